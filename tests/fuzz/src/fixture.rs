//! A sound study on the disk, of which a target replaces one file, and the plugins that come along, by their manifests alone.

use camino::{Utf8Path, Utf8PathBuf};
use plyflow_model::manifest::{Manifest, PluginKind};
use plyflow_workflow::resolved::PluginId;
use plyflow_workflow::{Catalog, CatalogEntry, CatalogError, Diagnostics};
use std::sync::LazyLock;

/// The folder of the repository.
pub(crate) static REPOSITORY: LazyLock<Utf8PathBuf> =
    LazyLock::new(|| Utf8Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."));

/// All files of a folder of the repository and those below with an ending, sorted; stores are left out.
pub(crate) fn files(folder: &str, ending: &str) -> Vec<Utf8PathBuf> {
    fn collect(folder: &Utf8Path, ending: &str, found: &mut Vec<Utf8PathBuf>) {
        for entry in folder.read_dir_utf8().into_iter().flatten().flatten() {
            let path = entry.path().to_owned();
            match path.is_dir() {
                true if !entry.file_name().starts_with('.') => collect(&path, ending, found),
                false if path.as_str().ends_with(ending) => found.push(path),
                _ => {}
            }
        }
    }
    let mut found = Vec::new();
    collect(&REPOSITORY.join(folder), ending, &mut found);
    found.sort();
    found
}

/// The manifests of all plugins that come along.
pub(crate) struct Shipped(Vec<Manifest>);

pub(crate) static CATALOG: LazyLock<Shipped> = LazyLock::new(|| {
    let read = |file: Utf8PathBuf| {
        let text = std::fs::read_to_string(&file).expect("a manifest");
        Manifest::parse(&text).unwrap_or_else(|e| panic!("{file}: {e}"))
    };
    let all: Vec<Manifest> = files("solver-plugins", "manifest.json")
        .into_iter()
        .map(read)
        .collect();
    assert!(!all.is_empty(), "no manifests in {}", *REPOSITORY);
    Shipped(all)
});

impl Catalog for Shipped {
    fn find(&self, name: &str, _: &Utf8Path) -> Result<CatalogEntry, CatalogError> {
        let wanted = name.rsplit('/').next().unwrap_or(name);
        let found = self.0.iter().find(|m| m.name == wanted);
        let entry = |manifest: &Manifest| CatalogEntry {
            id: PluginId {
                name: manifest.name.clone(),
                version: manifest.version.clone(),
                path: format!("/plugins/lib{}.so", manifest.name).into(),
                hash: blake3::hash(manifest.name.as_bytes()).to_hex().to_string(),
            },
            manifest: manifest.clone(),
        };
        found.map(entry).ok_or_else(|| CatalogError::NotFound {
            name: name.into(),
            searched: vec!["/plugins".into()],
        })
    }

    fn names(&self, kind: PluginKind) -> Vec<String> {
        let of_kind = self.0.iter().filter(|m| m.kind == kind);
        of_kind.map(|m| m.name.clone()).collect()
    }
}

/// A folder with a sound study.
pub(crate) struct Folder(tempfile::TempDir);

impl Folder {
    /// An empty one. Its place is that of temporary files: `TMPDIR`.
    pub(crate) fn empty() -> Self {
        Self(tempfile::tempdir().expect("a folder for temporary files"))
    }

    /// One with the files of the study.
    pub(crate) fn of_study() -> Self {
        let folder = Self::empty();
        let from = REPOSITORY.join("tests/fuzz/fixture");
        std::fs::create_dir(folder.path("materials")).expect("a folder");
        for name in [
            "workflow.yaml",
            "workflow-expected.yaml",
            "workflow-points.yaml",
            "scene.yaml",
            "materials/fabric.yaml",
            "film.yaml",
            "points.csv",
            "workflow-plies.yaml",
            "scene-plies.yaml",
            "plies.csv",
            "ply.dxf",
            "corners.csv",
            "expected.json",
            "tool.stl",
        ] {
            std::fs::copy(from.join(name), folder.path(name)).expect("a file of the study");
        }
        folder
    }

    /// A path in it.
    pub(crate) fn path(&self, name: &str) -> Utf8PathBuf {
        let root = Utf8Path::from_path(self.0.path()).expect("a folder whose name is UTF-8");
        root.join(name)
    }

    /// Writes a file in it, and returns its path.
    pub(crate) fn write(&self, name: &str, bytes: &[u8]) -> Utf8PathBuf {
        let path = self.path(name);
        std::fs::write(&path, bytes).expect("a disk that takes a small file");
        path
    }
}

/// What every list of findings is: not empty; each with words, and with a place that is in its file, or with none where the file as a
/// whole cannot be read; and it can be shown in all ways, without what steers a terminal.
pub(crate) fn judge(found: &Diagnostics, file: &Utf8Path, text: &[u8]) {
    assert!(!found.items.is_empty(), "refused without a word");
    // A line ends with a line feed, or as on old machines with a carriage return that none follows.
    let next = text.iter().skip(1).map(Some).chain([None]);
    let ends =
        |(b, next): &(&u8, Option<&u8>)| **b == b'\n' || (**b == b'\r' && *next != Some(&b'\n'));
    let lines = text.iter().zip(next).filter(ends).count() + 1;
    let wide = text.starts_with(&[0xff, 0xfe]) || text.starts_with(&[0xfe, 0xff]);
    for d in &found.items {
        assert!(!d.message.trim().is_empty(), "no message: {d:?}");
        assert_eq!(d.line == 0, d.column == 0, "half a place: {d:?}");
        if d.file == file && !wide {
            assert!(d.line <= lines, "line {} of {lines}: {d:?}", d.line);
        }
    }
    let plain = found.render(false);
    let steers = |c: char| c.is_control() && c != '\n';
    assert!(!plain.contains(steers), "a control character: {plain:?}");
    let _ = (found.render(true), found.to_string(), found.to_json());
}
