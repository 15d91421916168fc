//! The table of the runs, and how their wrinkles change with the bending stiffness.

use crate::run::{Field, Run};
use plyflow_model::artifact::{Cell, CensusRun, Column, Table, Wrinkle};
use plyflow_sdk::{Host, StepError};
use plyflow_surface::{weighted_mean, weighted_quantiles};

/// Columns of the table: label, SI unit.
const COLUMNS: [(&str, &str); 13] = [
    ("run", ""),
    ("bending stiffness", "N m"),
    ("wrinkles", ""),
    ("positive shear", ""),
    ("negative shear", ""),
    ("mean height", "m"),
    ("largest height", "m"),
    ("mean width", "m"),
    ("mean length", "m"),
    ("mean deviation", "m"),
    ("deviation, 99 %", "m"),
    ("mean bending moment", "N"),
    ("bending moment, 99 %", "N"),
];

/// The table as in the data model.
pub fn table(runs: &[Run]) -> Table {
    Table {
        name: "runs".into(),
        title: Some("Wrinkles on the first circle, and distributions over the ply".into()),
        columns: COLUMNS.map(|(label, unit)| Column::new(label, unit)).into(),
        rows: runs.iter().map(row).collect(),
    }
}

fn row(run: &Run) -> Vec<Cell> {
    let w = &run.wrinkles;
    let signs = w.iter().filter(|w| w.shear > 0.0).count();
    let largest = w.iter().map(|w| w.height.abs()).reduce(f64::max);
    let spread = |f: &Option<Field>| {
        let mean = f.as_ref().map(|f| weighted_mean(&f.values, &f.weights));
        let q = f.as_ref();
        let q = q.map(|f| weighted_quantiles(&f.values, &f.weights, &[0.99])[0]);
        (mean, q)
    };
    let (deviation, moment) = (spread(&run.deviation), spread(&run.bending_moment));
    vec![
        (&run.label).into(),
        run.bending_stiffness.into(),
        w.len().into(),
        signs.into(),
        (w.len() - signs).into(),
        mean(w, |w| w.height.abs()).into(),
        largest.into(),
        mean(w, |w| w.width).into(),
        mean(w, |w| w.length).into(),
        deviation.0.into(),
        deviation.1.into(),
        moment.0.into(),
        moment.1.into(),
    ]
}

/// Over the wrinkles; `None` without one.
fn mean(of: &[Wrinkle], what: fn(&Wrinkle) -> f64) -> Option<f64> {
    let sum: f64 = of.iter().map(what).sum();
    (!of.is_empty()).then(|| sum / of.len() as f64)
}

/// The runs for programs.
pub fn list(runs: &[Run]) -> Vec<CensusRun> {
    let one = |r: &Run| CensusRun {
        name: r.name.clone(),
        label: r.label.clone(),
        bending_stiffness: r.bending_stiffness,
    };
    runs.iter().map(one).collect()
}

/// Whether the second number of the pairs never rises from one to the next when they are sorted by the first.
pub fn never_rises(pairs: &[[f64; 2]]) -> bool {
    sorted(pairs).windows(2).all(|p| p[1][1] <= p[0][1])
}

/// Whether it never falls.
pub fn never_falls(pairs: &[[f64; 2]]) -> bool {
    sorted(pairs).windows(2).all(|p| p[1][1] >= p[0][1])
}

fn sorted(pairs: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut all = pairs.to_vec();
    all.sort_by(|a, b| a[0].total_cmp(&b[0]));
    all
}

/// Reports the results.
///
/// # Errors
/// When two runs have the same stiffness, or the host refuses.
pub fn results(host: &Host, runs: &[Run]) -> Result<(), StepError> {
    host.result("runs", runs.len() as f64, "1")?;
    for run in runs {
        let name = format!("wrinkles.{}", run.name);
        host.result(&name, run.wrinkles.len() as f64, "1")?;
    }
    let stiff: Vec<(&Run, f64)> = (runs.iter())
        .filter_map(|r| Some((r, r.bending_stiffness?)))
        .collect();
    for (k, (a, b)) in stiff.iter().enumerate() {
        if let Some((c, _)) = stiff[..k].iter().find(|(_, other)| other == b) {
            return Err(format!(
                "runs: '{}' and '{}' have the same bending_stiffness, {b} N m; give each its own, or leave one's out",
                c.name, a.name
            )
            .into());
        }
    }
    if stiff.len() < 2 {
        return Ok(());
    }
    let of = |what: &dyn Fn(&Run) -> Option<f64>| -> Vec<[f64; 2]> {
        let pair = |(r, b): &(&Run, f64)| Some([*b, what(r)?]);
        stiff.iter().filter_map(pair).collect()
    };
    let falls = never_rises(&of(&|r| Some(r.wrinkles.len() as f64)));
    host.result("falls", f64::from(u8::from(falls)), "1")?;
    // A run without wrinkles has no width: that the stiffest has none does not say that they get narrower.
    let widths = of(&|r| mean(&r.wrinkles, |w| w.width));
    if widths.len() < 2 {
        return Ok(());
    }
    host.result("grows", f64::from(u8::from(never_falls(&widths))), "1")
}
