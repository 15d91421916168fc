//! Which variable a response depends on: rank correlation, Sobol indices, elementary effects, each with how sure it is.
//!
//! Random numbers are those of one fixed stream (ChaCha8), so that the same study has the same page.

use chacha20::ChaCha8Rng;
use chacha20::rand_core::{Rng, SeedableRng};
use std::collections::BTreeMap;

/// A rank correlation of fewer points tells nothing.
pub(crate) const LEAST: usize = 8;
/// First-order indices of a sample need so many points.
pub(crate) const LEAST_SAMPLE: usize = 50;
/// Elementary effects of a variable need so many pairs.
pub(crate) const LEAST_PAIRS: usize = 4;

/// How often is drawn for a range, and how many halves of a sample are.
const DRAWS: usize = 1000;
const HALVES: usize = 300;
/// Cosines that follow a response over a variable.
const WAVES: usize = 6;
/// Half of what lies outside of a range.
const TAIL: f64 = 0.025;
/// Standard deviations from the middle to the end of a range of 95 %.
const SPREAD: f64 = 1.96;
const SEED: [u8; 32] = *b"plyflow study page: sensitivity.";

/// A number with the range in which it lies with a confidence of 95 %.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Estimate {
    pub(crate) value: f64,
    pub(crate) low: f64,
    pub(crate) high: f64,
}

/// The elementary effects of a variable (Morris): of every two neighbours that differ in it alone, the difference of the response over
/// that of the variable, times the whole range of the variable. In the unit of the response.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Effects {
    /// Mean of their sizes.
    pub(crate) size: Estimate,
    /// Their standard deviation: large where the effect depends on where one is.
    pub(crate) deviation: f64,
    pub(crate) pairs: usize,
}

fn stream() -> ChaCha8Rng {
    ChaCha8Rng::from_seed(SEED)
}

/// A whole number below `n`.
fn below(stream: &mut ChaCha8Rng, n: usize) -> usize {
    ((u64::from(stream.next_u32()) * n as u64) >> 32) as usize
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Mean square of the deviation from the mean.
fn variance(values: &[f64]) -> f64 {
    let m = mean(values);
    values.iter().map(|v| (v - m).powi(2)).sum::<f64>() / values.len() as f64
}

/// Whether values differ by no more than rounding.
fn is_constant(values: &[f64]) -> bool {
    let size = values.iter().fold(0.0f64, |a, v| a.max(v.abs()));
    variance(values).sqrt() <= 1e-12 * size
}

/// For each value its place among the different ones, and how many there are.
fn places(values: &[f64]) -> (Vec<usize>, usize) {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let (mut of, mut n) = (vec![0; values.len()], 0);
    for (k, i) in order.iter().enumerate() {
        n += usize::from(k > 0 && values[order[k - 1]] != values[*i]);
        of[*i] = n;
    }
    (of, n + usize::from(!values.is_empty()))
}

/// Mean rank of each place among those that are drawn.
fn ranks((of, n): &(Vec<usize>, usize), drawn: &[usize]) -> Vec<f64> {
    let mut count = vec![0usize; *n];
    drawn.iter().for_each(|i| count[of[*i]] += 1);
    let mut before = 0;
    let rank = count.iter().map(|c| {
        let middle = before as f64 + 0.5 * (*c as f64 - 1.0);
        before += c;
        middle
    });
    rank.collect()
}

/// Spearman's rank correlation of some points; `None` when one side is the same everywhere.
fn correlation(x: &(Vec<usize>, usize), y: &(Vec<usize>, usize), drawn: &[usize]) -> Option<f64> {
    let (rx, ry) = (ranks(x, drawn), ranks(y, drawn));
    let middle = 0.5 * (drawn.len() as f64 - 1.0);
    let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
    for i in drawn {
        let (a, b) = (rx[x.0[*i]] - middle, ry[y.0[*i]] - middle);
        (xx, yy, xy) = (xx + a * a, yy + b * b, xy + a * b);
    }
    (xx > 0.0 && yy > 0.0).then(|| xy / (xx * yy).sqrt())
}

/// The middle 95 % of what was drawn.
fn range_of(mut drawn: Vec<f64>, value: f64) -> Estimate {
    drawn.sort_by(f64::total_cmp);
    let at = |part: f64| {
        let place = (part * drawn.len() as f64) as usize;
        drawn.get(place.min(drawn.len().saturating_sub(1))).copied()
    };
    Estimate {
        value,
        low: at(TAIL).unwrap_or(value),
        high: at(1.0 - TAIL).unwrap_or(value),
    }
}

/// Spearman's rank correlation with its range, by drawing the points again with replacement (bootstrap). `None`: fewer than [`LEAST`]
/// points, or one side is the same everywhere.
pub(crate) fn rank_correlation(x: &[f64], y: &[f64]) -> Option<Estimate> {
    let n = x.len();
    if n < LEAST {
        return None;
    }
    let all: Vec<usize> = (0..n).collect();
    let (px, py) = (places(x), places(y));
    let value = correlation(&px, &py, &all)?;
    let mut stream = stream();
    let drawn = (0..DRAWS).filter_map(|_| {
        let drawn: Vec<usize> = (0..n).map(|_| below(&mut stream, n)).collect();
        correlation(&px, &py, &drawn)
    });
    Some(range_of(drawn.collect(), value))
}

/// Sobol indices, first and total, of each variable on a grid on which every combination stands once: the part of the response's
/// variance that is due to a variable by itself, and with all that it does together with others. They are exact for the values of the
/// grid, each as likely as the others. `levels`: for each variable the position of each point's value. `None`: the response is the same
/// everywhere.
pub(crate) fn grid_indices(levels: &[&[usize]], y: &[f64]) -> Option<Vec<[f64; 2]>> {
    if is_constant(y) {
        return None;
    }
    let whole = variance(y);
    let by = |key: &dyn Fn(usize) -> Vec<usize>| {
        let mut groups: BTreeMap<Vec<usize>, Vec<f64>> = BTreeMap::new();
        for (i, v) in y.iter().enumerate() {
            groups.entry(key(i)).or_default().push(*v);
        }
        groups
    };
    let one = |v: usize| {
        let means: Vec<f64> = by(&|i| vec![levels[v][i]])
            .values()
            .map(|g| mean(g))
            .collect();
        let others = |i: usize| -> Vec<usize> {
            let others = levels.iter().enumerate().filter(|(w, _)| *w != v);
            others.map(|(_, l)| l[i]).collect()
        };
        let within: Vec<f64> = by(&others).values().map(|g| variance(g)).collect();
        [variance(&means) / whole, mean(&within) / whole]
    };
    Some((0..levels.len()).map(one).collect())
}

/// First-order Sobol index of a variable from a sample whose variables are drawn independently of each other: the part of the response's
/// variance that its first [`WAVES`] cosines over the ranks of the variable have (Plischke, Environmental Modelling and Software 35, 2012),
/// less what as many cosines have of noise. It looks at slow changes alone, so that it holds for samples that are more even than chance as
/// well, of which neighbours are unlike each other. The range is that of random halves of the sample. `None`: fewer than
/// [`LEAST_SAMPLE`] points, or the same response everywhere.
pub(crate) fn first_order(x: &[f64], y: &[f64]) -> Option<Estimate> {
    let n = x.len();
    if n < LEAST_SAMPLE || is_constant(y) {
        return None;
    }
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| x[*a].total_cmp(&x[*b]));
    let sorted: Vec<f64> = order.iter().map(|i| y[*i]).collect();
    let half = n / 2;
    let (value, waves, mut stream) = (of_cosines(&sorted, &cosines(n)), cosines(half), stream());
    let mut places: Vec<usize> = (0..n).collect();
    let drawn = (0..HALVES).map(|_| {
        for k in 0..half {
            let other = k + below(&mut stream, n - k);
            places.swap(k, other);
        }
        let mut chosen = places[..half].to_vec();
        chosen.sort_unstable();
        let part: Vec<f64> = chosen.iter().map(|i| sorted[*i]).collect();
        of_cosines(&part, &waves)
    });
    let drawn: Vec<f64> = drawn.filter(|v| v.is_finite()).collect();
    // A half varies about the whole as the whole does about the truth, but for this factor.
    let deviation = variance(&drawn).sqrt() * (half as f64 / (n - half) as f64).sqrt();
    Some(Estimate {
        value,
        low: value - SPREAD * deviation,
        high: value + SPREAD * deviation,
    })
}

/// The first cosines over `n` places, each of length 1 and at right angles to the others.
fn cosines(n: usize) -> Vec<Vec<f64>> {
    let scale = (2.0 / n as f64).sqrt();
    let at = |k: usize, j: usize| {
        let turn = std::f64::consts::PI * k as f64 * (j as f64 + 0.5) / n as f64;
        scale * turn.cos()
    };
    (1..=WAVES)
        .map(|k| (0..n).map(|j| at(k, j)).collect())
        .collect()
}

/// Of responses in the order of a variable.
fn of_cosines(y: &[f64], cosines: &[Vec<f64>]) -> f64 {
    let n = y.len() as f64;
    let part = |wave: &Vec<f64>| wave.iter().zip(y).map(|(c, v)| c * v).sum::<f64>().powi(2);
    let share = cosines.iter().map(part).sum::<f64>() / (n * variance(y));
    1.0 - (1.0 - share) * (n - 1.0) / (n - 1.0 - WAVES as f64)
}

/// Elementary effects of the variable whose value at each point is `at`, 0 to 1 over its range. `others`: points of one group differ in
/// it alone. `None`: fewer than [`LEAST_PAIRS`] pairs of neighbours.
pub(crate) fn effects(at: &[f64], others: &[usize], y: &[f64]) -> Option<Effects> {
    let mut order: Vec<usize> = (0..y.len()).collect();
    order.sort_by(|a, b| others[*a].cmp(&others[*b]).then(at[*a].total_cmp(&at[*b])));
    let pairs = order.windows(2).filter(|w| others[w[0]] == others[w[1]]);
    let effect = |w: &[usize]| (y[w[1]] - y[w[0]]) / (at[w[1]] - at[w[0]]);
    let all: Vec<f64> = pairs.map(effect).filter(|e| e.is_finite()).collect();
    let n = all.len();
    if n < LEAST_PAIRS {
        return None;
    }
    let sizes: Vec<f64> = all.iter().map(|e| e.abs()).collect();
    let mut stream = stream();
    let drawn =
        (0..DRAWS).map(|_| (0..n).map(|_| sizes[below(&mut stream, n)]).sum::<f64>() / n as f64);
    Some(Effects {
        size: range_of(drawn.collect(), mean(&sizes)),
        deviation: if is_constant(&all) {
            0.0
        } else {
            variance(&all).sqrt()
        },
        pairs: n,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers between 0 and 1, three by three, of another stream than that of the ranges.
    fn sample(n: usize) -> Vec<[f64; 3]> {
        let mut stream = ChaCha8Rng::from_seed([7; 32]);
        let mut one = || f64::from(stream.next_u32()) / 4_294_967_296.0;
        (0..n).map(|_| [one(), one(), one()]).collect()
    }

    fn column(sample: &[[f64; 3]], d: usize) -> Vec<f64> {
        sample.iter().map(|s| s[d]).collect()
    }

    #[test]
    fn a_rank_correlation_is_spearmans_also_with_ties() {
        // Ranks 1 2.5 2.5 4 5 6 7 8 against 2 1 3.5 3.5 5 7 6 8: by hand.
        let x = [1.0, 2.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
        let y = [20.0, 10.0, 30.0, 30.0, 40.0, 60.0, 50.0, 70.0];
        let (a, b) = (
            [1.0f64, 2.5, 2.5, 4.0, 5.0, 6.0, 7.0, 8.0],
            [2.0f64, 1.0, 3.5, 3.5, 5.0, 7.0, 6.0, 8.0],
        );
        let sum = |f: &dyn Fn(usize) -> f64| (0..8).map(f).sum::<f64>();
        let (xx, yy) = (
            sum(&|i| (a[i] - 4.5).powi(2)),
            sum(&|i| (b[i] - 4.5).powi(2)),
        );
        let expected = sum(&|i| (a[i] - 4.5) * (b[i] - 4.5)) / (xx * yy).sqrt();
        let found = rank_correlation(&x, &y).unwrap();
        assert!((found.value - expected).abs() < 1e-14, "{found:?}");
        // Any rising curve is 1, any falling one -1.
        let bent: Vec<f64> = x.iter().map(|v: &f64| -v.exp()).collect();
        assert!((rank_correlation(&x, &bent).unwrap().value + 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_range_holds_the_truth_about_as_often_as_it_says() {
        // Independent variables: the true correlation is 0. Of 200 ranges of 95 % about 190 hold it.
        let mut stream = ChaCha8Rng::from_seed([3; 32]);
        let mut one = || f64::from(stream.next_u32());
        let mut held = 0;
        for _ in 0..200 {
            let x: Vec<f64> = (0..40).map(|_| one()).collect();
            let y: Vec<f64> = (0..40).map(|_| one()).collect();
            let e = rank_correlation(&x, &y).unwrap();
            held += usize::from(e.low <= 0.0 && 0.0 <= e.high);
        }
        assert!((180..=198).contains(&held), "{held} of 200");
    }

    #[test]
    fn too_few_points_or_an_even_response_have_no_sensitivity() {
        let x: Vec<f64> = (0..60).map(f64::from).collect();
        assert_eq!(rank_correlation(&x[..7], &x[..7]), None);
        assert_eq!(rank_correlation(&x, &[2.0; 60]), None);
        assert_eq!(first_order(&x[..49], &x[..49]), None);
        assert_eq!(first_order(&x, &[0.1 + 0.2; 60]), None);
        assert_eq!(grid_indices(&[&[0, 1, 2]], &[0.3; 3]), None);
        assert_eq!(effects(&[0.0, 1.0], &[0, 0], &[1.0, 2.0]), None);
    }

    #[test]
    fn indices_of_a_grid_are_those_of_its_polynomial() {
        // y = 3 a + b + a b on {-1, 1} x {-1, 0, 1}: variances 9, 2/3 and 2/3 of the parts, which are orthogonal.
        let (mut a, mut b, mut y) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..2 {
            for j in 0..3 {
                let (p, q) = (2.0 * i as f64 - 1.0, j as f64 - 1.0);
                a.push(i);
                b.push(j);
                y.push(3.0 * p + q + p * q + 100.0);
            }
        }
        let found = grid_indices(&[&a, &b], &y).unwrap();
        let whole = 9.0 + 4.0 / 3.0;
        let expected = [
            [9.0 / whole, (9.0 + 2.0 / 3.0) / whole],
            [2.0 / 3.0 / whole, 4.0 / 3.0 / whole],
        ];
        for (f, e) in found.iter().flatten().zip(expected.iter().flatten()) {
            assert!((f - e).abs() < 1e-12, "{found:?}");
        }
    }

    #[test]
    fn first_order_indices_of_ishigamis_function_are_found_also_where_no_rank_correlates() {
        use std::f64::consts::PI;
        let sample = sample(2000);
        let at = |u: f64| PI * (2.0 * u - 1.0);
        let ishigami = |s: &[f64; 3]| {
            let [a, b, c] = s.map(at);
            a.sin() + 7.0 * b.sin().powi(2) + 0.1 * c.powi(4) * a.sin()
        };
        let y: Vec<f64> = sample.iter().map(ishigami).collect();
        // Closed form (Ishigami and Homma 1990) for a = 7, b = 0.1.
        for (d, truth) in [0.3139, 0.4424, 0.0].into_iter().enumerate() {
            let e = first_order(&column(&sample, d), &y).unwrap();
            assert!((e.value - truth).abs() < 0.05, "{d}: {e:?}");
            assert!(e.low <= truth && truth <= e.high, "{d}: {e:?}");
            assert!(e.high - e.low < 0.15, "{d}: {e:?}");
        }
        let hump = rank_correlation(&column(&sample, 1), &y).unwrap();
        assert!(hump.low < 0.0 && hump.high > 0.0, "{hump:?}");
    }

    #[test]
    fn first_order_indices_hold_for_a_sample_that_is_more_even_than_chance() {
        // Roberts' sequence, whose neighbours in one variable are far from each other in the others.
        let n = 200;
        let g: f64 = 1.220_744_084_61;
        let at = |d: i32| -> Vec<f64> {
            (0..n)
                .map(|i| (0.5 + f64::from(i + 1) / g.powi(d)).fract())
                .collect()
        };
        let x = [at(1), at(2), at(3)];
        let y: Vec<f64> = (0..n as usize).map(|i| 3.0 * x[0][i] + x[1][i]).collect();
        for (column, truth) in x.iter().zip([0.9, 0.1, 0.0]) {
            let e = first_order(column, &y).unwrap();
            assert!((e.value - truth).abs() < 0.04, "{truth}: {e:?}");
            assert!(e.low <= truth + 0.005 && truth <= e.high, "{truth}: {e:?}");
        }
    }

    #[test]
    fn elementary_effects_of_a_plane_are_its_slopes_over_the_range() {
        // A walk that changes one variable at a time, as Morris' designs do: y = 5 u - 2 v, and 4 u v on top.
        let walk = [
            [0.0, 0.0],
            [0.5, 0.0],
            [0.5, 0.5],
            [1.0, 0.5],
            [1.0, 1.0],
            [0.0, 1.0],
            [0.0, 0.5],
            [0.5, 1.0],
        ];
        let u: Vec<f64> = walk.iter().map(|w| w[0]).collect();
        let rows: Vec<usize> = walk.iter().map(|w| (2.0 * w[1]) as usize).collect();
        let y: Vec<f64> = walk.iter().map(|w| 5.0 * w[0] - 2.0 * w[1]).collect();
        let e = effects(&u, &rows, &y).unwrap();
        assert!(
            (e.size.value - 5.0).abs() < 1e-12 && e.deviation < 1e-12,
            "{e:?}"
        );
        assert_eq!(e.pairs, 5);
        let bent: Vec<f64> = y
            .iter()
            .zip(walk)
            .map(|(y, w)| y + 4.0 * w[0] * w[1])
            .collect();
        let e = effects(&u, &rows, &bent).unwrap();
        assert!(e.deviation > 1.0 && e.size.low < e.size.high, "{e:?}");
    }
}
