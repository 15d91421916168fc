//! The methods, those of the crate `basin`: each is driven with an order of points in place of a cost.
//!
//! Only methods are here that compare and add, multiply and divide: their points have the same bits on every machine (decision 37).

use super::{Along, Asked, Search, key};
use crate::{Problem, Value};
use basin::{
    BoxBounds, ConstraintDescription, ConstraintSet, Constraints, CostFunction, De, DeMutation,
    NelderMead, PopulationProgress, SimplexProgress, Solver,
};
use std::cell::RefCell;
use std::collections::{HashMap, HashSet};

/// Members of a population for each variable, where the number is not given.
pub const DEFAULT_POPULATION: usize = 4;

/// How far the corners of the first simplex lie from its start, as a part of each range.
const FIRST_STEP: f64 = 0.25;

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

impl Way {
    /// The points that it begins with, of the unit cube.
    pub(super) fn begin(self, search: &Search) -> Result<Vec<Vec<f64>>, Problem> {
        let n = search.over.len();
        let start: Vec<f64> = match &search.start {
            Some(values) => {
                let all = search.over.iter().zip(values);
                let found = all.map(|((_, along), v)| along.fraction(v).unwrap_or(0.5));
                found.collect()
            }
            None => vec![0.5; n],
        };
        match self {
            Self::Simplex => {
                let mut all = vec![start.clone()];
                for i in 0..n {
                    let mut corner = start.clone();
                    // A step must lead to another value.
                    let step = match &search.over[i].1 {
                        Along::Range(_) => FIRST_STEP,
                        Along::Steps(v) | Along::Choice(v) => {
                            FIRST_STEP.max(1.0 / v.len() as f64).min(0.5)
                        }
                    };
                    corner[i] += if start[i] <= 0.5 { step } else { -step };
                    all.push(corner);
                }
                Ok(all)
            }
            Self::Evolution { population } => {
                let seed = search.stream("begin") as u32;
                let coordinate = |i: u32, d: u32| f64::from(sobol_burley::sample(i, d, seed));
                let member = |i: u32| (0..n as u32).map(|d| coordinate(i, d)).collect();
                let mut all: Vec<Vec<f64>> = (0..population as u32).map(member).collect();
                if search.start.is_some() {
                    all[0] = start;
                }
                Ok(all)
            }
        }
    }

    /// How many points it asks for at once behind its first ones.
    fn at_once(self) -> usize {
        match self {
            Self::Simplex => 1,
            Self::Evolution { population } => population,
        }
    }

    /// So many points in a row that it has had already mean that it has nothing new to ask.
    fn enough(self, variables: usize) -> usize {
        match self {
            Self::Simplex => 10 * (variables + 2),
            Self::Evolution { population } => 20 * population,
        }
    }
}

/// Why a method is stopped.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{self:?}")]
enum Halt {
    /// It asks for points that have no answer yet.
    Unknown,
    /// It asks only for what it has had.
    Settled,
    /// A value cannot be written.
    Wrong(Problem),
}

/// Answers a method from what is known, and notes what is not.
struct Oracle<'s> {
    search: &'s Search,
    known: HashMap<String, f64>,
    first: usize,
    state: RefCell<State>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

#[derive(Default)]
struct State {
    asked: usize,
    /// Points that the method has had in this replay.
    had: HashSet<String>,
    /// Evaluations in a row without a new point.
    repeated: usize,
    open: Vec<Vec<Value>>,
    open_keys: HashSet<String>,
}

impl Oracle<'_> {
    fn answer(&self, at: &[f64]) -> Result<f64, Halt> {
        let point = self.search.point(at).map_err(Halt::Wrong)?;
        let name = key(&point);
        let mut state = self.state.borrow_mut();
        state.asked += 1;
        let at_once = self.search.way.at_once();
        // Whether with this one a generation is whole: what was asked in it may then run at once.
        let whole =
            (state.asked.checked_sub(self.first)).is_some_and(|n| n.is_multiple_of(at_once));
        let found = self.known.get(&name).copied();
        if state.had.insert(name.clone()) {
            state.repeated = 0;
        } else {
            state.repeated += 1;
        }
        if found.is_none() && state.open_keys.insert(name) {
            state.open.push(point);
        }
        if whole && !state.open.is_empty() {
            return Err(Halt::Unknown);
        }
        if state.repeated > self.search.way.enough(self.search.over.len()) {
            return Err(Halt::Settled);
        }
        // Of a point without an answer nothing is used: the method is stopped before its generation is compared.
        Ok(found.unwrap_or(f64::INFINITY))
    }
}

impl Constraints for Oracle<'_> {
    type Set = ConstraintSet<BoxBounds<Vec<f64>>>;

    fn constraints(&self) -> <Self::Set as ConstraintDescription>::Borrowed<'_> {
        ConstraintSet::new().with_bounds(BoxBounds::new(Some(&self.lower), Some(&self.upper)))
    }
}

impl CostFunction for Oracle<'_> {
    type Param = Vec<f64>;
    type Output = f64;
    type Error = Halt;

    fn cost(&self, at: &Vec<f64>) -> Result<f64, Halt> {
        self.answer(at)
    }
}

/// Lets a method run on what is known until it asks for more.
pub(super) fn next(
    search: &Search,
    begin: Vec<Vec<f64>>,
    known: HashMap<String, f64>,
) -> Result<Asked, Problem> {
    let n = search.over.len();
    let oracle = Oracle {
        search,
        known,
        first: begin.len(),
        state: RefCell::default(),
        lower: vec![0.0; n],
        upper: vec![1.0; n],
    };
    let mut problem = basin::Problem::new(oracle);
    let halt = match search.way {
        Way::Simplex => {
            let method = NelderMead::adaptive().projected();
            drive(method, &mut problem, SimplexProgress::from_simplex(begin))
        }
        Way::Evolution { population } => {
            let method = De::new(search.stream("evolution"))
                .with_pop_size(population)
                .with_mutation(DeMutation::RandToBest1)
                .with_dither(0.5, 1.0);
            let state = PopulationProgress::from_population(begin);
            drive(method, &mut problem, state)
        }
    };
    match halt {
        Halt::Unknown => {
            let state = problem.into_inner().state.into_inner();
            Ok(Asked::Points(state.open))
        }
        Halt::Settled => Ok(Asked::Settled),
        Halt::Wrong(problem) => Err(problem),
    }
}

/// Steps a solver until it is stopped. It has no end of its own here: with an order in place of costs, its tests would mean nothing.
fn drive<'s, M, S>(mut method: M, problem: &mut basin::Problem<Oracle<'s>>, state: S) -> Halt
where
    S: basin::State,
    M: Solver<Oracle<'s>, S, Error = basin::ConstraintSolveError<Halt>>,
{
    let stopped = |e| match e {
        basin::ConstraintSolveError::Evaluation(halt) => halt,
        // Bounds of 0 and 1 and members within them are what every method takes.
        other => Halt::Wrong(Problem::new(other.to_string())),
    };
    let mut state = match method.init(problem, state) {
        Ok(state) => state,
        Err(e) => return stopped(e),
    };
    loop {
        state = match method.next_iter(problem, state) {
            Ok(step) => step.state,
            Err(e) => return stopped(e),
        };
    }
}
