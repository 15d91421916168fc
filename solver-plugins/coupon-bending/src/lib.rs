//! Step plugin `coupon-bending`: see [`plyflow_coupons::pure_bending`].

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

use plyflow_sdk::{Host, Step, StepError};

/// The step.
pub struct PureBending;

impl Step for PureBending {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        plyflow_coupons::pure_bending::main(host)
    }
}

plyflow_sdk::export_step!(PureBending);
