//! CSV files of raw test data: `#` comment lines, one header line `name [unit],name [unit]`, rows of numbers, in the dialects of
//! [`plyflow_files::rows`]: any separator, decimal commas, quotes, encodings, and units in parentheses or in a row of their own.
//!
//! Everything that is wrong is an error with file, line and column: a test that is read wrongly gives a
//! law that looks right.

use plyflow_files::number::{Decimal, Signs, plain};
use plyflow_files::open::{self, MOST_DATA};
use plyflow_files::rows::{Head, Lines, RowError, Separator, names};
use plyflow_files::text::{excerpt, shown};
use plyflow_model::units::{Dimension, parse_quantity, parse_unit, parse_unit_of};

/// Displacements may go back by so much (m): the jitter of an encoder.
const JITTER: f64 = 1e-4;

/// A column that a reader asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Column {
    /// Name in the header.
    pub name: &'static str,
    /// Dimension that its unit must have.
    pub dimension: Dimension,
    /// Whether a file without it is refused.
    pub required: bool,
}

impl Column {
    /// A column that must be there.
    pub const fn required(name: &'static str, dimension: Dimension) -> Self {
        Self {
            name,
            dimension,
            required: true,
        }
    }

    /// A column that may be there.
    pub const fn optional(name: &'static str, dimension: Dimension) -> Self {
        Self {
            name,
            dimension,
            required: false,
        }
    }
}

/// The columns that were asked for, in SI.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    /// Name of the file, for messages.
    pub source: String,
    /// Line in the file (from 1) of each row.
    pub lines: Vec<usize>,
    columns: Vec<Values>,
}

/// A column that was read.
#[derive(Debug, Clone, PartialEq)]
struct Values {
    name: &'static str,
    /// Unit of the header.
    unit: String,
    /// SI.
    values: Vec<f64>,
}

/// Refuses two files with the same rows: what is measured twice is never the same to the last digit, and one file for two specimens would make a spread of nothing.
///
/// # Errors
/// Names both files.
pub fn distinct(tables: &[Table]) -> Result<(), String> {
    for (i, table) in tables.iter().enumerate() {
        if let Some(same) = tables[..i].iter().find(|t| t.columns == table.columns) {
            return Err(format!(
                "{} has the rows of {}, the file before it: two specimens never give the same to the last digit, and with one that counts twice the error \
                 that is told would be too small; give each test once",
                table.source, same.source
            ));
        }
    }
    Ok(())
}

impl Table {
    /// Values of a column (SI), one per row; `None` when the file has no such column.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns
            .iter()
            .find(|c| c.name == name)
            .map(|c| c.values.as_slice())
    }

    /// Values of a column that was asked for as required.
    ///
    /// # Errors
    /// When it was not.
    pub fn values(&self, name: &str) -> Result<&[f64], String> {
        self.column(name)
            .ok_or_else(|| format!("{}: there is no column '{name}'", self.source))
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.lines.len()
    }

    /// `file:line` of a row, for messages.
    pub fn place(&self, row: usize) -> String {
        format!(
            "{}:{}",
            self.source,
            self.lines.get(row).copied().unwrap_or(0)
        )
    }

    /// Refuses a length (m) outside of `range` (m), as a wrong unit in the header makes it: a law would come of it that is
    /// wrong by powers of ten. `what` it is of.
    ///
    /// # Errors
    /// Says the row, the value, the unit of the header and what is plausible.
    pub fn plausible_length(&self, name: &str, range: [f64; 2], what: &str) -> Result<(), String> {
        let Some(column) = self.columns.iter().find(|c| c.name == name) else {
            return Ok(());
        };
        let outside = |v: &f64| !(range[0]..=range[1]).contains(&v.abs());
        let Some(row) = column.values.iter().position(outside) else {
            return Ok(());
        };
        let unit = &column.unit;
        Err(format!(
            "{}: column '{name} [{unit}]': {} m is not plausible for {what}; expected {} mm to {} m: is [{unit}] the unit \
             of the numbers? If not, change it in the header, to `{name} [mm]`, say",
            self.place(row),
            column.values[row],
            1e3 * range[0],
            range[1]
        ))
    }

    /// Refuses a displacement (m) that falls below what it was before by more than a jitter; `expected` of the file.
    ///
    /// # Errors
    /// Says the row, from where to where, and what is expected.
    pub fn goes_forward(&self, name: &str, expected: &str) -> Result<(), String> {
        let mut farthest = f64::NEG_INFINITY;
        for (i, s) in self.values(name)?.iter().enumerate() {
            if *s < farthest - JITTER {
                return Err(format!(
                    "{}: the {name} goes back from {:.3} mm to {:.3} mm; {expected}",
                    self.place(i),
                    1e3 * farthest,
                    1e3 * s
                ));
            }
            farthest = farthest.max(*s);
        }
        Ok(())
    }

    /// Refuses a table with too few rows.
    ///
    /// # Errors
    /// Says how many there are, how many are needed and for what.
    pub fn at_least(&self, rows: usize, why: &str) -> Result<(), String> {
        if self.rows() >= rows {
            return Ok(());
        }
        let n = self.rows();
        Err(format!(
            "{}: {n} rows of data; {why} needs at least {rows}",
            self.source
        ))
    }
}

/// Reads a file.
///
/// # Errors
/// When it cannot be read, and as [`parse`].
pub fn read(path: &str, wanted: &[Column]) -> Result<Table, String> {
    let shown = excerpt(path, 300);
    let path = std::path::Path::new(path);
    let bytes = open::read(path, MOST_DATA).map_err(|e| format!("{shown}: cannot be read: {e}"))?;
    let name = path.file_name().and_then(|n| n.to_str());
    let name = name.map_or(shown, |n| excerpt(n, 100));
    parse(&bytes, &name, wanted)
}

/// Reads the bytes of a file; columns that nobody asked for are passed over.
///
/// # Errors
/// A missing or repeated column, one that is nearly an optional one, a missing, unknown or unfit unit, a row of another length, a value that is
/// no finite number: each with `source`, line and column.
pub fn parse(
    bytes: &(impl AsRef<[u8]> + ?Sized),
    source: &str,
    wanted: &[Column],
) -> Result<Table, String> {
    of_rows(bytes.as_ref(), source, wanted).map_err(|e| e.of(source))
}

/// A column that is in a file: where, which, and its unit as the file writes it.
type Picked = (usize, Column, String);

/// The decimal sign of all numbers of the file. `last`: line of the header, or of the row of units below it.
fn decimal(
    lines: &Lines,
    separator: Separator,
    picked: &[Picked],
    last: usize,
) -> Result<Decimal, RowError> {
    let mut signs = Signs::default();
    let mut rows = lines.rows(separator);
    while let Some(row) = rows.read()? {
        if row.line > last {
            let cells = picked.iter().filter_map(|p| row.cells.get(p.0));
            cells.for_each(|c| signs.note(row.line, c));
        }
    }
    signs.decide().map_err(|(line, e)| RowError::at(line, e))
}

fn of_rows(bytes: &[u8], source: &str, wanted: &[Column]) -> Result<Table, RowError> {
    let lines = Lines::new(bytes)?;
    let Some((_, first)) = lines.first() else {
        return Err(RowError::at(
            0,
            format!("is empty; expected {}", example(wanted)),
        ));
    };
    let separator = separator(&lines, first, wanted)?;
    let (mut heads, line, last) = header(&lines, separator, wanted)?;
    while heads
        .last()
        .is_some_and(|h| h.name.is_empty() && h.unit.is_none())
    {
        heads.pop();
    }
    let picked = pick(&heads, wanted, line)?;
    let decimal = decimal(&lines, separator, &picked, last)?;
    let mut table = Table {
        source: source.to_owned(),
        lines: Vec::new(),
        columns: (picked.iter())
            .map(|(_, column, unit)| Values {
                name: column.name,
                unit: unit.clone(),
                values: Vec::new(),
            })
            .collect(),
    };
    let mut rows = lines.rows(separator);
    while let Some(row) = rows.read()? {
        if row.line <= last {
            continue;
        }
        // Spreadsheets part cells that nobody filled, too.
        let behind = row.cells.iter().skip(heads.len()).all(str::is_empty);
        if row.cells.len() < heads.len() || !behind {
            let (n, m) = (row.cells.len(), heads.len());
            let words = separator.words();
            return Err(RowError::at(
                row.line,
                format!(
                    "{n} values where the header names {m} columns; values are separated by {words} here, decimals by a point, or by a comma where \
                     the values are separated otherwise"
                ),
            ));
        }
        for ((index, column, unit), into) in picked.iter().zip(&mut table.columns) {
            let value = value(&row.cells[*index], decimal, unit, column.dimension)
                .map_err(|e| RowError::at(row.line, format!("column '{}': {e}", column.name)))?;
            into.values.push(value);
        }
        table.lines.push(row.line);
    }
    Ok(table)
}

fn example(wanted: &[Column]) -> String {
    let names: Vec<String> = wanted.iter().filter(|c| c.required).map(heading).collect();
    format!("a header line such as `{}`", names.join(","))
}

/// The separator of a file: that of its header's in which the columns that are asked for are found, else the likeliest.
fn separator(lines: &Lines, first: &str, wanted: &[Column]) -> Result<Separator, RowError> {
    if let Some(told) = lines.told {
        return Ok(told);
    }
    let mut of_line = Separator::of_line(first);
    if first.matches('"').count() % 2 == 1 {
        // The header goes on in the next line.
        of_line = Separator::ALL.to_vec();
    }
    of_line.retain(|s| *s != Separator::Blanks);
    for &separator in &of_line {
        let mut rows = lines.rows(separator);
        let Ok(Some(row)) = rows.read() else { continue };
        let has = |c: &Column| row.cells.iter().any(|cell| Head::of(cell).name == c.name);
        if wanted.iter().filter(|c| c.required).all(has) {
            return Ok(separator);
        }
    }
    // A comma that parts nothing is a decimal sign.
    let single = Separator::Semicolon;
    Ok(of_line.first().copied().unwrap_or(single))
}

/// The header, its line, and the line behind which data begins: instruments write a row of units below the names.
fn header(
    lines: &Lines,
    separator: Separator,
    wanted: &[Column],
) -> Result<(Vec<Head>, usize, usize), RowError> {
    let mut rows = lines.rows(separator);
    let Some(row) = rows.read()? else {
        return Err(RowError::at(
            0,
            format!("is empty; expected {}", example(wanted)),
        ));
    };
    let line = row.line;
    // What stands in parentheses may be a remark.
    let known = |h: &Head| h.certain || h.unit.as_ref().is_some_and(|u| parse_unit(u).is_ok());
    let whole = |cell: &str| Head {
        name: cell.to_owned(),
        unit: None,
        certain: false,
    };
    let named = row.cells.iter().map(|cell| {
        Some(Head::of(cell))
            .filter(known)
            .unwrap_or_else(|| whole(cell))
    });
    let mut heads: Vec<Head> = named.collect();
    if heads.iter().any(|h| h.unit.is_some()) {
        return Ok((heads, line, line));
    }
    let names_of = heads.iter().map(|h| h.name.clone()).collect::<Vec<_>>();
    if let Some(row) = rows.read()? {
        let bare = |cell: &str| {
            let inner = cell
                .trim_start_matches(['[', '('])
                .trim_end_matches([']', ')']);
            inner.trim().to_owned()
        };
        let is_unit = |cell: &str| {
            let unit = bare(cell);
            let number = plain(&unit, Decimal::Point).or(plain(&unit, Decimal::Comma));
            (cell.is_empty() || (unit != cell && unit == "1") || number.is_none())
                && parse_unit(&unit).is_ok()
        };
        if row.cells.len() <= heads.len() && row.cells.iter().all(is_unit) {
            for (head, cell) in heads.iter_mut().zip(row.cells.iter()) {
                head.unit = Some(bare(cell)).filter(|u| !u.is_empty());
                head.certain = true;
            }
            return Ok((heads, line, row.line));
        }
    }
    Err(RowError::at(
        line,
        format!(
            "`{}` names no units; expected {}",
            names(names_of.iter().map(String::as_str)),
            example(wanted)
        ),
    ))
}

fn heading(column: &Column) -> String {
    let example = column.dimension.example();
    let unit = example.split_once(' ').map_or("1", |e| e.1);
    format!("{} [{unit}]", column.name)
}

/// The unit of a column that is read.
fn unit_of(head: &Head, column: &Column, line: usize) -> Result<String, RowError> {
    let what = column.dimension.with_article();
    let say = |e: String| {
        let problem = format!(
            "column '{}': {e}; expected {what}, such as `{}`",
            column.name,
            heading(column)
        );
        RowError::at(line, problem)
    };
    let Some(unit) = head.unit.as_deref() else {
        return Err(say("has no unit".into()));
    };
    parse_unit_of(unit, column.dimension).map_err(|e| match e {
        plyflow_model::units::UnitError::WrongDimension { got, .. } => say(format!(
            "the unit '{}' does not fit: it is {got}{}",
            shown(unit),
            as_force(&got, column.dimension)
        )),
        e => say(format!("{}: {}", e.reason(), e.help())),
    })?;
    Ok(unit.to_owned())
}

fn pick(heads: &[Head], wanted: &[Column], line: usize) -> Result<Vec<Picked>, RowError> {
    let mut picked = Vec::new();
    for column in wanted {
        let found: Vec<usize> = (0..heads.len())
            .filter(|&i| heads[i].name == column.name)
            .collect();
        let index = match found[..] {
            [] if !column.required => {
                if let Some(head) = heads.iter().find(|h| looks_like(&h.name, column.name)) {
                    return Err(RowError::at(
                        line,
                        format!(
                            "the column '{}' is not one that is read; did you mean `{}`? If not, give it another name",
                            shown(&head.name),
                            heading(column)
                        ),
                    ));
                }
                continue;
            }
            [] => {
                return Err(RowError::at(
                    line,
                    format!(
                        "there is no column '{}'; the header names: {}; expected `{}`",
                        column.name,
                        names(heads.iter().map(|h| h.name.as_str())),
                        heading(column)
                    ),
                ));
            }
            [index] => index,
            _ => {
                let problem = format!("column '{}' stands there more than once", column.name);
                return Err(RowError::at(line, problem));
            }
        };
        picked.push((index, *column, unit_of(&heads[index], column, line)?));
    }
    Ok(picked)
}

/// Test machines tell forces as masses.
fn as_force(got: &str, wanted: Dimension) -> &'static str {
    match wanted {
        Dimension::Force if got == Dimension::Mass.with_article() => {
            " (as a force write `kgf`, `gf` or `lbf`)"
        }
        _ => "",
    }
}

/// Whether a header may stand for an optional column that it does not name: it would be passed over, and nobody told.
fn looks_like(head: &str, name: &str) -> bool {
    head.get(..name.len())
        .is_some_and(|start| start.eq_ignore_ascii_case(name))
}

fn value(text: &str, decimal: Decimal, unit: &str, dimension: Dimension) -> Result<f64, String> {
    let Some(number) = plain(text, decimal) else {
        let text = shown(text);
        let word = text.trim_start_matches(['-', '+']).to_lowercase();
        return Err(match &word[..] {
            "" => "there is no value".to_owned(),
            "nan" | "inf" | "infinity" => {
                format!("'{text}' is not a finite number; leave the row out")
            }
            _ => format!("'{text}' is not a number"),
        });
    };
    if dimension == Dimension::Dimensionless && matches!(unit, "" | "1") {
        return number
            .parse()
            .map_err(|_| format!("'{text}' is not a number"));
    }
    // Through the one reader of units, so that 10 mm and 1 cm are the same bits here too.
    parse_quantity(&format!("{number} {unit}"), dimension).map_err(|e| e.to_string())
}

#[cfg(test)]
#[path = "csv_tests.rs"]
mod tests;
