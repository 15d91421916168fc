//! What steps carry for people: tables, plots, maps and files of any artifact; coupons and characterisations with their numbers.

use crate::input::{Instance, ReportInput};
use crate::page::carried_tables::table;
use crate::plain::{FieldMap, Ply, id_of_row};
use crate::read::{CARRIED, Facts, Run, coupon, files, maps, open, plots, shown_sheet, tables};
use maud::{Markup, html};
use plyflow_model::artifact::CarriedFile;

/// Plots that are drawn on a page.
const PLOTS: usize = 120;
/// The drawn plots of a page are together about this long at most (bytes).
const LENGTH: usize = 2_500_000;
/// Panels of maps that are drawn on a page.
const PANELS: usize = 60;
/// Steps of which the deformed sheet is drawn.
const PICTURES: usize = 12;

/// What is shown of one step.
#[derive(Debug, Default)]
pub(crate) struct Shown {
    /// Index of its instance.
    pub(crate) instance: usize,
    /// What it calls itself, else its label.
    pub(crate) title: String,
    /// Whether its results stand beside its plots: it is a coupon or a characterisation.
    pub(crate) numbers: bool,
    /// Its tables, drawn.
    pub(crate) tables: Vec<Markup>,
    /// Its maps.
    pub(crate) maps: Vec<FieldMap>,
    /// Its plots, drawn.
    pub(crate) plots: Vec<Markup>,
    /// Its files.
    pub(crate) files: Vec<CarriedFile>,
    /// The first sheet of a coupon in the last frame.
    pub(crate) sheet: Option<Ply>,
    /// Energies of a coupon, if it has a history.
    pub(crate) run: Option<Run>,
}

/// Reads what is shown of all steps, in their order, and draws plots at once, so that no more than one is in memory; what is wrong is added to `problems`.
pub(crate) fn read(
    input: &ReportInput,
    facts: &[Option<Facts>],
    problems: &mut Vec<String>,
) -> Vec<Shown> {
    let mut room = [PLOTS, PANELS];
    let mut length = 0;
    let mut pictures = PICTURES;
    let mut all = Vec::new();
    for (at, (instance, facts)) in input.instances.iter().zip(facts).enumerate() {
        let Some(facts) = facts else { continue };
        let mut wrong = Vec::new();
        if let Some(mut shown) = one((instance, at), facts, room, &mut wrong) {
            let panels: usize = shown.maps.iter().map(|m| m.panels.len()).sum();
            room[0] = room[0].saturating_sub(shown.plots.len());
            room[1] = room[1].saturating_sub(panels);
            length += shown.plots.iter().map(|p| p.0.len()).sum::<usize>();
            if length > LENGTH {
                room[0] = 0;
            }
            if shown.sheet.is_some() && pictures == 0 {
                shown.sheet = None;
            }
            pictures -= usize::from(shown.sheet.is_some());
            all.push(shown);
        }
        problems.extend(wrong.iter().map(|w| format!("{}: {w}", instance.label())));
    }
    all
}

/// What is shown of one step, of at most as many plots and panels of maps as there is room for.
fn one(
    (instance, at): (&Instance, usize),
    facts: &Facts,
    room: [usize; 2],
    wrong: &mut Vec<String>,
) -> Option<Shown> {
    let a = &facts.attributes;
    let numbers = matches!(facts.kind.as_str(), "coupon" | "characterisation");
    if !numbers && CARRIED.iter().all(|what| a[*what].is_null()) {
        return None;
    }
    let mut shown = Shown {
        instance: at,
        title: a["title"]
            .as_str()
            .map_or_else(|| instance.label(), str::to_owned),
        numbers,
        files: files(a, wrong),
        ..Shown::default()
    };
    let results = &instance.record.results;
    let drawn = |t| table(t, results, &|row| id_of_row(at, row));
    shown.tables = tables::read(a, wrong).iter().map(drawn).collect();
    match open(&instance.artifact) {
        Ok(artifact) => {
            plots::each(a, &artifact, room[0], wrong, |plot, note| {
                shown.plots.push(match note {
                    Some(note) => html! { div { (plot.svg()) p class="note" { (note) } } },
                    None => plot.svg(),
                });
            });
            shown.maps = maps::read(a, &artifact, room[1], wrong);
            if facts.kind == "coupon" {
                shown.sheet = shown_sheet(&artifact);
                shown.run = coupon::run(instance, at, facts, wrong);
            }
        }
        Err(e) => wrong.push(e.to_string()),
    }
    Some(shown)
}
