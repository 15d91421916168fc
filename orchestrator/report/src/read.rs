//! What is read from an artifact.

use crate::others::{self, Other};
use crate::raster::{Triangles, Vec3};
use camino::Utf8Path;
use plyflow_artifact::{Artifact, On};
use plyflow_model::artifact::ComparedBody;
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeMap;

/// Opens an artifact.
pub(crate) fn open(path: &Utf8Path) -> Result<Artifact, String> {
    Artifact::open(path.as_std_path()).map_err(|e| e.to_string())
}

fn json(what: &str, text: &str) -> Result<Value, String> {
    serde_json::from_str(text).map_err(|e| format!("its {what}: {e}"))
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
    pub(crate) fn read(path: &Utf8Path) -> Result<Self, String> {
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
            c.arrays
                .iter()
                .map(|a| format!("array {} {:?} {}", a.path, a.shape, a.unit)),
        );
        Ok(Self {
            kind: artifact.kind().to_owned(),
            attributes: json("attributes", artifact.attributes())?,
            provenance: json("provenance", artifact.provenance())?,
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
}

/// Histories by name, all of one length; empty when there is none.
#[derive(Debug, Clone, Default)]
pub(crate) struct History {
    pub(crate) columns: BTreeMap<String, Vec<f64>>,
}

impl History {
    pub(crate) fn read(path: &Utf8Path) -> Result<Self, String> {
        let artifact = open(path)?;
        let mut columns = BTreeMap::new();
        for info in &artifact.contents().arrays {
            let Some(name) = info.path.strip_prefix("history/") else {
                continue;
            };
            let (data, shape) = artifact.array_f64(&info.path).map_err(|e| e.to_string())?;
            if shape.len() == 1 {
                columns.insert(name.to_owned(), data);
            }
        }
        let rows = columns.get("time").map_or(0, Vec::len);
        columns.retain(|_, c| c.len() == rows && rows > 1);
        Ok(Self { columns })
    }

    /// A column, if there is one.
    pub(crate) fn get(&self, name: &str) -> Option<&[f64]> {
        self.columns.get(name).map(Vec::as_slice)
    }

    /// Membrane, bending and hourglass energy (J).
    pub(crate) fn internal(&self) -> Option<Vec<f64>> {
        let parts = ["membrane", "bending", "hourglass"].map(|n| self.get(n));
        let rows = parts.iter().flatten().next()?.len();
        Some(
            (0..rows)
                .map(|i| parts.iter().flatten().map(|p| p[i]).sum())
                .collect(),
        )
    }
}

/// The rigid tool.
#[derive(Debug, Clone)]
pub(crate) struct Tool {
    pub(crate) points: Vec<Vec3>,
    pub(crate) mesh: Triangles,
}

/// The body `tool`, if there is one.
pub(crate) fn tool(path: &Utf8Path) -> Result<Option<Tool>, String> {
    let artifact = open(path)?;
    let Some(body) = artifact.contents().body("tool") else {
        return Ok(None);
    };
    let k = body.nodes_per_cell as usize;
    let (points, cells) = artifact.mesh("tool").map_err(|e| e.to_string())?;
    let mesh = Triangles::new(points.len(), &cells, k);
    Ok(Some(Tool { points, mesh }))
}

/// What is wrong with a cell.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum Marked {
    /// Nothing.
    #[default]
    No,
    /// It lies on a wrinkle.
    Wrinkle,
    /// It bridges, or a detection flagged it.
    Other,
}

impl Marked {
    /// Of a cell by the codes of its nodes (1 wrinkle, 2 bridging): it lies on a defect when half of its nodes do.
    fn of_nodes(codes: [f64; 4]) -> Self {
        let wrinkle = codes.iter().filter(|c| (0.5..1.5).contains(*c)).count();
        let any = codes.iter().filter(|c| **c > 0.5).count();
        match (wrinkle, any) {
            (2.., _) => Self::Wrinkle,
            (_, 2..) => Self::Other,
            _ => Self::No,
        }
    }
}

/// A formed ply. Fields are absent when the artifact does not have them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Ply {
    pub(crate) name: String,
    /// Undeformed points (m).
    pub(crate) flat: Vec<Vec3>,
    /// Formed points (m).
    pub(crate) formed: Vec<Vec3>,
    pub(crate) cells: Vec<[u32; 4]>,
    /// Shear angle per cell (rad).
    pub(crate) shear: Option<Vec<f64>>,
    /// Distance from the tool per point (m).
    pub(crate) distance: Option<Vec<f64>>,
    /// Principal curvature of largest magnitude per point (1/m).
    pub(crate) curvature: Option<Vec<f64>>,
    /// How far it moved along z per point (m).
    pub(crate) deflection: Option<Vec<f64>>,
    /// Cells that the detection flagged, or that lie on a defect.
    pub(crate) marked: Vec<Marked>,
    /// Whatever else is told of its points and cells.
    pub(crate) others: Vec<Other>,
}

pub(crate) fn last_frame(artifact: &Artifact) -> Result<u64, String> {
    artifact
        .contents()
        .frames
        .checked_sub(1)
        .ok_or_else(|| "it has no frame".to_owned())
}

pub(crate) fn quads(name: &str, cells: &[u32], k: u32) -> Result<Vec<[u32; 4]>, String> {
    if k != 4 {
        return Err(format!(
            "body '{name}' has cells of {k} nodes; sheets have 4"
        ));
    }
    Ok(cells.as_chunks::<4>().0.to_vec())
}

/// The plies of a `defects` or `comparison` artifact: bodies that are formed and know their flat place; of the latter with their model.
pub(crate) fn judged_plies(path: &Utf8Path) -> Result<Vec<(Option<ComparedBody>, Ply)>, String> {
    let artifact = open(path)?;
    if artifact.contents().bodies.is_empty() {
        return Ok(Vec::new());
    }
    let frame = last_frame(&artifact)?;
    let mut all = Vec::new();
    for body in &artifact.contents().bodies {
        let read = |on, what: &str| artifact.frame_field(&body.name, frame, on, what).ok();
        let (_, cells) = artifact.mesh(&body.name).map_err(|e| e.to_string())?;
        let formed = artifact
            .frame_points(&body.name, frame)
            .map_err(|e| e.to_string())?;
        let cells = quads(&body.name, &cells, body.nodes_per_cell)?;
        let flat = read(On::Points, "undeformed")
            .ok_or_else(|| format!("body '{}' has no field 'undeformed'", body.name))?;
        let marked = match (read(On::Cells, "flag"), read(On::Points, "defect")) {
            (Some(flag), _) => {
                let of = |f: &f64| if *f > 0.5 { Marked::Other } else { Marked::No };
                flag.iter().map(of).collect()
            }
            (None, Some(d)) => cells
                .iter()
                .map(|c| Marked::of_nodes(c.map(|i| d[i as usize])))
                .collect(),
            _ => vec![Marked::No; cells.len()],
        };
        let about = ComparedBody::deserialize(&body.attributes).ok();
        let ply = Ply {
            name: about.as_ref().map_or(&body.name, |a| &a.ply).clone(),
            flat: flat.as_chunks::<3>().0.to_vec(),
            formed,
            shear: read(On::Cells, "shear_angle"),
            distance: read(On::Points, "nodal_distance"),
            curvature: read(On::Points, "curvature_max"),
            deflection: None,
            marked,
            others: others::of_body(&artifact, body, frame, &cells),
            cells,
        };
        all.push((about, ply));
    }
    Ok(all)
}

/// Plies of a `forming` artifact by name, in its last frame.
pub(crate) fn formed_plies(path: &Utf8Path, names: &[String]) -> Result<Vec<Ply>, String> {
    let artifact = open(path)?;
    let frame = last_frame(&artifact)?;
    let one = |name: &String| -> Result<Ply, String> {
        let body = artifact.body(name).map_err(|e| e.to_string())?;
        let (flat, cells) = artifact.mesh(name).map_err(|e| e.to_string())?;
        let cells = quads(name, &cells, body.nodes_per_cell)?;
        Ok(Ply {
            name: name.clone(),
            flat,
            formed: artifact
                .frame_points(name, frame)
                .map_err(|e| e.to_string())?,
            shear: artifact
                .frame_field(name, frame, On::Cells, "shear_angle")
                .ok(),
            marked: vec![Marked::No; cells.len()],
            others: others::of_body(&artifact, body, frame, &cells),
            cells,
            ..Ply::default()
        })
    };
    names.iter().map(one).collect()
}

/// The first moving body of quads in its last frame, with its shear angle and its deflection; `None` when there is
/// none or it cannot be read.
pub(crate) fn shown_sheet(artifact: &Artifact) -> Option<Ply> {
    let frame = last_frame(artifact).ok()?;
    let bodies = &artifact.contents().bodies;
    let body = bodies
        .iter()
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

impl Ply {
    /// Its cells as triangles.
    pub(crate) fn triangles(&self) -> Triangles {
        Triangles::new(self.flat.len(), self.cells.as_flattened(), 4)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_lies_on_what_half_of_its_nodes_lie_on() {
        assert_eq!(Marked::of_nodes([0.0, 1.0, 0.0, 0.0]), Marked::No);
        assert_eq!(Marked::of_nodes([0.0, 1.0, 1.0, 0.0]), Marked::Wrinkle);
        assert_eq!(Marked::of_nodes([2.0, 1.0, 1.0, 2.0]), Marked::Wrinkle);
        assert_eq!(Marked::of_nodes([2.0, 0.0, 1.0, 0.0]), Marked::Other);
    }
}
