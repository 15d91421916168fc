//! The time step that `s4` reports, against exact frequencies.

mod common;
mod s4_support;
use common::*;
use s4_support::*;

/// Largest frequency (1/s) of a lane with its masses and inertias, by differences and power iteration.
fn exact_frequency(s: &Shell, b: &Batch, x: &[Quad]) -> f64 {
    let k = stiffness(s, b, x, 0);
    let scale = |c: usize| if c < 12 { b.mass[0] } else { b.inertia[0] }.sqrt();
    let a: Vec<[f64; 24]> = (0..24)
        .map(|i| std::array::from_fn(|j| 0.5 * (k[i][j] + k[j][i]) / (scale(i) * scale(j))))
        .collect();
    let shift = 0.1 * a.iter().flatten().map(|v| v * v).sum::<f64>().sqrt();
    let mut v: [f64; 24] = std::array::from_fn(|i| 1.0 + 0.1 * (i * i % 7) as f64);
    let mut value = 0.0;
    for _ in 0..3000 {
        let w: [f64; 24] =
            std::array::from_fn(|i| (0..24).map(|j| a[i][j] * v[j]).sum::<f64>() + shift * v[i]);
        value = w.iter().map(|x| x * x).sum::<f64>().sqrt();
        v = w.map(|x| x / value);
    }
    (value - shift).sqrt()
}

#[test]
fn critical_step_bounds_the_exact_one_on_random_bent_and_skewed_elements() {
    let mut r = Random(106);
    let mut slack: Vec<f64> = Vec::new();
    let thick = plate(1e9, 0.3, 2e-3);
    let cases = [
        (ply(), "{}", 0.3, 0.2),
        (ply(), r#"{"bending":"lagged-tangent"}"#, 0.3, 0.2),
        (
            soft(),
            r#"{"hourglass_floor":0,"bending":"total"}"#,
            0.2,
            0.4,
        ),
        (ply(), r#"{"thickening":2}"#, 0.3, 0.4),
        (soft(), r#"{"thickening":1,"hourglass_floor":0}"#, 0.3, 0.4),
        (soft(), r#"{"thickening":2,"twist":"material"}"#, 0.3, 0.4),
        (plate(1e9, 0.3, 2e-4), PLATE, 0.1, 0.2),
        (
            thick,
            r#"{"bending":"total","twist":"material","transverse_shear":30,"hourglass_director":1}"#,
            0.1,
            0.2,
        ),
    ];
    for (m, json, strain, angle) in &cases {
        let s = Shell::new(json, m).unwrap();
        for _ in 0..25 {
            let mut q = uneven(&mut r, 0.25, 0.05);
            let (long, skew) = (1.0 + 3.0 * r.next().abs(), 0.57 * r.next());
            q.iter_mut()
                .for_each(|x| *x = [long * x[0] + skew * x[1], x[1], x[2]]);
            let mut b = s.start(&[q; 8], AXIS);
            let x = bent(&mut r, &s, &mut b, &[q; 8], *strain, *angle)[0];
            // All lanes get lane 0's state: its history is the batch's.
            for row in b
                .history
                .chunks_mut(8)
                .chain(b.material_history.chunks_mut(8))
            {
                let first = row[0];
                row.fill(first);
            }
            let step = nudged(&s, &b, &[x; 8], 0, 0.0).step[0];
            let exact = 2.0 / exact_frequency(&s, &b, &[x; 8]);
            assert!(
                step <= 1.0001 * exact,
                "{json}: step {step} s, exact {exact} s"
            );
            slack.push(step / exact);
        }
    }
    for (c, part) in cases.iter().zip(slack.chunks(25)) {
        let mean = part.iter().sum::<f64>() / 25.0;
        println!("{}: {mean}", c.1);
        assert!(
            mean > 0.5,
            "{}: the bound gives away too much: {mean} of the exact step",
            c.1
        );
    }
}

#[test]
fn rotations_do_not_set_the_step_of_a_ply() {
    // Against the same element's membrane. Below 2 mm the transverse shear of a ply of 0.4 mm counts.
    let m = ply();
    let s = Shell::new("{}", &m).unwrap();
    let e = El::new::<plyflow_kernels::m4::M4>("{}", &m).unwrap();
    for (size, least) in [(0.001, 0.85), (0.002, 0.92), (0.005, 0.93), (0.02, 0.93)] {
        let q = [
            [0.0; 3],
            [size, 0.0, 0.0],
            [size, size, 0.0],
            [0.0, size, 0.0],
        ];
        let b = s.initialise(&[q; 8], [1.0, 0.0, 0.0]);
        let plane = e.initialise(&[q; 8], &[[1.0, 0.0, 0.0]; 8]).step[0];
        assert!(
            b.step[0] > least * plane,
            "{size}: {} s, membrane {plane} s",
            b.step[0]
        );
        // Not more than a plate 6 times as thick has.
        let physical = b.mass[0] * 4e-4f64.powi(2) / 12.0;
        println!(
            "{size}: inertia {} of the physical",
            b.inertia[0] / physical
        );
        assert!(b.inertia[0] >= physical && b.inertia[0] < 36.0 * physical);
    }
}
