//! What can be read off a run at one time.

pub mod draw_in;
pub mod penetration;
pub mod pressure;
pub mod strain;
