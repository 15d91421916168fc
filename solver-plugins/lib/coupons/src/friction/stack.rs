//! A sheet that is pulled out from between two others.

use super::sliding::{
    BEGIN, Finding, Finds, GRAVITY, MEASURED, Means, PULL_TIME, Parameters, Pull, carry_out,
};
use crate::run::Test;
use crate::specimen::{Specimen, Stacked};
use plyflow_mechanics::contact::{ContactSettings, SheetContact, SlaveItem};
use plyflow_mechanics::history::smooth_step;
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::model::{Fixed, Pressures};
use plyflow_mechanics::sheet::Pressed;
use plyflow_sdk::{Host, StepError};

/// Side of the upper sheet (m), on which the pressure acts.
const SIDE: f64 = 0.05;
/// Ends along x (m) and half widths (m) of the lower, the middle and the upper sheet: the upper one stays on the middle one, and that on
/// the lower one, all the way.
const SHEETS: [([f64; 2], f64); 3] = [
    ([-0.06, 0.08], 0.04),
    ([-0.05, 0.07], 0.03),
    ([-0.5 * SIDE, 0.5 * SIDE], 0.5 * SIDE),
];

struct Stack {
    pressure: f64,
    law: f64,
    /// Driven nodes that stay where they are; the others pull.
    still: usize,
    /// A pulled node: its number, where it began along x, and where it is (m).
    end: (usize, f64, f64),
    means: Means,
}

impl Test for Stack {
    fn duration(&self) -> f64 {
        BEGIN + MEASURED[1] * PULL_TIME
    }

    fn apply(&mut self, specimen: &mut Specimen, t: f64) {
        let pressures = Pressures {
            above: self.pressure * smooth_step(t, 0.0, 0.5 * BEGIN),
            ..specimen.model.pressures()
        };
        specimen.model.set_pressures(pressures);
    }

    fn stepped(&mut self, specimen: &Specimen) {
        let model = &specimen.model;
        let pull = model.reactions()[self.still..].iter().map(|r| r[0]);
        self.means.count(model.time(), pull.sum());
        self.end.2 = model.x()[self.end.0][0];
    }

    fn sample(&mut self, _specimen: &Specimen, t: f64) {
        self.means.sample(t);
    }

    fn phase(&self) -> &'static str {
        "pulling"
    }
}

impl Finds for Stack {
    fn finding(self) -> Finding {
        Finding {
            result: "pulling_force",
            what: "pulling force",
            unit: "N",
            got: self.means.mean(),
            law: self.law,
            slid: self.end.2 - self.end.1,
            time: self.means.time,
            value: self.means.value,
        }
    }
}

/// The cell of a grid that lies below a point, and the place in it; both grids are flat.
fn below(mesh: &QuadMesh, p: [f64; 3]) -> Option<(u32, [f64; 2])> {
    let inside = |c: &[u32; 4]| {
        let (a, b) = (mesh.points[c[0] as usize], mesh.points[c[2] as usize]);
        let xi = [0, 1].map(|k| 2.0 * (p[k] - a[k]) / (b[k] - a[k]) - 1.0);
        xi.iter().all(|x| x.abs() <= 1.0 + 1e-9).then_some(xi)
    };
    let mut cells = mesh.cells.iter().enumerate();
    cells.find_map(|(i, c)| inside(c).map(|xi| (i as u32, xi)))
}

/// A sheet, by its number from below.
fn mesh_of(k: usize, size: f64, thickness: f64) -> QuadMesh {
    let (x, y) = SHEETS[k];
    let mut mesh = QuadMesh::grid(&even_axis(x[0], x[1], size), &even_axis(-y, y, size));
    for point in &mut mesh.points {
        point[2] = thickness * k as f64;
    }
    mesh
}

/// The nodes of a sheet, from `first` on, on the cells from `cell0` on of the sheet below.
fn items_on(lower: &QuadMesh, cell0: u32, upper: &QuadMesh, first: usize) -> Vec<SlaveItem> {
    let item = |i: usize| {
        let node = (first + i) as u32;
        let (cell, xi) = below(lower, upper.points[i])?;
        Some(SlaveItem::new(node, cell0 + cell, xi))
    };
    (0..upper.points.len()).filter_map(item).collect()
}

pub(super) fn test(host: &Host, p: &Parameters) -> Result<(), StepError> {
    p.common.allow(
        SHEETS
            .iter()
            .map(|(x, y)| 2.0 * y * (x[1] - x[0]))
            .sum::<f64>(),
    )?;
    let (size, thickness) = (p.common.element_size, p.common.thickness());
    let meshes = [0, 1, 2].map(|k| mesh_of(k, size, thickness));
    let sheets = [0, 1, 2].map(|k| Stacked {
        name: ["lower", "middle", "upper"][k],
        mesh: meshes[k].clone(),
        axis: [1.0, 0.0, 0.0],
        pressed: if k == 2 { Pressed::Above } else { Pressed::No },
    });
    let mut specimen = Specimen::of_sheets(host, &p.common, &sheets)?;
    let n = meshes.each_ref().map(|m| m.points.len());
    let first = [0, n[0], n[0] + n[1]];
    let points = specimen.mesh.points.clone();
    let model = &mut specimen.model;
    let mut driven: Vec<u32> = (0..first[1] as u32).collect();
    let still = driven.len();
    let edge = |n: &u32| points[*n as usize][0] > SHEETS[1].0[1] - 1e-9;
    driven.extend((first[1] as u32..first[2] as u32).filter(edge));
    let end = driven[still] as usize;
    let drive = Pull {
        start: driven.iter().map(|n| points[*n as usize]).collect(),
        still,
        direction: [1.0, 0.0, 0.0],
    };
    model.set_driven(driven, Box::new(drive));
    // The upper sheet only sinks, so that all of the pressure goes through the stack.
    let sinks = Fixed {
        translations: [true, true, false],
        rotations: [false; 3],
    };
    for n in first[2]..points.len() {
        model.fix(n as u32, sinks);
    }
    let contact = ContactSettings::default();
    for k in [1, 2] {
        let cell0 = model.sheets()[k - 1].cell_range.0 as u32;
        let items = items_on(&meshes[k - 1], cell0, &meshes[k], first[k]);
        let name = format!("{}/{}", sheets[k - 1].name, sheets[k].name);
        let on = SheetContact::new(name, 1.0, thickness, p.coefficient, &contact, items);
        model.add_sheet_contact(on);
    }
    model.set_contact_stiffness(&contact);
    // A membrane's slack tail would float up and fold over the edge of the upper sheet; its weight keeps it down.
    model.set_body_acceleration([0.0, 0.0, -GRAVITY]);
    let stack = Stack {
        pressure: p.pressure,
        law: 2.0 * p.coefficient * p.pressure * SIDE * SIDE,
        still,
        end: (end, points[end][0], points[end][0]),
        means: Means::default(),
    };
    carry_out(host, p, specimen, stack)
}
