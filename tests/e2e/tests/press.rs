//! Press runs that are killed: punch and holder go on from where they were, to the same bytes.

use plyflow_e2e::{Study, wait_for, well, workers_of};

/// Two plies of a fabric at 45 degrees through a round hole, 12 mm deep, between die and holder.
fn study(hold: &str) -> Study {
    study_of(
        hold,
        SQUARE,
        "
steps:
  press:
    plugin: forming-explicit
    with: {scene: scene.yaml, element: m4, element_size: 5 mm, frames: 24, tool_grid: 2 mm, contact_augmentation: 0}
",
    )
}

/// Shape of a ply of the scene.
const SQUARE: &str = "length: 120 mm, width: 120 mm";
/// The same with a hole under the holder.
const HOLED: &str = "outline: [[-60 mm, -60 mm], [60 mm, -60 mm], [60 mm, 60 mm], [-60 mm, 60 mm]], holes: [{circle: {centre: [-30 mm, -30 mm], radius: 12 mm}}]";

/// The same scene with these steps and a lower ply of this shape.
fn study_of(hold: &str, lower: &str, steps: &str) -> Study {
    let scene = format!(
        "
plyflow_scene: 1
name: dome
tool: {{hemisphere: {{radius: 25 mm, facet_size: 2 mm}}}}
sheets:
  - {{name: ply_1, kind: ply, {lower}, fibre_1: -45 deg, fibre_2: 45 deg, material: fabric.yaml}}
  - {{name: ply_2, kind: ply, length: 120 mm, width: 120 mm, fibre_1: -45 deg, fibre_2: 45 deg, material: fabric.yaml}}
friction: {{tool_fabric: 0.23, fabric_fabric: 0.36}}
process:
  press:
    stroke: 12 mm
    forming_time: 60 ms
    settling_time: 5 ms
    die: {{opening_radius: 27.5 mm, edge_radius: 4 mm}}
    holder: {{hold: {hold}}}
    weight: die
"
    );
    let fabric = "
plyflow_material: 1
name: soft fabric
plugin: material-fabric
thickness: 0.4 mm
areal_mass: 0.44 kg/m2
with:
  form: fibre-energy
  fibre_modulus: 3 GPa
  shear: {coefficients: [0 N/m, 100 N/m]}
";
    let study = Study::new(steps);
    std::fs::write(study.path("scene.yaml"), scene).expect("a scene");
    std::fs::write(study.path("fabric.yaml"), fabric).expect("a material");
    study
}

/// Frames that belong to the checkpoint in the study's store; none before there is one.
fn frames_kept(study: &Study) -> usize {
    let folder = study.path(".plyflow/runs/study/checkpoints/press");
    let keys = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let files = keys.flat_map(|k| std::fs::read_dir(k.path()).into_iter().flatten().flatten());
    let names: Vec<String> = files
        .map(|f| f.file_name().to_string_lossy().into_owned())
        .collect();
    let has_state = names.iter().any(|n| n == "state");
    let frame = |n: &&String| n.starts_with("frame-") && !n.ends_with(".new");
    if has_state {
        names.iter().filter(frame).count()
    } else {
        0
    }
}

fn killed_and_resumed(hold: &str) {
    let undisturbed = study(hold);
    assert_eq!(undisturbed.run(&["--jobs", "1"]), well(1, 0));
    let on_two = study(hold);
    assert_eq!(on_two.run(&["--jobs", "2"]), well(1, 0));
    assert!(
        undisturbed.artifacts() == on_two.artifacts(),
        "{hold}: two threads"
    );

    // Killed as the holder closes, and in the middle of the stroke; each attempt with another number of threads.
    let study = study(hold);
    for (frames, jobs) in [(3, "1"), (12, "2")] {
        let mut engine = study.start(&["--checkpoint-every", "0 s", "--jobs", jobs]);
        wait_for("a checkpoint", || frames_kept(&study) >= frames);
        engine.kill().unwrap();
        engine.wait().unwrap();
        wait_for("the workers' end", || workers_of(engine.id()) == 0);
        assert!(
            study.artifacts().is_empty(),
            "{hold}: it was over before it was killed"
        );
    }
    let mut engine = study.start(&["--jobs", "1"]);
    assert!(engine.wait().unwrap().success(), "{}", study.log());
    let log = study.log();
    assert!(log.contains("goes on from a checkpoint at t = "), "{log}");
    assert!(
        undisturbed.artifacts() == study.artifacts(),
        "{hold}: the artifacts differ"
    );
}

#[test]
fn a_press_with_a_holder_at_a_gap_goes_on_to_the_same_bytes() {
    killed_and_resumed("{gap: 1.2 mm}");
}

#[test]
fn a_press_with_a_holder_under_a_force_goes_on_to_the_same_bytes() {
    killed_and_resumed("{force: 200 N}");
}

/// A coarse run, a zone at a corner of the plies, across the hole of the lower one, and its fine run between punch, die and a holder that a force presses.
const WITH_ZONE: &str = "
steps:
  coarse:
    plugin: forming-explicit
    with: {scene: scene.yaml, element: m4, element_size: 10 mm, frames: 24, tool_grid: 2 mm, contact_augmentation: 0}
  defects: {plugin: defect-detection, from: {formed: coarse}}
  zones: {plugin: zone-extraction, from: {defects: defects}, with: {boxes: [[-60 mm, -60 mm, 10 mm, 20 mm]]}}
  boundary: {plugin: boundary-interpolation, for_each: {zone: zones}, from: {formed: coarse, zones: zones}, with: {element_size: 5 mm}}
  local:
    plugin: forming-explicit
    for_each: {zone: zones}
    from: {boundary: boundary}
    with: {scene: scene.yaml, element: m4, frames: 12, tool_grid: 2 mm, contact_augmentation: 0}
  comparison: {plugin: comparison, from: {global: coarse, zones: zones, local: local}}
";

#[test]
fn a_zone_across_a_hole_in_a_press_is_run_through_the_real_plugins_to_the_same_bytes_on_two_threads()
 {
    let one = study_of("{force: 200 N}", HOLED, WITH_ZONE);
    assert_eq!(one.run(&["--jobs", "1"]), well(6, 0));
    assert!(one.values("local", "cycles")[0] > 0.0);
    assert!(one.values("local", "drift_ratio")[0] < 0.02);
    // The upper ply has 14 x 16 elements in the zone; the lower one, with its hole, fewer or a row more.
    let elements = one.values("local", "elements")[0];
    assert!(
        elements > 1.8 * 14.0 * 16.0 && elements < 2.2 * 14.0 * 16.0,
        "{elements}"
    );
    let two = study_of("{force: 200 N}", HOLED, WITH_ZONE);
    assert_eq!(two.run(&["--jobs", "2"]), well(6, 0));
    assert!(one.artifacts() == two.artifacts());
}
