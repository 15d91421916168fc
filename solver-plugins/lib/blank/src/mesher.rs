//! From the coarse mesh to elements: every quad becomes four, every triangle three; then the nodes near the edge are moved to
//! where the elements are best.

use crate::coarse::{Coarse, OnEdge, coarse_mesh, grid_spacings, key};
use crate::edge::{Curve, check_features};
use crate::error::MeshError;
use crate::quality;
use crate::smooth::{Moving, Place};
use plyflow_mechanics::mesh::QuadMesh;
use plyflow_model::outline::{Millimetres, Point, Region};
use std::collections::BTreeMap;

/// Nodes farther than this many elements from the last cell that is not of the grid stay on the grid.
const MOVED_RINGS: usize = 3;

/// A fine mesh while it grows.
#[derive(Default)]
struct Fine {
    points: Vec<Point>,
    places: Vec<Place>,
    cells: Vec<[u32; 4]>,
    regular: Vec<bool>,
}

/// Meshes a region with convex quads of edges near `size` (m) that follow its contours, in the plane z = 0.
///
/// # Errors
/// When something of the region is too small for the elements ([`crate::LEAST_FEATURE`]), or cannot be followed.
pub fn mesh_region(region: &Region, size: f64) -> Result<QuadMesh, MeshError> {
    let curves: Vec<Curve> = region.contours().map(|c| Curve::new(c)).collect();
    check_features(region, &curves, size)?;
    let coarse = coarse_mesh(region, &curves, 2.0 * size)?;
    let mut fine = split(&coarse, &curves);
    hold_grid(&mut fine);
    let [hx, hy] = grid_spacings(region, 2.0 * size);
    Moving {
        points: &mut fine.points,
        places: &mut fine.places,
        cells: &fine.cells,
        curves: &curves,
        area: 0.25 * hx * hy,
    }
    .smooth();
    let mesh = ordered(&fine, size);
    let quality = quality::of(&mesh, region, size);
    if quality.least_scaled_jacobian <= 0.0 {
        return Err(MeshError::Coarse {
            size: 1e3 * size,
            at: Millimetres(quality.worst_at),
            why: "a cell there is folded",
        });
    }
    Ok(mesh)
}

fn split(coarse: &Coarse, curves: &[Curve]) -> Fine {
    let mut fine = Fine::default();
    let place = |on: &OnEdge| {
        if on.stop.pinned {
            Place::Fixed
        } else {
            Place::OnEdge(on.contour, on.stop.at)
        }
    };
    for (p, on) in coarse.points.iter().zip(&coarse.on_edge) {
        fine.points.push(*p);
        fine.places.push(on.as_ref().map_or(Place::Free, place));
    }
    let mut middles: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    for (polygon, regular) in coarse.polygons.iter().zip(&coarse.regular) {
        let k = polygon.len();
        let corners: Vec<Point> = polygon.iter().map(|n| coarse.points[*n as usize]).collect();
        let centre = fine.points.len() as u32;
        fine.points
            .push([0, 1].map(|c| corners.iter().map(|p| p[c]).sum::<f64>() / k as f64));
        fine.places.push(Place::Free);
        let edges: Vec<u32> = (0..k)
            .map(|e| {
                let edge = key(polygon[e], polygon[(e + 1) % k]);
                *middles.entry(edge).or_insert_with(|| {
                    let (point, at) = match coarse.edge_middles.get(&edge) {
                        Some(on) => (curves[on.contour].point(on.stop.at), place(on)),
                        None => {
                            let (p, q) = (
                                coarse.points[edge.0 as usize],
                                coarse.points[edge.1 as usize],
                            );
                            ([0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])], Place::Free)
                        }
                    };
                    fine.points.push(point);
                    fine.places.push(at);
                    fine.points.len() as u32 - 1
                })
            })
            .collect();
        for e in 0..k {
            fine.cells
                .push([polygon[e], edges[e], centre, edges[(e + k - 1) % k]]);
            fine.regular.push(*regular);
        }
    }
    fine
}

/// Fixes the nodes well inside the grid.
fn hold_grid(fine: &mut Fine) {
    let mut moved = vec![false; fine.points.len()];
    for (cell, _) in fine.cells.iter().zip(&fine.regular).filter(|(_, r)| !**r) {
        for n in cell {
            moved[*n as usize] = true;
        }
    }
    for _ in 0..MOVED_RINGS {
        let before = moved.clone();
        for cell in &fine.cells {
            if cell.iter().any(|n| before[*n as usize]) {
                cell.iter().for_each(|n| moved[*n as usize] = true);
            }
        }
    }
    for (place, _) in fine.places.iter_mut().zip(&moved).filter(|(_, m)| !**m) {
        *place = Place::Fixed;
    }
}

/// Numbers nodes and cells along rows of elements, so that what is near is near in memory.
fn ordered(fine: &Fine, size: f64) -> QuadMesh {
    let row = |p: Point| ((p[1] / size).floor() as i64, p[0]);
    let sorted = |at: &dyn Fn(usize) -> Point, n: usize| {
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|a, b| {
            let ((i, x), (j, y)) = (row(at(*a)), row(at(*b)));
            i.cmp(&j).then(x.total_cmp(&y)).then(a.cmp(b))
        });
        order
    };
    let order = sorted(&|n| fine.points[n], fine.points.len());
    let mut number = vec![0u32; order.len()];
    for (to, from) in order.iter().enumerate() {
        number[*from] = to as u32;
    }
    let centre = |c: usize| {
        [0, 1].map(|k| {
            fine.cells[c]
                .iter()
                .map(|n| fine.points[*n as usize][k])
                .sum::<f64>()
                / 4.0
        })
    };
    let cells = sorted(&centre, fine.cells.len());
    QuadMesh {
        points: order
            .iter()
            .map(|n| [fine.points[*n][0], fine.points[*n][1], 0.0])
            .collect(),
        cells: cells
            .iter()
            .map(|c| fine.cells[*c].map(|n| number[n as usize]))
            .collect(),
    }
}
