//! The catalog over a folder with good, broken and foreign libraries.

use camino::{Utf8Path, Utf8PathBuf};
use plyflow_faults::{folder, library};
use plyflow_model::manifest::PluginKind;
use plyflow_plugin_host::{Describer, PluginCatalog};
use plyflow_workflow::{Catalog, CatalogError};

fn child() -> Describer {
    Describer::Child {
        program: env!("CARGO_BIN_EXE_faults-worker").into(),
        arguments: vec!["--describe".into()],
    }
}

/// Describing with this fails: shows that nothing had to be described.
fn no_child() -> Describer {
    Describer::Child {
        program: "/nowhere/at/all".into(),
        arguments: vec![],
    }
}

fn plugins() -> Utf8PathBuf {
    Utf8PathBuf::from_path_buf(folder().to_owned()).unwrap()
}

#[test]
fn a_plugin_is_found_by_name_and_by_path() {
    let catalog = PluginCatalog::new(vec![plugins()], None, child());
    let by_name = catalog.find("nan-field", Utf8Path::new("/")).unwrap();
    assert_eq!(by_name.manifest.name, "nan-field");
    let bytes = std::fs::read(library("nan-field")).unwrap();
    assert_eq!(by_name.id.hash, blake3_hex(&bytes));
    let by_path = catalog.find("./libnan_field.so", &plugins()).unwrap();
    assert_eq!(by_path.id.hash, by_name.id.hash);
    assert!(
        catalog
            .names(PluginKind::Step)
            .contains(&"trivial".to_owned())
    );
    assert_eq!(catalog.names(PluginKind::Element), ["panicking-element"]);
}

fn blake3_hex(bytes: &[u8]) -> String {
    // The catalog's own hash of the same bytes under another name must agree.
    let dir = tempfile::tempdir().unwrap();
    let copy = dir.path().join("libcopy.so");
    std::fs::write(&copy, bytes).unwrap();
    let path = Utf8PathBuf::from_path_buf(copy).unwrap();
    let catalog = PluginCatalog::new(vec![], None, Describer::InProcess);
    catalog
        .find(path.as_str(), Utf8Path::new("/"))
        .unwrap()
        .id
        .hash
}

#[test]
fn a_library_that_crashes_is_broken_and_takes_nobody_with_it() {
    let catalog = PluginCatalog::new(vec![plugins()], None, child());
    match catalog.find("crash-on-load", Utf8Path::new("/")) {
        Err(CatalogError::Broken { reason, .. }) => {
            assert!(reason.contains("killed by signal 6"), "{reason}");
        }
        other => panic!("{other:?}"),
    }
    assert!(catalog.find("trivial", Utf8Path::new("/")).is_ok());
}

#[test]
fn broken_and_missing_plugins_are_told_apart() {
    let catalog = PluginCatalog::new(vec![plugins()], None, child());
    match catalog.find("wrong-abi", Utf8Path::new("/")) {
        Err(CatalogError::Broken { reason, .. }) => {
            assert!(reason.contains("ABI 99.0"), "{reason}")
        }
        other => panic!("{other:?}"),
    }
    match catalog.find("unknown-unit", Utf8Path::new("/")) {
        Err(CatalogError::Broken { reason, .. }) => {
            assert!(reason.contains("unit of `torque`"), "{reason}");
        }
        other => panic!("{other:?}"),
    }
    match catalog.find("no-such-plugin", Utf8Path::new("/")) {
        Err(CatalogError::NotFound { searched, .. }) => assert_eq!(searched, [plugins()]),
        other => panic!("{other:?}"),
    }
    match catalog.find("./no.so", &plugins()) {
        Err(CatalogError::NotFound { searched, .. }) => assert_eq!(searched.len(), 1),
        other => panic!("{other:?}"),
    }
    let foreign = library("not-a-plugin");
    match catalog.find(foreign.to_str().unwrap(), Utf8Path::new("/")) {
        Err(CatalogError::Broken { reason, .. }) => assert!(reason.contains("plyflow_plugin")),
        other => panic!("{other:?}"),
    }
}

#[test]
fn nothing_is_described_again_when_the_cache_knows_it() {
    let dir = tempfile::tempdir().unwrap();
    let cache = Utf8PathBuf::from_path_buf(dir.path().join("sub/plugins.json")).unwrap();
    let only = dir.path().join("plugins");
    std::fs::create_dir(&only).unwrap();
    std::fs::copy(library("trivial"), only.join("libtrivial.so")).unwrap();
    std::fs::copy(library("not-a-plugin"), only.join("libnot_a_plugin.so")).unwrap();
    let folders = || vec![Utf8PathBuf::from_path_buf(only.clone()).unwrap()];
    let first = PluginCatalog::new(folders(), Some(cache.clone()), child());
    let entry = first.find("trivial", Utf8Path::new("/")).unwrap();
    let second = PluginCatalog::new(folders(), Some(cache.clone()), no_child());
    assert_eq!(second.find("trivial", Utf8Path::new("/")).unwrap(), entry);
    assert!(second.broken().is_empty());
    // A changed file is looked at again.
    std::fs::copy(library("sum"), only.join("libtrivial.so")).unwrap();
    let third = PluginCatalog::new(folders(), Some(cache.clone()), child());
    assert!(third.find("trivial", Utf8Path::new("/")).is_err());
    assert!(third.find("sum", Utf8Path::new("/")).is_ok());
    // A damaged cache counts as empty.
    std::fs::write(&cache, "{").unwrap();
    let fourth = PluginCatalog::new(folders(), Some(cache), child());
    assert!(fourth.find("sum", Utf8Path::new("/")).is_ok());
}

#[test]
fn a_kept_manifest_that_breaks_a_rule_is_not_believed() {
    let dir = tempfile::tempdir().unwrap();
    let cache = Utf8PathBuf::from_path_buf(dir.path().join("plugins.json")).unwrap();
    let only = dir.path().join("plugins");
    std::fs::create_dir(&only).unwrap();
    std::fs::copy(library("trivial"), only.join("libtrivial.so")).unwrap();
    let folders = || vec![Utf8PathBuf::from_path_buf(only.clone()).unwrap()];
    let catalog = |describer| PluginCatalog::new(folders(), Some(cache.clone()), describer);
    let entry = catalog(child())
        .find("trivial", Utf8Path::new("/"))
        .unwrap();
    for unit in ["Nm", "mm"] {
        // As a program that did not look at units left it.
        let kept = std::fs::read_to_string(&cache).unwrap();
        let (old, new) = (r#"\"unit\": \"1\""#, format!(r#"\"unit\": \"{unit}\""#));
        assert!(kept.contains(old), "{kept}");
        let mut kept: serde_json::Value = serde_json::from_str(&kept).unwrap();
        kept.as_object_mut().unwrap().remove("seal");
        let other = kept.to_string().replace(old, &new);
        std::fs::write(&cache, plyflow_artifact::seal::seal(&other)).unwrap();
        let refused = catalog(no_child()).find("trivial", Utf8Path::new("/"));
        assert!(
            matches!(refused, Err(CatalogError::Broken { .. })),
            "{unit} is believed: {refused:?}"
        );
        let again = catalog(child()).find("trivial", Utf8Path::new("/"));
        assert_eq!(again.unwrap(), entry, "{unit}");
    }
}
