//! What outlives a killed attempt of a step: a folder for the plugin, and what the step has cost so far.

use crate::emitter::Emitter;
use crate::process;
use camino::Utf8Path;
use plyflow_artifact::seal::{BrokenSeal, read_document, seal, sealed};
use plyflow_artifact::whole;
use plyflow_model::job::{self, Cost, LogLevel};
use serde::{Deserialize, Serialize};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::Instant;

/// The cost up to the last checkpoint, beside the plugin's files.
const COST: &str = "plyflow-cost.json";

/// What is noted of an instance: sealed, and with the name of its folder, so that another's note does not pass for it.
#[derive(Serialize, Deserialize)]
struct Noted {
    of: String,
    cost: Cost,
}

fn name(folder: &Utf8Path) -> &str {
    folder.file_name().unwrap_or_default()
}

/// Why a noted cost is not one.
#[derive(Debug, thiserror::Error)]
enum CostError {
    #[error(transparent)]
    Io(#[from] std::io::Error),
    #[error(transparent)]
    Seal(#[from] BrokenSeal),
    #[error(transparent)]
    Form(#[from] serde_json::Error),
    #[error("it is of another step or key")]
    Other,
}

fn read_cost(folder: &Utf8Path) -> Result<Cost, CostError> {
    let bytes = read_document(folder.join(COST).as_std_path())?;
    let noted: Noted = serde_json::from_str(sealed(&bytes)?)?;
    match noted.of == name(folder) {
        true => Ok(noted.cost),
        false => Err(CostError::Other),
    }
}

/// What a step that was stopped has cost up to its last checkpoint in this folder; `None` when there is none, or when it is damaged.
pub fn cost_so_far(folder: &Utf8Path) -> Option<Cost> {
    read_cost(folder).ok()
}

/// Whether the note of what a step has cost so far is there and damaged, in words.
pub fn damaged_cost(folder: &Utf8Path) -> Option<String> {
    let path = folder.join(COST);
    let there = path.symlink_metadata().is_ok();
    let why = read_cost(folder).err().filter(|_| there)?;
    Some(format!("{path}: {why}"))
}

/// Checkpoints of the running step.
pub(crate) struct Checkpoints<'a> {
    job: Option<&'a job::Checkpoints>,
    folder: OnceLock<String>,
    started: Instant,
    last: Mutex<Instant>,
    /// What earlier attempts cost up to the checkpoint that this one may go on from.
    earlier: OnceLock<Cost>,
}

impl<'a> Checkpoints<'a> {
    pub(crate) fn new(job: Option<&'a job::Checkpoints>) -> Self {
        let now = Instant::now();
        Self {
            job,
            folder: OnceLock::new(),
            started: now,
            last: Mutex::new(now),
            earlier: OnceLock::new(),
        }
    }

    /// The folder, made on the first call; empty when nothing is kept.
    pub(crate) fn folder(&self, emitter: &Emitter<'_>) -> &str {
        self.folder.get_or_init(|| {
            let Some(job) = self.job else {
                return String::new();
            };
            if let Err(e) = std::fs::create_dir_all(&job.folder) {
                let text = format!(
                    "no checkpoints are kept: the folder {} cannot be made: {e}",
                    job.folder
                );
                emitter.log(LogLevel::Warn, &text);
                return String::new();
            }
            let earlier = read_cost(&job.folder);
            let is_new = || {
                let mut files = job.folder.read_dir_utf8().into_iter().flatten();
                files.next().is_none()
            };
            if let Err(e) = &earlier
                && !is_new()
            {
                let text = format!(
                    "what earlier attempts cost up to their last checkpoint is not known ({COST}: {e}): the cost that is told is \
                     that of this attempt alone"
                );
                emitter.log(LogLevel::Warn, &text);
            }
            let _ = self.earlier.set(earlier.unwrap_or_default());
            job.folder.to_string()
        })
    }

    /// Whether enough time has passed since the last one.
    pub(crate) fn due(&self) -> bool {
        let last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        // Whoever asks for the folder only when a checkpoint is due has none yet.
        let kept = self.folder.get().is_none_or(|f| !f.is_empty());
        kept && (self.job).is_some_and(|j| last.elapsed().as_secs_f64() >= j.interval)
    }

    /// Notes the cost so far.
    pub(crate) fn saved(&self, emitter: &Emitter<'_>) {
        let Some(job) = self.job else { return };
        *self.last.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
        let cost = self.with_earlier(Cost {
            wall_seconds: self.started.elapsed().as_secs_f64(),
            cpu_seconds: process::cpu_seconds(),
            peak_memory: process::peak_memory(),
            threads: 0,
        });
        let noted = Noted {
            of: name(&job.folder).to_owned(),
            cost,
        };
        let written = serde_json::to_string(&noted).map_err(std::io::Error::from);
        // Under a name of its own until it is whole: an earlier attempt may still write here, too.
        let file = job.folder.join(COST);
        let written =
            written.and_then(|text| whole::write(file.as_std_path(), seal(&text).as_bytes()));
        if let Err(e) = written {
            let text = format!("{}: the cost so far cannot be noted: {e}", job.folder);
            emitter.log(LogLevel::Debug, &text);
        }
    }

    /// A cost of this attempt with that of the earlier ones.
    pub(crate) fn with_earlier(&self, cost: Cost) -> Cost {
        let earlier = self.earlier.get().copied().unwrap_or_default();
        Cost {
            wall_seconds: cost.wall_seconds + earlier.wall_seconds,
            cpu_seconds: cost.cpu_seconds + earlier.cpu_seconds,
            peak_memory: cost.peak_memory.max(earlier.peak_memory),
            threads: cost.threads,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_later_attempt_adds_the_cost_up_to_the_last_checkpoint() {
        let place = tempfile::tempdir().unwrap();
        let folder = camino::Utf8PathBuf::from_path_buf(place.path().join("label/key")).unwrap();
        let job = |interval| job::Checkpoints {
            folder: folder.clone(),
            interval,
        };
        let cost = |wall, cpu, peak_memory| Cost {
            wall_seconds: wall,
            cpu_seconds: cpu,
            peak_memory,
            threads: 2,
        };
        let mut out = Vec::new();
        let emitter = Emitter::new(&mut out);
        let none = Checkpoints::new(None);
        assert_eq!((none.folder(&emitter), none.due()), ("", false));

        let often = job(0.0);
        let first = Checkpoints::new(Some(&often));
        assert!(first.due(), "before anyone has asked where to write to");
        assert_eq!(first.folder(&emitter), folder.as_str());
        assert!(first.due());
        assert_eq!(first.with_earlier(cost(1.0, 2.0, 5)), cost(1.0, 2.0, 5));
        assert_eq!(cost_so_far(&often.folder), None);
        first.saved(&emitter);

        let rarely = job(3600.0);
        let second = Checkpoints::new(Some(&rarely));
        second.folder(&emitter);
        assert!(!second.due());
        let noted = *second.earlier.get().unwrap();
        assert_eq!(cost_so_far(&often.folder), Some(noted));
        assert!(noted.wall_seconds > 0.0 && noted.cpu_seconds > 0.0 && noted.peak_memory > 0);
        let sum = second.with_earlier(cost(1.0, 2.0, 5));
        assert_eq!(sum.wall_seconds, 1.0 + noted.wall_seconds);
        assert_eq!(sum.cpu_seconds, 2.0 + noted.cpu_seconds);
        assert_eq!((sum.peak_memory, sum.threads), (noted.peak_memory, 2));
        // The note of another step or key is none of this one, nor is a damaged one.
        let other = folder.with_file_name("other");
        std::fs::create_dir(&other).unwrap();
        std::fs::copy(folder.join(COST), other.join(COST)).unwrap();
        assert_eq!(cost_so_far(&other), None);
        assert!(damaged_cost(&other).unwrap().contains("another"));
        assert_eq!(damaged_cost(&folder), None);
        let whole = std::fs::read(folder.join(COST)).unwrap();
        for bit in (0..8 * whole.len()).step_by(23) {
            let mut bytes = whole.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            std::fs::write(other.join(COST), bytes).unwrap();
            assert_eq!(cost_so_far(&other), None, "bit {bit}");
        }
        // A third attempt has the cost of both.
        second.saved(&emitter);
        let third = Checkpoints::new(Some(&rarely));
        third.folder(&emitter);
        assert!(third.earlier.get().unwrap().cpu_seconds > noted.cpu_seconds);
    }
}
