//! Fibre compression: on how much of a flat ply the fibres of a family are compressed, and by how much.

use crate::measured::{Measured, columns};
use plyflow_model::artifact::{
    Cell, Compressed, FamilyCompression, FibreCompression, Measurement, Table,
};
use plyflow_sdk::{Host, Input, StepError};

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

    fn told(&self) -> Compressed {
        let ratio = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
        Compressed {
            area: self.area,
            strain_mean: ratio(self.integral, self.area),
            strain_least: self.least,
            compression: ratio(-self.integral, self.whole),
        }
    }
}

/// Names, units and values of the results of a family, or of several together.
fn results(of: &Compressed) -> [(&'static str, &'static str, f64); 4] {
    [
        ("compressed_area", "m2", of.area),
        ("compressed_strain_mean", "1", of.strain_mean),
        ("fibre_strain_least", "1", of.strain_least),
        ("fibre_compression", "1", of.compression),
    ]
}

/// By how much each has fallen from what was there `before`, as a share of that; none for what was not compressed before.
fn fallen(now: &Compressed, before: &Compressed) -> Vec<(&'static str, f64)> {
    let falls = results(now).into_iter().zip(results(before));
    let fall = |((name, _, now), (_, _, then)): ((&'static str, _, f64), (_, _, f64))| {
        // Strains are compared as compressions: what is stretched is not compressed at all.
        let strain = name != "compressed_area" && name != "fibre_compression";
        let size = |v: f64| if strain { (-v).max(0.0) } else { v };
        let fallen = (size(then) > 0.0).then(|| 1.0 - size(now) / size(then));
        fallen.map(|f| (name, f))
    };
    falls.filter_map(fall).collect()
}

/// Of the plies of a run; `None` where a run does not tell the strains of their fibres.
pub fn of(measured: &[Measured], threshold: f64) -> Option<FibreCompression> {
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
            families.push(FamilyCompression {
                ply: ply.name.clone(),
                family: k + 1,
                found: sum.told(),
            });
        }
    }
    (!families.is_empty()).then(|| FibreCompression {
        threshold,
        all: all.told(),
        families,
    })
}

/// Reports the results.
pub fn report(host: &Host, found: &FibreCompression) -> Result<(), StepError> {
    for (name, unit, value) in results(&found.all) {
        host.result(name, value, unit)?;
    }
    for f in &found.families {
        for (name, unit, value) in results(&f.found) {
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
pub fn against(host: &Host, found: &FibreCompression, input: &Input) -> Result<(), StepError> {
    let other: Measurement = host.attributes(input)?;
    let (step, threshold) = (&input.step, found.threshold);
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
    for (name, fall) in fallen(&found.all, &before.all) {
        host.result(&format!("{name}_fall"), fall, "1")?;
    }
    for f in &found.families {
        let same = |o: &&FamilyCompression| (&o.ply, o.family) == (&f.ply, f.family);
        let Some(then) = before.families.iter().find(same) else {
            continue;
        };
        for (name, fall) in fallen(&f.found, &then.found) {
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
pub fn table(found: &FibreCompression) -> Table {
    let row = |f: &FamilyCompression| -> Vec<Cell> {
        let n = &f.found;
        vec![
            (&f.ply).into(),
            f.family.to_string().into(),
            n.area.into(),
            n.strain_mean.into(),
            n.strain_least.into(),
            n.compression.into(),
        ]
    };
    let title = format!("Fibre compression (strain below {})", found.threshold);
    Table {
        name: "fibre_compression".into(),
        title: Some(title),
        columns: columns(&COLUMNS),
        rows: found.families.iter().map(row).collect(),
    }
}

/// Error of parameters and inputs that ask for what a run does not tell.
pub fn unknown(input: &Input) -> StepError {
    format!("against: the run '{}' has no fibre strains, so there is no fibre compression to compare; leave `against` out", input.step).into()
}
