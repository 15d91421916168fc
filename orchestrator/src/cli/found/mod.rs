//! What is found: of a workflow in its store, of its expectations, of the points of its study. Nothing here speaks, but of what is damaged or
//! missing; commands show it.

pub mod answer;
pub mod asked;
pub mod change;
pub mod damage;
mod family;
pub mod points;
pub mod row;
pub mod rows;
pub mod trace;
