//! `s4`: a four-node shell with rotations (the S4R of the thesis): one point in its plane, three
//! layers through its thickness, hourglass control, nonlinear bending along the fibres.
//!
//! # Kinematics
//!
//! Every element keeps its own four unit directors d_I (start: its unit normal), which turn with the
//! nodes by the exact rotation `spin * dt`. So elements may meet at an angle in the reference, and
//! rotations may have any size. With the one-point gradient of [`crate::quad`], `g_a = x,a` and `d,a`,
//!
//! `C_ab = g_a . g_b`, `k_ab = -c (d,a . g_b + d,b . g_a) / 2`, `c = 1 + |q_d|^2 / 32`,
//!
//! with the directors' hourglass mode q_d; without it, c = 1, this is `n . x,ab` when d is normal to the surface (differentiate `d . x,b = 0`), and both vanish
//! under rigid motion. The factor c gives the slopes of the directors the length that the mode takes off them: four unit
//! vectors turned to and fro by b have a mean shorter by cos b, so that an element that is bent by more than about 0.4 rad from side to side
//! could unbend by this mode, against nothing but its hourglass control (`docs/decisions/0039`). Each side I-J has the transverse shear `e_IJ = (x_J - x_I) . (d_I + d_J) / 2`
//! less its value in the reference; it is zero for a side bent to an arc with normal directors, and
//! for every constant curvature (trapezoidal rule of a linear slope), whatever the element's shape.
//! The means of opposite sides give the transverse shear `gamma_a` at the point; their differences
//! `e_12 - e_43`, `e_14 - e_23` are two of the four modes that the point does not see (the warping
//! w = xi eta less the twist that the directors show, and the turning of the directors about the
//! normal): together these are the assumed strains of MITC4 (Dvorkin and Bathe 1984), written
//! without a reference normal. Constant curvature and constant twist are free of hourglass energy.
//!
//! # Energy of an element
//!
//! `A sum_i w_i W_m(C11, C22, C12 - 2 z_i k12) + A W_b(k) + gamma K gamma / 2 + hourglass`.
//!
//! Layers (thesis eqs 3.5-3.9): one material point in the middle and one in each surface layer,
//! `w = [t/h, (1 - t/h)/2, (1 - t/h)/2]`, `z = [0, +(h + t)/4, -(h + t)/4]`: with a surface modulus
//! these give eq. 3.8. The fibres' bending is the material's moment law, so the layers see no fibre
//! bending strain; they see the twist, and their shear stresses give the thesis' only twist stiffness
//! (eqs 3.19, 3.20: G12 acts in the surface layers too). The weights add to one: a flat sheet has the
//! material's membrane response exactly, and the stitch fails layer by layer. All layers carry the
//! whole metric and not the shear alone: then the sum is one energy, and forces are its gradient.
//! With `twist: material` the middle is the only point, and M12 comes from the material's moments.
//!
//! `bending: total` takes M(k) of the material: the force is the exact gradient of the energy.
//! `bending: lagged-tangent` (the thesis, 3.3.3) adds `dM/dk` at the previous curvature times the
//! change of curvature, for each fibre family by itself, and reports the work done as energy. Every step
//! then leaves an error of `M'' dk^2 / 2`, always of the same sign: moments creep away from the law, and in long
//! runs a strip at rest can come alive (`docs/decisions/0011`).
//! Tangents across families are not in the material's contract, so it also refuses a material
//! that couples them (an isotropic plate).
//!
//! `thickening: p`: the section bends with `A J^-p W_b(k)`, J = sqrt(det C), as in [`crate::rf4`]; the membrane's
//! stress has `-p J^-p W_b C^-1` besides. The layers' twist is left as it is.
//!
//! # Penalty of transverse shear
//!
//! `K = transverse_shear * 12 D A S`, `S_ab = sum_I b_Ia b_Ib` (1/L^2 along the sides of a
//! rectangle), D the bending tangent of the stiffer family at zero curvature: MacNeal's residual
//! bending flexibility (1978), with which one point makes a beam element exact for thin beams. It
//! falls with the element's size, does not lock, and is softer than a physical shear modulus, which
//! may be put in series (`transverse_shear_modulus`, with the factor 5/6).
//!
//! # Rotary inertia
//!
//! `max(physical, 8 K_theta / lambda)` with the bound K_theta of the rotational stiffness at rest and
//! lambda = omega^2 of the membrane: rotations then cost at most 6 % of the membrane's time step.
//! Both scale with the thickness squared: the inertia is 16 times the physical one of the NCF at every
//! element size, that of a sheet 4 times as thick, which no wave longer than some 10 thicknesses notices.
//!
//! Forces are `dW/dx`; moments are `d_I x dW/dd_I` and have no part along d_I (no drilling).
//! Elements are wound counter-clockwise about the normal.

mod bounds;
mod forces;
mod lag;
mod rotation;
mod section;

pub use section::S4;

use crate::coupling;
use crate::quad::{self, Hourglass, MAX_LANES, material_frame};
use crate::record;
use crate::thickening;
use plyflow_geometry::Vec3;
use plyflow_sdk::abi::{PF_BAD_SHAPE, PF_OK};
use plyflow_sdk::{
    BendingBatch, Constants, Element, ElementBatch, ElementSizes, ElementTape, MaterialRef,
    MaterialSizes, MembraneBatch,
};
use section::{BendingRule, DIRECTORS, Layers, Parameters, Rest, Twist, row};

/// Rows of fields: those of [`crate::quad`], then curvatures and moments along the two fibre families.
const FIELDS: usize = quad::FIELDS + 4;
/// The rotations' share of omega^2.
const ROTATION_SHARE: f64 = 0.125;

impl Element for S4 {
    const MANIFEST: &'static str = include_str!("s4/manifest.json");

    fn create(parameters: &str, material: &MaterialRef) -> Result<Self, String> {
        let p = Parameters::parse(parameters)?;
        let plane = Hourglass::new(p.hourglass, p.hourglass_floor, 0.0, material)?;
        let rest = Rest::of(material)?;
        if rest.coupled && p.bending == BendingRule::LaggedTangent {
            return Err(
                "bending: lagged-tangent adds moments family by family, but the curvature of one \
                 family gives the other a moment in this material: set 'bending: total' (and, for \
                 an isotropic plate, 'twist: material')"
                    .into(),
            );
        }
        if p.twist == Twist::Layers && coupling::softest(material).is_some() {
            return Err(
                "twist: layers gives the ply its twist by the shear of two outer layers, but shear stretches fibres in this material, whose families \
                 do not cross at a right angle, so that layers would bend as a solid plate: set 'twist: material'"
                    .into(),
            );
        }
        let sizes = material.sizes();
        let layers = (p.twist == Twist::Layers).then_some(Layers {
            core: p.core_share,
            surface: 0.5 * (1.0 - p.core_share),
            height: 0.25 * (1.0 + p.core_share) * sizes.thickness,
        });
        Ok(Self {
            plane,
            parameters: p,
            rest,
            layers,
            thickness: sizes.thickness,
            areal_mass: sizes.areal_mass,
            bending_history: sizes.bending_history,
        })
    }

    fn sizes(&self) -> ElementSizes {
        ElementSizes {
            nodes: 4,
            dofs_per_node: 6,
            constants: row::COUNT,
            history: self.material_rows() + self.bending_history,
            material_points: self.points(),
            fields: FIELDS,
            ignores_velocity: true,
            ..Default::default()
        }
    }

    fn initialise(&self, batch: &mut ElementBatch<'_>, material: &MaterialRef) {
        let n = batch.lanes;
        let mut step = vec![0.0; n];
        quad::initialise(
            &mut ElementBatch {
                lanes: n,
                dt: 0.0,
                position: batch.position,
                velocity: &[],
                spin: &[],
                axis: batch.axis,
                constants: Constants::Open(&mut batch.constants),
                history: &mut [],
                material_history: &mut [],
                force: &mut [],
                moment: &mut [],
                energy: &mut [],
                fields: None,
                mass: &mut *batch.mass,
                inertia: &mut [],
                critical_step: Some(&mut step),
            },
            material,
            self.plane,
        );
        for l in 0..n {
            let x: [Vec3; 4] = core::array::from_fn(|i| {
                core::array::from_fn(|k| batch.position[(3 * i + k) * n + l])
            });
            let axis: Vec3 = core::array::from_fn(|k| batch.axis[k * n + l]);
            let constants = &mut batch.constants;
            self.plate_constants(&x, axis, constants, n, l);
            // Bound of the rotational stiffness at rest against omega^2 of the membrane.
            let rotational = bounds::at_rest(self, constants, n, l, &x);
            let lambda = 4.0 / (step[l] * step[l]);
            let mass = batch.mass[l];
            let physical = mass * self.thickness * self.thickness / 12.0;
            let inertia = physical.max(rotational / (ROTATION_SHARE * lambda));
            constants[row::INERTIA * n + l] = inertia;
            for i in 0..4 {
                if !batch.inertia.is_empty() {
                    batch.inertia[i * n + l] = inertia;
                }
            }
            step[l] = 2.0
                / (lambda + rotational / inertia + bounds::plate(constants, n, l) / mass).sqrt();
        }
        if let Some(to) = batch.critical_step.as_deref_mut() {
            to[..n].copy_from_slice(&step);
        }
    }

    fn forces(&self, batch: &mut ElementBatch<'_>, material: &MaterialRef) -> i32 {
        let rows = 12 * batch.lanes;
        if batch.spin.len() < rows || batch.moment.len() < rows {
            return PF_BAD_SHAPE; // A caller that does not know rotations.
        }
        match batch.lanes {
            0..=16 => self.forces_with(batch, material, forces::Scratch::<16>::new().view()),
            17..=32 => self.forces_with(batch, material, forces::Scratch::<32>::new().view()),
            _ => self.forces_with(batch, material, forces::Scratch::<MAX_LANES>::new().view()),
        }
    }

    fn tape(&self, what: ElementTape, material: &MaterialSizes) -> Result<Option<String>, String> {
        record::of_element(self, what, *material)
    }
}

impl S4 {
    /// The rows after those of the membrane, of one lane.
    fn plate_constants(
        &self,
        x: &[Vec3; 4],
        axis: Vec3,
        constants: &mut [f64],
        n: usize,
        l: usize,
    ) {
        let sub = |a: Vec3, b: Vec3| -> Vec3 { core::array::from_fn(|k| a[k] - b[k]) };
        let dot = |a: Vec3, b: Vec3| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (d13, d24) = (sub(x[0], x[2]), sub(x[1], x[3]));
        let cross: Vec3 = core::array::from_fn(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            d13[i] * d24[j] - d13[j] * d24[i]
        });
        let (_, _, normal) = material_frame(axis, cross);
        let mode: Vec3 = core::array::from_fn(|k| (x[0][k] - x[1][k]) + (x[2][k] - x[3][k]));
        let b = |r: usize| constants[r * n + l];
        let s11 = 2.0 * (b(0) * b(0) + b(1) * b(1));
        let s22 = 2.0 * (b(2) * b(2) + b(3) * b(3));
        let s12 = 2.0 * (b(0) * b(2) + b(1) * b(3));
        let area = b(6);
        let penalty = 12.0 * self.parameters.transverse_shear * self.rest.stiffness;
        let (mut k11, mut k22, mut k12) = (penalty * s11, penalty * s22, penalty * s12);
        if let Some(modulus) = self.parameters.transverse_shear_modulus {
            // (K^-1 + 1/G)^-1 = K (1 + K/G)^-1: both are functions of K, so they commute.
            let limit = 5.0 / 6.0 * modulus * self.thickness;
            let (a, d, c) = (1.0 + k11 / limit, 1.0 + k22 / limit, k12 / limit);
            let det = a * d - c * c;
            (k11, k22, k12) = (
                (k11 * d - k12 * c) / det,
                (k22 * a - k12 * c) / det,
                (k12 * a - k11 * c) / det,
            );
        }
        // The bending stiffness that this shear stiffness stands for, and what a fully integrated
        // element has for the differences of opposite sides.
        let effective = (k11 + k22) / (12.0 * (s11 + s22)).max(f64::MIN_POSITIVE);
        let edge = |sign: f64| {
            let side: Vec3 = core::array::from_fn(|k| 0.5 * (d24[k] - sign * d13[k]));
            let square = dot(side, side).max(f64::MIN_POSITIVE);
            self.parameters.hourglass_shear * effective * area / (square * square)
        };
        let values = [
            normal[0],
            normal[1],
            normal[2],
            dot(mode, normal),
            area * k11,
            area * k22,
            area * k12,
            edge(1.0),
            edge(-1.0),
            self.parameters.hourglass_director * self.rest.stiffness / 6.0,
        ];
        for (r, v) in values.into_iter().enumerate() {
            constants[(row::NORMAL + r) * n + l] = v;
        }
    }

    /// Long, as it lists what is computed, in the order in which each kernel needs what those before it have written.
    fn forces_with(
        &self,
        batch: &mut ElementBatch<'_>,
        material: &MaterialRef,
        mut s: forces::View<'_>,
    ) -> i32 {
        let n = batch.lanes;
        let (directors, rest) = batch.history.split_at_mut(DIRECTORS * n);
        let height = self.layers.map(|l| l.height);
        forces::kinematics(
            batch.position,
            batch.spin,
            batch.dt,
            &batch.constants,
            n,
            height,
            directors,
            &mut s,
        );
        let wanted = batch.critical_step.is_some();
        let code = self.membrane(
            batch.material_history,
            material,
            n,
            batch.dt,
            &mut s,
            wanted,
        );
        if code != PF_OK {
            return code;
        }
        let (lagged, law) = rest.split_at_mut((self.material_rows() - DIRECTORS) * n);
        let code = material.bending(&mut BendingBatch {
            lanes: n,
            dt: batch.dt,
            metric: &s.metric[..3 * n],
            curvature: &s.curvature[..3 * n],
            history: law,
            moment: &mut s.moment[..3 * n],
            energy: &mut s.bending[..n],
            tangent: Some(&mut s.tangent[..3 * n]),
        });
        if code != PF_OK {
            return code;
        }
        if self.lagged() {
            lag::moments(n, s.curvature, s.tangent, lagged, s.moment, s.bending);
        }
        let power = self.parameters.thickening;
        if power > 0 {
            thickening::scale(power, n, s.metric, s.moment, s.tangent, s.bending);
            s.swell.copy_from_slice(s.bending);
        }
        if let Some(layers) = &self.layers {
            forces::superpose(n, layers, &mut s);
        }
        if power > 0 {
            forces::swell(power, n, &mut s);
        }
        forces::forces(
            batch.position,
            directors,
            &batch.constants,
            n,
            &s,
            batch.force,
            batch.moment,
            batch.energy,
        );
        if let Some(step) = batch.critical_step.as_deref_mut() {
            bounds::critical_step(
                self,
                batch.position,
                directors,
                &batch.constants,
                n,
                &s,
                step,
            );
        }
        if let Some(fields) = batch.fields.as_deref_mut() {
            fields_of(n, &s, fields);
        }
        PF_OK
    }

    /// The material at every layer.
    fn membrane(
        &self,
        history: &mut [f64],
        material: &MaterialRef,
        n: usize,
        dt: f64,
        s: &mut forces::View<'_>,
        wanted: bool,
    ) -> i32 {
        let rows = material.sizes().membrane_history * n;
        for p in 0..self.points() {
            let code = material.membrane(&mut MembraneBatch {
                lanes: n,
                dt,
                metric: &s.metric[3 * p * n..3 * (p + 1) * n],
                history: &mut history[p * rows..(p + 1) * rows],
                stress: &mut s.stress[3 * p * n..3 * (p + 1) * n],
                energy: &mut s.energy[p * n..(p + 1) * n],
                stiffness: wanted.then_some(&mut s.stiffness[2 * p * n..2 * (p + 1) * n]),
            });
            if code != PF_OK {
                return code;
            }
        }
        PF_OK
    }
}

fn fields_of(n: usize, s: &forces::View<'_>, fields: &mut [f64]) {
    quad::fields_of(n, s.metric, s.stress, fields);
    for l in 0..n {
        for a in 0..2 {
            let stretch = s.metric[a * n + l].max(f64::MIN_POSITIVE);
            fields[(quad::FIELDS + a) * n + l] = s.curvature[a * n + l] / stretch;
            fields[(quad::FIELDS + 2 + a) * n + l] = s.moment[a * n + l];
        }
    }
}
