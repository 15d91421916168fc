//! Returns an error with a text.

use plyflow_sdk::{Host, Log, Step, StepError, export_step};

struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = r#"{
        "name": "error", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "step", "role": "test",
        "summary": "A test plugin.",
        "parameters": {},
        "inputs": {},
        "output": {"kind": "test"},
        "results": {}
    }"#;

    fn run(host: &Host) -> Result<(), StepError> {
        host.log(Log::Warn, "something is odd");
        Err("the tool has no surface: give it at least one triangle".into())
    }
}

export_step!(Plugin);
