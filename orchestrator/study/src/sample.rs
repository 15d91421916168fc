//! Samples of a region.
//!
//! Every variable has a stream of its own, which its name and the seed choose: a variable more leaves the others' values as they are.
//! `sobol` and `random` go on where a smaller count ended, so that a larger `count` only adds points; `latin-hypercube` and `grid` do
//! not. Streams are ChaCha8 of the crate `chacha20`, Sobol numbers with Owen's scrambling those of `sobol_burley`: whole numbers,
//! the same on every machine.

use crate::points::Table;
use crate::problem::Problem;
use crate::range::{Range, Step, range};
use crate::value::Value;
use chacha20::ChaCha8Rng;
use chacha20::rand_core::{Rng, SeedableRng};

/// How points are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// All combinations of equally many values of each variable.
    Grid,
    /// One value in each of `count` slices of every variable, in random company.
    LatinHypercube,
    /// Scrambled Sobol numbers.
    Sobol,
    /// Independent.
    Random,
}

/// What a variable may be.
#[derive(Debug, Clone, PartialEq)]
pub enum Axis {
    /// Anything between two ends.
    Range(Range),
    /// One of these.
    List(Vec<Value>),
}

/// A sample that is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// How.
    pub method: Method,
    /// How many points.
    pub count: u32,
    /// Chooses the streams.
    pub seed: u64,
    /// The variables.
    pub of: Vec<(String, Axis)>,
}

/// Most points of one sample: Sobol numbers repeat after these.
const MOST: u32 = 1 << 16;

/// The points of a sample.
///
/// # Errors
/// When there are none, too many, or a grid has no such number of points.
pub fn sample(asked: &Sample) -> Result<Table, Problem> {
    if asked.count == 0 || asked.count > MOST {
        return Err(Problem::new(format!("a sample of {} points", asked.count))
            .expected(format!("1 to {MOST} points")));
    }
    if asked.of.is_empty() {
        return Err(
            Problem::new("a sample of no variable").expected("`of: {name: {from: .., to: ..}}`")
        );
    }
    if asked.method == Method::Sobol && asked.of.len() > sobol_burley::NUM_DIMENSIONS as usize {
        return Err(
            Problem::new("more variables than Sobol numbers have dimensions")
                .expected(format!("at most {}", sobol_burley::NUM_DIMENSIONS)),
        );
    }
    if asked.method == Method::Grid {
        return grid(asked);
    }
    let columns = asked.of.iter().enumerate().map(|(d, (name, axis))| {
        let at = fractions(asked, d, name);
        at.into_iter().map(|u| of_axis(axis, u)).collect()
    });
    let columns = columns.collect::<Result<Vec<Vec<Value>>, _>>()?;
    Ok(Table {
        names: asked.of.iter().map(|(name, _)| name.clone()).collect(),
        rows: (0..asked.count as usize)
            .map(|i| columns.iter().map(|c| c[i].clone()).collect())
            .collect(),
    })
}

/// The value at a fraction of an axis, 0 to 1 without 1.
fn of_axis(axis: &Axis, fraction: f64) -> Result<Value, Problem> {
    match axis {
        Axis::Range(r) => r.at(fraction),
        Axis::List(values) => {
            let i = (fraction * values.len() as f64) as usize;
            Ok(values[i.min(values.len() - 1)].clone())
        }
    }
}

/// A stream of random numbers of a variable.
fn stream(asked: &Sample, name: &str) -> ChaCha8Rng {
    let mut hasher = blake3::Hasher::new();
    hasher.update(b"plyflow study stream 1");
    hasher.update(&asked.seed.to_le_bytes());
    hasher.update(name.as_bytes());
    ChaCha8Rng::from_seed(*hasher.finalize().as_bytes())
}

/// A double in [0, 1) from the upper 53 bits.
fn unit(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1u64 << 53) as f64
}

/// The fractions of the way of a variable, point by point.
fn fractions(asked: &Sample, dimension: usize, name: &str) -> Vec<f64> {
    let n = asked.count;
    let mut random = stream(asked, name);
    match asked.method {
        Method::Sobol => {
            // The scrambling takes 32 bits of seed.
            let seed = (asked.seed ^ (asked.seed >> 32)) as u32;
            let dimension = dimension as u32;
            (0..n)
                .map(|i| f64::from(sobol_burley::sample(i, dimension, seed)))
                .collect()
        }
        Method::Random => (0..n).map(|_| unit(random.next_u64())).collect(),
        Method::LatinHypercube | Method::Grid => {
            let mut slices: Vec<u32> = (0..n).collect();
            for i in (1..slices.len()).rev() {
                // Of 64 bits a count below 2^16 takes a part that no bias shows in.
                let j = (u128::from(random.next_u64()) * (i as u128 + 1)) >> 64;
                slices.swap(i, j as usize);
            }
            let within = |s: u32, r: u64| (f64::from(s) + unit(r)) / f64::from(n);
            slices
                .iter()
                .map(|s| within(*s, random.next_u64()))
                .collect()
        }
    }
}

fn grid(asked: &Sample) -> Result<Table, Problem> {
    let dimensions = asked.of.len() as u32;
    let power = |side: u32| side.checked_pow(dimensions);
    let mut side = 1;
    while power(side + 1).is_some_and(|n| n <= asked.count) {
        side += 1;
    }
    if power(side) != Some(asked.count) {
        let near = [power(side), power(side + 1)];
        let near: Vec<String> = near.iter().flatten().map(u32::to_string).collect();
        return Err(Problem::new(format!(
            "a grid of {} variables has no {} points",
            dimensions, asked.count
        ))
        .expected(format!(
            "the same number of values of each: {} points",
            near.join(" or ")
        ))
        .help("for a number of values of each variable of its own, use `vary`"));
    }
    let mut columns = Vec::new();
    for (name, axis) in &asked.of {
        let values = match axis {
            Axis::Range(r) => range(r, &Step::Count(side))?,
            Axis::List(values) if values.len() == side as usize => values.clone(),
            Axis::List(values) => {
                return Err(Problem::new(format!(
                    "`{name}` has {} values, and the grid {side} of each variable",
                    values.len()
                )));
            }
        };
        columns.push((name.clone(), values));
    }
    Table::vary(columns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Quantity;

    fn ask(method: Method, count: u32, seed: u64, names: &[&str]) -> Sample {
        let q = |t: &str| Quantity::read(t).unwrap().unwrap();
        let axis = Axis::Range(Range::new(q("0 deg"), &q("90 deg"), false).unwrap());
        Sample {
            method,
            count,
            seed,
            of: names
                .iter()
                .map(|n| ((*n).to_owned(), axis.clone()))
                .collect(),
        }
    }

    fn texts(s: &Sample) -> Vec<Vec<String>> {
        let table = sample(s).unwrap();
        let row = |r: &Vec<Value>| r.iter().map(Value::text).collect();
        table.rows.iter().map(row).collect()
    }

    #[test]
    fn sobol_and_random_go_on_where_a_smaller_count_ended() {
        for method in [Method::Sobol, Method::Random] {
            let (few, many) = (
                texts(&ask(method, 10, 3, &["a", "b"])),
                texts(&ask(method, 40, 3, &["a", "b"])),
            );
            assert_eq!(few, many[..10], "{method:?}");
            assert_ne!(few, texts(&ask(method, 10, 4, &["a", "b"])), "{method:?}");
        }
    }

    #[test]
    fn a_further_variable_leaves_random_values_as_they_are() {
        let (one, two) = (
            texts(&ask(Method::Random, 5, 1, &["a"])),
            texts(&ask(Method::Random, 5, 1, &["b", "a"])),
        );
        for (x, y) in one.iter().zip(&two) {
            assert_eq!(x[0], y[1]);
        }
    }

    #[test]
    fn the_numbers_are_those_of_every_machine() {
        let first = |m| texts(&ask(m, 3, 7, &["a"])).concat();
        assert_eq!(first(Method::Sobol), SOBOL);
        assert_eq!(first(Method::Random), RANDOM);
        assert_eq!(first(Method::LatinHypercube), LATIN);
    }

    const SOBOL: [&str; 3] = ["61.27899 deg", "2.6092 deg", "73.32394 deg"];
    const RANDOM: [&str; 3] = ["66.61004 deg", "86.08262 deg", "86.09255 deg"];
    const LATIN: [&str; 3] = ["28.69752 deg", "32.05182 deg", "76.86384 deg"];

    #[test]
    fn a_latin_hypercube_has_one_value_in_every_slice() {
        let table = sample(&ask(Method::LatinHypercube, 30, 5, &["a", "b", "c"])).unwrap();
        for d in 0..3 {
            let slice = |r: &Vec<Value>| (r[d].si().unwrap().to_degrees() / 3.0) as usize;
            let mut met: Vec<usize> = table.rows.iter().map(slice).collect();
            met.sort_unstable();
            assert_eq!(met, (0..30).collect::<Vec<_>>());
        }
    }

    #[test]
    fn sobol_numbers_fill_every_box_of_a_net_alike() {
        // 16 points: one in each of the 16 slices of either variable, and in each box of 4 x 4.
        let table = sample(&ask(Method::Sobol, 16, 11, &["a", "b"])).unwrap();
        let at = |r: &Vec<Value>, d: usize, n: f64| {
            (r[d].si().unwrap().to_degrees() / 90.0 * n) as usize
        };
        let boxes: std::collections::BTreeSet<_> = table
            .rows
            .iter()
            .map(|r| (at(r, 0, 4.0), at(r, 1, 4.0)))
            .collect();
        let slices: std::collections::BTreeSet<_> =
            table.rows.iter().map(|r| at(r, 0, 16.0)).collect();
        assert_eq!((boxes.len(), slices.len()), (16, 16));
    }

    #[test]
    fn a_grid_has_the_same_number_of_values_of_each_variable() {
        assert_eq!(
            texts(&ask(Method::Grid, 9, 0, &["a", "b"]))[4],
            ["45 deg", "45 deg"]
        );
        let e = sample(&ask(Method::Grid, 10, 0, &["a", "b"])).unwrap_err();
        assert!(e.expected.unwrap().contains("9 or 16"));
    }
}
