//! What an element of `s4` is made of: its parameters, its layers, its material at rest, and the rows of its constants and history.

use super::lag;
use crate::coupling;
use crate::quad::Hourglass;
use crate::rows::Rows;
use crate::{WIDTH, thickening};
use plyflow_sdk::abi::PF_OK;
use plyflow_sdk::{Aligned, BendingBatch, MaterialRef};

/// Rows of constants after those of [`crate::quad`].
pub(super) mod row {
    /// Unit normal of the reference (3).
    pub const NORMAL: usize = crate::quad::CONSTANTS;
    /// (X1 - X2 + X3 - X4) . normal (m).
    pub const WARP: usize = NORMAL + 3;
    /// K11, K22, K12 of transverse shear, times the area (N m).
    pub const SHEAR: usize = WARP + 1;
    /// Stiffness of e_12 - e_43 and of e_14 - e_23 (N/m).
    pub const EDGE: usize = SHEAR + 3;
    /// Stiffness of the directors' hourglass mode (N m).
    pub const DIRECTOR: usize = EDGE + 2;
    /// Rotary inertia of a node (kg m2).
    pub const INERTIA: usize = DIRECTOR + 1;
    pub const COUNT: usize = INERTIA + 1;
}

/// Rows of history: directors `[4][3]`; with lagged tangents also those of [`lag`]; then the
/// material's bending history.
pub(super) const DIRECTORS: usize = 12;
#[derive(Clone, Copy, PartialEq, Eq, Debug, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum BendingRule {
    LaggedTangent,
    Total,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Twist {
    Layers,
    Material,
}

/// Parameters; see the manifest.
#[derive(Clone, Copy, Debug, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Parameters {
    pub(super) bending: BendingRule,
    pub(super) twist: Twist,
    pub(super) core_share: f64,
    pub(super) transverse_shear: f64,
    pub(super) transverse_shear_modulus: Option<f64>,
    pub(super) hourglass: f64,
    pub(super) hourglass_floor: f64,
    pub(super) hourglass_shear: f64,
    pub(super) hourglass_director: f64,
    pub(super) thickening: u32,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            bending: BendingRule::Total,
            twist: Twist::Layers,
            core_share: 1.0 / 3.0,
            transverse_shear: 1.0,
            transverse_shear_modulus: None,
            hourglass: 1.0,
            hourglass_floor: 3000.0,
            hourglass_shear: 1.0,
            hourglass_director: 0.5,
            thickening: 0,
        }
    }
}

impl Parameters {
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let p: Self =
            serde_json::from_str(text).map_err(|e| format!("parameters of element 's4': {e}"))?;
        if !(0.0..1.0).contains(&p.core_share) {
            return Err(format!(
                "core_share: given {}; expected at least 0 and below 1 (thickness of the central \
                 layer over that of the sheet)",
                p.core_share
            ));
        }
        let modulus = p.transverse_shear_modulus.unwrap_or(1.0);
        if !(modulus > 0.0 && modulus.is_finite()) {
            return Err(format!(
                "transverse_shear_modulus: given {modulus} Pa; expected a finite value above 0"
            ));
        }
        thickening::check(p.thickening)?;
        if p.thickening > 0 && p.bending == BendingRule::LaggedTangent {
            return Err(format!(
                "thickening: given {} with 'bending: lagged-tangent', whose moments grow step by step and have no \
                 energy to thicken: set 'bending: total' or 'thickening: 0'",
                p.thickening
            ));
        }
        for (name, value) in [
            ("transverse_shear", p.transverse_shear),
            ("hourglass_shear", p.hourglass_shear),
            ("hourglass_director", p.hourglass_director),
        ] {
            // Zero leaves a motion without resistance; beyond 1000 it would only cost time steps.
            if !(value > 0.0 && value <= 1e3) {
                return Err(format!(
                    "{name}: given {value}; expected above 0, at most 1000"
                ));
            }
        }
        Ok(p)
    }
}

/// Bending of a material in its undeformed state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rest {
    /// Largest dM/dk of the two families, both signs (N m).
    pub(super) stiffness: f64,
    /// dM12/dk12 (N m).
    pub(super) twist: f64,
    /// Whether one family's curvature gives the other a moment.
    pub(super) coupled: bool,
    /// Whether a twist bends the families.
    pub(super) twist_bends: bool,
}

impl Rest {
    pub(super) fn of(material: &MaterialRef) -> Result<Self, String> {
        let sizes = material.sizes();
        if !sizes.has_bending {
            return Err(
                "element 's4' needs a material with bending stiffness; this one has none: \
                        give the fabric a 'bending' block, or use the membrane 'm4'"
                    .into(),
            );
        }
        // A surface strain of about 1e-9: small against every law's scale.
        let k = 1e-9 / sizes.thickness;
        let mut metric = Rows::<{ 3 * WIDTH }>::zeros();
        metric.0[..2 * WIDTH].fill(1.0);
        let mut curvature = Rows::<{ 3 * WIDTH }>::zeros();
        for (lane, (r, sign)) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)]
            .into_iter()
            .enumerate()
        {
            curvature.0[r * WIDTH + lane] = sign * k;
        }
        let mut history = Aligned::zeros(sizes.bending_history * WIDTH);
        let mut moment = Rows::<{ 3 * WIDTH }>::zeros();
        let mut energy = Rows::<WIDTH>::zeros();
        let mut tangent = Rows::<{ 3 * WIDTH }>::zeros();
        let code = material.bending(&mut BendingBatch {
            lanes: WIDTH,
            dt: 0.0,
            metric: &metric.0,
            curvature: &curvature.0,
            history: &mut history,
            moment: &mut moment.0,
            energy: &mut energy.0,
            tangent: Some(&mut tangent.0),
        });
        let stiffness = tangent.0[..2 * WIDTH].iter().fold(0.0f64, |m, t| m.max(*t));
        let twist = tangent.0[2 * WIDTH];
        let finite = tangent.0.iter().all(|t| t.is_finite());
        if code != PF_OK || !(finite && stiffness > 0.0 && twist >= 0.0) {
            return Err(format!(
                "the material's moments at rest gave code {code}, largest tangent {stiffness} N m \
                 and twist tangent {twist} N m: expected code 0, finite tangents, bending above 0"
            ));
        }
        let m = &moment.0;
        let cross = m[WIDTH].abs().max(m[2].abs());
        Ok(Self {
            stiffness,
            twist,
            coupled: cross > 1e-6 * m[0].abs().max(m[WIDTH + 2].abs()),
            twist_bends: coupling::twist_bends(material),
        })
    }
}

/// Weights of the layers: middle, one surface layer, and the height of a surface layer (m).
#[derive(Clone, Copy, Debug)]
pub(super) struct Layers {
    pub(super) core: f64,
    pub(super) surface: f64,
    pub(super) height: f64,
}

/// The formulation for one material.
pub struct S4 {
    pub(super) plane: Hourglass,
    pub(super) parameters: Parameters,
    pub(super) rest: Rest,
    /// None: the middle alone, twist from the material.
    pub(super) layers: Option<Layers>,
    pub(super) thickness: f64,
    pub(super) areal_mass: f64,
    pub(super) bending_history: usize,
}

impl S4 {
    pub(super) fn points(&self) -> usize {
        if self.layers.is_some() { 3 } else { 1 }
    }

    pub(super) fn lagged(&self) -> bool {
        self.parameters.bending == BendingRule::LaggedTangent
    }

    /// Where the material's bending history starts.
    pub(super) fn material_rows(&self) -> usize {
        DIRECTORS + if self.lagged() { lag::HISTORY } else { 0 }
    }
}
