//! The net on a sphere against the Chebyshev net with great circles as generators, solved here on its own.

use plyflow_forming_kinematic::drop_on;
use plyflow_forming_kinematic::net::{Fabric, Generators, Net};
use plyflow_forming_kinematic::surface::{DrapeSurface, SmoothSurface};
use plyflow_geometry::vec3::{Vec3, norm, scale};
use plyflow_model::scene::{HemisphereTool, Tool};
use plyflow_model::units::Length;
use plyflow_tooling::ToolMesh;
use std::convert::Infallible;
use std::f64::consts::FRAC_PI_2;

/// Angle between the families on the bias meridian at every polar angle in `polar` (rad).
///
/// On a unit sphere the angle w of a net with sides du, dv satisfies w_uv = -sin w (the Gauss equation of the metric
/// du2 + 2 cos w du dv + dv2); with great circles through the pole at right angles as generators
/// w(u, 0) = w(0, v) = pi / 2. Scaling u up and v down changes nothing, so w = F(u v) with
/// z F'' + F' = -sin F, F(0) = pi / 2. On the bias meridian u = v = s, where the arc from the pole grows by
/// 2 cos(w / 2) ds. With G(s) = F(s2): G'' + G' / s = -4 sin G. Fourth-order Runge-Kutta from the series at 0.
fn analytic_shear(polar: &[f64]) -> Vec<f64> {
    let step = 1e-5;
    let slope =
        |s: f64, y: [f64; 3]| [y[1], -4.0 * y[0].sin() - y[1] / s, 2.0 * (0.5 * y[0]).cos()];
    // G = pi/2 - s2 + O(s6); the arc is sqrt(2) s + O(s3).
    let mut s = step;
    let mut y = [FRAC_PI_2 - s * s, -2.0 * s, 2f64.sqrt() * s];
    let mut found = Vec::new();
    for &target in polar {
        loop {
            let at = |y: [f64; 3], k: [f64; 3], h: f64| [0, 1, 2].map(|i| y[i] + h * k[i]);
            let k1 = slope(s, y);
            let k2 = slope(s + 0.5 * step, at(y, k1, 0.5 * step));
            let k3 = slope(s + 0.5 * step, at(y, k2, 0.5 * step));
            let k4 = slope(s + step, at(y, k3, step));
            let next =
                [0, 1, 2].map(|i| y[i] + step / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
            if next[2] >= target {
                let part = (target - y[2]) / (next[2] - y[2]);
                found.push(FRAC_PI_2 - (y[0] + part * (next[0] - y[0])));
                break;
            }
            s += step;
            y = next;
        }
    }
    found
}

/// A radius (m), and half of the side of a blank that reaches a little beyond 60 degrees on the bias.
const R: f64 = 0.05;
const HALF: f64 = 1.15 * R;
/// So small that the generator's chord tolerance leaves its facets as coarse as they are asked for.
const R_SMALL: f64 = 1e-3;

const POLAR: [f64; 3] = [20.0, 40.0, 60.0];

#[test]
fn analytic_net_gives_the_published_shear_angles() {
    let found = analytic_shear(&POLAR.map(f64::to_radians));
    for (g, published) in found.iter().zip([3.422, 12.961, 26.946]) {
        assert!(
            (g.to_degrees() - published).abs() < 6e-4,
            "{} {published}",
            g.to_degrees()
        );
    }
}

struct Sphere(f64);

impl DrapeSurface for Sphere {
    fn level(&self, p: Vec3, offset: f64) -> Option<(f64, Vec3)> {
        let r = norm(p);
        Some((r - self.0 - offset, scale(p, 1.0 / r)))
    }
}

/// Draped over the whole of `blank` (half side) from the pole.
fn drape(
    surface: &dyn DrapeSurface,
    pole: Vec3,
    spacing: f64,
    half: f64,
    offset: f64,
    turn: f64,
) -> Net {
    let fabric = Fabric {
        directions: [turn, turn + FRAC_PI_2],
        blank: [-half, -half, half, half],
        start: [0.0; 2],
        spacing,
        locking: 80f64.to_radians(),
        bed: 0.0,
        generators: Generators::Geodesic,
        offset,
    };
    let mut net = Net::new(fabric).expect("a small net");
    let Ok(()) = net.drape(surface, pole, [0.0, 0.0, 1.0], |_| Ok::<(), Infallible>(()));
    net
}

/// Shear angle on the bias meridian in the quadrant (`a`, `b`) at the polar angles: cubic between the cells' centres,
/// so that only the net's own error shows.
fn on_bias(net: &Net, a: i32, b: i32) -> Vec<f64> {
    let mut along = Vec::new();
    for k in 0.. {
        let cell = [
            if a > 0 { k } else { -k - 1 },
            if b > 0 { k } else { -k - 1 },
        ];
        let Some(shear) = net.shear(cell) else { break };
        let x = plyflow_forming_kinematic::net::corners(cell).map(|c| net.position(c).unwrap());
        let middle = [0, 1, 2].map(|d| x.iter().map(|p| p[d]).sum::<f64>());
        along.push((middle[0].hypot(middle[1]).atan2(middle[2]), shear));
    }
    POLAR
        .map(|degrees| {
            let at = degrees.to_radians();
            let k = along.partition_point(|p| p.0 < at);
            let four = &along[k - 2..k + 2];
            let weight = |i: usize| {
                (0..4)
                    .filter(|j| *j != i)
                    .map(|j| (at - four[j].0) / (four[i].0 - four[j].0))
                    .product::<f64>()
            };
            (0..4).map(|i| weight(i) * four[i].1).sum()
        })
        .to_vec()
}

fn worst(found: &[f64], sign: f64) -> f64 {
    let expected = analytic_shear(&POLAR.map(f64::to_radians));
    found
        .iter()
        .zip(&expected)
        .map(|(f, e)| (f - sign * e).abs().to_degrees())
        .fold(0.0, f64::max)
}

fn hemisphere(radius: f64, facet: f64) -> ToolMesh {
    let tool = Tool::Hemisphere(HemisphereTool {
        radius: Length(radius),
        facet_size: Length(facet),
    });
    plyflow_tooling::build(&tool).expect("a hemisphere")
}

#[test]
fn shear_on_an_exact_sphere_converges_with_second_order_in_the_spacing() {
    let error = |n: f64| {
        let net = drape(&Sphere(R), [0.0, 0.0, R], R / n, HALF, 0.0, 0.0);
        worst(&on_bias(&net, 1, 1), 1.0)
    };
    let errors = [20.0, 40.0, 80.0, 160.0].map(error);
    println!("error (deg): {errors:?}");
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((order - 2.0).abs() < 0.05, "order {order}");
    }
    assert!(errors[3] < 3e-4, "{errors:?}");
}

#[test]
fn shear_has_its_sign_in_every_quadrant_and_nodes_stand_at_the_offset() {
    for offset in [0.0, 1.5e-3] {
        let r = R + offset;
        let net = drape(&Sphere(R), [0.0, 0.0, r], r / 40.0, 1.15 * r, offset, 0.0);
        for (a, b) in [(1, 1), (-1, -1), (1, -1), (-1, 1)] {
            let error = worst(&on_bias(&net, a, b), f64::from(a * b));
            assert!(error < 5e-3, "quadrant {a} {b}: {error} deg");
        }
        for (at, _) in net.nodes() {
            let Some(x) = net.position(at) else { continue };
            assert!((norm(x) / r - 1.0).abs() < 1e-12);
        }
    }
}

/// Longest edge over the radius, and the largest difference (deg) to the net on the exact sphere with the same spacing: what
/// the facets alone do. The fibres run at 20 degrees to the facets' axes.
fn facet_error(facet: f64, crease: f64, offset: f64) -> (f64, f64) {
    let mesh = hemisphere(R_SMALL, facet * R_SMALL);
    let surface = SmoothSurface::new(&mesh, crease).expect("facets");
    let (z, face) = surface.top(0.0, 0.0).expect("a pole");
    let (pole, _) = drop_on(&surface, [0.0, 0.0, z], face, offset, R_SMALL).expect("a pole");
    let r = R_SMALL + offset;
    let turn = 20f64.to_radians();
    let round = drape(
        &Sphere(R_SMALL),
        [0.0, 0.0, r],
        r / 80.0,
        1.0 * r,
        offset,
        turn,
    );
    let net = drape(&surface, pole, r / 80.0, 1.0 * r, offset, turn);
    let pairs = on_bias(&net, 1, 1).into_iter().zip(on_bias(&round, 1, 1));
    let error = pairs
        .map(|(a, b)| (a - b).abs().to_degrees())
        .fold(0.0, f64::max);
    (mesh.longest_edge() / R_SMALL, error)
}

#[test]
fn shear_on_facets_converges_with_their_size_and_keeps_its_order_on_the_offset_surface() {
    for offset in [0.0, 0.03 * R_SMALL] {
        let found = [0.4, 0.2, 0.1].map(|facet| facet_error(facet, 0.6, offset));
        println!("offset {offset}: edge / R, error (deg): {found:?}");
        let ((coarse, before), (fine, after)) = (found[0], found[2]);
        let order = (before / after).ln() / (coarse / fine).ln();
        assert!(order > 3.5, "order {order}: {found:?}");
        assert!(found[1].1 < 4e-3 && found[2].1 < 4e-4, "{found:?}");
    }
}

#[test]
fn bare_facets_are_worse_by_far_than_smoothed_ones() {
    // No angle is smooth enough: every edge is a crease.
    let (_, bare) = facet_error(0.1, 0.0, 0.0);
    let (_, smooth) = facet_error(0.1, 0.6, 0.0);
    println!("bare {bare} deg, smoothed {smooth} deg");
    assert!(bare > 100.0 * smooth, "bare {bare}, smoothed {smooth}");
}
