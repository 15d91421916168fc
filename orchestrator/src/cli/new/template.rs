//! The templates that this program carries, and how one is filled in.
//!
//! They lie in `solver-plugins/door/templates`, a folder for each kind and language: `step-c`. `shared` has what every folder gets that has
//! no file of that name itself. They build as they lie there, so a name stands in them where the new one goes: that of [`placeholder`].

use crate::cli::args::NewKind;
use camino::{Utf8Path, Utf8PathBuf};

/// Text files by their paths from the folder of the templates, sorted; and `plyflow.h`.
const FILES: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/templates.rs"));

/// How a template finds the folder of the header from where it lies.
const HEADER_FOLDER: &str = "PLYFLOW_H ?= ../../../../schemas/abi";

/// How a template finds crates from where it lies, and where these lie in the source.
const CRATES: [(&str, &str); 2] = [
    ("path = \"../../sdk\"", "solver-plugins/door/sdk"),
    ("path = \"../../../../schemas/model\"", "schemas/model"),
];

/// What a plugin is written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Language {
    Python,
    Rust,
    C,
}

impl Language {
    pub const ALL: [Self; 3] = [Self::Python, Self::Rust, Self::C];

    /// For people.
    pub fn title(self) -> &'static str {
        match self {
            Self::Python => "Python",
            Self::Rust => "Rust",
            Self::C => "C",
        }
    }

    /// The word of its option and of its folders.
    pub fn word(self) -> &'static str {
        match self {
            Self::Python => "python",
            Self::Rust => "rust",
            Self::C => "c",
        }
    }
}

fn kind_word(kind: NewKind) -> &'static str {
    match kind {
        NewKind::Study => "study",
        NewKind::Step => "step",
        NewKind::Element => "element",
        NewKind::Material => "material",
    }
}

/// The name that stands in the templates of a kind.
fn placeholder(kind: NewKind) -> &'static str {
    match kind {
        // There is no template of one: it is put together (`super::study`).
        NewKind::Study => "study",
        NewKind::Step => "double-time",
        NewKind::Element => "my-membrane",
        NewKind::Material => "my-sheet",
    }
}

/// The files of a folder of templates, by their paths in it.
fn of_folder(folder: &str) -> impl Iterator<Item = (&'static str, &'static str)> {
    FILES.iter().filter_map(move |(path, text)| {
        let name = path.strip_prefix(folder)?.strip_prefix('/')?;
        Some((name, *text))
    })
}

fn of(kind: NewKind, language: Language) -> impl Iterator<Item = (&'static str, &'static str)> {
    of_folder(&format!("{}-{}", kind_word(kind), language.word()))
        .collect::<Vec<_>>()
        .into_iter()
}

/// The languages in which there is a template of a kind.
pub fn languages(kind: NewKind) -> Vec<Language> {
    let there = |language: &Language| of(kind, *language).next().is_some();
    Language::ALL.into_iter().filter(there).collect()
}

/// The crates that a template in Rust is built of, by name, without its own.
pub fn crates(kind: NewKind) -> Vec<&'static str> {
    let lock = of(kind, Language::Rust).find(|(name, _)| *name == "Cargo.lock");
    let lines = lock.map_or("", |(_, text)| text).lines();
    let names = lines.filter_map(|l| l.strip_prefix("name = \"")?.strip_suffix('"'));
    names.filter(|name| *name != placeholder(kind)).collect()
}

/// The files of a new plugin: path in its folder, and text. `crates`: the folder below which Plyflow's crates lie, for Rust.
pub fn filled(
    kind: NewKind,
    language: Language,
    name: &str,
    crates: Option<&Utf8Path>,
) -> Vec<(Utf8PathBuf, String)> {
    let mut files: Vec<(&str, &str)> = of(kind, language).collect();
    for (file, text) in of_folder("shared") {
        if !files.iter().any(|(there, _)| *there == file) {
            files.push((file, text));
        }
    }
    if files.iter().any(|(file, _)| *file == "Makefile") {
        files.extend(FILES.iter().find(|(path, _)| *path == "plyflow.h"));
    }
    let from = placeholder(kind);
    let (from_word, word) = (from.replace('-', "_"), name.replace('-', "_"));
    let named = |text: &str| text.replace(from, name).replace(&from_word, &word);
    let one = |(file, text): (&str, &str)| {
        let path = Utf8PathBuf::from(named(file));
        let text = match file {
            "plyflow.h" => text.to_owned(),
            "Makefile" => named(text).replace(HEADER_FOLDER, "PLYFLOW_H ?= ."),
            "Cargo.toml" => with_crates(named(text), crates),
            "Cargo.lock" => sorted(&named(text)),
            "README.md" => aligned(&named(text)),
            _ => named(text),
        };
        (path, text)
    };
    let mut files: Vec<_> = files.into_iter().map(one).collect();
    files.sort();
    files
}

/// A `Cargo.toml` that finds Plyflow's crates where they are.
fn with_crates(text: String, folder: Option<&Utf8Path>) -> String {
    let Some(folder) = folder else {
        return text;
    };
    CRATES.iter().fold(text, |text, (from, place)| {
        // As TOML has it in quotation marks.
        let path = folder
            .join(place)
            .as_str()
            .replace('\\', "\\\\")
            .replace('"', "\\\"");
        text.replace(from, &format!("path = \"{path}\""))
    })
}

/// A `Cargo.lock` with its packages in the order of their names, which has changed with one of them: Cargo takes another order for a change.
fn sorted(lock: &str) -> String {
    const BETWEEN: &str = "\n[[package]]\n";
    let mut parts = lock.split(BETWEEN);
    let head = parts.next().unwrap_or("");
    let mut packages: Vec<&str> = parts.map(|p| p.trim_end_matches('\n')).collect();
    packages.sort_by_key(|p| p.lines().next());
    let packages: Vec<String> = packages.iter().map(|p| format!("{BETWEEN}{p}\n")).collect();
    head.to_owned() + &packages.concat()
}

/// What stands between a command and what is said of it.
const REMARK: &str = "   # ";

/// A README whose remarks on commands stand below each other: with a name of another length they have moved.
fn aligned(readme: &str) -> String {
    let mut text = String::new();
    for (i, part) in readme.split("```").enumerate() {
        if i > 0 {
            text += "```";
        }
        let is_shell = i % 2 == 1 && part.starts_with("sh\n");
        if !is_shell {
            text += part;
            continue;
        }
        let parted = |line: &'_ str| {
            line.split_once(REMARK)
                .map(|(a, b)| (a.trim_end().to_owned(), b.to_owned()))
        };
        let width = part
            .lines()
            .filter_map(parted)
            .map(|(command, _)| command.len())
            .max();
        for line in part.lines() {
            text += &match parted(line) {
                Some((command, remark)) => {
                    format!("{command:0$}{REMARK}{remark}\n", width.unwrap_or(0))
                }
                None => format!("{line}\n"),
            };
        }
    }
    text
}

/// The commands to go on with: the first block of shell commands of the README.
pub fn commands(files: &[(Utf8PathBuf, String)]) -> Vec<&str> {
    let readme = files.iter().find(|(path, _)| path == "README.md");
    let block = readme.and_then(|(_, text)| text.split_once("```sh\n")?.1.split_once("```"));
    block.map_or(Vec::new(), |(block, _)| block.lines().collect())
}

#[cfg(test)]
mod tests;
