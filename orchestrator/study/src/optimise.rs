//! Optimisation by ask and tell: a method asks for points, is told what became of them, and asks for more.
//!
//! What a method asks for is a function of the search and of what has been told, and of nothing else: no time, no number of threads, and no
//! state that would have to be kept. A method is begun anew each time and sees the same answers in the same order, until it asks for a
//! point that has none ([`ask`]). So a search that was stopped anywhere goes on, and one with a larger budget goes on where the smaller
//! one ended.
//!
//! A method never sees a number of a result. It is told the *order* of the points ([`rank`]): a point that has failed is behind all others,
//! whatever their numbers; one that breaks a constraint is behind all that break none.

mod method;
mod rank;
mod trace;

pub use method::{DEFAULT_POPULATION, Way};
pub use rank::{Outcome, Told};
pub use trace::{Entry, best, trace};

use crate::{Problem, Range, Value};
use chacha20::ChaCha8Rng;
use chacha20::rand_core::{Rng, SeedableRng};
use std::collections::HashMap;

/// Most variables of a search: Sobol numbers, which begin one, have so many dimensions.
pub const MOST_VARIABLES: usize = sobol_burley::NUM_DIMENSIONS as usize;

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

/// What a method wants next.
#[derive(Debug, Clone, PartialEq)]
pub enum Asked {
    /// These points, which may run at once.
    Points(Vec<Vec<Value>>),
    /// Nothing: it asks only for points that it has had.
    Settled,
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

    /// The first points that the method asks for.
    ///
    /// # Errors
    /// When a value has too many digits.
    pub fn first(&self) -> Result<Vec<Vec<Value>>, Problem> {
        Ok(match self.ask(&[])? {
            Asked::Points(points) => points,
            Asked::Settled => Vec::new(),
        })
    }

    /// What the method asks for, where it has been told this, in the order in which it asked.
    ///
    /// # Errors
    /// When a value has too many digits.
    pub fn ask(&self, told: &[Told]) -> Result<Asked, Problem> {
        let begin = self.way.begin(self)?;
        let first = distinct(self, &begin)?;
        let ranks = rank::ranks(told, first);
        let known = told.iter().zip(ranks);
        let known: HashMap<String, f64> = known.map(|(t, rank)| (key(&t.point), rank)).collect();
        method::next(self, begin, known)
    }

    /// A point from the texts of its values; `None`: it is none of this search.
    #[must_use]
    pub fn read(&self, texts: &[String]) -> Option<Vec<Value>> {
        let one = |(along, text): (&Along, &String)| match along {
            Along::Range(_) => {
                let value = Value::Quantity(crate::Quantity::read(text)?.ok()?);
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
    fn point(&self, at: &[f64]) -> Result<Vec<Value>, Problem> {
        let one = |(along, u): (&Along, &f64)| along.at(*u);
        self.over.iter().map(|o| &o.1).zip(at).map(one).collect()
    }

    /// A stream of random numbers of a purpose.
    fn stream(&self, purpose: &str) -> u64 {
        let mut hasher = blake3::Hasher::new();
        hasher.update(b"plyflow optimisation stream 1");
        hasher.update(&self.seed.to_le_bytes());
        hasher.update(purpose.as_bytes());
        ChaCha8Rng::from_seed(*hasher.finalize().as_bytes()).next_u64()
    }
}

/// A text that only this point has.
fn key(point: &[Value]) -> String {
    point
        .iter()
        .map(Value::text)
        .collect::<Vec<_>>()
        .join("\u{1f}")
}

/// How many different points of a search there are among some of the unit cube.
fn distinct(search: &Search, all: &[Vec<f64>]) -> Result<usize, Problem> {
    let mut keys = std::collections::HashSet::new();
    for at in all {
        keys.insert(key(&search.point(at)?));
    }
    Ok(keys.len())
}

#[cfg(test)]
#[path = "optimise/tests.rs"]
mod tests;
