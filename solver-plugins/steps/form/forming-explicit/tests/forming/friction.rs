//! The friction of a scene: classes, named pairs, laws of pressure and angle; and what is refused.

use crate::common::scenes::{ply, press};
use crate::common::{BuiltIn, fabric};
use plyflow_forming_explicit::{Parameters, build_global};
use plyflow_mechanics::contact::{FrictionLaw, PressureDependence, Whose};
use plyflow_mechanics::model::Model;
use serde_json::{Value, json};

/// Two plies in a press with a holder, and with this friction.
fn parameters(friction: &Value) -> Parameters {
    press(2, &json!({"gap": "0.002 m"}), |p| {
        let scene = &mut p["scene"];
        scene["tool"]["hemisphere"]["facet_size"] = json!("0.004 m");
        scene["sheets"] = ["inner", "outer"]
            .map(|n| ply(n, &fabric(), [0.12, 0.12], 0.0))
            .into();
        scene["friction"] = friction.clone();
        p["element_size"] = json!(0.012);
        p["tool_grid"] = json!(0.004);
    })
}

fn model(friction: &Value) -> Model {
    let p = parameters(friction);
    build_global(&p, &BuiltIn).map(|f| f.model).unwrap()
}

/// The law of a contact by its name.
fn law<'a>(model: &'a Model, name: &str) -> &'a FrictionLaw {
    let rigid = model
        .rigid_contacts()
        .iter()
        .map(|c| (&c.name, &c.friction));
    let sheets = model
        .sheet_contacts()
        .iter()
        .map(|c| (&c.name, &c.friction));
    let found = rigid.chain(sheets).find(|(n, _)| n.as_str() == name);
    found.unwrap_or_else(|| panic!("no contact {name}")).1
}

fn constant(model: &Model, name: &str) -> f64 {
    match law(model, name) {
        FrictionLaw::Constant(mu) => *mu,
        law => panic!("{name}: {law:?}"),
    }
}

#[test]
fn pairs_take_the_place_of_their_class_in_either_order() {
    let m = model(&json!({
        "tool_fabric": 0.2, "fabric_fabric": 0.3,
        "pairs": [{"between": ["die", "outer"], "coefficient": 0.5}, {"between": ["outer", "inner"], "coefficient": 0.4}]
    }));
    assert_eq!(constant(&m, "tool/inner"), 0.2);
    assert_eq!(constant(&m, "holder/inner"), 0.2);
    assert_eq!(constant(&m, "die/outer"), 0.5);
    assert_eq!(constant(&m, "inner/outer"), 0.4);
    // What holds a ply through another one rubs as the weaker of the surfaces between does.
    assert_eq!(constant(&m, "die/inner"), 0.4);
    assert_eq!(constant(&m, "tool/outer"), 0.2);
    // A class whose pairs are all named is not needed, nor a law of those that have another ply between them.
    model(
        &json!({"tool_fabric": 0.2, "pairs": [{"between": ["outer", "inner"], "coefficient": 0.4}]}),
    );
    let pair = |between: [&str; 2], mu: f64| json!({"between": between, "coefficient": mu});
    let m = model(&json!({"fabric_fabric": 0.3,
        "pairs": [pair(["tool", "inner"], 0.2), pair(["holder", "inner"], 0.1), pair(["outer", "die"], 0.5)]}));
    assert_eq!(constant(&m, "die/inner"), 0.3);
    assert_eq!(constant(&m, "holder/outer"), 0.1);
}

#[test]
fn laws_of_pressure_and_angle_reach_the_contacts() {
    let factors = json!([{"angle": "0 deg", "factor": 1.0}, {"angle": "90 deg", "factor": 0.7}]);
    let m = model(&json!({
        "tool_fabric": {"coefficient": 0.25, "pressure": {"power": {"reference": "50 kPa", "exponent": -0.2}}},
        "fabric_fabric": {"coefficient": 0.3, "angle": {"of": "lower", "family": 2, "factors": factors}},
        "pairs": [{"between": ["holder", "inner"], "angle": {"factors": factors},
                   "pressure": {"table": [{"pressure": "0 kPa", "coefficient": 0.4}, {"pressure": "100 kPa", "coefficient": 0.2}]}}]
    }));
    let varying = |name: &str| match law(&m, name) {
        FrictionLaw::Varying(law) => law.clone(),
        law => panic!("{name}: {law:?}"),
    };
    let power = varying("tool/inner");
    assert!(power.angle.is_none());
    let at = power.pressure.coefficient(1e5);
    assert!((at - 0.25 * 2f64.powf(-0.2)).abs() < 1e-12, "{at}");
    let between = varying("inner/outer");
    assert_eq!(between.pressure, PressureDependence::Constant(0.3));
    // The outer ply's nodes touch the inner ply, whose fibres count.
    assert_eq!(between.angle.as_ref().unwrap().whose, Whose::Master);
    // Through the inner ply, a law by the inner ply's fibres counts without them: the die is no sheet that has any.
    let through = varying("die/inner");
    assert!((through.pressure.coefficient(1e5) - at).abs() < 1e-12);
    let weakest = varying("holder/outer");
    assert!(weakest.angle.is_none());
    assert_eq!(weakest.pressure.coefficient(1e5), 0.2);
    let table = varying("holder/inner");
    assert!((table.pressure.coefficient(25e3) - 0.35).abs() < 1e-12);
    let angle = table.angle.as_ref().unwrap();
    assert_eq!(angle.whose, Whose::Slave);
    assert!(
        (angle.factors[1][0] - std::f64::consts::FRAC_PI_2).abs() < 1e-9
            && angle.factors[1][1] == 0.7
    );
}

#[test]
fn pairs_and_laws_that_make_no_sense_are_refused_with_what_to_do() {
    let pair = |names: [&str; 2]| json!({"between": names, "coefficient": 0.3});
    let with =
        |pairs: Vec<Value>| json!({"tool_fabric": 0.2, "fabric_fabric": 0.3, "pairs": pairs});
    let tool = |law: Value| json!({"tool_fabric": law, "fabric_fabric": 0.3});
    let plies = |law: Value| json!({"tool_fabric": 0.2, "fabric_fabric": law});
    let factors = |rows: &[(&str, f64)]| -> Value {
        rows.iter()
            .map(|(a, f)| json!({"angle": a, "factor": f}))
            .collect()
    };
    let table = |rows: &[(&str, f64)]| -> Value {
        rows.iter()
            .map(|(p, c)| json!({"pressure": p, "coefficient": c}))
            .collect()
    };
    for (friction, words) in [
        (
            with(vec![pair(["inner", "oter"])]),
            vec!["pairs[0].between", "`oter`", "did you mean `outer`?"],
        ),
        (
            with(vec![pair(["bed", "inner"])]),
            vec!["`bed`", "`tool`, `die`, `holder`, `inner`, `outer`"],
        ),
        (
            with(vec![pair(["tool", "holder"])]),
            vec!["do not rub", "`[tool, inner]`", "`[outer, die]`"],
        ),
        (
            with(vec![pair(["inner", "outer"]), pair(["outer", "inner"])]),
            vec![
                "pairs[1].between",
                "named twice",
                "at friction.pairs[0].between",
            ],
        ),
        (
            tool(json!(-0.1)),
            vec!["friction.tool_fabric", "-0.1", "from 0 to 2"],
        ),
        (
            tool(json!({})),
            vec!["friction.tool_fabric.coefficient", "has no `coefficient`"],
        ),
        (
            tool(
                json!({"coefficient": 0.2, "pressure": {"power": {"reference": "1 kPa", "exponent": -1.0}}}),
            ),
            vec!["tool_fabric.pressure.power.exponent", "-1"],
        ),
        (
            tool(json!({"pressure": {"table": table(&[("1 kPa", 0.2), ("1 kPa", 0.3)])}})),
            vec!["tool_fabric.pressure.table[1]", "more than the 1000 Pa"],
        ),
        (
            tool(
                json!({"coefficient": 0.2, "pressure": {"table": table(&[("1 kPa", 0.2), ("2 kPa", 0.3)])}}),
            ),
            vec!["tool_fabric.coefficient", "remove one"],
        ),
        (
            tool(json!({"coefficient": 0.2, "angle": {"factors": factors(&[("0 deg", 1.0)])}})),
            vec!["tool_fabric.angle.factors", "one row"],
        ),
        (
            tool(
                json!({"coefficient": 0.5, "angle": {"factors": factors(&[("0 deg", 1.0), ("90 deg", 5.0)])}}),
            ),
            vec!["factors[1].factor", "at most 2"],
        ),
        (
            plies(
                json!({"coefficient": 0.3, "angle": {"factors": factors(&[("0 deg", 1.0), ("90 deg", 0.5)])}}),
            ),
            vec!["fabric_fabric.angle.of", "`of: lower` or `of: upper`"],
        ),
        (
            json!({"tool_fabric": 0.2}),
            vec!["friction.fabric_fabric", "`inner` and `outer` touch"],
        ),
    ] {
        let p = parameters(&friction);
        let text = build_global(&p, &BuiltIn)
            .err()
            .expect("refused")
            .to_string();
        for word in words {
            assert!(text.contains(word), "{friction}: '{text}' lacks '{word}'");
        }
    }
}
