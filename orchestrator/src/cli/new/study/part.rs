//! What the tool's file tells a new study: how it stands, how large it is, how sharp.

use plyflow_model::tool::place::{Auto, Axis, Centre, Direction, Foot, Place, Rotation};
use plyflow_model::tool::placed::Placed;
use plyflow_model::tool::stand::stands;
use plyflow_model::units::Angle;
use std::collections::HashMap;
use std::f64::consts::FRAC_PI_2;

type Facet = [[f64; 3]; 3];

/// Overlaps of two facets that are bent by less (rad) are not looked at: next to flat.
const FLAT: f64 = 0.03;

/// Beyond this (rad) the edge of two facets is an edge, and no chord of something round.
const SHARP: f64 = 0.6;

/// Share of the bent length that may be sharper than the radius that counts.
const SHARPER: f64 = 0.02;

/// A rounding of a smaller radius (m) is an edge to any ply.
const EDGE: f64 = 1e-4;

/// How far (m) a tool may lie off its place and be left there.
const IN_PLACE: f64 = 1e-5;

/// A part that is to be formed.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Words that put it in its place, as a scene writes them; empty where it lies there.
    pub words: Vec<String>,
    /// Length, width and height once it is in its place (m).
    pub size: [f64; 3],
    /// Largest distance from the axis (m).
    pub reach: f64,
    /// Share of it, as seen from above, that overhangs.
    pub undercut: f64,
    /// The smallest radius of its roundings (m); `None` without any.
    pub radius: Option<f64>,
    /// Whether it has edges that are not rounded.
    pub sharp: bool,
}

impl Part {
    /// Of facets in units of `unit` (m). `None` where they have no extent.
    pub fn new(facets: &[Facet], unit: f64) -> Option<Self> {
        let (axis, stand) = *stands(facets).first()?;
        let mut place = Place {
            up: (axis != Axis::PlusZ).then_some(Direction::Axis(axis)),
            ..Place::default()
        };
        let [low, high] = bounds(&place, unit, facets)?;
        // Its long side along x. A quarter turn, as what is nearly square is left as it is.
        if high[1] - low[1] > 1.05 * (high[0] - low[0]) {
            place.rotate = Some(Rotation::AboutZ(Angle(FRAC_PI_2)));
        }
        let [low, high] = bounds(&place, unit, facets)?;
        let off = |k: usize| (0.5 * (low[k] + high[k])).abs() > IN_PLACE;
        if off(0) || off(1) {
            place.centre = Some(Centre::Auto(Auto::Auto));
        }
        if low[2].abs() > IN_PLACE {
            place.foot = Some(Foot::Auto);
        }
        let placed = Placed::of(&place, unit, facets.as_flattened().iter())?;
        let from_axis = |p: &[f64; 3]| {
            let [x, y, _] = placed.put(*p);
            (x * x + y * y).sqrt()
        };
        let size: [f64; 3] = std::array::from_fn(|k| high[k] - low[k]);
        let (radius, sharp) = roundings(facets, stand.up);
        let radius = radius.map(|r| r * unit);
        let sharp = sharp || radius.is_some_and(|r| r < EDGE);
        let largest = size.into_iter().fold(0.0, f64::max);
        (largest > 0.0).then(|| Self {
            words: words(&place),
            size,
            reach: facets
                .as_flattened()
                .iter()
                .map(from_axis)
                .fold(0.0, f64::max),
            undercut: stand.undercut,
            radius: radius.filter(|r| *r >= EDGE),
            sharp,
        })
    }
}

/// The words of a place that [`Part::new`] makes.
fn words(place: &Place) -> Vec<String> {
    let mut all = Vec::new();
    if let Some(Direction::Axis(axis)) = place.up {
        all.push(format!("up: {}", axis.word()));
    }
    all.extend(place.rotate.as_ref().map(|_| "rotate: 90 deg".to_owned()));
    all.extend(place.centre.map(|_| "centre: auto".to_owned()));
    all.extend(place.foot.map(|_| "foot: auto".to_owned()));
    all
}

fn bounds(place: &Place, unit: f64, facets: &[Facet]) -> Option<[[f64; 3]; 2]> {
    let placed = Placed::of(place, unit, facets.as_flattened().iter())?;
    let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for p in facets.as_flattened() {
        let p = placed.put(*p);
        for k in 0..3 {
            bounds[0][k] = bounds[0][k].min(p[k]);
            bounds[1][k] = bounds[1][k].max(p[k]);
        }
    }
    bounds[0].iter().all(|c| c.is_finite()).then_some(bounds)
}

/// The smallest radius of what is rounded, in the facets' units, and whether there are sharp edges: two facets that are chords of an arc are bent
/// by their width over its radius. The edge around the foot does not count: no ply lies over it.
fn roundings(facets: &[Facet], up: [f64; 3]) -> (Option<f64>, bool) {
    let along = |p: &[f64; 3]| (0..3).map(|k| p[k] * up[k]).sum::<f64>();
    let heights = || facets.as_flattened().iter().map(along);
    let low = heights().fold(f64::INFINITY, f64::min);
    let foot = low + 1e-3 * (heights().fold(f64::NEG_INFINITY, f64::max) - low);
    let mut edges: HashMap<[[u64; 3]; 2], usize> = HashMap::new();
    let (mut bent, mut all, mut sharp) = (Vec::new(), 0.0, 0.0);
    for (k, facet) in facets.iter().enumerate() {
        for side in 0..3 {
            let [a, b] = [facet[side], facet[(side + 1) % 3]];
            let key = |p: [f64; 3]| p.map(|c| (c + 0.0).to_bits());
            let Some(other) = edges.remove(&[key(b), key(a)]) else {
                edges.insert([key(a), key(b)], k);
                continue;
            };
            if along(&a) <= foot && along(&b) <= foot {
                continue;
            }
            let (length, angle) = (norm(sub(b, a)), angle(facet, &facets[other]));
            all += length;
            if angle > SHARP {
                sharp += length;
            } else if angle > FLAT {
                let height = |f: &Facet| 2.0 * norm(normal(f)) / length;
                let width = height(facet).min(height(&facets[other]));
                bent.push((width / angle, length));
            }
        }
    }
    bent.sort_by(|a, b| a.0.total_cmp(&b.0));
    let whole: f64 = bent.iter().map(|b| b.1).sum();
    let mut sum = 0.0;
    let radius = bent.iter().find(|b| {
        sum += b.1;
        sum > SHARPER * whole
    });
    (radius.map(|r| r.0), sharp > 1e-3 * all)
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}

fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|c| c * c).sum::<f64>().sqrt()
}

/// Half the cross product of two sides.
fn normal([a, b, c]: &Facet) -> [f64; 3] {
    let (u, v) = (sub(*b, *a), sub(*c, *a));
    [
        0.5 * (u[1] * v[2] - u[2] * v[1]),
        0.5 * (u[2] * v[0] - u[0] * v[2]),
        0.5 * (u[0] * v[1] - u[1] * v[0]),
    ]
}

/// Between the normals of two facets (rad); 0 where one has none.
fn angle(a: &Facet, b: &Facet) -> f64 {
    let (a, b) = (normal(a), normal(b));
    let both = norm(a) * norm(b);
    if both == 0.0 {
        return 0.0;
    }
    let cosine = (0..3).map(|k| a[k] * b[k]).sum::<f64>() / both;
    cosine.clamp(-1.0, 1.0).acos()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hat along x: upright walls and a top, between them arcs of `radius`; without ends.
    fn hat([length, width, height, radius]: [f64; 4]) -> Vec<Facet> {
        let half = 0.5 * width;
        let mut line = vec![[-half, 0.0]];
        for k in 0..=12 {
            let a = std::f64::consts::PI - FRAC_PI_2 * f64::from(k) / 12.0;
            line.push([
                -half + radius + radius * a.cos(),
                height - radius + radius * a.sin(),
            ]);
        }
        let other: Vec<[f64; 2]> = line.iter().rev().map(|[y, z]| [-y, *z]).collect();
        line.extend(other);
        let at = |x: f64, [y, z]: [f64; 2]| [x, y, z];
        let (l, mut facets) = (0.5 * length, Vec::new());
        for pair in line.windows(2) {
            let [a, b, c, d] = [
                at(-l, pair[0]),
                at(l, pair[0]),
                at(l, pair[1]),
                at(-l, pair[1]),
            ];
            // Counter-clockwise seen from above: y grows along the line.
            facets.extend([[a, b, c], [a, c, d]]);
        }
        facets
    }

    #[test]
    fn a_hat_in_aircraft_coordinates_is_put_in_its_place_and_its_radius_is_found() {
        let there = hat([300.0, 120.0, 40.0, 6.0]);
        let here = Part::new(&there, 1e-3).unwrap();
        assert_eq!(here.words, Vec::<String>::new());
        let close = |a: f64, b: f64| (a - b).abs() < 1e-9;
        assert!(close(here.size[0], 0.3) && close(here.size[1], 0.12) && close(here.size[2], 0.04));
        assert!((here.radius.unwrap() / 6e-3 - 1.0).abs() < 0.05, "{here:?}");
        assert!(!here.sharp && here.undercut < 1e-9);

        // Length along z, up along y.
        let moved = |f: &Facet| f.map(|[x, y, z]| [y + 8_000.0, z - 300.0, x + 12_000.0]);
        let far: Vec<Facet> = there.iter().map(moved).collect();
        let far = Part::new(&far, 1e-3).unwrap();
        let words = ["up: +y", "rotate: 90 deg", "centre: auto", "foot: auto"];
        assert_eq!(far.words, words);
        assert!((0..3).all(|k| close(far.size[k], here.size[k])), "{far:?}");
    }

    #[test]
    fn edges_without_roundings_are_told() {
        let box_of = hat([300.0, 120.0, 40.0, 1e-9]);
        let part = Part::new(&box_of, 1e-3).unwrap();
        assert!(part.sharp, "{part:?}");
        // A pyramid: sharp above, and its foot is closed.
        let corner = |k: usize| {
            [
                [-50.0, -50.0, 0.0],
                [50.0, -50.0, 0.0],
                [50.0, 50.0, 0.0],
                [-50.0, 50.0, 0.0],
            ][k % 4]
        };
        let flank = |k: usize, top: f64| [corner(k), corner(k + 1), [0.0, 0.0, top]];
        let foot = [
            [corner(0), corner(2), corner(1)],
            [corner(0), corner(3), corner(2)],
        ];
        let with = |top: f64| {
            let mut all: Vec<Facet> = (0..4).map(|k| flank(k, top)).collect();
            all.extend(foot);
            Part::new(&all, 1e-3).unwrap()
        };
        assert!(with(50.0).sharp);
        // So flat that above only the foot's edge is one.
        assert!(!with(5.0).sharp);
        assert_eq!(Part::new(&[], 1e-3), None);
    }
}
