//! Optimisation by ask and tell: a method asks for points, is told what became of them, and asks for more.
//!
//! What a method asks for is a function of the search and of what has been told, and of nothing else: no time, no number of threads, and no
//! state that would have to be kept. A method is begun anew each time and sees the same answers in the same order, until it asks for a
//! point that has none ([`Search::ask`]). So a search that was stopped anywhere goes on, and one with a larger budget goes on where the smaller
//! one ended.
//!
//! A method never sees a number of a result. It is told the *order* of the points ([`rank`]): a point that has failed is behind all others,
//! whatever their numbers; one that breaks a constraint is behind all that break none.

mod method;
mod rank;
mod search;
mod trace;

pub use method::Asked;
pub use rank::{Outcome, Told};
pub use search::{Along, DEFAULT_POPULATION, MOST_VARIABLES, Search, Way};
pub use trace::{Entry, best, trace};

#[cfg(test)]
#[path = "optimise/tests.rs"]
mod tests;
