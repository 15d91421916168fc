//! Where a run begins: the repository's own files, and such as the readers' formats are made of.

use crate::fixture::{CATALOG, Folder, REPOSITORY, files};
use crate::patch::BASES;
use camino::{Utf8Path, Utf8PathBuf};
use plyflow::plan::{Ingredients, InputKey, Key};
use plyflow::store::{Journal, Known};
use plyflow_artifact::{ArtifactWriter, DType, FieldInfo, On};
use serde_json::json;

/// Inputs for a target, besides its corpus.
#[must_use]
pub fn of(target: &str) -> Vec<Vec<u8>> {
    let fixture = |name: &str| REPOSITORY.join("tests/fuzz/fixture").join(name);
    let mut found = match target {
        "workflow" => of_yaml("plyflow:"),
        "scene" => of_yaml("plyflow_scene:"),
        "material" => of_yaml("plyflow_material:"),
        "expected" => read(files("workflows", ".json")),
        "points" => vec![std::fs::read(fixture("points.csv")).unwrap_or_default()],
        "override" => vec![
            b"coarse.element_size=8 mm\ndefects.over_shear_positive='9 deg'\n".to_vec(),
            b"coarse.scene.friction.fabric_fabric=0.1\ncoarse.scene.sheets.ply-1.fibre_1=-45 deg\ncoarse.damping=null".to_vec(),
        ],
        "ply-book" => vec![std::fs::read(fixture("plies.csv")).unwrap_or_default()],
        "drawing" => read(vec![fixture("ply.dxf"), fixture("corners.csv"), REPOSITORY.join("workflows/files-of-others/blank.dxf")]),
        "steering" => texts(&[
            "x [mm],y [mm],angle\n0,0,0\n100,0,20\n100,50,40 deg\n0,50,0.3 rad\n",
            "x;y;direction;note\n1,5 cm;0 mm;-170;a\n0 m;0 mm;170;b\n",
        ]),
        "quantity" => texts(&["5 mm", "-1.5e3 kPa", "45 °", "112.19 N/m", "20 °C", "1e-9 1/s2", "50 %", "3", "1/4 in"]),
        "expression" => texts(&[
            "-135 deg + ${angle}",
            "mu <= 0.1 and layup != 'L4'",
            "min(angle, 90 deg) * 2 / (1 + mu)",
            "0 <= mu < 1 or not on",
            "${layup}.yaml",
        ]),
        "table" | "profile" => read(files("workflows", ".csv")),
        "scan-points" => texts(&[&cloud("x;y;z", ";"), &cloud("x [mm]\ty [mm]\tz [mm]", "\t"), &cloud("# cloud", " ")]),
        "stl" | "scan-facets" => facets(),
        "artifact" => (0..BASES.len() as u8).map(|i| vec![i]).collect(),
        "manifest" => read(files("solver-plugins", "manifest.json")),
        "plugins" => texts(&[r#"{"version":1,"libraries":{"/p/liba.so":{"stamp":{},"hash":"","description":{"plugin":"{}"}}}}"#]),
        "record" => vec![std::fs::read(fixture("record.json")).unwrap_or_default()],
        "journal" => vec![journal()],
        "resolved" => vec![resolved()],
        "lock" => texts(&["4242\n", ""]),
        _ => Vec::new(),
    };
    found.retain(|bytes| !bytes.is_empty() && bytes.len() <= 1 << 14);
    found
}

fn texts(all: &[&str]) -> Vec<Vec<u8>> {
    all.iter().map(|t| t.as_bytes().to_vec()).collect()
}

fn read(files: Vec<Utf8PathBuf>) -> Vec<Vec<u8>> {
    files.iter().flat_map(std::fs::read).collect()
}

/// Files of workflows of one kind. What they name lies elsewhere: names of scenes and materials become those of the study beside.
fn of_yaml(begin: &str) -> Vec<Vec<u8>> {
    let mut all = files("workflows", ".yaml");
    all.extend(files("tests/fuzz/fixture", ".yaml"));
    let texts = all.iter().flat_map(std::fs::read_to_string);
    let of_kind = texts.filter(|t| t.lines().any(|l| l.starts_with(begin)));
    of_kind.map(|t| renamed(&t).into_bytes()).collect()
}

fn renamed(text: &str) -> String {
    let word = |word: &str| {
        let bare = word.trim_end_matches([',', '}', ']']);
        let end = &word[bare.len()..];
        match Utf8Path::new(bare).extension() {
            Some("yaml") if bare.contains("material") => format!("materials/fabric.yaml{end}"),
            Some("yaml") => format!("scene.yaml{end}"),
            Some("json") => format!("expected.json{end}"),
            Some("csv") => format!("points.csv{end}"),
            _ => word.to_owned(),
        }
    };
    let line = |line: &str| line.split(' ').map(word).collect::<Vec<_>>().join(" ");
    text.lines().map(line).collect::<Vec<_>>().join("\n") + "\n"
}

fn cloud(head: &str, sign: &str) -> String {
    let row = |i: usize| format!("{}{sign}{}.5{sign}-{i}e-1", i % 5, i / 5);
    let rows: Vec<String> = (0..25).map(row).collect();
    format!("{head}\n{}\n", rows.join("\n"))
}

/// A tetrahedron in the forms of the field, and one whose last facet is missing.
fn facets() -> Vec<Vec<u8>> {
    let p = [
        [0.0, 0.0, 0.0],
        [40.0, 0.0, 0.0],
        [0.0, 40.0, 0.0],
        [0.0, 0.0, 40.0],
    ];
    let of = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]].map(|f: [usize; 3]| f.map(|i| p[i]));
    let vertex = |v: &[f64; 3]| format!("      vertex {} {} {}\n", v[0], v[1], v[2]);
    let facet = |f: &[[f64; 3]; 3]| {
        let corners: String = f.iter().map(vertex).collect();
        format!("  facet normal 0 0 0\n    outer loop\n{corners}    endloop\n  endfacet\n")
    };
    let text = |f: &[[[f64; 3]; 3]]| {
        let all: String = f.iter().map(facet).collect();
        format!("solid part\n{all}endsolid part\n")
    };
    let closed = text(&of);
    let latin = [
        closed.as_bytes(),
        b"solid gr\xf6\xdfe\n",
        text(&of[..1])
            .split_once('\n')
            .unwrap_or_default()
            .1
            .as_bytes(),
    ]
    .concat();
    vec![
        plyflow_files::stl::write(&of),
        text(&of[..3]).into_bytes(),
        closed.to_uppercase().replace('.', ",").into_bytes(),
        closed.encode_utf16().flat_map(u16::to_le_bytes).collect(),
        latin,
        closed.into_bytes(),
    ]
}

/// The payloads of a journal of two steps, each behind its length, in the form that the target puts frames around.
fn journal() -> Vec<u8> {
    let folder = Folder::empty();
    let path = folder.path("journal");
    let study = Folder::of_study();
    let study = plyflow_workflow::load(&study.path("workflow.yaml"), &*CATALOG);
    let study = study.unwrap_or_else(|e| panic!("the study is not sound:\n{}", e.render(false)));
    let step = &study.steps[0];
    let mut journal = Journal::open(&path).expect("a new journal");
    let key = |n: u8| Key([n; 32]);
    journal.started();
    for n in [1, 2] {
        let known = Known {
            bytes: 100,
            labels: (n == 2).then(|| vec!["A".into(), "B".into()]),
            stamp: Some(7),
        };
        let ingredients = || Ingredients::of(step);
        let inputs = Vec::<InputKey>::new;
        journal.used(
            ("step", &[u64::from(n)]),
            key(n),
            (key(9), ingredients),
            known,
            inputs,
        );
    }
    journal.failed(("step", &[3]), key(3), "it failed");
    journal.ended(2, 1);
    journal.flush().expect("a disk");
    let file = std::fs::read(&path).expect("a journal");
    let (mut out, mut at) = (Vec::new(), 8);
    while let Some(length) = file.get(at..at + 4) {
        let length = u32::from_le_bytes([length[0], length[1], length[2], length[3]]) as usize;
        let payload = &file[at + 12..at + 12 + length];
        out.extend((length as u16).to_le_bytes());
        out.extend(payload);
        at += 12 + length;
    }
    out
}

/// A workflow that a store keeps, without the hashes before it.
fn resolved() -> Vec<u8> {
    let folder = Folder::of_study();
    let path = folder.path("workflow.yaml");
    let found = plyflow_workflow::resolve(&path, &*CATALOG, &[])
        .unwrap_or_else(|e| panic!("the study is not sound:\n{}", e.render(false)));
    let recipes = plyflow::plan::recipes(&found.workflow);
    plyflow::store::resolved::write(&folder.path(""), &path, &[7; 32], (&found, &recipes));
    let mut kept = folder.path("resolved").read_dir_utf8().expect("a folder");
    let kept = kept.next().expect("a file").expect("a file").into_path();
    std::fs::read(kept).expect("a file").split_off(64)
}

/// Writes the sound artifacts that patches are of into a folder. Long, as it lists what stands in each.
///
/// # Panics
/// When they cannot be written.
pub fn write_bases(folder: &Utf8Path) {
    let new = |name: &str, kind: &str| {
        let path = folder.join(format!("{name}.vtkhdf"));
        ArtifactWriter::create(path.as_std_path(), kind).expect("a new artifact")
    };
    let doubles = |v: &[f64]| -> Vec<u8> { v.iter().flat_map(|x| x.to_ne_bytes()).collect() };
    let mut w = new("attributes", "defects");
    w.attributes(r#"{"count": 3, "names": ["a", "b"]}"#)
        .expect("attributes");
    w.result("peak", 0.25, "rad").expect("a result");
    w.collection(vec!["A".into(), "B".into()]).expect("labels");
    w.finish(&json!({"step": "s"})).expect("an artifact");

    let mut w = new("arrays", "coupon");
    w.array(
        "history/time",
        DType::F64,
        &[3],
        "s",
        &doubles(&[0.0, 0.5, 1.0]),
    )
    .expect("an array");
    w.array(
        "history/deep/x",
        DType::F64,
        &[1, 2],
        "m",
        &doubles(&[3.0, 4.0]),
    )
    .expect("an array");
    w.array("count", DType::U32, &[], "1", &7u32.to_ne_bytes())
        .expect("an array");
    w.array("empty", DType::F64, &[0, 3], "1", &[])
        .expect("an array");
    w.finish(&json!({})).expect("an artifact");

    let mut w = new("bodies", "forming");
    let points: Vec<f64> = (0..12).map(|i| f64::from(i) / 3.0).collect();
    w.define_mesh("tool", &points[..9], 3, &[0, 1, 2], "")
        .expect("a body");
    w.define_mesh("ply", &points, 4, &[0, 1, 2, 3], r#"{"layer": 1}"#)
        .expect("a body");
    for frame in 0..2 {
        w.begin_frame(f64::from(frame)).expect("a frame");
        w.frame_points("ply", &points).expect("points");
        for (on, name, components) in [(On::Points, "u", 3), (On::Cells, "shear", 1)] {
            let field = FieldInfo::new(on, name, components, "m");
            let count = if on == On::Points { 12 } else { 1 };
            w.frame_field("ply", field, &points[..count])
                .expect("a field");
        }
        w.end_frame().expect("a frame");
    }
    w.finish(&json!({})).expect("an artifact");

    let mut w = new("long", "zones");
    let long: Vec<u32> = (0..2000).collect();
    w.attributes(&json!({"long": long, "more": "x".repeat(60_000)}).to_string())
        .expect("attributes");
    w.finish(&json!({"text": "y".repeat(1000)}))
        .expect("an artifact");
}
