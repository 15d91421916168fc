//! The data of the 3D view, read as the page's script reads them, and the joints of tables, maps and view.

mod common;

use base64::Engine;
use camino::{Utf8Path, Utf8PathBuf};
use common::found::BESIDE;
use common::{Study, whole, whole_study};
use plyflow_artifact::{Artifact, On};
use plyflow_report::{ReportInput, write_report};
use serde_json::Value;
use std::io::Read;

fn folder() -> (tempfile::TempDir, Utf8PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = Utf8PathBuf::from_path_buf(dir.path().to_owned()).unwrap();
    (dir, path)
}

fn page(input: &ReportInput, folder: &Utf8Path) -> String {
    let out = folder.join("report.html");
    write_report(input, &out).unwrap();
    std::fs::read_to_string(&out).unwrap()
}

const BEGIN: &str = "<script type=\"application/json\" class=\"scene\">";

/// The text of the first scene.
fn json(page: &str) -> &str {
    let from = page.find(BEGIN).expect("a scene") + BEGIN.len();
    &page[from..from + page[from..].find("</script>").unwrap()]
}

/// A scene: what is told, and its arrays.
struct Scene {
    told: Value,
    bytes: Vec<u8>,
    at: usize,
}

impl Scene {
    fn of(page: &str) -> Self {
        let told: Value = serde_json::from_str(json(page)).unwrap();
        let data = told["data"].as_str().unwrap();
        let data = base64::engine::general_purpose::STANDARD.decode(data);
        let mut bytes = Vec::new();
        flate2::read::ZlibDecoder::new(data.unwrap().as_slice())
            .read_to_end(&mut bytes)
            .unwrap();
        Self { told, bytes, at: 0 }
    }

    /// Whole numbers of `size` bytes, each the difference to the one `stride` before.
    fn take(&mut self, count: u64, size: usize, stride: usize) -> Vec<u64> {
        let count = usize::try_from(count).unwrap();
        let bytes = &self.bytes[self.at..self.at + count * size];
        self.at += count * size;
        let number = |b: &[u8]| b.iter().rev().fold(0u64, |n, b| n << 8 | u64::from(*b));
        let mut all: Vec<u64> = bytes.chunks(size).map(number).collect();
        let modulo = 1u64 << (8 * size);
        for i in stride..all.len() {
            all[i] = (all[i] + all[i - stride]) % modulo;
        }
        all
    }

    /// Lines of a list of bodies, outlines or defects.
    fn lines(&mut self, one: &Value) -> Vec<Vec<f64>> {
        let counts = list(&one["lines"]);
        counts
            .iter()
            .map(|n| self.points(n.as_u64().unwrap()))
            .collect()
    }

    /// Points on the way, which are coarser.
    fn coarse_points(&mut self, count: u64) -> Vec<f64> {
        let number = |v: &Value| v.as_f64().unwrap();
        let extent = self.told["extent"].clone();
        let largest = list(&extent["size"]).iter().map(number).fold(0.0, f64::max);
        let step = largest / number(&self.told["way"]["places"]);
        let taken = self.take(3 * count, 2, 3);
        let place = |(i, v): (usize, &u64)| number(&extent["low"][i % 3]) + *v as f64 * step;
        taken.iter().enumerate().map(place).collect()
    }

    fn points(&mut self, count: u64) -> Vec<f64> {
        let number = |v: &Value, d: usize| v[d].as_f64().unwrap();
        let taken = self.take(3 * count, 2, 3);
        let extent = &self.told["extent"];
        let place = |(i, v): (usize, &u64)| {
            number(&extent["low"], i % 3) + *v as f64 / 65535.0 * number(&extent["size"], i % 3)
        };
        taken.iter().enumerate().map(place).collect()
    }
}

/// Reads a body to its end, and gives its fields: 0 where there is no value.
fn fields(scene: &mut Scene, body: &Value) -> Vec<Vec<u64>> {
    let points = body["points"].as_u64().unwrap();
    scene.points(points);
    for part in list(&body["parts"]) {
        scene.take(4 * part["cells"].as_u64().unwrap(), 4, 4);
    }
    let all = list(&body["fields"]);
    let all = all.iter().map(|_| scene.take(points, 1, 1)).collect();
    for fibres in list(&body["fibres"]) {
        scene.lines(&fibres);
    }
    scene.points(2 * body["edges"].as_u64().unwrap());
    all
}

fn list(value: &Value) -> Vec<Value> {
    value.as_array().unwrap().clone()
}

#[test]
fn where_no_distance_is_judged_the_ply_is_grey_and_the_scale_does_not_see_it() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.beside_tool = true;
    study.forming("coarse", None, 0.004);
    study.defects(false);
    let page = page(&study.input(), &folder);
    let mut scene = Scene::of(&page);
    // The tool comes first.
    let [_, fields] = [0, 1].map(|n| {
        let body = scene.told["bodies"][n].clone();
        fields(&mut scene, &body)
    });
    let artifact = Artifact::open(folder.join("detect.h5").as_std_path()).unwrap();
    let flat = artifact.frame_field("ply_1", 0, On::Points, "undeformed");
    let unknown = |(place, at): (&u64, &[f64])| (*place == 0) == (at[0] > BESIDE[1]);
    let flat = flat.unwrap();
    assert!(
        fields[1].iter().zip(flat.chunks(3)).all(unknown),
        "the distance"
    );
    assert!(
        fields[0].iter().all(|place| *place > 0),
        "the shear is known"
    );
    // The range is that of what is judged, and not the 50 mm beside the tool.
    let legend = "Distance of the ply from where it would lie on the tool";
    let ranges: Vec<f64> = (page.match_indices(legend))
        .map(|(at, _)| page[..at].rsplit_once("; values from ").unwrap().1)
        .map(|range| range.split_once(" to ").unwrap().1)
        .map(|to| to.split(' ').next().unwrap().trim_end_matches('.'))
        .map(|to| to.parse().unwrap())
        .collect();
    assert!(
        !ranges.is_empty() && ranges.iter().all(|r| *r < 7.0),
        "{ranges:?}"
    );
}

#[test]
fn a_ply_comes_back_from_the_page_as_it_lies_in_the_artifact() {
    let (_keep, folder) = folder();
    let page = page(&whole(&folder), &folder);
    let mut scene = Scene::of(&page);
    let bodies = list(&scene.told["bodies"]);
    let of = |b: &Value| (b["ply"].clone(), b["zone"].clone());
    assert_eq!(of(&bodies[0]), (Value::Null, Value::Null), "the tool");
    assert_eq!(of(&bodies[1]), ("ply_1".into(), Value::Null));
    assert_eq!(of(&bodies[6]), ("ply_2".into(), "B".into()));
    let artifact = Artifact::open(folder.join("detect.h5").as_std_path()).unwrap();
    let (_, cells) = artifact.mesh("ply_1").unwrap();
    let formed = artifact.frame_points("ply_1", 0).unwrap();
    let distance = artifact
        .frame_field("ply_1", 0, On::Points, "nodal_distance")
        .unwrap();
    for (n, body) in bodies.iter().enumerate() {
        let points = scene.points(body["points"].as_u64().unwrap());
        let mut quads = Vec::new();
        for part in list(&body["parts"]) {
            let part = scene.take(4 * part["cells"].as_u64().unwrap(), 4, 4);
            quads.extend(
                part.chunks(4)
                    .map(|q| [q[0], q[1], q[2], q[3]])
                    .collect::<Vec<_>>(),
            );
        }
        let fields: Vec<Vec<u64>> = list(&body["fields"])
            .iter()
            .map(|_| scene.take(body["points"].as_u64().unwrap(), 1, 1))
            .collect();
        for fibres in list(&body["fibres"]) {
            scene.lines(&fibres);
        }
        let edges = body["edges"].as_u64().unwrap();
        let ends: Vec<Vec<f64>> = (0..edges).map(|_| scene.points(2)).collect();
        // The half-pipe is open all around: its rim is an edge, and no other.
        let rim = |e: &Vec<f64>| e[0] == e[3] || (e[1].abs() - 0.0593).abs() < 1e-3;
        assert!(
            (n == 0) == (edges == 82) && ends.iter().all(rim),
            "{n}: {edges}"
        );
        if n != 1 {
            continue;
        }
        let off = |(a, b): (&f64, &f64)| (a - b).abs();
        let worst = points
            .iter()
            .zip(formed.as_flattened())
            .map(off)
            .fold(0.0, f64::max);
        assert!(points.len() == 3 * formed.len() && worst < 1e-5, "{worst}");
        // In parts by zone, but the same cells.
        let mut expected: Vec<[u64; 4]> = (cells.as_chunks::<4>().0.iter())
            .map(|c| c.map(u64::from))
            .collect();
        assert_ne!(quads, expected);
        quads.sort_unstable();
        expected.sort_unstable();
        assert_eq!(quads, expected);
        // 0 to 5 mm on the scale of the distance.
        let place = |d: &f64| 1.0 + (d / 0.005).clamp(0.0, 1.0) * 254.0;
        let wrong = |(v, d): (&u64, &f64)| (*v as f64 - place(d)).abs() > 0.6;
        assert!(!fields[1].iter().zip(&distance).any(wrong));
    }
    for kind in ["outlines", "defects"] {
        for one in list(&scene.told[kind]) {
            scene.lines(&one);
        }
    }
    on_the_way(&mut scene, &bodies, &formed);
    assert_eq!(scene.at, scene.bytes.len(), "all is told");
}

/// The made-up run has a frame in which its plies are flat, and the last one.
fn on_the_way(scene: &mut Scene, bodies: &[Value], formed: &[[f64; 3]]) {
    let way = scene.told["way"].clone();
    assert_eq!(way["times"], serde_json::json!([0.0, 1.0]));
    assert_eq!(
        way["bodies"],
        serde_json::json!([1, 2]),
        "those of the whole"
    );
    let fields = list(&way["fields"]);
    let name = |k: &Value| scene.told["fields"][k.as_u64().unwrap() as usize]["name"].clone();
    let names: Vec<Value> = fields.iter().map(name).collect();
    assert_eq!(
        names,
        [
            "Shear angle",
            "Fibre deviation, family 1",
            "Fibre deviation, family 2"
        ]
    );
    for k in list(&way["bodies"]) {
        let count = bodies[k.as_u64().unwrap() as usize]["points"]
            .as_u64()
            .unwrap();
        let points = scene.coarse_points(count);
        let flat = points
            .chunks(3)
            .zip(formed)
            .all(|(p, f)| p[2].abs() < 2e-4 && (p[0] - f[0]).abs() < 2e-4);
        assert!(
            flat,
            "the first moment is the flat ply, within a quarter of a millimetre"
        );
        let shades: Vec<Vec<u64>> = fields.iter().map(|_| scene.take(count, 1, 1)).collect();
        // A flat ply has no deviation: the middle of its scale.
        assert!(
            shades[1].iter().chain(&shades[2]).all(|v| *v == 128),
            "{:?}",
            &shades[1][..4]
        );
    }
}

#[test]
fn lines_of_fibres_run_along_their_families_and_are_parted_at_the_zones_with_finer_plies() {
    let (_keep, folder) = folder();
    let page = page(&whole(&folder), &folder);
    let mut scene = Scene::of(&page);
    assert!(
        page.contains("Lines of fibres are 7.5 mm apart")
            || page.contains("Lines of fibres are 10 mm apart")
    );
    let mut seen = Vec::new();
    for body in list(&scene.told["bodies"]) {
        let count = body["points"].as_u64().unwrap();
        scene.points(count);
        for part in list(&body["parts"]) {
            scene.take(4 * part["cells"].as_u64().unwrap(), 4, 4);
        }
        for _ in list(&body["fields"]) {
            scene.take(count, 1, 1);
        }
        for fibres in list(&body["fibres"]) {
            let family = fibres["family"].as_u64().unwrap();
            seen.push((
                body["ply"].clone(),
                body["zone"].clone(),
                fibres["zone"].clone(),
                family,
            ));
            for line in scene.lines(&fibres) {
                assert!(line.len() >= 6);
                // Where the half-pipe has no wave, a fibre at +-45 deg turns by its angle about the pipe: y goes with x, to one side or the other.
                let (a, b) = (&line[..3], &line[line.len() - 3..]);
                let (along, around) = (b[0] - a[0], b[1].atan2(b[2]) - a[1].atan2(a[2]));
                let sign = if family == 0 { -1.0 } else { 1.0 };
                let off = (sign * around * 0.061 - along).abs();
                assert!(
                    off < 0.012 + 0.2 * along.abs(),
                    "{along} {around} of family {family}"
                );
            }
        }
        for _ in 0..body["edges"].as_u64().unwrap() {
            scene.points(2);
        }
    }
    let is = |ply: &str, own: Value, part: Value| {
        let of = seen
            .iter()
            .filter(|s| s.0 == ply && s.1 == own && s.2 == part);
        of.count()
    };
    assert_eq!(is("ply_1", Value::Null, Value::Null), 2, "{seen:?}");
    assert_eq!(is("ply_2", Value::Null, "A".into()), 2);
    assert_eq!(is("ply_2", "B".into(), Value::Null), 2);
    assert!(seen.iter().all(|s| !s.0.is_null()), "a tool has no fibres");
}

#[test]
fn defects_of_comparison_and_measurement_stand_in_table_map_and_view_under_one_name() {
    let (_keep, folder) = folder();
    let mut study = whole_study(&folder);
    study.measurement();
    let measure = study.instances.len() - 1;
    let page = page(&study.input(), &folder);
    let scene = Scene::of(&page);
    let defects = list(&scene.told["defects"]);
    let names: Vec<&str> = defects.iter().map(|d| d["id"].as_str().unwrap()).collect();
    let rows = [0, 1].map(|row| format!("step-{measure}-{row}"));
    assert_eq!(
        names,
        ["0-AB1", "0-AW1", "0-BB1", "0-BW1", &rows[0], &rows[1]]
    );
    for name in &names {
        let row = format!("<tr data-defect=\"{name}\">");
        let mark = format!("<g class=\"place\" data-defect=\"{name}\">");
        assert_eq!(page.matches(&row).count(), 1, "{name}");
        assert!(page.contains(&mark), "{name}");
    }
    // The made-up waves have three humps each; the crest of the first follows their outlines.
    let [with, without] = [4, 5].map(|k| list(&defects[k]["lines"]).len());
    assert_eq!((with, without), (4, 3));
    // The wrinkle of zone A lies about its middle, on the side of -y.
    let at = &defects[1]["at"];
    assert!((at[0].as_f64().unwrap() + 0.05).abs() < 0.006, "{at}");
    assert!(defects[1]["normal"][1].as_f64().unwrap() < -0.3);
}

#[test]
fn names_in_a_scene_cannot_end_its_script() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.forming("coarse", None, 0.008);
    study.defects(false);
    study.zones(&[("</script><b>&", common::ZONES[0].1)]);
    let page = page(&study.input(), &folder);
    assert!(json(&page).contains("\\u003c/script\\u003e\\u003cb\\u003e\\u0026"));
    let told: Value = serde_json::from_str(json(&page)).unwrap();
    assert_eq!(told["outlines"][0]["zone"], "</script><b>&");
    assert!(!page.contains("</script><b>"));
}

#[test]
fn a_mesh_beyond_the_budget_is_thinned_and_the_page_says_so() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.forming("coarse", None, 0.000_5);
    let page = page(&study.input(), &folder);
    assert!(page.len() < 5_000_000, "{} bytes", page.len());
    let whole = (480 + 1) * (320 + 1);
    assert!(page.contains("Shown coarser than computed: ply_1 with "));
    assert!(page.contains(&format!("of its {whole} points")));
    let told: Value = serde_json::from_str(json(&page)).unwrap();
    let points: u64 = list(&told["bodies"])
        .iter()
        .map(|b| b["points"].as_u64().unwrap())
        .sum();
    assert!((10_000..=120_000).contains(&points), "{points}");
}

#[test]
fn a_page_without_plies_has_no_view_and_no_script_for_one() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.coupon();
    let page = page(&study.input(), &folder);
    assert!(!page.contains("createREGL") && !page.contains("view3d\""));
    assert!(page.contains("class=\"copy with-script\""));
}

/// The made-up runs have, besides what the maps show, a strain on cells, a pressure on points, a displacement and one thickness.
#[test]
fn every_field_of_the_plies_is_in_the_menu_with_its_unit_and_what_is_the_same_everywhere_is_told() {
    let (_keep, folder) = folder();
    let page = page(&whole(&folder), &folder);
    let from = page.find("<select").unwrap();
    let menu = &page[from..from + page[from..].find("</select>").unwrap()];
    let texts: Vec<&str> = (menu.split("<option").skip(1))
        .map(|o| o.split(['>', '<']).nth(1).unwrap())
        .collect();
    assert_eq!(
        texts[..3],
        [
            "Shear angle (deg)",
            "Nodal distance (mm)",
            "Curvature (1/mm)"
        ]
    );
    for text in [
        "Fibre strain 1",
        "Contact pressure (kPa)",
        "Displacement, y (mm)",
        "Displacement, z (mm)",
        "Displacement, magnitude (mm)",
    ] {
        assert!(texts.contains(&text), "{text}: {texts:?}");
    }
    // No place of the half-pipe goes along it.
    for (title, told) in [
        ("Thickness", "Thickness (0.5 mm)"),
        ("Displacement, x", "Displacement, x (0 mm)"),
    ] {
        assert!(!menu.contains(title) && page.contains(told), "{title}");
    }
    assert!(
        texts[3].starts_with("Fibre") && texts.last() == Some(&"Wrinkle (1 where one was found)"),
        "{texts:?}"
    );
    assert!(!page.contains("Left out, as the page"));
    // What the view has of the displacement is that of the artifact.
    let mut scene = Scene::of(&page);
    let names: Vec<String> = list(&scene.told["fields"])
        .iter()
        .map(|f| f["name"].as_str().unwrap().to_owned())
        .collect();
    assert_eq!(names.len(), texts.len());
    let wanted = names
        .iter()
        .position(|n| n == "Displacement, magnitude")
        .unwrap();
    let bodies = list(&scene.told["bodies"]);
    let artifact = Artifact::open(folder.join("coarse.h5").as_std_path()).unwrap();
    let moved = artifact
        .frame_field("ply_1", 1, On::Points, "displacement")
        .unwrap();
    let size: Vec<f64> = (moved.as_chunks::<3>().0.iter())
        .map(|d| d.iter().map(|v| v * v).sum::<f64>().sqrt())
        .collect();
    for (n, body) in bodies.iter().take(2).enumerate() {
        let count = body["points"].as_u64().unwrap();
        scene.points(count);
        for part in list(&body["parts"]) {
            scene.take(4 * part["cells"].as_u64().unwrap(), 4, 4);
        }
        for field in list(&body["fields"]) {
            let found = scene.take(count, 1, 1);
            // 1 to 255 are places on the scale.
            let found: Vec<u64> = found.iter().map(|v| v - 1).collect();
            if n == 1 && field == wanted {
                // Places on one scale from nought on: in proportion, as far as it does not end.
                let top = size.iter().copied().fold(0.0, f64::max);
                let at = size.iter().position(|s| *s > 0.3 * top && *s < 0.5 * top);
                let unit = found[at.unwrap()] as f64 / size[at.unwrap()];
                let wrong = |(v, s): (&u64, &f64)| {
                    *v < 254 && (*v as f64 - unit * s).abs() > 1.0 + 0.02 * unit * s
                };
                assert!(!found.iter().zip(&size).any(wrong));
                return;
            }
        }
        for fibres in list(&body["fibres"]) {
            scene.lines(&fibres);
        }
        for _ in 0..body["edges"].as_u64().unwrap() {
            scene.points(2);
        }
    }
    panic!("ply_1 has no displacement");
}

#[test]
fn slip_that_a_measurement_has_found_is_in_the_menu_of_the_view_and_its_numbers_of_defects_are_not()
{
    let (_keep, folder) = folder();
    let mut study = whole_study(&folder);
    study.measurement();
    let page = page(&study.input(), &folder);
    let scene = Scene::of(&page);
    let fields = list(&scene.told["fields"]);
    let place = |name: &str| fields.iter().position(|f| f["name"] == name);
    let slip = place("Slip along").expect("slip is shown");
    assert!(page.contains(">Slip along (mm)<") && place("Defect").is_none());
    // On the ply that has it alone.
    let bodies = list(&scene.told["bodies"]).into_iter();
    let with = bodies.filter(|b| list(&b["fields"]).iter().any(|f| *f == slip));
    assert_eq!(with.count(), 1);
}
