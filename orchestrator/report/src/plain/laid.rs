//! Plies as they were laid: their fibres and their thickness, and what follows from these.

use crate::plain::ply::Ply;
use crate::plain::shape::Shape;
use plyflow_export::{Fibre, Net, laid_fibres};
use plyflow_model::artifact::Sheet;

impl Ply {
    /// Takes over what its run tells of the flat ply, and computes what follows from the shape.
    pub(crate) fn laid_as(&mut self, sheets: &[Sheet]) {
        let Some(sheet) = sheets.iter().find(|s| s.name == self.name) else {
            return;
        };
        self.fibres = sheet.laid();
        self.thickness = Some(sheet.thickness).filter(|t| *t > 0.0);
        let draped = self.draped.as_deref();
        let told = (self.fibres.as_ref(), self.thickness);
        self.shape = Shape::of((&self.flat, &self.formed), &self.cells, draped, told);
        // What an artifact tells comes before what is computed here, as in exports.
        if self.others.iter().any(|o| o.title == "Thickness") {
            (self.thickness, self.shape.thickness) = (None, None);
        }
    }

    /// Lines of a fibre family, `distance` (m) apart in the flat ply, through the cells that have a shape; none where the ply tells no fibres.
    pub(crate) fn fibre_lines(&self, family: usize, distance: f64) -> Vec<Fibre> {
        let Some(laid) = &self.fibres else {
            return Vec::new();
        };
        let there = |k: &usize| self.draped.as_ref().is_none_or(|d| d[*k]);
        let through: Vec<usize> = (0..self.cells.len()).filter(there).collect();
        let net = Net {
            flat: &self.flat,
            formed: &self.formed,
            cells: self.cells.as_flattened(),
            corners: 4,
            through: &through,
        };
        laid_fibres(&net, (laid, 1.0), family, distance).unwrap_or_default()
    }
}
