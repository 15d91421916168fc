//! The gate before libraries that are not trusted: what is known of them without loading them, and what they may not take.

use super::{Found, Looked, PluginCatalog, is_readable, named_like};
use crate::describe::Description;
use crate::load::{hash_of, read_manifest};
use crate::trust::{Place, Stranger, Trust, manifest_file};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_workflow::resolved::PluginId;
use plyflow_workflow::{Catalog, CatalogEntry, CatalogError};

/// Longest manifest that is read from beside a library (bytes).
const LONGEST_MANIFEST: u64 = 4 << 20;

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
        if self.trust.place(&id.path) != Place::Elsewhere {
            return Ok(());
        }
        let library = read_stranger(&id.path).map_err(|reason| CatalogError::Broken {
            path: id.path.clone(),
            reason,
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

    /// A plugin that has the name of one that is trusted more, with other bytes: which of them is meant nobody can know.
    pub(super) fn taken(&self, entry: &CatalogEntry, place: Place) -> Option<CatalogError> {
        let owner = self.owner(&entry.id.name, place)?;
        (owner.id.hash != entry.id.hash).then(|| CatalogError::Taken {
            name: entry.id.name.clone(),
            owner: owner.id.path.clone(),
            other: entry.id.path.clone(),
        })
    }

    /// The plugin of a name that is trusted more than those of a place.
    fn owner(&self, name: &str, than: Place) -> Option<&CatalogEntry> {
        let places = match than {
            Place::Installation => &[][..],
            Place::Own => &[Place::Installation][..],
            Place::Elsewhere => &[Place::Installation, Place::Own][..],
        };
        places.iter().find_map(|wanted| {
            self.scan().iter().find_map(|found| match found {
                Found::Plugin(e, place) if place == wanted && e.id.name == name => Some(&**e),
                _ => None,
            })
        })
    }

    pub(super) fn look_at_stranger(&self, path: &Utf8Path, ask: bool) -> Looked {
        let library = match read_stranger(path) {
            Ok(library) => library,
            Err(reason) => return Looked::Broken(reason),
        };
        let beside = match manifest_beside(path) {
            Ok(text) => text,
            Err(reason) => return Looked::Broken(reason),
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
            Err(reason) => return Looked::Broken(reason),
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

    pub(super) fn find_by_name(&self, name: &str) -> Result<CatalogEntry, CatalogError> {
        let mut strangers = Vec::new();
        for found in self.scan() {
            match found {
                Found::Plugin(entry, place) if entry.id.name == name => {
                    return match self.taken(entry, *place) {
                        Some(taken) => Err(taken),
                        None => Ok((**entry).clone()),
                    };
                }
                Found::Broken { path, reason } if named_like(path, name) => {
                    return Err(CatalogError::Broken {
                        path: path.clone(),
                        reason: reason.clone(),
                    });
                }
                Found::Stranger(library) if named_like(&library.path, name) => {
                    // It comes before a plugin of that name: to take either without a word would be wrong.
                    if let Some(owner) = self.owner(name, Place::Elsewhere) {
                        return Err(CatalogError::Taken {
                            name: name.into(),
                            owner: owner.id.path.clone(),
                            other: library.path.clone(),
                        });
                    }
                    match self.find(library.path.as_str(), Utf8Path::new("/")) {
                        Ok(entry) if entry.id.name != name => {}
                        answer => return answer,
                    }
                }
                Found::Stranger(library) => strangers.push(library),
                _ => {}
            }
        }
        if strangers.is_empty() {
            return Err(CatalogError::NotFound {
                name: name.into(),
                searched: self.folders.clone(),
            });
        }
        Err(needs_consent(name, strangers))
    }
}

/// The path and the hash of a library's bytes.
pub(super) fn read_stranger(path: &Utf8Path) -> Result<Stranger, String> {
    if !path.is_file() {
        return Err("there is no such file".into());
    }
    Ok(Stranger {
        path: path.to_owned(),
        hash: hash_of(path).map_err(|e| e.to_string())?,
    })
}

/// The manifest that lies beside a library, if one does.
fn manifest_beside(library: &Utf8Path) -> Result<Option<String>, String> {
    let file = manifest_file(library);
    let wrong = |why: String| format!("its manifest {file} cannot be used: {why}");
    match std::fs::metadata(&file) {
        Err(_) => return Ok(None),
        Ok(m) if !m.is_file() || m.len() > LONGEST_MANIFEST => {
            return Err(wrong(format!(
                "expected a plain file of at most {} KiB",
                LONGEST_MANIFEST / 1024
            )));
        }
        Ok(_) => {}
    }
    let text = std::fs::read_to_string(&file).map_err(|e| wrong(e.to_string()))?;
    read_manifest(&text).map_err(wrong)?;
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

pub(super) fn looked(path: &Utf8Path, (hash, description): (String, Description)) -> Looked {
    let text = match description {
        Description::Foreign(_) => return Looked::Foreign,
        Description::Broken(reason) => return Looked::Broken(reason),
        Description::Plugin(text) => text,
    };
    let manifest = match read_manifest(&text) {
        Ok(manifest) => manifest,
        Err(reason) => return Looked::Broken(reason),
    };
    let id = PluginId {
        name: manifest.name.clone(),
        version: manifest.version.clone(),
        path: path.to_owned(),
        hash,
    };
    Looked::Plugin(Box::new(CatalogEntry { id, manifest }))
}
