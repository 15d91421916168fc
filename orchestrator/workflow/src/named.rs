//! Files that other files name: where they lie, and what is said when they cannot be read.

use crate::diagnostics::{Mention, Problems};
use camino::{Utf8Component, Utf8Path, Utf8PathBuf};
use plyflow_files::open::{self, FileError};
use plyflow_files::text::shown;

/// Reports a file that cannot be read, with the nearest name in its folder.
pub fn unreadable(
    problems: &mut Problems,
    &Mention {
        source,
        span,
        text: given,
    }: &Mention<'_>,
    path: &Utf8Path,
    error: &FileError,
) {
    let message = format!("cannot read `{}`: {error}", shown(given));
    let d = problems.add(source, span, message);
    d.once()
        .given(given)
        .expected(format!("a file; the path is relative to {}", source.folder));
    if !matches!(error, FileError::Missing) {
        return;
    }
    let beside: Vec<String> = path
        .parent()
        .and_then(|folder| folder.read_dir_utf8().ok())
        .into_iter()
        .flatten()
        .filter_map(|e| e.ok().map(|e| e.file_name().to_owned()))
        .collect();
    let name = path.file_name().unwrap_or_default();
    let mut beside: Vec<&str> = beside.iter().map(String::as_str).collect();
    beside.sort_unstable();
    // Differences that nobody sees: blanks at the ends, and forms of Unicode (more than one such name is there).
    let bare = |name: &str| open::composed(name.trim());
    let alike: Vec<&str> = beside
        .iter()
        .copied()
        .filter(|b| bare(b) == bare(name))
        .collect();
    if let Some(one) = alike.first() {
        d.help(match (one.trim() == *one, name.trim() == name) {
            (true, false) => format!(
                "the file `{}` is there: take the blank at the end of the path away",
                shown(one)
            ),
            (false, true) => format!(
                "the name of the file there has a blank at its end or begin: rename it to `{}`",
                shown(one.trim())
            ),
            _ => format!(
                "{} names there look alike, in other forms of Unicode: rename one of them",
                alike.len()
            ),
        });
    } else if let Some(nearest) = plyflow_model::nearest::nearest(name, beside) {
        d.help(format!(
            "did you mean `{}`, in the same folder?",
            shown(nearest)
        ));
    }
}

/// The absolute path of a file that is named in another one: where there is none of that name, that of the same name in another form of
/// Unicode. That is noted: a file of the very name may come later.
pub fn named(problems: &mut Problems, folder: &Utf8Path, text: &str) -> Utf8PathBuf {
    let path = absolute(folder, text);
    let found = open::in_other_form(path.as_std_path())
        .and_then(|found| Utf8PathBuf::from_path_buf(found).ok());
    match found {
        Some(found) if found != path => {
            problems.note_form(&path, &found);
            found
        }
        _ => path,
    }
}

/// The path, absolute, with `.` and `..` taken out. Behind a link to a folder `..` is the folder above the one that it leads to, as
/// the kernel has it: the path is then that of the file itself.
pub fn absolute(folder: &Utf8Path, text: &str) -> Utf8PathBuf {
    let mut real = Utf8PathBuf::new();
    let mut plain = Utf8PathBuf::new();
    let (mut back, mut all_real) = (false, true);
    for part in folder.join(text).components() {
        match part {
            Utf8Component::CurDir => {}
            Utf8Component::ParentDir => {
                back = true;
                plain.pop();
                match real.canonicalize_utf8() {
                    Ok(found) => real = found,
                    Err(_) => all_real = false,
                }
                real.pop();
            }
            part => {
                plain.push(part);
                real.push(part);
            }
        }
    }
    // The path as it was written, unless it names another file.
    let same = |file: &Utf8Path| file.canonicalize_utf8().ok();
    if !back || !all_real || same(&plain) == same(&real) {
        plain
    } else {
        real
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn behind_a_link_the_folder_above_is_that_of_where_it_leads() {
        let folder = tempfile::tempdir().unwrap();
        let root = Utf8PathBuf::from_path_buf(folder.path().canonicalize().unwrap()).unwrap();
        for file in ["c.csv", "real/c.csv", "real/sub/w.yaml", "plain/d.csv"] {
            let path = root.join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "x").unwrap();
        }
        std::os::unix::fs::symlink("real/sub", root.join("link")).unwrap();
        std::os::unix::fs::symlink("plain", root.join("way")).unwrap();
        let link = root.join("link");
        assert_eq!(absolute(&link, "../c.csv"), root.join("real/c.csv"));
        // As it was written, where that is the same file, and where there is none.
        assert_eq!(absolute(&link, "./w.yaml"), link.join("w.yaml"));
        let way = root.join("way");
        assert_eq!(absolute(&way, "x/../d.csv"), way.join("d.csv"));
        assert_eq!(absolute(&way, "../c.csv"), root.join("c.csv"));
        assert_eq!(absolute(&root, "none/../also/none"), root.join("also/none"));
        assert_eq!(absolute(&root, ".."), root.parent().unwrap());
        // Not another file of the name that a reading of the text would lead to.
        std::fs::remove_file(root.join("real/c.csv")).unwrap();
        assert_eq!(absolute(&link, "../c.csv"), root.join("real/c.csv"));
    }
}
