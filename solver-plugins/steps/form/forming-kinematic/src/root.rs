//! The point of a circle, or of a line, that lies on the surface.

use crate::surface::DrapeSurface;
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{Vec3, add, dot, scale};

/// Why there is no such point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Miss {
    /// The circle does not meet the surface within the angles allowed.
    NoPoint,
    /// The surface ends there.
    Edge,
}

/// A circle: centre + radius (cos(angle) ahead + sin(angle) aside), `ahead` and `aside` unit and square to each other.
#[derive(Debug, Clone, Copy)]
pub struct Circle {
    /// m.
    pub centre: Vec3,
    /// m.
    pub radius: f64,
    /// Direction at angle zero.
    pub ahead: Vec3,
    /// Direction at a quarter turn.
    pub aside: Vec3,
}

impl Circle {
    fn at(&self, angle: f64) -> Vec3 {
        let (s, c) = angle.fixed_sin_cos();
        let turn = add(scale(self.ahead, c), scale(self.aside, s));
        add(self.centre, scale(turn, self.radius))
    }

    fn slope(&self, angle: f64) -> Vec3 {
        let (s, c) = angle.fixed_sin_cos();
        scale(
            add(scale(self.ahead, -s), scale(self.aside, c)),
            self.radius,
        )
    }

    /// Its point on the surface at `offset` (m) nearest to angle zero, within 100 degrees, and the surface's
    /// normal there. The point lies on the circle to rounding and on the surface to 1e-11 radii.
    ///
    /// # Errors
    /// See [`Miss`].
    pub fn meet(&self, surface: &dyn DrapeSurface, offset: f64) -> Result<(Vec3, Vec3), Miss> {
        let level = |angle: f64| surface.level(self.at(angle), offset).ok_or(Miss::Edge);
        let slope = |angle: f64, normal: Vec3| dot(self.slope(angle), normal);
        let angle = nearest_root(level, slope, 1.75, 1e-11 * self.radius)?;
        let (_, normal) = level(angle)?;
        Ok((self.at(angle), normal))
    }
}

/// The point of the vertical line through (x, y) on the surface at `offset` over the facet at height `z` with the
/// normal `face`; also the surface's normal there.
pub fn drop_on(
    surface: &dyn DrapeSurface,
    [x, y, z]: Vec3,
    face: Vec3,
    offset: f64,
    reach: f64,
) -> Option<(Vec3, Vec3)> {
    let from = z + offset / face[2].max(0.05);
    let at = |rise: f64| [x, y, from + rise];
    let level = |rise: f64| surface.level(at(rise), offset).ok_or(Miss::Edge);
    let slope = |_: f64, normal: Vec3| normal[2];
    let rise = nearest_root(level, slope, reach, 1e-13).ok()?;
    let (_, normal) = level(rise).ok()?;
    Some((at(rise), normal))
}

/// The root of `level` nearest to zero within +-`most`, to `tolerance` of the level: Newton's method; if that leaves or
/// stalls, a search outwards in steps for a change of sign, which is then halved.
fn nearest_root(
    level: impl Fn(f64) -> Result<(f64, Vec3), Miss>,
    slope: impl Fn(f64, Vec3) -> f64,
    most: f64,
    tolerance: f64,
) -> Result<f64, Miss> {
    const STEPS: u32 = 40;
    let mut at = 0.0;
    for _ in 0..12 {
        let Ok((f, normal)) = level(at) else { break };
        if f.abs() <= tolerance {
            return Ok(at);
        }
        let slope = slope(at, normal);
        let step = -f / slope;
        if !step.is_finite() || step.abs() > 0.5 * most || (at + step).abs() > most {
            break;
        }
        at += step;
    }
    let width = most / f64::from(STEPS);
    let start = level(0.0)?.0;
    // Per side: place and level of the last step; none once the surface has ended there.
    let mut sides = [Some((0.0, start)), Some((0.0, start))];
    let mut ended = false;
    for k in 1..=STEPS {
        for (side, sign) in sides.iter_mut().zip([1.0, -1.0]) {
            let Some((before, f)) = *side else { continue };
            let here = sign * width * f64::from(k);
            match level(here) {
                Ok((g, _)) if (f < 0.0) != (g < 0.0) => {
                    return halved(&level, [before, here], f, tolerance);
                }
                Ok((g, _)) => *side = Some((here, g)),
                Err(_) => (*side, ended) = (None, true),
            }
        }
    }
    Err(if ended { Miss::Edge } else { Miss::NoPoint })
}

fn halved(
    level: impl Fn(f64) -> Result<(f64, Vec3), Miss>,
    [mut a, mut b]: [f64; 2],
    first: f64,
    tolerance: f64,
) -> Result<f64, Miss> {
    for _ in 0..100 {
        let middle = 0.5 * (a + b);
        let (f, _) = level(middle)?;
        if f.abs() <= tolerance {
            return Ok(middle);
        }
        if (f < 0.0) == (first < 0.0) {
            a = middle;
        } else {
            b = middle;
        }
    }
    // The level jumps here (over a sharp edge): this is the place where it changes sign.
    Ok(0.5 * (a + b))
}
