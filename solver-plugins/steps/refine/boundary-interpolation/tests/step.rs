//! The step on a coarse motion that is known.

mod common;

use common::{TIMES, coarse, interpolate, motion, of_pass, zones};
use plyflow_boundary_interpolation::BoundaryInterpolation;
use plyflow_geometry::vec3::{Vec3, unit};
use plyflow_sdk::On;
use plyflow_testing::{MemoryArtifact, MemoryBody, MemoryField, MemoryInput, run};
use serde_json::{Value, json};
use std::f64::consts::{FRAC_PI_2, PI};

#[test]
fn driven_nodes_follow_the_coarse_motion_in_place_and_velocity() {
    let out = interpolate(&coarse(0.0), json!({"element_size": 0.0025}), &[1]).unwrap();
    assert_eq!(out.attributes["zone"]["name"], "B");
    let body = out.body("ply_1");
    assert!(
        body.points.iter().all(|p| (p[2] - 0.101).abs() < 1e-12),
        "its place in the stack"
    );
    let (shape, nodes) = &out.arrays["ply_1/driven_nodes"];
    let k = shape[0];
    assert_eq!(k, 4 * 40);
    let (shape, position) = &out.arrays["ply_1/position"];
    let (_, velocity) = &out.arrays["ply_1/velocity"];
    assert_eq!(shape, &[6, k, 3]);
    for (f, &t) in TIMES.iter().enumerate() {
        for (i, &node) in nodes.iter().enumerate() {
            let start = body.points[node as usize];
            let expected = motion(start, t);
            let rate = {
                let h = 1e-6;
                let (a, b) = (motion(start, t - h), motion(start, t + h));
                [0, 1, 2].map(|d| (b[d] - a[d]) / (2.0 * h))
            };
            for d in 0..3 {
                let at = (f * k + i) * 3 + d;
                assert!((position[at] - expected[d]).abs() < 1e-12);
                assert!(
                    (velocity[at] - rate[d]).abs() < 1e-8,
                    "{} {}",
                    velocity[at],
                    rate[d]
                );
            }
        }
    }
    // Straight lines stay straight in this motion; between them the coarse surface is smooth and not quite bilinear.
    let error = out.result("interpolation_error");
    assert!(error < 1e-6, "{error}");
    let pressures = out.arrays["cavity_pressure"]
        .1
        .iter()
        .zip([1e5, 1e5, 1e5, 8e4, 4e4, 0.0]);
    assert!(
        pressures.clone().count() == 6 && pressures.into_iter().all(|(a, b)| (a - b).abs() < 1e-6)
    );
    assert!(!out.arrays.contains_key("frame_height"));
    assert_eq!(out.attributes["sheets"].as_array().unwrap().len(), 2);
    assert!(out.log.is_empty(), "{:?}", out.log);
}

#[test]
fn a_late_start_gives_all_nodes_their_way_there_and_the_rest_of_the_motion() {
    let whole = interpolate(&coarse(0.0), json!({"element_size": 0.005}), &[1]).unwrap();
    let late = |t: f64| {
        interpolate(
            &coarse(0.0),
            json!({"element_size": 0.005, "start_time": t}),
            &[1],
        )
    };
    assert!(!whole.arrays.contains_key("ply_1/path"));
    // Frames lie 0.2 s apart.
    let out = late(0.5).unwrap();
    assert_eq!(out.arrays["time"].1, TIMES[2..]);
    assert_eq!(out.attributes["start_time"], 0.4);
    for what in ["position", "velocity", "normal", "normal_rate"] {
        let name = format!("ply_1/{what}");
        let ((shape, rest), all) = (&out.arrays[&name], &whole.arrays[&name].1);
        assert_eq!(rest[..], all[2 * 3 * shape[1]..], "{what}");
    }
    assert_eq!(out.arrays["cavity_pressure"].1.len(), 4);
    let points = &out.body("ply_1").points;
    let (shape, path) = &out.arrays["ply_1/path"];
    assert_eq!(shape, &[2, points.len(), 3]);
    let velocity = &out.arrays["ply_1/start_velocity"].1;
    for (i, p) in points.iter().enumerate() {
        let [before, here, after] = [0.2, 0.4, 0.6].map(|t| motion(*p, t));
        for d in 0..3 {
            let at = |state: usize| path[(state * points.len() + i) * 3 + d];
            // Between lines of the coarse mesh the surface is smooth, and not quite the motion's.
            assert!((at(0) - before[d]).abs() < 2e-6 && (at(1) - here[d]).abs() < 2e-6);
            let rate = (after[d] - before[d]) / 0.4;
            assert!((velocity[3 * i + d] - rate).abs() < 1e-5);
        }
    }
    assert_eq!(late(0.8).unwrap().arrays["time"].1, [0.8, 1.0]);
    let refused = late(1.0).unwrap_err();
    assert!(
        refused.contains("start_time") && refused.contains("earlier"),
        "{refused}"
    );
}

#[test]
fn a_zone_finds_the_frame_before_its_ply_is_bent() {
    let begin = |bend: f64, zone: u64| {
        let parameters = json!({"element_size": 0.005, "start_bend": bend});
        let out = interpolate(&coarse(5.0), parameters, &[zone]).unwrap();
        assert_eq!(out.arrays["time"].1[0], out.attributes["start_time"]);
        out.attributes["start_time"].as_f64().unwrap()
    };
    // The curvature along y grows as 10 1/m times the time where the slope is small; that of the twist is less by far.
    // Beyond a third of the sharpest a limit changes nothing.
    for zone in [0, 1] {
        assert_eq!([1.0, 2.5, 1000.0].map(|b| begin(b, zone)), [0.0, 0.2, 0.2]);
    }
    let both = json!({"element_size": 0.005, "start_bend": 0.5, "start_time": 0.4});
    let refused = interpolate(&coarse(0.5), both, &[1]).unwrap_err();
    assert!(
        refused.contains("`start_time` and `start_bend`"),
        "{refused}"
    );
}

#[test]
fn normals_at_the_cut_are_those_of_the_coarse_surface_and_turn_with_it() {
    let out = interpolate(&coarse(0.0), json!({"element_size": 0.004}), &[1]).unwrap();
    let body = out.body("ply_1");
    let (shape, nodes) = &out.arrays["ply_1/driven_nodes"];
    let k = shape[0];
    let (_, normal) = &out.arrays["ply_1/normal"];
    let (_, rate) = &out.arrays["ply_1/normal_rate"];
    // Of the motion above: d/dx x d/dy of it.
    let exact = |[x, y, _]: Vec3, t: f64| {
        let s = t * t * (3.0 - 2.0 * t);
        unit([2.0 * s * y, 2.0 * s * x - 0.2 * s * s * y, 1.0])
    };
    for (f, &t) in TIMES.iter().enumerate() {
        for (i, &node) in nodes.iter().enumerate() {
            let (start, at) = (body.points[node as usize], (f * k + i) * 3);
            let (n, [a, b]) = (
                exact(start, t),
                [t - 1e-6, t + 1e-6].map(|t| exact(start, t)),
            );
            for d in 0..3 {
                assert!(
                    (normal[at + d] - n[d]).abs() < 1e-4,
                    "{} {}",
                    normal[at + d],
                    n[d]
                );
                let slope = (b[d] - a[d]) / 2e-6;
                assert!(
                    (rate[at + d] - slope).abs() < 5e-3,
                    "{} {slope}",
                    rate[at + d]
                );
            }
        }
    }
    assert!(
        !out.arrays.contains_key("film_low/normal"),
        "films do not rotate"
    );
}

#[test]
fn a_cut_on_the_blank_s_corner_leaves_two_sides_free() {
    let out = interpolate(&coarse(0.0), json!({"element_size": 0.01}), &[0]).unwrap();
    assert_eq!(out.arrays["ply_1/driven_nodes"].0, [14 + 14]);
    // The film: 180 x 170 mm.
    assert_eq!(out.arrays["film_low/driven_nodes"].0, [2 * (18 + 17)]);
    assert_eq!(out.result("elements"), (14 * 13 + 18 * 17) as f64);
}

#[test]
fn a_zone_that_covers_the_whole_ply_cuts_films_alone() {
    let whole =
        json!([{"name": "A", "box": [-0.24, -0.15, 0.24, 0.15], "free_sides": vec![true; 4]}]);
    let zones = MemoryArtifact {
        kind: "zones".into(),
        attributes: json!({"zones": whole}),
        ..Default::default()
    };
    let formed = coarse(0.0);
    let inputs = [
        MemoryInput::new("formed", &formed),
        MemoryInput::new("zones", &zones),
    ];
    let out = run::<BoundaryInterpolation>(json!({"element_size": 0.01}), &inputs, &[0]).unwrap();
    assert_eq!(out.arrays["ply_1/driven_nodes"].0, [0]);
    // The arrays are there all the same.
    for what in ["position", "velocity", "normal", "normal_rate"] {
        assert_eq!(out.arrays[&format!("ply_1/{what}")].0, [6, 0, 3], "{what}");
    }
    assert!(out.arrays["film_low/driven_nodes"].0[0] > 0);
}

#[test]
fn interpolation_error_is_what_straight_fine_edges_cut_off() {
    // A parabola z = 4 y2 on the film's nodes every 1.5 m / 31. Fine edges are its chords, those of 6 mm up to 8 a2 / 8 deep,
    // and more where the coarse surface is a little off the parabola.
    let error = |size: f64| {
        let sizes = json!({"element_size": size, "film_element_size": size});
        let out = interpolate(&coarse(4.0), sizes, &[1]).unwrap();
        out.result("interpolation_error")
    };
    let (wide, narrow) = (error(0.006), error(0.001));
    // Kinks of straight coarse edges would be cut off by 5.8e-4.
    assert!(wide > 2e-5 && wide < 0.4 * 5.8e-4, "{wide}");
    assert!(narrow < 0.5 * wide, "{narrow} {wide}");
}

#[test]
fn a_cut_that_gives_way_is_told_what_its_surroundings_pull_with() {
    let held = json!({"element_size": 0.005, "cut_stiffness": 3e6});
    let mut formed = coarse(0.0);
    let error = interpolate(&formed, held.clone(), &[1]).unwrap_err();
    assert!(
        error.contains("ply 'ply_1'") && error.contains("fibres"),
        "{error}"
    );
    let ply = &mut formed.attributes["sheets"][1];
    (ply["fibre_1"], ply["fibre_2"]) = (json!(0.0), json!(FRAC_PI_2));
    let error = interpolate(&formed, held.clone(), &[1]).unwrap_err();
    assert!(
        error.contains("ply 'ply_1'") && error.contains("membrane_force_1"),
        "{error}"
    );
    // 200 N/m along x and 50 N/m of shear, growing in time.
    for body in &mut formed.bodies {
        let of = |name: &str, value: f64| MemoryField {
            name: name.into(),
            on: On::Cells,
            components: 1,
            values: vec![value; body.cells.len() / 4],
        };
        let at = |t: &f64| {
            vec![
                of("membrane_force_1", 200.0 * t),
                of("membrane_force_2", 0.0),
                of("membrane_force_12", 50.0 * t),
            ]
        };
        body.fields = TIMES.iter().map(at).collect();
    }
    let out = interpolate(&formed, held.clone(), &[1]).unwrap();
    let (shape, pull) = &out.arrays["ply_1/pull"];
    assert_eq!(shape, &out.arrays["ply_1/position"].0);
    let k = shape[1];
    // Zone B, 100 x 100 mm, is cut all around.
    let (_, stiffness) = &out.arrays["ply_1/stiffness"];
    assert_eq!(stiffness.len(), k);
    let around: f64 = stiffness.iter().sum();
    assert!((around / (3e6 * 0.4) - 1.0).abs() < 1e-9, "{around}");
    let frame = |f: usize| &pull[3 * k * f..3 * k * (f + 1)];
    assert!(frame(0).iter().all(|v| *v == 0.0));
    // The motion is bilinear in place: at t = 1, F = [[1, 0.1], [0, 1], [-2 y, -2 x]] and the traction is F S N. Both ends of the zone are
    // pulled at, and as S is even the sum is that of F's change across.
    let [ex, ey] = [0.1, 0.1];
    let expected = [0.0, 0.0, -2.0 * 2.0 * 50.0 * ex * ey];
    let sum = (0..3).map(|c| frame(5).iter().skip(c).step_by(3).sum::<f64>());
    for (sum, expected) in sum.zip(expected) {
        assert!((sum - expected).abs() < 1e-6, "{sum} {expected}");
    }
    // Forces are told along the family that the other one follows counter-clockwise, whichever the scene names first.
    for (families, same) in [
        ([0.0, FRAC_PI_2], true),
        ([FRAC_PI_2, 0.0], true),
        ([FRAC_PI_2, PI], false),
    ] {
        let mut other = formed.clone();
        let ply = &mut other.attributes["sheets"][1];
        (ply["fibre_1"], ply["fibre_2"]) = (json!(families[0]), json!(families[1]));
        let told = interpolate(&other, held.clone(), &[1]).unwrap();
        let off = (told.arrays["ply_1/pull"].1.iter().zip(pull))
            .fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
        assert_eq!(off < 1e-9, same, "{families:?}: {off} N");
    }
    // Films are not pulled at.
    assert!(!out.arrays.contains_key("film_low/pull"));
}

#[test]
fn the_zone_is_told_from_the_pass_in_whichever_order_a_step_is_fanned_out() {
    let mut formed = coarse(0.0);
    let size = json!({"element_size": 0.01});
    let zone = |item: &[u64], pass: &[u64]| {
        let out = of_pass(&formed, size.clone(), item, pass).unwrap();
        out.attributes["zone"]["name"].clone()
    };
    for (zones, name) in [(0, "A"), (1, "B")] {
        assert_eq!(
            zone(&[0, zones], &[0]),
            name,
            "{{pass: feedback, zone: zones}}"
        );
        assert_eq!(
            zone(&[zones, 0], &[0]),
            name,
            "{{zone: zones, pass: feedback}}"
        );
        assert_eq!(zone(&[0, zones, 0], &[0, 0]), name);
    }
    // Over the passes alone: zone A would be built as if it had been asked for.
    let error = of_pass(&formed, size.clone(), &[0], &[0]).unwrap_err();
    assert!(
        error.contains("[0] are those of 'coarse_2'")
            && error.contains("Add `zone: zones` to its `for_each`"),
        "{error}"
    );
    // Over something of which the coarse run knows nothing.
    let error = of_pass(&formed, size.clone(), &[0, 1], &[]).unwrap_err();
    assert!(
        error.contains("item [0, 1]")
            && error.contains("`for_each: {pass: feedback, zone: zones}`"),
        "{error}"
    );
    // A run of the zone itself may drive a finer one.
    formed.attributes["zone"] = zones().attributes["zones"][1].clone();
    let out = of_pass(&formed, size.clone(), &[1], &[1]).unwrap();
    assert_eq!(out.attributes["zone"]["name"], "B");
    assert!(of_pass(&formed, size, &[0], &[0]).is_err());
}

#[test]
fn a_missing_zone_and_a_still_run_are_named() {
    let error = interpolate(&coarse(0.0), json!({"element_size": 0.01}), &[7]).unwrap_err();
    assert!(
        error.contains("zone 7") && error.contains("holds 2"),
        "{error}"
    );
    let error = interpolate(&coarse(0.0), json!({"element_size": 0.01}), &[]).unwrap_err();
    assert!(error.contains("for_each"), "{error}");
    let error = interpolate(&coarse(0.0), json!({"element_size": 0.11}), &[1]).unwrap_err();
    assert!(error.contains("110 mm in zone B (x 0 to 100 mm"), "{error}");
    let mut still = coarse(0.0);
    still.times.truncate(1);
    let error = interpolate(&still, json!({"element_size": 0.01}), &[0]).unwrap_err();
    assert!(error.contains("1 frames"), "{error}");
}

#[test]
fn a_first_frame_that_is_not_the_undeformed_state_brings_a_warning() {
    let mut late = coarse(0.0);
    for body in &mut late.bodies {
        body.frames[0].iter_mut().for_each(|p| p[2] -= 0.002);
    }
    let out = interpolate(&late, json!({"element_size": 0.01}), &[1]).unwrap();
    assert!(
        out.log.iter().any(|l| l.contains("2.00 mm")),
        "{:?}",
        out.log
    );
}

#[test]
fn a_zone_takes_the_size_that_a_mesh_study_of_its_runs_advises_and_no_finer_than_asked_for() {
    let study = |zones: Value| MemoryArtifact {
        kind: "mesh-study".into(),
        attributes: json!({"target_error": 0.1, "zones": zones}),
        ..Default::default()
    };
    let name = &zones().attributes["zones"][0]["name"];
    let bounds = &zones().attributes["zones"][0]["box"];
    let taken = |advised: f64, least: f64| {
        let (formed, zones) = (coarse(0.0), zones());
        let study = study(
            json!([{"name": "Z", "box": [0.0, 0.0, 1.0, 1.0], "element_size": 1.0, "finest_error": 0.1},
            {"name": name, "box": bounds, "element_size": advised, "finest_error": 0.1}]),
        );
        let inputs = [
            MemoryInput::new("formed", &formed),
            MemoryInput::new("zones", &zones),
            MemoryInput::new("meshes", &study),
        ];
        let parameters = json!({"element_size": least});
        let out = run::<BoundaryInterpolation>(parameters, &inputs, &[0]).unwrap();
        assert_eq!(out.attributes["element_size"], out.result("element_size"));
        assert_eq!(
            out.attributes["film_element_size"],
            out.result("element_size")
        );
        let warned = out
            .log
            .iter()
            .any(|l| l.contains("finer than `element_size`"));
        (out.result("element_size"), out.result("elements"), warned)
    };
    let (size, many, warned) = taken(0.005, 0.002);
    assert_eq!((size, warned), (0.005, false));
    let (size, few, warned) = taken(0.005, 0.010);
    assert_eq!((size, warned), (0.010, true));
    assert!(many > 3.0 * few);
    let (formed, zones, of_the_whole) = (coarse(0.0), zones(), study(json!([])));
    let inputs = [
        MemoryInput::new("formed", &formed),
        MemoryInput::new("zones", &zones),
        MemoryInput::new("meshes", &of_the_whole),
    ];
    let parameters = json!({"element_size": 0.01});
    let error = run::<BoundaryInterpolation>(parameters, &inputs, &[0]).unwrap_err();
    assert!(
        error.contains("advises no element size for zone"),
        "{error}"
    );
    let of_another = study(
        json!([{"name": name, "box": [0.0, 0.0, 1.0, 1.0], "element_size": 0.004, "finest_error": 0.1}]),
    );
    let inputs = [
        inputs[0],
        inputs[1],
        MemoryInput::new("meshes", &of_another),
    ];
    let parameters = json!({"element_size": 0.01});
    let error = run::<BoundaryInterpolation>(parameters, &inputs, &[0]).unwrap_err();
    assert!(
        error.contains("with the box [0.0, 0.0, 1.0, 1.0] m"),
        "{error}"
    );
}

#[test]
fn films_of_a_zone_end_where_the_smaller_one_is_joined_to_the_other() {
    let mut formed = coarse(0.0);
    let smaller = |p: &Vec3| [0.3 * p[0], 0.3 * p[1], p[2] + 0.002];
    let lower = formed.body("film_low");
    let top = MemoryBody {
        name: "film_top".into(),
        points: lower.points.iter().map(smaller).collect(),
        frames: (lower.frames.iter())
            .map(|f| f.iter().map(smaller).collect())
            .collect(),
        cells: lower.cells.clone(),
        nodes_per_cell: 4,
        ..Default::default()
    };
    formed.bodies.push(top);
    let film =
        json!({"name": "film_top", "kind": "diaphragm", "thickness": 0.00008, "offset": 0.0005});
    formed.attributes["sheets"]
        .as_array_mut()
        .unwrap()
        .push(film);
    let with = |margin: f64| {
        let p = json!({"element_size": 0.005, "film_margin": margin});
        let out = interpolate(&formed, p, &[0]).unwrap();
        ["film_low", "film_top"].map(|name| {
            let x = out.body(name).points.iter().map(|p| p[0]);
            x.fold(f64::INFINITY, f64::min)
        })
    };
    // The ply ends at -0.24 m, the upper film at -0.27 m, the lower one at -0.9 m.
    for (margin, end) in [(0.02, -0.26), (0.06, -0.27)] {
        for x in with(margin) {
            assert!((x - end).abs() < 1e-9, "{x} at a margin of {margin}");
        }
    }
}

#[test]
fn sizes_a_thousandfold_too_small_are_refused_before_a_zone_is_meshed() {
    let formed = coarse(0.0);
    for (with, sheet, parameter) in [
        (json!({"element_size": 2e-6}), "film_low", "element_size"),
        (
            json!({"element_size": 2e-6, "film_element_size": 0.01}),
            "ply_1",
            "element_size",
        ),
        (
            json!({"element_size": 0.01, "film_element_size": 2e-6}),
            "film_low",
            "film_element_size",
        ),
    ] {
        let error = interpolate(&formed, with, &[0]).unwrap_err();
        for part in [
            format!("the mesh of '{sheet}' in the zone would have"),
            format!("elements at `{parameter}`"),
            format!("Take `{parameter}` of at least"),
        ] {
            assert!(error.contains(&part), "{error}");
        }
    }
}

#[test]
fn rigid_parts_go_on_from_the_row_before_the_beginning_in_the_fine_run_s_own_time() {
    let parameters = |with: Value| {
        let mut all = json!({"element_size": 0.005});
        all.as_object_mut()
            .unwrap()
            .extend(with.as_object().unwrap().clone());
        all
    };
    let mut formed = coarse(0.0);
    let none = interpolate(&formed, parameters(json!({})), &[1]).unwrap();
    assert!(!none.arrays.keys().any(|k| k.starts_with("parts/")));
    // Of a press and of a stamping: rows at 0, 0.5 and 1 s.
    let rows = |ways: [f64; 3]| (vec![3], ways.to_vec());
    formed
        .arrays
        .insert("history/holder_travel".into(), rows([0.0, 1e-3, 3e-3]));
    formed
        .arrays
        .insert("history/parts/pad/way".into(), rows([2e-3, 1e-3, 0.0]));
    let ply = formed.body("ply_1");
    formed.bodies.push(MemoryBody {
        name: "pad".into(),
        points: ply.points.clone(),
        nodes_per_cell: 4,
        cells: ply.cells.clone(),
        frames: ply.frames.clone(),
        ..MemoryBody::default()
    });
    let late = json!({"start_time": 0.6, "slower": 2.0});
    let late = interpolate(&formed, parameters(late), &[1]).unwrap();
    for (name, expected) in [
        ("parts/time", [1.0, 2.0]),
        ("parts/holder/way", [1e-3, 3e-3]),
        ("parts/pad/way", [1e-3, 0.0]),
    ] {
        assert_eq!(late.arrays[name].1, expected, "{name}");
    }
    let whole = interpolate(&formed, parameters(json!({})), &[1]).unwrap();
    assert_eq!(whole.arrays["parts/time"].1, [0.0, 0.5, 1.0]);
    formed
        .arrays
        .insert("history/holder_travel".into(), (vec![2], vec![0.0; 2]));
    let torn = interpolate(&formed, parameters(json!({})), &[1]).unwrap_err();
    assert!(torn.contains("history/holder_travel 2"), "{torn}");
}

#[test]
fn a_zone_across_a_notch_follows_the_coarse_motion_at_its_cut_and_not_at_the_notch() {
    let mut formed = coarse(0.0);
    let notched = json!([
        [-0.24, -0.15],
        [0.24, -0.15],
        [0.24, 0.15],
        [0.08, 0.15],
        [0.05, 0.05],
        [0.02, 0.15],
        [-0.24, 0.15]
    ]);
    formed.attributes["sheets"][1]["outline"] = notched;
    // Zone B, from 0 to 100 mm along x and y: the notch ends in it.
    let out = interpolate(&formed, json!({"element_size": 0.005}), &[1]).unwrap();
    let body = out.body("ply_1");
    let (_, nodes) = &out.arrays["ply_1/driven_nodes"];
    let (_, position) = &out.arrays["ply_1/position"];
    let k = nodes.len();
    for (f, &t) in TIMES.iter().enumerate() {
        for (i, &node) in nodes.iter().enumerate() {
            let expected = motion(body.points[node as usize], t);
            let own = &position[(f * k + i) * 3..][..3];
            let off = (0..3)
                .map(|d| (own[d] - expected[d]).abs())
                .fold(0.0, f64::max);
            assert!(off < 1e-9, "{own:?} {expected:?}");
        }
    }
    let tip = |n: u32| {
        let [x, y, _] = body.points[n as usize];
        (x - 0.05).hypot(y - 0.05) < 1e-9
    };
    assert!(
        (0..body.points.len() as u32).any(tip),
        "a node in the notch's corner"
    );
    assert!(!nodes.iter().any(|n| tip(*n as u32)), "which is free");
}
