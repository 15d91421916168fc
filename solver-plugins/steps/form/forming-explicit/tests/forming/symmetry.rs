//! Halves and quarters of symmetric scenes against the whole ones.

use crate::common::scenes::{diaphragm, gentle_press as press, ply};
use crate::common::{BuiltIn, apart, fabric, form, twins, woven};
use plyflow_forming_explicit::{Forming, HistoryRow, Observer, Outcome, Parameters, build_global};
use plyflow_geometry::vec3::{Vec3, add, norm, scale, sub};
use plyflow_kernels::{m4::M4, rf4::Rf4, s4::S4};
use plyflow_mechanics::component::{ElementField, element_fields};
use plyflow_mechanics::energy::Ledger;
use plyflow_mechanics::mesh::area_vector;
use plyflow_model::scene::Scene;
use plyflow_sdk::{Element, StepError};
use serde_json::{Value, json};

fn last(outcome: &Outcome) -> &HistoryRow {
    outcome.history.last().unwrap()
}

/// The beginning of drawing a ply between two films over a flat block.
fn diaphragms(element: &str, symmetry: &[&str]) -> Parameters {
    let ply = ply("ply_1", &woven(), [0.12, 0.09], -DIAGONAL);
    let mut p = press(element, 0.0, symmetry);
    let mut scene = serde_json::to_value(&p.scene).unwrap();
    scene["tool"] = json!({"flat": {"length": "0.1 m", "width": "0.06 m", "height": "0.02 m", "fillet": "0.012 m",
                                    "facet_size": "0.008 m"}});
    scene["sheets"] = json!([diaphragm("lower"), ply, diaphragm("upper")]);
    scene["friction"] =
        json!({"tool_diaphragm": 0.5, "fabric_diaphragm": 0.4, "diaphragm_diaphragm": 0.3});
    scene["process"] = json!({"double_diaphragm": {
        "frame_length": "0.32 m", "frame_width": "0.28 m", "clearance": "0.005 m",
        "bag_pressure": "100000 Pa", "forming_pressure": "100000 Pa",
        "bagging_time": "0.04 s", "lowering_time": "0.06 s", "drawing_time": "0.06 s",
        "settling_time": "0.005 s", "film_pre_stretch": 0.01, "film_joint_margin": "0.03 m"}});
    p.scene = Scene::from_json(scene).unwrap();
    p.diaphragm_element.with = json!({"hourglass_floor": 3000.0});
    (p.element_size, p.time_step, p.tool_grid) = (0.0075, 1.2e-5, 0.002);
    p.diaphragm_element_size = Some(0.015);
    (p.contact_augmentation, p.frames) = (0.003, 8);
    p
}

/// Positions of all bodies' points at every frame.
#[derive(Default)]
struct Frames(Vec<Vec<Vec<Vec3>>>);

impl Observer for Frames {
    fn frame(&mut self, forming: &Forming, _: f64) -> Result<(), StepError> {
        let bodies = forming.bodies.iter();
        self.0.push(bodies.map(|b| forming.points(b)).collect());
        Ok(())
    }
    fn tick(&mut self, _: &Forming, _: &Ledger, _: f64) -> Result<(), StepError> {
        Ok(())
    }
}

fn frames(p: &Parameters) -> (Forming, Outcome, Vec<Vec<Vec<Vec3>>>) {
    let mut forming = build_global(p, &BuiltIn).unwrap();
    let mut seen = Frames::default();
    let outcome = forming.run(&p.control(), &mut seen);
    (forming, outcome.unwrap_or_else(|e| panic!("{e:?}")), seen.0)
}

const DIAGONAL: f64 = std::f64::consts::FRAC_PI_4;

/// Fields of an element, from its manifest.
fn fields_of(element: &str) -> Vec<ElementField> {
    element_fields(match element {
        "rf4" => Rf4::MANIFEST,
        "s4" => S4::MANIFEST,
        _ => M4::MANIFEST,
    })
}

/// The part's fields on the whole are those that the whole run has there.
fn fields_agree(element: &str, whole: &Forming, part: &Forming) {
    let (a, b) = (&whole.bodies[0], &part.bodies[0]);
    let (r, q) = (whole.reference_points(a), part.reference_points(b));
    let centres = |points: &[Vec3], cells: &[[u32; 4]]| -> Vec<Vec3> {
        let at = |c: &[u32; 4]| {
            let sum = c.iter().fold([0.0; 3], |s, n| add(s, points[*n as usize]));
            scale(sum, 0.25)
        };
        cells.iter().map(at).collect()
    };
    let nodes = twins(&q, &r);
    let cells = twins(&centres(&q, &b.cells), &centres(&r, &a.cells));
    let all = fields_of(element);
    for f in &all {
        let (x, y) = (whole.field(a, f, &all), part.field(b, f, &all));
        let twin = if f.patch { &nodes } else { &cells };
        assert_eq!(x.len(), y.len(), "{}", f.name);
        let size = x.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let far = twin.iter().zip(&y).map(|(t, v)| (x[*t] - v).abs());
        let far = far.fold(0.0, f64::max);
        assert!(
            size > 0.0 && far < 1e-3 * size,
            "{element} {}: {far} of {size}",
            f.name
        );
        // Both signs are there: a field of one sign would agree without being mirrored.
        let low = x.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(f.name != "shear_angle" || low < -0.1 * size, "{low} {size}");
    }
    let (x, y) = (whole.contact_pressure(a), part.contact_pressure(b));
    let far = nodes.iter().zip(&y).map(|(t, v)| (x[*t] - v).abs());
    let (far, size) = (
        far.fold(0.0, f64::max),
        x.iter().copied().fold(0.0, f64::max),
    );
    assert!(far < 1e-2 * size, "{element}: {far} of {size} Pa");
}

/// A part gives the whole's places, fields, energies and forces.
fn agrees(element: &str, fibre_1: f64, planes: &[&str], (whole, a): &(Forming, Outcome)) {
    let (part, b) = form(&press(element, fibre_1, planes), 1);
    let case = format!("{element}, family 1 at {fibre_1:.2}, {planes:?}");
    // Measured: 3e-8 m without bending stiffness, 2e-9 m with it; single precision in the tool's distances is not
    // symmetric to more than that.
    let far = apart(whole, &part);
    assert!(far < 2e-7, "{case}: {far} m");
    assert_eq!(
        whole.model.cells().len(),
        part.copies() as usize * part.model.cells().len()
    );
    let (l, m) = (last(a), last(&b));
    let near = |x: f64, y: f64, to: f64, what: &str| {
        assert!((y / x - 1.0).abs() < to, "{case}: {what} {x} {y}");
    };
    near(l.ledger.membrane, m.ledger.membrane, 1e-5, "membrane");
    near(l.ledger.external, m.ledger.external, 1e-5, "external");
    near(l.ledger.friction, m.ledger.friction, 1e-5, "friction");
    near(l.punch_force, m.punch_force, 1e-3, "punch force");
    near(l.sheets[0].membrane, m.sheets[0].membrane, 1e-5, "ply");
    if element != "m4" {
        near(l.ledger.bending, m.ledger.bending, 1e-5, "bending");
    }
    // The holder presses the whole with the force that is given for it.
    assert!(l.holder_travel != 0.0, "{case}");
    assert!((l.holder_travel - m.holder_travel).abs() < 1e-9, "{case}");
    assert!(b.health.peak_drift_ratio < 1e-3, "{case}: {:?}", b.health);
    let added = |f: &Forming| f.copies() * f.model.sheets()[0].added_mass;
    near(added(whole), added(&part), 1e-9, "added mass");
    // Wound as the whole, the images too.
    let (now, cells) = (part.points(&part.bodies[0]), &part.bodies[0].cells);
    for cell in cells {
        assert!(
            area_vector(cell.map(|n| now[n as usize]))[2] > 0.0,
            "{case}"
        );
    }
    fields_agree(element, whole, &part);
}

#[test]
fn halves_and_quarters_of_a_pressed_membrane_are_those_of_the_whole() {
    for fibre_1 in [0.0, -DIAGONAL] {
        let whole = form(&press("m4", fibre_1, &[]), 1);
        for planes in [&["x"][..], &["y"], &["x", "y"]] {
            agrees("m4", fibre_1, planes, &whole);
        }
    }
}

#[test]
fn a_quarter_of_a_pressed_rotation_free_shell_is_that_of_the_whole() {
    let whole = form(&press("rf4", 0.0, &[]), 1);
    agrees("rf4", 0.0, &["x", "y"], &whole);
    let whole = form(&press("rf4", DIAGONAL, &[]), 1);
    agrees("rf4", DIAGONAL, &["y"], &whole);
}

#[test]
fn a_quarter_of_a_pressed_shell_with_rotations_is_that_of_the_whole() {
    let whole = form(&press("s4", 0.0, &[]), 1);
    agrees("s4", 0.0, &["x"], &whole);
    let whole = form(&press("s4", DIAGONAL, &[]), 1);
    agrees("s4", DIAGONAL, &["x", "y"], &whole);
}

#[test]
fn a_quarter_gives_the_same_bits_on_two_threads() {
    let p = press("rf4", DIAGONAL, &["x", "y"]);
    let (one, two) = (form(&p, 1).0, form(&p, 2).0);
    assert!(one.model.x() == two.model.x() && one.model.v() == two.model.v());
}

#[test]
fn a_half_between_diaphragms_is_the_whole_as_far_as_that_is_symmetric() {
    let (whole, a, x) = frames(&diaphragms("rf4", &[]));
    let (part, b, y) = frames(&diaphragms("rf4", &["x"]));
    assert_eq!(2 * part.model.cells().len(), whole.model.cells().len());
    // Contact looks for closest points node by node in turn, so that no whole is exactly symmetric, and a film wakes
    // what little there is, also which way the ply buckles on the flat top. A part can be as near to the whole as the whole is to its own
    // mirror images.
    let (mut far, mut own) = (0.0f64, 1e-7f64);
    for frame in 0..x.len() {
        for (k, (body, other)) in whole.bodies.iter().zip(&part.bodies).enumerate() {
            let r = whole.reference_points(body);
            let (now, then) = (&x[frame][k], twins(&part.reference_points(other), &r));
            let pairs = then.iter().zip(&y[frame][k]);
            far = pairs
                .map(|(t, p)| norm(sub(now[*t], *p)))
                .fold(far, f64::max);
            for axis in [0, 1] {
                let image = |p: &Vec3| {
                    let mut p = *p;
                    p[axis] = -p[axis];
                    p
                };
                let turned = twins(&r.iter().map(image).collect::<Vec<_>>(), &r);
                let pairs = turned.iter().zip(now);
                own = pairs
                    .map(|(t, p)| norm(sub(image(&now[*t]), *p)))
                    .fold(own, f64::max);
            }
        }
        assert!(far < 6.0 * own, "frame {frame}: {far} m, the whole {own} m");
    }
    assert!(far < 1e-3, "{far}");
    for (l, m) in a.history.iter().zip(&b.history) {
        assert!(
            (l.cavity - m.cavity).abs() < 100.0,
            "{} {}",
            l.cavity,
            m.cavity
        );
        let (l, m) = (l.ledger.membrane, m.ledger.membrane);
        assert!((l - m).abs() < 2e-3 * l + 1e-9, "{l} {m}");
    }
}

#[test]
fn an_outlined_ply_is_cut_at_the_planes_and_pressed_with_a_closed_ledger() {
    let mut p = press("rf4", DIAGONAL, &["x", "y"]);
    let mut sheet = serde_json::to_value(&p.scene.sheets[0]).unwrap();
    let map = sheet.as_object_mut().unwrap();
    map.remove("length");
    map.remove("width");
    map.insert("outline".into(), json!({"circle": {"radius": "0.055 m"}}));
    let holes = [[0.04, 0.0], [-0.04, 0.0]];
    let hole = |c: [f64; 2]| json!({"circle": {"centre": c.map(|x| format!("{x} m")), "radius": "0.009 m"}});
    map.insert("holes".into(), json!(holes.map(hole)));
    p.scene.sheets[0] = serde_json::from_value(sheet).unwrap();
    let (forming, outcome) = form(&p, 1);
    assert!(
        outcome.health.peak_drift_ratio < 0.01,
        "{:?}",
        outcome.health
    );
    let (now, body) = (forming.points(&forming.bodies[0]), &forming.bodies[0]);
    let area: f64 = (forming.bodies[0].cells.iter())
        .map(|c| {
            norm(area_vector(
                c.map(|n| forming.reference_points(body)[n as usize]),
            ))
        })
        .sum();
    let expected = std::f64::consts::PI * (0.055f64.powi(2) - 2.0 * 0.009f64.powi(2));
    assert!((area / expected - 1.0).abs() < 0.01, "{area} {expected}");
    assert!(now.iter().all(|p| p.iter().all(|c| c.is_finite())));
}

/// What the builder says to a scene that was changed.
fn refused(p: &Parameters, change: impl Fn(&mut Value)) -> String {
    let mut p = p.clone();
    let mut scene = serde_json::to_value(&p.scene).unwrap();
    change(&mut scene);
    p.scene = Scene::from_json(scene).unwrap();
    build_global(&p, &BuiltIn)
        .err()
        .expect("refused")
        .to_string()
}

#[test]
fn what_is_not_its_own_mirror_image_is_refused_with_what_and_where() {
    let p = press("rf4", 0.0, &["x", "y"]);
    let text = refused(&p, |s| s["sheets"][0]["centre"] = json!(["0.001 m", "0 m"]));
    for part in [
        "ply `ply_1`",
        "plane x = 0",
        "2 mm off",
        "leave `x` out of `symmetry`",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let text = refused(&p, |s| {
        s["sheets"][0]["fibre_1"] = json!("0.5 rad");
        s["sheets"][0]["fibre_2"] = json!(format!("{} rad", 0.5 + std::f64::consts::FRAC_PI_2));
    });
    assert!(
        text.contains("symmetry[0]") && text.contains("28.648 deg"),
        "{text}"
    );

    // The tool: a spar with one joggle has its image in y = 0 but not in x = 0.
    let spar = json!({"joggle_spar": {
        "length": "0.1 m", "top_width": "0.03 m", "height": "0.02 m", "draft": "0.1 rad", "fillet": "0.004 m",
        "joggles": [{"start": "0 m", "length": "0.03 m", "rise": "0.003 m", "skew": "0 rad",
                     "side_step": ["0 m", "0 m"], "fillet": "0.004 m"}], "facet_size": "0.004 m"}});
    let p = diaphragms("m4", &["x", "y"]);
    let text = refused(&p, |s| s["tool"] = spar.clone());
    let part = "the tool is not its own mirror image in the plane x = 0";
    assert!(text.contains(part), "{text}");
    let mut half = diaphragms("m4", &["y"]);
    let mut scene = serde_json::to_value(&half.scene).unwrap();
    scene["tool"] = spar;
    half.scene = Scene::from_json(scene).unwrap();
    assert!(build_global(&half, &BuiltIn).is_ok());
}

#[test]
fn materials_that_a_plane_turns_into_others_are_refused() {
    // The stitch of the non-crimp fabric resists positive shear alone: between fibres along the axes that is not symmetric.
    let p = press("m4", 0.0, &["x"]);
    let text = refused(&p, |s| s["sheets"][0]["material"] = fabric());
    for part in [
        "material 'NCF' of sheet 'ply_1'",
        "stress in the plane",
        "sign of shear",
        "45 deg",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    // At 45 degrees it is, while its families bend alike.
    let bending = |families: &str| {
        let law = |k: f64| json!({"linear": k, "asymptote": 0.03, "scale": 5.0});
        let mut material = fabric();
        material["with"]["bending"] = json!({"positive": law(2e-4), "negative": law(1e-4), "positive_face": "up", "families": families});
        material
    };
    let p = press("rf4", DIAGONAL, &["x"]);
    let mut alike = p.clone();
    let mut scene = serde_json::to_value(&alike.scene).unwrap();
    scene["sheets"][0]["material"] = bending("same");
    alike.scene = Scene::from_json(scene).unwrap();
    assert!(build_global(&alike, &BuiltIn).is_ok());
    let text = refused(&p, |s| s["sheets"][0]["material"] = bending("opposite"));
    for part in ["bending moment differs", "two fibre families differ"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    // A membrane does not bend: there the same material is symmetric.
    let mut membrane = press("m4", DIAGONAL, &["x"]);
    let mut scene = serde_json::to_value(&membrane.scene).unwrap();
    scene["sheets"][0]["material"] = bending("opposite");
    membrane.scene = Scene::from_json(scene).unwrap();
    let made = build_global(&membrane, &BuiltIn);
    assert!(
        made.is_ok(),
        "{}",
        made.err().map_or_else(String::new, |e| e.to_string())
    );
}

#[test]
fn friction_by_the_angle_to_one_of_two_exchanged_families_is_refused() {
    let law = json!([{"between": ["tool", "ply_1"], "coefficient": 0.3,
        "angle": {"family": 1, "factors": [{"angle": "0 rad", "factor": 1.0}, {"angle": "1.5 rad", "factor": 0.5}]}}]);
    let p = press("m4", DIAGONAL, &["y"]);
    let text = refused(&p, |s| s["friction"]["pairs"] = law.clone());
    for part in ["symmetry[0]", "`angle`", "`ply_1`"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let mut along = press("m4", 0.0, &["y"]);
    let mut scene = serde_json::to_value(&along.scene).unwrap();
    scene["friction"]["pairs"] = law;
    along.scene = Scene::from_json(scene).unwrap();
    assert!(build_global(&along, &BuiltIn).is_ok());
}
