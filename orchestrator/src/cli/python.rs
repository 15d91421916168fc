//! By what plugins in Python are made: the interpreter, the package, and where what is made is kept.

use camino::{Utf8Path, Utf8PathBuf};
use plyflow_plugin_host::{CARRIERS, Python};
use std::env;

/// By this file a folder above the program is known to be Plyflow's source.
pub const SOURCE_KNOWN_BY: &str = "schemas/abi/plyflow.h";

/// Names the interpreter; the command of the wheel sets it to its own.
const INTERPRETER: &str = "PLYFLOW_PYTHON";

/// What this program makes plugins in Python with; `installation`: the folders of its own libraries.
pub fn python(program: &Utf8Path, installation: &[Utf8PathBuf]) -> Python {
    let bridge = installation
        .iter()
        .map(|folder| folder.join(format!("{CARRIERS}step.so")));
    Python {
        interpreter: interpreter(),
        package: package(program),
        bridge: bridge.into_iter().find(|file| file.is_file()),
        folder: cache(),
    }
}

/// The folder that holds the package `plyflow` for Python: of the wheel in which this program lies, or of the source tree in which it was built.
fn package(program: &Utf8Path) -> Option<Utf8PathBuf> {
    let has = |folder: &&Utf8Path| folder.join("plyflow/__init__.py").is_file();
    // `plyflow/_prefix/bin/plyflow`
    let wheel = program.ancestors().nth(4).filter(has);
    let source = || {
        let mut above = program.ancestors().skip(1);
        above.find(|folder| folder.join(SOURCE_KNOWN_BY).is_file())
    };
    let source = || Some(source()?.join("orchestrator/python"));
    wheel
        .map(Utf8Path::to_owned)
        .or_else(|| source().filter(|f| has(&f.as_path())))
}

/// The interpreter that the user names, or the first `python3` on the path, by its full path: another one on another path is another one.
fn interpreter() -> String {
    let given = env::var(INTERPRETER).unwrap_or_default();
    if given.contains('/') {
        return given;
    }
    let name = if given.is_empty() { "python3" } else { &given };
    let folders = env::var_os("PATH").unwrap_or_default();
    let found = env::split_paths(&folders)
        .filter(|folder| folder.is_absolute())
        .filter_map(|folder| Utf8PathBuf::from_path_buf(folder.join(name)).ok())
        .find(|file| file.is_file());
    found.map_or_else(|| name.to_owned(), Utf8PathBuf::into_string)
}

/// A folder of the user's own, below `XDG_CACHE_HOME` or `~/.cache`.
fn cache() -> Option<Utf8PathBuf> {
    let folder = |name: &str| {
        let path = Utf8PathBuf::from(env::var(name).ok()?);
        // A path from where one happens to stand would be a stranger's.
        path.is_absolute().then_some(path)
    };
    let base = folder("XDG_CACHE_HOME").or_else(|| Some(folder("HOME")?.join(".cache")))?;
    Some(base.join("plyflow/python"))
}
