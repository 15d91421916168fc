//! What was probably meant by a value of the wrong type, or by a file of the wrong format.

use crate::diagnostics::{Problems, Source};
use crate::yaml::{Kind, Node};
use plyflow_model::units::plain_number;
use serde_json::Value;

/// What to write in the place of a value that is no number, if that can be told.
pub fn number_help(node: &Node, whole: bool) -> Option<String> {
    let text = node.text()?;
    if text.parse::<f64>().is_ok() {
        return Some("remove the quotes".into());
    }
    let meant = plain_number(text).filter(|_| !whole)?;
    Some(format!("write `{meant}`: a plain number, without a unit"))
}

/// The list that was meant by one value in its place.
pub fn list_help(node: &Node, what: &str) -> Option<String> {
    let one = match &node.kind {
        Kind::Text(text) if shows_as_it_is(text) => text.clone(),
        Kind::Number(n) => n.to_string(),
        _ => return None,
    };
    // Inside of a list the value has no key of its own.
    Some(if what.contains(['[', '.']) {
        format!("write `[{one}]`")
    } else {
        format!("write `{what}: [{one}]`")
    })
}

/// The mapping that was probably meant by one text in its place, of those whose meaning is plain.
pub fn mapping_help(node: &Node, what: &str) -> Option<String> {
    let text = node.text().filter(|t| shows_as_it_is(t))?;
    let stl = || format!("{{file: {text}, unit: 1 mm}}");
    match what {
        "for_each" => {
            let item = text.strip_suffix('s').filter(|t| !t.is_empty());
            let item = item.unwrap_or("item");
            Some(format!(
                "write `for_each: {{{item}: {text}}}`, a free name for the items and the step that makes them"
            ))
        }
        "stl" => Some(format!(
            "write `stl: {}`, with the length of one unit of the file",
            stl()
        )),
        "tool" if text.to_ascii_lowercase().ends_with(".stl") => Some(format!(
            "write `tool: {{stl: {}}}`, with the length of one unit of the file",
            stl()
        )),
        "tool" if is_step(text) => Some(format!(
            "a step reads `{text}` and gives a body: `tool: {{input: {{body: ..}}}}` (the page \"Files of others\" of the book)"
        )),
        _ => None,
    }
}

/// Whether a text names a STEP file.
fn is_step(text: &str) -> bool {
    let text = text.to_ascii_lowercase();
    text.ends_with(".step") || text.ends_with(".stp")
}

/// Whether a text may stand in a list or mapping of one line as it is.
fn shows_as_it_is(text: &str) -> bool {
    let plain = |c: char| !c.is_control() && !",[]{}#:'\"`".contains(c);
    !text.is_empty() && text.chars().count() <= 60 && text.chars().all(plain)
}

/// Says that a file is of another format than the one wanted, if its first key tells so: one error in the place of
/// one for each of its keys.
pub fn other_format(
    root: &Node,
    wanted: &str,
    expected: &str,
    source: &Source,
    problems: &mut Problems,
) -> bool {
    const FORMATS: [(&str, &str, &str); 4] = [
        ("plyflow", "a workflow", ""),
        (
            "plyflow_scene",
            "a scene",
            "give the workflow that names this scene",
        ),
        (
            "plyflow_material",
            "a material",
            "give the workflow whose scene names this material",
        ),
        (
            "plyflow_expected",
            "a file of expectations",
            "give the workflow that names it in `expect`",
        ),
    ];
    if root.entry(wanted).is_some() {
        return false;
    }
    let found = FORMATS
        .iter()
        .find_map(|f| root.entry(f.0).map(|entry| (f, entry)));
    let Some(((key, kind, help), entry)) = found else {
        return false;
    };
    let wanted_kind = FORMATS.iter().find(|f| f.0 == wanted).map_or("", |f| f.1);
    let message = format!("this is {kind} (`{key}`), not {wanted_kind}");
    let d = problems.add(source, &entry.key_span, message);
    d.given(*kind).expected(expected);
    if wanted == "plyflow" {
        d.help(*help);
    }
    true
}
/// Words that may stand for a quantity, for messages.
pub fn or_words(words: &[Value]) -> String {
    let words = words.iter().filter_map(Value::as_str);
    words
        .map(|w| format!("`{w}`"))
        .collect::<Vec<_>>()
        .join(" or ")
}

/// Whether one of the variants of a `oneOf` is a word.
pub fn has_words(variants: &Value) -> bool {
    let all = variants.as_array();
    all.is_some_and(|v| v.iter().any(|v| v["const"].is_string()))
}
