//! What the core and those who act for it say to each other.

use plyflow_workflow::resolved::FailurePolicy;

/// Number of an instance, in the order of discovery.
pub type Id = usize;

/// Where an instance stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// An input's key or a fan-out is not known yet, so neither is its own key.
    Unkeyed,
    /// Its key is known; whether the store has it is being looked up.
    Looking,
    /// Not in the store; waits for its inputs.
    Waiting,
    /// Waits for cores and memory.
    Ready,
    /// Runs with so many threads.
    Running(u32),
    /// Its artifact is in the store.
    Done {
        /// Found, not run.
        cached: bool,
    },
    /// Its last attempt failed.
    Failed,
    /// Not run because of that instance.
    Skipped(Id),
    /// Not run, or stopped, because the run is being stopped.
    Stopped,
}

impl State {
    /// Nothing further will happen to it.
    pub fn is_final(self) -> bool {
        matches!(
            self,
            Self::Done { .. } | Self::Failed | Self::Skipped(_) | Self::Stopped
        )
    }
}

/// What happened.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Event {
    /// Answer to [`Effect::Look`]: whether the store has the artifact, with the labels of a collection.
    Looked {
        /// Which.
        id: Id,
        /// `Some` when it is there.
        found: Option<Output>,
    },
    /// An instance ran and its artifact is in the store.
    Finished {
        /// Which.
        id: Id,
        /// What it made.
        output: Output,
    },
    /// An attempt failed.
    Failed {
        /// Which.
        id: Id,
    },
    /// A running instance was stopped on request.
    Cancelled {
        /// Which.
        id: Id,
    },
    /// Artifacts that were found turned out not to be what was written: they are not there any more.
    Lost {
        /// The instance that was started and wanted to read them.
        reader: Option<Id>,
        /// Whose they are.
        ids: Vec<Id>,
    },
    /// The user wants the run to stop.
    Interrupt,
}

/// What the core must know of an artifact.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Output {
    /// Labels of a collection's items.
    pub labels: Option<Vec<String>>,
}

/// What is to be done.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Effect {
    /// Look the key up in the store and answer with [`Event::Looked`].
    Look(Id),
    /// Run it and answer with `Finished`, `Failed` or `Cancelled`.
    Start {
        /// Which.
        id: Id,
        /// With how many threads.
        threads: u32,
        /// 1 for the first attempt.
        attempt: u32,
    },
    /// Tell it, while it runs, with how many threads it may go on.
    Lend {
        /// Which.
        id: Id,
        /// Those that it was started with, and cores that nothing else can use now.
        threads: u32,
    },
    /// Stop it; the answer is still awaited.
    Cancel(Id),
    /// It will not run because `cause` did not succeed.
    Skip {
        /// Which.
        id: Id,
        /// The instance that failed.
        cause: Id,
    },
}

/// What the run may use and how it meets failure.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Cores.
    pub cores: u32,
    /// Bytes; 0: not limited.
    pub memory: u64,
    /// What a failure does to the rest.
    pub policy: FailurePolicy,
}

impl Limits {
    /// The bound of memory (bytes; 0: none) of a step that states none: the run's memory in the share that it has of the cores, but
    /// no less than a quarter.
    pub fn memory_of(&self, threads: u32) -> u64 {
        let share = f64::from(threads) / f64::from(self.cores.max(1));
        (self.memory as f64 * share.clamp(0.25, 1.0)) as u64
    }
}
