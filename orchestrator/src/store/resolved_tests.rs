use super::*;
use plyflow_model::manifest::PluginKind;
use plyflow_workflow::{CatalogEntry, CatalogError};
use serde_json::json;
use std::fs;

/// One plugin, `reader`, whose library has the given hash.
struct One(&'static str);

impl Catalog for One {
    fn find(&self, name: &str, _: &Utf8Path) -> Result<CatalogEntry, CatalogError> {
        let manifest = serde_json::from_value(json!({
            "name": "reader", "version": "1.0.0", "vendor": "tests", "kind": "step", "role": "test",
            "summary": "Reads.",
            "parameters": {
                "mesh": {"type": "file", "doc": "A file."},
                "x": {"type": "number", "default": 0.1, "doc": "A number."}
            },
            "inputs": {}, "output": {"kind": "test"}, "results": {}
        }));
        if name != "reader" {
            return Err(CatalogError::NotFound {
                name: name.into(),
                searched: Vec::new(),
            });
        }
        Ok(CatalogEntry {
            id: PluginId {
                name: name.into(),
                version: "1.0.0".into(),
                path: "/reader.so".into(),
                hash: self.0.into(),
            },
            manifest: manifest.expect("a manifest"),
        })
    }

    fn names(&self, _: PluginKind) -> Vec<String> {
        vec!["reader".into()]
    }
}

const TEXT: &str = "plyflow: 1\nname: kept\nsteps:\n  a: {plugin: reader, with: {mesh: m.stl, x: 0.30000000000000004}}\n";

/// A folder with a workflow, a mesh, a plugin folder, and the resolution in its store.
struct Kept {
    _folder: tempfile::TempDir,
    root: Utf8PathBuf,
    file: Utf8PathBuf,
}

impl Kept {
    fn new(text: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let root = Utf8PathBuf::from_path_buf(folder.path().canonicalize().unwrap()).unwrap();
        let file = root.join("workflow.yaml");
        fs::write(&file, text).unwrap();
        fs::write(root.join("m.stl"), "mesh").unwrap();
        fs::create_dir(root.join("more")).unwrap();
        let kept = Self {
            _folder: folder,
            root,
            file,
        };
        let found = plyflow_workflow::resolve(&kept.file, &One("11"), &[]).unwrap();
        let recipes = crate::plan::recipes(&found.workflow);
        write(&kept.root, &kept.file, &[1; 32], (&found, &recipes));
        kept
    }

    fn read(&self) -> Option<ResolvedWorkflow> {
        Some(read(&self.root, &self.file, &[1; 32], &One("11"))?.0)
    }

    fn place(&self) -> Utf8PathBuf {
        place(&self.root, &self.file)
    }
}

#[test]
fn what_is_kept_is_what_was_resolved_bit_for_bit() {
    let kept = Kept::new(TEXT);
    let anew = plyflow_workflow::load(&kept.file, &One("11")).unwrap();
    let recipes = crate::plan::recipes(&anew);
    let read = read(&kept.root, &kept.file, &[1; 32], &One("11"));
    assert_eq!(read, Some((anew, recipes)));
}

#[test]
fn values_keep_their_type_and_their_bits() {
    let value = json!({"z": [null, true, -3, u64::MAX, -0.0, 5e-324, 1.0], "a": {"t": "µ"}});
    let back = PackedValue::read(&PackedValue::bytes(&value)).unwrap();
    assert_eq!(back.to_string(), value.to_string());
}

#[test]
fn a_kept_workflow_is_not_used_after_a_change_of_a_file_it_read() {
    for name in ["workflow.yaml", "m.stl"] {
        let kept = Kept::new(TEXT);
        let path = kept.root.join(name);
        let modified = fs::metadata(&path).unwrap().modified().unwrap();
        let mut bytes = fs::read(&path).unwrap();
        *bytes.last_mut().unwrap() = b' ';
        fs::write(&path, bytes).unwrap();
        // Neither size nor date tells.
        let file = fs::File::options().write(true).open(&path).unwrap();
        file.set_modified(modified).unwrap();
        assert_eq!(kept.read(), None, "{name} changed");
        fs::remove_file(&path).unwrap();
        assert_eq!(kept.read(), None, "{name} is gone");
    }
}

#[test]
fn a_kept_workflow_is_not_used_with_another_library_or_other_circumstances() {
    let kept = Kept::new(TEXT);
    let other = |c: u8, catalog: &One| read(&kept.root, &kept.file, &[c; 32], catalog);
    assert!(other(1, &One("11")).is_some());
    assert!(other(1, &One("12")).is_none());
    assert!(other(2, &One("11")).is_none());
}

#[test]
fn a_kept_workflow_is_not_used_when_a_plugin_folder_is_gone() {
    let kept = Kept::new(&format!("{TEXT}plugins: [more]\n"));
    assert!(kept.read().is_some());
    fs::remove_dir(kept.root.join("more")).unwrap();
    assert!(kept.read().is_none());
}

#[test]
fn a_kept_workflow_that_is_cut_damaged_or_gone_counts_as_none() {
    let kept = Kept::new(TEXT);
    let whole = fs::read(kept.place()).unwrap();
    for end in 0..whole.len() {
        fs::write(kept.place(), &whole[..end]).unwrap();
        assert!(kept.read().is_none(), "cut at {end}");
        let mut damaged = whole.clone();
        damaged[end] ^= 1;
        fs::write(kept.place(), damaged).unwrap();
        assert!(kept.read().is_none(), "byte {end} damaged");
    }
    fs::remove_file(kept.place()).unwrap();
    assert!(kept.read().is_none());
}

#[test]
fn nothing_is_made_where_there_is_no_store() {
    let kept = Kept::new(TEXT);
    let none = kept.root.join("none");
    let found = plyflow_workflow::resolve(&kept.file, &One("11"), &[]).unwrap();
    let recipes = crate::plan::recipes(&found.workflow);
    write(&none, &kept.file, &[1; 32], (&found, &recipes));
    assert!(!none.exists());
}

#[test]
fn circumstances_follow_the_file_the_overrides_the_folders_and_the_program() {
    let kept = Kept::new(TEXT);
    let of = |program: &str, file: &str, set: &[&str], folders: &[&str]| {
        let set: Vec<String> = set.iter().map(|t| (*t).to_owned()).collect();
        let folders: Vec<Utf8PathBuf> = folders.iter().map(|f| f.into()).collect();
        circumstances(&kept.root.join(program), file.into(), &set, &folders)
    };
    let base = of("m.stl", "/w", &["a.x=1"], &["/p"]);
    assert!(base.is_some());
    assert_ne!(base, of("workflow.yaml", "/w", &["a.x=1"], &["/p"]));
    assert_ne!(base, of("m.stl", "/v", &["a.x=1"], &["/p"]));
    assert_ne!(base, of("m.stl", "/w", &["a.x=2"], &["/p"]));
    assert_ne!(base, of("m.stl", "/w", &["a.x=1", "/p"], &[]));
    assert_ne!(base, of("m.stl", "/w", &["a.x=1"], &["/p", "/q"]));
    assert_eq!(of("absent", "/w", &[], &[]), None);
}
