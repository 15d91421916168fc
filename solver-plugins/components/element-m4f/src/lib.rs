//! The plugin `m4f`: exports [`plyflow_kernels::m4f::M4f`], where the mechanics stand. They live in a
//! library of their own so that tests and benches can link several components at once.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

plyflow_sdk::export_element!(plyflow_kernels::m4f::M4f);
