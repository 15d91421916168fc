//! Whose libraries are loaded: the user's own list, the options of the command line, the question on a terminal; and
//! `plyflow trust`, which keeps the list.
//!
//! The list is a text file, `plyflow/trusted` in the user's configuration folder (`$XDG_CONFIG_HOME`, or `~/.config`).
//! A line is the BLAKE3 of a library's bytes, or the absolute path of a folder whose libraries are trusted whatever
//! their bytes; what follows `#` is for people.

use super::args::{Places, TrustArgs};
use crate::exit;
use crate::said::{Done, Stop, print, warn};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_files::open;
use plyflow_model::text::one_line;
use plyflow_plugin_host::{Consent, Stranger, Trust};
use std::io::{BufRead, IsTerminal, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};

/// The user's own list.
#[derive(Debug, Default, Clone, PartialEq, Eq)]
pub struct List {
    /// Folders that are trusted whatever lies in them.
    pub folders: Vec<Utf8PathBuf>,
    /// BLAKE3 of libraries, hex.
    pub hashes: Vec<String>,
}

/// Where the list lies; `None` when the system names no home.
pub fn file() -> Option<Utf8PathBuf> {
    let folder = |name: &str| {
        let path = Utf8PathBuf::from(std::env::var(name).ok()?);
        // A path from where one happens to stand would be a stranger's.
        path.is_absolute().then_some(path)
    };
    let base = folder("XDG_CONFIG_HOME").or_else(|| Some(folder("HOME")?.join(".config")))?;
    Some(base.join("plyflow/trusted"))
}

/// The list; empty, with a warning, when others than the user could have written it.
pub fn read() -> List {
    let Some(path) = file() else {
        return List::default();
    };
    let Ok(meta) = std::fs::metadata(&path) else {
        return List::default();
    };
    let me = rustix::process::geteuid().as_raw();
    if !meta.is_file() || meta.mode() & 0o022 != 0 || ![0, me].contains(&meta.uid()) {
        warn(&format!(
            "plyflow: the list of trusted libraries {path} is not used, because others than you can write it; \
             expected: a file of yours with `chmod go-w`\n"
        ));
        return List::default();
    }
    parse(&text_of(&path))
}

/// The text of the list; empty when there is none that can be read.
fn text_of(path: &Utf8Path) -> String {
    let bytes = open::read(path.as_std_path(), open::MOST_WRITTEN).unwrap_or_default();
    String::from_utf8(bytes).unwrap_or_default()
}

fn parse(text: &str) -> List {
    let mut list = List::default();
    for line in text.lines() {
        let word = entry(line);
        if word.starts_with('/') {
            list.folders.push(word.into());
        } else if is_hash(word) {
            list.hashes.push(word.to_ascii_lowercase());
        }
    }
    list
}

/// What a line of the list says, without its remark.
fn entry(line: &str) -> &str {
    let end = line.find(" #").unwrap_or(line.len());
    let word = line[..end].trim();
    if word.starts_with('#') { "" } else { word }
}

fn is_hash(word: &str) -> bool {
    word.len() == 64 && word.bytes().all(|b| b.is_ascii_hexdigit())
}

/// Whose libraries a command loads: `installation` and `own` are folders.
///
/// # Errors
/// When `--trust` names no library.
pub fn trust(
    places: &Places,
    installation: &[Utf8PathBuf],
    mut own: Vec<Utf8PathBuf>,
) -> Result<Trust, Stop> {
    let list = read();
    own.extend(list.folders);
    let consents: Vec<Consent> = places
        .trust
        .iter()
        .map(|word| consent(word))
        .collect::<Result<_, _>>()?;
    let trust = Trust::new(installation, &own)
        .with_bytes(list.hashes)
        .with_consents(consents);
    if std::io::stdin().is_terminal() && std::io::stderr().is_terminal() {
        return Ok(trust.with_question(Box::new(ask)));
    }
    Ok(trust)
}

fn consent(word: &str) -> Result<Consent, Stop> {
    if word.is_empty() {
        return Ok(Consent::All);
    }
    if is_hash(word) {
        return Ok(Consent::Bytes(word.to_ascii_lowercase()));
    }
    let path = Utf8Path::new(word).canonicalize_utf8();
    // Consent to a folder would be consent to nothing.
    path.ok().filter(|p| p.is_file()).map(Consent::Path).ok_or_else(|| {
        let text = format!(
            "--trust={word}: there is no such library; expected the path of a library or the BLAKE3 of its bytes (64 \
             hexadecimal digits), --trust alone for all libraries of the workflow, or --plugins for a folder of your own"
        );
        Stop::new(exit::USAGE, text)
    })
}

/// Asks on the terminal; anything but a yes is a no.
fn ask(library: &Stranger) -> bool {
    warn(&format!(
        "The library {}\n  blake3 {}\nis neither part of this program nor on your own list. A library can do all that you can do: read \
         and delete your files, use the network.\nLoad it? y: this time, a: always these bytes, anything else: no [N] ",
        one_line(library.path.as_str()),
        library.hash
    ));
    let mut answer = String::new();
    if std::io::stdin().lock().read_line(&mut answer).is_err() {
        return false;
    }
    match answer.trim() {
        "y" | "Y" | "yes" => true,
        "a" | "A" | "always" => {
            if let Err(stop) = add(&line_of(library)) {
                warn(&format!(
                    "plyflow: it is loaded this time only: {}\n",
                    stop.text
                ));
            }
            true
        }
        _ => false,
    }
}

fn line_of(library: &Stranger) -> String {
    format!("{} # {}", library.hash, one_line(library.path.as_str()))
}

fn place() -> Result<Utf8PathBuf, Stop> {
    file().ok_or_else(|| {
        let text = "there is no place for the list of trusted libraries: expected an absolute path in XDG_CONFIG_HOME or HOME";
        Stop::new(exit::USAGE, text)
    })
}

/// Adds a line to the list.
fn add(line: &str) -> Result<Utf8PathBuf, Stop> {
    let path = place()?;
    let wrong = || Stop::machine(format!("writing {path}"));
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(wrong())?;
    }
    let mut file = std::fs::OpenOptions::new()
        .append(true)
        .create(true)
        .mode(0o600)
        .open(&path)
        .map_err(wrong())?;
    // An editor may have left the last line without an end: the new one would be lost in it.
    let text = text_of(&path);
    let end = match text.is_empty() || text.ends_with('\n') {
        true => "",
        false => "\n",
    };
    file.write_all(format!("{end}{line}\n").as_bytes())
        .map_err(wrong())?;
    Ok(path)
}

/// `plyflow trust`.
///
/// # Errors
/// [`exit::USAGE`] when a path leads to neither a library nor a folder, or is not in the list to be taken out.
pub fn command(args: &TrustArgs) -> Done {
    if args.paths.is_empty() {
        let path = place()?;
        let text = text_of(&path);
        let list = if entry_count(&text) == 0 {
            "nothing besides this program's own plugins is trusted\n".to_owned()
        } else {
            text
        };
        return print(&format!("# {path}\n{list}"));
    }
    for given in &args.paths {
        let (word, line) = line_for(given, args.forget)?;
        if args.forget {
            forget(given, &word)?;
            continue;
        }
        let list = read();
        if list.hashes.contains(&word) || list.folders.iter().any(|f| f.as_str() == word) {
            print(&format!("{given}: trusted already\n"))?;
            continue;
        }
        let path = add(&line)?;
        print(&format!(
            "{given}: trusted from now on ({word}); the list is {path}\n"
        ))?;
    }
    Ok(())
}

fn entry_count(text: &str) -> usize {
    text.lines().filter(|l| !entry(l).is_empty()).count()
}

/// The word that stands for a library or a folder in the list, and its line.
fn line_for(given: &Utf8Path, forget: bool) -> Result<(String, String), Stop> {
    if is_hash(given.as_str()) {
        let word = given.as_str().to_ascii_lowercase();
        return Ok((word.clone(), word));
    }
    let wrong = || {
        let text = format!(
            "{given}: expected a library, a folder of libraries, or the BLAKE3 of a library's bytes (64 hexadecimal digits)"
        );
        Stop::new(exit::USAGE, text)
    };
    let path = match given.canonicalize_utf8() {
        Ok(path) => path,
        // A folder that is gone can still be forgotten.
        Err(_) if forget && given.is_absolute() => {
            return Ok((given.to_string(), given.to_string()));
        }
        Err(_) => return Err(wrong()),
    };
    if path.as_str().contains(['\n', '\r']) || path.as_str().contains(" #") {
        return Err(Stop::new(
            exit::USAGE,
            format!(
                "{}: such a path cannot stand in the list",
                one_line(path.as_str())
            ),
        ));
    }
    if path.is_dir() {
        return Ok((path.to_string(), path.to_string()));
    }
    if !path.is_file() {
        return Err(wrong());
    }
    let bytes = std::fs::read(&path).map_err(Stop::machine(format!("reading {path}")))?;
    let hash = blake3::hash(&bytes).to_hex().to_string();
    let library = Stranger { path, hash };
    Ok((library.hash.clone(), line_of(&library)))
}

/// Takes an entry out of the list.
fn forget(given: &Utf8Path, word: &str) -> Done {
    let path = place()?;
    let text = text_of(&path);
    let kept: Vec<&str> = text
        .lines()
        .filter(|l| !entry(l).eq_ignore_ascii_case(word))
        .collect();
    if kept.len() == text.lines().count() {
        return Err(Stop::new(
            exit::USAGE,
            format!("{given}: it is not in the list {path}; `plyflow trust` shows what is"),
        ));
    }
    let beside = plyflow_artifact::whole::begun(path.as_std_path());
    let mut lines = kept.join("\n");
    if !lines.is_empty() {
        lines.push('\n');
    }
    // Readable by its owner alone, whatever the mask of this process: a list that others can write is not used.
    let write = || {
        let _ = std::fs::remove_file(&beside);
        let mut options = std::fs::OpenOptions::new();
        let mut file = options
            .write(true)
            .create_new(true)
            .mode(0o600)
            .open(&beside)?;
        file.write_all(lines.as_bytes())?;
        // It is the user's own: a power cut must not leave an empty one.
        file.sync_all()?;
        std::fs::rename(&beside, &path)
    };
    write().map_err(Stop::machine(format!("writing {path}")))?;
    print(&format!("{given}: no longer trusted\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_has_hashes_and_absolute_folders_and_everything_else_is_ignored() {
        let hash = "ab".repeat(32);
        let text = format!(
            "# mine\n\n{hash} # /a/libx.so\n/home/me/build # my own\nrelative/folder\n{}\n{}\n",
            "zz".repeat(32),
            &hash[1..]
        );
        let list = parse(&text);
        assert_eq!(list.hashes, [hash]);
        assert_eq!(list.folders, ["/home/me/build"]);
        assert_eq!(parse(""), List::default());
    }
}
