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
    /// `[n]` moments (N m).
    moment: Vec<V>,
    /// `[n]` the part of them that is a load.
    external: Vec<V>,
}

impl Rotations {
    pub(super) fn new(n: usize) -> Self {
        Self {
            spin: vec![[0.0; 3]; n],
            inertia: vec![0.0; n],
            moment: vec![[0.0; 3]; n],
            external: vec![[0.0; 3]; n],
        }
    }
}

impl Model {
    /// `[n]` spins (rad/s) at the half step; `None` when no sheet's nodes rotate.
    pub fn spins(&self) -> Option<&[V]> {
        self.rotations.as_deref().map(|r| r.spin.as_slice())
    }

    /// Sums element moments and loads at the nodes.
    pub(super) fn assemble_moments(&mut self) {
        let Some(r) = self.rotations.as_deref_mut() else {
            return;
        };
        let (slots, batches, inertia) = (&self.node_slots, &self.batches, &r.inertia);
        r.moment
            .par_chunks_mut(NODE_CHUNK)
            .enumerate()
            .for_each(|(chunk, moment)| {
                for (i, m) in moment.iter_mut().enumerate() {
                    let node = chunk * NODE_CHUNK + i;
                    *m = [0.0; 3];
                    if inertia[node] <= 0.0 {
                        continue;
                    }
                    for entry in slots.of(node) {
                        let (slot, k) = ((entry / 4) as usize, (entry % 4) as usize);
                        let moment = &batches[slot / LANES].moment;
                        if moment.is_empty() {
                            continue;
                        }
                        let at = k * 3 * LANES + slot % LANES;
                        for c in 0..3 {
                            m[c] -= moment[at + c * LANES];
                        }
                    }
                }
            });
        for load in &self.loads {
            r.external[load.node as usize] = [0.0; 3];
        }
        for load in &self.loads {
            let n = load.node as usize;
            let m = scale(load.moment, self.load_factor);
            r.external[n] = add(r.external[n], m);
            r.moment[n] = add(r.moment[n], m);
        }
    }

    /// Spins of the next half step; their kinetic energy and works. Uses the same central differences and
    /// the same mass-proportional damping as the translations.
    pub(super) fn rotate(&mut self) {
        let Some(r) = self.rotations.as_deref_mut() else {
            return;
        };
        let (dt, alpha, kick) = (self.dt, self.settings.damping, self.kick);
        let middle = self.time + 0.5 * dt;
        let mut prescribed: Vec<Option<(u32, V)>> = Vec::new();
        if let Some(drive) = &self.drive {
            prescribed = (0..self.driven.len())
                .map(|k| drive.spin(k, middle).map(|w| (self.driven[k], w)))
                .collect();
        }
        let mut driven_work = 0.0;
        let mut held = vec![
            false;
            if prescribed.is_empty() {
                0
            } else {
                r.spin.len()
            }
        ];
        for (k, (n, next)) in prescribed
            .iter()
            .enumerate()
            .filter_map(|(k, p)| p.map(|p| (k, p)))
        {
            let n = n as usize;
            let old = r.spin[n];
            let mean = scale(add(next, old), 0.5);
            let inertia = scale(sub(next, old), r.inertia[n] / dt);
            let support = sub(inertia, sub(r.moment[n], r.external[n]));
            driven_work += dot(support, mean) * dt;
            self.supports.reaction_moment[k] = sub(inertia, r.moment[n]);
            r.spin[n] = next;
            held[n] = true;
        }
        let (lo, hi) = (1.0 / dt - 0.5 * alpha, 1.0 / (1.0 / dt + 0.5 * alpha));
        let (moment, external, inertia) = (&r.moment, &r.external, &r.inertia);
        let fixed = &self.supports.fixed;
        let parts: Vec<NodeWork> = r
            .spin
            .par_chunks_mut(NODE_CHUNK)
            .enumerate()
            .map(|(chunk, spins)| {
                let mut work = NodeWork::default();
                for (i, spin) in spins.iter_mut().enumerate() {
                    let n = chunk * NODE_CHUNK + i;
                    if inertia[n] <= 0.0 {
                        continue;
                    }
                    if !held.get(n).is_some_and(|h| *h) {
                        let old = *spin;
                        let mut w: V = std::array::from_fn(|c| {
                            (lo * old[c] + kick * moment[n][c] / inertia[n]) * hi
                        });
                        if let Some(f) = fixed.get(n) {
                            w = f.rotation(w);
                        }
                        let mean = scale(add(w, old), 0.5);
                        work.external += dot(external[n], mean) * dt;
                        work.damping += alpha * inertia[n] * dot(mean, mean) * dt;
                        *spin = w;
                    }
                    let w2 = dot(*spin, *spin);
                    work.kinetic += 0.5 * inertia[n] * w2;
                    if !w2.is_finite() {
                        work.bad = work.bad.or(Some(n as u32));
                    }
                }
                work
            })
            .collect();
        let sum = parts.into_iter().fold(NodeWork::default(), NodeWork::add);
        self.work = self.work.add(sum);
        self.ledger.external += driven_work;
    }
}
