//! Incompressible film in plane stress with a Marlow energy: `W = h0 U(I1)`, `I1 = tr C + 1/det C`,
//! which returns a given uniaxial nominal stress-strain curve T(e) exactly.
//!
//! A uniaxial stretch l = 1 + e has `I1 = l^2 + 2/l`. Its energy is `U = integral of T de`, hence
//! `dU/dI1 = T(e) / (2 (l - l^-2))`. For any state, e is the non-negative root of
//! `e^3 + 3 e^2 - D e - D = 0`, `D = I1 - 3` (the same relation without its cancellation), found by
//! Newton's method; U and dU/dI1 follow in closed form, so that the stress is the exact derivative
//! of the energy. Source: Marlow 2003; thesis table 5.1 (its strains are in per cent).
//!
//! Beyond the limit strain T goes on along its tangent (convex energy). As det C -> 0, 1/det C goes
//! on along its tangent from det C = 0.001 downwards, so every state stays finite. There is no
//! bending, and no resistance to compression besides incompressibility's.

use crate::record;
use crate::{Lanes, WIDTH, dispatch, exp};
use plyflow_fixed::FixedBits;
use plyflow_sdk::{Material, MaterialSizes, MaterialTape, MembraneBatch};
use serde::Deserialize;

/// Least det C at which 1/det C is evaluated.
const LEAST_DETERMINANT: f64 = 1e-3;
/// Most points of a table.
const MAX_POINTS: usize = 32;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameters {
    uniaxial: Uniaxial,
    limit: Option<f64>,
    thickness: f64,
    areal_mass: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Uniaxial {
    amplitude: Option<f64>,
    growth: Option<f64>,
    decay: Option<f64>,
    strains: Option<Vec<f64>>,
    stresses: Option<Vec<f64>>,
}

/// Where the exponential curve ends when nothing is said.
const LIMIT: f64 = 5.0;

/// T = amplitude (exp(growth e) - exp(-decay e)) up to the limit.
#[derive(Clone, Copy, Debug)]
struct Exponential {
    amplitude: f64,
    growth: f64,
    decay: f64,
    limit: f64,
    /// T and dT/de at the limit.
    end: f64,
    end_slope: f64,
}

/// Straight pieces: sum of `slope * max(e - strain, 0)`.
#[derive(Clone, Debug)]
struct Table {
    hinges: Vec<(f64, f64)>,
}

#[derive(Clone, Debug)]
enum Curve {
    Exponential(Exponential),
    Table(Table),
}

/// A film.
pub struct Marlow {
    curve: Curve,
    thickness: f64,
    areal_mass: f64,
}

impl Exponential {
    fn new(amplitude: f64, growth: f64, decay: f64, limit: f64) -> Result<Self, String> {
        let fine = amplitude > 0.0 && growth >= 0.0 && decay > 0.0 && limit > 0.0;
        let (up, down) = ((growth * limit).fixed_exp(), (-decay * limit).fixed_exp());
        if !(fine && up.is_finite()) {
            return Err(format!(
                "uniaxial: given amplitude {amplitude} Pa, growth {growth}, decay {decay}, limit \
                 {limit}; expected amplitude, decay and limit above 0, growth at least 0 (rates per \
                 unit strain, not per cent)"
            ));
        }
        Ok(Self {
            amplitude,
            growth,
            decay,
            limit,
            end: amplitude * (up - down),
            end_slope: amplitude * (growth * up + decay * down),
        })
    }

    /// T, dT/de and the energy at e.
    #[inline(always)]
    fn at<V: Lanes>(&self, e: V) -> (V, V, V) {
        let inside = e.min(V::splat(self.limit));
        let beyond = e - inside;
        let (a, b) = (V::splat(self.growth), V::splat(self.decay));
        let (up, down) = (exp(a * inside), exp(-(b * inside)));
        let amplitude = V::splat(self.amplitude);
        let slope = V::select(
            V::splat(0.0).lt(beyond),
            V::splat(self.end_slope),
            amplitude * (a * up + b * down),
        );
        let stress = amplitude * (up - down) + V::splat(self.end_slope) * beyond;
        let one = V::splat(1.0);
        // The integral of exp(growth e); its limit for growth = 0 is e.
        let risen = if self.growth > 1e-9 {
            (up - one) / a
        } else {
            inside
        };
        let energy = amplitude * (risen - (one - down) / b)
            + (V::splat(self.end) + V::splat(0.5 * self.end_slope) * beyond) * beyond;
        (stress, slope, energy)
    }
}

/// A curve through the origin that rises all the way: else the film is unstable.
fn check_table(strains: &[f64], stresses: &[f64]) -> Result<(), String> {
    let n = strains.len();
    if n != stresses.len() {
        return Err(format!(
            "uniaxial: given {n} strains and {} stresses; expected as many of each",
            stresses.len()
        ));
    }
    if !(2..=MAX_POINTS).contains(&n) {
        return Err(format!(
            "uniaxial: given {n} points; expected 2 to {MAX_POINTS}, closer together where the curve bends"
        ));
    }
    for (name, unit, v) in [("strains", "", strains), ("stresses", " Pa", stresses)] {
        if let Some(i) = v.iter().position(|x| !x.is_finite()) {
            return Err(format!(
                "uniaxial.{name}[{i}]: given {}{unit}; expected a finite number",
                v[i]
            ));
        }
        if v[0] != 0.0 {
            return Err(format!(
                "uniaxial.{name}[0]: given {}{unit}; expected 0: put the point 0, 0 Pa in front, or take \
                 the offset from the measured values",
                v[0]
            ));
        }
        if let Some(i) = (1..n).find(|i| v[*i] <= v[*i - 1]) {
            return Err(format!(
                "uniaxial.{name}[{i}]: given {}{unit} after {}{unit}; expected increasing {name} (a film \
                 whose stress falls is unstable): sort or smooth the points, and end the table before the \
                 film yields; beyond the last point the stress goes on along its tangent",
                v[i],
                v[i - 1]
            ));
        }
    }
    Ok(())
}

impl Table {
    fn new(strains: &[f64], stresses: &[f64]) -> Result<Self, String> {
        check_table(strains, stresses)?;
        let n = strains.len();
        let mut before = 0.0;
        let mut hinges = Vec::with_capacity(n);
        for i in 0..n - 1 {
            let slope = (stresses[i + 1] - stresses[i]) / (strains[i + 1] - strains[i]);
            hinges.push((strains[i], slope - before));
            before = slope;
        }
        Ok(Self { hinges })
    }

    #[inline(always)]
    fn at<V: Lanes>(&self, e: V) -> (V, V, V) {
        let zero = V::splat(0.0);
        let (mut stress, mut slope, mut energy) = (zero, zero, zero);
        for (strain, change) in &self.hinges {
            let (from, change) = (V::splat(*strain), V::splat(*change));
            let x = (e - from).max(zero);
            stress = stress + change * x;
            energy = energy + V::splat(0.5) * change * x * x;
            slope = slope + V::select(e.lt(from), zero, change);
        }
        (stress, slope, energy)
    }
}

impl Marlow {
    #[inline(always)]
    fn at<V: Lanes>(&self, e: V) -> (V, V, V) {
        match &self.curve {
            Curve::Exponential(c) => c.at(e),
            Curve::Table(c) => c.at(e),
        }
    }

    /// Slope dT/de at rest (Pa).
    fn initial_modulus(&self) -> f64 {
        match &self.curve {
            Curve::Exponential(c) => c.amplitude * (c.growth + c.decay),
            Curve::Table(c) => c.hinges[0].1,
        }
    }
}

impl Material for Marlow {
    const MANIFEST: &'static str = include_str!("marlow/manifest.json");

    fn create(parameters: &str) -> Result<Self, String> {
        let p: Parameters = serde_json::from_str(parameters)
            .map_err(|e| format!("parameters of material-marlow: {e}"))?;
        let u = p.uniaxial;
        let curve = match (u.amplitude, u.growth, u.decay, u.strains, u.stresses) {
            (Some(a), Some(g), Some(d), None, None) => {
                Curve::Exponential(Exponential::new(a, g, d, p.limit.unwrap_or(LIMIT))?)
            }
            (None, None, None, Some(e), Some(t)) => {
                if let Some(limit) = p.limit {
                    return Err(format!(
                        "limit: given {limit} beside 'strains' and 'stresses'; expected none: a table ends at its last point"
                    ));
                }
                Curve::Table(Table::new(&e, &t)?)
            }
            _ => {
                return Err(
                    "uniaxial: expected either 'amplitude', 'growth' and 'decay', or \
                            'strains' and 'stresses'"
                        .into(),
                );
            }
        };
        if !(p.thickness > 0.0 && p.areal_mass > 0.0) {
            return Err(format!(
                "thickness {} m and areal mass {} kg/m2: expected values above 0",
                p.thickness, p.areal_mass
            ));
        }
        Ok(Self {
            curve,
            thickness: p.thickness,
            areal_mass: p.areal_mass,
        })
    }

    fn sizes(&self) -> MaterialSizes {
        MaterialSizes {
            membrane_history: 0,
            bending_history: 0,
            has_bending: false,
            thickness: self.thickness,
            areal_mass: self.areal_mass,
        }
    }

    fn membrane(&self, b: &mut MembraneBatch<'_>) {
        let stiffness = b.stiffness.as_deref_mut().unwrap_or(&mut []);
        membrane(self, b.lanes, b.metric, b.stress, b.energy, stiffness);
    }

    fn tape(&self, what: MaterialTape) -> Result<Option<String>, String> {
        record::of_material(self, what)
    }
}

/// The strain e >= 0 of the uniaxial state with I1 = 3 + d.
#[inline(always)]
fn uniaxial_strain<V: Lanes>(d: V) -> V {
    // Starting value: right at both ends, d^(1/2) / 3^(1/2) and d^(1/2) - 1, within 5 % between.
    let root = d.sqrt();
    let p = V::splat(1.366_025_403_784_438_6);
    let mut e = root * (root + p) / (root + p * V::splat(1.732_050_807_568_877_2));
    let (two, three, six) = (V::splat(2.0), V::splat(3.0), V::splat(6.0));
    for _ in 0..4 {
        // e <- e - f / f' with f = e^3 + 3 e^2 - d e - d, written without the subtraction of e.
        let e2 = e * e;
        let numerator = e2 * (two * e + three) + d;
        let denominator = e * (three * e + six) - d;
        e = numerator / denominator.max(V::splat(1e-300));
    }
    e
}

dispatch!(fn membrane(
    f: &Marlow,
    n: usize,
    metric: &[f64],
    stress: &mut [f64],
    energy: &mut [f64],
    stiffness: &mut [f64],
) = membrane_kernel);

/// Long, as it is the loop of a kernel: pieces of it would share most of its values, and its speed would hang on how they are inlined.
#[inline(always)]
fn membrane_kernel<V: Lanes>(
    f: &Marlow,
    n: usize,
    metric: &[f64],
    stress: &mut [f64],
    energy: &mut [f64],
    stiffness: &mut [f64],
) {
    let (zero, one, two) = (V::splat(0.0), V::splat(1.0), V::splat(2.0));
    let h = V::splat(f.thickness);
    let modulus = V::splat(f.initial_modulus() / 6.0);
    for c in (0..n).step_by(WIDTH) {
        let c11 = V::load(metric, c);
        let c22 = V::load(metric, n + c);
        let c12 = V::load(metric, 2 * n + c);
        let det = c11 * c22 - c12 * c12;
        let held = det.max(V::splat(LEAST_DETERMINANT));
        let inverse = one / held;
        let square = inverse * inverse;
        // 1/det, along its tangent below the floor.
        let thickness = inverse - (det - held) * square;
        let d = (c11 + c22 + thickness - V::splat(3.0)).max(V::splat(1e-20));
        let e = uniaxial_strain(d);
        let (t, slope, u) = f.at(e);
        // l - l^-2 = e (3 + 3 e + e^2) / l^2.
        let l = one + e;
        let l2 = l * l;
        let width = e * (V::splat(3.0) + e * (V::splat(3.0) + e)) / l2;
        let safe = width.max(V::splat(1e-7));
        let small = width.lt(V::splat(1e-7));
        let rate = V::select(small, modulus, t / (two * safe));
        let factor = two * h * rate;
        (factor * (one - c22 * square)).store(stress, c);
        (factor * (one - c11 * square)).store(stress, n + c);
        (factor * c12 * square).store(stress, 2 * n + c);
        (h * u).store(energy, c);
        if !stiffness.is_empty() {
            // dS/dE = 4 h (U'' a (x) a + U' d2(1/det)/dC2), a = dI1/dC. U'' counts where it is positive.
            let a11 = one - c22 * square;
            let a22 = one - c11 * square;
            let a12 = c12 * square;
            let aa = a11 * a11 + a22 * a22 + two * a12 * a12;
            let bend = one + two / (l2 * l);
            let second = V::select(
                small,
                zero,
                (slope - t * bend / safe) / (V::splat(4.0) * safe * safe.max(V::splat(1e-7))),
            )
            .max(zero);
            let cc = c11 * c11 + c22 * c22 + two * c12 * c12;
            // d2(1/det) = [(C^-1 : X)^2 + C^-1 X C^-1 : X] / det, bounded by the Frobenius and the
            // spectral norm of C^-1 (in two dimensions those of C over det); exact at rest.
            let half = V::splat(0.5);
            let apart = half * (c11 - c22);
            let widest = half * (c11 + c22) + (apart * apart + c12 * c12).sqrt();
            let hessian = (cc + widest * widest) * square * inverse;
            let four = V::splat(4.0) * h;
            (four * (second * aa + rate * hessian)).store(stiffness, c);
            // dS12 / d(2 E12) = 2 h U' / det^2 (1 + 4 C12^2 / det) + 4 h U'' C12^2 / det^4; never below that at rest.
            let sheared = c12 * c12;
            let turning = one + V::splat(4.0) * sheared * inverse;
            (factor * square * turning + four * second * sheared * square * square)
                .max(two * h * modulus.min(rate))
                .store(stiffness, n + c);
        }
    }
}
