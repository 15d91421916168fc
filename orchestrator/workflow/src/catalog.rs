//! What the workflow needs to know of plugins; the plugin host implements it.

use crate::resolved::PluginId;
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_model::manifest::{Manifest, PluginKind};
use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

/// A plugin that was found.
#[derive(Debug, Clone, PartialEq)]
pub struct CatalogEntry {
    /// Its library.
    pub id: PluginId,
    /// What it says about itself.
    pub manifest: Manifest,
}

/// Why a plugin was not found.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CatalogError {
    /// No plugin of that name, no library at that path.
    #[error("no plugin `{name}` was found")]
    NotFound {
        /// Name or path as given.
        name: String,
        /// Folders (or the path) that were looked at.
        searched: Vec<Utf8PathBuf>,
    },
    /// There is a library, but it cannot be used.
    #[error("the plugin library {path} cannot be used: {reason}")]
    Broken {
        /// The library.
        path: Utf8PathBuf,
        /// Why: ABI version, manifest, missing symbol.
        reason: String,
    },
    /// It would have to be loaded to know more, or to run it, and that is not allowed.
    #[error("{}", consent_text(libraries))]
    NeedsConsent {
        /// Name or path as given.
        name: String,
        /// Libraries that may not be loaded, with the BLAKE3 (hex) of their bytes.
        libraries: Vec<(Utf8PathBuf, String)>,
    },
    /// Two different libraries have the same name, and one of them is trusted more than the other.
    #[error(
        "`{name}` is the name of the plugin {owner}, and {other} takes it: two libraries of one name, so that nobody can \
         know which is meant; give the second another name, or take it out of the folder"
    )]
    Taken {
        /// The name.
        name: String,
        /// The library that comes with this program, or that is on the user's own list.
        owner: Utf8PathBuf,
        /// The library that takes its name.
        other: Utf8PathBuf,
    },
}

fn consent_text(libraries: &[(Utf8PathBuf, String)]) -> String {
    let [(path, hash), more @ ..] = libraries else {
        return "a library was not loaded".into();
    };
    let others = match more.len() {
        0 => String::new(),
        n => format!(", nor {n} more beside it,"),
    };
    format!(
        "the library {path} (blake3 {hash}) was not loaded{others}: it is neither part of this program nor on your own list, and a \
         library can do all that you can do. If you trust it: `--trust` for this command, `plyflow trust {path}` for good"
    )
}

/// Finds plugins.
pub trait Catalog {
    /// Finds a plugin by name (on the search path) or by path (when it contains a slash or the library
    /// suffix), relative paths starting from `relative_to`.
    ///
    /// # Errors
    /// See [`CatalogError`].
    fn find(
        &self,
        name_or_path: &str,
        relative_to: &Utf8Path,
    ) -> Result<CatalogEntry, CatalogError>;

    /// Names of all plugins of a kind on the search path, for suggestions.
    fn names(&self, kind: PluginKind) -> Vec<String>;
}

/// A catalog that is asked once per name and folder: ten thousand steps share a handful of plugins.
pub(crate) struct Plugins<'a> {
    catalog: &'a dyn Catalog,
    known: RefCell<HashMap<(String, Utf8PathBuf), Answer>>,
}

/// What a catalog said.
type Answer = Result<Rc<CatalogEntry>, CatalogError>;

impl<'a> Plugins<'a> {
    /// Nothing is known yet.
    pub fn new(catalog: &'a dyn Catalog) -> Self {
        Plugins {
            catalog,
            known: RefCell::default(),
        }
    }

    /// See [`Catalog::find`].
    pub fn find(&self, name_or_path: &str, relative_to: &Utf8Path) -> Answer {
        let key = (name_or_path.to_owned(), relative_to.to_owned());
        let mut known = self.known.borrow_mut();
        let answer = known
            .entry(key)
            .or_insert_with(|| self.catalog.find(name_or_path, relative_to).map(Rc::new));
        answer.clone()
    }

    /// Every question that was answered with a plugin: what was asked, and what was found.
    pub fn answers(&self) -> Vec<(String, Utf8PathBuf, PluginId)> {
        let known = self.known.borrow();
        let mut found: Vec<_> = known
            .iter()
            .filter_map(|((name, folder), answer)| {
                let entry = answer.as_ref().ok()?;
                Some((name.clone(), folder.clone(), entry.id.clone()))
            })
            .collect();
        found.sort_by(|a, b| (&a.0, &a.1).cmp(&(&b.0, &b.1)));
        found
    }

    /// See [`Catalog::names`].
    pub fn names(&self, kind: PluginKind) -> Vec<String> {
        self.catalog.names(kind)
    }
}
