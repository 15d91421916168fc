//! The part of a ply in a zone, whatever the ply's outline.

use crate::grid::{Grid, SAME_PLACE, cut_ply, is_less_than_a_cell, ply_grid};
use crate::outlined;
use plyflow_geometry::rectangle;
use plyflow_mechanics::mesh::even_axis;
use plyflow_model::artifact::Rectangle;
use plyflow_model::outline::{sides, signed_area, winds};

/// The part of a ply inside a zone (contours in m). Where the zone crosses an outline that is no upright rectangle, or a hole, it is the cells there
/// of the mesh that the whole ply would have.
///
/// # Errors
/// When elements of `size` (m) cannot follow the contours that the zone crosses.
pub fn ply_part(
    zone: Rectangle,
    outline: &[[f64; 2]],
    holes: &[Vec<[f64; 2]>],
    size: f64,
) -> Result<Option<Grid>, String> {
    let ply = rectangle::around(outline.iter().copied());
    let box_area = (ply[2] - ply[0]) * (ply[3] - ply[1]);
    // Only an upright rectangle fills its box.
    let rectangle = (signed_area(outline).abs() - box_area).abs() < SAME_PLACE * box_area;
    if (!rectangle && crosses(zone, outline)) || holes.iter().any(|h| crosses(zone, h)) {
        return outlined::part(zone, outline, holes, size);
    }
    if rectangle && holes.is_empty() {
        return Ok(ply_grid(zone, ply, size));
    }
    let middle = [0.5 * (zone[0] + zone[2]), 0.5 * (zone[1] + zone[3])];
    let material = (rectangle || winds(outline, middle)) && !holes.iter().any(|h| winds(h, middle));
    if !material {
        return Ok(None);
    }
    let part = rectangle::intersection(zone, ply);
    if is_less_than_a_cell(part, size) {
        return Ok(None);
    }
    // The mesh of the whole has no straight lines here that a zone could be cut along.
    let axes = [0, 1].map(|d| {
        let length = part[d + 2] - part[d];
        let cells = (length / size - SAME_PLACE).ceil();
        even_axis(part[d], part[d + 2], length / cells)
    });
    Ok(Some(cut_ply(axes, ply)))
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
