//! Rigid parts as the watch sees them: the tool's triangles, the bed, the plates of a press.

use crate::stack::RigidName;
use plyflow_geometry::vec3::{Vec3, add, cross, norm, scale};
use plyflow_mechanics::contact::OpenPlate;
use plyflow_surface::Surface;
use plyflow_tooling::ToolMesh;

/// What a rigid part is made of.
pub enum Shape {
    /// The triangles of the tool, or of another part.
    Tool(Triangles),
    /// The plane z = 0.
    Bed,
    /// Of a press.
    Plate(OpenPlate),
}

/// A rigid part that is watched.
pub struct Part {
    /// Which it is.
    pub name: RigidName,
    /// What it is made of.
    pub shape: Shape,
    /// Whether it lies above the sheets.
    pub above: bool,
    /// Error (m) of its distance field.
    pub error: f64,
}

/// The triangles of a tool, body by body.
pub struct Triangles {
    bodies: Vec<Surface>,
}

/// A triangle of a tool near which a search begins: its body and its number there.
pub type Hint = (u32, u32);

/// The closest point of a tool.
#[derive(Debug, Clone, Copy)]
pub struct OnTool {
    /// Distance (m), positive outside.
    pub distance: f64,
    /// The point (m).
    pub at: Vec3,
    /// Out of the tool there (unit).
    pub normal: Vec3,
    /// The triangle that it lies on.
    pub triangle: Hint,
}

impl Triangles {
    /// `None` for a tool without area.
    pub fn new(tool: &ToolMesh) -> Option<Self> {
        let bodies: Vec<Surface> = (parts(tool).iter())
            .filter_map(|triangles| Surface::new(&tool.points, triangles))
            .collect();
        (!bodies.is_empty()).then_some(Self { bodies })
    }

    /// The closest point of a body. The hint makes a search shorter and changes nothing of what is found.
    fn of_body(&self, body: usize, p: Vec3, hint: Hint) -> OnTool {
        let surface = &self.bodies[body];
        let c = match hint.0 as usize == body {
            true => surface.closest_from(p, hint.1 as usize),
            false => surface.closest(p),
        };
        OnTool {
            distance: c.signed_distance,
            at: c.point,
            normal: c.normal,
            triangle: (body as u32, c.triangle as u32),
        }
    }

    /// Of bodies that stand on or in each other the least of their distances is that of what they are together. `hint`: a triangle that is
    /// probably near, such as the last one or (0, 0).
    pub fn closest(&self, p: Vec3, hint: Hint) -> OnTool {
        let mut all = (0..self.bodies.len()).map(|b| self.of_body(b, p, hint));
        let first = all.next().expect("a tool has a body");
        all.fold(first, |a, b| if b.distance < a.distance { b } else { a })
    }

    /// Distance (m), positive outside.
    pub fn distance(&self, p: Vec3, hint: Hint) -> f64 {
        let all = (0..self.bodies.len()).map(|b| self.of_body(b, p, hint).distance);
        all.fold(f64::INFINITY, f64::min)
    }

    /// Curvatures (1/m) of the surface at a place on it, from how far places half an element of `size` (m) away in its tangent plane lie off
    /// it: the sum of the principal ones and that of their squares. Positive where it is convex.
    fn curvatures(&self, on: &OnTool, size: f64) -> [f64; 2] {
        let (at, normal) = (on.at, on.normal);
        let side = if normal[2].abs() < 0.7 {
            [0.0, 0.0, 1.0]
        } else {
            [1.0, 0.0, 0.0]
        };
        let a = cross(normal, side);
        let a = scale(a, 1.0 / norm(a));
        let b = cross(normal, a);
        let s = 0.5 * size;
        let place = |u: f64, v: f64| add(at, add(scale(a, u * s), scale(b, v * s)));
        let off = |u: f64, v: f64| self.distance(place(u, v), on.triangle);
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
        let [sum, squares] = self.curvatures(on, size);
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
pub fn from_plate(plate: &OpenPlate, p: Vec3) -> f64 {
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

#[cfg(test)]
mod tests {
    use super::*;
    use plyflow_mechanics::contact::RigidSurface;

    /// A box with these corners (m).
    fn block(low: Vec3, high: Vec3) -> ToolMesh {
        let corner = |k: usize| -> Vec3 {
            std::array::from_fn(|d| if k >> d & 1 == 1 { high[d] } else { low[d] })
        };
        let sides = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        ToolMesh {
            points: (0..8).map(corner).collect(),
            triangles: sides
                .iter()
                .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]])
                .collect(),
        }
    }

    #[test]
    fn a_place_in_a_box_is_as_deep_as_its_nearest_face_at_faces_edges_and_corners() {
        let tool = Triangles::new(&block([0.0; 3], [0.1, 0.06, 0.02])).unwrap();
        let e = 1e-4;
        for (p, expected) in [
            ([0.05, 0.03, 0.02 - e], -e),
            ([0.1 - e, 0.06 - 2.0 * e, 0.01], -e),
            ([0.1 - e, 0.06 - e, 0.02 - e], -e),
            ([0.1 - 3.0 * e, 0.03, 0.02 - 2.0 * e], -2.0 * e),
            ([0.1 + 3.0 * e, 0.06 + 4.0 * e, 0.01], 5.0 * e),
            ([0.1 + e, 0.06 + e, 0.02 + e], 3f64.sqrt() * e),
        ] {
            let found = tool.closest(p, (0, 0)).distance;
            assert!(
                (found - expected).abs() < 1e-12,
                "{p:?}: {found}, not {expected}"
            );
        }
    }

    #[test]
    fn a_face_of_one_body_that_lies_in_another_one_is_no_surface() {
        let mut both = block([0.0; 3], [0.1, 0.06, 0.02]);
        let second = block([0.05, 0.01, 0.0], [0.15, 0.05, 0.02]);
        both.points.extend(second.points);
        both.triangles
            .extend(second.triangles.iter().map(|t| t.map(|n| n + 8)));
        let tool = Triangles::new(&both).unwrap();
        // Just outside of the second body's end, which lies 50 mm inside of the first one.
        let found = tool.closest([0.05 - 1e-4, 0.03, 0.01], (0, 0)).distance;
        assert!((found + 0.01).abs() < 1e-12, "{found}");
        assert!(tool.closest([0.16, 0.03, 0.01], (0, 0)).distance > 0.0099);
    }

    #[test]
    fn a_hollow_lets_nodes_in_by_what_makes_chords_as_long_as_arcs_and_nothing_else_does() {
        // Half of a groove of 20 mm radius along y, in facets of 1 degree, closed by a box below.
        let (radius, size, width) = (0.02, 0.004, 0.05);
        let outline: Vec<[f64; 2]> = (0..=180)
            .map(|k| {
                let (s, c) = f64::from(k).to_radians().sin_cos();
                [-radius * c, 0.03 - radius * s]
            })
            .collect();
        let mut mesh = ToolMesh::default();
        for y in [-width, width] {
            mesh.points.extend(outline.iter().map(|p| [p[0], y, p[1]]));
        }
        let n = outline.len() as u32;
        for k in 0..n - 1 {
            mesh.triangles.push([k, k + 1, n + k + 1]);
            mesh.triangles.push([k, n + k + 1, n + k]);
        }
        let tool = Triangles::new(&mesh).unwrap();
        let on = tool.closest([0.001, 0.003, 0.0101], (0, 0));
        let expected = size * size / (24.0 * radius);
        let found = tool.let_be(&on, size);
        assert!(
            (found / expected - 1.0).abs() < 0.1,
            "{found}, not {expected}"
        );
        // The same from below is convex, and a plane is nothing.
        mesh.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        let tool = Triangles::new(&mesh).unwrap();
        assert_eq!(
            tool.let_be(&tool.closest([0.001, 0.003, 0.0099], (0, 0)), size),
            0.0
        );
        let tool = Triangles::new(&block([0.0; 3], [0.1, 0.06, 0.02])).unwrap();
        assert!(tool.let_be(&tool.closest([0.05, 0.03, 0.021], (0, 0)), size) < 1e-12);
    }

    #[test]
    fn a_plate_is_where_the_contact_has_it_though_the_watch_looks_for_its_nearest_point() {
        for side in [1.0, -1.0] {
            let plate = OpenPlate {
                height: 0.01,
                side,
                opening: 0.03,
                edge: 0.004,
            };
            for i in 0..2000 {
                let f = |k: f64| (f64::from(i) * k).fract();
                let p = [
                    0.1 * (f(0.618) - 0.5),
                    0.1 * (f(0.414) - 0.5),
                    0.03 * f(0.732),
                ];
                let (found, theirs) = (from_plate(&plate, p), plate.distance(p).0);
                // Deep inside theirs is the distance to the part that faces, which is no nearer.
                let same = (found - theirs).abs() < 1e-12;
                assert!(
                    same || found < 0.0 && theirs <= found,
                    "{p:?}: {found}, {theirs}"
                );
            }
        }
    }
}
