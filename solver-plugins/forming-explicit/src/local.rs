//! The model of one zone, driven at its cut by a coarse run.

use crate::assembly::{self, Components, Placed, ToolSurface};
use crate::parameters::Parameters;
use crate::process::{Cycle, Load};
use crate::run::{Body, Forming};
use plyflow_mechanics::history::{hermite, locate};
use plyflow_mechanics::mesh::QuadMesh;
use plyflow_mechanics::model::{Drive, Model};
use plyflow_mechanics::sheet::{Pressed, SheetSpec};
use plyflow_mechanics::vec3::V;
use plyflow_model::scene::{Process, SheetKind};
use std::sync::Arc;

/// A sheet of the zone as the boundary artifact holds it.
pub struct LocalSheet {
    /// Name, as in the scene.
    pub name: String,
    /// `[n]` undeformed points (m).
    pub points: Vec<V>,
    /// `[m]` cells.
    pub cells: Vec<[u32; 4]>,
    /// `[k]` driven nodes.
    pub driven: Vec<u32>,
    /// `[frames][k]` positions (m).
    pub position: Vec<Vec<V>>,
    /// `[frames][k]` velocities (m/s).
    pub velocity: Vec<Vec<V>>,
}

/// What a boundary artifact gives.
pub struct LocalInput {
    /// Times of the frames (s).
    pub time: Vec<f64>,
    /// Sheets, any order.
    pub sheets: Vec<LocalSheet>,
    /// Cavity pressure (Pa) at the times.
    pub cavity: Vec<f64>,
    /// Bag pressure (Pa).
    pub bag: Vec<f64>,
    /// Frame height (m).
    pub frame: Vec<f64>,
    /// The zone, as its artifact describes it.
    pub zone: serde_json::Value,
    /// Element size (m).
    pub element_size: f64,
}

/// Cubic Hermite motion of the cut.
struct CutDrive {
    time: Vec<f64>,
    position: Vec<Vec<V>>,
    velocity: Vec<Vec<V>>,
}

impl Drive for CutDrive {
    fn position(&self, k: usize, t: f64) -> V {
        let (i, s) = locate(&self.time, t);
        let w = hermite(s, self.time[i + 1] - self.time[i]);
        let (p, q) = (self.position[i][k], self.position[i + 1][k]);
        let (u, v) = (self.velocity[i][k], self.velocity[i + 1][k]);
        [0, 1, 2].map(|c| w[0] * p[c] + w[1] * q[c] + w[2] * u[c] + w[3] * v[c])
    }
}

/// Builds the model of a zone.
///
/// # Errors
/// A text for the user: what of the boundary or the parameters makes no model.
pub fn build_local(
    p: &Parameters,
    input: LocalInput,
    components: &dyn Components,
) -> Result<Forming, String> {
    let scene = &p.scene;
    let Process::DoubleDiaphragm(process) = &scene.process else {
        return Err(format!(
            "scene '{}' is formed by a {}; local runs are built for double_diaphragm only. Run the whole scene with \
             bending elements instead: leave out the boundary",
            scene.name,
            scene.process.word()
        ));
    };
    let whole = assembly::stack(scene)?;
    let has = |name: &str| input.sheets.iter().any(|s| s.name == name);
    let stack: Vec<_> = whole.into_iter().filter(|s| has(&s.scene.name)).collect();
    if stack.len() < 3 {
        let names: Vec<&str> = input.sheets.iter().map(|s| s.name.as_str()).collect();
        return Err(format!(
            "the zone needs both diaphragms and at least one ply of scene '{}'; its boundary has: {}",
            scene.name,
            names.join(", ")
        ));
    }
    if input.time.len() < 2 {
        return Err("the boundary has fewer than two frames".into());
    }
    let frames = input.time.len();
    let mut points = Vec::new();
    let (mut specs, mut bodies, mut placed) = (Vec::new(), Vec::new(), Vec::new());
    let (mut driven, mut position, mut velocity) = (
        Vec::new(),
        vec![Vec::new(); frames],
        vec![Vec::new(); frames],
    );
    for (k, sheet) in stack.iter().enumerate() {
        let local = input
            .sheets
            .iter()
            .find(|s| s.name == sheet.scene.name)
            .expect("filtered");
        let first = points.len() as u32;
        points.extend_from_slice(&local.points);
        let film = sheet.scene.kind == SheetKind::Diaphragm;
        let pressed = match (film, k == 0) {
            (true, true) => Pressed::Below,
            (true, false) => Pressed::Above,
            _ => Pressed::No,
        };
        let choice = if film {
            &p.diaphragm_element
        } else {
            &p.element
        };
        let mesh = QuadMesh {
            points: local.points.clone(),
            cells: local.cells.clone(),
        };
        let nodes: Vec<u32> = (first..points.len() as u32).collect();
        let mut free = vec![true; local.points.len()];
        for n in &local.driven {
            free[*n as usize] = false;
            driven.push(first + n);
        }
        for f in 0..frames {
            position[f].extend_from_slice(&local.position[f]);
            velocity[f].extend_from_slice(&local.velocity[f]);
        }
        // Driven nodes push no one: they stand where the coarse run says, with its penetration.
        let slaves = nodes
            .iter()
            .copied()
            .filter(|n| free[(n - first) as usize])
            .collect();
        placed.push(Placed { index: k, slaves });
        bodies.push(Body::new(sheet, k, local.cells.clone()));
        specs.push(SheetSpec {
            name: sheet.scene.name.clone(),
            nodes,
            layers: vec![1.0; local.cells.len()],
            pressed: vec![pressed; local.cells.len()],
            patches: mesh.patches(),
            least_areal_mass: vec![p.least_areal_mass; mesh.cells.len()],
            cells: mesh.cells,
            axis: assembly::axis(&sheet.scene),
            element: assembly::element(components, sheet, choice)?,
        });
    }
    let (tool, grid) = assembly::tool(scene, p.tool_grid)?;
    let cycle = Cycle::new(process, [input.frame[0], input.frame[frames - 1]]);
    let reference = points.clone();
    let mut model =
        Model::new(points, specs, assembly::step_settings(p)).map_err(|e| e.to_string())?;
    assembly::add_contacts(
        &mut model,
        &stack,
        &placed,
        scene,
        p,
        Arc::new(ToolSurface(grid)),
    )?;
    let drive = CutDrive {
        time: input.time.clone(),
        position,
        velocity,
    };
    model.set_driven(driven, Box::new(drive));
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
        bodies,
        reference,
        tool,
        rigid: Vec::new(),
        zone: Some(input.zone),
        element_size: input.element_size,
    })
}
