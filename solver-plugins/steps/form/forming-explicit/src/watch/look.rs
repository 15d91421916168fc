//! The watch over a run.

use crate::forming::Forming;
use crate::stack::{RigidName, RigidShape, SheetIndex};
use crate::watch::against::{Clear, Found, View};
use crate::watch::bodies::Bodies;
use crate::watch::deep::{CHUNK, Deep, Peak, Watched};
use crate::watch::edges::{Edges, Look, UNKNOWN};
use crate::watch::pairs::Pair;
use crate::watch::rigid::Shape;
use crate::watch::sheet::{Bent, Seat, SheetTree};
use crate::watch::watcher::{Moment, Watcher};
use plyflow_geometry::vec3::Vec3;
use rayon::prelude::*;
use std::sync::OnceLock;

/// Steps after which closest points are looked for among all cells again, and not only near the last ones.
const ANEW: u64 = 4000;

/// The watch over a run.
pub struct Watch {
    bodies: Bodies,
    /// By sheet, node and part.
    clear: Vec<Vec<Clear>>,
    /// By pair of a part and a sheet: how far (m) the nearest node was from touching at the last look.
    nearest: Vec<f64>,
    edges: Vec<Edges>,
}

impl Watch {
    /// Over a model that is about to start.
    pub fn new(forming: &Forming) -> Self {
        let bodies = Bodies::new(forming);
        let sizes: Vec<f64> = bodies.sheets.iter().map(|s| s.size).collect();
        let never = |s: &Watcher| vec![Clear::NEVER; s.mesh.nodes.len() * bodies.parts.len()];
        Self {
            edges: edges(forming, &bodies, &sizes),
            clear: bodies.sheets.iter().map(never).collect(),
            nearest: vec![f64::INFINITY; bodies.pairs.len()],
            bodies,
        }
    }

    /// The pairs, in the order of [`Watched::peaks`].
    pub fn pairs(&self) -> &[Pair] {
        &self.bodies.pairs
    }

    /// Of a rigid part and a sheet of the model: how far (m) the nearest node was from touching at the last look that ended a run.
    /// `None` where no node was looked at, because something else drives them all.
    pub fn nearest(&self, part: &RigidName, sheet: SheetIndex) -> Option<f64> {
        let k = self.bodies.parts.iter().position(|p| p.name == *part)?;
        let looked_at = self.bodies.sheets[sheet.0].free.contains(&true);
        looked_at.then(|| self.nearest[self.bodies.pair_with_part(k, sheet.0)])
    }

    /// Looks at everything as it is now. `last`: at the end of the run.
    pub fn look(&mut self, forming: &Forming, watched: &mut Watched, last: bool) {
        let (model, sheets) = (&forming.model, &self.bodies.sheets);
        let due = |at: u64| model.cycle().saturating_sub(at) >= ANEW;
        let anew = last || watched.anew_at.is_none_or(due);
        make_room(watched, sheets);
        let trees: Option<Vec<Option<SheetTree>>> = anew.then(|| {
            let of = |s: &Watcher| s.mesh.tree(model.x());
            sheets.par_iter().map(of).collect()
        });
        let asked: Vec<OnceLock<Option<SheetTree>>> =
            sheets.iter().map(|_| OnceLock::new()).collect();
        let first = watched.anew_at.is_none();
        if anew {
            watched.anew_at = Some(model.cycle());
        }
        let boxes: Vec<[Vec3; 2]> = sheets.iter().map(|s| s.mesh.bounds(model.x())).collect();
        let parts = self.bodies.parts.iter();
        let shifts: Vec<Vec3> = parts.map(|p| forming.shift(&p.name)).collect();
        let bent: Vec<Bent> = sheets.iter().map(|s| Bent::new(&s.mesh)).collect();
        let moment = Moment {
            x: model.x(),
            shifts: &shifts,
            trees: trees.as_deref(),
            asked: &asked,
            boxes: &boxes,
            bent: &bent,
            first,
            last,
        };
        let mut deepest = vec![Deep::default(); self.bodies.pairs.len()];
        self.nearest.fill(f64::INFINITY);
        let count = sheets.len();
        let downwards = (0..count).map(|k| (k, false));
        let upwards = (0..count).rev().map(|k| (k, true));
        for (sheet, up) in downwards.chain(upwards) {
            self.look_from(&moment, [sheet, usize::from(up)], watched, &mut deepest);
        }
        self.look_at_edges(&moment, &mut deepest);
        watched.peaks.resize_with(deepest.len(), Peak::default);
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

    /// Holds the nodes of a sheet against what is on one side of them: 0 below, 1 above.
    fn look_from(
        &mut self,
        moment: &Moment<'_>,
        [sheet, side]: [usize; 2],
        watched: &mut Watched,
        deepest: &mut [Deep],
    ) {
        let bodies = &self.bodies;
        let up = side == 1;
        let parts: Vec<usize> = (0..bodies.parts.len())
            .filter(|k| bodies.parts[*k].above == up)
            .collect();
        let view = View {
            bodies,
            moment,
            sheet,
            up,
            parts: &parts,
            between: &watched.between,
        };
        let found: Vec<Found> = (watched.seats[sheet])
            .par_chunks_mut(CHUNK * bodies.sheets.len())
            .zip(self.clear[sheet].par_chunks_mut(CHUNK * bodies.parts.len()))
            .enumerate()
            .map(|(c, (seats, clear))| view.look_at(c * CHUNK, seats, clear))
            .collect();
        let mut node = 0;
        for found in found {
            for (a, b) in deepest.iter_mut().zip(found.deepest) {
                *a = a.or(b);
            }
            for k in &parts {
                let pair = bodies.pair_with_part(*k, sheet);
                self.nearest[pair] = self.nearest[pair].min(found.nearest[*k]);
            }
            for b in found.between {
                watched.between[sheet][node][side] = b;
                node += 1;
            }
        }
    }

    /// Holds edges of rigid parts against the sheets' cells.
    fn look_at_edges(&mut self, moment: &Moment<'_>, deepest: &mut [Deep]) {
        let bodies = &self.bodies;
        let Some(trees) = moment.trees else { return };
        for edges in &mut self.edges {
            let (number, part) = (edges.part, &bodies.parts[edges.part]);
            let Shape::Tool(triangles) = &part.shape else {
                continue;
            };
            for (k, tree) in trees.iter().enumerate() {
                let Some(tree) = tree else { continue };
                let pair = bodies.pair_with_edges(number, k);
                let sheet = &bodies.sheets[k];
                let look = Look {
                    x: moment.x,
                    mesh: &sheet.mesh,
                    tree,
                    bounds: moment.boxes[k],
                    shift: moment.shifts[number],
                    size: sheet.size,
                    half: 0.5 * sheet.thickness,
                    error: part.error,
                    floor: bodies.floor(pair, moment.last),
                    above: part.above,
                };
                let Some(beyond) = bodies.numbers.beyond[k] else {
                    [deepest[pair], _] = edges.deepest(k, triangles, &look, |_| true);
                    continue;
                };
                // What a film does an element away from all plies no ply feels.
                let on_plies = |at: Vec3| {
                    let mut trees = bodies.of_plies(trees).flatten();
                    trees.any(|tree| {
                        let found = tree.cell_within(at, sheet.size, &mut { UNKNOWN });
                        found.is_some()
                    })
                };
                [deepest[pair], deepest[beyond]] = edges.deepest(k, triangles, &look, on_plies);
            }
        }
    }
}

/// The edges of the rigid parts that have triangles, for sheets with elements of these sizes (m).
fn edges(forming: &Forming, bodies: &Bodies, sizes: &[f64]) -> Vec<Edges> {
    let mirrored = forming.model.planes().0;
    let mesh_of = |name: &RigidName| match name {
        RigidName::Tool => Some(&forming.tool),
        other => {
            let body = forming.rigid.iter().find(|body| body.name == *other)?;
            match &body.shape {
                RigidShape::Triangles(mesh) => Some(mesh),
                RigidShape::Plate(_) => None,
            }
        }
    };
    let parts = bodies.parts.iter().enumerate();
    parts
        .filter_map(|(k, part)| Some(Edges::new(k, mesh_of(&part.name)?, sizes, mirrored)))
        .collect()
}

/// Room for what is remembered of each node of the sheets.
fn make_room(watched: &mut Watched, sheets: &[Watcher]) {
    if watched.seats.len() != sheets.len() {
        let of = |s: &Watcher| vec![Seat::NOWHERE; s.mesh.nodes.len() * sheets.len()];
        watched.seats = sheets.iter().map(of).collect();
        let of = |s: &Watcher| vec![[0.0; 2]; s.mesh.nodes.len()];
        watched.between = sheets.iter().map(of).collect();
    }
}
