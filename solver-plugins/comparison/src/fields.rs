//! How far the positions, the distances from the tool and the shear angles of one way to the answer are from those of another.

use crate::QUANTILES;
use crate::models::{Model, ROUNDING};
use plyflow_defects::{Ply, quantiles};
use plyflow_sdk::{Host, StepError};
use plyflow_surface::vector::distance;
use plyflow_surface::{Location, QuadLocator};

/// Errors of fields against those of a reference, at the reference's nodes and at the centres of its cells, as far as both have them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldErrors {
    /// Root mean square distance of material points from where the reference has them (m).
    pub position: f64,
    /// Root mean square difference of the distances from the tool (m), where both are judged; `None` when nowhere.
    pub distance: Option<f64>,
    /// Largest difference of the quantiles ([`QUANTILES`]) of the shear angle (rad), over the plies; `None` when it is not known.
    pub shear: Option<f64>,
}

/// A ply of one name in several models; where they overlap the first one counts.
struct Layered<'a>(Vec<(&'a Ply, QuadLocator)>);

impl<'a> Layered<'a> {
    fn new(way: &[&'a Model], name: &str) -> Self {
        let plies = (way.iter()).flat_map(|m| m.plies.iter().filter(|p| p.name == name));
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

/// Root mean square of what was added.
#[derive(Default)]
struct Squares {
    sum: f64,
    count: usize,
}

impl Squares {
    fn add(&mut self, difference: f64) {
        self.sum += difference * difference;
        self.count += 1;
    }

    fn root(&self) -> Option<f64> {
        (self.count > 0).then(|| (self.sum / self.count as f64).sqrt())
    }
}

impl FieldErrors {
    /// Of the models of a way (the first one that has a place counts there) against those of a reference; `None` when they share no place.
    pub fn of(way: &[&Model], reference: &[&Model]) -> Option<Self> {
        let (mut position, mut standing_off) = (Squares::default(), Squares::default());
        let mut names: Vec<&str> = Vec::new();
        for p in reference.iter().flat_map(|m| &m.plies) {
            if !names.contains(&p.name.as_str()) {
                names.push(&p.name);
            }
        }
        let mut shear: Option<f64> = None;
        for name in names {
            let ours = Layered::new(way, name);
            let theirs = (reference.iter()).flat_map(|m| m.plies.iter().filter(|p| p.name == name));
            // Shear angles of both at the same places.
            let mut angles = [Vec::new(), Vec::new()];
            for ply in theirs {
                for (i, at) in ply.undeformed.iter().enumerate() {
                    let Some((p, place)) = ours.at(at[0], at[1]) else {
                        continue;
                    };
                    position.add(distance(place.interpolate(&p.formed), ply.formed[i]));
                    let judged = ply.distance[i].judged;
                    if let Some(value) = distance_at(p, &place).filter(|_| judged) {
                        standing_off.add(value - ply.distance[i].value);
                    }
                }
                for (c, &theirs) in ply.shear_angle.iter().enumerate() {
                    let [x, y] = centre(ply, c);
                    let found = ours.at(x, y);
                    if let Some(&value) = found.and_then(|(p, l)| p.shear_angle.get(l.cell)) {
                        angles[0].push(value);
                        angles[1].push(theirs);
                    }
                }
            }
            if !angles[0].is_empty() {
                let [a, b] = angles.map(|a| quantiles(&a, &QUANTILES));
                let worst = (a.iter().zip(&b)).map(|(a, b)| (a - b).abs());
                shear = worst.chain(shear).reduce(f64::max);
            }
        }
        Some(Self {
            position: position.root()?,
            distance: standing_off.root(),
            shear,
        })
    }

    /// Writes them under their names with a suffix.
    ///
    /// # Errors
    /// When the host refuses a result.
    pub fn write(&self, host: &Host, suffix: &str) -> Result<(), StepError> {
        host.result(&format!("position_error{suffix}"), self.position, "m")?;
        if let Some(distance) = self.distance {
            host.result(&format!("distance_error{suffix}"), distance, "m")?;
        }
        if let Some(shear) = self.shear {
            host.result(&format!("shear_quantile_error{suffix}"), shear, "rad")?;
        }
        Ok(())
    }
}
