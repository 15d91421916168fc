//! Curvature and ridge lines against surfaces that are known.

mod common;

use plyflow_geometry::vec3::{Vec3, cross, distance, dot, norm, sub};
use plyflow_surface::{Bound, Curvature, Topology, curvatures, ridge_line};
use std::f64::consts::PI;

const RADIUS: f64 = 0.01;

fn bound(threshold: f64) -> Bound<'static> {
    Bound {
        threshold,
        margin: &[],
    }
}

fn of(
    n: usize,
    a: f64,
    jitter: f64,
    f: impl Fn(f64, f64) -> f64,
) -> (Topology, Vec<Vec3>, Vec<Curvature>) {
    let (flat, cells) = common::grid(n, a, jitter);
    let points = common::lifted(&flat, f);
    let topology = Topology::new(points.len(), 4, &cells);
    let k = curvatures(&topology, &points);
    (topology, points, k)
}

fn worst(k: &[Curvature], points: &[Vec3], expected: impl Fn(Vec3) -> (f64, f64)) -> f64 {
    k.iter().zip(points).fold(0.0, |w: f64, (k, &p)| {
        let (large, small) = expected(p);
        w.max((k.max - large).abs()).max((k.min - small).abs())
    })
}

#[test]
fn curvature_of_a_sphere_holds_at_inner_rim_and_corner_nodes() {
    let dome = |x: f64, y: f64| (RADIUS * RADIUS - x * x - y * y).sqrt();
    for (jitter, bound) in [(0.0, 0.01), (0.25, 0.015)] {
        let (_, points, k) = of(16, 0.005, jitter, dome);
        let error = worst(&k, &points, |_| (-1.0 / RADIUS, -1.0 / RADIUS)) * RADIUS;
        assert!(error < bound, "jitter {jitter}: {error}");
        assert!(k.iter().all(|k| k.determined));
    }
}

#[test]
fn error_of_curvature_falls_with_the_fourth_power_of_the_mesh_size() {
    let dome = |x: f64, y: f64| (RADIUS * RADIUS - x * x - y * y).sqrt();
    let error = |n: usize| {
        let (t, points, k) = of(n, 0.004, 0.0, dome);
        let inner: Vec<usize> = (0..points.len()).filter(|&i| !t.is_free(i)).collect();
        inner
            .iter()
            .map(|&i| (k[i].max * RADIUS + 1.0).abs())
            .fold(0.0, f64::max)
    };
    let order = (error(8) / error(16)).log2();
    assert!((3.5..4.5).contains(&order), "order {order}");
    assert!(error(16) < 1e-4);
}

#[test]
fn cylinder_has_one_curvature_and_its_axis_as_other_direction() {
    // Axis at 30 degrees to x.
    let axis = [(PI / 6.0).cos(), (PI / 6.0).sin(), 0.0];
    let arch = move |x: f64, y: f64| {
        let across = -axis[1] * x + axis[0] * y;
        (RADIUS * RADIUS - across * across).sqrt()
    };
    for (jitter, bound) in [(0.0, 0.005), (0.2, 0.007)] {
        let (_, points, k) = of(20, 0.005, jitter, arch);
        let error = worst(&k, &points, |_| (-1.0 / RADIUS, 0.0)) * RADIUS;
        assert!(error < bound, "jitter {jitter}: {error}");
        for k in &k {
            assert!(dot(k.min_direction, axis).abs() > 0.995, "{k:?}");
            assert!(dot(k.max_direction, k.normal).abs() < 1e-9);
        }
    }
}

#[test]
fn saddle_has_curvatures_of_both_signs() {
    let (_, points, k) = of(20, 0.001, 0.2, |x, y| 50.0 * (x * x - 0.5 * y * y));
    let middle = (0..points.len())
        .min_by(|&a, &b| {
            let r = |i: usize| points[i][0].hypot(points[i][1]);
            r(a).total_cmp(&r(b))
        })
        .unwrap();
    assert!((k[middle].max - 100.0).abs() < 0.5, "{:?}", k[middle]);
    assert!((k[middle].min + 50.0).abs() < 0.5, "{:?}", k[middle]);
    assert!(k[middle].max_direction[0].abs() > 0.99);
}

#[test]
fn plane_has_none_and_a_single_cell_says_that_it_cannot_tell() {
    let (_, _, k) = of(6, 1.0, 0.3, |x, y| 0.3 * x - 0.2 * y);
    assert!(k.iter().all(|k| k.max.abs() < 1e-9 && k.determined));
    let (_, _, k) = of(1, 1.0, 0.0, |_, _| 0.0);
    assert!(k.iter().all(|k| !k.determined && k.max == 0.0));
}

/// Wrinkle of wave length 20 mm and height 3 mm along a line at `angle` (rad) that fades to nothing at both
/// ends (half length 30 mm).
fn wrinkle(angle: f64) -> impl Fn(f64, f64) -> f64 {
    move |x, y| {
        let (sin, cos) = angle.sin_cos();
        let (along, across) = (cos * x + sin * y, -sin * x + cos * y);
        let fade = if along.abs() < 0.030 {
            (0.5 * PI * along / 0.030).cos()
        } else {
            0.0
        };
        let wave = if across.abs() < 0.010 {
            0.5 * (1.0 + (PI * across / 0.010).cos())
        } else {
            0.0
        };
        0.003 * wave * fade
    }
}

#[test]
fn peak_curvature_of_a_sinusoidal_wrinkle_is_that_of_its_crest() {
    // d2/dy2 of 3 mm / 2 (1 + cos(pi y / 10 mm)) at the crest.
    let expected = 0.0015 * (PI / 0.010).powi(2);
    let (_, _, k) = of(80, 0.04, 0.0, wrinkle(0.0));
    let most = -k[40 * 81 + 40].max;
    assert!((most / expected - 1.0).abs() < 0.03, "{most} {expected}");
}

#[test]
fn ridge_length_does_not_depend_on_the_angle_between_mesh_and_wrinkle() {
    // Crest curvature is 148 cos(pi s / 60 mm) 1/m: above 60 1/m for |s| < 22.0 mm.
    let threshold = 60.0;
    let half = 0.060 / PI * (threshold / (0.0015f64 * (PI / 0.010).powi(2))).acos();
    // Length over the surface of z = 3 mm cos(pi s / 60 mm) between -half and half.
    let steps = 1000;
    let line: Vec<Vec3> = (0..=steps)
        .map(|i| {
            let s = -half + 2.0 * half * i as f64 / steps as f64;
            [s, 0.0, 0.003 * (PI * s / 0.060).cos()]
        })
        .collect();
    let expected: f64 = line.windows(2).map(|w| distance(w[0], w[1])).sum();
    for degrees in [0.0, 10.0, 22.5, 30.0, 45.0, 63.0, 90.0] {
        for jitter in [0.0, 0.2] {
            let (t, points, k) = of(80, 0.04, jitter, wrinkle(f64::to_radians(degrees)));
            let chosen: Vec<bool> = k.iter().map(|k| k.max < -threshold).collect();
            let regions = t.node_components(&chosen);
            let region = regions.iter().max_by_key(|r| r.len()).unwrap();
            let ridge = ridge_line(&t, &points, &k, region, bound(threshold)).unwrap();
            let error = (ridge.length / expected - 1.0).abs();
            assert!(
                error < 0.05,
                "{degrees} {jitter}: {} {expected}",
                ridge.length
            );
            for p in &ridge.points {
                let across =
                    -p[0] * f64::to_radians(degrees).sin() + p[1] * f64::to_radians(degrees).cos();
                assert!(across.abs() < 0.0012, "{degrees} {jitter}: {across}");
            }
        }
    }
}

#[test]
fn ridge_of_a_wavy_crest_follows_its_curve() {
    // The crest line swings by 6 mm over 60 mm.
    let crest = |s: f64| 0.006 * (PI * s / 0.030).sin();
    let (t, points, k) = of(80, 0.04, 0.0, move |x, y| {
        let across: f64 = y - crest(x);
        if across.abs() < 0.010 {
            0.0015 * (1.0 + (PI * across / 0.010).cos())
        } else {
            0.0
        }
    });
    let chosen: Vec<bool> = k
        .iter()
        .enumerate()
        .map(|(i, k)| k.max < -80.0 && points[i][0].abs() < 0.0305)
        .collect();
    let regions = t.node_components(&chosen);
    let region = regions.iter().max_by_key(|r| r.len()).unwrap();
    let ridge = ridge_line(&t, &points, &k, region, bound(80.0)).unwrap();
    let expected: f64 = (-300..300)
        .map(|i| {
            let (a, b) = (i as f64 * 1e-4, (i + 1) as f64 * 1e-4);
            1e-4f64.hypot(crest(b) - crest(a))
        })
        .sum();
    assert!(
        (ridge.length / expected - 1.0).abs() < 0.04,
        "{} {expected}",
        ridge.length
    );
}

#[test]
fn a_crest_as_narrow_as_the_mesh_is_one() {
    // Across a fold that a run in 4 mm shells gave at the edge of a spar (y, z in mm): a wall, nearly upright, then a shallow flank. The turn
    // at the crest grows from 75 degrees as the fold is lifted off the edge.
    let flank = [[-70.0, 83.0], [-68.3, 91.0], [-66.6, 99.0], [-65.2, 103.0]];
    let top = [
        [-60.0, 109.2],
        [-56.0, 109.4],
        [-52.0, 110.5],
        [-48.0, 110.7],
    ];
    let crests = [
        [-64.3, 107.0],
        [-64.1, 108.0],
        [-64.0, 109.0],
        [-63.9, 110.0],
        [-63.8, 111.0],
        [-63.7, 112.0],
        [-63.6, 113.0],
    ];
    let lines: Vec<Vec<[f64; 2]>> = crests
        .iter()
        .map(|c| [&flank[..], &[*c], &top[..]].concat())
        .collect();
    let (rows, across) = (lines.len(), lines[0].len());
    let points: Vec<[f64; 3]> = (0..rows)
        .flat_map(|i| {
            lines[i]
                .iter()
                .map(move |[y, z]| [4e-3 * i as f64, 1e-3 * y, 1e-3 * z])
        })
        .collect();
    let node = |i: usize, j: usize| (i * across + j) as u32;
    let cells: Vec<u32> = (0..rows - 1)
        .flat_map(|i| (0..across - 1).map(move |j| (i, j)))
        .flat_map(|(i, j)| {
            [
                node(i, j),
                node(i + 1, j),
                node(i + 1, j + 1),
                node(i, j + 1),
            ]
        })
        .collect();
    let topology = Topology::new(points.len(), 4, &cells);
    let k = curvatures(&topology, &points);
    for i in 1..rows - 1 {
        // The circle through a crest and the nodes beside it (Menger).
        let [a, b, c] = [3, 4, 5].map(|j| points[node(i, j) as usize]);
        let sides = [distance(a, b), distance(b, c), distance(c, a)];
        let area = 0.5 * norm(cross(sub(b, a), sub(c, a)));
        let circle = 4.0 * area / sides.iter().product::<f64>();
        let found = &k[node(i, 4) as usize];
        assert!(
            found.max < -circle && found.max > -4.0 * circle,
            "{i}: {} for {circle}",
            found.max
        );
        assert!(
            found.min_direction[0].abs() > 0.95,
            "{i}: {:?}",
            found.min_direction
        );
    }
}
