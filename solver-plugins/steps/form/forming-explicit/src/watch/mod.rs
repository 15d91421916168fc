//! An independent watch over what must stay outside of what: it shares no code with the contacts nor with the tool's distance field.
//!
//! At every row of the ledger each node of each sheet is held against the triangles of the tool and of other rigid parts, the bed or the plates of a press, and against
//! the cells of the sheets below and above it in the stack: how much nearer their middle surfaces are than half of their thicknesses, and what
//! really lies between them, allow. See decision 34.

pub mod against;
pub mod bodies;
pub mod cell;
pub mod deep;
pub mod edges;
pub mod look;
pub mod pairs;
pub mod rigid;
pub mod sheet;
pub mod told;
pub mod watcher;

pub use deep::Watched;
pub use look::Watch;
pub use pairs::{DEPTH_BOUND, Kind};
pub use told::{PairDepth, depth_attributes, depth_warnings};
