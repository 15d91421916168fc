//! Input of Abaqus and of CalculiX: a file to be included in a model, with meshes, sets, orientations and sections.
//!
//! Each ply is a composite of two layers of half its thickness, one for each fibre family, so that families keep their angle where the ply is sheared.
//! In Abaqus, orientations and thickness are distributions over the elements. CalculiX knows composites only of elements with nodes at the
//! middles of edges, and passes over distributions in sections of shells (2.20, `shellsections.f`). So its file has these nodes, and
//! an orientation for each family and a section for each element.
//!
//! Materials are not written: what the fabric becomes with its resin is not known here.

use crate::fibres::Sheared;
use crate::file::File;
use crate::names::Names;
use crate::part::{Part, Ply};
use crate::request::{Format, Request};
use crate::shells::{ELEMENT, Shells, label, shells};
use crate::vec3::{Vec3, add_scaled, cross, scaled};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::ops::Range;

/// Writes the file.
pub fn write(part: &Part, request: &Request, files: &mut Vec<File>, told: &mut Vec<String>) {
    let calculix = request.format == Format::Calculix;
    let all = shells(part, told);
    let labels = labels(&all);
    let mut text = String::new();
    head(&mut text, part, &labels, calculix);
    meshes(&mut text, &all, calculix);
    if !calculix && !labels.is_empty() {
        text += "*Distribution Table, name=PLYFLOW_AXES\nCOORD3D, COORD3D\n*Distribution Table, name=PLYFLOW_LENGTH\nLENGTH\n";
    }
    for shells in &all {
        let Some(laminate) = laminate(shells, &labels) else {
            told.push(format!(
                "{}: only its mesh is written, without a section: {}",
                shells.body.name,
                match shells.body.ply {
                    Some(_) => "its fibres or its thickness are not known",
                    None => "it is no ply",
                }
            ));
            continue;
        };
        match calculix {
            true => sections(&mut text, shells, &laminate),
            false => distributions(&mut text, shells, &laminate, part.scale),
        }
    }
    if !labels.is_empty() {
        let named = |(material, label): &(&str, String)| match *material == label {
            true => label.clone(),
            false => format!("{label} (`{material}`)"),
        };
        let list: Vec<String> = labels.iter().map(named).collect();
        told.push(format!(
            "give the material{} {} in your model, 1 along the fibres: what the fabric becomes with its resin is not in the artifact",
            if list.len() == 1 { "" } else { "s" },
            list.join(", ")
        ));
    }
    files.push(File::of_text(format!("{}.inp", request.stem), text));
}

/// Of a ply whose fibres and thickness are known.
struct Laminate<'a> {
    ply: &'a Ply,
    thickness: &'a [f64],
    material: String,
}

impl Laminate<'_> {
    fn shape(&self, cell: usize) -> &Sheared {
        self.ply.sheared[cell]
            .as_ref()
            .expect("cells with a shape are listed")
    }
}

/// Name of a ply's material, of plies whose fibres and thickness are known.
fn material<'a>(shells: &'a Shells<'_>) -> Option<&'a str> {
    let ply = shells.body.ply.as_ref()?;
    let known = ply.laid.is_some() && ply.thickness.is_some();
    known.then(|| ply.sheet.material.as_deref().unwrap_or("fabric"))
}

fn laminate<'a>(shells: &'a Shells<'_>, labels: &[(&str, String)]) -> Option<Laminate<'a>> {
    let name = material(shells)?;
    let label = labels.iter().find(|(material, _)| *material == name);
    let ply = shells.body.ply.as_ref()?;
    Some(Laminate {
        ply,
        thickness: ply.thickness.as_ref()?,
        material: label?.1.clone(),
    })
}

/// The materials that sections ask for, each once, in the order of the plies, with labels of which no two are alike.
fn labels<'a>(all: &'a [Shells<'_>]) -> Vec<(&'a str, String)> {
    let mut taken = Names::default();
    let mut labels: Vec<(&str, String)> = Vec::new();
    for name in all.iter().filter_map(material) {
        if labels.iter().all(|(known, _)| *known != name) {
            labels.push((name, taken.own(&label(name))));
        }
    }
    labels
}

fn head(text: &mut String, part: &Part, labels: &[(&str, String)], calculix: bool) {
    for line in &part.origin {
        let _ = writeln!(text, "** {line}");
    }
    let program = if calculix { "CalculiX" } else { "Abaqus" };
    let _ = writeln!(
        text,
        "** For {program}: define the materials, then *Include this file. Layers from below: family 1, family 2."
    );
    for (name, material) in labels {
        let kind = if calculix {
            "Engineering Constants"
        } else {
            "Lamina"
        };
        let _ = writeln!(
            text,
            "** *Material, name={material}\n** (`{}`)\n** *Elastic, type={kind}",
            name.replace(|c: char| c.is_control(), " ")
        );
    }
}

/// A number of at most 20 characters, which both programs read whole.
fn number(value: f64) -> String {
    // No negative zero, so that two ways to the same number look alike.
    format!("{:.11e}", if value == 0.0 { 0.0 } else { value })
}

fn vector(v: Vec3) -> String {
    v.map(number).join(", ")
}

/// All nodes in one block, as readers of meshes expect it, then the elements of each body, with sets of both by its name.
fn meshes(text: &mut String, all: &[Shells<'_>], quadratic: bool) {
    let first_middle = 1 + all.iter().map(|s| s.nodes.len()).sum::<usize>();
    let (mut next, mut middles, mut rest) = (first_middle, String::new(), String::new());
    text.push_str("*Node\n");
    for shells in all {
        for (node, at) in shells.numbered() {
            let _ = writeln!(text, "{node}, {}", vector(at));
        }
        let from = next;
        elements(
            &mut rest,
            &mut middles,
            shells,
            quadratic.then_some(&mut next),
        );
        node_set(&mut rest, shells, from..next);
    }
    *text += &middles;
    *text += &rest;
}

/// The set of a body's nodes, those at the middles of edges included.
fn node_set(text: &mut String, shells: &Shells<'_>, middles: Range<usize>) {
    let corners: Vec<usize> = shells.numbered().map(|(node, _)| node).collect();
    let [first, .., last] = corners[..] else {
        return;
    };
    let _ = write!(text, "*Nset, nset={}", shells.label);
    if middles.is_empty() {
        let _ = writeln!(text, ", generate\n{first}, {last}, 1");
        return;
    }
    text.push('\n');
    // Readers of meshes know one range of `generate` only, and both solvers at most 16 numbers in a line.
    let all: Vec<String> = corners
        .into_iter()
        .chain(middles)
        .map(|n| n.to_string())
        .collect();
    for line in all.chunks(16) {
        let _ = writeln!(text, "{},", line.join(", "));
    }
}

/// Elements; with nodes at the middles of edges from the number in `next` on, which are written to `middles`.
fn elements(
    text: &mut String,
    middles: &mut String,
    shells: &Shells<'_>,
    next: Option<&mut usize>,
) {
    let mut edges: BTreeMap<[usize; 2], usize> = BTreeMap::new();
    let mut elements = String::new();
    let quadratic = next.is_some();
    let points: BTreeMap<usize, Vec3> = shells.numbered().collect();
    if let Some(next) = next {
        for (element, cell) in shells.elements() {
            let mut nodes = shells.corners(cell);
            for [a, b] in sides(&nodes) {
                let edge = [a.min(b), a.max(b)];
                nodes.push(*edges.entry(edge).or_insert_with(|| {
                    let at = scaled(0.5, add_scaled(points[&edge[0]], 1.0, points[&edge[1]]));
                    let _ = writeln!(middles, "{next}, {}", vector(at));
                    *next += 1;
                    *next - 1
                }));
            }
            row(&mut elements, element, &nodes);
        }
    } else {
        for (element, cell) in shells.elements() {
            row(&mut elements, element, &shells.corners(cell));
        }
    }
    let kind = match (shells.body.k, quadratic) {
        (3, false) => "S3",
        (3, true) => "S6",
        (_, false) => "S4",
        (_, true) => "S8R",
    };
    let name = &shells.label;
    let _ = write!(text, "*Element, type={kind}, elset={name}\n{elements}");
}

/// The sides of a cell, from corner to corner.
fn sides(corners: &[usize]) -> Vec<[usize; 2]> {
    let n = corners.len();
    (0..n).map(|k| [corners[k], corners[(k + 1) % n]]).collect()
}

fn row(text: &mut String, element: usize, nodes: &[usize]) {
    let _ = write!(text, "{element}");
    for node in nodes {
        let _ = write!(text, ", {node}");
    }
    text.push('\n');
}

/// Two directions that span a layer's plane: along the fibre, and across it, so that their vector product is the normal.
fn axes(shape: &Sheared, family: usize) -> String {
    let along = shape.directions[family];
    format!("{}, {}", vector(along), vector(cross(shape.normal, along)))
}

/// Abaqus: one distribution of orientations for each family, and one of the thickness.
fn distributions(text: &mut String, shells: &Shells<'_>, laminate: &Laminate<'_>, scale: f64) {
    let name = &shells.label;
    for family in 0..2 {
        let own = format!("{name}_FIBRE_{}", family + 1);
        let _ = writeln!(
            text,
            "*Distribution, name={own}_AXES, location=ELEMENT, table=PLYFLOW_AXES\n, 1., 0., 0., 0., 1., 0."
        );
        for (element, cell) in shells.elements() {
            let _ = writeln!(text, "{element}, {}", axes(laminate.shape(cell), family));
        }
        let _ = writeln!(
            text,
            "*Orientation, name={own}, system=RECTANGULAR\n{own}_AXES\n3, 0."
        );
    }
    // The thickness of the flat ply stands for elements without a value, of which there are none. Layers count by their share of the whole.
    let whole = scale * laminate.ply.sheet.thickness;
    let _ = writeln!(
        text,
        "*Distribution, name={name}_THICKNESS, location=ELEMENT, table=PLYFLOW_LENGTH\n, {}",
        number(whole)
    );
    for (element, cell) in shells.elements() {
        let _ = writeln!(text, "{element}, {}", number(laminate.thickness[cell]));
    }
    let material = &laminate.material;
    let _ = writeln!(
        text,
        "*Shell Section, elset={name}, composite, shell thickness={name}_THICKNESS"
    );
    for family in 1..=2 {
        let _ = writeln!(
            text,
            "{}, 3, {material}, {name}_FIBRE_{family}",
            number(0.5 * whole)
        );
    }
}

/// CalculiX: a section and two orientations for each element, under names that no body has.
fn sections(text: &mut String, shells: &Shells<'_>, laminate: &Laminate<'_>) {
    let material = &laminate.material;
    for (element, cell) in shells.elements() {
        let own = format!("{ELEMENT}{element}");
        for family in 0..2 {
            let axes = axes(laminate.shape(cell), family);
            let _ = writeln!(text, "*Orientation, name={own}_{}\n{axes}", family + 1);
        }
        let half = number(0.5 * laminate.thickness[cell]);
        let _ = writeln!(
            text,
            "*Elset, elset={own}\n{element}\n*Shell Section, elset={own}, composite\n\
             {half}, 3, {material}, {own}_1\n{half}, 3, {material}, {own}_2"
        );
    }
}
