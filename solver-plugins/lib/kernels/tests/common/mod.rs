//! Components behind their C tables, as the solver meets them, and batches that are easy to fill.
#![allow(dead_code)]

use plyflow_kernels::{fabric::Fabric, marlow::Marlow};
use plyflow_sdk::abi::*;
use plyflow_sdk::{Aligned, Element, MaterialRef, element_table, material_table};
use std::ffi::c_void;
use std::sync::OnceLock;

pub const LANES: usize = 8;

/// NCF FCIM359 (thesis tables 3.1, 3.2) with the form put in.
pub fn ncf(form: &str, extra: &str) -> String {
    format!(
        r#"{{"form":"{form}","fibre_modulus":3e9,"compression_factor":1.0,
        "shear":{{"coefficients":[0,112.19,94.73,137.06,-65.56,29.56],"limit":1.0471975511965976}},
        "stitch":{{"angles":[0.06,0.5,0.75],"forces":[0,880,0]}},
        "bending":{{"positive":{{"linear":1.9457e-4,"asymptote":0.03139,"scale":4.0}},
                    "negative":{{"linear":1.0279e-4,"asymptote":0.03619,"scale":6.5}},
                    "positive_face":"up","families":"opposite"}},
        "thickness":4e-4,"areal_mass":0.44{extra}}}"#
    )
}

/// Woven 38616.
pub fn woven(form: &str) -> String {
    format!(
        r#"{{"form":"{form}","fibre_modulus":3e9,
        "shear":{{"coefficients":[0,37.35,-322.61,1458.51,-3539.56,4727.84,-3275.20,930.53]}},
        "bending":{{"positive":{{"linear":1.549e-5,"asymptote":0.00757,"scale":20.0}}}},
        "thickness":3e-4,"areal_mass":0.21}}"#
    )
}

/// StretchLon HT-350.
pub const FILM: &str = r#"{"uniaxial":{"amplitude":6.364e6,"growth":0.4451,"decay":7.545},
    "limit":5.0,"thickness":8e-5,"areal_mass":0.08}"#;

pub struct Mat(pub MaterialRef);

fn make(table: &'static pf_material_functions, json: &str) -> Result<Mat, String> {
    let mut instance: *mut c_void = std::ptr::null_mut();
    let mut error = pf_error::default();
    // SAFETY: a text, room for the instance and a whole `pf_error`.
    let code = unsafe { (table.create)(pf_str::new(json), &raw mut instance, &raw mut error) };
    if code != PF_OK {
        let text: Vec<u8> = error
            .text
            .iter()
            .take_while(|c| **c != 0)
            .map(|c| *c as u8)
            .collect();
        return Err(String::from_utf8_lossy(&text).into_owned());
    }
    // SAFETY: a static table, and an instance that is never ended: the process is a test.
    unsafe {
        MaterialRef::new(pf_material {
            functions: table,
            instance,
        })
    }
    .map(Mat)
}

pub fn fabric(json: &str) -> Result<Mat, String> {
    static TABLE: OnceLock<pf_material_functions> = OnceLock::new();
    make(TABLE.get_or_init(material_table::<Fabric>), json)
}

pub fn film(json: &str) -> Result<Mat, String> {
    static TABLE: OnceLock<pf_material_functions> = OnceLock::new();
    make(TABLE.get_or_init(material_table::<Marlow>), json)
}

/// One state of a membrane point, in every lane.
pub struct Point {
    pub history: Aligned,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answer {
    pub stress: [f64; 3],
    pub energy: f64,
    pub stiffness: [f64; 2],
}

impl Point {
    pub fn new(m: &Mat) -> Self {
        Self {
            history: Aligned::zeros(m.0.sizes().membrane_history * LANES),
        }
    }

    pub fn at(&mut self, m: &Mat, metric: [f64; 3]) -> Answer {
        let rows = lanes_of(metric);
        let mut stress = Aligned::zeros(3 * LANES);
        let mut energy = Aligned::zeros(LANES);
        let mut stiffness = Aligned::zeros(2 * LANES);
        let code = m.0.membrane(&mut plyflow_sdk::MembraneBatch {
            lanes: LANES,
            dt: 1e-6,
            metric: &rows,
            history: &mut self.history,
            stress: &mut stress,
            energy: &mut energy,
            stiffness: Some(&mut stiffness),
        });
        assert_eq!(code, PF_OK);
        Answer {
            stress: [stress[0], stress[LANES], stress[2 * LANES]],
            energy: energy[0],
            stiffness: [stiffness[0], stiffness[LANES]],
        }
    }

    /// The same state without keeping its history.
    pub fn peek(&self, m: &Mat, metric: [f64; 3]) -> Answer {
        Point {
            history: self.history.clone(),
        }
        .at(m, metric)
    }
}

pub struct Moments {
    pub moment: [f64; 3],
    pub energy: f64,
    pub tangent: [f64; 3],
}

/// Three rows with one value each in every lane.
fn lanes_of(values: [f64; 3]) -> Aligned {
    let rows: Vec<f64> = values.iter().flat_map(|x| [*x; LANES]).collect();
    Aligned::from(rows.as_slice())
}

pub fn bend(m: &Mat, metric: [f64; 3], curvature: [f64; 3]) -> Moments {
    let mut history = Aligned::zeros(m.0.sizes().bending_history * LANES);
    let (mut moment, mut tangent) = (Aligned::zeros(3 * LANES), Aligned::zeros(3 * LANES));
    let mut energy = Aligned::zeros(LANES);
    let code = m.0.bending(&mut plyflow_sdk::BendingBatch {
        lanes: LANES,
        dt: 0.0,
        metric: &lanes_of(metric),
        curvature: &lanes_of(curvature),
        history: &mut history,
        moment: &mut moment,
        energy: &mut energy,
        tangent: Some(&mut tangent),
    });
    assert_eq!(code, PF_OK);
    Moments {
        moment: [moment[0], moment[LANES], moment[2 * LANES]],
        energy: energy[0],
        tangent: [tangent[0], tangent[LANES], tangent[2 * LANES]],
    }
}

/// An element formulation behind its C table.
pub struct El {
    table: pf_element_functions,
    instance: *mut c_void,
    material: pf_material,
    pub sizes: pf_element_sizes,
    membrane_history: usize,
    bending_history: usize,
}

pub struct Elements {
    pub constants: Vec<f64>,
    pub material_history: Aligned,
    pub mass: Vec<f64>,
    pub step: Vec<f64>,
    pub lanes: usize,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Forces {
    pub force: Vec<f64>,
    pub energy: Vec<f64>,
    pub fields: Vec<f64>,
    pub step: Vec<f64>,
}

impl El {
    pub fn new<E: Element>(json: &str, m: &Mat) -> Result<Self, String> {
        let table = element_table::<E>();
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
            let text: Vec<u8> = error
                .text
                .iter()
                .take_while(|c| **c != 0)
                .map(|c| *c as u8)
                .collect();
            return Err(String::from_utf8_lossy(&text).into_owned());
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
            bending_history: m.0.sizes().bending_history,
        })
    }

    fn batch(&self, lanes: usize) -> pf_element_batch {
        pf_element_batch {
            size: size_of::<pf_element_batch>() as u64,
            lanes: lanes as u32,
            reserved: 0,
            dt: 1e-6,
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

    /// `position[lane][node]`, `axis[lane]`.
    pub fn initialise(&self, position: &[[[f64; 3]; 4]], axis: &[[f64; 3]]) -> Elements {
        let n = position.len();
        let p = rows(position);
        let a: Vec<f64> = (0..3)
            .flat_map(|k| axis.iter().map(move |v| v[k]))
            .collect();
        let mut e = Elements {
            constants: vec![0.0; self.sizes.constants as usize * n],
            material_history: Aligned::zeros(
                self.sizes.material_points as usize * self.membrane_history * n,
            ),
            mass: vec![0.0; 4 * n],
            step: vec![0.0; n],
            lanes: n,
        };
        let b = pf_element_batch {
            position: p.as_ptr(),
            axis: a.as_ptr(),
            constants: e.constants.as_mut_ptr(),
            mass: e.mass.as_mut_ptr(),
            critical_step: e.step.as_mut_ptr(),
            ..self.batch(n)
        };
        // SAFETY: this table's instance, which is never ended, and a batch with the arrays of this call, of the lengths for its sizes and lanes. Not all are
        // aligned to 64 bytes: what is tested is this crate's own, which takes doubles as they lie.
        let code = unsafe { (self.table.initialise)(self.instance, &raw const b) };
        assert_eq!(code, PF_OK);
        e
    }

    /// Forces and energies alone, into buffers of the caller.
    pub fn forces_into(
        &self,
        e: &mut Elements,
        position: &[f64],
        velocity: &[f64],
        force: &mut [f64],
        energy: &mut [f64],
    ) {
        let vectors = [position.len(), velocity.len(), force.len()];
        assert_eq!((vectors, energy.len()), ([12 * e.lanes; 3], 3 * e.lanes));
        let b = pf_element_batch {
            position: position.as_ptr(),
            velocity: velocity.as_ptr(),
            constants: e.constants.as_mut_ptr(),
            material_history: e.material_history.as_mut_ptr(),
            force: force.as_mut_ptr(),
            energy: energy.as_mut_ptr(),
            ..self.batch(e.lanes)
        };
        // SAFETY: as in `initialise`; the caller's arrays were looked at above.
        let code = unsafe { (self.table.forces)(self.instance, &raw const b) };
        assert_eq!(code, PF_OK);
    }

    pub fn forces(&self, e: &mut Elements, position: &[[[f64; 3]; 4]]) -> Forces {
        let n = e.lanes;
        let p = rows(position);
        let v = vec![0.0; 12 * n];
        let mut f = Forces {
            force: vec![f64::NAN; 12 * n],
            energy: vec![f64::NAN; 3 * n],
            fields: vec![f64::NAN; self.sizes.fields as usize * n],
            step: vec![f64::NAN; n],
        };
        let b = pf_element_batch {
            position: p.as_ptr(),
            velocity: v.as_ptr(),
            constants: e.constants.as_mut_ptr(),
            material_history: e.material_history.as_mut_ptr(),
            force: f.force.as_mut_ptr(),
            energy: f.energy.as_mut_ptr(),
            fields: f.fields.as_mut_ptr(),
            critical_step: f.step.as_mut_ptr(),
            ..self.batch(n)
        };
        // SAFETY: as in `initialise`.
        let code = unsafe { (self.table.forces)(self.instance, &raw const b) };
        assert_eq!(code, PF_OK);
        f
    }
}

/// Patches of `lanes` lanes.
pub struct Patches {
    pub constants: Vec<f64>,
    pub history: Aligned,
    pub stiffness: Vec<f64>,
    pub lanes: usize,
    nodes: usize,
}

#[derive(Debug, Clone, PartialEq)]
pub struct PatchForces {
    /// `[node][3][lanes]`
    pub force: Vec<f64>,
    pub energy: Vec<f64>,
    pub fields: Vec<f64>,
    pub stiffness: Vec<f64>,
}

impl El {
    fn patch_batch(&self, lanes: usize) -> pf_patch_batch {
        pf_patch_batch {
            size: size_of::<pf_patch_batch>() as u64,
            lanes: lanes as u32,
            reserved: 0,
            dt: 1e-6,
            position: std::ptr::null(),
            count: std::ptr::null(),
            area: std::ptr::null(),
            axis: std::ptr::null(),
            constants: std::ptr::null_mut(),
            history: std::ptr::null_mut(),
            force: std::ptr::null_mut(),
            energy: std::ptr::null_mut(),
            fields: std::ptr::null_mut(),
            stiffness: std::ptr::null_mut(),
            material: &raw const self.material,
        }
    }

    /// `[lane][node][3]`, unused slots on the centre, to `[node][3][lanes]`.
    pub fn patch_rows(&self, patches: &[Vec<[f64; 3]>]) -> Vec<f64> {
        let mut out = Vec::new();
        for i in 0..self.sizes.patch_nodes as usize {
            for k in 0..3 {
                out.extend(patches.iter().map(|x| x.get(i).unwrap_or(&x[0])[k]));
            }
        }
        out
    }

    pub fn initialise_patches(
        &self,
        patches: &[Vec<[f64; 3]>],
        axis: [f64; 3],
        area: f64,
    ) -> Patches {
        let n = patches.len();
        let nodes = self.sizes.patch_nodes as usize;
        let position = self.patch_rows(patches);
        let count: Vec<f64> = patches.iter().map(|x| x.len() as f64).collect();
        let area = vec![area; n];
        let axis: Vec<f64> = axis.iter().flat_map(|a| vec![*a; n]).collect();
        let mut p = Patches {
            constants: vec![f64::NAN; self.sizes.patch_constants as usize * n],
            history: Aligned::zeros((self.sizes.patch_history as usize + self.bending_history) * n),
            stiffness: vec![f64::NAN; nodes * n],
            lanes: n,
            nodes,
        };
        let b = pf_patch_batch {
            position: position.as_ptr(),
            count: count.as_ptr(),
            area: area.as_ptr(),
            axis: axis.as_ptr(),
            constants: p.constants.as_mut_ptr(),
            stiffness: p.stiffness.as_mut_ptr(),
            ..self.patch_batch(n)
        };
        let f = self.table.patch_initialise.unwrap();
        // SAFETY: as in `initialise`, of patches.
        let code = unsafe { f(self.instance, &raw const b) };
        assert_eq!(code, PF_OK);
        p
    }

    pub fn patch_forces(&self, p: &mut Patches, patches: &[Vec<[f64; 3]>]) -> PatchForces {
        let n = p.lanes;
        let position = self.patch_rows(patches);
        let mut f = PatchForces {
            force: vec![f64::NAN; 3 * p.nodes * n],
            energy: vec![f64::NAN; n],
            fields: vec![f64::NAN; self.sizes.patch_fields as usize * n],
            stiffness: vec![f64::NAN; p.nodes * n],
        };
        let b = pf_patch_batch {
            position: position.as_ptr(),
            constants: p.constants.as_mut_ptr(),
            history: p.history.as_mut_ptr(),
            force: f.force.as_mut_ptr(),
            energy: f.energy.as_mut_ptr(),
            fields: f.fields.as_mut_ptr(),
            stiffness: f.stiffness.as_mut_ptr(),
            ..self.patch_batch(n)
        };
        let call = self.table.patch_forces.unwrap();
        // SAFETY: as in `initialise`, of patches.
        let code = unsafe { call(self.instance, &raw const b) };
        assert_eq!(code, PF_OK);
        f
    }

    /// Forces and energies alone, into buffers of the caller.
    pub fn patch_forces_into(
        &self,
        p: &mut Patches,
        position: &[f64],
        force: &mut [f64],
        energy: &mut [f64],
    ) {
        let vectors = [position.len(), force.len()];
        assert_eq!(
            (vectors, energy.len()),
            ([3 * p.nodes * p.lanes; 2], p.lanes)
        );
        let b = pf_patch_batch {
            position: position.as_ptr(),
            constants: p.constants.as_mut_ptr(),
            history: p.history.as_mut_ptr(),
            force: force.as_mut_ptr(),
            energy: energy.as_mut_ptr(),
            ..self.patch_batch(p.lanes)
        };
        let call = self.table.patch_forces.unwrap();
        // SAFETY: as in `initialise`, of patches; the caller's arrays were looked at above.
        let code = unsafe { call(self.instance, &raw const b) };
        assert_eq!(code, PF_OK);
    }
}

/// `[lane][node][3]` to `[node][3][lanes]`.
pub fn rows(position: &[[[f64; 3]; 4]]) -> Vec<f64> {
    let mut out = Vec::with_capacity(12 * position.len());
    for i in 0..4 {
        for k in 0..3 {
            out.extend(position.iter().map(|x| x[i][k]));
        }
    }
    out
}

/// A small deterministic generator: uniform in [-1, 1).
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        ((self.0 >> 11) as f64) / (1u64 << 52) as f64 - 1.0
    }
}

pub type Quad = [[f64; 3]; 4];
pub type Patch = Vec<[f64; 3]>;

pub const SIZE: f64 = 0.005;

pub fn ply() -> Mat {
    fabric(&ncf("fibre-energy", "")).unwrap()
}

/// A distorted flat quadrilateral of about 5 mm.
pub fn flat(r: &mut Random, distortion: f64) -> Quad {
    [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]: [f64; 2]| {
        [
            SIZE * (x + distortion * r.next()),
            SIZE * (y + distortion * r.next()),
            0.0,
        ]
    })
}

pub fn rotation(r: &mut Random) -> [[f64; 3]; 3] {
    let mut q = [r.next(), r.next(), r.next(), r.next()];
    let l = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    q = q.map(|x| x / l);
    let [w, x, y, z] = q;
    [
        [
            1.0 - 2.0 * (y * y + z * z),
            2.0 * (x * y - w * z),
            2.0 * (x * z + w * y),
        ],
        [
            2.0 * (x * y + w * z),
            1.0 - 2.0 * (x * x + z * z),
            2.0 * (y * z - w * x),
        ],
        [
            2.0 * (x * z - w * y),
            2.0 * (y * z + w * x),
            1.0 - 2.0 * (x * x + y * y),
        ],
    ]
}

pub fn turned(m: &[[f64; 3]; 3], x: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| (0..3).map(|j| m[i][j] * x[j]).sum::<f64>() + 0.1 * i as f64)
}

/// The quad stretched, sheared and warped at random.
pub fn deformed(r: &mut Random, q: &Quad, strain: f64, warp: f64) -> Quad {
    let f: [[f64; 2]; 2] = [
        [1.0 + strain * r.next(), strain * r.next()],
        [strain * r.next(), 1.0 + strain * r.next()],
    ];
    let m = rotation(r);
    q.map(|[x, y, _]| {
        let bump = warp * SIZE;
        let p = [
            f[0][0] * x + f[0][1] * y + bump * r.next(),
            f[1][0] * x + f[1][1] * y + bump * r.next(),
            bump * r.next(),
        ];
        turned(&m, p)
    })
}

pub const AXIS: [f64; 3] = [0.8, 0.6, 0.0];

pub fn total(f: &Forces, n: usize, lane: usize) -> f64 {
    (0..3).map(|r| f.energy[r * n + lane]).sum()
}

/// A 3 x 3 patch, centre first, distorted in the plane.
pub fn grid(r: &mut Random, distortion: f64) -> Patch {
    let ring = [
        [1, 0],
        [1, 1],
        [0, 1],
        [-1, 1],
        [-1, 0],
        [-1, -1],
        [0, -1],
        [1, -1],
    ];
    let mut x = vec![[0.0; 3]];
    x.extend(ring.map(|[i, j]: [i32; 2]| {
        [
            SIZE * (i as f64 + distortion * r.next()),
            SIZE * (j as f64 + distortion * r.next()),
            0.0,
        ]
    }));
    x
}

pub fn wavy(r: &mut Random, p: &Patch) -> Patch {
    let m = rotation(r);
    let k = [30.0 * r.next(), 30.0 * r.next(), 30.0 * r.next()];
    let shear = 0.4 * r.next();
    p.iter()
        .map(|[x, y, _]| {
            let z = 0.5 * k[0] * x * x + 0.5 * k[1] * y * y + k[2] * x * y + 0.02 * SIZE * r.next();
            turned(&m, [x + shear * y, *y, z + 0.3 * x])
        })
        .collect()
}
