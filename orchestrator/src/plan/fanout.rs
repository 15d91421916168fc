//! Fan-out: the index paths of a step's instances, as far as the collections they range over are known.

use super::graph::Graph;

/// How many items the artifact of one instance has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// Known: the instance is done.
    Items(u64),
    /// Not known yet; the instance's number, to wait for.
    Unknown(usize),
}

/// What a walk found.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Walk {
    /// Index paths that are known, in lexicographic order.
    pub known: Vec<Vec<u64>>,
    /// Instances whose extents hide further paths; without repeats, in the order met.
    pub unknown: Vec<usize>,
}

/// Lists the instances of `step` whose path agrees with `fixed` (one entry per dimension; `None`: all).
///
/// `extent(step, path)` tells the size of the collection made by the instance of `step` at `path`.
pub fn walk(
    graph: &Graph,
    step: usize,
    fixed: &[Option<u64>],
    mut extent: impl FnMut(usize, &[u64]) -> Extent,
) -> Walk {
    let mut walker = Walker {
        graph,
        step,
        fixed,
        path: Vec::with_capacity(fixed.len()),
        found: Walk::default(),
    };
    walker.descend(&mut extent);
    walker.found
}

/// A walk under way.
struct Walker<'w> {
    graph: &'w Graph,
    step: usize,
    fixed: &'w [Option<u64>],
    path: Vec<u64>,
    found: Walk,
}

impl Walker<'_> {
    fn descend(&mut self, extent: &mut impl FnMut(usize, &[u64]) -> Extent) {
        let at = self.path.len();
        let Some(dimension) = self.graph.steps[self.step].dimensions.get(at) else {
            self.found.known.push(self.path.clone());
            return;
        };
        let owner: Vec<u64> = dimension.prefix.iter().map(|at| self.path[*at]).collect();
        match extent(dimension.over, &owner) {
            Extent::Unknown(instance) => {
                if !self.found.unknown.contains(&instance) {
                    self.found.unknown.push(instance);
                }
            }
            Extent::Items(n) => {
                let range = match self.fixed[at] {
                    Some(i) if i < n => i..i + 1,
                    Some(_) => 0..0,
                    None => 0..n,
                };
                for i in range {
                    self.path.push(i);
                    self.descend(extent);
                    self.path.pop();
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{step, workflow};
    use super::*;

    #[test]
    fn a_nested_fan_out_lists_what_is_known_and_names_what_hides_the_rest() {
        // b is fanned over a (2 items); c over a and, inside, over b: 3 items for b[0], unknown for b[1].
        let w = workflow(vec![
            step("a", &[], &[]),
            step("b", &["a"], &[]),
            step("c", &["a", "b"], &[]),
        ]);
        let graph = Graph::new(&w).unwrap();
        let found = walk(&graph, 2, &[None, None], |s, path| match (s, path) {
            (0, []) => Extent::Items(2),
            (1, [0]) => Extent::Items(3),
            (1, [1]) => Extent::Unknown(77),
            other => panic!("asked for {other:?}"),
        });
        assert_eq!(found.known, [vec![0, 0], vec![0, 1], vec![0, 2]]);
        assert_eq!(found.unknown, [77]);
    }

    #[test]
    fn a_product_of_two_collections_has_every_pair_in_order() {
        let w = workflow(vec![
            step("a", &[], &[]),
            step("b", &[], &[]),
            step("c", &["a", "b"], &[]),
        ]);
        let graph = Graph::new(&w).unwrap();
        let found = walk(&graph, 2, &[None, Some(1)], |_, _| Extent::Items(2));
        assert_eq!(found.known, [vec![0, 1], vec![1, 1]]);
    }

    #[test]
    fn an_empty_collection_gives_no_instances_and_nothing_unknown() {
        let w = workflow(vec![step("a", &[], &[]), step("b", &["a"], &[])]);
        let graph = Graph::new(&w).unwrap();
        assert_eq!(
            walk(&graph, 1, &[None], |_, _| Extent::Items(0)),
            Walk::default()
        );
    }
}
