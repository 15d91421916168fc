//! Zones from flags that are known.
//!
//! A little over 600 lines: drawing zones, cuts across defects, and drawing them again share the same patches of cells.

use plyflow_geometry::vec3::Vec3;
use plyflow_model::artifact::{
    ComparedDefect, ComparedModel, Defect, DefectKind, Role, Zone, current_zones,
};
use plyflow_sdk::On;
use plyflow_testing::{MemoryArtifact, MemoryBody, MemoryField, MemoryInput, run};
use plyflow_zone_extraction::{
    AtCut, ExtractError, FlaggedCell, Settings, ZoneExtraction, across, extract, grow,
};
use serde_json::{Map, Value, json};

const BLANK: [f64; 4] = [-0.240, -0.150, 0.240, 0.150];

fn settings() -> Settings {
    Settings {
        scale: 1.15,
        join_distance: 0.010,
        minimum_area: 200e-6,
        edge_factor: 1.0,
        minimum_size: 0.040,
        wider: 1.0,
        maximum_fraction: 0.6,
        boxes: Vec::new(),
        growth: 0.25,
    }
}

/// Zones of plies that are called by their numbers.
fn draw(
    cells: &[FlaggedCell],
    blank: [f64; 4],
    settings: &Settings,
) -> Result<Vec<Zone>, ExtractError> {
    let names: Vec<String> = (0..4).map(|k| format!("ply_{k}")).collect();
    extract(cells, &names, blank, settings)
}

/// Cells of 10 mm that fill a box.
fn patch(ply: usize, b: [f64; 4]) -> Vec<FlaggedCell> {
    let count = |d: usize| ((b[d + 2] - b[d]) / 0.010).round() as usize;
    let mut cells = Vec::new();
    for j in 0..count(1) {
        for i in 0..count(0) {
            let (x, y) = (b[0] + 0.010 * i as f64, b[1] + 0.010 * j as f64);
            cells.push(FlaggedCell {
                ply,
                bounds: [x, y, x + 0.010, y + 0.010],
                area: 1e-4,
            });
        }
    }
    cells
}

fn close(a: [f64; 4], b: [f64; 4]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9)
}

#[test]
fn a_box_grows_by_the_scale_about_its_centre() {
    let zones = draw(
        &patch(0, [-0.050, -0.040, 0.050, 0.040]),
        BLANK,
        &settings(),
    )
    .unwrap();
    assert_eq!(zones.len(), 1);
    assert!(
        close(zones[0].bounds, [-0.0575, -0.046, 0.0575, 0.046]),
        "{zones:?}"
    );
    assert!(close(
        zones[0].defect_box.unwrap(),
        [-0.050, -0.040, 0.050, 0.040]
    ));
    assert_eq!(zones[0].free_sides, [false; 4]);
    assert!((zones[0].flagged_area - 80e-4).abs() < 1e-12);
}

#[test]
fn zones_are_named_from_left_to_right_whatever_the_order_of_the_cells() {
    let mut cells = patch(0, [0.100, -0.020, 0.150, 0.020]);
    cells.extend(patch(1, [-0.200, 0.000, -0.150, 0.050]));
    cells.extend(patch(0, [-0.030, -0.100, 0.000, -0.060]));
    let zones = draw(&cells, BLANK, &settings()).unwrap();
    let names: Vec<&str> = zones.iter().map(|z| z.name.as_str()).collect();
    assert_eq!(names, ["A", "B", "C"]);
    assert_eq!(zones[0].plies, ["ply_1"]);
    cells.reverse();
    assert_eq!(draw(&cells, BLANK, &settings()).unwrap(), zones);
}

#[test]
fn defects_on_different_plies_within_the_join_distance_are_one() {
    let mut cells = patch(0, [-0.050, -0.040, -0.010, 0.040]);
    cells.extend(patch(1, [0.000, -0.040, 0.050, 0.040]));
    let zones = draw(&cells, BLANK, &settings()).unwrap();
    assert_eq!(zones.len(), 1, "a gap of 10 mm");
    assert_eq!(zones[0].plies, ["ply_0", "ply_1"]);
    let apart = Settings {
        join_distance: 0.005,
        scale: 1.0,
        minimum_size: 0.0,
        ..settings()
    };
    assert_eq!(draw(&cells, BLANK, &apart).unwrap().len(), 2);
}

#[test]
fn scaled_boxes_that_overlap_are_merged_until_none_do() {
    // Three in a row: the first two overlap, and only their union reaches the third.
    let mut cells = patch(0, [-0.150, -0.020, -0.060, 0.020]);
    cells.extend(patch(0, [-0.048, -0.020, 0.042, 0.020]));
    cells.extend(patch(0, [0.056, -0.020, 0.076, 0.020]));
    let s = Settings {
        minimum_size: 0.0,
        ..settings()
    };
    let zones = draw(&cells, BLANK, &s).unwrap();
    assert_eq!(zones.len(), 1, "{zones:?}");
    assert!(close(
        zones[0].defect_box.unwrap(),
        [-0.150, -0.020, 0.076, 0.020]
    ));
}

#[test]
fn sides_past_or_near_the_blank_s_edge_lie_on_it_and_are_free() {
    let zones = draw(
        &patch(0, [-0.240, 0.080, -0.200, 0.140]),
        BLANK,
        &settings(),
    )
    .unwrap();
    assert_eq!(zones[0].bounds[0], BLANK[0]);
    assert_eq!(zones[0].bounds[3], BLANK[3]);
    assert_eq!(zones[0].free_sides, [true, false, false, true]);
}

#[test]
fn specks_get_no_zone_even_when_both_plies_have_them() {
    let mut cells = patch(0, [0.0, 0.0, 0.010, 0.010]);
    cells.extend(patch(1, [0.0, 0.0, 0.010, 0.010]));
    assert!(draw(&cells, BLANK, &settings()).unwrap().is_empty());
    cells.extend(patch(1, [0.010, 0.0, 0.020, 0.010]));
    let zones = draw(&cells, BLANK, &settings()).unwrap();
    assert!(
        (zones[0].bounds[2] - zones[0].bounds[0] - 0.040).abs() < 1e-12,
        "smallest size"
    );
}

#[test]
fn a_place_that_the_blank_s_edge_cuts_off_counts_as_its_mirror_images_do() {
    // One cell of 100 mm2, of 200 that are asked for: inside, at an edge, at a corner.
    let inside = [0.0, 0.0, 0.010, 0.010];
    let edge = [-0.240, 0.0, -0.230, 0.010];
    let corner = [0.230, -0.150, 0.240, -0.140];
    let zones = |bounds: [f64; 4], edge_factor: f64, minimum_area: f64| {
        let s = Settings {
            edge_factor,
            minimum_area,
            ..settings()
        };
        draw(&patch(0, bounds), BLANK, &s).unwrap().len()
    };
    for place in [inside, edge, corner] {
        assert_eq!(zones(place, 1.0, 200e-6), 0, "as it is");
    }
    assert_eq!(
        [inside, edge, corner].map(|b| zones(b, 2.0, 200e-6)),
        [0, 1, 1]
    );
    assert_eq!(
        [inside, edge, corner].map(|b| zones(b, 2.0, 201e-6)),
        [0, 0, 1]
    );
    assert_eq!(
        [inside, edge, corner].map(|b| zones(b, 2.0, 401e-6)),
        [0, 0, 0]
    );
    // From one edge to the other it is cut off across y alone, at both ends.
    let strip = [0.0, -0.150, 0.010, 0.150];
    assert_eq!([6e-3, 6.1e-3].map(|area| zones(strip, 2.0, area)), [1, 0]);
    // What lies one cell away from the edge is whole.
    assert_eq!(zones([-0.230, 0.0, -0.220, 0.010], 2.0, 200e-6), 0);
    // The zone at the corner has the corner.
    let s = Settings {
        edge_factor: 2.0,
        ..settings()
    };
    let zones = draw(&patch(0, corner), BLANK, &s).unwrap();
    assert_eq!(zones[0].free_sides, [false, true, true, false]);
    assert!(
        close(zones[0].bounds, [0.215, -0.150, 0.240, -0.125]),
        "{zones:?}"
    );
}

/// Side, length and the place of a cut that is free of the defect, of all cuts across defects.
fn cuts(cells: &[FlaggedCell], bounds: [f64; 4]) -> Vec<(usize, f64, f64)> {
    let s = Settings {
        boxes: vec![bounds.to_vec()],
        ..settings()
    };
    let zones = draw(cells, BLANK, &s).unwrap();
    let found = across(cells, &zones, BLANK, &s);
    let mut told = Vec::new();
    for a in &found {
        assert_eq!(a.zone, 0);
        told.push((a.side, (1e6 * a.length).round() / 1e6, a.free_at));
    }
    told
}

#[test]
fn a_cut_across_a_defect_is_found_by_its_side_its_length_and_where_it_would_be_free() {
    let defect = patch(1, [-0.050, -0.040, 0.050, 0.040]);
    // Through cells, and along their edges.
    for x in [0.004, 0.010] {
        let told = cuts(&defect, [x, -0.100, 0.100, 0.010]);
        assert_eq!(told.len(), 2, "{told:?}");
        assert_eq!(told[0].0, 0);
        assert!((told[0].1 - 0.050).abs() < 1e-6 && (told[0].2 + 0.050).abs() < 1e-9);
        assert_eq!(told[1].0, 3);
        assert!((told[1].1 - (0.050 - x)).abs() < 1e-6 && (told[1].2 - 0.040).abs() < 1e-9);
    }
}

#[test]
fn a_cut_beside_a_defect_along_its_rim_or_at_the_edge_of_the_blank_is_none_across_it() {
    let defect = patch(0, [-0.050, -0.040, 0.050, 0.040]);
    assert!(cuts(&defect, [-0.060, -0.050, 0.060, 0.050]).is_empty());
    assert!(cuts(&defect, [-0.050, -0.040, 0.050, 0.040]).is_empty());
    assert!(cuts(&defect, [0.050, -0.040, 0.150, 0.040]).is_empty());
    let at_edge = patch(0, [0.200, -0.150, 0.240, -0.100]);
    assert!(cuts(&at_edge, [0.150, -0.150, 0.240, -0.050]).is_empty());
    // On the two sides different plies, or what is too small for a zone.
    let mut plies = patch(0, [-0.050, -0.040, 0.000, 0.040]);
    plies.extend(patch(1, [0.000, -0.040, 0.050, 0.040]));
    assert!(cuts(&plies, [0.000, -0.100, 0.100, 0.100]).is_empty());
    assert!(
        cuts(
            &patch(0, [0.0, 0.0, 0.010, 0.010]),
            [0.005, -0.05, 0.05, 0.05]
        )
        .is_empty()
    );
}

#[test]
fn zones_that_are_drawn_around_defects_are_not_cut_across_them() {
    let mut cells = patch(0, [-0.150, -0.020, -0.060, 0.020]);
    cells.extend(patch(0, [-0.020, 0.050, 0.042, 0.090]));
    cells.extend(patch(1, [0.056, -0.150, 0.076, -0.050]));
    let zones = draw(&cells, BLANK, &settings()).unwrap();
    assert!(across(&cells, &zones, BLANK, &settings()).is_empty());
}

#[test]
fn drawn_boxes_are_taken_as_they_are_and_bad_ones_are_named() {
    let with = |boxes: Vec<Vec<f64>>| Settings {
        boxes,
        ..settings()
    };
    let cells = patch(0, [0.0, 0.0, 0.050, 0.050]);
    let zones = draw(
        &cells,
        BLANK,
        &with(vec![vec![0.1, -0.2, 0.2, 0.1], vec![-0.1, 0.0, 0.02, 0.02]]),
    )
    .unwrap();
    assert!(close(zones[0].bounds, [0.1, -0.150, 0.2, 0.1]));
    assert_eq!((zones[0].flagged_area, zones[0].plies.len()), (0.0, 0));
    assert!((zones[1].flagged_area - 4e-4).abs() < 1e-12);
    let error = draw(&cells, BLANK, &with(vec![vec![0.1, 0.2]]))
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("box 0") && error.contains("[0.1, 0.2]"),
        "{error}"
    );
    let error = draw(&cells, BLANK, &with(vec![vec![1.0, 0.0, 2.0, 0.1]]))
        .unwrap_err()
        .to_string();
    assert!(error.contains("outside of the blank"), "{error}");
}

fn artifact(flag: impl Fn(usize) -> bool) -> MemoryArtifact {
    let mut points: Vec<Vec3> = Vec::new();
    for j in 0..=30 {
        for i in 0..=48 {
            points.push([-0.240 + 0.010 * i as f64, -0.150 + 0.010 * j as f64, 0.1]);
        }
    }
    let at = |i: usize, j: usize| (j * 49 + i) as u32;
    let cells: Vec<u32> = (0..30 * 48)
        .flat_map(|c| {
            let (i, j) = (c % 48, c / 48);
            [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]
        })
        .collect();
    let flags = (0..30 * 48).map(|c| f64::from(u8::from(flag(c)))).collect();
    let field = |name: &str, on, components, values| MemoryField {
        name: name.into(),
        on,
        components,
        values,
    };
    let body = MemoryBody {
        name: "ply_2".into(),
        fields: vec![vec![
            field("flag", On::Cells, 1, flags),
            field(
                "undeformed",
                On::Points,
                3,
                points
                    .as_flattened()
                    .iter()
                    .map(|v| f64::from(*v as f32))
                    .collect(),
            ),
        ]],
        frames: vec![points.clone()],
        points,
        nodes_per_cell: 4,
        cells,
        ..Default::default()
    };
    MemoryArtifact {
        kind: "defects".into(),
        times: vec![1.0],
        bodies: vec![body],
        ..Default::default()
    }
}

#[test]
fn nothing_flagged_is_a_valid_empty_collection() {
    let input = artifact(|_| false);
    let out =
        run::<ZoneExtraction>(json!({}), &[MemoryInput::new("defects", &input)], &[]).unwrap();
    assert_eq!(out.collection, Some(vec![]));
    assert_eq!(
        (out.result("zone_count"), out.result("ply_fraction")),
        (0.0, 0.0)
    );
    assert_eq!(out.attributes["zones"], json!([]));
}

#[test]
fn artifact_follows_the_data_model_and_warns_when_zones_cover_too_much() {
    let input = artifact(|c| c % 48 < 4 && c / 48 < 5);
    let out =
        run::<ZoneExtraction>(json!({}), &[MemoryInput::new("defects", &input)], &[]).unwrap();
    assert_eq!(out.collection, Some(vec!["A".to_owned()]));
    let zone = &out.attributes["zones"][0];
    assert_eq!(zone["free_sides"], json!([true, false, true, false]));
    assert_eq!(
        zone["box"][0], -0.240,
        "fields in single precision do not show"
    );
    assert_eq!(zone["plies"], json!(["ply_2"]));
    let number = |v: &Value| v.as_f64().unwrap();
    assert!((number(&zone["box"][2]) + 0.197).abs() < 1e-9, "{zone}");
    assert!((number(&zone["flagged_area"]) - 20e-4).abs() < 1e-12);
    assert!((out.result("ply_fraction") - 0.043 * 0.05375 / 0.144).abs() < 1e-9);
    assert!(out.log.is_empty());
    let all = artifact(|_| true);
    let out = run::<ZoneExtraction>(json!({}), &[MemoryInput::new("defects", &all)], &[]).unwrap();
    assert!((out.result("ply_fraction") - 1.0).abs() < 1e-12);
    assert!(out.log[0].contains("100 %"), "{:?}", out.log);
}

fn drawn(name: &str, bounds: [f64; 4]) -> Zone {
    Zone {
        name: name.into(),
        bounds,
        defect_box: Some(bounds),
        free_sides: [false; 4],
        plies: vec!["ply_1".into()],
        flagged_area: 1e-3,
        replaces: Vec::new(),
        other: Map::new(),
    }
}

/// A run of a comparison.
fn model(role: Role, zone: Option<&str>) -> ComparedModel {
    let name = zone.map_or("global".to_owned(), |zone| format!("local.{zone}"));
    ComparedModel {
        name,
        role,
        zone: zone.map(str::to_owned),
        element_size: 0.004,
        elements: 100,
        element_cycles: 1e6,
    }
}

/// A wrinkle of a comparison, at the right side of a zone's cut.
fn defect(id: &str, model: &str, zone: &str) -> ComparedDefect {
    ComparedDefect {
        id: id.into(),
        model: model.into(),
        zone: zone.into(),
        ply: "ply_1".into(),
        found: Defect {
            kind: DefectKind::Wrinkle,
            cause: None,
            amplitude: 0.002,
            area: 1e-4,
            centre: [0.0, 0.0],
            radius: None,
            direction: None,
            ridge_shear: None,
            ridge_shear_min: None,
            ridge_shear_max: None,
            ridge_shear_profile: None,
        },
        length: 0.02,
        curvature_max: 100.0,
        shear_min: None,
        shear_max: None,
        touches_cut: true,
        cut_sides: [false, true, false, false],
    }
}

fn at_cut(id: &str, zone: &str, cut_sides: [bool; 4]) -> AtCut {
    AtCut {
        id: id.into(),
        zone: zone.into(),
        cut_sides,
    }
}

#[test]
fn zones_that_lie_nearer_than_the_join_distance_are_one() {
    // Boxes of 57.5 mm with 5 and 15 mm between them.
    for (gap, count) in [(0.005, 1), (0.015, 2)] {
        let at = 0.0575 + gap;
        let mut cells = patch(0, [-0.100, -0.020, -0.050, 0.030]);
        let shifted = cells.clone().into_iter().map(|mut c| {
            c.bounds[0] += at;
            c.bounds[2] += at;
            c
        });
        cells.extend(shifted);
        // What is left between the cells, 12.5 mm and more, parts the defects.
        assert_eq!(draw(&cells, BLANK, &settings()).unwrap().len(), count);
    }
}

#[test]
fn a_zone_grows_on_the_sides_that_a_defect_reaches_and_onto_the_edge() {
    let zones = [
        drawn("A", [-0.230, -0.040, -0.150, 0.040]),
        drawn("B", [0.050, 0.0, 0.150, 0.050]),
        drawn("C", [0.0, -0.130, 0.040, -0.090]),
    ];
    let defects = [
        at_cut("AW1", "A", [true, false, false, false]),
        at_cut("CW1", "C", [false, true, false, false]),
        at_cut("CW2", "C", [false, false, false, true]),
        at_cut("BW1", "B", [false; 4]),
    ];
    let found = grow(&zones, &defects, BLANK, &settings());
    let names: Vec<&str> = found.iter().map(|f| f.0.name.as_str()).collect();
    assert_eq!(names, ["A", "C"]);
    assert!(close(found[0].0.bounds, [-0.240, -0.040, -0.150, 0.040]));
    assert_eq!(found[0].0.free_sides, [true, false, false, false]);
    assert!(close(found[1].0.bounds, [0.0, -0.130, 0.050, -0.080]));
    assert_eq!(found[1].1, "CW1, CW2");
    assert!(found.iter().all(|f| f.0.replaces.is_empty()));
    assert_eq!(grow(&zones, &[], BLANK, &settings()), []);
}

#[test]
fn zones_that_meet_as_one_grows_become_one() {
    let zones = [
        drawn("A", [0.0, 0.0, 0.100, 0.050]),
        drawn("B", [0.120, 0.010, 0.160, 0.080]),
        drawn("C", [0.165, 0.010, 0.200, 0.080]),
    ];
    let defects = [at_cut("AW1", "A", [false, true, false, false])];
    let found = grow(&zones, &defects, BLANK, &settings());
    assert_eq!(found.len(), 1);
    let zone = &found[0].0;
    assert!(close(zone.bounds, [0.0, 0.0, 0.200, 0.080]), "{zone:?}");
    assert_eq!(
        (zone.name.as_str(), &zone.replaces[..]),
        ("A", &["B".to_owned(), "C".to_owned()][..])
    );
    assert_eq!(zone.plies, ["ply_1"]);
    assert!((zone.flagged_area - 3e-3).abs() < 1e-15);
}

/// A, B and C; A has grown over B. It grows again, and comes to lie on C, which has been left alone until now.
#[test]
fn a_second_pass_sees_the_zones_that_the_first_one_left_alone() {
    let list = |zones: Value, blank: [f64; 4]| MemoryArtifact {
        kind: "zones".into(),
        attributes: json!({"zones": zones, "blank": blank}),
        ..Default::default()
    };
    let again = Zone {
        replaces: vec!["B".into()],
        ..drawn("A", [0.0, 0.0, 0.100, 0.050])
    };
    let c = drawn("C", [0.115, 0.010, 0.200, 0.080]);
    let first = list(
        json!([
            drawn("A", [0.0, 0.0, 0.050, 0.050]),
            drawn("B", [0.055, 0.0, 0.100, 0.050]),
            c
        ]),
        BLANK,
    );
    let grown = list(json!([again]), BLANK);
    let comparison = MemoryArtifact {
        kind: "comparison".into(),
        attributes: json!({
            "zones": ["A", "C"],
            "models": [model(Role::Local, Some("A")), model(Role::Local, Some("C"))],
            "defects": [defect("AW1", "local.A", "A")]}),
        ..Default::default()
    };
    let given = |lists: &[&MemoryArtifact]| {
        let mut inputs: Vec<MemoryInput<'_>> =
            lists.iter().map(|l| MemoryInput::new("zones", l)).collect();
        inputs.push(MemoryInput::new("comparison", &comparison));
        run::<ZoneExtraction>(json!({}), &inputs, &[])
    };
    for lists in [[&first, &grown], [&grown, &first]] {
        let out = given(&lists).unwrap();
        assert_eq!(out.collection, Some(vec!["A".to_owned()]));
        let zone = &out.attributes["zones"][0];
        assert_eq!(zone["box"], json!([0.0, 0.0, 0.200, 0.080]));
        assert_eq!(zone["replaces"], json!(["C"]));
        assert!(
            !out.log.iter().any(|l| l.contains("none of the lists")),
            "{:?}",
            out.log
        );
    }
    // With the last list alone it cannot know, and says so.
    let out = given(&[&grown]).unwrap();
    assert_eq!(
        out.attributes["zones"][0]["box"],
        json!([0.0, 0.0, 0.125, 0.050])
    );
    assert!(
        out.log[0].contains("the comparison has C too"),
        "{:?}",
        out.log
    );
    let other = list(json!([]), [0.0, 0.0, 1.0, 1.0]);
    let error = given(&[&first, &other]).unwrap_err();
    assert!(error.contains("of one coarse run"), "{error}");
}

/// A has grown since it was drawn first, or since it was compared.
#[test]
fn a_zone_that_was_compared_with_another_box_is_told() {
    let list = |bounds: [f64; 4]| MemoryArtifact {
        kind: "zones".into(),
        attributes: json!({"zones": [drawn("A", bounds), drawn("C", [0.15, 0.0, 0.2, 0.1])], "blank": BLANK}),
        ..Default::default()
    };
    let (small, grown) = ([0.0, 0.0, 0.05, 0.05], [0.0, 0.0, 0.0625, 0.05]);
    let told = |lists: &[[f64; 4]], compared: Option<[f64; 4]>| {
        let lists: Vec<MemoryArtifact> = lists.iter().map(|b| list(*b)).collect();
        let mut attributes = json!({"zones": ["A", "C"], "models": [], "defects": []});
        if let Some(bounds) = compared {
            // As a file may have rounded it.
            attributes["zone_boxes"] = json!([bounds.map(|b| b + 1e-12), [0.15, 0.0, 0.2, 0.1]]);
        }
        let comparison = MemoryArtifact {
            kind: "comparison".into(),
            attributes,
            ..Default::default()
        };
        let mut inputs: Vec<MemoryInput<'_>> =
            lists.iter().map(|l| MemoryInput::new("zones", l)).collect();
        inputs.push(MemoryInput::new("comparison", &comparison));
        let log = run::<ZoneExtraction>(json!({}), &inputs, &[]).unwrap().log;
        log.into_iter()
            .filter(|l| l.contains("was compared with"))
            .collect::<Vec<_>>()
    };
    // The list with the larger one is left out; and one that the comparison did not have is given.
    for (given, compared) in [(small, grown), (grown, small)] {
        let warned = told(&[given], Some(compared));
        assert_eq!(warned.len(), 1, "{warned:?}");
        let [own, other] =
            [compared, given].map(|b| format!("{:?} mm", b.map(|b| (1e4 * b).round() / 10.0)));
        assert!(
            warned[0].contains(&format!("zone A was compared with the box {own}")),
            "{warned:?}"
        );
        assert!(
            warned[0].contains(&other) && warned[0].contains("Give all lists"),
            "{warned:?}"
        );
    }
    assert!(told(&[small, grown], Some(grown)).is_empty());
    // A comparison that tells no boxes.
    assert!(told(&[small], None).is_empty());
}

#[test]
fn of_several_lists_the_largest_of_a_name_counts_and_none_that_is_replaced() {
    let replacing = |name: &str, bounds: [f64; 4], others: &[&str]| Zone {
        replaces: others.iter().map(|o| (*o).to_owned()).collect(),
        ..drawn(name, bounds)
    };
    let square = |side: f64| [0.0, 0.0, side, side];
    let zones = vec![
        drawn("AA", square(0.01)),
        drawn("A", square(0.01)),
        drawn("B", square(0.09)),
        drawn("C", square(0.01)),
        replacing("A", square(0.02), &["B"]),
        drawn("A", square(0.03)),
    ];
    let found = current_zones(zones).0;
    let told: Vec<(&str, f64)> = found
        .iter()
        .map(|z| (z.name.as_str(), z.bounds[2]))
        .collect();
    assert_eq!(told, [("A", 0.03), ("C", 0.01), ("AA", 0.01)]);
}

#[test]
fn the_step_gives_only_what_is_drawn_again_and_wants_one_way_of_two() {
    let attributes = json!({"zones": [drawn("A", [0.0, 0.0, 0.100, 0.050]), drawn("B", [-0.2, -0.1, -0.1, 0.1])], "blank": BLANK});
    let zones = MemoryArtifact {
        kind: "zones".into(),
        attributes,
        ..Default::default()
    };
    let comparison = MemoryArtifact {
        kind: "comparison".into(),
        attributes: json!({
            "models": [model(Role::Global, None), model(Role::Local, Some("A"))],
            "defects": [defect("W", "global", "B"), defect("W", "local.A", "A")]}),
        ..Default::default()
    };
    let inputs = [
        MemoryInput::new("zones", &zones),
        MemoryInput::new("comparison", &comparison),
    ];
    let out = run::<ZoneExtraction>(json!({"growth": 0.5}), &inputs, &[]).unwrap();
    assert_eq!(out.result("zone_count"), 1.0);
    assert_eq!(out.attributes["zones"][0]["name"], "A");
    assert_eq!(
        out.attributes["zones"][0]["box"],
        json!([0.0, 0.0, 0.150, 0.050])
    );
    let error = run::<ZoneExtraction>(json!({}), &inputs[..1], &[]).unwrap_err();
    assert!(error.contains("give either `defects`"), "{error}");
}
