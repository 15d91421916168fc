//! The service table of the host in memory.

use crate::memory::{Machine, MemoryArtifact, MemoryBody, MemoryField, MemoryInput, Vec3};
use plyflow_model::manifest::Manifest;
use plyflow_sdk::On;
use plyflow_sdk::abi::*;
use serde_json::{Value, json};
use std::ffi::c_void;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What a run reads and writes.
pub(super) struct State<'a> {
    pub(super) machine: Machine,
    pub(super) manifest: Manifest,
    pub(super) inputs: Vec<MemoryInput<'a>>,
    pub(super) texts: Vec<Box<str>>,
    pub(super) parameters: Value,
    pub(super) item: Vec<u64>,
    pub(super) output: MemoryArtifact,
    pub(super) frame_open: bool,
    pub(super) failure: String,
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

/// The service table of a `Mutex` around a state.
pub(super) fn table(host: *mut c_void) -> pf_services {
    pf_services {
        size: size_of::<pf_services>() as u64,
        host,
        log,
        progress: no_progress,
        cancelled,
        fail,
        threads,
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
        find_component,
        checkpoint: nothing,
        checkpoint_due: never,
        checkpoint_saved: ignored,
    }
}

/// The state behind a host pointer, for one call at a time: services may be called from any thread.
unsafe fn state<'a>(host: *mut c_void) -> MutexGuard<'a, State<'a>> {
    let state = unsafe { &*host.cast::<Mutex<State<'a>>>() };
    state.lock().unwrap_or_else(PoisonError::into_inner)
}

fn text(s: pf_str) -> String {
    unsafe { s.as_str() }.unwrap_or("").to_owned()
}

unsafe extern "C" fn no_progress(_: *mut c_void, _: *const pf_progress) {}

unsafe extern "C" fn never(_: *mut c_void) -> i32 {
    0
}

unsafe extern "C" fn cancelled(host: *mut c_void) -> i32 {
    unsafe { state(host) }.machine.cancelled.into()
}

unsafe extern "C" fn ignored(_: *mut c_void) {}

unsafe extern "C" fn threads(host: *mut c_void) -> u32 {
    unsafe { state(host) }.machine.threads
}

unsafe extern "C" fn nothing(_: *mut c_void) -> pf_str {
    pf_str::new("")
}

unsafe extern "C" fn find_component(
    host: *mut c_void,
    kind: u32,
    name: pf_str,
    found: *mut pf_component,
) -> i32 {
    match (unsafe { state(host) }.machine.component)(kind, &text(name)) {
        Some(component) => {
            unsafe { found.write(component) };
            PF_OK
        }
        None => PF_NOT_FOUND,
    }
}

unsafe extern "C" fn log(host: *mut c_void, _: u32, line: pf_str) {
    unsafe { state(host) }.output.log.push(text(line));
}

unsafe extern "C" fn fail(host: *mut c_void, why: pf_str) {
    unsafe { state(host) }.failure = text(why);
}

unsafe extern "C" fn parameters(host: *mut c_void) -> pf_str {
    let mut s = unsafe { state(host) };
    let text = s.parameters.to_string();
    s.keep(text)
}

unsafe extern "C" fn inputs(host: *mut c_void) -> pf_str {
    let mut s = unsafe { state(host) };
    let list: Value = (s.inputs.iter().enumerate())
        .map(|(handle, i)| {
            json!({"handle": handle, "port": i.port, "step": i.step, "kind": i.artifact.kind, "item": i.item,
                   "cost": {"wall_seconds": i.cost[0], "cpu_seconds": i.cost[1], "peak_memory": i.cost[2]}})
        })
        .collect();
    s.keep(list.to_string())
}

unsafe extern "C" fn own_item(host: *mut c_void) -> pf_str {
    let mut s = unsafe { state(host) };
    let text = json!(s.item).to_string();
    s.keep(text)
}

unsafe extern "C" fn attributes(host: *mut c_void, handle: u32) -> pf_str {
    let mut s = unsafe { state(host) };
    let text = s.inputs[handle as usize].artifact.attributes.to_string();
    s.keep(text)
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
    let mut s = unsafe { state(host) };
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
    let s = unsafe { state(host) };
    let Some(body) = find(&s, handle, name) else {
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
    let Some(body) = find(&s, handle, name) else {
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
    let s = unsafe { state(host) };
    let Some(body) = find(&s, handle, body) else {
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
    let mut s = unsafe { state(host) };
    let output = &mut s.output;
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
    let mut s = unsafe { state(host) };
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
    let mut s = unsafe { state(host) };
    let bodies = &mut s.output.bodies;
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
    let mut s = unsafe { state(host) };
    let bodies = &mut s.output.bodies;
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
    let mut s = unsafe { state(host) };
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
    let mut s = unsafe { state(host) };
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
    let mut s = unsafe { state(host) };
    let names: Vec<String> = serde_json::from_str(&text(names)).unwrap_or_default();
    if names.len() as u64 != n || !s.manifest.output.as_ref().is_some_and(|o| o.collection) {
        return PF_BAD_VALUE;
    }
    s.output.collection = Some(names);
    PF_OK
}
