//! The history of a run: one row at each look at its energies.

use crate::forming::Forming;
use crate::load::PressLoad;
use crate::watch::Watched;
use plyflow_mechanics::contact::ContactEnergy;
use plyflow_mechanics::energy::{Ledger, SheetEnergy};
use serde::{Deserialize, Serialize};

/// One line of the history.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct HistoryRow {
    /// Time (s).
    pub time: f64,
    /// Step that brought it there (s).
    pub time_step: f64,
    /// Critical step of the elements at the last frame (s), of which that is at most the share `step_safety`.
    pub critical_step: f64,
    /// Energies (J).
    pub ledger: Ledger,
    /// Cavity pressure (Pa).
    pub cavity: f64,
    /// Bag pressure (Pa).
    pub bag: f64,
    /// Frame height (m); of a press's punch over its end.
    pub frame: f64,
    /// Force of a press's punch on the plies (N).
    pub punch_force: f64,
    /// Way of a press's holder towards the die (m).
    pub holder_travel: f64,
    /// By rigid part of a stamping, and then by gripper: force on the plies (N), and way (m).
    pub parts: Vec<[f64; 2]>,
    /// By sheet of the model.
    pub sheets: Vec<SheetEnergy>,
    /// By interface, in the order of [`Model::interface_energies`](plyflow_mechanics::model::Model::interface_energies).
    pub interfaces: Vec<ContactEnergy>,
    /// How deep (m) bodies are in each other, by pair, in the order of [`crate::Watch::pairs`].
    pub depths: Vec<f64>,
}

/// A column of the history: its name in the artifact, its unit, its value.
pub type Column = (&'static str, &'static str, fn(&HistoryRow) -> f64);

impl HistoryRow {
    /// The columns of every run.
    pub const COLUMNS: [Column; 15] = [
        ("time", "s", |r| r.time),
        ("kinetic", "J", |r| r.ledger.kinetic),
        ("membrane", "J", |r| r.ledger.membrane),
        ("bending", "J", |r| r.ledger.bending),
        ("hourglass", "J", |r| r.ledger.hourglass),
        ("contact", "J", |r| r.ledger.contact),
        ("friction", "J", |r| r.ledger.friction),
        ("damping", "J", |r| r.ledger.damping),
        ("external", "J", |r| r.ledger.external),
        ("drift", "J", |r| r.ledger.drift()),
        ("cavity_pressure", "Pa", |r| r.cavity),
        ("bag_pressure", "Pa", |r| r.bag),
        ("frame_height", "m", |r| r.frame),
        ("time_step", "s", |r| r.time_step),
        ("critical_step", "s", |r| r.critical_step),
    ];

    /// Those that a press has besides.
    pub const OF_PRESS: [Column; 2] = [
        ("punch_force", "N", |r| r.punch_force),
        ("holder_travel", "m", |r| r.holder_travel),
    ];

    /// What a run is like now. Energies (`ledger`) and forces are those of the whole, where a part is computed.
    pub fn of(forming: &Forming, ledger: Ledger, critical_step: f64, watched: &Watched) -> Self {
        let m = &forming.model;
        let n = forming.copies();
        let press = forming.load.press();
        Self {
            time: m.time(),
            time_step: m.dt(),
            critical_step,
            ledger: ledger.times(n),
            cavity: m.pressures().below,
            bag: m.pressures().above,
            frame: forming.load.frame_height(m.time()),
            punch_force: n * press.map_or(0.0, |p| p.punch_force(m)),
            holder_travel: press.map_or(0.0, PressLoad::holder_travel),
            parts: (forming.load.stamping()).map_or_else(Vec::new, |s| s.ways(m, n)),
            sheets: m.sheet_energies().iter().map(|e| e.times(n)).collect(),
            interfaces: m.interface_energies().map(|(_, e)| e.times(n)).collect(),
            depths: watched.now.iter().map(|d| d.depth).collect(),
        }
    }
}
