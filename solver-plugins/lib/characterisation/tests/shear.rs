//! Picture-frame and cantilever tests of known laws: the laws must come back.

use plyflow_characterisation::cantilever::{Formula, stiffness};
use plyflow_characterisation::csv::{Column, Table, parse};
use plyflow_characterisation::picture_frame::{Frame, Shear, Test, ZeroChoice, characterise};
use plyflow_characterisation::synthetic::{
    BENDING, Elastica, Noise, elastica, frame_force, ncf_shear, overhang_at, woven_shear,
};
use plyflow_characterisation::yarns::Yarns;
use plyflow_model::units::Dimension;

const FRAME: Frame = Frame {
    side: 0.145,
    specimen_side: 0.110,
};

fn table(law: fn(f64) -> f64, sign: f64, degrees: f64, noise: f64, seed: u64) -> Table {
    let wanted = [
        Column::required("displacement", Dimension::Length),
        Column::required("force", Dimension::Force),
    ];
    let half = 0.5 * (90f64 - degrees).to_radians();
    let last = 2.0 * FRAME.side * (half.cos() - 0.5f64.sqrt());
    let mut random = Noise::new(seed);
    let rows: Vec<(f64, f64)> = (0..=600)
        .map(|i| last * f64::from(i) / 600.0)
        .map(|d| {
            (
                d,
                frame_force(&law, FRAME.side, FRAME.specimen_side, d, sign),
            )
        })
        .collect();
    let largest = rows.iter().fold(0.0f64, |m, r| m.max(r.1));
    let text: String = (rows.iter())
        .map(|(d, f)| {
            format!(
                "{:.7},{:.9}\n",
                1e3 * d,
                f + noise * largest * random.normal()
            )
        })
        .collect();
    parse(
        &format!("displacement [mm],force [N]\n{text}"),
        "t.csv",
        &wanted,
    )
    .unwrap()
}

fn test(law: fn(f64) -> f64, sign: f64, degrees: f64, noise: f64, seed: u64) -> Test {
    Test::new(
        &table(law, sign, degrees, noise, seed),
        &FRAME,
        ZeroChoice::Find,
        // Positive shear of the non-crimp fabric, whose stitch carries most of it.
        law(sign * 0.4) > 400.0,
    )
    .unwrap()
}

/// Root mean square of the difference of two laws over that of the second, from `from` to `to` degrees.
fn law_error(found: &Shear, law: fn(f64) -> f64, from: f64, to: f64) -> f64 {
    let (mut off, mut size) = (0.0, 0.0);
    for i in 0..=1000 {
        let g = (from + (to - from) * f64::from(i) / 1000.0).to_radians();
        off += (found.force(g) - law(g)).powi(2);
        size += law(g).powi(2);
    }
    (off / size).sqrt()
}

/// Of the yarns' polynomial.
fn degree(found: &Shear) -> usize {
    match &found.law.fit.yarns {
        Yarns::Polynomial(p) => p.coefficients.len() - 1,
        Yarns::Table { .. } => panic!("a table: {found:?}"),
    }
}

#[test]
fn angle_and_force_of_the_frame_are_those_of_energy_and_of_the_hinges() {
    // Energy gives the force of the law at the angle that the closed form of the frame gives.
    for degrees in [3.0, 20.0, 45.0, 65.0] {
        let g = f64::to_radians(degrees);
        let d = 2.0 * FRAME.side * (0.5 * (std::f64::consts::FRAC_PI_2 - g)).cos()
            - FRAME.side * 2f64.sqrt();
        let angle = FRAME.shear_angle(d).unwrap();
        assert!((angle - g).abs() < 1e-12, "{angle} {g}");
        let force = frame_force(&woven_shear, FRAME.side, FRAME.specimen_side, d, 1.0);
        assert!((FRAME.normalised(force, angle) / woven_shear(g) - 1.0).abs() < 1e-6);
    }
    assert!(FRAME.shear_angle(0.6 * FRAME.side).is_none());
    // A specimen that fills the frame: F = 2 F_norm L cos((pi/2 - g)/2).
    let full = Frame {
        side: 0.2,
        specimen_side: 0.2,
    };
    assert!(
        (full.normalised(
            2.0 * 100.0 * 0.2 * 0.6f64.cos(),
            std::f64::consts::FRAC_PI_2 - 1.2
        ) - 100.0)
            .abs()
            < 1e-12
    );
}

#[test]
fn the_woven_curve_comes_back_within_three_per_mille_in_both_signs() {
    for (noise, bound) in [(0.0, 1e-5), (0.005, 0.003)] {
        let up = [
            test(woven_shear, 1.0, 60.0, noise, 1),
            test(woven_shear, 1.0, 60.0, noise, 2),
        ];
        let down = [test(woven_shear, -1.0, 60.0, noise, 3)];
        for negative in [&down[..], &[]] {
            let found = characterise(&up, negative, false, None, 1.4).unwrap();
            let errors =
                [(-60.0, 0.0), (0.0, 60.0)].map(|(a, b)| law_error(&found, woven_shear, a, b));
            println!(
                "woven, noise {noise}: degree {}, off by {errors:?}, condition {:.1e}",
                degree(&found),
                found.law.fit.condition
            );
            assert!(errors.iter().all(|e| *e < bound), "{errors:?}");
        }
    }
}

#[test]
fn the_ncf_curve_with_its_stitch_comes_back_within_one_percent_in_both_signs() {
    for (noise, bound) in [(0.0, 1e-3), (0.005, 0.01)] {
        let up = [test(ncf_shear, 1.0, 55.0, noise, 1)];
        let down = [test(ncf_shear, -1.0, 55.0, noise, 2)];
        let found = characterise(&up, &down, true, None, 1.4).unwrap();
        let errors = [(-55.0, 0.0), (0.0, 55.0)].map(|(a, b)| law_error(&found, ncf_shear, a, b));
        let stitch = found.stitch.unwrap().stitch;
        println!("NCF, noise {noise}: off by {errors:?}, {stitch:?}");
        assert!(errors.iter().all(|e| *e < bound), "{errors:?}");
        for (a, b) in stitch.angles.iter().zip([0.06, 0.5, 0.75]) {
            assert!((a - b).abs() < 0.01, "{stitch:?}");
        }
        assert!((stitch.peak / 880.0 - 1.0).abs() < 0.01, "{stitch:?}");
    }
}

#[test]
fn a_force_that_is_lost_in_the_noise_at_first_is_not_taken_for_slack() {
    // Locks by a factor of 20: up to 15 deg the noise of 1 % hides most of the force.
    fn locking(g: f64) -> f64 {
        (60.0 * g.abs() + 4.0 * ((6.0 * g.abs()).exp() - 1.0 - 6.0 * g.abs())) * g.signum()
    }
    for seed in 1..=40 {
        let found = test(locking, 1.0, 55.0, 0.01, seed).zero;
        assert!(found.displacement.abs() < 1e-9, "{seed}: {found:?}");
    }
}

#[test]
fn signs_that_differ_have_each_a_law_and_signs_that_agree_one() {
    fn apart(g: f64) -> f64 {
        if g > 0.0 {
            90.0 * g + 150.0 * g.powi(3)
        } else {
            200.0 * g + 60.0 * g.powi(3)
        }
    }
    let tests = |law, sign: f64| {
        let seeds = if sign > 0.0 { [1, 2] } else { [3, 4] };
        seeds.map(|s| test(law, sign, 55.0, 0.005, s))
    };
    let found = characterise(&tests(apart, 1.0), &tests(apart, -1.0), false, None, 1.4).unwrap();
    let other = found.negative.as_ref().unwrap();
    assert!(found.positive_relative_rms < 0.02 && found.negative_relative_rms < 0.02);
    assert!((other.fit.yarns.stiffness() / 200.0 - 1.0).abs() < 0.05);
    let errors = [(-50.0, -5.0), (5.0, 50.0)].map(|(a, b)| law_error(&found, apart, a, b));
    assert!(errors.iter().all(|e| *e < 0.01), "{errors:?}");
    let alike = characterise(
        &tests(woven_shear, 1.0),
        &tests(woven_shear, -1.0),
        false,
        None,
        1.4,
    );
    assert!(alike.unwrap().negative.is_none());
}

#[test]
fn shear_tests_that_are_none_are_refused() {
    let up = [test(ncf_shear, 1.0, 55.0, 0.0, 1)];
    assert!(
        characterise(&up, &[], true, None, 1.4)
            .unwrap_err()
            .contains("`negative`")
    );
    let short = [test(ncf_shear, 1.0, 25.0, 0.0, 1)];
    let down = [test(ncf_shear, -1.0, 55.0, 0.0, 1)];
    assert!(
        characterise(&short, &down, true, None, 1.4)
            .unwrap_err()
            .contains("before the stitch has failed")
    );
    // 0.75 rad, where the stitch has failed, are 43 deg.
    for (up, down, says) in [
        (41.0, 55.0, "the positive tests end at 41.0 deg, before"),
        (
            55.0,
            41.0,
            "the negative tests end at 41.0 deg, up to which",
        ),
    ] {
        let [up, down] = [(1.0, up), (-1.0, down)].map(|(s, to)| [test(ncf_shear, s, to, 0.0, 1)]);
        let e = characterise(&up, &down, true, None, 1.4).unwrap_err();
        assert!(e.contains(says) && e.contains("ends at 43.0 deg"), "{e}");
    }
    let wanted = [
        Column::required("displacement", Dimension::Length),
        Column::required("force", Dimension::Force),
    ];
    let refused = |rows: &str| {
        let text = format!("displacement [mm],force [N]\n{rows}");
        Test::new(
            &parse(&text, "t.csv", &wanted).unwrap(),
            &FRAME,
            ZeroChoice::Given,
            false,
        )
        .unwrap_err()
    };
    let line = |scale: f64| {
        (0..40)
            .map(|i| format!("{},1\n", scale * f64::from(i)))
            .collect::<String>()
    };
    assert!(refused("1,2\n").contains("at least 20"));
    assert!(refused(&line(0.001)).contains("shear angle of"));
    assert!(refused(&line(10.0)).starts_with("t.csv:11: a displacement of 90.000 mm does not fit"));
    assert!(refused(&line(-1.0)).contains("one file holds one stroke"));
    let back: String = (0..40)
        .map(|i| format!("{},1\n", 20 - i32::abs(i - 20)))
        .collect();
    assert!(
        refused(&back)
            .starts_with("t.csv:23: the displacement goes back from 20.000 mm to 19.000 mm"),
    );
}

/// The laws printed in table 3.2 (from the revised test) and the constants (from the standard test) are two
/// measurements. For the woven fabric they agree; the laws printed for the non-crimp fabric are softer than
/// its constants, by 22 to 43 %, whatever is computed from them.
#[test]
fn the_standard_test_of_the_printed_laws_agrees_with_the_printed_constants_for_the_woven_and_is_softer_for_the_ncf()
 {
    for law in &BENDING {
        for (degrees, published) in [41.5f64, 7.1].into_iter().zip(law.standard) {
            let overhang = overhang_at(&|k| law.law(k), law.weight(), degrees.to_radians());
            let by = |formula| stiffness(formula, overhang, degrees.to_radians(), law.weight());
            let b = by(Formula::Standard)
                .or_else(|_| by(Formula::Peirce))
                .unwrap();
            let off = b / published - 1.0;
            println!(
                "{} at {degrees} deg: overhang {:.1} mm, B {b:.6} N m (Peirce {:.6}), thesis {published} ({:+.1} %)",
                law.name,
                1e3 * overhang,
                by(Formula::Peirce).unwrap(),
                100.0 * off
            );
            let expected = if law.name == "woven" {
                -0.1..0.1
            } else {
                -0.45..-0.2
            };
            assert!(expected.contains(&off), "{} {degrees}: {off}", law.name);
        }
    }
}

/// The thesis' own figures for strips with its constants: 18 % (NCF) too stiff, tip of the woven 4 mm too
/// high. The elastica of the printed laws says the same, so it is the same law.
#[test]
fn strips_with_the_printed_constants_hang_less_than_with_the_printed_laws_as_the_thesis_found() {
    let mut differences = Vec::new();
    for law in &BENDING {
        let b = law.standard[0];
        let tip = |e: Elastica| e.deflection[e.deflection.len() - 1];
        let (own, constant) = (
            tip(law.strip()),
            tip(elastica(&|k| [b * k, b], law.weight(), law.overhang, 2000)),
        );
        println!(
            "{}: tip {:.2} mm, with a constant {:.2} mm",
            law.name,
            1e3 * own,
            1e3 * constant
        );
        differences.push((own - constant, 1.0 - constant / own));
    }
    assert!((3e-3..5e-3).contains(&differences[0].0), "{differences:?}");
    assert!((0.16..0.21).contains(&differences[1].1), "{differences:?}");
    assert!((0.12..0.18).contains(&differences[2].1), "{differences:?}");
}

#[test]
fn the_formulas_are_as_near_the_elastica_of_a_constant_stiffness_as_is_said() {
    let error = |formula, degrees: f64| {
        let overhang = overhang_at(&|k| [0.0038 * k, 0.0038], 4.315, degrees.to_radians());
        let b = stiffness(formula, overhang, degrees.to_radians(), 4.315).unwrap();
        println!(
            "constant B at {degrees} deg: {formula:?} gives {:+.2} %",
            100.0 * (b / 0.0038 - 1.0)
        );
        b / 0.0038 - 1.0
    };
    assert!(error(Formula::Standard, 41.5).abs() < 2e-3);
    assert!(error(Formula::Peirce, 7.1).abs() < 3e-3);
    // Peirce's formula is too stiff at the standard's own angle.
    assert!((0.05..0.065).contains(&error(Formula::Peirce, 41.5)));
}
