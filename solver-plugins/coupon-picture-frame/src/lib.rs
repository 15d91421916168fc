//! Step plugin `coupon-picture-frame`: see [`plyflow_coupons::picture_frame`].

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

use plyflow_sdk::{Host, Step, StepError};

/// The step.
pub struct PictureFrame;

impl Step for PictureFrame {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        plyflow_coupons::picture_frame::main(host)
    }
}

plyflow_sdk::export_step!(PictureFrame);
