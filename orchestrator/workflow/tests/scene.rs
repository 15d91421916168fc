//! Rules of a scene as a whole: the stack and its process, pairs of friction, frame and fibres.

mod common;

use common::{Study, WORKFLOW};

const S: &str = "scene.yaml";

/// A process with one film.
const SINGLE: &str = "process:\n  single_diaphragm:\n    frame_length: 1.8 m\n    frame_width: 1.5 m\n    clearance: 5 mm\n    forming_pressure: 1 bar\n\
    \x20   stretching_time: 5 ms\n    lowering_time: 20 ms\n    drawing_time: 20 ms\n    settling_time: 5 ms\n";

/// The scene with other sheets and another process.
fn scene(sheets: &[(&str, &str)], friction: &str, process: &str) -> String {
    let sheet = |(name, kind): &(&str, &str)| match *kind {
        "ply" => format!(
            "  - {{name: {name}, kind: ply, material: materials/fabric.yaml, length: 48 mm, width: 30 mm, fibre_2: 90 deg}}\n"
        ),
        _ => format!("  - {{name: {name}, kind: {kind}, material: film.yaml}}\n"),
    };
    let part = |from: &str, to: &str| {
        let start = common::SCENE.find(from).unwrap();
        &common::SCENE[start..common::SCENE.find(to).unwrap()]
    };
    let process = match process {
        "press" => {
            "process:\n  press:\n    stroke: 50 mm\n    forming_time: 1 s\n    settling_time: 0 s\n    die: {opening_radius: 20 mm, edge_radius: 6 mm}\n".to_owned()
        }
        "single_diaphragm" => SINGLE.to_owned(),
        _ => common::SCENE[common::SCENE.find("process:").unwrap()..].to_owned(),
    };
    let sheets: String = sheets.iter().map(sheet).collect();
    let friction = format!(
        "{}  tool_fabric: 0.2\n{friction}",
        part("friction:", "process:")
    );
    let head = &common::SCENE[..common::SCENE.find("sheets:").unwrap()];
    format!("{head}sheets:\n{sheets}{friction}{process}")
}

/// What is found in a scene; empty when it is sound.
fn told(text: &str) -> String {
    let study = Study::sound();
    study.write(S, text);
    // Its limits name a ply that these scenes need not have.
    let (without_limits, _) = WORKFLOW.split_once("limits:\n").expect("limits come last");
    study.write("workflow.yaml", without_limits);
    study
        .load()
        .err()
        .map(|d| d.to_string())
        .unwrap_or_default()
}

#[test]
fn the_stack_is_in_the_order_of_its_process() {
    let (film, ply) = ("diaphragm", "ply");
    for (process, kinds, wrong) in [
        ("double_diaphragm", &[film, ply, film][..], None),
        ("double_diaphragm", &[film, ply, ply, ply, film], None),
        (
            "double_diaphragm",
            &[ply],
            Some((0, "a diaphragm below it")),
        ),
        (
            "double_diaphragm",
            &[film],
            Some((0, "plies and a diaphragm above it")),
        ),
        (
            "double_diaphragm",
            &[film, film],
            Some((1, "a ply below it")),
        ),
        (
            "double_diaphragm",
            &[film, ply, film, ply, film],
            Some((2, "no further diaphragm here")),
        ),
        (
            "double_diaphragm",
            &[film, ply, ply],
            Some((2, "a diaphragm above it")),
        ),
        ("single_diaphragm", &[ply, film], None),
        ("single_diaphragm", &[ply, ply, film], None),
        (
            "single_diaphragm",
            &[film, ply, film],
            Some((0, "no diaphragm here: one or more plies, one diaphragm")),
        ),
        (
            "single_diaphragm",
            &[ply, film, ply, film],
            Some((1, "no diaphragm here")),
        ),
        (
            "single_diaphragm",
            &[ply, ply],
            Some((1, "a diaphragm above it")),
        ),
        ("single_diaphragm", &[film], Some((0, "plies below it"))),
        ("press", &[ply], None),
        ("press", &[ply, ply], None),
        ("press", &[ply, film], Some((1, "plies alone"))),
        ("press", &[film, ply, film], Some((0, "plies alone"))),
    ] {
        let names: Vec<String> = (0..kinds.len()).map(|i| format!("s{i}")).collect();
        let sheets: Vec<(&str, &str)> = names
            .iter()
            .map(String::as_str)
            .zip(kinds.iter().copied())
            .collect();
        let text = scene(&sheets, "", process);
        let found = told(&text);
        let Some((at, says)) = wrong else {
            assert_eq!(found, "", "{process} {kinds:?}");
            continue;
        };
        let before = text.find(&format!("name: s{at},")).unwrap();
        let line = text[..before].matches('\n').count() + 1;
        assert!(
            found.contains(&format!("scene.yaml:{line}:")) && found.contains(says),
            "{process} {kinds:?}: {found}"
        );
        assert_eq!(found.lines().count(), 1, "{found}");
    }
}

#[test]
fn pairs_of_friction_are_those_of_the_process() {
    let of = |process: &str, pairs: &str| {
        let sheets: &[(&str, &str)] = match process {
            "press" => &[("a", "ply"), ("b", "ply")],
            "single_diaphragm" => &[("a", "ply"), ("b", "ply"), ("high", "diaphragm")],
            _ => &[("low", "diaphragm"), ("a", "ply"), ("high", "diaphragm")],
        };
        let pairs: String = pairs
            .split(' ')
            .map(|p| {
                format!(
                    "    - {{between: [{}], coefficient: 0.3}}\n",
                    p.replace('+', ", ")
                )
            })
            .collect();
        told(&scene(sheets, &format!("  pairs:\n{pairs}"), process))
    };
    assert_eq!(
        of("double_diaphragm", "low+tool bed+low low+a high+a low+high"),
        ""
    );
    assert_eq!(of("press", "tool+a tool+b die+b die+a a+b"), "");
    let all = "tool+a tool+b tool+high bed+a bed+b bed+high a+b high+b high+a";
    assert_eq!(of("single_diaphragm", all), "");
    // Plies slide: what is further apart in the stack meets past the edges of the others, as the solver has it.
    let sheets = [
        ("low", "diaphragm"),
        ("a", "ply"),
        ("b", "ply"),
        ("high", "diaphragm"),
    ];
    let pairs = "  pairs:\n    - {between: [low, b], coefficient: 0.3}\n";
    assert_eq!(told(&scene(&sheets, pairs, "double_diaphragm")), "");
    for (process, pair, says) in [
        ("press", "bed+a", "called `bed`"),
        // This press has none.
        ("press", "holder+a", "called `holder`"),
        ("press", "die+tool", "do not rub"),
        ("double_diaphragm", "bed+a", "do not rub"),
        ("double_diaphragm", "a+a", "do not rub"),
        ("double_diaphragm", "low+a a+low", "named twice"),
    ] {
        let found = of(process, pair);
        assert!(found.contains(says), "{process} {pair}: {found}");
    }
}

#[test]
fn the_frame_holds_every_ply_where_it_lies() {
    let study = Study::sound();
    let found = |size: &str, frame: &str| {
        let size = common::SCENE.replace("    length: 480 mm\n    width: 300 mm\n", size);
        study.write(S, &size.replace("frame_width: 1.5 m", frame));
        study
            .load()
            .err()
            .map(|d| d.to_string())
            .unwrap_or_default()
    };
    let rectangle = "    length: 480 mm\n    width: 300 mm\n";
    assert_eq!(found(rectangle, "frame_width: 300 mm"), "");
    let moved = format!("{rectangle}    centre: [0 mm, -20 mm]\n");
    let told = found(&moved, "frame_width: 300 mm");
    assert!(told.contains("more than the 340 mm"), "{told}");
    let round = "    outline: {circle: {centre: [0 mm, 10 mm], radius: 160 mm}}\n";
    let told = found(round, "frame_width: 300 mm");
    assert!(told.contains("more than the 340 mm"), "{told}");
}

#[test]
fn families_cross_at_six_degrees_or_more() {
    for (first, second, sound) in [
        ("45 deg", "-45 deg", true),
        ("0 deg", "6 deg", true),
        ("0 deg", "-174 deg", true),
        ("10 deg", "15.9 deg", false),
        ("10 deg", "190 deg", false),
        ("-90 deg", "85 deg", false),
    ] {
        let study = Study::sound();
        study.mutate(S, "fibre_1: 45 deg", &format!("fibre_1: {first}"));
        study.mutate(S, "fibre_2: -45 deg", &format!("fibre_2: {second}"));
        assert_eq!(study.load().is_ok(), sound, "{first}, {second}");
    }
}

#[test]
fn an_stl_without_its_unit_is_told_the_form() {
    let spar = common::SCENE.find("tool:").unwrap()..common::SCENE.find("sheets:").unwrap();
    for (tool, says) in [
        (
            "tool: {stl: spar.stl}\n",
            "write `stl: {file: spar.stl, unit: 1 mm}`",
        ),
        (
            "tool: spar.stl\n",
            "write `tool: {stl: {file: spar.stl, unit: 1 mm}}`",
        ),
        (
            "tool: spar.STEP\n",
            "a step reads `spar.STEP` and gives a body: `tool: {input: {body: ..}}`",
        ),
    ] {
        let mut text = common::SCENE.to_owned();
        text.replace_range(spar.clone(), tool);
        let found = told(&text);
        assert!(found.contains(says), "{found}");
    }
}

#[test]
fn words_that_place_a_tool_are_read_in_all_their_forms_and_wrong_ones_are_told_what_fits() {
    let study = Study::sound();
    study.write("spar.stl", "solid\nendsolid\n");
    let spar = common::SCENE.find("tool:").unwrap()..common::SCENE.find("sheets:").unwrap();
    let with = |words: &str| {
        let mut text = common::SCENE.to_owned();
        let tool = format!("tool: {{stl: {{file: spar.stl, unit: 1 mm, {words}}}}}\n");
        text.replace_range(spar.clone(), &tool);
        study.write(S, &text);
        study
            .load()
            .err()
            .map(|d| d.to_string())
            .unwrap_or_default()
    };
    for sound in [
        "up: +y",
        "up: [0, 0.5, 1]",
        "rotate: -30 deg",
        "rotate: [{axis: -x, angle: 90 deg}, {axis: [1, 1, 0], angle: 0.1 rad}]",
        "centre: auto",
        "centre: [1 mm, -2 mm]",
        "foot: auto",
        "foot: 5 mm",
        "translate: [1 m, 0 m, 0 m], up: -z, rotate: 90 deg, centre: auto, foot: auto",
    ] {
        assert_eq!(with(sound), "", "{sound}");
    }
    for (wrong, says) in [
        ("up: y", &["`up` is `y`", "did you mean `+y`?"][..]),
        (
            "up: 3",
            &["`up` is the number 3", "an axis such as `+y`, or a vector"],
        ),
        (
            "up: [0, 0, 0]",
            &["the vector has no length", "such as `+y`"],
        ),
        ("up: [0, 1]", &["`up` has 2 items", "3 items"]),
        (
            "rotate: 90",
            &[
                "`rotate` is the number 90",
                "an angle about z such as `90 deg`",
            ],
        ),
        (
            "rotate: [{axis: +z}]",
            &["`angle` is missing in `rotate[0]`"],
        ),
        (
            "rotate: [{axis: z, angle: 1 deg}]",
            &["`axis` is `z`", "did you mean `+z`?"],
        ),
        (
            "rotate: [{axis: [0, 0, 0], angle: 1 deg}]",
            &["the vector has no length"],
        ),
        ("centre: mid", &["`centre` is `mid`", "`auto`"]),
        (
            "centre: 3",
            &[
                "`centre` is the number 3",
                "`auto`, or a place of the scene",
            ],
        ),
        (
            "foot: atuo",
            &["`foot` is `atuo`", "`auto` or a length with its unit"],
        ),
        ("foot: 5", &["`5` has no unit", "`5 mm`"]),
        ("foot: 5 kg", &["`foot`", "a length such as"]),
    ] {
        let told = with(wrong);
        for part in says {
            assert!(told.contains(part), "{wrong}: {part} in {told}");
        }
    }
}

#[test]
fn a_gap_of_the_holder_and_an_opening_of_the_die_are_held_against_the_plies() {
    let with = |die: &str, gap: &str| {
        let text = scene(&[("a", "ply"), ("b", "ply")], "", "press");
        let die = format!("die: {{opening_radius: {die}, edge_radius: 6 mm}}");
        let holder = format!("{die}\n    holder: {{hold: {{gap: {gap}}}}}");
        let changed = text.replace("die: {opening_radius: 20 mm, edge_radius: 6 mm}", &holder);
        assert_ne!(changed, text);
        told(&changed)
    };
    assert_eq!(with("20 mm", "0.8 mm"), "");
    // The materials' files say how thick the plies are.
    let thin = with("20 mm", "0.7 mm");
    assert!(
        thin.contains("`gap` is `0.7 mm`") && thin.contains("0.8 mm thick"),
        "{thin}"
    );
    let wide = with("40 mm", "0.8 mm");
    assert!(wide.contains("`opening_radius` is `40 mm`"), "{wide}");
}

#[test]
fn a_slip_in_one_part_hides_nothing_in_another() {
    let text = scene(
        &[("low", "diaphragm"), ("a", "ply"), ("high", "ply")],
        "",
        "bag",
    );
    let text = text.replacen("fibre_2: 90 deg", "fibre_1: 90 deg, fibre_2: 90", 1);
    let text = text.replacen("fabric_fabric: 0.35", "fabric_fabric: 0,35", 1);
    let found = told(&text);
    for says in ["a diaphragm above it", "has no unit", "write `0.35`"] {
        assert!(found.contains(says), "{says} in {found}");
    }
    assert!(
        !found.contains("needs `fibre_2`") && !found.contains("is missing"),
        "{found}"
    );
}

#[test]
fn what_does_not_fit_a_single_film_is_told_at_its_place() {
    let sheets = [("a", "ply"), ("high", "diaphragm")];
    let sound = scene(&sheets, "", "single_diaphragm");
    assert_eq!(told(&sound), "");
    let after = |line: &str| {
        let settled = "    settling_time: 5 ms\n";
        sound.replace(settled, &format!("{settled}{line}\n"))
    };
    let last = sound.lines().count() + 1;
    for (line, says) in [
        (
            "    frame_height: 3 mm",
            "no `frame_height` where there is a bed",
        ),
        ("    weight: away", "pulls the plies off the tool"),
        ("    surroundings: 0 bar", "more than 0 Pa"),
        ("    bag_pressure: 1 bar", "unknown key `bag_pressure`"),
        (
            "    surroundings: 0.9 bar",
            "at most `surroundings` (0.9 bar",
        ),
    ] {
        let found = told(&after(line));
        // What is drawn is wrong where it stands itself.
        let at = match line {
            "    surroundings: 0.9 bar" => last - 5,
            _ => last,
        };
        assert!(
            found.contains(&format!("scene.yaml:{at}:")) && found.contains(says),
            "{line}: {found}"
        );
    }
    let drawn = told(&sound.replace("forming_pressure: 1 bar", "forming_pressure: 1.2 bar"));
    assert!(drawn.contains("at most `surroundings` (1 bar)"), "{drawn}");
    let hung = "    bed: false\n    frame_height: 3 mm\n    weight: tool";
    assert_eq!(told(&after(hung)), "");
    // Plies lie on the tool itself.
    let bare = told(&sound.replace("  tool_fabric: 0.2\n", ""));
    assert!(
        bare.contains("`tool_fabric` is missing") && bare.contains("`tool` and `a` touch"),
        "{bare}"
    );
    let two = told(&sound.replace("  diaphragm_diaphragm: 0.5\n", ""));
    assert_eq!(two, "");
}
