//! Curves of all runs over each other, and their plies side by side.

use crate::run::{Field, Run};
use plyflow_model::artifact::{Axis, CensusRunBody, Map, Panel, Plot, Series};
use plyflow_sdk::{Host, StepError};
use plyflow_surface::{bin_width, density, weighted_quantiles};

/// Plots of a census that are laid over each other: name, x label, unit of x, and its SI unit.
const OVERLAID: [(&str, &str, &str, &str); 3] = [
    ("circles", "angle from x", "deg", "rad"),
    ("sections", "distance from the axis", "mm", "m"),
    ("cross_sections", "distance along the section", "mm", "m"),
];

/// One plot for each circle and section of the first run, with the curves of that label of all runs.
///
/// # Errors
/// When a curve cannot be read or written.
pub fn overlaid(host: &Host, runs: &[Run]) -> Result<Vec<Plot>, StepError> {
    let mut plots = Vec::new();
    let first = runs
        .first()
        .map(|r| r.curves.as_slice())
        .unwrap_or_default();
    for (plot, x_label, unit, si) in OVERLAID {
        for (k, leader) in first.iter().filter(|c| c.plot == plot).enumerate() {
            let mut series = Vec::new();
            // Older censuses round labels: of those with one label each has its own place.
            let before = first.iter().filter(|c| c.plot == plot).take(k);
            let place = before.filter(|c| c.is(leader)).count();
            for run in runs {
                let mut same = run.curves.iter().filter(|c| c.is(leader));
                let Some(curve) = same.nth(place) else {
                    continue;
                };
                let copy = |what: &str, path: &str, unit: &str| -> Result<String, StepError> {
                    let (values, shape) = host.array_f64(&run.input, path)?;
                    let to = format!("curves/{}/{plot}_{k}/{what}", run.name);
                    host.write_f64(&to, &shape, unit, &values)?;
                    Ok(to)
                };
                let (x, y) = (copy("x", &curve.x, si)?, copy("y", &curve.y, "m")?);
                series.push(Series::new(&run.label, x, y));
            }
            plots.push(Plot {
                name: format!("{plot}_{k}"),
                title: Some(leader.label.clone()),
                note: None,
                x: Axis::new(x_label, unit),
                y: Axis::new("height", "mm"),
                series,
            });
        }
    }
    Ok(plots)
}

/// A quantity over the plies.
struct Quantity {
    name: &'static str,
    title: &'static str,
    unit: &'static str,
    inverse: &'static str,
    shown: &'static str,
    of: fn(&Run) -> &Option<Field>,
}

const QUANTITIES: [Quantity; 2] = [
    Quantity {
        name: "deviation",
        title: "Deviation from punch and die",
        unit: "m",
        inverse: "1/m",
        shown: "mm",
        of: |r| &r.deviation,
    },
    Quantity {
        name: "bending_moment",
        title: "RMS bending moment along the fibres",
        unit: "N",
        inverse: "1/N",
        shown: "N",
        of: |r| &r.bending_moment,
    },
];

/// Writes the plies of all runs with their fields, and the densities in common bins: plots and maps.
///
/// # Errors
/// When the host refuses.
pub fn fields(host: &Host, runs: &[Run]) -> Result<(Vec<Plot>, Vec<Map>), StepError> {
    for run in runs {
        host.define_mesh(
            &run.name,
            &run.flat,
            4,
            &run.cells,
            &CensusRunBody {
                label: run.label.clone(),
            },
        )?;
    }
    host.begin_frame(0.0)?;
    for run in runs {
        host.write_points(&run.name, &run.points)?;
        for q in &QUANTITIES {
            if let Some(f) = (q.of)(run) {
                host.write_field(&run.name, f.on, q.name, 1, q.unit, &f.values)?;
            }
        }
    }
    host.end_frame()?;
    let (mut plots, mut maps) = (Vec::new(), Vec::new());
    for q in &QUANTITIES {
        let panel = |r: &Run| Panel {
            label: r.label.clone(),
            body: r.name.clone(),
            field: q.name.into(),
        };
        let there = runs.iter().filter(|r| (q.of)(r).is_some());
        let panels: Vec<Panel> = there.map(panel).collect();
        if !panels.is_empty() {
            maps.push(Map {
                name: q.name.into(),
                title: Some(q.title.into()),
                unit: q.shown.into(),
                panels,
            });
        }
        plots.extend(densities(host, runs, q)?);
    }
    Ok((plots, maps))
}

/// The densities of a quantity in bins that all runs share, so that their heights compare.
fn densities(host: &Host, runs: &[Run], q: &Quantity) -> Result<Option<Plot>, StepError> {
    let fields: Vec<(&Run, &Field)> = (runs.iter())
        .filter_map(|r| Some((r, (q.of)(r).as_ref()?)))
        .collect();
    let most = |f: &Field| weighted_quantiles(&f.values, &f.weights, &[0.999])[0];
    let range = fields.iter().map(|(_, f)| most(f)).fold(0.0, f64::max);
    if range <= 0.0 {
        return Ok(None);
    }
    let width = bin_width(range);
    let count = (range / width) as usize + 1;
    let centres: Vec<f64> = (0..count).map(|i| (i as f64 + 0.5) * width).collect();
    let value = format!("curves/{}/value", q.name);
    host.write_f64(&value, &[count], q.unit, &centres)?;
    let mut series = Vec::new();
    for (run, f) in fields {
        let density = density(&f.values, &f.weights, width, count);
        let path = format!("curves/{}/{}_density", run.name, q.name);
        host.write_f64(&path, &[count], q.inverse, &density)?;
        series.push(Series::new(&run.label, &value, path));
    }
    Ok(Some(Plot {
        name: format!("{}_density", q.name),
        title: Some(format!("{}, by area", q.title)),
        note: None,
        x: Axis::new(q.title.to_lowercase(), q.shown),
        y: Axis::new("probability density", format!("1/{}", q.shown)),
        series,
    }))
}
