//! Checks of a material.

use crate::{Finding, Sequence, finding};
use plyflow_sdk::abi::*;
use plyflow_sdk::{MaterialRef, MembraneBatch};

const LANES: usize = 8;

/// What one call gave: stress `[3][lanes]`, energy `[lanes]`.
struct Answer {
    stress: Vec<f64>,
    energy: Vec<f64>,
    status: i32,
}

fn call(material: &MaterialRef, lanes: usize, metric: &[f64]) -> Answer {
    let mut history = vec![0.0; material.sizes().membrane_history * lanes];
    let mut a = Answer {
        stress: vec![f64::NAN; 3 * lanes],
        energy: vec![f64::NAN; lanes],
        status: 0,
    };
    let mut stiffness = vec![f64::NAN; 2 * lanes];
    a.status = material.membrane(&mut MembraneBatch {
        lanes,
        dt: 1e-6,
        metric,
        history: &mut history,
        stress: &mut a.stress,
        energy: &mut a.energy,
        stiffness: Some(&mut stiffness),
    });
    a
}

/// C11, C22, C12 of a small random deformation around a stretch.
fn metrics(sequence: &mut Sequence, lanes: usize, size: f64) -> Vec<f64> {
    let mut metric = vec![0.0; 3 * lanes];
    for lane in 0..lanes {
        let f = [1.0 + size * sequence.next(), size * sequence.next()];
        let g = [size * sequence.next(), 1.0 + size * sequence.next()];
        metric[lane] = f[0] * f[0] + g[0] * g[0];
        metric[lanes + lane] = f[1] * f[1] + g[1] * g[1];
        metric[2 * lanes + lane] = f[0] * f[1] + g[0] * g[1];
    }
    metric
}

/// Checks a material made with `parameters` (JSON, SI numbers).
///
/// Findings: `create`, `sizes`, `status`, `finite`, `rest` (no stress and energy undeformed),
/// `batch-independence`, and, for a material without history, `derivative` (stress is the derivative of
/// the energy, by central differences within 1e-4 of the largest stress).
///
/// # Safety
/// `functions` must be a valid table that outlives the call.
#[must_use]
pub unsafe fn check_material(
    functions: *const pf_material_functions,
    parameters: &str,
) -> Vec<Finding> {
    let (mut instance, mut error) = (std::ptr::null_mut(), pf_error::default());
    let create = unsafe { (*functions).create };
    let code = unsafe { create(pf_str::new(parameters), &raw mut instance, &raw mut error) };
    if code != PF_OK {
        return vec![finding("create", format!("status {code}: {}", error.get()))];
    }
    let found = match unsafe {
        MaterialRef::new(pf_material {
            functions,
            instance,
        })
    } {
        Ok(material) => judge(&material),
        Err(text) => vec![finding("sizes", text)],
    };
    unsafe { ((*functions).destroy)(instance) };
    found
}

fn judge(material: &MaterialRef) -> Vec<Finding> {
    let mut found = Vec::new();
    let mut sequence = Sequence(0x9e37_79b9_7f4a_7c15);
    let rest: Vec<f64> = (0..3 * LANES)
        .map(|i| if i < 2 * LANES { 1.0 } else { 0.0 })
        .collect();
    let at_rest = call(material, LANES, &rest);
    let metric = metrics(&mut sequence, LANES, 0.02);
    let a = call(material, LANES, &metric);
    if a.status != PF_OK || at_rest.status != PF_OK {
        found.push(finding(
            "status",
            format!("membrane returned {} at 2 % strain", a.status),
        ));
        return found;
    }
    if a.stress.iter().chain(&a.energy).any(|x| !x.is_finite()) {
        found.push(finding(
            "finite",
            "stress or energy is not finite at 2 % strain",
        ));
        return found;
    }
    let largest = a.stress.iter().fold(0.0f64, |m, s| m.max(s.abs()));
    if at_rest.stress.iter().any(|s| s.abs() > 1e-9 * largest) {
        found.push(finding(
            "rest",
            format!("stress at rest is {:?} N/m", &at_rest.stress[..3]),
        ));
    }
    found.extend(batches(material, &metric, &a));
    if material.sizes().membrane_history == 0 {
        found.extend(derivative(material, &metric, &a, largest));
    }
    found
}

/// The same lanes among other lanes, in another order, must give the same bits.
fn batches(material: &MaterialRef, metric: &[f64], a: &Answer) -> Option<Finding> {
    let wide = 2 * LANES;
    let mut other = vec![0.0; 3 * wide];
    for row in 0..3 {
        for lane in 0..LANES {
            other[row * wide + wide - 1 - lane] = metric[row * LANES + lane];
            other[row * wide + lane] = metric[row * LANES] + if row < 2 { 0.01 } else { 0.0 };
        }
    }
    let b = call(material, wide, &other);
    for lane in 0..LANES {
        let to = wide - 1 - lane;
        let same = (0..3).all(|r| a.stress[r * LANES + lane] == b.stress[r * wide + to])
            && a.energy[lane] == b.energy[to];
        if !same {
            return Some(finding(
                "batch-independence",
                format!("lane {lane} of 8 differs from the same state in lane {to} of 16"),
            ));
        }
    }
    None
}

/// S11 = 2 dW/dC11, S22 = 2 dW/dC22, S12 = dW/dC12 (C12 stands for both off-diagonals).
fn derivative(material: &MaterialRef, metric: &[f64], a: &Answer, largest: f64) -> Option<Finding> {
    let h = 1e-6;
    for (row, factor) in [(0, 2.0), (1, 2.0), (2, 1.0)] {
        let shifted = |by: f64| {
            let mut m = metric.to_vec();
            m[row * LANES..(row + 1) * LANES]
                .iter_mut()
                .for_each(|x| *x += by);
            call(material, LANES, &m).energy
        };
        let (up, down) = (shifted(h), shifted(-h));
        for lane in 0..LANES {
            let want = factor * (up[lane] - down[lane]) / (2.0 * h);
            let got = a.stress[row * LANES + lane];
            if (got - want).abs() > 1e-4 * largest {
                let name = ["S11", "S22", "S12"][row];
                return Some(finding(
                    "derivative",
                    format!("{name} is {got} N/m, the energy's derivative is {want} N/m"),
                ));
            }
        }
    }
    None
}
