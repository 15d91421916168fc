//! Panics.

use plyflow_sdk::{Host, Step, StepError, export_step};

struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = r#"{
        "name": "panic", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "step", "role": "test",
        "summary": "A test plugin.",
        "parameters": {},
        "inputs": {},
        "output": {"kind": "test"},
        "results": {}
    }"#;

    fn run(host: &Host) -> Result<(), StepError> {
        let n: usize = host.threads() * 1000;
        let list = [1, 2, 3];
        host.result("never", f64::from(list[n]), "1")
    }
}

export_step!(Plugin);
