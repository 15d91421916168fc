//! Rules of a sheet's size: length and width, or an outline with holes.

use crate::diagnostics::{Problems, Source};
use crate::yaml::{Kind, Node};
use plyflow_model::outline::{ContourName, Region};
use plyflow_model::scene::Contour;

/// Checks what a sheet says of its size and fibres.
pub fn rules(sheet: &Node, source: &Source, problems: &mut Problems) {
    if !matches!(sheet.kind, Kind::Map(_)) {
        return;
    }
    match sheet.get("kind").and_then(Node::text) {
        Some("ply") => ply(sheet, source, problems),
        Some("diaphragm") => {
            for name in ["outline", "holes"] {
                if let Some(entry) = sheet.entry(name) {
                    let message = format!("a diaphragm has no `{name}`");
                    let d = problems.add(source, &entry.key_span, message);
                    d.help("diaphragms fill the frame of the process; only plies have a shape of their own");
                }
            }
        }
        _ => {}
    }
}

fn ply(sheet: &Node, source: &Source, problems: &mut Problems) {
    let outlined = sheet.get("outline").is_some();
    for wanted in ["length", "width", "fibre_2"] {
        let size = wanted != "fibre_2";
        match sheet.entry(wanted) {
            Some(entry) if outlined && size => {
                let message = format!("`{wanted}` stands beside `outline`");
                let d = problems.add(source, &entry.key_span, message);
                d.expected("an `outline`, or `length` and `width` of a rectangle");
            }
            None if !(outlined && size) => {
                let at = sheet.entry("kind").map_or(&sheet.span, |e| &e.value.span);
                let d = problems.add(source, at, format!("a ply needs `{wanted}`"));
                let example = if size { "300 mm" } else { "45 deg" };
                d.expected(format!("`{wanted}: {example}`, say"));
                if size {
                    d.help("a ply that is no rectangle has an `outline` instead of `length` and `width`");
                }
            }
            _ => {}
        }
    }
    region(sheet, source, problems);
}

/// Checks outline and holes against each other.
fn region(sheet: &Node, source: &Source, problems: &mut Problems) {
    let Some(outline) = sheet.get("outline") else {
        if let Some(entry) = sheet.entry("holes") {
            let d = problems.add(source, &entry.key_span, "`holes` stand without `outline`");
            d.expected("an `outline` around the holes")
                .help("a rectangle with holes is an outline of four points");
        }
        return;
    };
    let holes = sheet.get("holes").map_or(&[][..], Node::items);
    // What is no contour by its type has been reported.
    let read = |n: &Node| serde_json::from_value::<Contour>(n.to_json()).ok();
    let (Some(around), Some(inside)) = (
        read(outline),
        holes.iter().map(read).collect::<Option<Vec<_>>>(),
    ) else {
        return;
    };
    let inside = inside.iter().map(Contour::corners).collect();
    let Err(error) = Region::new(around.corners(), inside) else {
        return;
    };
    let at = match error.contour() {
        Some(ContourName::Hole(i)) => &holes[i].span,
        _ => &outline.span,
    };
    let d = problems.add(source, at, error.to_string());
    d.help(
        "points count from 0 in the order of the file; places are relative to the sheet's `centre`",
    );
}
