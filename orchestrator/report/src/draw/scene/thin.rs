//! Coarser meshes for pages that would be too large.

use crate::plain::Vec3;
use std::collections::{BTreeMap, BTreeSet};

/// Cosine of the angle from which on two faces meet at a sharp edge: 35 degrees, as the script of the page has it.
const CREASE: f64 = 0.819_152_044_288_992;
/// Cosine of the angle up to which an edge goes on straight.
const BENT: f64 = 0.9;
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

/// A mesh with about `most` points: space (`at`) is divided into cubes, and of the points of a cube the one next to its centre stays. With
/// `edges` points on sharp edges and where these end or bend come before others, so that edges stay where they are.
pub(super) fn thin(at: &[Vec3], cells: &[Vec<u32>], most: usize, edges: bool) -> Thinned {
    let whole = Thinned {
        points: (0..at.len() as u32).collect(),
        cells: cells.to_vec(),
    };
    if at.len() <= most {
        return whole;
    }
    let pitch = mean_side(at, cells);
    let ranks = match edges {
        true => ranks(at, cells),
        false => vec![0; at.len()],
    };
    let mut found = whole;
    // Half steps: between two whole numbers of sides lies more than a factor of two in points.
    for k in 3..STEPS {
        found = merged(at, cells, &ranks, pitch * f64::from(k) / 2.0);
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

/// Of each point: 0 on a smooth part of the surface, 1 on a sharp edge or on the rim, 2 where edges meet, end or bend.
fn ranks(at: &[Vec3], cells: &[Vec<u32>]) -> Vec<u8> {
    let mut ends: Vec<Vec<Vec3>> = vec![Vec::new(); at.len()];
    for [a, b] in sharp_edges(at, cells) {
        let along = unit(sub(at[b as usize], at[a as usize]));
        ends[a as usize].push(along);
        ends[b as usize].push(along.map(|x| -x));
    }
    let rank = |ends: &Vec<Vec3>| match ends.as_slice() {
        [] => 0,
        [a, b] if dot(*a, *b) < -BENT => 1,
        _ => 2,
    };
    ends.iter().map(rank).collect()
}

/// Sides of cells where two faces meet at an edge, and those of one cell alone.
pub(super) fn sharp_edges(at: &[Vec3], cells: &[Vec<u32>]) -> Vec<[u32; 2]> {
    let mut faces: BTreeMap<[u32; 2], Vec<Vec3>> = BTreeMap::new();
    for cell in cells {
        let of = |k: usize| at[cell[k] as usize];
        let last = cell.len() - 1;
        let normal = match last {
            3 => cross(sub(of(2), of(0)), sub(of(3), of(1))),
            _ => cross(sub(of(1), of(0)), sub(of(2), of(0))),
        };
        for k in 0..=last {
            let (a, b) = (cell[k], cell[if k == last { 0 } else { k + 1 }]);
            if a != b {
                let side = [a.min(b), a.max(b)];
                faces.entry(side).or_default().push(unit(normal));
            }
        }
    }
    let sharp = |(_, n): &(_, Vec<Vec3>)| match n.as_slice() {
        [a, b] => dot(*a, *b) < CREASE,
        _ => true,
    };
    faces
        .into_iter()
        .filter(sharp)
        .map(|(side, _)| side)
        .collect()
}

fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [0, 1, 2].map(|d| a[d] - b[d])
}

fn dot(a: Vec3, b: Vec3) -> f64 {
    (0..3).map(|d| a[d] * b[d]).sum()
}

fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

fn unit(a: Vec3) -> Vec3 {
    let length = dot(a, a).sqrt().max(1e-300);
    a.map(|x| x / length)
}

fn merged(at: &[Vec3], cells: &[Vec<u32>], ranks: &[u8], pitch: f64) -> Thinned {
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
        let rank = |i: u32| std::cmp::Reverse(ranks[i as usize]);
        let order = rank(i).cmp(&rank(*now)).then(off(i).total_cmp(&off(*now)));
        if order.is_lt() {
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
        let found = thin(&at, &cells, 500, false);
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
        let found = thin(&at, &cells, 25, true);
        assert_eq!(found.points.len(), 25);
        assert_eq!(found.cells, cells);
    }

    #[test]
    fn small_meshes_keep_their_points_and_large_ones_share_the_rest() {
        assert_eq!(share(&[10, 20, 30], 60), usize::MAX);
        assert_eq!(share(&[10, 500, 500], 110), 50);
        assert_eq!(share(&[], 10), usize::MAX);
    }

    #[test]
    fn the_corners_and_edges_of_a_block_stay_where_they_are() {
        // An open box of five squares of 24 by 24 cells, without its foot.
        const N: u32 = 24;
        let n = f64::from(N);
        let place = |side: u32, i: u32, j: u32| -> Vec3 {
            let (a, b) = (f64::from(i), f64::from(j));
            match side {
                0 => [a, b, n],
                1 => [a, 0.0, b],
                2 => [a, n, b],
                3 => [0.0, a, b],
                _ => [n, a, b],
            }
        };
        let (mut at, mut known, mut cells) = (Vec::new(), BTreeMap::new(), Vec::new());
        for side in 0..5 {
            let mut number = |i, j| {
                let p = place(side, i, j);
                let key = p.map(|x| x as i64);
                *known.entry(key).or_insert_with(|| {
                    at.push(p);
                    at.len() as u32 - 1
                })
            };
            for i in 0..N {
                for j in 0..N {
                    let corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
                    cells.push(corners.map(|(i, j)| number(i, j)).to_vec());
                }
            }
        }
        let found = thin(&at, &cells, 300, true);
        assert!(found.points.len() <= 300, "{}", found.points.len());
        let kept: Vec<Vec3> = found.points.iter().map(|i| at[*i as usize]).collect();
        for corner in 0..8u32 {
            let c = [0, 1, 2].map(|d| if corner >> d & 1 == 1 { n } else { 0.0 });
            assert!(kept.contains(&c), "the corner {c:?} is lost");
        }
        // What is left of a face lies on the face: its outline has not moved inwards.
        let over = |c: &Vec<u32>| {
            let p = c.iter().map(|i| kept[*i as usize]);
            p.clone().all(|p| p[2] == n)
        };
        let top: f64 = (found.cells.iter().filter(|c| over(c)))
            .map(|c| {
                let p: Vec<Vec3> = c.iter().map(|i| kept[*i as usize]).collect();
                let last = p[p.len() - 1];
                let twice = cross(sub(p[2], p[0]), sub(last, p[1]));
                0.5 * dot(twice, twice).sqrt()
            })
            .sum();
        assert!((top / (n * n) - 1.0).abs() < 0.02, "{top}");
    }
}
