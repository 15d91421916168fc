//! Fan-outs whose size is known only when an earlier step has run.

use plyflow_e2e::{Study, well};

const NESTED: &str = "
steps:
  outer: {plugin: split, with: {items: 2}}
  inner: {plugin: split, with: {items: 3}, for_each: {o: outer}, from: {in: outer}}
  leaf: {plugin: trivial, with: {value: 1}, for_each: {o: outer, i: inner}, from: {in: inner}}
  each: {plugin: sum, for_each: {o: outer}, from: {in: leaf}}
  all: {plugin: sum, from: {in: each}}
";

#[test]
fn a_nested_fan_out_runs_every_leaf_and_gathers_per_outer_item() {
    let study = Study::new(NESTED);
    assert_eq!(study.run(&[]), well(1 + 2 + 6 + 2 + 1, 0));
    assert_eq!(study.values("each", "sum"), [3.0, 3.0]);
    assert_eq!(study.values("all", "sum"), [6.0]);
    assert_eq!(study.run(&[]), well(0, 12));
}

#[test]
fn a_nested_fan_out_that_grows_runs_only_what_is_new() {
    let study = Study::new(NESTED);
    assert_eq!(study.run(&[]), well(12, 0));
    // A third outer item: the collection itself, its new inner split, leaves and sum, and the total. What
    // an item receives from `outer` is the whole collection, so its other items run again too.
    let ended = study.run(&["--set", "outer.items=3"]);
    assert_eq!(
        (ended.code, ended.executed + ended.cached),
        (Some(0), 1 + 3 + 9 + 3 + 1)
    );
    assert_eq!(
        study.values("all", "sum"),
        [6.0],
        "results are of the file, without --set"
    );
    assert_eq!(study.run(&[]), well(0, 12));
}

#[test]
fn two_fan_outs_meet_in_one_step_as_their_product() {
    let study = Study::new(
        "
steps:
  a: {plugin: split, with: {items: 2}}
  b: {plugin: split, with: {items: 3}}
  left: {plugin: trivial, with: {value: 1}, for_each: {x: a}}
  right: {plugin: trivial, with: {value: 10}, for_each: {y: b}}
  pair: {plugin: sum, for_each: {x: a, y: b}, from: {in: [left, right]}}
  all: {plugin: sum, from: {in: pair}}
",
    );
    assert_eq!(study.run(&[]), well(2 + 2 + 3 + 6 + 1, 0));
    assert_eq!(study.values("pair", "sum"), [11.0; 6]);
    assert_eq!(study.values("all", "sum"), [66.0]);
}

#[test]
fn two_fan_outs_of_which_one_is_empty_meet_in_nothing() {
    let study = Study::new(
        "
steps:
  a: {plugin: split, with: {items: 2}}
  b: {plugin: split, with: {items: 0}}
  pair: {plugin: trivial, for_each: {x: a, y: b}}
  all: {plugin: sum, from: {in: pair}}
",
    );
    assert_eq!(study.run(&[]), well(3, 0));
    assert_eq!(study.values("all", "sum"), [0.0]);
    assert_eq!(study.run(&[]), well(0, 3));
}

#[test]
fn a_step_downstream_of_nested_emptiness_still_runs_once() {
    let study = Study::new(&NESTED.replace("items: 3", "items: 0"));
    assert_eq!(study.run(&[]), well(1 + 2 + 2 + 1, 0));
    assert_eq!(study.values("all", "sum"), [0.0]);
}

#[test]
fn one_failing_item_leaves_its_siblings_alone() {
    // `hang` without a limit would never end, so the failing step is one that fails for every item.
    let study = Study::new(
        "
steps:
  zones: {plugin: split, with: {items: 3}}
  good: {plugin: trivial, for_each: {z: zones}}
  bad: {plugin: error, for_each: {z: zones}}
  all: {plugin: sum, from: {in: good}}
",
    );
    let ended = study.run(&[]);
    assert_eq!(
        (ended.code, ended.executed, ended.failed),
        (Some(4), 1 + 3 + 1, 3)
    );
}
