//! A scan and the ply that it shows: which defects both have, and how far the scanned face is from the simulated one.

use plyflow_defects::pairs::{PairErrors, Pairs, measure_for_pairs};
use plyflow_defects::{Defect, Ply, Settings, Tool};
use plyflow_geometry::vec3::{Vec3, add, distance, dot, scale};
use plyflow_surface::{Closest, Surface, triangles, weighted_mean, weighted_quantiles};

/// Quantiles of the magnitude of the deviation that are told.
pub const QUANTILES: [(&str, f64); 4] =
    [("q50", 0.5), ("q90", 0.9), ("q99", 0.99), ("largest", 1.0)];

/// A scan that lies over the tool, above its foot, with less than this share of its area is not where it should be.
const LEAST_ON_TOOL: f64 = 0.5;
/// Of what lies there, at least this share lies over the ply. Less than of the tool: the ply may be one of several, or a part of the blank.
const LEAST_ON_PLY: f64 = 0.1;
/// A scan of less than this share of the ply's area is no part of the ply that one would measure: its numbers are in another unit.
const LEAST_SIZE: f64 = 1e-4;
/// With less than this share of the ply covered, one is told so.
const PARTIAL: f64 = 0.5;

/// What the scan says of the simulation.
pub struct Agreement {
    /// Name of the ply.
    pub ply: String,
    /// The ply's defects, measured as a scan's are: on its formed face, areas too. Without those beyond the edge of the scan.
    pub simulated: Vec<Defect>,
    /// The scan's, without those beyond the edge of the ply.
    pub scanned: Vec<Defect>,
    /// Of `simulated` and `scanned`.
    pub pairs: Pairs,
    /// What the ply has of the scan's defects.
    pub errors: PairErrors,
    /// `[scan's nodes]` height of the scanned over the simulated face (m); 0 where it is not judged.
    pub deviation: Vec<f64>,
    /// Share of the scan's area that is judged: over the tool, above its foot, and over the ply.
    pub judged_share: f64,
    /// Share of the ply's formed area over which the scan lies.
    pub covered_share: f64,
    /// Mean of it, by area (m).
    pub mean: f64,
    /// Its root mean square (m).
    pub root_mean_square: f64,
    /// Its magnitude at [`QUANTILES`] (m).
    pub quantiles: Vec<f64>,
}

impl Agreement {
    /// Of a scan with a ply on the same tool. `above`: how far the scanned surface lies above the ply's mid-surface where both
    /// are right (m).
    ///
    /// # Errors
    /// When either has no area, or the scan is so small, or so little of it lies over tool and ply, that it cannot be a scan of that ply.
    pub fn of(
        ply: &Ply,
        scan: &Ply,
        tool: &Tool,
        above: f64,
        settings: &Settings,
    ) -> Result<Self, String> {
        let (face, scanned_face) = (surface(ply, "ply")?, surface(scan, "body")?);
        let closest: Vec<Closest> = scan.formed.iter().map(|p| face.closest(*p)).collect();
        let side = upper_side(&closest, tool);
        let areas = scan.topology.node_areas(&scan.formed);
        let of_ply = ply.topology.node_areas(&ply.formed);
        let uncovered: Vec<bool> = (ply.formed.iter())
            .map(|p| scanned_face.closest(*p).on_free_edge)
            .collect();
        let judged = |i: usize| scan.distance[i].judged && !closest[i].on_free_edge;
        let shares = Shares {
            size: sum(&areas, |_| true) / sum(&of_ply, |_| true),
            on_tool: share(&areas, |i| scan.distance[i].judged),
            judged: share(&areas, judged),
            covered: share(&of_ply, |i| !uncovered[i]),
        };
        shares.check(ply, scan)?;
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

        let (simulated, middles) = found(&as_scanned(ply), &of_ply, settings, |i| !uncovered[i]);
        let (scanned, others) = found(scan, &areas, settings, |i| !closest[i].on_free_edge);
        let (ours, theirs): (Vec<_>, Vec<_>) =
            (simulated.iter().collect(), scanned.iter().collect());
        let pairs = Pairs::of(&ours, &theirs, settings, |i, j| {
            Some(distance(middles[i], others[j]))
        });
        let errors = PairErrors::of(&ours, &theirs, &pairs);
        Ok(Self {
            ply: ply.name.clone(),
            judged_share: shares.judged,
            covered_share: shares.covered,
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

/// How much of scan and ply lies where the other one is.
struct Shares {
    /// Area of the scan over that of the ply.
    size: f64,
    /// Of the scan's area, over the tool and above its foot.
    on_tool: f64,
    /// Of the scan's area, there and over the ply.
    judged: f64,
    /// Of the ply's area, under the scan.
    covered: f64,
}

impl Shares {
    /// Refuses a scan that cannot be one of the ply: where nothing is judged, nothing would be wrong.
    fn check(&self, ply: &Ply, scan: &Ply) -> Result<(), String> {
        let percent = |share: f64| format!("{:.3} %", 100.0 * share);
        let (name, size) = (&ply.name, extent(&scan.formed));
        if self.size < LEAST_SIZE {
            return Err(format!(
                "scan: it is {size} mm large and has {:.1e} of the area of ply '{name}'; expected at least {LEAST_SIZE:.0e}. Its numbers are probably in a larger \
                 unit than `scan_unit` says",
                self.size
            ));
        }
        if self.on_tool < LEAST_ON_TOOL {
            return Err(format!(
                "scan: {} of its area lies over the tool above its foot; expected at least {}. It is {size} mm large where it lies: if that is not the preform's size, \
                 correct `scan_unit`; else move the scan to within some centimetres and degrees of the tool, or cut away from it what is no preform",
                percent(self.on_tool),
                percent(LEAST_ON_TOOL)
            ));
        }
        let on_ply = self.judged / self.on_tool;
        if on_ply < LEAST_ON_PLY {
            return Err(format!(
                "scan: {} of what lies over the tool lies over ply '{name}'; expected at least {}. It is {size} mm large: name the ply that it shows as `scan_ply`, \
                 correct `scan_unit`, or move the scan nearer to where the ply lies",
                percent(on_ply),
                percent(LEAST_ON_PLY)
            ));
        }
        Ok(())
    }
}

impl Agreement {
    /// What one should know of a scan that shows less than half of the ply.
    pub fn partial(&self) -> Option<String> {
        (self.covered_share < PARTIAL).then(|| {
            format!(
                "the scan covers {:.1} % of ply '{}': defects and deviation are compared there alone. If it should cover more, look at `scan_unit` and where it lies",
                100.0 * self.covered_share,
                self.ply
            )
        })
    }
}

/// A ply's or the scan's formed face.
fn surface(of: &Ply, what: &str) -> Result<Surface, String> {
    let (corners, cells) = of.topology.connectivity();
    Surface::new(&of.formed, &triangles(corners, cells)).ok_or_else(|| {
        let name = &of.name;
        format!("{what} '{name}' has no facet with an area: there is nothing to compare")
    })
}

fn sum(areas: &[f64], counts: impl Fn(usize) -> bool) -> f64 {
    let all = areas.iter().enumerate();
    all.filter(|(i, _)| counts(*i)).map(|(_, a)| a).sum()
}

/// Share of an area that counts.
fn share(areas: &[f64], counts: impl Fn(usize) -> bool) -> f64 {
    sum(areas, counts) / sum(areas, |_| true)
}

/// Whether at least half of a defect's area counts.
fn mostly(defect: &Defect, areas: &[f64], counts: impl Fn(usize) -> bool) -> bool {
    let nodes = || defect.nodes.iter().map(|&i| i as usize);
    let area = |i: usize| areas[i];
    2.0 * nodes().filter(|&i| counts(i)).map(area).sum::<f64>() >= nodes().map(area).sum()
}

fn everywhere(ply: &Ply, settings: &Settings) -> Vec<Defect> {
    measure_for_pairs(ply, &vec![true; ply.formed.len()], settings)
}

/// Sides of the box around points, "160.0 x 100.0 x 5.0" (mm).
fn extent(points: &[Vec3]) -> String {
    let side = |d: usize| {
        let along = || points.iter().map(|p| p[d]);
        1e3 * (along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min))
    };
    [0, 1, 2].map(|d| format!("{:.3}", side(d))).join(" x ")
}

/// +1 where the normals of a ply's closest places point away from the tool, -1 where they point to it: a mesh says by its winding which
/// side is up, the tool says it for certain.
fn upper_side(closest: &[Closest], tool: &Tool) -> f64 {
    let along = |c: &Closest| dot(c.normal, tool.surface.closest(c.point).normal);
    closest.iter().map(along).sum::<f64>().signum()
}

/// The defects of a ply with their middles (m). Where only one of the two is, nobody knows what the other one would show: what lies by more than
/// half where the other is not `known` does not count.
fn found(
    ply: &Ply,
    areas: &[f64],
    settings: &Settings,
    known: impl Fn(usize) -> bool,
) -> (Vec<Defect>, Vec<Vec3>) {
    let mut defects = everywhere(ply, settings);
    defects.retain(|d| mostly(d, areas, &known));
    let middles = defects.iter().map(|d| middle(d, &ply.formed, areas));
    let middles = middles.collect();
    (defects, middles)
}

/// A ply of which no more is known than of a scan.
fn as_scanned(ply: &Ply) -> Ply {
    Ply {
        undeformed: ply.formed.clone(),
        shear_angle: Vec::new(),
        fibre_strain: Vec::new(),
        fibre_strains: [Vec::new(), Vec::new()],
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
