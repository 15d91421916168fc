//! Halves and quarters that mirror planes bound, against the whole and against their own energy.

mod common;

use plyflow_geometry::vec3::{Vec3, norm, sub};
use plyflow_mechanics::MechanicsError;
use plyflow_mechanics::archive::Archive;
use plyflow_mechanics::contact::{ContactSettings, SheetContact, SlaveItem};
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::mirror::{Mirrors, Planes, Whole, part_patches, reflect};
use plyflow_mechanics::model::{Model, StepSettings};
use plyflow_mechanics::sheet::SheetSpec;

const STEP: f64 = 1e-7;

/// The part of a sheet of 60 x 40 mm, elements of 10 mm, that planes bound.
fn part(planes: Planes) -> QuadMesh {
    let axis = |k: usize, half: f64| {
        let low = if planes.0[k] { 0.0 } else { -half };
        even_axis(low, half, 0.01)
    };
    QuadMesh::grid(&axis(0, 0.03), &axis(1, 0.02))
}

/// A model of `rf4` of such a part, and its mesh.
fn model(planes: Planes) -> (Model, QuadMesh) {
    let mesh = part(planes);
    let element = common::rotation_free();
    let (patches, ghosts) = part_patches(&mesh, planes, element.sizes.patch_nodes);
    let mut points = mesh.points.clone();
    points.extend(
        ghosts
            .iter()
            .map(|g| reflect(mesh.points[g.of as usize], g.image)),
    );
    let spec = SheetSpec {
        nodes: (0..points.len() as u32).collect(),
        patches,
        ..common::sheet("sheet", &mesh, 0, element)
    };
    let settings = StepSettings {
        target_step: STEP,
        safety: 0.8,
        damping: 0.0,
    };
    let mut model =
        Model::mirrored(points, vec![spec], settings, Mirrors { planes, ghosts }).unwrap();
    model.set_step(STEP);
    (model, mesh)
}

/// A deformation that both planes mirror.
fn deformed(p: Vec3) -> Vec3 {
    let (x, y) = (p[0] / 0.03, p[1] / 0.02);
    [
        p[0] * (1.01 + 0.02 * y * y),
        p[1] * (0.99 + 0.03 * x * x),
        0.004 * (x * x + 0.7 * y * y - 0.4 * x * x * y * y),
    ]
}

/// Puts a part to `x` (its own nodes) and makes a step from rest: energies there and forces.
fn forces(planes: Planes, x: &[Vec3]) -> (f64, f64, Vec<Vec3>, Model) {
    let (mut model, _) = model(planes);
    model.x_mut()[..x.len()].copy_from_slice(x);
    model.place_ghosts();
    model.step(false).unwrap();
    let e = model.energies();
    let force = |n: usize| model.v()[n].map(|v| v * model.mass()[n] / STEP);
    let forces = (0..x.len()).map(force).collect();
    (e.membrane + e.hourglass, e.bending, forces, model)
}

fn place(mesh: &QuadMesh) -> Vec<Vec3> {
    mesh.points.iter().map(|p| deformed(*p)).collect()
}

#[test]
fn energies_and_forces_of_halves_and_quarters_are_those_of_the_whole() {
    let none = Planes::default();
    let whole = part(none);
    let (membrane, bending, all, _) = forces(none, &place(&whole));
    assert!(bending > 1e-4 && membrane > 1e-4, "{membrane} {bending}");
    let largest = all.iter().map(|f| norm(*f)).fold(0.0, f64::max);
    for planes in [[true, false], [false, true], [true, true]].map(Planes) {
        let mesh = part(planes);
        let n = planes.copies() as f64;
        let (m, b, own, model) = forces(planes, &place(&mesh));
        assert!((n * m / membrane - 1.0).abs() < 1e-12, "{m} {membrane}");
        assert!((n * b / bending - 1.0).abs() < 1e-12, "{b} {bending}");
        assert!((n * model.mass().iter().sum::<f64>() - 0.06 * 0.04).abs() < 1e-12);
        for (p, f) in mesh.points.iter().zip(own) {
            let near = |q: &Vec3| norm(sub(*q, *p)) < 1e-9;
            let twin = all[whole.points.iter().position(near).unwrap()];
            // What pushes off a plane is held there.
            let on = planes.holding(*p);
            let expected = [0, 1, 2].map(|c| {
                let held = c < 2 && on[c];
                if held {
                    0.0
                } else {
                    twin[c] * planes.share(*p)
                }
            });
            let apart = norm(sub(f, expected));
            assert!(apart < 1e-11 * largest, "{p:?}: {f:?} {expected:?}");
        }
        let step = model.critical_step().unwrap();
        let (_, _, _, all) = forces(none, &place(&whole));
        let reference = all.critical_step().unwrap();
        assert!((step / reference - 1.0).abs() < 1e-6, "{step} {reference}");
    }
}

#[test]
fn forces_of_a_quarter_with_ghosts_are_the_gradient_of_its_energy() {
    let planes = Planes([true; 2]);
    let mesh = part(planes);
    let x = place(&mesh);
    let (_, _, force, _) = forces(planes, &x);
    let largest = force.iter().map(|f| norm(*f)).fold(0.0, f64::max);
    let h = 1e-7;
    for n in 0..x.len() {
        let on = planes.holding(mesh.points[n]);
        for c in (0..3).filter(|c| *c == 2 || !on[*c]) {
            let energy = |d: f64| {
                let mut moved = x.clone();
                moved[n][c] += d;
                let (m, b, _, _) = forces(planes, &moved);
                m + b
            };
            let slope = (energy(h) - energy(-h)) / (2.0 * h);
            let apart = (slope + force[n][c]).abs();
            assert!(
                apart < 1e-6 * largest,
                "node {n}, {c}: {slope} {}",
                force[n][c]
            );
        }
    }
}

#[test]
fn ghosts_follow_their_images_and_rigid_motion_along_a_plane_costs_nothing() {
    let planes = Planes([true, false]);
    let (mut model, mesh) = model(planes);
    for v in &mut model.v_mut()[..mesh.points.len()] {
        *v = [0.0, 0.3, -0.2];
    }
    for _ in 0..20 {
        model.step(false).unwrap();
    }
    let way = 20.0 * STEP;
    let whole = Whole::new(&mesh.points, &mesh.cells, planes);
    let ghosts = model.x().len() - mesh.points.len();
    // One row beside the plane.
    assert_eq!(ghosts, 5);
    for p in &model.x()[mesh.points.len()..] {
        let stands = [p[0], p[1] - 0.3 * way, p[2] + 0.2 * way];
        let near = |q: &Vec3| norm(sub(*q, stands)) < 1e-12;
        assert!(
            p[0] < 0.0 && whole.points(&mesh.points).iter().any(near),
            "{p:?}"
        );
    }
    let e = model.energies();
    assert!(e.internal() < 1e-12, "{e:?}");
}

#[test]
fn a_ghost_of_a_node_without_a_patch_is_refused() {
    let planes = Planes([true, false]);
    let mesh = part(planes);
    let (_, ghosts) = part_patches(&mesh, planes, 0);
    let mut points = mesh.points.clone();
    points.extend(ghosts.iter().map(|g| mesh.points[g.of as usize]));
    let spec = SheetSpec {
        nodes: (0..points.len() as u32).collect(),
        ..common::sheet("sheet", &mesh, 0, common::rotation_free())
    };
    let settings = StepSettings {
        target_step: STEP,
        safety: 0.8,
        damping: 0.0,
    };
    let refused = Model::mirrored(points, vec![spec], settings, Mirrors { planes, ghosts });
    let Err(MechanicsError::Input(text)) = refused else {
        panic!("a ghost without a patch was taken");
    };
    assert!(text.contains("belongs to a patch"), "{text}");
}

#[test]
fn a_quarter_that_takes_up_a_state_goes_on_with_the_same_bits() {
    let start = || {
        let planes = Planes([true; 2]);
        let (mut model, mesh) = model(planes);
        let x = place(&mesh);
        model.x_mut()[..x.len()].copy_from_slice(&x);
        model.place_ghosts();
        model
    };
    let steps = |m: &mut Model| (0..30).for_each(|_| m.step(false).unwrap());
    let mut model = start();
    steps(&mut model);
    let mut bytes = Vec::new();
    model.archive(&mut Archive::Save(&mut bytes)).unwrap();
    steps(&mut model);
    let mut other = start();
    other.archive(&mut Archive::Load(&bytes)).unwrap();
    steps(&mut other);
    assert!(model.x() == other.x() && model.v() == other.v());
    assert!(norm(model.v()[3]) > 0.0);
}

/// A trough z = 0.3 |x| along y of elements of 10 mm, and a finer one that is pressed 0.1 mm into it.
fn troughs(planes: Planes) -> (Model, Vec<Vec3>) {
    const OFFSET: f64 = 1e-3;
    let low = if planes.0[0] { 0.0 } else { -0.04 };
    let mesh = |size: f64| QuadMesh::grid(&even_axis(low, 0.04, size), &even_axis(0.0, 0.02, size));
    let (lower, upper) = (mesh(0.01), mesh(0.004));
    let over = 0.9 * OFFSET * (1.0 + 0.3f64 * 0.3).sqrt();
    let mut points: Vec<Vec3> = Vec::new();
    let mut specs = Vec::new();
    for (mesh, up) in [(&lower, 0.0), (&upper, over)] {
        let first = points.len() as u32;
        points.extend(
            mesh.points
                .iter()
                .map(|p| [p[0], p[1], 0.3 * p[0].abs() + up]),
        );
        specs.push(SheetSpec {
            axis: [0.0, 1.0, 0.0],
            steered: None,
            ..common::sheet("trough", mesh, first, common::membrane())
        });
    }
    let settings = StepSettings {
        target_step: 1e-6,
        safety: 0.8,
        damping: 0.0,
    };
    let mirrors = Mirrors {
        planes,
        ghosts: Vec::new(),
    };
    let n = lower.points.len();
    let place = |k: usize| {
        let p = upper.points[k];
        let holds = |c: &[u32; 4]| {
            let [a, _, b, _] = c.map(|n| lower.points[n as usize]);
            (0..2).all(|k| a[k] - 1e-9 <= p[k] && p[k] <= b[k] + 1e-9)
        };
        let cell = lower.cells.iter().position(holds).unwrap();
        let [a, _, b, _] = lower.cells[cell].map(|n| lower.points[n as usize]);
        let xi = [0, 1].map(|k| 2.0 * (p[k] - a[k]) / (b[k] - a[k]) - 1.0);
        SlaveItem::new((n + k) as u32, cell as u32, xi)
    };
    // Soft, so that a step moves nodes by less than a micrometre.
    let contact = ContactSettings {
        stiffness_factor: 0.003,
        ..ContactSettings::default()
    };
    let items = (0..upper.points.len()).map(place).collect();
    let start = points.clone();
    let mut model = Model::mirrored(points, specs, settings, mirrors).unwrap();
    model.set_step(1e-6);
    let without = ContactSettings {
        augmentation: 0.0,
        ..contact
    };
    let name = "trough/trough".into();
    let pair = SheetContact::new(name, 1.0, OFFSET, 0.2, &without, items);
    model.add_sheet_contact(pair);
    model.set_contact_stiffness(&contact);
    (model, start)
}

#[test]
fn in_a_fold_on_a_plane_a_node_touches_the_image_of_the_other_face() {
    let run = |planes: Planes, steps: usize| {
        let (mut model, start) = troughs(planes);
        for _ in 0..steps {
            model.step(false).unwrap();
        }
        (model, start)
    };
    // The second step has speeds for dampers and friction. Closest points are searched anew for every fourth node in turn,
    // so that the whole is no longer exactly its own mirror image.
    for (steps, bound) in [(1, 1e-8), (2, 1e-5)] {
        let (whole, places) = run(Planes::default(), steps);
        let (half, own) = run(Planes([true, false]), steps);
        let fastest = whole.v().iter().map(|v| norm(*v)).fold(0.0, f64::max);
        assert!(fastest > 0.1, "{fastest}");
        for (n, p) in own.iter().enumerate() {
            let near = |q: &Vec3| norm(sub(*q, *p)) < 1e-9;
            let twin = places.iter().position(near).unwrap();
            let (a, b) = (half.v()[n], whole.v()[twin]);
            assert!(
                norm(sub(a, b)) < bound * fastest,
                "{steps}: {p:?}: {a:?} {b:?}"
            );
        }
    }
    let (whole, half) = (run(Planes::default(), 1).0, run(Planes([true, false]), 1).0);
    let stored = |m: &Model| m.energies().contact;
    assert!((2.0 * stored(&half) / stored(&whole) - 1.0).abs() < 1e-12);
    // Only in the fold is that more than the distance from one face.
    let line = half.sheet_contacts()[0]
        .items
        .iter()
        .filter(|i| half.x()[i.node as usize][0] == 0.0);
    let deep: Vec<f64> = line.map(|i| i.penetration).collect();
    assert!(deep.iter().all(|d| *d > 1.1e-4 && *d < 1.5e-4), "{deep:?}");
}

#[test]
fn nodes_that_reach_a_plane_are_held_off_it_and_come_back() {
    let planes = Planes([true, false]);
    let (mut model, mesh) = model(planes);
    model.add_plane_contacts(&ContactSettings {
        damping_ratio: 0.0,
        ..ContactSettings::default()
    });
    // A membrane of no size: its last column alone flies at the plane.
    let far: Vec<usize> = (0..mesh.points.len())
        .filter(|n| mesh.points[*n][0] > 0.0)
        .collect();
    let contact = |m: &Model| {
        m.rigid_contacts()
            .iter()
            .map(|c| c.items.len())
            .sum::<usize>()
    };
    assert_eq!(contact(&model), far.len());
    let node = far[0];
    model.x_mut()[node][0] = 1e-6;
    model.x_mut()[node][2] = 0.01;
    model.place_ghosts();
    model.v_mut()[node] = [-20.0, 0.0, 0.0];
    let mut least = f64::INFINITY;
    for _ in 0..200 {
        model.step(false).unwrap();
        least = least.min(model.x()[node][0]);
    }
    let touched = model
        .rigid_contacts()
        .iter()
        .any(|c| c.name == "symmetry_x/sheet");
    assert!(touched && least < 0.0 && least > -2e-4, "{least}");
    assert!(
        model.x()[node][0] > 0.0 && model.v()[node][0] > 0.0,
        "{:?}",
        model.x()[node]
    );
}
