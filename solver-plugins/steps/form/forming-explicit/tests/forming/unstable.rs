//! Runs made unstable on purpose: they stop with what it is, where and when, its likely cause and what to change, and up to then
//! no frame holds anything that is no number.

use crate::common::BuiltIn;
use crate::common::scenes::{bag, press};
use plyflow_forming_explicit::{Forming, Observer, Parameters, build_global};
use plyflow_kernels::m4::M4;
use plyflow_mechanics::component::element_fields;
use plyflow_mechanics::energy::Ledger;
use plyflow_sdk::{Element, StepError};
use serde_json::json;

/// Sees to it that all that would be written is a number.
#[derive(Default)]
struct Watch {
    frames: usize,
    ticks: usize,
}

fn assert_numbers(what: &str, time: f64, values: &[f64]) {
    let all = values.iter().all(|x| x.is_finite());
    assert!(all, "{what} at t = {time} s");
}

impl Observer for Watch {
    fn frame(&mut self, forming: &Forming, time: f64) -> Result<(), StepError> {
        self.frames += 1;
        let fields = element_fields(M4::MANIFEST);
        for body in &forming.bodies {
            assert_numbers("points", time, forming.points(body).as_flattened());
            assert_numbers("pressure", time, &forming.contact_pressure(body));
            for f in &fields {
                assert_numbers(&f.name, time, &forming.field(body, f, &fields));
            }
        }
        Ok(())
    }
    fn tick(&mut self, _: &Forming, e: &Ledger, end: f64) -> Result<(), StepError> {
        self.ticks += 1;
        assert_numbers("energies", end, &[e.kinetic, e.internal(), e.drift()]);
        Ok(())
    }
}

/// What a run ends with that stops before half of its process is over.
fn stopped(p: &Parameters) -> String {
    let mut forming = build_global(p, &BuiltIn).unwrap();
    let mut watch = Watch::default();
    let text = (forming.run(&p.control(), &mut watch))
        .unwrap_err()
        .to_string();
    assert!(watch.frames > 0 && watch.ticks > 0);
    assert!(
        forming.model.time() < 0.5 * forming.load.duration(),
        "{text}"
    );
    text
}

fn assert_says(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "'{part}' is not in: {text}");
    }
}

#[test]
fn a_step_above_the_critical_one_is_told_with_the_element_and_by_how_much() {
    // What the elements allow is a half of it: the first to be moved are those at the corners, which touch nothing.
    let text = stopped(&press(1, &json!({"gap": "0.002 m"}), |p| {
        p["step_safety"] = json!(2.0);
        p["time_step"] = json!(2e-5);
    }));
    assert_says(
        &text,
        &[
            "the run became unstable in cycle ",
            "of 'ply_1' at (",
            "seen at t = 0.000",
            " s of 0.21000 s (forming)",
            "The step is set by an element of 'ply_1' at (",
            " us (it is 20.000 us)",
            "Likely cause: a step above the critical one.",
            "What to try: smaller step_safety or time_step",
        ],
    );
}

#[test]
fn films_too_light_for_the_pressure_are_told_with_the_contact_that_they_break() {
    // The stiffness of a contact that a step bears goes with the masses: 25 times the mass carries the pressure (small_part.rs).
    let text = stopped(&bag(1, |p| {
        p["least_areal_mass"] = json!(0.0);
        p["element_size"] = json!(0.01);
        p["frames"] = json!(10);
    }));
    assert_says(
        &text,
        &[
            "'ply_1' has gone through 'lower' at (",
            "(bagging)",
            "larger `least_areal_mass`",
        ],
    );
}

#[test]
fn a_punch_that_is_too_fast_for_the_contact_is_told_with_it() {
    let text = stopped(&press(1, &json!({"gap": "0.002 m"}), |p| {
        p["scene"]["process"]["press"]["forming_time"] = json!("0.0005 s");
    }));
    assert_says(
        &text,
        &[
            "'ply_1' has gone through 'tool' at (",
            "(forming)",
            "longer process times",
        ],
    );
}
