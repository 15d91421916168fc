//! Reads what `mesh` wrote and reports what it saw.

use plyflow_sdk::{Host, Step, StepError, export_step};

struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = r#"{
        "name": "mesh-reader", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "step", "role": "test",
        "summary": "A test plugin.",
        "parameters": {},
        "inputs": {"formed": {"kind": "forming", "doc": "What mesh wrote."}},
        "output": {"kind": "test"},
        "results": {}
    }"#;

    fn run(host: &Host) -> Result<(), StepError> {
        let input = host.input("formed")?;
        let meshes = host.meshes(&input)?;
        let ply = meshes.body("ply")?;
        let (reference, cells) = host.mesh(&input, ply)?;
        let last = meshes.times.len() - 1;
        let points = host.frame_points(&input, ply, last)?;
        let angle = host.frame_field(&input, ply, last, "shear_angle")?;
        let (history, shape) = host.array_f64(&input, "history/time")?;
        host.result("reference_z", reference[0][2], "m")?;
        host.result("cells", (cells.len() / ply.nodes_per_cell) as f64, "1")?;
        host.result("z", points[0][2], "m")?;
        host.result("last_angle", *angle.last().unwrap_or(&0.0), "rad")?;
        host.result("history", history[3] + shape.len() as f64, "s")?;
        host.result("time", meshes.times[last], "s")
    }
}

export_step!(Plugin);
