//! Plots that an artifact carries in its attributes, for every kind of artifact (`plots` in the data model).

use crate::plain::{Boxes, chart};
use crate::read::carried::{list, pretty, to_si, unreadable, without_list};
use plyflow_artifact::Artifact;
use plyflow_model::artifact::{Axis, Paths, Plot, Series, Style};
use plyflow_model::units::parse_unit;
use serde::Deserialize;
use serde_json::Value;

/// Series of a plot; more could not be told apart.
const SERIES: usize = 12;
/// Values of an array that is read for a plot.
const VALUES: u64 = 20_000_000;
/// Size of a plot on the page (px).
const SIZE: [f64; 2] = [560.0, 330.0];

/// Reads the plots that the attributes of an artifact describe, at most `room` of them, in their order, and gives each with its note to
/// `take`: the arrays of all together may be too large for the memory. What is wrong is said in `wrong`, one text each.
pub(crate) fn each(
    attributes: &Value,
    artifact: &Artifact,
    room: usize,
    wrong: &mut Vec<String>,
    mut take: impl FnMut(&chart::Plot<'_>, Option<&str>),
) {
    let all = list(attributes, "plots", wrong);
    if all.len() > room {
        wrong.push(format!(
            "{} of its {} plots are not drawn: the page is full",
            all.len() - room,
            all.len()
        ));
    }
    for (i, value) in all.iter().enumerate().take(room) {
        match without_list(value, "series") {
            Ok((given, series)) => {
                if let Some(plot) = plot(&given, &series, artifact, wrong) {
                    take(&plot, given.note.as_deref());
                }
            }
            Err(e) => wrong.push(unreadable("plot", i, value, &e)),
        }
    }
}

fn plot<'a>(
    given: &'a Plot,
    told: &[Value],
    artifact: &Artifact,
    wrong: &mut Vec<String>,
) -> Option<chart::Plot<'a>> {
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
    let plot = chart::Plot {
        title: given.title.as_deref().unwrap_or(&given.name).into(),
        x_label: labelled(&given.x).into(),
        y_label: labelled(&given.y).into(),
        legend_of_one: (series
            .iter()
            .any(|s: &chart::Series<'_>| !s.name.is_empty()))
            || boxes.iter().any(|b: &Boxes<'_>| !b.name.is_empty()),
        series,
        boxes,
        size: SIZE,
        ..chart::Plot::default()
    };
    if plot.places().next().is_none() {
        wrong.push(of("it is not drawn: no series has a value".into()));
        return None;
    }
    Some(plot)
}

/// The label of an axis with its unit.
fn labelled(axis: &Axis) -> String {
    match pretty(&axis.unit).as_str() {
        "" | "1" => axis.label.clone(),
        unit => format!("{} ({unit})", axis.label),
    }
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
) -> Result<chart::Series<'static>, String> {
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
    Ok(chart::Series {
        name: given.label.clone().into(),
        colour: number,
        style: match given.style {
            Some(Style::Dashed) => chart::Style::Dashed,
            Some(Style::Points) => chart::Style::Points,
            Some(Style::Line | Style::Box) | None => chart::Style::Line,
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
