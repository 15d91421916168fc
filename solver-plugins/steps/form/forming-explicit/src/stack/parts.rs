//! What a model is made of, as it grows sheet by sheet.

use crate::error::{FormingError, Result};
use crate::request::Parameters;
use crate::stack::body::Body;
use crate::stack::elements::{Elements, bending_part, patches};
use crate::stack::place::{Placed, SheetIndex};
use crate::stack::sheet::StackSheet;
use crate::stack::{regions, symmetry};
use plyflow_blank::Blank;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::component::ElementInstance;
use plyflow_mechanics::mesh::{Patch, QuadMesh};
use plyflow_mechanics::mirror::Mirrors;
use plyflow_mechanics::sheet::{Pressed, SheetSpec};

/// Points and sheets of a model, from the tool upwards.
#[derive(Default)]
pub struct Parts {
    /// `[nodes]` (m).
    pub points: Vec<Vec3>,
    /// The sheets.
    pub specs: Vec<SheetSpec>,
    /// Their bodies in the artifact.
    pub bodies: Vec<Body>,
    /// As their contacts see them.
    pub placed: Vec<Placed>,
    /// The planes beside which a part is computed, and what lies beyond them.
    pub mirrors: Mirrors,
}

/// How a sheet is meshed: model node of each mesh node, cells and patches in mesh-local numbers.
pub struct Meshed {
    /// `[n]`.
    pub nodes: Vec<u32>,
    /// `[m]`.
    pub cells: Vec<[u32; 4]>,
    /// Around nodes.
    pub patches: Vec<Patch>,
}

/// A sheet of one layer on which nothing presses, with one element and material.
pub fn plain(
    sheet: &StackSheet,
    meshed: Meshed,
    element: ElementInstance,
    p: &Parameters,
) -> SheetSpec {
    let count = meshed.cells.len();
    SheetSpec {
        name: sheet.scene.name.clone(),
        nodes: meshed.nodes,
        cells: meshed.cells,
        patches: meshed.patches,
        axis: sheet.axis_at([0.0; 2]),
        steered: None,
        layers: vec![1.0; count],
        pressed: vec![Pressed::No; count],
        least_areal_mass: vec![p.least_areal_mass; count],
        element,
        elsewhere: None,
        other_material: None,
    }
}

impl Parts {
    /// The number that the next sheet has.
    pub fn next(&self) -> SheetIndex {
        SheetIndex(self.specs.len())
    }

    /// Adds a sheet, of whose nodes `slaves` may be those.
    pub fn add(&mut self, spec: SheetSpec, body: Body, slaves: Vec<u32>) {
        let sheet = self.next();
        self.placed.push(Placed { sheet, slaves });
        self.bodies.push(body);
        self.specs.push(spec);
    }

    /// Adds a ply at height `z` (m). `blank` is its part between the mirror planes.
    ///
    /// # Errors
    /// When its blank cannot be meshed, its element cannot be made, or it is not its own mirror image.
    pub fn add_ply(
        &mut self,
        sheet: &StackSheet,
        blank: &Blank,
        z: f64,
        elements: &Elements<'_>,
    ) -> Result<()> {
        let (p, planes) = (elements.p, self.mirrors.planes);
        let name = &sheet.scene.name;
        let (mut mesh, quality) = (blank.mesh(p.element_size)).map_err(|source| {
            let ply = name.clone();
            FormingError::Mesh { ply, source }
        })?;
        // A mesh that follows an outline may leave rounding there; nodes of a plane are those that are exactly on it.
        for c in mesh.points.iter_mut().flat_map(|q| (0..2).zip(q)) {
            if planes.0[c.0] && c.1.abs() < 1e-9 {
                *c.1 = 0.0;
            }
        }
        let first = self.points.len() as u32;
        self.points
            .extend(mesh.points.iter().map(|q| [q[0], q[1], z]));
        let slaves: Vec<u32> = (first..self.points.len() as u32).collect();
        regions::check(&sheet.scene, &mesh.points, &mesh.cells, planes)?;
        let element = elements.of_ply(sheet)?;
        let other_material = elements.unstitched(sheet, &mesh, &element)?;
        symmetry::check_material(&element, sheet, planes)?;
        let elsewhere = elements.elsewhere(sheet, &element, &mesh, planes)?;
        let body = Body {
            quality,
            ..Body::mirrored(sheet, self.next(), &mesh.points, &mesh.cells, planes)?
        };
        let mut nodes = slaves.clone();
        let bending = bending_part(&mesh, elsewhere.as_ref());
        let patches = self.patches(&mut nodes, &bending, &element);
        if elsewhere.is_none() && element.sizes.patch_nodes > 0 && patches.is_empty() {
            return Err(too_few_elements(name, blank, p));
        }
        let steered = sheet.steered(&mesh.points, &mesh.cells);
        let cells = mesh.cells;
        let meshed = Meshed {
            nodes,
            cells,
            patches,
        };
        let spec = SheetSpec {
            steered,
            elsewhere,
            other_material,
            ..plain(sheet, meshed, element, p)
        };
        self.add(spec, body, slaves);
        Ok(())
    }

    /// Node patches of a mesh whose nodes have the numbers `nodes`, for its element; ghosts beyond mirror planes are added.
    pub fn patches(
        &mut self,
        nodes: &mut Vec<u32>,
        mesh: &QuadMesh,
        element: &ElementInstance,
    ) -> Vec<Patch> {
        patches(&mut self.points, nodes, mesh, element, &mut self.mirrors)
    }
}

/// A ply without a node inside, in an element that bends about such nodes.
fn too_few_elements(name: &str, blank: &Blank, p: &Parameters) -> FormingError {
    let [x0, y0, x1, y1] = blank.bounds();
    FormingError::Element(format!(
        "element: given '{}', which bends about the nodes inside of a ply, and ply '{name}' of {:.1} x {:.1} mm has none in elements of {:.1} mm: it would not \
         bend. Expected two elements across it at least: an `element_size` of {:.1} mm or less, or an element with rotations such as s4",
        p.element.plugin,
        1e3 * (x1 - x0),
        1e3 * (y1 - y0),
        1e3 * p.element_size,
        1e3 * 0.5 * (x1 - x0).min(y1 - y0)
    ))
}
