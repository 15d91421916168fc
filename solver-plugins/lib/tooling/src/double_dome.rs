//! Two domes joined by a waist, on a vertical wall.

mod die;

pub(crate) use die::die;

use crate::chord::CHORD_TOLERANCE;
use crate::mesh::ToolMesh;
use crate::sweep::arc_step;
use plyflow_fixed::FixedBits;
use plyflow_model::scene::DoubleDomeTool;
use std::f64::consts::{FRAC_PI_2, PI};

/// The closed surface, standing on z = 0.
pub(crate) fn double_dome(t: &DoubleDomeTool) -> ToolMesh {
    let (shape, facet) = (Shape::new(t), t.facet_size.si());
    let mut size = facet;
    loop {
        let mesh = shape.mesh(size, CHORD_TOLERANCE);
        if mesh.longest_edge() <= facet {
            return mesh;
        }
        size *= 0.9;
    }
}

/// A curve in the half plane (x, r >= 0), symmetric about x = 0: an arc of a dome about (centre, 0), tangent to the arc of the
/// waist about (0, height). Turned about the x axis it is the upper part; drawn in plan it is the outline of the wall.
struct Shape {
    radius: f64,
    centre: f64,
    waist: f64,
    /// r of the centre of the waist's arc.
    height: f64,
    /// Angle of the waist's half arc.
    turn: f64,
    wall: f64,
}

impl Shape {
    fn new(t: &DoubleDomeTool) -> Self {
        let (radius, distance) = (t.dome_radius.si(), t.dome_distance.si());
        let (waist, wall) = (t.waist_radius.si(), t.wall.si());
        let centre = 0.5 * distance;
        let both = radius + waist;
        Self {
            radius,
            centre,
            waist,
            height: (both * both - centre * centre).sqrt(),
            turn: (centre / both).fixed_asin(),
            wall,
        }
    }

    /// Points (x, r) from one pole to the other, so close that facets keep size and tolerance.
    fn stations(&self, facet: f64, tolerance: f64) -> Vec<[f64; 2]> {
        // On the dome, the angle from the axis x.
        let sweep = FRAC_PI_2 + self.turn;
        let count = |angle: f64, radius: f64| {
            let n = angle / arc_step(radius, tolerance, facet);
            n.ceil().max(2.0) as usize
        };
        let (n, m) = (count(sweep, self.radius), count(self.turn, self.waist));
        let mut half = vec![[self.centre + self.radius, 0.0]];
        half.extend((1..=n).map(|k| {
            let (s, c) = (sweep * k as f64 / n as f64).fixed_sin_cos();
            [self.centre + self.radius * c, self.radius * s]
        }));
        half.extend((1..=m).map(|k| {
            let (s, c) = (self.turn * (1.0 - k as f64 / m as f64)).fixed_sin_cos();
            [self.waist * s, self.height - self.waist * c]
        }));
        let last = half.len() - 1;
        half[last][0] = 0.0;
        let mirror: Vec<[f64; 2]> = half[..last].iter().rev().map(|p| [-p[0], p[1]]).collect();
        half.extend(mirror);
        half
    }

    /// Loops around x, one for each station: over the top from y > 0 to y < 0, down the wall, back along the bed, up the wall.
    fn mesh(&self, facet: f64, tolerance: f64) -> ToolMesh {
        let stations = self.stations(facet, tolerance);
        let over = (PI / arc_step(self.radius, tolerance, facet)).ceil() as usize;
        let over = over + over % 2;
        let down = if self.wall > 0.0 {
            (self.wall / (0.55 * facet)).ceil() as usize
        } else {
            0
        };
        let mut mesh = ToolMesh::default();
        let loops: Vec<Vec<u32>> = stations
            .iter()
            .map(|p| self.ring(&mut mesh, *p, over, down))
            .collect();
        for pair in loops.windows(2) {
            let (a, b) = (&pair[0], &pair[1]);
            for k in 0..a.len() {
                let j = (k + 1) % a.len();
                // At the poles two corners are one.
                if a[k] == a[j] {
                    if b[k] != b[j] {
                        mesh.triangles.push([a[k], b[k], b[j]]);
                    }
                } else if b[k] == b[j] {
                    mesh.triangles.push([a[k], b[k], a[j]]);
                } else {
                    mesh.quad(a[k], b[k], b[j], a[j]);
                }
            }
        }
        mesh
    }

    fn ring(&self, mesh: &mut ToolMesh, [x, r]: [f64; 2], over: usize, down: usize) -> Vec<u32> {
        let pole = r == 0.0;
        let mut ring = Vec::with_capacity(2 * (over + down));
        let top = if pole { 0 } else { over };
        for k in 0..=top {
            let (s, c) = (PI * k as f64 / over as f64).fixed_sin_cos();
            // The ends exactly on the wall.
            let s = if k == 0 || k == over { 0.0 } else { s };
            ring.push(mesh.push([x, r * c, self.wall + r * s]));
        }
        if pole {
            ring.resize(over + 1, ring[0]);
        }
        for k in 1..=down {
            ring.push(mesh.push([x, -r, self.wall * (1.0 - k as f64 / down as f64)]));
        }
        let low = *ring.last().expect("the top has points");
        for k in 1..over {
            ring.push(if pole {
                low
            } else {
                mesh.push([x, r * (2.0 * k as f64 / over as f64 - 1.0), 0.0])
            });
        }
        if down > 0 {
            ring.push(if pole { low } else { mesh.push([x, r, 0.0]) });
            for k in (1..down).rev() {
                let other = ring[over + k];
                let z = self.wall * (1.0 - k as f64 / down as f64);
                ring.push(if pole { other } else { mesh.push([x, r, z]) });
            }
        }
        ring
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{SignedDistanceGrid, SurfaceTree};

    fn tool(wall: &str, facet: &str) -> DoubleDomeTool {
        let text = format!(
            "dome_radius: 60 mm\ndome_distance: 180 mm\nwaist_radius: 150 mm\nwall: {wall}\nfacet_size: {facet}\n"
        );
        serde_saphyr::from_str(&text).unwrap()
    }

    /// Exact signed distance to the surface without the bed, negative inside.
    fn distance(s: &Shape, p: [f64; 3]) -> f64 {
        let r = p[1].hypot((p[2] - s.wall).max(0.0));
        let x = p[0].abs();
        // Left of the line through both centres the nearest point lies on the waist's arc.
        let beyond = x * s.height + (r - s.height) * s.centre;
        if beyond < 0.0 && r < s.height {
            s.waist - x.hypot(r - s.height)
        } else {
            (x - s.centre).hypot(r) - s.radius
        }
    }

    /// Numbers in [0, 1) that look random.
    fn numbers() -> impl FnMut() -> f64 {
        let mut state = 7u64;
        move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        }
    }

    #[test]
    fn points_lie_on_the_surface_and_facets_near_it() {
        for wall in ["0 mm", "25 mm"] {
            let t = tool(wall, "8 mm");
            let (mesh, shape) = (double_dome(&t), Shape::new(&t));
            assert!(
                mesh.is_watertight() && mesh.longest_edge() <= 0.008,
                "wall {wall}"
            );
            for p in mesh.points.iter().filter(|p| p[2] > 0.0) {
                assert!(distance(&shape, *p).abs() < 1e-12, "{p:?}");
            }
            for k in 0..mesh.triangles.len() {
                let q = mesh.corners(k);
                let middle = [0, 1, 2].map(|c| (q[0][c] + q[1][c] + q[2][c]) / 3.0);
                if middle[2] > 0.0 {
                    let d = distance(&shape, middle);
                    // In both directions at once: twice a chord's.
                    assert!(d.abs() < 2.0 * CHORD_TOLERANCE, "{middle:?}: {d}");
                }
            }
            let [lo, hi] = mesh.bounds();
            assert_eq!((lo[2], hi[0]), (0.0, 0.15));
            assert!((hi[2] - t.wall.si() - 0.06).abs() < CHORD_TOLERANCE);
        }
    }

    #[test]
    fn closest_points_and_offsets_are_those_of_the_arcs() {
        let t = tool("25 mm", "8 mm");
        let (mesh, shape) = (double_dome(&t), Shape::new(&t));
        let tree = SurfaceTree::new(&mesh);
        let grid = SignedDistanceGrid::build(&mesh, 0.002, 0.012);
        let mut random = numbers();
        let (mut near, mut waist) = (0, 0);
        for _ in 0..4000 {
            let p = [
                0.34 * random() - 0.17,
                0.16 * random() - 0.08,
                0.02 + 0.08 * random(),
            ];
            let exact = distance(&shape, p);
            if exact <= 0.0 || exact > 0.01 {
                continue;
            }
            near += 1;
            waist += usize::from(p[0].abs() < 0.04);
            let q = tree.closest(p);
            let found = (0..3)
                .map(|k| (q.point[k] - p[k]).powi(2))
                .sum::<f64>()
                .sqrt();
            assert!(
                (found - exact).abs() < 2.0 * CHORD_TOLERANCE,
                "{p:?}: {found} {exact}"
            );
            let (offset, _) = grid.distance_and_gradient(p);
            assert!((offset - exact).abs() < 6e-5, "{p:?}: {offset} {exact}");
        }
        assert!(near > 200 && waist > 20, "{near} {waist}");
    }

    #[test]
    fn volume_is_that_of_a_numerical_integral_with_second_order() {
        let t = tool("25 mm", "8 mm");
        let s = Shape::new(&t);
        // Half a disc on a rectangle at every x.
        let r = |x: f64| {
            if x < s.waist * s.turn.sin() {
                s.height - (s.waist.powi(2) - x * x).sqrt()
            } else {
                (s.radius.powi(2) - (x - s.centre).powi(2)).max(0.0).sqrt()
            }
        };
        let n = 200_000;
        let end = s.centre + s.radius;
        let section = |k: usize| {
            let r = r(end * (k as f64 + 0.5) / n as f64);
            0.5 * PI * r * r + 2.0 * r * s.wall
        };
        let volume = 2.0 * end / n as f64 * (0..n).map(section).sum::<f64>();
        let error = |facet: f64| {
            let mesh = s.mesh(facet, 1.0);
            assert!(mesh.is_watertight());
            1.0 - mesh.volume() / volume
        };
        let (coarse, fine) = (error(0.008), error(0.004));
        let order = (coarse / fine).log2();
        assert!((order - 2.0).abs() < 0.15, "order {order}");
        assert!(fine.abs() < 1e-3, "error {fine}");
    }
}
