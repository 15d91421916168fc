//! What a user should know of a run.

use crate::course::Outcome;
use crate::forming::Forming;
use crate::load::{PressLoad, StampingLoad};
use crate::measure::{Penetration, ply_strains, tie_stretch, too_deep_on_the_way, untied};
use crate::request::Parameters;
use crate::stack::{Body, StackSheet};
use crate::watch::depth_warnings;

/// What to say before the first step.
pub fn at_the_start(forming: &Forming) -> impl Iterator<Item = String> {
    long_process(forming)
        .into_iter()
        .chain(unlike_films(forming))
        .chain(heavy_or_light(forming))
}

/// Densities (kg/m3) of sheets, their areal mass over their thickness, from lofty veils to metal: what lies outside has a wrong unit.
const DENSITIES: [f64; 2] = [20.0, 2e4];

/// Materials that have the density of nothing that is formed.
fn heavy_or_light(forming: &Forming) -> Vec<String> {
    let mut told = Vec::new();
    for sheet in &forming.stack {
        let mass = sheet.material.areal_mass.si();
        let density = mass / sheet.thickness;
        if (DENSITIES[0]..=DENSITIES[1]).contains(&density) {
            continue;
        }
        let text = format!(
            "the material '{}' has {mass} kg/m2 at a thickness of {} mm, which is {density:.3e} kg/m3; fabrics have 200 to 3000: look at the units of \
             `areal_mass` and `thickness`",
            sheet.material.name,
            1e3 * sheet.thickness
        );
        if !told.contains(&text) {
            told.push(text);
        }
    }
    told
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
    let film = |s: &&StackSheet| !s.is_ply();
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

/// How far (over the length of an element) ties may give way without a word: what plies slide by is seen to within an element's length.
const TIES_GIVE: f64 = 0.1;

/// All that a user should know of a run that came to its end.
pub fn warnings(forming: &Forming, outcome: &Outcome, now: &[Penetration]) -> Vec<String> {
    let mut warnings = mesh_warnings(forming);
    warnings.extend(forming.tool_warnings.iter().cloned());
    warnings.extend(outcome.warnings.iter().cloned());
    warnings.extend(depth_warnings(&outcome.depths));
    warnings.extend(now.iter().filter_map(Penetration::too_deep));
    warnings.extend(too_deep_on_the_way(now, &outcome.peaks));
    warnings.extend(untied(forming));
    warnings.extend(stretched_ties(forming));
    let strain = ply_strains(forming).fibre;
    if strain > LARGEST_FIBRE_STRAIN {
        warnings.push(format!(
            "a fibre is strained by {:.1} %, more than {:.0} %: fibres of plies hardly stretch. Where it is (fibre_strain_1, fibre_strain_2) look for cells \
             that have gathered; where it is widespread raise the material's fibre_modulus, which asks for smaller steps",
            100.0 * strain,
            100.0 * LARGEST_FIBRE_STRAIN
        ));
    }
    // Of a zone most parts are elsewhere.
    let stamping = forming.load.stamping().filter(|_| forming.zone.is_none());
    warnings.extend(stamping.into_iter().flat_map(StampingLoad::never_touched));
    if forming.load.press().is_some_and(PressLoad::holder_is_bare) {
        warnings.push(
            "the plies have left the holder, which its force has pressed against the die: make the blank larger or the stroke shorter, or give the holder a gap"
                .into(),
        );
    }
    warnings
}

/// Ties are springs: what they give way by is told where it counts.
fn stretched_ties(forming: &Forming) -> Option<String> {
    let [stretch, share] = tie_stretch(forming)?;
    (share > TIES_GIVE).then(|| {
        format!(
            "a node of tied plies is {:.2} mm from the point that it was laid on, {:.0} % of an element: ties are springs, which the step allows to be only so \
             stiff. Take a smaller `time_step`: with half of it they are four times as stiff",
            1e3 * stretch,
            100.0 * share
        )
    })
}

/// What to tell where contacts' multipliers grow more slowly than asked for.
pub fn slower_multipliers(forming: &Forming, p: &Parameters) -> Option<String> {
    let asked = p.contact_augmentation;
    let taken = forming.model.contact_augmentation();
    if taken <= 0.0 && asked > 0.0 {
        return Some(format!(
            "contact_augmentation is 0 instead of {asked:.2e}: without damping of contacts (contact_damping: {}) multipliers would feed every \
             motion, so pressure is borne by the penalty alone, at larger penetrations",
            p.contact_damping
        ));
    }
    (taken > 0.0 && taken < asked).then(|| {
        format!(
            "contact_augmentation is {taken:.2e} instead of {asked:.2e}: some sheets have far more mass in a node than those they touch, \
             and would tremble"
        )
    })
}
