//! VTK's XML files: a `.vtu` for each body, a `.vtm` that joins them, and a `.pvd` for frames.
//!
//! Arrays are inline, in base64, little-endian, with their length before them as an unsigned 64-bit number. VTK 5.10 and later read that, and
//! so do meshio and programs that know VTK's format. Stored fields keep their single precision. The unit of an array stands in VTK's own
//! key for it, `UNITS_LABEL`.

use crate::file::File;
use crate::names::apart;
use crate::part::{Body, Field, Part};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use plyflow_artifact::On;
use std::fmt::Write as _;

/// Writes the bodies of one frame, and gives the name of the file that has them all.
pub fn write(part: &Part, stem: &str, files: &mut Vec<File>) -> String {
    let mut blocks = String::new();
    let names = apart(part.bodies.iter().map(|b| b.name.as_str()));
    for (k, (body, name)) in part.bodies.iter().zip(names).enumerate() {
        let name = format!("{stem}-{name}.vtu");
        let _ = writeln!(
            blocks,
            "    <DataSet index=\"{k}\" name=\"{}\" file=\"{name}\"/>",
            body.name
        );
        files.push(File::of_text(name, unstructured(part, body)));
    }
    if let [_] = part.bodies[..] {
        return files[files.len() - 1].name.clone();
    }
    let text = xml(
        "vtkMultiBlockDataSet",
        &part.origin,
        &format!("  <vtkMultiBlockDataSet>\n{blocks}  </vtkMultiBlockDataSet>\n"),
    );
    let name = format!("{stem}.vtm");
    files.push(File::of_text(name.clone(), text));
    name
}

/// The file that joins frames: times (s) and names.
pub fn collection(stem: &str, frames: &[(f64, String)]) -> File {
    let mut sets = String::new();
    for (time, name) in frames {
        let _ = writeln!(
            sets,
            "    <DataSet timestep=\"{time}\" part=\"0\" file=\"{name}\"/>"
        );
    }
    let text = xml(
        "Collection",
        &[],
        &format!("  <Collection>\n{sets}  </Collection>\n"),
    );
    File::of_text(format!("{stem}.pvd"), text)
}

fn xml(kind: &str, origin: &[String], inner: &str) -> String {
    let about = origin.join("; ").replace("--", "- -");
    let comment = match about.is_empty() {
        true => String::new(),
        false => format!("<!-- {about} -->\n"),
    };
    format!(
        "<?xml version=\"1.0\"?>\n{comment}<VTKFile type=\"{kind}\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
         {inner}</VTKFile>\n"
    )
}

fn unstructured(part: &Part, body: &Body) -> String {
    let mut inner = String::from("  <UnstructuredGrid>\n");
    if let Some(time) = part.time {
        inner += "    <FieldData>\n";
        inner += &array(
            "TimeValue",
            "Float64",
            " NumberOfTuples=\"1\"",
            "s",
            &time.to_le_bytes(),
        );
        inner += "    </FieldData>\n";
    }
    let (n, m) = (body.points.len(), body.count());
    let _ = writeln!(
        inner,
        "    <Piece NumberOfPoints=\"{n}\" NumberOfCells=\"{m}\">"
    );
    for (on, group) in [(On::Points, "PointData"), (On::Cells, "CellData")] {
        let _ = writeln!(inner, "      <{group}>");
        for field in body.fields.iter().filter(|f| f.on == on) {
            inner += &field_array(field);
        }
        let _ = writeln!(inner, "      </{group}>");
    }
    let three = " NumberOfComponents=\"3\"";
    inner += "      <Points>\n";
    inner += &array(
        "Points",
        "Float64",
        three,
        part.unit,
        &doubles(body.points.as_flattened()),
    );
    inner += "      </Points>\n      <Cells>\n";
    let corners: Vec<u8> = body
        .cells
        .iter()
        .flat_map(|i| i64::from(*i).to_le_bytes())
        .collect();
    inner += &array("connectivity", "Int64", "", "", &corners);
    let ends: Vec<u8> = (1..=m)
        .flat_map(|c| ((c * body.k) as i64).to_le_bytes())
        .collect();
    inner += &array("offsets", "Int64", "", "", &ends);
    // VTK's numbers of a triangle and of a quadrilateral.
    let kind = if body.k == 3 { 5u8 } else { 9 };
    inner += &array("types", "UInt8", "", "", &vec![kind; m]);
    inner += "      </Cells>\n    </Piece>\n  </UnstructuredGrid>\n";
    xml("UnstructuredGrid", &part.origin, &inner)
}

fn doubles(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn field_array(field: &Field) -> String {
    let components = match field.components {
        1 => String::new(),
        c => format!(" NumberOfComponents=\"{c}\""),
    };
    let (kind, bytes) = match field.stored {
        true => (
            "Float32",
            field
                .values
                .iter()
                .flat_map(|v| (*v as f32).to_le_bytes())
                .collect(),
        ),
        false => ("Float64", doubles(&field.values)),
    };
    array(&field.name, kind, &components, &field.unit, &bytes)
}

/// One array: with its length before it, as one text of base64.
fn array(name: &str, kind: &str, more: &str, unit: &str, bytes: &[u8]) -> String {
    let mut all = (bytes.len() as u64).to_le_bytes().to_vec();
    all.extend_from_slice(bytes);
    let label = match unit {
        "" => String::new(),
        _ => format!(
            "          <InformationKey name=\"UNITS_LABEL\" location=\"vtkDataArray\">{}</InformationKey>\n",
            escaped(unit)
        ),
    };
    format!(
        "        <DataArray type=\"{kind}\" Name=\"{name}\"{more} format=\"binary\">\n          {}\n{label}        </DataArray>\n",
        STANDARD.encode(all)
    )
}

/// A text without what XML has a meaning for.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}
