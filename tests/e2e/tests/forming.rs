//! The whole chain of real plugins on a part small enough for seconds: coarse run, defects, zones, local
//! runs, comparison.

use plyflow_e2e::{Ended, Study, repository, wait_for, well, workers_of};

/// A flat block of 20 mm, two small plies, short phases: coarse enough that its numbers mean nothing.
const SCENE: &str = "
plyflow_scene: 1
name: small
tool: {flat: {length: 260 mm, width: 220 mm, height: 20 mm, fillet: 10 mm, facet_size: 10 mm}}
sheets:
  - {name: lower_film, kind: diaphragm, material: MATERIALS/stretchlon-ht350.yaml}
  - {name: ply_1, kind: ply, material: MATERIALS/ncf-fcim359.yaml, length: 120 mm, width: 100 mm, fibre_1: -45 deg, fibre_2: 45 deg}
  - {name: ply_2, kind: ply, material: MATERIALS/ncf-fcim359.yaml, length: 120 mm, width: 100 mm, fibre_1: -45 deg, fibre_2: 45 deg}
  - {name: upper_film, kind: diaphragm, material: MATERIALS/stretchlon-ht350.yaml}
friction: {tool_diaphragm: 0.5, fabric_diaphragm: 0.4, fabric_fabric: 0.35, diaphragm_diaphragm: 0.3}
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
";

/// `boxes`: zones drawn by hand, so that there is something to run locally.
fn chain(boxes: &str) -> String {
    format!(
        "
steps:
  coarse:
    plugin: forming-explicit
    with: {{scene: scene.yaml, element: m4, element_size: 20 mm, frames: 20, tool_grid: 5 mm}}
  defects: {{plugin: defect-detection, from: {{formed: coarse}}, with: {{distance_threshold: 20 mm}}}}
  zones: {{plugin: zone-extraction, from: {{defects: defects}}, with: {{boxes: {boxes}}}}}
  boundary:
    plugin: boundary-interpolation
    for_each: {{zone: zones}}
    from: {{formed: coarse, zones: zones}}
    with: {{element_size: 10 mm}}
  local:
    plugin: forming-explicit
    for_each: {{zone: zones}}
    from: {{boundary: boundary}}
    with: {{scene: scene.yaml, element: rf4, frames: 20, tool_grid: 5 mm}}
  comparison: {{plugin: comparison, from: {{global: coarse, zones: zones, local: local}}}}
"
    )
}

const TWO_ZONES: &str = "[[-60 mm, -50 mm, 0 mm, 50 mm], [10 mm, -50 mm, 60 mm, 50 mm]]";

fn study(boxes: &str) -> Study {
    let study = Study::new(&chain(boxes));
    let materials = repository().join("workflows/materials");
    let scene = SCENE.replace("MATERIALS", materials.to_str().expect("a UTF-8 path"));
    std::fs::write(study.path("scene.yaml"), scene).expect("a scene");
    study
}

#[test]
fn without_defects_there_are_no_zones_and_no_local_runs_and_the_rest_ends_well() {
    let study = study("[]");
    assert_eq!(study.run(&[]), well(4, 0));
    assert_eq!(study.values("zones", "zone_count"), [0.0]);
    assert!(study.values("local", "cycles").is_empty());
    assert!(study.values("coarse", "cycles")[0] > 0.0);
    // Contacts of a bag take a part of the time, whatever the machine.
    let parts = ["contact", "element", "node", "load"];
    let shares = parts.map(|part| study.values("coarse", &format!("{part}_share"))[0]);
    let all: f64 = shares.iter().sum();
    assert!(
        shares.iter().all(|s| *s > 0.0) && all > 0.5 && all <= 1.0,
        "{shares:?}"
    );
    assert_eq!(study.run(&[]), well(0, 4));
}

#[test]
fn another_element_runs_only_the_local_runs_and_the_comparison() {
    let study = study(TWO_ZONES);
    assert_eq!(study.run(&[]), well(3 + 2 + 2 + 1, 0));
    assert_eq!(study.values("local", "cycles").len(), 2);
    study.write(&chain(TWO_ZONES).replace("element: rf4", "element: m4"));
    assert_eq!(study.run(&[]), well(2 + 1, 5));
    // A threshold of the detection that changes no flag still changes its key, and all that follows.
    study
        .write(&chain(TWO_ZONES).replace("distance_threshold: 20 mm", "distance_threshold: 21 mm"));
    let Ended { code, cached, .. } = study.run(&[]);
    assert_eq!((code, cached), (Some(0), 1), "only the coarse run is kept");
}

#[test]
fn the_whole_chain_has_the_same_bytes_with_one_and_with_two_cores() {
    let (one, two) = (study(TWO_ZONES), study(TWO_ZONES));
    assert_eq!(one.run(&["--jobs", "1"]), well(8, 0));
    assert_eq!(two.run(&["--jobs", "2"]), well(8, 0));
    let (one, two) = (one.artifacts(), two.artifacts());
    assert_eq!(one.len(), 8);
    assert!(one == two, "the artifacts differ");
}

#[test]
fn the_same_length_in_other_units_is_the_same_run() {
    let study = study("[]");
    assert_eq!(study.run(&[]), well(4, 0));
    study.write(
        &chain("[]")
            .replace("20 mm", "2.0 cm")
            .replace("5 mm", "0.005 m"),
    );
    assert_eq!(study.run(&[]), well(0, 4));
    let scene = study.path("scene.yaml");
    let text = std::fs::read_to_string(&scene).unwrap();
    std::fs::write(
        &scene,
        text.replace("20 kPa", "0.2 bar").replace("20 ms", "0.02 s"),
    )
    .unwrap();
    assert_eq!(study.run(&[]), well(0, 4));
}

/// Two zones cut through what hangs over the ends of a shorter block, 25 mm apart; both grow towards each other and become one.
#[test]
fn zones_whose_defects_reach_their_cuts_are_drawn_again_and_run_again() {
    let boxes = "[[-60 mm, -50 mm, 60 mm, 0 mm], [-60 mm, 20 mm, 60 mm, 50 mm]]";
    let study = study(boxes);
    let scene = study.path("scene.yaml");
    let text = std::fs::read_to_string(&scene).unwrap();
    std::fs::write(&scene, text.replace("length: 260 mm", "length: 80 mm")).unwrap();
    let (first, _) = chain(boxes)
        .split_once("  comparison:")
        .map(|(a, b)| (a.to_owned(), b.to_owned()))
        .unwrap();
    let measured = "{distance_threshold: 0.5 mm, minimum_bridging_area: 20 mm2, foot_margin: 0 mm}";
    study.write(&format!(
        "{first}
  drawn: {{plugin: comparison, from: {{global: coarse, zones: zones, local: local}}, with: &measured {measured}}}
  grown: {{plugin: zone-extraction, from: {{zones: zones, comparison: drawn}}}}
  boundary_grown:
    plugin: boundary-interpolation
    for_each: {{zone: grown}}
    from: {{formed: coarse, zones: grown}}
    with: {{element_size: 10 mm}}
  local_grown:
    plugin: forming-explicit
    for_each: {{zone: grown}}
    from: {{boundary: boundary_grown}}
    with: {{scene: scene.yaml, element: rf4, frames: 20, tool_grid: 5 mm}}
  comparison: {{plugin: comparison, from: {{global: coarse, zones: [zones, grown], local: [local, local_grown]}}, with: *measured}}
"
    ));
    assert!(study.start(&[]).wait().unwrap().success());
    let log = study.log();
    let at_a_cut = |step: &str| {
        let lines = log.lines().filter(|l| l.contains("reaches the cut"));
        lines
            .filter(|l| l.contains(&format!("\"step\":\"{step}\"")))
            .count()
    };
    // Both ends of both plies, in both zones.
    assert_eq!((at_a_cut("drawn"), at_a_cut("comparison")), (8, 0), "{log}");
    // The sides at y = 0 and at 20 mm go to 12.5 mm: one zone, all of the blank.
    assert_eq!(study.values("grown", "zone_count"), [1.0]);
    assert_eq!(study.values("grown", "ply_fraction"), [1.0]);
    assert_eq!(study.values("drawn", "zone_count"), [2.0]);
    assert_eq!(study.values("comparison", "zone_count"), [1.0]);
    assert!(study.values("comparison", "cost.superseded.cpu_seconds")[0] > 0.0);
    // Nothing is left to grow, and nothing runs again.
    assert_eq!(study.run(&[]), well(0, 12));
}

/// Checkpoints in the study's store: their instances.
fn checkpoints(study: &Study) -> Vec<String> {
    let folder = study.path(".plyflow/runs/study/checkpoints");
    let instances = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let has_state = |i: &std::fs::DirEntry| {
        let keys = std::fs::read_dir(i.path()).into_iter().flatten().flatten();
        // The note of what it has cost is the last that a checkpoint gets.
        let whole = |k: std::fs::DirEntry| {
            let file = |name: &str| k.path().join(name).exists();
            file("state") && file("plyflow-cost.json")
        };
        keys.into_iter().any(whole)
    };
    let with_state = instances.filter(has_state);
    with_state
        .map(|i| i.file_name().into_string().expect("a UTF-8 name"))
        .collect()
}

/// The two zones under pressures that follow tables, with weight: all that a process has to keep.
fn heavy_with_tables() -> Study {
    let study = study(TWO_ZONES);
    let scene = study.path("scene.yaml");
    let text = std::fs::read_to_string(&scene).unwrap();
    let table = "{table: [{share: 0, pressure: 0 kPa}, {share: 0.5, pressure: 0 kPa}, {share: 1, pressure: 20 kPa}]}";
    let changed = text
        .replace(
            "bag_pressure: 20 kPa",
            &format!("weight: tool\n    bag_pressure: {table}"),
        )
        .replace(
            "forming_pressure: 20 kPa",
            &format!("forming_pressure: {table}"),
        );
    assert_eq!(changed.matches("table").count(), 2);
    std::fs::write(&scene, changed).unwrap();
    study
}

#[test]
fn a_run_killed_while_it_forms_goes_on_from_its_checkpoint_to_the_same_bytes() {
    let undisturbed = heavy_with_tables();
    assert_eq!(undisturbed.run(&[]), well(8, 0));
    assert!(checkpoints(&undisturbed).is_empty(), "an hour is not over");

    let study = heavy_with_tables();
    let often = ["--checkpoint-every", "0 s", "--jobs", "1"];
    for instance in ["coarse", "local"] {
        let mut engine = study.start(&often);
        wait_for("a checkpoint", || {
            checkpoints(&study).iter().any(|i| i.starts_with(instance))
        });
        engine.kill().unwrap();
        engine.wait().unwrap();
        wait_for("the workers' end", || workers_of(engine.id()) == 0);
    }
    let left = checkpoints(&study);
    assert!(left.iter().any(|i| i.starts_with("local")), "{left:?}");
    let plan = String::from_utf8(study.call(&["plan"]).stdout).unwrap();
    assert!(plan.contains("goes on from a checkpoint, "), "{plan}");
    let mut engine = study.start(&often);
    assert!(engine.wait().unwrap().success());
    assert!(
        study.log().contains("goes on from a checkpoint at t = "),
        "{}",
        study.log()
    );
    assert!(
        undisturbed.artifacts() == study.artifacts(),
        "the artifacts differ"
    );
    assert!(
        checkpoints(&study).is_empty(),
        "they are removed in the end"
    );
    // What earlier attempts cost is counted, and no wall time is negative or nothing.
    let spent = study.results();
    let steps = spent["steps"].as_array().unwrap();
    assert!(
        steps
            .iter()
            .all(|s| s["cost"]["wall_seconds"].as_f64() > Some(0.0))
    );
}

#[test]
fn two_attempts_at_a_step_in_one_folder_of_checkpoints_leave_one_that_goes_on_to_the_same_bytes() {
    let undisturbed = heavy_with_tables();
    let only = ["--until", "coarse"];
    assert_eq!(undisturbed.run(&only), well(1, 0));

    // As on a cluster whose network has parted: the attempt that was given up runs on beside its successor, and both write checkpoints.
    let (given_up, study) = (heavy_with_tables(), heavy_with_tables());
    let runs = ".plyflow/runs/study";
    std::fs::create_dir_all(study.path(runs).join("checkpoints")).unwrap();
    std::fs::create_dir_all(given_up.path(runs)).unwrap();
    let shared = given_up.path(runs).join("checkpoints");
    std::os::unix::fs::symlink(study.path(runs).join("checkpoints"), shared).unwrap();
    let often = ["--until", "coarse", "--checkpoint-every", "0 s"];
    let mut engines = [given_up.start(&often), study.start(&often)];
    wait_for("a checkpoint", || !checkpoints(&study).is_empty());
    // Long enough for some hundreds of files to be written by each.
    std::thread::sleep(std::time::Duration::from_millis(300));
    for engine in &mut engines {
        engine.kill().unwrap();
        engine.wait().unwrap();
        wait_for("the workers' end", || workers_of(engine.id()) == 0);
    }
    for attempt in [&given_up, &study] {
        let log = attempt.log();
        assert!(!log.contains("no more checkpoints"), "{log}");
        assert!(!log.contains("begins anew"), "{log}");
    }
    assert_eq!(study.run(&only), well(1, 0));
    let said = std::fs::read_to_string(study.path(runs).join("logs/coarse.log")).unwrap();
    assert!(said.contains("goes on from a checkpoint at t = "), "{said}");
    assert!(undisturbed.artifacts() == study.artifacts());
}

/// The coarse run's zones, and one run of the whole `with` something, from `from`.
fn one_model(from: &str, with: &str) -> String {
    let chain = chain(TWO_ZONES);
    let zones = &chain[..chain.find("  boundary:").expect("a step")];
    format!(
        "{zones}  one_model:\n    plugin: forming-explicit\n    from: {{{from}}}\n    with: \
         {{scene: scene.yaml, element: rf4, {with} element_size: 10 mm, time_step: 4 us, frames: 20, tool_grid: 5 mm}}\n"
    )
}

#[test]
fn a_whole_that_bends_in_zones_goes_on_after_a_kill_to_the_same_bytes_on_another_number_of_cores() {
    let wanted = one_model("zones: zones", "element_elsewhere: m4,");
    let (undisturbed, killed) = (study("[]"), study("[]"));
    undisturbed.write(&wanted);
    assert_eq!(undisturbed.run(&["--jobs", "1"]), well(4, 0));
    killed.write(&wanted);
    let mut engine = killed.start(&["--checkpoint-every", "0 s", "--jobs", "1"]);
    let has = |i: &String| i.starts_with("one_model");
    wait_for("a checkpoint", || checkpoints(&killed).iter().any(has));
    engine.kill().unwrap();
    engine.wait().unwrap();
    wait_for("the workers' end", || workers_of(engine.id()) == 0);
    let mut engine = killed.start(&["--jobs", "2"]);
    assert!(engine.wait().unwrap().success());
    let log = killed.log();
    assert!(log.contains("goes on from a checkpoint at t = "), "{log}");
    assert!(undisturbed.artifacts() == killed.artifacts(), "they differ");
}

#[test]
fn zones_and_the_element_elsewhere_are_refused_without_each_other() {
    for (from, with, text) in [
        (
            "zones: zones",
            "",
            "zones: given 'zones', but no `element_elsewhere`",
        ),
        (
            "",
            "element_elsewhere: m4,",
            "element_elsewhere: given 'm4', but no `zones`",
        ),
    ] {
        let study = study("[]");
        study.write(&one_model(from, with));
        let mut engine = study.start(&[]);
        assert!(!engine.wait().unwrap().success());
        let log = study.log();
        assert!(log.contains(text), "{log}");
    }
}

#[test]
fn a_forced_run_begins_anew_and_goes_on_when_it_was_killed() {
    let study = study("[]");
    let often = ["--checkpoint-every", "0 s", "--until", "coarse"];
    assert!(study.start(&often).wait().unwrap().success());
    let undisturbed = study.artifacts();
    let forced = [&often[..], &["--force", "coarse"]].concat();
    let mut engine = study.start(&forced);
    wait_for("a checkpoint", || !checkpoints(&study).is_empty());
    engine.kill().unwrap();
    engine.wait().unwrap();
    wait_for("the workers' end", || workers_of(engine.id()) == 0);
    for goes_on in [true, false] {
        assert!(study.start(&forced).wait().unwrap().success());
        let log = study.log();
        assert_eq!(log.contains("goes on from a checkpoint"), goes_on, "{log}");
        assert!(study.artifacts() == undisturbed, "they differ");
    }
}

#[test]
fn a_stack_of_plies_of_different_outlines_is_run_and_written() {
    let study = study("[]");
    let scene = std::fs::read_to_string(study.path("scene.yaml")).unwrap();
    // The film reaches the upper ply beside the lower one.
    std::fs::write(
        study.path("scene.yaml"),
        scene.replacen("120 mm", "60 mm", 1),
    )
    .unwrap();
    assert_eq!(study.run(&["--until", "coarse"]), well(1, 0));
}

#[test]
fn the_boundary_of_another_scene_is_refused() {
    let study = study(TWO_ZONES);
    let scene = std::fs::read_to_string(study.path("scene.yaml")).unwrap();
    let turned = scene.replacen(
        "fibre_1: -45 deg, fibre_2: 45 deg",
        "fibre_1: 0 deg, fibre_2: 90 deg",
        1,
    );
    std::fs::write(study.path("other.yaml"), turned).unwrap();
    let local = "with: {scene: scene.yaml, element: rf4";
    study.write(&chain(TWO_ZONES).replace(local, &local.replace("scene.yaml", "other.yaml")));
    assert!(!study.start(&[]).wait().unwrap().success());
    let log = study.log();
    assert!(
        log.contains("fibre_1 of sheet 'ply_1' is 0.0000 deg, and -45.0000 deg"),
        "{log}"
    );
}

#[test]
fn a_torn_checkpoint_is_not_taken_up() {
    let study = study("[]");
    let often = ["--checkpoint-every", "0 s", "--until", "coarse"];
    let mut engine = study.start(&often);
    wait_for("a checkpoint", || !checkpoints(&study).is_empty());
    engine.kill().unwrap();
    engine.wait().unwrap();
    wait_for("the workers' end", || workers_of(engine.id()) == 0);
    let folder = study.path(".plyflow/runs/study/checkpoints/coarse");
    let key = std::fs::read_dir(folder).unwrap().flatten().next().unwrap();
    let state = key.path().join("state");
    let bytes = std::fs::read(&state).unwrap();
    std::fs::write(&state, &bytes[..bytes.len() / 2]).unwrap();
    let mut engine = study.start(&often);
    assert!(engine.wait().unwrap().success());
    assert!(!study.log().contains("goes on from a checkpoint"));
}

#[test]
fn confirming_adds_the_variants_keeps_what_was_run_and_goes_on_where_it_was_stopped() {
    let study = study(TWO_ZONES);
    let json = |words: &[&str]| -> serde_json::Value {
        let output = study.call(words);
        serde_json::from_slice(&output.stdout).expect("JSON")
    };
    let plan = ["plan", "--confirm", "--format", "json"];
    // Before anything has run nobody knows what it costs.
    assert!(json(&plan)["confirm"]["estimated_cpu_seconds"].is_null());
    assert_eq!(study.run(&[]), well(8, 0));
    let costs = &json(&plan)["confirm"];
    let told = costs["variants"].as_array().unwrap();
    let names: Vec<&str> = told
        .iter()
        .map(|v| v["variant"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["finer", "slower", "half_step", "wider"]);
    let (all, own) = (
        &costs["estimated_cpu_seconds"],
        &costs["workflow_cpu_seconds"],
    );
    assert!(
        all.as_f64().unwrap() > 0.0 && own.as_f64().unwrap() > 0.0,
        "{costs}"
    );
    // Two zones: boundaries and runs of two variants, the smaller step, and the wider zones with theirs; the step that follows.
    assert_eq!(study.run(&["--confirm=finer"]), well(2 + 2 + 1, 8));
    assert_eq!(study.run(&["--confirm"]), well(4 + 2 + 5 + 1, 12));
    assert_eq!(study.run(&["--confirm"]), well(0, 24));
    assert_eq!(study.run(&[]), well(0, 8), "its own steps are as before");
    let results = json(&["results", "--confirm", "--format", "json"]);
    let value = |step: &str, result: &str| -> Vec<f64> {
        let all = results["results"].as_array().unwrap().iter();
        let mine = all.filter(|r| r["step"] == step && r["result"] == result);
        mine.map(|r| r["value"].as_f64().unwrap()).collect()
    };
    let counts = ["defect_count", "stay_count", "hang_count", "gone_count"];
    let [all, stay, hang, gone] = counts.map(|name| value("confirm", name)[0]);
    assert_eq!(all, stay + hang + gone);
    let compared = ["wrinkle_count", "bridging_count"].map(|name| value("comparison", name)[0]);
    assert_eq!(all, compared[0] + compared[1]);
    // The slower process takes twice as many steps of the same size, the smaller step too; finer elements more of them.
    for zone in 0..2 {
        let of = |step: &str, result: &str| value(step, result)[zone];
        for step in ["local_slower", "local_half_step"] {
            let ratio = of(step, "cycles") / of("local", "cycles");
            assert!((1.8..2.3).contains(&ratio), "{step}: {ratio}");
        }
        assert!(of("local_finer", "elements") > 1.4 * of("local", "elements"));
        assert!(of("local_wider", "elements") >= of("local", "elements"));
    }
}
