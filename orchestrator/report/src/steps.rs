//! What steps carry for people: tables, plots, maps and files of any artifact; coupons and characterisations with their numbers.

use crate::input::{Instance, ReportInput};
use crate::maps::{self, Map};
use crate::place::id_of_row;
use crate::plots;
use crate::read::{Facts, History, Ply, open, shown_sheet};
use crate::study::Run;
use crate::tables;
use maud::Markup;
use plyflow_model::artifact::{Coupon, ElementCount, Forming, TextFile};
use serde::Deserialize;

/// What a step carries for people.
const CARRIED: [&str; 4] = ["plots", "files", "tables", "maps"];
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
    pub(crate) maps: Vec<Map>,
    /// Its plots, drawn.
    pub(crate) plots: Vec<Markup>,
    /// Its text files.
    pub(crate) files: Vec<TextFile>,
    /// The first sheet of a coupon in the last frame.
    pub(crate) sheet: Option<Ply>,
    /// Energies of a coupon, if it has a history.
    pub(crate) run: Option<Run>,
}

/// Reads what is shown of all steps, in their order; what is wrong is added to `problems`.
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
            shown.instance = at;
            if let Some(run) = &mut shown.run {
                run.instance = at;
            }
            let panels: usize = shown.maps.iter().map(Map::panels).sum();
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
        title: a["title"]
            .as_str()
            .map_or_else(|| instance.label(), str::to_owned),
        numbers,
        files: files(&a["files"], wrong),
        tables: tables::drawn(
            a,
            &instance.record.results,
            &|row| id_of_row(at, row),
            wrong,
        ),
        ..Shown::default()
    };
    match open(&instance.artifact) {
        Ok(artifact) => {
            shown.plots = plots::drawn(a, &artifact, room[0], wrong);
            shown.maps = maps::read(a, &artifact, room[1], wrong);
            if facts.kind == "coupon" {
                shown.sheet = shown_sheet(&artifact);
                shown.run = run(instance, facts, wrong);
            }
        }
        Err(e) => wrong.push(e),
    }
    Some(shown)
}

fn files(value: &serde_json::Value, wrong: &mut Vec<String>) -> Vec<TextFile> {
    if value.is_null() {
        return Vec::new();
    }
    Vec::<TextFile>::deserialize(value).unwrap_or_else(|e| {
        wrong.push(format!("its attribute 'files': {e}"));
        Vec::new()
    })
}

/// What a coupon tells besides what it carries, which is read entry by entry.
fn coupon(facts: &Facts, wrong: &mut Vec<String>) -> Coupon {
    let mut told = facts.attributes.clone();
    if let Some(told) = told.as_object_mut() {
        told.retain(|key, _| !CARRIED.contains(&key.as_str()));
    }
    Coupon::deserialize(told).unwrap_or_else(|e| {
        wrong.push(format!("its attributes: {e}"));
        Coupon::default()
    })
}

/// The energies of a coupon, which has the histories of a forming run.
fn run(instance: &Instance, facts: &Facts, wrong: &mut Vec<String>) -> Option<Run> {
    let history = History::read(&instance.artifact)
        .map_err(|e| wrong.push(e))
        .ok()?;
    history.internal()?;
    let told = coupon(facts, wrong);
    let elements = told.elements.map_or(0, ElementCount::all);
    let cycles = told.cycles.unwrap_or(0);
    Some(Run {
        label: instance.label(),
        instance: 0,
        facts: Forming {
            energy: told.energy,
            element_size: told.element_size.unwrap_or(0.0),
            element_cycles: Some(elements as f64 * cycles as f64),
            elements,
            cycles: Some(cycles),
            ..Forming::default()
        },
        kinetic_bound: facts.provenance["parameters"]["kinetic_bound"].as_f64(),
        history,
    })
}
