//! What a session tells whoever shows it.

use super::core::{Core, Id};
use camino::Utf8PathBuf;
use plyflow_model::job::{LogLevel, Progress, Record};

/// Something to show.
#[derive(Debug)]
pub enum Update<'a> {
    /// Found in the store.
    Cached,
    /// What the store had of it is not what was written; it is made again.
    Damaged {
        /// What is wrong and where it is kept, in words.
        what: &'a str,
    },
    /// A worker is being started.
    Started {
        /// Threads it may use.
        threads: u32,
        /// 1 for the first attempt.
        attempt: u32,
    },
    /// How far it is.
    Progress(&'a Progress),
    /// It says something.
    Log {
        /// Level.
        level: LogLevel,
        /// Text.
        text: &'a str,
    },
    /// Its artifact is in the store.
    Finished(&'a Record),
    /// An attempt failed.
    Failed {
        /// What the user reads.
        reason: &'a str,
        /// Whether it is tried again.
        again: bool,
    },
    /// It was stopped because the run is being stopped.
    Stopped,
    /// It will not run because another instance failed.
    Skipped {
        /// That instance.
        cause: Id,
    },
}

/// Shows a run.
pub trait Observer {
    /// Something happened to instance `id`.
    fn update(&mut self, core: &Core<'_>, id: Id, update: &Update<'_>);
    /// Time has passed.
    fn tick(&mut self) {}
    /// Nothing more comes.
    fn end(&mut self) {}
}

/// An instance that failed for good.
#[derive(Debug, Clone)]
pub struct Failure {
    /// Its label.
    pub label: String,
    /// What the user reads.
    pub reason: String,
    /// Log of its worker, when it wrote one.
    pub log: Option<Utf8PathBuf>,
}

/// How a run ended.
#[derive(Debug, Default)]
pub struct Summary {
    /// Instances that ran.
    pub executed: usize,
    /// Instances found in the store.
    pub cached: usize,
    /// Instances that failed, the first first.
    pub failures: Vec<Failure>,
    /// Instances not run because another failed or the run was stopped.
    pub skipped: usize,
    /// Whether the user stopped it.
    pub interrupted: bool,
    /// Instances whose artifacts turned out to be damaged.
    pub damaged: usize,
}

impl Summary {
    /// Takes up how a further round of the same run ended.
    pub fn add(&mut self, round: Self) {
        self.executed += round.executed;
        self.cached += round.cached;
        self.failures.extend(round.failures);
        self.skipped = round.skipped;
        self.interrupted |= round.interrupted;
        self.damaged += round.damaged;
    }
}
