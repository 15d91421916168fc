//! Slaves that slide past the rim of a sheet: the sheet grows thinner there, and hands them over by and by.

mod common;

use common::slave::{OFFSET, contact, evaluate, gradient_errors, pace, scene, scene_of};
use plyflow_geometry::vec3::{Vec3, add, dot, norm, scale, sub};
use plyflow_mechanics::contact::{
    ContactSettings, Plane, RigidContact, RigidItem, SheetContact, SlaveItem, Surface, ledge,
    rim_height,
};
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::model::{Drive, Model, StepSettings};
use std::sync::Arc;

/// What a cell goes on by past its rim, over its length.
const LEDGE: f64 = 0.25;

/// Distance (m) at which a slave is held there, by what is left of the ledge along both sides of a cell of the length `cell` (m): less by
/// seven tenths at the end, or by what a parabola falls that is as steep as 1 in 2 there.
fn held(cell: f64, past: [f64; 2]) -> f64 {
    let most = (0.7 * OFFSET).min(0.5 * 0.5 * LEDGE * cell);
    OFFSET - most * (1.0 - (1.0 - past[0] * past[0]) * (1.0 - past[1] * past[1]))
}

/// A flat sheet of four cells of the length `cell` (m) and a slave at `height` (m) over its plane, past its rims x = cell and y = -cell by the shares `past`
/// of the ledge, or as far inside of the sheet as in its middle where that is 0.
fn beside(cell: f64, past: [f64; 2], height: f64) -> (QuadMesh, Vec<Vec3>) {
    let at = |p: f64, inside: f64| if p > 0.0 { 1.0 + LEDGE * p } else { inside };
    let place = [cell * at(past[0], 0.4), -cell * at(past[1], 0.3)];
    let (mesh, mut x) = scene_of(cell, 0.0, place, height);
    x.iter_mut().rev().skip(1).for_each(|x| x[2] = 0.0);
    (mesh, x)
}

/// What a contact sees of a sheet.
fn surface_of<'a>(
    mesh: &'a QuadMesh,
    neighbours: &'a [[u32; 4]],
    x: &'a [Vec3],
    normals: &'a [Vec3],
) -> Surface<'a> {
    Surface {
        cells: &mesh.cells,
        neighbours,
        x,
        normals,
    }
}

/// Sizes of cells (m), and shares of their ledges along both sides: past one rim, past the other, at their corner.
fn places() -> impl Iterator<Item = (f64, [f64; 2])> {
    let shares = [0.05, 0.5, 0.95];
    let rims = move || shares.into_iter().flat_map(|a| [[a, 0.0], [0.0, a]]);
    let corners = move || shares.into_iter().flat_map(move |a| shares.map(|b| [a, b]));
    [0.008, 0.001]
        .into_iter()
        .flat_map(move |cell| rims().chain(corners()).map(move |p| (cell, p)))
}

#[test]
fn past_a_rim_the_distance_shrinks_and_the_force_is_the_gradient_of_its_energy() {
    for (cell, past) in places() {
        let held = held(cell, past);
        let energy = |height: f64| {
            let (mesh, x) = beside(cell, past, height);
            evaluate(&mesh, &x, 0).0
        };
        assert_eq!(energy(1.0001 * held), 0.0, "{cell} m, {past:?}");
        let depth = 0.1 * OFFSET;
        let expected = 0.5e5 * depth * depth;
        let got = energy(held - depth);
        assert!(
            (got / expected - 1.0).abs() < 1e-9,
            "{cell} m, {past:?}: {got} J"
        );
        let [slave, master] = gradient_errors(beside(cell, past, 0.7 * held));
        assert!(slave < 1e-4, "{cell} m, {past:?}: {slave}");
        // The way from the place to the slave turns with the master's cell, which moves the place along the ledge: that is left out. Of the force it is
        // the slope, 1 in 2 at most, times that way over the cell's length.
        let left_out = 0.5 * held / cell;
        assert!(master < left_out, "{cell} m, {past:?}: {master}");
    }
}

#[test]
fn past_a_rim_a_contact_is_not_stiffer_than_a_step_can_bear() {
    for (cell, past) in places() {
        let (mesh, x) = beside(cell, past, 0.7 * held(cell, past));
        let (energy, f) = evaluate(&mesh, &x, 0);
        let depth = (energy / 0.5e5).sqrt();
        // Force over depth: the stiffness times the length of the gradient, by which the stiffness against the motion is once more.
        let gradient = norm(f[f.len() - 1]) / (1e5 * depth);
        assert!(
            gradient * gradient < 1.0 + 0.5 * 0.5 + 1e-6,
            "{cell} m, {past:?}: {gradient}"
        );
    }
}

#[test]
fn past_a_rim_a_slave_that_passes_the_middle_of_the_sheet_is_pushed_as_before() {
    let past = [0.5, 0.0];
    let (mesh, mut x) = beside(0.008, past, OFFSET);
    let (neighbours, normals) = (mesh.neighbours(), vec![[0.0, 0.0, 1.0]; x.len()]);
    let v = vec![[0.0; 3]; x.len()];
    let node = x.len() - 1;
    let mut c = contact(node as u32, 1);
    for k in 0..=1000 {
        let height = OFFSET * (1.0 - 1.3 * f64::from(k) / 1000.0);
        x[node][2] = height;
        let surface = surface_of(&mesh, &neighbours, &x, &normals);
        c.compute(&surface, &v, pace(1e-6));
        // Where the two planes are the same, no way out is better than another.
        if height.abs() < 0.02 * OFFSET {
            continue;
        }
        let depth = (held(0.008, past) - height).max(0.0);
        let got = c.items[0].penetration;
        assert!(
            (got - depth).abs() < 1e-3 * OFFSET,
            "{height} m: {got} m, not {depth}"
        );
    }
}

#[test]
fn a_slave_that_is_drawn_off_a_rim_gives_back_what_it_has_stored_and_no_more() {
    let (mesh, mut x) = scene(0.0, [0.0, 0.003], OFFSET);
    x.iter_mut().rev().skip(1).for_each(|x| x[2] = 0.0);
    let node = x.len() - 1;
    let (neighbours, normals) = (mesh.neighbours(), vec![[0.0, 0.0, 1.0]; x.len()]);
    let v = vec![[0.0; 3]; x.len()];
    let mut c = contact(node as u32, 1);
    // Outwards, at more than what the distance is at the end of the ledge.
    let steps = 40_000;
    let at = |k: i32| {
        let way = f64::from(k) / f64::from(steps);
        [0.006 + 0.006 * way, 0.003, 0.6 * OFFSET]
    };
    let mut forces = Vec::new();
    for k in 0..=steps {
        x[node] = at(k);
        let surface = surface_of(&mesh, &neighbours, &x, &normals);
        let energy = c.compute(&surface, &v, pace(1e-6)).stored;
        forces.push((energy, c.items[0].force));
    }
    let (first, last) = (forces[0], forces[steps as usize]);
    assert!(first.0 > 0.0 && last.0 == 0.0);
    let work: f64 = (1..=steps)
        .map(|k| {
            let mean = scale(add(forces[k as usize].1, forces[k as usize - 1].1), 0.5);
            dot(mean, sub(at(k), at(k - 1)))
        })
        .sum();
    assert!((work / first.0 - 1.0).abs() < 0.01, "{work} {}", first.0);
    // It is let go by and by.
    let steepest = forces.iter().map(|f| norm(f.1)).fold(0.0, f64::max);
    assert!(steepest <= 1.05 * norm(first.1), "{steepest}");
}

/// A plate of cells of 4 mm with a slot from its middle to its far rim, `width` (m) wide from x = 8 mm on, and the cells at its rim.
fn slotted(width: f64) -> (QuadMesh, Vec<u32>) {
    let axis = |n: u32| (0..=n).map(|k| 0.004 * f64::from(k)).collect::<Vec<_>>();
    let mut mesh = QuadMesh::grid(&axis(5), &axis(6));
    let centre = |c: &[u32; 4]| {
        let sum = |k: usize| c.iter().map(|n| mesh.points[*n as usize][k]).sum::<f64>();
        [0.25 * sum(0), 0.25 * sum(1)]
    };
    let in_slot = |c: &[u32; 4]| {
        let [x, y] = centre(c);
        (0.008..0.012).contains(&x) && y > 0.008
    };
    let cells: Vec<[u32; 4]> = mesh.cells.iter().copied().filter(|c| !in_slot(c)).collect();
    mesh.cells = cells;
    let beyond = mesh.points.iter_mut().filter(|p| p[0] > 0.0119);
    beyond.for_each(|p| p[0] -= 0.004 - width);
    let rim = (0..mesh.cells.len() as u32).collect();
    (mesh, rim)
}

#[test]
fn a_slave_that_crosses_a_slot_is_held_by_what_is_beyond() {
    let (mesh, rim) = slotted(0.004);
    let neighbours = mesh.neighbours();
    let mut x = mesh.points.clone();
    let node = x.len() as u32;
    x.push([0.006, 0.018, 2e-3]);
    let normals = vec![[0.0, 0.0, 1.0]; x.len()];
    let v = vec![[0.0; 3]; x.len()];
    let held = |rim: &[u32]| {
        let mut x = x.clone();
        let mut c = contact(node, 0);
        c.rim = rim.to_vec();
        // Over the slot and down onto the right arm.
        for k in 0..=400 {
            let way = f64::from(k) / 400.0;
            let height = if way < 0.7 {
                2e-3
            } else {
                2e-3 - 1.8e-3 * (way - 0.7) / 0.3
            };
            x[node as usize] = [0.006 + 0.009 * way, 0.018, height];
            let surface = surface_of(&mesh, &neighbours, &x, &normals);
            c.compute(&surface, &v, pace(1e-6));
        }
        c.items[0].penetration
    };
    assert!((held(&rim) - 2e-4).abs() < 1e-9, "{}", held(&rim));
    // What it is for: the walk along the rim alone stays at the left arm.
    assert_eq!(held(&[]), 0.0);
}

#[test]
fn in_a_slot_narrower_than_two_ledges_a_slave_is_held_by_the_one_that_is_thicker_there() {
    // Cells of the right arm as long as those of the left one, and four times as long.
    for right in [0.004, 0.016] {
        let (mut mesh, rim) = slotted(0.0015);
        for p in mesh.points.iter_mut().filter(|p| p[0] > 0.0096) {
            p[0] = 0.0095 + (p[0] - 0.0095) / 0.004 * right;
        }
        let neighbours = mesh.neighbours();
        let mut x = mesh.points.clone();
        let node = x.len();
        x.push([0.0; 3]);
        let normals = vec![[0.0, 0.0, 1.0]; x.len()];
        let v = vec![[0.0; 3]; x.len()];
        let mut c = contact(node as u32, 0);
        c.rim = rim.clone();
        c.ledge = ledge(OFFSET, 0.004);
        // From the left arm to the right one and back, at a height at which it is always held.
        const STEPS: i32 = 20_000;
        for k in 0..=2 * STEPS {
            let at = 0.011 - 0.005 * f64::from((k - STEPS).abs()) / f64::from(STEPS);
            x[node] = [at, 0.018, 0.3 * OFFSET];
            let surface = surface_of(&mesh, &neighbours, &x, &normals);
            c.compute(&surface, &v, pace(1e-6));
            let past = [(at - 0.008) / 0.001, (0.0095 - at) / (0.25 * right)];
            let thick = past.map(|p| match p {
                p if p > 1.0 => 0.0,
                p => held(0.004, [p.max(0.0), 0.0]),
            });
            let expected = thick[0].max(thick[1]) - 0.3 * OFFSET;
            let got = c.items[0].penetration;
            // It looks for other stretches of the rim in every sixteenth step.
            assert!(
                (got - expected).abs() < 0.02 * OFFSET,
                "{right} m, {at} m: {got} m, not {expected}"
            );
        }
    }
}

#[test]
fn along_a_rim_of_unequal_and_slanting_cells_the_distance_is_one() {
    // Rows of cells that are 4 and 2 mm wide along the rim y = -4 mm, of 4 mm and, inwards, slanting.
    let mut mesh = QuadMesh::grid(&[-0.004, 0.0, 0.002], &[-0.004, 0.0, 0.003]);
    for p in mesh.points.iter_mut().filter(|p| p[1] == 0.0) {
        p[0] += 0.001;
    }
    let (neighbours, node) = (mesh.neighbours(), mesh.points.len());
    let mut x = mesh.points.clone();
    x.push([0.0; 3]);
    let normals = vec![[0.0, 0.0, 1.0]; x.len()];
    let v = vec![[0.0; 3]; x.len()];
    let mut c = contact(node as u32, 0);
    c.ledge = ledge(
        OFFSET,
        rim_height(&mesh.cells, &neighbours, &x[..node]).unwrap(),
    );
    let mut depths = Vec::new();
    for k in 0..=4000 {
        x[node] = [-0.003 + 1e-6 * f64::from(k), -0.0049, 0.4 * OFFSET];
        let surface = surface_of(&mesh, &neighbours, &x, &normals);
        c.compute(&surface, &v, pace(1e-6));
        depths.push(c.items[0].penetration);
    }
    let (least, most) = (depths.iter()).fold((1.0, 0.0), |(a, b), d| (d.min(a), d.max(b)));
    assert!(
        least > 0.1 * OFFSET && most - least < 0.01 * OFFSET,
        "{least} to {most} m"
    );
}

#[test]
fn a_slave_beneath_the_end_of_a_ledge_that_comes_inwards_is_not_flung_up() {
    let (mesh, mut x) = beside(0.008, [1.0, 0.0], -0.24 * OFFSET);
    let (neighbours, normals) = (mesh.neighbours(), vec![[0.0, 0.0, 1.0]; x.len()]);
    let v = vec![[0.0; 3]; x.len()];
    let node = x.len() - 1;
    let mut c = contact(node as u32, 1);
    let mut energies = Vec::new();
    for k in 0..=2000 {
        x[node][0] = 0.010_05 - 1e-7 * f64::from(k);
        let surface = surface_of(&mesh, &neighbours, &x, &normals);
        energies.push(c.compute(&surface, &v, pace(1e-6)).stored);
    }
    let jump = (energies.windows(2))
        .map(|e| (e[1] - e[0]).abs())
        .fold(0.0, f64::max);
    let whole = 0.5e5 * OFFSET * OFFSET;
    assert!(
        energies.iter().any(|e| *e > 1e-4 * whole),
        "it is never held"
    );
    assert!(jump < 0.01 * whole, "{jump} J of {whole} J");
}

#[test]
fn past_the_rim_of_a_flank_whose_nodes_have_other_normals_the_distance_shrinks_too() {
    let fold = -2.4f64;
    let (sin, cos) = (0.5 * fold).sin_cos();
    // On the flank x > 0, half of the ledge past its rim y = -8 mm; the normals of all nodes are those of the ridge.
    let place = [0.0035, -0.009];
    let energy = |height: f64| {
        let (mut mesh, mut x) = scene(fold, place, height / cos);
        for p in mesh.points.iter_mut().chain(&mut x[..9]) {
            p[2] = p[0].abs() * sin / cos;
        }
        evaluate(&mesh, &x, 1).0
    };
    let held = held(0.008, [0.5, 0.0]);
    assert_eq!(energy(1.001 * held), 0.0);
    let depth = 0.1 * OFFSET;
    let (got, expected) = (energy(held - depth), 0.5e5 * depth * depth);
    assert!(
        (got / expected - 1.0).abs() < 1e-6,
        "{got} J, not {expected}"
    );
}

/// Draws a sheet over the rim of one that lies on a rigid plane, down the ledge, at a depth of 1 % of their distance.
struct DrawnOff {
    start: Vec<Vec3>,
    /// How many nodes of those driven lie still.
    still: usize,
    duration: f64,
}

const CELL: f64 = 0.008;

impl Drive for DrawnOff {
    fn position(&self, k: usize, t: f64) -> Vec3 {
        let x = self.start[k];
        if k < self.still {
            return x;
        }
        // Its leading nodes begin 1 mm before the rim, at x = 16 mm.
        let at = x[0] + 0.0045 * t / self.duration;
        let past = ((at - 0.016) / (LEDGE * CELL)).clamp(0.0, 1.0);
        [at, x[1], x[2] - (OFFSET - held(CELL, [past, 0.0]))]
    }
}

#[test]
fn over_a_tool_a_slave_goes_down_the_ledge_and_the_tool_does_not_hold_it_up() {
    let axis = even_axis(0.0, 0.016, CELL);
    let lower = QuadMesh::grid(&axis, &axis);
    let n = lower.points.len() as u32;
    let half = 0.5 * OFFSET;
    let mut points: Vec<Vec3> = lower
        .points
        .iter()
        .map(|p| add(*p, [0.0, 0.0, half]))
        .collect();
    // Its trailing nodes stay over the lower sheet.
    let over = [0.007, 0.0, half + 0.99 * OFFSET];
    points.extend(
        lower
            .points
            .iter()
            .map(|p| add([0.5 * p[0], p[1], p[2]], over)),
    );
    let settings = StepSettings {
        target_step: 1e-6,
        safety: 0.9,
        damping: 0.0,
    };
    let mut upper = lower.clone();
    upper.points = points[n as usize..].to_vec();
    let specs = vec![
        common::sheet("lower", &lower, 0, common::membrane()),
        common::sheet("upper", &upper, n, common::membrane()),
    ];
    let mut model = Model::new(points.clone(), specs, settings).unwrap();
    let duration = 2e-3;
    let drive = DrawnOff {
        start: points.clone(),
        still: n as usize,
        duration,
    };
    model.set_driven((0..2 * n).collect(), Box::new(drive));
    let contact = ContactSettings::default();
    let nodes = n..2 * n;
    let items = nodes
        .clone()
        .map(|k| SlaveItem::new(k, 0, [0.0; 2]))
        .collect();
    let between = SheetContact::new("between".into(), 1.0, OFFSET, 0.0, &contact, items);
    model.add_sheet_contact(between);
    let ground = Arc::new(Plane { height: 0.0 });
    let items = nodes.map(RigidItem::new).collect();
    let mut through = RigidContact::new("tool".into(), ground, 1.5 * OFFSET, 0.0, &contact, items)
        .with_slack(0.05 * OFFSET);
    through.through = vec![0];
    model.add_rigid_contact(through);
    model.set_contact_stiffness(&contact);
    let leading: Vec<usize> = (0..n as usize)
        .filter(|k| points[n as usize + k][0] > 0.0149)
        .collect();
    assert_eq!(leading.len(), 3);
    let (mut over_ledge, mut off) = (0, 0);
    while model.time() < duration {
        model.step(false).unwrap();
        for k in &leading {
            let (sheet, tool) = (
                &model.sheet_contacts()[0].items[*k],
                &model.rigid_contacts()[0].items[*k],
            );
            let at = model.x()[sheet.node as usize][0];
            assert_eq!(tool.normal_force, 0.0, "held up by the tool at {at} m");
            if (0.0161..0.0179).contains(&at) {
                over_ledge += 1;
                assert!(sheet.normal_force > 0.0, "let go at {at} m");
            }
            // The end of the ledge is round.
            if at > 0.0183 {
                off += 1;
                assert!(!sheet.active, "held at {at} m");
            }
        }
    }
    assert!(over_ledge > 100 && off > 10, "{over_ledge} {off}");
}
