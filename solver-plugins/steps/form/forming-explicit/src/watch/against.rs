//! What one node of a sheet is held against: the sheets around it, and rigid parts.

use crate::watch::bodies::Bodies;
use crate::watch::deep::{CHUNK, Deep};
use crate::watch::rigid::{Hint, Shape, from_plate};
use crate::watch::sheet::{Near, Seat};
use crate::watch::watcher::{Moment, has_come_through};
use plyflow_geometry::vec3::{Vec3, norm, sub};

/// A node's place when it was looked at, and its distance (m) from a part then, which can have shrunk by no more than the node has moved.
#[derive(Clone, Copy)]
pub struct Clear {
    at: Vec3,
    distance: f64,
    /// Triangle of the tool that was closest.
    hint: Hint,
}

impl Clear {
    /// Nothing known.
    pub const NEVER: Self = Self {
        at: [0.0; 3],
        distance: f64::NEG_INFINITY,
        hint: (0, 0),
    };
}

/// Distances (m) are bounds but for rounding.
const ROUNDING: f64 = 1e-12;

/// What some nodes of a sheet found.
pub struct Found {
    /// By pair.
    pub deepest: Vec<Deep>,
    /// By node.
    pub between: Vec<f64>,
    /// By part: how far (m) the nearest is from touching it.
    pub nearest: Vec<f64>,
}

/// What a node lies on.
#[derive(Default)]
struct Under {
    /// Thickness (m) of the sheets between it and what comes after them.
    between: f64,
    /// How deep (m) it is in the first of them.
    squeezed: f64,
}

/// The nodes of one sheet, in one direction.
pub struct View<'a> {
    /// What it is held against.
    pub bodies: &'a Bodies,
    /// When.
    pub moment: &'a Moment<'a>,
    /// Its number.
    pub sheet: usize,
    /// Whether it looks up.
    pub up: bool,
    /// Numbers of the parts that lie there.
    pub parts: &'a [usize],
    /// By sheet and node: thickness (m) of what lies between it and what is below it, and above it.
    pub between: &'a [Vec<[f64; 2]>],
}

impl View<'_> {
    /// Nodes of the sheet from number `from` on.
    pub fn look_at(&self, from: usize, seats: &mut [Seat], clear: &mut [Clear]) -> Found {
        let bodies = self.bodies;
        let mut found = Found {
            deepest: vec![Deep::default(); bodies.pairs.len()],
            between: Vec::with_capacity(CHUNK),
            nearest: vec![f64::INFINITY; bodies.parts.len()],
        };
        let seats = seats.chunks_exact_mut(bodies.sheets.len());
        let clear = clear.chunks_exact_mut(bodies.parts.len());
        for (i, (seats, clear)) in seats.zip(clear).enumerate() {
            let i = from + i;
            if !bodies.sheets[self.sheet].free[i] {
                found.between.push(self.kept(i));
                continue;
            }
            let under = self.against_sheets(i, seats, &mut found.deepest);
            for k in self.parts {
                let near = self.against_part(i, *k, &under, &mut clear[*k], &mut found.deepest);
                found.nearest[*k] = found.nearest[*k].min(near);
            }
            found.between.push(under.between);
        }
        found
    }

    /// What was between a node and what it lies on when that was looked at last (m).
    fn kept(&self, i: usize) -> f64 {
        self.between[self.sheet][i][usize::from(self.up)]
    }

    /// Holds a node against the sheets on its side, from the next one on until one is really there.
    fn against_sheets(&self, i: usize, seats: &mut [Seat], deepest: &mut [Deep]) -> Under {
        let (bodies, moment, own) = (self.bodies, self.moment, &self.bodies.sheets[self.sheet]);
        let node = own.mesh.nodes[i];
        let place = moment.x[node as usize];
        let mut lower = (0..self.sheet).rev();
        let mut upper = self.sheet + 1..bodies.sheets.len();
        while let Some(other) = if self.up { upper.next() } else { lower.next() } {
            let sheet = &bodies.sheets[other];
            let Some((near, over)) = self.meet(other, node, &mut seats[other]) else {
                continue;
            };
            let pair = bodies.pair_of_sheets_at(moment, [self.sheet, other], place);
            let mut depth = 0.5 * (own.thickness + sheet.thickness) - over;
            let squeezed = depth.max(0.0);
            let least = bodies.floor(pair, moment.last).max(deepest[pair].depth);
            if depth > least {
                let [own_bent, bent] = [self.sheet, other].map(|k| &moment.bent[k]);
                depth -= sheet.mesh.bulge(moment.x, bent, near.cell, near.xi)
                    + own.mesh.bulge_around(moment.x, own_bent, node);
                if depth > least {
                    deepest[pair] = Deep { depth, node, place };
                }
            }
            let between = if moment.trees.is_none() {
                self.kept(i)
            } else if over < 0.0 {
                0.0
            } else {
                let side = usize::from(self.up);
                let below = |n: u32| self.between[other][sheet.mesh.index(n)][side];
                let corners = sheet.mesh.cell(near.cell).map(below);
                sheet.thickness + corners.into_iter().fold(f64::INFINITY, f64::min)
            };
            return Under { between, squeezed };
        }
        Under::default()
    }

    /// The closest point of another sheet to a node, and how far (m) the node is over that on the side where it belongs. `None` where the
    /// other is not there: the node is beside it, or behind it without having come through.
    fn meet(&self, other: usize, node: u32, seat: &mut Seat) -> Option<(Near, f64)> {
        let (moment, sheet) = (self.moment, &self.bodies.sheets[other]);
        let mut near = sheet.near(moment, other, node, seat)?;
        let above = |near: &Near| if self.up { -near.height } else { near.height };
        let mut over = above(&near);
        let before = if moment.first {
            0.0
        } else {
            f64::from(seat.side)
        };
        if moment.trees.is_none() && over < 0.0 && has_come_through(before, over) {
            near = sheet.nearest(moment, other, node, near);
            over = above(&near);
        }
        let there = !near.is_beside(sheet.size) && (over >= 0.0 || has_come_through(before, over));
        *seat = Seat {
            cell: near.cell,
            xi: near.xi.map(|c| c as f32),
            side: if there { over as f32 } else { f32::INFINITY },
        };
        there.then_some((near, over))
    }

    /// Holds a node against a rigid part. Gives how far (m) it is from touching it, a bound where it is far.
    fn against_part(
        &self,
        i: usize,
        k: usize,
        under: &Under,
        clear: &mut Clear,
        deepest: &mut [Deep],
    ) -> f64 {
        let bodies = self.bodies;
        let (part, own) = (&bodies.parts[k], &bodies.sheets[self.sheet]);
        let pair = bodies.pair_with_part(k, self.sheet);
        let least = bodies
            .floor(pair, self.moment.last)
            .max(deepest[pair].depth);
        let node = own.mesh.nodes[i];
        let place = self.moment.x[node as usize];
        let p = sub(place, self.moment.shifts[k]);
        // What lies between is as much thinner as the sheet next to it is in it. Of an upper film the lower one does not count: each hangs between the
        // other's nodes, and what is felt of that is a matter of the two (decision 34).
        let film = match self.sheet > 0 && !bodies.pairs[pair].of_ply {
            true => bodies.sheets[0].thickness,
            false => 0.0,
        };
        let need = 0.5 * own.thickness + (under.between - under.squeezed - film).max(0.0);
        let nearest = clear.distance - norm(sub(p, clear.at));
        if !self.moment.last && need - nearest - part.error < least - ROUNDING {
            return f64::INFINITY;
        }
        let mut on = None;
        let distance = match &part.shape {
            Shape::Bed => p[2],
            Shape::Plate(plate) => from_plate(plate, p),
            Shape::Tool(triangles) => on.insert(triangles.closest(p, clear.hint)).distance,
        };
        let mut depth = need - distance;
        *clear = Clear {
            at: p,
            distance,
            hint: on.map_or(clear.hint, |on| on.triangle),
        };
        let near = -depth;
        depth -= part.error;
        if let (true, Shape::Tool(triangles), Some(on)) =
            (depth > least && bodies.stands_off, &part.shape, &on)
        {
            depth -= triangles.let_be(on, own.size);
        }
        if depth > least {
            deepest[pair] = Deep { depth, node, place };
        }
        near
    }
}
