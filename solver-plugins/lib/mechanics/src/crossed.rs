//! What elements tell of fibres, for families that do not cross at a right angle.
//!
//! Elements know the axes e1 and e2 of a sheet, and take its families to lie along them. Where the second family lies elsewhere, its strain and
//! the shear between both follow from what the elements tell: with the stretches `l1`, `l2` and the shear angle of the axes C11, C22 and C12 are known, and
//! the rest is that of the law (`material-fabric`, `crossing`).

use plyflow_fixed::FixedBits;

/// Field of the shear angle (rad).
const SHEAR: &str = "shear_angle";
/// Fields of the strains along both families.
const STRAINS: [&str; 2] = ["fibre_strain_1", "fibre_strain_2"];

/// Families that cross at another angle than a right one.
#[derive(Debug, Clone, Copy)]
pub struct Crossed {
    angle: f64,
}

impl Crossed {
    /// Of the angle from family 1 to family 2, counter-clockwise (rad).
    pub fn new(angle: f64) -> Self {
        Self { angle }
    }

    /// Direction of family 2 in the plane of e1 and e2.
    pub fn second(&self) -> [f64; 2] {
        [self.angle.fixed_cos(), self.angle.fixed_sin()]
    }

    /// Shear angle (rad) of the families, and strain of family 2, of the stretches l1 and l2 and the shear angle (rad) of the axes.
    pub fn families(&self, l1: f64, l2: f64, sheared: f64) -> (f64, f64) {
        let [c, s] = self.second();
        let between = l1 * l2 * sheared.fixed_sin();
        let square = c * c * l1 * l1 + 2.0 * c * s * between + s * s * l2 * l2;
        // l1 l2' cos t and l1 l2' sin t of the angle t between them now.
        let along = c * l1 * l1 + s * between;
        let area = s * l1 * l2 * sheared.fixed_cos();
        (
            self.angle - area.fixed_atan2(along),
            square.max(0.0).sqrt() - 1.0,
        )
    }

    /// Values of the field `name` where it is one of fibres that differ from what the element tells. `of` gives the element's own ones; `None` where it
    /// has no such field.
    pub fn field(&self, name: &str, of: impl Fn(&str) -> Option<Vec<f64>>) -> Option<Vec<f64>> {
        if name != SHEAR && name != STRAINS[1] {
            return None;
        }
        let [shear, first, second] = [of(SHEAR)?, of(STRAINS[0])?, of(STRAINS[1])?];
        let cells = shear.iter().zip(first.iter().zip(&second));
        let both = cells.map(|(g, (a, b))| self.families(1.0 + a, 1.0 + b, *g));
        let chosen = both.map(|(g, strain)| if name == SHEAR { g } else { strain });
        Some(chosen.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The deformation gradient of columns f1, f2: what the axes tell, and what families at 0 and `angle` do, by their own images.
    fn compare(f: [[f64; 2]; 2], angle: f64) {
        let dot = |a: [f64; 2], b: [f64; 2]| a[0] * b[0] + a[1] * b[1];
        let norm = |a: [f64; 2]| dot(a, a).sqrt();
        let [f1, f2] = f;
        let sheared = (dot(f1, f2) / (norm(f1) * norm(f2))).asin();
        let image = [0, 1].map(|k| angle.cos() * f1[k] + angle.sin() * f2[k]);
        let now = (dot(f1, image) / (norm(f1) * norm(image))).acos();
        let (shear, strain) = Crossed::new(angle).families(norm(f1), norm(f2), sheared);
        assert!((shear - (angle - now)).abs() < 1e-12, "{shear} {now}");
        assert!((strain - (norm(image) - 1.0)).abs() < 1e-12, "{strain}");
    }

    #[test]
    fn shear_and_strain_are_those_of_the_images_of_both_families() {
        for degrees in [30.0f64, 60.0, 90.0, 110.0, 150.0] {
            for f in [
                [[1.0, 0.0], [0.0, 1.0]],
                [[1.01, 0.02], [0.3, 0.9]],
                [[0.98, 0.1], [-0.5, 0.8]],
                [[0.6, 0.6], [-0.7, 0.75]],
            ] {
                compare(f, degrees.to_radians());
            }
        }
    }

    #[test]
    fn other_fields_are_the_elements_own() {
        let crossed = Crossed::new(1.0);
        let of = |name: &str| {
            let known = [
                ("shear_angle", 0.1),
                ("fibre_strain_1", 0.0),
                ("fibre_strain_2", 0.01),
            ];
            known
                .iter()
                .find(|(n, _)| *n == name)
                .map(|(_, v)| vec![*v; 2])
        };
        assert!(crossed.field("fibre_strain_1", of).is_none());
        assert!(crossed.field("membrane_force_1", of).is_none());
        let (shear, strain) = crossed.families(1.0, 1.01, 0.1);
        assert_eq!(crossed.field("shear_angle", of), Some(vec![shear; 2]));
        assert_eq!(crossed.field("fibre_strain_2", of), Some(vec![strain; 2]));
        assert!(crossed.field("shear_angle", |_| None).is_none());
    }
}
