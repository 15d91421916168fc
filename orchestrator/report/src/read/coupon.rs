//! A coupon as a run: it has the histories and the energies of a forming run.

use crate::input::Instance;
use crate::read::carried::CARRIED;
use crate::read::facts::Facts;
use crate::read::history::History;
use crate::read::study::Run;
use plyflow_model::artifact::{Coupon, ElementCount, Forming};
use serde::Deserialize;

/// What a coupon tells besides what it carries, which is read entry by entry.
fn coupon(facts: &Facts, wrong: &mut Vec<String>) -> Coupon {
    let mut told = facts.attributes.clone();
    if let Some(told) = told.as_object_mut() {
        told.retain(|key, _| !CARRIED.contains(&key.as_str()));
    }
    Coupon::deserialize(told).unwrap_or_else(|e| {
        wrong.push(format!("its attributes: {e}"));
        Coupon::default()
    })
}

/// The run of a coupon that is the instance `at`; `None` when it has no energies.
pub(crate) fn run(
    instance: &Instance,
    at: usize,
    facts: &Facts,
    wrong: &mut Vec<String>,
) -> Option<Run> {
    let history = History::read(&instance.artifact)
        .map_err(|e| wrong.push(e.to_string()))
        .ok()?;
    history.internal()?;
    let told = coupon(facts, wrong);
    let elements = told.elements.map_or(0, ElementCount::all);
    let cycles = told.cycles.unwrap_or(0);
    Some(Run {
        label: instance.label(),
        instance: at,
        key: instance.record.key.clone(),
        facts: Forming {
            energy: told.energy,
            element_size: told.element_size.unwrap_or(0.0),
            element_cycles: Some(elements as f64 * cycles as f64),
            elements,
            cycles: Some(cycles),
            ..Forming::default()
        },
        kinetic_bound: facts.kinetic_bound(),
        history,
    })
}
