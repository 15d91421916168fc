//! Fabrics of every kind of law, and the reference curves that they are made from.
#![allow(dead_code)]

use crate::common::*;
use serde_json::{Value, json};

pub const FORMS: [&str; 2] = ["fibre-energy", "hypoelastic"];

pub const NCF_YARN: [f64; 6] = [0.0, 112.19, 94.73, 137.06, -65.56, 29.56];
pub const WOVEN: [f64; 8] = [
    0.0, 37.35, -322.61, 1458.51, -3539.56, 4727.84, -3275.20, 930.53,
];

pub fn polynomial(c: &[f64], g: f64) -> f64 {
    c.iter().rev().fold(0.0, |y, a| y * g.abs() + a).copysign(g)
}

/// Stitch of the NCF (thesis table 3.1).
pub fn ncf_stitch(g: f64) -> f64 {
    match g {
        g if (0.06..0.5).contains(&g) => 2000.0 * g - 120.0,
        g if (0.5..0.75).contains(&g) => -3520.0 * g + 2640.0,
        _ => 0.0,
    }
}

pub fn ncf_curve(g: f64) -> f64 {
    polynomial(&NCF_YARN, g) + ncf_stitch(g)
}

pub fn woven_curve(g: f64) -> f64 {
    polynomial(&WOVEN, g)
}

/// The polynomial at `n` even angles from 0 to 60 deg, as a table.
pub fn sampled(c: &[f64], n: usize) -> Value {
    let angles: Vec<f64> = (0..n)
        .map(|i| 60f64.to_radians() * i as f64 / (n - 1) as f64)
        .collect();
    let forces: Vec<f64> = angles.iter().map(|g| polynomial(c, *g)).collect();
    json!({"table": {"angles": angles, "forces": forces}})
}

pub fn stitch(direction: &str) -> Value {
    json!({"direction": direction, "angles": [0.06, 0.5, 0.75], "forces": [0.0, 880.0, 0.0]})
}

/// A ply of these laws without bending.
pub fn sheet(form: &str, shear: &Value, stitch: Option<Value>) -> Value {
    let mut v = json!({"form": form, "fibre_modulus": 3e9, "shear": shear,
                       "thickness": 4e-4, "areal_mass": 0.44});
    if let Some(s) = stitch {
        v["stitch"] = s;
    }
    v
}

/// A law of its own for each sign: a table for g > 0, a polynomial for g < 0.
pub fn asymmetric() -> Value {
    let mut v = sampled(&NCF_YARN, 25);
    v["negative"] = json!({"coefficients": WOVEN});
    v
}

/// A polynomial for g > 0, a table for g < 0 that ends earlier.
pub fn asymmetric_other() -> Value {
    json!({"coefficients": NCF_YARN,
           "negative": {"table": {"angles": [0.0, 0.2, 0.4, 0.7], "forces": [0.0, 10.0, 15.0, 90.0]}}})
}

/// Every kind of shear law, by name.
pub fn every_shear_law() -> Vec<(&'static str, Value, Option<Value>)> {
    let soft = json!({"table": {"angles": [0.0, 0.1, 0.3, 0.5, 0.9], "forces": [0.0, 40.0, 20.0, 25.0, 200.0]},
                      "allow_softening": true});
    vec![
        ("polynomial", json!({"coefficients": NCF_YARN}), None),
        (
            "polynomial, stitch",
            json!({"coefficients": NCF_YARN}),
            Some(stitch("positive")),
        ),
        (
            "polynomial, negative stitch",
            json!({"coefficients": NCF_YARN}),
            Some(stitch("negative")),
        ),
        ("table", sampled(&WOVEN, 25), None),
        (
            "table, stitch",
            sampled(&NCF_YARN, 25),
            Some(stitch("positive")),
        ),
        (
            "two points",
            json!({"table": {"angles": [0.0, 1.0], "forces": [0.0, 100.0]}}),
            None,
        ),
        ("asymmetric", asymmetric(), None),
        (
            "asymmetric, stitch",
            asymmetric_other(),
            Some(stitch("positive")),
        ),
        (
            "asymmetric, negative stitch",
            asymmetric(),
            Some(stitch("negative")),
        ),
        ("softening table", soft, None),
    ]
}

pub fn build(v: &Value) -> Mat {
    fabric(&v.to_string()).unwrap_or_else(|e| panic!("{e}"))
}

pub fn metric(l1: f64, l2: f64, g: f64) -> [f64; 3] {
    [l1 * l1, l2 * l2, l1 * l2 * g.sin()]
}

/// Picture frame: root-mean-square difference of F = S12 l1 l2 and the curve over that of the curve.
pub fn frame_error(m: &Mat, curve: impl Fn(f64) -> f64, to: f64, steps: usize) -> f64 {
    let mut p = Point::new(m);
    let (mut d, mut f) = (0.0, 0.0);
    for i in 1..=steps {
        let g = to * i as f64 / steps as f64;
        let s = p.at(m, metric(1.0, 1.0, g)).stress[2];
        d += (s - curve(g)).powi(2);
        f += curve(g).powi(2);
    }
    (d / f).sqrt()
}
