//! The step behind a host in memory.

use plyflow_forming_kinematic::FormingKinematic;
use plyflow_geometry::vec3::{distance, norm};
use plyflow_testing::{MemoryArtifact, run};
use plyflow_tooling::CHORD_TOLERANCE;
use serde_json::{Value, json};
use std::f64::consts::{FRAC_PI_2, TAU};

const FILM: f64 = 8e-5;
const PLY: f64 = 3e-4;

fn material(name: &str, thickness: f64) -> Value {
    json!({
        "plyflow_material": 1, "name": name, "plugin": "none", "thickness": format!("{thickness} m"),
        "areal_mass": "0.4 kg/m2", "with": {},
    })
}

/// A scene as the host hands it over: quantities in SI with their unit, materials read in.
fn scene(tool: Value, size: [f64; 2], fibres: [f64; 2]) -> Value {
    let film =
        |name: &str| json!({"name": name, "kind": "diaphragm", "material": material("film", FILM)});
    let ply = |name: &str| {
        json!({
            "name": name, "kind": "ply", "material": material("woven", PLY),
            "length": format!("{} m", size[0]), "width": format!("{} m", size[1]), "centre": ["0 m", "0 m"],
            "fibre_1": format!("{} deg", fibres[0]), "fibre_2": format!("{} deg", fibres[1]),
        })
    };
    json!({
        "plyflow_scene": 1, "name": "test", "tool": tool,
        "sheets": [film("lower"), ply("ply_1"), ply("ply_2"), film("upper")],
        "friction": {"tool_diaphragm": 0.5, "fabric_diaphragm": 0.4, "fabric_fabric": 0.3, "diaphragm_diaphragm": 0.3},
        "process": {"double_diaphragm": {
            "frame_length": "1 m", "frame_width": "1 m", "clearance": "0.005 m", "bag_pressure": "1e5 Pa",
            "forming_pressure": "1e5 Pa", "bagging_time": "0.1 s", "lowering_time": "0.1 s",
            "drawing_time": "0.1 s", "settling_time": "0.1 s", "film_joint_margin": "0.03 m",
        }},
    })
}

fn hemisphere() -> Value {
    json!({"hemisphere": {"radius": "0.05 m", "facet_size": "0.004 m"}})
}

fn drape(parameters: Value) -> Result<MemoryArtifact, String> {
    run::<FormingKinematic>(parameters, &[], &[])
}

fn on_hemisphere(side: f64, more: Value) -> Result<MemoryArtifact, String> {
    let mut with =
        json!({"scene": scene(hemisphere(), [side, side], [0.0, 90.0]), "element_size": 0.004});
    for (k, v) in more.as_object().into_iter().flatten() {
        with[k] = v.clone();
    }
    drape(with)
}

fn last(artifact: &MemoryArtifact, ply: &str) -> Vec<[f64; 3]> {
    artifact.body(ply).frames.last().expect("a frame").clone()
}

#[test]
fn plies_lie_at_their_place_in_the_stack() {
    let formed = on_hemisphere(0.08, json!({})).unwrap();
    assert_eq!(formed.result("coverage"), 1.0);
    assert_eq!(formed.result("unreachable_cells"), 0.0);
    assert_eq!(formed.result("elements"), 800.0);
    assert!(formed.result("fibre_strain_max") < 1e-12);
    for (name, offset) in [("ply_1", FILM + 0.5 * PLY), ("ply_2", FILM + 1.5 * PLY)] {
        for x in last(&formed, name) {
            assert!(
                (norm(x) - 0.05 - offset).abs() < 2e-8,
                "{name}: {}",
                norm(x) - 0.05
            );
        }
        let cells = formed.body(name).cells.chunks_exact(4);
        let points = last(&formed, name);
        for c in cells {
            // Counter-clockwise from outside.
            let p = [0, 1, 3].map(|k| points[c[k] as usize]);
            let [u, v] = [1, 2].map(|k| [0, 1, 2].map(|d| p[k][d] - p[0][d]));
            let n = [
                u[1] * v[2] - u[2] * v[1],
                u[2] * v[0] - u[0] * v[2],
                u[0] * v[1] - u[1] * v[0],
            ];
            assert!((0..3).map(|d| n[d] * p[0][d]).sum::<f64>() > 0.0);
        }
    }
    assert!(formed.attributes["warnings"].as_array().unwrap().is_empty());
    assert_eq!(formed.attributes["sheets"].as_array().unwrap().len(), 2);
}

#[test]
fn mesh_across_the_fibres_carries_the_shear_of_the_mesh_along_them() {
    // The same net, meshed along its fibres and at 45 degrees to them.
    let shear = |fibres: [f64; 2]| {
        let with =
            json!({"scene": scene(hemisphere(), [0.08, 0.08], fibres), "element_size": 0.002});
        let formed = drape(with).unwrap();
        let body = formed.body("ply_1");
        let centre = |c: &[u32]| {
            [0, 1].map(|d| c.iter().map(|n| body.points[*n as usize][d]).sum::<f64>() / 4.0)
        };
        body.cells
            .chunks_exact(4)
            .map(centre)
            .zip(body.last("shear_angle").to_vec())
            .collect::<Vec<_>>()
    };
    let along = shear([0.0, 90.0]);
    let across = shear([-45.0, 45.0]);
    let mut compared = 0;
    for (at, g) in &across {
        // In the axes of the fibres.
        let k = 0.5f64.sqrt();
        let (u, v) = (k * (at[0] - at[1]), k * (at[0] + at[1]));
        let four: Vec<_> = along
            .iter()
            .filter(|(p, _)| (p[0] - u).abs() < 0.002 && (p[1] - v).abs() < 0.002)
            .collect();
        if four.len() != 4 {
            continue;
        }
        let weight =
            |p: &[f64; 2]| (1.0 - (p[0] - u).abs() / 0.002) * (1.0 - (p[1] - v).abs() / 0.002);
        let expected: f64 = four.iter().map(|(p, g)| weight(p) * g).sum();
        assert!((g - expected).abs() < 2e-3, "{at:?}: {g} {expected}");
        compared += 1;
    }
    assert!(compared > 500, "{compared}");
}

#[test]
fn families_named_the_other_way_round_shear_the_same() {
    let shear = |fibres| {
        let formed = drape(json!({"scene": scene(hemisphere(), [0.08, 0.06], fibres)})).unwrap();
        formed.body("ply_1").last("shear_angle").to_vec()
    };
    let given = shear([-45.0, 45.0]);
    for other in [[45.0, -45.0], [135.0, 225.0], [-225.0, -135.0]] {
        for (a, b) in shear(other).iter().zip(&given) {
            assert!((a - b).abs() < 1e-9, "{other:?}: {a} {b}");
        }
    }
    assert!(given.iter().any(|g| g.abs() > 0.05));
}

#[test]
fn bytes_are_the_same_twice() {
    let twice = [0, 1].map(|_| on_hemisphere(0.11, json!({})).unwrap());
    let bits = |a: &MemoryArtifact| -> Vec<u64> {
        let points = a.bodies.iter().flat_map(|b| {
            b.frames
                .iter()
                .flatten()
                .flatten()
                .copied()
                .collect::<Vec<_>>()
        });
        points.map(f64::to_bits).collect()
    };
    assert_eq!(bits(&twice[0]), bits(&twice[1]));
    assert_eq!(twice[0].attributes, twice[1].attributes);
}

#[test]
fn under_a_single_film_the_lowest_ply_lies_on_the_tool_itself() {
    let mut scene = scene(hemisphere(), [0.06, 0.06], [0.0, 90.0]);
    scene["sheets"].as_array_mut().unwrap().remove(0);
    scene["friction"]["tool_fabric"] = json!(0.2);
    scene["process"] = json!({"single_diaphragm": {
        "frame_length": "1 m", "frame_width": "1 m", "clearance": "0.005 m", "forming_pressure": "1e5 Pa",
        "stretching_time": "0.1 s", "lowering_time": "0.1 s", "drawing_time": "0.1 s", "settling_time": "0.1 s",
    }});
    let bed = drape(json!({"scene": scene, "element_size": 0.004})).unwrap();
    assert_eq!(bed.attributes["without_bed"], Value::Null);
    for (name, offset) in [("ply_1", 0.5 * PLY), ("ply_2", 1.5 * PLY)] {
        for x in last(&bed, name) {
            assert!((norm(x) - 0.05 - offset).abs() < 2e-8, "{name}: {x:?}");
        }
    }
    scene["process"]["single_diaphragm"]["bed"] = json!(false);
    let none = drape(json!({"scene": scene, "element_size": 0.004})).unwrap();
    assert_eq!(none.attributes["without_bed"], json!(true));
}

#[test]
fn ply_that_reaches_the_bed_is_marked_there_and_draped_elsewhere() {
    let formed = on_hemisphere(0.18, json!({"locking_angle": 1.5})).unwrap();
    let coverage = formed.result("coverage");
    assert!(coverage > 0.3 && coverage < 0.9, "{coverage}");
    let body = formed.body("ply_1");
    let draped = body.last("draped");
    let missed = |name: &str| {
        let draped = formed.body(name).last("draped");
        draped.iter().filter(|d| **d < 0.5).count()
    };
    let all = missed("ply_1") + missed("ply_2");
    assert_eq!(formed.result("unreachable_cells"), all as f64);
    let points = last(&formed, "ply_1");
    for (cell, on) in body.cells.chunks_exact(4).zip(draped) {
        for n in cell {
            let x = points[*n as usize];
            assert!(x[2] >= FILM + 0.5 * PLY - 1e-9, "{x:?} lies in the bed");
            // The foot is a sharp edge of the tool, straight between its points: there the chord counts.
            let bound = if x[2] > 0.008 { 1e-7 } else { CHORD_TOLERANCE };
            let miss = (norm(x) - 0.05 - FILM - 0.5 * PLY).abs();
            assert!(*on < 0.5 || miss < bound, "{x:?} misses by {miss}");
        }
    }
    let text = formed.attributes["warnings"][0].as_str().unwrap();
    assert!(
        text.contains("ply 'ply_1'")
            && text.contains("machine bed")
            && text.contains("mm of the flat ply"),
        "{text}"
    );
    assert!(
        formed.log.iter().any(|l| l.contains("machine bed")),
        "{:?}",
        formed.log
    );
}

#[test]
fn cells_beyond_the_locking_angle_are_left_open_and_the_rest_is_draped() {
    let locking = 25f64.to_radians();
    let formed = on_hemisphere(0.096, json!({"locking_angle": locking})).unwrap();
    let free = on_hemisphere(0.096, json!({})).unwrap();
    assert_eq!(free.result("coverage"), 1.0);
    let coverage = formed.result("coverage");
    assert!(coverage > 0.5 && coverage < 0.95, "{coverage}");
    assert!(formed.result("shear_max") <= locking && formed.result("shear_max") > 0.9 * locking);
    let text = formed.attributes["warnings"][0].as_str().unwrap();
    assert!(text.contains("locking angle of 25.0 deg"), "{text}");
    // What is draped is draped as without the bound.
    let (a, b) = (formed.body("ply_1"), free.body("ply_1"));
    let (p, q) = (last(&formed, "ply_1"), last(&free, "ply_1"));
    for (cell, on) in a.cells.chunks_exact(4).zip(a.last("draped")) {
        for n in cell.iter().filter(|_| *on > 0.5) {
            assert!(distance(p[*n as usize], q[*n as usize]) < 1e-12);
        }
    }
    assert_eq!(a.cells, b.cells);
    // What is not has no shear, and says why.
    assert!(b.fields[0].iter().all(|f| f.name != "drape_stop"));
    let (draped, why) = (a.last("draped"), a.last("drape_stop"));
    for (c, on) in draped.iter().enumerate() {
        assert_eq!(why[c], if *on > 0.5 { 0.0 } else { 1.0 }, "cell {c}");
        assert!(*on > 0.5 || a.last("shear_angle")[c] == 0.0, "cell {c}");
    }
}

/// An STL file of blocks between these corners (mm).
fn blocks(all: &[[[f64; 3]; 2]]) -> tempfile::NamedTempFile {
    let mut text = String::new();
    for [low, high] in all {
        let corner = |k: usize| [0, 1, 2].map(|d| if k >> d & 1 == 1 { high[d] } else { low[d] });
        text += "solid block\n";
        for [a, b, c, d] in [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ] {
            for facet in [[a, b, c], [a, c, d]] {
                text += "facet normal 0 0 0\nouter loop\n";
                for [x, y, z] in facet.map(corner) {
                    text += &format!("vertex {x} {y} {z}\n");
                }
                text += "endloop\nendfacet\n";
            }
        }
        text += "endsolid block\n";
    }
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), text).unwrap();
    file
}

/// The same places, units and walls as in `forming-explicit`: a net hangs as happily over a speck, or over what floats.
#[test]
fn a_tool_is_held_to_the_checks_of_explicit_forming() {
    let block = [[-60.0, -40.0, 0.0], [60.0, 40.0, 20.0]];
    let over = |all: &[[[f64; 3]; 2]], unit: &str| {
        let file = blocks(all);
        let tool = json!({"stl": {"file": file.path().to_str().unwrap(), "unit": unit,
                                  "translate": ["0 m", "0 m", "0 m"]}});
        let with = json!({"scene": scene(tool, [0.06, 0.05], [0.0, 90.0]), "element_size": 0.005});
        drape(with).map(|formed| formed.result("coverage"))
    };
    assert_eq!(over(&[block], "1 mm"), Ok(1.0));
    // A bar through two towers that stand beside the ply, no corner of which is in another: it does not float.
    let tower = |y: f64| [[-8.0, y, 0.0], [8.0, y + 10.0, 60.0]];
    let bar = [[-3.0, -70.0, 30.0], [3.0, 70.0, 36.0]];
    let file = blocks(&[block, tower(45.0), tower(-55.0), bar]);
    let tool = json!({"stl": {"file": file.path().to_str().unwrap(), "unit": "1 mm",
                              "translate": ["0 m", "0 m", "0 m"]}});
    let crossed = serde_json::from_value(scene(tool, [0.06, 0.05], [0.0, 90.0])).unwrap();
    plyflow_tooling::given::checked(&crossed, 3e-3).unwrap();
    for (all, unit, parts) in [
        (
            vec![block.map(|p| [p[0], p[1], p[2] + 15.0])],
            "1 mm",
            ["z = 15.000 mm", "stands on the bed"],
        ),
        (
            vec![block],
            "1 um",
            ["0.120 x 0.080 x 0.020 mm", "is `unit`"],
        ),
        (vec![block], "1 m", ["the frame is too small", "is `unit`"]),
        (
            vec![block.map(|p| [p[0] + 600.0, p[1], p[2]])],
            "1 mm",
            ["the frame is too small", "x = y = 0"],
        ),
        (
            vec![block, [[-9.0, -9.0, 25.0], [9.0, 9.0, 30.0]]],
            "1 mm",
            ["one of its 2 bodies floats", "25.0) mm"],
        ),
        (
            vec![block, [[-9.0, -0.01, 20.0], [9.0, 0.01, 60.0]]],
            "1 mm",
            ["has a wall 0.02 mm thin", "thinnest ply"],
        ),
    ] {
        let told = over(&all, unit).expect_err(parts[0]);
        for part in parts {
            assert!(told.contains(part), "'{part}' in: {told}");
        }
    }
}

#[test]
fn wrong_input_is_refused_with_what_to_do() {
    let text = |more: Value| on_hemisphere(0.09, more).unwrap_err();
    let off = text(json!({"start": [0.2, 0.0]}));
    assert!(
        off.contains("lies off ply 'ply_1'") && off.contains("(200.0, 0.0) mm"),
        "{off}"
    );
    let odd = text(json!({"start": [0.0]}));
    assert!(odd.contains("two lengths"), "{odd}");
    let fine = text(json!({"net_spacing": 1e-6}));
    assert!(fine.contains("Take `net_spacing` of at least"), "{fine}");
    let away =
        drape(json!({"scene": scene(hemisphere(), [0.4, 0.1], [0.0, 90.0]), "start": [0.15, 0.0]}))
            .unwrap_err();
    assert!(away.contains("is not below it"), "{away}");
    let along = drape(json!({"scene": scene(hemisphere(), [0.1, 0.1], [0.0, 3.0])})).unwrap_err();
    assert!(
        along.contains("fibre_1") && along.contains("3 deg apart"),
        "{along}"
    );
    let mut steered = scene(hemisphere(), [0.1, 0.1], [0.0, 90.0]);
    let sheets = steered["sheets"].as_array_mut().unwrap();
    let ply = sheets.iter_mut().find(|s| s["kind"] == "ply").unwrap();
    ply["fibre_1"] = json!({"points": [{"x": "0 m", "y": "0 m", "angle": "0.1 rad"}]});
    ply.as_object_mut().unwrap().remove("fibre_2");
    let curved = drape(json!({"scene": steered})).unwrap_err();
    assert!(
        curved.contains("fibre_1: the fibres of ply 'ply_1' are steered"),
        "{curved}"
    );
    let mut bare = scene(hemisphere(), [0.1, 0.1], [0.0, 90.0]);
    bare["sheets"] = json!([bare["sheets"][0]]);
    let none = drape(json!({"scene": bare})).unwrap_err();
    assert!(none.contains("plies and a diaphragm above it"), "{none}");
    let huge = on_hemisphere(0.09, json!({"net_spacing": 0.5})).unwrap_err();
    assert!(huge.contains("net_spacing"), "{huge}");
}

#[test]
fn drape_has_one_frame_so_that_no_step_takes_it_for_a_motion() {
    let formed = on_hemisphere(0.09, json!({})).unwrap();
    assert_eq!(formed.times, [0.0]);
    assert!(formed.arrays.is_empty());
    let body = formed.body("ply_1");
    // The reference is the flat ply over the tool, as forming-explicit places it.
    let z = 0.05 + 0.005 + FILM + 0.5 * PLY;
    assert!(body.points.iter().all(|p| (p[2] - z).abs() < 1e-12));
    let zeros = |name: &str| body.last(name).iter().all(|v| *v == 0.0);
    assert!(zeros("fibre_strain_1") && zeros("fibre_strain_2"));
}

/// 18 x 12 mm under plies of 300 mm: inches, or tenths of a millimetre.
#[test]
fn a_tool_of_quite_another_size_than_the_plies_is_asked_about_its_unit() {
    let file = blocks(&[[[-60.0, -40.0, 0.0], [60.0, 40.0, 20.0]]]);
    let of = |unit: &str| {
        let tool = json!({"stl": {"file": file.path().to_str().unwrap(), "unit": unit,
                                  "translate": ["0 m", "0 m", "0 m"]}});
        let with = json!({"scene": scene(tool, [0.3, 0.3], [0.0, 90.0]), "element_size": 0.003});
        drape(with).unwrap().log.join("\n")
    };
    let told = of("0.15 mm");
    let parts = ["spans 18 mm x 12 mm", "the plies up to 300 mm", "is `unit`"];
    assert!(parts.iter().all(|p| told.contains(p)), "{told}");
    assert!(!of("1 mm").contains("unit"));
}

/// Flat sides that meet at 15 degrees, less than `crease_angle`: the net lies on the tube that they may stand for, by the chord's height off them.
#[test]
fn a_tool_that_is_smoothed_by_more_than_a_ply_says_so() {
    let with = |crease: f64| {
        let formed = on_hemisphere(0.06, json!({"crease_angle": crease})).unwrap();
        (formed.result("tool_field_error"), formed.log.join("\n"))
    };
    // Fine facets of a ball: by what their chords leave out.
    let (off, told) = with(0.5);
    assert!(off > 0.0 && off < 2.0 * CHORD_TOLERANCE, "{off}");
    assert!(!told.contains("smoothed"), "{told}");
    assert_eq!(with(0.0).0, 0.0);
    let mut sides = scene(json!({}), [0.06, 0.05], [0.0, 90.0]);
    let file = arch();
    sides["tool"] = json!({"stl": {"file": file.path().to_str().unwrap(), "unit": "1 mm",
                                   "translate": ["0 m", "0 m", "0 m"]}});
    let formed = drape(json!({"scene": sides, "element_size": 0.005})).unwrap();
    let height = 0.01 * (7.5f64.to_radians() / 2.0).tan();
    let off = formed.result("tool_field_error");
    assert!((off / height - 1.0).abs() < 0.02, "{off} of {height}");
    let told = formed.log.join("\n");
    assert!(
        told.contains("smoothed") && told.contains("smaller `crease_angle` (30 deg)"),
        "{told}"
    );
}

/// Half of a tube of 24 flat sides, each 20 mm wide, 120 mm long.
fn arch() -> tempfile::NamedTempFile {
    let radius = 10.0 / 7.5f64.to_radians().sin();
    let at = |k: usize, x: f64| {
        let (s, c) = (15.0 * (k % 13) as f64).to_radians().sin_cos();
        let z = if k % 13 == 12 { 0.0 } else { radius * s };
        [x, radius * c, z]
    };
    let mut facets = Vec::new();
    for k in 0..13 {
        let [a, b, c, d] = [at(k, -60.0), at(k, 60.0), at(k + 1, 60.0), at(k + 1, -60.0)];
        facets.extend([[a, c, b], [a, d, c]]);
    }
    for k in 1..12 {
        facets.push([at(0, -60.0), at(k + 1, -60.0), at(k, -60.0)]);
        facets.push([at(0, 60.0), at(k, 60.0), at(k + 1, 60.0)]);
    }
    let mut text = "solid arch\n".to_owned();
    for facet in facets {
        text += "facet normal 0 0 0\nouter loop\n";
        for [x, y, z] in facet {
            text += &format!("vertex {x} {y} {z}\n");
        }
        text += "endloop\nendfacet\n";
    }
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), text + "endsolid arch\n").unwrap();
    file
}

#[test]
fn regions_of_a_ply_are_said_to_count_for_nothing_in_a_net() {
    let mut scene = scene(hemisphere(), [0.08, 0.08], [0.0, 90.0]);
    scene["sheets"][1]["regions"] = json!([{"name": "a", "rectangle": {"length": "0.02 m", "width": "0.02 m"}, "friction": {"all": 0.1}}]);
    let formed = on_hemisphere(0.08, json!({"scene": scene})).unwrap();
    let text = formed.attributes["warnings"][0].as_str().unwrap();
    assert!(text.contains("`regions` count for nothing"), "{text}");
    assert_eq!(formed.attributes["warnings"].as_array().unwrap().len(), 1);
}

#[test]
fn a_net_of_a_tied_ply_says_that_it_does_not_know_of_the_one_below() {
    let mut scene = scene(hemisphere(), [0.08, 0.08], [0.0, 90.0]);
    let mut upper = scene["sheets"][1].clone();
    upper["name"] = json!("second");
    upper["tied"] = json!(true);
    scene["sheets"].as_array_mut().unwrap().insert(2, upper);
    let formed = on_hemisphere(0.08, json!({"scene": scene})).unwrap();
    let warnings = formed.attributes["warnings"].as_array().unwrap();
    let of_ties: Vec<_> = (warnings.iter().filter_map(|w| w.as_str()))
        .filter(|w| w.contains("tied to the ply below"))
        .collect();
    assert_eq!(of_ties.len(), 1, "{warnings:?}");
    assert!(of_ties[0].starts_with("ply 'second'"), "{of_ties:?}");
}

/// Facets of a block of 140 x 140 x 10 mm and of half a sphere of 40 mm on it, each closed, in mm.
fn block_and_dome() -> [Vec<[[f64; 3]; 3]>; 2] {
    let corner = |k: usize| {
        let side = |bit: usize| if k >> bit & 1 == 0 { -70.0 } else { 70.0 };
        [side(0), side(1), if k < 4 { 0.0 } else { 10.0 }]
    };
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let halves = quads.iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
    let block = halves.map(|t| t.map(|k| corner(*k))).collect();
    let (n, m, radius) = (32, 12, 40.0);
    let at = |j: usize, i: usize| {
        let (up, around) = (
            FRAC_PI_2 * j as f64 / m as f64,
            TAU * (i % n) as f64 / n as f64,
        );
        [
            radius * up.cos() * around.cos(),
            radius * up.cos() * around.sin(),
            10.0 + radius * up.sin(),
        ]
    };
    let mut dome = Vec::new();
    for i in 0..n {
        for j in 0..m - 1 {
            dome.push([at(j, i), at(j, i + 1), at(j + 1, i + 1)]);
            dome.push([at(j, i), at(j + 1, i + 1), at(j + 1, i)]);
        }
        dome.push([at(m - 1, i), at(m - 1, i + 1), [0.0, 0.0, 10.0 + radius]]);
        dome.push([at(0, i + 1), at(0, i), [0.0, 0.0, 10.0]]);
    }
    [block, dome]
}

#[test]
fn a_dome_on_a_block_is_draped_whichever_of_its_bodies_comes_first() {
    let folder = tempfile::tempdir().unwrap();
    let bodies = block_and_dome();
    for order in [[0, 1], [1, 0]] {
        let mut text = String::new();
        for body in order {
            text += "solid body\n";
            for facet in &bodies[body] {
                text += "facet normal 0 0 0\nouter loop\n";
                for [x, y, z] in facet {
                    text += &format!("vertex {x:.6} {y:.6} {z:.6}\n");
                }
                text += "endloop\nendfacet\n";
            }
            text += "endsolid body\n";
        }
        let file = folder.path().join("tool.stl");
        std::fs::write(&file, text).unwrap();
        let tool = json!({"stl": {"file": file.to_str().unwrap(), "unit": "1 mm"}});
        let scene = scene(tool, [0.096, 0.096], [0.0, 90.0]);
        let with = json!({"scene": scene, "element_size": 0.006, "net_spacing": 0.002});
        let formed = drape(with).unwrap();
        // With the dome turned by 3 or 7 degrees, or of 30 facets round, it is 0.894 to 0.898 rad; 0.77 rad where the walk began on the block.
        let shear = formed.result("shear_max");
        assert!((shear - 0.8969).abs() < 4e-3, "{order:?}: {shear}");
        assert!(
            formed.result("coverage") > 0.9,
            "{order:?}: {}",
            formed.result("coverage")
        );
    }
}
