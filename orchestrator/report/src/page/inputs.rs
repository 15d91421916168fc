//! What went in: ply book, materials, friction, process and tool, as the run had them.

mod friction;
pub(crate) mod laws;
mod plies;
mod process;
mod tool;

use crate::draw::{Drawn, Sharpness};
use crate::read::{Inputs, Material, inputs};
use crate::units::quantity;
use maud::{Markup, html};
use plyflow_model::artifact::Sheet;

/// Whether there is something to show.
pub(super) fn has(material: &Material) -> bool {
    material
        .studies
        .iter()
        .any(|s| s.global.is_some() && !s.plies.is_empty())
}

/// The inputs of all runs of whole parts, those that are the same once.
///
/// # Errors
/// When a picture cannot be encoded.
pub(super) fn section(material: &Material, sharp: Sharpness) -> Drawn {
    if !has(material) {
        return Ok(html! {});
    }
    let all = inputs(material);
    let mut blocks = Vec::new();
    for found in &all {
        blocks.push(one(material, found, all.len() > 1, sharp)?);
    }
    Ok(html! {
        section id="inputs" {
            h2 { "What went in" }
            p class="note" { "As the run had it: read from the artifacts, whatever has become of the files since." }
            @for block in &blocks { (block) }
        }
    })
}

fn one(material: &Material, found: &Inputs, many: bool, sharp: Sharpness) -> Drawn {
    let study = &material.studies[found.study];
    let tool = tool::drawn(study.tool.as_ref(), found.tool.as_ref(), sharp)?;
    let history = study.global.as_ref().map(|g| &g.history);
    Ok(html! {
        @if many { h3 { "Of " (found.runs.join(", ")) } }
        @if let Some(scene) = &found.scene { p { "Scene " code { (scene) } "."
            @for plane in &found.symmetry { " Mirror plane " (plane.word()) " = 0: a part of it was computed and the whole is shown." } } }
        h4 { "Ply book" }
        (stack(&found.sheets))
        (plies::sketches(&found.sheets))
        (tool)
        @if let Some(process) = &found.process { (process::drawn(process, history)) }
        @if let Some(friction) = &found.friction { (friction::table(friction)) }
        div class="materials" { @for law in &found.materials { div { (laws::drawn(law)) } } }
    })
}

/// The sheets in order, from the tool upwards.
fn stack(sheets: &[Sheet]) -> Markup {
    let deg = |a: Option<f64>| a.map_or("–".to_owned(), |a| quantity(a, "rad", 4));
    html! {
        div class="scroll" { table class="stack" {
            thead { tr { th class="n" { "from the tool" } th { "sheet" } th { "kind" } th { "material" } th class="n" { "thickness" } th class="n" { "areal mass" }
                th class="n" { "fibres 1" } th class="n" { "fibres 2" } th class="n" { "size" } th class="n" { "area" } } }
            tbody { @for (k, s) in sheets.iter().enumerate() { tr {
                td class="n" { (k + 1) } th { (s.name) } td { @if s.is_ply() { "ply" } @else { "film" } } td { (s.material.as_deref().unwrap_or("–")) }
                td class="n" { (quantity(s.thickness, "m", 3)) }
                td class="n" { (s.areal_mass.map_or("–".to_owned(), |m| format!("{} g/m²", crate::units::number(m * 1e3, 4)))) }
                @if let Some(points) = &s.steering { td class="n" { "steered, " (points.len()) " points" } td class="n" { "across" } }
                @else { td class="n" { (deg(s.fibre_1)) } td class="n" { (deg(s.fibre_2)) } }
                td class="n" { (plies::size(s).unwrap_or_else(|| "–".into())) }
                td class="n" { (plies::area(s).map_or("–".to_owned(), |a| quantity(a, "m2", 4))) }
            } } }
        } }
    }
}
