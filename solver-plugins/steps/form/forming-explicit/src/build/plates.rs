//! Die and blank holder of a press: where they are, and whether the punch goes through.

use crate::error::{FormingError, Result};
use crate::stack::{RigidName, StackSheet};
use plyflow_fixed::FixedBits;
use plyflow_mechanics::contact::{OpenPlate, RigidSurface};
use plyflow_model::scene::{Hold, Press};
use plyflow_tooling::ToolMesh;

/// The flat parts of a press.
pub struct Plates {
    /// Height of the lower face of the stack at the start (m).
    pub blank: f64,
    /// Above the plies.
    pub die: OpenPlate,
    /// Below them.
    pub holder: Option<OpenPlate>,
}

/// Largest distance (m) from the axis of what of a surface is above a height: of its points there, and of its edges where they cross it.
fn radius_above(tool: &ToolMesh, z: f64) -> f64 {
    let mut radius = 0.0f64;
    for triangle in &tool.triangles {
        for k in 0..3 {
            let [a, b] = [k, (k + 1) % 3].map(|k| tool.points[triangle[k] as usize]);
            if a[2] > z {
                radius = radius.max(a[0].fixed_hypot(a[1]));
            }
            if (a[2] > z) != (b[2] > z) {
                let t = (z - a[2]) / (b[2] - a[2]);
                let at = [0, 1].map(|c| a[c] + t * (b[c] - a[c]));
                radius = radius.max(at[0].fixed_hypot(at[1]));
            }
        }
    }
    radius
}

impl Plates {
    /// For a stack over a punch whose top ends at `tool_top` (m).
    pub fn new(press: &Press, stack: &[StackSheet], tool_top: f64) -> Self {
        let thickness: f64 = stack.iter().map(|s| s.thickness).sum();
        let blank = tool_top - press.stroke.si();
        let die = OpenPlate {
            height: blank + thickness,
            side: 1.0,
            opening: press.die.opening_radius.si(),
            edge: press.die.edge_radius.si(),
        };
        let holder = press.holder.as_ref().map(|holder| OpenPlate {
            height: match &holder.hold {
                Hold::Force(_) => blank,
                Hold::Gap(gap) => die.height - gap.si(),
            },
            side: -1.0,
            opening: holder.opening_radius.map_or(die.opening, |r| r.si()),
            edge: holder.edge_radius.map_or(die.edge, |r| r.si()),
        });
        Self { blank, die, holder }
    }

    /// By name.
    pub fn named(&self) -> impl Iterator<Item = (RigidName, OpenPlate)> {
        let holder = self.holder.map(|plate| (RigidName::Holder, plate));
        std::iter::once((RigidName::Die, self.die)).chain(holder)
    }

    /// Room for the plies under the die at the start (m).
    pub fn thickness(&self) -> f64 {
        self.die.height - self.blank
    }

    /// Whether the punch ends inside its own height and goes through the openings, with the plies over it.
    pub fn check_passage(&self, press: &Press, tool: &ToolMesh) -> Result<()> {
        let [low, high] = tool.bounds().map(|b| b[2]);
        let mm = |x: f64| 1e3 * x;
        if press.stroke.si() > high - low + 1e-9 {
            return Err(FormingError::Scene(format!(
                "process.press.stroke: given {:.1} mm, the punch is {:.1} mm high; expected at most its height",
                mm(press.stroke.si()),
                mm(high - low)
            )));
        }
        let die = &self.die;
        let radius_above = |z: f64| radius_above(tool, z);
        // Below the rounding of its edge a plate leaves more room.
        let thickness = self.thickness();
        let in_die = radius_above(die.height + die.edge) + thickness;
        if in_die > die.opening {
            return Err(FormingError::Scene(format!(
                "process.press.die.opening_radius: given {:.2} mm; expected at least {:.2} mm: where the punch with its plies \
                 ({:.2} mm) goes through",
                mm(die.opening),
                mm(in_die),
                mm(thickness)
            )));
        }
        // In its rounding a plate is the wider, the nearer to its face.
        let room = |p: &&[f64; 3]| die.distance(**p).0 < thickness - 1e-9;
        let above = tool.points.iter().filter(|p| p[2] > die.height);
        if let Some([x, y, z]) = above.clone().find(room) {
            return Err(FormingError::Scene(format!(
                "process.press: at the end the punch reaches into the die: ({:.1}, {:.1}) mm from the axis it stands {:.2} mm above the die's face, where the opening \
                 ({:.2} mm, rounded by {:.2} mm) leaves no room for it and the plies ({:.2} mm). Expected a narrower punch, a wider opening, or a longer `stroke`",
                mm(*x),
                mm(*y),
                mm(z - die.height),
                mm(die.opening),
                mm(die.edge),
                mm(thickness)
            )));
        }
        if let Some(holder) = &self.holder {
            let in_holder = radius_above(holder.height);
            if in_holder > holder.opening {
                return Err(FormingError::Scene(format!(
                    "process.press.holder.opening_radius: {:.2} mm (that of the die unless given); expected at least \
                     {:.2} mm: the punch goes through it",
                    mm(holder.opening),
                    mm(in_holder)
                )));
            }
        }
        Ok(())
    }
}
