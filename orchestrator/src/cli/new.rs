//! `new`: begins a study of a part, or a plugin of one's own, from a template that the program carries.

mod name;
mod study;
mod template;

use super::args::{Cli, Command, NewArgs, NewKind, Places, ValidateArgs};
use super::open::{catalog, folders, store_root};
use super::plan::validate;
use super::shipped;
use super::typed::quoted;
use crate::exit;
use crate::said::{Done, Stop, print, warn};
use camino::{Utf8Path, Utf8PathBuf};
use clap::Parser;
use std::io::{BufRead, IsTerminal, Write};
use template::Language;

/// `plyflow new`.
///
/// # Errors
/// [`exit::USAGE`] when the name is none or is taken, the folder is there already, there is no such template, or, for Rust, Plyflow's crates
/// are not to be found.
pub fn new(args: &NewArgs) -> Done {
    let wrong = |text: String| Stop::new(exit::USAGE, text);
    let what = match args.kind {
        NewKind::Study => "study",
        _ => "plugin",
    };
    if let Some(text) = name::malformed(&args.name, what) {
        return Err(wrong(text));
    }
    let folder = match &args.into {
        Some(into) => into.join(&args.name),
        None => Utf8PathBuf::from(&args.name),
    };
    if args.kind == NewKind::Study {
        return new_study(args, &folder);
    }
    if let Some(option) = args.study.given() {
        let text = format!("{option} is for a study: `plyflow new study {}`", args.name);
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

/// Writes a study and looks whether what was written is one.
fn new_study(args: &NewArgs, folder: &Utf8Path) -> Done {
    if args.python || args.rust || args.c {
        let text = "--python, --rust and --c are for plugins: a study is written in YAML";
        return Err(Stop::new(exit::USAGE, text));
    }
    refuse_what_is_there(folder)?;
    let (files, told) = {
        let mut answers = std::io::stdin().lock();
        let terminal = answers.is_terminal() && std::io::stderr().is_terminal();
        let answers = terminal.then_some(&mut answers as &mut dyn BufRead);
        study::files(args, folder, answers)?
    };
    write(folder, &files)?;
    validate(&typed_validate(&folder.join("workflow.yaml"))?).map_err(|stop| {
        let text = format!(
            "{}{folder}: it was written, and has errors: correct them there",
            stop.text
        );
        Stop::new(stop.code, text)
    })?;
    print(&told)
}

/// `validate` of a file, as it is typed, so that what it does by default stands in one place.
fn typed_validate(file: &Utf8Path) -> Result<ValidateArgs, Stop> {
    match Cli::try_parse_from(["plyflow", "validate", "--", file.as_str()]).map(|cli| cli.command) {
        Ok(Command::Validate(args)) => Ok(args),
        Ok(_) => Err(Stop::new(exit::INTERNAL, "`validate` is another command")),
        Err(e) => Err(Stop::new(exit::INTERNAL, e)),
    }
}

/// A kind, for people.
fn title(kind: NewKind) -> &'static str {
    match kind {
        NewKind::Study => "a study",
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

/// Ends where there is something under the name of a folder that is to be made, unless it is an empty folder.
fn refuse_what_is_there(folder: &Utf8Path) -> Result<(), Stop> {
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
    Ok(())
}

/// Writes the files into a folder that must be new or empty.
fn write(folder: &Utf8Path, files: &[(Utf8PathBuf, String)]) -> Result<(), Stop> {
    refuse_what_is_there(folder)?;
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
