//! `plyflow new`, with all plugins beside the program: names that are theirs, and a folder that builds and is valid.

use plyflow_e2e::program;
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn plyflow(folder: &Path, words: &[&str]) -> Output {
    let mut command = Command::new(program());
    command.args(words).current_dir(folder).stdin(Stdio::null());
    command.output().expect("plyflow starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn a_name_of_a_plugin_that_comes_along_is_refused_and_nothing_is_made() {
    let dir = tempfile::tempdir().unwrap();
    for (kind, name) in [
        ("element", "m4"),
        ("material", "fabric-linear"),
        ("step", "forming-explicit"),
        // Two plugins of one name are never both meant, whatever their kinds.
        ("step", "rf4"),
    ] {
        let output = plyflow(dir.path(), &["new", kind, name, "--c"]);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(
            said.contains(&format!("choose another, such as `my-{name}`")),
            "{said}"
        );
    }
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
}

#[test]
fn a_new_step_in_c_builds_and_its_workflow_is_valid() {
    let dir = tempfile::tempdir().unwrap();
    let made = plyflow(
        dir.path(),
        &["new", "step", "count-sheared", "--c", "--into", "a/b"],
    );
    assert_eq!(made.status.code(), Some(0), "{}", text(&made.stderr));
    assert!(text(&made.stdout).contains("\n  cd a/b/count-sheared\n"));
    let folder = dir.path().join("a/b/count-sheared");
    let built = Command::new("make")
        .arg("--silent")
        .current_dir(&folder)
        .status()
        .expect("make and a C compiler are needed for this test");
    assert!(built.success());
    let valid = plyflow(&folder, &["validate", "workflow.yaml", "--trust"]);
    assert_eq!(valid.status.code(), Some(0), "{}", text(&valid.stderr));
    let shown = plyflow(&folder, &["plugins", "--trust", "./libcount_sheared.so"]);
    let shown = text(&shown.stdout);
    assert!(shown.starts_with("count-sheared 0.1.0 (step"), "{shown}");
}
