//! The step behind the host: from its inputs to its artifact.

use crate::build::{build_global, build_local, feed_back};
use crate::error::{FormingError, Result};
use crate::forming::Forming;
use crate::judge::absurd;
use crate::output::{
    Writer, at_the_start, define, define_rigid, fields_of, slower_multipliers, write_energies,
    write_history, write_summary,
};
use crate::request::{
    Feedback, Parameters, advised_size, bending_zones, read_boundary, read_motion,
};
use crate::stack::{Body, Components};
use plyflow_abi::{PF_KIND_ELEMENT, PF_KIND_MATERIAL, pf_component};
use plyflow_mechanics::team;
use plyflow_sdk::{Host, Log, Progress};
use plyflow_tooling::{given, of_step};

struct HostComponents<'a>(&'a Host);

// SAFETY: a host gives tables of the kind that it is asked for, valid until the process ends; its texts are valid until `run` returns, which the
// `Host` does not outlive (plyflow.h).
unsafe impl Components for HostComponents<'_> {
    fn element(&self, name: &str) -> Result<pf_component> {
        Ok(self.0.component(PF_KIND_ELEMENT, name)?)
    }
    fn material(&self, name: &str) -> Result<pf_component> {
        Ok(self.0.component(PF_KIND_MATERIAL, name)?)
    }
}

/// Runs the step.
pub fn run(host: &Host) -> Result<()> {
    let mut p: Parameters = host.parameters()?;
    of_step::read(host, &mut p.scene)?;
    if let Some(size) = advised_size(host)? {
        let text = format!("element_size {:.3} mm, as advised", 1e3 * size);
        host.log(Log::Info, &text);
        p.element_size = size;
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(host.threads())
        .build()
        .map_err(|e| FormingError::Run(format!("starting {} threads: {e}", host.threads())))?;
    p.bending_zones = bending_zones(host, &p)?;
    pool.install(|| {
        let mut forming = build(host, &p)?;
        form(host, &p, &mut forming)
    })
}

/// The model that is asked for: of the whole scene, driven in parts by what finer runs fed back or not, or of a zone.
fn build(host: &Host, p: &Parameters) -> Result<Forming> {
    host.progress(&Progress {
        phase: "building the model",
        ..Progress::default()
    });
    let components = HostComponents(host);
    let boundary = host.inputs_of("boundary")?;
    let feedback = host.inputs_of("feedback")?;
    if !(boundary.is_empty() || feedback.is_empty()) {
        let text = "give `boundary`, for the run of a zone, or `feedback`, for the whole scene again, not both";
        return Err(FormingError::Input(text.into()));
    }
    let mut forming = match boundary.first() {
        None => build_global(p, &components)?,
        Some(input) => build_local(p, read_boundary(host, input, &p.scene)?, &components)?,
    };
    if let Some(what) = slower_multipliers(&forming, p) {
        host.log(Log::Info, &what);
    }
    if let Some(placement) = &forming.placement {
        host.log(Log::Info, &given::placement_told(placement));
    }
    for what in forming.load.stamping().iter().flat_map(|s| &s.stops) {
        host.log(Log::Info, what);
    }
    for what in at_the_start(&forming) {
        host.log(Log::Warn, &what);
    }
    if let Some(input) = feedback.first() {
        let (time, sheets) = read_motion(host, input)?;
        feed_back(&mut forming, Feedback { time, sheets })?;
    }
    tell_bending(host, &forming, p)?;
    absurd::check(p, &forming)?;
    Ok(forming)
}

/// Tells how much of the plies bends, where that is not everything.
fn tell_bending(host: &Host, forming: &Forming, p: &Parameters) -> Result<()> {
    let bending = |b: &Body| forming.model.bending_cells(b.sheet.0);
    let mixed = || forming.bodies.iter().filter_map(|b| Some((b, bending(b)?)));
    for (body, [cells, all]) in mixed() {
        let name = &body.name;
        let text = format!("ply '{name}': {cells} of {all} elements lie in zones and bend");
        host.log(Log::Info, &text);
    }
    if !p.bending_zones.is_empty() && mixed().all(|(_, [cells, _])| cells == 0) {
        let text = "zones: given, but no element of a ply has its centre in one; expected zones of this scene, not smaller than \
                    `element_size`";
        return Err(FormingError::Input(text.into()));
    }
    Ok(())
}

/// Runs the model and writes what comes of it.
fn form(host: &Host, p: &Parameters, forming: &mut Forming) -> Result<()> {
    let mut fields = Vec::new();
    for (body, sheet) in forming.bodies.iter().zip(&forming.stack) {
        fields.push(fields_of(host, sheet.scene.kind, p)?);
        define(host, forming, body, sheet)?;
    }
    define_rigid(host, forming)?;
    let mut writer = Writer::new(host, fields);
    let mut outcome = team::awake(|| forming.run(&p.control(), &mut writer))?;
    (outcome.warnings).extend(forming.frictionless_folds(&p.scene));
    let rate = writer.rate(outcome.cycles);
    write_history(host, forming, &outcome)?;
    write_energies(host, forming, &outcome)?;
    write_summary(host, p, forming, &outcome, rate)
}
