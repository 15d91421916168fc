//! What is watched: rigid parts, sheets, and the pairs of them.

use crate::forming::Forming;
use crate::stack::{RigidName, RigidShape, SheetIndex};
use crate::watch::pairs::{Numbers, Pair, pairs};
use crate::watch::rigid::{Part, Shape, Triangles};
use crate::watch::sheet::SheetMesh;
use crate::watch::watcher::{Moment, Watcher};
use plyflow_geometry::vec3::{Vec3, cross, norm, sub};

/// Share of the thinner sheet below which a depth counts as none, except at the end.
const FLOOR: f64 = 0.02;

/// What is watched.
pub struct Bodies {
    /// The rigid parts; the tool first, if it has a surface.
    pub parts: Vec<Part>,
    /// In the order of the stack.
    pub sheets: Vec<Watcher>,
    /// All pairs of these.
    pub pairs: Vec<Pair>,
    /// Where some of them are.
    pub numbers: Numbers,
    /// Whether sheets stand off hollows as decision 28 has it.
    pub stands_off: bool,
}

impl Bodies {
    /// Of a model that is about to start.
    pub fn new(forming: &Forming) -> Self {
        let model = &forming.model;
        let parts = parts(forming);
        let watcher = |k: usize| {
            let cells = SheetIndex(k).cells(model);
            let mesh = SheetMesh::new(cells, model.start(), model.planes());
            let free = mesh.nodes.iter().map(|n| !model.is_driven(*n)).collect();
            Watcher {
                size: size_over(&mesh, model.start(), forming.tool.bounds()),
                mesh,
                thickness: model.sheets()[k].thickness,
                free,
            }
        };
        let sheets: Vec<Watcher> = (0..forming.stack.len()).map(watcher).collect();
        let sizes: Vec<f64> = sheets.iter().map(|s| s.size).collect();
        let (pairs, numbers) = pairs(&forming.stack, &parts, &sizes);
        Self {
            parts,
            sheets,
            pairs,
            numbers,
            stands_off: !forming.load.moves_parts(),
        }
    }

    /// Of what there is by sheet, that of the plies.
    pub fn of_plies<'a, T>(&'a self, by_sheet: &'a [T]) -> impl Iterator<Item = &'a T> {
        let all = self.numbers.beyond.iter().zip(by_sheet);
        all.filter(|(film, _)| film.is_none()).map(|(_, of)| of)
    }

    /// Depth (m) from which on one of a pair is told; `last`: at the end of the run.
    pub fn floor(&self, pair: usize, last: bool) -> f64 {
        if last {
            0.0
        } else {
            FLOOR * self.pairs[pair].thinner
        }
    }

    /// Pair of a part with a sheet, by their numbers here.
    pub fn pair_with_part(&self, part: usize, sheet: usize) -> usize {
        part * self.sheets.len() + sheet
    }

    /// Pair of the edges of a part, which has triangles, with a sheet, by their numbers here.
    pub fn pair_with_edges(&self, part: usize, sheet: usize) -> usize {
        match self.numbers.edges[part] {
            Some(first) => first + sheet,
            None => self.parts.len() * self.sheets.len() + sheet,
        }
    }

    /// As [`Bodies::pair_of_sheets`], of a node at a place: what films do an element away from all plies, by the boxes around these, is a pair of its own.
    pub fn pair_of_sheets_at(&self, moment: &Moment<'_>, [a, b]: [usize; 2], place: Vec3) -> usize {
        let pair = self.pair_of_sheets(a, b);
        let Some([_, off]) = self.numbers.films.filter(|[films, _]| *films == pair) else {
            return pair;
        };
        let reach = self.sheets[a].size.max(self.sheets[b].size);
        let in_reach = |[low, high]: &[Vec3; 2]| {
            (0..3).all(|k| (low[k] - reach..=high[k] + reach).contains(&place[k]))
        };
        match self.of_plies(moment.boxes).any(in_reach) {
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

/// The rigid parts of a run.
fn parts(forming: &Forming) -> Vec<Part> {
    let mut parts = Vec::new();
    if let Some(triangles) = Triangles::new(&forming.tool) {
        parts.push(Part {
            name: RigidName::Tool,
            shape: Shape::Tool(triangles),
            above: false,
            error: forming.field_error(&RigidName::Tool),
        });
    }
    let contacts = forming.model.rigid_contacts();
    if contacts.iter().any(|c| RigidName::Bed.is_of(&c.name)) {
        parts.push(Part {
            name: RigidName::Bed,
            shape: Shape::Bed,
            above: false,
            error: 0.0,
        });
    }
    parts.extend(forming.rigid.iter().filter_map(|body| {
        let (shape, error) = match &body.shape {
            RigidShape::Plate(mesh) => (Shape::Plate(mesh.plate), 0.0),
            RigidShape::Triangles(mesh) => (
                Shape::Tool(Triangles::new(mesh)?),
                forming.field_error(&body.name),
            ),
        };
        Some(Part {
            name: body.name.clone(),
            shape,
            above: body.above,
            error,
        })
    }));
    parts
}

/// Side (m) of a square as large as the median cell over the tool of a sheet that lies flat; of one that lies nowhere over it, of all its cells.
fn size_over(mesh: &SheetMesh, start: &[Vec3], [low, high]: [Vec3; 2]) -> f64 {
    let area = |q: [Vec3; 4]| 0.5 * norm(cross(sub(q[2], q[0]), sub(q[3], q[1])));
    let is_over = |q: &[Vec3; 4]| {
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
