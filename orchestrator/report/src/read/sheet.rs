//! The ply of a point of a study that stands for it.

use crate::plain::{Shade, Sheet, at_points};
use crate::read::error::{ReadError, form};
use crate::read::facts::{last_frame, open, quads};
use crate::read::plies::judged_distance;
use camino::Utf8Path;
use plyflow_artifact::{Artifact, BodyInfo, On};
use plyflow_model::artifact::{Attributes, CensusBody, Coupon, Defects, Forming, Measurement};
use serde::Deserialize;

/// What kind of artifact the ply is taken from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Source {
    Measurement,
    Defects,
    Forming,
    Coupon,
}

impl Source {
    /// The best first: what measured defects tells more than what only formed.
    pub(crate) const ALL: [Self; 4] = [
        Self::Measurement,
        Self::Defects,
        Self::Forming,
        Self::Coupon,
    ];

    /// The name of the kind.
    pub(crate) fn kind(self) -> &'static str {
        match self {
            Self::Measurement => Measurement::KIND,
            Self::Defects => Defects::KIND,
            Self::Forming => Forming::KIND,
            Self::Coupon => Coupon::KIND,
        }
    }
}

/// The uppermost ply of an artifact, in its last frame; `None` when it has no ply.
///
/// # Errors
/// When what the artifact tells of its plies, or a ply itself, cannot be read.
pub(crate) fn read(path: &Utf8Path, source: Source) -> Result<Option<Sheet>, ReadError> {
    let artifact = open(path)?;
    let Some(body) = uppermost(&artifact, source)? else {
        return Ok(None);
    };
    let frame = match last_frame(&artifact) {
        // Of a scan there is one state alone, which has no flat shape.
        Err(ReadError::NoFrame) if source != Source::Forming => return Ok(None),
        frame => frame?,
    };
    let name = &body.name;
    let (flat, cells) = artifact.mesh(name)?;
    let cells = quads(name, &cells, body.nodes_per_cell)?;
    let points = artifact.frame_points(name, frame)?;
    if points.is_empty() || points.iter().flatten().any(|v| !v.is_finite()) {
        return Err(ReadError::NoPlace(name.clone()));
    }
    let field = |on, what: &str| artifact.frame_field(name, frame, on, what).ok();
    // What is not draped has no shear and no distance, though zeros stand there.
    let draped = field(On::Cells, "draped").filter(|d| d.len() == cells.len());
    let is_draped = |i: usize| draped.as_ref().is_none_or(|d| d[i] > 0.5);
    let kept: Vec<usize> = (0..cells.len()).filter(|i| is_draped(*i)).collect();
    let shear = field(On::Cells, "shear_angle").filter(|s| s.len() == cells.len());
    let shear = shear.map(|s| kept.iter().map(|i| s[*i]).collect::<Vec<f64>>());
    let cells: Vec<[u32; 4]> = kept.iter().map(|i| cells[*i]).collect();
    let deflection = || flat.iter().zip(&points).map(|(a, b)| b[2] - a[2]).collect();
    let (shade, values) = match source {
        Source::Coupon => (Shade::Deflection, deflection()),
        _ => match (judged_distance(&artifact, name, frame), shear) {
            (Some(d), _) if d.len() == points.len() => (Shade::Distance, d),
            (_, Some(s)) => (
                Shade::Shear,
                at_points(&s, cells.as_flattened(), 4, points.len()),
            ),
            _ => (Shade::Nothing, vec![0.0; points.len()]),
        },
    };
    let told = CensusBody::deserialize(&body.attributes);
    Ok(Some(Sheet {
        name: told.map_or_else(|_| name.clone(), |told| told.ply),
        points,
        cells,
        values,
        shade,
    }))
}

/// The body of the uppermost ply.
fn uppermost(artifact: &Artifact, source: Source) -> Result<Option<&BodyInfo>, ReadError> {
    let bodies = &artifact.contents().bodies;
    let is_sheet = |b: &&BodyInfo| b.nodes_per_cell == 4 && b.cells > 0 && b.points > 0;
    let mut sheets = bodies.iter().filter(is_sheet);
    Ok(match source {
        // Bodies stand in the order of the stack, from the tool.
        Source::Measurement | Source::Defects => sheets.next_back(),
        Source::Forming => {
            let told = serde_json::from_str(artifact.attributes());
            let told: Forming = told.map_err(form("attributes"))?;
            let Some(ply) = told.plies().last().filter(|_| told.zone.is_none()) else {
                return Ok(None);
            };
            let body = sheets.find(|b| b.name == ply.name);
            Some(body.ok_or_else(|| ReadError::NoBody(ply.name.clone()))?)
        }
        Source::Coupon => sheets.find(|b| b.moving && b.name != "tool"),
    })
}
