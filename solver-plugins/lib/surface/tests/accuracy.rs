//! Curvature and distance on exact surfaces at ten nodes per wave, regular and jittered, inside and at the rim. The table:
//!
//!     cargo test --release -p plyflow-surface --test accuracy -- --nocapture
//!
//! A surface of radius R has nodes R / 5 apart: so has the crest of a wave a tenth as high as long, with ten nodes.

mod common;

use plyflow_geometry::vec3::{Vec3, add, cross, norm, scale, sub, unit};
use plyflow_surface::{Surface, Topology, curvatures, triangles};
use std::f64::consts::PI;

/// Radius (m) and distance of nodes.
const R: f64 = 0.010;
const H: f64 = R / 5.0;

/// A surface over a grid of `n` x `n` cells of size H about the origin, (u, v) in m, and its principal curvatures (1/m).
struct Exact {
    name: &'static str,
    n: usize,
    place: fn(f64, f64) -> Vec3,
    principal: fn(f64, f64) -> [f64; 2],
}

const SURFACES: [Exact; 7] = [
    Exact {
        name: "plane",
        n: 16,
        place: |u, v| [u, v, 0.3 * u - 0.2 * v],
        principal: |_, _| [0.0; 2],
    },
    Exact {
        name: "sphere",
        n: 10,
        place: |u, v| {
            let ((su, cu), (sv, cv)) = ((u / R).sin_cos(), (v / R).sin_cos());
            [R * su * cv, R * sv, R * cu * cv]
        },
        principal: |_, _| [-1.0 / R; 2],
    },
    Exact {
        name: "cylinder",
        n: 14,
        place: |u, v| [R * (u / R).sin(), v, R * (u / R).cos()],
        principal: |_, _| [-1.0 / R, 0.0],
    },
    Exact {
        name: "torus 3:1",
        n: 14,
        place: |u, v| {
            let ((su, cu), (sv, cv)) = ((u / R).sin_cos(), (v / (3.0 * R)).sin_cos());
            let ring = 3.0 * R + R * su;
            [ring * sv, ring * cv, R * cu]
        },
        principal: |u, _| {
            let s = (u / R).sin();
            // The grid's normal points inward.
            [1.0 / R, s / (3.0 * R + R * s)]
        },
    },
    Exact {
        name: "saddle",
        n: 8,
        place: |u, v| [u, v, (u * u - v * v) / (2.0 * R)],
        principal: |u, v| {
            let (x, y) = (u / R, v / R);
            let w = 1.0 + x * x + y * y;
            // Mean and Gauss curvature of a graph.
            let mean = ((1.0 + y * y) - (1.0 + x * x)) / (2.0 * R * w.powf(1.5));
            let gauss = -1.0 / (R * R * w * w);
            let root = (mean * mean - gauss).sqrt();
            [mean - root, mean + root]
        },
    },
    Exact {
        name: "wave along the mesh",
        n: 24,
        place: |u, v| wave(0.0, 0.05, u, v),
        principal: |u, v| wave_curvature(0.0, 0.05, u, v),
    },
    Exact {
        name: "wave at 23 deg",
        n: 24,
        place: |u, v| wave(0.4, 0.05, u, v),
        principal: |u, v| wave_curvature(0.4, 0.05, u, v),
    },
];

const LENGTH: f64 = 10.0 * H;

fn wave(angle: f64, height: f64, u: f64, v: f64) -> Vec3 {
    let s = u * angle.cos() + v * angle.sin();
    [u, v, height * LENGTH * (2.0 * PI * s / LENGTH).cos()]
}

fn wave_curvature(angle: f64, height: f64, u: f64, v: f64) -> [f64; 2] {
    let s = u * angle.cos() + v * angle.sin();
    let q = 2.0 * PI / LENGTH;
    let a = height * LENGTH;
    let slope = -a * q * (q * s).sin();
    [
        -a * q * q * (q * s).cos() / (1.0 + slope * slope).powf(1.5),
        0.0,
    ]
}

/// Largest and mean error of the principal curvatures over the peak, inside and at the rim.
fn errors(surface: &Exact, jitter: f64) -> [[f64; 2]; 2] {
    let (flat, cells) = common::grid(surface.n, 0.5 * surface.n as f64 * H, jitter);
    let points: Vec<Vec3> = flat.iter().map(|&[u, v]| (surface.place)(u, v)).collect();
    let topology = Topology::new(points.len(), 4, &cells);
    let exact: Vec<[f64; 2]> = flat
        .iter()
        .map(|&[u, v]| {
            let [a, b] = (surface.principal)(u, v);
            [a.min(b), a.max(b)]
        })
        .collect();
    let peak = exact
        .as_flattened()
        .iter()
        .fold(0.0, |m: f64, k| m.max(k.abs()));
    let peak = if peak > 0.0 { peak } else { 1.0 / R };
    let found = curvatures(&topology, &points);
    [false, true].map(|rim| {
        let at = (0..points.len()).filter(|&i| topology.is_free(i) == rim);
        let errors: Vec<f64> = at
            .map(|i| {
                let (k, e) = (&found[i], exact[i]);
                let [a, b] = [k.max.min(k.min), k.max.max(k.min)];
                (a - e[0]).abs().max((b - e[1]).abs()) / peak
            })
            .collect();
        let most = errors.iter().copied().fold(0.0, f64::max);
        [most, errors.iter().sum::<f64>() / errors.len() as f64]
    })
}

/// Largest errors over the peak: inside of a regular mesh, of a jittered one, and at the rim of either. At a rim across a wave only one
/// side is known: there 36 % is what the one-sided difference of second order (2, -5, 4, -1) makes of ten nodes per wave.
const BOUNDS: [f64; 3] = [0.03, 0.03, 0.36];

#[test]
fn curvature_of_exact_surfaces_at_ten_nodes_per_wave() {
    println!("error of the principal curvatures over their peak, %: largest (mean)");
    println!(
        "{:22}{:>16}{:>16}{:>16}{:>16}",
        "", "regular", "its rim", "jittered", "its rim"
    );
    for surface in &SURFACES {
        let [regular, jittered] = [0.0, 0.25].map(|j| errors(surface, j));
        let show = |[most, mean]: [f64; 2]| format!("{:.1} ({:.1})", 100.0 * most, 100.0 * mean);
        println!(
            "{:22}{:>16}{:>16}{:>16}{:>16}",
            surface.name,
            show(regular[0]),
            show(regular[1]),
            show(jittered[0]),
            show(jittered[1])
        );
        let most = [
            regular[0][0],
            jittered[0][0],
            regular[1][0].max(jittered[1][0]),
        ];
        for (most, bound) in most.into_iter().zip(BOUNDS) {
            assert!(most <= bound, "{}: {most}", surface.name);
        }
    }
}

#[test]
fn distance_from_facets_is_exact() {
    let mut random = common::random();
    for surface in &SURFACES {
        let (flat, cells) = common::grid(surface.n, 0.5 * surface.n as f64 * H, 0.25);
        let points: Vec<Vec3> = flat.iter().map(|&[u, v]| (surface.place)(u, v)).collect();
        let facets = triangles(4, &cells);
        let found = Surface::new(&points, &facets).unwrap();
        for t in &facets {
            let [a, b, c] = t.map(|i| points[i as usize]);
            let normal = unit(cross(sub(b, a), sub(c, a)));
            // Near the middle and not far off: no neighbour is nearer, whichever way the surface bends.
            let middle = scale(add(a, add(b, c)), 1.0 / 3.0);
            let foot = add(middle, scale(sub(a, middle), 0.2 * random()));
            let height = 0.02 * H * random();
            let closest = found.closest(add(foot, scale(normal, height)));
            let error = (closest.signed_distance - height).abs();
            assert!(error < 1e-9 * R, "{}: {error}", surface.name);
            assert!(norm(sub(closest.point, foot)) < 1e-9 * R);
        }
    }
}
