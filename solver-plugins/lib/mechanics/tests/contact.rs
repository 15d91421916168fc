//! Contact against what it must be: gradients of its own energy, balance, Coulomb's law.

mod common;

use common::slave::{OFFSET, contact, evaluate, gradient_error, gradient_error_of, pace, scene};
use plyflow_geometry::vec3::{Vec3, add, cross, dot, norm, scale, sub};
use plyflow_mechanics::contact::{ContactSettings, SheetContact, SlaveItem, Surface};
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::model::{Model, StepSettings};

/// The same cells as a bowl: four planes that meet at the slave's corner, with folds of `folds` (rad).
fn bowl(folds: [f64; 2], place: [f64; 2], height: f64) -> (QuadMesh, Vec<Vec3>) {
    let axis = [-0.008, 0.0, 0.008];
    let mut mesh = QuadMesh::grid(&axis, &axis);
    let ground =
        |x: f64, y: f64| x.abs() * (0.5 * folds[0]).tan() + y.abs() * (0.5 * folds[1]).tan();
    for p in &mut mesh.points {
        p[2] = ground(p[0], p[1]);
    }
    let mut x = mesh.points.clone();
    x.push([place[0], place[1], height]);
    (mesh, x)
}

#[test]
fn force_is_the_gradient_of_its_energy_inside_cells_and_on_ridges() {
    for (fold, place) in [
        (0.0, [0.003, 0.002]),
        (0.4, [0.004, -0.003]),
        (-0.5, [0.003, 0.001]),
        (-0.5, [0.00001, 0.001]),
        (0.4, [-0.005, 0.006]),
    ] {
        let error = gradient_error(fold, place, 0.8 * OFFSET);
        assert!(error < 1e-4, "fold {fold} at {place:?}: {error}");
    }
}

#[test]
fn force_is_the_gradient_of_its_energy_in_a_valley_but_for_the_turn_of_the_fold() {
    // The width of the blend follows the fold; its change is left out of the gradient.
    for x in [0.0, 5e-6, -8e-6, 2e-5] {
        let error = gradient_error(0.5, [x, 0.001], 0.8 * OFFSET);
        assert!(error < 0.02, "at {x}: {error}");
    }
}

#[test]
fn force_is_the_gradient_of_its_energy_in_the_corner_of_a_bowl_but_for_the_turn_of_the_folds() {
    for place in [[0.0, 0.0], [3e-6, -2e-6], [1e-5, 1e-5], [-2e-5, 4e-6]] {
        for folds in [[0.3, 0.3], [0.3, 0.15], [0.3, -0.2]] {
            let error = gradient_error_of(bowl(folds, place, 0.8 * OFFSET));
            assert!(error < 0.02, "folds {folds:?} at {place:?}: {error}");
        }
    }
}

#[test]
fn around_the_corner_of_a_bowl_the_force_turns_smoothly_and_does_no_work() {
    // Circles of up to the distance over which the faces share the slave, d = 0.32 mm and more.
    for (folds, radius) in [
        ([0.3, 0.3], 2e-6),
        ([0.3, 0.3], 2e-5),
        ([0.3, 0.12], 1e-5),
        ([0.3, 0.3], 8e-5),
        ([0.3, -0.2], 2e-5),
    ] {
        const STEPS: usize = 720;
        let at = |k: usize| {
            let angle = std::f64::consts::TAU * k as f64 / STEPS as f64;
            let place = [radius * angle.cos(), radius * angle.sin()];
            let (mesh, x) = bowl(folds, place, 0.8 * OFFSET);
            let (energy, f) = evaluate(&mesh, &x, 0);
            (x[x.len() - 1], energy, f[f.len() - 1])
        };
        let states: Vec<_> = (0..=STEPS).map(at).collect();
        let size = norm(states[0].2);
        let (mut work, mut jump) = (0.0, 0.0f64);
        for (a, b) in states.iter().zip(&states[1..]) {
            work += 0.5 * dot(add(a.2, b.2), sub(b.0, a.0));
            jump = jump.max(norm(sub(b.2, a.2)));
        }
        let aside = states
            .iter()
            .map(|s| s.2[0].hypot(s.2[1]))
            .fold(0.0, f64::max);
        assert!(
            aside > 0.004 * size,
            "the corner pushes aside: {}",
            aside / size
        );
        assert!(
            jump < 0.05 * aside,
            "folds {folds:?}, {radius} m: a jump of {jump} N of {aside} N"
        );
        let way = std::f64::consts::TAU * radius;
        assert!(
            work.abs() < 1e-3 * aside * way,
            "folds {folds:?}, {radius} m: {work} J"
        );
    }
}

/// A film at the foot of a block's rounded corner, as it lay after forming: its cells on the ground and on the two walls are hollow towards each
/// other, and the fourth, which lies on the corner's edge, is not. One slave at `place` from the node that they share.
fn foot_of_a_corner(place: Vec3) -> (QuadMesh, Vec<Vec3>) {
    let axis = [-0.016, 0.0, 0.016];
    let mut mesh = QuadMesh::grid(&axis, &axis);
    let millimetres = [
        [-18.9, -20.8, 0.0],
        [-2.0, -18.0, 0.0],
        [13.9, -11.1, 0.0],
        [-17.8, -4.7, 0.0],
        [0.0, 0.0, 0.0],
        [11.4, 2.3, 13.2],
        [-15.5, 10.9, 0.0],
        [0.3, 11.7, 11.7],
        [7.2, 9.3, 28.9],
    ];
    for (p, at) in mesh.points.iter_mut().zip(millimetres) {
        *p = scale(at, 1e-3);
    }
    let mut x = mesh.points.clone();
    x.push(place);
    (mesh, x)
}

#[test]
fn at_the_foot_of_a_corner_the_force_turns_smoothly_between_ground_and_both_walls_and_does_no_work()
{
    // Where the slave is pressed into the foot with some 2 to 10 % of the distance at which it touches.
    let middle: Vec3 = [-1.75e-4, -2.3e-4, 4.3e-4];
    for (radius, upright) in [(4e-6, false), (2e-5, false), (5e-5, false), (2e-5, true)] {
        const STEPS: usize = 720;
        let at = |k: usize| {
            let angle = std::f64::consts::TAU * k as f64 / STEPS as f64;
            let (a, b) = (radius * angle.cos(), radius * angle.sin());
            // Along the line between the walls, and across it or upwards.
            let way = if upright {
                [0.8 * a, -0.6 * a, b]
            } else {
                [0.8 * a + 0.6 * b, -0.6 * a + 0.8 * b, 0.0]
            };
            let (mesh, x) = foot_of_a_corner(add(middle, way));
            let (_, f) = evaluate(&mesh, &x, 0);
            (x[x.len() - 1], f[f.len() - 1])
        };
        let states: Vec<_> = (0..=STEPS).map(at).collect();
        let size = states.iter().map(|s| norm(s.1)).fold(0.0, f64::max);
        assert!(size > 0.5, "{radius} m: {size} N");
        let (mut work, mut jump) = (0.0, 0.0f64);
        for (a, b) in states.iter().zip(&states[1..]) {
            work += 0.5 * dot(add(a.1, b.1), sub(b.0, a.0));
            jump = jump.max(norm(sub(b.1, a.1)));
        }
        let way = std::f64::consts::TAU * radius;
        assert!(
            jump < 0.05 * size,
            "{radius} m: a jump of {jump} N of {size} N"
        );
        assert!(
            work.abs() < 2e-2 * size * way,
            "{radius} m: {work} J of {} J",
            size * way
        );
    }
}

#[test]
fn force_turns_smoothly_across_a_valley() {
    let sideways = |x: f64| {
        let (mesh, points) = scene(0.5, [x, 0.001], 0.8 * OFFSET);
        let f = evaluate(&mesh, &points, 0).1;
        f.last().unwrap()[0] / norm(*f.last().unwrap())
    };
    let steps: Vec<f64> = (-60..=60).map(|i| sideways(i as f64 * 1e-6)).collect();
    let jump = steps
        .windows(2)
        .map(|p| (p[1] - p[0]).abs())
        .fold(0.0, f64::max);
    let whole = (steps[0] - steps[120]).abs();
    assert!(whole > 0.4, "the fold is crossed: {whole}");
    assert!(jump < 0.05 * whole, "largest jump {jump} of {whole}");
}

#[test]
fn forces_and_moments_balance() {
    for (fold, x) in [(0.0, 0.003), (0.5, 1e-5), (-0.5, 1e-5), (0.3, 0.002)] {
        let (mesh, points) = scene(fold, [x, 0.001], 0.7 * OFFSET);
        let (_, f) = evaluate(&mesh, &points, 3);
        let force = f.iter().fold([0.0; 3], |a, b| add(a, *b));
        let moment = f
            .iter()
            .zip(&points)
            .fold([0.0; 3], |a, (f, p)| add(a, cross(*p, *f)));
        let size = norm(*f.last().unwrap());
        assert!(size > 0.0);
        assert!(norm(force) < 1e-12 * size);
        assert!(norm(moment) < 1e-9 * size, "fold {fold}: {moment:?}");
    }
}

/// Speed (m/s) upwards at which a slave of 1e-5 kg comes out of a flat sheet, or after a millisecond, that begins at `height` over
/// its mid-surface with `speed`; and its height then.
fn comes_out(height: f64, speed: f64, clearing: bool) -> [f64; 2] {
    let (mesh, mut x) = scene(0.0, [0.003, 0.002], height);
    let normals = vec![[0.0, 0.0, 1.0]; x.len()];
    let neighbours = mesh.neighbours();
    let mut c = contact(x.len() as u32 - 1, 3);
    c.clearing = clearing;
    let (slave, dt, mass) = (x.len() - 1, 1e-6, 1e-5);
    let mut v = vec![[0.0; 3]; x.len()];
    v[slave][2] = speed;
    for _ in 0..1000 {
        let surface = Surface {
            cells: &mesh.cells,
            neighbours: &neighbours,
            x: &x,
            normals: &normals,
        };
        c.compute(&surface, &v, pace(dt));
        let mut f = vec![[0.0; 3]; x.len()];
        c.scatter(&mesh.cells, &mut f);
        for k in 0..3 {
            v[slave][k] += f[slave][k] / mass * dt;
            x[slave][k] += v[slave][k] * dt;
        }
    }
    [v[slave][2], x[slave][2]]
}

#[test]
fn a_slave_that_is_found_deep_inside_is_not_flung_out() {
    // It comes out as fast as it was, through where half of the offset is left too.
    let [speed, height] = comes_out(0.3 * OFFSET, 0.5, false);
    assert!(height > 1.2 * OFFSET, "{height}");
    assert!((speed - 0.5).abs() < 0.01, "{speed}");
    // Pressed on, it gives way no further, and comes back as fast at most.
    let [speed, _] = comes_out(0.3 * OFFSET, -0.05, false);
    assert!(speed > 0.0 && speed < 0.0505, "{speed}");
    // A model that is put together by hand is cleared.
    let [speed, height] = comes_out(0.3 * OFFSET, 0.0, true);
    assert!(speed > 1.0 && height > OFFSET, "{speed} {height}");
}

/// The share that contacts hand to their multipliers between a sheet of 12 x 12 mm in elements of 1 mm and one above it of elements of
/// `size` (m), both of 1 kg/m2.
fn augmentation(size: f64) -> f64 {
    between_sheets(size).contact_augmentation()
}

/// The same two sheets.
fn between_sheets(size: f64) -> Model {
    let meshes = [1e-3, size].map(|size| {
        let axis = even_axis(0.0, 0.012, size);
        QuadMesh::grid(&axis, &axis)
    });
    let mut points = meshes[0].points.clone();
    let first = points.len() as u32;
    points.extend(meshes[1].points.iter().map(|p| add(*p, [0.0, 0.0, OFFSET])));
    let settings = StepSettings {
        target_step: 5e-7,
        safety: 0.9,
        damping: 0.0,
    };
    let spec = |k: usize| common::sheet("sheet", &meshes[k], [0, first][k], common::membrane());
    let specs = vec![spec(0), spec(1)];
    let mut model = Model::new(points, specs, settings).unwrap();
    let above = model.sheets()[1].cell_range.0 as u32;
    let per_side = (0.012 / size).round();
    let items = (0..first).map(|n| {
        let [i, j] = [0, 1].map(|k| (meshes[0].points[n as usize][k] / size).min(per_side - 0.5));
        let cell = (j.floor() * per_side + i.floor()) as u32;
        SlaveItem::new(n, above + cell, [0.0; 2])
    });
    let contact = ContactSettings::default();
    let between = SheetContact::new(
        "between".into(),
        -1.0,
        OFFSET,
        0.0,
        &contact,
        items.collect(),
    );
    model.add_sheet_contact(between);
    model.set_contact_stiffness(&contact);
    model
}

#[test]
fn multipliers_grow_more_slowly_where_one_sheet_has_far_more_mass_in_a_node() {
    let default = ContactSettings::default();
    for size in [1e-3, 2e-3] {
        assert_eq!(augmentation(size), default.augmentation, "{size} m");
    }
    // A node inside carries an element's mass: 36 times the other's.
    let expected = 2.0 * default.damping_ratio * default.stiffness_factor.sqrt() / 36.0 / 16.0;
    let got = augmentation(6e-3);
    assert!((got / expected - 1.0).abs() < 1e-9, "{got}, not {expected}");
}

#[test]
fn multipliers_of_light_nodes_at_a_corner_grow_more_slowly_by_themselves() {
    let default = ContactSettings::default();
    let model = between_sheets(2e-3);
    let follows: Vec<f64> = (model.sheet_contacts()[0].items.iter())
        .map(SlaveItem::follows)
        .collect();
    // In masses of a small element the corner's node has a quarter; those of the cell that it touches have 1, 2, 4 and 2.
    let most = default.largest_augmentation(0.25 / 2.25);
    let expected = most / default.augmentation;
    assert!(expected < 0.8);
    for corner in [0, 12, 13 * 12, 13 * 13 - 1] {
        let got = follows[corner];
        assert!(
            got <= expected && got > expected - 1.0 / 255.0,
            "{got}, not {expected}"
        );
    }
    assert_eq!(follows.iter().filter(|f| **f == 1.0).count(), 13 * 13 - 4);
}

#[test]
fn a_slave_on_a_flank_is_held_where_the_sheet_is_bent_so_sharply_that_nodes_normals_are_far_from_the_flanks()
 {
    // The normals of all nodes are those of the ridge, 69 and 74 degrees off the flanks'.
    for fold in [-2.4f64, -2.6] {
        let (sin, cos) = (0.5 * fold).sin_cos();
        for (cell, place) in [(3, [0.0045, 0.002]), (0, [-0.003, -0.003])] {
            let (mesh, x) = scene(fold, place, 0.8 * OFFSET / cos);
            let (energy, f) = evaluate(&mesh, &x, cell);
            let force = *f.last().unwrap();
            let out = [-sin * f64::signum(place[0]), 0.0, cos];
            let expected = 0.2 * OFFSET * 1e5;
            let error = norm(sub(force, scale(out, expected))) / expected;
            // The cells are warped by up to 0.04 mm.
            assert!(
                energy > 0.0 && error < 0.3,
                "fold {fold} at {place:?}: {force:?}"
            );
        }
        // From under the flank nothing is held.
        let (mesh, x) = scene(fold, [0.0045, 0.002], -0.8 * OFFSET / cos);
        assert_eq!(evaluate(&mesh, &x, 3).0, 0.0);
    }
}

/// A contact that catches: of a slave over the middle of a cell of 8 mm of a sheet of the curvature `bend` (1/m, hollow), at `height` (m)
/// over the cell.
struct Catch {
    mesh: QuadMesh,
    x: Vec<Vec3>,
    normals: Vec<Vec3>,
    contact: SheetContact,
}

impl Catch {
    fn new(bend: f64, height: f64) -> Self {
        let axis = even_axis(-0.02, 0.02, 0.008);
        let mut mesh = QuadMesh::grid(&axis, &axis);
        for p in &mut mesh.points {
            p[2] = 0.5 * bend * p[0] * p[0];
        }
        let normal = |p: &Vec3| {
            let n = [-bend * p[0], 0.0, 1.0];
            scale(n, 1.0 / norm(n))
        };
        let mut normals: Vec<Vec3> = mesh.points.iter().map(normal).collect();
        normals.push([0.0, 0.0, 1.0]);
        let mut x = mesh.points.clone();
        // The cell in the middle reaches from -4 to 4 mm.
        x.push([0.0, 0.0, 0.5 * bend * 0.004 * 0.004 + height]);
        let mut contact = contact(x.len() as u32 - 1, mesh.cells.len() as u32 / 2);
        contact.let_in = Some(0.03);
        Self {
            mesh,
            x,
            normals,
            contact,
        }
    }

    /// Penetration (m) now; `None` when it does not touch.
    fn penetration(&mut self) -> Option<f64> {
        let neighbours = self.mesh.neighbours();
        let surface = Surface {
            cells: &self.mesh.cells,
            neighbours: &neighbours,
            x: &self.x,
            normals: &self.normals,
        };
        let v = vec![[0.0; 3]; self.x.len()];
        for _ in 0..8 {
            self.contact.compute(&surface, &v, pace(1e-6));
        }
        let item = &self.contact.items[0];
        item.active.then_some(item.penetration)
    }
}

#[test]
fn what_catches_lets_in_what_straight_cells_cut_off_and_no_more_than_half_of_the_distance() {
    // Of a parabola of the curvature k a cell of the length h cuts off k h2 / 8.
    let cut_off = |bend: f64| bend * 0.008 * 0.008 / 8.0;
    for bend in [0.0, 2.0, 5.0, 40.0] {
        let let_in = (0.03 * OFFSET + 2.0 * cut_off(bend)).min(0.5 * OFFSET);
        let touching = OFFSET - let_in;
        let apart = Catch::new(bend, touching + 0.01 * OFFSET).penetration();
        assert_eq!(apart, None, "bend {bend}");
        let deep = Catch::new(bend, touching - 0.01 * OFFSET).penetration();
        let deep = deep.unwrap_or_else(|| panic!("bend {bend}: not in touch"));
        assert!((deep / OFFSET - 0.01).abs() < 2e-3, "bend {bend}: {deep}");
    }
}

#[test]
fn what_is_let_in_does_not_change_while_a_slave_touches() {
    let mut catch = Catch::new(5.0, 0.7 * OFFSET);
    let deep = catch.penetration().expect("in touch");
    // As if the sheet had become flat between its nodes.
    catch.normals.fill([0.0, 0.0, 1.0]);
    assert_eq!(catch.penetration(), Some(deep));
}
