//! The resolved `with` block of a fabric (SI numbers) and its checks.

use super::bending::{Bending, Law};
use super::shear::Shear;
use super::{Fabric, Form};
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Parameters {
    #[serde(default = "fibre_energy")]
    form: Form,
    fibre_modulus: f64,
    #[serde(default = "one")]
    compression_factor: f64,
    shear: ShearParameters,
    stitch: Option<StitchParameters>,
    bending: Option<BendingParameters>,
    thickness: f64,
    areal_mass: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ShearParameters {
    coefficients: Vec<f64>,
    #[serde(default = "sixty_degrees")]
    limit: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StitchParameters {
    angles: Vec<f64>,
    forces: Vec<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BendingParameters {
    positive: Law,
    negative: Option<Law>,
    #[serde(default)]
    positive_face: Face,
    #[serde(default)]
    families: Families,
    twist_stiffness: Option<f64>,
}

#[derive(Deserialize, Default, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum Face {
    #[default]
    Up,
    Down,
}

#[derive(Deserialize, Default, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum Families {
    #[default]
    Opposite,
    Same,
}

fn fibre_energy() -> Form {
    Form::FibreEnergy
}

fn one() -> f64 {
    1.0
}

fn sixty_degrees() -> f64 {
    60f64.to_radians()
}

fn positive(name: &str, value: f64, unit: &str) -> Result<(), String> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(format!(
        "{name}: given {value} {unit}; expected a finite value above 0"
    ))
}

impl Parameters {
    pub(super) fn build(self) -> Result<Fabric, String> {
        positive("fibre_modulus", self.fibre_modulus, "Pa")?;
        positive("thickness", self.thickness, "m")?;
        positive("areal_mass", self.areal_mass, "kg/m2")?;
        if !(0.0..=1.0).contains(&self.compression_factor) {
            return Err(format!(
                "compression_factor: given {}; expected 0 to 1",
                self.compression_factor
            ));
        }
        let stitch = self.stitch.as_ref();
        let shear = Shear::new(
            &self.shear.coefficients,
            self.shear.limit,
            stitch.map_or(&[], |s| &s.angles),
            stitch.map_or(&[], |s| &s.forces),
        )?;
        let h = self.thickness;
        let bending = self
            .bending
            .map(|b| b.build(shear.initial_slope() * h * h / 6.0));
        let tension = self.fibre_modulus * h;
        Ok(Fabric {
            form: self.form,
            tension,
            compression: tension * self.compression_factor,
            shear,
            bending: bending.transpose()?,
            thickness: h,
            areal_mass: self.areal_mass,
        })
    }
}

impl BendingParameters {
    /// `twist`: dM12/dk12 when none is given.
    fn build(self, twist: f64) -> Result<Bending, String> {
        let negative = self.negative.unwrap_or(self.positive);
        for (name, law) in [("positive", &self.positive), ("negative", &negative)] {
            positive(&format!("bending.{name}.scale"), law.scale, "1/m")?;
            let (a, b) = (law.linear, law.asymptote);
            if !(a >= 0.0 && b >= 0.0 && a.is_finite() && b.is_finite()) {
                return Err(format!(
                    "bending.{name}: given linear {a} N m and asymptote {b} N; expected at least 0"
                ));
            }
        }
        let twist = self.twist_stiffness.unwrap_or(twist);
        if !(twist >= 0.0 && twist.is_finite()) {
            return Err(format!(
                "bending.twist_stiffness: given {twist} N m; expected at least 0"
            ));
        }
        let first = if self.positive_face == Face::Up {
            1.0
        } else {
            -1.0
        };
        let second = if self.families == Families::Same {
            first
        } else {
            -first
        };
        Ok(Bending {
            laws: [self.positive, negative],
            signs: [first, second],
            twist,
        })
    }
}
