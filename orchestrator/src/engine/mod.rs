//! The engine: [`core`] decides; a [`Session`] knows, looks and acts; an [`Executor`] runs jobs somewhere.

mod compare;
pub mod core;
mod drive;
pub(crate) mod executor;
pub(crate) mod local;
mod look;
mod opening;
mod session;
mod shown;
mod sound;
mod task;
mod terms;
mod unchanged;
mod whole;

pub use compare::Compared;
pub use executor::{Executor, FailureClass, Outcome, Report, Task};
pub use local::Local;
pub(crate) use local::WANTED_MEMORY;
pub use session::{Of, Options, Purpose, Session};
pub use shown::{Failure, Observer, Summary, Update};
pub use sound::Depth;
pub use task::input_keys;
pub(crate) use task::library;
