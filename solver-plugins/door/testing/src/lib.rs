//! A host in memory: runs a step plugin through its real service table, without HDF5 and without a worker
//! process. For tests of step plugins.
//!
//! It refuses what the contract refuses: NaN and infinities, sizes that do not match, artifacts of the wrong
//! kind, results that the manifest does not declare, a collection that it does not announce.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod services;

use plyflow_model::manifest::{Manifest, Shape};
use plyflow_model::units::parse_quantity;
use plyflow_sdk::abi::{PF_OK, pf_component};
use plyflow_sdk::{On, Step, run_step};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

/// A point (m).
pub(crate) type Vec3 = [f64; 3];

/// A field of a body in one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct MemoryField {
    /// Name.
    pub name: String,
    /// On points or cells.
    pub on: On,
    /// Values per point or cell.
    pub components: u32,
    /// `[rows * components]`.
    pub values: Vec<f64>,
}

/// A body.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MemoryBody {
    /// Name.
    pub name: String,
    /// Reference points (m).
    pub points: Vec<Vec3>,
    /// 3 or 4.
    pub nodes_per_cell: usize,
    /// `[m * nodes_per_cell]`.
    pub cells: Vec<u32>,
    /// What the plugin said of it.
    pub attributes: Value,
    /// Points of each frame (m).
    pub frames: Vec<Vec<Vec3>>,
    /// Fields of each frame.
    pub fields: Vec<Vec<MemoryField>>,
}

impl MemoryBody {
    /// Values of a field in the last frame.
    ///
    /// # Panics
    /// When there is none of that name.
    pub fn last(&self, field: &str) -> &[f64] {
        let fields = self
            .fields
            .last()
            .unwrap_or_else(|| panic!("'{}' has no frame", self.name));
        let found = fields.iter().find(|f| f.name == field);
        &found
            .unwrap_or_else(|| panic!("'{}' has no field '{field}'", self.name))
            .values
    }
}

/// An artifact.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MemoryArtifact {
    /// Artifact kind.
    pub kind: String,
    /// Attributes.
    pub attributes: Value,
    /// Arrays by path: shape and values (u32 arrays as f64).
    pub arrays: BTreeMap<String, (Vec<usize>, Vec<f64>)>,
    /// Frame times (s).
    pub times: Vec<f64>,
    /// Bodies.
    pub bodies: Vec<MemoryBody>,
    /// Results: value and unit.
    pub results: BTreeMap<String, (f64, String)>,
    /// Measured results: value and unit.
    pub measured: BTreeMap<String, (f64, String)>,
    /// Labels of the collection.
    pub collection: Option<Vec<String>>,
    /// Log lines.
    pub log: Vec<String>,
}

impl MemoryArtifact {
    /// The body of that name.
    ///
    /// # Panics
    /// When there is none.
    pub fn body(&self, name: &str) -> &MemoryBody {
        let found = self.bodies.iter().find(|b| b.name == name);
        found.unwrap_or_else(|| panic!("no body '{name}'"))
    }

    /// Value of a result.
    ///
    /// # Panics
    /// When there is none of that name.
    pub fn result(&self, name: &str) -> f64 {
        let found = self.results.get(name);
        found
            .unwrap_or_else(|| panic!("no result '{name}': {:?}", self.results.keys()))
            .0
    }
}

/// One input of a run.
#[derive(Debug, Clone, Copy)]
pub struct MemoryInput<'a> {
    /// Port.
    pub port: &'a str,
    /// Name of the step that it comes from.
    pub step: &'a str,
    /// The artifact.
    pub artifact: &'a MemoryArtifact,
    /// Its fan-out index path.
    pub item: &'a [u64],
    /// Wall and CPU seconds, peak memory (bytes).
    pub cost: [f64; 3],
}

impl<'a> MemoryInput<'a> {
    /// An input without fan-out and cost, from a step that is called as the port is.
    pub fn new(port: &'a str, artifact: &'a MemoryArtifact) -> Self {
        Self {
            port,
            step: port,
            artifact,
            item: &[],
            cost: [0.0; 3],
        }
    }
}

/// Runs a step. `overrides`: parameters as SI JSON; the others get the manifest's defaults. `item`: the
/// step's own fan-out index path.
///
/// # Errors
/// The text that the step failed with.
///
/// # Panics
/// When the manifest is not valid, or an input does not fit its port.
pub fn run<S: Step>(
    overrides: Value,
    inputs: &[MemoryInput<'_>],
    item: &[u64],
) -> Result<MemoryArtifact, String> {
    run_on::<S>(&Machine::default(), overrides, inputs, item)
}

/// What a host offers besides the workflow.
#[derive(Debug, Clone, Copy)]
pub struct Machine {
    /// Threads that the step may use.
    pub threads: u32,
    /// The component (`PF_KIND_*`) of that name; `None`: there is none.
    pub component: fn(u32, &str) -> Option<pf_component>,
}

impl Default for Machine {
    /// One thread, no components.
    fn default() -> Self {
        Self {
            threads: 1,
            component: |_, _| None,
        }
    }
}

/// [`run`] with threads and components.
///
/// # Errors
/// As [`run`].
///
/// # Panics
/// As [`run`].
pub fn run_on<S: Step>(
    machine: &Machine,
    overrides: Value,
    inputs: &[MemoryInput<'_>],
    item: &[u64],
) -> Result<MemoryArtifact, String> {
    let manifest = Manifest::parse(S::MANIFEST).unwrap_or_else(|e| panic!("{e}"));
    let mut parameters = Map::new();
    for (name, declaration) in &manifest.parameters {
        if let Some(value) = &declaration.default {
            parameters.insert(name.clone(), si(value, &declaration.shape));
        }
    }
    for (name, value) in overrides.as_object().into_iter().flatten() {
        assert!(
            manifest.parameters.contains_key(name),
            "no parameter '{name}'"
        );
        parameters.insert(name.clone(), value.clone());
    }
    for (name, port) in &manifest.inputs {
        let wired: Vec<_> = inputs.iter().filter(|i| i.port == name).collect();
        assert!(
            !port.required || !wired.is_empty(),
            "port '{name}' is not wired"
        );
        assert!(
            port.many || wired.len() <= 1,
            "port '{name}' takes one artifact"
        );
        assert!(
            wired.iter().all(|i| port.accepts(&i.artifact.kind)),
            "wrong kind at '{name}'"
        );
    }
    let kind = manifest
        .output
        .as_ref()
        .map(|o| o.kind.clone())
        .unwrap_or_default();
    let state = Mutex::new(services::State {
        machine: *machine,
        manifest,
        inputs: inputs.to_vec(),
        texts: Vec::new(),
        parameters: Value::Object(parameters),
        item: item.to_vec(),
        output: MemoryArtifact {
            kind,
            ..Default::default()
        },
        frame_open: false,
        failure: String::new(),
    });
    let services = services::table((&raw const state).cast_mut().cast());
    let code = unsafe { run_step::<S>(&raw const services) };
    let state = state.into_inner().unwrap_or_else(PoisonError::into_inner);
    match code {
        PF_OK => Ok(state.output),
        code => Err(format!("{} (code {code})", state.failure)),
    }
}

/// A default as written in YAML -> as a plugin gets it.
fn si(value: &Value, shape: &Shape) -> Value {
    match (shape, value) {
        (Shape::Quantity(dimension, _), Value::String(text)) => {
            json!(parse_quantity(text, *dimension).unwrap_or_else(|e| panic!("{e}")))
        }
        (Shape::List(of, _), Value::Array(items)) => {
            items.iter().map(|v| si(v, &of.shape)).collect()
        }
        _ => value.clone(),
    }
}

/// A flat mesh of squares with edges of about `size` (m) over a box `[x0, y0, x1, y1]` (m) at the height `z` (m), rows along x:
/// points, and cells `[m * 4]`, counter-clockwise from above.
pub fn flat_grid(b: [f64; 4], size: f64, z: f64) -> (Vec<Vec3>, Vec<u32>) {
    let n = [0, 1].map(|d| ((b[d + 2] - b[d]) / size).round() as usize);
    let (mut points, mut cells) = (Vec::new(), Vec::new());
    for j in 0..=n[1] {
        for i in 0..=n[0] {
            points.push([b[0] + size * i as f64, b[1] + size * j as f64, z]);
        }
    }
    let node = |i: usize, j: usize| (j * (n[0] + 1) + i) as u32;
    for j in 0..n[1] {
        for i in 0..n[0] {
            cells.extend([
                node(i, j),
                node(i + 1, j),
                node(i + 1, j + 1),
                node(i, j + 1),
            ]);
        }
    }
    (points, cells)
}
