//! Bodies that contradict themselves: the host in memory refuses them, as it knows only how much room the step has made by what it told of them.

use plyflow_sdk::{Host, Step, StepError};
use plyflow_testing::{MemoryArtifact, MemoryBody, MemoryInput, run};
use serde_json::json;

/// Reads the mesh of `ply` and its points in the first frame.
struct Reads;

impl Step for Reads {
    const MANIFEST: &'static str = r#"{
        "name": "reads", "version": "0.1.0", "vendor": "Plyflow", "kind": "step", "role": "example", "summary": "Reads.",
        "parameters": {}, "inputs": {"in": {"kind": "example"}}, "output": {"kind": "example"}, "results": {}
    }"#;

    fn run(host: &Host) -> Result<(), StepError> {
        let input = host.input("in")?;
        let meshes = host.meshes(&input)?;
        let ply = meshes.body("ply")?;
        host.mesh(&input, ply)?;
        host.frame_points(&input, ply, 0)?;
        Ok(())
    }
}

/// One quad that does not move, changed by `slip`.
fn read(slip: impl FnOnce(&mut MemoryBody)) -> Result<MemoryArtifact, String> {
    let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let mut body = MemoryBody {
        name: "ply".into(),
        frames: vec![points.clone()],
        points,
        nodes_per_cell: 4,
        cells: vec![0, 1, 2, 3],
        ..Default::default()
    };
    slip(&mut body);
    let artifact = MemoryArtifact {
        kind: "example".into(),
        times: vec![0.0],
        bodies: vec![body],
        ..Default::default()
    };
    run::<Reads>(json!({}), &[MemoryInput::new("in", &artifact)], &[])
}

#[test]
fn a_frame_with_other_points_than_its_body_is_refused_and_written_nowhere() {
    assert!(read(|_| {}).is_ok());
    for points in [3, 5, 4096] {
        let error = read(|b| b.frames[0] = vec![[7.0; 3]; points]).unwrap_err();
        assert!(error.contains("the sizes do not match"), "{error}");
    }
}

#[test]
fn cells_that_are_not_whole_are_refused_and_written_nowhere() {
    for nodes in [5, 7] {
        let error = read(|b| b.cells = vec![0; nodes]).unwrap_err();
        assert!(error.contains("the sizes do not match"), "{error}");
    }
}
