//! Calls of element formulations on batches, and the cells' areas.

use super::transpose::gather;
use crate::component::MOST_PATCH_NODES;
use crate::sheet::{
    Aligned, Batch, PatchBatch, Pressures, Sheet, empty_element_batch, empty_patch_batch,
};
use crate::vec3::Vec3;
use crate::{LANES, MechanicsError};
use plyflow_abi::*;

pub(super) fn component_status(code: i32, sheet: &str) -> Result<(), MechanicsError> {
    if code == PF_OK {
        return Ok(());
    }
    let reason = match code {
        PF_PANIC => "it panicked".to_owned(),
        PF_BAD_VALUE => "a value is NaN, infinite or out of range".to_owned(),
        c => format!("it returned status {c}"),
    };
    Err(MechanicsError::Component {
        what: format!("element of sheet '{sheet}'"),
        reason,
    })
}

/// Velocities and spins of a batch at the half step, for elements whose nodes rotate.
pub(super) struct Rates {
    velocity: Buffer<{ 12 * LANES }>,
    spin: Buffer<{ 12 * LANES }>,
}

impl Rates {
    /// Of a body at rest.
    pub(super) fn zero() -> Self {
        Self {
            velocity: Buffer([0.0; 12 * LANES]),
            spin: Buffer([0.0; 12 * LANES]),
        }
    }

    /// Puts them into a batch view, which must not outlive `self`.
    pub(super) fn attach(&self, raw: &mut pf_element_batch) {
        raw.velocity = self.velocity.0.as_ptr();
        raw.spin = self.spin.0.as_ptr();
    }
}

#[repr(align(64))]
pub(super) struct Buffer<const N: usize>(pub(super) [f64; N]);

/// What the batches of a block are computed in, one after the other.
pub(super) struct BatchWorkspace {
    position: Buffer<{ 12 * LANES }>,
    rates: Rates,
    /// `[4][3][LANES]` (N).
    pub(super) force: Buffer<{ 12 * LANES }>,
    /// `[4][3][LANES]` (N m), of elements whose nodes rotate.
    pub(super) moment: Buffer<{ 12 * LANES }>,
    /// `[AREA_ROWS][LANES]` (m2).
    pub(super) area: Buffer<{ AREA_ROWS * LANES }>,
    /// `[4][3][LANES]` pressure (N).
    pub(super) load: Buffer<{ 12 * LANES }>,
    /// `[PF_ENERGIES][LANES]` (J).
    energy: Buffer<{ PF_ENERGIES * LANES }>,
}

impl Default for BatchWorkspace {
    fn default() -> Self {
        Self {
            position: Buffer([0.0; 12 * LANES]),
            rates: Rates::zero(),
            force: Buffer([0.0; 12 * LANES]),
            moment: Buffer([0.0; 12 * LANES]),
            area: Buffer([0.0; AREA_ROWS * LANES]),
            load: Buffer([0.0; 12 * LANES]),
            energy: Buffer([0.0; PF_ENERGIES * LANES]),
        }
    }
}

/// What the patches of a block are computed in.
pub(super) struct PatchWorkspace {
    position: Buffer<{ MOST_PATCH_NODES * 3 * LANES }>,
    /// `[patch_nodes][3][LANES]` (N).
    pub(super) force: Buffer<{ MOST_PATCH_NODES * 3 * LANES }>,
    /// `[LANES]` (J).
    energy: Buffer<LANES>,
}

impl Default for PatchWorkspace {
    fn default() -> Self {
        Self {
            position: Buffer([0.0; MOST_PATCH_NODES * 3 * LANES]),
            force: Buffer([0.0; MOST_PATCH_NODES * 3 * LANES]),
            energy: Buffer([0.0; LANES]),
        }
    }
}

/// Rows of the cell areas: three vectors per cell.
pub(super) const AREA_ROWS: usize = 9;

/// Signs of the local coordinates of a cell's nodes.
pub(super) const SIGNS: [(f64, f64); 4] = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];

/// The integral of N_I x,xi x x,eta over a bilinear cell is u + xi_I v + eta_I w with u = c1 x c2,
/// v = c1 x c3 / 3, w = c3 x c2 / 3, where x = c0 + c1 xi + c2 eta + c3 xi eta. Pressure by these weights is the
/// exact gradient of the enclosed volume; by a quarter of the area each it is not, and under 1 bar the
/// difference drives the hourglass modes into flutter.
#[inline(always)]
pub(super) fn cell_areas(p: &[f64; 12 * LANES], area: &mut [f64]) {
    let area = &mut area[..AREA_ROWS * LANES];
    let row = |k: usize, c: usize| &p[(3 * k + c) * LANES..(3 * k + c + 1) * LANES];
    let mut c = [[[0.0; LANES]; 3]; 3];
    for k in 0..3 {
        let (x0, x1, x2, x3) = (row(0, k), row(1, k), row(2, k), row(3, k));
        for l in 0..LANES {
            let (d, e) = (0.25 * (x2[l] - x0[l]), 0.25 * (x3[l] - x1[l]));
            c[0][k][l] = d - e;
            c[1][k][l] = d + e;
            c[2][k][l] = 0.25 * (x0[l] - x1[l] + x2[l] - x3[l]);
        }
    }
    for (r, (i, j, share)) in [(0, 1, 1.0), (0, 2, 1.0 / 3.0), (2, 1, 1.0 / 3.0)]
        .into_iter()
        .enumerate()
    {
        let (a, b) = (&c[i], &c[j]);
        for k in 0..3 {
            let (m, n) = ((k + 1) % 3, (k + 2) % 3);
            let out = &mut area[(3 * r + k) * LANES..(3 * r + k + 1) * LANES];
            for l in 0..LANES {
                out[l] = share * (a[m][l] * b[n][l] - a[n][l] * b[m][l]);
            }
        }
    }
}

/// [`cell_areas`] with the machine's widest vectors; no fused operations, so the bits are the same on all.
#[inline]
pub(super) fn cell_areas_dispatch(p: &[f64; 12 * LANES], area: &mut [f64]) {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn wide(p: &[f64; 12 * LANES], area: &mut [f64]) {
            cell_areas(p, area);
        }
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: AVX2, all that `wide` asks for, was found the line above.
            return unsafe { wide(p, area) };
        }
    }
    cell_areas(p, area);
}

/// Where the nodes are and how they move.
#[derive(Clone, Copy)]
pub(super) struct Motion<'a> {
    pub(super) x: &'a [Vec3],
    pub(super) v: &'a [Vec3],
    /// Empty when no sheet has rotations.
    pub(super) spin: &'a [Vec3],
    /// Step just done (s).
    pub(super) dt: f64,
}

/// What the elements of a step see.
#[derive(Clone, Copy)]
pub(super) struct Present<'a> {
    pub(super) sheets: &'a [Sheet],
    pub(super) motion: Motion<'a>,
    pub(super) pressures: Pressures,
    /// Whether area vectors are wanted of all cells.
    pub(super) areas: bool,
    /// Whether the elements' fields are wanted.
    pub(super) fields: bool,
}

/// Forces of a batch into `work`; cell areas too where they are needed.
pub(super) fn run_batch(batch: &mut Batch, present: Present<'_>, work: &mut BatchWorkspace) {
    let element = present.sheets[batch.sheet as usize].element_of(batch);
    let motion = present.motion;
    gather(&batch.nodes, motion.x, &mut work.position.0);
    if !batch.pressed.is_empty() || present.areas {
        cell_areas_dispatch(&work.position.0, &mut work.area.0);
    }
    let mut raw = empty_element_batch(element, motion.dt, &work.position.0);
    raw.constants = batch.constants.as_ptr().cast_mut();
    raw.history = batch.history.as_mut_ptr();
    raw.material_history = batch.material_history.as_mut_ptr();
    raw.force = work.force.0.as_mut_ptr();
    raw.energy = work.energy.0.as_mut_ptr();
    if present.fields {
        batch.fields = Aligned::zeros(element.sizes.fields * LANES);
        raw.fields = batch.fields.as_mut_ptr();
    }
    if element.rotates() {
        gather(&batch.nodes, motion.spin, &mut work.rates.spin.0);
        if !element.sizes.ignores_velocity {
            gather(&batch.nodes, motion.v, &mut work.rates.velocity.0);
        }
        // After both are written: a pointer that was taken before would be none to what is borrowed anew.
        work.rates.attach(&mut raw);
        if element.sizes.ignores_velocity {
            raw.velocity = std::ptr::null();
        }
        raw.moment = work.moment.0.as_mut_ptr();
    }
    // SAFETY: the workspace has room for the 4 nodes that every element here has (`ElementInstance::create`), the batch's own arrays were made for
    // this element's sizes; all are aligned, and borrowed by nobody else until the call ends. Constants are shared, and only read.
    batch.status = unsafe { element.forces(&raw) };
    if !batch.layers.is_empty() {
        let rows = work.force.0.chunks_exact_mut(LANES);
        for row in rows
            .chain(work.moment.0.chunks_exact_mut(LANES))
            .chain(work.energy.0.chunks_exact_mut(LANES))
        {
            for (value, layers) in row.iter_mut().zip(&batch.layers) {
                *value *= layers;
            }
        }
    }
    for (sum, row) in batch
        .energy
        .iter_mut()
        .zip(work.energy.0.chunks_exact(LANES))
    {
        *sum = sum_of(&row[..batch.count as usize]);
    }
}

/// Sum of a row, eight lanes at a time.
#[inline]
fn sum_of(row: &[f64]) -> f64 {
    let (eights, rest) = row.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for eight in eights {
        for (sum, value) in sums.iter_mut().zip(eight) {
            *sum += value;
        }
    }
    sums.iter().chain(rest).sum()
}

/// Positions `[patch_nodes][3][LANES]` of a batch of patches; unused slots repeat the centre.
fn gather_patches(sheet: &Sheet, batch: &PatchBatch, x: &[Vec3], position: &mut [f64]) {
    let rows = 3 * LANES * batch.nodes.len();
    let width = 3 * LANES * sheet.element.sizes.patch_nodes;
    gather(&batch.nodes, x, &mut position[..rows]);
    for start in (rows..width).step_by(3 * LANES) {
        position.copy_within(..3 * LANES, start);
    }
}

/// Forces of a batch of patches into `work`.
pub(super) fn run_patch(batch: &mut PatchBatch, present: Present<'_>, work: &mut PatchWorkspace) {
    let sheet = &present.sheets[batch.sheet as usize];
    gather_patches(sheet, batch, present.motion.x, &mut work.position.0);
    let mut raw = empty_patch_batch(sheet, present.motion.dt, &work.position.0);
    raw.constants = batch.constants.as_ptr().cast_mut();
    raw.history = batch.history.as_mut_ptr();
    raw.force = work.force.0.as_mut_ptr();
    raw.energy = work.energy.0.as_mut_ptr();
    if present.fields {
        batch.fields = Aligned::zeros(sheet.element.sizes.patch_fields * LANES);
        raw.fields = batch.fields.as_mut_ptr();
    }
    // SAFETY: the workspace has room for `MOST_PATCH_NODES`, which no element here exceeds (`ElementInstance::create`), the batch's own arrays were
    // made for this element's sizes; all are aligned, and borrowed by nobody else until the call ends. Constants are shared, and only read.
    batch.status = unsafe { sheet.element.patch_forces(&raw) };
    batch.energy = sum_of(&work.energy.0[..batch.count as usize]);
}

/// Forces `[4][3][LANES]` of a pressure (Pa) by lane on the cells' nodes, from [`cell_areas`].
#[inline(always)]
pub(super) fn pressure_forces(
    area: &[f64; AREA_ROWS * LANES],
    pressure: &[f64; LANES],
    force: &mut [f64; 12 * LANES],
) {
    for (k, (sx, sy)) in SIGNS.into_iter().enumerate() {
        for c in 0..3 {
            let row = |r: usize| &area[(3 * r + c) * LANES..(3 * r + c + 1) * LANES];
            let (u, v, w) = (row(0), row(1), row(2));
            let out = &mut force[(3 * k + c) * LANES..(3 * k + c + 1) * LANES];
            for l in 0..LANES {
                out[l] = pressure[l] * (u[l] + sx * v[l] + sy * w[l]);
            }
        }
    }
}

/// The smallest critical step of a batch (s).
pub(super) fn batch_critical_step(sheet: &Sheet, batch: &Batch, x: &[Vec3]) -> f64 {
    let steps = cell_critical_steps(sheet, batch, x);
    steps.into_iter().fold(f64::INFINITY, f64::min)
}

/// Critical steps of a batch's elements (s); 0 where they fail or give none. Works on copies of the histories: asking changes
/// nothing.
pub(super) fn cell_critical_steps(sheet: &Sheet, batch: &Batch, x: &[Vec3]) -> Vec<f64> {
    let mut position = Buffer([0.0; 12 * LANES]);
    gather(&batch.nodes, x, &mut position.0);
    let mut history = batch.history.clone();
    let mut material_history = batch.material_history.clone();
    let mut force = Aligned::zeros(12 * LANES);
    let mut moment = Aligned::zeros(12 * LANES);
    let mut energy = Aligned::zeros(PF_ENERGIES * LANES);
    let mut step = Aligned::zeros(LANES);
    let rates = Rates::zero();
    let element = sheet.element_of(batch);
    let mut raw = empty_element_batch(element, 0.0, &position.0);
    if element.rotates() {
        rates.attach(&mut raw);
        raw.moment = moment.as_mut_ptr();
    }
    raw.constants = batch.constants.as_ptr().cast_mut();
    raw.history = history.as_mut_ptr();
    raw.material_history = material_history.as_mut_ptr();
    raw.force = force.as_mut_ptr();
    raw.energy = energy.as_mut_ptr();
    raw.critical_step = step.as_mut_ptr();
    // SAFETY: arrays of this function, of the lengths for 4 nodes and `LANES` lanes, and copies of the batch's own; constants are only read.
    if unsafe { element.forces(&raw) } != PF_OK {
        return vec![0.0; batch.count as usize];
    }
    let bound = |l: usize| step[l] * batch.mass_factor.get(l).map_or(1.0, |f| f.sqrt());
    // A NaN bounds nothing: comparisons would pass over it.
    let safe = |step: f64| if step.is_nan() { 0.0 } else { step };
    (0..batch.count as usize).map(|l| safe(bound(l))).collect()
}

/// Row sums of the bending stiffness (N/m) by model node; infinite where a patch fails or gives none.
pub(super) fn patch_rows(sheet: &Sheet, batch: &PatchBatch, x: &[Vec3]) -> Vec<(u32, f64)> {
    let width = sheet.element.sizes.patch_nodes;
    let mut position = Aligned::zeros(3 * width * LANES);
    gather_patches(sheet, batch, x, &mut position);
    let mut history = batch.history.clone();
    let mut force = Aligned::zeros(3 * width * LANES);
    let mut energy = Aligned::zeros(LANES);
    let mut stiffness = Aligned::zeros(width * LANES);
    let mut raw = empty_patch_batch(sheet, 0.0, &position);
    raw.constants = batch.constants.as_ptr().cast_mut();
    raw.history = history.as_mut_ptr();
    raw.force = force.as_mut_ptr();
    raw.energy = energy.as_mut_ptr();
    raw.stiffness = stiffness.as_mut_ptr();
    // SAFETY: arrays of this function, of the lengths for the element's patch nodes and `LANES` lanes, and a copy of the batch's history; constants
    // are only read.
    let failed = unsafe { sheet.element.patch_forces(&raw) } != PF_OK;
    let safe = |row: f64| {
        if failed || row.is_nan() {
            f64::INFINITY
        } else {
            row
        }
    };
    (0..batch.count as usize)
        .flat_map(|l| {
            let (nodes, stiffness) = (&batch.nodes, &stiffness);
            (0..nodes.len())
                .filter(move |k| *k == 0 || nodes[*k][l] != nodes[0][l])
                .map(move |k| (nodes[k][l], safe(stiffness[k * LANES + l])))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vec3::{cross, dot};

    /// Volume enclosed by bilinear cells: a third of the flux of x, by 2 x 2 Gauss points (exact).
    fn volume(points: &[Vec3], cells: &[[u32; 4]]) -> f64 {
        let g = 1.0 / 3.0f64.sqrt();
        let mut sum = 0.0;
        for cell in cells {
            let p = cell.map(|n| points[n as usize]);
            for (a, b) in [(-g, -g), (g, -g), (g, g), (-g, g)] {
                let at = |w: [f64; 4]| -> Vec3 {
                    std::array::from_fn(|c| (0..4).map(|k| w[k] * p[k][c]).sum())
                };
                let w = crate::contact::shape([a, b]);
                let (wa, wb) = ((1.0 - b, 1.0 + b), (1.0 - a, 1.0 + a));
                let tx = at([-wa.0, wa.0, wa.1, -wa.1].map(|w| 0.25 * w));
                let ty = at([-wb.0, -wb.1, wb.1, wb.0].map(|w| 0.25 * w));
                sum += dot(at(w), cross(tx, ty)) / 3.0;
            }
        }
        sum
    }

    #[test]
    fn pressure_weights_are_the_gradient_of_the_enclosed_volume() {
        // A cube of six warped quads.
        let mut points: Vec<Vec3> = (0..8)
            .map(|i| [(i & 1) as f64, ((i >> 1) & 1) as f64, (i >> 2) as f64])
            .collect();
        for (i, p) in points.iter_mut().enumerate() {
            for (c, v) in p.iter_mut().enumerate() {
                *v += 0.2 * (((i * 5 + c * 3) % 7) as f64 / 7.0 - 0.5);
            }
        }
        let cells: [[u32; 4]; 6] = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let mut gradient = [[0.0; 3]; 8];
        let nodes: [[u32; LANES]; 4] =
            std::array::from_fn(|k| std::array::from_fn(|l| cells.get(l).map_or(0, |c| c[k])));
        let mut position = [0.0; 12 * LANES];
        gather(&nodes, &points, &mut position);
        let mut area = [0.0; AREA_ROWS * LANES];
        cell_areas(&position, &mut area);
        let mut force = [0.0; 12 * LANES];
        pressure_forces(&area, &[1.0; LANES], &mut force);
        for (l, cell) in cells.iter().enumerate() {
            for k in 0..4 {
                for c in 0..3 {
                    gradient[cell[k] as usize][c] += force[(3 * k + c) * LANES + l];
                }
            }
        }
        let h = 1e-6;
        for n in 0..8 {
            for c in 0..3 {
                let at = |d: f64| {
                    let mut q = points.clone();
                    q[n][c] += d;
                    volume(&q, &cells)
                };
                let slope = (at(h) - at(-h)) / (2.0 * h);
                assert!((slope - gradient[n][c]).abs() < 1e-8, "node {n}, {c}");
            }
        }
    }
}
