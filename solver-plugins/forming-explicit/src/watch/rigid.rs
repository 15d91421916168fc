//! Rigid parts as the watch sees them: the tool's triangles, the bed, the plates of a press.

use plyflow_mechanics::contact::OpenPlate;
use plyflow_mechanics::vec3::{V, add, cross, norm, scale};
use plyflow_surface::Surface;
use plyflow_tooling::ToolMesh;

/// The triangles of a tool, body by body.
pub(super) struct Triangles {
    bodies: Vec<Surface>,
}

/// The closest point of a tool.
#[derive(Debug, Clone, Copy)]
pub(super) struct OnTool {
    /// Distance (m), positive outside.
    pub distance: f64,
    /// The point (m).
    pub at: V,
    /// Out of the tool there (unit).
    pub normal: V,
}

impl Triangles {
    /// `None` for a tool without area.
    pub fn new(tool: &ToolMesh) -> Option<Self> {
        let bodies: Vec<Surface> = (parts(tool).iter())
            .filter_map(|triangles| Surface::new(&tool.points, triangles))
            .collect();
        (!bodies.is_empty()).then_some(Self { bodies })
    }

    /// Of bodies that stand on or in each other the least of their distances is that of what they are together.
    pub fn closest(&self, p: V) -> OnTool {
        let of = |s: &Surface| {
            let c = s.closest(p);
            OnTool {
                distance: c.signed_distance,
                at: c.point,
                normal: c.normal,
            }
        };
        let mut all = self.bodies.iter().map(of);
        let first = all.next().expect("a tool has a body");
        all.fold(first, |a, b| if b.distance < a.distance { b } else { a })
    }

    /// Distance (m), positive outside.
    pub fn distance(&self, p: V) -> f64 {
        let all = self.bodies.iter().map(|s| s.closest(p).signed_distance);
        all.fold(f64::INFINITY, f64::min)
    }

    /// Curvatures (1/m) of the surface at a place on it, from how far places half an element of `size` (m) away in its tangent plane lie off
    /// it: the sum of the principal ones and that of their squares. Positive where it is convex.
    fn curvatures(&self, at: V, normal: V, size: f64) -> [f64; 2] {
        let side = if normal[2].abs() < 0.7 {
            [0.0, 0.0, 1.0]
        } else {
            [1.0, 0.0, 0.0]
        };
        let a = cross(normal, side);
        let a = scale(a, 1.0 / norm(a));
        let b = cross(normal, a);
        let s = 0.5 * size;
        let off = |u: f64, v: f64| self.distance(add(at, add(scale(a, u * s), scale(b, v * s))));
        let square = s * s;
        let (k1, k2) = (
            (off(1.0, 0.0) + off(-1.0, 0.0)) / square,
            (off(0.0, 1.0) + off(0.0, -1.0)) / square,
        );
        let mixed = ((off(1.0, 1.0) + off(-1.0, -1.0)) - (off(1.0, -1.0) + off(-1.0, 1.0)))
            / (4.0 * square);
        [k1 + k2, k1 * k1 + k2 * k2 + 2.0 * mixed * mixed]
    }

    /// How far (m) into a hollow the nodes of elements of `size` (m) stand so that the elements are as long as the surface (decision 28),
    /// recomputed from the triangles.
    pub fn let_be(&self, on: &OnTool, size: f64) -> f64 {
        let [sum, squares] = self.curvatures(on.at, on.normal, size);
        if squares <= 0.0 {
            return 0.0;
        }
        let mean = sum * (3.0 * squares - sum * sum) / (2.0 * squares);
        size * size / 24.0 * (-mean).max(0.0)
    }
}

/// Triangles that hang together by common points; bodies in the order of their first triangles.
fn parts(tool: &ToolMesh) -> Vec<Vec<[u32; 3]>> {
    let mut root: Vec<u32> = (0..tool.points.len() as u32).collect();
    fn find(root: &mut [u32], mut i: u32) -> u32 {
        while root[i as usize] != i {
            root[i as usize] = root[root[i as usize] as usize];
            i = root[i as usize];
        }
        i
    }
    for t in &tool.triangles {
        let a = find(&mut root, t[0]);
        for n in &t[1..] {
            let b = find(&mut root, *n);
            root[b as usize] = a;
        }
    }
    let mut of = vec![usize::MAX; tool.points.len()];
    let mut all: Vec<Vec<[u32; 3]>> = Vec::new();
    for t in &tool.triangles {
        let r = find(&mut root, t[0]) as usize;
        if of[r] == usize::MAX {
            of[r] = all.len();
            all.push(Vec::new());
        }
        all[of[r]].push(*t);
    }
    all
}

/// Distance (m, positive outside) from a plate with a rounded opening: in the half plane of the axis, the nearest point of its outline, which is a
/// straight face, a quarter of a circle and a straight wall.
pub(super) fn from_plate(plate: &OpenPlate, p: V) -> f64 {
    let r = (p[0] * p[0] + p[1] * p[1]).sqrt();
    // Into the plate from its face.
    let y = plate.side * (p[2] - plate.height);
    let (round, from) = (plate.edge, plate.opening + plate.edge);
    let length = |a: f64, b: f64| (a * a + b * b).sqrt();
    let face = length((from - r).max(0.0), y);
    let wall = length(r - plate.opening, (round - y).max(0.0));
    let (u, v) = (r - from, y - round);
    let arc = if u <= 0.0 && v <= 0.0 {
        (length(u, v) - round).abs()
    } else {
        f64::INFINITY
    };
    let inside = r > plate.opening && y > 0.0 && (u > 0.0 || v > 0.0 || length(u, v) < round);
    let distance = face.min(wall).min(arc);
    if inside { -distance } else { distance }
}
