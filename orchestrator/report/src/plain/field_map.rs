//! Maps of a field on bodies seen from above, side by side.

use crate::plain::ply::{Cells, Vec3, range_of};

/// A map that can be drawn.
#[derive(Debug)]
pub(crate) struct FieldMap {
    pub(crate) title: String,
    /// Unit as printed, and the factor to it from SI.
    pub(crate) unit: String,
    pub(crate) factor: f64,
    pub(crate) panels: Vec<Panel>,
}

/// A body with a field.
#[derive(Debug)]
pub(crate) struct Panel {
    pub(crate) label: String,
    /// `[points]` (m).
    pub(crate) points: Vec<Vec3>,
    pub(crate) cells: Cells,
    /// `[points]` (SI).
    pub(crate) values: Vec<f64>,
}

impl FieldMap {
    /// The values of all panels.
    pub(crate) fn values(&self) -> impl Iterator<Item = f64> {
        self.panels.iter().flat_map(|p| p.values.iter().copied())
    }

    /// Smallest and largest value (SI).
    pub(crate) fn range(&self) -> Option<[f64; 2]> {
        range_of(self.values())
    }
}
