//! What sheets of a stack touch besides their neighbours: past the edges of what lies between.
//!
//! A ply reaches out over the one below it, lies over a hole of it or beside it, or slides past its edge (plies of one outline whose
//! fibres lie at different angles do): there it touches what comes next, at the distance of what is really between. How far plies slide
//! nobody knows before. So any two sheets of a stack have a contact, with all of their nodes; where something lies between they are too
//! far apart to touch, and nodes that are far from touching sleep.

use crate::assembly::{self, StackSheet};
use crate::friction::FrictionTable;
use crate::parameters::Parameters;
use crate::penetration;
use plyflow_mechanics::contact::{
    FrictionLaw, RigidContact, RigidItem, RigidSurface, SheetContact, SlaveItem,
};
use plyflow_mechanics::mesh::area_vector;
use plyflow_mechanics::model::Model;
use plyflow_mechanics::vec3::V;
use plyflow_model::scene::SheetKind;
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::sync::Arc;

/// A sheet of a stack: its place in that, its sheet's number in the model, its nodes that may be slaves.
pub type Layer<'a> = (usize, usize, &'a [u32]);

/// Distance (m) of a sheet's mid-plane from what is under (or over) all the sheets `between`.
fn offset_over(between: &[&StackSheet], sheet: &StackSheet) -> f64 {
    // Summed from the tool upwards, as the stack's own offsets are.
    let under = between.iter().fold(0.0, |sum, s| sum + s.thickness);
    under + 0.5 * sheet.thickness
}

/// What the name of a contact ends with that holds a ply where plies (their places in the stack) do not lie between.
fn beside(stack: &[StackSheet], plies: impl Iterator<Item = usize>) -> String {
    let missing: Vec<&str> = plies.map(|i| stack[i].scene.name.as_str()).collect();
    // Also a part of the path of its energies in the artifact.
    format!("/beside_{}", missing.join("_"))
}

/// The edges of a cell, around it.
fn edges(c: &[u32; 4]) -> [[u32; 2]; 4] {
    [0, 1, 2, 3].map(|k| [c[k], c[(k + 1) % 4]])
}

/// Edges that belong to one cell alone.
fn free_edges<'a>(cells: impl Iterator<Item = &'a [u32; 4]> + Clone) -> Vec<[u32; 2]> {
    let sorted = |[a, b]: [u32; 2]| [a.min(b), a.max(b)];
    let mut sides: HashMap<[u32; 2], usize> = HashMap::new();
    for edge in cells.clone().flat_map(edges) {
        *sides.entry(sorted(edge)).or_default() += 1;
    }
    (cells.flat_map(edges))
        .filter(|e| sides[&sorted(*e)] == 1)
        .collect()
}

/// Edges (model nodes) that bound a sheet of a model that is still flat. At a mirror plane a sheet does not end.
fn rim(model: &Model, sheet: usize) -> Vec<[u32; 2]> {
    let (from, to) = model.sheets()[sheet].cell_range;
    let planes = model.planes().0;
    let on = |n: &u32, k: usize| model.x()[*n as usize][k].abs() < 1e-9;
    let ends = |e: &[u32; 2]| !(0..2).any(|k| planes[k] && e.iter().all(|n| on(n, k)));
    let mut edges = free_edges(model.cells()[from..to].iter());
    edges.retain(ends);
    edges
}

/// The nodes (model numbering, increasing) on the rim of a sheet of a model that is still flat.
fn rim_nodes(model: &Model, sheet: usize) -> Vec<u32> {
    let mut ends = rim(model, sheet).into_flattened();
    ends.sort_unstable();
    ends.dedup();
    ends
}

/// The cells along the rim of a sheet of a model that is still flat; none where its rim is convex.
pub fn crooked_rim(model: &Model, sheet: usize) -> Vec<u32> {
    let edges = rim(model, sheet);
    let (from, to) = model.sheets()[sheet].cell_range;
    let x = |n: u32| model.x()[n as usize];
    let area = |c: &[u32; 4]| area_vector(c.map(x))[2].abs();
    let areas = model.cells()[from..to].iter().map(area);
    let (whole, largest) = areas.fold((0.0, 0.0f64), |(w, l), a| (w + a, l.max(a)));
    let nodes = edges.iter().flatten().map(|n| [x(*n)[0], x(*n)[1]]);
    // Meshed curves are convex but for some hundredths of a cell.
    if hull_area(nodes.collect()) - whole < 0.5 * largest {
        return Vec::new();
    }
    let ends = rim_nodes(model, sheet);
    let at_rim = |c: &u32| {
        let corners = model.cells()[*c as usize];
        corners.iter().any(|n| ends.binary_search(n).is_ok())
    };
    (from as u32..to as u32).filter(at_rim).collect()
}

/// Area (m2) of the convex hull of points in a plane (Andrew's monotone chain, 1979).
fn hull_area(mut points: Vec<[f64; 2]>) -> f64 {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let turn = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let chain = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut hull: Vec<[f64; 2]> = Vec::new();
        for p in points {
            while hull.len() > 1 && turn(hull[hull.len() - 2], hull[hull.len() - 1], p) <= 0.0 {
                hull.pop();
            }
            hull.push(p);
        }
        hull.pop();
        hull
    };
    let mut hull = chain(&mut points.iter().copied());
    hull.extend(chain(&mut points.iter().rev().copied()));
    let of_edge = |k: usize| {
        let (a, b) = (hull[k], hull[(k + 1) % hull.len()]);
        0.5 * (a[0] * b[1] - a[1] * b[0])
    };
    (0..hull.len()).map(of_edge).sum()
}

/// Adds the contacts of plies with all sheets that are not their neighbours in the stack, and those in which nodes of a lower ply or film hold cells
/// of an upper one. `sheets`: of the whole stack, from the tool upwards, of a model that is still flat.
///
/// # Errors
/// When a friction coefficient is missing or makes no sense.
pub fn add_contacts_past(
    model: &mut Model,
    stack: &[StackSheet],
    sheets: &[Layer<'_>],
    friction: &FrictionTable<'_>,
    p: &Parameters,
) -> Result<(), String> {
    let is_ply = |k: usize| stack[k].scene.kind == SheetKind::Ply;
    let law =
        |model: &Model, from: usize, to: usize, slave: usize| -> Result<FrictionLaw, String> {
            let chain: Vec<&str> = (from..=to).map(|k| stack[k].scene.name.as_str()).collect();
            friction.past(model, &chain, &stack[slave].scene.name)
        };
    let add =
        |model: &mut Model, slave: Layer<'_>, master: Layer<'_>, side: f64| -> Result<(), String> {
            let (from, to) = (slave.0.min(master.0), slave.0.max(master.0));
            let mu = law(model, from, to, slave.0)?;
            let on = (master.0, master.1);
            assembly::add_sheet_contact(model, stack, (slave.0, slave.2), on, side, mu, p);
            let contact = model.sheet_contacts_mut().last_mut().expect("just added");
            // What lies between holds them apart but at its edges, where all may touch for a moment.
            (contact.share, contact.counted) = (0.5, 0.0);
            Ok(())
        };
    for (upper, sheet) in sheets.iter().enumerate() {
        for (lower, below) in sheets.iter().enumerate().take(upper) {
            // Neighbours have theirs.
            if upper - lower == 1 {
                continue;
            }
            match (is_ply(lower), is_ply(upper)) {
                (_, true) => add(model, *sheet, *below, 1.0)?,
                (true, false) => add(model, *below, *sheet, -1.0)?,
                (false, false) => {}
            }
        }
    }
    for (upper, sheet) in sheets.iter().enumerate() {
        for (lower, below) in sheets.iter().enumerate().take(upper) {
            if is_ply(lower) != is_ply(upper) {
                continue;
            }
            add(model, *below, *sheet, -1.0)?;
            let mut contact = model.sheet_contacts_mut().pop().expect("just added");
            contact.let_in = Some(if is_ply(lower) { LET_IN } else { FILMS_LET_IN });
            if !is_ply(lower) {
                // Where the films are joined they have the same nodes, which lie on cells of their own.
                let (from, to) = model.sheets()[sheet.1].cell_range;
                let of_both: HashSet<u32> =
                    model.cells()[from..to].iter().flatten().copied().collect();
                let (cells, x) = (model.cells(), model.x());
                let lies_over = |i: &SlaveItem| {
                    let [at, p] = [place(i, cells, x), x[i.node as usize]];
                    (at[0] - p[0]).abs().max((at[1] - p[1]).abs()) < 1e-6
                };
                (contact.items).retain(|i| !of_both.contains(&i.node) && lies_over(i));
            }
            model.add_sheet_contact(contact);
        }
    }
    Ok(())
}

/// Where on its cell a slave is nearest to.
fn place(item: &SlaveItem, cells: &[[u32; 4]], x: &[V]) -> V {
    let corners = cells[item.cell as usize].map(|n| x[n as usize]);
    let add = |sum: V, (w, p): (f64, V)| [0, 1, 2].map(|c| sum[c] + w * p[c]);
    item.weights().into_iter().zip(corners).fold([0.0; 3], add)
}

/// Share of the distance of two plies by which nodes of the lower one may reach into cells of the upper one before these are held off, besides what
/// the straight cells of both cut off where they are curved.
///
/// The nodes of the upper one, which lie on the lower one, carry what presses the two together. Held at the same distance the nodes of the lower
/// one would share in it, in shares that no physics gives, and where nodes lie on nodes a bag at rest trembles.
const LET_IN: f64 = 0.05;

/// The same share for films: these are only to be kept from crossing. How deep one is in the other beside the plies matters to nobody, and what catches
/// there puts work in (`docs/decisions/0050-what-slides-off-an-edge.md`).
const FILMS_LET_IN: f64 = 0.25;

/// A rigid part as the sheets of a stack meet it.
pub struct RigidPart {
    /// Its name.
    pub name: &'static str,
    /// Its surface.
    pub surface: Arc<dyn RigidSurface>,
    /// Whether it lies above the stack.
    pub above: bool,
    /// Place in the stack of the film that lies between it and all plies everywhere.
    pub film: Option<usize>,
    /// Whether it moves.
    pub moves: bool,
}

/// Adds the contacts of a ply with a rigid part: of what faces the part it rubs on it; elsewhere its nodes stay outside of the part where the chords
/// of other sheets' elements cut through its fillets. `among`: the plies between the two. Nodes that lie on all of these are held at the
/// distance of their thicknesses; all nodes, at that of what lies there in any case. To be called when the contacts of the plies with each other
/// are there.
///
/// # Errors
/// When a friction coefficient is missing or makes no sense.
pub fn add_rigid_contacts(
    model: &mut Model,
    stack: &[StackSheet],
    part: &RigidPart,
    (ply, _, nodes): Layer<'_>,
    among: Range<usize>,
    friction: &FrictionTable<'_>,
    p: &Parameters,
) -> Result<(), String> {
    let own = stack[ply].scene.name.as_str();
    let of = |k: &usize| stack[*k].scene.name.as_str();
    let make = |model: &Model, between: &[usize], name: String| -> Result<RigidContact, String> {
        let mut chain: Vec<&str> = std::iter::once(part.name)
            .chain(between.iter().map(of))
            .chain([own])
            .collect();
        let between: Vec<&StackSheet> = between.iter().map(|k| &stack[*k]).collect();
        if part.above {
            chain.reverse();
        }
        let mut contact = RigidContact::new(
            name,
            part.surface.clone(),
            offset_over(&between, &stack[ply]),
            friction.through(model, &chain, own)?,
            &assembly::contact_settings(p),
            nodes.iter().map(|n| RigidItem::new(*n)).collect(),
        )
        .with_slack(penetration::slack_through(&between));
        contact.moves = part.moves;
        Ok(contact)
    };
    let film: Vec<usize> = part.film.into_iter().collect();
    let mut all: Vec<usize> = film.iter().copied().chain(among.clone()).collect();
    if part.above {
        all.reverse();
    }
    let name = format!("{}/{own}", part.name);
    let mut contact = make(model, &all, name.clone())?;
    let side = if part.above { -1.0 } else { 1.0 };
    for other in among.clone() {
        let other = format!("{}/{own}", stack[other].scene.name);
        let of_both =
            |c: &SheetContact| c.name == other && c.side == side && c.items.len() == nodes.len();
        let found = model.sheet_contacts().iter().position(of_both);
        contact.through.extend(found);
    }
    debug_assert!(contact.through.len() == among.len());
    model.add_rigid_contact(contact);
    if !among.is_empty() {
        let name = name + &beside(stack, among);
        let mut contact = make(model, &film, name)?;
        (contact.share, contact.counted) = (0.5, 0.0);
        model.add_rigid_contact(contact);
    }
    Ok(())
}
