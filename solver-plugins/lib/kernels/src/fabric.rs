//! Biaxial fabric ply: two fibre families and a shear law, in resultants per undeformed area.
//!
//! With the stretches l1 = sqrt(C11), l2 = sqrt(C22) and s = sin g = C12 / (l1 l2) the form
//! `fibre-energy` is
//!
//! `W = k/2 [(l1 - 1)^2 + (l2 - 1)^2] + Phi(s)`, `dPhi/ds = F_norm(g)`, `k = fibre_modulus * thickness`:
//!
//! a picture frame does the work `F_norm cos g dg = F_norm ds` per undeformed area, so this energy
//! gives back the measured curve exactly. `hypoelastic` is the thesis' incremental form (eqs
//! 3.10-3.23). Bending is decoupled: a potential of the curvatures k11, k22 of the fibre families
//! ([`bending`]). Stretches are floored at 0.001, so that no state gives NaN.

mod bending;
mod checks;
mod cubic;
mod hypoelastic;
mod parameters;
mod shear;
mod stitch;
mod yarn;

use crate::{Lanes, WIDTH, dispatch};
use bending::Bending;
use parameters::Parameters;
use plyflow_sdk::{BendingBatch, Material, MaterialSizes, MembraneBatch};
use shear::{Shear, ShearOf, Yarn};
use yarn::Law;

/// A floor for squared stretches.
const LEAST: f64 = 1e-6;
/// Rows of history of the form `fibre-energy` with a stitch: largest shear angle, its sine.
const STITCH_HISTORY: usize = 2;

#[derive(Clone, Copy, PartialEq, Eq, Debug, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Form {
    FibreEnergy,
    Hypoelastic,
}

/// A fabric ply.
pub struct Fabric {
    form: Form,
    /// Fibre stiffness in tension and in compression (N/m).
    tension: f64,
    compression: f64,
    shear: Shear,
    bending: Option<Bending>,
    thickness: f64,
    areal_mass: f64,
}

impl Material for Fabric {
    const MANIFEST: &'static str = include_str!("fabric/manifest.json");

    fn create(parameters: &str) -> Result<Self, String> {
        let p: Parameters = serde_json::from_str(parameters)
            .map_err(|e| format!("parameters of material-fabric: {e}"))?;
        p.build()
    }

    fn sizes(&self) -> MaterialSizes {
        let membrane_history = match self.form {
            Form::FibreEnergy if self.shear.stitch.is_some() => STITCH_HISTORY,
            Form::FibreEnergy => 0,
            Form::Hypoelastic => hypoelastic::HISTORY,
        };
        MaterialSizes {
            membrane_history,
            bending_history: 0,
            has_bending: self.bending.is_some(),
            thickness: self.thickness,
            areal_mass: self.areal_mass,
        }
    }

    fn membrane(&self, b: &mut MembraneBatch<'_>) {
        let (n, stiffness) = (b.lanes, b.stiffness.as_deref_mut().unwrap_or(&mut []));
        match self.form {
            Form::FibreEnergy => {
                membrane(self, n, b.metric, b.history, b.stress, b.energy, stiffness);
            }
            Form::Hypoelastic => {
                hypoelastic::membrane(self, n, b.metric, b.history, b.stress, b.energy, stiffness);
            }
        }
    }

    fn bending(&self, b: &mut BendingBatch<'_>) {
        if let Some(law) = &self.bending {
            let tangent = b.tangent.as_deref_mut().unwrap_or(&mut []);
            bending::moments(law, b.lanes, b.curvature, b.moment, b.energy, tangent);
        }
    }
}

dispatch!(fn membrane(
    f: &Fabric,
    n: usize,
    metric: &[f64],
    history: &mut [f64],
    stress: &mut [f64],
    energy: &mut [f64],
    stiffness: &mut [f64],
) = membrane_kernel);

/// Calls a kernel that is written for one kind of yarns.
macro_rules! for_yarn {
    ($f:expr, $kernel:ident::<$V:ident>($($arg:expr),* $(,)?)) => {{
        let stitch = $f.shear.stitch.as_ref();
        match &$f.shear.yarn {
            Yarn::Polynomial(yarn) => {
                $kernel::<$V, _>($f, ShearOf { yarn: &**yarn, stitch }, $($arg),*);
            }
            Yarn::Table(yarn) => $kernel::<$V, _>($f, ShearOf { yarn, stitch }, $($arg),*),
            Yarn::Signed(yarn) => {
                $kernel::<$V, _>($f, ShearOf { yarn: &**yarn, stitch }, $($arg),*);
            }
        }
    }};
}
use for_yarn;

#[inline(always)]
fn membrane_kernel<V: Lanes>(
    f: &Fabric,
    n: usize,
    metric: &[f64],
    history: &mut [f64],
    stress: &mut [f64],
    energy: &mut [f64],
    stiffness: &mut [f64],
) {
    for_yarn!(
        f,
        membrane_of::<V>(n, metric, history, stress, energy, stiffness)
    );
}

#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn membrane_of<V: Lanes, L: Law>(
    f: &Fabric,
    law: ShearOf<'_, L>,
    n: usize,
    metric: &[f64],
    history: &mut [f64],
    stress: &mut [f64],
    energy: &mut [f64],
    stiffness: &mut [f64],
) {
    let (one, half) = (V::splat(1.0), V::splat(0.5));
    let (tension, compression) = (V::splat(f.tension), V::splat(f.compression));
    for c in (0..n).step_by(WIDTH) {
        let c11 = V::load(metric, c).max(V::splat(LEAST));
        let c22 = V::load(metric, n + c).max(V::splat(LEAST));
        let c12 = V::load(metric, 2 * n + c);
        let (i1, i2) = (one / c11, one / c22);
        // 1/l, and l = C / l: one division and one root for each family.
        let (r1, r2) = (i1.sqrt(), i2.sqrt());
        let (d1, d2) = (c11 * r1 - one, c22 * r2 - one);
        let zero = V::splat(0.0);
        let k1 = V::select(d1.lt(zero), compression, tension);
        let k2 = V::select(d2.lt(zero), compression, tension);
        let rr = r1 * r2;
        let s = c12 * rr;
        let shear = if law.stitch.is_some() {
            let (g, sine) = (V::load(history, c), V::load(history, n + c));
            let (shear, g, sine) = law.with_stitch(s, g, sine);
            g.store(history, c);
            sine.store(history, n + c);
            shear
        } else {
            law.yarn(s)
        };
        let fs = shear.force * s;
        (k1 * d1 * r1 - fs * i1).store(stress, c);
        (k2 * d2 * r2 - fs * i2).store(stress, n + c);
        (shear.force * rr).store(stress, 2 * n + c);
        (half * (k1 * d1 * d1 + k2 * d2 * d2) + shear.energy).store(energy, c);
        if !stiffness.is_empty() {
            let slope = law.slopes(s).0;
            let (a1, a2) = (tension * i1 * r1, tension * i2 * r2);
            let (largest, soft) = tangents(slope, s, i1, i2, a1, a2, shear.force.abs());
            largest.store(stiffness, c);
            soft.store(stiffness, n + c);
        }
    }
}

/// Bounds of the largest eigenvalue of dS/dE and of the shear tangent dS12 / d(2 E12); both are
/// positive also while the stitch softens, and count compressed fibres as stretched ones. `a1`, `a2`
/// are the fibre tangents k / l^3, `slope` bounds dF/ds. The shear part is F' (ds/dE)^2 + F d2s/dE2, each factor by its
/// Frobenius norm.
#[inline(always)]
fn tangents<V: Lanes>(slope: V, s: V, i1: V, i2: V, a1: V, a2: V, force: V) -> (V, V) {
    let two = V::splat(2.0);
    let gradient = s * s * (i1 * i1 + i2 * i2) + two * i1 * i2;
    let widest = i1.max(i2);
    let largest = a1.max(a2) + slope * gradient + V::splat(8.0) * force * widest * widest;
    (largest, slope * i1 * i2)
}
