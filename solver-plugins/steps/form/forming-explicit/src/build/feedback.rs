//! A whole scene of which fine runs drive parts.

use crate::boundary::CutDrive;
use crate::error::{FormingError, Result};
use crate::forming::Forming;
use crate::request::Feedback;
use plyflow_geometry::vec3::{Vec3, norm, sub};
use plyflow_mechanics::mirror::Planes;

/// Drives nodes of the plies of a whole scene as fine runs have moved them.
///
/// # Errors
/// What was fed back is of other meshes, or has too few frames.
pub fn feed_back(forming: &mut Forming, input: Feedback) -> Result<()> {
    if input.time.len() < 2 {
        let text = "the feedback has fewer than two frames";
        return Err(FormingError::Input(text.into()));
    }
    if forming.model.planes() != Planes::default() {
        let text = "what is fed back is of the whole scene, and this scene is computed beside mirror planes: leave out its `symmetry`";
        return Err(FormingError::Input(text.into()));
    }
    let mut nodes = Vec::new();
    let mut drive = CutDrive::new(input.time);
    for sheet in &input.sheets {
        let body = forming.plies().find(|(body, _)| body.name == sheet.name);
        let (body, _) = body.ok_or_else(|| {
            FormingError::Input(format!(
                "what is fed back moves '{}', which is no ply of this scene",
                sheet.name
            ))
        })?;
        let own = forming.reference_points(body);
        let near = |(a, b): (&Vec3, &Vec3)| norm(sub(*a, *b)) < SAME_PLACE;
        if own.len() != sheet.points.len() || !own.iter().zip(&sheet.points).all(near) {
            return Err(FormingError::Input(format!(
                "what is fed back was made for another mesh of ply '{}' ({} nodes; this run has {}): give this run the scene and \
                 the `element_size` of the coarse run that it came from",
                sheet.name,
                sheet.points.len(),
                own.len()
            )));
        }
        let all = body.sheet.nodes(&forming.model);
        nodes.extend(sheet.driven.iter().map(|n| all[*n as usize]));
        drive.add(sheet);
    }
    forming.model.drive_also(nodes, Box::new(drive));
    let_drive_decide(forming);
    Ok(())
}

/// Takes nodes that are driven out of contacts with what does not give way to them: rigid parts, other plies, whose nodes there are driven too, and
/// folds of their own ply, which are mostly driven as a whole. Where they are has been decided, by runs with finer elements; coarse ones stand
/// elsewhere off tool and plies, and a multiplier that cannot move its node grows for ever. The films give way.
fn let_drive_decide(forming: &mut Forming) {
    let plies: Vec<usize> = forming.plies().map(|(body, _)| body.sheet.0).collect();
    forming.model.release_driven(&plies);
}

/// Places nearer than this are the same (m).
const SAME_PLACE: f64 = 1e-9;
