//! A scan and the ply that it shows: which defects both have, and how far the scanned face is from the simulated one.

use plyflow_defects::pairs::{PairErrors, Pairs, measure_for_pairs};
use plyflow_defects::{Defect, Ply, Settings, Tool};
use plyflow_surface::vector::{Vec3, add, distance, dot, scale};
use plyflow_surface::{Closest, Surface, triangles, weighted_mean, weighted_quantiles};

/// Quantiles of the magnitude of the deviation that are told.
pub const QUANTILES: [(&str, f64); 4] =
    [("q50", 0.5), ("q90", 0.9), ("q99", 0.99), ("largest", 1.0)];

/// What the scan says of the simulation.
pub struct Agreement {
    /// Name of the ply.
    pub ply: String,
    /// The ply's defects, measured as a scan's are: on its formed face, areas too.
    pub simulated: Vec<Defect>,
    /// The scan's, without those beyond the edge of the ply.
    pub scanned: Vec<Defect>,
    /// Of `simulated` and `scanned`.
    pub pairs: Pairs,
    /// What the ply has of the scan's defects.
    pub errors: PairErrors,
    /// `[scan's nodes]` height of the scanned over the simulated face (m); 0 where it is not judged.
    pub deviation: Vec<f64>,
    /// Mean of it, by area (m).
    pub mean: f64,
    /// Its root mean square (m).
    pub root_mean_square: f64,
    /// Its magnitude at [`QUANTILES`] (m).
    pub quantiles: Vec<f64>,
}

impl Agreement {
    /// Of a scan with a ply on the same tool. `above`: how far the scanned surface lies above the ply's mid-surface where both
    /// are right (m). `None` when the ply has no area.
    pub fn of(ply: &Ply, scan: &Ply, tool: &Tool, above: f64, settings: &Settings) -> Option<Self> {
        let (corners, cells) = ply.topology.connectivity();
        let face = Surface::new(&ply.formed, &triangles(corners, cells))?;
        let closest: Vec<Closest> = scan.formed.iter().map(|p| face.closest(*p)).collect();
        let side = upper_side(&closest, tool);
        let areas = scan.topology.node_areas(&scan.formed);
        let judged = |i: usize| scan.distance[i].judged && !closest[i].on_free_edge;
        let weights: Vec<f64> = (0..areas.len())
            .map(|i| if judged(i) { areas[i] } else { 0.0 })
            .collect();
        let height = |i: usize| {
            if judged(i) {
                side * closest[i].signed_distance - above
            } else {
                0.0
            }
        };
        let deviation: Vec<f64> = (0..areas.len()).map(height).collect();
        let magnitudes: Vec<f64> = deviation.iter().map(|d| d.abs()).collect();
        let squares: Vec<f64> = deviation.iter().map(|d| d * d).collect();

        let simulated = measure_for_pairs(&as_scanned(ply), settings);
        let on_ply = |d: &Defect| {
            let area = |counts: &dyn Fn(usize) -> bool| -> f64 {
                let nodes = d.nodes.iter().map(|&i| i as usize);
                nodes.filter(|&i| counts(i)).map(|i| areas[i]).sum()
            };
            2.0 * area(&|i| closest[i].on_free_edge) <= area(&|_| true)
        };
        let mut scanned = measure_for_pairs(scan, settings);
        scanned.retain(on_ply);
        let of_ply = ply.topology.node_areas(&ply.formed);
        let middles: Vec<Vec3> = simulated
            .iter()
            .map(|d| middle(d, &ply.formed, &of_ply))
            .collect();
        let others: Vec<Vec3> = scanned
            .iter()
            .map(|d| middle(d, &scan.formed, &areas))
            .collect();
        let (ours, theirs): (Vec<_>, Vec<_>) =
            (simulated.iter().collect(), scanned.iter().collect());
        let pairs = Pairs::of(&ours, &theirs, settings, |i, j| {
            Some(distance(middles[i], others[j]))
        });
        let errors = PairErrors::of(&ours, &theirs, &pairs);
        Some(Self {
            ply: ply.name.clone(),
            pairs,
            errors,
            simulated,
            scanned,
            mean: weighted_mean(&deviation, &weights),
            root_mean_square: weighted_mean(&squares, &weights).sqrt(),
            quantiles: weighted_quantiles(&magnitudes, &weights, &QUANTILES.map(|q| q.1)),
            deviation,
        })
    }
}

/// +1 where the normals of a ply's closest places point away from the tool, -1 where they point to it: a mesh says by its winding which
/// side is up, the tool says it for certain.
fn upper_side(closest: &[Closest], tool: &Tool) -> f64 {
    let along = |c: &Closest| dot(c.normal, tool.surface.closest(c.point).normal);
    closest.iter().map(along).sum::<f64>().signum()
}

/// A ply of which no more is known than of a scan.
fn as_scanned(ply: &Ply) -> Ply {
    Ply {
        undeformed: ply.formed.clone(),
        shear_angle: Vec::new(),
        fibre_strain: Vec::new(),
        ..ply.clone()
    }
}

/// Middle of a defect's nodes where they are formed, by area (m).
fn middle(defect: &Defect, formed: &[Vec3], areas: &[f64]) -> Vec3 {
    let nodes = || defect.nodes.iter().map(|&i| i as usize);
    let area: f64 = nodes().map(|i| areas[i]).sum();
    nodes().fold([0.0; 3], |sum, i| {
        add(sum, scale(formed[i], areas[i] / area))
    })
}
