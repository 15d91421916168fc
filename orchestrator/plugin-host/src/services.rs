//! The table of services: C functions over [`HostState`].
//!
//! What the plugin hands over is trusted as far as the contract goes (lengths are right, pointers are
//! valid for the call); everything that can be checked is. No panic crosses into the plugin.

use crate::emitter::LONGEST_TEXT;
use crate::host::HostState;
use crate::process;
use plyflow_abi::*;
use plyflow_artifact::{ArtifactError, DType, ErrorKind, FieldInfo, On, check_result};
use plyflow_model::job::{LogLevel, NamedResult, Progress};
use plyflow_model::manifest::PluginKind;
use plyflow_model::text::shortened;
use plyflow_model::units::{check_si, parse_unit};
use std::ffi::c_void;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// The table for a step; valid as long as `state`.
pub(crate) fn table(state: &HostState<'_, '_>) -> pf_services {
    pf_services {
        size: size_of::<pf_services>() as u64,
        host: std::ptr::from_ref(state).cast_mut().cast(),
        log,
        progress,
        cancelled,
        fail,
        threads,
        parameters,
        scratch,
        inputs,
        item,
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
        checkpoint,
        checkpoint_due,
        checkpoint_saved,
    }
}

unsafe fn state<'a, 'w: 'a>(host: *mut c_void) -> &'a HostState<'a, 'w> {
    unsafe { &*host.cast::<HostState<'a, 'w>>() }
}

/// Runs a service; a panic in it is this program's defect and fails the call, not the process.
fn guard<T>(host: *mut c_void, failed: T, f: impl FnOnce(&HostState<'_, '_>) -> T) -> T {
    let state = unsafe { state(host) };
    catch_unwind(AssertUnwindSafe(|| f(state))).unwrap_or_else(|_| {
        state.emitter.log(
            LogLevel::Error,
            "a service of the host panicked (a defect of Plyflow)",
        );
        failed
    })
}

fn error(kind: ErrorKind, message: String) -> ArtifactError {
    ArtifactError { kind, message }
}

unsafe fn text<'a>(s: pf_str) -> Result<&'a str, ArtifactError> {
    unsafe { s.as_str() }
        .map_err(|e| error(ErrorKind::BadValue, format!("a text is not UTF-8: {e}")))
}

unsafe fn slice<'a, T>(p: *const T, n: u64, what: &str) -> Result<&'a [T], ArtifactError> {
    if n == 0 {
        return Ok(&[]);
    }
    if p.is_null() {
        return Err(error(
            ErrorKind::BadValue,
            format!("{what}: the pointer is NULL"),
        ));
    }
    times(n, size_of::<T>() as u64)?;
    Ok(unsafe { std::slice::from_raw_parts(p, n as usize) })
}

unsafe fn slice_mut<'a, T>(p: *mut T, n: u64, what: &str) -> Result<&'a mut [T], ArtifactError> {
    if n == 0 {
        return Ok(&mut []);
    }
    if p.is_null() {
        return Err(error(
            ErrorKind::BadValue,
            format!("{what}: the pointer is NULL"),
        ));
    }
    times(n, size_of::<T>() as u64)?;
    Ok(unsafe { std::slice::from_raw_parts_mut(p, n as usize) })
}

fn times(a: u64, b: u64) -> Result<u64, ArtifactError> {
    let most = isize::MAX as u64 / 8;
    a.checked_mul(b).filter(|n| *n <= most).ok_or_else(|| {
        error(
            ErrorKind::BadShape,
            format!("{a} x {b} values are too many"),
        )
    })
}

fn dtype(code: u32) -> Result<DType, ArtifactError> {
    match code {
        PF_F64 => Ok(DType::F64),
        PF_F32 => Ok(DType::F32),
        PF_I64 => Ok(DType::I64),
        PF_U32 => Ok(DType::U32),
        PF_U8 => Ok(DType::U8),
        _ => Err(error(
            ErrorKind::BadValue,
            format!("{code} is no element type (PF_F64 .. PF_U8)"),
        )),
    }
}

fn on(code: u32) -> Result<On, ArtifactError> {
    match code {
        PF_ON_POINTS => Ok(On::Points),
        PF_ON_CELLS => Ok(On::Cells),
        _ => Err(error(
            ErrorKind::BadValue,
            format!("{code} is neither PF_ON_POINTS nor PF_ON_CELLS"),
        )),
    }
}

fn read(host: *mut c_void, f: impl FnOnce(&HostState<'_, '_>) -> Result<(), ArtifactError>) -> i32 {
    guard(host, PF_ERROR, |s| match f(s) {
        Ok(()) => s.succeed(),
        Err(e) => s.refuse_read(&e),
    })
}

// ---- talking ------------------------------------------------------------------------------------

unsafe extern "C" fn log(host: *mut c_void, level: u32, message: pf_str) {
    guard(host, (), |s| {
        let level = match level {
            PF_LOG_ERROR => LogLevel::Error,
            PF_LOG_WARN => LogLevel::Warn,
            PF_LOG_INFO => LogLevel::Info,
            _ => LogLevel::Debug,
        };
        s.emitter.log(
            level,
            unsafe { message.as_str() }.unwrap_or("(a text that is not UTF-8)"),
        );
    });
}

unsafe extern "C" fn progress(host: *mut c_void, p: *const pf_progress) {
    guard(host, (), |s| {
        if p.is_null() {
            return;
        }
        let p = unsafe { &*p };
        let known = |x: f64| (x.is_finite() && x >= 0.0).then_some(x);
        s.emitter.progress(Progress {
            fraction: if p.fraction.is_finite() {
                p.fraction.clamp(0.0, 1.0)
            } else {
                0.0
            },
            simulated_time: known(p.simulated_time),
            rate: known(p.rate),
            energy_ratio: known(p.energy_ratio),
            phase: shortened(unsafe { p.phase.as_str() }.unwrap_or(""), 200).into_owned(),
        });
    });
}

unsafe extern "C" fn cancelled(_: *mut c_void) -> i32 {
    i32::from(process::cancelled())
}

unsafe extern "C" fn fail(host: *mut c_void, message: pf_str) {
    guard(host, (), |s| {
        let message = unsafe { message.as_str() }.unwrap_or("(a text that is not UTF-8)");
        s.output().failure = Some(shortened(message, LONGEST_TEXT).into_owned());
    });
}

unsafe extern "C" fn threads(host: *mut c_void) -> u32 {
    unsafe { state(host) }.job.threads.max(1)
}

unsafe extern "C" fn parameters(host: *mut c_void) -> pf_str {
    pf_str::new(&unsafe { state(host) }.parameters)
}

unsafe extern "C" fn scratch(host: *mut c_void) -> pf_str {
    guard(host, pf_str::new(""), |s| pf_str::new(s.scratch()))
}

unsafe extern "C" fn checkpoint(host: *mut c_void) -> pf_str {
    guard(host, pf_str::new(""), |s| {
        pf_str::new(s.checkpoints.folder(s.emitter))
    })
}

unsafe extern "C" fn checkpoint_due(host: *mut c_void) -> i32 {
    guard(host, 0, |s| i32::from(s.checkpoints.due()))
}

unsafe extern "C" fn checkpoint_saved(host: *mut c_void) {
    guard(host, (), |s| s.checkpoints.saved(s.emitter));
}

unsafe extern "C" fn inputs(host: *mut c_void) -> pf_str {
    pf_str::new(&unsafe { state(host) }.inputs)
}

unsafe extern "C" fn item(host: *mut c_void) -> pf_str {
    pf_str::new(&unsafe { state(host) }.item)
}

// ---- reading ------------------------------------------------------------------------------------

unsafe extern "C" fn attributes(host: *mut c_void, handle: u32) -> pf_str {
    guard(host, pf_str::new(""), |s| match s.artifact(handle) {
        Ok(a) => pf_str::new(a.attributes()),
        Err(e) => {
            s.refuse_read(&e);
            pf_str::new("")
        }
    })
}

unsafe extern "C" fn array_info(
    host: *mut c_void,
    handle: u32,
    path: pf_str,
    info: *mut pf_array_info,
) -> i32 {
    guard(host, PF_ERROR, |s| {
        let found = unsafe { text(path) }
            .and_then(|path| s.artifact(handle).and_then(|a| a.array_info(path)));
        let found = match found {
            Ok(found) => found,
            // Asking whether there is an array is no failure: leave no reason behind.
            Err(e) if e.kind == ErrorKind::NotFound => return PF_NOT_FOUND,
            Err(e) => return s.refuse_read(&e),
        };
        let mut shape = [0; PF_MAX_RANK];
        shape[..found.shape.len()].copy_from_slice(&found.shape);
        let dtype = match found.dtype {
            DType::F64 => PF_F64,
            DType::F32 => PF_F32,
            DType::I64 => PF_I64,
            DType::U32 => PF_U32,
            DType::U8 => PF_U8,
        };
        if !info.is_null() {
            unsafe {
                *info = pf_array_info {
                    dtype,
                    rank: found.shape.len() as u32,
                    shape,
                }
            };
        }
        PF_OK
    })
}

unsafe extern "C" fn array_read(
    host: *mut c_void,
    handle: u32,
    path: pf_str,
    code: u32,
    buffer: *mut c_void,
    bytes: u64,
) -> i32 {
    read(host, |s| {
        let path = unsafe { text(path) }?;
        let buffer = unsafe { slice_mut(buffer.cast::<u8>(), bytes, path) }?;
        s.artifact(handle)?.read_array(path, dtype(code)?, buffer)
    })
}

unsafe extern "C" fn meshes(host: *mut c_void, handle: u32) -> pf_str {
    guard(host, pf_str::new(""), |s| match s.artifact(handle) {
        Ok(a) => pf_str::new(s.slots[handle as usize].meshes.get_or_init(|| {
            serde_json::json!({"times": a.times(), "bodies": a.contents().bodies}).to_string()
        })),
        Err(e) => {
            s.refuse_read(&e);
            pf_str::new("")
        }
    })
}

unsafe extern "C" fn mesh_read(
    host: *mut c_void,
    handle: u32,
    body: pf_str,
    points: *mut f64,
    cells: *mut u32,
) -> i32 {
    read(host, |s| {
        let body = unsafe { text(body) }?;
        let a = s.artifact(handle)?;
        let info = a.body(body)?;
        let (n, ids) = (3 * info.points, info.cells * u64::from(info.nodes_per_cell));
        let points = unsafe { slice_mut(points, n, body) }?;
        a.read_mesh(body, points, unsafe { slice_mut(cells, ids, body) }?)
    })
}

unsafe extern "C" fn frame_points_read(
    host: *mut c_void,
    handle: u32,
    body: pf_str,
    frame: u64,
    points: *mut f64,
) -> i32 {
    read(host, |s| {
        let body = unsafe { text(body) }?;
        let a = s.artifact(handle)?;
        let n = 3 * a.body(body)?.points;
        a.read_frame_points(body, frame, unsafe { slice_mut(points, n, body) }?)
    })
}

unsafe extern "C" fn frame_field_read(
    host: *mut c_void,
    handle: u32,
    body: pf_str,
    frame: u64,
    place: u32,
    name: pf_str,
    values: *mut f64,
    count: u64,
) -> i32 {
    read(host, |s| {
        let (body, name) = unsafe { (text(body)?, text(name)?) };
        let values = unsafe { slice_mut(values, count, name) }?;
        s.artifact(handle)?
            .read_frame_field(body, frame, on(place)?, name, values)
    })
}

// ---- writing ------------------------------------------------------------------------------------

/// Refuses numbers that are not in SI: readers take what is stored as it is.
fn si(what: &str, unit: &str) -> Result<(), ArtifactError> {
    check_si(unit).map_err(|e| error(ErrorKind::BadValue, format!("{what}: {e}")))
}

/// Runs a write on the artifact being made.
fn write(
    host: *mut c_void,
    f: impl FnOnce(&mut plyflow_artifact::ArtifactWriter) -> Result<(), ArtifactError>,
) -> i32 {
    guard(host, PF_ERROR, |s| {
        s.write(|output| match output.writer.as_mut() {
            Some(writer) => f(writer),
            None => Err(error(
                ErrorKind::BadOrder,
                "the artifact is finished".into(),
            )),
        })
    })
}

unsafe extern "C" fn attributes_write(host: *mut c_void, json: pf_str) -> i32 {
    write(host, |w| w.attributes(unsafe { text(json) }?))
}

unsafe extern "C" fn array_write(
    host: *mut c_void,
    path: pf_str,
    info: *const pf_array_info,
    unit: pf_str,
    data: *const c_void,
) -> i32 {
    write(host, |w| {
        let (path, unit) = unsafe { (text(path)?, text(unit)?) };
        let Some(info) = (unsafe { info.as_ref() }) else {
            return Err(error(
                ErrorKind::BadValue,
                format!("array '{path}': info is NULL"),
            ));
        };
        si(&format!("array '{path}'"), unit)?;
        let dtype = dtype(info.dtype)?;
        let Some(shape) = info.shape.get(..info.rank as usize) else {
            return Err(error(
                ErrorKind::BadShape,
                format!(
                    "array '{path}' has rank {}; at most {PF_MAX_RANK}",
                    info.rank
                ),
            ));
        };
        let mut bytes = dtype.size() as u64;
        for n in shape {
            bytes = times(bytes, *n)?;
        }
        let data = unsafe { slice(data.cast::<u8>(), bytes, path) }?;
        w.array(path, dtype, shape, unit, data)
    })
}

unsafe extern "C" fn mesh_define(
    host: *mut c_void,
    body: pf_str,
    n: u64,
    points: *const f64,
    m: u64,
    k: u32,
    cells: *const u32,
    attributes: pf_str,
) -> i32 {
    write(host, |w| {
        let (body, attributes) = unsafe { (text(body)?, text(attributes)?) };
        let points = unsafe { slice(points, times(n, 3)?, body) }?;
        let cells = unsafe { slice(cells, times(m, u64::from(k))?, body) }?;
        w.define_mesh(body, points, k, cells, attributes)
    })
}

unsafe extern "C" fn frame_begin(host: *mut c_void, time: f64) -> i32 {
    write(host, |w| w.begin_frame(time))
}

unsafe extern "C" fn frame_points(
    host: *mut c_void,
    body: pf_str,
    points: *const f64,
    n: u64,
) -> i32 {
    write(host, |w| {
        let body = unsafe { text(body) }?;
        w.frame_points(body, unsafe { slice(points, times(n, 3)?, body) }?)
    })
}

unsafe extern "C" fn frame_field(
    host: *mut c_void,
    body: pf_str,
    place: u32,
    name: pf_str,
    components: u32,
    unit: pf_str,
    values: *const f64,
    count: u64,
) -> i32 {
    write(host, |w| {
        let (body, name, unit) = unsafe { (text(body)?, text(name)?, text(unit)?) };
        si(&format!("field '{name}' of '{body}'"), unit)?;
        let values = unsafe { slice(values, times(count, 1)?, name) }?;
        let field = FieldInfo::new(on(place)?, name, components, unit);
        w.frame_field(body, field, values)
    })
}

unsafe extern "C" fn frame_end(host: *mut c_void) -> i32 {
    write(host, plyflow_artifact::ArtifactWriter::end_frame)
}

unsafe extern "C" fn result(
    host: *mut c_void,
    name: pf_str,
    value: f64,
    unit: pf_str,
    flags: u32,
) -> i32 {
    guard(host, PF_ERROR, |s| {
        s.write(|output| {
            let (name, unit) = unsafe { (text(name)?, text(unit)?) };
            check_result(name, value)?;
            if output.results.iter().any(|r| r.name == name) {
                let message = format!("the result '{name}' was reported before");
                return Err(error(ErrorKind::BadOrder, message));
            }
            si(&format!("result '{name}'"), unit)?;
            let mut measured = flags & PF_RESULT_MEASURED != 0;
            if let Some(declared) = s.plugin.manifest.result(name) {
                // Workflows are checked against the manifest before anything runs.
                if !same_unit(unit, &declared.unit) {
                    let message = format!(
                        "the result '{name}' was reported in `{unit}`; the plugin's manifest says `{}`",
                        declared.unit
                    );
                    return Err(error(ErrorKind::BadValue, message));
                }
                measured |= declared.measured;
            } else {
                s.emitter.log(
                    LogLevel::Debug,
                    &format!("the result '{name}' is not declared in the plugin's manifest"),
                );
            }
            if let (false, Some(writer)) = (measured, output.writer.as_mut()) {
                writer.result(name, value, unit)?;
            }
            let (name, unit) = (name.to_owned(), unit.to_owned());
            output.results.push(NamedResult {
                name,
                value,
                unit,
                measured,
            });
            Ok(())
        })
    })
}

/// Whether two texts mean the same unit: `` and `1`, `N m` and `J`.
fn same_unit(a: &str, b: &str) -> bool {
    matches!((parse_unit(a), parse_unit(b)), (Ok(a), Ok(b)) if a == b)
}

unsafe extern "C" fn collection(host: *mut c_void, n: u64, names: pf_str) -> i32 {
    guard(host, PF_ERROR, |s| {
        s.write(|output| {
            if !s.job.collection {
                return Err(error(
                    ErrorKind::BadOrder,
                    "the plugin declared a collection, but its manifest has no `collection: true`"
                        .into(),
                ));
            }
            let names = unsafe { text(names) }?;
            let labels: Vec<String> = serde_json::from_str(names).map_err(|e| {
                let message = format!("the labels of the collection are no array of texts: {e}");
                error(ErrorKind::BadValue, message)
            })?;
            if labels.len() as u64 != n {
                let message = format!("the collection has {n} items but {} labels", labels.len());
                return Err(error(ErrorKind::BadShape, message));
            }
            match output.writer.as_mut() {
                Some(writer) => writer.collection(labels),
                None => Err(error(
                    ErrorKind::BadOrder,
                    "the artifact is finished".into(),
                )),
            }
        })
    })
}

unsafe extern "C" fn find_component(
    host: *mut c_void,
    kind: u32,
    name: pf_str,
    component: *mut pf_component,
) -> i32 {
    guard(host, PF_ERROR, |s| {
        let wanted = match kind {
            PF_KIND_ELEMENT => PluginKind::Element,
            PF_KIND_MATERIAL => PluginKind::Material,
            _ => return PF_NOT_FOUND,
        };
        let found = unsafe { text(name) }
            .map_err(|e| e.message)
            .and_then(|name| s.component(wanted, name).map_err(|e| e.to_string()));
        match found {
            Ok(plugin) if !component.is_null() => {
                let manifest = pf_str::new(plugin.manifest_text);
                let functions = plugin.functions();
                unsafe {
                    *component = pf_component {
                        kind,
                        reserved: 0,
                        functions,
                        manifest,
                    }
                };
                PF_OK
            }
            Ok(_) => PF_BAD_VALUE,
            Err(message) => s.refuse_read(&error(ErrorKind::NotFound, message)),
        }
    })
}
