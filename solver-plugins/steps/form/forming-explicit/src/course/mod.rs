//! A run over time.

pub mod history;
pub mod observer;
pub mod outcome;
pub mod progress;

pub use history::HistoryRow;
pub use observer::Observer;
pub use outcome::Outcome;
pub use progress::Course;
