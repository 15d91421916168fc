//! Rules of a sheet's size: length and width, or an outline with holes.

use crate::diagnostics::{Problems, Source};
use crate::yaml::{Kind, Node};
use plyflow_model::outline::{ContourName, Region};
use plyflow_model::scene::Contour;
use plyflow_model::units::{Dimension, parse_quantity, si_number};

/// What only plies have.
const OF_PLIES: [&str; 8] = [
    "length", "width", "outline", "holes", "centre", "fibre_1", "fibre_2", "regions",
];

/// Checks what a sheet says of its size and fibres.
pub fn rules(sheet: &Node, source: &Source, problems: &mut Problems) {
    if !matches!(sheet.kind, Kind::Map(_)) {
        return;
    }
    match sheet.get("kind").and_then(Node::text) {
        Some("ply") => ply(sheet, source, problems),
        Some("diaphragm") => {
            for name in OF_PLIES {
                if let Some(entry) = sheet.entry(name) {
                    let message = format!("a diaphragm has no `{name}`");
                    let d = problems.add(source, &entry.key_span, message);
                    d.help("diaphragms fill the frame of the process and have no fibres; only plies have a shape of their own");
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
    fibres(sheet, source, problems);
    region(sheet, source, problems);
}

/// Least angle between the fibre families (deg). Nearer to each other they are one family, and no yarn lies across.
const LEAST_CROSSING: f64 = 5.0;

/// The families must cross.
fn fibres(sheet: &Node, source: &Source, problems: &mut Problems) {
    let read = |n: &Node| parse_quantity(n.text()?, Dimension::Angle).ok();
    let first = sheet.get("fibre_1").map_or(Some(0.0), read);
    let second = sheet.get("fibre_2").and_then(|n| Some((n, read(n)?)));
    let (Some(first), Some((at, second))) = (first, second) else {
        return;
    };
    // A fibre has no sense: directions 180 deg apart are the same.
    let apart = (second - first).to_degrees().rem_euclid(180.0);
    let apart = apart.min(180.0 - apart);
    // To rounding of degrees in radians.
    if apart < LEAST_CROSSING - 1e-9 {
        let message = format!(
            "`fibre_1` and `fibre_2` lie along each other, {} deg apart",
            si_number((1e3 * apart).round() / 1e3)
        );
        let d = problems.add(source, &at.span, message);
        d.given(at.describe()).expected(format!(
            "a direction that crosses `fibre_1` at {LEAST_CROSSING} deg or more"
        ));
        d.help("the families of most fabrics cross at 90 deg: `fibre_1: -45 deg`, `fibre_2: 45 deg`, say");
    }
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
