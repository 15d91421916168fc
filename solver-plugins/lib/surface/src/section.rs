//! Where vertical planes and curtains cut a triangulated surface.

use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{Vec3, add, distance, scale, sub};
use std::collections::BTreeMap;

/// Ends of lines that lie within this of each other (m) are one place.
const SAME: f64 = 1e-9;

/// A place on a section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SectionPoint {
    /// Along the path (m).
    pub station: f64,
    /// On the surface (m).
    pub place: Vec3,
}

/// The lines in which the vertical plane through `from` and `to` (x, y in m) cuts the triangles, as far as they lie between the two. A
/// line is ordered; lines come with the longest first, and each begins at its end nearer to `from`.
pub fn plane_section(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    from: [f64; 2],
    to: [f64; 2],
) -> Vec<Vec<Vec3>> {
    let path = [from, to];
    let lines = path_section(points, points, triangles, &path, &stations(&path));
    (lines.into_iter())
        .map(|line| line.into_iter().map(|p| p.place).collect())
        .collect()
}

/// Lengths along a path to each of its corners (m), 0 at the first.
pub fn stations(path: &[[f64; 2]]) -> Vec<f64> {
    let mut gone = 0.0;
    let sides = path.windows(2).map(|w| {
        gone += (w[1][0] - w[0][0]).fixed_hypot(w[1][1] - w[0][1]);
        gone
    });
    path.iter()
        .take(1)
        .map(|_| 0.0)
        .chain(sides.collect::<Vec<_>>())
        .collect()
}

/// The lines in which the curtain that hangs on a path cuts a surface, in pieces of a straight plane each.
///
/// - `plan` (`[nodes]`, m): coordinates whose x and y the path is given in. The points themselves: a section as seen from above, which also
///   follows walls and overhangs. The places in the flat ply: a line of the material, wherever it went.
/// - `points` (`[nodes]`, m): where the nodes lie.
/// - `path`: its corners (x, y in m); sides without a length are passed over.
/// - `stations`: as many, not falling: what the places along it are told by ([`stations`], or others).
///
/// A line is ordered, and begins at its end of the lower station; the longest lines come first. Lines end where the surface or the path
/// does. A path that crosses itself is cut in each of its passes.
pub fn path_section(
    plan: &[Vec3],
    points: &[Vec3],
    triangles: &[[u32; 3]],
    path: &[[f64; 2]],
    stations: &[f64],
) -> Vec<Vec<SectionPoint>> {
    let mut places: BTreeMap<Key, SectionPoint> = BTreeMap::new();
    let mut next: BTreeMap<Key, Vec<Key>> = BTreeMap::new();
    for k in 1..path.len() {
        let Some(side) = Side::new(
            k - 1,
            [path[k - 1], path[k]],
            [stations[k - 1], stations[k]],
        ) else {
            continue;
        };
        for (t, triangle) in triangles.iter().enumerate() {
            let Some(piece) = side.cut(plan, points, t, *triangle) else {
                continue;
            };
            let [(a, p), (b, q)] = piece;
            if a == b || distance(p.place, q.place) <= 1e-3 * SAME {
                continue;
            }
            places.insert(a, p);
            places.insert(b, q);
            next.entry(a).or_default().push(b);
            next.entry(b).or_default().push(a);
        }
    }
    let mut lines = merged(joined(&places, &next));
    for line in &mut lines {
        if line[0].station > line[line.len() - 1].station {
            line.reverse();
        }
    }
    let length = |line: &[SectionPoint]| -> f64 {
        (line.windows(2))
            .map(|w| distance(w[0].place, w[1].place))
            .sum()
    };
    lines.sort_by(|a, b| length(b).total_cmp(&length(a)));
    lines
}

/// What a place of a section lies on: the same for both pieces that meet there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Key {
    /// An edge of the surface, its lower and its higher node, cut by a side of the path.
    Edge(u32, u32, usize),
    /// A triangle, pierced by the vertical line through a corner of the path.
    Corner(usize, usize),
}

/// A side of a path.
struct Side {
    number: usize,
    from: [f64; 2],
    axis: [f64; 2],
    length: f64,
    stations: [f64; 2],
}

impl Side {
    /// `None` when it has no length.
    fn new(number: usize, [from, to]: [[f64; 2]; 2], stations: [f64; 2]) -> Option<Self> {
        let along = [to[0] - from[0], to[1] - from[1]];
        let length = along[0].fixed_hypot(along[1]);
        (length > 0.0).then(|| Self {
            number,
            from,
            axis: along.map(|a| a / length),
            length,
            stations,
        })
    }

    fn along(&self, p: Vec3) -> f64 {
        self.axis[0] * (p[0] - self.from[0]) + self.axis[1] * (p[1] - self.from[1])
    }

    fn off(&self, p: Vec3) -> f64 {
        let side = self.axis[0] * (p[1] - self.from[1]) - self.axis[1] * (p[0] - self.from[0]);
        // A node on the plane counts as above it: so every triangle is cut in two edges or in none.
        if side == 0.0 { f64::MIN_POSITIVE } else { side }
    }

    /// The piece of a triangle that lies on it.
    fn cut(
        &self,
        plan: &[Vec3],
        points: &[Vec3],
        number: usize,
        t: [u32; 3],
    ) -> Option<[(Key, SectionPoint); 2]> {
        let off = t.map(|i| self.off(plan[i as usize]));
        let along = t.map(|i| self.along(plan[i as usize]));
        let beyond = |out: fn(f64, f64) -> bool, bound| along.iter().all(|a| out(*a, bound));
        if beyond(|a, b| a < b, 0.0) || beyond(|a, b| a > b, self.length) {
            return None;
        }
        // Key, distance along the side, place.
        let mut crossed: Vec<(Key, f64, Vec3)> = Vec::new();
        for k in 0..3 {
            // The same numbers from both sides of an edge: it is cut from its lower node on.
            let (i, j) = (k, (k + 1) % 3);
            let (i, j) = if t[i] < t[j] { (i, j) } else { (j, i) };
            if (off[i] > 0.0) != (off[j] > 0.0) {
                let share = off[i] / (off[i] - off[j]);
                let (p, q) = (points[t[i] as usize], points[t[j] as usize]);
                crossed.push((
                    Key::Edge(t[i], t[j], self.number),
                    along[i] + share * (along[j] - along[i]),
                    add(p, scale(sub(q, p), share)),
                ));
            }
        }
        let [mut a, mut b] = crossed[..] else {
            return None;
        };
        if a.1 > b.1 {
            std::mem::swap(&mut a, &mut b);
        }
        if b.1 < 0.0 || a.1 > self.length {
            return None;
        }
        // What reaches beyond a corner of the path ends there.
        let at = |s: f64| add(a.2, scale(sub(b.2, a.2), (s - a.1) / (b.1 - a.1)));
        let (first, last) = (
            (Key::Corner(self.number, number), 0.0, at(0.0)),
            (
                Key::Corner(self.number + 1, number),
                self.length,
                at(self.length),
            ),
        );
        let [low, high] = self.stations;
        let told = |(key, s, place): (Key, f64, Vec3)| {
            let station = low + (high - low) * s / self.length;
            (key, SectionPoint { station, place })
        };
        Some([
            told(if a.1 < 0.0 { first } else { a }),
            told(if b.1 > self.length { last } else { b }),
        ])
    }
}

/// The lines of two places or more through what is cut: where, and what each is joined with.
fn joined(
    places: &BTreeMap<Key, SectionPoint>,
    next: &BTreeMap<Key, Vec<Key>>,
) -> Vec<Vec<SectionPoint>> {
    let mut lines = Vec::new();
    // Open lines from their ends first, then what is closed.
    let ends = next.iter().filter(|(_, n)| n.len() == 1).map(|(e, _)| *e);
    let starts: Vec<Key> = ends.chain(next.keys().copied()).collect();
    let mut seen = std::collections::BTreeSet::new();
    for start in starts {
        let mut line = Vec::new();
        let mut at = Some(start);
        while let Some(key) = at.filter(|e| seen.insert(*e)) {
            line.push(places[&key]);
            at = next[&key].iter().copied().find(|e| !seen.contains(e));
        }
        if line.len() > 1 {
            lines.push(line);
        }
    }
    lines
}

/// Lines whose ends are one place are one line: a corner of the path may lie on an edge of the surface or on a node.
fn merged(mut lines: Vec<Vec<SectionPoint>>) -> Vec<Vec<SectionPoint>> {
    let meet = |a: &SectionPoint, b: &SectionPoint| {
        (a.station - b.station).abs() <= SAME && distance(a.place, b.place) <= SAME
    };
    let mut done: Vec<Vec<SectionPoint>> = Vec::new();
    while let Some(mut line) = lines.pop() {
        let with = |other: &Vec<SectionPoint>| {
            let ends = [other[0], other[other.len() - 1]];
            let own = [line[0], line[line.len() - 1]];
            ends.iter().any(|e| own.iter().any(|o| meet(e, o)))
        };
        let Some(k) = lines.iter().position(with) else {
            done.push(line);
            continue;
        };
        let mut other = lines.swap_remove(k);
        let last = line[line.len() - 1];
        if !meet(&last, &other[0]) && !meet(&last, &other[other.len() - 1]) {
            line.reverse();
        }
        if !meet(&line[line.len() - 1], &other[0]) {
            other.reverse();
        }
        line.extend(other.into_iter().skip(1));
        lines.push(line);
    }
    done
}

/// Length of a line through points (m).
pub fn line_length(line: &[Vec3]) -> f64 {
    line.windows(2).map(|w| distance(w[0], w[1])).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_follows_the_surface_also_where_it_stands_upright_or_is_parted() {
        // A step of 1 between two levels, the wall upright, and a level beside it that does not join.
        let profile = [
            [0.0, 0.0],
            [1.0, 0.0],
            [1.0, 1.0],
            [2.0, 1.0],
            [3.0, 5.0],
            [3.5, 5.0],
        ];
        let points: Vec<Vec3> = profile
            .iter()
            .flat_map(|p| [[p[0], -1.0, p[1]], [p[0], 1.0, p[1]]])
            .collect();
        let quads = [0u32, 1, 2, 4].map(|i| [2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1]);
        let triangles: Vec<[u32; 3]> = quads
            .iter()
            .flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]])
            .collect();
        let lines = plane_section(&points, &triangles, [-1.0, 0.2], [5.0, 0.2]);
        assert_eq!(lines.len(), 2);
        assert!((line_length(&lines[0]) - 3.0).abs() < 1e-12);
        assert!((line_length(&lines[1]) - 0.5).abs() < 1e-12);
        assert!(plyflow_geometry::vec3::distance(lines[0][0], [0.0, 0.2, 0.0]) < 1e-12);
        // Through nodes, backwards, and cut short.
        let lines = plane_section(&points, &triangles, [5.0, -1.0], [-1.0, -1.0]);
        assert_eq!(lines.len(), 2);
        assert!(plyflow_geometry::vec3::distance(lines[0][0], [2.0, -1.0, 1.0]) < 1e-12);
        assert!(plane_section(&points, &triangles, [9.0, 0.0], [10.0, 0.0]).is_empty());
    }

    /// Triangles over a lattice of `n` by `n` nodes, each at f(u, v) for u and v from -1 to 1.
    fn lattice(n: usize, f: impl Fn(f64, f64) -> Vec3) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let at = |k: usize| 2.0 * k as f64 / (n - 1) as f64 - 1.0;
        let points = (0..n * n).map(|k| f(at(k % n), at(k / n))).collect();
        let node = |i: usize, j: usize| (j * n + i) as u32;
        let mut triangles = Vec::new();
        for (i, j) in (0..(n - 1) * (n - 1)).map(|k| (k % (n - 1), k / (n - 1))) {
            let quad = [
                node(i, j),
                node(i + 1, j),
                node(i + 1, j + 1),
                node(i, j + 1),
            ];
            triangles.extend([[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]);
        }
        (points, triangles)
    }

    /// A circle about a place in `pieces` straight sides, from the angle 0.3 rad on so that no corner lies on a line of the mesh.
    fn circle(centre: [f64; 2], r: f64, turn: f64, pieces: usize) -> Vec<[f64; 2]> {
        (0..=pieces)
            .map(|k| 0.3 + turn * k as f64 / pieces as f64)
            .map(|a| [centre[0] + r * a.cos(), centre[1] + r * a.sin()])
            .collect()
    }

    #[test]
    fn a_curtain_along_an_arc_over_a_sphere_stands_at_one_height_whatever_its_pieces() {
        // A sphere of 100 mm; the arc is 60 mm from its axis, at a height of 80 mm.
        let dome = |u: f64, v: f64| {
            let (x, y) = (0.07 * u, 0.07 * v);
            [x, y, (0.01 - x * x - y * y).sqrt()]
        };
        let (points, triangles) = lattice(81, dome);
        // Pieces longer and shorter than the 1.75 mm of the mesh.
        for pieces in [40, 1000] {
            let path = circle([0.0; 2], 0.060, 3.0, pieces);
            let stations = stations(&path);
            let lines = path_section(&points, &points, &triangles, &path, &stations);
            assert_eq!(lines.len(), 1, "{pieces}");
            let line = &lines[0];
            let (first, last) = (line[0], line[line.len() - 1]);
            assert!(first.station.abs() < 1e-12);
            assert!(
                (last.station - stations[pieces]).abs() < 1e-12,
                "it reaches its end"
            );
            assert!((last.station - 0.18).abs() < 2e-4);
            assert!(line.windows(2).all(|w| w[0].station <= w[1].station));
            // Chords of the path lie within the circle by r (1 - cos): higher by 3/4 of that; facets lie below by up to h^2 / (4 R).
            let chord = 0.060 * (1.0 - (1.5 / pieces as f64).cos());
            for p in line {
                let off = p.place[2] - 0.080;
                assert!((-2e-5..1e-5 + chord).contains(&off), "{pieces}: {off}");
            }
        }
    }

    #[test]
    fn a_line_of_the_material_is_followed_to_where_a_cylinder_took_it() {
        // A flat sheet of 160 mm by 160 mm, wound about a cylinder of 50 mm: the sides hang under it.
        let (flat, triangles) = lattice(161, |u, v| [0.08 * u, 0.08 * v, 0.0]);
        let wound = |p: &Vec3| {
            let a = p[0] / 0.05;
            [0.05 * a.sin(), p[1], 0.05 * a.cos()]
        };
        let points: Vec<Vec3> = flat.iter().map(wound).collect();
        let path = circle([0.01, 0.02], 0.05, 6.0, 700);
        let lines = path_section(&flat, &points, &triangles, &path, &stations(&path));
        assert_eq!(lines.len(), 1);
        for p in &lines[0] {
            let a = 0.3 + p.station / 0.05;
            let at = wound(&[0.01 + 0.05 * a.cos(), 0.02 + 0.05 * a.sin(), 0.0]);
            let off = plyflow_geometry::vec3::distance(p.place, at);
            assert!(off < 1e-5, "{off} m at {}", p.station);
        }
    }

    #[test]
    fn corners_on_nodes_and_edges_do_not_part_a_line() {
        let (points, triangles) = lattice(5, |u, v| [u, v, 0.5 * u]);
        // Nodes, the middle of an edge, a side along the mesh, a step back, and an end beyond the surface.
        let path = [
            [-1.0, -1.0],
            [0.0, 0.0],
            [0.25, 0.0],
            [0.25, 0.0],
            [0.5, 0.5],
            [0.5, 5.0],
        ];
        let along = stations(&path);
        assert_eq!(along[2], along[3]);
        let lines = path_section(&points, &points, &triangles, &path, &along);
        assert_eq!(lines.len(), 1, "{lines:?}");
        let line = &lines[0];
        let last = line[line.len() - 1];
        assert!((last.station - (along[4] + 0.5)).abs() < 1e-12);
        assert!(
            line.iter()
                .all(|p| (p.place[2] - 0.5 * p.place[0]).abs() < 1e-12)
        );
        assert!(stations(&[]).is_empty());
        assert!(path_section(&points, &points, &triangles, &path[..1], &along).is_empty());
    }
}
