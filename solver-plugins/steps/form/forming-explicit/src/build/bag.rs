//! The model of a whole scene in a bag: films, plies between them, the tool below.

use crate::boundary::FrameDrive;
use crate::build::bag_contacts::add_contacts;
use crate::build::films;
use crate::build::layout::Layout;
use crate::error::Result;
use crate::forming::Forming;
use crate::load::{Cycle, Load};
use crate::request::Parameters;
use crate::stack::{Components, Elements, Parts, RigidName, ToolSurfaces, sheet, symmetry, tool};
use plyflow_mechanics::model::Model;
use plyflow_model::scene::DoubleDiaphragm;

/// What to say of a distance field with points further apart than the nodes that it holds off.
fn coarse_grid(p: &Parameters) -> Option<String> {
    (p.tool_grid > p.element_size).then(|| {
        format!(
            "tool_grid: given {:.2} mm, the plies' elements have {:.2} mm; by how much nodes stand off fillets, so that elements are as long as the \
             tool, is taken over the larger of both, and too small in fillets that are sharper: take a `tool_grid` of half the elements' size",
            1e3 * p.tool_grid,
            1e3 * p.element_size
        )
    })
}

/// Builds the model of a scene in a bag.
///
/// # Errors
/// What of the scene or the parameters makes no model.
pub fn build_bag(
    p: &Parameters,
    process: &DoubleDiaphragm,
    components: &dyn Components,
) -> Result<Forming> {
    let scene = &p.scene;
    let stack = sheet::stack(scene)?;
    let mut tool = tool::rigid(p)?;
    tool.warnings.extend(coarse_grid(p));
    let planes = symmetry::planes(scene);
    symmetry::check_tool(planes, &tool.mesh)?;
    let at = Layout::new(&stack, process, p, &tool.mesh, planes)?;
    let elements = Elements { p, components };
    let mut parts = Parts::default();
    parts.mirrors.planes = planes;
    let frame = films::add_bottom(&mut parts, &at, &stack[0], &elements)?;
    for (sheet, blank) in stack[1..].iter().zip(&at.plies) {
        let z = at.bottom_z + sheet.offset - stack[0].offset;
        parts.add_ply(sheet, blank, z, &elements)?;
    }
    films::add_top(&mut parts, &at, &stack, &elements)?;
    let cycle = Cycle::new(process, [at.bottom_z, stack[0].offset]);
    let in_plan = |n: &u32| [0, 1].map(|k| parts.points[*n as usize][k]);
    let drive = FrameDrive {
        plan: frame.iter().map(in_plan).collect(),
        cycle: cycle.clone(),
    };
    let settings = p.step_settings();
    let mut model = Model::mirrored(parts.points, parts.specs, settings, parts.mirrors)?;
    let mut surfaces = ToolSurfaces::new(tool.field);
    add_contacts(&mut model, &stack, &parts.placed, p, &mut surfaces)?;
    model.add_plane_contacts(&p.contact_settings());
    model.set_driven(frame, Box::new(drive));
    let reference = model.start().clone();
    Ok(Forming {
        model,
        load: Load::Process {
            cycle,
            tool_volume: tool.mesh.volume() / planes.copies() as f64,
            sealed_volume: None,
            pumped_volume: None,
        },
        stack,
        bodies: parts.bodies,
        reference,
        tool: tool.mesh,
        rigid: Vec::new(),
        field_errors: vec![(RigidName::Tool, tool.error)],
        placement: tool.placement,
        tool_warnings: tool.warnings,
        zone: None,
        slower: 1.0,
        start: None,
        element_size: p.element_size,
    })
}
