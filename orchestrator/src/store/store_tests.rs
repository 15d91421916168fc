use super::super::names::safe_name;
use super::*;
use camino::Utf8PathBuf;

#[test]
fn names_that_are_not_file_names_stay_apart() {
    assert_eq!(safe_name("local[A,0]"), "local[A,0]");
    assert_ne!(safe_name("a/b"), safe_name("a:b"));
    assert!(!safe_name("../../etc").contains('/'));
    assert!(!safe_name("..").starts_with('.'));
}

#[test]
fn an_artifact_becomes_visible_with_its_record() {
    let folder = tempfile::tempdir().unwrap();
    let root = Utf8PathBuf::from_path_buf(folder.path().to_owned()).unwrap();
    let store = Store::new(root.clone());
    let key = Key([7; 32]);
    let (a, r) = (root.join("a"), root.join("r"));
    fs::write(&a, "artifact").unwrap();
    assert!(
        store.commit(&key, &a, &r, true).is_err(),
        "a missing record must stop the commit"
    );
    assert_eq!(store.size(&key), None);
    fs::write(&r, "{}").unwrap();
    store.commit(&key, &a, &r, true).unwrap();
    assert_eq!(store.size(&key), Some(8));
    assert_eq!(store.keys().unwrap(), [key]);
    store.remove(&key).unwrap();
    assert!(store.keys().unwrap().is_empty());
}

#[test]
fn what_cannot_be_committed_is_kept_and_taken_by_the_next_run() {
    let folder = tempfile::tempdir().unwrap();
    let root = Utf8PathBuf::from_path_buf(folder.path().to_owned()).unwrap();
    let store = Store::new(root.clone());
    let run = store.run("study");
    let key = Key([7; 32]);
    let (a, r) = (root.join("a"), root.join("r"));
    write_pair(&key, &a, &r);
    // A file where the folder should be: nothing can be put there.
    fs::write(root.join("artifacts"), "").unwrap();
    assert!(store.commit(&key, &a, &r, true).is_err());
    store.keep_unplaced(&run, &key, &a, &r).unwrap();
    store.take_unplaced(&run);
    assert_eq!((store.size(&key), a.exists()), (None, false));
    fs::remove_file(root.join("artifacts")).unwrap();
    store.take_unplaced(&run);
    assert_eq!(store.size(&key), Some(8));
    assert!(store.check(&key, None).is_ok() && !run.unplaced().exists());
}

#[test]
fn what_is_damaged_while_it_could_not_be_committed_never_gets_into_the_store() {
    let folder = tempfile::tempdir().unwrap();
    let root = Utf8PathBuf::from_path_buf(folder.path().to_owned()).unwrap();
    let store = Store::new(root.clone());
    let run = store.run("study");
    let key = Key([7; 32]);
    let (a, r) = (root.join("a"), root.join("r"));
    write_pair(&key, &a, &r);
    store.keep_unplaced(&run, &key, &a, &r).unwrap();
    let kept = run.unplaced().join(format!("{}{ENDING}", key.hex()));
    fs::write(&kept, "ARTIFACT").unwrap();
    let told = store.take_unplaced(&run);
    assert!(told[0].contains("damaged"), "{told:?}");
    assert_eq!(store.size(&key), None);
    assert_eq!(store.set_aside_before().unwrap().len(), 2);
}

/// An artifact and its record, as a worker leaves them.
pub(crate) fn write_pair(key: &Key, artifact: &Utf8Path, record: &Utf8Path) {
    fs::write(artifact, "artifact").unwrap();
    let whole = plyflow_model::job::Record {
        version: plyflow_model::job::JOB_VERSION,
        step: "s".into(),
        item: vec![],
        key: key.hex(),
        kind: "forming".into(),
        bytes: 8,
        hash: blake3::hash(b"artifact").to_hex().to_string(),
        cost: plyflow_model::job::Cost::default(),
        results: vec![],
        collection: None,
        warnings: vec![],
        host: "h".into(),
        started: 0.0,
    };
    let text = serde_json::to_string_pretty(&whole).unwrap();
    fs::write(record, plyflow_artifact::seal::seal(&text)).unwrap();
}

#[test]
fn clearing_removes_what_runs_have_put_there_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let root = Utf8PathBuf::from_path_buf(folder.path().to_owned()).unwrap();
    let store = Store::new(root.clone());
    let key = Key([7; 32]);
    let write = |path: Utf8PathBuf| {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, "x").unwrap();
    };
    let own = [
        store.artifact(&key),
        store.record(&key),
        store.run("study").journal(),
        store.run("study").tmp().join("1.vtkhdf"),
        store.damaged().join("x"),
        root.join("resolved/0123456789abcdef"),
        root.join("plugins.json"),
    ];
    let others = [
        root.join("runs/exp1/result.csv"),
        root.join("artifacts/sub/model.bin"),
        root.join("resolved/issues.txt"),
        root.join("notes.txt"),
    ];
    own.iter().chain(&others).cloned().for_each(write);
    store.clear().unwrap();
    assert!(own.iter().all(|p| !p.exists()));
    assert!(others.iter().all(|p| p.exists()));
}
