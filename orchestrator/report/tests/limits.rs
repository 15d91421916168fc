//! Limits of the engineer on made-up runs: what is judged, by whom, and what the first screen says of it.

mod common;

use camino::{Utf8Path, Utf8PathBuf};
use common::{Study, ZONES, family, whole, whole_study};
use plyflow_model::workflow::{LimitOn, Limits};
use plyflow_report::{Judged, Kept, ReportInput, failing, judge, summary, write_report};
use serde_json::{Value, json};

fn folder() -> (tempfile::TempDir, Utf8PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = Utf8PathBuf::from_path_buf(dir.path().to_owned()).unwrap();
    (dir, path)
}

fn page(input: &ReportInput, folder: &Utf8Path) -> String {
    let out = folder.join("out/report.html");
    write_report(input, &out).unwrap();
    std::fs::read_to_string(&out).unwrap()
}

/// The input with these limits, judged.
fn with(mut input: ReportInput, limits: Value) -> ReportInput {
    let limits: Limits = serde_json::from_value(limits).unwrap();
    input.limits = Some(limits);
    input.judged = judge(&input);
    input
}

fn of(input: &ReportInput, on: LimitOn, place: Option<&str>) -> Judged {
    let mut all = input.judged.iter();
    let found = all.find(|j| j.on == on && j.place.as_deref() == place);
    found
        .unwrap_or_else(|| panic!("no {on:?} at {place:?}"))
        .clone()
}

#[test]
fn defects_are_judged_by_the_fine_runs_and_shear_by_every_cell_of_the_finest_run() {
    let (_keep, folder) = folder();
    let input = with(
        whole(&folder),
        json!({"wrinkle_length": "60 mm", "bridging_area": "500 mm2", "shear_positive": "20 deg", "shear_negative": "-40 deg"}),
    );
    let long = of(&input, LimitOn::WrinkleLength, None);
    assert_eq!(long.verdict, Kept::Beyond);
    let worst = long.worst.unwrap();
    assert_eq!(
        (worst.name.as_deref(), worst.zone.as_deref()),
        (Some("AW1"), Some("A"))
    );
    assert_eq!(worst.by, "local.A", "the coarse run has it shorter");
    assert!((worst.value - 0.0684).abs() < 1e-9);
    // Nothing is beyond, but one place of bridging goes on behind the cut of its zone.
    let area = of(&input, LimitOn::BridgingArea, None);
    assert_eq!(area.verdict, Kept::NotJudged);
    assert!(
        area.notes[0].starts_with("BB1 reaches the cut of its zone"),
        "{:?}",
        area.notes
    );
    // 0.4 rad at a corner of the blank, which no zone has.
    let shear = of(&input, LimitOn::ShearPositive, None);
    let worst = shear.worst.unwrap();
    assert_eq!((shear.verdict, worst.by.as_str()), (Kept::Beyond, "coarse"));
    assert!(worst.value > 0.33 && worst.value < 0.4, "{}", worst.value);
    let negative = of(&input, LimitOn::ShearNegative, None);
    assert_eq!(negative.verdict, Kept::Within);
    assert_eq!(
        failing(&input.judged).unwrap(),
        "2 limits exceeded: wrinkle length, positive shear angle; 1 limit not judged: bridging area"
    );
}

#[test]
fn what_hangs_beside_the_tool_is_no_gap_though_it_is_far_from_it() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    // Cells that are flagged reach to where the tool ends, and beyond lies the ply 50 mm off it.
    study.beside_tool = true;
    study.forming("coarse", None, 0.004);
    study.defects(false);
    let input = with(study.input(), json!({"bridging_gap": "7 mm"}));
    let gap = of(&input, LimitOn::BridgingGap, None);
    assert_eq!(gap.verdict, Kept::Within, "{gap:?}");
    let worst = gap.worst.unwrap();
    assert!(
        worst.value > 0.005 && worst.value < 0.0061,
        "{}",
        worst.value
    );
    let page = page(&input, &folder);
    assert!(
        page.contains("<th class=\"n\">judged (%)</th>")
            && page.contains("<td class=\"n\">74</td>")
    );
}

#[test]
fn fibre_deviation_is_judged_by_the_formed_direction_of_both_families() {
    let (_keep, folder) = folder();
    // The half-pipe bends about x, which turns no fibre. Around it the plies are longer than the flat ones, by 2 mm over 60 mm of the outer one.
    let input = with(
        whole(&folder),
        json!({"fibre_deviation": "2 deg", "places": [
        {"name": "flat end", "rectangle": {"centre": ["-110 mm", "60 mm"], "length": "10 mm", "width": "20 mm"}, "fibre_deviation": "1 deg"}]}),
    );
    let part = of(&input, LimitOn::FibreDeviation, None);
    assert_eq!(part.verdict, Kept::Beyond, "{part:?}");
    let worst = part.worst.unwrap();
    assert!(
        worst.by.starts_with("local["),
        "the wave is in a zone: {worst:?}"
    );
    assert!(worst.value.abs() > 2f64.to_radians() && worst.value.abs() < 45f64.to_radians());
    let end = of(&input, LimitOn::FibreDeviation, Some("flat end"));
    assert_eq!(end.verdict, Kept::Within);
    let (worst, exact) = (
        end.worst.unwrap(),
        (0.062f64 / 0.06).atan() - 45f64.to_radians(),
    );
    assert!(
        (worst.value.abs() - exact).abs() < 1e-3 * exact + 1e-4,
        "{worst:?}"
    );
    let page = page(&input, &folder);
    assert!(page.contains("fibre deviation") && page.contains("at most ±1 deg"));
}

#[test]
fn in_a_zone_the_cells_of_the_whole_do_not_count() {
    let (_keep, folder) = folder();
    let [x0, y0, x1, y1] = ZONES[0].1;
    let mm = |v: f64| format!("{} mm", 1e3 * v);
    let zone = json!({"rectangle": {"centre": [mm((x0 + x1) / 2.0), mm((y0 + y1) / 2.0)],
        "length": mm((x1 - x0) * 0.8), "width": mm((y1 - y0) * 0.8)}, "shear": "80 deg"});
    let input = with(whole(&folder), json!({"places": [zone]}));
    assert_eq!(input.judged.len(), 1, "the part has no limit of its own");
    let inside = of(&input, LimitOn::Shear, Some("a rectangle"));
    assert_eq!(inside.verdict, Kept::Within);
    assert_eq!(inside.worst.unwrap().by, "local[A]");
}

#[test]
fn what_has_not_been_looked_at_closely_enough_is_not_judged_and_says_why() {
    let (_keep, folder) = folder();
    // The made-up fine runs tell no curvature: elements that do not bend have no wrinkles.
    let wide = json!({"wrinkle_height": "1 m", "fibre_strain": 0.5});
    let input = with(whole(&folder), wide.clone());
    let height = of(&input, LimitOn::WrinkleHeight, None);
    assert_eq!(height.verdict, Kept::NotJudged);
    assert!(
        height
            .notes
            .iter()
            .any(|n| n.contains("local[A] do not bend")),
        "{:?}",
        height.notes
    );
    assert_eq!(of(&input, LimitOn::FibreStrain, None).verdict, Kept::Within);
    // Before anything has been compared, before there are zones, and before there is a run.
    let mut study = whole_study(&folder);
    study.instances.retain(|i| i.record.kind != "comparison");
    let uncompared = with(study.input(), wide.clone());
    let height = of(&uncompared, LimitOn::WrinkleHeight, None);
    assert!(
        height.notes[0].contains("no fine run has been compared"),
        "{:?}",
        height.notes
    );
    let mut empty = whole(&folder);
    empty.instances.clear();
    let empty = with(empty, wide);
    assert!(empty.judged.iter().all(|j| j.verdict == Kept::NotJudged));
    assert_eq!(empty.judged.len(), 2);
}

#[test]
fn the_first_screen_answers_and_leads_to_the_defects() {
    let (_keep, folder) = folder();
    let input = with(
        whole(&folder),
        json!({"wrinkle_length": "60 mm", "shear": "60 deg", "source": "drawing 7"}),
    );
    let page = page(&input, &folder);
    let (head, rest) = page.split_once("</header>").unwrap();
    let answer = &head[head.find("<section id=\"answer\" class=\"bad\">").unwrap()..];
    for text in [
        "The part exceeds 1 of 2 limits; worst: wrinkle length 68.4 mm (at most 60 mm), AW1 on ply_2, zone A at",
        "<td class=\"missed\">✗ beyond</td>",
        "<td class=\"met\">✓ within</td>",
        "<li data-defect=\"0-AW1\"><b>AW1 on ply_2, zone A at x = ",
        "AW1, BW1 lie beside bridges",
        "2 zones; 2 wrinkles, longest 68.4 mm; 2 bridging areas.",
        "Nothing speaks against it.",
        "--confirm</code> tells.",
    ] {
        assert!(answer.contains(text), "{text} in {answer}");
    }
    let limits = &rest[rest.find("<section id=\"limits\">").unwrap()..];
    assert!(
        limits.contains("drawing 7")
            && limits.contains("2 fine runs in their zones; coarse elsewhere")
    );
    let told = summary(&input, None);
    assert!(
        told.starts_with("the part exceeds 1 of 2 limits; worst: wrinkle length"),
        "{told}"
    );
}

#[test]
fn without_limits_nothing_is_called_good() {
    let (_keep, folder) = folder();
    let input = whole(&folder);
    assert!(judge(&input).is_empty());
    let page = page(&input, &folder);
    assert!(
        page.contains("<p class=\"verdict found\">No limits were given, so nothing is judged.</p>")
    );
    assert!(page.contains("What was found?") && !page.contains("id=\"limits\""));
    assert!(!page.contains("class=\"verdict good\""));
    assert!(!summary(&input, None).contains("limit"));
}

#[test]
fn of_a_study_every_point_is_judged_by_itself() {
    let (_keep, folder) = folder();
    let input = with(family::sweep(&folder, 45), json!({"shear": "1 deg"}));
    let points = &input.family.as_ref().unwrap().points;
    assert!(
        points
            .iter()
            .all(|p| input.judged.iter().any(|j| j.of.starts_with(&p.name)))
    );
    let page = page(&input, &folder);
    assert!(
        page.contains("Over all points, the part exceeds")
            || page.contains("Over all points, the part is not judged")
    );
}

/// What was not judged, in one text.
fn why(judged: &Judged) -> String {
    assert_eq!(judged.verdict, Kept::NotJudged, "{judged:?}");
    judged.notes.join("; ")
}

#[test]
fn a_place_without_a_cell_is_not_judged() {
    let (_keep, folder) = folder();
    let place = |name: &str, x: &str, size: &str| {
        json!({"name": name, "rectangle": {"centre": [x, "1 mm"], "length": size, "width": size},
        "shear": "80 deg", "wrinkle_length": "1 m", "fibre_deviation": "80 deg"})
    };
    let places = [
        place("a hair", "0.3 mm", "0.2 mm"),
        place("beside", "43 m", "20 mm"),
        place("hidden", "0 mm", "20 mm"),
        place("over it", "0 mm", "30 mm"),
    ];
    let input = with(whole(&folder), json!({"shear": "80 deg", "places": places}));
    for on in [
        LimitOn::Shear,
        LimitOn::WrinkleLength,
        LimitOn::FibreDeviation,
    ] {
        for name in ["a hair", "beside", "hidden"] {
            let text = why(&of(&input, on, Some(name)));
            let expected = format!("no cell has its middle in {name}");
            assert!(text.contains(&expected), "{on:?} {name}: {text}");
        }
        let judged = of(&input, on, Some("over it"));
        assert!(!judged.notes.join("").contains("no cell"), "{judged:?}");
    }
    let over = of(&input, LimitOn::Shear, Some("over it"));
    assert_eq!(over.verdict, Kept::Within);
}

const WIDE: [&str; 4] = [
    "wrinkle_height",
    "wrinkle_length",
    "bridging_gap",
    "bridging_area",
];

fn wide() -> Value {
    json!({"wrinkle_height": "1 m", "wrinkle_length": "10 m", "bridging_gap": "1 m", "bridging_area": "1 m2"})
}

#[test]
fn what_a_drape_does_not_reach_and_what_it_cannot_show_is_not_judged() {
    let (_keep, folder) = folder();
    for half in [true, false] {
        let mut study = Study::new(&folder);
        (study.half_draped, study.draped) = (half, true);
        study.forming("coarse", None, 0.004);
        study.measurement();
        let input = with(study.input(), wide());
        assert_eq!(input.judged.len(), WIDE.len());
        for judged in &input.judged {
            let text = why(judged);
            assert_eq!(
                text.contains("of ply_1 are not draped in coarse"),
                half,
                "{text}"
            );
            let bridging = matches!(judged.on, LimitOn::BridgingGap | LimitOn::BridgingArea);
            assert_eq!(text.contains("by geometry alone"), bridging, "{text}");
        }
    }
    // With a detection alone.
    let mut study = Study::new(&folder);
    study.half_draped = true;
    study.forming("coarse", None, 0.004);
    study.defects(true);
    let input = with(study.input(), json!({"bridging_gap": "1 m"}));
    let text = why(&input.judged[0]);
    assert!(
        text.contains("not draped") && text.contains("by geometry alone"),
        "{text}"
    );
}

#[test]
fn of_several_measurements_those_count_that_see_what_is_limited_in_whatever_order() {
    let limits = json!({"wrinkle_height": "4 mm", "bridging_gap": "4 mm"});
    for fine_first in [true, false] {
        let (_keep, folder) = folder();
        let mut study = Study::new(&folder);
        study.forming("coarse", None, 0.004);
        let mut steps = [
            ("fine", json!({"distance_threshold": 1e-3}), 0.0052),
            ("rough", json!({"distance_threshold": 5e-3}), 0.0039),
        ];
        if !fine_first {
            steps.reverse();
        }
        for (step, parameters, height) in steps {
            study.parameters = parameters;
            study.measurement_by(step, height);
        }
        let input = with(study.input(), limits.clone());
        let height = of(&input, LimitOn::WrinkleHeight, None);
        assert_eq!(height.verdict, Kept::Beyond);
        assert_eq!(height.worst.unwrap().by, "fine");
    }
    // The rough one alone: what it has not seen, nobody has.
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.forming("coarse", None, 0.004);
    study.parameters = json!({"distance_threshold": 5e-3});
    study.measurement_by("rough", 0.0039);
    let input = with(study.input(), limits);
    for on in [LimitOn::WrinkleHeight, LimitOn::BridgingGap] {
        let text = why(&of(&input, on, None));
        assert!(
            text.contains("rough counts what is larger than 5 mm only"),
            "{text}"
        );
    }
}

#[test]
fn a_step_that_counts_only_larger_defects_than_usual_judges_no_other_size_of_them() {
    use LimitOn::{
        BridgingArea as Area, BridgingGap as Gap, WrinkleHeight as Height, WrinkleLength as Length,
    };
    for (key, value, missed) in [
        ("distance_threshold", 0.02, [Length, Area].as_slice()),
        ("curvature_threshold", 400.0, &[Height, Length]),
        ("minimum_wrinkle_length", 0.05, &[Height]),
        ("minimum_bridging_area", 0.01, &[Gap]),
    ] {
        let (_keep, folder) = folder();
        let mut study = Study::new(&folder);
        study.forming("coarse", None, 0.004);
        study.parameters = json!({key: value});
        study.measurement();
        let input = with(study.input(), wide());
        for judged in &input.judged {
            let text = judged.notes.join("; ");
            let told = text.contains(&format!("give it `{key}` of "));
            assert_eq!(
                told,
                missed.contains(&judged.on),
                "{key} {:?}: {text}",
                judged.on
            );
        }
    }
}

#[test]
fn the_usual_sizes_are_those_of_the_steps() {
    for manifest in [
        include_str!("../../../solver-plugins/steps/compare/defect-measurement/manifest.json"),
        include_str!("../../../solver-plugins/steps/compare/comparison/manifest.json"),
    ] {
        let manifest: Value = serde_json::from_str(manifest).unwrap();
        for (key, usual) in [
            ("distance_threshold", "1 mm"),
            ("curvature_threshold", "0.1 1/mm"),
            ("minimum_wrinkle_length", "10 mm"),
            ("minimum_bridging_area", "50 mm2"),
        ] {
            assert_eq!(manifest["parameters"][key]["default"], usual, "{key}");
        }
    }
}

#[test]
fn a_detection_that_flags_only_what_is_far_off_judges_nothing_outside_of_the_zones() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.flagged_from = 0.03;
    study.forming("coarse", None, 0.004);
    study.defects(false);
    study.zones(&[]);
    study.parameters = json!({"distance_threshold": 1e-3});
    study.comparison(&[]);
    let all = json!({"wrinkle_height": "10 mm", "wrinkle_length": "10 m", "bridging_gap": "10 mm", "bridging_area": "1 m2"});
    let study = study.input();
    let input = with(study.clone(), all);
    for judged in &input.judged {
        let text = why(judged);
        assert!(
            text.contains("flags distances from 30 mm on only"),
            "{:?}: {text}",
            judged.on
        );
    }
    // With limits that large it has looked closely enough.
    let input = with(
        study,
        json!({"bridging_gap": "40 mm", "wrinkle_height": "40 mm"}),
    );
    assert!(
        input.judged.iter().all(|j| j.verdict == Kept::Within),
        "{:?}",
        input.judged
    );
}

#[test]
fn what_is_flagged_outside_of_the_zones_is_not_judged_unless_it_is_too_small_for_a_zone() {
    for (least, open) in [(2e-4, true), (1.0, false)] {
        let (_keep, folder) = folder();
        let mut study = Study::new(&folder);
        study.forming("coarse", None, 0.004);
        study.defects(false);
        study.parameters = json!({"minimum_area": least, "distance_threshold": 1e-3});
        study.zones(&[]);
        study.comparison(&[]);
        let input = with(study.input(), wide());
        for judged in &input.judged {
            let text = judged.notes.join("; ");
            assert!(
                text.contains("are flagged in coarse where no fine run has looked"),
                "{text}"
            );
            let of_gap = judged.on == LimitOn::BridgingGap;
            assert_eq!(
                judged.verdict == Kept::NotJudged,
                open && !of_gap,
                "{judged:?}"
            );
        }
    }
}

#[test]
fn of_several_comparisons_the_verdict_names_the_one_that_it_is_by() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.forming("coarse", None, 0.008);
    study.defects(false);
    study.zones(&ZONES[..1]);
    study.boundary("A");
    study.forming("local[A]", Some(ZONES[0]), 0.004);
    study.compared("demo", ["coarse", "local"], &ZONES[..1], &[]);
    study.compared("later", ["coarse", "local"], &ZONES[..1], &[]);
    let input = with(study.input(), json!({"bridging_gap": "1 m"}));
    let gap = of(&input, LimitOn::BridgingGap, None);
    let named = "judged by the fine runs of demo: those of later in the same zones are not asked";
    assert!(gap.notes.iter().any(|n| n == named), "{gap:?}");
}
