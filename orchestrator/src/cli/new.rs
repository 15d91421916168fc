//! `new`: begins a plugin of one's own, from a template that the program carries.

mod name;
mod template;

use super::args::{NewArgs, NewKind, Places};
use super::open::{catalog, folders, store_root};
use super::shipped;
use super::typed::quoted;
use crate::exit;
use crate::said::{Done, Stop, print, warn};
use camino::{Utf8Path, Utf8PathBuf};
use std::io::{BufRead, IsTerminal, Write};
use template::Language;

/// `plyflow new`.
///
/// # Errors
/// [`exit::USAGE`] when the name is none or is taken, the folder is there already, there is no such template, or, for Rust, Plyflow's crates
/// are not to be found.
pub fn new(args: &NewArgs) -> Done {
    let wrong = |text: String| Stop::new(exit::USAGE, text);
    if let Some(text) = name::malformed(&args.name) {
        return Err(wrong(text));
    }
    let language = {
        // Given back at once: whether a stranger's library may be loaded is asked there too.
        let mut answers = std::io::stdin().lock();
        let terminal = answers.is_terminal() && std::io::stderr().is_terminal();
        language(args, terminal.then_some(&mut answers))?
    };
    if let Some(text) = name::reserved(&args.name, language, &template::crates(args.kind)) {
        return Err(wrong(text));
    }
    if let Some(text) = taken(&args.name)? {
        return Err(wrong(text));
    }
    let crates = match language {
        Language::Rust => Some(shipped::crates(args.source.as_deref())?),
        _ => None,
    };
    let folder = match &args.into {
        Some(into) => into.join(&args.name),
        None => Utf8PathBuf::from(&args.name),
    };
    let files = template::filled(args.kind, language, &args.name, crates.as_deref());
    write(&folder, &files)?;
    let mut text = format!(
        "{folder}: {} in {}. Go on with\n\n  cd {}\n",
        title(args.kind),
        language.title(),
        quoted(folder.as_str())
    );
    for command in template::commands(&files) {
        text += &format!("  {command}\n");
    }
    print(&(text + "\nIts README says what to change, and how it is used.\n"))
}

/// A kind, for people.
fn title(kind: NewKind) -> &'static str {
    match kind {
        NewKind::Step => "a step",
        NewKind::Element => "an element",
        NewKind::Material => "a material",
    }
}

/// The language that was asked for, or that is asked for now where there is a terminal to answer from.
fn language(args: &NewArgs, answers: Option<&mut impl BufRead>) -> Result<Language, Stop> {
    let there = template::languages(args.kind);
    let options: Vec<String> = there
        .iter()
        .map(|l| format!("--{} ({})", l.word(), l.title()))
        .collect();
    let options = options.join(", ");
    let what = title(args.kind);
    let asked = [
        (args.python, Language::Python),
        (args.rust, Language::Rust),
        (args.c, Language::C),
    ];
    if let Some((_, language)) = asked.into_iter().find(|(asked, _)| *asked) {
        return match there.contains(&language) {
            true => Ok(language),
            false => {
                let text = format!(
                    "there is no template of {what} in {}; there is one for {options}",
                    language.title()
                );
                Err(Stop::new(exit::USAGE, text))
            }
        };
    }
    let Some(answers) = answers else {
        let text = format!("say in which language {what} is to be written: {options}");
        return Err(Stop::new(exit::USAGE, text));
    };
    let titles: Vec<&str> = there.iter().map(|l| l.title()).collect();
    warn(&format!("In which language? {} ", titles.join(", ")));
    let _ = std::io::stderr().flush();
    let mut answer = String::new();
    let read = answers.read_line(&mut answer);
    read.map_err(Stop::machine("reading the answer"))?;
    let answer = answer.trim();
    let meant = there
        .into_iter()
        .find(|l| l.word().eq_ignore_ascii_case(answer));
    meant.ok_or_else(|| {
        let text =
            format!("{answer:?} is none of these languages; nothing was made. Say {options}");
        Stop::new(exit::USAGE, text)
    })
}

/// Why a name cannot be used here: a plugin has it that comes with this program, or lies in a folder of the user's own.
fn taken(name: &str) -> Result<Option<String>, Stop> {
    let places = Places::default();
    let catalog = catalog(folders(&places, None)?, &places, &store_root(&places, None))?;
    let owner = catalog.plugins().into_iter().find(|e| e.id.name == name);
    Ok(owner.map(|owner| {
        format!(
            "`{name}` is the name of a plugin that is there already ({} in {}): of two plugins of one name nobody knows which is meant, and a workflow would refuse the new one; choose another, such as `my-{name}`",
            title_of(owner.manifest.kind.name()),
            owner.id.path
        )
    }))
}

fn title_of(kind: &str) -> String {
    let article = if kind == "element" { "an" } else { "a" };
    format!("{article} {kind}")
}

/// Writes the files into a folder that must be new or empty.
fn write(folder: &Utf8Path, files: &[(Utf8PathBuf, String)]) -> Result<(), Stop> {
    let is_new = match std::fs::read_dir(folder) {
        Ok(mut entries) => entries.next().is_none(),
        Err(_) => folder.symlink_metadata().is_err(),
    };
    if !is_new {
        let text = format!(
            "{folder} is there already, and nothing in it is overwritten: choose another name, or another folder with --into DIR"
        );
        return Err(Stop::new(exit::USAGE, text));
    }
    for (path, text) in files {
        let path = folder.join(path);
        let failed = || Stop::machine(format!("writing {path}"));
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent).map_err(failed())?;
        }
        // Also where another program has made it in the meantime.
        let mut file = std::fs::File::create_new(&path).map_err(failed())?;
        file.write_all(text.as_bytes()).map_err(failed())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
