//! Small plugins for tests (`plugins/`, built as examples): well-behaved ones and ones that fail in every
//! known way.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// Folder of the plugin libraries of this build profile. Builds them on the first call.
///
/// # Panics
/// When they cannot be built.
#[must_use]
pub fn folder() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let exe = std::env::current_exe().expect("a test has a path");
        let in_deps = exe.parent().is_some_and(|p| p.ends_with("deps"));
        let profile = exe
            .ancestors()
            .nth(if in_deps { 2 } else { 1 })
            .expect("a profile folder");
        // Of the whole workspace: dependencies then have the features that `cargo test --workspace` gives them, and nothing is
        // compiled a second time.
        let mut words = vec!["--workspace".to_owned()];
        words.extend(
            names()
                .into_iter()
                .flat_map(|n| ["--example".to_owned(), n]),
        );
        build(profile, &words);
        gather(&profile.join("examples"), &profile.join("test-plugins"))
    })
}

/// The program `plyflow` of this build profile; built on the first call.
///
/// # Panics
/// When it does not build.
pub fn program() -> &'static Path {
    static PROGRAM: OnceLock<PathBuf> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let exe = std::env::current_exe().expect("a test has a path");
        // TARGET/PROFILE/deps/TEST
        let profile = exe.ancestors().nth(2).expect("a profile folder").to_owned();
        build(&profile, &[shipped(), vec!["--bin", "plyflow"]].concat());
        profile.join("plyflow")
    })
}

/// What `make build` builds, as words for cargo. Another choice of packages would give their dependencies other features, and then they
/// would all be built twice.
///
/// # Panics
/// When the Makefile does not say what is left out.
#[must_use]
pub fn shipped() -> Vec<&'static str> {
    let makefile = include_str!("../../../Makefile");
    let line = makefile
        .lines()
        .find_map(|l| l.strip_prefix("NOT_SHIPPED := "));
    let mut words = vec!["--workspace"];
    words.extend(line.expect("what is not shipped").split(' '));
    words
}

/// Runs `cargo build` with these words and the profile whose folder is given (`TARGET/PROFILE`).
///
/// # Panics
/// When something does not build.
pub fn build<S: AsRef<std::ffi::OsStr>>(profile: &Path, words: &[S]) {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.current_dir(env!("CARGO_MANIFEST_DIR"));
    let target = profile.parent().expect("a target folder");
    cargo.env("CARGO_TARGET_DIR", target);
    cargo.args(["build", "--quiet"]).args(words);
    if profile.ends_with("release") {
        cargo.arg("--release");
    }
    let built = cargo.status().expect("cargo starts").success();
    assert!(built, "plyflow or its test plugins do not build");
}

/// Names of the plugins' examples: those of their sources.
fn names() -> Vec<String> {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("plugins");
    let entries = std::fs::read_dir(sources).expect("the sources of the test plugins");
    let paths = entries.flatten().map(|e| e.path());
    let names = paths.filter_map(|p| Some(p.file_stem()?.to_str()?.to_owned()));
    names.collect()
}

/// Cargo keeps copies with a hash in their names beside the libraries: gathers those without.
fn gather(from: &Path, to: &Path) -> PathBuf {
    std::fs::create_dir_all(to).expect("a folder for the test plugins");
    for entry in std::fs::read_dir(from)
        .expect("a folder of examples")
        .flatten()
    {
        let name = entry.file_name();
        let Some(text) = name.to_str() else { continue };
        if !text.starts_with("lib") || !text.ends_with(".so") || text.contains('-') {
            continue;
        }
        // Another test process may do the same: never a moment without the library.
        let temporary = to.join(format!(".{text}.{}", std::process::id()));
        let _ = std::fs::remove_file(&temporary);
        std::fs::hard_link(entry.path(), &temporary).expect("a link to the library");
        std::fs::rename(&temporary, to.join(&name)).expect("the library in its place");
        let _ = std::fs::remove_file(&temporary);
    }
    to.to_owned()
}

/// The library of a test plugin, by the name in its manifest.
///
/// # Panics
/// When there is none of that name.
#[must_use]
pub fn library(name: &str) -> PathBuf {
    let path = folder().join(format!("lib{}.so", name.replace('-', "_")));
    assert!(
        path.is_file(),
        "there is no test plugin {name} at {}",
        path.display()
    );
    path
}
