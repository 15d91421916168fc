//! The state behind the services of one running step.

use crate::breach::ComponentError;
use crate::catalog::find_component_library;
use crate::checkpoints::Checkpoints;
use crate::emitter::Emitter;
use crate::lent::Lent;
use crate::load::Plugin;
use plyflow_abi::{PF_BAD_SHAPE, PF_BAD_VALUE, PF_ERROR, PF_NOT_FOUND};
use plyflow_artifact::{Artifact, ArtifactError, ArtifactWriter, ErrorKind};
use plyflow_model::job::{Job, LogLevel, NamedResult};
use plyflow_model::manifest::PluginKind;
use serde_json::json;
use std::cell::OnceCell;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

/// One input artifact, opened when the plugin first reads it.
#[derive(Default)]
pub(crate) struct InputSlot {
    artifact: OnceLock<Result<Artifact, ArtifactError>>,
    pub(crate) meshes: OnceLock<String>,
}

/// What writing has come to.
pub(crate) struct Output {
    /// Gone when finished.
    pub(crate) writer: Option<ArtifactWriter>,
    pub(crate) results: Vec<NamedResult>,
    /// The first write that was refused, by the data model or by the disk: there is no artifact, whatever the plugin says.
    pub(crate) refused: Option<ArtifactError>,
    /// What the plugin said of its failure.
    pub(crate) failure: Option<String>,
    /// The last thing that a service refused, for the failure's text.
    pub(crate) detail: Option<String>,
    pub(crate) components: Vec<(String, Plugin)>,
}

/// Everything that `pf_services.host` points to. Text handed to the plugin lives here.
pub(crate) struct HostState<'a, 'w> {
    pub(crate) job: &'a Job,
    pub(crate) plugin: &'a Plugin,
    pub(crate) emitter: &'a Emitter<'w>,
    pub(crate) parameters: String,
    pub(crate) inputs: String,
    pub(crate) item: String,
    pub(crate) scratch: OnceLock<String>,
    pub(crate) slots: Vec<InputSlot>,
    pub(crate) checkpoints: Checkpoints<'a>,
    lent: Lent,
    /// The most threads that the step was told it may use.
    most_threads: AtomicU32,
    output: Mutex<Output>,
}

impl<'a, 'w> HostState<'a, 'w> {
    pub(crate) fn new(
        job: &'a Job,
        plugin: &'a Plugin,
        emitter: &'a Emitter<'w>,
        lent: Lent,
    ) -> Result<Self, ArtifactError> {
        let inputs: Vec<serde_json::Value> = job
            .inputs
            .iter()
            .enumerate()
            .map(|(handle, i)| {
                json!({"handle": handle, "port": i.port, "step": i.step, "kind": i.kind,
                       "item": i.item, "cost": i.cost})
            })
            .collect();
        let writer = ArtifactWriter::create(job.artifact.as_std_path(), &job.output_kind)?;
        let output = Output {
            writer: Some(writer),
            results: Vec::new(),
            refused: None,
            failure: None,
            detail: None,
            components: Vec::new(),
        };
        Ok(Self {
            job,
            plugin,
            emitter,
            parameters: job.parameters.to_string(),
            inputs: serde_json::Value::from(inputs).to_string(),
            item: serde_json::Value::from(job.item.clone()).to_string(),
            scratch: OnceLock::new(),
            slots: job.inputs.iter().map(|_| InputSlot::default()).collect(),
            checkpoints: Checkpoints::new(job.checkpoints.as_ref()),
            lent,
            most_threads: AtomicU32::new(job.threads.max(1)),
            output: Mutex::new(output),
        })
    }

    /// How many threads the step may use at the moment: never fewer than its job has.
    pub(crate) fn threads(&self) -> u32 {
        let own = self.job.threads.max(1);
        let now = self.lent.threads().map_or(own, |lent| lent.max(own));
        self.most_threads.fetch_max(now, Ordering::Relaxed);
        now
    }

    /// The most that [`Self::threads`] has told.
    pub(crate) fn most_threads(&self) -> u32 {
        self.most_threads.load(Ordering::Relaxed)
    }

    pub(crate) fn output(&self) -> MutexGuard<'_, Output> {
        self.output.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The artifact behind a handle.
    pub(crate) fn artifact(&self, handle: u32) -> Result<&Artifact, ArtifactError> {
        let Some(slot) = self.slots.get(handle as usize) else {
            return Err(ArtifactError {
                kind: ErrorKind::NotFound,
                message: format!("there is no input {handle}; there are {}", self.slots.len()),
            });
        };
        let path = self.job.inputs[handle as usize].artifact.as_std_path();
        slot.artifact
            .get_or_init(|| Artifact::open(path))
            .as_ref()
            .map_err(Clone::clone)
    }

    /// A reading that went well: what was refused before, the plugin has got over.
    pub(crate) fn succeed(&self) -> i32 {
        self.output().detail = None;
        0
    }

    /// Turns a refused reading into a status and keeps the reason.
    pub(crate) fn refuse_read(&self, error: &ArtifactError) -> i32 {
        self.output().detail = Some(error.message.clone());
        status(error.kind)
    }

    /// Does a write; a refusal is kept, so that the step fails even if the plugin ignores the status.
    pub(crate) fn write(&self, f: impl FnOnce(&mut Output) -> Result<(), ArtifactError>) -> i32 {
        let mut output = self.output();
        match f(&mut output) {
            Ok(()) => {
                output.detail = None;
                0
            }
            Err(e) => {
                output.detail = Some(e.message.clone());
                let code = status(e.kind);
                output.refused.get_or_insert(e);
                code
            }
        }
    }

    /// The private folder, made on the first call. Where it cannot be made the step fails of that, as of a write that is refused, and not
    /// of what the plugin then finds missing: a failing disk is no fault of the plugin's.
    pub(crate) fn scratch(&self) -> &str {
        self.scratch.get_or_init(|| {
            if let Err(e) = std::fs::create_dir_all(&self.job.scratch) {
                let message = format!(
                    "the scratch folder {} cannot be made: {e}",
                    self.job.scratch
                );
                self.emitter.log(LogLevel::Error, &message);
                let kind = ErrorKind::Io;
                self.output()
                    .refused
                    .get_or_insert(ArtifactError { kind, message });
            }
            self.job.scratch.to_string()
        })
    }

    /// A component by name or path: what the job lists, then the search path.
    pub(crate) fn component(&self, kind: PluginKind, name: &str) -> Result<Plugin, ComponentError> {
        let mut output = self.output();
        let known = |(n, p): &&(String, Plugin)| n == name && p.manifest.kind == kind;
        if let Some((_, plugin)) = output.components.iter().find(known) {
            return Ok(plugin.clone());
        }
        let listed = OnceCell::new();
        for library in &self.job.components {
            if library.name != name && library.path.as_str() != name {
                continue;
            }
            let hash = library.hash.as_deref();
            let plugin = Plugin::load_bytes(&library.path, hash)?;
            if plugin.manifest.kind == kind {
                let _ = listed.set(plugin);
                break;
            }
        }
        let plugin = match listed.into_inner() {
            Some(plugin) => plugin,
            None => {
                let plugin = find_component_library(&self.job.search_path, kind, name)?;
                self.emitter.log(
                    LogLevel::Warn,
                    &format!(
                        "the {kind} '{name}' is not named by a parameter of type `{kind}`: a new \
                         version of it will not make this step run again"
                    ),
                );
                plugin
            }
        };
        output.components.push((name.to_owned(), plugin.clone()));
        Ok(plugin)
    }
}

pub(crate) fn status(kind: ErrorKind) -> i32 {
    match kind {
        ErrorKind::NotFound => PF_NOT_FOUND,
        ErrorKind::BadShape => PF_BAD_SHAPE,
        ErrorKind::BadValue => PF_BAD_VALUE,
        ErrorKind::BadOrder | ErrorKind::NotAnArtifact | ErrorKind::Io => PF_ERROR,
    }
}
