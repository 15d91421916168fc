//! What Plyflow's own component plugins are made of: the element formulations [`m4`], [`m4f`], [`rf4`] and
//! [`s4`], the materials [`fabric`], [`fabric_linear`], [`isotropic`] and [`marlow`], and the lane arithmetic under them ([`Lanes`],
//! [`exp`], [`asin`]).
//!
//! The plugin crates `element-*` and `material-*` only export these types: a library may be linked
//! together with others, the exported symbol of a plugin may not. A stranger's plugin needs none
//! of this; the contract is `plyflow.h` alone.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod built_in;
mod coupling;
mod dispatch;
pub mod fabric;
pub mod fabric_linear;
mod functions;
pub mod isotropic;
mod lanes;
pub mod m4;
pub mod m4f;
pub mod marlow;
pub mod quad;
pub mod record;
pub mod rf4;
pub mod rows;
pub mod s4;
mod strain;
mod thickening;

pub(crate) use dispatch::dispatch;
pub use functions::{asin, exp, polynomial};
pub use lanes::*;
