//! A mesh of a scene.

use crate::plain::{Ply, Vec3};

/// A mesh that may be shown.
pub(super) struct Body<'a> {
    pub(super) ply: Option<&'a Ply>,
    pub(super) zone: Option<&'a str>,
    /// Places by which it is thinned: flat ones, where it has some.
    pub(super) at: &'a [Vec3],
    pub(super) formed: &'a [Vec3],
    pub(super) cells: Vec<Vec<u32>>,
}

impl Body<'_> {
    pub(super) fn name(&self) -> String {
        let ply = self.ply.map_or("tool", |p| p.name.as_str());
        match self.zone {
            Some(zone) => format!("{ply} of zone {zone}"),
            None => ply.to_owned(),
        }
    }
}
