//! Leaves a frame open.

use plyflow_sdk::{Host, Step, StepError, export_step};

struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = r#"{
        "name": "open-frame", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "step", "role": "test",
        "summary": "A test plugin.",
        "parameters": {},
        "inputs": {},
        "output": {"kind": "forming"},
        "results": {}
    }"#;

    fn run(host: &Host) -> Result<(), StepError> {
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        host.define_mesh("ply", &points, 3, &[0, 1, 2], &serde_json::json!({}))?;
        host.begin_frame(0.0)?;
        Ok(())
    }
}

export_step!(Plugin);
