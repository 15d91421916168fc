//! Where a single film and the plies under it begin and end beside the tool.

use crate::boundary::FrameDrive;
use crate::error::{FormingError, Result};
use crate::stack::{Parts, StackSheet, ToolSurfaces};
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::contact::RigidSurface;
use plyflow_mechanics::model::Drive;
use plyflow_model::scene::SingleDiaphragm;
use plyflow_tooling::ToolMesh;
use std::sync::Arc;

/// How far (m) the frame may reach into the tool: rounding of drawings.
const TOUCH: f64 = 1e-5;

/// How often plies are raised until they touch the tool nowhere too deep: a distance is that along a slope, so one step may fall short.
const RAISES: usize = 20;

/// Raises all sheets until the plies are nowhere in the tool. Flat plies lie on its highest face, but elements that are as long as the tool
/// (`docs/decisions/0028-elements-as-long-as-the-tool.md`) have their nodes off its edges. Plies that begin in there would be thrown off.
pub fn lift(parts: &mut Parts, stack: &[StackSheet], tool: &mut ToolSurfaces) {
    let plies: Vec<(usize, f64, Arc<dyn RigidSurface>)> = (stack.iter().enumerate())
        .filter(|(_, sheet)| sheet.is_ply())
        .map(|(k, sheet)| {
            let spec = &parts.specs[k];
            let place = |n: u32| parts.points[spec.nodes[n as usize] as usize];
            let cells = spec.cells.iter().map(|c| c.map(place));
            (k, sheet.offset, tool.of_cells(cells))
        })
        .collect();
    for _ in 0..RAISES {
        let depth = |(k, offset, surface): &(usize, f64, Arc<dyn RigidSurface>)| {
            let nodes = parts.specs[*k].nodes.iter();
            let depths = nodes.map(|n| offset - surface.distance(parts.points[*n as usize]).0);
            depths.fold(0.0, f64::max)
        };
        let deepest = plies.iter().map(depth).fold(0.0, f64::max);
        if deepest < 1e-9 {
            break;
        }
        parts.points.iter_mut().for_each(|p| p[2] += deepest);
    }
}

/// Whether the frame comes down, and ends over the tool or beside it, not in it.
///
/// # Errors
/// Where it would not, with the height that would do.
pub fn check(process: &SingleDiaphragm, frame: &FrameDrive, tool: &ToolMesh) -> Result<()> {
    let [start, end] = frame.cycle.frame;
    let height = process.frame_height.map_or(0.0, |h| h.si());
    if start < end {
        return Err(FormingError::Scene(format!(
            "process.single_diaphragm.frame_height: given {:.3} mm, the film begins lower, at {:.3} mm; expected a frame that comes down: a lower \
             `frame_height`, or more `clearance`",
            1e3 * height,
            1e3 * (start - (end - height))
        )));
    }
    let t = frame.cycle.duration();
    let over = (0..frame.plan.len()).map(|k| {
        let at = frame.position(k, t);
        (at, top_over(tool, at))
    });
    let Some((at, top)) = over.max_by(|a, b| a.1.total_cmp(&b.1)) else {
        return Ok(());
    };
    if top <= height + TOUCH {
        return Ok(());
    }
    Err(FormingError::Scene(format!(
        "process.single_diaphragm.frame_height: given {:.3} mm, at ({:.1}, {:.1}) mm the frame would end in the tool; expected the height of the face on \
         which it lies: `frame_height: {:.3} mm`, or a frame that goes around the tool",
        1e3 * height,
        1e3 * at[0],
        1e3 * at[1],
        1e3 * top
    )))
}

/// Height (m) of the tool's highest surface over or under a place; 0 beside it.
fn top_over(tool: &ToolMesh, p: Vec3) -> f64 {
    let over = tool.triangles.iter().filter_map(|t| {
        let [a, b, c] = t.map(|n| tool.points[n as usize]);
        let cross = |u: Vec3, v: Vec3, w: Vec3| {
            (v[0] - u[0]) * (w[1] - u[1]) - (v[1] - u[1]) * (w[0] - u[0])
        };
        let whole = cross(a, b, c);
        let share = [cross(p, b, c), cross(p, c, a), cross(p, a, b)].map(|s| s / whole);
        // Walls that stand upright have no area from above.
        let inside = whole.abs() > 1e-18 && share.iter().all(|s| *s >= -1e-9);
        inside.then(|| share[0] * a[2] + share[1] * b[2] + share[2] * c[2])
    });
    over.fold(0.0, f64::max)
}
