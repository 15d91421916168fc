//! The rotatable view of the formed plies: its place on the page and its scripts.

use crate::draw::{DrawError, Drawn, Field, Legend, Scene, Sharpness, Shown, scene};
use crate::plain::{Place, Ply};
use crate::read::Study;
use crate::units::quantity;
use maud::{Markup, PreEscaped, html};

/// regl 2.1.1 (MIT), see `vendor/README.md`.
const REGL: &str = include_str!("../../vendor/regl/regl.min.js");
const REGL_LICENCE: &str = include_str!("../../vendor/regl/LICENSE");
const SCENE: &str = include_str!("../script/scene3d.js");
const VIEW: &str = include_str!("../script/view3d.js");
const PAGE: &str = include_str!("../script/page.js");
const STUDY: &str = include_str!("../script/study.js");

/// Directions of the buttons: name, and where the viewer stands as azimuth and elevation (deg).
const STANDARD: [(&str, [i32; 2]); 4] = [
    ("Iso", [-50, 35]),
    ("Top", [-90, 90]),
    ("Side", [-90, 0]),
    ("End", [0, 0]),
];

/// The scripts of the page; those of the view and of a study's table only when there is one.
pub(super) fn scripts(view: bool, study: bool) -> Markup {
    html! {
        script { (PreEscaped(PAGE)) }
        @if study { script { (PreEscaped(STUDY)) } }
        @if view {
            script { (PreEscaped(format!("/*!{REGL_LICENCE}*/\n"))) (PreEscaped(REGL)) }
            script { (PreEscaped(SCENE)) }
            script { (PreEscaped(VIEW)) }
        }
    }
}

/// The view of a study that is one of `drawn` on the page.
pub(super) fn section(
    study: &Study,
    n: usize,
    places: &[Place],
    drawn: usize,
    sharp: Sharpness,
) -> Drawn {
    let legends = in_3d(study, &study.all_plies());
    let view = view((study, n, places), (legends, &[]), drawn, sharp)?;
    Ok(html! { @if let Some(view) = &view {
        section id={ "view-" (n) } {
            h2 { "Formed plies in 3D" }
            (view)
        }
    } })
}

/// The view of one of two runs, with the scales of all `plies` of both.
pub(super) fn beside(
    study: &Study,
    n: usize,
    plies: &[&Ply],
    side: &str,
    drawn: usize,
    sharp: Sharpness,
) -> Drawn {
    let view = view((study, n, &[]), (in_3d(study, plies), plies), drawn, sharp)?;
    Ok(html! { @if let Some(view) = &view {
        section id={ "view-" (n) } { h3 { (side) } (view) }
    } })
}

/// A view, without its heading. `plies`: those of other runs that share the scales.
fn view(
    (study, n, places): (&Study, usize, &[Place]),
    (legends, plies): (Vec<Legend>, &[&Ply]),
    drawn: usize,
    sharp: Sharpness,
) -> Result<Option<Markup>, DrawError> {
    let finer = study.locals.iter();
    let finer = finer.flat_map(|l| l.plies.iter().map(|p| (l.zone.as_str(), p)));
    let shown = Shown {
        tool: study.tool.as_ref(),
        plies: &study.plies,
        finer: finer.collect(),
        zones: study.zones.as_deref().unwrap_or_default(),
        places,
        legends,
        frames: study.frames.as_ref(),
        beside: plies,
    };
    let Some(scene) = scene(shown, drawn, sharp)? else {
        return Ok(None);
    };
    Ok(Some(html! {
        p class="without-3d" { "The rotatable view needs scripts and WebGL, which this browser does not give. The maps below show the same fields." }
        div class="view3d" hidden {
            (controls(&scene, n))
            div class="stage" {
                canvas tabindex="0" role="img" aria-label="Formed plies in 3D. Arrow keys turn, plus and minus zoom, 0 resets." {}
                div class="labels" aria-hidden="true" {}
                svg class="triad3d" viewBox="-45 -45 90 90" width="90" height="90" aria-hidden="true" {
                    @for name in ["x", "y", "z"] { g { path class="triad-halo" {} path class="triad" {} text class="over" text-anchor="middle" { (name) } } }
                }
            }
            @if scene.times.len() > 1 {
                p class="moments" { label for={ "moment-" (n) } { "Time" }
                    input type="range" id={ "moment-" (n) } data-moment min="0" max=(scene.times.len() - 1) step="1" value=(scene.times.len() - 1);
                    output for={ "moment-" (n) } {} }
            }
            @for (k, legend) in scene.legends.iter().enumerate() {
                div class="legend3d" data-field=(k) hidden[k > 0] {
                    (legend.bar(&format!("view-scale-{n}-{k}")))
                    (legend.note())
                }
            }
            (notes(&scene))
        }
        script type="application/json" class="scene" { (PreEscaped(&scene.json)) }
    }))
}

/// How the view is used, and what it does not show.
fn notes(scene: &Scene) -> Markup {
    html! {
        p class="note" { "Drag, one finger or the arrow keys turn; Shift and drag, or two fingers, move; +, −, two fingers or the wheel (after a click) zoom; 0 resets. Surfaces are shaded by the light."
            @if scene.defects { " A defect that is chosen is shown on its own ply alone." }
            @if let Some(apart) = scene.fibres { " Lines of fibres are " (quantity(apart, "m", 3)) " apart in the flat ply." }
            @if scene.times.len() > 1 { " On the way to the formed state the plies of the whole are shown, within " (quantity(scene.coarse, "m", 1))
                ", in " (scene.times.len()) " moments; fields that are known at the end alone are grey there." }
            @if !scene.notes.is_empty() { " Shown coarser than computed: " (scene.notes.join("; ")) "." }
            @if !scene.even.is_empty() { " The same everywhere and not in the menu: " (scene.even.join(", ")) "." }
            @if !scene.left_out.is_empty() { " Left out, as the page would grow too large: " (scene.left_out.join(", ")) "; " code { "plyflow inspect" } " tells where the artifacts lie, which ParaView opens." } }
    }
}

/// The fields that are mapped, and those of the shape, with the scales of `plies`.
fn in_3d(study: &Study, plies: &[&Ply]) -> Vec<Legend> {
    let all = Field::ALL.iter().chain(&Field::OF_SHAPE);
    let detection = study.detection.as_ref();
    all.filter_map(|f| f.legend(plies, detection)).collect()
}

fn controls(scene: &Scene, n: usize) -> Markup {
    let switch = |kind: &str, value: &str, text: &str| {
        html! { label { input type="checkbox" checked data-show=(kind) value=(value); " " (text) } }
    };
    let on_request = |kind: &str, value: &str, text: &str| {
        html! { label { input type="checkbox" data-show=(kind) value=(value); " " (text) } }
    };
    html! {
        div class="controls" {
            @if !scene.legends.is_empty() {
                label for={ "field-" (n) } { "Colour" }
                select id={ "field-" (n) } {
                    @for (k, l) in scene.legends.iter().enumerate() { option value=(k) { (l.titled()) } }
                }
            }
            span class="group" { @for (name, [azimuth, elevation]) in STANDARD {
                button type="button" data-azimuth=(azimuth) data-elevation=(elevation) { (name) }
            } button type="button" data-reset { "Reset" } }
            span class="group" role="group" aria-label="Bodies" {
                @if scene.seen.tool { (switch("tool", "", "Tool")) }
                @for ply in &scene.seen.plies { (switch("ply", ply, ply)) }
            }
            span class="group" role="group" aria-label="Lines" {
                (on_request("edges", "", "Ply edges"))
                @if scene.fibres.is_some() { (on_request("fibres", "0", "Fibres 1")) (on_request("fibres", "1", "Fibres 2")) }
                // Of a mesh that is shown coarser than it is, the lines would be no elements.
                @if scene.seen.elements { (on_request("mesh", "", "Mesh")) }
            }
            @if !scene.seen.zones.is_empty() {
                span class="group" role="group" aria-label="Finer plies of zones" {
                    "Finer in zone " @for zone in &scene.seen.zones { (switch("zone", zone, zone)) }
                }
            }
        }
    }
}
