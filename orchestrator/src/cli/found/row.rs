//! A number of what was run, and what is expected of it.

use plyflow_workflow::resolved::Expectation;

/// Where the expectations over a study stand in lists of results.
pub const STEP: &str = "study";

/// A verdict on what is expected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// It is met.
    Ok,
    /// It is not.
    Missed,
    /// There is no value to judge.
    NotJudged,
}

impl Verdict {
    /// In words.
    pub fn word(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Missed => "missed",
            Self::NotJudged => "not judged",
        }
    }
}

/// One number, or one expectation without a number.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Step.
    pub step: String,
    /// Labels of its item.
    pub item: Vec<String>,
    /// Name of the number.
    pub name: String,
    /// Value (SI); absent when the step did not report it.
    pub value: Option<f64>,
    /// Unit.
    pub unit: String,
    /// Whether it depends on the machine.
    pub measured: bool,
    /// What is expected of it.
    pub expected: Option<Expectation>,
}

impl Row {
    /// What it is about, in a list.
    pub fn title(&self) -> String {
        let e = self.expected.as_ref();
        if self.step == STEP {
            return self.name.clone();
        }
        if e.is_some_and(|e| !e.mean_over.is_empty()) {
            format!("{} ({})", self.name, self.step)
        } else {
            let item = match self.item.is_empty() {
                true => String::new(),
                false => format!("[{}]", self.item.join(",")),
            };
            format!("{}{item}.{}", self.step, self.name)
        }
    }

    /// Whether it is as expected; only when something is expected.
    pub fn verdict(&self) -> Option<Verdict> {
        let e = self.expected.as_ref()?;
        let Some(value) = self.value else {
            return Some(Verdict::NotJudged);
        };
        let near = e.value.is_none_or(|x| {
            // Without a tolerance the same number is meant, up to rounding in its text.
            (value - x).abs() <= e.tolerance.unwrap_or(1e-9 * x.abs())
        });
        let inside = e.minimum.is_none_or(|m| value >= m) && e.maximum.is_none_or(|m| value <= m);
        Some(if near && inside {
            Verdict::Ok
        } else {
            Verdict::Missed
        })
    }
}
