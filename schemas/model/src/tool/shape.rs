//! The shape of swept tools: a profile (fillet, then a wall down to the bed) around a rounded rectangle, deformed by joggles. Lengths in
//! metres, angles in radians; points are x, y, z.

use crate::tool::ramp::Ramp;
use plyflow_fixed::FixedBits;
use std::f64::consts::FRAC_PI_2;

/// The shape. Theoretical corners are where the top plane meets the planes of the walls.
#[derive(Debug, Clone)]
pub struct SparShape {
    /// x of the theoretical corners at both ends.
    pub ends: [f64; 2],
    /// y of the theoretical corners is +- this.
    pub half_width: f64,
    /// Height of the undeformed top over the bed.
    pub height: f64,
    /// Angle of the walls from the vertical.
    pub draft: f64,
    /// Radius between top and walls.
    pub fillet: f64,
    /// Radius in plan of the vertical edges at the theoretical corners; at least [`SparShape::setback`].
    pub corner: f64,
    /// In order of `start`.
    pub joggles: Vec<JoggleShape>,
}

/// One joggle. Top and walls follow the same profile, each with its part: where a rise and a step of a wall
/// meet on the edge between, their curvatures add as vectors, so the profile's amplitude is that of the sum
/// and its fillets are the sharpest of the joggle.
#[derive(Debug, Clone)]
pub struct JoggleShape {
    /// x where the ramp begins on y = 0 (m).
    pub start: f64,
    /// Along x (m).
    pub length: f64,
    /// Slant in plan (rad).
    pub skew: f64,
    /// From 0 to the amplitude, square to the slanted ramp.
    pub profile: Ramp,
    /// Change of height (m).
    pub rise: f64,
    /// Outward steps of the walls at y < 0 and y > 0 (m).
    pub sides: [f64; 2],
    /// Radius where the ramp begins and ends (m).
    pub fillet: f64,
}

impl JoggleShape {
    /// Length of the vector of rise and larger side step.
    pub fn amplitude(rise: f64, sides: [f64; 2]) -> f64 {
        rise.fixed_hypot(sides[0].abs().max(sides[1].abs()))
    }

    /// Part of the joggle that has happened at (x, y): 0 to 1.
    fn progress(&self, x: f64, y: f64) -> f64 {
        let amplitude = Self::amplitude(self.rise, self.sides);
        if amplitude == 0.0 {
            return 0.0;
        }
        let s = (x - self.start - y * self.skew.fixed_tan()) * self.skew.fixed_cos();
        self.profile.height(s) / amplitude
    }

    /// How far its walls step outwards at most (m).
    pub fn widening(&self) -> f64 {
        self.sides[0].max(self.sides[1]).max(0.0)
    }

    /// Factor by which the fillet's circle must be larger than the radius that must remain.
    pub fn sharpening(&self) -> f64 {
        1.0 + self.profile.slope().powi(2)
    }
}

impl SparShape {
    /// Angle of the fillet's arc.
    pub fn arc_angle(&self) -> f64 {
        FRAC_PI_2 - self.draft
    }

    /// Distance from the theoretical corner to where the fillet begins on the top.
    pub fn setback(&self) -> f64 {
        self.fillet * (0.5 * self.arc_angle()).fixed_tan()
    }

    /// Limits of the level top: x low, x high, half width, and its radius in plan.
    pub fn top(&self) -> ([f64; 2], f64, f64) {
        let t = self.setback();
        let radius = (self.corner - t).max(0.0);
        (
            [self.ends[0] + t, self.ends[1] - t],
            self.half_width - t,
            radius,
        )
    }

    /// Height that the joggles add at (x, y).
    pub fn lift(&self, x: f64, y: f64) -> f64 {
        self.joggles.iter().map(|j| j.rise * j.progress(x, y)).sum()
    }

    /// Outward step of a wall at x; side 0 is y < 0.
    fn side_step(&self, x: f64, side: usize) -> f64 {
        let y = if side == 0 {
            -self.half_width
        } else {
            self.half_width
        };
        self.joggles
            .iter()
            .map(|j| j.sides[side] * j.progress(x, y))
            .sum()
    }

    /// Moves a point of the undeformed shape. The walls and fillets step sideways as they are; the top
    /// stretches between them, from its middle third on.
    pub fn deform(&self, p: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = p;
        let side = usize::from(y > 0.0);
        let reach = self.half_width - self.corner.max(self.setback());
        let w = (y.abs() / reach).clamp(0.0, 1.0);
        let y = y + y.signum() * w * w * (3.0 - 2.0 * w) * self.side_step(x, side);
        [x, y, z + self.lift(x, y)]
    }

    /// Offset from the top's outline and height of the undeformed profile at angle `a` of the fillet.
    pub fn fillet_point(&self, a: f64) -> (f64, f64) {
        (
            self.fillet * a.fixed_sin(),
            self.height - self.fillet * (1.0 - a.fixed_cos()),
        )
    }

    /// The same at length `s` down the wall.
    pub fn wall_point(&self, s: f64) -> (f64, f64) {
        let (d, z) = self.fillet_point(self.arc_angle());
        (
            d + s * self.draft.fixed_sin(),
            z - s * self.draft.fixed_cos(),
        )
    }

    /// The deformed point at an offset and height of the profile, over a point of the top's outline.
    pub fn surface(&self, base: [f64; 2], normal: [f64; 2], profile: (f64, f64)) -> [f64; 3] {
        let (d, z) = profile;
        self.deform([base[0] + d * normal[0], base[1] + d * normal[1], z])
    }

    /// Length of the wall down to the bed at a point of the outline.
    pub fn wall_length(&self, base: [f64; 2], normal: [f64; 2]) -> f64 {
        let z = |s: f64| self.surface(base, normal, self.wall_point(s))[2];
        let (mut low, mut high) = (0.0, 2.0 * self.height + 1.0);
        // Bisection to the last bit: the walls fall steadily, and speed does not matter here.
        for _ in 0..80 {
            let middle = 0.5 * (low + high);
            if z(middle) > 0.0 {
                low = middle
            } else {
                high = middle
            }
        }
        0.5 * (low + high)
    }

    /// Height of the top where it is lowest (m).
    pub fn lowest_top(&self) -> f64 {
        let mut height = self.height;
        let mut lowest = height;
        for j in &self.joggles {
            height += j.rise;
            lowest = lowest.min(height);
        }
        lowest
    }
}
