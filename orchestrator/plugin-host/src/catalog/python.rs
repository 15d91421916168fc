//! Plugins in Python: a library is made of the file, by the interpreter, and kept in a folder of the user's own. From then on it is a library
//! as any other (`docs/decisions/0059`).

use super::files::{Stamp, answer_within, stamp};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_artifact::whole;
use serde::{Deserialize, Serialize};
use std::process::Command;
use std::time::Duration;

/// Ending of the name of a plugin in Python.
pub(super) const SUFFIX: &str = ".py";

/// What the interpreter does first: it forgets the folder where one happens to stand, in which anything may lie, and takes the package `plyflow`
/// alone from the folder that the first word names. That folder may be the `site-packages` of another interpreter, with a numpy that is not
/// this one's.
const BEGIN: &str = "import sys, importlib.util as u; sys.path[:] = [p for p in sys.path if p]; f = sys.argv.pop(1) + '/plyflow'; \
    s = u.spec_from_file_location('plyflow', f + '/__init__.py', submodule_search_locations=[f]); \
    sys.modules['plyflow'] = m = u.module_from_spec(s); s.loader.exec_module(m); from plyflow._plugin import main; main()";

/// By these words a file in a folder of plugins is known to be one: no other is ever run.
const MARKS: [&str; 2] = ["@plyflow.step(", "@plyflow.law("];

/// How long a library stays that was made of an earlier text of a file.
const KEPT_FOR: Duration = Duration::from_secs(30 * 24 * 3600);

/// How long a library may take to be made. A law is compiled for two kinds of processors, which takes some seconds on a quiet machine.
const MAKE_LIMIT: Duration = Duration::from_secs(180);

/// Version of the notes on what was made.
const NOTE_VERSION: u32 = 1;

/// By what plugins in Python are made.
#[derive(Debug, Clone)]
pub struct Python {
    /// The interpreter: a path, or a name that the system looks for.
    pub interpreter: String,
    /// The folder that holds the package `plyflow`; `None`: it did not come with this program.
    pub package: Option<Utf8PathBuf>,
    /// The library of which that of a step is a copy; `None`: this installation has none.
    pub bridge: Option<Utf8PathBuf>,
    /// Where what is made is kept: a folder that only the user can write to. `None`: the system names none.
    pub folder: Option<Utf8PathBuf>,
}

/// What the interpreter says of what it made.
#[derive(Deserialize)]
#[serde(untagged)]
enum Made {
    Library {
        library: Utf8PathBuf,
        watch: Vec<Utf8PathBuf>,
    },
    Error {
        error: String,
    },
}

/// What was made of a file, and what that rests on.
#[derive(Serialize, Deserialize)]
struct Note {
    version: u32,
    interpreter: String,
    source: Utf8PathBuf,
    library: Utf8PathBuf,
    /// The library comes last.
    stamps: Vec<(Utf8PathBuf, Stamp)>,
}

/// Why no library can be made.
#[derive(Debug, thiserror::Error)]
pub(super) enum NotMade {
    #[error(
        "this installation lacks what plugins in Python need: the package `plyflow` or the library that carries steps. Install Plyflow from its wheel, \
         or run it from the tree in which it was built"
    )]
    Incomplete,
    #[error(
        "there is no place for what is made of it: expected an absolute path in XDG_CACHE_HOME or HOME"
    )]
    NoFolder,
    #[error(
        "the interpreter {0} cannot be started: {1}. Install Python 3.9 or later, or name one in PLYFLOW_PYTHON"
    )]
    NoInterpreter(String, std::io::Error),
    #[error("{0} had not imported it, and made a library of it, after 180 s")]
    Hangs(String),
    #[error(
        "{0} ended without an answer; does it have numpy? `{0} -c 'import numpy'` tells. PLYFLOW_PYTHON names another interpreter"
    )]
    Silent(String),
    #[error("{0}")]
    Refused(String),
    #[error("{0}: {1}")]
    Io(Utf8PathBuf, std::io::Error),
}

impl Python {
    /// The note on what was made of a file.
    fn note(&self, folder: &Utf8Path, source: &Utf8Path) -> Utf8PathBuf {
        let hash = blake3::hash(format!("{}\0{source}", self.interpreter).as_bytes()).to_hex();
        folder.join(format!("{}.json", &hash[..24]))
    }

    /// What was made of it before, if all that this rests on is as it was.
    pub(super) fn kept(&self, folder: &Utf8Path, source: &Utf8Path) -> Option<Utf8PathBuf> {
        let text = std::fs::read(self.note(folder, source)).ok()?;
        let note: Note = serde_json::from_slice(&text).ok()?;
        let same = note.version == NOTE_VERSION
            && note.interpreter == self.interpreter
            && note.source == source;
        let as_it_was =
            |(path, then): &(Utf8PathBuf, Stamp)| stamp(path).is_ok_and(|now| now == *then);
        (same && note.stamps.iter().all(as_it_was)).then_some(note.library)
    }

    pub(super) fn make(&self, source: &Utf8Path) -> Result<Utf8PathBuf, NotMade> {
        let bridge = self.bridge.as_ref().ok_or(NotMade::Incomplete)?;
        let package = self.package.as_ref().ok_or(NotMade::Incomplete)?;
        let folder = self.folder.as_ref().ok_or(NotMade::NoFolder)?;
        if let Some(library) = self.kept(folder, source) {
            return Ok(library);
        }
        private(folder).map_err(|e| NotMade::Io(folder.clone(), e))?;
        let mut command = Command::new(&self.interpreter);
        command.args(["-B", "-c", BEGIN]).arg(package).arg(source);
        command
            .arg("--into")
            .arg(folder)
            .arg("--bridge")
            .arg(bridge);
        command.env("PYTHONHASHSEED", "0");
        // What the environment says of packages does not decide what a plugin does.
        for name in ["PYTHONPATH", "PYTHONHOME", "PYTHONSTARTUP"] {
            command.env_remove(name);
        }
        let interpreter = || self.interpreter.clone();
        let (said, status) = answer_within(MAKE_LIMIT, command)
            .map_err(|e| NotMade::NoInterpreter(interpreter(), e))?;
        status.ok_or_else(|| NotMade::Hangs(interpreter()))?;
        let made: Made =
            serde_json::from_slice(&said).map_err(|_| NotMade::Silent(interpreter()))?;
        let (library, mut watch) = match made {
            Made::Library { library, watch } => (library, watch),
            Made::Error { error } => return Err(NotMade::Refused(error)),
        };
        watch.push(library.clone());
        // A change between the making and this look would pass unseen: what is made holds the text that it was made of, and so says what ran.
        let stamps: Result<Vec<_>, _> = watch
            .into_iter()
            .map(|path| match stamp(&path) {
                Ok(stamp) => Ok((path, stamp)),
                Err(e) => Err(NotMade::Io(path, e)),
            })
            .collect();
        let note = Note {
            version: NOTE_VERSION,
            interpreter: interpreter(),
            source: source.to_owned(),
            library: library.clone(),
            stamps: stamps?,
        };
        // One that cannot be written only costs time, but for the consent, which rests on `origin`.
        let text = serde_json::to_string(&note).unwrap_or_default();
        let failed = |e| NotMade::Io(folder.clone(), e);
        whole::write(self.note(folder, source).as_std_path(), text.as_bytes()).map_err(failed)?;
        clear(folder);
        Ok(library)
    }

    /// The files of which a library in the folder was made; none where it lies elsewhere.
    pub(super) fn origins(&self, library: &Utf8Path) -> Vec<Utf8PathBuf> {
        let Some(folder) = self.folder.as_ref().filter(|f| library.starts_with(f)) else {
            return Vec::new();
        };
        let notes = notes(folder).into_iter();
        let of_it = notes.filter(|note| note.library == library);
        of_it.map(|note| note.source).collect()
    }
}

/// All notes on what was made.
fn notes(folder: &Utf8Path) -> Vec<Note> {
    let entries = folder.read_dir_utf8().into_iter().flatten().flatten();
    let files = entries.filter(|e| e.path().extension() == Some("json"));
    files
        .filter_map(|e| serde_json::from_slice(&std::fs::read(e.path()).ok()?).ok())
        .collect()
}

/// Removes libraries that no note names any more, each edit of a file having made one. A run that began with one may load it still, so those
/// of the last month stay.
fn clear(folder: &Utf8Path) {
    let named: Vec<Utf8PathBuf> = notes(folder).into_iter().map(|n| n.library).collect();
    let entries = folder.read_dir_utf8().into_iter().flatten().flatten();
    for entry in entries.filter(|e| e.path().is_dir()) {
        let place = entry.path();
        let used = named.iter().any(|library| library.starts_with(place));
        let modified = std::fs::metadata(place).and_then(|m| m.modified()).ok();
        let age = modified.and_then(|t| t.elapsed().ok());
        if !used && age.is_some_and(|a| a > KEPT_FOR) {
            let _ = std::fs::remove_dir_all(place);
        }
    }
}

/// Makes the folder, and sees to it that nobody else writes there: what lies in it is loaded.
fn private(folder: &Utf8Path) -> std::io::Result<()> {
    use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
    std::fs::DirBuilder::new()
        .recursive(true)
        .mode(0o700)
        .create(folder)?;
    let meta = std::fs::metadata(folder)?;
    // SAFETY: a number.
    let me = unsafe { libc::geteuid() };
    if meta.uid() != me || meta.permissions().mode() & 0o022 != 0 {
        let text = "others than you can write there; expected a folder of yours with `chmod go-w`";
        return Err(std::io::Error::other(text));
    }
    Ok(())
}

/// Whether a file of a folder of plugins is one.
pub(super) fn is_marked(path: &Utf8Path) -> bool {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    MARKS.iter().any(|mark| text.contains(mark))
}
