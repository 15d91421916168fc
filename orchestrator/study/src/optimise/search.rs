//! A search: its variables, its method, and where it begins.

use crate::number::Quantity;
use crate::problem::Problem;
use crate::range::Range;
use crate::value::Value;
use chacha20::ChaCha8Rng;
use chacha20::rand_core::{Rng, SeedableRng};
use std::collections::HashSet;

/// Most variables of a search: Sobol numbers, which begin one, have so many dimensions.
pub const MOST_VARIABLES: usize = sobol_burley::NUM_DIMENSIONS as usize;

/// Members of a population for each variable, where the number is not given.
pub const DEFAULT_POPULATION: usize = 4;

/// How far the corners of the first simplex lie from its start, as a part of each range.
const FIRST_STEP: f64 = 0.25;

/// What a variable may be. Quantities of one variable have one unit.
#[derive(Debug, Clone, PartialEq)]
pub enum Along {
    /// Anything between two ends.
    Range(Range),
    /// One of these, which have an order.
    Steps(Vec<Value>),
    /// One of these, without an order.
    Choice(Vec<Value>),
}

impl Along {
    /// The value at a fraction of the way, 0 to 1.
    fn at(&self, fraction: f64) -> Result<Value, Problem> {
        match self {
            Self::Range(r) => r.at(fraction),
            Self::Steps(values) | Self::Choice(values) => {
                let i = (fraction * values.len() as f64) as usize;
                Ok(values[i.min(values.len() - 1)].clone())
            }
        }
    }

    /// Whether it is a value of this variable.
    #[must_use]
    pub fn holds(&self, value: &Value) -> bool {
        self.fraction(value).is_some()
    }

    /// The fraction of the way at which a value lies; `None`: it is no value of this variable.
    fn fraction(&self, value: &Value) -> Option<f64> {
        match self {
            Self::Range(r) => r.fraction(value),
            Self::Steps(values) | Self::Choice(values) => {
                let i = values.iter().position(|v| v == value)?;
                Some((i as f64 + 0.5) / values.len() as f64)
            }
        }
    }
}

/// A method.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// The simplex of Nelder and Mead, kept within the ranges: local, one point after the other.
    Simplex,
    /// Differential evolution of a population: global, a generation at once.
    Evolution {
        /// Members of the population, at least 4.
        population: usize,
    },
}

/// A search.
#[derive(Debug, Clone, PartialEq)]
pub struct Search {
    /// The variables.
    pub over: Vec<(String, Along)>,
    /// The method.
    pub way: Way,
    /// Chooses its random numbers.
    pub seed: u64,
    /// Where it begins, a value for each variable; the middle where it is not given.
    pub start: Option<Vec<Value>>,
}

impl Search {
    /// Checks that the method can go over the variables.
    ///
    /// # Errors
    /// When there are none or too many, a choice for a method that needs an order, or a start outside.
    pub fn check(&self) -> Result<(), Problem> {
        if self.over.is_empty() || self.over.len() > MOST_VARIABLES {
            let n = self.over.len();
            return Err(Problem::new(format!("a search over {n} variables"))
                .expected(format!("1 to {MOST_VARIABLES} variables")));
        }
        if matches!(self.way, Way::Simplex)
            && let Some((name, _)) = self.over.iter().find(|o| matches!(o.1, Along::Choice(_)))
        {
            return Err(Problem::new(format!(
                "`{name}` is a choice, and `simplex` needs variables with an order"
            ))
            .help("use `method: evolution`, or a study with one optimisation for each choice"));
        }
        for (i, (name, along)) in self.over.iter().enumerate() {
            if let Some(start) = &self.start
                && along.fraction(&start[i]).is_none()
            {
                let text = start[i].text();
                return Err(Problem::new(format!("`{name}` cannot begin at `{text}`"))
                    .expected("one of its values"));
            }
            along.at(0.0)?;
            along.at(1.0)?;
        }
        Ok(())
    }

    /// The points that its method begins with, of the unit cube.
    pub(super) fn begin(&self) -> Vec<Vec<f64>> {
        let n = self.over.len();
        let start: Vec<f64> = match &self.start {
            Some(values) => {
                let all = self.over.iter().zip(values);
                let found = all.map(|((_, along), v)| along.fraction(v).unwrap_or(0.5));
                found.collect()
            }
            None => vec![0.5; n],
        };
        match self.way {
            Way::Simplex => {
                let mut all = vec![start.clone()];
                for i in 0..n {
                    let mut corner = start.clone();
                    // A step must lead to another value.
                    let step = match &self.over[i].1 {
                        Along::Range(_) => FIRST_STEP,
                        Along::Steps(v) | Along::Choice(v) => {
                            FIRST_STEP.max(1.0 / v.len() as f64).min(0.5)
                        }
                    };
                    corner[i] += if start[i] <= 0.5 { step } else { -step };
                    all.push(corner);
                }
                all
            }
            Way::Evolution { population } => {
                let seed = self.stream("begin") as u32;
                let coordinate = |i: u32, d: u32| f64::from(sobol_burley::sample(i, d, seed));
                let member = |i: u32| (0..n as u32).map(|d| coordinate(i, d)).collect();
                let mut all: Vec<Vec<f64>> = (0..population as u32).map(member).collect();
                if self.start.is_some() {
                    all[0] = start;
                }
                all
            }
        }
    }

    /// A point from the texts of its values; `None`: it is none of this search.
    #[must_use]
    pub fn read(&self, texts: &[String]) -> Option<Vec<Value>> {
        let one = |(along, text): (&Along, &String)| match along {
            Along::Range(_) => {
                let value = Value::Quantity(Quantity::read(text)?.ok()?);
                along.fraction(&value).map(|_| value)
            }
            Along::Steps(values) | Along::Choice(values) => {
                values.iter().find(|v| v.text() == *text).cloned()
            }
        };
        let all = self.over.iter().map(|o| &o.1).zip(texts);
        let point: Vec<Value> = all.map(one).collect::<Option<_>>()?;
        (point.len() == self.over.len() && texts.len() == point.len()).then_some(point)
    }

    /// A point of the unit cube in values.
    pub(super) fn point(&self, at: &[f64]) -> Result<Vec<Value>, Problem> {
        let one = |(along, u): (&Along, &f64)| along.at(*u);
        self.over.iter().map(|o| &o.1).zip(at).map(one).collect()
    }

    /// A stream of random numbers of a purpose.
    pub(super) fn stream(&self, purpose: &str) -> u64 {
        let mut hasher = blake3::Hasher::new();
        hasher.update(b"plyflow optimisation stream 1");
        hasher.update(&self.seed.to_le_bytes());
        hasher.update(purpose.as_bytes());
        ChaCha8Rng::from_seed(*hasher.finalize().as_bytes()).next_u64()
    }
}

/// A text that only this point has.
pub(super) fn key(point: &[Value]) -> String {
    point
        .iter()
        .map(Value::text)
        .collect::<Vec<_>>()
        .join("\u{1f}")
}

/// How many different points of a search there are among some of the unit cube.
pub(super) fn distinct(search: &Search, all: &[Vec<f64>]) -> Result<usize, Problem> {
    let mut keys = HashSet::new();
    for at in all {
        keys.insert(key(&search.point(at)?));
    }
    Ok(keys.len())
}
