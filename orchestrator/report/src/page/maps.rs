//! Maps of the plies.

use crate::draw::{
    DrawError, Drawn, Field, FormedView, Legend, Mark, Overlay, Sharpness, Side, flat, formed,
};
use crate::plain::{Place, Ply, id_of};
use crate::read::{Local, Study};
use crate::units::{plural, quantity};
use maud::{Markup, html};
use plyflow_model::artifact::ComparedDefect;
use rayon::prelude::*;
use std::borrow::Cow;

/// Widths on the page (px).
const FLAT: f64 = 430.0;
const FORMED: f64 = 430.0;
const LOCAL: f64 = 340.0;

/// The scales of all maps of a study.
pub(super) fn legends(study: &Study) -> Vec<Legend> {
    let (plies, detection) = (study.all_plies(), study.detection.as_ref());
    let of = |f: &Field| f.legend(&plies, detection);
    Field::ALL.iter().filter_map(of).collect()
}

/// A quantity on a ply of the global run: flat, and formed from both sides.
fn triple(
    study: &Study,
    legend: &Legend,
    ply: &Ply,
    (overlay, places): (&Overlay, &[Place]),
    sharp: Sharpness,
) -> Result<[Markup; 3], DrawError> {
    let mine: Vec<&Place> = places.iter().filter(|p| p.ply == ply.name).collect();
    let selectable = Overlay {
        places: &mine,
        ..overlay.clone()
    };
    let view = |side| {
        let how = FormedView {
            side,
            tool: study.tool.as_ref(),
            whole_tool: true,
            width: FORMED,
        };
        formed(ply, legend, overlay, how, sharp)
    };
    let plan = flat(ply, legend, &selectable, FLAT, sharp)?;
    Ok([plan, view(Side::Front)?, view(Side::Back)?])
}

/// Maps of the global run: each quantity on each ply, flat and formed.
pub(super) fn global(study: &Study, n: usize, places: &[Place], sharp: Sharpness) -> Drawn {
    if study.plies.is_empty() {
        return Ok(html! {});
    }
    let overlay = Overlay {
        zones: study.zones.as_deref().unwrap_or_default(),
        ..Overlay::default()
    };
    let legends = legends(study);
    let has = |(l, p): &(&Legend, &Ply)| l.at_points(p).is_some();
    let pairs = (legends.iter()).flat_map(|l| study.plies.iter().map(move |p| (l, p)));
    let pairs: Vec<(&Legend, &Ply)> = pairs.filter(has).collect();
    let drawn: Vec<_> = pairs
        .par_iter()
        .map(|(legend, ply)| triple(study, legend, ply, (&overlay, places), sharp))
        .collect::<Result<_, DrawError>>()?;
    let rows = || pairs.iter().zip(&drawn);
    let of = |field| rows().filter(move |((l, _), _)| l.field == field);
    Ok(html! {
        section id={ "maps-" (n) } {
            h2 { "Maps of the global run" }
            @if let Some(run) = &study.global {
                p { "Step " code { (run.label) } ", elements of " (quantity(run.facts.element_size, "m", 3))
                    ". Left: the undeformed ply, axes in mm"
                    @if study.detection.is_some() { "; dotted: what the detection flagged" }
                    @if !overlay.zones.is_empty() { "; rectangles: the zones" }
                    ". Right: the formed ply on the tool, from both sides, shaded by the light: values are read off the flat one." }
            }
            @for legend in &legends {
                div class="field" {
                    h3 { (legend.title()) }
                    (legend.bar(&format!("scale-{n}-{}", legend.si_unit().replace('/', "-"))))
                    (legend.note_of(&study.plies))
                    @for ((_, ply), figures) in of(legend.field) {
                        div class="triple" {
                            @for (figure, what) in figures.iter().zip(["flat", "formed", "formed"]) {
                                figure class="map" { (figure) figcaption { (ply.name) ", " (what) } }
                            }
                        }
                    }
                }
            }
        }
    })
}

/// Maps of the local runs, with their defects named.
pub(super) fn local(study: &Study, n: usize, places: &[Place], sharp: Sharpness) -> Drawn {
    let legends = legends(study);
    let shown = study.locals.par_iter().filter(|l| !l.plies.is_empty());
    let draw = |local: &Local| zone((study, n), local, &legends, places, sharp);
    let zones: Vec<Markup> = shown.map(draw).collect::<Result<_, DrawError>>()?;
    if zones.is_empty() {
        return Ok(html! {});
    }
    Ok(html! {
        section id={ "local-" (n) } {
            h2 { "Local runs" }
            p { "Colours as in the maps of the global run; formed plies are shaded by the light."
                @if study.comparison.is_some() { " Solid outlines: wrinkles (W), dotted: bridging (B), with their id in the table of defects." } }
            div class="bars-row" {
                @for (k, legend) in legends.iter().enumerate() {
                    div { p class="note" { (legend.titled()) } (legend.bar(&format!("local-scale-{n}-{k}"))) }
                }
            }
            @for zone in &zones { (zone) }
        }
    })
}

fn zone(
    (study, n): (&Study, usize),
    local: &Local,
    legends: &[Legend],
    places: &[Place],
    sharp: Sharpness,
) -> Drawn {
    let compared = (study.comparison.as_ref()).map(|c| &c.told);
    let compared = compared.filter(|c| c.local_of(&local.zone).is_some());
    let defects: Vec<&ComparedDefect> = (compared.iter())
        .flat_map(|c| c.local_defects())
        .filter(|d| d.zone == local.zone)
        .collect();
    let mut rows = Vec::new();
    for ply in &local.plies {
        let marks: Vec<Mark> = (defects.iter())
            .filter(|d| d.ply == ply.name)
            .map(|d| Mark {
                text: d.id.clone(),
                at: d.found.centre,
                id: id_of(n, &d.id),
            })
            .collect();
        let here = |p: &&Place| p.ply == ply.name && p.zone.as_deref() == Some(&local.zone);
        let mine: Vec<&Place> = places.iter().filter(here).collect();
        let overlay = Overlay {
            zones: &[],
            marks: &marks,
            places: &mine,
        };
        let figures = figures(study, ply, legends, &overlay, sharp)?;
        rows.push((ply.name.clone(), marks.len(), figures));
    }
    Ok(html! {
        div class="zone-block" {
            h3 { "Zone " (local.zone) }
            p class="note" { "Step " code { (local.run.label) } ", elements of "
                (quantity(local.run.facts.element_size, "m", 3)) "." }
            @let bare = rows.iter().filter(|(_, found, _)| compared.is_some() && *found == 0).count();
            @if bare > 0 {
                p class="on-paper note" { (plural(bare, "ply", "plies")) " of this zone without wrinkle and bridging: on the screen alone." }
            }
            @for (name, found, figures) in &rows {
              div class=[(compared.is_some() && *found == 0).then_some("on-screen")] {
                h4 { (name) span class="note" { ": "
                    @if compared.is_none() { "not compared" }
                    @else if *found == 0 { "no wrinkle, no bridging" }
                    @else { (found) " found" } } }
                div class="row" {
                    @for (title, figure) in figures {
                        figure class="map" { (figure) figcaption { (title) } }
                    }
                }
              }
            }
        }
    })
}

/// The maps of a finer ply, each with its title, and the formed ply.
fn figures<'a>(
    study: &Study,
    ply: &Ply,
    legends: &'a [Legend],
    overlay: &Overlay<'_>,
    sharp: Sharpness,
) -> Result<Vec<(Cow<'a, str>, Markup)>, DrawError> {
    let known = || legends.iter().filter(|l| l.at_points(ply).is_some());
    let mut figures = Vec::new();
    for legend in known() {
        let map = flat(ply, legend, overlay, LOCAL, sharp)?;
        figures.push((legend.title().into(), map));
    }
    // The formed view shows the shape; the distance tells most on it.
    let distance = known().find(|l| l.field == Some(Field::Distance));
    if let Some(legend) = distance.or(known().next()) {
        let how = FormedView {
            side: Side::facing(ply),
            tool: study.tool.as_ref(),
            whole_tool: false,
            width: LOCAL,
        };
        let view = formed(ply, legend, overlay, how, sharp)?;
        figures.push((format!("{}, formed", legend.title()).into(), view));
    }
    Ok(figures)
}
