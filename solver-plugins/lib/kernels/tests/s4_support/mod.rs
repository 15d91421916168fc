//! The element `s4` behind its C table, batches that are easy to fill, and small dense algebra.
#![allow(dead_code)]

use super::common::*;
use plyflow_kernels::{isotropic::Isotropic, s4::S4};
use plyflow_sdk::abi::*;
use plyflow_sdk::{Aligned, Element, Material, MaterialRef, element_table, material_table};
use std::ffi::c_void;
use std::sync::OnceLock;

pub mod model;

pub type V3 = [f64; 3];

fn text(error: &pf_error) -> String {
    let bytes: Vec<u8> = error
        .text
        .iter()
        .take_while(|c| **c != 0)
        .map(|c| *c as u8)
        .collect();
    String::from_utf8_lossy(&bytes).into_owned()
}

pub fn isotropic(json: &str) -> Result<Mat, String> {
    static TABLE: OnceLock<pf_material_functions> = OnceLock::new();
    let table = TABLE.get_or_init(material_table::<Isotropic>);
    let mut instance: *mut c_void = std::ptr::null_mut();
    let mut error = pf_error::default();
    // SAFETY: a text, room for the instance and a whole `pf_error`.
    let code = unsafe { (table.create)(pf_str::new(json), &raw mut instance, &raw mut error) };
    if code != PF_OK {
        return Err(text(&error));
    }
    let material = pf_material {
        functions: table,
        instance,
    };
    // SAFETY: a static table, and an instance that is never ended: the process is a test.
    unsafe { MaterialRef::new(material) }.map(Mat)
}

/// Young's modulus, Poisson's ratio, thickness, density of 1500 kg/m3.
pub fn plate(modulus: f64, nu: f64, thickness: f64) -> Mat {
    isotropic(&format!(
        r#"{{"youngs_modulus":{modulus},"poisson_ratio":{nu},"thickness":{thickness},"areal_mass":{}}}"#,
        1500.0 * thickness
    ))
    .unwrap()
}

/// With the exact gradient and the material's own twist.
pub const PLATE: &str = r#"{"bending":"total","twist":"material"}"#;

pub fn manifest_names() -> [&'static str; 2] {
    [S4::MANIFEST, Isotropic::MANIFEST]
}

pub struct Shell {
    table: pf_element_functions,
    instance: *mut c_void,
    material: pf_material,
    pub sizes: pf_element_sizes,
    membrane_history: usize,
}

#[derive(Clone)]
pub struct Batch {
    pub constants: Vec<f64>,
    pub history: Aligned,
    pub material_history: Aligned,
    pub mass: Vec<f64>,
    pub inertia: Vec<f64>,
    pub step: Vec<f64>,
    pub lanes: usize,
}

#[derive(Clone, Debug, PartialEq)]
pub struct Out {
    pub force: Vec<f64>,
    pub moment: Vec<f64>,
    pub energy: Vec<f64>,
    pub fields: Vec<f64>,
    pub step: Vec<f64>,
}

impl Out {
    pub fn total(&self, lane: usize) -> f64 {
        let n = self.energy.len() / 3;
        (0..3).map(|r| self.energy[r * n + lane]).sum()
    }

    /// Node `i`'s force or moment in lane `l`.
    pub fn at(rows: &[f64], i: usize, l: usize) -> V3 {
        let n = rows.len() / 12;
        std::array::from_fn(|k| rows[(3 * i + k) * n + l])
    }
}

pub const STILL: Quad = [[0.0; 3]; 4];

impl Shell {
    pub fn new(json: &str, m: &Mat) -> Result<Self, String> {
        let table = element_table::<S4>();
        let mut instance: *mut c_void = std::ptr::null_mut();
        let mut error = pf_error::default();
        let material = *m.0.raw();
        // SAFETY: a text, a material that is never ended, room for the instance and a whole `pf_error`.
        let code = unsafe {
            (table.create)(
                pf_str::new(json),
                &raw const material,
                &raw mut instance,
                &raw mut error,
            )
        };
        if code != PF_OK {
            return Err(text(&error));
        }
        let mut sizes = pf_element_sizes::default();
        // SAFETY: the instance that the table has just made; a whole struct, as its `size` says.
        let code = unsafe { (table.sizes)(instance, &raw mut sizes) };
        assert_eq!(code, PF_OK);
        Ok(Self {
            table,
            instance,
            material,
            sizes,
            membrane_history: m.0.sizes().membrane_history,
        })
    }

    fn batch(&self, lanes: usize, dt: f64) -> pf_element_batch {
        pf_element_batch {
            size: size_of::<pf_element_batch>() as u64,
            lanes: lanes as u32,
            reserved: 0,
            dt,
            position: std::ptr::null(),
            velocity: std::ptr::null(),
            spin: std::ptr::null(),
            axis: std::ptr::null(),
            constants: std::ptr::null_mut(),
            history: std::ptr::null_mut(),
            material_history: std::ptr::null_mut(),
            force: std::ptr::null_mut(),
            moment: std::ptr::null_mut(),
            energy: std::ptr::null_mut(),
            fields: std::ptr::null_mut(),
            mass: std::ptr::null_mut(),
            inertia: std::ptr::null_mut(),
            critical_step: std::ptr::null_mut(),
            material: &raw const self.material,
        }
    }

    /// Initialises, and makes the first call (`dt = 0`) at the reference.
    pub fn start(&self, x: &[Quad], axis: V3) -> Batch {
        let mut b = self.initialise(x, axis);
        self.forces(&mut b, x, &vec![STILL; x.len()], 0.0);
        b
    }

    pub fn initialise(&self, x: &[Quad], axis: V3) -> Batch {
        let n = x.len();
        let p = rows(x);
        let a: Vec<f64> = axis.iter().flat_map(|v| vec![*v; n]).collect();
        let s = &self.sizes;
        let mut e = Batch {
            constants: vec![f64::NAN; s.constants as usize * n],
            history: Aligned::zeros(s.history as usize * n),
            material_history: Aligned::zeros(
                s.material_points as usize * self.membrane_history * n,
            ),
            mass: vec![f64::NAN; 4 * n],
            inertia: vec![f64::NAN; 4 * n],
            step: vec![f64::NAN; n],
            lanes: n,
        };
        let b = pf_element_batch {
            position: p.as_ptr(),
            axis: a.as_ptr(),
            constants: e.constants.as_mut_ptr(),
            mass: e.mass.as_mut_ptr(),
            inertia: e.inertia.as_mut_ptr(),
            critical_step: e.step.as_mut_ptr(),
            ..self.batch(n, 0.0)
        };
        // SAFETY: this table's instance, which is never ended, and a batch with the arrays of this call, of the lengths for its sizes and lanes. Not all are
        // aligned to 64 bytes: what is tested is this crate's own, which takes doubles as they lie.
        let code = unsafe { (self.table.initialise)(self.instance, &raw const b) };
        assert_eq!(code, PF_OK);
        e
    }

    /// One call at positions `x` after a step of `dt` with the spins `w`.
    pub fn forces(&self, e: &mut Batch, x: &[Quad], w: &[Quad], dt: f64) -> Out {
        let n = e.lanes;
        let (p, w, v) = (rows(x), rows(w), vec![0.0; 12 * n]);
        let mut f = Out {
            force: vec![f64::NAN; 12 * n],
            moment: vec![f64::NAN; 12 * n],
            energy: vec![f64::NAN; 3 * n],
            fields: vec![f64::NAN; self.sizes.fields as usize * n],
            step: vec![f64::NAN; n],
        };
        let b = pf_element_batch {
            position: p.as_ptr(),
            velocity: v.as_ptr(),
            spin: w.as_ptr(),
            constants: e.constants.as_mut_ptr(),
            history: e.history.as_mut_ptr(),
            material_history: e.material_history.as_mut_ptr(),
            force: f.force.as_mut_ptr(),
            moment: f.moment.as_mut_ptr(),
            energy: f.energy.as_mut_ptr(),
            fields: f.fields.as_mut_ptr(),
            critical_step: f.step.as_mut_ptr(),
            ..self.batch(n, dt)
        };
        // SAFETY: as in `initialise`.
        let code = unsafe { (self.table.forces)(self.instance, &raw const b) };
        assert_eq!(code, PF_OK);
        f
    }

    /// Forces and energies alone, into buffers of the caller (`[node][3][lanes]` rows).
    pub fn forces_into(&self, e: &mut Batch, position: &[f64], spin: &[f64], out: [&mut [f64]; 3]) {
        let [force, moment, energy] = out;
        let vectors = [position.len(), spin.len(), force.len(), moment.len()];
        assert_eq!(vectors, [12 * e.lanes; 4]);
        assert!(energy.len() >= 3 * e.lanes);
        let b = pf_element_batch {
            position: position.as_ptr(),
            velocity: position.as_ptr(),
            spin: spin.as_ptr(),
            constants: e.constants.as_mut_ptr(),
            history: e.history.as_mut_ptr(),
            material_history: e.material_history.as_mut_ptr(),
            force: force.as_mut_ptr(),
            moment: moment.as_mut_ptr(),
            energy: energy.as_mut_ptr(),
            ..self.batch(e.lanes, 1e-6)
        };
        // SAFETY: as in `initialise`; the caller's arrays were looked at above.
        let code = unsafe { (self.table.forces)(self.instance, &raw const b) };
        assert_eq!(code, PF_OK);
    }

    /// The call as a host without rotations would make it.
    pub fn forces_without_spin(&self, e: &mut Batch, x: &[Quad]) -> i32 {
        let (p, mut f, mut w) = (rows(x), vec![0.0; 12 * e.lanes], vec![0.0; 3 * e.lanes]);
        let b = pf_element_batch {
            position: p.as_ptr(),
            velocity: p.as_ptr(),
            constants: e.constants.as_mut_ptr(),
            history: e.history.as_mut_ptr(),
            material_history: e.material_history.as_mut_ptr(),
            force: f.as_mut_ptr(),
            energy: w.as_mut_ptr(),
            ..self.batch(e.lanes, 0.0)
        };
        // SAFETY: as in `initialise`; without spins and moments, which are NULL.
        unsafe { (self.table.forces)(self.instance, &raw const b) }
    }
}

/// The state moved by `h` in dof `c` (24: the nodes' positions, then their rotations), on a copy.
pub fn nudged(shell: &Shell, at: &Batch, x: &[Quad], c: usize, h: f64) -> Out {
    let mut b = at.clone();
    let (mut y, mut w) = (x.to_vec(), vec![STILL; x.len()]);
    let to = if c < 12 { &mut y } else { &mut w };
    to.iter_mut().for_each(|q| q[c % 12 / 3][c % 3] += h);
    shell.forces(&mut b, &y, &w, 1.0)
}

/// Forces then moments of a lane.
pub fn reaction(f: &Out, lane: usize) -> [f64; 24] {
    std::array::from_fn(|c| {
        let from = if c < 12 { &f.force } else { &f.moment };
        from[(c % 12) * f.step.len() + lane]
    })
}

/// d(force, moment)/d(position, rotation) of lane 0, by differences.
pub fn stiffness(shell: &Shell, at: &Batch, x: &[Quad], lane: usize) -> Vec<[f64; 24]> {
    let mut k = vec![[0.0; 24]; 24];
    for c in 0..24 {
        let h = if c < 12 { 1e-8 } else { 1e-6 };
        let p = reaction(&nudged(shell, at, x, c, h), lane);
        let q = reaction(&nudged(shell, at, x, c, -h), lane);
        for r in 0..24 {
            k[r][c] = (p[r] - q[r]) / (2.0 * h);
        }
    }
    k
}

/// Solves a x = b by elimination with row pivots.
pub fn solve(mut a: Vec<Vec<f64>>, mut b: Vec<f64>) -> Vec<f64> {
    let n = b.len();
    for i in 0..n {
        let p = (i..n)
            .max_by(|x, y| a[*x][i].abs().total_cmp(&a[*y][i].abs()))
            .unwrap();
        a.swap(i, p);
        b.swap(i, p);
        for r in i + 1..n {
            let f = a[r][i] / a[i][i];
            if f != 0.0 {
                let (head, tail) = a.split_at_mut(r);
                for (to, from) in tail[0][i..].iter_mut().zip(&head[i][i..]) {
                    *to -= f * from;
                }
                b[r] -= f * b[i];
            }
        }
    }
    for i in (0..n).rev() {
        let s: f64 = (i + 1..n).map(|j| a[i][j] * b[j]).sum();
        b[i] = (b[i] - s) / a[i][i];
    }
    b
}

pub fn cross(a: V3, b: V3) -> V3 {
    std::array::from_fn(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        a[i] * b[j] - a[j] * b[i]
    })
}

pub fn dot(a: V3, b: V3) -> f64 {
    (0..3).map(|k| a[k] * b[k]).sum()
}

/// Rodrigues' formula.
pub fn rotated(t: V3, x: V3) -> V3 {
    let a = dot(t, t).sqrt();
    if a == 0.0 {
        return x;
    }
    let u = t.map(|c| c / a);
    let (v, p) = (cross(u, x), dot(u, x) * (1.0 - a.cos()));
    std::array::from_fn(|k| a.cos() * x[k] + a.sin() * v[k] + p * u[k])
}

/// As NCF with fibres so soft that bending counts in the energies.
pub fn soft() -> Mat {
    fabric(&ncf("fibre-energy", "").replace("3e9", "1e6")).unwrap()
}

/// A distorted quadrilateral, also out of its plane.
pub fn uneven(r: &mut Random, distortion: f64, warp: f64) -> Quad {
    flat(r, distortion).map(|[x, y, _]| [x, y, warp * SIZE * r.next()])
}

/// A deformed state that was reached in one step: positions and rotations of up to `angle` besides
/// the rigid one.
pub fn bent(
    r: &mut Random,
    s: &Shell,
    b: &mut Batch,
    reference: &[Quad],
    strain: f64,
    angle: f64,
) -> Vec<Quad> {
    let mut x = Vec::new();
    let mut w = Vec::new();
    for q in reference {
        let turn: V3 = std::array::from_fn(|_| r.next());
        let f: [[f64; 2]; 2] = std::array::from_fn(|i| {
            std::array::from_fn(|j| if i == j { 1.0 } else { 0.0 } + strain * r.next())
        });
        x.push(q.map(|[x, y, z]| {
            let bump = 0.1 * SIZE * strain.min(0.5);
            let p = [
                f[0][0] * x + f[0][1] * y + bump * r.next(),
                f[1][0] * x + f[1][1] * y + bump * r.next(),
                z + 0.3 * angle * SIZE * r.next(),
            ];
            rotated(turn, p)
        }));
        w.push(q.map(|_| turn));
    }
    // The rigid turn first (exactly the same for all directors), then each node's own.
    s.forces(b, &x, &w, 1.0);
    let own: Vec<Quad> = reference
        .iter()
        .map(|_| std::array::from_fn(|_| std::array::from_fn(|_| angle * r.next())))
        .collect();
    s.forces(b, &x, &own, 1.0);
    x
}
