//! The model of one zone, driven at its cut by a coarse run.

use crate::boundary::{Beginning, CutDrive};
use crate::build::bag_contacts::add_contacts;
use crate::error::{FormingError, Result};
use crate::forming::Forming;
use crate::load::{Cycle, Load};
use crate::request::{LocalInput, LocalSheet, Parameters};
use crate::stack::{
    Body, Components, Elements, Meshed, Parts, RigidName, StackSheet, ToolSurfaces, plain, sheet,
    tool,
};
use plyflow_mechanics::mesh::QuadMesh;
use plyflow_mechanics::model::Model;
use plyflow_mechanics::sheet::{Pressed, SheetSpec};
use plyflow_model::scene::{DoubleDiaphragm, Process, Scene, SheetKind};

/// Builds the model of a zone.
///
/// # Errors
/// What of the boundary or the parameters makes no model.
pub fn build_local(
    p: &Parameters,
    input: LocalInput,
    components: &dyn Components,
) -> Result<Forming> {
    let process = process_of(&p.scene)?;
    let stack = stack_of(&p.scene, &input)?;
    if input.time.len() < 2 {
        let text = "the boundary has fewer than two frames";
        return Err(FormingError::Input(text.into()));
    }
    let last = input.time.len() - 1;
    let (parts, cut) = sheets_of(&input, &stack, &Elements { p, components })?;
    let start = Beginning::of_zone(&stack, &input.sheets, input.time[0])?;
    let tool = tool::rigid(p)?;
    let cycle = Cycle::new(process, [input.frame[0], input.frame[last]]).slowed(input.slower);
    let mut model = Model::new(parts.points, parts.specs, p.step_settings())?;
    let mut surfaces = ToolSurfaces::new(tool.field);
    add_contacts(&mut model, &stack, &parts.placed, p, &mut surfaces)?;
    model.set_driven(cut.nodes, Box::new(cut.drive));
    let reference = model.start().clone();
    Ok(Forming {
        model,
        load: Load::Given {
            time: input.time,
            cavity: input.cavity,
            bag: input.bag,
            frame: input.frame,
            cycle,
        },
        stack,
        bodies: parts.bodies,
        reference,
        tool: tool.mesh,
        rigid: Vec::new(),
        field_errors: vec![(RigidName::Tool, tool.error)],
        placement: tool.placement,
        tool_warnings: tool.warnings,
        zone: Some(input.zone),
        slower: input.slower,
        start,
        element_size: input.element_size,
    })
}

/// The process of a scene of which a zone can be run by itself.
fn process_of(scene: &Scene) -> Result<&DoubleDiaphragm> {
    match &scene.process {
        Process::DoubleDiaphragm(process) => Ok(process),
        Process::Press(_) | Process::Stamping(_) => Err(FormingError::Scene(format!(
            "scene '{}' is formed by a {}; local runs are built for double_diaphragm only. Run the whole scene with \
             bending elements instead: leave out the boundary",
            scene.name,
            scene.process.word()
        ))),
    }
}

/// Those sheets of the scene that the zone has, bottom to top, one on the other.
fn stack_of(scene: &Scene, input: &LocalInput) -> Result<Vec<StackSheet>> {
    let whole = sheet::stack(scene)?;
    let has = |name: &str| input.sheets.iter().any(|s| s.name == name);
    let mut stack: Vec<_> = whole.into_iter().filter(|s| has(&s.scene.name)).collect();
    // A ply that does not reach into the zone holds nothing off the tool there.
    sheet::lay(&mut stack);
    if stack.len() < 3 {
        let names: Vec<&str> = input.sheets.iter().map(|s| s.name.as_str()).collect();
        return Err(FormingError::Input(format!(
            "the zone needs both diaphragms and at least one ply of scene '{}'; its boundary has: {}",
            scene.name,
            names.join(", ")
        )));
    }
    Ok(stack)
}

/// What is driven of a zone.
struct Cut {
    /// Model nodes, in the order of `drive`.
    nodes: Vec<u32>,
    drive: CutDrive,
}

/// The sheets of a zone, from the tool upwards, and what drives them.
fn sheets_of(
    input: &LocalInput,
    stack: &[StackSheet],
    elements: &Elements<'_>,
) -> Result<(Parts, Cut)> {
    let mut parts = Parts::default();
    let mut cut = Cut {
        nodes: Vec::new(),
        drive: CutDrive::new(input.time.clone()),
    };
    for sheet in stack {
        let of_name = |s: &&LocalSheet| s.name == sheet.scene.name;
        let local = input.sheets.iter().find(of_name).expect("filtered");
        let first = parts.points.len() as u32;
        parts.points.extend_from_slice(&local.points);
        let pressed = match (sheet.scene.kind, parts.specs.is_empty()) {
            (SheetKind::Diaphragm, true) => Pressed::Below,
            (SheetKind::Diaphragm, false) => Pressed::Above,
            (SheetKind::Ply, _) => Pressed::No,
        };
        let element = match sheet.scene.kind {
            SheetKind::Diaphragm => elements.of_film(sheet)?,
            SheetKind::Ply => elements.of_ply(sheet)?,
        };
        let mesh = QuadMesh {
            points: local.points.clone(),
            cells: local.cells.clone(),
        };
        let other_material = elements.unstitched(sheet, &mesh, &element)?;
        let nodes: Vec<u32> = (first..parts.points.len() as u32).collect();
        let mut free = vec![true; local.points.len()];
        for n in &local.driven {
            free[*n as usize] = false;
            cut.nodes.push(first + n);
        }
        cut.drive.add(local);
        // Driven nodes push no one: they stand where the coarse run says, with its penetration.
        let is_free = |n: &u32| free[(n - first) as usize];
        let slaves = nodes.iter().copied().filter(is_free).collect();
        let body = Body::new(sheet, parts.next(), local.cells.clone());
        let meshed = Meshed {
            nodes,
            patches: mesh.patches(),
            cells: mesh.cells,
        };
        let spec = SheetSpec {
            pressed: vec![pressed; local.cells.len()],
            other_material,
            ..plain(sheet, meshed, element, elements.p)
        };
        parts.add(spec, body, slaves);
    }
    Ok((parts, cut))
}
