//! Zones with larger margins around the same defects.

use plyflow_zone_extraction::{FlaggedCell, Settings, extract};

const BLANK: [f64; 4] = [-0.240, -0.150, 0.240, 0.150];

fn settings(wider: f64) -> Settings {
    Settings {
        scale: 1.2,
        join_distance: 0.010,
        minimum_area: 200e-6,
        minimum_size: 0.040,
        edge_factor: 1.0,
        wider,
        maximum_fraction: 0.6,
        boxes: Vec::new(),
        growth: 0.25,
    }
}

/// The zones around flagged cells that fill boxes.
fn zones(defects: &[[f64; 4]], settings: &Settings) -> Vec<[f64; 4]> {
    let cell = |b: &[f64; 4]| FlaggedCell {
        ply: 0,
        bounds: *b,
        area: (b[2] - b[0]) * (b[3] - b[1]),
    };
    let cells: Vec<FlaggedCell> = defects.iter().map(cell).collect();
    let found = extract(&cells, &["ply_1".into()], BLANK, settings).unwrap();
    found.iter().map(|z| z.bounds).collect()
}

fn close(a: [f64; 4], b: [f64; 4]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9)
}

#[test]
fn the_margin_is_multiplied_whether_the_scale_or_the_least_size_made_it() {
    // 100 mm wide: the scale leaves 10 mm at each side. 20 mm high: the least size leaves 10 mm too.
    let defect = [[-0.050, -0.010, 0.050, 0.010]];
    let one = zones(&defect, &settings(1.0));
    assert!(close(one[0], [-0.060, -0.020, 0.060, 0.020]), "{one:?}");
    let two = zones(&defect, &settings(2.0));
    assert!(close(two[0], [-0.070, -0.030, 0.070, 0.030]), "{two:?}");
}

#[test]
fn a_box_that_was_drawn_by_hand_counts_as_drawn_with_the_scale() {
    let drawn = |wider| Settings {
        boxes: vec![vec![-0.060, -0.024, 0.060, 0.024]],
        ..settings(wider)
    };
    assert!(close(
        zones(&[], &drawn(1.0))[0],
        [-0.060, -0.024, 0.060, 0.024]
    ));
    // Of 120 mm a defect of 100 mm leaves 10 mm at each side, of 48 mm one of 40 mm leaves 4 mm.
    assert!(close(
        zones(&[], &drawn(2.0))[0],
        [-0.070, -0.028, 0.070, 0.028]
    ));
}

#[test]
fn every_zone_lies_in_a_wider_one_also_where_those_meet_or_reach_the_edge() {
    let defects = [
        [-0.200, -0.020, -0.120, 0.020],
        [-0.090, -0.030, -0.030, 0.030],
        [0.100, 0.080, 0.180, 0.120],
    ];
    let (one, two) = (
        zones(&defects, &settings(1.0)),
        zones(&defects, &settings(2.0)),
    );
    assert_eq!((one.len(), two.len()), (3, 2), "{one:?} {two:?}");
    for a in &one {
        let inside = |b: &&[f64; 4]| a[0] >= b[0] && a[1] >= b[1] && a[2] <= b[2] && a[3] <= b[3];
        assert!(two.iter().any(|b| inside(&b)), "{a:?} in none of {two:?}");
    }
}
