//! What a made-up forming run has besides its sheets: further fields, and its history.

use super::shapes::Sheet;
use plyflow_artifact::{ArtifactWriter, DType, FieldInfo, On};

/// Name, unit and values over time of a column of a part.
type OfPart<'a> = (&'a str, &'a str, &'a dyn Fn(f64) -> f64);

/// Fields that no map shows: a scalar on cells, one on points, a vector, and one that is the same everywhere.
pub fn further_fields(w: &mut ArtifactWriter, name: &str, s: &Sheet, last: bool) {
    let n = s.flat.len() / 3;
    let strain: Vec<f64> = s.shear.iter().map(|g| 1e-3 * g.abs()).collect();
    let pressure: Vec<f64> = (0..n).map(|i| 2e5 * (i as f64 / n as f64)).collect();
    let moved = s.flat.iter().zip(&s.formed).map(|(a, b)| b - a);
    let moved: Vec<f64> = moved.map(|d| if last { d } else { 0.0 }).collect();
    for (what, on, components, unit, values) in [
        ("fibre_strain_1", On::Cells, 1, "1", &strain),
        ("contact_pressure", On::Points, 1, "Pa", &pressure),
        ("displacement", On::Points, 3, "m", &moved),
        ("thickness", On::Points, 1, "m", &vec![0.0005; n]),
    ] {
        w.frame_field(name, FieldInfo::new(on, what, components, unit), values)
            .unwrap();
    }
}

/// `parts`: names of the parts of a stamping, each of which closes from 30 mm, and what it presses with at the end (N).
pub fn history(w: &mut ArtifactWriter, press: bool, parts: &[(&str, f64)]) {
    for (name, force) in parts {
        let time = (0..600).map(|i| f64::from(i) / 599.0);
        let columns: [OfPart<'_>; 2] = [
            ("way", "m", &|t| 0.03 * (1.0 - t)),
            ("force", "N", &|t| force * t * t),
        ];
        for (column, unit, f) in columns {
            let data: Vec<u8> = time.clone().flat_map(|t| f(t).to_ne_bytes()).collect();
            let path = format!("history/parts/{name}/{column}");
            w.array(&path, DType::F64, &[600], unit, &data).unwrap();
        }
    }
    let n = 600;
    let time: Vec<f64> = (0..n).map(|i| f64::from(i) / f64::from(n - 1)).collect();
    type Column = (&'static str, &'static str, fn(f64) -> f64);
    let columns: [Column; 12] = [
        ("time", "s", |t| t),
        ("kinetic", "J", |t| {
            0.3 * t * (1.0 - t) + 0.02 * (80.0 * t).sin().abs()
        }),
        ("membrane", "J", |t| 9.0 * t * t),
        ("bending", "J", |t| 0.8 * t),
        ("hourglass", "J", |t| 0.02 * t),
        ("contact", "J", |t| 0.2 * t),
        ("friction", "J", |t| 3.0 * t * t * t),
        ("damping", "J", |t| 0.4 * t),
        ("external", "J", |t| {
            9.0 * t * t + 1.42 * t + 3.0 * t * t * t
        }),
        ("drift", "J", |t| 0.02 * t),
        ("bag_pressure", "Pa", |t| 1e5 * t.min(0.8) / 0.8),
        ("frame_height", "m", |t| 0.12 * (1.0 - t)),
    ];
    let of_press: [Column; 2] = [
        ("punch_force", "N", |t| 180.0 * t * t),
        ("holder_travel", "m", |t| -1e-3 * t),
    ];
    let more = if press { &of_press[..] } else { &[] };
    for (name, unit, f) in columns.into_iter().chain(more.iter().copied()) {
        let data: Vec<u8> = time.iter().flat_map(|t| f(*t).to_ne_bytes()).collect();
        w.array(
            &format!("history/{name}"),
            DType::F64,
            &[u64::try_from(n).unwrap()],
            unit,
            &data,
        )
        .unwrap();
    }
}
