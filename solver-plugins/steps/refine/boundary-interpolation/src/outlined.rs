//! Zones across the edge of a ply that is no upright rectangle, or across a hole: cells of the whole ply's mesh.

use crate::grid::{Grid, SAME_PLACE, SIDES};
use plyflow_blank::Blank;
use plyflow_geometry::rectangle;
use plyflow_model::artifact::Rectangle;
use plyflow_model::outline::Region;
use std::collections::BTreeMap;

/// The cells in a zone of the mesh that the whole ply has in elements of `size` (m), which follows its contours (m): all that have a part in the zone.
/// `None` when the middle of none lies in it.
///
/// # Errors
/// When the contours bound no region, or elements of that size cannot follow them.
pub(crate) fn part(
    zone: Rectangle,
    outline: &[[f64; 2]],
    holes: &[Vec<[f64; 2]>],
    size: f64,
) -> Result<Option<Grid>, String> {
    let region = Region::new(outline.to_vec(), holes.to_vec()).map_err(|e| e.to_string())?;
    let (whole, _) = Blank::Region(region)
        .mesh(size)
        .map_err(|e| e.to_string())?;
    let at = |n: u32| {
        let [x, y, _] = whole.points[n as usize];
        [x, y]
    };
    let around = |cell: &[u32; 4]| rectangle::around(cell.map(at));
    let middle = |cell: &[u32; 4]| {
        let corners = cell.map(at);
        [0, 1].map(|d| 0.25 * corners.iter().map(|p| p[d]).sum::<f64>())
    };
    let within = |cell: &[u32; 4]| {
        let [x, y] = middle(cell);
        rectangle::holds_inside(zone, x, y)
    };
    if !whole.cells.iter().any(within) {
        return Ok(None);
    }
    let touches = |cell: &[u32; 4]| {
        let b = around(cell);
        (0..2).all(|d| b[d] < zone[d + 2] - SAME_PLACE && b[d + 2] > zone[d] + SAME_PLACE)
    };
    let kept: Vec<[u32; 4]> = whole.cells.iter().filter(|c| touches(c)).copied().collect();
    let mut nodes: Vec<u32> = kept.iter().flatten().copied().collect();
    nodes.sort_unstable();
    nodes.dedup();
    let own = |n: u32| nodes.partition_point(|k| *k < n) as u32;
    let points: Vec<[f64; 2]> = nodes.iter().map(|n| at(*n)).collect();
    Ok(Some(Grid {
        cells: kept.iter().flatten().map(|n| own(*n)).collect(),
        cuts: [const { None }; SIDES],
        outlined: true,
        pieces: cut_sides(&whole.cells, &kept)
            .into_iter()
            .map(|side| side.map(own))
            .collect(),
        bounds: rectangle::around(points.iter().copied()),
        points,
    }))
}

/// Sides of the `kept` cells beyond which a cell of `all` is left out, the kept one on their left.
fn cut_sides(all: &[[u32; 4]], kept: &[[u32; 4]]) -> Vec<[u32; 2]> {
    let sides = |cell: &[u32; 4]| {
        let c = *cell;
        (0..4).map(move |k| [c[k], c[(k + 1) % 4]])
    };
    let key = |[a, b]: [u32; 2]| [a.min(b), a.max(b)];
    let count = |cells: &[[u32; 4]]| {
        let mut count = BTreeMap::new();
        for side in cells.iter().flat_map(sides) {
            *count.entry(key(side)).or_insert(0u8) += 1;
        }
        count
    };
    let (in_all, in_kept) = (count(all), count(kept));
    let is_cut = |side: &[u32; 2]| in_kept[&key(*side)] == 1 && in_all[&key(*side)] == 2;
    kept.iter().flat_map(sides).filter(is_cut).collect()
}
