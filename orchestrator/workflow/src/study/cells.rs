//! The table of a study's points as its file has it: heads, units and cells.

use plyflow_files::number::{Decimal, Signs};
use plyflow_files::rows::{Head, Lines, RowError, Separator};

/// The cells of a table as its file has them.
pub(super) struct Cells {
    /// Line and cells of the head.
    pub(super) heads: (usize, Vec<Head>),
    /// Line and cells of every row.
    pub(super) rows: Vec<(usize, Vec<String>)>,
    /// What parts whole numbers from the rest.
    pub(super) decimal: Decimal,
}

impl Cells {
    /// Reads a table, its bytes as a file has them.
    ///
    /// # Errors
    /// The line of what is no table, and why.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, RowError> {
        let lines = Lines::new(bytes)?;
        let (_, first) =
            (lines.first()).ok_or_else(|| RowError::at(0, "the table has nothing in it"))?;
        // Blanks part words within a cell too, so that they never part cells here.
        let mut signs = Separator::of_line(first).into_iter();
        let sign = signs.find(|s| *s != Separator::Blanks);
        let mut reader = lines.rows(lines.told.or(sign).unwrap_or(Separator::Comma));
        let mut all: Vec<(usize, Vec<String>)> = Vec::new();
        let mut signs = Signs::default();
        while let Some(row) = reader.read()? {
            let cells: Vec<String> = row.cells.iter().map(str::to_owned).collect();
            if let Some((_, heads)) = all.first()
                && cells.len() != heads.len()
            {
                let text = format!(
                    "this row has {} cells, and the head {}",
                    cells.len(),
                    heads.len()
                );
                return Err(RowError::at(row.line, text));
            }
            if !all.is_empty() {
                cells.iter().for_each(|c| signs.note(row.line, c));
            }
            all.push((row.line, cells));
        }
        let decimal = signs
            .decide()
            .map_err(|(line, text)| RowError::at(line, text))?;
        if all.is_empty() {
            return Err(RowError::at(0, "the table has nothing in it"));
        }
        let (line, heads) = all.remove(0);
        let mut heads: Vec<Head> = heads.iter().map(|c| Head::of(c)).collect();
        if let Some(units) = row_of_units(&heads, &all, decimal) {
            for (head, unit) in heads.iter_mut().zip(units) {
                head.unit = Some(unit);
            }
            all.remove(0);
        }
        Ok(Self {
            heads: (line, heads),
            rows: all,
            decimal,
        })
    }
}

/// The units of the columns, where they have a row of their own below the head. Such a row stands above numbers; words above words
/// are values.
fn row_of_units(
    heads: &[Head],
    rows: &[(usize, Vec<String>)],
    decimal: Decimal,
) -> Option<Vec<String>> {
    let [(_, below), (_, next), ..] = rows else {
        return None;
    };
    if heads.iter().any(|h| h.unit.is_some()) {
        return None;
    }
    let number = |cell: &str| plyflow_files::number::plain(cell, decimal).is_some();
    let unit = |cell: &String| {
        cell.trim_matches(['[', ']', '(', ')', '-'])
            .trim()
            .to_owned()
    };
    let units: Vec<String> = below.iter().map(unit).collect();
    let fits = |((cell, unit), next): ((&String, &String), &String)| {
        unit.is_empty()
            || (!number(cell) && number(next) && plyflow_model::units::parse_unit(unit).is_ok())
    };
    let any = units.iter().any(|u| !u.is_empty());
    (any && below.iter().zip(&units).zip(next).all(fits)).then_some(units)
}
