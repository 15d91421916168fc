//! The plugin `material-marlow`: exports [`plyflow_kernels::marlow::Marlow`], where the mechanics stand. They live in a
//! library of their own so that tests and benches can link several components at once.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

plyflow_sdk::export_material!(plyflow_kernels::marlow::Marlow);
