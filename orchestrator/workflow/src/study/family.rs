//! Expectations over the points of a study.

use crate::diagnostics::{Problems, Source};
use crate::draft::Draft;
use crate::resolved::{FamilyExpectation, StudyResponse};
use crate::results::{bounds_meet, value};
use crate::study::optimise::looked_for;
use crate::study::responses::responses;
use crate::study::space::Family;
use crate::study::told::{report, within};
use crate::wires::Wiring;
use crate::yaml::{Kind, Node};
use plyflow_model::workflow::FamilyOf;
use plyflow_study::{Expression, Kind as ValueKind, Names, Value, judge, marks};

/// A study and what is read from its points.
pub(crate) struct Asked<'a> {
    pub(super) family: &'a Family,
    pub responses: Vec<StudyResponse>,
    /// Names of all, also of those that are wrong (and reported).
    declared: Vec<String>,
}

impl<'a> Asked<'a> {
    /// Reads the responses of a study; everything wrong is reported.
    pub fn read(
        family: &'a Family,
        root: &Node,
        steps: (&[Draft<'_>], &Wiring),
        source: &Source,
        problems: &mut Problems,
    ) -> Self {
        let responses = responses(root, family, steps, source, problems);
        let declared = root.get("responses").map_or(&[][..], Node::entries);
        Self {
            family,
            responses,
            declared: declared.iter().map(|e| e.key.clone()).collect(),
        }
    }

    /// What an optimisation looks for; `None` for a study, or when something is wrong (and reported).
    pub fn optimisation(
        &self,
        root: &Node,
        source: &Source,
        problems: &mut Problems,
    ) -> Option<crate::resolved::Optimisation> {
        looked_for(self.family, &self.responses, root, source, problems)
    }

    /// Reads an expectation over the points; everything wrong is reported. Long, as it fills all fields of one, each from a key.
    pub fn expectation(
        &self,
        item: &Node,
        source: &Source,
        problems: &mut Problems,
    ) -> Option<FamilyExpectation> {
        let before = problems.count();
        let response = self.response(item, source, problems)?;
        let of = of(item);
        if !self.is_for_this(item, of, source, problems) {
            return None;
        }
        let over = self.over(item, of, source, problems)?;
        let points = self.points(item, of, source, problems)?;
        // What is stated is a place along a variable, or a value of the response.
        let place = matches!(of, FamilyOf::Argmax | FamilyOf::Argmin | FamilyOf::Best);
        let variable = over
            .filter(|_| place)
            .map(|i| &self.family.points.variables[i]);
        let of_response = &self.responses[response];
        let (unit, what) = match variable {
            Some(v) => (v.unit.clone(), v.name.as_str()),
            None => (of_response.unit.clone(), of_response.name.as_str()),
        };
        let mut number = |key: &str| {
            let entry = item.entry(key).filter(|e| e.value.kind != Kind::Null)?;
            value(entry, &unit, what, source, problems)
        };
        let (expected, tolerance) = (number("value"), number("tolerance"));
        let (minimum, maximum) = (number("minimum"), number("maximum"));
        if let (Some(_), Some(e)) = (tolerance.filter(|t| *t < 0.0), item.entry("tolerance")) {
            problems.add(source, &e.value.span, "`tolerance` is negative");
        }
        bounds_meet(
            item,
            [expected, tolerance, minimum, maximum],
            source,
            problems,
        );
        let relative = item
            .get("relative_tolerance")
            .and_then(|n| n.to_json().as_f64());
        let about = match item.get("about") {
            Some(node) if of == FamilyOf::SymmetricAbout => {
                Some(self.about(node, over?, source, problems)?)
            }
            _ => None,
        };
        stated(item, of, source, problems);
        let si_unit = variable.map_or(unit, |v| v.kind.si_unit());
        let found = FamilyExpectation {
            response,
            of,
            over,
            about,
            increasing: item.get("direction").and_then(Node::text) == Some("increasing"),
            points,
            condition: item.get("where").and_then(Node::text).map(str::to_owned),
            unit: si_unit,
            value: expected,
            tolerance,
            relative_tolerance: relative,
            minimum,
            maximum,
            source: item.get("source").and_then(Node::text).map(str::to_owned),
        };
        if problems.count() == before {
            self.comparable(&found, item, source, problems);
        }
        (problems.count() == before).then_some(found)
    }

    /// The response that is named; `None` when there is none, or none that is right (and reported).
    fn response(&self, item: &Node, source: &Source, problems: &mut Problems) -> Option<usize> {
        let node = item.get("response")?;
        let name = node.text()?;
        let found = self.responses.iter().position(|r| r.name == name);
        if found.is_none() && !self.declared.iter().any(|d| d == name) {
            let d = problems.add(source, &node.span, format!("there is no response `{name}`"));
            d.given(name)
                .suggest(name, self.declared.iter().map(String::as_str));
        }
        found
    }

    /// Whether this can be told of an optimisation, or of a study, whichever the workflow is.
    fn is_for_this(
        &self,
        item: &Node,
        of: FamilyOf,
        source: &Source,
        problems: &mut Problems,
    ) -> bool {
        let searched = self.family.search.is_some();
        if searched != (of == FamilyOf::Best)
            && matches!(
                of,
                FamilyOf::Best | FamilyOf::Monotone | FamilyOf::SymmetricAbout
            )
        {
            let at = item.get("of").map_or(&item.span, |n| &n.span);
            let message = format!(
                "`of: {}` in {}",
                of.word(),
                if searched {
                    "an optimisation"
                } else {
                    "a study"
                }
            );
            problems.add(source, at, message).help(match searched {
                true => "a method chooses the points: expect something `of: best`",
                false => "it is for `optimise`; use `max`, `min`, `argmax` or `argmin`",
            });
            return false;
        }
        true
    }

    /// The variable along which is looked. `None` when something is wrong.
    fn over(
        &self,
        item: &Node,
        of: FamilyOf,
        source: &Source,
        problems: &mut Problems,
    ) -> Option<Option<usize>> {
        let needs = matches!(
            of,
            FamilyOf::Argmax | FamilyOf::Argmin | FamilyOf::Monotone | FamilyOf::SymmetricAbout
        );
        let Some(node) = item.get("over") else {
            if needs {
                let message = format!("`{}` without the variable that it is about", of.word());
                problems
                    .add(source, &item.span, message)
                    .expected("`over: name`");
                return None;
            }
            return Some(None);
        };
        let name = node.text()?;
        if !needs && of != FamilyOf::Best {
            let d = problems.add(
                source,
                &node.span,
                format!("`over` with `of: {}`", of.word()),
            );
            d.help("leave it out; to choose points use `where`");
            return None;
        }
        let Some(i) = self.family.names.iter().position(|n| n == name) else {
            let message = format!("there is no variable `{name}` in the study");
            let d = problems.add(source, &node.span, message);
            d.given(name)
                .suggest(name, self.family.names.iter().map(String::as_str));
            return None;
        };
        if !matches!(self.family.points.variables[i].kind, ValueKind::Quantity(_)) {
            let message = format!("`{name}` is no number");
            problems
                .add(source, &node.span, message)
                .expected("a variable whose values have an order");
            return None;
        }
        Some(Some(i))
    }

    /// Positions of the points that are meant. `None` when something is wrong.
    fn points(
        &self,
        item: &Node,
        of: FamilyOf,
        source: &Source,
        problems: &mut Problems,
    ) -> Option<Vec<u32>> {
        let all = &self.family.points.all;
        let Some(node) = item.get("where") else {
            if of == FamilyOf::ZeroWhere {
                let d = problems.add(source, &item.span, "`zero_where` without `where`");
                d.expected("`where: ..`, a condition on the variables");
                return None;
            }
            return Some((0..all.len() as u32).collect());
        };
        let text = node.text()?;
        let names = Names {
            all: &self.family.names,
            bare: true,
        };
        let chosen = Expression::read(text, names).and_then(|condition| {
            let mut chosen = Vec::new();
            for (i, point) in all.iter().enumerate() {
                if condition.holds(&point.values)? {
                    chosen.push(i as u32);
                }
            }
            Ok(chosen)
        });
        match chosen {
            // The points of an optimisation are not known before it has run.
            Ok(chosen) if chosen.is_empty() && self.family.search.is_none() => {
                let d = problems.add(source, &node.span, "this holds at no point of the study");
                d.expected("a condition that chooses at least one point");
                None
            }
            Ok(chosen) => Some(chosen),
            Err(e) => {
                let span = within(source, node, text, &e.at);
                report(e.problem, &span, source, problems);
                None
            }
        }
    }

    fn about(
        &self,
        node: &Node,
        over: usize,
        source: &Source,
        problems: &mut Problems,
    ) -> Option<(f64, String)> {
        let variable = &self.family.points.variables[over];
        let value = match &node.kind {
            Kind::Number(n) => Value::of_number(&n.to_string()).ok(),
            Kind::Text(t) => Value::of_text(t).ok(),
            _ => None,
        };
        match value.filter(|v| v.kind() == variable.kind) {
            Some(value) => Some((value.si()?, value.text())),
            None => {
                let message = format!("`about` is {}", node.describe());
                let d = problems.add(source, &node.span, message);
                d.expected(format!(
                    "{}, as `{}` is",
                    variable.kind.in_words(),
                    variable.name
                ));
                None
            }
        }
    }

    /// A claim along a variable needs points that differ in it alone.
    fn comparable(
        &self,
        e: &FamilyExpectation,
        item: &Node,
        source: &Source,
        problems: &mut Problems,
    ) {
        if !matches!(e.of, FamilyOf::Monotone | FamilyOf::SymmetricAbout) {
            return;
        }
        let Some(over) = e.over else { return };
        let others: Vec<usize> = (0..self.family.names.len())
            .filter(|i| *i != over)
            .collect();
        let mark = |i: &u32| {
            let point = &self.family.points.all[*i as usize];
            let along = point.values[over].si().unwrap_or(f64::NAN);
            (
                along,
                point.part(&self.family.points.variables, &others),
                Some(0.0),
            )
        };
        let marks = marks(e.points.iter().map(mark));
        if judge(e.claim(), &marks, (f64::NEG_INFINITY, f64::INFINITY))
            .value
            .is_none()
        {
            let name = &self.family.names[over];
            let (message, expected) = match e.of {
                FamilyOf::SymmetricAbout => (
                    format!("no two points mirror each other in `{name}`, all else being the same"),
                    "pairs of points at the same distance on both sides of `about`",
                ),
                _ => (
                    format!("no two points differ in `{name}` alone"),
                    "points that differ in this variable while the others stay as they are",
                ),
            };
            let at = item.get("over").map_or(&item.span, |n| &n.span);
            problems.add(source, at, message).expected(expected);
        }
    }
}

fn of(item: &Node) -> FamilyOf {
    use FamilyOf::{
        Argmax, Argmin, Best, Each, Max, Mean, Min, Monotone, SymmetricAbout, ZeroWhere,
    };
    let all = [
        Each,
        Mean,
        Max,
        Min,
        Argmax,
        Argmin,
        Monotone,
        ZeroWhere,
        SymmetricAbout,
        Best,
    ];
    let word = item.get("of").and_then(Node::text);
    let found = all.into_iter().find(|o| Some(o.word()) == word);
    found.unwrap_or_default()
}

/// Whether an expectation states what its kind needs, and nothing else.
fn stated(item: &Node, of: FamilyOf, source: &Source, problems: &mut Problems) {
    for (key, whose, expected) in [
        (
            "about",
            FamilyOf::SymmetricAbout,
            "`about: ..`, where the points mirror each other",
        ),
        (
            "direction",
            FamilyOf::Monotone,
            "`direction: increasing` or `decreasing`",
        ),
    ] {
        match item.entry(key) {
            Some(e) if of != whose && e.value.kind != Kind::Null => {
                let message = format!("`{key}` with `of: {}`", of.word());
                problems
                    .add(source, &e.key_span, message)
                    .help("leave it out");
            }
            None if of == whose => {
                let message = format!("`{}` without `{key}`", of.word());
                problems.add(source, &item.span, message).expected(expected);
            }
            _ => {}
        }
    }
    bounds_stated(item, of, source, problems);
}

/// Whether an expectation has the bounds that its kind needs, and no others: a claim along a variable has a tolerance alone, a number
/// has a value or a limit.
fn bounds_stated(item: &Node, of: FamilyOf, source: &Source, problems: &mut Problems) {
    let given = |key: &str| item.get(key).is_some();
    let along = matches!(
        of,
        FamilyOf::Monotone | FamilyOf::ZeroWhere | FamilyOf::SymmetricAbout
    );
    let foreign: &[&str] = if along {
        &["value", "minimum", "maximum"]
    } else {
        &["relative_tolerance"]
    };
    for key in foreign {
        if let Some(e) = item.entry(key).filter(|_| given(key)) {
            let message = format!("`{key}` with `of: {}`", of.word());
            let d = problems.add(source, &e.key_span, message);
            d.help(match along {
                true => "state a `tolerance`, or a `relative_tolerance`",
                false => "state a `tolerance`",
            });
        }
    }
    if along && given("tolerance") && given("relative_tolerance") {
        let d = problems.add(source, &item.span, "two tolerances");
        d.expected("`tolerance` or `relative_tolerance`");
    }
    if !along && !["value", "minimum", "maximum"].into_iter().any(given) {
        let d = problems.add(source, &item.span, "this expectation states nothing");
        d.expected("`value` (with `tolerance`), `minimum` or `maximum`");
    }
    if !along && given("tolerance") && !given("value") {
        let d = problems.add(source, &item.span, "`tolerance` without `value`");
        d.help("for a bound use `minimum` or `maximum`");
    }
}
