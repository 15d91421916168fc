//! Tables in text: measurements, profiles, clouds of points.

use crate::fixture::Folder;
use plyflow_characterisation::csv::{Column, parse};
use plyflow_defects::scan;
use plyflow_model::units::Dimension;
use std::fmt::Write;

thread_local! {
    static FOLDER: Folder = Folder::empty();
}

/// A table that was read has finite numbers in rows of rising lines; written in SI, it is read as the same.
fn read(bytes: &[u8], wanted: &[Column]) {
    let table = match parse(bytes, "t.csv", wanted) {
        Ok(table) => table,
        Err(e) => {
            let told = e.strip_prefix("t.csv:").unwrap_or_default();
            assert!(!told.trim().is_empty(), "no place or no words: {e:?}");
            return;
        }
    };
    assert!(table.lines.is_sorted_by(|a, b| a < b), "{:?}", table.lines);
    let there: Vec<&Column> = wanted
        .iter()
        .filter(|c| table.column(c.name).is_some())
        .collect();
    let mut text = String::new();
    let head = |c: &&Column| match c.dimension.base_unit() {
        "" => c.name.to_owned(),
        unit => format!("{} [{unit}]", c.name),
    };
    let heads: Vec<String> = there.iter().map(head).collect();
    text.push_str(&heads.join(";"));
    for row in 0..table.rows() {
        text.push('\n');
        for (i, column) in there.iter().enumerate() {
            let value = table.column(column.name).expect("filtered")[row];
            assert!(value.is_finite(), "{value} in {}", table.place(row));
            let sign = if i > 0 { ";" } else { "" };
            write!(text, "{sign}{value:?}").expect("texts grow");
        }
    }
    let again = parse(&text, "t.csv", wanted)
        .unwrap_or_else(|e| panic!("what was written is refused: {e}\n{text}"));
    for column in there {
        let both = [&table, &again].map(|t| t.column(column.name));
        assert_eq!(both[0], both[1], "{} is another\n{text}", column.name);
    }
}

/// The bytes as the table of a picture frame.
pub(super) fn table(bytes: &[u8]) {
    read(
        bytes,
        &[
            Column::required("displacement", Dimension::Length),
            Column::required("force", Dimension::Force),
            Column::optional("shear_angle", Dimension::Angle),
            Column::optional("cycle", Dimension::Dimensionless),
        ],
    );
}

/// The bytes as a profile of a strip that hangs.
pub(super) fn profile(bytes: &[u8]) {
    read(
        bytes,
        &[
            Column::required("x", Dimension::Length),
            Column::required("deflection", Dimension::Length),
        ],
    );
}

/// The bytes as a cloud of points, in millimetres and in whatever it says.
pub(super) fn scan(bytes: &[u8]) {
    FOLDER.with(|folder| {
        let path = folder.write("scan.csv", bytes);
        for unit in [None, Some(1e-3)] {
            match scan::read(path.as_std_path(), unit) {
                Ok(read) => {
                    let numbers = read.points.as_flattened();
                    assert!(numbers.iter().all(|v| v.is_finite()), "no finite number");
                    assert!(read.unit > 0.0 && read.triangles.is_empty());
                }
                Err(e) => assert!(!e.to_string().trim().is_empty()),
            }
        }
    });
}
