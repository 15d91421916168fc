//! What files may be named, and how what is wrong with them is told.

mod common;

use common::Study;

const W: &str = "workflow.yaml";

/// The findings of a study that has some.
fn told(study: &Study) -> plyflow_workflow::Diagnostics {
    match study.load() {
        Ok(_) => panic!("nothing was found"),
        Err(d) => d,
    }
}

/// A table beside the workflow that a step names.
fn with_table(name: &str) -> Study {
    let study = Study::sound();
    study.mutate(W, "damping: 0.1", &format!("table: {name:?}"));
    study
}

#[test]
fn what_is_no_file_of_data_is_refused_wherever_it_is_named() {
    let study = with_table("pipe");
    let pipe = study.path("pipe");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    assert!(made.unwrap().success());
    let found = told(&study).to_string();
    assert!(
        found.contains("cannot read `pipe`: it is a pipe, no file with data"),
        "{found}"
    );
    for (from, to, says) in [
        (
            "table: \"pipe\"",
            "table: /dev/zero",
            "cannot read `/dev/zero`: it is a device",
        ),
        (
            "table: /dev/zero",
            "table: materials",
            "cannot read `materials`: it is a folder",
        ),
        (
            "scene: scene.yaml\n      element: m4",
            "scene: pipe\n      element: m4",
            "cannot read `pipe`: it is a pipe",
        ),
    ] {
        study.mutate(W, from, to);
        let found = told(&study).to_string();
        assert!(found.contains(says), "{found}");
    }
    let whole = plyflow_workflow::load(&pipe, &common::catalog()).unwrap_err();
    assert!(
        whole
            .to_string()
            .contains("cannot read the workflow: it is a pipe"),
        "{whole}"
    );
    let study = Study::with_expected_file();
    std::fs::remove_file(study.path("expected.json")).unwrap();
    std::fs::create_dir(study.path("expected.json")).unwrap();
    assert!(told(&study).to_string().contains("it is a folder"));
}

#[test]
fn files_that_people_write_have_a_limit() {
    let study = Study::sound();
    let large = "# filler\n".repeat((plyflow_files::open::MOST_WRITTEN / 9 + 1) as usize);
    study.write("scene.yaml", &(study.read("scene.yaml") + &large));
    let found = told(&study).to_string();
    assert!(
        found.contains("of data; at most 16.0 MiB are read"),
        "{found}"
    );
}

#[test]
fn a_name_in_another_form_of_unicode_is_found_and_differences_that_nobody_sees_are_told() {
    let (one, marked) = ("gr\u{f6}\u{df}e.csv", "gro\u{308}\u{df}e.csv");
    let study = with_table(one);
    study.write(marked, "x");
    let loaded = study.load().unwrap();
    let step = common::step(&loaded, "coarse");
    assert_eq!(step.files.last().unwrap().path, study.path(marked));
    // What was kept of it does not outlive a file of the very name.
    let kept = plyflow_workflow::resolve(&study.path(W), &common::catalog(), &[]).unwrap();
    assert!(kept.evidence.holds(&common::catalog()));
    study.write(one, "another");
    assert!(!kept.evidence.holds(&common::catalog()));
    for (named, there, says) in [
        (
            "a.csv ",
            "a.csv",
            "take the blank at the end of the path away",
        ),
        (
            "b.csv",
            "b.csv ",
            "has a blank at its end or begin: rename it to `b.csv`",
        ),
        ("c.csv", "d.csv", "did you mean `d.csv`"),
    ] {
        let study = with_table(named);
        study.write(there, "x");
        let found = told(&study).to_string();
        assert!(
            found.contains("there is no such file") && found.contains(says),
            "{found}"
        );
    }
}

#[test]
fn a_workflow_in_utf_16_is_read_and_another_encoding_is_told_with_its_line() {
    let study = Study::sound();
    let text = study.read(W);
    let wide: Vec<u8> = std::iter::once(0xfeff)
        .chain(text.encode_utf16())
        .flat_map(|u: u16| u.to_le_bytes())
        .collect();
    std::fs::write(study.path(W), wide).unwrap();
    study.load().unwrap();
    let latin: Vec<u8> = text
        .replace("main", "gr\u{f6}\u{df}te")
        .chars()
        .map(|c| c as u8)
        .collect();
    std::fs::write(study.path(W), latin).unwrap();
    let found = told(&study).to_string();
    assert!(
        found.contains("not text in UTF-8, from line 3: save it as UTF-8"),
        "{found}"
    );
}

#[test]
fn messages_are_of_bounded_length_and_harmless_whatever_a_file_holds() {
    let long = "x".repeat(10_000_000);
    for (from, to) in [
        ("damping: 0.1", format!("damping: {long}")),
        ("damping: 0.1", format!("{long}: 1")),
        ("element_size: 8 mm", format!("element_size: 8 {long}")),
        ("element_size: 8 mm", format!("element_size: {long}")),
        ("plugin: forming-explicit", format!("plugin: {long}")),
        ("contact: penalty", format!("contact: {long}")),
        ("scene: scene.yaml", format!("scene: {long}")),
        ("coarse:", format!("{long}:")),
        (
            "description: The main job.",
            format!("description: [{long}"),
        ),
        (
            "damping: 0.1",
            format!("damping: \"\\e[2J\\u202e\"\n      # {long}"),
        ),
    ] {
        let study = Study::sound();
        study.mutate(W, from, &to);
        let found = told(&study);
        for text in [
            found.to_string(),
            found.render(false),
            found.to_json().to_string(),
        ] {
            let each = text.len() / found.items.len();
            assert!(
                each < 6000,
                "{from}: {} bytes for {} findings",
                text.len(),
                found.items.len()
            );
            assert!(!text.contains(['\u{1b}', '\u{202e}']), "{from}");
        }
    }
}
