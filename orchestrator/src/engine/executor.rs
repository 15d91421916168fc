//! Where jobs run. The engine hands over self-contained jobs and hears back in reports; it never assumes
//! that a job is a child process or even on this machine.

use crate::advice;
use camino::Utf8PathBuf;
use plyflow_model::job::{FailureKind, Job, Message, Record};
use std::io;
use std::time::Duration;

/// A job for an executor.
#[derive(Debug)]
pub struct Task {
    /// The engine's number of the instance.
    pub id: usize,
    /// The job.
    pub job: Job,
    /// Wall-clock limit (s); 0: none.
    pub time_limit: f64,
    /// Where the worker's log goes; made only when there is something to write.
    pub log: Utf8PathBuf,
}

/// How a job ended.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Outcome {
    /// Artifact and record are whole under their temporary names.
    Done(Box<Record>),
    /// The worker said what failed.
    Failed {
        /// Why.
        kind: FailureKind,
        /// Text for the user.
        message: String,
    },
    /// The worker was killed by a signal, by name: `SIGSEGV`.
    Signal(String),
    /// The worker ended with this status without saying how it went.
    Silent(i32),
    /// It was stopped at its time limit (s).
    TimedOut(f64),
    /// It was stopped on request.
    Cancelled,
    /// It could not be started.
    NotStarted(String),
}

impl Outcome {
    /// Why it ended so, in words for the user.
    pub fn reason(&self) -> String {
        match self {
            Self::Done(_) => "done".into(),
            Self::Failed {
                kind: FailureKind::Panic,
                message,
            } => format!("the plugin panicked: {message}"),
            Self::Failed {
                kind: FailureKind::Malformed,
                message,
            } => {
                format!("malformed artifact: {message}")
            }
            Self::Failed { message, .. } => message.clone(),
            Self::Signal(name) => {
                let hint = match name.as_str() {
                    "SIGSEGV" | "SIGBUS" | "SIGILL" | "SIGFPE" | "SIGABRT" => {
                        "; the defect is in the plugin or a library it uses"
                    }
                    "SIGKILL" => "; perhaps the machine ran out of memory",
                    _ => "",
                };
                format!("the worker crashed: {name}{hint}")
            }
            Self::Silent(code) => {
                format!("the worker ended with status {code} without saying how it went")
            }
            Self::TimedOut(limit) => format!(
                "stopped at its time limit of {limit} s; raise `resources: {{time_limit: ..}}` of the step if it needs longer"
            ),
            Self::Cancelled => "stopped".into(),
            Self::NotStarted(text) => format!("the worker could not be started: {text}"),
        }
    }
}

/// The class of a failure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FailureClass {
    /// The step said what failed.
    Error,
    /// The plugin panicked.
    Panic,
    /// What the plugin wrote is no artifact of its kind.
    Malformed,
    /// The worker died.
    Crash,
    /// It was stopped at its time limit.
    TimeLimit,
    /// The machine failed: nothing is told of the step.
    Machine,
}

impl FailureClass {
    /// The class by the reason that the user reads ([`Outcome::reason`]), which is what a journal keeps of it.
    pub fn of(reason: &str) -> Self {
        let classes = [
            ("the plugin panicked", Self::Panic),
            ("malformed artifact", Self::Malformed),
            ("the worker crashed", Self::Crash),
            ("the worker ended", Self::Crash),
            ("the worker could not be started", Self::Machine),
            ("the artifact cannot be put into the store", Self::Machine),
            ("stopped at its time limit", Self::TimeLimit),
        ];
        // An optimisation takes a failure for an answer and never asks again: a full disk, a kill from outside, or what was exchanged in
        // the middle of a run must not be one, however the step told it.
        let outside = [
            "the worker crashed: SIGKILL",
            "the worker was told to stop from outside",
            "since this run began; run again",
            "its input cannot be kept",
        ];
        if advice::on(reason).is_some() || outside.iter().any(|words| reason.contains(words)) {
            return Self::Machine;
        }
        let found = classes.iter().find(|(begin, _)| reason.starts_with(begin));
        found.map_or(Self::Error, |(_, class)| *class)
    }
}

/// In a word, as in the table of a study.
impl std::fmt::Display for FailureClass {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Error => "error",
            Self::Panic => "panic",
            Self::Malformed => "malformed",
            Self::Crash => "crash",
            Self::TimeLimit => "time-limit",
            Self::Machine => "machine",
        })
    }
}

/// What an executor reports.
#[derive(Debug)]
pub enum Report {
    /// A line from the worker (progress or log).
    Message {
        /// Which.
        id: usize,
        /// The line.
        message: Message,
    },
    /// The job ended; nothing more comes from it.
    Ended {
        /// Which.
        id: usize,
        /// How.
        outcome: Outcome,
    },
}

/// A place where jobs run.
pub trait Executor {
    /// Takes a job. A job that cannot be started is reported as [`Outcome::NotStarted`].
    fn submit(&mut self, task: Task);

    /// Waits until something can be reported, the timeout passes or the user interrupts; appends to `out`.
    ///
    /// # Errors
    /// When the executor itself is broken; jobs' troubles are reports.
    fn wait(&mut self, timeout: Option<Duration>, out: &mut Vec<Report>) -> io::Result<()>;

    /// Asks a job to stop; `now`: without grace. Its end is still reported.
    fn cancel(&mut self, id: usize, now: bool);

    /// Tells a job that runs with how many threads it may go on. Nothing depends on it: an executor that has no word for it leaves jobs with
    /// those that they were started with.
    fn lend(&mut self, _id: usize, _threads: u32) {}

    /// Where the artifact and the record of a job lie that has ended well, when that is not where its [`Task`] says.
    fn files(&mut self, _id: usize) -> Option<(Utf8PathBuf, Utf8PathBuf)> {
        None
    }

    /// What steps have taken that ended without an artifact, since this was asked for (s): the time of the cores that were given to them.
    /// `None` where their processes are of this machine, which knows better.
    fn lost_seconds(&mut self) -> Option<f64> {
        None
    }

    /// Nothing more will be submitted.
    fn close(&mut self) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_came_from_outside_tells_nothing_of_a_step() {
        let full = std::io::Error::from_raw_os_error(libc::ENOSPC);
        let stopped = Outcome::Failed {
            kind: FailureKind::Cancelled,
            message: "the worker was told to stop from outside".into(),
        };
        for reason in [
            format!("field 'x' of body 'ply': the host refused: {full}"),
            format!("malformed artifact: {full}"),
            Outcome::Signal("SIGKILL".into()).reason(),
            stopped.reason(),
            "the plugin /a.so has changed since this run began; run again, and what is finished is kept".into(),
            "its input cannot be kept: made again 2 times in this run".into(),
        ] {
            assert_eq!(FailureClass::of(&reason), FailureClass::Machine, "{reason}");
        }
    }

    #[test]
    fn a_failure_has_the_class_of_how_it_ended() {
        let failed = |kind| Outcome::Failed {
            kind,
            message: "m".into(),
        };
        for (outcome, class) in [
            (failed(FailureKind::Error), "error"),
            (failed(FailureKind::Panic), "panic"),
            (failed(FailureKind::Malformed), "malformed"),
            (Outcome::Signal("SIGSEGV".into()), "crash"),
            (Outcome::Silent(3), "crash"),
            (Outcome::TimedOut(2.0), "time-limit"),
            (Outcome::NotStarted("m".into()), "machine"),
        ] {
            let found = FailureClass::of(&outcome.reason()).to_string();
            assert_eq!(found, class, "{outcome:?}");
        }
    }
}
