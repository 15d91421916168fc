//! `plyflow check-plugin`: every planted fault is refused by the check that is meant for it, a crash, an exit and a
//! hang are findings, and sound plugins pass.

use plyflow_e2e::{program, repository};
use plyflow_kernels::built_in;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Exit code of a plugin that does not keep the contract.
const NOT_CONFORMING: i32 = 7;

/// Builds `tests/faults/c/SOURCE.c` with a fault into a folder.
fn build(folder: &Path, source: &str, fault: &str) -> PathBuf {
    let library = folder.join(format!("lib{source}_{fault}.so"));
    let built = Command::new(std::env::var_os("CC").unwrap_or_else(|| "cc".into()))
        .args([
            "-std=c11",
            "-O2",
            "-ffp-contract=off",
            "-Wall",
            "-Wextra",
            "-Werror",
        ])
        .args(["-fPIC", "-shared", "-I"])
        .arg(repository().join("schemas/abi"))
        .arg(format!("-DFAULT={fault}"))
        .arg("-o")
        .arg(&library)
        .arg(repository().join(format!("tests/faults/c/{source}.c")))
        .arg("-lm")
        .status()
        .expect("a C compiler");
    assert!(built.success(), "{fault} does not build");
    library
}

/// Exit code and what was said in JSON.
fn check(plugin: &Path, more: &[&str]) -> (i32, Value) {
    let output = Command::new(program())
        .arg("check-plugin")
        .arg(plugin)
        .args(["--format", "json"])
        .args(more)
        .stdin(Stdio::null())
        .output()
        .expect("plyflow starts");
    let said = serde_json::from_slice(&output.stdout).unwrap_or_else(|e| {
        panic!("{e}: {}", String::from_utf8_lossy(&output.stderr));
    });
    (output.status.code().expect("an exit code"), said)
}

/// The failed checks: name and what was seen.
fn failed(said: &Value) -> Vec<(String, String)> {
    let subjects = said["subjects"].as_array().expect("subjects");
    let checks = subjects
        .iter()
        .flat_map(|s| s["checks"].as_array().expect("checks"));
    let text = |v: &Value| v.as_str().expect("text").to_owned();
    checks
        .filter(|c| c["outcome"] == "failed")
        .map(|c| (text(&c["name"]), text(&c["seen"])))
        .collect()
}

/// Demands that a fault is refused by a check whose text says these words.
fn refused(folder: &Path, source: &str, fault: &str, by: &str, words: &str) {
    let (code, said) = check(&build(folder, source, fault), &["--time-limit", "60"]);
    assert_eq!(code, NOT_CONFORMING, "{fault}: {said:#}");
    let found = failed(&said);
    let meant = found
        .iter()
        .any(|(name, seen)| name == by && seen.contains(words));
    assert!(meant, "{fault}: expected {by} ({words}), found {found:?}");
}

#[test]
fn every_fault_planted_in_an_element_is_refused_by_the_check_that_is_meant_for_it() {
    let folder = tempfile::tempdir().unwrap();
    for (fault, by, words) in [
        ("PAST_END", "guard-zones", "1 doubles past its end"),
        ("BEFORE_START", "guard-zones", "1 doubles before its start"),
        ("FEW_CONSTANTS", "guard-zones", "`constants`"),
        ("WRITES_INPUT", "guard-zones", "`position`"),
        ("WRONG_STRIDE", "complete", "did not write"),
        ("UNWRITTEN", "complete", "`energy`, row 1"),
        ("ACCUMULATES", "finite", "`force`"),
        ("NOT_FINITE", "finite", "`force`"),
        ("FRAME", "frame-invariance", "turned by 132 degrees"),
        ("ENERGY", "energy", "derivative of the energy"),
        ("ENERGY", "work", "work and energy differ"),
        ("BALANCE", "balance", "sum of forces"),
        ("PRESTRESS", "rest", "force at rest"),
        ("LONG_STEP", "critical-step", "of the true 2 / omega_max"),
        ("LIGHT", "mass", "differ from 1 by 5.0e-1"),
        (
            "NEIGHBOUR",
            "batch-independence",
            "differs from the same in lane",
        ),
        (
            "MEAN",
            "batch-independence",
            "differs from the same in lane",
        ),
        ("RACE", "threads", "differ"),
        ("STEP_RACE", "threads", "differ"),
        ("COUNTER", "repeatable", "second call"),
        ("ASKING", "asking", "NULL"),
        ("BAD_STATUS", "status", "42"),
        ("MANY_FIELDS", "sizes", "3 element fields"),
        ("STEP_IN_FIELDS", "complete", "`critical_step`"),
        ("PATCH_RACE", "patch-threads", "differ"),
        ("PATCH_COUNTER", "patch-repeatable", "second call"),
        ("PATCH_ASKING", "patch-asking", "stiffness"),
        ("PATCH_IN_FIELDS", "patch-complete", "`stiffness`"),
    ] {
        refused(folder.path(), "faulty_element", fault, by, words);
    }
}

#[test]
fn a_crash_an_exit_and_a_hang_are_findings_of_the_check_that_was_under_way() {
    let folder = tempfile::tempdir().unwrap();
    for (fault, words) in [
        ("SEGFAULT", "SIGSEGV"),
        ("ABORT", "SIGABRT"),
        ("EXIT", "ended the process with status 3"),
        ("HANG", "time limit"),
    ] {
        let library = build(folder.path(), "faulty_element", fault);
        let (code, said) = check(&library, &["--time-limit", "10"]);
        assert_eq!(code, NOT_CONFORMING, "{fault}");
        let found = failed(&said);
        assert_eq!(found.len(), 1, "{fault}: {found:?}");
        assert_eq!(found[0].0, "status", "{fault}");
        assert!(found[0].1.contains(words), "{fault}: {found:?}");
        let passed = said["passed"].as_u64().expect("a count");
        assert!(passed >= 3, "what passed before is kept: {said:#}");
    }
    refused(
        folder.path(),
        "faulty_material",
        "SEGFAULT",
        "status",
        "SIGSEGV",
    );
}

#[test]
fn a_panic_in_rust_is_refused_with_its_status() {
    let (code, said) = check(&plyflow_faults::library("panicking-element"), &[]);
    assert_eq!(code, NOT_CONFORMING);
    let found = failed(&said);
    let panic = |(name, seen): &(String, String)| name == "status" && seen.contains("PF_PANIC");
    assert!(found.iter().any(panic), "{found:?}");
}

#[test]
fn every_fault_planted_in_a_material_is_refused_by_the_check_that_is_meant_for_it() {
    let folder = tempfile::tempdir().unwrap();
    for (fault, by, words) in [
        ("PAST_END", "guard-zones", "`stress`"),
        ("NOT_FINITE", "finite", "`energy`"),
        ("PRESTRESS", "rest", "stress at rest"),
        ("WRONG_SHEAR", "stress", "S12"),
        ("SMALL_BOUND", "stiffness", "true largest tangents"),
        (
            "NEIGHBOUR",
            "batch-independence",
            "differs from the same in lane",
        ),
        ("GAINS", "cycle", "closed cycles"),
        ("WRONG_MOMENT", "moment", "M12"),
        ("WRONG_TANGENT", "tangent", "dM/dk"),
        ("BENT_AT_REST", "bending-rest", "moment when flat"),
        ("FIXED_SIZES", "sizes", "the parameters say"),
        ("RACE", "threads", "differ"),
        ("STIFFNESS_RACE", "threads", "differ"),
        ("DIVIDES_BY_DT", "zero-dt", "with dt = 0: membrane gave inf"),
        ("SKIPS_ZERO_DT", "zero-dt", "a step of dt = 0 differs"),
        ("SHEARED_STRESS", "stress", "S12"),
        ("SHEARED_BOUND", "stiffness", "true largest tangents"),
        ("SHEARED_GAINS", "cycle", "closed cycles"),
        ("NEGATIVE_BOUND", "stiffness", "bounds are positive"),
        ("BENDING_RACE", "bending-threads", "differ"),
        ("BENDING_COUNTER", "bending-repeatable", "second call"),
        ("BENDING_ASKING", "bending-asking", "NULL"),
        ("BENDING_DT", "bending-zero-dt", "a step of dt = 0 differs"),
        ("BENDING_GAINS", "bending-cycle", "closed cycles"),
        ("SHARP_MOMENT", "moment", "M11"),
    ] {
        refused(folder.path(), "faulty_material", fault, by, words);
    }
}

#[test]
fn sound_plugins_in_c_pass() {
    let folder = tempfile::tempdir().unwrap();
    for (source, fault) in [
        ("faulty_element", "NONE"),
        ("faulty_material", "NONE"),
        // A sheet without stiffness in shear, which says so.
        ("faulty_material", "SLACK"),
    ] {
        let (code, said) = check(&build(folder.path(), source, fault), &[]);
        assert_eq!((code, failed(&said)), (0, vec![]), "{source}, {fault}");
    }
}

#[test]
fn all_of_plyflow_s_own_components_pass() {
    for element in built_in::elements().map(|e| e.name) {
        let (code, said) = check(Path::new(element), &[]);
        assert_eq!((code, failed(&said)), (0, vec![]), "{element}");
    }
    let foil = "{youngs_modulus: 70 GPa, poisson_ratio: 0.33}";
    let (code, said) = check(Path::new("material-isotropic"), &["--with", foil]);
    assert_eq!((code, failed(&said)), (0, vec![]), "material-isotropic");
    let mut plugins = std::collections::BTreeSet::from(["material-isotropic".to_owned()]);
    for entry in std::fs::read_dir(repository().join("workflows/materials")).expect("materials") {
        let file = entry.expect("a file").path();
        let text = std::fs::read_to_string(&file).expect("a material");
        let plugin = text.lines().find_map(|l| l.strip_prefix("plugin: "));
        let plugin = plugin.expect("the line that names the plugin").trim();
        let first = plugins.insert(plugin.to_owned());
        let file = file.to_str().expect("a UTF-8 path");
        // The constant bending stiffnesses of a fabric are three files of one law.
        if first || !file.contains("-constant-") {
            let (code, said) = check(Path::new(plugin), &["--material", file]);
            assert_eq!((code, failed(&said)), (0, vec![]), "{file}");
        }
    }
    let all = built_in::materials().map(|m| m.name.to_owned());
    assert_eq!(
        plugins,
        all.collect(),
        "a material without a file in workflows/materials"
    );
}

#[test]
fn a_step_is_judged_by_its_descriptor_and_manifest_and_the_answer_says_so() {
    let (code, said) = check(Path::new("comparison"), &[]);
    assert_eq!((code, said["passed"].as_u64()), (0, Some(2)));
    let note = said["notes"][0].as_str().expect("a note");
    assert!(note.contains("descriptor and the manifest"), "{note}");
}

#[test]
fn what_is_no_plugin_is_refused_and_what_is_not_there_is_a_wrong_command() {
    for library in ["wrong-abi", "crash-on-load", "not-a-plugin", "unknown-unit"] {
        let (code, said) = check(&plyflow_faults::library(library), &[]);
        assert_eq!(code, NOT_CONFORMING, "{library}");
        assert_eq!(failed(&said)[0].0, "load", "{library}");
    }
    let absent = Command::new(program())
        .args(["check-plugin", "./no-such-library.so"])
        .output()
        .expect("plyflow starts");
    assert_eq!(absent.status.code(), Some(2));
    let said = String::from_utf8_lossy(&absent.stderr).into_owned();
    assert!(said.contains("no-such-library"), "{said}");
}

#[test]
fn a_wrong_parameter_is_refused_before_anything_runs() {
    let output = Command::new(program())
        .args(["check-plugin", "m4", "--with", "{hourglas: 2}"])
        .output()
        .expect("plyflow starts");
    assert_eq!(output.status.code(), Some(3));
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("hourglass"), "the nearest name: {said}");
}
