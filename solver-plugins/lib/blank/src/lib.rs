//! Blanks of plies before forming: rectangles, and outlines with holes.
//!
//! A rectangle is a regular grid. Any other outline is meshed with quads alone that follow it ([`mesh_region`]): nodes on
//! its edge, one on each sharp corner, grid lines along x and y inside.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod coarse;
mod cut;
mod edge;
mod mesher;
mod quality;
mod smooth;

pub use edge::{LEAST_FEATURE, SHARP};
pub use mesher::mesh_region;
use plyflow_fixed::FixedBits;
pub use quality::{POOR_JACOBIAN, Quality};

use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::mirror::Planes;
use plyflow_model::budget::{self, Wanted};
use plyflow_model::outline::{Millimetres, OutlineError, Point, Region};
use plyflow_model::scene::Sheet;

/// Why a blank has no mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// The sheet has no size.
    #[error("ply '{0}' needs length and width, or an outline")]
    Size(String),
    /// Its outline bounds no region.
    #[error("ply '{0}': {1}")]
    Outline(String, OutlineError),
    /// Something is smaller than the elements can follow. Lengths in mm.
    #[error(
        "{what} at {at} measures {given:.3} mm, too small for elements of {size:.3} mm; take an element size of at most \
         {wanted:.3} mm, or leave that feature out of the outline"
    )]
    Small {
        /// What it is.
        what: &'static str,
        /// Where.
        at: Millimetres,
        /// Its size (mm).
        given: f64,
        /// The elements' (mm).
        size: f64,
        /// Largest elements that follow it (mm).
        wanted: f64,
    },
    /// It is not its own mirror image. Lengths in mm.
    #[error(
        "the blank is not its own mirror image in the plane {plane} = 0: the image of its edge at {at} lies {apart:.3} mm off \
         the edge; move the blank or change its outline, or leave `{plane}` out of `symmetry`"
    )]
    Asymmetric {
        /// x or y.
        plane: char,
        /// Where.
        at: Millimetres,
        /// How far apart they are (mm).
        apart: f64,
    },
    /// The edge cannot be followed at this size.
    #[error(
        "the outline cannot be followed with elements of {size:.3} mm near {at}: {why}; take smaller elements"
    )]
    Coarse {
        /// Element size (mm).
        size: f64,
        /// Where.
        at: Millimetres,
        /// What happened.
        why: &'static str,
    },
    /// It would have too many elements; the sentence says how many, and what would do.
    #[error("{0}")]
    TooMany(String),
}

/// The blank of a ply, placed over the tool.
#[derive(Debug, Clone, PartialEq)]
pub enum Blank {
    /// x0, y0, x1, y1 (m).
    Rectangle([f64; 4]),
    /// Any other.
    Region(Region),
}

impl Blank {
    /// The blank of a sheet of the scene.
    ///
    /// # Errors
    /// When it has no size, or an outline that bounds no region.
    pub fn new(sheet: &Sheet) -> Result<Self, MeshError> {
        let region = sheet
            .region()
            .map_err(|e| MeshError::Outline(sheet.name.clone(), e))?;
        if let Some(region) = region {
            return Ok(Self::Region(region));
        }
        let (Some(l), Some(w)) = (sheet.length, sheet.width) else {
            return Err(MeshError::Size(sheet.name.clone()));
        };
        let [cx, cy] = sheet.centre.map(|c| c.si());
        let (hl, hw) = (0.5 * l.si(), 0.5 * w.si());
        Ok(Self::Rectangle([cx - hl, cy - hw, cx + hl, cy + hw]))
    }

    /// The box around it: x0, y0, x1, y1 (m).
    pub fn bounds(&self) -> [f64; 4] {
        match self {
            Self::Rectangle(b) => *b,
            Self::Region(region) => region.bounds(),
        }
    }

    /// Corners of its outline (m), counter-clockwise.
    pub fn outline(&self) -> Vec<Point> {
        match self {
            Self::Rectangle([x0, y0, x1, y1]) => {
                vec![[*x0, *y0], [*x1, *y0], [*x1, *y1], [*x0, *y1]]
            }
            Self::Region(region) => region.outline.clone(),
        }
    }

    /// Corners of its holes (m), clockwise.
    pub fn holes(&self) -> &[Vec<Point>] {
        match self {
            Self::Rectangle(_) => &[],
            Self::Region(region) => &region.holes,
        }
    }

    /// Distance of a point from its material (m); 0 on it.
    pub fn distance(&self, p: Point) -> f64 {
        match self {
            Self::Rectangle([x0, y0, x1, y1]) => {
                let dx = (x0 - p[0]).max(p[0] - x1).max(0.0);
                let dy = (y0 - p[1]).max(p[1] - y1).max(0.0);
                dx.fixed_hypot(dy)
            }
            Self::Region(region) if region.contains(p) => 0.0,
            Self::Region(region) => region.distance_to_edge(p),
        }
    }

    /// The part of it with x >= 0 (y >= 0) beside mirror planes.
    ///
    /// # Errors
    /// When it is not its own mirror image in one of them.
    pub fn part(&self, planes: Planes) -> Result<Self, MeshError> {
        cut::part(self, planes)
    }

    /// Material of it (m2).
    fn area(&self) -> f64 {
        match self {
            Self::Rectangle([x0, y0, x1, y1]) => (x1 - x0) * (y1 - y0),
            Self::Region(region) => region.area(),
        }
    }

    /// Whether a mesh of elements of `size` (m) is not too large to be made.
    fn allow(&self, size: f64) -> Result<(), MeshError> {
        budget::allow(Wanted {
            what: "its mesh",
            of: "elements",
            count: self.area() / (size * size),
            most: budget::MOST_ELEMENTS,
            bytes: budget::ELEMENT_BYTES,
            parameter: "element_size",
            size,
        })
        .map_err(MeshError::TooMany)
    }

    /// Its mesh in the plane z = 0 with edges near `size` (m), and the quality of a mesh that follows an outline.
    ///
    /// # Errors
    /// When it would have too many elements, or the outline cannot be followed at this size.
    pub fn mesh(&self, size: f64) -> Result<(QuadMesh, Option<Quality>), MeshError> {
        self.allow(size)?;
        match self {
            Self::Rectangle([x0, y0, x1, y1]) => {
                let grid = QuadMesh::grid(&even_axis(*x0, *x1, size), &even_axis(*y0, *y1, size));
                Ok((grid, None))
            }
            Self::Region(region) => {
                let mesh = mesh_region(region, size)?;
                let quality = Quality::new(&mesh, region, size);
                Ok((mesh, Some(quality)))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_a_thousand_times_too_small_are_refused_before_any_is_made() {
        let square = vec![[0.0, 0.0], [0.4, 0.0], [0.5, 0.3], [0.0, 0.2]];
        let region = Region::new(square, vec![]).unwrap();
        for blank in [
            Blank::Rectangle([0.0, 0.0, 0.4, 0.2]),
            Blank::Region(region),
        ] {
            let error = blank.mesh(1e-6).unwrap_err();
            assert!(matches!(error, MeshError::TooMany(_)), "{error}");
            let text = error.to_string();
            assert!(text.contains("elements at `element_size`"), "{text}");
            assert!(blank.mesh(0.01).is_ok());
        }
    }
}
