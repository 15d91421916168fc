//! From the facets of a file to a surface: equal corners become one point, seams are closed, and no facet is without area.
//!
//! All of it takes n log n at most, whichever way the facets lie.

use plyflow_geometry::vec3::{Vec3, cross, norm, sub};
use rstar::primitives::GeomWithData;
use rstar::{AABB, RTree};
use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashMap, HashSet};

/// Points closer than this part of the diagonal of the box around all of them are one.
pub const WELD: f64 = 1e-6;

/// Facets that share their points.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Surface {
    /// Positions, in the order in which the file names them first.
    pub points: Vec<Vec3>,
    /// Indices into `points`.
    pub triangles: Vec<[u32; 3]>,
    /// For each triangle the facet of the file of which it is, or is a part.
    pub facet: Vec<u32>,
}

/// Joins facets to a surface. Points nearer to each other than [`WELD`] of the diagonal are one. Facets that lose a corner by that are left out, as are those
/// that are there already, wound alike. Facets that are no higher than that though they have three corners (programs write them where the one side of
/// a seam has a point that the other has not) take the point on their longest side into the facet beyond it: nothing moves by more than that
/// part of the diagonal, and what they joined stays joined. At seams where such facets are missing, points on the free edge of a facet part it too.
pub fn join(corners: &[[Vec3; 3]]) -> Surface {
    let (points, of_corner, near) = weld(corners.as_flattened());
    let mut surface = Surface {
        points,
        ..Surface::default()
    };
    let mut seen = HashSet::with_capacity(corners.len());
    for (facet, t) in of_corner.as_chunks::<3>().0.iter().enumerate() {
        let [a, b, c] = *t;
        // The same corners in the same sense, from whichever the facet begins.
        let from_least = match a.min(b).min(c) {
            l if l == a => [a, b, c],
            l if l == b => [b, c, a],
            _ => [c, a, b],
        };
        if a != b && b != c && c != a && seen.insert(from_least) {
            surface.triangles.push(*t);
            surface.facet.push(facet as u32);
        }
    }
    surface.take_flat_ones_in(near);
    // A facet with two seams is parted at one of them each time.
    for _ in 0..3 {
        if !surface.part_at_seams(near) {
            break;
        }
    }
    surface
}

/// The places of corners, those within reach of an earlier one left out; the place that each corner takes; and the reach.
fn weld(corners: &[Vec3]) -> (Vec<Vec3>, Vec<u32>, f64) {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in corners {
        for d in 0..3 {
            low[d] = low[d].min(p[d]);
            high[d] = high[d].max(p[d]);
        }
    }
    let diagonal = norm(sub(high, low));
    let near = if corners.is_empty() {
        0.0
    } else {
        WELD * diagonal
    };
    // Boxes of some reaches' width: within one there is room for a limited number of points, however many corners there are.
    let width = if near > 0.0 { 8.0 * near } else { 1.0 };
    let of = |v: f64, d: usize| ((v - low[d]) / width).floor() as i32;
    let mut boxes: HashMap<[i32; 3], Vec<u32>> = HashMap::new();
    let mut equal: HashMap<[u64; 3], u32> = HashMap::new();
    let mut points: Vec<Vec3> = Vec::new();
    let places = corners.iter().map(|p| {
        // Adding zero turns -0 into 0.
        let p = p.map(|c| c + 0.0);
        *equal.entry(p.map(f64::to_bits)).or_insert_with(|| {
            let [from, to] = [-near, near].map(|r| [0, 1, 2].map(|d| of(p[d] + r, d)));
            let mut found: Option<u32> = None;
            for x in from[0]..=to[0] {
                for y in from[1]..=to[1] {
                    for z in from[2]..=to[2] {
                        for &q in boxes.get(&[x, y, z]).map_or(&[][..], |b| b) {
                            if norm(sub(points[q as usize], p)) <= near {
                                found = Some(found.map_or(q, |f| f.min(q)));
                            }
                        }
                    }
                }
            }
            found.unwrap_or_else(|| {
                let own = points.len() as u32;
                boxes
                    .entry([0, 1, 2].map(|d| of(p[d], d)))
                    .or_default()
                    .push(own);
                points.push(p);
                own
            })
        })
    });
    let places = places.collect();
    (points, places, near)
}

/// A facet without height, by the length of its longest side.
#[derive(PartialEq)]
struct Flat {
    longest: f64,
    triangle: usize,
    corners: [u32; 3],
}

impl Eq for Flat {}

impl Ord for Flat {
    fn cmp(&self, other: &Self) -> Ordering {
        let by_length = self.longest.total_cmp(&other.longest);
        by_length.then(other.triangle.cmp(&self.triangle))
    }
}

impl PartialOrd for Flat {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// The sides of a triangle, in its sense.
fn sides([a, b, c]: [u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

/// Owner of a side that no triangle has, and of one that several have.
const NONE: usize = usize::MAX;
const MANY: usize = usize::MAX - 1;

/// Takes the sides from a triangle that has them alone.
fn leave(at: &mut HashMap<[u32; 2], usize>, corners: [u32; 3], owner: usize) {
    for side in sides(corners) {
        if at.get(&side) == Some(&owner) {
            at.insert(side, NONE);
        }
    }
}

impl Surface {
    fn corners(&self, [a, b, c]: [u32; 3]) -> [Vec3; 3] {
        [a, b, c].map(|p| self.points[p as usize])
    }

    /// A triangle as one without height, if it is one.
    fn flat(&self, triangle: usize, near: f64) -> Option<Flat> {
        let corners = self.triangles[triangle];
        let [p, q, r] = self.corners(corners);
        let (u, v) = (sub(q, p), sub(r, p));
        let longest = norm(u).max(norm(v)).max(norm(sub(r, q)));
        (norm(cross(u, v)) <= near * longest).then_some(Flat {
            longest,
            triangle,
            corners,
        })
    }

    /// Which side of a triangle is the longest: the first of equals.
    fn longest_side(&self, corners: [u32; 3]) -> usize {
        let length = |[a, b]: [u32; 2]| norm(sub(self.points[b as usize], self.points[a as usize]));
        (0..3).fold(0, |k, j| {
            match length(sides(corners)[j]) > length(sides(corners)[k]) {
                true => j,
                false => k,
            }
        })
    }

    /// The longest first, so that what is made of the facet beyond is shorter: it comes to an end.
    fn take_flat_ones_in(&mut self, near: f64) {
        let mut heap: BinaryHeap<Flat> = (0..self.triangles.len())
            .filter_map(|t| self.flat(t, near))
            .collect();
        if heap.is_empty() {
            return;
        }
        let mut at: HashMap<[u32; 2], usize> = HashMap::with_capacity(3 * self.triangles.len());
        for (t, corners) in self.triangles.iter().enumerate() {
            for side in sides(*corners) {
                at.entry(side).and_modify(|k| *k = MANY).or_insert(t);
            }
        }
        let mut gone = vec![false; self.triangles.len()];
        while let Some(Flat {
            triangle, corners, ..
        }) = heap.pop()
        {
            if gone[triangle] || self.triangles[triangle] != corners {
                continue;
            }
            gone[triangle] = true;
            leave(&mut at, corners, triangle);
            let k = self.longest_side(corners);
            let ([a, b], middle) = (sides(corners)[k], corners[(k + 2) % 3]);
            // The facet beyond, which passes the side from b to a.
            let beyond = at.get(&[b, a]).copied().filter(|&g| g < MANY && !gone[g]);
            let Some(g) = beyond else { continue };
            let old = self.triangles[g];
            let Some(&far) = old.iter().find(|&&p| p != a && p != b) else {
                continue;
            };
            leave(&mut at, old, g);
            gone[g] = true;
            if far == middle {
                continue;
            }
            for part in [[b, middle, far], [middle, a, far]] {
                let t = self.triangles.len();
                self.triangles.push(part);
                self.facet.push(self.facet[g]);
                gone.push(false);
                for side in sides(part) {
                    let taken = at.entry(side).or_insert(NONE);
                    *taken = if *taken == NONE { t } else { MANY };
                }
                heap.extend(self.flat(t, near));
            }
        }
        self.keep(|t| !gone[t]);
    }

    /// Keeps some triangles, in the order of the file.
    fn keep(&mut self, kept: impl Fn(usize) -> bool) {
        let mut order: Vec<usize> = (0..self.triangles.len()).filter(|t| kept(*t)).collect();
        order.sort_by_key(|&t| (self.facet[t], t));
        self.triangles = order.iter().map(|&t| self.triangles[t]).collect();
        self.facet = order.iter().map(|&t| self.facet[t]).collect();
    }

    /// Parts facets at points of free edges that lie on a free edge of theirs. Returns whether there were any.
    fn part_at_seams(&mut self, near: f64) -> bool {
        let mut all: Vec<([u32; 2], usize, usize)> = (self.triangles.iter().enumerate())
            .flat_map(|(t, corners)| {
                let sides = sides(*corners).map(|[a, b]| [a.min(b), a.max(b)]);
                [0, 1, 2].map(|k| (sides[k], t, k))
            })
            .collect();
        all.sort_unstable();
        let alone = |group: &[([u32; 2], usize, usize)]| (group.len() == 1).then(|| group[0]);
        let free: Vec<([u32; 2], usize, usize)> =
            all.chunk_by(|p, q| p.0 == q.0).filter_map(alone).collect();
        if free.is_empty() {
            return false;
        }
        let mut ends: Vec<u32> = free.iter().flat_map(|f| f.0).collect();
        ends.sort_unstable();
        ends.dedup();
        let place = |p: u32| self.points[p as usize];
        let tree = RTree::bulk_load(
            ends.iter()
                .map(|&p| GeomWithData::new(place(p), p))
                .collect(),
        );
        // By facet: its side, and the points on it with how far along they are.
        let mut parted: HashMap<usize, (usize, Vec<(f64, u32)>)> = HashMap::new();
        for &([..], t, k) in &free {
            let [a, b] = sides(self.triangles[t])[k];
            let (p, q) = (place(a), place(b));
            let along = sub(q, p);
            let length = norm(along);
            let reach = |sign: f64, pick: fn(f64, f64) -> f64| {
                [0, 1, 2].map(|d| pick(p[d], q[d]) + sign * near)
            };
            let bounds = AABB::from_corners(reach(-1.0, f64::min), reach(1.0, f64::max));
            let mut on: Vec<(f64, u32)> = tree
                .locate_in_envelope(&bounds)
                .filter(|m| m.data != a && m.data != b)
                .filter_map(|m| {
                    let from = sub(*m.geom(), p);
                    let share = (0..3).map(|d| from[d] * along[d]).sum::<f64>() / (length * length);
                    let off = norm(cross(along, from)) / length;
                    (off <= near && share > 0.0 && share < 1.0).then_some((share, m.data))
                })
                .collect();
            if !on.is_empty() {
                on.sort_by(|x, y| x.0.total_cmp(&y.0).then(x.1.cmp(&y.1)));
                parted.entry(t).or_insert((k, on));
            }
        }
        for t in 0..self.triangles.len() {
            let Some((k, on)) = parted.remove(&t) else {
                continue;
            };
            self.part(t, k, on.iter().map(|m| m.1));
        }
        let any = self.triangles.len() > all.len() / 3;
        self.keep(|_| true);
        any
    }

    /// Parts the triangle `t` at the points `on` its side `k`, in their order along it.
    fn part(&mut self, t: usize, k: usize, on: impl Iterator<Item = u32>) {
        let corners = self.triangles[t];
        let ([a, b], far) = (sides(corners)[k], corners[(k + 2) % 3]);
        let stops: Vec<u32> = [a].into_iter().chain(on).chain([b]).collect();
        self.triangles[t] = [stops[0], stops[1], far];
        for pair in stops[1..].windows(2) {
            self.triangles.push([pair[0], pair[1], far]);
            self.facet.push(self.facet[t]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::ToolMesh;

    /// A box whose faces are cut into squares of two facets.
    fn cut_box(size: Vec3, cuts: [usize; 3], turn: usize) -> Vec<[Vec3; 3]> {
        let mut facets = Vec::new();
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            for top in [false, true] {
                for i in 0..cuts[u] {
                    for j in 0..cuts[v] {
                        let at = |i: usize, j: usize| {
                            let mut p = [0.0; 3];
                            p[(axis + turn) % 3] = if top { size[axis] } else { 0.0 };
                            p[(u + turn) % 3] = size[u] * i as f64 / cuts[u] as f64;
                            p[(v + turn) % 3] = size[v] * j as f64 / cuts[v] as f64;
                            p
                        };
                        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                        facets.extend(match top {
                            true => [[a, b, c], [a, c, d]],
                            false => [[a, c, b], [a, d, c]],
                        });
                    }
                }
            }
        }
        facets
    }

    fn mesh(surface: &Surface) -> ToolMesh {
        ToolMesh {
            points: surface.points.clone(),
            triangles: surface.triangles.clone(),
        }
    }

    #[test]
    fn work_does_not_depend_on_how_the_tool_lies() {
        // Compared are the points looked at: none more than those of some boxes.
        for turn in 0..3 {
            let facets = cut_box([1.0, 0.5, 0.25], [1, 200, 100], turn);
            let found = join(&facets);
            assert_eq!(found.points.len(), 2 * (201 * 101));
            // The sides are not cut as finely: they are parted at the points of the others.
            assert!(mesh(&found).is_watertight());
            assert!((mesh(&found).volume() - 0.125).abs() < 1e-12);
            let all = cut_box([1.0, 0.5, 0.25], [2, 100, 50], turn);
            assert!(mesh(&join(&all)).is_watertight());
        }
    }

    #[test]
    fn facets_without_height_keep_the_surface_closed() {
        let cube = cut_box([40.0, 40.0, 30.0], [1, 1, 1], 0);
        for facet in 0..cube.len() {
            for shift in [0.0, 1e-7, -1e-7] {
                let [a, b, c] = cube[facet];
                let mut middle: Vec3 = [0, 1, 2].map(|d| 0.5 * (a[d] + b[d]));
                middle.iter_mut().for_each(|m| *m += shift);
                let third: Vec3 = [0, 1, 2].map(|d| a[d] + (b[d] - a[d]) / 3.0);
                let mut facets = cube.clone();
                facets.remove(facet);
                facets.extend([[a, middle, c], [middle, b, c]]);
                // Where the neighbour is not parted: one flat facet, or two, of which the one lies on the other.
                let mut once = facets.clone();
                once.push([a, b, middle]);
                let mut twice = facets.clone();
                twice.extend([[a, third, middle], [a, b, third], [third, b, middle]]);
                for with in [once, twice, facets] {
                    let found = join(&with);
                    let mesh = mesh(&found);
                    assert!(mesh.is_watertight(), "facet {facet}, shift {shift}");
                    assert!((mesh.volume() - 48_000.0).abs() < 1e-2, "{}", mesh.volume());
                    assert!(found.triangles.len() == 14 || found.triangles.len() == 16);
                    let high = (0..mesh.triangles.len()).all(|t| norm(mesh.area_normal(t)) > 1.0);
                    assert!(high, "no facet is without area");
                    assert_eq!(found.facet.len(), found.triangles.len());
                }
            }
        }
    }

    #[test]
    fn repeated_facets_count_once_and_those_wound_against_each_other_stay() {
        let cube = cut_box([1.0; 3], [1; 3], 0);
        let [a, b, c] = cube[5];
        let mut again = cube.clone();
        again.extend([[b, c, a], cube[2]]);
        assert_eq!(join(&again), join(&cube));
        again.push([b, a, c]);
        assert_eq!(join(&again).triangles.len(), cube.len() + 1);
    }

    #[test]
    fn a_heap_of_equal_points_is_one_point() {
        // As many as would take a day if each were compared with each.
        let dust = |k: usize| [1e-9 * (k % 977) as f64, 1e-9 * (k % 331) as f64, 0.0];
        let mut facets: Vec<[Vec3; 3]> = (0..300_000)
            .map(|k| [dust(k), dust(3 * k), dust(7 * k)])
            .collect();
        facets.push([[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        let found = join(&facets);
        assert_eq!((found.points.len(), found.triangles.len()), (3, 1));
        assert_eq!(found.facet, [300_000]);
    }
}
