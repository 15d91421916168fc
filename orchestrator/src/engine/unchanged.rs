//! Whether the libraries and files of a step still have the bytes that its key was made of.
//!
//! A key is made when a run begins, and steps start hours later: what has been built or edited anew in between would be stored under the
//! key of the old.

use camino::{Utf8Path, Utf8PathBuf};
use plyflow_files::open;
use plyflow_workflow::resolved::ResolvedStep;
use std::collections::HashMap;
use std::io;

/// What a file system tells of a file: as long as it is the same, so are the bytes.
type Stamp = [i128; 5];

/// Files that have been looked at, with their stamps while they had the bytes of their hash.
#[derive(Debug, Default)]
pub struct Unchanged {
    seen: HashMap<(Utf8PathBuf, String), Stamp>,
}

fn stamp(path: &Utf8Path) -> io::Result<Stamp> {
    let s = rustix::fs::stat(path.as_std_path())?;
    let time = |seconds: i128, nanoseconds: i128| seconds * 1_000_000_000 + nanoseconds;
    Ok([
        s.st_dev.into(),
        s.st_ino.into(),
        s.st_size.into(),
        time(s.st_mtime.into(), s.st_mtime_nsec.into()),
        time(s.st_ctime.into(), s.st_ctime_nsec.into()),
    ])
}

impl Unchanged {
    /// The first library or file of a step that is no longer what it was when the run began, in words for the user.
    pub fn first_changed(&mut self, step: &ResolvedStep) -> Option<String> {
        let libraries = std::iter::once(&step.plugin).chain(&step.components);
        let libraries = libraries.map(|p| ("plugin", &p.path, &p.hash));
        let files = step.files.iter().map(|f| ("file", &f.path, &f.hash));
        for (what, path, hash) in libraries.chain(files) {
            let now = match self.is_same(path, hash) {
                Ok(true) => continue,
                Ok(false) => "has changed".to_owned(),
                Err(e) => format!("cannot be read any more ({e})"),
            };
            return Some(format!(
                "the {what} {path} {now} since this run began; run again, and what is finished is kept"
            ));
        }
        None
    }

    fn is_same(&mut self, path: &Utf8Path, hash: &str) -> io::Result<bool> {
        let now = stamp(path)?;
        let key = (path.to_owned(), hash.to_owned());
        if self.seen.get(&key) == Some(&now) {
            return Ok(true);
        }
        // A pipe that took a file's place would be waited for.
        let bytes = open::read(path.as_std_path(), open::MOST_DATA).map_err(io::Error::other)?;
        let same = blake3::hash(&bytes).to_hex().as_str() == hash;
        if same {
            // Taken before the bytes were read: a change in between has a later one.
            self.seen.insert(key, now);
        }
        Ok(same)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_decide_and_not_dates() {
        let folder = tempfile::tempdir().unwrap();
        let path = Utf8PathBuf::from_path_buf(folder.path().join("tool.stl")).unwrap();
        std::fs::write(&path, "solid a").unwrap();
        let hash = blake3::hash(b"solid a").to_hex().to_string();
        let mut files = Unchanged::default();
        assert!(files.is_same(&path, &hash).unwrap());
        assert!(files.is_same(&path, &hash).unwrap(), "by its stamp");
        // The same bytes in another file, as a build may leave them.
        std::fs::remove_file(&path).unwrap();
        std::fs::write(&path, "solid a").unwrap();
        assert!(files.is_same(&path, &hash).unwrap());
        std::fs::write(&path, "solid b").unwrap();
        assert!(!files.is_same(&path, &hash).unwrap());
        std::fs::write(&path, "solid a").unwrap();
        assert!(files.is_same(&path, &hash).unwrap(), "it came back");
        std::fs::remove_file(&path).unwrap();
        assert!(files.is_same(&path, &hash).is_err());
    }
}
