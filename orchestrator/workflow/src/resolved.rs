//! A workflow with every name looked up, every parameter checked and in SI, every file hashed: all that
//! the planner and the engine need, and nothing of YAML.

use camino::Utf8PathBuf;
use plyflow_model::artifact::{self, StudyOrigin, Variation};
use plyflow_model::workflow::{FamilyOf, Limits, ResponseOf};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fmt;
use std::ops::{Deref, DerefMut};
use std::sync::OnceLock;

/// A plugin library as found on the search path or by path.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PluginId {
    /// Name in its manifest.
    pub name: String,
    /// Version in its manifest.
    pub version: String,
    /// The library.
    pub path: Utf8PathBuf,
    /// BLAKE3 of the library's bytes, hex.
    pub hash: String,
}

/// A file that a parameter names, whose content is part of the key.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputFile {
    /// JSON pointer of the parameter, e.g. `/scene/tool/stl/file`.
    pub pointer: String,
    /// Absolute path.
    pub path: Utf8PathBuf,
    /// BLAKE3 of its bytes, hex.
    pub hash: String,
}

/// One wire of a step.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ResolvedInput {
    /// Port of the receiving plugin.
    pub port: String,
    /// Step whose artifact arrives. Fan-out: dimensions that both steps have are matched by index,
    /// dimensions that only the giving step has are gathered (all items, in order), dimensions that only
    /// the receiving step has repeat the same artifact.
    pub from: String,
}

/// One dimension of a fan-out.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Dimension {
    /// Name in `for_each`, for labels.
    pub name: String,
    /// The step whose collection is fanned over; identifies the dimension.
    pub over: String,
}

/// What a step may use.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Resources {
    /// Cores; the engine gives the step this many threads. 0: not stated, it gets a share of what is free.
    pub cores: u32,
    /// Bytes.
    pub memory: u64,
    /// Wall-clock limit (s); 0: none.
    pub time_limit: f64,
}

/// Parameters of a step: a JSON value, which may stay packed until somebody asks for it. Of ten thousand steps that are all in the
/// store nobody does.
#[derive(Clone, Serialize, Deserialize)]
#[serde(from = "Value", into = "Value")]
pub struct Parameters {
    value: OnceLock<Value>,
    packed: Vec<u8>,
    unpack: fn(&[u8]) -> Value,
}

impl Parameters {
    /// Those that `unpack` makes of some bytes.
    pub fn packed(bytes: Vec<u8>, unpack: fn(&[u8]) -> Value) -> Self {
        Self {
            value: OnceLock::new(),
            packed: bytes,
            unpack,
        }
    }
}

impl From<Value> for Parameters {
    fn from(value: Value) -> Self {
        Self {
            value: value.into(),
            packed: Vec::new(),
            unpack: |_| Value::Null,
        }
    }
}

impl From<Parameters> for Value {
    fn from(parameters: Parameters) -> Self {
        parameters.clone_value()
    }
}

impl Parameters {
    /// A copy of the value.
    pub fn clone_value(&self) -> Value {
        Value::clone(self)
    }
}

impl Deref for Parameters {
    type Target = Value;

    fn deref(&self) -> &Value {
        self.value.get_or_init(|| (self.unpack)(&self.packed))
    }
}

impl DerefMut for Parameters {
    fn deref_mut(&mut self) -> &mut Value {
        let value = Value::clone(self);
        *self = Self::from(value);
        self.value.get_mut().expect("it has just been set")
    }
}

impl PartialEq for Parameters {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl fmt::Debug for Parameters {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(&**self, f)
    }
}

/// One step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ResolvedStep {
    /// Name in the workflow; of a step of a study with the values that it depends on, such as `formed@angle=45deg`.
    pub name: String,
    /// Of a step of a study: its name in the file. Its plugin, its artifact and its key know it by that, so that a key is of values
    /// alone: points share what is the same for them, and no other name makes anything run again.
    pub base: Option<String>,
    /// Role of its plugin.
    pub role: String,
    /// Its plugin.
    pub plugin: PluginId,
    /// Components that its parameters name (elements, materials), in order of their JSON pointer.
    pub components: Vec<PluginId>,
    /// Resolved `with` block: SI numbers, defaults filled in, keys sorted.
    pub parameters: Parameters,
    /// Files that parameters name.
    pub files: Vec<InputFile>,
    /// Wires, in the order of the plugin's ports.
    pub inputs: Vec<ResolvedInput>,
    /// All fan-out dimensions, outermost first: those of the collections it fans over, then its own.
    pub dimensions: Vec<Dimension>,
    /// Kind of its artifact.
    pub output_kind: String,
    /// Whether its artifact is a collection.
    pub collection: bool,
    /// Budget.
    pub resources: Resources,
    /// How often a failed step is tried again.
    pub retries: u32,
}

impl ResolvedStep {
    /// Its name in the file.
    pub fn in_file(&self) -> &str {
        self.base.as_deref().unwrap_or(&self.name)
    }
}

/// The points of a study, and what is read from them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Study {
    /// The variables.
    pub variables: Vec<StudyVariable>,
    /// The points.
    pub points: Vec<StudyPoint>,
    /// Names of the steps in the file, in the order in which they run.
    pub steps: Vec<String>,
    /// What is read from every point.
    pub responses: Vec<StudyResponse>,
    /// What is expected of it.
    pub expectations: Vec<FamilyExpectation>,
    /// The samples: method, number of points, seed.
    pub samples: Vec<(String, u32, u32)>,
    /// Failed points that are borne; none: any number may fail, and the run does not end well.
    pub at_most_failures: Option<u32>,
    /// Of an optimisation, whose points are those that it has asked for so far.
    pub optimisation: Option<Optimisation>,
}

/// What an optimisation looks for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Optimisation {
    /// Position of the response that is to be small or large.
    pub objective: usize,
    /// Whether it is to be large.
    pub maximise: bool,
    /// What must hold, as written.
    pub subject_to: Vec<String>,
    /// By comparison of that, in what SI unit it is told how far it is from holding; `1` of plain numbers.
    pub constraints: Vec<String>,
    /// The method, as written.
    pub method: String,
    /// Chooses its random numbers.
    pub seed: u32,
    /// How long it goes on.
    pub budget: Budget,
    /// Names the search: all of the block but its budget.
    pub digest: String,
    /// The search itself and the points that it has asked for; none where a workflow was read from where it is kept, which those with
    /// an optimisation are not.
    #[serde(skip)]
    pub search: Option<(
        plyflow_study::optimise::Search,
        Vec<Vec<plyflow_study::Value>>,
    )>,
}

/// How long an optimisation goes on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Budget {
    /// So many points.
    Runs(u32),
    /// So much CPU time (s).
    CpuSeconds(f64),
}

/// A variable of a study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StudyVariable {
    /// Name.
    pub name: String,
    /// Unit in which its values are shown; empty for plain numbers, texts, and yes or no.
    pub unit: String,
    /// The SI unit of the same.
    pub si_unit: String,
}

/// A value of a variable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum StudyValue {
    /// A number: in the unit of its variable, and in SI.
    Number {
        /// As it is shown.
        shown: f64,
        /// In SI.
        si: f64,
    },
    /// A text.
    Text(String),
    /// Yes or no.
    Bool(bool),
}

/// A point of a study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StudyPoint {
    /// Its name: its values, such as `angle=45deg,mu=0.1`.
    pub name: String,
    /// A value for each variable.
    pub values: Vec<StudyValue>,
    /// For each step of the file: the position of this point's in the workflow.
    pub steps: Vec<usize>,
}

/// What is read from every point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StudyResponse {
    /// Name.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Where it comes from.
    pub from: ResponseFrom,
}

/// Where the value of a response comes from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum ResponseFrom {
    /// A result of a step.
    Step {
        /// Position of the step among the steps of the file.
        step: usize,
        /// Name of the result.
        result: String,
        /// What is taken of several items.
        of: Option<ResponseOf>,
    },
    /// The values of the variables.
    Variables {
        /// As written.
        expression: String,
        /// For each point (SI).
        values: Vec<f64>,
    },
}

impl StudyResponse {
    /// Position of the step of the file that reports it, if one does.
    pub fn step(&self) -> Option<usize> {
        match self.from {
            ResponseFrom::Step { step, .. } => Some(step),
            ResponseFrom::Variables { .. } => None,
        }
    }

    /// As it stands in a study's table. `steps`: names of the steps of the file.
    pub fn told(&self, steps: &[String]) -> artifact::StudyResponse {
        let from = match &self.from {
            ResponseFrom::Step { step, result, of } => StudyOrigin::Step {
                step: steps[*step].clone(),
                result: result.clone(),
                of: *of,
            },
            ResponseFrom::Variables { expression, .. } => StudyOrigin::Variables {
                value: expression.clone(),
            },
        };
        artifact::StudyResponse {
            name: self.name.clone(),
            unit: self.unit.clone(),
            from,
        }
    }
}

/// A stated expectation over the points of a study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FamilyExpectation {
    /// Position of the response.
    pub response: usize,
    /// What is claimed.
    pub of: FamilyOf,
    /// Position of the variable along which is looked.
    pub over: Option<usize>,
    /// Where points mirror each other (SI), and as written.
    pub about: Option<(f64, String)>,
    /// Whether it grows.
    pub increasing: bool,
    /// Positions of the points that are meant.
    pub points: Vec<u32>,
    /// The condition that chooses them, as written.
    pub condition: Option<String>,
    /// Unit of the numbers below.
    pub unit: String,
    /// Expected value (SI), if stated.
    pub value: Option<f64>,
    /// Allowed absolute deviation (SI).
    pub tolerance: Option<f64>,
    /// Allowed deviation as a part of the largest size of the response.
    pub relative_tolerance: Option<f64>,
    /// Lower bound (SI).
    pub minimum: Option<f64>,
    /// Upper bound (SI).
    pub maximum: Option<f64>,
    /// Where the expectation comes from.
    pub source: Option<String>,
}

impl FamilyExpectation {
    /// What is claimed.
    #[must_use]
    pub fn claim(&self) -> plyflow_study::Claim {
        plyflow_study::Claim {
            of: self.of,
            increasing: self.increasing,
            about: self.about.as_ref().map_or(f64::NAN, |a| a.0),
        }
    }
}

/// A stated expectation on a result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Expectation {
    /// Step; the first of `mean_over` if there are any.
    pub step: String,
    /// Steps over which, and over the items of which, the mean is meant; empty: every result of `step`.
    pub mean_over: Vec<String>,
    /// Result name.
    pub result: String,
    /// Its unit, as its plugin declares it.
    pub unit: String,
    /// Expected value (SI), if stated.
    pub value: Option<f64>,
    /// Allowed absolute deviation from `value` (SI).
    pub tolerance: Option<f64>,
    /// Lower bound (SI).
    pub minimum: Option<f64>,
    /// Upper bound (SI).
    pub maximum: Option<f64>,
    /// Where the expectation comes from.
    pub source: Option<String>,
}

/// What happens to independent branches when a step fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FailurePolicy {
    /// Independent branches finish.
    KeepGoing,
    /// Running steps are stopped.
    FailFast,
}

/// A workflow ready to plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ResolvedWorkflow {
    /// Name.
    pub name: String,
    /// Its file, absolute.
    pub file: Utf8PathBuf,
    /// Free text.
    pub description: Option<String>,
    /// Steps in topological order (ties in the order of the file).
    pub steps: Vec<ResolvedStep>,
    /// Expectations.
    pub expectations: Vec<Expectation>,
    /// How large defects may be, if that is said. No key hangs on it.
    pub limits: Option<Limits>,
    /// Failure policy.
    pub on_failure: FailurePolicy,
    /// Its study, if it is one.
    pub study: Option<Study>,
    /// What `--confirm` has added to its steps.
    pub confirming: Option<Confirming>,
}

/// What `--confirm` has added to the steps of a workflow.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Confirming {
    /// Name of the step that follows the defects.
    pub step: String,
    /// The steps of the variants, in their order.
    pub steps: Vec<VariantStep>,
    /// Variants that are not run.
    pub left_out: Vec<LeftOut>,
}

/// A step of a variant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VariantStep {
    /// Its name.
    pub name: String,
    /// Name of the step that it is a variant of.
    pub of: String,
    /// In what it differs.
    pub variant: Variation,
    /// About how many times as much it costs (1).
    pub factor: f64,
}

/// A variant that is not run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LeftOut {
    /// Which.
    pub variant: Variation,
    /// Why, in words.
    pub why: String,
}
