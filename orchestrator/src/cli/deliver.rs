//! Writes files that were made for the user into a folder that the user named: all of them or, where one is in the way, none.

use super::table::bytes;
use crate::exit;
use crate::said::Stop;
use camino::{Utf8Path, Utf8PathBuf};

/// A file with its bytes.
#[derive(Debug, PartialEq)]
pub struct Ready {
    /// Its name in the folder.
    pub name: String,
    /// What is in it.
    pub content: Vec<u8>,
}

/// Why a text cannot be the name of a file in the folder that the user gave.
pub fn unfit(name: &str) -> Option<&'static str> {
    if name.is_empty() {
        Some("is empty")
    } else if name.contains(['/', '\\']) {
        Some("names another folder")
    } else if name == "." || name.contains("..") {
        Some("could lead out of the folder")
    } else if name.chars().any(char::is_control) {
        Some("has a control character")
    } else if name.len() > 200 {
        Some("is too long")
    } else {
        None
    }
}

/// A file that lies in the folder now.
#[derive(Debug, PartialEq)]
pub struct Written {
    /// Its path, from the current folder.
    pub path: Utf8PathBuf,
    /// Its size.
    pub bytes: u64,
    /// Whether it was not there before, with the same content.
    pub new: bool,
}

/// What was done, for people.
pub fn told(all: &[Written]) -> String {
    let one = |w: &Written| {
        let what = if w.new { "" } else { ", as it was" };
        format!("{}: {}{what}\n", w.path, bytes(w.bytes))
    };
    all.iter().map(one).collect()
}

/// Writes all files or, when one is in the way, none; tells of each.
///
/// # Errors
/// [`exit::USAGE`] when something else is in the way, [`exit::INTERNAL`] when a disk fails.
pub fn write_all(files: &[Ready], folder: &Utf8Path, force: bool) -> Result<Vec<Written>, Stop> {
    let mut todo: Vec<(Utf8PathBuf, &Ready, bool)> = Vec::new();
    let mut in_the_way = Vec::new();
    for file in files {
        let path = folder.join(&file.name);
        // Not followed: what a link points to is not what the user named.
        match std::fs::symlink_metadata(&path) {
            Err(_) => todo.push((path, file, true)),
            Ok(m) if !m.is_file() => {
                let text = format!("{path} is in the way: it is no plain file; nothing is written");
                return Err(Stop::new(exit::USAGE, text));
            }
            Ok(_) => {
                let same = std::fs::read(&path).is_ok_and(|b| b == file.content);
                if !same && !force {
                    in_the_way.push(path.to_string());
                }
                todo.push((path, file, !same));
            }
        }
    }
    if !in_the_way.is_empty() {
        let text = format!(
            "{} in the way, with another content: {}; nothing is written; use --to DIR for another folder or --force \
             to replace",
            if in_the_way.len() == 1 {
                "a file is"
            } else {
                "files are"
            },
            in_the_way.join(", ")
        );
        return Err(Stop::new(exit::USAGE, text));
    }
    std::fs::create_dir_all(folder)
        .map_err(Stop::machine(format!("making the folder {folder}")))?;
    let mut written = Vec::new();
    for (path, file, new) in todo {
        if new {
            write(&path, &file.content).map_err(Stop::machine(format!("writing {path}")))?;
        }
        let bytes = file.content.len() as u64;
        written.push(Written { path, bytes, new });
    }
    Ok(written)
}

/// Under a temporary name first, so that a whole file is there at any moment.
fn write(path: &Utf8Path, content: &[u8]) -> std::io::Result<()> {
    plyflow_artifact::whole::write(path.as_std_path(), content)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder() -> (tempfile::TempDir, Utf8PathBuf) {
        let dir = tempfile::tempdir().unwrap();
        let path = Utf8PathBuf::from_path_buf(dir.path().to_owned()).unwrap();
        (dir, path)
    }

    fn file(name: &str, text: &str) -> Ready {
        Ready {
            name: name.into(),
            content: text.into(),
        }
    }

    #[test]
    fn another_file_is_never_replaced_without_force_and_then_nothing_is_written() {
        let (_keep, dir) = folder();
        let to = dir.join("new/folder");
        let all = [file("a", "1\n"), file("b", "2\n")];
        assert_eq!(
            told(&write_all(&all, &to, false).unwrap()),
            format!("{to}/a: 2 B\n{to}/b: 2 B\n")
        );
        // The same content is no reason to stop.
        assert!(told(&write_all(&all, &to, false).unwrap()).contains("as it was"));
        std::fs::write(to.join("b"), "mine").unwrap();
        std::fs::remove_file(to.join("a")).unwrap();
        let stop = write_all(&all, &to, false).unwrap_err();
        assert_eq!(stop.code, exit::USAGE);
        assert!(stop.text.contains("/b") && stop.text.contains("--force"));
        assert!(!to.join("a").exists());
        assert_eq!(std::fs::read_to_string(to.join("b")).unwrap(), "mine");
        write_all(&all, &to, true).unwrap();
        assert_eq!(std::fs::read_to_string(to.join("b")).unwrap(), "2\n");
        assert_eq!(std::fs::read_dir(&to).unwrap().count(), 2);
    }

    #[test]
    fn links_and_folders_are_never_written_through_even_with_force() {
        let (_keep, dir) = folder();
        std::fs::create_dir(dir.join("a")).unwrap();
        std::os::unix::fs::symlink(dir.join("elsewhere"), dir.join("b")).unwrap();
        for name in ["a", "b"] {
            let stop = write_all(&[file(name, "t")], &dir, true).unwrap_err();
            assert!(stop.text.contains("no plain file"), "{}", stop.text);
        }
        assert!(!dir.join("elsewhere").exists());
    }
}
