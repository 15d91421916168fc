//! What artifacts of every kind may carry for people in their attributes: lists of plots, maps, tables and files.
//!
//! They come from a plugin that anybody may have written: what is wrong with an entry is a warning of the report, a text in `wrong`, and
//! the rest is shown.

use plyflow_model::artifact::CarriedFile;
use plyflow_model::units::parse_quantity_in;
use serde::Deserialize;
use serde_json::Value;

/// What a step carries for people.
pub(crate) const CARRIED: [&str; 4] = ["plots", "files", "tables", "maps"];

/// The entries of one of the lists.
pub(crate) fn list<'a>(attributes: &'a Value, what: &str, wrong: &mut Vec<String>) -> &'a [Value] {
    match &attributes[what] {
        Value::Null => {}
        Value::Array(all) => return all,
        other => {
            let is = in_words(other);
            wrong.push(format!(
                "its attribute '{what}' is {is}; expected a list of {what}"
            ));
        }
    }
    &[]
}

/// Says that an entry cannot be read.
pub(crate) fn unreadable(what: &str, i: usize, entry: &Value, e: &serde_json::Error) -> String {
    let name = entry["name"].as_str().unwrap_or_default();
    format!("{what} {} '{name}' of its attributes: {e}", i + 1)
}

/// The files.
pub(crate) fn files(attributes: &Value, wrong: &mut Vec<String>) -> Vec<CarriedFile> {
    let value = &attributes["files"];
    if value.is_null() {
        return Vec::new();
    }
    let mut files: Vec<CarriedFile> = Vec::deserialize(value).unwrap_or_else(|e| {
        wrong.push(format!("its attribute 'files': {e}"));
        Vec::new()
    });
    // `plyflow extract` refuses these too: a page must not promise a file that is none.
    files.retain(|file| {
        let one = file.text.is_some() != file.array.is_some();
        if !one {
            let name = &file.name;
            wrong.push(format!(
                "its attribute 'files': {name:?} has not one of `text` and `array`"
            ));
        }
        one
    });
    files
}

/// What has a list without what is in that, and the list as it is told: each of its entries is read by itself, so that a wrong one does not
/// keep the others from being drawn.
pub(crate) fn without_list<T: for<'de> Deserialize<'de>>(
    value: &Value,
    list: &str,
) -> serde_json::Result<(T, Vec<Value>)> {
    let mut value = value.clone();
    let told = value.get_mut(list).and_then(Value::as_array_mut);
    let told = told.map(std::mem::take).unwrap_or_default();
    Ok((T::deserialize(value)?, told))
}

fn in_words(value: &Value) -> &'static str {
    match value {
        Value::Null => "nothing",
        Value::Bool(_) => "true or false",
        Value::Number(_) => "a number",
        Value::String(_) => "a text",
        Value::Array(_) => "a list",
        Value::Object(_) => "a mapping",
    }
}

/// A unit as it is printed: `mm2` is mm².
pub(crate) fn pretty(unit: &str) -> String {
    let mut out = String::new();
    for c in unit.trim().chars() {
        let behind_letter = out.chars().last().is_some_and(char::is_alphabetic);
        match c {
            '^' => {}
            '2' if behind_letter => out.push('²'),
            '3' if behind_letter => out.push('³'),
            c => out.push(c),
        }
    }
    out
}

/// SI value = scale x (value in `unit`) + offset; `None` when `unit` is not of the dimension of `stored`.
pub(crate) fn to_si(unit: &str, stored: &str) -> Option<(f64, f64)> {
    let none = |u: &str| matches!(u.trim(), "" | "1");
    if none(unit) && none(stored) {
        return Some((1.0, 0.0));
    }
    let stored = if none(stored) { "" } else { stored };
    let unit = if none(unit) { "" } else { unit };
    let of = |n: &str| parse_quantity_in(format!("{n} {unit}").trim(), stored).ok();
    // A stored value is in SI whatever its unit's text, so that the text tells the dimension alone.
    let offset = of("0")?;
    Some((of("1")? - offset, offset))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn si_values_are_shown_in_the_unit_of_the_axis() {
        let shown = |v: f64, unit: &str, stored: &str| {
            to_si(unit, stored).map(|(scale, offset)| (v - offset) / scale)
        };
        let near = |a: Option<f64>, b: f64| (a.unwrap() - b).abs() < 1e-12 * b.abs().max(1.0);
        assert!(near(shown(0.25, "mm", "m"), 250.0));
        assert!(near(shown(std::f64::consts::PI, "deg", "rad"), 180.0));
        assert!(near(shown(2.0, "N/mm", "N/m"), 2e-3));
        assert!(near(shown(0.19e-3, "N mm", "N m"), 0.19));
        assert!(near(shown(4.0, "1/mm", "1/m"), 4e-3));
        assert!(near(shown(293.15, "degC", "K"), 20.0));
        assert!(near(shown(0.02, "%", "1"), 2.0));
        assert!(near(shown(0.3, "", "1"), 0.3) && near(shown(0.3, "1", ""), 0.3));
        assert!(near(shown(5.0, "N2", "N2"), 5.0));
        for (unit, stored) in [("mm", "rad"), ("", "m"), ("deg", "1"), ("N", "Pa")] {
            assert_eq!(to_si(unit, stored), None, "{unit} of {stored}");
        }
    }

    #[test]
    fn units_are_printed_with_raised_powers() {
        assert_eq!(pretty("mm2"), "mm²");
        assert_eq!(pretty("g/m^2"), "g/m²");
        assert_eq!(pretty("1/mm"), "1/mm");
        assert_eq!(pretty("12"), "12");
    }
}
