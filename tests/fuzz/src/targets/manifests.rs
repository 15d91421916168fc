//! What plugins say of themselves, and what is kept of it.

use crate::fixture::Folder;
use plyflow_artifact::seal::seal;
use plyflow_model::manifest::{Manifest, PluginKind};
use plyflow_model::schema;
use plyflow_plugin_host::{Describer, PluginCatalog};
use plyflow_workflow::Catalog;

thread_local! {
    static FOLDER: Folder = Folder::empty();
}

/// The bytes as a manifest: written it is read as the same, and there is a schema of its parameters.
pub(super) fn manifest(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    match Manifest::parse(text) {
        Ok(read) => {
            let written = serde_json::to_string(&read).expect("a manifest is JSON");
            let again = Manifest::parse(&written);
            assert_eq!(again.as_ref(), Ok(&read), "{written}");
            let schema = schema::workflow_with(std::slice::from_ref(&read));
            assert!(schema.is_object());
        }
        Err(e) => assert!(!e.to_string().trim().is_empty()),
    }
}

/// The bytes as what is kept of libraries, as they are and sealed: whatever they say, a catalog of no folders finds nothing.
pub(super) fn plugins(bytes: &[u8]) {
    let sealed = std::str::from_utf8(bytes).map(seal).unwrap_or_default();
    FOLDER.with(|folder| {
        for bytes in [bytes, sealed.as_bytes()] {
            let path = folder.write("plugins.json", bytes);
            if let Some(why) = plyflow::store::damage_of_plugins(&path) {
                assert!(!why.trim().is_empty(), "damaged without a word");
            }
            let catalog = PluginCatalog::new(Vec::new(), Some(path), Describer::InProcess);
            assert!(catalog.names(PluginKind::Step).is_empty());
        }
    });
}
