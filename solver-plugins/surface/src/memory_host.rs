//! A host in memory: runs a step plugin through its real service table, without HDF5 and without a worker
//! process. For tests of step plugins.
//!
//! It refuses what the contract refuses: NaN and infinities, sizes that do not match, artifacts of the wrong
//! kind, results that the manifest does not declare, a collection that it does not announce.

use crate::vector::Vec3;
use plyflow_model::manifest::{Manifest, Shape};
use plyflow_model::units::parse_quantity;
use plyflow_sdk::abi::*;
use plyflow_sdk::{On, Step, run_step};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::ffi::c_void;

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
    /// The artifact.
    pub artifact: &'a MemoryArtifact,
    /// Its fan-out index path.
    pub item: &'a [u64],
    /// Wall and CPU seconds, peak memory (bytes).
    pub cost: [f64; 3],
}

impl<'a> MemoryInput<'a> {
    /// An input without fan-out and cost.
    pub fn new(port: &'a str, artifact: &'a MemoryArtifact) -> Self {
        Self {
            port,
            artifact,
            item: &[],
            cost: [0.0; 3],
        }
    }
}

struct State<'a> {
    manifest: Manifest,
    inputs: Vec<MemoryInput<'a>>,
    texts: Vec<Box<str>>,
    parameters: Value,
    item: Vec<u64>,
    output: MemoryArtifact,
    frame_open: bool,
    failure: String,
}

impl State<'_> {
    /// Keeps a text until the run ends.
    fn keep(&mut self, text: String) -> pf_str {
        self.texts.push(text.into_boxed_str());
        self.texts
            .last()
            .map_or(pf_str::new(""), |t| pf_str::new(t))
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
    let mut state = State {
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
    };
    let services = table((&raw mut state).cast());
    match unsafe { run_step::<S>(&raw const services) } {
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
        (Shape::List(of), Value::Array(items)) => items.iter().map(|v| si(v, &of.shape)).collect(),
        _ => value.clone(),
    }
}

fn table(host: *mut c_void) -> pf_services {
    pf_services {
        size: size_of::<pf_services>() as u64,
        host,
        log,
        progress: no_progress,
        cancelled: never,
        fail,
        threads: one,
        parameters,
        scratch: nothing,
        inputs,
        item: own_item,
        attributes,
        array_info,
        array_read,
        meshes,
        mesh_read,
        frame_points_read,
        frame_field_read,
        attributes_write,
        array_write,
        mesh_define,
        frame_begin,
        frame_points,
        frame_field,
        frame_end,
        result,
        collection,
        find_component: no_component,
    }
}

/// The state behind a host pointer. Every call ends its borrow before it returns.
unsafe fn state<'a>(host: *mut c_void) -> &'a mut State<'a> {
    unsafe { &mut *host.cast() }
}

fn text(s: pf_str) -> String {
    unsafe { s.as_str() }.unwrap_or("").to_owned()
}

unsafe extern "C" fn no_progress(_: *mut c_void, _: *const pf_progress) {}

unsafe extern "C" fn never(_: *mut c_void) -> i32 {
    0
}

unsafe extern "C" fn one(_: *mut c_void) -> u32 {
    1
}

unsafe extern "C" fn nothing(_: *mut c_void) -> pf_str {
    pf_str::new("")
}

unsafe extern "C" fn no_component(_: *mut c_void, _: u32, _: pf_str, _: *mut pf_component) -> i32 {
    PF_NOT_FOUND
}

unsafe extern "C" fn log(host: *mut c_void, _: u32, line: pf_str) {
    unsafe { state(host) }.output.log.push(text(line));
}

unsafe extern "C" fn fail(host: *mut c_void, why: pf_str) {
    unsafe { state(host) }.failure = text(why);
}

unsafe extern "C" fn parameters(host: *mut c_void) -> pf_str {
    let s = unsafe { state(host) };
    s.keep(s.parameters.to_string())
}

unsafe extern "C" fn inputs(host: *mut c_void) -> pf_str {
    let s = unsafe { state(host) };
    let list: Value = (s.inputs.iter().enumerate())
        .map(|(handle, i)| {
            json!({"handle": handle, "port": i.port, "step": i.port, "kind": i.artifact.kind, "item": i.item,
                   "cost": {"wall_seconds": i.cost[0], "cpu_seconds": i.cost[1], "peak_memory": i.cost[2]}})
        })
        .collect();
    s.keep(list.to_string())
}

unsafe extern "C" fn own_item(host: *mut c_void) -> pf_str {
    let s = unsafe { state(host) };
    s.keep(json!(s.item).to_string())
}

unsafe extern "C" fn attributes(host: *mut c_void, handle: u32) -> pf_str {
    let s = unsafe { state(host) };
    s.keep(s.inputs[handle as usize].artifact.attributes.to_string())
}

unsafe extern "C" fn array_info(
    host: *mut c_void,
    handle: u32,
    path: pf_str,
    info: *mut pf_array_info,
) -> i32 {
    let s = unsafe { state(host) };
    let Some((shape, _)) = s.inputs[handle as usize].artifact.arrays.get(&text(path)) else {
        return PF_NOT_FOUND;
    };
    let mut found = pf_array_info {
        dtype: PF_F64,
        rank: shape.len() as u32,
        ..Default::default()
    };
    for (to, from) in found.shape.iter_mut().zip(shape) {
        *to = *from as u64;
    }
    unsafe { *info = found };
    PF_OK
}

unsafe extern "C" fn array_read(
    host: *mut c_void,
    handle: u32,
    path: pf_str,
    dtype: u32,
    buffer: *mut c_void,
    bytes: u64,
) -> i32 {
    let s = unsafe { state(host) };
    let Some((_, values)) = s.inputs[handle as usize].artifact.arrays.get(&text(path)) else {
        return PF_NOT_FOUND;
    };
    let width = if dtype == PF_F64 { 8 } else { 4 };
    if bytes != width * values.len() as u64 {
        return PF_BAD_SHAPE;
    }
    for (i, &v) in values.iter().enumerate() {
        match dtype {
            PF_F64 => unsafe { *buffer.cast::<f64>().add(i) = v },
            _ => unsafe { *buffer.cast::<u32>().add(i) = v as u32 },
        }
    }
    PF_OK
}

unsafe extern "C" fn meshes(host: *mut c_void, handle: u32) -> pf_str {
    let s = unsafe { state(host) };
    let artifact = s.inputs[handle as usize].artifact;
    let bodies: Vec<Value> = (artifact.bodies.iter())
        .map(|b| {
            let fields: Vec<Value> = (b.fields.last().into_iter().flatten())
                .map(|f| {
                    let on = if f.on == On::Points { "points" } else { "cells" };
                    json!({"name": f.name, "on": on, "components": f.components, "unit": ""})
                })
                .collect();
            json!({"name": b.name, "points": b.points.len(), "cells": b.cells.len() / b.nodes_per_cell,
                   "nodes_per_cell": b.nodes_per_cell, "attributes": b.attributes, "fields": fields})
        })
        .collect();
    s.keep(json!({"times": artifact.times, "bodies": bodies}).to_string())
}

fn find<'a>(s: &State<'a>, handle: u32, name: pf_str) -> Option<&'a MemoryBody> {
    let name = text(name);
    s.inputs[handle as usize]
        .artifact
        .bodies
        .iter()
        .find(|b| b.name == name)
}

unsafe extern "C" fn mesh_read(
    host: *mut c_void,
    handle: u32,
    name: pf_str,
    points: *mut f64,
    cells: *mut u32,
) -> i32 {
    let Some(body) = find(unsafe { state(host) }, handle, name) else {
        return PF_NOT_FOUND;
    };
    unsafe {
        points.copy_from_nonoverlapping(body.points.as_ptr().cast(), 3 * body.points.len());
        cells.copy_from_nonoverlapping(body.cells.as_ptr(), body.cells.len());
    }
    PF_OK
}

unsafe extern "C" fn frame_points_read(
    host: *mut c_void,
    handle: u32,
    name: pf_str,
    frame: u64,
    points: *mut f64,
) -> i32 {
    let s = unsafe { state(host) };
    let Some(body) = find(s, handle, name) else {
        return PF_NOT_FOUND;
    };
    if frame as usize >= s.inputs[handle as usize].artifact.times.len() {
        return PF_NOT_FOUND;
    }
    // A body that does not move has its reference points in every frame.
    let from = body.frames.get(frame as usize).unwrap_or(&body.points);
    unsafe { points.copy_from_nonoverlapping(from.as_ptr().cast(), 3 * from.len()) };
    PF_OK
}

unsafe extern "C" fn frame_field_read(
    host: *mut c_void,
    handle: u32,
    body: pf_str,
    frame: u64,
    _on: u32,
    name: pf_str,
    values: *mut f64,
    count: u64,
) -> i32 {
    let Some(body) = find(unsafe { state(host) }, handle, body) else {
        return PF_NOT_FOUND;
    };
    let name = text(name);
    let fields = body.fields.get(frame as usize);
    let Some(field) = fields.and_then(|f| f.iter().find(|f| f.name == name)) else {
        return PF_NOT_FOUND;
    };
    if field.values.len() as u64 != count {
        return PF_BAD_SHAPE;
    }
    unsafe { values.copy_from_nonoverlapping(field.values.as_ptr(), field.values.len()) };
    PF_OK
}

unsafe extern "C" fn attributes_write(host: *mut c_void, json: pf_str) -> i32 {
    match serde_json::from_str::<Value>(&text(json)) {
        Ok(value) if value.is_object() => {
            unsafe { state(host) }.output.attributes = value;
            PF_OK
        }
        _ => PF_BAD_VALUE,
    }
}

unsafe extern "C" fn array_write(
    host: *mut c_void,
    path: pf_str,
    info: *const pf_array_info,
    _unit: pf_str,
    data: *const c_void,
) -> i32 {
    let info = unsafe { &*info };
    let shape: Vec<usize> = info.shape[..info.rank as usize]
        .iter()
        .map(|&n| n as usize)
        .collect();
    let count = shape.iter().product();
    let values: Vec<f64> = match info.dtype {
        PF_F64 => (0..count)
            .map(|i| unsafe { *data.cast::<f64>().add(i) })
            .collect(),
        PF_U32 => (0..count)
            .map(|i| f64::from(unsafe { *data.cast::<u32>().add(i) }))
            .collect(),
        _ => return PF_BAD_VALUE,
    };
    if values.iter().any(|v| !v.is_finite()) {
        return PF_BAD_VALUE;
    }
    let taken = unsafe { state(host) }
        .output
        .arrays
        .insert(text(path), (shape, values));
    if taken.is_some() { PF_BAD_VALUE } else { PF_OK }
}

unsafe extern "C" fn mesh_define(
    host: *mut c_void,
    name: pf_str,
    n: u64,
    points: *const f64,
    m: u64,
    k: u32,
    cells: *const u32,
    attributes: pf_str,
) -> i32 {
    let output = &mut unsafe { state(host) }.output;
    let points = (0..n as usize)
        .map(|i| [0, 1, 2].map(|d| unsafe { *points.add(3 * i + d) }))
        .collect::<Vec<Vec3>>();
    let cells: Vec<u32> = (0..m as usize * k as usize)
        .map(|i| unsafe { *cells.add(i) })
        .collect();
    let name = text(name);
    let bad = points.iter().flatten().any(|v| !v.is_finite())
        || cells.iter().any(|&i| u64::from(i) >= n)
        || !output.times.is_empty()
        || output.bodies.iter().any(|b| b.name == name);
    if bad {
        return PF_BAD_VALUE;
    }
    let attributes = serde_json::from_str(&text(attributes)).unwrap_or(Value::Null);
    output.bodies.push(MemoryBody {
        name,
        points,
        nodes_per_cell: k as usize,
        cells,
        attributes,
        ..Default::default()
    });
    PF_OK
}

unsafe extern "C" fn frame_begin(host: *mut c_void, time: f64) -> i32 {
    let s = unsafe { state(host) };
    if s.frame_open || !time.is_finite() || s.output.times.last().is_some_and(|&t| t >= time) {
        return PF_BAD_VALUE;
    }
    s.frame_open = true;
    s.output.times.push(time);
    for body in &mut s.output.bodies {
        body.frames.push(body.points.clone());
        body.fields.push(Vec::new());
    }
    PF_OK
}

unsafe extern "C" fn frame_points(
    host: *mut c_void,
    name: pf_str,
    points: *const f64,
    n: u64,
) -> i32 {
    let name = text(name);
    let bodies = &mut unsafe { state(host) }.output.bodies;
    let Some(body) = bodies.iter_mut().find(|b| b.name == name) else {
        return PF_NOT_FOUND;
    };
    let Some(frame) = body.frames.last_mut() else {
        return PF_BAD_VALUE;
    };
    if frame.len() as u64 != n {
        return PF_BAD_SHAPE;
    }
    for (i, p) in frame.iter_mut().enumerate() {
        *p = [0, 1, 2].map(|d| unsafe { *points.add(3 * i + d) });
    }
    if frame.iter().flatten().all(|v| v.is_finite()) {
        PF_OK
    } else {
        PF_BAD_VALUE
    }
}

unsafe extern "C" fn frame_field(
    host: *mut c_void,
    body: pf_str,
    on: u32,
    name: pf_str,
    components: u32,
    _unit: pf_str,
    values: *const f64,
    count: u64,
) -> i32 {
    let body = text(body);
    let bodies = &mut unsafe { state(host) }.output.bodies;
    let Some(body) = bodies.iter_mut().find(|b| b.name == body) else {
        return PF_NOT_FOUND;
    };
    let (on, rows) = match on {
        PF_ON_POINTS => (On::Points, body.points.len()),
        _ => (On::Cells, body.cells.len() / body.nodes_per_cell),
    };
    if rows as u64 * u64::from(components) != count {
        return PF_BAD_SHAPE;
    }
    let values: Vec<f64> = (0..count as usize)
        .map(|i| unsafe { *values.add(i) })
        .collect();
    if values.iter().any(|v| !v.is_finite()) {
        return PF_BAD_VALUE;
    }
    let Some(fields) = body.fields.last_mut() else {
        return PF_BAD_VALUE;
    };
    fields.push(MemoryField {
        name: text(name),
        on,
        components,
        values,
    });
    PF_OK
}

unsafe extern "C" fn frame_end(host: *mut c_void) -> i32 {
    let s = unsafe { state(host) };
    if std::mem::take(&mut s.frame_open) {
        PF_OK
    } else {
        PF_BAD_VALUE
    }
}

unsafe extern "C" fn result(
    host: *mut c_void,
    name: pf_str,
    value: f64,
    unit: pf_str,
    flags: u32,
) -> i32 {
    let s = unsafe { state(host) };
    let (name, unit) = (text(name), text(unit));
    let measured = flags & PF_RESULT_MEASURED != 0;
    let declared = s
        .manifest
        .result(&name)
        .is_some_and(|d| d.unit == unit && d.measured == measured);
    if !value.is_finite() || !declared {
        return PF_BAD_VALUE;
    }
    let to = if measured {
        &mut s.output.measured
    } else {
        &mut s.output.results
    };
    if to.insert(name, (value, unit)).is_some() {
        PF_BAD_VALUE
    } else {
        PF_OK
    }
}

unsafe extern "C" fn collection(host: *mut c_void, n: u64, names: pf_str) -> i32 {
    let s = unsafe { state(host) };
    let names: Vec<String> = serde_json::from_str(&text(names)).unwrap_or_default();
    if names.len() as u64 != n || !s.manifest.output.as_ref().is_some_and(|o| o.collection) {
        return PF_BAD_VALUE;
    }
    s.output.collection = Some(names);
    PF_OK
}
