//! Judges element and material components against the contract of `plyflow.h`: buffers, finite numbers, lanes
//! that depend on themselves alone, forces that are derivatives of energies, independence of the observer,
//! critical steps that are bounds. Call it in a process that may die: the component is foreign code. The step
//! plugin `plugin-conformance` does, and `plyflow check-plugin` runs that.
//!
//! Every check has a [`Rule`] and ends in a [`Check`] with a measured number where there is one. A [`Sink`] hears
//! of a check before it begins, so that a crash can be told apart from its neighbours.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod bending;
mod breaches;
mod buffer;
mod check;
mod cycle;
mod element;
mod element_motion;
mod law;
mod linear;
mod material;
mod material_law;
mod meeting;
mod neighbours;
mod patch;
mod rules;
mod run;
mod sequence;
mod shapes;
mod slope;
mod subject;
mod tapes;

pub use check::{Check, Outcome, Rule, Silent, Sink, failed};
pub use element::check_element;
pub use material::check_material;
