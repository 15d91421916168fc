//! The manifest of a plugin, as described in `schemas/manifest.md`.

use crate::units::{Dimension, parse_unit};
use indexmap::IndexMap;
use serde::{Deserialize, Serialize};
use serde_json::Value;

mod fits;
mod items;
mod raw;
pub mod schema;
mod unique;

pub use items::{Items, Order, Unfit};

/// What a plugin says about itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Name, by which workflows find it.
    pub name: String,
    /// Version of the plugin.
    pub version: String,
    /// Who makes it.
    #[serde(default)]
    pub vendor: String,
    /// Step or which component.
    pub kind: PluginKind,
    /// Steps: what it does; plugins of one role fit in the same place. Components: equals `kind`.
    pub role: String,
    /// One sentence.
    pub summary: String,
    /// Name -> declaration, in the order of the manifest.
    #[serde(default, deserialize_with = "unique::keys")]
    pub parameters: IndexMap<String, Declaration>,
    /// Steps: port -> what it takes, in the order of the manifest.
    #[serde(default, deserialize_with = "unique::keys")]
    pub inputs: IndexMap<String, InputPort>,
    /// Steps: what it writes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub output: Option<Output>,
    /// The named numbers it may report.
    #[serde(default, deserialize_with = "unique::keys")]
    pub results: IndexMap<String, ResultDeclaration>,
    /// Elements: fields in the order of the field rows.
    #[serde(default)]
    pub fields: Vec<Field>,
}

/// Kinds of plugin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PluginKind {
    /// Reads artifacts, writes one.
    Step,
    /// Component: an element formulation.
    Element,
    /// Component: a material.
    Material,
}

impl PluginKind {
    /// Name in manifests.
    pub const fn name(self) -> &'static str {
        match self {
            PluginKind::Step => "step",
            PluginKind::Element => "element",
            PluginKind::Material => "material",
        }
    }
}

impl std::fmt::Display for PluginKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// A port of a step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InputPort {
    /// Artifact kind it takes; `any` takes all.
    pub kind: String,
    /// Whether it must be wired.
    #[serde(default = "yes")]
    pub required: bool,
    /// Whether several artifacts may arrive.
    #[serde(default)]
    pub many: bool,
    /// What it is for.
    #[serde(default)]
    pub doc: String,
}

fn yes() -> bool {
    true
}

impl InputPort {
    /// Whether an artifact of this kind may arrive.
    pub fn accepts(&self, kind: &str) -> bool {
        self.kind == "any" || self.kind == kind
    }
}

/// What a step writes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Output {
    /// Artifact kind.
    pub kind: String,
    /// Whether later steps may fan out over its items.
    #[serde(default)]
    pub collection: bool,
    /// What it holds.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub doc: String,
}

/// A named number that a step may report. A name that a plugin forms when it runs is declared by its part
/// before the first dot: `wrinkle_length` covers `wrinkle_length.AW1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResultDeclaration {
    /// SI unit; `1` or empty when dimensionless.
    #[serde(default)]
    pub unit: String,
    /// What it is.
    #[serde(default)]
    pub doc: String,
    /// Whether it depends on the machine (seconds, bytes), so that it is kept beside the artifact.
    #[serde(default, skip_serializing_if = "is_false")]
    pub measured: bool,
    /// Whether the name that a result of it has goes on with that of a step which is wired to the one that reports it
    /// (`quartile_error.mesh_5`).
    #[serde(default, skip_serializing_if = "is_false")]
    pub by_step: bool,
}

/// A field that an element writes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Field {
    /// Name in artifacts.
    pub name: String,
    /// SI unit; `1` when dimensionless.
    pub unit: String,
    /// What it is.
    #[serde(default)]
    pub doc: String,
    /// Whether it belongs to the patch part (points) and not to the element part (cells).
    #[serde(default, skip_serializing_if = "is_false")]
    pub patch: bool,
}

/// Whether artifacts may hold something of this name: the rule by which `plyflow-artifact`, which knows nothing of manifests, refuses others.
fn is_name(name: &str) -> bool {
    let letter = |c: char| c.is_ascii_alphabetic() || c == '_';
    name.starts_with(letter)
        && (name.chars()).all(|c| c.is_ascii_alphanumeric() || "_-.".contains(c))
}

fn is_false(b: &bool) -> bool {
    !b
}

/// A bound of a number: SI value and the text of the manifest, for messages.
#[derive(Debug, Clone, PartialEq)]
pub struct Bound {
    /// SI value.
    pub value: f64,
    /// As written in the manifest.
    pub text: String,
}

/// Bounds of a number, an integer or a quantity.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Bounds {
    /// Smallest value.
    pub minimum: Option<Bound>,
    /// Largest value.
    pub maximum: Option<Bound>,
    /// Value it must exceed.
    pub exclusive_minimum: Option<Bound>,
}

impl Bounds {
    /// What is expected, when `value` (SI) is out of bounds: `at least 0 deg`.
    pub fn broken_by(&self, value: f64) -> Option<String> {
        let says = |b: &Option<Bound>, breaks: fn(f64, f64) -> bool, words: &str| {
            b.as_ref()
                .filter(|b| breaks(value, b.value))
                .map(|b| format!("{words} {}", b.text))
        };
        says(&self.exclusive_minimum, |v, b| v <= b, "more than")
            .or_else(|| says(&self.minimum, |v, b| v < b, "at least"))
            .or_else(|| says(&self.maximum, |v, b| v > b, "at most"))
    }
}

/// A parameter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "raw::RawDeclaration", into = "raw::RawDeclaration")]
pub struct Declaration {
    /// What it is.
    pub doc: String,
    /// Whether it must be given.
    pub required: bool,
    /// Value when it is not given, written as in YAML.
    pub default: Option<Value>,
    /// What it takes.
    pub shape: Shape,
}

/// What a parameter takes.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// `true` or `false`.
    Boolean,
    /// A whole number.
    Integer(Bounds),
    /// A dimensionless number.
    Number(Bounds),
    /// Text.
    String,
    /// One of these.
    Choice(Vec<String>),
    /// Text with a unit.
    Quantity(Dimension, Bounds),
    /// A sequence.
    List(Box<Declaration>, Items),
    /// A mapping of free names.
    Map(Box<Declaration>),
    /// A mapping of these names.
    Object(IndexMap<String, Declaration>),
    /// A scene file or the scene itself.
    Scene {
        /// Whether the step cannot do with plies whose fibres are steered: such a scene is refused when it is planned.
        straight_fibres: bool,
    },
    /// A material of a sheet: a material file, the material itself, or a file with other parameters.
    SheetMaterial,
    /// A path.
    File,
    /// An element or a material: name, path of a library, or `{plugin: .., with: {..}}`.
    Component(PluginKind),
}

impl Shape {
    /// Whether its values are single numbers.
    pub fn is_number(&self) -> bool {
        matches!(
            self,
            Shape::Integer(_) | Shape::Number(_) | Shape::Quantity(..)
        )
    }

    /// What to write, for messages: "a length such as `5 mm`".
    pub fn expected(&self) -> String {
        match self {
            Shape::Boolean => "`true` or `false`".into(),
            Shape::Integer(_) => "a whole number".into(),
            Shape::Number(_) => "a plain number such as `0.3`".into(),
            Shape::String => "text".into(),
            Shape::Choice(values) => one_of(values.iter().map(String::as_str)),
            Shape::Quantity(d, _) => format!("{} such as `{}`", d.with_article(), d.example()),
            Shape::List(of, _) => format!("a list, each item {}", of.shape.expected()),
            Shape::Map(of) => format!("a mapping of names, each {}", of.shape.expected()),
            Shape::Object(fields) => {
                let names: Vec<&str> = fields.keys().map(String::as_str).collect();
                format!("a mapping with {}", names.join(", "))
            }
            Shape::Scene { .. } => "the path of a scene file, or a scene".into(),
            Shape::SheetMaterial => {
                "the path of a material file, a material, or `{file: .., with: {..}}`".into()
            }
            Shape::File => "the path of a file".into(),
            Shape::Component(kind) => format!(
                "the name of an {kind} plugin, the path of its library, or `{{plugin: .., with: {{..}}}}`"
            )
            .replace("an material", "a material"),
        }
    }
}

/// "one of `a`, `b`".
pub fn one_of<'a>(values: impl Iterator<Item = &'a str>) -> String {
    let quoted: Vec<String> = values.map(|v| format!("`{v}`")).collect();
    if quoted.len() == 1 {
        quoted[0].clone()
    } else {
        format!("one of {}", quoted.join(", "))
    }
}

/// Why a manifest is not one.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ManifestError {
    /// No JSON, an unknown key, a wrong type.
    #[error("the manifest does not follow schemas/manifest.md: {0}")]
    Form(String),
    /// Well formed, but against a rule.
    #[error("the manifest of `{name}` is wrong: {rule}")]
    Rule {
        /// Plugin.
        name: String,
        /// What is wrong.
        rule: String,
    },
}

impl Manifest {
    /// Reads and checks a manifest.
    ///
    /// # Errors
    /// When the text is no JSON, has unknown keys, or breaks a rule (a step without output, a component
    /// with ports, a unit that is not known).
    pub fn parse(json: &str) -> Result<Self, ManifestError> {
        let manifest: Self =
            serde_json::from_str(json).map_err(|e| ManifestError::Form(e.to_string()))?;
        match manifest.broken_rule() {
            Some(rule) => Err(ManifestError::Rule {
                name: manifest.name,
                rule,
            }),
            None => Ok(manifest),
        }
    }

    fn broken_rule(&self) -> Option<String> {
        let is_step = self.kind == PluginKind::Step;
        if self.name.is_empty() || self.name.contains(['/', '\\', ' ']) {
            return Some("`name` must be a word without spaces and slashes".into());
        }
        if self.name.ends_with(".so") {
            return Some("`name` must not end with `.so`: workflows take that for a path".into());
        }
        let kinds = self.output.iter().map(|o| ("`output.kind`", &o.kind));
        let ports = self.inputs.keys().map(|port| ("a port of `inputs`", port));
        let fields = self.fields.iter().map(|f| ("a name of `fields`", &f.name));
        for (what, name) in kinds.chain(ports).chain(fields) {
            if !is_name(name) {
                return Some(format!(
                    "{what} is `{name}`; expected a letter or `_`, then letters, digits, `_`, `-` and `.`"
                ));
            }
        }
        for (k, field) in self.fields.iter().enumerate() {
            if self.fields[..k].iter().any(|f| f.name == field.name) {
                return Some(format!("`fields` names `{}` twice", field.name));
            }
        }
        if is_step && self.output.is_none() {
            return Some("a step needs `output`".into());
        }
        if !is_step && (self.output.is_some() || !self.inputs.is_empty()) {
            return Some("a component has neither `inputs` nor `output`".into());
        }
        if !is_step && self.role != self.kind.name() {
            return Some(format!(
                "`role` of a component equals its kind, `{}`",
                self.kind
            ));
        }
        let units = self.results.iter().map(|(n, r)| (n, &r.unit));
        let units = units.chain(self.fields.iter().map(|f| (&f.name, &f.unit)));
        for (name, unit) in units {
            if let Err(e) = parse_unit(unit) {
                return Some(format!("unit of `{name}`: {e}"));
            }
        }
        None
    }

    /// The declaration of a result, by its name or the part before the first dot.
    pub fn result(&self, name: &str) -> Option<&ResultDeclaration> {
        let stem = name.split_once('.').map_or(name, |(stem, _)| stem);
        self.results.get(name).or_else(|| self.results.get(stem))
    }
}

#[cfg(test)]
mod tests;
