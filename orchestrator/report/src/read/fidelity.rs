//! Speed against error: what the ways of a study cost, how far they are from its reference, and which are on the Pareto front.

use crate::input::{Instance, ReportInput};

/// A measure of how wrong a way is: a result of `comparison`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measure {
    /// Mean error of the reference's defects and of false ones, a missed and a false one counting as 1.
    Defects,
    /// Mean relative error of the lengths of wrinkles that both have.
    Length,
    /// The same of their amplitudes.
    Amplitude,
    /// Mean relative error of the areas of bridging that both have.
    BridgingArea,
    /// Root mean square distance of material points from where the reference has them (m).
    Position,
    /// Root mean square difference of the distance from the tool (m).
    Distance,
    /// Largest difference of the quantiles of the shear angle (rad).
    Shear,
}

impl Measure {
    /// All, in the order of [`Way::errors`] and [`Way::on_front`].
    pub const ALL: [Self; 7] = [
        Self::Defects,
        Self::Length,
        Self::Amplitude,
        Self::BridgingArea,
        Self::Position,
        Self::Distance,
        Self::Shear,
    ];

    /// Name of the result that holds it, without the model.
    #[must_use]
    pub fn result(self) -> &'static str {
        match self {
            Self::Defects => "defect_error",
            Self::Length => "wrinkle_length_error",
            Self::Amplitude => "wrinkle_amplitude_error",
            Self::BridgingArea => "bridging_area_error",
            Self::Position => "position_error",
            Self::Distance => "distance_error",
            Self::Shear => "shear_quantile_error",
        }
    }

    /// Its SI unit.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::Position | Self::Distance => "m",
            Self::Shear => "rad",
            _ => "1",
        }
    }
}

/// A way to the answer: the coarse run alone, another run of the whole, fine runs of its zones, or the reference.
#[derive(Debug, Clone, PartialEq)]
pub struct Way {
    /// Label of the comparison that measured it.
    pub comparison: String,
    /// Its model in the names of that step's results: `global`, `other.drape`, `total` (coarse run and zones), `reference`.
    pub model: String,
    /// Name for people; with the comparison when there are several.
    pub name: String,
    /// CPU time (s).
    pub cpu_seconds: f64,
    /// Wall time (s).
    pub wall_seconds: f64,
    /// Peak memory of its largest run (bytes).
    pub peak_memory: Option<f64>,
    /// CPU time over that of the reference.
    pub share: f64,
    /// By [`Measure::ALL`], SI; absent when nothing was there to compare. Those of the reference are 0.
    pub errors: [Option<f64>; 7],
    /// Missed and false wrinkles, missed and false bridging; absent for the reference.
    pub counts: Option<[f64; 4]>,
    /// Whether it measures the others.
    pub is_reference: bool,
    /// What it is measured by, and whose costs its own is held against: the reference of this comparison, the first of those that have it. Only ways of one
    /// are held against each other.
    pub measured_by: String,
    /// When it began, if that was late (s): what came before is not in its cost.
    pub start_time: Option<f64>,
    /// By [`Measure::ALL`], whether nothing cheaper is as good. One that began late is never on the front.
    pub on_front: [bool; 7],
}

impl Way {
    /// One of its errors (SI).
    #[must_use]
    pub fn error(&self, measure: Measure) -> Option<f64> {
        self.errors[measure as usize]
    }

    /// Whether it is on the front of a measure.
    #[must_use]
    pub fn is_on_front(&self, measure: Measure) -> bool {
        self.on_front[measure as usize]
    }

    /// Its name, with when it began if that was late: `reference (from 0.60 s)`.
    #[must_use]
    pub fn label(&self) -> String {
        match self.start_time {
            Some(time) => format!("{} (from {time:.2} s)", self.name),
            None => self.name.clone(),
        }
    }

    /// Whether its cost is that of an answer.
    pub(crate) fn is_whole(&self) -> bool {
        self.start_time.is_none()
    }
}

/// Results that count defects of one alone, in the order of [`Way::counts`].
pub const COUNTS: [&str; 4] = [
    "missed_wrinkles",
    "false_wrinkles",
    "missed_bridging",
    "false_bridging",
];

/// The ways of a study.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Ways {
    /// The cheapest first.
    pub list: Vec<Way>,
    /// Whether a run of the whole measures them; else the fine runs of the zones do, in these.
    pub of_the_whole: bool,
}

impl Ways {
    /// What measures them.
    #[must_use]
    pub fn yardstick(&self) -> &'static str {
        if self.of_the_whole {
            "reference"
        } else {
            "coarse run and zones"
        }
    }

    /// The ways of each reference by themselves, in the order of the comparisons.
    #[must_use]
    pub fn by_reference(&self) -> Vec<(&str, Self)> {
        let mut groups: Vec<(&str, Self)> = Vec::new();
        for way in &self.list {
            let of = way.measured_by.as_str();
            let at = groups.iter().position(|g| g.0 == of);
            let at = at.unwrap_or_else(|| {
                let list = Vec::new();
                let of_the_whole = self.of_the_whole;
                groups.push((of, Self { list, of_the_whole }));
                groups.len() - 1
            });
            groups[at].1.list.push(way.clone());
        }
        groups
    }

    /// The front of a measure, the cheapest first: whose error nothing cheaper has or is below.
    fn mark_fronts(&mut self) {
        for (m, measure) in Measure::ALL.into_iter().enumerate() {
            // That the reference has no error says nothing where nobody was measured.
            if !(self.list.iter()).any(|w| !w.is_reference && w.error(measure).is_some()) {
                (self.list.iter_mut()).for_each(|w| w.errors[m] = None);
                continue;
            }
            if measure == Measure::Defects {
                // That neither the way nor the reference has a defect is agreement, where others have false ones.
                let agrees = |w: &&mut Way| w.errors[m].is_none() && w.counts == Some([0.0; 4]);
                let agreeing = self.list.iter_mut().filter(agrees);
                agreeing.for_each(|w| w.errors[m] = Some(0.0));
            }
            let whole = self.list.iter().enumerate().filter(|(_, w)| w.is_whole());
            let mut told: Vec<(usize, f64)> = whole
                .filter_map(|(k, w)| Some((k, w.error(measure)?)))
                .collect();
            told.sort_by(|a, b| {
                let cost = |k: usize| self.list[k].cpu_seconds;
                cost(a.0).total_cmp(&cost(b.0)).then(a.1.total_cmp(&b.1))
            });
            let mut least = f64::INFINITY;
            for (k, error) in told {
                self.list[k].on_front[m] = error < least;
                least = least.min(error);
            }
        }
    }
}

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
        None => [Some(0.0); 7],
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
        is_reference: suffix.is_none(),
        measured_by: String::new(),
        start_time: value(&format!("start_time.{model}")),
        on_front: [false; 7],
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

/// For each of the errors: the cheapest way with no more, if it is not the reference alone. Of one reference's ways.
pub(crate) fn advice(ways: &Ways, targets: &[f64]) -> Vec<String> {
    let one = |target: &f64| {
        let percent = 100.0 * target;
        let good = |w: &&Way| w.errors[0].is_some_and(|e| e <= *target);
        let found = ways.list.iter().find(|w| w.is_whole() && good(w));
        // A reference that began late is one all the same.
        let found = found.or(ways.list.iter().find(|w| w.is_reference && good(w)))?;
        let share = 100.0 * found.share;
        Some(if !found.is_reference {
            format!(
                "For an error of {percent:.0} % or less: {} ({share:.1} % of the CPU time of the {}).",
                found.name,
                ways.yardstick()
            )
        } else {
            format!(
                "For an error of {percent:.0} % or less there is none but the {}.",
                ways.yardstick()
            )
        })
    };
    targets.iter().filter_map(one).collect()
}

#[cfg(test)]
mod tests;
