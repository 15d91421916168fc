//! The step on fine motions that are known.

use plyflow_geometry::vec3::{Vec3, distance};
use plyflow_testing::{MemoryArtifact, MemoryBody, MemoryInput, flat_grid, run};
use plyflow_zone_feedback::ZoneFeedback;
use serde_json::{Value, json};

const BLANK: [f64; 4] = [-0.20, -0.10, 0.20, 0.10];
/// Reaches the blank's right edge.
const ZONE: [f64; 4] = [0.06, -0.06, 0.20, 0.06];
const COARSE: f64 = 0.01;

/// Bilinear in space, cubic in time and at rest in the beginning.
fn motion(p: Vec3, t: f64, draw_in: f64) -> Vec3 {
    let s = t * t * (3.0 - 2.0 * t);
    [
        p[0] - draw_in * s,
        p[1] + 0.1 * s * p[0],
        p[2] - s * (0.05 + 2.0 * p[0] * p[1]),
    ]
}

fn formed(b: [f64; 4], size: f64, times: &[f64], draw_in: f64, zone: Value) -> MemoryArtifact {
    let (points, cells) = flat_grid(b, size, 0.1);
    let at = |t: &f64| points.iter().map(|p| motion(*p, *t, draw_in)).collect();
    MemoryArtifact {
        kind: "forming".into(),
        attributes: json!({
            "scene": "s", "element_size": size, "zone": zone, "symmetry": [],
            "sheets": [{"name": "film", "kind": "diaphragm", "thickness": 4e-5, "offset": 2e-5}, {"name": "ply_1", "kind": "ply", "thickness": 4e-4, "offset": 2e-4}],
        }),
        times: times.to_vec(),
        bodies: vec![MemoryBody {
            name: "ply_1".into(),
            nodes_per_cell: 4,
            cells,
            frames: times.iter().map(at).collect(),
            points,
            ..Default::default()
        }],
        ..Default::default()
    }
}

const COARSE_TIMES: [f64; 5] = [0.0, 0.26, 0.5, 0.74, 1.0];

fn coarse() -> MemoryArtifact {
    formed(BLANK, COARSE, &COARSE_TIMES, 0.0, Value::Null)
}

/// Coarse nodes lie on nodes of its mesh.
fn fine(draw_in: f64) -> MemoryArtifact {
    fine_at(draw_in, &[0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
}

fn fine_at(draw_in: f64, times: &[f64]) -> MemoryArtifact {
    let zone = json!({"name": "A", "box": ZONE, "free_sides": [false, true, false, false]});
    formed(ZONE, 0.005, times, draw_in, zone)
}

fn feed_back(
    parameters: Value,
    coarse: &MemoryArtifact,
    fine: &[&MemoryArtifact],
) -> Result<MemoryArtifact, String> {
    let mut inputs = vec![MemoryInput::new("formed", coarse)];
    inputs.extend(fine.iter().map(|f| MemoryInput::new("local", f)));
    run::<ZoneFeedback>(parameters, &inputs, &[])
}

#[test]
fn coarse_nodes_deep_in_a_zone_follow_the_fine_run_at_the_coarse_frames() {
    let (coarse, fine) = (coarse(), fine(0.003));
    let out = feed_back(json!({}), &coarse, &[&fine]).unwrap();
    let (shape, nodes) = &out.arrays["ply_1/driven_nodes"];
    // Two elements from the cuts at x = 60 mm and y = +-60 mm, up to the free edge: 80 to 200 and -40 to 40 mm.
    let k = shape[0];
    assert_eq!(k, 13 * 9);
    let (_, position) = &out.arrays["ply_1/position"];
    let (_, velocity) = &out.arrays["ply_1/velocity"];
    for (f, &t) in COARSE_TIMES.iter().enumerate() {
        for (i, &node) in nodes.iter().enumerate() {
            let start = coarse.bodies[0].points[node as usize];
            assert!(start[0] > 0.079 && start[1].abs() < 0.041);
            let (a, b) = (
                motion(start, t - 1e-6, 0.003),
                motion(start, t + 1e-6, 0.003),
            );
            for (d, expected) in motion(start, t, 0.003).into_iter().enumerate() {
                let at = (f * k + i) * 3 + d;
                assert!((position[at] - expected).abs() < 1e-12);
                assert!((velocity[at] - (b[d] - a[d]) / 2e-6).abs() < 1e-7);
            }
        }
    }
    // The fine run has drawn in 3 mm more.
    assert!((out.result("feedback_change") - 0.003).abs() < 1e-12);
    assert!((out.result("feedback_change_max") - 0.003).abs() < 1e-12);
    assert_eq!(out.attributes["fed_back"], json!(["A"]));
    let wider = feed_back(json!({"overlap": 0.05}), &coarse, &[&fine]).unwrap();
    assert_eq!(wider.result("driven_nodes"), (10 * 3) as f64);
}

#[test]
fn nodes_go_as_in_the_coarse_run_until_a_zone_begins_and_then_over_to_its_motion() {
    // Led over in 5 % of the time, 0.475 to 0.525 s: the coarse frame at 0.5 s lies half way.
    let late_times: Vec<f64> = (0..=42).map(|k| 0.475 + 0.0125 * f64::from(k)).collect();
    let (coarse, late) = (coarse(), fine_at(0.003, &late_times));
    let out = feed_back(json!({}), &coarse, &[&late]).unwrap();
    let (shape, nodes) = &out.arrays["ply_1/driven_nodes"];
    let (_, position) = &out.arrays["ply_1/position"];
    for (f, &t) in COARSE_TIMES.iter().enumerate() {
        let draw_in = match t {
            0.5 => 0.0015,
            t if t < 0.475 => 0.0,
            _ => 0.003,
        };
        for (i, &node) in nodes.iter().enumerate() {
            let expected = motion(coarse.bodies[0].points[node as usize], t, draw_in);
            for (d, expected) in expected.into_iter().enumerate() {
                let found = position[(f * shape[0] + i) * 3 + d];
                // The late run's spline does not know what was before, and is off by less than 1 um.
                assert!((found - expected).abs() < 1e-6, "{t} s: {found} {expected}");
            }
        }
    }
}

/// On a cylinder about y of `RADIUS`, elements as long as the material: nodes stand off by size^2 / (24 radius).
fn bent(mut run: MemoryArtifact, size: f64) -> MemoryArtifact {
    let body = &mut run.bodies[0];
    let r = RADIUS + size * size / (24.0 * RADIUS);
    let place = |p: &Vec3| {
        let (s, c) = (p[0] / RADIUS).sin_cos();
        [r * s, p[1], r * c]
    };
    let last = body.frames.len() - 1;
    body.frames[last] = body.points.iter().map(place).collect();
    run
}

const RADIUS: f64 = 0.03;

#[test]
fn coarse_nodes_stand_off_the_fine_surface_so_that_their_elements_are_as_long() {
    let (coarse, fine) = (bent(coarse(), COARSE), bent(fine(0.0), 0.005));
    let out = feed_back(json!({}), &coarse, &[&fine]).unwrap();
    // 139 um between the coarse nodes and the material, 35 um between the fine ones and it; at the edge, where nodes lie on one side only, the
    // way is found less well than elsewhere.
    assert!(
        out.result("feedback_change_max") < 8e-6,
        "{}",
        out.result("feedback_change_max")
    );
    let (shape, nodes) = &out.arrays["ply_1/driven_nodes"];
    let (_, position) = &out.arrays["ply_1/position"];
    let (k, last) = (shape[0], COARSE_TIMES.len() - 1);
    let place = |i: usize| -> Vec3 { [0, 1, 2].map(|d| position[(last * k + i) * 3 + d]) };
    let flat = |i: usize| coarse.bodies[0].points[nodes[i] as usize];
    let mut sides = 0;
    for i in 0..k {
        for j in 0..k {
            let way = [0, 1].map(|d| flat(j)[d] - flat(i)[d]);
            if (way[0] - COARSE).abs() < 1e-9 && way[1].abs() < 1e-9 {
                let length = distance(place(i), place(j));
                // On the fine surface they would be 3.5e-3 too short; at the edge 2.2e-4 are left.
                assert!((length / COARSE - 1.0).abs() < 3e-4, "{length}");
                sides += 1;
            }
        }
    }
    assert_eq!(sides, 12 * 9);
}

#[test]
fn zones_that_share_nodes_drive_each_once() {
    let (coarse, one, mut two) = (coarse(), fine(0.003), fine(0.001));
    two.attributes["zone"]["name"] = json!("B");
    let out = feed_back(json!({}), &coarse, &[&one, &two]).unwrap();
    assert_eq!(out.result("driven_nodes"), (13 * 9) as f64);
    assert!(
        (out.result("feedback_change") - 0.003).abs() < 1e-12,
        "the first has them"
    );
}

#[test]
fn of_zones_that_were_drawn_again_the_runs_that_count_are_fed_back() {
    let coarse = coarse();
    let zone = |name: &str, x0: f64, replaces: &[&str], draw_in: f64| {
        let zone = json!({"name": name, "box": [x0, -0.06, 0.20, 0.06],
            "free_sides": [false, true, false, false], "replaces": replaces});
        formed(
            [x0, -0.06, 0.20, 0.06],
            0.005,
            &[0.0, 0.5, 1.0],
            draw_in,
            zone,
        )
    };
    let fed = |fine: &[&MemoryArtifact]| {
        let out = feed_back(json!({}), &coarse, fine).unwrap();
        let names = out.attributes["fed_back"].clone();
        (names, out.result("feedback_change"), out)
    };
    // Drawn larger, wherever it stands in the list; of the same box the last.
    let (small, large) = (zone("A", 0.06, &[], 0.001), zone("A", 0.04, &[], 0.003));
    for list in [[&small, &large], [&large, &small]] {
        let (names, change, out) = fed(&list);
        assert_eq!(names, json!(["A"]));
        assert!((change - 0.003).abs() < 1e-12, "{change}");
        assert!(
            out.log.iter().any(|l| l.contains("(zone A)")),
            "{:?}",
            out.log
        );
    }
    let again = zone("A", 0.06, &[], 0.002);
    assert!((fed(&[&small, &again]).1 - 0.002).abs() < 1e-12);
    // One in the place of another.
    let both = zone("B", 0.05, &["A"], 0.004);
    let (names, change, _) = fed(&[&small, &both]);
    assert_eq!(names, json!(["B"]));
    assert!((change - 0.004).abs() < 1e-12, "{change}");
}

#[test]
fn passes_end_when_what_they_change_is_within_the_tolerance() {
    let (coarse, fine) = (coarse(), fine(0.003));
    let again = |parameters: Value, fine: &[&MemoryArtifact]| {
        let out = feed_back(parameters, &coarse, fine).unwrap();
        (
            out.collection.clone(),
            out.results.get("converged").map(|r| r.0),
        )
    };
    let one = || Some(vec!["again".to_owned()]);
    assert_eq!(
        again(json!({"tolerance": 0.0029}), &[&fine]),
        (one(), Some(0.0))
    );
    assert_eq!(
        again(json!({"tolerance": 0.0031}), &[&fine]),
        (Some(vec![]), Some(1.0))
    );
    // Without one it goes on as long as there is something to feed back.
    assert_eq!(again(json!({}), &[&fine]), (one(), None));
    assert_eq!(again(json!({}), &[]), (Some(vec![]), None));
    // Without zones there is nothing to feed back; zones that are smaller than the overlap have not come to rest.
    let none = json!({"tolerance": 0.001});
    assert_eq!(again(none, &[]), (Some(vec![]), Some(1.0)));
    let deep = json!({"tolerance": 0.001, "overlap": 0.2});
    assert_eq!(again(deep, &[&fine]), (Some(vec![]), None));
}

#[test]
fn what_cannot_be_fed_back_is_named() {
    let (coarse, fine) = (coarse(), fine(0.0));
    let out = feed_back(json!({}), &coarse, &[]).unwrap();
    assert_eq!(out.result("driven_nodes"), 0.0);
    assert!(
        out.log
            .iter()
            .any(|text| text.contains("nothing is fed back"))
    );
    let text = feed_back(json!({}), &fine, &[]).unwrap_err();
    assert!(text.contains("run of a zone"), "{text}");
    let text = feed_back(json!({}), &coarse, &[&coarse]).unwrap_err();
    assert!(text.contains("no run of a zone"), "{text}");
    let mut half = coarse.clone();
    half.attributes["symmetry"] = json!(["x"]);
    let text = feed_back(json!({}), &half, &[]).unwrap_err();
    assert!(text.contains("symmetry"), "{text}");
    let mut still = coarse.clone();
    still.times.truncate(1);
    let text = feed_back(json!({}), &still, &[]).unwrap_err();
    assert!(text.contains("1 frames"), "{text}");
}
