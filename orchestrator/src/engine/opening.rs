//! Opens the journal of a run, and says what of its files was found damaged.

use crate::store::{Journal, RunFolder, Scanned, Store};
use camino::{Utf8Path, Utf8PathBuf};
use std::io;

/// The journal of a run that writes, and what of its files was found damaged.
pub(super) fn open_for_writing(
    store: &Store,
    folder: &RunFolder,
    ahead: Option<Scanned>,
) -> io::Result<(Journal, Vec<String>)> {
    let named = |what: &Utf8Path| {
        let what = what.to_owned();
        move |e: io::Error| io::Error::new(e.kind(), format!("{what}: {e}"))
    };
    folder.prepare().map_err(named(&folder.tmp()))?;
    store.clear_killed();
    let mut told = store.take_unplaced(folder);
    let path = folder.journal();
    let kept = |place: Option<Utf8PathBuf>| {
        place.map_or(String::new(), |p| format!("; it is kept as {p}"))
    };
    let journal = match Journal::open_with(&path, ahead) {
        Ok(journal) => journal,
        Err(e) if path.symlink_metadata().is_ok() => {
            // A folder, or a file that may not be read: without it all is found by its files.
            let place = kept(store.set_aside(&path)?);
            let text = format!("the journal {path} is damaged: {e}{place}, and a new one begun");
            told.push(text);
            Journal::open(&path).map_err(named(&path))?
        }
        Err(e) => return Err(named(&path)(e)),
    };
    if journal.is_damaged() {
        let place = kept(store.set_aside(&Journal::damaged_file(&path))?);
        told.push(format!(
            "the journal {path} is damaged{place}; what could be read of it goes on in a new one. Artifacts are found without it"
        ));
    }
    Ok((journal, told))
}

/// The journal for a session that only looks, and whether it was found damaged.
pub(super) fn look_at_journal(folder: &RunFolder) -> io::Result<(Journal, Vec<String>)> {
    let path = folder.journal();
    let (journal, why) = match Journal::read(&path) {
        Ok(journal) => {
            let why = journal.is_damaged().then(String::new);
            (journal, why)
        }
        Err(e) => (Journal::empty(&path), Some(format!(": {e}"))),
    };
    let told = why.map(|why| {
        format!(
            "the journal {path} is damaged{why}; what ran before may be told wrongly or not at all. The next run sets it aside"
        )
    });
    Ok((journal, told.into_iter().collect()))
}
