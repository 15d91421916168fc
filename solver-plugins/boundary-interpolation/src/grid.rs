//! Fine structured meshes of a zone's sheets, in the undeformed plane.

use plyflow_model::outline::{sides, signed_area, winds};
use plyflow_surface::flat_bounds;

/// `[x0, y0, x1, y1]` (m).
pub type Rectangle = [f64; 4];

/// Sides in the order left, right, bottom, top.
pub const SIDES: usize = 4;

/// Places nearer than this are the same (m).
pub const SAME_PLACE: f64 = 1e-6;

/// A flat mesh of quads, counter-clockwise from above.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// `[n]` (m).
    pub points: Vec<[f64; 2]>,
    /// `[m * 4]`.
    pub cells: Vec<u32>,
    /// Nodes on each side that is cut, in ascending order along it; `None` for free sides.
    pub cuts: [Option<Vec<u32>>; SIDES],
    /// The box that it fills (m).
    pub bounds: Rectangle,
}

impl Grid {
    /// All nodes on cut sides, ascending, each once.
    pub fn driven_nodes(&self) -> Vec<u32> {
        let mut nodes: Vec<u32> = self.cuts.iter().flatten().flatten().copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }
}

/// The part of a ply inside a zone. The ply is an upright rectangle, or the zone lies wholly inside of it.
///
/// # Errors
/// When the zone crosses an outline that is no upright rectangle, or a hole (contours in m).
pub fn ply_part(
    zone: Rectangle,
    outline: &[[f64; 2]],
    holes: &[Vec<[f64; 2]>],
    size: f64,
) -> Result<Option<Grid>, &'static str> {
    let ply = flat_bounds(outline.iter().copied());
    let box_area = (ply[2] - ply[0]) * (ply[3] - ply[1]);
    // Only an upright rectangle fills its box.
    let rectangle = (signed_area(outline).abs() - box_area).abs() < SAME_PLACE * box_area;
    if !rectangle && crosses(zone, outline) {
        return Err("its outline, which is no upright rectangle");
    }
    if holes.iter().any(|h| crosses(zone, h)) {
        return Err("a hole");
    }
    let middle = [0.5 * (zone[0] + zone[2]), 0.5 * (zone[1] + zone[3])];
    let material = (rectangle || winds(outline, middle)) && !holes.iter().any(|h| winds(h, middle));
    Ok(if material {
        ply_grid(zone, ply, size)
    } else {
        None
    })
}

/// Whether a contour has a part inside a box; one that only touches it has none.
fn crosses(zone: Rectangle, contour: &[[f64; 2]]) -> bool {
    sides(contour).any(|(a, b)| {
        // The part of the side between the zone's lines (Liang and Barsky 1984).
        let (mut from, mut to) = (0.0f64, 1.0f64);
        for d in 0..2 {
            let (low, high) = (zone[d] + SAME_PLACE, zone[d + 2] - SAME_PLACE);
            let way = b[d] - a[d];
            if way == 0.0 {
                if a[d] < low || a[d] > high {
                    return false;
                }
                continue;
            }
            let (s, t) = ((low - a[d]) / way, (high - a[d]) / way);
            from = from.max(s.min(t));
            to = to.min(s.max(t));
        }
        from <= to
    })
}

/// The part of a rectangular ply inside a zone. Sides where the zone reaches the ply's edge (or past it) are free, the
/// others are cut. `None` when less than one cell of the ply lies in the zone.
pub fn ply_grid(zone: Rectangle, ply: Rectangle, size: f64) -> Option<Grid> {
    let bounds = [
        zone[0].max(ply[0]),
        zone[1].max(ply[1]),
        zone[2].min(ply[2]),
        zone[3].min(ply[3]),
    ];
    if bounds[2] - bounds[0] < size - SAME_PLACE || bounds[3] - bounds[1] < size - SAME_PLACE {
        return None;
    }
    let free = [
        ply[0] >= zone[0] - SAME_PLACE,
        ply[2] <= zone[2] + SAME_PLACE,
        ply[1] >= zone[1] - SAME_PLACE,
        ply[3] <= zone[3] + SAME_PLACE,
    ];
    structured(bounds, size, free)
}

/// The part of a film under or over a zone: the zone and `margin` on every side, as far as the film reaches.
/// All sides are cut.
pub fn film_grid(zone: Rectangle, film: Rectangle, margin: f64, size: f64) -> Option<Grid> {
    let bounds = [
        (zone[0] - margin).max(film[0]),
        (zone[1] - margin).max(film[1]),
        (zone[2] + margin).min(film[2]),
        (zone[3] + margin).min(film[3]),
    ];
    if bounds[0] >= bounds[2] || bounds[1] >= bounds[3] {
        return None;
    }
    structured(bounds, size, [false; SIDES])
}

fn structured(b: Rectangle, size: f64, free: [bool; SIDES]) -> Option<Grid> {
    // The slack keeps a side of a whole number of cells from getting one more by rounding.
    let count = |d: usize| (((b[d + 2] - b[d]) / size - 1e-6).ceil() as usize).max(1);
    let (nx, ny) = (count(0), count(1));
    let at = |d: usize, i: usize, n: usize| {
        if i == n {
            b[d + 2]
        } else {
            b[d] + (b[d + 2] - b[d]) * i as f64 / n as f64
        }
    };
    let number = |i: usize, j: usize| (j * (nx + 1) + i) as u32;
    let mut cells = Vec::new();
    for j in 0..ny {
        for i in 0..nx {
            cells.extend([
                number(i, j),
                number(i + 1, j),
                number(i + 1, j + 1),
                number(i, j + 1),
            ]);
        }
    }
    let points = (0..=ny)
        .flat_map(|j| (0..=nx).map(move |i| [at(0, i, nx), at(1, j, ny)]))
        .collect();
    let row = |j: usize| (0..=nx).map(|i| number(i, j)).collect::<Vec<_>>();
    let column = |i: usize| (0..=ny).map(|j| number(i, j)).collect::<Vec<_>>();
    let all = [column(0), column(nx), row(0), row(ny)];
    let mut sides = all
        .into_iter()
        .zip(free)
        .map(|(nodes, free)| (!free).then_some(nodes));
    let cuts = std::array::from_fn(|_| sides.next().flatten());
    Some(Grid {
        points,
        cells,
        cuts,
        bounds: b,
    })
}
