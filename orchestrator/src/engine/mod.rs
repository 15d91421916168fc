//! The engine: [`core`] decides, [`drive`](mod@drive) acts, an [`Executor`] runs jobs somewhere.

pub mod core;
pub(crate) mod drive;
pub(crate) mod executor;
pub(crate) mod local;
mod shown;
mod unchanged;

pub use drive::{Compared, Depth, Options, Session, input_keys};
pub use executor::{Executor, FailureClass, Outcome, Report, Task};
pub use local::Local;
pub use shown::{Failure, Observer, Summary, Update};
