//! The step on surfaces whose wrinkles, deviations and moments are known.

use plyflow_geometry::vec3::Vec3;
use plyflow_sdk::On;
use plyflow_testing::{MemoryArtifact, MemoryBody, MemoryField, MemoryInput, run};
use plyflow_wrinkle_census::WrinkleCensus;
use serde_json::{Value, json};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// Cells along a side.
const N: usize = 100;

/// A square of 300 mm in cells of 3 mm; `z` (m) by radius and angle; shear positive where x y > 0.
fn formed(z: impl Fn(f64, f64) -> f64) -> MemoryArtifact {
    let at = |i: usize| 0.3 * (i as f64 / N as f64 - 0.5);
    let points: Vec<Vec3> = (0..(N + 1) * (N + 1))
        .map(|k| [at(k % (N + 1)), at(k / (N + 1)), 0.0])
        .collect();
    let node = |i: usize, j: usize| (j * (N + 1) + i) as u32;
    let cells: Vec<u32> = (0..N * N)
        .flat_map(|k| {
            let (i, j) = (k % N, k / N);
            [
                node(i, j),
                node(i + 1, j),
                node(i + 1, j + 1),
                node(i, j + 1),
            ]
        })
        .collect();
    let lifted: Vec<Vec3> = (points.iter())
        .map(|p| [p[0], p[1], z(p[0].hypot(p[1]), p[1].atan2(p[0]))])
        .collect();
    let shear = |k: usize| (2 * (k % N) >= N) == (2 * (k / N) >= N);
    let field = MemoryField {
        name: "shear_angle".into(),
        on: On::Cells,
        components: 1,
        values: (0..N * N)
            .map(|k| if shear(k) { 0.5 } else { -0.5 })
            .collect(),
    };
    let ply = MemoryBody {
        name: "ply_1".into(),
        nodes_per_cell: 4,
        cells,
        frames: vec![lifted],
        points,
        fields: vec![vec![field]],
        ..Default::default()
    };
    MemoryArtifact {
        kind: "forming".into(),
        attributes: json!({"sheets": [{"name": "ply_1", "kind": "ply", "thickness": 4e-4, "offset": 2e-4}]}),
        times: vec![1.0],
        bodies: vec![ply],
        ..Default::default()
    }
}

/// A level square plate of 1 m at that height (m).
fn plate(name: &str, z: f64) -> MemoryBody {
    MemoryBody {
        name: name.into(),
        points: vec![
            [-0.5, -0.5, z],
            [0.5, -0.5, z],
            [0.5, 0.5, z],
            [-0.5, 0.5, z],
        ],
        nodes_per_cell: 4,
        cells: vec![0, 1, 2, 3],
        ..Default::default()
    }
}

/// Gives the ply moments along its families (N) on its points or cells.
fn bent(mut input: MemoryArtifact, on: On, moments: impl Fn(usize) -> [f64; 2]) -> MemoryArtifact {
    let rows = if on == On::Cells {
        N * N
    } else {
        (N + 1) * (N + 1)
    };
    for (family, name) in ["bending_moment_1", "bending_moment_2"]
        .into_iter()
        .enumerate()
    {
        input.bodies[0].fields[0].push(MemoryField {
            name: name.into(),
            on,
            components: 1,
            values: (0..rows).map(|k| moments(k)[family]).collect(),
        });
    }
    input
}

fn census(input: &MemoryArtifact, with: Value) -> Result<MemoryArtifact, String> {
    run::<WrinkleCensus>(with, &[MemoryInput::new("formed", input)], &[])
        .map_err(|e| format!("{e:?}"))
}

fn parameters(circles: Value) -> Value {
    json!({"centre": [0.0, 0.0], "circles": circles, "inner_circles": [0.02, 0.04],
           "sections": [0.0, FRAC_PI_4], "threshold": 1e-3, "samples": 720})
}

/// Outside of a dome of 50 mm: four wrinkles 3 mm high on the diagonals, those at negative shear twice as wide; they
/// start at 50 mm and are whole from 60 mm on.
fn four_wrinkles() -> MemoryArtifact {
    formed(|r, a| {
        let dome = (0.05f64.powi(2) - r * r).max(0.0).sqrt();
        let wave = |top: f64, wide: f64| {
            let d = (a - top).sin().atan2((a - top).cos());
            3e-3 * (-(4.0 * 2f64.ln()) * (d / wide).powi(2)).exp()
        };
        let on = [(0.25, 0.15), (0.75, 0.3), (-0.75, 0.15), (-0.25, 0.3)];
        let waves: f64 = on.map(|(q, w)| wave(q * PI, w)).iter().sum();
        dome + waves * ((r - 0.05) / 0.01).clamp(0.0, 1.0)
    })
}

#[test]
fn wrinkles_on_the_diagonals_are_counted_by_quadrant_and_shear() {
    let found = census(&four_wrinkles(), parameters(json!([0.09, 0.07]))).unwrap();
    let of = |name: &str| found.result(name);
    assert_eq!(of("wrinkles"), 4.0);
    for q in 1..=4 {
        assert_eq!(of(&format!("wrinkles_q{q}")), 1.0);
    }
    assert_eq!(
        [of("wrinkles_positive_shear"), of("wrinkles_negative_shear")],
        [2.0, 2.0]
    );
    assert!((of("height_largest") - 3e-3).abs() < 1e-4);
    assert!((of("height_mean") - 3e-3).abs() < 1e-4);
    assert!((of("width_positive_shear") - 0.15 * 0.09).abs() < 1.5e-3);
    assert!((of("width_negative_shear") - 0.3 * 0.09).abs() < 1.5e-3);
    // 1 mm of height is reached at 53.3 mm. Outwards the corner of the ply, at 212 mm, leaves less and less of a circle: the
    // wrinkle stands 1 mm over its ends up to 201 mm where it is narrow, to 192 mm where it is wide.
    let long = of("length_positive_shear");
    assert!((long - 0.1477).abs() < 4e-3, "{long}");
    let long = of("length_negative_shear");
    assert!((long - 0.1387).abs() < 4e-3, "{long}");
    // Twice as wide, and as long as they are above.
    assert!((of("negative_over_positive_width") - 2.0).abs() < 0.15);
    let longer = of("negative_over_positive_length");
    assert!((longer - 0.1387 / 0.1477).abs() < 0.04, "{longer}");
    // Cells of 3 mm on a sphere of 50 mm.
    assert!(of("inner_deviation") < 3e-4, "{}", of("inner_deviation"));
    let circles = found.attributes["circles"].as_array().unwrap();
    assert_eq!(circles[1]["wrinkles"].as_array().unwrap().len(), 4);
    let (_, height) = &found.arrays["curves/section_0/height"];
    let top = height.iter().copied().fold(0.0, f64::max);
    assert!((top - 0.05).abs() < 1e-4);
    assert_eq!(found.attributes["plots"].as_array().unwrap().len(), 2);
    // Neither tool nor moments: nothing is made up.
    assert!(!found.results.keys().any(|k| k.starts_with("deviation")));
    assert!(
        !found
            .results
            .keys()
            .any(|k| k.starts_with("bending_moment"))
    );
}

#[test]
fn a_wrinkle_that_lies_over_is_seen_from_its_own_side_alone() {
    let mut input = formed(|_, _| 0.0);
    // Across y: down 3 mm, 18 mm under the sheet to its right, up 1.5 mm, back, and up again. All corners are nodes.
    let way = |s: f64| -> [f64; 2] {
        let s = s - 9e-3;
        let corners = [
            [0.0, 0.0, 0.0],
            [3e-3, 0.0, -3e-3],
            [21e-3, 18e-3, -3e-3],
            [24e-3, 18e-3, -1.5e-3],
            [42e-3, 0.0, -1.5e-3],
            [45e-3, 0.0, 0.0],
        ];
        if s <= 0.0 || s >= 45e-3 {
            return [s.min(0.0) + (s - 45e-3).max(0.0), 0.0];
        }
        let k = corners.iter().take_while(|c| c[0] <= s).count() - 1;
        let (a, b) = (corners[k], corners[k + 1]);
        let part = (s - a[0]) / (b[0] - a[0]);
        [1, 2].map(|c| a[c] + part * (b[c] - a[c]))
    };
    for p in &mut input.bodies[0].frames[0] {
        let [y, z] = way(p[1] + 18e-3);
        *p = [p[0], y - 9e-3, z];
    }
    let from = |side: &str| {
        let mut with = parameters(json!([0.08]));
        with["side"] = json!(side);
        census(&input, with).unwrap()
    };
    assert_eq!(from("up").result("wrinkles"), 0.0);
    let below = from("down");
    assert_eq!(below.result("wrinkles"), 2.0);
    assert!((below.result("height_largest") - 3e-3).abs() < 1e-6);
    assert!((below.result("width_positive_shear") - 18e-3).abs() < 1e-3);
}

#[test]
fn a_section_across_shows_the_wrinkle_that_it_cuts() {
    let mut with = parameters(json!([0.09]));
    with["cross_sections"] = json!([{"label": "A-A'", "angle": FRAC_PI_4, "offset": 0.09}, {"label": "B-B'", "angle": FRAC_PI_2, "offset": 0.09}]);
    let found = census(&four_wrinkles(), with.clone()).unwrap();
    let at = |k: usize, what: &str| {
        found.arrays[&format!("curves/cross_section_{k}/{what}")]
            .1
            .clone()
    };
    let (along, height) = (at(0, "distance"), at(0, "height"));
    let peak = |of: &[f64]| of.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let top = (0..height.len())
        .max_by(|a, b| height[*a].total_cmp(&height[*b]))
        .unwrap();
    // The wrinkle's top lies in the middle of the section.
    assert!(along[top].abs() < 5e-4 && (height[top] - 3e-3).abs() < 1e-4);
    // B-B' stands between two wrinkles: its middle is level.
    let (along, height) = (at(1, "distance"), at(1, "height"));
    let near: Vec<f64> = along
        .iter()
        .zip(&height)
        .filter(|(d, _)| d.abs() < 0.02)
        .map(|(_, h)| *h)
        .collect();
    assert!(peak(&near) < 3e-5, "{}", peak(&near));
    // A-A' counts it, with its height and place; what ends at the end of B-B' is no top there.
    let section = |what: &str, name: &str| found.result(&format!("section_{what}.{name}"));
    assert_eq!(
        (section("wrinkles", "a_a"), section("wrinkles", "b_b")),
        (1.0, 0.0)
    );
    assert!((section("height", "a_a") - 3e-3).abs() < 1e-4);
    let listed = &found.attributes["cross_sections"][0]["wrinkles"][0];
    assert!(listed["place"].as_f64().unwrap().abs() < 5e-4, "{listed}");
    assert!((listed["height"].as_f64().unwrap() - 3e-3).abs() < 1e-4);
    assert!(found.attributes["plots"].to_string().contains("A-A'"));
    // Names of results are made of letters and digits.
    for label in ["b b", "\u{3b1}-\u{3b1}'"] {
        let mut alike = with.clone();
        alike["cross_sections"][0]["label"] = json!(label);
        let told = census(&four_wrinkles(), alike).unwrap_err();
        assert!(told.contains("].label: given"), "{told}");
    }
    with["cross_sections"][0]["offset"] = json!(0.4);
    let told = census(&four_wrinkles(), with).unwrap_err();
    assert!(told.contains("A-A'") && told.contains("400.0 mm"), "{told}");
}

#[test]
fn deviation_is_the_distance_from_the_nearest_surface_less_that_at_rest() {
    // The die above the ply at 10 mm: at rest its mid-surface is 0.2 mm below. Three quarters of the ply lie there, a
    // quarter hangs 4 mm lower, but for a tenth of that which lies on the punch at 2 mm.
    let mut input = formed(|_, _| 0.0);
    let places = input.bodies[0].frames[0].clone();
    for p in places.iter().zip(&mut input.bodies[0].frames[0]) {
        let (from, to) = p;
        to[2] = if from[0] < 0.075 - 1e-9 {
            9.8e-3
        } else {
            5.8e-3
        };
        if from[0] > 0.075 + 1e-9 && from[1] < -0.12 - 1e-9 {
            to[2] = 2.2e-3;
        }
    }
    input.bodies.push(plate("die", 10e-3));
    input.bodies.push(plate("tool", 2e-3));
    input.bodies.push(plate("holder", 3e-3));
    let mut with = parameters(json!([0.09]));
    with["inner_circles"] = json!([]);
    with["dome_radius"] = json!(0.05);
    let found = census(&input, with.clone()).unwrap();
    let of = |name: &str| found.result(name);
    // Hangs 4 mm under the die, 3.8 mm - 0.2 mm over the punch: the nearest counts, 3.6 mm.
    assert!(
        (of("deviation_largest") - 3.6e-3).abs() < 1e-12,
        "{}",
        of("deviation_largest")
    );
    assert!(of("deviation_q50") < 1e-15 && of("dome_deviation_largest") < 1e-15);
    assert!((of("deviation_q90") - 3.6e-3).abs() < 1e-12);
    // 75 of 300 mm, half a cell more at the nodes of the step; less its tenth of 30 mm.
    let expected = 3.6e-3 * (76.5 * 300.0 - 73.5 * 28.5) / 9e4;
    assert!(
        (of("deviation_mean") - expected).abs() < 1e-3 * expected,
        "{} {expected}",
        of("deviation_mean")
    );
    // The body carries it, and the map names it.
    assert_eq!(
        found.body("ply_1").last("deviation").len(),
        (N + 1) * (N + 1)
    );
    assert_eq!(
        found.attributes["maps"][0]["panels"][0]["field"],
        "deviation"
    );
    // The density integrates to the whole.
    let value = &found.arrays["curves/deviation/value"].1;
    let sum: f64 = found.arrays["curves/deviation/density"].1.iter().sum();
    assert!((sum * (value[1] - value[0]) - 1.0).abs() < 1e-9, "{sum}");
    // With the die alone, 4 mm and 7.6 mm.
    with["surfaces"] = json!(["die"]);
    let found = census(&input, with.clone()).unwrap();
    assert!((found.result("deviation_largest") - 7.6e-3).abs() < 1e-12);
    for (surfaces, told) in [(json!(["dei"]), "'dei'"), (json!([]), "given none")] {
        with["surfaces"] = surfaces;
        let error = census(&input, with.clone()).unwrap_err();
        assert!(
            error.contains("surfaces: ") && error.contains(told),
            "{error}"
        );
    }
}

/// Three plies of 0.4 mm, all on what is there, under a die: the lowest ends at x = 0, the uppermost at x = 60 mm.
#[test]
fn plies_that_end_below_and_above_do_not_count_where_they_do_not_lie() {
    let stacked = |ends: [f64; 2], by_place: bool| {
        let mut input = formed(|_, _| 0.0);
        let t = 4e-4;
        let outline = |end: f64| json!([[-0.15, -0.15], [end, -0.15], [end, 0.15], [-0.15, 0.15]]);
        let sheet = |name: &str, place: f64, end: f64| {
            json!({"name": name, "kind": "ply", "thickness": t, "offset": (place + 0.5) * t,
                   "outline": outline(end)})
        };
        input.attributes = json!({"contact_by_place": by_place, "sheets": [
            sheet("below", 0.0, ends[0]), sheet("ply_1", 1.0, 0.15), sheet("above", 2.0, ends[1])]});
        let flat = input.bodies[0].points.clone();
        for (p, at) in input.bodies[0].frames[0].iter_mut().zip(&flat) {
            p[2] = if at[0] < ends[0] + 1e-9 {
                1.5 * t
            } else {
                0.5 * t
            };
        }
        input.bodies.push(plate("tool", 0.0));
        input
    };
    let mut with = parameters(json!([0.09]));
    (with["inner_circles"], with["ply"]) = (json!([]), json!("ply_1"));
    let deviation = |input: &MemoryArtifact| {
        let found = census(input, with.clone()).unwrap();
        found.body("ply_1").last("deviation").to_vec()
    };
    let ending = stacked([0.0, 0.06], true);
    let largest = deviation(&ending).into_iter().fold(0.0, f64::max);
    assert!(largest < 1e-15, "{largest}");
    // Half of it 1 mm up, on the lower ply or beside it.
    let mut lifted = ending.clone();
    for p in &mut lifted.bodies[0].frames[0] {
        p[2] += if p[1] > 0.0 { 1e-3 } else { 0.0 };
    }
    for (d, p) in deviation(&lifted).iter().zip(&lifted.bodies[0].frames[0]) {
        let expected = if p[1] > 0.0 { 1e-3 } else { 0.0 };
        assert!((d - expected).abs() < 1e-12, "{p:?}: {d}");
    }
    // Hard under a die that follows the stack's upper face 5 mm up.
    let mut pressed = ending.clone();
    pressed.bodies.truncate(1);
    let flat = pressed.bodies[0].points.clone();
    let up = |x: f64| {
        if x < 0.06 + 1e-9 {
            1.5 * 4e-4
        } else {
            0.5 * 4e-4
        }
    };
    for (p, at) in pressed.bodies[0].frames[0].iter_mut().zip(&flat) {
        p[2] = 5e-3 - up(at[0]);
    }
    pressed.bodies.push(plate("die", 5e-3));
    let largest = deviation(&pressed).into_iter().fold(0.0, f64::max);
    assert!(largest < 1e-15, "{largest}");
    // Plies of one outline: as if the run did not say where they lie.
    let [by_place, whole] = [true, false].map(|by| deviation(&stacked([0.15, 0.15], by)));
    assert!(
        by_place
            .iter()
            .zip(&whole)
            .all(|(a, b)| a.to_bits() == b.to_bits())
    );
}

#[test]
fn curves_are_told_apart_by_their_labels() {
    let mut with = parameters(json!([0.0804, 0.0796, 0.08, 0.1]));
    with["sections"] = json!([
        0.0,
        FRAC_PI_4,
        30.0002f64.to_radians(),
        44.6f64.to_radians()
    ]);
    let found = census(&four_wrinkles(), with).unwrap();
    let labels = |plot: &str| -> Vec<&str> {
        let curves = found.attributes["curves"].as_array().unwrap();
        let own = curves.iter().filter(|c| c["plot"] == plot);
        own.map(|c| c["label"].as_str().unwrap()).collect()
    };
    let circles = [
        "radius 80.4 mm",
        "radius 79.6 mm",
        "radius 80 mm",
        "radius 100 mm",
    ];
    assert_eq!(labels("circles"), circles);
    let sections = [
        "section at 0 deg",
        "section at 45 deg",
        "section at 30 deg",
        "section at 44.6 deg",
    ];
    assert_eq!(labels("sections"), sections);
}

#[test]
fn moments_of_both_families_are_spread_by_area() {
    // On cells: 3 and 4 N in a fifth of the ply, 1 and 1 N in the rest.
    let level = || formed(|_, _| 0.0);
    let cells = bent(level(), On::Cells, |k| {
        if k % N < N / 5 {
            [3.0, -4.0]
        } else {
            [1.0, -1.0]
        }
    });
    let mut with = parameters(json!([0.09]));
    with["inner_circles"] = json!([]);
    let found = census(&cells, with.clone()).unwrap();
    let of = |name: &str| found.result(name);
    let high = 12.5f64.sqrt();
    assert_eq!(
        [of("bending_moment_q50"), of("bending_moment_largest")],
        [1.0, high]
    );
    assert_eq!(of("bending_moment_q90"), high);
    assert!((of("bending_moment_mean") - (0.8 + 0.2 * high)).abs() < 1e-9);
    assert_eq!(found.results["bending_moment_mean"].1, "N");
    // On points: a node on the edge has no moment and counts for nothing.
    let inside = |k: usize| (1..N).contains(&(k % (N + 1))) && (1..N).contains(&(k / (N + 1)));
    let points = bent(level(), On::Points, |k| {
        if inside(k) { [2.0, 2.0] } else { [0.0, 0.0] }
    });
    let found = census(&points, with.clone()).unwrap();
    let of = |name: &str| found.result(name);
    assert!((of("bending_moment_mean") - 2.0).abs() < 1e-12);
    let value = &found.arrays["curves/bending_moment/value"].1;
    let density = &found.arrays["curves/bending_moment/density"].1;
    assert!((density.iter().sum::<f64>() * (value[1] - value[0]) - 1.0).abs() < 1e-9);
    // One family on points and one on cells cannot be put together.
    let mut mixed = bent(level(), On::Cells, |_| [1.0, 1.0]);
    mixed.bodies[0].fields[0][2].on = On::Points;
    mixed.bodies[0].fields[0][2].values = vec![1.0; (N + 1) * (N + 1)];
    let told = census(&mixed, with).unwrap_err();
    assert!(
        told.contains("bending_moment_2") && told.contains("both on"),
        "{told}"
    );
}

#[test]
fn a_level_ply_has_none_and_a_circle_beside_it_is_told() {
    let level = formed(|_, _| 0.01);
    let found = census(&level, parameters(json!([0.09]))).unwrap();
    assert_eq!(found.result("wrinkles"), 0.0);
    // Rounding of the interpolation.
    assert!(found.result("inner_deviation") < 1e-15);
    assert!(found.log.is_empty(), "{:?}", found.log);
    // The corners of the square reach beyond 150 mm, its sides do not.
    let partly = census(&level, parameters(json!([0.17]))).unwrap().log;
    let told = "of the circle with a radius of 170.0 mm only ";
    assert!(partly.iter().any(|l| l.contains(told)), "{partly:?}");
    let told = census(&level, parameters(json!([0.5]))).unwrap_err();
    assert!(told.contains("500.0 mm lies all beside the ply"), "{told}");
    let mut other = parameters(json!([0.09]));
    other["ply"] = json!("ply_7");
    let told = census(&level, other).unwrap_err();
    assert!(told.contains("'ply_7'") && told.contains("ply_1"), "{told}");
}

/// A quarter of the ply hangs on from where a net ended, 4 mm lower.
#[test]
fn what_a_net_does_not_reach_deviates_from_nothing() {
    let mut input = formed(|_, _| 9.8e-3);
    let ply = &mut input.bodies[0];
    for p in &mut ply.frames[0] {
        if p[0] > 0.075 + 1e-9 {
            p[2] = 5.8e-3;
        }
    }
    ply.fields[0].push(MemoryField {
        name: "draped".into(),
        on: On::Cells,
        components: 1,
        values: (0..N * N)
            .map(|k| f64::from(u8::from(k % N < 75)))
            .collect(),
    });
    input.bodies.push(plate("die", 10e-3));
    let mut with = parameters(json!([0.07]));
    with["inner_circles"] = json!([]);
    let found = census(&input, with).unwrap();
    assert!(found.result("deviation_largest") < 1e-15);
    assert_eq!(found.body("ply_1").last("deviation").len(), 76 * (N + 1));
    let text = found.log.join("\n");
    assert!(text.contains("draped on 75.0 % of its area"), "{text}");
}
