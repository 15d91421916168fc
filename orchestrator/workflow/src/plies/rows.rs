//! The rows of a ply book as sheets of the scene.

use super::{Filler, corners, entry_mut, length, list, moved, text};
use crate::named::named;
use crate::yaml::{Entry, Kind, Node, Span};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_files::book::{self, Row};
use plyflow_files::open::MOST_WRITTEN;
use plyflow_files::table::Cell;
use plyflow_files::text::shown;
use plyflow_files::turn;
use plyflow_model::book::PlyBook;
use plyflow_model::contour::{Contour, Drawing};
use plyflow_model::outline::Point;
use plyflow_model::units::{Angle, Length, si_number};
use serde_json::Value;
use std::f64::consts::FRAC_PI_2;

/// What a ply book's entry in the scene says, and where.
struct Entered<'n> {
    node: &'n Node,
    book: PlyBook,
    /// The folder of the book, as the scene writes it.
    folder: Utf8PathBuf,
    /// Where the places of the book are counted on from.
    base: usize,
}

impl Filler<'_> {
    /// Adds the plies of a book.
    pub(super) fn book(&mut self, node: &Node, sheets: &mut Vec<Node>) {
        let mut node = node.clone();
        let Ok(book) = serde_json::from_value::<PlyBook>(node.to_json()) else {
            // The schema check has spoken.
            self.sound = false;
            return;
        };
        self.contours_of(&mut node);
        let span = node.get("book").map_or(&node.span, |b| &b.span).clone();
        let Some((text, base)) = self.text(&book.book, &span, MOST_WRITTEN) else {
            return;
        };
        let folder = Utf8Path::new(&book.book).parent();
        let entered = Entered {
            folder: folder.unwrap_or(Utf8Path::new("")).to_owned(),
            node: &node,
            book,
            base,
        };
        match book::read(&text) {
            Ok(book) => {
                for row in &book.rows {
                    let sheet = self.ply(&entered, row);
                    sheets.extend(sheet);
                }
            }
            Err(flaws) => flaws.iter().for_each(|f| self.tell(f, base)),
        }
    }

    /// A row as a sheet; `None` when it is wrong (and reported).
    fn ply(&mut self, of: &Entered<'_>, row: &Row) -> Option<Node> {
        let span = moved(&row.span, of.base);
        let before = self.problems.count();
        let material = self.material(of, row);
        let outline = self.shape(of, row);
        if self.problems.count() > before {
            return None;
        }
        let mut entries = Vec::new();
        let mut add = |key: &str, value: Node| {
            entries.push(Entry {
                key: key.into(),
                key_span: value.span.clone(),
                value,
            });
        };
        add(
            "name",
            text(&row.name.text, &moved(&row.name.span, of.base)),
        );
        add("kind", text("ply", &span));
        add("material", material?);
        outline?.into_iter().for_each(|(key, node)| add(key, node));
        let place = [0, 1].map(|k| self.coordinate(of, row, k));
        if place.iter().any(Option::is_some) {
            let place = place.map(|p| p.unwrap_or_else(|| text("0 mm", &span)));
            add("centre", list(place.to_vec(), &span));
        }
        let at = moved(&row.angle.span, of.base);
        add("fibre_1", text(&row.angle.text, &at));
        // A quarter turn on, until the material is known (`cross`).
        add(
            "fibre_2",
            text(turned(&row.angle.text, row.angle.si, FRAC_PI_2), &at),
        );
        if let Some((tied, at)) = &row.tied {
            let (kind, span) = (Kind::Bool(*tied), moved(at, of.base));
            add("tied", Node { kind, span });
        }
        Some(Node {
            kind: Kind::Map(entries),
            span,
        })
    }

    /// A coordinate of a ply's place, moved as the scene says.
    fn coordinate(&self, of: &Entered<'_>, row: &Row, k: usize) -> Option<Node> {
        let own = row.place[k].as_ref();
        let by = of.book.centre[k].si();
        let span = own.map_or(&row.span, |a| &a.span);
        let span = moved(span, of.base);
        match (own, by == 0.0) {
            (None, true) => None,
            (Some(own), true) => Some(text(&own.text, &span)),
            (None, false) => of.node.get("centre")?.items().get(k).cloned(),
            // To the picometre, as tools are placed: 10 mm and -100 mm are -90 mm.
            (Some(own), false) => Some(length(((own.si + by) * 1e12).round() / 1e12, &span)),
        }
    }

    fn material(&mut self, of: &Entered<'_>, row: &Row) -> Option<Node> {
        let Some(cell) = &row.material else {
            let given = of.node.get("material");
            if given.is_none() {
                let message = format!("the ply `{}` has no material", shown(&row.name.text));
                self.wrong(
                    &moved(&row.span, of.base),
                    message,
                    "one in the column `material`, or `material` beside `book` in the scene",
                );
            }
            return given.cloned();
        };
        if let Some(meant) = of.node.get("materials").and_then(|m| m.get(&cell.text)) {
            return Some(meant.clone());
        }
        let (file, span) = self.path(of, cell);
        let names: Vec<&str> = of.book.materials.keys().map(String::as_str).collect();
        let there = named(self.problems, &self.source.folder, &file).is_file();
        if there || (names.is_empty() && Utf8Path::new(&file).extension().is_some()) {
            return Some(text(file, &span));
        }
        let message = format!("there is no material `{}`", shown(&cell.text));
        self.sound = false;
        let d = self.problems.add(&self.source, &span, message);
        d.given(cell.text.clone());
        match names.is_empty() {
            true => {
                d.expected("the path of a material file from the book, or a name that `materials` beside `book` in the scene has");
            }
            false => {
                d.suggest(&cell.text, names);
                d.expected("a name that `materials` beside `book` in the scene has, or the path of a material file from the book");
            }
        }
        None
    }

    /// A path of a cell, as the scene would write it, and where it stands.
    fn path(&self, of: &Entered<'_>, cell: &Cell) -> (String, Span) {
        let path = of.folder.join(&cell.text);
        (path.into_string(), moved(&cell.span, of.base))
    }

    /// Outline and holes of a ply, or its length and width; `None` when they are wrong (and reported).
    fn shape(&mut self, of: &Entered<'_>, row: &Row) -> Option<Vec<(&'static str, Node)>> {
        let angle = row.rotation.as_ref().map_or(0.0, |r| r.si);
        if let Some(cell) = &row.outline {
            let (file, span) = self.path(of, cell);
            let drawing = Drawing {
                file,
                layer: row.layer.as_ref().map(|l| l.text.clone()),
                unit: of.book.unit,
                tolerance: of.book.tolerance,
                chord: of.book.chord,
                centred: false,
            };
            let found = self.contours(&drawing, &span)?;
            return Some(shape_of(&found.outline, &found.holes, angle, &span));
        }
        let Some(entries) = given_shape(of.node) else {
            let message = format!("the ply `{}` has no outline", shown(&row.name.text));
            let expected = "a file in the column `outline`, or `length` and `width`, or `outline`, beside `book` in the scene";
            self.wrong(&moved(&row.span, of.base), message, expected);
            return None;
        };
        let Some(rotation) = row.rotation.as_ref().filter(|_| angle != 0.0) else {
            return Some(entries);
        };
        let span = moved(&rotation.span, of.base);
        let read = |node: &Node| serde_json::from_value::<Contour>(node.to_json()).ok();
        let all: Option<Vec<Contour>> = match (of.book.length, of.book.width) {
            (Some(l), Some(w)) => Some(vec![rectangle(l, w)]),
            _ => {
                let holes = of.node.get("holes").map_or(&[][..], Node::items);
                of.node
                    .get("outline")
                    .into_iter()
                    .chain(holes)
                    .map(read)
                    .collect()
            }
        };
        let all = all?;
        if all.iter().any(|c| c.unread().is_some()) {
            let message = "an outline of another step is not turned by `rotation`".to_owned();
            self.wrong(
                &span,
                message,
                "`rotation` empty or 0, and the outline turned in the step that makes it",
            );
            return None;
        }
        let mut all = all.iter().map(Contour::corners);
        let outline = all.next()?;
        Some(shape_of(&outline, &all.collect::<Vec<_>>(), angle, &span))
    }
}

fn rectangle(length: Length, width: Length) -> Contour {
    let (l, w) = (0.5 * length.si(), 0.5 * width.si());
    Contour::of(&[[-l, -w], [l, -w], [l, w], [-l, w]])
}

/// The shape that the scene gives to plies whose row has none.
fn given_shape(node: &Node) -> Option<Vec<(&'static str, Node)>> {
    let keys = ["length", "width", "outline", "holes"];
    let found = keys
        .into_iter()
        .filter_map(|k| Some((k, node.get(k)?.clone())));
    Some(found.collect()).filter(|f: &Vec<_>| !f.is_empty())
}

fn shape_of(
    outline: &[Point],
    holes: &[Vec<Point>],
    angle: f64,
    span: &Span,
) -> Vec<(&'static str, Node)> {
    let place = |all: &[Point]| -> Node {
        match angle == 0.0 {
            true => corners(all, span),
            false => corners(
                &all.iter()
                    .map(|p| turn::turned(*p, angle))
                    .collect::<Vec<_>>(),
                span,
            ),
        }
    };
    let mut shape = vec![("outline", place(outline))];
    if !holes.is_empty() {
        shape.push((
            "holes",
            list(holes.iter().map(|h| place(h)).collect(), span),
        ));
    }
    shape
}

/// The direction that lies `by` (rad) on from an angle of `si` (rad), which is written as `given`: as a scene writes it.
fn turned(given: &str, si: f64, by: f64) -> String {
    let degrees = ["deg", "\u{b0}"]
        .iter()
        .find_map(|u| given.strip_suffix(u)?.trim().parse::<f64>().ok());
    match degrees {
        // 90 deg is 90 deg again, and not what rounding has made of it on the way through radians.
        Some(degrees) => {
            let on = (by.to_degrees() * 1e9).round() / 1e9;
            format!("{} deg", si_number(degrees + on))
        }
        None => Angle(si + by).to_string(),
    }
}

/// Lays the second fibres of plies whose book has one angle for both families as their material says.
pub(crate) fn cross(scene: &mut Node, materials: &[Option<Value>]) {
    let Some(Entry { value, .. }) = entry_mut(scene, "sheets") else {
        return;
    };
    let Kind::List(sheets) = &mut value.kind else {
        return;
    };
    for (sheet, material) in sheets.iter_mut().zip(materials) {
        let crossing = material
            .as_ref()
            .and_then(|m| m["with"]["crossing"].as_f64());
        let first = sheet.get("fibre_1").cloned();
        let (Some(by), Some(first), Some(second)) = (crossing, first, entry_mut(sheet, "fibre_2"))
        else {
            continue;
        };
        // Both stand at one place: the book has said one.
        let Some(given) = first.text().filter(|_| first.span == second.value.span) else {
            continue;
        };
        if let Ok(angle) = given.parse::<Angle>() {
            second.value = text(turned(given, angle.si(), by), &first.span);
        }
    }
}
