//! Which names a new plugin may have.

use super::template::Language;

/// The longest name: a file is named by it, and tables show it.
const MOST: usize = 64;

/// What a name has to be, for messages.
const EXPECTED: &str = "expected small letters and digits, with single hyphens between words, beginning with a letter, such as `count-sheared`";

/// Why a text is no name of `what`, a plugin or a study; `None`: it is one.
pub fn malformed(name: &str, what: &str) -> Option<String> {
    if name.len() > MOST {
        return Some(format!(
            "the name has {} letters; expected at most {MOST}",
            name.chars().count()
        ));
    }
    if is_kebab(name) {
        return None;
    }
    let nearest = kebab(name);
    let meant = match is_kebab(&nearest) && nearest.len() <= MOST {
        true => format!("; `{nearest}` is such a name"),
        false => String::new(),
    };
    Some(format!(
        "`{name}` is no name of a {what}: {EXPECTED}{meant}"
    ))
}

/// Why a plugin in this language may not have a name; `None`: it may. `crates`: those that one in Rust is built of.
pub fn reserved(name: &str, language: Language, crates: &[&str]) -> Option<String> {
    let word = name.replace('-', "_");
    let taken = match language {
        Language::Rust if crates.contains(&name) || crates.contains(&word.as_str()) => {
            "is the name of a crate that it is built of"
        }
        Language::Rust if has(RUST_WORDS, &word) => "is a word of Rust's own",
        Language::Python if has(PYTHON_WORDS, &word) => "is a word of Python's own",
        Language::Python if has(PYTHON_MODULES, &word) => {
            "is the name of a module of Python's: a file of that name would take its place"
        }
        _ => return None,
    };
    Some(format!(
        "`{name}` {taken}; choose another, such as `my-{name}`"
    ))
}

fn has(words: &str, word: &str) -> bool {
    words.split_whitespace().any(|w| w == word)
}

fn is_kebab(name: &str) -> bool {
    let part = |p: &str| {
        !p.is_empty()
            && p.bytes()
                .all(|b| b.is_ascii_lowercase() || b.is_ascii_digit())
    };
    name.starts_with(|c: char| c.is_ascii_lowercase()) && name.split('-').all(part)
}

/// A name in the form that is expected: `CountSheared` and `count sheared` as `count-sheared`.
fn kebab(name: &str) -> String {
    let mut words = String::new();
    let mut before = ' ';
    for c in name.chars() {
        let begins =
            c.is_ascii_uppercase() && (before.is_ascii_lowercase() || before.is_ascii_digit());
        if begins || !c.is_ascii_alphanumeric() {
            words.push('-');
        }
        if c.is_ascii_alphanumeric() {
            words.push(c.to_ascii_lowercase());
        }
        before = c;
    }
    let parts: Vec<&str> = words.split('-').filter(|p| !p.is_empty()).collect();
    parts.join("-")
}

/// What a crate may not be named: keywords, and crates that come with the compiler.
const RUST_WORDS: &str = "abstract alloc as async await become box break const continue core crate do dyn else enum extern false final fn for gen if \
    impl in let loop macro match mod move mut override priv proc_macro pub ref return self static std struct super test trait true try type typeof \
    unsafe unsized use virtual where while yield";

const PYTHON_WORDS: &str = "and as assert async await break class continue def del elif else except finally for from global if import in is lambda \
    nonlocal not or pass raise return try while with yield";

/// Modules of Python 3.9 to 3.14 whose names a plugin could have, and what a step imports.
const PYTHON_MODULES: &str = "plyflow numpy h5py \
    abc aifc annotationlib antigravity argparse array ast asynchat asyncio asyncore atexit audioop base64 bdb binascii binhex bisect builtins bz2 \
    calendar cgi cgitb chunk cmath cmd code codecs codeop collections colorsys compileall compression concurrent configparser contextlib contextvars \
    copy copyreg crypt csv ctypes curses dataclasses datetime dbm decimal difflib dis distutils doctest email encodings ensurepip enum errno \
    faulthandler fcntl filecmp fileinput fnmatch formatter fractions ftplib functools gc genericpath getopt getpass gettext glob graphlib grp gzip \
    hashlib heapq hmac html http idlelib imaplib imghdr imp importlib inspect io ipaddress itertools json keyword lib2to3 linecache locale logging \
    lzma mailbox mailcap marshal math mimetypes mmap modulefinder msilib msvcrt multiprocessing netrc nis nntplib nt ntpath nturl2path numbers opcode \
    operator optparse os ossaudiodev parser pathlib pdb pickle pickletools pipes pkgutil platform plistlib poplib posix posixpath pprint profile \
    pstats pty pwd py_compile pyclbr pydoc pydoc_data pyexpat queue quopri random re readline reprlib resource rlcompleter runpy sched secrets select \
    selectors shelve shlex shutil signal site smtpd smtplib sndhdr socket socketserver spwd sqlite3 sre_compile sre_constants sre_parse ssl stat \
    statistics string stringprep struct subprocess sunau symbol symtable sys sysconfig syslog tabnanny tarfile telnetlib tempfile termios textwrap \
    this threading time timeit tkinter token tokenize tomllib trace traceback tracemalloc tty turtle turtledemo types typing unicodedata unittest \
    urllib uu uuid venv warnings wave weakref webbrowser winreg winsound wsgiref xdrlib xml xmlrpc zipapp zipfile zipimport zlib zoneinfo";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_small_words_with_hyphens_and_another_one_is_told_how_it_would_be_right() {
        for name in ["a", "m4x", "count-sheared", "x2-3d"] {
            assert_eq!(malformed(name, "plugin"), None, "{name}");
        }
        for (name, nearest) in [
            ("CountSheared", Some("count-sheared")),
            ("count_sheared", Some("count-sheared")),
            ("count  sheared", Some("count-sheared")),
            ("-count", Some("count")),
            ("count--sheared-", Some("count-sheared")),
            ("lib.so", Some("lib-so")),
            ("../up", Some("up")),
            ("2d", None),
            ("", None),
            ("größe", Some("gr-e")),
        ] {
            let text = malformed(name, "plugin").expect(name);
            assert!(text.contains("such as `count-sheared`"), "{text}");
            let told = text
                .split_once("beginning with a letter, such as `count-sheared`")
                .unwrap()
                .1;
            let expected = nearest.map_or(String::new(), |n| format!("; `{n}` is such a name"));
            assert_eq!(told, expected, "{name}");
        }
        assert_eq!(malformed(&"a".repeat(64), "plugin"), None);
        let text = malformed(&"a".repeat(65), "study").unwrap();
        assert!(text.contains("65 letters"), "{text}");
    }

    #[test]
    fn what_another_thing_is_called_in_the_language_is_refused_in_that_language_alone() {
        let crates = ["serde", "serde_json", "plyflow-sdk"];
        for (name, language) in [
            ("match", Language::Rust),
            ("test", Language::Rust),
            ("proc-macro", Language::Rust),
            ("serde", Language::Rust),
            ("serde-json", Language::Rust),
            ("plyflow-sdk", Language::Rust),
            ("lambda", Language::Python),
            ("statistics", Language::Python),
            ("numpy", Language::Python),
            ("py-compile", Language::Python),
        ] {
            let text = reserved(name, language, &crates).expect(name);
            assert!(text.ends_with(&format!("`my-{name}`")), "{text}");
            assert_eq!(reserved(name, Language::C, &crates), None, "{name}");
            assert_eq!(reserved(&format!("my-{name}"), language, &crates), None);
        }
    }
}
