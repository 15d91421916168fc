//! The fishnet algorithm (C. Mack, H. M. Taylor, The fitting of woven cloth to surfaces, J. Textile Institute 47,
//! 1956): fibres that do not stretch, pinned where they cross, laid over a surface cell by cell.

use crate::root::{Circle, Miss};
use crate::surface::DrapeSurface;
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{Vec3, add, cross, distance, dot, norm, scale, sub, unit};

/// How the first fibre of each family runs from the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Generators {
    /// Straight on the surface.
    Geodesic,
    /// In the vertical plane of its direction in the flat ply.
    Projection,
}

/// What a net is made of, in the flat ply.
#[derive(Debug, Clone, Copy)]
pub struct Fabric {
    /// Directions of the two families (rad from x); the second lies counter-clockwise of the first.
    pub directions: [f64; 2],
    /// Outline: x0, y0, x1, y1 (m).
    pub blank: [f64; 4],
    /// Where the net starts (m).
    pub start: [f64; 2],
    /// Distance of neighbouring nodes along the fibres (m).
    pub spacing: f64,
    /// Shear angle (rad) beyond which a cell is not closed.
    pub locking: f64,
    /// First fibres.
    pub generators: Generators,
    /// Distance of the ply's mid-plane from the tool (m); also its least height over the machine bed.
    pub offset: f64,
    /// Height of the machine bed, or in a press of what the tool stands on (m).
    pub bed: f64,
}

/// Why a node could not be placed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stop {
    /// Its cell would shear beyond the locking angle, or cannot be closed at all.
    Locked,
    /// The tool's surface ends.
    Edge,
    /// It would lie below the machine bed.
    Bed,
}

/// Where a node of the net stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Node {
    /// The ply does not need it.
    Unused,
    /// Not reached (yet).
    Waiting,
    /// On the surface: position (m) and surface normal.
    Placed(Vec3, Vec3),
    /// It could not be placed.
    Stopped(Stop),
    /// It hangs on nodes that could not be placed, for this reason.
    Behind(Stop),
}

impl Node {
    fn place(&self) -> Option<(Vec3, Vec3)> {
        match *self {
            Node::Placed(x, n) => Some((x, n)),
            _ => None,
        }
    }

    /// Why it is not placed, or what it hangs on is not.
    pub(crate) fn stop(&self) -> Option<Stop> {
        match *self {
            Node::Stopped(why) | Node::Behind(why) => Some(why),
            _ => None,
        }
    }
}

/// A draped net. Node (i, j) stands in the flat ply at start + i spacing e1 + j spacing e2.
#[derive(Debug, Clone)]
pub struct Net {
    /// What it is made of.
    pub fabric: Fabric,
    /// Lowest i and j.
    low: [i32; 2],
    /// Nodes along i and j.
    count: [usize; 2],
    nodes: Vec<Node>,
}

/// Most nodes of a net: about 1 GB.
pub(crate) const MOST_NODES: f64 = 1.2e7;
/// What a node takes (bytes).
pub(crate) const NODE_BYTES: f64 = size_of::<Node>() as f64;

impl Net {
    /// The empty net whose cells cover the blank; `None` when that takes too many nodes.
    pub fn new(fabric: Fabric) -> Option<Self> {
        let mut net = Self {
            fabric,
            low: [0; 2],
            count: [0; 2],
            nodes: Vec::new(),
        };
        let [x0, y0, x1, y1] = fabric.blank;
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for corner in [[x0, y0], [x1, y0], [x1, y1], [x0, y1]] {
            let at = net.coordinates(corner);
            for d in 0..2 {
                low[d] = low[d].min(at[d].floor());
                high[d] = high[d].max(at[d].ceil());
            }
        }
        let sizes = [0, 1].map(|d| high[d] - low[d] + 3.0);
        if sizes[0] * sizes[1] > MOST_NODES {
            return None;
        }
        net.low = low.map(|v| v as i32 - 1);
        net.count = sizes.map(|v| v as usize);
        net.nodes = vec![Node::Unused; net.count[0] * net.count[1]];
        for j in 0..net.count[1] as i32 - 1 {
            for i in 0..net.count[0] as i32 - 1 {
                let cell = [i + net.low[0], j + net.low[1]];
                if net.covers(cell) {
                    for corner in corners(cell) {
                        let k = net.index(corner).expect("inside the table");
                        net.nodes[k] = Node::Waiting;
                    }
                }
            }
        }
        Some(net)
    }

    /// Place in the flat ply (m) in steps of the net along both families.
    pub fn coordinates(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [a, b] = self.fabric.directions;
        let (px, py) = (x - self.fabric.start[0], y - self.fabric.start[1]);
        let sine = (b - a).fixed_sin() * self.fabric.spacing;
        [
            (px * b.fixed_sin() - py * b.fixed_cos()) / sine,
            (py * a.fixed_cos() - px * a.fixed_sin()) / sine,
        ]
    }

    /// Place of a node in the flat ply (m).
    pub fn flat(&self, [i, j]: [i32; 2]) -> [f64; 2] {
        let f = &self.fabric;
        let (u, v) = (f64::from(i) * f.spacing, f64::from(j) * f.spacing);
        let [a, b] = f.directions;
        [
            f.start[0] + u * a.fixed_cos() + v * b.fixed_cos(),
            f.start[1] + u * a.fixed_sin() + v * b.fixed_sin(),
        ]
    }

    fn index(&self, at: [i32; 2]) -> Option<usize> {
        let k = [0, 1].map(|d| i64::from(at[d]) - i64::from(self.low[d]));
        let inside = (0..2).all(|d| k[d] >= 0 && k[d] < self.count[d] as i64);
        inside.then(|| k[1] as usize * self.count[0] + k[0] as usize)
    }

    /// State of a node.
    pub fn node(&self, at: [i32; 2]) -> Node {
        self.index(at).map_or(Node::Unused, |k| self.nodes[k])
    }

    /// Position of a placed node (m).
    pub fn position(&self, at: [i32; 2]) -> Option<Vec3> {
        self.node(at).place().map(|p| p.0)
    }

    /// All nodes in a fixed order.
    pub fn nodes(&self) -> impl Iterator<Item = ([i32; 2], Node)> + '_ {
        self.nodes.iter().enumerate().map(|(k, node)| {
            let at = [
                (k % self.count[0]) as i32 + self.low[0],
                (k / self.count[0]) as i32 + self.low[1],
            ];
            (at, *node)
        })
    }

    /// Whether a cell (named by its lowest node) and the blank share area: no side of either parts them.
    fn covers(&self, cell: [i32; 2]) -> bool {
        let [x0, y0, x1, y1] = self.fabric.blank;
        let blank = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]];
        let cell = corners(cell).map(|c| self.flat(c));
        let [a, b] = self.fabric.directions;
        let axes = [
            [1.0, 0.0],
            [0.0, 1.0],
            [-a.fixed_sin(), a.fixed_cos()],
            [-b.fixed_sin(), b.fixed_cos()],
        ];
        axes.iter().all(|n| {
            let span = |p: &[[f64; 2]; 4]| {
                let along = p.map(|q| q[0] * n[0] + q[1] * n[1]);
                (
                    along.iter().copied().fold(f64::INFINITY, f64::min),
                    along.iter().copied().fold(f64::NEG_INFINITY, f64::max),
                )
            };
            let ((l0, h0), (l1, h1)) = (span(&cell), span(&blank));
            h0.min(h1) - l0.max(l1) > 1e-6 * self.fabric.spacing
        })
    }

    /// Shear angle (rad) at the centre of a cell, positive when the angle between the families has become
    /// smaller; `None` unless its four nodes are placed and its four sides as long as the spacing.
    pub fn shear(&self, cell: [i32; 2]) -> Option<f64> {
        let [a, b, c, d] = corners(cell).map(|at| self.position(at));
        let x = [a?, b?, c?, d?];
        let length = self.fabric.spacing;
        let whole =
            (0..4).all(|k| (distance(x[k], x[(k + 1) % 4]) - length).abs() <= 1e-6 * length);
        whole.then(|| self.shear_of(x))
    }

    fn shear_of(&self, [a, b, c, d]: [Vec3; 4]) -> f64 {
        let g1 = sub(add(b, c), add(a, d));
        let g2 = sub(add(c, d), add(a, b));
        let [first, second] = self.fabric.directions;
        (second - first) - norm(cross(g1, g2)).fixed_atan2(dot(g1, g2))
    }

    /// Drapes the net from `place` (m) on the surface, whose unit normal there is `normal`. `tick` hears
    /// now and then what part is done.
    ///
    /// # Errors
    /// Only those of `tick`.
    pub fn drape<E>(
        &mut self,
        surface: &dyn DrapeSurface,
        place: Vec3,
        normal: Vec3,
        mut tick: impl FnMut(f64) -> Result<(), E>,
    ) -> Result<(), E> {
        let Some(start) = self.index([0, 0]) else {
            return Ok(());
        };
        self.nodes[start] = Node::Placed(place, normal);
        for (family, angle) in self.fabric.directions.into_iter().enumerate() {
            for sign in [1, -1] {
                let s = f64::from(sign);
                let flat = [s * angle.fixed_cos(), s * angle.fixed_sin(), 0.0];
                self.generate(surface, family, sign, flat);
            }
        }
        let mut order: Vec<[i32; 2]> = self
            .nodes()
            .filter(|(_, n)| *n == Node::Waiting)
            .map(|(at, _)| at)
            .collect();
        order.sort_unstable_by_key(|[i, j]| (i.abs() + j.abs(), j.abs(), *i, *j));
        let total = order.len().max(1) as f64;
        for sweep in 0.. {
            let before = order.len();
            for (k, &at) in order.iter().enumerate() {
                if k % 512 == 0 {
                    tick(1.0 - (before - k) as f64 / total)?;
                }
                let found = self.next(surface, at, sweep > 0);
                let index = self.index(at).expect("inside the table");
                self.nodes[index] = found;
            }
            order.retain(|at| self.node(*at) == Node::Waiting);
            if order.is_empty() || (order.len() == before && sweep > 0) {
                break;
            }
        }
        for at in order {
            let index = self.index(at).expect("inside the table");
            self.nodes[index] = Node::Behind(Stop::Edge);
        }
        Ok(())
    }

    /// Lays the first fibre of a family from the start to one side.
    fn generate(&mut self, surface: &dyn DrapeSurface, family: usize, sign: i32, flat: Vec3) {
        let (mut x, mut normal) = self.node([0, 0]).place().expect("the start is placed");
        let mut heading = match self.fabric.generators {
            Generators::Geodesic => turned(flat, normal),
            // Along the surface over the flat direction.
            Generators::Projection => unit([flat[0], flat[1], -dot(flat, normal) / normal[2]]),
        };
        for k in 1.. {
            let mut at = [0, 0];
            at[family] = sign * k;
            if self.node(at) == Node::Unused {
                return;
            }
            let aside = match self.fabric.generators {
                Generators::Geodesic => square(normal, heading),
                Generators::Projection => square([0.0, 0.0, 1.0], heading),
            };
            let found = self.step(surface, x, heading, aside);
            let index = self.index(at).expect("inside the table");
            self.nodes[index] = found;
            let Some((next, n)) = found.place() else {
                return;
            };
            heading = unit(sub(next, x));
            (x, normal) = (next, n);
        }
    }

    /// One spacing further from `x` in the plane of `heading` and `aside`.
    fn step(&self, surface: &dyn DrapeSurface, x: Vec3, heading: Vec3, aside: Vec3) -> Node {
        if aside == [0.0; 3] {
            return Node::Stopped(Stop::Locked);
        }
        let circle = Circle {
            centre: x,
            radius: self.fabric.spacing,
            ahead: heading,
            aside,
        };
        self.land(circle.meet(surface, self.fabric.offset))
    }

    fn land(&self, found: Result<(Vec3, Vec3), Miss>) -> Node {
        match found {
            Ok((x, _)) if x[2] < self.fabric.bed + self.fabric.offset - 1e-9 => {
                Node::Stopped(Stop::Bed)
            }
            Ok((x, n)) => Node::Placed(x, n),
            Err(Miss::Edge) => Node::Stopped(Stop::Edge),
            Err(Miss::NoPoint) => Node::Stopped(Stop::Locked),
        }
    }

    /// What becomes of a waiting node. Its neighbours towards the start decide; `any`: cells on its other
    /// sides may close on it too.
    fn next(&self, surface: &dyn DrapeSurface, at: [i32; 2], any: bool) -> Node {
        let inward = [0, 1].map(|d| -at[d].signum());
        let neighbours = [[at[0] + inward[0], at[1]], [at[0], at[1] + inward[1]]];
        let states = neighbours.map(|n| self.node(n));
        let own = |d: usize| inward[d] != 0;
        let stops = [0, 1].map(|d| states[d].stop().filter(|_| own(d)));
        if stops.contains(&Some(Stop::Locked)) {
            return Node::Behind(Stop::Locked);
        }
        if (0..2).all(|d| own(d) && states[d].place().is_some()) {
            return self.close(surface, at, inward);
        }
        // One neighbour is no part of the ply, or lies off the tool: the fibre from the other goes on straight.
        for d in 0..2 {
            if own(d) && (states[1 - d] == Node::Unused || stops[1 - d].is_some()) {
                let mut before = neighbours[d];
                before[d] += inward[d];
                if let (Some((x, n)), Some(y)) = (states[d].place(), self.position(before)) {
                    let heading = unit(sub(x, y));
                    return self.step(surface, x, heading, square(n, heading));
                }
            }
        }
        let gone = |d: usize| !own(d) || stops[d].is_some() || states[d] == Node::Unused;
        if let Some(why) = stops[0].or(stops[1]).filter(|_| gone(0) && gone(1)) {
            return Node::Behind(why);
        }
        if any {
            for side in [[-1, -1], [1, -1], [1, 1], [-1, 1]] {
                let near = [[at[0] + side[0], at[1]], [at[0], at[1] + side[1]]];
                if near.iter().all(|n| self.position(*n).is_some()) {
                    return self.close(surface, at, side);
                }
            }
        }
        Node::Waiting
    }

    /// Closes the cell of a node towards `side` (+-1, +-1): one spacing from both neighbours there.
    fn close(&self, surface: &dyn DrapeSurface, at: [i32; 2], side: [i32; 2]) -> Node {
        let (Some((a, n)), Some((b, _))) = (
            self.node([at[0] + side[0], at[1]]).place(),
            self.node([at[0], at[1] + side[1]]).place(),
        ) else {
            return Node::Waiting;
        };
        let middle = scale(add(a, b), 0.5);
        let across = sub(b, a);
        let half = 0.5 * norm(across);
        let reach = self.fabric.spacing.powi(2) - half * half;
        if !(reach > 0.0 && half > 0.0) {
            return Node::Stopped(Stop::Locked);
        }
        let opposite = self.position([at[0] + side[0], at[1] + side[1]]);
        let ahead = match opposite {
            Some(c) => square(sub(middle, c), unit(across)),
            // Along the surface, away from the start.
            None => {
                let along = unit(cross(n, across));
                let start = self.position([0, 0]).unwrap_or(middle);
                let away = dot(along, sub(middle, start));
                square(
                    if away < 0.0 {
                        scale(along, -1.0)
                    } else {
                        along
                    },
                    unit(across),
                )
            }
        };
        if ahead == [0.0; 3] {
            return Node::Stopped(Stop::Locked);
        }
        let circle = Circle {
            centre: middle,
            radius: reach.sqrt(),
            ahead,
            aside: cross(unit(across), ahead),
        };
        let found = self.land(circle.meet(surface, self.fabric.offset));
        if let (Some((x, _)), Some(c)) = (found.place(), opposite) {
            // The cell's nodes in the order of its corners.
            let mut nodes = [c, c, c, c];
            let place = |i: i32, j: i32| match (i < 0, j < 0) {
                (true, true) => 0,
                (false, true) => 1,
                (false, false) => 2,
                (true, false) => 3,
            };
            nodes[place(-side[0], -side[1])] = x;
            nodes[place(side[0], -side[1])] = a;
            nodes[place(-side[0], side[1])] = b;
            if self.shear_of(nodes).abs() > self.fabric.locking {
                return Node::Stopped(Stop::Locked);
            }
        }
        found
    }
}

/// Nodes of the cell named by its lowest node, counter-clockwise.
pub fn corners([i, j]: [i32; 2]) -> [[i32; 2]; 4] {
    [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]]
}

/// The part of `a` square to the unit vector `b`, as a unit vector; zero when there is none.
fn square(a: Vec3, b: Vec3) -> Vec3 {
    let rest = sub(a, scale(b, dot(a, b)));
    if norm(rest) > 1e-9 * norm(a) {
        unit(rest)
    } else {
        [0.0; 3]
    }
}

/// A horizontal direction turned with the smallest rotation that brings the vertical to `normal`: so two
/// fibres keep their angle.
fn turned(flat: Vec3, normal: Vec3) -> Vec3 {
    let axis = cross([0.0, 0.0, 1.0], normal);
    let cosine = normal[2];
    if cosine <= -1.0 + 1e-12 {
        return flat;
    }
    // Rodrigues' formula with sin and 1 - cos taken from the axis' length.
    let turn = add(scale(flat, cosine), cross(axis, flat));
    add(turn, scale(axis, dot(axis, flat) / (1.0 + cosine)))
}
