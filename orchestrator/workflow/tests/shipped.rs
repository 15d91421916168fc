//! Every workflow that comes along is sound, against the manifests of the plugins beside it.

mod common;

use camino::{Utf8Path, Utf8PathBuf};
use common::Fake;
use plyflow_model::manifest::Manifest;

fn root() -> Utf8PathBuf {
    Utf8Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// All files of a folder and those below, but for stores.
fn files(folder: &Utf8Path) -> Vec<Utf8PathBuf> {
    let mut found = Vec::new();
    for entry in folder.read_dir_utf8().unwrap().map(Result::unwrap) {
        let hidden = entry.file_name().starts_with('.');
        match entry.file_type().unwrap() {
            kind if kind.is_dir() && !hidden => found.extend(files(entry.path())),
            kind if kind.is_file() => found.push(entry.path().to_owned()),
            _ => {}
        }
    }
    found
}

#[test]
fn every_workflow_that_comes_along_is_sound() {
    let manifests = files(&root().join("solver-plugins"))
        .into_iter()
        .filter(|f| f.file_name() == Some("manifest.json"))
        .map(|f| Manifest::parse(&std::fs::read_to_string(&f).unwrap()).unwrap());
    let catalog = Fake(manifests.collect());
    let mut sound = 0;
    for file in files(&root().join("workflows")) {
        if file.extension() != Some("yaml") {
            continue;
        }
        let text = std::fs::read_to_string(&file).unwrap();
        let is_workflow = text.lines().any(|l| l.starts_with("plyflow:"));
        // What a step in Python declares, only Python can tell: these workflows are run by scripts of their own.
        let in_python = |l: &str| l.contains("plugin: ./") && l.trim_end().ends_with(".py");
        if !is_workflow || text.lines().any(in_python) {
            continue;
        }
        if let Err(found) = plyflow_workflow::load(&file, &catalog) {
            panic!("{file}:\n{}", found.render(false));
        }
        sound += 1;
    }
    assert!(sound >= 20, "{sound}");
}
