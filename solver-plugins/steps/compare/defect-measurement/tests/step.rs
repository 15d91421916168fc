//! A ply with a known wrinkle and bridge.

mod common;

use common::*;
use plyflow_defect_measurement::DefectMeasurement;
use plyflow_testing::{MemoryArtifact, MemoryInput, run};
use serde_json::{Value, json};
use std::f64::consts::PI;

#[test]
fn plies_are_measured_with_sections_and_distribution() {
    let out = measured(json!({"sections": [
        {"label": "A-A'", "from": [-0.035, -0.02], "to": [-0.035, 0.02]}]}));
    assert_eq!(out.result("wrinkle_count"), 1.0);
    assert_eq!(out.result("bridging_count"), 1.0);
    assert_eq!(out.result("wrinkle_length.ply_1"), 0.0);
    assert!((out.result("wrinkle_amplitude.ply_2") - 0.003).abs() < 1e-5);
    let area = PI * 0.0125f64.powi(2);
    assert!((out.result("bridging_area.ply_2") / area - 1.0).abs() < 0.03);
    assert!(out.result("distance_largest.ply_1") < 1e-12);
    let defects = &out.attributes["defects"];
    assert_eq!(defects[0]["cause"], "undetermined");
    assert_eq!(
        (&defects[0]["on"], &defects[0]["type"]),
        (&json!("ply_2"), &json!("wrinkle"))
    );
    for name in ["ridge_shear", "ridge_shear_min", "ridge_shear_max"] {
        let shear = defects[0][name].as_f64().unwrap();
        assert!((shear - 0.1).abs() < 1e-9, "{name}");
    }
    assert!(defects[0]["ridge_shear_profile"].as_array().unwrap().len() > 10);
    assert_eq!(
        out.attributes["tables"][0]["rows"]
            .as_array()
            .unwrap()
            .len(),
        2
    );
    // The highest place of the section is the crest, and its line has the arc's length.
    let (_, heights) = &out.arrays["sections/section_0/ply_2/height"];
    let top = heights.iter().copied().fold(0.0, f64::max);
    assert!(
        (top - (TOP + OFFSET + THICKNESS + 0.003)).abs() < 1e-5,
        "{top}"
    );
    let (_, stations) = &out.arrays["sections/section_0/ply_2/station"];
    assert!((stations[stations.len() - 1] - 0.04).abs() < 2.0 * H);
    // The density is one over what is judged.
    let (_, x) = &out.arrays["distributions/ply_2/value"];
    let (_, y) = &out.arrays["distributions/ply_2/density"];
    let sum: f64 = y.iter().map(|d| d * (x[1] - x[0])).sum();
    assert!((sum - 1.0).abs() < 0.01, "{sum}");
    let number = out.body("ply_2").last("defect");
    assert!(number.contains(&1.0) && number.contains(&2.0));
}

#[test]
fn causes_are_told_from_shear_bridging_and_layup() {
    let cause = |parameters: Value| measured(parameters).attributes["defects"][0]["cause"].clone();
    // 0.1 rad are 5.7 degrees. The crest ends 22 mm from where the blister is 1 mm high, or somewhat more.
    assert_eq!(cause(json!({"over_shear_positive": 0.09})), "over-shear");
    let mut of_material = formed();
    let sheets = of_material.attributes["sheets"].as_array_mut().unwrap();
    for sheet in sheets {
        sheet["over_shear"] = json!({"positive": 0.09});
    }
    let inputs = [MemoryInput::new("formed", &of_material)];
    let out = run::<DefectMeasurement>(json!({}), &inputs, &[]).unwrap();
    assert_eq!(out.attributes["defects"][0]["cause"], "over-shear");
    assert!(
        out.log.iter().any(|l| l.contains("over-shear is no cause")),
        "negative shear is not judged"
    );
    assert_eq!(cause(json!({"bridging_reach": 0.06})), "bridging");
    let mut run_off = formed();
    run_off.bodies[2].fields[0][1].values.fill(-2e-4);
    let inputs = [MemoryInput::new("formed", &run_off)];
    let out = run::<DefectMeasurement>(json!({}), &inputs, &[]).unwrap();
    assert_eq!(
        out.attributes["defects"][0]["cause"],
        "inter-ply-compression"
    );
}

#[test]
fn what_cannot_be_measured_is_told() {
    let formed = formed();
    let refused = |parameters: Value, artifact: &MemoryArtifact| {
        let inputs = [MemoryInput::new("formed", artifact)];
        run::<DefectMeasurement>(parameters, &inputs, &[]).unwrap_err()
    };
    let beside = json!({"sections": [{"label": "B", "from": [0.3, 0.3], "to": [0.4, 0.3]}]});
    assert!(refused(beside, &formed).contains("meets no ply"));
    let point = json!({"sections": [{"label": "B", "from": [0.0, 0.0], "to": [0.0, 0.0]}]});
    assert!(refused(point, &formed).contains("different places"));
    let both = json!({"sections": [{"label": "B", "from": [0.0, 0.0], "path": [[0.0, 0.0]]}]});
    assert!(refused(both, &formed).contains("or a `path`"));
    let flat =
        json!({"sections": [{"label": "B", "path": [[0.3, 0.0], [0.4, 0.0]], "on": "flat-ply"}]});
    assert!(refused(flat, &formed).contains("in the flat ply"));
    let missing = json!({"scan": "/nowhere/scan.stl"});
    assert!(refused(missing, &formed).contains("cannot read the scan `/nowhere/scan.stl`"));
    let folder = tempfile::tempdir().unwrap();
    let scan = scan_file(&folder, height, 1.0);
    let named = json!({"scan": scan, "scan_ply": "ply_7"});
    let told = refused(named, &formed);
    assert!(
        told.contains("no ply 'ply_7'; its plies are: ply_1, ply_2"),
        "{told}"
    );
    let mut without = formed.clone();
    without.attributes = json!({"sheets": []});
    assert!(refused(json!({}), &without).contains("no sheet of kind 'ply'"));
}

#[test]
fn what_a_net_does_not_reach_is_no_bridging_and_told() {
    let mut input = formed();
    let ply = input.bodies.iter_mut().find(|b| b.name == "ply_2").unwrap();
    // The blister lies about x = 40 mm, the wrinkle left of 0.
    let cells = ply.cells.chunks_exact(4);
    let draped = cells.map(|c| f64::from(u8::from(ply.points[c[0] as usize][0] < 0.005)));
    let draped: Vec<f64> = draped.collect();
    let on: f64 = draped.iter().sum();
    for (shear, draped) in ply.fields[0][0].values.iter_mut().zip(&draped) {
        *shear = if *draped > 0.5 { *shear } else { 1.4 };
    }
    ply.fields[0].push(plyflow_testing::MemoryField {
        name: "draped".into(),
        on: plyflow_sdk::On::Cells,
        components: 1,
        values: draped,
    });
    let inputs = [MemoryInput::new("formed", &input)];
    let out = run::<DefectMeasurement>(json!({}), &inputs, &[]).unwrap();
    assert_eq!(out.result("wrinkle_count"), 1.0);
    assert_eq!(out.result("bridging_count"), 0.0);
    let shown = out.body("ply_2");
    assert_eq!(
        shown.cells.len(),
        4 * on as usize,
        "what is shown is what was measured"
    );
    assert!(shown.last("shear_angle").iter().all(|g| *g == 0.1));
    let text = out.log.join("\n");
    assert!(
        text.contains("ply 'ply_2'") && text.contains("of its area (field `draped`)"),
        "{text}"
    );
}

#[test]
fn the_uppermost_ply_is_counted_and_its_longest_wrinkle_told_apart_from_all_of_them() {
    let mut run_off = formed();
    // A second wrinkle, 15 mm from the lower edge, 2 mm high and 40 mm long.
    for (p, flat) in run_off.bodies[2].frames[0].iter_mut().zip(flat()) {
        let along = (flat[0] + 0.035) / 0.020;
        let fade = if along.abs() < 1.0 {
            (0.5 * PI * along).cos()
        } else {
            0.0
        };
        p[2] += 0.002 * bump(flat[1] + 0.035, 0.007) * fade;
    }
    let inputs = [MemoryInput::new("formed", &run_off)];
    let out = run::<DefectMeasurement>(json!({}), &inputs, &[]).unwrap();
    let of = |name: &str| out.result(name);
    assert_eq!(
        (
            of("wrinkle_count"),
            of("wrinkle_count.ply_1"),
            of("wrinkle_count.ply_2")
        ),
        (2.0, 0.0, 2.0)
    );
    for name in [
        "wrinkle_count",
        "wrinkle_length",
        "wrinkle_length_max",
        "wrinkle_amplitude",
    ] {
        assert_eq!(
            of(&format!("uppermost_{name}")),
            of(&format!("{name}.ply_2")),
            "{name}"
        );
    }
    let both: Vec<f64> = (0..2)
        .map(|k| out.attributes["defects"][k]["length"].as_f64().unwrap())
        .collect();
    assert!((of("uppermost_wrinkle_length") - both[0] - both[1]).abs() < 1e-12);
    assert!(both[0] > 1.2 * both[1] && of("uppermost_wrinkle_length_max") == both[0]);
    // Both lie along x, one over the other: 35 mm apart across the tool, not at all along it.
    assert!(of("uppermost_wrinkle_distance") < 0.001);
    let across =
        run::<DefectMeasurement>(json!({"slip_direction": PI / 2.0}), &inputs, &[]).unwrap();
    let distance = across.result("uppermost_wrinkle_distance");
    assert!((distance - 0.035).abs() < 0.001, "{distance}");
    let one = measured(json!({}));
    assert!(!one.results.contains_key("uppermost_wrinkle_distance"));
    // The height is over 1 mm where the fade is over a third (0.5), along the crest.
    let reach = 2.0 * 0.030 * 2.0 / PI * (1.0f64 / 3.0).acos();
    assert!(
        (both[0] / reach - 1.0).abs() < 0.03,
        "{} for {reach}",
        both[0]
    );
    // Under another threshold the flatter one is no wrinkle.
    let inputs = [MemoryInput::new("formed", &run_off)];
    let out =
        run::<DefectMeasurement>(json!({"distance_threshold": 0.0025}), &inputs, &[]).unwrap();
    assert_eq!(out.result("uppermost_wrinkle_count"), 1.0);
}

/// Fills the strain of a family of `ply_2`: `inner` in the cells whose lower left corner lies left of x = -40 mm, `outer` elsewhere.
fn strain(of: &mut MemoryArtifact, family: usize, inner: f64, outer: f64) {
    let ply = &mut of.bodies[2];
    for (c, value) in ply
        .cells
        .chunks_exact(4)
        .zip(&mut ply.fields[0][family].values)
    {
        *value = if ply.points[c[0] as usize][0] < -0.0401 {
            inner
        } else {
            outer
        };
    }
}

#[test]
fn fibre_compression_is_the_flat_area_below_the_threshold_with_its_mean_and_least_strain() {
    let mut dry = formed();
    // A quarter of 160 x 100 mm at -0.4 %, the rest just not below the threshold.
    strain(&mut dry, 1, -4e-3, -1e-4);
    let measure = |run_: &MemoryArtifact, parameters: Value, against: Option<&MemoryArtifact>| {
        let mut inputs = vec![MemoryInput::new("formed", run_)];
        inputs.extend(against.map(|a| MemoryInput::new("against", a)));
        run::<DefectMeasurement>(parameters, &inputs, &[])
    };
    let out = measure(&dry, json!({}), None).unwrap();
    let near = |name: &str, value: f64| {
        let found = out.result(name);
        assert!(
            (found - value).abs() < 1e-9 * value.abs().max(1e-3),
            "{name}: {found} for {value}"
        );
    };
    near("compressed_area.ply_2.family_1", 0.04 * 0.1);
    near("compressed_strain_mean.ply_2.family_1", -4e-3);
    near("fibre_strain_least.ply_2.family_1", -4e-3);
    near("fibre_compression.ply_2.family_1", 1e-3);
    // Family 2 and the other ply are stretched; all together have four times the area.
    near("compressed_area.ply_2.family_2", 0.0);
    near("compressed_strain_mean.ply_2.family_2", 0.0);
    near("fibre_strain_least.ply_2.family_2", 2e-4);
    near("compressed_area", 0.004);
    near("fibre_compression", 0.25e-3);
    near("fibre_strain_least", -4e-3);
    assert!(!out.results.contains_key("compressed_area_fall"));
    assert_eq!(out.body("ply_2").last("fibre_strain_1")[0], -4e-3);
    let table = &out.attributes["tables"][1];
    assert_eq!(
        (&table["name"], table["rows"].as_array().unwrap().len()),
        (&json!("fibre_compression"), 4)
    );

    // The same area at 0.3 of the strain: it falls by 70 %, the area does not.
    let mut lubricated = formed();
    strain(&mut lubricated, 1, -1.2e-3, 1e-4);
    let fallen = measure(&lubricated, json!({}), Some(&out)).unwrap();
    for (name, value) in [
        ("fibre_compression_fall", 0.7),
        ("compressed_strain_mean_fall.ply_2.family_1", 0.7),
        ("fibre_strain_least_fall", 0.7),
        ("compressed_area_fall", 0.0),
    ] {
        assert!((fallen.result(name) - value).abs() < 1e-9, "{name}");
    }
    // What was not compressed cannot fall, and is not told as if it had not.
    assert!(
        !fallen
            .results
            .contains_key("compressed_area_fall.ply_2.family_2")
    );
    let other = measure(&lubricated, json!({"compressed_below": -5e-4}), Some(&out)).unwrap_err();
    assert!(other.contains("expected the same in both"), "{other}");
    let mut net = formed();
    for body in &mut net.bodies[1..] {
        body.fields[0].truncate(1);
    }
    let bare = measure(&net, json!({}), None).unwrap();
    assert!(!bare.results.contains_key("compressed_area"));
    assert!(
        measure(&net, json!({}), Some(&out))
            .unwrap_err()
            .contains("no fibre strains")
    );
    assert!(
        measure(&dry, json!({}), Some(&bare))
            .unwrap_err()
            .contains("no fibre compression")
    );
}

/// The wrinkle of the upper ply goes along x through (-35, 0) mm, 60 mm long and 14 mm wide; everywhere the shear is 0.1 rad, but in a place on it
/// and in one beside it.
#[test]
fn shear_of_a_region_is_told_outside_of_wrinkles() {
    let mut formed = formed();
    let at = |x: f64, y: f64| {
        let index = |v: f64, from: f64| ((v - from) / H) as usize;
        index(y, -0.050) * N[0] + index(x, -0.080)
    };
    let shear = |a: &mut MemoryArtifact, ply: usize, cell: usize, value: f64| {
        a.bodies[ply].fields[0][0].values[cell] = value;
    };
    shear(&mut formed, 2, at(-0.035, 0.0006), 0.5);
    shear(&mut formed, 2, at(-0.035, 0.0206), -0.2);
    shear(&mut formed, 1, at(-0.035, 0.0006), 0.3);
    let region = |name: &str, at: [f64; 2], size: [f64; 2]| json!({"name": name, "at": at, "length": size[0], "width": size[1]});
    let ask = |regions: Value| {
        let parameters = json!({"shear_regions": regions});
        run::<DefectMeasurement>(parameters, &[MemoryInput::new("formed", &formed)], &[])
    };
    let out = ask(json!([
        region("around", [-0.035, 0.0], [0.040, 0.060]),
        region("far", [0.0, -0.040], [0.150, 0.010]),
        region("crest", [-0.035, 0.0], [0.002, 0.002]),
    ]))
    .unwrap();
    let told = |name: &str| out.result(name);
    assert_eq!(told("region_shear_max.around.ply_2"), 0.2);
    assert_eq!(told("region_shear_max.around.ply_1"), 0.3);
    assert_eq!(told("region_shear_max.around"), 0.3);
    assert_eq!(told("region_shear_q99.around"), 0.1);
    let share = told("region_wrinkled_share.around.ply_2");
    assert!((0.10..0.25).contains(&share), "{share}");
    assert_eq!(told("region_wrinkled_share.around.ply_1"), 0.0);
    assert_eq!(told("region_shear_max.far"), 0.1);
    // All of it is in the wrinkle: nothing is told of this ply, and no zero.
    assert_eq!(told("region_wrinkled_share.crest.ply_2"), 1.0);
    assert!(!out.results.contains_key("region_shear_max.crest.ply_2"));
    for (regions, says) in [
        (
            json!([region("away", [0.3, 0.0], [0.01, 0.01])]),
            "no ply whose shear is known has an element there",
        ),
        (
            json!([region("a b", [0.0; 2], [0.1; 2])]),
            "cannot be a part of a result's name",
        ),
        (
            json!([
                region("a", [0.0; 2], [0.1; 2]),
                region("a", [0.0; 2], [0.1; 2])
            ]),
            "another one 'a'",
        ),
    ] {
        let error = ask(regions).err().unwrap().to_string();
        assert!(error.contains(says), "{error}");
    }
}

#[test]
fn the_direction_of_the_longest_crest_and_its_mirror_images_are_told() {
    let out = measured(json!({}));
    assert!(out.result("uppermost_wrinkle_direction").abs() < 0.02);
    assert!(out.result("uppermost_wrinkle_obliquity") < 0.02);
    // Along x through (-35, 0) mm: its own image about the length; the image with x turned round is 10 mm away at its nearer end, 70 mm at its middle.
    assert!(out.result("uppermost_crest_image_y") < 0.001);
    let ends = out.result("wrinkle_length.ply_2") / 2.0;
    for image in ["x", "turn"] {
        let found = out.result(&format!("uppermost_crest_image_{image}"));
        assert!((found - (0.070 - ends)).abs() < 0.002, "{image}: {found}");
    }
    let across = measured(json!({"slip_direction": PI / 2.0}));
    assert!((across.result("uppermost_wrinkle_direction").abs() - PI / 2.0).abs() < 0.02);
    assert!(across.result("uppermost_wrinkle_obliquity") < 0.02);
}

/// A wrinkle that is half as high again, and one that a measurement without wrinkles is held against.
#[test]
fn the_growth_of_wrinkles_from_another_measurement_is_told() {
    let before = measured(json!({}));
    let mut higher = formed();
    for p in &mut higher.bodies[2].frames[0] {
        p[2] += 0.0015 * wrinkle(p[0], p[1]);
    }
    let against = |other: &MemoryArtifact| {
        let inputs = [
            MemoryInput::new("formed", &higher),
            MemoryInput::new("against", other),
        ];
        run::<DefectMeasurement>(json!({}), &inputs, &[]).unwrap()
    };
    let out = against(&before);
    let change = out.result("uppermost_wrinkle_amplitude_change");
    assert!((change - 0.5).abs() < 0.01, "{change}");
    let [now, then] = [&out, &before].map(|a| a.result("uppermost_wrinkle_length"));
    assert!(now > then);
    for name in [
        "uppermost_wrinkle_length_change",
        "uppermost_wrinkle_length_max_change",
    ] {
        assert!(
            (out.result(name) - (now / then - 1.0)).abs() < 1e-12,
            "{name}"
        );
    }
    assert_eq!(out.result("uppermost_verdict_change"), 0.0);
    let none = measured(json!({"distance_threshold": 0.01}));
    let out = against(&none);
    let changes = out.results.keys().filter(|k| k.ends_with("_change"));
    assert!(changes.eq(["uppermost_verdict_change"]));
    assert_eq!(out.result("uppermost_verdict_change"), 1.0);
    let flat = shaped(|_, _| 0.0);
    let inputs = [("formed", &flat), ("against", &before)].map(|(n, a)| MemoryInput::new(n, a));
    let out = run::<DefectMeasurement>(json!({}), &inputs, &[]).unwrap();
    assert_eq!(out.result("uppermost_verdict_change"), -1.0);
    let mut silent = before.clone();
    silent
        .attributes
        .as_object_mut()
        .unwrap()
        .remove("uppermost");
    let inputs = [("formed", &flat), ("against", &silent)].map(|(n, a)| MemoryInput::new(n, a));
    let error = run::<DefectMeasurement>(json!({}), &inputs, &[]).unwrap_err();
    assert!(
        error.contains("against: ") && error.contains("uppermost"),
        "{error}"
    );
}

/// The upper ply with this height over the tool and no other defect.
fn shaped(height: impl Fn(f64, f64) -> f64) -> MemoryArtifact {
    let mut run = formed();
    for (p, flat) in run.bodies[2].frames[0].iter_mut().zip(flat()) {
        p[2] = TOP + OFFSET + THICKNESS + height(flat[0], flat[1]);
    }
    run
}

/// 1 on a line of this length (half of it to either side) that ends over 10 mm at both ends, at this place along it and beside it.
fn crest(along: f64, beside: f64, half: f64) -> f64 {
    bump(beside, 0.007) * bump((along.abs() - half).max(0.0), 0.010)
}

#[test]
fn crests_that_meet_in_a_corner_or_a_tee_are_two_wrinkles_and_one_that_bends_is_one() {
    // One along x from (-60, -20) to (0, -20) mm, one from there along y to (0, 30) mm.
    let corner = shaped(|x, y| {
        let first = crest(x + 0.030, y + 0.020, 0.030);
        0.003 * first.max(crest(y - 0.005, x, 0.025))
    });
    let measure = |run_: &MemoryArtifact, parameters: Value| {
        run::<DefectMeasurement>(parameters, &[MemoryInput::new("formed", run_)], &[]).unwrap()
    };
    let out = measure(&corner, json!({}));
    assert_eq!(out.result("uppermost_wrinkle_count"), 2.0);
    let list = out.attributes["defects"].as_array().unwrap();
    let told: Vec<[f64; 2]> = list
        .iter()
        .filter(|d| d["type"] == "wrinkle")
        .map(|d| ["length", "direction"].map(|k| d[k].as_f64().unwrap()))
        .collect();
    // Each goes on past its straight part to where it stands off by less than 1 mm, 6.1 mm further out: 10 mm / pi * acos(-1/3).
    let past = 0.010 / PI * (-1f64 / 3.0).acos();
    for (found, (length, direction)) in told.iter().zip([(0.060, 0.0), (0.050, PI / 2.0)]) {
        assert!((found[0] - (length + past)).abs() < 0.003, "{told:?}");
        assert!((found[1].abs() - direction).abs() < 0.1, "{told:?}");
    }
    let whole: f64 = told.iter().map(|t| t[0]).sum();
    assert!((out.result("uppermost_wrinkle_length") - whole).abs() < 1e-12);
    // The longer one alone.
    let main = measure(&corner, json!({"minimum_wrinkle_length": 0.060}));
    assert_eq!(main.result("uppermost_wrinkle_count"), 1.0);
    assert_eq!(main.result("uppermost_wrinkle_length"), told[0][0]);

    // From the middle of a crest of 100 mm, 30 mm long: a tee.
    let tee = shaped(|x, y| {
        let first = crest(x, y + 0.020, 0.050);
        0.003 * first.max(crest(y + 0.005, x, 0.015))
    });
    let out = measure(&tee, json!({}));
    assert_eq!(out.result("uppermost_wrinkle_count"), 2.0);
    let longest = out.result("uppermost_wrinkle_length_max");
    assert!((longest - (0.100 + 2.0 * past)).abs() < 0.003, "{longest}");
    // It begins at the crest that it leaves.
    let branch = out.result("uppermost_wrinkle_length") - longest;
    assert!((branch - (0.030 + past)).abs() < 0.006, "{branch}");
    let direction = out.attributes["defects"][1]["direction"].as_f64().unwrap();
    assert!((direction.abs() - PI / 2.0).abs() < 0.1, "{direction}");

    // A quarter of a circle of 40 mm.
    let arc = shaped(|x, y| {
        let (x, y) = (x + 0.020, y + 0.020);
        let along = 0.040 * (y.atan2(x) - PI / 4.0);
        0.003 * crest(along, x.hypot(y) - 0.040, 0.040 * PI / 4.0)
    });
    let out = measure(&arc, json!({}));
    assert_eq!(out.result("uppermost_wrinkle_count"), 1.0);
    let length = out.result("uppermost_wrinkle_length");
    assert!(
        (length - (0.040 * PI / 2.0 + 2.0 * past)).abs() < 0.004,
        "{length}"
    );
}
