//! What presses on an evacuated stack reaches the tool through every sheet of it.
//!
//! The plies' own nodes are held by the tool as well, for where the chords of a coarser film cut through its fillets. Held at the full
//! thickness of what lies below, they took up to four fifths of the load past the film, without its friction: the finer the
//! plies, the more, so that the whole stack slid further the finer it was meshed.

mod common;

use common::{fabric, form};
use plyflow_forming_explicit::parameters::Parameters;
use plyflow_forming_explicit::run::Forming;
use serde_json::json;

/// Pressure (Pa) on both sides of the stack at the end.
const PRESSURE: f64 = 1e5;

/// Two plies of elements of 5 mm between films of 10 mm, drawn down onto a flat block.
fn parameters() -> Parameters {
    let film = json!({
        "plyflow_material": 1, "name": "film", "plugin": "material-marlow",
        "thickness": "8e-05 m", "areal_mass": "0.08 kg/m2",
        "with": {"uniaxial": {"amplitude": 6.364e6, "growth": 0.4451, "decay": 7.545}, "limit": 5.0}
    });
    let diaphragm =
        |name: &str| json!({"name": name, "kind": "diaphragm", "material": film.clone()});
    let ply = |name: &str| {
        json!({"name": name, "kind": "ply", "material": fabric(), "length": "0.12 m", "width": "0.08 m",
               "fibre_1": "-0.7853981633974483 rad", "fibre_2": "0.7853981633974483 rad"})
    };
    let hourglass = json!({"hourglass": 1.0, "hourglass_floor": 3000.0, "hourglass_normal": 0.01});
    serde_json::from_value(json!({
        "scene": {
            "plyflow_scene": 1, "name": "block",
            "tool": {"flat": {"length": "0.2 m", "width": "0.16 m", "height": "0.02 m", "fillet": "0.01 m", "facet_size": "0.004 m"}},
            "sheets": [diaphragm("lower"), ply("ply_1"), ply("ply_2"), diaphragm("upper")],
            "friction": {"tool_diaphragm": 0.5, "fabric_diaphragm": 0.4, "fabric_fabric": 0.35,
                         "diaphragm_diaphragm": 0.3},
            "process": {"double_diaphragm": {
                "frame_length": "0.4 m", "frame_width": "0.34 m", "clearance": "0.005 m",
                "bag_pressure": "100000 Pa", "forming_pressure": "100000 Pa",
                "bagging_time": "0.08 s", "lowering_time": "0.1 s", "drawing_time": "0.15 s",
                "settling_time": "0.04 s", "film_pre_stretch": 0.01, "film_joint_margin": "0.03 m"}}
        },
        "element": {"plugin": "m4", "with": hourglass},
        "diaphragm_element": {"plugin": "m4", "with": hourglass},
        "element_size": 0.005, "diaphragm_element_size": 0.01, "diaphragm_growth": 1.25, "time_step": 8e-6, "step_safety": 0.8,
        "least_areal_mass": 2.0, "damping": 30.0, "contact_stiffness": 0.3, "slip_stiffness": 0.5,
        "contact_damping": 0.3, "contact_augmentation": 0.003, "frames": 1, "tool_grid": 0.003,
        "kinetic_bound": 0.05, "drift_bound": 0.5
    }))
    .expect("the parameters fit their type")
}

/// Force (N) with which the tool holds the nodes of a sheet that lie within 50 mm of the middle along x and 30 mm along y.
fn held_in_the_middle(forming: &Forming, sheet: &str) -> f64 {
    let model = &forming.model;
    let name = format!("tool/{sheet}");
    let contact = model.rigid_contacts.iter().find(|c| c.name == name);
    let middle = |n: u32| {
        let x = model.x[n as usize];
        x[0].abs() < 0.05 && x[1].abs() < 0.03
    };
    let items = contact.unwrap_or_else(|| panic!("no {name}")).items.iter();
    items
        .filter(|i| middle(i.node))
        .map(|i| i.normal_force)
        .sum()
}

#[test]
fn the_pressure_on_the_bag_reaches_the_tool_through_the_lower_film() {
    let (forming, outcome) = form(&parameters(), 2);
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
