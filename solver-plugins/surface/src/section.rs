//! Where a vertical plane cuts a triangulated surface.

use crate::vector::{Vec3, add, scale, sub};
use std::collections::BTreeMap;

/// The lines in which the vertical plane through `from` and `to` (x, y in m) cuts the triangles, as far as they lie between the two. A
/// line is ordered; lines come with the longest first, and each begins at its end nearer to `from`.
pub fn plane_section(
    points: &[Vec3],
    triangles: &[[u32; 3]],
    from: [f64; 2],
    to: [f64; 2],
) -> Vec<Vec<Vec3>> {
    let along = [to[0] - from[0], to[1] - from[1]];
    let length = along[0].hypot(along[1]);
    if length <= 0.0 {
        return Vec::new();
    }
    let axis = along.map(|a| a / length);
    let off = |p: Vec3| {
        let side = axis[0] * (p[1] - from[1]) - axis[1] * (p[0] - from[0]);
        // A node on the plane counts as above it: so every triangle is cut in two edges or in none.
        if side == 0.0 { f64::MIN_POSITIVE } else { side }
    };
    let station = |p: &Vec3| axis[0] * (p[0] - from[0]) + axis[1] * (p[1] - from[1]);
    let mut places: BTreeMap<Edge, Vec3> = BTreeMap::new();
    let mut next: BTreeMap<Edge, Vec<Edge>> = BTreeMap::new();
    for t in triangles {
        let mut crossed = Vec::new();
        for k in 0..3 {
            let (a, b) = (t[k].min(t[(k + 1) % 3]), t[k].max(t[(k + 1) % 3]));
            let (p, q) = (points[a as usize], points[b as usize]);
            let (d, e) = (off(p), off(q));
            if (d > 0.0) != (e > 0.0) {
                let place = add(p, scale(sub(q, p), d / (d - e)));
                places.insert((a, b), place);
                crossed.push((a, b));
            }
        }
        if let [a, b] = crossed[..] {
            let within = |e: &Edge| (0.0..=length).contains(&station(&places[e]));
            if within(&a) && within(&b) {
                next.entry(a).or_default().push(b);
                next.entry(b).or_default().push(a);
            }
        }
    }
    let mut lines = joined(&places, &next);
    for line in &mut lines {
        if station(&line[0]) > station(&line[line.len() - 1]) {
            line.reverse();
        }
    }
    lines.sort_by(|a, b| line_length(b).total_cmp(&line_length(a)));
    lines
}

/// An edge of the surface: its lower and its higher node.
type Edge = (u32, u32);

/// The lines of two places or more through cut edges: where each is cut, and the edges that it is joined with.
fn joined(places: &BTreeMap<Edge, Vec3>, next: &BTreeMap<Edge, Vec<Edge>>) -> Vec<Vec<Vec3>> {
    let mut lines = Vec::new();
    // Open lines from their ends first, then what is closed.
    let ends = next.iter().filter(|(_, n)| n.len() == 1).map(|(e, _)| *e);
    let starts: Vec<Edge> = ends.chain(next.keys().copied()).collect();
    let mut seen = std::collections::BTreeSet::new();
    for start in starts {
        let mut line = Vec::new();
        let mut at = Some(start);
        while let Some(edge) = at.filter(|e| seen.insert(*e)) {
            line.push(places[&edge]);
            at = next[&edge].iter().copied().find(|e| !seen.contains(e));
        }
        if line.len() > 1 {
            lines.push(line);
        }
    }
    lines
}

/// Length of a line through points (m).
pub fn line_length(line: &[Vec3]) -> f64 {
    line.windows(2)
        .map(|w| crate::vector::distance(w[0], w[1]))
        .sum()
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
        assert!(crate::vector::distance(lines[0][0], [0.0, 0.2, 0.0]) < 1e-12);
        // Through nodes, backwards, and cut short.
        let lines = plane_section(&points, &triangles, [5.0, -1.0], [-1.0, -1.0]);
        assert_eq!(lines.len(), 2);
        assert!(crate::vector::distance(lines[0][0], [2.0, -1.0, 1.0]) < 1e-12);
        assert!(plane_section(&points, &triangles, [9.0, 0.0], [10.0, 0.0]).is_empty());
    }
}
