//! Ridge lines: the crest of a wrinkle, and its length over the surface.

use crate::curvature::Curvature;
use crate::topology::Topology;
use crate::vector::{Vec3, add, distance, dot, norm, scale, sub, unit};

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

/// Walks the ridge of a connected `region` (nodes of a mesh at `points`) both ways from its most curved
/// node: each step goes along the direction of smallest curvature to the most curved node ahead inside the
/// region. Each node is then moved across the ridge to the top of the parabola through the curvatures
/// of its ring, and the line is smoothed once (1/4, 1/2, 1/4): both keep the steps of a mesh that lies at an
/// angle to the ridge from lengthening the line. At an end where the node ahead is curved less than
/// `threshold` (1/m, the bound of the region), or has a negative `margin` (`[nodes]`, what else bounds the region, at
/// least 0 inside; empty: nothing else), the line goes on to where the first of them falls to its bound between
/// the two. `None` for an empty region.
pub fn ridge_line(
    topology: &Topology,
    points: &[Vec3],
    curvature: &[Curvature],
    region: &[u32],
    threshold: f64,
    margin: &[f64],
) -> Option<Ridge> {
    let strength = |i: u32| curvature[i as usize].max.abs();
    // Of equals the lowest index, for the same line in every run.
    let start = region
        .iter()
        .copied()
        .reduce(|a, b| if strength(b) > strength(a) { b } else { a })?;
    let mut inside = vec![false; topology.nodes()];
    region.iter().for_each(|&i| inside[i as usize] = true);
    let along = curvature[start as usize].min_direction;
    let walk = Walk {
        topology,
        points,
        curvature,
        inside: &inside,
        threshold,
        margin,
    };
    let (mut nodes, first_tip) = walk.from(start, scale(along, -1.0));
    nodes.reverse();
    nodes.push(start);
    let (onward, last_tip) = walk.from(start, along);
    nodes.extend(onward);
    let crests: Vec<Vec3> = nodes
        .iter()
        .map(|&i| crest(topology, points, curvature, i))
        .collect();
    let mut line = crests.clone();
    for i in 1..line.len().saturating_sub(1) {
        let sides = add(crests[i - 1], crests[i + 1]);
        line[i] = add(scale(crests[i], 0.5), scale(sides, 0.25));
    }
    line.insert(0, add(line[0], first_tip));
    line.push(add(line[line.len() - 1], last_tip));
    let length = line.windows(2).map(|w| distance(w[0], w[1])).sum();
    Some(Ridge {
        points: line,
        nodes,
        length,
    })
}

struct Walk<'a> {
    topology: &'a Topology,
    points: &'a [Vec3],
    curvature: &'a [Curvature],
    inside: &'a [bool],
    threshold: f64,
    margin: &'a [f64],
}

impl Walk<'_> {
    /// Nodes after `start`, and the way from the last one on to the bound of the region.
    fn from(&self, start: u32, mut heading: Vec3) -> (Vec<u32>, Vec3) {
        let mut path = Vec::new();
        let mut visited = vec![start];
        let mut at = start;
        while let Some(next) = self.next(at, heading, &visited) {
            // The principal direction has no sign, and is rough where the ridge is weak: the heading is
            // kept by averaging it with the way gone.
            let way = unit(self.way(at, next));
            let axis = self.curvature[next as usize].min_direction;
            let axis = if dot(axis, heading) < 0.0 {
                scale(axis, -1.0)
            } else {
                axis
            };
            heading = unit(add(scale(heading, 0.5), add(axis, scale(way, 0.5))));
            visited.push(next);
            path.push(next);
            at = next;
        }
        (path, self.tip(at, heading))
    }

    fn way(&self, from: u32, to: u32) -> Vec3 {
        sub(self.points[to as usize], self.points[from as usize])
    }

    fn strength(&self, i: u32) -> f64 {
        self.curvature[i as usize].max.abs()
    }

    /// The most curved of `nodes` within 45 degrees of the heading: wider, and the line would turn along
    /// the rim at the end of a region.
    fn ahead(&self, at: u32, heading: Vec3, nodes: impl Iterator<Item = u32>) -> Option<u32> {
        nodes
            .filter(|&i| {
                let way = self.way(at, i);
                dot(way, heading) > 0.7 * norm(way)
            })
            .reduce(|a, b| {
                if self.strength(b) > self.strength(a) {
                    b
                } else {
                    a
                }
            })
    }

    /// The next node inside the region: of the first ring, or where an irregular mesh has none ahead, of
    /// the second.
    fn next(&self, at: u32, heading: Vec3, visited: &[u32]) -> Option<u32> {
        (1..=2).find_map(|rings| {
            let ring = self.topology.rings(at as usize, rings).into_iter();
            let open = ring.filter(|i| self.inside[*i as usize] && !visited.contains(i));
            self.ahead(at, heading, open)
        })
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
