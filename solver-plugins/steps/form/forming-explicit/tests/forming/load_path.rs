//! What presses on an evacuated stack reaches the tool through every sheet of it.
//!
//! The plies' own nodes are held by the tool as well, for where the chords of a coarser film cut through its fillets. Held at the full
//! thickness of what lies below, they took up to four fifths of the load past the film, without its friction: the finer the
//! plies, the more, so that the whole stack slid further the finer it was meshed.

use crate::common::form;
use crate::common::scenes::bag;
use plyflow_forming_explicit::{Forming, Parameters};
use serde_json::json;

/// Pressure (Pa) on both sides of the stack at the end.
const PRESSURE: f64 = 1e5;

/// Two plies of elements of 5 mm between films of 10 mm, drawn down onto a flat block.
fn parameters() -> Parameters {
    bag(2, |p| {
        p["scene"]["tool"] = json!({"flat": {"length": "0.2 m", "width": "0.16 m", "height": "0.02 m",
                                             "fillet": "0.01 m", "facet_size": "0.004 m"}});
        let process = &mut p["scene"]["process"]["double_diaphragm"];
        process["drawing_time"] = json!("0.15 s");
        process["settling_time"] = json!("0.04 s");
        p["element_size"] = json!(0.005);
        p["diaphragm_element_size"] = json!(0.01);
        p["time_step"] = json!(8e-6);
        p["damping"] = json!(30.0);
        p["frames"] = json!(1);
    })
}

/// Force (N) with which the tool holds the nodes of a sheet that lie within 50 mm of the middle along x and 30 mm along y.
fn held_in_the_middle(forming: &Forming, sheet: &str) -> f64 {
    let model = &forming.model;
    let name = format!("tool/{sheet}");
    let contact = model.rigid_contacts().iter().find(|c| c.name == name);
    let middle = |n: u32| {
        let x = model.x()[n as usize];
        x[0].abs() < 0.05 && x[1].abs() < 0.03
    };
    let items = contact.unwrap_or_else(|| panic!("no {name}")).items.iter();
    items
        .filter(|i| middle(i.node))
        .map(|i| f64::from(i.normal_force))
        .sum()
}

#[test]
fn the_pressure_on_the_bag_reaches_the_tool_through_the_lower_film() {
    let (forming, outcome) = form(&parameters(), 1);
    assert!(
        outcome.health.peak_drift_ratio < 0.05,
        "{:?}",
        outcome.health
    );
    let film = held_in_the_middle(&forming, "lower");
    // 9 x 5 nodes, 10 mm apart before the frame stretched the films by a hundredth.
    let expected = 45.0 * 0.0101f64.powi(2) * PRESSURE;
    assert!(
        (film / expected - 1.0).abs() < 5e-3,
        "{film} N, expected {expected} N"
    );
    for ply in ["ply_1", "ply_2"] {
        let past = held_in_the_middle(&forming, ply);
        assert!(past < 1e-3 * expected, "{ply}: {past} N of {expected} N");
    }
}
