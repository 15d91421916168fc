//! Biaxial fabric ply: two fibre families and a shear law, in resultants per undeformed area.
//!
//! With the stretches l1 = sqrt(C11), l2 = sqrt(C22) and s = sin g = C12 / (l1 l2) the form
//! `fibre-energy` is
//!
//! `W = k1/2 (l1 - 1)^2 + k2/2 (l2 - 1)^2 + Phi(s)`, `dPhi/ds = F_norm(g)`, `k = fibre_modulus * thickness` of each family
//! (in compression a share of it, or instead the integral of a curve over `1 - l`, [`compression`]):
//!
//! a picture frame does the work `F_norm cos g dg = F_norm ds` per undeformed area, so this energy
//! gives back the measured curve exactly. Families may cross at any angle ([`crossing`]). `hypoelastic` is the thesis' incremental form (eqs
//! 3.10-3.23). Bending is decoupled: a potential of the curvatures k11, k22 of the fibre families
//! ([`bending`]). Stretches are floored at 0.001, so that no state gives NaN.

mod bending;
mod checks;
mod compression;
mod crossing;
mod cubic;
mod fibre_energy;
mod hypoelastic;
mod hysteresis;
mod parameters;
mod ply;
mod shear;
mod stitch;
mod yarn;

pub use ply::Fabric;

use crate::record;
use crate::{Lanes, dispatch};
use parameters::Parameters;
use ply::Form;
use plyflow_sdk::{BendingBatch, Material, MaterialSizes, MaterialTape, MembraneBatch};
use shear::{ShearOf, Yarn};

impl Material for Fabric {
    const MANIFEST: &'static str = include_str!("fabric/manifest.json");

    fn create(parameters: &str) -> Result<Self, String> {
        let p: Parameters = serde_json::from_str(parameters)
            .map_err(|e| format!("parameters of material-fabric: {e}"))?;
        p.build()
    }

    fn sizes(&self) -> MaterialSizes {
        let slides = self.shear.slider.is_some();
        let of_form = match self.form {
            Form::FibreEnergy if slides || self.shear.stitch.is_some() => fibre_energy::HISTORY,
            Form::FibreEnergy => 0,
            Form::Hypoelastic => hypoelastic::HISTORY,
        };
        let of_slider = if slides { hysteresis::HISTORY } else { 0 };
        let bends = self.bending.as_ref();
        MaterialSizes {
            membrane_history: of_form + of_slider,
            bending_history: bends.map_or(0, bending::Bending::history),
            has_bending: self.bending.is_some(),
            thickness: self.thickness,
            areal_mass: self.areal_mass,
        }
    }

    fn membrane(&self, b: &mut MembraneBatch<'_>) {
        let (n, stiffness) = (b.lanes, b.stiffness.as_deref_mut().unwrap_or(&mut []));
        membrane(self, n, b.metric, b.history, b.stress, b.energy, stiffness);
    }

    fn bending(&self, b: &mut BendingBatch<'_>) {
        if let Some(law) = &self.bending {
            let tangent = b.tangent.as_deref_mut().unwrap_or(&mut []);
            bending::moments(law, b.lanes, b.curvature, b.moment, b.energy, tangent);
            if let Some(sliders) = &law.sliders {
                let of = bending::Rubbed {
                    history: &mut *b.history,
                    moment: &mut *b.moment,
                    energy: &mut *b.energy,
                    tangent,
                };
                bending::rub(sliders, law.crossing.as_ref(), b.lanes, b.curvature, of);
            }
        }
    }

    fn tape(&self, what: MaterialTape) -> Result<Option<String>, String> {
        record::of_material(self, what)
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
    let stitch = f.shear.stitch.as_ref();
    // Compiled for each kind of yarns and each form.
    macro_rules! of_yarn {
        ($yarn:expr, $more:literal) => {{
            let law = ShearOf {
                yarn: $yarn,
                stitch,
            };
            match f.form {
                Form::FibreEnergy => {
                    fibre_energy::membrane::<V, _, $more>(
                        f, law, n, metric, history, stress, energy, stiffness,
                    );
                }
                Form::Hypoelastic => {
                    hypoelastic::membrane::<V, _, $more>(
                        f, law, n, metric, history, stress, energy, stiffness,
                    );
                }
            }
        }};
    }
    match &f.shear.yarn {
        Yarn::Polynomial(yarn) => of_yarn!(&**yarn, false),
        Yarn::Table(yarn) => of_yarn!(yarn, false),
        Yarn::Signed(yarn)
            if f.shear.slider.is_some() || f.crush.is_some() || f.crossing.is_some() =>
        {
            of_yarn!(&**yarn, true);
        }
        Yarn::Signed(yarn) => of_yarn!(&**yarn, false),
    }
}
