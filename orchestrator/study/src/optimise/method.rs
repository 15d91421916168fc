//! The methods, those of the crate `basin`: each is driven with an order of points in place of a cost.
//!
//! Only methods are here that compare and add, multiply and divide: their points have the same bits on every machine (decision 37).

use super::rank::{Told, ranks};
use super::search::{Search, Way, distinct, key};
use crate::problem::Problem;
use crate::value::Value;
use basin::{
    BoxBounds, ConstraintDescription, ConstraintSet, Constraints, CostFunction, De, DeMutation,
    NelderMead, PopulationProgress, SimplexProgress, Solver,
};
use std::cell::RefCell;
use std::collections::{HashMap, HashSet};

/// What a method wants next.
#[derive(Debug, Clone, PartialEq)]
pub enum Asked {
    /// These points, which may run at once.
    Points(Vec<Vec<Value>>),
    /// Nothing: it asks only for points that it has had.
    Settled,
}

impl Search {
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
        let begin = self.begin();
        let first = distinct(self, &begin)?;
        let ranks = ranks(told, first);
        let known = told.iter().zip(ranks);
        let known: HashMap<String, f64> = known.map(|(t, rank)| (key(&t.point), rank)).collect();
        next(self, begin, known)
    }
}

impl Way {
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
fn next(
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
