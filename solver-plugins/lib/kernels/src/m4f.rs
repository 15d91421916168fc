//! `m4f`: a four-node membrane quadrilateral in space with four points and no hourglass control.
//!
//! At each Gauss point p of the 2 x 2 rule the columns of the deformation gradient along the material axes are
//! `g_a = N_i,a x_i`, the metric is `C_ab = g_a . g_b`, and the internal force is the exact gradient of `sum_p A_p W(C_p)`:
//! `f_i = sum_p A_p (N_i,1 (S11 g1 + S12 g2) + N_i,2 (S12 g1 + S22 g2))` (total Lagrangian, as any textbook has it, such as
//! Belytschko, Liu, Moran, Nonlinear Finite Elements, 4.9). The reference is projected on the plane of its diagonals.
//!
//! Every in-plane mode has its stiffness from the material, so nothing has to be controlled. The price: 4 calls of the material instead of
//! one, and locking where stiff fibres are not parallel to the sides, because all four points then forbid what the element cannot do
//! otherwise: a coarse spar of plies at +-45 deg sheared by -8 deg where [`crate::m4`] gives -22 deg. So a material as stiff along its fibres as a
//! fabric is refused unless the fibres run along the sides. The element is for films, and for telling hourglass control from material.

use crate::coupling;
use crate::quad::{
    FIELDS, MAX_LANES, Scratch, View, fields_of, largest, material_call, material_frame,
    stiffness_at_rest,
};
use crate::record;
use crate::{Lanes, WIDTH, dispatch};
use plyflow_geometry::vec3::{Vec3, cross, dot, sub};
use plyflow_sdk::abi::{PF_ENERGIES, PF_OK};
use plyflow_sdk::{
    Aligned, Element, ElementBatch, ElementSizes, ElementTape, MaterialRef, MaterialSizes,
};

/// Points of the 2 x 2 Gauss rule.
const POINTS: usize = 4;
/// Rows of constants of a point: `N_i,1` and `N_i,2` of four nodes (1/m), area (m2).
const PER_POINT: usize = 9;
/// Rows of constants; the last one is the least area that a node has (m2).
const CONSTANTS: usize = POINTS * PER_POINT + 1;
/// Corners and Gauss points of the unit square, counter-clockwise.
const SIGNS: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
/// 1 / sqrt(3).
const GAUSS: f64 = 0.577_350_269_189_625_8;

/// Largest tangent over shear tangent at rest from which a material counts as a fabric: an isotropic sheet has at most 6, a fabric some 10,000.
const FABRIC: f64 = 100.0;

/// Parameters; see the manifest.
#[derive(Default, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Parameters {
    fibres_along_sides: bool,
}

/// The formulation.
pub struct M4f;

impl Element for M4f {
    const MANIFEST: &'static str = include_str!("m4f/manifest.json");

    fn create(parameters: &str, material: &MaterialRef) -> Result<Self, String> {
        let p: Parameters = serde_json::from_str(parameters)
            .map_err(|e| format!("parameters of element 'm4f': {e}"))?;
        let (largest, shear) = stiffness_at_rest(material)?;
        if largest > FABRIC * shear && !p.fibres_along_sides {
            return Err(format!(
                "element 'm4f' locks where stiff fibres are not parallel to its sides, and this material is {:.0} times as stiff along its fibres \
                 as in shear (at most {FABRIC}): its shear would come out far too small. Use 'm4', or say 'fibres_along_sides: true' where all \
                 elements lie along the fibres",
                largest / shear
            ));
        }
        if largest > FABRIC * shear && coupling::softest(material).is_some() {
            return Err(
                "element 'm4f': given fibres_along_sides, but the families of this material do not cross at a right angle, so both cannot lie along \
                 sides: use 'm4'"
                    .into(),
            );
        }
        Ok(Self)
    }

    fn sizes(&self) -> ElementSizes {
        ElementSizes {
            nodes: 4,
            dofs_per_node: 3,
            constants: CONSTANTS,
            material_points: POINTS,
            fields: FIELDS,
            ..Default::default()
        }
    }

    fn initialise(&self, batch: &mut ElementBatch<'_>, material: &MaterialRef) {
        let n = batch.lanes;
        let areal_mass = material.sizes().areal_mass;
        for l in 0..n {
            let x = |i: usize| core::array::from_fn(|k| batch.position[(3 * i + k) * n + l]);
            let axis = core::array::from_fn(|k| batch.axis[k * n + l]);
            let (constants, areas) = reference([0, 1, 2, 3].map(x), axis);
            for (r, value) in constants.iter().enumerate() {
                batch.constants[r * n + l] = *value;
            }
            for (i, area) in areas.iter().enumerate() {
                batch.mass[i * n + l] = area * areal_mass;
            }
        }
        if let Some(step) = batch.critical_step.as_deref_mut() {
            let points = Points {
                constants: &batch.constants,
                n,
                position: batch.position,
                material,
            };
            let mut history = Aligned::zeros(POINTS * material.sizes().membrane_history * n);
            let mut s = Scratch::<MAX_LANES>::new();
            step.fill(0.0);
            let code = points.each(&mut history, 0.0, true, &mut s.view(), |constants, s| {
                add_stiffness(constants, n, s, step);
            });
            match code {
                PF_OK => points.critical_step(step),
                _ => step.fill(0.0),
            }
        }
    }

    fn forces(&self, batch: &mut ElementBatch<'_>, material: &MaterialRef) -> i32 {
        // As in [`crate::quad`]; of one point at a time, which stays in the nearest cache.
        match batch.lanes {
            0..=16 => forces_with(batch, material, Scratch::<16>::new().view()),
            17..=32 => forces_with(batch, material, Scratch::<32>::new().view()),
            _ => forces_with(batch, material, Scratch::<MAX_LANES>::new().view()),
        }
    }

    fn tape(&self, what: ElementTape, material: &MaterialSizes) -> Result<Option<String>, String> {
        record::of_element(self, what, *material)
    }
}

fn forces_with(batch: &mut ElementBatch<'_>, material: &MaterialRef, mut s: View<'_>) -> i32 {
    let n = batch.lanes;
    let points = Points {
        constants: &batch.constants,
        n,
        position: batch.position,
        material,
    };
    let (force, energy) = (&mut *batch.force, &mut *batch.energy);
    force[..12 * n].fill(0.0);
    energy[..PF_ENERGIES * n].fill(0.0);
    let mut step = batch.critical_step.as_deref_mut();
    if let Some(step) = &mut step {
        step.fill(0.0);
    }
    let mut means = batch.fields.as_ref().map(|_| [[0.0; 3 * MAX_LANES]; 2]);
    let (history, wanted) = (&mut *batch.material_history, step.is_some());
    let code = points.each(history, batch.dt, wanted, &mut s, |constants, s| {
        add_forces(constants, n, s, force, energy);
        if let Some(step) = &mut step {
            add_stiffness(constants, n, s, step);
        }
        if let Some(means) = &mut means {
            points.add_means(constants, s, means);
        }
    });
    if code != PF_OK {
        return code;
    }
    if let Some(step) = step {
        points.critical_step(step);
    }
    if let (Some(fields), Some([metric, stress])) = (batch.fields.as_deref_mut(), means) {
        fields_of(n, &metric, &stress, fields);
    }
    PF_OK
}

/// Constants of an element with corners `x` (m) and the fabric's `axis`, and the areas of its nodes (m2).
fn reference(x: [Vec3; 4], axis: Vec3) -> ([f64; CONSTANTS], [f64; 4]) {
    let normal = cross(sub(x[0], x[2]), sub(x[1], x[3]));
    let (e1, e2, _) = material_frame(axis, normal);
    let flat = x.map(|p| [dot(p, e1), dot(p, e2)]);
    let mut constants = [0.0; CONSTANTS];
    let mut areas = [0.0; 4];
    for (p, at) in SIGNS.iter().enumerate() {
        let [xi, eta] = at.map(|s| s * GAUSS);
        let slopes = SIGNS.map(|[s, t]| [0.25 * s * (1.0 + t * eta), 0.25 * t * (1.0 + s * xi)]);
        let mut jacobian = [[0.0; 2]; 2];
        for (slope, place) in slopes.iter().zip(&flat) {
            for a in 0..2 {
                for b in 0..2 {
                    jacobian[a][b] += slope[a] * place[b];
                }
            }
        }
        let [[a, b], [c, d]] = jacobian;
        let area = (a * d - b * c).max(f64::MIN_POSITIVE);
        let rows = &mut constants[p * PER_POINT..];
        for (i, [s, t]) in slopes.iter().enumerate() {
            rows[i] = (d * s - b * t) / area;
            rows[4 + i] = (a * t - c * s) / area;
            let [along, across] = SIGNS[i];
            areas[i] += area * 0.25 * (1.0 + along * xi) * (1.0 + across * eta);
        }
        rows[8] = area;
    }
    constants[CONSTANTS - 1] = areas.iter().fold(f64::INFINITY, |m, a| m.min(*a));
    (constants, areas)
}

/// The points of a batch, one after the other.
struct Points<'a> {
    constants: &'a [f64],
    n: usize,
    position: &'a [f64],
    material: &'a MaterialRef,
}

impl Points<'_> {
    /// Calls `then` with the constants of each point once its metric and stress stand in `s`, and its tangents where these are `wanted`;
    /// the material's code.
    fn each(
        &self,
        history: &mut [f64],
        dt: f64,
        wanted: bool,
        s: &mut View<'_>,
        mut then: impl FnMut(&[f64], &View<'_>),
    ) -> i32 {
        let n = self.n;
        let rows = self.material.sizes().membrane_history * n;
        for p in 0..POINTS {
            let constants = &self.constants[p * PER_POINT * n..];
            metric_of(self.position, constants, n, s);
            let history = &mut history[p * rows..(p + 1) * rows];
            let code = material_call(self.material, history, n, dt, s, wanted);
            if code != PF_OK {
                return code;
            }
            then(constants, s);
        }
        PF_OK
    }

    /// A bound of 2 / omega_max with the lightest node's mass, in the place of what [`add_stiffness`] has summed.
    fn critical_step(&self, step: &mut [f64]) {
        let areal_mass = self.material.sizes().areal_mass;
        for (l, step) in step[..self.n].iter_mut().enumerate() {
            let mass = areal_mass * self.constants[(CONSTANTS - 1) * self.n + l];
            *step = 2.0 * (mass / *step).sqrt();
        }
    }

    /// Adds a point's part of the means of metric and stress over the area, `[3][lanes]` each.
    fn add_means(&self, constants: &[f64], s: &View<'_>, means: &mut [[f64; 3 * MAX_LANES]; 2]) {
        let n = self.n;
        let area = |p: usize, l: usize| self.constants[(p * PER_POINT + 8) * n + l];
        for k in 0..3 * n {
            let all: f64 = (0..POINTS).map(|p| area(p, k % n)).sum();
            let share = constants[8 * n + k % n] / all;
            means[0][k] += share * s.metric[k];
            means[1][k] += share * s.stress[k];
        }
    }
}

/// Adds a point's part of a bound of the stiffness (N/m) of each lane, as that of [`crate::quad`].
fn add_stiffness(constants: &[f64], n: usize, s: &View<'_>, sum: &mut [f64]) {
    for l in 0..n {
        let b = |r: usize| constants[r * n + l];
        let product = |r: usize, s: usize| (0..4).map(|i| b(r + i) * b(s + i)).sum::<f64>();
        let gradient = largest(product(0, 0), product(4, 4), product(0, 4));
        let row = |of: &[f64], r: usize| of[r * n + l];
        let metric = [0, 1, 2].map(|r| row(s.metric, r));
        let stress = [0, 1, 2].map(|r| row(s.stress, r));
        let [tangent, shear] = [0, 1].map(|r| row(s.stiffness, r).max(0.0));
        let stretch = largest(metric[0], metric[1], metric[2]);
        let pulled = largest(stress[0], stress[1], stress[2]).max(0.0);
        let along = (tangent * metric[0].max(metric[1])).sqrt();
        let across = (shear * (metric[0] + metric[1])).sqrt();
        let material = (tangent * stretch).min((along + across).powi(2));
        sum[l] += b(8) * (material + pulled) * gradient;
    }
}

dispatch!(fn metric_of(position: &[f64], constants: &[f64], n: usize, s: &mut View<'_>) = metric_kernel, lanes n);
dispatch!(fn add_forces(
    constants: &[f64],
    n: usize,
    s: &View<'_>,
    force: &mut [f64],
    energy: &mut [f64],
) = forces_kernel, lanes n);

#[inline(always)]
fn metric_kernel<V: Lanes>(position: &[f64], constants: &[f64], n: usize, s: &mut View<'_>) {
    for c in (0..n).step_by(WIDTH) {
        let slope = |r: usize| V::load(constants, r * n + c);
        let (mut c11, mut c22, mut c12) = (V::splat(0.0), V::splat(0.0), V::splat(0.0));
        for k in 0..3 {
            let (mut g1, mut g2) = (V::splat(0.0), V::splat(0.0));
            for i in 0..4 {
                let x = V::load(position, (3 * i + k) * n + c);
                g1 = g1 + slope(i) * x;
                g2 = g2 + slope(4 + i) * x;
            }
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

/// Adds a point's part.
#[inline(always)]
fn forces_kernel<V: Lanes>(
    constants: &[f64],
    n: usize,
    s: &View<'_>,
    force: &mut [f64],
    energy: &mut [f64],
) {
    for c in (0..n).step_by(WIDTH) {
        let row = |r: usize| V::load(constants, r * n + c);
        let area = row(8);
        let s11 = V::load(s.stress, c) * area;
        let s22 = V::load(s.stress, n + c) * area;
        let s12 = V::load(s.stress, 2 * n + c) * area;
        for k in 0..3 {
            let g1 = V::load(s.g, k * n + c);
            let g2 = V::load(s.g, (3 + k) * n + c);
            let t1 = s11 * g1 + s12 * g2;
            let t2 = s12 * g1 + s22 * g2;
            for i in 0..4 {
                let at = (3 * i + k) * n + c;
                (V::load(force, at) + (row(i) * t1 + row(4 + i) * t2)).store(force, at);
            }
        }
        (V::load(energy, c) + V::load(s.energy, c) * area).store(energy, c);
    }
}
