use super::*;
use crate::friction::Coefficient;
use crate::regions::{area, holds};
use crate::rules::faults;
use crate::scene::Scene;
use serde_json::{Value, json};

/// Two plies of 200 x 100 mm in a press, the lower one an L about its centre at (10, 0) mm, with these regions.
fn scene(lower: Value, upper: Value) -> Scene {
    let ply = |name: &str, stitch: bool, regions: Value| {
        let with = if stitch {
            json!({"stitch": {}})
        } else {
            json!({})
        };
        json!({
            "name": name, "kind": "ply", "fibre_1": "0 deg", "fibre_2": "90 deg", "regions": regions,
            "material": {"plyflow_material": 1, "name": "cloth", "plugin": "material-fabric", "thickness": "0.4 mm", "areal_mass": "0.4 kg/m2", "with": with},
        })
    };
    let mut l = ply("lower", true, lower);
    l["centre"] = json!(["10 mm", "0 mm"]);
    let at = |x: i32, y: i32| json!([format!("{x} mm"), format!("{y} mm")]);
    l["outline"] = json!([
        at(-100, -50),
        at(100, -50),
        at(100, 0),
        at(0, 0),
        at(0, 50),
        at(-100, 50)
    ]);
    let mut u = ply("upper", false, upper);
    (u["length"], u["width"]) = (json!("200 mm"), json!("100 mm"));
    serde_json::from_value(json!({
        "plyflow_scene": 1, "name": "s", "sheets": [l, u], "friction": {"tool_fabric": 0.2, "fabric_fabric": 0.3},
        "tool": {"flat": {"length": "200 mm", "width": "100 mm", "height": "20 mm", "fillet": "5 mm", "facet_size": "5 mm"}},
        "process": {"press": {"stroke": "20 mm", "forming_time": "100 ms", "settling_time": "10 ms", "die": {"opening_radius": "50 mm", "edge_radius": "5 mm"}}},
    }))
    .unwrap()
}

fn rectangle(name: &str, centre: [i32; 2], size: [i32; 2], angle: i32, does: Value) -> Value {
    let mm = |v: i32| format!("{v} mm");
    let mut region = json!({"name": name, "rectangle": {
        "centre": centre.map(mm), "length": mm(size[0]), "width": mm(size[1]), "angle": format!("{angle} deg")}});
    region
        .as_object_mut()
        .unwrap()
        .extend(does.as_object().unwrap().clone());
    region
}

fn wrong(lower: Value, upper: Value) -> Vec<String> {
    faults(&Known::from(&scene(lower, upper)))
        .into_iter()
        .map(|f| f.to_string())
        .collect()
}

#[test]
fn a_rectangle_is_turned_about_its_middle_and_placed_with_its_ply() {
    let scene = scene(
        json!([rectangle(
            "a",
            [-50, 0],
            [40, 20],
            90,
            json!({"stitches": "removed"})
        )]),
        json!([]),
    );
    assert_eq!(faults(&Known::from(&scene)), []);
    let corners = scene.sheets[0].regions[0].corners([0.01, 0.0]).unwrap();
    assert!((area(&corners) - 8e-4).abs() < 1e-12);
    for (at, is) in [
        ([-0.04, 0.0199], true),
        ([-0.04, 0.02 + 1e-9], true),
        ([-0.04, 0.0201], false),
        ([-0.0305, 0.0], true),
        ([-0.029, 0.0], false),
    ] {
        assert_eq!(holds(&corners, at), is, "{at:?}");
    }
}

#[test]
fn a_name_counts_before_its_class_and_that_before_all() {
    let friction = json!({"friction": {"all": 0.1, "fabric_fabric": 0.2, "upper": 0.3}});
    let scene = scene(
        json!([rectangle("a", [-50, 0], [40, 20], 0, friction)]),
        json!([]),
    );
    let region = &scene.sheets[0].regions[0];
    let of = |name, class| match region.coefficient(name, class) {
        Some(Coefficient::Constant(c)) => c.0,
        other => panic!("{other:?}"),
    };
    assert_eq!(
        [
            of("upper", CLASSES[0]),
            of("lower", CLASSES[0]),
            of("tool", CLASSES[2])
        ],
        [0.3, 0.2, 0.1]
    );
}

#[test]
fn regions_that_make_no_sense_are_told_with_what_is_expected() {
    let slick = || json!({"friction": {"all": 0.1}});
    let a = |centre, size| rectangle("a", centre, size, 0, slick());
    let polygon = |points: &[[i32; 2]]| {
        let points: Vec<Value> = points
            .iter()
            .map(|p| json!(p.map(|v| format!("{v} mm"))))
            .collect();
        json!({"name": "a", "polygon": points, "stitches": "removed"})
    };
    for (lower, upper, words) in [
        // Off the ply: beside it, over its notch alone, around its inner corner, and around all of it.
        (
            json!([a([-90, 0], [40, 20])]),
            json!([]),
            "reaches beyond the ply at (-100, -10) mm (over the tool)",
        ),
        (
            json!([a([50, 25], [20, 20])]),
            json!([]),
            "reaches beyond the ply",
        ),
        (
            json!([polygon(&[
                [-40, -40],
                [40, -40],
                [40, -1],
                [20, 20],
                [-1, 40],
                [-40, 40]
            ])]),
            json!([]),
            "reaches beyond the ply",
        ),
        (
            json!([a([0, 0], [400, 200])]),
            json!([]),
            "reaches beyond the ply",
        ),
        (
            json!([polygon(&[[-40, -40], [-10, -10], [-10, -40], [-40, -10]])]),
            json!([]),
            "polygon crosses or touches itself",
        ),
        (
            json!([polygon(&[[-40, -40], [-10, -10]])]),
            json!([]),
            "polygon has 2 points",
        ),
        (
            json!([{"name": "a", "stitches": "removed"}]),
            json!([]),
            "expected a `polygon` or a `rectangle`",
        ),
        (
            json!([rectangle("a", [-50, 0], [20, 20], 0, json!({}))]),
            json!([]),
            "does nothing",
        ),
        (
            json!([rectangle(
                "a",
                [-50, 0],
                [20, 20],
                0,
                json!({"friction": {"uper": 0.1}})
            )]),
            json!([]),
            "did you mean 'upper'?",
        ),
        (
            json!([rectangle(
                "a",
                [-50, 0],
                [20, 20],
                0,
                json!({"friction": {"fabric_diaphragm": 0.1}})
            )]),
            json!([]),
            "expected some of: lower, upper, tool, die, all, fabric_fabric, tool_fabric",
        ),
        (
            json!([rectangle(
                "a",
                [-50, 0],
                [20, 20],
                0,
                json!({"friction": {"all": 2.5}})
            )]),
            json!([]),
            "sheets[0].regions[0].friction.all: given 2.5; expected a coefficient from 0 to 2",
        ),
        (
            json!([]),
            json!([rectangle(
                "a",
                [0, 0],
                [20, 20],
                0,
                json!({"stitches": "removed"})
            )]),
            "has no `stitch`",
        ),
        (
            json!([a([-50, 0], [20, 20]), a([-50, 30], [20, 20])]),
            json!([]),
            "name of another region",
        ),
    ] {
        let found = wrong(lower.clone(), upper);
        assert!(
            found.len() == 1 && found[0].contains(words),
            "{lower}: {found:?}"
        );
    }
}

#[test]
fn regions_overlap_where_they_share_a_place_and_a_partner() {
    let of = |name: &str, x: i32, size: i32, angle: i32, does: Value| {
        rectangle(name, [x, 0], [size, size], angle, does)
    };
    let with = |partner: &str| json!({"friction": {partner: 0.1}});
    let pair = |b: Value| wrong(json!([]), json!([of("a", -30, 20, 0, with("all")), b]));
    // Crossed, the same, one within the other, crossed without a corner inside.
    for b in [
        of("b", -20, 20, 0, with("lower")),
        of("b", -30, 20, 0, with("lower")),
        of("b", -30, 4, 0, with("tool_fabric")),
        rectangle("b", [-30, 0], [40, 4], 30, with("all")),
    ] {
        let found = pair(b.clone());
        assert!(
            found.len() == 1 && found[0].contains("overlaps region 'a'"),
            "{b}: {found:?}"
        );
    }
    // Side by side, and without a partner in common.
    for b in [
        of("b", -10, 20, 0, with("all")),
        of(
            "b",
            -30,
            20,
            45,
            json!({"friction": {}, "stitches": "removed"}),
        ),
    ] {
        let found: Vec<String> = pair(b)
            .into_iter()
            .filter(|t| t.contains("overlaps"))
            .collect();
        assert_eq!(found, Vec::<String>::new());
    }
    let apart = wrong(
        json!([]),
        json!([
            of("a", -30, 20, 0, with("lower")),
            of("b", -30, 20, 0, with("tool_fabric"))
        ]),
    );
    assert_eq!(apart, Vec::<String>::new());
}

#[test]
fn regions_beside_a_mirror_plane_need_their_images() {
    let with = |mu: f64| json!({"friction": {"all": mu}});
    let upper = |regions: Value| scene(json!([]), regions).sheets[1].clone();
    let two = |x: i32, mu: f64| {
        json!([
            rectangle("a", [-30, 5], [20, 10], 0, with(0.1)),
            rectangle("b", [x, 5], [20, 10], 0, with(mu))
        ])
    };
    let alone = |regions: Value, axis: usize| {
        let upper = upper(regions);
        asymmetric(&upper, axis).map(|region| region.name.clone())
    };
    assert_eq!(alone(two(30, 0.1), 0), None);
    assert_eq!(alone(two(30, 0.1), 1).as_deref(), Some("a"));
    assert!(alone(two(31, 0.1), 0).is_some() && alone(two(30, 0.2), 0).is_some());
    let turned = json!([rectangle("a", [0, 0], [60, 60], 45, with(0.1))]);
    assert_eq!(alone(turned, 0), None);
}
