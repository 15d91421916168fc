//! What the end-to-end tests share: the built program and folders with workflows to run it on.
//!
//! The program is a child process throughout, as for a user; the plugins are those of `tests/faults`.

pub mod crash;
pub mod disk;
pub mod random;
pub mod watch;

use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// `plyflow` of this build profile with all of its own plugins beside it; built on the first call, by the
/// same command as `make build`, so that after that there is nothing to do.
///
/// # Panics
/// When something does not build.
#[must_use]
pub fn program() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let profile = plyflow_faults::folder().parent().expect("a profile folder");
        plyflow_faults::build(profile, &plyflow_faults::shipped());
        profile.join("plyflow")
    })
}

/// The root of the repository.
#[must_use]
pub fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../..")
        .canonicalize()
        .expect("a repository")
}

/// How a run ended, as it tells programs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ended {
    /// Exit code.
    pub code: Option<i32>,
    /// Steps that ran.
    pub executed: u64,
    /// Steps found in the store.
    pub cached: u64,
    /// Steps that failed.
    pub failed: u64,
    /// Steps that were not run because another failed or the run was stopped.
    pub not_run: u64,
}

/// An [`Ended`] with exit code 0 and nothing failed or left out.
#[must_use]
pub fn well(executed: u64, cached: u64) -> Ended {
    Ended {
        code: Some(0),
        executed,
        cached,
        failed: 0,
        not_run: 0,
    }
}

/// A folder with a workflow in it, and its store.
pub struct Study {
    folder: tempfile::TempDir,
}

impl Study {
    /// A study with these steps (and whatever else follows `name:` in a workflow file).
    ///
    /// # Panics
    /// When the folder cannot be written.
    #[must_use]
    pub fn new(workflow: &str) -> Self {
        let study = Self {
            folder: tempfile::tempdir().expect("a temporary folder"),
        };
        study.write(workflow);
        study
    }

    /// Replaces the workflow.
    ///
    /// # Panics
    /// When it cannot be written.
    pub fn write(&self, workflow: &str) {
        let text = format!("plyflow: 1\nname: study\n{workflow}");
        std::fs::write(self.path("workflow.yaml"), text).expect("a workflow file");
    }

    /// A path in the study's folder.
    #[must_use]
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// `plyflow WORDS[0] workflow.yaml WORDS[1..]`, not yet started.
    #[must_use]
    pub fn command(&self, words: &[&str]) -> Command {
        self.command_on("workflow.yaml", words)
    }

    /// `plyflow WORDS[0] FILE WORDS[1..]`, not yet started.
    #[must_use]
    pub fn command_on(&self, file: &str, words: &[&str]) -> Command {
        let mut command = Command::new(program());
        command.arg(words[0]).arg(file).args(&words[1..]);
        command.current_dir(self.folder.path());
        // The study's own folder too: a library that a test builds there is its author's.
        let folders = [plyflow_faults::folder(), self.folder.path()];
        let folders = std::env::join_paths(folders).expect("folders without a colon");
        command.env("PLYFLOW_PLUGINS", folders).stdin(Stdio::null());
        command
    }

    /// Runs a command to its end.
    ///
    /// # Panics
    /// When it does not start.
    #[must_use]
    pub fn call(&self, words: &[&str]) -> Output {
        self.command(words).output().expect("plyflow starts")
    }

    /// Runs the workflow.
    ///
    /// # Panics
    /// When it does not say how it ended.
    #[must_use]
    pub fn run(&self, more: &[&str]) -> Ended {
        let mut words = vec!["run", "--log-format", "json", "--no-report"];
        words.extend(more);
        let output = self.call(&words);
        ended(&output.stderr, output.status)
    }

    /// Starts a run and returns at once; its messages go to the file `run.log`.
    ///
    /// # Panics
    /// When it does not start.
    #[must_use]
    pub fn start(&self, more: &[&str]) -> Child {
        let log = std::fs::File::create(self.path("run.log")).expect("a log");
        let mut command = self.command(&["run", "--log-format", "json", "--no-report"]);
        command.args(more).stdout(Stdio::null()).stderr(log);
        command.spawn().expect("plyflow starts")
    }

    /// What a started run said so far.
    #[must_use]
    pub fn log(&self) -> String {
        std::fs::read_to_string(self.path("run.log")).unwrap_or_default()
    }

    /// The results as `plyflow results --format json` tells them.
    ///
    /// # Panics
    /// When that is no JSON.
    #[must_use]
    pub fn results(&self) -> Value {
        let output = self.call(&["results", "--format", "json"]);
        serde_json::from_slice(&output.stdout).expect("results in JSON")
    }

    /// Values of a result of a step, in the order of its items.
    ///
    /// # Panics
    /// When a value is no number.
    #[must_use]
    pub fn values(&self, step: &str, result: &str) -> Vec<f64> {
        let all = self.results();
        let rows = all["results"].as_array().expect("a list of results");
        let mine = rows
            .iter()
            .filter(|r| r["step"] == step && r["result"] == result);
        mine.map(|r| r["value"].as_f64().expect("a number"))
            .collect()
    }

    /// Every visible artifact: file name and bytes.
    ///
    /// # Panics
    /// When one cannot be read.
    #[must_use]
    pub fn artifacts(&self) -> BTreeMap<String, Vec<u8>> {
        artifacts(&self.path(".plyflow"))
    }
}

/// Every visible artifact of a store: file name and bytes.
///
/// # Panics
/// When one cannot be read.
#[must_use]
pub fn artifacts(store: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for shard in std::fs::read_dir(store.join("artifacts"))
        .into_iter()
        .flatten()
        .flatten()
    {
        for file in std::fs::read_dir(shard.path()).expect("a shard").flatten() {
            let name = file.file_name().into_string().expect("a UTF-8 name");
            if name.ends_with(".vtkhdf") {
                found.insert(name, std::fs::read(file.path()).expect("an artifact"));
            }
        }
    }
    found
}

/// How a run ended, from its messages in JSON.
///
/// # Panics
/// When they do not say.
#[must_use]
pub fn ended(messages: &[u8], status: ExitStatus) -> Ended {
    let text = String::from_utf8_lossy(messages);
    let end = text
        .lines()
        .filter_map(|l| serde_json::from_str::<Value>(l).ok())
        .find(|l| l["event"] == "end")
        .unwrap_or_else(|| panic!("the run does not say how it ended: {text}"));
    let n = |key: &str| end[key].as_u64().expect("a count");
    Ended {
        code: status.code(),
        executed: n("executed"),
        cached: n("cached"),
        failed: n("failed"),
        not_run: n("not_run"),
    }
}

/// Waits for a condition. A loaded machine may take long, so the limit is generous: it is there to end a
/// test that hangs, not to measure.
///
/// # Panics
/// When the condition does not come true within two minutes.
pub fn wait_for(what: &str, mut condition: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !condition() {
        assert!(
            begun.elapsed() < Duration::from_secs(120),
            "waited too long for {what}"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Sends a signal to a child.
///
/// # Panics
/// When there is no such process.
pub fn signal(child: &Child, number: i32) {
    let pid = i32::try_from(child.id()).expect("a process number");
    // SAFETY: numbers alone. A child that has not been waited for: its number is no other's.
    let code = unsafe { libc::kill(pid, number) };
    assert_eq!(code, 0);
}

/// Live worker processes of the engine with this process number.
///
/// # Panics
/// When processes cannot be listed.
#[must_use]
pub fn workers_of(engine: u32) -> usize {
    let mark = format!("--parent\0{engine}\0");
    let processes = std::fs::read_dir("/proc")
        .expect("a list of processes")
        .flatten();
    let lines = processes.filter_map(|p| std::fs::read(p.path().join("cmdline")).ok());
    lines
        .filter(|l| String::from_utf8_lossy(l).contains(&mark))
        .count()
}
