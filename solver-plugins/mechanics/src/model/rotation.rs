//! Rotations of the nodes, only for models with a sheet whose nodes have six degrees of freedom.
//!
//! Every node carries a spin (global axes) and an isotropic rotary inertia, so that there is no
//! gyroscopic term: `I dw/dt = moment`. Elements turn their own directors by the spin; the model keeps
//! no orientation.

use super::*;

/// Rotational state; per-node arrays in the model's numbering.
pub(super) struct Rotations {
    /// `[n]` spins at the half step (rad/s).
    pub(super) spin: Vec<V>,
    /// `[n]` rotary inertias (kg m2); 0: the node does not rotate.
    pub(super) inertia: Vec<f64>,
    /// `[n]` moments of the elements (N m).
    moment: Vec<V>,
}

impl Rotations {
    pub(super) fn new(n: usize) -> Self {
        Self {
            spin: vec![[0.0; 3]; n],
            inertia: vec![0.0; n],
            moment: vec![[0.0; 3]; n],
        }
    }
}

impl Model {
    /// `[n]` spins (rad/s) at the half step; `None` when no sheet's nodes rotate.
    pub fn spins(&self) -> Option<&[V]> {
        self.rotations.as_deref().map(|r| r.spin.as_slice())
    }

    /// Sums the moments; spins of the next half step; their kinetic energy and works. Uses the same central
    /// differences and the same mass-proportional damping as the translations.
    pub(super) fn rotate(&mut self) {
        let Some(r) = self.rotations.as_deref_mut() else {
            return;
        };
        let turning = Turning {
            dt: self.dt,
            damping: self.settings.damping,
            kick: self.kick,
            inertia: &r.inertia,
            fixed: &self.supports.fixed,
            loads: &self.loads.moment,
            load_factor: self.load_factor,
        };
        let sums = &self.sums;
        let nodes_held = &self.held;
        let works: Vec<NodeWork> = r
            .spin
            .par_chunks_mut(NODE_CHUNK)
            .zip_eq(r.moment.par_chunks_mut(NODE_CHUNK))
            .enumerate()
            .map(|(chunk, (spins, moments))| {
                let mut work = NodeWork::default();
                moments.fill([0.0; 3]);
                sums.collect(&sums.moment, chunk, moments);
                for (i, (spin, moment)) in spins.iter_mut().zip(moments).enumerate() {
                    let n = chunk * NODE_CHUNK + i;
                    if turning.inertia[n] > 0.0 && nodes_held[n] == Held::Free {
                        *spin = turning.free(n, *spin, *moment, &mut work);
                    }
                }
                work
            })
            .collect();
        let mut work = works.into_iter().fold(NodeWork::default(), NodeWork::add);
        let middle = self.time + 0.5 * self.dt;
        for (k, n) in self.driven.iter().enumerate() {
            let n = *n as usize;
            if turning.inertia[n] <= 0.0 {
                continue;
            }
            let (old, moment) = (r.spin[n], r.moment[n]);
            r.spin[n] = match self.drive.as_ref().and_then(|d| d.spin(k, middle)) {
                None => turning.free(n, old, moment, &mut work),
                Some(next) => {
                    let mean = scale(add(next, old), 0.5);
                    let inertia = scale(sub(next, old), turning.inertia[n] / turning.dt);
                    let support = sub(inertia, moment);
                    self.ledger.external += dot(support, mean) * turning.dt;
                    self.supports.reaction_moment[k] = sub(support, turning.load(n));
                    work.count(turning.inertia[n], n, next);
                    next
                }
            };
        }
        self.work = self.work.add(work);
    }
}

/// What turns the nodes in a step.
struct Turning<'a> {
    dt: f64,
    damping: f64,
    kick: f64,
    inertia: &'a [f64],
    fixed: &'a [Fixed],
    loads: &'a [V],
    load_factor: f64,
}

impl Turning<'_> {
    #[inline(always)]
    fn load(&self, n: usize) -> V {
        let load = |m: &V| scale(*m, self.load_factor);
        self.loads.get(n).map_or([0.0; 3], load)
    }

    /// The next spin of a node that `moment` and its load turn.
    #[inline(always)]
    fn free(&self, n: usize, old: V, moment: V, work: &mut NodeWork) -> V {
        let (dt, alpha) = (self.dt, self.damping);
        let (lo, hi) = (1.0 / dt - 0.5 * alpha, 1.0 / (1.0 / dt + 0.5 * alpha));
        let load = self.load(n);
        let per_inertia = self.kick / self.inertia[n];
        let mut w: V =
            std::array::from_fn(|c| (lo * old[c] + per_inertia * (moment[c] + load[c])) * hi);
        if let Some(f) = self.fixed.get(n) {
            w = f.rotation(w);
        }
        let mean = scale(add(w, old), 0.5);
        work.external += dot(load, mean) * dt;
        work.damping += alpha * self.inertia[n] * dot(mean, mean) * dt;
        work.count(self.inertia[n], n, w);
        w
    }
}
