//! Friction against its closed forms: a belt around a drum, a block on an incline, a sheet that is pulled out of a stack.
//!
//! - [`belt`]: a belt that slides over a drum pulls `exp(mu a)` times as hard as it is held, over an arc of `a` (Euler and Eytelwein).
//! - [`block`]: a block on a plane that is inclined by `a` stays where `tan a < mu`, and slides with the acceleration
//!   `g (sin a - mu cos a)` otherwise (Coulomb).
//! - [`stack`]: a sheet between two under the pressure `p` on the area `A` is held by `2 mu p A`, half of it by each face.
//!
//! They are computed with the contacts that forming uses: nodes on a rigid surface, and nodes on the elements of another sheet.

mod belt;
mod block;
mod sliding;
mod stack;

use crate::run::with_threads;
use plyflow_sdk::{Host, Step, StepError};
use sliding::{Case, Parameters};

/// The step plugin `coupon-friction`.
pub struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = include_str!("manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        with_threads(host, || test(host, p))
    }
}

fn test(host: &Host, mut p: Parameters) -> Result<(), StepError> {
    if p.case == Case::Incline {
        // It is a motion, and meant to be one: there is no kinetic energy that would be too large.
        p.common.kinetic_bound = f64::INFINITY;
    }
    match p.case {
        Case::Capstan => belt::test(host, &p),
        Case::Incline => block::test(host, &p),
        Case::Stack => stack::test(host, &p),
    }
}
