//! `extract`: writes the files that an artifact carries.

use super::args::ExtractArgs;
use super::inspect::artifact_of;
use super::open::open;
use super::table::{bytes, table};
use crate::exit;
use crate::said::{Done, Stop, print};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_artifact::{Artifact, DType};
use plyflow_model::artifact::CarriedFile;
use serde::Deserialize;
use serde_json::Value;

/// `plyflow extract`.
///
/// # Errors
/// [`exit::USAGE`] when the step has no artifact or no files, or when another file is in the way;
/// [`exit::INTERNAL`] when what the step wrote cannot be used or a file cannot be written. Nothing is written then, but
/// what was before a disk failed.
pub fn extract(args: &ExtractArgs) -> Done {
    let opened = open(&args.workflow)?;
    let path = artifact_of(&opened, &args.step, &args.workflow.workflow)?;
    let artifact = Artifact::open(path.as_std_path()).map_err(|e| Stop::new(exit::INTERNAL, e))?;
    let unusable = |e: NoFiles| Stop::new(exit::INTERNAL, format!("{}: {e}; {path}", args.step));
    let files = files(artifact.attributes()).map_err(unusable)?;
    if files.is_empty() {
        let text = format!(
            "the artifact of {} carries no files; what it holds: plyflow inspect '{}' --workflow {}",
            args.step, args.step, args.workflow.workflow
        );
        return Err(Stop::new(exit::USAGE, text));
    }
    let read = files.iter().map(|f| ready(f, &artifact));
    let files: Vec<Ready> = read.collect::<Result<_, _>>().map_err(unusable)?;
    if args.list {
        let row = |f: &Ready| vec![f.name.clone(), bytes(f.content.len() as u64)];
        let rows: Vec<Vec<String>> = files.iter().map(row).collect();
        return print(&table(&["file", "size"], &rows, &[1]));
    }
    let here = Utf8Path::new(".");
    let folder = args.to.as_deref().unwrap_or(here);
    print(&write_all(&files, folder, args.force)?)
}

/// Why the files of an artifact cannot be used.
#[derive(Debug, thiserror::Error)]
enum NoFiles {
    #[error("its attributes: {0}")]
    Attributes(serde_json::Error),
    #[error("its attribute 'files' is no list of a name with a text or an array: {0}")]
    List(serde_json::Error),
    #[error("its file {name:?} has {given}; expected one of them; nothing is written")]
    Content { name: String, given: &'static str },
    #[error("its file {name:?} is to be the array '{array}', {why}; nothing is written")]
    Array {
        name: String,
        array: String,
        why: String,
    },
    #[error("it carries a file with the name {name:?}, which {why}; nothing is written")]
    Unfit { name: String, why: &'static str },
    #[error("it carries two files with the name {0:?}; nothing is written")]
    Twice(String),
}

/// The files in the attributes of an artifact, each with a name that stays in its folder.
fn files(attributes: &str) -> Result<Vec<CarriedFile>, NoFiles> {
    let attributes: Value = serde_json::from_str(attributes).map_err(NoFiles::Attributes)?;
    if attributes["files"].is_null() {
        return Ok(Vec::new());
    }
    let files = Vec::<CarriedFile>::deserialize(&attributes["files"]).map_err(NoFiles::List)?;
    for (i, file) in files.iter().enumerate() {
        let name = &file.name;
        if let Some(why) = unfit(name) {
            let name = name.clone();
            return Err(NoFiles::Unfit { name, why });
        }
        let given = match (&file.text, &file.array) {
            (None, None) => Some("neither `text` nor `array`"),
            (Some(_), Some(_)) => Some("`text` and `array`"),
            _ => None,
        };
        if let Some(given) = given {
            let name = name.clone();
            return Err(NoFiles::Content { name, given });
        }
        if files[..i].iter().any(|f| f.name == *name) {
            return Err(NoFiles::Twice(name.clone()));
        }
    }
    Ok(files)
}

/// A file with its bytes.
#[derive(Debug, PartialEq)]
struct Ready {
    name: String,
    content: Vec<u8>,
}

/// Reads the array of a file that is one.
fn ready(file: &CarriedFile, artifact: &Artifact) -> Result<Ready, NoFiles> {
    let (name, text) = (file.name.clone(), file.text.clone().unwrap_or_default());
    let Some(array) = file.array.clone() else {
        let content = text.into_bytes();
        return Ok(Ready { name, content });
    };
    let wrong = |why: String| NoFiles::Array {
        name: name.clone(),
        array: array.clone(),
        why,
    };
    let info = artifact.contents().array(&array);
    let info = info.ok_or_else(|| wrong("and the artifact has no such array".into()))?;
    let (DType::U8, [n]) = (info.dtype, &info.shape[..]) else {
        return Err(wrong(format!(
            "which has the type {:?} and the shape {:?}; expected bytes (u8) with one index",
            info.dtype, info.shape
        )));
    };
    let mut content = vec![0; *n as usize];
    let read = artifact.read_array(&array, DType::U8, &mut content);
    read.map_err(|e| wrong(format!("which cannot be read: {e}")))?;
    Ok(Ready { name, content })
}

/// Why a text cannot be the name of a file in the folder that the user gave.
fn unfit(name: &str) -> Option<&'static str> {
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

/// Writes all files or, when one is in the way, none; says what was done.
fn write_all(files: &[Ready], folder: &Utf8Path, force: bool) -> Result<String, Stop> {
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
    let mut out = String::new();
    for (path, file, new) in todo {
        if new {
            write(&path, &file.content).map_err(Stop::machine(format!("writing {path}")))?;
        }
        let size = bytes(file.content.len() as u64);
        let what = if new { "" } else { ", as it was" };
        out += &format!("{path}: {size}{what}\n");
    }
    Ok(out)
}

/// Under a temporary name first, so that a whole file is there at any moment.
fn write(path: &Utf8Path, content: &[u8]) -> std::io::Result<()> {
    plyflow_artifact::whole::write(path.as_std_path(), content)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attributes(name: &str) -> String {
        serde_json::json!({"files": [{"name": name, "text": "t"}]}).to_string()
    }

    #[test]
    fn names_that_lead_elsewhere_are_refused_and_say_why() {
        for name in [
            "", ".", "..", "../a", "a/b", "/etc/a", "a\\b", "a..b", "a\nb", "a\0",
        ] {
            let error = files(&attributes(name)).unwrap_err().to_string();
            assert!(error.contains("nothing is written"), "{name:?}: {error}");
        }
        assert!(files(&attributes(&"a".repeat(300))).is_err());
        for name in ["material.yaml", ".hidden", "Träger 1.csv", "a-b_c.d"] {
            assert_eq!(files(&attributes(name)).unwrap()[0].name, name);
        }
    }

    #[test]
    fn attributes_without_files_have_none_and_odd_ones_are_refused() {
        assert_eq!(files("{}").unwrap(), []);
        assert_eq!(files("{\"files\": []}").unwrap(), []);
        for odd in [
            "",
            "{\"files\": 5}",
            "{\"files\": [{\"name\": \"a\"}]}",
            "{\"files\": [{\"name\": \"a\", \"text\": \"t\", \"array\": \"b\"}]}",
        ] {
            assert!(files(odd).is_err(), "{odd}");
        }
        let twice = r#"{"files": [{"name": "a", "text": "1"}, {"name": "a", "text": "2"}]}"#;
        assert!(matches!(files(twice), Err(NoFiles::Twice(_))));
    }

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
    fn bytes_of_an_array_are_a_file_and_other_arrays_are_refused() {
        use plyflow_artifact::ArtifactWriter;
        let (_keep, dir) = folder();
        let path = dir.join("a.vtkhdf");
        let mut writer = ArtifactWriter::create(path.as_std_path(), "export").unwrap();
        let all: Vec<u8> = (0..=255).collect();
        let size = [all.len() as u64];
        writer
            .array("files/odd", DType::U8, &size, "", &all)
            .unwrap();
        writer
            .array("files/wide", DType::U8, &[16, 16], "", &all)
            .unwrap();
        writer
            .array("time", DType::F64, &[32], "s", &[0; 256])
            .unwrap();
        writer.finish(&serde_json::json!({})).unwrap();
        let artifact = Artifact::open(path.as_std_path()).unwrap();
        let of = |array: &str| CarriedFile {
            name: "part.bin".into(),
            text: None,
            array: Some(array.into()),
        };
        let read = ready(&of("files/odd"), &artifact).unwrap();
        assert_eq!((read.name.as_str(), &read.content), ("part.bin", &all));
        for (array, why) in [
            ("files/none", "has no such array"),
            ("files/wide", "the shape [16, 16]"),
            ("time", "the type F64"),
        ] {
            let error = ready(&of(array), &artifact).unwrap_err().to_string();
            assert!(error.contains(array) && error.contains(why), "{error}");
        }
    }

    #[test]
    fn another_file_is_never_replaced_without_force_and_then_nothing_is_written() {
        let (_keep, dir) = folder();
        let to = dir.join("new/folder");
        let all = [file("a", "1\n"), file("b", "2\n")];
        assert_eq!(
            write_all(&all, &to, false).unwrap(),
            format!("{to}/a: 2 B\n{to}/b: 2 B\n")
        );
        // The same content is no reason to stop.
        assert!(write_all(&all, &to, false).unwrap().contains("as it was"));
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
