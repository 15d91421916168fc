//! Attributes and results of a run.

use crate::course::Outcome;
use crate::error::Result;
use crate::forming::Forming;
use crate::measure::{
    OVERLAP_BOUND, OVERLAP_PEAK_BOUND, Penetration, PenetrationPeak, ply_strains, tie_stretch,
};
use crate::output::warnings::warnings;
use crate::request::Parameters;
use crate::stack::{RigidName, regions, sheet, symmetry};
use crate::watch::{DEPTH_BOUND, Kind, PairDepth, depth_attributes};
use plyflow_model::artifact::{self, MeshQuality};
use plyflow_model::scene::{Sheet, SheetKind};
use plyflow_sdk::{Host, Log};
use plyflow_tooling::FieldError;
use std::collections::BTreeMap;

fn sheet_attributes(forming: &Forming, p: &Parameters) -> Vec<artifact::Sheet> {
    let sheets = forming.bodies.iter().zip(&forming.stack);
    sheets
        .map(|(body, s)| {
            let choice = match s.scene.kind {
                SheetKind::Diaphragm => &p.diaphragm_element,
                SheetKind::Ply => &p.element,
            };
            let added = forming.copies() * forming.model.sheets()[body.sheet.0].added_mass;
            let mut sheet = artifact::Sheet {
                material: Some(s.material.name.clone()),
                areal_mass: Some(s.material.areal_mass.si()),
                over_shear: s.material.over_shear.map(Into::into),
                added_mass: Some(added),
                element: Some(choice.plugin.clone()),
                regions: regions::attributes(&s.scene),
                tied_to: Sheet::ties(&p.scene.sheets)
                    .find(|(name, _)| *name == s.scene.name)
                    .map(|(_, below)| below.to_owned()),
                mesh_quality: body.quality,
                ..artifact::Sheet::new(&body.name, s.scene.kind, s.thickness, s.offset)
            };
            if let Some([cells, _]) = forming.model.bending_cells(body.sheet.0) {
                let elsewhere = p.element_elsewhere.as_ref();
                sheet.element_elsewhere = elsewhere.map(|e| e.plugin.clone());
                sheet.bending_elements = Some(forming.model.planes().copies() * cells);
            }
            if let Ok(blank) = sheet::blank(s) {
                sheet = sheet.with_fibres(&s.laid);
                sheet.outline = Some(blank.outline().to_vec());
                sheet.holes = blank.holes().to_vec();
            }
            sheet
        })
        .collect()
}

/// Penetrations by pair, at the end and largest on the way.
fn penetration_attributes(
    now: &[Penetration],
    peaks: &[PenetrationPeak],
) -> BTreeMap<String, artifact::Penetration> {
    (now.iter().zip(peaks))
        .map(|(p, peak)| {
            let of = artifact::Penetration {
                max: p.largest,
                q999: p.q999,
                overlap: Some(p.overlap()),
                place: p.place,
                peak: Some(artifact::PenetrationPeak {
                    max: peak.largest,
                    max_time: peak.largest_time,
                    place: peak.place,
                    q999: peak.q999,
                    q999_time: peak.q999_time,
                    q999_place: peak.q999_place,
                    overlap: Some(p.overlap_of(peak.q999)),
                }),
            };
            (p.pair.clone(), of)
        })
        .collect()
}

/// By how much what contacts see of rigid parts differs from their triangles, and where.
fn field_error_attributes(forming: &Forming) -> BTreeMap<String, artifact::FieldError> {
    let of = |(part, e): &(RigidName, FieldError)| {
        let (max, place) = (e.largest, e.at);
        (part.word().to_owned(), artifact::FieldError { max, place })
    };
    forming.field_errors.iter().map(of).collect()
}

fn attributes(
    p: &Parameters,
    forming: &Forming,
    outcome: &Outcome,
    penetrations: &[Penetration],
) -> artifact::Forming {
    let h = &outcome.health;
    let m = &forming.model;
    let elements = m.element_count();
    artifact::Forming {
        scene: Some(p.scene.name.clone()),
        sheets: sheet_attributes(forming, p),
        contact_by_place: true,
        without_bed: p.scene.process.is_without_bed(),
        symmetry: Some(symmetry::mirror_planes(m.planes())),
        element_size: forming.element_size,
        net_spacing: None,
        zone: forming.zone.clone(),
        slower: Some(forming.slower).filter(|s| *s != 1.0),
        time_step: Some(outcome.smallest_step),
        cycles: Some(outcome.cycles),
        element_cycles: Some(elements as f64 * outcome.cycles as f64),
        elements: elements as u64,
        energy: Some(artifact::Energy {
            peak_drift_ratio: Some(h.peak_drift_ratio),
            peak_kinetic_ratio: Some(h.peak_kinetic_ratio),
            kinetic_bound_kept: Some(h.peak_kinetic_ratio <= p.kinetic_bound),
            hourglass_ratio: Some(h.hourglass_ratio),
        }),
        penetration: Some(penetration_attributes(penetrations, &outcome.peaks)),
        overlap_bound: Some(OVERLAP_BOUND),
        overlap_peak_bound: Some(OVERLAP_PEAK_BOUND),
        tool_field_error: field_error_attributes(forming),
        depth: Some(depth_attributes(&outcome.depths)),
        depth_bound: Some(DEPTH_BOUND),
        tool_placement: forming.placement,
        warnings: warnings(forming, outcome, penetrations),
    }
}

/// Tells attributes and results of a run that came to its end; `rate`: steps per second.
pub fn write_summary(
    host: &Host,
    p: &Parameters,
    forming: &Forming,
    outcome: &Outcome,
    rate: f64,
) -> Result<()> {
    let penetrations = forming.penetrations();
    let attributes = attributes(p, forming, outcome, &penetrations);
    for w in &attributes.warnings {
        host.log(Log::Warn, w);
    }
    host.write_attributes(&attributes)?;
    write_health(host, forming, outcome, &penetrations)?;
    let errors = forming.field_errors.iter().map(|(_, e)| e.largest);
    host.result("tool_field_error", errors.fold(0.0, f64::max), "m")?;
    write_shape(host, forming)?;
    write_cost(host, forming, outcome, rate)
}

/// What the run took.
fn write_cost(host: &Host, forming: &Forming, outcome: &Outcome, rate: f64) -> Result<()> {
    let m = &forming.model;
    let elements = m.element_count() as f64;
    host.result("elements", elements, "1")?;
    host.result("cycles", outcome.cycles as f64, "1")?;
    host.result("time_step", outcome.smallest_step, "s")?;
    if let Some(shift) = outcome.start_shift {
        host.result("start_shift", shift, "m")?;
    }
    let added = m.sheets().iter().map(|s| s.added_mass).sum::<f64>();
    host.result("added_mass", forming.copies() * added, "kg")?;
    for (name, part) in [
        ("contact_share", m.spent().contacts),
        ("element_share", m.spent().elements),
        ("node_share", m.spent().nodes),
        ("load_share", m.spent().loads),
    ] {
        if let Some(share) = m.spent().share(part) {
            host.measured(name, share, "1")?;
        }
    }
    Ok(host.measured("element_cycle_rate", elements * rate, "1/s")?)
}

/// How far to trust the run: energies and penetrations.
fn write_health(
    host: &Host,
    forming: &Forming,
    outcome: &Outcome,
    now: &[Penetration],
) -> Result<()> {
    let h = &outcome.health;
    let worst = |f: fn(&Penetration) -> f64| now.iter().map(f).fold(0.0, f64::max);
    let peak = |f: fn(&Penetration, &PenetrationPeak) -> f64| {
        let pairs = now.iter().zip(&outcome.peaks);
        pairs.map(|(p, peak)| f(p, peak)).fold(0.0, f64::max)
    };
    host.result("kinetic_ratio", h.peak_kinetic_ratio, "1")?;
    host.result("kinetic_ratio_at_end", h.kinetic_ratio_at_end, "1")?;
    host.result("drift_ratio", h.peak_drift_ratio, "1")?;
    host.result("hourglass_ratio", h.hourglass_ratio, "1")?;
    host.result("penetration_max", worst(|p| p.largest), "m")?;
    host.result("penetration_q999", worst(|p| p.q999), "m")?;
    host.result("overlap_ratio", worst(Penetration::overlap), "1")?;
    host.result("penetration_peak_max", peak(|_, k| k.largest), "m")?;
    host.result("penetration_peak_q999", peak(|_, k| k.q999), "m")?;
    host.result("overlap_peak_ratio", peak(|p, k| p.overlap_of(k.q999)), "1")?;
    let deepest = |f: fn(&PairDepth) -> f64, counts: fn(&PairDepth) -> bool| {
        let of = outcome.depths.iter().filter(|d| counts(d));
        of.map(f).fold(0.0, f64::max)
    };
    let nodes = |d: &PairDepth| d.pair.kind == Kind::Nodes;
    let plies = |d: &PairDepth| d.pair.kind == Kind::Nodes && d.pair.of_ply;
    host.result("depth", deepest(|d| d.end.depth, nodes), "m")?;
    host.result("depth_ratio", deepest(PairDepth::share, nodes), "1")?;
    host.result("depth_peak", deepest(|d| d.peak.deep.depth, nodes), "m")?;
    host.result(
        "depth_peak_ratio",
        deepest(PairDepth::peak_share, nodes),
        "1",
    )?;
    host.result("ply_depth_ratio", deepest(PairDepth::share, plies), "1")?;
    host.result(
        "ply_depth_peak_ratio",
        deepest(PairDepth::peak_share, plies),
        "1",
    )?;
    let of = |kind: Kind| move |d: &&PairDepth| d.pair.kind == kind;
    for (name, kind) in [("edge_depth", Kind::Edges), ("film_hang", Kind::Hangs)] {
        let ends = outcome.depths.iter().filter(of(kind)).map(|d| d.end.depth);
        host.result(name, ends.fold(0.0, f64::max), "m")?;
    }
    if let Some([stretch, _]) = tie_stretch(forming) {
        host.result("tie_stretch", stretch, "m")?;
    }
    Ok(())
}

/// What the plies came to, and the quality of what they are meshed with.
fn write_shape(host: &Host, forming: &Forming) -> Result<()> {
    let outlined = || forming.bodies.iter().filter_map(|b| b.quality);
    if outlined().next().is_some() {
        let least = |f: fn(MeshQuality) -> f64| outlined().map(f).fold(f64::INFINITY, f64::min);
        host.result(
            "mesh_scaled_jacobian",
            least(|q| q.least_scaled_jacobian),
            "1",
        )?;
        host.result("mesh_least_edge", least(|q| q.least_edge), "1")?;
    }
    let strains = ply_strains(forming);
    host.result("shear_max", strains.shear[1], "rad")?;
    host.result("shear_min", strains.shear[0], "rad")?;
    host.result("fibre_strain_max", strains.fibre, "1")?;
    if forming.zone.is_none() {
        let ways = forming.draw_in();
        host.result("draw_in_max", ways.rim, "m")?;
        host.result("corner_draw_in_max", ways.corner, "m")?;
    }
    Ok(())
}
