//! Inputs that reached code which no other had reached, and inputs that once broke a reader: all of them through all targets.

use plyflow_fuzz::memory::Counted;
use plyflow_fuzz::{TARGETS, seeds, target};
use std::path::{Path, PathBuf};

#[global_allocator]
static MEMORY: Counted = Counted;

fn corpus() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus")
}

/// The files of a target's corpus, sorted.
fn files(target: &str) -> Vec<PathBuf> {
    let folder = corpus().join(target);
    let entries =
        std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut files: Vec<PathBuf> = entries.map(|e| e.unwrap().path()).collect();
    files.sort();
    files
}

#[test]
fn every_target_has_a_corpus_and_every_corpus_a_target() {
    for folder in std::fs::read_dir(corpus()).unwrap() {
        let name = folder.unwrap().file_name().into_string().unwrap();
        assert!(target(&name).is_some(), "there is no target `{name}`");
    }
    for target in &TARGETS {
        assert!(!files(target.name).is_empty(), "`{}` has none", target.name);
    }
}

#[test]
fn no_input_of_the_corpus_breaks_its_reader() {
    for target in &TARGETS {
        for file in files(target.name) {
            let bytes = std::fs::read(&file).unwrap();
            let run = std::panic::AssertUnwindSafe(|| target.run(&bytes));
            let ran = std::panic::catch_unwind(run);
            assert!(ran.is_ok(), "{}", file.display());
        }
    }
}

#[test]
fn the_files_that_come_along_break_no_reader() {
    for target in &TARGETS {
        let seeds = seeds::of(target.name);
        assert!(!seeds.is_empty(), "`{}` has no seed", target.name);
        seeds.iter().for_each(|bytes| target.run(bytes));
    }
}
