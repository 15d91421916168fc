//! Tables in text: rows of cells parted by tabs, semicolons, commas, bars or blanks, with quotes, comments and a header.
//!
//! The grammar within a line is that of the crate `csv`. Around it are the dialects of the field: any encoding and line ends, comments,
//! `sep=;` of spreadsheets, separators and units as the header has them.

use crate::text::{LONGEST_MESSAGE, decode, excerpt, lines, shown};
use std::borrow::Cow;

/// What parts the cells of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Separator {
    /// One tab.
    Tab,
    /// `;`
    Semicolon,
    /// `,`
    Comma,
    /// `|`
    Bar,
    /// Blanks and tabs, any number of them: no cell is empty.
    Blanks,
}

impl Separator {
    /// All, the likeliest first.
    pub const ALL: [Separator; 5] = [
        Separator::Tab,
        Separator::Semicolon,
        Separator::Comma,
        Separator::Bar,
        Separator::Blanks,
    ];

    const fn sign(self) -> u8 {
        match self {
            Separator::Tab => b'\t',
            Separator::Semicolon => b';',
            Separator::Comma => b',',
            Separator::Bar => b'|',
            Separator::Blanks => b' ',
        }
    }

    /// In words, such as `semicolons`.
    pub const fn words(self) -> &'static str {
        match self {
            Separator::Tab => "tabs",
            Separator::Semicolon => "semicolons",
            Separator::Comma => "commas",
            Separator::Bar => "bars",
            Separator::Blanks => "blanks",
        }
    }

    /// Those that stand in a line outside of quotes and brackets, the likeliest first.
    pub fn of_line(line: &str) -> Vec<Separator> {
        let (mut quoted, mut depth) = (false, 0i32);
        let mut there = [false; 128];
        for b in line.trim().bytes() {
            match b {
                b'"' => quoted = !quoted,
                b'[' | b'(' if !quoted => depth += 1,
                b']' | b')' if !quoted => depth -= 1,
                b if !quoted && depth <= 0 && b.is_ascii() => there[usize::from(b)] = true,
                _ => {}
            }
        }
        let blank = there[usize::from(b' ')] || there[usize::from(b'\t')];
        let found = |s: &Separator| match s {
            Separator::Blanks => blank,
            s => there[usize::from(s.sign())],
        };
        Separator::ALL.into_iter().filter(found).collect()
    }
}

/// Why a table is not read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{problem}")]
pub struct RowError {
    /// Line in the file, from 1; 0 where it is the whole file.
    pub line: usize,
    /// A sentence.
    pub problem: String,
}

impl RowError {
    /// At a line. The sentence is shown as any text of a user's is: [`excerpt`].
    pub fn at(line: usize, problem: impl Into<String>) -> Self {
        let problem = excerpt(&problem.into(), LONGEST_MESSAGE);
        Self { line, problem }
    }

    /// `file:line: sentence`.
    pub fn of(&self, file: &str) -> String {
        match self.line {
            0 => format!("{file}: {}", self.problem),
            line => format!("{file}:{line}: {}", self.problem),
        }
    }
}

/// A file of rows, decoded, without its comments.
#[derive(Debug, Clone, PartialEq)]
pub struct Lines {
    /// Line ends as `\n`; comments are empty lines here, so that every line keeps its number.
    text: String,
    /// Lines that begin with `#`, `//` or `%`, without these signs.
    pub comments: Vec<(usize, String)>,
    /// What a first line `sep=;` says.
    pub told: Option<Separator>,
}

impl Lines {
    /// Decodes a file.
    ///
    /// # Errors
    /// When it is no text.
    pub fn new(bytes: &[u8]) -> Result<Self, RowError> {
        let decoded = decode(bytes).map_err(|e| RowError::at(0, e))?;
        let mut read = Lines {
            text: String::with_capacity(decoded.len() + 1),
            comments: Vec::new(),
            told: None,
        };
        let mut first = true;
        for (number, line) in lines(&decoded) {
            let content = line.trim();
            if let Some(words) = comment(content) {
                read.comments.push((number, words.to_owned()));
            } else if first && let Some(told) = told(content) {
                (read.told, first) = (Some(told), false);
            } else {
                first &= content.is_empty();
                read.text.push_str(line);
            }
            read.text.push('\n');
        }
        Ok(read)
    }

    /// The first line with something in it, and its number.
    pub fn first(&self) -> Option<(usize, &str)> {
        self.all().find(|l| !l.1.trim().is_empty())
    }

    /// Its lines; comments are empty ones.
    pub fn all(&self) -> impl Iterator<Item = (usize, &str)> {
        lines(&self.text)
    }

    /// Its rows.
    pub fn rows(&self, separator: Separator) -> Rows<'_> {
        let text = match separator {
            // Blanks of either kind are the same, however many.
            Separator::Blanks => Cow::Owned(self.text.replace('\t', " ")),
            _ => Cow::Borrowed(&self.text[..]),
        };
        let reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .delimiter(separator.sign())
            .from_reader(Bytes { text, at: 0 });
        Rows {
            reader,
            record: Cells::new(),
            separator,
            header_read: false,
        }
    }
}

/// What stands behind the sign of a comment. Spreadsheets put quotes around a line that has separators in it.
fn comment(line: &str) -> Option<&str> {
    let line = line.strip_prefix('"').unwrap_or(line).trim_start();
    let signs = ["#", "//", "%"];
    let words = signs.iter().find_map(|s| line.strip_prefix(s))?;
    Some(words.trim_start_matches(['#', '/', '%']).trim())
}

/// What `sep=;`, which some spreadsheets write first, says.
fn told(line: &str) -> Option<Separator> {
    let line = line.trim_matches('"');
    let sign = line.get(..4).filter(|s| s.eq_ignore_ascii_case("sep="))?;
    let sign = &line[sign.len()..];
    let all = Separator::ALL.into_iter();
    let mut found =
        all.filter(|s| sign.as_bytes() == [s.sign()] || (sign == "\\t" && *s == Separator::Tab));
    found.next()
}

/// A text to read from.
struct Bytes<'t> {
    text: Cow<'t, str>,
    at: usize,
}

impl std::io::Read for Bytes<'_> {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        let read = (&self.text.as_bytes()[self.at..]).read(into)?;
        self.at += read;
        Ok(read)
    }
}

/// Reads rows one after the other; those without anything in them are passed over.
pub struct Rows<'t> {
    reader: csv::Reader<Bytes<'t>>,
    record: Cells,
    separator: Separator,
    header_read: bool,
}

/// The cells of a row.
pub type Cells = csv::StringRecord;

/// One row.
#[derive(Debug, Clone, Copy)]
pub struct Row<'r> {
    /// Line in the file, from 1.
    pub line: usize,
    /// Without blanks and quotes around them.
    pub cells: &'r Cells,
}

impl Rows<'_> {
    /// The next row, if there is one.
    ///
    /// # Errors
    /// When a quotation is not closed in its line: it would swallow the lines behind it. The first row, a header, may have one over several lines.
    pub fn read(&mut self) -> Result<Option<Row<'_>>, RowError> {
        loop {
            let read = self.reader.read_record(&mut self.record);
            let after = self.reader.position().line() as usize;
            if !read.map_err(|e| RowError::at(after, e.to_string()))? {
                return Ok(None);
            }
            let within: usize = (self.record.iter())
                .map(|c| c.bytes().filter(|b| *b == b'\n').count())
                .sum();
            // Only now: a line end at the edge of a cell counts, too.
            self.record.trim();
            // A quotation that goes on to the end of the file has the last line end in itself.
            let begun = self.record.position().map_or(0, |p| p.line() as usize);
            let line = (after - 1).saturating_sub(within).max(begun);
            if within > 0 && (self.header_read || self.record.iter().any(|c| c.len() > 200)) {
                return Err(RowError::at(
                    line,
                    "a quotation mark is not closed in this line; close or remove it",
                ));
            }
            if self.separator == Separator::Blanks {
                self.record = self.record.iter().filter(|c| !c.is_empty()).collect();
            }
            if self.record.iter().all(str::is_empty) {
                continue;
            }
            self.header_read = true;
            let cells = &self.record;
            return Ok(Some(Row { line, cells }));
        }
    }
}

/// A cell of a header.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Head {
    /// Without the unit.
    pub name: String,
    /// As it stands in brackets, in parentheses, or behind a stroke between blanks: `x [mm]`, `x (mm)`, `x / mm`.
    pub unit: Option<String>,
    /// Whether it stands in brackets: then it is a unit, and not a remark.
    pub certain: bool,
}

impl Head {
    /// Reads a cell.
    pub fn of(cell: &str) -> Self {
        let text = cell.split_whitespace().collect::<Vec<_>>().join(" ");
        let text = text.trim_matches(['"', '\'', '\u{feff}']).trim();
        let named = |name: &str, unit: &str, certain| Head {
            name: name.trim().to_owned(),
            unit: Some(unit.trim().to_owned()),
            certain,
        };
        if let Some((name, rest)) = text.split_once('[') {
            return named(name, rest.trim_end_matches(']'), true);
        }
        if let Some((name, rest)) = text.strip_suffix(')').and_then(|t| t.rsplit_once('(')) {
            return named(name, rest, false);
        }
        if let Some((name, rest)) = text.split_once(" / ") {
            return named(name, rest, false);
        }
        Head {
            name: text.to_owned(),
            unit: None,
            certain: false,
        }
    }
}

/// Names of columns as a message shows them: at most twelve, each of bounded length.
pub fn names<'a>(all: impl IntoIterator<Item = &'a str>) -> String {
    let all: Vec<&str> = all.into_iter().collect();
    let mut told: Vec<String> = all.iter().take(12).map(|n| shown(n)).collect();
    if all.len() > 12 {
        told.push(format!("and {} more", all.len() - 12));
    }
    told.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(text: &str, separator: Separator) -> Result<Vec<(usize, Vec<String>)>, RowError> {
        let lines = Lines::new(text.as_bytes())?;
        let mut rows = lines.rows(separator);
        let mut found = Vec::new();
        while let Some(row) = rows.read()? {
            found.push((row.line, row.cells.iter().map(str::to_owned).collect()));
        }
        Ok(found)
    }

    #[test]
    fn rows_keep_their_lines_in_every_dialect() {
        let wanted = [
            (3, vec!["a b".to_owned(), "c".to_owned()]),
            (6, vec!["1".to_owned(), "2.5".to_owned()]),
            (7, vec!["3".to_owned(), "4".to_owned()]),
        ];
        for (sign, separator) in [
            (";", Separator::Semicolon),
            (",", Separator::Comma),
            ("\t", Separator::Tab),
            ("|", Separator::Bar),
        ] {
            let text = format!(
                "# one \"quote\n\n\"a b\"{sign} c\n  // more\n\"#x{sign}y\"\n 1 {sign}\"2.5\"\n3{sign}4\n{sign}\n"
            );
            for end in ["\n", "\r\n", "\r"] {
                let found = all(&text.replace('\n', end), separator).unwrap();
                assert_eq!(found, wanted, "{sign} {end:?}");
            }
        }
        let found = all("#\n\n  \"a b\"\tc\n\n\n1   2.5 \n 3\t 4", Separator::Blanks).unwrap();
        assert_eq!(found, wanted);
    }

    #[test]
    fn a_header_may_have_line_ends_and_a_quotation_that_swallows_rows_is_refused() {
        let found = all("\"force\n[N]\",b\n1,2\n", Separator::Comma).unwrap();
        assert_eq!(found[0], (1, vec!["force\n[N]".into(), "b".into()]));
        assert_eq!(found[1].0, 3);
        for (text, line) in [
            ("a,b\n1,2\n3,\"x\n4,y\n5,z\n", 3),
            ("a,b\n1,\"x\n2,y\"\n3,z\n", 2),
            ("a,b\n1,\"\n2,y\"\n3,z\n", 2),
            ("a,b\n1,\"x\n\"\n3,z\n", 2),
        ] {
            assert_eq!(all(text, Separator::Comma).unwrap_err().line, line);
        }
    }

    #[test]
    fn separators_are_those_outside_of_quotes_and_brackets() {
        use Separator::*;
        let of = Separator::of_line;
        assert_eq!(of("a [N, mm];\"b,c\""), [Semicolon, Blanks]);
        assert_eq!(of("a\tb, c"), [Tab, Comma, Blanks]);
        assert_eq!(of("a b"), [Blanks]);
        assert_eq!(of("a"), []);
        assert_eq!(
            Lines::new(b"\xef\xbb\xbfsep=;\na;b\n").unwrap().told,
            Some(Semicolon)
        );
    }

    #[test]
    fn units_of_a_header_are_read_as_people_write_them() {
        for (cell, name, unit) in [
            ("force [N]", "force", Some("N")),
            (" \"force\n[ kN ]\" ", "force", Some("kN")),
            ("shear angle (deg)", "shear angle", Some("deg")),
            ("x / mm", "x", Some("mm")),
            ("N/m", "N/m", None),
            ("plain", "plain", None),
        ] {
            let head = Head::of(cell);
            assert_eq!(
                (head.name.as_str(), head.unit.as_deref()),
                (name, unit),
                "{cell}"
            );
        }
    }
}
