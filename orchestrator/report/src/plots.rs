//! Plots that an artifact carries in its attributes, for every kind of artifact (`plots` in the data model).
//!
//! A plot comes from a plugin that anybody may have written: what is wrong with one is a warning of the report, and
//! the rest is drawn.

use crate::plot::{self, Boxes};
use maud::{Markup, html};
use plyflow_artifact::Artifact;
use plyflow_model::artifact::{Axis, Paths, Plot, Series, Style};
use plyflow_model::units::{parse_quantity_in, parse_unit};
use serde::Deserialize;
use serde_json::Value;

/// Series of a plot; more could not be told apart.
const SERIES: usize = 12;
/// Values of an array that is read for a plot.
const VALUES: u64 = 20_000_000;
/// Size of a plot on the page (px).
const SIZE: [f64; 2] = [560.0, 330.0];

/// Draws the plots that the attributes of an artifact describe, at most `room` of them, in their order. What is wrong
/// is said in `wrong`, one text each.
pub(crate) fn drawn(
    attributes: &Value,
    artifact: &Artifact,
    room: usize,
    wrong: &mut Vec<String>,
) -> Vec<Markup> {
    let all = match &attributes["plots"] {
        Value::Null => return Vec::new(),
        Value::Array(all) => all,
        other => {
            wrong.push(format!(
                "its attribute 'plots' is {}; expected a list of plots",
                in_words(other)
            ));
            return Vec::new();
        }
    };
    if all.len() > room {
        wrong.push(format!(
            "{} of its {} plots are not drawn: the page is full",
            all.len() - room,
            all.len()
        ));
    }
    let mut plots = Vec::new();
    for (i, value) in all.iter().enumerate().take(room) {
        match without_list(value, "series") {
            Ok((given, series)) => plots.extend(plot(&given, &series, artifact, wrong)),
            Err(e) => {
                let name = value["name"].as_str().unwrap_or_default();
                wrong.push(format!("plot {} '{name}' of its attributes: {e}", i + 1));
            }
        }
    }
    plots
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

pub(crate) fn in_words(value: &Value) -> &'static str {
    match value {
        Value::Null => "nothing",
        Value::Bool(_) => "true or false",
        Value::Number(_) => "a number",
        Value::String(_) => "a text",
        Value::Array(_) => "a list",
        Value::Object(_) => "a mapping",
    }
}

fn plot(
    given: &Plot,
    told: &[Value],
    artifact: &Artifact,
    wrong: &mut Vec<String>,
) -> Option<Markup> {
    let of = |text: String| format!("plot '{}': {text}", given.name);
    for (axis, which) in [(&given.x, "x"), (&given.y, "y")] {
        if let Err(e) = parse_unit(&axis.unit) {
            wrong.push(of(format!("the unit of its {which} axis: {e}")));
            return None;
        }
    }
    if told.len() > SERIES {
        wrong.push(of(format!(
            "the first {SERIES} of its {} series are drawn",
            told.len()
        )));
    }
    let (mut series, mut boxes) = (Vec::new(), Vec::new());
    for (i, value) in told.iter().enumerate().take(SERIES) {
        let read = one(value, i, &of, wrong);
        let drawn = read.and_then(|one| match one.style {
            Some(Style::Box) => spread(&one, given, artifact, i).map(|b| boxes.push(b)),
            _ => line(&one, given, artifact, i).map(|l| series.push(l)),
        });
        if let Err(e) = drawn {
            wrong.push(of(format!("series {}: {e}", i + 1)));
        }
    }
    let (x_label, y_label) = (labelled(&given.x), labelled(&given.y));
    let drawn = plot::Plot {
        title: given.title.as_deref().unwrap_or(&given.name),
        x_label: &x_label,
        y_label: &y_label,
        legend_of_one: (series.iter().any(|s: &plot::Series<'_>| !s.name.is_empty()))
            || boxes.iter().any(|b: &Boxes<'_>| !b.name.is_empty()),
        series,
        boxes,
        from_zero: false,
        bound: None,
        ceiling: None,
        size: SIZE,
    }
    .svg();
    if drawn.0.is_empty() {
        wrong.push(of("it is not drawn: no series has a value".into()));
        return None;
    }
    Some(match &given.note {
        Some(note) => html! { div { (drawn) p class="note" { (note) } } },
        None => drawn,
    })
}

/// The label of an axis with its unit.
fn labelled(axis: &Axis) -> String {
    match pretty(&axis.unit).as_str() {
        "" | "1" => axis.label.clone(),
        unit => format!("{} ({unit})", axis.label),
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

/// A series as it is told. One in a style that there is not is drawn as a line, which is said.
fn one(
    value: &Value,
    number: usize,
    of: &dyn Fn(String) -> String,
    wrong: &mut Vec<String>,
) -> Result<Series, String> {
    let text = |e: serde_json::Error| e.to_string();
    let style = &value["style"];
    let Some(odd) = style
        .as_str()
        .filter(|_| Style::deserialize(style).is_err())
    else {
        return Series::deserialize(value).map_err(text);
    };
    let mut plain = value.clone();
    plain["style"] = Value::Null;
    let series = Series::deserialize(plain).map_err(text)?;
    wrong.push(of(format!(
        "series {} has the style '{odd}' and is drawn as a line; there are: line, dashed, points, box",
        number + 1
    )));
    Ok(series)
}

/// A series of lines or points.
fn line(
    given: &Series,
    plot: &Plot,
    artifact: &Artifact,
    number: usize,
) -> Result<plot::Series<'static>, String> {
    let Paths::One(path) = &given.y else {
        return Err("`y` lists seven arrays, as that of the style 'box' does; expected one".into());
    };
    let x = values(artifact, &given.x, &plot.x.unit)?;
    let y = values(artifact, path, &plot.y.unit)?;
    if x.len() != y.len() {
        return Err(unequal(&given.x, x.len(), path, y.len()));
    }
    if x.is_empty() {
        return Err(format!("'{}' is empty", given.x));
    }
    Ok(plot::Series {
        name: given.label.clone().into(),
        colour: number,
        style: match given.style {
            Some(Style::Dashed) => plot::Style::Dashed,
            Some(Style::Points) => plot::Style::Points,
            Some(Style::Line | Style::Box) | None => plot::Style::Line,
        },
        x: x.into(),
        y: y.into(),
    })
}

/// A series of box plots.
fn spread(
    given: &Series,
    plot: &Plot,
    artifact: &Artifact,
    number: usize,
) -> Result<Boxes<'static>, String> {
    let Paths::Spread(paths) = &given.y else {
        return Err("`y` is one array (`y` of the style 'box' lists seven arrays)".into());
    };
    let x = values(artifact, &given.x, &plot.x.unit)?;
    let mut spread = vec![[0.0; 7]; x.len()];
    for (k, path) in paths.iter().enumerate() {
        let column = values(artifact, path, &plot.y.unit)?;
        if column.len() != x.len() {
            return Err(unequal(&given.x, x.len(), path, column.len()));
        }
        for (all, value) in spread.iter_mut().zip(column) {
            all[k] = value;
        }
    }
    Ok(Boxes {
        name: given.label.clone().into(),
        colour: number,
        x,
        spread,
    })
}

fn unequal(x: &str, values: usize, y: &str, others: usize) -> String {
    format!("'{x}' has {values} values and '{y}' has {others}; expected as many")
}

/// An array of the artifact in a unit.
fn values(artifact: &Artifact, path: &str, unit: &str) -> Result<Vec<f64>, String> {
    let Some(info) = artifact.contents().array(path) else {
        let all = artifact.contents().arrays.iter().map(|a| a.path.as_str());
        let mut text = format!("there is no array '{path}'");
        if let Some(near) = plyflow_model::nearest::nearest(path, all) {
            text += &format!("; did you mean '{near}'?");
        }
        return Err(text);
    };
    if info.shape.len() != 1 {
        return Err(format!(
            "the array '{path}' has the shape {:?}; expected one index",
            info.shape
        ));
    }
    if info.shape[0] > VALUES {
        return Err(format!(
            "the array '{path}' has {} values; at most {VALUES} are drawn",
            info.shape[0]
        ));
    }
    let (scale, offset) = to_si(unit, &info.unit).ok_or_else(|| {
        format!(
            "the array '{path}' is in '{}', which cannot be shown in '{unit}'",
            info.unit
        )
    })?;
    let (mut data, _) = artifact.array_f64(path).map_err(|e| e.to_string())?;
    for v in &mut data {
        *v = (*v - offset) / scale;
    }
    Ok(data)
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
