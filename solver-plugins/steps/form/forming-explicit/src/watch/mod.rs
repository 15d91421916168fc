//! An independent watch over what must stay outside of what: it shares no code with the contacts nor with the tool's distance field.
//!
//! At every row of the ledger each node of each sheet is held against the triangles of the tool, the bed or the plates of a press, and against
//! the cells of the sheets below and above it in the stack: how much nearer their middle surfaces are than half of their thicknesses, and what
//! really lies between them, allow. See decision 34.

mod edges;
mod pairs;
mod rigid;
mod sheet;
mod told;
mod watcher;

pub use pairs::{Kind, Pair};
pub use told::{DEPTH_BOUND, PairDepth, depth_attributes, depth_warnings};

use crate::run::Forming;
use pairs::{Numbers, pairs};
use plyflow_mechanics::vec3::{V, cross, norm, sub};
use rayon::prelude::*;
use rigid::{Hint, Triangles, from_plate};
use serde::{Deserialize, Serialize};
use sheet::{Bent, Near, Seat, SheetMesh, SheetTree};
use std::sync::OnceLock;
use watcher::{Scene, Watcher, has_come_through};

/// Share of the thinner sheet below which a depth counts as none, except at the end.
const FLOOR: f64 = 0.02;
/// Steps after which closest points are looked for among all cells again, and not only near the last ones.
const ANEW: u64 = 4000;
/// A node nearer than this share of an element to the edge of a sheet is beside it.
const BESIDE: f64 = 0.1;
/// Nodes that are looked at together.
const CHUNK: usize = 256;

/// A depth and where it is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Deep {
    /// m; 0: none.
    pub depth: f64,
    /// Node of the model.
    pub node: u32,
    /// Its place (m).
    pub place: V,
}

impl Deep {
    /// The deeper one; of equals this one.
    fn or(self, other: Self) -> Self {
        if other.depth > self.depth {
            other
        } else {
            self
        }
    }
}

/// The deepest of a pair so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Peak {
    /// It.
    pub deep: Deep,
    /// When (s).
    pub time: f64,
}

/// What the watch remembers of a run.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Watched {
    /// The deepest so far, by pair.
    pub peaks: Vec<Peak>,
    /// The last ones, by pair.
    pub now: Vec<Deep>,
    /// By sheet, node and other sheet.
    seats: Vec<Vec<Seat>>,
    /// By sheet and node: thickness (m) of what lies between it and what is below it, and above it.
    between: Vec<Vec<[f64; 2]>>,
    /// Cycle of the last look at everything.
    anew_at: Option<u64>,
}

/// What a rigid part is made of.
enum Shape {
    Tool(Triangles),
    Bed,
    Plate(plyflow_mechanics::contact::OpenPlate),
}

struct Part {
    name: String,
    shape: Shape,
    /// Whether it lies above the sheets.
    above: bool,
    /// Error (m) of its distance field.
    error: f64,
}

/// A node's place when it was looked at, and its distance (m) from a part then, which can have shrunk by no more than the node has moved.
#[derive(Clone, Copy)]
struct Clear {
    at: V,
    distance: f64,
    /// Triangle of the tool that was closest.
    hint: Hint,
}

/// Distances (m) are bounds but for rounding.
const ROUNDING: f64 = 1e-12;

/// The watch over a run.
pub struct Watch {
    parts: Vec<Part>,
    sheets: Vec<Watcher>,
    pairs: Vec<Pair>,
    numbers: Numbers,
    /// By sheet, node and part.
    clear: Vec<Vec<Clear>>,
    /// By pair of a part and a sheet: how far (m) the nearest node was from touching at the last look.
    nearest: Vec<f64>,
    edges: edges::Edges,
    /// Whether sheets stand off hollows as decision 28 has it.
    stands_off: bool,
}

/// What some nodes of a sheet found.
struct Found {
    /// By pair.
    deepest: Vec<Deep>,
    /// By node.
    between: Vec<f64>,
    /// By part: how far (m) the nearest is from touching it.
    nearest: Vec<f64>,
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
struct View<'a> {
    scene: &'a Scene<'a>,
    sheet: usize,
    up: bool,
    between: &'a [Vec<[f64; 2]>],
}

impl Watch {
    /// Over a model that is about to start.
    pub fn new(forming: &Forming) -> Self {
        let model = &forming.model;
        let mut parts = Vec::new();
        let press = forming.load.press().is_some();
        if let Some(triangles) = Triangles::new(&forming.tool) {
            parts.push(Part {
                name: "tool".into(),
                shape: Shape::Tool(triangles),
                above: false,
                error: forming.field_error("tool"),
            });
        }
        if !press {
            parts.push(Part {
                name: "bed".into(),
                shape: Shape::Bed,
                above: false,
                error: 0.0,
            });
        }
        for body in &forming.rigid {
            parts.push(Part {
                name: body.name.clone(),
                shape: Shape::Plate(body.plate),
                above: body.plate.side > 0.0,
                error: 0.0,
            });
        }
        let sheets: Vec<Watcher> = (model.sheets().iter())
            .map(|s| {
                let cells = &model.cells()[s.cell_range.0..s.cell_range.1];
                let mesh = SheetMesh::new(cells, model.start(), model.planes());
                let free = mesh.nodes.iter().map(|n| !model.is_driven(*n)).collect();
                Watcher {
                    size: size_over(&mesh, model.start(), forming.tool.bounds()),
                    mesh,
                    thickness: s.thickness,
                    free,
                }
            })
            .collect();
        let sizes: Vec<f64> = sheets.iter().map(|s| s.size).collect();
        let (pairs, numbers) = pairs(forming, &parts, &sizes);
        let never = Clear {
            at: [0.0; 3],
            distance: f64::NEG_INFINITY,
            hint: (0, 0),
        };
        let clear = (sheets.iter())
            .map(|s| vec![never; s.mesh.nodes.len() * parts.len()])
            .collect();
        Self {
            edges: edges::Edges::new(&forming.tool, &sizes, forming.model.planes().0),
            parts,
            sheets,
            clear,
            nearest: vec![f64::INFINITY; pairs.len()],
            pairs,
            numbers,
            stands_off: !press,
        }
    }

    /// The pairs, in the order of [`Watched::peaks`].
    pub fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    /// Of a rigid part and a sheet of the stack: how far (m) the nearest node was from touching at the last look that ended a run.
    /// `None` where no node was looked at, because something else drives them all.
    pub fn nearest(&self, part: &str, sheet: usize) -> Option<f64> {
        let k = self.parts.iter().position(|p| p.name == part)?;
        let looked_at = self.sheets[sheet].free.contains(&true);
        looked_at.then(|| self.nearest[self.pair_with_part(k, sheet)])
    }

    /// Looks at everything as it is now. `last`: at the end of the run.
    pub fn look(&mut self, forming: &Forming, watched: &mut Watched, last: bool) {
        let model = &forming.model;
        let due = |at: u64| model.cycle().saturating_sub(at) >= ANEW;
        let anew = last || watched.anew_at.is_none_or(due);
        let count = self.sheets.len();
        if watched.seats.len() != count {
            let of = |s: &Watcher| vec![Seat::NOWHERE; s.mesh.nodes.len() * count];
            watched.seats = self.sheets.iter().map(of).collect();
            let of = |s: &Watcher| vec![[0.0; 2]; s.mesh.nodes.len()];
            watched.between = self.sheets.iter().map(of).collect();
        }
        let trees: Option<Vec<Option<SheetTree>>> = anew.then(|| {
            let of = |s: &Watcher| s.mesh.tree(model.x());
            self.sheets.par_iter().map(of).collect()
        });
        let asked: Vec<OnceLock<Option<SheetTree>>> = (0..count).map(|_| OnceLock::new()).collect();
        let first = watched.anew_at.is_none();
        if anew {
            watched.anew_at = Some(model.cycle());
        }
        let boxes: Vec<[V; 2]> = (self.sheets.iter())
            .map(|s| s.mesh.bounds(model.x()))
            .collect();
        let shifts: Vec<V> = self.parts.iter().map(|p| forming.shift(&p.name)).collect();
        let mut deepest = vec![Deep::default(); self.pairs.len()];
        let bent: Vec<Bent> = self.sheets.iter().map(|s| Bent::new(&s.mesh)).collect();
        let mut clear = std::mem::take(&mut self.clear);
        self.nearest.fill(f64::INFINITY);
        let scene = Scene {
            x: model.x(),
            shifts: &shifts,
            trees: trees.as_deref(),
            asked: &asked,
            boxes: &boxes,
            bent: &bent,
            first,
            last,
        };
        let downwards = (0..count).map(|k| (k, false));
        let upwards = (0..count).rev().map(|k| (k, true));
        for (sheet, up) in downwards.chain(upwards) {
            let side = usize::from(up);
            let view = View {
                scene: &scene,
                sheet,
                up,
                between: &watched.between,
            };
            let of_part = |k: usize, p: &Part| (p.above == up).then_some(k);
            let parts: Vec<usize> = (self.parts.iter().enumerate())
                .filter_map(|(k, p)| of_part(k, p))
                .collect();
            let found: Vec<Found> = (watched.seats[sheet])
                .par_chunks_mut(CHUNK * count)
                .zip(clear[sheet].par_chunks_mut(CHUNK * self.parts.len()))
                .enumerate()
                .map(|(c, (seats, clear))| self.look_at(&view, &parts, c * CHUNK, seats, clear))
                .collect();
            let mut node = 0;
            for found in found {
                for (a, b) in deepest.iter_mut().zip(found.deepest) {
                    *a = a.or(b);
                }
                for k in &parts {
                    let pair = self.pair_with_part(*k, sheet);
                    self.nearest[pair] = self.nearest[pair].min(found.nearest[*k]);
                }
                for b in found.between {
                    watched.between[sheet][node][side] = b;
                    node += 1;
                }
            }
        }
        self.clear = clear;
        self.look_at_edges(&scene, &mut deepest);
        watched.peaks.resize_with(self.pairs.len(), Peak::default);
        for (peak, now) in watched.peaks.iter_mut().zip(&deepest) {
            if now.depth > peak.deep.depth {
                *peak = Peak {
                    deep: *now,
                    time: model.time(),
                };
            }
        }
        watched.now = deepest;
    }

    /// Nodes of a sheet from number `from` on, in one direction.
    fn look_at(
        &self,
        view: &View<'_>,
        parts: &[usize],
        from: usize,
        seats: &mut [Seat],
        clear: &mut [Clear],
    ) -> Found {
        let own = &self.sheets[view.sheet];
        let mut found = Found {
            deepest: vec![Deep::default(); self.pairs.len()],
            between: Vec::with_capacity(CHUNK),
            nearest: vec![f64::INFINITY; self.parts.len()],
        };
        let seats = seats.chunks_exact_mut(self.sheets.len());
        let clear = clear.chunks_exact_mut(self.parts.len());
        for (i, (seats, clear)) in seats.zip(clear).enumerate() {
            let i = from + i;
            if !own.free[i] {
                let kept = view.between[view.sheet][i][usize::from(view.up)];
                found.between.push(kept);
                continue;
            }
            let under = self.against_sheets(view, i, seats, &mut found.deepest);
            for k in parts {
                let near =
                    self.against_part(view, i, *k, &under, &mut clear[*k], &mut found.deepest);
                found.nearest[*k] = found.nearest[*k].min(near);
            }
            found.between.push(under.between);
        }
        found
    }

    /// Holds a node against the sheets on one side of it, from the next one on until one is really there.
    fn against_sheets(
        &self,
        view: &View<'_>,
        i: usize,
        seats: &mut [Seat],
        deepest: &mut [Deep],
    ) -> Under {
        let (scene, own) = (view.scene, &self.sheets[view.sheet]);
        let node = own.mesh.nodes[i];
        let place = scene.x[node as usize];
        let side = usize::from(view.up);
        let mut lower = (0..view.sheet).rev();
        let mut upper = view.sheet + 1..self.sheets.len();
        while let Some(other) = if view.up { upper.next() } else { lower.next() } {
            let sheet = &self.sheets[other];
            let Some(mut near) = sheet.near(scene, other, node, &mut seats[other]) else {
                continue;
            };
            let above = |near: &Near| if view.up { -near.height } else { near.height };
            let mut over = above(&near);
            let before = if scene.first {
                0.0
            } else {
                f64::from(seats[other].side)
            };
            if scene.trees.is_none() && over < 0.0 && has_come_through(before, over) {
                near = sheet.nearest(scene, other, node, near);
                over = above(&near);
            }
            let beside = near.to_rim <= BESIDE * sheet.size;
            let there = !beside && (over >= 0.0 || has_come_through(before, over));
            seats[other] = Seat {
                cell: near.cell,
                xi: near.xi.map(|c| c as f32),
                side: if there { over as f32 } else { f32::INFINITY },
            };
            if !there {
                continue;
            }
            let pair = self.pair_of_sheets_at(scene, [view.sheet, other], place);
            let mut depth = 0.5 * (own.thickness + sheet.thickness) - over;
            let squeezed = depth.max(0.0);
            let least = self.floor(pair, scene.last).max(deepest[pair].depth);
            if depth > least {
                let [own_bent, bent] = [view.sheet, other].map(|k| &scene.bent[k]);
                depth -= sheet.mesh.bulge(scene.x, bent, near.cell, near.xi)
                    + own.mesh.bulge_around(scene.x, own_bent, node);
                if depth > least {
                    deepest[pair] = Deep { depth, node, place };
                }
            }
            let between = if scene.trees.is_none() {
                view.between[view.sheet][i][side]
            } else if over < 0.0 {
                0.0
            } else {
                let below = |n: u32| view.between[other][sheet.mesh.index(n)][side];
                let corners = sheet.mesh.cell(near.cell).map(below);
                sheet.thickness + corners.into_iter().fold(f64::INFINITY, f64::min)
            };
            return Under { between, squeezed };
        }
        Under::default()
    }

    /// Holds a node against a rigid part. Gives how far (m) it is from touching it, a bound where it is far.
    fn against_part(
        &self,
        view: &View<'_>,
        i: usize,
        k: usize,
        under: &Under,
        clear: &mut Clear,
        deepest: &mut [Deep],
    ) -> f64 {
        let (part, own) = (&self.parts[k], &self.sheets[view.sheet]);
        let pair = self.pair_with_part(k, view.sheet);
        let least = self.floor(pair, view.scene.last).max(deepest[pair].depth);
        let node = own.mesh.nodes[i];
        let place = view.scene.x[node as usize];
        let p = sub(place, view.scene.shifts[k]);
        // What lies between is as much thinner as the sheet next to it is in it. Of an upper film the lower one does not count: each hangs between the
        // other's nodes, and what is felt of that is a matter of the two (decision 34).
        let film = match view.sheet > 0 && !self.pairs[pair].of_ply {
            true => self.sheets[0].thickness,
            false => 0.0,
        };
        let need = 0.5 * own.thickness + (under.between - under.squeezed - film).max(0.0);
        let nearest = clear.distance - norm(sub(p, clear.at));
        if !view.scene.last && need - nearest - part.error < least - ROUNDING {
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
            (depth > least && self.stands_off, &part.shape, &on)
        {
            depth -= triangles.let_be(on, own.size);
        }
        if depth > least {
            deepest[pair] = Deep { depth, node, place };
        }
        near
    }

    /// Holds edges of the tool against the sheets' cells.
    fn look_at_edges(&mut self, scene: &Scene<'_>, deepest: &mut [Deep]) {
        let Some(trees) = scene.trees else { return };
        for (k, tree) in trees.iter().enumerate() {
            let Some(tree) = tree else { continue };
            let pair = self.pair_with_edges(k);
            let floor = self.floor(pair, scene.last);
            let Some(Shape::Tool(triangles)) = self.parts.first().map(|p| &p.shape) else {
                return;
            };
            let sheet = &self.sheets[k];
            let look = edges::Look {
                x: scene.x,
                mesh: &sheet.mesh,
                tree,
                bounds: scene.boxes[k],
                shift: scene.shifts[0],
                size: sheet.size,
                half: 0.5 * sheet.thickness,
                error: self.parts[0].error,
                floor,
            };
            let Some(beyond) = self.numbers.beyond[k] else {
                [deepest[pair], _] = self.edges.deepest(k, triangles, &look, |_| true);
                continue;
            };
            // What a film does an element away from all plies no ply feels.
            let plies =
                || (self.numbers.beyond.iter().zip(trees)).filter(|(film, _)| film.is_none());
            let on_plies = |at: V| {
                let mut trees = plies().filter_map(|(_, tree)| tree.as_ref());
                trees.any(|tree| {
                    tree.cell_within(at, sheet.size, &mut { edges::UNKNOWN })
                        .is_some()
                })
            };
            [deepest[pair], deepest[beyond]] = self.edges.deepest(k, triangles, &look, on_plies);
        }
    }

    fn floor(&self, pair: usize, last: bool) -> f64 {
        if last {
            0.0
        } else {
            FLOOR * self.pairs[pair].thinner
        }
    }

    fn pair_with_part(&self, part: usize, sheet: usize) -> usize {
        part * self.sheets.len() + sheet
    }

    fn pair_with_edges(&self, sheet: usize) -> usize {
        self.parts.len() * self.sheets.len() + sheet
    }

    /// As [`Watch::pair_of_sheets`], of a node at a place: what films do an element away from all plies, by the boxes around these, is a pair of its own.
    fn pair_of_sheets_at(&self, scene: &Scene<'_>, [a, b]: [usize; 2], place: V) -> usize {
        let pair = self.pair_of_sheets(a, b);
        let Some([_, off]) = self.numbers.films.filter(|[films, _]| *films == pair) else {
            return pair;
        };
        let reach = self.sheets[a].size.max(self.sheets[b].size);
        let in_reach = |[low, high]: &[V; 2]| {
            (0..3).all(|k| (low[k] - reach..=high[k] + reach).contains(&place[k]))
        };
        let plies =
            (self.numbers.beyond.iter().zip(scene.boxes)).filter(|(film, _)| film.is_none());
        match plies.map(|(_, bounds)| bounds).any(in_reach) {
            true => pair,
            false => off,
        }
    }

    /// Pair of the nodes of sheet `a` with the cells of sheet `b`.
    fn pair_of_sheets(&self, a: usize, b: usize) -> usize {
        if let Some(pair) = self.numbers.hangs[a * self.sheets.len() + b] {
            return pair;
        }
        let (low, high) = (a.min(b), a.max(b));
        (self.parts.len() + 1) * self.sheets.len() + high * (high - 1) / 2 + low
    }
}

/// Side (m) of a square as large as the median cell over the tool of a sheet that lies flat; of one that lies nowhere over it, of all its cells.
fn size_over(mesh: &SheetMesh, start: &[V], [low, high]: [V; 2]) -> f64 {
    let area = |q: [V; 4]| 0.5 * norm(cross(sub(q[2], q[0]), sub(q[3], q[1])));
    let is_over = |q: &[V; 4]| {
        (0..2).all(|k| {
            let middle = 0.25 * q.iter().map(|x| x[k]).sum::<f64>();
            low[k] <= middle && middle <= high[k]
        })
    };
    let corners = || mesh.cells().iter().map(|c| c.map(|n| start[n as usize]));
    let mut areas: Vec<f64> = corners().filter(is_over).map(area).collect();
    if areas.is_empty() {
        areas = corners().map(area).collect();
    }
    areas.sort_by(f64::total_cmp);
    areas.get(areas.len() / 2).map_or(0.0, |a| a.sqrt())
}
