//! Speed against error: what the ways of a study cost, and how far they are from its reference.

use crate::input::{Instance, ReportInput};

/// A way to the answer: the coarse run alone, fine runs of its zones, or the reference.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Way {
    pub(crate) name: String,
    /// CPU and wall time (s).
    pub(crate) cpu: f64,
    pub(crate) wall: f64,
    /// CPU time over that of the reference.
    pub(crate) share: f64,
    /// Mean error of the reference's defects, a missed one counting as 1; see `comparison`.
    pub(crate) error: f64,
    /// Mean errors of length, amplitude and bridging area; absent when nothing was there to compare.
    pub(crate) errors: [Option<f64>; 3],
    /// Missed and false wrinkles, missed and false bridging; absent for the reference.
    pub(crate) counts: Option<[f64; 4]>,
    pub(crate) is_reference: bool,
    /// Whether no other way is both cheaper and better.
    pub(crate) on_front: bool,
}

/// Results that make the errors and counts of a way.
const ERRORS: [&str; 3] = [
    "wrinkle_length_error",
    "wrinkle_amplitude_error",
    "bridging_area_error",
];
const COUNTS: [&str; 4] = [
    "missed_wrinkles",
    "false_wrinkles",
    "missed_bridging",
    "false_bridging",
];

/// The ways of all comparisons with a reference, the cheapest first; one of equal cost and error is told once.
pub(crate) fn ways(input: &ReportInput) -> Vec<Way> {
    let compared = input
        .instances
        .iter()
        .filter(|i| i.record.kind == "comparison");
    let mut all: Vec<Way> = compared.flat_map(of).collect();
    all.sort_by(|a, b| a.cpu.total_cmp(&b.cpu).then(a.error.total_cmp(&b.error)));
    all.dedup_by(|a, b| a.cpu == b.cpu && a.error == b.error);
    let mut least = f64::INFINITY;
    for way in &mut all {
        way.on_front = way.error < least;
        least = least.min(way.error);
    }
    all
}

/// The ways of one comparison; none without a reference.
fn of(instance: &Instance) -> Vec<Way> {
    let value = |name: &str| {
        let mut results = instance.record.results.iter();
        results.find(|r| r.name == name).map(|r| r.value)
    };
    let Some(whole) = value("cost.reference.cpu_seconds").filter(|w| *w > 0.0) else {
        return Vec::new();
    };
    let label = instance.label();
    let way = |name: String, cost: &str, suffix: Option<&str>| {
        let cpu = value(&format!("cost.{cost}.cpu_seconds"))?;
        let measured = |name: &str| value(&format!("{name}{}", suffix?));
        Some(Way {
            name,
            cpu,
            wall: value(&format!("cost.{cost}.wall_seconds"))?,
            share: cpu / whole,
            error: if suffix.is_some() {
                measured("defect_error")?
            } else {
                0.0
            },
            errors: ERRORS.map(measured),
            counts: suffix.and_then(|_| {
                let counts = COUNTS.map(measured);
                counts
                    .iter()
                    .all(Option::is_some)
                    .then(|| counts.map(Option::unwrap_or_default))
            }),
            is_reference: suffix.is_none(),
            on_front: false,
        })
    };
    let ways = [
        way(
            format!("{label}: coarse run alone"),
            "global",
            Some(".global"),
        ),
        way(format!("{label}: coarse run and zones"), "total", Some("")),
        way("reference".to_owned(), "reference", None),
    ];
    ways.into_iter().flatten().collect()
}

/// For each of the errors: the cheapest way with no more, if it is not the reference alone.
pub(crate) fn advice(ways: &[Way], targets: &[f64]) -> Vec<String> {
    let one = |target: &f64| {
        let percent = 100.0 * target;
        let found = ways.iter().find(|w| w.error <= *target)?;
        let share = 100.0 * found.share;
        Some(if !found.is_reference {
            format!(
                "For an error of {percent:.0} % or less: {} ({share:.1} % of the reference's CPU time).",
                found.name
            )
        } else {
            format!("For an error of {percent:.0} % or less there is none but the reference.")
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
            command: "plyflow run w.yaml".into(),
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
        let told: Vec<(&str, bool)> = ways.iter().map(|w| (w.name.as_str(), w.on_front)).collect();
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
            (ways[2].share, ways[2].errors),
            (0.1, [Some(0.03), None, None])
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
}
