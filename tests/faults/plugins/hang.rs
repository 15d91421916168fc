//! Never ends and never asks whether it should.

use plyflow_sdk::{Host, Log, Step, StepError, export_step};

struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = r#"{
        "name": "hang", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "step", "role": "test",
        "summary": "A test plugin.",
        "parameters": {},
        "inputs": {},
        "output": {"kind": "test"},
        "results": {}
    }"#;

    fn run(host: &Host) -> Result<(), StepError> {
        host.log(Log::Info, "hanging");
        loop {
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
    }
}

export_step!(Plugin);
