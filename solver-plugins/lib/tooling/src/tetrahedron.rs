//! A pyramid over an equilateral triangle with rounded edges and top.

use crate::chord::CHORD_TOLERANCE;
use crate::mesh::ToolMesh;
use crate::sweep::arc_step;
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{Vec3, add, cross, dot, norm, scale, slerp, sub, unit};
use plyflow_model::scene::TetrahedronTool;
use std::f64::consts::FRAC_PI_6;

/// The closed surface, standing on z = 0.
pub(crate) fn tetrahedron(t: &TetrahedronTool) -> ToolMesh {
    let (edge, height, radius) = (t.edge.si(), t.height.si(), t.radius.si());
    let facet = t.facet_size.si();
    let shape = Shape::new(edge, height, radius);
    let mut size = facet;
    loop {
        let mesh = shape.mesh(size, CHORD_TOLERANCE);
        if mesh.longest_edge() <= facet {
            return mesh;
        }
        size *= 0.9;
    }
}

/// The sphere that rounds the top rolls down the edges.
struct Shape {
    /// Its centre at the top.
    centre: Vec3,
    radius: f64,
    /// Along the edges downwards; counter-clockwise seen from above.
    edges: [Vec3; 3],
    /// Outward normal of the face between edges i and i + 1.
    normals: [Vec3; 3],
}

impl Shape {
    fn new(edge: f64, height: f64, radius: f64) -> Self {
        let top = [0.0, 0.0, height];
        let corner = |i: usize| {
            let (s, c) = (-5.0 * FRAC_PI_6 + 4.0 * FRAC_PI_6 * i as f64).fixed_sin_cos();
            scale([c, s, 0.0], edge / 3f64.sqrt())
        };
        let edges = [0, 1, 2].map(|i| unit(sub(corner(i), top)));
        let normals = [0, 1, 2].map(|i| unit(cross(edges[i], edges[(i + 1) % 3])));
        Self {
            // As far from every face as the radius says.
            centre: [0.0, 0.0, height - radius / normals[0][2]],
            radius,
            edges,
            normals,
        }
    }

    /// Directions from the sphere's centre to its part of the surface over edge i: from face i - 1 to face i.
    fn arc(&self, i: usize, w: f64) -> Vec3 {
        slerp(self.normals[(i + 2) % 3], self.normals[i], w)
    }

    fn mesh(&self, facet: f64, tolerance: f64) -> ToolMesh {
        let mut mesh = ToolMesh::default();
        let [a, b] = [self.normals[0], self.normals[1]];
        let angle = dot(a, b).clamp(-1.0, 1.0).fixed_acos();
        let around = (angle / arc_step(self.radius, tolerance, facet))
            .ceil()
            .max(2.0) as usize;
        let arcs = self.mesh_top(&mut mesh, around);
        // The longest line down an edge, and the foot of a face, which has as many pieces as the line.
        let foot = |i: usize, w: f64| {
            let start = add(self.centre, scale(self.arc(i, w), self.radius));
            add(start, scale(self.edges[i], -start[2] / self.edges[i][2]))
        };
        let line = norm(sub(foot(0, 0.5), self.centre));
        let width = norm(sub(foot(0, 1.0), foot(1, 0.0)));
        let down = (line.max(width) / (0.55 * facet)).ceil().max(2.0) as usize;
        let edges = [0, 1, 2].map(|i| self.mesh_edge(&mut mesh, i, &arcs[i], down));
        let mut rim = Vec::new();
        for i in 0..3 {
            let left: Vec<u32> = edges[i].iter().map(|row| row[around]).collect();
            let right: Vec<u32> = edges[(i + 1) % 3].iter().map(|row| row[0]).collect();
            rim.extend(&edges[i][down]);
            rim.extend(mesh_face(&mut mesh, &left, &right));
        }
        mesh_bottom(&mut mesh, &rim, facet);
        mesh
    }

    /// The sphere's part; its border over every edge.
    fn mesh_top(&self, mesh: &mut ToolMesh, n: usize) -> [Vec<u32>; 3] {
        let [a, b, c] = self.normals;
        let mut rows: Vec<Vec<u32>> = Vec::new();
        for r in 0..=n {
            let w = r as f64 / n as f64;
            let (from, to) = (slerp(a, b, w), slerp(a, c, w));
            let row = (0..=r).map(|j| {
                let direction = slerp(from, to, if r > 0 { j as f64 / r as f64 } else { 0.0 });
                mesh.push(add(self.centre, scale(direction, self.radius)))
            });
            rows.push(row.collect());
        }
        triangle_rows(mesh, &rows);
        [
            rows.iter().rev().map(|row| row[row.len() - 1]).collect(),
            rows.iter().map(|row| row[0]).collect(),
            rows[n].clone(),
        ]
    }

    /// Edge i from the top's border down to the bed; its rows.
    fn mesh_edge(&self, mesh: &mut ToolMesh, i: usize, arc: &[u32], down: usize) -> Vec<Vec<u32>> {
        let mut rows = vec![arc.to_vec()];
        for row in 1..=down {
            let next = arc.iter().map(|top| {
                let start = mesh.points[*top as usize];
                let length = -start[2] / self.edges[i][2] * row as f64 / down as f64;
                let mut p = add(start, scale(self.edges[i], length));
                if row == down {
                    p[2] = 0.0;
                }
                mesh.push(p)
            });
            rows.push(next.collect());
        }
        for pair in rows.windows(2) {
            for k in 0..arc.len() - 1 {
                mesh.quad(pair[0][k], pair[1][k], pair[1][k + 1], pair[0][k + 1]);
            }
        }
        rows
    }
}

/// The face between two lines that begin at one point; the inner points of its foot.
fn mesh_face(mesh: &mut ToolMesh, left: &[u32], right: &[u32]) -> Vec<u32> {
    let mut rows = vec![vec![left[0]]];
    for r in 1..left.len() {
        let (a, b) = (
            mesh.points[left[r] as usize],
            mesh.points[right[r] as usize],
        );
        let mut row = vec![left[r]];
        for j in 1..r {
            let w = j as f64 / r as f64;
            row.push(mesh.push(add(scale(a, 1.0 - w), scale(b, w))));
        }
        row.push(right[r]);
        rows.push(row);
    }
    triangle_rows(mesh, &rows);
    let foot = &rows[rows.len() - 1];
    foot[1..foot.len() - 1].to_vec()
}

/// Facets between rows of 1, 2, 3, .. points, left to right seen from outside, each below the one before.
fn triangle_rows(mesh: &mut ToolMesh, rows: &[Vec<u32>]) {
    for pair in rows.windows(2) {
        let (upper, lower) = (&pair[0], &pair[1]);
        for j in 0..upper.len() {
            mesh.triangles.push([upper[j], lower[j], lower[j + 1]]);
            if j + 1 < upper.len() {
                mesh.triangles.push([upper[j], lower[j + 1], upper[j + 1]]);
            }
        }
    }
}

/// The bottom inside its rim, which runs counter-clockwise seen from above: smaller and smaller rims.
fn mesh_bottom(mesh: &mut ToolMesh, rim: &[u32], facet: f64) {
    let reach = (rim.iter().map(|p| norm(mesh.points[*p as usize]))).fold(0.0, f64::max);
    let rings = (reach / (0.55 * facet)).ceil().max(1.0) as usize;
    let mut outer = rim.to_vec();
    for ring in (1..rings).rev() {
        let inner: Vec<u32> = rim
            .iter()
            .map(|p| mesh.push(scale(mesh.points[*p as usize], ring as f64 / rings as f64)))
            .collect();
        for k in 0..rim.len() {
            let next = (k + 1) % rim.len();
            mesh.quad(outer[k], inner[k], inner[next], outer[next]);
        }
        outer = inner;
    }
    let centre = mesh.push([0.0; 3]);
    for k in 0..outer.len() {
        let next = outer[(k + 1) % outer.len()];
        mesh.triangles.push([outer[k], centre, next]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn regular(radius: &str, facet: &str) -> TetrahedronTool {
        let text =
            format!("edge: 200 mm\nheight: 163.299 mm\nradius: {radius}\nfacet_size: {facet}\n");
        serde_saphyr::from_str(&text).unwrap()
    }

    #[test]
    fn every_point_lies_on_a_face_an_edge_or_the_top() {
        let t = regular("15 mm", "6 mm");
        let mesh = tetrahedron(&t);
        assert!(mesh.is_watertight() && mesh.longest_edge() <= 0.006);
        let shape = Shape::new(t.edge.si(), t.height.si(), t.radius.si());
        for p in mesh.points.iter().filter(|p| p[2] > 0.0) {
            // Distance from the cone of edges that the sphere's centre moves in.
            let q = sub(*p, shape.centre);
            let faces = shape.normals.map(|n| dot(n, q));
            let along = |e: Vec3| dot(e, q).max(0.0);
            let edges = shape.edges.map(|e| norm(sub(q, scale(e, along(e)))));
            let nearest = faces.into_iter().fold(f64::NEG_INFINITY, f64::max);
            let on_face = (nearest - shape.radius).abs() < 1e-12;
            let on_edge = edges.iter().any(|d| (d - shape.radius).abs() < 1e-12);
            assert!(on_face || on_edge, "{p:?}: {faces:?} {edges:?}");
            assert!(nearest < shape.radius + 1e-12);
        }
        let [lo, hi] = mesh.bounds();
        // The highest point of the sphere need not be a point of the mesh.
        let top = shape.centre[2] + shape.radius;
        assert!(lo[2] == 0.0 && hi[2] < top + 1e-12 && hi[2] > top - 2.0 * CHORD_TOLERANCE);
        // One edge of the foot lies along x at y < 0, the corner opposite on y > 0.
        assert!((lo[0] + hi[0]).abs() < 1e-12 && hi[1] > -lo[1]);
    }

    #[test]
    fn volume_is_that_of_the_pyramid_less_what_the_rounding_takes() {
        // Rounded by 0.1 mm: next to nothing.
        let sharp = tetrahedron(&regular("0.1 mm", "10 mm"));
        let whole = 3f64.sqrt() / 4.0 * 0.2f64.powi(2) * 0.163_299 / 3.0;
        assert!(
            (sharp.volume() / whole - 1.0).abs() < 1e-4,
            "{}",
            sharp.volume() / whole
        );
        // Per length of an edge the rounding takes r^2 (cot(d/2) - (pi - d)/2), d the angle between the faces.
        let round = tetrahedron(&regular("2 mm", "4 mm"));
        let between = (1.0f64 / 3.0).acos();
        let section = 2e-3f64.powi(2)
            * (1.0 / (0.5 * between).tan() - 0.5 * (std::f64::consts::PI - between));
        let taken = whole - round.volume();
        assert!(
            (taken / (3.0 * 0.2 * section) - 1.0).abs() < 0.02,
            "{taken}"
        );
    }
}
