//! Surfaces of facets.

use crate::fixture::Folder;
use plyflow_defects::scan::read;
use plyflow_files::stl::{Corners, parse, write};
use plyflow_tooling::facets;
use std::fmt::Write;
use std::path::Path;

thread_local! {
    static FOLDER: Folder = Folder::empty();
}

fn text(corners: &[Corners]) -> String {
    let mut text = String::from("solid s\n");
    for facet in corners {
        text.push_str("facet normal 0 0 0\nouter loop\n");
        for [x, y, z] in facet {
            writeln!(text, "vertex {x:e} {y:e} {z:e}").expect("texts grow");
        }
        text.push_str("endloop\nendfacet\n");
    }
    text + "endsolid s\n"
}

/// The bytes as an STL file: its corners are finite; written as text they are read as the same, written in single precision as what
/// single precision leaves of them; and joined they are a surface whose corners are there.
pub(super) fn stl(bytes: &[u8]) {
    let found = match parse(bytes) {
        Ok(found) => found,
        Err(e) => {
            let told = e.of(Path::new("a.stl"));
            assert!(
                told.starts_with("a.stl:") && !e.problem.trim().is_empty(),
                "{told}"
            );
            let lines = bytes.iter().filter(|b| matches!(b, b'\n' | b'\r')).count() + 1;
            assert!(e.line.is_none_or(|l| l as usize <= lines), "{told}");
            return;
        }
    };
    let numbers = || found.corners.as_flattened().as_flattened().iter();
    assert!(numbers().all(|v| v.is_finite()) && !found.corners.is_empty());
    assert!(found.lines.is_empty() || found.lines.len() == found.corners.len());
    let again = parse(text(&found.corners).as_bytes()).expect("text that was written");
    assert_eq!(again.corners, found.corners, "text is read as another");
    if numbers().all(|v| (*v as f32).is_finite()) {
        let single = |c: &Corners| c.map(|p| p.map(|v| f64::from(v as f32)));
        let wanted: Vec<Corners> = found.corners.iter().map(single).collect();
        let again = parse(&write(&found.corners)).expect("a file that was written");
        assert_eq!(again.corners, wanted, "bytes are read as another");
    }
    let surface = facets::join(&found.corners);
    let count = surface.points.len() as u32;
    let mut all = surface.triangles.iter().flatten();
    assert!(all.all(|i| *i < count), "a corner that is no point");
}

/// The bytes as a scan of facets.
pub(super) fn scan(bytes: &[u8]) {
    FOLDER.with(|folder| {
        let path = folder.write("scan.stl", bytes);
        match read(path.as_std_path(), None) {
            Ok(read) => {
                let count = read.points.len() as u32;
                let mut all = read.triangles.iter().flatten();
                assert!(all.all(|i| *i < count), "a corner that is no point");
                let mut numbers = read.points.as_flattened().iter();
                assert!(numbers.all(|v| v.is_finite()), "no finite number");
            }
            Err(e) => assert!(!e.to_string().trim().is_empty()),
        }
    });
}
