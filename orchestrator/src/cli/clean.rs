//! `clean`: makes room in a store.

use super::args::CleanArgs;
use super::open::{locked, store_root};
use super::table::bytes;
use crate::exit;
use crate::plan::Key;
use crate::said::{Done, Stop, print};
use crate::store::{Journal, Lock, Store};
use camino::Utf8Path;
use std::collections::BTreeSet;

/// `plyflow clean`.
///
/// # Errors
/// [`exit::LOCKED`] while a run uses the store, [`exit::USAGE`] when the workflow is no file.
pub fn clean(args: &CleanArgs) -> Done {
    // A slip of the name, or a folder, would mean the store beside it: another study's.
    if let Some(file) = args.workflow.as_deref().filter(|f| !f.is_file()) {
        let text = format!(
            "there is no workflow file {file}; name the workflow beside which the store lies, or the store itself with --store"
        );
        return Err(Stop::new(exit::USAGE, text));
    }
    let root = store_root(&args.places, args.workflow.as_deref());
    if !root.is_dir() {
        return print(&format!("there is no store {root}; nothing to remove\n"));
    }
    let store = Store::new(root);
    if !store.exists() {
        let text = format!(
            "{} is no store: no run has left its `lock` there; given with --store, expected a folder such as `.plyflow`",
            store.root()
        );
        return Err(Stop::new(exit::USAGE, text));
    }
    let _lock =
        Lock::exclusive(&store.lock(), &format!("the store {}", store.root())).map_err(locked)?;
    let failed = || Stop::machine(format!("cleaning {}", store.root()));
    let mut used = BTreeSet::new();
    let mut noted = None;
    if !args.all {
        for run in store.runs().map_err(failed())? {
            let journal = whole(&run.journal())?;
            used.extend(journal.last_keys());
            noted = noted.max(modified(&run.journal()));
        }
    }
    // What has come since any journal was last written to is the work of a run that could not note it: the disk was full, or it was
    // killed between the two. The next run finds it by its file.
    let unnoted = |key: &Key| noted.is_some() && modified(&store.artifact(key)) > noted;
    let (mut count, mut size, mut damaged) = (0u64, 0u64, 0u64);
    for key in store
        .keys()
        .map_err(failed())?
        .into_iter()
        .filter(|k| !used.contains(k) && !unnoted(k))
    {
        count += 1;
        size += store.size(&key).unwrap_or(0);
        if !args.dry_run {
            store.remove(&key).map_err(failed())?;
        }
    }
    // Of an earlier version: without a hash, so nothing uses them any more.
    for key in store.earlier_keys().map_err(failed())? {
        count += 1;
        size += size_of(&store.earlier_artifact(&key));
        if !args.dry_run {
            store.remove_earlier(&key).map_err(failed())?;
        }
    }
    for path in store.set_aside_before().map_err(failed())? {
        damaged += 1;
        size += match path.is_dir() {
            true => folder_size(&path),
            false => size_of(&path),
        };
    }
    if !args.dry_run {
        store.remove_set_aside().map_err(failed())?;
    }
    let mut old = 0u64;
    for run in store.runs().map_err(failed())? {
        for folder in run.old_checkpoints().map_err(failed())? {
            old += 1;
            size += folder_size(&folder);
            if !args.dry_run {
                std::fs::remove_dir_all(&folder).map_err(failed())?;
            }
        }
    }
    let verb = if args.dry_run {
        "would remove"
    } else {
        "removed"
    };
    if args.all && !args.dry_run {
        // `--store` may name a folder that holds other things too.
        store.clear().map_err(failed())?;
    }
    let s = if count == 1 { "" } else { "s" };
    let checkpoints = match old {
        0 => String::new(),
        1 => " and 1 old checkpoint".into(),
        n => format!(" and {n} old checkpoints"),
    };
    let aside = match damaged {
        0 => String::new(),
        1 => " and 1 damaged file that was set aside".into(),
        n => format!(" and {n} damaged files that were set aside"),
    };
    print(&format!(
        "{verb} {count} artifact{s}{checkpoints}{aside}, {}, in the store {}\n",
        bytes(size),
        store.root()
    ))
}

/// A journal from which it can be told what is in use.
///
/// # Errors
/// [`exit::DAMAGED`] when it is damaged: what it does not know any more would be removed.
fn whole(path: &Utf8Path) -> Result<Journal, Stop> {
    let why = match Journal::read(path) {
        Ok(journal) if !journal.is_damaged() => return Ok(journal),
        Ok(_) => String::new(),
        Err(e) => format!(": {e}"),
    };
    let text = format!(
        "the journal {path} is damaged{why}: it cannot be told which artifacts are in use, so nothing is removed. Run its workflow once, \
         which sets the journal aside and notes anew what is in use; or remove the whole store with --all"
    );
    Err(Stop::new(exit::DAMAGED, text))
}

/// Size of a file (bytes), 0 when it is not there.
fn size_of(path: &Utf8Path) -> u64 {
    std::fs::symlink_metadata(path).map_or(0, |m| m.len())
}

/// When a file was last written to, if it is there.
fn modified(path: &Utf8Path) -> Option<std::time::SystemTime> {
    std::fs::metadata(path).and_then(|m| m.modified()).ok()
}

/// Size of the files in a folder (bytes).
fn folder_size(folder: &Utf8Path) -> u64 {
    let files = folder.read_dir_utf8().into_iter().flatten().flatten();
    files
        .filter_map(|f| f.metadata().ok())
        .map(|m| m.len())
        .sum()
}
