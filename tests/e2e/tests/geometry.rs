//! A tool and an outline that a step makes, in the place of a file and of listed points.

use plyflow_e2e::{Study, repository, well};
use plyflow_model::scene::Tool;
use std::process::Command;

/// What stands for the tool and for the outlines of the plies.
struct Words {
    tool: &'static str,
    outline: &'static str,
}

const LISTED: Words = Words {
    tool: "{stl: {file: tool.stl, unit: 1 mm}}",
    outline: "outline: [[-60 mm, -50 mm], [60 mm, -50 mm], [60 mm, 50 mm], [-60 mm, 50 mm]], \
              holes: [[[-20 mm, -10 mm], [-20 mm, 10 mm], [20 mm, 10 mm], [20 mm, -10 mm]]]",
};

const MADE: Words = Words {
    tool: "{input: {body: hat}}",
    outline: "outline: {input: blank}",
};

fn scene(words: &Words) -> String {
    let materials = repository().join("workflows/materials");
    let materials = materials.to_str().expect("a UTF-8 path");
    let (tool, outline) = (words.tool, words.outline);
    format!(
        "
plyflow_scene: 1
name: small
tool: {tool}
sheets:
  - {{name: lower_film, kind: diaphragm, material: {materials}/stretchlon-ht350.yaml}}
  - {{name: ply_1, kind: ply, material: {materials}/ncf-fcim359.yaml, {outline}, fibre_1: -45 deg, fibre_2: 45 deg}}
  - {{name: ply_2, kind: ply, material: {materials}/ncf-fcim359.yaml, {outline}, centre: [5 mm, 0 mm], fibre_1: -45 deg, fibre_2: 45 deg}}
  - {{name: upper_film, kind: diaphragm, material: {materials}/stretchlon-ht350.yaml}}
friction: {{tool_diaphragm: 0.5, fabric_diaphragm: 0.4, fabric_fabric: 0.35, diaphragm_diaphragm: 0.3}}
process:
  double_diaphragm:
    frame_length: 600 mm
    frame_width: 560 mm
    bag_pressure: 20 kPa
    forming_pressure: 20 kPa
    clearance: 5 mm
    bagging_time: 10 ms
    lowering_time: 20 ms
    drawing_time: 20 ms
    settling_time: 5 ms
    film_pre_stretch: 0.01
    film_joint_margin: 30 mm
"
    )
}

/// A chain of both kinds of forming, with a run of a zone. `cad`: the step that makes tool and outline, and the words that wire it.
fn chain(cad: [&str; 3]) -> String {
    let [step, only, beside] = cad;
    format!(
        "
steps:{step}
  net:
    plugin: forming-kinematic{only}
    with: {{scene: scene.yaml, element_size: 10 mm}}
  coarse:
    plugin: forming-explicit{only}
    with: {{scene: scene.yaml, element: m4, element_size: 20 mm, frames: 20, tool_grid: 5 mm}}
  defects: {{plugin: defect-detection, from: {{formed: coarse}}, with: {{distance_threshold: 20 mm}}}}
  zones: {{plugin: zone-extraction, from: {{defects: defects}}, with: {{boxes: [[-50 mm, -40 mm, -28 mm, 40 mm]]}}}}
  boundary:
    plugin: boundary-interpolation
    for_each: {{zone: zones}}
    from: {{formed: coarse, zones: zones}}
    with: {{element_size: 10 mm}}
  local:
    plugin: forming-explicit
    for_each: {{zone: zones}}
    from: {{boundary: boundary{beside}}}
    with: {{scene: scene.yaml, element: m4, frames: 20, tool_grid: 5 mm}}
  comparison: {{plugin: comparison, from: {{global: coarse, zones: zones, local: local}}}}
"
    )
}

const LIBRARY: &str = "\n  cad: {plugin: ./libsurface.so, with: {stl: tool.stl}}";
const WIRED: [&str; 3] = [LIBRARY, "\n    from: {geometry: cad}", ", geometry: cad"];

/// A study with the file of a tool and the step that reads it.
fn study(workflow: &str, words: &Words) -> Study {
    let study = Study::new(workflow);
    let tool = r#"{"flat": {"length": "260 mm", "width": "220 mm", "height": "20 mm", "fillet": "10 mm", "facet_size": "10 mm"}}"#;
    let tool: Tool = serde_json::from_str(tool).unwrap();
    let mesh = plyflow_tooling::build(&tool).unwrap();
    let facets: Vec<[[f64; 3]; 3]> = (0..mesh.triangles.len())
        .map(|t| mesh.corners(t).map(|p| p.map(|c| 1e3 * c)))
        .collect();
    std::fs::write(study.path("tool.stl"), plyflow_files::stl::write(&facets)).unwrap();
    std::fs::write(study.path("scene.yaml"), scene(words)).unwrap();
    let built = Command::new(std::env::var_os("CC").unwrap_or_else(|| "cc".into()))
        .args([
            "-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared", "-I",
        ])
        .arg(repository().join("schemas/abi"))
        .arg("-o")
        .arg(study.path("libsurface.so"))
        .arg(repository().join("tests/e2e/plugins/surface.c"))
        .status()
        .expect("a C compiler");
    assert!(built.success());
    study
}

#[test]
fn a_tool_and_outlines_of_a_step_form_as_the_file_and_the_points_they_come_from_bit_by_bit() {
    let listed = study(&chain(["", "", ""]), &LISTED);
    let made = study(&chain(WIRED), &MADE);
    assert_eq!(listed.run(&[]), well(7, 0));
    assert_eq!(made.run(&[]), well(8, 0));
    let other = made.path("workflow.yaml");
    for step in [
        "net",
        "coarse",
        "defects",
        "zones",
        "boundary",
        "local",
        "comparison",
    ] {
        let words = [
            "diff",
            other.to_str().unwrap(),
            "--format",
            "json",
            "--step",
            step,
        ];
        let told = listed.call(&words);
        let told: serde_json::Value = serde_json::from_slice(&told.stdout).unwrap();
        let compared = told["compared"].as_array().unwrap();
        assert!(!compared.is_empty(), "{step}: {told}");
        for one in compared {
            assert_eq!(one["status"], "same", "{step}: {one}");
        }
    }
    assert_eq!(made.run(&[]), well(0, 8));
    // Another tool is another input of the steps that take it, and of what follows.
    let mut bytes = std::fs::read(made.path("tool.stl")).unwrap();
    bytes[0] ^= 1;
    std::fs::write(made.path("tool.stl"), &bytes).unwrap();
    assert_eq!(made.run(&[]).code, Some(0));
    assert_eq!(
        made.values("local", "cycles"),
        listed.values("local", "cycles")
    );
    limits_are_judged_and_run_nothing_again(&listed);
}

/// Of a study that has run: limits that are written afterwards.
fn limits_are_judged_and_run_nothing_again(study: &Study) {
    let with = |limits: &str| study.write(&(chain(["", "", ""]) + "limits:" + limits));
    let code = || study.call(&["results", "--check"]).status.code();
    with(" {shear: 90 deg, fibre_strain: 1}\n");
    assert_eq!(study.run(&["--check"]), well(0, 7));
    assert_eq!(code(), Some(0));
    // The elements of the zone are membranes, and no fold of theirs is a wrinkle.
    with(
        " {wrinkle_height: 1 m, places: [{ply: ply_1, rectangle: {length: 50 mm, width: 60 mm}, shear: 0 deg}]}\n",
    );
    let ended = study.run(&["--check"]);
    assert_eq!((ended.code, ended.executed), (Some(5), 0));
    assert_eq!(code(), Some(5));
    let results = study.results();
    let verdict = |limit: &str| {
        let mut all = results["limits"].as_array().unwrap().iter();
        let found = all.find(|l| l["limit"] == limit).unwrap();
        (
            found["verdict"].clone(),
            found["place"].clone(),
            found["by"].clone(),
        )
    };
    let (height, place, _) = verdict("wrinkle_height");
    assert_eq!(
        (height.as_str(), place.as_str()),
        (Some("not judged"), None)
    );
    let (shear, place, by) = verdict("shear");
    assert_eq!(
        (shear.as_str(), place.as_str()),
        (Some("beyond"), Some("a rectangle of ply_1"))
    );
    assert_eq!(by, "1 fine run in its zone; coarse elsewhere");
    with(" {shear: 1 mm, places: [{ply: plie, shear: 1 deg}]}\n");
    let wrong = told(study, "plan");
    assert!(
        wrong.contains("workflow.yaml:") && wrong.contains("is a length"),
        "{wrong}"
    );
}

/// What `plyflow COMMAND` says of a study that cannot be run, or that warns.
fn told(study: &Study, command: &str) -> String {
    let output = study.call(&[command]);
    let text = |b: &[u8]| String::from_utf8(b.to_vec()).unwrap();
    text(&output.stdout) + &text(&output.stderr)
}

#[test]
fn what_a_scene_asks_for_and_nothing_gives_is_told_by_the_plan_at_its_word() {
    let study = study(&chain([LIBRARY, "", ""]), &MADE);
    let plan = told(&study, "plan");
    for says in [
        "scene.yaml:4:22",
        "the body `hat` is to come from another step, and step `net` does not wire its input `geometry`",
        "`from: {geometry: <step that gives `geometry`>}`",
        "the outline `blank` is to come from another step, and step `local`",
    ] {
        assert!(plan.contains(says), "{says}\n{plan}");
    }
}

#[test]
fn names_that_no_step_has_and_geometry_without_a_use_are_told_with_the_step() {
    let workflow = "
steps:
  cad: {plugin: ./libsurface.so, with: {stl: tool.stl}}
  net: {plugin: forming-kinematic, from: cad, with: {scene: scene.yaml, element_size: 10 mm}}
";
    let study = study(workflow, &MADE);
    let with = |from: &str, to: &str| {
        std::fs::write(study.path("scene.yaml"), scene(&MADE).replace(from, to)).unwrap();
        told(&study, "run")
    };
    let body = with("body: hat", "body: hut");
    let says = "scene.tool.input.body: no step that is wired to `geometry` has the body `hut`; expected a name of one of them: `cad` has hat";
    assert!(body.contains(says), "{body}");
    let outline = with("input: blank", "input: blanc");
    let says = "scene.sheets[1].outline.input: no step that is wired to `geometry` has the outline `blanc`; expected a name of one of them: `cad` has blank";
    assert!(outline.contains(says), "{outline}");
    let floats = with("body: hat", "body: hat, translate: [0 mm, 0 mm, 5 mm]");
    for says in [
        "scene.tool.input: the lowest point of body `hat` of step `cad` lies at z = 5.000 mm",
        "`translate: [0 mm, 0 mm, 0 mm]`",
    ] {
        assert!(floats.contains(says), "{says}\n{floats}");
    }
    std::fs::write(study.path("scene.yaml"), scene(&LISTED)).unwrap();
    let unused = told(&study, "run");
    let says = "geometry: step `cad` is wired to `geometry`, and no word of the scene asks for anything of it (`tool: {input: {body: hat}}`, \
                `outline: {input: blank}`)";
    assert!(unused.contains(says), "{unused}");
}
