//! The step on a surface whose wrinkles are known.

use plyflow_sdk::On;
use plyflow_surface::memory_host::{MemoryArtifact, MemoryBody, MemoryField, MemoryInput, run};
use plyflow_surface::vector::Vec3;
use plyflow_wrinkle_census::WrinkleCensus;
use serde_json::{Value, json};

/// A square of 300 mm in cells of 3 mm; `z` (m) by radius and angle; shear positive where x y > 0.
fn formed(z: impl Fn(f64, f64) -> f64) -> MemoryArtifact {
    const N: usize = 100;
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
        attributes: json!({"sheets": [{"name": "ply_1", "kind": "ply"}]}),
        times: vec![1.0],
        bodies: vec![ply],
        ..Default::default()
    }
}

fn census(input: &MemoryArtifact, with: Value) -> Result<MemoryArtifact, String> {
    run::<WrinkleCensus>(with, &[MemoryInput::new("formed", input)], &[])
        .map_err(|e| format!("{e:?}"))
}

fn parameters(circles: Value) -> Value {
    json!({"centre": [0.0, 0.0], "circles": circles, "inner_circles": [0.02, 0.04],
           "sections": [0.0, std::f64::consts::FRAC_PI_4], "threshold": 1e-3, "samples": 720})
}

#[test]
fn wrinkles_on_the_diagonals_are_counted_by_quadrant_and_shear() {
    // Outside of a dome of 50 mm: four wrinkles on the diagonals, those at negative shear twice as wide.
    let input = formed(|r, a| {
        let dome = (0.05f64.powi(2) - r * r).max(0.0).sqrt();
        let wave = |top: f64, wide: f64| {
            let d = (a - top).sin().atan2((a - top).cos());
            3e-3 * (-(4.0 * 2f64.ln()) * (d / wide).powi(2)).exp()
        };
        let on = [(0.25, 0.15), (0.75, 0.3), (-0.75, 0.15), (-0.25, 0.3)];
        let waves: f64 = on
            .map(|(q, w)| wave(q * std::f64::consts::PI, w))
            .iter()
            .sum();
        dome + waves * ((r - 0.05) / 0.01).clamp(0.0, 1.0)
    });
    let found = census(&input, parameters(json!([0.09, 0.07]))).unwrap();
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
    assert!((of("width_positive_shear") - 0.15 * 0.09).abs() < 1.5e-3);
    assert!((of("width_negative_shear") - 0.3 * 0.09).abs() < 1.5e-3);
    // Cells of 3 mm on a sphere of 50 mm.
    assert!(of("inner_deviation") < 3e-4, "{}", of("inner_deviation"));
    let circles = found.attributes["circles"].as_array().unwrap();
    assert_eq!(circles[1]["wrinkles"].as_array().unwrap().len(), 4);
    let (_, height) = &found.arrays["curves/section_0/height"];
    let top = height.iter().copied().fold(0.0, f64::max);
    assert!((top - 0.05).abs() < 1e-4);
    assert_eq!(found.attributes["plots"].as_array().unwrap().len(), 2);
}

#[test]
fn a_level_ply_has_none_and_a_circle_beside_it_is_told() {
    let level = formed(|_, _| 0.01);
    let found = census(&level, parameters(json!([0.09]))).unwrap();
    assert_eq!(found.result("wrinkles"), 0.0);
    // Rounding of the interpolation.
    assert!(found.result("inner_deviation") < 1e-15);
    let told = census(&level, parameters(json!([0.5]))).unwrap_err();
    assert!(told.contains("500.0 mm lies all beside the ply"), "{told}");
    let mut other = parameters(json!([0.09]));
    other["ply"] = json!("ply_7");
    let told = census(&level, other).unwrap_err();
    assert!(told.contains("'ply_7'") && told.contains("ply_1"), "{told}");
}
