//! A formed ply, with its distances from the tool and its curvatures.

use plyflow_geometry::vec3::{Vec3, cross, dot, scale, sub, unit};
use plyflow_surface::{
    Crests, Curvature, Ground, NodalDistance, Surface, Topology, curvatures, judged_share,
    nodal_distances,
};

/// A formed ply: of a simulation, or scanned.
#[derive(Debug, Clone)]
pub struct Ply {
    /// Name of the sheet.
    pub name: String,
    /// Its mesh, quads or triangles.
    pub topology: Topology,
    /// `[nodes]` in the flat ply (m); of a scan, which knows none, where they are.
    pub undeformed: Vec<Vec3>,
    /// `[nodes]` (m).
    pub formed: Vec<Vec3>,
    /// `[cells]` (rad); empty when it is not known.
    pub shear_angle: Vec<f64>,
    /// `[cells]` the smaller of the two strains along fibres; empty when they are not known.
    pub fibre_strain: Vec<f64>,
    /// By family, `[cells]`: the strain along its fibres; empty when they are not known.
    pub fibre_strains: [Vec<f64>; 2],
    /// `[nodes]`.
    pub distance: Vec<NodalDistance>,
    /// `[nodes]`.
    pub curvature: Vec<Curvature>,
    /// `[nodes]` crest curvature of the tool at the closest point (1/m, zero or negative).
    pub tool_crest: Vec<f64>,
}

/// A mesh of a ply, flat and formed.
#[derive(Debug, Clone)]
pub struct Shape {
    /// Quads or triangles.
    pub topology: Topology,
    /// `[nodes]` in the flat ply (m); of a scan, which knows none, where they are.
    pub undeformed: Vec<Vec3>,
    /// `[nodes]` (m).
    pub formed: Vec<Vec3>,
}

/// A tool and its own crests.
#[derive(Debug, Clone)]
pub struct Tool {
    /// Its surface.
    pub surface: Surface,
    crests: Crests,
}

impl Tool {
    /// Takes the curvatures of a tool's surface.
    pub fn new(surface: Surface) -> Self {
        let crests = Crests::new(&surface);
        Self { surface, crests }
    }
}

impl Ply {
    /// Takes distances and curvatures of a ply whose mid-plane lies `offset` (m) from the tool when all sheets
    /// lie on it. Nothing is known of its strains ([`Ply::shear_angle`], [`Ply::fibre_strain`]). Cells may be wound either way, all alike: what is a crest
    /// is told by the side on which the tool lies.
    pub fn new(name: String, shape: Shape, tool: &Tool, offset: f64, ground: Ground) -> Self {
        let Shape {
            topology,
            undeformed,
            formed,
        } = shape;
        let distance = nodal_distances(&tool.surface, &topology, &formed, offset, ground);
        let mut curvature = curvatures(&topology, &formed);
        if faces(&topology, &formed, &tool.surface, &distance) {
            curvature.iter_mut().for_each(turn_over);
        }
        let tool_crest = (distance.iter().zip(&formed))
            .map(|(d, p)| tool.crests.at(*p, d.triangle))
            .collect();
        Self {
            name,
            topology,
            undeformed,
            formed,
            shear_angle: Vec::new(),
            fibre_strain: Vec::new(),
            fibre_strains: [Vec::new(), Vec::new()],
            distance,
            curvature,
            tool_crest,
        }
    }

    /// The mean of a cell field (`[cells]`) at a node; `None` when the field is empty.
    pub fn at_node(&self, field: &[f64], node: u32) -> Option<f64> {
        let cells = self.topology.cells_of(node as usize);
        let sum: f64 = cells
            .iter()
            .map(|&c| field.get(c as usize))
            .sum::<Option<f64>>()?;
        (!cells.is_empty()).then(|| sum / cells.len() as f64)
    }

    /// `[nodes]`: 1 where the distance from the tool is judged, 0 elsewhere.
    pub fn judged(&self) -> Vec<f64> {
        let judged = self.distance.iter().map(|d| d.judged);
        judged.map(|j| f64::from(u8::from(j))).collect()
    }

    /// Share of its area in the flat ply whose distance from the tool is judged.
    pub fn judged_share(&self) -> f64 {
        judged_share(&self.distance, &self.topology.node_areas(&self.undeformed))
    }

    /// Takes account of plies below that do not lie under all of its nodes: by node, what (m) of its offset is not there.
    pub fn lower(&mut self, missing: &[f64]) {
        for (distance, missing) in self.distance.iter_mut().zip(missing) {
            distance.value += missing;
        }
    }
}

/// Whether a ply's normals point, on the whole and by area, to the tool: its cells are wound the other way round. It is asked of the nodes that are
/// judged alone, past a free edge the tool has no side.
fn faces(topology: &Topology, formed: &[Vec3], tool: &Surface, distance: &[NodalDistance]) -> bool {
    let (normals, areas) = (topology.normals(formed), topology.node_areas(formed));
    let outwards = |i: usize| {
        let [a, b, c] = tool.triangles()[distance[i].triangle].map(|k| tool.points()[k as usize]);
        areas[i] * dot(normals[i], unit(cross(sub(b, a), sub(c, a))))
    };
    let judged = (0..formed.len()).filter(|&i| distance[i].judged);
    judged.map(outwards).sum::<f64>() < 0.0
}

/// The curvature as seen from the other side.
fn turn_over(seen: &mut Curvature) {
    (seen.max, seen.min) = (-seen.max, -seen.min);
    seen.normal = scale(seen.normal, -1.0);
}
