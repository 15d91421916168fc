//! The fully integrated membrane against closed forms.

mod common;
mod s4_support;
use common::*;
use plyflow_kernels::{m4::M4, m4f::M4f};
use s4_support::plate;

const Y: f64 = 2.1e9;
const NU: f64 = 0.3;
const H: f64 = 1e-3;
const AXIS: [f64; 3] = [1.0, 0.0, 0.0];
const ALONG: &str = r#"{"fibres_along_sides": true}"#;

fn square(side: f64) -> Quad {
    let a = 0.5 * side;
    [[-a, -a, 0.0], [a, -a, 0.0], [a, a, 0.0], [-a, a, 0.0]]
}

/// Energy per area of a plate in plane stress with these Green's strains.
fn density([e11, e22, e12]: [f64; 3]) -> f64 {
    let d = Y * H / (1.0 - NU * NU);
    0.5 * d * (e11 * e11 + e22 * e22 + 2.0 * NU * e11 * e22 + 2.0 * (1.0 - NU) * e12 * e12)
}

#[test]
fn a_homogeneous_deformation_of_any_flat_quad_is_exact() {
    let mut r = Random(5);
    let m = plate(Y, NU, H);
    let e = El::new::<M4f>("{}", &m).unwrap();
    let reference: Vec<Quad> = (0..8).map(|_| flat(&mut r, 0.3)).collect();
    let mut batch = e.initialise(&reference, &[AXIS; 8]);
    let f: [[f64; 2]; 2] = [[1.03, 0.02], [-0.01, 0.97]];
    let moved = |p: [f64; 3]| {
        [
            f[0][0] * p[0] + f[0][1] * p[1],
            f[1][0] * p[0] + f[1][1] * p[1],
            p[2],
        ]
    };
    let x: Vec<Quad> = reference.iter().map(|q| q.map(moved)).collect();
    let found = e.forces(&mut batch, &x);
    let c = |i: usize, j: usize| f[0][i] * f[0][j] + f[1][i] * f[1][j];
    let wanted = density([0.5 * (c(0, 0) - 1.0), 0.5 * (c(1, 1) - 1.0), 0.5 * c(0, 1)]);
    for (l, q) in reference.iter().enumerate() {
        let (d, e) = (
            [q[2][0] - q[0][0], q[2][1] - q[0][1]],
            [q[3][0] - q[1][0], q[3][1] - q[1][1]],
        );
        let area = 0.5 * (d[0] * e[1] - d[1] * e[0]);
        // The material's axes lie along x and y, in which the deformation is written, only for flat elements whose plane is x-y.
        let energy = total(&found, 8, l);
        assert!(
            (energy / (wanted * area) - 1.0).abs() < 1e-9,
            "{energy} {}",
            wanted * area
        );
    }
}

/// u = k x y along x in a square: all nodes move by the hourglass mode alone. Linear elasticity stores `Y h / (2 (1 - nu^2)) k^2 I (1 + (1 - nu) / 2)`
/// with `I = a^4 / 12`, which two points a side integrate exactly.
#[test]
fn the_hourglass_mode_has_the_stiffness_of_the_material() {
    let side = 0.01;
    let m = plate(Y, NU, H);
    let k = 1e-4 / side;
    let bent = square(side).map(|p| [p[0] + k * p[0] * p[1], p[1], p[2]]);
    let energy = |e: &El| {
        let mut batch = e.initialise(&[square(side); 8], &[AXIS; 8]);
        total(&e.forces(&mut batch, &[bent; 8]), 8, 0)
    };
    let inertia = side.powi(4) / 12.0;
    let closed = Y * H / (2.0 * (1.0 - NU * NU)) * k * k * inertia * (1.0 + 0.5 * (1.0 - NU));
    let found = energy(&El::new::<M4f>("{}", &m).unwrap());
    assert!((found / closed - 1.0).abs() < 1e-3, "{found} {closed}");
    // One point sees nothing of it: what m4 stores is its hourglass control's.
    let free = energy(&El::new::<M4>(r#"{"hourglass": 0, "hourglass_floor": 0}"#, &m).unwrap());
    assert!(free < 1e-6 * closed, "{free}");
}

/// The bound is that of the stiffest state: a square pulled along its largest tangent.
#[test]
fn the_step_is_below_that_of_one_point_and_above_two_thirds_of_it() {
    let m = plate(Y, NU, H);
    let step = |e: &El| {
        let mut batch = e.initialise(&[square(0.01); 8], &[AXIS; 8]);
        e.forces(&mut batch, &[square(0.01); 8]).step[0]
    };
    let soft = r#"{"hourglass": 0, "hourglass_floor": 0}"#;
    let [one, four] = [
        step(&El::new::<M4>(soft, &m).unwrap()),
        step(&El::new::<M4f>("{}", &m).unwrap()),
    ];
    assert!(four < one && four > one / 1.5, "{four} {one}");
}

#[test]
fn a_fabric_is_refused_unless_its_fibres_run_along_the_sides() {
    let error = El::new::<M4f>("{}", &ply()).err().unwrap();
    for part in [
        "locks",
        "times as stiff",
        "Use 'm4'",
        "fibres_along_sides: true",
    ] {
        assert!(error.contains(part), "{part}: {error}");
    }
    assert!(El::new::<M4f>(ALONG, &ply()).is_ok());
}

/// In the mode in which a square bends in its plane, fibres along the diagonals are strained by what the element cannot do otherwise: the
/// energy grows with the fibres' stiffness, though the fabric could shear instead. This is what the refusal is about.
#[test]
fn stiff_fibres_along_the_diagonals_lock_the_mode_in_which_a_square_bends() {
    let side = 0.01;
    let k = 1e-4 / side;
    let bent = square(side).map(|p| [p[0] + k * p[0] * p[1], p[1], p[2]]);
    let energy = |axis: [f64; 3], json: &str| {
        let m = fabric(json).unwrap();
        let e = El::new::<M4f>(ALONG, &m).unwrap();
        let mut batch = e.initialise(&[square(side); 8], &[axis; 8]);
        total(&e.forces(&mut batch, &[bent; 8]), 8, 0)
    };
    let soft = r#"{"fibre_modulus":3e6,"shear":{"coefficients":[0,100]},"thickness":4e-4,"areal_mass":0.44}"#;
    let stiff = soft.replace("3e6", "3e9");
    let r = 0.5f64.sqrt();
    let grows = energy([r, r, 0.0], &stiff) / energy([r, r, 0.0], soft);
    assert!(grows > 500.0, "{grows}");
}

#[test]
fn a_parameter_that_it_does_not_have_is_refused_by_name() {
    let error = El::new::<M4f>(r#"{"hourglass": 1}"#, &ply()).err().unwrap();
    assert!(
        error.contains("'m4f'") && error.contains("hourglass"),
        "{error}"
    );
}
