//! The block `optimise`: its search, and what became of its points.

use crate::check::Checker;
use crate::diagnostics::{Problems, Source};
use crate::draft::WORKFLOW;
use crate::resolved::{Budget, Optimisation, Study, StudyResponse};
use crate::study::points;
use crate::study::space::{Begun, Family};
use crate::study::told::{in_unit_of, report, within};
use crate::yaml::{Entry, Kind, Node};
use plyflow_model::units::{Dimension, parse_quantity};
use plyflow_study::optimise::{Along, DEFAULT_POPULATION, Outcome, Search, Way};
use plyflow_study::{Expression, ExpressionError, Names, Points, Quantity, Table, Value};
use std::collections::HashMap;

/// Gives the points with which an optimisation is looked at, by the name of the workflow, what names the search, and the search: none for
/// its first ones.
pub type PointsOf<'a> = dyn Fn(&str, &str, &Search) -> Option<Vec<Vec<Value>>> + 'a;

/// Digits of a response that constraints look at.
const DIGITS: usize = 12;

impl Family {
    /// Reads the block, and finds its variables in the steps. `None` when something is wrong (and reported).
    pub fn read_optimise(
        node: &Node,
        root: &Node,
        points: &PointsOf<'_>,
        source: &Source,
        problems: &mut Problems,
    ) -> Option<Self> {
        let before = problems.count();
        Checker::new(&WORKFLOW, source, problems).check_as("Optimise", node, "optimise");
        if problems.count() > before {
            return None;
        }
        let search = search(node, source, problems)?;
        let place = &root.entry("optimise")?.key_span;
        let told = |problem, problems: &mut Problems| report(problem, place, source, problems);
        if let Err(problem) = search.check() {
            told(problem, problems);
            return None;
        }
        let digest = digest(node);
        let name = root.get("name").and_then(Node::text).unwrap_or_default();
        let asked = match points(name, &digest, &search).filter(|p| !p.is_empty()) {
            Some(asked) => Ok(asked),
            None => search.first(),
        };
        let names: Vec<String> = search.over.iter().map(|o| o.0.clone()).collect();
        let found = asked.and_then(|asked| {
            let table = Table {
                names: names.clone(),
                rows: asked.clone(),
            };
            Ok((Points::new(table)?, asked))
        });
        let (points, asked) = match found {
            Ok(found) => found,
            Err(problem) => {
                told(problem, problems);
                return None;
            }
        };
        let over = node.get("over").map_or(&[][..], Node::entries).iter();
        let groups = over.map(|e| (e.key_span.clone(), vec![e.key.clone()]));
        let family = Self {
            points,
            names,
            samples: Vec::new(),
            at_most_failures: None,
            templates: HashMap::new(),
            search: Some(Begun {
                search,
                asked,
                digest,
            }),
        };
        family.in_steps(root, groups.collect(), source, problems)
    }
}

/// Names a search: all of the block but its budget, with which alone it grows.
fn digest(node: &Node) -> String {
    let mut all = node.to_json();
    if let Some(map) = all.as_object_mut() {
        map.remove("budget");
    }
    let text = format!("plyflow optimisation 1 {}", plyflow_model::canonical(all));
    blake3::hash(text.as_bytes()).to_hex().to_string()
}

/// The schema check has passed.
fn search(node: &Node, source: &Source, problems: &mut Problems) -> Option<Search> {
    let over = points::over(node.get("over")?, source, problems)?;
    let whole = |key: &str| node.get(key).and_then(|n| n.to_json().as_u64());
    let way = match node.get("method").and_then(Node::text) {
        Some("simplex") => Way::Simplex,
        _ => Way::Evolution {
            population: match whole("population") {
                Some(n) => n as usize,
                None => (DEFAULT_POPULATION * over.len()).max(8),
            },
        },
    };
    if let (Way::Simplex, Some(e)) = (way, node.entry("population")) {
        let d = problems.add(source, &e.key_span, "`population` with `method: simplex`");
        d.help("leave it out: it is for `method: evolution`");
    }
    let start = match node.entry("start").filter(|e| e.value.kind != Kind::Null) {
        None => None,
        Some(e) => {
            let mut values = Vec::new();
            for (name, along) in &over {
                match e.value.get(name) {
                    Some(v) => values.push(begins(v, name, along, source, problems)?),
                    None => {
                        let message = format!("`start` has no `{name}`");
                        let d = problems.add(source, &e.value.span, message);
                        d.expected("a value for every variable");
                        return None;
                    }
                }
            }
            let known = |key: &str| over.iter().any(|o| o.0 == key);
            if let Some(odd) = e.value.entries().iter().find(|e| !known(&e.key)) {
                let message = format!("there is no variable `{}` in `over`", odd.key);
                let d = problems.add(source, &odd.key_span, message);
                d.suggest(&odd.key, over.iter().map(|o| o.0.as_str()));
                return None;
            }
            Some(values)
        }
    };
    Some(Search {
        over,
        way,
        seed: whole("seed").unwrap_or(0),
        start,
    })
}

/// The value at which a variable begins, as the variable writes it.
fn begins(
    node: &Node,
    name: &str,
    along: &Along,
    source: &Source,
    problems: &mut Problems,
) -> Option<Value> {
    let given = points::value(node, source, problems)?;
    let value = match along {
        Along::Steps(all) | Along::Choice(all) => in_unit_of(&given, &all[0]),
        Along::Range(_) => Ok(given.clone()),
    };
    match value {
        Ok(value) if along.holds(&value) => Some(value),
        _ => {
            let message = format!("`{name}` cannot begin at `{}`", given.text());
            let d = problems.add(source, &node.span, message);
            d.expected("one of its values");
            None
        }
    }
}

fn budget(node: &Node, source: &Source, problems: &mut Problems) -> Option<Budget> {
    let node = node.get("budget")?;
    let found = match &node.kind {
        Kind::Number(n) => n.as_u64().and_then(|n| u32::try_from(n).ok()),
        Kind::Text(text) => match parse_quantity(text, Dimension::Time) {
            Ok(seconds) if seconds > 0.0 => return Some(Budget::CpuSeconds(seconds)),
            _ => None,
        },
        _ => None,
    };
    match found.filter(|n| (1..=100_000).contains(n)) {
        Some(runs) => Some(Budget::Runs(runs)),
        None => {
            let d = problems.add(
                source,
                &node.span,
                format!("`budget` is {}", node.describe()),
            );
            d.expected("a number of points, such as `40`, or CPU time, such as `2 h`");
            None
        }
    }
}

/// What an optimisation looks for; `None` for a study, or when something is wrong (and reported).
pub(super) fn looked_for(
    family: &Family,
    responses: &[StudyResponse],
    root: &Node,
    source: &Source,
    problems: &mut Problems,
) -> Option<Optimisation> {
    let begun = family.search.as_ref()?;
    let entry = root.entry("optimise")?;
    let node = &entry.value;
    let (objective, maximise) = objective(entry, responses, source, problems)?;
    let budget = budget(node, source, problems)?;
    let (subject_to, constraints) =
        conditions(node, family, &begun.asked[0], responses, source, problems)?;
    Some(Optimisation {
        objective,
        maximise,
        subject_to,
        constraints,
        method: node.get("method")?.text()?.to_owned(),
        seed: begun.search.seed as u32,
        budget,
        digest: begun.digest.clone(),
        search: Some((begun.search.clone(), begun.asked.clone())),
    })
}

/// The response that `optimise` names, and whether it shall be large; everything wrong is reported.
fn objective(
    entry: &Entry,
    responses: &[StudyResponse],
    source: &Source,
    problems: &mut Problems,
) -> Option<(usize, bool)> {
    let node = &entry.value;
    let given = |key: &str| node.entry(key).filter(|e| e.value.kind != Kind::Null);
    let (target, maximise) = match (given("minimise"), given("maximise")) {
        (Some(e), None) => (e, false),
        (None, Some(e)) => (e, true),
        (both, _) => {
            let message = match both {
                Some(_) => "`minimise` and `maximise`",
                None => "`optimise` without `minimise` or `maximise`",
            };
            let d = problems.add(source, &entry.key_span, message);
            d.expected("one of them, with the name of a response");
            return None;
        }
    };
    let name = target.value.text()?;
    let Some(objective) = responses.iter().position(|r| r.name == name) else {
        let d = problems.add(
            source,
            &target.value.span,
            format!("there is no response `{name}`"),
        );
        d.given(name).expected("one of `responses`");
        d.suggest(name, responses.iter().map(|r| r.name.as_str()));
        return None;
    };
    Some((objective, maximise))
}

/// The conditions of `subject_to`, and the SI units of their parts; everything wrong is reported.
fn conditions(
    node: &Node,
    family: &Family,
    first: &[Value],
    responses: &[StudyResponse],
    source: &Source,
    problems: &mut Problems,
) -> Option<(Vec<String>, Vec<String>)> {
    let (mut subject_to, mut constraints) = (Vec::new(), Vec::new());
    for item in node.get("subject_to").map_or(&[][..], Node::items) {
        let text = item.text()?;
        // With numbers that are equal nowhere, so that units are all that can be wrong.
        let probe = |i: usize| Some(1.25 + i as f64 / 7.0);
        let some: Vec<Option<f64>> = (0..responses.len()).map(probe).collect();
        let names = names(&family.names, responses);
        let values = values(first, responses, &some);
        let names = Names {
            all: &names,
            bare: true,
        };
        let found = Expression::read(text, names).and_then(|e| match values {
            Some(values) => e.excess_units(&values).map(|units| (e.variables(), units)),
            None => Ok((e.variables(), vec![String::new()])),
        });
        match found {
            Ok((named, _)) if named.iter().all(|i| *i < family.names.len()) => {
                let d = problems.add(source, &item.span, "this names no response");
                d.expected("a condition on a response")
                    .help("what variables may be is said by `over`");
            }
            Ok((_, units)) => {
                subject_to.push(text.to_owned());
                let plain = |u: String| if u.is_empty() { "1".into() } else { u };
                constraints.extend(units.into_iter().map(plain));
            }
            Err(e) => {
                let span = within(source, item, text, &e.at);
                report(e.problem, &span, source, problems);
            }
        }
    }
    Some((subject_to, constraints))
}

fn names(variables: &[String], responses: &[StudyResponse]) -> Vec<String> {
    let responses = responses.iter().map(|r| r.name.clone());
    variables.iter().cloned().chain(responses).collect()
}

/// The values of variables and responses at a point; `None` where a response has none.
fn values(
    point: &[Value],
    responses: &[StudyResponse],
    found: &[Option<f64>],
) -> Option<Vec<Value>> {
    let mut all = point.to_vec();
    for (r, value) in responses.iter().zip(found) {
        let value = (*value)?;
        // What is smaller than any result of a step is nothing.
        let value = if value.abs() < 1e-18 { 0.0 } else { value };
        let unit = if r.unit == "1" { "" } else { &r.unit };
        let text = format!("{value:.*e} {unit}", DIGITS - 1);
        all.push(Value::Quantity(Quantity::read(&text)?.ok()?));
    }
    Some(all)
}

impl Optimisation {
    /// What became of a point that has run: what is to be small, and how far it is from meeting what must hold. `None` of `found`: a response
    /// has no value, so that the point has failed.
    ///
    /// # Errors
    /// When a constraint cannot be computed from the numbers.
    pub fn outcome(
        &self,
        study: &Study,
        point: &[Value],
        found: &[Option<f64>],
    ) -> Result<Outcome, ExpressionError> {
        let variables: Vec<String> = study.variables.iter().map(|v| v.name.clone()).collect();
        let (Some(value), Some(values)) = (
            found[self.objective],
            values(point, &study.responses, found),
        ) else {
            return Ok(Outcome::Failed);
        };
        let names = names(&variables, &study.responses);
        let mut excess = Vec::with_capacity(self.subject_to.len());
        for text in &self.subject_to {
            let names = Names {
                all: &names,
                bare: true,
            };
            excess.extend(Expression::read(text, names)?.excess(&values)?);
        }
        Ok(Outcome::Done {
            objective: if self.maximise { -value } else { value },
            excess,
        })
    }
}
