//! The criteria of thesis 5.2.2 on one ply.

use plyflow_geometry::vec3::Vec3;
use plyflow_model::artifact::{PlyDefects, ShearLimits};
use plyflow_surface::{
    Ground, NodalDistance, Surface, Topology, curvatures, judged_share, nodal_distances,
};
use serde::Deserialize;

/// When a place counts as a defect.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
pub struct Thresholds {
    /// Cells above this shear angle are flagged (rad), whatever the ply's material says.
    pub over_shear_positive: Option<f64>,
    /// Cells below this shear angle are flagged (rad), whatever the ply's material says.
    pub over_shear_negative: Option<f64>,
    /// Nodes above this distance do not conform (m).
    pub distance_threshold: f64,
    /// Nodes whose closest point is nearer to the tool's foot are not judged (m).
    pub foot_margin: f64,
}

impl Thresholds {
    /// Limits of shear that were asked for, which count more than those of a material.
    pub fn asked(&self) -> ShearLimits {
        ShearLimits {
            positive: self.over_shear_positive,
            negative: self.over_shear_negative,
        }
    }
}

/// A formed ply.
#[derive(Debug, Clone, Copy)]
pub struct Ply<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its mesh of quads.
    pub topology: &'a Topology,
    /// `[nodes]` flat positions (m).
    pub undeformed: &'a [Vec3],
    /// `[nodes]` positions to judge (m).
    pub formed: &'a [Vec3],
    /// `[cells]` (rad).
    pub shear_angle: &'a [f64],
    /// Shear angles from which it counts as over-sheared; `None`: its shear is not judged.
    pub over_shear: Option<ShearLimits>,
    /// Distance of the mid-plane from the tool when all sheets lie on it (m).
    pub offset: f64,
    /// `[nodes]` what of that is not there, because plies below end beside it (m); `None`: all is there.
    pub missing: Option<&'a [f64]>,
    /// Whether there is a machine bed under the tool.
    pub bed: bool,
}

/// What was found on a ply.
#[derive(Debug, Clone, PartialEq)]
pub struct Detection {
    /// `[nodes]` (m).
    pub nodal_distance: Vec<f64>,
    /// `[nodes]`: whether that is judged.
    pub judged: Vec<bool>,
    /// `[nodes]` principal curvature of largest magnitude (1/m).
    pub curvature_max: Vec<f64>,
    /// `[cells]`.
    pub over_shear: Vec<bool>,
    /// `[nodes]`.
    pub poor_conformity: Vec<bool>,
    /// `[cells]`: over-sheared, or with a node that does not conform.
    pub flag: Vec<bool>,
    /// Its numbers; areas that are not draped are not known here.
    pub summary: PlyDefects,
}

/// Distances of the nodes from the tool, less what of their offset is not there.
fn distances(tool: &Surface, ply: &Ply<'_>, foot_margin: f64) -> Vec<NodalDistance> {
    let ground = Ground {
        foot_margin,
        bed: ply.bed,
    };
    let mut distances = nodal_distances(tool, ply.topology, ply.formed, ply.offset, ground);
    for (distance, missing) in distances.iter_mut().zip(ply.missing.unwrap_or_default()) {
        distance.value += missing;
    }
    distances
}

/// Judges a ply against the tool.
pub fn detect(tool: &Surface, ply: &Ply<'_>, thresholds: &Thresholds) -> Detection {
    let t = thresholds;
    let distances = distances(tool, ply, t.foot_margin);
    let poor_conformity: Vec<bool> = distances
        .iter()
        .map(|d| d.judged && d.value > t.distance_threshold)
        .collect();
    let is_over = |&g: &f64| ply.over_shear.is_some_and(|limits| limits.exceeded(g));
    let over_shear: Vec<bool> = ply.shear_angle.iter().map(is_over).collect();
    let is_poor = |&i: &u32| poor_conformity[i as usize];
    let poor: Vec<bool> = (0..ply.topology.cells())
        .map(|c| ply.topology.cell(c).iter().any(is_poor))
        .collect();
    let either = |(a, b): (&bool, &bool)| *a || *b;
    let flag: Vec<bool> = over_shear.iter().zip(&poor).map(either).collect();
    let areas = ply.topology.cell_areas(ply.undeformed);
    // A fold: the sum of nothing is -0 in Rust.
    let area = |chosen: &[bool]| {
        areas
            .iter()
            .zip(chosen)
            .filter(|(_, c)| **c)
            .map(|(a, _)| a)
            .fold(0.0, |sum, a| sum + a)
    };
    let shear = |pick: fn(f64, f64) -> f64| {
        let angles = ply.shear_angle.iter().copied();
        angles.reduce(pick).unwrap_or(0.0)
    };
    let judged = distances.iter().filter(|d| d.judged).map(|d| d.value);
    let nodes = ply.topology.node_areas(ply.undeformed);
    let summary = PlyDefects {
        name: ply.name.to_owned(),
        flagged_area: area(&flag),
        over_shear: ply.over_shear,
        over_shear_area: ply.over_shear.map(|_| area(&over_shear)),
        poor_conformity_area: area(&poor),
        shear_min: shear(f64::min),
        shear_max: shear(f64::max),
        distance_max: judged.reduce(f64::max).unwrap_or(0.0),
        judged_share: Some(judged_share(&distances, &nodes)),
        undraped_area: None,
        locked_area: None,
        buckling_area: None,
        buckling_excess: None,
    };
    Detection {
        nodal_distance: distances.iter().map(|d| d.value).collect(),
        judged: distances.iter().map(|d| d.judged).collect(),
        curvature_max: curvatures(ply.topology, ply.formed)
            .iter()
            .map(|k| k.max)
            .collect(),
        over_shear,
        poor_conformity,
        flag,
        summary,
    }
}
