//! Defects that were measured on the plies of a run (`defect-measurement`).

use crate::plain::{Line, Place, Vec3, id_of_row, of_cells};
use crate::read::error::{ReadError, form};
use crate::read::facts::{Facts, open};
use camino::Utf8Path;
use plyflow_artifact::{Artifact, On};
use plyflow_model::artifact::MeasuredDefect;
use serde::Deserialize;

/// Where the defects lie that the attributes of a measurement list, by the nodes that the artifact gives them, in the order of its table; those on bodies
/// without cells of four nodes (scans) have no flat shape, and no place.
pub(crate) fn read(
    path: &Utf8Path,
    facts: &Facts,
    instance: usize,
) -> Result<Vec<Place>, ReadError> {
    let list = &facts.attributes["defects"];
    let list = Vec::<MeasuredDefect>::deserialize(list).map_err(form("attribute 'defects'"))?;
    let artifact = open(path)?;
    let mut places = Vec::new();
    for (row, given) in list.iter().enumerate() {
        let Some((flat, formed, cells)) = cells_of(&artifact, given)? else {
            continue;
        };
        let mut place = of_cells(&flat, &formed, &cells);
        if given.ridge.len() > 1 {
            place.lines.push(Line {
                flat: Vec::new(),
                formed: given.ridge.clone(),
            });
        }
        places.push(Place {
            id: id_of_row(instance, row),
            label: given.number.to_string(),
            ply: given.on.clone(),
            ..place
        });
    }
    Ok(places)
}

type Cells = (Vec<Vec3>, Vec<Vec3>, Vec<[u32; 4]>);

/// Flat and formed points of the body of a defect, and the cells of which half of the nodes bear its number;
/// where there is none, those of which one does.
fn cells_of(artifact: &Artifact, given: &MeasuredDefect) -> Result<Option<Cells>, ReadError> {
    let Ok(body) = artifact.body(&given.on) else {
        return Ok(None);
    };
    let Some(frame) = artifact.contents().frames.checked_sub(1) else {
        return Ok(None);
    };
    if body.nodes_per_cell != 4 {
        return Ok(None);
    }
    let (flat, cells) = artifact.mesh(&given.on)?;
    let formed = artifact.frame_points(&given.on, frame)?;
    let number = artifact.frame_field(&given.on, frame, On::Points, "defect")?;
    let bears = |i: &u32| (number[*i as usize] - given.number as f64).abs() < 0.5;
    let with = |least: usize| -> Vec<[u32; 4]> {
        let mine = |c: &&[u32; 4]| c.iter().filter(|i| bears(i)).count() >= least;
        let all = cells.as_chunks::<4>().0.iter();
        all.filter(mine).copied().collect()
    };
    let mut found = with(2);
    if found.is_empty() {
        found = with(1);
    }
    Ok((!found.is_empty()).then_some((flat, formed, found)))
}
