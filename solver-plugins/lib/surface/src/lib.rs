//! Geometry of meshed surfaces that several steps share: exact closest point and signed distance,
//! curvature, distributions, ridge lines, location in an undeformed quad mesh, smooth surfaces through nodes. All lengths in m. Everything is
//! deterministic: ties go to the lowest index.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod closest;
mod conformity;
mod crests;
mod curvature;
mod distribution;
mod outline;
mod ridge;
mod section;
mod smooth;
mod topology;
mod traction;

pub use closest::{Closest, Surface};
pub use conformity::{Ground, NodalDistance, foot_height, judged_share, nodal_distances};
pub use crests::{Crests, tool_crests};
pub use curvature::{Curvature, curvatures};
pub use distribution::{bin_width, density, weighted_mean, weighted_quantiles};
pub use outline::Outline;
pub use ridge::{Bound, Ridge, SHARP, ridge_line, sharpness};
pub use section::{SectionPoint, line_length, path_section, plane_section, stations};
pub use smooth::{SmoothSheet, StandOff};
pub use topology::{Topology, triangles};
pub use traction::traction;

#[cfg(feature = "steps")]
pub mod draped;
#[cfg(feature = "steps")]
pub mod of_run;
