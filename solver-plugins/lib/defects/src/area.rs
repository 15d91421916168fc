//! Areas of defects, to the line at which the ply comes back to the tool.

use crate::ply::Ply;
use nalgebra::{Matrix3, Vector3};
use plyflow_geometry::vec3::{Vec3, add, cross, dot, norm, scale, sub};

/// Of no set.
pub(crate) const NONE: usize = usize::MAX;

/// Area of a set of nodes in the undeformed ply.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Extent {
    /// (m2).
    pub(crate) area: f64,
    /// Its first moment (m3).
    pub(crate) moment: Vec3,
}

impl Extent {
    pub(crate) fn centre(&self) -> [f64; 2] {
        [0, 1].map(|k| self.moment[k] / self.area)
    }

    fn add_triangle(&mut self, [a, b, c]: [Vec3; 3]) {
        let area = 0.5 * norm(cross(sub(b, a), sub(c, a)));
        self.area += area;
        self.moment = add(self.moment, scale(add(add(a, b), c), area / 3.0));
    }
}

/// How often the triangles between the middle of a cell and its sides are halved.
const HALVINGS: usize = 3;

/// Directions that the neighbours of a node span by less than this, of the sum of squares of their cosines, are none of the ply's.
const FLAT: f64 = 0.05;

/// Height over the threshold at a place of the undeformed ply.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    place: Vec3,
    /// (m).
    height: f64,
    /// Its gradient in the ply.
    slope: Vec3,
}

impl Sample {
    pub(crate) fn height(&self) -> f64 {
        self.height
    }

    /// Half way to another, on the cubic that has both heights and slopes.
    pub(crate) fn half_way(&self, to: &Self) -> Self {
        let way = sub(to.place, self.place);
        let slope = scale(add(self.slope, to.slope), 0.5);
        let rise = to.height - self.height;
        let steeper = 1.5 * (rise - dot(slope, way)) / dot(way, way);
        Self {
            place: scale(add(self.place, to.place), 0.5),
            height: 0.5 * (self.height + to.height) + 0.125 * dot(sub(self.slope, to.slope), way),
            slope: add(slope, scale(way, steeper)),
        }
    }

    /// In the middle of a cell; as it is for quadratic functions.
    fn middle(corners: &[Self]) -> Self {
        let share = 1.0 / corners.len() as f64;
        let mean = |of: fn(&Self) -> Vec3| {
            scale(corners.iter().fold([0.0; 3], |s, c| add(s, of(c))), share)
        };
        let place = mean(|c| c.place);
        let height = |c: &Self| c.height + 0.5 * dot(c.slope, sub(place, c.place));
        Self {
            place,
            height: share * corners.iter().map(height).sum::<f64>(),
            slope: mean(|c| c.slope),
        }
    }
}

/// What of the ply belongs to each of `count` sets of nodes that stand off the tool by more than `threshold` (m). `set`: `[nodes]` the set
/// of a node or [`NONE`]; `judged`: `[nodes]` whether it may belong to one.
///
/// A set ends where the distance is the threshold: whole cells of nodes would jump by a share of a cell with each node. Between nodes the
/// distance is cubic, by slopes from their neighbours: chords would cut a quarter off a strip as wide as a cell. Between sets, and towards
/// nodes that are not judged, the bound is half way.
pub(crate) fn extents(
    ply: &Ply,
    set: &[usize],
    judged: &[bool],
    threshold: f64,
    count: usize,
) -> Vec<Extent> {
    let mut all = vec![Extent::default(); count];
    let of = |n: u32| set[n as usize];
    for c in 0..ply.topology.cells() {
        let cell = ply.topology.cell(c);
        if cell.iter().all(|n| of(*n) == NONE) {
            continue;
        }
        let corners: Vec<Sample> = cell
            .iter()
            .map(|&n| sample(ply, n as usize, threshold))
            .collect();
        let centre = Sample::middle(&corners);
        let highest = (0..cell.len())
            .filter(|&i| of(cell[i]) != NONE)
            .max_by(|&i, &j| corners[i].height.total_cmp(&corners[j].height));
        for (i, &a) in cell.iter().enumerate() {
            for j in [(i + 1) % cell.len(), (i + cell.len() - 1) % cell.len()] {
                // The part of the corner a beside the side to b. Where a does not stand off, what does belongs to whom it comes from.
                let owner = match (of(a), of(cell[j])) {
                    (NONE, _) if !judged[a as usize] => continue,
                    (NONE, NONE) => highest.map_or(NONE, |n| of(cell[n])),
                    (NONE, other) => other,
                    (own, _) => own,
                };
                let side = corners[i].half_way(&corners[j]);
                add_positive(&mut all[owner], &[corners[i], side, centre], HALVINGS);
            }
        }
    }
    all
}

/// At a node, with the slope that fits its neighbours best.
pub(crate) fn sample(ply: &Ply, node: usize, threshold: f64) -> Sample {
    let place = ply.undeformed[node];
    let value = ply.distance[node].value;
    let (mut spread, mut rise) = (Matrix3::zeros(), Vector3::zeros());
    for &n in ply.topology.edge_neighbours(node) {
        let way = Vector3::from(sub(ply.undeformed[n as usize], place));
        let square = way.norm_squared();
        if square > 0.0 {
            spread += way * way.transpose() / square;
            rise += way * (ply.distance[n as usize].value - value) / square;
        }
    }
    let slope = spread
        .pseudo_inverse(FLAT)
        .map_or([0.0; 3], |i| (i * rise).into());
    Sample {
        place,
        height: value - threshold,
        slope,
    }
}

/// Adds that part of a triangle that is higher than the threshold.
fn add_positive(to: &mut Extent, corners: &[Sample; 3], halvings: usize) {
    let [a, b, c] = corners;
    if halvings == 0 {
        add_positive_part(to, [a, b, c].map(|s| (s.place, s.height)));
        return;
    }
    let [ab, bc, ca] = [a.half_way(b), b.half_way(c), c.half_way(a)];
    for part in [[*a, ab, ca], [ab, *b, bc], [ca, bc, *c], [ab, bc, ca]] {
        add_positive(to, &part, halvings - 1);
    }
}

/// Adds that part of a triangle in which a linear function with these values at its corners is positive.
fn add_positive_part(to: &mut Extent, corners: [(Vec3, f64); 3]) {
    let mut part = [[0.0; 3]; 4];
    let mut n = 0;
    for k in 0..3 {
        let ((p, f), (q, g)) = (corners[k], corners[(k + 1) % 3]);
        if f > 0.0 {
            part[n] = p;
            n += 1;
        }
        if (f > 0.0) != (g > 0.0) {
            part[n] = add(p, scale(sub(q, p), f / (f - g)));
            n += 1;
        }
    }
    for k in 2..n {
        to.add_triangle([part[0], part[k - 1], part[k]]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plyflow_surface::{NodalDistance, Topology};

    /// Four by one cells of 1 m whose nodes stand off by these distances (m), the same on both sides.
    fn strip(distance: [f64; 5]) -> Ply {
        let points: Vec<Vec3> = (0..10)
            .map(|i| [f64::from(i % 5), f64::from(i / 5), 0.0])
            .collect();
        let cells: Vec<u32> = (0..4).flat_map(|i| [i, i + 1, i + 6, i + 5]).collect();
        let at = |i: usize| NodalDistance {
            value: distance[i % 5],
            judged: true,
            triangle: 0,
        };
        Ply {
            name: "strip".into(),
            topology: Topology::new(10, 4, &cells),
            undeformed: points.clone(),
            formed: points,
            shear_angle: Vec::new(),
            fibre_strain: Vec::new(),
            fibre_strains: [Vec::new(), Vec::new()],
            distance: (0..10).map(at).collect(),
            curvature: Vec::new(),
            tool_crest: Vec::new(),
        }
    }

    fn areas(distance: [f64; 5], set: [usize; 5], judged: [bool; 5]) -> Vec<f64> {
        let (set, judged): (Vec<_>, Vec<_>) = (0..10).map(|i| (set[i % 5], judged[i % 5])).unzip();
        let found = extents(&strip(distance), &set, &judged, 1.0, 2);
        found.iter().map(|e| e.area).collect()
    }

    #[test]
    fn sets_end_half_way_to_each_other_and_at_the_threshold_elsewhere() {
        let all = [true; 5];
        let near = |a: Vec<f64>, b: [f64; 2]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        // All stand off: nodes' shares, wherever the border is.
        assert!(near(areas([2.0; 5], [0, 0, 1, 1, 1], all), [1.5, 2.5]));
        // Falls to the threshold three quarters of a cell beyond the last node: also the share of the next one counts.
        let falling = [3.75, 2.75, 1.75, 0.75, -0.25];
        let set = [0, 0, 0, NONE, NONE];
        assert!(near(areas(falling, set, all), [2.75, 0.0]));
        // But not where that one is not judged.
        let judged = [true, true, true, false, false];
        assert!(near(areas(falling, set, judged), [2.5, 0.0]));
    }

    #[test]
    fn the_positive_part_of_a_triangle_ends_where_the_function_is_zero() {
        let corner = |x: f64, y: f64, f: f64| ([x, y, 0.0], f);
        let part = |f: [f64; 3]| {
            let mut e = Extent::default();
            let corners = [
                corner(0.0, 0.0, f[0]),
                corner(2.0, 0.0, f[1]),
                corner(0.0, 1.0, f[2]),
            ];
            add_positive_part(&mut e, corners);
            (e.area, e.moment)
        };
        assert_eq!(part([1.0, 2.0, 3.0]).0, 1.0);
        assert_eq!(part([-1.0, 0.0, -3.0]).0, 0.0);
        // Half of each side from the one corner that is positive: a quarter, and its own centre.
        let (area, moment) = part([-1.0, 1.0, -1.0]);
        assert!((area - 0.25).abs() < 1e-15);
        assert!(
            (moment[0] / area - 4.0 / 3.0).abs() < 1e-12
                && (moment[1] / area - 1.0 / 6.0).abs() < 1e-12
        );
        // And all but that.
        assert!((part([1.0, -1.0, 1.0]).0 - 0.75).abs() < 1e-15);
    }
}
