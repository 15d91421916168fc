//! An expectation is never dropped in silence.

mod common;

use common::{Study, catalog};

#[test]
fn an_expectation_of_a_result_whose_declared_unit_cannot_be_read_is_an_error_where_it_stands() {
    let mut catalog = catalog();
    let comparison = catalog.0.iter_mut().find(|m| m.name == "comparison");
    let result = comparison.unwrap().results.get_mut("wrinkle_length");
    result.unwrap().unit = "mtr".into();
    let study = Study::sound();
    let told = match plyflow_workflow::load(&study.path("workflow.yaml"), &catalog) {
        Ok(_) => panic!("the expectation is taken, or dropped"),
        Err(found) => found.render(false),
    };
    let line = study.mutate("workflow.yaml", "value: 68 mm", "value: 68 mm");
    for words in [
        &format!("workflow.yaml:{line}:"),
        "declares for `wrinkle_length.AW1`",
        "`mtr`",
    ] {
        assert!(told.contains(words), "{words} in {told}");
    }
}

#[test]
fn a_result_by_step_is_expected_of_a_step_that_is_wired() {
    let mut catalog = catalog();
    let comparison = catalog.0.iter_mut().find(|m| m.name == "comparison");
    let result = comparison.unwrap().results.get_mut("wrinkle_length");
    result.unwrap().by_step = true;
    let study = Study::sound();
    let load = || match plyflow_workflow::load(&study.path("workflow.yaml"), &catalog) {
        Ok(_) => String::new(),
        Err(found) => found.render(false),
    };
    let line = study.mutate(
        "workflow.yaml",
        "wrinkle_length.AW1",
        "wrinkle_length.coarze",
    );
    let told = load();
    for words in [
        &format!("workflow.yaml:{line}:"),
        "`wrinkle_length.coarze` is none of the results of `comparison`",
        "`wrinkle_length.coarse`",
    ] {
        assert!(told.contains(words), "{words} in {told}");
    }
    study.mutate("workflow.yaml", "wrinkle_length.coarze", "wrinkle_length");
    assert!(load().contains("`wrinkle_length` is none of"));
    for (to, sound) in [
        ("wrinkle_length.coarse_0_12.a_a", true),
        ("wrinkle_length.coarse_", false),
        ("wrinkle_length.coarse_x", false),
        ("wrinkle_length.coarser", false),
    ] {
        study.mutate(
            "workflow.yaml",
            "result: wrinkle_length",
            &format!("result: {to}"),
        );
        assert_eq!(load().is_empty(), sound, "{to}");
        study.mutate(
            "workflow.yaml",
            &format!("result: {to}"),
            "result: wrinkle_length",
        );
    }
    study.mutate(
        "workflow.yaml",
        "result: wrinkle_length",
        "result: wrinkle_length.coarse",
    );
    assert_eq!(load(), "");
}
