//! A study as its page shows it: what was varied, and what came out at every point.

use crate::units::{join, plural, shown};
use plyflow_model::units::si_number;

/// Studies with more points show what is of one point on that point's own page alone.
const SMALL: usize = 6;

/// The points of a study with what came out.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Family {
    /// What was varied.
    pub variables: Vec<Variable>,
    /// What is read from every point.
    pub responses: Vec<Response>,
    /// The points, in the order of the study.
    pub points: Vec<Point>,
    /// Samples among the points.
    pub samples: Vec<Sampled>,
    /// Name of the file that has the table whole.
    pub table: String,
    /// Positions among [`ReportInput::instances`](crate::ReportInput::instances) of those that are the same at every point.
    pub shared: Vec<usize>,
}

/// A variable.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Variable {
    /// Name.
    pub name: String,
    /// Unit of its values; empty for plain numbers, texts, and yes or no.
    pub unit: String,
}

/// A value of a variable.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// A number, in the unit of its variable.
    Number(f64),
    /// A text.
    Text(String),
    /// Yes or no.
    Flag(bool),
}

/// A response.
#[derive(Debug, Clone, PartialEq)]
pub struct Response {
    /// Name.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Where it comes from.
    pub from: Origin,
}

/// Where a response comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum Origin {
    /// A result of a step of the file.
    Step {
        /// The step.
        step: String,
        /// Its name there.
        result: String,
    },
    /// What is computed from the variables, as written.
    Variables(String),
}

/// A sample: how the points were chosen.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sampled {
    /// `sobol`, `random`, ..
    pub method: String,
    /// Number of points.
    pub count: u32,
    /// Seed.
    pub seed: u32,
}

/// A point.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Its name: its values.
    pub name: String,
    /// The same as a word behind a command.
    pub word: String,
    /// A value for each variable.
    pub values: Vec<Value>,
    /// For each response: its value (SI); `None`: there is none.
    pub responses: Vec<Option<f64>>,
    /// What became of it.
    pub fate: Fate,
    /// Positions of its steps among [`ReportInput::instances`](crate::ReportInput::instances).
    pub instances: Vec<usize>,
    /// Where its own page lies, as an address from the study's page, if it has been written.
    pub report: Option<String>,
}

/// What became of a point.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Fate {
    /// All its steps are there.
    Done,
    /// A step of it has failed.
    Failed {
        /// The step.
        step: String,
        /// The class of the failure.
        class: String,
        /// Why, in one line.
        cause: String,
    },
    /// Something of it has not been run.
    NotRun,
}

impl Fate {
    /// In a word.
    pub(crate) fn word(&self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Failed { .. } => "failed",
            Self::NotRun => "not run",
        }
    }

    pub(crate) fn is_failed(&self) -> bool {
        matches!(self, Self::Failed { .. })
    }
}

impl Value {
    /// As the table has it.
    pub(crate) fn text(&self) -> String {
        match self {
            Self::Number(v) => si_number(*v),
            Self::Text(t) => t.clone(),
            Self::Flag(b) => b.to_string(),
        }
    }

    pub(crate) fn number(&self) -> Option<f64> {
        match self {
            Self::Number(v) => Some(*v),
            _ => None,
        }
    }
}

impl Variable {
    /// With its unit, as over a column: `angle (deg)`.
    pub(crate) fn titled(&self) -> String {
        titled(&self.name, &self.unit)
    }
}

impl Response {
    /// With the unit in which it is shown.
    pub(crate) fn titled(&self) -> String {
        titled(&self.name, shown(&self.unit).1)
    }
}

fn titled(name: &str, unit: &str) -> String {
    match unit {
        "" => name.to_owned(),
        unit => format!("{name} ({unit})"),
    }
}

impl Point {
    /// The name of its place on the page. It is that of its values, so that it stays when the study grows.
    pub(crate) fn place(&self) -> String {
        let hash = plyflow_artifact::seal::hash(self.name.as_bytes()).to_string();
        format!("p{}", &hash[..10])
    }
}

/// The different values of a variable.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Levels {
    /// Numbers by size, texts in the order in which the study has them.
    pub(crate) values: Vec<Value>,
    /// For each point the position of its value.
    pub(crate) of: Vec<usize>,
}

impl Levels {
    /// All are numbers.
    pub(crate) fn numbers(&self) -> Option<Vec<f64>> {
        self.values.iter().map(Value::number).collect()
    }
}

impl Family {
    /// Whether what is of one point is on that point's own page alone.
    pub(crate) fn is_large(&self) -> bool {
        self.points.len() > SMALL
    }

    /// The different values of each variable.
    pub(crate) fn levels(&self) -> Vec<Levels> {
        (0..self.variables.len())
            .map(|v| self.levels_of(v))
            .collect()
    }

    fn levels_of(&self, variable: usize) -> Levels {
        let mut known = std::collections::HashMap::new();
        let mut values: Vec<Value> = Vec::new();
        let of = self.points.iter().map(|p| {
            let value = &p.values[variable];
            *known.entry(value.text()).or_insert_with(|| {
                values.push(value.clone());
                values.len() - 1
            })
        });
        let mut of: Vec<usize> = of.collect();
        if values.iter().all(|v| v.number().is_some()) {
            let number = |i: &usize| values[*i].number().unwrap_or(0.0);
            let mut order: Vec<usize> = (0..values.len()).collect();
            order.sort_by(|a, b| number(a).total_cmp(&number(b)));
            let mut place = vec![0; order.len()];
            (order.iter())
                .enumerate()
                .for_each(|(to, from)| place[*from] = to);
            of.iter_mut().for_each(|i| *i = place[*i]);
            values = order.iter().map(|i| values[*i].clone()).collect();
        }
        Levels { values, of }
    }

    /// How many points there are of each kind, in words: `6 points, 5 done, 1 failed`.
    pub(crate) fn counts(&self) -> String {
        let mut parts = vec![plural(self.points.len(), "point", "points")];
        for word in ["done", "failed", "not run"] {
            match self.count(word) {
                0 => {}
                n => parts.push(format!("{n} {word}")),
            }
        }
        parts.join(", ")
    }

    pub(crate) fn count(&self, word: &str) -> usize {
        let points = self.points.iter();
        points.filter(|p| p.fate.word() == word).count()
    }

    /// Values of some variables at a point, in words: `size = 80 mm, layup = L3`.
    pub(crate) fn said(&self, point: usize, variables: &[usize]) -> String {
        let one = |v: &usize| {
            let variable = &self.variables[*v];
            let value = self.points[point].values[*v].text();
            let value = join(value, &variable.unit);
            format!("{} = {value}", variable.name)
        };
        variables.iter().map(one).collect::<Vec<_>>().join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn family(values: &[&[Value]]) -> Family {
        let variable = |n: usize| Variable {
            name: format!("v{n}"),
            unit: if n == 0 { "mm".into() } else { String::new() },
        };
        let point = |values: &&[Value]| Point {
            name: format!("{values:?}"),
            word: String::new(),
            values: values.to_vec(),
            responses: Vec::new(),
            fate: Fate::Done,
            instances: Vec::new(),
            report: None,
        };
        Family {
            variables: (0..values[0].len()).map(variable).collect(),
            points: values.iter().map(point).collect(),
            ..Family::default()
        }
    }

    #[test]
    fn numbers_are_ordered_by_size_and_texts_as_they_come() {
        let (n, t) = (Value::Number, |s: &str| Value::Text(s.into()));
        let all = family(&[&[n(10.0), t("b")], &[n(-2.0), t("a")], &[n(10.0), t("a")]]);
        let levels = all.levels();
        assert_eq!(levels[0].numbers(), Some(vec![-2.0, 10.0]));
        assert_eq!(levels[0].of, [1, 0, 1]);
        assert_eq!(levels[1].values, [t("b"), t("a")]);
        assert_eq!(levels[1].of, [0, 1, 1]);
        assert_eq!(all.said(0, &[0, 1]), "v0 = 10 mm, v1 = b");
    }

    #[test]
    fn the_place_of_a_point_stays_when_the_study_grows() {
        let n = Value::Number;
        let few = family(&[&[n(1.0)], &[n(3.0)]]);
        let more = family(&[&[n(1.0)], &[n(2.0)], &[n(3.0)]]);
        assert_eq!(few.points[1].place(), more.points[2].place());
        assert_ne!(more.points[0].place(), more.points[1].place());
    }
}
