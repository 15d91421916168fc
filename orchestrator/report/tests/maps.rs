//! Maps and tables that artifacts of any kind carry, on the page.

mod common;

use camino::Utf8PathBuf;
use common::Study;
use plyflow_artifact::{FieldInfo, On};
use plyflow_report::write_report;
use serde_json::{Value, json};

/// The page of one step of a stranger's kind with these attributes; bodies `left` and `right`, squares of four cells 0.1 m wide,
/// with the fields `height` (points, m), up to 3 and 6 mm, and `moment` (cells, N), on `left` alone; `way` has three components.
fn page_with(about: &Value) -> String {
    let dir = tempfile::tempdir().unwrap();
    let folder = Utf8PathBuf::from_path_buf(dir.path().to_owned()).unwrap();
    let mut study = Study::new(&folder);
    let mut w = study.create("step", "a-stranger-s-kind");
    let at = |i: usize| 0.05 * i as f64;
    let points: Vec<f64> = (0..9).flat_map(|k| [at(k % 3), at(k / 3), 0.0]).collect();
    let cells = [0, 1, 4, 3, 1, 2, 5, 4, 3, 4, 7, 6, 4, 5, 8, 7];
    for body in ["left", "right"] {
        w.define_mesh(body, &points, 4, &cells, "{}").unwrap();
    }
    w.begin_frame(0.0).unwrap();
    for (body, top) in [("left", 3e-3), ("right", 6e-3)] {
        w.frame_points(body, &points).unwrap();
        let height: Vec<f64> = (0..9).map(|k| top * f64::from(k) / 8.0).collect();
        w.frame_field(body, FieldInfo::new(On::Points, "height", 1, "m"), &height)
            .unwrap();
    }
    w.frame_field(
        "left",
        FieldInfo::new(On::Cells, "moment", 1, "N"),
        &[-0.1, 0.0, 0.1, 0.2],
    )
    .unwrap();
    w.frame_field(
        "left",
        FieldInfo::new(On::Points, "way", 3, "m"),
        &[0.0; 27],
    )
    .unwrap();
    w.end_frame().unwrap();
    w.attributes(&about.to_string()).unwrap();
    study.finish(w, ("step", &[]), "a-stranger-s-kind", &[], vec![]);
    let mut input = study.input();
    input.expectations.clear();
    let out = folder.join("report.html");
    write_report(&input, &out).unwrap();
    std::fs::read_to_string(&out).unwrap()
}

fn panel(body: &str, field: &str) -> Value {
    json!({"label": format!("<{body}>"), "body": body, "field": field})
}

fn a_map(unit: &str, panels: Vec<Value>) -> Value {
    json!({"maps": [{"name": "m", "title": "Title of m", "unit": unit, "panels": panels}]})
}

fn warnings(page: &str) -> &str {
    let Some(start) = page.find("id=\"warnings\"") else {
        return "";
    };
    &page[start..start + page[start..].find("</section>").unwrap()]
}

/// The picture of a panel.
fn picture(page: &str, label: &str) -> String {
    let mark = format!("aria-label=\"Title of m, {label}\"");
    let from = &page[page.find(&mark).unwrap_or_else(|| panic!("no {mark}"))..];
    let from = &from[from.find("href=\"").unwrap() + 6..];
    from[..from.find('"').unwrap()].to_owned()
}

#[test]
fn panels_share_one_scale_in_the_unit_of_the_map() {
    let page = page_with(&a_map(
        "mm",
        vec![panel("left", "height"), panel("right", "height")],
    ));
    assert_eq!(warnings(&page), "");
    for text in [
        "Title of m (mm)",
        "values from 0 to 6",
        ">6</text>",
        "&lt;left&gt;",
    ] {
        assert!(page.contains(text), "{text}");
    }
    // One bar; the lower panel is drawn in other colours than alone, where its own values set the scale.
    assert_eq!(page.matches("class=\"bar\"").count(), 1);
    let alone = page_with(&a_map(
        "mm",
        vec![panel("left", "height"), panel("left", "height")],
    ));
    assert_ne!(
        picture(&page, "&lt;left&gt;"),
        picture(&alone, "&lt;left&gt;")
    );
    assert_ne!(
        picture(&page, "&lt;left&gt;"),
        picture(&page, "&lt;right&gt;")
    );
    // A field of both signs on cells.
    let page = page_with(&a_map("N", vec![panel("left", "moment")]));
    assert_eq!(warnings(&page), "");
    assert!(page.contains("Title of m (N)") && page.contains("values from -0.1 to 0.2"));
}

#[test]
fn what_is_wrong_with_a_map_is_a_warning_and_the_rest_is_drawn() {
    let good = || panel("left", "height");
    let cases: Vec<(Value, &str, bool)> = vec![
        (json!({"maps": 3}), "expected a list of maps", false),
        (
            json!({"maps": [{"name": "m"}]}),
            "missing field `panels`",
            false,
        ),
        (
            a_map("mm", vec![good(), panel("middle", "height")]),
            "middle",
            true,
        ),
        (
            a_map("mm", vec![good(), panel("right", "moment")]),
            "no field 'moment'; its fields are: height",
            true,
        ),
        (
            a_map("mm", vec![good(), panel("left", "moment")]),
            "is in 'N', which cannot be shown in 'mm'",
            true,
        ),
        (
            a_map("mm", vec![good(), panel("left", "way")]),
            "3 components; expected one",
            true,
        ),
        (a_map("mm", vec![]), "no panel has a value", false),
        (
            a_map("mm", vec![good(); 14]),
            "the first 12 of its 14 panels",
            true,
        ),
    ];
    for (about, says, drawn) in cases {
        let page = page_with(&about);
        let told = warnings(&page);
        assert!(
            told.contains(says) && told.contains("step"),
            "{about}: no {says} in {told}"
        );
        assert_eq!(page.contains("Title of m (mm)"), drawn, "{about}");
        assert!(page.contains("id=\"costs\"") && !page.contains("NaN"));
    }
}

#[test]
fn tables_of_any_kind_of_artifact_are_shown() {
    let page = page_with(&json!({"tables": [{"name": "runs", "title": "All runs",
        "columns": [{"label": "run"}, {"label": "height", "unit": "m"}], "rows": [["a", 0.0031], ["b", null]]}]}));
    assert_eq!(warnings(&page), "");
    for text in ["All runs", "height (mm)", ">3.1</td>", "href=\"#plots\""] {
        assert!(page.contains(text), "{text}");
    }
}
