//! What bodies of a tool have in common, so that it is not counted once for each of them.

use crate::mesh::ToolMesh;
use plyflow_geometry::rectangle::Rectangle;
use plyflow_geometry::vec3::Vec3;

/// Lines along each side of the rectangle in which bodies may overlap. What they have in common is found to within some thousandths of it.
const LINES: usize = 512;

/// Upright lines in a rectangle, in the middles of equal cells.
struct Lines {
    low: [f64; 2],
    size: [f64; 2],
}

/// Where a surface crosses one of these lines.
struct Crossing {
    line: u32,
    height: f64,
    /// 1: into a body, on the way down; -1: out of it.
    sign: i32,
}

impl Lines {
    fn within([x0, y0, x1, y1]: Rectangle) -> Self {
        let size = [x1 - x0, y1 - y0].map(|l| l / LINES as f64);
        let low = [x0, y0];
        Self { low, size }
    }

    fn at(&self, i: usize, d: usize) -> f64 {
        self.low[d] + (i as f64 + 0.5) * self.size[d]
    }

    /// The lines that may cross what lies between two coordinates.
    fn between(&self, d: usize, from: f64, to: f64) -> std::ops::Range<usize> {
        let index = |x: f64| ((x - self.low[d]) / self.size[d]).clamp(0.0, LINES as f64) as usize;
        index(from)..(index(to) + 1).min(LINES)
    }

    /// Adds where a facet is crossed. Of two facets that meet in an edge in plan, one has it.
    fn cross(&self, corners: [Vec3; 3], crossings: &mut Vec<Crossing>) {
        let [a, mut b, mut c] = corners;
        let twice = |a: Vec3, b: Vec3, c: Vec3| {
            (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        };
        let looks_up = twice(a, b, c) > 0.0;
        if !looks_up {
            (b, c) = (c, b);
        }
        let area = twice(a, b, c);
        if area <= 0.0 {
            return;
        }
        let bound = |d: usize, of: fn(f64, f64) -> f64| of(a[d], of(b[d], c[d]));
        for i in self.between(0, bound(0, f64::min), bound(0, f64::max)) {
            for j in self.between(1, bound(1, f64::min), bound(1, f64::max)) {
                let p = [self.at(i, 0), self.at(j, 1), 0.0];
                let weights = [(b, c), (c, a), (a, b)].map(|(from, to)| {
                    let w = twice(from, to, p);
                    let has_edge = to[1] < from[1] || (to[1] == from[1] && to[0] < from[0]);
                    (w > 0.0 || (w == 0.0 && has_edge)).then_some(w)
                });
                let [Some(u), Some(v), Some(w)] = weights else {
                    continue;
                };
                crossings.push(Crossing {
                    line: (i * LINES + j) as u32,
                    height: (u * a[2] + v * b[2] + w * c[2]) / area,
                    sign: if looks_up { 1 } else { -1 },
                });
            }
        }
    }
}

impl ToolMesh {
    /// Of what lies over `base` (m) and under an opening, a rectangle in plan (m), that which lies in several bodies: its area (m2) at `base` and its
    /// volume (m3), each as often as it is counted too much where areas and volumes of bodies are added up. The bodies are closed, or open only at a
    /// foot that lies no higher than `base`. By upright lines, to within some thousandths.
    pub(crate) fn counted_again(&self, opening: Rectangle, base: f64) -> [f64; 2] {
        let Some(common) = self.common(opening) else {
            return [0.0; 2];
        };
        let lines = Lines::within(common);
        let mut crossings = Vec::new();
        for t in 0..self.triangles.len() {
            lines.cross(self.corners(t), &mut crossings);
        }
        crossings.sort_by(|a, b| a.line.cmp(&b.line).then(b.height.total_cmp(&a.height)));
        let (mut sections, mut length) = (0.0, 0.0);
        for line in crossings.chunk_by(|a, b| a.line == b.line) {
            let mut bodies = 0;
            for (k, crossing) in line.iter().enumerate() {
                bodies += crossing.sign;
                let next = line.get(k + 1).map_or(base, |c| c.height.max(base));
                let again = f64::from((bodies - 1).max(0));
                length += again * (crossing.height - next).max(0.0);
                // A foot that stands on `base` has no section there, as what is added up has none.
                if crossing.height > base && line.get(k + 1).is_none_or(|c| c.height < base) {
                    sections += again;
                }
            }
        }
        let cell = lines.size[0] * lines.size[1];
        [sections * cell, length * cell]
    }

    /// The rectangle in plan (m), within an opening, that holds all places where boxes of two bodies overlap; `None`: nowhere.
    fn common(&self, opening: Rectangle) -> Option<Rectangle> {
        let of = self.bodies();
        let count = of.iter().max().map_or(0, |m| *m as usize + 1);
        let mut boxes = vec![[[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]]; count];
        for (t, body) in of.iter().enumerate() {
            let [low, high] = &mut boxes[*body as usize];
            for p in self.corners(t) {
                for d in 0..3 {
                    low[d] = low[d].min(p[d]);
                    high[d] = high[d].max(p[d]);
                }
            }
        }
        let mut hull: Option<Rectangle> = None;
        for (k, a) in boxes.iter().enumerate() {
            for b in &boxes[k + 1..] {
                let overlap = |d: usize| (a[0][d].max(b[0][d]), a[1][d].min(b[1][d]));
                let [x, y, z] = [0, 1, 2].map(overlap);
                let x = (x.0.max(opening[0]), x.1.min(opening[2]));
                let y = (y.0.max(opening[1]), y.1.min(opening[3]));
                if x.0 >= x.1 || y.0 >= y.1 || z.0 >= z.1 {
                    continue;
                }
                let both = [x.0, y.0, x.1, y.1];
                hull = Some(hull.map_or(both, |h| plyflow_geometry::rectangle::hull(h, both)));
            }
        }
        hull
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::facets::join;

    /// A box, closed or without its foot; turned inside out it is a hollow.
    fn block(low: Vec3, high: Vec3, is_closed: bool, is_hollow: bool) -> Vec<[Vec3; 3]> {
        let at = |k: usize| [0, 1, 2].map(|d| if k >> d & 1 == 1 { high[d] } else { low[d] });
        let faces = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [1, 3, 7, 5],
            [3, 2, 6, 7],
            [2, 0, 4, 6],
        ];
        let faces = faces.into_iter().skip(usize::from(!is_closed));
        let facets = faces.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
        facets
            .map(|[a, b, c]| {
                let [b, c] = if is_hollow { [c, b] } else { [b, c] };
                [at(a), at(b), at(c)]
            })
            .collect()
    }

    fn mesh(blocks: &[Vec<[Vec3; 3]>]) -> ToolMesh {
        let found = join(&blocks.concat());
        ToolMesh {
            points: found.points,
            triangles: found.triangles,
        }
    }

    const WIDE: Rectangle = [-1.0, -1.0, 1.0, 1.0];

    #[test]
    fn what_two_bodies_have_in_common_counts_once() {
        let low = block([0.0, 0.0, 0.0], [0.06, 0.04, 0.01], true, false);
        let high = block([0.013, 0.007, 0.003], [0.031, 0.021, 0.05], true, false);
        let both = mesh(&[low.clone(), high.clone()]);
        let expected = 0.06 * 0.04 * 0.01 + 0.018 * 0.014 * 0.04;
        let common = 0.018 * 0.014 * 0.007;
        assert!(
            (both.volume() - expected).abs() < 4e-3 * common,
            "{}",
            both.volume()
        );
        // The same over a base and under a part of them; and three in one place.
        let three = mesh(&[low, high.clone(), high]);
        for tool in [&both, &three] {
            let [area, volume] = tool.column([0.02, 0.0, 0.04, 0.04], 0.005);
            let (wide, narrow) = (0.02 * 0.04 * 0.005, 0.011 * 0.014 * 0.04);
            assert!((area - 0.02 * 0.04).abs() < 4e-3 * 0.011 * 0.014, "{area}");
            assert!((volume - wide - narrow).abs() < 4e-3 * narrow, "{volume}");
        }
    }

    #[test]
    fn bodies_apart_and_hollows_are_counted_as_they_are() {
        let low = block([0.0, 0.0, 0.0], [0.06, 0.04, 0.01], true, false);
        let beside = block([0.06, 0.0, 0.0], [0.09, 0.04, 0.01], true, false);
        let on_it = block([0.01, 0.01, 0.01], [0.03, 0.03, 0.02], true, false);
        let hollow = block([0.02, 0.01, 0.002], [0.05, 0.03, 0.007], true, true);
        for tool in [
            vec![low.clone(), beside],
            vec![low.clone(), on_it],
            vec![low, hollow],
        ] {
            let again = mesh(&tool).counted_again(WIDE, 0.0);
            assert_eq!(again, [0.0; 2]);
        }
    }

    #[test]
    fn a_foot_may_be_open() {
        let open = |low, high| block(low, high, false, false);
        let tool = mesh(&[
            open([0.0, 0.0, 0.0], [0.06, 0.04, 0.02]),
            open([0.02, -0.01, 0.0], [0.04, 0.05, 0.01]),
        ]);
        let [area, volume] = tool.column(WIDE, 0.0);
        let common = 0.02 * 0.04;
        assert!(
            (area - (0.06 * 0.04 + 0.02 * 0.06 - common)).abs() < 4e-3 * common,
            "{area}"
        );
        let expected = 0.06 * 0.04 * 0.02 + 0.02 * 0.06 * 0.01 - common * 0.01;
        assert!((volume - expected).abs() < 4e-3 * common * 0.01, "{volume}");
    }
}
