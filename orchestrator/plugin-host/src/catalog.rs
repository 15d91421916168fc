//! The plugins on a search path.

mod gate;

use self::gate::{looked, needs_consent, read_stranger};
use crate::describe::{Description, describe};
use crate::load::{Plugin, read_manifest};
use crate::supervise::Orphans;
use crate::trust::{Place, Stranger, Trust};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_artifact::seal::{read_document, seal, sealed};
use plyflow_model::manifest::PluginKind;
use plyflow_workflow::{Catalog, CatalogEntry, CatalogError};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::Read;
use std::os::unix::fs::MetadataExt;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

/// Ending of a library's file name.
const SUFFIX: &str = ".so";

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
struct Known {
    stamp: Stamp,
    /// BLAKE3 of the file, hex.
    hash: String,
    description: Description,
}

#[derive(Debug, Default, Serialize, Deserialize)]
struct CacheFile {
    version: u32,
    libraries: BTreeMap<Utf8PathBuf, Known>,
}

#[derive(Debug, Default)]
struct Cache {
    libraries: BTreeMap<Utf8PathBuf, Known>,
    changed: bool,
}

/// Finds plugins in folders and by path. Manifests and hashes are kept in a cache file, so that a run
/// looks at a library only when its file has changed.
#[derive(Debug)]
pub struct PluginCatalog {
    folders: Vec<Utf8PathBuf>,
    cache_file: Option<Utf8PathBuf>,
    describer: Describer,
    cache: Mutex<Cache>,
    scanned: OnceLock<Vec<Found>>,
    trust: Trust,
}

/// A library in a folder of the search path.
#[derive(Debug, Clone)]
enum Found {
    Plugin(Box<CatalogEntry>, Place),
    Broken {
        path: Utf8PathBuf,
        reason: String,
    },
    /// Nothing is known of it, because it may not be loaded.
    Stranger(Stranger),
}

/// What a look at a library gave.
enum Looked {
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

    /// All plugins on the search path, in its order; of two of a name only the first.
    #[must_use]
    pub fn plugins(&self) -> Vec<CatalogEntry> {
        let mut entries: Vec<CatalogEntry> = Vec::new();
        for found in self.scan() {
            if let Found::Plugin(entry, _) = found {
                let same = |e: &CatalogEntry| {
                    e.id.name == entry.id.name && e.manifest.kind == entry.manifest.kind
                };
                if !entries.iter().any(same) {
                    entries.push((**entry).clone());
                }
            }
        }
        entries
    }

    /// Libraries on the search path that are plugins but cannot be used, with the reason.
    #[must_use]
    pub fn broken(&self) -> Vec<(Utf8PathBuf, String)> {
        let broken = |found: &Found| match found {
            Found::Broken { path, reason } => Some((path.clone(), reason.clone())),
            Found::Stranger(library) => {
                let reason = needs_consent("", [library]).to_string();
                Some((library.path.clone(), reason))
            }
            Found::Plugin(entry, place) => {
                let taken = self.taken(entry, *place)?;
                Some((entry.id.path.clone(), taken.to_string()))
            }
        };
        self.scan().iter().filter_map(broken).collect()
    }

    fn scan(&self) -> &[Found] {
        self.scanned.get_or_init(|| {
            let mut found = Vec::new();
            let libraries = self.folders.iter().flat_map(|folder| {
                let place = self.trust.place(&folder.join("lib.so"));
                libraries(folder).into_iter().map(move |path| (path, place))
            });
            for (path, place) in libraries {
                match self.look(&path, place, false) {
                    Looked::Plugin(entry) => found.push(Found::Plugin(entry, place)),
                    Looked::Foreign => {}
                    Looked::Broken(reason) => found.push(Found::Broken { path, reason }),
                    Looked::Stranger(library) => found.push(Found::Stranger(library)),
                }
            }
            self.save();
            found
        })
    }

    fn cache(&self) -> MutexGuard<'_, Cache> {
        self.cache.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What a library is. One that may not be loaded is described by what lies beside it; `ask`: the user may be asked
    /// when nothing does.
    fn look(&self, path: &Utf8Path, place: Place, ask: bool) -> Looked {
        match place {
            Place::Elsewhere => self.look_at_stranger(path, ask),
            Place::Installation | Place::Own => match self.known(path, None) {
                Ok(known) => looked(path, known),
                Err(reason) => Looked::Broken(reason),
            },
        }
    }

    /// Hash and description of a library that may be loaded, from the cache when the file is as it was. `hash`: that of
    /// its bytes, where they have just been read.
    fn known(
        &self,
        path: &Utf8Path,
        hash: Option<String>,
    ) -> Result<(String, Description), String> {
        let stamp = stamp(path).map_err(|e| e.to_string())?;
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
    fn save(&self) {
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
        let temporary = Utf8PathBuf::from(format!("{path}.{}", std::process::id()));
        let written = path
            .parent()
            .map_or(Ok(()), std::fs::create_dir_all)
            .and_then(|()| std::fs::write(&temporary, seal(&serde_json::to_string(&file)?)))
            .and_then(|()| std::fs::rename(&temporary, path));
        if written.is_err() {
            let _ = std::fs::remove_file(&temporary);
        }
        cache.libraries = file.libraries;
        cache.changed = false;
    }
}

impl Catalog for PluginCatalog {
    fn find(
        &self,
        name_or_path: &str,
        relative_to: &Utf8Path,
    ) -> Result<CatalogEntry, CatalogError> {
        let not_found = |searched| CatalogError::NotFound {
            name: name_or_path.into(),
            searched,
        };
        if is_path(name_or_path) {
            let path = relative_to.join(name_or_path);
            let Ok(path) = path.canonicalize_utf8() else {
                return Err(not_found(vec![path]));
            };
            let place = self.trust.place(&path);
            let found = self.look(&path, place, true);
            self.save();
            return match found {
                Looked::Plugin(entry) => match self.taken(&entry, place) {
                    Some(taken) => Err(taken),
                    None => Ok(*entry),
                },
                Looked::Foreign => Err(CatalogError::Broken {
                    path,
                    reason: "it is not a Plyflow plugin: it does not export `plyflow_plugin`"
                        .into(),
                }),
                Looked::Broken(reason) => Err(CatalogError::Broken { path, reason }),
                Looked::Stranger(library) => Err(needs_consent(name_or_path, [&library])),
            };
        }
        self.find_by_name(name_or_path)
    }

    fn names(&self, kind: PluginKind) -> Vec<String> {
        let mut names: Vec<String> = self
            .plugins()
            .into_iter()
            .filter(|e| e.manifest.kind == kind)
            .map(|e| e.id.name)
            .collect();
        names.sort();
        names
    }
}

/// Whether a description can still be used: one that an earlier program kept may break a rule that this one has.
fn is_readable(description: &Description) -> bool {
    match description {
        Description::Plugin(text) => read_manifest(text).is_ok(),
        Description::Foreign(_) | Description::Broken(_) => true,
    }
}

/// Whether a plugin is named by its path.
fn is_path(name: &str) -> bool {
    name.contains('/') || name.ends_with(SUFFIX)
}

/// Whether a library's file name says that it is the plugin of that name.
fn named_like(path: &Utf8Path, name: &str) -> bool {
    let stem = path.file_stem().unwrap_or("");
    let stem = stem.strip_prefix("lib").unwrap_or(stem);
    let name = name.replace('-', "_");
    stem == name
        || stem
            .strip_suffix(&name)
            .is_some_and(|rest| rest.ends_with('_'))
}

/// Library files of a folder, sorted by name; none if the folder cannot be read.
fn libraries(folder: &Utf8Path) -> Vec<Utf8PathBuf> {
    let folder = folder
        .canonicalize_utf8()
        .unwrap_or_else(|_| folder.to_owned());
    let Ok(entries) = folder.read_dir_utf8() else {
        return Vec::new();
    };
    let mut paths: Vec<Utf8PathBuf> = entries
        .flatten()
        .map(camino::Utf8DirEntry::into_path)
        .filter(|p| p.as_str().ends_with(SUFFIX) && p.is_file())
        .collect();
    paths.sort();
    paths
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

/// A component by name on a search path, or by path: loads the libraries whose file names fit. Only in a
/// worker, which may die.
pub(crate) fn find_component_library(
    folders: &[Utf8PathBuf],
    kind: PluginKind,
    name: &str,
) -> Result<Plugin, String> {
    if is_path(name) {
        let path = Utf8Path::new(name);
        let folder = path.canonicalize_utf8().ok();
        let folder = folder.as_deref().and_then(Utf8Path::parent);
        // The engine has asked about the libraries that it knows of; this one it never saw.
        if !folder.is_some_and(|f| folders.iter().any(|known| known == f)) {
            return Err(format!(
                "the {kind} {name} lies in no folder that is trusted, and no parameter of type `{kind}` names it: \
                 it is not loaded"
            ));
        }
        let plugin = Plugin::load(path).map_err(|e| e.to_string())?;
        if plugin.manifest.kind == kind {
            return Ok(plugin);
        }
        return Err(format!(
            "{name} is of kind {}, not {kind}",
            plugin.manifest.kind
        ));
    }
    let mut broken = Vec::new();
    for path in folders
        .iter()
        .flat_map(|f| libraries(f))
        .filter(|p| named_like(p, name))
    {
        match Plugin::load(&path) {
            Ok(p) if p.manifest.kind == kind && p.manifest.name == name => return Ok(p),
            Ok(_) => {}
            Err(e) if e.foreign => {}
            Err(e) => broken.push(e.to_string()),
        }
    }
    if !broken.is_empty() {
        return Err(broken.join("; "));
    }
    let folders: Vec<&str> = folders.iter().map(|f| f.as_str()).collect();
    Err(format!(
        "there is no {kind} '{name}'; searched: {}",
        if folders.is_empty() {
            "no folder".into()
        } else {
            folders.join(", ")
        }
    ))
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
