//! Steps: the host's services with Rust types.

use crate::panic_text;
use plyflow_abi::*;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// A step plugin.
pub trait Step {
    /// The manifest (JSON, see `schemas/manifest.md`).
    const MANIFEST: &'static str;
    /// Does the step: reads inputs and parameters from `host`, writes the output artifact to it.
    ///
    /// # Errors
    /// Any [`StepError`]; its text becomes the step's failure in the run.
    fn run(host: &Host) -> Result<(), StepError>;
}

/// Why a step stopped.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum StepError {
    /// The host asked to stop.
    Cancelled,
    /// Anything else: what was wrong, where, and what to do.
    Failed(String),
}

impl<T: std::fmt::Display> From<T> for StepError {
    fn from(value: T) -> Self {
        Self::Failed(value.to_string())
    }
}

/// Where the values of a field sit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum On {
    /// One row per point.
    Points,
    /// One row per cell.
    Cells,
}

/// Level of a log line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Log {
    /// The step cannot go on.
    Error,
    /// The result may not mean what it seems to.
    Warn,
    /// Worth a line.
    Info,
    /// For a plugin's developer.
    Debug,
}

/// What an input cost (measured when it was made; not part of the artifact).
#[derive(Debug, Clone, Copy, Default, Deserialize)]
pub struct Cost {
    /// Wall time (s).
    #[serde(default)]
    pub wall_seconds: f64,
    /// CPU time of all threads (s).
    #[serde(default)]
    pub cpu_seconds: f64,
    /// Peak resident memory (bytes).
    #[serde(default)]
    pub peak_memory: f64,
    /// Threads that the step was given.
    #[serde(default)]
    pub threads: f64,
}

/// One input artifact.
#[derive(Debug, Clone, Deserialize)]
pub struct Input {
    /// Handle for the reading functions of [`Host`].
    pub handle: u32,
    /// Name of the port that the workflow wired it to.
    pub port: String,
    /// Name of the step that made it.
    pub step: String,
    /// Artifact kind.
    pub kind: String,
    /// Fan-out index path of the input; empty when its step is not fanned out.
    #[serde(default)]
    pub item: Vec<u64>,
    /// What it cost.
    #[serde(default)]
    pub cost: Cost,
}

/// A field of a body.
#[derive(Debug, Clone, Deserialize)]
pub struct FieldInfo {
    /// Name.
    pub name: String,
    /// On points or cells.
    pub on: On,
    /// Values per point or cell.
    pub components: u32,
    /// SI unit.
    #[serde(default)]
    pub unit: String,
}

/// A body of a mesh artifact.
#[derive(Debug, Clone, Deserialize)]
pub struct BodyInfo {
    /// Name.
    pub name: String,
    /// Number of points.
    pub points: usize,
    /// Number of cells.
    pub cells: usize,
    /// 3 (triangles) or 4 (quads).
    pub nodes_per_cell: usize,
    /// What the writing plugin said of the body.
    #[serde(default)]
    pub attributes: serde_json::Value,
    /// Fields, the same in every frame.
    #[serde(default)]
    pub fields: Vec<FieldInfo>,
}

/// The meshes of an artifact.
#[derive(Debug, Clone, Deserialize)]
pub struct Meshes {
    /// Time of each frame (s).
    #[serde(default)]
    pub times: Vec<f64>,
    /// Bodies in the order of definition.
    #[serde(default)]
    pub bodies: Vec<BodyInfo>,
}

impl Meshes {
    /// The body of that name.
    ///
    /// # Errors
    /// Lists the names there are.
    pub fn body(&self, name: &str) -> Result<&BodyInfo, StepError> {
        self.bodies.iter().find(|b| b.name == name).ok_or_else(|| {
            let names: Vec<&str> = self.bodies.iter().map(|b| b.name.as_str()).collect();
            StepError::Failed(format!("no body '{name}'; there are: {}", names.join(", ")))
        })
    }
}

/// Progress of a step; leave what does not apply at its default.
#[derive(Debug, Clone, Copy)]
pub struct Progress<'a> {
    /// 0..1 of the step's work.
    pub fraction: f64,
    /// Simulated time (s) or negative.
    pub simulated_time: f64,
    /// Cycles per second or negative.
    pub rate: f64,
    /// Kinetic over internal energy or negative.
    pub energy_ratio: f64,
    /// What is being done.
    pub phase: &'a str,
}

impl Default for Progress<'_> {
    fn default() -> Self {
        Self {
            fraction: 0.0,
            simulated_time: -1.0,
            rate: -1.0,
            energy_ratio: -1.0,
            phase: "",
        }
    }
}

/// The running step's view of the host.
pub struct Host {
    services: *const pf_services,
}

// The contract (plyflow.h): any thread may call services until `run` returns, and the host does one call at a time.
unsafe impl Sync for Host {}

macro_rules! call {
    ($self:ident . $f:ident ( $($a:expr),* )) => {
        // The services table lives as long as the Host (contract of run_step).
        unsafe { let s = &*$self.services; (s.$f)(s.host $(, $a)*) }
    };
}

fn check(code: i32, what: impl FnOnce() -> String) -> Result<(), StepError> {
    let why = match code {
        PF_OK => return Ok(()),
        PF_CANCELLED => return Err(StepError::Cancelled),
        PF_NOT_FOUND => "not found",
        PF_BAD_SHAPE => "the sizes do not match",
        PF_BAD_VALUE => "a value is NaN, infinite or out of range",
        _ => "the host refused",
    };
    Err(StepError::Failed(format!("{}: {why}", what())))
}

impl Host {
    /// Wraps a services table.
    ///
    /// # Safety
    /// `services` must be valid for the life of the `Host`.
    pub unsafe fn new(services: *const pf_services) -> Self {
        Self { services }
    }

    /// The raw table, for code that passes it on.
    pub fn raw(&self) -> *const pf_services {
        self.services
    }

    fn text(&self, s: pf_str) -> &str {
        // Host strings stay valid until `run` returns.
        unsafe { s.as_str() }.unwrap_or("")
    }

    fn json<T: DeserializeOwned>(&self, s: pf_str, what: &str) -> Result<T, StepError> {
        serde_json::from_str(self.text(s)).map_err(|e| StepError::Failed(format!("{what}: {e}")))
    }

    /// Writes a log line.
    pub fn log(&self, level: Log, text: &str) {
        let level = match level {
            Log::Error => PF_LOG_ERROR,
            Log::Warn => PF_LOG_WARN,
            Log::Info => PF_LOG_INFO,
            Log::Debug => PF_LOG_DEBUG,
        };
        call!(self.log(level, pf_str::new(text)));
    }

    /// Reports progress.
    pub fn progress(&self, p: &Progress<'_>) {
        let p = pf_progress {
            size: size_of::<pf_progress>() as u64,
            fraction: p.fraction,
            simulated_time: p.simulated_time,
            rate: p.rate,
            energy_ratio: p.energy_ratio,
            phase: pf_str::new(p.phase),
        };
        call!(self.progress(&raw const p));
    }

    /// Stops with [`StepError::Cancelled`] when the run is being stopped.
    ///
    /// # Errors
    /// Only that one.
    pub fn check_cancelled(&self) -> Result<(), StepError> {
        if call!(self.cancelled()) != 0 {
            Err(StepError::Cancelled)
        } else {
            Ok(())
        }
    }

    /// Threads that the step may use (at least 1).
    pub fn threads(&self) -> usize {
        (call!(self.threads()) as usize).max(1)
    }

    /// The resolved `with` block, as the plugin's own type.
    ///
    /// # Errors
    /// When it does not fit the type.
    pub fn parameters<T: DeserializeOwned>(&self) -> Result<T, StepError> {
        self.json(call!(self.parameters()), "parameters")
    }

    /// A private folder, removed after the step.
    pub fn scratch(&self) -> &str {
        self.text(call!(self.scratch()))
    }

    /// A folder that is kept until the step has succeeded: what lies in it was written by an earlier attempt with the
    /// same plugin, components, parameters and inputs. `None`: this host keeps nothing.
    pub fn checkpoint(&self) -> Option<&str> {
        Some(self.text(call!(self.checkpoint()))).filter(|f| !f.is_empty())
    }

    /// Whether enough time has passed since the last checkpoint.
    pub fn checkpoint_due(&self) -> bool {
        call!(self.checkpoint_due()) != 0
    }

    /// Tells the host that a checkpoint is on disk, so that it notes the cost of the step so far.
    pub fn checkpoint_saved(&self) {
        call!(self.checkpoint_saved());
    }

    /// All inputs in the order of the workflow.
    ///
    /// # Errors
    /// When the host's list cannot be read.
    pub fn inputs(&self) -> Result<Vec<Input>, StepError> {
        self.json(call!(self.inputs()), "inputs")
    }

    /// The inputs wired to one port.
    ///
    /// # Errors
    /// As [`Host::inputs`].
    pub fn inputs_of(&self, port: &str) -> Result<Vec<Input>, StepError> {
        Ok(self
            .inputs()?
            .into_iter()
            .filter(|i| i.port == port)
            .collect())
    }

    /// The single input of a port.
    ///
    /// # Errors
    /// When there is none or more than one.
    pub fn input(&self, port: &str) -> Result<Input, StepError> {
        let mut found = self.inputs_of(port)?;
        match found.len() {
            1 => Ok(found.remove(0)),
            n => Err(StepError::Failed(format!(
                "port '{port}' needs one input, has {n}"
            ))),
        }
    }

    /// This step's own fan-out index path; empty if it is not fanned out.
    ///
    /// # Errors
    /// When the host's text cannot be read.
    pub fn item(&self) -> Result<Vec<u64>, StepError> {
        self.json(call!(self.item()), "item")
    }

    /// The attributes that the input's plugin wrote.
    ///
    /// # Errors
    /// When they do not fit the type.
    pub fn attributes<T: DeserializeOwned>(&self, input: &Input) -> Result<T, StepError> {
        let what = format!("attributes of '{}'", input.step);
        self.json(call!(self.attributes(input.handle)), &what)
    }

    /// Type and shape of an array, or `None` if the artifact has none of that path.
    pub fn array_info(&self, input: &Input, path: &str) -> Option<pf_array_info> {
        let mut info = pf_array_info::default();
        let code = call!(self.array_info(input.handle, pf_str::new(path), &raw mut info));
        (code == PF_OK).then_some(info)
    }

    fn read_array<T: Copy + Default>(
        &self,
        input: &Input,
        path: &str,
        dtype: u32,
    ) -> Result<(Vec<T>, Vec<usize>), StepError> {
        let missing = || StepError::Failed(format!("'{}' has no array '{path}'", input.step));
        let info = self.array_info(input, path).ok_or_else(missing)?;
        let shape: Vec<usize> = info.shape[..info.rank as usize]
            .iter()
            .map(|n| *n as usize)
            .collect();
        let mut data = vec![T::default(); shape.iter().product()];
        let bytes = size_of_val(data.as_slice()) as u64;
        let buffer = data.as_mut_ptr().cast();
        check(
            call!(self.array_read(input.handle, pf_str::new(path), dtype, buffer, bytes)),
            || format!("reading '{path}' of '{}'", input.step),
        )?;
        Ok((data, shape))
    }

    /// An array as f64 (converted if stored otherwise) with its shape.
    ///
    /// # Errors
    /// When there is none.
    pub fn array_f64(
        &self,
        input: &Input,
        path: &str,
    ) -> Result<(Vec<f64>, Vec<usize>), StepError> {
        self.read_array(input, path, PF_F64)
    }

    /// An array as u32 with its shape.
    ///
    /// # Errors
    /// When there is none.
    pub fn array_u32(
        &self,
        input: &Input,
        path: &str,
    ) -> Result<(Vec<u32>, Vec<usize>), StepError> {
        self.read_array(input, path, PF_U32)
    }

    /// Bodies, fields and frame times of an input.
    ///
    /// # Errors
    /// When the artifact has no meshes.
    pub fn meshes(&self, input: &Input) -> Result<Meshes, StepError> {
        let what = format!("meshes of '{}'", input.step);
        self.json(call!(self.meshes(input.handle)), &what)
    }

    /// The services that read meshes take no sizes: a description of another artifact's body would make
    /// the host write beyond the buffer.
    fn check_body(&self, input: &Input, body: &BodyInfo) -> Result<(), StepError> {
        let meshes = self.meshes(input)?;
        let own = meshes.body(&body.name)?;
        let sizes = |b: &BodyInfo| (b.points, b.cells, b.nodes_per_cell);
        if sizes(own) == sizes(body) {
            return Ok(());
        }
        Err(StepError::Failed(format!(
            "body '{}' of '{}' has {} points and {} cells; the description given is of another \
             artifact's body with {} and {}",
            body.name, input.step, own.points, own.cells, body.points, body.cells
        )))
    }

    /// Reference points `[n]` (m) and cells `[m * nodes_per_cell]` of a body.
    ///
    /// # Errors
    /// When there is no such body.
    pub fn mesh(
        &self,
        input: &Input,
        body: &BodyInfo,
    ) -> Result<(Vec<[f64; 3]>, Vec<u32>), StepError> {
        self.check_body(input, body)?;
        let mut points = vec![[0.0; 3]; body.points];
        let mut cells = vec![0u32; body.cells * body.nodes_per_cell];
        let (p, c) = (points.as_mut_ptr().cast(), cells.as_mut_ptr());
        check(
            call!(self.mesh_read(input.handle, pf_str::new(&body.name), p, c)),
            || format!("body '{}' of '{}'", body.name, input.step),
        )?;
        Ok((points, cells))
    }

    /// Points (m) of a body in a frame.
    ///
    /// # Errors
    /// When there is no such body or frame.
    pub fn frame_points(
        &self,
        input: &Input,
        body: &BodyInfo,
        frame: usize,
    ) -> Result<Vec<[f64; 3]>, StepError> {
        self.check_body(input, body)?;
        let mut points = vec![[0.0; 3]; body.points];
        let p = points.as_mut_ptr().cast();
        let name = pf_str::new(&body.name);
        check(
            call!(self.frame_points_read(input.handle, name, frame as u64, p)),
            || format!("frame {frame} of body '{}' of '{}'", body.name, input.step),
        )?;
        Ok(points)
    }

    /// Values `[rows * components]` of a field in a frame.
    ///
    /// # Errors
    /// When there is no such body, frame or field.
    pub fn frame_field(
        &self,
        input: &Input,
        body: &BodyInfo,
        frame: usize,
        name: &str,
    ) -> Result<Vec<f64>, StepError> {
        let Some(field) = body.fields.iter().find(|f| f.name == name) else {
            let names: Vec<&str> = body.fields.iter().map(|f| f.name.as_str()).collect();
            return Err(StepError::Failed(format!(
                "body '{}' of '{}' has no field '{name}'; there are: {}",
                body.name,
                input.step,
                names.join(", ")
            )));
        };
        let (rows, on) = match field.on {
            On::Points => (body.points, PF_ON_POINTS),
            On::Cells => (body.cells, PF_ON_CELLS),
        };
        let mut values = vec![0.0; rows * field.components as usize];
        let (p, n) = (values.as_mut_ptr(), values.len() as u64);
        let (b, f) = (pf_str::new(&body.name), pf_str::new(name));
        check(
            call!(self.frame_field_read(input.handle, b, frame as u64, on, f, p, n)),
            || format!("field '{name}' of body '{}' of '{}'", body.name, input.step),
        )?;
        Ok(values)
    }

    /// Writes the artifact's attributes (once; a JSON object).
    ///
    /// # Errors
    /// When the host refuses.
    pub fn write_attributes(&self, value: &impl serde::Serialize) -> Result<(), StepError> {
        let text = serde_json::to_string(value).map_err(|e| StepError::Failed(e.to_string()))?;
        check(call!(self.attributes_write(pf_str::new(&text))), || {
            "writing attributes".into()
        })
    }

    fn write_array<T>(
        &self,
        path: &str,
        dtype: u32,
        shape: &[usize],
        unit: &str,
        data: &[T],
    ) -> Result<(), StepError> {
        let what = || format!("writing array '{path}'");
        if shape.len() > PF_MAX_RANK || shape.iter().product::<usize>() != data.len() {
            return Err(StepError::Failed(format!(
                "{}: shape {shape:?} does not hold {} values",
                what(),
                data.len()
            )));
        }
        let mut info = pf_array_info {
            dtype,
            rank: shape.len() as u32,
            ..Default::default()
        };
        for (to, from) in info.shape.iter_mut().zip(shape) {
            *to = *from as u64;
        }
        let (p, u) = (pf_str::new(path), pf_str::new(unit));
        check(
            call!(self.array_write(p, &raw const info, u, data.as_ptr().cast())),
            what,
        )
    }

    /// Writes an f64 array (row-major) at `path`, e.g. `history/kinetic_energy`.
    ///
    /// # Errors
    /// When the shape does not fit, a value is not finite, or the path exists.
    pub fn write_f64(
        &self,
        path: &str,
        shape: &[usize],
        unit: &str,
        data: &[f64],
    ) -> Result<(), StepError> {
        self.write_array(path, PF_F64, shape, unit, data)
    }

    /// Writes a u32 array (row-major) at `path`.
    ///
    /// # Errors
    /// As [`Host::write_f64`].
    pub fn write_u32(&self, path: &str, shape: &[usize], data: &[u32]) -> Result<(), StepError> {
        self.write_array(path, PF_U32, shape, "1", data)
    }

    /// Defines a body: reference `points` (m) and `cells` with `k` = 3 or 4 nodes each.
    ///
    /// # Errors
    /// When the host refuses (name taken, index out of range, after the first frame).
    pub fn define_mesh(
        &self,
        body: &str,
        points: &[[f64; 3]],
        k: usize,
        cells: &[u32],
        attributes: &serde_json::Value,
    ) -> Result<(), StepError> {
        if !matches!(k, 3 | 4) || !cells.len().is_multiple_of(k) {
            return Err(StepError::Failed(format!(
                "body '{body}': {} node numbers do not make cells of {k} nodes; a cell has 3 or 4",
                cells.len()
            )));
        }
        let json = attributes.to_string();
        let (n, m) = (points.len() as u64, (cells.len() / k) as u64);
        let (p, c) = (points.as_ptr().cast(), cells.as_ptr());
        let (b, j) = (pf_str::new(body), pf_str::new(&json));
        check(call!(self.mesh_define(b, n, p, m, k as u32, c, j)), || {
            format!("body '{body}'")
        })
    }

    /// Starts a frame at `time` (s).
    ///
    /// # Errors
    /// When a frame is open or the time does not grow.
    pub fn begin_frame(&self, time: f64) -> Result<(), StepError> {
        check(call!(self.frame_begin(time)), || {
            format!("frame at {time} s")
        })
    }

    /// Points (m) of a body in the open frame.
    ///
    /// # Errors
    /// When the size differs from the body's or a value is not finite.
    pub fn write_points(&self, body: &str, points: &[[f64; 3]]) -> Result<(), StepError> {
        let (b, p, n) = (
            pf_str::new(body),
            points.as_ptr().cast(),
            points.len() as u64,
        );
        check(call!(self.frame_points(b, p, n)), || {
            format!("points of body '{body}'")
        })
    }

    /// A field `[rows * components]` of a body in the open frame.
    ///
    /// # Errors
    /// As [`Host::write_points`].
    pub fn write_field(
        &self,
        body: &str,
        on: On,
        name: &str,
        components: u32,
        unit: &str,
        values: &[f64],
    ) -> Result<(), StepError> {
        let on = if on == On::Points {
            PF_ON_POINTS
        } else {
            PF_ON_CELLS
        };
        let (b, f, u) = (pf_str::new(body), pf_str::new(name), pf_str::new(unit));
        let (p, n) = (values.as_ptr(), values.len() as u64);
        check(
            call!(self.frame_field(b, on, f, components, u, p, n)),
            || format!("field '{name}' of body '{body}'"),
        )
    }

    /// Ends the open frame.
    ///
    /// # Errors
    /// When a body lacks a field that it had in the first frame.
    pub fn end_frame(&self) -> Result<(), StepError> {
        check(call!(self.frame_end()), || "ending a frame".into())
    }

    /// A named number for `plyflow results`.
    ///
    /// # Errors
    /// When the value is not finite or the name is taken.
    pub fn result(&self, name: &str, value: f64, unit: &str) -> Result<(), StepError> {
        let (n, u) = (pf_str::new(name), pf_str::new(unit));
        check(call!(self.result(n, value, u, 0)), || {
            format!("result '{name}' = {value}")
        })
    }

    /// A named number that depends on the machine (seconds, bytes); kept beside the artifact.
    ///
    /// # Errors
    /// As [`Host::result`].
    pub fn measured(&self, name: &str, value: f64, unit: &str) -> Result<(), StepError> {
        let (n, u) = (pf_str::new(name), pf_str::new(unit));
        check(call!(self.result(n, value, u, PF_RESULT_MEASURED)), || {
            format!("result '{name}' = {value}")
        })
    }

    /// Declares the output a collection of the named items, for later fan-out.
    ///
    /// # Errors
    /// When the plugin's manifest does not declare a collection.
    pub fn collection(&self, names: &[String]) -> Result<(), StepError> {
        let json = serde_json::to_string(names).map_err(|e| StepError::Failed(e.to_string()))?;
        check(
            call!(self.collection(names.len() as u64, pf_str::new(&json))),
            || "declaring the collection".into(),
        )
    }

    /// A component by name or path. Its function table stays valid until the process ends.
    ///
    /// # Errors
    /// When there is none of that kind.
    pub fn component(&self, kind: u32, name: &str) -> Result<pf_component, StepError> {
        let mut c = pf_component {
            kind: 0,
            reserved: 0,
            functions: std::ptr::null(),
            manifest: pf_str::new(""),
        };
        check(
            call!(self.find_component(kind, pf_str::new(name), &raw mut c)),
            || {
                let what = if kind == PF_KIND_ELEMENT {
                    "element"
                } else {
                    "material"
                };
                format!("{what} component '{name}'")
            },
        )?;
        Ok(c)
    }
}

/// Runs a [`Step`] behind the ABI: used by [`crate::export_step!`].
///
/// # Safety
/// `services` must be a valid table for the length of the call.
pub unsafe fn run_step<S: Step>(services: *const pf_services) -> i32 {
    let size = size_of::<pf_services>() as u64;
    if services.is_null() || unsafe { (*services).size } < size {
        // A host that accepts this plugin's ABI version has all of its services.
        return PF_ERROR;
    }
    let host = unsafe { Host::new(services) };
    let fail = |text: &str| unsafe { ((*services).fail)((*services).host, pf_str::new(text)) };
    match catch_unwind(AssertUnwindSafe(|| S::run(&host))) {
        Ok(Ok(())) => PF_OK,
        Ok(Err(StepError::Cancelled)) => PF_CANCELLED,
        Ok(Err(StepError::Failed(text))) => {
            fail(&text);
            PF_ERROR
        }
        Err(payload) => {
            fail(&format!(
                "the plugin panicked: {}",
                panic_text(payload.as_ref())
            ));
            PF_PANIC
        }
    }
}
