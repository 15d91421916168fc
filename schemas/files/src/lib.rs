//! Files that users name: tools, scans and tests as the field's programs write them.
//!
//! One reader for each kind of file, and one place for its dialects: [`stl`] for facets, [`dxf`] for drawings, [`book`] for
//! ply books, [`steered`] for tables of fibre directions, [`corners`] for tables of corners ([`drawn`] for
//! either of the two), [`rows`] for everything in columns. Under
//! them [`open`] (what is opened at all, and how much of it is read), [`text`] (encodings, and what a message may show of a file) and
//! [`number`] (decimal signs). What is no dialect that is known here is refused, with its line; nothing is passed over in silence.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod book;
pub mod corners;
pub mod drawn;
pub mod dxf;
pub mod flaw;
pub mod number;
pub mod open;
pub mod rows;
pub mod steered;
pub mod stl;
pub mod table;
pub mod text;
pub mod turn;
