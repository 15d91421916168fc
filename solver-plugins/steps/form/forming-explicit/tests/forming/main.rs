//! Whole small runs. One program, because each would have all of the solver in it.

#[path = "../common/mod.rs"]
mod common;

mod absurd;
mod crossing;
mod friction;
mod hard_cases;
mod load_path;
mod one_model;
mod outlines;
mod press;
mod process;
mod quiet_bag;
mod refused;
mod regions;
mod single_film;
mod sliding;
mod small_part;
mod stamping;
mod steered;
mod symmetry;
mod taken_up;
mod ties;
mod tools;
mod unstable;
mod watch;
mod zones;
