//! Boundaries of a mesh.

use std::collections::{BTreeMap, VecDeque};

/// Closed lines of nodes about cells with these corners: the sides that one cell alone has, each in the direction of its cell. Cells are
/// counter-clockwise, so outer lines are too, and holes are clockwise. Where lines meet at a node, they part there in the order of the cells.
/// A line begins at its smallest node.
pub fn loops<'a>(cells: impl Iterator<Item = &'a [u32]>) -> Vec<Vec<u32>> {
    let mut sides: BTreeMap<[u32; 2], ([u32; 2], u32)> = BTreeMap::new();
    for corners in cells {
        for (k, a) in corners.iter().enumerate() {
            let b = corners[(k + 1) % corners.len()];
            let side = sides
                .entry([(*a).min(b), (*a).max(b)])
                .or_insert(([*a, b], 0));
            side.1 += 1;
        }
    }
    let mut from: BTreeMap<u32, VecDeque<u32>> = BTreeMap::new();
    for ([a, b], count) in sides.into_values() {
        if count == 1 {
            from.entry(a).or_default().push_back(b);
        }
    }
    let mut found = Vec::new();
    while let Some((&start, _)) = from.first_key_value() {
        let mut line = vec![start];
        let mut at = start;
        while let Some(next) = take(&mut from, at) {
            at = next;
            if at == start {
                break;
            }
            line.push(at);
        }
        found.push(line);
    }
    found
}

fn take(from: &mut BTreeMap<u32, VecDeque<u32>>, at: u32) -> Option<u32> {
    let next = from.get_mut(&at)?;
    let first = next.pop_front();
    if next.is_empty() {
        from.remove(&at);
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cells of a grid of 3 x 3 without those named.
    fn grid(without: &[usize]) -> Vec<[u32; 4]> {
        let of = |c: usize| {
            let a = (4 * (c / 3) + c % 3) as u32;
            [a, a + 1, a + 5, a + 4]
        };
        (0..9).filter(|c| !without.contains(c)).map(of).collect()
    }

    fn of(cells: &[[u32; 4]]) -> Vec<Vec<u32>> {
        loops(cells.iter().map(|c| &c[..]))
    }

    #[test]
    fn a_hole_is_clockwise_and_the_edge_counter_clockwise() {
        assert_eq!(
            of(&grid(&[4])),
            [
                vec![0, 1, 2, 3, 7, 11, 15, 14, 13, 12, 8, 4],
                vec![5, 9, 10, 6]
            ]
        );
    }

    #[test]
    fn cells_that_touch_at_a_corner_keep_all_their_sides() {
        let cells = grid(&[1, 2, 3, 5, 6, 7, 8]);
        let found = of(&cells);
        let sides: usize = found.iter().map(Vec::len).sum();
        assert_eq!(cells.len(), 2);
        assert_eq!(sides, 8, "{found:?}");
    }

    #[test]
    fn apart_pieces_are_lines_of_their_own() {
        let found = of(&grid(&[1, 3, 4, 5, 6, 7, 8]));
        assert_eq!(found, [vec![0, 1, 5, 4], vec![2, 3, 7, 6]]);
    }
}
