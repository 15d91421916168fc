//! The plies of a new study: rectangles, plies of one outline, or those of a ply book.

use crate::exit;
use crate::said::Stop;
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_files::book::{self, Row};
use plyflow_files::dxf::{Contours, Fineness, MOST_DRAWN};
use plyflow_files::flaw::{Flaw, plain};
use plyflow_files::open::{self, MOST_WRITTEN};
use plyflow_files::table::Cell;
use plyflow_files::{drawn, turn};
use plyflow_model::outline::Point;

/// What the plies are. Paths are as the study's folder has them.
#[derive(Debug, Clone, PartialEq)]
pub enum Plies {
    /// Rectangles of this length and width (m).
    Rectangles([f64; 2]),
    /// Of one outline, which is drawn in a file.
    Drawn {
        /// The file.
        file: String,
        /// The layer, where that has to be said.
        layer: Option<String>,
        /// One unit of it, as a scene writes it, where the file does not say it.
        unit: Option<String>,
        /// Length and width of the box around it (m).
        size: [f64; 2],
    },
    /// Those of a book.
    Book(Book),
}

/// What a study says of a ply book.
#[derive(Debug, Clone, PartialEq)]
pub struct Book {
    /// Its file.
    pub file: String,
    /// What the book itself tells.
    pub read: Read,
    /// One unit of files that do not say it, as a scene writes it.
    pub unit: Option<String>,
    /// Length and width (m) of plies whose row has no outline.
    pub size: Option<[f64; 2]>,
    /// The material of rows that have none.
    pub material: Option<String>,
    /// What names of materials stand for.
    pub materials: Vec<(String, String)>,
}

/// What a book and the files that it names tell.
#[derive(Debug, Clone, PartialEq)]
pub struct Read {
    /// Its rows.
    pub rows: Vec<Row>,
    /// The box around all plies (m), as the book places them.
    pub span: [Point; 2],
    /// The least length or width of the box around a ply (m).
    pub least: f64,
    /// Whether a file does not say its unit, so that the tool's is taken.
    pub without_unit: bool,
}

impl Plies {
    /// Length and width (m) that the frame has to hold over a tool of this size (m), and the least length or width of a ply.
    pub fn extent(&self, tool: [f64; 3]) -> ([f64; 2], f64) {
        match self {
            Self::Rectangles(size) | Self::Drawn { size, .. } => (*size, size[0].min(size[1])),
            Self::Book(book) => {
                let by = book.read.centre(tool).unwrap_or_default();
                let [low, high] = book.read.span;
                let reach = |k: usize| 2.0 * (low[k] + by[k]).abs().max((high[k] + by[k]).abs());
                ([reach(0), reach(1)], book.read.least)
            }
        }
    }
}

impl Read {
    /// By how much all plies are moved so that their middle lies over the middle of the tool (m), where none of them lies over it.
    pub fn centre(&self, tool: [f64; 3]) -> Option<Point> {
        let [low, high] = self.span;
        let over = (0..2).all(|k| low[k] < 0.5 * tool[k] && high[k] > -0.5 * tool[k]);
        // To the micrometre, as the scene writes it.
        let middle = |k: usize| (-0.5e6 * (low[k] + high[k])).round() * 1e-6;
        (!over).then(|| [middle(0), middle(1)])
    }
}

/// The text of a file that an option names.
fn text_of(option: &str, path: &Utf8Path, most: u64) -> Result<String, Stop> {
    let wrong = |why: String| Stop::new(exit::USAGE, format!("{option} {path}: {why}"));
    let bytes = open::read(path.as_std_path(), most).map_err(|e| wrong(e.to_string()))?;
    match most {
        MOST_DRAWN => drawn::text(&bytes),
        _ => plain(&bytes),
    }
    .map_err(wrong)
}

fn flawed(path: &Utf8Path, text: &str, flaws: &[Flaw]) -> Stop {
    let told: Vec<String> = flaws.iter().map(|f| f.of(path.as_str(), text)).collect();
    Stop::new(exit::USAGE, told.join("\n"))
}

/// The contours of a file; and whether it does not say its unit, so that `unit` (m) counts.
fn contours(text: &str, layer: Option<&str>, unit: f64) -> Result<(Contours, bool), Vec<Flaw>> {
    let fine = Fineness::default();
    drawn::read(text, layer, None, fine).map_or_else(
        |own| match drawn::read(text, layer, Some(unit), fine) {
            Ok(found) => Ok((found, true)),
            // Of a file that is wrong with any unit its own fault is told.
            Err(flaws) => Err(if flaws.len() < own.len() { flaws } else { own }),
        },
        |found| Ok((found, false)),
    )
}

/// The outline of a drawing: whether the tool's unit (m) has to count for it, and the size of the box around it (m).
///
/// # Errors
/// [`exit::USAGE`] with what is wrong with the file, and where.
pub fn drawing(path: &Utf8Path, layer: Option<&str>, unit: f64) -> Result<(bool, [f64; 2]), Stop> {
    let text = text_of("--dxf", path, MOST_DRAWN)?;
    let (found, without_unit) = contours(&text, layer, unit).map_err(|flaws| {
        let mut stop = flawed(path, &text, &flaws);
        if layer.is_none() && flaws.iter().any(|f| f.problem.contains("layers")) {
            stop.text += "; say --layer LAYER";
        }
        stop
    })?;
    let [low, high] = found.bounds();
    Ok((without_unit, [high[0] - low[0], high[1] - low[1]]))
}

fn rows_of(path: &Utf8Path, text: &str) -> Result<Vec<Row>, Stop> {
    let book = book::read(text).map_err(|flaws| flawed(path, text, &flaws))?;
    Ok(book.rows)
}

/// The rows of a book, without what they name.
///
/// # Errors
/// [`exit::USAGE`] with what is wrong with the book, and where.
pub fn rows(path: &Utf8Path) -> Result<Vec<Row>, Stop> {
    rows_of(path, &text_of("--plies", path, MOST_WRITTEN)?)
}

/// Reads a book; `size`: of plies whose row has no outline (m), `unit`: of files that do not say it (m).
///
/// # Errors
/// [`exit::USAGE`] with what is wrong with the book or a file that it names, and where.
pub fn read(path: &Utf8Path, size: Option<[f64; 2]>, unit: f64) -> Result<Read, Stop> {
    let text = text_of("--plies", path, MOST_WRITTEN)?;
    let rows = rows_of(path, &text)?;
    let mut read = Read {
        rows: Vec::new(),
        span: [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]],
        least: f64::INFINITY,
        without_unit: false,
    };
    for row in &rows {
        let at_row = |span: &std::ops::Range<usize>, problem: String| {
            let flaw = Flaw::at(span.clone(), problem);
            flawed(path, &text, &[flaw])
        };
        let outline = match (&row.outline, size) {
            (Some(cell), _) => {
                let file = beside(path, cell);
                let opened = open::read(file.as_std_path(), MOST_DRAWN);
                let bytes = opened
                    .map_err(|e| at_row(&cell.span, format!("cannot read `{}`: {e}", cell.text)))?;
                let drawing = drawn::text(&bytes)
                    .map_err(|e| at_row(&cell.span, format!("cannot read `{}`: {e}", cell.text)))?;
                let layer = row.layer.as_ref().map(|l| l.text.as_str());
                let (found, without_unit) = contours(&drawing, layer, unit)
                    .map_err(|flaws| flawed(&file, &drawing, &flaws))?;
                read.without_unit |= without_unit;
                found.outline
            }
            (None, Some([l, w])) => vec![
                [-0.5 * l, -0.5 * w],
                [0.5 * l, -0.5 * w],
                [0.5 * l, 0.5 * w],
                [-0.5 * l, 0.5 * w],
            ],
            (None, None) => {
                let problem = format!(
                    "the ply `{}` has no outline; name its file there, or say how large such plies are: --ply '400 x 200 mm'",
                    row.name.text
                );
                return Err(at_row(&row.span, problem));
            }
        };
        read.add(row, &outline);
    }
    read.rows = rows;
    Ok(read)
}

impl Read {
    /// Counts an outline in its place.
    fn add(&mut self, row: &Row, outline: &[Point]) {
        let angle = row.rotation.as_ref().map_or(0.0, |r| r.si);
        let place = [0, 1].map(|k| row.place[k].as_ref().map_or(0.0, |p| p.si));
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for p in outline {
            let p = turn::turned(*p, angle);
            for k in 0..2 {
                (low[k], high[k]) = (low[k].min(p[k] + place[k]), high[k].max(p[k] + place[k]));
            }
        }
        for k in 0..2 {
            self.span[0][k] = self.span[0][k].min(low[k]);
            self.span[1][k] = self.span[1][k].max(high[k]);
            self.least = self.least.min(high[k] - low[k]);
        }
    }
}

/// A file that a cell names: its path is relative to the book.
pub fn beside(book: &Utf8Path, cell: &Cell) -> Utf8PathBuf {
    book.parent().unwrap_or(Utf8Path::new("")).join(&cell.text)
}

/// What a book's material is.
#[derive(Debug, Clone, PartialEq)]
pub enum Named {
    /// A file beside the book.
    File(Utf8PathBuf),
    /// One that comes along under that name, or is to be that of `--material`.
    Name(String),
}

/// The materials that the rows of a book name, each once and in their order; and whether a row has none.
pub fn materials(book: &Utf8Path, rows: &[Row]) -> (Vec<Named>, bool) {
    let mut found = Vec::new();
    for cell in rows.iter().filter_map(|r| r.material.as_ref()) {
        let file = beside(book, cell);
        let named = match file.is_file() {
            true => Named::File(file),
            false => Named::Name(cell.text.clone()),
        };
        if !found.contains(&named) {
            found.push(named);
        }
    }
    (found, rows.iter().any(|r| r.material.is_none()))
}
