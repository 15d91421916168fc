//! Steps: the host's services with Rust types.

use crate::error::{StepError, panic_text};
use plyflow_abi::*;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};

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
    /// Whether the step was told to stop.
    told_to_stop: AtomicBool,
}

// SAFETY: any thread may call services until `run` returns, and the host does one call at a time (plyflow.h); a `Host` lives no longer than
// that (`Host::new`). The flag is atomic.
unsafe impl Sync for Host {}

macro_rules! call {
    ($self:ident . $f:ident ( $($a:expr),* )) => {
        // SAFETY: the table lives as long as the `Host` (`Host::new`). What is given with the call are texts, arrays and structs that are borrowed
        // through it, each array as long as the call says or, where it says nothing, as `check_body` has found.
        unsafe { let s = &*$self.services; (s.$f)(s.host $(, $a)*) }
    };
}

mod read;
mod write;

impl Host {
    /// Wraps a services table.
    ///
    /// # Safety
    /// `services` must be a whole table of a host that keeps to plyflow.h, valid for the life of the `Host`: until the step's `run` returns.
    pub unsafe fn new(services: *const pf_services) -> Self {
        Self {
            services,
            told_to_stop: AtomicBool::new(false),
        }
    }

    /// The raw table, for code that passes it on.
    pub fn raw(&self) -> *const pf_services {
        self.services
    }

    fn check(&self, code: i32, what: impl FnOnce() -> String) -> Result<(), StepError> {
        let why = match code {
            PF_OK => return Ok(()),
            PF_CANCELLED => return Err(self.stop()),
            PF_NOT_FOUND => "not found",
            PF_BAD_SHAPE => "the sizes do not match",
            PF_BAD_VALUE => "a value is NaN, infinite or out of range",
            _ => "the host refused",
        };
        Err(StepError::Failed(format!("{}: {why}", what())))
    }

    /// What a step is told that shall stop. However it passes that on, it ends as cancelled.
    fn stop(&self) -> StepError {
        self.told_to_stop.store(true, Ordering::Relaxed);
        StepError::Cancelled
    }

    /// A text that a service of this host returned: nothing else is given here.
    fn text(&self, s: pf_str) -> &str {
        // SAFETY: the host's texts stay valid until `run` returns (plyflow.h), which the `Host` does not outlive (`Host::new`).
        unsafe { s.as_str() }.unwrap_or("")
    }

    fn json<T: DeserializeOwned>(&self, s: pf_str, what: &str) -> Result<T, StepError> {
        let mut text = serde_json::Deserializer::from_str(self.text(s));
        serde_path_to_error::deserialize(&mut text).map_err(|e| {
            let path = e.path().to_string();
            // A lone dot: the whole.
            let place = if path == "." {
                String::new()
            } else {
                format!(" `{path}`:")
            };
            StepError::Failed(format!("{what}:{place} {}", e.inner()))
        })
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
            Err(self.stop())
        } else {
            Ok(())
        }
    }

    /// Threads that the step may use now (at least 1). It is given these at its start and keeps them; later there may be more, while the run
    /// has cores that nothing else can use: a long step asks again now and then. What it writes must not depend on it.
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
        self.check(
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
    // SAFETY: not null, so a table (the caller's promise), and every version of it begins with its size.
    if services.is_null() || unsafe { (*services).size } < size {
        // A host that accepts this plugin's ABI version has all of its services.
        return PF_ERROR;
    }
    // SAFETY: a table that is valid for this call, which `host` does not outlive, and as large as this plugin knows it (above).
    let host = unsafe { Host::new(services) };
    // SAFETY: the same table, still in the call; the text is borrowed through it.
    let fail = |text: &str| unsafe { ((*services).fail)((*services).host, pf_str::new(text)) };
    match catch_unwind(AssertUnwindSafe(|| S::run(&host))) {
        Ok(Ok(())) => PF_OK,
        Ok(Err(StepError::Cancelled)) => PF_CANCELLED,
        Ok(Err(_)) if host.told_to_stop.load(Ordering::Relaxed) => PF_CANCELLED,
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
