//! The laws of the plies that a scene names, behind the host.

use crate::compressed::Law;
use plyflow_abi::{PF_KIND_MATERIAL, PF_OK};
use plyflow_mechanics::component::MaterialInstance;
use plyflow_model::artifact::{Forming, Sheet};
use plyflow_model::material::MaterialEntry;
use plyflow_model::scene::Scene;
use plyflow_sdk::{Aligned, BendingBatch, Host, MembraneBatch, StepError};
use std::sync::Arc;

/// Lanes of a call of a material.
const LANES: usize = 16;

/// Strain at which the stiffness along a direction is taken.
const STRAIN: f64 = -1e-4;

/// Thicknesses that differ by less, over the larger, are the same.
const ROUNDING: f64 = 1e-6;

/// A ply's material. Where it fails its answers are NaN.
pub struct PlyLaw(Arc<MaterialInstance>);

impl PlyLaw {
    /// Of a formed ply, by the scene that was formed.
    ///
    /// # Errors
    /// When the scene has no such ply, has it with another thickness, or gives it a material that does not bend or cannot be made.
    pub fn new(
        host: &Host,
        scene: &Scene,
        formed: &Forming,
        ply: &Sheet,
    ) -> Result<Self, StepError> {
        let name = &ply.name;
        let wrong = |what: String| {
            StepError::from(format!(
                "scene: {what}; expected the scene that was formed{}, as its materials say how plies bend",
                formed
                    .scene
                    .as_ref()
                    .map_or(String::new(), |s| format!(", '{s}'"))
            ))
        };
        let sheet = scene.sheets.iter().find(|s| s.name == *name);
        let sheet =
            sheet.ok_or_else(|| wrong(format!("'{}' has no sheet '{name}'", scene.name)))?;
        let MaterialEntry::Inline(material) = &sheet.material else {
            return Err(wrong(format!("the material of '{name}' was not read in")));
        };
        let thickness = material.thickness.si();
        if (thickness - ply.thickness).abs() > ROUNDING * thickness.max(ply.thickness) {
            return Err(wrong(format!(
                "'{}' has the ply '{name}' {:.4} mm thick, and {:.4} mm were formed",
                scene.name,
                1e3 * thickness,
                1e3 * ply.thickness
            )));
        }
        let mut with = serde_json::Value::Object(material.with.clone());
        with["thickness"] = thickness.into();
        with["areal_mass"] = material.areal_mass.si().into();
        let found = host.component(PF_KIND_MATERIAL, &material.plugin)?;
        let what = format!("material '{}' of ply '{name}'", material.name);
        // SAFETY: the host gives the table of a material for a material, valid until the process ends (plyflow.h).
        let made = unsafe { MaterialInstance::create(&found, &with.to_string(), &what) }
            .map_err(|e| e.to_string())?;
        if !made.reference().sizes().has_bending {
            return Err(format!(
                "scene: the material '{}' of ply '{name}' has no bending law, which says when its compressed fibres lift off; give it `bending` \
                 (`plyflow plugins {}`), or leave out `scene`",
                material.name, material.plugin
            )
            .into());
        }
        let law = Self(made);
        if law.answers() {
            Ok(law)
        } else {
            let text = format!(
                "scene: {what} does not answer when it is asked for the moments and forces of small bends and strains along its fibres; expected \
                 finite numbers (`plyflow check-plugin` tells what a material must keep), or leave out `scene`"
            );
            Err(text.into())
        }
    }

    /// Whether both calls succeed, with finite numbers.
    fn answers(&self) -> bool {
        [[1.0, 0.0], [0.0, 1.0]].iter().all(|direction| {
            let moments = self.moments(*direction, &[1.0, -1.0]);
            moments.iter().all(|m| m.is_finite()) && self.stiffness(*direction).is_finite()
        })
    }
}

impl Law for PlyLaw {
    fn moments(&self, [c, s]: [f64; 2], curvatures: &[f64]) -> Vec<f64> {
        let material = self.0.reference();
        let mut moments = Vec::with_capacity(curvatures.len());
        for part in curvatures.chunks(LANES) {
            let mut curvature = Aligned::zeros(3 * LANES);
            for (lane, k) in part.iter().enumerate() {
                curvature[lane] = k * c * c;
                curvature[LANES + lane] = k * s * s;
                curvature[2 * LANES + lane] = k * c * s;
            }
            let mut metric = Aligned::filled(1.0, 3 * LANES);
            metric[2 * LANES..].fill(0.0);
            let mut history = Aligned::zeros(material.sizes().bending_history * LANES);
            let mut moment = Aligned::zeros(3 * LANES);
            let mut energy = Aligned::zeros(LANES);
            let code = material.bending(&mut BendingBatch {
                lanes: LANES,
                dt: 0.0,
                metric: &metric,
                curvature: &curvature,
                history: &mut history,
                moment: &mut moment,
                energy: &mut energy,
                tangent: None,
            });
            let [m11, m22, m12] = [0, 1, 2].map(|row| &moment[row * LANES..]);
            let along = |l: usize| match code {
                PF_OK => m11[l] * c * c + m22[l] * s * s + 2.0 * m12[l] * c * s,
                _ => f64::NAN,
            };
            moments.extend((0..part.len()).map(along));
        }
        moments
    }

    fn stiffness(&self, [c, s]: [f64; 2]) -> f64 {
        let material = self.0.reference();
        let mut metric = Aligned::zeros(3 * LANES);
        for lane in 0..LANES {
            metric[lane] = 1.0 + 2.0 * STRAIN * c * c;
            metric[LANES + lane] = 1.0 + 2.0 * STRAIN * s * s;
            metric[2 * LANES + lane] = 2.0 * STRAIN * c * s;
        }
        let mut history = Aligned::zeros(material.sizes().membrane_history * LANES);
        let mut stress = Aligned::zeros(3 * LANES);
        let mut energy = Aligned::zeros(LANES);
        let code = material.membrane(&mut MembraneBatch {
            lanes: LANES,
            dt: 0.0,
            metric: &metric,
            history: &mut history,
            stress: &mut stress,
            energy: &mut energy,
            stiffness: None,
        });
        let [s11, s22, s12] = [0, 1, 2].map(|row| stress[row * LANES]);
        match code {
            PF_OK => (s11 * c * c + s22 * s * s + 2.0 * s12 * c * s) / STRAIN,
            _ => f64::NAN,
        }
    }
}
