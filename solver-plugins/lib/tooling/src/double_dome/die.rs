//! The die that closes over a double dome: its hollow is the dome with a gap all around it.

use super::Shape;
use crate::chord::CHORD_TOLERANCE;
use crate::mesh::ToolMesh;
use crate::sweep::arc_step;
use plyflow_fixed::FixedBits;
use plyflow_model::scene::{DoubleDomeTool, MatchingDie};
use std::f64::consts::{FRAC_PI_2, PI};

/// Height (m) of the block over the top of its hollow.
const CROWN: f64 = 0.02;

/// The closed surface of the block where it stands when it is closed over the dome.
///
/// # Errors
/// When the waist is so deep that rays from the axis meet the outline more than once, from which the face is made.
pub(crate) fn die(t: &DoubleDomeTool, words: &MatchingDie) -> Result<ToolMesh, String> {
    let shape = Shape::new(t).around(words.gap.si());
    // Rays go out from the rounding's rim.
    let waist = shape.waist - words.edge_radius.si();
    let tangent = (waist / shape.height).clamp(-1.0, 1.0).fixed_acos();
    if shape.turn >= tangent {
        return Err(format!(
            "the waist of the double dome is too deep for a die made from its words: its arcs turn by {:.1} deg, and the face of the die is made \
             for up to {:.1} deg; take a larger `waist_radius`, or draw the die and give it as `tool: {{stl: ..}}`",
            shape.turn.to_degrees(),
            tangent.to_degrees()
        ));
    }
    let mut size = t.facet_size.si();
    loop {
        let (mesh, longest) = Block::new(&shape, words, size).mesh();
        if longest <= t.facet_size.si() {
            return Ok(mesh);
        }
        size *= 0.9;
    }
}

impl Shape {
    /// The same with `gap` (m) all around: arcs about the same centres.
    fn around(&self, gap: f64) -> Self {
        Self {
            radius: self.radius + gap,
            waist: self.waist - gap,
            ..*self
        }
    }

    /// Unit normal of the outline at one of its points, away from what it bounds.
    fn normal(&self, [x, r]: [f64; 2]) -> [f64; 2] {
        if x.abs() <= self.waist * self.turn.fixed_sin() {
            [-x / self.waist, (self.height - r) / self.waist]
        } else {
            let along = (x.abs() - self.centre) * x.signum();
            [along / self.radius, r / self.radius]
        }
    }
}

/// A block, and how finely its surface is made.
struct Block<'a> {
    shape: &'a Shape,
    words: &'a MatchingDie,
    facet: f64,
    mesh: ToolMesh,
    /// Points (x, r) of the outline from one pole to the other, with its normals there.
    stations: Vec<([f64; 2], [f64; 2])>,
    /// Facets of which the length counts, the last excluded: those of hollow and rounding. The others are flat.
    curved: usize,
}

impl<'a> Block<'a> {
    fn new(shape: &'a Shape, words: &'a MatchingDie, facet: f64) -> Self {
        let points = shape.stations(facet, CHORD_TOLERANCE);
        let with_normal = |p: [f64; 2]| (p, shape.normal(p));
        Self {
            shape,
            words,
            facet,
            mesh: ToolMesh::default(),
            stations: points.into_iter().map(with_normal).collect(),
            curved: 0,
        }
    }

    /// The surface and the longest edge of what is not flat (m).
    fn mesh(mut self) -> (ToolMesh, f64) {
        let rim = self.hollow();
        let lower = self.wall(rim);
        let edge = self.rounding(lower);
        self.curved = self.mesh.triangles.len();
        self.outside(&edge);
        if self.mesh.volume() < 0.0 {
            self.mesh.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        let curved = ToolMesh {
            points: self.mesh.points.clone(),
            triangles: self.mesh.triangles[..self.curved].to_vec(),
        };
        (self.mesh, curved.longest_edge())
    }

    /// The dome of the hollow. Gives the points of its rim, from one pole along y > 0 to the other and back along y < 0.
    fn hollow(&mut self) -> Vec<u32> {
        let over = (PI / arc_step(self.shape.radius, CHORD_TOLERANCE, self.facet)).ceil() as usize;
        let over = over + over % 2;
        let last = self.stations.len() - 1;
        let mut rings: Vec<Vec<u32>> = Vec::with_capacity(last + 1);
        for (k, ([x, r], _)) in self.stations.clone().into_iter().enumerate() {
            if k == 0 || k == last {
                let pole = self.mesh.push([x, 0.0, self.shape.wall]);
                rings.push(vec![pole; over + 1]);
                continue;
            }
            let ring = (0..=over).map(|j| {
                let (s, c) = (PI * j as f64 / over as f64).fixed_sin_cos();
                // The ends exactly on the wall.
                let s = if j == 0 || j == over { 0.0 } else { s };
                self.mesh.push([x, r * c, self.shape.wall + r * s])
            });
            rings.push(ring.collect());
        }
        for pair in rings.windows(2) {
            for j in 0..over {
                self.strip([pair[0][j], pair[0][j + 1]], [pair[1][j], pair[1][j + 1]]);
            }
        }
        let back = rings[1..last].iter().rev().map(|ring| ring[over]);
        rings.iter().map(|ring| ring[0]).chain(back).collect()
    }

    /// Two facets between two points of one row and two of the next; one where two are the same.
    fn strip(&mut self, [a, b]: [u32; 2], [c, d]: [u32; 2]) {
        if a == b {
            self.mesh.triangles.push([a, d, c]);
        } else if c == d {
            self.mesh.triangles.push([a, b, c]);
        } else {
            self.mesh.quad(a, b, d, c);
        }
    }

    /// Facets between two closed rows of as many points.
    fn band(&mut self, from: &[u32], to: &[u32]) {
        for k in 0..from.len() {
            let next = (k + 1) % from.len();
            self.strip([from[k], from[next]], [to[k], to[next]]);
        }
    }

    /// Points of the outline with `out` (m) around it at a height (m), in the order of the rim.
    fn row(&mut self, out: f64, z: f64) -> Vec<u32> {
        let last = self.stations.len() - 1;
        let forth = (0..=last).map(|k| (k, 1.0));
        let back = (1..last).rev().map(|k| (k, -1.0));
        let all: Vec<(usize, f64)> = forth.chain(back).collect();
        let place = |(k, side): (usize, f64)| {
            let ([x, r], [nx, nr]) = self.stations[k];
            [x + out * nx, side * (r + out * nr), z]
        };
        let places: Vec<[f64; 3]> = all.into_iter().map(place).collect();
        places.into_iter().map(|p| self.mesh.push(p)).collect()
    }

    /// Height (m) at which the wall ends in the rounding.
    fn foot_of_wall(&self) -> f64 {
        self.words.face.si() + self.words.edge_radius.si()
    }

    /// The wall from the rim down to the rounding. Gives its last row.
    fn wall(&mut self, rim: Vec<u32>) -> Vec<u32> {
        let (high, low) = (self.shape.wall, self.foot_of_wall());
        let count = ((high - low) / (0.55 * self.facet)).ceil() as usize;
        let mut above = rim;
        // A wall as high as what decimals of a scene leave is none.
        if high - low < 1e-9 {
            return above;
        }
        for k in 1..=count {
            let z = high + (low - high) * k as f64 / count as f64;
            let row = self.row(0.0, z);
            self.band(&above, &row);
            above = row;
        }
        above
    }

    /// The rounding from the wall to the face. Gives its last row.
    fn rounding(&mut self, wall: Vec<u32>) -> Vec<u32> {
        let edge = self.words.edge_radius.si();
        let count = (FRAC_PI_2 / arc_step(edge, CHORD_TOLERANCE, 0.7 * self.facet)).ceil() as usize;
        let mut above = wall;
        for k in 1..=count {
            let (s, c) = (FRAC_PI_2 * k as f64 / count as f64).fixed_sin_cos();
            let c = if k == count { 0.0 } else { c };
            let row = self.row(edge * (1.0 - c), self.foot_of_wall() - edge * s);
            self.band(&above, &row);
            above = row;
        }
        above
    }

    /// Face, sides and back of the block.
    fn outside(&mut self, edge: &[u32]) {
        let half = [self.words.length, self.words.width].map(|full| 0.5 * full.si());
        let mut outline: Vec<[f64; 2]> = edge.iter().map(|p| self.on_block(*p, half)).collect();
        // No ray from the axis meets a corner by itself: the nearest one goes there.
        for corner in [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]] {
            let corner = [0, 1].map(|k| corner[k] * half[k]);
            let far = |p: &[f64; 2]| (p[0] - corner[0]).fixed_hypot(p[1] - corner[1]);
            let nearest =
                (0..outline.len()).min_by(|a, b| far(&outline[*a]).total_cmp(&far(&outline[*b])));
            if let Some(k) = nearest {
                outline[k] = corner;
            }
        }
        let face = self.words.face.si();
        let back = self.shape.wall + self.shape.radius + CROWN;
        let loop_at = |z: f64, mesh: &mut ToolMesh| -> Vec<u32> {
            outline.iter().map(|p| mesh.push([p[0], p[1], z])).collect()
        };
        let low = loop_at(face, &mut self.mesh);
        let high = loop_at(back, &mut self.mesh);
        self.band(edge, &low);
        self.band(&low, &high);
        let middle = self.mesh.push([0.0, 0.0, back]);
        for k in 0..high.len() {
            self.mesh
                .triangles
                .push([high[k], high[(k + 1) % high.len()], middle]);
        }
    }

    /// Where the ray from the axis through a point meets the sides of the block, whose half sizes (m) are given.
    fn on_block(&self, point: u32, half: [f64; 2]) -> [f64; 2] {
        let [x, y, _] = self.mesh.points[point as usize];
        let scale = (half[0] / x.abs()).min(half[1] / y.abs());
        [x * scale, y * scale]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SurfaceTree;
    use crate::double_dome::double_dome;

    fn dome() -> DoubleDomeTool {
        let text = "dome_radius: 60 mm\ndome_distance: 180 mm\nwaist_radius: 150 mm\nwall: 30 mm\nfacet_size: 8 mm\n";
        serde_saphyr::from_str(text).unwrap()
    }

    fn words() -> MatchingDie {
        let text = "gap: 1.5 mm\nedge_radius: 10 mm\nface: 12 mm\nlength: 420 mm\nwidth: 260 mm\n";
        serde_saphyr::from_str(text).unwrap()
    }

    #[test]
    fn the_hollow_is_the_dome_with_the_gap_all_around_it_and_the_block_is_closed() {
        let (dome, words) = (dome(), words());
        let die = die(&dome, &words).unwrap();
        assert!(die.is_watertight() && die.volume() > 0.0);
        let punch = SurfaceTree::new(&double_dome(&dome));
        // Points of hollow and wall, but not of its rounded edge: each as far from the dome as the gap.
        let inner = |p: &&[f64; 3]| {
            p[2] > 0.0225 && p[2] < 0.0929 && {
                let [x, y] = [p[0].abs(), p[1].abs()];
                x < 0.155 && y < 0.1
            }
        };
        let all: Vec<f64> = die
            .points
            .iter()
            .filter(inner)
            .map(|p| punch.closest(*p).signed_distance)
            .collect();
        assert!(all.len() > 500);
        let off = all.iter().map(|d| (d - 1.5e-3).abs()).fold(0.0, f64::max);
        assert!(off < 2.0 * CHORD_TOLERANCE, "{off}");
        // The rim of the face, all around: as far from the dome as gap and rounding.
        let on_rim =
            |p: &&[f64; 3]| (p[2] - 0.012).abs() < 1e-9 && p[0].abs() < 0.2 && p[1].abs() < 0.12;
        let rim: Vec<f64> = (die.points.iter().filter(on_rim))
            .map(|p| punch.closest(*p).signed_distance)
            .collect();
        assert!(rim.len() > 50);
        let off = rim.iter().map(|d| (d - 11.5e-3).abs()).fold(0.0, f64::max);
        assert!(off < 2.0 * CHORD_TOLERANCE, "{off}");
        // The block's box: as long and wide as said, from the face to the crown over the hollow.
        let [low, high] = die.bounds();
        for (found, expected) in [
            (low, [-0.21, -0.13, 0.012]),
            (high, [0.21, 0.13, 0.03 + 0.0615 + CROWN]),
        ] {
            for k in 0..3 {
                assert!(
                    (found[k] - expected[k]).abs() < 1e-9,
                    "{found:?} {expected:?}"
                );
            }
        }
    }

    #[test]
    fn what_is_in_the_block_is_inside_and_what_is_in_its_hollow_is_outside() {
        let mesh = die(&dome(), &words()).unwrap();
        let tree = SurfaceTree::new(&mesh);
        for (p, expected) in [
            // Under the top of the hollow, on the axis of a dome.
            ([0.09, 0.0, 0.03 + 0.0615 - 0.004], 0.004),
            ([0.09, 0.0, 0.03 + 0.0615 + 0.004], -0.004),
            // Under and in the face.
            ([0.19, 0.0, 0.007], 0.005),
            ([0.19, 0.1, 0.016], -0.004),
        ] {
            let found = tree.closest(p).signed_distance;
            assert!(
                (found - expected).abs() < 2.0 * CHORD_TOLERANCE,
                "{p:?}: {found}"
            );
        }
        // The rounding lies on its arc: in the section y = 0 through the pole its centre is `edge` out of the wall and over the face.
        let centre = [0.1515 + 0.01, 0.022];
        let on_arc = |p: &&[f64; 3]| {
            p[1] == 0.0 && p[0] > 0.1515 + 1e-6 && p[0] < 0.1615 - 1e-6 && p[2] < 0.03
        };
        let arc: Vec<f64> = (mesh.points.iter().filter(on_arc))
            .map(|p| (p[0] - centre[0]).hypot(p[2] - centre[1]))
            .collect();
        assert!(
            arc.len() >= 3 && arc.iter().all(|r| (r - 0.01).abs() < 1e-12),
            "{arc:?}"
        );
    }

    #[test]
    fn a_waist_too_deep_for_rays_from_the_axis_is_refused() {
        let mut deep = dome();
        // The domes barely meet.
        deep.dome_radius = plyflow_model::units::Length(0.04);
        deep.waist_radius = plyflow_model::units::Length(0.085);
        let text = die(&deep, &words()).unwrap_err();
        assert!(
            text.contains("waist_radius") && text.contains("stl"),
            "{text}"
        );
    }
}
