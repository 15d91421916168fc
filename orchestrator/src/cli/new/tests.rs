use super::*;
use crate::cli::args::StudyWords;

fn args(kind: NewKind, flags: [bool; 3]) -> NewArgs {
    NewArgs {
        kind,
        name: "mine".into(),
        python: flags[0],
        rust: flags[1],
        c: flags[2],
        into: None,
        source: None,
        study: StudyWords::default(),
    }
}

#[test]
fn the_language_is_that_of_the_option_or_of_the_answer_and_none_is_made_up() {
    let element = |flags| args(NewKind::Element, flags);
    let c = language(&element([false, false, true]), None::<&mut &[u8]>).unwrap();
    assert_eq!(c, Language::C);
    let stop = language(&element([true, false, false]), None::<&mut &[u8]>).unwrap_err();
    assert_eq!(stop.code, exit::USAGE);
    let expected =
        "there is no template of an element in Python; there is one for --rust (Rust), --c (C)";
    assert_eq!(stop.text, expected);
    let stop = language(&element([false; 3]), None::<&mut &[u8]>).unwrap_err();
    assert_eq!(stop.code, exit::USAGE);
    assert!(
        stop.text.ends_with("--rust (Rust), --c (C)"),
        "{}",
        stop.text
    );

    let answered = |text: &str| {
        let mut answers = text.as_bytes();
        language(&element([false; 3]), Some(&mut answers))
    };
    assert_eq!(answered("rust\n").unwrap(), Language::Rust);
    assert_eq!(answered(" C \n").unwrap(), Language::C);
    for none in ["", "\n", "python\n", "c++\n"] {
        let stop = answered(none).unwrap_err();
        assert_eq!(stop.code, exit::USAGE);
        assert!(stop.text.contains("nothing was made"), "{}", stop.text);
    }
}

#[test]
fn nothing_that_is_there_is_overwritten() {
    let dir = tempfile::tempdir().unwrap();
    let root = Utf8Path::from_path(dir.path()).unwrap();
    let files = [(Utf8PathBuf::from("src/lib.rs"), "new".to_owned())];
    let read = |folder: &str| std::fs::read_to_string(root.join(folder).join("src/lib.rs"));

    write(&root.join("into/fresh"), &files).unwrap();
    assert_eq!(read("into/fresh").unwrap(), "new");
    std::fs::create_dir(root.join("empty")).unwrap();
    write(&root.join("empty"), &files).unwrap();
    assert_eq!(read("empty").unwrap(), "new");

    std::fs::create_dir(root.join("full")).unwrap();
    std::fs::write(root.join("full/notes.txt"), "mine").unwrap();
    std::fs::write(root.join("file"), "mine").unwrap();
    std::os::unix::fs::symlink("nowhere", root.join("link")).unwrap();
    for name in ["full", "file", "link"] {
        let stop = write(&root.join(name), &files).unwrap_err();
        assert_eq!(stop.code, exit::USAGE, "{name}");
        assert!(stop.text.contains("is there already"), "{}", stop.text);
    }
    assert!(!root.join("full/src").exists());
    assert_eq!(std::fs::read_to_string(root.join("file")).unwrap(), "mine");
    assert!(!root.join("nowhere").exists());
}
