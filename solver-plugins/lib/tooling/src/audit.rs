//! A tool's distance field held against its triangles.

use crate::mesh::ToolMesh;
use crate::tree::{ClosestPoint, SurfaceTree};
use plyflow_geometry::vec3::{Vec3, add, dot, norm, scale, sub, unit};
use rayon::prelude::*;

/// Largest difference of a tool's distance field from the distance to its triangles, and where it is.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FieldError {
    /// m, never negative.
    pub largest: f64,
    /// The place (m).
    pub at: [f64; 3],
}

impl FieldError {
    /// The larger of both; of equals the first.
    pub fn or(self, other: Self) -> Self {
        if other.largest > self.largest {
            other
        } else {
            self
        }
    }
}

/// A place near a tool's surface.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    /// m.
    pub at: Vec3,
    /// Distance to the closest point of the triangles (m), positive outside.
    pub distance: f64,
}

/// A piece of a facet (three corners), or of an edge (the third is the second), with the direction out of it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Piece {
    corners: [Vec3; 3],
    out: Vec3,
    body: u32,
}

impl Piece {
    /// A whole facet of a body.
    pub fn of(body: &ToolMesh, facet: usize) -> Self {
        Self {
            corners: body.corners(facet),
            out: unit(body.area_normal(facet)),
            body: 0,
        }
    }

    /// Where it is looked at: of an edge there is no area to have a centre.
    fn middle(&self) -> Vec3 {
        let [a, b, c] = self.corners;
        if b == c {
            scale(add(a, b), 0.5)
        } else {
            scale(add(add(a, b), c), 1.0 / 3.0)
        }
    }

    /// Of a piece of a facet its middle and the direction out of it.
    pub fn face(&self) -> Option<(Vec3, Vec3)> {
        let [_, b, c] = self.corners;
        (b != c).then(|| (self.middle(), self.out))
    }

    /// Its middle, and what lies `offset` (m) out of it.
    pub fn middles(&self, offset: f64) -> [Vec3; 2] {
        [self.middle(), add(self.middle(), scale(self.out, offset))]
    }

    /// Its parts, none longer than `spacing`, each longest side halved in turn: long thin facets need few.
    pub fn parts(&self, spacing: f64, visit: &mut impl FnMut(Piece)) {
        let [a, b, c] = self.corners;
        let sides = [[a, b, c], [b, c, a], [c, a, b]];
        let length = |s: &[Vec3; 3]| norm(sub(s[1], s[0]));
        let longest =
            sides[1..].iter().fold(
                sides[0],
                |best, s| {
                    if length(s) > length(&best) { *s } else { best }
                },
            );
        if length(&longest) <= spacing {
            return visit(*self);
        }
        let middle = scale(add(longest[0], longest[1]), 0.5);
        let [from, to, apex] = longest;
        let is_edge = b == c;
        for corners in [[from, middle, apex], [middle, to, apex]] {
            let corners = if is_edge {
                let [p, q] = [corners[0], corners[1]];
                [p, q, q]
            } else {
                corners
            };
            Piece { corners, ..*self }.parts(spacing, visit);
        }
    }
}

/// Cosine of the angle between neighbouring facets beyond which their edge is looked at by itself: less is a chord of something round.
const CREASE: f64 = 0.985;

/// Where the last search in the tree of each body of a survey ended. The next one looks there first, and what it finds does not depend on it:
/// only how long it takes.
#[derive(Debug, Clone)]
pub(crate) struct Near(Vec<usize>);

/// A tool as its distance field has to see it: its bodies without their bottoms.
pub(crate) struct Survey {
    mesh: ToolMesh,
    shells: Vec<ToolMesh>,
    /// One for each of them.
    trees: Vec<SurfaceTree>,
    /// Height of the bottom (m), below which nothing is looked at.
    low: f64,
}

impl Survey {
    /// Of a tool whose walls go on below its bottom by `depth` (m).
    pub fn new(mesh: &ToolMesh, depth: f64) -> Self {
        let low = mesh.bounds()[0][2];
        let mesh = mesh.without_bottom(depth);
        let shells = mesh.shells();
        Self {
            trees: shells.iter().map(SurfaceTree::new).collect(),
            shells,
            mesh,
            low,
        }
    }

    /// One for each body.
    pub fn trees(&self) -> &[SurfaceTree] {
        &self.trees
    }

    /// Where searches begin that have nothing near behind them.
    pub fn anywhere(&self) -> Near {
        Near(vec![0; self.trees.len()])
    }

    /// Distance to the closest point of the triangles (m): of bodies that stand on or in each other the least of their own distances is that
    /// of what they are together, outside of it and in sign.
    pub fn distance(&self, at: Vec3, near: &mut Near) -> f64 {
        let mut least = f64::INFINITY;
        for (tree, place) in self.trees.iter().zip(&mut near.0) {
            let (found, there) = tree.closest_from(at, *place);
            *place = there;
            least = least.min(found.signed_distance);
        }
        least
    }

    /// The closest point of the body that a piece is of, and the direction out of the facet there. `hints`: one for each body, where the last
    /// search ended; pieces come neighbour after neighbour.
    pub fn nearest_of(&self, at: Vec3, piece: &Piece, hints: &mut [usize]) -> (ClosestPoint, Vec3) {
        let body = piece.body as usize;
        let (found, place) = self.trees[body].closest_from(at, hints[body]);
        hints[body] = place;
        let normal = self.shells[body].area_normal(found.triangle as usize);
        (found, unit(normal))
    }

    /// All facets, and all edges that are sharper than chords of something round.
    pub fn pieces(&self) -> Vec<Piece> {
        let bodies = self.mesh.bodies();
        let neighbour = self.mesh.adjacency().neighbour;
        let normal = |t: usize| unit(self.mesh.area_normal(t));
        let mut pieces = Vec::new();
        for t in 0..self.mesh.triangles.len() {
            let (out, corners, body) = (normal(t), self.mesh.corners(t), bodies[t]);
            if out == [0.0; 3] {
                continue;
            }
            pieces.push(Piece { corners, out, body });
            for k in 0..3 {
                let Some(n) = neighbour[t][k].map(|n| n as usize).filter(|n| *n > t) else {
                    continue;
                };
                let other = normal(n);
                if dot(other, out) < CREASE && other != [0.0; 3] {
                    let [a, b] = [corners[k], corners[(k + 1) % 3]];
                    pieces.push(Piece {
                        corners: [a, b, b],
                        out: unit(add(out, other)),
                        body,
                    });
                }
            }
        }
        pieces
    }

    /// Places of a piece: its middle, its corners if it is of an edge, and what lies `offset` (m) out of these, where sheets have
    /// their middles; none that another body covers.
    pub fn places(
        &self,
        piece: &Piece,
        offset: f64,
        near: &mut Near,
        mut visit: impl FnMut(Place),
    ) {
        let [a, b, c] = piece.corners;
        let ends = if b == c { &[a, b][..] } else { &[] };
        for on in ends.iter().copied().chain([piece.middle()]) {
            let others = (self.trees.iter().zip(&mut near.0)).enumerate();
            let mut others = others.filter(|(k, _)| *k != piece.body as usize);
            let covered = others.any(|(_, (tree, place))| {
                let (found, there) = tree.closest_from(on, *place);
                *place = there;
                found.signed_distance < 1e-6
            });
            if covered || on[2] < self.low {
                continue;
            }
            visit(Place {
                at: on,
                distance: 0.0,
            });
            if offset > 0.0 {
                let at = add(on, scale(piece.out, offset));
                let distance = self.distance(at, near);
                // Between walls closer than that no sheet has room.
                if at[2] >= self.low && distance > 0.5 * offset {
                    visit(Place { at, distance });
                }
            }
        }
    }

    /// The largest error of a field over all pieces' parts of `spacing` (m), where `counts` is true.
    pub fn error(
        &self,
        [spacing, offset]: [f64; 2],
        field: impl Fn(Vec3) -> f64 + Sync,
        counts: impl Fn(Vec3) -> bool + Sync,
    ) -> FieldError {
        let of = |piece: &Piece| {
            let (mut worst, mut near) = (FieldError::default(), self.anywhere());
            piece.parts(spacing, &mut |part| {
                self.places(&part, offset, &mut near, |place| {
                    if counts(place.at) {
                        let largest = (field(place.at) - place.distance).abs();
                        worst = worst.or(FieldError {
                            largest,
                            at: place.at,
                        });
                    }
                });
            });
            worst
        };
        let all: Vec<FieldError> = self.pieces().par_iter().map(of).collect();
        all.into_iter().fold(FieldError::default(), FieldError::or)
    }
}
