//! What a resolved workflow rests on: as long as that holds, resolving again gives the same.

use crate::catalog::{Catalog, Plugins};
use crate::diagnostics::Problems;
use crate::resolved::{PluginId, ResolvedWorkflow};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_files::open::{self, FileError, MOST_DATA};
use serde::{Deserialize, Serialize};

/// A workflow and what it rests on.
#[derive(Debug, Clone, PartialEq)]
pub struct Resolution {
    /// The workflow.
    pub workflow: ResolvedWorkflow,
    /// What it was resolved from.
    pub evidence: Evidence,
}

/// Everything that a resolution read and asked, besides the overrides and the program itself.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Evidence {
    /// Absolute paths of the files that were read (the workflow, scenes, materials, meshes) with the
    /// BLAKE3 of their bytes, hex.
    files: Vec<(Utf8PathBuf, String)>,
    /// Names in files of which there was none, and the file that has the same name in another form of Unicode.
    forms: Vec<(Utf8PathBuf, Utf8PathBuf)>,
    /// Folders that had to exist.
    folders: Vec<Utf8PathBuf>,
    /// Plugin names or paths, the folder that paths start from, and what the catalog found.
    plugins: Vec<(String, Utf8PathBuf, PluginId)>,
}

impl Evidence {
    pub(crate) fn new(
        problems: &Problems,
        folders: Vec<Utf8PathBuf>,
        plugins: &Plugins<'_>,
    ) -> Self {
        let files = problems.files().iter();
        Self {
            files: files.map(|(p, h)| (p.clone(), h.clone())).collect(),
            forms: problems.forms().to_vec(),
            folders,
            plugins: plugins.answers(),
        }
    }

    /// Whether every file has the same bytes, every folder is there, and the catalog gives the same
    /// libraries. The files are read, not only looked at: a resolution from other bytes must never pass.
    #[must_use]
    pub fn holds(&self, catalog: &dyn Catalog) -> bool {
        let same = |(path, known): &(Utf8PathBuf, String)| {
            hash_file(path).is_ok_and(|hash| hash == *known)
        };
        let means = |(name, known): &(Utf8PathBuf, Utf8PathBuf)| {
            open::in_other_form(name.as_std_path()).is_some_and(|found| found == *known)
        };
        self.files.iter().all(same)
            && self.forms.iter().all(means)
            && self.folders.iter().all(|f| f.is_dir())
            && self.plugins.iter().all(|(name, folder, known)| {
                catalog.find(name, folder).is_ok_and(|e| e.id == *known)
            })
    }
}

/// BLAKE3 of a file of data, hex: what the readers of such files would read.
pub(crate) fn hash_file(path: &Utf8Path) -> Result<String, FileError> {
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(open::open(path.as_std_path(), MOST_DATA)?)?;
    Ok(hasher.finalize().to_hex().to_string())
}

/// BLAKE3 of some bytes, hex.
pub(crate) fn hash(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}
