//! The template of a step in C builds with nothing but a C compiler and the header, and runs.

use camino::Utf8PathBuf;
use plyflow_artifact::{Artifact, ArtifactWriter, DType};
use plyflow_model::job::{Cost, JOB_VERSION, Job, JobInput, LibraryRef, Message};
use serde_json::json;
use std::path::Path;
use std::process::Command;

#[test]
fn a_step_in_c_runs_when_built_with_only_the_header() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| Utf8PathBuf::from_path_buf(dir.path().join(name)).unwrap();
    let template =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../solver-plugins/door/templates/step-c");
    let built = Command::new("make")
        .args(["--silent", "CFLAGS=-O2 -Wall -Wextra -Wpedantic -Werror"])
        .arg(format!("OUT={}", at("libdouble_time.so")))
        .current_dir(template)
        .status()
        .expect("make and a C compiler are needed for this test");
    assert!(built.success());

    let mut w = ArtifactWriter::create(at("in.h5").as_std_path(), "forming").unwrap();
    let times: Vec<u8> = [0.5f64, 1.0, 2.0]
        .iter()
        .flat_map(|x| x.to_ne_bytes())
        .collect();
    w.array("history/time", DType::F64, &[3], "s", &times)
        .unwrap();
    w.finish(&json!({})).unwrap();

    let job = Job {
        version: JOB_VERSION,
        step: "twice".into(),
        item: vec![],
        key: "0".into(),
        plugin: LibraryRef {
            name: "double-time".into(),
            path: at("libdouble_time.so"),
            hash: None,
        },
        components: vec![],
        search_path: vec![],
        parameters: json!({"factor": 2.0}),
        inputs: vec![JobInput {
            port: "formed".into(),
            step: "coarse".into(),
            kind: "forming".into(),
            item: vec![],
            artifact: at("in.h5"),
            cost: Cost::default(),
        }],
        output_kind: "example".into(),
        collection: false,
        threads: 1,
        memory_limit: 0,
        artifact: at("out.h5"),
        record: at("out.json"),
        scratch: at("scratch"),
        checkpoints: None,
        provenance: json!({}),
    };
    let mut out = Vec::new();
    assert_eq!(
        plyflow_plugin_host::run_job(&job, &mut out),
        0,
        "{}",
        String::from_utf8_lossy(&out)
    );
    let last = String::from_utf8(out).unwrap();
    let last: Message = serde_json::from_str(last.lines().last().unwrap()).unwrap();
    let Message::Done { record } = last else {
        panic!("{last:?}")
    };
    assert_eq!(
        (record.results[0].name.as_str(), record.results[0].value),
        ("sum", 7.0)
    );
    let a = Artifact::open(at("out.h5").as_std_path()).unwrap();
    assert_eq!(
        a.array_f64("history/time").unwrap(),
        (vec![1.0, 2.0, 4.0], vec![3])
    );
    assert_eq!(a.attributes(), r#"{"count": 3}"#);
}
