//! Fine structured meshes of a zone's sheets, in the undeformed plane.

use plyflow_geometry::rectangle;
use plyflow_mechanics::mesh::{even_axis, multiples_axis};
use plyflow_model::artifact::Rectangle;

/// Sides in the order left, right, bottom, top.
pub const SIDES: usize = 4;

/// Places nearer than this (m) are the same.
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
    /// Whether the mesh follows an outline: it has `pieces`, where it is cut, and no `cuts`.
    pub outlined: bool,
    /// Sides of its cells on the cut, the material on their left.
    pub pieces: Vec<[u32; 2]>,
    /// The box around it, which a mesh of rectangles fills (m).
    pub bounds: Rectangle,
}

impl Grid {
    /// All nodes on cut sides, ascending, each once.
    pub fn driven_nodes(&self) -> Vec<u32> {
        let sides = self.cuts.iter().flatten().flatten();
        let mut nodes: Vec<u32> = sides.chain(self.pieces.as_flattened()).copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }
}

/// The part of a rectangular ply in a zone, cut along lines of the mesh that the whole ply would have in elements of `size` (m):
/// the nearest that leave the zone inside. Sides where it reaches the ply's edge are free, the others are cut. `None` when less
/// than one cell of the ply lies in the zone.
pub fn ply_grid(zone: Rectangle, ply: Rectangle, size: f64) -> Option<Grid> {
    let part = rectangle::intersection(zone, ply);
    if is_less_than_a_cell(part, size) {
        return None;
    }
    let axes = [0, 1].map(|d| {
        let all = even_axis(ply[d], ply[d + 2], size);
        let from = all.partition_point(|x| *x <= part[d] + SAME_PLACE) - 1;
        let to = all.partition_point(|x| *x < part[d + 2] - SAME_PLACE);
        all[from..=to].to_vec()
    });
    Some(cut_ply(axes, ply))
}

pub(crate) fn is_less_than_a_cell(part: Rectangle, size: f64) -> bool {
    (0..2).any(|d| part[d + 2] - part[d] < size - SAME_PLACE)
}

/// A mesh between lines, free where these are a ply's edges.
pub(crate) fn cut_ply([xs, ys]: [Vec<f64>; 2], ply: Rectangle) -> Grid {
    let same = |line: f64, edge: f64| (line - edge).abs() < SAME_PLACE;
    let free = [
        same(xs[0], ply[0]),
        same(xs[xs.len() - 1], ply[2]),
        same(ys[0], ply[1]),
        same(ys[ys.len() - 1], ply[3]),
    ];
    structured(&xs, &ys, free)
}

/// The part of a film under or over a zone: the zone and `margin` on every side, as far as the film reaches, cut along whole
/// multiples of `size` (m), where the lines of a whole film of such elements are. All sides are cut.
pub fn film_grid(zone: Rectangle, film: Rectangle, margin: f64, size: f64) -> Option<Grid> {
    let wanted = [
        zone[0] - margin,
        zone[1] - margin,
        zone[2] + margin,
        zone[3] + margin,
    ];
    let [xs, ys] = [0, 1].map(|d| {
        let mut lines = multiples_axis(wanted[d], wanted[d + 2], size);
        lines.retain(|x| film[d] - SAME_PLACE <= *x && *x <= film[d + 2] + SAME_PLACE);
        lines
    });
    (xs.len() > 1 && ys.len() > 1).then(|| structured(&xs, &ys, [false; SIDES]))
}

/// Quads between lines (m), which ascend.
fn structured(xs: &[f64], ys: &[f64], free: [bool; SIDES]) -> Grid {
    let (nx, ny) = (xs.len() - 1, ys.len() - 1);
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
    let points = ys.iter().flat_map(|y| xs.iter().map(|x| [*x, *y]));
    let row = |j: usize| (0..=nx).map(|i| number(i, j)).collect::<Vec<_>>();
    let column = |i: usize| (0..=ny).map(|j| number(i, j)).collect::<Vec<_>>();
    let all = [column(0), column(nx), row(0), row(ny)];
    let mut sides = all
        .into_iter()
        .zip(free)
        .map(|(nodes, free)| (!free).then_some(nodes));
    let cuts = std::array::from_fn(|_| sides.next().flatten());
    Grid {
        points: points.collect(),
        cells,
        cuts,
        outlined: false,
        pieces: Vec::new(),
        bounds: [xs[0], ys[0], xs[nx], ys[ny]],
    }
}
