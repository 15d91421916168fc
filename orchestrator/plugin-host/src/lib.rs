//! Finds plugins, loads them and runs one step in this process. The only user of dlopen.
//!
//! - [`PluginCatalog`] knows the plugins on a search path. It never loads a library into its own process:
//!   manifests are read by a child, once per version of a library.
//! - [`worker_main`] is the body of `plyflow step-worker`: it reads a job, runs it ([`run_job`]) and
//!   talks in messages on standard output.
//! - [`describe_main`] is the body of `plyflow step-worker --describe LIBRARY`.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod breach;
mod catalog;
mod checkpoints;
mod describe;
mod emitter;
mod host;
mod lent;
mod load;
mod process;
mod services;
mod supervise;
mod trust;
mod worker;

pub use breach::{Breach, LoadError};
pub use catalog::{CARRIERS, Describer, PluginCatalog, Python};
pub use checkpoints::{cost_so_far, damaged_cost};
pub use describe::{Description, describe, describe_main};
pub use lent::Lender;
pub use load::Plugin;
pub use process::children_seconds;
pub use supervise::{Orphans, rename_argument, supervise};
pub use trust::{Ask, Consent, Place, Stranger, Trust, manifest_file};
pub use worker::{run_job, worker_main};
