//! Parameters given on the command line in place of the file's.

use crate::diagnostics::{Problems, Source};
use crate::yaml::{Entry, Kind, Node, parse};

/// `STEP.PARAMETER=VALUE`, the value written as in YAML.
#[derive(Debug, Clone, PartialEq)]
pub struct Override {
    step: String,
    path: Vec<String>,
    value: Node,
}

impl std::str::FromStr for Override {
    type Err = String;

    /// Reads `detect.over_shear_positive=9 deg` or, for a parameter inside another, `detect.a.b=1`.
    fn from_str(text: &str) -> Result<Self, String> {
        let wanted = "expected STEP.PARAMETER=VALUE, such as detect.over_shear_positive='9 deg'";
        let (target, value) = text
            .split_once('=')
            .ok_or_else(|| format!("no `=`; {wanted}"))?;
        let mut words = target.split('.').map(|w| w.trim().to_owned());
        let step = words.next().unwrap_or_default();
        let path: Vec<String> = words.collect();
        if step.is_empty() || path.is_empty() || path.iter().any(String::is_empty) {
            return Err(format!(
                "`{target}` does not name a parameter of a step; {wanted}"
            ));
        }
        let value = parse(value).map_err(|e| format!("the value is no YAML: {}", e.message))?;
        Ok(Self { step, path, value })
    }
}

/// Puts the overrides into the tree of a workflow. What is wrong with a value is later reported at the
/// name of its step.
pub(crate) fn apply(
    root: &mut Node,
    overrides: &[Override],
    source: &Source,
    problems: &mut Problems,
) {
    for given in overrides {
        let step = child(root, "steps").and_then(|steps| child(steps, &given.step));
        let Some(step) = step else {
            let message = format!("--set names the step `{}`, which is not here", given.step);
            problems.add(source, &(0..0), message);
            continue;
        };
        set(
            step,
            std::iter::once("with").chain(given.path.iter().map(String::as_str)),
            &given.value,
        );
    }
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

fn set<'p>(node: &mut Node, mut path: impl Iterator<Item = &'p str>, value: &Node) {
    let Some(key) = path.next() else {
        // The value's own place is on the command line: show where it went instead.
        let span = node.span.clone();
        *node = Node::from_json(&value.to_json(), &span);
        return;
    };
    if !matches!(node.kind, Kind::Map(_)) {
        node.kind = Kind::Map(Vec::new());
    }
    let span = node.span.start..node.span.start;
    let Kind::Map(entries) = &mut node.kind else {
        return;
    };
    let at = entries
        .iter()
        .rposition(|e| e.key == key)
        .unwrap_or_else(|| {
            let value = Node {
                kind: Kind::Null,
                span: span.clone(),
            };
            entries.push(Entry {
                key: key.to_owned(),
                key_span: span,
                value,
            });
            entries.len() - 1
        });
    set(&mut entries[at].value, path, value);
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn an_override_replaces_or_adds_a_parameter_at_any_depth() {
        let mut root =
            parse("steps:\n  a:\n    plugin: p\n    with: {x: 1 mm}\n  b: {plugin: p}\n").unwrap();
        let source = Source {
            name: "w.yaml".into(),
            folder: "/".into(),
            text: std::sync::Arc::new(String::new()),
        };
        let mut problems = Problems::default();
        let list: Vec<Override> = ["a.x=2 mm", "b.y.z=[1, 2]"]
            .iter()
            .map(|t| t.parse().unwrap())
            .collect();
        apply(&mut root, &list, &source, &mut problems);
        assert_eq!(problems.count(), 0);
        let json = root.to_json();
        assert_eq!(json["steps"]["a"]["with"], json!({"x": "2 mm"}));
        assert_eq!(json["steps"]["b"]["with"], json!({"y": {"z": [1, 2]}}));
        apply(
            &mut root,
            &["c.x=1".parse().unwrap()],
            &source,
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
