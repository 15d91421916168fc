//! The variables of a study in the steps of its workflow, and every step at every point.

use crate::check::Checker;
use crate::diagnostics::{Problems, Source};
use crate::draft::{Draft, WORKFLOW};
use crate::resolved::{ResolvedStep, Study, StudyPoint, StudyValue, StudyVariable};
use crate::study::points;
use crate::study::told::{report, within};
use crate::wires::Wiring;
use crate::yaml::{Entry, Kind, Node, Span};
use plyflow_study::optimise::Search;
use plyflow_study::{Kind as ValueKind, Point, Points, Template, Value, Written};
use std::collections::{BTreeSet, HashMap};

/// Keys of a step in whose values `${name}` may stand.
const OPEN: [&str; 3] = ["with", "resources", "retries"];

/// Findings at so many points are enough to see what is wrong.
const ENOUGH: usize = 200;

/// A search, and the points that it has asked for.
pub(crate) struct Begun {
    pub(super) search: Search,
    pub(super) asked: Vec<Vec<Value>>,
    pub(super) digest: String,
}

/// The points of a study and where its variables stand in the steps.
pub(crate) struct Family {
    pub points: Points,
    pub names: Vec<String>,
    pub(super) samples: Vec<(String, u32, u32)>,
    pub(super) at_most_failures: Option<u32>,
    /// By what is written there. A place names no value: all that is below an alias stands where the alias does.
    pub(super) templates: HashMap<String, Template>,
    /// Of an optimisation: what asks for points, and those that it has asked for.
    pub(super) search: Option<Begun>,
}

impl Family {
    /// Reads the block and finds its variables in the steps. `None` when something is wrong (and reported).
    pub fn read(
        study: &Node,
        root: &Node,
        source: &Source,
        problems: &mut Problems,
    ) -> Option<Self> {
        let before = problems.count();
        Checker::new(&WORKFLOW, source, problems).check_as("Study", study, "study");
        if problems.count() > before {
            return None;
        }
        let read = points::read(study, source, problems)?;
        let place = root.entry("study").map_or(&study.span, |e| &e.key_span);
        let points = match Points::new(read.table) {
            Ok(points) => points,
            Err(problem) => {
                report(problem, place, source, problems);
                return None;
            }
        };
        if points.all.is_empty() {
            let at = study.entry("where").map_or(place, |e| &e.value.span);
            let d = problems.add(source, at, "the study has no point");
            d.expected(match study.entry("where") {
                Some(_) => "at least one point for which `where` holds",
                None => "at least one point",
            });
            return None;
        }
        let at_most = study.get("at_most_failures").map(Node::to_json);
        let at_most = at_most.and_then(|n| n.as_u64());
        let family = Self {
            names: points.variables.iter().map(|v| v.name.clone()).collect(),
            points,
            samples: read.samples,
            at_most_failures: at_most.and_then(|n| n.try_into().ok()),
            templates: HashMap::new(),
            search: None,
        };
        family.in_steps(root, read.groups, source, problems)
    }

    /// Finds the variables in the steps. `groups`: those of which at least one must be used. `None` when something is wrong (and reported).
    pub(super) fn in_steps(
        mut self,
        root: &Node,
        groups: Vec<(Span, Vec<String>)>,
        source: &Source,
        problems: &mut Problems,
    ) -> Option<Self> {
        let before = problems.count();
        let steps = root.get("steps").map_or(&[][..], Node::entries);
        let mut used = BTreeSet::new();
        for step in steps {
            for entry in step.value.entries() {
                let open = OPEN.contains(&entry.key.as_str());
                used.extend(self.scan(&entry.value, open, &entry.key, source, problems));
            }
        }
        for (span, variables) in groups {
            let place = |name: &String| self.names.iter().position(|n| n == name);
            let any = |name: &String| place(name).is_some_and(|i| used.contains(&i));
            if problems.count() == before && !variables.iter().any(any) {
                let message = format!("no step depends on `{}`", variables.join("`, `"));
                let d = problems.add(source, &span, message);
                d.expected(format!("`${{{}}}` in a value of a step", variables[0]))
                    .help("all its points would be the same: name it in a step, or leave it out");
            }
        }
        (problems.count() == before).then_some(self)
    }

    /// Finds the templates below a node, and gives the variables in them.
    fn scan(
        &mut self,
        node: &Node,
        open: bool,
        key: &str,
        source: &Source,
        problems: &mut Problems,
    ) -> BTreeSet<usize> {
        let mut used = BTreeSet::new();
        match &node.kind {
            Kind::Text(text) if text.contains("${") => {
                let kinds: Vec<ValueKind> = self.points.variables.iter().map(|v| v.kind).collect();
                match Template::read(text, &self.names, &kinds) {
                    Ok(None) => {}
                    Ok(Some(_)) if !open => {
                        let message = format!("`{key}` is the same at every point of a study");
                        let d = problems.add(source, &node.span, message);
                        d.given(text.clone())
                            .expected("a value without `${..}`")
                            .help("variables may stand in `with`, `resources` and `retries`");
                    }
                    Ok(Some(template)) => {
                        used.extend(template.variables());
                        self.templates.insert(text.clone(), template);
                    }
                    Err(e) => {
                        let span = within(source, node, text, &e.at);
                        report(e.problem, &span, source, problems);
                    }
                }
            }
            Kind::List(items) => {
                for item in items {
                    used.extend(self.scan(item, open, key, source, problems));
                }
            }
            Kind::Map(entries) => {
                for entry in entries {
                    used.extend(self.scan(&entry.value, open, key, source, problems));
                }
            }
            _ => {}
        }
        used
    }

    /// The variables below a node.
    fn used(&self, node: &Node, found: &mut BTreeSet<usize>) {
        if let Some(t) = node.text().and_then(|text| self.templates.get(text)) {
            found.extend(t.variables());
        }
        node.items().iter().for_each(|n| self.used(n, found));
        node.entries()
            .iter()
            .for_each(|e| self.used(&e.value, found));
    }

    /// A node with the values of a point in it. Where they do not fit, what stands there stays, and `fail` is told.
    fn put(
        &self,
        node: &Node,
        values: &[Value],
        fail: &mut dyn FnMut(&Node, plyflow_study::ExpressionError),
    ) -> Node {
        let kind = match &node.kind {
            Kind::Text(text) => match self.templates.get(text).map(|t| t.written(values)) {
                Some(Ok(Written::Integer(n))) => Kind::Number(n.into()),
                Some(Ok(Written::Decimal(n))) => match serde_json::Number::from_f64(n) {
                    Some(n) => Kind::Number(n),
                    None => node.kind.clone(),
                },
                Some(Ok(Written::Text(t))) => Kind::Text(t),
                Some(Ok(Written::Bool(b))) => Kind::Bool(b),
                Some(Err(e)) => {
                    fail(node, e);
                    node.kind.clone()
                }
                None => node.kind.clone(),
            },
            Kind::List(items) => {
                Kind::List(items.iter().map(|n| self.put(n, values, fail)).collect())
            }
            Kind::Map(entries) => {
                let one = |e: &Entry| Entry {
                    key: e.key.clone(),
                    key_span: e.key_span.clone(),
                    value: self.put(&e.value, values, fail),
                };
                Kind::Map(entries.iter().map(one).collect())
            }
            other => other.clone(),
        };
        Node {
            kind,
            span: node.span.clone(),
        }
    }

    /// The workflow as it is at the first point, for checks of its form.
    pub fn first(&self, root: &Node) -> Node {
        self.put(root, &self.points.all[0].values, &mut |_, _| {})
    }

    /// Every step at every point, in topological order. `None` when something is wrong (and reported).
    pub fn steps(
        &self,
        drafts: &[Draft<'_>],
        wiring: &Wiring,
        source: &Source,
        problems: &mut Problems,
        resolve: &mut dyn FnMut(&Draft<'_>, &mut Problems) -> Option<ResolvedStep>,
    ) -> Option<(Vec<ResolvedStep>, Option<Study>)> {
        let named = drafts.iter().enumerate();
        let index: HashMap<&str, usize> = named.map(|(i, d)| (d.name(), i)).collect();
        let depends = self.depends(drafts, wiring, &index);
        // Positions of the resolved steps: by step of the file, by point.
        let mut at: Vec<Vec<usize>> = vec![Vec::new(); drafts.len()];
        let mut steps: Vec<ResolvedStep> = Vec::new();
        let mut contents: HashMap<blake3::Hash, usize> = HashMap::new();
        for &i in &wiring.order {
            let mut known: HashMap<String, usize> = HashMap::new();
            for (p, point) in self.points.all.iter().enumerate() {
                let part = point.part(&self.points.variables, &depends[i]);
                if let Some(there) = known.get(&part) {
                    at[i].push(*there);
                    continue;
                }
                let before = problems.count();
                let found = self.at_point(&drafts[i], point, source, problems, resolve);
                problems.at_point(before, &part);
                let Some(mut step) = found.filter(|_| problems.count() == 0) else {
                    if problems.count() > ENOUGH {
                        return None;
                    }
                    // Only findings come of it from now on.
                    known.insert(part, usize::MAX);
                    at[i].push(usize::MAX);
                    continue;
                };
                let name = |base: &str| steps[at[index[base]][p]].name.clone();
                for input in &mut step.inputs {
                    input.from = name(&input.from);
                }
                for dimension in &mut step.dimensions {
                    dimension.over = name(&dimension.over);
                }
                // Other values may come to the same in the end.
                let content = content_of(i, &step);
                let there = *contents.entry(content).or_insert(steps.len());
                if there == steps.len() {
                    steps.push(at_part(step, &part));
                }
                known.insert(part, there);
                at[i].push(there);
            }
        }
        if problems.count() > 0 || wiring.order.len() != drafts.len() {
            return None;
        }
        let study = self.study(drafts, wiring, &at);
        Some((steps, Some(study)))
    }

    /// The variables on which each step depends, by its own text or through what it is wired to.
    fn depends(
        &self,
        drafts: &[Draft<'_>],
        wiring: &Wiring,
        index: &HashMap<&str, usize>,
    ) -> Vec<Vec<usize>> {
        let mut depends: Vec<Vec<usize>> = vec![Vec::new(); drafts.len()];
        for &i in &wiring.order {
            let mut own = BTreeSet::new();
            self.used(&drafts[i].entry.value, &mut own);
            let inputs = wiring.inputs[i].iter().map(|w| w.from.as_str());
            for from in inputs.chain(wiring.dimensions[i].iter().map(|d| d.over.as_str())) {
                own.extend(depends[index[from]].iter().copied());
            }
            depends[i] = own.into_iter().collect();
        }
        depends
    }

    /// One step of the file at one point, under its name in the file.
    fn at_point(
        &self,
        draft: &Draft<'_>,
        point: &Point,
        source: &Source,
        problems: &mut Problems,
        resolve: &mut dyn FnMut(&Draft<'_>, &mut Problems) -> Option<ResolvedStep>,
    ) -> Option<ResolvedStep> {
        let before = problems.count();
        let value = self.put(&draft.entry.value, &point.values, &mut |node, e| {
            let text = node.text().unwrap_or_default();
            report(
                e.problem,
                &within(source, node, text, &e.at),
                source,
                problems,
            );
        });
        if problems.count() > before {
            return None;
        }
        let entry = Entry {
            key: draft.entry.key.clone(),
            key_span: draft.entry.key_span.clone(),
            value,
        };
        let mut open = BTreeSet::new();
        for key in ["resources", "retries"] {
            if let Some(node) = draft.entry.value.get(key) {
                self.used(node, &mut open);
            }
        }
        if !open.is_empty() {
            Checker::new(&WORKFLOW, source, problems).check_as("Step", &entry.value, draft.name());
        }
        let draft = Draft {
            entry: &entry,
            index: draft.index,
            plugin: draft.plugin.clone(),
        };
        resolve(&draft, problems)
    }

    fn study(&self, drafts: &[Draft<'_>], wiring: &Wiring, at: &[Vec<usize>]) -> Study {
        let variables = self.points.variables.iter().map(|v| StudyVariable {
            name: v.name.clone(),
            unit: v.unit.clone(),
            si_unit: v.kind.si_unit(),
        });
        let value = |v: &Value| match v {
            Value::Quantity(q) => StudyValue::Number {
                shown: plyflow_study::Quantity::plain(q.number).si(),
                si: q.si(),
            },
            Value::Text(t) => StudyValue::Text(t.clone()),
            Value::Bool(b) => StudyValue::Bool(*b),
        };
        let point = |(p, point): (usize, &Point)| StudyPoint {
            name: point.name.clone(),
            values: point.values.iter().map(value).collect(),
            steps: wiring.order.iter().map(|&i| at[i][p]).collect(),
        };
        Study {
            variables: variables.collect(),
            points: self.points.all.iter().enumerate().map(point).collect(),
            steps: wiring
                .order
                .iter()
                .map(|&i| drafts[i].name().to_owned())
                .collect(),
            responses: Vec::new(),
            expectations: Vec::new(),
            samples: self.samples.clone(),
            at_most_failures: self.at_most_failures,
            optimisation: None,
        }
    }
}

/// A step at what is its `part` of a point: under a name of its own, if it depends on it.
fn at_part(mut step: ResolvedStep, part: &str) -> ResolvedStep {
    if !part.is_empty() {
        let base = std::mem::take(&mut step.name);
        step.name = format!("{base}@{part}");
        step.base = Some(base);
    }
    step
}

/// What a step is, besides its name.
fn content_of(index: usize, step: &ResolvedStep) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    let all = serde_json::json!([
        index,
        step.parameters,
        step.components,
        step.files,
        step.inputs,
        step.dimensions,
        step.resources,
        step.retries
    ]);
    hasher.update(all.to_string().as_bytes());
    hasher.finalize()
}
