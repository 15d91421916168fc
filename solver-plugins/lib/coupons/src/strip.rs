//! What the tests of strips share: columns of nodes along the strip, clamps, the family that lies along it.
//!
//! **Clamps.** Elements with rotations are held by the positions and the spins of the clamped nodes: the clamp
//! line is the last column of them. Elements without rotations hold a slope only between two columns, so the
//! line where the strip leaves the clamp is the middle between the last two clamped columns (as in every
//! rotation-free formulation): the axis is shifted by half an element. Four columns are clamped, because of how
//! the areas of a mesh's edge are given to the curvature patches (`QuadMesh::patches`): the patch next to the edge is half
//! as heavy again, the next one by up to a twelfth, all others speak for their own cells only. The patch of the clamp
//! line must be one of those, or the strip is clamped a tenth of an element off.

use crate::specimen::{Common, Specimen, element};
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::component::ElementInstance;
use plyflow_mechanics::mesh::QuadMesh;
use plyflow_sdk::{Host, StepError};

/// Clamped columns of nodes at an end.
pub const CLAMPED: usize = 4;

/// Whether the nodes of the chosen element rotate.
///
/// # Errors
/// When a component is missing or refuses its parameters; when element and material do not bend.
pub fn rotates(host: &Host, p: &Common) -> Result<bool, StepError> {
    let element = element(host, p)?.0;
    check_bends(&element, p)?;
    if !element.rotates() && element.sizes.patch_nodes == 0 {
        return Err(format!(
            "element: given '{}', a membrane, which does not bend; expected an element that does, such as rf4 or s4",
            p.element.plugin
        )
        .into());
    }
    Ok(element.rotates())
}

/// Refuses an element that bends with a material that does not: it would be a membrane without a word.
///
/// # Errors
/// When it is so.
pub fn check_bends(element: &ElementInstance, p: &Common) -> Result<(), StepError> {
    if element.sizes.patch_nodes > 0 && !element.material.reference().sizes().has_bending {
        return Err(format!(
            "element: given '{}', which bends, and material '{}', which has no bending; expected a material with `bending` \
             (`plyflow plugins {}`)",
            p.element.plugin, p.material.name, p.material.plugin
        )
        .into());
    }
    Ok(())
}

/// A structured strip: columns along x, rows along y.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// `[columns]` places of the columns (m).
    pub xs: Vec<f64>,
    /// `[rows]` places of the rows (m); the middle one is y = 0 when their number is odd.
    pub ys: Vec<f64>,
}

impl Grid {
    /// Mesh; node (column i, row j) has the number j * columns + i.
    pub fn mesh(&self) -> QuadMesh {
        QuadMesh::grid(&self.xs, &self.ys)
    }

    /// Number of a node.
    pub fn node(&self, column: usize, row: usize) -> u32 {
        (row * self.xs.len() + column) as u32
    }

    /// Column and row of a node.
    pub fn place(&self, node: u32) -> (usize, usize) {
        (node as usize % self.xs.len(), node as usize / self.xs.len())
    }

    /// Nodes of the columns in `range`, column by column.
    pub fn columns(&self, range: std::ops::Range<usize>) -> Vec<u32> {
        range
            .flat_map(|i| (0..self.ys.len()).map(move |j| (i, j)))
            .map(|(i, j)| self.node(i, j))
            .collect()
    }
}

/// Rows over a width around y = 0: an even number of elements (at least two) of about `size` (m), so that a row
/// of nodes lies in the middle.
pub fn rows(width: f64, size: f64) -> Vec<f64> {
    let half = (0.5 * width / size).round().max(1.0) as usize;
    (0..=2 * half)
        .map(|j| 0.5 * width * (j as f64 / half as f64 - 1.0))
        .collect()
}

/// Direction of material axis e1 (undeformed plane) that puts fibre family 1 or 2 along x.
pub fn axis_of_family(family: u32) -> Vec3 {
    if family == 2 {
        // e2 lies 90 degrees counter-clockwise from e1.
        [0.0, -1.0, 0.0]
    } else {
        [1.0, 0.0, 0.0]
    }
}

/// Largest size of a field over the specimen, 0 when the element does not have it.
pub fn largest(specimen: &Specimen, field: &str) -> f64 {
    specimen
        .field(field)
        .map_or(0.0, |v| v.iter().map(|x| x.abs()).fold(0.0, f64::max))
}

/// Largest fibre strain of both families, by size.
pub fn fibre_strain(specimen: &Specimen) -> f64 {
    largest(specimen, "fibre_strain_1").max(largest(specimen, "fibre_strain_2"))
}

/// Refuses a family other than 1 and 2.
///
/// # Errors
/// With what was given.
pub fn check_family(family: u32) -> Result<(), StepError> {
    if family == 1 || family == 2 {
        return Ok(());
    }
    Err(format!("family: given {family}; expected 1 or 2, the fibre family along the strip").into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_of_nodes_lies_in_the_middle_whatever_the_size() {
        for size in [0.002, 0.0045, 0.01, 0.1] {
            let ys = rows(0.03, size);
            assert!(ys.len() % 2 == 1 && ys.len() >= 3);
            assert_eq!(ys[ys.len() / 2], 0.0);
            assert_eq!((ys[0], ys[ys.len() - 1]), (-0.015, 0.015));
        }
    }
}
