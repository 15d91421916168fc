//! Step plugin `coupon-bias-plane`: see [`plyflow_coupons::bias_plane`].

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

use plyflow_sdk::{Host, Step, StepError};

/// The step.
pub struct BiasPlane;

impl Step for BiasPlane {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        plyflow_coupons::bias_plane::main(host)
    }
}

plyflow_sdk::export_step!(BiasPlane);
