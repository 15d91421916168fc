//! Forces on the nodes, and where they take them.

use super::blocks::{NODE_CHUNK, Sums, chunks_or_none};
use super::boundary::Fixed;
use super::parts::{Model, NodeWork};
use crate::team;
use crate::vec3::{Vec3, add, dot, scale, sub};
use rayon::prelude::*;
use std::ops::Range;

/// What moves or turns the nodes of a model in a step.
#[derive(Clone, Copy)]
pub(super) struct Moving {
    dt: f64,
    /// `v = (lo v + kick f / m) hi`.
    lo: f64,
    hi: f64,
    kick: f64,
    damping: f64,
    /// Whether anything but contacts, elements and supports acts on the nodes.
    loaded: bool,
}

/// Components of all nodes of a chunk, one after the other.
struct Components<'a> {
    x: &'a mut [f64],
    v: &'a mut [f64],
    /// Of the elements; then of everything.
    force: &'a mut [f64],
    contact: &'a mut [f64],
    /// Empty when nothing external acts.
    external: &'a [f64],
    /// By node (kg); 0: driven.
    mass: &'a [f64],
    /// By node, or empty when nothing is fixed.
    fixed: &'a [Fixed],
}

/// The same of their rotations.
pub(super) struct Turns<'a> {
    pub(super) spin: &'a mut [f64],
    /// Of the elements.
    pub(super) moment: &'a [f64],
    pub(super) external: &'a [f64],
    /// By node (kg m2); 0: it does not rotate, or is driven.
    pub(super) inertia: &'a [f64],
    /// By node, or empty when nothing is fixed.
    pub(super) fixed: &'a [Fixed],
}

/// What acts on nodes from outside: weight, pressure and loads.
struct Acting<'a> {
    /// (m/s2)
    weight: Vec3,
    /// By node, without scaling (kg).
    own_mass: &'a [f64],
    sums: &'a Sums,
    /// By node (N), or empty.
    loads: &'a [Vec3],
    load_factor: f64,
}

impl Acting<'_> {
    /// The forces on the `nodes` of a chunk.
    #[inline(always)]
    fn on(&self, chunk: usize, nodes: Range<usize>, external: &mut [Vec3]) {
        for (q, m) in external.iter_mut().zip(&self.own_mass[nodes.clone()]) {
            *q = scale(self.weight, *m);
        }
        if !self.sums.pressure.is_empty() {
            self.sums.collect(&self.sums.pressure, chunk, external);
        }
        if !self.loads.is_empty() {
            for (q, load) in external.iter_mut().zip(&self.loads[nodes]) {
                *q = add(*q, scale(*load, self.load_factor));
            }
        }
    }
}

/// Components whose sums are kept apart: eight nodes.
const GROUP: usize = 24;

/// Chunks that a thread takes at most without leaving some to the others.
const TOGETHER: usize = 8;

impl Model {
    /// Velocities and positions of the next step; works of the step.
    pub(super) fn advance(&mut self) {
        let weight = self.boundary.body_acceleration;
        let loaded = weight != [0.0; 3]
            || !self.boundary.loads.force.is_empty()
            || !self.elements.sums.pressure.is_empty();
        let moving = self.moving(loaded);
        // None are kept while nothing acts.
        let loaded_nodes = if loaded { self.state.x.len() } else { 0 };
        self.boundary.external_force.resize(loaded_nodes, [0.0; 3]);
        let before = self.before();
        let (sums, patch_sums) = (&self.elements.sums, &self.elements.patch_sums);
        let free_mass = free_or_all(&self.topology.free_mass, &self.topology.mass);
        let fixed = &self.boundary.supports.fixed;
        let chunks = self.state.x.len().div_ceil(NODE_CHUNK);
        let external = chunks_or_none(&mut self.boundary.external_force, NODE_CHUNK, chunks);
        let acting = Acting {
            weight,
            own_mass: &self.topology.own_mass,
            sums,
            loads: &self.boundary.loads.force,
            load_factor: self.boundary.load_factor,
        };
        self.state
            .x
            .par_chunks_mut(NODE_CHUNK)
            .zip_eq(self.state.v.par_chunks_mut(NODE_CHUNK))
            .zip_eq(self.state.force.par_chunks_mut(NODE_CHUNK))
            .zip_eq(external)
            .zip_eq(self.contacts.force.par_chunks_mut(NODE_CHUNK))
            .enumerate()
            .with_max_len(TOGETHER)
            .with_min_len(team::least())
            .map(|(chunk, ((((x, v), force), external), contact))| {
                let nodes = chunk * NODE_CHUNK..chunk * NODE_CHUNK + x.len();
                force.fill([0.0; 3]);
                sums.collect(&sums.force, chunk, force);
                if patch_sums.stride > 0 {
                    patch_sums.collect(&patch_sums.force, chunk, force);
                }
                if moving.loaded {
                    acting.on(chunk, nodes.clone(), external);
                }
                moving.chunk(Components {
                    x: x.as_flattened_mut(),
                    v: v.as_flattened_mut(),
                    force: force.as_flattened_mut(),
                    contact: contact.as_flattened_mut(),
                    external: external.as_flattened(),
                    mass: &free_mass[nodes.clone()],
                    fixed: fixed.get(nodes).unwrap_or_default(),
                })
            })
            .collect_into_vec(&mut self.workspace.works);
        let works = self.workspace.works.iter();
        self.workspace.work = works.fold(NodeWork::default(), |sum, w| sum.add(*w));
        self.follow(&before);
        self.workspace.before = before;
        self.close_step();
    }

    /// Positions and velocities of the driven nodes.
    fn before(&mut self) -> Vec<(Vec3, Vec3)> {
        let mut before = std::mem::take(&mut self.workspace.before);
        before.clear();
        let places = self.boundary.driven.iter().map(|n| *n as usize);
        before.extend(places.map(|n| (self.state.x[n], self.state.v[n])));
        before
    }

    /// What follows from the works of a step, when nodes have moved: rotations, energies, time.
    fn close_step(&mut self) {
        let dt = self.state.dt;
        if !self.workspace.work.kinetic.is_finite() {
            let bad = |v: &Vec3| !v.iter().all(|c| c.is_finite());
            self.workspace.work.bad = self.state.v.iter().position(bad).map(|n| n as u32);
        }
        self.rotate();
        self.state.max_speed = self.workspace.work.speed.sqrt();
        self.state.max_acceleration = self.workspace.work.change.sqrt() / dt;
        let work = &self.workspace.work;
        // Nothing that is not finite comes into the ledger without a node that is told as bad.
        debug_assert!(work.bad.is_some() || (work.external + work.damping).is_finite());
        self.state.ledger.external += self.workspace.work.external;
        self.state.ledger.damping += self.workspace.work.damping;
        self.state.time += dt;
        self.state.last_dt = dt;
        self.state.kick = 1.0;
        self.state.cycle += 1;
    }

    /// What this step does to velocities and spins.
    pub(super) fn moving(&self, loaded: bool) -> Moving {
        let (dt, alpha) = (self.state.dt, self.topology.settings.damping);
        Moving {
            dt,
            lo: 1.0 / dt - 0.5 * alpha,
            hi: 1.0 / (1.0 / dt + 0.5 * alpha),
            kick: self.state.kick,
            damping: alpha,
            loaded,
        }
    }

    /// Puts the driven nodes where their drive wants them. `before`: their positions and velocities.
    fn follow(&mut self, before: &[(Vec3, Vec3)]) {
        let Some(drive) = &self.boundary.drive else {
            return;
        };
        let dt = self.state.dt;
        let anchors = &self.boundary.anchors.at;
        debug_assert!([0, before.len()].contains(&anchors.len()));
        for (k, (n, (x, v))) in self.boundary.driven.iter().zip(before).enumerate() {
            let n = *n as usize;
            let mut target = drive.position(k, self.state.time + dt);
            if let Some(hold) = drive.hold(k, self.state.time) {
                let way = hold.in_plane(sub(*x, drive.position(k, self.state.time)));
                let creep = hold.creep(
                    &self.boundary.anchors,
                    k,
                    way,
                    self.state.force[n],
                    dt * dt / self.topology.mass[n],
                );
                target = add(target, add(way, creep));
            }
            let next = scale(sub(target, *x), 1.0 / dt);
            // What holds the node makes up for the forces on it: its work is external.
            let mean = scale(add(next, *v), 0.5);
            let inertia = scale(sub(next, *v), self.topology.mass[n] / dt);
            let external = self
                .boundary
                .external_force
                .get(n)
                .copied()
                .unwrap_or_default();
            let held = sub(inertia, sub(self.state.force[n], external));
            self.state.ledger.external += dot(held, mean) * dt;
            self.boundary.supports.reaction[k] = sub(inertia, self.state.force[n]);
            self.state.x[n] = target;
            self.state.v[n] = next;
            self.workspace.work.count(self.topology.mass[n], n, next);
            self.workspace.work.speed = self.workspace.work.speed.max(dot(next, next));
            let change = sub(next, *v);
            self.workspace.work.change = self.workspace.work.change.max(dot(change, change));
        }
    }

    /// Masses as [`Model::advance`] wants them.
    pub(super) fn set_free_masses(&mut self) {
        self.topology.free_mass = free_of(&self.topology.mass, &self.boundary.driven);
        self.set_free_inertias();
    }
}

/// Values by node, 0 where it is driven; empty when none is.
pub(super) fn free_of(of_nodes: &[f64], driven: &[u32]) -> Vec<f64> {
    if driven.is_empty() {
        return Vec::new();
    }
    let mut free = of_nodes.to_vec();
    for n in driven {
        free[*n as usize] = 0.0;
    }
    free
}

/// What [`free_of`] has given, or all values where that is empty.
pub(super) fn free_or_all<'a>(free: &'a [f64], all: &'a [f64]) -> &'a [f64] {
    if free.is_empty() { all } else { free }
}

impl Moving {
    /// Moves a chunk with the machine's widest vectors; no fused operations and sums by group, so the bits are
    /// the same on all.
    fn chunk(self, c: Components<'_>) -> NodeWork {
        #[cfg(target_arch = "x86_64")]
        {
            #[target_feature(enable = "avx2")]
            fn wide(moving: Moving, c: Components<'_>) -> NodeWork {
                moving.components(c)
            }
            if std::arch::is_x86_feature_detected!("avx2") {
                // SAFETY: AVX2, all that `wide` asks for, was found the line above.
                return unsafe { wide(self, c) };
            }
        }
        self.components(c)
    }

    /// Turns a chunk, in the same way.
    pub(super) fn turn(self, c: Turns<'_>) -> NodeWork {
        #[cfg(target_arch = "x86_64")]
        {
            #[target_feature(enable = "avx2")]
            fn wide(moving: Moving, c: Turns<'_>) -> NodeWork {
                moving.turns(c)
            }
            if std::arch::is_x86_feature_detected!("avx2") {
                // SAFETY: AVX2, all that `wide` asks for, was found the line above.
                return unsafe { wide(self, c) };
            }
        }
        self.turns(c)
    }

    #[inline(always)]
    fn turns(self, mut c: Turns<'_>) -> NodeWork {
        let mut sums = Works::default();
        let n = c.spin.len();
        let whole = n - n % GROUP;
        for start in (0..whole).step_by(GROUP) {
            self.turn_group::<GROUP>(&mut c, start, &mut sums);
        }
        for start in (whole..n).step_by(3) {
            self.turn_group::<3>(&mut c, start, &mut sums);
        }
        self.work(&sums)
    }

    /// Turns `N` components, three of a node, at most [`GROUP`].
    #[inline(always)]
    fn turn_group<const N: usize>(self, c: &mut Turns<'_>, start: usize, sums: &mut Works) {
        let spin = to::<N>(&mut c.spin[start..]);
        let (moment, q) = (of::<N>(&c.moment[start..]), of::<N>(&c.external[start..]));
        let inertia = by_component::<N>(c.inertia, start);
        debug_assert!(inertia.iter().all(|i| *i >= 0.0));
        let mut per_inertia = inertia.map(reciprocal);
        for (k, fixed) in part::<N>(c.fixed, start).iter().enumerate() {
            let free = to(&mut per_inertia[3 * k..]);
            *free = fixed.rotation(*free);
        }
        for i in 0..N {
            let old = spin[i];
            let new = (self.lo * old + self.kick * per_inertia[i] * (moment[i] + q[i])) * self.hi;
            spin[i] = new;
            sums.kinetic[i] += inertia[i] * (new * new);
            let mean = 0.5 * (new + old);
            sums.lost[i] += inertia[i] * (mean * mean);
            sums.done[i] += if inertia[i] > 0.0 { q[i] * mean } else { 0.0 };
        }
    }

    /// Works of a chunk.
    #[inline(always)]
    fn work(self, sums: &Works) -> NodeWork {
        NodeWork {
            kinetic: 0.5 * sums.kinetic.iter().sum::<f64>(),
            external: sums.done.iter().sum::<f64>() * self.dt,
            damping: sums.lost.iter().sum::<f64>() * self.damping * self.dt,
            speed: sums.speed.iter().fold(0.0, |m, s| m.max(*s)),
            change: sums.change.iter().fold(0.0, |m, s| m.max(*s)),
            bad: None,
        }
    }

    #[inline(always)]
    fn components(self, mut c: Components<'_>) -> NodeWork {
        let mut sums = Works::default();
        let n = c.x.len();
        let whole = n - n % GROUP;
        for start in (0..whole).step_by(GROUP) {
            self.group::<GROUP>(&mut c, start, &mut sums);
        }
        for start in (whole..n).step_by(3) {
            self.group::<3>(&mut c, start, &mut sums);
        }
        self.work(&sums)
    }

    /// Moves `N` components, three of a node, at most [`GROUP`].
    #[inline(always)]
    fn group<const N: usize>(self, c: &mut Components<'_>, start: usize, sums: &mut Works) {
        let x = to::<N>(&mut c.x[start..]);
        let v = to::<N>(&mut c.v[start..]);
        let f = to::<N>(&mut c.force[start..]);
        let contact = to::<N>(&mut c.contact[start..]);
        let q = match c.external {
            [] => &[0.0; N],
            external => of::<N>(&external[start..]),
        };
        let mass = by_component::<N>(c.mass, start);
        debug_assert!(mass.iter().all(|m| *m >= 0.0));
        let mut per_mass = mass.map(reciprocal);
        for (k, fixed) in part::<N>(c.fixed, start).iter().enumerate() {
            let free = to(&mut per_mass[3 * k..]);
            *free = fixed.translation(*free);
        }
        let mut change = [0.0; N];
        for i in 0..N {
            f[i] += contact[i] + q[i];
            contact[i] = 0.0;
            let old = v[i];
            let new = (self.lo * old + self.kick * per_mass[i] * f[i]) * self.hi;
            v[i] = new;
            change[i] = new - old;
            x[i] += new * self.dt;
            sums.kinetic[i] += mass[i] * (new * new);
            let mean = 0.5 * (new + old);
            sums.lost[i] += mass[i] * (mean * mean);
            // Supports do the work at driven nodes.
            sums.done[i] += if mass[i] > 0.0 { q[i] * mean } else { 0.0 };
        }
        for k in 0..N / 3 {
            let square = |a: &[f64; N]| {
                a[3 * k] * a[3 * k] + a[3 * k + 1] * a[3 * k + 1] + a[3 * k + 2] * a[3 * k + 2]
            };
            let raise = |to: &mut f64, by: f64| *to = if by > *to { by } else { *to };
            raise(&mut sums.speed[k], square(v));
            raise(&mut sums.change[k], square(&change));
        }
    }
}

/// What a force accelerates: nothing where there is no free mass.
#[inline(always)]
fn reciprocal(mass: f64) -> f64 {
    if mass > 0.0 { 1.0 / mass } else { 0.0 }
}

/// Values by node for the `N` components from `start`.
#[inline(always)]
fn by_component<const N: usize>(of_nodes: &[f64], start: usize) -> [f64; N] {
    let of_nodes = &of_nodes[start / 3..start / 3 + N / 3];
    std::array::from_fn(|i| of_nodes[i / 3])
}

/// The nodes of the `N` components from `start`; none when nothing is fixed.
#[inline(always)]
fn part<const N: usize>(fixed: &[Fixed], start: usize) -> &[Fixed] {
    fixed.get(start / 3..start / 3 + N / 3).unwrap_or_default()
}

fn of<const N: usize>(from: &[f64]) -> &[f64; N] {
    from.first_chunk().expect("whole groups")
}

fn to<const N: usize>(from: &mut [f64]) -> &mut [f64; N] {
    from.first_chunk_mut().expect("whole groups")
}

/// Sums by place in a group.
#[derive(Default)]
struct Works {
    /// Twice the kinetic energies (J).
    kinetic: [f64; GROUP],
    /// Mass times mean velocity squared (J).
    lost: [f64; GROUP],
    /// Powers of the external forces (W).
    done: [f64; GROUP],
    /// Largest squares of the speed (m2/s2).
    speed: [f64; GROUP / 3],
    /// Largest squares of its change in the step (m2/s2).
    change: [f64; GROUP / 3],
}
