//! What of a part is not draped.

use crate::input::ReportInput;
use crate::read::{Run, last_frame, open, quads};
use plyflow_artifact::{Artifact, On};
use plyflow_model::outline::Point;

/// By ply of a run the undeformed area (m2) that is not draped, of plies that have some; without cells whose middles (m) are `seen` otherwise.
///
/// # Errors
/// Why the run cannot be read.
pub(super) fn undraped(
    input: &ReportInput,
    run: &Run,
    seen: impl Fn(&Point) -> bool,
) -> Result<Vec<(String, f64)>, String> {
    let path = &input.instances[run.instance].artifact;
    let artifact = open(path).map_err(|e| e.to_string())?;
    let mut all = Vec::new();
    for ply in run.facts.plies() {
        let area = of_ply(&artifact, &ply.name, &seen)?;
        if area > 0.0 {
            all.push((ply.name.clone(), area));
        }
    }
    Ok(all)
}

fn of_ply(artifact: &Artifact, ply: &str, seen: impl Fn(&Point) -> bool) -> Result<f64, String> {
    let said = |e: &dyn std::fmt::Display| e.to_string();
    let frame = last_frame(artifact).map_err(|e| said(&e))?;
    let Ok(draped) = artifact.frame_field(ply, frame, On::Cells, "draped") else {
        // A run with forces drapes all.
        return Ok(0.0);
    };
    let body = artifact.body(ply).map_err(|e| said(&e))?;
    let (flat, cells) = artifact.mesh(ply).map_err(|e| said(&e))?;
    let cells = quads(ply, &cells, body.nodes_per_cell).map_err(|e| said(&e))?;
    let corners = cells.iter().map(|c| {
        c.map(|n| {
            let [x, y, _] = flat[n as usize];
            [x, y]
        })
    });
    let bare = corners.zip(&draped).filter(|(_, d)| **d <= 0.5);
    Ok(bare
        .map(|(c, _)| c)
        .filter(|c| !seen(&middle(c)))
        .map(|c| area(&c))
        .sum())
}

/// The middle of a flat cell's corners (m).
pub(super) fn middle(corners: &[Point; 4]) -> Point {
    [0, 1].map(|d| corners.iter().map(|p| p[d]).sum::<f64>() / 4.0)
}

/// The area of a flat cell (m2).
pub(super) fn area([a, b, c, d]: &[Point; 4]) -> f64 {
    let (e, f) = ([c[0] - a[0], c[1] - a[1]], [d[0] - b[0], d[1] - b[1]]);
    0.5 * (e[0] * f[1] - e[1] * f[0]).abs()
}
