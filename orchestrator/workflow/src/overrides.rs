//! Parameters given on the command line in place of the file's.

use crate::catalog::Plugins;
use crate::diagnostics::{Problems, Source};
use crate::paths::{Blocked, Word, put, put_in_file};
use crate::yaml::{Kind, Node, Span, parse};
use indexmap::IndexMap;
use plyflow_model::manifest::{Declaration, Shape};
use std::collections::BTreeSet;

/// `STEP.PARAMETER=VALUE`, the value written as in YAML. Places are those in this text.
#[derive(Debug, Clone, PartialEq)]
pub struct Override {
    text: String,
    step: Word,
    path: Vec<Word>,
    value: Node,
}

impl Word {
    /// The text from `start` without the blanks around it.
    fn at(start: usize, text: &str) -> Self {
        let name = text.trim();
        let start = start + (text.len() - text.trim_start().len());
        Self {
            name: name.to_owned(),
            span: start..start + name.len(),
        }
    }
}

/// Why a text is no override.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum OverrideError {
    /// It has no `=`.
    #[error("no `=`; {}", WANTED)]
    NoValue,
    /// What stands before it names no parameter.
    #[error("`{}` does not name a parameter of a step; {}", .0, WANTED)]
    NoTarget(String),
    /// What stands behind it is no YAML.
    #[error("the value is no YAML: {0}")]
    NoYaml(String),
}

/// What an override looks like.
const WANTED: &str = "expected STEP.PARAMETER=VALUE, such as detect.over_shear_positive='9 deg'";

impl std::str::FromStr for Override {
    type Err = OverrideError;

    /// Reads `detect.over_shear_positive=9 deg` or, for a parameter inside another, `detect.a.b=1`.
    fn from_str(text: &str) -> Result<Self, OverrideError> {
        let (target, value) = text.split_once('=').ok_or(OverrideError::NoValue)?;
        let mut start = 0;
        let mut words = target.split('.').map(|w| {
            let word = Word::at(start, w);
            start += w.len() + 1;
            word
        });
        let step = words.next().unwrap_or_else(|| Word::at(0, ""));
        let path: Vec<Word> = words.collect();
        if step.name.is_empty() || path.is_empty() || path.iter().any(|w| w.name.is_empty()) {
            return Err(OverrideError::NoTarget(target.to_owned()));
        }
        let mut node = parse(value).map_err(|e| OverrideError::NoYaml(e.message))?;
        shift(&mut node, target.len() + 1);
        Ok(Self {
            text: text.to_owned(),
            step,
            path,
            value: node,
        })
    }
}

/// Moves all places of a tree on by some bytes.
fn shift(node: &mut Node, by: usize) {
    let moved = |span: &Span| span.start + by..span.end + by;
    node.span = moved(&node.span);
    match &mut node.kind {
        Kind::List(items) => items.iter_mut().for_each(|item| shift(item, by)),
        Kind::Map(entries) => {
            for entry in entries {
                entry.key_span = moved(&entry.key_span);
                shift(&mut entry.value, by);
            }
        }
        _ => {}
    }
}

/// Puts the overrides into the tree of a workflow, and gives what each has taken out of it. What is wrong with one is later reported in its own text.
pub(crate) fn apply(
    root: &mut Node,
    overrides: &[Override],
    source: &mut Source,
    problems: &mut Problems,
    catalog: &Plugins<'_>,
) -> Vec<Lost> {
    let mut lost = Vec::new();
    for given in overrides {
        let before = words(root);
        let start = source.add_set(&given.text);
        let on = |w: &Word| Word {
            name: w.name.clone(),
            span: w.span.start + start..w.span.end + start,
        };
        let wanted = on(&given.step);
        let steps = child(root, "steps");
        let names: Vec<String> = (steps.iter())
            .flat_map(|s| s.entries().iter().map(|e| e.key.clone()))
            .collect();
        let step = steps.and_then(|steps| child(steps, &wanted.name));
        let Some(step) = step else {
            let message = format!("there is no step `{}`", wanted.name);
            let d = problems.add(source, &wanted.span, message);
            d.given(wanted.name.as_str())
                .suggest(&wanted.name, names.iter().map(String::as_str));
            continue;
        };
        let mut value = given.value.clone();
        shift(&mut value, start);
        // A `with` that the file lacks is not in the text either: what is missing in it is missing in the step.
        let with = Word {
            name: "with".into(),
            span: step.span.start..step.span.start,
        };
        let path: Vec<Word> = [with]
            .into_iter()
            .chain(given.path.iter().map(on))
            .collect();
        let file = step
            .get("plugin")
            .and_then(Node::text)
            .and_then(|name| catalog.find(name, &source.folder).ok())
            .and_then(|entry| words_to_file(&entry.manifest.parameters, &given.path));
        if let Err(blocked) = set(step, &path, file, value) {
            let d = blocked.report(&path, source, problems);
            d.given(given.text.clone());
            if blocked.names.is_empty() {
                d.help(whole_of(&path[blocked.at - 1].name, &wanted.name));
            }
        }
        let span = wanted.span.start..path[path.len() - 1].span.end;
        let words = before.difference(&words(root)).cloned().collect();
        lost.push(Lost { span, words });
    }
    lost
}

/// What to do where a path leads into something that has no parts.
fn whole_of(name: &str, step: &str) -> String {
    format!(
        "give the whole of `{name}`, as in --set '{step}.{name}={{..}}', or write it out in the file"
    )
}

/// Words that an override has taken out of the steps.
pub(crate) struct Lost {
    /// Where the override names its parameter.
    span: Span,
    words: BTreeSet<String>,
}

/// Reports overrides after which no step depends on one of the `variables` of a study any more: the points would be told with values that they do not have.
pub(crate) fn without_variables(
    lost: &[Lost],
    variables: &[String],
    source: &Source,
    problems: &mut Problems,
) {
    for Lost { span, words } in lost {
        for name in variables.iter().filter(|v| words.contains(*v)) {
            let message =
                format!("it takes the place of `${{{name}}}`, on which no step depends any more");
            let d = problems.add(source, span, message);
            d.expected("a value that no variable of the study sets").help(format!(
                "the points would be told with values of `{name}` that they do not have: change those in the study instead"
            ));
        }
    }
}

/// The words of expressions in the values of the steps, variables among them.
fn words(root: &Node) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    if let Some(steps) = root.get("steps") {
        words_in(steps, &mut found);
    }
    found
}

fn words_in(node: &Node, found: &mut BTreeSet<String>) {
    match &node.kind {
        Kind::Text(text) => {
            let inner = text.split("${").skip(1).filter_map(|t| t.split('}').next());
            let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_';
            let words = inner.flat_map(|t| t.split(move |c| !is_part(c)));
            found.extend(words.map(str::to_owned));
        }
        Kind::List(items) => items.iter().for_each(|n| words_in(n, found)),
        Kind::Map(entries) => entries.iter().for_each(|e| words_in(&e.value, found)),
        _ => {}
    }
}

/// How many words of a path lead to a parameter that is a scene or a material, if it goes on from there.
fn words_to_file(declared: &IndexMap<String, Declaration>, path: &[Word]) -> Option<usize> {
    let mut declaration = declared.get(&path.first()?.name)?;
    for at in 1..path.len() {
        declaration = match &declaration.shape {
            Shape::Scene { .. } | Shape::SheetMaterial => return Some(at),
            Shape::Object(fields) => fields.get(&path[at].name)?,
            Shape::List(of, _) | Shape::Map(of) => of,
            _ => return None,
        };
    }
    None
}

/// Sets a value of a step; `file`: how many words behind `with` lead to a scene or a material, perhaps in a file of its own.
fn set(step: &mut Node, path: &[Word], file: Option<usize>, value: Node) -> Result<(), Blocked> {
    let Some(file) = file else {
        return put(step, path, value, false);
    };
    let (to, rest) = path.split_at(file + 1);
    // What stands there is taken out, changed, and put back.
    let mut place = Node {
        kind: Kind::Null,
        span: to[file].span.clone(),
    };
    swap(step, to, &mut place)?;
    let done = put_in_file(&mut place, rest, value);
    swap(step, to, &mut place)?;
    done.map_err(|b| Blocked {
        at: b.at + to.len(),
        ..b
    })
}

/// Exchanges a value with the one where a path leads.
fn swap(node: &mut Node, path: &[Word], with: &mut Node) -> Result<(), Blocked> {
    let mut value = Node {
        kind: Kind::Null,
        span: with.span.clone(),
    };
    std::mem::swap(&mut value, with);
    if let Some(there) = find(node, path) {
        std::mem::swap(there, &mut value);
        *with = value;
        return Ok(());
    }
    put(node, path, value, false)
}

fn find<'n>(node: &'n mut Node, path: &[Word]) -> Option<&'n mut Node> {
    path.iter()
        .try_fold(node, |node, word| child(node, &word.name))
}

fn child<'n>(node: &'n mut Node, key: &str) -> Option<&'n mut Node> {
    let Kind::Map(entries) = &mut node.kind else {
        return None;
    };
    entries
        .iter_mut()
        .rev()
        .find(|e| e.key == key)
        .map(|e| &mut e.value)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::{Catalog, CatalogEntry, CatalogError};
    use camino::Utf8Path;
    use plyflow_model::manifest::PluginKind;
    use serde_json::json;

    /// No plugin at all.
    struct Nothing;

    impl Catalog for Nothing {
        fn find(&self, name: &str, _: &Utf8Path) -> Result<CatalogEntry, CatalogError> {
            Err(CatalogError::NotFound {
                name: name.into(),
                searched: Vec::new(),
            })
        }

        fn names(&self, _: PluginKind) -> Vec<String> {
            Vec::new()
        }
    }

    #[test]
    fn an_override_replaces_or_adds_a_parameter_at_any_depth() {
        let mut root =
            parse("steps:\n  a:\n    plugin: p\n    with: {x: 1 mm}\n  b: {plugin: p}\n").unwrap();
        let mut source = Source {
            name: "w.yaml".into(),
            folder: "/".into(),
            text: std::sync::Arc::new(String::new()),
            set: Vec::new(),
        };
        let mut problems = Problems::default();
        let list: Vec<Override> = ["a.x=2 mm", "b.y.z=[1, 2]"]
            .iter()
            .map(|t| t.parse().unwrap())
            .collect();
        let catalog = Plugins::new(&Nothing);
        apply(&mut root, &list, &mut source, &mut problems, &catalog);
        assert_eq!(problems.count(), 0);
        let json = root.to_json();
        assert_eq!(json["steps"]["a"]["with"], json!({"x": "2 mm"}));
        assert_eq!(json["steps"]["b"]["with"], json!({"y": {"z": [1, 2]}}));
        apply(
            &mut root,
            &["c.x=1".parse().unwrap()],
            &mut source,
            &mut problems,
            &catalog,
        );
        assert_eq!(problems.count(), 1);
    }

    #[test]
    fn an_override_without_step_parameter_or_value_is_refused() {
        for text in ["a.x", "a=1", ".x=1", "a.=1", "a.x=[1"] {
            assert!(text.parse::<Override>().is_err(), "{text}");
        }
    }
}
