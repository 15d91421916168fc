//! Plies of a run on their way: some of the frames that its artifact has.

use crate::plain::{Frame, FramePly, Frames, Ply, Vec3};
use crate::read::error::ReadError;
use crate::read::facts::open;
use camino::Utf8Path;
use plyflow_artifact::{Artifact, On};

/// Frames that are read at most, the last one not counted; a slider has no use for more.
const MOST: u64 = 24;
/// Points of all plies in all frames that are read at most.
const POINTS: u64 = 2_000_000;

/// The way of `plies` in the run of an artifact, from its first frame on; `None` where the artifact has one frame alone, is not of the same
/// meshes, or has so many points that fewer than two frames would be read.
///
/// # Errors
/// When the artifact cannot be read.
pub(crate) fn read(path: &Utf8Path, plies: &[Ply]) -> Result<Option<Frames>, ReadError> {
    let artifact = open(path)?;
    let times = artifact.times();
    let points: u64 = plies.iter().map(|p| p.formed.len() as u64).sum();
    let last = artifact.contents().frames.saturating_sub(1);
    let count = MOST.min(last).min(POINTS / points.max(1));
    let is_same = |p: &Ply| {
        let body = artifact.contents().body(&p.name);
        body.is_some_and(|b| {
            b.points as usize == p.formed.len() && b.cells as usize == p.cells.len()
        })
    };
    if plies.is_empty() || count < 2.min(last.max(1)) || !plies.iter().all(is_same) {
        return Ok(None);
    }
    let (start, end) = (tool_at(&artifact, None)?, times.get(last as usize));
    let mut all = Vec::new();
    // Evenly, from the first one on.
    for k in (0..count).map(|i| i * last / count) {
        let mut of_plies = Vec::new();
        for ply in plies {
            let shear = artifact
                .frame_field(&ply.name, k, On::Cells, "shear_angle")
                .ok();
            of_plies.push(FramePly {
                formed: artifact.frame_points(&ply.name, k)?,
                shear: shear.filter(|s| s.len() == ply.cells.len()),
            });
        }
        let moved = tool_at(&artifact, Some(k))?.zip(start);
        all.push(Frame {
            time: times.get(k as usize).copied().unwrap_or_default(),
            plies: of_plies,
            tool: moved.map_or([0.0; 3], |(now, end)| [0, 1, 2].map(|d| now[d] - end[d])),
        });
    }
    Ok(Some(Frames {
        all,
        end: end.copied().unwrap_or_default(),
    }))
}

/// Where the first point of the tool lies: as the view shows it, or in a frame. `None` where there is no tool, or one that does not move.
fn tool_at(artifact: &Artifact, frame: Option<u64>) -> Result<Option<Vec3>, ReadError> {
    let Some(_) = artifact.contents().body("tool").filter(|b| b.moving) else {
        return Ok(None);
    };
    let points = match frame {
        Some(k) => artifact.frame_points("tool", k)?,
        None => artifact.mesh("tool")?.0,
    };
    Ok(points.first().copied())
}
