//! Which element a cell has: those of sheets, their node patches, and membranes beside the zones in which plies bend.

use crate::error::{FormingError, Result};
use crate::request::{ComponentChoice, Parameters};
use crate::stack::sheet::StackSheet;
use crate::stack::{regions, symmetry};
use plyflow_abi::pf_component;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::component::{ElementInstance, MaterialInstance};
use plyflow_mechanics::mesh::{Patch, QuadMesh};
use plyflow_mechanics::mirror::{Ghost, Mirrors, Planes, part_patches, reflect};
use plyflow_mechanics::sheet::{Elsewhere, OtherMaterial};
use plyflow_model::artifact::Rectangle;
use std::sync::Arc;

/// Finds components: the host, or a test.
///
/// # Safety
/// What it gives is of the kind that it says: whole tables that keep to plyflow.h, valid until the process ends, and manifests that can be read as
/// long as `self` is there.
pub unsafe trait Components {
    /// The element formulation of that name.
    ///
    /// # Errors
    /// When there is none.
    fn element(&self, name: &str) -> Result<pf_component>;
    /// The material of that name.
    ///
    /// # Errors
    /// When there is none.
    fn material(&self, name: &str) -> Result<pf_component>;
}

/// Makes the elements of sheets.
pub struct Elements<'a> {
    /// Which are asked for.
    pub p: &'a Parameters,
    /// Where they are found.
    pub components: &'a dyn Components,
}

impl Elements<'_> {
    /// Makes the element of a sheet with its material.
    fn element(&self, sheet: &StackSheet, choice: &ComponentChoice) -> Result<ElementInstance> {
        let along = choice.with.get("fibres_along_sides") == Some(&true.into());
        if along && sheet.laid.straight().is_none() {
            return Err(FormingError::Element(format!(
                "element: given '{}' with fibres_along_sides, and the fibres of ply '{}' are steered; expected an element for fibres of any direction, such \
                 as m4: sides of elements do not follow steered fibres",
                choice.plugin, sheet.scene.name
            )));
        }
        self.of_material(sheet, choice, self.material(sheet)?)
    }

    /// The element of a film.
    pub fn of_film(&self, film: &StackSheet) -> Result<ElementInstance> {
        self.element(film, &self.p.diaphragm_element)
    }

    /// The element of a ply.
    ///
    /// # Errors
    /// The component's own text; when the element has patches for bending and the material nothing that bends: it would be a membrane
    /// without a word.
    pub fn of_ply(&self, sheet: &StackSheet) -> Result<ElementInstance> {
        let element = self.element(sheet, &self.p.element)?;
        let bends = element.material.reference().sizes().has_bending;
        if element.sizes.patch_nodes > 0 && !bends {
            return Err(FormingError::Element(format!(
                "element: given '{}', which bends, for ply '{}', whose material '{}' has no bending; expected a material with `bending` \
                 (`plyflow plugins {}`), or a membrane such as m4",
                self.p.element.plugin, sheet.scene.name, sheet.material.name, sheet.material.plugin
            )));
        }
        symmetry::check_order(&element, sheet)?;
        Ok(element)
    }

    /// Makes the material of a sheet.
    fn material(&self, sheet: &StackSheet) -> Result<Arc<MaterialInstance>> {
        let mut with = serde_json::Value::Object(sheet.material.with.clone());
        with["thickness"] = sheet.thickness.into();
        with["areal_mass"] = sheet.material.areal_mass.si().into();
        let what = format!(
            "material '{}' of sheet '{}'",
            sheet.material.name, sheet.scene.name
        );
        let found = self.components.material(&sheet.material.plugin)?;
        // SAFETY: what `Components` promises.
        Ok(unsafe { MaterialInstance::create(&found, &with.to_string(), &what) }?)
    }

    /// Makes the element of a sheet for its material.
    fn of_material(
        &self,
        sheet: &StackSheet,
        choice: &ComponentChoice,
        material: Arc<MaterialInstance>,
    ) -> Result<ElementInstance> {
        let what = format!(
            "element '{}' of sheet '{}'",
            choice.plugin, sheet.scene.name
        );
        let found = self.components.element(&choice.plugin)?;
        let parameters = if choice.with.is_null() {
            "{}".into()
        } else {
            choice.with.to_string()
        };
        // SAFETY: what `Components` promises.
        Ok(unsafe { ElementInstance::create(&found, &parameters, material, &what) }?)
    }

    /// The membranes of a ply whose `element` is for the zones alone: where the centres of its cells lie in none. `None` for a
    /// run whose plies have one element.
    ///
    /// # Errors
    /// An element in the zones that does not bend, or one elsewhere that does.
    pub fn elsewhere(
        &self,
        sheet: &StackSheet,
        element: &ElementInstance,
        mesh: &QuadMesh,
        planes: Planes,
    ) -> Result<Option<Elsewhere>> {
        let Some(choice) = &self.p.element_elsewhere else {
            return Ok(None);
        };
        let bends = |e: &ElementInstance| e.sizes.patch_nodes > 0 || e.rotates();
        if !bends(element) {
            return Err(FormingError::Element(format!(
                "element: given '{}', a membrane, for the plies in the zones; expected an element that bends, such as rf4, beside \
                 `element_elsewhere`",
                self.p.element.plugin
            )));
        }
        let other = self.of_material(sheet, choice, element.material.clone())?;
        if bends(&other) {
            return Err(FormingError::Element(format!(
                "element_elsewhere: given '{}', which bends; expected a membrane, such as m4. For plies that bend everywhere \
                 leave out `element_elsewhere` and `zones`",
                choice.plugin
            )));
        }
        let cells = mesh.cells.iter();
        let centre = |c| regions::centre(&mesh.points, c);
        let is_elsewhere = cells.map(|c| !is_in(&self.p.bending_zones, centre(c), planes));
        Ok(Some(Elsewhere {
            element: other,
            cells: is_elsewhere.collect(),
        }))
    }

    /// The material without stitches of a ply in `element`, with the cells of its flat mesh that have it. `None` of a ply without such cells.
    pub fn unstitched(
        &self,
        sheet: &StackSheet,
        mesh: &QuadMesh,
        element: &ElementInstance,
    ) -> Result<Option<OtherMaterial>> {
        let cells = regions::without_stitches(&sheet.scene, &mesh.points, &mesh.cells)?;
        if !cells.iter().any(|c| *c) {
            return Ok(None);
        }
        let mut bare = sheet.clone();
        bare.material.with.remove("stitch");
        let make = |choice: &ComponentChoice| self.element(&bare, choice);
        let other = make(&self.p.element)?;
        debug_assert_eq!(other.sizes.fields, element.sizes.fields);
        Ok(Some(OtherMaterial {
            element: other,
            elsewhere: self.p.element_elsewhere.as_ref().map(make).transpose()?,
            cells,
        }))
    }
}

/// A box holds what is nearer to it than this (m): whether a centre that lies on its side counts must not hang on rounding.
const SAME_PLACE: f64 = 1e-6;

/// Whether a place of the undeformed plane or, with mirror planes, one of its images lies in a zone: so what is computed
/// beside a plane is what its other side would be.
fn is_in(zones: &[Rectangle], at: Vec3, planes: Planes) -> bool {
    planes.images().iter().any(|image| {
        let [x, y, _] = reflect(at, *image);
        let within = |v: f64, low: f64, high: f64| v >= low - SAME_PLACE && v <= high + SAME_PLACE;
        let holds = |b: &Rectangle| within(x, b[0], b[2]) && within(y, b[1], b[3]);
        zones.iter().any(holds)
    })
}

/// The part of a mesh, with all of its points, whose cells have the sheet's own element. Patches that are made of it end at
/// its outline as at a free edge, as they do at the cut of a zone that is run by itself.
pub fn bending_part(mesh: &QuadMesh, elsewhere: Option<&Elsewhere>) -> QuadMesh {
    let Some(elsewhere) = elsewhere else {
        return mesh.clone();
    };
    let cells = mesh.cells.iter().zip(&elsewhere.cells);
    QuadMesh {
        points: mesh.points.clone(),
        cells: cells.filter(|c| !c.1).map(|c| *c.0).collect(),
    }
}

/// Node patches of a sheet's mesh whose nodes have the numbers `nodes`, for its element. Ghosts beyond mirror planes are
/// added to the points, to `nodes` and to `mirrors`.
pub fn patches(
    points: &mut Vec<Vec3>,
    nodes: &mut Vec<u32>,
    mesh: &QuadMesh,
    element: &ElementInstance,
    mirrors: &mut Mirrors,
) -> Vec<Patch> {
    let most = element.sizes.patch_nodes;
    if most == 0 || !element.material.reference().sizes().has_bending {
        return Vec::new();
    }
    let (patches, ghosts) = part_patches(mesh, mirrors.planes, most);
    for ghost in ghosts {
        let (of, node) = (nodes[ghost.of as usize], points.len() as u32);
        points.push(reflect(points[of as usize], ghost.image));
        nodes.push(node);
        mirrors.ghosts.push(Ghost { node, of, ..ghost });
    }
    patches
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_counts_as_in_a_zone_with_its_mirror_images() {
        let zones = [[0.01, 0.02, 0.03, 0.04], [-0.09, 0.0, -0.08, 0.01]];
        let is = |x: f64, y: f64, planes: [bool; 2]| is_in(&zones, [x, y, 0.0], Planes(planes));
        assert!(is(0.02, 0.03, [false; 2]) && is(0.01 - 1e-15, 0.04 + 1e-15, [false; 2]));
        assert!(!is(0.02, 0.019, [false; 2]) && !is(0.085, 0.005, [false; 2]));
        assert!(is(0.085, 0.005, [true, false]) && !is(0.085, 0.005, [false, true]));
        assert!(!is_in(&[], [0.0; 3], Planes::default()));
    }
}
