//! Step plugin `coupon-bias-extension`: see [`plyflow_coupons::bias_extension`].

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

use plyflow_sdk::{Host, Step, StepError};

/// The step.
pub struct BiasExtension;

impl Step for BiasExtension {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        plyflow_coupons::bias_extension::main(host)
    }
}

plyflow_sdk::export_step!(BiasExtension);
