//! Checks of an element formulation.

use crate::{Finding, Sequence, finding};
use plyflow_sdk::abi::*;
use std::ffi::c_void;

const LANES: usize = 8;

struct Subject<'a> {
    functions: *const pf_element_functions,
    instance: *mut c_void,
    sizes: pf_element_sizes,
    membrane_history: usize,
    material: &'a pf_material,
}

/// What one call of `forces` gave.
#[derive(Clone)]
struct Answer {
    force: Vec<f64>,
    energy: Vec<f64>,
    status: i32,
}

/// Checks the element part of a formulation made with `parameters` (JSON, SI numbers) for a material.
///
/// Findings: `create`, `sizes`, `status`, `finite`, `mass`, `rest`, `balance` (forces of an element add
/// up to zero), `batch-independence`, `frame-invariance` (a rigid motion changes nothing), and, with a
/// material and an element without history, `derivative` (forces are derivatives of the energy).
///
/// # Safety
/// `functions` and `material` must be valid for the length of the call.
#[must_use]
pub unsafe fn check_element(
    functions: *const pf_element_functions,
    parameters: &str,
    material: &pf_material,
) -> Vec<Finding> {
    let (mut instance, mut error) = (std::ptr::null_mut(), pf_error::default());
    let text = pf_str::new(parameters);
    let code = unsafe { ((*functions).create)(text, material, &raw mut instance, &raw mut error) };
    if code != PF_OK {
        return vec![finding("create", format!("status {code}: {}", error.get()))];
    }
    let mut sizes = pf_element_sizes {
        size: size_of::<pf_element_sizes>() as u64,
        ..pf_element_sizes::default()
    };
    let code = unsafe { ((*functions).sizes)(instance, &raw mut sizes) };
    let mut of_material = pf_material_sizes {
        size: size_of::<pf_material_sizes>() as u64,
        ..pf_material_sizes::default()
    };
    unsafe { ((*material.functions).sizes)(material.instance, &raw mut of_material) };
    let found = if code != PF_OK || !matches!(sizes.nodes, 3 | 4) || sizes.dofs_per_node != 3 {
        let text = format!(
            "status {code}, {} nodes with {} degrees of freedom; judged are 3 or 4 nodes with 3",
            sizes.nodes, sizes.dofs_per_node
        );
        vec![finding("sizes", text)]
    } else {
        let membrane_history = of_material.membrane_history as usize;
        Subject {
            functions,
            instance,
            sizes,
            membrane_history,
            material,
        }
        .judge()
    };
    unsafe { ((*functions).destroy)(instance) };
    found
}

impl Subject<'_> {
    fn nodes(&self) -> usize {
        self.sizes.nodes as usize
    }

    /// Initialises at `reference` and computes at `position`, both `[nodes][3][lanes]`.
    fn call(&self, lanes: usize, reference: &[f64], position: &[f64]) -> (Answer, Vec<f64>) {
        let n = self.nodes();
        let s = &self.sizes;
        let mut constants = vec![0.0; s.constants as usize * lanes];
        let mut history = vec![0.0; s.history as usize * lanes];
        let mut of_material = vec![0.0; s.material_points as usize * self.membrane_history * lanes];
        let mut mass = vec![f64::NAN; n * lanes];
        let mut axis = vec![0.0; 3 * lanes];
        axis[..lanes].fill(1.0);
        let velocity = vec![0.0; 3 * n * lanes];
        let mut a = Answer {
            force: vec![f64::NAN; 3 * n * lanes],
            energy: vec![f64::NAN; PF_ENERGIES * lanes],
            status: 0,
        };
        let null = std::ptr::null_mut();
        let mut batch = pf_element_batch {
            size: size_of::<pf_element_batch>() as u64,
            lanes: lanes as u32,
            reserved: 0,
            dt: 0.0,
            position: reference.as_ptr(),
            velocity: null,
            spin: null,
            axis: axis.as_ptr(),
            constants: constants.as_mut_ptr(),
            history: history.as_mut_ptr(),
            material_history: of_material.as_mut_ptr(),
            force: null,
            moment: null,
            energy: null,
            fields: null,
            mass: mass.as_mut_ptr(),
            inertia: null,
            critical_step: null,
            material: self.material,
        };
        unsafe {
            let f = &*self.functions;
            a.status = (f.initialise)(self.instance, &raw const batch);
            batch.axis = null;
            batch.mass = null;
            batch.position = position.as_ptr();
            batch.velocity = velocity.as_ptr();
            batch.force = a.force.as_mut_ptr();
            batch.energy = a.energy.as_mut_ptr();
            if a.status == PF_OK {
                a.status = (f.forces)(self.instance, &raw const batch);
            }
        }
        (a, mass)
    }

    fn judge(&self) -> Vec<Finding> {
        let n = self.nodes();
        let mut sequence = Sequence(0x2545_f491_4f6c_dd1d);
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let mut reference = vec![0.0; 3 * n * LANES];
        let mut position = reference.clone();
        for node in 0..n {
            for lane in 0..LANES {
                for axis in 0..3 {
                    let i = (node * 3 + axis) * LANES + lane;
                    let flat = corners[node].get(axis).copied().unwrap_or(0.0);
                    // Slightly skewed elements of 5 mm, stretched by some 2 %.
                    let skew = if axis < 2 { 0.1 * sequence.next() } else { 0.0 };
                    reference[i] = 5e-3 * (flat + skew);
                    position[i] = reference[i] + 5e-3 * 0.02 * sequence.next();
                }
            }
        }
        let (a, mass) = self.call(LANES, &reference, &position);
        if a.status != PF_OK {
            return vec![finding(
                "status",
                format!("status {} at 2 % strain", a.status),
            )];
        }
        if a.force.iter().chain(&a.energy).any(|x| !x.is_finite()) {
            return vec![finding(
                "finite",
                "force or energy is not finite at 2 % strain",
            )];
        }
        let mut found = Vec::new();
        if mass.iter().any(|m| !(m.is_finite() && *m > 0.0)) {
            found.push(finding(
                "mass",
                format!("masses must be positive: {:?} kg", &mass[..n]),
            ));
        }
        let largest = a.force.iter().fold(0.0f64, |m, f| m.max(f.abs()));
        let rest = self.call(LANES, &reference, &reference).0;
        if rest.force.iter().any(|f| f.abs() > 1e-8 * largest) {
            found.push(finding(
                "rest",
                "there are forces in the reference position",
            ));
        }
        found.extend(self.balance(&a, largest));
        found.extend(self.batches(&reference, &position, &a));
        found.extend(self.frame(&reference, &position, &a, largest));
        if self.sizes.history == 0 && self.membrane_history == 0 {
            found.extend(self.derivative(&reference, &position, &a, largest));
        }
        found
    }

    fn balance(&self, a: &Answer, largest: f64) -> Option<Finding> {
        (0..3 * LANES).find_map(|i| {
            let sum: f64 = (0..self.nodes())
                .map(|node| a.force[node * 3 * LANES + i])
                .sum();
            (sum.abs() > 1e-9 * largest).then(|| {
                finding(
                    "balance",
                    format!("the forces of an element add up to {sum} N, not 0"),
                )
            })
        })
    }

    fn batches(&self, reference: &[f64], position: &[f64], a: &Answer) -> Option<Finding> {
        let wide = 2 * LANES;
        let spread = |from: &[f64], shift: f64| {
            let mut to = vec![0.0; 2 * from.len()];
            for row in 0..3 * self.nodes() {
                for lane in 0..LANES {
                    to[row * wide + wide - 1 - lane] = from[row * LANES + lane];
                    to[row * wide + lane] = from[row * LANES] * (1.0 + shift);
                }
            }
            to
        };
        let (b, _) = self.call(wide, &spread(reference, 0.0), &spread(position, 0.01));
        let differs = (0..LANES).find(|lane| {
            (0..3 * self.nodes())
                .any(|r| a.force[r * LANES + lane] != b.force[r * wide + wide - 1 - lane])
        })?;
        let text = format!("lane {differs} of 8 differs from the same element in another batch");
        Some(finding("batch-independence", text))
    }

    /// A rotation about an oblique axis and a shift: energies stay, forces turn.
    fn frame(
        &self,
        reference: &[f64],
        position: &[f64],
        a: &Answer,
        largest: f64,
    ) -> Option<Finding> {
        let q = [[2.0, -1.0, 2.0], [2.0, 2.0, -1.0], [-1.0, 2.0, 2.0]].map(|r| r.map(|x| x / 3.0));
        let turn = |v: &[f64], shift: f64| {
            let mut to = vec![0.0; v.len()];
            for node in 0..self.nodes() {
                for lane in 0..LANES {
                    for i in 0..3 {
                        let at = |j: usize| v[(node * 3 + j) * LANES + lane];
                        to[(node * 3 + i) * LANES + lane] =
                            q[i][0] * at(0) + q[i][1] * at(1) + q[i][2] * at(2) + shift;
                    }
                }
            }
            to
        };
        let (b, _) = self.call(LANES, reference, &turn(position, 0.01));
        let want = turn(&a.force, 0.0);
        let error = want
            .iter()
            .zip(&b.force)
            .fold(0.0f64, |m, (w, f)| m.max((w - f).abs()));
        (error > 1e-6 * largest).then(|| {
            let text = format!("after a rigid rotation forces are off by {error} N of {largest} N");
            finding("frame-invariance", text)
        })
    }

    fn derivative(
        &self,
        reference: &[f64],
        position: &[f64],
        a: &Answer,
        largest: f64,
    ) -> Option<Finding> {
        let h = 1e-9;
        let total = |answer: &Answer, lane: usize| -> f64 {
            (0..PF_ENERGIES)
                .map(|row| answer.energy[row * LANES + lane])
                .sum()
        };
        for row in 0..3 * self.nodes() {
            let shifted = |by: f64| {
                let mut p = position.to_vec();
                p[row * LANES..(row + 1) * LANES]
                    .iter_mut()
                    .for_each(|x| *x += by);
                self.call(LANES, reference, &p).0
            };
            let (up, down) = (shifted(h), shifted(-h));
            for lane in 0..LANES {
                let want = (total(&up, lane) - total(&down, lane)) / (2.0 * h);
                let got = a.force[row * LANES + lane];
                if (got - want).abs() > 1e-4 * largest {
                    let text = format!(
                        "node {}, axis {}: force {got} N, the energy's derivative is {want} N",
                        row / 3,
                        row % 3
                    );
                    return Some(finding("derivative", text));
                }
            }
        }
        None
    }
}
