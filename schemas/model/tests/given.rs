//! What a scene takes from other steps: what it asks for, what is put in its place, and what is told where that is missing or wrong.

use plyflow_model::given::{AskedFor, Geometry, GivenOutline, asks, fill};
use plyflow_model::outline::{OutlineError, Point};
use plyflow_model::rules;
use plyflow_model::scene::{Scene, Tool};
use plyflow_model::tool::GivenSurface;
use serde_json::{Value, json};

fn material(name: &str) -> Value {
    json!({"plyflow_material": 1, "name": name, "plugin": "none", "thickness": "0.3 mm", "areal_mass": "0.4 kg/m2", "with": {"stitch": {}}})
}

fn scene(tool: Value, ply: Value) -> Scene {
    let film =
        |name: &str| json!({"name": name, "kind": "diaphragm", "material": material("film")});
    let mut own = json!({"name": "ply_1", "kind": "ply", "material": material("woven"), "fibre_1": "-45 deg", "fibre_2": "45 deg"});
    for (key, value) in ply.as_object().unwrap() {
        own[key] = value.clone();
    }
    let scene = json!({
        "plyflow_scene": 1, "name": "test", "tool": tool, "sheets": [film("lower"), own, film("upper")],
        "friction": {"tool_diaphragm": 0.5, "fabric_diaphragm": 0.4, "fabric_fabric": 0.3, "diaphragm_diaphragm": 0.3},
        "process": {"double_diaphragm": {
            "frame_length": "1 m", "frame_width": "1 m", "clearance": "0.005 m", "bag_pressure": "1e5 Pa",
            "forming_pressure": "1e5 Pa", "bagging_time": "0.1 s", "lowering_time": "0.1 s",
            "drawing_time": "0.1 s", "settling_time": "0.1 s", "film_joint_margin": "0.03 m",
        }},
    });
    Scene::from_json(scene).unwrap_or_else(|e| panic!("{e}"))
}

fn square(half: f64) -> Vec<Point> {
    vec![[-half, -half], [half, -half], [half, half], [-half, half]]
}

/// Name, corners, and corners of the holes.
type Drawn = (&'static str, Vec<Point>, Vec<Vec<Point>>);

/// The outlines of one step, and one body.
struct Made(Vec<Drawn>);

impl Geometry for Made {
    fn body(&self, name: &str) -> Result<GivenSurface, String> {
        (name == "hat")
            .then(|| GivenSurface {
                step: "cad".into(),
                points: vec![[0.0; 3]],
                triangles: Vec::new(),
            })
            .ok_or_else(|| "none such".into())
    }

    fn outline(&self, name: &str) -> Result<GivenOutline, String> {
        let found = self.0.iter().find(|o| o.0 == name);
        let (_, outline, holes) = found.ok_or("none such")?.clone();
        Ok(GivenOutline {
            step: "dxf".into(),
            outline,
            holes,
        })
    }
}

fn made() -> Made {
    Made(vec![
        ("blank", square(0.1), vec![square(0.01)]),
        ("plain", square(0.02), vec![]),
        (
            "bow",
            vec![[0.0, 0.0], [0.1, 0.1], [0.1, 0.0], [0.0, 0.1]],
            vec![],
        ),
        ("out", square(0.1), vec![square(0.2)]),
    ])
}

fn asking() -> Scene {
    let region = json!({"name": "r", "polygon": {"input": "plain"}, "stitches": "removed"});
    let listed = json!([["30 mm", "30 mm"], ["40 mm", "30 mm"], ["40 mm", "40 mm"]]);
    let ply = json!({"outline": {"input": "blank"}, "holes": [listed], "centre": ["10 mm", "0 mm"], "regions": [region]});
    scene(json!({"input": {"body": "hat"}}), ply)
}

#[test]
fn all_that_a_scene_asks_for_is_listed_with_its_place_and_kept_by_its_words() {
    let scene = asking();
    let listed: Vec<(String, AskedFor)> = asks(&scene)
        .into_iter()
        .map(|(p, a)| (p.to_string(), a))
        .collect();
    assert_eq!(
        listed,
        [
            ("tool.input.body".to_owned(), AskedFor::Body("hat".into())),
            (
                "sheets[1].outline.input".to_owned(),
                AskedFor::Outline("blank".into())
            ),
            (
                "sheets[1].regions[0].polygon.input".to_owned(),
                AskedFor::Outline("plain".into())
            ),
        ]
    );
    let written = serde_json::to_value(&scene).unwrap();
    assert_eq!(written["sheets"][1]["outline"], json!({"input": "blank"}));
    assert_eq!(Scene::from_json(written).unwrap(), scene);
    // What is filled in is no word of the tool.
    let mut filled = scene.clone();
    fill(&mut filled, &made()).unwrap();
    assert_eq!(
        serde_json::to_value(&filled.tool).unwrap(),
        serde_json::to_value(&scene.tool).unwrap()
    );
}

#[test]
fn what_is_not_filled_in_breaks_no_rule_and_has_no_region() {
    let scene = asking();
    rules::check(&scene).unwrap();
    let error = scene.sheets[1].region().unwrap_err();
    assert!(matches!(error, OutlineError::NotRead { .. }), "{error}");
    assert!(
        error
            .to_string()
            .contains("outline is `blank` of another step"),
        "{error}"
    );
}

#[test]
fn a_filled_scene_is_the_one_with_the_same_points_listed() {
    let mut filled = asking();
    fill(&mut filled, &made()).unwrap();
    let Tool::Input(tool) = &filled.tool else {
        panic!("{:?}", filled.tool)
    };
    assert_eq!(tool.given.as_ref().unwrap().step, "cad");
    let texts = |corners: &[Point]| -> Value {
        corners
            .iter()
            .map(|p| json!([format!("{} m", p[0]), format!("{} m", p[1])]))
            .collect()
    };
    let listed_hole = json!([["30 mm", "30 mm"], ["40 mm", "30 mm"], ["40 mm", "40 mm"]]);
    let listed = json!({
        "outline": texts(&square(0.1)), "holes": [listed_hole, texts(&square(0.01))], "centre": ["10 mm", "0 mm"],
        "regions": [{"name": "r", "polygon": texts(&square(0.02)), "stitches": "removed"}],
    });
    let listed = scene(json!({"input": {"body": "hat"}}), listed);
    assert_eq!(filled.sheets, listed.sheets);
    assert_eq!(
        filled.sheets[1].region().unwrap(),
        listed.sheets[1].region().unwrap()
    );
    rules::check(&filled).unwrap();
}

#[test]
fn rules_hold_for_what_is_filled_in() {
    let large = Made(vec![("blank", square(0.6), vec![])]);
    let mut scene = scene(
        json!({"input": {"body": "hat"}}),
        json!({"outline": {"input": "blank"}}),
    );
    fill(&mut scene, &large).unwrap();
    let text = rules::check(&scene).unwrap_err().to_string();
    assert!(
        text.contains(
            "frame_length: given 1000 mm; expected more than the 1200 mm that ply `ply_1` takes"
        ),
        "{text}"
    );
}

#[test]
fn what_is_missing_or_bounds_no_region_is_told_with_place_and_step() {
    let told = |tool: Value, ply: Value| fill(&mut scene(tool, ply), &made()).unwrap_err();
    let hat = || json!({"input": {"body": "hat"}});
    let none = told(
        json!({"input": {"body": "hut"}}),
        json!({"outline": {"input": "blank"}}),
    );
    assert_eq!(none, "scene.tool.input.body: none such");
    let none = told(hat(), json!({"outline": {"input": "blanc"}}));
    assert_eq!(none, "scene.sheets[1].outline.input: none such");
    let bow = told(hat(), json!({"outline": {"input": "bow"}}));
    assert!(bow.starts_with("scene.sheets[1].outline.input: outline `bow` of step `dxf` bounds no region: outline crosses"), "{bow}");
    assert!(bow.contains("(50, 50) mm"), "{bow}");
    let out = told(hat(), json!({"outline": {"input": "out"}}));
    assert!(
        out.contains("outline `out` of step `dxf`") && out.contains("holes[0]"),
        "{out}"
    );
    let holed = told(
        hat(),
        json!({"outline": {"input": "plain"}, "holes": [{"input": "blank"}]}),
    );
    assert!(
        holed.starts_with(
            "scene.sheets[1].holes[0].input: outline `blank` of step `dxf` has a hole of its own"
        ),
        "{holed}"
    );
}

#[test]
fn holes_of_another_step_need_an_outline_too() {
    let alone = scene(
        json!({"input": {"body": "hat"}}),
        json!({"length": "100 mm", "width": "100 mm", "holes": [{"input": "plain"}]}),
    );
    let text = rules::check(&alone).unwrap_err().to_string();
    assert!(text.contains("`holes` stand without `outline`"), "{text}");
}
