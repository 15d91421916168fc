//! What is held against what.

use super::{DEPTH_BOUND, Part};
use crate::run::Forming;
use plyflow_model::scene::SheetKind;

/// What is held against what in a pair.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Nodes against a part or a sheet.
    Nodes,
    /// The tool's edges against the cells of a sheet.
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
pub(super) struct Numbers {
    /// By film and ply: of what hangs through.
    pub(super) hangs: Vec<Option<usize>>,
    /// By film: of edges of the tool that are an element away from all plies.
    pub(super) beyond: Vec<Option<usize>>,
    /// Of the two films, and of the two where they are an element away from all plies.
    pub(super) films: Option<[usize; 2]>,
}

/// The pairs: parts with sheets, edges of the tool with sheets, sheets with each other, and those of [`Numbers`].
pub(super) fn pairs(forming: &Forming, parts: &[Part], sizes: &[f64]) -> (Vec<Pair>, Numbers) {
    let stack = &forming.stack;
    let is_ply = |k: usize| stack[k].scene.kind == SheetKind::Ply;
    let plies = (0..stack.len()).filter(|k| is_ply(*k));
    let thinnest = plies
        .map(|k| stack[k].thickness)
        .fold(f64::INFINITY, f64::min);
    let name = |k: usize| stack[k].scene.name.as_str();
    let mut all = Vec::new();
    for part in parts {
        for (k, s) in stack.iter().enumerate() {
            let thinner = s.thickness;
            all.push(Pair {
                name: format!("{}/{}", part.name, name(k)),
                kind: Kind::Nodes,
                thinner,
                bound: DEPTH_BOUND * thinner,
                // A film may land on the bed harder than it is thick.
                most: thinner.max(if is_ply(k) { 0.0 } else { thinnest }),
                of_ply: is_ply(k),
            });
        }
    }
    let edges = |k: usize| Pair {
        name: format!("tool_edges/{}", name(k)),
        kind: Kind::Edges,
        thinner: stack[k].thickness,
        bound: stack[k].thickness.max(thinnest),
        most: 0.5 * sizes[k],
        of_ply: is_ply(k),
    };
    all.extend((0..stack.len()).map(edges));
    let pair = |low: usize, high: usize| {
        let [a, b] = [low, high].map(|k| stack[k].thickness);
        Pair {
            name: format!("{}/{}", name(low), name(high)),
            kind: Kind::Nodes,
            thinner: a.min(b),
            bound: DEPTH_BOUND * a.min(b),
            // Until their middles have crossed.
            most: 0.5 * (a + b),
            of_ply: true,
        }
    };
    // No ply feels what films do to each other beside the plies; they fold there.
    let films = |low: usize, high: usize, element: f64| Pair {
        bound: DEPTH_BOUND * thinnest,
        most: thinnest.max(element * sizes[low].min(sizes[high])),
        of_ply: false,
        ..pair(low, high)
    };
    let mut both_films = None;
    for high in 1..stack.len() {
        for low in 0..high {
            if is_ply(low) || is_ply(high) {
                all.push(pair(low, high));
            } else {
                both_films = Some((all.len(), films(low, high, 0.5)));
                all.push(films(low, high, 0.25));
            }
        }
    }
    let mut hangs = vec![None; stack.len() * stack.len()];
    for film in (0..stack.len()).filter(|k| !is_ply(*k)) {
        for ply in (0..stack.len()).filter(|k| is_ply(*k)) {
            hangs[film * stack.len() + ply] = Some(all.len());
            let both = pair(film.min(ply), film.max(ply));
            all.push(Pair {
                name: format!("between_nodes/{}", both.name),
                kind: Kind::Hangs,
                bound: f64::INFINITY,
                most: f64::INFINITY,
                ..both
            });
        }
    }
    let mut beyond = vec![None; stack.len()];
    for film in (0..stack.len()).filter(|k| !is_ply(*k)) {
        beyond[film] = Some(all.len());
        all.push(Pair {
            name: format!("tool_edges_off_plies/{}", name(film)),
            bound: f64::INFINITY,
            ..edges(film)
        });
    }
    let films = both_films.map(|(near, both)| {
        all.push(Pair {
            name: both.name.replacen('/', "_off_plies/", 1),
            bound: f64::INFINITY,
            ..both
        });
        [near, all.len() - 1]
    });
    let numbers = Numbers {
        hangs,
        beyond,
        films,
    };
    (all, numbers)
}
