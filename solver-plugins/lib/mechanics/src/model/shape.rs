//! Whether the elements still are what they were made as: none collapsed, turned inside out, folded onto itself, or carried by its
//! hourglass control alone.
//!
//! An element's forces are a function of a few products of its sides and directors. Far from the states for which it was made such a
//! function has other minima: an element that has come into one of them rests there without force, and nothing else in the model shows
//! it. So the shapes themselves are looked at, independently of what the elements say; what only the element knows (its directors) it
//! tells by a critical step of 0.

use super::blocks::NODE_CHUNK;
use super::parts::Model;
use crate::mesh::area_vector;
use crate::vec3::{Vec3, add, cross, dot, norm, scale, sub};
use crate::{MechanicsError, team};
use plyflow_fixed::FixedBits;
use rayon::prelude::*;

/// Steps between two looks at the shapes: some thousandths of a step's work.
pub(super) const LOOK: u64 = 1024;
/// Steps between two looks at what the elements themselves say, which costs some steps' work.
pub const ASK_INTERVAL: u64 = 8192;
/// Least area over that of the reference: parallelograms sheared by 87 degrees; a ply locks long before.
const LEAST_AREA: f64 = 0.05;
/// Cosine of the angle between the normals at opposite corners, or of neighbours, from which on a sheet lies folded back onto itself
/// within one element or between two: 150 degrees.
const FOLDED: f64 = -0.866;

/// What has become of an element.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    /// Area over that of the reference.
    Collapsed(f64),
    /// Corners cross, as in a bow tie.
    Crossed,
    /// Folded along a diagonal by this angle (rad).
    Folded(f64),
    /// Two neighbours lie on each other: angle between their normals (rad).
    Closed(f64),
    /// It gives no step that is stable.
    Stepless,
}

fn cosine(a: Vec3, b: Vec3) -> f64 {
    let size = (dot(a, a) * dot(b, b)).sqrt();
    if size > 0.0 { dot(a, b) / size } else { 1.0 }
}

/// Directed areas of the corners: twice those of the triangles of a corner and its two neighbours.
fn corners(p: &[Vec3; 4]) -> [Vec3; 4] {
    std::array::from_fn(|i| {
        let (next, last) = (p[(i + 1) % 4], p[(i + 3) % 4]);
        cross(sub(next, p[i]), sub(last, p[i]))
    })
}

/// Of a cell by itself.
fn fault_of(p: &[Vec3; 4], reference: &[Vec3; 4]) -> Option<Fault> {
    let area = norm(area_vector(*p)) / norm(area_vector(*reference)).max(f64::MIN_POSITIVE);
    if area < LEAST_AREA {
        return Some(Fault::Collapsed(area));
    }
    let c = corners(p);
    let opposite = [cosine(c[0], c[2]), cosine(c[1], c[3])];
    if opposite[0] < 0.0 && opposite[1] < 0.0 {
        return Some(Fault::Crossed);
    }
    // A cell that has only become concave has one corner that points the other way, but a small one.
    let large = |i: usize| norm(c[i]) > 0.25 * norm(c[i ^ 2]);
    (0..2)
        .find(|i| opposite[*i] < FOLDED && large(*i) && large(*i + 2))
        .map(|i| Fault::Folded(angle_of(opposite[i])))
}

fn angle_of(cosine: f64) -> f64 {
    (1.0 - cosine * cosine).max(0.0).sqrt().fixed_atan2(cosine)
}

impl Model {
    /// Looks at the shape of every cell. A membrane may be folded as it likes: that costs it nothing, and it hides nothing.
    ///
    /// # Errors
    /// When one is no element any more: which, where, when, and what has become of it.
    pub fn check_shapes(&self) -> Result<(), MechanicsError> {
        let at = |x: &[Vec3], cell: usize| self.topology.cells[cell].map(|n| x[n as usize]);
        for sheet in &self.topology.sheets {
            let of_element = &sheet.element;
            let bends = of_element.rotates() || of_element.sizes.patch_nodes > 0;
            let bends = bends && sheet.elsewhere.is_none();
            let (first, end) = sheet.cell_range;
            let look = |cell: usize| {
                let p = at(&self.state.x, cell);
                let fault = fault_of(&p, &at(&self.topology.start, cell));
                if !bends {
                    return fault.filter(|f| !matches!(f, Fault::Folded(_)));
                }
                fault.or_else(|| {
                    let normal = area_vector(p);
                    let closed = |other: &u32| {
                        let other = *other as usize;
                        let lies = |other| cosine(normal, area_vector(at(&self.state.x, other)));
                        (other < end && other > cell)
                            .then(|| lies(other))
                            .filter(|c| *c < FOLDED)
                    };
                    let found = self.topology.neighbours[cell].iter().find_map(closed)?;
                    Some(Fault::Closed(angle_of(found)))
                })
            };
            let cells = (first..end).into_par_iter();
            let cells = cells.with_min_len(NODE_CHUNK.max(team::least()));
            if let Some((cell, fault)) = cells.find_map_first(|cell| Some((cell, look(cell)?))) {
                return Err(self.distorted(cell, fault));
            }
        }
        Ok(())
    }

    /// Asks the elements themselves: one that gives no stable step has none.
    ///
    /// # Errors
    /// As [`Model::check_shapes`].
    pub(super) fn check_steps(&self) -> Result<(), MechanicsError> {
        match self.weakest_cell() {
            Some((cell, step)) if step <= 0.0 => Err(self.distorted(cell, Fault::Stepless)),
            _ => Ok(()),
        }
    }

    fn distorted(&self, cell: usize, fault: Fault) -> MechanicsError {
        let sheet = self
            .topology
            .sheets
            .iter()
            .find(|s| (s.cell_range.0..s.cell_range.1).contains(&cell));
        let (name, first) = sheet.map_or(("?", 0), |s| (s.name.as_str(), s.cell_range.0));
        let p = self.topology.cells[cell].map(|n| self.state.x[n as usize]);
        let middle = scale(add(add(p[0], p[1]), add(p[2], p[3])), 0.25);
        MechanicsError::Distorted {
            time: self.state.time,
            cycle: self.state.cycle,
            sheet: name.into(),
            cell: cell - first,
            place: middle,
            what: match fault {
                Fault::Collapsed(a) => {
                    format!("it has collapsed to {:.1} % of its area", 100.0 * a)
                }
                Fault::Crossed => "its corners have crossed".into(),
                Fault::Folded(a) => format!(
                    "it is folded onto itself along a diagonal, by {:.0} degrees",
                    a.to_degrees()
                ),
                Fault::Closed(a) => format!(
                    "the sheet is folded back by {:.0} degrees between it and the element beside it",
                    a.to_degrees()
                ),
                Fault::Stepless => {
                    "it has turned inside out, or its material gives no finite stiffness".into()
                }
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: [Vec3; 4] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
    ];

    fn moved(f: impl Fn(Vec3) -> Vec3) -> Option<Fault> {
        fault_of(&SQUARE.map(f), &SQUARE)
    }

    #[test]
    fn cells_that_a_sound_run_has_are_left_alone() {
        assert_eq!(moved(|p| p), None);
        for degrees in [-70.0f64, -60.0, 45.0, 60.0, 80.0] {
            // A trellis: the sides keep their length.
            let (s, c) = degrees.to_radians().sin_cos();
            assert_eq!(
                moved(|p| [p[0] + s * p[1], c * p[1], 0.0]),
                None,
                "{degrees} degrees"
            );
        }
        // Bent over its diagonal and warped by a right angle; stretched; concave by a tenth.
        for up in [0.5, -0.7] {
            assert_eq!(moved(|p| [p[0], p[1], up * p[0] * p[1]]), None);
        }
        assert_eq!(moved(|p| [3.0 * p[0], 0.3 * p[1], 0.0]), None);
        let mut dart = SQUARE;
        dart[2] = [0.45, 0.45, 0.0];
        assert_eq!(fault_of(&dart, &SQUARE), None);
    }

    #[test]
    fn cells_that_are_none_any_more_are_told_apart() {
        let collapsed = moved(|p| [p[0], 0.04 * p[1], 0.0]);
        assert!(matches!(collapsed, Some(Fault::Collapsed(a)) if (a - 0.04).abs() < 1e-12));
        let mut tie = SQUARE;
        (tie[2], tie[3]) = ([0.1, 1.0, 0.0], [0.9, 1.0, 0.3]);
        assert_eq!(fault_of(&tie, &SQUARE), Some(Fault::Crossed));
        // The third corner turned about the diagonal from the second to the fourth, by 160 degrees.
        let fold = |angle: f64| {
            let (s, c) = angle.to_radians().sin_cos();
            let r = 0.5f64.sqrt();
            let mut p = SQUARE;
            p[2] = [0.5 + 0.5 * c, 0.5 + 0.5 * c, r * s];
            fault_of(&p, &SQUARE)
        };
        assert_eq!(fold(120.0), None);
        assert!(
            matches!(fold(160.0), Some(Fault::Folded(a)) if (a.to_degrees() - 160.0).abs() < 1e-9)
        );
    }
}
