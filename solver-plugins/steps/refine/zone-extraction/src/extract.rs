//! From flagged cells to zones, all in the undeformed plane.

use plyflow_geometry::rectangle::{self, hull};
use plyflow_model::artifact::{Rectangle, Zone};
use serde::Deserialize;
use serde_json::Map;

/// How zones are drawn.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Settings {
    /// Factor on both sides of a box, about its centre.
    pub scale: f64,
    /// Largest gap inside a defect (m).
    pub join_distance: f64,
    /// Smallest flagged area of a defect on its most affected ply (m2).
    pub minimum_area: f64,
    /// How many times a defect at a side of the blank's box counts, and once more at a corner.
    pub edge_factor: f64,
    /// Smallest side of a zone before clipping (m).
    pub minimum_size: f64,
    /// Factor on what that leaves between a defect and each side of its zone.
    pub wider: f64,
    /// Covered part of the blank above which there is a warning.
    pub maximum_fraction: f64,
    /// Zones drawn by hand, `[x0, y0, x1, y1]` (m).
    pub boxes: Vec<Vec<f64>>,
    /// By how much a side of a zone that a defect reaches is moved out, over the zone's size across it.
    pub growth: f64,
}

/// A flagged cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlaggedCell {
    /// Index of its ply.
    pub ply: usize,
    /// The box around it (m).
    pub bounds: Rectangle,
    /// Undeformed area (m2).
    pub area: f64,
}

/// Why no zones could be drawn.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ExtractError {
    /// A hand-drawn box is not one.
    #[error(
        "box {index} of `boxes` is {given:?}; expected four lengths [x0, y0, x1, y1] with x0 < x1 and y0 < y1"
    )]
    Form {
        /// Position in the list.
        index: usize,
        /// As given (m).
        given: Vec<f64>,
    },
    /// A hand-drawn box misses the blank.
    #[error("box {index} of `boxes`, {given:?} m, lies outside of the blank {blank:?} m; move it")]
    Outside {
        /// Position in the list.
        index: usize,
        /// As given (m).
        given: Vec<f64>,
        /// The blank (m).
        blank: Rectangle,
    },
}

/// Draws the zones of a `blank` (the box around all plies). Without flagged cells and boxes there are none. `names`: of the plies.
///
/// # Errors
/// When a hand-drawn box is not a box or lies off the blank.
pub fn extract(
    cells: &[FlaggedCell],
    names: &[String],
    blank: Rectangle,
    settings: &Settings,
) -> Result<Vec<Zone>, ExtractError> {
    let mut zones = if settings.boxes.is_empty() {
        let defects = defects(cells, blank, settings);
        let mut zones: Vec<(Rectangle, Rectangle)> = (defects.iter())
            .map(|d| (d.bounds, grown(d.bounds, blank, settings)))
            .collect();
        merge(&mut zones, blank, settings);
        zones.sort_by(|a, b| a.1[0].total_cmp(&b.1[0]).then(a.1[1].total_cmp(&b.1[1])));
        zones
    } else {
        drawn(blank, settings)?
    };
    let describe = |(i, (defect_box, bounds)): (usize, (Rectangle, Rectangle))| {
        let inside = |c: &&FlaggedCell| overlap(c.bounds, bounds);
        let mut plies: Vec<usize> = cells.iter().filter(inside).map(|c| c.ply).collect();
        plies.sort_unstable();
        plies.dedup();
        Zone {
            name: name(i),
            bounds,
            defect_box: Some(defect_box),
            free_sides: free_sides(bounds, blank),
            plies: plies.iter().map(|&p| names[p].clone()).collect(),
            // A fold: the sum of nothing is -0 in Rust.
            flagged_area: cells.iter().filter(inside).fold(0.0, |sum, c| sum + c.area),
            replaces: Vec::new(),
            other: Map::new(),
        }
    };
    Ok(zones.drain(..).enumerate().map(describe).collect())
}

/// A .. Z, AA, AB, ..
fn name(index: usize) -> String {
    let letter = char::from(b'A' + (index % 26) as u8);
    match index / 26 {
        0 => letter.to_string(),
        more => format!("{}{letter}", name(more - 1)),
    }
}

/// A connected set of flagged cells.
pub(crate) struct FlaggedSet {
    /// The box around it (m).
    pub(crate) bounds: Rectangle,
    /// Indices of its cells.
    pub(crate) cells: Vec<usize>,
}

/// Places on a side of the blank's box lie on it, however they were rounded (m).
const ON_EDGE: f64 = 1e-6;

/// By how much more a set counts that the blank's edge cuts off: by `factor` for a side of the box across x, and for one across y.
fn at_edges(bounds: Rectangle, blank: Rectangle, factor: f64) -> f64 {
    let cut =
        |d: &usize| bounds[*d] <= blank[*d] + ON_EDGE || bounds[d + 2] >= blank[d + 2] - ON_EDGE;
    [0, 1]
        .iter()
        .filter(|d| cut(d))
        .fold(1.0, |all, _| all * factor)
}

/// Connected sets of flagged cells that are large enough on some ply of a `blank`.
pub(crate) fn defects(
    cells: &[FlaggedCell],
    blank: Rectangle,
    settings: &Settings,
) -> Vec<FlaggedSet> {
    let set = connected(cells, settings.join_distance);
    let plies = cells.iter().map(|c| c.ply + 1).max().unwrap_or(0);
    let mut found = Vec::new();
    for root in 0..cells.len() {
        if set[root] != root {
            continue;
        }
        let mut areas = vec![0.0; plies];
        let mut bounds = cells[root].bounds;
        let members: Vec<usize> = (0..cells.len()).filter(|&c| set[c] == root).collect();
        for &c in &members {
            areas[cells[c].ply] += cells[c].area;
            bounds = hull(bounds, cells[c].bounds);
        }
        let factor = at_edges(bounds, blank, settings.edge_factor);
        // A little slack: areas of cells are sums of rounded numbers.
        if areas
            .iter()
            .any(|a| factor * a >= settings.minimum_area * (1.0 - 1e-9))
        {
            found.push(FlaggedSet {
                bounds,
                cells: members,
            });
        }
    }
    found
}

/// For every cell the lowest index of its connected set.
fn connected(cells: &[FlaggedCell], gap: f64) -> Vec<usize> {
    fn root(parent: &mut [usize], mut i: usize) -> usize {
        while parent[i] != i {
            parent[i] = parent[parent[i]];
            i = parent[i];
        }
        i
    }
    // Sweep along x: only cells whose x ranges come within the gap are compared. The slack lets cells that
    // touch count as touching however their coordinates were rounded.
    let gap = gap + 1e-9;
    let mut order: Vec<usize> = (0..cells.len()).collect();
    order.sort_by(|&a, &b| {
        cells[a].bounds[0]
            .total_cmp(&cells[b].bounds[0])
            .then(a.cmp(&b))
    });
    let widest = cells
        .iter()
        .map(|c| c.bounds[2] - c.bounds[0])
        .fold(0.0, f64::max);
    let mut parent: Vec<usize> = (0..cells.len()).collect();
    for (k, &i) in order.iter().enumerate() {
        let a = cells[i].bounds;
        for &j in &order[k + 1..] {
            let b = cells[j].bounds;
            if b[0] > a[0] + widest + gap {
                break;
            }
            if b[0] <= a[2] + gap && b[1] <= a[3] + gap && a[1] <= b[3] + gap {
                let (p, q) = (root(&mut parent, i), root(&mut parent, j));
                parent[p.max(q)] = p.min(q);
            }
        }
    }
    (0..cells.len()).map(|i| root(&mut parent, i)).collect()
}

/// A defect's box scaled, brought to the smallest size, its margins widened, clipped, and its sides near the blank's edge moved
/// onto it.
fn grown(defect: Rectangle, blank: Rectangle, s: &Settings) -> Rectangle {
    let mut b = [0.0; 4];
    for d in 0..2 {
        let centre = 0.5 * (defect[d] + defect[d + 2]);
        let size = defect[d + 2] - defect[d];
        let half = 0.5 * widened(size, (size * s.scale).max(s.minimum_size), s.wider);
        b[d] = tidy(centre - half);
        b[d + 2] = tidy(centre + half);
    }
    onto_edges(b, blank, s.join_distance)
}

/// The size of a zone of this size around a defect (m), what it has beyond the defect being multiplied.
fn widened(defect: f64, zone: f64, wider: f64) -> f64 {
    zone + (wider - 1.0) * (zone - defect)
}

/// A box that was drawn by hand, its margins widened: it counts as a defect's box that was scaled.
fn widened_box(b: Rectangle, s: &Settings) -> Rectangle {
    if s.wider == 1.0 {
        return b;
    }
    let mut wide = b;
    for d in 0..2 {
        let (centre, size) = (0.5 * (b[d] + b[d + 2]), b[d + 2] - b[d]);
        let half = 0.5 * widened(size / s.scale, size, s.wider);
        (wide[d], wide[d + 2]) = (tidy(centre - half), tidy(centre + half));
    }
    wide
}

/// A box with its sides that lie beyond the blank's edge, or nearer to it than `gap` (m), moved onto it.
pub(crate) fn onto_edges(mut b: Rectangle, blank: Rectangle, gap: f64) -> Rectangle {
    for d in 0..2 {
        if b[d] < blank[d] + gap {
            b[d] = blank[d];
        }
        if b[d + 2] > blank[d + 2] - gap {
            b[d + 2] = blank[d + 2];
        }
    }
    b
}

/// Left, right, bottom, top: whether the side lies on the edge of the blank.
pub(crate) fn free_sides(bounds: Rectangle, blank: Rectangle) -> [bool; 4] {
    [0, 2, 1, 3].map(|k| bounds[k] == blank[k])
}

/// To 0.1 um, so that people can read it.
pub(crate) fn tidy(length: f64) -> f64 {
    (length * 1e7).round() / 1e7
}

/// Replaces zones that overlap, or nearly touch, by one around both of their defects, until none do: a strip so narrow between
/// two cuts would be driven from both sides and belong to neither.
fn merge(zones: &mut Vec<(Rectangle, Rectangle)>, blank: Rectangle, settings: &Settings) {
    let first_pair = |zones: &[(Rectangle, Rectangle)]| {
        (0..zones.len()).find_map(|i| {
            (i + 1..zones.len())
                .find(|&j| near(zones[i].1, zones[j].1, settings.join_distance))
                .map(|j| (i, j))
        })
    };
    while let Some((i, j)) = first_pair(zones) {
        let (a, b) = (zones[i], zones.remove(j));
        let defect = hull(a.0, b.0);
        // The hull of the old boxes: a zone never loses what it had.
        zones[i] = (defect, hull(grown(defect, blank, settings), hull(a.1, b.1)));
    }
}

fn drawn(
    blank: Rectangle,
    settings: &Settings,
) -> Result<Vec<(Rectangle, Rectangle)>, ExtractError> {
    (settings.boxes.iter().enumerate())
        .map(|(index, given)| {
            let b = match given[..] {
                [x0, y0, x1, y1] if x0 < x1 && y0 < y1 => [x0, y0, x1, y1],
                _ => {
                    return Err(ExtractError::Form {
                        index,
                        given: given.clone(),
                    });
                }
            };
            let wide = widened_box(b, settings);
            let clipped = [
                wide[0].max(blank[0]),
                wide[1].max(blank[1]),
                wide[2].min(blank[2]),
                wide[3].min(blank[3]),
            ];
            if clipped[0] < clipped[2] && clipped[1] < clipped[3] {
                Ok((b, clipped))
            } else {
                Err(ExtractError::Outside {
                    index,
                    given: given.clone(),
                    blank,
                })
            }
        })
        .collect()
}

/// Whether two boxes share area.
fn overlap(a: Rectangle, b: Rectangle) -> bool {
    rectangle::near(a, b, 0.0)
}

/// Whether two boxes lie less than `gap` (m) apart.
pub(crate) fn near(a: Rectangle, b: Rectangle, gap: f64) -> bool {
    rectangle::near(a, b, gap - 1e-9 * f64::from(gap > 0.0))
}
