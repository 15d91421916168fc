//! The plugin `coupon-off-axis`: exports [`plyflow_coupons::off_axis::Plugin`].

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

plyflow_sdk::export_step!(plyflow_coupons::off_axis::Plugin);
