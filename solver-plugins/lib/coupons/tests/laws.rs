//! Coupons of laws against closed forms: a unidirectional ply off its fibres, and loops with friction between the yarns. The
//! closed forms are those of the workflows' `closed-forms.py`; what is checked of them here is found in another way.

use plyflow_coupons::{
    off_axis::Plugin as OffAxis, picture_frame::Plugin as PictureFrame,
    pure_bending::Plugin as PureBending,
};
use plyflow_kernels::built_in::component;
use plyflow_testing::{Components, Machine, MemoryArtifact, run_on};
use serde_json::{Value, json};
use std::path::Path;

const ALONE: Machine = Machine {
    threads: 1,
    cancelled: false,
    // SAFETY: Plyflow's own, which are static.
    components: unsafe { Components::new(component) },
};

fn element(name: &str) -> Value {
    json!({"plugin": name, "with": {"hourglass": 1.0, "hourglass_floor": 3000.0, "hourglass_normal": 0.01}})
}

fn reference(path: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../workflows/coupons");
    folder.join(path).to_str().unwrap().to_owned()
}

/// As workflows/materials/unidirectional.yaml, with the fibre modulus of the workflow.
fn unidirectional() -> Value {
    json!({
        "plyflow_material": 1, "name": "unidirectional", "plugin": "material-fabric",
        "thickness": "0.0003 m", "areal_mass": "0.3 kg/m2",
        "with": {
            "fibre_modulus": 3e7, "fibre_modulus_2": 6e6, "shear": {"coefficients": [0.0, 60.0, 0.0, 120.0]},
            "bending": {"family_1": {"positive": {"stiffness": 4e-3}}, "family_2": {"positive": {"stiffness": 4e-5}}, "families": "same"}
        }
    })
}

/// Stretch along the pull.
fn stretch(angle: f64, [l1, l2, g]: [f64; 3]) -> f64 {
    let (c, s) = (angle.cos(), angle.sin());
    (c * c * l1 * l1 + s * s * l2 * l2 - 2.0 * c * s * l1 * l2 * g.sin()).sqrt()
}

/// Energy of the law and of the load (J/m2): least where the strip is at rest.
fn potential(angle: f64, force: f64, at: [f64; 3]) -> f64 {
    let [l1, l2, g] = at;
    // Phi: the integral of (60 g + 120 g^3) cos g.
    let phi = 60.0 * (g * g.sin() + g.cos() - 1.0)
        + 120.0
            * (g.powi(3) * g.sin() + 3.0 * g * g * g.cos() - 6.0 * g * g.sin() - 6.0 * g.cos()
                + 6.0);
    let fibres = 0.5 * 3e7 * 3e-4 * (l1 - 1.0).powi(2) + 0.5 * 6e6 * 3e-4 * (l2 - 1.0).powi(2);
    fibres + phi - force * stretch(angle, at)
}

/// The state of least potential, by Newton's method on differences.
fn at_rest(angle: f64, force: f64) -> [f64; 3] {
    let step = [1e-6, 1e-5, 1e-4];
    let mut x = [1.0, 1.0, -0.1];
    for _ in 0..60 {
        let at = |a: usize, da: f64, b: usize, db: f64| {
            let mut y = x;
            y[a] += da * step[a];
            y[b] += db * step[b];
            potential(angle, force, y)
        };
        let slope: [f64; 3] =
            std::array::from_fn(|a| (at(a, 1.0, a, 0.0) - at(a, -1.0, a, 0.0)) / (2.0 * step[a]));
        let mut m: [[f64; 4]; 3] = std::array::from_fn(|a| {
            std::array::from_fn(|b| {
                if b == 3 {
                    return -slope[a];
                }
                let cross = at(a, 1.0, b, 1.0) - at(a, 1.0, b, -1.0) - at(a, -1.0, b, 1.0)
                    + at(a, -1.0, b, -1.0);
                cross / (4.0 * step[a] * step[b])
            })
        });
        // Gauss, without pivots: the matrix is positive.
        for k in 0..3 {
            for i in (0..3).filter(|i| *i != k) {
                let f = m[i][k] / m[k][k];
                let row = m[k];
                (0..4).for_each(|j| m[i][j] -= f * row[j]);
            }
        }
        for k in 0..3 {
            let most = [0.01, 0.05, 0.1][k];
            x[k] += (m[k][3] / m[k][k]).clamp(-most, most);
        }
    }
    x
}

#[test]
fn a_unidirectional_ply_off_its_fibres_lies_where_its_potential_is_least() {
    for (degrees, force) in [(20, 100.0), (45, 60.0), (70, 100.0)] {
        let with = json!({
            "material": unidirectional(), "element": element("m4"), "element_size": 0.01, "fibre_angle": f64::from(degrees).to_radians(),
            "force": force, "steps": 5, "closed_form": reference(&format!("unidirectional/reference/off-axis-{degrees}.csv"))
        });
        let run = run_on::<OffAxis>(&ALONE, with, &[], &[]).unwrap_or_else(|e| panic!("{e}"));
        assert!(
            run.result("strain_error") < 0.01,
            "{degrees}: {}",
            run.result("strain_error")
        );
        assert!(
            run.result("shear_error") < 0.01,
            "{degrees}: {}",
            run.result("shear_error")
        );
        assert!(
            run.result("shear_spread") < 1e-3,
            "{degrees}: {}",
            run.result("shear_spread")
        );
        let angle = f64::from(degrees).to_radians();
        let at = at_rest(angle, force);
        let strain = stretch(angle, at) - 1.0;
        println!(
            "{degrees} deg: {at:?}, strain {strain}, run {} {}",
            run.result("strain"),
            run.result("shear_angle")
        );
        assert!(
            (run.result("strain") / strain - 1.0).abs() < 0.01,
            "{degrees}: {strain}"
        );
        assert!(
            (run.result("shear_angle") / at[2] - 1.0).abs() < 0.01,
            "{degrees}: {at:?}"
        );
        assert!(
            (run.result("fibre_strain_2") / (at[1] - 1.0) - 1.0).abs() < 0.02,
            "{degrees}: {at:?}"
        );
        // The angle between the sides: C_XY over both lengths.
        let ([l1, l2, g], c, s) = (at, angle.cos(), angle.sin());
        let between = c * s * (l1 * l1 - l2 * l2) + (c * c - s * s) * l1 * l2 * g.sin();
        let across = stretch(angle + std::f64::consts::FRAC_PI_2, at);
        let slant = (between / ((1.0 + strain) * across)).asin();
        assert!(
            (run.result("slant") / slant - 1.0).abs() < 0.01,
            "{degrees}: {} {slant}",
            run.result("slant")
        );
    }
}

#[test]
fn forces_that_meet_no_load_step_are_refused() {
    let with = json!({
        "material": unidirectional(), "element": element("m4"), "element_size": 0.02, "fibre_angle": 0.5,
        "force": 7.0, "steps": 1, "closed_form": reference("unidirectional/reference/off-axis-45.csv")
    });
    let error = run_on::<OffAxis>(&ALONE, with, &[], &[]).unwrap_err();
    assert!(
        error.contains("closed_form: no force of its 6 is one of the 1 load steps"),
        "{error}"
    );
}

/// As the workflow's fabric.
fn rubbing(fibre_modulus: f64) -> Value {
    json!({
        "plyflow_material": 1, "name": "rubbing", "plugin": "material-fabric", "thickness": "0.0003 m", "areal_mass": "0.21 kg/m2",
        "with": {
            "fibre_modulus": fibre_modulus,
            "shear": {"coefficients": [0.0, 40.0, 0.0, 60.0],
                      "hysteresis": {"force": 4.0, "angle": f64::to_radians(1.0), "per_tension": 0.002}},
            "bending": {"positive": {"stiffness": 4e-4}, "hysteresis": {"moment": 1e-3, "curvature": 2.0}}
        }
    })
}

fn told(run: &MemoryArtifact) -> String {
    let of = |name: &str| format!("{name} {:?}", run.results.get(name).map(|r| r.0));
    [
        "work_density",
        "dissipation_error",
        "path_error",
        "drift_ratio",
    ]
    .map(of)
    .join(", ")
}

#[test]
fn loops_of_shear_cost_what_the_friction_says_also_under_tension() {
    for (path, strain, cost, name) in [
        (json!([0.4, -0.4, 0.4, 0.0]), 0.0, 8.892_278, "shear"),
        (
            json!([0.0, 0.4, -0.4, 0.4, 0.0]),
            0.01,
            16.119_394,
            "shear-tension",
        ),
    ] {
        let with = json!({
            "material": rubbing(3e8), "element": element("m4"), "element_size": 0.06, "side": 0.06, "path": path, "leg_time": 0.05,
            "fibre_strain": strain, "damping": 0.0, "dissipation": cost,
            "path_reference": reference(&format!("hysteresis/reference/{name}.csv"))
        });
        let run = run_on::<PictureFrame>(&ALONE, with, &[], &[]).unwrap_or_else(|e| panic!("{e}"));
        println!("{name}: {}", told(&run));
        assert!(run.result("dissipation_error") < 0.01, "{}", told(&run));
        assert!(run.result("path_error") < 0.02, "{}", told(&run));
        assert!(run.result("drift_ratio") < 0.01, "{}", told(&run));
    }
}

#[test]
fn a_loop_of_bending_costs_what_the_friction_says() {
    for name in ["rf4", "s4"] {
        let mut shell = element(name);
        if name == "s4" {
            shell = json!({"plugin": "s4", "with": {}});
        }
        let with = json!({
            "material": rubbing(3e7), "element": shell, "element_size": 0.004, "length": 0.04, "width": 0.012,
            "path": [50.0, -50.0, 50.0, 0.0], "leg_time": 0.1, "dissipation": 0.287
        });
        let run = run_on::<PureBending>(&ALONE, with, &[], &[]).unwrap_or_else(|e| panic!("{e}"));
        println!("{name}: {}", told(&run));
        // Elements of 4 mm: (k h)^2 / 24 of the curvature is missing, 0.2 %.
        assert!(
            run.result("dissipation_error") < 0.01,
            "{name}: {}",
            told(&run)
        );
        assert!(run.result("drift_ratio") < 0.01, "{name}: {}", told(&run));
    }
}
