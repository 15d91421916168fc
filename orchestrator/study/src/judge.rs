//! What is said of a family of results: where it is largest, whether it grows, whether it is symmetric.

/// What is claimed of a family.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Claim {
    /// Each value: the one that is farthest from what is expected.
    Each,
    /// Their mean.
    Mean,
    /// The largest.
    Max,
    /// The smallest.
    Min,
    /// The value of a variable where the result is largest; of several such points the one farthest from what is expected.
    Argmax,
    /// The value of a variable where the result is smallest.
    Argmin,
    /// The largest step against the direction, along a variable.
    Monotone {
        /// Whether it grows.
        increasing: bool,
    },
    /// The largest size.
    Zero,
    /// The largest difference between two points that mirror each other in a value of a variable.
    Symmetric {
        /// That value.
        about: f64,
    },
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

/// What was found.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Found {
    /// The number that is held against what is expected; `None` when it is not known.
    pub value: Option<f64>,
    /// Positions of the points that it comes from.
    pub at: Vec<usize>,
    /// Points without a result.
    pub missing: usize,
    /// Whether points without a result could make the number better, so that one that misses is known to miss whatever they are.
    pub stands: bool,
}

/// How far a value is outside of `low..high`, or how near to their border inside: the largest is the worst.
fn badness(value: f64, (low, high): (f64, f64)) -> f64 {
    (low - value).max(value - high)
}

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
    match claim {
        Claim::Each => {
            let (at, value) = worst(&mut known.iter().copied()).unwrap_or((0, f64::NAN));
            (found.value, found.at, found.stands) = (Some(value), vec![at], true);
        }
        Claim::Mean => {
            let sum: f64 = known.iter().map(|(_, v)| v).sum();
            found.value = Some(sum / known.len() as f64);
        }
        Claim::Zero => {
            let (at, value) = largest(known.iter().map(|(i, v)| (*i, v.abs())));
            (found.value, found.at, found.stands) = (Some(value), vec![at], true);
        }
        Claim::Max | Claim::Min => {
            let sign = if claim == Claim::Max { 1.0 } else { -1.0 };
            let (at, value) = largest(known.iter().map(|(i, v)| (*i, sign * v)));
            let value = sign * value;
            found.stands = match claim {
                Claim::Max => value > within.1,
                _ => value < within.0,
            };
            (found.value, found.at) = (Some(value), vec![at]);
        }
        Claim::Argmax | Claim::Argmin => {
            let sign = if claim == Claim::Argmax { 1.0 } else { -1.0 };
            let (_, extreme) = largest(known.iter().map(|(i, v)| (*i, sign * v)));
            let ties = known.iter().filter(|(_, v)| sign * v == extreme);
            let at = worst(&mut ties.map(|(i, _)| (*i, marks[*i].along)));
            (found.value, found.at) = (at.map(|a| a.1), at.map(|a| a.0).into_iter().collect());
        }
        Claim::Monotone { increasing } => along(&mut found, monotone(marks, increasing)),
        Claim::Symmetric { about } => along(&mut found, symmetric(marks, about)),
    }
    found
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

/// The largest step against the direction between two points of a group; 0 when there is none. `None`: no group has two points.
fn monotone(marks: &[Mark], increasing: bool) -> Option<(f64, [usize; 2])> {
    let mut order: Vec<usize> = (0..marks.len())
        .filter(|i| marks[*i].result.is_some())
        .collect();
    let sign = if increasing { 1.0 } else { -1.0 };
    order.sort_by(|a, b| {
        let (x, y) = (&marks[*a], &marks[*b]);
        (x.group.cmp(&y.group)).then(x.along.total_cmp(&y.along))
    });
    let value = |i: usize| sign * marks[i].result.unwrap_or(0.0);
    let mut worst: Option<(f64, [usize; 2])> = None;
    // The highest so far of the group: a slow fall over many points is a fall.
    let mut top: Option<usize> = None;
    for &i in &order {
        match top {
            Some(t) if marks[t].group == marks[i].group => {
                let fall = (value(t) - value(i)).max(0.0);
                if worst.is_none_or(|w| fall > w.0) {
                    worst = Some((fall, [t, i]));
                }
                if value(i) > value(t) {
                    top = Some(i);
                }
            }
            _ => top = Some(i),
        }
    }
    worst
}

/// The largest difference of two points of a group that mirror each other. `None`: there are no two.
fn symmetric(marks: &[Mark], about: f64) -> Option<(f64, [usize; 2])> {
    let mut worst: Option<(f64, [usize; 2])> = None;
    for (i, a) in marks.iter().enumerate() {
        for (j, b) in marks.iter().enumerate().skip(i + 1) {
            let size = a.along.abs().max(b.along.abs()).max(about.abs());
            let mirrors = (a.along + b.along - 2.0 * about).abs() <= 1e-9 * size;
            if let (true, true, Some(x), Some(y)) =
                (a.group == b.group, mirrors, a.result, b.result)
                && worst.is_none_or(|w| (x - y).abs() > w.0)
            {
                worst = Some(((x - y).abs(), [i, j]));
            }
        }
    }
    worst
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let found = judge(Claim::Max, &marks(&HILL), ALL);
        assert_eq!((found.value, found.at), (Some(10.0), vec![2]));
        assert_eq!(judge(Claim::Argmax, &marks(&HILL), ALL).value, Some(45.0));
        // Of two smallest the one that is farther from what is expected.
        assert_eq!(
            judge(Claim::Argmin, &marks(&HILL), (-1.0, 1.0)).value,
            Some(90.0)
        );
        assert_eq!(judge(Claim::Mean, &marks(&HILL), ALL).value, Some(3.4));
        assert_eq!(
            judge(Claim::Each, &marks(&HILL), (ALL.0, 5.0)).value,
            Some(10.0)
        );
        assert_eq!(
            judge(Claim::Each, &marks(&HILL), (1.0, ALL.1)).value,
            Some(0.0)
        );
    }

    #[test]
    fn a_slow_fall_over_many_points_is_a_fall() {
        let slow: Vec<_> = (0..10)
            .map(|i| (f64::from(i), Some(10.0 - 0.1 * f64::from(i))))
            .collect();
        let fall = |increasing| {
            judge(Claim::Monotone { increasing }, &marks(&slow), ALL)
                .value
                .unwrap()
        };
        assert!((fall(true) - 0.9).abs() < 1e-12 && fall(false) == 0.0);
        let one = judge(
            Claim::Monotone { increasing: true },
            &marks(&slow[..1]),
            ALL,
        );
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
        let up = Claim::Monotone { increasing: true };
        assert_eq!(judge(up, &two, ALL).value, Some(0.0));
        let found = judge(Claim::Symmetric { about: 0.5 }, &two, ALL);
        assert_eq!((found.value, found.at), (Some(1.0), vec![0, 2]));
    }

    #[test]
    fn points_without_a_result_are_counted_and_never_zero() {
        let holes = marks(&[(0.0, Some(2.0)), (1.0, None), (2.0, Some(1.0))]);
        let found = judge(Claim::Zero, &holes, (ALL.0, 0.5));
        assert_eq!(
            (found.value, found.missing, found.stands),
            (Some(2.0), 1, true)
        );
        let found = judge(Claim::Max, &holes, (ALL.0, 3.0));
        assert_eq!(
            (found.missing, found.stands),
            (1, false),
            "the third may be larger"
        );
        assert_eq!(judge(Claim::Max, &marks(&[(0.0, None)]), ALL).value, None);
        let mirrored = judge(Claim::Symmetric { about: 1.0 }, &holes, ALL);
        assert_eq!(mirrored.value, Some(1.0));
        assert_eq!(
            judge(Claim::Symmetric { about: 7.0 }, &holes, ALL).value,
            None
        );
    }
}
