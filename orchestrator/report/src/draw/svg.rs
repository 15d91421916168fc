//! Numbers in SVG.

use crate::units::number;

/// A place on the page, to a tenth of a pixel.
pub(crate) fn px(v: f64) -> String {
    number((v * 10.0).round() / 10.0, 6)
}

/// A place on the page as a path has it.
pub(crate) fn spot(at: [f64; 2]) -> String {
    format!("{} {}", px(at[0]), px(at[1]))
}
