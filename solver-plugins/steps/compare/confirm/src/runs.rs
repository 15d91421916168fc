//! Reading the runs: those that are confirmed, and those of the variants.

use plyflow_defects::{Ply, Settings, Tool, of_run};
use plyflow_model::artifact::{Forming, Rectangle, Variation, Zone, Zones, current_zones};
use plyflow_sdk::{Host, Input, Log, StepError};
use plyflow_surface::of_run::check_quads;

/// Elements of a finer run are smaller by this share at least.
const LEAST_FINER: f64 = 0.05;
/// The step of a run with a smaller one is at most this share of the first.
const MOST_OF_STEP: f64 = 0.75;
/// Elements of a whole that judges the bounds are at most this share of those of the zones.
const MOST_OF_REFERENCE: f64 = 0.6;
/// Boxes may differ by this (m), however they were rounded.
const ROUNDING: f64 = 1e-6;

/// A fine run of a zone.
pub struct Run {
    /// Name of its step.
    pub step: String,
    /// Its zone.
    pub zone: Zone,
    /// Its plies, from the tool upwards.
    pub plies: Vec<Ply>,
    /// Mean edge of the plies' elements in the flat ply (m).
    pub element_size: f64,
    /// The smallest step in time (s), if it tells it.
    time_step: Option<f64>,
    /// How many times slower than the scene says its process goes on.
    slower: f64,
}

/// The runs of a variant.
pub struct OfVariant {
    /// In what it differs.
    pub variant: Variation,
    /// By zone that is confirmed: indices of its runs that look there, the coarsest first.
    pub of_zone: Vec<Vec<usize>>,
    /// All of them.
    pub runs: Vec<Run>,
}

impl OfVariant {
    /// Names of its steps, each once, in their order.
    pub fn steps(&self) -> Vec<String> {
        let mut steps: Vec<String> = Vec::new();
        for run in &self.runs {
            if !steps.contains(&run.step) {
                steps.push(run.step.clone());
            }
        }
        steps
    }
}

/// What is confirmed, and what it is held against.
pub struct All {
    /// The zones.
    pub zones: Vec<Zone>,
    /// Their runs, one for each.
    pub base: Vec<Run>,
    /// The variants that were run.
    pub variants: Vec<OfVariant>,
    /// The whole by which the bounds are judged.
    pub reference: Option<Whole>,
}

/// The whole in smaller elements.
pub struct Whole {
    /// Name of its step.
    pub step: String,
    /// Its plies, from the tool upwards.
    pub plies: Vec<Ply>,
    /// Mean edge of their elements in the flat ply (m).
    pub element_size: f64,
}

/// Reads everything.
///
/// # Errors
/// When a run or the tool cannot be read, a zone has no run or two, or a variant is none of what is confirmed.
pub fn read(host: &Host, settings: &Settings) -> Result<All, StepError> {
    let mut zones = Vec::new();
    for input in host.inputs_of("zones")? {
        zones.extend(host.attributes::<Zones>(&input)?.zones);
    }
    let (zones, superseded) = current_zones(zones);
    let tool = of_run::tool(host, &host.input("global")?)?;
    let (base, _) = of_port(host, "local", &tool, settings, &superseded)?;
    let base = one_each(&zones, base)?;
    let (mut variants, mut given) = (Vec::new(), Vec::new());
    for variant in Variation::ALL {
        let (runs, left_out) = of_port(host, variant.name(), &tool, settings, &superseded)?;
        if runs.is_empty() && !left_out {
            continue;
        }
        given.push(variant.name());
        variants.extend(of_variant(host, variant, runs, &zones, &base)?);
    }
    if variants.is_empty() && !given.is_empty() {
        return Err(format!(
            "none of the runs at {} differs from those of `local` in what it is given for (see above): nothing can be confirmed",
            given.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
        )
        .into());
    }
    if variants.is_empty() && !zones.is_empty() {
        return Err("nothing is given to hold the runs of `local` against; expected runs of the same zones at one of the inputs `finer`, `slower`, `half_step` and `wider`".into());
    }
    let reference = whole(host, &tool, settings, &base)?;
    Ok(All {
        zones,
        base,
        variants,
        reference,
    })
}

/// The whole by which the bounds are judged, if one is given; told where its elements are too large for that.
fn whole(
    host: &Host,
    tool: &Tool,
    settings: &Settings,
    base: &[Run],
) -> Result<Option<Whole>, StepError> {
    let Some(input) = host.inputs_of("reference")?.into_iter().next() else {
        return Ok(None);
    };
    let formed: Forming = host.attributes(&input)?;
    let step = input.step.clone();
    if let Some(zone) = &formed.zone {
        return Err(format!(
            "`reference`: '{step}' is a run of zone {}; expected a run of the whole scene",
            zone.name
        )
        .into());
    }
    let (plies, element_size) = read_plies(host, &input, &formed, tool, settings)?;
    if plies.is_empty() {
        return Err(format!("`reference`: '{step}' has no ply").into());
    }
    let finest = base
        .iter()
        .map(|r| r.element_size)
        .fold(f64::INFINITY, f64::min);
    if element_size > MOST_OF_REFERENCE * finest {
        let mm = |m: f64| (1e6 * m).round() / 1e3;
        let text = format!(
            "`reference`: the elements of '{step}' are {} mm, those of the zones {} mm: it judges their bounds only where they are about half as large",
            mm(element_size),
            mm(finest)
        );
        host.log(Log::Warn, &text);
    }
    Ok(Some(Whole {
        step,
        plies,
        element_size,
    }))
}

/// The runs at a port, without those of zones that others replace; and whether there were such.
fn of_port(
    host: &Host,
    port: &str,
    tool: &Tool,
    settings: &Settings,
    superseded: &[Zone],
) -> Result<(Vec<Run>, bool), StepError> {
    let (mut runs, mut left_out) = (Vec::new(), false);
    for input in host.inputs_of(port)? {
        host.check_cancelled()?;
        let run = read_run(host, &input, port, tool, settings)?;
        if superseded.iter().any(|z| z.is(&run.zone)) {
            left_out = true;
        } else {
            runs.push(run);
        }
    }
    Ok((runs, left_out))
}

fn read_run(
    host: &Host,
    input: &Input,
    port: &str,
    tool: &Tool,
    settings: &Settings,
) -> Result<Run, StepError> {
    let formed: Forming = host.attributes(input)?;
    let step = &input.step;
    let zone = formed.zone.clone().ok_or_else(|| {
        format!("`{port}`: '{step}' is no run of a zone (its attribute `zone` is null); expected the fine runs of zones")
    })?;
    let (plies, element_size) = read_plies(host, input, &formed, tool, settings)?;
    if plies.is_empty() {
        return Err(format!("`{port}`: '{step}' has no ply in zone {}", zone.name).into());
    }
    Ok(Run {
        step: step.clone(),
        zone,
        plies,
        element_size,
        time_step: formed.time_step,
        slower: formed.slower.unwrap_or(1.0),
    })
}

/// The plies of a run that have cells, from the tool upwards, and the mean edge of their elements in the flat ply (m).
fn read_plies(
    host: &Host,
    input: &Input,
    formed: &Forming,
    tool: &Tool,
    settings: &Settings,
) -> Result<(Vec<Ply>, f64), StepError> {
    let meshes = host.meshes(input)?;
    let frame = of_run::last_frame(input, &meshes)?;
    let own = match meshes.body("tool") {
        Ok(_) => Some(of_run::tool(host, input)?),
        Err(_) => None,
    };
    let (mut plies, mut area, mut cells) = (Vec::new(), 0.0, 0);
    for sheet in formed.plies() {
        let name = format!("ply '{}' of '{}'", sheet.name, input.step);
        check_quads(&name, meshes.body(&sheet.name)?)?;
        let of = of_run::Frame { host, input, frame };
        let place = (sheet.name.as_str(), sheet.offset);
        let tool = own.as_ref().unwrap_or(tool);
        let ply = of_run::ply(of, place, tool, settings.foot_margin)?;
        let areas = ply.topology.cell_areas(&ply.undeformed);
        area += areas.iter().sum::<f64>();
        cells += areas.len();
        plies.push(ply);
    }
    if cells == 0 {
        plies.clear();
    }
    Ok((plies, (area / cells.max(1) as f64).sqrt()))
}

/// The one run of each zone, in their order.
fn one_each(zones: &[Zone], runs: Vec<Run>) -> Result<Vec<Run>, StepError> {
    let mut found: Vec<Option<Run>> = zones.iter().map(|_| None).collect();
    for run in runs {
        let name = &run.zone.name;
        let Some(place) = zones.iter().position(|z| z.is(&run.zone)) else {
            let names: Vec<&str> = zones.iter().map(|z| z.name.as_str()).collect();
            return Err(format!(
                "`local`: '{}' is of zone {name} (or of a box that no zone of that name has); the zones are: {}",
                run.step,
                names.join(", ")
            )
            .into());
        };
        if let Some(first) = &found[place] {
            return Err(format!(
                "`local`: '{}' and '{}' are both of zone {name}; expected one run of each zone: give that of the last pass alone",
                first.step, run.step
            )
            .into());
        }
        found[place] = Some(run);
    }
    let missing = |(zone, run): (&Zone, Option<Run>)| {
        run.ok_or_else(|| {
            format!(
                "`local`: no run of zone {} arrives; expected one of each zone",
                zone.name
            )
            .into()
        })
    };
    zones.iter().zip(found).map(missing).collect()
}

/// Whether a box lies in another one.
fn lies_in(inner: Rectangle, outer: Rectangle) -> bool {
    let beyond = |k: usize| (inner[k] - outer[k]) * [1.0, 1.0, -1.0, -1.0][k];
    (0..4).all(|k| beyond(k) > -ROUNDING)
}

/// Finds out which run of a variant looks where. `None`: in no zone is it what it is given as, so that it says nothing.
fn of_variant(
    host: &Host,
    variant: Variation,
    runs: Vec<Run>,
    zones: &[Zone],
    base: &[Run],
) -> Result<Option<OfVariant>, StepError> {
    let port = variant.name();
    let looks_at = |run: &Run, zone: &Zone| match variant {
        Variation::Wider => lies_in(zone.bounds, run.zone.bounds),
        _ => run.zone.is(zone),
    };
    if let Some(stray) = runs.iter().find(|r| zones.iter().all(|z| !looks_at(r, z))) {
        let (step, zone) = (&stray.step, &stray.zone);
        return Err(format!(
            "`{port}`: '{step}' is of zone {} with the box {:?} m, which is none of the zones of `zones`; expected runs of these zones",
            zone.name, zone.bounds
        )
        .into());
    }
    let (mut of_zone, mut differs) = (Vec::new(), zones.is_empty());
    for (zone, own) in zones.iter().zip(base) {
        let mut here: Vec<usize> = (0..runs.len())
            .filter(|&k| looks_at(&runs[k], zone))
            .collect();
        here.sort_by(|&a, &b| {
            runs[b]
                .element_size
                .total_cmp(&runs[a].element_size)
                .then(a.cmp(&b))
        });
        if here.is_empty() {
            return Err(format!(
                "`{port}`: no run looks at zone {}; expected one for each zone of `zones`",
                zone.name
            )
            .into());
        }
        if variant == Variation::Finer {
            is_finer(own, &here, &runs)?;
        } else if here.len() > 1 {
            let names: Vec<&str> = here.iter().map(|&k| runs[k].step.as_str()).collect();
            return Err(format!(
                "`{port}`: {} runs look at zone {} ({}); expected one",
                here.len(),
                zone.name,
                names.join(", ")
            )
            .into());
        }
        differs |= !tell_same(host, variant, own, &runs[here[0]]);
        of_zone.push(here);
    }
    Ok(differs.then_some(OfVariant {
        variant,
        of_zone,
        runs,
    }))
}

/// That each of the finer runs of a zone is finer than the one before, and the first than that which is confirmed.
fn is_finer(base: &Run, here: &[usize], runs: &[Run]) -> Result<(), StepError> {
    let mut before = base;
    for run in here.iter().map(|&k| &runs[k]) {
        if run.element_size > (1.0 - LEAST_FINER) * before.element_size {
            let mm = |r: &Run| (1e6 * r.element_size).round() / 1e3;
            return Err(format!(
                "`finer`: the elements of '{}' of zone {} are {} mm, those of '{}' {} mm; expected elements that are smaller by {} % or more: give a larger `finer` to its \
                 boundary-interpolation",
                run.step,
                run.zone.name,
                mm(run),
                before.step,
                mm(before),
                100.0 * LEAST_FINER
            )
            .into());
        }
        before = run;
    }
    Ok(())
}

/// Tells where a variant is not what it is given as; whether it is so.
fn tell_same(host: &Host, variant: Variation, base: &Run, run: &Run) -> bool {
    let zone = &base.zone.name;
    let text = match (variant, base.time_step, run.time_step) {
        (Variation::HalfStep, Some(first), Some(own)) if own > MOST_OF_STEP * first => format!(
            "`half_step`: the step of '{}' of zone {zone} is {own:.3e} s, that of '{}' {first:.3e} s: that says little of the step. Give half of `time_step`",
            run.step, base.step
        ),
        (Variation::Slower, _, _) if run.slower <= base.slower => format!(
            "`slower`: the process of '{}' of zone {zone} goes on as fast as that of '{}': that says nothing of the speed. Give `slower: 2` to its boundary-interpolation",
            run.step, base.step
        ),
        (Variation::Wider, _, _) if run.zone.has_box(base.zone.bounds) => format!(
            "`wider`: zone {zone} is no wider in '{}' than in '{}': that says nothing of the margin. Give `wider: 2` to its zone-extraction, if the zone does not fill the blank",
            run.step, base.step
        ),
        _ => return false,
    };
    host.log(Log::Warn, &text);
    true
}
