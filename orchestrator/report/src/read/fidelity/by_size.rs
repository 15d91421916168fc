//! Errors by the size of the defects, as `comparison` tells them.

use crate::units::{number, shown};

/// Defects of one kind and class of size.
#[derive(Debug, Clone, PartialEq)]
pub struct OfClass {
    /// What they are, for people: `wrinkles of 20 to 40 mm`.
    pub title: String,
    /// Its name in results: `wrinkle.short`, `bridging.small`.
    pub name: String,
    /// How many the way and the reference have.
    pub pairs: f64,
    /// How many the reference has alone.
    pub missed: f64,
    /// How many the way has alone.
    pub wrong: f64,
    /// Mean relative error of the length or the area over the pairs.
    pub mean: Option<f64>,
    /// All that differs, over what the reference has.
    pub total: Option<f64>,
}

/// Of a kind in the names of results: itself, in the plural, its size, the unit of that, and its classes.
type Names = (
    &'static str,
    &'static str,
    &'static str,
    &'static str,
    [&'static str; 3],
);

const KINDS: [Names; 2] = [
    (
        "wrinkle",
        "wrinkles",
        "wrinkle_length",
        "m",
        ["short", "medium", "long"],
    ),
    (
        "bridging",
        "bridging",
        "bridging_area",
        "m2",
        ["small", "medium", "large"],
    ),
];

/// The classes of a way in which it or the reference has a defect; none where its comparison does not tell them. `value`: a result of the comparison;
/// `suffix`: what the results of the way end with.
pub(super) fn classes(value: impl Fn(&str) -> Option<f64>, suffix: &str) -> Vec<OfClass> {
    let mut list = Vec::new();
    for (kind, plural, size, unit, names) in KINDS {
        let from = |class: &str| value(&format!("{kind}_class_from.{class}"));
        let (Some(middle), Some(last)) = (from(names[1]), from(names[2])) else {
            continue;
        };
        let bounds = [
            (None, Some(middle)),
            (Some(middle), Some(last)),
            (Some(last), None),
        ];
        for (class, bounds) in names.into_iter().zip(bounds) {
            let of = |name: String| value(&format!("{name}.{class}{suffix}"));
            let counts = [
                format!("{kind}_pairs"),
                format!("missed_{plural}"),
                format!("false_{plural}"),
            ];
            let [Some(pairs), Some(missed), Some(wrong)] = counts.map(of) else {
                continue;
            };
            if pairs + missed + wrong > 0.0 {
                list.push(OfClass {
                    title: format!("{plural} {}", words(bounds, unit)),
                    name: format!("{kind}.{class}"),
                    pairs,
                    missed,
                    wrong,
                    mean: of(format!("{size}_error")),
                    total: of(format!("{size}_total_error")),
                });
            }
        }
    }
    list
}

/// What lies within two bounds: `below 20 mm`, `of 20 to 40 mm`, `from 40 mm on`.
fn words(bounds: (Option<f64>, Option<f64>), unit: &str) -> String {
    let (factor, unit) = shown(unit);
    let text = |v: f64| number(factor * v, 3);
    match bounds {
        (None, Some(to)) => format!("below {} {unit}", text(to)),
        (Some(from), Some(to)) => format!("of {} to {} {unit}", text(from), text(to)),
        (Some(from), None) => format!("from {} {unit} on", text(from)),
        (None, None) => String::new(),
    }
}
