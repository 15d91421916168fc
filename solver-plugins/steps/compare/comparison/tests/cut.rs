//! The cut between coarse and fine against closed forms: work through it, and what is wrong beside it.

use plyflow_comparison::Comparison;
use plyflow_geometry::vec3::Vec3;
use plyflow_sdk::On;
use plyflow_surface::traction;
use plyflow_testing::{MemoryArtifact, MemoryBody, MemoryField, MemoryInput, flat_grid, run};
use serde_json::{Value, json};
use std::f64::consts::FRAC_PI_2;

const BLANK: [f64; 4] = [-0.24, -0.16, 0.24, 0.16];
/// Its right side is the blank's edge.
const ZONE: [f64; 4] = [0.08, -0.08, 0.24, 0.08];
const AXIS: f64 = 0.4;
const FRAMES: usize = 21;
/// Green strain along x at the end.
const STRAIN: f64 = 0.05;

/// S11, S22, S12 in axes at `AXIS` of a tensor that has `along_x` in x and nothing else.
fn rotated(along_x: f64) -> [f64; 3] {
    let (s, c) = AXIS.sin_cos();
    [along_x * c * c, along_x * s * s, -along_x * s * c]
}

/// A ply that is pulled along x (`x -> F x`) while it turns about z, with `S_xx = stiffness E_xx`.
fn pulled(b: [f64; 4], size: f64, stiffness: f64) -> MemoryBody {
    let (points, cells) = flat_grid(b, size, 0.0);
    let (mut frames, mut fields) = (Vec::new(), Vec::new());
    for f in 0..FRAMES {
        let share = f as f64 / (FRAMES - 1) as f64;
        let (strain, turn) = (STRAIN * share, 0.3 * share);
        let stretch = (1.0 + 2.0 * strain).sqrt();
        let (sin, cos) = f64::sin_cos(turn);
        let at = |p: &Vec3| {
            let (x, y) = (stretch * p[0], p[1]);
            [cos * x - sin * y, sin * x + cos * y, 0.0]
        };
        frames.push(points.iter().map(at).collect());
        let names = ["membrane_force_1", "membrane_force_2", "membrane_force_12"];
        let mut all: Vec<MemoryField> = (names.iter().zip(rotated(stiffness * strain)))
            .map(|(name, v)| cells_field(name, vec![v; cells.len() / 4]))
            .collect();
        all.push(cells_field("shear_angle", vec![0.0; cells.len() / 4]));
        fields.push(all);
    }
    MemoryBody {
        name: "ply_1".into(),
        nodes_per_cell: 4,
        cells,
        points,
        frames,
        fields,
        ..Default::default()
    }
}

fn cells_field(name: &str, values: Vec<f64>) -> MemoryField {
    MemoryField {
        name: name.into(),
        on: On::Cells,
        components: 1,
        values,
    }
}

fn formed(ply: MemoryBody, size: f64, zone: Value) -> MemoryArtifact {
    let tool = MemoryBody {
        name: "tool".into(),
        points: vec![[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0]],
        nodes_per_cell: 3,
        cells: vec![0, 1, 2],
        ..Default::default()
    };
    let times = (0..ply.frames.len()).map(|f| f as f64).collect();
    MemoryArtifact {
        kind: "forming".into(),
        attributes: json!({
            "sheets": [{"name": "ply_1", "kind": "ply", "thickness": 0.0004, "offset": 0.0, "fibre_1": AXIS, "fibre_2": AXIS + FRAC_PI_2}],
            "element_size": size, "zone": zone,
        }),
        times,
        bodies: vec![tool, ply],
        ..Default::default()
    }
}

fn zone() -> Value {
    json!({"name": "A", "box": ZONE, "free_sides": [false, true, false, false], "plies": ["ply_1"]})
}

fn compare(
    global: &MemoryArtifact,
    local: &MemoryArtifact,
    reference: Option<&MemoryArtifact>,
) -> MemoryArtifact {
    let zones = MemoryArtifact {
        kind: "zones".into(),
        attributes: json!({"zones": [zone()]}),
        ..Default::default()
    };
    let mut inputs = vec![
        MemoryInput::new("global", global),
        MemoryInput::new("zones", &zones),
        MemoryInput::new("local", local),
    ];
    inputs.extend(reference.map(|r| MemoryInput::new("reference", r)));
    run::<Comparison>(json!({}), &inputs, &[]).unwrap()
}

#[test]
fn work_through_the_cut_is_the_closed_forms() {
    // S_xx alone: top and bottom carry nothing, the right side is the blank's edge, all passes through the left.
    let stiffness = 2e4;
    let out = compare(
        &formed(pulled(BLANK, 0.02, stiffness), 0.02, Value::Null),
        &formed(pulled(ZONE, 0.005, 2.0 * stiffness), 0.005, zone()),
        None,
    );
    // The force there is width F S, its way x0 dF, and F dF = dE; the turn about the origin does no work on a side whose middle
    // lies at y = 0. So W = -width x0 stiffness E^2 / 2.
    let exact = -0.16 * 0.08 * stiffness * STRAIN * STRAIN / 2.0;
    let got = out.result("cut_work.A.global");
    assert!((got / exact - 1.0).abs() < 0.01, "{got} J, exact {exact} J");
    let got = out.result("cut_work.A");
    assert!((got / (2.0 * exact) - 1.0).abs() < 0.01, "{got} J");
    // What passes either way is at least what is left over; the runs differ by as much as the global one has.
    let error = out.result("cut_work_error.A");
    let part = &out.attributes["cut"]["work"][0]["global"];
    let (net, gross) = (
        part["net"].as_f64().unwrap(),
        part["gross"].as_f64().unwrap(),
    );
    assert!(gross >= net.abs() && (error - net.abs() / gross).abs() < 0.02);
}

/// The same ply, but it ends inside of the zone, at x = 0.2 m, where another one goes on: that is no cut of it.
#[test]
fn nothing_passes_through_the_own_edge_of_a_ply_that_ends_inside_of_its_zone() {
    let stiffness = 2e4;
    let ends = |b: [f64; 4]| [b[0], b[1], 0.2, b[3]];
    let mut open = zone();
    open["free_sides"] = json!(vec![false; 4]);
    let zones = MemoryArtifact {
        kind: "zones".into(),
        attributes: json!({"zones": [open]}),
        ..Default::default()
    };
    let global = formed(pulled(ends(BLANK), 0.02, stiffness), 0.02, Value::Null);
    let local = formed(pulled(ends(ZONE), 0.005, stiffness), 0.005, open.clone());
    let reference = formed(pulled(ends(BLANK), 0.005, stiffness), 0.005, Value::Null);
    let inputs = [
        MemoryInput::new("global", &global),
        MemoryInput::new("zones", &zones),
        MemoryInput::new("local", &local),
        MemoryInput::new("reference", &reference),
    ];
    let out = run::<Comparison>(json!({}), &inputs, &[]).unwrap();
    // As above: all passes through the left.
    let exact = -0.16 * 0.08 * stiffness * STRAIN * STRAIN / 2.0;
    for name in ["cut_work.A.global", "cut_work.A"] {
        let got = out.result(name);
        assert!(
            (got / exact - 1.0).abs() < 0.01,
            "{name}: {got} J, exact {exact} J"
        );
    }
    // Nor is there a strip along it: the deepest nodes lie in the middle between top and bottom, and at the edge.
    let strips = out.attributes["cut"]["layers"][0]["strips"]
        .as_array()
        .unwrap();
    let nodes: Vec<u64> = strips.iter().filter_map(|s| s["nodes"].as_u64()).collect();
    assert_eq!(
        nodes,
        [
            25 * 33 - 21 * 25,
            21 * 25 - 17 * 17,
            17 * 17 - 13 * 9,
            13 * 9 - 9,
            9
        ]
    );
}

#[test]
fn a_zone_that_is_nowhere_deeper_than_the_strip_at_its_cut_has_no_inner_error() {
    let local = formed(pulled(ZONE, 0.005, 1.0), 0.005, zone());
    let reference = formed(pulled(BLANK, 0.005, 1.0), 0.005, Value::Null);
    let errors = |size: f64| {
        let global = formed(pulled(BLANK, size, 1.0), size, Value::Null);
        let out = compare(&global, &local, Some(&reference));
        ["cut_error.A", "inner_error.A"].map(|name| out.results.contains_key(name))
    };
    // 80 mm deep.
    assert_eq!(errors(0.02), [true, true]);
    assert_eq!(errors(0.16), [true, false]);
}

#[test]
fn traction_is_that_of_the_deformed_cell_and_turns_with_it() {
    let then = [
        [0.0, 0.0, 0.0],
        [0.01, 0.0, 0.0],
        [0.01, 0.01, 0.0],
        [0.0, 0.01, 0.0],
    ];
    // 10 % longer along x and stood up: x becomes z.
    let now = then.map(|p| [0.0, p[1], 1.1 * p[0]]);
    let t = traction(then, now, rotated(1000.0), AXIS, [1.0, 0.0]);
    let expected = [0.0, 0.0, 1100.0];
    assert!((0..3).all(|k| (t[k] - expected[k]).abs() < 1e-9), "{t:?}");
    let t = traction(then, now, rotated(1000.0), AXIS, [0.0, 1.0]);
    assert!(t.iter().all(|v| v.abs() < 1e-9), "{t:?}");
}

#[test]
fn runs_without_membrane_forces_have_no_account_of_the_work() {
    let mut local = formed(pulled(ZONE, 0.005, 1.0), 0.005, zone());
    for frame in &mut local.bodies[1].fields {
        frame.retain(|f| f.name == "shear_angle");
    }
    let global = formed(pulled(BLANK, 0.02, 1.0), 0.02, Value::Null);
    let out = compare(&global, &local, None);
    assert!(!out.results.contains_key("cut_work.A"));
}

#[test]
fn what_is_wrong_at_the_cut_is_told_from_what_is_wrong_inside() {
    let last = |b: &mut MemoryBody, f: &dyn Fn(Vec3) -> f64| {
        let at: Vec<f64> = b.points.iter().map(|p| f(*p)).collect();
        for (p, up) in b.frames[FRAMES - 1].iter_mut().zip(at) {
            p[2] += up;
        }
    };
    let mut local = formed(pulled(ZONE, 0.005, 1.0), 0.005, zone());
    // 1 mm off within 19 mm of the left side, 0.1 mm elsewhere; the right side is free and does not count as a cut.
    last(&mut local.bodies[1], &|p| {
        let deep = (p[0] - 0.08).min(p[1] + 0.08).min(0.08 - p[1]);
        if deep < 0.0199 { 0.001 } else { 0.0001 }
    });
    let global = formed(pulled(BLANK, 0.02, 1.0), 0.02, Value::Null);
    let reference = formed(pulled(BLANK, 0.005, 1.0), 0.005, Value::Null);
    let out = compare(&global, &local, Some(&reference));
    let (at, inside) = (out.result("cut_error.A"), out.result("inner_error.A"));
    assert!((at - 0.001).abs() < 1e-9, "{at}");
    assert!((inside - 0.0001).abs() < 1e-9, "{inside}");
    let strips = out.attributes["cut"]["layers"][0]["strips"]
        .as_array()
        .unwrap()
        .len();
    assert_eq!(
        strips, 5,
        "80 mm deep in strips of 20 mm, and the line in the middle"
    );
}
