//! The block `limits`: how large defects may be. Its keys and units are those of the schema; here it is held against the scenes of the steps.

use crate::diagnostics::{Problems, Source};
use crate::resolved::ResolvedStep;
use crate::yaml::{Kind, Node};
use plyflow_model::workflow::{LimitPlace, Limits};
use std::collections::{BTreeMap, BTreeSet};

/// Plies and regions of the scenes of some steps: of each ply the names of its regions.
type Plies = BTreeMap<String, BTreeSet<String>>;

/// Reads the block and reports where it stands what is wrong with it. `steps`: of all points of a study.
pub(crate) fn limits(
    root: &Node,
    steps: &[ResolvedStep],
    source: &Source,
    problems: &mut Problems,
) -> Option<Limits> {
    let entry = root
        .entry("limits")
        .filter(|e| e.value.kind != Kind::Null)?;
    let before = problems.count();
    // The schema has been checked: what cannot be read has been told.
    let limits: Limits = match serde_json::from_value(entry.value.to_json()) {
        Ok(limits) => limits,
        Err(e) => {
            // Never in silence, should the two ever differ.
            if before == 0 {
                problems.add(source, &entry.value.span, format!("`limits`: {e}"));
            }
            return None;
        }
    };
    if limits.is_empty() {
        let d = problems.add(source, &entry.key_span, "`limits` states no limit");
        d.expected("at least one, such as `wrinkle_height: 1 mm`");
        return None;
    }
    let plies = plies(steps);
    let nodes = entry.value.get("places").map_or(&[][..], Node::items);
    for (node, place) in nodes.iter().zip(&limits.places) {
        stated(node, place, source, problems);
        shaped(node, place, source, problems);
        named(node, place, &plies, source, problems);
    }
    (problems.count() == before).then_some(limits)
}

/// The plies of the scenes that steps have.
fn plies(steps: &[ResolvedStep]) -> Plies {
    let mut all = Plies::new();
    for step in steps {
        let parameters = step.parameters.as_object();
        let scenes = parameters.into_iter().flat_map(|p| p.values());
        for sheet in scenes.flat_map(|s| s["sheets"].as_array().into_iter().flatten()) {
            let Some(name) = sheet["name"].as_str().filter(|_| sheet["kind"] == "ply") else {
                continue;
            };
            let regions = sheet["regions"].as_array().into_iter().flatten();
            let regions = regions.filter_map(|r| r["name"].as_str().map(str::to_owned));
            all.entry(name.to_owned()).or_default().extend(regions);
        }
    }
    all
}

/// Whether a place says where it is and what holds there.
fn stated(node: &Node, place: &LimitPlace, source: &Source, problems: &mut Problems) {
    if place.values.is_empty() {
        let d = problems.add(source, &node.span, "this place has no limit");
        d.expected("at least one, such as `wrinkle_height: 1 mm`");
    }
    let ways = ["region", "polygon", "rectangle"];
    let mut given = ways.iter().filter_map(|k| node.entry(k));
    match (given.next(), given.next()) {
        (Some(first), Some(second)) => {
            let message = format!("`{}` and `{}` of one place", first.key, second.key);
            let d = problems.add(source, &second.key_span, message);
            d.expected("one of `region`, `polygon` and `rectangle`");
        }
        (None, _) if place.ply.is_none() => {
            let d = problems.add(source, &node.span, "this place is nowhere");
            d.expected("`ply`, `region`, `polygon` or `rectangle`");
            d.help("what holds for the whole part stands in `limits` itself, beside `places`");
        }
        _ => {}
    }
}

/// Whether the polygon or rectangle of a place bounds something.
fn shaped(node: &Node, place: &LimitPlace, source: &Source, problems: &mut Problems) {
    if place.polygon.is_some() && place.rectangle.is_some() {
        return;
    }
    let Some(shape) = node.entry("polygon").or(node.entry("rectangle")) else {
        return;
    };
    if let Some(name) = place.polygon.as_ref().and_then(|p| p.input()) {
        let message = "the polygon of a limit cannot come from another step";
        let d = problems.add(source, &shape.value.span, message);
        d.given(format!("input: {name}"));
        d.expected("a list of points, [[x, y], ..], or {circle: {radius: ..}}");
    } else if place.polygon.as_ref().is_some_and(|p| p.unread().is_some()) {
        let message = "the polygon of a limit cannot come from a drawing";
        let d = problems.add(source, &shape.value.span, message);
        d.expected("a list of points, [[x, y], ..], or {circle: {radius: ..}}");
        d.help("name a region of the scene whose polygon is that drawing");
    } else if let Some(Err(e)) = place.corners() {
        let message = format!("`{}` {e}", shape.key);
        problems
            .add(source, &shape.value.span, message)
            .given(shape.value.describe());
    }
}

/// Whether its ply and its region are there.
fn named(node: &Node, place: &LimitPlace, plies: &Plies, source: &Source, problems: &mut Problems) {
    let known = || plies.keys().map(String::as_str);
    if let (Some(at), Some(ply)) = (node.get("ply"), &place.ply)
        && !plies.contains_key(ply)
    {
        let message = format!("no scene of a step has a ply `{ply}`");
        let d = problems.add(source, &at.span, message);
        d.given(ply.clone()).suggest(ply, known());
        return;
    }
    let (Some(at), Some(region)) = (node.get("region"), &place.region) else {
        return;
    };
    let meant = plies
        .iter()
        .filter(|(ply, _)| place.ply.as_ref().is_none_or(|p| p == *ply));
    let regions: BTreeSet<&str> = meant
        .flat_map(|(_, r)| r.iter().map(String::as_str))
        .collect();
    if !regions.contains(region.as_str()) {
        let of = match &place.ply {
            Some(ply) => format!("`{ply}`"),
            None => "the plies".to_owned(),
        };
        let message = format!("there is no region `{region}` of {of} in any scene of a step");
        let d = problems.add(source, &at.span, message);
        d.given(region.clone())
            .suggest(region, regions.iter().copied());
        d.help("name a region of the scene, or give `rectangle` or `polygon` here, which needs no change of the scene");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    #[test]
    fn plies_and_their_regions_are_those_of_every_scene() {
        let step = |parameters: Value| {
            serde_json::from_value::<ResolvedStep>(serde_json::json!({
                "name": "s", "base": null, "role": "r", "plugin": {"name": "p", "version": "1", "path": "/p", "hash": ""}, "components": [],
                "parameters": parameters, "files": [], "inputs": [], "dimensions": [], "output_kind": "k", "collection": false,
                "resources": {"cores": 1, "memory": 0, "time_limit": 0.0}, "retries": 0,
            }))
            .unwrap()
        };
        let film = serde_json::json!({"name": "film", "kind": "diaphragm"});
        let ply = |name: &str, region: &str| serde_json::json!({"name": name, "kind": "ply", "regions": [{"name": region}]});
        let scene = |sheets: Vec<Value>| serde_json::json!({"scene": {"sheets": sheets}, "n": 1});
        let steps = [
            step(scene(vec![film, ply("a", "web")])),
            step(serde_json::json!({})),
            step(scene(vec![ply("a", "flange"), ply("b", "web")])),
        ];
        let found = plies(&steps);
        assert_eq!(found.keys().collect::<Vec<_>>(), ["a", "b"]);
        assert_eq!(found["a"].iter().collect::<Vec<_>>(), ["flange", "web"]);
    }
}
