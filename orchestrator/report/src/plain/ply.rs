//! Meshes of plies and tool, with what is known at their points and in their cells.

use crate::plain::shape::Shape;
use plyflow_model::steering::Laid;

/// A place or a direction in space.
pub(crate) type Vec3 = [f64; 3];

/// The rigid tool.
#[derive(Debug, Clone)]
pub(crate) struct Tool {
    /// `[points]` (m).
    pub(crate) points: Vec<Vec3>,
    pub(crate) cells: Cells,
}

/// Cells of one number of nodes.
#[derive(Debug, Clone)]
pub(crate) struct Cells {
    /// `[cells][nodes]`: indices of points.
    pub(crate) nodes: Vec<u32>,
    /// Nodes of a cell.
    pub(crate) each: usize,
}

impl Cells {
    /// Those that have a surface: triangles and quads.
    pub(crate) fn surface(&self) -> Vec<Vec<u32>> {
        if !matches!(self.each, 3 | 4) {
            return Vec::new();
        }
        let all = self.nodes.chunks_exact(self.each);
        all.map(<[u32]>::to_vec).collect()
    }
}

/// What is wrong with a cell.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum Marked {
    /// Nothing.
    #[default]
    No,
    /// It lies on a wrinkle.
    Wrinkle,
    /// It bridges, or a detection flagged it.
    Other,
}

/// A formed ply. Fields are absent when the artifact does not have them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Ply {
    pub(crate) name: String,
    /// Undeformed points (m).
    pub(crate) flat: Vec<Vec3>,
    /// Formed points (m).
    pub(crate) formed: Vec<Vec3>,
    pub(crate) cells: Vec<[u32; 4]>,
    /// Shear angle per cell (rad).
    pub(crate) shear: Option<Vec<f64>>,
    /// Distance from the tool per point (m); NaN where it is not judged, as there is no tool to lie on.
    pub(crate) distance: Option<Vec<f64>>,
    /// Principal curvature of largest magnitude per point (1/m).
    pub(crate) curvature: Option<Vec<f64>>,
    /// How far it moved along z per point (m).
    pub(crate) deflection: Option<Vec<f64>>,
    /// Cells that the detection flagged, or that lie on a defect.
    pub(crate) marked: Vec<Marked>,
    /// Whatever else is told of its points and cells.
    pub(crate) others: Vec<Other>,
    /// Cells that a drape has reached; absent: all.
    pub(crate) draped: Option<Vec<bool>>,
    /// Directions of both fibre families in the flat ply.
    pub(crate) fibres: Option<Laid>,
    /// Thickness of the flat ply (m).
    pub(crate) thickness: Option<f64>,
    /// What follows from flat and formed shape.
    pub(crate) shape: Shape,
}

/// A scalar field on the points of a ply.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Other {
    /// Its name for people, with the component if it is one of several.
    pub(crate) title: String,
    /// SI unit.
    pub(crate) unit: String,
    /// `[points]` (SI); those of cells are averaged.
    pub(crate) values: Vec<f64>,
}

/// The ply of a point of a study, for its small picture.
#[derive(Debug)]
pub(crate) struct Sheet {
    pub(crate) name: String,
    /// `[points]` (m), formed.
    pub(crate) points: Vec<Vec3>,
    /// The cells that are drawn, of four nodes.
    pub(crate) cells: Vec<[u32; 4]>,
    /// `[points]` (SI): what colours it.
    pub(crate) values: Vec<f64>,
    pub(crate) shade: Shade,
}

/// What colours the small pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shade {
    Distance,
    Shear,
    Deflection,
    /// Nothing is known of the ply but its shape.
    Nothing,
}

/// The mean over the cells of `each` nodes around each of `points` points.
pub(crate) fn at_points(values: &[f64], nodes: &[u32], each: usize, points: usize) -> Vec<f64> {
    let mut sum = vec![0.0; points];
    let mut count = vec![0.0f64; points];
    for (cell, value) in nodes.chunks_exact(each).zip(values) {
        for i in cell {
            sum[*i as usize] += value;
            count[*i as usize] += 1.0;
        }
    }
    let mean = |(s, n): (&f64, &f64)| s / n.max(1.0);
    sum.iter().zip(&count).map(mean).collect()
}

/// Smallest and largest of some values; `None` when there is none that is a number.
pub(crate) fn range_of(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    let none = [f64::INFINITY, f64::NEG_INFINITY];
    let [low, high] = values.fold(none, |[a, b], v| [a.min(v), b.max(v)]);
    (low <= high).then_some([low, high])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_cells_are_averaged_at_their_points() {
        let cells = [0, 1, 4, 3, 1, 2, 5, 4];
        let found = at_points(&[1.0, 3.0], &cells, 4, 7);
        assert_eq!(found, [1.0, 2.0, 3.0, 1.0, 2.0, 3.0, 0.0]);
    }
}
