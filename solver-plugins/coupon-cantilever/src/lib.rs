//! Step plugin `coupon-cantilever`: see [`plyflow_coupons::cantilever`].

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

use plyflow_sdk::{Host, Step, StepError};

/// The step.
pub struct Cantilever;

impl Step for Cantilever {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        plyflow_coupons::cantilever::main(host)
    }
}

plyflow_sdk::export_step!(Cantilever);
