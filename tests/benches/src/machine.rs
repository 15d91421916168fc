//! What a row says of the machine: its class, never its name.

use plyflow_e2e::repository;
use std::path::PathBuf;
use std::process::Command;

/// Class of a machine, and what was measured on it.
pub struct Class {
    /// Processor model.
    pub cpu: String,
    /// Threads that this process may use.
    pub threads: usize,
    /// Commit; `+` when the tree has changes.
    pub commit: String,
}

/// This machine.
pub fn class() -> Class {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = info.lines().find(|l| l.starts_with("model name"));
    let cpu = model
        .and_then(|l| l.split(':').nth(1))
        .map_or("unknown", str::trim)
        .to_owned();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    Class {
        cpu,
        threads,
        commit: commit(),
    }
}

fn git(words: &[&str]) -> Option<String> {
    let output = Command::new("git")
        .args(words)
        .current_dir(repository())
        .output()
        .ok()?;
    output
        .status
        .success()
        .then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

fn commit() -> String {
    let Some(head) = git(&["rev-parse", "--short=10", "HEAD"]) else {
        return "unknown".into();
    };
    let clean =
        git(&["status", "--porcelain", "--untracked-files=no"]).is_some_and(|s| s.is_empty());
    if clean { head } else { head + "+" }
}

/// The file for rows of a class.
pub fn record_file(class: &Class) -> PathBuf {
    let plain = |c: char| {
        if c.is_ascii_alphanumeric() {
            c.to_ascii_lowercase()
        } else {
            '-'
        }
    };
    let slug: String = class.cpu.chars().map(plain).collect();
    let words: Vec<&str> = slug.split('-').filter(|w| !w.is_empty()).collect();
    let name = format!("{}-{}-threads.jsonl", words.join("-"), class.threads);
    repository().join("docs/benchmarks").join(name)
}
