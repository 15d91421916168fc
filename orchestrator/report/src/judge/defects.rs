//! Wrinkles and bridging: as a comparison of fine runs has them, else as a measurement has them; where neither has looked, by what the
//! detection flags in the run of the whole part.

use super::draped;
use super::evidence::Evidence;
use crate::input::ReportInput;
use crate::judged::Finding;
use crate::read::{Material, Run, Study, judged_plies, open};
use crate::units::{plural, quantity};
use petgraph::unionfind::UnionFind;
use plyflow_model::artifact::{
    Attributes, ComparedDefect, Defect, MeasuredDefect, Measurement, Role, Zone, Zones,
};
use plyflow_model::workflow::{LimitOn, Limits};
use serde_json::Value;
use std::collections::BTreeMap;

/// Measurements of the plies of the global run of a study, by their instances.
pub(super) fn measurements(material: &Material, study: &Study) -> Vec<usize> {
    let Some(key) = study.global.as_ref().map(|g| g.key.as_str()) else {
        return Vec::new();
    };
    let is_of = |at: &usize| {
        let facts = material.facts[*at].as_ref();
        facts.is_some_and(|f| f.kind == Measurement::KIND && f.at_port("formed").any(|k| k == key))
    };
    (0..material.facts.len()).filter(is_of).collect()
}

/// What looked for defects in a study.
pub(super) struct Look<'a> {
    input: &'a ReportInput,
    material: &'a Material,
    study: &'a Study,
    /// What the detection flagged outside of the zones that fine runs have looked into.
    flagged: Flagged,
}

/// What a detection flagged where no finer run has looked.
#[derive(Default)]
struct Flagged {
    /// By ply: undeformed area (m2), and the node of it that is farthest from the tool, with its distance (m).
    plies: BTreeMap<String, (f64, [f64; 2], f64)>,
    /// Undeformed area of the largest connected place on a ply (m2).
    largest: f64,
    /// Why it is not known.
    unread: Option<String>,
}

impl<'a> Look<'a> {
    pub(super) fn new(input: &'a ReportInput, material: &'a Material, study: &'a Study) -> Self {
        Self {
            input,
            material,
            study,
            flagged: flagged(input, study),
        }
    }

    /// What is known of wrinkles or of bridging. The limits are asked which sizes matter: smaller ones than a step counts are not judged.
    pub(super) fn evidence(&self, on: LimitOn, limits: &Limits) -> Evidence {
        if self.study.comparison.is_some() {
            return self.compared(on, limits);
        }
        let measured = measurements(self.material, self.study);
        if measured.is_empty() {
            return self.detected(on, limits);
        }
        let all = measured.iter().map(|at| self.measured(*at, on, limits));
        let mut all: Vec<Evidence> = all.collect();
        // Where one of several leaves nothing open, nothing is, in whatever order they stand in the file. What any of them has found counts.
        if all.iter().any(|e| e.open.is_empty()) {
            all.iter_mut().for_each(|e| e.open.clear());
        }
        all.into_iter().fold(Evidence::default(), Evidence::and)
    }

    /// All wrinkles or places of bridging that were found, each once: of several measurements the first tells them.
    pub(super) fn list(&self, on: LimitOn) -> Vec<Finding> {
        let limits = Limits::default();
        match measurements(self.material, self.study).first() {
            Some(at) if self.study.comparison.is_none() => self.measured(*at, on, &limits),
            _ => self.evidence(on, &limits),
        }
        .findings
    }

    /// By the fine runs of the zones and the reference; elsewhere by the detection.
    fn compared(&self, on: LimitOn, limits: &Limits) -> Evidence {
        let Some(c) = &self.study.comparison else {
            return Evidence::default();
        };
        let mut all = Evidence::default();
        let judged = |d: &&ComparedDefect| {
            matches!(c.told.role(&d.model), Some(Role::Local | Role::Reference))
        };
        for d in c.told.defects.iter().filter(judged) {
            let Some(value) = value(on, &d.found, d.length) else {
                continue;
            };
            all.findings.push(Finding {
                name: Some(d.id.clone()),
                ply: d.ply.clone(),
                zone: Some(d.zone.clone()),
                at: d.found.centre,
                value,
                by: d.model.clone(),
                at_cut: d.touches_cut,
                cause: d.found.cause,
                crest_shear: d.found.ridge_shear,
            });
        }
        let at = self.input.instances.iter();
        let at = at.enumerate().find(|(_, i)| i.label() == c.label);
        let parameters = at.and_then(|(at, _)| self.parameters(at));
        all.open.extend(unseen(on, limits, parameters, &c.label));
        self.zones_without_runs(&mut all);
        if let Some(missed) = c.missed_text() {
            all.open
                .push(format!("no local run has {missed} of the reference"));
        }
        for local in &self.study.locals {
            self.bending(on, &local.run, &mut all);
        }
        let fine = self.study.locals.len();
        if fine > 0 {
            all.by.push(plural(
                fine,
                "fine run in its zone",
                "fine runs in their zones",
            ));
        }
        self.elsewhere(on, limits, &mut all);
        if !c.others.is_empty() {
            all.notes.push(format!(
                "judged by the fine runs of {}: those of {} in the same zones are not asked",
                c.label,
                c.others.join(", ")
            ));
        }
        all
    }

    /// Zones of which there is no fine run.
    fn zones_without_runs(&self, all: &mut Evidence) {
        let zones = self.study.zones.as_deref().unwrap_or_default();
        let seen = seen(self.study);
        let without: Vec<&str> = zones
            .iter()
            .filter(|z| !seen.iter().any(|s| s.name == z.name))
            .map(|z| z.name.as_str())
            .collect();
        if !without.is_empty() {
            let names = without.join(", ");
            all.open
                .push(format!("there is no fine run of zone {names}"));
        }
    }

    /// What the detection says of what lies outside of the zones.
    fn elsewhere(&self, on: LimitOn, limits: &Limits, all: &mut Evidence) {
        let Some(detection) = &self.study.detection else {
            all.open
                .push("no detection has looked at what lies outside of the zones".into());
            return;
        };
        if let Some(why) = &self.flagged.unread {
            all.open.push(why.clone());
        }
        let whole = self.study.global.as_ref().map_or("", |g| g.label.as_str());
        all.by.push(format!("elsewhere the detection in {whole}"));
        let area: f64 = self.flagged.plies.values().map(|f| f.0).sum();
        if area > 0.0 {
            let text = format!(
                "{} are flagged in {whole} where no fine run has looked",
                quantity(area, "m2", 3)
            );
            // Of a gap the detection tells how wide it is.
            match on == LimitOn::BridgingGap || self.flagged.largest < self.without_zone() {
                true => all.notes.push(text),
                false => all.open.push(text),
            }
        }
        if let Some(threshold) = detection.thresholds.distance_threshold
            && self.seen_from(on, limits) < threshold * (1.0 - 1e-9)
        {
            all.open.push(format!(
                "outside of the zones the detection flags distances from {} on only: lower its `distance_threshold`",
                quantity(threshold, "m", 3)
            ));
        }
        self.undraped(all);
        if on != LimitOn::BridgingGap {
            return;
        }
        for (ply, (_, at, distance)) in &self.flagged.plies {
            all.findings.push(Finding {
                name: None,
                ply: ply.clone(),
                zone: None,
                at: *at,
                value: *distance,
                by: whole.to_owned(),
                at_cut: false,
                cause: None,
                crest_shear: None,
            });
        }
    }

    /// Distance (m) from which on what stands off has to be seen for a limit: the limit itself where it is one on a distance, else what the comparison counts as standing off.
    fn seen_from(&self, on: LimitOn, limits: &Limits) -> f64 {
        if matches!(on, LimitOn::WrinkleHeight | LimitOn::BridgingGap) {
            return least(limits, on).unwrap_or(f64::INFINITY);
        }
        let compared = self.study.comparison.as_ref().and_then(|c| {
            let mut all = self.input.instances.iter();
            self.parameters(all.position(|i| i.label() == c.label)?)
        });
        let counted = compared.and_then(|p| p["distance_threshold"].as_f64());
        counted.unwrap_or(f64::INFINITY)
    }

    /// Area (m2) up to which a place that is flagged gets no zone.
    fn without_zone(&self) -> f64 {
        let at = self.study.detected_by;
        let Some(key) = at.map(|at| self.input.instances[at].record.key.as_str()) else {
            return 0.0;
        };
        let facts = self.material.facts.iter().flatten();
        let drawn = facts.filter(|f| f.kind == Zones::KIND && f.took(key));
        let least = drawn.filter_map(|f| f.provenance["parameters"]["minimum_area"].as_f64());
        least.fold(0.0, f64::max)
    }

    /// What of the whole part is not draped, so that no defect can be seen there.
    fn undraped(&self, all: &mut Evidence) {
        let Some(run) = &self.study.global else {
            return;
        };
        let seen = seen(self.study);
        match draped::undraped(self.input, run, |at| seen.iter().any(|z| z.holds(at, 0.0))) {
            Ok(plies) => all.open.extend(plies.into_iter().map(|(ply, area)| {
                let area = quantity(area, "m2", 3);
                format!("{area} of {ply} are not draped in {}", run.label)
            })),
            Err(why) => all
                .open
                .push(format!("{} cannot be read: {why}", run.label)),
        }
    }

    /// A drape by geometry alone lays all of a ply on the tool: that it has no bridging says nothing.
    fn bridges(&self, on: LimitOn, run: &Run, all: &mut Evidence) {
        let on_bridging = matches!(on, LimitOn::BridgingGap | LimitOn::BridgingArea);
        if on_bridging && run.facts.net_spacing.is_some() {
            all.open.push(format!(
                "{} lays its plies on the tool by geometry alone, so that it has no bridging of its own",
                run.label
            ));
        }
    }

    /// By a measurement of the plies of the whole.
    fn measured(&self, at: usize, on: LimitOn, limits: &Limits) -> Evidence {
        let label = self.input.instances[at].label();
        let told = self.material.facts[at]
            .as_ref()
            .map(|f| &f.attributes["defects"]);
        let read = told.map(|d| serde_json::from_value::<Vec<MeasuredDefect>>(d.clone()));
        let list = match read {
            Some(Ok(list)) => list,
            _ => return Evidence::none(format!("the defects of {label} cannot be read")),
        };
        let mut all = Evidence {
            by: vec![label.clone()],
            ..Evidence::default()
        };
        let run = self.study.global.as_ref();
        for d in &list {
            // A scan is not the part that is computed.
            if run.is_some_and(|r| r.facts.plies().all(|p| p.name != d.on)) {
                continue;
            }
            let found = value(on, &d.found, d.length.unwrap_or(0.0));
            all.findings.extend(found.map(|value| Finding {
                name: Some(format!("{} {}", d.found.kind.name(), d.number)),
                ply: d.on.clone(),
                zone: None,
                at: d.found.centre,
                value,
                by: label.clone(),
                at_cut: false,
                cause: d.found.cause,
                crest_shear: d.found.ridge_shear,
            }));
        }
        all.open
            .extend(unseen(on, limits, self.parameters(at), &label));
        if let Some(run) = run {
            self.bending(on, run, &mut all);
            self.bridges(on, run, &mut all);
        }
        self.undraped(&mut all);
        all
    }

    /// Without either: a detection tells of gaps alone.
    fn detected(&self, on: LimitOn, limits: &Limits) -> Evidence {
        if self.study.detection.is_none() {
            return Evidence::none(
                "no step measures defects: add `defect-measurement`, or zones with `comparison`",
            );
        }
        if on == LimitOn::BridgingGap {
            let mut all = Evidence::default();
            self.zones_without_runs(&mut all);
            self.elsewhere(on, limits, &mut all);
            if let Some(run) = &self.study.global {
                self.bridges(on, run, &mut all);
            }
            return all;
        }
        Evidence::none("no fine run has been compared: `comparison` tells the sizes of defects")
    }

    fn parameters(&self, at: usize) -> Option<&'a Value> {
        Some(&self.material.facts[at].as_ref()?.provenance["parameters"])
    }

    /// Plies whose elements do not bend cannot wrinkle: that they have none says nothing.
    fn bending(&self, on: LimitOn, run: &Run, all: &mut Evidence) {
        if matches!(on, LimitOn::WrinkleHeight | LimitOn::WrinkleLength) && !bends(self.input, run)
        {
            all.open.push(format!(
                "the elements of {} do not bend, so that it has no wrinkles of its own",
                run.label
            ));
        }
    }
}

/// The size of a defect that is limited; `None` when it is another kind of defect.
fn value(on: LimitOn, found: &Defect, length: f64) -> Option<f64> {
    match (on, found.is_wrinkle()) {
        (LimitOn::WrinkleHeight, true) | (LimitOn::BridgingGap, false) => Some(found.amplitude),
        (LimitOn::WrinkleLength, true) => Some(length),
        (LimitOn::BridgingArea, false) => Some(found.area),
        _ => None,
    }
}

/// The smallest limit on a quantity, at the part or at a place.
fn least(limits: &Limits, on: LimitOn) -> Option<f64> {
    let all = std::iter::once(&limits.part).chain(limits.places.iter().map(|p| &p.values));
    all.filter_map(|v| v.of(on)).min_by(f64::total_cmp)
}

/// From which sizes on the steps count a defect where nobody says otherwise, by their parameters (SI).
const USUAL: [(&str, f64, &str); 4] = [
    ("distance_threshold", 1e-3, "m"),
    ("curvature_threshold", 100.0, "1/m"),
    ("minimum_wrinkle_length", 10e-3, "m"),
    ("minimum_bridging_area", 50e-6, "m2"),
];

/// Why defects are not seen that matter to a limit: a step counts larger ones only. What is limited is held against the smallest limit; of its other sizes no limit
/// speaks, and those of a defect are the usual ones.
fn unseen(on: LimitOn, limits: &Limits, parameters: Option<&Value>, label: &str) -> Vec<String> {
    let own = match on {
        LimitOn::WrinkleLength => "minimum_wrinkle_length",
        LimitOn::BridgingArea => "minimum_bridging_area",
        _ => "distance_threshold",
    };
    let of_others = match on {
        LimitOn::WrinkleHeight | LimitOn::WrinkleLength => "minimum_bridging_area",
        _ => "minimum_wrinkle_length",
    };
    let wrinkles = of_others == "minimum_bridging_area";
    let asked = |key: &str| key != of_others && (wrinkles || key != "curvature_threshold");
    let all = USUAL.into_iter().filter(|(key, ..)| asked(key));
    let from = |key: &str| parameters?[key].as_f64();
    let missed = all.filter_map(|(key, usual, unit)| {
        let from = from(key)?;
        let most = if key == own {
            least(limits, on)?
        } else {
            usual
        };
        (most < from * (1.0 - 1e-9)).then(|| {
            let shown = |v: f64| quantity(v, unit, 3);
            let (from, most) = (shown(from), shown(most));
            format!(
                "{label} counts what is larger than {from} only: give it `{key}` of {most} or less"
            )
        })
    });
    missed.collect()
}

/// Whether the plies of a run bend: shells tell curvatures and moments.
fn bends(input: &ReportInput, run: &Run) -> bool {
    let Ok(artifact) = open(&input.instances[run.instance].artifact) else {
        return false;
    };
    let told = |name: &str| name.starts_with("bending_moment") || name.starts_with("curvature_");
    run.facts.plies().any(|p| {
        let body = artifact.body(&p.name);
        body.is_ok_and(|b| b.fields.iter().any(|f| told(&f.name)))
    })
}

/// What the detection of a study flagged where no fine run has looked.
fn flagged(input: &ReportInput, study: &Study) -> Flagged {
    let mut all = Flagged::default();
    let Some(at) = study.detected_by.filter(|_| study.detection.is_some()) else {
        return all;
    };
    let path = &input.instances[at].artifact;
    let plies = match judged_plies(path) {
        Ok(plies) => plies,
        Err(e) => {
            let label = input.instances[at].label();
            all.unread = Some(format!("what {label} flags cannot be read: {e}"));
            return all;
        }
    };
    let seen = seen(study);
    for (_, ply) in plies {
        let off = ply.distance.as_deref().unwrap_or_default();
        let mut pieces = Pieces::of(ply.flat.len());
        for (cell, mark) in ply.cells.iter().zip(&ply.marked) {
            let corners = cell.map(|i| ply.flat[i as usize]);
            let middle = [0, 1].map(|d| corners.iter().map(|c| c[d]).sum::<f64>() / 4.0);
            if *mark == crate::plain::Marked::No || seen.iter().any(|z| z.holds(&middle, 0.0)) {
                continue;
            }
            let [a, b, c, d] = corners;
            let cross = (c[0] - a[0]) * (d[1] - b[1]) - (c[1] - a[1]) * (d[0] - b[0]);
            let known = (all.plies)
                .entry(ply.name.clone())
                .or_insert((0.0, middle, 0.0));
            known.0 += 0.5 * cross.abs();
            pieces.add(cell, 0.5 * cross.abs());
            let far = cell.iter().filter_map(|i| off.get(*i as usize));
            let far = far.copied().filter(|v| v.is_finite()).fold(0.0, f64::max);
            if far > known.2 {
                (known.1, known.2) = (middle, far);
            }
        }
        all.largest = all.largest.max(pieces.largest());
    }
    all
}

/// The zones into which fine runs have looked.
fn seen(study: &Study) -> Vec<&Zone> {
    let zones = study.zones.as_deref().unwrap_or_default().iter();
    let has_run = |z: &&Zone| study.locals.iter().any(|l| l.zone == z.name);
    zones.filter(has_run).collect()
}

/// Cells of a mesh that hang together by their nodes.
struct Pieces {
    nodes: UnionFind<u32>,
    /// A node of each cell, and the cell's area (m2).
    cells: Vec<(u32, f64)>,
}

impl Pieces {
    fn of(nodes: usize) -> Self {
        Self {
            nodes: UnionFind::new(nodes),
            cells: Vec::new(),
        }
    }

    fn add(&mut self, cell: &[u32; 4], area: f64) {
        cell[1..].iter().for_each(|i| {
            self.nodes.union(cell[0], *i);
        });
        self.cells.push((cell[0], area));
    }

    /// Area of the largest piece (m2).
    fn largest(&self) -> f64 {
        let mut areas: BTreeMap<u32, f64> = BTreeMap::new();
        for (node, area) in &self.cells {
            *areas.entry(self.nodes.find(*node)).or_default() += area;
        }
        areas.into_values().fold(0.0, f64::max)
    }
}
