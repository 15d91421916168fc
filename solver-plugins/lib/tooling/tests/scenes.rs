//! The scenes and materials of the repository.

use plyflow_model::material::{Material, MaterialEntry};
use plyflow_model::rules::{self, known::Known};
use plyflow_model::scene::{Process, Scene, SheetKind, Tool};
use std::path::{Path, PathBuf};

fn workflows() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../workflows")
}

fn parse<T: serde::de::DeserializeOwned>(path: &Path) -> T {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    serde_saphyr::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn scene(path: &Path) -> Scene {
    Scene::from_json(parse(path)).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn scenes() -> Vec<(PathBuf, Scene)> {
    let mut folders: Vec<PathBuf> = std::fs::read_dir(workflows())
        .unwrap()
        .map(|e| e.unwrap().path())
        .collect();
    folders.sort();
    let files: Vec<PathBuf> = folders
        .iter()
        .map(|f| f.join("scene.yaml"))
        .filter(|f| f.is_file())
        .collect();
    files.into_iter().map(|f| (f.clone(), scene(&f))).collect()
}

#[test]
fn every_scene_has_a_closed_tool_under_its_plies_and_materials_that_parse() {
    // A tool that a step makes is there once that has run.
    let is_known = |(_, scene): &(_, Scene)| !matches!(scene.tool, Tool::Input(_));
    let scenes: Vec<(PathBuf, Scene)> = scenes().into_iter().filter(is_known).collect();
    assert!(scenes.len() >= 2, "found {} scenes", scenes.len());
    for (path, scene) in scenes {
        let folder = path.parent().unwrap();
        let mesh = plyflow_tooling::build_from(&scene.tool, folder).unwrap();
        assert!(
            mesh.is_watertight() && mesh.volume() > 0.0,
            "{}",
            path.display()
        );
        let [low, high] = mesh.bounds();
        assert!(
            low[2].abs() < 1e-9,
            "{}: the tool stands on the bed",
            path.display()
        );
        for sheet in &scene.sheets {
            let MaterialEntry::File(file) = &sheet.material else {
                continue;
            };
            let material: Material = parse(&folder.join(file));
            assert!(material.thickness.si() > 0.0 && material.areal_mass.si() > 0.0);
            // Between rigid parts a holder carries what the tool does not.
            let is_bag = matches!(scene.process, Process::DoubleDiaphragm(_));
            if sheet.kind == SheetKind::Ply && is_bag {
                let length = sheet.length.expect("a ply has a length").si();
                assert!(
                    length < high[0] - low[0],
                    "{}: {}",
                    path.display(),
                    sheet.name
                );
            }
        }
    }
}

#[test]
fn every_material_file_parses_and_states_its_source() {
    let mut count = 0;
    for entry in std::fs::read_dir(workflows().join("materials")).unwrap() {
        let path = entry.unwrap().path();
        let material: Material = parse(&path);
        assert!(material.source.is_some(), "{}", path.display());
        count += 1;
    }
    assert!(count >= 3);
}

#[test]
fn preform_of_the_joggle_spar_ends_above_the_bed() {
    // Thesis 5.3.1: the depth of the preform is less than that of the tool. Arc length along the section
    // where the tool is lowest, from the blank's edge to the bed.
    let path = workflows().join("joggle-spar/scene.yaml");
    let scene = scene(&path);
    let mesh = plyflow_tooling::build(&scene.tool).unwrap();
    let x = -0.2003;
    let mut arc = 0.0;
    for t in 0..mesh.triangles.len() {
        let corners = mesh.corners(t);
        let cut: Vec<[f64; 2]> = (0..3)
            .filter_map(|k| {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                let (da, db) = (a[0] - x, b[0] - x);
                (da * db < 0.0).then(|| {
                    let w = da / (da - db);
                    [a[1] + w * (b[1] - a[1]), a[2] + w * (b[2] - a[2])]
                })
            })
            .collect();
        if let [p, q] = cut[..]
            && p[1].max(q[1]) > 1e-9
        {
            arc += (p[0] - q[0]).hypot(p[1] - q[1]);
        }
    }
    let width = scene.sheets[1].width.unwrap().si();
    let left = 0.5 * (arc - width);
    assert!(
        left > 0.012 && left < 0.04,
        "{:.1} mm of wall stay free on each side",
        left * 1e3
    );
    println!("{:.1} mm of wall stay free on each side", left * 1e3);
}

#[test]
fn every_scene_keeps_all_rules_that_its_words_can_tell() {
    for (path, scene) in scenes() {
        let faults = rules::faults(&Known::from(&scene));
        assert_eq!(faults, [], "{}", path.display());
    }
}
