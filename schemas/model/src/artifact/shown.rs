//! What every kind of artifact may show in the report: plots, maps, tables, text files.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A plot of arrays of the same artifact (attribute `plots`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Plot {
    /// Names the plot in messages.
    pub name: String,
    /// Stands above it; without it the name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// Stands below it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
    /// Along the bottom.
    pub x: Axis,
    /// Up the side.
    pub y: Axis,
    /// One or more; the report draws the first 12 and says so.
    pub series: Vec<Series>,
}

/// An axis of a plot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Axis {
    /// Stands beside it.
    pub label: String,
    /// In which it is shown: any unit of the dimension of the arrays; empty or `1` where there is none.
    #[serde(default)]
    pub unit: String,
}

impl Axis {
    /// Of a label and the unit in which it is shown.
    pub fn new(label: impl Into<String>, unit: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            unit: unit.into(),
        }
    }
}

/// A series of a plot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Series {
    /// For the legend.
    pub label: String,
    /// Path of an array below `/data`.
    pub x: String,
    /// Path of an array below `/data` with as many values; of the style `box` seven of them.
    pub y: Paths,
    /// How it is drawn; left out: `line`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub style: Option<Style>,
}

impl Series {
    /// Of a label and the paths of its arrays, in the style that is usual.
    pub fn new(label: impl Into<String>, x: impl Into<String>, y: impl Into<Paths>) -> Self {
        Self {
            label: label.into(),
            x: x.into(),
            y: y.into(),
            style: None,
        }
    }

    /// The same, drawn so.
    #[must_use]
    pub fn drawn(self, style: Style) -> Self {
        Self {
            style: Some(style),
            ..self
        }
    }
}

/// Path of an array, or of the seven arrays of box plots.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "expected `y` to be the path of an array, or of the style 'box' a list of seven arrays"
)]
pub enum Paths {
    /// Of one array.
    One(String),
    /// Lower extreme, lower whisker, lower quartile, median, upper quartile, upper whisker, upper extreme.
    Spread([String; 7]),
}

impl<T: Into<String>> From<T> for Paths {
    fn from(path: T) -> Self {
        Self::One(path.into())
    }
}

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Style {
    /// A line.
    Line,
    /// A dashed line.
    Dashed,
    /// Points.
    Points,
    /// A box plot at every x.
    Box,
}

/// Fields of bodies of the same artifact in the last frame, seen from above, side by side (attribute `maps`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Map {
    /// Names the map in messages.
    pub name: String,
    /// Stands above it; without it the name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// In which the scale is shown: any unit of the fields' dimension.
    #[serde(default)]
    pub unit: String,
    /// 1 to 12.
    pub panels: Vec<Panel>,
}

/// A body of a map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Panel {
    /// Stands above it.
    pub label: String,
    /// Name of the body.
    pub body: String,
    /// Name of a field with one component, on points or cells.
    pub field: String,
}

/// A table (attribute `tables`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Table {
    /// Names the table in messages.
    pub name: String,
    /// Stands above it; without it the name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// Its columns.
    pub columns: Vec<Column>,
    /// Rows with as many cells. The report shows the first 200.
    pub rows: Vec<Vec<Cell>>,
}

/// A column of a table.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Column {
    /// Its head.
    pub label: String,
    /// The SI unit of its numbers, which are shown in the units of the trade.
    #[serde(default)]
    pub unit: String,
    /// Of a column of what was measured, which is in no artifact: the name of a result of the step, with `{k}` for the text of the row's cell k. Its
    /// cells are `null`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measured: Option<String>,
}

impl Column {
    /// Of a head and the SI unit of its numbers.
    pub fn new(label: impl Into<String>, unit: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            unit: unit.into(),
            measured: None,
        }
    }
}

/// A cell of a table.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected a number, a text or null")]
pub enum Cell {
    /// A whole number.
    Count(u64),
    /// A number (SI).
    Number(f64),
    /// A text.
    Text(String),
    /// Not known, or measured.
    #[default]
    Empty,
}

macro_rules! cell_from {
    ($($from:ty => $variant:ident as $to:ty),+) => {$(
        impl From<$from> for Cell {
            fn from(value: $from) -> Self {
                Self::$variant(<$to>::from(value))
            }
        }
    )+};
}

cell_from!(u64 => Count as u64, u32 => Count as u64, f64 => Number as f64, &str => Text as String, String => Text as String, &String => Text as String);

impl From<usize> for Cell {
    fn from(value: usize) -> Self {
        Self::Count(value as u64)
    }
}

impl<T: Into<Self>> From<Option<T>> for Cell {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Empty, Into::into)
    }
}

/// A file that `plyflow extract` writes (attribute `files`): a text, or the bytes of an array.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct CarriedFile {
    /// Of a file in one folder: without `/`, `\` and `..`, at most 200 bytes, and used once.
    pub name: String,
    /// What is in it, where it is a text.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub text: Option<String>,
    /// Instead of `text`: path of an array below `/data` of type u8 and one index, which holds its bytes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub array: Option<String>,
}

impl CarriedFile {
    /// A file of a text.
    pub fn of_text(name: impl Into<String>, text: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            text: Some(text.into()),
            array: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    #[test]
    fn cells_are_numbers_texts_or_null_and_come_back_as_they_were_written() {
        let row: Vec<Cell> = vec![3usize.into(), 2.5.into(), "a".into(), None::<f64>.into()];
        let written = serde_json::to_value(&row).unwrap();
        assert_eq!(written, json!([3, 2.5, "a", null]));
        assert_eq!(serde_json::from_value::<Vec<Cell>>(written).unwrap(), row);
        // What is no number has none.
        assert_eq!(
            serde_json::to_value(Cell::from(f64::NAN)).unwrap(),
            Value::Null
        );
        let wrong = serde_json::from_value::<Cell>(json!([1])).unwrap_err();
        assert!(wrong.to_string().contains("a number, a text or null"));
    }

    #[test]
    fn a_series_has_one_array_or_the_seven_of_box_plots() {
        let read =
            |y: Value| serde_json::from_value::<Series>(json!({"label": "l", "x": "x", "y": y}));
        assert_eq!(read(json!("y")).unwrap().y, "y".into());
        let seven = ["a", "b", "c", "d", "e", "f", "g"].map(str::to_owned);
        assert_eq!(read(json!(seven)).unwrap().y, Paths::Spread(seven));
        let wrong = read(json!(["a"])).unwrap_err().to_string();
        assert!(wrong.contains("a list of seven arrays"), "{wrong}");
    }
}
