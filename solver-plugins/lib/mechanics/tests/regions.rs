//! Friction and materials by region against closed forms: a block on an incline of which half is lubricated, from above or from below; a sheet sheared
//! evenly of which a part has no stitches.

mod common;

use plyflow_geometry::vec3::Vec3;
use plyflow_kernels::m4::M4;
use plyflow_mechanics::contact::{
    ContactSettings, FrictionLaw, NodeLaws, Partner, Plane, RegionalFriction, RigidContact,
    RigidItem, SheetContact, SlaveItem,
};
use plyflow_mechanics::history::smooth_step;
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::model::{Drive, Model, StepSettings};
use plyflow_mechanics::sheet::OtherMaterial;
use std::sync::Arc;

const DRY: f64 = 0.4;
const SLICK: f64 = 0.1;
const THICKNESS: f64 = 1e-3;
const STEP: StepSettings = StepSettings {
    target_step: 1e-5,
    safety: 0.8,
    damping: 0.0,
};

/// Holds nodes where they start.
struct Still(Vec<Vec3>);

impl Drive for Still {
    fn position(&self, k: usize, _: f64) -> Vec3 {
        self.0[k]
    }
}

/// What a block lies on.
enum Ground {
    /// A rigid plane.
    Plane,
    /// A sheet that is held, of cells of 10 mm from x = y = -5 mm on.
    Sheet,
}

/// A block of 70 x 20 mm in cells of 10 x 10 mm, its nodes first.
fn block() -> QuadMesh {
    QuadMesh::grid(&even_axis(0.0, 0.07, 0.01), &even_axis(0.0, 0.02, 0.01))
}

/// Mean acceleration (m/s2) of a block down a plane inclined by `angle` (rad) under gravity.
fn incline(angle: f64, ground: &Ground, law: impl Fn(&Model) -> FrictionLaw) -> f64 {
    let mesh = block();
    let n = mesh.points.len() as u32;
    let mut points = mesh.points.clone();
    let mut specs = vec![common::sheet("block", &mesh, 0, common::membrane())];
    let lower = QuadMesh::grid(
        &even_axis(-0.005, 0.085, 0.01),
        &even_axis(-0.005, 0.025, 0.01),
    );
    if matches!(ground, Ground::Sheet) {
        points.extend(lower.points.iter().map(|p| [p[0], p[1], -THICKNESS]));
        specs.push(common::sheet("lower", &lower, n, common::membrane()));
    }
    let mut model = Model::new(points.clone(), specs, STEP).unwrap();
    let held: Vec<u32> = (n..points.len() as u32).collect();
    let places = held.iter().map(|k| points[*k as usize]).collect();
    model.set_driven(held, Box::new(Still(places)));
    let contact = ContactSettings::default();
    let law = law(&model);
    match ground {
        Ground::Plane => {
            let items = (0..n).map(RigidItem::new).collect();
            let floor = Arc::new(Plane { height: 0.0 });
            model.add_rigid_contact(RigidContact::new(
                "plane".into(),
                floor,
                0.0,
                law,
                &contact,
                items,
            ));
        }
        Ground::Sheet => {
            // Nodes of the block lie in the middles of the cells below.
            let first = model.sheets()[1].cell_range.0;
            let under = |k: u32| {
                let p = points[k as usize];
                let holds = |c: &[u32; 4]| {
                    let a = points[c[0] as usize];
                    (0..2).all(|d| (p[d] - a[d] - 0.005).abs() < 1e-9)
                };
                let cell = model.cells()[first..].iter().position(holds).unwrap();
                SlaveItem::new(k, (first + cell) as u32, [0.0; 2])
            };
            let items = (0..n).map(under).collect();
            let on = SheetContact::new("sheet".into(), 1.0, THICKNESS, law, &contact, items);
            model.add_sheet_contact(on);
        }
    }
    model.set_contact_stiffness(&contact);
    let speed = |m: &Model| {
        let moved: f64 = (0..n as usize).map(|k| m.mass()[k] * m.v()[k][0]).sum();
        moved / (0..n as usize).map(|k| m.mass()[k]).sum::<f64>()
    };
    let settle = 0.02;
    let mut seen = [0.0; 2];
    while model.time() < settle + 0.03 {
        let tilt = if model.time() < settle { 0.0 } else { angle };
        let weight = 9.81 * smooth_step(model.time(), 0.0, 0.5 * settle);
        model.set_body_acceleration([weight * tilt.sin(), 0.0, -weight * tilt.cos()]);
        model.step(false).unwrap();
        if model.time() < settle + 0.015 {
            seen[0] = speed(&model);
        }
        seen[1] = speed(&model);
    }
    (seen[1] - seen[0]) / 0.015
}

fn laws(slave: NodeLaws, partner: Partner) -> FrictionLaw {
    FrictionLaw::Regional(Arc::new(RegionalFriction {
        laws: vec![DRY.into(), SLICK.into()],
        slave,
        partner,
    }))
}

/// Law 1 for the nodes of these places.
fn inside(model: &Model, sheet: usize, holds: impl Fn(Vec3) -> bool) -> NodeLaws {
    NodeLaws::new(&model.sheets()[sheet].nodes, |n| {
        u16::from(holds(model.x()[n as usize]))
    })
}

fn near(got: f64, angle: f64, coefficient: f64) {
    let law = 9.81 * (angle.sin() - coefficient * angle.cos());
    assert!(
        (got / law - 1.0).abs() < 0.01,
        "{got} m/s2 instead of {law} with {coefficient}"
    );
}

#[test]
fn a_block_half_of_which_is_lubricated_slides_by_the_mean_coefficient() {
    let angle = 0.45f64.atan();
    // Four of eight rows of nodes, the rear ones: half of the weight. And none, and all.
    for (reach, coefficient) in [(-1.0, DRY), (0.035, 0.5 * (DRY + SLICK)), (1.0, SLICK)] {
        let got = incline(angle, &Ground::Plane, |m| {
            laws(inside(m, 0, |p| p[0] < reach), Partner::Bare)
        });
        near(got, angle, coefficient);
    }
    // As a constant coefficient to the bit where there is nothing inside.
    let none = incline(angle, &Ground::Plane, |m| {
        laws(inside(m, 0, |_| false), Partner::Bare)
    });
    assert_eq!(none, incline(angle, &Ground::Plane, |_| DRY.into()));
}

#[test]
fn a_region_of_the_sheet_below_counts_by_the_nodes_of_its_cells_and_the_lesser_of_both_holds() {
    let angle = 0.45f64.atan();
    let below = |m: &Model, reach: f64| {
        let (first, end) = m.sheets()[1].cell_range;
        Partner::Sheet {
            laws: inside(m, 1, |p| p[0] < reach),
            cells: m.cells()[first..end].to_vec(),
            first_cell: first as u32,
        }
    };
    let dry = |m: &Model| inside(m, 0, |_| false);
    // Weight of the rows of the block's nodes: a half, one, .., one, a half. Those at 0, 10 and 20 mm lie in lubricated cells, that at 30 mm in one of which
    // half of the nodes are (those at 25 mm, not at 35 mm).
    let share = (0.5 + 1.0 + 1.0 + 0.5) / 7.0;
    let mean = |share: f64| DRY + share * (SLICK - DRY);
    near(
        incline(angle, &Ground::Sheet, |m| laws(dry(m), below(m, 0.026))),
        angle,
        mean(share),
    );
    near(
        incline(angle, &Ground::Sheet, |m| laws(dry(m), below(m, -1.0))),
        angle,
        DRY,
    );
    // The block is lubricated in front, the sheet behind: all slides as lubricated.
    let front = |m: &Model| inside(m, 0, |p| p[0] > 0.021);
    near(
        incline(angle, &Ground::Sheet, |m| laws(front(m), below(m, 0.026))),
        angle,
        SLICK,
    );
}

#[test]
fn a_sheared_sheet_without_stitches_in_a_part_has_the_mean_of_both_energies_by_area() {
    let mesh = QuadMesh::grid(&even_axis(0.0, 0.05, 0.01), &even_axis(0.0, 0.04, 0.01));
    let part = |name: &str| common::STITCHED.find(name).unwrap();
    let (from, to) = (part("\"stitch\""), part("\"bending\""));
    let bare = format!("{}{}", &common::STITCHED[..from], &common::STITCHED[to..]);
    // Simple shear of all nodes: the energy is that of every element.
    let energy = |removed: Option<f64>| {
        let centre =
            |c: &[u32; 4]| 0.25 * c.iter().map(|n| mesh.points[*n as usize][0]).sum::<f64>();
        let other = removed.map(|reach| OtherMaterial {
            element: common::instance::<M4>(&bare),
            elsewhere: None,
            cells: mesh.cells.iter().map(|c| centre(c) < reach).collect(),
        });
        let mut spec = common::sheet("sheet", &mesh, 0, common::instance::<M4>(common::STITCHED));
        spec.other_material = other;
        let mut model = Model::new(mesh.points.clone(), vec![spec], STEP).unwrap();
        for p in model.x_mut() {
            p[0] += 0.04 * p[1];
        }
        model.step(false).unwrap();
        model.energies().membrane
    };
    let (with, without) = (energy(None), energy(Some(1.0)));
    assert!(with > 1.05 * without, "{with} {without}");
    for (reach, share) in [(0.011, 0.2), (0.026, 0.6), (-1.0, 0.0)] {
        let expected = with + share * (without - with);
        let got = energy(Some(reach));
        assert!(
            (got / expected - 1.0).abs() < 1e-9,
            "{got} J instead of {expected} J"
        );
    }
}
