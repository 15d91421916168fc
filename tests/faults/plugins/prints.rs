//! Prints to standard output, which belongs to the messages.

use plyflow_sdk::{Host, Step, StepError, export_step};

struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = r#"{
        "name": "prints", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "step", "role": "test",
        "summary": "A test plugin.",
        "parameters": {},
        "inputs": {},
        "output": {"kind": "test"},
        "results": {"value": {"unit": "1", "doc": "One."}}
    }"#;

    fn run(host: &Host) -> Result<(), StepError> {
        println!("{{\"event\": \"nonsense\"}}");
        host.result("value", 1.0, "1")
    }
}

export_step!(Plugin);
