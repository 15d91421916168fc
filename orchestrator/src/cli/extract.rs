//! `extract`: writes the files that an artifact carries.

use super::args::ExtractArgs;
use super::deliver::{Ready, told, unfit, write_all};
use super::inspect::artifact_of;
use super::open::open;
use super::table::{bytes, table};
use crate::exit;
use crate::said::{Done, Stop, print};
use camino::Utf8Path;
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
    print(&told(&write_all(&files, folder, args.force)?))
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

#[cfg(test)]
mod tests {
    use super::*;
    use camino::Utf8PathBuf;

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
}
