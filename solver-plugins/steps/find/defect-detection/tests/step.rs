//! The step on formed plies whose defects are known.

use plyflow_defect_detection::DefectDetection;
use plyflow_geometry::vec3::Vec3;
use plyflow_sdk::On;
use plyflow_testing::{MemoryArtifact, MemoryBody, MemoryField, MemoryInput, run};
use serde_json::json;

const HEIGHT: f64 = 0.060;
const OFFSET: f64 = 0.00028;

fn quads(n: [usize; 2], size: [f64; 2], z: f64) -> (Vec<Vec3>, Vec<u32>) {
    let mut points = Vec::new();
    for j in 0..=n[1] {
        for i in 0..=n[0] {
            let at = |d: usize, i: usize| size[d] * (i as f64 / n[d] as f64 - 0.5);
            points.push([at(0, i), at(1, j), z]);
        }
    }
    let at = |i: usize, j: usize| (j * (n[0] + 1) + i) as u32;
    let mut cells = Vec::new();
    for j in 0..n[1] {
        for i in 0..n[0] {
            cells.extend([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    (points, cells)
}

/// A block 300 x 200 mm, 60 mm high, open below, with upright walls.
fn tool() -> MemoryBody {
    let (mut points, quads) = quads([6, 4], [0.300, 0.200], HEIGHT);
    let mut cells: Vec<u32> = quads
        .chunks_exact(4)
        .flat_map(|c| [c[0], c[1], c[2], c[0], c[2], c[3]])
        .collect();
    let rim: Vec<u32> = (0..7)
        .chain([13, 20, 27, 34])
        .chain((28..34).rev())
        .chain([21, 14, 7])
        .collect();
    let base = points.len() as u32;
    for &i in &rim {
        let [x, y, _] = points[i as usize];
        points.push([x, y, 0.0]);
    }
    let n = rim.len();
    for k in 0..n {
        let (a, b) = (rim[k], rim[(k + 1) % n]);
        let (c, d) = (base + k as u32, base + ((k + 1) % n) as u32);
        cells.extend([a, c, d, a, d, b]);
    }
    MemoryBody {
        name: "tool".into(),
        points,
        nodes_per_cell: 3,
        cells,
        ..Default::default()
    }
}

/// One ply 200 x 100 mm with 10 mm cells, formed to `z` above the top, with the given shear in each cell.
fn formed(z: impl Fn(f64, f64) -> f64, shear: impl Fn(usize) -> f64) -> MemoryArtifact {
    let (points, cells) = quads([20, 10], [0.200, 0.100], 0.2);
    let lifted: Vec<Vec3> = points
        .iter()
        .map(|p| [p[0], p[1], HEIGHT + z(p[0], p[1])])
        .collect();
    let angles = |on: f64| (0..200).map(|c| on * shear(c)).collect();
    let field = |values| MemoryField {
        name: "shear_angle".into(),
        on: On::Cells,
        components: 1,
        values,
    };
    let ply = MemoryBody {
        name: "ply_1".into(),
        nodes_per_cell: 4,
        cells,
        frames: vec![points.clone(), lifted],
        points,
        fields: vec![vec![field(angles(0.0))], vec![field(angles(1.0))]],
        ..Default::default()
    };
    MemoryArtifact {
        kind: "forming".into(),
        attributes: json!({"sheets": [{"name": "film", "kind": "diaphragm", "thickness": 0.00008, "offset": 0.00004},
                                      {"name": "ply_1", "kind": "ply", "material": "NCF", "thickness": 0.0004, "offset": OFFSET,
                                       "over_shear": {"positive": f64::to_radians(8.0), "negative": f64::to_radians(-50.0)}}]}),
        times: vec![0.0, 1.0],
        bodies: vec![tool(), ply],
        ..Default::default()
    }
}

fn detect(input: &MemoryArtifact) -> MemoryArtifact {
    run::<DefectDetection>(json!({}), &[MemoryInput::new("formed", input)], &[]).unwrap()
}

#[test]
fn flat_ply_on_a_flat_tool_has_no_defect() {
    let found = detect(&formed(|_, _| OFFSET, |_| 0.01));
    assert_eq!(found.kind, "defects");
    for name in ["flagged_area", "over_shear_area", "poor_conformity_area"] {
        assert_eq!(
            found.result(name).to_bits(),
            0,
            "{name}: zero, and not minus zero"
        );
    }
    assert!(found.result("distance_max").abs() < 1e-12);
    assert!(found.body("ply_1").last("flag").iter().all(|&f| f == 0.0));
}

#[test]
fn a_ply_beside_a_tool_without_a_bed_is_not_flagged_and_the_share_is_told() {
    // Flat, and moved along the block of 300 mm until its last 49 mm of 200 mm lie past it.
    let mut input = formed(|_, _| OFFSET, |_| 0.0);
    for p in &mut input.bodies[1].frames[1] {
        p[0] += 0.099;
    }
    let bridging = detect(&input);
    assert!((bridging.result("poor_conformity_area") - 0.050 * 0.100).abs() < 1e-9);
    assert!((bridging.result("judged_share.ply_1") - 1.0).abs() < 1e-12);
    input.attributes["without_bed"] = json!(true);
    let found = detect(&input);
    assert_eq!(found.result("poor_conformity_area"), 0.0);
    assert_eq!(found.result("flagged_area"), 0.0);
    assert!(found.result("distance_max").abs() < 1e-12);
    // Nodes at each 10 mm: the last five of 21 rows, of which the outermost stands for half as much.
    let share = 1.0 - 4.5 / 20.0;
    assert!((found.result("judged_share.ply_1") - share).abs() < 1e-12);
    assert_eq!(
        found.attributes["plies"][0]["judged_share"],
        json!(found.result("judged_share.ply_1"))
    );
    let (judged, points) = (
        found.body("ply_1").last("judged"),
        &input.bodies[1].frames[1],
    );
    for (judged, p) in judged.iter().zip(points) {
        assert_eq!(*judged, f64::from(u8::from(p[0] < 0.15)), "{p:?}");
    }
}

#[test]
fn blank_that_hangs_over_the_rim_onto_the_bed_has_no_poor_conformity() {
    // The block is 300 mm long: moved by 100 mm, the ply's last 50 mm lie past it, half-way down and on
    // the bed.
    let mut input = formed(|_, _| OFFSET, |_| 0.0);
    for p in &mut input.bodies[1].frames[1] {
        p[0] += 0.101;
        if p[0] > 0.155 {
            p[2] = 0.0005;
        }
    }
    let found = detect(&input);
    assert_eq!(found.result("poor_conformity_area"), 0.0);
    let distances = found.body("ply_1").last("nodal_distance");
    assert!(
        distances.iter().any(|&d| d > 0.03),
        "the distance itself is still reported"
    );
}

#[test]
fn shear_beyond_the_asymmetric_limits_is_flagged_with_its_undeformed_area() {
    let degrees = [9.0, 8.1, 7.9, -49.0, -51.0, 0.0];
    let found = detect(&formed(
        |_, _| OFFSET,
        |c| f64::to_radians(*degrees.get(c).unwrap_or(&0.0)),
    ));
    let flags = found.body("ply_1").last("over_shear");
    assert_eq!(&flags[..6], &[1.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    assert!((found.result("over_shear_area") - 3.0e-4).abs() < 1e-12);
    assert_eq!(
        found.result("flagged_area"),
        found.result("over_shear_area")
    );
    assert!((found.result("shear_max") - 9f64.to_radians()).abs() < 1e-12);
    assert!((found.result("shear_min") + 51f64.to_radians()).abs() < 1e-12);
    assert_eq!(found.body("ply_1").last("undeformed").len(), 3 * 231);
}

#[test]
fn a_blister_above_the_threshold_is_poor_conformity_and_below_it_is_not() {
    let blister = |height: f64| {
        move |x: f64, y: f64| {
            if x.hypot(y) < 0.011 {
                OFFSET + height
            } else {
                OFFSET
            }
        }
    };
    let flat = detect(&formed(blister(0.0009), |_| 0.0));
    assert_eq!(flat.result("flagged_area"), 0.0);
    let found = detect(&formed(blister(0.0011), |_| 0.0));
    // Five nodes: the middle one and its edge neighbours; they touch twelve cells of 100 mm2.
    assert_eq!(
        found
            .body("ply_1")
            .last("poor_conformity")
            .iter()
            .sum::<f64>(),
        5.0
    );
    assert!((found.result("poor_conformity_area") - 12.0e-4).abs() < 1e-12);
    assert!((found.result("distance_max") - 0.0011).abs() < 1e-12);
    let curvature = found.body("ply_1").last("curvature_max");
    assert!(
        curvature.iter().any(|k| *k < -5.0),
        "the blister's crest bends away from its normal"
    );
    let ply = &found.attributes["plies"][0];
    assert_eq!(ply["name"], "ply_1");
    assert!(
        (found.attributes["thresholds"]["over_shear_positive"]
            .as_f64()
            .unwrap()
            - 0.13963)
            .abs()
            < 1e-4
    );
}

#[test]
fn a_run_without_plies_or_frames_says_so() {
    let mut input = formed(|_, _| OFFSET, |_| 0.0);
    input.attributes = json!({"sheets": []});
    let error =
        run::<DefectDetection>(json!({}), &[MemoryInput::new("formed", &input)], &[]).unwrap_err();
    assert!(error.contains("no sheet of kind 'ply'"), "{error}");
    let mut input = formed(|_, _| OFFSET, |_| 0.0);
    input.bodies.remove(0);
    let error =
        run::<DefectDetection>(json!({}), &[MemoryInput::new("formed", &input)], &[]).unwrap_err();
    assert!(
        error.contains("no body 'tool'") && error.contains("ply_1"),
        "{error}"
    );
}

#[test]
fn limits_of_another_fabric_are_warned_of() {
    // A woven ply over a dome: much shear of both signs, nothing wrong with it.
    let input = formed(
        |_, _| OFFSET,
        |c| f64::to_radians(if c % 2 == 0 { 20.0 } else { -20.0 }),
    );
    let warned = |found: &MemoryArtifact| {
        let told: Vec<&String> = found
            .log
            .iter()
            .filter(|l| l.contains("over-sheared"))
            .collect();
        assert!(told.len() < 2, "{told:?}");
        told.first().map(|t| (*t).clone())
    };
    let text = warned(&detect(&input)).expect("half of the ply is flagged");
    for part in [
        "50 % of ply 'ply_1'",
        "over_shear_positive: 8.0 deg",
        "woven",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let limits = json!({"over_shear_positive": f64::to_radians(45.0)});
    let found = run::<DefectDetection>(limits, &[MemoryInput::new("formed", &input)], &[]).unwrap();
    assert_eq!(warned(&found), None);
}

#[test]
fn a_ply_that_lies_beside_the_one_below_it_conforms_where_it_lies_on_the_film() {
    // The upper ply is 0.4 mm lower where x > 0: the one below ends there.
    const BELOW: f64 = 0.0004;
    let steps = |hangs: f64| {
        let z = move |x: f64, _: f64| OFFSET + if x > 0.0 { hangs } else { BELOW };
        let mut run = formed(z, |_| 0.0);
        let (points, cells) = quads([10, 10], [0.100, 0.100], 0.2);
        let points: Vec<Vec3> = points.iter().map(|p| [p[0] - 0.05, p[1], p[2]]).collect();
        let laid = points.iter().map(|p| [p[0], p[1], HEIGHT + OFFSET]);
        let mut below = MemoryBody {
            name: "ply_0".into(),
            frames: vec![points.clone(), laid.collect()],
            points,
            nodes_per_cell: 4,
            cells,
            ..Default::default()
        };
        let mut shear = run.bodies[1].fields.clone();
        for field in shear.iter_mut().flatten() {
            field.values.truncate(100);
        }
        below.fields = shear;
        run.bodies.push(below);
        run.attributes = json!({"contact_by_place": true, "sheets": [
            {"name": "film", "kind": "diaphragm", "offset": 0.00004, "thickness": 8e-5},
            {"name": "ply_0", "kind": "ply", "offset": OFFSET, "thickness": BELOW},
            {"name": "ply_1", "kind": "ply", "offset": OFFSET + BELOW, "thickness": BELOW}]});
        run
    };
    let found = detect(&steps(0.0));
    let distances = found.body("ply_1").last("nodal_distance");
    assert!(distances.iter().all(|d| d.abs() < 1e-9), "{distances:?}");
    // 1.2 mm above the film, and 0.8 above where a whole stack would be: it stands off.
    assert!((detect(&steps(0.0012)).result("distance_max") - 0.0012).abs() < 1e-9);
    assert!(detect(&steps(0.0012)).result("poor_conformity_area") > 0.005);
    // A run that lays it on the whole stack everywhere is judged so.
    let mut whole = steps(BELOW);
    whole.attributes["contact_by_place"] = json!(false);
    assert!(detect(&whole).result("distance_max").abs() < 1e-9);
    // So is one of a zone in which the mesh of the ply below ends where that ply does not; with a hole there it ends.
    let mut zone = steps(BELOW);
    let square = |half: f64| json!([[-half, -half], [half, -half], [half, half], [-half, half]]);
    zone.attributes["sheets"][1]["outline"] = square(0.5);
    assert!(detect(&zone).result("distance_max").abs() < 1e-9);
    zone.attributes["sheets"][1]["holes"] = json!([square(0.4)]);
    assert!((detect(&zone).result("distance_max") - BELOW).abs() < 1e-9);
}

/// Cells of a net that hang on: over-sheared and off the tool, whatever they show. `locked`: those of them where the fabric locks.
fn half_draped(draped: impl Fn(usize) -> bool, locked: impl Fn(usize) -> bool) -> MemoryArtifact {
    let shear = |c: usize| if draped(c) { 0.05 } else { 1.2 };
    let z = |x: f64, _: f64| OFFSET + if x > 0.051 { 0.02 } else { 0.0 };
    let mut input = formed(z, shear);
    let field = |name: &str, value: &dyn Fn(usize) -> f64| MemoryField {
        name: name.into(),
        on: On::Cells,
        components: 1,
        values: (0..200).map(value).collect(),
    };
    let on = field("draped", &|c| f64::from(u8::from(draped(c))));
    let why = field("drape_stop", &|c| match (draped(c), locked(c)) {
        (true, _) => 0.0,
        (false, true) => 1.0,
        (false, false) => 3.0,
    });
    input.bodies[1].fields[1].extend([on, why]);
    input
}

#[test]
fn cells_that_a_net_does_not_reach_are_no_defects_and_told() {
    // Fifteen of twenty cells along x, of 10 mm: what hangs on begins at x = 50 mm.
    let found = detect(&half_draped(|c| c % 20 < 15, |_| false));
    for name in [
        "flagged_area",
        "over_shear_area",
        "poor_conformity_area",
        "locked_area",
    ] {
        assert_eq!(found.result(name), 0.0, "{name}");
    }
    assert!((found.result("undraped_area") - 5e-3).abs() < 1e-12);
    assert_eq!(
        [found.result("shear_max"), found.result("shear_min")],
        [0.05; 2]
    );
    assert!(found.result("distance_max").abs() < 1e-12);
    let ply = found.body("ply_1");
    assert_eq!(
        ply.last("undeformed").len(),
        3 * 231,
        "the whole ply is there"
    );
    assert_eq!(ply.last("draped").iter().sum::<f64>(), 150.0);
    assert!(ply.last("flag").iter().all(|f| *f == 0.0));
    let text = found.log.join("\n");
    assert!(
        text.contains("ply 'ply_1'") && text.contains("draped on 75.0 % of its area"),
        "{text}"
    );
}

#[test]
fn where_the_fabric_locks_the_ply_is_flagged_and_nothing_of_it_is_measured() {
    let locked = |c: usize| c / 20 < 4;
    let found = detect(&half_draped(|c| c % 20 < 15, locked));
    assert!((found.result("locked_area") - 2e-3).abs() < 1e-12);
    assert_eq!(found.result("flagged_area"), 0.0);
    assert_eq!(found.result("shear_max"), 0.05);
    let flags = found.body("ply_1").last("flag");
    for (c, flag) in flags.iter().enumerate() {
        assert_eq!(*flag > 0.5, c % 20 >= 15 && locked(c), "cell {c}");
    }
    assert!(found.log.join("\n").contains("the fabric locks"));
}

#[test]
fn a_run_that_draped_all_of_a_ply_or_is_no_net_is_judged_as_before() {
    let all = detect(&half_draped(|_| true, |_| false));
    let mut plain = half_draped(|_| true, |_| false);
    plain.bodies[1].fields[1].truncate(1);
    let plain = detect(&plain);
    assert!(plain.log.is_empty() && all.log.is_empty());
    assert_eq!(all.bodies, plain.bodies);
    assert!(plain.result("poor_conformity_area") > 0.0);
}

/// A ply of a material without limits: nothing is flagged however far it is sheared, no area is told, and the log says why.
#[test]
fn shear_of_a_material_without_limits_is_not_judged_and_that_is_told() {
    let mut input = formed(|_, _| OFFSET, |_| f64::to_radians(70.0));
    let sheet = &mut input.attributes["sheets"][1];
    sheet.as_object_mut().unwrap().remove("over_shear");
    let found = detect(&input);
    assert!(!found.results.contains_key("over_shear_area"));
    assert_eq!(found.result("flagged_area"), 0.0);
    let ply = &found.attributes["plies"][0];
    assert_eq!(ply.get("over_shear_area"), None);
    assert_eq!(ply.get("over_shear"), None);
    let told = |found: &MemoryArtifact| {
        let told = found.log.iter().find(|l| l.contains("is not judged"));
        told.cloned()
    };
    let text = told(&found).unwrap();
    for part in ["shear of 'ply_1'", "'NCF'", "over_shear: {positive: 8 deg"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    // Asked of the step, they count for every ply; of one sign alone, for that.
    let limits = json!({"over_shear_negative": -0.5});
    let found = run::<DefectDetection>(limits, &[MemoryInput::new("formed", &input)], &[]).unwrap();
    assert_eq!(found.result("over_shear_area"), 0.0);
    assert!(told(&found).unwrap().contains("positive shear of 'ply_1'"));
    let limits = json!({"over_shear_positive": 1.0, "over_shear_negative": -0.5});
    let found = run::<DefectDetection>(limits, &[MemoryInput::new("formed", &input)], &[]).unwrap();
    assert!((found.result("over_shear_area") - 0.02).abs() < 1e-12);
    assert_eq!(told(&found), None);
}

/// Plies of two fabrics: each is judged by its own limits, and the artifact tells of the whole what they share. Of two without limits
/// one text tells.
#[test]
fn each_ply_is_judged_by_the_limits_of_its_own_material() {
    let mut input = formed(|_, _| OFFSET, |_| f64::to_radians(20.0));
    let limits = |positive: f64| json!({"positive": f64::to_radians(positive), "negative": f64::to_radians(-50.0)});
    let sheets = input.attributes["sheets"].as_array_mut().unwrap();
    let ncf = sheets[1].clone();
    let more = [
        ("ply_2", "woven", Some(limits(50.0))),
        ("ply_3", "cloth", None),
        ("ply_4", "cloth", None),
    ];
    for (name, material, over_shear) in more {
        let mut sheet = ncf.clone();
        sheet["name"] = json!(name);
        sheet["material"] = json!(material);
        match over_shear {
            Some(limits) => sheet["over_shear"] = limits,
            None => drop(sheet.as_object_mut().unwrap().remove("over_shear")),
        }
        sheets.push(sheet);
    }
    for name in ["ply_2", "ply_3", "ply_4"] {
        let mut body = input.bodies[1].clone();
        body.name = name.into();
        input.bodies.push(body);
    }
    let found = detect(&input);
    let area = |k: usize| {
        found.attributes["plies"][k]
            .get("over_shear_area")
            .and_then(|a| a.as_f64())
    };
    assert!((area(0).unwrap() - 0.02).abs() < 1e-12);
    assert_eq!((area(1), area(2), area(3)), (Some(0.0), None, None));
    assert!((found.result("over_shear_area") - 0.02).abs() < 1e-12);
    let thresholds = &found.attributes["thresholds"];
    assert_eq!(thresholds.get("over_shear_positive"), None);
    assert_eq!(thresholds.get("over_shear_negative"), None);
    let told: Vec<&String> = found
        .log
        .iter()
        .filter(|l| l.contains("is not judged"))
        .collect();
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(
        told[0].contains("shear of 'ply_3', 'ply_4' is not judged: the material 'cloth'"),
        "{told:?}"
    );
    // Without the two, the plies share their limit of negative shear.
    let sheets = input.attributes["sheets"].as_array_mut().unwrap();
    sheets.truncate(3);
    let found = detect(&input);
    let thresholds = &found.attributes["thresholds"];
    assert_eq!(thresholds.get("over_shear_positive"), None);
    let negative = thresholds["over_shear_negative"].as_f64().unwrap();
    assert!((negative - f64::to_radians(-50.0)).abs() < 1e-12);
}
