//! Plyflow: runs forming studies. A workflow is planned ([`plan`]), decided on and driven ([`engine`]),
//! each step in a process of its own ([`worker`]), here or in allocations of a [`cluster`], with its artifacts in a [`store`].

pub mod advice;
pub mod cli;
pub mod cluster;
pub mod engine;
pub mod exit;
pub mod plan;
pub mod progress;
pub mod said;
pub mod store;
pub mod worker;
