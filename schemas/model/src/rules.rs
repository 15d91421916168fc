//! What a scene must be to be formed: every rule that its words can tell, said once. The workflow shows a fault in the YAML, a plugin prints it.
//!
//! What needs triangles, a mesh, or the answers of a material is looked at by the plugins.

pub mod friction;
pub mod known;
pub mod process;
pub mod regions;
pub mod sheets;
pub mod stamping;
pub mod steering;
pub mod surfaces;
pub mod symmetry;

use crate::fault::{Fault, Path, Rule, Shown};
use crate::scene::Scene;
use crate::tool;
use known::Known;

/// All that is wrong with a scene, as far as it is known.
pub fn faults(known: &Known<'_>) -> Vec<Fault> {
    let mut found = Vec::new();
    let stack = process::stack(known);
    let in_order = stack.is_none();
    found.extend(stack);
    found.extend(sheets::check(known));
    found.extend(regions::check(known));
    found.extend(friction::check(known, in_order));
    found.extend(process::check(known));
    let tool = known.tool.and_then(|tool| tool::rules::check(tool).err());
    found.extend(tool);
    found.extend(symmetry::repeated(known));
    // A part that is none has no image either.
    if found.is_empty() {
        found.extend(symmetry::check(known));
    }
    found
}

/// Whether a scene can be formed, as far as its words tell.
///
/// # Errors
/// The first rule that it breaks.
pub fn check(scene: &Scene) -> Result<(), Fault> {
    if scene.sheets.is_empty() {
        return Err(no_sheet());
    }
    let first = faults(&Known::from(scene)).into_iter().next();
    first.map_or(Ok(()), Err)
}

/// Of a scene whose list of sheets is empty.
pub fn no_sheet() -> Fault {
    Fault::text(Rule::Stack, Path::to("sheets"), "the scene has no sheet")
        .shown(Shown::Key)
        .expected("at least one sheet")
        .help("list plies and diaphragms from the tool upwards")
}
