//! Runs that would end well and mean nothing: refused with what to do.

use crate::common::BuiltIn;
use crate::common::scenes::{bag, gentle_press, press};
use plyflow_forming_explicit::{
    Feedback, FormingError, LocalSheet, Parameters, Watch, Watched,
    absurd::{check, off_the_tool},
    at_the_start, build_global, feed_back,
};
use serde_json::{Value, json};

fn judged(p: &Parameters) -> Result<(), FormingError> {
    check(p, &build_global(p, &BuiltIn)?)
}

fn in_bag(name: &str, value: Value) -> Parameters {
    bag(1, |p| {
        p["scene"]["process"]["double_diaphragm"][name] = value
    })
}

fn assert_told(p: &Parameters, parts: &[&str]) {
    let text = judged(p).expect_err("refused").to_string();
    for part in parts {
        assert!(text.contains(part), "'{part}' in: {text}");
    }
}

#[test]
fn the_scenes_of_the_other_tests_make_sense() {
    let gap = json!({"gap": "0.003 m"});
    for p in [
        bag(2, |_| {}),
        press(2, &gap, |_| {}),
        gentle_press("m4", 0.0, &["x", "y"]),
    ] {
        judged(&p).unwrap();
    }
}

#[test]
fn a_material_with_the_density_of_nothing_is_told_of_once() {
    let told = |mass: &str| {
        let p = press(2, &json!({"gap": "0.003 m"}), |p| {
            for sheet in p["scene"]["sheets"].as_array_mut().unwrap() {
                sheet["material"]["areal_mass"] = json!(mass);
            }
        });
        let forming = build_global(&p, &BuiltIn).unwrap();
        let all =
            at_the_start(&forming).filter(|t| t.contains("look at the units of `areal_mass`"));
        all.collect::<Vec<_>>()
    };
    for (mass, says) in [
        ("440 kg/m2", "440 kg/m2 at a thickness of"),
        ("0.00044 kg/m2", "0.00044 kg/m2"),
    ] {
        let all = told(mass);
        assert!(all.len() == 1 && all[0].contains(says), "{all:?}");
    }
    assert_eq!(told("0.44 kg/m2"), Vec::<String>::new());
}

#[test]
fn phases_shorter_than_a_wave_and_steps_as_long_as_the_process_are_refused() {
    for phase in ["bagging_time", "lowering_time", "drawing_time"] {
        assert_told(
            &in_bag(phase, json!("1 us")),
            &[phase, "1.000e-6 s", "at least"],
        );
    }
    let p = bag(1, |p| {
        p["time_step"] = json!(1.0);
        for phase in [
            "bagging_time",
            "lowering_time",
            "drawing_time",
            "settling_time",
        ] {
            p["scene"]["process"]["double_diaphragm"][phase] = json!("1 us");
        }
    });
    assert_told(&p, &["bagging_time", "`time_step`"]);
    let p = press(1, &json!({"gap": "0.003 m"}), |p| {
        p["scene"]["process"]["press"]["forming_time"] = json!("10 us");
    });
    assert_told(&p, &["forming_time", "at least"]);
}

#[test]
fn sheets_with_a_thousand_times_their_mass_are_refused() {
    assert_told(
        &bag(1, |p| p["least_areal_mass"] = json!(5000.0)),
        &["least_areal_mass", "their own mass"],
    );
    assert_told(&bag(1, |p| p["time_step"] = json!(0.001)), &["time_step"]);
}

#[test]
fn a_process_without_pressure_and_damping_that_holds_the_sheets_up_are_refused() {
    assert_told(
        &in_bag("forming_pressure", json!("0 Pa")),
        &["forming_pressure", "nothing is formed"],
    );
    assert_told(
        &bag(1, |p| p["damping"] = json!(1e6)),
        &["damping: given 1.000e6", "or less"],
    );
}

#[test]
fn a_ply_beside_the_tool_one_within_the_opening_and_one_of_a_single_element_are_refused() {
    let beside = bag(1, |p| {
        p["scene"]["sheets"][1]["centre"] = json!(["0.13 m", "0 m"]);
        p["scene"]["process"]["double_diaphragm"]["frame_length"] = json!("0.8 m");
    });
    assert_told(
        &beside,
        &["ply 'ply_1'", "no part of it lies over the tool"],
    );
    let small = press(1, &json!({"gap": "0.003 m"}), |p| {
        let ply = &mut p["scene"]["sheets"][0];
        (ply["length"], ply["width"]) = (json!("0.03 m"), json!("0.03 m"));
    });
    assert_told(&small, &["never touch the die"]);
    let coarse = press(1, &json!({"gap": "0.003 m"}), |p| {
        p["element_size"] = json!(0.07)
    });
    assert_told(
        &coarse,
        &["element_size: given 70.000 mm", "60.000 mm or less"],
    );
}

#[test]
fn a_ply_that_ends_off_the_tool_is_no_result() {
    let forming = build_global(&bag(1, |_| {}), &BuiltIn).unwrap();
    let (mut watch, mut watched) = (Watch::new(&forming), Watched::default());
    watch.look(&forming, &mut watched, true);
    let told = off_the_tool(&forming, &watch).expect("it hangs over the tool");
    for part in ["ply 'ply_1' is nowhere on the tool", "5.0 mm away"] {
        assert!(told.contains(part), "'{part}' in: {told}");
    }
}

#[test]
fn a_ply_that_is_driven_everywhere_is_not_told_to_be_off_the_tool() {
    let mut forming = build_global(&bag(1, |_| {}), &BuiltIn).unwrap();
    let body = forming.bodies.iter().find(|b| b.name == "ply_1").unwrap();
    let points = forming.reference_points(body);
    let all: Vec<u32> = (0..points.len() as u32).collect();
    let sheet = LocalSheet {
        name: body.name.clone(),
        cells: body.cells.clone(),
        position: vec![points.clone(); 2],
        velocity: vec![vec![[0.0; 3]; points.len()]; 2],
        points,
        driven: all,
        normal: Vec::new(),
        normal_rate: Vec::new(),
        pull: Vec::new(),
        stiffness: Vec::new(),
        start: None,
    };
    let (time, sheets) = (vec![0.0, 1.0], vec![sheet]);
    feed_back(&mut forming, Feedback { time, sheets }).unwrap();
    let (mut watch, mut watched) = (Watch::new(&forming), Watched::default());
    watch.look(&forming, &mut watched, true);
    assert_eq!(off_the_tool(&forming, &watch), None);
}
