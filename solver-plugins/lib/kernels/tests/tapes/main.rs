//! Kernels, written down, give the same bits: run as tapes, and compiled from the source that a GPU gets.

#[path = "../common/mod.rs"]
mod common;
mod elements;
#[path = "../fabric_support/mod.rs"]
mod fabric_support;
mod materials;
mod rules;
mod support;
