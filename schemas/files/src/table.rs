//! Tables with a head whose cells know where they stand, for what people write by hand.

use crate::flaw::Flaw;
use crate::number::{Decimal, Signs, plain};
use crate::rows::{Head, Lines, Row, RowError, Separator, names};
use crate::text::shown;
use plyflow_model::units::{Dimension, parse_quantity, parse_unit_of};
use std::ops::Range;

/// A column that a table may have.
#[derive(Debug, Clone, Copy)]
pub struct Known {
    /// Its name, and other names for the same.
    pub names: &'static [&'static str],
    /// What its values are, where they are quantities.
    pub of: Option<Dimension>,
    /// Whether it must be there.
    pub needed: bool,
}

/// A cell.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    /// Without blanks and quotes around it.
    pub text: String,
    /// Bytes of the text.
    pub span: Range<usize>,
}

/// A quantity of a cell.
#[derive(Debug, Clone, PartialEq)]
pub struct Amount {
    /// As a scene writes it, such as `12.5 mm`.
    pub text: String,
    /// In SI.
    pub si: f64,
    /// Where it stands.
    pub span: Range<usize>,
}

/// A row: for each known column its cell, if there is something in it.
#[derive(Debug, Clone, PartialEq)]
pub struct TableRow {
    /// The cells, in the order of the known columns.
    pub cells: Vec<Option<Cell>>,
    /// All of the row.
    pub span: Range<usize>,
}

/// A table.
#[derive(Debug)]
pub struct Table {
    known: &'static [Known],
    /// For each known column its head, if it is there.
    heads: Vec<Option<Head>>,
    /// Where each of them stands.
    places: Vec<Range<usize>>,
    /// Where the head stands.
    pub head: Range<usize>,
    /// The rows.
    pub rows: Vec<TableRow>,
    decimal: Decimal,
}

/// Letters and digits of a name, small.
fn bare(name: &str) -> String {
    let letters = name.chars().filter(|c| c.is_alphanumeric());
    letters.flat_map(char::to_lowercase).collect()
}

/// The names of all columns.
fn all(known: &[Known]) -> String {
    known
        .iter()
        .map(|k| k.names[0])
        .collect::<Vec<_>>()
        .join(", ")
}

/// The column of a name.
fn position(known: &[Known], name: &str) -> Option<usize> {
    let name = bare(name);
    known
        .iter()
        .position(|k| k.names.iter().any(|n| *n == name))
}

/// What is wrong with a name that is no column's.
fn unknown(known: &[Known], name: &str, span: Range<usize>) -> Option<Flaw> {
    let note = ["note", "notes", "remark", "comment"].contains(&bare(name).as_str());
    if note || name.is_empty() {
        return None;
    }
    let flaw = Flaw::at(span, format!("there is no column `{}`", shown(name)));
    let nearest = plyflow_model::nearest::nearest(name, known.iter().map(|k| k.names[0]));
    let help = nearest.map(|n| format!("did you mean `{n}`?"));
    let help = help.unwrap_or_else(|| "a column for readers is called `note`".to_owned());
    Some(flaw.expected(format!("some of {}", all(known))).help(help))
}

/// What is wrong with the unit of a head.
fn wrong_unit(known: &Known, head: &Head, span: Range<usize>) -> Option<Flaw> {
    let (name, unit) = (known.names[0], head.unit.as_deref()?);
    match known.of {
        _ if unit.is_empty() => None,
        Some(dimension) => {
            let e = parse_unit_of(unit, dimension).err()?;
            let problem = format!("the unit of `{name}`: {}", e.reason());
            Some(Flaw::at(span, problem).help(e.help()))
        }
        None if head.certain => {
            let problem = format!("`{name}` has the unit `{}`", shown(unit));
            Some(Flaw::at(span, problem).expected("no unit, as its values are words"))
        }
        None => None,
    }
}

/// A head; `x_mm` is x in mm too.
fn head(cell: &str, is_quantity: impl Fn(&str, &str) -> bool) -> Head {
    let found = Head::of(cell);
    match found.name.rsplit_once('_') {
        Some((name, unit)) if found.unit.is_none() && is_quantity(name, unit) => Head {
            name: name.to_owned(),
            unit: Some(unit.to_owned()),
            certain: false,
        },
        _ => found,
    }
}

/// Where the cells of a line stand, without blanks and quotes around them.
fn spans(line: &str, separator: Separator) -> Vec<Range<usize>> {
    let sign = |b: u8| match separator {
        Separator::Tab => b == b'\t',
        Separator::Semicolon => b == b';',
        Separator::Comma => b == b',',
        Separator::Bar => b == b'|',
        Separator::Blanks => b == b' ' || b == b'\t',
    };
    let (mut found, mut from, mut quoted) = (Vec::new(), 0, false);
    let ends = line.bytes().enumerate().chain([(line.len(), 0)]);
    for (i, b) in ends {
        quoted ^= b == b'"';
        if i < line.len() && (quoted || !sign(b)) {
            continue;
        }
        let cell = &line[from..i];
        let inner = cell.trim().trim_matches('"').trim();
        if separator != Separator::Blanks || !inner.is_empty() {
            let at = from + cell.find(inner).unwrap_or(0);
            found.push(at..at + inner.len());
        }
        from = i + 1;
    }
    found
}

/// Where lines and cells of a text stand.
struct Places<'t> {
    text: &'t str,
    /// First byte of each line.
    starts: Vec<usize>,
    separator: Separator,
}

impl<'t> Places<'t> {
    fn of(text: &'t str) -> Self {
        let ends = text.bytes().enumerate().filter(|(_, b)| *b == b'\n');
        Self {
            text,
            starts: std::iter::once(0).chain(ends.map(|(i, _)| i + 1)).collect(),
            separator: Separator::Comma,
        }
    }

    /// All of a line (from 1).
    fn line(&self, line: usize) -> Range<usize> {
        let start = self.starts.get(line.max(1) - 1).copied().unwrap_or(0);
        let rest = &self.text[start..];
        start..start + rest.find('\n').unwrap_or(rest.len())
    }

    /// A cell of a line that has so many; all of the line where that is not clear.
    fn cell(&self, line: usize, count: usize, k: usize) -> Range<usize> {
        let whole = self.line(line);
        let cells = spans(&self.text[whole.clone()], self.separator);
        let cell = cells.get(k).filter(|_| cells.len() == count);
        cell.map_or(whole.clone(), |c| {
            whole.start + c.start..whole.start + c.end
        })
    }

    fn flaw(&self, e: RowError) -> Vec<Flaw> {
        vec![Flaw::at(self.line(e.line), e.problem)]
    }
}

impl Table {
    /// Reads a table; `text` is what [`crate::flaw::plain`] gives of its file, `most` the most rows that it may have.
    ///
    /// # Errors
    /// What is wrong with its form, with the place of each.
    pub fn read(text: &str, known: &'static [Known], most: usize) -> Result<Self, Vec<Flaw>> {
        let mut places = Places::of(text);
        let lines = Lines::new(text.as_bytes()).map_err(|e| places.flaw(e))?;
        let Some((first, line)) = lines.first() else {
            let expected = format!("a head with the columns {}, and a row for each", all(known));
            return Err(vec![Flaw::whole("the table is empty").expected(expected)]);
        };
        // Not blanks: names and quantities have some.
        let ways = Separator::of_line(line).into_iter();
        let mut ways = ways.filter(|s| *s != Separator::Blanks);
        places.separator = lines
            .told
            .or_else(|| ways.next())
            .unwrap_or(Separator::Comma);
        let mut rows = lines.rows(places.separator);
        let mut table = Table {
            known,
            heads: vec![None; known.len()],
            places: vec![0..0; known.len()],
            head: places.line(first),
            rows: Vec::new(),
            decimal: Decimal::Point,
        };
        let mut order = Vec::new();
        if let Some(row) = rows.read().map_err(|e| places.flaw(e))? {
            let count = row.cells.len();
            let spans = (0..count).map(|k| places.cell(first, count, k));
            order = table.columns(row.cells.iter().zip(spans))?;
        }
        let (mut flaws, mut signs) = (Vec::new(), Signs::default());
        while let Some(row) = rows.read().map_err(|e| places.flaw(e))? {
            if table.rows.len() >= most {
                let flaw = Flaw::at(
                    places.line(row.line),
                    format!("the table has more than {most} rows"),
                );
                flaws.push(flaw.expected(format!("at most {most}")));
                break;
            }
            match table.row(row, &order, &places, &mut signs) {
                Ok(row) => table.rows.push(row),
                Err(flaw) => flaws.push(flaw),
            }
        }
        match signs.decide() {
            Ok(decimal) => table.decimal = decimal,
            Err((line, problem)) => flaws.push(Flaw::at(places.line(line), problem)),
        }
        match flaws.is_empty() {
            true => Ok(table),
            false => Err(flaws),
        }
    }

    /// A row; `order`: the known column of each cell.
    fn row(
        &self,
        row: Row<'_>,
        order: &[Option<usize>],
        places: &Places<'_>,
        signs: &mut Signs,
    ) -> Result<TableRow, Flaw> {
        let count = row.cells.len();
        let mut cells = vec![None; self.known.len()];
        for (k, text) in row.cells.iter().enumerate().filter(|c| !c.1.is_empty()) {
            let span = places.cell(row.line, count, k);
            let Some(column) = order.get(k) else {
                let problem = format!(
                    "`{}` stands behind the last column of the head",
                    shown(text)
                );
                let flaw =
                    Flaw::at(span, problem).expected(format!("at most {} cells", order.len()));
                return Err(
                    flaw.help("put quotes around a text that has the sign between cells in it")
                );
            };
            if let Some(column) = *column {
                if self.known[column].of.is_some() {
                    signs.note(row.line, number_of(text));
                }
                let text = text.to_owned();
                cells[column] = Some(Cell { text, span });
            }
        }
        let span = places.cell(row.line, count, 0).start..places.line(row.line).end;
        Ok(TableRow { cells, span })
    }

    /// Takes the heads; gives the known column of each. A column `note` is for readers, and has none.
    fn columns<'c>(
        &mut self,
        cells: impl Iterator<Item = (&'c str, Range<usize>)>,
    ) -> Result<Vec<Option<usize>>, Vec<Flaw>> {
        let known = self.known;
        let fits = |name: &str, unit: &str| {
            let of = position(known, name).and_then(|k| known[k].of);
            of.is_some_and(|d| parse_unit_of(unit, d).is_ok())
        };
        let (mut order, mut flaws) = (Vec::new(), Vec::new());
        for (cell, span) in cells {
            let head = head(cell, fits);
            let column = position(known, &head.name);
            order.push(column);
            match column {
                Some(k) if self.heads[k].is_some() => {
                    let problem = format!("two columns are `{}`", known[k].names[0]);
                    flaws.push(Flaw::at(span, problem).expected("one of each"));
                }
                Some(k) => {
                    flaws.extend(wrong_unit(&known[k], &head, span.clone()));
                    (self.heads[k], self.places[k]) = (Some(head), span.clone());
                }
                None => flaws.extend(unknown(known, &head.name, span)),
            }
        }
        let missing = (0..known.len()).filter(|k| known[*k].needed && self.heads[*k].is_none());
        let missing: Vec<&str> = missing.map(|k| known[k].names[0]).collect();
        if !missing.is_empty() && flaws.is_empty() {
            let problem = format!("the head has no column {}", names(missing));
            let flaw = Flaw::at(self.head.clone(), problem);
            flaws.push(flaw.expected(format!("some of {}", all(known))));
        }
        match flaws.is_empty() {
            true => Ok(order),
            false => Err(flaws),
        }
    }

    /// What is wrong where the head of a column has another unit than `given` is.
    pub fn other_unit(&self, column: usize, given: Option<&str>) -> Option<Flaw> {
        let (known, given) = (&self.known[column], given?);
        let told = self.heads[column].as_ref()?.unit.as_deref()?;
        let of = |unit: &str| parse_quantity(&format!("1 {unit}"), known.of?).ok();
        let (own, other) = (of(told)?, of(given)?);
        let same = (own - other).abs() <= 1e-9 * own.abs();
        (!same).then(|| {
            let name = known.names[0];
            let problem = format!(
                "`{name}` has the unit `{}` here, and `unit` says {given}",
                shown(told)
            );
            let flaw = Flaw::at(self.places[column].clone(), problem);
            flaw.expected("one unit of the file")
                .help("correct the one, or leave out the other")
        })
    }

    /// A cell as a quantity of its column: with the unit that it has, with that of the head, or with `else_unit`.
    ///
    /// # Errors
    /// When it is none, or has no unit.
    pub fn amount(
        &self,
        column: usize,
        cell: &Cell,
        else_unit: Option<&str>,
    ) -> Result<Amount, Flaw> {
        let known = &self.known[column];
        let name = known.names[0];
        let dimension = known.of.unwrap_or(Dimension::Dimensionless);
        let unit = self.heads[column]
            .as_ref()
            .and_then(|h| h.unit.as_deref())
            .filter(|u| !u.is_empty());
        let wrong = |problem: String| Flaw::at(cell.span.clone(), problem);
        let number = number_of(&cell.text);
        let Some(number) = plain(number, self.decimal).map(|n| n.into_owned()) else {
            let problem = format!(
                "`{name}` is `{}`, which is no {dimension}",
                shown(&cell.text)
            );
            return Err(wrong(problem).expected(format!(
                "a number with its unit, such as `{}`",
                dimension.example()
            )));
        };
        let own = cell.text[number_of(&cell.text).len()..].trim();
        let Some(unit) = Some(own).filter(|u| !u.is_empty()).or(unit).or(else_unit) else {
            let problem = format!("`{name}` is `{}`, without a unit", shown(&cell.text));
            return Err(wrong(problem).expected(format!(
                "a unit behind the number, or in the head of the column: `{name} [mm]`, say"
            )));
        };
        let text = format!("{number} {unit}");
        match parse_quantity(&text, dimension) {
            Ok(si) => Ok(Amount {
                text,
                si,
                span: cell.span.clone(),
            }),
            Err(e) => Err(wrong(format!("`{name}`: {}", e.reason())).help(e.help())),
        }
    }
}

/// The number that a text begins with.
fn number_of(text: &str) -> &str {
    let text = text.trim();
    let sign = |c: char| c.is_ascii_digit() || ".,+-\u{2212}".contains(c);
    let mut end = text.find(|c| !sign(c)).unwrap_or(text.len());
    // A power of ten.
    let rest = &text[end..];
    let digits = rest
        .strip_prefix(['e', 'E'])
        .map(|r| r.trim_start_matches(['+', '-']));
    if let Some(digits) = digits.filter(|d| d.starts_with(|c: char| c.is_ascii_digit())) {
        let power = digits
            .find(|c: char| !c.is_ascii_digit())
            .unwrap_or(digits.len());
        end += rest.len() - digits.len() + power;
    }
    &text[..end]
}

#[cfg(test)]
mod tests {
    use super::*;

    const KNOWN: [Known; 2] = [
        Known {
            names: &["name"],
            of: None,
            needed: true,
        },
        Known {
            names: &["x"],
            of: Some(Dimension::Length),
            needed: false,
        },
    ];

    #[test]
    fn cells_know_where_they_stand_in_every_dialect() {
        for text in [
            "name,x [mm]\n# a note\n\n\"b, c\" , 12.5\n",
            "x_mm;Name;note\n12,5;b, c;seen\n",
            "name\tx\nb, c\t12.5 mm\n",
            "sep=;\nname;x (mm)\nb, c;12.5\n",
        ] {
            let table = Table::read(text, &KNOWN, 10).unwrap_or_else(|e| panic!("{text}: {e:?}"));
            let [Some(name), Some(x)] = &table.rows[0].cells[..] else {
                panic!("{text}: {:?}", table.rows);
            };
            assert_eq!(
                (name.text.as_str(), &text[name.span.clone()]),
                ("b, c", "b, c"),
                "{text}"
            );
            let amount = table.amount(1, x, None).unwrap();
            assert_eq!(
                (amount.si, amount.text.as_str()),
                (0.0125, "12.5 mm"),
                "{text}"
            );
            assert!(text[x.span.clone()].starts_with("12"), "{text}");
        }
    }

    #[test]
    fn what_a_table_cannot_have_is_told_where_it_stands() {
        let told = |text: &str| {
            let flaws = Table::read(text, &KNOWN, 2).unwrap_err();
            flaws
                .iter()
                .map(|f| f.of("t.csv", text))
                .collect::<Vec<_>>()
                .join("\n")
        };
        for (text, says) in [
            ("", "t.csv:1:1: the table is empty"),
            ("x [mm]\n1\n", "t.csv:1:1: the head has no column name"),
            ("name,nmae\n", "t.csv:1:6: there is no column `nmae`"),
            ("name,colour\n", "a column for readers is called `note`"),
            ("name,x,X [mm]\n", "t.csv:1:8: two columns are `x`"),
            ("name,x [kg]\n", "t.csv:1:6: the unit of `x`"),
            ("name [mm]\n", "t.csv:1:1: `name` has the unit `mm`"),
            (
                "name,x [mm]\na,1,\nb,2,more\n",
                "t.csv:3:5: `more` stands behind the last column",
            ),
            (
                "name\na\nb\nc\n",
                "t.csv:4:1: the table has more than 2 rows",
            ),
            (
                "name;x [mm]\na;1,5\nb;1.5\n",
                "t.csv:2:1: `1,5` has a comma",
            ),
        ] {
            assert!(told(text).contains(says), "{text:?}: {}", told(text));
        }
    }

    #[test]
    fn a_cell_that_is_no_quantity_of_its_column_is_told() {
        for (cell, says) in [
            ("12", "without a unit"),
            ("12 kg", "`x`:"),
            ("wide", "is no length"),
            ("1e999 mm", "is no length"),
            ("12 mn", "`x`:"),
        ] {
            let text = format!("name,x\na,{cell}\n");
            let table = Table::read(&text, &KNOWN, 2).unwrap();
            let flaw = table
                .amount(1, table.rows[0].cells[1].as_ref().unwrap(), None)
                .unwrap_err();
            let told = flaw.of("t.csv", &text);
            assert!(
                told.starts_with("t.csv:2:3: ") && told.contains(says),
                "{told}"
            );
        }
    }
}
