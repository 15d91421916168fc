//! What an artifact holds, as told by the attribute `contents` of `/plyflow`: everything that a reader
//! needs before it touches an array.

use crate::h5::DType;
use serde::{Deserialize, Serialize};

/// Version of the data model (`schemas/data-model.md`) that this crate reads and writes.
pub const DATA_MODEL: i64 = 1;

/// Where the values of a field sit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum On {
    /// One row per point.
    Points,
    /// One row per cell.
    Cells,
}

/// A field of a body; it has values in every frame.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FieldInfo {
    /// Name.
    pub name: String,
    /// On points or cells.
    pub on: On,
    /// Values per point or cell.
    pub components: u32,
    /// SI unit.
    pub unit: String,
}

impl FieldInfo {
    /// Of these.
    pub fn new(on: On, name: &str, components: u32, unit: &str) -> Self {
        Self {
            name: name.to_owned(),
            on,
            components,
            unit: unit.to_owned(),
        }
    }
}

/// A body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BodyInfo {
    /// Name.
    pub name: String,
    /// Number of points.
    pub points: u64,
    /// Number of cells.
    pub cells: u64,
    /// 3 (triangles) or 4 (quads).
    pub nodes_per_cell: u32,
    /// Whether each frame has points of its own; else the reference holds in all frames.
    pub moving: bool,
    /// What the writing plugin said of the body: a JSON object.
    pub attributes: serde_json::Value,
    /// Fields in the order of the first frame.
    pub fields: Vec<FieldInfo>,
}

/// A free array under `/data`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ArrayInfo {
    /// Path below `/data`, e.g. `history/time`.
    pub path: String,
    /// Type of an element.
    pub dtype: DType,
    /// Shape, row-major.
    pub shape: Vec<u64>,
    /// SI unit.
    pub unit: String,
}

/// A named number.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NamedValue {
    /// Name.
    pub name: String,
    /// Value (SI).
    pub value: f64,
    /// Unit.
    pub unit: String,
}

/// Bodies and arrays of an artifact.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Contents {
    /// Bodies in the order of definition.
    pub bodies: Vec<BodyInfo>,
    /// Number of frames.
    pub frames: u64,
    /// Arrays in the order of writing.
    pub arrays: Vec<ArrayInfo>,
}

impl Contents {
    /// What a file of so many bytes cannot hold of this: readers make buffers by these numbers.
    pub(crate) fn beyond(&self, length: u64) -> Option<String> {
        let fits = |counts: &[u64], bytes: u64| {
            let size = counts.iter().try_fold(bytes, |n, c| n.checked_mul(*c));
            size.is_some_and(|n| n <= length)
        };
        if !fits(&[self.frames], 8) {
            return Some(format!("it has {} frames", self.frames));
        }
        let frames = self.frames.max(1);
        for b in &self.bodies {
            // Points are doubles, indices 64-bit, fields single precision.
            let rows = if b.moving { frames } else { 1 };
            if !fits(&[b.points, rows], 24) || !fits(&[b.cells, b.nodes_per_cell.into()], 8) {
                let (name, points, cells) = (&b.name, b.points, b.cells);
                return Some(format!(
                    "body '{name}' has {points} points and {cells} cells"
                ));
            }
            for f in &b.fields {
                let rows = if f.on == On::Points {
                    b.points
                } else {
                    b.cells
                };
                if !fits(&[rows, f.components.into(), frames], 4) {
                    let (name, c) = (&f.name, f.components);
                    return Some(format!("field '{name}' has {c} components"));
                }
            }
        }
        let array = |a: &&ArrayInfo| !fits(&a.shape, a.dtype.size() as u64);
        let array = self.arrays.iter().find(array)?;
        Some(format!(
            "the array '{}' has the shape {:?}",
            array.path, array.shape
        ))
    }
}

impl Contents {
    /// The body of that name.
    #[must_use]
    pub fn body(&self, name: &str) -> Option<&BodyInfo> {
        self.bodies.iter().find(|b| b.name == name)
    }

    /// The array at that path.
    #[must_use]
    pub fn array(&self, path: &str) -> Option<&ArrayInfo> {
        self.arrays.iter().find(|a| a.path == path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_file_cannot_hold_is_told_of_arrays_too() {
        let with = |shape: &[u64]| Contents {
            arrays: vec![ArrayInfo {
                path: "a".into(),
                dtype: DType::F64,
                shape: shape.to_vec(),
                unit: "1".into(),
            }],
            ..Contents::default()
        };
        for shape in [&[][..], &[125], &[5, 25], &[0, 3]] {
            assert_eq!(with(shape).beyond(1000), None, "{shape:?}");
        }
        for shape in [&[126][..], &[u64::MAX, 2], &[1 << 40]] {
            let told = with(shape).beyond(1000).unwrap();
            assert!(told.contains("the array 'a' has the shape"), "{told}");
        }
    }
}
