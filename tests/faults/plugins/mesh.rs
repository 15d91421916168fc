//! Writes two bodies over some frames, an array and a scratch file.

use plyflow_sdk::{Host, On, Step, StepError, export_step};

#[derive(serde::Deserialize)]
struct Parameters {
    points: usize,
    frames: usize,
}

struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = r#"{
        "name": "mesh", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "step", "role": "test",
        "summary": "A test plugin.",
        "parameters": {"points": {"type": "integer", "default": 8, "minimum": 4, "doc": "Points of the ply."}, "frames": {"type": "integer", "default": 3, "minimum": 0, "doc": "Frames."}},
        "inputs": {"in": {"kind": "any", "required": false, "many": true, "doc": "Anything."}},
        "output": {"kind": "forming"},
        "results": {}
    }"#;

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        let n = p.points;
        let flat: Vec<[f64; 3]> = (0..n).map(|i| [i as f64 * 0.1, 0.0, 0.0]).collect();
        let cells: Vec<u32> = (0..n as u32 - 3)
            .flat_map(|i| [i, i + 1, i + 2, i + 3])
            .collect();
        host.define_mesh("tool", &flat[..3], 3, &[0, 1, 2], &serde_json::json!({}))?;
        host.define_mesh(
            "ply",
            &flat,
            4,
            &cells,
            &serde_json::json!({"thickness": 0.001}),
        )?;
        std::fs::write(format!("{}/note", host.scratch()), "x")?;
        for f in 0..p.frames {
            host.begin_frame(f as f64 * 0.5)?;
            let z = f as f64 * 0.01;
            let points: Vec<[f64; 3]> = flat.iter().map(|p| [p[0], p[1], z]).collect();
            host.write_points("ply", &points)?;
            let angle: Vec<f64> = (0..n - 3).map(|i| (i as f64 + f as f64) * 0.25).collect();
            host.write_field("ply", On::Cells, "shear_angle", 1, "rad", &angle)?;
            host.end_frame()?;
        }
        host.write_f64("history/time", &[2, 2], "s", &[0.0, 1.0, 2.0, 3.0])?;
        host.write_attributes(&serde_json::json!({"threads": host.threads() > 0}))
    }
}

export_step!(Plugin);
