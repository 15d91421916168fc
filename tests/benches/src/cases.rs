//! The cases.

use crate::machine::Class;
use plyflow_e2e::{program, repository};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

/// One measured number.
pub struct Row {
    /// What was measured.
    pub case: String,
    /// How much.
    pub value: f64,
    /// Of what.
    pub unit: &'static str,
    /// What belongs to it.
    pub more: Value,
}

impl Row {
    /// A number of a case.
    pub fn new(case: impl Into<String>, value: f64, unit: &'static str) -> Self {
        Self {
            case: case.into(),
            value,
            unit,
            more: json!({}),
        }
    }

    /// The row as it is recorded.
    pub fn json(&self, class: &Class) -> Value {
        let mut row = json!({
            "case": self.case, "value": self.value, "unit": self.unit,
            "cpu": class.cpu, "threads": class.threads, "commit": class.commit,
        });
        if let (Value::Object(row), Value::Object(more)) = (&mut row, &self.more) {
            row.extend(more.clone());
        }
        row
    }
}

/// Wall and CPU seconds of some work, with all children that it waits for.
#[derive(Clone, Copy)]
struct Spent {
    wall: f64,
    cpu: f64,
}

fn cpu_seconds(who: i32) -> f64 {
    // SAFETY: numbers alone, for which zeros are values.
    let mut usage: libc::rusage = unsafe { std::mem::zeroed() };
    // SAFETY: a whole struct of this function.
    let code = unsafe { libc::getrusage(who, &raw mut usage) };
    assert_eq!(code, 0);
    let seconds = |t: libc::timeval| t.tv_sec as f64 + 1e-6 * t.tv_usec as f64;
    seconds(usage.ru_utime) + seconds(usage.ru_stime)
}

fn spent(work: impl FnOnce()) -> Spent {
    let cpu = || cpu_seconds(libc::RUSAGE_SELF) + cpu_seconds(libc::RUSAGE_CHILDREN);
    let (clock, before) = (Instant::now(), cpu());
    work();
    Spent {
        wall: clock.elapsed().as_secs_f64(),
        cpu: cpu() - before,
    }
}

/// The repetition with the least CPU time: what disturbs can only add.
fn least(times: usize, mut work: impl FnMut() -> Spent) -> Spent {
    let runs = (0..times).map(|_| work());
    runs.min_by(|a, b| a.cpu.total_cmp(&b.cpu))
        .expect("at least one repetition")
}

fn quiet(command: &mut Command) {
    let status = command
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    let status = status.expect("the program starts");
    assert!(status.success(), "{command:?} ended with {status}");
}

/// A folder with a workflow of `n` steps that do nothing, each written out.
fn written_out(n: usize) -> tempfile::TempDir {
    let mut text = String::from("plyflow: 1\nname: trivial\nsteps:\n");
    for i in 0..n {
        text += &format!("  s{i}: {{plugin: trivial, with: {{value: {i}}}}}\n");
    }
    folder(&text)
}

/// The same by fan-out.
fn fanned_out(n: usize) -> tempfile::TempDir {
    folder(&format!(
        "plyflow: 1\nname: trivial\nsteps:\n  items: {{plugin: split, with: {{items: {n}}}}}\n  \
         each: {{plugin: trivial, for_each: {{i: items}}}}\n"
    ))
}

fn folder(workflow: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join("workflow.yaml"), workflow).expect("a workflow");
    folder
}

/// A folder with the two plugins that are needed, alone: those that are broken on purpose would be looked at in each run.
fn plugins() -> PathBuf {
    let folder = plyflow_faults::folder().with_file_name("bench-plugins");
    std::fs::create_dir_all(&folder).expect("a folder");
    for name in ["trivial", "split"] {
        let library = plyflow_faults::library(name);
        let link = folder.join(library.file_name().expect("a name"));
        if !link.exists() {
            let _ = std::fs::remove_file(&link);
            std::os::unix::fs::symlink(&library, link).expect("a link");
        }
    }
    folder
}

fn run(folder: &Path) {
    let mut command = Command::new(program());
    command.args([
        "run",
        "workflow.yaml",
        "--jobs",
        "2",
        "--quiet",
        "--no-report",
    ]);
    quiet(
        command
            .current_dir(folder)
            .env("PLYFLOW_PLUGINS", plugins()),
    );
}

/// What `ninja` takes to find that nothing is to be done for `n` files; `None` where there is no ninja.
fn ninja(n: usize) -> Option<Spent> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut text = String::from("rule t\n  command = echo $v > $out\n");
    for i in 0..n {
        text += &format!("build s{i}: t\n  v = {i}\n");
    }
    std::fs::write(folder.path().join("build.ninja"), text).expect("a build file");
    let mut command = Command::new("ninja");
    command.current_dir(folder.path()).stdout(Stdio::null());
    let first = command.stderr(Stdio::null()).status().ok()?;
    assert!(first.success(), "ninja does not build");
    Some(least(9, || spent(|| quiet(&mut command))))
}

/// Spawns processes that load a library and end, two at a time.
fn bare_loop(n: usize) {
    let bare = std::env::current_exe()
        .expect("a path")
        .with_file_name("bare-worker");
    let library = plyflow_faults::library("trivial");
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                for _ in 0..n / 2 {
                    quiet(Command::new(&bare).arg(&library));
                }
            });
        }
    });
}

/// What steps and looking cost, without any work in the steps.
pub fn engine() -> Vec<Row> {
    let mut rows = Vec::new();
    let n = 1000;
    // Build it before the clock starts.
    assert!(program().is_file());
    let bare = least(3, || spent(|| bare_loop(n)));
    let full = least(3, || {
        let folder = written_out(n);
        spent(|| run(folder.path()))
    });
    rows.push(Row::new("spawn + dlopen, 1,000 times, CPU", bare.cpu, "s"));
    rows.push(Row::new("1,000 trivial steps, 2 jobs, CPU", full.cpu, "s"));
    rows.push(Row::new(
        "1,000 trivial steps, 2 jobs, wall",
        full.wall,
        "s",
    ));
    rows.push(Row::new(
        "1,000 trivial steps over spawn + dlopen",
        full.cpu / bare.cpu,
        "1",
    ));
    for (name, folder) in [
        ("written out", written_out(10_000)),
        ("fanned out", fanned_out(10_000)),
    ] {
        let first = spent(|| run(folder.path()));
        rows.push(Row::new(
            format!("10,000 trivial steps {name}, CPU"),
            first.cpu,
            "s",
        ));
        let again = least(9, || spent(|| run(folder.path())));
        if let Some(other) = ninja(10_000) {
            let case = format!("no-op of 10,000 steps {name} over ninja's");
            rows.push(Row::new(
                format!("{case}, wall"),
                again.wall / other.wall,
                "1",
            ));
            rows.push(Row::new(format!("{case}, CPU"), again.cpu / other.cpu, "1"));
        }
        rows.push(Row::new(
            format!("no-op of 10,000 steps {name}, CPU"),
            1e3 * again.cpu,
            "ms",
        ));
        rows.push(Row::new(
            format!("no-op of 10,000 steps {name}, wall"),
            1e3 * again.wall,
            "ms",
        ));
    }
    let help = help();
    rows.push(Row::new("--help, CPU", 1e3 * help.cpu, "ms"));
    rows.push(Row::new("--help, wall", 1e3 * help.wall, "ms"));
    rows
}

/// What one call takes that only prints.
fn help() -> Spent {
    least(5, || {
        let all = spent(|| (0..50).for_each(|_| quiet(Command::new(program()).arg("--help"))));
        Spent {
            wall: all.wall / 50.0,
            cpu: all.cpu / 50.0,
        }
    })
}

/// A study of a thousand trivial points beside the same steps written out: to plan it, to run it, and to add one point.
pub fn points() -> Vec<Row> {
    let n = 1000;
    let study = |to: usize| {
        format!(
            "plyflow: 1\nname: trivial\nstudy:\n  vary:\n    v: {{from: 1, to: {to}, by: 1}}\nsteps:\n  \
             s: {{plugin: trivial, with: {{value: \"${{v}}\"}}}}\nresponses:\n  value: {{step: s, result: value}}\n"
        )
    };
    assert!(program().is_file());
    let plan = |folder: &Path| {
        let mut command = Command::new(program());
        command.args(["plan", "workflow.yaml"]).current_dir(folder);
        quiet(command.env("PLYFLOW_PLUGINS", plyflow_faults::folder()));
    };
    let planned = least(5, || {
        let folder = folder(&study(n));
        spent(|| plan(folder.path()))
    });
    let full = least(3, || {
        let folder = folder(&study(n));
        spent(|| run(folder.path()))
    });
    let by_hand = least(3, || {
        let folder = written_out(n);
        spent(|| run(folder.path()))
    });
    let grown = folder(&study(n));
    run(grown.path());
    std::fs::write(grown.path().join("workflow.yaml"), study(n + 1)).expect("a workflow");
    let added = spent(|| run(grown.path()));
    let more = |a: f64, b: f64| 1e3 * (a - b) / n as f64;
    vec![
        Row::new(
            "study of 1,000 trivial points, plan, wall",
            planned.wall,
            "s",
        ),
        Row::new("study of 1,000 trivial points, plan, CPU", planned.cpu, "s"),
        Row::new("study of 1,000 trivial points, 2 jobs, CPU", full.cpu, "s"),
        Row::new(
            "study of 1,000 trivial points, a point more than by hand, wall",
            more(full.wall, by_hand.wall),
            "ms",
        ),
        Row::new(
            "study of 1,000 trivial points, a point more than by hand, CPU",
            more(full.cpu, by_hand.cpu),
            "ms",
        ),
        Row::new(
            "study of 1,000 trivial points, one more point, wall",
            1e3 * added.wall,
            "ms",
        ),
    ]
}

/// Element-steps per second of one core, as the kernels' own example measures them.
pub fn kernels() -> Vec<Row> {
    let row = |(case, v): (String, Value)| {
        let rate = v["million_per_second"].as_f64().expect("a rate");
        Row::new(case, 1e3 / rate, "ns per element-step")
    };
    kernel_rows(&[]).into_iter().map(row).collect()
}

/// The same over the calibrating loop of that example, with the widest instruction set alone and for a shorter time.
pub fn kernel_ratios() -> Vec<Row> {
    let row = |(case, v): (String, Value)| {
        let ratio = v["calibrations"].as_f64().expect("a ratio");
        Row::new(format!("{case}, ratio"), ratio, "calibrations")
    };
    kernel_rows(&["--short"]).into_iter().map(row).collect()
}

/// What the kernels' example prints, with the names of its cases.
fn kernel_rows(words: &[&str]) -> Vec<(String, Value)> {
    let target = program()
        .parent()
        .and_then(Path::parent)
        .expect("a target folder");
    let output = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .args(["run", "--quiet", "--release", "-p", "plyflow-kernels"])
        .args(["--example", "bench_kernels", "--"])
        .args(words)
        .current_dir(repository())
        .env("CARGO_TARGET_DIR", target)
        .stderr(Stdio::inherit())
        .output()
        .expect("cargo starts");
    assert!(output.status.success(), "the kernels' example failed");
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    let row = |line: &str| {
        let v: Value = serde_json::from_str(line).expect("a JSON row");
        let word = |key: &str| v[key].as_str().unwrap_or_default().to_owned();
        let case = format!(
            "{} {}, {}, {}",
            word("element"),
            word("material"),
            word("part"),
            word("lanes")
        );
        (case, v)
    };
    text.lines().map(row).collect()
}

/// A workflow whose steps are done, to be looked at again.
pub struct NoOp(tempfile::TempDir);

impl NoOp {
    /// With so many steps.
    pub fn of(n: usize) -> Self {
        let folder = fanned_out(n);
        run(folder.path());
        Self(folder)
    }

    /// CPU time of a look (ns).
    pub fn nanoseconds(&self) -> f64 {
        1e9 * least(3, || spent(|| run(self.0.path()))).cpu
    }
}

/// The coarse joggle spar from nothing: cost, rate and energy balance of its global run.
pub fn study() -> Vec<Row> {
    let store = tempfile::tempdir().expect("a temporary folder");
    let workflow = "workflows/joggle-spar/workflow-coarse.yaml";
    let plyflow = |word: &str| {
        let mut command = Command::new(program());
        command
            .args([word, workflow, "--store"])
            .arg(store.path())
            .current_dir(repository());
        command
    };
    let all = spent(|| quiet(plyflow("run").args(["--no-report", "--jobs", "2"])));
    let again = spent(|| quiet(plyflow("run").args(["--no-report", "--jobs", "2"])));
    let results = plyflow("results")
        .args(["--format", "json"])
        .output()
        .expect("plyflow starts");
    let results: Value = serde_json::from_slice(&results.stdout).expect("results in JSON");
    let value = |name: &str| {
        let rows = results["results"].as_array().expect("results");
        let found = rows
            .iter()
            .find(|r| r["step"] == "coarse" && r["result"] == name);
        found.and_then(|r| r["value"].as_f64()).unwrap_or(f64::NAN)
    };
    let mut rate = Row::new(
        "coarse joggle spar, global run",
        1e9 / value("element_cycle_rate"),
        "ns per element-step",
    );
    rate.more = json!({
        "elements": value("elements"), "cycles": value("cycles"),
        "drift_ratio": value("drift_ratio"), "kinetic_ratio": value("kinetic_ratio"),
    });
    vec![
        Row::new("coarse joggle spar, all steps, 2 jobs, wall", all.wall, "s"),
        Row::new("coarse joggle spar, all steps, 2 jobs, CPU", all.cpu, "s"),
        Row::new(
            "coarse joggle spar, second run, wall",
            1e3 * again.wall,
            "ms",
        ),
        rate,
    ]
}
