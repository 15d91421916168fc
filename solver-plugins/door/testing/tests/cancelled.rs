//! How a step ends that is told to stop.

use plyflow_sdk::{Host, Step, StepError};
use plyflow_testing::{Machine, run_on};
use serde_json::json;

const MANIFEST: &str = r#"{
    "name": "stops", "version": "0.1.0", "vendor": "Plyflow", "kind": "step", "role": "example", "summary": "Stops.",
    "parameters": {}, "inputs": {}, "output": {"kind": "example"}, "results": {}
}"#;

/// An error of a plugin's own that wraps what the host said, as a `?` inside of the plugin makes it.
#[derive(Debug)]
struct Wrapped(StepError);

impl std::fmt::Display for Wrapped {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "on the way: {}", self.0.text())
    }
}

/// Wraps what the host said, and a `?` makes a text of that.
struct Wraps;

impl Step for Wraps {
    const MANIFEST: &'static str = MANIFEST;

    fn run(host: &Host) -> Result<(), StepError> {
        Ok(host.check_cancelled().map_err(Wrapped)?)
    }
}

/// Fails by itself, and never asks.
struct Fails;

impl Step for Fails {
    const MANIFEST: &'static str = MANIFEST;

    fn run(_: &Host) -> Result<(), StepError> {
        Err("no table".into())
    }
}

#[test]
fn a_step_that_was_told_to_stop_ends_as_cancelled_whatever_its_errors_make_of_that() {
    let stopped = Machine {
        cancelled: true,
        ..Default::default()
    };
    let end = |e: Result<_, String>| e.map(|_| ()).unwrap_err();
    let run = |machine: &Machine| run_on::<Wraps>(machine, json!({}), &[], &[]);
    assert_eq!(end(run(&stopped)), " (code 2)");
    assert!(run(&Machine::default()).is_ok());
    // What fails before it is told has failed.
    let failed = run_on::<Fails>(&stopped, json!({}), &[], &[]);
    assert_eq!(end(failed), "no table (code 1)");
}
