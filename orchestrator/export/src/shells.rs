//! Bodies as shells of a solver: the cells that have a shape, with numbers for nodes and elements, and names that every solver takes.

use crate::names::Names;
use crate::part::{Body, Part};
use std::collections::BTreeSet;

/// With what the names of single elements begin, and that of no body.
pub const ELEMENT: &str = "CELL_";

/// A body as shells.
pub struct Shells<'a> {
    /// The body.
    pub body: &'a Body,
    /// Its name in capital letters, digits and `_`, no two alike.
    pub label: String,
    /// Points that its cells use, in the order of their numbers.
    pub nodes: Vec<usize>,
    /// Number of the first of them.
    first_node: usize,
    /// Its cells.
    pub cells: Vec<usize>,
    /// Number of the first of them.
    first_element: usize,
}

impl Shells<'_> {
    /// The nodes with their numbers and points.
    pub fn numbered(&self) -> impl Iterator<Item = (usize, [f64; 3])> + '_ {
        let of = |(k, node): (usize, &usize)| (self.first_node + k, self.body.points[*node]);
        self.nodes.iter().enumerate().map(of)
    }

    /// Cells with the numbers of their elements.
    pub fn elements(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let of = |(k, cell): (usize, &usize)| (self.first_element + k, *cell);
        self.cells.iter().enumerate().map(of)
    }

    /// Numbers of the nodes at a cell's corners.
    pub fn corners(&self, cell: usize) -> Vec<usize> {
        let number = |node: &u32| {
            let at = self.nodes.binary_search(&(*node as usize));
            self.first_node + at.expect("nodes of cells are listed")
        };
        self.body.corners(cell).iter().map(number).collect()
    }
}

/// The bodies, each with nodes and elements of its own, numbered from 1 through all of them. What has no shape is told and left out.
pub fn shells<'a>(part: &'a Part, told: &mut Vec<String>) -> Vec<Shells<'a>> {
    let (mut node, mut element) = (1, 1);
    let mut labels = Names::default();
    let mut all = Vec::new();
    for body in &part.bodies {
        body.tell_missing(told);
        let cells = body.usable();
        let used: BTreeSet<usize> = cells
            .iter()
            .flat_map(|c| body.corners(*c).iter().map(|i| *i as usize))
            .collect();
        let nodes: Vec<usize> = used.into_iter().collect();
        let counts = (nodes.len(), cells.len());
        all.push(Shells {
            body,
            label: labels.own(&label(&body.name)),
            nodes,
            first_node: node,
            cells,
            first_element: element,
        });
        node += counts.0;
        element += counts.1;
    }
    all
}

/// A name that solvers take: capital letters, digits and `_`, with a letter first.
pub fn label(name: &str) -> String {
    let fit = |c: char| {
        if c.is_ascii_alphanumeric() {
            c.to_ascii_uppercase()
        } else {
            '_'
        }
    };
    let name: String = name.chars().map(fit).take(60).collect();
    match name.starts_with(|c: char| c.is_ascii_uppercase()) && !name.starts_with(ELEMENT) {
        true => name,
        false => format!("N{name}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_labels_that_stay_apart() {
        let mut taken = Names::default();
        let labels: Vec<String> = ["ply-1", "ply.1", "PLY_1", "_a", "ä", "cell_7"]
            .map(|n| taken.own(&label(n)))
            .into();
        assert_eq!(
            labels,
            ["PLY_1", "PLY_1_2", "PLY_1_3", "N_A", "N_", "NCELL_7"]
        );
    }
}
