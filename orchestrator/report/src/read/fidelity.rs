//! Speed against error: what the ways of a study cost, how far they are from its reference, and which are on the Pareto front.

mod advice;
mod by_size;
mod measure;
mod way;

pub use advice::{TARGETS, advice};
pub use by_size::OfClass;
pub use measure::Measure;
pub use way::{COUNTS, Way, Ways};

use crate::input::{Instance, ReportInput};

/// The ways of all comparisons with a reference, those of one reference together; one of equal cost and errors is told once. Where there is none,
/// those of the comparison whose fine runs cost most. Costs are those of the runs' records, as `comparison` reports them.
#[must_use]
pub fn ways(input: &ReportInput) -> Ways {
    let compared = (input.instances.iter()).filter(|i| i.record.kind == "comparison");
    let has = |i: &&Instance| value(i, "cost.reference.cpu_seconds").is_some_and(|w| w > 0.0);
    let mut with: Vec<&Instance> = compared.clone().filter(has).collect();
    let of_the_whole = !with.is_empty();
    if !of_the_whole {
        let total = |i: &Instance| value(i, TOTAL).unwrap_or(0.0);
        // Told whenever something was measured, also where nobody has a defect.
        let refined = compared.filter(|i| value(i, "missed_wrinkles.global").is_some());
        with.extend(refined.max_by(|a, b| total(a).total_cmp(&total(b))));
    }
    let named = with.len() > 1;
    // A reference is told by what it cost: a run has the same cost in whatever it takes part.
    let run = |i: &Instance| {
        let told = ["cost.reference.cpu_seconds", "start_time.reference"].map(|n| value(i, n));
        told.map(|v| v.map(f64::to_bits))
    };
    let mut groups: Vec<(_, Vec<&Instance>)> = Vec::new();
    for instance in with {
        match groups.iter_mut().find(|g| g.0 == run(instance)) {
            Some(group) => group.1.push(instance),
            None => groups.push((run(instance), vec![instance])),
        }
    }
    let one = |(_, instances): &(_, Vec<&Instance>)| {
        let measured_by = instances[0].label();
        let ways = |i: &&Instance| of(i, named, &measured_by);
        let mut list: Vec<Way> = instances.iter().flat_map(ways).collect();
        let first = |w: &Way| w.errors[0].unwrap_or(f64::INFINITY);
        list.sort_by(|a, b| {
            let by_cost = a.cpu_seconds.total_cmp(&b.cpu_seconds);
            by_cost.then(first(a).total_cmp(&first(b)))
        });
        list.dedup_by(|a, b| a.cpu_seconds == b.cpu_seconds && a.errors == b.errors);
        if groups.len() > 1 {
            let reference = list.iter_mut().filter(|w| w.is_reference);
            reference.for_each(|w| w.name = format!("{measured_by}: reference"));
        }
        let mut ways = Ways { list, of_the_whole };
        ways.mark_fronts();
        ways.list
    };
    Ways {
        list: groups.iter().flat_map(one).collect(),
        of_the_whole,
    }
}

const TOTAL: &str = "cost.total.cpu_seconds";

fn value(instance: &Instance, name: &str) -> Option<f64> {
    let mut results = instance.record.results.iter();
    results.find(|r| r.name == name).map(|r| r.value)
}

/// A way of a comparison, without its name, by its model there and what the results of its errors end with (none: it is the reference).
/// `whole`: the CPU time that its own is held against (s).
fn one(instance: &Instance, model: &str, suffix: Option<&str>, whole: f64) -> Option<Way> {
    let value = |name: &str| value(instance, name);
    let cpu_seconds = value(&format!("cost.{model}.cpu_seconds"))?;
    let measured = |name: &str| value(&format!("{name}{}", suffix?));
    let counts = COUNTS.map(measured);
    let errors = match suffix {
        Some(_) => Measure::ALL.map(|m| measured(m.result())),
        None => [Some(0.0); Measure::COUNT],
    };
    // A reference without defects leaves the other errors to be told.
    if errors.iter().chain(&counts).all(Option::is_none) {
        return None;
    }
    let all_counts = counts.iter().all(Option::is_some);
    Some(Way {
        comparison: instance.label(),
        model: model.to_owned(),
        name: String::new(),
        cpu_seconds,
        wall_seconds: value(&format!("cost.{model}.wall_seconds"))?,
        peak_memory: value(&format!("peak_memory.{model}")),
        share: cpu_seconds / whole,
        errors,
        counts: all_counts.then(|| counts.map(Option::unwrap_or_default)),
        classes: suffix.map_or(Vec::new(), |s| by_size::classes(value, s)),
        is_reference: suffix.is_none(),
        measured_by: String::new(),
        start_time: value(&format!("start_time.{model}")),
        on_front: [false; Measure::COUNT],
    })
}

/// The ways of one comparison, `named` after it or not.
fn of(instance: &Instance, named: bool, measured_by: &str) -> Vec<Way> {
    let value = |name: &str| value(instance, name);
    let reference = value("cost.reference.cpu_seconds");
    let Some(whole) = reference.or(value(TOTAL)).filter(|w| *w > 0.0) else {
        return Vec::new();
    };
    let label = |what: &str| {
        if named {
            format!("{}: {what}", instance.label())
        } else {
            what.to_owned()
        }
    };
    let way = |name: String, model: &str, suffix: Option<&str>| {
        let way = Way {
            name,
            measured_by: measured_by.to_owned(),
            ..one(instance, model, suffix, whole)?
        };
        Some(way)
    };
    let coarse = match value("passes") {
        Some(_) => "coarse run of the last pass",
        None => "coarse run alone",
    };
    let mut ways = vec![way(label(coarse), "global", Some(".global"))];
    for result in &instance.record.results {
        let other = result.name.strip_prefix("cost.other.");
        if let Some(step) = other.and_then(|r| r.strip_suffix(".cpu_seconds")) {
            let model = format!("other.{step}");
            ways.push(way(label(step), &model, Some(&format!(".{model}"))));
        }
    }
    let both = label("coarse run and zones");
    if reference.is_some() {
        ways.push(way(both, "total", Some("")));
        ways.push(way("reference".to_owned(), "reference", None));
    } else {
        ways.push(way(both, "total", None));
    }
    ways.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests;
