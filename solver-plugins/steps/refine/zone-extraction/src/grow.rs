//! Zones whose local run shows a defect at the cut: they are drawn again, larger, and run again.

use crate::extract::{Settings, free_sides, near, onto_edges, tidy};
use plyflow_geometry::rectangle::hull;
use plyflow_model::artifact::{Rectangle, Zone};

/// What growing asks of a defect of a local run.
#[derive(Debug, Clone, PartialEq)]
pub struct AtCut {
    /// Such as CW1.
    pub id: String,
    /// Its zone's name.
    pub zone: String,
    /// Left, right, bottom, top: the sides of the cut that it reaches.
    pub cut_sides: [bool; 4],
}

/// Those of the `zones` that have a defect at their cut, drawn larger: every side that one reaches is moved out by
/// `growth` times the zone's size across it. Where a zone then meets others, one zone takes the place of all, with the name of the first. With them
/// the texts that tell why.
pub fn grow(
    zones: &[Zone],
    defects: &[AtCut],
    blank: Rectangle,
    settings: &Settings,
) -> Vec<(Zone, String)> {
    let mut all: Vec<(Zone, Option<String>)> = (zones.iter())
        .map(|z| match reached(z, defects) {
            (_, ids) if ids.is_empty() => (z.clone(), None),
            (sides, ids) => (larger(z, sides, blank, settings), Some(ids.join(", "))),
        })
        .collect();
    let pair = |all: &[(Zone, Option<String>)]| {
        let grown = (0..all.len()).filter(|&i| all[i].1.is_some());
        let mut pairs = grown.flat_map(|i| {
            (0..all.len())
                .filter(move |&j| j != i)
                .map(move |j| (i.min(j), i.max(j)))
        });
        pairs.find(|&(i, j)| near(all[i].0.bounds, all[j].0.bounds, settings.join_distance))
    };
    while let Some((i, j)) = pair(&all) {
        let (b, why) = all.remove(j);
        let a = &mut all[i];
        a.0.bounds = hull(a.0.bounds, b.bounds);
        a.0.defect_box = match (a.0.defect_box, b.defect_box) {
            (Some(a), Some(b)) => Some(hull(a, b)),
            (a, b) => a.or(b),
        };
        a.0.free_sides = free_sides(a.0.bounds, blank);
        a.0.plies.extend(b.plies);
        a.0.plies.sort();
        a.0.plies.dedup();
        a.0.flagged_area += b.flagged_area;
        a.0.replaces.push(b.name);
        a.0.replaces.extend(b.replaces);
        let reasons: Vec<String> = [a.1.take(), why].into_iter().flatten().collect();
        a.1 = Some(reasons.join(", "));
    }
    all.into_iter()
        .filter_map(|(z, why)| Some((z, why?)))
        .collect()
}

/// The sides of its cut that defects of a zone reach, and their names.
fn reached(zone: &Zone, defects: &[AtCut]) -> ([bool; 4], Vec<String>) {
    let own = defects.iter().filter(|d| d.zone == zone.name);
    own.filter(|d| d.cut_sides.contains(&true)).fold(
        ([false; 4], Vec::new()),
        |(sides, mut ids), d| {
            ids.push(d.id.clone());
            ([0, 1, 2, 3].map(|k| sides[k] || d.cut_sides[k]), ids)
        },
    )
}

fn larger(zone: &Zone, sides: [bool; 4], blank: Rectangle, s: &Settings) -> Zone {
    let mut bounds = zone.bounds;
    for d in 0..2 {
        let step = s.growth * (zone.bounds[d + 2] - zone.bounds[d]);
        if sides[2 * d] {
            bounds[d] = tidy(bounds[d] - step);
        }
        if sides[2 * d + 1] {
            bounds[d + 2] = tidy(bounds[d + 2] + step);
        }
    }
    let bounds = onto_edges(bounds, blank, s.join_distance);
    Zone {
        bounds,
        free_sides: free_sides(bounds, blank),
        replaces: Vec::new(),
        ..zone.clone()
    }
}
