//! Contact by penalty: sheet on sheet, sheet on rigid surface.
//!
//! Normal force: k times the penetration, on the continuous normal of the surface (interpolated from the
//! nodes of a sheet; the gradient of the distance field of a rigid surface), plus damping of the normal
//! approach. Tangential force: Coulomb with an elastic-slip spring and a history per contact. The
//! stiffness is bounded by the masses that it couples, so that contact alone never sets the step.

mod rigid;
mod sheets;

pub use rigid::{Plane, RigidContact, RigidItem, RigidSurface};
pub use sheets::{SheetContact, SlaveItem, Surface, shape};

/// Constants that all contacts share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactSettings {
    /// Normal stiffness over (reduced mass / step^2).
    pub stiffness_factor: f64,
    /// Elastic-slip stiffness over the normal stiffness.
    pub slip_factor: f64,
    /// Damping of the normal approach over critical.
    pub damping_ratio: f64,
}

impl Default for ContactSettings {
    fn default() -> Self {
        Self { stiffness_factor: 0.3, slip_factor: 0.5, damping_ratio: 0.1 }
    }
}

/// What contacts did in a step (J): stored, lost to friction, lost to damping.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ContactEnergy {
    /// Stored in normal and slip springs.
    pub stored: f64,
    /// Lost to friction in the step.
    pub friction: f64,
    /// Lost to damping in the step.
    pub damping: f64,
}

/// Coulomb return: limits the trial traction to `limit`; gives the traction and the friction loss.
/// `slip_stiffness` in N/m.
#[inline]
pub(crate) fn coulomb(trial: [f64; 3], limit: f64, slip_stiffness: f64) -> ([f64; 3], f64) {
    let size = crate::vec3::norm(trial);
    if size <= limit || size == 0.0 {
        (trial, 0.0)
    } else {
        let loss = limit * (size - limit) / slip_stiffness;
        (crate::vec3::scale(trial, limit / size), loss)
    }
}
