//! `demo`: copies the joggle spar into a new folder and runs it.

use super::args::{Cli, Command, DemoArgs};
use super::typed::quoted;
use super::{run, shipped};
use crate::exit;
use crate::said::{Done, Stop, print};
use camino::{Utf8Path, Utf8PathBuf};
use clap::Parser;

/// The folders that the demo consists of: its scene and workflows, and the materials that they name.
const FOLDERS: [&str; 2] = ["joggle-spar", "materials"];

/// `plyflow demo`.
///
/// # Errors
/// [`exit::USAGE`] when the folder is there already, or no workflows lie beside this program; otherwise as `plyflow run`.
pub fn demo(args: &DemoArgs) -> Done {
    let source = shipped::workflows()?;
    let variant = if args.coarse { "-coarse" } else { "" };
    let workflow = args
        .folder
        .join(format!("joggle-spar/workflow{variant}.yaml"));
    copy(&source, &args.folder, &workflow)?;
    print(&format!(
        "{}: the joggle spar was copied here\n",
        args.folder
    ))?;
    if args.no_run {
        return print(&format!(
            "to run it: plyflow run {}\n",
            quoted(workflow.as_str())
        ));
    }
    // As it is typed, so that what `run` does by default stands in one place.
    let jobs = args.jobs.map(|jobs| format!("--jobs={jobs}"));
    let words = ["plyflow", "run"].into_iter().chain(jobs.as_deref());
    let words = words.chain(["--", workflow.as_str()]);
    match Cli::try_parse_from(words).map(|cli| cli.command) {
        Ok(Command::Run(args)) => run::run(&args),
        Ok(_) => Err(Stop::new(exit::INTERNAL, "`run` is another command")),
        Err(e) => Err(Stop::new(exit::INTERNAL, e)),
    }
}

/// Copies the YAML files of the demo into `folder`, which must be new or empty.
fn copy(source: &Utf8Path, folder: &Utf8Path, workflow: &Utf8Path) -> Result<(), Stop> {
    if !is_new(folder) {
        let again = match workflow.is_file() {
            true => format!(
                ", or run what is there: plyflow run {}",
                quoted(workflow.as_str())
            ),
            false => String::new(),
        };
        let text = format!(
            "{folder} is there already, and nothing in it is overwritten: name a folder that does not exist yet, as in `plyflow demo my-spar`{again}"
        );
        return Err(Stop::new(exit::USAGE, text));
    }
    for name in FOLDERS {
        let (from, to) = (source.join(name), folder.join(name));
        let failed = || Stop::machine(format!("copying {from} to {to}"));
        std::fs::create_dir_all(&to).map_err(failed())?;
        for file in yaml_files(&from).map_err(failed())? {
            // Contents alone: files of an installation may not be written to, copies may.
            let bytes = std::fs::read(from.join(&file)).map_err(failed())?;
            std::fs::write(to.join(&file), bytes).map_err(failed())?;
        }
    }
    Ok(())
}

/// Whether there is nothing under this name, or an empty folder.
fn is_new(folder: &Utf8Path) -> bool {
    match std::fs::read_dir(folder) {
        Ok(mut entries) => entries.next().is_none(),
        Err(_) => folder.symlink_metadata().is_err(),
    }
}

/// Names of the YAML files of a folder, sorted.
fn yaml_files(folder: &Utf8Path) -> std::io::Result<Vec<Utf8PathBuf>> {
    let mut names = Vec::new();
    for entry in folder.read_dir_utf8()? {
        let path = entry?.into_path();
        if let Some(name) = path
            .file_name()
            .filter(|_| path.extension() == Some("yaml"))
        {
            names.push(Utf8PathBuf::from(name));
        }
    }
    names.sort();
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_there_is_never_overwritten() {
        let dir = tempfile::tempdir().unwrap();
        let root = Utf8Path::from_path(dir.path()).unwrap();
        for (file, text) in [
            ("joggle-spar/workflow.yaml", "w"),
            ("joggle-spar/notes.txt", "n"),
            ("materials/film.yaml", "f"),
        ] {
            let path = root.join("source").join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        let (source, folder) = (root.join("source"), root.join("new/demo"));
        let workflow = folder.join("joggle-spar/workflow.yaml");
        copy(&source, &folder, &workflow).unwrap();
        assert_eq!(std::fs::read_to_string(&workflow).unwrap(), "w");
        assert!(folder.join("materials/film.yaml").is_file());
        assert!(
            !folder.join("joggle-spar/notes.txt").exists(),
            "YAML alone is copied"
        );

        std::fs::write(&workflow, "mine").unwrap();
        let stop = copy(&source, &folder, &workflow).unwrap_err();
        assert_eq!(stop.code, exit::USAGE);
        assert!(stop.text.contains("plyflow run"), "{}", stop.text);
        assert_eq!(std::fs::read_to_string(&workflow).unwrap(), "mine");

        let file = root.join("file");
        std::fs::write(&file, "").unwrap();
        assert_eq!(
            copy(&source, &file, &workflow).unwrap_err().code,
            exit::USAGE
        );
        std::fs::create_dir(root.join("empty")).unwrap();
        copy(&source, &root.join("empty"), &workflow).unwrap();
    }
}
