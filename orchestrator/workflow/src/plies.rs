//! The words of a scene that stand for files: the plies of a ply book, contours that are drawn in a file, and directions of a table. What the files say takes the place of
//! these words in the tree, as if it were written there; each value still knows where in which file it stands.

pub(crate) mod rows;
mod steered;

use crate::diagnostics::{Mention, Problems, Source};
use crate::evidence;
use crate::named::{named, unreadable};
use crate::yaml::{Entry, Kind, Node, Span};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_files::drawn;
use plyflow_files::dxf::{Contours, Fineness, MOST_DRAWN};
use plyflow_files::flaw::{Flaw, plain};
use plyflow_files::open;
use plyflow_files::text::shown;
use plyflow_model::contour::Drawing;
use plyflow_model::outline::Point;
use plyflow_model::units::{Dimension, Length, si_text};
use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::Arc;

/// A scene with sheets and corners in the place of files.
pub(crate) struct Filled {
    /// Its tree.
    pub scene: Node,
    /// What the tree's places are in.
    pub source: Source,
    /// Whether all files could be read. What is wrong with them has been reported.
    pub sound: bool,
}

/// A text that has been read, and where its places are counted on from.
type Text = (Arc<String>, usize);

struct Filler<'p> {
    problems: &'p mut Problems,
    source: Source,
    texts: BTreeMap<Utf8PathBuf, Option<Text>>,
    drawings: BTreeMap<String, Option<Rc<Contours>>>,
    sound: bool,
}

/// Puts what files say into a scene; one that names none of them stays as it is.
pub(crate) fn fill(scene: &Node, source: &Source, problems: &mut Problems) -> Filled {
    let sheets = scene.get("sheets").map_or(&[][..], Node::items);
    if !sheets.iter().any(names_files) {
        return Filled {
            scene: scene.clone(),
            source: source.clone(),
            sound: true,
        };
    }
    let mut filler = Filler {
        problems,
        source: source.clone(),
        texts: BTreeMap::new(),
        drawings: BTreeMap::new(),
        sound: true,
    };
    let mut filled = Vec::new();
    for sheet in sheets {
        match sheet.get("plies") {
            Some(plies) => filler.book(plies, &mut filled),
            None => {
                let mut sheet = sheet.clone();
                filler.contours_of(&mut sheet);
                filler.steering_of(&mut sheet);
                filled.push(sheet);
            }
        }
    }
    let mut scene = scene.clone();
    if let Some(entry) = entry_mut(&mut scene, "sheets") {
        entry.value.kind = Kind::List(filled);
    }
    Filled {
        scene,
        source: filler.source,
        sound: filler.sound,
    }
}

fn names_files(sheet: &Node) -> bool {
    let drawn = |c: &Node| c.get("drawing").is_some();
    let all = |key: &str| sheet.get(key).map_or(&[][..], Node::items).iter();
    sheet.get("plies").is_some()
        || sheet
            .get("fibre_1")
            .is_some_and(|f| f.get("table").is_some())
        || sheet.get("outline").is_some_and(drawn)
        || all("holes").any(drawn)
        || all("regions").any(|r| r.get("polygon").is_some_and(drawn))
}

fn entry_mut<'n>(node: &'n mut Node, key: &str) -> Option<&'n mut Entry> {
    match &mut node.kind {
        Kind::Map(entries) => entries.iter_mut().rev().find(|e| e.key == key),
        _ => None,
    }
}

fn text(text: impl Into<String>, span: &Span) -> Node {
    Node {
        kind: Kind::Text(text.into()),
        span: span.clone(),
    }
}

fn list(items: Vec<Node>, span: &Span) -> Node {
    Node {
        kind: Kind::List(items),
        span: span.clone(),
    }
}

fn length(metres: f64, span: &Span) -> Node {
    text(si_text(metres, Dimension::Length), span)
}

/// Corners as a scene lists them.
fn corners(points: &[Point], span: &Span) -> Node {
    let point = |p: &Point| list(p.map(|v| length(v, span)).to_vec(), span);
    list(points.iter().map(point).collect(), span)
}

fn moved(span: &Span, base: usize) -> Span {
    span.start + base..span.end.max(span.start) + base
}

impl Filler<'_> {
    fn tell(&mut self, flaw: &Flaw, base: usize) {
        self.sound = false;
        let span = moved(&flaw.span, base);
        let d = self.problems.add(&self.source, &span, flaw.problem.clone());
        if let Some(expected) = &flaw.expected {
            d.expected(expected.clone());
        }
        if let Some(help) = &flaw.help {
            d.help(help.clone());
        }
    }

    /// Says at a place of the tree what is wrong there.
    fn wrong(&mut self, span: &Span, message: String, expected: &str) {
        self.sound = false;
        let d = self.problems.add(&self.source, span, message);
        d.expected(expected);
    }

    /// The text of a file that is named at a place of the tree.
    fn text(&mut self, file: &str, span: &Span, most: u64) -> Option<Text> {
        let path = named(self.problems, &self.source.folder, file);
        if let Some(known) = self.texts.get(&path) {
            self.sound &= known.is_some();
            return known.clone();
        }
        let read = self.read(&path, (file, span), most);
        self.sound &= read.is_some();
        self.texts.insert(path, read.clone());
        read
    }

    fn read(&mut self, path: &Utf8Path, (file, span): (&str, &Span), most: u64) -> Option<Text> {
        let bytes = match open::read(path.as_std_path(), most) {
            Ok(bytes) => bytes,
            Err(e) => {
                let mention = Mention::new(&self.source, span, file);
                unreadable(self.problems, &mention, path, &e);
                return None;
            }
        };
        self.problems.note_file(path, &evidence::hash(&bytes));
        let text = match most {
            MOST_DRAWN => drawn::text(&bytes),
            _ => plain(&bytes),
        };
        match text {
            Ok(text) => {
                let text = Arc::new(text);
                let base = self.source.add_text(text.clone(), Some(path.to_owned()));
                Some((text, base))
            }
            Err(why) => {
                let message = format!("cannot read `{}`: {why}", shown(file));
                self.problems.add(&self.source, span, message);
                None
            }
        }
    }

    /// The contours of a drawing that is named at a place of the tree.
    fn contours(&mut self, drawing: &Drawing, span: &Span) -> Option<Rc<Contours>> {
        let key = format!("{drawing:?}");
        if let Some(known) = self.drawings.get(&key) {
            return known.clone();
        }
        let found = self.text(&drawing.file, span, MOST_DRAWN);
        let found = found.and_then(|(text, base)| {
            let default = Fineness::default();
            let fine = Fineness {
                tolerance: drawing.tolerance.map_or(default.tolerance, Length::si),
                chord: drawing.chord.map_or(default.chord, Length::si),
            };
            let unit = drawing.unit.map(Length::si);
            match drawn::read(&text, drawing.layer.as_deref(), unit, fine) {
                Ok(found) => Some(Rc::new(match drawing.centred {
                    true => found.centred(),
                    false => found,
                })),
                Err(flaws) => {
                    for flaw in flaws {
                        self.of_drawing(flaw, &drawing.file, span, base);
                    }
                    None
                }
            }
        });
        self.sound &= found.is_some();
        self.drawings.insert(key, found.clone());
        found
    }

    /// Tells what is wrong with a drawing: in its line, or, where it is about all of the file, where that is named.
    fn of_drawing(&mut self, flaw: Flaw, file: &str, span: &Span, base: usize) {
        if !flaw.span.is_empty() || flaw.span.start > 0 {
            return self.tell(&flaw, base);
        }
        let problem = format!("`{}`: {}", shown(file), flaw.problem);
        let span = span.clone();
        self.tell(
            &Flaw {
                span,
                problem,
                ..flaw
            },
            0,
        );
    }

    /// What a node `{drawing: {..}}` names; the schema check has spoken about one that is none.
    fn drawing(&mut self, contour: &Node) -> Option<Rc<Contours>> {
        let node = contour.get("drawing")?;
        let Ok(drawing) = serde_json::from_value::<Drawing>(node.to_json()) else {
            self.sound = false;
            return None;
        };
        let span = node.get("file").map_or(&node.span, |f| &f.span).clone();
        self.contours(&drawing, &span)
    }

    /// Puts corners in the place of all drawings of a sheet.
    fn contours_of(&mut self, sheet: &mut Node) {
        if let Some(entry) = entry_mut(sheet, "holes")
            && let Kind::List(holes) = &mut entry.value.kind
        {
            holes.iter_mut().for_each(|hole| self.plain_contour(hole));
        }
        if let Some(entry) = entry_mut(sheet, "regions")
            && let Kind::List(regions) = &mut entry.value.kind
        {
            for region in regions {
                if let Some(polygon) = entry_mut(region, "polygon") {
                    self.plain_contour(&mut polygon.value);
                }
            }
        }
        let Some(entry) = entry_mut(sheet, "outline") else {
            return;
        };
        let Some(found) = self.drawing(&entry.value) else {
            return;
        };
        let (span, key_span) = (entry.value.span.clone(), entry.key_span.clone());
        entry.value.kind = corners(&found.outline, &span).kind;
        let holes: Vec<Node> = found.holes.iter().map(|h| corners(h, &span)).collect();
        if holes.is_empty() {
            return;
        }
        // Behind those that the scene lists.
        if let Some(entry) = entry_mut(sheet, "holes") {
            if let Kind::List(all) = &mut entry.value.kind {
                all.extend(holes);
            }
        } else if let Kind::Map(entries) = &mut sheet.kind {
            entries.push(Entry {
                key: "holes".into(),
                key_span,
                value: list(holes, &span),
            });
        }
    }

    /// A contour that has no holes of its own.
    fn plain_contour(&mut self, contour: &mut Node) {
        let Some(found) = self.drawing(contour) else {
            return;
        };
        if !found.holes.is_empty() {
            let message = format!(
                "the drawing has {} contours inside of the largest one",
                found.holes.len()
            );
            let span = contour.span.clone();
            self.wrong(
                &span,
                message,
                "one contour, as only the outline of a ply has holes",
            );
        }
        contour.kind = corners(&found.outline, &contour.span).kind;
    }
}
