//! Bulk data of Nastran, to be included in a model: `GRID`, `CQUAD4` and `CTRIA3`, `PSHELL`.
//!
//! An element of Nastran has one material angle. So each cell is two elements on the same nodes, one for each fibre family, each half as
//! thick as the ply and moved off the ply's middle by a quarter of its thickness (`ZOFFS`). Together they are the laminate of two layers: their
//! nodes share all motions, so membrane, coupling and bending stiffness add up to the laminate's.
//!
//! Materials are not written. Numbers stand in fields of 16 characters.

use crate::fibres::Sheared;
use crate::file::File;
use crate::part::{Part, Ply};
use crate::shells::{Shells, shells};
use crate::vec3::{add_scaled, cross, dot, sub};
use plyflow_fixed::FixedBits;
use std::fmt::Write as _;

/// Writes the file.
pub fn write(part: &Part, stem: &str, files: &mut Vec<File>, told: &mut Vec<String>) {
    let all = shells(part, told);
    let mut text = String::new();
    for line in &part.origin {
        let _ = writeln!(text, "$ {line}");
    }
    text += "$ To be included in the bulk data of a model that has the materials (MAT8, 1 along the fibres).\n";
    let mut element = 1;
    let mut materials: Vec<&str> = Vec::new();
    for (k, shells) in all.iter().enumerate() {
        grid(&mut text, shells);
        let property = 10 * (k + 1);
        let ply = shells.body.ply.as_ref().filter(|p| p.laid.is_some());
        if let Some((ply, thickness)) = ply.and_then(|p| Some((p, p.thickness.as_ref()?))) {
            let name = ply.sheet.material.as_deref().unwrap_or("fabric");
            let known = materials.iter().position(|m| *m == name);
            let material = 1 + known.unwrap_or_else(|| {
                materials.push(name);
                materials.len() - 1
            });
            let half = 0.5 * ply.sheet.thickness * part.scale;
            for family in 0..2 {
                let property = property + family + 1;
                let _ = writeln!(
                    text,
                    "$ {}: family {} is property {property}",
                    shells.label,
                    family + 1
                );
                text += &card(
                    "PSHELL",
                    &[
                        whole(property),
                        whole(material),
                        real(half),
                        whole(material),
                    ],
                );
                layer(
                    &mut text,
                    shells,
                    ply,
                    (family, property),
                    thickness,
                    &mut element,
                );
            }
        } else {
            bare(&mut text, shells, property, &mut element, told);
        }
    }
    tell_materials(&materials, told);
    files.push(File::of_text(format!("{stem}.bdf"), text));
}

/// Says which materials the model has to have.
fn tell_materials(materials: &[&str], told: &mut Vec<String>) {
    if materials.is_empty() {
        return;
    }
    let named = materials.iter().enumerate();
    let list: Vec<String> = named.map(|(k, m)| format!("{} ({m})", k + 1)).collect();
    told.push(format!(
        "give the materials (MAT8) {} in your model, 1 along the fibres: what the fabric becomes with its resin is not in the artifact",
        list.join(", ")
    ));
}

/// Elements of one family of a ply, from a number on.
fn layer(
    text: &mut String,
    shells: &Shells<'_>,
    ply: &Ply,
    (family, property): (usize, usize),
    thickness: &[f64],
    element: &mut usize,
) {
    for (_, cell) in shells.elements() {
        let shape = ply.sheared[cell]
            .as_ref()
            .expect("cells with a shape are listed");
        let thickness = 0.5 * thickness[cell];
        let layer = Layer {
            shape,
            family,
            thickness,
        };
        shell(text, shells, cell, *element, property, Some(&layer));
        *element += 1;
    }
}

/// Elements of a body without layers, with a property that the model has to have.
fn bare(
    text: &mut String,
    shells: &Shells<'_>,
    property: usize,
    element: &mut usize,
    told: &mut Vec<String>,
) {
    told.push(format!(
        "{}: only its mesh is written, with the property {property} that your model has to have: {}",
        shells.body.name,
        match shells.body.ply {
            Some(_) => "its fibres or its thickness are not known",
            None => "it is no ply",
        }
    ));
    let _ = writeln!(
        text,
        "$ {}: property {property} of your model",
        shells.label
    );
    for (_, cell) in shells.elements() {
        shell(text, shells, cell, *element, property, None);
        *element += 1;
    }
}

/// A family of fibres in a cell.
struct Layer<'a> {
    shape: &'a Sheared,
    family: usize,
    thickness: f64,
}

fn grid(text: &mut String, shells: &Shells<'_>) {
    for (node, [x, y, z]) in shells.numbered() {
        *text += &card(
            "GRID",
            &[whole(node), String::new(), real(x), real(y), real(z)],
        );
    }
}

/// Angle (degrees) of the layer's fibres from the first side of the cell, about its normal.
fn angle(shells: &Shells<'_>, cell: usize, layer: &Layer<'_>) -> f64 {
    let corner = |k: usize| shells.body.points[shells.body.corners(cell)[k] as usize];
    let (side, normal) = (sub(corner(1), corner(0)), layer.shape.normal);
    // Nastran projects the side onto the plane of the element.
    let side = add_scaled(side, -dot(side, normal), normal);
    let fibre = layer.shape.directions[layer.family];
    dot(cross(side, fibre), normal)
        .fixed_atan2(dot(side, fibre))
        .to_degrees()
}

fn shell(
    text: &mut String,
    shells: &Shells<'_>,
    cell: usize,
    element: usize,
    property: usize,
    layer: Option<&Layer<'_>>,
) {
    let corners = shells.corners(cell);
    let mut fields = vec![whole(element), whole(property)];
    fields.extend(corners.iter().map(|n| whole(*n)));
    if let Some(layer) = layer {
        let sign = if layer.family == 0 { -0.5 } else { 0.5 };
        fields.push(real(angle(shells, cell, layer)));
        fields.push(real(sign * layer.thickness));
        // What is left blank before the thickness at the corners; a triangle has one field less on its first line.
        let blank = 6 - corners.len();
        fields.extend(vec![String::new(); blank]);
        fields.extend(vec![real(layer.thickness); corners.len()]);
    }
    *text += &card(
        if corners.len() == 4 {
            "CQUAD4"
        } else {
            "CTRIA3"
        },
        &fields,
    );
}

fn whole(n: usize) -> String {
    n.to_string()
}

/// A real number with as many digits as 16 characters hold, always with a point.
fn real(value: f64) -> String {
    let value = if value == 0.0 { 0.0 } else { value };
    let with = |digits: usize| format!("{value:.digits$e}").replace('e', "E");
    let fits = (8..=12).rev().map(with).find(|t| t.len() <= 16);
    fits.unwrap_or_else(|| with(7))
}

/// A card in fields of 16 characters, four to a line. Cards in this form have two lines or more.
fn card(name: &str, fields: &[String]) -> String {
    let mut text = String::new();
    for (k, four) in fields.chunks(4).enumerate() {
        let head = if k == 0 {
            format!("{name}*")
        } else {
            "*".to_owned()
        };
        let _ = write!(text, "{head:<8}");
        for field in four {
            let _ = write!(text, "{field:<16}");
        }
        text.truncate(text.trim_end_matches(' ').len());
        text.push('\n');
    }
    if fields.len() <= 4 {
        text += "*\n";
    }
    text
}
