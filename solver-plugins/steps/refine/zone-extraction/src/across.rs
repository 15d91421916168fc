//! Cuts that run across what is flagged.

use crate::extract::{FlaggedCell, Settings, defects};
use plyflow_model::artifact::{Rectangle, Zone};

/// Where the cut of a zone runs across a defect: on both sides of it, cells of one ply are flagged.
#[derive(Debug, Clone, PartialEq)]
pub struct Across {
    /// Index of the zone.
    pub zone: usize,
    /// Side of the zone: 0 to 3 for x0, y0, x1, y1.
    pub side: usize,
    /// Index of the ply.
    pub ply: usize,
    /// Length of the side over which it does (m).
    pub length: f64,
    /// From where to where along the side (m).
    pub from_to: [f64; 2],
    /// The side at which nothing would be cut (m): beyond the defect, which may be the blank's edge.
    pub free_at: f64,
}

/// Coordinates that differ by less are the same (m).
const SLACK: f64 = 1e-7;

/// All places where the cut of a zone of a `blank` runs across a defect, by zone, side and ply. Sides at the blank's edge are no cuts.
#[must_use]
pub fn across(
    cells: &[FlaggedCell],
    zones: &[Zone],
    blank: Rectangle,
    settings: &Settings,
) -> Vec<Across> {
    let mut found = Vec::new();
    for set in defects(cells, blank, settings) {
        let plies = set.cells.iter().map(|&c| cells[c].ply);
        let (least, most) = (plies.clone().min(), plies.max());
        for (zone, z) in zones.iter().enumerate() {
            for (side, _) in SIDES.iter().zip(z.free_sides).filter(|(_, free)| !free) {
                for ply in least.unwrap_or(0)..=most.unwrap_or(0) {
                    let members = set.cells.iter().map(|&c| &cells[c]);
                    let of_ply = members.filter(|c| c.ply == ply).map(|c| c.bounds);
                    let cut = shared(of_ply, z.bounds, *side);
                    let length: f64 = cut.iter().map(|c| c[1] - c[0]).sum();
                    if length > SLACK {
                        found.push(Across {
                            zone,
                            side: *side,
                            ply,
                            length,
                            from_to: [cut[0][0], cut[cut.len() - 1][1]],
                            free_at: set.bounds[*side],
                        });
                    }
                }
            }
        }
    }
    found.sort_by_key(|a| (a.zone, a.side, a.ply));
    found
}

/// Left, right, bottom, top, as `free_sides` of a zone has them, by their place in its bounds.
const SIDES: [usize; 4] = [0, 2, 1, 3];

/// Where along a side of a box cells lie on both sides of it.
fn shared(
    cells: impl Iterator<Item = Rectangle> + Clone,
    zone: Rectangle,
    side: usize,
) -> Vec<[f64; 2]> {
    let (across, line) = (side % 2, zone[side]);
    let along = 1 - across;
    let range = |c: Rectangle| {
        let (from, to) = (c[along].max(zone[along]), c[along + 2].min(zone[along + 2]));
        (from + SLACK < to).then_some([from, to])
    };
    let touch = |c: &Rectangle| c[across] <= line + SLACK && c[across + 2] >= line - SLACK;
    let below = joined(
        (cells.clone().filter(touch))
            .filter(|c| c[across] < line - SLACK)
            .filter_map(range),
    );
    let above = joined(
        cells
            .filter(touch)
            .filter(|c| c[across + 2] > line + SLACK)
            .filter_map(range),
    );
    let both = |a: &[f64; 2], b: &[f64; 2]| {
        let (from, to) = (a[0].max(b[0]), a[1].min(b[1]));
        (from + SLACK < to).then_some([from, to])
    };
    let pairs = below
        .iter()
        .flat_map(|a| above.iter().filter_map(move |b| both(a, b)));
    pairs.collect()
}

/// Ranges in their order, with those joined that touch.
fn joined(ranges: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    let mut all: Vec<[f64; 2]> = ranges.collect();
    all.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut done: Vec<[f64; 2]> = Vec::new();
    for range in all {
        match done.last_mut() {
            Some(last) if range[0] <= last[1] + SLACK => last[1] = last[1].max(range[1]),
            _ => done.push(range),
        }
    }
    done
}
