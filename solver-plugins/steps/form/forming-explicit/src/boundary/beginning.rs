//! Where a local run that begins late begins: at a state that the coarse run had on its way.

use crate::error::{FormingError, Result};
use crate::request::LocalSheet;
use crate::stack::StackSheet;
use plyflow_geometry::vec3::Vec3;

/// Where all sheets of a zone are when it begins late, and how they came there.
#[derive(Debug, Clone, PartialEq)]
pub struct Beginning {
    /// `[states][n]`, as [`Start::path`](crate::Start::path).
    pub path: Vec<Vec<Vec3>>,
    /// `[n]`, as [`Start::velocity`](crate::Start::velocity).
    pub velocity: Vec<Vec3>,
    /// Nodes of the cut, and the normals (of any length) that the coarse surface has there: the zone's own elements are only on one
    /// side of them.
    pub normals: Vec<(u32, Vec3)>,
    /// When it begins (s).
    pub time: f64,
}

impl Beginning {
    /// The start of a whole zone whose sheets begin at `time` (s): none at 0.
    ///
    /// # Errors
    /// Sheets that do not tell their start.
    pub fn of_zone(stack: &[StackSheet], sheets: &[LocalSheet], time: f64) -> Result<Option<Self>> {
        if time == 0.0 {
            return Ok(None);
        }
        let mut start = Self {
            path: Vec::new(),
            velocity: Vec::new(),
            normals: Vec::new(),
            time,
        };
        for sheet in stack {
            let name = &sheet.scene.name;
            let told = |s: &&LocalSheet| &s.name == name && s.start.is_some();
            let found = (sheets.iter().find(told)).and_then(|s| Some((s, s.start.as_ref()?)));
            let (cut, own) = found.ok_or_else(|| {
                FormingError::Input(format!(
                    "the boundary begins at {time} s and does not tell where sheet '{name}' is then; run its step again"
                ))
            })?;
            start.path.resize_with(own.path.len(), Vec::new);
            for (all, part) in start.path.iter_mut().zip(&own.path) {
                all.extend_from_slice(part);
            }
            let first = start.velocity.len() as u32;
            let normals = cut.normal.first().into_iter().flatten();
            let of_cut = cut.driven.iter().zip(normals);
            start
                .normals
                .extend(of_cut.map(|(n, normal)| (first + n, *normal)));
            start.velocity.extend_from_slice(&own.velocity);
        }
        let n = start.velocity.len();
        if start.path.is_empty() || start.path.iter().any(|p| p.len() != n) {
            let text = "the sheets of the boundary tell ways of different lengths to where they begin; run its step again";
            return Err(FormingError::Input(text.into()));
        }
        Ok(Some(start))
    }
}
