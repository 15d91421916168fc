//! `fabric-linear`: a woven or stitched ply with constant moduli, a beginner's law.
//!
//! Per undeformed area, with Green's strains `E = (C - 1)/2` along and between the fibre families, thickness h, moduli Y1, Y2, G and
//! bending stiffnesses B1, B2, T per width:
//!
//! `W_m = h/2 [Y1 E11^2 + Y2 E22^2 + 4 G E12^2]`, `W_b = 1/2 [B1 k11^2 + B2 k22^2 + 2 T k12^2]`.
//!
//! The families do not know of each other, as in a fabric and unlike in a plate. The law of an orthotropic sheet without coupling (any
//! textbook, such as Jones, Mechanics of Composite Materials, 2.4, with nu12 = 0); it neither locks nor loses a stitch: `material-fabric` does.

use crate::record;
use crate::strain::{green_strain, store_with_work};
use crate::{Lanes, WIDTH, dispatch};
use plyflow_sdk::{BendingBatch, Material, MaterialSizes, MaterialTape, MembraneBatch};

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    fibre_modulus_1: f64,
    fibre_modulus_2: f64,
    shear_modulus: f64,
    bending: Option<Bending>,
    thickness: f64,
    areal_mass: f64,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Bending {
    family_1: f64,
    family_2: f64,
    twist: f64,
}

/// The ply.
pub struct FabricLinear {
    /// Y1 h, Y2 h, 2 G h (N/m): stress over Green's strain.
    membrane: [f64; 3],
    /// B1, B2, T (N m); `None`: it does not bend.
    bending: Option<[f64; 3]>,
    thickness: f64,
    areal_mass: f64,
}

impl Material for FabricLinear {
    const MANIFEST: &'static str = include_str!("fabric_linear/manifest.json");

    fn create(parameters: &str) -> Result<Self, String> {
        let p: Parameters = serde_json::from_str(parameters)
            .map_err(|e| format!("parameters of fabric-linear: {e}"))?;
        let bending = p.bending.map(|b| [b.family_1, b.family_2, b.twist]);
        let [b1, b2, twist] = bending.unwrap_or([1.0; 3]);
        for (name, value, unit) in [
            ("fibre_modulus_1", p.fibre_modulus_1, "Pa"),
            ("fibre_modulus_2", p.fibre_modulus_2, "Pa"),
            ("shear_modulus", p.shear_modulus, "Pa"),
            ("bending.family_1", b1, "N m"),
            ("bending.family_2", b2, "N m"),
            ("bending.twist", twist, "N m"),
            ("thickness", p.thickness, "m"),
            ("areal_mass", p.areal_mass, "kg/m2"),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(format!(
                    "{name}: given {value} {unit}; expected a finite value above 0"
                ));
            }
        }
        let membrane = [p.fibre_modulus_1, p.fibre_modulus_2, 2.0 * p.shear_modulus];
        Ok(Self {
            membrane: membrane.map(|modulus| modulus * p.thickness),
            bending,
            thickness: p.thickness,
            areal_mass: p.areal_mass,
        })
    }

    fn sizes(&self) -> MaterialSizes {
        MaterialSizes {
            membrane_history: 0,
            bending_history: 0,
            has_bending: self.bending.is_some(),
            thickness: self.thickness,
            areal_mass: self.areal_mass,
        }
    }

    fn membrane(&self, b: &mut MembraneBatch<'_>) {
        membrane(self.membrane, b.lanes, b.metric, b.stress, b.energy);
        if let Some(stiffness) = b.stiffness.as_deref_mut() {
            let [first, second, shear] = self.membrane;
            stiffness[..b.lanes].fill(first.max(second).max(shear));
            stiffness[b.lanes..2 * b.lanes].fill(0.5 * shear);
        }
    }

    fn bending(&self, b: &mut BendingBatch<'_>) {
        let Some(stiffness) = self.bending else {
            return;
        };
        bending(stiffness, b.lanes, b.curvature, b.moment, b.energy);
        if let Some(tangent) = b.tangent.as_deref_mut() {
            for (row, value) in tangent.chunks_exact_mut(b.lanes).zip(stiffness) {
                row.fill(value);
            }
        }
    }

    fn tape(&self, what: MaterialTape) -> Result<Option<String>, String> {
        record::of_material(self, what)
    }
}

dispatch!(fn membrane(
    d: [f64; 3],
    n: usize,
    metric: &[f64],
    stress: &mut [f64],
    energy: &mut [f64],
) = membrane_kernel);
dispatch!(fn bending(
    d: [f64; 3],
    n: usize,
    curvature: &[f64],
    moment: &mut [f64],
    energy: &mut [f64],
) = bending_kernel);

#[inline(always)]
fn membrane_kernel<V: Lanes>(
    d: [f64; 3],
    n: usize,
    metric: &[f64],
    stress: &mut [f64],
    energy: &mut [f64],
) {
    for c in (0..n).step_by(WIDTH) {
        let e = green_strain::<V>(metric, n, c);
        linear(d, e, n, c, stress, energy);
    }
}

#[inline(always)]
fn bending_kernel<V: Lanes>(
    d: [f64; 3],
    n: usize,
    curvature: &[f64],
    moment: &mut [f64],
    energy: &mut [f64],
) {
    for c in (0..n).step_by(WIDTH) {
        let row = |r: usize| V::load(curvature, r * n + c);
        let k = [row(0), row(1), row(2)];
        linear(d, k, n, c, moment, energy);
    }
}

/// `s = [d0 e11, d1 e22, d2 e12]` and half its work on e.
#[inline(always)]
fn linear<V: Lanes>(d: [f64; 3], e: [V; 3], n: usize, c: usize, s: &mut [f64], energy: &mut [f64]) {
    let stress = [
        V::splat(d[0]) * e[0],
        V::splat(d[1]) * e[1],
        V::splat(d[2]) * e[2],
    ];
    store_with_work(stress, e, n, c, s, energy);
}
