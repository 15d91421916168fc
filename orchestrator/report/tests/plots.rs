//! Plots, files and numbers that artifacts carry, on the page.

mod common;

use camino::{Utf8Path, Utf8PathBuf};
use common::{Study, expectation};
use plyflow_report::{ReportInput, write_report};
use serde_json::{Value, json};

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

fn line(label: &str, x: &str, y: &str) -> Value {
    json!({"label": label, "x": x, "y": y})
}

fn a_plot(name: &str, series: Vec<Value>) -> Value {
    json!({"name": name, "title": format!("Title of {name}"), "x": {"label": "time", "unit": "ms"},
        "y": {"label": "displacement", "unit": "mm"}, "series": series})
}

/// The page of one step of a stranger's kind with these plots; arrays `t` (s), `u` (m) of 5 values, `angle` (rad).
fn page_with(plots: &Value) -> String {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    let arrays = [
        ("t", "s", vec![0.0, 0.1, 0.2, 0.3, 0.4]),
        ("u", "m", vec![0.0, 0.02, 0.01, -0.01, 0.04]),
        ("angle", "rad", vec![0.1; 5]),
        ("short", "m", vec![0.0, 1.0]),
        ("nothing", "m", vec![]),
        ("lost", "m", vec![1e200; 5]),
    ];
    let about = json!({ "plots": plots });
    study.artifact(("step", &[]), "a-stranger-s-kind", &arrays, &about, vec![]);
    let mut input = study.input();
    input.expectations.clear();
    page(&input, &folder)
}

fn warnings(page: &str) -> &str {
    let Some(start) = page.find("id=\"warnings\"") else {
        return "";
    };
    &page[start..start + page[start..].find("</section>").unwrap()]
}

#[test]
fn plots_of_any_kind_of_artifact_are_drawn_in_the_units_of_their_axes() {
    let page = page_with(&json!([a_plot("jump", vec![line("sensor <1>", "t", "u")])]));
    assert_eq!(warnings(&page), "");
    assert!(page.contains("href=\"#plots\"") && page.contains("id=\"plots\""));
    for text in [
        "Title of jump",
        "time (ms)",
        "displacement (mm)",
        "sensor &lt;1&gt;",
        // 0.4 s and 0.04 m.
        ">400</text>",
        ">40</text>",
    ] {
        assert!(page.contains(text), "{text}");
    }
    assert!(page.contains("aria-label=\"Title of jump: displacement (mm), from "));
    assert!(!page.contains("sensor <1>"));
}

#[test]
fn what_is_wrong_with_a_plot_is_a_warning_and_the_rest_is_drawn() {
    let good = || line("good", "t", "u");
    let cases: Vec<(Value, &[&str], bool)> = vec![
        (json!("force"), &["'plots' is a text", "a list"], false),
        (json!([5]), &["plot 1", "invalid type"], false),
        (
            json!([{"name": "p"}]),
            &["plot 1 'p'", "missing field `x`"],
            false,
        ),
        (
            json!([a_plot("p", vec![good(), line("bad", "t", "v")])]),
            &["plot 'p': series 2", "no array 'v'"],
            true,
        ),
        (
            json!([a_plot("p", vec![good(), line("bad", "t", "shrot")])]),
            &["no array 'shrot'", "did you mean 'short'"],
            true,
        ),
        (
            json!([a_plot("p", vec![good(), line("bad", "t", "short")])]),
            &["'t' has 5 values", "'short' has 2"],
            true,
        ),
        (
            json!([a_plot("p", vec![good(), line("bad", "t", "angle")])]),
            &["'angle' is in 'rad'", "cannot be shown in 'mm'"],
            true,
        ),
        (
            json!([a_plot("p", vec![good(), line("bad", "nothing", "nothing")])]),
            &["'nothing' is in 'm'", "in 'ms'"],
            true,
        ),
        (
            json!([a_plot("p", vec![good(), json!({"label": "bad", "x": "t"})])]),
            &["series 2", "missing field `y`"],
            true,
        ),
        (
            json!([a_plot(
                "p",
                vec![json!({"label": "s", "x": "t", "y": "u", "style": "doted"})]
            )]),
            &["the style 'doted'", "line, dashed, points, box"],
            true,
        ),
        (
            json!([a_plot(
                "p",
                vec![
                    good(),
                    json!({"label": "s", "x": "t", "y": "u", "style": "box"})
                ]
            )]),
            &["series 2", "'box' lists seven arrays"],
            true,
        ),
        (
            json!([a_plot(
                "p",
                vec![
                    good(),
                    json!({"label": "s", "x": "t", "y": ["u", "u"], "style": "box"})
                ]
            )]),
            &["series 2", "'box' a list of seven arrays"],
            true,
        ),
        (
            json!([a_plot(
                "p",
                vec![good(), json!({"label": "s", "x": "t", "y": vec!["u"; 7]})]
            )]),
            &["series 2", "lists seven arrays", "expected one"],
            true,
        ),
        (
            json!([{"name": "p", "x": {"label": "t", "unit": "sek"}, "y": {"label": "u", "unit": "mm"}, "series": [good()]}]),
            &["plot 'p'", "x axis", "unknown unit `sek`"],
            false,
        ),
        (
            json!([a_plot("p", vec![])]),
            &["no series has a value"],
            false,
        ),
        (
            json!([a_plot("p", vec![line("s", "t", "lost")])]),
            &["no series has a value"],
            false,
        ),
        (
            json!([a_plot("p", vec![good(); 14])]),
            &["the first 12 of its 14 series"],
            true,
        ),
    ];
    for (plots, says, drawn) in cases {
        let page = page_with(&plots);
        let told = warnings(&page).replace("&quot;", "\"");
        for text in says {
            assert!(told.contains(text), "{plots}: no {text} in {told}");
        }
        assert!(told.contains("step: "), "{told}: which step");
        assert_eq!(page.contains("Title of p</p>"), drawn, "{plots}");
        assert!(page.contains("id=\"costs\"") && !page.contains("NaN"));
    }
}

#[test]
fn a_sound_plot_beside_a_broken_one_is_drawn() {
    let page = page_with(&json!([
        a_plot("a", vec![line("s", "t", "no")]),
        a_plot("b", vec![line("s", "t", "u")])
    ]));
    assert!(page.contains("Title of b</p>") && !page.contains("Title of a</p>"));
}

#[test]
fn the_plot_of_a_long_history_is_small_and_shows_its_peak() {
    let n = 100_000;
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    let t: Vec<f64> = (0..n).map(|i| f64::from(i) * 1e-5).collect();
    let mut u: Vec<f64> = t.iter().map(|t| 1e-3 * (900.0 * t).sin()).collect();
    u[54_321] = 0.05;
    let arrays = [("t", "s", t), ("u", "m", u)];
    let series = (0..12).map(|_| line("s", "t", "u")).collect();
    let about = json!({"plots": [a_plot("long", series)]});
    study.artifact(("step", &[]), "any", &arrays, &about, vec![]);
    let page = page(&study.input(), &folder);
    assert!(page.len() < 600_000, "{} bytes", page.len());
    // 50 mm is the highest value: 4 % of the range below the upper edge of the field.
    let path = page.split("class=\"line c0\" d=\"").nth(1).unwrap();
    let path = &path[..path.find('"').unwrap()];
    let heights = path
        .split(['M', 'L'])
        .filter_map(|p| p.split(' ').nth(1)?.parse::<f64>().ok());
    let highest = heights.fold(f64::INFINITY, f64::min);
    assert!((16.0..30.0).contains(&highest), "{highest}");
}

#[test]
fn a_page_has_room_for_many_plots_and_says_when_it_is_full() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    let arrays = [("t", "s", vec![0.0, 1.0]), ("u", "m", vec![0.0, 1.0])];
    for i in 0..5 {
        let plots: Vec<Value> = (0..30)
            .map(|k| a_plot(&format!("{i}-{k}"), vec![line("s", "t", "u")]))
            .collect();
        let item = i.to_string();
        let about = json!({ "plots": plots });
        study.artifact(("step", &[&item]), "any", &arrays, &about, vec![]);
    }
    let page = page(&study.input(), &folder);
    assert_eq!(
        page.matches("<p class=\"plot-title\">Title of").count(),
        120
    );
    assert!(warnings(&page).contains("step[4]: 30 of its 30 plots are not drawn"));
}

#[test]
fn a_coupon_shows_its_numbers_beside_what_is_expected_its_curves_and_its_sheet() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.coupon();
    let mut input = study.input();
    let mut error = expectation("frame", "force_error", Some(0.0123), "1", true);
    (error.minimum, error.maximum) = (None, Some(0.03));
    let second = plyflow_report::Expectation {
        maximum: Some(0.01),
        source: Some("own bound".into()),
        met: false,
        ..error.clone()
    };
    let absent = expectation("frame", "hourglass", None, "m", false);
    input.expectations = vec![error, second, absent];
    let page = page(&input, &folder);
    let at = page.find("<table class=\"numbers\">").unwrap();
    let table = &page[at..at + page[at..].find("</table>").unwrap()];
    let rows: Vec<&str> = table.split("<tr>").skip(2).collect();
    assert_eq!(rows.len(), 4, "{table}");
    assert!(
        rows[0].contains("force_error") && rows[0].contains("≤ 0.03") && rows[0].contains("met")
    );
    assert!(
        rows[1].contains("≤ 0.01") && rows[1].contains("missed") && rows[1].contains("own bound")
    );
    assert!(rows[2].contains("wrinkle_onset") && rows[2].contains("8.0214 deg"));
    for text in ["hourglass", "not reported", "≤ 0.2 mm", "not judged"] {
        assert!(rows[3].contains(text), "{text}: {}", rows[3]);
    }
    for text in [
        "Picture frame, &quot;NCF&quot; &lt;both signs&gt;",
        "shear angle (deg)",
        "closed form",
        "class=\"line dashed c1\"",
        "class=\"points c2\"",
        "Deflection along z (mm)",
        "fabric, deformed, last frame",
        "plyflow extract workflow.yaml --set 'coarse.element=m4 &amp; &lt;x&gt;' 'frame'",
        "name: &lt;NCF&gt;",
        // Its energies stand with those of forming runs.
        "1.23 %",
        // Its element-steps with the costs: 1600 elements, 5000 steps.
        "<td class=\"n\">8.0</td>",
        "Kinetic over internal energy",
    ] {
        assert!(page.contains(text), "{text}");
    }
    // Shear and deflection on the flat sheet, and the deformed one.
    assert_eq!(page.matches("data:image/png;base64,").count(), 3);
}

#[test]
fn what_is_wrong_with_a_coupon_is_a_warning_and_its_energies_are_drawn_all_the_same() {
    let rows = |v: [f64; 3]| v.to_vec();
    let arrays = [
        ("history/time", "s", rows([0.0, 0.5, 1.0])),
        ("history/kinetic", "J", rows([0.0, 0.01, 0.0])),
        ("history/membrane", "J", rows([0.0, 0.5, 1.0])),
    ];
    let broken = json!([{"name": "p"}]);
    let energy = json!({"peak_drift_ratio": 0.0456});
    let cases = [
        (
            json!({"plots": broken, "energy": energy}),
            vec!["plot 1 'p'"],
        ),
        (
            json!({"plots": broken, "elements": "many"}),
            vec!["plot 1 'p'", "frame: its attributes"],
        ),
    ];
    for (about, says) in cases {
        let (_keep, folder) = folder();
        let mut study = Study::new(&folder);
        study.artifact(("frame", &[]), "coupon", &arrays, &about, vec![]);
        let mut input = study.input();
        input.expectations.clear();
        let page = page(&input, &folder);
        let told = warnings(&page);
        assert_eq!(told.matches("frame: ").count(), says.len(), "{told}");
        assert!(says.iter().all(|s| told.contains(s)), "{told}");
        assert!(page.contains("Kinetic over internal energy"), "{about}");
        assert_eq!(page.contains("4.56 %"), about["energy"].is_object());
    }
}

#[test]
fn a_characterisation_without_plots_shows_its_numbers_and_odd_files_are_a_warning() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    let both = json!({"name": "b", "text": "t", "array": "files/b"});
    let about = json!({"files": [{"name": "a"}, both, {"name": "whole.csv", "text": "t"}]});
    let results = vec![("bending_stiffness", 1e-3, "N m")];
    study.artifact(("peirce", &[]), "characterisation", &[], &about, results);
    let mut input = study.input();
    input.expectations.clear();
    let page = page(&input, &folder);
    assert!(page.contains("Tests and plots") && page.contains("bending_stiffness"));
    let told = warnings(&page);
    assert_eq!(
        told.matches("peirce: its attribute 'files'").count(),
        2,
        "{told}"
    );
    assert!(page.contains("whole.csv"), "the rest is shown");
}

#[test]
fn the_same_plots_give_the_same_bytes() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.coupon();
    let input = study.input();
    assert!(page(&input, &folder) == page(&input, &folder));
}
