//! What was measured, and what all that tells of it shares.

use plyflow_defects::{Defect, Ply};
use plyflow_model::artifact::Column;
use plyflow_sdk::StepError;

/// Name of the scan's body.
pub const SCAN: &str = "scan";

/// A ply or a scan, with what was found on it.
pub struct Measured {
    pub ply: Ply,
    pub defects: Vec<Defect>,
    /// Whether it is a ply of the run.
    pub simulated: bool,
}

/// Columns of a table: label, SI unit.
pub fn columns(of: &[(&str, &str)]) -> Vec<Column> {
    let column = |(label, unit): &(&str, &str)| Column::new(*label, *unit);
    of.iter().map(column).collect()
}

/// Names are parts of results' names, and what they name is told apart by them.
///
/// # Errors
/// When a name cannot be such a part, or stands twice.
pub fn check_names<'a>(what: &str, names: impl Iterator<Item = &'a str>) -> Result<(), StepError> {
    let mut seen: Vec<&str> = Vec::new();
    for (k, name) in names.enumerate() {
        let begins = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
        let goes_on = |c: char| c.is_ascii_alphanumeric() || "_-".contains(c);
        if !begins || !name.chars().all(goes_on) {
            return Err(format!(
                "{what}[{k}].name: '{name}' cannot be a part of a result's name; expected letters, digits, _ and -, the first a letter, such as A-A"
            )
            .into());
        }
        if seen.contains(&name) {
            return Err(format!(
                "{what}[{k}].name: there is another one '{name}'; give each a name of its own"
            )
            .into());
        }
        seen.push(name);
    }
    Ok(())
}

/// What is said under the distances of plies of which not all is judged.
pub fn not_judged(measured: &[Measured]) -> Option<String> {
    let open = measured
        .iter()
        .map(|m| (&m.ply.name, 1.0 - m.ply.judged_share()));
    let open = open.filter(|(_, share)| *share > 1e-9);
    let open: Vec<String> = open
        .map(|(name, share)| format!("{:.1} % of {name}", 100.0 * share))
        .collect();
    (!open.is_empty()).then(|| {
        format!(
            "Not in it, as there is no tool to lie on (at its foot, past an edge of it, over a hole in it): {}.",
            open.join(", ")
        )
    })
}
