//! Aligns scanned points to a surface by iterated closest points, point to plane (Y. Chen, G. Medioni, Image Vis. Comput. 10
//! (1992) 145), trimmed (D. Chetverikov et al., ICPR 2002): what stands off, as wrinkles and bridging do, must not pull the rest along.

use nalgebra::{
    DMatrix, Isometry3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3, Vector6,
};
use plyflow_geometry::vec3::{Vec3, add, scale, unit};
use plyflow_surface::Surface;

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
    /// Whether it came to rest; if not, the passes were at an end before.
    pub converged: bool,
    /// How far, about, the last pass moved the outermost of the points (m).
    pub last_motion: f64,
    /// How many of the six freedoms of motion the surface decides: a cylinder leaves one along and one around its axis.
    pub decided: usize,
}

impl Alignment {
    /// Where a point goes (m).
    pub fn place(&self, p: Vec3) -> Vec3 {
        (self.motion * Point3::from(p)).coords.into()
    }
}

/// More passes are not made.
pub const MOST_PASSES: usize = 200;
/// A motion has six freedoms.
const LEAST: usize = 6;
/// It has converged when no point moves by more than this share of the points' extent.
const CONVERGED: f64 = 1e-9;
/// What lies under each point is settled when no point moves by more than this share any more: one at the edge of a ply must not go to and fro for ever.
const SETTLED: f64 = 1e-6;
/// A motion counts as decided by an eigenvalue of more than this part of the largest.
const DECIDED: f64 = 1e-6;
/// Facets turned against each other by less than this (rad) stand for one smooth surface.
const CREASE: f64 = 0.7;

/// Moves `points` (m) onto the surface; `None` for fewer than six points, or where fewer than six lie over the surface and not beyond a free
/// edge of it: nothing can be aligned then.
pub fn align(points: &[Vec3], surface: &Surface, settings: &Settings) -> Option<Alignment> {
    align_where(points, surface, settings, |_| 0.0)
}

/// As [`align`], where the points lie `missing(p)` (m) nearer to the surface about a place `p` than [`Settings::offset`] says: something
/// that this counts does not lie there.
pub fn align_where(
    points: &[Vec3],
    surface: &Surface,
    settings: &Settings,
    missing: impl Fn(Vec3) -> f64,
) -> Option<Alignment> {
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
        converged: false,
        last_motion: f64::INFINITY,
        decided: 0,
    };
    let normals = surface.corner_normals(CREASE);
    let mut offsets = Vec::new();
    while found.passes < MOST_PASSES {
        found.passes += 1;
        let pivot = found.motion * Point3::from(centre);
        if found.last_motion > SETTLED * extent {
            let offset =
                |p: &Point3<f64>| settings.offset - missing((found.motion * p).coords.into());
            offsets = sample.iter().map(offset).collect();
        }
        let ground = (surface, normals.as_slice());
        let mut rows: Vec<Row> = (sample.iter().zip(&offsets))
            .filter_map(|(p, offset)| row(ground, found.motion * p, pivot, extent, *offset))
            .collect();
        if rows.len() < LEAST {
            return None;
        }
        rows.sort_by(|a, b| a.distance.abs().total_cmp(&b.distance.abs()));
        let kept = ((settings.kept * rows.len() as f64).ceil() as usize).min(rows.len());
        rows.truncate(kept);
        let squares = rows.iter().map(|r| r.distance * r.distance);
        found.rms = (squares.sum::<f64>() / kept.max(1) as f64).sqrt();
        let (change, decided) = solve(&rows);
        found.decided = decided;
        found.motion = moved(&change, extent, pivot) * found.motion;
        found.last_motion = change.norm();
        if found.last_motion < CONVERGED * extent {
            found.converged = true;
            break;
        }
    }
    Some(found)
}

/// A point's equation.
struct Row {
    /// How far it is from the offset surface (m).
    distance: f64,
    /// How that changes as the points turn and shift.
    moves: Vector6<f64>,
    /// The same on the smooth surface that the facets stand for. Facets of a sphere hold against turns about its centre, if hardly, the sphere does not.
    smooth: Vector6<f64>,
}

/// `None` beyond a free edge, where the nearest place says nothing.
fn row(
    (surface, normals): (&Surface, &[[Vec3; 3]]),
    p: Point3<f64>,
    pivot: Point3<f64>,
    extent: f64,
    offset: f64,
) -> Option<Row> {
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
    let six = |at: Point3<f64>, normal: Vector3<f64>| {
        let a = (at - pivot).cross(&normal) / extent;
        Vector6::new(a.x, a.y, a.z, normal.x, normal.y, normal.z)
    };
    let weights = surface.weights(closest.triangle, closest.point);
    let corners = normals[closest.triangle].iter().zip(weights);
    let smooth = unit(corners.fold([0.0; 3], |sum, (n, w)| add(sum, scale(*n, w))));
    Some(Row {
        distance: d - offset,
        moves: six(p, normal),
        // On the surface: above it, a point lies along its facet's normal and not along this one.
        smooth: six(Point3::from(closest.point), Vector3::from(smooth)),
    })
}

/// A change of shift and turn about `pivot`, the middle of the points, as a motion. Turns are scaled with the `extent` of the points (m), so that all
/// unknowns are lengths.
fn moved(change: &Vector6<f64>, extent: f64, pivot: Point3<f64>) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(change.fixed_rows::<3>(0) / extent);
    let shift = Translation3::from(change.fixed_rows::<3>(3).into_owned());
    let about = Translation3::from(pivot.coords);
    shift * about * turn * about.inverse()
}

/// The motion of least squares that takes the distances away, without the motions that the smooth surface does not decide.
fn solve(rows: &[Row]) -> (Vector6<f64>, usize) {
    let (mut gram, mut smooth, mut rhs) = (Matrix6::zeros(), Matrix6::zeros(), Vector6::zeros());
    for row in rows {
        gram += row.moves * row.moves.transpose();
        smooth += row.smooth * row.smooth.transpose();
        rhs -= row.moves * row.distance;
    }
    let parts = smooth.symmetric_eigen();
    let limit = DECIDED * parts.eigenvalues.max();
    let columns: Vec<Vector6<f64>> = (0..6)
        .filter(|&k| parts.eigenvalues[k] > limit)
        .map(|k| parts.eigenvectors.column(k).into_owned())
        .collect();
    // Of those that are left the facets must decide too: they are what distances are taken from.
    let of = |a: &Vector6<f64>, b: &Vector6<f64>| a.dot(&(gram * b));
    let count = columns.len();
    let reduced = DMatrix::from_fn(count, count, |i, j| of(&columns[i], &columns[j]));
    let parts = reduced.symmetric_eigen();
    let limit = DECIDED * parts.eigenvalues.max();
    let (mut change, mut decided) = (Vector6::zeros(), 0);
    for (k, value) in parts.eigenvalues.iter().enumerate() {
        if *value > limit {
            let weights = parts.eigenvectors.column(k);
            let v = (columns.iter().zip(weights.iter()))
                .fold(Vector6::zeros(), |sum, (column, weight)| {
                    sum + column * *weight
                });
            change += v * (v.dot(&rhs) / value);
            decided += 1;
        }
    }
    (change, decided)
}
