//! Studies, without files and without processes: points from ranges, tables and samples; expressions with units; the names of points; and
//! what is said of a family of results.
//!
//! Numbers are kept as they are written, exactly, in their units: `0.1 + 0.2` is `0.3`, `45 deg` of a range is the text `45 deg`, and what
//! a study puts into a step is what a user would have written there. Nothing here depends on the machine, the time, or the order of a
//! hash table.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod expression;
mod judge;
mod number;
pub mod optimise;
mod points;
mod problem;
mod range;
mod sample;
mod template;
mod value;

pub use expression::{Expression, ExpressionError, Names};
pub use judge::{Claim, Found, Mark, judge, marks};
pub use number::{Exact, Quantity};
pub use points::{MOST_POINTS, Point, Points, Table, Variable};
pub use problem::Problem;
pub use range::{Range, Step, range};
pub use sample::{Axis, Method, Sample, sample};
pub use template::Template;
pub use value::{Kind, Value, Written};
