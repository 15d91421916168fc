//! How two artifacts differ: in everything but their provenance, number by number.

use crate::contents::{ArrayInfo, BodyInfo, FieldInfo};
use crate::error::Result;
use crate::reader::Artifact;
use serde::Serialize;
use serde_json::{Map, Value, json};

/// One difference.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// What differs, such as `result shear_max` or `points of ply_1`.
    pub place: String,
    /// How.
    #[serde(flatten)]
    pub how: How,
}

/// How two artifacts differ in one place.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "how", rename_all = "kebab-case")]
pub enum How {
    /// The first alone has it.
    OnlyInFirst,
    /// The second alone has it.
    OnlyInSecond,
    /// It is described otherwise, or has another text.
    Other {
        /// In the first.
        first: Value,
        /// In the second.
        second: Value,
    },
    /// Another number.
    Number {
        /// In the first.
        first: f64,
        /// In the second.
        second: f64,
        /// Unit of both.
        unit: String,
    },
    /// Other numbers in an array of the same shape.
    Numbers {
        /// How many are not the same bits.
        differ: u64,
        /// Of so many.
        of: u64,
        /// The largest difference.
        largest: f64,
        /// Its index, from 0, row-major. For moving points and for fields: frame, point or cell, component.
        at: Vec<u64>,
        /// The largest size of a number in the first, to see how much that is.
        scale: f64,
        /// Unit of all.
        unit: String,
    },
}

/// Everything in which two artifacts differ but their provenance: kind, results, collection, attributes, frames, bodies with their fields, arrays.
/// Nothing when all of it is the same: attributes by value, everything else to the bit.
///
/// # Errors
/// When one of them cannot be read.
pub fn differences(first: &Artifact, second: &Artifact) -> Result<Vec<Difference>> {
    let mut found = Found {
        both: [first, second],
        all: Vec::new(),
    };
    found.other("kind", &first.kind(), &second.kind());
    found.results();
    found.other("collection", &first.collection(), &second.collection());
    found.attributes();
    found.numbers_of("times of frames", "s", &[first.times(), second.times()]);
    found.bodies()?;
    found.arrays()?;
    Ok(found.all)
}

struct Found<'a> {
    both: [&'a Artifact; 2],
    all: Vec<Difference>,
}

/// Names of two lists, those of the first before what only the second has.
fn names<'n>(lists: [impl Iterator<Item = &'n str>; 2]) -> Vec<&'n str> {
    let mut all: Vec<&str> = Vec::new();
    for name in lists.into_iter().flatten() {
        if !all.contains(&name) {
            all.push(name);
        }
    }
    all
}

impl Found<'_> {
    fn add(&mut self, place: impl Into<String>, how: How) {
        let place = place.into();
        self.all.push(Difference { place, how });
    }

    /// Notes two descriptions that are not alike.
    fn other<T: PartialEq + Serialize>(&mut self, place: &str, first: &T, second: &T) {
        if first != second {
            let [first, second] = [first, second].map(|v| json!(v));
            self.add(place, How::Other { first, second });
        }
    }

    /// Both of a name, where both have it; else that one of them has none is noted.
    fn paired<T>(&mut self, place: &str, [first, second]: [Option<T>; 2]) -> Option<[T; 2]> {
        match (first, second) {
            (Some(a), Some(b)) => return Some([a, b]),
            (Some(_), None) => self.add(place, How::OnlyInFirst),
            (None, Some(_)) => self.add(place, How::OnlyInSecond),
            (None, None) => {}
        }
        None
    }

    fn results(&mut self) {
        let lists = self.both.map(Artifact::results);
        for name in names(lists.map(|l| l.iter().map(|r| r.name.as_str()))) {
            let place = format!("result {name}");
            let of = lists.map(|l| l.iter().find(|r| r.name == name));
            let Some([a, b]) = self.paired(&place, of) else {
                continue;
            };
            self.other(&format!("unit of {place}"), &a.unit, &b.unit);
            if a.value.to_bits() != b.value.to_bits() {
                let (first, second, unit) = (a.value, b.value, a.unit.clone());
                let how = How::Number {
                    first,
                    second,
                    unit,
                };
                self.add(place, how);
            }
        }
    }

    fn attributes(&mut self) {
        // What is no JSON (no artifact of ours) is compared as a text.
        let read = |a: &Artifact| {
            let text = a.attributes();
            serde_json::from_str(text).unwrap_or_else(|_| json!(text))
        };
        let [first, second]: [Value; 2] = self.both.map(read);
        self.values("attribute", &first, &second);
    }

    /// Goes down to the smallest values that are not alike.
    fn values(&mut self, place: &str, first: &Value, second: &Value) {
        match (first, second) {
            (Value::Object(a), Value::Object(b)) => {
                for key in names([a, b].map(|m: &Map<String, Value>| m.keys().map(String::as_str)))
                {
                    let inner = match place {
                        "attribute" => format!("attribute {key}"),
                        _ => format!("{place}.{key}"),
                    };
                    if let Some([a, b]) = self.paired(&inner, [a.get(key), b.get(key)]) {
                        self.values(&inner, a, b);
                    }
                }
            }
            (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
                for (k, (a, b)) in a.iter().zip(b).enumerate() {
                    self.values(&format!("{place}[{k}]"), a, b);
                }
            }
            (Value::Array(a), Value::Array(b)) => {
                self.other(&format!("length of {place}"), &a.len(), &b.len());
            }
            _ => self.other(place, first, second),
        }
    }

    /// Notes numbers that are not the same bits, of two arrays in memory. Only the length is noted where that is not the same.
    fn numbers_of(&mut self, place: &str, unit: &str, both: &[&[f64]; 2]) {
        let [a, b] = both;
        if a.len() != b.len() {
            self.other(&format!("number of {place}"), &a.len(), &b.len());
            return;
        }
        let mut numbers = Numbers::default();
        numbers.take(&[], &[a.len() as u64], both);
        self.all.extend(numbers.told(place, unit));
    }

    fn bodies(&mut self) -> Result<()> {
        let lists = self.both.map(|a| &a.contents().bodies);
        for name in names(lists.map(|l| l.iter().map(|b| b.name.as_str()))) {
            let of = self.both.map(|a| a.contents().body(name));
            if let Some(bodies) = self.paired(&format!("body {name}"), of) {
                self.body(bodies)?;
            }
        }
        Ok(())
    }

    fn body(&mut self, [a, b]: [&BodyInfo; 2]) -> Result<()> {
        let name = &a.name;
        self.values(
            &format!("attributes of {name}"),
            &a.attributes,
            &b.attributes,
        );
        let sizes = |b: &BodyInfo| json!({"points": b.points, "cells": b.cells, "nodes_per_cell": b.nodes_per_cell, "moving": b.moving});
        let [first, second] = [sizes(a), sizes(b)];
        if first != second {
            self.other(&format!("mesh of {name}"), &first, &second);
            return Ok(());
        }
        let [first, second] = self.both;
        let [(points, cells), (points_2, cells_2)] = [first.mesh(name)?, second.mesh(name)?];
        let flat = [points.as_flattened(), points_2.as_flattened()];
        let mut numbers = Numbers::default();
        numbers.take(&[], &[a.points, 3], &flat);
        self.all
            .extend(numbers.told(&format!("undeformed points of {name}"), "m"));
        if cells != cells_2 {
            let differ = cells.iter().zip(&cells_2).filter(|(a, b)| a != b).count();
            let text = format!("{differ} of {} corners are other points", cells.len());
            self.other(
                &format!("cells of {name}"),
                &json!("as they are"),
                &json!(text),
            );
        }
        // Frames that one of them alone has are told by the times.
        let frames = first.times().len().min(second.times().len()) as u64;
        if a.moving {
            let mut numbers = Numbers::default();
            for frame in 0..frames {
                let [p, q] = [
                    first.frame_points(name, frame)?,
                    second.frame_points(name, frame)?,
                ];
                let flat = [p.as_flattened(), q.as_flattened()];
                numbers.take(&[frame], &[a.points, 3], &flat);
            }
            self.all
                .extend(numbers.told(&format!("points of {name}"), "m"));
        }
        self.fields([a, b], frames)
    }

    fn fields(&mut self, [a, b]: [&BodyInfo; 2], frames: u64) -> Result<()> {
        let called = |f: &FieldInfo| {
            let on = format!("{:?}", f.on).to_lowercase();
            format!("field {} ({on}) of {}", f.name, a.name)
        };
        for field in &b.fields {
            if !a
                .fields
                .iter()
                .any(|f| f.name == field.name && f.on == field.on)
            {
                self.add(called(field), How::OnlyInSecond);
            }
        }
        for field in &a.fields {
            let place = called(field);
            let same = |f: &&FieldInfo| f.name == field.name && f.on == field.on;
            let Some(other) = b.fields.iter().find(same) else {
                self.add(place, How::OnlyInFirst);
                continue;
            };
            if field != other {
                self.other(&place, field, other);
                continue;
            }
            let mut numbers = Numbers::default();
            for frame in 0..frames {
                let read = |artifact: &Artifact| {
                    artifact.frame_field(&a.name, frame, field.on, &field.name)
                };
                let [p, q] = [read(self.both[0])?, read(self.both[1])?];
                let components = u64::from(field.components.max(1));
                let shape = [p.len() as u64 / components, components];
                numbers.take(&[frame], &shape, &[&p, &q]);
            }
            self.all.extend(numbers.told(&place, &field.unit));
        }
        Ok(())
    }

    fn arrays(&mut self) -> Result<()> {
        let lists = self.both.map(|a| &a.contents().arrays);
        for path in names(lists.map(|l| l.iter().map(|a| a.path.as_str()))) {
            let place = format!("array {path}");
            let of = self.both.map(|a| a.contents().array(path));
            let Some([a, b]) = self.paired(&place, of) else {
                continue;
            };
            if a != b {
                self.other(&place, a, b);
                continue;
            }
            let [first, second] = self.both;
            let raw = |artifact: &Artifact, info: &ArrayInfo| -> Result<Vec<u8>> {
                let count: u64 = info.shape.iter().product();
                let mut bytes = vec![0; count as usize * info.dtype.size()];
                artifact
                    .read_array(path, info.dtype, &mut bytes)
                    .map(|()| bytes)
            };
            // Large integers are not told apart as doubles.
            if raw(first, a)? == raw(second, b)? {
                continue;
            }
            let [(p, _), (q, _)] = [first.array_f64(path)?, second.array_f64(path)?];
            let mut numbers = Numbers::default();
            numbers.take(&[], &a.shape, &[&p, &q]);
            match numbers.told(&place, &a.unit) {
                Some(told) => self.all.push(told),
                None => self.other(
                    &place,
                    &json!("integers"),
                    &json!("others that are the same as doubles"),
                ),
            }
        }
        Ok(())
    }
}

/// Counts numbers that are not the same.
#[derive(Default)]
struct Numbers {
    differ: u64,
    of: u64,
    largest: f64,
    at: Vec<u64>,
    scale: f64,
}

impl Numbers {
    /// Takes two arrays of one shape; `before` is the part of the index that stands before theirs.
    fn take(&mut self, before: &[u64], shape: &[u64], [first, second]: &[&[f64]; 2]) {
        self.of += first.len() as u64;
        for (k, (a, b)) in first.iter().zip(*second).enumerate() {
            self.scale = self.scale.max(a.abs());
            if a.to_bits() == b.to_bits() {
                continue;
            }
            self.differ += 1;
            let size = (a - b).abs();
            if self.at.is_empty() || size > self.largest {
                self.largest = size;
                self.at = before.to_vec();
                self.at.extend(index(k as u64, shape));
            }
        }
    }

    fn told(self, place: &str, unit: &str) -> Option<Difference> {
        let Self {
            differ,
            of,
            largest,
            at,
            scale,
        } = self;
        let (place, unit) = (place.to_owned(), unit.to_owned());
        let how = How::Numbers {
            differ,
            of,
            largest,
            at,
            scale,
            unit,
        };
        (differ > 0).then_some(Difference { place, how })
    }
}

/// Index of a place in an array of this shape, row-major.
fn index(mut place: u64, shape: &[u64]) -> Vec<u64> {
    let mut index = vec![0; shape.len()];
    for (at, n) in index.iter_mut().zip(shape).rev() {
        *at = place % n.max(&1);
        place /= n.max(&1);
    }
    index
}
