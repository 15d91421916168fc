//! Writes a field after the frame ended and does not heed the refusal.

use plyflow_sdk::{Host, On, Step, StepError, export_step};

struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = r#"{
        "name": "writes-after-frame", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "step", "role": "test",
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
        host.end_frame()?;
        let _ = host.write_field("ply", On::Points, "temperature", 1, "K", &[1.0, 2.0, 3.0]);
        Ok(())
    }
}

export_step!(Plugin);
