//! Minutes, not seconds: `make long`. Kills are in `kills`.

use plyflow_e2e::{artifacts, ended, program, repository};
use std::path::Path;
use std::process::{Command, Output};

const WORKFLOW: &str = "workflows/joggle-spar/workflow-coarse.yaml";
/// Its steps.
const STEPS: [&str; 7] = [
    "coarse",
    "defects",
    "zones",
    "boundary",
    "local",
    "drape",
    "comparison",
];

fn call(words: &[&str], store: &Path, jobs: &str) -> Output {
    let mut command = Command::new(program());
    command.args(words).args(["--jobs", jobs, "--store"]);
    command.arg(store).current_dir(repository());
    command.output().expect("plyflow starts")
}

fn run(store: &Path, jobs: &str) {
    let words = ["run", WORKFLOW, "--no-report", "--log-format", "json"];
    let output = call(&words, store, jobs);
    let end = ended(&output.stderr, output.status);
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(end.code, Some(0), "{text}");
}

#[test]
#[ignore = "minutes: make long"]
fn the_coarse_joggle_spar_has_the_same_bytes_with_1_2_and_4_threads_and_made_again() {
    let folder = tempfile::tempdir().unwrap();
    let one = folder.path().join("1");
    run(&one, "1");
    let expected = artifacts(&one);
    for jobs in ["2", "4"] {
        let store = folder.path().join(jobs);
        run(&store, jobs);
        let found = artifacts(&store);
        assert!(found.keys().eq(expected.keys()), "{jobs} threads");
        for (name, bytes) in &found {
            assert!(expected[name] == *bytes, "{jobs} threads: {name} differs");
        }
    }
    // Each step by itself, with more threads than it was made with.
    let again: Vec<&str> = STEPS.iter().flat_map(|step| ["--again", step]).collect();
    let output = call(&[&["verify", WORKFLOW], &again[..]].concat(), &one, "4");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(0), "{text}");
    let same = text.matches("made again, the same").count();
    assert_eq!(same, expected.len(), "{text}");
}
