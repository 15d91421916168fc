//! Runs that would end well and mean nothing: refused before the first step where that can be known, stopped where it shows.

use crate::course::HistoryRow;
use crate::error::{FormingError, Result};
use crate::forming::Forming;
use crate::load::Load;
use crate::request::Parameters;
use crate::stack::{Body, RigidName};
use crate::watch::Watch;

/// Mass that is added over the sheets' own, beyond which a run is none of these sheets. Shipped studies have up to 75 in films.
const MOST_ADDED: f64 = 1000.0;
/// Share of the pressure that forms beyond which the drag of mass-proportional damping holds the sheets up.
const MOST_DRAG: f64 = 0.1;
/// Kinetic over internal energy beyond which sheets fly, and the share of the whole process for which they must do so. Sheets that a punch or a
/// frame carries along have some kinetic energy before anything is stored in them: a soft fabric in a quick press several times as much.
const FLIES: f64 = 10.0;
const MOST_OF_IT: f64 = 0.5;
/// Rows before which nothing is said of them.
const FEW_ROWS: usize = 40;
/// A ply this far (m) from the tool, or so many times its thickness, does not touch it.
const OFF: f64 = 2e-3;
const OFF_THICKNESSES: f64 = 5.0;

/// Whether parameters and scene of a run make sense together.
///
/// # Errors
/// What is given, what would do.
pub fn check(p: &Parameters, forming: &Forming) -> Result<()> {
    check_elements(p, forming)?;
    check_phases(p, forming)?;
    check_masses(p, forming)?;
    check_drag(p, forming)?;
    check_places(forming)
}

/// Box (m) in plan of the nodes of a sheet before forming, of the whole.
fn plan(forming: &Forming, body: &Body) -> [[f64; 2]; 2] {
    let points = forming.reference_points(body);
    let none = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    points.iter().fold(none, |[low, high], x| {
        [
            [low[0].min(x[0]), low[1].min(x[1])],
            [high[0].max(x[0]), high[1].max(x[1])],
        ]
    })
}

/// Whether plies have elements to speak of.
fn check_elements(p: &Parameters, forming: &Forming) -> Result<()> {
    if forming.zone.is_some() {
        return Ok(());
    }
    for (body, _) in forming.plies() {
        let [low, high] = plan(forming, body);
        let least = (high[0] - low[0]).min(high[1] - low[1]);
        if least < 2.0 * p.element_size * (1.0 - 1e-6) {
            return Err(FormingError::Absurd(format!(
                "element_size: given {:.3} mm, ply '{}' is {:.1} x {:.1} mm; expected two elements across it at least: {:.3} mm or less",
                1e3 * p.element_size,
                body.name,
                1e3 * (high[0] - low[0]),
                1e3 * (high[1] - low[1]),
                1e3 * 0.5 * least
            )));
        }
    }
    Ok(())
}

/// Phases in which something moves: their names in a scene, and how long they take (s).
fn phases(forming: &Forming) -> Vec<(&'static str, f64)> {
    match &forming.load {
        Load::Process { cycle, .. } => {
            let first = match cycle.first {
                "stretching" => "stretching_time",
                _ => "bagging_time",
            };
            [first, "lowering_time", "drawing_time"]
                .into_iter()
                .zip(cycle.durations)
                .collect()
        }
        Load::Press(press) => vec![("forming_time", press.stroke.forming)],
        Load::Stamping(stamping) => vec![("forming_time", stamping.forming)],
        Load::Given { .. } => Vec::new(),
    }
}

/// Whether phases take as long as a wave needs to cross the plies: what is pulled at one end is not felt at the other before, and elements pass it on by
/// one in a step at most.
fn check_phases(p: &Parameters, forming: &Forming) -> Result<()> {
    let across = (forming.plies())
        .map(|(body, _)| {
            let [low, high] = plan(forming, body);
            (high[0] - low[0]).max(high[1] - low[1]) / p.element_size
        })
        .fold(1.0, f64::max);
    let critical = forming.model.critical_step()?;
    let step = p.time_step.min(p.step_safety * critical);
    let least = across * step;
    for (name, duration) in phases(forming) {
        if duration < least {
            return Err(FormingError::Absurd(format!(
                "scene.process.{name}: given {duration:.3e} s, which is {:.1} steps of {step:.3e} s; expected at least {least:.3e} s, in which a wave crosses the \
                 {across:.0} elements of the plies, and far more for a slow process: tenths of a second for most parts, with a `time_step` of microseconds \
                 (given {:.3e} s)",
                duration / step,
                p.time_step
            )));
        }
    }
    Ok(())
}

/// Whether sheets keep something of their own mass.
fn check_masses(p: &Parameters, forming: &Forming) -> Result<()> {
    let m = &forming.model;
    let own: f64 = m.own_masses().iter().sum();
    let added: f64 = m.sheets().iter().map(|s| s.added_mass).sum();
    if added > MOST_ADDED * own {
        return Err(FormingError::Absurd(format!(
            "time_step: given {:.3e} s, least_areal_mass: given {:.3} kg/m2; with these the sheets are given {:.1e} times their own mass ({own:.3e} kg), and move as \
             nothing of that kind does. Expected at most {MOST_ADDED:.0} times as much, and mostly less than 100: a smaller `time_step`, or less `least_areal_mass`",
            p.time_step,
            p.least_areal_mass,
            added / own
        )));
    }
    Ok(())
}

/// Whether damping leaves the motion to what forms.
fn check_drag(p: &Parameters, forming: &Forming) -> Result<()> {
    let m = &forming.model;
    let Load::Process { cycle, .. } = &forming.load else {
        return Ok(());
    };
    let way = (cycle.frame[0] - cycle.frame[1]).abs();
    let (speed, pressure) = (way / cycle.durations[1].max(1e-9), cycle.bag);
    let area: f64 = (m.sheets().iter())
        .flat_map(|s| &m.cells()[s.cell_range.0..s.cell_range.1])
        .map(|c| {
            let q = c.map(|n| m.start()[n as usize]);
            let d = |a: usize, b: usize| [0, 1].map(|k| q[b][k] - q[a][k]);
            let ([ax, ay], [bx, by]) = (d(0, 2), d(1, 3));
            0.5 * (ax * by - ay * bx).abs()
        })
        .sum();
    let areal = m.mass().iter().sum::<f64>() / area.max(1e-12);
    let drag = areal * p.damping * speed;
    if drag > MOST_DRAG * pressure {
        return Err(FormingError::Absurd(format!(
            "damping: given {:.3e} 1/s; at the {speed:.3} m/s at which the frame comes down it holds the sheets up with {drag:.1e} Pa, the vacuum presses with {pressure:.1e} Pa. \
             Expected a drag of at most {:.0} % of that: `damping: {:.0} 1/s` or less (50 1/s is usual)",
            p.damping,
            100.0 * MOST_DRAG,
            MOST_DRAG * pressure / (areal * speed)
        )));
    }
    Ok(())
}

/// Whether plies lie over the tool.
fn check_places(forming: &Forming) -> Result<()> {
    if forming.zone.is_some() {
        return Ok(());
    }
    let [low, high] = forming.tool.bounds();
    for (body, _) in forming.plies() {
        let name = &body.name;
        let [from, to] = plan(forming, body);
        if (0..2).any(|c| to[c] <= low[c] || from[c] >= high[c]) {
            let mm = |v: [f64; 2]| format!("({:.1}, {:.1}) mm", 1e3 * v[0], 1e3 * v[1]);
            return Err(FormingError::Absurd(format!(
                "scene: ply '{name}' lies from {} to {}, the tool from {} to {}: no part of it lies over the tool. Expected a ply that is formed: move it \
                 (`offset`), or the tool (`translate` of an STL file)",
                mm(from),
                mm(to),
                mm([low[0], low[1]]),
                mm([high[0], high[1]])
            )));
        }
    }
    Ok(())
}

/// What to say of sheets that have flown about for most of the process: kinetic energy far beyond all that is stored. `least` (J) is
/// too little to judge, see [`too_little`](crate::judge::scale::too_little).
pub fn flies(history: &[HistoryRow], [begin, end]: [f64; 2], least: f64) -> Option<String> {
    let last = history.last()?;
    let over = (last.time - begin) / (end - begin);
    if history.len() < FEW_ROWS || over < MOST_OF_IT {
        return None;
    }
    let fast = |r: &&HistoryRow| r.ledger.kinetic > FLIES * r.ledger.internal().max(least);
    let share = history.iter().filter(fast).count() as f64 / history.len() as f64 * over;
    (share > MOST_OF_IT).then(|| {
        format!(
            "kinetic energy has been {FLIES} times as large as all that the sheets store, and more, in {:.0} % of the process: they fly about, and nothing is formed \
             slowly. Expected kinetic energy of some percent (`kinetic_bound`)",
            100.0 * share
        )
    })
}

/// What to say of plies that are off the tool at the end.
pub fn off_the_tool(forming: &Forming, watch: &Watch) -> Option<String> {
    if forming.zone.is_some() {
        return None;
    }
    forming.plies().find_map(|(body, sheet)| {
        let off = watch.nearest(&RigidName::Tool, body.sheet)?;
        (off > OFF.max(OFF_THICKNESSES * sheet.thickness)).then(|| {
            format!(
                "ply '{}' is nowhere on the tool at the end: it is {:.1} mm away where it is nearest. Nothing was formed. Look at the place of tool and ply, the \
                 pressures, the stroke, and the times of the process",
                body.name,
                1e3 * off
            )
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use plyflow_mechanics::energy::Ledger;

    #[test]
    fn sheets_fly_when_they_move_with_more_than_they_store_for_most_of_half_a_run() {
        let row = |time: f64, kinetic: f64| HistoryRow {
            time,
            ledger: Ledger {
                kinetic,
                membrane: 1.0,
                ..Ledger::default()
            },
            ..HistoryRow::default()
        };
        let history = |kinetic: &dyn Fn(usize) -> f64, rows: usize| -> Vec<HistoryRow> {
            (0..rows).map(|k| row(k as f64, kinetic(k))).collect()
        };
        let told = flies(&history(&|_| 30.0, 60), [0.0, 100.0], 0.0).expect("told");
        assert!(told.contains("59 % of the process"), "{told}");
        // Not before half of it is over, not for a knock, not where the start alone is fast, and not for what is carried along.
        let silent: [(&dyn Fn(usize) -> f64, usize); 4] = [
            (&|_| 30.0, 45),
            (&|k| if k % 3 == 0 { 90.0 } else { 0.1 }, 90),
            (&|k| if k < 45 { 90.0 } else { 0.1 }, 90),
            (&|_| 9.0, 90),
        ];
        assert_eq!(flies(&history(&|_| 30.0, 60), [0.0, 100.0], 4.0), None);
        for (kinetic, rows) in silent {
            assert_eq!(flies(&history(kinetic, rows), [0.0, 100.0], 0.0), None);
        }
    }
}
