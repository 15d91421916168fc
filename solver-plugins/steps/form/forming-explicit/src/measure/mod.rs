//! What can be read off a run at one time.

pub mod draw_in;
pub mod penetration;
pub mod pressure;
pub mod strain;
pub mod ties;

pub use penetration::{
    MANY, OVERLAP_BOUND, OVERLAP_PEAK_BOUND, Penetration, PenetrationPeak, keep_largest,
    too_deep_on_the_way,
};
pub use strain::{cell_strain, ply_strains};
pub use ties::{tie_stretch, untied};
