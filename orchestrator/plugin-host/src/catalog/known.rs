//! What is known of libraries: what their files and they themselves say, kept in a cache file.

use crate::breach::Breach;
use crate::describe::{Description, describe};
use crate::load::{hash_of, read_manifest};
use crate::supervise::Orphans;
use crate::trust::{Place, Stranger, Trust};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_artifact::seal::{read_document, seal, sealed};
use plyflow_artifact::whole;
use plyflow_workflow::CatalogEntry;
use plyflow_workflow::resolved::PluginId;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::Read;
use std::os::unix::fs::MetadataExt;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

/// How long a library may take to load and describe itself.
const LOAD_LIMIT: Duration = Duration::from_secs(30);

/// Most bytes that a library may say of itself: what a plugin's manifest takes, many times over.
const LONGEST_ANSWER: u64 = 16 << 20;

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

/// What tells one version of a library file from another, without reading it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct Stamp {
    size: u64,
    modified: i64,
    modified_ns: i64,
    changed: i64,
    changed_ns: i64,
    inode: u64,
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

/// Runs a command to its end: its standard output and its status, or no status when it had to be killed after
/// [`LOAD_LIMIT`] or [`LONGEST_ANSWER`].
fn answer(mut command: Command) -> std::io::Result<(Vec<u8>, Option<ExitStatus>)> {
    let mut child = command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .process_group(0)
        .spawn()?;
    let mut pipe = child.stdout.take().expect("piped above");
    let (send, receive) = std::sync::mpsc::channel();
    // A reader of its own, because the pipe alone tells when the child has ended.
    std::thread::spawn(move || {
        let mut said = Vec::new();
        let read = (&mut pipe).take(LONGEST_ANSWER).read_to_end(&mut said);
        let whole = read.is_ok() && said.len() < LONGEST_ANSWER as usize;
        let _ = send.send(whole.then_some(said));
    });
    match receive.recv_timeout(LOAD_LIMIT) {
        Ok(Some(said)) => Ok((said, Some(child.wait()?))),
        // One that goes on to talk is stopped as one that hangs.
        Ok(None) | Err(_) => {
            // What the library started goes too, also where it has left the group.
            if let Ok(group) = libc::pid_t::try_from(child.id()) {
                // SAFETY: numbers alone. The group of a child that has not been waited for: its number is no other's.
                unsafe { libc::kill(-group, libc::SIGKILL) };
            }
            child.kill()?;
            child.wait()?;
            Orphans::end(&[]);
            Ok((Vec::new(), None))
        }
    }
}

fn stamp(path: &Utf8Path) -> std::io::Result<Stamp> {
    let m = std::fs::metadata(path)?;
    Ok(Stamp {
        size: m.size(),
        modified: m.mtime(),
        modified_ns: m.mtime_nsec(),
        changed: m.ctime(),
        changed_ns: m.ctime_nsec(),
        inode: m.ino(),
    })
}

/// The path and the hash of a library's bytes.
pub(super) fn read_stranger(path: &Utf8Path) -> Result<Stranger, Breach> {
    if !path.is_file() {
        return Err(Breach::Missing);
    }
    Ok(Stranger {
        path: path.to_owned(),
        hash: hash_of(path)?,
    })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_without_end_is_cut_off_and_its_command_killed() {
        let shell = |text: &str| {
            let mut command = Command::new("sh");
            command.args(["-c", text]);
            answer(command).unwrap()
        };
        let (said, status) = shell("echo short");
        assert_eq!(
            (said.as_slice(), status.and_then(|s| s.code())),
            (&b"short\n"[..], Some(0))
        );
        let begun = std::time::Instant::now();
        let (said, status) = shell("yes");
        assert!(said.is_empty() && status.is_none());
        assert!(begun.elapsed() < LOAD_LIMIT / 2);
    }
}
