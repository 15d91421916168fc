//! Bending of `s4` against closed forms, the input laws, and an ODE solved here.

mod common;
mod s4_support;
use common::*;
use s4_support::model::{Model, rectangle};
use s4_support::*;

fn voce(k: f64, [a, b, c]: [f64; 3]) -> f64 {
    a * k + b * (1.0 - (-k / c).exp())
}

/// Positive and negative law.
const NCF: [[f64; 3]; 2] = [[1.9457e-4, 0.03139, 4.0], [1.0279e-4, 0.03619, 6.5]];
const WOVEN: [[f64; 3]; 2] = [[1.549e-5, 0.00757, 20.0]; 2];

/// Rolls a 2 mm element, sheared by `g`, along one family to the curvature `last` (1/m): the nodes
/// lie on a circle with chords that keep their length, and turn by angle = curvature * arc. Gives
/// the moments (work over the change of curvature and area) at a tenth, a half and all of it.
fn rolled(s: &Shell, family: usize, g: f64, last: f64) -> Vec<(f64, f64)> {
    let size = 0.002;
    let square = [
        [0.0; 3],
        [size, 0.0, 0.0],
        [size, size, 0.0],
        [0.0, size, 0.0],
    ];
    let sheared = square.map(|[x, y, _]| [x + g.sin() * y, g.cos() * y, 0.0]);
    // The axis of the roll is the other fibre, p is normal to it in the plane.
    let (axis, p) = if family == 0 {
        ([g.sin(), g.cos(), 0.0], [g.cos(), -g.sin(), 0.0])
    } else {
        ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    };
    let chord = size * g.cos();
    let arc = sheared.map(|x| dot(x, p));
    let turn = cross(p, [0.0, 0.0, 1.0]);
    let place = |k: f64| -> Quad {
        let radius = 0.5 * chord / (0.5 * k * chord).sin();
        std::array::from_fn(|i| {
            let (a, t) = (k * arc[i], dot(sheared[i], axis));
            let (u, z) = (radius * a.sin(), radius * (1.0 - a.cos()));
            std::array::from_fn(|c| u * p[c] + t * axis[c] + if c == 2 { z } else { 0.0 })
        })
    };
    let mut b = s.start(&[square; 8], [1.0, 0.0, 0.0]);
    s.forces(&mut b, &[sheared; 8], &[STILL; 8], 1e-6);
    let steps = 4000;
    let mut out = Vec::new();
    for i in 1..=steps {
        let k = last * i as f64 / steps as f64;
        let w = arc.map(|a| turn.map(|c| c * a * last / steps as f64));
        let f = s.forces(&mut b, &[place(k); 8], &[w; 8], 1.0);
        if [steps / 10, steps / 2, steps].contains(&i) {
            let h = 1e-4 * k;
            let (more, less) = (place(k + h), place(k - h));
            let mut work = 0.0;
            for n in 0..4 {
                let (p, m) = (Out::at(&f.force, n, 0), Out::at(&f.moment, n, 0));
                let dx: V3 = std::array::from_fn(|c| (more[n][c] - less[n][c]) / (2.0 * h));
                work += dot(p, dx) + dot(m, turn) * arc[n];
            }
            // Along the fibre the curvature is cos^2 g of that along p.
            let per = g.cos().powi(2);
            out.push((k * per, work / (size * size * per)));
        }
    }
    out
}

#[test]
fn pure_bending_returns_the_law_in_both_signs_and_families_at_any_shear() {
    let mut worst = [0.0f64; 2];
    for (m, laws, same) in [
        (ply(), NCF, false),
        (fabric(&woven("fibre-energy")).unwrap(), WOVEN, true),
    ] {
        for (rule, json) in [r#"{"bending":"lagged-tangent"}"#, "{}"]
            .into_iter()
            .enumerate()
        {
            let s = Shell::new(json, &m).unwrap();
            for family in 0..2 {
                for g in [0.0f64, 30.0, -30.0] {
                    for sign in [1.0, -1.0] {
                        let g = g.to_radians();
                        let last = sign * 50.0 / g.cos().powi(2);
                        for (k, got) in rolled(&s, family, g, last) {
                            let law = if same || (k > 0.0) == (family == 0) {
                                laws[0]
                            } else {
                                laws[1]
                            };
                            let want = voce(k.abs(), law).copysign(k);
                            let error = (got / want - 1.0).abs();
                            worst[rule] = worst[rule].max(error);
                            assert!(
                                error < 0.01,
                                "{json}, family {}, {g} rad, {k} 1/m: {got} N, law {want} N",
                                family + 1
                            );
                        }
                    }
                }
            }
        }
    }
    println!("largest difference, lagged and total: {worst:?}");
}

#[test]
fn sections_that_thicken_bend_with_the_power_of_their_thickness() {
    let m = ply();
    for power in 1..3 {
        let s = Shell::new(&format!(r#"{{"thickening": {power}}}"#), &m).unwrap();
        for family in 0..2 {
            for g in [0.0f64, 50.0, -60.0].map(f64::to_radians) {
                for (k, got) in rolled(&s, family, g, 50.0 / g.cos().powi(2)) {
                    let law = NCF[usize::from(family == 1)];
                    let want = voce(k, law) / g.cos().powi(power);
                    assert!(
                        (got / want - 1.0).abs() < 0.01,
                        "power {power}, family {}, {g} rad, {k} 1/m: {got} N, expected {want} N",
                        family + 1
                    );
                }
            }
        }
    }
}

#[test]
fn lagged_tangents_come_back_to_the_law_when_a_ply_is_unrolled() {
    // The work left over after rolling and unrolling is that of the finite increments alone.
    let s = Shell::new(r#"{"bending":"lagged-tangent"}"#, &ply()).unwrap();
    let size = 0.002;
    let square = [
        [0.0; 3],
        [size, 0.0, 0.0],
        [size, size, 0.0],
        [0.0, size, 0.0],
    ];
    let mut left = Vec::new();
    for steps in [500, 1000] {
        let mut b = s.start(&[square; 8], [1.0, 0.0, 0.0]);
        let mut peak = 0.0f64;
        let mut last = 0.0;
        for i in 0..2 * steps {
            let sign = if i < steps { 1.0 } else { -1.0 };
            let w =
                square.map(|[x, _, _]| [0.0, -sign * 50.0 * (x - 0.5 * size) / steps as f64, 0.0]);
            let f = s.forces(&mut b, &[square; 8], &[w; 8], 1.0);
            last = f.energy[8];
            peak = peak.max(last);
        }
        left.push(last / peak);
    }
    assert!(
        left[0].abs() < 0.02 && left[1].abs() < 0.55 * left[0].abs(),
        "{left:?}"
    );
}

#[test]
fn thin_cantilever_with_an_end_load_is_exact_for_any_number_of_elements() {
    // MacNeal's transverse shear makes the one-point beam's nodal values exact: P L^3 / (3 D).
    let (length, width, thickness) = (0.1f64, 0.01, 1e-3);
    let m = plate(1e9, 0.0, thickness);
    let rigidity = 1e9 * thickness * thickness * thickness / 12.0 * width;
    let load = 1e-4;
    let want = load * length.powi(3) / (3.0 * rigidity);
    // With a physical shear modulus in series also P L / (5/6 G h).
    let modulus = 1e5;
    let shear = load * length / (5.0 / 6.0 * modulus * thickness * width);
    let soft = PLATE.replace('}', r#","transverse_shear_modulus":1e5}"#);
    for (n, json, want) in [1, 2, 5]
        .into_iter()
        .flat_map(|n| [(n, PLATE, want), (n, &soft, want + shear)])
    {
        let mut s = Model::new(
            json,
            &m,
            rectangle([n, 1], [length, width], 0.0),
            [1.0, 0.0, 0.0],
        );
        let mut f = vec![[0.0; 3]; s.x.len()];
        f[n][2] = 0.5 * load;
        f[2 * n + 1][2] = 0.5 * load;
        s.equilibrium(&f, &|node, _| node % (n + 1) == 0);
        let got = s.x[n][2];
        assert!(
            (got / want - 1.0).abs() < 1e-5,
            "{n} elements, {json}: {got} m, exact {want} m"
        );
    }
}

#[test]
fn plate_twisted_at_its_corners_converges_to_the_closed_form() {
    // w = k12 x y: M12 = D (1 - nu) k12 in the plate, 2 M12 at the corners (Kirchhoff).
    let (side, thickness, nu) = (0.1, 1e-3, 0.3);
    let m = plate(1e9, nu, thickness);
    let d = 1e9 * thickness * thickness * thickness / (12.0 * (1.0 - nu * nu));
    let load = 1e-4;
    // Corner to corner: w(0,0) - w(1,0) + w(1,1) - w(0,1) = k12 side^2, over the corner's force.
    let want = load / (2.0 * d * (1.0 - nu)) * side * side;
    let error = |n: usize, json: &str| -> f64 {
        let mut s = Model::new(
            json,
            &m,
            rectangle([n, n], [side, side], 0.0),
            [1.0, 0.0, 0.0],
        );
        let corner = [0, n, (n + 1) * (n + 1) - 1, n * (n + 1)];
        let mut f = vec![[0.0; 3]; s.x.len()];
        corner
            .iter()
            .zip([1.0, -1.0, 1.0, -1.0])
            .for_each(|(c, sign)| f[*c][2] = sign * load);
        s.equilibrium(&f, &|node, k| match k {
            0 => node == corner[0],
            1 => node == corner[0] || node == corner[1],
            2 => node == corner[0] || node == corner[1] || node == corner[3],
            _ => false,
        });
        let w = corner.map(|c| s.x[c][2]);
        (w[0] - w[1] + w[2] - w[3]) / want - 1.0
    };
    let errors: Vec<f64> = [1, 2, 4, 8].iter().map(|n| error(*n, PLATE)).collect();
    println!("{errors:?}");
    assert!(errors[3].abs() < 0.05, "{errors:?}");
    assert!(
        errors.windows(2).all(|e| e[1].abs() < e[0].abs()),
        "{errors:?}"
    );
}

/// Tip of a cantilever under its own weight `q` (N/m2) with the moment law `moment(k)`: drop and
/// horizontal position, by shooting on the tip's angle (Runge-Kutta from the tip; inextensible).
fn hanging(length: f64, q: f64, moment: &dyn Fn(f64) -> f64) -> [f64; 2] {
    let curvature = |m: f64| {
        let (mut a, mut b) = (0.0, 1.0);
        while moment(b) < m {
            b *= 2.0;
        }
        for _ in 0..60 {
            let c = 0.5 * (a + b);
            if moment(c) < m { a = c } else { b = c }
        }
        0.5 * (a + b)
    };
    // y: angle below the horizontal, moment, x and drop counted from the tip backwards.
    let rate = |s: f64, y: [f64; 4]| [-curvature(y[1]), q * s * y[0].cos(), y[0].cos(), y[0].sin()];
    let shoot = |tip: f64| -> [f64; 4] {
        let (n, mut y) = (400, [tip, 0.0, 0.0, 0.0]);
        let h = length / n as f64;
        for i in 0..n {
            let s = i as f64 * h;
            let add = |y: [f64; 4], k: [f64; 4], f: f64| -> [f64; 4] {
                std::array::from_fn(|i| y[i] + f * k[i])
            };
            let a = rate(s, y);
            let b = rate(s + 0.5 * h, add(y, a, 0.5 * h));
            let c = rate(s + 0.5 * h, add(y, b, 0.5 * h));
            let d = rate(s + h, add(y, c, h));
            y = std::array::from_fn(|i| y[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
        }
        y
    };
    // The clamped end must be horizontal; its angle grows with the tip's.
    let (mut a, mut b) = (0.0, 1.57);
    for _ in 0..50 {
        let c = 0.5 * (a + b);
        if shoot(c)[0] < 0.0 { a = c } else { b = c }
    }
    let y = shoot(0.5 * (a + b));
    [y[3], y[2]]
}

#[test]
fn hanging_strip_of_fabric_converges_to_the_inextensible_solution_with_its_law() {
    let m = ply();
    let (length, width) = (0.12, 0.02);
    let weight = 0.44 * 9.81;
    // Family 1 bends downwards: its negative law.
    let want = hanging(length, weight, &|k| voce(k, NCF[1]));
    assert!(want[0] > 0.2 * length, "not a large deflection: {want:?}");
    let error = |n: usize| -> f64 {
        let mesh = rectangle([n, 1], [length, width], 0.0);
        let mut s = Model::new(r#"{"bending":"total"}"#, &m, mesh, [1.0, 0.0, 0.0]);
        for part in 1..=8 {
            let f: Vec<V3> = s
                .mass
                .iter()
                .map(|m| [0.0, 0.0, -9.81 * m * part as f64 / 8.0])
                .collect();
            s.equilibrium(&f, &|node, _| node % (n + 1) == 0);
        }
        let (dx, dz) = (s.x[n][0] - want[1], -s.x[n][2] - want[0]);
        (dx * dx + dz * dz).sqrt() / want[0]
    };
    let errors: Vec<f64> = [5, 10, 20].iter().map(|n| error(*n)).collect();
    let orders: Vec<f64> = errors.windows(2).map(|e| (e[0] / e[1]).log2()).collect();
    println!("tip {want:?}, errors {errors:?}, orders {orders:?}");
    assert!(errors[1] < 0.01 && errors[2] < 0.0025, "{errors:?}");
    assert!(orders.iter().all(|o| (1.7..2.4).contains(o)), "{orders:?}");
}

#[test]
fn folded_reference_of_flat_elements_bends_like_a_flat_one() {
    // Two flat parts that meet at 30 degrees: the elements' own directors see relative turns alone, so
    // an end load gives the closed form of the L-shaped beam.
    let (n, length, width, thickness) = (8, 0.1f64, 0.01, 1e-3);
    let m = plate(1e9, 0.0, thickness);
    let rigidity = 1e9 * thickness * thickness * thickness / 12.0 * width;
    let (mut x, cells) = rectangle([n, 1], [length, width], 0.0);
    let fold = 30f64.to_radians();
    for p in x.iter_mut().filter(|p| p[0] > 0.5 * length) {
        let s = p[0] - 0.5 * length;
        (p[0], p[2]) = (0.5 * length + s * fold.cos(), s * fold.sin());
    }
    let mut s = Model::new(PLATE, &m, (x.clone(), cells), [1.0, 0.0, 0.0]);
    // So small that the tip's way does not change the arms.
    let load = 2e-5;
    let mut f = vec![[0.0; 3]; s.x.len()];
    f[n][2] = 0.5 * load;
    f[2 * n + 1][2] = 0.5 * load;
    s.equilibrium(&f, &|node, _| node % (n + 1) == 0);
    // Castigliano with M = P (x_tip - x): integrals of the horizontal arm over both parts.
    let (a, c) = (0.5 * length, fold.cos());
    let tip = a + a * c;
    let arm = |from: f64, to: f64| (from.powi(3) - to.powi(3)) / 3.0;
    let want = load / rigidity * (arm(tip, tip - a) + arm(a * c, 0.0) / c);
    let got = s.x[n][2] - x[n][2];
    assert!(
        (got / want - 1.0).abs() < 1e-4,
        "{got} m, closed form {want} m"
    );
}
