//! The plugins on a search path.

mod files;
mod gate;
mod known;
mod made;
mod python;

pub use known::{Describer, PluginCatalog};
pub use python::Python;

use crate::breach::{Breach, ComponentError};
use crate::load::Plugin;
use crate::trust::Place;
use camino::{Utf8Path, Utf8PathBuf};
use gate::needs_consent;
use known::{Found, Looked};
use plyflow_model::manifest::PluginKind;
use plyflow_workflow::{Catalog, CatalogEntry, CatalogError};

/// Ending of a library's file name.
const SUFFIX: &str = ".so";

/// Beginning of the names of libraries that carry what is written in Python: with nothing to carry they are no plugins.
pub const CARRIERS: &str = "libplyflow_python_";

impl PluginCatalog {
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

    /// Plugins in Python of a folder.
    fn in_python(&self, folder: &Utf8Path) -> Vec<Utf8PathBuf> {
        let mut paths = match self.python {
            Some(_) => files(folder, python::SUFFIX),
            None => Vec::new(),
        };
        paths.retain(|p| python::is_marked(p));
        paths
    }

    fn scan(&self) -> &[Found] {
        self.scanned.get_or_init(|| {
            let mut found = Vec::new();
            let libraries = self.folders.iter().flat_map(|folder| {
                let place = self.trust.place(&folder.join("lib.so"));
                let files = libraries(folder).into_iter().chain(self.in_python(folder));
                files.map(move |path| (path, place))
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

    /// A plugin that has the name of one that is trusted more, with other bytes: which of them is meant nobody can know.
    fn taken(&self, entry: &CatalogEntry, place: Place) -> Option<CatalogError> {
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

    fn find_by_name(&self, name: &str) -> Result<CatalogEntry, CatalogError> {
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
            let place = self.place(&path);
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

/// Whether a plugin is named by its path.
fn is_path(name: &str) -> bool {
    name.contains('/') || name.ends_with(SUFFIX) || name.ends_with(python::SUFFIX)
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
    let mut paths = files(folder, SUFFIX);
    paths.retain(|p| !p.file_name().is_some_and(|n| n.starts_with(CARRIERS)));
    paths
}

/// Files of a folder whose names end so, sorted.
fn files(folder: &Utf8Path, suffix: &str) -> Vec<Utf8PathBuf> {
    let folder = folder
        .canonicalize_utf8()
        .unwrap_or_else(|_| folder.to_owned());
    let Ok(entries) = folder.read_dir_utf8() else {
        return Vec::new();
    };
    let mut paths: Vec<Utf8PathBuf> = entries
        .flatten()
        .map(camino::Utf8DirEntry::into_path)
        .filter(|p| p.as_str().ends_with(suffix) && p.is_file())
        .collect();
    paths.sort();
    paths
}

/// A component by name on a search path, or by path: loads the libraries whose file names fit. Only in a
/// worker, which may die.
pub(crate) fn find_component_library(
    folders: &[Utf8PathBuf],
    kind: PluginKind,
    name: &str,
) -> Result<Plugin, ComponentError> {
    if is_path(name) {
        let path = Utf8Path::new(name);
        let folder = path.canonicalize_utf8().ok();
        let folder = folder.as_deref().and_then(Utf8Path::parent);
        // The engine has asked about the libraries that it knows of; this one it never saw.
        if !folder.is_some_and(|f| folders.iter().any(|known| known == f)) {
            let name = name.to_owned();
            return Err(ComponentError::NotTrusted { kind, name });
        }
        let plugin = Plugin::load(path)?;
        if plugin.manifest.kind == kind {
            return Ok(plugin);
        }
        return Err(ComponentError::OtherKind {
            name: name.to_owned(),
            found: plugin.manifest.kind,
            kind,
        });
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
            Err(e) if e.breach == Breach::Foreign => {}
            Err(e) => broken.push(e),
        }
    }
    if !broken.is_empty() {
        return Err(ComponentError::Broken(broken));
    }
    Err(ComponentError::NotFound {
        kind,
        name: name.to_owned(),
        searched: folders.to_vec(),
    })
}
