//! Contact by penalty: sheet on sheet, sheet on itself, sheet on rigid surface.
//!
//! Normal force: k times the penetration, along the gradient of the distance (to the closest point of a sheet's
//! bilinear cells, blended across concave folds; to a rigid surface's distance field), so that it is the
//! gradient of an energy; plus damping of the normal approach. Tangential force: Coulomb with an elastic-slip
//! spring, a damper and a history per contact. The
//! stiffness is bounded by the masses that it couples, so that contact alone never sets the step. Such a
//! penalty is too soft to carry 1 bar within a tenth of a film's thickness; so a multiplier per contact takes
//! over the steady part of the force (augmented Lagrangian, a little in every step): the penetration of a
//! contact at rest dies out over 1 / augmentation steps, at no cost in step size.

mod blend;
mod closest;
mod folds;
mod friction;
mod ledge;
mod penalty;
mod proximity;
mod regions;
mod rigid;
mod search;
mod sheets;
mod slave;
mod ties;

pub use closest::{Surface, shape};
pub(crate) use folds::Bearing;
pub use folds::{FoldItem, FoldSpec, SelfContact};
pub use friction::{
    AngleDependence, FibreField, LARGEST_COEFFICIENT, PressureDependence, SheetCells,
    VaryingFriction, Whose,
};
pub use ledge::{ledge, rim_height};
pub use penalty::{ContactEnergy, ContactSettings, Pace};
pub use regions::{FrictionLaw, NodeLaws, Partner, RegionalFriction};
pub use rigid::{OpenPlate, Plane, RigidContact, RigidItem, RigidMotion, RigidSurface};
pub use sheets::SheetContact;
pub use slave::SlaveItem;
pub(crate) use slave::WHOLE;
pub use ties::{SLACK, Tie, Ties};
