//! Ridge lines: the crest of a wrinkle, and its length over the surface.

use crate::curvature::Curvature;
use crate::topology::Topology;
use petgraph::algo::astar;
use petgraph::graphmap::UnGraphMap;
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{Vec3, add, cross, distance, dot, norm, scale, sub, unit};

/// The crest line of a region.
#[derive(Debug, Clone, PartialEq)]
pub struct Ridge {
    /// Points of the line (m), from one end to the other.
    pub points: Vec<Vec3>,
    /// The node nearest each point when it was found.
    pub nodes: Vec<u32>,
    /// Length of the line (m).
    pub length: f64,
}

/// What bounds a region.
#[derive(Debug, Clone, Copy)]
pub struct Bound<'a> {
    /// Curvature from which on a node is in it (1/m).
    pub threshold: f64,
    /// `[nodes]` what else bounds it, at least 0 inside; empty: nothing else.
    pub margin: &'a [f64],
}

/// The ridge of a connected `region` (nodes of a mesh at `points`): the path over sides and diagonals of cells between the two
/// ends of the region that is shortest when a length counts the more the less the ply is curved there (a minimal path, Cohen and Kimmel
/// 1997). Each node is then moved across the ridge to the top of the parabola through the curvatures
/// of its ring, and the line is smoothed once (1/4, 1/2, 1/4): both keep the steps of a mesh that lies at an
/// angle to the ridge from lengthening the line. At an end where the node ahead is curved less than
/// the bound says, or has a negative margin, the line goes on to where the first of them falls to its bound between
/// the two. `None` for an empty region.
pub fn ridge_line(
    topology: &Topology,
    points: &[Vec3],
    curvature: &[Curvature],
    region: &[u32],
    bound: Bound<'_>,
) -> Option<Ridge> {
    let Bound { threshold, margin } = bound;
    let mut inside = vec![false; topology.nodes()];
    region.iter().for_each(|&i| inside[i as usize] = true);
    let crest_region = Region {
        topology,
        points,
        curvature,
        nodes: region,
        inside: &inside,
        threshold,
        margin,
    };
    let nodes = crest_region.spine()?;
    let crests: Vec<Vec3> = nodes
        .iter()
        .map(|&i| crest(topology, points, curvature, i))
        .collect();
    let mut line = crests.clone();
    for i in 1..line.len().saturating_sub(1) {
        let sides = add(crests[i - 1], crests[i + 1]);
        line[i] = add(scale(crests[i], 0.5), scale(sides, 0.25));
    }
    if sharpness(topology, points, &nodes) > SHARP {
        line = without_steps(line);
    }
    let (first, last) = (nodes[0], nodes[nodes.len() - 1]);
    let axis = curvature[first as usize].min_direction;
    // Out of the region, along the line and the ridge's own direction alike.
    let outwards = |end: u32, before: Option<&u32>, alone: Vec3| {
        let axis = curvature[end as usize].min_direction;
        before.map_or(alone, |&b| {
            let way = unit(sub(points[end as usize], points[b as usize]));
            let along = scale(axis, if dot(axis, way) < 0.0 { -1.0 } else { 1.0 });
            unit(add(along, way))
        })
    };
    let backwards = outwards(first, nodes.get(1), scale(axis, -1.0));
    let before = nodes.len().checked_sub(2).map(|i| &nodes[i]);
    let onwards = outwards(last, before, axis);
    line.insert(0, add(line[0], crest_region.tip(first, backwards)));
    line.push(add(line[line.len() - 1], crest_region.tip(last, onwards)));
    let length = line.windows(2).map(|w| distance(w[0], w[1])).sum();
    Some(Ridge {
        points: line,
        nodes,
        length,
    })
}

/// A crest that turns by more than this (rad) from one node to the next is sharper than the mesh shows: its nodes lie beside it by parts of a
/// cell, and where it is curved most cannot be told between them.
pub const SHARP: f64 = 0.5;

/// Largest turn (rad) of a surface from one cell to another at the same node, over the nodes along a crest: its curvature times the size of a cell, of crests sharper than the
/// mesh as well, whose curvature is not told.
pub fn sharpness(topology: &Topology, points: &[Vec3], nodes: &[u32]) -> f64 {
    let normal = |&c: &u32| {
        let p: Vec<Vec3> = (topology.cell(c as usize).iter())
            .map(|&i| points[i as usize])
            .collect();
        match p.len() {
            3 => unit(cross(sub(p[1], p[0]), sub(p[2], p[0]))),
            _ => unit(cross(sub(p[2], p[0]), sub(p[3], p[1]))),
        }
    };
    let turn = |&i: &u32| {
        let all: Vec<Vec3> = topology.cells_of(i as usize).iter().map(normal).collect();
        let pairs =
            (all.iter().enumerate()).flat_map(|(k, a)| all[k + 1..].iter().map(move |b| (a, b)));
        let least = pairs.map(|(a, b)| dot(*a, *b)).fold(1.0, f64::min);
        least.max(-1.0).fixed_acos()
    };
    nodes.iter().map(turn).fold(0.0, f64::max)
}

/// Nodes over which the direction of a crest is taken where it goes on to the rim.
const HEADING: usize = 4;
/// How far from a crest that is drawn on (in cells) a node of the rim may lie to be its end.
const NEAR: f64 = 0.75;
/// A crest whose direction has this cosine or more with the rim's, within 16 degrees of it, runs along the rim and ends nowhere on it.
const CROSSED: f64 = 0.96;

/// Rounds of [`without_steps`], and how far a round goes to the middle of the neighbours and then back.
const ROUNDS: usize = 4;
const FORTH: f64 = 0.5;
const BACK: f64 = -0.53;

/// A line without steps from node to node, its bends as they are: smoothing that does not shrink (Taubin, SIGGRAPH 1995).
fn without_steps(mut line: Vec<Vec3>) -> Vec<Vec3> {
    for _ in 0..ROUNDS {
        for part in [FORTH, BACK] {
            let before = line.clone();
            for i in 1..line.len().saturating_sub(1) {
                let middle = scale(add(before[i - 1], before[i + 1]), 0.5);
                line[i] = add(before[i], scale(sub(middle, before[i]), part));
            }
        }
    }
    line
}

/// Connected nodes around a crest.
struct Region<'a> {
    topology: &'a Topology,
    points: &'a [Vec3],
    curvature: &'a [Curvature],
    nodes: &'a [u32],
    inside: &'a [bool],
    threshold: f64,
    margin: &'a [f64],
}

impl Region<'_> {
    fn way(&self, from: u32, to: u32) -> Vec3 {
        sub(self.points[to as usize], self.points[from as usize])
    }

    fn strength(&self, i: u32) -> f64 {
        self.curvature[i as usize].max.abs()
    }

    /// The most curved of nodes; of equals the first, for the same line in every run.
    fn strongest(&self, nodes: impl Iterator<Item = u32>) -> Option<u32> {
        nodes.reduce(|a, b| {
            if self.strength(b) > self.strength(a) {
                b
            } else {
                a
            }
        })
    }

    /// Whether the ply bends to the same side at two nodes.
    fn alike(&self, a: u32, b: u32) -> bool {
        self.curvature[a as usize].max * self.curvature[b as usize].max > 0.0
    }

    /// Whether no node beside it, across the ridge, is curved more (Canny's thinning): a corner of the region is no end of its crest.
    fn on_crest(&self, i: u32) -> bool {
        let across = self.curvature[i as usize].max_direction;
        let beside = self.topology.ring(i as usize).iter().filter(|&&n| {
            let way = self.way(i, n);
            self.alike(i, n) && dot(way, across).abs() > 0.9 * norm(way)
        });
        beside
            .copied()
            .all(|n| self.strength(n) <= self.strength(i))
    }

    /// The node of the crest furthest from another.
    fn furthest(&self, from: u32) -> u32 {
        let lengths =
            (self.topology).path_lengths(self.points, &[from], self.inside, f64::INFINITY);
        let crests = self.nodes.iter().copied().filter(|i| self.on_crest(*i));
        crests
            .reduce(|a, b| {
                if lengths[b as usize] > lengths[a as usize] {
                    b
                } else {
                    a
                }
            })
            .unwrap_or(from)
    }

    /// Nodes along the ridge, from end to end.
    fn spine(&self) -> Option<Vec<u32>> {
        let start = self.strongest(self.nodes.iter().copied())?;
        let first = self.furthest(start);
        let last = self.furthest(first);
        if first == last {
            return Some(vec![start]);
        }
        let nodes = self.between(first, last)?;
        let backwards: Vec<u32> = nodes.iter().rev().copied().collect();
        match [&backwards, &nodes].map(|line| self.end_at_rim(line)) {
            ends if ends == [first, last] => Some(nodes),
            [first, last] => self.between(first, last),
        }
    }

    /// Where a line that ends at the mesh's rim is to end. At the rim only one side of a crest is seen: nodes beyond the one at which the crest leaves the mesh look like its
    /// crest too, down to the foot of its flank, and are further off. So the crest is drawn on straight from the last node of the line on it that is not of the rim, and
    /// ends at the node of the rim that comes nearest. A crest that runs along the rim, or does not come near it, ends where the line did.
    fn end_at_rim(&self, line: &[u32]) -> u32 {
        let end = line[line.len() - 1];
        let free = |i: u32| self.topology.is_free(i as usize);
        if !free(end) {
            return end;
        }
        let within = line.iter().rev().copied();
        let within = within.filter(|&i| !free(i) && self.on_crest(i));
        let within: Vec<u32> = within.take(HEADING).collect();
        let &[from, _, _, ..] = within.as_slice() else {
            return end;
        };
        let out = self.way(from, end);
        let along = within.into_iter().map(|i| {
            let axis = self.curvature[i as usize].min_direction;
            scale(axis, if dot(axis, out) < 0.0 { -1.0 } else { 1.0 })
        });
        let along = unit(along.fold([0.0; 3], add));
        let top = crest(self.topology, self.points, self.curvature, from);
        let ring = self.topology.ring(from as usize);
        let size = ring.iter().map(|&i| norm(self.way(from, i))).sum::<f64>() / ring.len() as f64;
        let beside = |i: u32| {
            let way = sub(self.points[i as usize], top);
            let ahead = dot(way, along);
            (ahead > 0.0).then(|| norm(sub(way, scale(along, ahead))))
        };
        let rim = self.nodes.iter().copied().filter(|&i| free(i));
        let near = rim.filter_map(|i| Some((i, beside(i)?)));
        let near = near.filter(|(_, beside)| *beside < NEAR * size);
        let nearest = near.reduce(|a, b| if b.1 < a.1 { b } else { a });
        let crossed = |&(i, _): &(u32, f64)| {
            let rim = self.topology.edge_neighbours(i as usize).iter();
            let rim = rim.filter(|&&n| free(n)).map(|&n| self.way(i, n));
            rim.fold(0.0, |most: f64, w| most.max(dot(w, along).abs() / norm(w))) < CROSSED
        };
        nearest.filter(crossed).map_or(end, |(i, _)| i)
    }

    /// The path between two nodes that is shortest where lengths count the more the less the ply is curved.
    fn between(&self, first: u32, last: u32) -> Option<Vec<u32>> {
        if first == last {
            return Some(vec![first]);
        }
        let mut graph = UnGraphMap::<u32, f64>::new();
        for &i in self.nodes {
            for &j in self.topology.ring(i as usize) {
                if i < j && self.inside[j as usize] {
                    let strength = 0.5 * (self.strength(i) + self.strength(j));
                    graph.add_edge(i, j, norm(self.way(i, j)) / strength);
                }
            }
        }
        let path = astar(&graph, first, |i| i == last, |(_, _, cost)| *cost, |_| 0.0);
        path.map(|(_, nodes)| nodes)
    }

    /// The most curved of `nodes` within 45 degrees of the heading: wider, and the line would turn along
    /// the rim at the end of a region.
    fn ahead(&self, at: u32, heading: Vec3, nodes: impl Iterator<Item = u32>) -> Option<u32> {
        self.strongest(nodes.filter(|&i| {
            let way = self.way(at, i);
            dot(way, heading) > 0.7 * norm(way)
        }))
    }

    fn tip(&self, at: u32, heading: Vec3) -> Vec3 {
        let outside = self.topology.ring(at as usize).iter().copied();
        let outside = outside.filter(|&i| !self.inside[i as usize]);
        let Some(next) = self.ahead(at, heading, outside) else {
            return [0.0; 3];
        };
        // Where between the two a measure falls to zero, if it does.
        let fall =
            |here: f64, there: f64| (there < 0.0 && here > there).then(|| here / (here - there));
        let beyond = |i: u32| self.strength(i) - self.threshold;
        let margin = |i: u32| self.margin.get(i as usize).copied().unwrap_or(0.0);
        let ends = [
            fall(beyond(at), beyond(next)),
            fall(margin(at), margin(next)),
        ];
        let Some(share) = ends.into_iter().flatten().reduce(f64::min) else {
            return [0.0; 3];
        };
        let share = share.clamp(0.0, 1.0);
        scale(heading, share * dot(self.way(at, next), heading))
    }
}

/// The node moved to where the parabola through |curvature| across the ridge has its top, by at most half
/// of the ring's size.
fn crest(topology: &Topology, points: &[Vec3], curvature: &[Curvature], node: u32) -> Vec3 {
    let p = points[node as usize];
    let across = curvature[node as usize].max_direction;
    let ring = topology.ring(node as usize);
    let here = curvature[node as usize].max.abs();
    // Least squares of k - k0 = g u + c u2 over the ring.
    let (mut s2, mut s3, mut s4, mut r1, mut r2, mut size) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for &i in ring {
        let offset = sub(points[i as usize], p);
        let u = dot(offset, across);
        let k = curvature[i as usize].max.abs() - here;
        s2 += u * u;
        s3 += u * u * u;
        s4 += u * u * u * u;
        r1 += u * k;
        r2 += u * u * k;
        size += norm(offset) / ring.len() as f64;
    }
    let determinant = s2 * s4 - s3 * s3;
    if determinant <= 1e-6 * s2 * s4 {
        return p;
    }
    let g = (r1 * s4 - r2 * s3) / determinant;
    let c = (r2 * s2 - r1 * s3) / determinant;
    if c >= 0.0 {
        return p;
    }
    let shift = (-g / (2.0 * c)).clamp(-0.5 * size, 0.5 * size);
    let height = 0.5 * curvature[node as usize].max * shift * shift;
    add(
        p,
        add(
            scale(across, shift),
            scale(curvature[node as usize].normal, height),
        ),
    )
}
