//! Slip in the artifact: fields, sections, results.

use crate::measured::{Measured, check_names, columns};
use crate::slip::{Course, Faces, Line, Slip, course, mirrored, size};
use plyflow_defects::Ply;
use plyflow_fixed::FixedBits;
use plyflow_model::artifact::{
    Axis, Cell, Plot, PlySlip, Series, SlipCourse, SlipPair, SlipSection, Table,
};
use plyflow_sdk::{Host, Log, On, StepError};
use plyflow_surface::weighted_mean;
use serde::Deserialize;

/// More stations on either side of a section's middle are not looked at.
const STATIONS: f64 = 100_000.0;
/// Where less than this share of a section has its mirror image, one is told so.
const ONE_SIDED: f64 = 0.5;
/// The parts of slip, as results, arrays and fields name them.
const PARTS: [&str; 2] = ["along", "across"];

/// Columns of the table of plies that lie on each other: label, SI unit.
const PAIR_COLUMNS: [(&str, &str); 6] = [
    ("ply", ""),
    ("over", ""),
    ("largest slip", "m"),
    ("mean", "m"),
    ("largest along", "m"),
    ("largest across", "m"),
];

/// Columns of the table of sections: label, SI unit.
const SECTION_COLUMNS: [(&str, &str); 9] = [
    ("section", ""),
    ("ply", ""),
    ("over", ""),
    ("part", ""),
    ("largest", "m"),
    ("mean", "m"),
    ("symmetric part (rms)", "m"),
    ("antisymmetric part (rms)", "m"),
    ("share of the antisymmetric", "1"),
];

/// What the manifest has of slip.
#[derive(Deserialize)]
pub struct Asked {
    slip_direction: f64,
    slip_step: f64,
    slip_sections: Vec<AskedSection>,
}

/// A line on the flat plies.
#[derive(Deserialize)]
struct AskedSection {
    name: String,
    /// Its middle (m).
    at: Vec<f64>,
    /// From x (rad).
    direction: f64,
    /// (m).
    length: Option<f64>,
}

/// By node of a ply: the number of the ply on which it lies, and its slip over it.
type Field = Vec<Option<(usize, Slip)>>;

/// A section and two plies that lie on each other there.
struct Cut {
    section: usize,
    pair: [String; 2],
    /// (m).
    stations: Vec<f64>,
    values: [Vec<f64>; 2],
    courses: [Course; 2],
}

/// The slip of the plies of a run.
pub struct Slipping {
    direction: f64,
    /// By ply, from the tool upwards; empty of one that lies on none.
    fields: Vec<(String, Field)>,
    names: Vec<String>,
    pairs: Vec<SlipPair>,
    cuts: Vec<Cut>,
    sections: Vec<String>,
}

impl Asked {
    /// Direction along which slip is told, from x (rad).
    pub fn direction(&self) -> f64 {
        self.slip_direction
    }

    fn line(&self, section: &AskedSection, faces: &Faces<'_>) -> Result<Line, StepError> {
        let middle = <[f64; 2]>::try_from(&section.at[..])
            .map_err(|_| "slip_sections: `at` is a place [x, y]")?;
        let reach = section
            .length
            .map_or_else(|| faces.reach(middle), |l| 0.5 * l);
        let count = (reach / self.slip_step + 1e-9).floor();
        if count > STATIONS {
            return Err(format!(
                "slip_step: section '{}' would have {count:.0} stations on either side of its middle, a place every {} mm; expected at most {STATIONS}",
                section.name,
                1e3 * self.slip_step
            )
            .into());
        }
        Ok(Line {
            middle,
            axis: [section.direction.fixed_cos(), section.direction.fixed_sin()],
            step: self.slip_step,
            reach: count as i64,
        })
    }

    fn check(&self) -> Result<(), StepError> {
        check_names(
            "slip_sections",
            self.slip_sections.iter().map(|s| s.name.as_str()),
        )
    }
}

impl Slipping {
    /// Of the plies of a run, from the tool upwards. `None` of a single ply.
    ///
    /// # Errors
    /// When a section cannot be taken, or meets no two plies that lie on each other.
    pub fn of(
        host: &Host,
        measured: &[Measured],
        asked: &Asked,
    ) -> Result<Option<Self>, StepError> {
        asked.check()?;
        let plies: Vec<&Ply> = (measured.iter())
            .filter(|m| m.simulated)
            .map(|m| &m.ply)
            .collect();
        if plies.len() < 2 {
            return match asked.slip_sections.first() {
                None => Ok(None),
                Some(s) => Err(format!(
                    "slip_sections: '{}': the run has one ply, and nothing to slip on",
                    s.name
                )
                .into()),
            };
        }
        let Some(faces) = Faces::new(&plies, asked.slip_direction) else {
            let why = "the plies of the run are not all meshes of quads, so their places cannot be found in each other";
            if asked.slip_sections.is_empty() {
                host.log(Log::Info, &format!("no slip between plies is told: {why}"));
                return Ok(None);
            }
            return Err(format!("slip_sections: {why}").into());
        };
        let mut slipping = Self {
            direction: asked.slip_direction,
            fields: Vec::new(),
            names: plies.iter().map(|p| p.name.clone()).collect(),
            pairs: Vec::new(),
            cuts: Vec::new(),
            sections: asked.slip_sections.iter().map(|s| s.name.clone()).collect(),
        };
        let fields: Vec<Field> = (0..faces.count()).map(|k| faces.field(k)).collect();
        let mut pairs = Vec::new();
        for (upper, field) in fields.iter().enumerate() {
            for lower in (0..upper).rev() {
                if field.iter().flatten().any(|(on, _)| *on == lower) {
                    pairs.push([lower, upper]);
                    slipping.whole(host, &faces, [lower, upper], field)?;
                }
            }
        }
        slipping.along(host, asked, &pairs, &faces)?;
        let names = slipping.names.clone();
        slipping.fields = names
            .into_iter()
            .zip(fields)
            .filter(|(_, f)| f.iter().any(Option::is_some))
            .collect();
        Ok(Some(slipping))
    }

    fn pair(&self, [lower, upper]: [usize; 2]) -> [String; 2] {
        [lower, upper].map(|k| self.names[k].clone())
    }

    /// Results of two plies, wherever the one lies on the other.
    fn whole(
        &mut self,
        host: &Host,
        faces: &Faces<'_>,
        pair: [usize; 2],
        field: &Field,
    ) -> Result<(), StepError> {
        let [lower, upper] = self.pair(pair);
        let ply = faces.ply(pair[1]);
        let areas = ply.topology.node_areas(&ply.undeformed);
        let here =
            |found: &Option<(usize, Slip)>| found.filter(|(on, _)| *on == pair[0]).map(|(_, s)| s);
        let (mut sizes, mut weights) = (Vec::new(), Vec::new());
        let mut largest = [0.0f64; 2];
        for (slip, area) in field.iter().map(here).zip(&areas) {
            let Some(slip) = slip else { continue };
            sizes.push(size(&slip));
            weights.push(*area);
            largest = [0, 1].map(|p| largest[p].max(slip.parts[p].abs()));
        }
        let max = sizes.iter().copied().fold(0.0, f64::max);
        let mean = weighted_mean(&sizes, &weights);
        for (name, value) in [
            ("slip_max", max),
            ("slip_mean", mean),
            ("slip_along_max", largest[0]),
            ("slip_across_max", largest[1]),
        ] {
            host.result(&format!("{name}.{lower}.{upper}"), value, "m")?;
        }
        let [along_max, across_max] = largest;
        self.pairs.push(SlipPair {
            lower,
            upper,
            area: weights.iter().sum(),
            max,
            mean,
            along_max,
            across_max,
        });
        Ok(())
    }

    /// Results and arrays of all sections.
    fn along(
        &mut self,
        host: &Host,
        asked: &Asked,
        pairs: &[[usize; 2]],
        faces: &Faces<'_>,
    ) -> Result<(), StepError> {
        for (k, section) in asked.slip_sections.iter().enumerate() {
            let line = asked.line(section, faces)?;
            let before = self.cuts.len();
            for [lower, upper] in pairs {
                self.cut(host, (k, &line), [*lower, *upper], faces)?;
            }
            if self.cuts.len() == before {
                return Err(format!(
                    "slip_sections: '{}' through {:?} m meets no two plies that lie on each other; its place is one on the flat plies",
                    section.name, section.at
                )
                .into());
            }
        }
        Ok(())
    }

    /// Results and arrays of two plies along a section, where the one lies on the other there.
    fn cut(
        &mut self,
        host: &Host,
        (number, line): (usize, &Line),
        pair: [usize; 2],
        faces: &Faces<'_>,
    ) -> Result<(), StepError> {
        let found = faces.along(pair[0], pair[1], line);
        let part =
            |p: usize| -> Vec<(i64, f64)> { found.iter().map(|(k, s)| (*k, s.parts[p])).collect() };
        let values = [part(0), part(1)];
        let (Some(along), Some(across)) = (course(&values[0]), course(&values[1])) else {
            return Ok(());
        };
        let [lower, upper] = self.pair(pair);
        let name = &self.sections[number];
        let stations: Vec<i64> = found.iter().map(|(k, _)| *k).collect();
        if mirrored(&stations) < ONE_SIDED {
            let text = format!(
                "slip section '{name}' of {upper} over {lower}: {:.0} % of it have their mirror image about its middle on both plies; only these count for its \
                 symmetric and antisymmetric parts. Give a middle (`at`) in the middle of the plies",
                100.0 * mirrored(&stations)
            );
            host.log(Log::Warn, &text);
        }
        for (part, course) in PARTS.iter().zip([&along, &across]) {
            tell(host, &format!("{name}.{part}.{lower}.{upper}"), course)?;
        }
        let cut = Cut {
            section: number,
            pair: [lower, upper],
            stations: stations.iter().map(|k| line.station(*k)).collect(),
            values: values.map(|v| v.into_iter().map(|(_, value)| value).collect()),
            courses: [along, across],
        };
        host.write_f64(
            &self.path(&cut, "station"),
            &[cut.stations.len()],
            "m",
            &cut.stations,
        )?;
        for (part, values) in PARTS.iter().zip(&cut.values) {
            host.write_f64(&self.path(&cut, part), &[values.len()], "m", values)?;
        }
        self.cuts.push(cut);
        Ok(())
    }

    fn path(&self, cut: &Cut, what: &str) -> String {
        let [lower, upper] = &cut.pair;
        format!("slip/{}/{lower}/{upper}/{what}", self.sections[cut.section])
    }

    /// Whether a body has fields of slip.
    pub fn has(&self, body: &str) -> bool {
        self.fields.iter().any(|(name, _)| name == body)
    }

    /// Writes the fields of a body, if it has any; no slip where it lies on no ply.
    pub fn write(&self, host: &Host, body: &str) -> Result<(), StepError> {
        let Some((_, field)) = self.fields.iter().find(|(name, _)| name == body) else {
            return Ok(());
        };
        let slip = |s: &Option<(usize, Slip)>| s.map_or([0.0; 3], |(_, s)| s.vector);
        let vectors: Vec<f64> = field.iter().flat_map(slip).collect();
        host.write_field(body, On::Points, "slip", 3, "m", &vectors)?;
        for (p, part) in PARTS.iter().enumerate() {
            let values: Vec<f64> = field
                .iter()
                .map(|s| s.map_or(0.0, |(_, s)| s.parts[p]))
                .collect();
            host.write_field(body, On::Points, &format!("slip_{part}"), 1, "m", &values)?;
        }
        let on: Vec<f64> = field
            .iter()
            .map(|s| s.map_or(0.0, |(on, _)| (on + 1) as f64))
            .collect();
        host.write_field(body, On::Points, "slip_on", 1, "1", &on)
    }

    fn in_words(&self, part: &str) -> String {
        // To a hundredth of a degree, without an end of zeros.
        let degrees = (100.0 * self.direction.to_degrees()).round() / 100.0;
        format!("{part} {degrees} deg")
    }

    /// A plot for each pair and part, with a line for each section.
    pub fn plots(&self) -> Vec<Plot> {
        let mut plots = Vec::new();
        for pair in &self.pairs {
            let (lower, upper) = (&pair.lower, &pair.upper);
            for part in PARTS {
                let of_pair = |c: &&Cut| c.pair.each_ref() == [lower, upper];
                let line = |c: &Cut| {
                    let [x, y] = ["station", part].map(|what| self.path(c, what));
                    Series::new(&self.sections[c.section], x, y)
                };
                let series: Vec<Series> = self.cuts.iter().filter(of_pair).map(line).collect();
                if !series.is_empty() {
                    let axis = "along the section in the flat ply, from its middle";
                    let title = format!("Slip of {upper} over {lower}, {}", self.in_words(part));
                    plots.push(Plot {
                        name: format!("slip_{part}_{lower}_{upper}"),
                        title: Some(title),
                        note: None,
                        x: Axis::new(axis, "mm"),
                        y: Axis::new("slip", "mm"),
                        series,
                    });
                }
            }
        }
        plots
    }

    /// Fields that are drawn as maps, with their titles.
    pub fn maps(&self) -> [(String, String); 2] {
        PARTS.map(|part| {
            let title = format!("Slip over the ply below, {}", self.in_words(part));
            (format!("slip_{part}"), title)
        })
    }

    /// As the attributes have it.
    pub fn told(&self) -> PlySlip {
        let cut = |c: &Cut| {
            let [lower, upper] = c.pair.clone();
            let [along, across] = c.courses.map(told);
            SlipSection {
                name: self.sections[c.section].clone(),
                lower,
                upper,
                along,
                across,
            }
        };
        PlySlip {
            direction: self.direction,
            plies: self.names.clone(),
            pairs: self.pairs.clone(),
            sections: self.cuts.iter().map(cut).collect(),
        }
    }

    /// Tables of the report.
    pub fn tables(&self) -> Vec<Table> {
        let row = |p: &SlipPair| -> Vec<Cell> {
            let numbers = [p.max, p.mean, p.along_max, p.across_max];
            let names = [&p.upper, &p.lower].map(Cell::from);
            names.into_iter().chain(numbers.map(Cell::from)).collect()
        };
        let title = format!("Slip between plies, {}", self.in_words("along and across"));
        let mut tables = vec![Table {
            name: "slip".into(),
            title: Some(title),
            columns: columns(&PAIR_COLUMNS),
            rows: self.pairs.iter().map(row).collect(),
        }];
        if !self.cuts.is_empty() {
            let row = |c: &Cut, p: usize| -> Vec<Cell> {
                let course = told(c.courses[p]);
                let [lower, upper] = &c.pair;
                vec![
                    (&self.sections[c.section]).into(),
                    upper.into(),
                    lower.into(),
                    PARTS[p].into(),
                    course.max.into(),
                    course.mean.into(),
                    course.symmetric.into(),
                    course.antisymmetric.into(),
                    course.asymmetry.into(),
                ]
            };
            let both = |c: &Cut| [row(c, 0), row(c, 1)];
            tables.push(Table {
                name: "slip_sections".into(),
                title: Some("Slip along sections".into()),
                columns: columns(&SECTION_COLUMNS),
                rows: self.cuts.iter().flat_map(both).collect(),
            });
        }
        tables
    }
}

/// As the attributes have it.
fn told(course: Course) -> SlipCourse {
    let parity = course.parity;
    SlipCourse {
        max: course.max,
        mean: course.mean,
        symmetric: parity.map(|p| p.symmetric),
        antisymmetric: parity.map(|p| p.antisymmetric),
        asymmetry: parity.and_then(|p| p.asymmetry()),
    }
}

/// Results of one part of slip along a section. `of`: section, part and plies, as their names end.
fn tell(host: &Host, of: &str, course: &Course) -> Result<(), StepError> {
    let told = |what: &str, value: f64, unit: &str| {
        host.result(&format!("section_slip_{what}.{of}"), value, unit)
    };
    told("max", course.max, "m")?;
    told("mean", course.mean, "m")?;
    let Some(parity) = course.parity else {
        return Ok(());
    };
    told("symmetric", parity.symmetric, "m")?;
    told("antisymmetric", parity.antisymmetric, "m")?;
    if let Some(share) = parity.asymmetry() {
        told("asymmetry", share, "1")?;
    }
    Ok(())
}
