//! Wrinkles and bridging of one formed ply.

use crate::area::{Extent, NONE, extents, sample};
use crate::crests::{Crest, crests};
use crate::ply::Ply;
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{Vec3, distance};
use plyflow_model::artifact::{self, Cause, DefectKind as Kind};
use plyflow_surface::{Bound, Curvature, Ridge, ridge_line, sharpness};
use serde::Deserialize;
use std::f64::consts::PI;

/// What counts as a defect.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct Settings {
    /// Distance above which a ply stands off the tool (m).
    pub distance_threshold: f64,
    /// Curvature of a crest, beyond that of the tool beneath it, above which it is a wrinkle's (1/m).
    pub curvature_threshold: f64,
    /// Share of it down to which a crest goes on (0 to 1).
    pub crest_hold: f64,
    /// Nodes nearer to the tool's foot are not judged (m).
    pub foot_margin: f64,
    /// Shorter ridges are no wrinkles (m).
    pub minimum_wrinkle_length: f64,
    /// Smaller areas are no bridging (m2).
    pub minimum_bridging_area: f64,
}

/// The curvature with the more negative of the two principal ones first, where one is that of a crest.
fn as_crest(seen: &Curvature) -> Curvature {
    if seen.min >= seen.max.min(0.0) {
        return *seen;
    }
    Curvature {
        max: seen.min,
        min: seen.max,
        max_direction: seen.min_direction,
        min_direction: seen.max_direction,
        ..*seen
    }
}

/// The shear angle along the crest of a wrinkle, at the nodes along it (rad).
#[derive(Debug, Clone, PartialEq)]
pub struct RidgeShear {
    /// Mean over the nodes.
    pub mean: f64,
    /// Smallest.
    pub min: f64,
    /// Largest.
    pub max: f64,
    /// By node: place along the ridge, from its first end over the surface (m), and shear angle (rad).
    pub profile: Vec<[f64; 2]>,
}

/// A defect of a ply.
#[derive(Debug, Clone, PartialEq)]
pub struct Defect {
    /// Which kind.
    pub kind: Kind,
    /// Its nodes, ascending.
    pub nodes: Vec<u32>,
    /// Wrinkles: length of the ridge over the surface (m); bridging: 0.
    pub length: f64,
    /// Largest distance from the tool (m).
    pub amplitude: f64,
    /// Undeformed area (m2), to where the ply is the distance threshold from the tool.
    pub area: f64,
    /// Centre in the undeformed plane (m).
    pub centre: [f64; 2],
    /// Largest magnitude of the principal curvatures (1/m).
    pub curvature_max: f64,
    /// Wrinkles: largest turn (rad) of the ply over the crest from one cell to the next; above [`plyflow_surface::SHARP`] the mesh does not tell how
    /// sharp it is.
    pub sharpness: f64,
    /// Wrinkles: direction of the ridge in the undeformed plane, from x, in (-pi/2, pi/2] (rad).
    pub direction: f64,
    /// Smallest and largest shear angle of the cells it touches (rad).
    pub shear: Option<[f64; 2]>,
    /// Wrinkles: the crest line on the formed ply (m), from one end to the other.
    pub ridge: Vec<Vec3>,
    /// Wrinkles: the nodes along it.
    pub ridge_nodes: Vec<u32>,
    /// Wrinkles of plies whose shear is known: the shear angle along it.
    pub ridge_shear: Option<RidgeShear>,
    /// Wrinkles: what most likely brought it about, once that was looked into ([`crate::find_causes`]).
    pub cause: Option<Cause>,
}

impl Defect {
    /// Least radius of curvature (m); `None` where it is flat.
    pub fn radius(&self) -> Option<f64> {
        (self.curvature_max > 0.0).then(|| 1.0 / self.curvature_max)
    }

    /// [`Self::direction`] of what has a ridge (rad).
    pub fn ridge_direction(&self) -> Option<f64> {
        (self.kind == Kind::Wrinkle).then_some(self.direction)
    }

    /// As the attributes of artifacts tell it.
    pub fn told(&self) -> artifact::Defect {
        let shear = self.ridge_shear.as_ref();
        artifact::Defect {
            kind: self.kind,
            cause: self.cause,
            amplitude: self.amplitude,
            area: self.area,
            centre: self.centre,
            radius: self.radius(),
            direction: self.ridge_direction(),
            ridge_shear: shear.map(|s| s.mean),
            ridge_shear_min: shear.map(|s| s.min),
            ridge_shear_max: shear.map(|s| s.max),
            ridge_shear_profile: shear.map(|s| s.profile.clone()),
        }
    }
}

/// Wrinkles (longest first), then bridging (largest first), among the nodes `inside` (`[nodes]`).
///
/// A wrinkle is a connected set of nodes that stand off the tool by more than the distance threshold and where the ply is curved
/// as a crest is (its most negative principal curvature: in a bend of the tool that is hollow along the crest the other one may be the larger),
/// beyond the tool's own there by more than `crest_hold` of the curvature threshold, at one of them at least by more than all of it (thresholds with
/// hysteresis, Canny 1986: a crest whose curvature wavers about one threshold would fall to pieces), with single nodes between
/// two such pieces where the ply is convex as well; its length is that of its ridge. A crest that turns a corner (60 degrees in the flat ply, over 10 mm to either side)
/// is one wrinkle up to the corner and another one from it, and so is what branches off from a crest. Its flanks belong to it as far as half a wave of the sinusoid with its amplitude and
/// curvature reaches along the surface, however steep it is. What else stands off the tool
/// is bridging.
pub fn measure(ply: &Ply, inside: &[bool], settings: &Settings) -> Vec<Defect> {
    let n = ply.topology.nodes();
    let judged: Vec<bool> = (0..n)
        .map(|i| inside[i] && ply.distance[i].judged)
        .collect();
    let off: Vec<bool> = (0..n)
        .map(|i| judged[i] && ply.distance[i].value > settings.distance_threshold)
        .collect();
    let crested: Vec<Curvature> = ply.curvature.iter().map(as_crest).collect();
    let wrinkles = wrinkles(ply, &off, &crested, settings);
    let mut set = with_flanks(ply, &off, &crested, &wrinkles);
    let rest: Vec<bool> = (0..n).map(|i| off[i] && set[i] == NONE).collect();
    let bridges = ply.topology.node_components(&rest);
    for (b, nodes) in bridges.iter().enumerate() {
        nodes
            .iter()
            .for_each(|&i| set[i as usize] = wrinkles.len() + b);
    }
    let (first_bridge, count) = (wrinkles.len(), wrinkles.len() + bridges.len());
    let extents = extents(ply, &set, &judged, settings.distance_threshold, count);
    let mut found = Vec::new();
    for (w, (_, ridge)) in wrinkles.into_iter().enumerate() {
        let nodes = (0..n as u32).filter(|&i| set[i as usize] == w).collect();
        let mut defect = describe(ply, Kind::Wrinkle, nodes, &extents[w]);
        defect.length = ridge.length;
        defect.sharpness = sharpness(&ply.topology, &ply.formed, &ridge.nodes);
        defect.direction = direction(ply, &ridge.nodes);
        defect.ridge_shear = ridge_shear(ply, &ridge);
        (defect.ridge, defect.ridge_nodes) = (ridge.points, ridge.nodes);
        found.push(defect);
    }
    found.sort_by(|a, b| b.length.total_cmp(&a.length));
    let mut bridging: Vec<Defect> = (bridges.into_iter())
        .zip(&extents[first_bridge..])
        .map(|(nodes, extent)| describe(ply, Kind::Bridging, nodes, extent))
        .filter(|d| d.area >= settings.minimum_bridging_area)
        .collect();
    bridging.sort_by(|a, b| b.area.total_cmp(&a.area));
    found.extend(bridging);
    found
}

/// Nodes and ridge of each wrinkle, without its flanks. `off`: the nodes that stand off; `crested`: [`as_crest`] of all.
fn wrinkles(ply: &Ply, off: &[bool], crested: &[Curvature], settings: &Settings) -> Vec<Crest> {
    let limit = |i: usize, share: f64| ply.tool_crest[i] - share * settings.curvature_threshold;
    let hold = settings.crest_hold;
    let curved: Vec<bool> = (0..off.len())
        .map(|i| off[i] && crested[i].max < limit(i, hold))
        .collect();
    let crest = without_gaps(ply, off, curved);
    let margin: Vec<f64> = (ply.distance.iter())
        .map(|d| d.value - settings.distance_threshold)
        .collect();
    let mut wrinkles = Vec::new();
    for nodes in ply.topology.node_components(&crest) {
        let beyond = |&i: &u32| crested[i as usize].max < limit(i as usize, 1.0);
        if !nodes.iter().any(beyond) {
            continue;
        }
        let threshold = nodes
            .iter()
            .map(|&i| -limit(i as usize, hold))
            .fold(f64::INFINITY, f64::min);
        let bound = Bound {
            threshold,
            margin: &margin,
        };
        let long = |r: &Ridge| r.length >= settings.minimum_wrinkle_length;
        let ridge_of = |nodes: &[u32]| {
            let (topology, formed) = (&ply.topology, &ply.formed);
            let ridge = ridge_line(topology, formed, crested, nodes, bound);
            ridge.filter(|r| long(r) && nodes.iter().any(beyond))
        };
        // What is curved as a crest reaches at most to half of the flank.
        let beside = 0.6 * flank(highest_node(ply, &nodes), curvature(crested, &nodes));
        let parts = crests(ply, &nodes, beside, ridge_of);
        wrinkles.extend(parts.into_iter().filter(|(_, r)| long(r)));
    }
    wrinkles
}

/// By node, to which wrinkle it belongs ([`NONE`]: to none): that whose crest is the nearest, as far as its flanks reach.
fn with_flanks(ply: &Ply, off: &[bool], crested: &[Curvature], wrinkles: &[Crest]) -> Vec<usize> {
    let mut set = vec![NONE; off.len()];
    let mut nearest = vec![f64::INFINITY; off.len()];
    for (w, (nodes, _)) in wrinkles.iter().enumerate() {
        let reach = flank(highest_node(ply, nodes), curvature(crested, nodes));
        let lengths = ply.topology.path_lengths(&ply.formed, nodes, off, reach);
        for i in 0..off.len() {
            if lengths[i] < nearest[i] {
                nearest[i] = lengths[i];
                set[i] = w;
            }
        }
    }
    set
}

/// Crests and the single nodes between pieces of one: such a node stands off, is convex too, and touches two pieces. (Between
/// two crests that lie side by side the ply is concave.)
fn without_gaps(ply: &Ply, off: &[bool], mut crest: Vec<bool>) -> Vec<bool> {
    let mut piece = vec![usize::MAX; crest.len()];
    for (p, nodes) in ply.topology.node_components(&crest).iter().enumerate() {
        nodes.iter().for_each(|&i| piece[i as usize] = p);
    }
    for i in 0..crest.len() {
        if !off[i] || piece[i] != usize::MAX || ply.curvature[i].max >= 0.0 {
            continue;
        }
        let ring = ply.topology.ring(i).iter();
        let mut touched = ring
            .map(|&k| piece[k as usize])
            .filter(|&p| p != usize::MAX);
        let first = touched.next();
        crest[i] = touched.any(|p| Some(p) != first);
    }
    crest
}

/// The shear angle along a ridge; `None` when it is not known.
fn ridge_shear(ply: &Ply, ridge: &Ridge) -> Option<RidgeShear> {
    let mean = mean_along(ply, &ply.shear_angle, &ridge.nodes)?;
    // The line begins and ends with a tip that is no node.
    let mut station = 0.0;
    let stations = ridge.points.windows(2).map(|w| {
        station += distance(w[0], w[1]);
        station
    });
    let angles = (ridge.nodes.iter()).map(|&i| ply.at_node(&ply.shear_angle, i));
    let profile = stations
        .zip(angles)
        .map(|(s, angle)| Some([s, angle?]))
        .collect::<Option<Vec<_>>>()?;
    let angles = || profile.iter().map(|p| p[1]);
    Some(RidgeShear {
        mean,
        min: angles().fold(f64::INFINITY, f64::min),
        max: angles().fold(f64::NEG_INFINITY, f64::max),
        profile,
    })
}

/// The mean over nodes of a cell field; `None` when the field is empty.
pub(crate) fn mean_along(ply: &Ply, field: &[f64], nodes: &[u32]) -> Option<f64> {
    let values = nodes.iter().map(|&i| ply.at_node(field, i));
    let sum: f64 = values.sum::<Option<f64>>()?;
    (!nodes.is_empty()).then(|| sum / nodes.len() as f64)
}

fn highest_node(ply: &Ply, nodes: &[u32]) -> f64 {
    nodes
        .iter()
        .map(|&i| ply.distance[i as usize].value)
        .fold(0.0, f64::max)
}

/// Largest distance from the tool (m), also between nodes: half way between two it is that of the cubic with both their distances and slopes.
fn amplitude(ply: &Ply, nodes: &[u32]) -> f64 {
    let highest = highest_node(ply, nodes);
    // The top lies beside a node not far below it.
    let near = nodes.iter().map(|&i| i as usize);
    let near = near.filter(|&i| ply.distance[i].value > NEARLY * highest);
    let between = near.flat_map(|i| {
        let own = sample(ply, i, 0.0);
        let next = ply.topology.ring(i).iter().map(|&n| n as usize);
        let next = next.filter(|&n| ply.distance[n].judged);
        next.map(move |n| own.half_way(&sample(ply, n, 0.0)).height())
    });
    between.fold(highest, f64::max)
}

/// A node higher than this part of the highest may have the top of a defect beside it.
const NEARLY: f64 = 0.8;

/// Points at which the length of a flank is summed.
const FLANK: usize = 64;

/// Length (m) along the surface from the crest to the trough of a sinusoid with this height from trough to crest (m) and this curvature on its crest (1/m).
fn flank(height: f64, curvature: f64) -> f64 {
    if curvature <= 0.0 || height <= 0.0 {
        return 0.0;
    }
    let number = (2.0 * curvature / height).sqrt();
    let steepest = 0.5 * height * number;
    let at = |i: usize| {
        let slope = steepest * (PI * (i as f64 + 0.5) / FLANK as f64).fixed_sin();
        (1.0 + slope * slope).sqrt()
    };
    (0..FLANK).map(at).sum::<f64>() * PI / (FLANK as f64 * number)
}

fn curvature(of: &[Curvature], nodes: &[u32]) -> f64 {
    nodes
        .iter()
        .map(|&i| of[i as usize].max.abs())
        .fold(0.0, f64::max)
}

/// Direction of the line of least squares through nodes in the flat ply, from x, in (-pi/2, pi/2] (rad).
fn direction(ply: &Ply, nodes: &[u32]) -> f64 {
    let places = || nodes.iter().map(|&i| ply.undeformed[i as usize]);
    let mean = [0, 1].map(|k| places().map(|p| p[k]).sum::<f64>() / nodes.len() as f64);
    let moment =
        |a: usize, b: usize| -> f64 { places().map(|p| (p[a] - mean[a]) * (p[b] - mean[b])).sum() };
    0.5 * (2.0 * moment(0, 1)).fixed_atan2(moment(0, 0) - moment(1, 1))
}

fn describe(ply: &Ply, kind: Kind, nodes: Vec<u32>, extent: &Extent) -> Defect {
    let cells = nodes
        .iter()
        .flat_map(|&i| ply.topology.cells_of(i as usize));
    let shear = cells.filter_map(|&c| ply.shear_angle.get(c as usize)).fold(
        None,
        |range: Option<[f64; 2]>, &g| {
            let [low, high] = range.unwrap_or([g; 2]);
            Some([low.min(g), high.max(g)])
        },
    );
    Defect {
        kind,
        length: 0.0,
        amplitude: amplitude(ply, &nodes),
        area: extent.area,
        centre: extent.centre(),
        curvature_max: curvature(&ply.curvature, &nodes),
        sharpness: 0.0,
        direction: 0.0,
        shear,
        nodes,
        ridge: Vec::new(),
        ridge_nodes: Vec::new(),
        ridge_shear: None,
        cause: None,
    }
}

/// Quantiles of `values` at `at` (0..1), linear between the ordered values; zeros when there are none.
pub fn quantiles(values: &[f64], at: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else {
        return vec![0.0; at.len()];
    };
    at.iter()
        .map(|q| {
            let place = q * last as f64;
            let low = (place.floor() as usize).min(last);
            let high = (low + 1).min(last);
            sorted[low] + (place - low as f64) * (sorted[high] - sorted[low])
        })
        .collect()
}
