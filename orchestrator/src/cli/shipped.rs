//! What lies beside this program: the workflows that come along, and the crates of which plugins in Rust are built.

use super::open::program;
use super::python::SOURCE_KNOWN_BY;
use crate::exit;
use crate::said::Stop;
use camino::{Utf8Path, Utf8PathBuf};

/// By this file a folder of shipped workflows is known.
const KNOWN_BY: &str = "joggle-spar/workflow.yaml";

/// The folder of the workflows that come along: `share/plyflow/workflows` of an installation, or `workflows` of the source tree in which
/// this program was built.
///
/// # Errors
/// [`exit::USAGE`] when there is none, with where it was looked for.
pub fn workflows() -> Result<Utf8PathBuf, Stop> {
    let program = program()?;
    found(&program).ok_or_else(|| {
        let text = format!(
            "no workflows lie beside this program: looked for {} and for a source tree above {program}. Install Plyflow from its wheel, or run it from the tree in which it was built",
            installed(&program, "workflows")
        );
        Stop::new(exit::USAGE, text)
    })
}

/// By this file a folder is known to hold the crates of which plugins in Rust are built.
const CRATES_KNOWN_BY: &str = "solver-plugins/door/sdk/Cargo.toml";

/// The folder below which the crates lie that a plugin in Rust needs, at the places that they have in the source: `given`, or
/// `share/plyflow/crates` of an installation, or the source tree in which this program was built.
///
/// # Errors
/// [`exit::USAGE`] when they are not there, with where they were looked for.
pub fn crates(given: Option<&Utf8Path>) -> Result<Utf8PathBuf, Stop> {
    if let Some(given) = given {
        let full = given.canonicalize_utf8().ok();
        return full.filter(|f| f.join(CRATES_KNOWN_BY).is_file()).ok_or_else(|| {
            let text = format!(
                "--source {given}: there is no {CRATES_KNOWN_BY} in it; expected the folder of Plyflow's source, or `share/plyflow/crates` of an installation"
            );
            Stop::new(exit::USAGE, text)
        });
    }
    let program = program()?;
    crates_beside(&program).ok_or_else(|| {
        let text = format!(
            "a plugin in Rust is built of Plyflow's crates, and none lie beside this program: looked for {} and for a source tree above {program}. \
             Say where Plyflow's source is with --source DIR, or take --c, which needs nothing but a compiler",
            installed(&program, "crates")
        );
        Stop::new(exit::USAGE, text)
    })
}

fn crates_beside(program: &Utf8Path) -> Option<Utf8PathBuf> {
    let installed = installed(program, "crates");
    let mut folders = std::iter::once(installed.as_path()).chain(program.ancestors().skip(1));
    let found = folders.find(|f| f.join(CRATES_KNOWN_BY).is_file());
    found.map(Utf8Path::to_owned)
}

/// Where an installation has a folder: two folders above the program, as for `/usr/bin` and `/usr/share`.
fn installed(program: &Utf8Path, what: &str) -> Utf8PathBuf {
    let prefix = program.parent().and_then(Utf8Path::parent);
    prefix
        .unwrap_or(Utf8Path::new("/"))
        .join("share/plyflow")
        .join(what)
}

fn found(program: &Utf8Path) -> Option<Utf8PathBuf> {
    let installed = installed(program, "workflows");
    if installed.join(KNOWN_BY).is_file() {
        return Some(installed);
    }
    let is_source = |folder: &&Utf8Path| {
        folder.join(SOURCE_KNOWN_BY).is_file() && folder.join("workflows").join(KNOWN_BY).is_file()
    };
    let source = program.ancestors().skip(1).find(is_source)?;
    Some(source.join("workflows"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn make(root: &Utf8Path, file: &str) {
        let path = root.join(file);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, "").unwrap();
    }

    #[test]
    fn crates_are_looked_for_where_the_user_says_and_a_folder_without_them_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let root = Utf8Path::from_path(dir.path())
            .unwrap()
            .canonicalize_utf8()
            .unwrap();
        let stop = crates(Some(&root)).unwrap_err();
        assert_eq!(stop.code, exit::USAGE);
        assert!(
            stop.text.contains("--source") && stop.text.contains(CRATES_KNOWN_BY),
            "{}",
            stop.text
        );
        make(&root, CRATES_KNOWN_BY);
        assert_eq!(crates(Some(&root.join("."))).unwrap(), root);

        make(
            &root,
            "installed/share/plyflow/crates/solver-plugins/door/sdk/Cargo.toml",
        );
        let beside = |program: &str| crates_beside(&root.join(program));
        let shipped = root.join("installed/share/plyflow/crates");
        assert_eq!(beside("installed/bin/plyflow"), Some(shipped));
        assert_eq!(beside("target/release/plyflow"), Some(root.clone()));
        std::fs::remove_file(root.join(CRATES_KNOWN_BY)).unwrap();
        assert_eq!(beside("target/release/plyflow"), None);
    }

    #[test]
    fn workflows_are_found_in_an_installation_and_in_a_source_tree_and_nowhere_else() {
        let dir = tempfile::tempdir().unwrap();
        let root = Utf8Path::from_path(dir.path()).unwrap();
        let built = root.join("source/target/release/plyflow");
        make(root, "source/workflows/joggle-spar/workflow.yaml");
        assert_eq!(
            found(&built),
            None,
            "a folder of that name alone is no source tree"
        );
        make(root, "source/schemas/abi/plyflow.h");
        assert_eq!(found(&built), Some(root.join("source/workflows")));

        let packaged = root.join("installed/bin/plyflow");
        assert_eq!(found(&packaged), None);
        make(
            root,
            "installed/share/plyflow/workflows/joggle-spar/workflow.yaml",
        );
        let expected = root.join("installed/share/plyflow/workflows");
        assert_eq!(found(&packaged), Some(expected));
    }
}
