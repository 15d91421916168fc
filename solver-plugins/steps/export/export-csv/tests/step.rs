//! Two small bodies as CSV.

use plyflow_export_csv::ExportCsv;
use plyflow_model::artifact::Export;
use plyflow_sdk::On;
use plyflow_testing::{MemoryArtifact, MemoryBody, MemoryField, MemoryInput, flat_grid, run};
use serde_json::{Value, json};

fn field(name: &str, on: On, components: u32, values: &[f64]) -> MemoryField {
    MemoryField {
        name: name.into(),
        on,
        components,
        values: values.to_vec(),
    }
}

/// One cell of 0.1 m in two frames, the second 0.25 m higher.
fn body(name: &str) -> MemoryBody {
    let (points, cells) = flat_grid([0.0, 0.0, 0.1, 0.1], 0.1, 0.0);
    let lifted = points.iter().map(|p| [p[0], p[1], p[2] + 0.25]).collect();
    let fields = |g: f64| {
        vec![
            field("height", On::Points, 1, &[g, 2.0 * g, 3.0 * g, 4.0 * g]),
            field("stress", On::Cells, 2, &[g, -g]),
        ]
    };
    MemoryBody {
        name: name.into(),
        frames: vec![points.clone(), lifted],
        points,
        nodes_per_cell: 4,
        cells,
        fields: vec![fields(1.0), fields(0.1)],
        attributes: Value::Null,
    }
}

fn export(with: Value) -> Result<(MemoryArtifact, Export), String> {
    let artifact = MemoryArtifact {
        kind: "forming".into(),
        times: vec![0.0, 0.5],
        bodies: vec![body("ply_1"), body("upper film/2")],
        ..MemoryArtifact::default()
    };
    let found = run::<ExportCsv>(with, &[MemoryInput::new("of", &artifact)], &[])?;
    let export = serde_json::from_value(found.attributes.clone()).map_err(|e| e.to_string())?;
    Ok((found, export))
}

#[test]
fn the_last_frame_is_written_with_every_digit() {
    let (artifact, export) = export(json!({})).unwrap();
    let names: Vec<&str> = export.files.iter().map(|f| f.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "ply_1-points.csv",
            "ply_1-cells.csv",
            "upper_film_2-points.csv",
            "upper_film_2-cells.csv"
        ]
    );
    assert_eq!(
        export.files[0].text.as_deref().unwrap(),
        "node,x (m),y (m),z (m),height\n0,0,0,0.25,0.1\n1,0.1,0,0.25,0.2\n2,0,0.1,0.25,0.30000000000000004\n3,0.1,0.1,0.25,0.4\n"
    );
    assert_eq!(
        export.files[1].text.as_deref().unwrap(),
        "cell,node_1,node_2,node_3,node_4,stress_1,stress_2\n0,0,1,3,2,0.1,-0.1\n"
    );
    assert_eq!(
        [
            artifact.result("time"),
            artifact.result("points"),
            artifact.result("cells")
        ],
        [0.5, 8.0, 2.0]
    );
}

#[test]
fn a_frame_and_bodies_can_be_chosen() {
    let (artifact, export) = export(json!({"time": 0.2, "bodies": ["ply_1"]})).unwrap();
    assert_eq!(export.files.len(), 2);
    assert!(
        export.files[0]
            .text
            .as_ref()
            .unwrap()
            .contains("\n3,0.1,0.1,0,4\n")
    );
    assert_eq!(artifact.result("time"), 0.0);
}

#[test]
fn a_body_that_is_not_there_is_refused_with_those_that_are() {
    let error = export(json!({"bodies": ["ply_3"]})).err().unwrap();
    assert!(
        error.contains("ply_3") && error.contains("ply_1"),
        "{error}"
    );
}

#[test]
fn an_artifact_without_frames_is_refused_with_its_step() {
    let empty = MemoryArtifact::default();
    let error = run::<ExportCsv>(json!({}), &[MemoryInput::new("of", &empty)], &[])
        .err()
        .unwrap();
    assert!(error.contains("'of' has no mesh"), "{error}");
}
