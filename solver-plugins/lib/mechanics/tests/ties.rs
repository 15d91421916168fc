//! Plies that are tied to each other: forces against the gradient of the energy, balances, and two unidirectional plies against the fabric that
//! they make.

mod common;

use plyflow_geometry::vec3::{Vec3, add, cross, norm, scale, sub};
use plyflow_kernels::m4::M4;
use plyflow_mechanics::contact::{
    ContactSettings, SLACK, SheetContact, SlaveItem, Surface, Tie, Ties,
};
use plyflow_mechanics::history::smooth_step;
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::model::{Drive, Model, StepSettings};

/// Distance (m) at which the sheets touch.
const OFFSET: f64 = 4e-4;
const STIFFNESS: f64 = 2e5;

/// A warped cell of 8 mm, and a node that is tied to a place in it and has gone from there by `way` (m).
fn scene(side: f64, way: Vec3) -> Vec<Vec3> {
    let mut x = vec![
        [0.0, 0.0, 1e-4],
        [8e-3, 1e-4, -2e-4],
        [8.3e-3, 8e-3, 3e-4],
        [-2e-4, 7.7e-3, 0.0],
    ];
    let weights = plyflow_mechanics::contact::shape(XI);
    let place = (0..4).fold([0.0; 3], |sum, k| add(sum, scale(x[k], weights[k])));
    x.push(add(add(place, [0.0, 0.0, side * OFFSET]), way));
    x
}

const XI: [f64; 2] = [0.3, -0.6];

/// Energy (J) and forces (N) of a tie, at velocities `v` (m/s) with the damping (N s/m).
fn evaluate(x: &[Vec3], side: f64, v: &[Vec3], damping: f64) -> (f64, Vec<Vec3>) {
    let settings = ContactSettings::default();
    let mut contact = SheetContact::new("test".into(), side, OFFSET, 0.0, &settings, Vec::new());
    let mut tie = Tie::new(4, 0, XI);
    (tie.stiffness, tie.damping) = (STIFFNESS, damping);
    contact.ties = Ties::new(vec![tie]);
    let surface = Surface {
        cells: &[[0, 1, 2, 3]],
        neighbours: &[[u32::MAX; 4]],
        x,
        normals: &[[0.0, 0.0, 1.0]; 5],
    };
    let energy = contact.compute(&surface, v, common::slave::pace(1e-6));
    let mut f = vec![[0.0; 3]; 5];
    contact.scatter(surface.cells, &mut f);
    (energy.stored, f)
}

const STILL: [Vec3; 5] = [[0.0; 3]; 5];

/// Sliding while pressed, sliding at a distance, drawn off; from above and below.
fn states() -> impl Iterator<Item = (f64, Vec3)> {
    let ways = [
        [3e-4, -1e-4, -5e-5],
        [-2e-4, 4e-4, -3e-4],
        [1e-4, 2e-4, 3e-4],
        [1e-4, 2e-4, 9e-4],
        [0.0, 0.0, 1.5e-3],
    ];
    [1.0, -1.0]
        .into_iter()
        .flat_map(move |side| ways.map(|w| (side, [w[0], w[1], side * w[2]])).into_iter())
}

#[test]
fn the_force_is_the_gradient_of_what_a_tie_stores() {
    for (side, way) in states() {
        let x = scene(side, way);
        let (energy, f) = evaluate(&x, side, &STILL, 0.0);
        assert!(energy > 0.0);
        let (size, h) = (norm(f[4]), 1e-9);
        for n in 0..5 {
            for c in 0..3 {
                let at = |d: f64| {
                    let mut y = x.clone();
                    y[n][c] += d;
                    evaluate(&y, side, &STILL, 0.0).0
                };
                let slope = (at(h) - at(-h)) / (2.0 * h);
                let error = (f[n][c] + slope).abs() / size;
                assert!(error < 1e-5, "{side} {way:?}, node {n}, {c}: {error:.1e}");
            }
        }
    }
}

#[test]
fn forces_of_a_tie_have_no_resultant_and_no_moment_and_moving_with_its_cell_costs_nothing() {
    let spin = [3.0, -7.0, 11.0];
    let rigid = |x: &[Vec3]| -> Vec<Vec3> {
        let speed = |p: &Vec3| add([1.0, 2.0, -3.0], cross(spin, *p));
        x.iter().map(speed).collect()
    };
    for side in [1.0, -1.0] {
        let mut x = scene(side, [0.0; 3]);
        // Where it was laid: over its point, along the normal of the cell.
        let area = cross(sub(x[2], x[0]), sub(x[3], x[1]));
        let place = sub(x[4], [0.0, 0.0, side * OFFSET]);
        x[4] = add(place, scale(area, side * OFFSET / norm(area)));
        let force = evaluate(&x, side, &rigid(&x), 50.0).1[4];
        assert!(norm(force) < 1e-9, "a rigid motion is damped: {force:?}");
    }
    for (side, way) in states() {
        let x = scene(side, way);
        let mut v = rigid(&x);
        v[1][2] += 0.4;
        v[4][0] -= 0.3;
        let still = evaluate(&x, side, &STILL, 50.0).1;
        let damped = evaluate(&x, side, &v, 50.0).1;
        let size = norm(still[4]);
        assert!(norm(sub(damped[4], still[4])) > 1.0);
        for f in [&still, &damped] {
            let sum = f.iter().fold([0.0; 3], |s, f| add(s, *f));
            let moment = x.iter().zip(f);
            let moment = moment.fold([0.0; 3], |s, (x, f)| add(s, cross(*x, *f)));
            assert!(norm(sum) < 1e-12 * size, "{sum:?}");
            // Dampers do not see that a stretched tie turns with its cell.
            let stretched = norm(way) * norm(sub(f[4], still[4]));
            assert!(norm(moment) < 1e-12 * size * 8e-3 + stretched, "{moment:?}");
        }
    }
}

#[test]
fn upright_a_tie_holds_from_its_slack_on() {
    let free = (SLACK - 1.0) * OFFSET;
    for side in [1.0, -1.0] {
        let held = |away: f64| {
            norm(evaluate(&scene(side, [0.0, 0.0, side * away]), side, &STILL, 0.0).1[4])
        };
        // The cell is nearly level.
        let drawn = held(free + 1e-3);
        assert!(
            (drawn / (STIFFNESS * 1e-3) - 1.0).abs() < 0.05,
            "{side}: {drawn} N"
        );
        for away in [-1e-4, 0.9 * free] {
            let loose = held(away);
            assert!(
                loose < 0.1 * STIFFNESS * away.abs().max(1e-4),
                "{side}, {away}: {loose} N"
            );
        }
    }
}

/// Ends of strips, drawn apart by 2 %.
struct Ends(Vec<Vec3>);

/// When they are (s).
const DRAWN: f64 = 0.03;
/// When they are at rest (s), under damping in proportion to their masses.
const AT_REST: f64 = 0.15;

impl Drive for Ends {
    fn position(&self, k: usize, t: f64) -> Vec3 {
        let [x, y, z] = self.0[k];
        [x * (1.0 + 0.02 * smooth_step(t, 0.0, DRAWN)), y, z]
    }
}

const LENGTH: f64 = 0.2;
const WIDTH: f64 = 0.08;

/// Force (N) on the ends of a strip, drawn by 2 %, of plies with these parameters, whose axis lies at 45 degrees to it, and the largest way (m) of a
/// tied node from its point.
fn drawn(plies: &[&str], is_tied: bool) -> (f64, f64) {
    let size = 8e-3;
    let mesh = QuadMesh::grid(&even_axis(0.0, LENGTH, size), &even_axis(0.0, WIDTH, size));
    let count = mesh.points.len();
    let mut points = Vec::new();
    let specs = plies.iter().enumerate().map(|(k, ply)| {
        let lifted = mesh
            .points
            .iter()
            .map(|p| add(*p, [0.0, 0.0, k as f64 * OFFSET]));
        points.extend(lifted);
        let element = common::instance::<M4>(ply);
        let mut spec = common::sheet("ply", &mesh, (k * count) as u32, element);
        spec.name = format!("ply_{k}");
        spec.axis = [0.5f64.sqrt(), 0.5f64.sqrt(), 0.0];
        spec
    });
    let specs = specs.collect();
    let settings = StepSettings {
        target_step: 1e-5,
        safety: 0.8,
        damping: 200.0,
    };
    let mut model = Model::new(points.clone(), specs, settings).unwrap();
    let is_end = |p: &Vec3| p[0] < 1e-9 || p[0] > LENGTH - 1e-9;
    if plies.len() == 2 {
        let items: Vec<SlaveItem> = (count..2 * count)
            .map(|n| {
                let cell = (0..mesh.cells.len() as u32)
                    .find(|c| mesh.cells[*c as usize].contains(&((n - count) as u32)))
                    .unwrap();
                let corner = mesh.cells[cell as usize].iter();
                let k = corner
                    .clone()
                    .position(|c| *c as usize == n - count)
                    .unwrap();
                let xi = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]][k];
                SlaveItem::new(n as u32, cell, xi)
            })
            .collect();
        let free = items.iter().filter(|i| !is_end(&points[i.node as usize]));
        let ties = free.map(|i| Tie::new(i.node, i.cell, i.xi)).collect();
        let contact = ContactSettings::default();
        let mut on = SheetContact::new("on".into(), 1.0, OFFSET, 0.0, &contact, items);
        if is_tied {
            on.ties = Ties::new(ties);
        }
        model.add_sheet_contact(on);
        model.set_contact_stiffness(&contact);
    }
    let ends = (0..points.len() as u32).filter(|n| is_end(&points[*n as usize]));
    let ends: Vec<u32> = ends.collect();
    let places = ends.iter().map(|n| points[*n as usize]).collect();
    model.set_driven(ends.clone(), Box::new(Ends(places)));
    while model.time() < AT_REST {
        model.step(false).unwrap();
    }
    assert!(model.kinetic() < 1e-6, "{} J", model.kinetic());
    let right = ends.iter().zip(model.reactions());
    let right = right.filter(|(n, _)| points[**n as usize][0] > 0.5 * LENGTH);
    let force = right.map(|(_, r)| r[0]).sum();
    let ties = model.sheet_contacts().iter().map(|c| c.ties.stretch());
    (force, ties.fold(0.0, f64::max))
}

#[test]
fn two_unidirectional_plies_tied_to_each_other_are_the_fabric_that_they_make() {
    let fabric = r#"{"fibre_modulus":1e7,"shear":{"coefficients":[0,1000]},"thickness":1e-3,"areal_mass":1.0}"#;
    let along = r#"{"fibre_modulus":1e7,"fibre_modulus_2":1,"shear":{"coefficients":[0,500]},"thickness":1e-3,"areal_mass":0.5}"#;
    let across = r#"{"fibre_modulus":1,"fibre_modulus_2":1e7,"shear":{"coefficients":[0,500]},"thickness":1e-3,"areal_mass":0.5}"#;
    let (expected, _) = drawn(&[fabric], false);
    let (tied, stretch) = drawn(&[along, across], true);
    let (apart, _) = drawn(&[along, across], false);
    println!(
        "fabric {expected} N, tied {tied} N, untied {apart} N; ties give way by {stretch:.1e} m"
    );
    assert!(
        (tied / expected - 1.0).abs() < 0.01,
        "{tied} and {expected} N"
    );
    assert!(
        (apart / expected - 1.0).abs() > 0.1,
        "{apart} and {expected} N"
    );
    assert!(stretch > 0.0 && stretch < 0.1 * OFFSET, "{stretch} m");
}
