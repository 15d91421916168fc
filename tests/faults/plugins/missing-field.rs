//! Leaves a field out of its second frame.

use plyflow_sdk::{Host, On, Step, StepError, export_step};

struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = r#"{
        "name": "missing-field", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "step", "role": "test",
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
        host.write_field("ply", On::Cells, "damage", 1, "1", &[0.5])?;
        host.end_frame()?;
        host.begin_frame(1.0)?;
        host.end_frame()
    }
}

export_step!(Plugin);
