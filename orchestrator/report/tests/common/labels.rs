//! Names of instances.

/// `step`, or `step[item,..]`.
pub fn label_of(step: &str, item: &[&str]) -> String {
    if item.is_empty() {
        step.into()
    } else {
        format!("{step}[{}]", item.join(","))
    }
}

/// The parts of an item.
pub fn as_refs(item: &[String]) -> Vec<&str> {
    item.iter().map(String::as_str).collect()
}

/// Step and item of a label.
pub fn split(label: &str) -> (String, Vec<String>) {
    match label.split_once('[') {
        Some((step, item)) => (step.into(), vec![item.trim_end_matches(']').into()]),
        None => (label.into(), vec![]),
    }
}

/// A key for the artifact of a label.
pub fn key(label: &str) -> String {
    label.bytes().map(|b| format!("{b:02x}")).collect()
}
