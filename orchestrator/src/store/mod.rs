//! Where a workflow's artifacts and journals lie.
//!
//! ```text
//! .plyflow/
//!   lock                           shared by runs, exclusive for `clean`
//!   artifacts/ab/ab12...ef.vtkhdf  an artifact under its content key: whole or absent
//!   artifacts/ab/ab12...ef.record.json   what it cost and found, and the hash of the artifact; there before the artifact is
//!   damaged/                       what was not as it was written, kept for those who want to look
//!   plugins.json                   what is known of plugin libraries; only saves time
//!   resolved/<file>                the workflow of a file as last resolved; only saves time
//!   runs/<workflow>/lock           held while a run is on; the kernel frees it whatever happens
//!   runs/<workflow>/journal        one append-only file
//!   runs/<workflow>/logs/          logs of workers that had something to say
//!   runs/<workflow>/tmp/           artifacts being written
//!   runs/<workflow>/checkpoints/<instance>/<key>/   what lets a killed step go on
//!   runs/<workflow>/checkpoints/<instance>/<key>.forced   these are of a run that was to begin anew
//!   runs/<workflow>/cluster/       what a run on a cluster shares with its allocations (see [`crate::cluster`])
//!   runs/<workflow>/unplaced/      finished artifacts that could not be put into `artifacts`, and their records
//! ```

mod aside;
mod check;
mod early;
mod folder;
mod journal;
mod lock;
mod names;
mod place;
pub mod resolved;
mod run;

pub use aside::damage_of_plugins;
pub use check::{Expected, Flaw, Seen, check_artifact, read_unplaced, record_beside};
pub use early::{Ahead, Early};
pub use folder::Store;
pub use journal::{Detail, Journal, Known, Scanned};
pub use lock::{Lock, LockError};
pub use names::ENDING;
pub use run::RunFolder;
