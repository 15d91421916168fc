//! Supports, loads and static equilibrium of a model, against closed forms.

mod common;

use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::MechanicsError;
use plyflow_mechanics::archive::Archive;
use plyflow_mechanics::history::smooth_step;
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::model::{Drive, Fixed, Hold, Model, NodalLoad, StepSettings};
use plyflow_mechanics::relax::{Tolerance, relax};

struct Clamp(Vec<Vec3>);

impl Drive for Clamp {
    fn position(&self, k: usize, _t: f64) -> Vec3 {
        self.0[k]
    }
}

/// A strip of 0.4 x 0.1 m, 8 x 2 elements, fibres along x and y, held at x = 0; its nodes at the other end.
fn strip() -> (Model, Vec<u32>) {
    damped_strip(0.0)
}

/// The same, damped in proportion to its mass (1/s).
fn damped_strip(damping: f64) -> (Model, Vec<u32>) {
    let mesh = QuadMesh::grid(&even_axis(0.0, 0.4, 0.05), &even_axis(0.0, 0.1, 0.05));
    let spec = common::sheet("strip", &mesh, 0, common::membrane());
    let settings = StepSettings {
        target_step: 0.0,
        safety: 0.8,
        damping,
    };
    let mut model = Model::new(mesh.points.clone(), vec![spec], settings).unwrap();
    let at = |x: f64| -> Vec<u32> {
        (0..mesh.points.len())
            .filter(|n| (mesh.points[*n][0] - x).abs() < 1e-9)
            .map(|n| n as u32)
            .collect()
    };
    let held = at(0.0);
    let points = held.iter().map(|n| mesh.points[*n as usize]).collect();
    model.set_driven(held, Box::new(Clamp(points)));
    (model, at(0.4))
}

const STATIC: Tolerance = Tolerance {
    balance: 1e-7,
    safety: 0.8,
    cycles: 200_000,
};

fn rest(model: &mut Model) {
    let r = relax::<MechanicsError>(model, STATIC, |_| Ok(())).unwrap();
    assert!(r.balanced, "{r:?}");
}

#[test]
fn nodal_loads_stretch_a_strip_by_hookes_law_and_the_support_carries_them() {
    let (mut model, end) = strip();
    let total = 20.0;
    let loads = end.iter().enumerate().map(|(j, n)| NodalLoad {
        node: *n,
        force: [if j == 1 { 0.5 } else { 0.25 }, 0.0, 0.0],
        moment: [0.0; 3],
    });
    model.set_loads(loads.collect());
    model.set_load_factor(total);
    rest(&mut model);
    // F = k w (l - 1) with k = 1e5 N/m over the width of 0.1 m.
    let expected = 0.4 * total / (1e5 * 0.1);
    for n in end {
        let u = model.x()[n as usize][0] - 0.4;
        assert!(
            (u / expected - 1.0).abs() < 1e-5,
            "{u} instead of {expected}"
        );
    }
    let support: f64 = model.reactions().iter().map(|r| r[0]).sum();
    assert!((support + total).abs() < 1e-4 * total, "{support} N");
}

#[test]
fn weight_of_a_hanging_strip_is_carried_by_its_support() {
    let (mut model, end) = strip();
    model.set_body_acceleration([9.81, 0.0, 0.0]);
    rest(&mut model);
    let weight = 0.4 * 0.1 * 9.81;
    let support: f64 = model.reactions().iter().map(|r| r[0]).sum();
    assert!((support + weight).abs() < 1e-4 * weight, "{support} N");
    // u(L) = w L^2 / (2 k), and one-point elements with lumped masses give it exactly at the nodes.
    let expected = 9.81 * 0.4 * 0.4 / (2.0 * 1e5);
    let u = model.x()[end[1] as usize][0] - 0.4;
    assert!(
        (u / expected - 1.0).abs() < 1e-3,
        "{u} instead of {expected}"
    );
}

#[test]
fn fixed_components_stay_where_they_are() {
    let (mut model, end) = strip();
    let fixed = Fixed {
        translations: [true, false, false],
        rotations: [false; 3],
    };
    for n in &end {
        model.fix(*n, fixed);
    }
    model.set_body_acceleration([3.0, 5.0, 0.0]);
    let start = model.x().to_vec();
    rest(&mut model);
    for n in end.iter().map(|n| *n as usize) {
        assert_eq!(model.x()[n][0], start[n][0]);
        assert_ne!(model.x()[n][1], start[n][1]);
    }
    // The other components are free: weight along y sags the end.
    let lowest = model.x()[end[0] as usize][1];
    assert!(lowest > 1e-6, "{lowest} m");
}

#[test]
fn work_of_weight_and_loads_balances_the_energies() {
    let (mut model, end) = strip();
    model.set_body_acceleration([9.81, 2.0, 0.0]);
    model.set_loads(vec![NodalLoad {
        node: end[1],
        force: [1.0, 0.5, 0.0],
        moment: [0.0; 3],
    }]);
    model.set_step(0.5 * model.critical_step().unwrap());
    let mut largest = 0.0f64;
    for _ in 0..4000 {
        model.step(false).unwrap();
        let l = model.energies();
        largest = largest.max(l.drift().abs() / l.external.abs().max(1e-3));
    }
    assert!(largest < 2e-2, "{largest}");
}

/// Nodes whose surroundings pull along x and out of the plane, and hold them more stiffly the further they go.
struct Surroundings {
    at: Vec<Vec3>,
    /// (N).
    pull: Vec<f64>,
    /// (N/m).
    stiffness: Vec<f64>,
    /// Goes this far along x (m), from this time on and for so long (s).
    goes: (f64, [f64; 2]),
}

impl Surroundings {
    /// What pulls at the `end` of a strip with 20 N, and holds it with `stiffness` (N/m), over its width.
    fn of(model: &Model, end: &[u32], stiffness: f64, goes: (f64, [f64; 2])) -> Self {
        let share = |j: usize| if j == 1 { 0.5 } else { 0.25 };
        Self {
            at: end.iter().map(|n| model.x()[*n as usize]).collect(),
            pull: (0..end.len()).map(|j| 20.0 * share(j)).collect(),
            stiffness: (0..end.len()).map(|j| stiffness * share(j)).collect(),
            goes,
        }
    }
}

impl Drive for Surroundings {
    fn position(&self, k: usize, t: f64) -> Vec3 {
        let (way, [from, duration]) = self.goes;
        let [x, y, z] = self.at[k];
        [x + way * smooth_step(t, from, duration), y, z]
    }

    fn hold(&self, k: usize, _t: f64) -> Option<Hold> {
        Some(Hold {
            pull: [self.pull[k], 0.0, 3.0 * self.pull[k]],
            stiffness: self.stiffness[k],
            normal: [0.0, 0.0, 1.0],
        })
    }
}

#[test]
fn a_held_node_goes_along_its_sheet_to_where_its_surroundings_and_the_model_balance() {
    for stiffness in [0.0, 4e4, 1e12] {
        let (mut model, end) = damped_strip(500.0);
        let held = Surroundings::of(&model, &end, stiffness, (0.0, [0.0, 1.0]));
        model.drive_also(end.clone(), Box::new(held));
        model.set_step(0.8 * model.critical_step().unwrap());
        for _ in 0..20_000 {
            model.step(false).unwrap();
        }
        // Of the strip: k w / l = 2.5e4 N/m.
        let expected = 20.0 / (1e5 * 0.1 / 0.4 + stiffness);
        for n in end {
            let [x, _, z] = model.x()[n as usize];
            let u = x - 0.4;
            assert!(
                (u / expected - 1.0).abs() < 2e-3,
                "{stiffness}: {u} {expected}"
            );
            assert_eq!(z, 0.0, "not out of its sheet");
        }
    }
}

#[test]
fn a_node_that_was_anchored_is_held_from_where_its_surroundings_and_the_model_were_in_balance() {
    let (strip, stiffness, goes) = (1e5 * 0.1 / 0.4, 4e4, 3e-4);
    let (mut model, end) = damped_strip(500.0);
    model.set_step(0.8 * model.critical_step().unwrap());
    let settling = 20_000.0 * model.dt();
    let when = [2.0 * settling, 0.2 * settling];
    let held = Surroundings::of(&model, &end, stiffness, (goes, when));
    model.drive_also(end.clone(), Box::new(held));
    let ends = |model: &mut Model, what: &str, expected: f64| {
        for _ in 0..20_000 {
            model.step(false).unwrap();
        }
        for n in &end {
            let u = model.x()[*n as usize][0] - 0.4;
            assert!((u / expected - 1.0).abs() < 2e-3, "{what}: {u} {expected}");
        }
    };
    // Loose, only the pull counts; anchored there, the stiffness changes nothing until the drive goes on.
    model.loosen();
    let pulled = 20.0 / strip;
    ends(&mut model, "loose", pulled);
    model.anchor();
    ends(&mut model, "anchored", pulled);
    // Then strip and surroundings share what it goes.
    let gone = pulled + stiffness * goes / (strip + stiffness);
    ends(&mut model, "gone on", gone);
    // Another model takes all that up.
    let mut bytes = Vec::new();
    model.archive(&mut Archive::Save(&mut bytes)).unwrap();
    let (mut other, end) = damped_strip(500.0);
    let held = Surroundings::of(&other, &end, stiffness, (goes, when));
    other.drive_also(end.clone(), Box::new(held));
    other.archive(&mut Archive::Load(&bytes)).unwrap();
    for m in [&mut model, &mut other] {
        (0..100).for_each(|_| m.step(false).unwrap());
    }
    assert_eq!(other.x(), model.x());
}

#[test]
fn a_shell_that_is_led_to_a_cylinder_has_the_bending_energy_of_one() {
    // Without a step, over frames, from flat to a part of a cylinder about y, while the whole turns about y, z and x.
    let (radius, frames) = (0.1, 24);
    let mesh = QuadMesh::grid(&even_axis(-0.15, 0.15, 0.01), &even_axis(0.0, 0.1, 0.02));
    // Rolled to `share` of the curvature 1 / radius, and turned by as much about the three axes one after the other.
    let shape = |share: f64, bent: f64| -> Vec<Vec3> {
        let turn = |v: Vec3, a: usize, angle: f64| {
            let (s, c) = angle.sin_cos();
            let (i, j) = ((a + 1) % 3, (a + 2) % 3);
            let mut w = v;
            w[i] = c * v[i] - s * v[j];
            w[j] = s * v[i] + c * v[j];
            w
        };
        let k = bent / radius;
        let rolled = |[x, y, _]: Vec3| {
            let across = if k == 0.0 { x } else { (k * x).sin() / k };
            let up = if k == 0.0 {
                0.0
            } else {
                (1.0 - (k * x).cos()) / k
            };
            let v = turn(turn([across, y, up], 1, 1.9 * share), 2, 1.3 * share);
            turn(v, 0, -0.8 * share)
        };
        mesh.points.iter().map(|p| rolled(*p)).collect()
    };
    let bending = |bent: f64| {
        let spec = common::sheet("strip", &mesh, 0, common::stiff_shell());
        let settings = StepSettings {
            target_step: 0.0,
            safety: 0.8,
            damping: 0.0,
        };
        let mut model = Model::new(mesh.points.clone(), vec![spec], settings).unwrap();
        for f in 1..=frames {
            let share = f64::from(f) / f64::from(frames);
            model.lead(shape(share, bent * share), 0.01, &[]).unwrap();
        }
        assert!(model.spins().unwrap().iter().all(|w| *w == [0.0; 3]));
        model.energies().bending
    };
    // Moment 5e-3 N m per radian and metre of width; the free ends' directors are half a cell off.
    let area = 0.3 * 0.1;
    let theory = 0.5 * 5e-3 / (radius * radius) * area;
    let rolled = bending(1.0);
    assert!(
        (rolled / theory - 1.0).abs() < 0.05,
        "{rolled} J instead of {theory} J"
    );
    // Turned alone it keeps none.
    let turned = bending(0.0);
    assert!(turned < 1e-12 * theory, "{turned} J");
}

#[test]
fn nodes_that_are_led_come_to_the_normals_that_they_are_given() {
    let mesh = QuadMesh::grid(&even_axis(0.0, 0.1, 0.02), &even_axis(0.0, 0.1, 0.02));
    let led = |normal: Vec3| {
        let spec = common::sheet("strip", &mesh, 0, common::stiff_shell());
        let settings = StepSettings {
            target_step: 0.0,
            safety: 0.8,
            damping: 0.0,
        };
        let mut model = Model::new(mesh.points.clone(), vec![spec], settings).unwrap();
        // Of the nodes at x < 0.05 alone: the flat sheet is bent between them and the others.
        let normals: Vec<(u32, Vec3)> = (0..mesh.points.len() as u32)
            .filter(|n| mesh.points[*n as usize][0] < 0.05)
            .map(|n| (n, normal))
            .collect();
        model.lead(mesh.points.clone(), 0.01, &normals).unwrap();
        assert!(model.v().iter().all(|v| *v == [0.0; 3]));
        model.energies().bending
    };
    let tilt = 0.01f64;
    let bent = led([tilt.sin(), 0.0, tilt.cos()]);
    // One column of elements, 20 mm wide, has the curvature tilt / 20 mm over 20 mm x 100 mm.
    let theory = 0.5 * 5e-3 * (tilt / 0.02).powi(2) * 0.02 * 0.1;
    assert!(
        bent > 0.99 * theory && bent.is_finite(),
        "{bent} J, at least {theory} J"
    );
    // Neither their length nor their sign matters.
    let same = led([-2.0 * tilt.sin(), 0.0, -2.0 * tilt.cos()]);
    assert!((same / bent - 1.0).abs() < 1e-9, "{same} J, {bent} J");
    assert_eq!(led([0.0, 0.0, -3.0]), 0.0);
}
