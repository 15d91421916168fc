//! The films of a bag, one or two: two are surfaces that are one where they are joined.

use crate::build::layout::Layout;
use crate::error::Result;
use crate::stack::{
    Body, Elements, LEAST_FILM_DISTANCE, Meshed, Parts, StackSheet, plain, symmetry,
};
use plyflow_mechanics::component::ElementInstance;
use plyflow_mechanics::mesh::QuadMesh;
use plyflow_mechanics::mirror::on_outer_boundary;
use plyflow_mechanics::sheet::{Pressed, SheetSpec};

/// The element of a film, which has to be its own mirror image.
fn film_element(
    film: &StackSheet,
    at: &Layout,
    elements: &Elements<'_>,
) -> Result<ElementInstance> {
    let element = elements.of_film(film)?;
    symmetry::check_material(&element, film, at.planes)?;
    Ok(element)
}

/// Adds the lower film of two, the first sheet of all. Gives its nodes in the frame.
///
/// # Errors
/// When its element cannot be made or is not its own mirror image.
pub fn add_bottom(
    parts: &mut Parts,
    at: &Layout,
    film: &StackSheet,
    elements: &Elements<'_>,
) -> Result<Vec<u32>> {
    let stands_for = |c: &[u32; 4]| match at.is_joined(c) {
        true => (2.0, Pressed::Both),
        false => (1.0, Pressed::Below),
    };
    add_clamped(parts, at, (film, at.bottom_z), stands_for, elements)
}

/// Adds a single film at height `z` (m), between the surroundings and the cavity. Gives its nodes in the frame.
///
/// # Errors
/// As [`add_bottom`].
pub fn add_single(
    parts: &mut Parts,
    at: &Layout,
    (film, z): (&StackSheet, f64),
    elements: &Elements<'_>,
) -> Result<Vec<u32>> {
    add_clamped(parts, at, (film, z), |_| (1.0, Pressed::Both), elements)
}

/// Adds a flat film at height `z` (m) that the frame clamps all around. `stands_for`: for how many layers a cell stands, and what presses on it.
fn add_clamped(
    parts: &mut Parts,
    at: &Layout,
    (film, z): (&StackSheet, f64),
    stands_for: impl Fn(&[u32; 4]) -> (f64, Pressed),
    elements: &Elements<'_>,
) -> Result<Vec<u32>> {
    let mesh = &at.film;
    let first = parts.points.len() as u32;
    let plan = mesh.points.iter();
    parts.points.extend(plan.map(|q| [q[0], q[1], z]));
    let boundary = on_outer_boundary(mesh, at.planes);
    let mut nodes: Vec<u32> = (first..parts.points.len() as u32).collect();
    let (frame, slaves) =
        (nodes.iter()).partition::<Vec<u32>, _>(|n| boundary[(**n - first) as usize]);
    let element = film_element(film, at, elements)?;
    let patches = parts.patches(&mut nodes, mesh, &element);
    let (layers, pressed) = mesh.cells.iter().map(stands_for).unzip();
    let meshed = Meshed {
        nodes,
        cells: mesh.cells.clone(),
        patches,
    };
    let least = |c| {
        if at.is_fine(c) {
            elements.p.least_areal_mass
        } else {
            0.0
        }
    };
    let spec = SheetSpec {
        layers,
        pressed,
        // Away from plies and tool nothing presses on the film: there it keeps its own mass.
        least_areal_mass: mesh.cells.iter().map(least).collect(),
        ..plain(film, meshed, element, elements.p)
    };
    let body = Body::mirrored(film, parts.next(), &mesh.points, &mesh.cells, at.planes)?;
    parts.add(spec, body, slaves);
    Ok(frame)
}

/// The upper film as it is meshed.
struct Upper {
    /// Model nodes, those of the lower film where the two are joined.
    nodes: Vec<u32>,
    /// In its own numbers.
    cells: Vec<[u32; 4]>,
    /// Those nodes that are its own.
    slaves: Vec<u32>,
}

/// Adds the upper film where it is not joined to the lower one; its outline shares the lower film's nodes.
///
/// # Errors
/// When its element cannot be made or is not its own mirror image.
pub fn add_top(
    parts: &mut Parts,
    at: &Layout,
    stack: &[StackSheet],
    elements: &Elements<'_>,
) -> Result<()> {
    let film = &stack[stack.len() - 1];
    let upper = lay_top(parts, at, &stack[0], film);
    let mut nodes = upper.nodes;
    let plan = QuadMesh {
        points: nodes.iter().map(|n| parts.points[*n as usize]).collect(),
        cells: upper.cells,
    };
    let body = Body::mirrored(film, parts.next(), &plan.points, &plan.cells, at.planes)?;
    let element = film_element(film, at, elements)?;
    let patches = parts.patches(&mut nodes, &plan, &element);
    let count = plan.cells.len();
    let meshed = Meshed {
        nodes,
        cells: plan.cells,
        patches,
    };
    let spec = SheetSpec {
        pressed: vec![Pressed::Above; count],
        ..plain(film, meshed, element, elements.p)
    };
    parts.add(spec, body, upper.slaves);
    Ok(())
}

/// Places the upper film's own nodes. It starts laid over the plies and down onto the lower film beside them: a gap that the vacuum would
/// have to close would close with a bang.
fn lay_top(parts: &mut Parts, at: &Layout, bottom: &StackSheet, top: &StackSheet) -> Upper {
    let mesh = &at.film;
    let (joined, free): (Vec<&[u32; 4]>, Vec<&[u32; 4]>) =
        mesh.cells.iter().partition(|c| at.is_joined(c));
    let mut shared = vec![false; mesh.points.len()];
    for n in joined.into_iter().flatten() {
        shared[*n as usize] = true;
    }
    let high = at.bottom_z + top.offset - bottom.offset;
    let low = at.bottom_z + (0.5 * (bottom.thickness + top.thickness)).max(LEAST_FILM_DISTANCE);
    let mut local = vec![u32::MAX; mesh.points.len()];
    let (mut nodes, mut slaves) = (Vec::new(), Vec::new());
    let mut number = |n: u32| {
        let i = n as usize;
        if local[i] == u32::MAX {
            local[i] = nodes.len() as u32;
            if shared[i] {
                nodes.push(n);
            } else {
                let [x, y, _] = mesh.points[i];
                let z = if at.over_ply([x, y]) { high } else { low };
                slaves.push(parts.points.len() as u32);
                nodes.push(parts.points.len() as u32);
                parts.points.push([x, y, z]);
            }
        }
        local[i]
    };
    let cells = free.into_iter().map(|c| c.map(&mut number)).collect();
    Upper {
        nodes,
        cells,
        slaves,
    }
}
