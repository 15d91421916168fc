//! Where a defect lies on a ply: what the maps and the 3D view highlight.

use crate::plain::locate::Locator;
use crate::plain::ply::{Marked, Ply, Vec3};
use plyflow_model::artifact::{ComparedDefect, Defect, DefectKind};
use std::collections::BTreeMap;

/// A ring around a defect of which no node is known has at least this radius (m).
const LEAST_RADIUS: f64 = 5e-3;
/// Points of such a ring.
const RING: usize = 32;

/// A line on a ply.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Line {
    /// On the flat ply (m); empty when that is not known.
    pub(crate) flat: Vec<[f64; 2]>,
    /// On the formed ply (m).
    pub(crate) formed: Vec<Vec3>,
}

/// A defect where it lies.
#[derive(Debug, Clone, Default)]
pub(crate) struct Place {
    /// Its name on the page, one of its own.
    pub(crate) id: String,
    /// Its name for people.
    pub(crate) label: String,
    /// Its ply.
    pub(crate) ply: String,
    /// The zone on whose finer ply it was found.
    pub(crate) zone: Option<String>,
    /// Its outlines, closed, and its crest where one is known.
    pub(crate) lines: Vec<Line>,
    /// Its middle on the formed ply (m).
    pub(crate) at: Vec3,
    /// Unit normal of the formed ply there, on the side that was up.
    pub(crate) normal: Vec3,
}

/// The name on the page of a defect of a comparison.
pub(crate) fn id_of(study: usize, defect: &str) -> String {
    format!("{study}-{defect}")
}

/// The name on the page of the defect in a row of the table of a measurement.
pub(crate) fn id_of_row(instance: usize, row: usize) -> String {
    format!("step-{instance}-{row}")
}

/// The cells of a defect; where it hangs together with others of its kind, those that lie nearer to its centre.
pub(crate) fn cells_of(ply: &Ply, d: &Defect, rivals: &[[f64; 2]]) -> Vec<[u32; 4]> {
    let kind = match d.kind {
        DefectKind::Wrinkle => Marked::Wrinkle,
        DefectKind::Bridging => Marked::Other,
    };
    let marked = ply.cells.iter().zip(&ply.marked);
    let marked = marked.filter(|(_, m)| **m == kind);
    let marked: Vec<[u32; 4]> = marked.map(|(c, _)| *c).collect();
    let groups = groups(&marked, ply.flat.len());
    let middle = |cells: &[[u32; 4]]| {
        let at = |c: &[u32; 4]| c.map(|i| ply.flat[i as usize]);
        let points: Vec<Vec3> = cells.iter().flat_map(at).collect();
        let m = mean(&points);
        [m[0], m[1]]
    };
    let nearest = groups.into_iter().min_by(|a, b| {
        let off = |g: &[[u32; 4]]| apart(middle(g), d.centre);
        off(a).total_cmp(&off(b))
    });
    let mut cells = nearest.unwrap_or_default();
    let whole = cells.clone();
    cells.retain(|c| {
        let at = middle(std::slice::from_ref(c));
        rivals.iter().all(|r| apart(at, d.centre) <= apart(at, *r))
    });
    if cells.is_empty() { whole } else { cells }
}

/// Cells that hang together by their nodes, in the order of their first cells.
fn groups(cells: &[[u32; 4]], points: usize) -> Vec<Vec<[u32; 4]>> {
    fn root(of: &mut [u32], mut i: u32) -> u32 {
        while of[i as usize] != i {
            of[i as usize] = of[of[i as usize] as usize];
            i = of[i as usize];
        }
        i
    }
    let mut of: Vec<u32> = (0..points as u32).collect();
    for cell in cells {
        let to = root(&mut of, cell[0]);
        for i in cell {
            let from = root(&mut of, *i);
            of[from as usize] = to;
        }
    }
    let mut at: BTreeMap<u32, usize> = BTreeMap::new();
    let mut all: Vec<Vec<[u32; 4]>> = Vec::new();
    for cell in cells {
        let k = *at.entry(root(&mut of, cell[0])).or_insert_with(|| {
            all.push(Vec::new());
            all.len() - 1
        });
        all[k].push(*cell);
    }
    all
}

/// The place of cells: the rings around them.
pub(crate) fn of_cells(flat: &[Vec3], formed: &[Vec3], cells: &[[u32; 4]]) -> Place {
    let line = |ring: Vec<u32>| Line {
        flat: (ring.iter())
            .map(|i| [flat[*i as usize][0], flat[*i as usize][1]])
            .collect(),
        formed: ring.iter().map(|i| formed[*i as usize]).collect(),
    };
    let corners = cells.as_flattened().iter();
    let corners: Vec<Vec3> = corners.map(|i| formed[*i as usize]).collect();
    Place {
        lines: rings(cells).into_iter().map(line).collect(),
        at: mean(&corners),
        normal: normal(flat, formed, cells),
        ..Place::default()
    }
}

/// The closed lines of nodes around cells; the first node stands again at the end.
fn rings(cells: &[[u32; 4]]) -> Vec<Vec<u32>> {
    let sides = |c: &[u32; 4]| [0, 1, 2, 3].map(|k| (c[k], c[(k + 1) % 4]));
    let mut count: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    for (a, b) in cells.iter().flat_map(sides) {
        *count.entry((a.min(b), a.max(b))).or_default() += 1;
    }
    let mut next: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for (a, b) in cells.iter().flat_map(sides) {
        if count[&(a.min(b), a.max(b))] == 1 {
            next.entry(a).or_default().push(b);
        }
    }
    let mut all = Vec::new();
    while let Some(start) = next.keys().next().copied() {
        let mut ring = vec![start];
        let mut at = start;
        while let Some(ends) = next.get_mut(&at) {
            let to = ends.remove(0);
            if ends.is_empty() {
                next.remove(&at);
            }
            ring.push(to);
            at = to;
            if at == start {
                break;
            }
        }
        all.push(ring);
    }
    all
}

/// A circle about the centre of a defect, of its size.
pub(crate) fn ring(ply: &Ply, of: &ComparedDefect) -> Option<Place> {
    let locator = Locator::new(&ply.flat, &ply.cells);
    let on = |at: [f64; 2]| locator.carried(at, &ply.formed);
    let d = &of.found;
    let radius = (d.area.max(0.0) / std::f64::consts::PI).sqrt();
    let radius = radius.max(of.length / 2.0).max(LEAST_RADIUS);
    let mut line = Line::default();
    for k in 0..=RING {
        let a = (k % RING) as f64 / RING as f64 * std::f64::consts::TAU;
        let at = [
            d.centre[0] + radius * a.cos(),
            d.centre[1] + radius * a.sin(),
        ];
        if let Some(p) = on(at) {
            line.flat.push(at);
            line.formed.push(p);
        }
    }
    let at = on(d.centre).or_else(|| (!line.formed.is_empty()).then(|| mean(&line.formed)))?;
    let near = |c: &&[u32; 4]| {
        c.iter().any(|i| {
            let p = ply.flat[*i as usize];
            apart([p[0], p[1]], d.centre) <= radius
        })
    };
    let cells: Vec<[u32; 4]> = ply.cells.iter().filter(near).copied().collect();
    Some(Place {
        lines: vec![line],
        at,
        normal: normal(&ply.flat, &ply.formed, &cells),
        ..Place::default()
    })
}

/// Mean normal of formed cells, on the side that was up when they were flat; up when they face all sides.
pub(crate) fn normal(flat: &[Vec3], formed: &[Vec3], cells: &[[u32; 4]]) -> Vec3 {
    let twice = |points: &[Vec3], cell: &[u32; 4]| {
        let [a, b, c, d] = cell.map(|i| points[i as usize]);
        let (e, f) = (
            [0, 1, 2].map(|k| c[k] - a[k]),
            [0, 1, 2].map(|k| d[k] - b[k]),
        );
        [
            e[1] * f[2] - e[2] * f[1],
            e[2] * f[0] - e[0] * f[2],
            e[0] * f[1] - e[1] * f[0],
        ]
    };
    let mut sum = [0.0; 3];
    for cell in cells {
        let up = twice(flat, cell)[2].signum();
        let n = twice(formed, cell);
        (0..3).for_each(|k| sum[k] += up * n[k]);
    }
    let size = sum.iter().map(|v| v * v).sum::<f64>().sqrt();
    if size > 0.0 {
        sum.map(|v| v / size)
    } else {
        [0.0, 0.0, 1.0]
    }
}

fn mean(points: &[Vec3]) -> Vec3 {
    let n = points.len().max(1) as f64;
    [0, 1, 2].map(|d| points.iter().map(|p| p[d]).sum::<f64>() / n)
}

fn apart(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// A lattice of n x n unit cells.
    fn lattice(n: u32) -> (Vec<Vec3>, Vec<[u32; 4]>) {
        let at = |i| [f64::from(i % (n + 1)), f64::from(i / (n + 1)), 0.0];
        let quad = |c: u32| {
            let i = c / n * (n + 1) + c % n;
            [i, i + 1, i + n + 2, i + n + 1]
        };
        (
            (0..(n + 1) * (n + 1)).map(at).collect(),
            (0..n * n).map(quad).collect(),
        )
    }

    #[test]
    fn the_ring_around_cells_is_closed_and_a_hole_has_one_of_its_own() {
        let (flat, cells) = lattice(3);
        let around: Vec<[u32; 4]> = (0..9).filter(|c| *c != 4).map(|c| cells[c]).collect();
        let place = of_cells(&flat, &flat, &around);
        let mut lengths: Vec<usize> = place.lines.iter().map(|l| l.flat.len()).collect();
        lengths.sort_unstable();
        assert_eq!(lengths, [5, 13]);
        assert!(place.lines.iter().all(|l| l.flat.first() == l.flat.last()));
        assert_eq!(place.normal, [0.0, 0.0, 1.0]);
    }

    #[test]
    fn a_defect_takes_the_cells_that_hang_together_about_its_centre_and_shares_with_its_neighbour()
    {
        let (flat, cells) = lattice(9);
        let marked = |c: usize| [0, 1, 2, 6, 7].contains(&(c % 9)) && c / 9 == 4;
        let ply = Ply {
            formed: flat.clone(),
            flat,
            marked: (0..cells.len())
                .map(|c| {
                    if marked(c) {
                        Marked::Wrinkle
                    } else {
                        Marked::No
                    }
                })
                .collect(),
            cells,
            ..Ply::default()
        };
        let defect = |x: f64| -> Defect {
            let told =
                json!({"type": "wrinkle", "amplitude": 1e-3, "area": 1e-4, "centre": [x, 4.5]});
            serde_json::from_value(told).unwrap()
        };
        assert_eq!(cells_of(&ply, &defect(7.0), &[[1.5, 4.5]]).len(), 2);
        assert_eq!(cells_of(&ply, &defect(0.4), &[[2.4, 4.5]]).len(), 1);
    }
}
