//! Fields of the plies besides those that are mapped: whatever an artifact has on their points or cells.

use crate::plain::{Other, Ply, at_points};
use crate::read::error::ReadError;
use crate::read::facts::{last_frame, open};
use camino::Utf8Path;
use plyflow_artifact::{Artifact, BodyInfo, On};
use plyflow_model::artifact::ComparedBody;
use serde::Deserialize;

/// Fields that the plies of a report have under names of their own, and places.
const KNOWN: [&str; 5] = [
    "shear_angle",
    "nodal_distance",
    "judged",
    "curvature_max",
    "undeformed",
];
/// Fields of more components are left out.
const COMPONENTS: u32 = 9;
/// Two meshes are one when their points lie within this of each other (m): artifacts hold them in double precision.
const SAME: f64 = 1e-9;

/// All fields of a body that are not known otherwise: scalars as they are, of vectors the components and the magnitude, of others the
/// components. What cannot be read is left out.
pub(crate) fn of_body(
    artifact: &Artifact,
    body: &BodyInfo,
    frame: u64,
    cells: &[[u32; 4]],
) -> Vec<Other> {
    let points = body.points as usize;
    let is_compared = ComparedBody::deserialize(&body.attributes).is_ok();
    let mut all = Vec::new();
    for field in &body.fields {
        let (name, c) = (field.name.as_str(), field.components as usize);
        if KNOWN.contains(&name) || field.components > COMPONENTS || c == 0 {
            continue;
        }
        let Ok(data) = artifact.frame_field(&body.name, frame, field.on, name) else {
            continue;
        };
        let scalars = if name == "defect" && is_compared {
            kinds(&data)
        } else {
            scalars(in_words(name), data, c)
        };
        for (title, values) in scalars {
            let values = match field.on {
                On::Points => values,
                On::Cells => at_points(&values, cells.as_flattened(), 4, points),
            };
            // A legend needs numbers.
            if values.len() == points && values.iter().all(|v| v.is_finite()) {
                let unit = field.unit.clone();
                all.push(Other {
                    title,
                    unit,
                    values,
                });
            }
        }
    }
    all
}

/// Of a comparison, codes of what was found there, each by itself: as numbers on a scale the rim of the one kind would look like the other.
fn kinds(codes: &[f64]) -> Vec<(String, Vec<f64>)> {
    let of = |(code, kind)| {
        let is = |v: &f64| f64::from(u8::from(*v == code));
        let values = codes.iter().map(is).collect();
        (format!("{kind} (1 where one was found)"), values)
    };
    [(1.0, "Wrinkle"), (2.0, "Bridging")].map(of).into()
}

/// A field of `c` components as scalars with their titles.
fn scalars(title: String, data: Vec<f64>, c: usize) -> Vec<(String, Vec<f64>)> {
    if c == 1 {
        return vec![(title, data)];
    }
    let of = |k: usize| {
        let which = match (c, k) {
            (2 | 3, 0) => "x".to_owned(),
            (2 | 3, 1) => "y".to_owned(),
            (3, 2) => "z".to_owned(),
            _ => (k + 1).to_string(),
        };
        let values = data.iter().skip(k).step_by(c).copied().collect();
        (format!("{title}, {which}"), values)
    };
    let mut all: Vec<_> = (0..c).map(of).collect();
    if c <= 3 {
        let size = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        let values = data.chunks_exact(c).map(size).collect();
        all.push((format!("{title}, magnitude"), values));
    }
    all
}

/// Adds the fields that the plies have in the last frame of another artifact, under their own names and on the same meshes.
///
/// # Errors
/// When the artifact cannot be read.
pub(crate) fn add(path: &Utf8Path, plies: &mut [Ply]) -> Result<(), ReadError> {
    // What a run computed comes before what was found in it.
    add_where(path, plies, |_| true, true)
}

/// Adds what a measurement has found on the plies that no other artifact has: how they slip on each other.
///
/// # Errors
/// When the artifact cannot be read.
pub(crate) fn add_slip(path: &Utf8Path, plies: &mut [Ply]) -> Result<(), ReadError> {
    add_where(path, plies, |o| o.title.starts_with("Slip"), false)
}

fn add_where(
    path: &Utf8Path,
    plies: &mut [Ply],
    wanted: impl Fn(&Other) -> bool,
    first: bool,
) -> Result<(), ReadError> {
    let artifact = open(path)?;
    let frame = last_frame(&artifact)?;
    for ply in plies {
        let Ok(body) = artifact.body(&ply.name) else {
            continue;
        };
        if body.points as usize != ply.formed.len() || body.cells as usize != ply.cells.len() {
            continue;
        }
        let places = artifact.frame_points(&body.name, frame)?;
        let near = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).all(|d| (a[d] - b[d]).abs() < SAME);
        if !places.iter().zip(&ply.formed).all(near) {
            continue;
        }
        let mut all = of_body(&artifact, body, frame, &ply.cells);
        let same = |a: &Other, b: &Other| a.title == b.title && a.unit == b.unit;
        all.retain(|o| wanted(o) && !ply.others.iter().any(|known| same(known, o)));
        if first {
            all.append(&mut ply.others);
            ply.others = all;
        } else {
            ply.others.append(&mut all);
        }
    }
    Ok(())
}

/// `fibre_strain_1` as one says it: Fibre strain 1.
fn in_words(name: &str) -> String {
    let text = name.replace('_', " ");
    let mut letters = text.chars();
    match letters.next() {
        Some(first) => first.to_uppercase().chain(letters).collect(),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_said_in_words() {
        assert_eq!(in_words("membrane_force_12"), "Membrane force 12");
    }
}
