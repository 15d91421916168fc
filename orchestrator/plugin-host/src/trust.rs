//! Whose libraries may be loaded: those of the installation, those on the user's own list, and those that the user
//! consents to. A library runs with all the rights of its user from the moment it is loaded (its constructors), so
//! that one which a stranger's folder brings along is only ever read.

use camino::{Utf8Path, Utf8PathBuf};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::{Mutex, PoisonError};

/// Where a library lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// It came with this program.
    Installation,
    /// In a folder that the user named: on the command line, in the environment, in the list of trust.
    Own,
    /// Anywhere else: in a folder that only a workflow names.
    Elsewhere,
}

/// What the command line says with `--trust`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Consent {
    /// Every library that the workflow names or that lies in its folders.
    All,
    /// The library with these bytes: BLAKE3, hex.
    Bytes(String),
    /// The library at this path, absolute and without links.
    Path(Utf8PathBuf),
}

/// A library that is asked about.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Stranger {
    /// The library.
    pub path: Utf8PathBuf,
    /// BLAKE3 of its bytes, hex.
    pub hash: String,
}

/// Asks the user whether a library may be loaded.
pub type Ask = Box<dyn Fn(&Stranger) -> bool + Send + Sync>;

/// Whose libraries may be loaded.
#[derive(Default)]
pub struct Trust {
    everything: bool,
    installation: Vec<Utf8PathBuf>,
    own: Vec<Utf8PathBuf>,
    bytes: BTreeSet<String>,
    consents: Vec<Consent>,
    ask: Option<Ask>,
    answers: Mutex<BTreeMap<String, bool>>,
}

impl fmt::Debug for Trust {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Trust")
            .field("everything", &self.everything)
            .field("installation", &self.installation)
            .field("own", &self.own)
            .field("bytes", &self.bytes)
            .field("consents", &self.consents)
            .finish_non_exhaustive()
    }
}

impl Trust {
    /// Trusts the folders of the installation and of the user (both with links resolved) and nothing else.
    #[must_use]
    pub fn new(installation: &[Utf8PathBuf], own: &[Utf8PathBuf]) -> Self {
        let real = |folders: &[Utf8PathBuf]| folders.iter().map(|f| real(f)).collect();
        Self {
            installation: real(installation),
            own: real(own),
            ..Self::default()
        }
    }

    /// Trusts every library: for programs that are given nothing by strangers.
    #[must_use]
    pub fn everything() -> Self {
        Self {
            everything: true,
            ..Self::default()
        }
    }

    /// Also trusts libraries with these bytes (BLAKE3, hex).
    #[must_use]
    pub fn with_bytes(mut self, hashes: impl IntoIterator<Item = String>) -> Self {
        self.bytes.extend(hashes);
        self
    }

    /// Also trusts what the command line consents to.
    #[must_use]
    pub fn with_consents(mut self, consents: impl IntoIterator<Item = Consent>) -> Self {
        self.consents.extend(consents);
        self
    }

    /// Asks the user before it refuses.
    #[must_use]
    pub fn with_question(mut self, ask: Ask) -> Self {
        self.ask = Some(ask);
        self
    }

    /// Where a library lies, by the folder that holds it.
    #[must_use]
    pub fn place(&self, library: &Utf8Path) -> Place {
        let Some(folder) = library.parent().map(real) else {
            return Place::Elsewhere;
        };
        if self.installation.contains(&folder) {
            Place::Installation
        } else if self.everything || self.own.contains(&folder) {
            Place::Own
        } else {
            Place::Elsewhere
        }
    }

    /// Whether a library that lies elsewhere may be loaded, without asking.
    #[must_use]
    pub fn allows(&self, library: &Stranger) -> bool {
        let said = |consent: &Consent| match consent {
            Consent::All => true,
            Consent::Bytes(hash) => *hash == library.hash,
            Consent::Path(path) => *path == library.path,
        };
        self.bytes.contains(&library.hash)
            || self.consents.iter().any(said)
            || self.answers().get(&library.hash) == Some(&true)
    }

    /// As [`Trust::allows`], but asks the user where that can be done; once for the same bytes.
    #[must_use]
    pub fn allows_when_asked(&self, library: &Stranger) -> bool {
        if self.allows(library) {
            return true;
        }
        let Some(ask) = &self.ask else { return false };
        if let Some(answer) = self.answers().get(&library.hash) {
            return *answer;
        }
        let answer = ask(library);
        self.answers().insert(library.hash.clone(), answer);
        answer
    }

    fn answers(&self) -> std::sync::MutexGuard<'_, BTreeMap<String, bool>> {
        self.answers.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A path without links, so that folders can be compared.
fn real(path: &Utf8Path) -> Utf8PathBuf {
    path.canonicalize_utf8().unwrap_or_else(|_| path.to_owned())
}

/// The file in which the manifest of a library can be read without loading it: `libx.so` has `libx.manifest.json`.
#[must_use]
pub fn manifest_file(library: &Utf8Path) -> Utf8PathBuf {
    library.with_extension("manifest.json")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stranger(path: &str, hash: &str) -> Stranger {
        Stranger {
            path: path.into(),
            hash: hash.into(),
        }
    }

    #[test]
    fn consent_is_for_the_bytes_or_the_path_that_was_named_and_for_nothing_else() {
        let library = stranger("/there/libx.so", "aa");
        let other = stranger("/there/liby.so", "bb");
        assert!(!Trust::new(&[], &[]).allows(&library));
        assert!(
            Trust::new(&[], &[])
                .with_consents([Consent::All])
                .allows(&other)
        );
        for trust in [
            Trust::new(&[], &[]).with_bytes(["aa".to_owned()]),
            Trust::new(&[], &[]).with_consents([Consent::Bytes("aa".into())]),
            Trust::new(&[], &[]).with_consents([Consent::Path("/there/libx.so".into())]),
        ] {
            assert!(trust.allows(&library) && !trust.allows(&other), "{trust:?}");
        }
    }

    #[test]
    fn a_question_is_asked_once_for_the_same_bytes() {
        let asked = std::sync::Arc::new(Mutex::new(0));
        let count = asked.clone();
        let trust = Trust::new(&[], &[]).with_question(Box::new(move |s| {
            *count.lock().unwrap() += 1;
            s.hash == "aa"
        }));
        for _ in 0..2 {
            assert!(trust.allows_when_asked(&stranger("/x.so", "aa")));
            assert!(!trust.allows_when_asked(&stranger("/y.so", "bb")));
        }
        assert_eq!(*asked.lock().unwrap(), 2);
        assert!(
            trust.allows(&stranger("/elsewhere.so", "aa")),
            "the bytes count"
        );
    }

    #[test]
    fn a_folder_is_the_same_folder_behind_a_link() {
        let dir = tempfile::tempdir().unwrap();
        let root = Utf8Path::from_path(dir.path()).unwrap();
        let (own, link) = (root.join("own"), root.join("link"));
        std::fs::create_dir(&own).unwrap();
        std::os::unix::fs::symlink(&own, &link).unwrap();
        let trust = Trust::new(&[root.to_owned()], std::slice::from_ref(&link));
        assert_eq!(trust.place(&own.join("libx.so")), Place::Own);
        assert_eq!(trust.place(&link.join("libx.so")), Place::Own);
        assert_eq!(trust.place(&root.join("libx.so")), Place::Installation);
        assert_eq!(trust.place(&root.join("more/libx.so")), Place::Elsewhere);
    }

    #[test]
    fn the_manifest_lies_beside_the_library_under_its_name() {
        assert_eq!(manifest_file("/a/libx.so".into()), "/a/libx.manifest.json");
    }
}
