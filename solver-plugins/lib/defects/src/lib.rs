//! Wrinkles and bridging of formed plies: measured, with their likely causes. The same for a
//! simulated ply and for a scanned preform ([`scan`]), which may have to be aligned to the tool first ([`align`]). All lengths in m.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod align;
mod area;
mod cause;
mod crests;
mod fields;
mod measure;
#[cfg(feature = "steps")]
pub mod of_run;
pub mod pairs;
mod ply;
mod points;
pub mod scan;
pub mod sizes;

pub use cause::{Limits, Neighbour, find_causes, relative_angle};
pub use fields::{FieldErrors, QUANTILES, distance_at};
pub use measure::{Defect, RidgeShear, Settings, measure, quantiles};
pub use ply::{Ply, Shape, Tool};
pub use plyflow_model::artifact::{Cause, DefectKind as Kind};
