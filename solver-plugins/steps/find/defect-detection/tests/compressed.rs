//! The step on plies whose fibres are compressed by known forces.

use plyflow_defect_detection::{DefectDetection, Harmonic, Ruck};
use plyflow_kernels::built_in::component;
use plyflow_sdk::On;
use plyflow_testing::{
    Components, Machine, MemoryArtifact, MemoryBody, MemoryField, MemoryInput, flat_grid, run_on,
};
use serde_json::{Value, json};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, FRAC_PI_6};

const MACHINE: Machine = Machine {
    threads: 1,
    cancelled: false,
    // SAFETY: Plyflow's own, which are static.
    components: unsafe { Components::new(component) },
};

/// Fibre modulus times thickness (N/m), and the constant bending stiffness (N m).
const STIFFNESS: f64 = 3e9 * 4e-4;
const BENDING: f64 = 2e-3;
const HEIGHT: f64 = 0.02;

fn fabric(bending: &Value) -> Value {
    let mut with = json!({
        "form": "fibre-energy", "fibre_modulus": 3e9, "compression_factor": 1.0,
        "shear": {"coefficients": [0.0, 112.0]}
    });
    if !bending.is_null() {
        with["bending"] = json!({"positive": bending, "negative": bending});
    }
    json!({"plyflow_material": 1, "name": "F", "plugin": "material-fabric", "thickness": "0.0004 m", "areal_mass": "0.44 kg/m2", "with": with})
}

fn scene(plies: usize, bending: &Value) -> Value {
    let ply = |k: usize| json!({"name": format!("ply_{k}"), "kind": "ply", "material": fabric(bending), "length": "0.2 m", "width": "0.2 m"});
    json!({
        "plyflow_scene": 1, "name": "flat",
        "tool": {"flat": {"length": "0.3 m", "width": "0.3 m", "height": "0.02 m", "fillet": "0.005 m", "facet_size": "0.01 m"}},
        "sheets": (1..=plies).map(ply).collect::<Vec<_>>(),
        "friction": {"tool_fabric": 0.2, "fabric_fabric": 0.3},
        "process": {"press": {"stroke": "0.02 m", "forming_time": "0.2 s", "settling_time": "0.01 s",
                              "die": {"opening_radius": "0.027 m", "edge_radius": "0.004 m"}}}
    })
}

fn constant() -> Value {
    json!({"stiffness": BENDING})
}

/// What a ply carries at a place (m): S11, S22, S12 (N/m) in its fibre axes, and the pressure (Pa) under it.
type State<'a> = &'a dyn Fn(f64, f64) -> ([f64; 3], f64);

/// Flat plies of 200 mm in cells of 5 mm on a block, with first fibres at `axes` (rad).
fn formed(plies: &[(f64, State<'_>)]) -> MemoryArtifact {
    let (top, quads) = flat_grid([-0.15, -0.15, 0.15, 0.15], 0.05, HEIGHT);
    let triangles = quads
        .chunks_exact(4)
        .flat_map(|c| [c[0], c[1], c[2], c[0], c[2], c[3]]);
    let mut bodies = vec![MemoryBody {
        name: "tool".into(),
        points: top,
        nodes_per_cell: 3,
        cells: triangles.collect(),
        ..Default::default()
    }];
    let mut sheets = Vec::new();
    for (k, (axis, state)) in plies.iter().enumerate() {
        let offset = 2e-4 + 4e-4 * k as f64;
        let (points, cells) = flat_grid([-0.1, -0.1, 0.1, 0.1], 0.005, 0.1);
        let centre =
            |c: &[u32], d: usize| c.iter().map(|n| points[*n as usize][d]).sum::<f64>() / 4.0;
        let at_cells = |of: &dyn Fn([f64; 3]) -> f64| -> Vec<f64> {
            let forces = cells
                .chunks_exact(4)
                .map(|c| state(centre(c, 0), centre(c, 1)).0);
            forces.map(of).collect()
        };
        let field = |name: &str, on: On, values: Vec<f64>| MemoryField {
            name: name.into(),
            on,
            components: 1,
            values,
        };
        let fields = vec![
            field("shear_angle", On::Cells, at_cells(&|_| 0.0)),
            field("membrane_force_1", On::Cells, at_cells(&|s| s[0])),
            field("membrane_force_2", On::Cells, at_cells(&|s| s[1])),
            field("membrane_force_12", On::Cells, at_cells(&|s| s[2])),
            field(
                "contact_pressure",
                On::Points,
                points.iter().map(|p| state(p[0], p[1]).1).collect(),
            ),
        ];
        let name = format!("ply_{}", k + 1);
        let on_tool = points
            .iter()
            .map(|p| [p[0], p[1], HEIGHT + offset])
            .collect();
        sheets.push(json!({"name": name, "kind": "ply", "thickness": 4e-4, "offset": offset, "fibre_1": axis, "fibre_2": axis + FRAC_PI_2}));
        bodies.push(MemoryBody {
            name,
            nodes_per_cell: 4,
            cells,
            frames: vec![on_tool],
            points,
            fields: vec![fields],
            ..Default::default()
        });
    }
    MemoryArtifact {
        kind: "forming".into(),
        attributes: json!({"scene": "flat", "sheets": sheets}),
        times: vec![1.0],
        bodies,
        ..Default::default()
    }
}

fn judged(formed: &MemoryArtifact, scene: Value) -> Result<MemoryArtifact, String> {
    let with = json!({"scene": scene});
    run_on::<DefectDetection>(&MACHINE, with, &[MemoryInput::new("formed", formed)], &[])
}

/// Share that a uniform state along a line of this length (m) has of what a ruck of 1 mm needs, for plies of the constant law.
fn expected(compression: f64, length: f64, pressure: f64, plies: f64) -> f64 {
    let law = Harmonic::of(|k| k.iter().map(|k| plies * BENDING * k).collect());
    let share = |height: f64| {
        let ruck = Ruck::under(&law, pressure, height);
        (compression - ruck.force) * length / (plies * STIFFNESS) / ruck.excess
    };
    [1e-3, 1.5e-3, 2e-3, 3e-3]
        .into_iter()
        .map(share)
        .fold(0.0, f64::max)
}

/// The middle cell of a ply of 40 x 40 cells.
const MIDDLE: usize = 20 * 40 + 20;

#[test]
fn a_uniform_compression_along_one_family_has_the_share_of_the_closed_form() {
    // Fibres along x: the line through any cell is as long as the ply, 200 mm in places of half a cell.
    let found = judged(
        &formed(&[(0.0, &|_, _| ([-3000.0, 500.0, 0.0], 1e5))]),
        scene(1, &constant()),
    );
    let found = found.unwrap();
    let excess = found.body("ply_1").last("buckling_excess");
    let want = expected(3000.0, 0.2, 1e5, 1.0);
    assert!((0.5..10.0).contains(&want), "{want}");
    for e in [excess[MIDDLE], excess[0], excess[1599]] {
        assert!((e / want - 1.0).abs() < 0.02, "{e}, expected {want}");
    }
    assert!((found.result("buckling_excess") / want - 1.0).abs() < 0.02);
    // All of the ply, or nothing of it.
    let area = found.result("buckling_area");
    assert!(
        (area - if want >= 1.0 { 0.04 } else { 0.0 }).abs() < 1e-9,
        "{area}"
    );
    assert_eq!(found.attributes["thresholds"]["ruck_height"], 1e-3);
    let panel = &found.attributes["maps"][0]["panels"][0];
    assert_eq!(
        [&panel["body"], &panel["field"]],
        ["ply_1", "buckling_excess"]
    );
}

#[test]
fn cells_with_enough_are_flagged_and_no_others() {
    // A band of fibres along y, 30 mm wide, in a ply whose first fibres lie at 30 degrees less than that.
    let axis = FRAC_PI_2 - FRAC_PI_6;
    let strong = |x: f64| (x - 0.02).abs() < 0.015;
    let along = |x: f64| if strong(x) { -9000.0 } else { 200.0 };
    let (c, s) = (FRAC_PI_6.cos(), FRAC_PI_6.sin());
    let turned =
        move |x: f64, _: f64| ([along(x) * c * c, along(x) * s * s, along(x) * c * s], 1e5);
    // Not along a family: the band is crossed by its fibres in short pieces, which give too little.
    let crossed = judged(&formed(&[(axis, &turned)]), scene(1, &constant())).unwrap();
    // Along the second family.
    let straight = move |x: f64, _: f64| ([0.0, along(x), 0.0], 1e5);
    let found = judged(&formed(&[(0.0, &straight)]), scene(1, &constant())).unwrap();
    let flag = found.body("ply_1").last("flag");
    for (cell, flagged) in flag.iter().enumerate() {
        let x = -0.0975 + 0.005 * (cell % 40) as f64;
        if (x - 0.02).abs() < 0.012 {
            assert_eq!(*flagged, 1.0, "{x}");
        } else if (x - 0.02).abs() > 0.025 {
            assert_eq!(*flagged, 0.0, "{x}");
        }
    }
    assert!(found.result("buckling_area") > 0.005 && found.result("buckling_area") < 0.0101);
    assert_eq!(found.result("flagged_area"), found.result("buckling_area"));
    assert!(crossed.result("buckling_excess") < 0.5 * found.result("buckling_excess"));
}

#[test]
fn a_ply_without_compression_has_no_excess() {
    let states: [State<'_>; 3] = [
        &|_, _| ([0.0; 3], 1e5),
        &|_, _| ([500.0, 20.0, 60.0], 1e5),
        &|_, _| ([500.0, 20.0, -60.0], 0.0),
    ];
    for state in states {
        let found = judged(&formed(&[(-FRAC_PI_4, state)]), scene(1, &constant())).unwrap();
        assert_eq!(found.result("buckling_excess").to_bits(), 0);
        assert_eq!(found.result("buckling_area").to_bits(), 0);
        assert!(found.body("ply_1").last("flag").iter().all(|f| *f == 0.0));
    }
}

#[test]
fn forces_that_alternate_from_cell_to_cell_are_no_compression() {
    // As in a coarse mesh of stiff fibres: +-1000 N/m about a tension of 50 N/m.
    let chequered = |x: f64, y: f64| {
        let odd = ((x + 0.1) / 0.005).floor() as i64 + ((y + 0.1) / 0.005).floor() as i64;
        let s = 50.0 + if odd % 2 == 0 { 1000.0 } else { -1000.0 };
        ([s, 300.0, 0.0], 1e5)
    };
    let found = judged(&formed(&[(0.0, &chequered)]), scene(1, &constant())).unwrap();
    let inner = found.body("ply_1").last("buckling_excess")[MIDDLE];
    assert_eq!(inner, 0.0);
    assert_eq!(found.result("buckling_area"), 0.0);
}

#[test]
fn plies_lift_what_lies_on_them() {
    let pressed: State<'_> = &|_, _| ([-3000.0, 500.0, 0.0], 1e5);
    let tense: State<'_> = &|_, _| ([4000.0, 500.0, 0.0], 1e5);
    let share = |above: State<'_>| {
        let found = judged(
            &formed(&[(0.0, pressed), (0.0, above)]),
            scene(2, &constant()),
        )
        .unwrap();
        ["ply_1", "ply_2"].map(|p| found.body(p).last("buckling_excess")[MIDDLE])
    };
    // Two equal plies share the pressure: the lower one needs less than alone, and the upper one does not know of it.
    let [lower, upper] = share(pressed);
    let [both, alone] = [
        expected(6000.0, 0.2, 1e5, 2.0),
        expected(3000.0, 0.2, 1e5, 1.0),
    ];
    assert!(
        (lower / both - 1.0).abs() < 0.02,
        "{lower}, expected {both}"
    );
    assert!(
        (upper / alone - 1.0).abs() < 0.02,
        "{upper}, expected {alone}"
    );
    assert!(lower > upper);
    // One that pulls harder than the other is pressed holds it down.
    assert_eq!(share(tense), [0.0, 0.0]);
}

#[test]
fn without_a_scene_nothing_of_it_is_judged() {
    let run = formed(&[(0.0, &|_, _| ([-9000.0, 0.0, 0.0], 1e5))]);
    let found = run_on::<DefectDetection>(
        &MACHINE,
        json!({}),
        &[MemoryInput::new("formed", &run)],
        &[],
    );
    let found = found.unwrap();
    assert_eq!(found.result("flagged_area"), 0.0);
    assert!(!found.results.contains_key("buckling_area"));
    assert!(found.attributes["plies"][0]["buckling_area"].is_null());
    assert!(found.attributes["maps"].is_null());
    let fields = found.body("ply_1").fields.last().unwrap();
    assert!(fields.iter().all(|f| f.name != "buckling_excess"));
}

#[test]
fn what_cannot_be_judged_is_refused_with_what_is_missing() {
    let run = || formed(&[(0.0, &|_, _| ([-9000.0, 0.0, 0.0], 1e5) as ([f64; 3], f64))]);
    let refused = |run: &MemoryArtifact, scene: Value, parts: &[&str]| {
        let error = judged(run, scene).unwrap_err();
        for part in parts {
            assert!(error.contains(part), "{part}: {error}");
        }
    };
    let unbent = scene(1, &Value::Null);
    refused(
        &run(),
        unbent,
        &["'F' of ply 'ply_1' has no bending law", "leave out `scene`"],
    );
    let mut other = scene(1, &constant());
    other["sheets"][0]["name"] = json!("lower");
    refused(
        &run(),
        other,
        &[
            "'flat' has no sheet 'ply_1'",
            "the scene that was formed, 'flat'",
        ],
    );
    let mut thick = run();
    thick.attributes["sheets"][0]["thickness"] = json!(5e-4);
    refused(
        &thick,
        scene(1, &constant()),
        &["0.4000 mm thick, and 0.5000 mm"],
    );
    let mut bare = run();
    bare.bodies[1].fields[0].retain(|f| f.name != "contact_pressure");
    refused(
        &bare,
        scene(1, &constant()),
        &[
            "does not tell contact_pressure of ply 'ply_1'",
            "forming-explicit",
        ],
    );
    let mut aimless = run();
    aimless.attributes["sheets"][0]["fibre_1"] = Value::Null;
    refused(
        &aimless,
        scene(1, &constant()),
        &["does not tell fibre directions"],
    );
    aimless.attributes["sheets"][0]["steering"] = json!([[0.0, 0.0, 0.1], [0.1, 0.0, 0.2]]);
    refused(
        &aimless,
        scene(1, &constant()),
        &["the fibres of ply 'ply_1'", "are steered"],
    );
}
