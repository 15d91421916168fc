//! Where plies of different outlines lie on each other: which of them are between two others, node by node.
//!
//! In a stack of equal plies every sheet touches its neighbours alone. A ply that reaches out over the one below it, that lies over a hole
//! of it or beside it touches what comes next, at the distance of what is really between.

use crate::assembly::{Bins, StackSheet, inverse_bilinear};
use plyflow_mechanics::model::Model;
use plyflow_mechanics::vec3::V;
use std::collections::{BTreeMap, HashMap};

/// How far (m) from another ply's edge a node may come to lie on its other side: more than plies slide on each other under vacuum.
const SLIDES: f64 = 0.02;

/// Where a node lies to a ply, in the undeformed plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Lies {
    /// On it, and it will not slide off.
    On,
    /// Near its edge, on either side.
    Near,
    /// Beside it.
    Off,
}

/// Nodes of plies and where they lie to the other plies of their stack.
#[derive(Debug, Default)]
pub struct Cover {
    /// By place in the stack of the nodes' ply and of the other one; none: the other one has all of these nodes on it, or beside it by less
    /// than an element.
    lies: BTreeMap<(usize, usize), Vec<Lies>>,
}

impl Cover {
    /// Of plies: their places in the stack, their sheets in the model, and their nodes that may touch.
    pub fn new(model: &Model, plies: &[(usize, usize, &[u32])]) -> Self {
        let mut lies = BTreeMap::new();
        for (other, sheet, _) in plies {
            let plan = Plan::new(model, *sheet);
            for (ply, _, nodes) in plies.iter().filter(|p| p.0 != *other) {
                if let Some(found) = plan.of(model, nodes) {
                    lies.insert((*ply, *other), found);
                }
            }
        }
        Self { lies }
    }

    fn at(&self, ply: usize, k: usize, other: usize) -> Lies {
        self.lies.get(&(ply, other)).map_or(Lies::On, |l| l[k])
    }

    /// The nodes (of `nodes`, those of `ply`) that may touch the `other` ply though plies lie `between` the two in the stack: none of these
    /// is surely there. Empty in a stack of equal plies.
    pub fn past(
        &self,
        (ply, nodes): (usize, &[u32]),
        between: impl Iterator<Item = usize> + Clone,
        other: Option<usize>,
    ) -> Vec<u32> {
        let open = |k: &usize| {
            let mut between = between.clone();
            let free = between.all(|i| self.at(ply, *k, i) != Lies::On);
            free && other.is_none_or(|o| self.at(ply, *k, o) != Lies::Off)
        };
        (0..nodes.len()).filter(open).map(|k| nodes[k]).collect()
    }

    /// The nodes of `ply` grouped by which of the plies `among` are surely there; those with all of them first.
    pub fn groups(
        &self,
        (ply, nodes): (usize, &[u32]),
        among: impl Iterator<Item = usize> + Clone,
    ) -> Vec<(Vec<usize>, Vec<u32>)> {
        let mut groups: BTreeMap<Vec<usize>, Vec<u32>> = BTreeMap::new();
        for (k, node) in nodes.iter().enumerate() {
            let there = among.clone().filter(|i| self.at(ply, k, *i) == Lies::On);
            groups.entry(there.collect()).or_default().push(*node);
        }
        let mut groups: Vec<_> = groups.into_iter().collect();
        groups.sort_by_key(|g| std::cmp::Reverse(g.0.len()));
        groups
    }
}

/// Distance (m) of a sheet's mid-plane from what is under (or over) all the sheets `between`.
pub fn offset_over(between: &[&StackSheet], sheet: &StackSheet) -> f64 {
    // Summed from the tool upwards, as the stack's own offsets are.
    let under = between.iter().fold(0.0, |sum, s| sum + s.thickness);
    under + 0.5 * sheet.thickness
}

/// What the name of a contact of a part of a ply's nodes ends with: which of the plies `among` are not surely between.
pub fn beside(
    stack: &[StackSheet],
    among: impl Iterator<Item = usize>,
    between: &[usize],
) -> String {
    let missing: Vec<&str> = among
        .filter(|i| !between.contains(i))
        .map(|i| stack[i].scene.name.as_str())
        .collect();
    match missing.is_empty() {
        true => String::new(),
        // Also a part of the path of its energies in the artifact.
        false => format!("/beside_{}", missing.join("_")),
    }
}

/// A sheet in the undeformed plane.
struct Plan {
    corners: Vec<[V; 4]>,
    bins: Bins,
    /// Ends of the edges that bound it.
    rim: Vec<[V; 2]>,
    /// Side (m) of a cell.
    size: f64,
    planes: [bool; 2],
}

impl Plan {
    fn new(model: &Model, sheet: usize) -> Self {
        let (from, to) = model.sheets[sheet].cell_range;
        let cells = &model.cells[from..to];
        let planes = model.planes().0;
        let x = |n: u32| model.x[n as usize];
        let corners: Vec<[V; 4]> = cells.iter().map(|c| c.map(x)).collect();
        let mut sides: HashMap<[u32; 2], usize> = HashMap::new();
        let edges = |c: &[u32; 4]| [0, 1, 2, 3].map(|k| [c[k], c[(k + 1) % 4]]);
        let sorted = |[a, b]: [u32; 2]| [a.min(b), a.max(b)];
        for edge in cells.iter().flat_map(edges) {
            *sides.entry(sorted(edge)).or_default() += 1;
        }
        // At a mirror plane a sheet does not end.
        let ends = |e: &[V; 2]| !(0..2).any(|k| planes[k] && e.iter().all(|p| p[k].abs() < 1e-9));
        let rim = (cells.iter().flat_map(edges))
            .filter(|e| sides[&sorted(*e)] == 1)
            .map(|e| e.map(x))
            .filter(ends)
            .collect();
        let area = |c: &[V; 4]| {
            let d = |a: usize, b: usize| [0, 1].map(|k| c[b][k] - c[a][k]);
            let ([ax, ay], [bx, by]) = (d(0, 2), d(1, 3));
            0.5 * (ax * by - ay * bx).abs()
        };
        let whole: f64 = corners.iter().map(area).sum();
        Self {
            bins: Bins::of_cells(&corners),
            rim,
            size: (whole / corners.len().max(1) as f64).sqrt(),
            corners,
            planes,
        }
    }

    /// Where nodes lie; none where all of them are on it, or off by less than an element.
    fn of(&self, model: &Model, nodes: &[u32]) -> Option<Vec<Lies>> {
        // Of a mirrored model a ghost lies beyond the plane, where the sheet goes on as its image.
        let place = |n: &u32| -> V {
            let p = model.x[*n as usize];
            [0, 1, 2].map(|k| {
                if k < 2 && self.planes[k] {
                    p[k].abs()
                } else {
                    p[k]
                }
            })
        };
        let places: Vec<V> = nodes.iter().map(place).collect();
        let inside: Vec<bool> = places.iter().map(|p| self.has(*p)).collect();
        let all = || places.iter().zip(&inside);
        if all().all(|(p, inside)| *inside || self.to_rim(*p) < self.size) {
            return None;
        }
        let lies = |(p, inside): (&V, &bool)| match (
            self.to_rim(*p) < SLIDES.max(2.0 * self.size),
            inside,
        ) {
            (true, _) => Lies::Near,
            (false, true) => Lies::On,
            (false, false) => Lies::Off,
        };
        Some(all().map(lies).collect())
    }

    fn has(&self, p: V) -> bool {
        self.bins.near(p).iter().any(|c| {
            let xi = inverse_bilinear(self.corners[*c as usize], p);
            xi.is_some_and(|xi| xi.iter().all(|x| x.abs() <= 1.0 + 1e-9))
        })
    }

    /// Distance (m) in the plane from its edge.
    fn to_rim(&self, p: V) -> f64 {
        let distance = |[a, b]: &[V; 2]| {
            let (e, r) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
            let along = (r[0] * e[0] + r[1] * e[1]) / (e[0] * e[0] + e[1] * e[1]).max(1e-300);
            let t = along.clamp(0.0, 1.0);
            (r[0] - t * e[0]).hypot(r[1] - t * e[1])
        };
        self.rim.iter().map(distance).fold(f64::INFINITY, f64::min)
    }
}
