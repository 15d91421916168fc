//! Writes a field with a NaN and does not heed the refusal.

use plyflow_sdk::{Host, On, Step, StepError, export_step};

struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = r#"{
        "name": "nan-field", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "step", "role": "test",
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
        let _ = host.write_field(
            "ply",
            On::Points,
            "temperature",
            1,
            "K",
            &[1.0, f64::NAN, 2.0],
        );
        host.end_frame()
    }
}

export_step!(Plugin);
