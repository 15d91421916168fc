//! Tables: the points of each body, and its cells. Heads and numbers are those of the step `export-csv`: as many digits as give a number back.

use crate::file::File;
use crate::names::apart;
use crate::part::{Body, Field, Part};
use crate::vec3::{Vec3, add_scaled, scaled};
use plyflow_artifact::On;
use std::fmt::Write as _;

/// Writes two files for each body. Where a cell has no shape, what is computed of it is left empty.
pub fn write(part: &Part, stem: &str, files: &mut Vec<File>) {
    let names = apart(part.bodies.iter().map(|b| b.name.as_str()));
    for (body, name) in part.bodies.iter().zip(names) {
        for (what, text) in [("points", points(part, body)), ("cells", cells(part, body))] {
            files.push(File::of_text(format!("{stem}-{name}-{what}.csv"), text));
        }
    }
}

fn points(part: &Part, body: &Body) -> String {
    let unit = part.unit;
    let mut text = format!("node,x ({unit}),y ({unit}),z ({unit})");
    head(&mut text, body, On::Points);
    for (node, [x, y, z]) in body.points.iter().enumerate() {
        let _ = write!(text, "{node},{x},{y},{z}");
        row(&mut text, body, On::Points, node);
    }
    text
}

fn cells(part: &Part, body: &Body) -> String {
    let unit = part.unit;
    let mut text = String::from("cell");
    for k in 1..=body.k {
        let _ = write!(text, ",node_{k}");
    }
    let _ = write!(text, ",x ({unit}),y ({unit}),z ({unit})");
    head(&mut text, body, On::Cells);
    for cell in 0..body.count() {
        let _ = write!(text, "{cell}");
        let corners = body.corners(cell);
        for node in corners {
            let _ = write!(text, ",{node}");
        }
        let sum = |sum: Vec3, node: &u32| add_scaled(sum, 1.0, body.points[*node as usize]);
        let [x, y, z] = scaled(1.0 / body.k as f64, corners.iter().fold([0.0; 3], sum));
        let _ = write!(text, ",{x},{y},{z}");
        row(&mut text, body, On::Cells, cell);
    }
    text
}

/// Names of the components of a field: x, y and z of what is computed here, numbers of what others have.
fn component(field: &Field, at: usize) -> String {
    match (field.components, field.stored) {
        (1, _) => String::new(),
        (3, false) => format!("_{}", ["x", "y", "z"][at]),
        _ => format!("_{}", at + 1),
    }
}

fn head(text: &mut String, body: &Body, on: On) {
    for field in body.fields.iter().filter(|f| f.on == on) {
        for at in 0..field.components {
            let _ = write!(text, ",{}{}", field.name, component(field, at));
            if !matches!(field.unit.as_str(), "" | "1") {
                let _ = write!(text, " ({})", field.unit);
            }
        }
    }
    text.push('\n');
}

fn row(text: &mut String, body: &Body, on: On, row: usize) {
    for field in body.fields.iter().filter(|f| f.on == on) {
        for value in &field.values[row * field.components..(row + 1) * field.components] {
            text.push(',');
            if !value.is_nan() {
                let _ = write!(text, "{value}");
            }
        }
    }
    text.push('\n');
}
