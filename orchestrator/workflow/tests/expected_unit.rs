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
