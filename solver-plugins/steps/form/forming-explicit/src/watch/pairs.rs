//! What is held against what.

use crate::stack::{RigidName, StackSheet};
use crate::watch::rigid::{Part, Shape};

/// Share of the thinner sheet beyond which a depth at the end is told.
pub const DEPTH_BOUND: f64 = 0.1;

/// What is held against what in a pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Nodes against a part or a sheet.
    Nodes,
    /// Edges of the tool, or of another rigid part, against the cells of a sheet.
    Edges,
    /// A film's nodes against the cells of a ply. Plies carry films at their nodes; between them a film hangs through.
    Hangs,
}

/// Two bodies that must stay outside of each other.
#[derive(Debug, Clone, PartialEq)]
pub struct Pair {
    /// Their names, from the tool upwards; of a part its own first.
    pub name: String,
    /// What is held.
    pub kind: Kind,
    /// Thickness (m) of the thinner sheet.
    pub thinner: f64,
    /// Depth (m) at the end beyond which it is told.
    pub bound: f64,
    /// Depth (m) beyond which the run stops.
    pub most: f64,
    /// Whether one of them is a ply.
    pub of_ply: bool,
}

/// Numbers of pairs that are not found by those of their bodies.
pub struct Numbers {
    /// By film and ply: of what hangs through.
    pub hangs: Vec<Option<usize>>,
    /// By part besides the first one, if it has triangles: of its edges with the first sheet; the others follow.
    pub edges: Vec<Option<usize>>,
    /// By film: of edges of the tool that are an element away from all plies.
    pub beyond: Vec<Option<usize>>,
    /// Of the two films, and of the two where they are an element away from all plies.
    pub films: Option<[usize; 2]>,
}

/// What all pairs of a stack are made from.
struct Stack<'a> {
    sheets: &'a [StackSheet],
    /// Of their elements (m).
    sizes: &'a [f64],
    /// Thickness of the thinnest ply (m).
    thinnest: f64,
}

impl Stack<'_> {
    fn name(&self, k: usize) -> &str {
        &self.sheets[k].scene.name
    }

    fn with_part(&self, part: &Part, k: usize) -> Pair {
        let thinner = self.sheets[k].thickness;
        let of_ply = self.sheets[k].is_ply();
        Pair {
            name: format!("{}/{}", part.name.word(), self.name(k)),
            kind: Kind::Nodes,
            thinner,
            bound: DEPTH_BOUND * thinner,
            // A film may land on the bed harder than it is thick.
            most: thinner.max(if of_ply { 0.0 } else { self.thinnest }),
            of_ply,
        }
    }

    fn with_edges(&self, part: &str, k: usize) -> Pair {
        let thinner = self.sheets[k].thickness;
        Pair {
            name: format!("{part}_edges/{}", self.name(k)),
            kind: Kind::Edges,
            thinner,
            bound: thinner.max(self.thinnest),
            most: 0.5 * self.sizes[k],
            of_ply: self.sheets[k].is_ply(),
        }
    }

    fn of_sheets(&self, low: usize, high: usize) -> Pair {
        let [a, b] = [low, high].map(|k| self.sheets[k].thickness);
        Pair {
            name: format!("{}/{}", self.name(low), self.name(high)),
            kind: Kind::Nodes,
            thinner: a.min(b),
            bound: DEPTH_BOUND * a.min(b),
            // Until their middles have crossed.
            most: 0.5 * (a + b),
            of_ply: true,
        }
    }

    /// What of a film hangs through between the nodes of a ply.
    fn hanging(&self, film: usize, ply: usize) -> Pair {
        let both = self.of_sheets(film.min(ply), film.max(ply));
        Pair {
            name: format!("between_nodes/{}", both.name),
            kind: Kind::Hangs,
            bound: f64::INFINITY,
            most: f64::INFINITY,
            ..both
        }
    }

    /// Edges of the tool with a film, an element away from all plies.
    fn off_plies(&self, film: usize) -> Pair {
        Pair {
            name: format!("tool_edges_off_plies/{}", self.name(film)),
            bound: f64::INFINITY,
            ..self.with_edges("tool", film)
        }
    }

    /// No ply feels what films do to each other beside the plies; they fold there. `share`: of an element, which they may be in each other.
    fn of_films(&self, low: usize, high: usize, share: f64) -> Pair {
        let size = self.sizes[low].min(self.sizes[high]);
        Pair {
            bound: DEPTH_BOUND * self.thinnest,
            most: self.thinnest.max(share * size),
            of_ply: false,
            ..self.of_sheets(low, high)
        }
    }
}

/// The pairs: parts with sheets, edges of the tool with sheets, sheets with each other, and those of [`Numbers`]. `sizes`: of the
/// sheets' elements (m).
pub fn pairs(sheets: &[StackSheet], parts: &[Part], sizes: &[f64]) -> (Vec<Pair>, Numbers) {
    let count = sheets.len();
    let plies = || (0..count).filter(|k| sheets[*k].is_ply());
    let films = || (0..count).filter(|k| !sheets[*k].is_ply());
    let thinnest = plies().map(|k| sheets[k].thickness);
    let stack = Stack {
        sheets,
        sizes,
        thinnest: thinnest.fold(f64::INFINITY, f64::min),
    };
    let with_part = |part| (0..count).map(move |k| (part, k));
    let mut all: Vec<Pair> = (parts.iter().flat_map(with_part))
        .map(|(part, k)| stack.with_part(part, k))
        .collect();
    all.extend((0..count).map(|k| stack.with_edges("tool", k)));
    let mut both_films = None;
    for high in 1..count {
        for low in 0..high {
            if sheets[low].is_ply() || sheets[high].is_ply() {
                all.push(stack.of_sheets(low, high));
            } else {
                both_films = Some((all.len(), stack.of_films(low, high, 0.5)));
                all.push(stack.of_films(low, high, 0.25));
            }
        }
    }
    let mut hangs = vec![None; count * count];
    for (film, ply) in films().flat_map(|film| plies().map(move |ply| (film, ply))) {
        hangs[film * count + ply] = Some(all.len());
        all.push(stack.hanging(film, ply));
    }
    let mut beyond = vec![None; count];
    for film in films() {
        beyond[film] = Some(all.len());
        all.push(stack.off_plies(film));
    }
    let films = both_films.map(|(near, both)| {
        all.push(Pair {
            name: both.name.replacen('/', "_off_plies/", 1),
            bound: f64::INFINITY,
            ..both
        });
        [near, all.len() - 1]
    });
    let mut edges = vec![None; parts.len()];
    for (k, part) in parts.iter().enumerate() {
        // Those of the tool have their place.
        if part.name != RigidName::Tool && matches!(part.shape, Shape::Tool(_)) {
            edges[k] = Some(all.len());
            all.extend((0..count).map(|s| stack.with_edges(part.name.word(), s)));
        }
    }
    let numbers = Numbers {
        hangs,
        edges,
        beyond,
        films,
    };
    (all, numbers)
}
