//! What is said of a family of results: where it is largest, whether it grows, whether it is symmetric.

use plyflow_model::workflow::FamilyOf;
use std::collections::HashMap;

/// What is claimed of a family.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Claim {
    /// What of the family is looked at.
    pub of: FamilyOf,
    /// For `monotone`: whether it grows.
    pub increasing: bool,
    /// For `symmetric_about`: the value of the variable in which points mirror each other (SI).
    pub about: f64,
}

/// A point as it is judged.
#[derive(Debug, Clone, PartialEq)]
pub struct Mark {
    /// The value of the variable along which is looked.
    pub along: f64,
    /// Points of one group differ in that variable alone.
    pub group: usize,
    /// The result; `None`: there is none.
    pub result: Option<f64>,
}

/// Points as they are judged: for each the value of the variable along which is looked, what it has of the others, and its result.
pub fn marks<G: std::hash::Hash + Eq>(
    points: impl IntoIterator<Item = (f64, G, Option<f64>)>,
) -> Vec<Mark> {
    let mut groups: HashMap<G, usize> = HashMap::new();
    let mark = |(along, others, result)| {
        let next = groups.len();
        Mark {
            along,
            group: *groups.entry(others).or_insert(next),
            result,
        }
    };
    points.into_iter().map(mark).collect()
}

/// What was found.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Found {
    /// The number that is held against what is expected; `None` when it is not known.
    pub value: Option<f64>,
    /// Positions of the points that it comes from.
    pub at: Vec<usize>,
    /// Points without a result.
    pub missing: usize,
    /// Points that the claim says nothing of, whatever their results: without a mirror, or without another one along the variable.
    pub alone: usize,
    /// Whether points without a result could make the number better, so that one that misses is known to miss whatever they are.
    pub stands: bool,
}

/// How far a value is outside of `low..high`, or how near to their border inside: the largest is the worst.
fn badness(value: f64, (low, high): (f64, f64)) -> f64 {
    (low - value).max(value - high)
}

/// Results that differ by less than this part are the same.
const SAME: f64 = 1e-12;

/// Finds the number of a claim. `within`: the bounds of what is expected (infinite where there is none). `None` of the value also when
/// a claim along a variable finds no two points to compare.
#[must_use]
pub fn judge(claim: Claim, marks: &[Mark], within: (f64, f64)) -> Found {
    let known: Vec<(usize, f64)> = (marks.iter().enumerate())
        .filter_map(|(i, m)| Some((i, m.result?)))
        .collect();
    let mut found = Found {
        missing: marks.len() - known.len(),
        ..Found::default()
    };
    let pairs = match claim.of {
        FamilyOf::Monotone => neighbours(marks, &mut found.alone),
        FamilyOf::SymmetricAbout => mirrors(marks, claim.about, &mut found.alone),
        _ => Vec::new(),
    };
    if known.is_empty() {
        return found;
    }
    let worst = |all: &mut dyn Iterator<Item = (usize, f64)>| {
        all.max_by(|a, b| {
            badness(a.1, within)
                .total_cmp(&badness(b.1, within))
                .then(b.0.cmp(&a.0))
        })
    };
    let is_most = matches!(claim.of, FamilyOf::Max | FamilyOf::Argmax);
    let sign = if is_most { 1.0 } else { -1.0 };
    match claim.of {
        FamilyOf::Each => {
            let (at, value) = worst(&mut known.iter().copied()).unwrap_or((0, f64::NAN));
            (found.value, found.at, found.stands) = (Some(value), vec![at], true);
        }
        FamilyOf::Mean => {
            let sum: f64 = known.iter().map(|(_, v)| v).sum();
            found.value = Some(sum / known.len() as f64);
        }
        FamilyOf::ZeroWhere => {
            let (at, value) = largest(known.iter().map(|(i, v)| (*i, v.abs())));
            (found.value, found.at, found.stands) = (Some(value), vec![at], true);
        }
        FamilyOf::Max | FamilyOf::Min => {
            let (at, value) = largest(known.iter().map(|(i, v)| (*i, sign * v)));
            let value = sign * value;
            found.stands = match claim.of {
                FamilyOf::Max => value > within.1,
                _ => value < within.0,
            };
            (found.value, found.at) = (Some(value), vec![at]);
        }
        FamilyOf::Argmax | FamilyOf::Argmin => {
            let ties = as_large(&known, sign);
            let at = worst(&mut ties.map(|i| (i, marks[i].along)));
            (found.value, found.at) = (at.map(|a| a.1), at.map(|a| a.0).into_iter().collect());
        }
        FamilyOf::Monotone => along(&mut found, monotone(marks, &pairs, claim.increasing)),
        FamilyOf::SymmetricAbout => along(&mut found, symmetric(marks, &pairs)),
        // What is best is told by the trace of an optimisation.
        FamilyOf::Best => {}
    }
    found
}

/// Positions of the largest of some results times `sign`, and of those that differ from it by rounding alone.
fn as_large(known: &[(usize, f64)], sign: f64) -> impl Iterator<Item = usize> {
    let (_, extreme) = largest(known.iter().map(|(i, v)| (*i, sign * v)));
    let least = extreme - SAME * extreme.abs();
    let ties = known.iter().filter(move |(_, v)| sign * v >= least);
    ties.map(|(i, _)| *i)
}

fn along(found: &mut Found, worst: Option<(f64, [usize; 2])>) {
    if let Some((value, at)) = worst {
        (found.value, found.at, found.stands) = (Some(value), at.to_vec(), true);
    }
}

/// The first of the largest.
fn largest(all: impl Iterator<Item = (usize, f64)>) -> (usize, f64) {
    let mut best = (0, f64::NEG_INFINITY);
    for (i, v) in all {
        if v > best.1 || best.1 == f64::NEG_INFINITY {
            best = (i, v);
        }
    }
    best
}

/// Positions in the order of their groups, within them along the variable.
fn in_order(marks: &[Mark]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..marks.len()).collect();
    order.sort_by(|a, b| {
        let (x, y) = (&marks[*a], &marks[*b]);
        (x.group.cmp(&y.group)).then(x.along.total_cmp(&y.along))
    });
    order
}

/// Each point with the next one of its group; `alone`: points whose group has no other.
fn neighbours(marks: &[Mark], alone: &mut usize) -> Vec<[usize; 2]> {
    let order = in_order(marks);
    let of_one = |a: &usize, b: &usize| marks[*a].group == marks[*b].group;
    *alone = order.chunk_by(of_one).filter(|g| g.len() == 1).count();
    let pairs = order.windows(2).filter(|w| of_one(&w[0], &w[1]));
    pairs.map(|w| [w[0], w[1]]).collect()
}

/// Pairs of points of a group that mirror each other; `alone`: points without a mirror that do not lie in it themselves.
fn mirrors(marks: &[Mark], about: f64, alone: &mut usize) -> Vec<[usize; 2]> {
    let order = in_order(marks);
    let of_one = |a: &usize, b: &usize| marks[*a].group == marks[*b].group;
    let mut pairs = Vec::new();
    for group in order.chunk_by(of_one) {
        // From both ends to the middle.
        let (mut i, mut j) = (0, group.len() - 1);
        while i <= j {
            let (a, b) = (marks[group[i]].along, marks[group[j]].along);
            let size = a.abs().max(b.abs()).max(about.abs());
            let off = a + b - 2.0 * about;
            if off.abs() <= 1e-9 * size {
                if i < j {
                    pairs.push([group[i].min(group[j]), group[i].max(group[j])]);
                }
                (i, j) = (i + 1, j.wrapping_sub(1));
            } else {
                *alone += 1;
                if off < 0.0 {
                    i += 1;
                } else {
                    j = j.wrapping_sub(1);
                }
            }
            if j == usize::MAX {
                break;
            }
        }
    }
    pairs.sort_unstable();
    pairs
}

/// The largest step against the direction between two points of a group; 0 when there is none. `None`: no group has two points.
fn monotone(marks: &[Mark], pairs: &[[usize; 2]], increasing: bool) -> Option<(f64, [usize; 2])> {
    let sign = if increasing { 1.0 } else { -1.0 };
    let mut worst: Option<(f64, [usize; 2])> = None;
    // The highest so far of the group: a slow fall over many points is a fall.
    let mut top: Option<(usize, f64)> = None;
    for &[from, to] in pairs {
        if top.is_none_or(|(t, _)| marks[t].group != marks[from].group) {
            top = marks[from].result.map(|v| (from, sign * v));
        }
        let Some(value) = marks[to].result.map(|v| sign * v) else {
            continue;
        };
        if let Some((t, highest)) = top {
            let fall = (highest - value).max(0.0);
            if worst.is_none_or(|w| fall > w.0) {
                worst = Some((fall, [t, to]));
            }
        }
        if top.is_none_or(|(_, highest)| value > highest) {
            top = Some((to, value));
        }
    }
    worst
}

/// The largest difference of two points that mirror each other. `None`: there are no two with results.
fn symmetric(marks: &[Mark], pairs: &[[usize; 2]]) -> Option<(f64, [usize; 2])> {
    let mut worst: Option<(f64, [usize; 2])> = None;
    for &[i, j] in pairs {
        if let (Some(x), Some(y)) = (marks[i].result, marks[j].result)
            && worst.is_none_or(|w| (x - y).abs() > w.0)
        {
            worst = Some(((x - y).abs(), [i, j]));
        }
    }
    worst
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(of: FamilyOf) -> Claim {
        Claim {
            of,
            increasing: true,
            about: f64::NAN,
        }
    }

    fn monotone(increasing: bool) -> Claim {
        Claim {
            increasing,
            ..of(FamilyOf::Monotone)
        }
    }

    fn symmetric(about: f64) -> Claim {
        Claim {
            about,
            ..of(FamilyOf::SymmetricAbout)
        }
    }

    fn marks(values: &[(f64, Option<f64>)]) -> Vec<Mark> {
        let mark = |(along, result): &(f64, Option<f64>)| Mark {
            along: *along,
            group: 0,
            result: *result,
        };
        values.iter().map(mark).collect()
    }

    const HILL: [(f64, Option<f64>); 5] = [
        (0.0, Some(0.0)),
        (20.0, Some(3.0)),
        (45.0, Some(10.0)),
        (70.0, Some(4.0)),
        (90.0, Some(0.0)),
    ];
    const ALL: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

    #[test]
    fn the_largest_is_found_with_its_place() {
        let found = judge(of(FamilyOf::Max), &marks(&HILL), ALL);
        assert_eq!((found.value, found.at), (Some(10.0), vec![2]));
        assert_eq!(
            judge(of(FamilyOf::Argmax), &marks(&HILL), ALL).value,
            Some(45.0)
        );
        // Nor does rounding part two largest ones.
        let mut two = HILL;
        two[1].1 = Some(10.0 - 5e-15);
        let found = judge(of(FamilyOf::Argmax), &marks(&two), (0.0, 30.0));
        assert_eq!(found.value, Some(45.0));
        let found = judge(of(FamilyOf::Argmax), &marks(&two), (30.0, 60.0));
        assert_eq!(found.value, Some(20.0));
        // Of two smallest the one that is farther from what is expected.
        assert_eq!(
            judge(of(FamilyOf::Argmin), &marks(&HILL), (-1.0, 1.0)).value,
            Some(90.0)
        );
        assert_eq!(
            judge(of(FamilyOf::Mean), &marks(&HILL), ALL).value,
            Some(3.4)
        );
        assert_eq!(
            judge(of(FamilyOf::Each), &marks(&HILL), (ALL.0, 5.0)).value,
            Some(10.0)
        );
        assert_eq!(
            judge(of(FamilyOf::Each), &marks(&HILL), (1.0, ALL.1)).value,
            Some(0.0)
        );
    }

    #[test]
    fn a_slow_fall_over_many_points_is_a_fall() {
        let slow: Vec<_> = (0..10)
            .map(|i| (f64::from(i), Some(10.0 - 0.1 * f64::from(i))))
            .collect();
        let fall = |increasing| {
            judge(monotone(increasing), &marks(&slow), ALL)
                .value
                .unwrap()
        };
        assert!((fall(true) - 0.9).abs() < 1e-12 && fall(false) == 0.0);
        let one = judge(monotone(true), &marks(&slow[..1]), ALL);
        assert_eq!(one.value, None, "one point tells of no direction");
    }

    #[test]
    fn groups_are_looked_at_one_by_one() {
        let mut two = marks(&[
            (0.0, Some(5.0)),
            (0.0, Some(1.0)),
            (1.0, Some(6.0)),
            (1.0, Some(2.0)),
        ]);
        (two[1].group, two[3].group) = (1, 1);
        let up = monotone(true);
        assert_eq!(judge(up, &two, ALL).value, Some(0.0));
        let found = judge(symmetric(0.5), &two, ALL);
        assert_eq!((found.value, found.at), (Some(1.0), vec![0, 2]));
    }

    #[test]
    fn points_without_a_result_are_counted_and_never_zero() {
        let holes = marks(&[(0.0, Some(2.0)), (1.0, None), (2.0, Some(1.0))]);
        let found = judge(of(FamilyOf::ZeroWhere), &holes, (ALL.0, 0.5));
        assert_eq!(
            (found.value, found.missing, found.stands),
            (Some(2.0), 1, true)
        );
        let found = judge(of(FamilyOf::Max), &holes, (ALL.0, 3.0));
        assert_eq!(
            (found.missing, found.stands),
            (1, false),
            "the third may be larger"
        );
        assert_eq!(
            judge(of(FamilyOf::Max), &marks(&[(0.0, None)]), ALL).value,
            None
        );
        let mirrored = judge(symmetric(1.0), &holes, ALL);
        assert_eq!(mirrored.value, Some(1.0));
        assert_eq!(judge(symmetric(7.0), &holes, ALL).value, None);
    }

    #[test]
    fn points_that_a_claim_says_nothing_of_are_counted() {
        let of_points = |claim, at: &[f64]| {
            let all: Vec<_> = at.iter().map(|a| (*a, Some(1.0))).collect();
            let found = judge(claim, &marks(&all), ALL);
            (found.value, found.alone)
        };
        assert_eq!(of_points(symmetric(1.0), &[0.0, 1.0, 2.0]), (Some(0.0), 0));
        assert_eq!(
            of_points(symmetric(1.0), &[3.0, 0.0, 2.0, 1.5]),
            (Some(0.0), 2)
        );
        assert_eq!(of_points(symmetric(1.0), &[1.0, 1.5]), (None, 1));
        assert_eq!(
            of_points(symmetric(0.0), &[-1.0, 1.0, -2.0]),
            (Some(0.0), 1)
        );
        assert_eq!(of_points(symmetric(-7.0), &[1.0]), (None, 1));
        assert_eq!(of_points(symmetric(7.0), &[1.0, 2.0]), (None, 2));
        let mut two = marks(&[(0.0, Some(1.0)), (1.0, Some(2.0)), (0.0, Some(3.0))]);
        two[2].group = 1;
        let found = judge(monotone(true), &two, ALL);
        assert_eq!((found.value, found.alone), (Some(0.0), 1));
    }

    #[test]
    fn a_fall_over_a_point_without_a_result_is_a_fall() {
        let holes = marks(&[(0.0, None), (1.0, Some(5.0)), (2.0, None), (3.0, Some(1.0))]);
        let found = judge(monotone(true), &holes, ALL);
        assert_eq!((found.value, found.at), (Some(4.0), vec![1, 3]));
    }
}
