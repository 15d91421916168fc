//! Ply books: tables with a row for each ply, in the order of the layup.

use crate::flaw::Flaw;
use crate::table::{Amount, Cell, Known, Table, TableRow};
use plyflow_model::units::Dimension;
use std::ops::Range;

/// Most plies of a book.
pub const MOST_PLIES: usize = 1000;

const NAME: usize = 0;
const ANGLE: usize = 1;
const MATERIAL: usize = 2;
const OUTLINE: usize = 3;
const LAYER: usize = 4;
const X: usize = 5;
const Y: usize = 6;
const ROTATION: usize = 7;
const TIED: usize = 8;

const fn column(names: &'static [&'static str], of: Option<Dimension>, needed: bool) -> Known {
    Known { names, of, needed }
}

const COLUMNS: [Known; 9] = [
    column(&["name", "ply"], None, true),
    column(&["angle", "orientation"], Some(Dimension::Angle), true),
    column(&["material"], None, false),
    column(&["outline", "outlinefile"], None, false),
    column(&["layer"], None, false),
    column(&["x"], Some(Dimension::Length), false),
    column(&["y"], Some(Dimension::Length), false),
    column(&["rotation"], Some(Dimension::Angle), false),
    column(&["tied"], None, false),
];

/// What a cell of `tied` may say.
const ANSWERS: [(&str, bool); 4] = [
    ("yes", true),
    ("no", false),
    ("true", true),
    ("false", false),
];

/// A row of a book.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Name of the ply.
    pub name: Cell,
    /// Direction of its first fibres, from the scene's x.
    pub angle: Amount,
    /// Its material: a name that the scene knows, or a path from the book.
    pub material: Option<Cell>,
    /// The file of its outline: a path from the book.
    pub outline: Option<Cell>,
    /// The layer of that file.
    pub layer: Option<Cell>,
    /// Where the outline's (0, 0) lies over the tool.
    pub place: [Option<Amount>; 2],
    /// By how much the outline is turned about its (0, 0), counter-clockwise seen from above. The fibres are not turned with it.
    pub rotation: Option<Amount>,
    /// Whether it is tied to the ply below it, and where that stands; `None`: the row does not say.
    pub tied: Option<(bool, Range<usize>)>,
    /// All of the row.
    pub span: Range<usize>,
}

/// A ply book.
#[derive(Debug, Clone, PartialEq)]
pub struct Book {
    /// Its rows, the ply nearest to the tool first.
    pub rows: Vec<Row>,
}

/// Reads a ply book; `text` is what [`crate::flaw::plain`] gives of its file. Angles without a unit are in degrees. Lengths have a unit, in the head or in
/// the cell.
///
/// # Errors
/// All that is wrong with it, each with its place.
pub fn read(text: &str) -> Result<Book, Vec<Flaw>> {
    let table = Table::read(text, &COLUMNS, MOST_PLIES)?;
    let (mut rows, mut flaws): (Vec<Row>, Vec<Flaw>) = (Vec::new(), Vec::new());
    for row in &table.rows {
        let mut amount = |k: usize, unit: Option<&str>| -> Option<Amount> {
            let read = table.amount(k, row.cells[k].as_ref()?, unit);
            read.map_err(|f| flaws.push(f)).ok()
        };
        let angle = amount(ANGLE, Some("deg"));
        let rotation = amount(ROTATION, Some("deg"));
        let place = [amount(X, None), amount(Y, None)];
        let cell = |k: usize| row.cells[k].clone();
        let tied = cell(TIED).and_then(|c| answer(&c).map_err(|f| flaws.push(f)).ok());
        flaws.extend(missing(row));
        let (Some(name), Some(angle)) = (cell(NAME), angle) else {
            continue;
        };
        if let Some(first) = rows.iter().find(|r| r.name.text == name.text) {
            let (line, _) = Flaw::at(first.span.clone(), "").place(text);
            let problem = format!(
                "the name `{}` is taken, by the ply in line {line}",
                crate::text::shown(&name.text)
            );
            flaws.push(
                Flaw::at(name.span.clone(), problem).expected("a name of its own in every row"),
            );
        }
        rows.push(Row {
            name,
            angle,
            material: cell(MATERIAL),
            outline: cell(OUTLINE),
            layer: cell(LAYER),
            place,
            rotation,
            tied,
            span: row.span.clone(),
        });
    }
    if table.rows.is_empty() {
        flaws.push(
            Flaw::at(table.head.clone(), "the book has no ply")
                .expected("a row for each ply below the head"),
        );
    }
    flaws.sort_by_key(|f| f.span.start);
    match flaws.is_empty() {
        true => Ok(Book { rows }),
        false => Err(flaws),
    }
}

/// Yes or no, in small letters or large ones.
fn answer(cell: &Cell) -> Result<(bool, Range<usize>), Flaw> {
    let given = cell.text.to_lowercase();
    let found = ANSWERS.iter().find(|(word, _)| *word == given);
    found
        .map(|(_, is)| (*is, cell.span.clone()))
        .ok_or_else(|| {
            let problem = format!("`tied` is `{}`", crate::text::shown(&cell.text));
            Flaw::at(cell.span.clone(), problem).expected("`yes`, `no`, or nothing")
        })
}

/// What a row leaves open.
fn missing(row: &TableRow) -> Vec<Flaw> {
    let mut flaws = Vec::new();
    for (k, of) in [
        (NAME, "a name of its own in every row"),
        (ANGLE, "the direction of its first fibres, such as `45`"),
    ] {
        if row.cells[k].is_none() {
            let problem = format!("the ply has no `{}`", COLUMNS[k].names[0]);
            flaws.push(Flaw::at(row.span.clone(), problem).expected(of));
        }
    }
    if let (Some(layer), None) = (&row.cells[LAYER], &row.cells[OUTLINE]) {
        let flaw = Flaw::at(layer.span.clone(), "a `layer` without an `outline`");
        flaws.push(flaw.expected("the drawing that the layer is of, in the column `outline`"));
    }
    flaws
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_book_is_read_in_its_order_with_units_as_people_write_them() {
        let text = "# layup of the hat\nname,material,angle,outline,layer,x [mm],y [mm],rotation,tied,note\n\
                    skin,woven,45,skin.dxf,PLY,10,-5,,,first\n\
                    cap,,-45 deg,,,1 cm,,90,Yes,\n\
                    patch,m/ncf.yaml,0.5 rad,patch.csv,,,,0.25 rad,no,\"a, b\"\n";
        let book = read(text).unwrap_or_else(|e| panic!("{e:?}"));
        let names: Vec<&str> = book.rows.iter().map(|r| r.name.text.as_str()).collect();
        assert_eq!(names, ["skin", "cap", "patch"]);
        let [skin, cap, patch] = &book.rows[..] else {
            panic!()
        };
        assert_eq!(skin.angle.text, "45 deg");
        assert_eq!(
            skin.place.each_ref().map(|p| p.as_ref().map(|p| p.si)),
            [Some(0.01), Some(-0.005)]
        );
        assert_eq!(skin.layer.as_ref().map(|c| c.text.as_str()), Some("PLY"));
        assert_eq!(cap.angle.si, (-45.0_f64).to_radians());
        assert_eq!(cap.place[0].as_ref().map(|p| p.text.as_str()), Some("1 cm"));
        assert!(cap.material.is_none() && cap.outline.is_none() && cap.place[1].is_none());
        assert_eq!(patch.rotation.as_ref().map(|r| r.si), Some(0.25));
        let tied = book.rows.iter().map(|r| r.tied.as_ref().map(|t| t.0));
        assert_eq!(tied.collect::<Vec<_>>(), [None, Some(true), Some(false)]);
    }

    #[test]
    fn all_that_is_wrong_is_told_with_line_and_column() {
        let text = "name,angle,outline,layer,x,tied\na,,,,,\nb,steep,,,1,\na,0,,,2 mm,\na,1,,PLY,3 kg,\n,0,,,,\nc,0,,,,below\n";
        let flaws = read(text).unwrap_err();
        let told: Vec<String> = flaws.iter().map(|f| f.of("b.csv", text)).collect();
        let begin = [
            "b.csv:2:1: the ply has no `angle`",
            "b.csv:3:3: `angle` is `steep`, which is no angle",
            "b.csv:3:11: `x` is `1`, without a unit",
            "b.csv:5:1: the name `a` is taken, by the ply in line 4",
            "b.csv:5:6: a `layer` without an `outline`",
            "b.csv:5:10: `x`:",
            "b.csv:6:1: the ply has no `name`",
            "b.csv:7:8: `tied` is `below`",
        ];
        assert_eq!(told.len(), begin.len(), "{told:#?}");
        for (told, begin) in told.iter().zip(begin) {
            assert!(told.starts_with(begin), "{told} is not {begin}");
        }
        assert!(
            read("name,angle\n").unwrap_err()[0]
                .problem
                .contains("no ply")
        );
    }
}
