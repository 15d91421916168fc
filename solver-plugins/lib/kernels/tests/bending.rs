//! The patches of `rf4` through the C table: gradients, invariance, exactness, convergence, bounds.

mod common;
mod fabric_support;
use common::*;
use plyflow_kernels::{m4::M4, rf4::Rf4};

#[test]
fn bending_forces_are_the_gradient_of_the_bending_energy() {
    forces_are_the_gradient("{}");
}

#[test]
fn forces_of_sections_that_thicken_are_the_gradient_of_their_energy() {
    for power in 1..3 {
        forces_are_the_gradient(&format!(r#"{{"thickening": {power}}}"#));
    }
}

fn forces_are_the_gradient(parameters: &str) {
    let mut r = Random(21);
    let m = ply();
    let e = El::new::<Rf4>(parameters, &m).unwrap();
    for round in 0..10 {
        // Full patches, and ones of 7 and 5 nodes.
        let cut = [9, 7, 5][round % 3];
        let reference: Vec<Patch> = (0..8).map(|_| grid(&mut r, 0.2)[..cut].to_vec()).collect();
        let mut p = e.initialise_patches(&reference, AXIS, SIZE * SIZE);
        let moved: Vec<Patch> = reference.iter().map(|x| wavy(&mut r, x)).collect();
        let f = e.patch_forces(&mut p, &moved);
        assert!(f.energy.iter().all(|w| *w > 0.0));
        for i in 0..cut {
            for k in 0..3 {
                let h = 1e-8;
                let mut at = |s: f64| {
                    let mut x = moved.clone();
                    x.iter_mut().for_each(|q| q[i][k] += s * h);
                    e.patch_forces(&mut p, &x).energy
                };
                let (a, b) = (at(1.0), at(-1.0));
                for l in 0..8 {
                    let d = (a[l] - b[l]) / (2.0 * h);
                    let scale = (0..36).fold(0.0f64, |m, j| m.max(f.force[j * 8 + l].abs()));
                    let got = f.force[(3 * i + k) * 8 + l];
                    assert!(
                        (d - got).abs() < 2e-5 * scale,
                        "node {i}: {got} N, dW {d} of {scale}"
                    );
                }
            }
        }
        assert!(
            f.force[3 * cut * 8..].iter().all(|x| *x == 0.0),
            "unused slots carry force"
        );
    }
}

#[test]
fn quadratic_surfaces_give_their_curvature_exactly_on_distorted_patches() {
    let mut r = Random(22);
    let m = ply();
    let e = El::new::<Rf4>("{}", &m).unwrap();
    let (c, s) = (AXIS[0], AXIS[1]);
    for _ in 0..20 {
        let reference: Vec<Patch> = (0..8).map(|_| grid(&mut r, 0.25)).collect();
        let mut p = e.initialise_patches(&reference, AXIS, SIZE * SIZE);
        let k = [40.0 * r.next(), 40.0 * r.next(), 40.0 * r.next()];
        let moved: Vec<Patch> = reference
            .iter()
            .map(|x| {
                x.iter()
                    .map(|[x, y, _]| {
                        let (u, v) = (c * x + s * y, c * y - s * x);
                        [
                            *x,
                            *y,
                            0.5 * k[0] * u * u + 0.5 * k[1] * v * v + k[2] * u * v,
                        ]
                    })
                    .collect()
            })
            .collect();
        let f = e.patch_forces(&mut p, &moved);
        let law = bend(&m, [1.0, 1.0, 0.0], k);
        for l in 0..8 {
            for a in 0..2 {
                let got = f.fields[a * 8 + l];
                assert!(
                    (got - k[a]).abs() < 1e-7,
                    "curvature_{} {got}, not {}",
                    a + 1,
                    k[a]
                );
                let (got, want) = (f.fields[(2 + a) * 8 + l], law.moment[a]);
                assert!(
                    (got - want).abs() < 1e-7 * want.abs() + 1e-12,
                    "bending_moment_{} {got}, not {want}",
                    a + 1
                );
            }
        }
        let want = SIZE * SIZE * law.energy;
        assert!(
            f.energy.iter().all(|w| (w - want).abs() < 1e-6 * want),
            "{:?}, {want}",
            f.energy
        );
    }
}

#[test]
fn pure_bending_of_a_strip_returns_the_voce_moment_for_each_family_and_sign() {
    let voce = |k: f64, [a, b, c]: [f64; 3]| a * k + b * (1.0 - (-k / c).exp());
    let (plus, minus) = ([1.9457e-4, 0.03139, 4.0], [1.0279e-4, 0.03619, 6.5]);
    roll_a_strip(&ply(), |k, positive| {
        voce(k, if positive { plus } else { minus })
    });
}

#[test]
fn pure_bending_of_a_strip_returns_constant_and_tabulated_moments() {
    let shear = serde_json::json!({"coefficients": fabric_support::NCF_YARN});
    let mut law = fabric_support::sheet("fibre-energy", &shear, None);
    // Positive: a constant stiffness. Negative: straight from point to point of a table on a line.
    law["bending"] = serde_json::json!({"positive": {"stiffness": 0.0038},
        "negative": {"table": {"curvatures": [0.0, 5.0, 20.0], "moments": [0.0, 0.016, 0.064]}}});
    roll_a_strip(&fabric_support::build(&law), |k, positive| {
        k * if positive { 0.0038 } else { 0.0032 }
    });
}

/// Rolls a strip on a cylinder along each fibre family and compares its moment with `law(|k|, positive)`: the
/// virtual work of the nodal forces over the curvature, per area.
fn roll_a_strip(m: &Mat, law: impl Fn(f64, bool) -> f64) {
    let e = El::new::<Rf4>("{}", m).unwrap();
    // 2 mm, as the thesis' coupons.
    let two: Patch = grid(&mut Random(1), 0.0)
        .iter()
        .map(|x| x.map(|c| 0.4 * c))
        .collect();
    let reference = vec![two; 8];
    for (axis, family) in [([1.0, 0.0, 0.0], 1), ([0.0, 1.0, 0.0], 2)] {
        let mut p = e.initialise_patches(&reference, axis, SIZE * SIZE);
        for k in [2.0, 10.0, 25.0, 50.0, -2.0, -10.0, -25.0, -50.0f64] {
            let rolled = |k: f64| -> Vec<Patch> {
                let roll = |[x, y, _]: [f64; 3]| [(k * x).sin() / k, y, (1.0 - (k * x).cos()) / k];
                vec![reference[0].iter().map(|x| roll(*x)).collect(); 8]
            };
            let f = e.patch_forces(&mut p, &rolled(k)).force;
            let h = 1e-4;
            let (a, b) = (&rolled(k + h)[0], &rolled(k - h)[0]);
            let work: f64 = (0..9)
                .flat_map(|i| (0..3).map(move |c| (i, c)))
                .map(|(i, c)| f[(3 * i + c) * 8] * (a[i][c] - b[i][c]) / (2.0 * h))
                .sum();
            let moment = work / (SIZE * SIZE);
            let want = law(k.abs(), (k > 0.0) == (family == 1)).copysign(k);
            // At 50 1/m an element turns by 0.1 rad: its work over the roll is 0.3 % short.
            assert!(
                (moment - want).abs() < 0.004 * want.abs(),
                "{family}, {k}: {moment}, {want}"
            );
        }
    }
}

#[test]
fn flat_and_rigidly_turned_patches_carry_no_force() {
    let mut r = Random(23);
    let m = ply();
    let e = El::new::<Rf4>("{}", &m).unwrap();
    let reference: Vec<Patch> = (0..8).map(|_| grid(&mut r, 0.25)).collect();
    let mut p = e.initialise_patches(&reference, AXIS, SIZE * SIZE);
    let turn = rotation(&mut r);
    let stretched: Vec<Patch> = reference
        .iter()
        .map(|q| {
            q.iter()
                .map(|[x, y, _]| turned(&turn, [1.02 * x + 0.3 * y, *y, 0.0]))
                .collect()
        })
        .collect();
    let f = e.patch_forces(&mut p, &stretched);
    assert!(f.force.iter().all(|x| x.abs() < 1e-9), "{:?}", f.force);
    let moved: Vec<Patch> = reference.iter().map(|x| wavy(&mut r, x)).collect();
    let f = e.patch_forces(&mut p, &moved);
    for l in 0..8 {
        for k in 0..3 {
            let sum: f64 = (0..12).map(|i| f.force[(3 * i + k) * 8 + l]).sum();
            assert!(sum.abs() < 1e-12, "net force {sum} N");
            let (a, b) = ((k + 1) % 3, (k + 2) % 3);
            let torque: f64 = (0..9)
                .map(|i| {
                    moved[l][i][a] * f.force[(3 * i + b) * 8 + l]
                        - moved[l][i][b] * f.force[(3 * i + a) * 8 + l]
                })
                .sum();
            assert!(torque.abs() < 1e-12, "net moment {torque} N m");
        }
    }
}

/// Fibres turned towards each other by the angle g, and then rolled on a cylinder with the curvature k along the bisector's
/// normal: the fibres keep their length, and lie at (90 deg - g) / 2 to the cylinder's axis.
fn sheared_and_rolled(x: &Patch, g: f64, k: f64) -> Patch {
    let half = 0.5 * (std::f64::consts::FRAC_PI_2 - g);
    let (across, along) = (half.sin(), half.cos());
    x.iter()
        .map(|[u, v, _]| {
            let (a, b) = (across * (u - v), along * (u + v));
            [(k * a).sin() / k, b, (1.0 - (k * a).cos()) / k]
        })
        .collect()
}

#[test]
fn a_sheared_section_bends_with_the_power_of_its_thickness() {
    // At a shear angle g the area is cos g times what it was, the thickness 1 / cos g times.
    let m = ply();
    let reference: Vec<Patch> = vec![grid(&mut Random(1), 0.0); 8];
    let (g, k) = (-1.1f64, 3.0);
    let moved: Vec<Patch> = reference
        .iter()
        .map(|x| sheared_and_rolled(x, -g, k))
        .collect();
    let run = |power: u32| {
        let e = El::new::<Rf4>(&format!(r#"{{"thickening": {power}}}"#), &m).unwrap();
        let mut p = e.initialise_patches(&reference, [1.0, 0.0, 0.0], SIZE * SIZE);
        e.patch_forces(&mut p, &moved)
    };
    let plain = run(0);
    // Each family bends along itself: k sin^2 of its angle to the axis (the patch is an element wide: 1 %).
    let bent = k * (0.5 * (std::f64::consts::FRAC_PI_2 + g)).sin().powi(2);
    assert!(
        (plain.fields[0] / bent - 1.0).abs() < 0.01,
        "{} {bent}",
        plain.fields[0]
    );
    for power in 1..3 {
        let thick = run(power);
        let factor = g.cos().powi(-(power as i32));
        for (got, want) in [
            (thick.energy[0], factor * plain.energy[0]),
            (thick.fields[2 * 8], factor * plain.fields[2 * 8]),
            (thick.fields[3 * 8], factor * plain.fields[3 * 8]),
        ] {
            assert!((got / want - 1.0).abs() < 2e-3, "{power}: {got}, {want}");
        }
        assert!((thick.fields[0] - plain.fields[0]).abs() < 1e-12);
    }
}

#[test]
fn a_power_of_thickness_that_no_section_has_is_refused() {
    let Err(text) = El::new::<Rf4>(r#"{"thickening": 3}"#, &ply()) else {
        panic!("accepted");
    };
    let Err(membrane) = El::new::<M4>(r#"{"thickening": 2}"#, &ply()) else {
        panic!("a membrane bends");
    };
    assert!(membrane.contains("does not bend"), "{membrane}");
    assert!(
        text.contains("thickening") && text.contains("0 to 2"),
        "{text}"
    );
}

#[test]
fn patch_stiffness_bounds_the_rows_of_the_exact_one() {
    stiffness_bounds_the_rows("{}", wavy);
}

#[test]
fn stiffness_of_sections_that_thicken_bounds_the_rows_of_the_exact_one() {
    for power in 1..3 {
        let parameters = format!(r#"{{"thickening": {power}}}"#);
        stiffness_bounds_the_rows(&parameters, wavy);
        stiffness_bounds_the_rows(&parameters, |r, x| {
            sheared_and_rolled(x, 1.2 * r.next(), 30.0 + 20.0 * r.next())
        });
    }
}

fn stiffness_bounds_the_rows(parameters: &str, shape: impl Fn(&mut Random, &Patch) -> Patch) {
    let mut r = Random(24);
    let m = ply();
    let e = El::new::<Rf4>(parameters, &m).unwrap();
    for _ in 0..10 {
        let reference: Vec<Patch> = vec![grid(&mut r, 0.2); 8];
        let mut p = e.initialise_patches(&reference, AXIS, SIZE * SIZE);
        let moved: Vec<Patch> = vec![shape(&mut r, &reference[0]); 8];
        let f = e.patch_forces(&mut p, &moved);
        let h = 1e-8;
        // Blocks K_IJ by differences; their Frobenius norm bounds the spectral one by sqrt(3), so
        // the row sums of Frobenius norms may exceed the bound by that at most.
        let mut rows = [0.0; 9];
        for j in 0..9 {
            let mut block = [0.0f64; 9];
            for c in 0..3 {
                let mut at = |s: f64| {
                    let mut x = moved.clone();
                    x.iter_mut().for_each(|q| q[j][c] += s * h);
                    e.patch_forces(&mut p, &x).force
                };
                let (a, b) = (at(1.0), at(-1.0));
                for i in 0..9 {
                    for k in 0..3 {
                        let d = (a[(3 * i + k) * 8] - b[(3 * i + k) * 8]) / (2.0 * h);
                        block[i] += d * d;
                    }
                }
            }
            (0..9).for_each(|i| rows[i] += block[i].sqrt());
        }
        for i in 0..9 {
            let bound = f.stiffness[i * 8];
            assert!(
                bound * 3f64.sqrt() > rows[i],
                "node {i}: bound {bound}, exact {}",
                rows[i]
            );
            assert!(
                bound < 20.0 * rows[i],
                "node {i}: bound {bound} is useless, {}",
                rows[i]
            );
        }
    }
}

#[test]
fn bending_energy_of_a_wavy_sheet_converges_at_second_order() {
    // z = a sin(pi x / w) sin(pi y / w) on w x w, fibres at 36.9 degrees to the mesh, a linear law:
    // exact energy by the material itself on a fine grid of points.
    let json = r#"{"fibre_modulus":3e9,"shear":{"coefficients":[0,100]},
        "bending":{"positive":{"linear":0.005}},"thickness":4e-4,"areal_mass":0.44}"#;
    let m = fabric(json).unwrap();
    let e = El::new::<Rf4>("{}", &m).unwrap();
    let (w, a) = (0.1, 1e-5);
    let q = std::f64::consts::PI / w;
    let height = |x: f64, y: f64| a * (q * x).sin() * (q * y).sin();
    let (c, s) = (AXIS[0], AXIS[1]);
    let exact = {
        let (n, mut sum) = (200, 0.0);
        for i in 0..n * n {
            let x = w * ((i % n) as f64 + 0.5) / n as f64;
            let y = w * ((i / n) as f64 + 0.5) / n as f64;
            let xx = -q * q * height(x, y);
            let xy = a * q * q * (q * x).cos() * (q * y).cos();
            let k = [
                xx + 2.0 * c * s * xy,
                xx - 2.0 * c * s * xy,
                (c * c - s * s) * xy,
            ];
            sum += bend(&m, [1.0, 1.0, 0.0], k).energy;
        }
        sum * w * w / (n * n) as f64
    };
    // Patches at the centres of n x n cells, so that their areas tile the sheet.
    let ring = grid(&mut Random(1), 0.0);
    let error = |n: usize| -> f64 {
        let h = w / n as f64;
        let centre = |i: usize| [h * ((i % n) as f64 + 0.5), h * ((i / n) as f64 + 0.5)];
        let patch = |i: usize, lifted: bool| -> Patch {
            let [x, y] = centre(i);
            ring.iter()
                .map(|p| [x + p[0] / SIZE * h, y + p[1] / SIZE * h])
                .map(|[x, y]| [x, y, if lifted { height(x, y) } else { 0.0 }])
                .collect()
        };
        let mut sum = 0.0;
        for block in (0..n * n).step_by(8) {
            let all = |lifted| {
                (block..block + 8)
                    .map(|i| patch(i, lifted))
                    .collect::<Vec<_>>()
            };
            let mut p = e.initialise_patches(&all(false), AXIS, h * h);
            let energy = e.patch_forces(&mut p, &all(true)).energy;
            sum += energy.iter().take(n * n - block).sum::<f64>();
        }
        (sum / exact - 1.0).abs()
    };
    let (coarse, middle, fine) = (error(10), error(20), error(40));
    let orders = [(coarse / middle).log2(), (middle / fine).log2()];
    assert!(orders.iter().all(|o| (1.8..2.2).contains(o)), "{orders:?}");
    assert!(fine < 0.005, "error {fine} with 40 elements on a half wave");
}
