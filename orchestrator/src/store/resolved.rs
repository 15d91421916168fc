//! The resolved workflow of the last command, kept so that a study of ten thousand steps is not parsed
//! and checked each time. It is used only when the program, the file, the overrides, the search path and
//! all that the resolution read and asked are the same; in any doubt the workflow is resolved anew.
//! Findings are never kept: a workflow with one is read again each time.

use crate::plan::Key;
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_artifact::whole;
use plyflow_files::open::{self, MOST_NOTED};
use plyflow_workflow::resolved::{
    Dimension, Expectation, FailurePolicy, InputFile, Parameters, PluginId, ResolvedInput,
    ResolvedStep, ResolvedWorkflow, Resources, Study,
};
use plyflow_workflow::{Catalog, Evidence, Resolution};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Number, Value};
use std::borrow::Cow;
use std::os::unix::fs::MetadataExt;

/// Changes whenever the form of the file does.
const FORM: &[u8] = b"plyflow resolved workflow 5";

/// What a resolution depends on besides its [`Evidence`], as one hash.
pub type Circumstances = [u8; 32];

/// The circumstances of resolving `file` (absolute) with the overrides as given and the search path;
/// `None` when this program cannot be told from another one.
pub fn circumstances(
    program: &Utf8Path,
    file: &Utf8Path,
    overrides: &[String],
    search_path: &[Utf8PathBuf],
) -> Option<Circumstances> {
    let m = std::fs::metadata(program).ok()?;
    let mut hasher = blake3::Hasher::new();
    hasher.update(FORM);
    for number in [m.dev(), m.ino(), m.size()] {
        hasher.update(&number.to_le_bytes());
    }
    for number in [m.mtime(), m.mtime_nsec(), m.ctime(), m.ctime_nsec()] {
        hasher.update(&number.to_le_bytes());
    }
    let mut text = |t: &str| {
        hasher.update(&(t.len() as u64).to_le_bytes());
        hasher.update(t.as_bytes());
    };
    text(env!("CARGO_PKG_VERSION"));
    text(file.as_str());
    // The count keeps an override from passing as a folder.
    text(&overrides.len().to_string());
    overrides.iter().for_each(|t| text(t));
    search_path.iter().for_each(|f| text(f.as_str()));
    Some(*hasher.finalize().as_bytes())
}

/// Where the resolution of a workflow file (absolute) is kept.
fn place(root: &Utf8Path, file: &Utf8Path) -> Utf8PathBuf {
    let hash = blake3::hash(file.as_str().as_bytes()).to_hex();
    root.join("resolved").join(&hash[..16])
}

/// The kept resolution with the recipes of its steps, if there is one and everything it rests on is as it was.
pub fn read(
    root: &Utf8Path,
    file: &Utf8Path,
    circumstances: &Circumstances,
    catalog: &dyn Catalog,
) -> Option<(ResolvedWorkflow, Vec<Key>)> {
    let bytes = open::read(place(root, file).as_std_path(), MOST_NOTED).ok()?;
    let (known, rest) = bytes.split_first_chunk::<32>()?;
    let (sum, payload) = rest.split_first_chunk::<32>()?;
    if known != circumstances || blake3::hash(payload).as_bytes() != sum {
        return None;
    }
    let (evidence, packed) = postcard::take_from_bytes::<Evidence>(payload).ok()?;
    if !evidence.holds(catalog) {
        return None;
    }
    postcard::from_bytes::<Packed<'_>>(packed).ok()?.unpack()
}

/// Whether a file of kept resolutions is damaged, in words.
pub fn damage(path: &Utf8Path) -> Option<String> {
    let bytes = match open::read(path.as_std_path(), MOST_NOTED) {
        Ok(bytes) => bytes,
        Err(e) => return Some(e.to_string()),
    };
    let whole = bytes.get(32..64).is_some_and(|sum| {
        let payload = &bytes[64..];
        blake3::hash(payload).as_bytes() == sum
    });
    (!whole).then(|| "its bytes are not those that were written".to_owned())
}

/// Keeps a resolution in a store that is there. One that cannot be written only costs time.
pub fn write(
    root: &Utf8Path,
    file: &Utf8Path,
    circumstances: &Circumstances,
    (resolution, recipes): (&Resolution, &[Key]),
) {
    let place = place(root, file);
    if place.is_dir() {
        let _ = super::Store::new(root.to_owned()).set_aside(&place);
    }
    let bytes = encode(circumstances, resolution, recipes);
    if let Some(bytes) = bytes.filter(|_| root.is_dir()) {
        let _ = std::fs::create_dir_all(root.join("resolved"))
            .and_then(|()| whole::write(place.as_std_path(), &bytes));
    }
}

fn encode(
    circumstances: &Circumstances,
    resolution: &Resolution,
    recipes: &[Key],
) -> Option<Vec<u8>> {
    let mut payload = postcard::to_stdvec(&resolution.evidence).ok()?;
    payload.extend(postcard::to_stdvec(&Packed::of(&resolution.workflow, recipes)).ok()?);
    let mut bytes = circumstances.to_vec();
    bytes.extend_from_slice(blake3::hash(&payload).as_bytes());
    bytes.extend(payload);
    Some(bytes)
}

/// A [`ResolvedWorkflow`] in a form that needs no names of fields, with every library once.
#[derive(Serialize, Deserialize)]
struct Packed<'a> {
    name: String,
    file: Utf8PathBuf,
    description: Option<String>,
    libraries: Vec<PluginId>,
    #[serde(borrow)]
    steps: Vec<PackedStep<'a>>,
    expectations: Vec<Expectation>,
    /// As JSON: its form has optional keys, which this one cannot tell.
    limits: Option<String>,
    fail_fast: bool,
    study: Option<Study>,
}

#[derive(Serialize, Deserialize)]
struct PackedStep<'a> {
    name: String,
    recipe: Key,
    base: Option<String>,
    role: String,
    plugin: usize,
    components: Vec<usize>,
    /// A [`PackedValue`], left as it is until somebody asks for it.
    #[serde(borrow)]
    parameters: Cow<'a, [u8]>,
    files: Vec<InputFile>,
    inputs: Vec<ResolvedInput>,
    dimensions: Vec<Dimension>,
    output_kind: String,
    collection: bool,
    resources: Resources,
    retries: u32,
}

/// A JSON value with its numbers bit for bit: text could round them, and so move a key.
#[derive(Serialize, Deserialize)]
enum PackedValue {
    Null,
    Bool(bool),
    Whole(u64),
    Negative(i64),
    Decimal(f64),
    Text(String),
    List(Vec<PackedValue>),
    Map(Vec<(String, PackedValue)>),
}

impl PackedValue {
    fn bytes(value: &Value) -> Vec<u8> {
        // Serialising into memory cannot fail: every type here has a known length.
        postcard::to_stdvec(&Self::of(value)).unwrap_or_default()
    }

    fn read(bytes: &[u8]) -> Option<Value> {
        postcard::from_bytes::<Self>(bytes).ok()?.unpack()
    }

    fn of(value: &Value) -> Self {
        match value {
            Value::Null => Self::Null,
            Value::Bool(b) => Self::Bool(*b),
            Value::Number(n) => match (n.as_u64(), n.as_i64()) {
                (Some(n), _) => Self::Whole(n),
                (None, Some(n)) => Self::Negative(n),
                (None, None) => n.as_f64().map_or(Self::Null, Self::Decimal),
            },
            Value::String(text) => Self::Text(text.clone()),
            Value::Array(items) => Self::List(items.iter().map(Self::of).collect()),
            Value::Object(map) => {
                Self::Map(map.iter().map(|(k, v)| (k.clone(), Self::of(v))).collect())
            }
        }
    }

    fn unpack(self) -> Option<Value> {
        Some(match self {
            Self::Null => Value::Null,
            Self::Bool(b) => Value::Bool(b),
            Self::Whole(n) => Value::Number(n.into()),
            Self::Negative(n) => Value::Number(n.into()),
            Self::Decimal(n) => Value::Number(Number::from_f64(n)?),
            Self::Text(text) => Value::String(text),
            Self::List(items) => {
                Value::Array(items.into_iter().map(Self::unpack).collect::<Option<_>>()?)
            }
            Self::Map(entries) => Value::Object(
                entries
                    .into_iter()
                    .map(|(k, v)| Some((k, v.unpack()?)))
                    .collect::<Option<Map<_, _>>>()?,
            ),
        })
    }
}

impl Packed<'_> {
    fn of(workflow: &ResolvedWorkflow, recipes: &[Key]) -> Self {
        let mut libraries: Vec<PluginId> = Vec::new();
        let mut number = |id: &PluginId| {
            libraries.iter().position(|l| l == id).unwrap_or_else(|| {
                libraries.push(id.clone());
                libraries.len() - 1
            })
        };
        let steps = workflow
            .steps
            .iter()
            .zip(recipes)
            .map(|(s, recipe)| PackedStep {
                name: s.name.clone(),
                recipe: *recipe,
                base: s.base.clone(),
                role: s.role.clone(),
                plugin: number(&s.plugin),
                components: s.components.iter().map(&mut number).collect(),
                parameters: Cow::Owned(PackedValue::bytes(&s.parameters)),
                files: s.files.clone(),
                inputs: s.inputs.clone(),
                dimensions: s.dimensions.clone(),
                output_kind: s.output_kind.clone(),
                collection: s.collection,
                resources: s.resources,
                retries: s.retries,
            })
            .collect();
        Self {
            name: workflow.name.clone(),
            file: workflow.file.clone(),
            description: workflow.description.clone(),
            libraries,
            steps,
            expectations: workflow.expectations.clone(),
            // Numbers and texts: it can be written.
            limits: (workflow.limits.as_ref()).and_then(|l| serde_json::to_string(l).ok()),
            fail_fast: workflow.on_failure == FailurePolicy::FailFast,
            study: workflow.study.clone(),
        }
    }

    fn unpack(self) -> Option<(ResolvedWorkflow, Vec<Key>)> {
        let library = |i: usize| self.libraries.get(i).cloned();
        let step = |s: PackedStep<'_>| {
            Some(ResolvedStep {
                name: s.name,
                base: s.base,
                role: s.role,
                plugin: library(s.plugin)?,
                components: s
                    .components
                    .into_iter()
                    .map(library)
                    .collect::<Option<_>>()?,
                parameters: Parameters::packed(s.parameters.into_owned(), |bytes| {
                    PackedValue::read(bytes)
                        .expect("what this program has packed, as its hash tells")
                }),
                files: s.files,
                inputs: s.inputs,
                dimensions: s.dimensions,
                output_kind: s.output_kind,
                collection: s.collection,
                resources: s.resources,
                retries: s.retries,
            })
        };
        let limits = self.limits.map(|l| serde_json::from_str(&l));
        let recipes = self.steps.iter().map(|s| s.recipe).collect();
        let workflow = ResolvedWorkflow {
            name: self.name,
            file: self.file,
            description: self.description,
            steps: self.steps.into_iter().map(step).collect::<Option<_>>()?,
            expectations: self.expectations,
            limits: limits.transpose().ok()?,
            on_failure: if self.fail_fast {
                FailurePolicy::FailFast
            } else {
                FailurePolicy::KeepGoing
            },
            study: self.study,
            confirming: None,
        };
        Some((workflow, recipes))
    }
}

#[cfg(test)]
#[path = "resolved_tests.rs"]
mod tests;
