//! Test data made from known laws: the elastica under its own weight, solved as an ODE, and a generator of
//! noise. Shares no numerics with the fits that are tested with it.

mod elastica;
mod laws;
mod noise;

pub use elastica::{Elastica, elastica, overhang_at};
pub use laws::*;
pub use noise::Noise;
