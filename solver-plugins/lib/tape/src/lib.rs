//! Tapes: what a kernel does to one lane, operation by operation.
//!
//! A kernel of an element or a material does the same to every lane, and it does it with a few operations that round once. A [`Tape`] is
//! the list of these operations in static single assignment: each has a number, uses operations before it, and is never changed. It holds
//! neither branches nor loops. So it can be checked ([`Tape::check`]), run on a CPU ([`Tape::run`]), put into another one
//! ([`Tape::with_calls`]) and written as the source of a function for a CPU or a GPU ([`Tape::source`]), and every one of these gives the
//! same bits as the kernel.
//!
//! Tapes of Plyflow's own components are recorded from their kernels (`plyflow_kernels::record`); others may be written by hand.
//!
//! Numbers are IEEE 754 doubles. Every operation rounds once to nearest; none is fused with another one.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod build;
mod calls;
mod check;
mod form;
mod run;
mod source;
mod text;

pub use build::Builder;
pub use check::Fault;
pub use form::{Buffer, COLUMNS, Call, Id, Operation, Row, Store, Table, Tape};
pub use run::Taken;
pub use source::PRELUDE;
