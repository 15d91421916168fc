//! A host in memory: runs a step plugin through its real service table, without HDF5 and without a worker
//! process. For tests of step plugins.
//!
//! It refuses what the contract refuses: NaN and infinities, sizes that do not match, artifacts of the wrong
//! kind, results that the manifest does not declare, a collection that it does not announce.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod memory;
mod services;

pub use memory::{Components, Machine, MemoryArtifact, MemoryBody, MemoryField, MemoryInput};

use memory::Vec3;
use plyflow_model::manifest::{Manifest, Shape};
use plyflow_model::units::parse_quantity;
use plyflow_sdk::abi::PF_OK;
use plyflow_sdk::{Step, run_step};
use serde_json::{Map, Value, json};
use std::sync::{Mutex, PoisonError};

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
    let parameters = parameters_of(&manifest, &overrides);
    check_inputs(&manifest, inputs);
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
        parameters,
        item: item.to_vec(),
        output: MemoryArtifact {
            kind,
            ..Default::default()
        },
        frame_open: false,
        failure: String::new(),
    });
    let services = services::table((&raw const state).cast_mut().cast());
    // SAFETY: a whole table, which lives through the call with the state behind it.
    let code = unsafe { run_step::<S>(&raw const services) };
    let state = state.into_inner().unwrap_or_else(PoisonError::into_inner);
    match code {
        PF_OK => Ok(state.output),
        code => Err(format!("{} (code {code})", state.failure)),
    }
}

/// What a plugin gets: the manifest's defaults where nothing overrides them.
fn parameters_of(manifest: &Manifest, overrides: &Value) -> Value {
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
    Value::Object(parameters)
}

/// # Panics
/// When an input does not fit its port.
fn check_inputs(manifest: &Manifest, inputs: &[MemoryInput<'_>]) {
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
