//! `rf4`: a rotation-free four-node shell: the membrane of [`crate::quad`], and bending from a patch
//! around every node that is surrounded by elements.
//!
//! In the undeformed plane (fibre axes e1, e2 at the patch centre, coordinates u, v) the positions of
//! the patch are fitted by `x = x_c + x,1 u + x,2 v + x,11 u^2/2 + x,22 v^2/2 + x,12 u v`, exactly at
//! the centre and by least squares (weights 1/r^4: every node counts by the curvature that it sees)
//! at the others. The weights depend on the reference alone, so each derivative is a fixed linear
//! combination of nodal positions, and with `n = x,1 x x,2 / |x,1 x x,2|`, `k_ab = n . x,ab`, the force
//! is the exact gradient of `area * W_b(k11, k22, k12)`:
//!
//! `f_I = area n [w_I11 M11 + w_I22 M22 + 2 w_I12 M12 - w_I1 p_1 - w_I2 p_2]`,
//! `p_c = (M11 x,11 + M22 x,22 + 2 M12 x,12) . a^c`, a^c dual to x,1, x,2 (because
//! `dn = -(n . dx,c) a^c`).
//!
//! When the patch does not determine all derivatives (a cross of four neighbours has no x,12), the
//! fit of least norm is taken: the undetermined derivative is zero and has no stiffness. The
//! material's moments must not depend on the metric (Plyflow's own do not) for the force to be an
//! exact gradient.
//!
//! `thickening: p`: a ply of constant volume is 1/J as thick when it is sheared to J = sqrt(det C) of its area, and its
//! section bends with `area J^-p W_b(k)`. What is bent then resists being sheared, by the gradient's other part
//! `-p area J^-p W_b (w_I1 a^1 + w_I2 a^2)` (because `d ln J = a^c . dx,c`). p = 2: a homogeneous section, J^-3 per width
//! as it is, J^-2 per undeformed width (`docs/decisions/0031`).
//!
//! Orientation: a patch does not know the winding of its elements. Its normal is the one of the
//! undeformed plane with a positive z component (or, in a vertical plane, y, else x): elements must
//! be wound counter-clockwise about it.

use crate::coupling;
use crate::m4::Parameters;
use crate::quad::{self, Hourglass, MAX_LANES, material_frame};
use crate::record;
use crate::{Lanes, WIDTH, dispatch, thickening};
use plyflow_geometry::Vec3;
use plyflow_sdk::abi::PF_OK;
use plyflow_sdk::{
    Aligned, BendingBatch, Element, ElementBatch, ElementSizes, ElementTape, MaterialRef,
    MaterialSizes, PatchBatch,
};

/// Most nodes of a patch, the centre first.
pub const PATCH_NODES: usize = 12;
/// Derivatives of the fit: x,1 x,2 x,11 x,22 x,12.
const TERMS: usize = 5;
/// Area, count, then `[node - 1][term]` weights.
const PATCH_CONSTANTS: usize = 2 + (PATCH_NODES - 1) * TERMS;
/// Curvatures and moments along the two fibre families.
const PATCH_FIELDS: usize = 4;

/// The formulation for one material.
pub struct Rf4 {
    hourglass: Hourglass,
    section: Section,
}

/// How a section bends.
#[derive(Clone, Copy)]
struct Section {
    thickening: u32,
    /// What the tangents of single curvatures are to be multiplied with to bound all of them together: 3 where a twist bends the families (a quadratic form
    /// is at most as often its diagonal as it has variables), else 1.
    coupling: f64,
}

impl Element for Rf4 {
    const MANIFEST: &'static str = include_str!("rf4/manifest.json");

    fn create(parameters: &str, material: &MaterialRef) -> Result<Self, String> {
        let p = Parameters::parse(parameters, "rf4")?;
        Ok(Self {
            hourglass: p.hourglass(material)?,
            section: Section {
                thickening: p.thickening,
                coupling: if coupling::twist_bends(material) {
                    3.0
                } else {
                    1.0
                },
            },
        })
    }

    fn sizes(&self) -> ElementSizes {
        ElementSizes {
            patch_nodes: PATCH_NODES,
            patch_constants: PATCH_CONSTANTS,
            patch_fields: PATCH_FIELDS,
            ..quad::sizes()
        }
    }

    fn initialise(&self, batch: &mut ElementBatch<'_>, material: &MaterialRef) {
        quad::initialise(batch, material, self.hourglass);
    }

    fn forces(&self, batch: &mut ElementBatch<'_>, material: &MaterialRef) -> i32 {
        quad::forces(batch, material)
    }

    fn patch_initialise(&self, batch: &mut PatchBatch<'_>, material: &MaterialRef) {
        let n = batch.lanes;
        for l in 0..n {
            let count = (batch.count[l] as usize).clamp(1, PATCH_NODES);
            let x: [Vec3; PATCH_NODES] = core::array::from_fn(|i| {
                core::array::from_fn(|k| batch.position[(3 * i + k) * n + l])
            });
            let axis: Vec3 = core::array::from_fn(|k| batch.axis[k * n + l]);
            let weights = fit(&x[..count], axis);
            batch.constants[l] = batch.area[l];
            batch.constants[n + l] = count as f64;
            for (i, w) in weights.iter().enumerate() {
                for (t, value) in w.iter().enumerate() {
                    batch.constants[(2 + i * TERMS + t) * n + l] = *value;
                }
            }
        }
        if let Some(stiffness) = batch.stiffness.as_deref_mut() {
            let mut s = Scratch::<MAX_LANES>::new();
            let mut s = s.view();
            derivatives(batch.position, &batch.constants, n, &mut s);
            let mut history = Aligned::zeros(material.sizes().bending_history * n);
            if bend(material, &mut history, n, 0.0, &mut s, true) != PF_OK {
                s.tangent.fill(f64::INFINITY);
            }
            row_sums(&batch.constants, n, self.section, &s, stiffness);
        }
    }

    fn patch_forces(&self, batch: &mut PatchBatch<'_>, material: &MaterialRef) -> i32 {
        let section = self.section;
        match batch.lanes {
            0..=16 => forces_with(batch, material, section, Scratch::<16>::new().view()),
            17..=32 => forces_with(batch, material, section, Scratch::<32>::new().view()),
            _ => forces_with(batch, material, section, Scratch::<MAX_LANES>::new().view()),
        }
    }

    fn tape(&self, what: ElementTape, material: &MaterialSizes) -> Result<Option<String>, String> {
        record::of_element(self, what, *material)
    }
}

fn forces_with(
    batch: &mut PatchBatch<'_>,
    material: &MaterialRef,
    section: Section,
    mut s: View<'_>,
) -> i32 {
    let (n, power) = (batch.lanes, section.thickening);
    derivatives(batch.position, &batch.constants, n, &mut s);
    let wanted = batch.stiffness.is_some();
    let code = bend(material, batch.history, n, batch.dt, &mut s, wanted);
    if code != PF_OK {
        return code;
    }
    if power > 0 {
        thickening::scale(power, n, s.metric, s.moment, s.tangent, s.energy);
    }
    forces(&batch.constants, n, power, &s, batch.force, batch.energy);
    if let Some(stiffness) = batch.stiffness.as_deref_mut() {
        row_sums(&batch.constants, n, section, &s, stiffness);
    }
    if let Some(fields) = batch.fields.as_deref_mut() {
        for l in 0..n {
            for a in 0..2 {
                let stretch = s.metric[a * n + l].max(f64::MIN_POSITIVE);
                fields[a * n + l] = s.curvature[a * n + l] / stretch;
                fields[(2 + a) * n + l] = s.moment[a * n + l];
            }
        }
    }
    PF_OK
}

/// Eigenvalues and eigenvectors (columns) of a symmetric matrix by cyclic Jacobi rotations.
fn eigen<const N: usize>(mut a: [[f64; N]; N]) -> ([f64; N], [[f64; N]; N]) {
    let mut v: [[f64; N]; N] =
        core::array::from_fn(|i| core::array::from_fn(|j| if i == j { 1.0 } else { 0.0 }));
    for _ in 0..30 {
        for p in 0..N {
            for q in p + 1..N {
                if a[p][q].abs() < 1e-300 {
                    continue;
                }
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for k in 0..N {
                    let (x, y) = (a[k][p], a[k][q]);
                    (a[k][p], a[k][q]) = (c * x - s * y, s * x + c * y);
                }
                for k in 0..N {
                    let (x, y) = (a[p][k], a[q][k]);
                    (a[p][k], a[q][k]) = (c * x - s * y, s * x + c * y);
                    let (x, y) = (v[k][p], v[k][q]);
                    (v[k][p], v[k][q]) = (c * x - s * y, s * x + c * y);
                }
            }
        }
    }
    (core::array::from_fn(|i| a[i][i]), v)
}

/// Normal of the undeformed plane of a patch, oriented as the module says.
fn plane_normal(x: &[Vec3]) -> Vec3 {
    let mut covariance = [[0.0; 3]; 3];
    for p in x {
        for i in 0..3 {
            for j in 0..3 {
                covariance[i][j] += (p[i] - x[0][i]) * (p[j] - x[0][j]);
            }
        }
    }
    let (values, vectors) = eigen(covariance);
    let least = (0..3).fold(0, |m, i| if values[i] < values[m] { i } else { m });
    let n: Vec3 = core::array::from_fn(|k| vectors[k][least]);
    let sign = [n[2], n[1], n[0]]
        .into_iter()
        .find(|c| c.abs() > 1e-6)
        .unwrap_or(1.0);
    n.map(|c| c * sign.signum())
}

/// Weights `[node - 1][term]` of the nodes after the centre; the centre's are minus their sum.
fn fit(x: &[Vec3], axis: Vec3) -> [[f64; TERMS]; PATCH_NODES - 1] {
    let mut weights = [[0.0; TERMS]; PATCH_NODES - 1];
    let (e1, e2, _) = material_frame(axis, plane_normal(x));
    let along = |p: &Vec3, e: &Vec3| (0..3).map(|k| (p[k] - x[0][k]) * e[k]).sum::<f64>();
    let local: Vec<[f64; 2]> = x[1..]
        .iter()
        .map(|p| [along(p, &e1), along(p, &e2)])
        .collect();
    let square = |p: &[f64; 2]| p[0] * p[0] + p[1] * p[1];
    let size = (local.iter().map(square).sum::<f64>() / local.len().max(1) as f64).sqrt();
    if size <= 0.0 || !size.is_finite() {
        return weights;
    }
    let rows: Vec<([f64; TERMS], f64)> = local
        .iter()
        .map(|p| {
            let (u, v) = (p[0] / size, p[1] / size);
            let r2 = (u * u + v * v).max(1e-12);
            ([u, v, 0.5 * u * u, 0.5 * v * v, u * v], 1.0 / (r2 * r2))
        })
        .collect();
    let mut normal = [[0.0; TERMS]; TERMS];
    for (row, w) in &rows {
        for i in 0..TERMS {
            for j in 0..TERMS {
                normal[i][j] += w * row[i] * row[j];
            }
        }
    }
    // Pseudo-inverse: what the nodes do not determine gets no weight.
    let (values, vectors) = eigen(normal);
    let largest = values.iter().fold(0.0f64, |m, v| m.max(*v));
    let scale = [
        1.0 / size,
        1.0 / size,
        size.powi(-2),
        size.powi(-2),
        size.powi(-2),
    ];
    for (to, (row, w)) in weights.iter_mut().zip(&rows) {
        for e in 0..TERMS {
            if values[e] < 1e-9 * largest {
                continue;
            }
            let part: f64 = (0..TERMS).map(|j| vectors[j][e] * row[j]).sum::<f64>() * w / values[e];
            for t in 0..TERMS {
                to[t] += vectors[t][e] * part * scale[t];
            }
        }
    }
    weights
}

/// What one batch of at most `N` lanes needs between the material call and the forces. Rows of n
/// lanes lie one after the other from the start of each field.
#[repr(align(64))]
struct Scratch<const N: usize> {
    /// x,11 x,22 x,12: `[3][3][lanes]`.
    second: [[f64; N]; 9],
    /// a^1, a^2, n: `[3][3][lanes]`.
    dual: [[f64; N]; 9],
    metric: [[f64; N]; 3],
    curvature: [[f64; N]; 3],
    moment: [[f64; N]; 3],
    energy: [f64; N],
    tangent: [[f64; N]; 3],
}

impl<const N: usize> Scratch<N> {
    #[inline(always)]
    fn new() -> Self {
        Self {
            second: [[0.0; N]; 9],
            dual: [[0.0; N]; 9],
            metric: [[0.0; N]; 3],
            curvature: [[0.0; N]; 3],
            moment: [[0.0; N]; 3],
            energy: [0.0; N],
            tangent: [[0.0; N]; 3],
        }
    }

    fn view(&mut self) -> View<'_> {
        View {
            second: self.second.as_flattened_mut(),
            dual: self.dual.as_flattened_mut(),
            metric: self.metric.as_flattened_mut(),
            curvature: self.curvature.as_flattened_mut(),
            moment: self.moment.as_flattened_mut(),
            energy: &mut self.energy,
            tangent: self.tangent.as_flattened_mut(),
        }
    }
}

/// A [`Scratch`] of any size.
struct View<'a> {
    second: &'a mut [f64],
    dual: &'a mut [f64],
    metric: &'a mut [f64],
    curvature: &'a mut [f64],
    moment: &'a mut [f64],
    energy: &'a mut [f64],
    tangent: &'a mut [f64],
}

fn bend(
    material: &MaterialRef,
    history: &mut [f64],
    n: usize,
    dt: f64,
    s: &mut View<'_>,
    tangent: bool,
) -> i32 {
    material.bending(&mut BendingBatch {
        lanes: n,
        dt,
        metric: &s.metric[..3 * n],
        curvature: &s.curvature[..3 * n],
        history,
        moment: &mut s.moment[..3 * n],
        energy: &mut s.energy[..n],
        tangent: if tangent {
            Some(&mut s.tangent[..3 * n])
        } else {
            None
        },
    })
}

dispatch!(fn derivatives(position: &[f64], constants: &[f64], n: usize, s: &mut View<'_>) = derivatives_kernel, lanes n);
dispatch!(fn forces(
    constants: &[f64],
    n: usize,
    power: u32,
    s: &View<'_>,
    force: &mut [f64],
    energy: &mut [f64],
) = forces_kernel, lanes n);

/// Nodes in use in a chunk: the most of its lanes (a lane's own unused nodes have zero weights and
/// sit on the centre, so they add exact zeros).
#[inline(always)]
fn used(constants: &[f64], n: usize, c: usize) -> usize {
    constants[n + c..n + c + WIDTH]
        .iter()
        .fold(1.0f64, |m, x| m.max(*x)) as usize
}

#[inline(always)]
fn derivatives_kernel<V: Lanes>(position: &[f64], constants: &[f64], n: usize, s: &mut View<'_>) {
    for c in (0..n).step_by(WIDTH) {
        let centre: [V; 3] = [
            V::load(position, c),
            V::load(position, n + c),
            V::load(position, 2 * n + c),
        ];
        let mut x = [[V::splat(0.0); 3]; TERMS];
        for i in 1..used(constants, n, c).min(PATCH_NODES) {
            let d: [V; 3] = [
                V::load(position, 3 * i * n + c) - centre[0],
                V::load(position, (3 * i + 1) * n + c) - centre[1],
                V::load(position, (3 * i + 2) * n + c) - centre[2],
            ];
            for t in 0..TERMS {
                let w = V::load(constants, (2 + (i - 1) * TERMS + t) * n + c);
                for k in 0..3 {
                    x[t][k] = x[t][k] + w * d[k];
                }
            }
        }
        let dot = |a: &[V; 3], b: &[V; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (a1, a2) = (&x[0], &x[1]);
        let (c11, c22, c12) = (dot(a1, a1), dot(a2, a2), dot(a1, a2));
        let inverse = V::splat(1.0) / (c11 * c22 - c12 * c12).max(V::splat(1e-12));
        let root = inverse.sqrt();
        let normal = [
            (a1[1] * a2[2] - a1[2] * a2[1]) * root,
            (a1[2] * a2[0] - a1[0] * a2[2]) * root,
            (a1[0] * a2[1] - a1[1] * a2[0]) * root,
        ];
        for k in 0..3 {
            ((c22 * a1[k] - c12 * a2[k]) * inverse).store(s.dual, k * n + c);
            ((c11 * a2[k] - c12 * a1[k]) * inverse).store(s.dual, (3 + k) * n + c);
            normal[k].store(s.dual, (6 + k) * n + c);
            for t in 0..3 {
                x[2 + t][k].store(s.second, (3 * t + k) * n + c);
            }
        }
        for (r, v) in [c11, c22, c12].into_iter().enumerate() {
            v.store(s.metric, r * n + c);
        }
        for t in 0..3 {
            dot(&normal, &x[2 + t]).store(s.curvature, t * n + c);
        }
    }
}

#[inline(always)]
fn forces_kernel<V: Lanes>(
    constants: &[f64],
    n: usize,
    power: u32,
    s: &View<'_>,
    force: &mut [f64],
    energy: &mut [f64],
) {
    let zero = V::splat(0.0);
    for c in (0..n).step_by(WIDTH) {
        let area = V::load(constants, c);
        let m11 = V::load(s.moment, c) * area;
        let m22 = V::load(s.moment, n + c) * area;
        let m12 = V::load(s.moment, 2 * n + c) * area * V::splat(2.0);
        let row = |from: &[f64], r: usize| V::load(from, r * n + c);
        let (mut p1, mut p2) = (zero, zero);
        for k in 0..3 {
            let v =
                m11 * row(s.second, k) + m22 * row(s.second, 3 + k) + m12 * row(s.second, 6 + k);
            p1 = p1 + v * row(s.dual, k);
            p2 = p2 + v * row(s.dual, 3 + k);
        }
        let normal = [row(s.dual, 6), row(s.dual, 7), row(s.dual, 8)];
        let mut sum = zero;
        let used = used(constants, n, c).min(PATCH_NODES);
        for i in 1..used {
            let w = |t: usize| row(constants, 2 + (i - 1) * TERMS + t);
            let f = (w(2) * m11 + w(3) * m22 + w(4) * m12) - (w(0) * p1 + w(1) * p2);
            sum = sum + f;
            for k in 0..3 {
                // Plus zero: a lane that does not use the node has +0 there, and not -0, whatever its neighbours use.
                (f * normal[k] + zero).store(force, (3 * i + k) * n + c);
            }
        }
        for k in 0..3 {
            (-(sum * normal[k])).store(force, k * n + c);
            for i in used..PATCH_NODES {
                zero.store(force, (3 * i + k) * n + c);
            }
        }
        if power > 0 {
            let pull = V::splat(f64::from(power)) * V::load(s.energy, c) * area;
            for k in 0..3 {
                let (p1, p2) = (pull * row(s.dual, k), pull * row(s.dual, 3 + k));
                let mut sum = zero;
                for i in 1..used {
                    let w = |t: usize| row(constants, 2 + (i - 1) * TERMS + t);
                    let f = w(0) * p1 + w(1) * p2;
                    sum = sum + f;
                    let at = (3 * i + k) * n + c;
                    (V::load(force, at) - f).store(force, at);
                }
                let at = k * n + c;
                (V::load(force, at) + sum).store(force, at);
            }
        }
        (V::load(s.energy, c) * area).store(energy, c);
    }
}

/// For each node a bound of the sum over the patch of the norms of the 3 x 3 blocks of the second
/// derivative of the energy: the tangent part `dM/dk dk dk` with each derivative as it is, and the
/// geometric part `M d2k` by norms. A section that thickens has `p^2 W dlnJ dlnJ - p W d2lnJ - 2 p M dk dlnJ` besides;
/// a block of `d2lnJ` is at most twice the product of its nodes' `|dlnJ|`.
fn row_sums(constants: &[f64], n: usize, section: Section, s: &View<'_>, stiffness: &mut [f64]) {
    let power = f64::from(section.thickening);
    for l in 0..n {
        let area = constants[l];
        let count = (constants[n + l] as usize).clamp(1, PATCH_NODES);
        let three = |from: &[f64], r: usize| -> Vec3 {
            core::array::from_fn(|k| from[(3 * r + k) * n + l])
        };
        let dot = |a: Vec3, b: Vec3| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let dual = [three(s.dual, 0), three(s.dual, 1)];
        let second = [three(s.second, 0), three(s.second, 1), three(s.second, 2)];
        let dual_length = dual.map(|a| dot(a, a).sqrt());
        let mut w = [[0.0; TERMS]; PATCH_NODES];
        for i in 1..count {
            for t in 0..TERMS {
                w[i][t] = constants[(2 + (i - 1) * TERMS + t) * n + l];
                w[0][t] -= w[i][t];
            }
        }
        let magnitude: [f64; TERMS] =
            core::array::from_fn(|t| w[..count].iter().map(|x| x[t].abs()).sum());
        let mut rows = [0.0; PATCH_NODES];
        for a in 0..3 {
            let twice = if a == 2 { 2.0 } else { 1.0 };
            let tangent = section.coupling * twice * s.tangent[a * n + l].abs() * area;
            let moment = twice * s.moment[a * n + l].abs() * area;
            let tilt = dual.map(|d| dot(second[a], d));
            let derivative = |x: &[f64; TERMS]| x[2 + a] - tilt[0] * x[0] - tilt[1] * x[1];
            let total: f64 = w[..count].iter().map(|x| derivative(x).abs()).sum();
            let bent = dot(second[a], second[a]).sqrt();
            let turn = dual_length[0] * magnitude[0] + dual_length[1] * magnitude[1];
            for (row, x) in rows[..count].iter_mut().zip(&w) {
                let own = dual_length[0] * x[0].abs() + dual_length[1] * x[1].abs();
                *row += tangent * derivative(x).abs() * total;
                *row += moment * (x[2 + a].abs() * turn + own * magnitude[2 + a]);
                *row += 3.0 * moment * bent * own * turn;
                *row += power * moment * (own * total + derivative(x).abs() * turn);
            }
        }
        let turn = dual_length[0] * magnitude[0] + dual_length[1] * magnitude[1];
        let swell = power * (power + 2.0) * area * s.energy[l];
        for (row, x) in rows[..count].iter_mut().zip(&w) {
            *row += swell * (dual_length[0] * x[0].abs() + dual_length[1] * x[1].abs()) * turn;
        }
        for (i, row) in rows.iter().enumerate() {
            stiffness[i * n + l] = *row;
        }
    }
}
