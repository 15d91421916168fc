//! What is known of libraries: what their files and they themselves say, kept in a cache file.

use super::files::{LOAD_LIMIT, LONGEST_ANSWER, Stamp, answer, read_stranger, stamp};
use super::python::Python;
use crate::breach::Breach;
use crate::describe::{Description, describe};
use crate::load::read_manifest;
use crate::trust::{Place, Stranger, Trust};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_artifact::seal::{read_document, seal, sealed};
use plyflow_artifact::whole;
use plyflow_workflow::CatalogEntry;
use plyflow_workflow::resolved::PluginId;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::os::unix::process::ExitStatusExt;
use std::process::Command;
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

/// Version of the cache file. 2: sealed.
const CACHE_VERSION: u32 = 2;

/// How the manifest of an unknown library is read.
#[derive(Debug, Clone)]
pub enum Describer {
    /// By a child: `program arguments.. LIBRARY` prints a [`Description`]. A library that crashes takes
    /// down only the child.
    Child {
        /// The program, usually `plyflow` itself.
        program: Utf8PathBuf,
        /// Its arguments before the library, e.g. `step-worker --describe`.
        arguments: Vec<String>,
    },
    /// In this process: only for tests and for workers, which may die.
    InProcess,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Known {
    stamp: Stamp,
    /// BLAKE3 of the file, hex.
    pub(super) hash: String,
    pub(super) description: Description,
}

#[derive(Debug, Default, Serialize, Deserialize)]
struct CacheFile {
    version: u32,
    pub(super) libraries: BTreeMap<Utf8PathBuf, Known>,
}

#[derive(Debug, Default)]
pub(super) struct Cache {
    pub(super) libraries: BTreeMap<Utf8PathBuf, Known>,
    changed: bool,
}

/// Finds plugins in folders and by path. Manifests and hashes are kept in a cache file, so that a run
/// looks at a library only when its file has changed.
#[derive(Debug)]
pub struct PluginCatalog {
    pub(super) folders: Vec<Utf8PathBuf>,
    pub(super) cache_file: Option<Utf8PathBuf>,
    pub(super) describer: Describer,
    pub(super) cache: Mutex<Cache>,
    pub(super) scanned: OnceLock<Vec<Found>>,
    pub(super) trust: Trust,
    pub(super) python: Option<Python>,
}

/// A library in a folder of the search path.
#[derive(Debug, Clone)]
pub(super) enum Found {
    Plugin(Box<CatalogEntry>, Place),
    Broken {
        path: Utf8PathBuf,
        reason: String,
    },
    /// Nothing is known of it, because it may not be loaded.
    Stranger(Stranger),
}

/// What a look at a library gave.
pub(super) enum Looked {
    Plugin(Box<CatalogEntry>),
    /// A library that is no plugin.
    Foreign,
    Broken(String),
    Stranger(Stranger),
}

impl PluginCatalog {
    /// A catalog over `folders` (searched in order; the first plugin of a name wins). Nothing is read
    /// before it is needed. A `cache_file` that is absent or damaged counts as empty.
    #[must_use]
    pub fn new(
        folders: Vec<Utf8PathBuf>,
        cache_file: Option<Utf8PathBuf>,
        describer: Describer,
    ) -> Self {
        let libraries = cache_file
            .as_ref()
            .and_then(|path| read_document(path.as_std_path()).ok())
            .and_then(|bytes| serde_json::from_str::<CacheFile>(sealed(&bytes).ok()?).ok())
            .filter(|cache| cache.version == CACHE_VERSION)
            .map(|cache| cache.libraries)
            .unwrap_or_default();
        let cache = Mutex::new(Cache {
            libraries,
            changed: false,
        });
        Self {
            folders,
            cache_file,
            describer,
            cache,
            scanned: OnceLock::new(),
            trust: Trust::everything(),
            python: None,
        }
    }

    /// The folders that are searched.
    #[must_use]
    pub fn folders(&self) -> &[Utf8PathBuf] {
        &self.folders
    }

    pub(super) fn cache(&self) -> MutexGuard<'_, Cache> {
        self.cache.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What is kept of a library that is as it was.
    pub(super) fn described(&self, path: &Utf8Path) -> Option<(String, Description)> {
        let stamp = stamp(path).ok()?;
        let cache = self.cache();
        let known = cache.libraries.get(path);
        let known = known.filter(|k| k.stamp == stamp && is_readable(&k.description))?;
        Some((known.hash.clone(), known.description.clone()))
    }

    /// Hash and description of a library that may be loaded, from the cache when the file is as it was. `hash`: that of
    /// its bytes, where they have just been read.
    pub(super) fn known(
        &self,
        path: &Utf8Path,
        hash: Option<String>,
    ) -> Result<(String, Description), Breach> {
        let stamp = stamp(path)?;
        let kept = self
            .cache()
            .libraries
            .get(path)
            .filter(|k| k.stamp == stamp && is_readable(&k.description))
            .filter(|k| hash.as_ref().is_none_or(|h| *h == k.hash))
            .cloned();
        if let Some(known) = kept {
            return Ok((known.hash, known.description));
        }
        // Between the consent to its bytes and its loading somebody may exchange it.
        let consented = hash.clone();
        let hash = match hash {
            Some(hash) => hash,
            None => read_stranger(path)?.hash,
        };
        let description = self.describe(path, consented.as_deref());
        // A broken library may only lack something that is installed later: ask again.
        if !matches!(description, Description::Broken(_)) {
            let known = Known {
                stamp,
                hash: hash.clone(),
                description: description.clone(),
            };
            let mut cache = self.cache();
            cache.libraries.insert(path.to_owned(), known);
            cache.changed = true;
        }
        Ok((hash, description))
    }

    /// `bytes`: the BLAKE3 that its bytes must have to be loaded.
    fn describe(&self, path: &Utf8Path, bytes: Option<&str>) -> Description {
        let Describer::Child { program, arguments } = &self.describer else {
            return describe(path, bytes);
        };
        let mut command = Command::new(program);
        command.args(arguments).arg(path).args(bytes);
        let (said, status) = match answer(command) {
            Ok((said, Some(status))) => (said, status),
            Ok((_, None)) => {
                return Description::Broken(format!(
                    "loading it had not ended after {} s, or it said more than {} MiB: its initialisers or `plyflow_plugin` hang, \
                     or write to file descriptors that are not theirs",
                    LOAD_LIMIT.as_secs(),
                    LONGEST_ANSWER >> 20
                ));
            }
            Err(e) => return Description::Broken(format!("{program} cannot be started: {e}")),
        };
        if let Ok(description) = serde_json::from_slice(&said) {
            return description;
        }
        let end = match (status.signal(), status.code()) {
            (Some(signal), _) => format!("killed by signal {signal}"),
            (None, Some(code)) => format!("ended with code {code}"),
            (None, None) => "ended".to_owned(),
        };
        Description::Broken(format!(
            "loading it ended the process that tried ({end}): its initialisers or `plyflow_plugin` \
             crash"
        ))
    }

    /// Writes the cache file if something changed. A cache that cannot be written only costs time.
    pub(super) fn save(&self) {
        let Some(path) = &self.cache_file else { return };
        let mut cache = self.cache();
        if !cache.changed {
            return;
        }
        cache.libraries.retain(|path, _| path.exists());
        let libraries = std::mem::take(&mut cache.libraries);
        let file = CacheFile {
            version: CACHE_VERSION,
            libraries,
        };
        let _ = path
            .parent()
            .map_or(Ok(()), std::fs::create_dir_all)
            .and_then(|()| {
                let text = seal(&serde_json::to_string(&file)?);
                whole::write(path.as_std_path(), text.as_bytes())
            });
        cache.libraries = file.libraries;
        cache.changed = false;
    }
}

/// Whether a description can still be used: one that an earlier program kept may break a rule that this one has.
pub(super) fn is_readable(description: &Description) -> bool {
    match description {
        Description::Plugin(text) => read_manifest(text).is_ok(),
        Description::Foreign(_) | Description::Broken(_) => true,
    }
}

pub(super) fn looked(path: &Utf8Path, (hash, description): (String, Description)) -> Looked {
    let text = match description {
        Description::Foreign(_) => return Looked::Foreign,
        Description::Broken(reason) => return Looked::Broken(reason),
        Description::Plugin(text) => text,
    };
    let manifest = match read_manifest(&text) {
        Ok(manifest) => manifest,
        Err(breach) => return Looked::Broken(breach.to_string()),
    };
    let id = PluginId {
        name: manifest.name.clone(),
        version: manifest.version.clone(),
        path: path.to_owned(),
        hash,
    };
    Looked::Plugin(Box::new(CatalogEntry { id, manifest }))
}
