use super::*;
use plyflow_model::manifest::Manifest;

const KINDS: [NewKind; 3] = [NewKind::Step, NewKind::Element, NewKind::Material];

/// All templates, filled in with a name that sorts before and one that sorts behind all crates.
fn all() -> impl Iterator<Item = (NewKind, Language, &'static str, Vec<(Utf8PathBuf, String)>)> {
    KINDS.into_iter().flat_map(|kind| {
        languages(kind).into_iter().flat_map(move |language| {
            ["a-name", "zz9-plural-z-alpha"]
                .into_iter()
                .map(move |name| {
                    let files = filled(kind, language, name, Some(Utf8Path::new("/opt/ply flow")));
                    (kind, language, name, files)
                })
        })
    })
}

fn text<'f>(files: &'f [(Utf8PathBuf, String)], name: &str) -> Option<&'f str> {
    files
        .iter()
        .find(|(path, _)| path == name)
        .map(|(_, text)| text.as_str())
}

#[test]
fn there_are_templates_of_each_kind_in_these_languages() {
    use Language::{C, Python, Rust};
    assert_eq!(languages(NewKind::Step), [Python, Rust, C]);
    assert_eq!(languages(NewKind::Element), [Rust, C]);
    assert_eq!(languages(NewKind::Material), [Python, Rust, C]);
}

#[test]
fn every_folder_of_templates_belongs_to_a_kind_and_a_language_or_is_shared() {
    let mut known = vec!["shared".to_owned()];
    for kind in KINDS {
        known.extend(Language::ALL.map(|l| format!("{}-{}", kind_word(kind), l.word())));
    }
    let folders: Vec<&str> = FILES
        .iter()
        .filter_map(|(path, _)| Some(path.split_once('/')?.0))
        .collect();
    assert!(folders.len() > 30, "{folders:?}");
    for folder in folders {
        assert!(
            known.iter().any(|k| k == folder),
            "`plyflow new` makes nothing of {folder}"
        );
    }
}

#[test]
fn a_new_folder_has_its_name_everywhere_and_nothing_of_the_template_is_left() {
    for (kind, language, name, files) in all() {
        let word = name.replace('-', "_");
        let what = format!("{kind:?} in {language:?}");
        for (path, text) in &files {
            for left in [
                placeholder(kind),
                &placeholder(kind).replace('-', "_"),
                "../../",
            ] {
                // The header is as it is, for all plugins.
                assert!(
                    path == "plyflow.h" || !text.contains(left),
                    "{what}: {path} has {left}"
                );
                assert!(!path.as_str().contains(left), "{what}: {path}");
            }
        }
        let workflow = text(&files, "workflow.yaml").expect(&what);
        assert!(
            workflow.contains(&format!("\nname: {name}\n")),
            "{what}: {workflow}"
        );
        let library = match language {
            Language::Python => format!("./{word}.py"),
            Language::Rust => format!("./target/release/lib{word}.so"),
            Language::C => format!("./lib{word}.so"),
        };
        let names_it = |file: &str| {
            text(&files, file).is_some_and(|t| t.contains(&format!("plugin: {library}")))
        };
        assert!(
            names_it("workflow.yaml") || names_it("sheet.yaml"),
            "{what}"
        );
        assert!(
            text(&files, "README.md")
                .unwrap()
                .starts_with(&format!("# {name}\n")),
            "{what}"
        );
        for file in ["scene.yaml", ".gitignore"] {
            assert!(text(&files, file).is_some(), "{what}: no {file}");
        }
        if language == Language::Python {
            let module = text(&files, &format!("{word}.py")).expect(&what);
            assert!(module.contains(&format!("\"{name}\"")), "{what}");
        }
        if language == Language::C {
            assert!(
                text(&files, "Makefile")
                    .unwrap()
                    .contains("PLYFLOW_H ?= .\n"),
                "{what}"
            );
            assert!(
                text(&files, "plyflow.h").unwrap().contains("pf_services"),
                "{what}"
            );
        }
    }
}

#[test]
fn a_manifest_of_a_template_is_one_and_says_the_kind_that_was_asked_for() {
    let mut seen = 0;
    for (kind, language, name, files) in all() {
        let json = match language {
            Language::Rust => text(&files, "manifest.json").unwrap().to_owned(),
            Language::C => in_c(text(&files, &format!("{}.c", kind_word(kind))).unwrap()),
            // What is declared becomes a manifest by the interpreter.
            Language::Python => continue,
        };
        let manifest = Manifest::parse(&json)
            .unwrap_or_else(|e| panic!("{kind:?} in {language:?}: {e}\n{json}"));
        assert_eq!(
            (manifest.name.as_str(), manifest.kind.name()),
            (name, kind_word(kind))
        );
        seen += 1;
    }
    assert_eq!(seen, 12);
}

/// The text of the constant MANIFEST of a source in C.
fn in_c(source: &str) -> String {
    let begun = source.split_once("MANIFEST[] =\n").expect("a manifest").1;
    let lines = begun.split_once(";\n").expect("its end").0.lines();
    let parts = lines.map(|l| {
        l.trim()
            .strip_prefix('"')
            .and_then(|l| l.strip_suffix('"'))
            .expect(l)
    });
    parts.collect::<String>().replace("\\\"", "\"")
}

#[test]
fn a_folder_in_rust_finds_the_crates_and_its_lock_is_as_cargo_writes_it() {
    for (kind, language, name, files) in all() {
        if language != Language::Rust {
            continue;
        }
        let cargo = text(&files, "Cargo.toml").unwrap();
        assert!(
            cargo
                .contains("\nplyflow-sdk = { path = \"/opt/ply flow/solver-plugins/door/sdk\" }\n"),
            "{cargo}"
        );
        assert!(cargo.contains(&format!("name = \"{name}\"\n")), "{cargo}");
        let lock = text(&files, "Cargo.lock").unwrap();
        let names: Vec<&str> = lock
            .lines()
            .filter_map(|l| l.strip_prefix("name = "))
            .collect();
        assert!(names.is_sorted() && names.len() > 8, "{names:?}");
        assert!(names.contains(&format!("\"{name}\"").as_str()), "{names:?}");
        assert!(
            lock.starts_with("# This file is automatically @generated by Cargo.\n")
                && lock.ends_with('\n')
        );
        assert!(!(lock.contains("\n\n\n") || lock.ends_with("\n\n")));
        assert!(crates(kind).contains(&"serde_json") && !crates(kind).contains(&placeholder(kind)));
    }
    // As it lies there it is in order: what is put together again is the same.
    for kind in KINDS {
        let lock = of(kind, Language::Rust)
            .find(|(file, _)| *file == "Cargo.lock")
            .unwrap()
            .1;
        assert_eq!(sorted(lock), lock);
    }
}

#[test]
fn a_path_with_quotation_marks_stays_one_text_of_toml() {
    let text = with_crates(
        "plyflow-sdk = { path = \"../../sdk\" }".into(),
        Some(Utf8Path::new("/a\"b\\c")),
    );
    assert_eq!(
        text,
        r#"plyflow-sdk = { path = "/a\"b\\c/solver-plugins/door/sdk" }"#
    );
}

#[test]
fn the_commands_to_go_on_with_stand_in_the_readme_with_their_remarks_below_each_other() {
    for (kind, language, name, files) in all() {
        let commands = commands(&files);
        assert!(
            commands.len() >= 2,
            "{kind:?} in {language:?}: {commands:?}"
        );
        let last = commands.last().unwrap();
        assert!(
            last.starts_with("plyflow run workflow.yaml --trust"),
            "{last}"
        );
        assert!(
            commands.iter().any(|c| c.contains(&name.replace('-', "_"))),
            "{commands:?}"
        );
        let columns: Vec<Option<usize>> = commands.iter().map(|c| c.find(REMARK)).collect();
        assert!(
            columns[0].is_some() && columns.iter().all(|c| *c == columns[0]),
            "{commands:?}"
        );
    }
}
