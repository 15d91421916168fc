//! The model of one zone, driven at its cut by a coarse run.

use crate::boundary::{Beginning, CutDrive};
use crate::build::bag::Bag;
use crate::build::dies::{Dies, Sheets, in_press, in_stamping};
use crate::error::{FormingError, Result};
use crate::forming::Forming;
use crate::load::Load;
use crate::request::{LocalInput, LocalSheet, Parameters};
use crate::stack::{
    Body, Components, Elements, Meshed, Parts, RigidName, StackSheet, ToolSurfaces, plain, sheet,
    tool,
};
use plyflow_mechanics::mesh::QuadMesh;
use plyflow_mechanics::model::Model;
use plyflow_mechanics::sheet::{Pressed, SheetSpec};
use plyflow_model::scene::{Process, Scene, SheetKind};
use plyflow_tooling::RigidTool;

/// Builds the model of a zone.
///
/// # Errors
/// What of the boundary or the parameters makes no model.
pub fn build_local(
    p: &Parameters,
    input: LocalInput,
    components: &dyn Components,
) -> Result<Forming> {
    let stack = stack_of(&p.scene, &input)?;
    if input.time.len() < 2 {
        let text = "the boundary has fewer than two frames";
        return Err(FormingError::Input(text.into()));
    }
    let (parts, cut) = sheets_of(&input, &stack, &Elements { p, components })?;
    let start = Beginning::of_zone(&stack, &input.sheets, input.time[0])?;
    let tool = tool::rigid(p)?;
    let mut model = Model::new(parts.points, parts.specs, p.step_settings())?;
    let sheets = Sheets {
        stack: &stack,
        placed: &parts.placed,
        input: &input,
    };
    let dies = match &p.scene.process {
        Process::DoubleDiaphragm(of) => in_bag(p, Bag::Double(of), &tool, &sheets, &mut model),
        Process::SingleDiaphragm(of) => in_bag(p, Bag::Single(of), &tool, &sheets, &mut model),
        Process::Press(press) => in_press(p, press, &tool, &sheets, &mut model),
        Process::Stamping(stamping) => in_stamping(p, stamping, &tool, &sheets, &mut model),
    }?;
    model.set_driven(cut.nodes, Box::new(cut.drive));
    let reference = model.start().clone();
    Ok(Forming {
        model,
        load: dies.load,
        stack,
        bodies: parts.bodies,
        reference,
        tool: tool.mesh,
        rigid: dies.rigid,
        field_errors: dies.field_errors,
        placement: tool.placement,
        tool_warnings: tool.warnings,
        zone: Some(input.zone),
        slower: input.slower,
        start,
        element_size: input.element_size,
    })
}

/// Puts a zone between films, or under one, over the tool, under the pressures of the run of the whole.
fn in_bag(
    p: &Parameters,
    bag: Bag<'_>,
    tool: &RigidTool,
    sheets: &Sheets<'_>,
    model: &mut Model,
) -> Result<Dies> {
    let input = sheets.input;
    if input.cavity.len() != input.time.len() {
        let text = "the boundary does not tell the pressure in the cavity over time, which presses on the films of a zone; run its step again, on a run of this scene";
        return Err(FormingError::Input(text.into()));
    }
    let last = input.time.len() - 1;
    let frame = [input.frame[0], input.frame[last]];
    let cycle = bag.cycle(frame).slowed(input.slower);
    let mut surfaces = ToolSurfaces::new(tool.field.clone());
    bag.add_contacts(model, sheets.stack, sheets.placed, p, &mut surfaces)?;
    Ok(Dies {
        load: Load::Given {
            time: input.time.clone(),
            cavity: input.cavity.clone(),
            bag: input.bag.clone(),
            frame: input.frame.clone(),
            cycle,
        },
        rigid: Vec::new(),
        field_errors: vec![(RigidName::Tool, tool.error)],
    })
}

/// Those sheets of the scene that the zone has, bottom to top, one on the other.
fn stack_of(scene: &Scene, input: &LocalInput) -> Result<Vec<StackSheet>> {
    let whole = sheet::stack(scene)?;
    let has = |name: &str| input.sheets.iter().any(|s| s.name == name);
    let mut stack: Vec<_> = whole.into_iter().filter(|s| has(&s.scene.name)).collect();
    // A ply that does not reach into the zone holds nothing off the tool there.
    sheet::lay(&mut stack);
    let bag = Bag::of(&scene.process);
    let plies = stack.iter().filter(|s| s.is_ply()).count();
    let films = stack.len() - plies;
    if plies == 0 || bag.is_some_and(|bag| films != bag.films()) {
        let expected = match bag {
            Some(Bag::Double(_)) => "both diaphragms and at least one ply",
            Some(Bag::Single(_)) => "the diaphragm and at least one ply",
            None => "at least one ply",
        };
        let names: Vec<&str> = input.sheets.iter().map(|s| s.name.as_str()).collect();
        return Err(FormingError::Input(format!(
            "the zone needs {expected} of scene '{}'; its boundary has: {}",
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
    let bag = Bag::of(&elements.p.scene.process);
    for sheet in stack {
        let of_name = |s: &&LocalSheet| s.name == sheet.scene.name;
        let local = input.sheets.iter().find(of_name).expect("filtered");
        let first = parts.points.len() as u32;
        parts.points.extend_from_slice(&local.points);
        let pressed = match (sheet.scene.kind, bag) {
            (SheetKind::Diaphragm, Some(bag)) => bag.presses(parts.specs.is_empty()),
            (SheetKind::Diaphragm, None) | (SheetKind::Ply, _) => Pressed::No,
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
            steered: sheet.steered(&local.points, &local.cells),
            pressed: vec![pressed; local.cells.len()],
            other_material,
            ..plain(sheet, meshed, element, elements.p)
        };
        parts.add(spec, body, slaves);
    }
    Ok((parts, cut))
}
