//! The sheets of a scene: their elements, meshes and contacts.

pub mod body;
pub mod contact;
pub mod cover;
pub mod elements;
pub mod friction;
pub mod locate;
pub mod parts;
pub mod place;
pub mod regions;
pub mod rigid;
pub mod rim;
pub mod sheet;
pub mod symmetry;
pub mod tool;
