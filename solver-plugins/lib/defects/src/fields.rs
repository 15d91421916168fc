//! How far the positions, the distances from the tool and the shear angles of one way to the answer are from those of another.

use crate::ply::Ply;
use plyflow_geometry::vec3::distance;
use plyflow_geometry::{Location, QuadLocator};
use plyflow_surface::weighted_quantiles;

/// Shear angles are told at these quantiles.
pub const QUANTILES: [f64; 5] = [0.01, 0.25, 0.5, 0.75, 0.99];

/// Places on the side of a mesh lie in it, however they were rounded (m).
const ROUNDING: f64 = 1e-6;

/// Errors of fields against those of a reference, at the reference's nodes and at the centres of its cells, as far as both have them. Nodes and cells count by
/// their area in the flat ply, so that a finely meshed part of the reference counts no more than another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldErrors {
    /// Root mean square distance of material points from where the reference has them (m).
    pub position: f64,
    /// Root mean square difference of the distances from the tool (m), where both are judged; `None` when nowhere.
    pub distance: Option<f64>,
    /// Root mean square of the reference's distances from the tool there (m): what `distance` is large or small against.
    pub standing_off: Option<f64>,
    /// Largest difference of the quantiles ([`QUANTILES`]) of the shear angle (rad), over the plies; `None` when it is not known.
    pub shear: Option<f64>,
}

/// A ply of one name in several models; where they overlap the first one counts.
struct Layered<'a>(Vec<(&'a Ply, QuadLocator)>);

impl<'a> Layered<'a> {
    fn new(way: &[&'a [Ply]], name: &str) -> Self {
        let plies = (way.iter()).flat_map(|m| m.iter().filter(|p| p.name == name));
        let located = plies.filter_map(|p| {
            let (_, cells) = p.topology.connectivity();
            Some((p, QuadLocator::new(&p.undeformed, cells)?))
        });
        Self(located.collect())
    }

    fn at(&self, x: f64, y: f64) -> Option<(&'a Ply, Location)> {
        let mut layers = self.0.iter();
        layers.find_map(|(p, l)| Some((*p, l.locate(x, y, ROUNDING)?)))
    }
}

/// Distance from the tool at a place (m); `None` where a node beside it is not judged.
pub fn distance_at(ply: &Ply, place: &Location) -> Option<f64> {
    let nodes = place.nodes.map(|i| ply.distance[i as usize]);
    let judged = nodes.iter().all(|n| n.judged);
    judged.then(|| {
        (nodes.iter().zip(place.weights))
            .map(|(n, w)| w * n.value)
            .sum()
    })
}

/// Centre of a cell in the flat ply (m).
fn centre(ply: &Ply, cell: usize) -> [f64; 2] {
    let corners = ply.topology.cell(cell);
    [0, 1].map(|d| {
        let sum: f64 = (corners.iter())
            .map(|&i| ply.undeformed[i as usize][d])
            .sum();
        sum / corners.len() as f64
    })
}

/// Area of a cell in the flat ply (m2): half of the cross product of the diagonals of a quad, of two sides of a triangle.
fn area(ply: &Ply, cell: usize) -> f64 {
    let corners = ply.topology.cell(cell);
    let at = |k: usize| ply.undeformed[corners[k] as usize];
    let way = |a: usize, b: usize| [0, 1].map(|d| at(b)[d] - at(a)[d]);
    let ([ax, ay], [bx, by]) = match corners.len() {
        3 => (way(0, 1), way(0, 2)),
        _ => (way(0, 2), way(1, 3)),
    };
    0.5 * (ax * by - ay * bx).abs()
}

/// Root mean square of what was added, by weight.
#[derive(Default)]
struct Squares {
    sum: f64,
    weight: f64,
}

impl Squares {
    fn add(&mut self, difference: f64, weight: f64) {
        self.sum += weight * difference * difference;
        self.weight += weight;
    }

    fn root(&self) -> Option<f64> {
        (self.weight > 0.0).then(|| (self.sum / self.weight).sqrt())
    }
}

impl FieldErrors {
    /// Of the plies of a way's runs (the first run that has a place counts there) against those of a reference's; plies of one name are
    /// the same. `counts`: whether a place in the flat ply (m) of a run of the reference, by its index, is asked. `None` when they share no such place.
    pub fn of(
        way: &[&[Ply]],
        reference: &[&[Ply]],
        counts: impl Fn(usize, &[f64]) -> bool,
    ) -> Option<Self> {
        let mut position = Squares::default();
        let (mut apart, mut standing_off) = (Squares::default(), Squares::default());
        let mut names: Vec<&str> = Vec::new();
        for p in reference.iter().copied().flatten() {
            if !names.contains(&p.name.as_str()) {
                names.push(&p.name);
            }
        }
        let mut shear: Option<f64> = None;
        for name in names {
            let ours = Layered::new(way, name);
            let theirs = (reference.iter().enumerate())
                .flat_map(|(run, m)| m.iter().filter(|p| p.name == name).map(move |p| (run, p)));
            // Shear angles of both at the same places, and the areas that these stand for.
            let (mut angles, mut cells) = ([Vec::new(), Vec::new()], Vec::new());
            for (run, ply) in theirs {
                let areas = ply.topology.node_areas(&ply.undeformed);
                for (i, at) in ply.undeformed.iter().enumerate() {
                    let Some((p, place)) = ours.at(at[0], at[1]).filter(|_| counts(run, at)) else {
                        continue;
                    };
                    let off = distance(place.interpolate(&p.formed), ply.formed[i]);
                    position.add(off, areas[i]);
                    let judged = ply.distance[i].judged;
                    if let Some(value) = distance_at(p, &place).filter(|_| judged) {
                        apart.add(value - ply.distance[i].value, areas[i]);
                        standing_off.add(ply.distance[i].value, areas[i]);
                    }
                }
                for (c, &theirs) in ply.shear_angle.iter().enumerate() {
                    let [x, y] = centre(ply, c);
                    let found = ours.at(x, y).filter(|_| counts(run, &[x, y]));
                    if let Some(&value) = found.and_then(|(p, l)| p.shear_angle.get(l.cell)) {
                        angles[0].push(value);
                        angles[1].push(theirs);
                        cells.push(area(ply, c));
                    }
                }
            }
            if !angles[0].is_empty() {
                let [a, b] = angles.map(|a| weighted_quantiles(&a, &cells, &QUANTILES));
                let worst = (a.iter().zip(&b)).map(|(a, b)| (a - b).abs());
                shear = worst.chain(shear).reduce(f64::max);
            }
        }
        Some(Self {
            position: position.root()?,
            distance: apart.root(),
            standing_off: standing_off.root(),
            shear,
        })
    }
}
