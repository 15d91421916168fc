//! The plugin `fabric-linear`: exports [`plyflow_kernels::fabric_linear::FabricLinear`], where the mechanics stand. They live in a
//! library of their own so that tests and benches can link several components at once.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

plyflow_sdk::export_material!(plyflow_kernels::fabric_linear::FabricLinear);
