//! Mirror symmetry: models of a half or a quarter, cut at the planes x = 0 and y = 0.
//!
//! The part with x >= 0 (y >= 0) is modelled; nodes on a plane stay on it. An element that is cut off at a plane has
//! all that it needs, but a node patch around a node of the plane reaches over it: the nodes that it misses are
//! [`Ghost`]s, which are where the mirror images of the model's nodes are. Forces on a ghost are mirrored and act on
//! its image, so that the model has exactly a half or a quarter of the whole's energy, and its gradient.

use crate::mesh::{NONE, Patch, QuadMesh, limit_patches};
use crate::vec3::Vec3;

/// By plane, x = 0 and y = 0: whether something is mirrored in it.
pub type Image = [bool; 2];

/// Across an edge (in the place of a neighbour) lies the cell's own mirror image, by plane.
pub const MIRRORED: [u32; 2] = [NONE - 1, NONE - 2];

/// The plane in which a "neighbour" is the cell's own mirror image.
#[inline(always)]
pub(crate) fn mirrored_in(neighbour: u32) -> Option<usize> {
    match NONE - neighbour {
        1 => Some(0),
        2 => Some(1),
        _ => None,
    }
}

/// A vector mirrored in the planes of `image`.
#[inline(always)]
pub fn reflect(v: Vec3, image: Image) -> Vec3 {
    let turn = |c: f64, mirrored: bool| if mirrored { -c } else { c };
    [turn(v[0], image[0]), turn(v[1], image[1]), v[2]]
}

/// Mirror planes of a model.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Planes(pub Image);

impl Planes {
    /// Whether there is any.
    pub fn any(self) -> bool {
        self.0 != [false; 2]
    }

    /// How often the whole holds the modelled part: 1, 2 or 4.
    pub fn copies(self) -> usize {
        self.images().len()
    }

    /// The modelled part itself and its mirror images, in the order in which [`Whole`] has them.
    pub fn images(self) -> &'static [Image] {
        const ALL: [Image; 4] = [[false, false], [true, false], [false, true], [true, true]];
        const Y: [Image; 2] = [[false, false], [false, true]];
        match self.0 {
            [false, false] => &ALL[..1],
            [true, false] => &ALL[..2],
            [false, true] => &Y,
            [true, true] => &ALL,
        }
    }

    /// The planes on which a point lies.
    #[inline]
    pub fn holding(self, p: Vec3) -> Image {
        [0, 1].map(|k| self.0[k] && p[k] == 0.0)
    }

    /// Share of a node at `p` that belongs to the modelled part: 1/2 on a plane, 1/4 on both.
    pub fn share(self, p: Vec3) -> f64 {
        let on = self.holding(p).iter().filter(|on| **on).count();
        [1.0, 0.5, 0.25][on]
    }
}

/// A place at the mirror image of a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ghost {
    /// Its own number.
    pub node: u32,
    /// The node that it mirrors.
    pub of: u32,
    /// The planes in which it does.
    pub image: Image,
}

/// Planes of a model, and its ghosts in increasing order.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Mirrors {
    /// The planes.
    pub planes: Planes,
    /// Numbers of the model; a sheet's stand after its own nodes in [`crate::sheet::SheetSpec::nodes`].
    pub ghosts: Vec<Ghost>,
}

/// A modelled part with its mirror images. The part comes first, in its own numbering, then what is not on a plane of
/// each image.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Whole {
    /// `[nodes]` node of the part, and the planes in which it is mirrored.
    pub nodes: Vec<(u32, Image)>,
    /// `[cells]` cell of the part, and the planes.
    pub origins: Vec<(u32, Image)>,
    /// `[cells]` nodes, counter-clockwise seen from above.
    pub cells: Vec<[u32; 4]>,
}

impl Whole {
    /// Mirrors a part with the points `points` (m) and cells in their numbers.
    pub fn new(points: &[Vec3], cells: &[[u32; 4]], planes: Planes) -> Self {
        let mut whole = Self::default();
        let index = |[x, y]: Image| usize::from(x) + 2 * usize::from(y);
        // By image: numbers of its nodes.
        let mut numbers: [Vec<u32>; 4] = Default::default();
        for image in planes.images() {
            for (n, p) in points.iter().enumerate() {
                let on = planes.holding(*p);
                // On a plane a node is its own mirror image: that of an image before.
                let own = [0, 1].map(|k| image[k] && !on[k]);
                let number = if own == *image {
                    whole.nodes.push((n as u32, *image));
                    whole.nodes.len() as u32 - 1
                } else {
                    numbers[index(own)][n]
                };
                numbers[index(*image)].push(number);
            }
            let number = &numbers[index(*image)];
            for (c, cell) in cells.iter().enumerate() {
                whole.origins.push((c as u32, *image));
                whole
                    .cells
                    .push(turned(*cell, *image).map(|n| number[n as usize]));
            }
        }
        whole
    }

    /// Points (m) of the whole from those of the part.
    pub fn points(&self, part: &[Vec3]) -> Vec<Vec3> {
        let at = |(n, image): &(u32, Image)| reflect(part[*n as usize], *image);
        self.nodes.iter().map(at).collect()
    }

    /// Values at the whole's nodes: `value` of a node of the part, as the image shows it.
    pub fn at_nodes(&self, value: impl Fn(usize, Image) -> f64) -> Vec<f64> {
        self.nodes
            .iter()
            .map(|(n, i)| value(*n as usize, *i))
            .collect()
    }

    /// The same of cells.
    pub fn at_cells(&self, value: impl Fn(usize, Image) -> f64) -> Vec<f64> {
        self.origins
            .iter()
            .map(|(c, i)| value(*c as usize, *i))
            .collect()
    }
}

/// A mirrored cell's nodes, counter-clockwise again; the first corner of a grid's cells stays the one with the least
/// x and y.
fn turned([a, b, c, d]: [u32; 4], image: Image) -> [u32; 4] {
    match image {
        [false, false] => [a, b, c, d],
        [true, false] => [b, a, d, c],
        [false, true] => [d, c, b, a],
        [true, true] => [c, d, a, b],
    }
}

/// Node patches of a part: those of the whole around the part's nodes, with as much of their areas as belongs to it, at
/// most `most` nodes each (0: any number); and the ghosts in them, the k-th of which has the number `points + k`.
pub fn part_patches(mesh: &QuadMesh, planes: Planes, most: usize) -> (Vec<Patch>, Vec<Ghost>) {
    let n = mesh.points.len();
    let whole = Whole::new(&mesh.points, &mesh.cells, planes);
    let full = QuadMesh {
        points: whole.points(&mesh.points),
        cells: whole.cells,
    };
    let mut patches = full.patches();
    limit_patches(&mut patches, &full.points, most);
    patches.retain(|p| (p.nodes[0] as usize) < n);
    let beyond = |k: &u32| *k as usize >= n;
    let mut missing: Vec<u32> = (patches.iter().flat_map(|p| &p.nodes))
        .copied()
        .filter(beyond)
        .collect();
    missing.sort_unstable();
    missing.dedup();
    for patch in &mut patches {
        patch.area *= planes.share(mesh.points[patch.nodes[0] as usize]);
        for k in patch.nodes.iter_mut().filter(|k| **k as usize >= n) {
            *k = (n + missing.partition_point(|m| m < k)) as u32;
        }
    }
    let ghost = |(k, m): (usize, &u32)| {
        let (of, image) = whole.nodes[*m as usize];
        Ghost {
            node: (n + k) as u32,
            of,
            image,
        }
    };
    let ghosts = missing.iter().enumerate().map(ghost).collect();
    (patches, ghosts)
}

/// `[n]` whether a node lies on the boundary of the whole.
pub fn on_outer_boundary(mesh: &QuadMesh, planes: Planes) -> Vec<bool> {
    let mut flags = vec![false; mesh.points.len()];
    for (cell, near) in mesh.cells.iter().zip(mesh.neighbours()) {
        for e in 0..4 {
            let (a, b) = (cell[e] as usize, cell[(e + 1) % 4] as usize);
            if near[e] == NONE && common(planes, mesh.points[a], mesh.points[b]).is_none() {
                flags[a] = true;
                flags[b] = true;
            }
        }
    }
    flags
}

/// A plane on which both points lie.
pub(crate) fn common(planes: Planes, a: Vec3, b: Vec3) -> Option<usize> {
    let (a, b) = (planes.holding(a), planes.holding(b));
    (0..2).find(|k| a[*k] && b[*k])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{area_vector, even_axis};
    use crate::vec3::{norm, sub};

    const BOTH: Planes = Planes([true; 2]);

    fn quarter() -> QuadMesh {
        QuadMesh::grid(&even_axis(0.0, 0.04, 0.01), &even_axis(0.0, 0.03, 0.01))
    }

    #[test]
    fn a_quarter_and_its_images_are_the_whole_grid_without_double_nodes() {
        let part = quarter();
        let whole = Whole::new(&part.points, &part.cells, BOTH);
        let points = whole.points(&part.points);
        let grid = QuadMesh::grid(&even_axis(-0.04, 0.04, 0.01), &even_axis(-0.03, 0.03, 0.01));
        assert_eq!(
            (points.len(), whole.cells.len()),
            (grid.points.len(), grid.cells.len())
        );
        assert_eq!(&points[..part.points.len()], &part.points[..]);
        let number = |p: Vec3| {
            let near = |q: &Vec3| norm(sub(*q, p)) < 1e-12;
            grid.points
                .iter()
                .position(near)
                .expect("a node of the grid") as u32
        };
        let mut cells: Vec<[u32; 4]> = (whole.cells.iter())
            .map(|c| c.map(|n| number(points[n as usize])))
            .collect();
        // First corners and winding too are those of the grid.
        cells.sort_unstable();
        assert_eq!(cells, grid.cells);
        for cell in &whole.cells {
            assert!(area_vector(cell.map(|n| points[n as usize]))[2] > 0.0);
        }
    }

    #[test]
    fn the_patches_of_a_quarter_have_a_quarter_of_the_area_and_full_rings() {
        let part = quarter();
        let (patches, ghosts) = part_patches(&part, BOTH, 0);
        let total: f64 = patches.iter().map(|p| p.area).sum();
        assert!((total - 0.04 * 0.03).abs() < 1e-13, "{total}");
        assert!(patches.iter().all(|p| p.nodes.len() == 9));
        // The node at the origin misses five of eight, its neighbours along the planes three.
        let n = part.points.len() as u32;
        let missing = |p: &Patch| p.nodes.iter().filter(|k| **k >= n).count();
        let of = |node: u32| patches.iter().find(|p| p.nodes[0] == node).map(missing);
        assert_eq!(
            [of(0), of(1), of(5), of(6)],
            [Some(5), Some(3), Some(3), Some(0)]
        );
        // Rows beside the planes: four nodes over x, five over y, one over both.
        assert_eq!(ghosts.len(), 4 + 5 + 1);
        let both = ghosts.iter().filter(|g| g.image == [true; 2]);
        assert_eq!(both.map(|g| g.of).collect::<Vec<_>>(), [6]);
    }

    #[test]
    fn nodes_on_a_plane_are_no_boundary_but_where_the_edge_meets_it() {
        let part = quarter();
        let outer = on_outer_boundary(&part, BOTH);
        for (p, outer) in part.points.iter().zip(outer) {
            let edge = (p[0] - 0.04).abs() < 1e-12 || (p[1] - 0.03).abs() < 1e-12;
            assert_eq!(outer, edge, "{p:?}");
        }
    }
}
