//! What the steps tell each other: the attributes of every kind of artifact, as one step writes and another reads them.
//!
//! A kind has one type here, and each rule about it stands beside that type. So a changed field is a compile error in all that write it and read it.
//! All numbers are SI. `schemas/json/artifacts` holds the JSON Schemas of these types, and `schemas/data-model.md` describes them together with the
//! bodies, fields and arrays of an artifact.
//!
//! A plugin of somebody else may tell more than a type has: readers pass over what they do not know, and what is handed on from one artifact to
//! the next ([`Sheet`], [`Zone`]) keeps it. What a type has as an `Option` or a list may be left out.

mod boundary;
mod defects;
mod forming;
mod shown;
mod zones;

pub use boundary::{Boundary, Feedback};
pub use defects::{Defects, PlyDefects, Thresholds};
pub use forming::{
    Depth, DepthPeak, Energy, FieldError, Forming, MeshQuality, Penetration, PenetrationPeak,
    RegionFacts, RigidBody, Sheet, SheetBody,
};
pub use shown::{Axis, Cell, Column, Map, Panel, Paths, Plot, Series, Style, Table, TextFile};
pub use zones::{Rectangle, Zone, Zones, area, current_zones, which_count};

/// A kind of artifact by its attributes.
pub trait Attributes:
    serde::Serialize + serde::de::DeserializeOwned + schemars::JsonSchema
{
    /// The name of the kind, as the manifests of plugins have it.
    const KIND: &'static str;
}
