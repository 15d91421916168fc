//! A resolution knows all that it rests on.

mod common;

use common::{Study, catalog};

/// The sound study with an STL tool and a file parameter.
fn study() -> Study {
    let study = Study::sound();
    study.write("tool.stl", "solid\nendsolid\n");
    study.write("table.csv", "1, 2\n");
    let scene = study.read("scene.yaml");
    let (start, end) = (
        scene.find("  joggle_spar:").unwrap(),
        scene.find("sheets:").unwrap(),
    );
    let stl = "  stl: {file: tool.stl, unit: 1 mm}\n";
    study.write(
        "scene.yaml",
        &format!("{}{stl}{}", &scene[..start], &scene[end..]),
    );
    study.mutate(
        "workflow.yaml",
        "element: m4",
        "element: m4\n      table: table.csv",
    );
    study
}

const FILES: [&str; 6] = [
    "workflow.yaml",
    "scene.yaml",
    "film.yaml",
    "materials/fabric.yaml",
    "tool.stl",
    "table.csv",
];

#[test]
fn the_evidence_fails_after_a_change_of_any_file_that_was_read_and_holds_after_its_return() {
    let study = study();
    let found = plyflow_workflow::resolve(&study.path("workflow.yaml"), &catalog(), &[])
        .unwrap_or_else(|e| panic!("{}", e.render(false)));
    assert!(found.evidence.holds(&catalog()));
    for name in FILES {
        let text = study.read(name);
        study.write(name, &format!("{text}\n"));
        assert!(!found.evidence.holds(&catalog()), "{name} changed");
        std::fs::remove_file(study.path(name)).unwrap();
        assert!(!found.evidence.holds(&catalog()), "{name} is gone");
        study.write(name, &text);
        assert!(found.evidence.holds(&catalog()), "{name} is back");
    }
}

#[test]
fn the_evidence_fails_when_any_plugin_or_component_is_gone() {
    let study = study();
    let found = plyflow_workflow::resolve(&study.path("workflow.yaml"), &catalog(), &[])
        .unwrap_or_else(|e| panic!("{}", e.render(false)));
    let mut used: Vec<String> = Vec::new();
    for step in &found.workflow.steps {
        used.push(step.plugin.name.clone());
        used.extend(step.components.iter().map(|c| c.name.clone()));
    }
    assert!(used.iter().any(|n| n == "material-marlow") && used.iter().any(|n| n == "rf4"));
    for name in used {
        let mut without = catalog();
        without.0.retain(|m| m.name != name);
        assert!(!found.evidence.holds(&without), "without {name}");
    }
}
