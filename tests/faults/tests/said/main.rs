//! What users read, whole, in the files of `snapshots/`: help, what is told of a workflow, and the most common errors.
//!
//! A text that has changed fails with a difference. Whoever means it accepts it with `SNAPSHOTS=overwrite cargo test -p plyflow-faults --test
//! said --release`, and the change of text is then part of what is reviewed. Times, sizes, keys and places are marks.

use regex::Regex;
use snapbox::data::DataFormat;
use snapbox::{Assert, Data, assert::DEFAULT_ACTION_ENV};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

/// The program in a folder of its own: beside it lie no plugins that a nearest name could be taken from.
fn program() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("said");
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("plyflow");
        let _ = std::fs::remove_file(&path);
        std::fs::hard_link(plyflow_faults::program(), &path).unwrap();
        path
    })
}

/// A folder of a fixed length of name: where lines are broken hangs on it.
struct Place(tempfile::TempDir);

impl Place {
    fn new(workflow: &str) -> Self {
        let mut named = tempfile::Builder::new();
        let place = Self(named.prefix("plyflow-said-").tempdir_in("/tmp").unwrap());
        std::fs::create_dir(place.0.path().join("plugins")).unwrap();
        for name in ["trivial", "split", "sum", "wrong-abi"] {
            let library = plyflow_faults::library(name);
            let link = place
                .0
                .path()
                .join("plugins")
                .join(format!("lib{}.so", name.replace('-', "_")));
            std::os::unix::fs::symlink(library, link).unwrap();
        }
        place.write(workflow);
        place
    }

    fn write(&self, workflow: &str) {
        let text = format!("plyflow: 1\nname: study\n{workflow}");
        std::fs::write(self.0.path().join("workflow.yaml"), text).unwrap();
    }

    fn call(&self, words: &[&str]) -> Output {
        let mut command = Command::new(program());
        command.args(words).current_dir(self.0.path());
        command.env("PLYFLOW_PLUGINS", self.0.path().join("plugins"));
        command.env("XDG_CONFIG_HOME", self.0.path());
        command.env("COLUMNS", "100").stdin(Stdio::null());
        command.output().unwrap()
    }

    fn run(&self, code: i32) {
        let output = self.call(&[
            "run",
            "workflow.yaml",
            "--jobs",
            "1",
            "--quiet",
            "--no-report",
        ]);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{said}");
    }

    /// Holds all that a command says, and the code with which it ends, against a snapshot.
    fn says(&self, snapshot: &str, words: &[&str]) {
        let output = self.call(words);
        let mut text = format!("$ plyflow {}\n", words.join(" "));
        for (name, said) in [
            ("", &output.stdout),
            ("on standard error:\n", &output.stderr),
        ] {
            if !said.is_empty() {
                text += &format!("{name}{}", String::from_utf8_lossy(said));
            }
        }
        let code = output.status.code().expect("no signal");
        text += &format!("(code {code})\n");
        let here = self.0.path().to_str().unwrap();
        check(snapshot, &marked(&text.replace(here, "[HERE]")));
    }
}

/// A text with marks in the place of what is another each time, and without blanks at the ends of lines.
fn marked(text: &str) -> String {
    let marks = [
        (r"\b[0-9a-f]{64}\b", "[BLAKE3]"),
        (r"\b[0-9a-f]{12}\b", "[KEY]"),
        (r"artifacts/[0-9a-f]{2}/", "artifacts/[..]/"),
        // With all blanks before but one: a longer one has fewer.
        (r"( ?) *\b\d+(\.\d)? (s|min \d\d s)\b", "${1}[TIME]"),
        (r"( ?) *\b\d+(\.\d)? ([KMGT]i)?B\b", "${1}[SIZE]"),
        (r"(?m) +$", ""),
    ];
    marks.iter().fold(text.to_owned(), |text, (pattern, mark)| {
        let pattern = Regex::new(pattern).unwrap();
        pattern.replace_all(&text, *mark).into_owned()
    })
}

fn check(snapshot: &str, text: &str) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/said/snapshots");
    let path = folder.join(format!("{snapshot}.txt"));
    let expected = Data::read_from(&path, Some(DataFormat::Text)).raw();
    let assert = Assert::new().action_env(DEFAULT_ACTION_ENV);
    assert.eq(Data::text(text).raw(), expected);
}

const FAN_OUT: &str = "
steps:
  first: {plugin: trivial, with: {value: 2}}
  zones: {plugin: split, with: {items: 3}, from: {in: first}}
  local: {plugin: trivial, with: {value: 5}, for_each: {zone: zones}, from: {in: [zones, first]}}
  all: {plugin: sum, from: {in: [local, first]}}
";

#[test]
fn help() {
    let place = Place::new(FAN_OUT);
    place.says("help", &["--help"]);
    let help = place.call(&["--help"]).stdout;
    let bare = place.call(&[]);
    assert_eq!((bare.status.code(), &bare.stderr), (Some(2), &help));
    let help = String::from_utf8(help).unwrap();
    let list = help.split("Commands:\n").nth(1).unwrap();
    let lines = list.lines().take_while(|l| l.starts_with("  "));
    for name in lines.filter_map(|l| l.split_whitespace().next()) {
        if name != "help" {
            place.says(&format!("help/{name}"), &[name, "--help"]);
        }
    }
}

/// What programs read: findings, the error at the end, and steps told apart from their items.
#[test]
fn errors_and_plans_for_programs() {
    let place = Place::new("steps:\n  a: {plugin: trivial, with: {valu: 2}}\n");
    let run = |file| ["run", file, "--log-format", "json", "--jobs", "1"];
    place.says("run-json-invalid", &run("workflow.yaml"));
    place.says("run-json-missing", &run("nowhere.yaml"));
    let place = Place::new(FAN_OUT);
    place.says("plan-json", &["plan", "workflow.yaml", "--format", "json"]);
}

#[test]
fn plan_explain_and_results() {
    let expected = "expect:\n  - {step: all, result: sum, value: 17, tolerance: 0.5}\n  \
         - {step: local, result: value, maximum: 4, source: made up}\n";
    let place = Place::new(&format!("{FAN_OUT}{expected}"));
    place.says("plan-new", &["plan", "workflow.yaml"]);
    place.says("results-none", &["results", "workflow.yaml"]);
    place.run(0);
    place.says("plan-done", &["plan", "workflow.yaml"]);
    place.says("results", &["results", "workflow.yaml", "--format", "csv"]);
    place.says(
        "missed-expectation",
        &[
            "results",
            "workflow.yaml",
            "--check",
            "--step",
            "all",
            "--step",
            "local",
        ],
    );
    place.write(&FAN_OUT.replace("value: 5", "value: 6"));
    place.says("plan-changed", &["plan", "workflow.yaml"]);
    place.says(
        "explain-changed",
        &["explain", "workflow.yaml", "local[item-1]"],
    );
    place.says("explain-input", &["explain", "workflow.yaml", "all"]);
    place.write(&FAN_OUT.replace("items: 3", "items: 2"));
    place.says("plan-unknown", &["plan", "workflow.yaml"]);
    place.says("explain-unknown", &["explain", "workflow.yaml", "local"]);
}

#[test]
fn a_study() {
    let text = "study:\n  vary: {v: [1, 2]}\nresponses:\n  size: {step: one, result: value}\nsteps:\n  \
         one: {plugin: trivial, with: {value: \"${v}\"}}\n";
    let place = Place::new(text);
    place.says("study-plan-new", &["plan", "workflow.yaml"]);
    place.run(0);
    place.says("study-plan-done", &["plan", "workflow.yaml"]);
    place.says("study-results", &["results", "workflow.yaml", "--study"]);
}

#[test]
fn diff() {
    let place = Place::new(FAN_OUT);
    place.run(0);
    place.says("diff-itself", &["diff", "workflow.yaml", "workflow.yaml"]);
    let text = format!("plyflow: 1\nname: same\n{FAN_OUT}");
    std::fs::write(place.0.path().join("same.yaml"), text).unwrap();
    let ran = place.call(&["run", "same.yaml", "--quiet", "--no-report"]);
    assert_eq!(ran.status.code(), Some(0));
    place.says("diff-same", &["diff", "workflow.yaml", "same.yaml"]);
    let other = FAN_OUT
        .replace("value: 5", "value: 6")
        .replace("items: 3", "items: 2");
    let text = format!("plyflow: 1\nname: other\n{other}");
    std::fs::write(place.0.path().join("other.yaml"), text).unwrap();
    place.says("diff-not-run", &["diff", "workflow.yaml", "other.yaml"]);
    let ran = place.call(&["run", "other.yaml", "--quiet", "--no-report"]);
    assert_eq!(ran.status.code(), Some(0));
    place.says("diff", &["diff", "workflow.yaml", "other.yaml"]);
}

#[test]
fn errors_of_a_workflow() {
    let one = |snapshot: &str, steps: &str| {
        let place = Place::new(&format!("steps:\n{steps}"));
        place.says(snapshot, &["validate", "workflow.yaml"]);
    };
    one("unknown-plugin", "  a: {plugin: trivail}\n");
    one(
        "unknown-parameter",
        "  a: {plugin: trivial, with: {valve: 1}}\n",
    );
    one(
        "unknown-step",
        "  a: {plugin: trivial}\n  b: {plugin: sum, from: {in: aa}}\n",
    );
    one("unknown-key", "  a: {plugin: trivial, wiht: {value: 1}}\n");
    one("wrong-type", "  a: {plugin: trivial, with: {value: two}}\n");
    one(
        "wrong-unit",
        "  a: {plugin: trivial, resources: {time_limit: 5 mm}}\n",
    );
    one(
        "missing-unit",
        "  a: {plugin: trivial, resources: {time_limit: 5}}\n",
    );
    one(
        "two-errors",
        "  a: {plugin: wrong-abi}\n  b: {plugin: trivial, with: {valve: 1}}\n",
    );
    one("missing-library", "  a: {plugin: ./libmine.so}\n");
    one(
        "missing-plugins",
        "  a: {plugin: ./libmine.so}\n  b: {plugin: ./libmine.so}\n  c: {plugin: trivail}\n  d: {plugin: trivail}\n",
    );
}

#[test]
fn errors_of_a_command_line() {
    let place = Place::new(FAN_OUT);
    place.says("missing-workflow", &["run", "nothing.yaml"]);
    place.says("no-workflow", &["run"]);
    place.says("no-jobs", &["run", "workflow.yaml", "--jobs", "0"]);
    place.says(
        "set-without-parameter",
        &["run", "workflow.yaml", "--set", "first=1"],
    );
    place.says("unknown-command", &["runn"]);
    place.says("unknown-option", &["run", "--jbos", "2"]);
    place.says(
        "until-unknown-step",
        &["run", "workflow.yaml", "--until", "zone"],
    );
    place.says(
        "set-unknown-parameter",
        &["run", "workflow.yaml", "--set", "first.valve=1"],
    );
    place.says(
        "wrong-unit-of-option",
        &["run", "workflow.yaml", "--checkpoint-every", "5 mm"],
    );
}

#[test]
fn new_plugins() {
    let place = Place::new(FAN_OUT);
    let new = |snapshot: &str, words: &[&str]| {
        place.says(snapshot, &[&["new"], words].concat());
    };
    new("new-step", &["step", "count-sheared", "--c"]);
    new("new-again", &["step", "count-sheared", "--python"]);
    new(
        "new-element",
        &["element", "my-element", "--c", "--into", "a place"],
    );
    new("new-material", &["material", "my-law", "--rust"]);
    new("new-bad-name", &["step", "My_Step", "--c"]);
    new("new-taken", &["step", "trivial", "--c"]);
    new("new-python-module", &["step", "statistics", "--python"]);
    new("new-without-language", &["step", "mine"]);
    new("new-without-template", &["element", "mine", "--python"]);
    new("new-two-languages", &["step", "mine", "--c", "--rust"]);
    new(
        "new-without-crates",
        &["step", "mine", "--rust", "--source", "."],
    );
}

#[test]
fn a_damaged_store() {
    let place = Place::new(FAN_OUT);
    place.run(0);
    let inspected = place
        .call(&["inspect", "all", "--workflow", "workflow.yaml"])
        .stdout;
    let inspected = String::from_utf8(inspected).unwrap();
    let artifact = Path::new(inspected.lines().next().unwrap());
    let mut bytes = std::fs::read(artifact).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(artifact, bytes).unwrap();
    place.says("damaged-verify", &["verify", "workflow.yaml", "--dry-run"]);
    place.says(
        "damaged-inspect",
        &["inspect", "all", "--workflow", "workflow.yaml"],
    );
    place.says("damaged-plan", &["plan", "workflow.yaml"]);
}

#[test]
fn every_snapshot_is_of_a_command() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/said/snapshots");
    let names = std::fs::read_dir(folder).unwrap().flatten();
    for path in names.map(|e| e.path()).filter(|p| p.is_file()) {
        let name = path.file_stem().unwrap().to_str().unwrap();
        let used = include_str!("main.rs").contains(&format!("\"{name}\""));
        assert!(used, "{name}: no test writes it any more");
    }
}
