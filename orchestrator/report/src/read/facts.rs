//! What an artifact tells of itself.

use crate::read::error::{ReadError, form};
use camino::Utf8Path;
use plyflow_artifact::Artifact;
use serde_json::Value;

/// Opens an artifact.
pub(crate) fn open(path: &Utf8Path) -> Result<Artifact, ReadError> {
    Ok(Artifact::open(path.as_std_path())?)
}

/// What an artifact tells of itself, without its arrays.
#[derive(Debug)]
pub(crate) struct Facts {
    pub(crate) kind: String,
    pub(crate) attributes: Value,
    pub(crate) provenance: Value,
    /// Bodies and arrays in words.
    pub(crate) contents: Vec<String>,
}

impl Facts {
    pub(crate) fn read(path: &Utf8Path) -> Result<Self, ReadError> {
        let artifact = open(path)?;
        let c = artifact.contents();
        let mut contents = Vec::new();
        for b in &c.bodies {
            let fields: Vec<&str> = b.fields.iter().map(|f| f.name.as_str()).collect();
            let with = if fields.is_empty() {
                String::new()
            } else {
                format!("; fields: {}", fields.join(", "))
            };
            contents.push(format!(
                "body {}: {} points, {} cells{with}",
                b.name, b.points, b.cells
            ));
        }
        if c.frames > 0 {
            contents.push(format!("{} frames", c.frames));
        }
        contents.extend(
            (c.arrays.iter()).map(|a| format!("array {} {:?} {}", a.path, a.shape, a.unit)),
        );
        Ok(Self {
            kind: artifact.kind().to_owned(),
            attributes: serde_json::from_str(artifact.attributes()).map_err(form("attributes"))?,
            provenance: serde_json::from_str(artifact.provenance()).map_err(form("provenance"))?,
            contents,
        })
    }

    fn inputs(&self) -> impl Iterator<Item = &Value> {
        self.provenance["inputs"].as_array().into_iter().flatten()
    }

    /// Whether it was made from the artifact of that key.
    pub(crate) fn took(&self, key: &str) -> bool {
        self.inputs().any(|i| i["key"] == key)
    }

    /// Keys of what arrived at a port.
    pub(crate) fn at_port<'a>(&'a self, port: &'a str) -> impl Iterator<Item = &'a str> {
        self.inputs()
            .filter(move |i| i["port"] == port)
            .filter_map(|i| i["key"].as_str())
    }

    /// What its step warns of.
    pub(crate) fn warnings(&self) -> impl Iterator<Item = &str> {
        let told = self.attributes["warnings"].as_array();
        told.into_iter().flatten().filter_map(Value::as_str)
    }

    /// The bound on kinetic over internal energy that its step was given.
    pub(crate) fn kinetic_bound(&self) -> Option<f64> {
        self.provenance["parameters"]["kinetic_bound"].as_f64()
    }
}

/// The last frame of an artifact of a kind that has frames.
pub(crate) fn last_frame(artifact: &Artifact) -> Result<u64, ReadError> {
    let frames = artifact.contents().frames;
    frames.checked_sub(1).ok_or(ReadError::NoFrame)
}

/// The cells of a sheet.
pub(crate) fn quads(body: &str, cells: &[u32], nodes: u32) -> Result<Vec<[u32; 4]>, ReadError> {
    if nodes != 4 {
        let body = body.to_owned();
        return Err(ReadError::NoQuads { body, nodes });
    }
    Ok(cells.as_chunks::<4>().0.to_vec())
}
