//! A strip clamped at both ends that is shortened until it stands as a hairpin: the force of the elastica, from both shells and from
//! coarse meshes too.

mod common;

use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::MechanicsError;
use plyflow_mechanics::component::ElementInstance;
use plyflow_mechanics::history::smooth_step;
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::model::{Drive, Model, StepSettings};
use plyflow_mechanics::sheet::SheetSpec;

/// Length (m) and bending stiffness (N m) of the strip.
const LENGTH: f64 = 0.1;
const STIFFNESS: f64 = 5e-3;
/// Shortening over length, and the force over Euler's `4 pi^2 B / L^2`: with m = k^2 from `1 - u = 2 E(m) / K(m) - 1`, the force is
/// `(2 K(m) / pi)^2` (the clamped elastica is four equal arcs).
const ELASTICA: [(f64, f64); 3] = [(0.05, 1.0257), (0.1, 1.0530), (0.2, 1.1127)];
/// Time of a shortening, and of the rest after it (s); the strip's slowest period is 40 ms.
const RAMP: f64 = 0.1;
const HOLD: f64 = 0.15;

fn way(t: f64) -> f64 {
    let (mut way, mut last) = (0.0, 0.0);
    for (i, (u, _)) in ELASTICA.iter().enumerate() {
        way += (u - last) * smooth_step(t, i as f64 * (RAMP + HOLD), RAMP);
        last = *u;
    }
    way * LENGTH
}

/// Both ends, without rotation; the right one comes nearer.
struct Ends(Vec<Vec3>);

impl Drive for Ends {
    fn position(&self, k: usize, t: f64) -> Vec3 {
        let p = self.0[k];
        let by = if p[0] > 0.5 * LENGTH { way(t) } else { 0.0 };
        [p[0] - by, p[1], p[2]]
    }

    fn spin(&self, _: usize, _: f64) -> Option<Vec3> {
        Some([0.0; 3])
    }
}

/// Two elements wide, `n` long between the clamps.
fn strip(element: ElementInstance, n: usize) -> (Model, Vec<usize>) {
    let h = LENGTH / n as f64;
    // A shell without rotations is clamped in the middle between two held nodes.
    let off = if element.sizes.patch_nodes > 0 {
        0.5
    } else {
        0.0
    };
    let around = (3.0 - off) * h;
    let columns = n + 6 - (2.0 * off) as usize;
    let xs: Vec<f64> = (0..=columns).map(|i| h * i as f64 - around).collect();
    let mesh = QuadMesh::grid(&xs, &even_axis(0.0, 2.0 * h, h));
    let patches = if off > 0.0 {
        mesh.patches()
    } else {
        Vec::new()
    };
    let spec = SheetSpec {
        patches,
        ..common::sheet("strip", &mesh, 0, element)
    };
    let settings = StepSettings {
        target_step: 5e-6,
        safety: 0.8,
        damping: 60.0,
    };
    let mut model = Model::new(mesh.points.clone(), vec![spec], settings).unwrap();
    let edge = off * h + 1e-9;
    let held = |x: f64| x < edge || x > LENGTH - edge;
    let driven: Vec<u32> = (0..mesh.points.len() as u32)
        .filter(|i| held(mesh.points[*i as usize][0]))
        .collect();
    let places: Vec<Vec3> = driven.iter().map(|n| mesh.points[*n as usize]).collect();
    let right = (0..places.len()).filter(|k| places[*k][0] > 0.5 * LENGTH);
    let right = right.collect();
    model.set_driven(driven, Box::new(Ends(places)));
    (model, right)
}

/// Force over Euler's at each shortening, the mean over the last fifth of the rest.
fn forces(element: ElementInstance, n: usize) -> Vec<f64> {
    let (mut model, right) = strip(element, n);
    let width = 2.0 * LENGTH / n as f64;
    let euler = 4.0 * std::f64::consts::PI.powi(2) * STIFFNESS / (LENGTH * LENGTH);
    let mut found = Vec::new();
    let (mut sum, mut count) = (0.0, 0.0);
    while found.len() < ELASTICA.len() {
        // A breath of weight tells the strip which way to go.
        let t = model.time();
        model.set_body_acceleration([0.0, 0.0, 0.5 * (1.0 - smooth_step(t, 0.05, 0.1))]);
        model.step(false).unwrap();
        let end = (found.len() + 1) as f64 * (RAMP + HOLD);
        if t > end - 0.2 * HOLD {
            sum -= right.iter().map(|k| model.reactions()[*k][0]).sum::<f64>();
            count += 1.0;
        }
        if t > end {
            found.push(sum / count / width / euler);
            (sum, count) = (0.0, 0.0);
        }
    }
    found
}

/// The arcs of a discrete strip are polygons: errors of the second order, at most `c / n^2`. In one thread: the strip is too small to share.
fn follows_the_elastica(element: fn() -> ElementInstance, n: usize, c: f64) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let found = pool.unwrap().install(|| forces(element(), n));
    let most = c / (n * n) as f64;
    for ((u, want), got) in ELASTICA.iter().zip(&found) {
        println!("{n} elements, shortened by {u}: {got:.5}, elastica {want}");
        assert!((got / want - 1.0).abs() < most, "{n} elements, {u}: {got}");
    }
}

#[test]
fn elastica_is_followed_by_the_shell_with_rotations_of_8_elements() {
    follows_the_elastica(common::stiff_shell, 8, 3.5);
}

#[test]
fn elastica_is_followed_by_the_shell_with_rotations_of_10_elements() {
    follows_the_elastica(common::stiff_shell, 10, 3.5);
}

#[test]
fn elastica_is_followed_by_the_shell_with_rotations_of_20_and_40_elements() {
    follows_the_elastica(common::stiff_shell, 20, 3.5);
    follows_the_elastica(common::stiff_shell, 40, 3.5);
}

#[test]
fn elastica_is_followed_by_the_rotation_free_shell_of_10_and_20_elements() {
    follows_the_elastica(common::rotation_free, 10, 10.0);
    follows_the_elastica(common::rotation_free, 20, 10.0);
}

#[test]
fn strip_too_coarse_for_its_arc_stops_and_says_where() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let ended = pool.unwrap().install(|| {
        // Four elements over a hairpin: each would have to bend by a right angle.
        let (mut model, _) = strip(common::stiff_shell(), 4);
        loop {
            let t = model.time();
            model.set_body_acceleration([0.0, 0.0, 0.5 * (1.0 - smooth_step(t, 0.05, 0.1))]);
            if let Err(e) = model.step(false) {
                return Some(e);
            }
            if model.time() > 3.0 * (RAMP + HOLD) {
                return None;
            }
        }
    });
    match ended.expect("it stops") {
        MechanicsError::Distorted {
            sheet, place, time, ..
        } => {
            assert_eq!(sheet, "strip");
            assert!(
                (0.0..LENGTH).contains(&place[0]) && time > RAMP,
                "{place:?} at {time}"
            );
        }
        e => panic!("{e}"),
    }
}
