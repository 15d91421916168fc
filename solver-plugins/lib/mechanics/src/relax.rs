//! Static equilibrium by explicit steps with kinetic damping: whenever the kinetic energy has passed a
//! peak, all nodes are stopped (Cundall). Needs no damping constant, and the answer is the static one
//! because nothing moves in it.

use crate::MechanicsError;
use crate::model::Model;

/// When a state counts as static.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerance {
    /// Forces out of balance over the loads (root sums of squares).
    pub balance: f64,
    /// Share of the critical step that is used.
    pub safety: f64,
    /// Most steps.
    pub cycles: u64,
}

/// How a relaxation went.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relaxed {
    /// Whether the forces are balanced.
    pub balanced: bool,
    /// Forces out of balance over the loads at the end; over nothing when there are no loads.
    pub residual: f64,
    /// Steps done.
    pub cycles: u64,
    /// Peaks of kinetic energy.
    pub peaks: u64,
}

/// Steps between two looks at the balance.
const LOOK: u64 = 50;
/// Steps between two looks at the critical step.
const CRITICAL: u64 = 1000;

/// Steps until the forces balance or `tolerance.cycles` are done. `every` is called at each look; its error
/// stops the relaxation. Loads must not change meanwhile. Moments count as balanced when the forces are.
///
/// # Errors
/// When the model becomes unstable, a component fails, or `every` says so.
pub fn relax<E: From<MechanicsError>>(
    model: &mut Model,
    tolerance: Tolerance,
    mut every: impl FnMut(&Model) -> Result<(), E>,
) -> Result<Relaxed, E> {
    let begin = model.cycle();
    let mut before = 0.0;
    let mut peaks = 0;
    model.halt();
    loop {
        let done = model.cycle() - begin;
        if done.is_multiple_of(CRITICAL) {
            model.set_step(tolerance.safety * model.critical_step()?);
        }
        model.step(false)?;
        let kinetic = model.kinetic();
        if kinetic < before {
            model.halt();
            peaks += 1;
            before = 0.0;
        } else {
            before = kinetic;
        }
        if (done + 1).is_multiple_of(LOOK) {
            every(model)?;
            let (rest, load) = model.out_of_balance();
            let residual = if load > 0.0 { rest / load } else { rest };
            let balanced = residual < tolerance.balance && peaks > 0;
            if balanced || done + 1 >= tolerance.cycles {
                return Ok(Relaxed {
                    balanced,
                    residual,
                    cycles: done + 1,
                    peaks,
                });
            }
        }
    }
}
