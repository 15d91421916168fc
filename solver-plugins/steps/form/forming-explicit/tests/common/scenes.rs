//! The scenes of the tests: a small press and a small bag, each of which a test changes to what it is about.

use super::{fabric, woven};
use plyflow_forming_explicit::Parameters;
use serde_json::{Value, json};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

/// The film of a diaphragm.
pub fn film() -> Value {
    json!({
        "plyflow_material": 1, "name": "film", "plugin": "material-marlow",
        "thickness": "8e-05 m", "areal_mass": "0.08 kg/m2",
        "with": {"uniaxial": {"amplitude": 6.364e6, "growth": 0.4451, "decay": 7.545}, "limit": 5.0}
    })
}

/// A sheet of that film.
pub fn diaphragm(name: &str) -> Value {
    json!({"name": name, "kind": "diaphragm", "material": film()})
}

/// A rectangular ply (m) of this material with fibres at `fibre_1` (rad) and across.
pub fn ply(name: &str, material: &Value, [length, width]: [f64; 2], fibre_1: f64) -> Value {
    json!({"name": name, "kind": "ply", "material": material,
           "length": format!("{length} m"), "width": format!("{width} m"),
           "fibre_1": format!("{fibre_1} rad"), "fibre_2": format!("{} rad", fibre_1 + FRAC_PI_2)})
}

/// Plies of the non-crimp fabric with fibres at -45 and 45 degrees: `ply_1`, `ply_2` ..
pub fn plies(count: usize, size: [f64; 2]) -> Vec<Value> {
    let one = |k: usize| ply(&format!("ply_{k}"), &fabric(), size, -FRAC_PI_4);
    (1..=count).map(one).collect()
}

/// What keeps membranes of one point from their hourglass modes, with at least `floor` (N/m) of stiffness.
pub fn hourglass(floor: f64) -> Value {
    json!({"hourglass": 1.0, "hourglass_floor": floor, "hourglass_normal": 0.01})
}

/// Plies through a hole of 27 mm radius over a hemisphere of 25 mm, 20 mm deep, with this `hold` of the holder (null: none);
/// `change` has the last word.
pub fn press(count: usize, hold: &Value, change: impl FnOnce(&mut Value)) -> Parameters {
    let mut press = json!({
        "stroke": "0.02 m", "forming_time": "0.2 s", "settling_time": "0.01 s",
        "die": {"opening_radius": "0.027 m", "edge_radius": "0.004 m"}});
    if !hold.is_null() {
        press["holder"] = json!({"hold": hold});
    }
    let mut all = json!({
        "scene": {
            "plyflow_scene": 1, "name": "dome",
            "tool": {"hemisphere": {"radius": "0.025 m", "facet_size": "0.001 m"}},
            "sheets": plies(count, [0.12, 0.12]),
            "friction": {"tool_fabric": 0.23, "fabric_fabric": 0.36},
            "process": {"press": press}
        },
        "element": {"plugin": "m4", "with": hourglass(300.0)},
        "diaphragm_element": {"plugin": "m4", "with": {}},
        "element_size": 0.006, "diaphragm_growth": 1.25, "time_step": 8e-6, "step_safety": 0.8,
        "least_areal_mass": 2.0, "damping": 50.0, "contact_stiffness": 0.3, "slip_stiffness": 0.5,
        "contact_damping": 0.3, "contact_augmentation": 0.0, "frames": 20, "tool_grid": 0.0015,
        "kinetic_bound": 0.05, "drift_bound": 0.5
    });
    change(&mut all);
    serde_json::from_value(all).expect("the parameters fit their type")
}

/// Plies between two films over a rounded block 20 mm high; `change` has the last word.
pub fn bag(count: usize, change: impl FnOnce(&mut Value)) -> Parameters {
    let mut sheets = plies(count, [0.12, 0.08]);
    sheets.insert(0, diaphragm("lower"));
    sheets.push(diaphragm("upper"));
    let mut all = json!({
        "scene": {
            "plyflow_scene": 1, "name": "block",
            "tool": {"flat": {"length": "0.1 m", "width": "0.06 m", "height": "0.02 m",
                              "fillet": "0.012 m", "facet_size": "0.008 m"}},
            "sheets": sheets,
            "friction": {"tool_diaphragm": 0.5, "fabric_diaphragm": 0.4, "fabric_fabric": 0.35,
                         "diaphragm_diaphragm": 0.3},
            "process": {"double_diaphragm": {
                "frame_length": "0.4 m", "frame_width": "0.34 m", "clearance": "0.005 m",
                "bag_pressure": "100000 Pa", "forming_pressure": "100000 Pa",
                "bagging_time": "0.08 s", "lowering_time": "0.1 s", "drawing_time": "0.12 s",
                "settling_time": "0.03 s", "film_pre_stretch": 0.01,
                "film_joint_margin": "0.03 m"}}
        },
        "element": {"plugin": "m4", "with": hourglass(3000.0)},
        "diaphragm_element": {"plugin": "m4", "with": hourglass(3000.0)},
        "element_size": 0.007, "diaphragm_growth": 1.25, "time_step": 1.2e-5, "step_safety": 0.8,
        "least_areal_mass": 2.0, "damping": 50.0, "contact_stiffness": 0.3, "slip_stiffness": 0.5,
        "contact_damping": 0.3, "contact_augmentation": 0.003, "frames": 40, "tool_grid": 0.003,
        "kinetic_bound": 0.05, "drift_bound": 0.5
    });
    change(&mut all);
    serde_json::from_value(all).expect("the parameters fit their type")
}

/// Plies on a rounded block 20 mm high under one film; `change` has the last word.
pub fn single(count: usize, change: impl FnOnce(&mut Value)) -> Parameters {
    bag(count, |p| {
        let scene = &mut p["scene"];
        let sheets = scene["sheets"].as_array_mut().expect("a list");
        sheets.remove(0);
        scene["friction"] = json!({"tool_diaphragm": 0.5, "tool_fabric": 0.23, "fabric_diaphragm": 0.4, "fabric_fabric": 0.35});
        scene["process"] = json!({"single_diaphragm": {
            "frame_length": "0.4 m", "frame_width": "0.34 m", "clearance": "0.005 m", "forming_pressure": "100000 Pa",
            "stretching_time": "0.02 s", "lowering_time": "0.1 s", "drawing_time": "0.12 s", "settling_time": "0.03 s",
            "film_pre_stretch": 0.01}});
        change(p);
    })
}

/// The beginning of a press stroke on a woven ply over a small dome: fibre family 1 at `fibre_1` (rad).
pub fn gentle_press(element: &str, fibre_1: f64, symmetry: &[&str]) -> Parameters {
    press(1, &json!({"force": "100 N"}), |p| {
        let scene = &mut p["scene"];
        scene["sheets"] = json!([ply("ply_1", &woven(), [0.12, 0.096], fibre_1)]);
        scene["friction"] = json!({"tool_fabric": 0.23});
        let press = &mut scene["process"]["press"];
        press["stroke"] = json!("0.012 m");
        press["forming_time"] = json!("0.06 s");
        press["settling_time"] = json!("0.002 s");
        scene["symmetry"] = json!(symmetry);
        p["element"]["plugin"] = json!(element);
        if element == "s4" {
            p["element"]["with"] = json!({});
        }
        p["frames"] = json!(4);
        // The grid of the tool's distances is its own mirror image.
        p["tool_grid"] = json!(0.00175);
    })
}

/// The text of an STL file of blocks with these corners.
pub fn blocks(all: &[([f64; 3], [f64; 3])]) -> String {
    // Counter-clockwise from outside.
    let sides = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let mut text = String::from("solid blocks\n");
    for (low, high) in all {
        let corner = |k: usize| [0, 1, 2].map(|d| if k >> d & 1 == 1 { high[d] } else { low[d] });
        for [a, b, c, d] in sides {
            for facet in [[a, b, c], [a, c, d]] {
                text += "facet normal 0 0 0\nouter loop\n";
                for [x, y, z] in facet.map(corner) {
                    text += &format!("vertex {x} {y} {z}\n");
                }
                text += "endloop\nendfacet\n";
            }
        }
    }
    text + "endsolid blocks\n"
}
