//! Coarser meshes for pages that would be too large.

use crate::plain::Vec3;
use std::collections::{BTreeMap, BTreeSet};

/// Coarsening stops here: a mesh that has still more points stays so.
const STEPS: u32 = 64;

/// What is left of a mesh: indices of the points that stay, and the cells between them (a quad may have become a triangle, with
/// a corner that stands twice).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Thinned {
    pub(super) points: Vec<u32>,
    pub(super) cells: Vec<Vec<u32>>,
}

/// The most points of a mesh, so that all `sizes` together are at most `budget`.
pub(super) fn share(sizes: &[usize], budget: usize) -> usize {
    let mut sizes = sizes.to_vec();
    sizes.sort_unstable();
    let mut left = budget;
    for (i, n) in sizes.iter().enumerate() {
        let each = left / (sizes.len() - i);
        if *n > each {
            return each;
        }
        left -= n;
    }
    usize::MAX
}

/// A mesh with about `most` points: space (`at`) is divided into cubes, and of the points of a cube the one next to its centre stays.
pub(super) fn thin(at: &[Vec3], cells: &[Vec<u32>], most: usize) -> Thinned {
    let whole = Thinned {
        points: (0..at.len() as u32).collect(),
        cells: cells.to_vec(),
    };
    if at.len() <= most {
        return whole;
    }
    let pitch = mean_side(at, cells);
    let mut found = whole;
    // Half steps: between two whole numbers of sides lies more than a factor of two in points.
    for k in 3..STEPS {
        found = merged(at, cells, pitch * f64::from(k) / 2.0);
        if found.points.len() <= most {
            break;
        }
    }
    found
}

fn mean_side(at: &[Vec3], cells: &[Vec<u32>]) -> f64 {
    let side = |c: &Vec<u32>| {
        let [a, b] = [c[0], c[1]].map(|i| at[i as usize]);
        (0..3).map(|d| (a[d] - b[d]).powi(2)).sum::<f64>().sqrt()
    };
    cells.iter().map(side).sum::<f64>() / cells.len().max(1) as f64
}

fn merged(at: &[Vec3], cells: &[Vec<u32>], pitch: f64) -> Thinned {
    let low = at.iter().fold([f64::INFINITY; 3], |l, p| {
        [0, 1, 2].map(|d| f64::min(l[d], p[d]))
    });
    // Points of a lattice lie within their cubes, not on the sides between two.
    let place = |p: &Vec3| [0, 1, 2].map(|d| (p[d] - low[d]) / pitch + 0.25);
    let cube = |p: &Vec3| place(p).map(|v| v.floor() as i64);
    let off = |i: u32| -> f64 {
        let v = place(&at[i as usize]);
        v.iter().map(|v| (v - v.floor() - 0.5).powi(2)).sum()
    };
    let mut stays: BTreeMap<[i64; 3], u32> = BTreeMap::new();
    for i in 0..at.len() as u32 {
        let now = stays.entry(cube(&at[i as usize])).or_insert(i);
        if off(i) < off(*now) {
            *now = i;
        }
    }
    let mut points: Vec<u32> = stays.values().copied().collect();
    points.sort_unstable();
    let number: BTreeMap<u32, u32> = points.iter().zip(0..).map(|(p, n)| (*p, n)).collect();
    let to = |i: &u32| number[&stays[&cube(&at[*i as usize])]];
    let mut seen = BTreeSet::new();
    let mut left = Vec::new();
    for cell in cells {
        let cell: Vec<u32> = cell.iter().map(to).collect();
        let mut corners = cell.clone();
        corners.sort_unstable();
        corners.dedup();
        if corners.len() > 2 && seen.insert(corners) {
            left.push(cell);
        }
    }
    Thinned {
        points,
        cells: left,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lattice(n: u32) -> (Vec<Vec3>, Vec<Vec<u32>>) {
        let at = (0..(n + 1) * (n + 1))
            .map(|i| [f64::from(i % (n + 1)), f64::from(i / (n + 1)), 0.0])
            .collect();
        let quad = |c: u32| {
            let i = c / n * (n + 1) + c % n;
            vec![i, i + 1, i + n + 2, i + n + 1]
        };
        (at, (0..n * n).map(quad).collect())
    }

    #[test]
    fn a_thinned_lattice_covers_the_same_place_with_fewer_points() {
        let (at, cells) = lattice(40);
        let found = thin(&at, &cells, 500);
        assert!(
            found.points.len() <= 500 && found.points.len() > 150,
            "{}",
            found.points.len()
        );
        let area: f64 = (found.cells.iter())
            .map(|c| {
                let p: Vec<Vec3> = c
                    .iter()
                    .map(|i| at[found.points[*i as usize] as usize])
                    .collect();
                let cross = |a: Vec3, b: Vec3, c: Vec3| {
                    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
                };
                0.5 * (cross(p[0], p[1], p[2]) + cross(p[0], p[2], p[3]))
            })
            .sum();
        // Cells at the rim are lost by less than a pitch.
        assert!(area > 0.85 * 1600.0 && area <= 1600.0, "{area}");
    }

    #[test]
    fn a_mesh_within_the_limit_stays_as_it_is() {
        let (at, cells) = lattice(4);
        let found = thin(&at, &cells, 25);
        assert_eq!(found.points.len(), 25);
        assert_eq!(found.cells, cells);
    }

    #[test]
    fn small_meshes_keep_their_points_and_large_ones_share_the_rest() {
        assert_eq!(share(&[10, 20, 30], 60), usize::MAX);
        assert_eq!(share(&[10, 500, 500], 110), 50);
        assert_eq!(share(&[], 10), usize::MAX);
    }
}
