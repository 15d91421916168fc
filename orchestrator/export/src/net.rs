//! Lines of fibres: straight and at even distances in the flat ply, and where the formed ply carries them.

use crate::vec3::{Vec3, add_scaled, scaled};
use plyflow_fixed::FixedBits;
use std::collections::BTreeMap;

/// Most lines of a family in a ply: more than anybody looks at, and than a cutter draws.
pub(crate) const MOST: usize = 10_000;

/// A line of fibres, flat and formed, point by point.
#[derive(Debug, Clone, PartialEq)]
pub struct Fibre {
    /// In the flat ply.
    pub flat: Vec<Vec3>,
    /// In the formed ply.
    pub formed: Vec<Vec3>,
}

/// A ply as lines are drawn on it.
#[derive(Debug, Clone, Copy)]
pub struct Net<'a> {
    /// `[points]`, in the flat ply. Of these, x and y count.
    pub flat: &'a [Vec3],
    /// `[points]`, in the formed ply.
    pub formed: &'a [Vec3],
    /// `[cells][corners]`, points at the corners of a cell, one behind the other.
    pub cells: &'a [u32],
    /// Corners of a cell: 3 or 4.
    pub corners: usize,
    /// The cells through which lines go.
    pub through: &'a [usize],
}

impl Net<'_> {
    pub(crate) fn corners(&self, cell: usize) -> &[u32] {
        &self.cells[cell * self.corners..(cell + 1) * self.corners]
    }
}

/// More lines than there may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TooMany {
    /// How many.
    pub lines: f64,
    /// How many there may be.
    pub most: usize,
    /// A distance that does, to two digits.
    pub would: f64,
}

/// Where a line crosses a side of the mesh.
#[derive(Debug, Clone, Copy)]
struct Crossing {
    side: [u32; 2],
    /// How far along the line.
    along: f64,
    flat: Vec3,
    formed: Vec3,
}

/// Lines of a family with the direction `angle` (rad, from x) in the flat ply. They are multiples of `distance`
/// (in the unit of the points) from x = y = 0, in the order of these, and from their beginning on. A line that cells interrupt is several.
/// A line that is the ply's edge itself is one where the ply lies to its right.
///
/// # Errors
/// When there would be too many.
pub fn fibres(net: &Net<'_>, angle: f64, distance: f64) -> Result<Vec<Fibre>, TooMany> {
    let (sin, cos) = angle.fixed_sin_cos();
    // Points that are on a line but for rounding are on it: where fibres run along the mesh, all of a row are.
    let across = |p: Vec3| {
        let height = (cos * p[1] - sin * p[0]) / distance;
        let whole = height.round();
        if (height - whole).abs() < 1e-9 {
            whole
        } else {
            height
        }
    };
    let heights: Vec<f64> = net.flat.iter().map(|p| across(*p)).collect();
    let span = |cell: usize| {
        let of = net.corners(cell).iter().map(|i| heights[*i as usize]);
        of.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], h| {
            [a.min(h), b.max(h)]
        })
    };
    let cells = net.through;
    let all = cells
        .iter()
        .map(|c| span(*c))
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], [c, d]| {
            [a.min(c), b.max(d)]
        });
    if all[1] - all[0] > MOST as f64 {
        let lines = all[1] - all[0];
        return Err(TooMany {
            lines,
            most: MOST,
            // Two digits are enough of what is an advice.
            would: rounded_up(lines / MOST as f64 * distance),
        });
    }
    let mut pieces: BTreeMap<i64, Vec<[Crossing; 2]>> = BTreeMap::new();
    for &cell in cells {
        let [low, high] = span(cell);
        for line in low.ceil() as i64..=high.floor() as i64 {
            let mut found = crossings(net, cell, &heights, line as f64, [cos, sin]);
            found.sort_by(|a, b| a.along.total_cmp(&b.along));
            let of = pieces.entry(line).or_default();
            of.extend(found.chunks_exact(2).map(|c| [c[0], c[1]]));
        }
    }
    Ok(pieces.into_values().flat_map(joined).collect())
}

/// To two digits, upwards.
pub(crate) fn rounded_up(value: f64) -> f64 {
    let mut step = 1e-12;
    while step * 100.0 < value {
        step *= 10.0;
    }
    // Printed, and parsed again, it is the number that one would write.
    let text = format!("{:.1e}", (value / step).ceil() * step);
    text.parse().unwrap_or(value)
}

/// A line crosses a side when one end lies below it and the other does not. So it never ends on a corner.
fn crossings(
    net: &Net<'_>,
    cell: usize,
    heights: &[f64],
    line: f64,
    direction: [f64; 2],
) -> Vec<Crossing> {
    let corners = net.corners(cell);
    let mut found = Vec::new();
    for k in 0..corners.len() {
        let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
        // From the smaller node on, so that both cells of a side find the same bits.
        let side = [a.min(b), a.max(b)];
        let [start, end] = side.map(|n| heights[n as usize]);
        if (start < line) == (end < line) {
            continue;
        }
        let share = (line - start) / (end - start);
        let at = |points: &[Vec3]| {
            let [p, q] = side.map(|n| points[n as usize]);
            add_scaled(scaled(1.0 - share, p), share, q)
        };
        let flat = at(net.flat);
        found.push(Crossing {
            side,
            along: direction[0] * flat[0] + direction[1] * flat[1],
            flat,
            formed: at(net.formed),
        });
    }
    found
}

/// Pieces of one line, joined where they share a side: from each end that lies foremost, as far as they go.
fn joined(pieces: Vec<[Crossing; 2]>) -> Vec<Fibre> {
    let mut at: BTreeMap<[u32; 2], Vec<usize>> = BTreeMap::new();
    for (k, piece) in pieces.iter().enumerate() {
        for crossing in piece {
            at.entry(crossing.side).or_default().push(k);
        }
    }
    let mut ends: Vec<(usize, Crossing)> = Vec::new();
    for (k, piece) in pieces.iter().enumerate() {
        ends.extend(
            piece
                .iter()
                .filter(|c| at[&c.side].len() == 1)
                .map(|c| (k, *c)),
        );
    }
    ends.sort_by(|a, b| a.1.along.total_cmp(&b.1.along));
    let mut used = vec![false; pieces.len()];
    let mut lines = Vec::new();
    for (first, from) in ends {
        let (mut line, mut side) = (vec![from], from.side);
        let mut next = Some(first).filter(|k| !used[*k]);
        while let Some(k) = next {
            used[k] = true;
            let [a, b] = pieces[k];
            let to = if a.side == side { b } else { a };
            // Where the line meets a corner, a piece may have no length.
            if line.last().is_some_and(|l| l.flat != to.flat) {
                line.push(to);
            }
            side = to.side;
            next = at[&side].iter().copied().find(|k| !used[*k]);
        }
        if line.len() > 1 {
            lines.push(Fibre {
                flat: line.iter().map(|c| c.flat).collect(),
                formed: line.iter().map(|c| c.formed).collect(),
            });
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_4, PI};

    /// A ply of the tests.
    struct Sheet {
        flat: Vec<Vec3>,
        formed: Vec<Vec3>,
        cells: Vec<u32>,
    }

    impl Sheet {
        fn lines(&self, angle: f64, distance: f64) -> Result<Vec<Fibre>, TooMany> {
            let through: Vec<usize> = (0..self.cells.len() / 4).collect();
            let net = Net {
                flat: &self.flat,
                formed: &self.formed,
                cells: &self.cells,
                corners: 4,
                through: &through,
            };
            fibres(&net, angle, distance)
        }
    }

    /// Three by two cells of 1 m from x = y = 0, formed by a turn about x; without the cells named.
    fn sheet(without: &[usize]) -> Sheet {
        let flat: Vec<Vec3> = (0..12)
            .map(|i| [f64::from(i % 4), f64::from(i / 4), 5.0])
            .collect();
        let cells = (0..6u32)
            .filter(|c| !without.contains(&(*c as usize)))
            .flat_map(|c| {
                let a = 4 * (c / 3) + c % 3;
                [a, a + 1, a + 5, a + 4]
            })
            .collect();
        Sheet {
            formed: flat.iter().map(|p| [p[0], 0.0, p[1]]).collect(),
            flat,
            cells,
        }
    }

    #[test]
    fn lines_run_through_and_are_carried_along() {
        let lines = sheet(&[]).lines(0.0, 0.8).unwrap();
        // At 0 the line is the edge itself, and nothing lies below it.
        let heights: Vec<f64> = lines.iter().map(|l| l.flat[0][1]).collect();
        assert_eq!(lines.len(), 2);
        for (line, height) in lines.iter().zip([0.8, 1.6]) {
            assert_eq!(line.flat.len(), 4, "{heights:?}");
            for (k, (flat, formed)) in line.flat.iter().zip(&line.formed).enumerate() {
                assert!((flat[0] - k as f64).abs() < 1e-15 && (flat[1] - height).abs() < 1e-15);
                assert!((formed[2] - height).abs() < 1e-15 && formed[1].abs() < 1e-15);
            }
        }
        let back = sheet(&[]).lines(PI, 0.8).unwrap();
        // Here the edge at 0 has the ply on its right.
        assert_eq!(back.len(), 3);
        assert!(
            back[0].flat[0][0] > back[0].flat[3][0],
            "from its beginning on"
        );
    }

    #[test]
    fn a_gap_parts_a_line_and_slanted_lines_end_on_the_edge() {
        let lines = sheet(&[1]).lines(0.0, 0.5).unwrap();
        let points: Vec<usize> = lines.iter().map(|l| l.flat.len()).collect();
        // 0.5 and 1 beside the gap, 1.5 and 2 above it.
        assert_eq!(points, [2, 2, 2, 2, 4, 4]);
        for line in sheet(&[]).lines(FRAC_PI_4, 0.3).unwrap() {
            for p in [line.flat[0], line.flat[line.flat.len() - 1]] {
                let on = |x: f64, end: f64| x.abs() < 1e-12 || (x - end).abs() < 1e-12;
                assert!(on(p[0], 3.0) || on(p[1], 2.0), "{p:?}");
            }
        }
    }

    #[test]
    fn lines_along_the_mesh_and_through_its_corners_are_whole() {
        for (angle, distance, count) in [
            (0.0, 1.0, 2),
            (PI / 2.0, 1.0, 3),
            (PI, 1.0, 2),
            (FRAC_PI_4, 0.5f64.sqrt(), 4),
        ] {
            let mut sheet = sheet(&[]);
            // A grid about x = y = 0 has heights that differ in their last bits.
            sheet
                .flat
                .iter_mut()
                .for_each(|p| *p = [p[0] - 1.5 + 0.5, p[1] - 1.0, 0.0]);
            let lines = sheet.lines(angle, distance).unwrap();
            assert_eq!(lines.len(), count, "{angle}: {lines:?}");
            for line in &lines {
                let ordered = line.flat.windows(2).all(|w| {
                    (w[1][0] - w[0][0]) * angle.cos() + (w[1][1] - w[0][1]) * angle.sin() > 0.1
                });
                assert!(ordered, "{angle}: {line:?}");
            }
        }
    }

    #[test]
    fn too_many_lines_are_refused_with_a_distance_that_does() {
        let error = sheet(&[]).lines(0.0, 1e-6).unwrap_err();
        assert!(error.lines > error.most as f64);
        assert!(sheet(&[]).lines(0.0, error.would).is_ok(), "{error:?}");
    }
}
