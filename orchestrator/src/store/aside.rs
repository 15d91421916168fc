//! Where damaged files go: kept under another name, so that somebody can look at them and nothing takes them for whole.

use super::folder::Store;
use super::names::{free_name, list};
use crate::plan::Key;
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_artifact::seal::{read_document, sealed};
use std::{fs, io};

impl Store {
    /// The folder of what was found damaged.
    pub fn damaged(&self) -> Utf8PathBuf {
        self.root().join("damaged")
    }

    /// Moves a file (or whatever lies there instead of one) to [`Store::damaged`]; gives its new place, `None` when nothing is there.
    ///
    /// # Errors
    /// When it cannot be moved.
    pub fn set_aside(&self, path: &Utf8Path) -> io::Result<Option<Utf8PathBuf>> {
        // Not followed: a link is moved, not what it points to.
        match fs::symlink_metadata(path) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(e),
            Ok(_) => {}
        }
        let folder = self.damaged();
        if fs::symlink_metadata(&folder).is_ok_and(|m| !m.is_dir()) {
            fs::rename(&folder, free_name(&folder.with_extension("old")))?;
        }
        fs::create_dir_all(&folder)?;
        // The name tells where it was: `runs/study/journal` is kept as `runs-study-journal`.
        let inside = path.strip_prefix(self.root()).unwrap_or(path);
        let is_artifact = inside.starts_with("artifacts");
        let name = match path.file_name() {
            Some(name) if is_artifact => name.to_owned(),
            _ => inside.as_str().trim_start_matches('/').replace('/', "-"),
        };
        let to = free_name(&folder.join(&name));
        match fs::rename(path, &to) {
            // Another command was faster.
            Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(None),
            other => other.map(|()| Some(to)),
        }
    }

    /// Moves both files of a key aside and says so.
    pub fn set_key_aside(&self, key: &Key) -> String {
        let (artifact, record) = (self.artifact(key), self.record(key));
        // The artifact first, so that none is left without a record.
        let moved = self.set_aside(&artifact);
        let moved = moved.and_then(|a| Ok([a, self.set_aside(&record)?]));
        match moved {
            Ok(places) => match places.into_iter().flatten().next() {
                Some(place) => format!("it is kept as {place}"),
                None => "it has gone".into(),
            },
            Err(e) => format!("it cannot be moved to {}: {e}", self.damaged()),
        }
    }

    /// What is known of plugin libraries.
    pub fn plugins(&self) -> Utf8PathBuf {
        self.root().join("plugins.json")
    }

    /// Sets what is known of plugin libraries aside when it is damaged, and says so: the libraries are looked at anew.
    pub fn set_damaged_plugins_aside(&self) -> Option<String> {
        let path = self.plugins();
        let why = damage_of_plugins(&path)?;
        let place = match self.set_aside(&path) {
            Ok(Some(place)) => format!("it is kept as {place}"),
            Ok(None) => return None,
            Err(e) => format!("it cannot be moved to {}: {e}", self.damaged()),
        };
        Some(format!(
            "what was noted of plugin libraries in {path} is damaged: {why}; {place}, and the libraries are looked at anew"
        ))
    }

    /// Makes room where a file is to be placed: what is no file there goes aside.
    pub(super) fn free(&self, path: &Utf8Path) -> io::Result<()> {
        match fs::symlink_metadata(path) {
            Ok(found) if found.is_dir() => self.set_aside(path).map(drop),
            _ => Ok(()),
        }
    }

    /// What has been set aside, sorted.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub fn set_aside_before(&self) -> io::Result<Vec<Utf8PathBuf>> {
        match self.damaged().is_dir() {
            true => list(&self.damaged()),
            false => Ok(Vec::new()),
        }
    }

    /// Removes what has been set aside.
    ///
    /// # Errors
    /// When it cannot be removed.
    pub fn remove_set_aside(&self) -> io::Result<()> {
        let folder = self.damaged();
        match fs::symlink_metadata(&folder) {
            Ok(found) if found.is_dir() => fs::remove_dir_all(&folder),
            _ => Ok(()),
        }
    }
}

/// Why the note of plugin libraries is not what was written, when it is there and is not.
pub fn damage_of_plugins(path: &Utf8Path) -> Option<String> {
    let bytes = match read_document(path.as_std_path()) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return None,
        Err(e) => return Some(e.to_string()),
    };
    let why = sealed(&bytes).err()?;
    // Those of the earlier version had no seal; they are not used any more.
    let earlier = serde_json::from_slice::<serde_json::Value>(&bytes)
        .is_ok_and(|v| v["version"] == 1 && v["seal"].is_null());
    (!earlier).then(|| why.to_string())
}
