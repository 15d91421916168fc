//! How a formed sheet lies on its tool: the nodal distance of thesis eq. 4.1, signed and less the sheet's own
//! offset.

use crate::closest::Surface;
use plyflow_geometry::vec3::Vec3;

/// Distance of a node from the tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NodalDistance {
    /// Signed distance to the closest point of the tool less the sheet's offset (m): zero where the sheet
    /// lies on the tool or on the sheets below it, positive where it stands off.
    pub value: f64,
    /// Whether the tool is there to conform to. Not so past the tool's free edge, and where the closest point
    /// lies at the tool's foot: there the blank hangs between tool and machine bed.
    pub judged: bool,
    /// The tool's triangle that holds the closest point (index into [`Surface::triangles`]).
    pub triangle: usize,
}

/// Height above the tool's lowest point below which closest points count as its foot (m): `margin`, but never
/// more than half of the tool's height (a flat tool just above the bed is all judged on its top).
pub fn foot_height(tool: &Surface, margin: f64) -> f64 {
    let (low, high) = tool.bounds();
    low[2] + margin.min(0.5 * (high[2] - low[2]))
}

/// Nodal distances of `points` (m). `offset`: distance of the sheet's mid-plane from the tool when all sheets
/// lie on it (m). `foot_margin`: see [`foot_height`].
pub fn nodal_distances(
    tool: &Surface,
    points: &[Vec3],
    offset: f64,
    foot_margin: f64,
) -> Vec<NodalDistance> {
    let foot = foot_height(tool, foot_margin);
    points
        .iter()
        .map(|&p| {
            let closest = tool.closest(p);
            // A tool without height (a plane) has no foot.
            let (low, high) = tool.bounds();
            let at_foot = high[2] > low[2] && closest.point[2] < foot;
            NodalDistance {
                value: closest.signed_distance - offset,
                judged: !closest.on_free_edge && !at_foot,
                triangle: closest.triangle,
            }
        })
        .collect()
}
