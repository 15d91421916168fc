//! Two made-up runs side by side.

mod common;

use camino::{Utf8Path, Utf8PathBuf};
use common::{Study, ZONES, whole, whole_study};
use plyflow_report::{ReportInput, judge, write_beside};
use serde_json::{Value, json};

fn folder() -> (tempfile::TempDir, Utf8PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = Utf8PathBuf::from_path_buf(dir.path().to_owned()).unwrap();
    (dir, path)
}

fn page(inputs: [&ReportInput; 2], folder: &Utf8Path) -> String {
    let out = folder.join("beside.html");
    let size = write_beside(inputs, &out).unwrap();
    let page = std::fs::read_to_string(&out).unwrap();
    assert_eq!(size, page.len() as u64);
    page
}

fn sub(folder: &Utf8Path, name: &str) -> Utf8PathBuf {
    let sub = folder.join(name);
    std::fs::create_dir_all(&sub).unwrap();
    sub
}

fn part<'p>(page: &'p str, id: &str) -> &'p str {
    let from = page
        .find(&format!("<section id=\"{id}\">"))
        .unwrap_or_else(|| panic!("no section {id}"));
    &page[from..from + page[from..].find("</section>").unwrap()]
}

fn scenes(page: &str) -> Vec<Value> {
    let begin = "<script type=\"application/json\" class=\"scene\">";
    let all = page.split(begin).skip(1);
    all.map(|s| serde_json::from_str(&s[..s.find("</script>").unwrap()]).unwrap())
        .collect()
}

/// The second run has another friction and no zone B.
fn changed(folder: &Utf8Path) -> ReportInput {
    let mut s = Study::new(folder);
    s.scene["friction"]["fabric_fabric"] = json!(0.2);
    s.forming("coarse", None, 0.004);
    s.defects(false);
    s.zones(&ZONES[..1]);
    let (zone, bounds) = ZONES[0];
    s.boundary(zone);
    s.forming(&format!("local[{zone}]"), Some((zone, bounds)), 0.002);
    s.comparison(&ZONES[..1]);
    s.input()
}

#[test]
fn changes_verdicts_and_defects_of_both_runs_stand_in_one_table_each() {
    let (_keep, folder) = folder();
    let mut inputs = [whole(&sub(&folder, "a")), changed(&sub(&folder, "b"))];
    for input in &mut inputs {
        input.limits = Some(serde_json::from_value(json!({"wrinkle_length": "60 mm"})).unwrap());
        input.judged = judge(input);
    }
    let page = page([&inputs[0], &inputs[1]], &folder);
    let changes = part(&page, "changes");
    assert!(changes.contains("<th><code>scene.friction.fabric_fabric</code></th><td>0.35</td><td>0.2</td><td>coarse, local</td>"), "{changes}");
    assert_eq!(
        changes.matches("<tr>").count(),
        2,
        "the head and one change"
    );
    let limits = part(&page, "limits");
    assert!(limits.contains("<th>wrinkle length</th><td class=\"n\">at most 60 mm</td><td class=\"n\">68.4 mm</td><td class=\"n\">68.4 mm</td>"), "{limits}");
    let defects = part(&page, "defects");
    // Both of zone A are in both runs, those of zone B in the first alone.
    assert!(
        defects.contains("2 defects are in both runs, 2 in A alone, 0 in B alone."),
        "{defects}"
    );
    assert_eq!(defects.matches("A alone</td>").count(), 2);
    assert!(page.contains("This page is complete in itself"));
    assert!(
        !page.contains("src=\"http") && !page.contains("<link"),
        "nothing is loaded"
    );
}

#[test]
fn both_views_have_the_same_fields_on_the_same_scales() {
    let (_keep, folder) = folder();
    let page = page(
        [&whole(&sub(&folder, "a")), &changed(&sub(&folder, "b"))],
        &folder,
    );
    let scenes = scenes(&page);
    assert_eq!(scenes.len(), 2);
    let names = |k: usize| -> Vec<String> {
        let all = scenes[k]["fields"].as_array().unwrap();
        all.iter()
            .map(|f| f["name"].as_str().unwrap().to_owned())
            .collect()
    };
    assert_eq!(names(0), names(1));
    // The bars of both views have the same ticks: their texts are the same but for the names of their gradients.
    let bars = |n: usize, k: usize| -> String {
        let from = page.find(&format!("id=\"view-scale-{n}-{k}\"")).unwrap();
        let bar = &page[from..from + page[from..].find("</svg>").unwrap()];
        bar.replace(&format!("view-scale-{n}-"), "")
    };
    for k in 0..names(0).len() {
        assert_eq!(bars(0, k), bars(1, k), "{}", names(0)[k]);
    }
    assert!(page.contains("<body class=\"beside\">"));
}

#[test]
fn a_run_beside_itself_differs_in_nothing() {
    let (_keep, folder) = folder();
    let input = whole_study(&folder).input();
    let page = page([&input, &input], &folder);
    assert!(part(&page, "changes").contains("Nothing: both runs had the same parameters"));
    assert!(
        part(&page, "defects").contains("4 defects are in both runs, 0 in A alone, 0 in B alone.")
    );
}
