//! Rigid parts: their names, and how the artifact shows them.

use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::contact::{OpenPlate, RigidSurface};
use plyflow_tooling::{FieldError, ToolMesh};
use std::sync::Arc;

/// A rigid part, by the name that it has in scenes, contacts and artifacts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RigidName {
    /// The tool; of a press the punch.
    Tool,
    /// What the tool stands on: the plane z = 0.
    Bed,
    /// Of a press, above the plies.
    Die,
    /// Of a press, below the plies.
    Holder,
    /// Of a stamping, by its name in the scene.
    Part(Arc<str>),
}

impl RigidName {
    /// The name.
    pub fn word(&self) -> &str {
        match self {
            Self::Tool => "tool",
            Self::Bed => "bed",
            Self::Die => "die",
            Self::Holder => "holder",
            Self::Part(name) => name,
        }
    }

    /// Whether a contact of that name is one with this part: those begin with the part's name and a slash.
    pub fn is_of(&self, contact: &str) -> bool {
        let rest = contact.strip_prefix(self.word());
        rest.is_some_and(|r| r.starts_with('/'))
    }
}

/// A rigid part besides the tool, as a body of the artifact.
#[derive(Debug, Clone)]
pub struct RigidBody {
    /// Which it is.
    pub name: RigidName,
    /// Whether it lies above the sheets.
    pub above: bool,
    /// What is shown of it where it is described.
    pub shape: RigidShape,
}

/// What is shown of a rigid part.
#[derive(Debug, Clone)]
pub enum RigidShape {
    /// A plate with a round opening.
    Plate(PlateMesh),
    /// Triangles.
    Triangles(ToolMesh),
}

/// A plate with a round opening, as far as it is shown.
#[derive(Debug, Clone)]
pub struct PlateMesh {
    /// Points (m).
    pub points: Vec<Vec3>,
    /// Quads.
    pub cells: Vec<[u32; 4]>,
    /// What they show.
    pub plate: OpenPlate,
}

impl RigidBody {
    /// Its points where it is described (m).
    pub fn points(&self) -> &[Vec3] {
        match &self.shape {
            RigidShape::Plate(plate) => &plate.points,
            RigidShape::Triangles(mesh) => &mesh.points,
        }
    }

    /// Its cells, one after the other, and how many points each has.
    pub fn cells(&self) -> (usize, &[u32]) {
        match &self.shape {
            RigidShape::Plate(plate) => (4, plate.cells.as_flattened()),
            RigidShape::Triangles(mesh) => (3, mesh.triangles.as_flattened()),
        }
    }
}

impl PlateMesh {
    /// The largest difference of its cells, cut along their diagonals, from a plate: at the cells' middles, and those of their sides.
    pub fn error_against(&self, plate: &OpenPlate) -> FieldError {
        let corner = |n: u32| self.points[n as usize];
        let middle = |of: &[Vec3]| -> Vec3 {
            std::array::from_fn(|k| of.iter().map(|p| p[k]).sum::<f64>() / of.len() as f64)
        };
        let mut worst = FieldError::default();
        for cell in &self.cells {
            let c = cell.map(corner);
            let sides = (0..4).map(|k| middle(&[c[k], c[(k + 1) % 4]]));
            let diagonals = [middle(&[c[0], c[2]]), middle(&[c[1], c[3]])];
            for at in sides.chain(diagonals) {
                let largest = plate.distance(at).0.abs();
                worst = worst.or(FieldError { largest, at });
            }
        }
        worst
    }

    /// The face of a plate out to a radius that covers `reach` (m), its rounding, and as much of the wall again.
    pub fn new(plate: &OpenPlate, reach: f64) -> Self {
        // Chords of 0.01 mm for what presses have: openings of 70 mm, roundings of 10 mm.
        const AROUND: usize = 192;
        const ALONG: usize = 16;
        let a = plate.opening + plate.edge;
        let mut profile = vec![[1.05 * reach.max(a), 0.0]];
        for i in 0..=ALONG {
            let (s, c) = (std::f64::consts::FRAC_PI_2 * i as f64 / ALONG as f64).fixed_sin_cos();
            profile.push([a - plate.edge * s, plate.edge * (1.0 - c)]);
        }
        profile.push([plate.opening, 2.0 * plate.edge]);
        let mut points = Vec::with_capacity(profile.len() * AROUND);
        for [r, y] in &profile {
            for k in 0..AROUND {
                let (s, c) = (std::f64::consts::TAU * k as f64 / AROUND as f64).fixed_sin_cos();
                points.push([r * c, r * s, plate.height + plate.side * y]);
            }
        }
        let node = |i: usize, k: usize| (i * AROUND + k % AROUND) as u32;
        let cells = (0..profile.len() - 1)
            .flat_map(|i| (0..AROUND).map(move |k| (i, k)))
            .map(|(i, k)| {
                [
                    node(i, k),
                    node(i, k + 1),
                    node(i + 1, k + 1),
                    node(i + 1, k),
                ]
            })
            .collect();
        Self {
            points,
            cells,
            plate: *plate,
        }
    }
}
