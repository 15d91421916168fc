//! A profile (fillet, then a wall down to the bed) swept around a rounded rectangle, then deformed by
//! joggles. Structured, closed, with exact fillets before deformation.

use crate::mesh::ToolMesh;
use plyflow_fixed::FixedBits;
use plyflow_model::tool::shape::{JoggleShape, SparShape};
use std::f64::consts::FRAC_PI_2;

/// The closed surface with edges up to `facet` and chords within `tolerance`.
pub(crate) fn mesh(shape: &SparShape, facet: f64, tolerance: f64) -> ToolMesh {
    let grid = TopGrid::new(shape, facet, tolerance);
    let mut mesh = ToolMesh::default();
    let mut top = vec![Vec::new(); grid.lines.len()];
    for (i, line) in grid.lines.iter().enumerate() {
        for j in 0..=grid.across {
            let [x, y] = line.point(j, grid.across);
            top[i].push(mesh.push(shape.deform([x, y, shape.height])));
        }
    }
    for i in 0..grid.lines.len() - 1 {
        for j in 0..grid.across {
            mesh.quad(top[i][j], top[i + 1][j], top[i + 1][j + 1], top[i][j + 1]);
        }
    }
    mesh_walls(shape, &mut mesh, &grid, &top, [facet, tolerance]);
    mesh
}

/// Fillets, walls and the bottom, hung on the outline of the top.
fn mesh_walls(
    shape: &SparShape,
    mesh: &mut ToolMesh,
    grid: &TopGrid,
    top: &[Vec<u32>],
    [facet, tolerance]: [f64; 2],
) {
    let outline = grid.outline();
    let arc = shape.arc_angle();
    let arcs = (arc / arc_step(shape.fillet, tolerance, facet))
        .ceil()
        .max(3.0) as usize;
    let longest = outline
        .iter()
        .map(|o| shape.wall_length(o.base, o.normal))
        .fold(0.0, f64::max);
    let walls = (longest / (SLACK * facet)).ceil().max(1.0) as usize;
    let mut ring: Vec<u32> = outline.iter().map(|o| top[o.line][o.place]).collect();
    for k in 1..=arcs + walls {
        let next: Vec<u32> = outline
            .iter()
            .map(|o| {
                let profile = if k <= arcs {
                    shape.fillet_point(arc * k as f64 / arcs as f64)
                } else {
                    let length = shape.wall_length(o.base, o.normal);
                    shape.wall_point(length * (k - arcs) as f64 / walls as f64)
                };
                let mut p = shape.surface(o.base, o.normal, profile);
                if k == arcs + walls {
                    p[2] = 0.0;
                }
                mesh.push(p)
            })
            .collect();
        for b in 0..ring.len() {
            let c = (b + 1) % ring.len();
            mesh.quad(ring[b], next[b], next[c], ring[c]);
        }
        ring = next;
    }
    mesh_bottom(mesh, grid, &outline, &ring);
}

/// The bottom on z = 0 inside the outline's last ring, in the lines of the top.
fn mesh_bottom(mesh: &mut ToolMesh, grid: &TopGrid, outline: &[OutlinePoint], ring: &[u32]) {
    let mut bottom = vec![vec![u32::MAX; grid.across + 1]; grid.lines.len()];
    for (o, &p) in outline.iter().zip(ring) {
        bottom[o.line][o.place] = p;
    }
    for line in &mut bottom {
        let ends = [line[0], line[grid.across]].map(|p| mesh.points[p as usize]);
        for (j, place) in line.iter_mut().enumerate() {
            if *place == u32::MAX {
                let w = j as f64 / grid.across as f64;
                let at = |k: usize| ends[0][k] + w * (ends[1][k] - ends[0][k]);
                *place = mesh.push([at(0), at(1), 0.0]);
            }
        }
    }
    for i in 0..bottom.len() - 1 {
        for j in 0..grid.across {
            mesh.quad(
                bottom[i][j],
                bottom[i][j + 1],
                bottom[i + 1][j + 1],
                bottom[i + 1][j],
            );
        }
    }
}

/// Sides of a quadrilateral as a part of the largest edge: its diagonal must keep it too, after the ramps
/// have sheared it.
const SLACK: f64 = 0.55;

/// Angle between points on an arc for a chord error, and for edges up to `facet`.
pub(crate) fn arc_step(radius: f64, tolerance: f64, facet: f64) -> f64 {
    if radius <= 0.0 {
        return FRAC_PI_2;
    }
    let chord = 2.0 * (1.0 - (tolerance / radius).min(0.5)).fixed_acos();
    chord.min(SLACK * facet / radius)
}

/// A line x = constant across the top.
#[derive(Debug, Clone, Copy)]
struct TopLine {
    x: f64,
    half: f64,
    /// Direction of the outline's normal at the end y > 0, as an angle from x.
    normal: f64,
}

impl TopLine {
    fn point(&self, j: usize, across: usize) -> [f64; 2] {
        [self.x, self.half * (2.0 * j as f64 / across as f64 - 1.0)]
    }
}

/// A point of the top's outline.
struct OutlinePoint {
    base: [f64; 2],
    normal: [f64; 2],
    line: usize,
    place: usize,
}

struct TopGrid {
    lines: Vec<TopLine>,
    /// Intervals across.
    across: usize,
}

impl TopGrid {
    fn new(shape: &SparShape, facet: f64, tolerance: f64) -> Self {
        let step = SLACK * facet;
        let ([low, high], half, radius) = shape.top();
        let foot = radius + shape.wall_point(shape.height / shape.draft.fixed_cos()).0;
        let turns = (FRAC_PI_2 / arc_step(foot, tolerance, facet))
            .ceil()
            .max(2.0) as usize;
        let corner = |k: usize| {
            let angle = FRAC_PI_2 * k as f64 / turns as f64;
            (
                radius * (1.0 - angle.fixed_cos()),
                half - radius + radius * angle.fixed_sin(),
                angle,
            )
        };
        let mut lines = Vec::new();
        for k in 0..=turns {
            let (x, half, angle) = corner(k);
            lines.push(TopLine {
                x: low + x,
                half,
                normal: std::f64::consts::PI - angle,
            });
        }
        for x in stations(shape, low + radius, high - radius, step, tolerance) {
            lines.push(TopLine {
                x,
                half,
                normal: FRAC_PI_2,
            });
        }
        for k in (0..=turns).rev() {
            let (x, half, angle) = corner(k);
            lines.push(TopLine {
                x: high - x,
                half,
                normal: angle,
            });
        }
        let widest =
            2.0 * half + 2.0 * shape.joggles.iter().map(JoggleShape::widening).sum::<f64>();
        TopGrid {
            lines,
            across: (widest / step).ceil().max(2.0) as usize,
        }
    }

    /// The outline counter-clockwise seen from above.
    fn outline(&self) -> Vec<OutlinePoint> {
        let last = self.lines.len() - 1;
        let mut places: Vec<(usize, usize)> = (0..=last).map(|i| (i, 0)).collect();
        places.extend((1..=self.across).map(|j| (last, j)));
        places.extend((0..last).rev().map(|i| (i, self.across)));
        places.extend((1..self.across).rev().map(|j| (0, j)));
        places
            .into_iter()
            .map(|(line, place)| {
                let l = &self.lines[line];
                let side = if place == 0 {
                    -1.0
                } else if place == self.across {
                    1.0
                } else {
                    0.0
                };
                let normal = if line == 0 {
                    [-1.0, 0.0]
                } else if line == last {
                    [1.0, 0.0]
                } else {
                    [l.normal.fixed_cos(), side * l.normal.fixed_sin()]
                };
                OutlinePoint {
                    base: l.point(place, self.across),
                    normal,
                    line,
                    place,
                }
            })
            .collect()
    }
}

/// x between the corners, closer where a joggle bends the surface.
fn stations(shape: &SparShape, low: f64, high: f64, step: f64, tolerance: f64) -> Vec<f64> {
    let mut breaks = vec![(low, step)];
    let foot = shape.half_width + (shape.height + 0.05) * shape.draft.fixed_tan();
    for j in &shape.joggles {
        let slant = foot * j.skew.fixed_tan().abs();
        let fine = (arc_step(j.fillet, tolerance, f64::MAX) * j.fillet).min(step);
        breaks.push(((j.start - slant).max(low), fine));
        breaks.push(((j.start + j.length + slant).min(high), step));
    }
    breaks.push((high, step));
    let mut found = Vec::new();
    for pair in breaks.windows(2) {
        let ((from, step), (to, _)) = (pair[0], pair[1]);
        if to <= from {
            continue;
        }
        let n = ((to - from) / step).ceil().max(1.0) as usize;
        found.extend((1..=n).map(|k| from + (to - from) * k as f64 / n as f64));
    }
    // `low` and `high` are lines of the corners.
    found.pop();
    found
}

#[cfg(test)]
pub(crate) mod tests;
