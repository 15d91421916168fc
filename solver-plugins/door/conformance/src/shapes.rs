//! Elements and patches to try a formulation on: skewed, stretched, small, large, tilted in space, with any
//! direction of the material axes.

use crate::linear::{Vec3, cross, dot};
use crate::linear::{rotation, turn};
use crate::sequence::Sequence;
use plyflow_fixed::FixedBits;

/// Elements side by side, one in each lane.
#[derive(Clone)]
pub(crate) struct Elements {
    pub(crate) lanes: usize,
    pub(crate) nodes: usize,
    /// `[nodes][3][lanes]` (m).
    pub(crate) reference: Vec<f64>,
    /// `[3][lanes]`.
    pub(crate) axis: Vec<f64>,
    /// `[lanes]` root of the area (m).
    pub(crate) size: Vec<f64>,
}

impl Elements {
    /// Plane convex elements of 2 to 12 mm, stretched up to 1 : 6, skewed, their plane tilted by up to half a
    /// radian, e1 anywhere in it.
    pub(crate) fn new(nodes: usize, lanes: usize, seed: u64) -> Self {
        let mut s = Sequence(seed);
        let mut new = Self {
            lanes,
            nodes,
            reference: vec![0.0; 3 * nodes * lanes],
            axis: vec![0.0; 3 * lanes],
            size: vec![0.0; lanes],
        };
        let square = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]];
        let triangle = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        for l in 0..lanes {
            // Lane 0 is the plain square of 5 mm that is easiest to follow by hand.
            let plain = l == 0;
            let size = 5e-3 * 10f64.fixed_powf(if plain { 0.0 } else { s.between(-0.4, 0.4) });
            let stretch = if plain { 1.0 } else { s.between(1.0, 6.0) }.sqrt();
            let skew = if plain { 0.0 } else { 0.6 * s.next() };
            let noise = if plain { 0.0 } else { 0.12 };
            let q = rotation([0.3 * s.next(), 0.3 * s.next(), 3.0 * s.next()]);
            let mut corners = [[0.0; 3]; 4];
            for (k, corner) in corners.iter_mut().enumerate().take(nodes) {
                let p = if nodes == 3 { triangle[k] } else { square[k] };
                let p = [p[0] + noise * s.next(), p[1] + noise * s.next()];
                let flat = [(p[0] + skew * p[1]) * stretch, p[1] / stretch, 0.0];
                *corner = turn(&q, flat.map(|x| x * size));
            }
            let angle = s.between(-3.1, 3.1);
            let e1 = turn(&q, [angle.fixed_cos(), angle.fixed_sin(), 0.0]);
            for k in 0..nodes {
                for c in 0..3 {
                    new.reference[(3 * k + c) * lanes + l] = corners[k][c];
                }
            }
            for c in 0..3 {
                new.axis[c * lanes + l] = e1[c];
            }
            new.size[l] = new.area(l).sqrt();
        }
        new
    }

    /// A node of a lane in `[nodes][3][lanes]`.
    pub(crate) fn node(&self, x: &[f64], k: usize, l: usize) -> Vec3 {
        std::array::from_fn(|c| x[(3 * k + c) * self.lanes + l])
    }

    /// Undeformed area of a lane's plane element (m2).
    pub(crate) fn area(&self, l: usize) -> f64 {
        let x: Vec<Vec3> = (0..self.nodes)
            .map(|k| self.node(&self.reference, k, l))
            .collect();
        let mut twice = [0.0; 3];
        for k in 0..self.nodes {
            let c = cross(x[k], x[(k + 1) % self.nodes]);
            twice = std::array::from_fn(|i| twice[i] + c[i]);
        }
        0.5 * dot(twice, twice).sqrt()
    }

    /// Positions after a random homogeneous deformation of about `strain` (also out of the plane) and a
    /// quarter of that as noise of each node, over the element's size.
    pub(crate) fn deformed(&self, strain: f64, seed: u64) -> Vec<f64> {
        let mut s = Sequence(seed);
        let mut x = self.reference.clone();
        for l in 0..self.lanes {
            let gradient: [Vec3; 3] = std::array::from_fn(|_| std::array::from_fn(|_| s.next()));
            for k in 0..self.nodes {
                let p = self.node(&self.reference, k, l);
                for c in 0..3 {
                    let by = strain * (dot(gradient[c], p) + 0.25 * self.size[l] * s.next());
                    x[(3 * k + c) * self.lanes + l] += by;
                }
            }
        }
        x
    }

    /// The same lanes in another order and number: lane `l` is lane `order[l]` of this set.
    pub(crate) fn picked(&self, order: &[usize]) -> Self {
        Self {
            lanes: order.len(),
            nodes: self.nodes,
            reference: pick(&self.reference, self.lanes, order),
            axis: pick(&self.axis, self.lanes, order),
            size: pick(&self.size, self.lanes, order),
        }
    }
}

/// Rows of `lanes` values in another order and number.
pub(crate) fn pick(rows: &[f64], lanes: usize, order: &[usize]) -> Vec<f64> {
    rows.chunks_exact(lanes)
        .flat_map(|row| order.iter().map(|l| row[*l]))
        .collect()
}

/// Every row of vectors `[n][3][lanes]` turned and shifted.
pub(crate) fn moved(x: &[f64], lanes: usize, q: &[Vec3; 3], shift: Vec3) -> Vec<f64> {
    let mut to = vec![0.0; x.len()];
    for k in 0..x.len() / (3 * lanes) {
        for l in 0..lanes {
            let v = turn(q, std::array::from_fn(|c| x[(3 * k + c) * lanes + l]));
            for c in 0..3 {
                to[(3 * k + c) * lanes + l] = v[c] + shift[c];
            }
        }
    }
    to
}

/// Patches side by side: a node and the others of the elements around it.
#[derive(Clone)]
pub(crate) struct Patches {
    pub(crate) lanes: usize,
    pub(crate) slots: usize,
    /// `[slots][3][lanes]` (m), centre first; unused slots repeat the centre.
    pub(crate) reference: Vec<f64>,
    /// `[lanes]`
    pub(crate) count: Vec<f64>,
    /// `[lanes]` (m2)
    pub(crate) area: Vec<f64>,
    /// `[3][lanes]`
    pub(crate) axis: Vec<f64>,
}

impl Patches {
    /// Three, four and five quads (or five to seven triangles) around a node, irregular, 2 to 12 mm; as many
    /// of them as fit into `slots`. The undeformed planes are tilted, their normal points upwards.
    pub(crate) fn new(nodes: usize, slots: usize, lanes: usize, seed: u64) -> Option<Self> {
        let mut s = Sequence(seed);
        let kinds: Vec<usize> = if nodes == 4 {
            vec![4, 3, 5]
        } else {
            vec![6, 5, 7]
        };
        let used = |around: usize| 1 + around * (nodes - 2);
        let kinds: Vec<usize> = kinds.into_iter().filter(|k| used(*k) <= slots).collect();
        if kinds.is_empty() {
            return None;
        }
        let mut new = Self {
            lanes,
            slots,
            reference: vec![0.0; 3 * slots * lanes],
            count: vec![0.0; lanes],
            area: vec![0.0; lanes],
            axis: vec![0.0; 3 * lanes],
        };
        for l in 0..lanes {
            let around = kinds[l % kinds.len()];
            let size = 5e-3 * 10f64.fixed_powf(s.between(-0.4, 0.4));
            let q = rotation([0.3 * s.next(), 0.3 * s.next(), 0.0]);
            let stretch = s.between(1.0, 2.0).sqrt();
            let centre = [size * s.next(), size * s.next(), 0.0];
            let spokes = around * (nodes - 2);
            for k in 0..slots {
                let mut p = centre;
                if k > 0 && k <= spokes {
                    let angle =
                        ((k - 1) as f64 + 0.2 * s.next()) * std::f64::consts::TAU / spokes as f64;
                    let corner = nodes == 4 && k % 2 == 0;
                    let r = size * if corner { 1.4 } else { 1.0 } * (1.0 + 0.15 * s.next());
                    p[0] += stretch * r * angle.fixed_cos();
                    p[1] += r * angle.fixed_sin() / stretch;
                }
                let p = turn(&q, p);
                for c in 0..3 {
                    new.reference[(3 * k + c) * lanes + l] = p[c];
                }
            }
            let angle = s.between(-3.1, 3.1);
            let e1 = turn(&q, [angle.fixed_cos(), angle.fixed_sin(), 0.0]);
            for c in 0..3 {
                new.axis[c * lanes + l] = e1[c];
            }
            new.count[l] = (1 + spokes) as f64;
            new.area[l] = size * size;
        }
        Some(new)
    }

    /// Positions bent to curvatures of up to `1 / (10 size)`, with 1 % of membrane strain. Unused slots stay
    /// on the centre.
    pub(crate) fn bent(&self, seed: u64) -> Vec<f64> {
        let mut s = Sequence(seed);
        let n = self.lanes;
        let mut x = self.reference.clone();
        for l in 0..n {
            let size = self.area[l].sqrt();
            let at =
                |k: usize| -> Vec3 { std::array::from_fn(|c| self.reference[(3 * k + c) * n + l]) };
            let centre = at(0);
            let curvature = [s.next(), s.next(), s.next()].map(|k| 0.1 * k / size);
            let gradient: [Vec3; 3] =
                std::array::from_fn(|_| std::array::from_fn(|_| 0.01 * s.next()));
            for k in 1..self.count[l] as usize {
                let p = at(k);
                let d: Vec3 = std::array::from_fn(|c| p[c] - centre[c]);
                let up = 0.5 * (curvature[0] * d[0] * d[0] + curvature[1] * d[1] * d[1])
                    + curvature[2] * d[0] * d[1];
                for c in 0..3 {
                    let more = if c == 2 { up } else { 0.0 };
                    x[(3 * k + c) * n + l] += more + dot(gradient[c], d) + 2e-3 * size * s.next();
                }
            }
        }
        x
    }

    /// The same lanes in another order and number.
    pub(crate) fn picked(&self, order: &[usize]) -> Self {
        Self {
            lanes: order.len(),
            slots: self.slots,
            reference: pick(&self.reference, self.lanes, order),
            count: pick(&self.count, self.lanes, order),
            area: pick(&self.area, self.lanes, order),
            axis: pick(&self.axis, self.lanes, order),
        }
    }
}
