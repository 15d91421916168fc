//! The crests of one connected place. Two wrinkles that meet, such as one across a spar and one along its edge, are connected, and have each a direction and
//! a length of its own: a crest that turns a corner is several, and what branches off is one by itself.

use crate::ply::Ply;
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{distance, dot, norm, sub};
use plyflow_surface::Ridge;

/// Turn of a crest in the flat ply (rad) that is a corner: more than the 45 degrees by which a line over a mesh's sides and diagonals may turn.
const CORNER: f64 = std::f64::consts::FRAC_PI_3;

/// The turn is that between the ways over this length (m) on either side, ..
const REACH: f64 = 0.010;

/// .. or over so many distances of nodes, on coarser meshes.
const NODES: f64 = 2.5;

/// Cosine of the least angle at which a branch leaves a crest (45 degrees).
const LEAVES: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Nodes of a crest, with its ridge.
pub type Crest = (Vec<u32>, Ridge);

/// The crests of a connected place (nodes): its ridge, parted at its corners, and those of its branches, of branches of these, and so on. `ridge_of` gives the ridge of nodes that are
/// connected, `None` for what has none that counts. What lies nearer to a ridge than `beside` (m), along the surface, is its flank and no branch, nor is what goes on beside it. Every node goes to the crest that is nearest over the place.
pub fn crests(
    ply: &Ply,
    nodes: &[u32],
    beside: f64,
    ridge_of: impl Fn(&[u32]) -> Option<Ridge>,
) -> Vec<Crest> {
    let mask = |of: &[u32]| {
        let mut inside = vec![false; ply.topology.nodes()];
        of.iter().for_each(|&i| inside[i as usize] = true);
        inside
    };
    let lengths = |from: &[u32], inside: &[bool]| {
        (ply.topology).path_lengths(&ply.formed, from, inside, f64::INFINITY)
    };
    let mut ridges = Vec::new();
    let mut regions = vec![(nodes.to_vec(), None)];
    let whole = mask(nodes);
    while let Some((region, parent)) = regions.pop() {
        let Some(mut ridge) = ridge_of(&region) else {
            continue;
        };
        if parent.is_some_and(|p: Ridge| !joined(ply, &mut ridge, &p, beside)) {
            continue;
        }
        let mut rest = mask(&region);
        let away = lengths(&ridge.nodes, &whole);
        for i in 0..rest.len() {
            rest[i] &= away[i] > beside.max(reach(&ridge));
        }
        let branches = ply.topology.node_components(&rest).into_iter();
        regions.extend(branches.map(|b| (b, Some(ridge.clone()))));
        let corners = corners(ply, &ridge.nodes, reach(&ridge));
        let last = ridge.nodes.len() - 1;
        let begins = [0].into_iter().chain(corners.iter().copied());
        let ends = corners.iter().copied().chain([last]);
        ridges.extend(begins.zip(ends).map(|(a, b)| part(&ridge, a, b)));
    }
    if ridges.len() < 2 {
        return ridges.into_iter().map(|r| (nodes.to_vec(), r)).collect();
    }
    let lengths: Vec<Vec<f64>> = ridges.iter().map(|r| lengths(&r.nodes, &whole)).collect();
    let mut of = vec![Vec::new(); ridges.len()];
    for &i in nodes {
        let at = |k: &usize| lengths[*k][i as usize];
        let nearest = (0..ridges.len()).min_by(|a, b| at(a).total_cmp(&at(b)));
        of[nearest.unwrap_or(0)].push(i);
    }
    of.into_iter().zip(ridges).collect()
}

/// How far (m) the ways reach that tell the turn of a ridge.
fn reach(ridge: &Ridge) -> f64 {
    REACH.max(NODES * ridge.length / ridge.nodes.len() as f64)
}

/// Lets a branch begin at the ridge that it leaves, where that is not further than twice what counts as its flank. False of one that goes on beside the ridge
/// (less than [`LEAVES`] from its direction): a fold that widens to two crests is one.
fn joined(ply: &Ply, branch: &mut Ridge, parent: &Ridge, beside: f64) -> bool {
    let nearest = |end: u32| {
        let p = ply.formed[end as usize];
        let apart = |i: &u32| distance(p, ply.formed[*i as usize]);
        let places = parent.nodes.iter().map(apart).enumerate();
        places.min_by(|a, b| a.1.total_cmp(&b.1))
    };
    let last = branch.nodes.len() - 1;
    let ends = [0, last].map(|k| nearest(branch.nodes[k]).map(|(at, d)| (d, k, at)));
    let Some((_, end, at)) = (ends.into_iter().flatten())
        .filter(|n| n.0 <= 2.0 * beside.max(reach(parent)))
        .min_by(|a, b| a.0.total_cmp(&b.0))
    else {
        return true;
    };
    // Ways in the flat ply: of the branch from its end on, of the other one around the nearest place.
    let place = |i: u32| ply.undeformed[i as usize];
    let reach = reach(parent);
    let far = |i: &u32, from: u32| distance(place(*i), place(from)) >= reach;
    let (own, theirs) = (&branch.nodes, parent.nodes[at]);
    let (begin, goal) = (own[end], own[last - end]);
    let mut onwards = own.iter().copied();
    let ahead = if end == 0 {
        onwards.find(|i| far(i, begin))
    } else {
        onwards.rev().find(|i| far(i, begin))
    };
    let mut before = parent.nodes[..at].iter().rev().copied();
    let mut after = parent.nodes[at..].iter().copied();
    let before = before.find(|i| far(i, theirs)).unwrap_or(theirs);
    let after = after.find(|i| far(i, theirs)).unwrap_or(theirs);
    let along = sub(place(after), place(before));
    let way = sub(place(ahead.unwrap_or(goal)), place(begin));
    if dot(along, way).abs() > LEAVES * norm(along) * norm(way) {
        return false;
    }
    let tip = if end == 0 { 0 } else { branch.points.len() - 1 };
    branch.points[tip] = ply.formed[parent.nodes[at] as usize];
    branch.length = branch.points.windows(2).map(|w| distance(w[0], w[1])).sum();
    true
}

/// A ridge from its node `a` to its node `b`. Its line has a tip beyond either of its end nodes, which parts in its middle have not.
fn part(ridge: &Ridge, a: usize, b: usize) -> Ridge {
    let last = ridge.nodes.len() - 1;
    if (a, b) == (0, last) {
        return ridge.clone();
    }
    let from = if a == 0 { 0 } else { a + 1 };
    let to = if b == last { last + 2 } else { b + 1 };
    let mut points = ridge.points[from..=to].to_vec();
    // Every ridge has a tip at both ends: at a corner it is the corner.
    if a != 0 {
        points.insert(0, points[0]);
    }
    if b != last {
        points.push(points[points.len() - 1]);
    }
    Ridge {
        length: points.windows(2).map(|w| distance(w[0], w[1])).sum(),
        points,
        nodes: ridge.nodes[a..=b].to_vec(),
    }
}

/// Places in a line of nodes where it turns a corner in the flat ply, ascending; sharpest first where several are near each other.
fn corners(ply: &Ply, nodes: &[u32], reach: f64) -> Vec<usize> {
    let places: Vec<[f64; 2]> = nodes
        .iter()
        .map(|&i| {
            let p = ply.undeformed[i as usize];
            [p[0], p[1]]
        })
        .collect();
    let way = |a: usize, b: usize| [0, 1].map(|k| places[b][k] - places[a][k]);
    let mut stations = vec![0.0];
    for i in 1..places.len() {
        let [x, y] = way(i - 1, i);
        stations.push(stations[i - 1] + x.fixed_hypot(y));
    }
    let turn = |i: usize| {
        let before = (0..i).rev().find(|&k| stations[i] - stations[k] >= reach)?;
        let after = (i + 1..places.len()).find(|&k| stations[k] - stations[i] >= reach)?;
        let ([ax, ay], [bx, by]) = (way(before, i), way(i, after));
        let angle = (ax * by - ay * bx).fixed_atan2(ax * bx + ay * by);
        (angle.abs() > CORNER).then(|| (angle.abs(), i))
    };
    let mut sharp: Vec<(f64, usize)> = (0..places.len()).filter_map(turn).collect();
    sharp.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut found: Vec<usize> = Vec::new();
    for (_, i) in sharp {
        if (found.iter()).all(|&k| (stations[k] - stations[i]).abs() >= reach) {
            found.push(i);
        }
    }
    found.sort_unstable();
    found
}
