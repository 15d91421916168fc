//! A workflow file: steps, what they receive, what is expected of their results.

use crate::units::Time;
use indexmap::IndexMap;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

mod limits;
mod optimise;
mod stated;
mod study;

pub use limits::{LimitOn, LimitPlace, LimitValues, Limits};
pub use optimise::{Optimise, OptimiseMethod};
pub use stated::{OnFailure, ResultValue, Stated};
pub use study::{
    Direction, ExpectResponse, FamilyOf, PointSet, PointsOf, Response, ResponseOf, Sample,
    SampleMethod, Scalar, Scale, Span, Study, Values,
};

/// Version of the workflow format that this crate reads.
pub const VERSION: u32 = 1;

/// A workflow file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Workflow {
    /// Version of the workflow format: 1.
    #[schemars(extend("const" = 1))]
    pub plyflow: u32,
    /// Name, used in reports.
    pub name: String,
    /// Free text.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub description: Option<String>,
    /// What happens to independent branches when a step fails.
    #[serde(default)]
    pub on_failure: OnFailure,
    /// Further folders to search for plugins, relative to this file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub plugins: Vec<String>,
    /// Runs the steps at many points: each value of these variables where `${name}` stands in a step.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub study: Option<Study>,
    /// Looks for the values of variables with which a response is smallest or largest; in place of `study`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub optimise: Option<Optimise>,
    /// The steps by name, in any order.
    pub steps: IndexMap<String, Step>,
    /// What is read from every point of the study or optimisation, by name: the columns of its table.
    #[serde(default, skip_serializing_if = "IndexMap::is_empty")]
    pub responses: IndexMap<String, Response>,
    /// What is expected of results: a list, or the path of a JSON file with one, relative to this file.
    #[serde(default, skip_serializing_if = "Expectations::is_empty")]
    #[schemars(extend("x-expected" = "a list of expectations, or the path of a JSON file with them"))]
    pub expect: Expectations,
    /// How large defects may be for the part to be good; left out: nothing is judged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limits: Option<Limits>,
}

/// One step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Step {
    /// Step plugin: its name on the search path, or the path of a library.
    pub plugin: String,
    /// Parameters of the plugin, checked against its manifest.
    #[serde(default)]
    pub with: serde_json::Map<String, serde_json::Value>,
    /// Where the inputs come from: port -> step. One step name alone is enough when the plugin has
    /// exactly one required port.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<From>,
    /// Runs the step once per item: a free name -> the step whose collection is fanned over. Several
    /// entries make the product.
    #[serde(default, skip_serializing_if = "IndexMap::is_empty")]
    pub for_each: IndexMap<String, String>,
    /// What the step may use.
    #[serde(default)]
    pub resources: Resources,
    /// How often a failed step is tried again.
    #[serde(default)]
    #[schemars(extend("maximum" = 100))]
    pub retries: u32,
}

/// Wires of a step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum From {
    /// A step for the only port.
    One(String),
    /// Port -> step or steps.
    Ports(IndexMap<String, Sources>),
}

/// One step or several.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Sources {
    /// One step.
    One(String),
    /// Several, where many are taken.
    Many(Vec<String>),
}

/// What a step may use.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Resources {
    /// Cores; a share of what is free when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 1, "maximum" = 4096))]
    pub cores: Option<u32>,
    /// Memory, such as `4 GiB`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory: Option<Memory>,
    /// Wall-clock limit, such as `30 min`; none when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-exclusive-minimum" = "0 s"))]
    pub time_limit: Option<Time>,
}

/// An entry of `expect`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Expectable {
    /// On a result of steps.
    Result(Expect),
    /// On a response of a study.
    Response(ExpectResponse),
}

/// A stated expectation on a result: a value (with a tolerance), a bound, or both.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Expect {
    /// Step, or several.
    #[schemars(extend("x-expected" = "the name of a step, or a list of names"))]
    pub step: Sources,
    /// Name of the result.
    pub result: String,
    /// What is held against the value and the bounds.
    #[serde(default, skip_serializing_if = "Of::is_each")]
    pub of: Of,
    /// What is expected of it.
    #[serde(flatten)]
    pub stated: Stated,
}

/// What of several results is held against an expectation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Of {
    /// Each of them, of every step and every item.
    #[default]
    Each,
    /// Their mean over the steps and their items: for what depends on chance, such as a random imperfection.
    Mean,
}

impl Of {
    /// Whether each result is meant.
    pub fn is_each(&self) -> bool {
        *self == Self::Each
    }
}

/// Where expectations stand.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Expectations {
    /// In the workflow.
    List(Vec<Expectable>),
    /// In a JSON file of their own (see [`Expected`]), relative to the workflow.
    File(String),
}

impl Default for Expectations {
    fn default() -> Self {
        Self::List(Vec::new())
    }
}

impl Expectations {
    /// Whether nothing is expected.
    pub fn is_empty(&self) -> bool {
        matches!(self, Self::List(list) if list.is_empty())
    }
}

/// Version of the format of a file of expectations that this crate reads.
pub const EXPECTED_VERSION: u32 = 1;

/// A file of expectations, which `expect` of a workflow names. JSON, so that other programs read and write it too.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Expected {
    /// Version of the format: 1.
    #[schemars(extend("const" = 1))]
    pub plyflow_expected: u32,
    /// Where the expectations come from; those with a `source` of their own keep theirs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    /// The expectations.
    pub expectations: Vec<Expectable>,
}

/// An amount of memory in bytes, written `4 GiB` or `500 MB`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub struct Memory(
    /// Bytes.
    pub u64,
);

impl Memory {
    const UNITS: [(&str, u64); 9] = [
        ("B", 1),
        ("kB", 1_000),
        ("MB", 1_000_000),
        ("GB", 1_000_000_000),
        ("TB", 1_000_000_000_000),
        ("KiB", 1 << 10),
        ("MiB", 1 << 20),
        ("GiB", 1 << 30),
        ("TiB", 1 << 40),
    ];
}

/// A text that is no amount of memory.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{text}` is no amount of memory; expected one such as `4 GiB` or `500 MB`{}",
    .nearest.map_or(String::new(), |n| format!(" (did you mean `{n}`?)"))
)]
pub struct MemoryError {
    /// As given.
    pub text: String,
    /// The unit that was probably meant.
    pub nearest: Option<&'static str>,
}

impl std::str::FromStr for Memory {
    type Err = MemoryError;

    fn from_str(text: &str) -> Result<Self, MemoryError> {
        let text = text.trim();
        let split = text
            .find(|c: char| !(c.is_ascii_digit() || c == '.'))
            .unwrap_or(text.len());
        let (number, unit) = text.split_at(split);
        let wrong = |nearest| MemoryError {
            text: text.to_owned(),
            nearest,
        };
        let number: f64 = number.parse().map_err(|_| wrong(None))?;
        let unit = unit.trim();
        let Some((_, factor)) = Memory::UNITS.iter().find(|(name, _)| *name == unit) else {
            let names = Memory::UNITS.iter().map(|(name, _)| *name);
            return Err(wrong(crate::nearest::nearest(unit, names)));
        };
        let bytes = number * *factor as f64;
        // Above 2^53 bytes the product is no longer exact, and no machine has that much.
        if bytes > 0.0 && bytes < 9e15 {
            Ok(Memory(bytes.round() as u64))
        } else {
            Err(wrong(None))
        }
    }
}

impl Serialize for Memory {
    fn serialize<S: serde::Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        s.collect_str(&format_args!("{} B", self.0))
    }
}

impl<'de> Deserialize<'de> for Memory {
    fn deserialize<D: serde::Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        String::deserialize(d)?
            .parse()
            .map_err(serde::de::Error::custom)
    }
}

impl JsonSchema for Memory {
    fn schema_name() -> Cow<'static, str> {
        "Memory".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "string",
            "pattern": r"^\s*[0-9]+\.?[0-9]*\s*([kMGT]|[KMGT]i)?B\s*$",
            "description": "An amount of memory, such as `4 GiB` or `500 MB`.",
            "examples": ["4 GiB", "500 MB"],
            "x-format": "memory",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_read_in_binary_and_decimal_units() {
        assert_eq!("4 GiB".parse(), Ok(Memory(4 << 30)));
        assert_eq!("1.5 kB".parse(), Ok(Memory(1500)));
        for wrong in ["4", "4 gb", "GiB", "-1 GB", "0 B", "4 GiBs", ""] {
            assert!(wrong.parse::<Memory>().is_err(), "{wrong}");
        }
        assert!(
            "4 gib"
                .parse::<Memory>()
                .unwrap_err()
                .to_string()
                .contains("`GiB`")
        );
    }

    #[test]
    fn expectations_are_a_list_or_the_path_of_a_file() {
        let read = |expect: serde_json::Value| {
            let w = serde_json::json!({"plyflow": 1, "name": "w", "steps": {}, "expect": expect});
            serde_json::from_value::<Workflow>(w).unwrap().expect
        };
        let file = Expectations::File("expected.json".into());
        assert_eq!(read(serde_json::json!("expected.json")), file);
        assert!(!file.is_empty() && read(serde_json::json!([])).is_empty());
        let expected: Expected = serde_json::from_value(serde_json::json!({
            "plyflow_expected": 1, "source": "thesis 3.4",
            "expectations": [{"step": "a", "result": "r", "maximum": 1}]
        }))
        .unwrap();
        let Expectable::Result(first) = &expected.expectations[0] else {
            panic!("an expectation on a result");
        };
        assert_eq!(first.stated.maximum, Some(ResultValue::Number(1.0)));
    }

    #[test]
    fn parts_that_formats_share_are_read_and_a_slip_in_them_is_refused() {
        let study = |more: serde_json::Value| {
            let mut study =
                serde_json::json!({"vary": {"a": [1, 2]}, "where": "a > 1", "at_most_failures": 3});
            study
                .as_object_mut()
                .unwrap()
                .extend(more.as_object().unwrap().clone());
            serde_json::from_value::<Study>(study)
        };
        let read = study(serde_json::json!({})).unwrap();
        assert_eq!(
            (read.at_most_failures, read.set.condition.as_deref()),
            (Some(3), Some("a > 1"))
        );
        assert!(read.set.vary.is_some());
        assert!(study(serde_json::json!({"varry": {}})).is_err());
        let expect = serde_json::json!({"response": "r", "of": "max", "maximum": 1, "unit": "m"});
        assert!(serde_json::from_value::<Expectable>(expect).is_err());
    }

    #[test]
    fn the_manual_s_steps_are_read() {
        let w: Workflow = serde_json::from_value(serde_json::json!({
            "plyflow": 1, "name": "w", "on_failure": "fail-fast",
            "steps": {
                "a": {"plugin": "x", "with": {"n": 1}, "resources": {"cores": 2, "memory": "4 GiB", "time_limit": "30 min"}},
                "b": {"plugin": "y", "from": "a"},
                "c": {"plugin": "z", "from": {"p": "a", "q": ["a", "b"]}, "for_each": {"zone": "b"}}
            },
            "expect": [{"step": "c", "result": "r", "value": "68 mm", "tolerance": "7 mm"}]
        }))
        .unwrap();
        assert_eq!(w.steps["a"].resources.time_limit, Some(Time(1800.0)));
        assert_eq!(w.steps["b"].from, Some(From::One("a".into())));
        assert_eq!(w.steps.keys().collect::<Vec<_>>(), ["a", "b", "c"]);
    }
}
