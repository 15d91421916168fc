//! The points that an optimisation has asked for, kept for other commands.

use crate::store::{RunFolder, Store};
use camino::Utf8Path;
use plyflow_study::Value;
use plyflow_study::optimise::Search;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The points that an optimisation has asked for, as they are kept beside the journal of a workflow. A run needs none of it: it asks anew.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct Kept {
    /// Names the search.
    pub digest: String,
    /// Whether the method has nothing more to ask.
    pub settled: bool,
    /// What the points took (CPU, s).
    pub cpu_seconds: f64,
    /// What steps took that failed (CPU, s), by their keys: the store has no record of them.
    #[serde(default)]
    pub failed: BTreeMap<String, f64>,
    /// Texts of the values.
    pub points: Vec<Vec<String>>,
}

impl Kept {
    /// What is kept of the search with this digest, if anything is.
    pub fn read(folder: &RunFolder, digest: &str) -> Option<Self> {
        let path = folder.root.join("asked.json");
        let bytes = plyflow_files::open::read(path.as_std_path(), plyflow_files::open::MOST_NOTED);
        let kept: Self = serde_json::from_slice(&bytes.ok()?).ok()?;
        (kept.digest == digest).then_some(kept)
    }

    /// Keeps it.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub fn write(&self, folder: &RunFolder) -> std::io::Result<()> {
        let path = folder.root.join("asked.json");
        std::fs::create_dir_all(&folder.root)?;
        plyflow_artifact::whole::write(path.as_std_path(), &serde_json::to_vec(self)?)
    }
}

/// The points that an optimisation asked for when it ran last.
pub fn asked_before(
    root: &Utf8Path,
    workflow: &str,
    digest: &str,
    search: &Search,
) -> Option<Vec<Vec<Value>>> {
    let folder = Store::new(root.to_owned()).run(workflow);
    let kept = Kept::read(&folder, digest)?;
    kept.points.iter().map(|p| search.read(p)).collect()
}
