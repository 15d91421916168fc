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
use std::io;

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
    let mut removed = Removed {
        dry_run: args.dry_run,
        ..Removed::default()
    };
    let unused = unused(&store, args.all)?;
    removed.artifacts(&store, &unused).map_err(failed())?;
    removed.lone_records(&store).map_err(failed())?;
    removed.set_aside(&store).map_err(failed())?;
    removed.checkpoints(&store).map_err(failed())?;
    if args.all && !args.dry_run {
        // `--store` may name a folder that holds other things too.
        store.clear().map_err(failed())?;
    }
    print(&removed.text(&store))
}

/// Keys of artifacts that no workflow's last run uses; `all`: of all artifacts.
fn unused(store: &Store, all: bool) -> Result<Vec<Key>, Stop> {
    let failed = || Stop::machine(format!("cleaning {}", store.root()));
    let (mut used, mut known) = (BTreeSet::new(), BTreeSet::new());
    let (mut noted, now) = (None, std::time::SystemTime::now());
    let mut is_ahead = false;
    if !all {
        for run in store.runs().map_err(failed())? {
            let journal = whole(&run.journal())?;
            used.extend(journal.last_keys());
            known.extend(journal.known_keys());
            let written = modified(&run.journal());
            is_ahead |= written > Some(now);
            noted = noted.max(written);
        }
    }
    // What has come since any journal was last written to is the work of a run that could not note it: the disk was full, or it was
    // killed between the two. The next run finds it by its file.
    let later = |key: &Key| noted.is_some() && modified(&store.artifact(key)) > noted;
    // A journal from the future: the clock was set back since, and dates tell nothing until the next run has written to it.
    let unnoted = |key: &Key| later(key) || (is_ahead && !known.contains(key));
    let mut keys = store.keys().map_err(failed())?;
    keys.retain(|k| !used.contains(k) && !unnoted(k));
    Ok(keys)
}

/// What has been removed, or would be.
#[derive(Default)]
struct Removed {
    dry_run: bool,
    artifacts: u64,
    set_aside: u64,
    checkpoints: u64,
    size: u64,
}

impl Removed {
    fn artifacts(&mut self, store: &Store, unused: &[Key]) -> io::Result<()> {
        for key in unused {
            self.artifacts += 1;
            self.size += store.size(key).unwrap_or(0);
            if !self.dry_run {
                store.remove(key)?;
            }
        }
        // Of an earlier version: without a hash, so nothing uses them any more.
        for key in store.earlier_keys()? {
            self.artifacts += 1;
            self.size += size_of(&store.earlier_artifact(&key));
            if !self.dry_run {
                store.remove_earlier(&key)?;
            }
        }
        Ok(())
    }

    /// Records without an artifact: what a run has left that was killed between the two.
    fn lone_records(&mut self, store: &Store) -> io::Result<()> {
        for key in store.recorded_keys()? {
            if store.size(&key).is_none() && !store.has_earlier(&key) {
                self.size += size_of(&store.record(&key));
                if !self.dry_run {
                    std::fs::remove_file(store.record(&key))?;
                }
            }
        }
        Ok(())
    }

    fn set_aside(&mut self, store: &Store) -> io::Result<()> {
        for path in store.set_aside_before()? {
            self.set_aside += 1;
            self.size += match path.is_dir() {
                true => folder_size(&path),
                false => size_of(&path),
            };
        }
        match self.dry_run {
            true => Ok(()),
            false => store.remove_set_aside(),
        }
    }

    fn checkpoints(&mut self, store: &Store) -> io::Result<()> {
        for run in store.runs()? {
            for folder in run.old_checkpoints()? {
                self.checkpoints += 1;
                self.size += folder_size(&folder);
                if !self.dry_run {
                    std::fs::remove_dir_all(&folder)?;
                }
            }
        }
        Ok(())
    }

    fn text(&self, store: &Store) -> String {
        let verb = if self.dry_run {
            "would remove"
        } else {
            "removed"
        };
        let s = if self.artifacts == 1 { "" } else { "s" };
        let checkpoints = match self.checkpoints {
            0 => String::new(),
            1 => " and 1 old checkpoint".into(),
            n => format!(" and {n} old checkpoints"),
        };
        let aside = match self.set_aside {
            0 => String::new(),
            1 => " and 1 damaged file that was set aside".into(),
            n => format!(" and {n} damaged files that were set aside"),
        };
        format!(
            "{verb} {} artifact{s}{checkpoints}{aside}, {}, in the store {}\n",
            self.artifacts,
            bytes(self.size),
            store.root()
        )
    }
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
