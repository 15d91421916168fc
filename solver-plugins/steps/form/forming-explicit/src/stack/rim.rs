//! The rim of a sheet of a model that is still flat.

use crate::stack::place::SheetIndex;
use plyflow_mechanics::mesh::area_vector;
use plyflow_mechanics::model::Model;
use std::collections::HashMap;

/// The edges of a cell, around it.
fn edges(c: &[u32; 4]) -> [[u32; 2]; 4] {
    [0, 1, 2, 3].map(|k| [c[k], c[(k + 1) % 4]])
}

/// Edges that belong to one cell alone.
fn free_edges(cells: &[[u32; 4]]) -> Vec<[u32; 2]> {
    let sorted = |[a, b]: [u32; 2]| [a.min(b), a.max(b)];
    let mut sides: HashMap<[u32; 2], usize> = HashMap::new();
    for edge in cells.iter().flat_map(edges) {
        *sides.entry(sorted(edge)).or_default() += 1;
    }
    (cells.iter().flat_map(edges))
        .filter(|e| sides[&sorted(*e)] == 1)
        .collect()
}

/// Edges (model nodes) that bound a sheet of a model that is still flat. At a mirror plane a sheet does not end.
fn rim(model: &Model, sheet: SheetIndex) -> Vec<[u32; 2]> {
    let planes = model.planes().0;
    let on = |n: &u32, k: usize| model.x()[*n as usize][k].abs() < 1e-9;
    let ends = |e: &[u32; 2]| !(0..2).any(|k| planes[k] && e.iter().all(|n| on(n, k)));
    let mut edges = free_edges(sheet.cells(model));
    edges.retain(ends);
    edges
}

/// The cells along the rim of a sheet of a model that is still flat; none where its rim is convex.
pub fn crooked_rim(model: &Model, sheet: SheetIndex) -> Vec<u32> {
    let edges = rim(model, sheet);
    let cells = sheet.cells(model);
    let x = |n: u32| model.x()[n as usize];
    let area = |c: &[u32; 4]| area_vector(c.map(x))[2].abs();
    let areas = cells.iter().map(area);
    let (whole, largest) = areas.fold((0.0, 0.0f64), |(w, l), a| (w + a, l.max(a)));
    let nodes = edges.iter().flatten().map(|n| [x(*n)[0], x(*n)[1]]);
    // Meshed curves are convex but for some hundredths of a cell.
    if hull_area(nodes.collect()) - whole < 0.5 * largest {
        return Vec::new();
    }
    let mut ends = edges.into_flattened();
    ends.sort_unstable();
    let at_rim = |corners: &[u32; 4]| corners.iter().any(|n| ends.binary_search(n).is_ok());
    let numbers = sheet.cell_range(model).map(|c| c as u32);
    (numbers.zip(cells))
        .filter_map(|(c, corners)| at_rim(corners).then_some(c))
        .collect()
}

/// Area (m2) of the convex hull of points in a plane (Andrew's monotone chain, 1979).
fn hull_area(mut points: Vec<[f64; 2]>) -> f64 {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let turn = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let chain = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut hull: Vec<[f64; 2]> = Vec::new();
        for p in points {
            while hull.len() > 1 && turn(hull[hull.len() - 2], hull[hull.len() - 1], p) <= 0.0 {
                hull.pop();
            }
            hull.push(p);
        }
        hull.pop();
        hull
    };
    let mut hull = chain(&mut points.iter().copied());
    hull.extend(chain(&mut points.iter().rev().copied()));
    let of_edge = |k: usize| {
        let (a, b) = (hull[k], hull[(k + 1) % hull.len()]);
        0.5 * (a[0] * b[1] - a[1] * b[0])
    };
    (0..hull.len()).map(of_edge).sum()
}
