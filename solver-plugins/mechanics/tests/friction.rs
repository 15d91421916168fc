//! Friction against closed forms: a belt around a drum (Euler and Eytelwein), a sheet pulled out from between two.

mod common;

use plyflow_mechanics::contact::{
    ContactSettings, RigidContact, RigidItem, RigidSurface, SheetContact, SlaveItem,
};
use plyflow_mechanics::history::{constant_speed_way, smooth_step};
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::model::{Drive, Fixed, Model, NodalLoad, StepSettings};
use plyflow_mechanics::sheet::{Pressed, SheetSpec};
use plyflow_mechanics::vec3::{V, add, dot, scale, sub};
use std::sync::Arc;

/// A sheet of the fabric; its nodes follow `first` of the model.
fn sheet(name: &str, mesh: &QuadMesh, first: u32, axis: V, pressed: Pressed) -> SheetSpec {
    let element = common::membrane();
    let m = mesh.cells.len();
    SheetSpec {
        name: name.into(),
        nodes: (first..first + mesh.points.len() as u32).collect(),
        cells: mesh.cells.clone(),
        patches: Vec::new(),
        axis,
        layers: vec![1.0; m],
        pressed: vec![pressed; m],
        least_areal_mass: vec![0.0; m],
        element,
    }
}

/// Holds nodes where they start, but for the last ones, which move along `direction`.
struct Pull {
    start: Vec<V>,
    still: usize,
    direction: V,
    /// When it begins, length (m) and duration (s) of the way.
    begin: f64,
    way: f64,
    duration: f64,
}

impl Drive for Pull {
    fn position(&self, k: usize, t: f64) -> V {
        if k < self.still {
            return self.start[k];
        }
        let way = constant_speed_way(
            (t - self.begin).max(0.0),
            self.way,
            self.duration,
            0.1 * self.duration,
        );
        add(self.start[k], scale(self.direction, way))
    }
}

/// A cylinder about the y axis.
struct Drum {
    radius: f64,
}

impl RigidSurface for Drum {
    fn distance(&self, p: V) -> (f64, V) {
        let r = p[0].hypot(p[2]);
        (r - self.radius, [p[0] / r, 0.0, p[2] / r])
    }
}

/// Ratio of the pulling to the holding force of a belt that slides over an arc of `angle` (rad).
fn belt(angle: f64, friction: f64) -> f64 {
    const RADIUS: f64 = 0.05;
    const TAIL: f64 = 0.02;
    let arc = RADIUS * angle;
    let mesh = QuadMesh::grid(
        &even_axis(0.0, arc + 2.0 * TAIL, 0.002),
        &even_axis(0.0, 0.01, 0.005),
    );
    // Along s: down the left tail's end, over the drum, down the right tail.
    let place = |s: f64| -> (V, V) {
        let turned = ((s - TAIL) / RADIUS).clamp(0.0, angle) - 0.5 * angle;
        let tangent = [turned.cos(), 0.0, -turned.sin()];
        let foot = [RADIUS * turned.sin(), 0.0, RADIUS * turned.cos()];
        let beyond = (s - TAIL).min(0.0) + (s - TAIL - arc).max(0.0);
        (add(foot, scale(tangent, beyond)), tangent)
    };
    let points: Vec<V> = mesh
        .points
        .iter()
        .map(|p| add(place(p[0]).0, [0.0, p[1], 0.0]))
        .collect();
    let settings = StepSettings {
        target_step: 3e-6,
        safety: 0.8,
        damping: 20.0,
    };
    // Family 1 lies across the belt: that direction is in the plane of every element.
    let spec = sheet("belt", &mesh, 0, [0.0, 1.0, 0.0], Pressed::No);
    let mut model = Model::new(points.clone(), vec![spec], settings).unwrap();
    let at = |s: f64| -> Vec<u32> {
        let there = |n: &usize| (mesh.points[*n][0] - s).abs() < 1e-9;
        (0..points.len()).filter(there).map(|n| n as u32).collect()
    };
    let (held, pulled) = (at(0.0), at(arc + 2.0 * TAIL));
    let back = scale(place(0.0).1, -1.0);
    let loads = held.iter().enumerate().map(|(j, n)| NodalLoad {
        node: *n,
        force: scale(back, if j == 1 { 0.5 } else { 0.25 }),
        moment: [0.0; 3],
    });
    model.set_loads(loads.collect());
    let direction = place(arc + 2.0 * TAIL).1;
    let (begin, duration) = (0.01, 0.06);
    let drive = Pull {
        start: pulled.iter().map(|n| points[*n as usize]).collect(),
        still: 0,
        direction,
        begin,
        way: 0.006,
        duration,
    };
    model.set_driven(pulled, Box::new(drive));
    let items = (0..points.len() as u32).map(|n| RigidItem::new(n, 0.0));
    let contact = ContactSettings::default();
    let drum = Arc::new(Drum { radius: RADIUS });
    let on = RigidContact::new("drum".into(), drum, friction, &contact, items.collect());
    model.rigid_contacts.push(on);
    model.set_contact_stiffness(&contact);
    let holding = 2.0;
    let (mut sum, mut count) = (0.0, 0);
    // The belt slides all along when the last fifth of the way at constant speed begins.
    while model.time < begin + 0.9 * duration {
        model.load_factor = holding * smooth_step(model.time, 0.0, begin);
        model.step(false).unwrap();
        if model.time > begin + 0.7 * duration {
            sum += model
                .reactions()
                .iter()
                .map(|r| dot(*r, direction))
                .sum::<f64>();
            count += 1;
        }
    }
    sum / f64::from(count) / holding
}

#[test]
fn a_belt_around_a_drum_follows_the_capstan_equation() {
    for (angle, friction) in [(90.0f64, 0.3), (180.0, 0.3), (90.0, 0.51)] {
        let angle = angle.to_radians();
        let (got, law) = (belt(angle, friction), (friction * angle).exp());
        assert!(
            (got / law - 1.0).abs() < 0.03,
            "{angle} rad, {friction}: {got} instead of {law}"
        );
    }
}

/// The cell of a grid below a point, and the place in it.
fn locate(mesh: &QuadMesh, p: V) -> (u32, [f64; 2]) {
    let inside = |c: &[u32; 4]| {
        let (a, b) = (mesh.points[c[0] as usize], mesh.points[c[2] as usize]);
        let xi = [0, 1].map(|k| 2.0 * (p[k] - a[k]) / (b[k] - a[k]) - 1.0);
        xi.iter().all(|x| x.abs() <= 1.0 + 1e-9).then_some(xi)
    };
    let mut cells = mesh.cells.iter().enumerate();
    cells
        .find_map(|(i, c)| inside(c).map(|xi| (i as u32, xi)))
        .expect("the lower sheet is larger")
}

#[test]
fn a_sheet_pulled_from_between_two_under_one_bar_is_held_by_both_faces() {
    const PRESSURE: f64 = 1e5;
    const FRICTION: f64 = 0.3;
    const THICKNESS: f64 = 1e-3;
    let grid =
        |x: [f64; 2], y: f64| QuadMesh::grid(&even_axis(x[0], x[1], 0.01), &even_axis(-y, y, 0.01));
    // The upper sheet stays on the middle one, and that on the lower one, all the way.
    let meshes = [
        grid([-0.06, 0.08], 0.04),
        grid([-0.05, 0.07], 0.03),
        grid([-0.025, 0.025], 0.025),
    ];
    let mut points: Vec<V> = Vec::new();
    let mut specs = Vec::new();
    let mut first = [0; 3];
    for (k, mesh) in meshes.iter().enumerate() {
        let pressed = if k == 2 { Pressed::Above } else { Pressed::No };
        first[k] = points.len() as u32;
        let name = ["lower", "middle", "upper"][k];
        specs.push(sheet(name, mesh, first[k], [1.0, 0.0, 0.0], pressed));
        let z = THICKNESS * k as f64;
        points.extend(mesh.points.iter().map(|p| [p[0], p[1], z]));
    }
    let settings = StepSettings {
        target_step: 1e-5,
        safety: 0.8,
        damping: 50.0,
    };
    let mut model = Model::new(points.clone(), specs, settings).unwrap();
    let mut driven: Vec<u32> = (0..first[1]).collect();
    let still = driven.len();
    let edge = |n: &u32| (points[*n as usize][0] - 0.07).abs() < 1e-9;
    driven.extend((first[1]..first[2]).filter(edge));
    let (begin, duration) = (0.02, 0.1);
    let drive = Pull {
        start: driven.iter().map(|n| points[*n as usize]).collect(),
        still,
        direction: [1.0, 0.0, 0.0],
        begin,
        way: 0.006,
        duration,
    };
    model.set_driven(driven, Box::new(drive));
    for n in first[2]..points.len() as u32 {
        let in_plane = Fixed {
            translations: [true, true, false],
            rotations: [false; 3],
        };
        model.fix(n, in_plane);
    }
    let settings = ContactSettings::default();
    for k in 1..3 {
        let nodes = first[k]..first[k] + meshes[k].points.len() as u32;
        let cell0 = model.sheets[k - 1].cell_range.0 as u32;
        let items = nodes.map(|n| {
            let (cell, xi) = locate(&meshes[k - 1], points[n as usize]);
            SlaveItem::new(n, cell0 + cell, xi)
        });
        model.sheet_contacts.push(SheetContact {
            name: format!("{k}"),
            side: 1.0,
            offset: THICKNESS,
            friction: FRICTION,
            slip_factor: settings.slip_factor,
            augmentation: settings.augmentation,
            items: items.collect(),
        });
    }
    model.set_contact_stiffness(&settings);
    // A membrane's slack tail would float up and fold over the edge of the upper sheet; its weight, a ten
    // thousandth of the pressure, keeps it down.
    model.body_acceleration[2] = -9.81;
    let (mut sum, mut count) = (0.0, 0);
    while model.time < begin + 0.9 * duration {
        model.pressures.above = PRESSURE * smooth_step(model.time, 0.0, 0.5 * begin);
        model.step(false).unwrap();
        if model.time > begin + 0.6 * duration {
            sum += model.reactions()[still..].iter().map(|r| r[0]).sum::<f64>();
            count += 1;
        }
    }
    // Thin sheets sag between nodes by nothing that counts: what presses is the upper sheet's area.
    let law = 2.0 * FRICTION * PRESSURE * 0.05 * 0.05;
    let got = sum / f64::from(count);
    assert!((got / law - 1.0).abs() < 0.01, "{got} N instead of {law} N");
    // The upper sheet kept its height over the middle one.
    let lifted = model.x[first[2] as usize + 14];
    let height = sub(lifted, [0.0, 0.0, 2.0 * THICKNESS])[2];
    assert!(height.abs() < 8e-6, "{height} m");
}
