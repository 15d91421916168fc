//! A step in C, built with nothing but a C compiler and the header, in a workflow.

use plyflow_e2e::{Study, repository, well};
use std::process::Command;

const WORKFLOW: &str = "
steps:
  formed: {plugin: mesh}
  twice: {plugin: ./libdouble_time.so, from: {formed: formed}}
  total: {plugin: sum, from: {in: twice}}
";

/// Builds the template into the study's folder, with a change to its source.
fn build(study: &Study, change: impl Fn(String) -> String) {
    let template = repository().join("solver-plugins/door/templates/step-c");
    let source = std::fs::read_to_string(template.join("step.c")).unwrap();
    std::fs::write(study.path("step.c"), change(source)).unwrap();
    let built = Command::new(std::env::var_os("CC").unwrap_or_else(|| "cc".into()))
        .args([
            "-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared", "-I",
        ])
        .arg(repository().join("schemas/abi"))
        .arg("-o")
        .args([study.path("libdouble_time.so"), study.path("step.c")])
        .status()
        .expect("a C compiler");
    assert!(built.success());
}

#[test]
fn a_step_in_c_runs_in_a_workflow_beside_steps_in_rust() {
    let study = Study::new(WORKFLOW);
    build(&study, |source| source);
    assert_eq!(study.run(&[]), well(3, 0));
    // The test mesh writes history/time = 0, 1, 2, 3.
    assert_eq!(study.values("twice", "sum"), [12.0]);
    assert_eq!(study.run(&[]), well(0, 3));
}

#[test]
fn a_changed_library_runs_its_step_and_what_depends_on_it() {
    let study = Study::new(WORKFLOW);
    build(&study, |source| source);
    assert_eq!(study.run(&[]), well(3, 0));
    build(&study, |source| {
        source.replace("time[i] *= factor;", "time[i] *= 1.5 * factor;")
    });
    let explained = String::from_utf8(study.call(&["explain", "twice"]).stdout).unwrap();
    assert!(explained.contains("plugin"), "{explained}");
    assert_eq!(study.run(&[]), well(2, 1));
    assert_eq!(study.values("twice", "sum"), [18.0]);
}
