//! Slip between plies that lie on each other: by how much places that lay on each other when flat have moved apart along the plies.

use plyflow_defects::Ply;
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{Vec3, add, cross, dot, norm, scale, sub, unit};
use plyflow_geometry::{Location, QuadLocator, rectangle};

/// Places on the edge of a ply lie on it, however they were rounded (m).
const ROUNDING: f64 = 1e-6;

/// Slip at a place (m).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slip {
    /// In space, in the tangent plane of the ply below.
    pub vector: Vec3,
    /// Its part along the direction that is asked for, and that across it, to the left as seen from above.
    pub parts: [f64; 2],
}

/// A ply with the means to find its places.
struct Face<'a> {
    ply: &'a Ply,
    locator: QuadLocator,
    /// Unit normals of the formed ply by node, away from the tool.
    normals: Vec<Vec3>,
}

/// The plies of a run, from the tool upwards.
pub struct Faces<'a> {
    all: Vec<Face<'a>>,
    /// Unit vector of the direction in the plane.
    along: Vec3,
}

impl<'a> Faces<'a> {
    /// `direction`: from x (rad). `None` where a ply is not a mesh of quads.
    pub fn new(plies: &[&'a Ply], direction: f64) -> Option<Self> {
        let face = |ply: &&'a Ply| {
            let (corners, cells) = ply.topology.connectivity();
            let locator = (corners == 4).then(|| QuadLocator::new(&ply.undeformed, cells))??;
            // Cells may be wound either way; flat, the side away from the tool is up.
            let flat = ply.topology.normals(&ply.undeformed);
            let side = flat.iter().map(|n| n[2]).sum::<f64>().signum();
            let normals = ply.topology.normals(&ply.formed).into_iter();
            Some(Face {
                ply,
                locator,
                normals: normals.map(|n| scale(n, side)).collect(),
            })
        };
        Some(Self {
            all: plies.iter().map(face).collect::<Option<_>>()?,
            along: [direction.fixed_cos(), direction.fixed_sin(), 0.0],
        })
    }

    /// How many plies there are.
    pub fn count(&self) -> usize {
        self.all.len()
    }

    /// The ply of that number.
    pub fn ply(&self, k: usize) -> &Ply {
        self.all[k].ply
    }

    fn locate(&self, k: usize, at: [f64; 2]) -> Option<Location> {
        self.all[k].locator.locate(at[0], at[1], ROUNDING)
    }

    /// What ply `upper` has slipped over the ply on which it lies at a place of the flat plane (m), the next one below that reaches there, with
    /// the number of that one. `formed`: where the place of `upper` is now (m).
    fn over(&self, upper: usize, at: [f64; 2], formed: Vec3) -> Option<(usize, Slip)> {
        let below = (0..upper).rev();
        let (lower, place) = below
            .map(|k| (k, self.locate(k, at)))
            .find_map(|(k, place)| Some((k, place?)))?;
        let face = &self.all[lower];
        let way = sub(formed, place.interpolate(&face.ply.formed));
        let normal = unit(place.interpolate(&face.normals));
        let vector = sub(way, scale(normal, dot(way, normal)));
        let along = tilted(self.along, normal);
        let parts = [dot(vector, along), dot(vector, cross(normal, along))];
        Some((lower, Slip { vector, parts }))
    }

    /// By node of ply `upper`: the number of the ply on which it lies there, and its slip over it; `None` where it lies on none.
    pub fn field(&self, upper: usize) -> Vec<Option<(usize, Slip)>> {
        let ply = self.all[upper].ply;
        let nodes = ply.undeformed.iter().zip(&ply.formed);
        nodes
            .map(|(flat, formed)| self.over(upper, [flat[0], flat[1]], *formed))
            .collect()
    }

    /// The slip of ply `upper` over ply `lower` at the stations of a line.
    pub fn along(&self, lower: usize, upper: usize, line: &Line) -> Vec<(i64, Slip)> {
        let slip = |k: i64| {
            let at = line.place(k);
            let place = self.locate(upper, at)?;
            let formed = place.interpolate(&self.all[upper].ply.formed);
            let (found, slip) = self.over(upper, at, formed)?;
            (found == lower).then_some((k, slip))
        };
        (-line.reach..=line.reach).filter_map(slip).collect()
    }

    /// How far from a place (m) the flat plies reach at most.
    pub fn reach(&self, from: [f64; 2]) -> f64 {
        let nodes = self.all.iter().flat_map(|f| &f.ply.undeformed);
        let [x0, y0, x1, y1] = rectangle::around(nodes.map(|p| [p[0], p[1]]));
        let off = |low: f64, high: f64, at: f64| (at - low).abs().max((high - at).abs());
        off(x0, x1, from[0]).fixed_hypot(off(y0, y1, from[1]))
    }
}

/// A horizontal direction on a surface of this normal: turned with it out of the plane, by the shortest way. On gentle slopes that is its
/// projection; on walls that face along the direction, which have none, it goes on along the wall.
fn tilted(direction: Vec3, normal: Vec3) -> Vec3 {
    let up = 1.0 + normal[2];
    if up < 1e-6 {
        return direction;
    }
    let middle = add(normal, [0.0, 0.0, 1.0]);
    sub(direction, scale(middle, dot(direction, normal) / up))
}

/// A straight line on the flat plies with stations at even distances on both sides of its middle.
pub struct Line {
    /// Its middle (m).
    pub middle: [f64; 2],
    /// Unit vector along it.
    pub axis: [f64; 2],
    /// Distance of stations (m).
    pub step: f64,
    /// Number of stations on either side.
    pub reach: i64,
}

impl Line {
    /// Of a station (m).
    pub fn place(&self, k: i64) -> [f64; 2] {
        let s = self.station(k);
        [0, 1].map(|d| self.middle[d] + s * self.axis[d])
    }

    /// From the middle (m).
    pub fn station(&self, k: i64) -> f64 {
        k as f64 * self.step
    }
}

/// What is told of one part of the slip along a line (m).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Course {
    /// Largest magnitude.
    pub max: f64,
    /// Mean, with its sign.
    pub mean: f64,
    /// About the middle; `None` where no station has its mirror image on both plies.
    pub parity: Option<Parity>,
}

/// Root mean squares (m) of the two parts of a course, over the stations whose mirror image is on both plies too: their squares add up to that of
/// the course.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parity {
    /// Half the sum with the mirror image.
    pub symmetric: f64,
    /// Half the difference from it.
    pub antisymmetric: f64,
}

impl Parity {
    /// Share of the antisymmetric part in the course, 0 to 1; `None` where there is no slip.
    pub fn asymmetry(&self) -> Option<f64> {
        let all = self.symmetric.fixed_hypot(self.antisymmetric);
        (all > 0.0).then(|| self.antisymmetric / all)
    }
}

/// Of the values at some stations, in their order. Empty: `None`.
pub fn course(values: &[(i64, f64)]) -> Option<Course> {
    let count = values.len() as f64;
    let each = || values.iter().map(|v| v.1);
    let at = |k: i64| {
        let found = values.binary_search_by_key(&k, |v| v.0).ok()?;
        Some(values[found].1)
    };
    let (mut even, mut odd, mut pairs) = (0.0, 0.0, 0.0);
    for (k, v) in values {
        if let Some(other) = at(-k) {
            even += (0.5 * (v + other)).powi(2);
            odd += (0.5 * (v - other)).powi(2);
            pairs += 1.0;
        }
    }
    (!values.is_empty()).then(|| Course {
        max: each().fold(0.0, |m, v| m.max(v.abs())),
        mean: each().sum::<f64>() / count,
        parity: (pairs > 0.0).then(|| Parity {
            symmetric: (even / pairs).sqrt(),
            antisymmetric: (odd / pairs).sqrt(),
        }),
    })
}

/// Share of the stations whose mirror image is there too.
pub fn mirrored(stations: &[i64]) -> f64 {
    let there = |k: &&i64| stations.binary_search(&-**k).is_ok();
    stations.iter().filter(there).count() as f64 / stations.len().max(1) as f64
}

/// Magnitude of a slip (m).
pub fn size(slip: &Slip) -> f64 {
    norm(slip.vector)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_about_the_middle_are_those_of_an_even_and_an_odd_course() {
        let of = |f: fn(f64) -> f64| {
            let values: Vec<(i64, f64)> = (-50..=50).map(|k| (k, f(k as f64 / 50.0))).collect();
            course(&values).unwrap().parity.unwrap()
        };
        let (even, odd) = (of(|x| 2.0 - x * x), of(|x| x * x * x));
        assert!(even.antisymmetric < 1e-15 && even.asymmetry() == Some(0.0));
        assert!(odd.symmetric < 1e-15 && odd.asymmetry() == Some(1.0));
        let both = of(|x| 3.0 + 4.0 * x.signum());
        assert!((both.symmetric - 3.0).abs() < 0.1 && (both.antisymmetric - 4.0).abs() < 0.1);
        assert_eq!(of(|_| 0.0).asymmetry(), None);
        // Of a line that ends early on one side only what has a mirror image counts.
        let half: Vec<(i64, f64)> = (-2..=9).map(|k| (k, 1.0)).collect();
        let stations: Vec<i64> = half.iter().map(|v| v.0).collect();
        assert!((mirrored(&stations) - 5.0 / 12.0).abs() < 1e-15);
        assert_eq!(course(&half[4..]).unwrap().parity, None);
        assert_eq!(course(&[]), None);
    }

    #[test]
    fn a_direction_is_turned_with_the_surface_and_stays_a_unit_vector_in_it() {
        let x = [1.0, 0.0, 0.0];
        for n in [
            [0.6, 0.0, 0.8],
            [0.0, 0.6, 0.8],
            [1.0, 0.0, 0.0],
            [0.48, -0.6, 0.64],
        ] {
            let a = tilted(x, n);
            assert!(
                (norm(a) - 1.0).abs() < 1e-12 && dot(a, n).abs() < 1e-12,
                "{n:?}"
            );
        }
        assert_eq!(tilted(x, [0.0, 0.6, 0.8]), x);
        assert!(norm(sub(tilted(x, [0.6, 0.0, 0.8]), [0.8, 0.0, -0.6])) < 1e-12);
        // A wall that faces along the direction: down along it.
        assert_eq!(tilted(x, x), [0.0, 0.0, -1.0]);
    }
}
