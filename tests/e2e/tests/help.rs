//! What the program says of itself.

use plyflow_e2e::{program, repository};
use std::process::{Command, Output};

fn plyflow(words: &[&str]) -> Output {
    // What is known of plugins is kept where the program is called: not in the repository.
    let mut command = Command::new(program());
    command.args(words).current_dir(env!("CARGO_TARGET_TMPDIR"));
    command.output().expect("plyflow starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("UTF-8")
}

/// Names under `Commands:` in `plyflow --help`.
fn commands() -> Vec<String> {
    let help = text(&plyflow(&["--help"]).stdout);
    let list = help
        .split("Commands:\n")
        .nth(1)
        .expect("a list of commands");
    let lines = list.lines().take_while(|l| l.starts_with("  "));
    let names = lines
        .filter_map(|l| l.split_whitespace().next())
        .map(str::to_owned);
    names.filter(|n| n != "help").collect()
}

#[test]
fn every_command_explains_itself_and_its_options() {
    let commands = commands();
    assert!(commands.len() >= 11, "{commands:?}");
    for name in commands {
        let long = plyflow(&[&name, "--help"]);
        assert_eq!(long.status.code(), Some(0), "{name}");
        assert!(
            text(&long.stdout).contains(&format!("Usage: plyflow {name}")),
            "{name}"
        );
        // In the short form an option and what it does stand in one line: "  -j, --jobs <N>  Cores that ..".
        let short = text(&plyflow(&[&name, "-h"]).stdout);
        for line in short
            .lines()
            .map(str::trim_start)
            .filter(|l| l.starts_with('-'))
        {
            let words = line.split("  ").filter(|part| !part.is_empty()).count();
            assert!(words >= 2, "{name}: nothing is said of {line}");
        }
    }
}

#[test]
fn the_exit_codes_of_help_and_of_the_book_are_the_same() {
    let help = text(&plyflow(&["--help"]).stdout);
    let list = help
        .split("Exit codes:\n")
        .nth(1)
        .expect("a list of exit codes");
    let first = |l: &str| {
        l.split_whitespace()
            .next()
            .and_then(|w| w.parse::<u8>().ok())
    };
    let told: Vec<u8> = list.lines().filter_map(first).collect();
    let page = std::fs::read_to_string(repository().join("docs/exit-codes.md")).unwrap();
    let row = |l: &str| l.strip_prefix("| ")?.split(" |").next()?.parse::<u8>().ok();
    let written: Vec<u8> = page.lines().filter_map(row).collect();
    assert_eq!(told, written);
    assert_eq!(told, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 130]);
}

#[test]
fn schemas_and_completions_are_printed_without_a_workflow() {
    for which in [
        "workflow",
        "plain-workflow",
        "scene",
        "material",
        "expected",
    ] {
        let output = plyflow(&["schema", which]);
        let schema: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert!(
            schema["$schema"].as_str().unwrap().contains("2020-12"),
            "{which}"
        );
    }
    for shell in ["bash", "zsh", "fish"] {
        assert!(
            text(&plyflow(&["completions", shell]).stdout).contains("plyflow"),
            "{shell}"
        );
    }
}

#[test]
fn a_reader_that_goes_away_ends_a_command_quietly() {
    let line = format!("'{}' schema workflow | head -1", program().display());
    let folder = env!("CARGO_TARGET_TMPDIR");
    let output = Command::new("sh")
        .args(["-c", &line])
        .current_dir(folder)
        .output()
        .unwrap();
    assert_eq!(text(&output.stderr), "");
}

/// Workflow files below a folder, at any depth, whatever their names; what runs leave behind is hidden and passed over.
fn workflows(folder: &std::path::Path, found: &mut Vec<std::path::PathBuf>) {
    for file in std::fs::read_dir(folder).unwrap().flatten() {
        let (path, name) = (file.path(), file.file_name().into_string().unwrap());
        if path.is_dir() && !name.starts_with('.') {
            workflows(&path, found);
        } else if name.ends_with(".yaml") {
            let written = std::fs::read_to_string(&path).unwrap();
            // To look at a step in Python is to run its file, which needs its packages: `scripts/check-files-of-others` does both.
            let in_python = written.contains(".py\n");
            if !in_python && written.lines().any(|line| line.starts_with("plyflow:")) {
                found.push(path);
            }
        }
    }
}

#[test]
fn the_workflows_of_this_repository_are_valid() {
    let mut found = Vec::new();
    workflows(&repository().join("workflows"), &mut found);
    for path in &found {
        let output = plyflow(&["validate", path.to_str().unwrap()]);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    }
    assert!(found.len() >= 50, "{} workflows", found.len());
}
