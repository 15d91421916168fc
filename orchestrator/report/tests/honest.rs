//! A page never says that all is well where nobody looked.

mod common;

use camino::{Utf8Path, Utf8PathBuf};
use common::{Study, ZONES, expectation, whole};
use plyflow_model::job::NamedResult;
use plyflow_report::{ReportInput, summary, write_report};
use serde_json::json;

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

/// The section of a page.
fn section<'a>(page: &'a str, id: &str) -> &'a str {
    let start = page.find(&format!("<section id=\"{id}\">"));
    let rest = &page[start.unwrap_or_else(|| panic!("no section {id}"))..];
    &rest[..rest.find("</section>").unwrap()]
}

/// Verdicts in the head: class and text.
fn verdicts(page: &str) -> Vec<(&str, &str)> {
    let parts = page.split("<p class=\"verdict ").skip(1);
    parts
        .map(|p| {
            let (class, rest) = p.split_once("\">").unwrap();
            (class, rest.split_once("</p>").unwrap().0)
        })
        .collect()
}

/// What the first screen says of how far the run can be trusted: its tone and its sentences.
fn trust(page: &str) -> (&str, &str) {
    let (_, rest) = page.split_once("<div id=\"trust\">").unwrap();
    let text = rest.split_once("</div>").unwrap().0;
    let (_, tone) = text.split_once("<p class=\"state ").unwrap();
    (tone.split_once('"').unwrap().0, text)
}

/// What the first screen says was found.
fn found(page: &str) -> &str {
    let (_, rest) = page.split_once("<div id=\"bad-places\">").unwrap();
    rest.split_once("</div>").unwrap().0
}

/// Coarse run, detection, no zone, and a comparison with a reference that has defects of its own.
fn without_zones(folder: &Utf8Path, missed: [f64; 2]) -> ReportInput {
    let mut study = Study::new(folder);
    study.forming("coarse", None, 0.008);
    study.defects(true);
    study.zones(&[]);
    study.forming("whole", None, 0.008);
    let reference = [("reference", "whole")];
    study.compared("compare", ["coarse", "local"], &[], &reference);
    let mut input = study.input();
    input.expectations.clear();
    report_missed(&mut input, missed);
    input
}

fn report_missed(input: &mut ReportInput, missed: [f64; 2]) {
    let mut instances = input.instances.iter_mut();
    let comparison = instances.find(|i| i.record.kind == "comparison").unwrap();
    let named = ["missed_wrinkles", "missed_bridging"]
        .into_iter()
        .zip(missed);
    let results = named.map(|(name, value)| NamedResult {
        name: name.into(),
        value,
        unit: "1".into(),
        measured: false,
    });
    comparison.record.results.extend(results);
}

#[test]
fn defects_of_the_reference_are_told_where_there_is_no_zone_to_list_them_in() {
    let (_keep, folder) = folder();
    let input = without_zones(&folder, [2.0, 1.0]);
    let page = page(&input, &folder);
    let (class, text) = trust(&page);
    assert_eq!(class, "found");
    assert!(
        text.contains("2 wrinkles and 1 bridging area of the reference missed"),
        "{text}"
    );
    assert!(found(&page).contains("No zones, no local runs."));
    let table = section(&page, "defects-0");
    assert!(table.contains("Nothing was compared: there are no zones."));
    assert!(
        table.contains("what lies outside of the zones is not listed"),
        "{table}"
    );
    for text in ["No wrinkle and no bridging", "o defects found"] {
        assert!(!page.contains(text), "{text}");
    }
    let told = summary(&input, None);
    assert!(
        told.contains("2 wrinkles and 1 bridging area of the reference missed"),
        "{told}"
    );
    assert!(!told.contains("no defects found"), "{told}");
}

#[test]
fn without_zones_and_without_defects_of_the_reference_nothing_was_compared() {
    let (_keep, folder) = folder();
    let page = page(&without_zones(&folder, [0.0, 0.0]), &folder);
    assert_eq!(trust(&page).0, "good");
    assert!(found(&page).contains("No defects found"));
    // That nothing was found makes no part good that has no limits.
    assert_eq!(verdicts(&page)[0].0, "found");
    let table = section(&page, "defects-0");
    assert!(table.contains("Nothing was compared"));
    assert!(!table.contains("missed") && !table.contains("No wrinkle"));
}

#[test]
fn an_empty_table_of_defects_speaks_of_the_zones_alone() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.forming("coarse", None, 0.008);
    study.defects(false);
    study.zones(&ZONES[..1]);
    // It found nothing: the zone has no local run.
    study.compared("compare", ["coarse", "local"], &[], &[]);
    let mut input = study.input();
    report_missed(&mut input, [0.0, 3.0]);
    let page = page(&input, &folder);
    let table = section(&page, "defects-0");
    assert!(table.contains("No wrinkle and no bridging was found in the zones"));
    assert!(table.contains("3 bridging areas of the reference <strong>missed</strong>"));
    assert!(
        trust(&page)
            .1
            .contains("3 bridging areas of the reference missed")
    );
}

#[test]
fn what_has_no_value_is_not_judged_and_counted_by_itself() {
    let (_keep, folder) = folder();
    let mut input = whole(&folder);
    let one = page(&input, &folder);
    let table = section(&one, "expectations");
    let row = |name: &str| {
        let rows = table.split("<tr>");
        rows.into_iter().find(|r| r.contains(name)).unwrap()
    };
    assert!(row("penetration_max").contains("✗ missed"));
    let open = row("no_such");
    assert!(open.contains("<td class=\"open\">– not judged</td>") && !open.contains("missed"));
    let told = summary(&input, None);
    let line = told.lines().find(|l| l.contains("no_such")).unwrap();
    assert!(line.ends_with("not judged"), "{line}");
    // Alone they are no missed ones, and not all is well either.
    input.expectations.retain(|e| e.result != "penetration_max");
    let page = page(&input, &folder);
    assert_eq!(
        verdicts(&page)[1],
        ("run bad", "1 of 2 expectations not judged")
    );
}

#[test]
fn what_another_item_has_not_reported_is_not_in_the_table_of_this_one() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    let results = || vec![("modulus", 3e9, "Pa")];
    for item in ["a", "b"] {
        study.artifact(("test", &[item]), "coupon", &[], &json!({}), results());
    }
    let mut input = study.input();
    let of = |item: &[&str], name: &str, got: Option<f64>| plyflow_report::Expectation {
        item: item.iter().map(|i| (*i).to_owned()).collect(),
        ..expectation("test", name, got, "Pa", true)
    };
    input.expectations = vec![
        of(&["a"], "modulus", Some(3e9)),
        of(&["b"], "modulus", Some(3e9)),
        // Of an item that has not run, and of those that are not known yet.
        of(&["c"], "modulus", None),
        of(&[], "modulus", None),
        of(&[], "strength", None),
    ];
    let page = page(&input, &folder);
    let tables: Vec<&str> = page.split("<table class=\"numbers\">").skip(1).collect();
    assert_eq!(tables.len(), 2);
    for table in tables {
        let table = &table[..table.find("</table>").unwrap()];
        assert_eq!(table.matches("met</td>").count(), 1, "{table}");
        assert_eq!(table.matches("not judged").count(), 1, "{table}");
        assert!(table.contains("strength"), "{table}");
    }
}

#[test]
fn the_page_says_when_its_steps_ran_by_their_records() {
    let (_keep, folder) = folder();
    let mut input = whole(&folder);
    for (i, instance) in input.instances.iter_mut().enumerate() {
        instance.record.started = 1_767_225_599.0 - 3600.0 * i as f64;
    }
    let hours = input.instances.len() as i64 - 1;
    assert_eq!(hours, 7);
    let two = page(&input, &folder);
    assert!(section(&two, "provenance").contains(
        "The first of its steps began at 2025-12-31 16:59 UTC, the last at 2025-12-31 23:59 UTC."
    ));
    for instance in &mut input.instances {
        instance.record.started = 1_709_210_096.0;
    }
    let one = page(&input, &folder);
    assert!(section(&one, "provenance").contains("Its steps began at 2024-02-29 12:34 UTC."));
}

#[test]
fn of_several_comparisons_one_is_drawn_by_name_and_the_others_are_told() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.forming("coarse", None, 0.008);
    study.forming("heavy", None, 0.008);
    study.defects(false);
    study.zones(&ZONES[..1]);
    study.boundary("A");
    study.forming("local[A]", Some(ZONES[0]), 0.004);
    study.kinetic_bound_kept = false;
    study.forming("placed[A]", Some(ZONES[0]), 0.004);
    // The first in the workflow has another global run, so it is not the one of this study.
    study.compared("of_heavy", ["heavy", "placed"], &ZONES[..1], &[]);
    study.compared("demo", ["coarse", "local"], &ZONES[..1], &[]);
    study.compared("later", ["coarse", "local"], &ZONES[..1], &[]);
    let input = study.input();
    let page = page(&input, &folder);
    let defects = section(&page, "defects-0");
    for text in [
        "Step <code>demo</code>.",
        "are not drawn: <code>of_heavy</code>, <code>later</code>.",
        "<th>AW1</th>",
    ] {
        assert!(defects.contains(text), "{text} in {defects}");
    }
    let energy = section(&page, "energy");
    let (_, health) = energy.split_once("<tbody>").unwrap();
    let health = &health[..health.find("</table>").unwrap()];
    assert_eq!(health.matches("<th>placed[A]</th>").count(), 1, "{health}");
    assert_eq!(health.matches("<th>local[A]</th>").count(), 1, "{health}");
    // A table of numbers, no plots.
    assert!(energy.contains("<h3><code>local[A]</code></h3>"));
    assert!(!energy.contains("<h3><code>placed[A]</code></h3>"));
    assert!(
        trust(&page)
            .1
            .contains("inetic bound missed by 1 of 3 runs (first: placed[A])")
    );
    let told = summary(&input, None);
    assert!(
        told.contains("defects as in demo; not listed: those of of_heavy, later"),
        "{told}"
    );
}

#[test]
fn the_reference_counts_in_the_verdict() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.forming("coarse", None, 0.008);
    study.defects(false);
    study.zones(&ZONES[..1]);
    study.boundary("A");
    study.forming("local[A]", Some(ZONES[0]), 0.004);
    study.kinetic_bound_kept = false;
    study.forming("whole", None, 0.008);
    let reference = [("reference", "whole")];
    study.compared("compare", ["coarse", "local"], &ZONES[..1], &reference);
    let page = page(&study.input(), &folder);
    let (class, text) = trust(&page);
    assert_eq!(class, "bad");
    assert!(verdicts(&page)[0].1.contains("not to be trusted"));
    assert!(
        text.contains("inetic bound missed by 1 of 3 runs (first: reference)"),
        "{text}"
    );
}

#[test]
fn ranges_beside_the_maps_of_the_global_run_are_its_own() {
    let (_keep, folder) = folder();
    let range = |page: &str, id: &str| {
        let section = section(page, id);
        let (_, field) = section.split_once("<b>mm</b>; values ").unwrap();
        field.chars().take(16).collect::<String>()
    };
    let with_zones = page(&whole(&folder), &folder);
    let mut alone = Study::new(&folder);
    alone.forming("coarse", None, 0.004);
    alone.defects(false);
    let alone = page(&alone.input(), &folder);
    assert_eq!(range(&with_zones, "maps-0"), range(&alone, "maps-0"));
    // The finer runs have the higher peak, and are in the 3D view.
    assert_ne!(range(&with_zones, "maps-0"), range(&with_zones, "view-0"));
}

#[test]
fn a_drape_has_dashes_for_time_steps() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    let mut w = study.create("drape", "forming");
    let about =
        json!({"scene": "s", "sheets": [], "element_size": 0.008, "zone": null, "elements": 480});
    w.attributes(&about.to_string()).unwrap();
    study.finish(w, ("drape", &[]), "forming", &[], vec![]);
    let page = page(&study.input(), &folder);
    let costs = section(&page, "costs");
    let (_, row) = costs.split_once("<th>drape</th>").unwrap();
    let row = &row[..row.find("</tr>").unwrap()];
    let cells: Vec<&str> = row.split("<td class=\"n\">").skip(1).collect();
    let text = |k: usize| cells[k].split('<').next().unwrap();
    assert_eq!([0, 1, 2, 7].map(text), ["480", "–", "–", "–"], "{row}");
}

#[test]
fn added_up_times_are_called_so() {
    let (_keep, folder) = folder();
    let input = whole(&folder);
    let page = page(&input, &folder);
    assert!(section(&page, "costs").contains("<th>all steps, times added up</th>"));
    assert!(summary(&input, None).contains("\nall, times added up"));
}

#[test]
fn commands_on_the_page_repeat_the_options_of_the_workflow() {
    let (_keep, folder) = folder();
    let page = page(&whole(&folder), &folder);
    let options = "workflow.yaml --set 'coarse.element=m4 &amp; &lt;x&gt;'";
    assert!(section(&page, "provenance").contains(&format!("<code>plyflow run {options}</code>")));
}

#[test]
fn a_page_whose_pictures_had_to_be_coarse_says_so_and_one_that_is_still_too_large_warns() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.forming("coarse", None, 0.008);
    study.defects(false);
    let mut input = study.input();
    let fine = page(&input, &folder);
    assert!(!fine.contains("id=\"coarser\"") && !fine.contains("is larger than"));
    let filled = 5_000_000;
    input.description = Some("x".repeat(filled));
    let too_large = page(&input, &folder);
    let warnings = &too_large[too_large.find("id=\"warnings\"").unwrap()..];
    assert!(warnings.contains("is larger than 4.3 MiB even with its coarsest pictures"));
    assert!(too_large.contains("id=\"coarser\""));
    // Room for the coarsest pictures and for none that are finer by much.
    let filled = 4_500_000 - (too_large.len() - filled);
    input.description = Some("x".repeat(filled));
    let coarse = page(&input, &folder);
    assert!(coarse.len() <= 4_500_000, "{}", coarse.len());
    assert!(!coarse.contains("is larger than"));
    let (_, note) = coarse.split_once("id=\"coarser\">").unwrap();
    let note = &note[..note.find("</p>").unwrap()];
    let in_full = (fine.len() + filled) as f64 / f64::from(1 << 20);
    assert!(
        note.contains(&format!("in full this page would have {in_full:.1} MiB")),
        "{note}"
    );
    assert!(note.contains("ParaView"), "{note}");
}
