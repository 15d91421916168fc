//! Maps of fields that an artifact carries in its attributes, for every kind of artifact (`maps` in the data model): bodies
//! seen from above, side by side in the colours of one scale.

use crate::plain::{Cells, FieldMap, Panel, at_points};
use crate::read::carried::{list, pretty, to_si, unreadable, without_list};
use crate::read::plies::judged_distance;
use plyflow_artifact::{Artifact, On};
use plyflow_model::artifact;
use serde::Deserialize;
use serde_json::Value;

/// Panels of a map; more would be stamps.
const PANELS: usize = 12;

/// Reads the maps that the attributes of an artifact describe, of at most `room` panels together. What is wrong is said in `wrong`.
pub(crate) fn read(
    attributes: &Value,
    artifact: &Artifact,
    room: usize,
    wrong: &mut Vec<String>,
) -> Vec<FieldMap> {
    let (mut maps, mut room) = (Vec::new(), room);
    for (i, value) in list(attributes, "maps", wrong).iter().enumerate() {
        match without_list::<artifact::Map>(value, "panels") {
            Ok((given, panels)) if panels.len() > room => {
                wrong.push(format!(
                    "map '{}': it is not drawn: the page is full",
                    given.name
                ));
            }
            Ok((given, panels)) => {
                let map = map(&given, &panels, artifact, wrong);
                room -= map.as_ref().map_or(0, |m| m.panels.len());
                maps.extend(map);
            }
            Err(e) => wrong.push(unreadable("map", i, value, &e)),
        }
    }
    maps
}

fn map(
    given: &artifact::Map,
    told: &[Value],
    artifact: &Artifact,
    wrong: &mut Vec<String>,
) -> Option<FieldMap> {
    let of = |text: String| format!("map '{}': {text}", given.name);
    if told.len() > PANELS {
        let all = told.len();
        wrong.push(of(format!(
            "the first {PANELS} of its {all} panels are drawn"
        )));
    }
    let (mut panels, mut factor) = (Vec::new(), 1.0);
    for (i, value) in told.iter().enumerate().take(PANELS) {
        match panel(value, &given.unit, artifact) {
            Ok((panel, per)) => {
                factor = per;
                panels.push(panel);
            }
            Err(e) => wrong.push(of(format!("panel {}: {e}", i + 1))),
        }
    }
    let map = FieldMap {
        title: given.title.clone().unwrap_or_else(|| given.name.clone()),
        unit: pretty(&given.unit),
        factor,
        panels,
    };
    if map.range().is_none() {
        wrong.push(of("it is not drawn: no panel has a value".into()));
        return None;
    }
    Some(map)
}

/// A panel, and the factor from SI to the unit.
fn panel(value: &Value, unit: &str, artifact: &Artifact) -> Result<(Panel, f64), String> {
    let given = artifact::Panel::deserialize(value).map_err(|e| e.to_string())?;
    let text = |e: plyflow_artifact::ArtifactError| e.to_string();
    let body = artifact.body(&given.body).map_err(text)?;
    let frame = artifact.contents().frames.checked_sub(1);
    let frame = frame.ok_or("the artifact has no frame")?;
    let Some(field) = body.fields.iter().find(|f| f.name == given.field) else {
        let names: Vec<&str> = body.fields.iter().map(|f| f.name.as_str()).collect();
        return Err(format!(
            "body '{}' has no field '{}'; its fields are: {}",
            given.body,
            given.field,
            names.join(", ")
        ));
    };
    if field.components != 1 {
        return Err(format!(
            "the field '{}' has {} components; expected one",
            field.name, field.components
        ));
    }
    let (scale, _) = to_si(unit, &field.unit)
        .filter(|(_, o)| *o == 0.0)
        .ok_or_else(|| {
            format!(
                "the field '{}' is in '{}', which cannot be shown in '{unit}'",
                field.name, field.unit
            )
        })?;
    let (_, nodes) = artifact.mesh(&given.body).map_err(text)?;
    let points = artifact.frame_points(&given.body, frame).map_err(text)?;
    let found = artifact.frame_field(&given.body, frame, field.on, &field.name);
    let mut values = found.map_err(text)?;
    if field.name == "nodal_distance" && field.on == On::Points {
        values = judged_distance(artifact, &given.body, frame).unwrap_or(values);
    }
    let each = body.nodes_per_cell as usize;
    if field.on == On::Cells {
        values = at_points(&values, &nodes, each, points.len());
    }
    let panel = Panel {
        label: given.label,
        points,
        cells: Cells { nodes, each },
        values,
    };
    Ok((panel, 1.0 / scale))
}
