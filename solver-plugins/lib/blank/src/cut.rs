//! Blanks cut at mirror planes.

use plyflow_model::outline::{APART, Point, Region, sides};

/// The part of a region on the positive side of plane `k`. Contours that the plane cuts become chains from the plane to
/// the plane; sides along it join them, and they are the only ones on it.
pub(crate) fn positive(region: &Region, k: usize) -> Region {
    let mut chains: Vec<Vec<Point>> = Vec::new();
    let mut closed: Vec<Vec<Point>> = Vec::new();
    for contour in region.contours() {
        let snapped: Vec<Point> = contour.iter().map(|p| snap(*p, k)).collect();
        if snapped.iter().all(|p| p[k] > 0.0) {
            closed.push(snapped);
        } else {
            chains.extend(positive_chains(&snapped, k));
        }
    }
    let mut contours = join(chains, k);
    // A hole stays one; of an outline that the plane does not cut there is nothing else than itself.
    contours.append(&mut closed);
    let largest = |c: &Vec<Point>| {
        let low = c.iter().map(|p| p[1 - k]).fold(f64::INFINITY, f64::min);
        let high = c.iter().map(|p| p[1 - k]).fold(f64::NEG_INFINITY, f64::max);
        high - low
    };
    let outer = (0..contours.len())
        .max_by(|a, b| largest(&contours[*a]).total_cmp(&largest(&contours[*b])))
        .unwrap_or(0);
    let outline = contours.swap_remove(outer);
    Region {
        outline,
        holes: contours,
    }
}

/// A corner that lies on the plane but for rounding.
fn snap(mut p: Point, k: usize) -> Point {
    if p[k].abs() < APART {
        p[k] = 0.0;
    }
    p
}

/// The runs of a contour strictly on the positive side, each with the points where it leaves and meets the plane.
fn positive_chains(contour: &[Point], k: usize) -> Vec<Vec<Point>> {
    let Some(start) = contour.iter().position(|p| p[k] <= 0.0) else {
        return Vec::new();
    };
    let mut turned = contour.to_vec();
    turned.rotate_left(start);
    let mut chains = Vec::new();
    let mut chain: Vec<Point> = Vec::new();
    for (a, b) in sides(&turned) {
        let meets = || {
            let t = a[k] / (a[k] - b[k]);
            let mut p = [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
            p[k] = 0.0;
            p
        };
        match (a[k] > 0.0, b[k] > 0.0) {
            (false, true) => chain = vec![meets(), b],
            (true, true) => chain.push(b),
            (true, false) => {
                chain.push(meets());
                chains.push(std::mem::take(&mut chain));
            }
            (false, false) => {}
        }
    }
    chains
}

/// Joins chains along the plane. With the material on the left, a contour goes on downwards along x = 0 and to the right
/// along y = 0 until the next chain begins.
fn join(mut chains: Vec<Vec<Point>>, k: usize) -> Vec<Vec<Point>> {
    let along = |p: &Point| if k == 0 { -p[1] } else { p[0] };
    let mut contours = Vec::new();
    while let Some(mut contour) = chains.pop() {
        loop {
            let end = contour.last().map_or(0.0, along);
            let ahead = |c: &Vec<Point>| along(&c[0]) - end;
            let own = ahead(&contour);
            let next = (0..chains.len())
                .filter(|i| ahead(&chains[*i]) >= 0.0)
                .min_by(|a, b| ahead(&chains[*a]).total_cmp(&ahead(&chains[*b])));
            match next {
                Some(i) if own < 0.0 || ahead(&chains[i]) < own => {
                    contour.append(&mut chains.remove(i));
                }
                _ => break,
            }
        }
        contours.push(contour);
    }
    contours
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blank::Blank;
    use plyflow_mechanics::mirror::Planes;
    use plyflow_model::outline::signed_area;
    use std::f64::consts::TAU;

    const X: Planes = Planes([true, false]);
    const BOTH: Planes = Planes([true; 2]);

    fn circle(x: f64, y: f64, r: f64) -> Vec<Point> {
        let at = |k: usize| {
            let (s, c) = (TAU * k as f64 / 360.0).sin_cos();
            [x + r * c, y + r * s]
        };
        (0..360).map(at).collect()
    }

    fn region(outline: Vec<Point>, holes: Vec<Vec<Point>>) -> Blank {
        Blank::Region(Region::new(outline, holes).unwrap())
    }

    fn area(blank: &Blank) -> f64 {
        let Blank::Region(r) = blank else {
            panic!("a region")
        };
        // It is one that its own checks accept, turned the right way already.
        let again = Region::new(r.outline.clone(), r.holes.clone()).unwrap();
        assert_eq!(&again, r);
        r.area()
    }

    #[test]
    fn halves_and_quarters_have_their_share_of_the_area() {
        // A disc with a hole in its middle, holes beside it, and holes across each plane.
        let holes = vec![
            circle(0.0, 0.0, 0.01),
            circle(0.03, 0.03, 0.004),
            circle(-0.03, 0.03, 0.004),
            circle(0.03, -0.03, 0.004),
            circle(-0.03, -0.03, 0.004),
            circle(0.0, 0.03, 0.004),
            circle(0.0, -0.03, 0.004),
        ];
        let disc = region(circle(0.0, 0.0, 0.06), holes);
        let whole = area(&disc);
        let half = disc.part(X);
        assert!((2.0 * area(&half) / whole - 1.0).abs() < 1e-12);
        assert_eq!(half.holes().len(), 2);
        assert!(half.holes().iter().all(|h| signed_area(h) < 0.0));
        let quarter = disc.part(BOTH);
        assert!((4.0 * area(&quarter) / whole - 1.0).abs() < 1e-12);
        assert_eq!(quarter.holes().len(), 1);
        for p in quarter.outline() {
            assert!(p[0] >= 0.0 && p[1] >= 0.0, "{p:?}");
        }
    }

    #[test]
    fn a_concave_outline_is_cut_into_one_part() {
        // An H on its side: two bars across x = 0, joined beside it by bars along y.
        let outer = vec![[-0.05, -0.04], [0.05, -0.04], [0.05, 0.04], [-0.05, 0.04]];
        let gap = vec![[-0.02, -0.02], [0.02, -0.02], [0.02, 0.02], [-0.02, 0.02]];
        let frame = region(outer, vec![gap]);
        let half = frame.part(X);
        assert!((area(&half) - 0.5 * (0.1 * 0.08 - 0.04 * 0.04)).abs() < 1e-15);
        assert_eq!((half.outline().len(), half.holes().len()), (8, 0));
        let Blank::Rectangle(b) = Blank::Rectangle([-0.05, -0.04, 0.05, 0.04]).part(BOTH) else {
            panic!("a rectangle")
        };
        assert_eq!(b, [0.0, 0.0, 0.05, 0.04]);
    }

    #[test]
    fn nodes_of_the_cut_lie_on_the_plane() {
        let half = region(circle(0.0, 0.0, 0.06), Vec::new()).part(BOTH);
        let (mesh, quality) = half.mesh(0.006).unwrap();
        assert!(quality.unwrap().least_scaled_jacobian > 0.5);
        for k in 0..2 {
            let on = mesh.points.iter().filter(|p| p[k] == 0.0).count();
            let near = mesh.points.iter().filter(|p| p[k] < 1e-4).count();
            assert!(on >= 9 && on == near, "{on} {near}");
        }
    }
}
