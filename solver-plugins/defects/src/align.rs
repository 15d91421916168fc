//! Aligns scanned points to a surface by iterated closest points, point to plane (Y. Chen, G. Medioni, Image Vis. Comput. 10
//! (1992) 145), trimmed (D. Chetverikov et al., ICPR 2002): what stands off, as wrinkles and bridging do, must not pull the rest along.

use nalgebra::{Isometry3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3, Vector6};
use plyflow_surface::Surface;
use plyflow_surface::vector::Vec3;

/// How points are aligned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Distance at which the points lie from the surface where nothing stands off (m).
    pub offset: f64,
    /// Share of the points, those nearest to that, that counts.
    pub kept: f64,
    /// At most so many points are looked at, evenly from all.
    pub most_points: usize,
}

/// What was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Alignment {
    /// Moves the points to where they fit (m).
    pub motion: Isometry3<f64>,
    /// Root mean square of the distances from the offset surface, of the points that count (m).
    pub rms: f64,
    /// Passes made.
    pub passes: usize,
    /// How many of the six freedoms of motion the surface decides: a cylinder leaves one along and one around its axis.
    pub decided: usize,
}

impl Alignment {
    /// Where a point goes (m).
    pub fn place(&self, p: Vec3) -> Vec3 {
        (self.motion * Point3::from(p)).coords.into()
    }
}

const MOST_PASSES: usize = 200;
/// A motion has six freedoms.
const LEAST: usize = 6;
/// It has converged when no point moves by more than this share of the points' extent.
const CONVERGED: f64 = 1e-9;
/// A motion counts as decided by an eigenvalue of more than this part of the largest.
const DECIDED: f64 = 1e-6;

/// Moves `points` (m) onto the surface; `None` for fewer than six points, or where fewer than six lie over the surface and not beyond a free
/// edge of it: nothing can be aligned then.
pub fn align(points: &[Vec3], surface: &Surface, settings: &Settings) -> Option<Alignment> {
    if points.len() < LEAST {
        return None;
    }
    let step = points.len().div_ceil(settings.most_points.max(LEAST));
    let sample: Vec<Point3<f64>> = points.iter().step_by(step).map(|&p| p.into()).collect();
    let centre = sample.iter().fold(Vector3::zeros(), |s, p| s + p.coords) / sample.len() as f64;
    let extent = sample
        .iter()
        .map(|p| (p.coords - centre).norm())
        .fold(0.0, f64::max);
    let mut found = Alignment {
        motion: Isometry3::identity(),
        rms: 0.0,
        passes: 0,
        decided: 0,
    };
    while found.passes < MOST_PASSES {
        found.passes += 1;
        let pivot = found.motion * Point3::from(centre);
        let mut rows: Vec<(f64, Vector6<f64>)> = sample
            .iter()
            .filter_map(|p| row(surface, found.motion * p, pivot, extent, settings.offset))
            .collect();
        if rows.len() < LEAST {
            return None;
        }
        rows.sort_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
        let kept = ((settings.kept * rows.len() as f64).ceil() as usize).min(rows.len());
        rows.truncate(kept);
        found.rms = (rows.iter().map(|r| r.0 * r.0).sum::<f64>() / kept.max(1) as f64).sqrt();
        let (change, decided) = solve(&rows);
        found.decided = decided;
        // Turned about the middle of the points; turns are scaled with their extent, so that all unknowns are lengths.
        let turn = UnitQuaternion::from_scaled_axis(change.fixed_rows::<3>(0) / extent);
        let shift = Translation3::from(change.fixed_rows::<3>(3).into_owned());
        let about = Translation3::from(pivot.coords);
        found.motion = shift * about * turn * about.inverse() * found.motion;
        if change.norm() < CONVERGED * extent {
            break;
        }
    }
    Some(found)
}

/// How far a point is from the offset surface, and how that changes as the points turn and shift; `None` beyond a free
/// edge, where the nearest place says nothing.
fn row(
    surface: &Surface,
    p: Point3<f64>,
    pivot: Point3<f64>,
    extent: f64,
    offset: f64,
) -> Option<(f64, Vector6<f64>)> {
    let closest = surface.closest(p.coords.into());
    if closest.on_free_edge {
        return None;
    }
    let d = closest.signed_distance;
    let arm = p.coords - Vector3::from(closest.point);
    let normal = if d.abs() > 1e-12 * extent {
        arm / d
    } else {
        Vector3::from(closest.normal)
    };
    let turn = (p - pivot).cross(&normal) / extent;
    let [a, b] = [turn, normal];
    Some((d - offset, Vector6::new(a.x, a.y, a.z, b.x, b.y, b.z)))
}

/// The motion of least squares that takes the distances away, without the motions that nothing decides.
fn solve(rows: &[(f64, Vector6<f64>)]) -> (Vector6<f64>, usize) {
    let (mut gram, mut rhs) = (Matrix6::zeros(), Vector6::zeros());
    for (distance, row) in rows {
        gram += row * row.transpose();
        rhs -= row * *distance;
    }
    let parts = gram.symmetric_eigen();
    let limit = DECIDED * parts.eigenvalues.max();
    let (mut change, mut decided) = (Vector6::zeros(), 0);
    for (k, value) in parts.eigenvalues.iter().enumerate() {
        if *value > limit {
            let v = parts.eigenvectors.column(k);
            change += v * (v.dot(&rhs) / value);
            decided += 1;
        }
    }
    (change, decided)
}
