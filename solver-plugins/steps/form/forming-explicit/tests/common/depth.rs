//! How deep the nodes of sheets lie in other sheets, from their places alone: nothing here is shared with contact.

use plyflow_forming_explicit::Forming;
use plyflow_geometry::vec3::{Vec3, add, cross, dot, norm, scale, sub, unit};
use plyflow_model::scene::SheetKind;

/// The deepest node of one sheet in another.
#[derive(Debug, Clone)]
pub struct Depth {
    /// The nodes' sheet and the other one.
    pub pair: [String; 2],
    /// Thickness (m) of the thinner one.
    pub thinner: f64,
    /// How much nearer (m) than half of both thicknesses the two mid-surfaces are; a node on the wrong side of the other sheet is deeper than
    /// that.
    pub depth: f64,
    /// Where the node is (m).
    pub place: Vec3,
}

/// A point of a bilinear cell and its distance (m) from `p`; whether it lies on one of the cell's sides without a neighbour.
fn closest(q: [Vec3; 4], free: [bool; 4], p: Vec3) -> (f64, Vec3, bool) {
    let mix = |w: [f64; 4]| (0..4).fold([0.0; 3], |s, k| add(s, scale(q[k], w[k])));
    let shape = |[u, v]: [f64; 2]| [(1.0 - u) * (1.0 - v), u * (1.0 - v), u * v, (1.0 - u) * v];
    let distance = |at: [f64; 2]| norm(sub(p, mix(shape(at))));
    // A pattern search: slow and sure.
    let (mut at, mut step) = ([0.5; 2], 0.5);
    let mut best = distance(at);
    while step > 1e-7 {
        let ways = [[step, 0.0], [-step, 0.0], [0.0, step], [0.0, -step]];
        let tried = ways.map(|w| [0, 1].map(|k: usize| (at[k] + w[k]).clamp(0.0, 1.0)));
        let found = tried.into_iter().map(|t| (distance(t), t));
        let (d, t) = found.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        if d < best {
            (best, at) = (d, t);
        } else {
            step *= 0.5;
        }
    }
    let on = [
        at[1] < 1e-6,
        at[0] > 1.0 - 1e-6,
        at[1] > 1.0 - 1e-6,
        at[0] < 1e-6,
    ];
    let rim = (0..4).any(|k| on[k] && free[k]);
    (best, mix(shape(at)), rim)
}

/// The deepest node of every pair of sheets of which one is a ply: of plies in each other and in the films, and of the upper film in plies. (The
/// lower film's nodes lie on the tool, through whose edges the plies' straight elements cut.)
pub fn depths(forming: &Forming) -> Vec<Depth> {
    let last = forming.stack.len() - 1;
    let is_ply = |k: usize| forming.stack[k].scene.kind == SheetKind::Ply;
    let mut found = Vec::new();
    for slave in 0..=last {
        for master in (0..=last).filter(|m| *m != slave) {
            if is_ply(slave) {
                found.extend(deepest(forming, slave, master));
            }
        }
    }
    found
}

fn deepest(forming: &Forming, slave: usize, master: usize) -> Option<Depth> {
    let [own, other] = [slave, master].map(|k| &forming.stack[k]);
    let (nodes, points) = (
        forming.points(&forming.bodies[slave]),
        forming.points(&forming.bodies[master]),
    );
    let cells = &forming.bodies[master].cells;
    let edge = |c: &[u32; 4], k: usize| [c[k].min(c[(k + 1) % 4]), c[k].max(c[(k + 1) % 4])];
    let mut edges: Vec<[u32; 2]> =
        (cells.iter().flat_map(|c| (0..4).map(move |k| edge(c, k)))).collect();
    edges.sort_unstable();
    let shared = |e: [u32; 2]| {
        let at = edges.partition_point(|f| *f < e);
        edges.get(at + 1) == Some(&e)
    };
    let touching = 0.5 * (own.thickness + other.thickness);
    let side = if slave > master { 1.0 } else { -1.0 };
    let cells: Vec<([Vec3; 4], [bool; 4], Vec3, f64)> = (cells.iter())
        .map(|c| {
            let q = c.map(|n| points[n as usize]);
            let middle = scale(q.into_iter().fold([0.0; 3], add), 0.25);
            let radius = q.iter().map(|p| norm(sub(*p, middle))).fold(0.0, f64::max);
            (q, [0, 1, 2, 3].map(|k| !shared(edge(c, k))), middle, radius)
        })
        .collect();
    let depth = |p: &Vec3| {
        // What is further away than this is not in it.
        let mut best = (4e-3, [0.0; 3], [0.0; 3], true);
        for (q, free, middle, radius) in &cells {
            if norm(sub(*p, *middle)) > radius + best.0 {
                continue;
            }
            let (d, at, rim) = closest(*q, *free, *p);
            if d < best.0 {
                let normal = unit(cross(sub(q[2], q[0]), sub(q[3], q[1])));
                best = (d, sub(*p, at), normal, rim);
            }
        }
        let height = side * dot(best.1, best.2);
        (!best.3).then(|| touching - best.0.copysign(height))
    };
    let all = nodes.iter().filter_map(|p| Some((depth(p)?, *p)));
    let (depth, place) = all.max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(Depth {
        pair: [own.scene.name.clone(), other.scene.name.clone()],
        thinner: own.thickness.min(other.thickness),
        depth,
        place,
    })
}
