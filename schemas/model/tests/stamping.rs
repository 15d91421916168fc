//! Rules of stamping: what a scene's words tell of parts that cannot be.

use plyflow_model::fault::Rule;
use plyflow_model::given::{AskedFor, asks};
use plyflow_model::rules;
use plyflow_model::rules::surfaces::contacts;
use plyflow_model::scene::Scene;
use serde_json::{Value, json};

/// A ply of 0.4 mm over a double dome under its matching die, a pad that is pressed and a gripper.
fn stamped(change: impl FnOnce(&mut Value)) -> Value {
    let material = json!({"plyflow_material": 1, "name": "m", "plugin": "material-fabric", "thickness": "0.4 mm", "areal_mass": "0.4 kg/m2", "with": {}});
    let mut scene = json!({
        "plyflow_scene": 1, "name": "s",
        "tool": {"double_dome": {"dome_radius": "60 mm", "dome_distance": "180 mm", "waist_radius": "150 mm", "wall": "30 mm", "facet_size": "8 mm"}},
        "sheets": [{"name": "a", "kind": "ply", "material": material, "length": "400 mm", "width": "200 mm", "fibre_1": "0 deg", "fibre_2": "90 deg"}],
        "friction": {"tool_fabric": 0.2},
        "process": {"stamping": {"forming_time": "100 ms", "settling_time": "10 ms",
            "parts": [
                {"name": "die", "side": "above", "matching": {"gap": "0.5 mm", "edge_radius": "10 mm", "face": "12 mm", "length": "400 mm", "width": "240 mm"},
                 "motion": {"table": [{"time": "0 ms", "way": "80 mm"}, {"time": "100 ms", "way": "0 mm"}]}},
                {"name": "pad", "side": "below", "foot": "70 mm", "motion": {"pressed": {"force": "10 N", "spring": "1 N/mm"}},
                 "tool": {"flat": {"length": "50 mm", "width": "50 mm", "height": "20 mm", "fillet": "4 mm", "facet_size": "10 mm"}}}],
            "grippers": [{"ply": "a", "centre": ["195 mm", "0 mm"], "length": "20 mm", "width": "50 mm", "pull": "0 deg", "force": "5 N"}]}}
    });
    change(&mut scene);
    scene
}

fn read(scene: Value) -> Scene {
    Scene::from_json(scene).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn a_sound_stamping_keeps_every_rule_and_every_part_rubs_on_every_ply() {
    let scene = read(stamped(|_| {}));
    assert_eq!(rules::check(&scene).map_err(|e| e.to_string()), Ok(()));
    let sheets: Vec<_> = scene.sheets.iter().collect();
    let found = contacts(&sheets, &scene.process);
    let pairs: Vec<[&str; 2]> = found.iter().map(|c| c.parts).collect();
    assert_eq!(pairs, [["tool", "a"], ["a", "die"], ["pad", "a"]]);
}

#[test]
fn what_a_scene_writes_of_a_stamping_is_what_it_reads() {
    let scene = read(stamped(|_| {}));
    let again = Scene::from_json(serde_json::to_value(&scene).unwrap()).unwrap();
    assert_eq!(scene, again);
}

#[test]
fn a_body_of_another_step_is_asked_for_at_its_part() {
    let scene = read(stamped(|s| {
        s["process"]["stamping"]["parts"][1]["tool"] = json!({"input": {"body": "block"}});
    }));
    let asked: Vec<(String, AskedFor)> = asks(&scene)
        .into_iter()
        .map(|(p, a)| (p.to_string(), a))
        .collect();
    let path = "process.stamping.parts[1].tool.input.body".to_owned();
    assert_eq!(asked, [(path, AskedFor::Body("block".into()))]);
}

/// Changes the stamping of a scene.
type Change = fn(&mut Value);

#[test]
fn what_makes_no_stamping_is_refused_with_its_place_and_what_is_expected() {
    let cases: [(Change, Rule, &str, &str); 26] = [
        (
            |s| s["parts"][1]["name"] = json!("die"),
            Rule::Name,
            "parts[1].name: the name `die` is taken",
            "a name of its own",
        ),
        (
            |s| s["parts"][1]["name"] = json!("a"),
            Rule::Name,
            "sheets[0].name: the name `a` is taken",
            "those of rigid parts",
        ),
        (
            |s| s["parts"][1]["name"] = json!("bed"),
            Rule::Name,
            "parts[1].name: the name `bed` is taken",
            "other than `bed`",
        ),
        (
            |s| s["parts"][1]["name"] = json!("a b"),
            Rule::Name,
            "parts[1].name: `a b` cannot name a body",
            "letters",
        ),
        (
            |s| s["parts"][1]["tool"] = Value::Null,
            Rule::Press,
            "the part `pad` has no surface",
            "`tool: ..` or `matching: ..`",
        ),
        (
            |s| s["parts"][0]["tool"] = s["parts"][1]["tool"].clone(),
            Rule::Press,
            "the part `die` has two surfaces",
            "one of them",
        ),
        (
            |s| s["parts"][1]["name"] = json!("tool"),
            Rule::Press,
            "parts[1].tool: `tool` stands at the part `tool`",
            "another name",
        ),
        (
            |s| s["parts"][1]["tool"]["flat"]["fillet"] = json!("30 mm"),
            Rule::Tool,
            "process.stamping.parts[1].tool.flat",
            "mm",
        ),
        (
            |s| s["parts"][1]["up"] = json!([0, 0, 0]),
            Rule::Tool,
            "parts[1].up: the vector has no length",
            "an axis",
        ),
        (
            |s| s["parts"][1]["direction"] = json!([0, 0, 0]),
            Rule::Press,
            "parts[1].direction: the vector has no length",
            "an axis",
        ),
        (
            |s| s["parts"][0]["side"] = json!("below"),
            Rule::Press,
            "a matching die below the plies",
            "`side: above`",
        ),
        (
            |s| s["parts"][0]["foot"] = json!("1 mm"),
            Rule::Press,
            "a matching die has its place from the tool",
            "leave out",
        ),
        (
            |s| s["parts"][0]["matching"]["gap"] = json!("0.3 mm"),
            Rule::Press,
            "matching.gap: given 0.3 mm",
            "0.4 mm thick",
        ),
        (
            |s| s["parts"][0]["matching"]["face"] = json!("21 mm"),
            Rule::Press,
            "matching.face: given 21 mm",
            "`wall` of the double dome (30 mm)",
        ),
        (
            |s| s["parts"][0]["matching"]["length"] = json!("320 mm"),
            Rule::Press,
            "matching.length: given 320 mm",
            "more than 321 mm",
        ),
        (
            |s| s["parts"][0]["motion"]["table"] = json!([]),
            Rule::Press,
            "table: the table has no row",
            "two or more",
        ),
        (
            |s| s["parts"][0]["motion"]["table"][0]["time"] = json!("1 ms"),
            Rule::Press,
            "table[0].time: given 1 ms",
            "`0 s` in the first row",
        ),
        (
            |s| s["parts"][0]["motion"]["table"][1]["time"] = json!("0 ms"),
            Rule::Press,
            "table[1].time: given 0 ms",
            "more than the 0 ms",
        ),
        (
            |s| s["parts"][0]["motion"]["table"][1]["time"] = json!("101 ms"),
            Rule::Press,
            "table[1].time: given 101 ms",
            "`forming_time` (100 ms)",
        ),
        (
            |s| s["parts"][1]["motion"]["pressed"]["force"] = json!("-1 N"),
            Rule::Press,
            "pressed.force: given -1 N",
            "0 N or more",
        ),
        (
            |s| s["parts"][1]["motion"]["pressed"] = json!({"force": "0 N"}),
            Rule::Press,
            "neither a force nor a spring presses the part",
            "more than 0 N",
        ),
        (
            |s| {
                s["parts"][1] = json!({"name": "tool", "side": "below", "motion": {"pressed": {"force": "5 N"}}})
            },
            Rule::Press,
            "parts[1].motion.pressed: the scene's own tool is pressed",
            "`table: [..]`",
        ),
        (
            |s| {
                let rows =
                    json!([{"time": "0 ms", "way": "9 mm"}, {"time": "50 ms", "way": "2 mm"}]);
                s["parts"][1] = json!({"name": "tool", "side": "below", "motion": {"table": rows}});
            },
            Rule::Press,
            "parts[1].motion.table[1].way: given 2 mm",
            "`0 mm` in the last row",
        ),
        (
            |s| s["parts"] = json!([]),
            Rule::Press,
            "parts: no part moves",
            "`motion: {table: [..]}`",
        ),
        (
            |s| s["grippers"][0]["ply"] = json!("b"),
            Rule::Press,
            "grippers[0].ply: no ply of this scene is called `b`",
            "`a`",
        ),
        (
            |s| s["grippers"][0]["centre"] = json!(["250 mm", "0 mm"]),
            Rule::Press,
            "the gripper holds no place of `a`",
            "onto the ply",
        ),
    ];
    for (change, rule, says, expects) in cases {
        let scene = read(stamped(|s| change(&mut s["process"]["stamping"])));
        let fault = rules::check(&scene).expect_err(says);
        let text = fault.to_string();
        assert_eq!(fault.rule, rule, "{text}");
        assert!(
            text.contains(says) && text.contains(expects),
            "'{says}' and '{expects}' in: {text}"
        );
    }
}

#[test]
fn beside_a_mirror_plane_nothing_moves_across_it_and_nothing_grips() {
    let told = |change: Change| {
        let scene = read(stamped(|s| {
            s["symmetry"] = json!(["x"]);
            change(&mut s["process"]["stamping"]);
        }));
        rules::check(&scene).expect_err("refused").to_string()
    };
    let across = told(|s| {
        s["grippers"] = json!([]);
        s["parts"][1]["direction"] = json!([1, 0, -1]);
    });
    assert!(
        across.contains("`pad` moves across the mirror plane x = 0"),
        "{across}"
    );
    let grips = told(|_| {});
    assert!(
        grips.contains("grippers") && grips.contains("`symmetry`"),
        "{grips}"
    );
}
