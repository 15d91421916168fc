//! Homogeneous isotropic plate: St. Venant-Kirchhoff in plane stress, and linear bending.
//!
//! Per undeformed area, with `E = (C - 1)/2`, thickness h, Young's modulus Y and Poisson's ratio nu:
//!
//! `W_m = Y h / (2 (1 - nu^2)) [E11^2 + E22^2 + 2 nu E11 E22 + 2 (1 - nu) E12^2]`,
//! `W_b = D / 2 [k11^2 + k22^2 + 2 nu k11 k22 + 2 (1 - nu) k12^2]`, `D = Y h^3 / (12 (1 - nu^2))`,
//!
//! the Kirchhoff-Love plate of any textbook (e.g. Ciarlet, Mathematical Elasticity, vol. 3). Meant
//! for verification and for foils in small strain: like every St. Venant-Kirchhoff law it softens in
//! strong compression. The metric has no influence on the moments.

use crate::record;
use crate::strain::{green_strain, store_with_work};
use crate::{Lanes, WIDTH, dispatch};
use plyflow_sdk::{BendingBatch, Material, MaterialSizes, MaterialTape, MembraneBatch};

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    youngs_modulus: f64,
    poisson_ratio: f64,
    thickness: f64,
    areal_mass: f64,
}

/// An isotropic sheet.
pub struct Isotropic {
    /// Y h / (1 - nu^2) (N/m).
    membrane: f64,
    /// Y h^3 / (12 (1 - nu^2)) (N m).
    bending: f64,
    nu: f64,
    thickness: f64,
    areal_mass: f64,
}

impl Material for Isotropic {
    const MANIFEST: &'static str = include_str!("isotropic/manifest.json");

    fn create(parameters: &str) -> Result<Self, String> {
        let p: Parameters = serde_json::from_str(parameters)
            .map_err(|e| format!("parameters of material-isotropic: {e}"))?;
        for (name, value, unit) in [
            ("youngs_modulus", p.youngs_modulus, "Pa"),
            ("thickness", p.thickness, "m"),
            ("areal_mass", p.areal_mass, "kg/m2"),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(format!(
                    "{name}: given {value} {unit}; expected a finite value above 0"
                ));
            }
        }
        let nu = p.poisson_ratio;
        // Negative ratios are possible but rare; both ends are singular in plane stress.
        if !(nu > -0.99 && nu <= 0.5) {
            return Err(format!(
                "poisson_ratio: given {nu}; expected more than -0.99 and at most 0.5"
            ));
        }
        let h = p.thickness;
        let membrane = p.youngs_modulus * h / (1.0 - nu * nu);
        Ok(Self {
            membrane,
            bending: membrane * h * h / 12.0,
            nu,
            thickness: h,
            areal_mass: p.areal_mass,
        })
    }

    fn sizes(&self) -> MaterialSizes {
        MaterialSizes {
            membrane_history: 0,
            bending_history: 0,
            has_bending: true,
            thickness: self.thickness,
            areal_mass: self.areal_mass,
        }
    }

    fn membrane(&self, b: &mut MembraneBatch<'_>) {
        membrane(self, b.lanes, b.metric, b.stress, b.energy);
        if let Some(stiffness) = b.stiffness.as_deref_mut() {
            // Eigenvalues of dS/dE: Y h / (1 - nu) for equal strains, Y h / (1 + nu) for shears.
            let largest = self.membrane * (1.0 + self.nu).max(1.0 - self.nu);
            stiffness[..b.lanes].fill(largest);
            stiffness[b.lanes..2 * b.lanes].fill(0.5 * self.membrane * (1.0 - self.nu));
        }
    }

    fn bending(&self, b: &mut BendingBatch<'_>) {
        let n = b.lanes;
        bending(self, n, b.curvature, b.moment, b.energy);
        if let Some(tangent) = b.tangent.as_deref_mut() {
            tangent[..2 * n].fill(self.bending);
            tangent[2 * n..3 * n].fill(self.bending * (1.0 - self.nu));
        }
    }

    fn tape(&self, what: MaterialTape) -> Result<Option<String>, String> {
        record::of_material(self, what)
    }
}

dispatch!(fn membrane(
    m: &Isotropic,
    n: usize,
    metric: &[f64],
    stress: &mut [f64],
    energy: &mut [f64],
) = membrane_kernel);
dispatch!(fn bending(
    m: &Isotropic,
    n: usize,
    curvature: &[f64],
    moment: &mut [f64],
    energy: &mut [f64],
) = bending_kernel);

#[inline(always)]
fn membrane_kernel<V: Lanes>(
    m: &Isotropic,
    n: usize,
    metric: &[f64],
    stress: &mut [f64],
    energy: &mut [f64],
) {
    for c in (0..n).step_by(WIDTH) {
        let e = green_strain::<V>(metric, n, c);
        quadratic(m.membrane, m.nu, e, n, c, stress, energy);
    }
}

#[inline(always)]
fn bending_kernel<V: Lanes>(
    m: &Isotropic,
    n: usize,
    curvature: &[f64],
    moment: &mut [f64],
    energy: &mut [f64],
) {
    for c in (0..n).step_by(WIDTH) {
        let row = |r: usize| V::load(curvature, r * n + c);
        let k = [row(0), row(1), row(2)];
        quadratic(m.bending, m.nu, k, n, c, moment, energy);
    }
}

/// `s = d [e11 + nu e22, e22 + nu e11, (1 - nu) e12]` and half its work on e.
#[inline(always)]
fn quadratic<V: Lanes>(
    d: f64,
    nu: f64,
    e: [V; 3],
    n: usize,
    c: usize,
    s: &mut [f64],
    energy: &mut [f64],
) {
    let (d, other, shear) = (V::splat(d), V::splat(nu), V::splat(1.0 - nu));
    let s11 = d * (e[0] + other * e[1]);
    let s22 = d * (e[1] + other * e[0]);
    let s12 = d * shear * e[2];
    store_with_work([s11, s22, s12], e, n, c, s, energy);
}
