//! Rules of a scene (`plyflow_model::rules`) on its YAML: each part is typed by itself, so that a slip in one does not hide what is wrong in another,
//! and what is found is shown where it is written.

use crate::check::out_of_bounds;
use crate::diagnostics::{Problems, Source};
use crate::yaml::{Entry, Kind, Node, Span};
use plyflow_model::fault::{Fault, Other, Part, Path, Problem, Shown};
use plyflow_model::friction::Friction;
use plyflow_model::rules::{self, known::Known};
use plyflow_model::scene::{MirrorPlane, Process, Sheet, Tool};
use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};

/// Tells all that is wrong with a scene but for what the check against its schema has `found` (its places). `materials`: that of every sheet,
/// where it could be read.
pub fn tell(
    scene: &Node,
    materials: &[Option<Value>],
    found: &[Span],
    source: &Source,
    problems: &mut Problems,
) {
    let sheets: Vec<Option<Sheet>> = (scene.get("sheets").map_or(&[][..], Node::items).iter())
        .zip(materials)
        .map(|(node, material)| sheet(node, material.as_ref(), found))
        .collect();
    let tool = part::<Tool>(scene, "tool", found);
    let friction = part::<Friction>(scene, "friction", found);
    let process = part::<Process>(scene, "process", found);
    let symmetry = scene.get("symmetry").map(Node::to_json);
    let symmetry = symmetry.and_then(|s| serde_json::from_value::<Vec<MirrorPlane>>(s).ok());
    let known = Known {
        tool: tool.as_ref(),
        sheets: sheets.iter().map(Option::as_ref).collect(),
        friction: friction.as_ref(),
        process: process.as_ref(),
        symmetry: symmetry.as_deref().unwrap_or_default(),
    };
    let mut faults = rules::faults(&known);
    let listed = scene.get("sheets");
    if listed.is_some_and(|s| matches!(&s.kind, Kind::List(all) if all.is_empty())) {
        faults.push(rules::no_sheet());
    }
    for fault in &faults {
        show(fault, scene, found, source, problems);
    }
}

/// A part of a scene.
fn part<T: DeserializeOwned>(scene: &Node, name: &str, found: &[Span]) -> Option<T> {
    serde_json::from_value(Value::Object(sound(scene.get(name)?, found))).ok()
}

/// A sheet; one whose material could not be read has none yet.
fn sheet(node: &Node, material: Option<&Value>, found: &[Span]) -> Option<Sheet> {
    let mut value = sound(node, found);
    let unread = || json!("");
    value.insert("material".into(), material.cloned().unwrap_or_else(unread));
    serde_json::from_value(Value::Object(value)).ok()
}

/// The entries of a mapping in which nothing was found.
fn sound(node: &Node, found: &[Span]) -> Map<String, Value> {
    let entries = node.entries().iter();
    let good = |e: &&Entry| e.value.kind != Kind::Null && !is_in(e, found);
    entries
        .filter(good)
        .map(|e| (e.key.clone(), e.value.to_json()))
        .collect()
}

/// Whether something was found in an entry.
fn is_in(entry: &Entry, found: &[Span]) -> bool {
    fn holds(node: &Node, found: &[Span]) -> bool {
        found.contains(&node.span)
            || node.entries().iter().any(|e| is_in(e, found))
            || node.items().iter().any(|n| holds(n, found))
    }
    found.contains(&entry.key_span) || holds(&entry.value, found)
}

/// A place of a scene.
struct Found<'n> {
    /// The value.
    node: &'n Node,
    /// Its key, if it has one.
    entry: Option<&'n Entry>,
    /// Whether it is all of the path; else as far as that goes.
    whole: bool,
}

fn follow<'n>(scene: &'n Node, path: &Path) -> Found<'n> {
    let mut at = Found {
        node: scene,
        entry: None,
        whole: true,
    };
    for part in path.parts() {
        let next = match part {
            Part::Key(key) => at.node.entry(key).map(|e| (&e.value, Some(e))),
            Part::Item(item) => at.node.items().get(*item).map(|n| (n, None)),
        };
        match next {
            Some((node, entry)) => (at.node, at.entry) = (node, entry),
            None => {
                at.whole = false;
                break;
            }
        }
    }
    at
}

/// Where in a scene's text the value of a path stands, as far as that goes.
pub fn place(scene: &Node, path: &Path) -> Span {
    follow(scene, path).node.span.clone()
}

/// Tells a fault where it stands, unless something was found there before.
fn show(fault: &Fault, scene: &Node, found: &[Span], source: &Source, problems: &mut Problems) {
    let at = follow(scene, &fault.path);
    let written = |other: &Other| match other {
        Other::Value(path, _) => {
            let there = follow(scene, path);
            there.whole.then(|| there.node.text().map(str::to_owned))?
        }
        Other::Same(path) => Some(source.line(&follow(scene, path).node.span)),
    };
    let key = at.entry.map(|e| &e.key_span);
    let span = match (fault.shown, at.whole) {
        (Shown::Beside(beside), false) => at.node.get(beside).map(|n| &n.span),
        // What is missing in a mapping is told at its key; of an item of a list at its first.
        (_, false) => key.or_else(|| at.node.entries().first().map(|e| &e.key_span)),
        (Shown::Key, true) => key,
        _ => None,
    };
    let span = span.unwrap_or(&at.node.span);
    let told = match at.whole {
        true => at.entry.is_some_and(|e| is_in(e, found)),
        // What could not be read of a sheet may stand for what seems to be missing.
        false => {
            matches!(fault.shown, Shown::Beside(_))
                && at.node.entries().iter().any(|e| is_in(e, found))
        }
    };
    if told || found.contains(span) {
        return;
    }
    let d = match &fault.problem {
        Problem::Given(given) => {
            let expected = fault.expected.as_ref().map(|e| e.written(written));
            let expected = expected.unwrap_or_default();
            match at.whole {
                true => out_of_bounds(at.node, fault.path.last_key(), expected, source, problems),
                false => {
                    let message = format!("`{}` is {given}", fault.path.last_key());
                    problems.add(source, span, message).expected(expected)
                }
            }
        }
        Problem::Text(text) => {
            let d = problems.add(source, span, text.clone());
            if at.whole && fault.shown == Shown::Value && at.node.text().is_some() {
                d.given(at.node.describe());
            }
            if let Some(expected) = &fault.expected {
                d.expected(expected.written(written));
            }
            d
        }
    };
    if let Some(help) = &fault.help {
        d.help(help.written(written));
    }
}
