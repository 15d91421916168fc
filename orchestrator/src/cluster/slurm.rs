//! What is asked of Slurm: the only place that calls its commands. All requests of a run together are bounded, so that no controller
//! suffers from it.

use camino::{Utf8Path, Utf8PathBuf};
use rustix::fs::MemfdFlags;
use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, Read, Seek};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Requests to the controller in a minute, at most.
pub const MOST_REQUESTS: usize = 10;
/// Of these, what is kept for other requests than where allocations stand.
const FOR_OTHERS: usize = 3;
const MINUTE: Duration = Duration::from_secs(60);
/// How long a command may take before its answer is unknown.
const PATIENCE: Duration = Duration::from_secs(30);

/// An allocation as Slurm sees it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Row {
    /// Number of its job: of the array, if it is of one.
    pub job: String,
    /// Index in its array; 0 of none.
    pub index: u32,
    /// Name of its job.
    pub name: String,
    /// State: `RUNNING`.
    pub state: String,
    /// Why it is in this state: `Priority`.
    pub reason: String,
    /// Nodes.
    pub nodes: String,
}

impl Row {
    /// Whether nothing of it runs or will run.
    pub fn has_ended(&self) -> bool {
        !matches!(
            self.state.as_str(),
            "PENDING"
                | "RUNNING"
                | "CONFIGURING"
                | "COMPLETING"
                | "SUSPENDED"
                | "STOPPED"
                | "SIGNALING"
                | "STAGE_OUT"
                | "RESIZING"
                | "REQUEUED"
                | "REQUEUE_HOLD"
                | "REQUEUE_FED"
                | "SPECIAL_EXIT"
                | "RESV_DEL_HOLD"
        )
    }

    fn parse(line: &str) -> Option<Self> {
        let mut words = line.split('|');
        let mut next = || words.next().map(|w| w.trim().to_owned());
        let (job, index, name) = (next()?, next()?, next()?);
        let (state, reason, nodes) = (next()?, next()?, next()?);
        if !job.bytes().all(|b| b.is_ascii_digit()) || job.is_empty() {
            return None;
        }
        Some(Self {
            job,
            index: index.parse().unwrap_or(0),
            name,
            state,
            reason,
            nodes,
        })
    }
}

/// What became of a submission.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Submitted {
    /// It is queued, under this number.
    Job(String),
    /// A limit on what one may queue is reached: later.
    Later(String),
    /// Slurm will never take it.
    Refused(String),
    /// Nobody knows: it may be queued.
    Unknown(String),
}

/// What a partition gives, as far as it is told. Slurm accepts jobs beyond some of it and lets them wait for ever.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Limits {
    /// The partition.
    pub partition: String,
    /// Longest wall-clock time (s); `None`: no limit, or not known.
    pub seconds: Option<u64>,
    /// Cores of its largest node.
    pub cores: Option<u32>,
    /// Memory of its largest node (MiB).
    pub memory: Option<u64>,
    /// Whether a node has GPUs.
    pub gpus: Option<bool>,
    /// One more than the largest index of an array.
    pub array: Option<u32>,
}

/// Why the limits of a partition are not known.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NoLimits {
    /// There is no such partition; with those that there are.
    #[error("there is no partition '{0}'; there are: {1}")]
    NoPartition(String, String),
    /// Slurm did not answer.
    #[error("{0}")]
    Silent(String),
}

/// A question that is under way.
struct Asked {
    child: Child,
    out: File,
    err: File,
    since: Instant,
}

impl Asked {
    fn begin(program: &str, words: &[&str]) -> io::Result<Self> {
        let memory =
            || rustix::fs::memfd_create("plyflow-slurm", MemfdFlags::CLOEXEC).map(File::from);
        let (out, err) = (memory()?, memory()?);
        let child = Command::new(program)
            .args(words)
            .stdin(Stdio::null())
            .stdout(out.try_clone()?)
            .stderr(err.try_clone()?)
            .spawn()
            .map_err(|e| io::Error::new(e.kind(), format!("{program}: {e}")))?;
        let since = Instant::now();
        Ok(Self {
            child,
            out,
            err,
            since,
        })
    }

    /// The answer, when there is one: standard output, or what the command complained of.
    fn answer(&mut self) -> Option<Result<String, String>> {
        let text = |mut file: &File| {
            let mut bytes = Vec::new();
            let _ = file.rewind().and_then(|()| file.read_to_end(&mut bytes));
            String::from_utf8_lossy(&bytes).trim().to_owned()
        };
        match self.child.try_wait() {
            Ok(None) if self.since.elapsed() < PATIENCE => None,
            Ok(Some(status)) if status.success() => Some(Ok(text(&self.out))),
            Ok(Some(status)) => {
                let said = text(&self.err);
                Some(Err(if said.is_empty() {
                    status.to_string()
                } else {
                    said
                }))
            }
            Ok(None) => {
                let _ = (self.child.kill(), self.child.wait());
                Some(Err(format!("no answer in {} s", PATIENCE.as_secs())))
            }
            Err(e) => Some(Err(e.to_string())),
        }
    }

    fn wait(mut self) -> Result<String, String> {
        loop {
            if let Some(answer) = self.answer() {
                return answer;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }
}

fn call(program: &str, words: &[&str]) -> Result<String, String> {
    Asked::begin(program, words)
        .map_err(|e| e.to_string())?
        .wait()
}

/// Slurm, as its commands tell it.
pub struct Slurm {
    /// Where its commands lie, when not on the search path.
    folder: Option<Utf8PathBuf>,
    /// Requests in a minute, at most.
    most: usize,
    asked: VecDeque<Instant>,
    looking: Option<Asked>,
    no_accounting: bool,
}

impl Default for Slurm {
    fn default() -> Self {
        Self {
            folder: None,
            most: MOST_REQUESTS,
            asked: VecDeque::new(),
            looking: None,
            no_accounting: false,
        }
    }
}

impl Slurm {
    /// One whose commands lie in a folder, and which takes so many requests in a minute.
    pub fn in_folder(folder: &Utf8Path, most: usize) -> Self {
        Self {
            folder: Some(folder.to_owned()),
            most,
            ..Self::default()
        }
    }

    fn command(&self, name: &str) -> String {
        let found = self.folder.as_ref().map(|f| f.join(name).into_string());
        found.unwrap_or_else(|| name.to_owned())
    }

    /// Whether another request may be made now.
    pub fn may_ask(&mut self) -> bool {
        while self.asked.front().is_some_and(|at| at.elapsed() >= MINUTE) {
            self.asked.pop_front();
        }
        self.asked.len() < self.most
    }

    /// Whether it may be asked where things stand: some requests are left for what cannot wait.
    pub fn may_look(&mut self) -> bool {
        self.may_ask() && self.asked.len() + FOR_OTHERS < self.most
    }

    fn count(&mut self) {
        self.asked.push_back(Instant::now());
    }

    /// Submits a script.
    pub fn submit(&mut self, script: &Utf8Path) -> Submitted {
        self.count();
        match call(&self.command("sbatch"), &["--parsable", script.as_str()]) {
            // Some sites put text around the number.
            Ok(text) => match text.lines().find_map(job_number) {
                Some(job) => Submitted::Job(job),
                None => Submitted::Unknown(format!("sbatch told no number: {text}")),
            },
            Err(text) => refused(text),
        }
    }

    /// Begins to ask where allocations of these names stand, unless that is being asked already.
    pub fn begin_look(&mut self, names: &[String]) -> bool {
        if self.looking.is_some() {
            return false;
        }
        self.count();
        let names = format!("--name={}", names.join(","));
        let words = [
            "--noheader",
            "--array",
            "--states=all",
            &names,
            "--format=%F|%K|%j|%T|%r|%N",
        ];
        self.looking = Asked::begin(&self.command("squeue"), &words).ok();
        true
    }

    /// The answer to what [`Slurm::begin_look`] has asked, once; `Err`: it is not known where they stand.
    pub fn looked(&mut self) -> Option<Result<Vec<Row>, String>> {
        let answer = self.looking.as_mut()?.answer()?;
        self.looking = None;
        Some(answer.map(|text| text.lines().filter_map(Row::parse).collect()))
    }

    /// As [`Slurm::begin_look`] and [`Slurm::looked`] at once.
    ///
    /// # Errors
    /// When Slurm does not answer: it is not known where they stand.
    pub fn look(&mut self, names: &[String]) -> Result<Vec<Row>, String> {
        self.begin_look(names);
        loop {
            if let Some(answer) = self.looked() {
                return answer;
            }
            if self.looking.is_none() {
                return Err("squeue cannot be started".into());
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// The last state of an allocation that the controller has forgotten, if there is accounting. That is probed once.
    pub fn last_state(&mut self, job: &str, index: u32) -> Option<Row> {
        if self.no_accounting || !self.may_ask() {
            return None;
        }
        self.count();
        let format = "--format=JobID,JobName,State,NodeList";
        let words = [
            "--noheader",
            "--parsable2",
            "--allocations",
            "-j",
            job,
            format,
        ];
        let Ok(text) = call(&self.command("sacct"), &words) else {
            self.no_accounting = true;
            return None;
        };
        text.lines()
            .find_map(|line| of_accounting(line, job, index))
    }

    /// Takes what still waits out of the queue; or all, with `running`.
    ///
    /// # Errors
    /// What `scancel` complained of.
    pub fn cancel(&mut self, jobs: &[String], running: bool) -> Result<(), String> {
        if jobs.is_empty() {
            return Ok(());
        }
        self.count();
        let mut words: Vec<&str> = jobs.iter().map(String::as_str).collect();
        if !running {
            words.insert(0, "--state=PENDING");
        }
        call(&self.command("scancel"), &words).map(drop)
    }

    /// What a partition gives; the default one when none is named.
    ///
    /// # Errors
    /// When there is no such partition, or Slurm does not answer.
    pub fn limits(&mut self, partition: Option<&str>) -> Result<Limits, NoLimits> {
        self.count();
        let text = call(
            &self.command("scontrol"),
            &["--oneliner", "show", "partition"],
        )
        .map_err(NoLimits::Silent)?;
        let is_wanted = |line: &&str| match partition {
            Some(name) => field(line, "PartitionName") == Some(name),
            None => field(line, "Default") == Some("YES"),
        };
        let Some(line) = text.lines().find(is_wanted) else {
            let there: Vec<&str> = text
                .lines()
                .filter_map(|l| field(l, "PartitionName"))
                .collect();
            let name = partition.unwrap_or("(default)").to_owned();
            return Err(NoLimits::NoPartition(name, there.join(", ")));
        };
        let name = field(line, "PartitionName").unwrap_or_default().to_owned();
        let number = |key| field(line, key).and_then(|t| t.parse::<u64>().ok());
        let mut limits = Limits {
            seconds: field(line, "MaxTime").and_then(seconds),
            partition: name.clone(),
            ..Limits::default()
        };
        self.count();
        let of = format!("--partition={name}");
        if let Ok(nodes) = call(
            &self.command("sinfo"),
            &["--noheader", "--exact", &of, "--format=%c|%m|%G"],
        ) {
            largest_node(&nodes, &mut limits);
        }
        let less = |a: Option<u64>, b: Option<u64>| a.into_iter().chain(b).min();
        limits.cores =
            less(limits.cores.map(u64::from), number("MaxCPUsPerNode")).map(|n| n as u32);
        limits.memory = less(limits.memory, number("MaxMemPerNode"));
        self.count();
        if let Ok(config) = call(&self.command("scontrol"), &["show", "config"]) {
            let line = config.lines().find(|l| l.starts_with("MaxArraySize"));
            let value = line.and_then(|l| l.split('=').nth(1));
            limits.array = value.and_then(|t| t.trim().parse().ok());
        }
        Ok(limits)
    }
}

/// Of lines `cores|memory|gres`.
fn largest_node(text: &str, limits: &mut Limits) {
    let mut gpus = false;
    for line in text.lines() {
        let mut words = line.split('|');
        let mut number = || -> Option<u64> {
            let word = words.next()?.trim().trim_end_matches('+');
            word.parse().ok()
        };
        let (cores, memory) = (number(), number());
        limits.cores = limits.cores.max(cores.map(|n| n as u32));
        limits.memory = limits.memory.max(memory);
        gpus |= words.next().is_some_and(|g| g.contains("gpu"));
    }
    limits.gpus = limits.cores.is_some().then_some(gpus);
}

/// The value of `KEY=value` in a line of many.
fn field<'t>(line: &'t str, key: &str) -> Option<&'t str> {
    line.split_whitespace()
        .find_map(|word| word.strip_prefix(key)?.strip_prefix('='))
}

/// Seconds of `days-hours:minutes:seconds`; `None` of `UNLIMITED`.
fn seconds(text: &str) -> Option<u64> {
    let (days, rest) = text.split_once('-').unwrap_or(("0", text));
    let mut total = 0;
    for part in rest.split(':') {
        total = total * 60 + part.parse::<u64>().ok()?;
    }
    Some(days.parse::<u64>().ok()? * 86_400 + total)
}

/// `123` or `123;cluster` at the end of a line.
fn job_number(line: &str) -> Option<String> {
    let word = line.split_whitespace().last()?.split(';').next()?;
    let is_number = !word.is_empty() && word.bytes().all(|b| b.is_ascii_digit());
    is_number.then(|| word.to_owned())
}

fn of_accounting(line: &str, job: &str, index: u32) -> Option<Row> {
    let mut words = line.split('|');
    let (id, name, state, nodes) = (words.next()?, words.next()?, words.next()?, words.next()?);
    if id != job && id != format!("{job}_{index}") {
        return None;
    }
    Some(Row {
        job: job.to_owned(),
        index,
        name: name.to_owned(),
        // `CANCELLED by 1000`
        state: state.split_whitespace().next()?.to_owned(),
        reason: String::new(),
        nodes: nodes.to_owned(),
    })
}

/// What it means that `sbatch` failed, by its words.
fn refused(text: String) -> Submitted {
    let lower = text.to_lowercase();
    let has = |words: &[&str]| words.iter().any(|w| lower.contains(w));
    if has(&[
        "job submit limit",
        "maxsubmit",
        "qosmax",
        "assocmax",
        "assocgrp",
        "too many jobs",
        "slurm temporarily unable to accept job",
    ]) {
        Submitted::Later(text)
    } else if has(&[
        "unable to contact",
        "socket timed out",
        "connection refused",
        "communication",
        "no answer in",
        "timed out",
        "zero bytes",
        "transport endpoint",
        "unexpected message",
    ]) {
        Submitted::Unknown(text)
    } else {
        Submitted::Refused(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_sbatch_says_tells_later_from_never_from_unknown() {
        let said = |t: &str| refused(t.into());
        let text = "sbatch: error: Batch job submission failed: Job violates accounting/QOS policy (job submit limit, user's size and/or time limits)";
        assert!(matches!(said(text), Submitted::Later(_)));
        for text in [
            "sbatch: error: Batch job submission failed: Unable to contact slurm controller (connect failure)",
            "sbatch: error: Batch job submission failed: Socket timed out on send/recv operation",
        ] {
            assert!(matches!(said(text), Submitted::Unknown(_)), "{text}");
        }
        let text = "sbatch: error: Batch job submission failed: Invalid partition name specified";
        assert!(matches!(said(text), Submitted::Refused(_)));
    }

    #[test]
    fn numbers_are_found_with_text_around_them() {
        assert_eq!(job_number("123"), Some("123".into()));
        assert_eq!(job_number("123;cluster"), Some("123".into()));
        assert_eq!(job_number("Submitted batch job 77"), Some("77".into()));
        assert_eq!(job_number("Welcome to the cluster"), None);
        assert_eq!(Row::parse("Welcome|to|the|cluster|of|x"), None);
        let row = Row::parse("12|3|plyflow-a-1|RUNNING|None|n1").unwrap();
        assert_eq!((row.index, row.has_ended()), (3, false));
        let row = Row::parse("12|N/A|plyflow-a-1|TIMEOUT|TimeLimit|n1").unwrap();
        assert_eq!((row.index, row.has_ended()), (0, true));
    }

    #[test]
    fn limits_are_those_of_the_largest_node() {
        let mut limits = Limits::default();
        largest_node("4|4000|(null)\n16+|64000+|gpu:a100:4\n", &mut limits);
        assert_eq!(
            (limits.cores, limits.memory, limits.gpus),
            (Some(16), Some(64_000), Some(true))
        );
        assert_eq!(seconds("1-00:10:00"), Some(87_000));
        assert_eq!(seconds("UNLIMITED"), None);
        let row = of_accounting("7_2|n|CANCELLED by 0|n2", "7", 2).unwrap();
        assert_eq!(
            (row.state.as_str(), row.nodes.as_str()),
            ("CANCELLED", "n2")
        );
    }

    #[test]
    fn no_more_than_ten_requests_are_made_in_a_minute() {
        let mut slurm = Slurm::default();
        let made = (0..100).take_while(|_| {
            let may = slurm.may_ask();
            if may {
                slurm.count();
            }
            may
        });
        assert_eq!(made.count(), MOST_REQUESTS);
    }
}
