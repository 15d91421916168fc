//! A whole press stroke on a small part: a ply over a hemisphere of 25 mm radius, through a hole, between plates.

use crate::common::scenes::press;
use crate::common::{BuiltIn, form};
use plyflow_forming_explicit::{Forming, Outcome, Parameters, build_global};
use plyflow_model::scene::Scene;
use serde_json::{Value, json};
use std::collections::BTreeMap;

const RADIUS: f64 = 0.025;
const STROKE: f64 = 0.02;

fn parameters(plies: usize, hold: &Value) -> Parameters {
    press(plies, hold, |_| {})
}

/// Distance (m) of a point from the punch's dome at its end.
fn over_dome(x: [f64; 3]) -> f64 {
    (x[0] * x[0] + x[1] * x[1] + x[2] * x[2]).sqrt() - RADIUS
}

#[test]
fn a_ply_takes_the_shape_of_the_punch_and_the_ledger_closes() {
    let p = parameters(1, &json!({"gap": "0.002 m"}));
    let (forming, outcome) = form(&p, 1);
    let health = &outcome.health;
    assert!(health.peak_drift_ratio < 0.01, "{health:?}");
    assert!(health.peak_kinetic_ratio < 0.05, "{health:?}");

    // The punch has arrived, and its force has grown along the way.
    let last = outcome.history.last().unwrap();
    assert_eq!(last.frame, 0.0);
    let force = |share: f64| {
        let row = outcome
            .history
            .iter()
            .find(|r| r.time >= share * 0.2)
            .unwrap();
        row.punch_force
    };
    assert!(force(0.5) > 0.0 && force(0.95) > 2.0 * force(0.5));

    let points = forming.points(&forming.bodies[0]);
    let half = 0.5 * forming.stack[0].thickness;
    // Nothing lies in the punch, the die (its face at the start's height of the stack) or the holder.
    let dome = points.iter().filter(|x| x[2] > 0.005);
    let least = dome.map(|x| over_dome(*x)).fold(f64::MAX, f64::min);
    assert!(least > half - 2e-5, "{least}");
    let face = RADIUS - STROKE + 2.0 * half;
    for x in points.iter().filter(|x| x[0].hypot(x[1]) > 0.032) {
        assert!(
            x[2] < face - half + 2e-5 && x[2] > face - 0.002 + half - 2e-5,
            "{x:?}"
        );
    }
    // The cap lies on the dome.
    for x in points.iter().filter(|x| x[0].hypot(x[1]) < 0.012) {
        assert!(
            (over_dome(*x) - half).abs() < 3e-4,
            "{x:?}: {}",
            over_dome(*x)
        );
    }
    // A ply at +-45 degrees: positive shear along x and y, negative along the diagonals; the same in opposite quadrants.
    let shear = forming.model.cell_field(0, 0);
    let mean = |sign: [f64; 2]| {
        let cells = forming.bodies[0].cells.iter().zip(&shear).filter(|(c, _)| {
            let corners = c.map(|n| forming.model.x()[n as usize]);
            let x = [0, 1].map(|k| 0.25 * corners.iter().map(|q| q[k]).sum::<f64>());
            let (r, along) = (x[0].hypot(x[1]), sign[0] * x[0] + sign[1] * x[1]);
            r > 0.012 && r < 0.03 && along > 0.96 * r * sign[0].hypot(sign[1])
        });
        let values: Vec<f64> = cells.map(|(_, s)| *s).collect();
        values.iter().sum::<f64>() / values.len() as f64
    };
    let (along, across) = (mean([1.0, 0.0]), mean([0.0, 1.0]));
    let signs = [along, across, mean([-1.0, 0.0]), mean([0.0, -1.0])];
    assert!(along.abs() > 0.1, "{signs:?}");
    // Shear has one sign along x and the other along y: the two bias directions of the fibres.
    assert!(along * across < 0.0, "{signs:?}");
    for k in 0..2 {
        assert!(
            (signs[k] - signs[k + 2]).abs() < 0.03 * along.abs(),
            "{signs:?}"
        );
    }

    let (again, _) = form(&p, 2);
    assert!(
        forming.model.x() == again.model.x(),
        "two threads give other positions"
    );
}

/// The blank of `parameters(1, ..)` replaced by an outline, and its elements.
fn outlined(outline: Value, holes: Value, holder: &Value) -> Parameters {
    let mut p = parameters(1, holder);
    let mut sheet = serde_json::to_value(&p.scene.sheets[0]).unwrap();
    let map = sheet.as_object_mut().unwrap();
    map.remove("length");
    map.remove("width");
    map.insert("outline".into(), outline);
    map.insert("holes".into(), holes);
    p.scene.sheets[0] = serde_json::from_value(sheet).expect("a sheet");
    p
}

#[test]
fn a_round_blank_with_a_hole_is_pressed_with_a_closed_ledger_and_the_hole_opens_evenly() {
    let holes = json!([{"circle": {"radius": "0.012 m"}}]);
    let outline = json!({"circle": {"radius": "0.06 m"}});
    let p = outlined(outline, holes, &json!({"gap": "0.002 m"}));
    let (forming, outcome) = form(&p, 1);
    let health = &outcome.health;
    assert!(health.peak_drift_ratio < 0.01, "{health:?}");
    let quality = forming.bodies[0].quality.expect("an outlined ply");
    assert!(
        quality.least_scaled_jacobian > 0.6 && quality.least_edge > 0.35,
        "{quality:?}"
    );
    let (now, then) = (
        forming.points(&forming.bodies[0]),
        forming.reference_points(&forming.bodies[0]),
    );
    // The edge of the hole is still around the axis, and the ply lies on the dome, not in it.
    let hole = || {
        now.iter()
            .zip(&then)
            .filter(|p| p.1[0].hypot(p.1[1]) < 0.0121)
    };
    let radii: Vec<f64> = hole().map(|p| p.0[0].hypot(p.0[1])).collect();
    assert!(
        radii.len() >= 8 && radii.iter().all(|r| *r > 0.008 && *r < 0.02),
        "{radii:?}"
    );
    let middle = |k: usize| hole().map(|p| p.0[k]).sum::<f64>() / radii.len() as f64;
    assert!(
        middle(0).abs() < 5e-4 && middle(1).abs() < 5e-4,
        "{} {}",
        middle(0),
        middle(1)
    );
    let half = 0.5 * forming.stack[0].thickness;
    let dome = now.iter().filter(|x| x[2] > 0.005);
    let least = dome.map(|x| over_dome(*x)).fold(f64::MAX, f64::min);
    assert!(least > half - 2e-5, "{least}");
    let (again, _) = form(&p, 2);
    assert!(
        forming.model.x() == again.model.x(),
        "two threads give other positions"
    );
}

#[test]
fn an_outline_that_the_elements_cannot_follow_is_refused_with_the_size_that_can() {
    let outline = json!({"circle": {"radius": "0.06 m"}});
    let holes = json!([{"circle": {"centre": ["0.05 m", "0 m"], "radius": "0.008 m"}}]);
    let p = outlined(outline, holes, &Value::Null);
    let text = build_global(&p, &BuiltIn)
        .err()
        .expect("refused")
        .to_string();
    assert!(
        text.contains("ply 'ply_1'") && text.contains("measures 2.0"),
        "{text}"
    );
    assert!(text.contains("element size of at most 2.8"), "{text}");
}

#[test]
fn a_holder_with_a_force_presses_with_that_force_on_two_plies() {
    let p = parameters(2, &json!({"force": "200 N"}));
    let (forming, outcome) = form(&p, 1);
    assert!(
        outcome.health.peak_drift_ratio < 0.01,
        "{:?}",
        outcome.health
    );
    let on = |part: &str| -> f64 {
        let contacts = forming.model.rigid_contacts().iter();
        let of = contacts.filter(|c| c.name.starts_with(part));
        of.map(|c| c.resultant()[2]).sum()
    };
    let (holder, punch, die) = (on("holder/"), on("tool/"), on("die/"));
    assert!((holder - 200.0).abs() < 4.0, "{holder}");
    // It goes through both plies: the holder does not hold the upper one past the lower one.
    let past = on("holder/ply_2");
    assert!(past.abs() < 2.0, "{past}");
    // What pushes up is held down by the die.
    assert!(
        (holder + punch + die).abs() < 0.03 * -die,
        "{holder} {punch} {die}"
    );
    for p in forming.penetrations() {
        assert!(p.q999 < 4e-5 && p.overlap() < 0.1, "{p:?}");
    }
    // The second ply lies on the first over the dome.
    let top = |k: usize| {
        forming
            .points(&forming.bodies[k])
            .iter()
            .map(|x| x[2])
            .fold(0.0, f64::max)
    };
    assert!(
        (top(1) - top(0) - 4e-4).abs() < 3e-5,
        "{} {}",
        top(0),
        top(1)
    );
    parts_add_up(&forming, &outcome);
}

/// The energies of sheets and interfaces are those of the ledger, in every row.
fn parts_add_up(forming: &Forming, outcome: &Outcome) {
    let near = |parts: f64, whole: f64, what: &str| {
        let apart = (parts - whole).abs();
        assert!(
            apart <= 1e-9 * whole.abs().max(1e-6),
            "{what}: {parts} and {whole}"
        );
    };
    for r in &outcome.history {
        let (l, s, i) = (&r.ledger, &r.sheets, &r.interfaces);
        near(s.iter().map(|e| e.kinetic).sum(), l.kinetic, "kinetic");
        near(s.iter().map(|e| e.membrane).sum(), l.membrane, "membrane");
        near(s.iter().map(|e| e.bending).sum(), l.bending, "bending");
        near(
            s.iter().map(|e| e.hourglass).sum(),
            l.hourglass,
            "hourglass",
        );
        near(i.iter().map(|e| e.stored).sum(), l.contact, "contact");
        near(i.iter().map(|e| e.friction).sum(), l.friction, "friction");
    }
    // Every surface that slides on another one loses something, and the holder more than the punch.
    let last = &outcome.history.last().expect("rows").interfaces;
    let names = forming.model.interface_energies().map(|(name, _)| name);
    let friction: BTreeMap<&str, f64> = names.zip(last.iter().map(|e| e.friction)).collect();
    let of = |name: &str| {
        friction
            .get(name)
            .copied()
            .unwrap_or_else(|| panic!("{name} in {friction:?}"))
    };
    for name in ["tool/ply_1", "ply_1/ply_2", "die/ply_2", "holder/ply_1"] {
        assert!(of(name) > 0.0, "{friction:?}");
    }
    assert!(of("holder/ply_1") > of("tool/ply_1"), "{friction:?}");
}

#[test]
fn the_strongest_contact_damping_keeps_the_ledger_closed() {
    // Nodes of two plies under a holder feel the dampers of the plates, of the punch and of each other.
    let mut p = parameters(2, &json!({"force": "200 N"}));
    p.contact_damping = 1.0;
    let (_, outcome) = form(&p, 1);
    let health = &outcome.health;
    assert!(health.peak_drift_ratio < 0.01, "{health:?}");
}

#[test]
fn contact_with_itself_changes_nothing_where_no_ply_folds() {
    let mut p = parameters(1, &json!({"gap": "0.002 m"}));
    p.scene.friction.fabric_fabric = None;
    (p.element_size, p.time_step) = (0.01, 1.2e-5);
    let (mut with, _) = form(&p, 1);
    p.self_contact = false;
    let (without, _) = form(&p, 1);
    assert!(with.model.x() == without.model.x() && with.model.v() == without.model.v());
    let pairs = |f: &Forming| -> Vec<String> {
        let all = f.penetrations().into_iter();
        let own = all.filter(|p| p.largest == 0.0).map(|p| p.pair);
        own.filter(|n| n == "ply_1/ply_1").collect()
    };
    assert_eq!((pairs(&with).len(), pairs(&without).len()), (1, 0));
    // Without a coefficient a fold slides freely, and the run says so, but only if there was one.
    assert!(with.frictionless_folds(&p.scene).is_none());
    with.model.self_contacts_mut()[0].touched = true;
    let text = with.frictionless_folds(&p.scene).unwrap();
    assert!(text.contains("friction.fabric_fabric") && text.contains("ply_1/ply_1"));
    p.scene.friction.fabric_fabric = Some(plyflow_model::friction::Coefficient::Constant(
        plyflow_model::units::Number(0.3),
    ));
    assert!(with.frictionless_folds(&p.scene).is_none());
}

#[test]
fn what_makes_no_press_is_refused_with_what_to_do() {
    let refused = |p: &Parameters| {
        build_global(p, &BuiltIn)
            .err()
            .expect("refused")
            .to_string()
    };
    let tight = refused(&parameters(2, &json!({"gap": "0.0005 m"})));
    assert!(tight.contains("gap") && tight.contains("0.8 mm"), "{tight}");
    let text = |key: &str, value: Value| {
        let mut scene =
            serde_json::to_value(parameters(1, &json!({"gap": "0.002 m"})).scene).unwrap();
        let press = &mut scene["process"]["press"];
        *press.pointer_mut(key).unwrap() = value;
        let mut p = parameters(1, &Value::Null);
        p.scene = Scene::from_json(scene).unwrap();
        refused(&p)
    };
    let deep = text("/stroke", json!("0.03 m"));
    assert!(
        deep.contains("stroke") && deep.contains("25.0 mm"),
        "{deep}"
    );
    let narrow = text("/die/opening_radius", json!("0.02 m"));
    assert!(narrow.contains("die.opening_radius"), "{narrow}");
    let holder = json!({"opening_radius": "0.024 m", "hold": {"gap": "0.002 m"}});
    let narrow = text("/holder", holder);
    assert!(narrow.contains("holder.opening_radius"), "{narrow}");
    // A shallow stroke that ends within the rounding of the die's edge, wider there than the opening.
    let mut scene = serde_json::to_value(parameters(1, &Value::Null).scene).unwrap();
    scene["process"]["press"]["stroke"] = json!("0.003 m");
    scene["process"]["press"]["die"] =
        json!({"opening_radius": "0.006 m", "edge_radius": "0.005 m"});
    let mut p = parameters(1, &Value::Null);
    p.scene = Scene::from_json(scene).unwrap();
    let wide = refused(&p);
    assert!(wide.contains("the punch reaches into the die"), "{wide}");
    // A strip with no node inside has nothing about which rf4 bends.
    let mut scene = serde_json::to_value(parameters(1, &Value::Null).scene).unwrap();
    scene["sheets"][0]["width"] = json!("0.004 m");
    scene["sheets"][0]["material"]["with"]["bending"] = json!({"positive": {"stiffness": 0.001}});
    let mut p = parameters(1, &Value::Null);
    p.scene = Scene::from_json(scene).unwrap();
    p.element.plugin = "rf4".into();
    p.element_size = 0.004;
    let strip = refused(&p);
    assert!(
        strip.contains("it would not bend") && strip.contains("of 2.0 mm or less"),
        "{strip}"
    );
    let mut p = parameters(1, &Value::Null);
    p.scene.friction.tool_fabric = None;
    let rough = refused(&p);
    assert!(rough.contains("friction.tool_fabric"), "{rough}");
    let mut p = parameters(1, &Value::Null);
    p.scene.sheets[0].kind = plyflow_model::scene::SheetKind::Diaphragm;
    let film = refused(&p);
    assert!(
        film.contains("press") && film.contains("plies alone"),
        "{film}"
    );
}

/// Three plies of 0.4 mm are 1.2000000000000002 mm to a computer.
#[test]
fn a_gap_as_thick_as_the_plies_is_taken() {
    build_global(&parameters(3, &json!({"gap": "0.0012 m"})), &BuiltIn).unwrap();
}

#[test]
fn a_holder_that_the_plies_have_left_stops_at_the_die() {
    let p = parameters(2, &json!({"force": "200 N"}));
    let mut forming = build_global(&p, &BuiltIn).unwrap();
    // No contact was computed: nothing resists.
    forming.model.set_step(1e-4);
    for _ in 0..5000 {
        forming.load_at(0.1);
    }
    let press = forming.load.press().unwrap();
    assert!(press.holder_is_bare());
    assert!((press.holder_travel() - 8e-4).abs() < 1e-12);
}

#[test]
fn an_open_ledger_stops_the_run_and_says_where() {
    let mut p = parameters(1, &json!({"gap": "0.002 m"}));
    // What rounding and the step's own error leave is beyond this.
    p.drift_bound = 1e-7;
    let mut forming = build_global(&p, &BuiltIn).unwrap();
    let error = forming
        .run(&p.control(), &mut crate::common::Silent)
        .unwrap_err();
    let text = error.to_string();
    for part in [
        "is unaccounted for (drift_bound",
        "The step is set by an element of 'ply_1' at (",
        "shear",
        "Deepest contact: ",
        "Fastest: 'ply_1' at",
        "Likely cause: ",
        "What to try: ",
    ] {
        assert!(text.contains(part), "'{part}' is not in: {text}");
    }
    // It stopped early, not at the end.
    assert!(forming.model.time() < 0.15, "{}", forming.model.time());
}
