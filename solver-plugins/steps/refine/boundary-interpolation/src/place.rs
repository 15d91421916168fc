//! Which place of a step's item is that of its zone.
//!
//! An item (fan-out index path) has a place for each collection that a step is fanned out over, in the order of its `for_each`, and does not name
//! them. But a coarse run of a pass of zone-feedback has the places of the passes in its own item, and a list of zones those of
//! what it is fanned out over itself: what is left is the zone's.

/// The place of the zone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Index of the zone.
    One(usize),
    /// There is none beside those of the inputs.
    None,
    /// It cannot be told from others.
    Several,
}

/// The place of the zone in a step's `item`. `zones`, `formed`: the items of the list of zones and of the coarse run, whose collections the step is
/// fanned out over as well. Of several places the one can be told whose omission leaves all that `formed` has, after all that `zones` has; places
/// with the same index are as good as one.
pub fn of_zone(item: &[u64], zones: &[u64], formed: &[u64]) -> Place {
    let without = |k: usize| -> Vec<u64> {
        let rest = item.iter().enumerate().filter(|(i, _)| *i != k);
        rest.map(|(_, v)| *v).collect()
    };
    let possible = |k: &usize| has_all(&item[..*k], zones) && has_all(&without(*k), formed);
    let mut found: Vec<u64> = (0..item.len()).filter(possible).map(|k| item[k]).collect();
    found.sort_unstable();
    found.dedup();
    match found[..] {
        [] => Place::None,
        [index] => Place::One(index as usize),
        _ => Place::Several,
    }
}

/// Whether every index of `some` is among `all`, as often.
fn has_all(all: &[u64], some: &[u64]) -> bool {
    let count = |of: &[u64], v: u64| of.iter().filter(|o| **o == v).count();
    some.iter().all(|&v| count(some, v) <= count(all, v))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_place_of_the_zone_is_what_its_inputs_have_not() {
        use Place::{None, One, Several};
        assert_eq!(of_zone(&[2], &[], &[]), One(2));
        // A pass of zone-feedback, in either order, and two.
        assert_eq!(of_zone(&[0, 2], &[], &[0]), One(2));
        assert_eq!(of_zone(&[2, 0], &[], &[0]), One(2));
        assert_eq!(of_zone(&[0, 0], &[], &[0]), One(0));
        assert_eq!(of_zone(&[1, 1], &[], &[1]), One(1));
        assert_eq!(of_zone(&[0, 1, 0], &[], &[0, 0]), One(1));
        assert_eq!(of_zone(&[1, 0, 1], &[], &[0, 1]), One(1));
        // Zones of the cases of a study, and coarse runs of them.
        assert_eq!(of_zone(&[3, 1], &[3], &[3]), One(1));
        assert_eq!(of_zone(&[1, 3], &[1], &[]), One(3));
        // Fanned out over the passes alone, or over something of which no input tells.
        assert_eq!(of_zone(&[0], &[], &[0]), None);
        assert_eq!(of_zone(&[], &[], &[]), None);
        assert_eq!(of_zone(&[0, 1], &[], &[]), Several);
        assert_eq!(of_zone(&[0, 1, 2], &[], &[1]), Several);
    }
}
