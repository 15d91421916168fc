//! What lies beside this program: the workflows that come along.

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
            installed(&program)
        );
        Stop::new(exit::USAGE, text)
    })
}

/// Where an installation has them: two folders above the program, as for `/usr/bin` and `/usr/share`.
fn installed(program: &Utf8Path) -> Utf8PathBuf {
    let prefix = program.parent().and_then(Utf8Path::parent);
    prefix
        .unwrap_or(Utf8Path::new("/"))
        .join("share/plyflow/workflows")
}

fn found(program: &Utf8Path) -> Option<Utf8PathBuf> {
    let installed = installed(program);
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
