//! What the page and the terminal tell of defects that were followed through other runs of their zones.

mod common;

use camino::Utf8PathBuf;
use common::{Study, ZONES, whole_study};
use plyflow_report::{ReportInput, summary, write_report};
use serde_json::{Value, json};

fn folder() -> (tempfile::TempDir, Utf8PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = Utf8PathBuf::from_path_buf(dir.path().to_owned()).unwrap();
    (dir, path)
}

fn page(input: &ReportInput, folder: &camino::Utf8Path) -> String {
    let out = folder.join("report.html");
    write_report(input, &out).unwrap();
    std::fs::read_to_string(&out).unwrap()
}

fn confirmation(stays: bool, text: &str) -> Value {
    let size = |value: f64| json!({"value": value, "low": value, "high": 1.04 * value, "order": null, "by": {"finer": 1.02 * value}});
    json!({
        "tolerance": 0.1,
        "variants": [{"variant": "finer", "steps": ["local_finer"], "runs": 2, "wrinkles": 1, "bridging": 0}],
        "left_out": ["wider"],
        "defects": [{"id": "AW1", "zone": "A", "ply": "ply_2", "type": "wrinkle", "centre": [-0.05, -0.04], "stands": "stays",
            "text": "68 to 71 mm, stays", "hangs_on": [], "sizes": {"length": size(0.068), "amplitude": size(0.003), "area": size(1e-4)}}],
        "new": [],
        "verdict": {"wrinkles": 1, "bridging": 0, "stays": stays, "hangs_on": [], "text": text},
        "tables": [{"name": "confirmed", "title": "Which defects stay", "columns": [{"label": "defect"}, {"label": "verdict"}],
            "rows": [["AW1", "68 to 71 mm, stays"]]}],
    })
}

/// A study with its defects confirmed.
fn confirmed(folder: &camino::Utf8Path, told: &Value) -> Study {
    let mut study = whole_study(folder);
    let mut w = study.create("confirm", "confirmation");
    w.attributes(&told.to_string()).unwrap();
    let inputs = [
        ("global", "coarse"),
        ("zones", "zones"),
        ("local", "local[A]"),
        ("local", "local[B]"),
    ];
    let results = vec![("verdict_stays", 1.0, "1")];
    study.finish(w, ("confirm", &[]), "confirmation", &inputs, results);
    study
}

#[test]
fn each_defect_has_its_bounds_and_the_verdict_its_sentence_on_the_page_and_in_the_terminal() {
    let (_keep, folder) = folder();
    let sentence = "the verdict stays: there are wrinkles and no bridging; 1 of 1 defects stay; not looked at: margin";
    let input = confirmed(&folder, &confirmation(true, sentence)).input();
    let page = page(&input, &folder);
    assert!(page.contains("run in other ways"));
    assert!(
        page.matches("68 to 71 mm, stays").count() >= 2,
        "in the table of defects, and in that of the step"
    );
    assert!(page.contains(&format!("<p class=\"confirmed\">T{}.</p>", &sentence[1..])));
    assert!(page.contains("Which defects stay"));
    let text = summary(&input, None);
    assert!(
        text.contains("run in other ways") && text.contains("68 to 71 mm, stays"),
        "{text}"
    );
    assert!(text.contains(sentence), "{text}");
    // Without one nothing of it is there.
    let plain = whole_study(&folder).input();
    assert!(!summary(&plain, None).contains("run in other ways"));
}

#[test]
fn a_verdict_that_hangs_on_something_is_shown_as_one_not_to_be_trusted() {
    let (_keep, folder) = folder();
    let told = |stays| {
        let input = confirmed(&folder, &confirmation(stays, "the verdict of the variants")).input();
        page(&input, &folder)
    };
    let class = |page: &str| {
        let at = page.find("The verdict of the variants").unwrap();
        let start = page[..at].rfind("class=\"state ").unwrap();
        page[start..].split('"').nth(1).unwrap().to_owned()
    };
    assert_eq!(class(&told(false)), "state bad");
    assert_eq!(class(&told(true)), "state good");
}

#[test]
fn wider_zones_beside_those_that_are_compared_are_no_study_of_their_own() {
    let (_keep, folder) = folder();
    let study = whole_study(&folder);
    let mut beside = Study::new(&folder);
    beside.instances = study.instances.clone();
    let one = page(&study.input(), &folder);
    let mut w = beside.create("zones_wider", "zones");
    let list: Vec<Value> = (ZONES.iter())
        .map(|(name, b)| json!({"name": name, "box": b, "free_sides": vec![false; 4], "plies": ["ply_1"]}))
        .collect();
    w.attributes(&json!({"zones": list, "scale": 1.15, "wider": 2.0}).to_string())
        .unwrap();
    beside.finish(
        w,
        ("zones_wider", &[]),
        "zones",
        &[("defects", "detect")],
        vec![],
    );
    let both = page(&beside.input(), &folder);
    let titles = |page: &str| page.matches("<h2 class=\"study\">").count();
    assert_eq!((titles(&one), titles(&both)), (0, 0));
}
