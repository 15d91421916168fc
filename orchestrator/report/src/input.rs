//! What a report is made of.

use crate::family::Family;
use crate::judged::Judged;
use camino::Utf8PathBuf;
use plyflow_model::job::Record;
use plyflow_model::workflow::Limits;

/// A run as the engine knows it. Arrays are read from the artifacts when the report is written.
#[derive(Debug, Clone, PartialEq)]
pub struct ReportInput {
    /// Name of the workflow.
    pub workflow: String,
    /// Its free text.
    pub description: Option<String>,
    /// Its file, as the user gave it.
    pub file: Utf8PathBuf,
    /// The workflow file with the options that it was asked for with, as one types them behind a command.
    pub given: String,
    /// The steps behind which nothing was asked for (`--until`); empty for the whole workflow.
    pub until: Vec<String>,
    /// This program and its version.
    pub program: String,
    /// Names the content of the report: equal fingerprints, equal content. See
    /// [`is_current`](crate::is_current).
    pub fingerprint: String,
    /// What the store has, in the order of the workflow, items in their order.
    pub instances: Vec<Instance>,
    /// What is expected of results, each with what was found.
    pub expectations: Vec<Expectation>,
    /// How large defects may be, if the workflow says so.
    pub limits: Option<Limits>,
    /// How these limits fared ([`judge`](crate::judge())); empty without limits.
    pub judged: Vec<Judged>,
    /// What failed: label of the instance and reason.
    pub failures: Vec<(String, String)>,
    /// Number of instances that are known and did not run.
    pub not_run: usize,
    /// The points of a study; absent when the workflow is none, and on the page of one point.
    pub family: Option<Family>,
}

impl ReportInput {
    /// The part that is the same at every point of a study: what is of one point is left out.
    pub(crate) fn shared(&self, family: &Family) -> Self {
        let one = |i: &usize| self.instances[*i].clone();
        Self {
            instances: family.shared.iter().map(one).collect(),
            family: None,
            ..self.clone()
        }
    }

    /// A command on this workflow as one types it: `plyflow run workflow.yaml --set ..`.
    pub(crate) fn command(&self, name: &str) -> String {
        let mut command = format!("plyflow {name} {}", self.given);
        if name == "run" {
            for step in &self.until {
                command += &format!(" --until {step}");
            }
        }
        command
    }
}

/// One finished step instance.
#[derive(Debug, Clone, PartialEq)]
pub struct Instance {
    /// Step name.
    pub step: String,
    /// Labels of its item, outermost first; empty when the step is not fanned out.
    pub item: Vec<String>,
    /// Its artifact.
    pub artifact: Utf8PathBuf,
    /// Cost, results, warnings, kind and key.
    pub record: Record,
}

impl Instance {
    /// Name for people: `coarse`, `local[A]`.
    #[must_use]
    pub fn label(&self) -> String {
        label(&self.step, &self.item)
    }

    /// The name of its step in the file, without the point of a study.
    pub(crate) fn base(&self) -> &str {
        self.step.split_once('@').map_or(&self.step, |s| s.0)
    }
}

/// `step` or `step[a,b]`.
pub(crate) fn label(step: &str, item: &[String]) -> String {
    if item.is_empty() {
        step.to_owned()
    } else {
        format!("{step}[{}]", item.join(","))
    }
}

/// An expectation on a result with what was found. All numbers in SI.
#[derive(Debug, Clone, PartialEq)]
pub struct Expectation {
    /// Step.
    pub step: String,
    /// Labels of the item.
    pub item: Vec<String>,
    /// Name of the result.
    pub result: String,
    /// Unit of the result.
    pub unit: String,
    /// Value found; absent when the step did not report it.
    pub got: Option<f64>,
    /// Expected value.
    pub value: Option<f64>,
    /// Allowed deviation from it.
    pub tolerance: Option<f64>,
    /// Lower bound.
    pub minimum: Option<f64>,
    /// Upper bound.
    pub maximum: Option<f64>,
    /// Where the expectation comes from.
    pub source: Option<String>,
    /// Whether it is met; of no meaning when nothing was found.
    pub met: bool,
}

impl Expectation {
    /// How it fared.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        match (self.got, self.met) {
            (None, _) => Verdict::NotJudged,
            (_, true) => Verdict::Met,
            (_, false) => Verdict::Missed,
        }
    }
}

/// How an expectation fared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// What was found is as expected.
    Met,
    /// It is not.
    Missed,
    /// There is no value: its step has not run, or has not reported it.
    NotJudged,
}
