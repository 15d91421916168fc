//! A tool that is refused as it lies is told the words that put it in its place, and with these it passes.

use plyflow_geometry::vec3::Vec3;
use plyflow_model::scene::Scene;
use plyflow_tooling::given::checked;
use plyflow_tooling::other_way_up;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::Path;

/// A hat of 300 x 120 x 40 mm whose walls lean, in mm: as it stands.
fn hat(closed: bool) -> Vec<[Vec3; 3]> {
    let corner = |k: usize, high: bool| {
        let (x, y) = ([-1.0, 1.0, 1.0, -1.0][k], [-1.0, -1.0, 1.0, 1.0][k]);
        let by = if high { 6.0 } else { 0.0 };
        [
            x * (150.0 - by),
            y * (60.0 - by),
            if high { 40.0 } else { 0.0 },
        ]
    };
    let (low, high) = (
        |k: usize| corner(k % 4, false),
        |k: usize| corner(k % 4, true),
    );
    let mut all = vec![[high(0), high(1), high(2)], [high(0), high(2), high(3)]];
    if closed {
        all.extend([[low(0), low(2), low(1)], [low(0), low(3), low(2)]]);
    }
    for k in 0..4 {
        all.extend([
            [low(k), low(k + 1), high(k + 1)],
            [low(k), high(k + 1), high(k)],
        ]);
    }
    all
}

fn write(path: &Path, facets: &[[Vec3; 3]], put: impl Fn(Vec3) -> Vec3) {
    let mut text = String::from("solid hat\n");
    for facet in facets {
        text += "facet normal 0 0 0\nouter loop\n";
        for p in facet {
            let [x, y, z] = put(*p);
            writeln!(text, "vertex {x} {y} {z}").unwrap();
        }
        text += "endloop\nendfacet\n";
    }
    std::fs::write(path, text + "endsolid hat\n").unwrap();
}

fn scene(tool: Value) -> Scene {
    let material = |thickness: &str| json!({"plyflow_material": 1, "name": "m", "plugin": "none", "thickness": thickness, "areal_mass": "0.4 kg/m2", "with": {}});
    let film =
        |name: &str| json!({"name": name, "kind": "diaphragm", "material": material("80 um")});
    let scene = json!({
        "plyflow_scene": 1, "name": "test", "tool": tool,
        "sheets": [film("lower"), {"name": "ply", "kind": "ply", "material": material("0.3 mm"), "length": "400 mm", "width": "200 mm"},
            film("upper")],
        "friction": {"tool_diaphragm": 0.5, "fabric_diaphragm": 0.4, "fabric_fabric": 0.3, "diaphragm_diaphragm": 0.3},
        "process": {"double_diaphragm": {
            "frame_length": "700 mm", "frame_width": "500 mm", "clearance": "5 mm", "bag_pressure": "1 bar", "forming_pressure": "1 bar",
            "bagging_time": "0.1 s", "lowering_time": "0.1 s", "drawing_time": "0.1 s", "settling_time": "0.1 s", "film_joint_margin": "30 mm",
        }},
    });
    Scene::from_json(scene).unwrap_or_else(|e| panic!("{e}"))
}

const SPACING: f64 = 3e-3;

/// What a refusal says would do, taken from its text and tried as a scene's words.
fn advised(said: &str) -> (String, Scene) {
    let from = said
        .find("This would do: `tool: ")
        .unwrap_or_else(|| panic!("{said}"))
        + 22;
    let words = &said[from..from + said[from..].find('`').unwrap()];
    let tool: Value = serde_saphyr::from_str(words).unwrap_or_else(|e| panic!("{words}: {e}"));
    (words.to_owned(), scene(tool))
}

#[test]
fn a_frame_may_be_smaller_than_the_tool_where_there_is_no_bed_around_it() {
    let tool = json!({"flat": {"length": "300 mm", "width": "120 mm", "height": "20 mm", "fillet": "5 mm", "facet_size": "10 mm"}});
    let with = |bed: bool| {
        let mut scene = serde_json::to_value(scene(tool.clone())).unwrap();
        scene["sheets"].as_array_mut().unwrap().remove(0);
        scene["process"] = json!({"single_diaphragm": {
            "frame_length": "250 mm", "frame_width": "100 mm", "clearance": "5 mm", "forming_pressure": "1 bar", "stretching_time": "0.1 s",
            "lowering_time": "0.1 s", "drawing_time": "0.1 s", "settling_time": "0.1 s", "bed": bed,
        }});
        let scene: Scene = serde_json::from_value(scene).unwrap();
        checked(&scene, SPACING).map(|_| ())
    };
    let said = with(true).unwrap_err();
    assert!(
        said.contains("the frame (process.single_diaphragm)") && said.contains("too small"),
        "{said}"
    );
    assert_eq!(with(false), Ok(()));
}

#[test]
fn a_hat_that_lies_elsewhere_is_refused_with_words_that_put_it_right() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("my hat.stl");
    let far = |p: Vec3| [p[0] + 12_000.0, p[1] - 900.0, p[2] + 3_000.0];
    let over = |p: Vec3| [p[0], -p[1], 40.0 - p[2]];
    let side = |p: Vec3| [p[1], p[2], p[0]];
    let inches = |p: Vec3| p.map(|c| c / 25.4);
    type Put<'a> = &'a dyn Fn(Vec3) -> Vec3;
    let cases: [(bool, Put<'_>, &str, &str); 8] = [
        (
            true,
            &|p| [p[0], p[1], p[2] - 20.0],
            "1 mm",
            "unit: 1 mm, foot: auto",
        ),
        (true, &far, "1 mm", "unit: 1 mm, centre: auto, foot: auto"),
        (false, &over, "1 mm", "unit: 1 mm, up: -z, foot: auto"),
        (
            true,
            &|p| far(side(p)),
            "1 mm",
            "unit: 1 mm, up: +y, centre: auto, foot: auto",
        ),
        (
            false,
            &|p| far(side(p)),
            "1 mm",
            "unit: 1 mm, up: +y, centre: auto, foot: auto",
        ),
        (
            true,
            &|p| inches(far(side(p))),
            "1 in",
            "unit: 1 in, up: +y, centre: auto, foot: auto",
        ),
        (true, &|p| p, "1 m", "unit: 1 mm, foot: auto"),
        (
            true,
            &|p| p.map(|c| 1e-3 * c),
            "1 mm",
            "unit: 1 m, foot: auto",
        ),
    ];
    for (closed, put, unit, expected) in cases {
        write(&file, &hat(closed), put);
        let given = json!({"stl": {"file": file.to_str().unwrap(), "unit": unit}});
        let said = checked(&scene(given), SPACING).map(|_| ()).unwrap_err();
        let (words, better) = advised(&said);
        assert!(
            words.ends_with(&format!(", {expected}}}}}")),
            "{expected}\n{said}"
        );
        let size = "it is 300 mm long, 120 mm wide and 40 mm high then";
        let turned = "it is 120 mm long, 300 mm wide and 40 mm high then";
        assert!(said.contains(size) || said.contains(turned), "{said}");
        let built = checked(&better, SPACING).unwrap_or_else(|e| panic!("{words}: {e}"));
        let [low, high] = built.mesh.bounds();
        assert!(low[2] == 0.0 && (high[2] - 0.04).abs() < 1e-12, "{words}");
        assert!(built.placement.is_some() && other_way_up(&better, &built.mesh).is_none());
    }
}

#[test]
fn a_hat_that_is_too_long_for_its_frame_either_way_gets_no_words_and_one_that_fits_across_is_turned()
 {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("hat.stl");
    let given = json!({"stl": {"file": file.to_str().unwrap(), "unit": "1 mm"}});
    let stretched = |by: f64| move |p: Vec3| [p[1], by * p[0], p[2]];
    // 600 mm long, along y: the frame is 500 mm wide.
    write(&file, &hat(true), |p| {
        let [x, y, z] = stretched(2.0)(p);
        // The mirror image of a quarter turn is no turn.
        [-x, y, z]
    });
    let said = checked(&scene(given.clone()), SPACING)
        .map(|_| ())
        .unwrap_err();
    let (words, better) = advised(&said);
    assert!(
        words.contains("rotate: 90 deg, centre: auto, foot: auto"),
        "{words}"
    );
    let [low, high] = checked(&better, SPACING)
        .unwrap_or_else(|e| panic!("{e}"))
        .mesh
        .bounds();
    assert!((high[0] - low[0] - 0.6).abs() < 1e-9);
    write(&file, &hat(true), |p| [3.0 * p[0], 3.0 * p[1], 3.0 * p[2]]);
    let said = checked(&scene(given), SPACING).map(|_| ()).unwrap_err();
    assert!(
        !said.contains("This would do") && said.contains("the frame is too small"),
        "{said}"
    );
}

#[test]
fn a_closed_hat_on_its_head_passes_the_checks_and_is_told_of() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("hat.stl");
    write(&file, &hat(true), |p| [p[0], -p[1], 40.0 - p[2]]);
    let with = |words: Value| {
        let mut tool = json!({"file": file.to_str().unwrap(), "unit": "1 mm"});
        tool.as_object_mut()
            .unwrap()
            .extend(words.as_object().unwrap().clone());
        let scene = scene(json!({ "stl": tool }));
        let built = checked(&scene, SPACING).unwrap_or_else(|e| panic!("{e}"));
        other_way_up(&scene, &built.mesh)
    };
    let told = with(json!({})).unwrap();
    assert!(told.contains("with `up: -z` it would be 0 %"), "{told}");
    assert_eq!(with(json!({"up": "-z", "foot": "auto"})), None);
    // Told in the axes of the file, however it is turned.
    let told = with(json!({"up": "+z", "rotate": "90 deg"})).unwrap();
    assert!(told.contains("with `up: -z`"), "{told}");
}
