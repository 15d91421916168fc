//! Runs jobs in allocations of Slurm. The head writes orders into a folder of the run, allocations ([`pilot`]) take them, run them as at
//! home ([`crate::engine::Local`]) and write a verdict on each. Head and allocations share that folder ([`Exchange`]) and nothing else: no
//! connection, no lock. What Slurm is asked for is only where allocations stand ([`Slurm`]).
//!
//! ```text
//! runs/<workflow>/cluster/
//!   id                                  part of the name of every allocation of this run
//!   head                                who drives the run, with a count that goes up
//!   stop                                `plyflow cancel` was called
//!   queues/<shape>/<attempt>.json       an order that waits for an allocation of this shape
//!   queues/<shape>/<attempt>.<pilot>.taken      one that an allocation has taken: a rename, which one of them wins
//!   queues/<shape>/<attempt>.withdrawn  one that the head has taken back, by the same rename
//!   results/<attempt>.json              the verdict, sealed
//!   cancel/<attempt>                    the head wants it to stop
//!   made/<attempt>.*                    what the attempt makes, until the store has it
//!   submissions/<name>/                 an allocation, or an array of them: intent, script, job number, signs of life, log
//! ```

mod executor;
mod folder;
mod intent;
mod judge;
mod needs;
pub mod pilot;
mod provide;
mod reach;
mod script;
mod slurm;
mod submission;
mod work;

pub use executor::{Cluster, Means, OpenError};
pub use folder::{Exchange, Standing};
pub use needs::{GUESS, Refusal, Shape, allocations, refusal};
pub use reach::{Taken, driven_by};
pub use slurm::{Limits, NoLimits, Row, Slurm};
pub use submission::Submission;
