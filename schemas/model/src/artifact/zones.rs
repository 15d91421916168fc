//! The kind `zones`: where finer runs look closer, in the undeformed plane.

use crate::artifact::attributes::Attributes;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// A box `[x0, y0, x1, y1]` (m) whose sides lie along x and y.
pub type Rectangle = [f64; 4];

/// Boxes whose sides lie nearer to each other than this (m) are one, however they were rounded on their ways.
const SAME_BOX: f64 = 1e-9;
/// Places nearer than this (m) to the side of a zone lie in it, however they were rounded.
const ROUNDING: f64 = 1e-6;

/// Area of a box (m2).
pub fn area([x0, y0, x1, y1]: Rectangle) -> f64 {
    (x1 - x0) * (y1 - y0)
}

/// Attributes of the kind `zones`, a collection: one label for each zone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Zones {
    /// The zones, in the order of the labels.
    pub zones: Vec<Zone>,
    /// Factor by which boxes were scaled about their middles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// Factor by which the margins around the boxes were enlarged after that; left out: 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wider: Option<f64>,
    /// `[x0, y0, x1, y1]` (m), the box around the blank. Zones can only be drawn again where it is told.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blank: Option<Rectangle>,
    /// Areas of the zones over that of the blank's box.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ply_fraction: Option<f64>,
}

impl Attributes for Zones {
    const KIND: &'static str = "zones";
}

/// A zone: a box around defects.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Zone {
    /// `A`, `B` and so on, from left to right.
    pub name: String,
    /// `[x0, y0, x1, y1]` (m) in the undeformed plane, scaled and clipped to the blank.
    #[serde(rename = "box")]
    pub bounds: Rectangle,
    /// `[x0, y0, x1, y1]` (m), the box before it was scaled.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub defect_box: Option<Rectangle>,
    /// `[left, right, bottom, top]`: whether the side coincides with the edge of the blank, so that nothing is cut there.
    pub free_sides: [bool; 4],
    /// Names of the plies with flagged cells in it.
    #[serde(default)]
    pub plies: Vec<String>,
    /// Undeformed flagged area in it, of all plies together (m2).
    #[serde(default)]
    pub flagged_area: f64,
    /// Of a zone that was drawn again: names of the others in whose places it is.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub replaces: Vec<String>,
    /// What a step of somebody else tells besides.
    #[serde(flatten)]
    pub other: Map<String, Value>,
}

impl Zone {
    /// A zone that is cut at all four sides, of which nothing else is told.
    pub fn new(name: impl Into<String>, bounds: Rectangle) -> Self {
        Self {
            name: name.into(),
            bounds,
            defect_box: None,
            free_sides: [false; 4],
            plies: Vec::new(),
            flagged_area: 0.0,
            replaces: Vec::new(),
            other: Map::new(),
        }
    }

    /// Area of its box (m2).
    pub fn area(&self) -> f64 {
        area(self.bounds)
    }

    /// Whether another is the same zone: of its name and its box.
    pub fn is(&self, other: &Self) -> bool {
        self.name == other.name && self.has_box(other.bounds)
    }

    /// Whether its box is this one, however that was rounded on its way.
    pub fn has_box(&self, bounds: Rectangle) -> bool {
        let near = |(a, b): (f64, f64)| (a - b).abs() < SAME_BOX;
        self.bounds.into_iter().zip(bounds).all(near)
    }

    /// Whether a place `[x, y, ..]` of the flat ply (m) lies in it or on its sides, and at least `depth` (m) from those at which it is cut.
    pub fn holds(&self, at: &[f64], depth: f64) -> bool {
        (0..4).all(|side| {
            let (d, outward) = direction(side);
            let inside = outward * (self.bounds[d + 2 * (side % 2)] - at[d]);
            let least = if self.free_sides[side] { 0.0 } else { depth };
            inside > least - ROUNDING
        })
    }

    /// `[left, right, bottom, top]`: whether a ply that fills `whole` (`[x0, y0, x1, y1]`, m) in the whole and `own` in the zone's run is cut there.
    /// Not so at a free side, nor where the ply ends at the side or inside of it, nor where the zone's mesh, which goes on to the next line, has come to
    /// the ply's end: that is its own edge.
    pub fn cuts(&self, whole: Rectangle, own: Rectangle) -> [bool; 4] {
        [0, 1, 2, 3].map(|side| {
            let (d, outward) = direction(side);
            let k = d + 2 * (side % 2);
            let goes_on = |from: f64| outward * (whole[k] - from) > ROUNDING;
            !self.free_sides[side] && goes_on(self.bounds[k]) && goes_on(own[k])
        })
    }
}

/// Of a side (left, right, bottom, top): the axis across it, and which way along that is outward.
fn direction(side: usize) -> (usize, f64) {
    let outward = [-1.0, 1.0][side % 2];
    (side / 2, outward)
}

/// Of zones that were drawn in several goes, in the order in which they were given, which of them count: none that another one replaces, and of one
/// name the one with the largest box, of several of these the last.
pub fn which_count(zones: &[&Zone]) -> Vec<bool> {
    let counts = |(i, own): (usize, &&Zone)| {
        let replaced = zones.iter().any(|z| z.replaces.contains(&own.name));
        let better = |(j, other): (usize, &&Zone)| {
            let by_area = other.area().total_cmp(&own.area());
            other.name == own.name && by_area.then(j.cmp(&i)).is_gt()
        };
        !replaced && !zones.iter().enumerate().any(better)
    };
    zones.iter().enumerate().map(counts).collect()
}

/// The zones that count ([`which_count`]), by name (A to Z before AA), and the others in the same order.
pub fn current_zones(mut zones: Vec<Zone>) -> (Vec<Zone>, Vec<Zone>) {
    let key = |z: &Zone| (z.name.len(), z.name.clone());
    zones.sort_by_key(key);
    let mut counts = which_count(&zones.iter().collect::<Vec<_>>()).into_iter();
    zones.into_iter().partition(|_| counts.next() == Some(true))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn zone(name: &str, bounds: Rectangle, replaces: &[&str]) -> Zone {
        Zone {
            replaces: replaces.iter().map(|&r| r.into()).collect(),
            ..Zone::new(name, bounds)
        }
    }

    #[test]
    fn of_one_name_the_largest_counts_and_none_that_another_one_replaces() {
        let small = zone("A", [0.0, 0.0, 1.0, 1.0], &[]);
        let large = zone("A", [0.0, 0.0, 2.0, 1.0], &["B"]);
        let gone = zone("B", [3.0, 0.0, 9.0, 9.0], &[]);
        let late = zone("AA", [0.0, 5.0, 1.0, 6.0], &[]);
        let other = zone("C", [0.0, 7.0, 1.0, 8.0], &[]);
        let all = vec![
            late.clone(),
            large.clone(),
            small.clone(),
            gone.clone(),
            other.clone(),
        ];
        let (current, superseded) = current_zones(all);
        assert_eq!(current, [large, other, late]);
        assert_eq!(superseded, [small, gone]);
    }

    #[test]
    fn of_equal_boxes_of_one_name_the_last_counts() {
        let [a, b] = [1.0, 2.0].map(|flagged_area| Zone {
            flagged_area,
            ..zone("A", [0.0, 0.0, 1.0, 1.0], &[])
        });
        assert_eq!(which_count(&[&a, &b]), [false, true]);
        assert_eq!(current_zones(vec![a, b.clone()]).0, [b]);
    }

    #[test]
    fn a_zone_is_one_of_its_name_and_box_however_that_was_rounded() {
        let a = zone("A", [0.0, 0.0, 0.1 + 0.2, 1.0], &[]);
        assert!(a.is(&zone("A", [0.0, 0.0, 0.3, 1.0], &[])));
        assert!(!a.is(&zone("A", [0.0, 0.0, 0.3001, 1.0], &[])));
        assert!(!a.is(&zone("B", a.bounds, &[])));
    }

    #[test]
    fn a_zone_holds_what_lies_deep_enough_from_its_cuts_and_up_to_its_free_sides() {
        let mut z = zone("A", [0.0, 0.0, 1.0, 1.0], &[]);
        z.free_sides = [true, false, false, false];
        assert!(z.holds(&[0.0, 0.5, 9.0], 0.2) && z.holds(&[0.8, 0.8], 0.2));
        assert!(!z.holds(&[0.9, 0.5], 0.2) && !z.holds(&[-0.1, 0.5], 0.2));
        assert!(z.holds(&[1.0, 1.0], 0.0) && !z.holds(&[1.0 + 2e-6, 1.0], 0.0));
    }

    #[test]
    fn a_zone_keeps_what_a_stranger_tells_of_it() {
        let text = r#"{"name":"A","box":[0.0,0.0,1.0,1.0],"free_sides":[true,false,false,false],"priority":3}"#;
        let zone: Zone = serde_json::from_str(text).unwrap();
        let again = serde_json::to_value(&zone).unwrap();
        assert_eq!(again["priority"], 3);
        assert!(again.get("defect_box").is_none() && again.get("replaces").is_none());
    }
}
