//! Builds the book of Plyflow.
//!
//! ```text
//! cargo run --locked --manifest-path docs/builder/Cargo.toml [OUTPUT]
//! ```
//!
//! The book is made in three steps: [`pages`] puts all pages, and the files to which they link, into one folder, in
//! their places of the repository; mdBook makes HTML of it, with [`formulas`] as its preprocessor; [`links`] checks the HTML.

mod formulas;
mod links;
mod markdown;
mod pages;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use mdbook_driver::MDBook;
use mdbook_driver::config::Config;

fn main() -> ExitCode {
    let output = std::env::args_os().nth(1).map(PathBuf::from);
    match build(output) {
        Ok(index) => {
            println!("book: {}", index.display());
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Builds the book and returns the path of its first page.
fn build(output: Option<PathBuf>) -> Result<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let root = root
        .canonicalize()
        .with_context(|| format!("{} is not a repository", root.display()))?;
    let output = output.unwrap_or_else(|| root.join("target/book"));
    let stage = output.with_extension("source");

    pages::stage(&root, &stage)?;
    let config = Config::from_disk(root.join("docs/book.toml"))?;
    let mut book = MDBook::load_with_config(&stage, config)?;
    book.config.build.build_dir = std::path::absolute(&output)?;
    book.with_preprocessor(formulas::Formulas);
    book.build()?;

    let dead = links::dead_links(&output)?;
    if !dead.is_empty() {
        bail!(
            "the book has {} dead links:\n{}",
            dead.len(),
            dead.join("\n")
        );
    }
    Ok(output.join("index.html"))
}
