//! What is written is read back, and the same calls make the same bytes.

use plyflow_artifact::{Artifact, ArtifactWriter, DType, ErrorKind, FieldInfo, On};
use serde_json::json;
use std::path::Path;

const FRAMES: u64 = 7;

fn bytes(v: &[f64]) -> Vec<u8> {
    v.iter().flat_map(|x| x.to_ne_bytes()).collect()
}

fn point(body: usize, frame: u64, i: usize) -> f64 {
    (body as f64 + 1.0) * 0.1 + frame as f64 * 1.7e-3 + i as f64 / 3.0
}

fn value(body: usize, frame: u64, i: usize) -> f64 {
    f64::from(((body * 1000 + i) as f32 + frame as f32 * 0.37) * 0.01)
}

/// Two moving bodies with fields of their own and a tool that stands still.
fn write(path: &Path) {
    let mut w = ArtifactWriter::create(path, "forming").unwrap();
    let tool: Vec<f64> = (0..15).map(|i| point(9, 0, i)).collect();
    w.define_mesh("tool", &tool, 3, &[0, 1, 2, 2, 3, 4], "")
        .unwrap();
    for (b, name) in ["ply_1", "film"].iter().enumerate() {
        let points: Vec<f64> = (0..18).map(|i| point(b, 99, i)).collect();
        w.define_mesh(
            name,
            &points,
            4,
            &[0, 1, 2, 3, 2, 3, 4, 5],
            r#"{"layer": 1}"#,
        )
        .unwrap();
    }
    for f in 0..FRAMES {
        w.begin_frame(f as f64 * 0.1).unwrap();
        for (b, name) in ["ply_1", "film"].iter().enumerate() {
            let points: Vec<f64> = (0..18).map(|i| point(b, f, i)).collect();
            w.frame_points(name, &points).unwrap();
            let values: Vec<f64> = (0..18).map(|i| value(b, f, i)).collect();
            w.frame_field(
                name,
                FieldInfo::new(On::Points, "contact_pressure", 1, "Pa"),
                &values[..6],
            )
            .unwrap();
            if b == 0 {
                w.frame_field(
                    name,
                    FieldInfo::new(On::Cells, "shear_angle", 1, "rad"),
                    &values[..2],
                )
                .unwrap();
                w.frame_field(
                    name,
                    FieldInfo::new(On::Points, "undeformed", 3, "m"),
                    &values,
                )
                .unwrap();
            }
        }
        w.end_frame().unwrap();
    }
    w.array(
        "history/time",
        DType::F64,
        &[3],
        "s",
        &bytes(&[0.0, 0.5, 1.0]),
    )
    .unwrap();
    w.array(
        "history/deep/x",
        DType::F64,
        &[1, 2],
        "m",
        &bytes(&[3.0, 4.0]),
    )
    .unwrap();
    w.array("count", DType::U32, &[], "1", &7u32.to_ne_bytes())
        .unwrap();
    w.array("empty", DType::F64, &[0, 3], "1", &[]).unwrap();
    w.attributes(r#"{"z": 1.5, "a": ["Å"]}"#).unwrap();
    w.result("peak", 0.25, "rad").unwrap();
    w.collection(vec!["A".into(), "B".into()]).unwrap();
    w.finish(&json!({"step": "coarse"})).unwrap();
}

#[test]
fn everything_reads_back_equal_after_writing() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.h5");
    write(&path);
    let a = Artifact::open(&path).unwrap();
    assert_eq!(a.kind(), "forming");
    let attributes: serde_json::Value = serde_json::from_str(a.attributes()).unwrap();
    assert_eq!(attributes, json!({"z": 1.5, "a": ["Å"]}));
    assert_eq!(a.collection().unwrap(), ["A", "B"]);
    assert_eq!(a.results()[0].value, 0.25);
    assert_eq!(a.provenance(), r#"{"step":"coarse"}"#);
    assert_eq!(a.times().len(), FRAMES as usize);
    assert_eq!(
        a.array_f64("history/time").unwrap(),
        (vec![0.0, 0.5, 1.0], vec![3])
    );
    assert_eq!(
        a.array_f64("history/deep/x").unwrap(),
        (vec![3.0, 4.0], vec![1, 2])
    );
    assert_eq!(
        a.array_f64("count").unwrap(),
        (vec![7.0], vec![]),
        "converted on reading"
    );
    assert_eq!(a.array_u32("empty").unwrap(), (vec![], vec![0, 3]));
    let (points, cells) = a.mesh("ply_1").unwrap();
    assert_eq!(points[1][0], point(0, 99, 3));
    assert_eq!(cells, [0, 1, 2, 3, 2, 3, 4, 5]);
    assert_eq!(a.body("film").unwrap().attributes["layer"], 1);
    for f in [0, 3, FRAMES - 1] {
        for (b, name) in ["ply_1", "film"].iter().enumerate() {
            let points = a.frame_points(name, f).unwrap();
            assert_eq!(points[5][2], point(b, f, 17), "doubles are kept bit by bit");
            let p = a
                .frame_field(name, f, On::Points, "contact_pressure")
                .unwrap();
            assert_eq!(p[5], value(b, f, 5));
        }
        assert_eq!(a.frame_points("tool", f).unwrap()[4][2], point(9, 0, 14));
        let u = a.frame_field("ply_1", f, On::Points, "undeformed").unwrap();
        assert_eq!(u[17], value(0, f, 17));
    }
}

#[test]
fn bytes_are_equal_when_written_twice() {
    let dir = tempfile::tempdir().unwrap();
    let (a, b) = (dir.path().join("a.h5"), dir.path().join("another-name.h5"));
    write(&a);
    // HDF5 keeps times in seconds: a second file in another second must not differ.
    std::thread::sleep(std::time::Duration::from_millis(1100));
    write(&b);
    assert_eq!(std::fs::read(a).unwrap(), std::fs::read(b).unwrap());
}

#[test]
fn long_texts_are_kept_beyond_the_limit_of_compact_attributes() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.h5");
    let long = "x".repeat(300_000);
    let mut w = ArtifactWriter::create(&path, "zones").unwrap();
    w.attributes(&json!({"long": long}).to_string()).unwrap();
    w.finish(&json!({"also": long})).unwrap();
    let a = Artifact::open(&path).unwrap();
    let attributes: serde_json::Value = serde_json::from_str(a.attributes()).unwrap();
    assert_eq!(attributes["long"].as_str().unwrap().len(), 300_000);
    assert!(a.provenance().len() > 300_000);
}

fn one_body(path: &Path) -> ArtifactWriter {
    let mut w = ArtifactWriter::create(path, "forming").unwrap();
    w.define_mesh("ply", &[0.0; 12], 4, &[0, 1, 2, 3], "{}")
        .unwrap();
    w
}

#[test]
fn nan_is_refused_with_its_place_in_the_text() {
    let dir = tempfile::tempdir().unwrap();
    let mut w = one_body(&dir.path().join("a.h5"));
    w.begin_frame(0.0).unwrap();
    let e = w
        .frame_field(
            "ply",
            FieldInfo::new(On::Points, "p", 2, "Pa"),
            &[0., 0., 0., 0., 0., f64::NAN, 0., 0.],
        )
        .unwrap_err();
    assert_eq!(e.kind, ErrorKind::BadValue);
    assert!(
        e.message.contains("'ply'") && e.message.contains("'p'"),
        "{e}"
    );
    assert!(e.message.contains("row 2, component 1"), "{e}");
    let mut points = [0.0; 12];
    points[7] = f64::INFINITY;
    let e = w.frame_points("ply", &points).unwrap_err();
    assert!(e.message.contains("coordinate 1 of point 2 is inf"), "{e}");
    let e = w
        .array("x", DType::F64, &[2], "1", &bytes(&[0.0, f64::NAN]))
        .unwrap_err();
    assert!(e.message.contains("flat index 1"), "{e}");
    assert_eq!(
        w.result("r", f64::NAN, "1").unwrap_err().kind,
        ErrorKind::BadValue
    );
}

#[test]
fn finishing_is_refused_with_a_frame_open() {
    let dir = tempfile::tempdir().unwrap();
    let mut w = one_body(&dir.path().join("a.h5"));
    w.begin_frame(0.5).unwrap();
    let e = w.finish(&json!({})).unwrap_err();
    assert_eq!(e.kind, ErrorKind::BadOrder);
    assert!(e.message.contains("0.5 s"), "{e}");
}

#[test]
fn a_frame_is_refused_when_a_field_or_points_of_the_first_are_missing() {
    let dir = tempfile::tempdir().unwrap();
    let mut w = one_body(&dir.path().join("a.h5"));
    w.begin_frame(0.0).unwrap();
    w.frame_points("ply", &[0.0; 12]).unwrap();
    w.frame_field("ply", FieldInfo::new(On::Cells, "s", 1, "1"), &[1.0])
        .unwrap();
    w.end_frame().unwrap();
    w.begin_frame(1.0).unwrap();
    assert!(w.end_frame().unwrap_err().message.contains("points"));
    w.frame_points("ply", &[0.0; 12]).unwrap();
    assert!(w.end_frame().unwrap_err().message.contains("'s'"));
    let late = w
        .frame_field("ply", FieldInfo::new(On::Cells, "t", 1, "1"), &[1.0])
        .unwrap_err();
    assert!(late.message.contains("not in frame 0"), "{late}");
    let size = w
        .frame_field("ply", FieldInfo::new(On::Cells, "s", 1, "1"), &[1.0, 2.0])
        .unwrap_err();
    assert_eq!(size.kind, ErrorKind::BadShape);
}

#[test]
fn a_mesh_is_refused_when_a_cell_names_no_point() {
    let dir = tempfile::tempdir().unwrap();
    let mut w = ArtifactWriter::create(&dir.path().join("a.h5"), "forming").unwrap();
    let e = w
        .define_mesh("ply", &[0.0; 12], 4, &[0, 1, 2, 4], "")
        .unwrap_err();
    assert!(e.message.contains("names point 4, but there are 4"), "{e}");
    let e = w
        .define_mesh("a b", &[0.0; 12], 4, &[0, 1, 2, 3], "")
        .unwrap_err();
    assert_eq!(e.kind, ErrorKind::BadValue);
}

#[test]
fn a_mesh_whose_cell_names_no_point_is_not_read() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.h5");
    write(&path);
    let mut file = std::fs::read(&path).unwrap();
    let cells: Vec<u8> = [0i64, 1, 2, 2, 3, 4]
        .iter()
        .flat_map(|i| i.to_le_bytes())
        .collect();
    let at = file.windows(cells.len()).position(|w| w == cells).unwrap();
    file[at + 8] = 5;
    std::fs::write(&path, file).unwrap();
    let error = Artifact::open(&path).unwrap().mesh("tool").unwrap_err();
    assert_eq!(error.kind, ErrorKind::NotAnArtifact);
    assert!(
        error
            .message
            .contains("5 points, and a cell with the corner 5"),
        "{error}"
    );
}

#[test]
fn opening_is_refused_when_the_file_is_no_artifact() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.h5");
    std::fs::write(&path, b"not an HDF5 file").unwrap();
    assert_eq!(
        Artifact::open(&path).unwrap_err().kind,
        ErrorKind::NotAnArtifact
    );
    let none = dir.path().join("none.h5");
    assert_eq!(Artifact::open(&none).unwrap_err().kind, ErrorKind::NotFound);
}
