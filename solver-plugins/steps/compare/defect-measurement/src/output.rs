//! The artifact: bodies with their fields, tables of defects, sections, distributions.

use crate::agreement::{self, Agreement};
use crate::compression;
use crate::measured::{Measured, SCAN, columns, not_judged};
use crate::read::{Beside, Run};
use crate::region::Regions;
use crate::sections::{Section, Sheet};
use crate::slipping::Slipping;
use crate::symmetry::Crests;
use plyflow_defects::align::Alignment;
use plyflow_defects::{Cause, Defect, Kind};
use plyflow_model::artifact::{
    self, Axis, Cell, FibreCompression, Map, MeasuredBody, MeasuredDefect, Measurement, Panel,
    Plot, ScanAgreement, ScanAlignment, ScanDefect, SectionOn, Series, Table,
};
use plyflow_sdk::{Host, Log, On, StepError};
use plyflow_surface::{SHARP, bin_width, density, weighted_mean, weighted_quantiles};

/// Columns of the table of defects: label, SI unit.
const COLUMNS: [(&str, &str); 15] = [
    ("defect", ""),
    ("on", ""),
    ("type", ""),
    ("likely cause", ""),
    ("length", "m"),
    ("amplitude", "m"),
    ("least radius", "m"),
    ("turn over a cell", "rad"),
    ("area", "m2"),
    ("direction", "rad"),
    ("x", "m"),
    ("y", "m"),
    ("mean shear along the crest", "rad"),
    ("smallest", "rad"),
    ("largest", "rad"),
];

/// Columns of the table of a scan's and a ply's defects.
const BOTH: [(&str, &str); 11] = [
    ("type", ""),
    ("in the simulation", ""),
    ("in the scan", ""),
    ("length", "m"),
    ("scanned", "m"),
    ("amplitude", "m"),
    ("scanned", "m"),
    ("area", "m2"),
    ("scanned", "m2"),
    ("x", "m"),
    ("y", "m"),
];

/// Quantiles of the distance that are told.
const QUANTILES: [(&str, f64); 4] = [("q50", 0.5), ("q90", 0.9), ("q99", 0.99), ("largest", 1.0)];

/// Fields of the strains along both families of fibres.
const STRAINS: [&str; 2] = ["fibre_strain_1", "fibre_strain_2"];

/// Writes what was measured.
pub struct Output<'a> {
    host: &'a Host,
    run: &'a Run,
    measured: &'a [Measured],
    agreement: Option<&'a Agreement>,
    plots: Vec<Plot>,
    sections: Vec<artifact::Section>,
    compression: Option<FibreCompression>,
    regions: Option<Regions>,
    /// Direction from which those of crests are told, from x (rad).
    pub axis: f64,
    /// Between plies, where there are several.
    pub slipping: Option<Slipping>,
}

impl<'a> Output<'a> {
    /// Of plies and scan on the tool of a run.
    pub fn new(
        host: &'a Host,
        run: &'a Run,
        measured: &'a [Measured],
        agreement: Option<&'a Agreement>,
    ) -> Self {
        Self {
            host,
            run,
            measured,
            agreement,
            plots: Vec::new(),
            sections: Vec::new(),
            compression: None,
            regions: None,
            axis: 0.0,
            slipping: None,
        }
    }

    /// Plies and scan as they are formed, with distance, curvature and number of the defect (0 where there is none).
    pub fn bodies(&mut self) -> Result<(), StepError> {
        let host = self.host;
        for m in self.measured {
            let (corners, cells) = m.ply.topology.connectivity();
            let about = MeasuredBody {
                ply: m.ply.name.clone(),
                simulated: m.simulated,
            };
            host.define_mesh(&m.ply.name, &m.ply.undeformed, corners, cells, &about)?;
        }
        host.begin_frame(self.run.time)?;
        for m in self.measured {
            let p = &m.ply;
            host.write_points(&p.name, &p.formed)?;
            let field = |name: &str, unit: &str, values: &[f64]| {
                host.write_field(&p.name, On::Points, name, 1, unit, values)
            };
            let distance: Vec<f64> = p.distance.iter().map(|d| d.value).collect();
            field("nodal_distance", "m", &distance)?;
            field("judged", "1", &p.judged())?;
            let curvature: Vec<f64> = p.curvature.iter().map(|k| k.max).collect();
            field("curvature_max", "1/m", &curvature)?;
            let mut number = vec![0.0; p.formed.len()];
            for (k, d) in m.defects.iter().enumerate() {
                d.nodes
                    .iter()
                    .for_each(|&i| number[i as usize] = (k + 1) as f64);
            }
            field("defect", "1", &number)?;
            if let Some(a) = self.agreement.filter(|_| !m.simulated) {
                field("deviation", "m", &a.deviation)?;
            }
            if !p.shear_angle.is_empty() {
                host.write_field(&p.name, On::Cells, "shear_angle", 1, "rad", &p.shear_angle)?;
            }
            if let Some(slipping) = self.slipping.as_ref().filter(|_| m.simulated) {
                slipping.write(host, &p.name)?;
            }
            for (name, strains) in STRAINS.iter().zip(&p.fibre_strains) {
                if !strains.is_empty() {
                    host.write_field(&p.name, On::Cells, name, 1, "1", strains)?;
                }
            }
        }
        host.end_frame()
    }

    /// Results and densities of the distance from the tool, by area.
    pub fn distances(&mut self) -> Result<(), StepError> {
        let host = self.host;
        let mut series = Vec::new();
        for m in self.measured {
            let p = &m.ply;
            host.result(&format!("judged_share.{}", p.name), p.judged_share(), "1")?;
            let areas = p.topology.node_areas(&p.undeformed);
            let judged = p.distance.iter().zip(&areas);
            let weights: Vec<f64> = judged
                .map(|(d, a)| if d.judged { *a } else { 0.0 })
                .collect();
            let values: Vec<f64> = p.distance.iter().map(|d| d.value.abs()).collect();
            let mean = weighted_mean(&values, &weights);
            host.result(&format!("distance_mean.{}", p.name), mean, "m")?;
            let found = weighted_quantiles(&values, &weights, &QUANTILES.map(|q| q.1));
            for ((name, _), value) in QUANTILES.iter().zip(&found) {
                host.result(&format!("distance_{name}.{}", p.name), *value, "m")?;
            }
            let range = found[QUANTILES.len() - 1].max(1e-6);
            let width = bin_width(range);
            let count = (range / width).ceil() as usize;
            let centres: Vec<f64> = (0..count).map(|k| (k as f64 + 0.5) * width).collect();
            let [x, y] = ["value", "density"].map(|n| format!("distributions/{}/{n}", p.name));
            host.write_f64(&x, &[count], "m", &centres)?;
            host.write_f64(
                &y,
                &[count],
                "1/m",
                &density(&values, &weights, width, count),
            )?;
            series.push(Series::new(&p.name, x, y));
        }
        self.plots.push(Plot {
            name: "distance_density".into(),
            title: Some("Distance from the tool, by area".into()),
            note: not_judged(self.measured),
            x: Axis::new("distance", "mm"),
            y: Axis::new("probability density", "1/mm"),
            series,
        });
        Ok(())
    }

    /// Results of fibre compression, and by how much it has fallen from the measurement `against`. `None`: the run does not tell it.
    pub fn compression(&mut self, found: Option<FibreCompression>) -> Result<(), StepError> {
        let host = self.host;
        for input in host.inputs_of("against")? {
            match &found {
                Some(found) => compression::against(host, found, &input)?,
                None => return Err(compression::unknown(self.run.step())),
            }
        }
        if let Some(found) = &found {
            compression::report(host, found)?;
        }
        self.compression = found;
        Ok(())
    }

    /// Results of the shear in regions.
    pub fn regions(&mut self, found: Regions) -> Result<(), StepError> {
        found.report(self.host)?;
        self.regions = Some(found);
        Ok(())
    }

    /// Cuts tool, plies, scan and the plies of runs beside along a path (x, y in m).
    pub fn section(
        &mut self,
        label: &str,
        path: &[[f64; 2]],
        on: SectionOn,
        beside: &[Beside],
    ) -> Result<(), StepError> {
        let number = self.sections.len();
        let measured = self
            .measured
            .iter()
            .map(|m| Sheet::measured(&m.ply, m.simulated));
        let sheets: Vec<Sheet<'_>> = measured.chain(beside.iter().map(Beside::sheet)).collect();
        let section = Section {
            label,
            path,
            on,
            number,
        };
        let (told, plot) = section.write(self.host, &self.run.tool.surface, &sheets)?;
        self.sections.push(told);
        self.plots.push(plot);
        Ok(())
    }

    /// Results of what the ply has of the scan.
    pub fn agreement(&self) -> Result<(), StepError> {
        let (Some(a), host) = (self.agreement, self.host) else {
            return Ok(());
        };
        for (name, value) in a.errors.told() {
            host.result(name, value, "1")?;
        }
        host.result("scan_judged_share", a.judged_share, "1")?;
        host.result("scan_covered_share", a.covered_share, "1")?;
        host.result("deviation_mean", a.mean, "m")?;
        host.result("deviation_rms", a.root_mean_square, "m")?;
        for ((name, _), value) in agreement::QUANTILES.iter().zip(&a.quantiles) {
            host.result(&format!("deviation_{name}"), *value, "m")?;
        }
        Ok(())
    }

    /// A row for each defect of the ply or the scan, those of both first; and the same for programs.
    fn beside_each_other(&self, a: &Agreement) -> (Vec<Vec<Cell>>, Vec<ScanDefect>) {
        let both = a.pairs.both.iter().map(|&(i, j)| (Some(i), Some(j)));
        let missed = a.pairs.missed.iter().map(|&j| (None, Some(j)));
        let wrong = a.pairs.wrong.iter().map(|&i| (Some(i), None));
        let (mut rows, mut list) = (Vec::new(), Vec::new());
        for (i, j) in both.chain(missed).chain(wrong) {
            let ours = i.map(|i| &a.simulated[i]);
            let theirs = j.map(|j| &a.scanned[j]);
            let Some(one) = theirs.or(ours) else { continue };
            let numbers = [(ours, a.ply.as_str()), (theirs, SCAN)].map(|(d, name)| {
                let of = self.measured.iter().find(|m| m.ply.name == name);
                d.zip(of).and_then(|(d, m)| number(m, d))
            });
            let told = |n: Option<usize>, d: Option<&Defect>| match (n, d) {
                (Some(n), _) => n.to_string(),
                (None, Some(_)) => "below the least size".to_owned(),
                (None, None) => "none".to_owned(),
            };
            let amplitude = |d: &Defect| d.amplitude;
            let area = |d: &Defect| d.area;
            let (a1, a2) = (ours.map(amplitude), theirs.map(amplitude));
            let (s1, s2) = (ours.map(area), theirs.map(area));
            let (l1, l2) = (ours.and_then(length), theirs.and_then(length));
            let (from_ply, from_scan) = (told(numbers[0], ours), told(numbers[1], theirs));
            rows.push(vec![
                one.kind.name().into(),
                from_ply.into(),
                from_scan.into(),
                l1.into(),
                l2.into(),
                a1.into(),
                a2.into(),
                s1.into(),
                s2.into(),
                one.centre[0].into(),
                one.centre[1].into(),
            ]);
            list.push(ScanDefect {
                kind: one.kind,
                simulated: numbers[0],
                scanned: numbers[1],
                length: [l1, l2],
                amplitude: [a1, a2],
                area: [s1, s2],
                centre: one.centre,
            });
        }
        (rows, list)
    }

    /// Counts, sums by ply, and the attributes.
    pub fn finish(self, alignment: Option<&Alignment>) -> Result<(), StepError> {
        let host = self.host;
        let simulated = || self.measured.iter().filter(|m| m.simulated);
        let count = |kind| simulated().flat_map(|m| of(m, kind)).count() as f64;
        host.result("wrinkle_count", count(Kind::Wrinkle), "1")?;
        host.result("bridging_count", count(Kind::Bridging), "1")?;
        if let Some(uppermost) = simulated().next_back() {
            let told = wrinkles(uppermost);
            for (what, unit, value) in told {
                host.result(&format!("uppermost_{what}"), value, unit)?;
            }
            self.changes(&told)?;
            let crests = Crests::of(uppermost, self.axis);
            for (what, unit, value) in crests.iter().flat_map(Crests::told) {
                host.result(&format!("uppermost_{what}"), value, unit)?;
            }
        }
        let (mut rows, mut defects) = (Vec::new(), Vec::new());
        for m in self.measured {
            let name = &m.ply.name;
            let area = of(m, Kind::Bridging).fold(0.0, |s, d| s + d.area);
            for (what, unit, value) in wrinkles(m) {
                host.result(&format!("{what}.{name}"), value, unit)?;
            }
            host.result(&format!("bridging_area.{name}"), area, "m2")?;
            let sharpest = of(m, Kind::Wrinkle).fold(0.0, |s: f64, d| s.max(d.sharpness));
            host.result(&format!("crest_sharpness.{name}"), sharpest, "rad")?;
            tell_sharpest(host, m);
            for (k, d) in m.defects.iter().enumerate() {
                rows.push(row(name, k + 1, d));
                defects.push(entry(m, k + 1, d));
            }
        }
        if let Some(a) = alignment {
            host.result("scan_rms", a.rms, "m")?;
            host.result("scan_freedoms", a.decided as f64, "1")?;
        }
        self.attributes(rows, defects, alignment)
    }

    /// `rows`: of the table of `defects`.
    fn attributes(
        self,
        rows: Vec<Vec<Cell>>,
        defects: Vec<MeasuredDefect>,
        alignment: Option<&Alignment>,
    ) -> Result<(), StepError> {
        let mut tables = vec![table("defects", "Defects", &COLUMNS, rows)];
        let agreement = self.agreement.map(|a| {
            let (rows, defects) = self.beside_each_other(a);
            let title = format!("{} and the scan", a.ply);
            tables.push(table("agreement", &title, &BOTH, rows));
            ScanAgreement {
                ply: a.ply.clone(),
                defects,
            }
        });
        tables.extend(self.compression.as_ref().map(compression::table));
        tables.extend(self.regions.as_ref().and_then(Regions::table));
        let uppermost = self.measured.iter().rfind(|m| m.simulated);
        let uppermost = uppermost.into_iter().flat_map(wrinkles);
        let maps = self.maps();
        let (slipping, mut plots) = (self.slipping.as_ref(), self.plots);
        tables.extend(slipping.iter().flat_map(|s| s.tables()));
        plots.extend(slipping.iter().flat_map(|s| s.plots()));
        self.host.write_attributes(&Measurement {
            defects,
            sections: self.sections,
            alignment: alignment.map(told_alignment),
            agreement,
            fibre_compression: self.compression,
            uppermost: uppermost.map(|(what, _, v)| (what.to_owned(), v)).collect(),
            slip: slipping.map(Slipping::told),
            plots,
            maps,
            tables,
        })
    }

    /// Results of how much longer and higher the wrinkles of the uppermost ply are than in the measurement `against`: shares of what that one has, none
    /// for what is 0 there. And whether one of both alone has wrinkles.
    fn changes(&self, now: &[(&'static str, &'static str, f64)]) -> Result<(), StepError> {
        for input in self.host.inputs_of("against")? {
            let other: Measurement = self.host.attributes(&input)?;
            if other.uppermost.is_empty() {
                let step = &input.step;
                return Err(format!("against: '{step}' tells nothing of its uppermost ply (attribute `uppermost`); expected a measurement of the plies of a run").into());
            }
            for (what, unit, value) in now {
                let Some(before) = other.uppermost.get(*what).copied() else {
                    continue;
                };
                if *what == "wrinkle_count" {
                    let verdict = |count: f64| f64::from(u8::from(count > 0.0));
                    let change = verdict(*value) - verdict(before);
                    self.host.result("uppermost_verdict_change", change, "1")?;
                }
                if *unit == "m" && before > 0.0 {
                    let name = format!("uppermost_{what}_change");
                    self.host.result(&name, value / before - 1.0, "1")?;
                }
            }
        }
        Ok(())
    }

    /// Maps of plies and scan.
    fn maps(&self) -> Vec<Map> {
        let simulated = || self.measured.iter().filter(|m| m.simulated);
        let scan = || self.measured.iter().filter(|m| !m.simulated);
        let map = |(field, title, unit): (&str, &str, &str), of: Vec<&Measured>| Map {
            name: field.to_owned(),
            title: Some(title.to_owned()),
            unit: unit.to_owned(),
            panels: of.into_iter().map(|m| panel(m, field)).collect(),
        };
        let mut maps = vec![
            map(
                ("nodal_distance", "Distance from the tool", "mm"),
                simulated().chain(scan()).collect(),
            ),
            map(
                ("curvature_max", "Largest curvature", "1/mm"),
                simulated().collect(),
            ),
        ];
        if let Some(a) = self.agreement {
            let title = format!("Height of the scan over {}", a.ply);
            maps.push(map(("deviation", &title, "mm"), scan().collect()));
        }
        for (k, name) in STRAINS.iter().enumerate() {
            let of: Vec<&Measured> = simulated()
                .filter(|m| !m.ply.fibre_strains[k].is_empty())
                .collect();
            if !of.is_empty() {
                let title = format!("Strain of the fibres of family {}", k + 1);
                maps.push(map((name, &title, "1"), of));
            }
        }
        if let Some(slipping) = &self.slipping {
            for (field, title) in slipping.maps() {
                let of: Vec<&Measured> =
                    simulated().filter(|m| slipping.has(&m.ply.name)).collect();
                if !of.is_empty() {
                    maps.push(map((&field, &title, "mm"), of));
                }
            }
        }
        maps
    }
}

/// Number of a defect in the table, by its nodes; `None` for one below the least sizes.
fn number(m: &Measured, d: &Defect) -> Option<usize> {
    let same = |o: &Defect| o.kind == d.kind && o.nodes == d.nodes;
    m.defects.iter().position(same).map(|k| k + 1)
}

fn of(m: &Measured, kind: Kind) -> impl Iterator<Item = &Defect> {
    m.defects.iter().filter(move |d| d.kind == kind)
}

/// What is told of the wrinkles of a ply: name, unit, value. A wrinkle stands off the tool by more than the distance threshold.
fn wrinkles(m: &Measured) -> [(&'static str, &'static str, f64); 4] {
    let all = || of(m, Kind::Wrinkle);
    let length = all().fold(0.0, |s, d| s + d.length);
    let longest = all().fold(0.0, |s: f64, d| s.max(d.length));
    let amplitude = all().fold(0.0, |s: f64, d| s.max(d.amplitude));
    [
        ("wrinkle_count", "1", all().count() as f64),
        ("wrinkle_length", "m", length),
        ("wrinkle_length_max", "m", longest),
        ("wrinkle_amplitude", "m", amplitude),
    ]
}

/// Absent for what has no ridge.
fn length(d: &Defect) -> Option<f64> {
    (d.kind == Kind::Wrinkle).then_some(d.length)
}

/// Absent for what has no crest.
fn sharpness(d: &Defect) -> Option<f64> {
    (d.kind == Kind::Wrinkle).then_some(d.sharpness)
}

/// Crests turn by no more than this (rad) over a cell whose radius is told within some per cent (`docs/decisions/0021`).
const TOLD: f64 = 0.25;

/// Says whose radius the mesh does not tell, and which would. On a scan, whose numbers are all that is known of it, that is a warning.
fn tell_sharpest(host: &Host, m: &Measured) {
    let sharp = |d: &&Defect| d.sharpness > SHARP;
    let of_all = of(m, Kind::Wrinkle).filter(sharp);
    let Some(sharpest) = of_all.max_by(|a, b| a.sharpness.total_cmp(&b.sharpness)) else {
        return;
    };
    let count = of(m, Kind::Wrinkle).filter(sharp).count();
    let numbered = m.defects.iter().position(|d| std::ptr::eq(d, sharpest));
    let text = format!(
        "{}: {count} of the wrinkles have crests as sharp as the mesh: that of wrinkle {} turns by {:.0} deg over one cell, so its radius and curvature \
         are not told by more than a third. Cells of {:.2} of their size there would do",
        m.ply.name,
        numbered.map_or(0, |k| k + 1),
        sharpest.sharpness.to_degrees(),
        TOLD / sharpest.sharpness
    );
    host.log(if m.simulated { Log::Info } else { Log::Warn }, &text);
}

fn panel(m: &Measured, field: &str) -> Panel {
    Panel {
        label: m.ply.name.clone(),
        body: m.ply.name.clone(),
        field: field.to_owned(),
    }
}

fn table(name: &str, title: &str, head: &[(&str, &str)], rows: Vec<Vec<Cell>>) -> Table {
    Table {
        name: name.to_owned(),
        title: Some(title.to_owned()),
        columns: columns(head),
        rows,
    }
}

/// As [`COLUMNS`].
fn row(name: &str, number: usize, d: &Defect) -> Vec<Cell> {
    let shear = d.ridge_shear.as_ref();
    vec![
        number.to_string().into(),
        name.into(),
        d.kind.name().into(),
        d.cause.map(Cause::name).into(),
        length(d).into(),
        d.amplitude.into(),
        d.radius().into(),
        sharpness(d).into(),
        d.area.into(),
        d.ridge_direction().into(),
        d.centre[0].into(),
        d.centre[1].into(),
        shear.map(|s| s.mean).into(),
        shear.map(|s| s.min).into(),
        shear.map(|s| s.max).into(),
    ]
}

fn entry(m: &Measured, number: usize, d: &Defect) -> MeasuredDefect {
    MeasuredDefect {
        on: m.ply.name.clone(),
        number,
        found: d.told(),
        length: length(d),
        crest_sharpness: sharpness(d),
        shear: d.shear,
        ridge: d.ridge.clone(),
    }
}

/// As the attributes have it: of the scan as given.
fn told_alignment(a: &Alignment) -> ScanAlignment {
    let (q, t) = (a.motion.rotation.coords, a.motion.translation.vector);
    ScanAlignment {
        quaternion: [q.x, q.y, q.z, q.w],
        shift: [t.x, t.y, t.z],
        rms: a.rms,
        passes: a.passes,
        freedoms: a.decided,
    }
}
