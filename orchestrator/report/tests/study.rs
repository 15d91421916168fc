//! The page of made-up studies, judged as text.

mod common;

use camino::{Utf8Path, Utf8PathBuf};
use common::family::{About, Out, alone, family, friction_map, grid, number, sample, sweep, texts};
use plyflow_model::units::si_number;
use plyflow_report::{Fate, ReportInput, write_report};
use std::collections::BTreeSet;
use std::sync::OnceLock;

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

/// The study of 208 points and its page, which several tests look at.
fn map() -> &'static (tempfile::TempDir, ReportInput, String) {
    static MAP: OnceLock<(tempfile::TempDir, ReportInput, String)> = OnceLock::new();
    MAP.get_or_init(|| {
        let (dir, folder) = folder();
        let input = friction_map(&folder);
        let text = page(&input, &folder);
        (dir, input, text)
    })
}

/// What stands between two texts, wherever the first stands.
fn all_between<'a>(text: &'a str, from: &str, to: &str) -> Vec<&'a str> {
    let pieces = text.split(from).skip(1);
    pieces
        .map(|p| p.split(to).next().unwrap_or_default())
        .collect()
}

/// A section of the page by its id.
fn section<'a>(page: &'a str, id: &str) -> &'a str {
    let start = page.find(&format!("id=\"{id}\"")).expect(id);
    let end = page[start..].find("<h2>").unwrap() + start + 4;
    let end = page[end..]
        .find("<h2>")
        .map_or(page.len(), |next| end + next);
    &page[start..end]
}

/// Texts without tags.
fn plain(markup: &str) -> String {
    let mut out = String::new();
    for piece in markup.split('<') {
        out += piece.split_once('>').map_or(piece, |p| p.1);
    }
    out.replace("&lt;", "<")
        .replace("&gt;", ">")
        .replace("&amp;", "&")
        .replace("&quot;", "\"")
}

fn rows(page: &str) -> Vec<&str> {
    let body = all_between(section(page, "points"), "<tbody>", "</tbody>")[0];
    all_between(body, "<tr ", "</tr>")
}

#[test]
fn the_table_has_a_row_for_every_point_with_the_numbers_of_the_study() {
    let (_, input, text) = map();
    let family = input.family.as_ref().unwrap();
    let rows = rows(text);
    assert_eq!(rows.len(), 208);
    for (row, point) in rows.iter().zip(&family.points) {
        let told = plain(row);
        assert!(told.contains(&point.name), "{told}");
        let values: Vec<&str> = all_between(row, "data-value=\"", "\"");
        let mut expected: Vec<String> = Vec::new();
        expected.extend(point.values.iter().filter_map(|v| match v {
            plyflow_report::Value::Number(v) => Some(si_number(*v)),
            _ => None,
        }));
        expected.extend(point.responses.iter().flatten().map(|v| si_number(*v)));
        assert_eq!(values[..expected.len()], expected, "{told}");
        match &point.fate {
            Fate::Failed { class, .. } => assert!(told.contains(&format!("failed: {class}"))),
            Fate::NotRun => assert!(told.contains("not run")),
            Fate::Done => assert!(told.contains("done")),
        }
        // What is not there is a dash, and never a number.
        let none = all_between(row, "class=\"n none\">", "<");
        let missing = point.responses.iter().filter(|r| r.is_none()).count();
        assert_eq!(none, vec!["–"; missing], "{told}");
    }
}

#[test]
fn failed_points_are_told_with_class_and_cause_and_drawn_as_crosses() {
    let text = &map().2;
    let failed = section(text, "failed");
    assert_eq!(
        all_between(failed, "<tr><th scope=\"row\">", "</tr>").len(),
        18
    );
    let told = plain(failed);
    assert!(
        told.contains("18 points of 208 failed: 16 of class error, 2 of class time-limit"),
        "{told}"
    );
    assert!(told.contains("a ply is folded at (0.1, 0.02) <sharp>"));
    assert!(plain(text).contains("208 points, 178 done, 18 failed, 12 not run"));
    // On the two maps of each response: one cross for each failed point, one open mark for each that has not run.
    let responses = section(text, "responses");
    assert_eq!(responses.matches("class=\"cross-halo\"").count(), 2 * 18);
    assert_eq!(
        responses.matches("<circle class=\"open-point\"").count(),
        2 * 12
    );
    assert_eq!(responses.matches("class=\"computed\"").count(), 2 * 178);
    // And in its own place.
    assert_eq!(text.matches("class=\"point failed\"").count(), 18);
}

#[test]
fn a_study_without_failed_points_has_no_such_section() {
    let (_dir, folder) = folder();
    let text = page(&texts(&folder), &folder);
    assert!(!text.contains("id=\"failed\"") && !text.contains("href=\"#failed\""));
    assert!(plain(&text).contains("12 points, 12 done"));
}

#[test]
fn a_page_of_200_points_with_pictures_is_below_5_mb_and_needs_nothing_else() {
    let text = &map().2;
    assert!(text.len() < 5_000_000, "{}", text.len());
    assert_eq!(text.matches("<img ").count(), 178);
    for address in all_between(text, "href=\"", "\"")
        .iter()
        .chain(&all_between(text, "src=\"", "\""))
    {
        let inside = address.starts_with('#') || address.starts_with("data:image/png;base64,");
        assert!(inside, "{address}");
    }
    for outside in [
        "http:",
        "https:",
        "@import",
        "fetch(",
        "XMLHttpRequest",
        "<link",
    ] {
        assert!(!text.contains(outside), "{outside}");
    }
}

#[test]
fn every_link_leads_to_a_place_that_is_there_once() {
    let (_dir, folder) = folder();
    let others = [sample(&folder, 60), alone(&folder)];
    let pages = others.iter().map(|input| (input, page(input, &folder)));
    for (input, text) in pages.chain([(&map().1, map().2.clone())]) {
        let places = all_between(&text, " id=\"", "\"");
        let once: BTreeSet<&str> = places.iter().copied().collect();
        assert_eq!(once.len(), places.len(), "an id stands twice");
        let links = all_between(&text, "href=\"#", "\"");
        let lost: Vec<&&str> = links.iter().filter(|l| !once.contains(**l)).collect();
        assert!(lost.is_empty(), "{lost:?}");
        for point in &input.family.as_ref().unwrap().points {
            let articles = all_between(section(&text, "places"), "<article ", "</article>");
            assert!(articles.iter().any(|a| plain(a).contains(&point.name)));
        }
    }
}

#[test]
fn the_same_study_has_the_same_bytes_on_any_number_of_threads() {
    let (_dir, folder) = folder();
    let (_, input, whole) = map();
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| page(input, &folder))
    };
    assert!(on(1) == *whole && on(3) == *whole, "the pages differ");
}

#[test]
fn all_pictures_have_one_view_one_size_and_the_order_of_the_table() {
    let (_dir, folder) = folder();
    let input = sweep(&folder, 5);
    let text = page(&input, &folder);
    let places = section(&text, "places");
    let sizes: BTreeSet<String> = (all_between(places, "<img ", ">").iter())
        .map(|i| {
            i.split("width=")
                .nth(1)
                .unwrap()
                .split(" alt")
                .next()
                .unwrap()
                .to_owned()
        })
        .collect();
    assert_eq!(sizes.len(), 1, "{sizes:?}");
    let alts = all_between(places, "alt=\"Formed ply at ", "\"");
    let expected: Vec<&str> = (input.family.as_ref().unwrap().points.iter())
        .filter(|p| p.fate == Fate::Done)
        .map(|p| p.name.as_str())
        .collect();
    assert_eq!(alts, expected);
    // Those of the same ply are the same picture, others are not: at 0 and 90 degrees it has no wave.
    let data = all_between(places, "src=\"", "\"");
    assert_eq!(data[0], data[data.len() - 1]);
    assert_ne!(data[0], data[9]);
}

/// Writes the artifact of a forming run anew, with attributes that are not of their form.
fn spoil(input: &ReportInput, instance: usize) {
    let instance = &input.instances[instance];
    assert_eq!(instance.record.kind, "forming");
    let path = instance.artifact.as_std_path();
    let mut w = plyflow_artifact::ArtifactWriter::create(path, "forming").unwrap();
    w.attributes(r#"{"sheets": [{"name": 3}]}"#).unwrap();
    w.finish(&serde_json::json!({})).unwrap();
}

#[test]
fn a_point_whose_sheet_cannot_be_read_is_named_and_the_others_have_their_pictures() {
    let (_dir, folder) = folder();
    let input = sweep(&folder, 15);
    let pictures = |text: &str| section(text, "places").matches("<img ").count();
    let all = pictures(&page(&input, &folder));
    // The one that is looked at first for what can be drawn.
    spoil(&input, 1);
    let text = page(&input, &folder);
    assert_eq!((all, pictures(&text)), (6, 5));
    assert!(
        text.contains("picture of angle=0deg: its attributes: invalid type"),
        "{text:.3000}"
    );
}

#[test]
fn a_study_none_of_whose_sheets_can_be_read_says_why_it_has_no_pictures() {
    let (_dir, folder) = folder();
    let input = sweep(&folder, 15);
    (1..input.instances.len()).for_each(|i| spoil(&input, i));
    let text = page(&input, &folder);
    assert!(!section(&text, "places").contains("<img "));
    let told =
        "no picture of a ply of the step formed: at angle=0deg: its attributes: invalid type";
    assert_eq!(text.matches(told).count(), 1, "{text:.3000}");
}

#[test]
fn points_that_repeat_have_bars_and_it_is_told_what_differs_among_them() {
    let (_dir, folder) = folder();
    let text = page(&texts(&folder), &folder);
    let told = plain(&text);
    assert!(
        told.contains("Up to 6 points have the same fabric and differ in lubricated and seed."),
        "{told}"
    );
    assert!(
        told.contains("Up to 4 points have the same seed and differ in fabric and lubricated.")
    );
    assert!(text.contains("class=\"spread\""));
    // Where no two points stand at one value there is no bar, and no line between points that differ in more.
    let sampled = page(&sample(&folder, 60), &folder);
    let responses = section(&sampled, "responses");
    assert!(plain(responses).contains("No two points with a value have the same friction. They differ in bending and pressure too."));
    let plots = responses.split("Which variables matter").next().unwrap();
    assert!(!plots.contains("class=\"spread\"") && !plots.contains("class=\"line"));
}

#[test]
fn a_line_is_parted_where_a_point_failed() {
    let (_dir, folder) = folder();
    let text = page(&sweep(&folder, 5), &folder);
    let line = all_between(&text, "class=\"line thin c0\" d=\"", "\"")[0];
    assert_eq!(line.matches('M').count(), 2, "{line}");
    assert_eq!(line.matches('L').count(), 16, "{line}");
}

#[test]
fn there_is_no_map_and_it_is_told_why_where_points_do_not_lie_on_a_plane() {
    let (_dir, folder) = folder();
    let told = plain(&page(&sample(&folder, 60), &folder));
    assert!(told.contains("No map over bending and friction; bending and pressure; friction and pressure: points that differ in these two alone are too few"), "{told}");
    assert!(!told.contains("Map of"));
}

#[test]
fn sensitivities_are_told_as_far_as_the_points_allow() {
    let (_dir, folder) = folder();
    // A whole grid: exact indices, also of texts.
    let told = plain(&page(&texts(&folder), &folder));
    assert!(told.contains("They are exact for this grid"));
    assert!(
        told.contains("The values of lubricated and fabric have no order"),
        "{told}"
    );
    // A grid with holes.
    let told = plain(&map().2);
    assert!(
        told.contains("Sobol indices of a grid need a value at every point; 30 points have none.")
    );
    assert!(told.contains("Of 208 points 178 have a value."));
    // A sample, large enough and too small.
    let told = plain(&page(&sample(&folder, 200), &folder));
    assert!(told.contains("First-order Sobol index"));
    let told = plain(&page(&sample(&folder, 40), &folder));
    assert!(
        told.contains("Sobol indices of a sample need 50 points with a value; there are"),
        "{told}"
    );
    assert!(told.contains("Rank correlation"));
    // Too few for anything.
    let told = plain(&page(&sweep(&folder, 45), &folder));
    assert!(told.contains("3 points have a value: a rank correlation needs 8."));
}

#[test]
fn one_point_alone_and_responses_without_values_are_told_in_words() {
    let (_dir, folder) = folder();
    let told = plain(&page(&alone(&folder), &folder));
    assert!(
        told.contains("1 point, 1 done")
            && told.contains("It is 100 mm at 1 point, so that there is nothing to plot."),
        "{told}"
    );
    assert!(told.contains("No point has a value of it."));
    assert!(!told.contains("NaN") && !told.contains("inf "));
}

#[test]
fn names_and_causes_from_files_are_escaped() {
    let (_dir, folder) = folder();
    for text in [&page(&texts(&folder), &folder), &map().2] {
        for raw in ["<300>", "<sharp>", "<folds>", "<study>"] {
            assert!(!text.contains(raw), "{raw}");
        }
    }
}

#[test]
fn warnings_of_points_are_counted_and_stand_in_their_places() {
    let text = &map().2;
    assert!(plain(text).contains("Steps of 24 of 208 points warn of something."));
    let articles = all_between(section(text, "places"), "<article ", "</article>");
    let warned = articles
        .iter()
        .filter(|a| plain(a).contains("the ply <folds>"));
    assert_eq!(warned.count(), 24);
}

#[test]
fn what_points_of_a_small_study_say_stands_in_their_places_too_and_not_before_the_table() {
    let (_dir, folder) = folder();
    let mut input = sweep(&folder, 45);
    let points = input.family.as_ref().unwrap().points.len();
    let warnings = &mut input.instances[0].record.warnings;
    warnings.push("the ply slides off".into());
    let text = page(&input, &folder);
    let (head, rest) = text.split_once("</header>").unwrap();
    let told = format!("of {points} points warn of something");
    assert!(plain(head).contains(&told), "{}", plain(head));
    assert!(!head.contains("the ply slides off") && !head.contains("kinetic"));
    assert!(section(rest, "places").contains("the ply slides off"));
}

#[test]
fn the_page_of_a_point_is_linked_where_it_was_written() {
    let (_dir, folder) = folder();
    let mut input = sweep(&folder, 45);
    let family = input.family.as_mut().unwrap();
    family.points[1].report = Some("report-points/angle=45deg.html".into());
    let text = page(&input, &folder);
    assert_eq!(
        text.matches("href=\"report-points/angle=45deg.html\"")
            .count(),
        1
    );
    assert_eq!(text.matches("Its own page").count(), 1);
    assert!(plain(&text).contains("--point 'angle=0deg'"));
}

#[test]
fn a_study_of_more_points_than_are_listed_says_so_and_no_link_is_lost() {
    let (_dir, folder) = folder();
    let steps = |n: usize| -> Vec<f64> { (0..n).map(|i| i as f64).collect() };
    let about = About {
        variables: &[("a", ""), ("b", "")],
        responses: &[("sum", "1")],
        plies: false,
    };
    let rows = grid(&[&steps(50), &steps(24)]);
    let input = family(&folder, &about, rows, |v| match number(&v[0]) {
        49.0 => Out::Failed("error", "late"),
        a => Out::Values(vec![Some(a + number(&v[1]))], 0.0),
    });
    let text = page(&input, &folder);
    assert!(text.len() < 2_000_000, "{}", text.len());
    assert_eq!(self::rows(&text).len(), 1000);
    assert!(plain(&text).contains("The first 1000 of 1200 points are listed here."));
    // The failed ones are the last: they are told without a link.
    assert!(plain(section(&text, "failed")).contains("a=49,b=23"));
    let places: BTreeSet<&str> = all_between(&text, " id=\"", "\"").into_iter().collect();
    let links = all_between(&text, "href=\"#", "\"");
    assert!(links.iter().all(|l| places.contains(l)));
    assert!(text.contains("class=\"computed-small\""));
}

#[test]
fn why_there_is_no_map_is_the_reason_of_these_points() {
    let (_dir, folder) = folder();
    let about = About {
        variables: &[("a", ""), ("b", ""), ("c", "")],
        responses: &[("sum", "1")],
        plies: false,
    };
    let five = [0.0, 1.0, 2.0, 3.0, 4.0];
    let rows = grid(&[&five, &[1.0, 2.0], &five]);
    let input = family(&folder, &about, rows, |v| {
        Out::Values(vec![Some(number(&v[0]) + number(&v[1]))], 0.0)
    });
    let told = plain(&page(&input, &folder));
    let why = "No map over a and b; b and c: points with a value have 2 values of a variable; a map needs 3.";
    assert!(told.contains(why), "{told}");
    assert!(told.contains("sum over a and c"), "{told}");
}
