//! Closed cycles of strain or curvature: what a law takes, it may not give back twice.

use crate::run::{Seen, worse};

/// Steps of a cycle.
const STEPS: usize = 2000;

/// What came of some cycles, over the largest energy in each.
#[derive(Default)]
pub(crate) struct Cycles {
    count: usize,
    /// The largest gain of energy over a whole cycle.
    gain: f64,
    /// The largest difference of the work done from the energy reported.
    apart: f64,
}

impl Cycles {
    /// Leads `lanes` lanes along `at(t)` with t from 0 to 2 pi, closed. `call` gives stresses `[3][lanes]` and energies
    /// `[lanes]`; `weights`: the work of a stress on the change of its component.
    pub(crate) fn lead(
        &mut self,
        lanes: usize,
        weights: [f64; 3],
        at: impl Fn(f64) -> Vec<f64>,
        mut call: impl FnMut(&[f64]) -> (Vec<f64>, Vec<f64>),
    ) {
        let mut before = at(0.0);
        let mut old = call(&before).0;
        let (mut work, mut peak) = (vec![0.0; lanes], vec![f64::MIN_POSITIVE; lanes]);
        let mut off = vec![0.0f64; lanes];
        for i in 1..=STEPS {
            let now = at(std::f64::consts::TAU * i as f64 / STEPS as f64);
            let (new, energy) = call(&now);
            for l in 0..lanes {
                for (row, weight) in weights.iter().enumerate() {
                    let j = row * lanes + l;
                    work[l] += weight * 0.5 * (old[j] + new[j]) * (now[j] - before[j]);
                }
                peak[l] = f64::max(peak[l], energy[l].abs());
                let apart = (work[l] - energy[l]).abs();
                if worse(apart, off[l]) {
                    off[l] = apart;
                }
            }
            (before, old) = (now, new);
        }
        self.count += lanes;
        for l in 0..lanes {
            let (gain, apart) = (-work[l] / peak[l], off[l] / peak[l]);
            if worse(gain, self.gain) {
                self.gain = gain;
            }
            if worse(apart, self.apart) {
                self.apart = apart;
            }
        }
    }

    /// The verdict; `range`: how far the cycles went.
    pub(crate) fn seen(&self, range: &str) -> Seen {
        Seen::Number {
            measured: if worse(self.gain, self.apart) {
                self.gain
            } else {
                self.apart
            },
            limit: 1e-2,
            what: format!(
                "over {} closed cycles ({range}) the sheet gave back at most {:.1e} of the peak energy more than was \
                 put in; work and energy differ by {:.1e}",
                self.count,
                if self.gain < 0.0 { 0.0 } else { self.gain },
                self.apart
            ),
        }
    }
}
