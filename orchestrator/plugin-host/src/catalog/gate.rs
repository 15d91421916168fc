//! The gate before libraries that are not trusted: what is known of them without loading them, and what they may not take.

use super::files::read_stranger;
use super::known::{Looked, PluginCatalog, is_readable, looked};
use super::python;
use crate::breach::Breach;
use crate::describe::Description;
use crate::load::read_manifest;
use crate::trust::{Place, Stranger, Trust, manifest_file};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_workflow::CatalogError;
use plyflow_workflow::resolved::PluginId;
use std::io;

/// Longest manifest that is read from beside a library (bytes).
const LONGEST_MANIFEST: u64 = 4 << 20;

/// Why the manifest beside a library is of no use.
#[derive(Debug, thiserror::Error)]
#[error("its manifest {file} cannot be used: {why}")]
struct BesideError {
    file: Utf8PathBuf,
    why: Unusable,
}

#[derive(Debug, thiserror::Error)]
enum Unusable {
    #[error("expected a plain file of at most {} KiB", LONGEST_MANIFEST / 1024)]
    NoFile,
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error(transparent)]
    Breach(#[from] Breach),
}

impl PluginCatalog {
    /// Loads only what this trust allows (without it: every library). Of the others only what stands beside them is
    /// read ([`manifest_file`]).
    #[must_use]
    pub fn gated(mut self, trust: Trust) -> Self {
        self.trust = trust;
        self
    }

    /// Those folders of the search path whose libraries may be loaded whatever their bytes, without links.
    #[must_use]
    pub fn trusted_folders(&self) -> Vec<Utf8PathBuf> {
        let real = |f: &Utf8PathBuf| f.canonicalize_utf8().unwrap_or_else(|_| f.clone());
        let folders = self.folders.iter().map(real);
        folders
            .filter(|f| self.trust.place(&f.join("lib.so")) != Place::Elsewhere)
            .collect()
    }

    /// Whether a library may be loaded to run a step: by where it lies, or by the bytes that it has now. Whoever kept
    /// its path and hash in a file is not believed.
    ///
    /// # Errors
    /// [`CatalogError::NeedsConsent`], or [`CatalogError::Broken`] when it cannot be read.
    pub fn admit(&self, id: &PluginId) -> Result<(), CatalogError> {
        if self.place(&id.path) != Place::Elsewhere {
            return Ok(());
        }
        if let Some(answer) = self.admit_python(id) {
            return answer;
        }
        let library = read_stranger(&id.path).map_err(|breach| CatalogError::Broken {
            path: id.path.clone(),
            reason: breach.to_string(),
        })?;
        if !self.trust.allows_when_asked(&library) {
            return Err(needs_consent(&id.name, [&library]));
        }
        // The workflow may have been checked by what lies beside the library, before this consent: now it can say itself what it is.
        let now = self.look_at_stranger(&id.path, false);
        self.save();
        match now {
            Looked::Broken(reason) => Err(CatalogError::Broken {
                path: id.path.clone(),
                reason,
            }),
            _ => Ok(()),
        }
    }

    /// What a library is. One that may not be loaded is described by what lies beside it; `ask`: the user may be asked
    /// when nothing does.
    pub(super) fn look(&self, path: &Utf8Path, place: Place, ask: bool) -> Looked {
        if path.as_str().ends_with(python::SUFFIX) {
            return self.look_at_python(path, place, ask);
        }
        match place {
            Place::Elsewhere => self.look_at_stranger(path, ask),
            Place::Installation | Place::Own => match self.known(path, None) {
                Ok(known) => looked(path, known),
                Err(breach) => Looked::Broken(breach.to_string()),
            },
        }
    }

    fn look_at_stranger(&self, path: &Utf8Path, ask: bool) -> Looked {
        let library = match read_stranger(path) {
            Ok(library) => library,
            Err(e) => return Looked::Broken(e.to_string()),
        };
        let beside = match manifest_beside(path) {
            Ok(text) => text,
            Err(e) => return Looked::Broken(e.to_string()),
        };
        let hash = library.hash.clone();
        if !self.trust.allows(&library) {
            // Of the same bytes: from a time when they were allowed to describe themselves.
            let before = self.cache().libraries.get(path).cloned();
            let before = before.filter(|k| k.hash == hash && is_readable(&k.description));
            let described = match (before, &beside) {
                (Some(known), _) => Some(known.description),
                (None, Some(text)) => Some(Description::Plugin(text.clone())),
                (None, None) => None,
            };
            if let Some(description) = described {
                return looked(path, (hash, description));
            }
            if !ask || !self.trust.allows_when_asked(&library) {
                return Looked::Stranger(library);
            }
        }
        let known = match self.known(path, Some(hash)) {
            Ok(known) => known,
            Err(e) => return Looked::Broken(e.to_string()),
        };
        if let (Some(beside), Description::Plugin(own)) = (beside, &known.1)
            && read_manifest(&beside) != read_manifest(own)
        {
            return Looked::Broken(format!(
                "{} says something else of it than the library itself; remove that file; then \
                 `plyflow plugins --trust {path} --write-manifest` writes it anew",
                manifest_file(path)
            ));
        }
        looked(path, known)
    }
}

/// The manifest that lies beside a library, if one does.
fn manifest_beside(library: &Utf8Path) -> Result<Option<String>, BesideError> {
    let file = manifest_file(library);
    let wrong = |why: Unusable| BesideError {
        file: file.clone(),
        why,
    };
    match std::fs::metadata(&file) {
        Err(_) => return Ok(None),
        Ok(m) if !m.is_file() || m.len() > LONGEST_MANIFEST => {
            return Err(wrong(Unusable::NoFile));
        }
        Ok(_) => {}
    }
    let text = std::fs::read_to_string(&file).map_err(|e| wrong(e.into()))?;
    read_manifest(&text).map_err(|e| wrong(e.into()))?;
    Ok(Some(text))
}

pub(super) fn needs_consent<'a>(
    name: &str,
    libraries: impl IntoIterator<Item = &'a Stranger>,
) -> CatalogError {
    let libraries = libraries.into_iter();
    CatalogError::NeedsConsent {
        name: name.into(),
        libraries: libraries
            .map(|l| (l.path.clone(), l.hash.clone()))
            .collect(),
    }
}
