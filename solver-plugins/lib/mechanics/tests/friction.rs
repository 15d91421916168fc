//! Friction against closed forms: a belt around a drum (Euler and Eytelwein), a sheet pulled out from between two, a block
//! on an incline; constant coefficients, and those by pressure and by the angle to the fibres.

mod common;

use plyflow_geometry::vec3::{Vec3, add, dot, scale};
use plyflow_mechanics::contact::{
    AngleDependence, ContactSettings, FibreField, FrictionLaw, Plane, PressureDependence,
    RigidContact, RigidItem, RigidSurface, SheetCells, SheetContact, SlaveItem, VaryingFriction,
    Whose,
};
use plyflow_mechanics::history::{constant_speed_way, smooth_step};
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::model::{Drive, Fixed, Model, NodalLoad, Pressures, StepSettings};
use plyflow_mechanics::sheet::{Pressed, SheetSpec};
use std::sync::Arc;

/// A sheet of the fabric; its nodes follow `first` of the model.
fn sheet(name: &str, mesh: &QuadMesh, first: u32, axis: Vec3, pressed: Pressed) -> SheetSpec {
    SheetSpec {
        axis,
        steered: None,
        pressed: vec![pressed; mesh.cells.len()],
        ..common::sheet(name, mesh, first, common::membrane())
    }
}

/// Holds nodes where they start, but for the last ones, which move along `direction`.
struct Pull {
    start: Vec<Vec3>,
    still: usize,
    direction: Vec3,
    /// When it begins, length (m) and duration (s) of the way.
    begin: f64,
    way: f64,
    duration: f64,
}

impl Drive for Pull {
    fn position(&self, k: usize, t: f64) -> Vec3 {
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
    fn distance(&self, p: Vec3) -> (f64, Vec3) {
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
    let place = |s: f64| -> (Vec3, Vec3) {
        let turned = ((s - TAIL) / RADIUS).clamp(0.0, angle) - 0.5 * angle;
        let tangent = [turned.cos(), 0.0, -turned.sin()];
        let foot = [RADIUS * turned.sin(), 0.0, RADIUS * turned.cos()];
        let beyond = (s - TAIL).min(0.0) + (s - TAIL - arc).max(0.0);
        (add(foot, scale(tangent, beyond)), tangent)
    };
    let points: Vec<Vec3> = mesh
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
    let items = (0..points.len() as u32).map(RigidItem::new);
    let contact = ContactSettings::default();
    let drum = Arc::new(Drum { radius: RADIUS });
    let on = RigidContact::new(
        "drum".into(),
        drum,
        0.0,
        friction,
        &contact,
        items.collect(),
    );
    model.add_rigid_contact(on);
    model.set_contact_stiffness(&contact);
    let holding = 2.0;
    let (mut sum, mut count) = (0.0, 0);
    // The belt slides all along when the last fifth of the way at constant speed begins.
    while model.time() < begin + 0.9 * duration {
        model.set_load_factor(holding * smooth_step(model.time(), 0.0, begin));
        model.step(false).unwrap();
        if model.time() > begin + 0.7 * duration {
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
            "{angle} rad, coefficient {friction}: T2/T1 = {got} instead of {law}, {:.2} % off",
            100.0 * (got / law - 1.0)
        );
    }
}

/// The cell of a grid below a point, and the place in it.
fn locate(mesh: &QuadMesh, p: Vec3) -> (u32, [f64; 2]) {
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

const THICKNESS: f64 = 1e-3;
/// Area of the upper sheet of a sandwich (m2).
const AREA: f64 = 0.05 * 0.05;

/// What a sandwich does while its middle sheet slides.
struct Sandwich {
    /// Mean pulling force (N).
    pull: f64,
    /// Mean friction on the slaves of the lower and of the upper face (N).
    faces: [f64; 2],
    /// Height of the upper sheet over its start at the end (m).
    lift: f64,
    /// Largest unexplained energy over the external work.
    drift: f64,
    /// Highest point of all sheets on the way (m).
    top: f64,
}

/// Pulls a sheet along x out from between two, under `pressure` (Pa) on the upper one. `laws`: of the lower and upper face;
/// the middle sheet's nodes are the slaves on the lower sheet, the upper one's on the middle sheet.
fn sandwich(pressure: f64, laws: impl Fn(&Model) -> [FrictionLaw; 2]) -> Sandwich {
    // A membrane's slack tail would float up and fold over the edge of the upper sheet; its weight, a ten
    // thousandth of the pressure, keeps it down.
    heavy_sandwich(9.81, pressure, laws)
}

/// The same with a weight of `gravity` (m/s2).
fn heavy_sandwich(
    gravity: f64,
    pressure: f64,
    laws: impl Fn(&Model) -> [FrictionLaw; 2],
) -> Sandwich {
    let grid =
        |x: [f64; 2], y: f64| QuadMesh::grid(&even_axis(x[0], x[1], 0.01), &even_axis(-y, y, 0.01));
    // The upper sheet stays on the middle one, and that on the lower one, all the way.
    let meshes = [
        grid([-0.06, 0.08], 0.04),
        grid([-0.05, 0.07], 0.03),
        grid([-0.025, 0.025], 0.025),
    ];
    let mut points: Vec<Vec3> = Vec::new();
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
    for (k, law) in laws(&model).into_iter().enumerate() {
        let k = k + 1;
        let nodes = first[k]..first[k] + meshes[k].points.len() as u32;
        let cell0 = model.sheets()[k - 1].cell_range.0 as u32;
        let items = nodes.map(|n| {
            let (cell, xi) = locate(&meshes[k - 1], points[n as usize]);
            SlaveItem::new(n, cell0 + cell, xi)
        });
        let (name, items) = (format!("{k}"), items.collect());
        let contact = SheetContact::new(name, 1.0, THICKNESS, law, &settings, items);
        model.add_sheet_contact(contact);
    }
    model.set_contact_stiffness(&settings);
    model.set_body_acceleration([0.0, 0.0, -gravity]);
    let (mut pull, mut faces, mut count) = (0.0, [0.0; 2], 0.0);
    let (mut drift, mut top) = (0.0f64, 0.0f64);
    while model.time() < begin + 0.9 * duration {
        model.set_pressures(Pressures {
            above: pressure * smooth_step(model.time(), 0.0, 0.5 * begin),
            ..model.pressures()
        });
        model.step(false).unwrap();
        if model.time() > begin + 0.6 * duration {
            pull += model.reactions()[still..].iter().map(|r| r[0]).sum::<f64>();
            for (face, contact) in faces.iter_mut().zip(model.sheet_contacts()) {
                *face += contact.items.iter().map(|i| i.force[0]).sum::<f64>();
            }
            count += 1.0;
        }
        if model.cycle().is_multiple_of(20) {
            drift = drift.max(model.energies().drift().abs());
            top = model.x().iter().map(|x| x[2]).fold(top, f64::max);
        }
    }
    Sandwich {
        pull: pull / count,
        faces: faces.map(|f| f / count),
        lift: model.x()[first[2] as usize + 14][2] - 2.0 * THICKNESS,
        drift: drift / model.energies().external,
        top,
    }
}

#[test]
fn a_sheet_pulled_from_between_two_under_one_bar_is_held_by_both_faces() {
    let (pressure, friction) = (1e5, 0.3);
    let got = sandwich(pressure, |_| [friction.into(), friction.into()]);
    // Thin sheets sag between nodes by nothing that counts: what presses is the upper sheet's area.
    let law = friction * pressure * AREA;
    for (face, force) in ["lower", "upper"].iter().zip(got.faces) {
        let error = 100.0 * (force.abs() / law - 1.0);
        assert!(
            error.abs() < 1.0,
            "{face} face: {force} N instead of mu p A = {law} N, {error:.2} % off"
        );
    }
    let error = 100.0 * (got.pull / (2.0 * law) - 1.0);
    assert!(
        error.abs() < 1.0,
        "{} N instead of 2 mu p A = {} N, {error:.2} % off",
        got.pull,
        2.0 * law
    );
    // The upper sheet kept its height over the middle one.
    assert!(got.lift.abs() < 8e-6, "{} m", got.lift);
}

/// The cells of a sheet of a model.
fn cells(model: &Model, sheet: usize) -> &[[u32; 4]] {
    let (c0, c1) = model.sheets()[sheet].cell_range;
    &model.cells()[c0..c1]
}

/// A law for slaves of a sheet.
fn varying(
    model: &Model,
    slave: usize,
    pressure: PressureDependence,
    angle: Option<AngleDependence>,
) -> FrictionLaw {
    let slave = SheetCells::new(cells(model, slave));
    FrictionLaw::Varying(Arc::new(VaryingFriction {
        pressure,
        angle,
        slave,
    }))
}

#[test]
fn pulls_under_two_pressures_follow_laws_of_pressure() {
    let power = PressureDependence::Power {
        coefficient: 0.3,
        reference: 5e4,
        exponent: -0.3,
    };
    let table = PressureDependence::Table(vec![[2e4, 0.5], [1.2e5, 0.1]]);
    let of_table = |p: f64| 0.5 - 0.4 * (p - 2e4) / 1e5;
    let lower = 0.1;
    for (law, pressure, expected) in [
        (&power, 5e4, 0.3),
        (&power, 1e5, 0.3 * 2f64.powf(-0.3)),
        (&table, 5e4, of_table(5e4)),
        (&table, 1e5, of_table(1e5)),
    ] {
        let got = sandwich(pressure, |m| {
            [lower.into(), varying(m, 2, law.clone(), None)]
        });
        let face = got.faces[1].abs() / (pressure * AREA);
        let whole = got.pull / (pressure * AREA) - lower;
        for (what, got) in [("face", face), ("pull", whole)] {
            let error = 100.0 * (got / expected - 1.0);
            assert!(
                error.abs() < 1.0,
                "{law:?} at {pressure} Pa, {what}: coefficient {got} instead of {expected}, {error:.2} % off"
            );
        }
    }
}

#[test]
fn pulls_along_and_across_fibres_differ_by_the_factor_of_the_angle() {
    let pressure = 1e5;
    let factors = vec![[0.0, 1.0], [std::f64::consts::FRAC_PI_2, 0.5]];
    // Fibres of the upper sheet, which stands still, and of the middle one, which slides.
    for (whose, degrees, factor) in [
        (Whose::Slave, 0.0, 1.0),
        (Whose::Slave, 45.0, 0.75),
        (Whose::Slave, 90.0, 0.5),
        (Whose::Master, 0.0, 1.0),
        (Whose::Master, 90.0, 0.5),
    ] {
        let got = sandwich(pressure, |m| {
            let sheet = if whose == Whose::Slave { 2 } else { 1 };
            let (s, c) = f64::to_radians(degrees).sin_cos();
            let first = m.sheets()[sheet].cell_range.0;
            let fibres = FibreField::new(cells(m, sheet), first, m.x(), [c, s, 0.0]);
            let angle = AngleDependence {
                factors: factors.clone(),
                whose,
                fibres,
            };
            let coefficient = PressureDependence::Constant(0.4);
            [0.1.into(), varying(m, 2, coefficient, Some(angle))]
        });
        let expected = 0.4 * factor * pressure * AREA;
        let force = got.faces[1].abs();
        let error = 100.0 * (force / expected - 1.0);
        assert!(
            error.abs() < 1.0,
            "{whose:?} fibres at {degrees} deg: {force} N instead of {expected} N, {error:.2} % off"
        );
    }
}

/// Pulls a sheet of 50 x 30 mm under `pressure` over a rigid plane; the mean force (N) while it slides.
fn sledge(pressure: f64, law: impl Fn(&Model) -> FrictionLaw) -> f64 {
    let mesh = QuadMesh::grid(&even_axis(0.0, 0.05, 0.01), &even_axis(0.0, 0.03, 0.01));
    let settings = StepSettings {
        target_step: 1e-5,
        safety: 0.8,
        damping: 50.0,
    };
    let spec = sheet("sledge", &mesh, 0, [1.0, 0.0, 0.0], Pressed::Above);
    let mut model = Model::new(mesh.points.clone(), vec![spec], settings).unwrap();
    let n = mesh.points.len() as u32;
    let front = (0..n).filter(|n| mesh.points[*n as usize][0] > 0.0499);
    let driven: Vec<u32> = front.collect();
    let (begin, duration) = (0.02, 0.1);
    let drive = Pull {
        start: driven.iter().map(|n| mesh.points[*n as usize]).collect(),
        still: 0,
        direction: [1.0, 0.0, 0.0],
        begin,
        way: 0.006,
        duration,
    };
    model.set_driven(driven, Box::new(drive));
    let floor = Arc::new(Plane { height: 0.0 });
    let items = (0..n).map(RigidItem::new).collect();
    let contact = ContactSettings::default();
    let law = law(&model);
    let on = RigidContact::new("floor".into(), floor, 0.0, law, &contact, items);
    model.add_rigid_contact(on);
    model.set_contact_stiffness(&contact);
    let (mut sum, mut count) = (0.0, 0.0);
    while model.time() < begin + 0.9 * duration {
        model.set_pressures(Pressures {
            above: pressure * smooth_step(model.time(), 0.0, 0.5 * begin),
            ..model.pressures()
        });
        model.step(false).unwrap();
        if model.time() > begin + 0.6 * duration {
            sum += model.reactions().iter().map(|r| r[0]).sum::<f64>();
            count += 1.0;
        }
    }
    sum / count
}

#[test]
fn a_sledge_on_a_rigid_plane_follows_pressure_and_fibres() {
    // The driven edge keeps its height: what lies on its nodes does not press.
    let area = 0.045 * 0.03;
    for (pressure, degrees, factor) in [(2e4, 0.0, 1.0), (8e4, 0.0, 1.0), (8e4, 90.0, 0.6)] {
        let got = sledge(pressure, |m| {
            let (s, c) = f64::to_radians(degrees).sin_cos();
            let law = PressureDependence::Power {
                coefficient: 0.25,
                reference: 2e4,
                exponent: -0.25,
            };
            let angle = AngleDependence {
                factors: vec![[0.0, 1.0], [std::f64::consts::FRAC_PI_2, 0.6]],
                whose: Whose::Slave,
                fibres: FibreField::new(cells(m, 0), 0, m.x(), [c, s, 0.0]),
            };
            varying(m, 0, law, Some(angle))
        });
        let coefficient = 0.25 * (pressure / 2e4).powf(-0.25) * factor;
        let expected = coefficient * pressure * area;
        let error = 100.0 * (got / expected - 1.0);
        assert!(
            error.abs() < 1.0,
            "{pressure} Pa, fibres at {degrees} deg: {got} N instead of {expected} N, {error:.2} % off"
        );
    }
}

/// Lets a block (a sheet under its weight) go on a plane inclined by `angle` (rad): its way (m) down the plane after 0.05 s, and
/// its mean acceleration (m/s2) over the second half of that time.
fn incline(angle: f64, friction: f64) -> (f64, f64) {
    let axis = even_axis(0.0, 0.02, 0.01);
    let mesh = QuadMesh::grid(&axis, &axis);
    let settings = StepSettings {
        target_step: 1e-5,
        safety: 0.8,
        damping: 0.0,
    };
    let spec = sheet("block", &mesh, 0, [1.0, 0.0, 0.0], Pressed::No);
    let mut model = Model::new(mesh.points.clone(), vec![spec], settings).unwrap();
    let floor = Arc::new(Plane { height: 0.0 });
    let items = (0..9).map(RigidItem::new).collect();
    let contact = ContactSettings::default();
    let on = RigidContact::new("incline".into(), floor, 0.0, friction, &contact, items);
    model.add_rigid_contact(on);
    model.set_contact_stiffness(&contact);
    let g = 9.81;
    let speed = |m: &Model| m.v().iter().map(|v| v[0]).sum::<f64>() / 9.0;
    let settle = 0.02;
    let mut seen = [0.0; 2];
    let mut start = 0.0;
    while model.time() < settle + 0.05 {
        // First it lies down on the level plane; then the plane tilts at once.
        let tilt = if model.time() < settle { 0.0 } else { angle };
        let weight = g * smooth_step(model.time(), 0.0, 0.5 * settle);
        model.set_body_acceleration([weight * tilt.sin(), 0.0, -weight * tilt.cos()]);
        model.step(false).unwrap();
        if model.time() < settle {
            start = model.x()[4][0];
        }
        if model.time() < settle + 0.025 {
            seen[0] = speed(&model);
        }
        seen[1] = speed(&model);
    }
    (model.x()[4][0] - start, (seen[1] - seen[0]) / 0.025)
}

#[test]
fn a_block_on_an_incline_sticks_below_the_angle_of_friction_and_slides_by_coulombs_law_above_it() {
    let friction: f64 = 0.4;
    let (way, _) = incline(friction.atan() * 0.98, friction);
    assert!(way.abs() < 2e-6, "it sticks, but went {way} m");
    for share in [1.1, 1.5] {
        let angle = friction.atan() * share;
        let law = 9.81 * (angle.sin() - friction * angle.cos());
        let (way, got) = incline(angle, friction);
        let error = 100.0 * (got / law - 1.0);
        assert!(
            error.abs() < 1.0 && way > 0.0,
            "at {share} of the angle of friction: {got} m/s2 instead of {law} m/s2, {error:.2} % off"
        );
    }
}

#[test]
fn a_slack_tail_that_folds_over_its_neighbour_brings_no_energy() {
    let (pressure, friction) = (1e5, 0.3);
    let got = heavy_sandwich(0.0, pressure, |_| [friction.into(), friction.into()]);
    // The tail stands up by several thicknesses, and folds over.
    assert!(got.top > 5e-3, "{} m", got.top);
    assert!(got.drift < 1e-3, "{}", got.drift);
    let law = 2.0 * friction * pressure * AREA;
    assert!((got.pull / law - 1.0).abs() < 0.01, "{} N", got.pull);
}
