//! Where and why a run went wrong, for the one who has to change it.

use crate::course::HistoryRow;
use crate::forming::Forming;
use crate::judge::scale;
use crate::measure::{Penetration, cell_strain};
use crate::words::in_mm;
use plyflow_geometry::vec3::{Vec3, norm};
use std::fmt::Write;

/// Share of [`open_shares`] from which on a ledger counts as opening.
const OPENING: f64 = 0.02;
/// Rows of the history for which it must stay open: a single one may be a knock that closes again.
const ROWS: usize = 3;
/// Rows at the start that are not judged.
const FIRST_ROWS: usize = 20;

/// Energy unaccounted for, by row, over the largest work or internal energy so far, projected to the end of the process:
/// work grows about with the square of time, and at the start there is hardly any to compare with. `least` (J) is too little to
/// judge, see [`scale`].
fn open_shares(history: &[HistoryRow], end: f64, least: f64) -> Vec<f64> {
    let mut work = least;
    (history.iter())
        .map(|r| {
            let l = &r.ledger;
            work = work.max(l.external.abs()).max(l.internal());
            if work > 0.0 {
                l.drift().abs() / work * (r.time / end).powi(2)
            } else {
                0.0
            }
        })
        .collect()
}

/// What to say when the ledger has been open by more than `bound` for some rows. `least` (J): what is too little to judge.
pub fn open_ledger(history: &[HistoryRow], end: f64, bound: f64, least: f64) -> Option<String> {
    if history.len() < FIRST_ROWS {
        return None;
    }
    let shares = open_shares(history, end, least);
    let open = shares
        .iter()
        .rev()
        .take(ROWS)
        .all(|s| s.is_nan() || *s > bound);
    open.then(|| {
        format!(
            "{:.0} % of the work that is to be expected is unaccounted for (drift_bound {:.0} %)",
            100.0 * shares.last().copied().unwrap_or(f64::NAN),
            100.0 * bound
        )
    })
}

/// Share of the energy unaccounted for from which on a pair is named for it.
const NAMED: f64 = 0.2;

/// Which pair of bodies has made the largest part of the energy that is unaccounted for, or lost it, if any has much of it.
pub fn source(forming: &Forming, row: &HistoryRow) -> Option<String> {
    let drift = row.ledger.drift();
    let names = forming.model.interface_energies().map(|(name, _)| name);
    let (name, made) = (names.zip(&row.interfaces))
        .map(|(name, e)| (name, e.made()))
        .max_by(|a, b| (a.1 * drift).total_cmp(&(b.1 * drift)))?;
    (made * drift > NAMED * drift * drift).then(|| {
        let what = if drift > 0.0 { "made" } else { "lost" };
        format!(
            "The largest part by contact of '{name}': {:.2e} J {what} of {:.2e} J",
            made.abs(),
            drift.abs()
        )
    })
}

/// Kinetic over internal energy at the end above which something still moves. Parts at rest between diaphragms have 1e-9 to 5e-5.
const AT_REST: f64 = 1e-4;

/// The least settling time that is advised (s).
const LEAST_SETTLING: f64 = 0.1;

/// The settling time (s) that is advised where this one was too short.
fn longer(settling: f64) -> f64 {
    (2.0 * settling).max(LEAST_SETTLING)
}

/// What to say of a part that has not come to rest between its diaphragms, with this `ratio` of kinetic to internal energy. A press ends its stroke in motion.
pub fn still_moving(forming: &Forming, ratio: f64) -> Option<String> {
    (!forming.load.moves_parts() && ratio > AT_REST).then(|| {
        let longer = longer(forming.load.settling());
        format!(
            "the run has ended while the part was moving: kinetic energy is {:.1e} of internal energy, and {AT_REST:.0e} at most at rest. A sheet \
             slips or snaps there, so what the end shows is not the end.{} Try a longer settling_time, {:.0} ms for instance",
            ratio,
            fastest(forming),
            1e3 * longer
        )
    })
}

/// A text of what happened, where it shows, what the likely cause is and what to change. `what` opens it.
pub fn of(forming: &Forming, history: &[HistoryRow], what: &str) -> String {
    let m = &forming.model;
    let (t, end) = (m.time(), forming.load.duration());
    let mut text = format!(
        "{what}; seen at t = {t:.5} s of {end:.5} s ({}).",
        forming.load.phase(t)
    );
    let least = scale::too_little(forming);
    let shares = open_shares(history, end, least);
    let calm = shares.iter().rposition(|s| *s < OPENING);
    if let Some(row) = calm.map_or(history.first(), |i| history.get(i + 1)) {
        let _ = write!(
            text,
            " The ledger is open by more than {:.0} % since t = {:.5} s.",
            100.0 * OPENING,
            row.time
        );
    }
    if let Some(source) = history.last().and_then(|r| source(forming, r)) {
        let _ = write!(text, " {source}.");
    }
    let cell = weakest(forming);
    if let Some(c) = &cell {
        text.push_str(&c.text);
    }
    let deep = deepest(forming);
    if let Some(d) = &deep {
        text.push_str(&d.text);
    }
    text.push_str(&fastest(forming));
    let kinetic = history
        .last()
        .map_or(0.0, |r| r.ledger.kinetic / r.ledger.internal().max(least));
    let (cause, remedy) = likely(cell.as_ref(), deep.as_ref().map(|d| d.share), kinetic);
    let _ = write!(text, " Likely cause: {cause}. What to try: {remedy}.");
    text
}

/// What to say when steps are less than half of the `known` ones (s).
pub fn slower(forming: &Forming, known: f64) -> String {
    let m = &forming.model;
    let mut text = format!(
        "steps of {:.3} us instead of {:.3} us from t = {:.5} s of {:.5} s on: what is left takes {:.1} times as long.",
        1e6 * m.dt(),
        1e6 * known,
        m.time(),
        forming.load.duration(),
        known / m.dt(),
    );
    let cell = weakest(forming);
    if let Some(c) = &cell {
        text.push_str(&c.text);
        if c.collapsed() {
            let (cause, remedy) = likely(cell.as_ref(), None, 0.0);
            let _ = write!(text, " Likely cause: {cause}. What to try: {remedy}.");
        }
    }
    text
}

const TOO_LARGE_A_STEP: (&str, &str) = (
    "a step above the critical one",
    "smaller step_safety or time_step, more frames (the step is chosen anew at each), less contact_damping",
);

/// The likely cause and what to try, by the element that sets the step, the deepest contact over the thinner body, and the kinetic
/// over the internal energy.
fn likely(cell: Option<&Weakest>, deep: Option<f64>, kinetic: f64) -> (&'static str, &'static str) {
    match (cell, deep) {
        (Some(c), _) if c.collapsed() && c.is_film => (
            "a film is drawn out or folded beyond what its mesh can follow",
            "smaller element_size or diaphragm_element_size, longer drawing_time, or a larger hourglass_floor of diaphragm_element",
        ),
        (Some(c), _) if c.collapsed() => (
            "the ply has gathered until an element collapsed: a fold narrower than the mesh",
            "smaller element_size, element s4 instead of rf4, a larger hourglass_floor, or a holder that leaves less room",
        ),
        (_, Some(share)) if share > 0.5 => (
            "a sheet is on its way through its neighbour",
            "smaller time_step, larger least_areal_mass (stiffer contact), longer process times",
        ),
        // Whatever a step too large throws about is fast as well.
        (Some(c), _) if c.over > 1.0 => TOO_LARGE_A_STEP,
        _ if kinetic > 0.5 => (
            "the process is too fast for its masses",
            "longer process times, or less least_areal_mass",
        ),
        _ => TOO_LARGE_A_STEP,
    }
}

fn centre(points: &[Vec3], nodes: &[u32]) -> Vec3 {
    let n = nodes.len() as f64;
    nodes.iter().fold([0.0; 3], |s, k| {
        let p = points[*k as usize];
        [s[0] + p[0] / n, s[1] + p[1] / n, s[2] + p[2] / n]
    })
}

struct Weakest {
    /// Shear angle (rad); NaN when it cannot be told.
    shear: f64,
    /// Of a diaphragm, not of a ply.
    is_film: bool,
    /// The steps that are done over the largest that it allows.
    over: f64,
    text: String,
}

impl Weakest {
    fn collapsed(&self) -> bool {
        self.shear.is_nan() || self.shear.abs() > 65f64.to_radians()
    }
}

/// The element that sets the step.
fn weakest(forming: &Forming) -> Option<Weakest> {
    let m = &forming.model;
    let (cell, step) = m.weakest_cell()?;
    let mut sheets = forming.bodies.iter().zip(&forming.stack);
    let (body, sheet) = sheets.find(|(b, _)| b.sheet.cell_range(m).contains(&cell))?;
    let nodes = m.cells()[cell];
    let of = |points: &[Vec3]| nodes.map(|n| points[n as usize]);
    let then = of(&forming.reference);
    let axis = sheet.axis_in_cell(&then);
    let (shear, strain) = cell_strain(then, of(m.x()), axis, sheet.crossed());
    Some(Weakest {
        shear,
        is_film: !sheet.is_ply(),
        over: m.dt() / step,
        text: format!(
            " The step is set by an element of '{}' at {} (before forming {}): at most {:.3} us (it is {:.3} us), shear {:.0} deg, fibre strain {:.1} %.",
            body.name,
            in_mm(centre(m.x(), &nodes)),
            in_mm(centre(&forming.reference, &nodes)),
            1e6 * step,
            1e6 * m.dt(),
            shear.to_degrees(),
            100.0 * strain,
        ),
    })
}

struct Deepest {
    /// What the bodies share, over the thinner one.
    share: f64,
    text: String,
}

/// The contact that is deepest.
fn deepest(forming: &Forming) -> Option<Deepest> {
    // Bare films are kept further apart than they are thick: what they use of that is no overlap.
    let overlap = |p: &Penetration| p.overlap_of(p.largest);
    let worst = (forming.penetrations().into_iter())
        .max_by(|a, b| {
            let by_overlap = overlap(a).total_cmp(&overlap(b));
            by_overlap.then(a.largest.total_cmp(&b.largest))
        })
        .filter(|p| p.largest > 0.0)?;
    let share = overlap(&worst);
    Some(Deepest {
        share,
        text: format!(
            " Deepest contact: {}{}, {:.0} um ({:.0} % of the thinner one).",
            worst.pair,
            worst
                .place
                .map_or_else(String::new, |x| format!(" at {}", in_mm(x))),
            1e6 * worst.largest,
            100.0 * share
        ),
    })
}

/// The node that moves fastest.
fn fastest(forming: &Forming) -> String {
    let m = &forming.model;
    let Some(node) = (0..m.v().len()).max_by(|a, b| norm(m.v()[*a]).total_cmp(&norm(m.v()[*b])))
    else {
        return String::new();
    };
    let sheet = (m.sheets().iter()).find(|s| s.nodes.contains(&(node as u32)));
    format!(
        " Fastest: '{}' at {} with {:.1} m/s.",
        sheet.map_or("?", |s| s.name.as_str()),
        in_mm(m.x()[node]),
        norm(m.v()[node])
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use plyflow_mechanics::energy::Ledger;

    /// A history whose work grows by 1 J a row, with that energy unaccounted for in each.
    fn history(drift: impl Fn(usize) -> f64, rows: usize) -> Vec<HistoryRow> {
        let row = |i: usize| HistoryRow {
            time: i as f64,
            ledger: Ledger {
                external: i as f64,
                membrane: i as f64 + drift(i),
                ..Ledger::default()
            },
            ..HistoryRow::default()
        };
        (0..rows).map(row).collect()
    }

    #[test]
    fn the_settling_time_that_is_advised_is_longer_than_the_one_that_was_too_short() {
        assert_eq!(longer(0.04), 0.1);
        for given in [0.0, 0.06, 0.1, 0.5] {
            assert!(
                longer(given) >= 1.5 * given && longer(given) > given,
                "{given}"
            );
        }
    }

    #[test]
    fn an_element_that_collapses_comes_before_deep_contacts_and_a_film_is_no_ply() {
        let cell = |shear: f64, is_film: bool| Weakest {
            shear,
            is_film,
            over: 0.8,
            text: String::new(),
        };
        let cause =
            |cell: &Weakest, deep: f64, kinetic: f64| likely(Some(cell), Some(deep), kinetic).0;
        assert!(cause(&cell(-1.3, false), 4.0, 1.0).contains("the ply has gathered"));
        assert!(cause(&cell(-1.3, true), 4.0, 1.0).contains("a film"));
        assert!(
            likely(Some(&cell(f64::NAN, true)), None, 0.0)
                .1
                .contains("diaphragm_element_size")
        );
        assert!(cause(&cell(0.5, true), 4.0, 1.0).contains("through its neighbour"));
        assert!(cause(&cell(0.5, true), 0.1, 1.0).contains("too fast"));
        assert!(likely(None, None, 0.0).0.contains("above the critical"));
        // What a step too large throws about is fast and, in the end, deep.
        let thrown = Weakest {
            over: 2.5,
            ..cell(0.5, false)
        };
        assert!(cause(&thrown, 0.1, 1.0).contains("above the critical"));
        assert!(cause(&thrown, 4.0, 1.0).contains("through its neighbour"));
    }

    #[test]
    fn a_ledger_is_open_only_beyond_the_bound_and_for_some_rows() {
        let open = |drift: &dyn Fn(usize) -> f64, rows| {
            open_ledger(&history(drift, rows), (rows - 1) as f64, 0.1, 0.0)
        };
        assert_eq!(open(&|_| 0.0, 50), None);
        assert_eq!(open(&|i| 0.05 * i as f64, 50), None);
        let text = open(&|i| -0.2 * i as f64, 50).unwrap();
        assert!(text.starts_with("20 % of the work"), "{text}");
        // The same share early on, when there will be nine times as much work.
        let early = history(|i| -0.2 * i as f64, 50);
        assert_eq!(open_ledger(&early, 147.0, 0.1, 0.0), None);
        // A knock, and what is open before there is any work.
        assert_eq!(open(&|i| if i == 48 { 30.0 } else { 0.0 }, 50), None);
        assert_eq!(open(&|_| 5.0, FIRST_ROWS - 1), None);
        // Of what is too little to judge.
        let light = history(|i| -0.2 * i as f64, 50);
        assert!(open_ledger(&light, 49.0, 0.1, 50.0).is_some());
        assert_eq!(open_ledger(&light, 49.0, 0.1, 150.0), None);
        // What is no number is not closed.
        assert!(open(&|i| if i > 40 { f64::NAN } else { 0.0 }, 50).is_some());
    }
}
