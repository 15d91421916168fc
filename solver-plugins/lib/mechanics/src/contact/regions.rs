//! Which law of friction holds: one everywhere, or others in regions of the sheets that touch.

use super::friction::{Constant, Coulomb, Sliding, VaryingFriction};
use std::sync::Arc;

/// Coulomb coefficient of a pair of surfaces. Each kind of contact tells the laws apart by itself, once in a step and outside of its loop over nodes,
/// whose arguments are its own.
#[derive(Debug, Clone)]
pub enum FrictionLaw {
    /// The same everywhere.
    Constant(f64),
    /// By pressure and direction.
    Varying(Arc<VaryingFriction>),
    /// By the places of the sheets that touch.
    Regional(Arc<RegionalFriction>),
}

impl From<f64> for FrictionLaw {
    fn from(coefficient: f64) -> Self {
        Self::Constant(coefficient)
    }
}

/// By node of a sheet: which of some laws holds there, 0 outside of all regions.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct NodeLaws {
    /// Model node of the first.
    base: u32,
    laws: Vec<u16>,
}

impl NodeLaws {
    /// Of the model nodes `nodes` (any order), for each of which `law` tells its law.
    pub fn new(nodes: &[u32], law: impl Fn(u32) -> u16) -> Self {
        let base = nodes.iter().min().copied().unwrap_or(0);
        let end = nodes.iter().max().map_or(base, |n| n + 1);
        let mut laws = vec![0; (end - base) as usize];
        for n in nodes {
            laws[(n - base) as usize] = law(*n);
        }
        Self { base, laws }
    }

    /// The law at a node: 0 at one of another sheet.
    #[inline]
    pub fn at(&self, node: u32) -> u16 {
        let place = node.checked_sub(self.base).map(|k| k as usize);
        place.and_then(|k| self.laws.get(k)).copied().unwrap_or(0)
    }

    /// How many nodes lie in regions.
    pub fn inside(&self) -> usize {
        self.laws.iter().filter(|l| **l > 0).count()
    }
}

/// Where the regions of the surface on which a sheet's nodes lie are.
#[derive(Debug, Clone)]
pub enum Partner {
    /// It has none.
    Bare,
    /// Those of a sheet by its own nodes: a cell counts by the shares of its four nodes.
    Sheet {
        /// By its nodes.
        laws: NodeLaws,
        /// `[cells]` its cells (model nodes).
        cells: Vec<[u32; 4]>,
        /// Model number of the first.
        first_cell: u32,
    },
    /// Those of a sheet that lies between, by the nodes that touch: for contacts without cells.
    Between(NodeLaws),
}

/// Laws by place. Where both surfaces have a region the lesser limit holds: what makes one of them slippery makes the contact so.
///
/// A node of the sheet whose nodes touch lies in a region or not. On the sheet that it touches the four nodes of the cell count in equal shares, so that the
/// coefficient goes over from the one to the other within a cell. Both depend on material places alone: there is no state.
#[derive(Debug, Clone)]
pub struct RegionalFriction {
    /// The law outside of all regions, then those of the regions, by number. None of them is regional.
    pub laws: Vec<FrictionLaw>,
    /// By node that touches.
    pub slave: NodeLaws,
    /// Of what it touches.
    pub partner: Partner,
}

impl RegionalFriction {
    /// Numbers of the laws of which the least limit holds for a node that touches anything but a cell: of itself, and of what lies between.
    pub fn at_node(&self, node: u32) -> [u16; 2] {
        let between = match &self.partner {
            Partner::Between(laws) => laws.at(node),
            _ => 0,
        };
        [self.slave.at(node), between]
    }

    fn of(&self, law: u16, s: &Sliding<'_>) -> f64 {
        match &self.laws[usize::from(law)] {
            FrictionLaw::Constant(c) => Constant(*c).limit(s),
            FrictionLaw::Varying(law) => law.limit(s),
            FrictionLaw::Regional(law) => law.limit(s),
        }
    }

    /// The limit under the laws of both sides.
    fn both(&self, own: u16, other: u16, s: &Sliding<'_>) -> f64 {
        match (own, other) {
            (law, 0) | (0, law) => self.of(law, s),
            (a, b) if a == b => self.of(a, s),
            (a, b) => self.of(a, s).min(self.of(b, s)),
        }
    }
}

impl Coulomb for RegionalFriction {
    fn is_smooth(&self) -> bool {
        let none = |l: &FrictionLaw| matches!(l, FrictionLaw::Constant(c) if *c <= 0.0);
        self.laws.iter().all(none)
    }

    fn limit(&self, s: &Sliding<'_>) -> f64 {
        let own = self.slave.at(s.node);
        match &self.partner {
            Partner::Bare => self.of(own, s),
            Partner::Between(laws) => self.both(own, laws.at(s.node), s),
            Partner::Sheet {
                laws,
                cells,
                first_cell,
            } => {
                let cell = s.cell.checked_sub(*first_cell).map(|c| c as usize);
                let Some(cell) = cell.and_then(|c| cells.get(c)) else {
                    return self.of(own, s);
                };
                let others = cell.map(|n| laws.at(n));
                if others.iter().all(|l| *l == others[0]) {
                    return self.both(own, others[0], s);
                }
                0.25 * others.iter().map(|l| self.both(own, *l, s)).sum::<f64>()
            }
        }
    }
}
