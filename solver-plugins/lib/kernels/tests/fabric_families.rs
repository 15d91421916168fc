//! Families that differ: each has its own modulus, in tension and in compression, as in a unidirectional ply.

mod common;
mod fabric_support;
use common::*;
use fabric_support::*;
use serde_json::{Value, json};

const THICKNESS: f64 = 4e-4;
/// k = E h of both families in tension (N/m).
const K: [f64; 2] = [3e9 * THICKNESS, 6e6 * THICKNESS];
/// Share of it in compression.
const PUSHED: [f64; 2] = [0.1, 0.4];

fn unidirectional(form: &str) -> Value {
    let mut ply = sheet(
        form,
        &json!({"coefficients": [0.0, 60.0, 0.0, 120.0]}),
        None,
    );
    ply["fibre_modulus_2"] = json!(6e6);
    ply["compression_factor"] = json!(PUSHED[0]);
    ply["compression_factor_2"] = json!(PUSHED[1]);
    ply
}

fn force(g: f64) -> f64 {
    60.0 * g + 120.0 * g.powi(3)
}

fn stiffness(family: usize, stretch: f64) -> f64 {
    K[family] * if stretch < 1.0 { PUSHED[family] } else { 1.0 }
}

#[test]
fn stress_and_energy_of_each_family_are_those_of_its_own_modulus() {
    let m = build(&unidirectional("fibre-energy"));
    for (l1, l2, g) in [
        (1.002, 1.03, 0.3),
        (0.997, 1.03, -0.4),
        (1.002, 0.96, 0.3),
        (0.997, 0.96, 0.0),
    ] {
        let a = Point::new(&m).at(&m, metric(l1, l2, g));
        let [k1, k2] = [stiffness(0, l1), stiffness(1, l2)];
        let shear = force(g) * g.sin();
        let wanted = [
            k1 * (l1 - 1.0) / l1 - shear / (l1 * l1),
            k2 * (l2 - 1.0) / l2 - shear / (l2 * l2),
            force(g) / (l1 * l2),
        ];
        for (got, want) in a.stress.iter().zip(wanted) {
            assert!(
                (got - want).abs() < 1e-9 * (1.0 + want.abs()),
                "{got} {want}"
            );
        }
        // Phi: the integral of F cos g.
        let n = 2000;
        let h = g / n as f64;
        let place = |i: usize| (i as f64 + 0.5) * h;
        let phi: f64 = (0..n).map(|i| force(place(i)) * place(i).cos() * h).sum();
        let fibres = 0.5 * (k1 * (l1 - 1.0).powi(2) + k2 * (l2 - 1.0).powi(2));
        assert!(
            (a.energy - fibres - phi).abs() < 1e-5 * (1.0 + fibres),
            "{}",
            a.energy
        );
    }
}

#[test]
fn stress_is_the_gradient_of_the_energy_and_its_tangent_is_bounded() {
    let m = build(&unidirectional("fibre-energy"));
    let mut r = Random(11);
    for _ in 0..200 {
        let c = metric(1.0 + 0.01 * r.next(), 1.0 + 0.05 * r.next(), r.next());
        let p = Point::new(&m);
        let a = p.peek(&m, c);
        let size = a.stress.iter().fold(1.0f64, |s, x| s.max(x.abs()));
        for k in 0..3 {
            let h = 1e-6;
            let at = |f: f64| {
                let mut x = c;
                x[k] += f * h;
                p.peek(&m, x)
            };
            let d = (at(1.0).energy - at(-1.0).energy) / (2.0 * h);
            let s = if k < 2 { 2.0 * d } else { d };
            assert!(
                (s - a.stress[k]).abs() < 1e-4 * size,
                "{c:?}: {s} {:?}",
                a.stress
            );
            // E = (C - 1) / 2: of the shear both E12 and E21 grow.
            let steps = if k < 2 { 0.5 } else { 1.0 };
            let slope = (at(1.0).stress[k] - at(-1.0).stress[k]) / (2.0 * h * steps);
            assert!(
                slope < 1.001 * a.stiffness[0],
                "{c:?}: {slope} {}",
                a.stiffness[0]
            );
        }
    }
}

#[test]
fn a_second_family_that_says_what_the_first_does_changes_no_bit() {
    for form in FORMS {
        let shear = json!({"coefficients": NCF_YARN});
        let mut plain = sheet(form, &shear, Some(stitch("positive")));
        plain["compression_factor"] = json!(0.3);
        let mut twice = plain.clone();
        twice["fibre_modulus_2"] = json!(3e9);
        twice["compression_factor_2"] = json!(0.3);
        let (a, b) = (build(&plain), build(&twice));
        let (mut p, mut q) = (Point::new(&a), Point::new(&b));
        let mut r = Random(12);
        let mut g = 0.0f64;
        for _ in 0..500 {
            g = (g + 0.05 * r.next()).clamp(-1.1, 1.1);
            let c = metric(1.0 + 0.003 * r.next(), 1.0 + 0.003 * r.next(), g);
            assert_eq!(p.at(&a, c), q.at(&b, c), "{form}");
        }
    }
}

/// The form `hypoelastic` adds up `k dl / l`: each family has `k ln l` over `C`.
#[test]
fn each_family_of_the_hypoelastic_form_adds_up_its_own_modulus() {
    let m = build(&unidirectional("hypoelastic"));
    for (l1, l2) in [(1.004, 1.05), (0.996, 1.05), (1.004, 0.95)] {
        let mut p = Point::new(&m);
        let mut stress = [0.0; 3];
        for i in 1..=100 {
            let t = f64::from(i) / 100.0;
            let c = metric(1.0 + t * (l1 - 1.0), 1.0 + t * (l2 - 1.0), 0.0);
            stress = p.at(&m, c).stress;
        }
        for (family, l) in [l1, l2].into_iter().enumerate() {
            let wanted = stiffness(family, l) * f64::ln(l) / (l * l);
            let got = stress[family];
            assert!(
                (got / wanted - 1.0).abs() < 1e-5,
                "{l1} {l2}: {got} {wanted}"
            );
        }
    }
}

/// Along a path like that of a test off the fibres. True and nominal strains, and what they are divided by, differ by one and a half
/// times the strain, which is 0.3 % here at most.
#[test]
fn both_forms_agree_while_a_unidirectional_ply_is_pulled_off_its_fibres() {
    let [a, b] = FORMS.map(|form| build(&unidirectional(form)));
    let (mut p, mut q) = (Point::new(&a), Point::new(&b));
    let (mut apart, mut size) = ([0.0f64; 3], [0.0f64; 3]);
    for i in 1..=500 {
        let t = f64::from(i) / 500.0;
        let c = metric(1.0 + 0.001 * t, 1.0 + 0.002 * t, -0.12 * t);
        let (x, y) = (p.at(&a, c).stress, q.at(&b, c).stress);
        for k in 0..3 {
            apart[k] = apart[k].max((x[k] - y[k]).abs());
            size[k] = size[k].max(x[k].abs());
        }
    }
    println!("apart {apart:?} N/m of {size:?} N/m");
    for k in 0..3 {
        assert!(apart[k] < 0.01 * size[k], "{k}: {apart:?} of {size:?}");
    }
}

#[test]
fn a_modulus_of_nothing_and_a_factor_above_one_are_refused_by_name() {
    for (key, value, text) in [
        ("fibre_modulus_2", 0.0, "fibre_modulus_2: given 0 Pa"),
        (
            "compression_factor_2",
            1.5,
            "compression_factor_2: given 1.5; expected 0 to 1",
        ),
    ] {
        let mut ply = unidirectional("fibre-energy");
        ply[key] = json!(value);
        let error = fabric(&ply.to_string()).err().unwrap();
        assert!(error.contains(text), "{error}");
    }
}
