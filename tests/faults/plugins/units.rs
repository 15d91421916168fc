//! Writes numbers in the units that it is told, and does not heed a refusal.

use plyflow_sdk::{Host, On, Step, StepError, export_step};

struct Plugin;

#[derive(serde::Deserialize)]
struct Parameters {
    what: String,
    unit: String,
}

impl Step for Plugin {
    const MANIFEST: &'static str = r#"{
        "name": "units", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "step", "role": "test",
        "summary": "A test plugin.",
        "parameters": {"what": {"type": "string", "required": true, "doc": "Name of a result, `array` or `field`."},
                       "unit": {"type": "string", "required": true, "doc": "The unit to write it in."}},
        "inputs": {},
        "output": {"kind": "test"},
        "results": {"length": {"unit": "m", "doc": "A length."}, "share": {"doc": "A share."},
                    "seconds": {"unit": "s", "doc": "How long it took.", "measured": true}}
    }"#;

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        let _ = match p.what.as_str() {
            "array" => host.write_f64("lengths", &[1], &p.unit, &[2.0]),
            "field" => {
                let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
                host.define_mesh("ply", &points, 3, &[0, 1, 2], &serde_json::json!({}))?;
                host.begin_frame(0.0)?;
                let _ = host.write_field("ply", On::Points, "way", 1, &p.unit, &[1.0, 2.0, 3.0]);
                host.end_frame()
            }
            // Without the flag of a measured result: the manifest knows.
            name => host.result(name, 2.0, &p.unit),
        };
        Ok(())
    }
}

export_step!(Plugin);
