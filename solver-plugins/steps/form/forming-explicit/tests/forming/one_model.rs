//! Whole runs whose plies bend in zones only, in one mesh: against runs of one element.

use crate::common::{BuiltIn, fabric, form};
use plyflow_forming_explicit::{Forming, Observer, Outcome, Parameters, build_global};
use plyflow_geometry::vec3::Vec3;
use plyflow_kernels::rf4::Rf4;
use plyflow_mechanics::component::element_fields;
use plyflow_mechanics::energy::Ledger;
use plyflow_model::scene::Scene;
use plyflow_sdk::{Element, StepError};
use serde_json::{Value, json};

const EVERYWHERE: [f64; 4] = [-1.0, -1.0, 1.0, 1.0];
const LEFT: [f64; 4] = [-1.0, -1.0, 0.0, 1.0];

fn hourglass() -> Value {
    json!({"hourglass": 1.0, "hourglass_floor": 300.0, "hourglass_normal": 0.01})
}

/// The beginning of a press stroke over a small dome, two plies in elements of 6 mm; with zones, a membrane elsewhere.
fn press(element: &str, zones: Option<&[[f64; 4]]>) -> Parameters {
    let mut material = fabric();
    material["with"]["bending"] =
        json!({"positive": {"linear": 5e-4}, "negative": {"linear": 5e-4}});
    let ply = |name: &str| {
        json!({"name": name, "kind": "ply", "material": material, "length": "0.12 m", "width": "0.096 m",
               "fibre_1": "0 rad", "fibre_2": "1.5707963267948966 rad"})
    };
    let with = |element: &str| {
        if element == "s4" {
            json!({})
        } else {
            hourglass()
        }
    };
    let mut p: Parameters = serde_json::from_value(json!({
        "scene": {
            "plyflow_scene": 1, "name": "dome",
            "tool": {"hemisphere": {"radius": "0.025 m", "facet_size": "0.001 m"}},
            "sheets": [ply("ply_1"), ply("ply_2")],
            "friction": {"tool_fabric": 0.23, "fabric_fabric": 0.3},
            "process": {"press": {
                "stroke": "0.012 m", "forming_time": "0.06 s", "settling_time": "0.002 s",
                "die": {"opening_radius": "0.028 m", "edge_radius": "0.004 m"}}}
        },
        "element": {"plugin": element, "with": with(element)},
        "diaphragm_element": {"plugin": "m4", "with": {}},
        "element_size": 0.006, "diaphragm_growth": 1.25, "time_step": 8e-6, "step_safety": 0.8,
        "least_areal_mass": 2.0, "damping": 50.0, "contact_stiffness": 0.3, "slip_stiffness": 0.5,
        "contact_damping": 0.3, "contact_augmentation": 0.003, "frames": 4, "tool_grid": 0.00175,
        "kinetic_bound": 0.05, "drift_bound": 0.5
    }))
    .expect("the parameters fit their type");
    if let Some(zones) = zones {
        let elsewhere = json!({"plugin": "m4", "with": hourglass()});
        p.element_elsewhere = serde_json::from_value(elsewhere).unwrap();
        p.bending_zones = zones.to_vec();
    }
    p
}

fn bits(f: &Forming) -> Vec<u64> {
    let all = [f.model.x(), f.model.v()];
    all.iter()
        .flat_map(|v| v.as_flattened())
        .map(|x| x.to_bits())
        .collect()
}

fn same(a: &(Forming, Outcome), b: &(Forming, Outcome)) {
    assert!(bits(&a.0) == bits(&b.0), "other positions or velocities");
    assert_eq!(a.1.history, b.1.history);
    assert_eq!(a.1.smallest_step.to_bits(), b.1.smallest_step.to_bits());
}

#[test]
fn zones_everywhere_give_the_bits_of_shells_and_zones_nowhere_those_of_membranes() {
    let everywhere = form(&press("rf4", Some(&[EVERYWHERE])), 2);
    same(&everywhere, &form(&press("rf4", None), 2));
    assert_eq!(everywhere.0.model.bending_cells(0), Some([320, 320]));
    let nowhere = form(&press("rf4", Some(&[])), 2);
    same(&nowhere, &form(&press("m4", None), 1));
    assert_eq!(nowhere.0.model.bending_cells(1), Some([0, 320]));
}

#[test]
fn half_a_ply_bends_where_the_zone_is_with_a_closed_ledger_and_the_same_bits_on_two_threads() {
    let half = form(&press("rf4", Some(&[LEFT])), 1);
    same(&half, &form(&press("rf4", Some(&[LEFT])), 2));
    let (forming, outcome) = &half;
    assert_eq!(forming.model.bending_cells(0), Some([160, 320]));
    let health = &outcome.health;
    println!("{health:?}");
    assert!(health.peak_drift_ratio < 0.01, "{health:?}");
    let whole = form(&press("rf4", None), 1);
    let bending = |of: &(Forming, Outcome)| of.1.history.last().unwrap().ledger.bending;
    let share = bending(&half) / bending(&whole);
    // Membranes gather and shear more than shells, and leave less to bend beside them: not exactly a half.
    println!("half of the ply has {share} of the bending energy of all of it");
    assert!((0.2..0.6).contains(&share), "{share}");
}

/// Keeps the fields of the last frame, by name, of the lower ply.
#[derive(Default)]
struct Fields(Vec<(String, Vec<f64>)>);

impl Observer for Fields {
    fn frame(&mut self, forming: &Forming, _: f64) -> Result<(), StepError> {
        let mut fields = element_fields(Rf4::MANIFEST);
        let others = element_fields(plyflow_kernels::m4::M4::MANIFEST);
        fields.iter_mut().for_each(|f| f.find_elsewhere(&others));
        let of = |f| forming.field(&forming.bodies[0], f, &fields);
        self.0 = fields.iter().map(|f| (f.name.clone(), of(f))).collect();
        Ok(())
    }
    fn tick(&mut self, _: &Forming, _: &Ledger, _: f64) -> Result<(), StepError> {
        Ok(())
    }
}

#[test]
fn membranes_tell_their_shear_and_no_curvature() {
    let p = press("rf4", Some(&[LEFT]));
    let mut forming = build_global(&p, &BuiltIn).unwrap();
    let mut seen = Fields::default();
    forming.run(&p.control(), &mut seen).unwrap();
    let field = |name: &str| &seen.0.iter().find(|f| f.0 == name).unwrap().1;
    let body = &forming.bodies[0];
    let points = forming.reference_points(body);
    let largest = |values: &[f64], places: &[Vec3], left: bool| {
        let own = values
            .iter()
            .zip(places)
            .filter(|v| (v.1[0] < -1e-9) == left);
        own.fold(0.0f64, |m, v| m.max(v.0.abs()))
    };
    for name in ["curvature_1", "bending_moment_2"] {
        let [left, right] = [true, false].map(|l| largest(field(name), &points, l));
        assert!(left > 0.0 && right == 0.0, "{name}: {left} and {right}");
    }
    let middle = |c: &[u32; 4]| {
        [0, 1, 2].map(|k| 0.25 * c.iter().map(|n| points[*n as usize][k]).sum::<f64>())
    };
    let centres: Vec<Vec3> = body.cells.iter().map(middle).collect();
    let [left, right] = [true, false].map(|l| largest(field("shear_angle"), &centres, l));
    assert!(left.min(right) > 0.01, "{left} and {right} rad");
}

/// The same with a fabric without a stitch, which is its own mirror image.
fn symmetric(zones: &[[f64; 4]], planes: &[&str]) -> Parameters {
    let mut p = press("rf4", Some(zones));
    let mut scene = serde_json::to_value(&p.scene).unwrap();
    scene["symmetry"] = json!(planes);
    for sheet in scene["sheets"].as_array_mut().unwrap() {
        let with = sheet["material"]["with"].as_object_mut().unwrap();
        with.remove("stitch");
        let shear = json!({"coefficients": [0.0, 112.0, 0.0, 137.0], "limit": 1.05});
        with.insert("shear".into(), shear);
    }
    p.scene = Scene::from_json(scene).unwrap();
    p
}

#[test]
fn a_half_beside_a_mirror_plane_bends_where_the_whole_does() {
    // Of the half that is computed only the mirror image of one zone lies in it.
    let both = [[-0.06, -1.0, -0.03, 1.0], [0.03, -1.0, 0.06, 1.0]];
    let whole = form(&symmetric(&both, &[]), 2);
    let half = form(&symmetric(&both[..1], &["x"]), 2);
    assert_eq!(whole.0.model.bending_cells(0), Some([160, 320]));
    assert_eq!(half.0.model.bending_cells(0), Some([80, 160]));
    let bending = |of: &(Forming, Outcome)| of.1.history.last().unwrap().ledger.bending;
    let ratio = bending(&half) / bending(&whole);
    println!("bending energy of the half over that of the whole: {ratio}");
    assert!((ratio - 1.0).abs() < 0.02, "{ratio}");
}

#[test]
fn shells_with_rotations_bend_in_a_zone_beside_membranes_whose_nodes_do_not_turn() {
    let (forming, outcome) = form(&press("s4", Some(&[LEFT])), 2);
    let health = &outcome.health;
    assert!(health.peak_drift_ratio < 0.01, "{health:?}");
    let spins = forming.model.spins().unwrap();
    let points = &*forming.reference;
    let turning = |left: bool| {
        let own = spins.iter().zip(points).filter(|s| (s.1[0] < 1e-9) == left);
        own.filter(|s| *s.0 != [0.0; 3]).count()
    };
    assert!(turning(true) > 100, "{}", turning(true));
    assert_eq!(turning(false), 0);
}

#[test]
fn elements_that_cannot_share_a_ply_are_refused_with_what_to_do() {
    let refused = |p: &Parameters| {
        build_global(p, &BuiltIn)
            .err()
            .expect("an error")
            .to_string()
    };
    let text = refused(&press("m4", Some(&[LEFT])));
    assert!(
        text.contains("element: given 'm4'") && text.contains("such as rf4"),
        "{text}"
    );
    let mut p = press("rf4", Some(&[LEFT]));
    p.element_elsewhere.as_mut().unwrap().plugin = "rf4".into();
    let text = refused(&p);
    assert!(
        text.contains("element_elsewhere: given 'rf4'") && text.contains("such as m4"),
        "{text}"
    );
}
