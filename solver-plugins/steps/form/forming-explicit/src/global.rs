//! The model of a whole scene.

use crate::assembly::{self, Components, Placed, StackSheet};
use crate::elements;
use crate::parameters::Parameters;
use crate::press::build_press;
use crate::process::{Cycle, FrameDrive, Load};
use crate::run::{Body, Forming};
use crate::symmetry;
use crate::tool::ToolSurfaces;
use plyflow_blank::Blank;
use plyflow_mechanics::mesh::{QuadMesh, graded_axis};
use plyflow_mechanics::mirror::{Mirrors, Planes, on_outer_boundary};
use plyflow_mechanics::model::Model;
use plyflow_mechanics::sheet::{Pressed, SheetSpec};
use plyflow_mechanics::vec3::V;
use plyflow_model::budget::{self, Wanted};
use plyflow_model::scene::{DoubleDiaphragm, Process};
use plyflow_tooling::{RigidTool, ToolMesh};

/// Extent in the plane: x0, y0, x1, y1 (m).
type Box2 = [f64; 4];

fn union(a: Box2, b: Box2) -> Box2 {
    [
        a[0].min(b[0]),
        a[1].min(b[1]),
        a[2].max(b[2]),
        a[3].max(b[3]),
    ]
}

fn grown(b: Box2, by: f64) -> Box2 {
    [b[0] - by, b[1] - by, b[2] + by, b[3] + by]
}

fn inside(b: Box2, x: f64, y: f64) -> bool {
    x > b[0] && x < b[2] && y > b[1] && y < b[3]
}

/// Places of everything before meshing.
struct Layout {
    tool_top: f64,
    bottom_z: f64,
    plies: Vec<Blank>,
    all_plies: Box2,
    joint: Box2,
    fine: Box2,
    film: QuadMesh,
    film_size: f64,
    planes: Planes,
}

fn layout(
    stack: &[StackSheet],
    process: &DoubleDiaphragm,
    p: &Parameters,
    tool: &ToolMesh,
    planes: Planes,
) -> Result<Layout, String> {
    let [lo, hi] = tool.bounds();
    let plies: Vec<Blank> = stack[1..stack.len() - 1]
        .iter()
        .map(|sheet| assembly::blank_part(sheet, planes))
        .collect::<Result<_, _>>()?;
    let all_plies = plies
        .iter()
        .map(Blank::bounds)
        .reduce(union)
        .ok_or("the scene has no ply")?;
    let film_size = p.film_size();
    if film_size < 0.999 * p.element_size {
        return Err(format!(
            "diaphragm_element_size ({film_size} m) is below element_size ({} m): the plies' nodes \
             carry the films, so the films' elements must not be finer",
            p.element_size
        ));
    }
    // At least three cells of free film around the plies, so that the step at their edge has room.
    let joint = grown(
        all_plies,
        process.film_joint_margin.si().max(3.0 * film_size),
    );
    let fine = union(
        grown(joint, film_size),
        grown([lo[0], lo[1], hi[0], hi[1]], 0.03),
    );
    let (hl, hw) = (
        0.5 * process.frame_length.si(),
        0.5 * process.frame_width.si(),
    );
    if fine[0] < -hl || fine[2] > hl || fine[1] < -hw || fine[3] > hw {
        return Err(format!(
            "process.double_diaphragm: the frame ({} x {} m) is too small; expected at least {:.3} x {:.3} m: the plies with {:.0} mm of free \
             film around them (`film_joint_margin`, at least three elements of {:.1} mm, `diaphragm_element_size` or `element_size`) and one \
             more element, and the tool with 30 mm. Enlarge `frame_length` and `frame_width`, or take less of these",
            2.0 * hl,
            2.0 * hw,
            2.0 * fine[2].max(-fine[0]),
            2.0 * fine[3].max(-fine[1]),
            1e3 * process.film_joint_margin.si().max(3.0 * film_size),
            1e3 * film_size
        ));
    }
    let fine_part = [0, 1].map(|k| fine[k + 2] - if planes.0[k] { 0.0 } else { fine[k] });
    allow_film(fine_part[0] * fine_part[1], p)?;
    // A grid line lies on every mirror plane.
    let axis = |k: usize, half: f64| {
        let (low, fine_low) = if planes.0[k] {
            (0.0, 0.0)
        } else {
            (-half, fine[k])
        };
        graded_axis(
            low,
            half,
            fine_low,
            fine[k + 2],
            film_size,
            p.diaphragm_growth,
        )
    };
    let (xs, ys) = (axis(0, hl), axis(1, hw));
    let tool_top = hi[2];
    Ok(Layout {
        tool_top,
        bottom_z: tool_top + process.clearance.si() + stack[0].offset,
        plies,
        all_plies,
        joint,
        fine,
        film: QuadMesh::grid(&xs, &ys),
        film_size,
        planes,
    })
}

/// Whether the films' elements are not too many to be made; `fine`: the area of the even ones (m2), which are most.
fn allow_film(fine: f64, p: &Parameters) -> Result<(), String> {
    let size = p.film_size();
    budget::allow(Wanted {
        what: "the mesh of a diaphragm",
        of: "elements",
        count: fine / (size * size),
        most: budget::MOST_ELEMENTS,
        bytes: budget::ELEMENT_BYTES,
        parameter: match p.diaphragm_element_size {
            Some(_) => "diaphragm_element_size",
            None => "element_size",
        },
        size,
    })
}

/// Points and sheets of the model as they grow.
#[derive(Default)]
struct Parts {
    points: Vec<V>,
    specs: Vec<SheetSpec>,
    bodies: Vec<Body>,
    placed: Vec<Placed>,
    mirrors: Mirrors,
}

fn bottom_film(
    parts: &mut Parts,
    at: &Layout,
    stack: &[StackSheet],
    p: &Parameters,
    components: &dyn Components,
) -> Result<Vec<u32>, String> {
    let mesh = &at.film;
    let joined: Vec<bool> = mesh.cells.iter().map(|c| is_joined(at, c)).collect();
    parts
        .points
        .extend(mesh.points.iter().map(|q| [q[0], q[1], at.bottom_z]));
    let boundary = on_outer_boundary(mesh, at.planes);
    let mut nodes: Vec<u32> = (0..mesh.points.len() as u32).collect();
    let frame: Vec<u32> = nodes
        .iter()
        .copied()
        .filter(|n| boundary[*n as usize])
        .collect();
    let inner = nodes.iter().copied();
    let slaves = inner.filter(|n| !boundary[*n as usize]).collect();
    let element = elements::element(components, &stack[0], &p.diaphragm_element)?;
    symmetry::check_material(&element, &stack[0], at.planes)?;
    let (points, mirrors) = (&mut parts.points, &mut parts.mirrors);
    let patches = elements::patches(points, &mut nodes, mesh, &element, mirrors);
    let spec = SheetSpec {
        name: stack[0].scene.name.clone(),
        nodes,
        cells: mesh.cells.clone(),
        patches,
        axis: assembly::axis(&stack[0].scene),
        layers: joined.iter().map(|j| if *j { 2.0 } else { 1.0 }).collect(),
        pressed: joined
            .iter()
            .map(|j| if *j { Pressed::Both } else { Pressed::Below })
            .collect(),
        // Away from plies and tool nothing presses on the film: there it keeps its own mass.
        least_areal_mass: mesh
            .cells
            .iter()
            .map(|c| {
                if is_inside(at, at.fine, c) {
                    p.least_areal_mass
                } else {
                    0.0
                }
            })
            .collect(),
        element,
        elsewhere: None,
        other_material: None,
    };
    parts.placed.push(Placed { index: 0, slaves });
    let body = assembly::body(&stack[0], 0, &mesh.points, &mesh.cells, at.planes)?;
    parts.bodies.push(body);
    parts.specs.push(spec);
    Ok(frame)
}

fn is_inside(at: &Layout, b: Box2, cell: &[u32; 4]) -> bool {
    let p = cell.map(|n| at.film.points[n as usize]);
    let c = [0, 1].map(|k| 0.25 * (p[0][k] + p[1][k] + p[2][k] + p[3][k]));
    inside(b, c[0], c[1])
}

fn is_joined(at: &Layout, cell: &[u32; 4]) -> bool {
    !is_inside(at, at.joint, cell)
}

fn ply(
    parts: &mut Parts,
    at: &Layout,
    k: usize,
    sheet: &StackSheet,
    bottom: &StackSheet,
    p: &Parameters,
    components: &dyn Components,
) -> Result<(), String> {
    let z = at.bottom_z + sheet.offset - bottom.offset;
    let blank = &at.plies[k - 1];
    let (points, mirrors) = (&mut parts.points, &mut parts.mirrors);
    let (before, first) = (mirrors.ghosts.len(), points.len() as u32);
    let (spec, body) = assembly::add_ply(points, mirrors, blank, z, (k, sheet), p, components)?;
    let own = (points.len() - (mirrors.ghosts.len() - before)) as u32;
    parts.bodies.push(body);
    parts.placed.push(Placed {
        index: k,
        slaves: (first..own).collect(),
    });
    parts.specs.push(spec);
    Ok(())
}

/// Whether a place lies over a ply, or within a film element beside one.
fn over_ply(at: &Layout, [x, y]: [f64; 2]) -> bool {
    let beside = 1.01 * at.film_size;
    let in_box = inside(grown(at.all_plies, beside), x, y);
    // Rectangles of one stack cover nearly the same: the box around all of them has no steps between them.
    let rectangles = at.plies.iter().all(|b| matches!(b, Blank::Rectangle(_)));
    in_box && (rectangles || at.plies.iter().any(|b| b.distance([x, y]) < beside))
}

/// The top film where it is not joined to the bottom film; its outline shares the bottom film's nodes.
/// It starts laid over the plies and down onto the bottom film beside them: a gap that the vacuum would have
/// to close would close with a bang.
fn top_film(
    parts: &mut Parts,
    at: &Layout,
    stack: &[StackSheet],
    p: &Parameters,
    components: &dyn Components,
) -> Result<(), String> {
    let last = stack.len() - 1;
    let (bottom, top) = (&stack[0], &stack[last]);
    let mesh = &at.film;
    let free: Vec<[u32; 4]> = mesh
        .cells
        .iter()
        .filter(|c| !is_joined(at, c))
        .copied()
        .collect();
    let mut shared = vec![false; mesh.points.len()];
    for cell in mesh.cells.iter().filter(|c| is_joined(at, c)) {
        for n in cell {
            shared[*n as usize] = true;
        }
    }
    let high = at.bottom_z + top.offset - bottom.offset;
    let low =
        at.bottom_z + (0.5 * (bottom.thickness + top.thickness)).max(assembly::LEAST_FILM_DISTANCE);
    let mut local = vec![u32::MAX; mesh.points.len()];
    let (mut nodes, mut slaves) = (Vec::new(), Vec::new());
    let mut cells = Vec::with_capacity(free.len());
    for cell in &free {
        cells.push(cell.map(|n| {
            let i = n as usize;
            if local[i] == u32::MAX {
                local[i] = nodes.len() as u32;
                if shared[i] {
                    nodes.push(n);
                } else {
                    let q = mesh.points[i];
                    let z = if over_ply(at, [q[0], q[1]]) {
                        high
                    } else {
                        low
                    };
                    slaves.push(parts.points.len() as u32);
                    nodes.push(parts.points.len() as u32);
                    parts.points.push([q[0], q[1], z]);
                }
            }
            local[i]
        }));
    }
    let plan = QuadMesh {
        points: nodes.iter().map(|n| parts.points[*n as usize]).collect(),
        cells: cells.clone(),
    };
    let body = assembly::body(top, last, &plan.points, &plan.cells, at.planes)?;
    let element = elements::element(components, top, &p.diaphragm_element)?;
    symmetry::check_material(&element, top, at.planes)?;
    let (points, mirrors) = (&mut parts.points, &mut parts.mirrors);
    let patches = elements::patches(points, &mut nodes, &plan, &element, mirrors);
    let spec = SheetSpec {
        name: top.scene.name.clone(),
        nodes,
        layers: vec![1.0; cells.len()],
        pressed: vec![Pressed::Above; cells.len()],
        patches,
        least_areal_mass: vec![p.least_areal_mass; cells.len()],
        cells,
        axis: assembly::axis(&top.scene),
        element,
        elsewhere: None,
        other_material: None,
    };
    parts.bodies.push(body);
    parts.placed.push(Placed {
        index: last,
        slaves,
    });
    parts.specs.push(spec);
    Ok(())
}

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

/// Builds the model of a whole scene.
///
/// # Errors
/// A text for the user: what of the scene or the parameters makes no model.
pub fn build_global(p: &Parameters, components: &dyn Components) -> Result<Forming, String> {
    let scene = &p.scene;
    let process = match &scene.process {
        Process::DoubleDiaphragm(process) => process,
        Process::Press(press) => return build_press(p, press, components),
    };
    let stack = assembly::stack(scene)?;
    let RigidTool {
        mesh: tool,
        field: grid,
        error,
        warnings: mut tool_warnings,
    } = plyflow_tooling::given::rigid(scene, p.tool_grid)?;
    tool_warnings.extend(coarse_grid(p));
    let planes = symmetry::planes(scene);
    symmetry::check(scene, planes, &stack, &tool)?;
    let at = layout(&stack, process, p, &tool, planes)?;
    let mut parts = Parts::default();
    parts.mirrors.planes = planes;
    let frame = bottom_film(&mut parts, &at, &stack, p, components)?;
    for k in 1..stack.len() - 1 {
        ply(&mut parts, &at, k, &stack[k], &stack[0], p, components)?;
    }
    top_film(&mut parts, &at, &stack, p, components)?;
    let cycle = Cycle::new(process, [at.bottom_z, stack[0].offset])?;
    let plan = frame
        .iter()
        .map(|n| [0, 1].map(|k| parts.points[*n as usize][k]))
        .collect();
    let settings = assembly::step_settings(p);
    let mut model = Model::mirrored(parts.points, parts.specs, settings, parts.mirrors)
        .map_err(|e| e.to_string())?;
    assembly::add_contacts(
        &mut model,
        &stack,
        &parts.placed,
        scene,
        p,
        &mut ToolSurfaces::new(grid),
    )?;
    model.add_plane_contacts(&assembly::contact_settings(p));
    model.set_driven(
        frame,
        Box::new(FrameDrive {
            plan,
            cycle: cycle.clone(),
        }),
    );
    debug_assert!(at.tool_top > 0.0);
    let reference = model.start().clone();
    Ok(Forming {
        model,
        load: Load::Process {
            cycle,
            tool_volume: tool.volume() / planes.copies() as f64,
            sealed_volume: None,
            pumped_volume: None,
        },
        stack,
        bodies: parts.bodies,
        reference,
        tool,
        rigid: Vec::new(),
        field_errors: vec![("tool", error)],
        tool_warnings,
        zone: None,
        start: None,
        element_size: p.element_size,
    })
}
