//! Errors of fields between two models whose difference is known.

use plyflow_defects::{FieldErrors, Ply, Shape, Tool};
use plyflow_geometry::vec3::Vec3;
use plyflow_surface::{Ground, Surface, Topology};

/// The tool: a plane.
const TOP: f64 = 0.060;
/// Of the mid-plane from it.
const OFFSET: f64 = 0.0003;

fn tool() -> Tool {
    let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]];
    let points = corners.map(|[x, y]| [x, y, TOP]);
    Tool::new(Surface::new(&points, &[[0, 1, 2], [0, 2, 3]]).unwrap())
}

/// Left of the middle nodes lie 1 mm apart and right of it 20 mm: half of the ply is 2 mm off however many nodes each half has.
#[test]
fn errors_of_fields_count_by_area() {
    let strip = |xs: &[f64], off: &dyn Fn(f64) -> f64| {
        let flat: Vec<Vec3> = [0.0, 0.02]
            .iter()
            .flat_map(|y| xs.iter().map(move |x| [*x, *y, 0.0]))
            .collect();
        let n = xs.len() as u32;
        let cells: Vec<u32> = (0..n - 1)
            .flat_map(|i| [i, i + 1, n + i + 1, n + i])
            .collect();
        let formed = flat
            .iter()
            .map(|p| [p[0], p[1], TOP + OFFSET + off(p[0])])
            .collect();
        let topology = Topology::new(flat.len(), 4, &cells);
        let shape = Shape {
            topology,
            undeformed: flat,
            formed,
        };
        Ply::new("ply".into(), shape, &tool(), OFFSET, Ground::bed(0.0))
    };
    let uneven: Vec<f64> = (-100..0)
        .map(|i| 0.001 * f64::from(i))
        .chain((0..=5).map(|i| 0.02 * f64::from(i)))
        .collect();
    let reference = [strip(&uneven, &|_| 0.0)];
    let ours = [strip(&[-0.1, -1e-9, 0.0, 0.1], &|x| {
        if x < -5e-10 { 0.002 } else { 0.0 }
    })];
    let found = FieldErrors::of(&[&ours], &[&reference], |_, _| true).unwrap();
    assert_eq!(found.shear, None);
    // The node in the middle has 0.5 + 10 mm of the 200 and is not off; the last one on the left has all of its millimetre.
    let expected = 0.002 * ((0.1 - 0.0005) / 0.2f64).sqrt();
    for error in [found.position, found.distance.unwrap()] {
        assert!((error / expected - 1.0).abs() < 1e-6, "{error} {expected}");
    }
    // Sheared from x on: by area half of the reference and a fifth of ours, so that the 75 % quantiles are apart; by number 5 and 2 of 105 cells.
    let sheared = |from: f64| {
        let mut ply = strip(&uneven, &|_| 0.0);
        let of = |c: usize| ply.undeformed[ply.topology.cell(c)[0] as usize][0] > from - 1e-9;
        let cells = 0..ply.topology.cells();
        ply.shear_angle = cells.map(|c| if of(c) { 0.1 } else { 0.0 }).collect();
        [ply]
    };
    let (reference, ours) = (sheared(0.0), sheared(0.06));
    let found = FieldErrors::of(&[&ours], &[&reference], |_, _| true).unwrap();
    assert_eq!(found.shear, Some(0.1));
    // Where nothing counts there is no error.
    assert_eq!(FieldErrors::of(&[&ours], &[&reference], |_, _| false), None);
}
