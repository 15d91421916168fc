//! What a store keeps besides artifacts.

use crate::fixture::{CATALOG, Folder};
use plyflow::plan::Key;
use plyflow::store::{Flaw, Journal, Lock, Scanned, record_beside, resolved as kept};
use plyflow_artifact::seal::seal;
use plyflow_plugin_host::{cost_so_far, damaged_cost};

thread_local! {
    static FOLDER: Folder = {
        let folder = Folder::empty();
        for name in ["resolved", KEY] {
            std::fs::create_dir(folder.path(name)).expect("a folder");
        }
        folder
    };
}

/// Names an instance.
const KEY: &str = "00000000000000000000000000000000000000000000000000000000000000aa";

/// The bytes as the record of an artifact and as the note of a step's cost, as they are and sealed.
pub(super) fn record(bytes: &[u8]) {
    let sealed = std::str::from_utf8(bytes).map(seal).unwrap_or_default();
    FOLDER.with(|folder| {
        for bytes in [bytes, sealed.as_bytes()] {
            for artifact in ["any.vtkhdf".to_owned(), format!("{KEY}.vtkhdf")] {
                let name = artifact.replace(".vtkhdf", ".record.json");
                folder.write(&name, bytes);
                match record_beside(&folder.path(&artifact)) {
                    Ok(Some(read)) => {
                        // Another key is another artifact's record.
                        assert!(artifact.starts_with("any") || read.key == KEY);
                        let text = serde_json::to_string_pretty(&read).expect("a record is JSON");
                        folder.write(&name, seal(&text).as_bytes());
                        let again = record_beside(&folder.path(&artifact));
                        assert_eq!(again, Ok(Some(read)), "written and read as another");
                    }
                    Ok(None) => {}
                    Err(Flaw::Damaged(why)) => assert!(why.contains("record"), "{why}"),
                    Err(other) => panic!("{other:?} of a file that is there"),
                }
            }
            folder.write(&format!("{KEY}/plyflow-cost.json"), bytes);
            let instance = folder.path(KEY);
            let damaged = damaged_cost(&instance);
            assert_ne!(
                cost_so_far(&instance).is_some(),
                damaged.is_some(),
                "{damaged:?}"
            );
        }
    });
}

/// A journal of frames that check: two bytes are the length of the payload behind them.
fn framed(bytes: &[u8]) -> Vec<u8> {
    let mut file = b"PFJRNL02".to_vec();
    let mut rest = bytes;
    while let [low, high, payload @ ..] = rest {
        let length = usize::from(u16::from_le_bytes([*low, *high])).min(payload.len());
        let (payload, behind) = payload.split_at(length);
        file.extend((length as u32).to_le_bytes());
        file.extend(&blake3::hash(payload).as_bytes()[..8]);
        file.extend(payload);
        rest = behind;
    }
    file
}

/// The bytes as a journal, as they are and as payloads of frames that check: who only reads it knows what the writer knows who has it
/// made whole; then it is whole, and known as before.
pub(super) fn journal(bytes: &[u8]) {
    FOLDER.with(|folder| {
        for bytes in [bytes, &framed(bytes)] {
            let path = folder.write("journal", bytes);
            let read = Journal::read(&path).expect("a file");
            let scanned = Scanned::read(&path).expect("a file");
            let keys = read.last_keys();
            assert_eq!(scanned.journal().last_keys(), keys);
            let some: Vec<Key> = keys.iter().take(4).copied().collect();
            for key in &some {
                let _ = (read.known(key), read.detail(key));
            }
            let written = Journal::open(&path).expect("a journal that is written");
            assert_eq!(written.is_damaged(), read.is_damaged());
            drop(written);
            let again = Journal::open(&path).expect("a journal that was written");
            assert!(!again.is_damaged(), "damaged by its own writer");
            let kept = again.last_keys();
            assert!(kept.iter().all(|k| keys.contains(k)), "keys from nowhere");
            // A damaged one, and one of more than a thousand frames, may be written anew without keys of which nothing more is known.
            let rewritten = read.is_damaged() || bytes.len() > 12 * 1000;
            assert!(
                rewritten || kept == keys,
                "{} keys of {}",
                kept.len(),
                keys.len()
            );
        }
    });
}

/// The bytes as a workflow that was kept, as they are and with their hash before them. What passes names its libraries rightly.
pub(super) fn resolved(bytes: &[u8]) {
    FOLDER.with(|folder| {
        let (root, file) = (folder.path(""), folder.path("w.yaml"));
        let name = blake3::hash(file.as_str().as_bytes()).to_hex()[..16].to_owned();
        let mut whole = vec![7; 32];
        whole.extend(blake3::hash(bytes).as_bytes());
        whole.extend(bytes);
        for bytes in [bytes, &whole] {
            let path = folder.write(&format!("resolved/{name}"), bytes);
            let damaged = kept::damage(&path);
            let read = kept::read(&root, &file, &[7; 32], &*CATALOG);
            assert!(
                read.is_none() || damaged.is_none(),
                "damaged and taken: {damaged:?}"
            );
            if let Some((workflow, recipes)) = read {
                assert_eq!(workflow.steps.len(), recipes.len());
            }
        }
    });
}

/// The bytes as what stands in a lock's file, which somebody holds: the message says who, whatever stands there.
pub(super) fn lock(bytes: &[u8]) {
    FOLDER.with(|folder| {
        let path = folder.path("lock");
        let held = Lock::exclusive(&path, "the run").expect("nobody holds it");
        std::fs::write(&path, bytes).expect("a file");
        let told = Lock::exclusive(&path, "the run").expect_err("it is held");
        assert!(told.to_string().contains("process"), "{told}");
        drop(held);
        let _ = std::fs::remove_file(&path);
    });
}
