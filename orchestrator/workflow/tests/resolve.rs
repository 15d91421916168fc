//! What a sound workflow resolves to.

mod common;

use common::{Study, step};
use plyflow_workflow::resolved::{Dimension, ResolvedInput, ResolvedWorkflow};
use serde_json::json;

fn sound() -> (Study, ResolvedWorkflow) {
    let study = Study::sound();
    let workflow = study
        .load()
        .unwrap_or_else(|e| panic!("{}", e.render(false)));
    (study, workflow)
}

#[test]
fn the_main_workflow_is_resolved_in_topological_order() {
    let (study, w) = sound();
    let names: Vec<&str> = w.steps.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "coarse",
            "defects",
            "zones",
            "boundary",
            "local",
            "comparison"
        ]
    );
    assert_eq!(w.file, study.path("workflow.yaml"));
    assert_eq!(w.name, "joggle-spar");
    let coarse = step(&w, "coarse");
    assert_eq!(coarse.resources.cores, 2);
    assert_eq!(coarse.resources.memory, 4 << 30);
    assert_eq!(coarse.resources.time_limit, 1800.0);
    assert_eq!((coarse.retries, step(&w, "zones").retries), (1, 0));
    assert!(step(&w, "zones").collection);
}

#[test]
fn parameters_are_si_with_defaults_and_components_with_theirs() {
    let (_study, w) = sound();
    let p = &step(&w, "coarse").parameters;
    assert_eq!(p["element_size"], json!(0.008));
    assert_eq!(
        p["element"],
        json!({"plugin": "m4", "with": {"hourglass": 0.05}})
    );
    assert_eq!(p["write_curvature"], json!(false));
    assert!(
        p.get("label").is_none(),
        "neither given nor with a default: absent"
    );
    assert_eq!(
        step(&w, "defects").parameters["over_shear_positive"],
        json!(8f64.to_radians())
    );
    let names: Vec<&str> = step(&w, "coarse")
        .components
        .iter()
        .map(|c| c.name.as_str())
        .collect();
    assert_eq!(names, ["m4", "material-marlow", "material-fabric"]);
}

#[test]
fn a_scene_has_its_materials_inside_and_reads_back_as_its_type() {
    let (_study, w) = sound();
    let scene = &step(&w, "coarse").parameters["scene"];
    let ply = &scene["sheets"][1];
    assert_eq!(
        ply["material"]["with"],
        json!({"fibre_modulus": 3e9, "shear": 112.19})
    );
    assert_eq!(ply["material"]["thickness"], json!("0.0004 m"));
    assert_eq!(ply["length"], json!("0.48 m"));
    assert!(
        ply["material"].get("source").is_none(),
        "prose does not enter"
    );
    use plyflow_model::{friction::Coefficient, units::Number};
    let typed = plyflow_model::scene::Scene::from_json(scene.clone()).unwrap();
    let constant = |n| Some(Coefficient::Constant(Number(n)));
    assert_eq!(typed.friction.tool_diaphragm, constant(0.51));
    assert_eq!(serde_json::to_value(&typed).unwrap(), *scene);
}

#[test]
fn a_table_of_pressures_is_read_in_any_unit_and_reads_back_as_its_type() {
    let study = Study::sound();
    study.mutate(
        "scene.yaml",
        "bag_pressure: 1 bar",
        "weight: tool\n    bag_pressure: {table: [{share: 0, pressure: 0 kPa}, {share: 0.5, pressure: 60 kPa}, {share: 1, pressure: 1 bar}]}",
    );
    let w = (study.load()).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let scene = &step(&w, "coarse").parameters["scene"];
    let typed = plyflow_model::scene::Scene::from_json(scene.clone()).unwrap();
    assert_eq!(serde_json::to_value(&typed).unwrap(), *scene);
    use plyflow_model::scene::{PressureCourse, Process};
    let Process::DoubleDiaphragm(process) = &typed.process else {
        panic!("{:?}", typed.process)
    };
    let PressureCourse::Course(course) = &process.bag_pressure else {
        panic!("{:?}", process.bag_pressure)
    };
    let rows: Vec<_> = (course.table.iter())
        .map(|r| (r.share.0, r.pressure.si()))
        .collect();
    assert_eq!(rows, [(0.0, 0.0), (0.5, 6e4), (1.0, 1e5)]);
    assert_eq!(process.bag_pressure.last(), 1e5);
}

#[test]
fn wires_follow_the_order_of_ports_and_fan_outs_their_collections() {
    let (_study, w) = sound();
    let wire = |port: &str, from: &str| ResolvedInput {
        port: port.into(),
        from: from.into(),
    };
    assert_eq!(
        step(&w, "comparison").inputs,
        [
            wire("global", "coarse"),
            wire("zones", "zones"),
            wire("defects", "defects"),
            wire("local", "local")
        ]
    );
    assert_eq!(step(&w, "defects").inputs, [wire("formed", "coarse")]);
    let zone = [Dimension {
        name: "zone".into(),
        over: "zones".into(),
    }];
    assert_eq!(step(&w, "local").dimensions, zone);
    assert!(step(&w, "comparison").dimensions.is_empty());
}

#[test]
fn a_collection_that_is_fanned_out_itself_gives_nested_dimensions() {
    let study = Study::sound();
    let text = r#"plyflow: 1
name: nested
steps:
  inner: {plugin: zone-extraction, for_each: {z: zones}, from: {defects: fine-defects}}
  leaf: {plugin: boundary-interpolation, for_each: {i: inner, z: zones}, from: {formed: fine, zones: inner}}
  pair: {plugin: boundary-interpolation, for_each: {a: zones, b: others}, from: {formed: coarse, zones: others}}
  fine-defects: {plugin: defect-detection, for_each: {z: zones}, from: fine}
  fine: {plugin: forming-explicit, for_each: {z: zones}, with: {element: rf4}}
  others: {plugin: zone-extraction, from: defects}
  zones: {plugin: zone-extraction, from: defects}
  defects: {plugin: defect-detection, from: coarse}
  coarse: {plugin: forming-explicit, with: {element: m4}}
"#;
    study.write("workflow.yaml", text);
    let w = study
        .load()
        .unwrap_or_else(|e| panic!("{}", e.render(false)));
    let overs = |name: &str| -> Vec<String> {
        step(&w, name)
            .dimensions
            .iter()
            .map(|d| d.over.clone())
            .collect()
    };
    assert_eq!(overs("inner"), ["zones"]);
    assert_eq!(overs("leaf"), ["zones", "inner"]);
    assert_eq!(overs("pair"), ["zones", "others"]);
    let names: Vec<&str> = w.steps.iter().map(|s| s.name.as_str()).collect();
    // Of the steps that are ready, the first in the file goes first.
    assert_eq!(
        names,
        [
            "coarse",
            "defects",
            "others",
            "zones",
            "pair",
            "fine",
            "fine-defects",
            "inner",
            "leaf"
        ]
    );
}

#[test]
fn expectations_are_in_si() {
    let (_study, w) = sound();
    assert_eq!(w.expectations.len(), 3);
    let wrinkle = &w.expectations[2];
    assert_eq!(
        (wrinkle.value, wrinkle.tolerance),
        (Some(0.068), Some(0.007))
    );
    assert_eq!(w.expectations[0].minimum, Some(1.0));
    assert_eq!(w.expectations[0].source.as_deref(), Some("thesis 5.5.2"));
}

#[test]
fn reformatted_yaml_resolves_to_the_same_value() {
    let (study, w) = sound();
    // Flow style, other order, other units, quotes, comments, an anchor: the same meaning.
    study.mutate("workflow.yaml", "      element: m4\n      element_size: 8 mm\n", "      element_size: '0.8 cm'   # the same\n      element: {with: {hourglass: 0.050}, plugin: m4}\n");
    study.mutate(
        "workflow.yaml",
        "      damping: 0.1\n",
        "      damping: 1e-1\n",
    );
    study.mutate("workflow.yaml", "      over_shear_positive: 8 deg\n", "");
    study.mutate(
        "scene.yaml",
        "name: spar\n",
        "description: |\n  Prose\n  only.\nname: 'spar'\n",
    );
    study.mutate("scene.yaml", "length: 620 mm", "length: 0.62 m");
    study.mutate("scene.yaml", "bag_pressure: 1 bar", "bag_pressure: 1e5 Pa");
    study.mutate(
        "scene.yaml",
        "fabric_diaphragm: 0.40",
        "fabric_diaphragm: 0.4",
    );
    study.mutate(
        "materials/fabric.yaml",
        "source: thesis 3.2\n",
        "source: elsewhere\n",
    );
    study.mutate("materials/fabric.yaml", "  shear: 112.19 N/m\n", "");
    study.mutate("materials/fabric.yaml", "440 g/m2", "0.44 kg/m^2");
    let again = study
        .load()
        .unwrap_or_else(|e| panic!("{}", e.render(false)));
    let text = |w: &ResolvedWorkflow| serde_json::to_string(&w.steps).unwrap();
    assert_eq!(text(&w), text(&again));
}

#[test]
fn a_changed_value_changes_only_the_step_that_uses_it() {
    let (study, w) = sound();
    study.mutate("workflow.yaml", "8 deg", "9 deg");
    let again = study.load().unwrap();
    let changed: Vec<&str> = w
        .steps
        .iter()
        .zip(&again.steps)
        .filter(|(a, b)| a != b)
        .map(|(a, _)| a.name.as_str())
        .collect();
    assert_eq!(changed, ["defects"]);
}

#[test]
fn files_of_a_scene_are_absolute_and_hashed() {
    let study = Study::sound();
    study.write("tool.stl", "solid\nendsolid\n");
    let scene = study.read("scene.yaml");
    let (start, end) = (
        scene.find("  joggle_spar:").unwrap(),
        scene.find("sheets:").unwrap(),
    );
    let stl = "  stl: {file: ./materials/../tool.stl, unit: 1 mm}\n";
    study.write(
        "scene.yaml",
        &format!("{}{stl}{}", &scene[..start], &scene[end..]),
    );
    let w = study
        .load()
        .unwrap_or_else(|e| panic!("{}", e.render(false)));
    let coarse = step(&w, "coarse");
    assert_eq!(coarse.files.len(), 1);
    assert_eq!(coarse.files[0].pointer, "/scene/tool/stl/file");
    assert_eq!(coarse.files[0].path, study.path("tool.stl"));
    assert_eq!(
        coarse.files[0].hash,
        blake3::hash(b"solid\nendsolid\n").to_hex().to_string()
    );
    assert_eq!(
        coarse.parameters["scene"]["tool"]["stl"]["file"],
        json!(study.path("tool.stl"))
    );
}

#[test]
fn files_of_the_parts_of_a_stamping_are_absolute_and_hashed() {
    let study = Study::sound();
    study.write("die.stl", "solid\nendsolid\n");
    let scene = study.read("scene.yaml");
    let at = |word: &str| scene.find(word).unwrap();
    let ply = &scene[at("  - name: ply-1")..at("  - name: upper-film")];
    let stamping = "process:\n  stamping:\n    forming_time: 20 ms\n    settling_time: 5 ms\n    parts:\n      - name: die\n        side: above\n        \
                    tool: {stl: {file: ./materials/../die.stl, unit: 1 mm}}\n        motion: {table: [{time: 0 ms, way: 9 mm}, {time: 20 ms, way: 0 mm}]}\n";
    let head = &scene[..at("sheets:")];
    let friction = "friction: {tool_fabric: 0.2}\n";
    study.write(
        "scene.yaml",
        &format!("{head}sheets:\n{ply}{friction}{stamping}"),
    );
    let w = study
        .load()
        .unwrap_or_else(|e| panic!("{}", e.render(false)));
    let coarse = step(&w, "coarse");
    let pointer = "/scene/process/stamping/parts/0/tool/stl/file";
    assert_eq!(coarse.files.len(), 1);
    assert_eq!(coarse.files[0].pointer, pointer);
    assert_eq!(coarse.files[0].path, study.path("die.stl"));
    let parameters = json!(coarse.parameters);
    assert_eq!(
        parameters.pointer(pointer),
        Some(&json!(study.path("die.stl")))
    );
}

#[test]
fn a_scene_and_its_materials_may_stand_in_the_workflow() {
    let study = Study::sound();
    let indent = |text: &str, by: usize| -> String {
        text.lines()
            .map(|l| format!("{}{l}\n", " ".repeat(by)))
            .collect()
    };
    let film = format!("material:\n{}", indent(common::FILM, 6));
    let scene = common::SCENE.replace("material: film.yaml\n", &film);
    study.mutate(
        "workflow.yaml",
        "      scene: scene.yaml\n",
        &format!("      scene:\n{}", indent(&scene, 8)),
    );
    let w = study
        .load()
        .unwrap_or_else(|e| panic!("{}", e.render(false)));
    assert_eq!(
        step(&w, "coarse").parameters["scene"],
        step(&w, "local").parameters["scene"]
    );
}

#[test]
fn a_sheet_may_replace_parameters_of_its_material() {
    let study = Study::sound();
    study.mutate(
        "scene.yaml",
        "material: materials/fabric.yaml",
        "material: {file: materials/fabric.yaml, with: {fibre_modulus: 30 MPa, shear: null}}",
    );
    let w = study
        .load()
        .unwrap_or_else(|e| panic!("{}", e.render(false)));
    let ply = &step(&w, "coarse").parameters["scene"]["sheets"][1];
    assert_eq!(ply["material"]["with"], json!({"fibre_modulus": 3e7}));
    assert_eq!(ply["material"]["thickness"], json!("0.0004 m"));

    for (given, wanted) in [
        ("{file: materials/fabric.yaml, wiht: {}}", "wiht"),
        ("{file: 3}", "`file` is"),
        (
            "{file: materials/fabric.yaml, with: {sheer: 1 N/m}}",
            "no parameter of `material-fabric`",
        ),
        ("{with: {shear: 1 N/m}}", "`file` is missing"),
    ] {
        let study = Study::sound();
        study.mutate(
            "scene.yaml",
            "material: materials/fabric.yaml",
            &format!("material: {given}"),
        );
        let text = study.load().expect_err(given).render(false);
        assert!(text.contains(wanted), "{given}: {text}");
        // Both steps read the scene: a mistake in it is said once.
        assert!(text.contains("\n1 error"), "{text}");
    }
}

#[test]
fn further_plugin_folders_are_absolute() {
    let study = Study::sound();
    study.mutate("workflow.yaml", "steps:", "plugins: [./materials]\nsteps:");
    study.load().unwrap();
    let folders = plyflow_workflow::plugin_search_folders(&study.path("workflow.yaml"));
    assert_eq!(folders, [study.path("materials")]);
}

#[test]
fn graphs_name_every_step_and_wire() {
    let (_study, w) = sound();
    let dot = plyflow_workflow::to_dot(&w);
    assert!(
        dot.contains("\"coarse\" -> \"defects\" [label=\"formed\"];"),
        "{dot}"
    );
    assert!(
        dot.contains("\"zones\" -> \"local\" [style=dashed];"),
        "{dot}"
    );
    assert!(
        dot.contains("local x N (from zones)\\nforming-explicit"),
        "{dot}"
    );
    let mermaid = plyflow_workflow::to_mermaid(&w);
    assert!(mermaid.contains("s0 -->|\"formed\"| s1"), "{mermaid}");
    assert_eq!(plyflow_workflow::graph(&w).node_count(), 6);
}

#[test]
fn line_ends_and_a_byte_order_mark_of_windows_change_nothing() {
    let (study, w) = sound();
    for name in [
        "workflow.yaml",
        "scene.yaml",
        "materials/fabric.yaml",
        "film.yaml",
    ] {
        study.write(
            name,
            &format!("\u{feff}{}", study.read(name).replace('\n', "\r\n")),
        );
    }
    let again = study
        .load()
        .unwrap_or_else(|e| panic!("{}", e.render(false)));
    assert_eq!(w.steps, again.steps);
    // Places are right, too.
    let line = study.mutate("scene.yaml", "620 mm", "620");
    let found = study.load().unwrap_err();
    assert_eq!(
        (found.items[0].line, found.items[0].column),
        (line, 13),
        "{}",
        found.render(false)
    );
}

/// A catalog in which the fabric is not on the search path, only under the folder of the materials.
struct Own(common::Fake);

impl plyflow_workflow::Catalog for Own {
    fn find(
        &self,
        name: &str,
        relative_to: &camino::Utf8Path,
    ) -> Result<plyflow_workflow::CatalogEntry, plyflow_workflow::CatalogError> {
        let in_place = relative_to.ends_with("materials") && name == "./mine/material-fabric";
        if name.contains("material-fabric") && !in_place {
            let (name, searched) = (name.to_owned(), vec![relative_to.to_owned()]);
            return Err(plyflow_workflow::CatalogError::NotFound { name, searched });
        }
        self.0.find(name, relative_to)
    }

    fn names(&self, kind: plyflow_model::manifest::PluginKind) -> Vec<String> {
        self.0.names(kind)
    }
}

#[test]
fn a_material_whose_plugin_is_named_by_a_path_from_its_file_may_be_varied_too() {
    let study = Study::sound();
    study.mutate(
        "materials/fabric.yaml",
        "plugin: material-fabric",
        "plugin: ./mine/material-fabric",
    );
    let with = "material: {file: materials/fabric.yaml, with: {fibre_modulus: 30 MPa}}";
    study.mutate("scene.yaml", "material: materials/fabric.yaml", with);
    let path = study.path("workflow.yaml");
    let w = plyflow_workflow::load_with(&path, &Own(common::catalog()), &[])
        .unwrap_or_else(|e| panic!("{}", e.render(false)));
    let ply = &step(&w, "coarse").parameters["scene"]["sheets"][1];
    assert_eq!(ply["material"]["with"]["fibre_modulus"], json!(3e7));
}

#[test]
fn a_plugin_that_many_steps_name_is_missed_once_with_the_place_of_each() {
    let study = Study::sound();
    let steps: String = (0..9)
        .map(|i| format!("  s{i}: {{plugin: {}}}\n", ["nowhere", "not-there"][i % 2]))
        .collect();
    let text = format!("plyflow: 1\nname: lost\nsteps:\n{steps}");
    std::fs::write(study.path("workflow.yaml"), text).unwrap();
    let found = study.load().unwrap_err();
    let [a, b] = &found.items[..] else {
        panic!("{}", found.render(false));
    };
    assert_eq!((a.line, a.column, b.line), (4, 16, 5));
    assert!(
        a.message
            .ends_with("(wanted by the steps `s0`, `s2` at 6:16, `s4` at 8:16, `s6` at 10:16 and `s8` at 12:16)"),
        "{}",
        a.message
    );
    let also: Vec<_> = b.also.iter().map(|p| (p.line, p.step.as_deref())).collect();
    assert_eq!(also, [(7, Some("s3")), (9, Some("s5")), (11, Some("s7"))]);
    let folders = |d: &plyflow_workflow::Diagnostic| d.help.as_ref().unwrap().contains("/plugins");
    assert_eq!((folders(a), folders(b)), (true, false));
}

#[test]
fn a_file_that_several_steps_read_is_missed_once() {
    let study = Study::sound();
    let step = "{plugin: forming-explicit, with: {scene: lost.yaml, element: m4}}";
    let text = format!("plyflow: 1\nname: lost\nsteps:\n  a: {step}\n  b: {step}\n");
    std::fs::write(study.path("workflow.yaml"), text).unwrap();
    let found = study.load().unwrap_err();
    let missed = |d: &&plyflow_workflow::Diagnostic| d.message.contains("lost.yaml");
    assert_eq!(
        found.items.iter().filter(missed).count(),
        1,
        "{}",
        found.render(false)
    );
}

#[test]
fn a_step_that_counts_twice_in_a_mean_is_refused() {
    let study = Study::sound();
    let mean = |steps: &str| {
        let of = format!("step: {steps}, result: kinetic_ratio, of: mean, maximum: 0.05");
        format!("expect:\n  - {{{of}}}\n")
    };
    study.mutate("workflow.yaml", "expect:\n", &mean("[coarse, coarse]"));
    let told = study.load().unwrap_err().to_string();
    assert!(told.contains("`coarse` counts twice in the mean"), "{told}");
}
