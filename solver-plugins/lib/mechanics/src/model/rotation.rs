//! Rotations of the nodes, only for models with a sheet whose nodes have six degrees of freedom.
//!
//! Every node carries a spin (global axes) and an isotropic rotary inertia, so that there is no
//! gyroscopic term: `I dw/dt = moment`. Elements turn their own directors by the spin; the model keeps
//! no orientation.

use super::advance::{Turns, free_of, free_or_all};
use super::blocks::NODE_CHUNK;
use super::boundary::Fixed;
use super::parts::{Model, NodeWork, Rotations};
use crate::MechanicsError;
use crate::mesh::area_vector;
use crate::mirror::Planes;
use crate::team::least;
use crate::vec3::{Vec3, add, cross, dot, norm, scale, sub};
use plyflow_fixed::FixedBits;
use rayon::prelude::*;

impl Model {
    /// Brings the nodes to `x` (`[n]`, m) in one step of `dt` (s), and the elements with them: forces, energies, and what they keep of the
    /// way. Nodes that rotate turn as the sheets' normals turn, and not about them; those of `normals` (node, of any length and
    /// either sign) come to have that normal instead of their own sheet's. At the end all is at rest.
    ///
    /// # Errors
    /// When a component fails, or the model is cut at mirror planes, whose other half has a share in the normals.
    pub fn lead(
        &mut self,
        x: Vec<Vec3>,
        dt: f64,
        normals: &[(u32, Vec3)],
    ) -> Result<(), MechanicsError> {
        if self.planes() != Planes::default() {
            return Err(MechanicsError::Input(
                "a model that is cut at mirror planes cannot be led to a state on its way".into(),
            ));
        }
        let rate = 1.0 / dt;
        if let Some(mut r) = self.state.rotations.take() {
            let (from, mut to) = (self.normals_at(&self.state.x), self.normals_at(&x));
            for (n, normal) in normals {
                let same = dot(*normal, to[*n as usize]) >= 0.0;
                to[*n as usize] = if same { *normal } else { scale(*normal, -1.0) };
            }
            for (n, spin) in r.spin.iter_mut().enumerate() {
                *spin = scale(turn_between(from[n], to[n]), rate);
                if let Some(fixed) = self.boundary.supports.fixed.get(n) {
                    *spin = fixed.rotation(*spin);
                }
            }
            self.state.rotations = Some(r);
        }
        for ((v, from), to) in self.state.v.iter_mut().zip(&self.state.x).zip(&x) {
            *v = scale(sub(*to, *from), rate);
        }
        self.state.x = x;
        let before = std::mem::replace(&mut self.state.last_dt, dt);
        let done = self.internal_forces(false, false);
        self.state.last_dt = before;
        self.state.v.fill([0.0; 3]);
        if let Some(r) = self.state.rotations.as_deref_mut() {
            r.spin.fill([0.0; 3]);
        }
        done
    }

    /// `[n]` sums of the directed areas (m2) of the cells around the nodes, were these at `x`.
    fn normals_at(&self, x: &[Vec3]) -> Vec<Vec3> {
        let mut normals = vec![[0.0; 3]; x.len()];
        for cell in &self.topology.cells {
            let area = area_vector(cell.map(|n| x[n as usize]));
            for n in cell {
                let normal = &mut normals[*n as usize];
                *normal = add(*normal, area);
            }
        }
        normals
    }

    /// `[n]` spins (rad/s) at the half step; `None` when no sheet's nodes rotate.
    pub fn spins(&self) -> Option<&[Vec3]> {
        self.state.rotations.as_deref().map(|r| r.spin.as_slice())
    }

    /// Inertias as [`Model::rotate`] wants them.
    pub(super) fn set_free_inertias(&mut self) {
        let Some(r) = self.state.rotations.as_deref_mut() else {
            return;
        };
        r.free_inertia = free_of(&r.inertia, &self.boundary.driven);
        for (n, fixed) in self.boundary.supports.fixed.iter().enumerate() {
            r.fix(n, *fixed);
        }
    }

    /// Sums the moments; spins of the next half step; their kinetic energy and works. Uses the same central
    /// differences and the same mass-proportional damping as the translations.
    pub(super) fn rotate(&mut self) {
        let Some(mut r) = self.state.rotations.take() else {
            return;
        };
        let mut before = std::mem::take(&mut self.workspace.spins);
        before.clear();
        before.extend(self.boundary.driven.iter().map(|n| r.spin[*n as usize]));
        let mut works = std::mem::take(&mut self.workspace.works);
        self.turn_all(&mut r, &mut works);
        let mut work = works.iter().fold(NodeWork::default(), |sum, w| sum.add(*w));
        self.workspace.works = works;
        self.turn_driven(&mut r, &before, &mut work);
        self.workspace.spins = before;
        if !work.kinetic.is_finite() {
            let bad = |w: &Vec3| !w.iter().all(|c| c.is_finite());
            work.bad = work.bad.or(r.spin.iter().position(bad).map(|n| n as u32));
        }
        self.workspace.work = self.workspace.work.add(work);
        self.state.rotations = Some(r);
    }

    /// Spins of all nodes as if none was driven; works of those that are not, by chunk.
    fn turn_all(&self, r: &mut Rotations, works: &mut Vec<NodeWork>) {
        let moving = self.moving(false);
        let (sums, loads, factor) = (
            &self.elements.sums,
            &self.boundary.loads.moment,
            self.boundary.load_factor,
        );
        let inertia = free_or_all(&r.free_inertia, &r.inertia);
        let fixed = &self.boundary.supports.fixed;
        r.spin
            .par_chunks_mut(NODE_CHUNK)
            .enumerate()
            .with_min_len(least())
            .map(|(chunk, spin)| {
                let nodes = chunk * NODE_CHUNK..chunk * NODE_CHUNK + spin.len();
                let mut moment = [[0.0; 3]; NODE_CHUNK];
                let moment = &mut moment[..spin.len()];
                sums.collect(&sums.moment, chunk, moment);
                let mut external = [[0.0; 3]; NODE_CHUNK];
                if !loads.is_empty() {
                    for (q, load) in external.iter_mut().zip(&loads[nodes.clone()]) {
                        *q = scale(*load, factor);
                    }
                }
                moving.turn(Turns {
                    external: external[..spin.len()].as_flattened(),
                    spin: spin.as_flattened_mut(),
                    moment: moment.as_flattened(),
                    inertia: &inertia[nodes.clone()],
                    fixed: fixed.get(nodes).unwrap_or_default(),
                })
            })
            .collect_into_vec(works);
    }

    /// Spins of the driven nodes, which were `before`, and their works.
    fn turn_driven(&mut self, r: &mut Rotations, before: &[Vec3], work: &mut NodeWork) {
        let turning = Turning {
            dt: self.state.dt,
            damping: self.topology.settings.damping,
            kick: self.state.kick,
            inertia: &r.inertia,
            fixed: &self.boundary.supports.fixed,
            loads: &self.boundary.loads.moment,
            load_factor: self.boundary.load_factor,
        };
        let middle = self.state.time + 0.5 * self.state.dt;
        for (k, (n, old)) in self.boundary.driven.iter().zip(before).enumerate() {
            let n = *n as usize;
            if turning.inertia[n] <= 0.0 {
                continue;
            }
            let moment = self.elements.sums.at(&self.elements.sums.moment, n);
            r.spin[n] = match self.boundary.drive.as_ref().and_then(|d| d.spin(k, middle)) {
                None => turning.free(n, *old, moment, work),
                Some(next) => {
                    let mean = scale(add(next, *old), 0.5);
                    let inertia = scale(sub(next, *old), turning.inertia[n] / turning.dt);
                    let support = sub(inertia, moment);
                    self.state.ledger.external += dot(support, mean) * turning.dt;
                    self.boundary.supports.reaction_moment[k] = sub(support, turning.load(n));
                    work.count(turning.inertia[n], n, next);
                    next
                }
            };
        }
    }
}

/// The smallest rotation (rad, along its axis) that brings the direction of `from` to that of `to`; none where one of them has no
/// direction, or they are opposite and there are many.
fn turn_between(from: Vec3, to: Vec3) -> Vec3 {
    let axis = cross(from, to);
    let sine = norm(axis);
    if sine == 0.0 {
        return [0.0; 3];
    }
    scale(axis, sine.fixed_atan2(dot(from, to)) / sine)
}

/// What turns a driven node whose drive leaves its rotation free.
struct Turning<'a> {
    dt: f64,
    damping: f64,
    kick: f64,
    inertia: &'a [f64],
    fixed: &'a [Fixed],
    loads: &'a [Vec3],
    load_factor: f64,
}

impl Turning<'_> {
    #[inline(always)]
    fn load(&self, n: usize) -> Vec3 {
        let load = |m: &Vec3| scale(*m, self.load_factor);
        self.loads.get(n).map_or([0.0; 3], load)
    }

    /// The next spin of a node that `moment` and its load turn.
    #[inline(always)]
    fn free(&self, n: usize, old: Vec3, moment: Vec3, work: &mut NodeWork) -> Vec3 {
        let (dt, alpha) = (self.dt, self.damping);
        let (lo, hi) = (1.0 / dt - 0.5 * alpha, 1.0 / (1.0 / dt + 0.5 * alpha));
        let load = self.load(n);
        let per_inertia = self.kick / self.inertia[n];
        let mut w: Vec3 =
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
