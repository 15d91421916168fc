//! A profile (fillet, then a wall down to the bed) swept around a rounded rectangle, then deformed by
//! joggles. Structured, closed, with exact fillets before deformation.

use crate::mesh::ToolMesh;
use crate::ramp::Ramp;
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::Vec3;
use std::f64::consts::FRAC_PI_2;

/// The shape. Theoretical corners are where the top plane meets the planes of the walls.
#[derive(Debug, Clone)]
pub(crate) struct Sweep {
    /// x of the theoretical corners at both ends.
    pub ends: [f64; 2],
    /// y of the theoretical corners is +- this.
    pub half_width: f64,
    /// Height of the undeformed top over the bed.
    pub height: f64,
    /// Angle of the walls from the vertical.
    pub draft: f64,
    /// Radius between top and walls.
    pub fillet: f64,
    /// Radius in plan of the vertical edges at the theoretical corners; at least [`Sweep::setback`].
    pub corner: f64,
    pub joggles: Vec<JoggleShape>,
}

/// One joggle. Top and walls follow the same profile, each with its part: where a rise and a step of a wall
/// meet on the edge between, their curvatures add as vectors, so the profile's amplitude is that of the sum
/// and its fillets are the sharpest of the joggle.
#[derive(Debug, Clone)]
pub(crate) struct JoggleShape {
    pub start: f64,
    pub length: f64,
    pub skew: f64,
    /// From 0 to the amplitude, square to the slanted ramp.
    pub profile: Ramp,
    /// Change of height (m).
    pub rise: f64,
    /// Outward steps of the walls at y < 0 and y > 0 (m).
    pub sides: [f64; 2],
    pub fillet: f64,
}

impl JoggleShape {
    /// Length of the vector of rise and larger side step.
    pub fn amplitude(rise: f64, sides: [f64; 2]) -> f64 {
        rise.fixed_hypot(sides[0].abs().max(sides[1].abs()))
    }

    /// Part of the joggle that has happened at (x, y): 0 to 1.
    fn progress(&self, x: f64, y: f64) -> f64 {
        let amplitude = Self::amplitude(self.rise, self.sides);
        if amplitude == 0.0 {
            return 0.0;
        }
        let s = (x - self.start - y * self.skew.fixed_tan()) * self.skew.fixed_cos();
        self.profile.height(s) / amplitude
    }

    fn widening(&self) -> f64 {
        self.sides[0].max(self.sides[1]).max(0.0)
    }
}

impl Sweep {
    /// Angle of the fillet's arc.
    pub fn arc_angle(&self) -> f64 {
        FRAC_PI_2 - self.draft
    }

    /// Distance from the theoretical corner to where the fillet begins on the top.
    pub fn setback(&self) -> f64 {
        self.fillet * (0.5 * self.arc_angle()).fixed_tan()
    }

    /// Limits of the level top: x low, x high, half width, and its radius in plan.
    pub fn top(&self) -> ([f64; 2], f64, f64) {
        let t = self.setback();
        let radius = (self.corner - t).max(0.0);
        (
            [self.ends[0] + t, self.ends[1] - t],
            self.half_width - t,
            radius,
        )
    }

    /// Height that the joggles add at (x, y).
    pub fn lift(&self, x: f64, y: f64) -> f64 {
        self.joggles.iter().map(|j| j.rise * j.progress(x, y)).sum()
    }

    /// Outward step of a wall at x; side 0 is y < 0.
    fn side_step(&self, x: f64, side: usize) -> f64 {
        let y = if side == 0 {
            -self.half_width
        } else {
            self.half_width
        };
        self.joggles
            .iter()
            .map(|j| j.sides[side] * j.progress(x, y))
            .sum()
    }

    /// Moves a point of the undeformed shape. The walls and fillets step sideways as they are; the top
    /// stretches between them, from its middle third on.
    pub fn deform(&self, p: Vec3) -> Vec3 {
        let [x, y, z] = p;
        let side = usize::from(y > 0.0);
        let reach = self.half_width - self.corner.max(self.setback());
        let w = (y.abs() / reach).clamp(0.0, 1.0);
        let y = y + y.signum() * w * w * (3.0 - 2.0 * w) * self.side_step(x, side);
        [x, y, z + self.lift(x, y)]
    }

    /// Offset from the top's outline and height of the undeformed profile at angle `a` of the fillet.
    pub fn fillet_point(&self, a: f64) -> (f64, f64) {
        (
            self.fillet * a.fixed_sin(),
            self.height - self.fillet * (1.0 - a.fixed_cos()),
        )
    }

    /// The same at length `s` down the wall.
    pub fn wall_point(&self, s: f64) -> (f64, f64) {
        let (d, z) = self.fillet_point(self.arc_angle());
        (
            d + s * self.draft.fixed_sin(),
            z - s * self.draft.fixed_cos(),
        )
    }

    /// The deformed point at an offset and height of the profile, over a point of the top's outline.
    pub fn surface(&self, base: [f64; 2], normal: [f64; 2], profile: (f64, f64)) -> Vec3 {
        let (d, z) = profile;
        self.deform([base[0] + d * normal[0], base[1] + d * normal[1], z])
    }

    /// Length of the wall down to the bed at a point of the outline.
    pub fn wall_length(&self, base: [f64; 2], normal: [f64; 2]) -> f64 {
        let z = |s: f64| self.surface(base, normal, self.wall_point(s))[2];
        let (mut low, mut high) = (0.0, 2.0 * self.height + 1.0);
        // Bisection to the last bit: the walls fall steadily, and speed does not matter here.
        for _ in 0..80 {
            let middle = 0.5 * (low + high);
            if z(middle) > 0.0 {
                low = middle
            } else {
                high = middle
            }
        }
        0.5 * (low + high)
    }

    /// The closed surface with edges up to `facet` and chords within `tolerance`.
    pub fn mesh(&self, facet: f64, tolerance: f64) -> ToolMesh {
        let grid = TopGrid::new(self, facet, tolerance);
        let mut mesh = ToolMesh::default();
        let mut top = vec![Vec::new(); grid.lines.len()];
        for (i, line) in grid.lines.iter().enumerate() {
            for j in 0..=grid.across {
                let [x, y] = line.point(j, grid.across);
                top[i].push(mesh.push(self.deform([x, y, self.height])));
            }
        }
        for i in 0..grid.lines.len() - 1 {
            for j in 0..grid.across {
                mesh.quad(top[i][j], top[i + 1][j], top[i + 1][j + 1], top[i][j + 1]);
            }
        }
        self.mesh_walls(&mut mesh, &grid, &top, facet, tolerance);
        mesh
    }

    /// Fillets, walls and the bottom, hung on the outline of the top.
    fn mesh_walls(
        &self,
        mesh: &mut ToolMesh,
        grid: &TopGrid,
        top: &[Vec<u32>],
        facet: f64,
        tolerance: f64,
    ) {
        let outline = grid.outline();
        let arc = self.arc_angle();
        let arcs = (arc / arc_step(self.fillet, tolerance, facet))
            .ceil()
            .max(3.0) as usize;
        let longest = outline
            .iter()
            .map(|o| self.wall_length(o.base, o.normal))
            .fold(0.0, f64::max);
        let walls = (longest / (SLACK * facet)).ceil().max(1.0) as usize;
        let mut ring: Vec<u32> = outline.iter().map(|o| top[o.line][o.place]).collect();
        for k in 1..=arcs + walls {
            let next: Vec<u32> = outline
                .iter()
                .map(|o| {
                    let profile = if k <= arcs {
                        self.fillet_point(arc * k as f64 / arcs as f64)
                    } else {
                        let length = self.wall_length(o.base, o.normal);
                        self.wall_point(length * (k - arcs) as f64 / walls as f64)
                    };
                    let mut p = self.surface(o.base, o.normal, profile);
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
    fn new(sweep: &Sweep, facet: f64, tolerance: f64) -> Self {
        let step = SLACK * facet;
        let ([low, high], half, radius) = sweep.top();
        let foot = radius + sweep.wall_point(sweep.height / sweep.draft.fixed_cos()).0;
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
        for x in stations(sweep, low + radius, high - radius, step, tolerance) {
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
            2.0 * half + 2.0 * sweep.joggles.iter().map(JoggleShape::widening).sum::<f64>();
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
fn stations(sweep: &Sweep, low: f64, high: f64, step: f64, tolerance: f64) -> Vec<f64> {
    let mut breaks = vec![(low, step)];
    let foot = sweep.half_width + (sweep.height + 0.05) * sweep.draft.fixed_tan();
    for j in &sweep.joggles {
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
