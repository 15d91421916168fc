//! Fine structured meshes of a zone's sheets, in the undeformed plane.

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

/// The part of a ply inside a zone. Sides where the zone reaches the ply's edge (or past it) are free, the
/// others are cut. Of an outline that is no upright rectangle, the cells with their centre inside are kept,
/// so slanted edges become steps of one cell. `None` when less than one cell of the ply lies in the zone.
pub fn ply_grid(zone: Rectangle, outline: &[[f64; 2]], size: f64) -> Option<Grid> {
    let mut ply = [
        f64::INFINITY,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NEG_INFINITY,
    ];
    for &[x, y] in outline {
        ply = [ply[0].min(x), ply[1].min(y), ply[2].max(x), ply[3].max(y)];
    }
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
    // Shoelace formula: only an upright rectangle fills its box.
    let next = outline.iter().cycle().skip(1);
    let twice: f64 = outline
        .iter()
        .zip(next)
        .map(|(p, q)| p[0] * q[1] - q[0] * p[1])
        .sum();
    let around = (ply[2] - ply[0]) * (ply[3] - ply[1]);
    let rectangle = (0.5 * twice.abs() - around).abs() < SAME_PLACE * around;
    let keep = |centre: [f64; 2]| rectangle || inside(outline, centre);
    structured(bounds, size, free, keep)
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
    structured(bounds, size, [false; SIDES], |_| true)
}

fn structured(
    b: Rectangle,
    size: f64,
    free: [bool; SIDES],
    keep: impl Fn([f64; 2]) -> bool,
) -> Option<Grid> {
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
    let mut number = vec![u32::MAX; (nx + 1) * (ny + 1)];
    let mut cells = Vec::new();
    for j in 0..ny {
        for i in 0..nx {
            let centre = [
                0.5 * (at(0, i, nx) + at(0, i + 1, nx)),
                0.5 * (at(1, j, ny) + at(1, j + 1, ny)),
            ];
            if keep(centre) {
                for (i, j) in [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)] {
                    let node = j * (nx + 1) + i;
                    number[node] = 0;
                    cells.push(node as u32);
                }
            }
        }
    }
    let mut points = Vec::new();
    for j in 0..=ny {
        for i in 0..=nx {
            let number = &mut number[j * (nx + 1) + i];
            if *number == 0 {
                *number = points.len() as u32;
                points.push([at(0, i, nx), at(1, j, ny)]);
            }
        }
    }
    if cells.is_empty() {
        return None;
    }
    cells.iter_mut().for_each(|c| *c = number[*c as usize]);
    let used = |node: usize| (number[node] != u32::MAX).then_some(number[node]);
    let row = |j: usize| {
        (0..=nx)
            .filter_map(|i| used(j * (nx + 1) + i))
            .collect::<Vec<_>>()
    };
    let column = |i: usize| {
        (0..=ny)
            .filter_map(|j| used(j * (nx + 1) + i))
            .collect::<Vec<_>>()
    };
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

/// Whether a point lies inside a polygon (even-odd rule).
fn inside(outline: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
    let n = outline.len();
    (0..n).fold(false, |odd, i| {
        let ([ax, ay], [bx, by]) = (outline[i], outline[(i + 1) % n]);
        let crosses = (ay > y) != (by > y) && x < ax + (y - ay) / (by - ay) * (bx - ax);
        odd != crosses
    })
}
