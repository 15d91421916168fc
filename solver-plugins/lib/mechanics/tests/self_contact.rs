//! A sheet on itself: folded over, squeezed, thrown.

mod common;

use plyflow_geometry::vec3::{Vec3, add, cross, norm, scale, sub};
use plyflow_mechanics::archive::Archive;
use plyflow_mechanics::component::ElementInstance;
use plyflow_mechanics::contact::{ContactSettings, FoldSpec, Plane, RigidContact, RigidItem};
use plyflow_mechanics::history::smooth_step;
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::model::{Drive, Model, Pressures, StepSettings};
use plyflow_mechanics::sheet::{Pressed, SheetSpec};
use std::sync::Arc;

const THICKNESS: f64 = 1e-3;

/// A strip with cross lines at `stations` (m along it when flat).
struct Strip {
    stations: Vec<f64>,
    width: f64,
    cell: f64,
    element: ElementInstance,
    damping: f64,
    friction: f64,
    contact: ContactSettings,
}

impl Strip {
    /// The strip as a model, bent so that station `s` begins at `place(s)` = `[x, z]`, with what presses on its cells;
    /// nodes at which `free` is false are no slaves. With the flat points.
    fn model(
        self,
        place: impl Fn(f64) -> [f64; 2],
        pressed: impl Fn(f64) -> Pressed,
        free: impl Fn(f64) -> bool,
    ) -> (Model, Vec<Vec3>) {
        let mesh = QuadMesh::grid(&self.stations, &even_axis(0.0, self.width, self.cell));
        let at = |p: &Vec3| {
            let [x, z] = place(p[0]);
            [x, p[1], z]
        };
        let station = |n: u32| mesh.points[n as usize][0];
        let middle = |c: &[u32; 4]| 0.5 * (station(c[0]) + station(c[2]));
        let count = mesh.points.len() as u32;
        let spec = SheetSpec {
            name: "strip".into(),
            nodes: (0..count).collect(),
            pressed: mesh.cells.iter().map(|c| pressed(middle(c))).collect(),
            cells: mesh.cells.clone(),
            patches: Vec::new(),
            // Across the strip: in the plane of every cell.
            axis: [0.0, 1.0, 0.0],
            steered: None,
            layers: vec![1.0; mesh.cells.len()],
            least_areal_mass: vec![0.0; mesh.cells.len()],
            element: self.element,
            elsewhere: None,
            other_material: None,
        };
        let settings = StepSettings {
            target_step: 5e-6,
            safety: 0.8,
            damping: self.damping,
        };
        let points = mesh.points.iter().map(at).collect();
        let mut model = Model::new(points, vec![spec], settings).unwrap();
        let contact = FoldSpec {
            name: "strip/strip".into(),
            slaves: (0..count).filter(|n| free(station(*n))).collect(),
            cell_range: model.sheets()[0].cell_range,
            thickness: THICKNESS,
            friction: self.friction.into(),
            undeformed: mesh.points.as_slice().into(),
        };
        model.add_self_contact(contact, &self.contact);
        (model, mesh.points)
    }
}

/// Largest and 99.9 % quantile of the penetrations (m), and how many pairs touch.
fn penetrations(model: &Model) -> (f64, f64, usize) {
    let items = model.self_contacts()[0].items.iter();
    let touching = items.filter(|i| i.slave.active);
    let mut depths: Vec<f64> = touching.map(|i| i.slave.penetration).collect();
    depths.sort_by(f64::total_cmp);
    let Some(max) = depths.last() else {
        return (0.0, 0.0, 0);
    };
    let at = (0.999 * depths.len() as f64) as usize;
    (*max, depths[at.min(depths.len() - 1)], depths.len())
}

/// Whether, seen along y, a lengthwise line of nodes crosses itself: then the sheet has passed through itself.
fn crosses_itself(model: &Model, stations: usize) -> bool {
    let turn =
        |a: Vec3, b: Vec3, c: Vec3| (b[0] - a[0]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[0] - a[0]);
    model.x().chunks(stations).any(|line| {
        let sides: Vec<&[Vec3]> = line.windows(2).collect();
        sides.iter().enumerate().any(|(i, p)| {
            sides[(i + 2).min(sides.len())..].iter().any(|q| {
                turn(p[0], p[1], q[0]) * turn(p[0], p[1], q[1]) < 0.0
                    && turn(q[0], q[1], p[0]) * turn(q[0], q[1], p[1]) < 0.0
            })
        })
    })
}

/// The end of a strip goes over to its other end in half a circle.
struct FoldOver {
    start: Vec<Vec3>,
    still: usize,
    radius: f64,
    duration: f64,
}

impl Drive for FoldOver {
    fn position(&self, k: usize, t: f64) -> Vec3 {
        if k < self.still {
            return self.start[k];
        }
        let share = smooth_step(t, 0.0, self.duration);
        let (s, c) = (std::f64::consts::PI * share).sin_cos();
        let r = self.radius;
        [r + r * c, self.start[k][1], r * s + 1.2 * THICKNESS * share]
    }
}

#[test]
fn a_strip_folded_over_onto_itself_stays_outside_itself_and_the_ledger_closes() {
    const LENGTH: f64 = 0.12;
    const DURATION: f64 = 0.12;
    let stations = even_axis(0.0, LENGTH, 0.0025);
    let lines = stations.len();
    let strip = Strip {
        stations,
        width: 0.01,
        cell: 0.0025,
        element: common::stiff_shell(),
        damping: 60.0,
        friction: 0.3,
        contact: ContactSettings::default(),
    };
    let pressed = |s: f64| match s > 0.75 * LENGTH {
        true => Pressed::Below,
        false => Pressed::No,
    };
    let is_end = |s: f64| !(1e-9..=LENGTH - 1e-9).contains(&s);
    let (mut model, flat) = strip.model(|s| [s, 0.0], pressed, |s| !is_end(s));
    let at = |s: f64| -> Vec<u32> {
        let there = |n: &u32| (flat[*n as usize][0] - s).abs() < 1e-9;
        (0..flat.len() as u32).filter(there).collect()
    };
    let mut driven = at(0.0);
    let still = driven.len();
    driven.extend(at(LENGTH));
    let drive = FoldOver {
        start: driven.iter().map(|n| model.x()[*n as usize]).collect(),
        still,
        radius: 0.5 * LENGTH,
        duration: DURATION,
    };
    model.set_driven(driven, Box::new(drive));
    let half = 0.5 * THICKNESS;
    let floor = Arc::new(Plane { height: -half });
    let contact = ContactSettings::default();
    let items = (0..flat.len() as u32).map(RigidItem::new);
    let on = RigidContact::new("floor".into(), floor, half, 0.3, &contact, items.collect());
    model.add_rigid_contact(on);
    model.set_contact_stiffness(&contact);
    model.set_body_acceleration([0.0, 0.0, -9.81]);
    let (mut worst, mut touching, mut drift, mut work) = (0.0f64, 0, 0.0f64, 0.0f64);
    while model.time() < DURATION + 0.1 {
        // Presses the leg that has come over onto the other one.
        model.set_pressures(Pressures {
            below: 5000.0 * smooth_step(model.time(), DURATION, DURATION + 0.08),
            ..model.pressures()
        });
        model.step(false).unwrap();
        if model.cycle().is_multiple_of(50) {
            let (_, quantile, count) = penetrations(&model);
            worst = worst.max(quantile);
            touching = count;
            let e = model.energies();
            drift = drift.max(e.drift().abs());
            work = work.max(e.external);
            assert!(!crosses_itself(&model, lines), "at {} s", model.time());
        }
    }
    assert!(touching > 18, "{touching}");
    assert!(worst < 0.1 * THICKNESS, "{worst} m");
    assert!(drift < 0.01 * work, "{drift} J of {work} J");
    // Nodes that are taken out of it touch no more; the others do.
    model.self_contacts_mut()[0].retain(|n| n % 2 == 0);
    model.step(false).unwrap();
    let items = model.self_contacts()[0].items.iter().map(|i| &i.slave);
    assert!(items.clone().all(|i| i.node % 2 == 0));
    let left = items.filter(|i| i.active).count();
    assert!(left > 0 && left < touching, "{left} of {touching}");
}

const LEG: f64 = 0.04;

/// Where `s` lies on a strip of legs that lie over each other `pitch` apart, with a cell of a thickness between.
fn zigzag(s: f64, pitch: f64) -> [f64; 2] {
    let period = LEG + THICKNESS;
    let leg = ((s + 0.25 * THICKNESS) / period).floor();
    let along = (s - leg * period).min(LEG);
    let even = leg.rem_euclid(2.0) < 0.5;
    [if even { along } else { LEG - along }, leg * pitch]
}

fn zigzag_stations(legs: usize, cell: f64) -> Vec<f64> {
    let leg = |k: usize| {
        let from = k as f64 * (LEG + THICKNESS);
        even_axis(from, from + LEG, cell)
    };
    (0..legs).flat_map(leg).collect()
}

/// Forces (N) along z that the contacts with itself bring on each of the legs.
fn on_legs(model: &Model, flat: &[Vec3], legs: usize) -> Vec<f64> {
    let mut f = vec![[0.0; 3]; flat.len()];
    for c in model.self_contacts() {
        c.scatter(model.cells(), &mut f);
    }
    let mut sums = vec![0.0; legs];
    for (f, p) in f.iter().zip(flat) {
        let leg = ((p[0] + 0.25 * THICKNESS) / (LEG + THICKNESS)) as usize;
        sums[leg.min(legs - 1)] += f[2];
    }
    sums
}

#[test]
fn folded_legs_carry_the_pressure_that_squeezes_them() {
    const PRESSURE: f64 = 1e5;
    const WIDTH: f64 = 0.02;
    // Two legs touch on one face of the sheet; the middle one of three is touched on both.
    for legs in [2, 3] {
        let strip = Strip {
            stations: zigzag_stations(legs, 0.005),
            width: WIDTH,
            cell: 0.005,
            element: common::membrane(),
            damping: 200.0,
            friction: 0.3,
            contact: ContactSettings::default(),
        };
        let pressed = |s: f64| {
            // Not next to the folds, whose stiff cells would carry a share.
            let is_outer = |leg: f64| {
                let x = s - leg * (LEG + THICKNESS);
                x > 0.25 * LEG && x < 0.75 * LEG
            };
            if is_outer(0.0) {
                Pressed::Below
            } else if !is_outer((legs - 1) as f64) {
                Pressed::No
            } else if legs == 2 {
                Pressed::Below
            } else {
                Pressed::Above
            }
        };
        let place = |s: f64| zigzag(s, THICKNESS);
        let (mut model, flat) = strip.model(place, pressed, |_| true);
        while model.time() < 0.06 {
            let p = PRESSURE * smooth_step(model.time(), 0.0, 0.02);
            model.set_pressures(Pressures { below: p, above: p });
            model.step(false).unwrap();
        }
        let force = PRESSURE * 0.5 * LEG * WIDTH;
        let sums = on_legs(&model, &flat, legs);
        assert!((sums[0] / -force - 1.0).abs() < 0.01, "{sums:?} {force}");
        assert!(
            (sums[legs - 1] / force - 1.0).abs() < 0.01,
            "{sums:?} {force}"
        );
        let (_, quantile, count) = penetrations(&model);
        assert!(quantile < 0.1 * THICKNESS, "{quantile}");
        assert!(count > 30 * (legs - 1), "{count}");
    }
}

/// A free strip of two legs, 4 mm apart, that fly towards each other with `speed` (m/s) and along with `drift`.
fn thrown(
    [speed, drift]: [f64; 2],
    cell: f64,
    friction: f64,
    contact: ContactSettings,
) -> (Model, Vec<Vec3>) {
    let stations = zigzag_stations(2, cell);
    let strip = Strip {
        stations,
        width: 0.04,
        cell,
        element: common::membrane(),
        damping: 0.0,
        friction,
        contact,
    };
    let (mut model, flat) = strip.model(|s| zigzag(s, 0.004), |_| Pressed::No, |_| true);
    for (v, p) in model.v_mut().iter_mut().zip(&flat) {
        let up = if p[0] < LEG + 0.5 * THICKNESS {
            1.0
        } else {
            -1.0
        };
        *v = [up * drift, 0.0, up * speed];
    }
    (model, flat)
}

fn momentum(model: &Model) -> (Vec3, Vec3) {
    let (mut linear, mut angular) = ([0.0; 3], [0.0; 3]);
    for n in 0..model.x().len() {
        let p = scale(model.v()[n], model.mass()[n]);
        linear = add(linear, p);
        angular = add(angular, cross(model.x()[n], p));
    }
    (linear, angular)
}

#[test]
fn a_free_sheet_that_hits_itself_keeps_its_momentum_and_energy() {
    for friction in [0.0, 0.3] {
        let elastic = ContactSettings {
            damping_ratio: 0.0,
            augmentation: 0.0,
            ..ContactSettings::default()
        };
        let (mut model, _) = thrown([2.0, 1.0], 0.005, friction, elastic);
        model.set_step(1e-6);
        let (linear, angular) = momentum(&model);
        let moving = model.mass().iter().zip(model.v());
        let amount: f64 = moving.map(|(m, v)| m * norm(*v)).sum();
        model.step(false).unwrap();
        let energy = model.energies().drift();
        while model.time() < 3e-3 {
            model.step(false).unwrap();
        }
        // After the hit: in it the ledger adds energies of the step to kinetic energy half a step on.
        assert_eq!(penetrations(&model).2, 0);
        let open = (model.energies().drift() - energy).abs();
        assert!(model.self_contacts()[0].touched);
        assert_eq!(model.energies().friction > 0.0, friction > 0.0);
        let (l, a) = momentum(&model);
        let lost = norm(sub(l, linear));
        let turned = norm(sub(a, angular));
        eprintln!(
            "{lost} {turned} of {amount}; {open} of {energy} {:?}",
            model.energies()
        );
        assert!(lost < 1e-12 * amount, "{lost} of {amount}");
        // Friction acts between mid-surfaces, a thickness apart: a couple that nodes without rotations do not feel.
        let couple = if friction > 0.0 {
            THICKNESS
        } else {
            1e-4 * LEG
        };
        assert!(turned < couple * amount, "{turned} of {amount}");
        assert!(open < 0.01 * energy, "{open} J of {energy} J");
    }
}

#[test]
fn a_strip_thrown_at_itself_bounces_off() {
    for (speed, drift) in [(10.0, 0.0), (20.0, 10.0), (80.0, 0.0)] {
        let (mut model, _) = thrown([speed, drift], 0.005, 0.3, ContactSettings::default());
        let lines = zigzag_stations(2, 0.005).len();
        let mut deepest = 0.0f64;
        while model.time() < 1.5e-3 {
            model.step(false).unwrap();
            deepest = deepest.max(penetrations(&model).0);
            if model.cycle().is_multiple_of(20) {
                assert!(
                    !crosses_itself(&model, lines),
                    "{speed} m/s at {} s",
                    model.time()
                );
            }
        }
        assert!(deepest > 0.0 && deepest < THICKNESS, "{deepest} m");
    }
}

fn bits(v: &[Vec3]) -> Vec<u64> {
    v.as_flattened().iter().map(|x| x.to_bits()).collect()
}

fn steps(model: &mut Model, n: usize) {
    for _ in 0..n {
        model.step(false).unwrap();
    }
}

#[test]
fn a_fold_gives_the_same_bits_with_two_threads_and_after_it_was_taken_up_again() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let (mut model, _) = thrown([5.0, 1.0], 0.001, 0.3, ContactSettings::default());
            steps(&mut model, 64);
            let mut bytes = Vec::new();
            model.archive(&mut Archive::Save(&mut bytes)).unwrap();
            steps(&mut model, 20);
            (model, bytes)
        })
    };
    let (one, bytes) = run(1);
    let contact = &one.self_contacts()[0];
    // Worth something only if the restored run searches, touches and slides.
    assert!(contact.touched && contact.searches > 2 && contact.items.len() > 512);
    assert!(one.energies().friction > 0.0);
    let (two, _) = run(2);
    assert!(bits(one.x()) == bits(two.x()) && bits(one.v()) == bits(two.v()));
    let (mut other, _) = thrown([5.0, 1.0], 0.001, 0.3, ContactSettings::default());
    let mut archive = Archive::Load(&bytes);
    other.archive(&mut archive).unwrap();
    assert!(archive.is_at_end());
    steps(&mut other, 20);
    assert!(bits(one.x()) == bits(other.x()) && bits(one.v()) == bits(other.v()));
    assert_eq!(one.energies(), other.energies());
}
