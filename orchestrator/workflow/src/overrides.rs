//! Parameters given on the command line in place of the file's.

use crate::diagnostics::{Problems, Source};
use crate::yaml::{Entry, Kind, Node, Span, parse};

/// `STEP.PARAMETER=VALUE`, the value written as in YAML. Places are those in this text.
#[derive(Debug, Clone, PartialEq)]
pub struct Override {
    text: String,
    step: Word,
    path: Vec<Word>,
    value: Node,
}

/// A name and where it stands.
#[derive(Debug, Clone, PartialEq)]
struct Word {
    name: String,
    span: Span,
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

impl std::str::FromStr for Override {
    type Err = String;

    /// Reads `detect.over_shear_positive=9 deg` or, for a parameter inside another, `detect.a.b=1`.
    fn from_str(text: &str) -> Result<Self, String> {
        let wanted = "expected STEP.PARAMETER=VALUE, such as detect.over_shear_positive='9 deg'";
        let (target, value) = text
            .split_once('=')
            .ok_or_else(|| format!("no `=`; {wanted}"))?;
        let mut start = 0;
        let mut words = target.split('.').map(|w| {
            let word = Word::at(start, w);
            start += w.len() + 1;
            word
        });
        let step = words.next().unwrap_or_else(|| Word::at(0, ""));
        let path: Vec<Word> = words.collect();
        if step.name.is_empty() || path.is_empty() || path.iter().any(|w| w.name.is_empty()) {
            return Err(format!(
                "`{target}` does not name a parameter of a step; {wanted}"
            ));
        }
        let mut node = parse(value).map_err(|e| format!("the value is no YAML: {}", e.message))?;
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

/// Puts the overrides into the tree of a workflow. What is wrong with one is later reported in its own text.
pub(crate) fn apply(
    root: &mut Node,
    overrides: &[Override],
    source: &mut Source,
    problems: &mut Problems,
) {
    for given in overrides {
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
        let path: Vec<Word> = std::iter::once(with)
            .chain(given.path.iter().map(on))
            .collect();
        if let Err(blocked) = set(step, &path, value) {
            let (name, below) = (&path[blocked.at - 1].name, &path[blocked.at]);
            let message = format!(
                "`{name}` is {}: there is no `{}` in it to be set",
                blocked.what, below.name
            );
            let d = problems.add(source, &below.span, message);
            d.given(given.text.clone()).help(format!(
                "give the whole of `{name}`, as in --set '{}.{name}={{..}}', or write it out in the file",
                wanted.name
            ));
        }
    }
}

/// What stands where a mapping is expected on the way to what is set.
struct Blocked {
    /// How many words of the path lead there.
    at: usize,
    what: String,
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

fn set(node: &mut Node, path: &[Word], value: Node) -> Result<(), Blocked> {
    let Some((word, path)) = path.split_first() else {
        *node = value;
        return Ok(());
    };
    if node.kind == Kind::Null {
        *node = Node {
            kind: Kind::Map(Vec::new()),
            span: word.span.clone(),
        };
    }
    let Kind::Map(entries) = &mut node.kind else {
        return Err(Blocked {
            at: 0,
            what: node.describe(),
        });
    };
    let at = entries
        .iter()
        .rposition(|e| e.key == word.name)
        .unwrap_or_else(|| {
            entries.push(Entry {
                key: word.name.clone(),
                key_span: word.span.clone(),
                value: Node {
                    kind: Kind::Null,
                    span: word.span.clone(),
                },
            });
            entries.len() - 1
        });
    set(&mut entries[at].value, path, value).map_err(|e| Blocked { at: e.at + 1, ..e })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

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
        apply(&mut root, &list, &mut source, &mut problems);
        assert_eq!(problems.count(), 0);
        let json = root.to_json();
        assert_eq!(json["steps"]["a"]["with"], json!({"x": "2 mm"}));
        assert_eq!(json["steps"]["b"]["with"], json!({"y": {"z": [1, 2]}}));
        apply(
            &mut root,
            &["c.x=1".parse().unwrap()],
            &mut source,
            &mut problems,
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
