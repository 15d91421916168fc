//! The gate before files in Python: they run when libraries are made of them, so they need the consent that a library needs.

use super::files::read_stranger;
use super::gate::needs_consent;
use super::known::{Looked, PluginCatalog, looked};
use super::python::Python;
use crate::trust::Place;
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_workflow::CatalogError;
use plyflow_workflow::resolved::PluginId;

impl PluginCatalog {
    /// Knows plugins in Python too.
    #[must_use]
    pub fn with_python(mut self, python: Python) -> Self {
        self.python = Some(python);
        self
    }

    /// Where a library lies; one that was made of a file in Python, where that lies, or among the user's own where the file is consented to.
    pub(super) fn place(&self, path: &Utf8Path) -> Place {
        let origins = match &self.python {
            Some(python) => python.origins(path),
            None => Vec::new(),
        };
        let allowed = |source: &Utf8PathBuf| {
            self.trust.place(source) != Place::Elsewhere
                || read_stranger(source).is_ok_and(|s| self.trust.allows(&s))
        };
        if origins.iter().any(allowed) {
            return Place::Own;
        }
        self.trust.place(path)
    }

    /// Asks for consent to a file of which a library was made; `None`: the library was made of none.
    pub(super) fn admit_python(&self, id: &PluginId) -> Option<Result<(), CatalogError>> {
        let source = self.python.as_ref()?.origins(&id.path).into_iter().next()?;
        let source = match read_stranger(&source) {
            Ok(source) => source,
            Err(breach) => {
                return Some(Err(CatalogError::Broken {
                    path: source,
                    reason: breach.to_string(),
                }));
            }
        };
        let allowed = self.trust.allows_when_asked(&source);
        Some(
            allowed
                .then_some(())
                .ok_or_else(|| needs_consent(&id.name, [&source])),
        )
    }

    /// What a file in Python is, after its library was made. It runs when that is done, so it needs the consent that a library needs.
    pub(super) fn look_at_python(&self, path: &Utf8Path, place: Place, ask: bool) -> Looked {
        let Some(python) = &self.python else {
            return Looked::Broken("this program does not make plugins of files in Python".into());
        };
        if place == Place::Elsewhere {
            let source = match read_stranger(path) {
                Ok(source) => source,
                Err(e) => return Looked::Broken(e.to_string()),
            };
            let allowed = match ask {
                true => self.trust.allows_when_asked(&source),
                false => self.trust.allows(&source),
            };
            if !allowed {
                // From a time when it was allowed to be made; nothing is loaded for this.
                let folder = python.folder.as_ref();
                let library = folder.and_then(|folder| python.kept(folder, path));
                let before = library.and_then(|l| Some((self.described(&l)?, l)));
                return match before {
                    Some((known, library)) => looked(&library, known),
                    None => Looked::Stranger(source),
                };
            }
        }
        let library = match python.make(path) {
            Ok(library) => library,
            Err(e) => return Looked::Broken(e.to_string()),
        };
        match self.known(&library, None) {
            Ok(known) => looked(&library, known),
            Err(breach) => Looked::Broken(breach.to_string()),
        }
    }
}
