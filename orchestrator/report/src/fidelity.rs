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
    // No suffix: the reference.
    let way = |name: String, model: &str, suffix: Option<&str>| {
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
        Some(Way {
            comparison: instance.label(),
            model: model.to_owned(),
            name,
            cpu_seconds,
            wall_seconds: value(&format!("cost.{model}.wall_seconds"))?,
            peak_memory: value(&format!("peak_memory.{model}")),
            share: cpu_seconds / whole,
            errors,
            counts: (counts.iter().all(Option::is_some))
                .then(|| counts.map(Option::unwrap_or_default)),
            is_reference: suffix.is_none(),
            measured_by: measured_by.to_owned(),
            start_time: value(&format!("start_time.{model}")),
            on_front: [false; 7],
        })
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
mod tests {
    use super::*;
    use plyflow_model::job::{Cost, NamedResult, Record};

    fn comparison(step: &str, results: &[(&str, f64)]) -> Instance {
        let result = |(name, value): &(&str, f64)| NamedResult {
            name: (*name).into(),
            value: *value,
            unit: "1".into(),
            measured: name.starts_with("cost"),
        };
        Instance {
            step: step.into(),
            item: Vec::new(),
            artifact: "none".into(),
            record: Record {
                version: 1,
                step: step.into(),
                item: Vec::new(),
                key: "k".into(),
                kind: "comparison".into(),
                bytes: 0,
                cost: Cost::default(),
                results: results.iter().map(result).collect(),
                collection: None,
                warnings: Vec::new(),
                host: "h".into(),
                started: 0.0,
            },
        }
    }

    fn input(instances: Vec<Instance>) -> ReportInput {
        ReportInput {
            workflow: "w".into(),
            description: None,
            file: "w.yaml".into(),
            given: "w.yaml".into(),
            program: "plyflow".into(),
            fingerprint: "f".into(),
            instances,
            expectations: Vec::new(),
            failures: Vec::new(),
            not_run: 0,
        }
    }

    fn costs(global: f64, total: f64) -> Vec<(&'static str, f64)> {
        vec![
            ("cost.global.cpu_seconds", global),
            ("cost.global.wall_seconds", global),
            ("cost.total.cpu_seconds", total),
            ("cost.total.wall_seconds", total),
            ("cost.reference.cpu_seconds", 1000.0),
            ("cost.reference.wall_seconds", 500.0),
            ("defect_error.global", 0.8),
            ("missed_wrinkles.global", 1.0),
        ]
    }

    #[test]
    fn the_front_holds_what_nothing_cheaper_equals_and_the_advice_is_the_cheapest_that_does() {
        let mut fine = costs(10.0, 100.0);
        fine.extend([("defect_error", 0.04), ("wrinkle_length_error", 0.03)]);
        let mut odd = costs(10.0, 200.0);
        odd.push(("defect_error", 0.3));
        let mut coarse = costs(10.0, 50.0);
        coarse.push(("defect_error", 0.09));
        let input = input(vec![
            comparison("fine", &fine),
            comparison("odd", &odd),
            comparison("coarse", &coarse),
            comparison("without", &[("cost.global.cpu_seconds", 1.0)]),
        ]);
        let ways = ways(&input);
        assert!(ways.of_the_whole);
        let list = &ways.list;
        let told: Vec<(&str, bool)> = list
            .iter()
            .map(|w| (w.name.as_str(), w.on_front[0]))
            .collect();
        assert_eq!(
            told,
            [
                ("fine: coarse run alone", true),
                ("coarse: coarse run and zones", true),
                ("fine: coarse run and zones", true),
                ("odd: coarse run and zones", false),
                ("reference", true),
            ]
        );
        assert_eq!(
            (list[2].share, list[2].error(Measure::Length)),
            (0.1, Some(0.03))
        );
        let advice = advice(&ways, &[0.1, 0.05, 0.01]);
        assert!(
            advice[0].contains("coarse: coarse run and zones (5.0 %"),
            "{advice:?}"
        );
        assert!(
            advice[1].contains("fine: coarse run and zones (10.0 %"),
            "{advice:?}"
        );
        assert!(advice[2].contains("none but the reference"), "{advice:?}");
    }

    #[test]
    fn without_a_reference_the_dearest_zones_measure_the_others() {
        let run = |total: f64, drape: f64| {
            vec![
                ("cost.global.cpu_seconds", 10.0),
                ("cost.global.wall_seconds", 10.0),
                ("cost.other.drape.cpu_seconds", 1.0),
                ("cost.other.drape.wall_seconds", 1.0),
                ("peak_memory.other.drape", 5e6),
                (TOTAL, total),
                ("cost.total.wall_seconds", total),
                ("defect_error.global", 0.8),
                ("missed_wrinkles.global", 0.0),
                ("defect_error.other.drape", drape),
                ("position_error.other.drape", 0.002),
            ]
        };
        let ways = ways(&input(vec![
            comparison("first", &run(50.0, 0.7)),
            comparison("grown", &run(80.0, 0.9)),
        ]));
        assert!(!ways.of_the_whole);
        let list = &ways.list;
        let told: Vec<(&str, f64)> = (list.iter())
            .map(|w| (w.name.as_str(), w.errors[0].unwrap()))
            .collect();
        assert_eq!(
            told,
            [
                ("drape", 0.9),
                ("coarse run alone", 0.8),
                ("coarse run and zones", 0.0),
            ]
        );
        assert_eq!(
            (list[0].share, list[0].peak_memory),
            (1.0 / 80.0, Some(5e6))
        );
        assert_eq!(list[0].error(Measure::Position), Some(0.002));
        assert_eq!(list[0].error(Measure::Shear), None);
        let advice = advice(&ways, &[0.85, 0.1]);
        assert!(
            advice[0]
                .contains("coarse run alone (12.5 % of the CPU time of the coarse run and zones)"),
            "{advice:?}"
        );
        assert!(
            advice[1].contains("none but the coarse run and zones"),
            "{advice:?}"
        );
    }

    #[test]
    fn a_run_that_began_late_is_told_so_and_not_advised() {
        let mut run = costs(10.0, 100.0);
        run.extend([
            ("defect_error", 0.08),
            ("cost.other.late.cpu_seconds", 50.0),
            ("cost.other.late.wall_seconds", 50.0),
            ("defect_error.other.late", 0.02),
            ("start_time.other.late", 0.6),
            ("start_time.reference", 0.7),
        ]);
        let ways = ways(&input(vec![comparison("late", &run)]));
        let told: Vec<(&str, Option<f64>, bool)> = (ways.list.iter())
            .map(|w| (w.name.as_str(), w.start_time, w.on_front[0]))
            .collect();
        assert_eq!(
            told,
            [
                ("coarse run alone", None, true),
                ("late", Some(0.6), false),
                ("coarse run and zones", None, true),
                ("reference", Some(0.7), false),
            ]
        );
        let told = advice(&ways, &[0.1, 0.05]);
        assert!(told[0].contains("coarse run and zones"), "{told:?}");
        assert!(told[1].contains("none but the reference"), "{told:?}");
        // Also where the part of a process that it did cost less than the zones.
        let cheap = run.iter_mut().find(|r| r.0 == "cost.reference.cpu_seconds");
        cheap.unwrap().1 = 60.0;
        let cheap = super::ways(&input(vec![comparison("late", &run)]));
        let zones = cheap.list.iter().find(|w| w.model == "total").unwrap();
        assert!(zones.on_front[0]);
        assert_eq!(
            advice(&cheap, &[0.1])[0].split(" (").next(),
            told[0].split(" (").next()
        );
    }

    #[test]
    fn ways_of_different_references_are_not_held_against_each_other() {
        let of = |whole: f64, total: f64, error: f64| {
            let mut run = costs(10.0, total);
            run.iter_mut()
                .filter(|r| r.0 == "cost.reference.cpu_seconds")
                .for_each(|r| r.1 = whole);
            run.push(("defect_error", error));
            run
        };
        let ways = ways(&input(vec![
            comparison("two", &of(9000.0, 700.0, 0.04)),
            comparison("four", &of(600.0, 100.0, 0.05)),
            comparison("two_s4", &of(9000.0, 800.0, 0.03)),
        ]));
        let told: Vec<(&str, Vec<(&str, bool)>)> = (ways.by_reference().into_iter())
            .map(|(of, _)| {
                let own = ways.list.iter().filter(|w| w.measured_by == of);
                (of, own.map(|w| (&w.name[..], w.on_front[0])).collect())
            })
            .collect();
        let expected = [
            (
                "two",
                vec![
                    ("two: coarse run alone", true),
                    ("two: coarse run and zones", true),
                    ("two_s4: coarse run and zones", true),
                    ("two: reference", true),
                ],
            ),
            (
                "four",
                vec![
                    ("four: coarse run alone", true),
                    ("four: coarse run and zones", true),
                    ("four: reference", true),
                ],
            ),
        ];
        assert_eq!(told, expected);
        let [two, four] = [0, 1].map(|k| advice(&ways.by_reference()[k].1, &[0.05]));
        assert!(
            two[0].contains("two: coarse run and zones (7.8 %"),
            "{two:?}"
        );
        assert!(
            four[0].contains("four: coarse run and zones (16.7 %"),
            "{four:?}"
        );
    }

    #[test]
    fn zones_without_a_defect_are_told_beside_each_other_too() {
        let run = [
            ("cost.global.cpu_seconds", 10.0),
            ("cost.global.wall_seconds", 10.0),
            (TOTAL, 50.0),
            ("cost.total.wall_seconds", 50.0),
            ("missed_wrinkles.global", 0.0),
            ("false_wrinkles.global", 0.0),
            ("missed_bridging.global", 0.0),
            ("false_bridging.global", 0.0),
            ("position_error.global", 1e-4),
        ];
        let ways = ways(&input(vec![comparison("level", &run)]));
        let names: Vec<&str> = ways.list.iter().map(|w| w.name.as_str()).collect();
        assert_eq!(names, ["coarse run alone", "coarse run and zones"]);
    }

    #[test]
    fn a_reference_without_defects_leaves_the_other_errors_and_a_fed_back_coarse_run_its_name() {
        let mut run = costs(10.0, 100.0);
        run.retain(|(name, _)| !name.starts_with("defect_error"));
        run.extend([
            ("position_error.global", 2e-4),
            ("position_error", 1e-4),
            ("passes", 2.0),
        ]);
        let ways = ways(&input(vec![comparison("level", &run)]));
        let told: Vec<(&str, Option<f64>, bool)> = (ways.list.iter())
            .map(|w| {
                (
                    w.name.as_str(),
                    w.error(Measure::Position),
                    w.is_on_front(Measure::Position),
                )
            })
            .collect();
        assert_eq!(
            told,
            [
                ("coarse run of the last pass", Some(2e-4), true),
                ("coarse run and zones", Some(1e-4), true),
                ("reference", Some(0.0), true),
            ]
        );
        assert_eq!(ways.list[0].error(Measure::Defects), None);
        assert!(
            advice(&ways, &[0.1])
                .iter()
                .all(|a| a.contains("none but the reference"))
        );
    }

    #[test]
    fn every_measure_has_a_front_of_its_own_and_the_reference_stands_on_it() {
        let mut run = costs(10.0, 100.0);
        run.extend([
            ("defect_error", 0.08),
            ("cost.other.drape.cpu_seconds", 1.0),
            ("cost.other.drape.wall_seconds", 1.0),
            ("defect_error.other.drape", 0.9),
            ("position_error.other.drape", 0.002),
            ("position_error.global", 0.003),
            ("position_error", 0.001),
        ]);
        let ways = ways(&input(vec![comparison("one", &run)]));
        let told: Vec<(&str, &str, [bool; 3])> = (ways.list.iter())
            .map(|w| {
                let on = |m| w.is_on_front(m);
                let fronts = [Measure::Defects, Measure::Position, Measure::Shear].map(on);
                (w.comparison.as_str(), w.model.as_str(), fronts)
            })
            .collect();
        assert_eq!(
            told,
            [
                ("one", "other.drape", [true, true, false]),
                ("one", "global", [true, false, false]),
                ("one", "total", [true, true, false]),
                ("one", "reference", [true, true, false]),
            ]
        );
        let reference = &ways.list[3];
        assert_eq!(reference.error(Measure::Position), Some(0.0));
        assert_eq!(reference.error(Measure::Shear), None, "nobody was measured");
    }
}
