//! Supports and nodal loads: fixed components, what driven nodes feel, forces and moments at nodes.

use super::*;

/// Components (global axes) of a node's motion that are held at zero.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Fixed {
    /// Translations along x, y, z.
    pub translations: [bool; 3],
    /// Rotations about x, y, z.
    pub rotations: [bool; 3],
}

impl Fixed {
    #[inline(always)]
    fn keep(held: [bool; 3], v: V) -> V {
        std::array::from_fn(|c| if held[c] { 0.0 } else { v[c] })
    }

    /// The free part of a velocity.
    #[inline(always)]
    pub(super) fn translation(&self, v: V) -> V {
        Self::keep(self.translations, v)
    }

    /// The free part of a spin.
    #[inline(always)]
    pub(super) fn rotation(&self, v: V) -> V {
        Self::keep(self.rotations, v)
    }
}

/// A dead load at a node (global axes); [`Model::set_load_factor`] multiplies it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NodalLoad {
    /// Node of the model.
    pub node: u32,
    /// Force (N).
    pub force: V,
    /// Moment (N m); needs a sheet whose nodes rotate.
    pub moment: V,
}

/// Dead loads by node.
#[derive(Default)]
pub(super) struct Loads {
    /// `[n]` (N), or empty without forces.
    pub(super) force: Vec<V>,
    /// `[n]` (N m), or empty without moments.
    pub(super) moment: Vec<V>,
}

/// What holds a model besides its drive.
#[derive(Default)]
pub(super) struct Supports {
    /// `[n]`, or empty when nothing is fixed.
    pub(super) fixed: Vec<Fixed>,
    /// By driven node: force of the support on it (N).
    pub(super) reaction: Vec<V>,
    /// By driven node: moment of the support on it (N m).
    pub(super) reaction_moment: Vec<V>,
}

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
        let sum = |of: &dyn Fn(&NodalLoad) -> V| {
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
    pub fn reactions(&self) -> &[V] {
        &self.boundary.supports.reaction
    }

    /// `[driven]` moments (N m) of what drives the nodes' rotations; zero where these are free.
    pub fn reaction_moments(&self) -> &[V] {
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
            let free = |f: V| {
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
