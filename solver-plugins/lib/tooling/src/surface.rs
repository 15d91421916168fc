//! From facets that somebody else made to a tool: joined to a surface, and looked at whether it is one with an outside.

use crate::facets;
use crate::mesh::{Adjacency, ToolMesh};
use plyflow_geometry::vec3::{Vec3, dot, sub};
use plyflow_model::tool::place::Place;
use plyflow_model::tool::placed::Placed;

/// How far above its lowest point, over its height, a tool may be open.
const FOOT: f64 = 1e-3;

/// Why facets are no tool: what is wrong, with the place of the first offence, and what to change.
pub(crate) type NoSurface = (String, &'static str);

/// How a place of a tool is told to who made its facets.
pub(crate) struct Origin<'a> {
    /// Where they have been put.
    pub placed: Placed,
    /// What the units are, as in `in the file's units`.
    pub units: &'a str,
    /// Which facet it is, by its number from 0.
    pub place: &'a dyn Fn(usize) -> String,
}

/// Puts facets, in units of `unit` (m), where the tool is (m), and tells how.
///
/// # Errors
/// When a coordinate is too large for that.
pub(crate) fn put(
    corners: &mut [[Vec3; 3]],
    unit: f64,
    place: &Place,
) -> Result<Placed, NoSurface> {
    let too_large = || {
        (
            "it has a coordinate that is too large".to_owned(),
            "export it again",
        )
    };
    let placed = match corners.is_empty() {
        true => Placed::moved(unit, place.translate),
        false => Placed::of(place, unit, corners.as_flattened().iter()).ok_or_else(too_large)?,
    };
    for facet in corners {
        for p in facet.iter_mut() {
            *p = placed.put(*p);
        }
        if facet.as_flattened().iter().any(|c| !c.is_finite()) {
            return Err(too_large());
        }
    }
    Ok(placed)
}

/// Joins facets ([`facets::join`]; m) and checks that they are a surface with a consistent outside, open at its foot at most.
///
/// # Errors
/// When they are not.
pub(crate) fn surface(corners: &[[Vec3; 3]], origin: &Origin<'_>) -> Result<ToolMesh, NoSurface> {
    let surface = facets::join(corners);
    let mesh = ToolMesh {
        points: surface.points,
        triangles: surface.triangles,
    };
    if mesh.triangles.is_empty() {
        return Err((
            format!("none of its {} facets has an area", corners.len()),
            "export the tool's surface as facets",
        ));
    }
    let checked = Checked {
        mesh: &mesh,
        facet: &surface.facet,
        origin,
    };
    checked.check()?;
    Ok(mesh)
}

/// A surface beside the facets that it is of.
struct Checked<'a> {
    mesh: &'a ToolMesh,
    /// For each triangle of the mesh the facet that it is of.
    facet: &'a [u32],
    origin: &'a Origin<'a>,
}

impl Checked<'_> {
    /// A point in the units of who made the facets.
    fn point(&self, p: Vec3) -> String {
        let q = self.origin.placed.back(p);
        format!("({:.4}, {:.4}, {:.4})", q[0], q[1], q[2])
    }

    /// An edge, and the first facet that has it.
    fn edge(&self, [a, b]: [u32; 2]) -> String {
        let has = |t: &[u32; 3]| t.contains(&a) && t.contains(&b);
        let of = self.mesh.triangles.iter().position(has);
        let place = of.map_or(String::new(), |t| {
            format!(", {}", (self.origin.place)(self.facet[t] as usize))
        });
        let [p, q] = [a, b].map(|p| self.point(self.mesh.points[p as usize]));
        let units = self.origin.units;
        format!("the edge from {p} to {q} ({units}{place})")
    }

    fn check(&self) -> Result<(), NoSurface> {
        let (mesh, adjacency) = (self.mesh, self.mesh.adjacency());
        if let Some(edge) = adjacency.crowded {
            return Err((
                format!("{} has more than two facets", self.edge(edge)),
                "export one surface without double or inner walls",
            ));
        }
        if let Some(edge) = adjacency.flipped {
            return Err((
                format!(
                    "the two facets at {} are oriented against each other",
                    self.edge(edge)
                ),
                "make the normals consistent (in MeshLab: Re-Orient all faces coherently)",
            ));
        }
        self.outside(&adjacency)?;
        // A rim higher up has no outside beside it.
        let [low, high] = mesh.bounds();
        let near = low[2] + FOOT * (high[2] - low[2]);
        let is_high = |edge: &&[u32; 2]| edge.iter().any(|p| mesh.points[*p as usize][2] > near);
        if let Some(edge) = adjacency.open.iter().find(is_high) {
            return Err((
                format!(
                    "it has a hole or a free rim above its foot: {} has one facet only ({} such edges in all)",
                    self.edge(*edge),
                    adjacency.open.iter().filter(is_high).count()
                ),
                "close it (in MeshLab: Close Holes), or draw its walls down to its foot",
            ));
        }
        Ok(())
    }

    /// Whether each body has its outside outside.
    fn outside(&self, adjacency: &Adjacency) -> Result<(), NoSurface> {
        let mesh = self.mesh;
        // About a point at the foot: where a tool is open there, what is missing has no part in it.
        let [low, high] = mesh.bounds();
        let foot = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2]];
        let bodies = bodies(adjacency);
        let count = bodies.iter().max().map_or(0, |b| b + 1);
        let (mut volumes, mut first) = (vec![0.0; count], vec![usize::MAX; count]);
        for (t, &body) in bodies.iter().enumerate() {
            volumes[body] += dot(sub(mesh.corners(t)[0], foot), mesh.area_normal(t)) / 6.0;
            first[body] = first[body].min(t);
        }
        let Some(body) = volumes.iter().position(|v| *v <= 0.0) else {
            return Ok(());
        };
        let which = match count {
            1 => "its facets point inwards".to_owned(),
            n => format!(
                "the facets of one of its {n} bodies, that at {} ({}, {}), point inwards",
                self.point(mesh.corners(first[body])[0]),
                self.origin.units,
                (self.origin.place)(self.facet[first[body]] as usize)
            ),
        };
        Err((
            format!("{which} (volume {:.3e} m3)", volumes[body]),
            "flip the facets so that they point away from the tool; a cavity inside of a tool is to be left out",
        ))
    }
}

/// For each facet the body of which it is: facets that share edges. The order is that of their first facets.
fn bodies(adjacency: &Adjacency) -> Vec<usize> {
    let mut of = vec![usize::MAX; adjacency.neighbour.len()];
    let mut count = 0;
    for first in 0..of.len() {
        if of[first] != usize::MAX {
            continue;
        }
        let mut open = vec![first];
        of[first] = count;
        while let Some(t) = open.pop() {
            for next in adjacency.neighbour[t].into_iter().flatten() {
                if of[next as usize] == usize::MAX {
                    of[next as usize] = count;
                    open.push(next as usize);
                }
            }
        }
        count += 1;
    }
    of
}
