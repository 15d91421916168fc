//! Triangles and quads twice as large as the elements: cells of a grid well inside, Delaunay triangles from there to the edge,
//! merged in pairs to quads where they make good ones.

use crate::edge::{Curve, Stop};
use crate::error::MeshError;
use plyflow_fixed::FixedBits;
use plyflow_model::outline::{Millimetres, Point, Region, cross, segment_distance, winds};
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};
use std::collections::{BTreeMap, BTreeSet};

/// Grid points keep this distance from the edge, over the coarse spacing: the edges of the grid's cells are then Delaunay
/// edges, and what remains between them and the edge is neither flat nor high.
const CLEARANCE: f64 = 0.6;
/// Two triangles make a quad when the sines of its angles are at least this.
const MERGE_JACOBIAN: f64 = 0.45;
/// The same where a node has more cells around it than [`MOST_CELLS`].
const CROWDED_JACOBIAN: f64 = 0.1;
/// An inner node should not have more cells around it: the patch of a rotation-free shell holds the nodes of five.
const MOST_CELLS: usize = 5;

/// A node on a contour.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OnEdge {
    /// Number of the contour.
    pub contour: usize,
    /// Where on it.
    pub stop: Stop,
}

/// The coarse mesh.
#[derive(Debug, Clone, Default)]
pub struct Coarse {
    /// `[n]` (m).
    pub points: Vec<Point>,
    /// `[n]` where those on the edge lie.
    pub on_edge: Vec<Option<OnEdge>>,
    /// Triangles and quads, counter-clockwise.
    pub polygons: Vec<Vec<u32>>,
    /// Of each polygon: whether it is a cell of the grid.
    pub regular: Vec<bool>,
    /// Sides on the edge (nodes in increasing order): the middle between their ends along the contour.
    pub edge_middles: BTreeMap<(u32, u32), OnEdge>,
}

/// An edge, nodes in increasing order.
pub fn key(a: u32, b: u32) -> (u32, u32) {
    (a.min(b), a.max(b))
}

/// Spacings of the grid in x and y (m): near `spacing`, a whole number to the box around the region.
pub fn grid_spacings(region: &Region, spacing: f64) -> [f64; 2] {
    let b = region.bounds();
    [0, 1].map(|k| {
        let extent = b[k + 2] - b[k];
        extent / (extent / spacing).round().max(1.0)
    })
}

/// Meshes a region at a spacing (m).
///
/// # Errors
/// When the sides between the stops of its contours cross.
pub fn coarse_mesh(region: &Region, curves: &[Curve], spacing: f64) -> Result<Coarse, MeshError> {
    let mut mesh = Coarse::default();
    let rings = stops(&mut mesh, curves, spacing);
    let grid = grid_points(&mut mesh, region, &rings, spacing);
    let mut triangles = triangulate(&mesh, &rings, &grid, spacing)?;
    improve_ears(&mesh, curves, &mut triangles);
    merge(&mut mesh, curves, &triangles, &grid);
    Ok(mesh)
}

/// Nodes on the contours; the nodes of each in order.
fn stops(mesh: &mut Coarse, curves: &[Curve], spacing: f64) -> Vec<Vec<u32>> {
    let mut rings = Vec::new();
    for (contour, curve) in curves.iter().enumerate() {
        let stops = curve.stops(spacing);
        let first = mesh.points.len() as u32;
        let n = stops.len();
        for (k, stop) in stops.iter().enumerate() {
            mesh.points.push(curve.point(stop.at));
            mesh.on_edge.push(Some(OnEdge {
                contour,
                stop: *stop,
            }));
            let last = k + 1 == n;
            let to = if last {
                stops[0].at + curve.length()
            } else {
                stops[k + 1].at
            };
            let middle = 0.5 * (stop.at + to);
            let soft = curve.nearest_corner(middle);
            let pinned = (soft - middle).abs() < 0.125 * (to - stop.at);
            let at = curve.wrapped(if pinned { soft } else { middle });
            let next = if last { first } else { first + k as u32 + 1 };
            let stop = Stop { at, pinned };
            mesh.edge_middles
                .insert(key(first + k as u32, next), OnEdge { contour, stop });
        }
        rings.push((first..first + n as u32).collect());
    }
    rings
}

/// Grid points well inside, and the cells between them.
struct Grid {
    numbers: BTreeMap<[i64; 2], u32>,
    cells: Vec<[u32; 4]>,
}

fn grid_points(mesh: &mut Coarse, region: &Region, rings: &[Vec<u32>], spacing: f64) -> Grid {
    let b = region.bounds();
    let h = grid_spacings(region, spacing);
    let count = [0, 1].map(|k| ((b[k + 2] - b[k]) / h[k]).round() as i64);
    let sides: Vec<(Point, Point)> = rings
        .iter()
        .flat_map(|r| {
            (0..r.len()).map(|k| {
                (
                    mesh.points[r[k] as usize],
                    mesh.points[r[(k + 1) % r.len()] as usize],
                )
            })
        })
        .collect();
    let clear = CLEARANCE * h[0].min(h[1]) * (1.0 - 1e-9);
    let free = |p: Point| {
        region.contains(p)
            && sides
                .iter()
                .all(|(a, b)| segment_distance(p, *a, *b) >= clear)
            && region.distance_to_edge(p) >= clear
    };
    let at = |i: f64, j: f64| [b[0] + h[0] * i, b[1] + h[1] * j];
    let mut numbers = BTreeMap::new();
    for j in 1..count[1] {
        for i in 1..count[0] {
            let p = at(i as f64, j as f64);
            if free(p) {
                numbers.insert([j, i], mesh.points.len() as u32);
                mesh.points.push(p);
                mesh.on_edge.push(None);
            }
        }
    }
    let mut cells = Vec::new();
    for [j, i] in numbers.keys() {
        let corners = [[*j, *i], [*j, i + 1], [j + 1, i + 1], [j + 1, *i]];
        let found: Vec<u32> = corners
            .iter()
            .filter_map(|k| numbers.get(k).copied())
            .collect();
        // A narrow slit may end between four points that are clear of it.
        if found.len() == 4 && free(at(*i as f64 + 0.5, *j as f64 + 0.5)) {
            cells.push([found[0], found[1], found[2], found[3]]);
        }
    }
    Grid { numbers, cells }
}

/// A Delaunay triangulation of the nodes that keeps the contours and the sides of the grid's cells.
fn constrained(
    mesh: &Coarse,
    rings: &[Vec<u32>],
    grid: &Grid,
    spacing: f64,
) -> Result<ConstrainedDelaunayTriangulation<Point2<f64>>, MeshError> {
    let fail = |n: u32, why| MeshError::Coarse {
        size: 0.5e3 * spacing,
        at: Millimetres(mesh.points[n as usize]),
        why,
    };
    let mut cdt = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
    let mut handles = Vec::with_capacity(mesh.points.len());
    for (n, p) in mesh.points.iter().enumerate() {
        let handle = cdt
            .insert(Point2::new(p[0], p[1]))
            .map_err(|_| fail(n as u32, "a point cannot be placed"))?;
        if handle.index() != n {
            return Err(fail(n as u32, "two nodes fall together"));
        }
        handles.push(handle);
    }
    let mut fix = |a: u32, b: u32| {
        let (p, q) = (handles[a as usize], handles[b as usize]);
        if !cdt.can_add_constraint(p, q) {
            return Err(fail(a, "two of its sides cross"));
        }
        cdt.add_constraint(p, q);
        Ok(())
    };
    for ring in rings {
        for k in 0..ring.len() {
            fix(ring[k], ring[(k + 1) % ring.len()])?;
        }
    }
    for c in &grid.cells {
        for k in 0..4 {
            fix(c[k], c[(k + 1) % 4])?;
        }
    }
    Ok(cdt)
}

/// Constrained Delaunay triangles inside the region, counter-clockwise.
fn triangulate(
    mesh: &Coarse,
    rings: &[Vec<u32>],
    grid: &Grid,
    spacing: f64,
) -> Result<Vec<[u32; 3]>, MeshError> {
    let cdt = constrained(mesh, rings, grid, spacing)?;
    let contours: Vec<Vec<Point>> = rings
        .iter()
        .map(|r| r.iter().map(|n| mesh.points[*n as usize]).collect())
        .collect();
    let mut triangles = Vec::new();
    for face in cdt.inner_faces() {
        let t = face.vertices().map(|v| v.fix().index() as u32);
        let p = t.map(|n| mesh.points[n as usize]);
        let middle = [0, 1].map(|k| (p[0][k] + p[1][k] + p[2][k]) / 3.0);
        let inside = contours
            .iter()
            .fold(false, |odd, c| odd != winds(c, middle));
        // Nodes on a slanted side lie on one line but for rounding: beside it there are triangles without area.
        if inside && cross(p[0], p[1], p[2]) > 1e-6 * spacing * spacing {
            let first = (0..3).min_by_key(|k| t[*k]).unwrap_or(0);
            triangles.push([t[first], t[(first + 1) % 3], t[(first + 2) % 3]]);
        }
    }
    triangles.sort_unstable();
    Ok(triangles)
}

/// The triangles on both sides of every edge.
fn sides_of(triangles: &[[u32; 3]]) -> BTreeMap<(u32, u32), Vec<usize>> {
    let mut edges: BTreeMap<(u32, u32), Vec<usize>> = BTreeMap::new();
    for (k, t) in triangles.iter().enumerate() {
        for e in 0..3 {
            edges.entry(key(t[e], t[(e + 1) % 3])).or_default().push(k);
        }
    }
    edges
}

/// The corner of a triangle that is not on an edge, and that edge in the triangle's sense.
fn opposite(t: [u32; 3], edge: (u32, u32)) -> (u32, [u32; 2]) {
    let k = (0..3)
        .find(|k| t[*k] != edge.0 && t[*k] != edge.1)
        .unwrap_or(0);
    (t[k], [t[(k + 1) % 3], t[(k + 2) % 3]])
}

/// The least number of cells that the angle at a node needs.
fn least_cells(mesh: &Coarse, curves: &[Curve], n: usize) -> usize {
    let Some(on) = mesh.on_edge[n] else { return 3 };
    let degrees = curves[on.contour].angle(on.stop.at).to_degrees();
    [130.0, 215.0, 305.0]
        .iter()
        .filter(|limit| degrees > **limit)
        .count()
        + 1
}

/// Where the edge is nearly straight at a node of a single triangle, turns that triangle's far side so that it has two.
fn improve_ears(mesh: &Coarse, curves: &[Curve], triangles: &mut [[u32; 3]]) {
    let mut around = vec![0usize; mesh.points.len()];
    for n in triangles.iter().flatten() {
        around[*n as usize] += 1;
    }
    let edges = sides_of(triangles);
    let mut changed = BTreeSet::new();
    for pair in edges.iter().filter(|(_, t)| t.len() == 2) {
        let (edge, [s, t]) = (*pair.0, [pair.1[0], pair.1[1]]);
        if changed.contains(&s) || changed.contains(&t) {
            continue;
        }
        let ((c, [a, b]), (d, _)) = (opposite(triangles[s], edge), opposite(triangles[t], edge));
        let ear = |n: u32| around[n as usize] == 1 && least_cells(mesh, curves, n as usize) > 1;
        if !ear(c) && !ear(d) {
            continue;
        }
        let x = |n: u32| mesh.points[n as usize];
        if cross(x(c), x(a), x(d)) > 0.0 && cross(x(d), x(b), x(c)) > 0.0 {
            triangles[s] = [c, a, d];
            triangles[t] = [d, b, c];
            changed.extend([s, t]);
        }
    }
}

/// Least sine of the angles of a quad; negative for one that is not convex.
fn least_sine(p: [Point; 4]) -> f64 {
    let sine = |k: usize| {
        let (a, b, c) = (p[k], p[(k + 1) % 4], p[(k + 3) % 4]);
        let long = |q: Point| (q[0] - a[0]).fixed_hypot(q[1] - a[1]);
        cross(a, b, c) / (long(b) * long(c))
    };
    (0..4).map(sine).fold(f64::INFINITY, f64::min)
}

/// Two triangles that would make a quad.
struct Pair {
    /// Least sine of its angles.
    sine: f64,
    /// Their common side.
    edge: (u32, u32),
    quad: [u32; 4],
    triangles: [usize; 2],
}

/// Merges pairs of triangles that are not `used`: the best pair first, after those that relieve a crowded node. `around`: how many cells a
/// node has, which stay at least `least_cells`.
fn merge_best_first(
    mesh: &mut Coarse,
    mut candidates: Vec<Pair>,
    used: &mut [bool],
    around: &mut [usize],
    least_cells: &[usize],
) {
    loop {
        let enough = |n: u32| around[n as usize] > least_cells[n as usize];
        let crowded =
            |n: u32| mesh.on_edge[n as usize].is_none() && around[n as usize] > MOST_CELLS;
        let worth = |c: &Pair| {
            let [a, b] = [c.edge.0, c.edge.1];
            let relief = f64::from(u8::from(crowded(a))) + f64::from(u8::from(crowded(b)));
            let free = c.triangles.iter().all(|t| !used[*t]) && enough(a) && enough(b);
            let sound = c.sine
                >= if relief > 0.0 {
                    CROWDED_JACOBIAN
                } else {
                    MERGE_JACOBIAN
                };
            (free && sound).then_some(c.sine + relief)
        };
        candidates.retain(|c| c.triangles.iter().all(|t| !used[*t]));
        let valued = candidates.iter().filter_map(|c| worth(c).map(|w| (w, c)));
        // The first of equals.
        let Some((_, best)) = valued.reduce(|a, b| if b.0 > a.0 { b } else { a }) else {
            break;
        };
        best.triangles.iter().for_each(|t| used[*t] = true);
        around[best.edge.0 as usize] -= 1;
        around[best.edge.1 as usize] -= 1;
        mesh.polygons.push(best.quad.to_vec());
        mesh.regular.push(false);
    }
}

/// Grid cells, then the best pairs of triangles as quads, then what is left as triangles. A pair is merged only where the nodes
/// of their common side keep as many cells as they need.
fn merge(mesh: &mut Coarse, curves: &[Curve], triangles: &[[u32; 3]], grid: &Grid) {
    let cells: BTreeMap<[u32; 4], usize> = grid
        .cells
        .iter()
        .enumerate()
        .map(|(k, c)| {
            let mut sorted = *c;
            sorted.sort_unstable();
            (sorted, k)
        })
        .collect();
    debug_assert!(grid.numbers.len() >= cells.len());
    let mut used = vec![false; triangles.len()];
    let mut around = vec![0usize; mesh.points.len()];
    for n in triangles.iter().flatten() {
        around[*n as usize] += 1;
    }
    let mut candidates = Vec::new();
    let least_cells: Vec<usize> = (0..mesh.points.len())
        .map(|n| least_cells(mesh, curves, n))
        .collect();
    for (edge, sides) in sides_of(triangles) {
        let &[s, t] = &sides[..] else { continue };
        let ((c, [a, b]), (d, _)) = (opposite(triangles[s], edge), opposite(triangles[t], edge));
        let quad = [c, a, d, b];
        let mut sorted = quad;
        sorted.sort_unstable();
        if let Some(k) = cells.get(&sorted) {
            mesh.polygons.push(grid.cells[*k].to_vec());
            mesh.regular.push(true);
            (used[s], used[t]) = (true, true);
            around[a as usize] -= 1;
            around[b as usize] -= 1;
        } else {
            let sine = least_sine(quad.map(|n| mesh.points[n as usize]));
            if sine >= CROWDED_JACOBIAN {
                candidates.push(Pair {
                    sine,
                    edge,
                    quad,
                    triangles: [s, t],
                });
            }
        }
    }
    merge_best_first(mesh, candidates, &mut used, &mut around, &least_cells);
    for (t, _) in triangles.iter().zip(&used).filter(|(_, used)| !**used) {
        mesh.polygons.push(t.to_vec());
        mesh.regular.push(false);
    }
}
