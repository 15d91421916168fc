//! Step plugin `export-csv`: one frame of a mesh artifact as CSV files, in the artifact's attribute `files`, which `plyflow extract` writes.
//!
//! Numbers are SI and have as many digits as give them back exactly, so that nothing is lost on the way to a script.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

use plyflow_model::artifact::{CarriedFile, Export};
use plyflow_sdk::{BodyInfo, Host, Input, On, Step, StepError, export_step};
use std::fmt::Write;

/// Text of all files together (bytes) beyond which HDF5 is the better way: a spreadsheet reads no such file either.
const MOST: usize = 200_000_000;

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    #[serde(default)]
    time: Option<f64>,
    #[serde(default)]
    bodies: Option<Vec<String>>,
}

/// The step.
pub struct ExportCsv;

impl Step for ExportCsv {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        let input = host.input("of")?;
        let meshes = host.meshes(&input)?;
        let frame = nearest(&meshes.times, p.time)
            .ok_or_else(|| format!("'{}' has no mesh with a frame to export", input.step))?;
        let bodies: Vec<&BodyInfo> = match &p.bodies {
            None => meshes.bodies.iter().collect(),
            Some(names) => {
                let found = names.iter().map(|name| meshes.body(name));
                found.collect::<Result<_, _>>()?
            }
        };
        let mut files = Vec::new();
        let mut written = 0;
        for body in &bodies {
            host.check_cancelled()?;
            for file in [
                points(host, &input, body, frame)?,
                cells(host, &input, body, frame)?,
            ] {
                written += file.text.as_ref().map_or(0, String::len);
                files.push(file);
            }
            if written > MOST {
                return Err(format!(
                    "the text is longer than {} MB; name fewer 'bodies', or read the HDF5 file of '{}' itself (ParaView opens it)",
                    MOST / 1_000_000,
                    input.step
                )
                .into());
            }
        }
        host.result("time", meshes.times[frame], "s")?;
        let sum = |of: fn(&BodyInfo) -> usize| bodies.iter().map(|b| of(b)).sum::<usize>() as f64;
        host.result("points", sum(|b| b.points), "1")?;
        host.result("cells", sum(|b| b.cells), "1")?;
        host.write_attributes(&Export { files })
    }
}

export_step!(ExportCsv);

/// The frame whose time is nearest to `wanted` (s), the earlier of two equally near; the last one when nothing is wanted.
fn nearest(times: &[f64], wanted: Option<f64>) -> Option<usize> {
    let Some(wanted) = wanted else {
        return times.len().checked_sub(1);
    };
    let distance = |k: &usize| (times[*k] - wanted).abs();
    (0..times.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

fn points(
    host: &Host,
    input: &Input,
    body: &BodyInfo,
    frame: usize,
) -> Result<CarriedFile, StepError> {
    let places = host.frame_points(input, body, frame)?;
    let columns = columns(host, input, body, frame, On::Points)?;
    let mut text = header("node,x (m),y (m),z (m)", &columns);
    for (node, place) in places.iter().enumerate() {
        let [x, y, z] = place;
        let _ = write!(text, "{node},{x},{y},{z}");
        end_row(&mut text, &columns, node);
    }
    Ok(file(body, "points", text))
}

fn cells(
    host: &Host,
    input: &Input,
    body: &BodyInfo,
    frame: usize,
) -> Result<CarriedFile, StepError> {
    let (_, nodes) = host.mesh(input, body)?;
    let columns = columns(host, input, body, frame, On::Cells)?;
    let names = (1..=body.nodes_per_cell).map(|k| format!(",node_{k}"));
    let mut text = header(&format!("cell{}", names.collect::<String>()), &columns);
    for (cell, corners) in nodes.chunks_exact(body.nodes_per_cell).enumerate() {
        let _ = write!(text, "{cell}");
        for node in corners {
            let _ = write!(text, ",{node}");
        }
        end_row(&mut text, &columns, cell);
    }
    Ok(file(body, "cells", text))
}

/// A component of a field: its head, its values, how many values lie from one row to the next, and which it is.
struct Column {
    head: String,
    values: std::rc::Rc<Vec<f64>>,
    stride: usize,
    component: usize,
}

/// Columns of a body's fields on points or on cells.
fn columns(
    host: &Host,
    input: &Input,
    body: &BodyInfo,
    frame: usize,
    on: On,
) -> Result<Vec<Column>, StepError> {
    let mut columns = Vec::new();
    for field in body.fields.iter().filter(|f| f.on == on) {
        let values = std::rc::Rc::new(host.frame_field(input, body, frame, &field.name)?);
        let stride = field.components as usize;
        for component in 0..stride {
            let name = match stride {
                1 => field.name.clone(),
                _ => format!("{}_{}", field.name, component + 1),
            };
            columns.push(Column {
                head: match field.unit.as_str() {
                    "" | "1" => name,
                    unit => format!("{name} ({unit})"),
                },
                values: values.clone(),
                stride,
                component,
            });
        }
    }
    Ok(columns)
}

fn header(first: &str, columns: &[Column]) -> String {
    let rest = columns.iter().map(|c| format!(",{}", c.head));
    format!("{first}{}\n", rest.collect::<String>())
}

fn end_row(text: &mut String, columns: &[Column], row: usize) {
    for column in columns {
        let _ = write!(
            text,
            ",{}",
            column.values[row * column.stride + column.component]
        );
    }
    text.push('\n');
}

fn file(body: &BodyInfo, what: &str, text: String) -> CarriedFile {
    // Names of bodies may hold what no name of a file does.
    let fit = |c: char| c.is_ascii_alphanumeric() || "_-.".contains(c);
    let name: String = body
        .name
        .chars()
        .map(|c| if fit(c) { c } else { '_' })
        .collect();
    CarriedFile::of_text(format!("{}-{what}.csv", name.replace("..", "__")), text)
}
