//! Sheets that bend in some of their cells and are membranes in the others.

mod common;

use plyflow_geometry::vec3::{Vec3, norm, sub};
use plyflow_mechanics::MechanicsError;
use plyflow_mechanics::archive::Archive;
use plyflow_mechanics::component::ElementInstance;
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::model::{Drive, Fixed, Model, NodalLoad, StepSettings};
use plyflow_mechanics::relax::{Tolerance, relax};
use plyflow_mechanics::sheet::{Elsewhere, SheetSpec};

/// Elements of 10 mm.
const SIZE: f64 = 0.01;

struct Clamp(Vec<Vec3>);

impl Drive for Clamp {
    fn position(&self, k: usize, _t: f64) -> Vec3 {
        self.0[k]
    }
}

fn centre(mesh: &QuadMesh, cell: &[u32; 4]) -> Vec3 {
    let corners = cell.map(|n| mesh.points[n as usize]);
    [0, 1, 2].map(|k| 0.25 * corners.iter().map(|p| p[k]).sum::<f64>())
}

/// A sheet that has `element`, and `other` where the centre of a cell is `elsewhere`.
fn spec(
    mesh: &QuadMesh,
    element: ElementInstance,
    other: Option<ElementInstance>,
    elsewhere: impl Fn(Vec3) -> bool,
) -> SheetSpec {
    let bending = QuadMesh {
        points: mesh.points.clone(),
        cells: (mesh.cells.iter())
            .filter(|c| other.is_none() || !elsewhere(centre(mesh, c)))
            .copied()
            .collect(),
    };
    let cells = mesh.cells.iter().map(|c| elsewhere(centre(mesh, c)));
    let elsewhere = other.map(|element| Elsewhere {
        element,
        cells: cells.collect(),
    });
    SheetSpec {
        patches: if element.sizes.patch_nodes > 0 {
            bending.patches()
        } else {
            Vec::new()
        },
        elsewhere,
        ..common::sheet("sheet", mesh, 0, element)
    }
}

fn model(mesh: &QuadMesh, spec: SheetSpec, step: f64) -> Model {
    let settings = StepSettings {
        target_step: step,
        safety: 0.8,
        damping: 0.0,
    };
    let mut model = Model::new(mesh.points.clone(), vec![spec], settings).unwrap();
    model.set_step(step);
    model
}

fn bits(v: &[Vec3]) -> Vec<u64> {
    v.as_flattened().iter().map(|x| x.to_bits()).collect()
}

/// A sheet of 24 x 20 elements, more than one block, that flaps about its left edge.
fn flapping(
    element: ElementInstance,
    other: Option<ElementInstance>,
    elsewhere: impl Fn(Vec3) -> bool,
) -> Model {
    let mesh = QuadMesh::grid(&even_axis(0.0, 0.24, SIZE), &even_axis(0.0, 0.2, SIZE));
    let mut model = model(&mesh, spec(&mesh, element, other, elsewhere), 8e-6);
    let edge = (0..mesh.points.len() as u32).filter(|n| mesh.points[*n as usize][0] < 1e-9);
    let edge: Vec<u32> = edge.collect();
    let at = edge.iter().map(|n| mesh.points[*n as usize]).collect();
    model.set_driven(edge, Box::new(Clamp(at)));
    let moving = model.v_mut().iter_mut().zip(&mesh.points);
    moving.for_each(|(v, p)| v[2] = (100.0 * p[0]).sin() * (1.0 + 2.0 * p[1]));
    model
}

fn steps(model: &mut Model, n: u32) {
    for _ in 0..n {
        model.step(false).unwrap();
    }
}

#[test]
fn a_sheet_whose_cells_are_all_of_one_kind_gives_the_bits_of_a_sheet_of_that_kind() {
    let membrane = || Some(common::membrane());
    let pairs = [
        (
            flapping(common::rotation_free(), membrane(), |_| false),
            flapping(common::rotation_free(), None, |_| false),
        ),
        (
            flapping(common::shell(), membrane(), |_| false),
            flapping(common::shell(), None, |_| false),
        ),
        (
            flapping(common::rotation_free(), membrane(), |_| true),
            flapping(common::membrane(), None, |_| false),
        ),
    ];
    for (mut mixed, mut plain) in pairs {
        steps(&mut mixed, 300);
        steps(&mut plain, 300);
        assert!(bits(mixed.x()) == bits(plain.x()) && bits(mixed.v()) == bits(plain.v()));
        assert_eq!(mixed.energies(), plain.energies());
        assert_eq!(mixed.critical_step(), plain.critical_step());
        assert_eq!(mixed.mass(), plain.mass());
    }
}

#[test]
fn a_sheet_of_two_elements_has_the_same_bits_on_two_threads_and_from_its_archive() {
    // A corner and an island of 7 x 7 elements bend.
    let outside =
        |p: Vec3| p[0] + p[1] > 0.15 && (p[0] - 0.18).abs().max((p[1] - 0.14).abs()) > 0.035;
    for element in [common::rotation_free, common::shell] {
        let start = || flapping(element(), Some(common::membrane()), outside);
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            pool.build().unwrap().install(|| {
                let mut model = start();
                steps(&mut model, 400);
                model
            })
        };
        let (mut one, two) = (on(1), on(2));
        assert!(bits(one.x()) == bits(two.x()) && bits(one.v()) == bits(two.v()));
        assert!(one.energies().bending > 0.0);

        let mut bytes = Vec::new();
        one.archive(&mut Archive::Save(&mut bytes)).unwrap();
        steps(&mut one, 200);
        let mut other = start();
        let mut archive = Archive::Load(&bytes);
        other.archive(&mut archive).unwrap();
        assert!(archive.is_at_end());
        steps(&mut other, 200);
        assert!(bits(one.x()) == bits(other.x()) && bits(one.v()) == bits(other.v()));
        assert_eq!(one.energies(), other.energies());
    }
}

#[test]
fn a_free_sheet_of_two_elements_keeps_its_energy() {
    for element in [common::rotation_free, common::stiff_shell] {
        let mut model = flapping(element(), Some(common::membrane()), |p| p[0] > 0.12);
        model.set_step(0.5 * model.critical_step().unwrap());
        steps(&mut model, 1);
        let (mut drift, mut bending) = (0.0f64, 0.0f64);
        let start = model.energies();
        for _ in 0..50 {
            steps(&mut model, 100);
            let now = model.energies();
            drift = drift.max((now.drift() - start.drift()).abs());
            bending = bending.max(now.bending);
        }
        println!(
            "drift {drift} J, bending {bending} J of {} J",
            start.kinetic
        );
        assert!(drift < 0.01 * start.kinetic, "{drift} of {start:?}");
        assert!(bending > 0.01 * start.kinetic, "{bending} of {start:?}");
    }
}

/// A strip of 150 x 20 mm, clamped over its first 20 mm, that bends up to 100 mm and is a membrane beyond; or that ends
/// at 100 mm, with the weight of the rest on its end. What it weighs acts downwards.
fn hung(whole: bool) -> (Model, QuadMesh) {
    const BENDS: f64 = 0.1;
    let length = if whole { 0.15 } else { BENDS };
    let mesh = QuadMesh::grid(&even_axis(0.0, length, SIZE), &even_axis(0.0, 0.02, SIZE));
    let other = whole.then(common::membrane);
    let spec = spec(&mesh, common::rotation_free(), other, |p| p[0] > BENDS);
    let mut model = model(&mesh, spec, 0.0);
    let held = |n: &u32| mesh.points[*n as usize][0] < 0.02 + 1e-9;
    let held: Vec<u32> = (0..mesh.points.len() as u32).filter(held).collect();
    let at = held.iter().map(|n| mesh.points[*n as usize]).collect();
    model.set_driven(held, Box::new(Clamp(at)));
    let fall = 0.2;
    model.set_body_acceleration([0.0, 0.0, -fall]);
    if !whole {
        // 1 kg/m2, 50 mm of it; nodes at the sides have half of what one in the middle has.
        let end = (0..mesh.points.len() as u32).filter(|n| mesh.points[*n as usize][0] > 0.0999);
        let load = |n: u32| {
            let middle = (mesh.points[n as usize][1] - SIZE).abs() < 1e-9;
            let width = if middle { SIZE } else { 0.5 * SIZE };
            NodalLoad {
                node: n,
                force: [0.0, 0.0, -fall * 0.05 * width],
                moment: [0.0; 3],
            }
        };
        model.set_loads(end.map(load).collect());
    }
    // Without twist and sway.
    for n in 0..mesh.points.len() as u32 {
        let translations = [false, true, false];
        model.fix(
            n,
            Fixed {
                translations,
                rotations: [false; 3],
            },
        );
    }
    let tolerance = Tolerance {
        balance: 1e-5,
        safety: 0.8,
        cycles: 1_000_000,
    };
    let relaxed = relax::<MechanicsError>(&mut model, tolerance, |_| Ok(())).unwrap();
    assert!(relaxed.balanced, "{relaxed:?}");
    (model, mesh)
}

#[test]
fn a_strip_bends_up_to_where_membranes_begin_and_these_hang_from_it_like_a_chain() {
    let ((mixed, mesh), (loaded, short)) = (hung(true), hung(false));
    let at = |model: &Model, mesh: &QuadMesh, x: f64| {
        let is = |p: &Vec3| (p[0] - x).abs() < 1e-9 && (p[1] - SIZE).abs() < 1e-9;
        model.x()[mesh.points.iter().position(is).unwrap()]
    };
    let (a, b) = (at(&mixed, &mesh, 0.1), at(&loaded, &short, 0.1));
    println!("ends of what bends: {a:?} m, {b:?} m");
    assert!(b[2] < -5e-4, "{b:?}");
    assert!(norm(sub(a, b)) < 2e-3 * b[2].abs(), "{a:?} and {b:?}");
    let tip = at(&mixed, &mesh, 0.15);
    let below = [a[0], a[1], a[2] - 0.05];
    assert!(norm(sub(tip, below)) < 1e-5, "{tip:?} under {a:?}");
}

#[test]
fn an_element_that_bends_is_refused_beside_another_one() {
    let mesh = QuadMesh::grid(&even_axis(0.0, 0.04, SIZE), &even_axis(0.0, 0.03, SIZE));
    let settings = StepSettings {
        target_step: 1e-6,
        safety: 0.8,
        damping: 0.0,
    };
    for other in [common::rotation_free(), common::shell()] {
        let spec = spec(&mesh, common::rotation_free(), Some(other), |p| p[0] > 0.02);
        let refused = Model::new(mesh.points.clone(), vec![spec], settings);
        let text = refused.err().expect("an error").to_string();
        assert!(text.contains("must be a membrane"), "{text}");
    }
}
