//! The table of services: C functions over [`HostState`].
//!
//! What the plugin hands over is trusted as far as the contract goes (lengths are right, pointers are
//! valid for the call); everything that can be checked is. No panic crosses into the plugin.
//!
//! Longer than other files: it has one function for each row of the table, which are read side by side.
//!
//! Every service is a safe function of a [`Call`], through which alone it reads what it was given; [`service`] makes the C function of it.

use crate::emitter::LONGEST_TEXT;
use crate::host::HostState;
use crate::process;
use plyflow_abi::*;
use plyflow_artifact::{
    ArtifactError, ArtifactWriter, DType, ErrorKind, FieldInfo, On, check_result,
};
use plyflow_model::job::{LogLevel, NamedResult, Progress};
use plyflow_model::manifest::PluginKind;
use plyflow_model::text::shortened;
use plyflow_model::units::{check_si, parse_unit};
use std::ffi::c_void;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// The table for a step; valid as long as `state`. Long, as it has one row for each service.
pub(crate) fn table(state: &HostState<'_, '_>) -> pf_services {
    pf_services {
        size: size_of::<pf_services>() as u64,
        host: std::ptr::from_ref(state).cast_mut().cast(),
        log: service!(log(level: u32, message: pf_str)),
        progress: service!(progress(p: *const pf_progress)),
        cancelled: service!(cancelled() -> i32),
        fail: service!(fail(message: pf_str)),
        threads: service!(threads() -> u32),
        parameters: service!(parameters() -> pf_str),
        scratch: service!(scratch() -> pf_str),
        inputs: service!(inputs() -> pf_str),
        item: service!(item() -> pf_str),
        attributes: service!(attributes(handle: u32) -> pf_str),
        array_info: service!(array_info(
            handle: u32,
            path: pf_str,
            info: *mut pf_array_info
        ) -> i32),
        array_read: service!(array_read(
            handle: u32,
            path: pf_str,
            code: u32,
            buffer: *mut c_void,
            bytes: u64
        ) -> i32),
        meshes: service!(meshes(handle: u32) -> pf_str),
        mesh_read: service!(mesh_read(
            handle: u32,
            body: pf_str,
            points: *mut f64,
            cells: *mut u32
        ) -> i32),
        frame_points_read: service!(frame_points_read(
            handle: u32,
            body: pf_str,
            frame: u64,
            points: *mut f64
        ) -> i32),
        frame_field_read: service!(frame_field_read(
            handle: u32,
            body: pf_str,
            frame: u64,
            place: u32,
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
            body: pf_str,
            n: u64,
            points: *const f64,
            m: u64,
            k: u32,
            cells: *const u32,
            attributes: pf_str
        ) -> i32),
        frame_begin: service!(frame_begin(time: f64) -> i32),
        frame_points: service!(frame_points(body: pf_str, points: *const f64, n: u64) -> i32),
        frame_field: service!(frame_field(
            body: pf_str,
            place: u32,
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
            component: *mut pf_component
        ) -> i32),
        checkpoint: service!(checkpoint() -> pf_str),
        checkpoint_due: service!(checkpoint_due() -> i32),
        checkpoint_saved: service!(checkpoint_saved()),
    }
}

/// A call of a service, while it is served: the state behind `host`, and the right to follow the pointers that the plugin gave.
#[derive(Clone, Copy)]
struct Call<'c> {
    state: &'c HostState<'c, 'c>,
}

/// The C function of a service, whose arguments after the [`Call`] are those after `host`.
macro_rules! service {
    ($service:ident($($argument:ident: $kind:ty),*) $(-> $answer:ty)?) => {{
        /// # Safety
        /// As plyflow.h asks of a plugin that calls a service.
        unsafe extern "C" fn entry(host: *mut c_void $(, $argument: $kind)*) $(-> $answer)? {
            // SAFETY: a plugin calls this through the table of `table`, with that table's `host`, until `run` returns, and what it gives
            // is valid for the call: that is its part of plyflow.h. All of it goes to the service, and lives no longer there than the `Call`.
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
    /// this call, in the place that plyflow.h has for it: texts and arrays are there for `'c`, aligned for their type and in the length that stands beside
    /// them, and nobody else reads or writes what the service is to write.
    unsafe fn of(host: *mut c_void) -> Self {
        // SAFETY: `table` made `host` of a `&HostState`, which lives for `'c` (above; what it borrows lives longer, and is only looked at).
        // Threads may call at once: see `shared_by_threads`.
        let state = unsafe { &*host.cast::<HostState<'c, 'c>>() };
        Self { state }
    }

    /// Runs a service; a panic in it is this program's defect and fails the call, not the process.
    fn guard<T>(self, failed: T, f: impl FnOnce(&'c HostState<'c, 'c>) -> T) -> T {
        catch_unwind(AssertUnwindSafe(|| f(self.state))).unwrap_or_else(|_| {
            self.state.emitter.log(
                LogLevel::Error,
                "a service of the host panicked (a defect of Plyflow)",
            );
            failed
        })
    }

    fn read(self, f: impl FnOnce(&'c HostState<'c, 'c>) -> Result<(), ArtifactError>) -> i32 {
        self.guard(PF_ERROR, |s| match f(s) {
            Ok(()) => s.succeed(),
            Err(e) => s.refuse_read(&e),
        })
    }

    /// Runs a write on the artifact being made.
    fn write(self, f: impl FnOnce(&mut ArtifactWriter) -> Result<(), ArtifactError>) -> i32 {
        self.guard(PF_ERROR, |s| {
            s.write(|output| match output.writer.as_mut() {
                Some(writer) => f(writer),
                None => Err(error(
                    ErrorKind::BadOrder,
                    "the artifact is finished".into(),
                )),
            })
        })
    }

    fn text(self, s: pf_str) -> Result<&'c str, ArtifactError> {
        // SAFETY: a text that the plugin gave in this call (`Call::of`).
        unsafe { s.as_str() }
            .map_err(|e| error(ErrorKind::BadValue, format!("a text is not UTF-8: {e}")))
    }

    fn slice<T: Plain>(self, p: *const T, n: u64, what: &str) -> Result<&'c [T], ArtifactError> {
        let Some(n) = length(p, n, what)? else {
            return Ok(&[]);
        };
        // SAFETY: `n` values that the plugin gave in this call (`Call::of`), of a type that any bytes make; not NULL and not too long, as
        // `length` has found.
        Ok(unsafe { std::slice::from_raw_parts(p, n) })
    }

    fn slice_mut<T: Plain>(
        self,
        p: *mut T,
        n: u64,
        what: &str,
    ) -> Result<&'c mut [T], ArtifactError> {
        let Some(n) = length(p, n, what)? else {
            return Ok(&mut []);
        };
        // SAFETY: as in `slice`; it is the plugin's buffer to be filled, which nobody else has until the call ends (`Call::of`), and no service
        // takes it twice. It is written, not read.
        Ok(unsafe { std::slice::from_raw_parts_mut(p, n) })
    }

    /// What the plugin gave a pointer to; `None` for NULL.
    fn given<T>(self, p: *const T) -> Option<&'c T> {
        // SAFETY: NULL, or a whole struct that the plugin gave in this call (`Call::of`).
        unsafe { p.as_ref() }
    }

    /// Writes an answer to where the plugin has room for it.
    ///
    /// # Errors
    /// When that is NULL.
    fn answer<T>(self, to: *mut T, answer: T) -> Result<(), Nowhere> {
        if to.is_null() {
            return Err(Nowhere);
        }
        // SAFETY: not NULL, so room for one `T` that the plugin gave in this call (`Call::of`); what was there is not read.
        unsafe { to.write(answer) };
        Ok(())
    }
}

/// A plugin gave NULL for where an answer is to go.
struct Nowhere;

/// Threads of a plugin may call services at once ([`Call::of`]).
const _: fn() = || {
    fn shared_by_threads<T: Sync>() {}
    shared_by_threads::<HostState<'_, '_>>();
};

/// Types that any bytes make.
trait Plain {}

impl Plain for f64 {}

impl Plain for u32 {}

impl Plain for u8 {}

fn error(kind: ErrorKind, message: String) -> ArtifactError {
    ArtifactError { kind, message }
}

/// Length of an array of the plugin's; `None`: no values, whatever the pointer.
fn length<T>(p: *const T, n: u64, what: &str) -> Result<Option<usize>, ArtifactError> {
    if n == 0 {
        return Ok(None);
    }
    if p.is_null() {
        return Err(error(
            ErrorKind::BadValue,
            format!("{what}: the pointer is NULL"),
        ));
    }
    times(n, size_of::<T>() as u64)?;
    Ok(Some(n as usize))
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

// ---- talking ------------------------------------------------------------------------------------

fn log(call: Call<'_>, level: u32, message: pf_str) {
    call.guard((), |s| {
        let level = match level {
            PF_LOG_ERROR => LogLevel::Error,
            PF_LOG_WARN => LogLevel::Warn,
            PF_LOG_INFO => LogLevel::Info,
            _ => LogLevel::Debug,
        };
        s.emitter.log(
            level,
            call.text(message).unwrap_or("(a text that is not UTF-8)"),
        );
    });
}

fn progress(call: Call<'_>, p: *const pf_progress) {
    call.guard((), |s| {
        let Some(p) = call.given(p) else {
            return;
        };
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
            phase: shortened(call.text(p.phase).unwrap_or(""), 200).into_owned(),
        });
    });
}

fn cancelled(_: Call<'_>) -> i32 {
    i32::from(process::cancelled())
}

fn fail(call: Call<'_>, message: pf_str) {
    call.guard((), |s| {
        let message = call.text(message).unwrap_or("(a text that is not UTF-8)");
        s.output().failure = Some(shortened(message, LONGEST_TEXT).into_owned());
    });
}

fn threads(call: Call<'_>) -> u32 {
    call.state.threads()
}

fn parameters(call: Call<'_>) -> pf_str {
    pf_str::new(&call.state.parameters)
}

fn scratch(call: Call<'_>) -> pf_str {
    call.guard(pf_str::new(""), |s| pf_str::new(s.scratch()))
}

fn checkpoint(call: Call<'_>) -> pf_str {
    call.guard(pf_str::new(""), |s| {
        pf_str::new(s.checkpoints.folder(s.emitter))
    })
}

fn checkpoint_due(call: Call<'_>) -> i32 {
    call.guard(0, |s| i32::from(s.checkpoints.due()))
}

fn checkpoint_saved(call: Call<'_>) {
    call.guard((), |s| s.checkpoints.saved(s.emitter));
}

fn inputs(call: Call<'_>) -> pf_str {
    pf_str::new(&call.state.inputs)
}

fn item(call: Call<'_>) -> pf_str {
    pf_str::new(&call.state.item)
}

// ---- reading ------------------------------------------------------------------------------------

fn attributes(call: Call<'_>, handle: u32) -> pf_str {
    call.guard(pf_str::new(""), |s| match s.artifact(handle) {
        Ok(a) => pf_str::new(a.attributes()),
        Err(e) => {
            s.refuse_read(&e);
            pf_str::new("")
        }
    })
}

fn array_info(call: Call<'_>, handle: u32, path: pf_str, info: *mut pf_array_info) -> i32 {
    call.guard(PF_ERROR, |s| {
        let found = call
            .text(path)
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
        // Who gives NULL wants to know only that it is there.
        let _ = call.answer(
            info,
            pf_array_info {
                dtype,
                rank: found.shape.len() as u32,
                shape,
            },
        );
        PF_OK
    })
}

fn array_read(
    call: Call<'_>,
    handle: u32,
    path: pf_str,
    code: u32,
    buffer: *mut c_void,
    bytes: u64,
) -> i32 {
    call.read(|s| {
        let path = call.text(path)?;
        let buffer = call.slice_mut(buffer.cast::<u8>(), bytes, path)?;
        s.artifact(handle)?.read_array(path, dtype(code)?, buffer)
    })
}

fn meshes(call: Call<'_>, handle: u32) -> pf_str {
    call.guard(pf_str::new(""), |s| match s.artifact(handle) {
        Ok(a) => pf_str::new(s.slots[handle as usize].meshes.get_or_init(|| {
            serde_json::json!({"times": a.times(), "bodies": a.contents().bodies}).to_string()
        })),
        Err(e) => {
            s.refuse_read(&e);
            pf_str::new("")
        }
    })
}

fn mesh_read(call: Call<'_>, handle: u32, body: pf_str, points: *mut f64, cells: *mut u32) -> i32 {
    call.read(|s| {
        let body = call.text(body)?;
        let a = s.artifact(handle)?;
        let info = a.body(body)?;
        let (n, ids) = (3 * info.points, info.cells * u64::from(info.nodes_per_cell));
        let points = call.slice_mut(points, n, body)?;
        a.read_mesh(body, points, call.slice_mut(cells, ids, body)?)
    })
}

fn frame_points_read(
    call: Call<'_>,
    handle: u32,
    body: pf_str,
    frame: u64,
    points: *mut f64,
) -> i32 {
    call.read(|s| {
        let body = call.text(body)?;
        let a = s.artifact(handle)?;
        let n = 3 * a.body(body)?.points;
        a.read_frame_points(body, frame, call.slice_mut(points, n, body)?)
    })
}

fn frame_field_read(
    call: Call<'_>,
    handle: u32,
    body: pf_str,
    frame: u64,
    place: u32,
    name: pf_str,
    values: *mut f64,
    count: u64,
) -> i32 {
    call.read(|s| {
        let (body, name) = (call.text(body)?, call.text(name)?);
        let values = call.slice_mut(values, count, name)?;
        s.artifact(handle)?
            .read_frame_field(body, frame, on(place)?, name, values)
    })
}

// ---- writing ------------------------------------------------------------------------------------

/// Refuses numbers that are not in SI: readers take what is stored as it is.
fn si(what: &str, unit: &str) -> Result<(), ArtifactError> {
    check_si(unit).map_err(|e| error(ErrorKind::BadValue, format!("{what}: {e}")))
}

fn attributes_write(call: Call<'_>, json: pf_str) -> i32 {
    call.write(|w| w.attributes(call.text(json)?))
}

fn array_write(
    call: Call<'_>,
    path: pf_str,
    info: *const pf_array_info,
    unit: pf_str,
    data: *const c_void,
) -> i32 {
    call.write(|w| {
        let (path, unit) = (call.text(path)?, call.text(unit)?);
        let Some(info) = call.given(info) else {
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
        let data = call.slice(data.cast::<u8>(), bytes, path)?;
        w.array(path, dtype, shape, unit, data)
    })
}

fn mesh_define(
    call: Call<'_>,
    body: pf_str,
    n: u64,
    points: *const f64,
    m: u64,
    k: u32,
    cells: *const u32,
    attributes: pf_str,
) -> i32 {
    call.write(|w| {
        let (body, attributes) = (call.text(body)?, call.text(attributes)?);
        let points = call.slice(points, times(n, 3)?, body)?;
        let cells = call.slice(cells, times(m, u64::from(k))?, body)?;
        w.define_mesh(body, points, k, cells, attributes)
    })
}

fn frame_begin(call: Call<'_>, time: f64) -> i32 {
    call.write(|w| w.begin_frame(time))
}

fn frame_points(call: Call<'_>, body: pf_str, points: *const f64, n: u64) -> i32 {
    call.write(|w| {
        let body = call.text(body)?;
        w.frame_points(body, call.slice(points, times(n, 3)?, body)?)
    })
}

fn frame_field(
    call: Call<'_>,
    body: pf_str,
    place: u32,
    name: pf_str,
    components: u32,
    unit: pf_str,
    values: *const f64,
    count: u64,
) -> i32 {
    call.write(|w| {
        let (body, name, unit) = (call.text(body)?, call.text(name)?, call.text(unit)?);
        si(&format!("field '{name}' of '{body}'"), unit)?;
        let values = call.slice(values, times(count, 1)?, name)?;
        let field = FieldInfo::new(on(place)?, name, components, unit);
        w.frame_field(body, field, values)
    })
}

fn frame_end(call: Call<'_>) -> i32 {
    call.write(ArtifactWriter::end_frame)
}

fn result(call: Call<'_>, name: pf_str, value: f64, unit: pf_str, flags: u32) -> i32 {
    call.guard(PF_ERROR, |s| {
        s.write(|output| {
            let (name, unit) = (call.text(name)?, call.text(unit)?);
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

fn collection(call: Call<'_>, n: u64, names: pf_str) -> i32 {
    call.guard(PF_ERROR, |s| {
        s.write(|output| {
            if !s.job.collection {
                return Err(error(
                    ErrorKind::BadOrder,
                    "the plugin declared a collection, but its manifest has no `collection: true`"
                        .into(),
                ));
            }
            let names = call.text(names)?;
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

fn find_component(call: Call<'_>, kind: u32, name: pf_str, component: *mut pf_component) -> i32 {
    call.guard(PF_ERROR, |s| {
        let wanted = match kind {
            PF_KIND_ELEMENT => PluginKind::Element,
            PF_KIND_MATERIAL => PluginKind::Material,
            _ => return PF_NOT_FOUND,
        };
        let found = call
            .text(name)
            .map_err(|e| e.message)
            .and_then(|name| s.component(wanted, name).map_err(|e| e.to_string()));
        match found {
            Ok(plugin) => {
                let found = pf_component {
                    kind,
                    reserved: 0,
                    functions: plugin.functions(),
                    manifest: pf_str::new(plugin.manifest_text),
                };
                match call.answer(component, found) {
                    Ok(()) => PF_OK,
                    Err(Nowhere) => PF_BAD_VALUE,
                }
            }
            Err(message) => s.refuse_read(&error(ErrorKind::NotFound, message)),
        }
    })
}
