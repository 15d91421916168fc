//! Errors by the size of the defects, beside sums that are worked out by hand.

use plyflow_defects::pairs::{PairErrors, Pairs};
use plyflow_defects::sizes::{SizeClasses, SizeErrors};
use plyflow_defects::{Defect, Kind};

const CLASSES: SizeClasses = SizeClasses {
    wrinkle_classes: [0.020, 0.040],
    bridging_classes: [200e-6, 500e-6],
};

fn defect(kind: Kind, length: f64, amplitude: f64, area: f64) -> Defect {
    Defect {
        kind,
        nodes: Vec::new(),
        length,
        amplitude,
        area,
        centre: [0.0; 2],
        curvature_max: 0.0,
        sharpness: 0.0,
        direction: 0.0,
        shear: None,
        ridge: Vec::new(),
        ridge_nodes: Vec::new(),
        ridge_shear: None,
        cause: None,
    }
}

/// A ridge of a length and a height in mm.
fn ridge(length: f64, amplitude: f64) -> Defect {
    defect(Kind::Wrinkle, length / 1e3, amplitude / 1e3, 0.0)
}

/// Bridging of an area in mm2.
fn bridging(area: f64) -> Defect {
    defect(Kind::Bridging, 0.0, 0.0, area / 1e6)
}

/// The first `pairs` of both are the same, one by one; what follows is of one alone.
fn pairs(ours: &[Defect], theirs: &[Defect], pairs: usize) -> Pairs {
    Pairs {
        both: (0..pairs).map(|i| (i, i)).collect(),
        missed: (pairs..theirs.len()).collect(),
        wrong: (pairs..ours.len()).collect(),
    }
}

fn errors(ours: &[Defect], theirs: &[Defect], both: usize) -> (PairErrors, SizeErrors) {
    let pairs = pairs(ours, theirs, both);
    let (ours, theirs): (Vec<_>, Vec<_>) = (ours.iter().collect(), theirs.iter().collect());
    (
        PairErrors::of(&ours, &theirs, &pairs),
        SizeErrors::of(&ours, &theirs, &pairs, &CLASSES),
    )
}

fn told(errors: &SizeErrors, name: &str) -> Option<f64> {
    let all = errors.told();
    let mut of = all.iter().filter(|t| t.0 == name);
    let found = of.next().map(|t| t.1);
    assert!(of.next().is_none(), "{name} is told twice");
    found
}

#[track_caller]
fn is(errors: &SizeErrors, name: &str, expected: f64) {
    let found = told(errors, name).unwrap_or_else(|| panic!("{name} is not told"));
    assert!(
        (found - expected).abs() < 1e-12,
        "{name}: {found}, expected {expected}"
    );
}

#[test]
fn four_short_ridges_decide_the_mean_and_not_the_total() {
    let lengths = [12.0, 13.0, 15.0, 15.0, 46.0, 46.0, 47.0, 48.0, 56.0, 57.0];
    let theirs = lengths.map(|l| ridge(l, 2.0));
    // Short ones 30 % too long, long ones 2 % too short.
    let ours = lengths.map(|l| ridge(l * if l < 20.0 { 1.3 } else { 0.98 }, 2.0));
    let (by_pair, by_size) = errors(&ours, &theirs, 10);
    // (4 x 30 % + 6 x 2 %) / 10 = 13.2 %.
    assert!((by_pair.error().unwrap() - 0.132).abs() < 1e-12);
    // 0.3 x 55 mm + 0.02 x 300 mm = 22.5 mm of 355 mm.
    is(&by_size, "wrinkle_length_total_error", 22.5 / 355.0);
    is(&by_size, "defect_total_error", 22.5 / 355.0);
    for (class, pairs, error) in [("short", 4.0, 0.3), ("long", 6.0, 0.02)] {
        is(&by_size, &format!("wrinkle_pairs.{class}"), pairs);
        is(&by_size, &format!("wrinkle_length_error.{class}"), error);
        is(
            &by_size,
            &format!("wrinkle_length_total_error.{class}"),
            error,
        );
    }
    is(&by_size, "wrinkle_pairs", 10.0);
    is(&by_size, "wrinkle_pairs.medium", 0.0);
    assert_eq!(told(&by_size, "wrinkle_length_error.medium"), None);
    assert_eq!(told(&by_size, "wrinkle_length_total_error.medium"), None);
    is(&by_size, "wrinkle_amplitude_total_error", 0.0);
}

#[test]
fn what_is_missed_or_false_counts_with_its_whole_size_and_the_parts_add_up() {
    let theirs = [ridge(50.0, 4.0), bridging(600.0), ridge(20.0, 2.0)];
    let ours = [ridge(45.0, 3.0), bridging(540.0), ridge(10.0, 1.5)];
    let (by_pair, by_size) = errors(&ours, &theirs, 2);
    // 5 mm of the pair, 20 mm missed and 10 mm false, of 70 mm.
    is(&by_size, "wrinkle_length_total_error", 35.0 / 70.0);
    is(&by_size, "wrinkle_length_total_error.paired", 5.0 / 70.0);
    is(&by_size, "wrinkle_length_total_error.missed", 20.0 / 70.0);
    is(&by_size, "wrinkle_length_total_error.false", 10.0 / 70.0);
    is(&by_size, "bridging_area_total_error", 0.1);
    is(&by_size, "bridging_area_total_error.missed", 0.0);
    // Heights by length: 50 x 1 of the pair, 20 x 2 missed and 10 x 1.5 false, of 50 x 4 + 20 x 2 (mm2).
    is(&by_size, "wrinkle_amplitude_total_error", 105.0 / 240.0);
    // Three wrinkles at 50 % and one place of bridging at 10 %.
    is(&by_size, "defect_total_error", 1.6 / 4.0);
    // The mean over defects: 10 %, 10 %, and twice 100 %.
    assert!((by_pair.error().unwrap() - 2.2 / 4.0).abs() < 1e-12);
    // 20 mm is no longer short; what is false is of the class of its own length.
    for (name, count) in [
        ("missed_wrinkles.short", 0.0),
        ("missed_wrinkles.medium", 1.0),
        ("false_wrinkles.short", 1.0),
        ("false_wrinkles.medium", 0.0),
        ("wrinkle_pairs.long", 1.0),
        ("bridging_pairs.large", 1.0),
        ("missed_bridging.large", 0.0),
    ] {
        is(&by_size, name, count);
    }
    is(&by_size, "wrinkle_length_total_error.medium", 1.0);
    is(&by_size, "wrinkle_length_total_error.long", 0.1);
    // Nothing of theirs is short: a false one has nothing to be held against.
    assert_eq!(told(&by_size, "wrinkle_length_total_error.short"), None);
    is(&by_size, "wrinkle_amplitude_error.long", 0.25);
}

#[test]
fn a_pair_is_of_the_class_of_the_reference_and_bounds_belong_to_the_larger_class() {
    let theirs = [
        ridge(18.0, 2.0),
        ridge(40.0, 2.0),
        bridging(200.0),
        bridging(76.0),
    ];
    let ours = [
        ridge(45.0, 2.0),
        ridge(12.0, 2.0),
        bridging(650.0),
        bridging(95.0),
    ];
    let (_, by_size) = errors(&ours, &theirs, 4);
    is(&by_size, "wrinkle_length_error.short", 1.5);
    is(&by_size, "wrinkle_length_error.long", 0.7);
    is(&by_size, "bridging_area_error.medium", 450.0 / 200.0);
    is(&by_size, "bridging_area_error.small", 0.25);
    is(&by_size, "bridging_pairs.large", 0.0);
    // (450 + 19) mm2 of 276 mm2: a total may be above 100 %.
    is(&by_size, "bridging_area_total_error", 469.0 / 276.0);
}

#[test]
fn total_and_mean_are_equal_where_all_defects_of_a_kind_are_of_one_size_and_none_is_false() {
    let theirs = [
        ridge(30.0, 2.0),
        bridging(300.0),
        ridge(30.0, 2.0),
        ridge(30.0, 2.0),
    ];
    let ours = [ridge(24.0, 2.0), bridging(330.0), ridge(39.0, 2.0)];
    let (by_pair, by_size) = errors(&ours, &theirs, 3);
    // 20 %, 10 %, 30 % and a missed one.
    is(&by_size, "defect_total_error", 1.6 / 4.0);
    assert!((by_pair.error().unwrap() - 1.6 / 4.0).abs() < 1e-12);
}

#[test]
fn where_the_reference_has_none_of_a_kind_all_is_false_and_where_nobody_has_any_nothing_is_told() {
    let (by_pair, by_size) = errors(&[ridge(30.0, 2.0), ridge(10.0, 2.0)], &[], 0);
    assert_eq!((by_pair.error(), by_size.error()), (Some(1.0), Some(1.0)));
    assert_eq!(told(&by_size, "wrinkle_length_total_error"), None);
    // Beside bridging that is right: two wrinkles at 100 % and one place at 0 %.
    let ours = [bridging(300.0), ridge(30.0, 2.0), ridge(10.0, 2.0)];
    let (_, by_size) = errors(&ours, &[bridging(300.0)], 1);
    is(&by_size, "defect_total_error", 2.0 / 3.0);

    let (by_pair, by_size) = errors(&[], &[], 0);
    assert_eq!((by_pair.error(), by_size.error()), (None, None));
    let all = by_size.told();
    assert!(all.iter().all(|(_, value)| *value == 0.0), "{all:?}");
    // Numbers of pairs, and by class of pairs, of missed and of false ones.
    assert_eq!(all.len(), 2 + 2 * 3 * 3);
}

#[test]
fn the_classes_say_where_they_begin() {
    let expected = [
        ("wrinkle_class_from.medium", 0.020, "m"),
        ("wrinkle_class_from.long", 0.040, "m"),
        ("bridging_class_from.medium", 200e-6, "m2"),
        ("bridging_class_from.large", 500e-6, "m2"),
    ];
    assert_eq!(
        CLASSES.told(),
        expected.map(|(name, v, unit)| (name.to_owned(), v, unit))
    );
}
