//! The blank of a ply.

use crate::error::MeshError;
use crate::mesher::mesh_region;
use crate::{cut, quality};
use plyflow_fixed::FixedBits;
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::mirror::Planes;
use plyflow_model::artifact::MeshQuality;
use plyflow_model::budget::{self, Wanted};
use plyflow_model::outline::{Point, Region};
use plyflow_model::scene::Sheet;

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
        let rectangle = sheet.rectangle().map(Self::Rectangle);
        rectangle.ok_or_else(|| MeshError::Size(sheet.name.clone()))
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

    /// The part of it with x >= 0 (y >= 0) beside mirror planes, in which it is its own image
    /// ([`plyflow_model::rules::symmetry`]).
    #[must_use]
    pub fn part(&self, planes: Planes) -> Self {
        let mut part = self.clone();
        for k in (0..2).filter(|k| planes.0[*k]) {
            part = match part {
                Self::Rectangle(mut b) => {
                    b[k] = 0.0;
                    Self::Rectangle(b)
                }
                Self::Region(region) => Self::Region(cut::positive(&region, k)),
            };
        }
        part
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
    pub fn mesh(&self, size: f64) -> Result<(QuadMesh, Option<MeshQuality>), MeshError> {
        self.allow(size)?;
        match self {
            Self::Rectangle([x0, y0, x1, y1]) => {
                let grid = QuadMesh::grid(&even_axis(*x0, *x1, size), &even_axis(*y0, *y1, size));
                Ok((grid, None))
            }
            Self::Region(region) => {
                let mesh = mesh_region(region, size)?;
                let quality = quality::of(&mesh, region, size);
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
