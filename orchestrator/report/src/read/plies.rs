//! Plies and tool of an artifact, in its last frame.

use crate::plain::{Cells, Marked, Ply, Tool};
use crate::read::error::ReadError;
use crate::read::facts::{last_frame, open, quads};
use crate::read::others;
use camino::Utf8Path;
use plyflow_artifact::{Artifact, On};
use plyflow_model::artifact::{ComparedBody, Forming};
use serde::Deserialize;

/// The body `tool`, if there is one.
pub(crate) fn tool(path: &Utf8Path) -> Result<Option<Tool>, ReadError> {
    let artifact = open(path)?;
    let Some(body) = artifact.contents().body("tool") else {
        return Ok(None);
    };
    let each = body.nodes_per_cell as usize;
    let (points, nodes) = artifact.mesh("tool")?;
    let cells = Cells { nodes, each };
    Ok(Some(Tool { points, cells }))
}

/// Of a cell by the codes of its nodes (1 wrinkle, 2 bridging): it lies on a defect when half of its nodes do.
fn of_nodes(codes: [f64; 4]) -> Marked {
    let wrinkle = codes.iter().filter(|c| (0.5..1.5).contains(*c)).count();
    let any = codes.iter().filter(|c| **c > 0.5).count();
    match (wrinkle, any) {
        (2.., _) => Marked::Wrinkle,
        (_, 2..) => Marked::Other,
        _ => Marked::No,
    }
}

/// Distances from the tool at the points of a body (m), NaN where they are not judged: there is no tool to lie on. `None` of one without distances.
pub(crate) fn judged_distance(artifact: &Artifact, body: &str, frame: u64) -> Option<Vec<f64>> {
    let field = |what: &str| artifact.frame_field(body, frame, On::Points, what).ok();
    let distance = field("nodal_distance")?;
    // A step of somebody else may judge all.
    let Some(judged) = field("judged").filter(|j| j.len() == distance.len()) else {
        return Some(distance);
    };
    let of = |(d, judged): (f64, f64)| if judged > 0.5 { d } else { f64::NAN };
    Some(distance.into_iter().zip(judged).map(of).collect())
}

/// The plies of a `defects` or `comparison` artifact: bodies that are formed and know their flat place; of the latter with their model.
pub(crate) fn judged_plies(path: &Utf8Path) -> Result<Vec<(Option<ComparedBody>, Ply)>, ReadError> {
    let artifact = open(path)?;
    if artifact.contents().bodies.is_empty() {
        return Ok(Vec::new());
    }
    let frame = last_frame(&artifact)?;
    let mut all = Vec::new();
    for body in &artifact.contents().bodies {
        let read = |on, what: &str| artifact.frame_field(&body.name, frame, on, what).ok();
        let (_, cells) = artifact.mesh(&body.name)?;
        let formed = artifact.frame_points(&body.name, frame)?;
        let cells = quads(&body.name, &cells, body.nodes_per_cell)?;
        let flat = read(On::Points, "undeformed").ok_or_else(|| ReadError::NoField {
            body: body.name.clone(),
            field: "undeformed",
        })?;
        let marked = match (read(On::Cells, "flag"), read(On::Points, "defect")) {
            (Some(flag), _) => {
                let of = |f: &f64| if *f > 0.5 { Marked::Other } else { Marked::No };
                flag.iter().map(of).collect()
            }
            (None, Some(d)) => cells
                .iter()
                .map(|c| of_nodes(c.map(|i| d[i as usize])))
                .collect(),
            _ => vec![Marked::No; cells.len()],
        };
        let about = ComparedBody::deserialize(&body.attributes).ok();
        let ply = Ply {
            name: about.as_ref().map_or(&body.name, |a| &a.ply).clone(),
            flat: flat.as_chunks::<3>().0.to_vec(),
            formed,
            shear: read(On::Cells, "shear_angle"),
            distance: judged_distance(&artifact, &body.name, frame),
            curvature: read(On::Points, "curvature_max"),
            deflection: None,
            marked,
            others: others::of_body(&artifact, body, frame, &cells),
            draped: draped(&artifact, &body.name, frame, cells.len()),
            cells,
            ..Ply::default()
        };
        all.push((about, ply));
    }
    Ok(all)
}

/// Which cells a drape has reached; `None` of an artifact that does not tell.
fn draped(artifact: &Artifact, body: &str, frame: u64, cells: usize) -> Option<Vec<bool>> {
    let told = artifact.frame_field(body, frame, On::Cells, "draped").ok();
    let told = told.filter(|d| d.len() == cells)?;
    Some(told.iter().map(|d| *d > 0.5).collect())
}

/// Plies of a `forming` artifact in the order of the stack, in its last frame.
pub(crate) fn formed_plies(path: &Utf8Path, told: &Forming) -> Result<Vec<Ply>, ReadError> {
    let artifact = open(path)?;
    let frame = last_frame(&artifact)?;
    let one = |name: &str| -> Result<Ply, ReadError> {
        let body = artifact.body(name)?;
        let (flat, cells) = artifact.mesh(name)?;
        let cells = quads(name, &cells, body.nodes_per_cell)?;
        Ok(Ply {
            name: name.to_owned(),
            flat,
            formed: artifact.frame_points(name, frame)?,
            shear: artifact
                .frame_field(name, frame, On::Cells, "shear_angle")
                .ok(),
            marked: vec![Marked::No; cells.len()],
            others: others::of_body(&artifact, body, frame, &cells),
            draped: draped(&artifact, name, frame, cells.len()),
            cells,
            ..Ply::default()
        })
    };
    told.plies().map(|ply| one(&ply.name)).collect()
}

/// The first moving body of quads in its last frame, with its shear angle and its deflection; `None` when there is
/// none or it cannot be read.
pub(crate) fn shown_sheet(artifact: &Artifact) -> Option<Ply> {
    let frame = last_frame(artifact).ok()?;
    let bodies = &artifact.contents().bodies;
    let body = (bodies.iter())
        .find(|b| b.moving && b.nodes_per_cell == 4 && b.cells > 0 && b.name != "tool")?;
    let (flat, cells) = artifact.mesh(&body.name).ok()?;
    let formed = artifact.frame_points(&body.name, frame).ok()?;
    let cells = quads(&body.name, &cells, body.nodes_per_cell).ok()?;
    let shear = artifact.frame_field(&body.name, frame, On::Cells, "shear_angle");
    let deflection = flat.iter().zip(&formed).map(|(a, b)| b[2] - a[2]);
    Some(Ply {
        name: body.name.clone(),
        shear: shear.ok().filter(|s| s.len() == cells.len()),
        deflection: Some(deflection.collect()),
        marked: vec![Marked::No; cells.len()],
        flat,
        formed,
        cells,
        ..Ply::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_lies_on_what_half_of_its_nodes_lie_on() {
        assert_eq!(of_nodes([0.0, 1.0, 0.0, 0.0]), Marked::No);
        assert_eq!(of_nodes([0.0, 1.0, 1.0, 0.0]), Marked::Wrinkle);
        assert_eq!(of_nodes([2.0, 1.0, 1.0, 2.0]), Marked::Wrinkle);
        assert_eq!(of_nodes([2.0, 0.0, 1.0, 0.0]), Marked::Other);
    }
}
