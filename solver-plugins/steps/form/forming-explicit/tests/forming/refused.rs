//! Scenes that would be computed as something else than they say, or not at all: refused before the first step, with what to do.

use crate::common::scenes::{bag, press};
use crate::common::{BuiltIn, woven};
use plyflow_forming_explicit::{Parameters, RigidName, build_global};
use serde_json::{Value, json};
use std::fmt::Write;

/// Of the non-crimp fabric of the tests (m).
const PLY_THICKNESS: f64 = 4e-4;

fn refused(p: &Parameters) -> String {
    build_global(p, &BuiltIn)
        .err()
        .expect("refused")
        .to_string()
}

fn assert_told(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "'{part}' in: {text}");
    }
}

#[test]
fn families_that_do_not_cross_at_a_right_angle_are_not_taken_for_such() {
    let with = |second: &str| bag(2, |p| p["scene"]["sheets"][1]["fibre_2"] = json!(second));
    assert_told(
        &refused(&with("30 deg")),
        &["ply 'ply_1'", "-45 and 30", "right angle"],
    );
    assert_told(&refused(&with("-45 deg")), &["0 deg apart"]);
    // Either way round, and with the rounding of a number in radians.
    for right in ["45 deg", "-135 deg", "0.785398163 rad"] {
        build_global(&with(right), &BuiltIn).map(|_| ()).unwrap();
    }
}

#[test]
fn a_shell_of_a_fabric_that_does_not_bend_is_not_taken_for_a_membrane() {
    let gap = json!({"gap": "0.003 m"});
    let shell = |material: Option<Value>| {
        press(1, &gap, |p| {
            p["element"]["plugin"] = json!("rf4");
            if let Some(material) = material {
                p["scene"]["sheets"][0]["material"] = material;
            }
        })
    };
    assert_told(
        &refused(&shell(None)),
        &[
            "element: given 'rf4'",
            "ply 'ply_1'",
            "'NCF' has no bending",
            "m4",
        ],
    );
    build_global(&shell(Some(woven())), &BuiltIn)
        .map(|_| ())
        .unwrap();
}

#[test]
fn more_pressure_than_the_bag_has_is_not_cut_off_without_a_word() {
    let p = bag(1, |p| {
        p["scene"]["process"]["double_diaphragm"]["forming_pressure"] = json!("7 bar")
    });
    assert_told(
        &refused(&p),
        &["forming_pressure: given 7 bar", "`bag_pressure` (1 bar)"],
    );
}

#[test]
fn a_frame_that_is_too_small_says_for_what() {
    let p = bag(1, |p| p["element_size"] = json!(0.7));
    assert_told(
        &refused(&p),
        &[
            "the frame (0.4 x 0.34 m) is too small",
            "element_size",
            "film_joint_margin",
            "2100 mm",
        ],
    );
}

#[test]
fn names_of_rigid_parts_are_taken() {
    let p = press(1, &json!({"gap": "0.003 m"}), |p| {
        p["scene"]["sheets"][0]["name"] = json!("die")
    });
    assert_told(&refused(&p), &["`die` is taken", "a name of its own"]);
}

/// An ASCII file of a block of this size and lowest corner (in its units).
fn block(size: [f64; 3], low: [f64; 3]) -> String {
    let corner = |k: usize| [0, 1, 2].map(|d| low[d] + if k >> d & 1 == 1 { size[d] } else { 0.0 });
    // Counter-clockwise from outside.
    let sides = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let mut text = "solid block\n".to_owned();
    for [a, b, c, d] in sides {
        for facet in [[a, b, c], [a, c, d]] {
            text += "facet normal 0 0 0\nouter loop\n";
            for [x, y, z] in facet.map(corner) {
                writeln!(text, "vertex {x} {y} {z}").unwrap();
            }
            text += "endloop\nendfacet\n";
        }
    }
    text + "endsolid block\n"
}

#[test]
fn a_tool_that_does_not_stand_on_the_bed_or_is_of_another_unit_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("block.stl");
    let with = |low: f64, unit: &str, translate: &str| {
        std::fs::write(&file, block([100.0, 60.0, 20.0], [-50.0, -30.0, low])).unwrap();
        bag(1, |p| {
            p["scene"]["tool"] = json!({"stl": {
                "file": file.to_str().unwrap(), "unit": unit, "translate": ["0 mm", "0 mm", translate]}});
        })
    };
    build_global(&with(0.0, "1 mm", "0 mm"), &BuiltIn)
        .map(|_| ())
        .unwrap();
    let told = refused(&with(-20.0, "1 mm", "0 mm"));
    assert_told(
        &told,
        &["lies at z = -20.000 mm", "translate: [0 mm, 0 mm, 20 mm]"],
    );
    assert_told(
        &refused(&with(40.0, "1 mm", "1 mm")),
        &["z = 41.000 mm", "-40 mm]"],
    );
    build_global(&with(40.0, "1 mm", "-40 mm"), &BuiltIn)
        .map(|_| ())
        .unwrap();
    let metres = refused(&with(0.0, "1 m", "0 mm"));
    assert_told(
        &metres,
        &[
            "from (-50000.0, -30000.0) to (50000.0, 30000.0) mm",
            "the frame is too small",
            "is `unit` (1 m) the length",
        ],
    );
}

/// An STL block of this size (mm) as a tool.
fn of_block(size: [f64; 3], grid: f64, unit: &str) -> (tempfile::TempDir, Parameters) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("block.stl");
    let low = [-0.5 * size[0], -0.3 * size[1], 0.0];
    std::fs::write(&file, block(size, low)).unwrap();
    let p = bag(1, |p| {
        p["tool_grid"] = json!(grid);
        p["scene"]["tool"] = json!({"stl": {"file": file.to_str().unwrap(), "unit": unit}});
    });
    (folder, p)
}

#[test]
fn a_wall_thinner_than_a_ply_says_so_and_thicker_ones_are_in_the_field() {
    for thickness in [0.02, 0.2] {
        let (_folder, p) = of_block([100.0, thickness, 30.0], 0.003, "1 mm");
        let told = refused(&p);
        let wall = format!("has a wall {thickness} mm thin at (");
        assert_told(&told, &[&wall, "thinnest ply", "leave it out"]);
    }
    let (_folder, p) = of_block([100.0, 2.0, 30.0], 0.003, "1 mm");
    let built = build_global(&p, &BuiltIn)
        .map_err(|e| e.to_string())
        .unwrap();
    assert!(
        built.field_error(&RigidName::Tool) <= 0.1 * PLY_THICKNESS,
        "{}",
        built.field_error(&RigidName::Tool)
    );
    let (_folder, p) = of_block([100.0, 2.0, 30.0], 0.003, "1 um");
    assert_told(&refused(&p), &["0.100 x 0.002 x 0.030 mm", "is `unit`"]);
}

/// A field that shows nothing of the tool: no defects, and exit 0.
#[test]
fn a_spacing_that_shows_nothing_of_the_tool_is_refused_with_one_that_does() {
    let (_folder, p) = of_block([100.0, 60.0, 20.0], 1.0, "1 mm");
    let told = refused(&p);
    assert_told(
        &told,
        &[
            "`tool_grid`, 1000 mm",
            "where a sheet can touch it",
            "would do, in ",
        ],
    );
    let from = told.find("`tool_grid: ").expect("a spacing that does") + 12;
    let spacing = told[from..]
        .split(' ')
        .next()
        .unwrap()
        .parse::<f64>()
        .unwrap();
    let (_folder, p) = of_block([100.0, 60.0, 20.0], 1e-3 * spacing, "1 mm");
    let built = build_global(&p, &BuiltIn)
        .map_err(|e| e.to_string())
        .unwrap();
    assert!(built.field_error(&RigidName::Tool) <= 0.1 * PLY_THICKNESS);
    // Of the tools that Plyflow draws itself as well.
    let p = bag(1, |p| p["tool_grid"] = json!(1.0));
    assert_told(&refused(&p), &["`tool_grid`, 1000 mm", "would do"]);
}

#[test]
fn a_body_that_floats_is_named() {
    let (folder, p) = of_block([100.0, 60.0, 20.0], 0.003, "1 mm");
    let file = folder.path().join("block.stl");
    let with = |low: f64| {
        let both = block([100.0, 60.0, 20.0], [-50.0, -30.0, 0.0])
            + &block([20.0, 20.0, 10.0], [-10.0, -10.0, low]);
        std::fs::write(&file, both).unwrap();
    };
    with(25.0);
    assert_told(
        &refused(&p),
        &["one of its 2 bodies floats", "(-10.0, -10.0, 25.0) mm"],
    );
    for on_or_in in [20.0, 15.0] {
        with(on_or_in);
        plyflow_tooling::given::checked(&p.scene, p.tool_grid).unwrap();
    }
}

#[test]
fn what_contacts_see_of_every_rigid_part_is_held_against_what_is_drawn_of_it() {
    let p = press(1, &json!({"gap": "0.003 m"}), |_| {});
    let built = build_global(&p, &BuiltIn).unwrap_or_else(|e| panic!("{e}"));
    for part in [RigidName::Tool, RigidName::Die, RigidName::Holder] {
        let error = built.field_error(&part);
        assert!(error > 0.0 && error < 2e-5, "{part:?}: {error}");
    }
    assert_eq!(built.field_error(&RigidName::Bed), 0.0);
}

#[test]
fn a_tool_that_leaves_the_frame_says_so() {
    let p = bag(1, |p| {
        p["scene"]["sheets"][1]["width"] = json!("0.04 m");
        p["scene"]["process"]["double_diaphragm"]["frame_width"] = json!("0.05 m")
    });
    assert_told(&refused(&p), &["scene.tool", "the frame is too small"]);
}

#[test]
fn fibres_named_clockwise_are_refused_where_the_material_tells_its_families_apart() {
    let gap = json!({"gap": "0.003 m"});
    let with = |fibres: [&str; 2], families: &str| {
        press(1, &gap, |p| {
            let mut material = woven();
            let law = |stiffness: f64| json!({"positive": {"linear": stiffness}});
            material["with"]["bending"] = match families {
                "apart" => {
                    json!({"family_1": law(0.02), "family_2": law(0.0002), "families": "same"})
                }
                _ => law(0.02),
            };
            let ply = &mut p["scene"]["sheets"][0];
            ply["material"] = material;
            [ply["fibre_1"], ply["fibre_2"]] = fibres.map(|f| json!(f));
        })
    };
    let told = refused(&with(["90 deg", "0 deg"], "apart"));
    assert_told(
        &told,
        &["fibre_2 (0.0 deg) lies clockwise", "fibre_2: 180.0 deg"],
    );
    for (fibres, families) in [
        (["90 deg", "180 deg"], "apart"),
        (["0 deg", "90 deg"], "apart"),
        (["90 deg", "0 deg"], "alike"),
    ] {
        build_global(&with(fibres, families), &BuiltIn)
            .map(|_| ())
            .unwrap();
    }
}
