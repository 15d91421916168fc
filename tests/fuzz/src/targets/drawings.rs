//! Outlines of plies, directions of their fibres, and ply books.

use super::workflows::load;
use crate::fixture::Folder;
use plyflow_files::dxf::{Contours, Fineness};
use plyflow_files::flaw::{Flaw, plain};
use plyflow_files::{book, drawn, steered};
use plyflow_model::outline::Region;
use plyflow_model::steering::{SteeredField, SteeringError};
use std::fmt::Write;

thread_local! {
    static STUDY: Folder = Folder::of_study();
}

/// Flaws have words, and places that are in their text.
fn told(flaws: &[Flaw], text: &str) {
    assert!(!flaws.is_empty(), "refused without a word");
    for flaw in flaws {
        assert!(!flaw.problem.trim().is_empty(), "{flaw:?}");
        assert!(text.get(flaw.span.clone()).is_some(), "no place: {flaw:?}");
        let said = flaw.of("a", text);
        assert!(!said.contains(|c: char| c.is_control()), "{said:?}");
    }
}

/// The contours as a table of corners.
fn table(found: &Contours) -> String {
    let mut text = String::from("x [m];y [m];contour\n");
    for (k, contour) in std::iter::once(&found.outline)
        .chain(&found.holes)
        .enumerate()
    {
        for [x, y] in contour {
            writeln!(text, "{x:?};{y:?};{k}").expect("texts grow");
        }
    }
    text
}

/// The bytes as a drawing, or as a table of corners: what it gives bounds a region, and written as a table it is read as the same.
pub(super) fn drawing(bytes: &[u8]) {
    let text = match drawn::text(bytes) {
        Ok(text) => text,
        Err(why) => return assert!(!why.trim().is_empty()),
    };
    let fine = Fineness::default();
    for (layer, unit) in [
        (None, None),
        (None, Some(1e-3)),
        (Some("PLY"), Some(0.0254)),
    ] {
        match drawn::read(&text, layer, unit, fine) {
            Ok(found) => {
                let region = Region::new(found.outline.clone(), found.holes.clone());
                assert!(region.is_ok(), "{region:?}");
                let again = drawn::read(&table(&found), None, None, fine);
                assert_eq!(again.as_ref(), Ok(&found), "written and read as another");
            }
            Err(flaws) => told(&flaws, &text),
        }
    }
}

/// The bytes as a ply book, by themselves and as a scene's.
pub(super) fn book(bytes: &[u8]) {
    if let Ok(text) = plain(bytes) {
        match book::read(&text) {
            Ok(read) => {
                assert!(!read.rows.is_empty(), "a book without plies");
                for row in &read.rows {
                    assert_eq!(&text[row.name.span.clone()].is_empty(), &false, "{row:?}");
                    assert!(row.angle.si.is_finite(), "{row:?}");
                }
            }
            Err(flaws) => told(&flaws, &text),
        }
    }
    STUDY.with(|folder| {
        let path = folder.write("plies.csv", bytes);
        load(folder, "workflow-plies.yaml", &path, bytes);
    });
}

/// The bytes as a table of fibre directions: what it gives tells a direction everywhere, which at its points is theirs.
pub(super) fn steering(bytes: &[u8]) {
    let Ok(text) = plain(bytes) else { return };
    for unit in [None, Some("mm")] {
        let rows = match steered::read(&text, unit) {
            Ok(rows) => rows,
            Err(flaws) => {
                told(&flaws, &text);
                continue;
            }
        };
        let points: Vec<[f64; 3]> = rows
            .iter()
            .map(|r| [r.place[0].si, r.place[1].si, r.angle.si])
            .collect();
        match SteeredField::new(points.clone()) {
            Ok(field) => {
                for [x, y, _] in &points {
                    assert!(field.angle_at([*x, *y]).is_finite(), "{x} {y}");
                }
                assert!(field.angle_at([1e3, -1e3]).is_finite());
                let turn = field.sharp_turn(None);
                assert!(turn.is_none_or(|t| t.first < t.second && t.second < points.len()));
            }
            Err(SteeringError::Same { first, second, .. }) => assert!(first < second),
            Err(SteeringError::NoNumber(k)) => assert!(k < points.len()),
            Err(other) => panic!("{other}"),
        }
    }
}
