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

pub use body::Body;
pub use contact::{LEAST_FILM_DISTANCE, StackContacts};
pub use cover::{RigidPart, SHARE_SQUEEZED};
pub use elements::{Components, Elements};
pub use locate::inverse_bilinear;
pub use parts::{Meshed, Parts, plain};
pub use place::{Placed, SheetIndex, StackPlace, layers};
pub use rigid::{PlateMesh, RigidBody, RigidName, RigidShape};
pub use sheet::StackSheet;
pub use tool::{PartSurface, ToolSurface, ToolSurfaces};
