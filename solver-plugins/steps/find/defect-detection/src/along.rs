//! What compressed fibres have too much of, along their lines in the flat ply.

use crate::ruck::{Harmonic, Ruck};

/// Heights of rucks that are looked at, over the least that counts: a higher one takes less force and more length.
const HEIGHTS: [f64; 4] = [1.0, 1.5, 2.0, 3.0];

/// Halvings by which the length of a ruck is found.
const HALVINGS: usize = 30;

/// A stretch of a fibre's line over which what lifts together is compressed.
#[derive(Debug, Clone, PartialEq)]
pub struct Stretch {
    /// `[n]` compression along the line, as a positive force per width (N/m), of all plies that lift together.
    pub compression: Vec<f64>,
    /// `[n]` pressure that holds them to what lies below (Pa).
    pub pressure: Vec<f64>,
    /// Distance of two places (m): each stands for so much of the line.
    pub step: f64,
    /// The place that is judged.
    pub at: usize,
}

impl Stretch {
    /// Its length (m).
    fn length(&self) -> f64 {
        self.step * self.compression.len() as f64
    }

    /// Mean pressure (Pa) over a length (m) about the place that is judged, as far as the stretch reaches.
    fn mean_pressure(&self, length: f64) -> f64 {
        let (mut sum, mut weights) = (0.0, 0.0);
        // No weight farther away than this.
        let reach = (0.5 * length / self.step) as usize + 1;
        let from = self.at.saturating_sub(reach);
        let to = (self.at + reach + 1).min(self.pressure.len());
        for (i, pressure) in self.pressure[from..to].iter().enumerate() {
            let away = self.step * (from + i).abs_diff(self.at) as f64;
            let weight = ((0.5 * length - away) / self.step + 0.5).clamp(0.0, 1.0);
            sum += weight * pressure;
            weights += weight;
        }
        if weights > 0.0 {
            sum / weights
        } else {
            self.pressure[self.at]
        }
    }

    /// The ruck of a height (m) that is as long as the pressure over that length lets it be; where the stretch is shorter than that, the one over all
    /// of the stretch between clamps.
    pub fn ruck(&self, bending: &Harmonic, height: f64) -> Ruck {
        let under = |length: f64| {
            let pressure = self.mean_pressure(length);
            (pressure > 0.0).then(|| Ruck::under(bending, pressure, height))
        };
        let longer = |length: f64| under(length).is_none_or(|r| r.length > length);
        let whole = self.length();
        if longer(whole) {
            return Ruck::clamped(bending, whole, height);
        }
        let (mut short, mut long) = (0.0, whole);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (short + long);
            if longer(middle) {
                short = middle;
            } else {
                long = middle;
            }
        }
        under(long).unwrap_or_else(|| Ruck::clamped(bending, whole, height))
    }

    /// Length (m) that the stretch gives when its force falls to that of a ruck: `integral of (N - P) / K`, with the stiffness `K` (N/m) along the line.
    pub fn gives(&self, force: f64, stiffness: f64) -> f64 {
        let beyond = self.compression.iter().map(|n| (n - force).max(0.0));
        self.step * beyond.sum::<f64>() / stiffness
    }

    /// Excess length that the stretch gives over that which a ruck of `height` (m) or more needs: the largest over the heights. From 1 on
    /// there is enough.
    pub fn excess(&self, bending: &Harmonic, stiffness: f64, height: f64) -> f64 {
        let share = |factor: f64| {
            let ruck = self.ruck(bending, factor * height);
            self.gives(ruck.force, stiffness) / ruck.excess
        };
        HEIGHTS.into_iter().map(share).fold(0.0, f64::max)
    }
}
