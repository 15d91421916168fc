//! What a wrinkle most likely comes from, by what the fields say about its place.

use crate::measure::{Defect, mean_along};
use crate::ply::Ply;
use plyflow_fixed::FixedBits;
use plyflow_geometry::rectangle;
use plyflow_geometry::vec3::distance;
use plyflow_model::artifact::{Cause, DefectKind as Kind, ShearLimits, Sheet};
use plyflow_model::steering::Laid;
use serde::Deserialize;
use std::f64::consts::FRAC_PI_2;

/// When a cause is taken for likely.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct Limits {
    /// Mean shear along the crest above this is over-shear (rad), whatever the ply's material says.
    pub over_shear_positive: Option<f64>,
    /// Mean shear along the crest below this is over-shear (rad), whatever the ply's material says.
    pub over_shear_negative: Option<f64>,
    /// How near bridging must be, in the flat ply (m).
    pub bridging_reach: f64,
    /// Fibre directions of two plies that differ by less are the same (rad).
    pub layup_angle: f64,
    /// Strain from which on fibres are compressed, as a positive number.
    pub fibre_compression: f64,
}

impl Limits {
    /// Of a ply whose material has limits of its own: these count for the signs that are not asked for.
    #[must_use]
    pub fn of_ply(&self, material: Option<ShearLimits>) -> Self {
        let limits = self.shear().or(material.unwrap_or_default());
        Self {
            over_shear_positive: limits.positive,
            over_shear_negative: limits.negative,
            ..*self
        }
    }

    /// What to say where wrinkles of some of these plies cannot be told to come from over-shear; `None`: nothing.
    pub fn untold<'a>(&self, plies: impl Iterator<Item = &'a Sheet>) -> Option<String> {
        let without = |sheet: &&Sheet| {
            let limits = self.of_ply(sheet.over_shear);
            limits.over_shear_positive.is_none() || limits.over_shear_negative.is_none()
        };
        let names: Vec<String> = plies
            .filter(without)
            .map(|s| format!("'{}'", s.name))
            .collect();
        (!names.is_empty()).then(|| {
            format!(
                "over-shear is no cause for wrinkles of {} where neither the material's file (`over_shear`) nor this step says from which \
                 shear angles the fabric wrinkles",
                names.join(", ")
            )
        })
    }

    fn shear(&self) -> ShearLimits {
        ShearLimits {
            positive: self.over_shear_positive,
            negative: self.over_shear_negative,
        }
    }
}

/// A ply next to another one in the stack.
#[derive(Debug, Clone)]
pub struct Neighbour<'a> {
    /// It counts where its flat mesh lies.
    pub ply: &'a Ply,
    /// Directions of both its fibre families in the flat ply.
    pub laid: Laid,
}

/// Places on the side of a cell lie in it, however they were rounded (m).
const ROUNDING: f64 = 1e-6;

/// Sets the causes of a ply's wrinkles. `laid`: directions of both fibre families of the flat ply; `others`:
/// the plies next to it, of which each counts for the wrinkles under or over which it lies with fibres askew: its flat mesh holds a node of the crest. A scan, of which neither is known, gives both empty: its wrinkles come from bridging or
/// are undetermined.
pub fn find_causes(
    ply: &Ply,
    defects: &mut [Defect],
    laid: Option<&Laid>,
    others: &[Neighbour<'_>],
    limits: &Limits,
) {
    let bridging: Vec<u32> = (defects.iter())
        .filter(|d| d.kind == Kind::Bridging)
        .flat_map(|d| d.nodes.iter().copied())
        .collect();
    let crossed = |ridge: &[u32]| {
        let flat = |&i: &u32| [0, 1].map(|k| ply.undeformed[i as usize][k]);
        others.iter().any(|other| {
            let askew = |p: &[f64; 2]| {
                laid.is_some_and(|own| {
                    relative_angle(own.at(*p), other.laid.at(*p)) > limits.layup_angle
                })
            };
            let places: Vec<[f64; 2]> = ridge.iter().map(flat).filter(askew).collect();
            !places.is_empty() && lies_at(other.ply, &places)
        })
    };
    let wrinkles = defects.iter_mut().filter(|d| d.kind == Kind::Wrinkle);
    for wrinkle in wrinkles {
        let over = |g: f64| limits.shear().exceeded(g);
        let strain = mean_along(ply, &ply.fibre_strain, &wrinkle.ridge_nodes);
        let compressed = strain.is_some_and(|e| e < -limits.fibre_compression);
        wrinkle.cause = Some(
            if wrinkle.ridge_shear.as_ref().is_some_and(|s| over(s.mean)) {
                Cause::OverShear
            } else if is_near(ply, &wrinkle.ridge_nodes, &bridging, limits.bridging_reach) {
                Cause::Bridging
            } else if compressed && crossed(&wrinkle.ridge_nodes) {
                Cause::InterPlyCompression
            } else if compressed {
                Cause::FibreCompression
            } else {
                Cause::Undetermined
            },
        );
    }
}

/// Whether a cell of a flat ply holds one of the places (m).
fn lies_at(ply: &Ply, places: &[[f64; 2]]) -> bool {
    let around = rectangle::around(places.iter().copied());
    (0..ply.topology.cells()).any(|c| {
        let at = |&i: &u32| [0, 1].map(|k| ply.undeformed[i as usize][k]);
        let corners: Vec<[f64; 2]> = ply.topology.cell(c).iter().map(at).collect();
        let own = rectangle::around(corners.iter().copied());
        let apart =
            |d: usize| own[d] > around[d + 2] + ROUNDING || own[d + 2] < around[d] - ROUNDING;
        !(apart(0) || apart(1)) && places.iter().any(|p| holds(&corners, *p))
    })
}

/// Whether a place lies in a convex cell, wound either way (m).
fn holds(corners: &[[f64; 2]], p: [f64; 2]) -> bool {
    // Distance from each side, positive to its left.
    let distance = |(k, a): (usize, &[f64; 2])| {
        let b = corners[(k + 1) % corners.len()];
        let (along, to) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
        (along[0] * to[1] - along[1] * to[0])
            / along[0].fixed_hypot(along[1]).max(f64::MIN_POSITIVE)
    };
    let distances = || corners.iter().enumerate().map(distance);
    distances().all(|d| d > -ROUNDING) || distances().all(|d| d < ROUNDING)
}

fn is_near(ply: &Ply, ridge: &[u32], bridging: &[u32], reach: f64) -> bool {
    let at = |i: u32| ply.undeformed[i as usize];
    // A box around the ridge first: there may be many nodes.
    let inside = |k: usize| {
        let along = ridge.iter().map(|&i| at(i)[k]);
        let low = along.clone().fold(f64::INFINITY, f64::min) - reach;
        let high = along.fold(f64::NEG_INFINITY, f64::max) + reach;
        move |v: f64| v >= low && v <= high
    };
    let (in_x, in_y) = (inside(0), inside(1));
    let candidates = bridging.iter().map(|&b| at(b));
    candidates
        .filter(|p| in_x(p[0]) && in_y(p[1]))
        .any(|p| ridge.iter().any(|&r| distance(p, at(r)) <= reach))
}

/// Angle (rad, 0 to pi/4) between the fibre directions of two plies: by how much the one would have to be turned for its
/// families to lie along the other's.
pub fn relative_angle(a: [f64; 2], b: [f64; 2]) -> f64 {
    let apart = |a: f64, b: f64| {
        let d = (a - b).rem_euclid(2.0 * FRAC_PI_2);
        d.min(2.0 * FRAC_PI_2 - d)
    };
    let [x, y] = [[0, 1], [1, 0]].map(|[i, j]| apart(a[0], b[i]).max(apart(a[1], b[j])));
    x.min(y)
}
