//! How the program is linked: workers start by the thousand, so what the dynamic loader does counts. And which templates of plugins it
//! carries: a folder that is added to them is carried too.

use std::fmt::Write;
use std::path::{Path, PathBuf};

const TEMPLATES: &str = "../solver-plugins/door/templates";
const HEADER: &str = "../schemas/abi/plyflow.h";

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_TARGET_ENV").as_deref() == Ok("gnu") {
        // Symbols are looked up when first called; a worker calls few of them.
        println!("cargo:rustc-link-arg-bins=-Wl,-z,lazy");
        // No load address to relocate for: some thousand pointers stay as they are in the file.
        println!("cargo:rustc-link-arg-bins=-no-pie");
        println!("cargo:rustc-link-arg-bins=-static-libgcc");
    }
    let here = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    let mut files = vec![("plyflow.h".to_owned(), here.join(HEADER))];
    collect(&here.join(TEMPLATES), "", &mut files);
    files.sort();
    let mut table = String::from("&[\n");
    for (name, path) in &files {
        println!("cargo:rerun-if-changed={}", path.display());
        writeln!(table, "    ({name:?}, include_str!({path:?})),").expect("into a text");
    }
    table += "]\n";
    let out = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets it"));
    std::fs::write(out.join("templates.rs"), table).expect("OUT_DIR can be written");
}

/// Files below a folder with their names from there, but for what a build or a run has left.
fn collect(folder: &Path, name: &str, files: &mut Vec<(String, PathBuf)>) {
    println!("cargo:rerun-if-changed={}", folder.display());
    let entries = std::fs::read_dir(folder).expect("the folder of the templates can be read");
    for entry in entries {
        let entry = entry.expect("the folder of the templates can be read");
        let file = entry.file_name().into_string().expect("UTF-8");
        let left = ["target", "__pycache__", ".plyflow"].contains(&file.as_str())
            || [".so", ".pyc", ".html"]
                .iter()
                .any(|end| file.ends_with(end));
        if left {
            continue;
        }
        let path = entry.path();
        let name = format!("{name}{}{file}", if name.is_empty() { "" } else { "/" });
        match path.is_dir() {
            true => collect(&path, &name, files),
            false => files.push((name, path)),
        }
    }
}
