//! A model whose state was written and read back goes on with the same bits.

mod common;

use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::archive::Archive;
use plyflow_mechanics::contact::{
    ContactSettings, Plane, RigidContact, RigidItem, SheetContact, SlaveItem, Tie, Ties,
};
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::model::{Drive, Model, Pressures, StepSettings};
use plyflow_mechanics::sheet::{Pressed, SheetSpec};
use std::sync::Arc;

/// Shears the upper sheet along y at its left edge, and lifts that.
struct Shear(Vec<Vec3>);

impl Drive for Shear {
    fn position(&self, k: usize, t: f64) -> Vec3 {
        let [x, y, z] = self.0[k];
        [x, y + 2.0 * t, z + 0.5 * t]
    }
}

/// A shell that lies under a bar on another one, which lies on a floor with friction; its edge is sheared.
fn pressed_stack() -> Model {
    const THICKNESS: f64 = 1e-3;
    let mesh = QuadMesh::grid(&even_axis(0.0, 0.1, 0.01), &even_axis(0.0, 0.08, 0.01));
    let n = mesh.points.len() as u32;
    let m = mesh.cells.len();
    let mut points: Vec<Vec3> = Vec::new();
    let mut specs = Vec::new();
    for k in 0..2u32 {
        let z = THICKNESS * (0.5 + f64::from(k));
        points.extend(mesh.points.iter().map(|p| [p[0], p[1], z]));
        let pressed = if k == 1 { Pressed::Above } else { Pressed::No };
        specs.push(SheetSpec {
            pressed: vec![pressed; m],
            ..common::sheet(&format!("sheet {k}"), &mesh, k * n, common::shell())
        });
    }
    let settings = StepSettings {
        target_step: 4e-6,
        safety: 0.8,
        damping: 50.0,
    };
    let mut model = Model::new(points.clone(), specs, settings).unwrap();
    let edge: Vec<u32> = (n..2 * n)
        .filter(|k| points[*k as usize][0] < 1e-9)
        .collect();
    let start = edge.iter().map(|k| points[*k as usize]).collect();
    model.set_driven(edge, Box::new(Shear(start)));
    let contact = ContactSettings::default();
    let items = (0..n).map(RigidItem::new);
    let floor = Arc::new(Plane { height: 0.0 });
    let on = RigidContact::new(
        "floor".into(),
        floor,
        0.5 * THICKNESS,
        0.3,
        &contact,
        items.collect(),
    );
    model.add_rigid_contact(on);
    // Both grids are the same: a node lies at the corner of the cell that begins with it, or ends.
    let corner = |k: u32| {
        let of = |c: &[u32; 4]| c.iter().position(|i| *i == k);
        let cells = mesh.cells.iter().enumerate();
        let (cell, at) = cells.filter_map(|(i, c)| Some((i, of(c)?))).next().unwrap();
        let xi = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]][at];
        SlaveItem::new(n + k, cell as u32, xi)
    };
    let slaves: Vec<SlaveItem> = (0..n).map(corner).collect();
    // Some of them are stitched on, not too many to slide.
    let tied = slaves.iter().step_by(17);
    let ties = tied.map(|s| Tie::new(s.node, s.cell, s.xi)).collect();
    let name = "sheet 1 on sheet 0".into();
    let mut on_sheet = SheetContact::new(name, 1.0, THICKNESS, 0.3, &contact, slaves);
    on_sheet.ties = Ties::new(ties);
    model.add_sheet_contact(on_sheet);
    model.set_contact_stiffness(&contact);
    model.set_pressures(Pressures {
        above: 1e5,
        ..model.pressures()
    });
    model
}

fn steps(model: &mut Model, n: u32) {
    for _ in 0..n {
        model.step(false).unwrap();
    }
}

#[test]
fn a_model_that_takes_up_a_state_goes_on_with_the_same_bits() {
    let mut model = pressed_stack();
    steps(&mut model, 777);
    let mut bytes = Vec::new();
    model.archive(&mut Archive::Save(&mut bytes)).unwrap();
    steps(&mut model, 500);
    // The case is worth something only if contacts hold and slide, and stitches have failed.
    let ledger = model.energies();
    let some = [ledger.friction, ledger.contact.abs(), ledger.bending];
    assert!(some.iter().all(|e| *e > 0.0), "{ledger:?}");

    let mut other = pressed_stack();
    let mut archive = Archive::Load(&bytes);
    other.archive(&mut archive).unwrap();
    assert!(archive.is_at_end());
    assert_eq!(other.cycle(), 777);
    steps(&mut other, 500);
    let bits = |v: &[Vec3]| -> Vec<u64> { v.as_flattened().iter().map(|x| x.to_bits()).collect() };
    assert!(bits(model.x()) == bits(other.x()) && bits(model.v()) == bits(other.v()));
    let spins = |m: &Model| bits(m.spins().unwrap());
    assert!(spins(&model) == spins(&other) && spins(&model).iter().any(|s| *s != 0));
    assert_eq!(ledger, other.energies());

    let cut = &bytes[..bytes.len() - 1];
    assert!(pressed_stack().archive(&mut Archive::Load(cut)).is_err());
}
