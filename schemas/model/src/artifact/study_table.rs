//! The kind `study-table`: what became of the points of a study. No step writes it, but `plyflow run`.

use crate::artifact::attributes::Attributes;
use crate::workflow::ResponseOf;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Attributes of the kind `study-table`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StudyTable {
    /// Name of the workflow.
    pub workflow: String,
    /// Names of the points, in the order of the rows.
    pub points: Vec<String>,
    /// What varies.
    pub variables: Vec<StudyVariable>,
    /// What is read from every point.
    pub responses: Vec<StudyResponse>,
    /// The words for the numbers of the array `status`: `done`, `failed`, `not run`.
    pub status: Vec<String>,
    /// Why points have failed.
    pub failures: Vec<StudyFailure>,
    /// For each step that a response is of: its artifacts.
    pub keys: Vec<StudyKeys>,
    /// Where values were drawn.
    pub samples: Vec<StudySamples>,
    /// How far an optimisation has come; `null` for a study.
    pub optimisation: Option<StudyOptimisation>,
}

impl StudyTable {
    /// The words for the numbers of the array `status`, in their order.
    pub const STATUS: [&'static str; 3] = ["done", "failed", "not run"];
}

impl Attributes for StudyTable {
    const KIND: &'static str = "study-table";
}

/// A variable of a study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StudyVariable {
    /// Its name; that of the array `variables/NAME` too, where all values are numbers.
    pub name: String,
    /// Unit in which its values are shown; empty for plain numbers, texts, and yes or no.
    pub unit: String,
    /// The SI unit of the same.
    pub si_unit: String,
    /// One for each point, numbers in `unit`.
    pub values: Vec<StudyValue>,
}

/// A value of a variable.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected a number, a text, true or false")]
pub enum StudyValue {
    /// Yes or no.
    Bool(bool),
    /// A number in the unit of its variable.
    Number(f64),
    /// A text.
    Text(String),
}

/// What is read from every point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StudyResponse {
    /// Its name; that of the arrays `responses/NAME/value` and `responses/NAME/point` too.
    pub name: String,
    /// The SI unit of its values.
    pub unit: String,
    /// Where it comes from.
    #[serde(flatten)]
    pub from: StudyOrigin,
}

/// Where the values of a response come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum StudyOrigin {
    /// A result of a step.
    Step {
        /// Name of the step, as in the workflow's file.
        step: String,
        /// Name of the result.
        result: String,
        /// What is taken of several items; `null` where there is one.
        of: Option<ResponseOf>,
    },
    /// The values of the variables.
    Variables {
        /// The expression, as written.
        value: String,
    },
}

/// Why a point has failed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct StudyFailure {
    /// Its row.
    pub point: usize,
    /// The step that failed.
    pub step: String,
    /// The class of the failure.
    pub class: String,
    /// Why, in one line.
    pub cause: String,
}

/// The artifacts of a step at all points.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct StudyKeys {
    /// Name of the step, as in the workflow's file.
    pub step: String,
    /// For each point the key of its artifact; of several items with blanks between them, empty where there is none.
    pub keys: Vec<String>,
}

/// Where values of variables were drawn.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct StudySamples {
    /// How, as written.
    pub method: String,
    /// How many points.
    pub count: u32,
    /// Of its random numbers.
    pub seed: u32,
}

/// How far an optimisation has come. Points are told to its method in the order of the rows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StudyOptimisation {
    /// Name of the response that is to be small or large.
    pub objective: String,
    /// Its unit.
    pub unit: String,
    /// Whether it is to be large.
    pub maximise: bool,
    /// What must hold, as written.
    pub subject_to: Vec<String>,
    /// The method, as written.
    pub method: String,
    /// Chooses its random numbers.
    pub seed: u32,
    /// How many points have been told to the method.
    pub told: usize,
    /// Whether its budget is used up, or its method has nothing more to ask.
    pub ended: bool,
    /// Whether its method has nothing more to ask.
    pub settled: bool,
    /// For each point that was told whether it meets what must hold; `null` of one that has failed.
    pub feasible: Vec<Option<bool>>,
    /// For each point that was told the best value up to it (in `unit`) that meets what must hold, or `null`.
    pub best_so_far: Vec<Option<f64>>,
    /// The best point, or `null` where none meets what must hold.
    pub best: Option<StudyBest>,
}

/// The best point of an optimisation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StudyBest {
    /// Its name.
    pub point: String,
    /// Its value (in the unit of the response).
    pub value: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_response_is_of_a_step_or_of_the_variables() {
        let of_step =
            json!({"name": "r", "unit": "m", "step": "one", "result": "value", "of": null});
        let computed = json!({"name": "s", "unit": "1", "value": "a + b"});
        for written in [of_step, computed] {
            let read: StudyResponse = serde_json::from_value(written.clone()).unwrap();
            assert_eq!(serde_json::to_value(&read).unwrap(), written);
        }
        let of = |of: ResponseOf| StudyOrigin::Step {
            step: "one".into(),
            result: "value".into(),
            of: Some(of),
        };
        let told = serde_json::to_value(of(ResponseOf::Max)).unwrap();
        assert_eq!(told["of"], "max");
    }

    #[test]
    fn values_are_numbers_texts_yes_or_no() {
        let written = json!([1.5, "a", true]);
        let read: Vec<StudyValue> = serde_json::from_value(written.clone()).unwrap();
        let expected = [
            StudyValue::Number(1.5),
            StudyValue::Text("a".into()),
            StudyValue::Bool(true),
        ];
        assert_eq!(read, expected);
        assert_eq!(serde_json::to_value(&read).unwrap(), written);
    }
}
