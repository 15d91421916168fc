//! Plies whose fibres are steered.

use crate::common::scenes::gentle_press;
use crate::common::{BuiltIn, form};
use plyflow_forming_explicit::{Forming, Parameters, build_global};
use plyflow_geometry::vec3::Vec3;
use plyflow_model::steering::directions_apart;
use serde_json::{Value, json};
use std::f64::consts::FRAC_PI_2;

/// Distance of the points of the tables (m).
const GRID: f64 = 0.01;

/// A table of the ply of [`gentle_press`], 120 x 96 mm, and a little beyond it, with the direction (rad) by place (m).
pub fn table(angle: impl Fn(f64, f64) -> f64) -> Value {
    let place = |i: i32, j: i32| [f64::from(i) * GRID, f64::from(j) * GRID];
    let all = (-7..=7).flat_map(|i| (-6..=6).map(move |j| place(i, j)));
    let point = |[x, y]: [f64; 2]| json!({"x": format!("{x} m"), "y": format!("{y} m"), "angle": format!("{} rad", angle(x, y))});
    json!({"points": all.map(point).collect::<Vec<_>>()})
}

/// The same scene with fibres of a table.
pub fn steered(mut p: Parameters, table: &Value) -> Parameters {
    let sheet = &mut p.scene.sheets[0];
    sheet.fibre_1 = serde_json::from_value(table.clone()).unwrap();
    sheet.fibre_2 = None;
    p
}

/// Circles about a place beside the ply (m).
const CENTRE: [f64; 2] = [-0.11, 0.01];

fn on_circles(x: f64, y: f64) -> f64 {
    (y - CENTRE[1]).atan2(x - CENTRE[0]) + FRAC_PI_2
}

/// Middles of the cells of the ply before forming (m).
fn middles(forming: &Forming) -> Vec<[f64; 2]> {
    let (body, then) = (&forming.bodies[0], &forming.reference);
    let cells = body.sheet.cells(&forming.model).iter();
    cells
        .map(|c| [0, 1].map(|k| c.iter().map(|n| then[*n as usize][k]).sum::<f64>() / 4.0))
        .collect()
}

/// A model of the ply whose points are where `to` puts them, with its fields.
fn moved(p: &Parameters, to: impl Fn(Vec3) -> Vec3) -> Forming {
    let mut forming = build_global(p, &BuiltIn).unwrap();
    let places: Vec<Vec3> = forming.model.x().iter().map(|x| to(*x)).collect();
    forming.model.x_mut().copy_from_slice(&places);
    // So short that the forces of the strain move nothing.
    forming.model.set_step(1e-12);
    forming.model.step(true).unwrap();
    forming
}

/// The ply is stretched along x by a share s. A fibre at the angle t is then longer by sqrt(1 + ((1 + s)^2 - 1) cos^2 t), and the sine of the shear angle
/// tells sin 2t. So the fields tell which direction each element has. It is off that of the circle by the error of the table's interpolation at
/// most: half the angle of the sine 1.125 h^2 / r^2 (`plyflow_model::steering` says where that comes from), r no nearer to the centre than the triangle.
#[test]
fn elements_have_the_directions_of_circles_within_the_error_of_their_table() {
    let s = 0.02;
    let p = steered(gentle_press("m4", 0.0, &[]), &table(on_circles));
    let forming = moved(&p, |[x, y, z]| [(1.0 + s) * x, y, z]);
    let row = |k: usize| forming.model.cell_field(0, k);
    let (shear, first, second) = (row(0), row(1), row(2));
    let grows = (1.0 + s) * (1.0 + s) - 1.0;
    let mut largest = 0.0f64;
    for (c, [x, y]) in middles(&forming).into_iter().enumerate() {
        let [l1, l2] = [1.0 + first[c], 1.0 + second[c]];
        let cosine = 2.0 * (l1 * l1 - 1.0) / grows - 1.0;
        let sine = -2.0 * shear[c].sin() * l1 * l2 / grows;
        let found = 0.5 * sine.atan2(cosine);
        assert!((sine.hypot(cosine) - 1.0).abs() < 1e-6, "{sine} {cosine}");
        let r = (x - CENTRE[0]).hypot(y - CENTRE[1]) - GRID;
        let bound = 0.5 * (1.125 * (GRID / r).powi(2)).asin();
        let off = directions_apart(found, on_circles(x, y));
        assert!(off < bound + 1e-6, "{off} beyond {bound} at {x}, {y}");
        largest = largest.max(off / bound);
    }
    assert!(largest > 0.05, "a bound that is never come near: {largest}");
}

/// Bent to a cylinder about y: the curvature along a fibre at the angle t is that of the cylinder times cos^2 t, to the order of the square of the slopes.
#[test]
fn bending_about_nodes_goes_by_the_direction_at_the_node() {
    let k = 0.5;
    let p = steered(gentle_press("rf4", 0.0, &[]), &table(on_circles));
    let forming = moved(&p, |[x, y, z]| [x, y, z + 0.5 * k * x * x]);
    let field = forming.model.patch_field(0, 0);
    let mut checked = 0;
    for (n, found) in field.iter().enumerate().filter(|f| *f.1 != 0.0) {
        let [x, y, _] = forming.reference[n];
        let r = (x - CENTRE[0]).hypot(y - CENTRE[1]) - GRID;
        // Of cos^2 by an angle: at most that angle. The slope is at most 0.03.
        let bound = 0.5 * (1.125 * (GRID / r).powi(2)).asin() + 2e-3;
        let wanted = on_circles(x, y).cos().powi(2);
        assert!(
            (found / k - wanted).abs() < bound,
            "{found} at {x}, {y}: {wanted}"
        );
        checked += 1;
    }
    assert!(checked > 100, "{checked}");
}

#[test]
fn a_table_of_one_direction_gives_the_bits_of_that_direction() {
    for (element, angle) in [("m4", 0.3), ("rf4", -1.2), ("s4", 0.0)] {
        let straight = gentle_press(element, angle, &[]);
        let table = table(|_, _| angle);
        let of = |p: &Parameters| {
            let forming = form(p, 1).0;
            forming.model.x().to_vec()
        };
        assert!(
            of(&straight) == of(&steered(straight.clone(), &table)),
            "{element}"
        );
    }
}

#[test]
fn steered_plies_are_formed_with_the_same_bits_on_two_threads_and_otherwise_than_straight_ones() {
    let straight = gentle_press("m4", 0.0, &[]);
    let p = steered(straight.clone(), &table(on_circles));
    let [a, b] = [1, 2].map(|threads| form(&p, threads).0);
    assert!(a.model.x() == b.model.x());
    let other = form(&straight, 1).0;
    assert!(a.model.x() != other.model.x());
}

#[test]
fn what_cannot_be_steered_is_refused_by_name() {
    let table = table(on_circles);
    let refused = |p: &Parameters| build_global(p, &BuiltIn).err().unwrap().to_string();
    let mut mirrored = steered(gentle_press("m4", 0.0, &["y"]), &table);
    let text = refused(&mirrored);
    assert!(
        text.contains("steered") && text.contains("symmetry"),
        "{text}"
    );
    mirrored.scene.symmetry.clear();
    mirrored.element.plugin = "m4f".into();
    mirrored.element.with = json!({"fibres_along_sides": true});
    let text = refused(&mirrored);
    assert!(
        text.contains("fibres_along_sides") && text.contains("'ply_1' are steered"),
        "{text}"
    );
    let mut both = steered(gentle_press("m4", 0.0, &[]), &table);
    both.scene.sheets[0].fibre_2 = serde_json::from_value(json!("90 deg")).unwrap();
    let text = refused(&both);
    assert!(
        text.contains("sheets[0].fibre_2") && text.contains("leave it out"),
        "{text}"
    );
    let unread = json!({"table": {"file": "a.csv"}});
    let text = refused(&steered(gentle_press("m4", 0.0, &[]), &unread));
    assert!(
        text.contains("a.csv") && text.contains("nobody has read"),
        "{text}"
    );
}
