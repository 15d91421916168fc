//! What another run gives in place of the coarse one.

use plyflow_boundary_interpolation::BoundaryInterpolation;
use plyflow_geometry::vec3::Vec3;
use plyflow_testing::{MemoryArtifact, MemoryBody, MemoryInput, run};
use serde_json::{Value, json};

const FRAMES: usize = 41;

/// A ply of 0.2 x 0.2 m in cells of `size` (m) that slides by `moved` (m), evenly in time, without turning.
fn sliding(size: f64, moved: Vec3) -> MemoryArtifact {
    let n = (0.2 / size).round() as usize;
    let node = |i: usize, j: usize| (j * (n + 1) + i) as u32;
    let at = |k: usize| size * k as f64;
    let cells = (0..n * n).flat_map(|c| {
        let (i, j) = (c % n, c / n);
        [
            node(i, j),
            node(i + 1, j),
            node(i + 1, j + 1),
            node(i, j + 1),
        ]
    });
    let points: Vec<Vec3> = (0..=n)
        .flat_map(|j| (0..=n).map(move |i| [at(i), at(j), 0.0]))
        .collect();
    let times: Vec<f64> = (0..FRAMES)
        .map(|f| f as f64 / (FRAMES - 1) as f64)
        .collect();
    let frame = |t: &f64| {
        points
            .iter()
            .map(|p| [0, 1, 2].map(|d| p[d] + t * moved[d]))
            .collect()
    };
    let outline = [[0.0, 0.0], [0.2, 0.0], [0.2, 0.2], [0.0, 0.2]];
    MemoryArtifact {
        kind: "forming".into(),
        attributes: json!({"scene": "s", "sheets": [{"name": "ply_1", "kind": "ply", "thickness": 0.0004, "offset": 0.0002, "outline": outline}]}),
        bodies: vec![MemoryBody {
            name: "ply_1".into(),
            nodes_per_cell: 4,
            cells: cells.collect(),
            frames: times.iter().map(frame).collect(),
            points,
            ..Default::default()
        }],
        times,
        ..Default::default()
    }
}

/// A zone with one cut, at x = 0.1 m: the other sides are the ply's edges.
fn zones() -> MemoryArtifact {
    let zone =
        json!({"name": "A", "box": [0.0, 0.0, 0.1, 0.2], "free_sides": [true, false, true, true]});
    MemoryArtifact {
        kind: "zones".into(),
        attributes: json!({"zones": [zone]}),
        ..Default::default()
    }
}

const OURS: Vec3 = [0.01, 0.0, -0.02];
const THEIRS: Vec3 = [0.013, 0.002, -0.025];

fn with(
    exchanged: &[&str],
    more: &[(&str, f64)],
    other: Option<&MemoryArtifact>,
) -> Result<MemoryArtifact, String> {
    let (formed, zones) = (sliding(0.02, OURS), zones());
    let mut inputs = vec![
        MemoryInput::new("formed", &formed),
        MemoryInput::new("zones", &zones),
    ];
    inputs.extend(other.map(|o| MemoryInput::new("other", o)));
    let mut parameters = json!({"element_size": 0.01, "exchanged": exchanged});
    for (key, value) in more {
        parameters[*key] = Value::from(*value);
    }
    run::<BoundaryInterpolation>(parameters, &inputs, &[0])
}

/// How far the nodes of the cut have moved at each frame that is told.
fn moved(out: &MemoryArtifact) -> Vec<Vec3> {
    let (shape, position) = &out.arrays["ply_1/position"];
    let nodes = &out.arrays["ply_1/driven_nodes"].1;
    let (f, k) = (shape[0], shape[1]);
    assert_eq!(k, 21);
    let at = |f: usize, i: usize| {
        let start = out.body("ply_1").points[nodes[i] as usize];
        [0, 1, 2].map(|d| position[3 * (f * k + i) + d] - start[d])
    };
    for f in 0..f {
        let first = at(f, 0);
        assert!((0..k).all(|i| (0..3).all(|d| (at(f, i)[d] - first[d]).abs() < 1e-12)));
    }
    (0..f).map(|f| at(f, 0)).collect()
}

fn near(a: Vec3, b: Vec3) -> bool {
    (0..3).all(|d| (a[d] - b[d]).abs() < 1e-12)
}

#[test]
fn each_direction_is_taken_by_itself_from_a_run_with_another_mesh() {
    let other = sliding(0.01, THEIRS);
    let last = |exchanged: &[&str]| {
        *moved(&with(exchanged, &[], Some(&other)).unwrap())
            .last()
            .unwrap()
    };
    // The ply stays flat, and its cut lies along y.
    assert!(near(last(&["across"]), [THEIRS[0], OURS[1], OURS[2]]));
    assert!(near(last(&["along"]), [OURS[0], THEIRS[1], OURS[2]]));
    assert!(near(last(&["height"]), [OURS[0], OURS[1], THEIRS[2]]));
    assert!(near(last(&["across", "along", "height"]), THEIRS));
    for nothing_of_the_ply in ["films", "start", "normals", "loads"] {
        assert!(
            near(last(&[nothing_of_the_ply]), OURS),
            "{nothing_of_the_ply}"
        );
    }
}

#[test]
fn a_late_zone_is_led_from_where_it_begins_to_what_drives_it() {
    let other = sliding(0.02, THEIRS);
    let late =
        |exchanged: &[&str]| moved(&with(exchanged, &[("start_time", 0.5)], Some(&other)).unwrap());
    let at = |way: Vec3, f: usize| way.map(|w| w * (20 + f) as f64 / 40.0);
    // It begins with ours and is theirs after 5 % of the frames, two, or the other way round.
    let (to_theirs, to_ours) = (late(&["across", "along", "height"]), late(&["start"]));
    let half = |f| [0, 1, 2].map(|d| 0.5 * (at(OURS, f)[d] + at(THEIRS, f)[d]));
    assert!(near(to_theirs[0], at(OURS, 0)) && near(to_ours[0], at(THEIRS, 0)));
    assert!(near(to_theirs[1], half(1)) && near(to_ours[1], half(1)));
    assert!(near(to_theirs[3], at(THEIRS, 3)) && near(to_ours[3], at(OURS, 3)));
    let whole = late(&["start", "across", "along", "height"]);
    assert!((0..whole.len()).all(|f| near(whole[f], at(THEIRS, f))));
    // All nodes begin where the run that gives the start has them.
    let out = with(&["start"], &[("start_time", 0.5)], Some(&other)).unwrap();
    let (shape, path) = &out.arrays["ply_1/path"];
    let end = &path[path.len() - 3 * shape[1]..];
    let flat = out.body("ply_1").points.as_flattened();
    assert!((0..end.len()).all(|i| (end[i] - flat[i] - at(THEIRS, 0)[i % 3]).abs() < 1e-12));
}

#[test]
fn what_makes_no_experiment_is_refused() {
    let other = sliding(0.02, THEIRS);
    let refused = |r: Result<MemoryArtifact, String>| r.map(|_| ()).unwrap_err();
    let without = refused(with(&["across"], &[], None));
    assert!(without.contains("without a run that gives it"), "{without}");
    let nothing = refused(with(&[], &[], Some(&other)));
    assert!(nothing.contains("`exchanged` is empty"), "{nothing}");
    let placed = refused(with(&["forces"], &[], Some(&other)));
    assert!(placed.contains("Give `cut_stiffness`"), "{placed}");
    let mut later = sliding(0.02, THEIRS);
    later.times[7] += 0.01;
    let times = refused(with(&["across"], &[], Some(&later)));
    assert!(times.contains("up to 1.000e-2 s apart"), "{times}");
    let mut renamed = sliding(0.02, THEIRS);
    renamed.attributes["sheets"][0]["name"] = "ply_9".into();
    let sheet = refused(with(&["across"], &[], Some(&renamed)));
    assert!(sheet.contains("has no sheet 'ply_1'"), "{sheet}");
}
