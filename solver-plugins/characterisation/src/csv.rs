//! CSV files of raw test data: `#` comment lines, one header line `name [unit],name [unit]`, rows of numbers.
//!
//! Everything that is wrong is an error with file, line and column: a test that is read wrongly gives a
//! law that looks right.

use plyflow_model::units::{Dimension, parse_quantity, parse_unit};

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
    let bytes = std::fs::read(path).map_err(|e| format!("{path}: cannot be read: {e}"))?;
    let text = String::from_utf8(bytes)
        .map_err(|_| format!("{path}: is not UTF-8 text; save the table as CSV (UTF-8)"))?;
    let name = std::path::Path::new(path)
        .file_name()
        .and_then(|n| n.to_str());
    parse(&text, name.unwrap_or(path), wanted)
}

/// Reads a text; columns that nobody asked for are passed over.
///
/// # Errors
/// A missing or repeated column, one that is nearly an optional one, a missing, unknown or unfit unit, a row of another length, a value that is
/// no finite number: each with `source`, line and column.
pub fn parse(text: &str, source: &str, wanted: &[Column]) -> Result<Table, String> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = (text.lines().enumerate())
        .map(|(i, line)| (i + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    let expected = || {
        let names: Vec<String> = wanted.iter().filter(|c| c.required).map(heading).collect();
        format!("a header line such as `{}`", names.join(","))
    };
    let (header_line, header) = lines
        .next()
        .ok_or_else(|| format!("{source}: is empty; expected {}", expected()))?;
    if !header.contains('[') {
        let text = format!(
            "{source}:{header_line}: `{header}` names no units; expected {}",
            expected()
        );
        return Err(text);
    }
    // What spreadsheets write where the comma is the decimal sign.
    for (sign, word) in [(';', "semicolons"), ('\t', "tabs")] {
        if header.contains(sign) && !header.contains(',') {
            return Err(format!(
                "{source}:{header_line}: the columns of `{}` are separated by {word}; expected commas between columns and a \
                 point in decimals, below {}",
                header.replace('\t', " "),
                expected()
            ));
        }
    }
    let heads: Vec<(&str, &str)> = header.split(',').map(split_head).collect();
    let picked = pick(&heads, wanted, source, header_line)?;
    let mut table = Table {
        source: source.to_owned(),
        lines: Vec::new(),
        columns: (picked.iter())
            .map(|(_, column, unit)| Values {
                name: column.name,
                unit: (*unit).to_owned(),
                values: Vec::new(),
            })
            .collect(),
    };
    for (line, row) in lines {
        let cells: Vec<&str> = row.split(',').map(str::trim).collect();
        if cells.len() != heads.len() {
            let (n, m) = (cells.len(), heads.len());
            return Err(format!(
                "{source}:{line}: {n} values where the header names {m} columns; values are separated by commas, decimals by a point"
            ));
        }
        for ((index, column, unit), into) in picked.iter().zip(&mut table.columns) {
            let value = value(cells[*index], unit, column.dimension)
                .map_err(|e| format!("{source}:{line}: column '{}': {e}", column.name))?;
            into.values.push(value);
        }
        table.lines.push(line);
    }
    Ok(table)
}

fn heading(column: &Column) -> String {
    let example = column.dimension.example();
    let unit = example.split_once(' ').map_or("1", |e| e.1);
    format!("{} [{unit}]", column.name)
}

/// `force [N]` -> (`force`, `N`); no brackets: unit `?`.
fn split_head(head: &str) -> (&str, &str) {
    let head = head.trim().trim_matches('"');
    match head.split_once('[') {
        Some((name, rest)) => (name.trim(), rest.trim_end_matches(']').trim()),
        None => (head, "?"),
    }
}

fn pick<'a>(
    heads: &[(&'a str, &'a str)],
    wanted: &[Column],
    source: &str,
    line: usize,
) -> Result<Vec<(usize, Column, &'a str)>, String> {
    let mut picked = Vec::new();
    for column in wanted {
        let found: Vec<usize> = (0..heads.len())
            .filter(|&i| heads[i].0 == column.name)
            .collect();
        let index = match found[..] {
            [] if !column.required => {
                if let Some((name, _)) = heads.iter().find(|h| looks_like(h.0, column.name)) {
                    return Err(format!(
                        "{source}:{line}: the column '{name}' is not one that is read; did you mean `{}`? If not, give it \
                         another name",
                        heading(column)
                    ));
                }
                continue;
            }
            [] => {
                let names: Vec<&str> = heads.iter().map(|h| h.0).collect();
                return Err(format!(
                    "{source}:{line}: there is no column '{}'; the header names: {}; expected `{}`",
                    column.name,
                    names.join(", "),
                    heading(column)
                ));
            }
            [index] => index,
            _ => {
                return Err(format!(
                    "{source}:{line}: column '{}' stands there more than once",
                    column.name
                ));
            }
        };
        let unit = heads[index].1;
        let what = column.dimension.with_article();
        let say = |e: String| {
            format!(
                "{source}:{line}: column '{}': {e}; expected {what}, such as `{}`",
                column.name,
                heading(column)
            )
        };
        if unit == "?" {
            return Err(say("has no unit".into()));
        }
        let parsed = parse_unit(unit).map_err(|e| say(e.to_string()))?;
        if parsed.exponents != column.dimension.exponents() {
            return Err(say(format!("the unit '{unit}' does not fit")));
        }
        picked.push((index, *column, unit));
    }
    Ok(picked)
}

/// Whether a header may stand for an optional column that it does not name: it would be passed over, and nobody told.
fn looks_like(head: &str, name: &str) -> bool {
    head.get(..name.len())
        .is_some_and(|start| start.eq_ignore_ascii_case(name))
}

fn value(text: &str, unit: &str, dimension: Dimension) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_| match text {
        "" => "there is no value".to_owned(),
        _ => format!("'{text}' is not a number"),
    })?;
    if !number.is_finite() {
        return Err(format!(
            "'{text}' is not a finite number; leave the row out"
        ));
    }
    if dimension == Dimension::Dimensionless && matches!(unit, "" | "1") {
        return Ok(number);
    }
    // Through the one reader of units, so that 10 mm and 1 cm are the same bits here too.
    parse_quantity(&format!("{text} {unit}"), dimension).map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    const WANTED: [Column; 2] = [
        Column::required("displacement", Dimension::Length),
        Column::required("force", Dimension::Force),
    ];

    fn error(text: &str) -> String {
        parse(text, "t.csv", &WANTED).unwrap_err()
    }

    #[test]
    fn values_arrive_in_si_and_keep_their_lines() {
        let text = "\u{feff}# made up\n\nnote [1], force [kN], displacement [mm]\n1,0.002, 10\n# pause\n2,3,1.5e1\n";
        let table = parse(text, "t.csv", &WANTED).unwrap();
        assert_eq!(table.values("displacement").unwrap(), [0.01, 0.015]);
        assert_eq!(table.values("force").unwrap(), [2.0, 3000.0]);
        assert_eq!(table.lines, [4, 6]);
        assert!(table.column("note").is_none());
    }

    #[test]
    fn an_optional_column_that_is_spelt_otherwise_is_not_passed_over() {
        let wanted = [WANTED[0], Column::optional("angle", Dimension::Angle)];
        let read = |head: &str| {
            parse(
                &format!("displacement [mm],{head}\n1,2\n"),
                "t.csv",
                &wanted,
            )
        };
        for head in [
            "Angle [deg]",
            "ANGLE [deg]",
            "angle (deg)",
            "angle_1 [deg]",
            "Angles [deg]",
        ] {
            let e = read(head).unwrap_err();
            assert!(
                e.starts_with("t.csv:1:") && e.contains("did you mean `angle ["),
                "{e}"
            );
        }
        assert!(read("angle [deg]").unwrap().column("angle").is_some());
        assert!(read("force [N]").unwrap().column("angle").is_none());
    }

    #[test]
    fn a_missing_column_is_named_with_those_there_are() {
        let e = error("displacement [mm],load [N]\n1,2\n");
        assert!(
            e.starts_with("t.csv:1: there is no column 'force'")
                && e.contains("displacement, load"),
            "{e}"
        );
    }

    #[test]
    fn a_wrong_an_unknown_and_a_missing_unit_are_located() {
        let e = error("# c\ndisplacement [N],force [N]\n1,2\n");
        assert!(
            e.starts_with("t.csv:2: column 'displacement': the unit 'N' does not fit"),
            "{e}"
        );
        let e = error("displacement [mm],force [bananas]\n1,2\n");
        assert!(e.contains("bananas"), "{e}");
        let e = error("displacement [mm],force\n1,2\n");
        assert!(e.contains("'force': has no unit"), "{e}");
        let e = error("displacement,force\n1,2\n");
        assert!(e.contains("names no units"), "{e}");
    }

    #[test]
    fn what_is_no_finite_number_is_located() {
        for bad in ["NaN", "inf", "abc", "", "1.2.3"] {
            let e = error(&format!("displacement [mm],force [N]\n1,2\n3,{bad}\n"));
            assert!(e.starts_with("t.csv:3: column 'force'"), "{e}");
        }
    }

    #[test]
    fn a_row_of_another_length_is_located() {
        let e = error("displacement [mm],force [N]\n1,2\n1,5,2\n");
        assert!(e.starts_with("t.csv:3: 3 values"), "{e}");
    }

    #[test]
    fn semicolons_and_tabs_between_columns_are_told_with_what_to_write() {
        for (text, word) in [
            ("displacement [mm];force [N]\n0,5;1,2\n", "semicolons"),
            ("# c\ndisplacement [mm]\tforce [N]\n1\t2\n", "tabs"),
        ] {
            let e = error(text);
            assert!(
                e.contains(word)
                    && e.contains("expected commas between columns and a point in decimals"),
                "{e}"
            );
            assert!(e.contains("displacement [mm],force [N]"), "{e}");
        }
    }

    #[test]
    fn a_length_that_is_not_plausible_is_told_with_the_unit_of_its_column() {
        let table = |text: &str| parse(text, "t.csv", &WANTED[..1]).unwrap();
        let judge = |t: Table| t.plausible_length("displacement", [1e-3, 2.0], "a strip");
        assert!(judge(table("displacement [mm]\n1\n-2000\n")).is_ok());
        for (text, says) in [
            (
                "displacement [m]\n1\n97.0\n",
                "t.csv:3: column 'displacement [m]': 97 m",
            ),
            ("displacement [mm]\n0.097\n", "expected 1 mm to 2 m"),
        ] {
            let e = judge(table(text)).unwrap_err();
            assert!(e.contains(says) && e.contains("for a strip"), "{e}");
        }
    }

    #[test]
    fn an_empty_file_says_what_is_expected() {
        let e = error("# nothing\n");
        assert!(e.contains("displacement [mm],force [N]"), "{e}");
    }
}
