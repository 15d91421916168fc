//! Parameters, histories, and the net that the shear is compared with.

use crate::specimen::Common;
use plyflow_fixed::FixedBits;
use plyflow_mechanics::history::linear;
use serde::Deserialize;
use std::f64::consts::{FRAC_PI_2, SQRT_2};

/// Place of point B in the central square zone: from its centre (0) to its corners (1).
#[derive(Debug, Clone, Copy, Deserialize)]
pub(super) struct PointB {
    /// Along the pull.
    pub(super) along: f64,
    /// Across it.
    pub(super) across: f64,
}

/// A range of displacements (m).
#[derive(Debug, Clone, Copy, Deserialize)]
pub(super) struct Range {
    pub(super) from: f64,
    pub(super) to: f64,
}

/// Parameters (SI).
#[derive(Debug, Clone, Deserialize)]
pub struct Parameters {
    #[serde(flatten)]
    pub(super) common: Common,
    /// Length between the clamps (m).
    pub(super) length: f64,
    /// Width (m).
    pub(super) width: f64,
    /// Way of the moving clamp (m).
    pub(super) displacement: f64,
    /// Time for it (s).
    pub(super) pull_time: f64,
    /// Share of the time in which it starts, and in which it stops.
    pub(super) ramp_share: f64,
    /// Largest out-of-plane place of the undeformed specimen (m).
    pub(super) imperfection: f64,
    /// Largest of the lateral load in the same shape (Pa).
    pub(super) transverse_load: f64,
    /// Which random shape.
    pub(super) seed: u64,
    /// Amplitude at which a wrinkle counts (m).
    pub(super) onset_amplitude: f64,
    /// Point B.
    pub(super) point_b: PointB,
    /// Radius of the gauges (m).
    pub(super) gauge_radius: f64,
    /// Shear angle at which the stitches begin to fail (rad).
    #[serde(default)]
    pub(super) failure_angle: Option<f64>,
    /// Displacements over which the amplitude is to stand.
    #[serde(default)]
    pub(super) plateau: Option<Range>,
    /// Displacement at which the amplitude is compared with its peak.
    #[serde(default)]
    pub(super) late: Option<f64>,
    /// Way after the onset at which heights are told.
    pub(super) after_onset: f64,
    /// CSV with columns displacement, amplitude.
    #[serde(default)]
    pub(super) measured_amplitude: Option<String>,
    /// CSV with columns displacement, shear_angle.
    #[serde(default)]
    pub(super) measured_shear: Option<String>,
}

/// Histories, one value per sample.
#[derive(Debug, Default)]
pub(super) struct Histories {
    pub(super) displacement: Vec<f64>,
    pub(super) force: Vec<f64>,
    pub(super) shear_a: Vec<f64>,
    pub(super) shear_b: Vec<f64>,
    pub(super) shear_largest: Vec<f64>,
    pub(super) top: Vec<f64>,
    pub(super) bottom: Vec<f64>,
    pub(super) section: Vec<f64>,
    pub(super) fibre_strain: f64,
}

impl Histories {
    pub(super) fn half_height(&self) -> Vec<f64> {
        self.top
            .iter()
            .zip(&self.bottom)
            .map(|(t, b)| 0.5 * (t + b))
            .collect()
    }

    /// Value of a history at a displacement.
    pub(super) fn at(&self, values: &[f64], displacement: f64) -> f64 {
        linear(&self.displacement, values, displacement)
    }

    /// Displacement at which a history first exceeds `level`, linear between the samples.
    pub(super) fn first_above(&self, values: &[f64], level: f64) -> Option<f64> {
        let i = values.iter().position(|v| *v > level)?;
        if i == 0 {
            return Some(self.displacement[0]);
        }
        let share = (level - values[i - 1]) / (values[i] - values[i - 1]);
        Some(self.displacement[i - 1] + share * (self.displacement[i] - self.displacement[i - 1]))
    }
}

/// Shear angle (rad) of the pin-jointed net in the central zone; 90 degrees when it is stretched out.
pub(super) fn net_angle(length: f64, width: f64, displacement: f64) -> f64 {
    let free = length - width;
    FRAC_PI_2
        - 2.0
            * ((free + displacement) / (SQRT_2 * free))
                .min(1.0)
                .fixed_acos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_net_has_the_angles_that_the_thesis_gives() {
        assert!((net_angle(0.3, 0.15, 0.045).to_degrees() - 43.6).abs() < 0.05);
        assert!(net_angle(0.2, 0.1, 0.0).abs() < 1e-12);
        assert!((net_angle(0.2, 0.1, 0.05) - FRAC_PI_2).abs() < 1e-12);
    }
}
