//! The model of a whole scene in a bag: films, plies between or under them, the tool below.

use crate::boundary::FrameDrive;
use crate::build::bag_contacts::{add_contacts, add_contacts_under_one};
use crate::build::layout::{Frame, Layout};
use crate::build::{films, rim};
use crate::error::Result;
use crate::forming::Forming;
use crate::load::{Cycle, Load};
use crate::request::Parameters;
use crate::stack::{
    Components, Elements, Parts, Placed, RigidName, StackSheet, ToolSurfaces, sheet, symmetry, tool,
};
use plyflow_mechanics::model::Model;
use plyflow_mechanics::sheet::Pressed;
use plyflow_model::scene::{DoubleDiaphragm, Process, SingleDiaphragm};
use plyflow_tooling::ToolMesh;

/// How far (m) beside a face of the tool its section is taken: more than a drawing rounds, less than any plate is thick.
const BESIDE: f64 = 2e-5;

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

/// What films do to plies: two of them hold the plies between them, or one presses them onto the tool.
#[derive(Debug, Clone, Copy)]
pub enum Bag<'a> {
    /// Plies between two films.
    Double(&'a DoubleDiaphragm),
    /// Plies on the tool under one film.
    Single(&'a SingleDiaphragm),
}

impl<'a> Bag<'a> {
    /// That of a process, if it has films.
    pub fn of(process: &'a Process) -> Option<Self> {
        match process {
            Process::DoubleDiaphragm(process) => Some(Self::Double(process)),
            Process::SingleDiaphragm(process) => Some(Self::Single(process)),
            Process::Press(_) | Process::Stamping(_) => None,
        }
    }

    /// How many films there are.
    pub fn films(self) -> usize {
        match self {
            Self::Double(_) => 2,
            Self::Single(_) => 1,
        }
    }

    /// What presses on a film; `lowest`: whether it is the first sheet of the stack.
    pub fn presses(self, lowest: bool) -> Pressed {
        match (self, lowest) {
            (Self::Single(_), _) => Pressed::Both,
            (Self::Double(_), true) => Pressed::Below,
            (Self::Double(_), false) => Pressed::Above,
        }
    }

    /// Phases; `frame` as in [`Cycle::frame`].
    pub fn cycle(self, frame: [f64; 2]) -> Cycle {
        match self {
            Self::Double(process) => Cycle::new(process, frame),
            Self::Single(process) => Cycle::of_single(process, frame),
        }
    }

    /// Sets up all contacts of a stack, or of those of its sheets that a zone has.
    ///
    /// # Errors
    /// When a friction coefficient is missing or makes no sense.
    pub fn add_contacts(
        self,
        model: &mut Model,
        stack: &[StackSheet],
        placed: &[Placed],
        p: &Parameters,
        tool: &mut ToolSurfaces,
    ) -> Result<()> {
        match self {
            Self::Double(_) => add_contacts(model, stack, placed, p, tool),
            Self::Single(process) => {
                add_contacts_under_one(model, stack, placed, p, (tool, process.bed))
            }
        }
    }

    fn frame(self) -> Frame {
        match self {
            Self::Double(process) => Frame {
                process: "double_diaphragm",
                opening: [process.frame_length.si(), process.frame_width.si()],
                clearance: process.clearance.si(),
                joint: Some(process.film_joint_margin.si()),
                around_tool: true,
            },
            Self::Single(process) => Frame {
                process: "single_diaphragm",
                opening: [process.frame_length.si(), process.frame_width.si()],
                clearance: 0.0,
                joint: None,
                around_tool: process.bed,
            },
        }
    }

    /// Adds the sheets, from the tool upwards. Gives the nodes that the frame clamps.
    fn add_sheets(
        self,
        parts: &mut Parts,
        at: &Layout,
        stack: &[StackSheet],
        elements: &Elements<'_>,
    ) -> Result<Vec<u32>> {
        let place = |sheet: &StackSheet| at.bottom_z + sheet.offset - stack[0].offset;
        let mut frame = match self {
            Self::Double(_) => films::add_bottom(parts, at, &stack[0], elements)?,
            Self::Single(_) => Vec::new(),
        };
        let plies = stack.iter().filter(|sheet| sheet.is_ply());
        for (sheet, blank) in plies.zip(&at.plies) {
            parts.add_ply(sheet, blank, place(sheet), elements)?;
        }
        match self {
            Self::Double(_) => films::add_top(parts, at, stack, elements)?,
            Self::Single(process) => {
                let film = &stack[stack.len() - 1];
                let z = place(film) + process.clearance.si();
                frame = films::add_single(parts, at, (film, z), elements)?;
            }
        }
        Ok(frame)
    }

    /// Height (m) of the mid-plane of the film in the frame at the end.
    fn end(self, stack: &[StackSheet]) -> f64 {
        match self {
            Self::Double(_) => stack[0].offset,
            Self::Single(process) => {
                let height = process.frame_height.map_or(0.0, |h| h.si());
                height + 0.5 * stack[stack.len() - 1].thickness
            }
        }
    }

    /// What of the volume (m3) between a film and z = 0 is not the cavity's, of the whole: the tool. Without a bed the tool may reach out under the
    /// frame, and beside it the cavity is taken to be as deep under the frame as the tool is high over it.
    fn filled(self, tool: &ToolMesh) -> f64 {
        let Self::Single(process) = self else {
            return tool.volume();
        };
        let stretched = 1.0 + process.film_pre_stretch.0;
        let [a, b] = [process.frame_length.si(), process.frame_width.si()].map(|l| l * stretched);
        let opening = [-0.5 * a, -0.5 * b, 0.5 * a, 0.5 * b];
        let base = process.frame_height.map_or(0.0, |h| h.si());
        let [_, volume] = tool.column(opening, base);
        if process.bed {
            return volume;
        }
        let [low, high] = tool.bounds().map(|p| p[2]);
        let [covered, _] = tool.column(opening, (base - BESIDE).max(low + BESIDE));
        let beside = (a * b - covered).max(0.0) * (high - base).max(0.0);
        volume + base * a * b - beside
    }
}

/// Builds the model of a scene in a bag.
///
/// # Errors
/// What of the scene or the parameters makes no model.
pub fn build_bag(p: &Parameters, bag: Bag<'_>, components: &dyn Components) -> Result<Forming> {
    let scene = &p.scene;
    let stack = sheet::stack(scene)?;
    let mut tool = tool::rigid(p)?;
    tool.warnings.extend(coarse_grid(p));
    let planes = symmetry::planes(scene);
    symmetry::check_tool(planes, &tool.mesh)?;
    let at = Layout::new(&stack, &bag.frame(), p, &tool.mesh, planes)?;
    let elements = Elements { p, components };
    let mut parts = Parts::default();
    parts.mirrors.planes = planes;
    let frame = bag.add_sheets(&mut parts, &at, &stack, &elements)?;
    let mut surfaces = ToolSurfaces::new(tool.field);
    if let Bag::Single(_) = bag {
        rim::lift(&mut parts, &stack, &mut surfaces);
    }
    let in_plan = |n: &u32| [0, 1].map(|k| parts.points[*n as usize][k]);
    let drive = FrameDrive {
        plan: frame.iter().map(in_plan).collect(),
        cycle: bag.cycle([parts.points[frame[0] as usize][2], bag.end(&stack)]),
    };
    if let Bag::Single(process) = bag {
        rim::check(process, &drive, &tool.mesh)?;
    }
    let cycle = drive.cycle.clone();
    let settings = p.step_settings();
    let mut model = Model::mirrored(parts.points, parts.specs, settings, parts.mirrors)?;
    bag.add_contacts(&mut model, &stack, &parts.placed, p, &mut surfaces)?;
    model.add_plane_contacts(&p.contact_settings());
    model.set_driven(frame, Box::new(drive));
    let reference = model.start().clone();
    Ok(Forming {
        model,
        load: Load::Process {
            cycle,
            tool_volume: bag.filled(&tool.mesh) / planes.copies() as f64,
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
