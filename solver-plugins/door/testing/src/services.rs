//! The service table of the host in memory.
//!
//! A little over 600 lines: it has one function for each row of the table, as the real host has.

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

/// The service table of a `Mutex` around a state. Long, as it has one row for each service.
pub(super) fn table(host: *mut c_void) -> pf_services {
    pf_services {
        size: size_of::<pf_services>() as u64,
        host,
        log: service!(log(level: u32, line: pf_str)),
        progress: service!(no_progress(progress: *const pf_progress)),
        cancelled: service!(cancelled() -> i32),
        fail: service!(fail(why: pf_str)),
        threads: service!(threads() -> u32),
        parameters: service!(parameters() -> pf_str),
        scratch: service!(nothing() -> pf_str),
        inputs: service!(inputs() -> pf_str),
        item: service!(own_item() -> pf_str),
        attributes: service!(attributes(handle: u32) -> pf_str),
        array_info: service!(array_info(
            handle: u32,
            path: pf_str,
            info: *mut pf_array_info
        ) -> i32),
        array_read: service!(array_read(
            handle: u32,
            path: pf_str,
            dtype: u32,
            buffer: *mut c_void,
            bytes: u64
        ) -> i32),
        meshes: service!(meshes(handle: u32) -> pf_str),
        mesh_read: service!(mesh_read(
            handle: u32,
            name: pf_str,
            points: *mut f64,
            cells: *mut u32
        ) -> i32),
        frame_points_read: service!(frame_points_read(
            handle: u32,
            name: pf_str,
            frame: u64,
            points: *mut f64
        ) -> i32),
        frame_field_read: service!(frame_field_read(
            handle: u32,
            body: pf_str,
            frame: u64,
            on: u32,
            name: pf_str,
            values: *mut f64,
            count: u64
        ) -> i32),
        attributes_write: service!(attributes_write(json: pf_str) -> i32),
        array_write: service!(array_write(
            path: pf_str,
            info: *const pf_array_info,
            unit: pf_str,
            data: *const c_void
        ) -> i32),
        mesh_define: service!(mesh_define(
            name: pf_str,
            n: u64,
            points: *const f64,
            m: u64,
            k: u32,
            cells: *const u32,
            attributes: pf_str
        ) -> i32),
        frame_begin: service!(frame_begin(time: f64) -> i32),
        frame_points: service!(frame_points(name: pf_str, points: *const f64, n: u64) -> i32),
        frame_field: service!(frame_field(
            body: pf_str,
            on: u32,
            name: pf_str,
            components: u32,
            unit: pf_str,
            values: *const f64,
            count: u64
        ) -> i32),
        frame_end: service!(frame_end() -> i32),
        result: service!(result(name: pf_str, value: f64, unit: pf_str, flags: u32) -> i32),
        collection: service!(collection(n: u64, names: pf_str) -> i32),
        find_component: service!(find_component(
            kind: u32,
            name: pf_str,
            found: *mut pf_component
        ) -> i32),
        checkpoint: service!(nothing() -> pf_str),
        checkpoint_due: service!(never() -> i32),
        checkpoint_saved: service!(ignored()),
    }
}

/// A call of a service, while it is served: the state behind `host`, and the right to follow the pointers that the plugin gave.
#[derive(Clone, Copy)]
struct Call<'c> {
    state: &'c Mutex<State<'c>>,
}

/// The C function of a service, whose arguments after the [`Call`] are those after `host`.
macro_rules! service {
    ($service:ident($($argument:ident: $kind:ty),*) $(-> $answer:ty)?) => {{
        /// # Safety
        /// As plyflow.h asks of a step that calls a service.
        unsafe extern "C" fn entry(host: *mut c_void $(, $argument: $kind)*) $(-> $answer)? {
            // SAFETY: a step calls this through the table of `table`, with that table's `host`, until its `run` returns, and what it gives is
            // valid for the call: that is its part of plyflow.h. All of it goes to the service, and lives no longer there than the `Call`.
            let call = unsafe { Call::of(host) };
            $service(call $(, $argument)*)
        }
        entry
    }};
}
use service;

impl<'c> Call<'c> {
    /// The call of a service.
    ///
    /// # Safety
    /// `host` is that of a [`table`] whose state lives for `'c`. Whatever is given to the methods that take pointers was given to the service in
    /// this call, in the place that plyflow.h has for it: texts and arrays are there for `'c`, aligned for their type and in the length that stands beside them, and nobody
    /// else reads or writes what the service is to write.
    unsafe fn of(host: *mut c_void) -> Self {
        // SAFETY: `table` was given a pointer to a `Mutex<State>`, which lives for `'c` (above). Threads may call at once: see
        // `shared_by_threads`.
        let state = unsafe { &*host.cast::<Mutex<State<'c>>>() };
        Self { state }
    }

    /// The state, for one call at a time: services may be called from any thread.
    fn state(self) -> MutexGuard<'c, State<'c>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn text(self, s: pf_str) -> String {
        // SAFETY: a text that the step gave in this call (`Call::of`).
        unsafe { s.as_str() }.unwrap_or("").to_owned()
    }

    /// `n` values that the step gave.
    ///
    /// # Panics
    /// When they are NULL, or too many to be.
    fn values<T: Plain>(self, p: *const T, n: usize) -> &'c [T] {
        if n == 0 {
            return &[];
        }
        assert!(!p.is_null(), "{n} values at NULL");
        assert!(n <= isize::MAX as usize / size_of::<T>(), "{n} values");
        // SAFETY: `n` values that the step gave in this call (`Call::of`), of a type that any bytes make; not NULL and not too many (above).
        unsafe { std::slice::from_raw_parts(p, n) }
    }

    /// Writes to where the step has room for as many values.
    ///
    /// # Panics
    /// When that is NULL.
    fn fill<T: Plain>(self, to: *mut T, values: &[T]) {
        if values.is_empty() {
            return;
        }
        assert!(!to.is_null(), "room for {} values at NULL", values.len());
        // SAFETY: room of the step's own for as many values (`Call::of`; the caller has looked at the length), apart from what the host holds.
        unsafe { to.copy_from_nonoverlapping(values.as_ptr(), values.len()) };
    }

    /// Writes an answer to where the step has room for it.
    ///
    /// # Panics
    /// When that is NULL.
    fn answer<T>(self, to: *mut T, answer: T) {
        assert!(!to.is_null(), "room for an answer at NULL");
        // SAFETY: not NULL, so room for one `T` that the step gave in this call (`Call::of`); what was there is not read.
        unsafe { to.write(answer) };
    }
}

/// Threads of a step may call services at once ([`Call::of`]).
const _: fn() = || {
    fn shared_by_threads<T: Sync>() {}
    shared_by_threads::<Mutex<State<'_>>>();
};

/// Types that any bytes make.
trait Plain: Copy {}

impl Plain for f64 {}

impl Plain for Vec3 {}

impl Plain for u32 {}

impl Plain for pf_array_info {}

fn no_progress(_: Call<'_>, _: *const pf_progress) {}

fn never(_: Call<'_>) -> i32 {
    0
}

fn cancelled(call: Call<'_>) -> i32 {
    call.state().machine.cancelled.into()
}

fn ignored(_: Call<'_>) {}

fn threads(call: Call<'_>) -> u32 {
    call.state().machine.threads
}

fn nothing(_: Call<'_>) -> pf_str {
    pf_str::new("")
}

fn find_component(call: Call<'_>, kind: u32, name: pf_str, found: *mut pf_component) -> i32 {
    let components = call.state().machine.components;
    match components.find(kind, &call.text(name)) {
        Some(component) => {
            call.answer(found, component);
            PF_OK
        }
        None => PF_NOT_FOUND,
    }
}

fn log(call: Call<'_>, _: u32, line: pf_str) {
    call.state().output.log.push(call.text(line));
}

fn fail(call: Call<'_>, why: pf_str) {
    call.state().failure = call.text(why);
}

fn parameters(call: Call<'_>) -> pf_str {
    let mut s = call.state();
    let text = s.parameters.to_string();
    s.keep(text)
}

fn inputs(call: Call<'_>) -> pf_str {
    let mut s = call.state();
    let list: Value = (s.inputs.iter().enumerate())
        .map(|(handle, i)| {
            json!({"handle": handle, "port": i.port, "step": i.step, "kind": i.artifact.kind, "item": i.item,
                   "cost": {"wall_seconds": i.cost[0], "cpu_seconds": i.cost[1], "peak_memory": i.cost[2]}})
        })
        .collect();
    s.keep(list.to_string())
}

fn own_item(call: Call<'_>) -> pf_str {
    let mut s = call.state();
    let text = json!(s.item).to_string();
    s.keep(text)
}

fn attributes(call: Call<'_>, handle: u32) -> pf_str {
    let mut s = call.state();
    let text = s.inputs[handle as usize].artifact.attributes.to_string();
    s.keep(text)
}

fn array_info(call: Call<'_>, handle: u32, path: pf_str, info: *mut pf_array_info) -> i32 {
    let s = call.state();
    let Some((shape, _)) = s.inputs[handle as usize]
        .artifact
        .arrays
        .get(&call.text(path))
    else {
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
    call.answer(info, found);
    PF_OK
}

fn array_read(
    call: Call<'_>,
    handle: u32,
    path: pf_str,
    dtype: u32,
    buffer: *mut c_void,
    bytes: u64,
) -> i32 {
    let s = call.state();
    let Some((_, values)) = s.inputs[handle as usize]
        .artifact
        .arrays
        .get(&call.text(path))
    else {
        return PF_NOT_FOUND;
    };
    let width = if dtype == PF_F64 { 8 } else { 4 };
    if bytes != width * values.len() as u64 {
        return PF_BAD_SHAPE;
    }
    match dtype {
        PF_F64 => call.fill(buffer.cast(), values),
        _ => {
            let values: Vec<u32> = values.iter().map(|v| *v as u32).collect();
            call.fill(buffer.cast(), &values);
        }
    }
    PF_OK
}

fn meshes(call: Call<'_>, handle: u32) -> pf_str {
    let mut s = call.state();
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

/// A body of an input by name.
fn find<'a>(s: &State<'a>, handle: u32, name: &str) -> Option<&'a MemoryBody> {
    s.inputs[handle as usize]
        .artifact
        .bodies
        .iter()
        .find(|b| b.name == name)
}

fn mesh_read(call: Call<'_>, handle: u32, name: pf_str, points: *mut f64, cells: *mut u32) -> i32 {
    let s = call.state();
    let Some(body) = find(&s, handle, &call.text(name)) else {
        return PF_NOT_FOUND;
    };
    // The step made room for the whole cells that it was told of.
    if !body.cells.len().is_multiple_of(body.nodes_per_cell) {
        return PF_BAD_SHAPE;
    }
    call.fill(points, body.points.as_flattened());
    call.fill(cells, &body.cells);
    PF_OK
}

fn frame_points_read(
    call: Call<'_>,
    handle: u32,
    name: pf_str,
    frame: u64,
    points: *mut f64,
) -> i32 {
    let s = call.state();
    let Some(body) = find(&s, handle, &call.text(name)) else {
        return PF_NOT_FOUND;
    };
    if frame as usize >= s.inputs[handle as usize].artifact.times.len() {
        return PF_NOT_FOUND;
    }
    // A body that does not move has its reference points in every frame.
    let from = body.frames.get(frame as usize).unwrap_or(&body.points);
    // The step made room for the points that it was told of.
    if from.len() != body.points.len() {
        return PF_BAD_SHAPE;
    }
    call.fill(points, from.as_flattened());
    PF_OK
}

fn frame_field_read(
    call: Call<'_>,
    handle: u32,
    body: pf_str,
    frame: u64,
    _on: u32,
    name: pf_str,
    values: *mut f64,
    count: u64,
) -> i32 {
    let s = call.state();
    let Some(body) = find(&s, handle, &call.text(body)) else {
        return PF_NOT_FOUND;
    };
    let name = call.text(name);
    let fields = body.fields.get(frame as usize);
    let Some(field) = fields.and_then(|f| f.iter().find(|f| f.name == name)) else {
        return PF_NOT_FOUND;
    };
    if field.values.len() as u64 != count {
        return PF_BAD_SHAPE;
    }
    call.fill(values, &field.values);
    PF_OK
}

fn attributes_write(call: Call<'_>, json: pf_str) -> i32 {
    match serde_json::from_str::<Value>(&call.text(json)) {
        Ok(value) if value.is_object() => {
            call.state().output.attributes = value;
            PF_OK
        }
        _ => PF_BAD_VALUE,
    }
}

fn array_write(
    call: Call<'_>,
    path: pf_str,
    info: *const pf_array_info,
    _unit: pf_str,
    data: *const c_void,
) -> i32 {
    let [info] = call.values(info, 1) else {
        return PF_BAD_VALUE;
    };
    let shape: Vec<usize> = info.shape[..info.rank as usize]
        .iter()
        .map(|&n| n as usize)
        .collect();
    let count = shape.iter().product();
    let values: Vec<f64> = match info.dtype {
        PF_F64 => call.values(data.cast::<f64>(), count).to_vec(),
        PF_U32 => (call.values(data.cast::<u32>(), count).iter())
            .map(|v| f64::from(*v))
            .collect(),
        _ => return PF_BAD_VALUE,
    };
    if values.iter().any(|v| !v.is_finite()) {
        return PF_BAD_VALUE;
    }
    let taken = call
        .state()
        .output
        .arrays
        .insert(call.text(path), (shape, values));
    if taken.is_some() { PF_BAD_VALUE } else { PF_OK }
}

fn mesh_define(
    call: Call<'_>,
    name: pf_str,
    n: u64,
    points: *const f64,
    m: u64,
    k: u32,
    cells: *const u32,
    attributes: pf_str,
) -> i32 {
    let mut s = call.state();
    let output = &mut s.output;
    let points: Vec<Vec3> = call.values(points.cast(), n as usize).to_vec();
    let cells = call.values(cells, m as usize * k as usize).to_vec();
    let name = call.text(name);
    let bad = points.iter().flatten().any(|v| !v.is_finite())
        || cells.iter().any(|&i| u64::from(i) >= n)
        || !output.times.is_empty()
        || output.bodies.iter().any(|b| b.name == name);
    if bad {
        return PF_BAD_VALUE;
    }
    let attributes = serde_json::from_str(&call.text(attributes)).unwrap_or(Value::Null);
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

fn frame_begin(call: Call<'_>, time: f64) -> i32 {
    let mut s = call.state();
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

fn frame_points(call: Call<'_>, name: pf_str, points: *const f64, n: u64) -> i32 {
    let name = call.text(name);
    let mut s = call.state();
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
    frame.copy_from_slice(call.values(points.cast(), n as usize));
    if frame.iter().flatten().all(|v| v.is_finite()) {
        PF_OK
    } else {
        PF_BAD_VALUE
    }
}

fn frame_field(
    call: Call<'_>,
    body: pf_str,
    on: u32,
    name: pf_str,
    components: u32,
    _unit: pf_str,
    values: *const f64,
    count: u64,
) -> i32 {
    let body = call.text(body);
    let mut s = call.state();
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
    let values = call.values(values, count as usize).to_vec();
    if values.iter().any(|v| !v.is_finite()) {
        return PF_BAD_VALUE;
    }
    let Some(fields) = body.fields.last_mut() else {
        return PF_BAD_VALUE;
    };
    fields.push(MemoryField {
        name: call.text(name),
        on,
        components,
        values,
    });
    PF_OK
}

fn frame_end(call: Call<'_>) -> i32 {
    let mut s = call.state();
    if std::mem::take(&mut s.frame_open) {
        PF_OK
    } else {
        PF_BAD_VALUE
    }
}

fn result(call: Call<'_>, name: pf_str, value: f64, unit: pf_str, flags: u32) -> i32 {
    let mut s = call.state();
    let (name, unit) = (call.text(name), call.text(unit));
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

fn collection(call: Call<'_>, n: u64, names: pf_str) -> i32 {
    let mut s = call.state();
    let names: Vec<String> = serde_json::from_str(&call.text(names)).unwrap_or_default();
    if names.len() as u64 != n || !s.manifest.output.as_ref().is_some_and(|o| o.collection) {
        return PF_BAD_VALUE;
    }
    s.output.collection = Some(names);
    PF_OK
}
