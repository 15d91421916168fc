//! Damage of every kind to every file of a store: no command tells a wrong number, the same run repairs it, nothing blocks for ever.
//!
//! `PLYFLOW_FLIPS=1000 cargo test --release -p plyflow-faults --test damage -- --ignored --nocapture` does the long form of it, on real
//! plugins too, which have to be built (`make build`).

mod lab;

use lab::{
    Damage, Lab, MIXED, Random, Study, WHOLE_FILE, copy, files, harm, hide, kind, numbers, real,
    text,
};
use plyflow::plan::Key;
use plyflow::store::Store;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};

#[test]
fn damage_to_any_file_of_a_store_gives_no_wrong_number_and_is_repaired() {
    Lab::new(Study::new(MIXED), "all").trials(38, 60, 18);
}

#[test]
fn every_kind_of_file_survives_every_kind_of_damage_to_the_whole_of_it() {
    let lab = Lab::new(Study::new(MIXED), "all");
    let mut random = Random(7);
    let kinds = ["vtkhdf", "record.json", "journal", "json", "lock"];
    for kind_ in kinds {
        for damage in WHOLE_FILE {
            let mut all = files(&lab.store());
            all.retain(|f| kind(f) == kind_);
            let file = random.one_of(&all).clone();
            harm(&lab.store(), &file, damage, &mut random);
            let about = format!("{damage:?} of {kind_}");
            let output = lab.ask(&["run", "--no-report", "--force", "all"], &about);
            assert_eq!(output.status.code(), Some(0), "{about}: {}", text(&output));
            let output = lab.ask(&["results", "--format", "json"], &about);
            assert_eq!(numbers(&output), lab.numbers, "{about}");
        }
    }
    lab.settle("at the end");
}

#[test]
fn a_record_edited_by_hand_never_turns_a_check_green() {
    let steps = "steps:\n  a: {plugin: trivial, with: {value: 2}}\nexpect:\n  - {step: a, result: value, value: 3, tolerance: 0.1, source: made up}\n";
    let study = Study::new(steps);
    let run = |more: &[&str]| {
        study
            .call(&[&["run", "--no-report"], more].concat())
            .status
            .code()
    };
    assert_eq!(run(&["--check"]), Some(5));
    let all = files(&study.path(".plyflow"));
    let record = all.iter().find(|f| kind(f) == "record.json").unwrap();
    let edited = std::fs::read_to_string(record).unwrap();
    let edited = edited.replace("\"value\": 2.0", "\"value\": 3.0");
    for words in [
        &["results", "--check"][..],
        &["run", "--check", "--no-report"],
    ] {
        std::fs::write(record, &edited).unwrap();
        let output = study.call(words);
        let said = text(&output);
        assert!(said.contains("damaged"), "{said}");
        // Not shown, or made again and missed as before.
        let code = if words[0] == "run" { 5 } else { 8 };
        assert_eq!(output.status.code(), Some(code), "{said}");
        run(&[]);
    }
    // With nothing to be seen from outside.
    for words in [
        &["results", "--check"][..],
        &["run", "--check", "--no-report"],
    ] {
        std::fs::write(record, &edited).unwrap();
        hide(&study.path(".plyflow"), record);
        let output = study.call(words);
        assert!(text(&output).contains("damaged"), "{}", text(&output));
        assert!(matches!(output.status.code(), Some(5 | 8)));
        run(&[]);
    }
    let last = numbers(&study.call(&["results", "--format", "json"]));
    assert_eq!(last.values().copied().collect::<Vec<_>>(), [2f64.to_bits()]);
}

#[test]
fn rot_in_what_a_report_or_inspect_shows_is_named_and_made_again() {
    let lab = Lab::new(Study::new(MIXED), "all");
    let all = files(&lab.store());
    // Measured in the middle of the numbers of a mesh: HDF5 itself does not notice.
    let of_mesh = |f: &&PathBuf| {
        let text = std::fs::read_to_string(f).unwrap_or_default();
        kind(f) == "record.json" && text.contains("\"step\": \"mesh\"")
    };
    let record = all.iter().find(of_mesh).unwrap();
    let name = record.to_str().unwrap().replace(".record.json", ".vtkhdf");
    let artifact = Path::new(&name);
    for words in [
        &["report"][..],
        &["inspect"],
        &["results", "--front"],
        &["run", "--force", "read"],
    ] {
        let mut bytes = std::fs::read(artifact).unwrap();
        let half = bytes.len() / 2;
        bytes[half] ^= 4;
        std::fs::write(artifact, &bytes).unwrap();
        hide(&lab.store(), artifact);
        let output = match words[0] {
            "inspect" => lab.study.command_on(&name, words).output().unwrap(),
            _ => lab.study.call(words),
        };
        let said = text(&output);
        assert!(said.contains("damaged"), "{words:?}: {said}");
        let code = if words[0] == "run" { 0 } else { 8 };
        assert_eq!(output.status.code(), Some(code), "{words:?}: {said}");
        if words[0] == "inspect" {
            lab.ask(&["verify"], "after inspect");
        }
        lab.ask(&["run", "--no-report"], "again");
        lab.settle(words[0]);
    }
}

#[test]
fn verify_that_is_to_say_it_only_moves_nothing() {
    let study = Study::new("steps:\n  a: {plugin: trivial, with: {value: 2}}\n");
    study.call(&["run", "--no-report"]);
    for file in files(&study.path(".plyflow")) {
        if kind(&file) != "lock" {
            std::fs::write(&file, vec![7; 100]).unwrap();
        }
    }
    let before = files(&study.path(".plyflow"));
    let output = study.call(&["verify", "--dry-run"]);
    assert_eq!(output.status.code(), Some(8), "{}", text(&output));
    assert_eq!(files(&study.path(".plyflow")), before);
    assert!(!study.path(".plyflow/damaged").exists());
    // The same without it does.
    assert_eq!(study.call(&["verify"]).status.code(), Some(8));
    assert!(study.path(".plyflow/damaged/plugins.json").exists());
}

#[test]
fn a_step_made_again_is_compared_byte_for_byte() {
    let study = Study::new(
        "steps:\n  same: {plugin: mesh}\n  other: {plugin: trivial, with: {value: 1}}\n  last: {plugin: sum, from: {in: [same, other]}}\n",
    );
    study.call(&["run", "--no-report"]);
    let before = study.artifacts();
    let words = ["verify", "--again", "same", "--again", "last"];
    let output = study.call(&words);
    let said = text(&output);
    assert_eq!(output.status.code(), Some(0), "{said}");
    for step in ["same", "last"] {
        assert!(
            said.contains(&format!("{step}: made again, the same ")),
            "{said}"
        );
    }
    assert_eq!(study.artifacts(), before);
    // One that was made of other inputs than its key says, sealed all the same, as a plugin that is not reproducible leaves it.
    let store = Store::new(study.path(".plyflow").try_into().unwrap());
    let named = |step: &str| {
        let keys = store.keys().unwrap();
        let of = |k: &Key| store.read_record(k).unwrap().step == step;
        keys.into_iter().find(of).unwrap()
    };
    let (key, mut record) = (named("last"), store.read_record(&named("last")).unwrap());
    let bytes = std::fs::read(store.artifact(&named("other"))).unwrap();
    record.bytes = bytes.len() as u64;
    record.hash = plyflow_artifact::seal::hash(&bytes);
    let text_ = serde_json::to_string(&record).unwrap();
    std::fs::write(store.artifact(&key), &bytes).unwrap();
    std::fs::write(store.record(&key), plyflow_artifact::seal::seal(&text_)).unwrap();
    let output = study.call(&words);
    let said = text(&output);
    assert_eq!(output.status.code(), Some(8), "{said}");
    assert!(
        said.contains("last: made again, and it is ANOTHER"),
        "{said}"
    );
    assert_eq!(std::fs::read(store.artifact(&key)).unwrap(), bytes);
}

#[test]
fn a_store_of_an_earlier_version_is_told_and_left_alone_until_it_is_cleaned() {
    let study = Study::new("steps:\n  a: {plugin: trivial, with: {value: 2}}\n");
    study.call(&["run", "--no-report"]);
    let all = files(&study.path(".plyflow"));
    let artifact = all.iter().find(|f| kind(f) == "vtkhdf").unwrap();
    let record = artifact.with_extension("record.json");
    let text_ = std::fs::read_to_string(&record).unwrap();
    let mut old: Value = serde_json::from_str(&text_).unwrap();
    for name in ["seal", "hash"] {
        old.as_object_mut().unwrap().remove(name);
    }
    old["version"] = 1.into();
    std::fs::write(&record, old.to_string()).unwrap();
    let earlier = artifact.with_extension("h5");
    std::fs::rename(artifact, &earlier).unwrap();
    for words in [&["plan"][..], &["explain", "a"]] {
        let said = text(&study.call(words));
        assert!(said.contains("an earlier version"), "{said}");
    }
    let said = text(&study.call(&["verify"]));
    assert!(said.contains("1 of an earlier version"), "{said}");
    let said = text(&study.call(&["run", "--no-report"]));
    assert!(said.contains("study: 1 run, 0 cached"), "{said}");
    assert!(earlier.exists(), "nothing is thrown away unasked");
    assert_eq!(study.call(&["clean"]).status.code(), Some(0));
    assert!(!earlier.exists());
    let said = text(&study.call(&["run", "--no-report"]));
    assert!(said.contains("study: 0 run, 1 cached"), "{said}");
}

/// Damages checkpoints of a run that was killed: the same command ends with the same bytes as one that was left alone.
fn checkpoints(seed: u64, times: usize) {
    let lab = Lab::new(real(), "defects");
    let killed = real();
    let often = ["--checkpoint-every", "0 s", "--jobs", "1"];
    let mut command = killed.command_on("workflow.yaml", &["run", "--no-report"]);
    command
        .args(often)
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let mut engine = command.spawn().expect("plyflow starts");
    let folder = killed.path(".plyflow/runs/study/checkpoints");
    let begun = Instant::now();
    while !files(&folder).iter().any(|f| f.ends_with("frame-9")) {
        assert!(begun.elapsed() < Duration::from_secs(300), "no checkpoint");
        std::thread::sleep(Duration::from_millis(2));
    }
    engine.kill().unwrap();
    engine.wait().unwrap();
    // Its worker dies with it.
    std::thread::sleep(Duration::from_secs(1));
    let pristine = killed.path("pristine");
    copy(&killed.path(".plyflow"), &pristine);
    let mut random = Random(seed);
    for number in 0..times {
        copy(&pristine, &killed.path(".plyflow"));
        let file = random.one_of(&files(&folder)).clone();
        let damage = match number % 3 {
            0 => WHOLE_FILE[(number / 3) % WHOLE_FILE.len()],
            _ => Damage::Bit,
        };
        harm(&folder, &file, damage, &mut random);
        let about = format!("{number}: {damage:?} of {}", file.display());
        eprintln!("{about}");
        let output = killed.call(&["run", "--no-report"]);
        assert_eq!(output.status.code(), Some(0), "{about}: {}", text(&output));
        assert!(killed.artifacts() == lab.artifacts, "{about}");
    }
    println!("{times} checkpoints damaged: the same bytes each time");
}

/// PLYFLOW_FLIPS (1000).
fn flips() -> usize {
    std::env::var("PLYFLOW_FLIPS").map_or(1000, |n| n.parse().expect("a number"))
}

#[test]
#[ignore = "minutes (make long): nine tenths and a half of PLYFLOW_FLIPS random bits (1000) and a fifth as many whole files, of test plugins and real ones"]
fn many_damages_to_a_store_give_no_wrong_number_and_are_repaired() {
    Lab::new(Study::new(MIXED), "all").trials(1, flips() * 8 / 10, flips() * 4 / 25);
    Lab::new(real(), "defects").trials(2, flips() * 3 / 20, flips() / 25);
}

#[test]
#[ignore = "minutes (make long): damages a thirteenth of PLYFLOW_FLIPS (1000) checkpoints"]
fn many_damages_to_checkpoints_give_the_same_bytes() {
    checkpoints(3, flips() * 3 / 40);
}
