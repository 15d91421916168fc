//! Step plugin `coupon-shell-benchmark`: see [`plyflow_coupons::shell_benchmark`].

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

use plyflow_sdk::{Host, Step, StepError};

/// The step.
pub struct ShellBenchmark;

impl Step for ShellBenchmark {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        plyflow_coupons::shell_benchmark::main(host)
    }
}

plyflow_sdk::export_step!(ShellBenchmark);
