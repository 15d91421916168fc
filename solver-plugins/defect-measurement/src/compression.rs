//! Fibre compression: on how much of a flat ply the fibres of a family are compressed, and by how much.

use crate::Measured;
use plyflow_sdk::{Host, Input, StepError};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

/// Columns of the table: label, SI unit.
const COLUMNS: [(&str, &str); 6] = [
    ("ply", ""),
    ("family", ""),
    ("compressed area", "m2"),
    ("mean strain there", "1"),
    ("least strain", "1"),
    ("mean compression of the ply", "1"),
];

/// What the cells of a family, or of several, have: by element, each with its area in the flat ply.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sum {
    /// Area of the cells whose strain is below the threshold (m2).
    area: f64,
    /// Integral of their strain over it (m2), not positive.
    integral: f64,
    /// Area of all cells (m2).
    whole: f64,
    /// Least strain of all cells.
    least: f64,
}

impl Sum {
    const EMPTY: Self = Self {
        area: 0.0,
        integral: 0.0,
        whole: 0.0,
        least: f64::INFINITY,
    };

    /// Of cells with these strains and flat areas (m2), in the order of the cells.
    fn of(strains: &[f64], areas: &[f64], threshold: f64) -> Self {
        let mut sum = Self::EMPTY;
        for (strain, area) in strains.iter().zip(areas) {
            if *strain < threshold {
                sum.area += area;
                sum.integral += strain * area;
            }
            sum.whole += area;
            sum.least = sum.least.min(*strain);
        }
        sum
    }

    fn and(self, o: &Self) -> Self {
        Self {
            area: self.area + o.area,
            integral: self.integral + o.integral,
            whole: self.whole + o.whole,
            least: self.least.min(o.least),
        }
    }

    fn numbers(&self) -> Numbers {
        let ratio = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
        Numbers {
            area: self.area,
            strain_mean: ratio(self.integral, self.area),
            strain_least: self.least,
            compression: ratio(-self.integral, self.whole),
        }
    }
}

/// What is told of a family, or of several together.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Numbers {
    /// Compressed area (m2).
    area: f64,
    /// Mean strain over it, negative; 0 where nothing is compressed.
    strain_mean: f64,
    /// Least strain.
    strain_least: f64,
    /// Mean over the whole area of the compression (the strain below the threshold, with its sign turned; 0 elsewhere).
    compression: f64,
}

impl Numbers {
    /// Names, units and values of its results.
    fn told(&self) -> [(&'static str, &'static str, f64); 4] {
        [
            ("compressed_area", "m2", self.area),
            ("compressed_strain_mean", "1", self.strain_mean),
            ("fibre_strain_least", "1", self.strain_least),
            ("fibre_compression", "1", self.compression),
        ]
    }

    /// By how much each has fallen from what `before` has, as a share of that; none for what was not compressed before.
    fn fallen(&self, before: &Self) -> Vec<(&'static str, f64)> {
        let falls = self.told().into_iter().zip(before.told());
        let fall = |((name, _, now), (_, _, then)): ((&'static str, _, f64), (_, _, f64))| {
            // Strains are compared as compressions: what is stretched is not compressed at all.
            let strain = name != "compressed_area" && name != "fibre_compression";
            let size = |v: f64| if strain { (-v).max(0.0) } else { v };
            let fallen = (size(then) > 0.0).then(|| 1.0 - size(now) / size(then));
            fallen.map(|f| (name, f))
        };
        falls.filter_map(fall).collect()
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Family {
    ply: String,
    /// 1 or 2, as the fields `fibre_strain_1` and `fibre_strain_2` have them.
    family: usize,
    #[serde(flatten)]
    numbers: Numbers,
}

/// The attribute `fibre_compression` of a measurement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Compression {
    threshold: f64,
    /// All families of all plies together.
    all: Numbers,
    families: Vec<Family>,
}

#[derive(Deserialize)]
struct Other {
    fibre_compression: Option<Compression>,
}

impl Compression {
    /// Of the plies of a run; `None` where a run does not tell the strains of their fibres.
    pub fn of(measured: &[Measured], threshold: f64) -> Option<Self> {
        let mut all = Sum::EMPTY;
        let mut families = Vec::new();
        for ply in measured.iter().filter(|m| m.simulated).map(|m| &m.ply) {
            let areas = ply.topology.cell_areas(&ply.undeformed);
            for (k, strains) in ply.fibre_strains.iter().enumerate() {
                if strains.is_empty() {
                    continue;
                }
                let sum = Sum::of(strains, &areas, threshold);
                all = all.and(&sum);
                families.push(Family {
                    ply: ply.name.clone(),
                    family: k + 1,
                    numbers: sum.numbers(),
                });
            }
        }
        (!families.is_empty()).then(|| Self {
            threshold,
            all: all.numbers(),
            families,
        })
    }

    /// Reports the results.
    pub fn report(&self, host: &Host) -> Result<(), StepError> {
        for (name, unit, value) in self.all.told() {
            host.result(name, value, unit)?;
        }
        for f in &self.families {
            for (name, unit, value) in f.numbers.told() {
                host.result(
                    &format!("{name}.{}.family_{}", f.ply, f.family),
                    value,
                    unit,
                )?;
            }
        }
        Ok(())
    }

    /// Reports by how much it has fallen from what another measurement has.
    ///
    /// # Errors
    /// When that one has none, or was made with another threshold.
    pub fn against(&self, host: &Host, input: &Input) -> Result<(), StepError> {
        let other: Other = host.attributes(input)?;
        let (step, threshold) = (&input.step, self.threshold);
        let Some(before) = other.fibre_compression else {
            return Err(format!("against: '{step}' tells no fibre compression: its run has no fibre strains; expected a measurement of a run that has").into());
        };
        if before.threshold != threshold {
            return Err(format!(
                "against: '{step}' was measured with `compressed_below: {}`, this one with {threshold}; expected the same in both",
                before.threshold
            )
            .into());
        }
        for (name, fall) in self.all.fallen(&before.all) {
            host.result(&format!("{name}_fall"), fall, "1")?;
        }
        for f in &self.families {
            let same = |o: &&Family| (&o.ply, o.family) == (&f.ply, f.family);
            let Some(then) = before.families.iter().find(same) else {
                continue;
            };
            for (name, fall) in f.numbers.fallen(&then.numbers) {
                host.result(
                    &format!("{name}_fall.{}.family_{}", f.ply, f.family),
                    fall,
                    "1",
                )?;
            }
        }
        Ok(())
    }

    /// The table of the report.
    pub fn table(&self) -> Value {
        let columns = COLUMNS.map(|(label, unit)| json!({"label": label, "unit": unit}));
        let row = |f: &Family| {
            let n = &f.numbers;
            json!([
                f.ply,
                f.family.to_string(),
                n.area,
                n.strain_mean,
                n.strain_least,
                n.compression
            ])
        };
        let rows: Vec<Value> = self.families.iter().map(row).collect();
        let title = format!("Fibre compression (strain below {})", self.threshold);
        json!({"name": "fibre_compression", "title": title, "columns": columns, "rows": rows})
    }
}

/// Error of parameters and inputs that ask for what a run does not tell.
pub fn unknown(input: &Input) -> StepError {
    format!("against: the run '{}' has no fibre strains, so there is no fibre compression to compare; leave `against` out", input.step).into()
}
