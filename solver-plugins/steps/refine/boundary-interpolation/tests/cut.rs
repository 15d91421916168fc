//! Fine nodes on curved and folded coarse sheets.

use plyflow_boundary_interpolation::{Placed, film_grid};
use plyflow_geometry::vec3::{Vec3, distance};

/// A cylinder of 14 mm that a coarse sheet with lines every 8 mm is bent to, and a cut with nodes every `fine` (m).
struct Bent {
    placed: Placed,
    /// Radius on which nodes of elements of a size lie when these are as long as their arcs (m).
    radius: fn(f64) -> f64,
    each: Vec<[f64; 2]>,
}

fn bent(fine: f64) -> Bent {
    let (size, n) = (0.008, 5);
    let node = |i: usize, j: usize| (j * (n + 1) + i) as u32;
    let each: Vec<[f64; 2]> = (0..=n)
        .flat_map(|j| (0..=n).map(move |i| [size * i as f64, size * j as f64]))
        .collect();
    let flat: Vec<Vec3> = each.iter().map(|[x, y]| [*x, *y, 0.0]).collect();
    let mut cells = Vec::new();
    for (i, j) in (0..n).flat_map(|j| (0..n).map(move |i| (i, j))) {
        cells.extend([
            node(i, j),
            node(i + 1, j),
            node(i + 1, j + 1),
            node(i, j + 1),
        ]);
    }
    let (zone, film) = ([0.008, 0.008, 0.032, 0.032], [0.0, 0.0, 0.04, 0.04]);
    let grid = film_grid(zone, film, 0.0, fine).unwrap();
    let radius = |size: f64| 0.5 * size / (0.5 * size / RADIUS).sin();
    Bent {
        placed: Placed::new(grid, &flat, &cells).unwrap(),
        radius,
        each,
    }
}

const RADIUS: f64 = 0.014;

/// The place (m) of the material at (x, y) in a sheet bent to the cylinder, at a distance from its axis.
fn on_cylinder(r: f64, [x, y]: [f64; 2]) -> Vec3 {
    [r * (x / RADIUS).sin(), y, r * (x / RADIUS).cos()]
}

#[test]
fn fine_nodes_lie_where_elements_as_long_as_their_arcs_have_them() {
    // Coarse nodes lie 0.193 mm outside of the cylinder, fine ones of 2 mm 0.012 mm, of 8 mm where the coarse ones are.
    for (fine, most) in [(0.002, 4.5e-5), (0.004, 4.5e-5), (0.008, 1e-12)] {
        let b = bent(fine);
        let at = |p: &[f64; 2]| on_cylinder((b.radius)(0.008), *p);
        let coarse = b.placed.surface(b.each.iter().map(at).collect());
        let positions = b.placed.positions(&coarse);
        let mut worst = [0.0f64; 2];
        for (p, &i) in positions.iter().zip(&b.placed.driven_nodes) {
            let [x, y, _] = b.placed.points[i as usize];
            let off = distance(*p, on_cylinder((b.radius)(fine), [x, y]));
            // At the coarse nodes nothing is left of the sagitta.
            let between = usize::from((x / 0.008).fract().min(1.0 - (x / 0.008).fract()) > 1e-6);
            worst[between] = worst[between].max(off);
        }
        assert!(worst[0] < 6e-6 && worst[1] < most, "{fine}: {worst:?}");
    }
}

#[test]
fn the_cut_follows_what_is_curved_and_not_the_chords_nor_what_is_folded() {
    // Chords of 8 mm stand back by 0.567 mm, R (1 - cos a) with the angle a = 4 / 14; lifted by R sin2 a cos a / 2 they do by
    // 0.034 mm.
    let b = bent(0.002);
    let placed = &b.placed;
    let coarse = placed.surface(b.each.iter().map(|p| on_cylinder(RADIUS, *p)).collect());
    let positions = placed.positions(&coarse);
    let (low, high) = (positions.iter().map(|p| p[0].hypot(p[2])))
        .fold((f64::INFINITY, 0.0f64), |(l, h), r| (l.min(r), h.max(r)));
    let half = 0.5 * 0.008 / RADIUS;
    let left = RADIUS * (1.0 - half.cos() - 0.5 * half.sin().powi(2) * half.cos());
    assert!(
        left < 3.5e-5 && (high - low - left).abs() < 1e-6,
        "{low} {high} {left}"
    );
    // Lines of the coarse mesh cross the cut at fine nodes here, and lie on the same surface.
    assert!(placed.error(&positions, &coarse) < 1e-12);
    // A sheet that is folded onto itself stays straight.
    let folded = |[x, y]: [f64; 2]| [(x - 0.016).abs(), y, 0.1 * x];
    let coarse = placed.surface(b.each.iter().map(|p| folded(*p)).collect());
    let across = placed.positions(&coarse);
    let straight = across.iter().zip(&placed.driven_nodes).all(|(p, &i)| {
        let [x, y, _] = placed.points[i as usize];
        distance(*p, folded([x, y])) < 1e-12
    });
    assert!(straight, "{across:?}");
}
