//! A law of a sheet in Rust: a linear orthotropic sheet with a cubic bending law.
//! Take it as a start: change `manifest.json`, then `membrane` and `bending`.
//!
//! The whole contract stands in `plyflow.h`; what matters most:
//!
//! - Arrays are `[row][lane]`: row r of point l is at `[r * lanes + l]`.
//! - Write every output for every lane. Allocate nothing in `membrane` and `bending`.
//! - Several threads call one instance at once: the compiler holds you to it (`&self`, `Sync`).
//! - Stress and moment are derivatives of the energy: `check-plugin` compares them.
//!
//! Per undeformed area, with `E_aa = (C_aa - 1) / 2` and the curvatures k11, k22, k12, of which the twist counts twice:
//!
//! `W = (K1 E11^2 + K2 E22^2 + G C12^2) / 2 + sum of (D k^2 / 2 + c k^4 / 4)`

use plyflow_sdk::{BendingBatch, Material, MaterialSizes, MembraneBatch, export_material};

/// Stiffnesses along the two families (N/m).
const K1: f64 = 1e5;
const K2: f64 = 2e5;
/// Bending constants D (N m) and c (N m3).
const D: f64 = 1e-3;
const CUBIC: f64 = 1e-7;

/// Parameters as the manifest declares them, and two of the sheet: checked by the host, defaults filled in, SI numbers.
#[derive(serde::Deserialize)]
struct Law {
    /// m
    thickness: f64,
    /// kg/m2
    areal_mass: f64,
    /// N/m
    shear_modulus: f64,
}

impl Material for Law {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn create(parameters: &str) -> Result<Self, String> {
        serde_json::from_str(parameters).map_err(|e| format!("parameters of my-sheet: {e}"))
    }

    fn sizes(&self) -> MaterialSizes {
        MaterialSizes {
            has_bending: true,
            thickness: self.thickness,
            areal_mass: self.areal_mass,
            ..MaterialSizes::default()
        }
    }

    fn membrane(&self, batch: &mut MembraneBatch<'_>) {
        let (n, g) = (batch.lanes, self.shear_modulus);
        for l in 0..n {
            let [c11, c22, c12] = [0, 1, 2].map(|row| batch.metric[row * n + l]);
            let (e11, e22) = (0.5 * (c11 - 1.0), 0.5 * (c22 - 1.0));
            batch.stress[l] = K1 * e11;
            batch.stress[n + l] = K2 * e22;
            // S12 = dW/dC12: C12 stands for both off-diagonals.
            batch.stress[2 * n + l] = g * c12;
            batch.energy[l] = 0.5 * (K1 * e11 * e11 + K2 * e22 * e22 + g * c12 * c12);
        }
        if let Some(stiffness) = batch.stiffness.as_deref_mut() {
            // A bound of the largest tangent: it sets the time step.
            stiffness[..n].fill(K2.max(2.0 * g));
            stiffness[n..2 * n].fill(g);
        }
    }

    fn bending(&self, batch: &mut BendingBatch<'_>) {
        let n = batch.lanes;
        for l in 0..n {
            let mut energy = 0.0;
            for (row, times) in [(0, 1.0), (1, 1.0), (2, 2.0)] {
                let k = batch.curvature[row * n + l];
                batch.moment[row * n + l] = D * k + CUBIC * k * k * k;
                energy += times * (0.5 * D * k * k + 0.25 * CUBIC * k * k * k * k);
                if let Some(tangent) = batch.tangent.as_deref_mut() {
                    tangent[row * n + l] = D + 3.0 * CUBIC * k * k;
                }
            }
            batch.energy[l] = energy;
        }
    }
}

export_material!(Law);
