//! A material under test: every call goes through guarded buffers.

use crate::breaches::{Ask, Breaches, DT, Refusal};
use crate::buffer::Guarded;
use crate::meeting::{CALLS, Counter, same};
use crate::run::Seen;
use crate::sequence::Sequence;
use plyflow_fixed::FixedBits;
use plyflow_sdk::abi::*;
use std::ffi::c_void;

/// Lanes of the sets that a law is judged on.
pub(crate) const LANES: usize = 16;
/// Strain of the states where the calls as such are looked at.
pub(crate) const STRAIN: f64 = 0.02;

/// A material under test.
pub(crate) struct Law {
    functions: *const pf_material_functions,
    instance: *mut c_void,
    pub(crate) sizes: pf_material_sizes,
}

// SAFETY: plyflow.h asks of an instance that several threads may call it at once. That is what is tested: one that breaks it may break the process,
// which is there for the plugin under test.
unsafe impl Sync for Law {}
// SAFETY: as for `Sync`.
unsafe impl Send for Law {}

impl Drop for Law {
    fn drop(&mut self) {
        // SAFETY: made by this table's `create`, ended once; the table is valid as long as the law lives (`create`).
        unsafe { ((*self.functions).destroy)(self.instance) };
    }
}

/// What a membrane call gave.
#[derive(Clone, Debug)]
pub(crate) struct Answer {
    /// `[3][lanes]`
    pub(crate) stress: Vec<f64>,
    /// `[lanes]`
    pub(crate) energy: Vec<f64>,
    /// `[2][lanes]`; empty when not asked for.
    pub(crate) stiffness: Vec<f64>,
    pub(crate) breaches: Breaches,
}

impl Law {
    /// Makes an instance and reads its sizes.
    ///
    /// # Safety
    /// `functions` must be a whole table, valid as long as the law lives. What its functions do with what they are given is under test: it may be more
    /// than plyflow.h allows, within the guard zones of [`Guarded`].
    pub(crate) unsafe fn create(
        functions: *const pf_material_functions,
        parameters: &str,
    ) -> Result<Self, Refusal> {
        let text = pf_str::new(parameters);
        // SAFETY: a valid table (the caller's promise), a text, and room for the instance and the error that `or_instance` has.
        let create = |new, error| unsafe { ((*functions).create)(text, new, error) };
        let instance = Refusal::or_instance(create)?;
        let mut new = Self {
            functions,
            instance,
            sizes: pf_material_sizes::default(),
        };
        // SAFETY: the instance that the table has just made; a whole struct, as its `size` says.
        let code = unsafe { ((*functions).sizes)(instance, &raw mut new.sizes) };
        if code != PF_OK {
            return Err(Refusal::Broken(format!("sizes returned {code}")));
        }
        Ok(new)
    }

    pub(crate) fn bends(&self) -> bool {
        self.sizes.has_bending != 0
    }

    pub(crate) fn functions(&self) -> &pf_material_functions {
        // SAFETY: valid as long as the law lives (`create`).
        unsafe { &*self.functions }
    }

    pub(crate) fn instance(&self) -> *const c_void {
        self.instance
    }

    pub(crate) fn start(&self, lanes: usize) -> Guarded {
        Guarded::zeros(self.sizes.membrane_history as usize * lanes)
    }

    /// Calls membrane; the history advances.
    pub(crate) fn membrane(&self, history: &mut Guarded, metric: &[f64], ask: Ask) -> Answer {
        self.membrane_after(DT, history, metric, ask)
    }

    /// Calls membrane with another time since the previous call.
    pub(crate) fn membrane_after(
        &self,
        dt: f64,
        history: &mut Guarded,
        metric: &[f64],
        ask: Ask,
    ) -> Answer {
        let lanes = metric.len() / 3;
        let mut c = Guarded::of(metric);
        let mut stress = Guarded::poisoned(3 * lanes);
        let mut energy = Guarded::poisoned(lanes);
        let mut stiffness = Guarded::poisoned(if ask.bound { 2 * lanes } else { 0 });
        let batch = pf_membrane_batch {
            size: size_of::<pf_membrane_batch>() as u64,
            lanes: lanes as u32,
            reserved: 0,
            dt,
            metric: c.pointer(),
            history: history.pointer(),
            stress: stress.pointer(),
            energy: energy.pointer(),
            stiffness: if ask.bound {
                stiffness.pointer()
            } else {
                std::ptr::null_mut()
            },
        };
        // SAFETY: this table's instance, and a batch with the guarded buffers that plyflow.h asks of this call, of the lengths for its sizes.
        let code = unsafe { (self.functions().membrane)(self.instance, &raw const batch) };
        let mut b = Breaches::default();
        let call = "membrane";
        b.status(call, code);
        b.unchanged(call, "metric", &c, metric);
        b.zones(call, "history", history);
        b.output(call, "stress", &stress, lanes);
        b.output(call, "energy", &energy, lanes);
        b.output(call, "stiffness", &stiffness, lanes);
        Answer {
            stress: stress.slice().to_vec(),
            energy: energy.slice().to_vec(),
            stiffness: stiffness.slice().to_vec(),
            breaches: b,
        }
    }

    /// Calls membrane [`CALLS`] times from the same history with as little around the calls as can be, so that calls of
    /// several threads meet, through the `counter` of all; how many differ from the history and the answer that one thread got.
    pub(crate) fn hammer(
        &self,
        (history, metric): (&Guarded, &[f64]),
        ask: Ask,
        (after, want): &(Guarded, Answer),
        counter: &Counter<'_>,
    ) -> usize {
        let lanes = metric.len() / 3;
        let (mut c, mut now) = (Guarded::of(metric), history.clone());
        let (mut stress, mut energy) = (Guarded::zeros(3 * lanes), Guarded::zeros(lanes));
        let mut stiffness = Guarded::zeros(want.stiffness.len());
        let batch = pf_membrane_batch {
            size: size_of::<pf_membrane_batch>() as u64,
            lanes: lanes as u32,
            reserved: 0,
            dt: DT,
            metric: c.pointer(),
            history: now.pointer(),
            stress: stress.pointer(),
            energy: energy.pointer(),
            stiffness: if ask.bound {
                stiffness.pointer()
            } else {
                std::ptr::null_mut()
            },
        };
        let membrane = self.functions().membrane;
        (0..CALLS)
            .filter(|_| {
                now.slice_mut().copy_from_slice(history.slice());
                // SAFETY: as in `membrane`, with buffers of this thread's own.
                let code = counter.during(|| unsafe { membrane(self.instance, &raw const batch) });
                let outputs = [
                    (&stress, &want.stress[..]),
                    (&energy, &want.energy),
                    (&stiffness, &want.stiffness),
                    (&now, after.slice()),
                ];
                code != PF_OK || outputs.iter().any(|(got, want)| !same(got.slice(), want))
            })
            .count()
    }
}

/// C11, C22, C12 of a random deformation of about `size`.
pub(crate) fn metrics(lanes: usize, size: f64, seed: u64) -> Vec<f64> {
    let mut s = Sequence(seed);
    let mut metric = vec![0.0; 3 * lanes];
    for l in 0..lanes {
        let f = [1.0 + size * s.next(), size * s.next()];
        let g = [size * s.next(), 1.0 + size * s.next()];
        metric[l] = f[0] * f[0] + g[0] * g[0];
        metric[lanes + l] = f[1] * f[1] + g[1] * g[1];
        metric[2 * lanes + l] = f[0] * f[1] + g[0] * g[1];
    }
    metric
}

pub(crate) fn undeformed(lanes: usize) -> Vec<f64> {
    (0..3 * lanes)
        .map(|i| if i < 2 * lanes { 1.0 } else { 0.0 })
        .collect()
}

/// Trellis shear: the fibres keep their lengths, and the angle between them changes by 10 to 60 degrees to either side.
/// None of them is a round number, at which a table would have a point.
pub(crate) fn trellis(lanes: usize) -> Vec<f64> {
    let mut metric = undeformed(lanes);
    let pairs = (lanes / 2).max(2) - 1;
    for l in 0..lanes {
        let sign = if l % 2 == 0 { 1.0 } else { -1.0 };
        let degrees: f64 = 10.3 + 49.4 * (l / 2) as f64 / pairs as f64;
        metric[2 * lanes + l] = sign * degrees.to_radians().fixed_sin();
    }
    metric
}

pub(crate) fn size(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, v| v.abs().max(m))
}

/// To divide by.
pub(crate) fn largest(values: &[f64]) -> f64 {
    size(values).max(f64::MIN_POSITIVE)
}

/// Whether a call with dt = 0 is answered: in finite numbers, and where it makes no difference whether a step takes a
/// microsecond or a millisecond, as these are. `answer`: what was seen in a call at rest with dt = 0 and in a step from there
/// that takes so long, and the outputs of that step.
pub(crate) fn zero_dt(answer: impl Fn(f64) -> (Breaches, Breaches, Vec<Vec<f64>>)) -> Seen {
    const SAME: f64 = 1e-9;
    let after = |dt: f64| {
        let (at_rest, step, outputs) = answer(dt);
        match (at_rest.any(), step.any()) {
            (Some(text), _) => Err(format!("at rest with dt = 0: {text}")),
            (_, Some(text)) => Err(format!("with dt = {dt} s: {text}")),
            _ => Ok(outputs),
        }
    };
    let (short, long, none) = match (after(DT), after(1e-3), after(0.0)) {
        (Ok(short), Ok(long), Ok(none)) => (short, long, none),
        (Err(text), ..) | (_, Err(text), _) | (.., Err(text)) => return Seen::Bad(text),
    };
    let apart = |a: &[Vec<f64>], b: &[Vec<f64>]| {
        a.iter().zip(b).fold(0.0f64, |worst, (a, b)| {
            let off = a.iter().zip(b).map(|(a, b)| (a - b).abs());
            worst.max(off.fold(0.0, f64::max) / largest(a))
        })
    };
    let rates = apart(&short, &long);
    if rates > SAME {
        return Seen::Well(format!(
            "finite; this law depends on dt ({rates:.1e} between steps of 1 us and 1 ms), and all other checks are those \
             of steps of 1 us"
        ));
    }
    let differ = apart(&short, &none);
    Seen::Number {
        measured: differ,
        limit: SAME,
        what: format!("steps of 1 us and 1 ms agree; a step of dt = 0 differs by {differ:.1e}"),
    }
}
