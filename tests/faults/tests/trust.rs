//! A stranger's folder with a workflow and a library: nothing of its code runs without consent.

mod stranger;

use stranger::{Place, build, told, told_in_one_line};

const BY_PATH: &str = "steps:\n  one: {plugin: ./libstranger.so}\n";
const BY_NAME: &str = "plugins: [.]\nsteps:\n  one: {plugin: stranger}\n";

/// Every command that reads a workflow.
const COMMANDS: [&[&str]; 12] = [
    &["validate", "workflow.yaml"],
    &["validate", "workflow.yaml", "--format", "json"],
    &["plan", "workflow.yaml"],
    &["graph", "workflow.yaml"],
    &["explain", "workflow.yaml", "one"],
    &["results", "workflow.yaml"],
    &["report", "workflow.yaml"],
    &["inspect", "one", "--workflow", "workflow.yaml"],
    &["extract", "workflow.yaml", "one", "--list"],
    &["export", "workflow.yaml", "one", "--format", "vtu"],
    &["run", "workflow.yaml"],
    &["plugins", "--workflow", "workflow.yaml"],
];

#[test]
fn no_command_loads_a_strangers_library_without_consent_however_it_is_named() {
    for steps in [BY_PATH, BY_NAME] {
        let place = Place::new(steps);
        for words in COMMANDS {
            let output = place.call(words);
            let text = told_in_one_line(&output);
            assert!(!place.was_loaded(), "{words:?} loads it: {text}");
            // The list of plugins knows only those in folders.
            if words[0] == "plugins" && steps == BY_PATH {
                continue;
            }
            assert!(text.contains("was not loaded"), "{words:?}: {text}");
            assert!(text.contains("--trust"), "{words:?}: {text}");
        }
        for words in [
            &["plugins", "./libstranger.so"][..],
            &["plugins", "stranger"],
        ] {
            assert_eq!(place.call(words).status.code(), Some(2));
            assert!(!place.was_loaded(), "{words:?}");
        }
        // A search path from where one happens to stand is the stranger's.
        let mut relative = place.command(&["plan", "workflow.yaml"]);
        let output = relative.env("PLYFLOW_PLUGINS", ".").output().unwrap();
        assert!(!place.was_loaded(), "{}", told(&output));
    }
}

#[test]
fn a_run_with_consent_works_and_the_next_commands_need_none_as_long_as_nothing_is_loaded() {
    for steps in [BY_PATH, BY_NAME] {
        let place = Place::new(steps);
        place.good(&["run", "--trust", "workflow.yaml", "--quiet"]);
        assert!(place.was_loaded());
        for words in COMMANDS
            .iter()
            .filter(|w| !["extract", "export"].contains(&w[0]))
        {
            place.good(words);
        }
        // To run it again needs consent again.
        let again = ["run", "workflow.yaml", "--force", "one"];
        assert_eq!(place.call(&again).status.code(), Some(3));
        assert!(!place.was_loaded());
    }
}

#[test]
fn consent_is_for_the_bytes_and_is_given_by_option_by_list_or_by_folder() {
    let place = Place::new(BY_PATH);
    let hash = place.hash();
    let there = place.path("there");
    let by_hash = format!("--trust={hash}");
    let ways: [&[&str]; 3] = [
        &["run", "workflow.yaml", "--force", "one", &by_hash],
        &[
            "run",
            "workflow.yaml",
            "--force",
            "one",
            "--trust=./libstranger.so",
        ],
        &["run", "workflow.yaml", "--force", "one", "--plugins", "."],
    ];
    for words in ways {
        place.good(words);
        assert!(place.was_loaded(), "{words:?}");
    }
    let run = ["run", "workflow.yaml", "--force", "one"];
    let refused = || {
        let output = place.call(&run);
        assert_eq!(output.status.code(), Some(3), "{}", told(&output));
        assert!(!place.was_loaded());
    };
    refused();
    // A folder is no library: to say nothing would be to let its user believe that it is trusted.
    let output = place.call(&["run", "workflow.yaml", "--trust=."]);
    assert_eq!(output.status.code(), Some(2), "{}", told(&output));
    for entry in ["./libstranger.so", hash.as_str(), there.to_str().unwrap()] {
        place.good(&["trust", entry]);
        assert!(told(&place.call(&["trust"])).contains(match entry {
            "./libstranger.so" => &hash,
            other => other,
        }));
        place.good(&run);
        assert!(place.was_loaded(), "{entry}");
        place.good(&["trust", "--forget", entry]);
        refused();
    }
    // Other bytes under the same path.
    place.good(&["trust", "./libstranger.so"]);
    build("stranger2", &there.join("libstranger.so"));
    refused();
    let output = place.call(&["run", "workflow.yaml", &by_hash]);
    assert_eq!(output.status.code(), Some(3), "{}", told(&output));
    assert!(!place.was_loaded());
    // A list that others can write is no list.
    let list = place.path("home/.config/plyflow/trusted");
    place.good(&["trust", "./libstranger.so"]);
    let mut mode = std::fs::metadata(&list).unwrap().permissions();
    std::os::unix::fs::PermissionsExt::set_mode(&mut mode, 0o666);
    std::fs::set_permissions(&list, mode).unwrap();
    let output = place.call(&run);
    assert!(
        told(&output).contains("others than you"),
        "{}",
        told(&output)
    );
    assert!(!place.was_loaded());
}

#[test]
fn a_library_that_is_exchanged_after_the_consent_is_not_loaded_to_be_described() {
    let place = Place::new(BY_PATH);
    let of = |hash: &str| {
        let words = ["step-worker", "--describe", "./libstranger.so", hash];
        told(&place.call(&words))
    };
    assert!(of(&place.hash()).contains("Does what a stranger wants"));
    assert!(place.was_loaded());
    let text = of(&"ab".repeat(32));
    assert!(
        text.contains("not the library that was consented to"),
        "{text}"
    );
    assert!(!place.was_loaded());
}

#[test]
fn the_list_stays_in_use_whatever_the_mask_of_the_process_and_the_last_line() {
    let place = Place::new(BY_PATH);
    let list = place.path("home/.config/plyflow/trusted");
    build("known", &place.path("known.so"));
    place.good(&["trust", place.path("known.so").to_str().unwrap()]);
    // As an editor leaves it: the last line without an end.
    let text = std::fs::read_to_string(&list).unwrap();
    std::fs::write(&list, text.trim_end()).unwrap();
    place.good(&["trust", "./libstranger.so"]);
    assert_eq!(std::fs::read_to_string(&list).unwrap().lines().count(), 2);
    let forget = [
        "trust",
        "--forget",
        place.path("known.so").to_str().unwrap(),
    ]
    .join(" ");
    let program = place.path("bin/plyflow");
    let mut shell = std::process::Command::new("sh");
    shell.args(["-c", &format!("umask 0; {} {forget}", program.display())]);
    shell
        .env("HOME", place.path("home"))
        .env_remove("XDG_CONFIG_HOME");
    assert!(shell.status().unwrap().success());
    let text = place.good(&["run", "workflow.yaml"]);
    assert!(!text.contains("others than you"), "{text}");
}

#[test]
fn a_manifest_beside_the_library_is_read_instead_of_it_and_must_say_the_same() {
    let place = Place::new(BY_PATH);
    place.good(&["plugins", "--trust", "./libstranger.so", "--write-manifest"]);
    assert!(place.was_loaded());
    for words in [
        &["validate", "workflow.yaml"][..],
        &["plan", "workflow.yaml"],
        &["explain", "workflow.yaml", "one"],
        &["plugins", "./libstranger.so"],
    ] {
        place.good(words);
    }
    assert_eq!(place.call(&["run", "workflow.yaml"]).status.code(), Some(3));
    assert!(!place.was_loaded());
    place.good(&["run", "--trust", "workflow.yaml"]);
    // One that says something else would let a run be checked by other rules than the library has.
    let file = place.path("there/libstranger.manifest.json");
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, text.replace("8 deg", "9 deg")).unwrap();
    let output = place.call(&["run", "--trust", "workflow.yaml"]);
    assert_eq!(output.status.code(), Some(3));
    assert!(
        told_in_one_line(&output).contains("says something else"),
        "{}",
        told(&output)
    );
}

#[test]
fn a_library_that_takes_the_name_of_a_shipped_plugin_is_an_error_that_names_both() {
    let names_both = |place: &Place, words: &[&str]| {
        let output = place.call(words);
        let text = told(&output).replace(['\n', '│', ' '], "");
        assert_eq!(output.status.code(), Some(3), "{words:?}: {text}");
        for part in [
            "bin/plugins/libshipped.so",
            "there/libmine.so",
            "shipped`isthename",
        ] {
            assert!(text.contains(part), "{words:?}: {part} is not in {text}");
        }
    };
    let by_name = "plugins: [.]\nsteps:\n  one: {plugin: shipped}\n";
    let by_path = "steps:\n  one: {plugin: ./libmine.so}\n";
    for steps in [by_name, by_path] {
        let place = Place::new(steps);
        let (mine, plain) = (place.path("there/libmine.so"), by_name == steps);
        build("shipped", &mine);
        if plain {
            // The same bytes under another name are the same plugin.
            place.good(&["validate", "--trust", "workflow.yaml"]);
        }
        // One byte more: another library, that does the same.
        let bytes = std::fs::read(&mine).unwrap();
        std::fs::write(&mine, [&bytes[..], b"!"].concat()).unwrap();
        for words in [
            &["validate", "--trust", "workflow.yaml"][..],
            &["run", "--trust", "workflow.yaml"],
            &["validate", "workflow.yaml", "--plugins", "."],
        ] {
            names_both(&place, words);
        }
        if plain {
            std::fs::rename(&mine, place.path("there/libshipped.so")).unwrap();
            place.was_loaded();
            let output = place.call(&["validate", "workflow.yaml"]);
            assert!(
                told_in_one_line(&output).contains("two libraries of one name"),
                "{}",
                told(&output)
            );
            assert!(!place.was_loaded(), "by its file's name alone");
        }
    }
}

#[test]
fn what_a_store_has_kept_of_a_library_gives_it_no_consent() {
    let place = Place::new(BY_PATH);
    place.good(&["run", "--trust", "workflow.yaml"]);
    let hash = place.hash();
    // The stranger knows bytes that the user trusts, and says in the store that the library has them.
    build("known", &place.path("known.so"));
    place.good(&["trust", place.path("known.so").to_str().unwrap()]);
    let trusted = std::fs::read_to_string(place.path("home/.config/plyflow/trusted")).unwrap();
    let known = &trusted[..64];
    assert_ne!(known, hash);
    let mut forged = 0;
    let store = place.path("there/.plyflow");
    for file in walk(&store) {
        let bytes = std::fs::read(&file).unwrap();
        let changed = replace(&bytes, hash.as_bytes(), known.as_bytes());
        if changed != bytes {
            std::fs::write(&file, changed).unwrap();
            forged += 1;
        }
    }
    assert!(forged > 0, "the store says nothing of the library");
    place.was_loaded();
    for words in COMMANDS {
        let output = place.call(words);
        assert!(!place.was_loaded(), "{words:?}: {}", told(&output));
    }
    let output = place.call(&["run", "workflow.yaml", "--force", "one"]);
    assert_eq!(output.status.code(), Some(3), "{}", told(&output));
    assert!(!place.was_loaded());
}

fn walk(folder: &std::path::Path) -> Vec<std::path::PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap().flatten() {
        let path = entry.path();
        if path.is_dir() {
            found.extend(walk(&path));
        } else {
            found.push(path);
        }
    }
    found
}

fn replace(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    let (mut out, mut at) = (Vec::new(), 0);
    while at < bytes.len() {
        if bytes[at..].starts_with(from) {
            out.extend_from_slice(to);
            at += from.len();
        } else {
            out.push(bytes[at]);
            at += 1;
        }
    }
    out
}
