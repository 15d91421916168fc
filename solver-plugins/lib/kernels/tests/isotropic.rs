//! The isotropic plate through its C table: gradients, closed forms, bounds.

mod common;
mod s4_support;
use common::*;
use s4_support::{isotropic, plate};

const Y: f64 = 2.1e9;
const NU: f64 = 0.3;
const H: f64 = 1e-3;

fn metric(r: &mut Random, strain: f64) -> [f64; 3] {
    let f: [[f64; 2]; 2] = std::array::from_fn(|i| {
        std::array::from_fn(|j| if i == j { 1.0 } else { 0.0 } + strain * r.next())
    });
    let c = |i: usize, j: usize| f[0][i] * f[0][j] + f[1][i] * f[1][j];
    [c(0, 0), c(1, 1), c(0, 1)]
}

#[test]
fn stress_and_moments_are_the_gradients_of_their_energies() {
    let mut r = Random(61);
    let m = plate(Y, NU, H);
    for _ in 0..50 {
        let c = metric(&mut r, 0.2);
        let p = Point::new(&m);
        let a = p.peek(&m, c);
        let k = [30.0 * r.next(), 30.0 * r.next(), 30.0 * r.next()];
        let b = bend(&m, c, k);
        for i in 0..3 {
            let (h, step) = (1e-5, 1e-3);
            let w = |f: f64| {
                let mut x = c;
                x[i] += f * h;
                p.peek(&m, x).energy
            };
            // dW = S11 dC11 / 2 + S22 dC22 / 2 + S12 dC12.
            let d = (w(1.0) - w(-1.0)) / (2.0 * h) * if i < 2 { 2.0 } else { 1.0 };
            let scale = a.stress.iter().fold(0.0f64, |m, x| m.max(x.abs()));
            assert!(
                (d - a.stress[i]).abs() < 1e-7 * scale,
                "{d}, {:?}",
                a.stress
            );
            let u = |f: f64| {
                let mut x = k;
                x[i] += f * step;
                bend(&m, c, x).energy
            };
            let d = (u(1.0) - u(-1.0)) / (2.0 * step) * if i < 2 { 1.0 } else { 0.5 };
            let scale = b.moment.iter().fold(0.0f64, |m, x| m.max(x.abs()));
            assert!(
                (d - b.moment[i]).abs() < 1e-7 * scale,
                "{d}, {:?}",
                b.moment
            );
        }
    }
}

#[test]
fn uniaxial_stress_and_cylindrical_bending_give_youngs_modulus_and_the_plates_rigidity() {
    let m = plate(Y, NU, H);
    // Contracted by nu e across: S22 = 0, S11 = Y h e.
    let e = 1e-4;
    let a = Point::new(&m).at(&m, [1.0 + 2.0 * e, 1.0 - 2.0 * NU * e, 0.0]);
    assert!((a.stress[0] / (Y * H * e) - 1.0).abs() < 1e-10 && a.stress[1].abs() < 1e-6);
    // Simple shear: G h = Y h / (2 (1 + nu)).
    let a = Point::new(&m).at(&m, [1.0, 1.0, e]);
    assert!((a.stress[2] / (Y * H / 2.6 * e) - 1.0).abs() < 1e-12);
    let d = Y * H * H * H / (12.0 * 0.91);
    let b = bend(&m, [1.0, 1.0, 0.0], [2.0, 0.0, 0.0]);
    assert!((b.moment[0] / (2.0 * d) - 1.0).abs() < 1e-12);
    assert!((b.moment[1] / (2.0 * NU * d) - 1.0).abs() < 1e-12);
    // Anticlastic: no moment across, Y h^3 / 12 along.
    let b = bend(&m, [1.0, 1.0, 0.0], [2.0, -2.0 * NU, 0.0]);
    assert!((b.moment[0] / (Y * H * H * H / 6.0) - 1.0).abs() < 1e-12 && b.moment[1].abs() < 1e-12);
}

#[test]
fn response_does_not_depend_on_the_direction_of_the_axes() {
    let mut r = Random(62);
    let m = plate(Y, NU, H);
    for _ in 0..20 {
        let c = metric(&mut r, 0.2);
        let k = [30.0 * r.next(), 30.0 * r.next(), 30.0 * r.next()];
        let (s, o) = (3.0 * r.next()).sin_cos();
        let turned = |t: [f64; 3]| {
            [
                o * o * t[0] + s * s * t[1] + 2.0 * o * s * t[2],
                s * s * t[0] + o * o * t[1] - 2.0 * o * s * t[2],
                o * s * (t[1] - t[0]) + (o * o - s * s) * t[2],
            ]
        };
        let (a, b) = (Point::new(&m).at(&m, c), Point::new(&m).at(&m, turned(c)));
        assert!((a.energy / b.energy - 1.0).abs() < 1e-9);
        let want = turned(a.stress);
        let scale = want.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        assert!((0..3).all(|i| (b.stress[i] - want[i]).abs() < 1e-10 * scale));
        let (a, b) = (bend(&m, c, k), bend(&m, c, turned(k)));
        assert!((a.energy / b.energy - 1.0).abs() < 1e-10);
    }
}

#[test]
fn stiffness_bounds_the_tangent_for_every_poisson_ratio() {
    for nu in [-0.5, 0.0, 0.3, 0.5] {
        let m = plate(Y, nu, H);
        let at = |c: [f64; 3]| Point::new(&m).at(&m, c);
        let rest = at([1.0, 1.0, 0.0]);
        // Directions of strain that the eigenvectors lie in: equal, opposite, shear.
        for dir in [
            [1.0, 1.0, 0.0],
            [1.0, -1.0, 0.0],
            [0.0, 0.0, 1.0],
            [1.0, 0.0, 0.0],
        ] {
            let h: f64 = 1e-4;
            // E = h dir, so C - 1 = 2 h dir; norms with the shear counted twice.
            let a = at([
                1.0 + 2.0 * h * dir[0],
                1.0 + 2.0 * h * dir[1],
                2.0 * h * dir[2],
            ]);
            let size = |v: [f64; 3]| (v[0] * v[0] + v[1] * v[1] + 2.0 * v[2] * v[2]).sqrt();
            let slope = size(a.stress) / (h * size(dir));
            assert!(
                slope <= rest.stiffness[0] * (1.0 + 1e-9),
                "nu {nu}, {dir:?}: {slope}"
            );
            if dir[2] > 0.0 {
                let shear = a.stress[2] / (2.0 * h);
                assert!((shear / rest.stiffness[1] - 1.0).abs() < 1e-9);
            }
        }
    }
}

#[test]
fn parameters_out_of_range_are_refused_by_name() {
    let json = |y: f64, nu: f64, h: f64| {
        format!(r#"{{"youngs_modulus":{y},"poisson_ratio":{nu},"thickness":{h},"areal_mass":1}}"#)
    };
    for (text, word) in [
        (json(0.0, 0.3, 1e-3), "youngs_modulus"),
        (json(1e9, 0.51, 1e-3), "poisson_ratio"),
        (json(1e9, -1.0, 1e-3), "poisson_ratio"),
        (json(1e9, 0.3, 0.0), "thickness"),
        (
            r#"{"youngs_modulus":1,"poisson_ratio":0,"thickness":1,"areal_mass":1,"x":2}"#.into(),
            "x",
        ),
    ] {
        let error = isotropic(&text)
            .err()
            .unwrap_or_else(|| panic!("{text} was taken"));
        assert!(error.contains(word), "{error}");
    }
}
