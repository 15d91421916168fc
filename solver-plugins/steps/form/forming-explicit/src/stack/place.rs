//! Where a sheet is: in the stack, and in the model.

use plyflow_mechanics::model::Model;
use std::ops::Range;

/// Place of a sheet in the stack, counted from the tool upwards.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct StackPlace(pub usize);

/// Number of a sheet in a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SheetIndex(pub usize);

impl SheetIndex {
    /// The sheet of that name.
    pub fn named(model: &Model, name: &str) -> Option<Self> {
        let found = model.sheets().iter().position(|s| s.name == name);
        found.map(Self)
    }

    /// Numbers of its cells in the model.
    pub fn cell_range(self, model: &Model) -> Range<usize> {
        let (from, to) = model.sheets()[self.0].cell_range;
        from..to
    }

    /// `[m]` its cells, in nodes of the model.
    pub fn cells(self, model: &Model) -> &[[u32; 4]] {
        &model.cells()[self.cell_range(model)]
    }

    /// `[n]` its nodes.
    pub fn nodes(self, model: &Model) -> &[u32] {
        &model.sheets()[self.0].nodes
    }
}

/// A sheet of a stack as the contacts see it.
#[derive(Debug, Clone, Copy)]
pub struct Layer<'a> {
    /// Where it lies.
    pub place: StackPlace,
    /// Its number in the model.
    pub sheet: SheetIndex,
    /// Nodes of the model that may be slaves: not driven, not shared with the master.
    pub slaves: &'a [u32],
}

/// The same, with nodes of its own: the stack of these is in the order of the places.
#[derive(Debug, Clone)]
pub struct Placed {
    /// As [`Layer::sheet`].
    pub sheet: SheetIndex,
    /// As [`Layer::slaves`].
    pub slaves: Vec<u32>,
}

/// The layers of a stack.
pub fn layers(placed: &[Placed]) -> Vec<Layer<'_>> {
    (placed.iter().enumerate())
        .map(|(k, p)| Layer {
            place: StackPlace(k),
            sheet: p.sheet,
            slaves: &p.slaves,
        })
        .collect()
}
