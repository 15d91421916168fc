//! Its manifest names a unit that there is not.

use plyflow_sdk::{Host, Step, StepError, export_step};

struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = r#"{
        "name": "unknown-unit", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "step", "role": "test",
        "summary": "A test plugin.",
        "parameters": {},
        "inputs": {},
        "output": {"kind": "test"},
        "results": {"torque": {"unit": "Nm", "doc": "There is `N m`."}}
    }"#;

    fn run(_: &Host) -> Result<(), StepError> {
        Ok(())
    }
}

export_step!(Plugin);
