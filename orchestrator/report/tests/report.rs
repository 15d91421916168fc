//! The page of made-up runs, judged as text.

mod common;

use camino::{Utf8Path, Utf8PathBuf};
use common::{Study, whole};
use plyflow_model::job::NamedResult;
use plyflow_report::{ReportInput, is_current, summary, write_report};

fn folder() -> (tempfile::TempDir, Utf8PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = Utf8PathBuf::from_path_buf(dir.path().to_owned()).unwrap();
    (dir, path)
}

fn page(input: &ReportInput, folder: &Utf8Path) -> String {
    let out = folder.join("out/report.html");
    let size = write_report(input, &out).unwrap();
    let text = std::fs::read_to_string(&out).unwrap();
    assert_eq!(text.len() as u64, size);
    let left: Vec<_> = std::fs::read_dir(folder.join("out")).unwrap().collect();
    assert_eq!(left.len(), 1, "no temporary file is left behind");
    text
}

/// The page without what stands in its scripts, and that.
fn parted(page: &str) -> (String, Vec<&str>) {
    let (mut rest, mut markup, mut scripts) = (page, String::new(), Vec::new());
    while let Some(at) = rest.find("<script") {
        let start = at + rest[at..].find('>').unwrap() + 1;
        let end = start + rest[start..].find("</script>").unwrap();
        markup += &rest[..start];
        scripts.push(&rest[start..end]);
        rest = &rest[end..];
    }
    (markup + rest, scripts)
}

/// Tags that are opened are closed, in order.
fn assert_well_formed(page: &str) {
    let page = &parted(page).0;
    let void = ["meta", "br", "img", "link", "input", "wbr"];
    let mut open: Vec<&str> = Vec::new();
    for piece in page.split('<').skip(1) {
        let end = piece.find(['>', ' ', '\n']).unwrap_or(piece.len());
        let name = &piece[..end];
        if let Some(closed) = name.strip_prefix('/') {
            assert_eq!(
                open.pop(),
                Some(closed),
                "at ...<{}",
                &piece[..piece.len().min(80)]
            );
        } else if !name.starts_with('!') && !void.contains(&name) {
            open.push(name);
        }
    }
    assert_eq!(open, Vec::<&str>::new());
}

/// Nothing is fetched: no address but pictures inside and places on the page.
fn assert_self_contained(page: &str) {
    let (page, scripts) = parted(page);
    let page = &page;
    for way in [
        "fetch(",
        "XMLHttpRequest",
        "WebSocket",
        "import(",
        "sendBeacon",
        "EventSource",
    ] {
        assert!(
            scripts.iter().all(|s| !s.contains(way)),
            "a script with {way}"
        );
    }
    assert!(!page.contains(" src="), "something is loaded");
    for attribute in ["href=\"", "src=\"", "url(", "@import", "srcset"] {
        for (at, _) in page.match_indices(attribute) {
            let target = &page[at + attribute.len()..];
            let target = &target[..target.len().min(24)];
            let inside = target.starts_with('#') || target.starts_with("data:image/png;base64,");
            assert!(inside, "{attribute}{target}");
        }
    }
    assert!(
        !page.contains("http:") && !page.contains("https:"),
        "an address of the network"
    );
    assert!(!page.contains("<link"));
}

#[test]
fn a_whole_study_shows_every_section_in_one_file_without_network() {
    let (_keep, folder) = folder();
    let page = page(&whole(&folder), &folder);
    assert_well_formed(&page);
    assert_self_contained(&page);
    assert!(page.len() < 5_000_000, "{} bytes", page.len());
    for id in [
        "view-0",
        "maps-0",
        "local-0",
        "defects-0",
        "expectations",
        "costs",
        "energy",
        "results",
        "provenance",
    ] {
        assert!(page.contains(&format!("id=\"{id}\"")), "section {id}");
        assert!(page.contains(&format!("href=\"#{id}\"")), "link to {id}");
    }
    // 3 quantities on 2 plies, flat and formed from two sides; per zone and ply 3 flat and 1 formed; the tool among what went in.
    assert_eq!(page.matches("data:image/png;base64,").count(), 18 + 16 + 1);
    assert!(page.contains("2 zones; 2 wrinkles, longest 68.4 mm; 2 bridging areas."));
    assert!(page.contains("Kinetic energy at most 2.3 % of internal (bound 5 %)."));
    assert!(page.contains("1 of 3 expectations missed, 1 not judged"));
    for unit in [
        "deg",
        "mm",
        "1/mm",
        "energy (J)",
        "pressure (kPa)",
        "height (mm)",
    ] {
        assert!(page.contains(unit), "{unit}");
    }
}

#[test]
fn local_and_global_measures_of_a_defect_stand_in_one_row() {
    let (_keep, folder) = folder();
    let page = page(&whole(&folder), &folder);
    let start = page.find("<table class=\"defects\">").unwrap();
    let table = &page[start..start + page[start..].find("</table>").unwrap()];
    let row = |id: &str| {
        let at = table.find(&format!("<th>{id}</th>")).unwrap();
        &table[at..at + table[at..].find("</tr>").unwrap()]
    };
    assert!(
        row("AW1").contains(">68.4<") && row("AW1").contains(">52.3<"),
        "{}",
        row("AW1")
    );
    assert!(
        row("AB1").contains(">410</td><td class=\"n\">–<"),
        "{}",
        row("AB1")
    );
    for (id, text) in [
        ("AW1", ">5.8<"),
        ("AW1", ">-29<"),
        ("AW1", ">2.9 (1.1 … 5.2)<"),
        ("AW1", ">bridging</td>"),
    ] {
        assert!(row(id).contains(text), "{text}: {}", row(id));
    }
    assert!(row("BW1").contains("reaches the cut") && !row("AW1").contains("reaches the cut"));
    let order: Vec<usize> = ["AW1", "AB1", "BW1", "BB1"]
        .iter()
        .map(|id| table.find(&format!("<th>{id}</th>")).unwrap())
        .collect();
    assert!(
        order.windows(2).all(|w| w[0] < w[1]),
        "by zone, wrinkles first"
    );
}

#[test]
fn what_overlapped_beyond_its_bound_on_the_way_is_marked_in_the_table_of_penetrations() {
    let (_keep, folder) = folder();
    let page = page(&whole(&folder), &folder);
    let (_, table) = page.split_once("<h3>Penetration</h3>").expect("a table");
    let (table, _) = table.split_once("</table>").expect("its end");
    assert!(table.contains("(bound 10 %)"), "{table}");
    let row = table.split("<tr>").find(|r| r.contains("tool/ply_1"));
    let row = row.expect("a row of the pair");
    assert!(row.contains(r#"<td class="n">4.21 %</td>"#), "{row}");
    assert!(
        row.contains(r#"<td class="n missed">11.53 %</td>"#),
        "{row}"
    );
    assert!(row.contains(">0.188<") && row.contains(">0.33<"), "{row}");
    // A pair of a program from before that told peaks has none.
    let other = table.split("<tr>").find(|r| r.contains("ply_1/ply_2"));
    assert!(other.expect("a row").contains("–"));
}

#[test]
fn what_the_watch_found_beyond_its_bound_is_marked_in_the_table_of_depths() {
    let (_keep, folder) = folder();
    let page = page(&whole(&folder), &folder);
    let (_, table) = page.split_once("<h3>Depth</h3>").expect("a table");
    let (table, _) = table.split_once("</table>").expect("its end");
    let row = |pair: &str| {
        let row = table.split("<tr>").find(|r| r.contains(pair));
        row.expect("a row of the pair").to_owned()
    };
    let deep = row("tool/ply_1");
    assert!(deep.contains(r#"<td class="n missed">0.06</td>"#), "{deep}");
    assert!(
        deep.contains("15.00 %") && deep.contains("12.3, 0.0, 20.0"),
        "{deep}"
    );
    assert!(
        deep.contains("22.50 %") && deep.contains(">0.188<"),
        "{deep}"
    );
    // What may be of any depth is marked by no bound.
    let hangs = row("between_nodes");
    assert!(!hangs.contains("missed") && hangs.contains("–"), "{hangs}");
}

#[test]
fn texts_from_files_are_escaped_everywhere() {
    let (_keep, folder) = folder();
    let mut input = whole(&folder);
    input
        .failures
        .push(("s[<i>]".into(), "died of <script>alert(1)</script>".into()));
    input.fingerprint = "\"><script>".into();
    let page = page(&input, &folder);
    assert_well_formed(&page);
    let scripts = page.matches("<script").count();
    assert_eq!(
        scripts, 5,
        "the page's own scripts and the data of one view"
    );
    assert!(!page.contains("<demo>") && !page.contains("<upper>"));
    assert!(page.contains("half-pipe &lt;demo&gt; &amp; co"));
    assert!(page.contains("the film &lt;upper&gt; is stretched by 61 %"));
    assert!(page.contains("died of &lt;script&gt;"));
}

#[test]
fn a_run_without_zones_says_so_in_words() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.forming("coarse", None, 0.004);
    study.defects(true);
    study.zones(&[]);
    let input = study.input();
    let page = page(&input, &folder);
    assert_well_formed(&page);
    // A sentence on what was found, and one on whether it can be trusted.
    let words = page.to_lowercase();
    for says in [
        "no defects found: no zones, no local runs",
        "kinetic energy at most 2.3 % of internal (bound 5 %)",
    ] {
        assert!(words.contains(says), "{says}");
    }
    assert!(!page.contains("id=\"local-0\"") && !page.contains("id=\"defects-0\""));
    let text = summary(&input, None);
    assert!(
        text.contains("no defects found: no zones, no local runs"),
        "{text}"
    );
}

#[test]
fn local_runs_are_shown_without_a_comparison() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.forming("coarse", None, 0.008);
    study.defects(false);
    study.zones(&common::ZONES[..1]);
    study.boundary("A");
    study.forming("local[A]", Some(common::ZONES[0]), 0.004);
    let page = page(&study.input(), &folder);
    assert!(page.contains("Zone A") && !page.contains("id=\"defects-0\""));
    // The shear alone is known of the local run: flat and formed, on two plies.
    assert_eq!(page.matches("data:image/png;base64,").count(), 18 + 4 + 1);
    // Nobody has looked for wrinkles in it.
    assert_eq!(page.matches(": not compared").count(), 2);
    assert!(!page.contains("no wrinkle, no bridging") && !page.contains("outlines: wrinkles"));
}

#[test]
fn a_zone_that_the_comparison_lacks_is_not_called_free_of_wrinkles() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.forming("coarse", None, 0.008);
    study.defects(false);
    study.zones(&common::ZONES);
    for (zone, bounds) in common::ZONES {
        study.boundary(zone);
        study.forming(&format!("local[{zone}]"), Some((zone, bounds)), 0.004);
    }
    study.comparison(&common::ZONES[..1]);
    let page = page(&study.input(), &folder);
    let (_, local) = page.split_once("id=\"local-0\"").unwrap();
    let (a, b) = local.split_once("Zone B").unwrap();
    assert!(a.contains(" found") && !a.contains("not compared"));
    assert_eq!(b.matches(": not compared").count(), 2);
}

#[test]
fn a_local_run_whose_zone_cannot_be_read_is_told_and_the_others_are_shown() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.forming("coarse", None, 0.008);
    study.defects(false);
    study.zones(&common::ZONES);
    for (zone, bounds) in common::ZONES {
        study.boundary(zone);
        study.forming(&format!("local[{zone}]"), Some((zone, bounds)), 0.004);
    }
    let mut torn = study.create("local[B]", "forming");
    torn.attributes(r#"{"sheets": [], "zone": {"name": "B"}}"#)
        .unwrap();
    let local = study.instances.pop().unwrap();
    study.finish(
        torn,
        ("local", &["B"]),
        "forming",
        &[("boundary", "boundary[B]")],
        vec![],
    );
    assert_eq!(study.instances.last().unwrap().label(), local.label());
    let text = page(&study.input(), &folder);
    assert!(text.contains("local[B]: its attribute 'zone': missing field `box`"));
    assert!(text.contains("Zone A") && !text.contains("Zone B"));
}

#[test]
fn a_press_shows_the_force_of_its_punch_and_no_pressures() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.press = true;
    study.forming("coarse", None, 0.008);
    let page = page(&study.input(), &folder);
    let (_, energy) = page.split_once("id=\"energy\"").unwrap();
    for text in [
        "Force of the punch",
        "force (N)",
        "punch, from its end",
        "holder",
    ] {
        assert!(energy.contains(text), "{text}");
    }
    assert!(!energy.contains("Pressures") && !energy.contains("Frame height"));
}

#[test]
fn of_several_runs_of_a_zone_the_finest_is_shown_and_with_a_comparison_the_compared_one() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.forming("coarse", None, 0.008);
    study.defects(false);
    study.zones(&common::ZONES[..1]);
    study.boundary("A");
    // In the order in which a study lists its steps.
    study.forming("rough[A]", Some(common::ZONES[0]), 0.006);
    study.forming("local[A]", Some(common::ZONES[0]), 0.004);
    study.forming("fine[A]", Some(common::ZONES[0]), 0.002);
    let mut compared = Study::new(&folder);
    compared.instances = study.instances.clone();
    let alone = page(&study.input(), &folder);
    let shown = |page: &str, size: &str| page.contains(&format!("elements of {size} mm"));
    assert_eq!(alone.matches("data:image/png;base64,").count(), 18 + 4 + 1);
    assert!(shown(&alone, "2") && !shown(&alone, "4") && !shown(&alone, "6"));
    compared.comparison(&common::ZONES[..1]);
    let beside = page(&compared.input(), &folder);
    assert!(shown(&beside, "4") && !shown(&beside, "2") && !shown(&beside, "6"));
}

#[test]
fn each_list_of_zones_that_a_detection_led_to_is_a_study_and_zones_drawn_again_belong_to_theirs() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.forming("coarse", None, 0.008);
    study.defects(false);
    study.zones(&common::ZONES);
    let mut more = Study::new(&folder);
    more.instances = study.instances.clone();
    let one = page(&study.input(), &folder);
    more.zones_of("tight", &[("defects", "detect")], &common::ZONES[1..]);
    let drawn_again = [("defects", "detect"), ("zones", "zones")];
    more.zones_of("again", &drawn_again, &[("A", [-0.1, -0.08, 0.0, 0.0])]);
    let several = page(&more.input(), &folder);
    let titles = |page: &str| -> Vec<String> {
        let parts = page.split("<h2 class=\"study\">").skip(1);
        parts
            .map(|p| p.split('<').next().unwrap().to_owned())
            .collect()
    };
    assert_eq!(titles(&one), [""; 0]);
    assert_eq!(
        titles(&several),
        ["coarse, detect, again", "coarse, detect, tight"]
    );
    // A and B of the first, the one of the second.
    assert_eq!(several.matches("<tr><th>A</th>").count(), 1);
    assert_eq!(several.matches("<tr><th>B</th>").count(), 2);
}

#[test]
fn unknown_kinds_are_listed_with_their_results_and_costs() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.stranger();
    let mut input = study.input();
    input.expectations.clear();
    let page = page(&input, &folder);
    assert_well_formed(&page);
    for text in [
        "coupon-test",
        "modulus",
        "array curve/force [2] N",
        "12.5 s",
        "300.0 MiB",
    ] {
        assert!(page.contains(text), "{text}");
    }
    assert!(!page.contains("<b>me</b>"));
    assert!(summary(&input, None).contains("coupon.modulus"));
}

#[test]
fn an_unreadable_artifact_is_a_warning_and_the_rest_is_shown() {
    let (_keep, folder) = folder();
    let input = whole(&folder);
    std::fs::write(folder.join("compare.h5"), b"torn").unwrap();
    let page = page(&input, &folder);
    assert!(page.contains("id=\"warnings\"") && page.contains("is not a Plyflow artifact"));
    assert!(page.contains("id=\"maps-0\"") && page.contains("id=\"local-0\""));
}

#[test]
fn the_same_run_gives_the_same_bytes_and_its_fingerprint_is_found() {
    let (_keep, folder) = folder();
    let input = whole(&folder);
    let first = page(&input, &folder);
    assert!(first == page(&input, &folder));
    let out = folder.join("out/report.html");
    assert!(is_current(&out, "0123abcd"));
    assert!(!is_current(&out, "0123abce"));
    assert!(!is_current(&folder.join("none.html"), "0123abcd"));
}

#[test]
fn the_terminal_table_names_defects_missed_expectations_and_the_report() {
    let (_keep, folder) = folder();
    let text = summary(&whole(&folder), Some("out/report.html".into()));
    for part in [
        "2 zones",
        "AW1",
        "68.4 mm",
        "coarse.penetration_max",
        "missed",
        "warning: coarse: the film",
    ] {
        assert!(text.contains(part), "{part} in\n{text}");
    }
    assert!(text.ends_with("report: out/report.html\n"));
}

#[test]
fn what_was_compared_with_a_reference_shows_its_speed_against_its_error() {
    let (_dir, folder) = folder();
    let mut input = whole(&folder);
    assert!(!page(&input, &folder).contains("Speed against error"));
    let comparison = input
        .instances
        .iter_mut()
        .find(|i| i.record.kind == "comparison");
    let results = &mut comparison.unwrap().record.results;
    let told = [
        ("cost.global.cpu_seconds", 100.0),
        ("cost.global.wall_seconds", 60.0),
        ("cost.total.cpu_seconds", 900.0),
        ("cost.total.wall_seconds", 500.0),
        ("cost.reference.cpu_seconds", 7200.0),
        ("cost.reference.wall_seconds", 3700.0),
        ("defect_error", 0.071),
        ("defect_error.global", 0.64),
        ("wrinkle_length_error", 0.06),
        ("defect_total_error", 0.043),
        ("defect_total_error.global", 0.71),
        ("wrinkle_length_total_error", 0.038),
        ("wrinkle_class_from.medium", 0.02),
        ("wrinkle_class_from.long", 0.04),
        ("wrinkle_pairs.short", 4.0),
        ("missed_wrinkles.short", 0.0),
        ("false_wrinkles.short", 1.0),
        ("wrinkle_length_error.short", 0.312),
        ("missed_wrinkles", 0.0),
        ("false_wrinkles", 1.0),
        ("missed_bridging", 0.0),
        ("false_bridging", 2.0),
    ];
    results.retain(|r| told.iter().all(|t| t.0 != r.name));
    results.extend(told.map(|(name, value)| NamedResult {
        name: name.into(),
        value,
        unit: "1".into(),
        measured: name.starts_with("cost"),
    }));
    let page = page(&input, &folder);
    assert_well_formed(&page);
    assert_self_contained(&page);
    for text in [
        "Speed against error",
        "coarse run and zones",
        "12.5 %",
        "7.1 %",
        "For a mean and a total error of 10 % or less: coarse run and zones (12.5 % of the CPU time of the reference).",
        "For a mean error of 5 % or less there is none but the reference. For a total error of 5 % or less: coarse run and zones (12.5 % of the CPU time of the reference). The two measures name different ways.",
        // Totals beside means, in the table and as plots of their own; what nobody was measured by has no plot.
        "<td class=\"n\">7.1 %</td><td class=\"n\">4.3 %</td><td class=\"n\">6.0 %</td><td class=\"n\">3.8 %</td>",
        "<details class=\"error-plot\" open><summary>Error of defects, total</summary>",
        "<details class=\"error-plot\"><summary>Error of wrinkle lengths, total</summary>",
        "Error of wrinkle lengths, total over CPU time",
        "<td>wrinkles below 20 mm</td><td class=\"n\">4</td><td class=\"n\">0</td><td class=\"n\">1</td><td class=\"n\">31.2 %</td><td class=\"n\">–</td>",
        "CPU time over that of the reference (%)",
        "<th class=\"n\">wall, added up</th>",
        "<code>plyflow results workflow.yaml --set 'coarse.element=m4 &amp; &lt;x&gt;' --front --format csv</code>",
    ] {
        assert!(page.contains(text), "{text}");
    }
    assert!(!page.contains("Nobody ran the whole"));
    assert!(!page.contains("Error of bridging areas, total"));
}

#[test]
fn without_a_reference_the_fine_runs_of_the_zones_measure_the_others_and_the_page_says_so() {
    let (_dir, folder) = folder();
    let mut input = whole(&folder);
    let mut instances = input.instances.iter_mut();
    let comparison = instances.find(|i| i.record.kind == "comparison");
    let results = &mut comparison.unwrap().record.results;
    results.retain(|r| !r.name.starts_with("cost"));
    let told = [
        ("cost.global.cpu_seconds", 100.0),
        ("cost.global.wall_seconds", 60.0),
        ("cost.other.drape.cpu_seconds", 2.0),
        ("cost.other.drape.wall_seconds", 2.0),
        ("peak_memory.other.drape", 73_109_504.0),
        ("cost.total.cpu_seconds", 800.0),
        ("cost.total.wall_seconds", 500.0),
        ("defect_error.global", 0.64),
        ("missed_wrinkles.global", 1.0),
        ("defect_error.other.drape", 1.0),
        ("position_error.global", 0.00077),
        ("position_error.other.drape", 0.00779),
        ("shear_quantile_error.other.drape", 0.1),
    ];
    results.extend(told.map(|(name, value)| NamedResult {
        name: name.into(),
        value,
        unit: "1".into(),
        measured: name.starts_with("cost"),
    }));
    let page = page(&input, &folder);
    assert_well_formed(&page);
    for text in [
        "Nobody ran the whole in fine elements here",
        "<th>drape</th>",
        "69.7 MiB",
        "0.25 %",
        "7.79",
        "5.73",
        "Error of position over CPU time",
        "For an error of 10 % or less there is none but the coarse run and zones.",
    ] {
        assert!(page.contains(text), "{text}");
    }
}
