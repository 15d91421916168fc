//! The step behind the host: frames, attributes, results.

use crate::assembly::{Components, StackSheet};
use crate::checkpoint::Recorder;
use crate::inputs::{advised_size, bending_zones, read_boundary, read_motion};
use crate::local::Feedback;
use crate::parameters::Parameters;
use crate::penetration::{
    OVERLAP_BOUND, OVERLAP_PEAK_BOUND, Penetration, PenetrationPeak, too_deep_on_the_way,
};
use crate::press::PressLoad;
use crate::run::{Body, Forming, Outcome};
use crate::strain::ply_extremes;
use crate::watch::{DEPTH_BOUND, Kind, PairDepth, depth_attributes, depth_warnings};
use crate::writer::Writer;
use plyflow_abi::{PF_KIND_ELEMENT, PF_KIND_MATERIAL, pf_component};
use plyflow_mechanics::component::element_fields;
use plyflow_mechanics::contact::ContactEnergy;
use plyflow_mechanics::energy::SheetEnergy;
use plyflow_model::artifact::{self, MeshQuality, RigidBody, SheetBody};
use plyflow_model::scene::SheetKind;
use plyflow_sdk::{Host, Log, Progress, StepError};
use plyflow_tooling::FieldError;
use std::collections::BTreeMap;
use std::time::Instant;

struct HostComponents<'a>(&'a Host);

impl Components for HostComponents<'_> {
    fn element(&self, name: &str) -> Result<pf_component, String> {
        self.0
            .component(PF_KIND_ELEMENT, name)
            .map_err(|e| e.text().to_owned())
    }
    fn material(&self, name: &str) -> Result<pf_component, String> {
        self.0
            .component(PF_KIND_MATERIAL, name)
            .map_err(|e| e.text().to_owned())
    }
}

/// Runs the step.
///
/// # Errors
/// Whatever stops it, as a text for the user.
pub fn run(host: &Host) -> Result<(), StepError> {
    let mut p: Parameters = host.parameters()?;
    if let Some(size) = advised_size(host)? {
        host.log(
            Log::Info,
            &format!("element_size {:.3} mm, as advised", 1e3 * size),
        );
        p.element_size = size;
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(host.threads())
        .build()
        .map_err(|e| format!("starting {} threads: {e}", host.threads()))?;
    p.bending_zones = bending_zones(host, &p)?;
    pool.install(|| form(host, &p))
}

/// Tells how much of the plies bends, where that is not everything.
///
/// # Errors
/// When there are zones and no element lies in any.
fn tell_bending(host: &Host, forming: &Forming, p: &Parameters) -> Result<(), StepError> {
    let bending = |b: &Body| forming.model.bending_cells(b.sheet);
    let mixed = || forming.bodies.iter().filter_map(|b| Some((b, bending(b)?)));
    for (body, [cells, all]) in mixed() {
        let text = format!(
            "ply '{}': {cells} of {all} elements lie in zones and bend",
            body.name
        );
        host.log(Log::Info, &text);
    }
    if !p.bending_zones.is_empty() && mixed().all(|(_, [cells, _])| cells == 0) {
        return Err(
            "zones: given, but no element of a ply has its centre in one; expected zones of this scene, not smaller than \
             `element_size`"
                .into(),
        );
    }
    Ok(())
}

/// Tells the meshes of the tool and of a press's parts.
fn define_rigid(host: &Host, forming: &Forming) -> Result<(), StepError> {
    let about = RigidBody::ATTRIBUTES;
    let tool = &forming.tool;
    let triangles: Vec<u32> = tool.triangles.iter().flatten().copied().collect();
    host.define_mesh("tool", &tool.points, 3, &triangles, &about)?;
    for part in &forming.rigid {
        let cells = part.cells.as_flattened();
        host.define_mesh(&part.name, &part.points, 4, cells, &about)?;
    }
    Ok(())
}

fn form(host: &Host, p: &Parameters) -> Result<(), StepError> {
    host.progress(&Progress {
        phase: "building the model",
        ..Progress::default()
    });
    let components = HostComponents(host);
    let boundary = host.inputs_of("boundary")?;
    let feedback = host.inputs_of("feedback")?;
    if !(boundary.is_empty() || feedback.is_empty()) {
        return Err("give `boundary`, for the run of a zone, or `feedback`, for the whole scene again, not both".into());
    }
    let mut forming = match boundary.first() {
        None => crate::build_global(p, &components)?,
        Some(input) => crate::build_local(p, read_boundary(host, input, &p.scene)?, &components)?,
    };
    if let Some(what) = crate::assembly::slower_multipliers(&forming.model, p) {
        host.log(Log::Info, &what);
    }
    for what in long_process(&forming)
        .into_iter()
        .chain(unlike_films(&forming))
    {
        host.log(Log::Warn, &what);
    }
    if let Some(input) = feedback.first() {
        let (time, sheets) = read_motion(host, input)?;
        crate::local::feed_back(&mut forming, Feedback { time, sheets })?;
    }
    tell_bending(host, &forming, p)?;
    crate::absurd::check(p, &forming)?;
    let mut fields = Vec::new();
    for (body, sheet) in forming.bodies.iter().zip(&forming.stack) {
        let film = sheet.scene.kind == SheetKind::Diaphragm;
        let choice = if film {
            &p.diaphragm_element
        } else {
            &p.element
        };
        let found = host.component(PF_KIND_ELEMENT, &choice.plugin)?;
        let manifest = unsafe { found.manifest.as_str() }.unwrap_or("{}");
        let mut list = element_fields(manifest);
        if let Some(other) = p.element_elsewhere.as_ref().filter(|_| !film) {
            let found = host.component(PF_KIND_ELEMENT, &other.plugin)?;
            let others = element_fields(unsafe { found.manifest.as_str() }.unwrap_or("{}"));
            list.iter_mut().for_each(|f| f.find_elsewhere(&others));
        }
        if film {
            list.retain(|f| f.name == "principal_stretch");
        } else {
            list.retain(|f| f.name != "principal_stretch");
        }
        fields.push(list);
        define(host, &forming, body)?;
    }
    define_rigid(host, &forming)?;
    let started = Instant::now();
    let mut writer = Writer {
        host,
        frames: Recorder::new(host),
        fields,
        started,
        shown: started,
        cycle_shown: 0,
        first_cycle: 0,
    };
    let mut outcome = plyflow_mechanics::team::awake(|| forming.run(&p.control(), &mut writer))?;
    outcome
        .warnings
        .extend(forming.frictionless_folds(&p.scene));
    let own_cycles = outcome.cycles - writer.first_cycle;
    let rate = own_cycles as f64 / writer.started.elapsed().as_secs_f64().max(1e-9);
    write_history(host, &outcome, forming.load.press().is_some())?;
    write_energies(host, &forming, &outcome)?;
    write_summary(host, p, &forming, &outcome, rate)
}

fn define(host: &Host, forming: &Forming, body: &Body) -> Result<(), StepError> {
    let cells: Vec<u32> = body.cells.iter().flatten().copied().collect();
    let sheet = &forming.stack[body.sheet];
    let attributes = SheetBody {
        kind: sheet.scene.kind,
        thickness: sheet.thickness,
        offset: sheet.offset,
    };
    host.define_mesh(
        &body.name,
        &forming.reference_points(body),
        4,
        &cells,
        &attributes,
    )
}

fn write_history(host: &Host, outcome: &Outcome, press: bool) -> Result<(), StepError> {
    type Column = (
        &'static str,
        &'static str,
        fn(&crate::run::HistoryRow) -> f64,
    );
    let mut columns: Vec<Column> = vec![
        ("time", "s", |r| r.time),
        ("kinetic", "J", |r| r.ledger.kinetic),
        ("membrane", "J", |r| r.ledger.membrane),
        ("bending", "J", |r| r.ledger.bending),
        ("hourglass", "J", |r| r.ledger.hourglass),
        ("contact", "J", |r| r.ledger.contact),
        ("friction", "J", |r| r.ledger.friction),
        ("damping", "J", |r| r.ledger.damping),
        ("external", "J", |r| r.ledger.external),
        ("drift", "J", |r| r.ledger.drift()),
        ("cavity_pressure", "Pa", |r| r.cavity),
        ("bag_pressure", "Pa", |r| r.bag),
        ("frame_height", "m", |r| r.frame),
        ("time_step", "s", |r| r.time_step),
        ("critical_step", "s", |r| r.critical_step),
    ];
    if press {
        columns.push(("punch_force", "N", |r| r.punch_force));
        columns.push(("holder_travel", "m", |r| r.holder_travel));
    }
    for (name, unit, value) in columns {
        let data: Vec<f64> = outcome.history.iter().map(value).collect();
        host.write_f64(&format!("history/{name}"), &[data.len()], unit, &data)?;
    }
    Ok(())
}

/// Energies by sheet and by interface over the times of the history.
fn write_energies(host: &Host, forming: &Forming, outcome: &Outcome) -> Result<(), StepError> {
    type Of<T> = (&'static str, fn(&T) -> f64);
    let sheet: [Of<SheetEnergy>; 4] = [
        ("kinetic", |e| e.kinetic),
        ("membrane", |e| e.membrane),
        ("bending", |e| e.bending),
        ("hourglass", |e| e.hourglass),
    ];
    let interface: [Of<ContactEnergy>; 3] = [
        ("stored", |e| e.stored),
        ("friction", |e| e.friction),
        ("damping", |e| e.damping),
    ];
    let write = |path: String, data: Vec<f64>| host.write_f64(&path, &[data.len()], "J", &data);
    let rows = &outcome.history;
    for (k, s) in forming.model.sheets().iter().enumerate() {
        for (what, of) in sheet {
            let data = rows.iter().map(|r| r.sheets.get(k).map_or(0.0, of));
            write(format!("history/sheets/{}/{what}", s.name), data.collect())?;
        }
    }
    for (k, (name, _)) in forming.model.interface_energies().enumerate() {
        for (what, of) in interface {
            let data = rows.iter().map(|r| r.interfaces.get(k).map_or(0.0, of));
            write(format!("history/interfaces/{name}/{what}"), data.collect())?;
        }
    }
    for (k, d) in outcome.depths.iter().enumerate() {
        let data: Vec<f64> = (rows.iter())
            .map(|r| r.depths.get(k).copied().unwrap_or(0.0))
            .collect();
        if data.iter().all(|depth| *depth == 0.0) {
            continue;
        }
        let path = format!("history/depth/{}", d.pair.name);
        host.write_f64(&path, &[data.len()], "m", &data)?;
    }
    Ok(())
}

fn sheet_attributes(forming: &Forming, p: &Parameters) -> Vec<artifact::Sheet> {
    let sheets = forming.bodies.iter().zip(&forming.stack);
    sheets
        .map(|(body, s)| {
            let choice = match s.scene.kind {
                SheetKind::Diaphragm => &p.diaphragm_element,
                SheetKind::Ply => &p.element,
            };
            let added = forming.copies() * forming.model.sheets()[body.sheet].added_mass;
            let mut sheet = artifact::Sheet {
                material: Some(s.material.name.clone()),
                areal_mass: Some(s.material.areal_mass.si()),
                added_mass: Some(added),
                element: Some(choice.plugin.clone()),
                regions: crate::regions::attributes(&s.scene),
                mesh_quality: body.quality.as_ref().map(mesh_quality),
                ..artifact::Sheet::new(&body.name, s.scene.kind, s.thickness, s.offset)
            };
            if let Some([cells, _]) = forming.model.bending_cells(body.sheet) {
                let elsewhere = p.element_elsewhere.as_ref();
                sheet.element_elsewhere = elsewhere.map(|e| e.plugin.clone());
                sheet.bending_elements = Some(forming.model.planes().copies() * cells);
            }
            if let Ok(blank) = crate::assembly::blank(s) {
                let first = s.scene.fibre_1.si();
                let across = first + std::f64::consts::FRAC_PI_2;
                sheet.fibre_1 = Some(first);
                sheet.fibre_2 = Some(s.scene.fibre_2.map_or(across, |a| a.si()));
                sheet.outline = Some(blank.outline().to_vec());
                sheet.holes = blank.holes().to_vec();
            }
            sheet
        })
        .collect()
}

fn mesh_quality(q: &plyflow_blank::Quality) -> MeshQuality {
    MeshQuality {
        least_scaled_jacobian: q.least_scaled_jacobian,
        least_angle: q.least_angle,
        largest_angle: q.largest_angle,
        edge_ratio: q.edge_ratio,
        least_edge: q.least_edge,
        area_error: q.area_error,
        worst_at: q.worst_at,
    }
}

/// What is poor about the meshes of outlined plies.
fn mesh_warnings(forming: &Forming) -> Vec<String> {
    let poor = |b: &Body| {
        let text = b.quality.and_then(|q| q.warning())?;
        Some(format!("ply '{}': {text}", b.name))
    };
    forming.bodies.iter().filter_map(poor).collect()
}

/// Simulated time (s) beyond which a process is likely to have been given in the workshop's times.
const LONG: f64 = 20.0;

/// What to say of a process that takes very long.
fn long_process(forming: &Forming) -> Option<String> {
    let (duration, step) = (forming.load.duration(), forming.model.dt());
    (duration > LONG && forming.zone.is_none()).then(|| {
        format!(
            "the process takes {duration:.0} s of simulated time, {:.1e} steps of {:.2} us: the times of a scene are those in which inertia \
             matters no more (tenths of a second for most parts), not the workshop's; see the kinetic ratio of a run with shorter ones",
            duration / step,
            1e6 * step
        )
    })
}

/// Whether two films that are one sheet where they are joined are of one material.
fn unlike_films(forming: &Forming) -> Option<String> {
    let film = |s: &&StackSheet| s.scene.kind == SheetKind::Diaphragm;
    let lower = forming.stack.first().filter(film)?;
    let upper = forming.stack.last().filter(film)?;
    (lower.material != upper.material).then(|| {
        format!(
            "the films are of unlike materials, '{}' below and '{}' above; beyond the plies, where they are joined (`film_joint_margin`), both \
             are taken for the lower one: its stiffness and mass carry the span to the frame",
            lower.material.name, upper.material.name
        )
    })
}

/// Strain of the fibres of plies beyond which the run warns (thesis 3.4.1).
const LARGEST_FIBRE_STRAIN: f64 = 0.01;

/// All that a user should know of a run that came to its end.
fn warnings(forming: &Forming, outcome: &Outcome, now: &[Penetration]) -> Vec<String> {
    let mut warnings = mesh_warnings(forming);
    warnings.extend(forming.tool_warnings.iter().cloned());
    warnings.extend(outcome.warnings.iter().cloned());
    warnings.extend(depth_warnings(&outcome.depths));
    warnings.extend(now.iter().filter_map(Penetration::too_deep));
    warnings.extend(too_deep_on_the_way(now, &outcome.peaks));
    let (_, _, strain) = ply_extremes(forming);
    if strain > LARGEST_FIBRE_STRAIN {
        warnings.push(format!(
            "a fibre is strained by {:.1} %, more than {:.0} %: fibres of plies hardly stretch. Where it is (fibre_strain_1, fibre_strain_2) look for cells \
             that have gathered; where it is widespread raise the material's fibre_modulus, which asks for smaller steps",
            100.0 * strain,
            100.0 * LARGEST_FIBRE_STRAIN
        ));
    }
    if forming.load.press().is_some_and(PressLoad::holder_is_bare) {
        warnings.push(
            "the plies have left the holder, which its force has pressed against the die: make the blank larger or the stroke shorter, or give the holder a gap"
                .into(),
        );
    }
    warnings
}

/// Penetrations by pair, at the end and largest on the way.
fn penetration_attributes(
    now: &[Penetration],
    peaks: &[PenetrationPeak],
) -> BTreeMap<String, artifact::Penetration> {
    (now.iter().zip(peaks))
        .map(|(p, peak)| {
            let of = artifact::Penetration {
                max: p.largest,
                q999: p.q999,
                overlap: Some(p.overlap()),
                place: p.place,
                peak: Some(artifact::PenetrationPeak {
                    max: peak.largest,
                    max_time: peak.largest_time,
                    place: peak.place,
                    q999: peak.q999,
                    q999_time: peak.q999_time,
                    q999_place: peak.q999_place,
                    overlap: Some(p.overlap_of(peak.q999)),
                }),
            };
            (p.pair.clone(), of)
        })
        .collect()
}

/// By how much what contacts see of rigid parts differs from their triangles, and where.
fn field_error_attributes(forming: &Forming) -> BTreeMap<String, artifact::FieldError> {
    let of = |(part, e): &(&str, FieldError)| {
        let (max, place) = (e.largest, e.at);
        ((*part).to_owned(), artifact::FieldError { max, place })
    };
    forming.field_errors.iter().map(of).collect()
}

fn write_summary(
    host: &Host,
    p: &Parameters,
    forming: &Forming,
    outcome: &Outcome,
    rate: f64,
) -> Result<(), StepError> {
    let h = &outcome.health;
    let m = &forming.model;
    let penetrations = forming.penetrations();
    let warnings = warnings(forming, outcome, &penetrations);
    let elements = m.element_count();
    let element_cycles = elements as f64 * outcome.cycles as f64;
    for w in &warnings {
        host.log(Log::Warn, w);
    }
    host.write_attributes(&artifact::Forming {
        scene: Some(p.scene.name.clone()),
        sheets: sheet_attributes(forming, p),
        contact_by_place: true,
        symmetry: Some(crate::symmetry::mirror_planes(m.planes())),
        element_size: forming.element_size,
        net_spacing: None,
        zone: forming.zone.clone(),
        time_step: Some(outcome.smallest_step),
        cycles: Some(outcome.cycles),
        element_cycles: Some(element_cycles),
        elements: elements as u64,
        energy: Some(artifact::Energy {
            peak_drift_ratio: Some(h.peak_drift_ratio),
            peak_kinetic_ratio: Some(h.peak_kinetic_ratio),
            kinetic_bound_kept: Some(h.peak_kinetic_ratio <= p.kinetic_bound),
            hourglass_ratio: Some(h.hourglass_ratio),
        }),
        penetration: Some(penetration_attributes(&penetrations, &outcome.peaks)),
        overlap_bound: Some(OVERLAP_BOUND),
        overlap_peak_bound: Some(OVERLAP_PEAK_BOUND),
        tool_field_error: field_error_attributes(forming),
        depth: Some(depth_attributes(&outcome.depths)),
        depth_bound: Some(DEPTH_BOUND),
        warnings,
    })?;
    write_health(host, outcome, &penetrations)?;
    let errors = forming.field_errors.iter().map(|(_, e)| e.largest);
    host.result("tool_field_error", errors.fold(0.0, f64::max), "m")?;
    write_shape(host, forming)?;
    host.result("elements", elements as f64, "1")?;
    host.result("cycles", outcome.cycles as f64, "1")?;
    host.result("time_step", outcome.smallest_step, "s")?;
    if let Some(shift) = outcome.start_shift {
        host.result("start_shift", shift, "m")?;
    }
    host.result(
        "added_mass",
        forming.copies() * m.sheets().iter().map(|s| s.added_mass).sum::<f64>(),
        "kg",
    )?;
    for (name, part) in [
        ("contact_share", m.spent().contacts),
        ("element_share", m.spent().elements),
        ("node_share", m.spent().nodes),
        ("load_share", m.spent().loads),
    ] {
        if let Some(share) = m.spent().share(part) {
            host.measured(name, share, "1")?;
        }
    }
    host.measured("element_cycle_rate", elements as f64 * rate, "1/s")
}

/// How far to trust the run: energies and penetrations.
fn write_health(host: &Host, outcome: &Outcome, now: &[Penetration]) -> Result<(), StepError> {
    let h = &outcome.health;
    let worst = |f: fn(&Penetration) -> f64| now.iter().map(f).fold(0.0, f64::max);
    let peak = |f: fn(&Penetration, &PenetrationPeak) -> f64| {
        let pairs = now.iter().zip(&outcome.peaks);
        pairs.map(|(p, peak)| f(p, peak)).fold(0.0, f64::max)
    };
    host.result("kinetic_ratio", h.peak_kinetic_ratio, "1")?;
    host.result("drift_ratio", h.peak_drift_ratio, "1")?;
    host.result("hourglass_ratio", h.hourglass_ratio, "1")?;
    host.result("penetration_max", worst(|p| p.largest), "m")?;
    host.result("penetration_q999", worst(|p| p.q999), "m")?;
    host.result("overlap_ratio", worst(Penetration::overlap), "1")?;
    host.result("penetration_peak_max", peak(|_, k| k.largest), "m")?;
    host.result("penetration_peak_q999", peak(|_, k| k.q999), "m")?;
    host.result("overlap_peak_ratio", peak(|p, k| p.overlap_of(k.q999)), "1")?;
    let deepest = |f: fn(&PairDepth) -> f64, counts: fn(&PairDepth) -> bool| {
        let of = outcome.depths.iter().filter(|d| counts(d));
        of.map(f).fold(0.0, f64::max)
    };
    let nodes = |d: &PairDepth| d.pair.kind == Kind::Nodes;
    let plies = |d: &PairDepth| d.pair.kind == Kind::Nodes && d.pair.of_ply;
    host.result("depth", deepest(|d| d.end.depth, nodes), "m")?;
    host.result("depth_ratio", deepest(PairDepth::share, nodes), "1")?;
    host.result("depth_peak", deepest(|d| d.peak.deep.depth, nodes), "m")?;
    host.result(
        "depth_peak_ratio",
        deepest(PairDepth::peak_share, nodes),
        "1",
    )?;
    host.result("ply_depth_ratio", deepest(PairDepth::share, plies), "1")?;
    host.result(
        "ply_depth_peak_ratio",
        deepest(PairDepth::peak_share, plies),
        "1",
    )?;
    let of = |kind: Kind| move |d: &&PairDepth| d.pair.kind == kind;
    for (name, kind) in [("edge_depth", Kind::Edges), ("film_hang", Kind::Hangs)] {
        let ends = outcome.depths.iter().filter(of(kind)).map(|d| d.end.depth);
        host.result(name, ends.fold(0.0, f64::max), "m")?;
    }
    Ok(())
}

/// What the plies came to, and the quality of what they are meshed with.
fn write_shape(host: &Host, forming: &Forming) -> Result<(), StepError> {
    let outlined = || forming.bodies.iter().filter_map(|b| b.quality);
    if outlined().next().is_some() {
        let least =
            |f: fn(plyflow_blank::Quality) -> f64| outlined().map(f).fold(f64::INFINITY, f64::min);
        host.result(
            "mesh_scaled_jacobian",
            least(|q| q.least_scaled_jacobian),
            "1",
        )?;
        host.result("mesh_least_edge", least(|q| q.least_edge), "1")?;
    }
    let (lo, hi, strain) = ply_extremes(forming);
    host.result("shear_max", hi, "rad")?;
    host.result("shear_min", lo, "rad")?;
    host.result("fibre_strain_max", strain, "1")?;
    if forming.zone.is_none() {
        let ways = forming.draw_in();
        host.result("draw_in_max", ways.rim, "m")?;
        host.result("corner_draw_in_max", ways.corner, "m")?;
    }
    Ok(())
}
