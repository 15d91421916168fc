//! What went into a run, as its artifact tells: scene and materials as they were, whatever has become of their files since.

use crate::read::material::Material;
use crate::read::study::Study;
use plyflow_model::artifact::Sheet;
use plyflow_model::friction::Friction;
use plyflow_model::scene::{MirrorPlane, Process};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

/// What went into runs.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Inputs {
    /// The runs, for people.
    pub(crate) runs: Vec<String>,
    /// The study whose tool and history are those of the first of these runs.
    pub(crate) study: usize,
    /// The scene as the artifact has it; null where it has none.
    words: Value,
    /// Name of the scene.
    pub(crate) scene: Option<String>,
    /// The stack, from the tool upwards.
    pub(crate) sheets: Vec<Sheet>,
    /// The materials in the order in which the stack first has them.
    pub(crate) materials: Vec<Law>,
    pub(crate) friction: Option<Friction>,
    pub(crate) process: Option<Process>,
    /// The tool's words in the scene.
    pub(crate) tool: Option<Value>,
    pub(crate) symmetry: Vec<MirrorPlane>,
}

/// A material with the sheets that are made of it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Law {
    /// Names of the sheets.
    pub(crate) sheets: Vec<String>,
    pub(crate) name: String,
    /// Where its numbers come from.
    pub(crate) source: Option<String>,
    /// Its plugin.
    pub(crate) plugin: String,
    /// The plugin's parameters (SI).
    pub(crate) with: Value,
}

/// What a scene says of a material, as an artifact has it.
#[derive(Debug, Deserialize)]
struct Told {
    name: String,
    #[serde(default)]
    source: Option<String>,
    plugin: String,
    #[serde(default)]
    with: Value,
}

/// The inputs of all runs of whole parts, those that are the same once.
pub(crate) fn inputs(material: &Material) -> Vec<Inputs> {
    let mut all: Vec<Inputs> = Vec::new();
    for (n, study) in material.studies.iter().enumerate() {
        let Some(found) = of_study(material, study, n) else {
            continue;
        };
        // A drape has the plies of a scene alone, and no films: what it was given is the same.
        let same = |i: &&mut Inputs| match found.words.is_null() {
            true => i.words.is_null() && i.sheets == found.sheets,
            false => i.words == found.words,
        };
        match all.iter_mut().find(same) {
            Some(known) => {
                known.runs.extend(found.runs);
                if found.sheets.len() > known.sheets.len() {
                    (known.sheets, known.study) = (found.sheets, found.study);
                }
                known.runs.dedup();
            }
            None => all.push(found),
        }
    }
    all
}

fn of_study(material: &Material, study: &Study, n: usize) -> Option<Inputs> {
    let run = study.global.as_ref()?;
    let facts = material.facts.get(run.instance)?.as_ref()?;
    let scene = &facts.provenance["parameters"]["scene"];
    let sheets: Vec<Sheet> = run.facts.sheets.iter().map(as_laid).collect();
    let found = Inputs {
        runs: vec![run.label.clone()],
        study: n,
        words: scene.clone(),
        scene: scene["name"]
            .as_str()
            .map(str::to_owned)
            .or_else(|| run.facts.scene.clone()),
        materials: laws(&scene["sheets"], &sheets),
        friction: told(&scene["friction"]),
        process: told(&scene["process"]),
        tool: Some(scene["tool"].clone()).filter(|t| !t.is_null()),
        symmetry: told(&scene["symmetry"]).unwrap_or_default(),
        sheets,
    };
    Some(found)
}

/// A sheet as it was laid, without what its run made of it.
fn as_laid(sheet: &Sheet) -> Sheet {
    Sheet {
        added_mass: None,
        element: None,
        element_elsewhere: None,
        bending_elements: None,
        mesh_quality: None,
        start: None,
        net_nodes: None,
        offset: 0.0,
        ..sheet.clone()
    }
}

/// What an artifact of today has of a kind; nothing of another program's.
fn told<T: DeserializeOwned>(value: &Value) -> Option<T> {
    serde_json::from_value(value.clone()).ok()
}

fn laws(given: &Value, sheets: &[Sheet]) -> Vec<Law> {
    let mut all: Vec<Law> = Vec::new();
    for sheet in sheets {
        let mut given = given.as_array().into_iter().flatten();
        let Some(own) = given.find(|g| g["name"] == sheet.name.as_str()) else {
            continue;
        };
        let Some(Told {
            name,
            source,
            plugin,
            with,
        }) = told(&own["material"])
        else {
            continue;
        };
        let law = Law {
            sheets: Vec::new(),
            name,
            source,
            plugin,
            with,
        };
        let same =
            |l: &&mut Law| l.name == law.name && l.plugin == law.plugin && l.with == law.with;
        match all.iter_mut().find(same) {
            Some(known) => known.sheets.push(sheet.name.clone()),
            None => all.push(Law {
                sheets: vec![sheet.name.clone()],
                ..law
            }),
        }
    }
    all
}
