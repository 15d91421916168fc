//! The plies of a stack whose fibres are compressed, and whether that is enough for a ruck.

use crate::along::Stretch;
use crate::ruck::Harmonic;
use plyflow_fixed::FixedBits;
use plyflow_geometry::QuadLocator;
use plyflow_geometry::vec3::Vec3;
use plyflow_surface::Topology;
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

/// Farthest place of a stretch from its cell (m), and the most places to one side: what lies farther gives nothing.
const FARTHEST: f64 = 0.25;
const MOST_PLACES: usize = 500;

/// Places on the edge of a ply lie on it, however they were rounded (m).
const ROUNDING: f64 = 1e-6;

/// What a ply is made of. Directions are unit vectors in its fibre axes.
pub trait Law {
    /// Moments per width (N) at signed curvatures (1/m) along a direction.
    fn moments(&self, direction: [f64; 2], curvatures: &[f64]) -> Vec<f64>;
    /// Force per width (N/m) over the strain along a direction, for small compression.
    fn stiffness(&self, direction: [f64; 2]) -> f64;
}

/// A formed ply and what it carries.
#[derive(Clone, Copy)]
pub struct Carrying<'a> {
    /// Its mesh of quads.
    pub topology: &'a Topology,
    /// `[nodes]` flat positions (m).
    pub flat: &'a [Vec3],
    /// Direction of its first fibre axis from x in the flat ply (rad).
    pub axis: f64,
    /// `[cells]` S11, S22 and S12 in the fibre axes (N/m).
    pub resultants: [&'a [f64]; 3],
    /// `[nodes]` pressure on its face that looks to the tool (Pa).
    pub contact_pressure: &'a [f64],
    /// Its law.
    pub law: &'a dyn Law,
}

/// A ply's state as a smooth field on its flat mesh.
struct Smooth<'a> {
    ply: &'a Carrying<'a>,
    locator: QuadLocator,
    /// `[nodes]` S11, S22, S12 (N/m) and pressure (Pa).
    at_nodes: Vec<[f64; 4]>,
    /// Half of the mean side of a cell (m).
    step: f64,
}

impl<'a> Smooth<'a> {
    /// Means over the cells about each node, by area: forces and pressures of single cells alternate in a coarse mesh. `None` for a ply without cells.
    fn new(ply: &'a Carrying<'a>) -> Option<Self> {
        let t = ply.topology;
        let areas = t.cell_areas(ply.flat);
        let (mut sums, mut weights) = (vec![[0.0; 4]; t.nodes()], vec![0.0; t.nodes()]);
        for (c, area) in areas.iter().enumerate() {
            let nodes = t.cell(c);
            let pressures = nodes.iter().map(|n| ply.contact_pressure[*n as usize]);
            let pressure = pressures.sum::<f64>() / nodes.len() as f64;
            let [s11, s22, s12] = ply.resultants.map(|s| s[c]);
            for n in nodes {
                for (sum, value) in sums[*n as usize].iter_mut().zip([s11, s22, s12, pressure]) {
                    *sum += area * value;
                }
                weights[*n as usize] += area;
            }
        }
        let mean = |(s, w): (&[f64; 4], &f64)| s.map(|v| if *w > 0.0 { v / w } else { 0.0 });
        let cells = t.connectivity().1;
        Some(Self {
            locator: QuadLocator::new(ply.flat, cells)?,
            at_nodes: sums.iter().zip(&weights).map(mean).collect(),
            step: 0.5 * (areas.iter().sum::<f64>() / areas.len() as f64).sqrt(),
            ply,
        })
    }

    /// Forces (N/m) and pressure (Pa) at a place of the flat plane (m); `None` where the ply does not lie.
    fn at(&self, [x, y]: [f64; 2]) -> Option<[f64; 4]> {
        let found = self.locator.locate(x, y, ROUNDING)?;
        let mut state = [0.0; 4];
        for (node, weight) in found.nodes.iter().zip(found.weights) {
            let values = self.at_nodes[*node as usize];
            for (sum, value) in state.iter_mut().zip(values) {
                *sum += weight * value;
            }
        }
        Some(state)
    }

    /// A direction of the flat plane, an angle from x (rad), in the fibre axes.
    fn own(&self, angle: f64) -> [f64; 2] {
        let (sine, cosine) = (angle - self.ply.axis).fixed_sin_cos();
        [cosine, sine]
    }
}

/// Plies that lift together, along one direction.
struct Lifted<'a> {
    /// From the lowest upwards, with the direction in the fibre axes of each.
    plies: Vec<(&'a Smooth<'a>, [f64; 2])>,
    bending: Harmonic,
    /// (N/m).
    stiffness: f64,
}

impl<'a> Lifted<'a> {
    fn new(plies: Vec<&'a Smooth<'a>>, angle: f64) -> Option<Self> {
        let plies: Vec<_> = plies.into_iter().map(|p| (p, p.own(angle))).collect();
        let bending = |(p, own): &(&Smooth<'_>, [f64; 2])| {
            Harmonic::of(|curvatures| p.ply.law.moments(*own, curvatures))
        };
        let all = plies.iter().map(bending).reduce(|a, b| a.plus(&b))?;
        let stiffness = plies.iter().map(|(p, own)| p.ply.law.stiffness(*own)).sum();
        (all.bends() && stiffness > 0.0).then_some(Self {
            plies,
            bending: all,
            stiffness,
        })
    }

    /// Compression (N/m) of all of them along the direction, and the pressure (Pa) under the lowest, at a place (m); `None` where the lowest does
    /// not lie or they are not compressed.
    fn at(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        let (lowest, _) = self.plies.first()?;
        let pressure = lowest.at(place)?[3].max(0.0);
        let mut compression = 0.0;
        for (ply, [c, s]) in &self.plies {
            if let Some([s11, s22, s12, _]) = ply.at(place) {
                compression -= s11 * c * c + s22 * s * s + 2.0 * s12 * c * s;
            }
        }
        (compression > 0.0).then_some([compression, pressure])
    }

    /// The stretch through a place along an angle from x (rad), with places `step` (m) apart; `None` where there is no compression.
    fn stretch(&self, place: [f64; 2], angle: f64, step: f64) -> Option<Stretch> {
        let middle = self.at(place)?;
        let (sine, cosine) = angle.fixed_sin_cos();
        let most = MOST_PLACES.min((FARTHEST / step) as usize);
        let side = |sign: f64| -> Vec<[f64; 2]> {
            (1..=most)
                .map_while(|k| {
                    let s = sign * k as f64 * step;
                    self.at([place[0] + s * cosine, place[1] + s * sine])
                })
                .collect()
        };
        let before = side(-1.0);
        let at = before.len();
        let all = before.into_iter().rev().chain([middle]).chain(side(1.0));
        let (compression, pressure) = all.map(|[n, p]| (n, p)).unzip();
        Some(Stretch {
            compression,
            pressure,
            step,
            at,
        })
    }
}

/// By ply and cell: the length that compressed fibres through the cell have too much of, over that which a ruck of the height `height` (m) or more
/// needs there ([`Stretch::excess`]); the larger of both fibre families, 0 where none is compressed. From 1 on there can be such a ruck.
///
/// `plies`: from the tool upwards. A ply lifts all plies above it, of which each adds what it carries along the line, and its bending. Films are
/// left out. A law without stiffness along a direction gives 0.
pub fn excess(plies: &[Carrying<'_>], height: f64) -> Vec<Vec<f64>> {
    let none = |p: &Carrying<'_>| vec![0.0; p.topology.cells()];
    let mut found: Vec<Vec<f64>> = plies.iter().map(none).collect();
    let smooth: Vec<Option<Smooth<'_>>> = plies.iter().map(Smooth::new).collect();
    for (j, ply) in smooth.iter().enumerate() {
        let Some(ply) = ply else { continue };
        for family in [0.0, 1.0] {
            let angle = ply.ply.axis + family * FRAC_PI_2;
            let mut lifted: BTreeMap<Vec<usize>, Option<Lifted<'_>>> = BTreeMap::new();
            for (c, excess) in found[j].iter_mut().enumerate() {
                let place = middle(ply.ply, c);
                let lies = |i: &usize| smooth[*i].as_ref().is_some_and(|p| p.at(place).is_some());
                let above: Vec<usize> = (j..plies.len()).filter(lies).collect();
                let of = |above: &Vec<usize>| {
                    let plies = above.iter().filter_map(|i| smooth[*i].as_ref());
                    Lifted::new(plies.collect(), angle)
                };
                let lifted = lifted.entry(above).or_insert_with_key(of);
                let stretch = lifted.as_ref().and_then(|l| {
                    let stretch = l.stretch(place, angle, ply.step)?;
                    Some(stretch.excess(&l.bending, l.stiffness, height))
                });
                *excess = stretch.unwrap_or(0.0).max(*excess);
            }
        }
    }
    found
}

/// The middle of a cell in the flat plane (m).
fn middle(ply: &Carrying<'_>, cell: usize) -> [f64; 2] {
    let nodes = ply.topology.cell(cell);
    let mean = |d: usize| {
        let sum: f64 = nodes.iter().map(|n| ply.flat[*n as usize][d]).sum();
        sum / nodes.len() as f64
    };
    [mean(0), mean(1)]
}
