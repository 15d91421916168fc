//! Why an instance must run: the difference of two recipes and two lists of inputs.

use super::keys::{Binary, Ingredients, InputKey, canonical_json};
use serde_json::Value;

/// A part of a key.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum KeyPart {
    /// The name of the step.
    #[error("step name")]
    StepName,
    /// The plugin.
    #[error("plugin")]
    Plugin,
    /// A component, by its name.
    #[error("component {0}")]
    Component(String),
    /// A parameter, by its JSON pointer.
    #[error("parameter {0}")]
    Parameter(String),
    /// What is in a file, by the pointer of the parameter that names it.
    #[error("content of the file at {0}")]
    File(String),
    /// The version of the data model.
    #[error("data model")]
    DataModel,
    /// An input.
    #[error("input {port} from {from}")]
    Input {
        /// The port at which it arrives.
        port: String,
        /// The instance that gives it: `local[2]`.
        from: String,
    },
    /// The order of the inputs.
    #[error("order of the inputs")]
    Order,
}

/// As its text.
impl serde::Serialize for KeyPart {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

/// One part of a key that differs.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Change {
    /// What.
    pub part: KeyPart,
    /// Before; empty when it was not there.
    pub old: String,
    /// Now; empty when it is gone.
    pub new: String,
}

/// All parts that differ, in the order plugin, components, parameters, files, inputs.
pub fn changes(old: (&Ingredients, &[InputKey]), new: (&Ingredients, &[InputKey])) -> Vec<Change> {
    let mut found = Vec::new();
    let (o, n) = (old.0, new.0);
    push(&mut found, KeyPart::StepName, &o.step, &n.step);
    push(
        &mut found,
        KeyPart::Plugin,
        &binary_text(&o.plugin),
        &binary_text(&n.plugin),
    );
    for at in 0..o.components.len().max(n.components.len()) {
        let (a, b) = (o.components.get(at), n.components.get(at));
        let name = b.or(a).map_or("", |c| c.name.as_str());
        let text = |c: Option<&Binary>| c.map(binary_text).unwrap_or_default();
        let part = KeyPart::Component(name.to_owned());
        push(&mut found, part, &text(a), &text(b));
    }
    compare_values(&mut found, "", Some(&o.parameters), Some(&n.parameters));
    compare_files(&mut found, &o.files, &n.files);
    push(
        &mut found,
        KeyPart::DataModel,
        &o.data_model.to_string(),
        &n.data_model.to_string(),
    );
    compare_inputs(&mut found, old.1, new.1);
    found
}

fn push(found: &mut Vec<Change>, part: KeyPart, old: &str, new: &str) {
    if old != new {
        found.push(Change {
            part,
            old: old.into(),
            new: new.into(),
        });
    }
}

fn binary_text(b: &Binary) -> String {
    format!(
        "{} {} ({})",
        b.name,
        b.version,
        b.hash.get(..12).unwrap_or(&b.hash)
    )
}

fn compare_values(found: &mut Vec<Change>, at: &str, old: Option<&Value>, new: Option<&Value>) {
    match (old, new) {
        (Some(Value::Object(a)), Some(Value::Object(b))) => {
            let mut names: Vec<&String> = a.keys().chain(b.keys()).collect();
            names.sort_unstable();
            names.dedup();
            for name in names {
                compare_values(found, &format!("{at}/{name}"), a.get(name), b.get(name));
            }
        }
        (Some(Value::Array(a)), Some(Value::Array(b))) if a.len() == b.len() => {
            for (i, (x, y)) in a.iter().zip(b).enumerate() {
                compare_values(found, &format!("{at}/{i}"), Some(x), Some(y));
            }
        }
        (a, b) => {
            let text = |v: Option<&Value>| v.map(canonical_json).unwrap_or_default();
            push(found, KeyPart::Parameter(at.to_owned()), &text(a), &text(b));
        }
    }
}

fn compare_files(found: &mut Vec<Change>, old: &[(String, String)], new: &[(String, String)]) {
    let hash = |list: &[(String, String)], p: &str| {
        list.iter()
            .find(|(q, _)| q == p)
            .map(|(_, h)| h.clone())
            .unwrap_or_default()
    };
    let mut pointers: Vec<&String> = old.iter().chain(new).map(|(p, _)| p).collect();
    pointers.sort_unstable();
    pointers.dedup();
    for p in pointers {
        push(
            found,
            KeyPart::File(p.clone()),
            &hash(old, p),
            &hash(new, p),
        );
    }
}

fn compare_inputs(found: &mut Vec<Change>, old: &[InputKey], new: &[InputKey]) {
    let part = |i: &InputKey| KeyPart::Input {
        port: i.port.clone(),
        from: place(&i.step, &i.item),
    };
    for o in old {
        let same = |i: &&InputKey| (&i.port, &i.step, &i.item) == (&o.port, &o.step, &o.item);
        match new.iter().find(same) {
            Some(n) => push(found, part(o), &o.key.short(), &n.key.short()),
            None => push(found, part(o), &o.key.short(), ""),
        }
    }
    for n in new {
        let same = |i: &InputKey| (&i.port, &i.step, &i.item) == (&n.port, &n.step, &n.item);
        if !old.iter().any(same) {
            push(found, part(n), "", &n.key.short());
        }
    }
    if found.is_empty() && old != new {
        push(found, KeyPart::Order, "differs", "");
    }
}

fn place(step: &str, item: &[u64]) -> String {
    if item.is_empty() {
        return step.to_owned();
    }
    let text: Vec<String> = item.iter().map(u64::to_string).collect();
    format!("{step}[{}]", text.join(","))
}

#[cfg(test)]
mod tests {
    use super::super::keys::Key;
    use super::super::tests::step;
    use super::*;
    use serde_json::json;

    #[test]
    fn the_changed_parameter_and_input_are_named_with_old_and_new_value() {
        let mut a = step("s", &[], &[]);
        a.parameters = json!({"limits": {"shear": 0.139, "gap": 1.0}, "list": [1, 2]}).into();
        let mut b = a.clone();
        b.parameters["limits"]["shear"] = json!(0.157);
        b.parameters["list"] = json!([1, 2, 3]);
        let input = |k| InputKey {
            port: "p".into(),
            step: "up".into(),
            item: vec![1],
            key: k,
        };
        let (old, new) = (Ingredients::of(&a), Ingredients::of(&b));
        let found = changes(
            (&old, &[input(Key([1; 32]))]),
            (&new, &[input(Key([2; 32]))]),
        );
        let parts: Vec<String> = found.iter().map(|c| c.part.to_string()).collect();
        assert_eq!(
            parts,
            [
                "parameter /limits/shear",
                "parameter /list",
                "input p from up[1]"
            ]
        );
        assert_eq!(
            (found[0].old.as_str(), found[0].new.as_str()),
            ("0.139", "0.157")
        );
    }
}
