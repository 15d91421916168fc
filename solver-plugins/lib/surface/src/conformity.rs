//! How a formed sheet lies on its tool: the nodal distance of thesis eq. 4.1, signed and less the sheet's own
//! offset, and where there is tool to lie on.

use crate::closest::{Closest, Surface};
use crate::outline::Outline;
use crate::topology::Topology;
use plyflow_geometry::vec3::{Vec3, dot, norm, sub};

/// Cosine of the angle between a sheet and a wall beside it up to which it runs along the wall: 45 degrees. A sheet that turns away further goes
/// across: it leaves the tool.
const ALONG: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Nearer to the tool than this (m) a sheet lies on it, whatever the direction to it.
const TOUCH: f64 = 1e-9;

/// Distance of a node from the tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NodalDistance {
    /// Signed distance to the closest point of the tool less the sheet's offset (m): zero where the sheet
    /// lies on the tool or on the sheets below it, positive where it stands off.
    pub value: f64,
    /// Whether there is tool to conform to ([`Ground`]).
    pub judged: bool,
    /// The tool's triangle that holds the closest point (index into [`Surface::triangles`]).
    pub triangle: usize,
}

/// What is under tool and sheet, which says where there is tool to lie on. It never is past a free edge of the tool's surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ground {
    /// Margin at the tool's foot (m): see [`foot_height`].
    pub foot_margin: f64,
    /// Whether the tool stands on a machine bed. Then everything is pressed onto tool or bed, and all is judged but what has its closest point at the
    /// foot: there the sheet leaves the tool for the bed. Without a bed a sheet may hang beside the tool, or over a hole in it. It is judged where a
    /// line along z meets the tool, and beside the tool where the sheet runs along a wall of it, above the foot.
    pub bed: bool,
}

impl Ground {
    /// Of a tool on a machine bed.
    pub fn bed(foot_margin: f64) -> Self {
        Self {
            foot_margin,
            bed: true,
        }
    }
}

/// Height above the tool's lowest point below which closest points count as its foot (m): `margin`, but never
/// more than half of the tool's height (a flat tool just above the bed is all judged on its top).
pub fn foot_height(tool: &Surface, margin: f64) -> f64 {
    let (low, high) = tool.bounds();
    low[2] + margin.min(0.5 * (high[2] - low[2]))
}

/// Nodal distances of a sheet's nodes at `points` (`[nodes]`, m). `offset`: distance of the sheet's mid-plane from the tool when all sheets
/// lie on it (m).
pub fn nodal_distances(
    tool: &Surface,
    topology: &Topology,
    points: &[Vec3],
    offset: f64,
    ground: Ground,
) -> Vec<NodalDistance> {
    let foot = foot_height(tool, ground.foot_margin);
    let (low, high) = tool.bounds();
    let air = (!ground.bed).then(|| (Outline::new(tool), topology.normals(points)));
    let mut all = Vec::with_capacity(points.len());
    for (i, &p) in points.iter().enumerate() {
        let closest = tool.closest(p);
        // A tool without height (a plane) has no foot.
        let at_foot = high[2] > low[2] && closest.point[2] < foot;
        let beside = match &air {
            None => at_foot,
            Some((outline, normals)) => {
                !outline.holds([p[0], p[1]]) && (at_foot || !runs_along(p, normals[i], &closest))
            }
        };
        all.push(NodalDistance {
            value: closest.signed_distance - offset,
            judged: !closest.on_free_edge && !beside,
            triangle: closest.triangle,
        });
    }
    all
}

/// Whether a sheet with this normal at a place (m) runs along the tool there: its normal points to the closest point rather than across.
fn runs_along(p: Vec3, normal: Vec3, closest: &Closest) -> bool {
    let way = sub(p, closest.point);
    let length = norm(way);
    length < TOUCH || dot(way, normal).abs() >= ALONG * length
}

/// Share of a sheet's area whose distance is judged. `areas`: `[nodes]`, of the flat sheet (m2). 0 of a sheet without area.
pub fn judged_share(distances: &[NodalDistance], areas: &[f64]) -> f64 {
    let (mut judged, mut all) = (0.0, 0.0);
    for (d, area) in distances.iter().zip(areas) {
        all += area;
        judged += if d.judged { *area } else { 0.0 };
    }
    if all > 0.0 { judged / all } else { 0.0 }
}
