//! The plugin `coupon-buckling`: exports [`plyflow_coupons::buckling::Plugin`].

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

plyflow_sdk::export_step!(plyflow_coupons::buckling::Plugin);
