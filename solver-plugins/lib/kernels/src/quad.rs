//! The one-point membrane quadrilateral that `m4` and `rf4` share.
//!
//! With one point the deformation gradient's columns along the material axes e1, e2 are
//! `g_a = b_1a (x1 - x3) + b_2a (x2 - x4)` (Flanagan and Belytschko 1981), the metric is
//! `C_ab = g_a . g_b`, and the internal force is the exact gradient of
//!
//! `A0 W(C) + k/2 (|q|^2 - (q . n)^2) + k_n/2 (q . n)^2`,
//!
//! with the hourglass vector `q = x1 - x2 + x3 - x4 - h_1 g_1 - h_2 g_2`, which vanishes for every
//! affine motion of a flat reference element (so the mode is measured from the reference shape and
//! turns with the element), and the normal `n = g1 x g2 / |g1 x g2|`.

use crate::coupling;
use crate::rows::Rows;
use crate::{Lanes, WIDTH, dispatch};
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{Vec3, cross, dot, sub};
use plyflow_sdk::abi::PF_OK;
use plyflow_sdk::{Aligned, ElementBatch, ElementSizes, MaterialRef, MembraneBatch};

/// Rows of constants: b11, b21, b12, b22 (1/m), h1, h2 (m), area (m2), k, k_n (N/m).
pub const CONSTANTS: usize = 9;
/// Rows of fields: shear angle (rad), two fibre strains, largest principal stretch, S11, S22, S12 (N/m).
pub const FIELDS: usize = 7;
/// Most lanes in a batch.
pub const MAX_LANES: usize = 64;
/// Hourglass stiffness may not exceed this part of the material's largest tangent: more than the
/// exact in-plane bending of a fully integrated element (1/12) needs no control, and light films
/// would lose their time step.
const HOURGLASS_CAP: f64 = 0.25;

/// Sizes of the quadrilateral.
pub(crate) fn sizes() -> ElementSizes {
    ElementSizes {
        nodes: 4,
        dofs_per_node: 3,
        constants: CONSTANTS,
        material_points: 1,
        fields: FIELDS,
        ..Default::default()
    }
}

/// Hourglass stiffnesses of an element formulation for one material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hourglass {
    /// In the element's plane (N/m).
    pub plane: f64,
    /// Along its normal (N/m).
    pub normal: f64,
}

impl Hourglass {
    /// `plane = factor * min(max(shear tangent at rest, floor), a quarter of the largest tangent)`, where the shear tangent is that of
    /// [`stiffness_at_rest`],
    /// `normal = normal_factor * plane`.
    ///
    /// # Errors
    /// When the material refuses its undeformed state or a stiffness is not finite.
    pub fn new(
        factor: f64,
        floor: f64,
        normal_factor: f64,
        material: &MaterialRef,
    ) -> Result<Self, String> {
        let (largest, shear) = stiffness_at_rest(material)?;
        let plane = factor * shear.max(floor).min(HOURGLASS_CAP * largest);
        let normal = normal_factor * plane;
        if !(plane >= 0.0 && normal >= 0.0 && plane.is_finite() && normal.is_finite()) {
            return Err(format!(
                "hourglass stiffness {plane} N/m (normal {normal} N/m): expected finite values of \
                 at least 0; look at 'hourglass', 'hourglass_floor' and 'hourglass_normal'"
            ));
        }
        Ok(Self { plane, normal })
    }
}

/// Largest tangent (N/m) of a material in its undeformed state, and how soft it is: its shear tangent, or where shear and stretches
/// hang together half of its softest one ([`crate::coupling`]).
///
/// # Errors
/// When the material fails or gives values that are not finite and positive.
pub fn stiffness_at_rest(material: &MaterialRef) -> Result<(f64, f64), String> {
    let mut metric = Rows::<{ 3 * WIDTH }>::zeros();
    metric.0[..2 * WIDTH].fill(1.0);
    let mut history = Aligned::zeros(material.sizes().membrane_history * WIDTH);
    let mut stress = Rows::<{ 3 * WIDTH }>::zeros();
    let mut energy = Rows::<WIDTH>::zeros();
    let mut stiffness = Rows::<{ 2 * WIDTH }>::zeros();
    let code = material.membrane(&mut MembraneBatch {
        lanes: WIDTH,
        dt: 0.0,
        metric: &metric.0,
        history: &mut history,
        stress: &mut stress.0,
        energy: &mut energy.0,
        stiffness: Some(&mut stiffness.0),
    });
    let (largest, shear) = (stiffness.0[0], stiffness.0[WIDTH]);
    if code != PF_OK || !(largest.is_finite() && largest > 0.0 && shear.is_finite()) {
        return Err(format!(
            "the material's undeformed state gave code {code}, tangent {largest} N/m and shear \
             tangent {shear} N/m: expected code 0 and finite, positive tangents"
        ));
    }
    Ok((largest, coupling::softest(material).unwrap_or(shear)))
}

/// a / |a|, by division: [`plyflow_geometry::vec3::unit`] multiplies, which rounds differently.
fn unit(a: Vec3) -> Vec3 {
    let l = dot(a, a).sqrt().max(f64::MIN_POSITIVE);
    [a[0] / l, a[1] / l, a[2] / l]
}

/// Orthonormal e1, e2, n: e1 is `axis` projected on the plane with normal along `normal`.
pub fn material_frame(axis: Vec3, normal: Vec3) -> (Vec3, Vec3, Vec3) {
    let n = unit(normal);
    let p = dot(axis, n);
    let mut e1 = sub(axis, [p * n[0], p * n[1], p * n[2]]);
    if dot(e1, e1) < 1e-20 {
        // The axis is normal to the sheet: any direction in the plane, but always the same.
        let helper = if n[0].abs() < 0.9 {
            [1.0, 0.0, 0.0]
        } else {
            [0.0, 1.0, 0.0]
        };
        let h = dot(helper, n);
        e1 = sub(helper, [h * n[0], h * n[1], h * n[2]]);
    }
    let e1 = unit(e1);
    (e1, cross(n, e1), n)
}

/// Writes the constants and nodal masses (a quarter of the element's each) of a batch.
pub fn initialise(batch: &mut ElementBatch<'_>, material: &MaterialRef, hourglass: Hourglass) {
    let n = batch.lanes;
    let areal_mass = material.sizes().areal_mass;
    for l in 0..n {
        let x =
            |i: usize| -> Vec3 { core::array::from_fn(|k| batch.position[(3 * i + k) * n + l]) };
        let axis: Vec3 = core::array::from_fn(|k| batch.axis[k * n + l]);
        let (d13, d24) = (sub(x(0), x(2)), sub(x(1), x(3)));
        let normal = cross(d13, d24);
        let (e1, e2, _) = material_frame(axis, normal);
        let (u13, v13, u24, v24) = (dot(d13, e1), dot(d13, e2), dot(d24, e1), dot(d24, e2));
        let twice = (u13 * v24 - u24 * v13).max(f64::MIN_POSITIVE);
        let h: Vec3 = core::array::from_fn(|k| x(0)[k] - x(1)[k] + x(2)[k] - x(3)[k]);
        let row = [
            v24 / twice,
            -v13 / twice,
            -u24 / twice,
            u13 / twice,
            dot(h, e1),
            dot(h, e2),
            0.5 * twice,
            hourglass.plane,
            hourglass.normal,
        ];
        for (r, v) in row.iter().enumerate() {
            batch.constants[r * n + l] = *v;
        }
        for i in 0..4 {
            batch.mass[i * n + l] = 0.125 * twice * areal_mass;
        }
    }
    if let Some(step) = batch.critical_step.as_deref_mut() {
        let mut history = Aligned::zeros(material.sizes().membrane_history * n);
        let mut scratch = Scratch::<MAX_LANES>::new();
        let mut scratch = scratch.view();
        metric_of(batch.position, &batch.constants, n, &mut scratch);
        if material_call(material, &mut history, n, 0.0, &mut scratch, true) != PF_OK {
            step.fill(0.0);
            return;
        }
        critical_step_of(&batch.constants, n, areal_mass, &scratch, step);
    }
}

/// What one batch of at most `N` lanes needs between the material call and the forces. Rows of n
/// lanes lie one after the other from the start of each field.
#[repr(align(64))]
pub(crate) struct Scratch<const N: usize> {
    /// g1, g2: `[2][3][lanes]`.
    g: [[f64; N]; 6],
    metric: [[f64; N]; 3],
    stress: [[f64; N]; 3],
    energy: [f64; N],
    stiffness: [[f64; N]; 2],
    /// |q|, |q . n|
    mode: [[f64; N]; 2],
}

impl<const N: usize> Scratch<N> {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self {
            g: [[0.0; N]; 6],
            metric: [[0.0; N]; 3],
            stress: [[0.0; N]; 3],
            energy: [0.0; N],
            stiffness: [[0.0; N]; 2],
            mode: [[0.0; N]; 2],
        }
    }

    pub(crate) fn view(&mut self) -> View<'_> {
        View {
            g: self.g.as_flattened_mut(),
            metric: self.metric.as_flattened_mut(),
            stress: self.stress.as_flattened_mut(),
            energy: &mut self.energy,
            stiffness: self.stiffness.as_flattened_mut(),
            mode: self.mode.as_flattened_mut(),
        }
    }
}

/// A [`Scratch`] of any size.
pub(crate) struct View<'a> {
    pub(crate) g: &'a mut [f64],
    pub(crate) metric: &'a mut [f64],
    pub(crate) stress: &'a mut [f64],
    pub(crate) energy: &'a mut [f64],
    pub(crate) stiffness: &'a mut [f64],
    mode: &'a mut [f64],
}

/// The material's part of a point, in the rows of `s`; its code.
pub(crate) fn material_call(
    material: &MaterialRef,
    history: &mut [f64],
    n: usize,
    dt: f64,
    s: &mut View<'_>,
    stiffness: bool,
) -> i32 {
    material.membrane(&mut MembraneBatch {
        lanes: n,
        dt,
        metric: &s.metric[..3 * n],
        history,
        stress: &mut s.stress[..3 * n],
        energy: &mut s.energy[..n],
        stiffness: if stiffness {
            Some(&mut s.stiffness[..2 * n])
        } else {
            None
        },
    })
}

/// Internal forces, energies and, when asked for, fields and critical steps of a batch. The row of
/// bending energy is set to zero.
pub fn forces(batch: &mut ElementBatch<'_>, material: &MaterialRef) -> i32 {
    // Zeroing the scratch costs as much as it is large.
    match batch.lanes {
        0..=16 => forces_with(batch, material, Scratch::<16>::new().view()),
        17..=32 => forces_with(batch, material, Scratch::<32>::new().view()),
        _ => forces_with(batch, material, Scratch::<MAX_LANES>::new().view()),
    }
}

fn forces_with(batch: &mut ElementBatch<'_>, material: &MaterialRef, mut s: View<'_>) -> i32 {
    let n = batch.lanes;
    metric_of(batch.position, &batch.constants, n, &mut s);
    let wanted = batch.critical_step.is_some();
    let code = material_call(
        material,
        batch.material_history,
        n,
        batch.dt,
        &mut s,
        wanted,
    );
    if code != PF_OK {
        return code;
    }
    forces_of(
        batch.position,
        &batch.constants,
        n,
        &mut s,
        batch.force,
        batch.energy,
    );
    if let Some(step) = batch.critical_step.as_deref_mut() {
        critical_step_of(&batch.constants, n, material.sizes().areal_mass, &s, step);
    }
    if let Some(fields) = batch.fields.as_deref_mut() {
        fields_of(n, s.metric, s.stress, fields);
    }
    PF_OK
}

dispatch!(fn metric_of(position: &[f64], constants: &[f64], n: usize, s: &mut View<'_>) = metric_kernel, lanes n);
dispatch!(fn forces_of(
    position: &[f64],
    constants: &[f64],
    n: usize,
    s: &mut View<'_>,
    force: &mut [f64],
    energy: &mut [f64],
) = forces_kernel, lanes n);

#[inline(always)]
fn metric_kernel<V: Lanes>(position: &[f64], constants: &[f64], n: usize, s: &mut View<'_>) {
    for c in (0..n).step_by(WIDTH) {
        let b = |r: usize| V::load(constants, r * n + c);
        let (b11, b21, b12, b22) = (b(0), b(1), b(2), b(3));
        let (mut c11, mut c22, mut c12) = (V::splat(0.0), V::splat(0.0), V::splat(0.0));
        for k in 0..3 {
            let d13 = V::load(position, k * n + c) - V::load(position, (6 + k) * n + c);
            let d24 = V::load(position, (3 + k) * n + c) - V::load(position, (9 + k) * n + c);
            let g1 = b11 * d13 + b21 * d24;
            let g2 = b12 * d13 + b22 * d24;
            g1.store(s.g, k * n + c);
            g2.store(s.g, (3 + k) * n + c);
            c11 = c11 + g1 * g1;
            c22 = c22 + g2 * g2;
            c12 = c12 + g1 * g2;
        }
        c11.store(s.metric, c);
        c22.store(s.metric, n + c);
        c12.store(s.metric, 2 * n + c);
    }
}

/// Long, as it is the loop of a kernel: pieces of it would share most of its values, and its speed would hang on how they are inlined.
#[inline(always)]
fn forces_kernel<V: Lanes>(
    position: &[f64],
    constants: &[f64],
    n: usize,
    s: &mut View<'_>,
    force: &mut [f64],
    energy: &mut [f64],
) {
    let half = V::splat(0.5);
    for c in (0..n).step_by(WIDTH) {
        let b = |r: usize| V::load(constants, r * n + c);
        let (b11, b21, b12, b22) = (b(0), b(1), b(2), b(3));
        let (h1, h2, area, plane, normal) = (b(4), b(5), b(6), b(7), b(8));
        let g1: [V; 3] = [
            V::load(s.g, c),
            V::load(s.g, n + c),
            V::load(s.g, 2 * n + c),
        ];
        let g2: [V; 3] = [
            V::load(s.g, 3 * n + c),
            V::load(s.g, 4 * n + c),
            V::load(s.g, 5 * n + c),
        ];
        let c11 = V::load(s.metric, c);
        let c22 = V::load(s.metric, n + c);
        let c12 = V::load(s.metric, 2 * n + c);
        // Dual vectors g^a and the normal; the floor keeps a collapsed element finite.
        let det = (c11 * c22 - c12 * c12).max(V::splat(1e-12));
        let inverse = V::splat(1.0) / det;
        let root = inverse.sqrt();
        let nx = (g1[1] * g2[2] - g1[2] * g2[1]) * root;
        let ny = (g1[2] * g2[0] - g1[0] * g2[2]) * root;
        let nz = (g1[0] * g2[1] - g1[1] * g2[0]) * root;
        let nn = [nx, ny, nz];
        let mut q = [V::splat(0.0); 3];
        let (mut qq, mut qn, mut q1, mut q2) =
            (V::splat(0.0), V::splat(0.0), V::splat(0.0), V::splat(0.0));
        for k in 0..3 {
            let x = |i: usize| V::load(position, (3 * i + k) * n + c);
            q[k] = ((x(0) - x(1)) + (x(2) - x(3))) - h1 * g1[k] - h2 * g2[k];
            qq = qq + q[k] * q[k];
            qn = qn + q[k] * nn[k];
            q1 = q1 + q[k] * g1[k];
            q2 = q2 + q[k] * g2[k];
        }
        let softer = plane - normal;
        let lift = softer * qn;
        // q . g^a, with g^1 = (C22 g1 - C12 g2) / det and g^2 = (C11 g2 - C12 g1) / det.
        let w1 = lift * (c22 * q1 - c12 * q2) * inverse;
        let w2 = lift * (c11 * q2 - c12 * q1) * inverse;
        let s11 = V::load(s.stress, c) * area;
        let s22 = V::load(s.stress, n + c) * area;
        let s12 = V::load(s.stress, 2 * n + c) * area;
        for k in 0..3 {
            let f = plane * q[k] - lift * nn[k];
            let t1 = s11 * g1[k] + s12 * g2[k] - h1 * f + w1 * nn[k];
            let t2 = s12 * g1[k] + s22 * g2[k] - h2 * f + w2 * nn[k];
            let u = b11 * t1 + b12 * t2;
            let w = b21 * t1 + b22 * t2;
            (f + u).store(force, k * n + c);
            (w - f).store(force, (3 + k) * n + c);
            (f - u).store(force, (6 + k) * n + c);
            (-(w + f)).store(force, (9 + k) * n + c);
        }
        (V::load(s.energy, c) * area).store(energy, c);
        V::splat(0.0).store(energy, n + c);
        (half * (plane * qq - softer * (qn * qn))).store(energy, 2 * n + c);
        qq.sqrt().store(s.mode, c);
        qn.abs().store(s.mode, n + c);
    }
}

/// A bound of 2 / omega_max with a quarter of the element's mass on each node: the stiffness is
/// `A (B^T D B + geometric)` plus the hourglass part, and each factor is replaced by its largest
/// eigenvalue; nearly exact for an undeformed square pulled along its largest tangent.
///
/// For the material part, a change dg of the columns gives the strain dE with `|dE|^2 <= c |dg|^2`,
/// c the largest eigenvalue of C; but also `dE11^2 + dE22^2 <= max(C11, C22) |dg|^2` and
/// `4 dE12^2 <= (C11 + C22) |dg|^2`. With the shear tangent G and a positive semi-definite D the
/// second pair gives `(sqrt(D max(C11, C22)) + sqrt(G (C11 + C22)))^2`, which does not grow when a
/// fabric with stiff fibres shears; the smaller bound counts.
fn critical_step_of(constants: &[f64], n: usize, areal_mass: f64, s: &View<'_>, step: &mut [f64]) {
    for l in 0..n {
        let b = |r: usize| constants[r * n + l];
        // B^T B: both directions, each with the two independent values twice.
        let b11 = 2.0 * (b(0) * b(0) + b(1) * b(1));
        let b22 = 2.0 * (b(2) * b(2) + b(3) * b(3));
        let b12 = 2.0 * (b(0) * b(2) + b(1) * b(3));
        let gradient = largest(b11, b22, b12);
        let metric = [s.metric[l], s.metric[n + l], s.metric[2 * n + l]];
        let stretch = largest(metric[0], metric[1], metric[2]);
        let stress = largest(s.stress[l], s.stress[n + l], s.stress[2 * n + l]).max(0.0);
        let (tangent, shear) = (s.stiffness[l].max(0.0), s.stiffness[n + l].max(0.0));
        let along = (tangent * metric[0].max(metric[1])).sqrt();
        let across = (shear * (metric[0] + metric[1])).sqrt();
        let material = (tangent * stretch).min((along + across).powi(2));
        let membrane = b(6) * (material + stress) * gradient;
        // The mode vector h - h1 B1 - h2 B2 has the length below because h and B are orthogonal.
        let mode = 4.0 + b(4) * b(4) * b11 + b(5) * b(5) * b22 + 2.0 * b(4) * b(5) * b12;
        let narrow = (metric[0] + metric[1] - stretch).max(1e-6).sqrt();
        let (q, qn) = (s.mode[l], s.mode[n + l]);
        let turn = gradient.sqrt() / narrow;
        let bent = (b(7) - b(8)).abs() * qn * (2.0 * mode.sqrt() * turn + 3.0 * q * turn * turn);
        let hourglass = b(7).max(b(8)) * mode + bent;
        let mass = 0.25 * areal_mass * b(6);
        step[l] = 2.0 * (mass / (membrane + hourglass)).sqrt();
    }
}

/// Largest eigenvalue of the symmetric [[a, c], [c, b]].
pub(crate) fn largest(a: f64, b: f64, c: f64) -> f64 {
    0.5 * (a + b) + (0.25 * (a - b) * (a - b) + c * c).sqrt()
}

/// Fields from the metric (C11, C22, C12) and the membrane resultants (S11, S22, S12), `[3][lanes]` each.
pub(crate) fn fields_of(n: usize, metric: &[f64], stress: &[f64], fields: &mut [f64]) {
    for l in 0..n {
        let (c11, c22, c12) = (metric[l], metric[n + l], metric[2 * n + l]);
        let product = (c11 * c22).sqrt().max(f64::MIN_POSITIVE);
        fields[l] = (c12 / product).clamp(-1.0, 1.0).fixed_asin();
        fields[n + l] = c11.sqrt() - 1.0;
        fields[2 * n + l] = c22.sqrt() - 1.0;
        fields[3 * n + l] = largest(c11, c22, c12).max(0.0).sqrt();
    }
    fields[4 * n..7 * n].copy_from_slice(&stress[..3 * n]);
}
