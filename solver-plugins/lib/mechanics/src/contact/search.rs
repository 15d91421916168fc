//! The closest point of a sheet: from where a slave was over the cells around it.

use super::blend::shares;
use super::closest::{Closest, FACES, Found, RIM, Surface, closest, middle};
use super::slave::SlaveItem;
use crate::mesh::NONE;
use crate::mirror::{Image, mirrored_in, reflect};
use crate::vec3::{Vec3, dot, sub};

/// The edge over which a walk enters the cell `to`.
fn entry(neighbours: &[[u32; 4]], from: u32, to: u32) -> usize {
    let edge = neighbours[to as usize].iter().position(|n| *n == from);
    edge.unwrap_or(3)
}

/// Whether a cell comes nearer to `p` from its side `edge` inwards: from the place on the side, which is straight, that is closest to
/// `p`. Where it does not, that place is the cell's closest (of a flat cell, whose distance from a point is convex).
#[inline(always)]
fn leads_into(s: &Surface<'_>, cell: u32, edge: usize, p: Vec3) -> bool {
    // The side from its southern or western end on, what is opposite to both ends, and the sides of the cell at these.
    const ENDS: [[usize; 6]; 4] = [
        [0, 1, 3, 2, 3, 1],
        [1, 2, 0, 3, 0, 2],
        [3, 2, 0, 1, 3, 1],
        [0, 3, 1, 2, 0, 2],
    ];
    let [a, b, over_a, over_b, low, high] = ENDS[edge];
    let nodes = s.cells[cell as usize];
    let [a, b, over_a, over_b] = [a, b, over_a, over_b].map(|k| s.x[nodes[k] as usize]);
    let near = s.neighbours[cell as usize];
    let past = |side: usize| if near[side] == NONE { 0.5 * RIM } else { 0.0 };
    let (along, to) = (sub(b, a), sub(p, a));
    let t = (dot(to, along) / dot(along, along)).clamp(-past(low), 1.0 + past(high));
    let [inwards_a, inwards_b] = [sub(over_a, a), sub(over_b, b)];
    let inwards: Vec3 = std::array::from_fn(|c| inwards_a[c] + t * (inwards_b[c] - inwards_a[c]));
    let arm: Vec3 = std::array::from_fn(|c| to[c] - t * along[c]);
    dot(arm, inwards) > 0.0
}

/// Closest point to `p` of the mirror image of a cell: the image of the closest point to the image of `p`.
#[inline(never)]
fn across(s: &Surface<'_>, cell: u32, start: [f64; 2], p: Vec3, image: Image) -> Closest {
    let other = closest(s, cell, start, reflect(p, image), 3);
    Closest {
        arm: reflect(other.arm, image),
        image,
        ..other
    }
}

/// Closest point of the cell across a corner: the neighbour of both cells (or images) `a` and `b` next to `first`.
#[inline(never)]
fn around(
    s: &Surface<'_>,
    first: &Closest,
    [a, b]: [&Closest; 2],
    p: Vec3,
    open: impl Fn(u32) -> bool,
) -> Option<Closest> {
    let real = |c: &Closest| c.image == [false; 2];
    let image = [a.image[0] != b.image[0], a.image[1] != b.image[1]];
    let found = match (real(a), real(b)) {
        (true, true) => {
            let near = s.neighbours[b.cell as usize];
            let of_both = |c: &u32| {
                let none = *c == NONE || *c == first.cell || mirrored_in(*c).is_some();
                !none && near.contains(c)
            };
            let cell = s.neighbours[a.cell as usize].into_iter().find(of_both)?;
            if !open(cell) {
                return None;
            }
            let start = middle(entry(s.neighbours, a.cell, cell));
            closest(s, cell, start, p, 3)
        }
        // Images of the cell next to the one that lies at the plane, or of that itself across both.
        (false, true) => across(s, b.cell, b.xi, p, image),
        (true, false) => across(s, a.cell, a.xi, p, image),
        (false, false) => across(s, first.cell, first.xi, p, image),
    };
    Some(found).filter(|c| c.free == [true; 2])
}

/// Closest point of the cell across a corner, where of the two cells next to `first` only `a` is hollow towards it: the surface folds away across
/// the side `edge`. At the foot of a block's corner a slave touches the ground and both walls, and these meet at the corner alone, or across
/// a ridge. Each of them is the closest in turn, and if it did not know of the other the slave would run to and fro between them.
#[inline(never)]
fn past_a_ridge(
    s: &Surface<'_>,
    first: &Closest,
    a: &Closest,
    edge: usize,
    p: Vec3,
    open: impl Fn(u32) -> bool,
) -> Option<Closest> {
    let next = s.neighbours[first.cell as usize][edge];
    // Of the cell across the side no more is needed than which it is.
    let b = match mirrored_in(next) {
        Some(plane) => Closest {
            image: [plane == 0, plane == 1],
            xi: middle(edge),
            ..*first
        },
        None if next == NONE => return None,
        None => Closest {
            cell: next,
            image: [false; 2],
            ..*first
        },
    };
    around(s, first, [a, &b], p, open)
}

/// The closest point of the surface near where the slave was: of its cell, and of the cells across those
/// sides that the point lies on, and (every eighth step) of those so near that a concave fold could make the
/// neighbour closer. The walk enters only cells that are `open` to it.
/// Long, as it is one walk over cells, inlined into every contact: each part goes on with the cells and sides that the one before has found.
#[inline(always)]
pub(super) fn track(
    s: &Surface<'_>,
    item: &SlaveItem,
    p: Vec3,
    offset: f64,
    iterations: u32,
    open: impl Fn(u32) -> bool,
) -> Found {
    let mut best = closest(s, item.cell, item.xi, p, iterations);
    let mut others = [None; FACES];
    let every = |n: u8| item.is_between() || item.turn.is_multiple_of(n) || !item.active;
    let careful = every(8);
    // A neighbour that is folded back over the slave (by more than a right angle) is as near as the slave's own
    // cell from further off its side. Found too late, it would stand deep inside from one step to the next.
    let reach = if every(16) { 4.0 } else { 1.0 };
    // By coordinate, the side that the place is near.
    let mut sides = [None; 2];
    for _ in 0..12 {
        let near = s.neighbours[best.cell as usize];
        let band = 1.0 - (reach * best.distance2.sqrt() / best.half).min(0.5);
        let here = best;
        others = [None; FACES];
        sides = [None; 2];
        for k in 0..2 {
            let place = here.xi[k];
            if place.abs() < band || (place.abs() < 1.0 && !careful) {
                continue;
            }
            // Sides 0: eta = -1, 1: xi = 1, 2: eta = 1, 3: xi = -1.
            let edge = match (k, place > 0.0) {
                (0, true) => 1,
                (0, false) => 3,
                (_, true) => 2,
                (_, false) => 0,
            };
            sides[k] = Some(edge);
            if let Some(plane) = mirrored_in(near[edge]) {
                // Across the plane the surface goes on as its own image, which is never closer.
                let image = [plane == 0, plane == 1];
                let other = across(s, here.cell, middle(edge), p, image);
                others[k] = Some(other).filter(|c| c.free[k]);
            } else if near[edge] != NONE && open(near[edge]) {
                let start = entry(s.neighbours, here.cell, near[edge]);
                // On a surface that does not fold towards the slave, which is most of all, the common side decides.
                if !leads_into(s, near[edge], start, p) {
                    continue;
                }
                let mut other = closest(s, near[edge], middle(start), p, 3);
                if other.distance2 < best.distance2 {
                    std::mem::swap(&mut best, &mut other);
                }
                // Edges 0 and 2 are held in eta, 1 and 3 in xi.
                others[k] = Some(other).filter(|c| c.free[1 - start % 2]);
            }
        }
        if best.cell == here.cell {
            break;
        }
    }
    // Only where the ways to both cells are perpendicular across their common side does the surface fold towards the slave;
    // along it they may end on a ridge, as on a saddle.
    for k in 0..2 {
        others[k] = others[k].filter(|_| best.free[k]);
    }
    others[2] = match (&others, sides) {
        ([Some(a), Some(b), _], _) => around(s, &best, [a, b], p, open),
        ([Some(a), None, _], [_, Some(edge)]) | ([None, Some(a), _], [Some(edge), _]) => {
            past_a_ridge(s, &best, a, edge, p, open)
        }
        _ => None,
    };
    let beside = [Some(&best), others[0].as_ref(), others[1].as_ref()];
    let reaches = |c: &Closest| {
        beside
            .into_iter()
            .flatten()
            .any(|b| shares(&best, b, c, offset))
    };
    others[2] = others[2].filter(reaches);
    // Beside a cell across the corner the others count for what the two share, also where they have no share themselves.
    if others[2].is_none() {
        for other in &mut others[..2] {
            *other = other.filter(|c| shares(&best, &best, c, offset));
        }
    }
    Found {
        first: best,
        others,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vec3::{add, norm, scale};

    /// Two skew cells that meet at a fold, and slaves around it: against the neighbour's nearest place of many.
    #[test]
    fn a_neighbour_is_left_out_only_where_its_nearest_place_is_on_the_common_side() {
        let mut left_out = 0;
        for k in 0..600u32 {
            // Spread evenly: parts of multiples of irrational numbers, -1 to 1.
            let r = |m: u32| 2.0 * (f64::from(k) * f64::from(m).sqrt()).fract() - 1.0;
            let (fold, skew) = (2.6 * r(2), 0.4 * r(3));
            // The first cell lies in x < 0, the second is turned about the side x = 0 by the fold.
            let (c, s) = (fold.cos(), fold.sin());
            let x: Vec<Vec3> = vec![
                [-1.0, skew, 0.0],
                [0.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [-1.0, 1.0 + skew, 0.0],
                [c, -skew, s],
                [c, 1.0 - skew, s],
            ];
            // The neighbour's corners begin at each of its own in turn, so that every side is the common one.
            let around = [1, 4, 5, 2];
            let turn = (k % 4) as usize;
            let cell: [u32; 4] = std::array::from_fn(|i| around[(i + turn) % 4]);
            // The side from the first cell is the last of `around`.
            let edge = (3 + 4 - turn) % 4;
            let far = 7;
            let surface = Surface {
                cells: &[[0, 1, 2, 3], cell],
                neighbours: &[[far; 4]; 2],
                x: &x,
                normals: &[],
            };
            let p = [0.5 * r(5) - 0.3, 0.5 + 0.8 * r(7), 0.4 * r(11)];
            let place = |u: f64, t: f64| -> Vec3 {
                let low = add(scale(x[1], 1.0 - u), scale(x[4], u));
                let high = add(scale(x[2], 1.0 - u), scale(x[5], u));
                add(scale(low, 1.0 - t), scale(high, t))
            };
            let parts = 0..=100;
            let nearest = |inwards: f64| {
                let along = parts.clone().map(|t| place(inwards, f64::from(t) / 100.0));
                along.fold(f64::INFINITY, |m, at| m.min(norm(sub(p, at))))
            };
            let on_side = nearest(0.0);
            let inside = (parts.clone().map(|u| nearest(f64::from(u) / 100.0)))
                .fold(f64::INFINITY, f64::min);
            if !leads_into(&surface, 1, edge, p) {
                left_out += 1;
                // The place on the side is exact, those that it is held against are not.
                assert!(inside > on_side - 1e-9, "{k}: {inside} {on_side}");
            }
        }
        assert!((150..450).contains(&left_out), "{left_out}");
    }
}
