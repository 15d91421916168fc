//! Plies that are tied to each other in a scene: which nodes are, and that they stay where they were laid.

use crate::common::scenes::{ply, press};
use crate::common::{BuiltIn, fabric, form};
use plyflow_forming_explicit::{Forming, Outcome, Parameters, build_global, untied};
use plyflow_geometry::vec3::{Vec3, add, cross, dot, norm, scale, sub};
use plyflow_mechanics::contact::{SheetContact, Tie, shape};
use serde_json::json;

/// A stroke of 12 mm on two plies whose fibres cross at 45 degrees, the inner one of 120 mm.
fn two(outer: f64, tied: bool) -> Parameters {
    press(2, &json!({"gap": "0.003 m"}), |p| {
        let scene = &mut p["scene"];
        scene["tool"]["hemisphere"]["facet_size"] = json!("0.004 m");
        scene["sheets"] = json!([
            ply("inner", &fabric(), [0.12, 0.12], 0.0),
            ply(
                "outer",
                &fabric(),
                [outer, outer],
                std::f64::consts::FRAC_PI_4
            ),
        ]);
        if tied {
            scene["sheets"][1]["tied"] = json!(true);
        }
        // So little that they slide where they may.
        scene["friction"] = json!({"tool_fabric": 0.1, "fabric_fabric": 0.02});
        let press = &mut scene["process"]["press"];
        press["stroke"] = json!("0.012 m");
        press["forming_time"] = json!("0.05 s");
        press["settling_time"] = json!("0.002 s");
        p["element_size"] = json!(0.008);
        p["tool_grid"] = json!(0.004);
        p["frames"] = json!(2);
        p["time_step"] = json!(3e-6);
    })
}

fn between(forming: &Forming) -> &SheetContact {
    let mut all = forming.model.sheet_contacts().iter();
    all.find(|c| c.name == "inner/outer").expect("the pair")
}

#[test]
fn a_ply_that_lies_beside_the_one_that_it_is_tied_to_is_told() {
    let mut p = two(0.04, true);
    p.scene.sheets[0].length = Some("0.04 m".parse().unwrap());
    p.scene.sheets[1].centre[0] = "0.05 m".parse().unwrap();
    let forming = build_global(&p, &BuiltIn).unwrap();
    assert!(between(&forming).ties.items.is_empty());
    let told = untied(&forming);
    assert!(
        told.len() == 1 && told[0].contains("'outer' is tied to 'inner'"),
        "{told:?}"
    );
    assert!(untied(&build_global(&two(0.096, true), &BuiltIn).unwrap()).is_empty());
}

/// How far (m) a node has slid along its cell from where it was laid over it.
fn slid(forming: &Forming, tie: &Tie) -> f64 {
    let x = forming.model.x();
    let corners = forming.model.cells()[tie.cell as usize].map(|n| x[n as usize]);
    let weights = shape(tie.xi);
    let place = (0..4).fold([0.0; 3], |sum, k| add(sum, scale(corners[k], weights[k])));
    let area: Vec3 = cross(sub(corners[2], corners[0]), sub(corners[3], corners[1]));
    let normal = scale(area, 1.0 / norm(area));
    let arm = sub(x[tie.node as usize], place);
    norm(sub(arm, scale(normal, dot(arm, normal))))
}

#[test]
fn nodes_over_the_ply_below_are_tied_and_those_beside_it_are_not() {
    for (outer, all) in [(0.096, true), (0.152, false)] {
        let forming = build_global(&two(outer, true), &BuiltIn).unwrap();
        let contact = between(&forming);
        let tied: Vec<u32> = contact.ties.items.iter().map(|t| t.node).collect();
        let start = forming.model.start();
        for item in &contact.items {
            let [x, y, _] = start[item.node as usize];
            let over = x.abs() <= 0.06 + 1e-9 && y.abs() <= 0.06 + 1e-9;
            assert_eq!(tied.contains(&item.node), over, "({x}, {y})");
        }
        assert_eq!(tied.len() == contact.items.len(), all);
        assert!(contact.ties.items.iter().all(|t| t.stiffness > 0.0));
    }
    let free = build_global(&two(0.096, false), &BuiltIn).unwrap();
    assert!(between(&free).ties.items.is_empty());
}

#[test]
fn tied_plies_neither_slide_on_each_other_nor_come_off_where_loose_ones_do() {
    let (tied, outcome) = form(&two(0.096, true), 2);
    let ties = &between(&tied).ties;
    let (loose, other) = form(&two(0.096, false), 2);
    let most = |forming: &Forming| {
        let all = ties.items.iter().map(|t| slid(forming, t));
        all.fold(0.0, f64::max)
    };
    let (held, free) = (most(&tied), most(&loose));
    println!(
        "slid {held:.2e} m, loose {free:.2e} m; ties give way by {:.2e} m",
        ties.stretch()
    );
    // An element is 8 mm long.
    assert!(held < 0.05 * 8e-3, "{held} m");
    assert!(free > 5.0 * held, "{free} and {held} m");
    assert!((ties.stretch() / held - 1.0).abs() < 0.01 && ties.stretch_share() < 0.1);
    // What ties store and lose is in the balance.
    let drift = |o: &Outcome| {
        let ledger = o.history.last().unwrap().ledger;
        ledger.drift().abs() / ledger.external
    };
    let [with, without] = [drift(&outcome), drift(&other)];
    assert!(
        with < without + 0.002,
        "{with} of the work is unaccounted for, without ties {without}"
    );
}
