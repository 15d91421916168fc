//! How a tool that was drawn somewhere could stand on the bed: what its facets tell about each direction that could be up.

use crate::tool::place::Axis;

/// How far above its lowest point, over its height, a facet still belongs to the foot.
const FOOT: f64 = 1e-3;

/// Facets that look down by less than this sine count as walls.
const WALL: f64 = 0.02;

/// Shares of undercuts that differ by less are alike: rounded edges of facets leave as much.
const ALIKE: f64 = 0.02;

/// A tool seen with one direction up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stand {
    /// The direction, in the axes of the facets.
    pub up: [f64; 3],
    /// What looks down above the foot, over what looks up, both as seen from above: 0 for a tool on which a sheet can be laid everywhere.
    pub undercut: f64,
    /// Its height, in the units of the facets.
    pub height: f64,
    /// What looks up, as seen from above.
    plan: f64,
}

impl Stand {
    /// Looks at facets, counter-clockwise seen from outside, with a unit vector up.
    pub fn of(facets: &[[[f64; 3]; 3]], up: [f64; 3]) -> Self {
        let along = |p: &[f64; 3]| p[0] * up[0] + p[1] * up[1] + p[2] * up[2];
        let heights = || facets.as_flattened().iter().map(along);
        let (low, high) = (
            heights().fold(f64::INFINITY, f64::min),
            heights().fold(f64::NEG_INFINITY, f64::max),
        );
        let height = (high - low).max(0.0);
        let foot = low + FOOT * height;
        let (mut plan, mut under) = (0.0, 0.0);
        for facet in facets {
            let normal = area_normal(facet);
            let seen = along(&normal);
            let area = along_itself(normal);
            if seen > 0.0 {
                plan += seen;
            } else if seen < -WALL * area && facet.iter().any(|p| along(p) > foot) {
                under -= seen;
            }
        }
        Self {
            up,
            undercut: if plan > 0.0 { under / plan } else { 1.0 },
            height,
            plan,
        }
    }

    /// Whether another one is clearly better: it has far less that overhangs.
    pub fn is_worse_than(&self, other: &Self) -> bool {
        self.undercut > 0.1 && other.undercut < 0.25 * self.undercut
    }
}

/// All six axes up, the likeliest first: with the least that overhangs, of alike ones the flattest, of these z before the others.
pub fn stands(facets: &[[[f64; 3]; 3]]) -> Vec<(Axis, Stand)> {
    let mut all = Axis::ALL.map(|axis| (axis, Stand::of(facets, axis.vector())));
    let class = |s: &Stand| (s.undercut / ALIKE).round();
    // Alike plans are those of a box seen from both ends.
    let flatter = |a: &Stand, b: &Stand| {
        let alike = (a.plan - b.plan).abs() <= 0.01 * a.plan.max(b.plan);
        match alike {
            true => std::cmp::Ordering::Equal,
            false => b.plan.total_cmp(&a.plan),
        }
    };
    all.sort_by(|(_, a), (_, b)| class(a).total_cmp(&class(b)).then(flatter(a, b)));
    all.to_vec()
}

/// Half the cross product of two sides: the area along the normal.
fn area_normal([a, b, c]: &[[f64; 3]; 3]) -> [f64; 3] {
    let u: [f64; 3] = std::array::from_fn(|k| b[k] - a[k]);
    let v: [f64; 3] = std::array::from_fn(|k| c[k] - a[k]);
    [
        0.5 * (u[1] * v[2] - u[2] * v[1]),
        0.5 * (u[2] * v[0] - u[0] * v[2]),
        0.5 * (u[0] * v[1] - u[1] * v[0]),
    ]
}

fn along_itself(v: [f64; 3]) -> f64 {
    (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hat: a block with walls that lean inwards by `lean` over its height; closed below where `closed`.
    fn hat(lean: f64, closed: bool) -> Vec<[[f64; 3]; 3]> {
        let [l, w, h] = [300.0, 120.0, 40.0];
        let corner = |k: usize, z: f64, by: f64| {
            let (x, y) = ([-1.0, 1.0, 1.0, -1.0][k], [-1.0, -1.0, 1.0, 1.0][k]);
            [x * (0.5 * l - by), y * (0.5 * w - by), z]
        };
        let low: Vec<_> = (0..4).map(|k| corner(k, 0.0, 0.0)).collect();
        let high: Vec<_> = (0..4).map(|k| corner(k, h, lean)).collect();
        let mut all = vec![[high[0], high[1], high[2]], [high[0], high[2], high[3]]];
        if closed {
            all.extend([[low[0], low[2], low[1]], [low[0], low[3], low[2]]]);
        }
        for k in 0..4 {
            let n = (k + 1) % 4;
            all.extend([[low[k], low[n], high[n]], [low[k], high[n], high[k]]]);
        }
        all
    }

    /// Turned so that what is z here points along an axis, and moved far away.
    fn lying(facets: &[[[f64; 3]; 3]], up: Axis) -> Vec<[[f64; 3]; 3]> {
        let z = up.vector();
        let x = [z[1].abs(), z[2].abs(), z[0].abs()];
        let y = [
            z[1] * x[2] - z[2] * x[1],
            z[2] * x[0] - z[0] * x[2],
            z[0] * x[1] - z[1] * x[0],
        ];
        let put =
            |p: [f64; 3]| std::array::from_fn(|k| 1e4 + p[0] * x[k] + p[1] * y[k] + p[2] * z[k]);
        facets.iter().map(|f| f.map(put)).collect()
    }

    #[test]
    fn the_way_that_a_hat_stands_is_found_wherever_its_up_points() {
        for closed in [true, false] {
            for up in Axis::ALL {
                let (found, stand) = stands(&lying(&hat(8.0, closed), up))[0];
                assert_eq!(found, up, "closed: {closed}");
                assert!(stand.undercut < 1e-9 && (stand.height - 40.0).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn a_block_that_stands_as_well_either_way_keeps_z_up() {
        assert_eq!(stands(&hat(0.0, true))[0].0, Axis::PlusZ);
        let over = Stand::of(&hat(8.0, true), [0.0, 0.0, -1.0]);
        let best = Stand::of(&hat(8.0, true), [0.0, 0.0, 1.0]);
        assert!(over.is_worse_than(&best), "{over:?}");
        assert!(!best.is_worse_than(&over));
    }
}
