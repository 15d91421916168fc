//! An element formulation in Rust: a four-node membrane in space with one integration point and hourglass control.
//! Take it as a start: change `manifest.json`, then `initialise` and `forces`.
//!
//! The whole contract stands in `plyflow.h`; what matters most:
//!
//! - Arrays are `[row][lane]`: element l of the batch has its value of row r at `[r * lanes + l]`.
//! - Write every output for every lane. Allocate nothing in `forces`.
//! - Several threads call one instance at once: the compiler holds you to it (`&self`, `Sync`).
//! - force = dW/dx. The structure is pulled by minus this.
//!
//! With one point, the deformed material axes are `g_a = b[0][a] (x1 - x3) + b[1][a] (x2 - x4)`, the metric is
//! `C_ab = g_a . g_b`, and
//!
//! `W = area * W_material(C) + hourglass / 2 |q|^2`,  `q = x1 - x2 + x3 - x4 - h_1 g_1 - h_2 g_2`,
//!
//! where q vanishes for every homogeneous deformation of the undeformed element.

use plyflow_sdk::abi::{PF_ENERGY_BENDING, PF_ENERGY_HOURGLASS, PF_ENERGY_MEMBRANE, PF_OK};
use plyflow_sdk::{
    Element, ElementBatch, ElementSizes, MaterialRef, MembraneBatch, export_element,
};

/// The most lanes that a batch has.
const MAX_LANES: usize = 64;

/// Rows of constants: b11, b21, b12, b22 (1/m), h1, h2 (m), area (m2).
const CONSTANTS: usize = 7;
/// Rows of fields, as in the manifest: shear angle, strains along e1 and e2.
const FIELDS: usize = 3;

type Vector = [f64; 3];

/// Parameters as the manifest declares them: checked by the host, defaults filled in, SI numbers.
#[derive(serde::Deserialize)]
struct Membrane {
    /// N/m
    hourglass: f64,
}

/// Rows that the material reads and writes: aligned like all batches.
#[repr(align(64))]
struct Rows<const N: usize>([f64; N]);

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Vector, b: Vector) -> Vector {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn unit(a: Vector) -> Vector {
    let length = dot(a, a).sqrt();
    a.map(|x| x / length)
}

/// Largest eigenvalue of [[a, c], [c, b]].
fn largest(a: f64, b: f64, c: f64) -> f64 {
    0.5 * (a + b) + (0.25 * (a - b) * (a - b) + c * c).sqrt()
}

/// x1 - x3, x2 - x4 and x1 - x2 + x3 - x4 of a lane.
fn differences(x: &[f64], lanes: usize, l: usize) -> [Vector; 3] {
    let mut d = [[0.0; 3]; 3];
    for k in 0..3 {
        let node = |i: usize| x[(3 * i + k) * lanes + l];
        d[0][k] = node(0) - node(2);
        d[1][k] = node(1) - node(3);
        d[2][k] = node(0) - node(1) + node(2) - node(3);
    }
    d
}

/// The deformed material axes of a lane.
fn axes(d13: Vector, d24: Vector, c: &[f64], lanes: usize, l: usize) -> [Vector; 2] {
    let b = |r: usize| c[r * lanes + l];
    [
        std::array::from_fn(|k| b(0) * d13[k] + b(1) * d24[k]),
        std::array::from_fn(|k| b(2) * d13[k] + b(3) * d24[k]),
    ]
}

impl Element for Membrane {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn create(parameters: &str, _material: &MaterialRef) -> Result<Self, String> {
        serde_json::from_str(parameters).map_err(|e| format!("parameters of my-membrane: {e}"))
    }

    fn sizes(&self) -> ElementSizes {
        ElementSizes {
            nodes: 4,
            dofs_per_node: 3,
            constants: CONSTANTS,
            material_points: 1,
            fields: FIELDS,
            ..ElementSizes::default()
        }
    }

    /// From the undeformed element: axes, derivatives of the shape functions, area, masses.
    fn initialise(&self, batch: &mut ElementBatch<'_>, material: &MaterialRef) {
        let lanes = batch.lanes;
        let areal_mass = material.sizes().areal_mass;
        for l in 0..lanes {
            let [d13, d24, h] = differences(batch.position, lanes, l);
            let normal = unit(cross(d13, d24));
            let axis: Vector = std::array::from_fn(|k| batch.axis[k * lanes + l]);
            // The axis lies in the plane up to rounding.
            let off = dot(axis, normal);
            let e1 = unit(std::array::from_fn(|k| axis[k] - off * normal[k]));
            let e2 = cross(normal, e1);
            let (u13, v13, u24, v24) = (dot(d13, e1), dot(d13, e2), dot(d24, e1), dot(d24, e2));
            let twice_area = u13 * v24 - u24 * v13;
            let constants: [f64; CONSTANTS] = [
                v24 / twice_area,
                -v13 / twice_area,
                -u24 / twice_area,
                u13 / twice_area,
                dot(h, e1),
                dot(h, e2),
                0.5 * twice_area,
            ];
            for (row, value) in constants.iter().enumerate() {
                batch.constants[row * lanes + l] = *value;
            }
            for node in 0..4 {
                batch.mass[node * lanes + l] = 0.25 * areal_mass * 0.5 * twice_area;
            }
        }
    }

    /// Long, so that all that makes an element of its own stands in one place, to be written anew.
    fn forces(&self, batch: &mut ElementBatch<'_>, material: &MaterialRef) -> i32 {
        let lanes = batch.lanes;
        let mut metric = Rows([0.0; 3 * MAX_LANES]);
        let mut stress = Rows([0.0; 3 * MAX_LANES]);
        let mut energy = Rows([0.0; MAX_LANES]);
        let mut tangent = Rows([0.0; 2 * MAX_LANES]);
        for l in 0..lanes {
            let [d13, d24, _] = differences(batch.position, lanes, l);
            let [g1, g2] = axes(d13, d24, &batch.constants, lanes, l);
            metric.0[l] = dot(g1, g1);
            metric.0[lanes + l] = dot(g2, g2);
            metric.0[2 * lanes + l] = dot(g1, g2);
        }
        let wanted = batch.critical_step.is_some();
        let code = material.membrane(&mut MembraneBatch {
            lanes,
            dt: batch.dt,
            metric: &metric.0[..3 * lanes],
            history: batch.material_history,
            stress: &mut stress.0[..3 * lanes],
            energy: &mut energy.0[..lanes],
            stiffness: wanted.then_some(&mut tangent.0[..2 * lanes]),
        });
        if code != PF_OK {
            return code;
        }
        let areal_mass = material.sizes().areal_mass;
        for l in 0..lanes {
            let row = |rows: &[f64], r: usize| rows[r * lanes + l];
            let c = |r: usize| batch.constants[r * lanes + l];
            let (h1, h2, area, k) = (c(4), c(5), c(6), self.hourglass);
            let [s11, s22, s12] = [0, 1, 2].map(|r| row(&stress.0, r));
            let [c11, c22, c12] = [0, 1, 2].map(|r| row(&metric.0, r));
            let [d13, d24, h] = differences(batch.position, lanes, l);
            let [g1, g2] = axes(d13, d24, &batch.constants, lanes, l);
            let mut mode = 0.0;
            for i in 0..3 {
                let q = h[i] - h1 * g1[i] - h2 * g2[i];
                mode += q * q;
                // dW/dg_a, then dW/d(x1 - x3) and dW/d(x2 - x4).
                let p1 = area * (s11 * g1[i] + s12 * g2[i]) - k * h1 * q;
                let p2 = area * (s12 * g1[i] + s22 * g2[i]) - k * h2 * q;
                let (f13, f24) = (c(0) * p1 + c(2) * p2, c(1) * p1 + c(3) * p2);
                let of_nodes = [f13 + k * q, f24 - k * q, -f13 + k * q, -f24 - k * q];
                for (node, force) in of_nodes.into_iter().enumerate() {
                    batch.force[(3 * node + i) * lanes + l] = force;
                }
            }
            batch.energy[PF_ENERGY_MEMBRANE * lanes + l] = area * energy.0[l];
            batch.energy[PF_ENERGY_BENDING * lanes + l] = 0.0;
            batch.energy[PF_ENERGY_HOURGLASS * lanes + l] = 0.5 * k * mode;
            if let Some(fields) = batch.fields.as_deref_mut() {
                let sine = (c12 / (c11 * c22).sqrt()).clamp(-1.0, 1.0);
                fields[l] = sine.asin();
                fields[lanes + l] = c11.sqrt() - 1.0;
                fields[2 * lanes + l] = c22.sqrt() - 1.0;
            }
            if let Some(step) = batch.critical_step.as_deref_mut() {
                // omega^2 <= (largest stiffness) / (nodal mass), by norms: |dg|^2 <= 2 |b|^2 |dx|^2, and the second
                // derivative of W by g is at most (tangent * stretch^2 + tension).
                let gradient = largest(
                    c(0) * c(0) + c(2) * c(2),
                    c(1) * c(1) + c(3) * c(3),
                    c(0) * c(1) + c(2) * c(3),
                );
                let sheet = tangent.0[l] * largest(c11, c22, c12) + largest(s11, s22, s12).max(0.0);
                let (m13, m24) = (h1 * c(0) + h2 * c(2), h1 * c(1) + h2 * c(3));
                let pattern = 4.0 + 2.0 * (m13 * m13 + m24 * m24);
                let stiffness = 2.0 * area * gradient * sheet + k * pattern;
                step[l] = 2.0 * (0.25 * areal_mass * area / stiffness).sqrt();
            }
        }
        PF_OK
    }
}

export_element!(Membrane);
