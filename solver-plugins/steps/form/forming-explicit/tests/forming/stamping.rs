//! Stamping: parts that stand still, follow a table or are pressed, grippers, and what cannot be stamped.

use crate::common::scenes::{hourglass, ply};
use crate::common::{BuiltIn, Silent, form, woven};
use plyflow_forming_explicit::{Forming, Parameters, RigidName, Watch, Watched, build_global};
use plyflow_mechanics::archive::Archive;
use plyflow_model::scene::Scene;
use serde_json::{Value, json};

/// A block with its flat top at 10 mm, under a ply of 0.3 mm; `stamping` says what else there is, and `change` has the last word.
pub fn stamped(stamping: Value, change: impl FnOnce(&mut Value)) -> Parameters {
    let mut all = json!({
        "scene": {
            "plyflow_scene": 1, "name": "stamped",
            "tool": {"flat": {"length": "0.04 m", "width": "0.06 m", "height": "0.01 m", "fillet": "0.002 m", "facet_size": "0.005 m"}},
            "sheets": [ply("ply_1", &woven(), [0.16, 0.048], 0.0)],
            "friction": {"tool_fabric": 0.3},
            "process": {"stamping": stamping}
        },
        "element": {"plugin": "m4", "with": hourglass(300.0)},
        "diaphragm_element": {"plugin": "m4", "with": {}},
        "element_size": 0.008, "diaphragm_growth": 1.25, "time_step": 1e-5, "step_safety": 0.8,
        "least_areal_mass": 2.0, "damping": 50.0, "contact_stiffness": 0.3, "slip_stiffness": 0.5,
        "contact_damping": 0.3, "contact_augmentation": 0.0, "frames": 10, "tool_grid": 0.002,
        "kinetic_bound": 0.05, "drift_bound": 0.5
    });
    change(&mut all);
    serde_json::from_value(all).expect("the parameters fit their type")
}

/// A block of 36 x 60 mm about x (m) that hangs with its face at `face` (m).
pub fn pad(name: &str, x: f64, face: f64) -> Value {
    json!({"name": name, "side": "above", "up": "-z", "centre": [format!("{x} m"), "0 m"], "foot": format!("{face} m"),
        "tool": {"flat": {"length": "0.036 m", "width": "0.06 m", "height": "0.01 m", "fillet": "0.002 m", "facet_size": "0.005 m"}}})
}

/// A block of 36 x 60 mm about x (m) that stands on z = 0 with its top at 10 mm.
pub fn block(name: &str, x: f64) -> Value {
    json!({"name": name, "side": "below", "centre": [format!("{x} m"), "0 m"],
        "tool": {"flat": {"length": "0.036 m", "width": "0.06 m", "height": "0.01 m", "fillet": "0.002 m", "facet_size": "0.005 m"}}})
}

pub fn with(mut part: Value, motion: Value) -> Value {
    part["motion"] = motion;
    part
}

pub fn process(parts: &[Value]) -> Value {
    json!({"forming_time": "0.08 s", "settling_time": "0.02 s", "parts": parts})
}

/// A pad over each of two blocks beside the tool: one block stands still, one rests on a spring, and the pads come down by 5 mm and not at all.
fn pushed() -> Parameters {
    let down =
        json!({"table": [{"time": "0 s", "way": "0.0051 m"}, {"time": "0.08 s", "way": "0 m"}]});
    let spring = json!({"pressed": {"force": "10 N", "spring": "2000 N/m"}});
    stamped(
        process(&[
            with(pad("punch", 0.055, 0.0053), down),
            with(block("holder", 0.055), spring),
            with(
                pad("pad", 0.0, 0.0103),
                json!({"pressed": {"force": "40 N", "travel": "0.001 m"}}),
            ),
        ]),
        |_| {},
    )
}

/// Force on the plies (N) and way (m) of a part in the last row.
fn last(forming: &Forming, outcome: &plyflow_forming_explicit::Outcome, name: &str) -> [f64; 2] {
    let names = ["tool", "punch", "holder", "pad"];
    let k = names.iter().position(|n| *n == name).unwrap();
    assert_eq!(
        forming.rigid.len() + 1,
        outcome.history.last().unwrap().parts.len()
    );
    outcome.history.last().unwrap().parts[k]
}

#[test]
fn a_pressed_part_gives_its_force_and_a_spring_what_it_is_pushed_back_by() {
    let (forming, outcome) = form(&pushed(), 1);
    let health = &outcome.health;
    assert!(health.peak_drift_ratio < 0.01, "{health:?}");
    // The pad has 40 N, and the tool below it stands against them; nothing else is on it but what the ply pulls along.
    let [pad, way] = last(&forming, &outcome, "pad");
    assert!(
        (pad - 40.0).abs() < 1.0 && way < 0.0 && way > -2e-5,
        "{pad} N, {way} m"
    );
    // The punch has arrived, and pushed the holder 5 mm down through the ply.
    let [punch, arrived] = last(&forming, &outcome, "punch");
    assert_eq!(arrived, 0.0);
    let [holder, back] = last(&forming, &outcome, "holder");
    assert!((back - 5e-3).abs() < 5e-5, "{back}");
    assert!(
        (holder - (10.0 + 2000.0 * back)).abs() < 1.0,
        "{holder} N at {back} m"
    );
    // What comes down is what holds up, but for what the bent ply takes sideways.
    let [tool, _] = last(&forming, &outcome, "tool");
    assert!(
        (tool + holder - punch - pad).abs() < 0.05 * (punch + pad),
        "{tool} {holder} {punch} {pad}"
    );
    // The ply lies between punch and holder.
    let half = 0.5 * forming.stack[0].thickness;
    let points = forming.points(&forming.bodies[0]);
    let under: Vec<f64> = points
        .iter()
        .filter(|p| (p[0] - 0.055).abs() < 0.012)
        .map(|p| p[2])
        .collect();
    assert!(under.len() > 5);
    for z in under {
        assert!((z - (5.3e-3 - half)).abs() < 3e-5, "{z}");
    }
    let (again, _) = form(&pushed(), 2);
    assert!(
        forming.model.x() == again.model.x(),
        "two threads give other positions"
    );
}

#[test]
fn a_pressed_part_without_travel_goes_on_to_the_part_that_it_meets_and_the_plies_bear_its_force() {
    let force = json!({"pressed": {"force": "40 N"}});
    let travel = |forming: &Forming, name: &str| {
        let load = forming.load.stamping().unwrap();
        let part = load.parts.iter().find(|p| p.name.word() == name).unwrap();
        part.travel().unwrap()
    };
    // Drawn on the ply of 0.3 mm over the tool, and 5 mm over it.
    for (face, open) in [(0.0103, 0.3e-3), (0.0153, 5.3e-3)] {
        let p = stamped(
            process(&[with(pad("pad", 0.0, face), force.clone())]),
            |_| {},
        );
        let forming = build_global(&p, &BuiltIn).unwrap();
        let found = travel(&forming, "pad");
        // The field of a part is off it by less than a tenth of the ply.
        assert!((found - open).abs() < 3e-5, "{found} for {open}");
        let told = &forming.load.stamping().unwrap().stops;
        assert!(
            told.len() == 1 && told[0].contains("`pad`") && told[0].contains("it meets `tool`"),
            "{told:?}"
        );
        assert!(forming.tool_warnings.is_empty());
    }
    let p = stamped(
        process(&[with(pad("pad", 0.0, 0.0103), force.clone())]),
        |_| {},
    );
    let (forming, outcome) = form(&p, 1);
    let [[tool, _], [pad_force, way]] = outcome.history.last().unwrap().parts[..] else {
        panic!("two parts");
    };
    assert!(
        (pad_force - 40.0).abs() < 1.0 && (tool - 40.0).abs() < 1.0,
        "{pad_force} {tool}"
    );
    // The ply holds it: it is far from its stop.
    assert!(way < 0.0 && way > -0.1 * travel(&forming, "pad"), "{way}");
}

#[test]
fn a_ply_that_only_rests_on_a_part_gives_it_its_weight_and_is_not_stopped_for_shares_of_nanojoules()
{
    let over =
        json!({"table": [{"time": "0 s", "way": "0.005 m"}, {"time": "0.08 s", "way": "0 m"}]});
    let mut process = process(&[with(pad("punch", 0.0, 0.0203), over)]);
    process["weight"] = json!("down");
    let p = stamped(process, |p| {
        p["scene"]["sheets"][0] = ply("ply_1", &woven(), [0.032, 0.048], 0.0);
    });
    let (forming, outcome) = form(&p, 1);
    let [_, [punch, _]] = outcome.history.last().unwrap().parts[..] else {
        panic!("two parts");
    };
    let own: f64 = forming.model.own_masses().iter().sum();
    let rows = &outcome.history[60..];
    let tool = rows.iter().map(|r| r.parts[0][0]).sum::<f64>() / rows.len() as f64;
    assert_eq!(punch, 0.0);
    assert!(
        (tool / (own * 9.80665) - 1.0).abs() < 0.01,
        "{tool} N of {own} kg"
    );
    assert!(
        outcome.health.peak_drift_ratio < 0.01,
        "{:?}",
        outcome.health
    );
    assert!(outcome.warnings.is_empty(), "{:?}", outcome.warnings);
}

#[test]
fn a_run_that_is_taken_up_has_its_parts_where_they_were() {
    let p = pushed();
    let mut forming = build_global(&p, &BuiltIn).unwrap();
    forming.run(&p.control(), &mut Silent).unwrap();
    let mut bytes = Vec::new();
    forming.archive(&mut Archive::Save(&mut bytes)).unwrap();
    let mut again = build_global(&p, &BuiltIn).unwrap();
    assert!(again.load.stamping() != forming.load.stamping());
    again.archive(&mut Archive::Load(&bytes)).unwrap();
    assert!(again.load.stamping() == forming.load.stamping());
}

#[test]
fn a_part_that_never_touches_is_told_and_those_that_do_are_not() {
    let mut parts = pushed();
    let (forming, _) = form(&parts, 1);
    assert_eq!(
        forming.load.stamping().unwrap().never_touched(),
        Vec::<String>::new()
    );
    // A block far under the ply.
    let mut scene = serde_json::to_value(&parts.scene).unwrap();
    let mut deep = block("deep", -0.055);
    deep["foot"] = json!("-0.05 m");
    scene["process"]["stamping"]["parts"]
        .as_array_mut()
        .unwrap()
        .push(deep);
    parts.scene = Scene::from_json(scene).unwrap();
    let (forming, _) = form(&parts, 1);
    let told = forming.load.stamping().unwrap().never_touched();
    assert!(
        told.len() == 1 && told[0].contains("'deep' has never touched"),
        "{told:?}"
    );
}

#[test]
fn a_gripper_pulls_with_its_force_and_its_spring_against_the_draw_in() {
    let pull = |spring: Value| {
        let mut stamping = process(&[with(
            pad("pad", 0.0, 0.0103),
            json!({"pressed": {"force": "400 N", "travel": "0.001 m"}}),
        )]);
        let grip = |x: &str, angle: &str, spring: &Value| {
            let mut grip = json!({"ply": "ply_1", "centre": [x, "0 m"], "length": "0.002 m", "width": "0.06 m", "pull": angle, "force": "6 N"});
            if !spring.is_null() {
                grip["spring"] = spring.clone();
            }
            grip
        };
        stamping["grippers"] = json!([
            grip("0.08 m", "0 deg", &spring),
            grip("-0.08 m", "180 deg", &Value::Null)
        ]);
        form(
            &stamped(stamping, |p| {
                p["scene"]["friction"]["tool_fabric"] = json!(0.5)
            }),
            1,
        )
    };
    let (forming, outcome) = pull(Value::Null);
    assert!(
        outcome.health.peak_drift_ratio < 0.01,
        "{:?}",
        outcome.health
    );
    let rows = outcome.history.last().unwrap().parts.clone();
    // Tool, pad, then the grippers: 6 N each, and the ply stretched by them a little between pad and gripper.
    assert_eq!(rows.len(), 4);
    for [force, drawn] in &rows[2..] {
        assert!((force - 6.0).abs() < 1e-9, "{force}");
        assert!(*drawn < 0.0 && *drawn > -1e-4, "{drawn}");
    }
    // Tension of the fibres along x between pad and gripper: the force over width, thickness and modulus.
    let strain = forming.field(&forming.bodies[0], &strain_field(), &[strain_field()]);
    let cells = forming.bodies[0].cells.iter().zip(&strain);
    let beside = cells.filter(|(c, _)| {
        let x = c
            .iter()
            .map(|n| forming.model.x()[*n as usize][0])
            .sum::<f64>()
            / 4.0;
        x > 0.035 && x < 0.065
    });
    let found: Vec<f64> = beside.map(|(_, s)| *s).collect();
    let mean = found.iter().sum::<f64>() / found.len() as f64;
    let expected = 6.0 / (0.048 * 3e-4 * 3e9);
    assert!(
        (mean / expected - 1.0).abs() < 0.1,
        "{mean}, not {expected}"
    );
    // A spring gives way with the stretch.
    let (_, sprung) = pull(json!("20000 N/m"));
    let [force, drawn] = sprung.history.last().unwrap().parts[2];
    assert!(
        force < 5.9 && (force - (6.0 + 20000.0 * drawn)).abs() < 0.02,
        "{force} N at {drawn} m"
    );
}

/// The strain of the fibres of family 1, as membranes have it.
fn strain_field() -> plyflow_mechanics::component::ElementField {
    let manifest = plyflow_kernels::built_in::component(plyflow_abi::PF_KIND_ELEMENT, "m4")
        .unwrap()
        .manifest;
    // SAFETY: of a component that is built in, whose texts are static.
    let manifest = unsafe { manifest.as_str() }.unwrap();
    let fields = plyflow_mechanics::component::element_fields(manifest);
    fields
        .into_iter()
        .find(|f| f.name == "fibre_strain_1")
        .unwrap()
}

#[test]
fn a_node_in_a_part_above_is_seen_with_the_part_and_its_depth() {
    let mut forming = build_global(&pushed(), &BuiltIn).unwrap();
    let (mut watch, mut watched) = (Watch::new(&forming), Watched::default());
    watch.look(&forming, &mut watched, false);
    assert!(
        watched.now.iter().all(|d| d.depth == 0.0),
        "nothing is in anything at the start"
    );
    let z = 0.0103 - 0.5 * forming.stack[0].thickness;
    let near = |n: &&u32| {
        let p = forming.model.x()[**n as usize];
        p[0].hypot(p[1])
    };
    let nodes = &forming.model.sheets()[0].nodes;
    let n = *nodes
        .iter()
        .min_by(|a, b| near(a).total_cmp(&near(b)))
        .unwrap() as usize;
    forming.model.x_mut()[n][2] = z + 1e-4;
    watch.look(&forming, &mut watched, false);
    let depths = watch.depths(&watched);
    let found = depths.iter().find(|d| d.pair.name == "pad/ply_1").unwrap();
    let pad = RigidName::Part("pad".into());
    assert!(
        (found.end.depth - (1e-4 - forming.field_error(&pad))).abs() < 1e-9,
        "{found:?}"
    );
    // Every part with every ply, by its nodes and by its edges.
    for part in ["tool", "punch", "holder", "pad"] {
        for pair in [format!("{part}/ply_1"), format!("{part}_edges/ply_1")] {
            assert!(depths.iter().any(|d| d.pair.name == pair), "{pair}");
        }
    }
}

#[test]
fn what_cannot_be_stamped_is_refused_with_the_parts_the_place_and_the_time() {
    let refused = |parts: &[Value]| {
        let p = stamped(process(parts), |_| {});
        build_global(&p, &BuiltIn)
            .err()
            .expect("refused")
            .to_string()
    };
    let table = |from: f64, to: f64| json!({"table": [{"time": "0 s", "way": format!("{from} m")}, {"time": "0.08 s", "way": format!("{to} m")}]});
    for (parts, says) in [
        // Into the tool by 1 mm at the end; without room for the ply; under the plies beside it.
        (
            vec![with(pad("pad", 0.0, 0.0103), table(0.01, -0.0013))],
            vec![
                "`tool` and `pad` meet",
                "t = 80.0 ms",
                "mm in each other at (",
            ],
        ),
        (
            vec![with(pad("pad", 0.0, 0.0103), table(0.01, -0.0001))],
            vec!["`tool` and `pad` leave 0.", "0.300 mm thick"],
        ),
        (
            vec![with(block("holder", 0.03), table(0.0, 0.002))],
            vec!["`tool` and `holder` meet", "in each other at ("],
        ),
        (
            vec![with(pad("pad", 0.0, 0.0083), table(0.0, 0.001))],
            vec![
                "at the start the part `pad` reaches 2.000 mm into the plies",
                "`way`",
            ],
        ),
        (
            vec![with(pad("pad", 0.2, 0.0103), table(0.01, 0.0))],
            vec!["`pad` is never over a ply", "(182.0, -30.0, 20.3) mm"],
        ),
        (
            vec![with(pad("pad", 0.0, 0.0203), table(0.0, 0.01))],
            vec![
                "`pad` starts 10.000 mm off the plies",
                "gets smaller",
                "up of a part above",
            ],
        ),
    ] {
        let text = refused(&parts);
        for part in says {
            assert!(text.contains(part), "'{part}' is not in: {text}");
        }
    }
    let mut stamping = process(&[with(pad("pad", 0.0, 0.0103), table(0.01, 0.0))]);
    stamping["grippers"] = json!([{"ply": "ply_1", "centre": ["0.03 m", "0.003 m"], "length": "0.001 m", "width": "0.001 m", "pull": "0 deg", "force": "1 N"}]);
    let p = stamped(stamping, |_| {});
    let text = build_global(&p, &BuiltIn)
        .err()
        .expect("refused")
        .to_string();
    assert!(
        text.contains("grippers[0]") && text.contains("no node"),
        "{text}"
    );
}

#[test]
fn a_matched_die_closes_over_a_double_dome_to_its_gap() {
    let stamping = json!({"forming_time": "0.06 s", "settling_time": "0.01 s", "parts": [
        {"name": "die", "side": "above",
         "matching": {"gap": "0.6 mm", "edge_radius": "4 mm", "face": "1 mm", "length": "180 mm", "width": "120 mm"},
         "motion": {"table": [{"time": "0 s", "way": "0.0275 m"}, {"time": "0.06 s", "way": "0 m"}]}}]});
    let p = stamped(stamping, |p| {
        p["scene"]["tool"] = json!({"double_dome": {"dome_radius": "20 mm", "dome_distance": "60 mm", "waist_radius": "50 mm",
            "wall": "8 mm", "facet_size": "4 mm"}});
        p["scene"]["sheets"] = json!([ply("ply_1", &woven(), [0.15, 0.096], 0.0)]);
        p["element_size"] = json!(0.006);
    });
    let (forming, outcome) = form(&p, 2);
    assert!(
        outcome.health.peak_drift_ratio < 0.01,
        "{:?}",
        outcome.health
    );
    let [_, way] = outcome.history.last().unwrap().parts[1];
    assert_eq!(way, 0.0);
    // Both have touched the ply, and it is in none of them.
    assert!(forming.load.stamping().unwrap().never_touched().is_empty());
    let depths = &outcome.depths;
    for name in ["tool/ply_1", "die/ply_1"] {
        let found = depths.iter().find(|d| d.pair.name == name).unwrap();
        assert!(found.share() < 0.1, "{found:?}");
    }
    // Over the domes each node is half a thickness off the punch and off the die, whose hollow is a dome with 0.6 mm around it.
    let half = 0.5 * forming.stack[0].thickness;
    let points = forming.points(&forming.bodies[0]);
    let over_dome = points.iter().filter(|p| p[0].abs() > 0.022 && p[2] > 0.012);
    let off: Vec<f64> = over_dome
        .map(|p| (p[0].abs() - 0.03).hypot(p[1]).hypot(p[2] - 0.008) - 0.02)
        .collect();
    assert!(off.len() > 20);
    let (least, most) = off
        .iter()
        .fold((f64::MAX, 0.0f64), |(a, b), d| (a.min(*d), b.max(*d)));
    assert!(
        least > half - 5e-5 && most < 6e-4 - half + 5e-5,
        "{least} {most}"
    );
    // The ply is sheared on the flanks of the domes, with both signs.
    let shear = forming.model.cell_field(0, 0);
    let most = shear.iter().copied().fold(0.0, f64::max);
    let least = shear.iter().copied().fold(0.0, f64::min);
    assert!(most > 0.1 && least < -0.1, "{least} {most}");
}
