//! The tool as the net sees it: a smooth surface laid over the facets, and its distance field.
//!
//! A net on the bare facets would find all curvature in their corners. So each facet carries a cubic patch
//! that meets the corners' normals, as a point-normal triangle (Vlachos, Peters, Boyd, Mitchell, Curved PN
//! Triangles, I3D 2001), written as a height over the facet. Sharp edges stay sharp.

use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{Vec3, add, cross, dot, norm, scale, sub, unit};
use plyflow_tooling::{SurfaceTree, ToolMesh};

/// A surface that a net is draped on.
pub trait DrapeSurface {
    /// Distance of `point` (m) from the surface at `offset` (m) over the tool, positive away from the tool,
    /// and the unit normal there. Exact in sign, and exact in value near zero. `None` where the tool ends.
    fn level(&self, point: Vec3, offset: f64) -> Option<(f64, Vec3)>;
}

/// What lies across an edge of a facet.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Across {
    /// The surface goes on smoothly in this facet.
    Smooth(u32),
    /// It goes on with a kink.
    Crease,
    /// It ends.
    Free,
}

#[derive(Debug, Clone)]
struct Patch {
    corners: [Vec3; 3],
    /// Unit normals of the smooth surface at the corners.
    normals: [Vec3; 3],
    face: Vec3,
    across: [Across; 3],
    /// Slopes of the height (m per edge) at the start and, rising towards the start, at the end of edge k from corner k
    /// to corner k + 1.
    slopes: [[f64; 2]; 3],
}

/// Facets of a tool with smooth patches over them.
#[derive(Debug, Clone)]
pub struct SmoothSurface {
    patches: Vec<Patch>,
    tree: SurfaceTree,
    /// Bound of the patches' heights (m).
    highest: f64,
}

impl SmoothSurface {
    /// Lays patches over the facets. Edges with more than `crease` (rad) between their facets stay sharp.
    /// `None` when no facet has an area.
    pub fn new(mesh: &ToolMesh, crease: f64) -> Option<Self> {
        let faces: Vec<Vec3> = (0..mesh.triangles.len())
            .map(|t| {
                let [a, b, c] = mesh.corners(t);
                unit(cross(sub(b, a), sub(c, a)))
            })
            .collect();
        if faces.iter().all(|n| *n == [0.0; 3]) {
            return None;
        }
        let across = edges(mesh, &faces, crease);
        let normals = corner_normals(mesh, &faces, &across);
        let patches: Vec<Patch> = (0..faces.len())
            .map(|t| {
                let corners = mesh.corners(t);
                Patch {
                    corners,
                    normals: normals[t],
                    face: faces[t],
                    across: across[t],
                    slopes: slopes(&corners, &normals[t], &across[t]),
                }
            })
            .collect();
        let highest = patches
            .iter()
            .flat_map(|p| p.slopes.as_flattened())
            .fold(0.0f64, |h, s| h.max(s.abs()));
        Some(Self {
            patches,
            tree: SurfaceTree::new(mesh),
            highest,
        })
    }

    /// How far (m) the smooth surface lies off the facets at most, of their middles and the middles of their edges, and where.
    pub fn smoothed_by(&self) -> (f64, Vec3) {
        const PLACES: [[f64; 3]; 4] = [
            [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0],
            [0.5, 0.5, 0.0],
            [0.0, 0.5, 0.5],
            [0.5, 0.0, 0.5],
        ];
        let mut most = (0.0, [0.0; 3]);
        for patch in self.patches.iter().filter(|p| p.face != [0.0; 3]) {
            for place in PLACES {
                let off = patch.height(place).abs();
                if off > most.0 {
                    let [a, b, c] = patch.corners;
                    let on = add(scale(a, place[0]), scale(b, place[1]));
                    most = (off, add(on, scale(c, place[2])));
                }
            }
        }
        most
    }

    /// Height (m) of the highest facet over (x, y) whose outside is up, with that facet's normal; `None` when there is none.
    pub fn top(&self, x: f64, y: f64) -> Option<(f64, Vec3)> {
        let mut best: Option<(f64, Vec3)> = None;
        for patch in self.patches.iter().filter(|p| p.face[2] > 0.0) {
            let [a, b, c] = patch.corners;
            let side = |p: Vec3, q: Vec3| (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]);
            let weights = [side(b, c), side(c, a), side(a, b)];
            if weights.iter().all(|w| *w >= 0.0) {
                let sum: f64 = weights.iter().sum();
                let z = (weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2]) / sum;
                if best.is_none_or(|(h, _)| z > h) {
                    best = Some((z, patch.face));
                }
            }
        }
        best
    }

    /// As [`DrapeSurface::level`], close to the surface: the point's place in the prism that the corners' normals
    /// span over a facet, walking from facet to facet. `Err(true)` where the surface ends, `Err(false)` where
    /// no prism holds the point (over a sharp edge).
    fn smooth(&self, x: Vec3, start: usize) -> Result<(f64, Vec3), bool> {
        /// How far outside a prism a point counts as in it, in weights.
        const SLACK: f64 = 1e-9;
        let mut at = start;
        for _ in 0..24 {
            let patch = &self.patches[at];
            let (weights, rise, normal) = patch.place(x).ok_or(false)?;
            let outside = (0..3).fold(0, |k, i| if weights[i] < weights[k] { i } else { k });
            if weights[outside] >= -SLACK {
                return Ok((rise - patch.height(weights), normal));
            }
            // The edge across from corner k is edge k + 1.
            match patch.across[(outside + 1) % 3] {
                Across::Smooth(next) => at = next as usize,
                Across::Crease => return Err(false),
                Across::Free => return Err(true),
            }
        }
        Err(false)
    }
}

impl DrapeSurface for SmoothSurface {
    fn level(&self, point: Vec3, offset: f64) -> Option<(f64, Vec3)> {
        let closest = self.tree.closest(point);
        let start = closest.triangle as usize;
        let flat = closest.signed_distance;
        // Away from the level the patches cannot change the sign.
        let near = (flat - offset).abs() <= 2.0 * self.highest + 0.1 * offset.abs() + 1e-9;
        let found = if near {
            self.smooth(point, start)
        } else {
            Err(false)
        };
        match found {
            Ok((distance, normal)) => Some((distance - offset, normal)),
            Err(true) => None,
            Err(false) => {
                let away = sub(point, closest.point);
                let normal = if flat.abs() > 1e-9 {
                    scale(away, 1.0 / flat)
                } else {
                    self.patches[start].face
                };
                Some((flat - offset, normal))
            }
        }
    }
}

impl Patch {
    /// Weights b of the corners, distance t and unit normal N with x = P(b) + t N(b), P and N linear between
    /// the corners: Newton's method from the foot on the facet's plane.
    fn place(&self, x: Vec3) -> Option<([f64; 3], f64, Vec3)> {
        let [p0, p1, p2] = self.corners;
        let [m0, m1, m2] = self.normals;
        let (u, v) = (sub(p1, p0), sub(p2, p0));
        let (mu, mv) = (sub(m1, m0), sub(m2, m0));
        let at = sub(x, p0);
        let mut t = dot(at, self.face);
        let (mut b, mut c) = (1.0 / 3.0, 1.0 / 3.0);
        for _ in 0..12 {
            let m = add(m0, add(scale(mu, b), scale(mv, c)));
            let r = sub(at, add(add(scale(u, b), scale(v, c)), scale(m, t)));
            let (du, dv) = (add(u, scale(mu, t)), add(v, scale(mv, t)));
            let (vm, mu_, uv) = (cross(dv, m), cross(m, du), cross(du, dv));
            let determinant = dot(du, vm);
            if determinant == 0.0 || !determinant.is_finite() {
                return None;
            }
            let step = [vm, mu_, uv].map(|k| dot(r, k) / determinant);
            b += step[0];
            c += step[1];
            t += step[2];
            if step[0].abs() + step[1].abs() < 1e-13 {
                break;
            }
            let away = b.abs() + c.abs();
            if away.is_nan() || away > 1e3 {
                return None;
            }
        }
        let m = add(m0, add(scale(mu, b), scale(mv, c)));
        let length = norm(m);
        (length > 0.5).then(|| ([1.0 - b - c, b, c], t * length, scale(m, 1.0 / length)))
    }

    /// Height (m) of the cubic patch over the facet: Bernstein form with zero corners, the edges' slopes
    /// and a middle that reproduces quadratics.
    fn height(&self, b: [f64; 3]) -> f64 {
        let mut h = 0.0;
        let mut sum = 0.0;
        for k in 0..3 {
            let (s, e) = (b[k], b[(k + 1) % 3]);
            let [start, end] = self.slopes[k];
            h += s * s * e * start + s * e * e * end;
            sum += start + end;
        }
        h + 0.5 * sum * b[0] * b[1] * b[2]
    }
}

/// What lies across every facet's edges.
fn edges(mesh: &ToolMesh, faces: &[Vec3], crease: f64) -> Vec<[Across; 3]> {
    let mut sides: Vec<(u32, u32, u32, usize)> = Vec::with_capacity(3 * faces.len());
    for (t, tri) in mesh.triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (tri[k], tri[(k + 1) % 3]);
            sides.push((a.min(b), a.max(b), t as u32, k));
        }
    }
    sides.sort_unstable();
    let mut across = vec![[Across::Crease; 3]; faces.len()];
    for group in sides.chunk_by(|p, q| (p.0, p.1) == (q.0, q.1)) {
        match *group {
            [(_, _, t, k)] => across[t as usize][k] = Across::Free,
            [(_, _, t, k), (_, _, o, l)] => {
                let (n, m) = (faces[t as usize], faces[o as usize]);
                let forward = |t: u32, k: usize| {
                    let tri = mesh.triangles[t as usize];
                    tri[k] < tri[(k + 1) % 3]
                };
                let flat = n == [0.0; 3] || m == [0.0; 3];
                let angle = norm(cross(n, m)).fixed_atan2(dot(n, m));
                if forward(t, k) != forward(o, l) && !flat && angle < crease {
                    across[t as usize][k] = Across::Smooth(o);
                    across[o as usize][l] = Across::Smooth(t);
                }
            }
            _ => {}
        }
    }
    across
}

/// Facets that hang together smoothly around a point.
struct Fan {
    /// Facet and which of its corners the point is.
    members: Vec<(usize, usize)>,
    /// Whether the fan ends at creases or free edges instead of closing on itself.
    open: bool,
}

fn fans(mesh: &ToolMesh, across: &[[Across; 3]]) -> Vec<Fan> {
    let mut around: Vec<(u32, usize, usize)> = Vec::with_capacity(3 * across.len());
    for (t, tri) in mesh.triangles.iter().enumerate() {
        around.extend((0..3).map(|k| (tri[k], t, k)));
    }
    around.sort_unstable();
    let mut found = Vec::new();
    for group in around.chunk_by(|p, q| p.0 == q.0) {
        let mut seen = vec![false; group.len()];
        for first in 0..group.len() {
            if std::mem::replace(&mut seen[first], true) {
                continue;
            }
            let mut fan = Fan {
                members: Vec::new(),
                open: false,
            };
            let mut waiting = vec![first];
            while let Some(g) = waiting.pop() {
                let (_, t, k) = group[g];
                fan.members.push((t, k));
                // The two edges at corner k.
                for edge in [k, (k + 2) % 3] {
                    let Across::Smooth(next) = across[t][edge] else {
                        fan.open = true;
                        continue;
                    };
                    let other = group.iter().position(|o| o.1 == next as usize);
                    if let Some(o) = other.filter(|o| !seen[*o]) {
                        seen[o] = true;
                        waiting.push(o);
                    }
                }
            }
            fan.members.sort_unstable();
            found.push(fan);
        }
    }
    found
}

/// Unit normals at the corners of each facet: over the facets that hang together smoothly around the corner, weighted by the
/// sine of the corner's angle over the lengths of its sides. That is exact when the points lie on a sphere
/// (N. Max, Weights for computing vertex normals from facet normals, J. Graphics Tools 4(2), 1999). Where the
/// fan ends at an edge of the surface it knows one side only; there the normals of its inner neighbours are carried on along
/// circular arcs.
fn corner_normals(mesh: &ToolMesh, faces: &[Vec3], across: &[[Across; 3]]) -> Vec<[Vec3; 3]> {
    let mut normals: Vec<[Vec3; 3]> = faces.iter().map(|n| [*n; 3]).collect();
    let mut open = vec![[false; 3]; faces.len()];
    let fans = fans(mesh, across);
    let set = |normals: &mut Vec<[Vec3; 3]>, fan: &Fan, sum: Vec3| {
        let normal = unit(sum);
        for &(t, k) in &fan.members {
            // A facet that stands nearly upright on its corner's normal has no height over itself.
            if dot(normal, faces[t]) > 0.5 {
                normals[t][k] = normal;
            }
        }
    };
    // The two sides of facet t at its corner k, and one over the squares of their lengths.
    let sides = |t: usize, k: usize| {
        let c = mesh.corners(t);
        let (u, v) = (sub(c[(k + 1) % 3], c[k]), sub(c[(k + 2) % 3], c[k]));
        let lengths = dot(u, u) * dot(v, v);
        (u, v, if lengths > 0.0 { 1.0 / lengths } else { 0.0 })
    };
    for fan in &fans {
        let sum = fan.members.iter().fold([0.0; 3], |sum, &(t, k)| {
            open[t][k] = fan.open;
            let (u, v, weight) = sides(t, k);
            add(sum, scale(cross(u, v), weight))
        });
        set(&mut normals, fan, sum);
    }
    let inner = normals.clone();
    for fan in fans.iter().filter(|f| f.open) {
        let mut sum = [0.0; 3];
        for &(t, k) in &fan.members {
            let (u, v, weight) = sides(t, k);
            for (j, e) in [((k + 1) % 3, unit(u)), ((k + 2) % 3, unit(v))] {
                if !open[t][j] {
                    let n = inner[t][j];
                    let mirrored = sub(n, scale(e, 2.0 * dot(n, e)));
                    sum = add(sum, scale(mirrored, weight * norm(cross(u, v))));
                }
            }
        }
        if sum != [0.0; 3] {
            set(&mut normals, fan, sum);
        }
    }
    normals
}

/// Slopes of the heights along the edges, from the normals at their ends. Where one end says flat and the
/// other curved (a fillet meets a plane there) the lesser counts: the plane must not bulge.
fn slopes(corners: &[Vec3; 3], normals: &[Vec3; 3], across: &[Across; 3]) -> [[f64; 2]; 3] {
    /// Largest ratio of the slopes at both ends that one cubic arch without inflection can have.
    const ARCH: f64 = 2.0;
    std::array::from_fn(|k| {
        if across[k] == Across::Crease {
            return [0.0; 2];
        }
        let e = sub(corners[(k + 1) % 3], corners[k]);
        let start = -dot(e, normals[k]);
        let end = dot(e, normals[(k + 1) % 3]);
        if start * end <= 0.0 {
            return [0.0; 2];
        }
        let bound = ARCH * start.abs().min(end.abs());
        [start.clamp(-bound, bound), end.clamp(-bound, bound)]
    })
}
