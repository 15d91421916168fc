//! Step plugin `coupon-inflation`: see [`plyflow_coupons::inflation`].

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

use plyflow_sdk::{Host, Step, StepError};

/// The step.
pub struct Inflation;

impl Step for Inflation {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        plyflow_coupons::inflation::main(host)
    }
}

plyflow_sdk::export_step!(Inflation);
