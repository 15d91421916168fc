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
            hash: String::new(),
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
        limits: None,
        judged: Vec::new(),
        expectations: Vec::new(),
        failures: Vec::new(),
        not_run: 0,
        family: None,
        until: Vec::new(),
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
        advice[0].contains("coarse run alone (12.5 % of the CPU time of the coarse run and zones)"),
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
fn a_way_without_a_defect_is_right_where_the_reference_has_none_and_others_have() {
    // The coarse run bridges where nothing does; its zones and the reference know better.
    let mut results = costs(10.0, 100.0);
    results.retain(|r| !r.0.contains("error") && !r.0.contains("missed"));
    for name in COUNTS {
        results.push((name, 0.0));
    }
    results.extend([
        ("missed_wrinkles.global", 0.0),
        ("false_wrinkles.global", 0.0),
        ("missed_bridging.global", 0.0),
        ("false_bridging.global", 1.0),
        ("defect_error.global", 1.0),
    ]);
    let ways = ways(&input(vec![comparison("c", &results)]));
    let told: Vec<_> = (ways.list.iter())
        .map(|w| (w.model.as_str(), w.errors[0], w.on_front[0]))
        .collect();
    assert_eq!(
        told,
        [
            ("global", Some(1.0), true),
            ("total", Some(0.0), true),
            ("reference", Some(0.0), false),
        ]
    );
    let advice = advice(&ways, &[0.1]);
    assert!(
        advice[0].contains("coarse run and zones (10.0 %"),
        "{advice:?}"
    );
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

/// Four short ridges that are wrong by 30 % and six long ones by 2 %: 13.2 % as a mean, and 22.5 of 355 mm in total.
#[test]
fn where_mean_and_total_name_different_ways_the_advice_says_so_and_both_have_a_front() {
    let mut run = costs(10.0, 100.0);
    run.extend([
        ("defect_error", 0.132),
        ("defect_total_error", 22.5 / 355.0),
        ("defect_total_error.global", 0.9),
        // Dearer: the short ones are right, and all the long ones wrong by 9 %.
        ("cost.other.lean.cpu_seconds", 400.0),
        ("cost.other.lean.wall_seconds", 400.0),
        ("defect_error.other.lean", 0.054),
        ("defect_total_error.other.lean", 27.0 / 355.0),
    ]);
    let ways = ways(&input(vec![comparison("one", &run)]));
    let told: Vec<(&str, [bool; 2])> = (ways.list.iter())
        .map(|w| {
            let on = |m| w.is_on_front(m);
            (
                &w.model[..],
                [Measure::Defects, Measure::TotalDefects].map(on),
            )
        })
        .collect();
    let expected = [
        ("global", [true, true]),
        ("total", [true, true]),
        ("other.lean", [true, false]),
        ("reference", [true, true]),
    ];
    assert_eq!(told, expected);
    assert_eq!(
        advice(&ways, &[0.2, 0.1, 0.07, 0.05]),
        [
            "For a mean and a total error of 20 % or less: coarse run and zones (10.0 % of the CPU time of the reference).",
            "For a mean error of 10 % or less: lean (40.0 % of the CPU time of the reference). For a total error of 10 % or less: coarse run and zones (10.0 % of the CPU time of the reference). The two measures name different ways.",
            "For a mean error of 7 % or less: lean (40.0 % of the CPU time of the reference). For a total error of 7 % or less: coarse run and zones (10.0 % of the CPU time of the reference). The two measures name different ways.",
            "For a mean and a total error of 5 % or less there is none but the reference.",
        ]
    );
}

#[test]
fn errors_by_size_have_the_bounds_of_their_comparison_and_leave_out_what_nobody_has() {
    let mut run = costs(10.0, 100.0);
    run.extend([
        ("defect_error", 0.4),
        ("wrinkle_class_from.medium", 0.02),
        ("wrinkle_class_from.long", 0.04),
        ("bridging_class_from.medium", 2e-4),
        ("bridging_class_from.large", 5e-4),
        ("wrinkle_pairs.short", 4.0),
        ("missed_wrinkles.short", 0.0),
        ("false_wrinkles.short", 0.0),
        ("wrinkle_length_error.short", 0.3),
        ("wrinkle_length_total_error.short", 0.29),
        ("wrinkle_pairs.medium", 0.0),
        ("missed_wrinkles.medium", 0.0),
        ("false_wrinkles.medium", 0.0),
        ("wrinkle_pairs.long", 0.0),
        ("missed_wrinkles.long", 0.0),
        ("false_wrinkles.long", 1.0),
        ("bridging_pairs.medium.global", 1.0),
        ("missed_bridging.medium.global", 2.0),
        ("false_bridging.medium.global", 0.0),
        ("bridging_area_error.medium.global", 0.1),
    ]);
    let ways = ways(&input(vec![comparison("one", &run)]));
    let of = |model: &str| {
        let way = ways.list.iter().find(|w| w.model == model).unwrap();
        let told = |c: &OfClass| {
            let numbers = [c.pairs, c.missed, c.wrong];
            (c.title.clone(), c.name.clone(), numbers, c.mean, c.total)
        };
        way.classes.iter().map(told).collect::<Vec<_>>()
    };
    let class = |title: &str, name: &str, numbers, mean, total| {
        (title.to_owned(), name.to_owned(), numbers, mean, total)
    };
    assert_eq!(
        of("total"),
        [
            class(
                "wrinkles below 20 mm",
                "wrinkle.short",
                [4.0, 0.0, 0.0],
                Some(0.3),
                Some(0.29)
            ),
            class(
                "wrinkles from 40 mm on",
                "wrinkle.long",
                [0.0, 0.0, 1.0],
                None,
                None
            ),
        ]
    );
    let bridging = "bridging of 200 to 500 mm²";
    let numbers = [1.0, 2.0, 0.0];
    let medium = class(bridging, "bridging.medium", numbers, Some(0.1), None);
    assert_eq!(of("global"), [medium]);
    assert_eq!(of("reference"), []);
}

#[test]
fn every_measure_has_a_title_and_a_result_of_its_own_and_stands_at_its_place() {
    for (k, measure) in Measure::ALL.into_iter().enumerate() {
        assert_eq!(measure as usize, k);
        let others = Measure::ALL.into_iter().filter(|m| *m != measure);
        for other in others {
            assert_ne!(measure.result(), other.result());
            assert_ne!(measure.title(), other.title());
        }
        if let Some(total) = measure.total() {
            let of = measure.result().trim_end_matches("_error");
            assert_eq!(total.result(), format!("{of}_total_error"));
        }
    }
}
