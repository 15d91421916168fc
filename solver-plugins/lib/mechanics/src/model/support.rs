//! Supports and nodal loads: fixed components, what driven nodes feel, forces and moments at nodes.

use super::boundary::{Fixed, Held, Loads, NodalLoad};
use super::parts::Model;
use crate::vec3::{Vec3, add, dot};

impl Model {
    /// Holds components of a node at zero. Held components do no work.
    pub fn fix(&mut self, node: u32, fixed: Fixed) {
        if self.boundary.supports.fixed.is_empty() {
            self.boundary.supports.fixed = vec![Fixed::default(); self.state.x.len()];
        }
        self.boundary.supports.fixed[node as usize] = fixed;
        self.state.v[node as usize] = fixed.translation(self.state.v[node as usize]);
        if let Some(r) = self.state.rotations.as_deref_mut() {
            r.fix(node as usize, fixed);
        }
    }

    /// Sets the nodal loads; [`Model::set_load_factor`] multiplies them.
    pub fn set_loads(&mut self, loads: Vec<NodalLoad>) {
        let sum = |of: &dyn Fn(&NodalLoad) -> Vec3| {
            let some = loads.iter().any(|l| of(l) != [0.0; 3]);
            let mut sums = vec![[0.0; 3]; if some { self.state.x.len() } else { 0 }];
            for load in loads.iter().filter(|_| some) {
                let at = &mut sums[load.node as usize];
                *at = add(*at, of(load));
            }
            sums
        };
        self.boundary.loads = Loads {
            force: sum(&|l| l.force),
            moment: sum(&|l| l.moment),
        };
    }

    /// Sets the force (N, global axes) of the nodal load of one node, in the place of what it was; [`Model::set_load_factor`] multiplies it.
    pub fn set_load(&mut self, node: u32, force: Vec3) {
        let loads = &mut self.boundary.loads.force;
        if loads.is_empty() {
            loads.resize(self.state.x.len(), [0.0; 3]);
        }
        loads[node as usize] = force;
    }

    /// Mass-proportional damping (1/s).
    pub fn damping(&self) -> f64 {
        self.topology.settings.damping
    }

    /// Sets the mass-proportional damping (1/s) from the next step on.
    pub fn set_damping(&mut self, damping: f64) {
        self.topology.settings.damping = damping;
    }

    /// `[driven]` forces (N) of what drives the nodes on them in the last step, in the order of
    /// [`Model::set_driven`]: mass times acceleration less all other forces.
    pub fn reactions(&self) -> &[Vec3] {
        &self.boundary.supports.reaction
    }

    /// `[driven]` moments (N m) of what drives the nodes' rotations; zero where these are free.
    pub fn reaction_moments(&self) -> &[Vec3] {
        &self.boundary.supports.reaction_moment
    }

    /// `[n]` masses without scaling (kg).
    pub fn own_masses(&self) -> &[f64] {
        &self.topology.own_mass
    }

    /// Stops all nodes, also their rotations (kinetic damping). What they moved with counts as lost to
    /// damping in the ledger. The next step is half a step of velocity, as from rest: a whole one would
    /// feed the highest frequencies.
    pub fn halt(&mut self) {
        self.state.kick = 0.5;
        self.state.ledger.damping += self.workspace.work.kinetic;
        self.workspace.work.kinetic = 0.0;
        self.state.v.fill([0.0; 3]);
        if let Some(r) = self.state.rotations.as_deref_mut() {
            r.spin.fill([0.0; 3]);
        }
    }

    /// Kinetic energy (J) after the last step.
    pub fn kinetic(&self) -> f64 {
        self.workspace.work.kinetic
    }

    /// Forces out of balance on what is free to move, and the loads that act there (pressure, weight,
    /// nodal loads): root sums of squares over the nodes (N), of the last step.
    pub fn out_of_balance(&self) -> (f64, f64) {
        let (mut rest, mut load) = (0.0, 0.0);
        for n in (0..self.state.x.len()).filter(|n| self.boundary.held[*n] == Held::Free) {
            let free = |f: Vec3| {
                self.boundary
                    .supports
                    .fixed
                    .get(n)
                    .map_or(f, |s| s.translation(f))
            };
            let external = self
                .boundary
                .external_force
                .get(n)
                .copied()
                .unwrap_or_default();
            let (f, e) = (free(self.state.force[n]), free(external));
            rest += dot(f, f);
            load += dot(e, e);
        }
        (rest.sqrt(), load.sqrt())
    }
}
