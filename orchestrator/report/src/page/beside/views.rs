//! Two runs in the same views: 3D with one camera, and flat maps with one scale for each quantity.

use crate::draw::{DrawError, Drawn, Field, Legend, Overlay, Sharpness, flat};
use crate::page::view3d;
use crate::plain::Ply;
use crate::read::Study;
use maud::{Markup, html};

/// Width of a map (px).
const WIDTH: f64 = 560.0;

/// A pair of runs. `n`: which pair; `drawn`: views on the page.
///
/// # Errors
/// When a picture cannot be encoded.
pub(super) fn drawn(pair: [&Study; 2], n: usize, drawn: usize, sharp: Sharpness) -> Drawn {
    let plies: Vec<&Ply> = pair.iter().flat_map(|s| s.all_plies()).collect();
    let mut views = Vec::new();
    for (k, study) in pair.into_iter().enumerate() {
        views.push(view3d::beside(
            study,
            2 * n + k,
            &plies,
            ["A", "B"][k],
            drawn,
            sharp,
        )?);
    }
    let maps = maps(pair, n, &plies, sharp)?;
    let title = |s: &Study| s.global.as_ref().map_or(String::new(), |g| g.label.clone());
    Ok(html! {
        h2 { "Formed plies in 3D" @if drawn > 2 { ": " (title(pair[0])) } }
        p class="without-views" { "Both views turn together, and have one scale for each quantity." }
        div class="pair views" { @for view in &views { (view) } }
        (maps)
    })
}

fn maps(pair: [&Study; 2], n: usize, plies: &[&Ply], sharp: Sharpness) -> Drawn {
    let detection = (pair[0].detection.as_ref()).or(pair[1].detection.as_ref());
    let all = Field::ALL.iter().chain(&Field::OF_SHAPE);
    let legends: Vec<Legend> = all.filter_map(|f| f.legend(plies, detection)).collect();
    let mut blocks = Vec::new();
    for (k, legend) in legends.iter().enumerate() {
        let mut rows = Vec::new();
        for ply in &pair[0].plies {
            let other = pair[1].plies.iter().find(|p| p.name == ply.name);
            let Some(other) =
                other.filter(|p| legend.at_points(p).is_some() && legend.at_points(ply).is_some())
            else {
                continue;
            };
            rows.push((
                ply.name.as_str(),
                [
                    map(pair[0], ply, legend, sharp)?,
                    map(pair[1], other, legend, sharp)?,
                ],
            ));
        }
        if !rows.is_empty() {
            blocks.push(block(legend, &rows, &format!("beside-{n}-{k}")));
        }
    }
    Ok(html! {
        @if !blocks.is_empty() {
            section id={ "maps-" (n) } {
                h2 { "Maps of the flat plies" }
                p { "Left A, right B; rectangles: the zones." }
                @for block in &blocks { (block) }
            }
        }
    })
}

fn map(study: &Study, ply: &Ply, legend: &Legend, sharp: Sharpness) -> Result<Markup, DrawError> {
    let overlay = Overlay {
        zones: study.zones.as_deref().unwrap_or_default(),
        ..Overlay::default()
    };
    flat(ply, legend, &overlay, WIDTH, sharp)
}

fn block(legend: &Legend, rows: &[(&str, [Markup; 2])], id: &str) -> Markup {
    html! {
        div class="field" {
            h3 { (legend.title()) }
            (legend.bar(id))
            (legend.note())
            @for (ply, both) in rows {
                div class="pair" { @for (figure, side) in both.iter().zip(["A", "B"]) {
                    figure class="map" { (figure) figcaption { (side) ": " (ply) } }
                } }
            }
        }
    }
}
