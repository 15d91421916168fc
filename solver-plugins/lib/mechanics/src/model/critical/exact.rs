//! The exact critical step of a model's elements and bending patches: all of their stiffness, assembled by differences of the model's own
//! forces. Nothing of it knows how the estimate is made.

use super::super::parts::Model;
use crate::vec3::Vec3;
use nalgebra::{DMatrix, DVector};
use plyflow_sdk::Aligned;

/// What elements and patches remember: a probe must not leave traces.
struct Memory {
    batches: Vec<[Aligned; 2]>,
    patches: Vec<Aligned>,
}

impl Memory {
    fn of(model: &Model) -> Self {
        let batches = model.elements.blocks.iter().flat_map(|b| &b.batches);
        let patches = model.elements.patches.iter().flat_map(|b| &b.batches);
        Self {
            batches: batches
                .map(|b| [b.history.clone(), b.material_history.clone()])
                .collect(),
            patches: patches.map(|b| b.history.clone()).collect(),
        }
    }

    fn restore(&self, model: &mut Model) {
        let batches = model
            .elements
            .blocks
            .iter_mut()
            .flat_map(|b| &mut b.batches);
        for (batch, [own, material]) in batches.zip(&self.batches) {
            batch.history.copy_from_slice(own);
            batch.material_history.copy_from_slice(material);
        }
        let patches = model
            .elements
            .patches
            .iter_mut()
            .flat_map(|b| &mut b.batches);
        for (batch, own) in patches.zip(&self.patches) {
            batch.history.copy_from_slice(own);
        }
    }
}

/// Forces (N) on all nodes, then moments (N m) where nodes rotate, of elements and patches at the model's positions and spins.
fn forces(model: &mut Model, memory: &Memory) -> Vec<f64> {
    memory.restore(model);
    model.internal_forces(false, false).expect("forces");
    let (elements, n) = (&model.elements, model.state.x.len());
    let mut force = vec![[0.0; 3]; n];
    elements
        .sums
        .collect(&elements.sums.force, 0, &mut force[..]);
    if elements.patch_sums.stride > 0 {
        let patches = &elements.patch_sums;
        patches.collect(&patches.force, 0, &mut force[..]);
    }
    let mut moment: Vec<Vec3> = Vec::new();
    if model.state.rotations.is_some() {
        moment.resize(n, [0.0; 3]);
        elements
            .sums
            .collect(&elements.sums.moment, 0, &mut moment[..]);
    }
    let all = force.as_flattened().iter().chain(moment.as_flattened());
    all.copied().collect()
}

/// Moves one degree of freedom: a position (m), or a rotation (rad) by the spin of a step of one second.
fn nudge(model: &mut Model, dof: usize, by: f64) {
    let n = model.state.x.len();
    if dof < 3 * n {
        model.state.x.as_flattened_mut()[dof] += by;
    } else {
        let rotations = model.state.rotations.as_deref_mut().expect("rotations");
        rotations.spin.as_flattened_mut()[dof - 3 * n] += by;
    }
}

/// `[n]` nodes whose forces change with a node's position or rotation: those that share a cell or a bending patch with it.
fn reach(model: &Model) -> Vec<Vec<usize>> {
    let mut near = vec![Vec::new(); model.state.x.len()];
    let mut join = |group: &[u32]| {
        for a in group {
            near[*a as usize].extend(group.iter().map(|b| *b as usize));
        }
    };
    model.topology.cells.iter().for_each(|c| join(c));
    for batch in model.elements.patches.iter().flat_map(|b| &b.batches) {
        for l in 0..batch.count as usize {
            join(&batch.nodes.iter().map(|n| n[l]).collect::<Vec<_>>());
        }
    }
    for list in &mut near {
        list.sort_unstable();
        list.dedup();
    }
    near
}

/// Groups of nodes of which no two reach the same node: one probe tells the columns of all of a group.
fn groups(reach: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let mut groups: Vec<(Vec<usize>, Vec<bool>)> = Vec::new();
    for (node, near) in reach.iter().enumerate() {
        let fits = |taken: &[bool]| near.iter().all(|n| !taken[*n]);
        let at = groups.iter().position(|(_, taken)| fits(taken));
        let at = at.unwrap_or_else(|| {
            groups.push((Vec::new(), vec![false; reach.len()]));
            groups.len() - 1
        });
        groups[at].0.push(node);
        near.iter().for_each(|n| groups[at].1[*n] = true);
    }
    groups.into_iter().map(|g| g.0).collect()
}

/// M^-1/2 K M^-1/2 (1/s2) with the masses and rotary inertias of the model. K by central differences, and of it the symmetric part:
/// hypoelastic laws have another one too. At most 256 nodes.
fn scaled_stiffness(model: &mut Model) -> DMatrix<f64> {
    let nodes = model.state.x.len();
    assert!(nodes <= super::super::blocks::NODE_CHUNK);
    let memory = Memory::of(model);
    model.state.last_dt = 1.0;
    let mut masses: Vec<f64> = model.topology.mass.clone();
    if let Some(r) = model.state.rotations.as_deref() {
        masses.extend(&r.inertia);
    }
    let kinds = masses.len() / nodes;
    let reach = reach(model);
    let groups = groups(&reach);
    let size = 3 * masses.len();
    let mut k = DMatrix::zeros(size, size);
    let start = model.state.x.clone();
    for (kind, group, axis) in (0..kinds)
        .flat_map(|kind| groups.iter().map(move |g| (kind, g)))
        .flat_map(|(kind, g)| (0..3).map(move |axis| (kind, g, axis)))
    {
        let h = if kind == 0 {
            1e-6 * model.topology.shortest_edge
        } else {
            1e-6
        };
        let column = |node: usize| 3 * (kind * nodes + node) + axis;
        let mut probe = |by: f64| {
            group
                .iter()
                .for_each(|node| nudge(model, column(*node), by));
            let all = forces(model, &memory);
            model.state.x.copy_from_slice(&start);
            if let Some(r) = model.state.rotations.as_deref_mut() {
                r.spin.fill([0.0; 3]);
            }
            all
        };
        let (ahead, behind) = (probe(h), probe(-h));
        for node in group {
            let rows = reach[*node].iter();
            let rows = rows.flat_map(|n| (0..kinds).map(move |of| of * nodes + n));
            for row in rows.flat_map(|n| (3 * n)..(3 * n + 3)) {
                let weight = (masses[row / 3] * masses[column(*node) / 3]).sqrt();
                k[(row, column(*node))] = (behind[row] - ahead[row]) / (2.0 * h * weight);
            }
        }
    }
    memory.restore(model);
    model.state.last_dt = 0.0;
    0.5 * (&k + k.transpose())
}

/// Largest eigenvalue of M^-1 K (1/s2) with the masses and rotary inertias of the model.
pub(super) fn largest_eigenvalue(model: &mut Model) -> f64 {
    lanczos(&scaled_stiffness(model))
}

/// Largest eigenvalue of a symmetric matrix, by Lanczos' method with all vectors kept square to each other. It goes on until what is left over
/// bounds the error by 1e-9 of it.
fn lanczos(a: &DMatrix<f64>) -> f64 {
    let n = a.nrows();
    let mut q = DVector::from_fn(n, |i, _| 1.0 + 0.3 * ((i * i + 7 * i) % 11) as f64).normalize();
    let (mut basis, mut alpha, mut beta) = (Vec::new(), Vec::new(), Vec::<f64>::new());
    loop {
        let mut w = a * &q;
        alpha.push(q.dot(&w));
        basis.push(q);
        for _ in 0..2 {
            for b in &basis {
                w.axpy(-w.dot(b), b, 1.0);
            }
        }
        let m = alpha.len();
        let left = w.norm();
        if m == n || m % 10 == 0 || left < 1e-12 * alpha[0].abs() {
            let t = DMatrix::from_fn(m, m, |i, j| match i.abs_diff(j) {
                0 => alpha[i],
                1 => beta[i.min(j)],
                _ => 0.0,
            });
            let eigen = t.symmetric_eigen();
            let (at, value) = eigen.eigenvalues.argmax();
            // The error is at most what is left over, and of its square over the next gap; the first is enough.
            if m == n
                || left == 0.0
                || left * eigen.eigenvectors[(m - 1, at)].abs() < 1e-9 * value.abs()
            {
                return value;
            }
        }
        beta.push(left);
        q = w / left;
    }
}

#[test]
fn lanczos_finds_the_largest_eigenvalue_of_a_dense_solution() {
    let a = DMatrix::from_fn(60, 60, |i, j| {
        1.0 / (1 + i + j) as f64 + if i == j { (i % 9) as f64 } else { 0.0 }
    });
    let exact = a.clone().symmetric_eigenvalues().max();
    assert!((lanczos(&a) / exact - 1.0).abs() < 1e-9);
}
