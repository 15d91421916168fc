//! The energy ledger.

/// Where the work is (J). Sums run in a fixed order.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Ledger {
    /// Kinetic.
    pub kinetic: f64,
    /// Stored in membranes.
    pub membrane: f64,
    /// Stored in bending.
    pub bending: f64,
    /// Hourglass control.
    pub hourglass: f64,
    /// Stored in contact springs (normal and elastic slip).
    pub contact: f64,
    /// Lost to friction.
    pub friction: f64,
    /// Lost to damping (mass-proportional and of normal approach).
    pub damping: f64,
    /// Done by pressure, weight and loads on nodes, by driven nodes and by rigid parts that move.
    pub external: f64,
}

/// Energies of one sheet (J). A node that two sheets share moves with the first.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SheetEnergy {
    /// Kinetic.
    pub kinetic: f64,
    /// Stored in membranes.
    pub membrane: f64,
    /// Stored in bending.
    pub bending: f64,
    /// Hourglass control.
    pub hourglass: f64,
}

impl SheetEnergy {
    /// `n` times as much.
    pub fn times(&self, n: f64) -> Self {
        Self {
            kinetic: n * self.kinetic,
            membrane: n * self.membrane,
            bending: n * self.bending,
            hourglass: n * self.hourglass,
        }
    }
}

impl Ledger {
    /// `n` times as much.
    pub fn times(&self, n: f64) -> Self {
        Self {
            kinetic: n * self.kinetic,
            membrane: n * self.membrane,
            bending: n * self.bending,
            hourglass: n * self.hourglass,
            contact: n * self.contact,
            friction: n * self.friction,
            damping: n * self.damping,
            external: n * self.external,
        }
    }

    /// Internal energy: membrane, bending, hourglass.
    pub fn internal(&self) -> f64 {
        self.membrane + self.bending + self.hourglass
    }

    /// What does not add up: everything stored and lost, less the external work (J).
    pub fn drift(&self) -> f64 {
        self.kinetic + self.internal() + self.contact + self.friction + self.damping - self.external
    }
}

/// Health of a run, judged over its whole history.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnergyHealth {
    /// Largest |drift| over the largest |external work|, or internal energy where that is larger, or what is too little to judge.
    pub peak_drift_ratio: f64,
    /// Largest kinetic over internal, or what is too little to judge, while internal is above 5 % of its largest value.
    pub peak_kinetic_ratio: f64,
    /// Kinetic over internal at the end: of a part that has come to rest next to nothing.
    pub kinetic_ratio_at_end: f64,
    /// Hourglass over internal at the end.
    pub hourglass_ratio: f64,
}

/// Judges a history of ledgers. The kinetic ratio is not taken while the internal energy is below 5 % of
/// its largest value: at the very start both are nought and the ratio says nothing. `least` (J): an energy that is too little to
/// judge. Where there is less, it stands below the fraction's line: a ply that only rests stores nanojoules, and shares of them
/// say nothing. 0 where all is judged.
pub fn judge(history: &[Ledger], least: f64) -> EnergyHealth {
    let peak = |f: &dyn Fn(&Ledger) -> f64| history.iter().map(f).fold(0.0, f64::max);
    let peak_work = peak(&|l| l.external.abs().max(l.internal()));
    let peak_internal = peak(&Ledger::internal);
    let kinetic = history
        .iter()
        .filter(|l| l.internal() > 0.05 * peak_internal)
        .map(|l| l.kinetic / l.internal().max(least))
        .fold(0.0, f64::max);
    let ratio = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
    let at_end = |f: fn(&Ledger) -> f64| {
        history
            .last()
            .map_or(0.0, |l| ratio(f(l), l.internal().max(least)))
    };
    EnergyHealth {
        peak_drift_ratio: ratio(peak(&|l| l.drift().abs()), peak_work.max(least)),
        peak_kinetic_ratio: kinetic,
        kinetic_ratio_at_end: at_end(|l| l.kinetic),
        hourglass_ratio: at_end(|l| l.hourglass),
    }
}
