//! The standard cantilever test: Peirce's formula (thesis eq. 3.1, BS EN ISO 9073-7).

use crate::material::significant;
use plyflow_fixed::FixedBits;
use serde::Deserialize;

/// The angle of the standard (rad): 41.5 degrees.
pub const STANDARD_ANGLE: f64 = 41.5 * std::f64::consts::PI / 180.0;

/// Overhangs of a strip of fabric (m): what lies outside is a wrong unit.
pub const PLAUSIBLE_OVERHANG: [f64; 2] = [1e-3, 2.0];

/// Bending stiffnesses per width (N m) of sheets that hang like fabrics.
pub const PLAUSIBLE_STIFFNESS: [f64; 2] = [1e-6, 1.0];

/// What one should know of a stiffness (N m) that no fabric has.
pub fn implausible_stiffness(stiffness: f64) -> Option<String> {
    let [low, high] = PLAUSIBLE_STIFFNESS.map(|b| significant(1e3 * b));
    (!(PLAUSIBLE_STIFFNESS[0]..=PLAUSIBLE_STIFFNESS[1]).contains(&stiffness)).then(|| {
        format!(
            "the bending stiffness at rest is {} N mm; fabrics have {low} to {high} N mm: look at the units of the lengths and at `areal_mass`",
            significant(1e3 * stiffness)
        )
    })
}

/// Bending lengths (m), the cube root of stiffness over weight per area, of fabrics from light to stiff ones. It spans far less than their
/// stiffnesses, so that lengths in centimetres under a header in millimetres show.
pub const USUAL_BENDING_LENGTH: [f64; 2] = [0.012, 0.25];

/// What one should know of a bending length (m) that hardly a fabric has.
pub fn implausible_bending_length(length: f64) -> Option<String> {
    let [low, high] = USUAL_BENDING_LENGTH;
    (!(low..=high).contains(&length)).then(|| {
        format!(
            "the bending length, the cube root of stiffness over weight, is {} mm; fabrics have {} to {} mm: look at the units of the lengths, of which \
             the stiffness is the third power",
            significant(1e3 * length),
            significant(1e3 * low),
            significant(1e3 * high)
        )
    })
}

/// How an overhang becomes a stiffness.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Formula {
    /// `B = w L^3 cos(phi / 2) / (8 tan phi)`, any angle (thesis eq. 3.1).
    Peirce,
    /// `B = w (L / 2)^3`, at 41.5 degrees only (BS EN ISO 9073-7).
    Standard,
}

/// Bending stiffness per width (N m) of a strip that hangs with its secant `angle` (rad) below the
/// horizontal when `overhang` (m) stands out; `weight` per area (N/m2).
///
/// # Errors
/// An overhang that is not positive, an angle outside 1..80 degrees, the standard's formula at another angle.
pub fn stiffness(formula: Formula, overhang: f64, angle: f64, weight: f64) -> Result<f64, String> {
    if overhang.is_nan() || overhang <= 0.0 {
        return Err(format!(
            "an overhang of {:.3} mm is none; it must be positive",
            1e3 * overhang
        ));
    }
    let degrees = angle.to_degrees();
    if !(1.0..=80.0).contains(&degrees) {
        return Err(format!(
            "an angle of {degrees:.2} deg is outside of what Peirce's formula is for, 1 to 80 deg: is its unit that of the number \
             (41.5 deg are 0.724 rad)?"
        ));
    }
    match formula {
        Formula::Peirce => {
            Ok(weight * overhang.powi(3) * (0.5 * angle).fixed_cos() / (8.0 * angle.fixed_tan()))
        }
        Formula::Standard if (degrees - 41.5).abs() <= 0.05 => {
            Ok(weight * (0.5 * overhang).powi(3))
        }
        Formula::Standard => Err(format!(
            "the standard's formula holds at 41.5 deg, the angle is {degrees:.2} deg; use `formula: peirce`"
        )),
    }
}

/// Mean and standard deviation (with n - 1; 0 for a single value).
pub fn mean_and_deviation(values: &[f64]) -> [f64; 2] {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    [
        mean,
        if values.len() > 1 {
            (squares / (n - 1.0)).sqrt()
        } else {
            0.0
        },
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_angles_of_the_thesis_give_its_simple_formulas() {
        // At 41.5 deg nearly w (L/2)^3, at 7.1 deg nearly w L^3.
        let at = |degrees: f64| stiffness(Formula::Peirce, 0.2, degrees.to_radians(), 4.0).unwrap();
        let standard = stiffness(Formula::Standard, 0.2, STANDARD_ANGLE, 4.0).unwrap();
        assert!((standard - 0.004).abs() < 1e-15);
        assert!(
            (at(41.5) / standard - 1.057).abs() < 1e-3,
            "{}",
            at(41.5) / standard
        );
        assert!((at(7.1) / (4.0 * 0.008) - 1.0).abs() < 2e-3, "{}", at(7.1));
    }

    #[test]
    fn what_the_formulas_are_not_for_is_refused() {
        assert!(
            stiffness(Formula::Standard, 0.2, 0.124, 4.0)
                .unwrap_err()
                .contains("41.5")
        );
        assert!(stiffness(Formula::Peirce, 0.0, 0.7, 4.0).is_err());
        assert!(stiffness(Formula::Peirce, 0.2, 0.0, 4.0).is_err());
        assert!(stiffness(Formula::Peirce, f64::NAN, 0.7, 4.0).is_err());
    }

    #[test]
    fn the_deviation_is_that_of_a_sample() {
        let [mean, deviation] = mean_and_deviation(&[2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0]);
        assert!((mean - 5.0).abs() < 1e-15 && (deviation - (32.0f64 / 7.0).sqrt()).abs() < 1e-15);
        assert_eq!(mean_and_deviation(&[3.0]), [3.0, 0.0]);
    }
}
