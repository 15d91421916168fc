//! The meshes of an artifact, and which fields are written on them.

use crate::error::Result;
use crate::forming::Forming;
use crate::request::Parameters;
use crate::stack::{Body, RigidName, StackSheet};
use plyflow_abi::PF_KIND_ELEMENT;
use plyflow_mechanics::component::{ElementField, element_fields};
use plyflow_model::artifact::{RigidBody, SheetBody};
use plyflow_model::scene::SheetKind;
use plyflow_sdk::Host;

/// Tells the meshes of the tool and of a press's parts.
pub fn define_rigid(host: &Host, forming: &Forming) -> Result<()> {
    let about = RigidBody::ATTRIBUTES;
    let tool = &forming.tool;
    let triangles: Vec<u32> = tool.triangles.iter().flatten().copied().collect();
    host.define_mesh(RigidName::Tool.word(), &tool.points, 3, &triangles, &about)?;
    for part in &forming.rigid {
        let (corners, cells) = part.cells();
        host.define_mesh(part.name.word(), part.points(), corners, cells, &about)?;
    }
    Ok(())
}

/// Tells the mesh of a sheet.
pub fn define(host: &Host, forming: &Forming, body: &Body, sheet: &StackSheet) -> Result<()> {
    let cells: Vec<u32> = body.cells.iter().flatten().copied().collect();
    let attributes = SheetBody {
        kind: sheet.scene.kind,
        thickness: sheet.thickness,
        offset: sheet.offset,
    };
    let points = forming.reference_points(body);
    Ok(host.define_mesh(&body.name, &points, 4, &cells, &attributes)?)
}

/// The one field of a film, which plies do not have.
const OF_FILMS: &str = "principal_stretch";

/// Fields of the elements of sheets of a kind.
pub fn fields_of(host: &Host, kind: SheetKind, p: &Parameters) -> Result<Vec<ElementField>> {
    let of_element = |name: &str| -> Result<Vec<ElementField>> {
        let found = host.component(PF_KIND_ELEMENT, name)?;
        // SAFETY: a text of the host's, valid until `run` returns.
        let manifest = unsafe { found.manifest.as_str() };
        Ok(element_fields(manifest.unwrap_or("{}")))
    };
    let (choice, elsewhere) = match kind {
        SheetKind::Diaphragm => (&p.diaphragm_element, None),
        SheetKind::Ply => (&p.element, p.element_elsewhere.as_ref()),
    };
    let mut list = of_element(&choice.plugin)?;
    if let Some(other) = elsewhere {
        let others = of_element(&other.plugin)?;
        list.iter_mut().for_each(|f| f.find_elsewhere(&others));
    }
    list.retain(|f| (f.name == OF_FILMS) == (kind == SheetKind::Diaphragm));
    Ok(list)
}
