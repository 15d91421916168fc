//! The contract between the engine and a worker: one step instance as a self-contained document, what
//! comes back, and the lines in between.
//!
//! A worker (`plyflow step-worker FILE`, or `-` for standard input) reads one [`Job`], runs the plugin,
//! writes the artifact and its [`Record`] under the temporary names that the job gives, and talks on
//! standard output in [`Message`]s, one JSON object a line. The last line is `done` or `failed`. A worker
//! that ends without either has crashed. Nothing here assumes that engine and worker share a process, a
//! parent or a machine: only the paths in the job must be reachable from both.

use camino::Utf8PathBuf;
use serde::{Deserialize, Serialize};

/// Version of this contract; a worker refuses a job of another. 2: records are sealed and hold the hash of the artifact.
pub const JOB_VERSION: u32 = 2;

/// Version of the data model (`schemas/data-model.md`); part of every content key.
pub const DATA_MODEL_VERSION: u32 = 1;

/// A library to load.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LibraryRef {
    /// Name in its manifest, or as the parameter names it.
    pub name: String,
    /// The library, absolute.
    pub path: Utf8PathBuf,
    /// BLAKE3 (hex) that its bytes must have before it is loaded: what the user consented to. Absent: it lies where any
    /// bytes are trusted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hash: Option<String>,
}

/// What a step cost.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// Wall-clock time of the plugin's `run` (s).
    pub wall_seconds: f64,
    /// User and system time of the worker (s).
    pub cpu_seconds: f64,
    /// Largest resident set of the worker (bytes).
    pub peak_memory: u64,
    /// Threads that the step was given.
    pub threads: u32,
}

/// One artifact that arrives at a port.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JobInput {
    /// Port of the plugin.
    pub port: String,
    /// Step that made it.
    pub step: String,
    /// Artifact kind.
    pub kind: String,
    /// Its own fan-out index path, `[]` when its step is not fanned out.
    pub item: Vec<u64>,
    /// The file, absolute.
    pub artifact: Utf8PathBuf,
    /// What it cost.
    pub cost: Cost,
}

/// Where a step may keep what lets a later attempt go on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Checkpoints {
    /// A folder of this instance and key alone, made when the plugin first asks for it. The engine removes it when the artifact
    /// is in the store, not before: until then it is all that is left of the work if the machine stops.
    pub folder: Utf8PathBuf,
    /// Wall-clock time between two checkpoints (s).
    pub interval: f64,
}

/// One step instance to run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Job {
    /// [`JOB_VERSION`].
    pub version: u32,
    /// Step name in the workflow.
    pub step: String,
    /// Fan-out index path of this instance, outermost first; `[]` when the step is not fanned out.
    pub item: Vec<u64>,
    /// Content key, hex.
    pub key: String,
    /// The step plugin.
    pub plugin: LibraryRef,
    /// Components that the parameters name; looked up here before `search_path`.
    pub components: Vec<LibraryRef>,
    /// Folders searched for further components, in order: only such as are trusted whatever lies in them.
    pub search_path: Vec<Utf8PathBuf>,
    /// Resolved parameters: JSON object, SI numbers.
    pub parameters: serde_json::Value,
    /// Inputs in the order of the workflow; the position is the handle that the plugin sees.
    pub inputs: Vec<JobInput>,
    /// Artifact kind to write.
    pub output_kind: String,
    /// Whether the plugin must declare a collection.
    pub collection: bool,
    /// Threads it may use.
    pub threads: u32,
    /// Memory limit (bytes); 0: none.
    pub memory_limit: u64,
    /// Where to write the artifact: a temporary name in an existing folder. The engine renames it.
    pub artifact: Utf8PathBuf,
    /// Where to write the record (JSON of [`Record`]): a temporary name. The engine renames it.
    pub record: Utf8PathBuf,
    /// A private folder, made by the worker when the plugin first asks for it and removed at the end.
    pub scratch: Utf8PathBuf,
    /// Checkpoints; without them the step starts anew in every attempt.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub checkpoints: Option<Checkpoints>,
    /// Written as it is into the artifact (`/plyflow`, attribute `provenance`); holds nothing that
    /// depends on the machine.
    pub provenance: serde_json::Value,
}

/// A named number.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NamedResult {
    /// Name.
    pub name: String,
    /// Value (SI).
    pub value: f64,
    /// Unit.
    pub unit: String,
    /// Whether it depends on the machine.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub measured: bool,
}

/// What is kept beside an artifact (`<key>.record.json`). The file ends with a seal: the BLAKE3 of all that is before it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// [`JOB_VERSION`].
    pub version: u32,
    /// Step, for people; the same key may serve others.
    pub step: String,
    /// Fan-out index path.
    pub item: Vec<u64>,
    /// Content key, hex.
    pub key: String,
    /// Artifact kind.
    pub kind: String,
    /// Size of the artifact (bytes): a file of another size is not the one that was written.
    pub bytes: u64,
    /// BLAKE3 of the artifact, hex: a file of other bytes is not the one that was written. Empty in records of version 1.
    #[serde(default)]
    pub hash: String,
    /// What it cost.
    pub cost: Cost,
    /// Results in the order reported, measured ones marked.
    pub results: Vec<NamedResult>,
    /// Labels of the collection's items; absent when the artifact is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub collection: Option<Vec<String>>,
    /// Texts that the plugin logged as warnings.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// Name of the machine.
    pub host: String,
    /// When the step began (s since 1970-01-01 UTC).
    pub started: f64,
}

impl Record {
    /// Whether the step took so long (s of wall-clock time, with what earlier attempts took) that its files are put on the disk
    /// before they count as written, and their names after they have them. Asking the disk takes some milliseconds, which would
    /// be most of the time of a run of many small steps; what these lose when the power fails is made again in a moment.
    #[must_use]
    pub fn is_lasting(&self) -> bool {
        self.cost.wall_seconds >= 1.0
    }
}

/// Level of a log line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LogLevel {
    /// The step will probably fail.
    Error,
    /// Worth a look.
    Warn,
    /// What is going on.
    Info,
    /// For the plugin's author.
    Debug,
}

/// Why a step failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FailureKind {
    /// The plugin returned an error.
    Error,
    /// The plugin panicked; its own net caught it.
    Panic,
    /// It stopped because it was told to.
    Cancelled,
    /// The artifact breaks the data model (NaN, missing frame or field, no collection).
    Malformed,
    /// The library cannot be loaded: absent, wrong ABI, wrong kind.
    Load,
}

/// How far a step is; a field that the step does not have is absent.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// 0 to 1.
    pub fraction: f64,
    /// Simulated time (s).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub simulated_time: Option<f64>,
    /// Cycles per second.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate: Option<f64>,
    /// Kinetic over internal energy.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub energy_ratio: Option<f64>,
    /// What is being done, in a few words.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub phase: String,
}

/// One line of a worker's standard output.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "lowercase")]
pub enum Message {
    /// How far it is; at most about ten a second.
    Progress(Progress),
    /// A log line of the plugin.
    Log {
        /// Level.
        level: LogLevel,
        /// Text.
        text: String,
    },
    /// The artifact and the record are whole under their temporary names.
    Done {
        /// The record as written.
        record: Box<Record>,
    },
    /// Nothing usable was written.
    Failed {
        /// Why.
        kind: FailureKind,
        /// Text for the user.
        message: String,
    },
}
