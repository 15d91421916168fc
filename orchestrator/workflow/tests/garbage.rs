//! No text, however broken, makes the reader panic.

mod common;

use common::{EXPECTED, FABRIC, FILM, SCENE, Study, WORKFLOW};
use proptest::prelude::*;

/// Loads with one file replaced; findings are rendered both ways, since that walks all spans.
fn survives(name: &str, bytes: &[u8]) {
    let study = if name == "expected.json" {
        Study::with_expected_file()
    } else {
        Study::sound()
    };
    std::fs::write(study.path(name), bytes).unwrap();
    if let Err(found) = study.load() {
        assert!(!found.items.is_empty());
        let _ = (found.render(true), found.render(false), found.to_json());
    }
}

fn file() -> impl Strategy<Value = (&'static str, &'static str)> {
    prop_oneof![
        Just(("workflow.yaml", WORKFLOW)),
        Just(("scene.yaml", SCENE)),
        Just(("materials/fabric.yaml", FABRIC)),
        Just(("film.yaml", FILM)),
        Just(("expected.json", EXPECTED)),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn random_bytes_do_not_panic((name, _) in file(), bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        survives(name, &bytes);
    }

    #[test]
    fn truncated_files_do_not_panic((name, text) in file(), part in 0.0..1.0f64) {
        survives(name, &text.as_bytes()[..(part * text.len() as f64) as usize]);
    }

    #[test]
    fn files_with_a_foreign_piece_do_not_panic(
        (name, text) in file(), part in 0.0..1.0f64, cut in 0usize..30,
        piece in "[-a-z0-9:{}\\[\\]&*!|>'\"%@` \n\t#µ°,~<]{0,12}"
    ) {
        let at = (part * text.len() as f64) as usize;
        let end = (at + cut).min(text.len());
        let bytes = [&text.as_bytes()[..at], piece.as_bytes(), &text.as_bytes()[end..]].concat();
        survives(name, &bytes);
    }

    #[test]
    fn swapped_lines_do_not_panic((name, text) in file(), a in 0usize..60, b in 0usize..60) {
        let mut lines: Vec<&str> = text.lines().collect();
        let n = lines.len();
        lines.swap(a % n, b % n);
        survives(name, lines.join("\n").as_bytes());
    }
}

#[test]
fn deep_nesting_is_refused_without_panic() {
    survives("workflow.yaml", "[".repeat(100_000).as_bytes());
    survives(
        "workflow.yaml",
        format!("steps: {}", "{a: ".repeat(50_000)).as_bytes(),
    );
    let deep: String = (0..3000)
        .map(|i| format!("{}a:\n", " ".repeat(i)))
        .collect();
    survives("scene.yaml", deep.as_bytes());
    survives("expected.json", "[".repeat(100_000).as_bytes());
}

#[test]
fn values_of_every_wrong_type_do_not_panic() {
    for value in [
        "null",
        "true",
        "5",
        "-0.5",
        "text",
        "''",
        "[]",
        "{}",
        "[1, {a: b}]",
        "{a: {b: [c]}}",
        "&a [*b]",
    ] {
        for (name, text) in [
            ("workflow.yaml", WORKFLOW),
            ("scene.yaml", SCENE),
            ("materials/fabric.yaml", FABRIC),
        ] {
            for (i, line) in text.lines().enumerate() {
                let Some((key, _)) = line.split_once(": ").or_else(|| line.split_once(':')) else {
                    continue;
                };
                let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
                lines[i] = format!("{key}: {value}");
                survives(name, lines.join("\n").as_bytes());
            }
        }
    }
}
