//! Clouds of points: tables of which three columns are x, y and z, by their names or by their places.

use plyflow_files::number::{Decimal, Signs, value};
use plyflow_files::rows::{Cells, Head, Lines, RowError, Separator, names};
use plyflow_files::text::shown;
use plyflow_geometry::vec3::Vec3;
use plyflow_model::units::{Dimension, parse_quantity, parse_unit};

/// A table that was read.
pub(crate) struct Points {
    /// (m)
    pub points: Vec<Vec3>,
    /// What one unit of its x is (m).
    pub unit: f64,
}

/// One unit where neither the file nor the user says what it is (m).
const USUAL: f64 = 1e-3;

/// Where x, y and z stand.
struct Columns {
    index: [usize; 3],
    /// One unit of each (m), if the header says so.
    unit: Option<[f64; 3]>,
    /// Columns that the header names; `None`: there is no header.
    count: Option<usize>,
    /// Line of the header, or of the row of units below it: data begins behind it.
    last: usize,
}

/// Reads a table. The columns are those that a header calls x, y and z, else the first three; units are those of the header
/// (`x [mm]`, `x (mm)`, `x_mm`, or a row of them below it), else `unit` (m), else millimetres.
///
/// # Errors
/// A header without one each of x, y and z, a unit that is no length or is another than `unit`, a row without three finite numbers: each
/// with its line.
pub(crate) fn read(bytes: &[u8], unit: Option<f64>) -> Result<Points, RowError> {
    let lines = Lines::new(bytes)?;
    let columns = columns(&lines)?;
    if let (Some(told), Some(given)) = (columns.unit, unit)
        && told.iter().any(|t| (t - given).abs() > 1e-9 * given)
    {
        return Err(RowError::at(
            columns.last,
            format!(
                "the header says that one unit is {} mm, and `scan_unit` that it is {} mm; correct the one or leave out the other",
                1e3 * told[0],
                1e3 * given
            ),
        ));
    }
    let units = columns.unit.unwrap_or([unit.unwrap_or(USUAL); 3]);
    let separator = separator(&lines, &columns)?;
    let decimal = decimal(&lines, separator, &columns)?;
    let mut points = Vec::new();
    let mut rows = lines.rows(separator);
    while let Some(row) = rows.read()? {
        if row.line <= columns.last {
            continue;
        }
        let cell = |k: usize| row.cells.get(columns.index[k]).unwrap_or_default();
        let [x, y, z] = [0, 1, 2].map(|k| value(cell(k), decimal).map(|v| v * units[k]));
        let (Some(x), Some(y), Some(z)) = (x, y, z) else {
            return Err(no_point(row.line, row.cells, columns.count.is_some()));
        };
        points.push([x, y, z]);
    }
    let unit = units[0];
    Ok(Points { points, unit })
}

fn no_point(line: usize, cells: &Cells, named: bool) -> RowError {
    let text = shown(&cells.iter().collect::<Vec<_>>().join(" "));
    let what = match named {
        true => "has no finite number in each of its columns x, y, z",
        false => "does not begin with three numbers x, y, z",
    };
    RowError::at(line, format!("`{text}` {what}; correct or remove the line"))
}

fn is_number(cell: &str) -> bool {
    value(cell, Decimal::Point).is_some() || value(cell, Decimal::Comma).is_some()
}

/// A row of cells, and by what it was parted into them.
type Way = (Separator, Vec<String>);

/// The first row with something in it behind a line, parted by each of the separators in its line.
fn first_behind(lines: &Lines, last: usize) -> Option<(usize, Vec<Way>)> {
    let (line, text) = lines.all().find(|l| l.0 > last && !l.1.trim().is_empty())?;
    let mut found = Vec::new();
    let mut of_line = Separator::of_line(text);
    if let Some(told) = lines.told {
        of_line = vec![told];
    }
    for separator in of_line {
        let single = Lines::new(text.as_bytes()).ok()?;
        let mut rows = single.rows(separator);
        if let Ok(Some(row)) = rows.read() {
            found.push((separator, row.cells.iter().map(str::to_owned).collect()));
        }
    }
    Some((line, found))
}

fn columns(lines: &Lines) -> Result<Columns, RowError> {
    let unnamed = Columns {
        index: [0, 1, 2],
        unit: None,
        count: None,
        last: 0,
    };
    let Some((line, ways)) = first_behind(lines, 0) else {
        return Ok(unnamed);
    };
    let words = |cells: &[String]| {
        let word = |c: &String| !is_number(c) && c.chars().any(char::is_alphabetic);
        // What programs print for a number that is none is no name.
        cells.iter().take(3).any(word) && !cells.iter().take(3).any(|c| is_number(c))
            || cells.len() > 3 && cells.iter().filter(|c| word(c)).count() >= 3
    };
    if let Some((_, cells)) = ways.iter().find(|w| words(&w.1)) {
        // A header, in whichever way its columns are parted.
        for (separator, cells) in &ways {
            if let Some(columns) = named(lines, cells, *separator, line)? {
                return Ok(columns);
            }
        }
        return Err(RowError::at(
            line,
            format!(
                "the first line names columns, but not one each of x, y and z: {}; write such as `x,y,z` or `id,x [mm],y [mm],z [mm]`, or `#` \
                 before a line that is a remark",
                names(cells.iter().map(String::as_str))
            ),
        ));
    }
    // Some programs write the header as a comment.
    for (at, text) in lines.comments.iter().rev().filter(|c| c.0 < line) {
        for separator in Separator::of_line(text) {
            let single = Lines::new(text.as_bytes())?;
            let mut rows = single.rows(separator);
            let Some(row) = rows.read()? else { continue };
            let cells: Vec<String> = row.cells.iter().map(str::to_owned).collect();
            if let Some(columns) = named(lines, &cells, separator, *at)? {
                return Ok(columns);
            }
        }
    }
    Ok(unnamed)
}

/// The cells of a header: in `x [mm] y [mm]` a unit belongs to the name before it.
fn with_units(cells: &[String], separator: Separator) -> Vec<String> {
    if separator != Separator::Blanks {
        return cells.to_vec();
    }
    let mut joined: Vec<String> = Vec::new();
    for cell in cells {
        match joined.last_mut() {
            Some(before) if cell.starts_with(['[', '(']) => *before += &format!(" {cell}"),
            _ => joined.push(cell.clone()),
        }
    }
    joined
}

/// The units of three columns from a row of units, as instruments write it.
fn row_of_units(cells: &[String], index: [usize; 3]) -> Option<[Option<String>; 3]> {
    let of = index.map(|k| {
        cells
            .get(k)
            .map(|c| c.trim_matches(['[', ']', '(', ')']).to_owned())
    });
    let lengths = of.iter().flatten().filter(|u| is_length(u)).count();
    (lengths == 3).then_some(of)
}

/// The units `told` of x, y and z, in m; none of all or of none.
fn units_of(told: &[Option<String>; 3], line: usize) -> Result<Option<[f64; 3]>, RowError> {
    match told {
        [None, None, None] => Ok(None),
        [Some(x), Some(y), Some(z)] => {
            let mut of = [0.0; 3];
            for (unit, into) in [x, y, z].into_iter().zip(&mut of) {
                let text = format!("1 {unit}");
                *into = parse_quantity(&text, Dimension::Length)
                    .map_err(|e| RowError::at(line, format!("the unit `{}`: {e}", shown(unit))))?;
            }
            Ok(Some(of))
        }
        _ => Err(RowError::at(
            line,
            "some of the columns x, y, z have a unit, and some have none; give it to all three, or to none",
        )),
    }
}

/// The columns of a header at a line; `None` where it has not one each of x, y and z.
fn named(
    lines: &Lines,
    cells: &[String],
    separator: Separator,
    line: usize,
) -> Result<Option<Columns>, RowError> {
    let cells = with_units(cells, separator);
    let heads: Vec<Head> = cells.iter().map(|c| head(c)).collect();
    let mut index = [0; 3];
    for (axis, into) in index.iter_mut().enumerate() {
        let mut of_axis = (0..heads.len()).filter(|&k| is_axis(&heads[k].name, axis));
        let (Some(one), None) = (of_axis.next(), of_axis.next()) else {
            return Ok(None);
        };
        *into = one;
    }
    let mut last = line;
    let mut told = index.map(|k| {
        heads[k]
            .unit
            .clone()
            .filter(|u| heads[k].certain || is_length(u))
    });
    if told.iter().all(Option::is_none)
        && let Some((below, ways)) = first_behind(lines, line)
    {
        let units = (ways.iter()).find_map(|(_, cells)| row_of_units(cells, index));
        if let Some(units) = units {
            (told, last) = (units, below);
        }
    }
    let unit = units_of(&told, last)?;
    Ok(Some(Columns {
        index,
        unit,
        count: Some(heads.len()),
        last: if lines.comments.iter().any(|c| c.0 == line) && last == line {
            0
        } else {
            last
        },
    }))
}

fn is_length(unit: &str) -> bool {
    !is_number(unit) && parse_unit(unit).is_ok_and(|u| u.exponents == Dimension::Length.exponents())
}

/// A cell of a header: `x_mm` is x in mm too.
fn head(cell: &str) -> Head {
    let mut head = Head::of(cell);
    if head.unit.is_none()
        && let Some((name, unit)) = head.name.rsplit_once('_')
        && is_length(unit)
    {
        head = Head {
            name: name.to_owned(),
            unit: Some(unit.to_owned()),
            certain: false,
        };
    }
    head
}

/// Whether a column's name means x (0), y (1) or z (2).
fn is_axis(name: &str, axis: usize) -> bool {
    let letter = ["x", "y", "z"][axis];
    let name: String = (name.to_lowercase().chars())
        .filter(|c| c.is_alphanumeric())
        .collect();
    let words = ["coordinate", "coord", "position", "pos"];
    name == letter
        || name == format!("points{axis}")
        || words
            .iter()
            .any(|w| name == format!("{letter}{w}") || name == format!("{w}{letter}"))
}

/// What parts the numbers: the first of the separators in the first row of data that makes numbers of its columns.
fn separator(lines: &Lines, columns: &Columns) -> Result<Separator, RowError> {
    let Some((line, ways)) = first_behind(lines, columns.last) else {
        return Ok(Separator::Comma);
    };
    let fits = |cells: &[String]| {
        let full = columns.count.is_none_or(|n| cells.len() == n);
        full && columns
            .index
            .iter()
            .all(|&k| cells.get(k).is_some_and(|c| is_number(c)))
    };
    if let Some((separator, _)) = ways.iter().find(|w| fits(&w.1)) {
        return Ok(*separator);
    }
    let text = lines.all().find(|l| l.0 == line).map_or("", |l| l.1);
    let text = shown(text.trim());
    Err(RowError::at(
        line,
        match columns.count {
            Some(n) => format!(
                "`{text}` has no number in each of the columns x, y, z of the {n} that the header names; correct or remove the line"
            ),
            None => format!(
                "`{text}` does not begin with three numbers x, y, z; correct or remove the line"
            ),
        },
    ))
}

/// The decimal sign, and whether all rows are alike.
fn decimal(lines: &Lines, separator: Separator, columns: &Columns) -> Result<Decimal, RowError> {
    let mut signs = Signs::default();
    let mut rows = lines.rows(separator);
    let (mut alike, mut whole, mut width) = (None, true, 0);
    while let Some(row) = rows.read()? {
        if row.line <= columns.last {
            continue;
        }
        for &k in &columns.index {
            signs.note(row.line, row.cells.get(k).unwrap_or_default());
        }
        let behind = row.cells.iter().rev().take_while(|c| c.is_empty()).count();
        width = row.cells.len() - behind;
        let digits = |c: &str| c.bytes().all(|b| b.is_ascii_digit() || b == b'-');
        whole &= row.cells.iter().all(digits);
        // Rows of other lengths have their numbers in other columns; behind the first three of no names that is nothing.
        if separator != Separator::Comma && columns.count.is_none() {
            continue;
        }
        let (first, line) = *alike.get_or_insert((row.cells.len(), row.line));
        if row.cells.len() != first && width != first {
            let text = shown(&row.cells.iter().collect::<Vec<_>>().join(" "));
            let cells = row.cells.len();
            return Err(RowError::at(
                row.line,
                format!(
                    "`{text}` has {cells} values where line {line} has {first}; values are parted by {} here: correct or remove the line",
                    separator.words()
                ),
            ));
        }
    }
    if separator == Separator::Comma && columns.count.is_none() && whole && width > 4 {
        return Err(RowError::at(
            0,
            format!(
                "it has no header, and {width} whole numbers between commas on each line: perhaps the comma is the decimal sign. Name its columns in a \
                 first line, such as `x,y,z`, or part them by semicolons"
            ),
        ));
    }
    signs
        .decide()
        .map_err(|(line, problem)| RowError::at(line, problem))
}
