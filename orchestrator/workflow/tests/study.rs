//! Workflows with a block `study`: points, shared steps, values by path, and findings that name their place and their point.

mod common;
mod points;

use common::Study;
use plyflow_workflow::resolved::{ResolvedStep, StudyValue};
use points::*;
use serde_json::json;

#[test]
fn steps_are_there_once_for_every_value_that_they_depend_on() {
    let w = load(&with(ANGLES, &[LIMIT]));
    let found = names(&w);
    assert_eq!(found[..2], ["coarse", "defects@limit=4deg"], "{found:?}");
    // One coarse run; the rest hangs on the detection, at three points.
    assert_eq!(found.len(), 1 + 5 * 3);
    let study = w.study.as_ref().unwrap();
    assert_eq!(study.points.len(), 3);
    assert_eq!(
        study.points[2].values,
        [StudyValue::Number {
            shown: 8.0,
            si: 8f64.to_radians()
        }]
    );
    let local = step(&w, "local@limit=6deg");
    assert_eq!(local.base.as_deref(), Some("local"));
    assert_eq!(local.inputs[0].from, "boundary@limit=6deg");
    assert_eq!(local.dimensions[0].over, "zones@limit=6deg");
    assert_eq!(step(&w, "comparison@limit=4deg").inputs[0].from, "coarse");
    // What a user would have written, to the last bit.
    let by_hand = Study::sound();
    by_hand.mutate(
        W,
        "over_shear_positive: 8 deg",
        "over_shear_positive: 6 deg",
    );
    let by_hand = load(&by_hand);
    assert_eq!(
        step(&w, "defects@limit=6deg").parameters,
        step(&by_hand, "defects").parameters
    );
    // Expectations on a step are on it at every point.
    let of = |step: &str| {
        w.expectations
            .iter()
            .filter(|e| e.step.starts_with(step))
            .count()
    };
    assert_eq!((of("comparison@"), of("coarse")), (2 * 3, 1));
}

/// All that an alias stands for has the place of the alias.
#[test]
fn values_behind_an_alias_are_those_of_what_it_stands_for() {
    let block = "  vary:\n    angle: [0 deg, 45 deg]\n    mu: [0.1]";
    let set = "scene: &whole {file: scene.yaml, set: {sheets.ply-1.fibre_1: \"-45 deg + ${angle}\", sheets.ply-1.fibre_2: \"45 deg + ${angle}\", friction.fabric_diaphragm: \"${mu}\"}}\n      element: m4";
    let study = with(block, &[("scene: scene.yaml\n      element: m4", set)]);
    assert!(
        study.mutate(
            W,
            "{scene: scene.yaml, element: rf4}",
            "{scene: *whole, element: rf4}"
        ) > 0
    );
    let w = load(&study);
    let [coarse, local] = ["coarse", "local"].map(|name| {
        let of = |s: &&ResolvedStep| s.name.starts_with(&format!("{name}@angle=45deg,mu=0.1"));
        let found = w.steps.iter().find(of);
        &found
            .unwrap_or_else(|| panic!("{:?}", names(&w)))
            .parameters["scene"]
    });
    assert_eq!(
        coarse["sheets"][1]["fibre_2"],
        json!(format!("{} rad", 90f64.to_radians()))
    );
    assert_eq!(coarse["friction"]["fabric_diaphragm"], json!(0.1));
    assert_eq!(coarse, local);
}

#[test]
fn a_regions_sizes_and_coefficients_are_changed_by_path() {
    let at = "scene: {file: scene.yaml, set: {sheets.ply-1.regions.slick.rectangle.length: \"${length}\", sheets.ply-1.regions.slick.friction.upper-film: \"${mu}\"}}\n      element: m4";
    let block = "  vary:\n    length: [30 mm]\n    mu: [0.2]";
    let study = with(block, &[("scene: scene.yaml\n      element: m4", at)]);
    let region = "    width: 300 mm\n    regions:\n      - {name: slick, rectangle: {length: 20 mm, width: 20 mm}, friction: {upper-film: 0.1}}\n";
    study.mutate("scene.yaml", "    width: 300 mm\n", region);
    let w = load(&study);
    let coarse = step(&w, "coarse@length=30mm,mu=0.2");
    let region = &coarse.parameters["scene"]["sheets"][1]["regions"][0];
    assert_eq!(region["rectangle"]["length"], json!("0.03 m"));
    assert_eq!(region["friction"]["upper-film"], json!(0.2));
}

#[test]
fn a_scene_and_its_materials_are_changed_by_path() {
    let block = "  vary:\n    angle: [0 deg, 45 deg]\n    mu: [0.1]\n    shear: [100 N/m]";
    let set = "scene: {file: scene.yaml, set: {sheets.ply-1.fibre_1: \"-45 deg + ${angle}\", sheets.ply-1.fibre_2: \"45 deg + ${angle}\", friction.fabric_diaphragm: \"${mu}\", \
        sheets.ply-1.material.with.shear: \"${shear}\", sheets.ply-1.material.thickness: 0.5 mm, tool.joggle_spar.joggles.1.rise: -5 mm}}\n      element: m4";
    let study = with(block, &[("scene: scene.yaml\n      element: m4", set)]);
    let w = load(&study);
    let coarse = step(&w, "coarse@angle=45deg,mu=0.1,shear=100N/m");
    let scene = &coarse.parameters["scene"];
    assert_eq!(scene["sheets"][1]["fibre_1"], json!("0 rad"), "{scene:#}");
    assert_eq!(scene["friction"]["fabric_diaphragm"], json!(0.1));
    assert_eq!(
        scene["sheets"][1]["material"]["with"]["shear"],
        json!(100.0)
    );
    assert_eq!(
        scene["sheets"][1]["material"]["thickness"],
        json!("0.0005 m")
    );
    assert_eq!(
        scene["tool"]["joggle_spar"]["joggles"][1]["rise"],
        json!("-0.005 m")
    );
    // The command line reaches the same places, and has the last word.
    let set = |text: &str| {
        let set = [text.parse().unwrap()];
        let w = plyflow_workflow::load_with(&study.path(W), &common::catalog(), &set);
        w.unwrap_or_else(|e| panic!("{}", e.render(false)))
    };
    let w = set("coarse.scene.sheets.ply-1.material.thickness=0.7 mm");
    let coarse = step(&w, "coarse@angle=0deg,mu=0.1,shear=100N/m");
    assert_eq!(
        coarse.parameters["scene"]["sheets"][1]["material"]["thickness"],
        json!("0.0007 m")
    );
    let w = set("local.scene.friction.fabric_diaphragm=0.2");
    let local = w
        .steps
        .iter()
        .find(|s| s.name.starts_with("local"))
        .unwrap();
    assert_eq!(
        local.parameters["scene"]["friction"]["fabric_diaphragm"],
        json!(0.2)
    );
}

#[test]
fn values_that_come_to_the_same_share_a_step() {
    let block = "  vary:\n    a: [1, 2]\n    b: [1, 2]";
    let w = load(&with(
        block,
        &[("damping: 0.1", "damping: \"${a} * ${b} / 10\"")],
    ));
    let coarse: Vec<&str> = names(&w)
        .into_iter()
        .filter(|n| n.starts_with("coarse"))
        .collect();
    assert_eq!(
        coarse,
        ["coarse@a=1,b=1", "coarse@a=1,b=2", "coarse@a=2,b=2"]
    );
    let study = w.study.unwrap();
    assert_eq!(study.points[1].steps, study.points[2].steps);
}

#[test]
fn every_way_to_give_points_is_read() {
    let all = |block: &str| -> Vec<String> {
        let study = Study::sound();
        study.write(
            "cases.csv",
            "# measured\nlimit [deg];d\n4;0.1\n\n6,5;x\n"
                .replace("6,5;x", "6.5;0.2")
                .as_str(),
        );
        study.mutate(W, "on_failure: keep-going\n", &format!("study: {block}\n"));
        study.mutate(W, "damping: 0.1", "damping: ${d}");
        study.mutate(W, LIMIT.0, LIMIT.1);
        let study = load(&study).study.unwrap();
        study.points.into_iter().map(|p| p.name).collect()
    };
    assert_eq!(
        all("{zip: {limit: [4 deg, 6.5 deg], d: [0.1, 0.2]}}"),
        ["limit=4deg,d=0.1", "limit=6.5deg,d=0.2"]
    );
    let wanted = ["limit=4deg,d=0.1", "limit=6.5deg,d=0.2"];
    assert_eq!(all("{points: cases.csv}"), wanted);
    assert_eq!(
        all("{points: [{limit: 4 deg, d: 0.1}, {d: 0.2, limit: 6.5 deg}]}"),
        wanted
    );
    assert_eq!(
        all(
            "{vary: {limit: {from: 1 deg, to: 100 deg, count: 3, scale: log}, d: 0.1}, where: 'limit < 20 deg'}"
        ),
        ["limit=1deg,d=0.1", "limit=10deg,d=0.1"]
    );
    let sampled = all(
        "{sample: {method: sobol, count: 8, seed: 2, of: {limit: {from: 1 deg, to: 9 deg}, d: [0.1, 0.2]}}}",
    );
    assert_eq!(sampled.len(), 8);
    let union =
        "{union: [{vary: {limit: [4 deg, 5 deg], d: 0.1}}, {vary: {limit: 4 deg, d: [0.1, 0.3]}}]}";
    assert_eq!(
        all(union),
        ["limit=4deg,d=0.1", "limit=5deg,d=0.1", "limit=4deg,d=0.3"]
    );
    let product = "{product: [{points: [{limit: 4 deg}]}, {union: [{vary: {d: [0.1]}}, {vary: {d: [0.2]}}]}]}";
    assert_eq!(all(product), ["limit=4deg,d=0.1", "limit=4deg,d=0.2"]);
}

#[test]
fn a_study_that_is_wrong_is_told_where_it_is_wrong() {
    for (block, place, says) in [
        (
            "  vary:\n    limit: {from: 4 deg, to: 9 deg, by: 2 deg}",
            "6:12",
            &["beyond 9 deg", "`to: 8 deg`"][..],
        ),
        (
            "  vary:\n    limit: {from: 4 deg, to: 8 deg}",
            "6:5",
            &["without `by` or `count`"],
        ),
        (
            "  vary: {limit: [4 deg]}\n  zip: {x: [1]}",
            "6:3",
            &["by `vary` and by `zip`", "`product: ["],
        ),
        (
            "  vary: {limit: [4 deg, 5 mm]}",
            "4:1",
            &["an angle at one point and a length at another"],
        ),
        (
            "  vary: {limit: [4 deg]}\n  where: \"limit > 5 deg\"",
            "6:10",
            &["no point"],
        ),
        (
            "  vary: {limit: [4 deg]}\n  where: \"limit > 5 mm\"",
            "6:11",
            &["do not go together"],
        ),
        (
            "  vary: {limit: [4 deg]}\n  where: \"limits > 5 deg\"",
            "6:11",
            &["did you mean `limit`"],
        ),
        (
            "  vary: {limit: [4 deg], spare: [1, 2]}",
            "5:26",
            &["no step depends on `spare`"],
        ),
        (
            "  vary: {max: [4 deg]}",
            "5:10",
            &["`max` cannot name a variable"],
        ),
        (
            "  varry: {limit: [4 deg]}",
            "5:3",
            &["unknown key `varry`", "did you mean `vary`"],
        ),
        ("  where: \"true\"", "5:3", &["gives no points"]),
        (
            "  sample: {method: sobel, count: 3, of: {limit: {from: 1 deg, to: 2 deg}}}",
            "5:20",
            &["did you mean `sobol`"],
        ),
        (
            "  sample: {method: grid, count: 3, of: {limit: [1 deg], b: [1]}}",
            "5:3",
            &["a grid of 2 variables has no 3 points"],
        ),
        ("  points: [{}]", "5:12", &["no variable"]),
        (
            "  vary: {limit: [1e99 deg, 1e-40 deg]}",
            "5:18",
            &["`1e99 deg`", "more digits"],
        ),
        (
            "  vary: {point: [4 deg]}",
            "5:10",
            &["every table of a study has"],
        ),
        ("  vary: {}", "5:9", &["no variable"]),
        ("  union: []", "5:3", &["has no parts"]),
        ("  zip: {limit: []}", "5:16", &["no value"]),
        ("  points: none.csv", "5:11", &["cannot read `none.csv`"]),
        (
            "  at_most_failures: -1\n  vary: {limit: [4 deg]}",
            "5:21",
            &["at least 0"],
        ),
    ] {
        let told = told(&with(block, &[LIMIT]));
        assert!(told.contains(&format!("{W}:{place}: ")), "{block}\n{told}");
        assert!(says.iter().all(|s| told.contains(s)), "{block}\n{told}");
    }
}

#[test]
fn a_table_of_points_may_look_as_any_table() {
    let all = |csv: &str| -> Vec<String> {
        let study = with(
            "  points: cases.csv",
            &[LIMIT, ("damping: 0.1", "damping: ${d}")],
        );
        study.write("cases.csv", csv);
        let study = load(&study).study.unwrap();
        study.points.into_iter().map(|p| p.name).collect()
    };
    let wanted = ["limit=4.5deg,d=0.1", "limit=6deg,d=0.25"];
    for csv in [
        "\u{feff}limit [deg];d\r\n4,5;0,1\r\n6,0;0,25\r\n",
        "sep=;\n\"limit (deg)\";\"d\"\n\"4,5\";\"0,1\"\n6;2,5D-1\n",
        "limit,d\ndeg,-\n4.5,1e-1\n6,.25\n",
        "limit / deg\td\n4.5\t0.1\n// more\n6\t0.25\n",
        "limit;d\n4.5 deg;0.1\n6 deg;0.25\n",
    ] {
        assert_eq!(all(csv), wanted, "{csv}");
    }
}

#[test]
fn a_table_that_is_wrong_is_told_with_its_line() {
    for (csv, line, says) in [
        ("limit [furlong]\n4\n", 1, "furlong"),
        ("limit [deg]\n4\nwide\n", 3, "`wide` is no number"),
        ("limit [deg]\r4\rwide\r", 3, "`wide` is no number"),
        ("limit [deg],x\n4\n", 2, "1 cells, and the head 2"),
        ("limit [deg],\"\"\n4,1\n", 1, "cannot name a variable"),
        ("limit [deg],x\n4,\n", 2, "no value for `x`"),
        ("limit [deg]\n1e99\n", 2, "more digits"),
        (",,\n\"\"\n", 1, "nothing in it"),
        (
            "limit [deg];x\n4,5;1.5\n",
            2,
            "one of them is no decimal sign",
        ),
        ("limit [deg],status\n4,1\n", 1, "every table of a study has"),
    ] {
        let study = with("  points: cases.csv", &[LIMIT]);
        study.write("cases.csv", csv);
        let told = told(&study);
        assert!(
            told.contains(&format!("cases.csv:{line}:")) && told.contains(says),
            "{csv}\n{told}"
        );
    }
}

#[test]
fn a_value_that_does_not_fit_is_told_where_it_stands_and_at_which_point() {
    let block = "  vary:\n    limit: {from: 80 deg, to: 100 deg, by: 10 deg}";
    let told_of = |value: &str| {
        told(&with(
            block,
            &[(LIMIT.0, &format!("over_shear_positive: {value}"))],
        ))
    };
    let found = told_of("${limit}");
    assert!(
        found.contains("`over_shear_positive` is `100 deg`")
            && found.contains("(at the point limit=100deg)"),
        "{found}"
    );
    // Line and column of the value, not of the study.
    let line = format!("{W}:");
    assert!(found.starts_with(&line) || found.contains(&line));
    let found = told_of("\"1 mm + ${limit}\"");
    assert!(
        found.contains("do not go together")
            && found.contains("limit=80deg, and something here also at 2 more"),
        "{found}"
    );
    let found = told_of("\"1 deg + ${limits}\"");
    assert!(
        found.contains("no variable `limits`") && !found.contains("at the point"),
        "{found}"
    );
    let found = told_of("\"1 + ${limit} +\"");
    assert!(found.contains("ends where a value is expected"), "{found}");
    // In a scene, by path: shown in the workflow, where it was written.
    let set = "scene: {file: scene.yaml, set: {sheets.ply-1.fibre_1: \"${limit} * 1 mm\", frictions.x: 1}}\n      element: m4";
    let study = with(
        block,
        &[
            (LIMIT.0, "over_shear_positive: ${limit}"),
            ("scene: scene.yaml\n      element: m4", set),
        ],
    );
    let found = told(&study);
    assert!(
        found.contains("unknown key `frictions`") && !found.contains("scene.yaml:"),
        "{found}"
    );
    for word in ["plugin: defect-detection", "from: coarse"] {
        let (key, _) = word.split_once(':').unwrap();
        let study = with(ANGLES, &[LIMIT, (word, &format!("{key}: ${{limit}}"))]);
        let found = told(&study);
        assert!(
            found.contains(&format!("`{key}` is the same at every point")),
            "{found}"
        );
    }
}

const FRICTION: &str = "{tool_diaphragm: 0.5, tool_fabric: 0.2, fabric_fabric: 0.5, fabric_diaphragm: 0.1, diaphragm_diaphragm: 0.5}";

#[test]
fn what_is_set_is_never_taken_away_by_what_is_set_behind_it() {
    let block = "  vary:\n    limit: [4 deg, 5 deg]";
    let set = |set: &str| {
        let text = format!("scene: {{file: scene.yaml, set: {{{set}}}}}\n      element: m4");
        with(
            block,
            &[LIMIT, ("scene: scene.yaml\n      element: m4", &text)],
        )
    };
    for (wrong, says) in [
        (
            "sheets.ply-1.fibre_1: 0 deg, sheets.ply-1: {name: x}",
            "`sheets.ply-1` takes `sheets.ply-1.fibre_1` away again",
        ),
        (
            "friction.fabric_fabric: 0.1, ' friction . fabric_fabric ': 0.2",
            "takes `friction.fabric_fabric` away again",
        ),
    ] {
        let told = told(&set(wrong));
        assert!(told.contains(says) && told.contains(W), "{wrong}\n{told}");
    }
    // A longer path behind a shorter one changes a part of it; and the command line has the last word.
    let study = set(&format!(
        "friction: {FRICTION}, friction.fabric_fabric: 0.3"
    ));
    let friction = |set: &str| {
        let set = [set.parse().unwrap()];
        let w = plyflow_workflow::load_with(&study.path(W), &common::catalog(), &set);
        let w = w.unwrap_or_else(|e| panic!("{}", e.render(false)));
        step(&w, "coarse").parameters["scene"]["friction"]["fabric_fabric"].clone()
    };
    assert_eq!(friction("coarse.damping=0.1"), json!(0.3));
    assert_eq!(
        friction("coarse.scene.friction.fabric_fabric=0.4"),
        json!(0.4)
    );
    let whole = format!("coarse.scene.friction={FRICTION}");
    assert_eq!(friction(&whole), json!(0.5));
}

#[test]
fn resources_may_vary_and_are_checked_at_every_point() {
    let block = "  vary: {n: [1, 2, 5000]}";
    let study = with(block, &[("cores: 2", "cores: \"${n}\"")]);
    let found = told(&study);
    assert!(
        found.contains("at most 4096") && found.contains("at the point n=5000"),
        "{found}"
    );
    study.mutate(W, ", 5000", "");
    let w = load(&study);
    assert_eq!(step(&w, "coarse@n=2").resources.cores, 2);
}

#[test]
fn without_a_study_signs_of_variables_are_plain_text() {
    let study = Study::sound();
    study.mutate(
        W,
        "contact: penalty",
        "contact: penalty\n      label: \"${x}\"",
    );
    let w = load(&study);
    assert_eq!(step(&w, "coarse").parameters["label"], json!("${x}"));
    study.mutate(
        W,
        "steps:\n",
        "responses: {r: {step: coarse, result: kinetic_ratio}}\nsteps:\n",
    );
    assert!(told(&study).contains("`responses` in a workflow without a study"));
}

#[test]
fn a_value_of_the_command_line_in_the_place_of_a_variable_is_refused_unless_another_step_has_it() {
    let refused = |block: &str, changes: &[(&str, &str)], set: &str| {
        let study = with(block, changes);
        let set = [set.parse().unwrap()];
        let loaded = plyflow_workflow::load_with(&study.path(W), &common::catalog(), &set);
        loaded.err().map(|found| found.to_string())
    };
    let limit = "defects.over_shear_positive=5 deg";
    for block in [
        "  vary: {limit: [4 deg]}",
        "  zip: {limit: [4 deg, 6 deg], d: [0.1, 0.2]}",
        "  points: [{limit: 4 deg, d: 0.1}, {limit: 6 deg, d: 0.2}]",
    ] {
        let damping = ("damping: 0.1", "damping: ${d}");
        let changes = match block.contains("vary") {
            true => vec![LIMIT],
            false => vec![LIMIT, damping],
        };
        let told = refused(block, &changes, limit).expect(block);
        assert!(
            told.contains("takes the place of `${limit}`") && told.contains("--set:1:1"),
            "{block}\n{told}"
        );
        assert_eq!(refused(block, &changes, "coarse.element_size=9 mm"), None);
    }
    // What a path in a scene sets is a place as well.
    let scene = (
        "scene: scene.yaml\n      element: m4",
        "scene: {file: scene.yaml, set: {friction.fabric_diaphragm: \"${mu}\"}}\n      element: m4",
    );
    let told = refused(
        "  vary: {mu: [0.1]}",
        &[scene],
        "coarse.scene.friction.fabric_diaphragm=0.3",
    );
    assert!(told.unwrap().contains("takes the place of `${mu}`"));
    // Elsewhere the variable is still what the points are told by.
    let both = [LIMIT, ("damping: 0.1", "damping: \"${limit} / 80 deg\"")];
    assert_eq!(refused("  vary: {limit: [4 deg]}", &both, limit), None);
}
