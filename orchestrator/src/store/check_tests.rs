use super::super::place::tests::write_pair;
use super::*;
use std::fs;
use std::os::unix::fs::PermissionsExt;

/// A store with the whole artifacts of two keys.
fn store() -> (tempfile::TempDir, Store, [Key; 2]) {
    let dir = tempfile::tempdir().unwrap();
    let root = Utf8PathBuf::from_path_buf(dir.path().to_owned()).unwrap();
    let store = Store::new(root.clone());
    let keys = [Key([7; 32]), Key([8; 32])];
    for key in &keys {
        let (a, r) = (root.join("a"), root.join("r"));
        write_pair(key, &a, &r);
        store.commit(key, &a, &r, false).unwrap();
    }
    (dir, store, keys)
}

const OF: Expected<'_> = Expected {
    step: "s",
    item: &[],
    kind: "forming",
};

fn is_damaged(store: &Store, key: &Key) -> bool {
    matches!(store.check(key, Some(OF)), Err(Flaw::Damaged(_)))
}

#[test]
fn each_bit_of_artifact_and_record_is_sealed() {
    let (_dir, store, [key, _]) = store();
    assert!(store.check(&key, Some(OF)).is_ok());
    for path in [store.artifact(&key), store.record(&key)] {
        let whole = fs::read(&path).unwrap();
        for bit in (0..8 * whole.len()).step_by(7) {
            let mut bytes = whole.clone();
            bytes[bit / 8] ^= 1 << (bit % 8);
            fs::write(&path, bytes).unwrap();
            let found = store.check_once(&key, Some(OF));
            assert!(matches!(found, Err(Flaw::Damaged(_))), "{path}, bit {bit}");
        }
        fs::write(&path, whole).unwrap();
    }
    assert!(store.check(&key, Some(OF)).is_ok());
}

#[test]
fn what_lies_there_instead_of_a_file_is_named() {
    let (_dir, store, [key, other]) = store();
    let (artifact, record) = (store.artifact(&key), store.record(&key));
    let whole = (fs::read(&artifact).unwrap(), fs::read(&record).unwrap());
    let restore = || {
        for path in [&artifact, &record] {
            let _ = fs::remove_file(path);
            let _ = fs::remove_dir(path);
        }
        fs::write(&artifact, &whole.0).unwrap();
        fs::write(&record, &whole.1).unwrap();
        assert!(store.check(&key, Some(OF)).is_ok());
    };
    let damages: [(&str, &dyn Fn()); 7] = [
        ("emptied", &|| fs::write(&artifact, "").unwrap()),
        ("zeroed", &|| fs::write(&artifact, [0; 8]).unwrap()),
        ("truncated", &|| fs::write(&artifact, "artif").unwrap()),
        ("the record of another", &|| {
            fs::copy(store.record(&other), &record).unwrap();
        }),
        ("an empty record", &|| fs::write(&record, "").unwrap()),
        ("no record", &|| fs::remove_file(&record).unwrap()),
        ("a link to no file", &|| {
            fs::remove_file(&artifact).unwrap();
            std::os::unix::fs::symlink("/dev/zero", &artifact).unwrap();
        }),
    ];
    for (what, damage) in damages {
        damage();
        assert!(is_damaged(&store, &key), "{what}");
        restore();
    }
    for path in [&artifact, &record] {
        fs::remove_file(path).unwrap();
        fs::create_dir(path).unwrap();
        assert!(is_damaged(&store, &key), "a folder as {path}");
        restore();
    }
    fs::set_permissions(&artifact, fs::Permissions::from_mode(0o0)).unwrap();
    // The superuser may read it all the same.
    let unreadable = fs::File::open(&artifact).is_err();
    assert_eq!(is_damaged(&store, &key), unreadable);
    let mut another = OF;
    another.step = "t";
    restore();
    assert!(matches!(
        store.check(&key, Some(another)),
        Err(Flaw::Damaged(_))
    ));
    fs::remove_file(&artifact).unwrap();
    assert_eq!(store.check(&key, Some(OF)).unwrap_err(), Flaw::Gone);
}

#[test]
fn whatever_writes_to_a_file_or_exchanges_it_shows_without_reading() {
    let (_dir, store, [key, other]) = store();
    let before = store.look(&key).unwrap();
    assert_eq!(store.look(&key).unwrap(), before);
    let artifact = store.artifact(&key);
    // An editor that keeps size and date.
    let date = fs::metadata(&artifact).unwrap().modified().unwrap();
    std::thread::sleep(Duration::from_millis(20));
    fs::write(&artifact, "ARTIFACT").unwrap();
    let file = fs::File::options().write(true).open(&artifact).unwrap();
    file.set_modified(date).unwrap();
    let edited = store.look(&key).unwrap();
    assert_ne!(edited, before);
    // The same bytes under the same date, but another file.
    fs::rename(store.artifact(&other), &artifact).unwrap();
    assert_ne!(store.look(&key).unwrap(), edited);
}

#[test]
fn a_record_of_an_earlier_version_is_not_taken_for_whole() {
    let (_dir, store, [key, _]) = store();
    let path = store.record(&key);
    let text = fs::read_to_string(&path).unwrap();
    let mut value: serde_json::Value = serde_json::from_str(&text).unwrap();
    for name in ["seal", "hash"] {
        value.as_object_mut().unwrap().remove(name);
    }
    value["version"] = 1.into();
    fs::write(&path, value.to_string()).unwrap();
    assert_eq!(store.check(&key, Some(OF)).unwrap_err(), Flaw::Unsealed);
    // A record of this version without its seal was edited.
    value["version"] = JOB_VERSION.into();
    fs::write(&path, value.to_string()).unwrap();
    assert!(is_damaged(&store, &key));
}

#[test]
fn what_is_set_aside_is_kept_and_never_replaced() {
    let (_dir, store, [key, _]) = store();
    for n in 0..2 {
        let (a, r) = (store.root().join("a"), store.root().join("r"));
        write_pair(&key, &a, &r);
        store.commit(&key, &a, &r, false).unwrap();
        let told = store.set_key_aside(&key);
        assert!(told.contains("damaged/0707"), "{told}");
        assert_eq!(store.size(&key), None);
        assert_eq!(store.set_aside_before().unwrap().len(), 2 + 2 * n);
    }
    store.remove_set_aside().unwrap();
    assert!(!store.damaged().exists());
    assert!(store.set_key_aside(&key).contains("gone"));
}
