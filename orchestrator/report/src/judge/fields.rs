//! Shear, strain and deviation of fibres: in every cell of the finest run that has it.

use super::draped;
use super::evidence::Evidence;
use super::governed::Governed;
use crate::input::ReportInput;
use crate::judged::{Finding, size};
use crate::plain::PlyShape;
use crate::read::{Material, Run, Study, last_frame, open, quads};
use crate::units::{plural, quantity};
use plyflow_artifact::{Artifact, On};
use plyflow_model::artifact::Zone;
use plyflow_model::workflow::LimitOn;
use std::collections::BTreeMap;

/// The cells of a ply of a run, by what is limited of them.
struct Sheet {
    ply: String,
    /// `[cells][x, y]` (m), their middles in the flat ply.
    at: Vec<[f64; 2]>,
    /// `[cells]` (rad); none where the run does not tell it.
    shear: Option<Vec<f64>>,
    /// `[cells]` (1), of both families the larger by size; none where the run does not tell it.
    strain: Option<Vec<f64>>,
    /// `[cells]` (rad), of both families the larger by size, NaN where it is not known; none where the run does not tell the fibres.
    deviation: Option<Vec<f64>>,
    /// Undeformed area that has no shape (m2).
    undraped: f64,
    /// Cells in which the deviation is not known: their middles in the flat ply (m) and their undeformed areas (m2).
    steep: Vec<([f64; 2], f64)>,
}

/// A run with its cells.
struct Looked<'a> {
    run: &'a Run,
    /// Of the fine run of a zone.
    zone: Option<&'a Zone>,
    /// The plies, or why they cannot be read.
    plies: Result<Vec<Sheet>, String>,
}

/// The runs of a study with what their cells tell.
pub(super) struct Look<'a> {
    runs: Vec<Looked<'a>>,
    zones: Vec<&'a Zone>,
}

impl<'a> Look<'a> {
    pub(super) fn new(input: &ReportInput, _: &Material, study: &'a Study) -> Self {
        let zones = study.zones.as_deref().unwrap_or_default();
        let whole = study.global.iter().map(|run| (run, None));
        let locals = study.locals.iter();
        let locals = locals.map(|l| (&l.run, zones.iter().find(|z| z.name == l.zone)));
        let runs: Vec<Looked<'a>> = (whole.chain(locals))
            .map(|(run, zone)| Looked {
                run,
                zone,
                plies: sheets(input, run),
            })
            .collect();
        let zones = runs.iter().filter_map(|r| r.zone).collect();
        Self { runs, zones }
    }

    /// The middles of the cells of all runs that can be read, by ply (m).
    pub(super) fn cells(&self) -> Vec<(&str, &[[f64; 2]])> {
        let plies = self.runs.iter().filter_map(|r| r.plies.as_ref().ok());
        let sheets = plies.flatten();
        sheets.map(|s| (s.ply.as_str(), s.at.as_slice())).collect()
    }

    /// What all cells tell of a quantity: for each run, ply and place of the limits the worst one.
    pub(super) fn evidence(&self, on: LimitOn, governed: &Governed<'_>) -> Evidence {
        let mut all = Evidence::default();
        for looked in &self.runs {
            let label = &looked.run.label;
            let plies = match &looked.plies {
                Ok(plies) => plies,
                Err(why) => {
                    all.open.push(format!("{label} cannot be read: {why}"));
                    continue;
                }
            };
            for ply in plies {
                let (values, what) = match on {
                    LimitOn::FibreStrain => (&ply.strain, "strains of fibres"),
                    LimitOn::FibreDeviation => (&ply.deviation, "directions of fibres"),
                    _ => (&ply.shear, "shear angles"),
                };
                let Some(values) = values else {
                    let text = format!("{label} tells no {what} of {}", ply.ply);
                    all.open.push(text);
                    continue;
                };
                if ply.undraped > 0.0 {
                    let area = quantity(ply.undraped, "m2", 3);
                    let text = format!("{area} of {} are not draped in {label}", ply.ply);
                    all.open.push(text);
                }
                let steep = self.steep(on, looked, ply);
                if steep > 0.0 {
                    all.open.push(format!(
                        "{} of {} in {label} stand across the x axis, from which fibres are told, by more than 60 deg",
                        quantity(steep, "m2", 3),
                        ply.ply
                    ));
                }
                all.findings
                    .extend(self.worst(on, looked, ply, values, governed));
            }
        }
        all.by = self.by();
        all
    }

    /// Undeformed area of a ply in which no deviation of fibres is known (m2), without that in which a finer run has looked.
    fn steep(&self, on: LimitOn, looked: &Looked<'_>, ply: &Sheet) -> f64 {
        let asked = |_: &&([f64; 2], f64)| on == LimitOn::FibreDeviation;
        let own = |(at, _): &&([f64; 2], f64)| !self.has_finer(looked, at);
        let cells = ply.steep.iter().filter(asked).filter(own);
        cells.map(|(_, area)| area).sum()
    }

    /// Whether a finer run has looked at a place of the flat ply (m).
    fn has_finer(&self, looked: &Looked<'_>, at: &[f64; 2]) -> bool {
        looked.zone.is_none() && self.zones.iter().any(|z| z.holds(at, 0.0))
    }

    /// The worst cell of a ply at each place of the limits, of those in which no finer run has looked.
    fn worst(
        &self,
        on: LimitOn,
        looked: &Looked<'_>,
        ply: &Sheet,
        values: &[f64],
        governed: &Governed<'_>,
    ) -> Vec<Finding> {
        let mut worst: BTreeMap<Option<usize>, (f64, [f64; 2])> = BTreeMap::new();
        let known = |(value, _): &(&f64, _)| value.is_finite();
        for (value, at) in values.iter().zip(&ply.at).filter(known) {
            let finer = self.has_finer(looked, at);
            let Some(place) = governed.place_at(on, &ply.ply, *at).filter(|_| !finer) else {
                continue;
            };
            let known = worst.entry(place).or_insert((*value, *at));
            if size(on, *value) > size(on, known.0) {
                *known = (*value, *at);
            }
        }
        let finding = |(value, at)| Finding {
            name: None,
            ply: ply.ply.clone(),
            zone: looked.zone.map(|z| z.name.clone()),
            at,
            value,
            by: looked.run.label.clone(),
            at_cut: false,
            cause: None,
            crest_shear: None,
        };
        worst.into_values().map(finding).collect()
    }

    fn by(&self) -> Vec<String> {
        let fine = self.runs.iter().filter(|r| r.zone.is_some()).count();
        let whole = self.runs.iter().find(|r| r.zone.is_none());
        let mut by = Vec::new();
        if fine > 0 {
            by.push(plural(
                fine,
                "fine run in its zone",
                "fine runs in their zones",
            ));
        }
        by.extend(whole.map(|w| match fine {
            0 => w.run.label.clone(),
            _ => format!("{} elsewhere", w.run.label),
        }));
        by
    }
}

/// The plies of a run in its last frame.
fn sheets(input: &ReportInput, run: &Run) -> Result<Vec<Sheet>, String> {
    let path = &input.instances[run.instance].artifact;
    let artifact = open(path).map_err(|e| e.to_string())?;
    let plies = run.facts.plies();
    plies.map(|p| sheet(&artifact, p)).collect()
}

fn sheet(artifact: &Artifact, told: &plyflow_model::artifact::Sheet) -> Result<Sheet, String> {
    let name = told.name.as_str();
    let said = |e: &dyn std::fmt::Display| e.to_string();
    let frame = last_frame(artifact).map_err(|e| said(&e))?;
    let body = artifact.body(name).map_err(|e| said(&e))?;
    let (flat, cells) = artifact.mesh(name).map_err(|e| said(&e))?;
    let cells = quads(name, &cells, body.nodes_per_cell).map_err(|e| said(&e))?;
    let field = |what: &str| {
        let values = artifact.frame_field(name, frame, On::Cells, what).ok();
        values.filter(|v| v.len() == cells.len())
    };
    // What is not draped has no shear, though noughts stand there.
    let is_draped = field("draped");
    let kept: Vec<usize> = (0..cells.len())
        .filter(|i| is_draped.as_ref().is_none_or(|d| d[*i] > 0.5))
        .collect();
    let of_kept = |values: Vec<f64>| kept.iter().map(|i| values[*i]).collect::<Vec<f64>>();
    let larger = |(a, b): (f64, f64)| if b.abs() > a.abs() { b } else { a };
    let strain = match (field("fibre_strain_1"), field("fibre_strain_2")) {
        (Some(a), Some(b)) => Some(a.into_iter().zip(b).map(larger).collect()),
        (a, b) => a.or(b),
    };
    let corners = |i: usize| {
        cells[i].map(|n| {
            let [x, y, _] = flat[n as usize];
            [x, y]
        })
    };
    let middle = |i: &usize| draped::middle(&corners(*i));
    let area = |i: usize| draped::area(&corners(i));
    let bare = |i: &usize| is_draped.as_ref().is_some_and(|d| d[*i] <= 0.5);
    let formed = artifact.frame_points(name, frame).map_err(|e| said(&e))?;
    let laid = told.laid();
    let shape = PlyShape::of((&flat, &formed), &cells, None, (laid.as_ref(), None));
    let deviation = shape.larger_deviation().map(of_kept);
    let unknown = |d: &Vec<f64>| -> Vec<([f64; 2], f64)> {
        let cells = kept.iter().zip(d).filter(|(_, d)| d.is_nan());
        cells.map(|(i, _)| (middle(i), area(*i))).collect()
    };
    Ok(Sheet {
        ply: name.to_owned(),
        at: kept.iter().map(middle).collect(),
        shear: field("shear_angle").map(of_kept),
        strain: strain.map(of_kept),
        steep: deviation.as_ref().map(unknown).unwrap_or_default(),
        deviation,
        undraped: (0..cells.len()).filter(bare).map(area).sum(),
    })
}
