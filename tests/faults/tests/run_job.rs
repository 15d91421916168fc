//! What a worker makes of well-behaved and of faulty plugins.

use camino::Utf8PathBuf;
use plyflow_artifact::{Artifact, On};
use plyflow_faults::library;
use plyflow_model::job::{
    Cost, FailureKind, JOB_VERSION, Job, JobInput, LibraryRef, LogLevel, Message, Record,
};
use plyflow_plugin_host::run_job;
use serde_json::{Value, json};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

fn utf8(path: std::path::PathBuf) -> Utf8PathBuf {
    Utf8PathBuf::from_path_buf(path).expect("a UTF-8 path")
}

fn job(dir: &TempDir, plugin: &str, kind: &str, parameters: Value) -> Job {
    let at = |name: &str| utf8(dir.path().join(format!("{plugin}.{name}")));
    Job {
        version: JOB_VERSION,
        step: plugin.into(),
        item: vec![3],
        key: "00ff".into(),
        plugin: LibraryRef {
            name: plugin.into(),
            path: utf8(library(plugin)),
            hash: None,
        },
        components: vec![],
        search_path: vec![],
        parameters,
        inputs: vec![],
        output_kind: kind.into(),
        collection: kind == "test-items",
        threads: 1,
        memory_limit: 0,
        artifact: at("h5.tmp"),
        record: at("record.tmp"),
        scratch: at("scratch"),
        checkpoints: None,
        provenance: json!({"step": plugin}),
    }
}

fn messages(bytes: &[u8]) -> Vec<Message> {
    let text = std::str::from_utf8(bytes).expect("messages are UTF-8");
    text.lines()
        .map(|l| serde_json::from_str(l).expect("a message"))
        .collect()
}

/// Runs a job in this process; the last message is the outcome.
fn run(job: &Job) -> (i32, Vec<Message>) {
    let mut out = Vec::new();
    let code = run_job(job, &mut out);
    (code, messages(&out))
}

fn done(job: &Job) -> Record {
    let (code, messages) = run(job);
    match messages.last() {
        Some(Message::Done { record }) => {
            assert_eq!(code, 0);
            (**record).clone()
        }
        other => panic!("expected done, got {other:?}"),
    }
}

fn failed(job: &Job) -> (FailureKind, String) {
    let (code, messages) = run(job);
    assert!(!job.artifact.exists(), "no partial artifact is left");
    assert!(!job.record.exists(), "no record is left");
    match messages.last() {
        Some(Message::Failed { kind, message }) => {
            assert_eq!(code, 1);
            (*kind, message.clone())
        }
        other => panic!("expected failed, got {other:?}"),
    }
}

fn input(job: &Job, port: &str) -> JobInput {
    JobInput {
        port: port.into(),
        step: job.step.clone(),
        kind: job.output_kind.clone(),
        item: vec![],
        artifact: job.artifact.clone(),
        cost: Cost::default(),
    }
}

#[test]
fn results_attributes_and_record_are_written_by_a_trivial_step() {
    let dir = tempfile::tempdir().unwrap();
    let job = job(&dir, "trivial", "test", json!({"value": 2.5}));
    let record = done(&job);
    assert_eq!(record.results[0].name, "value");
    assert_eq!(record.results[0].value, 2.5);
    assert_eq!(
        record.bytes,
        std::fs::metadata(&job.artifact).unwrap().len()
    );
    assert!(record.cost.peak_memory > 1_000_000);
    let written: Record =
        serde_json::from_slice(&std::fs::read(&job.record).unwrap()).expect("a record");
    assert_eq!(written, record);
    let a = Artifact::open(job.artifact.as_std_path()).unwrap();
    assert_eq!(a.kind(), "test");
    let attributes: Value = serde_json::from_str(a.attributes()).unwrap();
    assert_eq!(attributes, json!({"value": 2.5, "item": [3]}));
    assert_eq!(a.results()[0].value, 2.5);
    assert_eq!(a.provenance(), r#"{"step":"trivial"}"#);
}

#[test]
fn a_scratch_folder_that_cannot_be_made_is_why_the_step_fails() {
    let dir = tempfile::tempdir().unwrap();
    let mut mesh = job(&dir, "mesh", "forming", json!({"points": 8, "frames": 3}));
    std::fs::write(dir.path().join("file"), "").unwrap();
    let inside = dir.path().join("file/scratch");
    mesh.scratch = inside.to_str().unwrap().into();
    let (kind, message) = failed(&mesh);
    assert_eq!(kind, FailureKind::Error, "{message}");
    assert!(
        message.contains("the scratch folder") && message.contains("Not a directory"),
        "{message}"
    );
}

#[test]
fn several_inputs_arrive_at_one_port_in_order() {
    let dir = tempfile::tempdir().unwrap();
    let one = job(&dir, "trivial", "test", json!({"value": 2.0}));
    done(&one);
    let mut sum = job(&dir, "sum", "test", json!({}));
    sum.inputs = vec![input(&one, "in"), input(&one, "in"), input(&one, "other")];
    assert_eq!(done(&sum).results[0].value, 4.0);
}

#[test]
fn meshes_fields_and_arrays_pass_from_step_to_step() {
    let dir = tempfile::tempdir().unwrap();
    let mesh = job(&dir, "mesh", "forming", json!({"points": 8, "frames": 3}));
    done(&mesh);
    assert!(!mesh.scratch.exists(), "the scratch folder is removed");
    let a = Artifact::open(mesh.artifact.as_std_path()).unwrap();
    assert_eq!(
        a.frame_field("ply", 2, On::Cells, "shear_angle").unwrap()[4],
        1.5
    );
    assert_eq!(a.frame_points("tool", 2).unwrap()[2], [0.2, 0.0, 0.0]);
    let mut reader = job(&dir, "mesh-reader", "test", json!({}));
    reader.inputs = vec![input(&mesh, "formed")];
    let record = done(&reader);
    let value = |name: &str| {
        record
            .results
            .iter()
            .find(|r| r.name == name)
            .unwrap()
            .value
    };
    assert_eq!(value("reference_z"), 0.0);
    assert_eq!(value("cells"), 5.0);
    assert_eq!(value("z"), 0.02);
    assert_eq!(value("last_angle"), 1.5);
    assert_eq!(value("history"), 5.0);
    assert_eq!(value("time"), 1.0);
}

#[test]
fn a_collection_has_the_declared_labels() {
    let dir = tempfile::tempdir().unwrap();
    let record = done(&job(&dir, "split", "test-items", json!({"items": 3})));
    assert_eq!(record.collection.unwrap(), ["item-0", "item-1", "item-2"]);
}

#[test]
fn measured_results_stay_out_of_the_artifact() {
    let dir = tempfile::tempdir().unwrap();
    let job = job(&dir, "sleep", "test", json!({"seconds": 0.01}));
    let record = done(&job);
    assert!(record.results[0].measured);
    assert!(
        Artifact::open(job.artifact.as_std_path())
            .unwrap()
            .results()
            .is_empty()
    );
}

#[test]
fn an_artifact_has_the_same_bytes_when_made_again() {
    let dir = tempfile::tempdir().unwrap();
    let job = job(&dir, "mesh", "forming", json!({"points": 20, "frames": 5}));
    done(&job);
    let first = std::fs::read(&job.artifact).unwrap();
    std::fs::remove_file(&job.artifact).unwrap();
    done(&job);
    assert_eq!(first, std::fs::read(&job.artifact).unwrap());
}

#[test]
fn progress_is_throttled_and_log_lines_are_passed_on() {
    let dir = tempfile::tempdir().unwrap();
    let (_, messages) = run(&job(&dir, "sleep", "test", json!({"seconds": 0.5})));
    let progress = messages
        .iter()
        .filter(|m| matches!(m, Message::Progress(_)))
        .count();
    assert!(
        (1..=4).contains(&progress),
        "{progress} progress messages in half a second"
    );
    let (_, messages) = run(&job(&dir, "error", "test", json!({})));
    let warned = |m: &Message| matches!(m, Message::Log { level: LogLevel::Warn, text } if text == "something is odd");
    assert!(messages.iter().any(warned));
}

#[test]
fn an_error_of_the_plugin_is_the_failure_text() {
    let dir = tempfile::tempdir().unwrap();
    let (kind, text) = failed(&job(&dir, "error", "test", json!({})));
    assert_eq!(kind, FailureKind::Error);
    assert_eq!(
        text,
        "the tool has no surface: give it at least one triangle"
    );
}

#[test]
fn a_panic_of_the_plugin_is_a_failure_with_its_text() {
    let dir = tempfile::tempdir().unwrap();
    let (kind, text) = failed(&job(&dir, "panic", "test", json!({})));
    assert_eq!(kind, FailureKind::Panic);
    assert!(text.contains("index out of bounds"), "{text}");
}

#[test]
fn a_malformed_artifact_fails_the_step_even_if_the_plugin_ignores_it() {
    let dir = tempfile::tempdir().unwrap();
    for (plugin, kind, expected) in [
        (
            "nan-field",
            "forming",
            "field 'temperature': is NaN at row 1, component 0",
        ),
        ("writes-after-frame", "forming", "no frame is open"),
        ("open-frame", "forming", "begun but not ended"),
        ("missing-field", "forming", "field 'damage' is missing"),
        ("no-collection", "test-items", "declares a collection"),
    ] {
        let (kind, text) = failed(&job(&dir, plugin, kind, json!({})));
        assert_eq!(kind, FailureKind::Malformed, "{plugin}");
        assert!(text.contains(expected), "{plugin}: {text}");
    }
}

#[test]
fn numbers_in_other_units_than_declared_or_than_those_of_si_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let units =
        |what: &str, unit: &str| job(&dir, "units", "test", json!({"what": what, "unit": unit}));
    for (what, unit, expected) in [
        (
            "length",
            "rad",
            "reported in `rad`; the plugin's manifest says `m`",
        ),
        ("length", "mm", "1 `mm` is 0.001 in SI units"),
        (
            "share",
            "m",
            "reported in `m`; the plugin's manifest says ``",
        ),
        ("length.first", "s", "the plugin's manifest says `m`"),
        ("undeclared", "deg", "result 'undeclared': 1 `deg` is 0.017"),
        ("undeclared", "Nm", "`Nm`"),
        (
            "array",
            "MPa",
            "array 'lengths': 1 `MPa` is 1000000 in SI units",
        ),
        ("field", "degC", "field 'way' of 'ply': 1 `degC` is 274.15"),
        ("field", "metre", "`metre`"),
    ] {
        let (kind, text) = failed(&units(what, unit));
        assert_eq!(kind, FailureKind::Malformed, "{what} in {unit}");
        assert!(text.contains(expected), "{what} in {unit}: {text}");
    }
    for (what, unit) in [
        ("length.first", "m"),
        ("share", "1"),
        ("undeclared", "N m"),
        ("array", "kg/m2"),
        ("field", "1"),
    ] {
        done(&units(what, unit));
    }
    // Declared as measured in the manifest, reported without the flag.
    let seconds = units("seconds", "s");
    assert!(done(&seconds).results[0].measured);
    let written = Artifact::open(seconds.artifact.as_std_path()).unwrap();
    assert!(written.results().is_empty());
}

#[test]
fn loading_is_refused_with_what_was_found_and_expected() {
    let dir = tempfile::tempdir().unwrap();
    for (plugin, expected) in [
        (
            "wrong-abi",
            "ABI 99.0; this program accepts 1.0 to 1.2: update Plyflow",
        ),
        ("bad-magic", "0x0000000000001234 instead of PF_MAGIC"),
        ("bad-manifest", "does not follow schemas/manifest.md"),
        ("unknown-unit", "unit of `torque`"),
        (
            "wrong-kind",
            "its descriptor says step, its manifest says material",
        ),
        ("not-a-plugin", "does not export `plyflow_plugin`"),
    ] {
        let (kind, text) = failed(&job(&dir, plugin, "test", json!({})));
        assert_eq!(kind, FailureKind::Load, "{plugin}");
        assert!(text.contains(expected), "{plugin}: {text}");
    }
    let mut absent = job(&dir, "trivial", "test", json!({}));
    absent.plugin.path = "/nowhere/libx.so".into();
    assert!(failed(&absent).1.contains("no such file"));
    let mut newer = job(&dir, "trivial", "test", json!({}));
    newer.version += 1;
    assert!(failed(&newer).1.contains("same release"));
}

#[test]
fn an_unreadable_input_is_named_in_the_failure() {
    let dir = tempfile::tempdir().unwrap();
    let mut sum = job(&dir, "sum", "test", json!({}));
    let broken = job(&dir, "trivial", "test", json!({}));
    std::fs::write(&broken.artifact, "no HDF5").unwrap();
    sum.inputs = vec![input(&broken, "in")];
    let (kind, text) = failed(&sum);
    assert_eq!(kind, FailureKind::Error);
    assert!(
        text.contains("trivial.h5.tmp is not a Plyflow artifact"),
        "{text}"
    );
}

#[test]
fn a_component_is_found_in_the_job_and_on_the_search_path() {
    let dir = tempfile::tempdir().unwrap();
    let mut listed = job(&dir, "component", "test", json!({"material": "paper"}));
    let path = utf8(library("paper"));
    listed.components = vec![LibraryRef {
        name: "paper".into(),
        path: path.clone(),
        hash: None,
    }];
    let (code, messages) = run(&listed);
    assert_eq!(code, 0);
    assert!(
        matches!(messages.as_slice(), [Message::Done { .. }]),
        "no warning: {messages:?}"
    );

    let mut by_path = job(
        &dir,
        "component",
        "test",
        json!({"material": path.as_str()}),
    );
    by_path.components = listed.components.clone();
    assert_eq!(done(&by_path).results[0].value, 1e-4);

    // A path that nobody has asked the user about is not loaded, unless it lies where everything is trusted.
    by_path.components = vec![];
    let (_, text) = failed(&by_path);
    assert!(text.contains("no folder that is trusted"), "{text}");
    by_path.search_path = vec![path.parent().unwrap().canonicalize_utf8().unwrap()];
    assert_eq!(done(&by_path).results[0].value, 1e-4);

    // Bytes that are not those that were consented to.
    let mut others = listed.clone();
    others.components[0].hash = Some("00".repeat(32));
    let (_, text) = failed(&others);
    assert!(
        text.contains("not the library that was consented to"),
        "{text}"
    );

    let mut searched = job(&dir, "component", "test", json!({"material": "paper"}));
    searched.search_path = vec![path.parent().unwrap().to_owned()];
    assert!(done(&searched).warnings[0].contains("will not make this step run again"));

    let absent = job(&dir, "component", "test", json!({"material": "paper"}));
    let (_, text) = failed(&absent);
    assert!(text.contains("there is no material 'paper'"), "{text}");
}

// ---- in a process of its own ----------------------------------------------------------------------

fn spawn(job: &Job, dir: &TempDir) -> std::process::Child {
    let file = dir.path().join(format!("{}.job.json", job.plugin.name));
    std::fs::write(&file, serde_json::to_vec(job).unwrap()).unwrap();
    Command::new(env!("CARGO_BIN_EXE_faults-worker"))
        .arg(file)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

#[test]
fn a_worker_reports_done_when_run_as_a_process() {
    let dir = tempfile::tempdir().unwrap();
    let job = job(&dir, "trivial", "test", json!({"value": 1.0}));
    let output = spawn(&job, &dir).wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert!(matches!(
        messages(&output.stdout).last(),
        Some(Message::Done { .. })
    ));
}

#[test]
fn what_a_plugin_prints_does_not_disturb_the_messages() {
    let dir = tempfile::tempdir().unwrap();
    let output = spawn(&job(&dir, "prints", "test", json!({})), &dir)
        .wait_with_output()
        .unwrap();
    assert!(matches!(
        messages(&output.stdout).as_slice(),
        [Message::Done { .. }]
    ));
    assert!(String::from_utf8_lossy(&output.stderr).contains("nonsense"));
}

#[test]
fn a_crash_ends_the_worker_without_a_last_word() {
    use std::os::unix::process::ExitStatusExt;
    let dir = tempfile::tempdir().unwrap();
    let output = spawn(&job(&dir, "segfault", "test", json!({})), &dir)
        .wait_with_output()
        .unwrap();
    assert_eq!(output.status.signal(), Some(libc::SIGSEGV));
    let messages = messages(&output.stdout);
    assert!(
        matches!(messages.last(), Some(Message::Log { .. })),
        "the log line got out"
    );
}

/// Waits for the first message, so that the plugin is known to run.
fn first_line(child: &mut std::process::Child) -> String {
    use std::io::BufRead;
    let mut line = String::new();
    std::io::BufReader::new(child.stdout.as_mut().unwrap())
        .read_line(&mut line)
        .unwrap();
    line
}

#[test]
fn a_terminated_worker_stops_its_step_as_cancelled() {
    let dir = tempfile::tempdir().unwrap();
    let mut child = spawn(&job(&dir, "sleep", "test", json!({"seconds": 60.0})), &dir);
    first_line(&mut child);
    // SAFETY: numbers alone. A child that has not been waited for: its number is no other's.
    unsafe { libc::kill(child.id() as i32, libc::SIGTERM) };
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let last = messages(&output.stdout).pop();
    assert!(
        matches!(
            last,
            Some(Message::Failed {
                kind: FailureKind::Cancelled,
                ..
            })
        ),
        "{last:?}"
    );
}

#[test]
fn a_worker_dies_with_the_process_that_started_it() {
    let dir = tempfile::tempdir().unwrap();
    let job = job(&dir, "hang", "test", json!({}));
    let file = dir.path().join("job.json");
    std::fs::write(&file, serde_json::to_vec(&job).unwrap()).unwrap();
    // A shell stands for the engine; a second one tells its process number before it becomes the worker, so
    // that the number comes before all that the worker says.
    let script = format!(
        "sh -c 'echo $$; exec {} {}' & wait",
        env!("CARGO_BIN_EXE_faults-worker"),
        file.display()
    );
    let mut engine = Command::new("sh")
        .args(["-c", &script])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let out = engine.stdout.take().unwrap();
    let mut lines = std::io::BufRead::lines(std::io::BufReader::new(out));
    let worker: i32 = lines.next().unwrap().unwrap().trim().parse().unwrap();
    assert!(
        lines.next().unwrap().unwrap().contains("hanging"),
        "the plugin runs"
    );
    engine.kill().unwrap();
    engine.wait().unwrap();
    // Gone or a zombie of whoever inherited it, within ten seconds.
    let clock = Instant::now();
    let alive = || {
        let stat = std::fs::read_to_string(format!("/proc/{worker}/stat")).unwrap_or_default();
        stat.rsplit(')')
            .next()
            .is_some_and(|s| !s.trim().is_empty() && !s.trim().starts_with('Z'))
    };
    while alive() {
        assert!(
            clock.elapsed() < Duration::from_secs(10),
            "the worker is still there"
        );
        std::thread::sleep(Duration::from_millis(10));
    }
}
