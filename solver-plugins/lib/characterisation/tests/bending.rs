//! Profiles of strips whose law is known, solved as an ODE: the law must come back.

use plyflow_characterisation::bending::{Bending, characterise};
use plyflow_characterisation::profile::{Choice, Method, Profile};
use plyflow_characterisation::synthetic::{BENDING, PublishedBending};
use plyflow_characterisation::voce::Saturation;

const CHOICE: Choice = Choice {
    method: Method::TangentAngle,
    degree: None,
    maximum_degree: 20,
    trim: 0.0,
    overhang: None,
};

fn profile(law: &PublishedBending, noise: f64, seed: u64) -> Profile {
    let [x, z] = law.scan(0.5e-3, noise, seed);
    Profile::new(&x, &z, 1e-3, &|i| format!("point {i}")).unwrap()
}

/// Root mean square of M(k) found / true - 1, evenly from 5 to 100 % of the largest curvature.
fn law_error(found: &Bending, law: &PublishedBending) -> f64 {
    let squares = found
        .curvature
        .iter()
        .map(|k| (found.voce.law.moment(*k) / law.moment(*k) - 1.0).powi(2));
    (squares.sum::<f64>() / found.curvature.len() as f64).sqrt()
}

fn report(what: &str, found: &Bending, law: &PublishedBending) -> f64 {
    let error = law_error(found, law);
    let [r0, r_inf, limit] = law.numbers;
    let l = found.voce.law;
    let off = [
        l.linear / (r0 * 1e-3),
        l.asymptote / r_inf,
        l.scale / (limit * 1e3),
    ]
    .map(|r| 100.0 * (r - 1.0));
    println!(
        "{} {what}: degree {}, rms {:.2e} mm, k to {:.3} 1/mm, M(k) off by {:.3} % rms (told {:.3} %), \
         parameters off by {:.1} {:.1} {:.1} % (told {:.1} {:.1} {:.1}), condition {:.0} of the law, {:.1e} of the fit",
        law.name,
        found.specimens[0].profile.degree,
        1e3 * found.specimens[0].profile.rms,
        1e-3 * found.curvature.last().unwrap(),
        100.0 * error,
        100.0 * found.relative_error,
        off[0],
        off[1],
        off[2],
        100.0 * found.parameter_error[0].unwrap_or(f64::NAN),
        100.0 * found.parameter_error[1].unwrap_or(f64::NAN),
        100.0 * found.parameter_error[2].unwrap_or(f64::NAN),
        found.voce.condition,
        found.specimens[0].profile.condition
    );
    error
}

#[test]
fn the_law_of_a_strip_solved_as_an_ode_comes_back_within_one_percent() {
    for law in &BENDING {
        for method in [Method::TangentAngle, Method::Deflection] {
            let found = characterise(
                &[profile(law, 0.0, 1)],
                law.weight(),
                &Choice { method, ..CHOICE },
            )
            .unwrap();
            // Up to the root, whatever the polynomial has at the clamp.
            let root = law.strip().curvature[0];
            let reached = found.curvature.last().unwrap() / root;
            assert!((reached - 1.0).abs() < 0.005, "{}: {reached}", law.name);
            let error = report(&format!("{method:?} exact"), &found, law);
            assert!(error < 0.01, "{} {method:?}: {error}", law.name);
            assert!(error < 2e-4, "{}: {error}", law.name);
            assert!(found.specimens[0].profile.monotone);
            assert!(
                (found.specimens[0].profile.length / law.overhang - 1.0).abs() < 1e-4,
                "{}",
                found.specimens[0].profile.length
            );
        }
    }
}

#[test]
fn moment_and_curvature_along_the_strip_are_those_of_the_ode() {
    for law in &BENDING {
        let found = characterise(&[profile(law, 0.0, 1)], law.weight(), &CHOICE).unwrap();
        let strip = law.strip();
        let s = &found.specimens[0].profile.stations;
        for i in s.inner(0.05) {
            let j = (s.arc[i] / law.overhang * 2000.0).round() as usize;
            let (k, m) = (strip.curvature[j], strip.moment[j]);
            assert!(
                (found.specimens[0].moment[i] - m).abs() < 2e-3 * strip.moment[0],
                "{} {i}",
                law.name
            );
            assert!(
                (s.curvature[i] - k).abs() < 0.02 * strip.curvature[0],
                "{} {i} {} {k}",
                law.name,
                s.curvature[i]
            );
        }
    }
}

#[test]
fn noise_of_a_scanner_hurts_the_parameters_much_more_than_the_law() {
    for law in &BENDING {
        for noise in [0.01e-3, 0.05e-3, 0.1e-3] {
            let mut worst = (0.0f64, 0.0f64);
            for seed in 1..=3 {
                let found =
                    characterise(&[profile(law, noise, seed)], law.weight(), &CHOICE).unwrap();
                let error = report(&format!("{:.2} mm", 1e3 * noise), &found, law);
                let linear = (found.voce.law.linear / (law.numbers[0] * 1e-3) - 1.0).abs();
                worst = (worst.0.max(error), worst.1.max(linear));
                let rms = found.specimens[0].profile.rms;
                assert!((rms / noise - 1.0).abs() < 0.15, "{rms}");
                assert!(error < 0.02, "{} {noise}: {error}", law.name);
            }
            assert!(worst.1 > 4.0 * worst.0, "{} {noise}: {worst:?}", law.name);
        }
    }
}

/// `law` with all moments times `factor`.
fn times(law: &PublishedBending, factor: f64) -> PublishedBending {
    let [r0, r_inf, limit] = law.numbers;
    PublishedBending {
        numbers: [factor * r0, factor * r_inf, limit],
        ..*law
    }
}

#[test]
fn strips_of_different_stiffness_give_their_mean_law_and_their_spread_is_told() {
    const FACTORS: [f64; 3] = [0.82, 0.95, 1.10];
    let law = &BENDING[1];
    let strips: Vec<Profile> = (1..)
        .zip(FACTORS)
        .map(|(seed, f)| profile(&times(law, f), 0.02e-3, seed))
        .collect();
    let found = characterise(&strips, law.weight(), &CHOICE).unwrap();
    let mean = FACTORS.iter().sum::<f64>() / 3.0;
    for k in [5.0, 20.0, 40.0] {
        let ratio = found.voce.law.moment(k) / (mean * law.moment(k));
        println!("three strips: M at {k} 1/m is {ratio:.3} of the mean law's");
        assert!((ratio - 1.0).abs() < 0.02, "{k}: {ratio}");
    }
    let squares = FACTORS.map(|f| (f / mean - 1.0).powi(2));
    let standard_error = (squares.iter().sum::<f64>() / 2.0 / 3.0).sqrt();
    let told = found.relative_error;
    println!("three strips: error told {told:.4}, of the mean {standard_error:.4}");
    // Student's quantile of two degrees of freedom: at 95 %.
    assert!(
        (told / (4.303 * standard_error) - 1.0).abs() < 0.1,
        "{told}"
    );
}

#[test]
fn several_specimens_give_one_law() {
    let law = &BENDING[2];
    let specimens: Vec<Profile> = (1..=4).map(|seed| profile(law, 0.05e-3, seed)).collect();
    let all = characterise(&specimens, law.weight(), &CHOICE).unwrap();
    assert!(law_error(&all, law) < 0.01, "{}", law_error(&all, law));
    for s in &all.specimens {
        let length = s.profile.length;
        assert!((length - law.overhang).abs() < 0.2e-3, "{length}");
    }
}

#[test]
fn strips_of_different_overhang_give_one_law() {
    let law = &BENDING[1];
    let strips: Vec<Profile> = [0.15, 0.21, 0.25]
        .map(|overhang| profile(&PublishedBending { overhang, ..*law }, 0.0, 1))
        .into();
    let found = characterise(&strips, law.weight(), &CHOICE).unwrap();
    assert!(law_error(&found, law) < 0.01, "{}", law_error(&found, law));
}

#[test]
fn a_scan_that_misses_the_tip_is_mended_by_the_overhang() {
    let law = &BENDING[1];
    let [x, z] = law.scan(0.5e-3, 0.0, 1);
    let kept = x.len() - 20;
    let short = Profile::new(&x[..kept], &z[..kept], 1e-3, &|i| i.to_string()).unwrap();
    for method in [Method::TangentAngle, Method::Deflection] {
        let choice = Choice { method, ..CHOICE };
        let blind = characterise(std::slice::from_ref(&short), law.weight(), &choice).unwrap();
        let told = Choice {
            overhang: Some(law.overhang),
            ..choice
        };
        let mended = characterise(std::slice::from_ref(&short), law.weight(), &told).unwrap();
        let (blind, mended) = (law_error(&blind, law), law_error(&mended, law));
        println!("{method:?}: 10 mm of the tip missing: {blind:.4}, mended {mended:.4}");
        assert!(mended < 0.01 && blind > 2.0 * mended, "{blind} {mended}");
        let wrong = Choice {
            overhang: Some(0.15),
            ..choice
        };
        let e = characterise(std::slice::from_ref(&short), law.weight(), &wrong).unwrap_err();
        assert!(e.contains("`overhang` is 150.00 mm"), "{e}");
    }
}

#[test]
fn a_linear_law_comes_back_and_is_said_to_have_no_saturation() {
    let strip =
        plyflow_characterisation::synthetic::elastica(&|k| [0.0038 * k, 0.0038], 4.315, 0.21, 2000);
    let [x, z]: [Vec<f64>; 2] = [0, 1].map(|d| {
        (0..=420)
            .map(|i| strip.at(0.5e-3 * f64::from(i))[d] * [1.0, -1.0][d])
            .collect()
    });
    let p = Profile::new(&x, &z, 1e-3, &|i| i.to_string()).unwrap();
    let found = characterise(&[p], 4.315, &CHOICE).unwrap();
    let k = *found.curvature.last().unwrap();
    assert!(
        (found.voce.law.moment(k) / (0.0038 * k) - 1.0).abs() < 2e-3,
        "{:?}",
        found.voce
    );
    assert!(
        found.voce.condition > 100.0 || found.voce.saturation != Saturation::Determined,
        "{:?}",
        found.voce
    );
}

#[test]
fn profiles_that_are_none_are_refused_with_their_place() {
    let [x, z] = BENDING[0].scan(1e-3, 0.0, 1);
    let place = |i: usize| format!("p.csv:{}", i + 2);
    let refused = |x: &[f64], z: &[f64]| Profile::new(x, z, 1e-3, &place).unwrap_err();
    let e = refused(&x[..8], &z[..8]);
    assert!(e.contains("8 points") && e.contains("at least 12"), "{e}");
    let shifted: Vec<f64> = x.iter().map(|v| v + 0.02).collect();
    let e = refused(&shifted, &z);
    assert!(
        e.starts_with("p.csv:2: the profile starts at x = 20.000 mm") && e.contains("clamp"),
        "{e}"
    );
    let mut back = x.clone();
    back.swap(60, 70);
    let mut height = z.clone();
    height.swap(60, 70);
    let e = refused(&back, &height);
    assert!(e.contains("turn back") && e.starts_with("p.csv:6"), "{e}");
    let up: Vec<f64> = z.iter().map(|v| -v).collect();
    assert!(refused(&x, &up).contains("rises from the clamp"));
    let mut nan = z.clone();
    nan[5] = f64::NAN;
    assert!(refused(&x, &nan).starts_with("p.csv:7"));
    let still = vec![0.0; 20];
    assert!(Profile::new(&still, &still, 1e-3, &place).is_err());
}

#[test]
fn a_degree_that_cannot_be_is_refused() {
    let p = profile(&BENDING[0], 0.0, 1);
    let e = characterise(
        &[p],
        2.0,
        &Choice {
            degree: Some(3),
            ..CHOICE
        },
    )
    .unwrap_err();
    assert!(e.contains("the least of `fit: tangent-angle` is 4"), "{e}");
    let [x, z] = BENDING[0].scan(10e-3, 0.0, 1);
    let few = Profile::new(&x, &z, 1e-3, &|i| i.to_string()).unwrap();
    assert!(
        characterise(
            &[few],
            2.0,
            &Choice {
                degree: Some(20),
                ..CHOICE
            }
        )
        .is_err()
    );
}
