//! What global and local runs share: checking the stack, making components, stacking the contacts.

use crate::cover::{self, Layer};
use crate::elements;
use crate::friction::{FrictionTable, Touching};
use crate::parameters::Parameters;
use crate::regions;
use crate::run::Body;
use crate::symmetry::{self, Families, MirroredBody};
use crate::tool::ToolSurfaces;
use plyflow_abi::pf_component;
use plyflow_blank::Blank;
use plyflow_fixed::FixedBits;
use plyflow_mechanics::contact::{
    ContactSettings, FoldSpec, FrictionLaw, Plane, RigidContact, RigidItem, RigidSurface,
    SheetContact, SlaveItem,
};
use plyflow_mechanics::mesh::NONE;
use plyflow_mechanics::mirror::{Mirrors, Planes, Whole};
use plyflow_mechanics::model::{Model, StepSettings};
use plyflow_mechanics::sheet::{Pressed, SheetSpec};
use plyflow_mechanics::vec3::V;
use plyflow_model::material::{Material, MaterialEntry};
use plyflow_model::rules;
use plyflow_model::scene::{Scene, Sheet, SheetKind, first_axis};
use std::sync::Arc;

/// Least distance of the mid-surfaces of two bare films in contact (m). They are 0.08 mm thick; at so small a
/// distance the direction from one film's facets to the other's nodes turns by a large angle over a few
/// micrometres in every fold, which explicit steps cannot follow. Where no ply lies between the films, 0.2 mm
/// more or less between them changes nothing.
pub const LEAST_FILM_DISTANCE: f64 = 3e-4;

/// Finds components: the host, or a test.
pub trait Components {
    /// The element formulation of that name.
    ///
    /// # Errors
    /// When there is none.
    fn element(&self, name: &str) -> Result<pf_component, String>;
    /// The material of that name.
    ///
    /// # Errors
    /// When there is none.
    fn material(&self, name: &str) -> Result<pf_component, String>;
}

/// A sheet of the stack with what the contacts and the output need.
#[derive(Debug, Clone)]
pub struct StackSheet {
    /// The scene's words.
    pub scene: Sheet,
    /// Its material.
    pub material: Material,
    /// Thickness (m).
    pub thickness: f64,
    /// Distance of its mid-plane from the tool surface when the stack is compact (m).
    pub offset: f64,
}

/// The stack of a scene, bottom to top, with offsets.
///
/// # Errors
/// When the scene breaks a rule ([`rules::check`]), or has fibres that the solver cannot compute.
pub fn stack(scene: &Scene) -> Result<Vec<StackSheet>, String> {
    rules::check(scene).map_err(|fault| format!("scene.{fault}"))?;
    let mut stack = scene
        .sheets
        .iter()
        .map(|sheet| {
            check_sheet(sheet)?;
            let MaterialEntry::Inline(material) = &sheet.material else {
                return Err(format!(
                    "the material of sheet '{}' was not read in",
                    sheet.name
                ));
            };
            Ok(StackSheet {
                scene: sheet.clone(),
                material: (**material).clone(),
                thickness: material.thickness.si(),
                offset: 0.0,
            })
        })
        .collect::<Result<Vec<_>, String>>()?;
    lay(&mut stack);
    Ok(stack)
}

/// Lays sheets one on the other, from the tool upwards: their offsets.
pub fn lay(stack: &mut [StackSheet]) {
    let mut below = 0.0;
    for sheet in stack {
        sheet.offset = below + 0.5 * sheet.thickness;
        below += sheet.thickness;
    }
}

/// How far (rad) the angle between the fibre families may be from a right one: rounding of angles that are written in degrees.
const SQUARE: f64 = 1e-6;

/// Whether the solver can compute a sheet as the scene has it.
fn check_sheet(sheet: &Sheet) -> Result<(), String> {
    if let (SheetKind::Ply, Some(second)) = (sheet.kind, sheet.fibre_2) {
        let degrees = |angle: f64| (1e6 * angle.to_degrees()).round() / 1e6;
        let between = second.si() - sheet.fibre_1.si();
        if between.fixed_cos().abs() > SQUARE {
            return Err(format!(
                "ply '{}': given fibres at {} and {} deg; expected families that cross at a right angle before forming, such as -45 and 45 deg: \
                 elements and material laws of forming-explicit measure shear from there. (forming-kinematic drapes other angles too)",
                sheet.name,
                degrees(sheet.fibre_1.si()),
                degrees(second.si())
            ));
        }
    }
    Ok(())
}

/// Constants of all contacts.
pub fn contact_settings(p: &Parameters) -> ContactSettings {
    ContactSettings {
        stiffness_factor: p.contact_stiffness,
        slip_factor: p.slip_stiffness,
        damping_ratio: p.contact_damping,
        augmentation: p.contact_augmentation,
    }
}

/// Adds the contact of slaves (their place in the stack, their nodes) on a master (its place,
/// its sheet's number). `side` 1: the slaves lie above.
pub fn add_sheet_contact(
    model: &mut Model,
    stack: &[StackSheet],
    (slave, nodes): (usize, &[u32]),
    (master, index): (usize, usize),
    side: f64,
    friction: FrictionLaw,
    p: &Parameters,
) {
    let touching = 0.5 * (stack[slave].thickness + stack[master].thickness);
    let films = [slave, master]
        .iter()
        .all(|k| stack[*k].scene.kind == SheetKind::Diaphragm);
    let offset = if films {
        touching.max(LEAST_FILM_DISTANCE)
    } else {
        touching
    };
    let items = locate(model, index, nodes);
    let name = format!("{}/{}", stack[master].scene.name, stack[slave].scene.name);
    let settings = contact_settings(p);
    let mut contact = SheetContact::new(name, side, offset, friction, &settings, items);
    contact.rim = cover::crooked_rim(model, index);
    model.sheet_contacts.push(contact);
}

/// Adds the contact of a ply (its place in the stack, its sheet's number, its nodes that may be slaves) with itself,
/// unless `self_contact` is off. The model must still be as it starts, with the plies flat. Where the scene has no
/// coefficient for fabric on fabric it is without friction: few plies fold, and a scene of one ply need not give it.
///
/// # Errors
/// When the law of friction makes no sense.
pub fn add_self_contact(
    model: &mut Model,
    stack: &[StackSheet],
    (ply, index): (usize, usize),
    slaves: &[u32],
    p: &Parameters,
) -> Result<(), String> {
    let (first, end) = model.sheets[index].cell_range;
    if !p.self_contact || first == end {
        return Ok(());
    }
    let mut slaves = slaves.to_vec();
    slaves.sort_unstable();
    let name = &stack[ply].scene.name;
    let friction = if p.scene.friction.fabric_fabric.is_some() {
        let touching = Touching {
            parts: [name, name],
            slave: name,
        };
        FrictionTable::new(&p.scene)?.law(model, &touching)?
    } else {
        0.0.into()
    };
    let spec = FoldSpec {
        name: format!("{name}/{name}"),
        slaves,
        cell_range: model.sheets[index].cell_range,
        thickness: stack[ply].thickness,
        friction,
        undeformed: model.start().clone(),
    };
    model.add_self_contact(spec, &contact_settings(p));
    Ok(())
}

/// The blank of a ply before forming.
///
/// # Errors
/// When the scene gives no size, or an outline that is none.
pub fn blank(sheet: &StackSheet) -> Result<Blank, String> {
    Blank::new(&sheet.scene).map_err(|e| e.to_string())
}

/// The part of a ply's blank that mirror planes bound: all of it without planes.
///
/// # Errors
/// As [`blank`]; when it is not its own mirror image.
pub fn blank_part(sheet: &StackSheet, planes: Planes) -> Result<Blank, String> {
    let part = blank(sheet)?.part(planes);
    part.map_err(|e| format!("ply '{}': {e}", sheet.scene.name))
}

/// Adds a ply (its place in the stack, which is that in the model too) at height `z` (m) to the points of a model: its
/// sheet and its body. `blank` is its part between the planes of `mirrors`.
///
/// # Errors
/// A text for the user when its blank cannot be meshed, its element cannot be made, or it is not its own mirror image.
pub fn add_ply(
    points: &mut Vec<V>,
    mirrors: &mut Mirrors,
    blank: &Blank,
    z: f64,
    (index, sheet): (usize, &StackSheet),
    p: &Parameters,
    components: &dyn Components,
) -> Result<(SheetSpec, Body), String> {
    let name = &sheet.scene.name;
    let (mut mesh, quality) =
        (blank.mesh(p.element_size)).map_err(|e| format!("ply '{name}': {e}"))?;
    // A mesh that follows an outline may leave rounding there; nodes of a plane are those that are exactly on it.
    for c in mesh.points.iter_mut().flat_map(|q| (0..2).zip(q)) {
        if mirrors.planes.0[c.0] && c.1.abs() < 1e-9 {
            *c.1 = 0.0;
        }
    }
    let first = points.len() as u32;
    points.extend(mesh.points.iter().map(|q| [q[0], q[1], z]));
    regions::check(&sheet.scene, &mesh.points, &mesh.cells, mirrors.planes)?;
    let element = elements::of_ply(components, sheet, &p.element)?;
    let flat = (&mesh.points[..], &mesh.cells[..]);
    let other_material = regions::unstitched(components, sheet, flat, &element, p)?;
    symmetry::check_material(&element, sheet, mirrors.planes)?;
    let elsewhere = elements::elsewhere(components, sheet, &element, &mesh, mirrors.planes, p)?;
    let body = Body {
        quality,
        ..body(sheet, index, &mesh.points, &mesh.cells, mirrors.planes)?
    };
    let mut nodes = (first..points.len() as u32).collect();
    let bending = elements::bending_part(&mesh, elsewhere.as_ref());
    let patches = elements::patches(points, &mut nodes, &bending, &element, mirrors);
    if elsewhere.is_none() && element.sizes.patch_nodes > 0 && patches.is_empty() {
        let [x0, y0, x1, y1] = blank.bounds();
        return Err(format!(
            "element: given '{}', which bends about the nodes inside of a ply, and ply '{name}' of {:.1} x {:.1} mm has none in elements of {:.1} mm: it would not \
             bend. Expected two elements across it at least: an `element_size` of {:.1} mm or less, or an element with rotations such as s4",
            p.element.plugin,
            1e3 * (x1 - x0),
            1e3 * (y1 - y0),
            1e3 * p.element_size,
            1e3 * 0.5 * (x1 - x0).min(y1 - y0)
        ));
    }
    let spec = SheetSpec {
        name: name.clone(),
        nodes,
        layers: vec![1.0; mesh.cells.len()],
        pressed: vec![Pressed::No; mesh.cells.len()],
        patches,
        least_areal_mass: vec![p.least_areal_mass; mesh.cells.len()],
        cells: mesh.cells,
        axis: axis(&sheet.scene),
        element,
        elsewhere,
        other_material,
    };
    Ok((spec, body))
}

/// Direction of material axis e1 in the undeformed plane.
pub fn axis(sheet: &Sheet) -> V {
    let first = sheet.fibre_1.si();
    let square = || first + std::f64::consts::FRAC_PI_2;
    let e1 = first_axis(first, sheet.fibre_2.map_or_else(square, |a| a.si()));
    [e1.fixed_cos(), e1.fixed_sin(), 0.0]
}

/// Settings of the time integration.
pub fn step_settings(p: &Parameters) -> StepSettings {
    StepSettings {
        target_step: p.time_step,
        safety: p.step_safety,
        damping: p.damping,
    }
}

/// What to tell where contacts' multipliers grow more slowly than asked for.
pub(crate) fn slower_multipliers(model: &Model, p: &Parameters) -> Option<String> {
    let (asked, taken) = (p.contact_augmentation, model.contact_augmentation());
    if taken <= 0.0 && asked > 0.0 {
        return Some(format!(
            "contact_augmentation is 0 instead of {asked:.2e}: without damping of contacts (contact_damping: {}) multipliers would feed every \
             motion, so pressure is borne by the penalty alone, at larger penetrations",
            p.contact_damping
        ));
    }
    (taken > 0.0 && taken < asked).then(|| {
        format!(
            "contact_augmentation is {taken:.2e} instead of {asked:.2e}: some sheets have far more mass in a node than those they touch, \
             and would tremble"
        )
    })
}

/// A sheet placed in a model, as the contacts see it.
pub struct Placed {
    /// Index in [`Model::sheets`].
    pub index: usize,
    /// Model nodes that may be slaves (not driven, not shared with the master).
    pub slaves: Vec<u32>,
}

/// Sets up all contacts of the stack. `placed` is in stack order (first and last are the films);
/// `tool` may be absent (a scene whose zone lies off the tool).
///
/// # Errors
/// When a friction coefficient is missing or makes no sense.
pub fn add_contacts(
    model: &mut Model,
    stack: &[StackSheet],
    placed: &[Placed],
    scene: &Scene,
    p: &Parameters,
    tool: &mut ToolSurfaces,
) -> Result<(), String> {
    let friction = FrictionTable::new(scene)?;
    let top = placed.len() - 1;
    let rigid = |name: String, surface, mu: FrictionLaw, offset: f64, nodes: &[u32]| {
        let items = nodes.iter().map(|n| RigidItem::new(*n)).collect();
        RigidContact::new(name, surface, offset, mu, &contact_settings(p), items)
    };
    let bottom = stack[0].scene.name.as_str();
    let under = |model: &Model, part: &str| {
        let touching = Touching {
            parts: [part, bottom],
            slave: bottom,
        };
        friction.law(model, &touching)
    };
    let bed: Arc<dyn RigidSurface> = Arc::new(Plane { height: 0.0 });
    let name = |what: &str, k: usize| format!("{what}/{}", stack[k].scene.name);
    for (part, surface) in [("tool", tool.of(model, placed[0].index)), ("bed", bed)] {
        let mu = under(model, part)?;
        let (offset, nodes) = (stack[0].offset, &placed[0].slaves);
        model
            .rigid_contacts
            .push(rigid(name(part, 0), surface, mu, offset, nodes));
    }
    let mut pair = |slave: usize, nodes: &[u32], master: usize, side: f64| -> Result<(), String> {
        let on = (master, placed[master].index);
        let of = |k: usize| stack[k].scene.name.as_str();
        let touching = Touching {
            parts: [of(slave.min(master)), of(slave.max(master))],
            slave: of(slave),
        };
        let mu = friction.law(model, &touching)?;
        add_sheet_contact(model, stack, (slave, nodes), on, side, mu, p);
        Ok(())
    };
    let slaves = |k: usize| &placed[k].slaves[..];
    for k in 1..top {
        pair(k, slaves(k), k - 1, 1.0)?;
    }
    // The plies' nodes are the slaves of both films: the two films have the same mesh, so whatever unevenness
    // node-to-surface contact makes of a uniform pressure is the same above and below, and cancels. With the
    // film above as the slave of the ply it does not, and the evacuated stack waves (tried).
    if top > 1 {
        pair(top - 1, slaves(top - 1), top, -1.0)?;
    }
    pair(top, slaves(top), 0, 1.0)?;
    let sheets: Vec<Layer<'_>> = (placed.iter().enumerate())
        .map(|(k, sheet)| (k, sheet.index, &sheet.slaves[..]))
        .collect();
    cover::add_contacts_past(model, stack, &sheets, &friction, p)?;
    for k in 1..top {
        let surface = tool.of(model, placed[k].index);
        let part = cover::RigidPart {
            name: "tool",
            surface,
            above: false,
            film: Some(0),
            moves: false,
        };
        cover::add_rigid_contacts(model, stack, &part, sheets[k], 1..k, &friction, p)?;
    }
    // The upper film lies on the cells of the lower one, whose chords cut the tool's edges.
    let part = cover::RigidPart {
        name: "tool",
        surface: tool.of(model, placed[top].index),
        above: false,
        film: Some(0),
        moves: false,
    };
    cover::add_rigid_contacts(model, stack, &part, sheets[top], 0..0, &friction, p)?;
    let contact = model.rigid_contacts.last_mut().expect("just added");
    (contact.share, contact.counted) = (0.5, 0.0);
    for (k, ply) in placed.iter().enumerate().take(top).skip(1) {
        add_self_contact(model, stack, (k, ply.index), &ply.slaves, p)?;
    }
    model.set_contact_stiffness(&contact_settings(p));
    Ok(())
}

/// Places slaves on the master in the undeformed plane. A slave beyond the master's edge gets the nearest
/// cell: it is in touch once it slides onto it.
fn locate(model: &Model, master: usize, slaves: &[u32]) -> Vec<SlaveItem> {
    let (c0, c1) = model.sheets[master].cell_range;
    if c0 == c1 {
        return slaves
            .iter()
            .map(|n| SlaveItem::new(*n, NONE, [0.0; 2]))
            .collect();
    }
    let cells = &model.cells[c0..c1];
    let corners: Vec<[V; 4]> = (cells.iter().map(|c| c.map(|n| model.x[n as usize]))).collect();
    let bins = Bins::of_cells(&corners);
    slaves
        .iter()
        .map(|n| {
            let p = model.x[*n as usize];
            let inside = bins.near(p).iter().find_map(|c| {
                let xi = inverse_bilinear(corners[*c as usize], p)?;
                (xi[0].abs() <= 1.0 + 1e-9 && xi[1].abs() <= 1.0 + 1e-9).then_some((*c, xi))
            });
            let (cell, xi) = inside.unwrap_or_else(|| (bins.nearest(p), [0.0; 2]));
            SlaveItem::new(*n, cell + c0 as u32, xi)
        })
        .collect()
}

/// Local coordinates of a point in the plane of a quad seen from above.
pub fn inverse_bilinear(q: [V; 4], p: V) -> Option<[f64; 2]> {
    let mut xi = [0.0f64; 2];
    for _ in 0..20 {
        let w = plyflow_mechanics::contact::shape(xi);
        let (a, b) = (0.25 * (1.0 - xi[1]), 0.25 * (1.0 + xi[1]));
        let (c, d) = (0.25 * (1.0 - xi[0]), 0.25 * (1.0 + xi[0]));
        let (wx, wy) = ([-a, a, b, -b], [-c, -d, d, c]);
        let sum = |w: [f64; 4], k: usize| (0..4).map(|i| w[i] * q[i][k]).sum::<f64>();
        let r = [p[0] - sum(w, 0), p[1] - sum(w, 1)];
        let (j11, j12, j21, j22) = (sum(wx, 0), sum(wy, 0), sum(wx, 1), sum(wy, 1));
        let det = j11 * j22 - j12 * j21;
        if det.abs() < 1e-300 {
            return None;
        }
        let step = [
            (r[0] * j22 - r[1] * j12) / det,
            (j11 * r[1] - j21 * r[0]) / det,
        ];
        xi = [xi[0] + step[0], xi[1] + step[1]];
        if step[0].abs() + step[1].abs() < 1e-13 {
            return Some(xi);
        }
    }
    Some(xi)
}

/// Cell centres sorted into square bins.
pub(crate) struct Bins {
    centres: Vec<[f64; 2]>,
    lo: [f64; 2],
    size: f64,
    shape: [usize; 2],
    cells: Vec<Vec<u32>>,
}

impl Bins {
    /// Of quads seen from above.
    pub(crate) fn of_cells(corners: &[[V; 4]]) -> Self {
        let centre = |p: &[V; 4]| [0, 1].map(|k| 0.25 * (p[0][k] + p[1][k] + p[2][k] + p[3][k]));
        Self::new(corners.iter().map(centre).collect())
    }

    fn new(centres: Vec<[f64; 2]>) -> Self {
        let (mut lo, mut hi) = ([f64::MAX; 2], [f64::MIN; 2]);
        for c in &centres {
            for k in 0..2 {
                lo[k] = lo[k].min(c[k]);
                hi[k] = hi[k].max(c[k]);
            }
        }
        let area = ((hi[0] - lo[0]) * (hi[1] - lo[1])).max(1e-12);
        // About four cells a bin.
        let size = 2.0 * (area / centres.len() as f64).sqrt();
        let shape = [0, 1].map(|k| ((hi[k] - lo[k]) / size) as usize + 1);
        let mut bins = Self {
            centres,
            lo,
            size,
            shape,
            cells: vec![Vec::new(); shape[0] * shape[1]],
        };
        for c in 0..bins.centres.len() {
            let [i, j] = bins.bin(bins.centres[c]);
            bins.cells[j * bins.shape[0] + i].push(c as u32);
        }
        bins
    }

    fn bin(&self, p: [f64; 2]) -> [usize; 2] {
        [0, 1].map(|k| {
            let i = ((p[k] - self.lo[k]) / self.size).max(0.0) as usize;
            i.min(self.shape[k] - 1)
        })
    }

    /// Cells around a place.
    pub(crate) fn near(&self, p: V) -> Vec<u32> {
        let [i, j] = self.bin([p[0], p[1]]);
        let mut found = Vec::new();
        for b in j.saturating_sub(1)..(j + 2).min(self.shape[1]) {
            for a in i.saturating_sub(1)..(i + 2).min(self.shape[0]) {
                found.extend_from_slice(&self.cells[b * self.shape[0] + a]);
            }
        }
        // A graded mesh has cells larger than a bin: then look at all.
        if found.is_empty() {
            (0..self.centres.len() as u32).collect()
        } else {
            found
        }
    }

    fn nearest(&self, p: V) -> u32 {
        let d = |c: u32| {
            let q = self.centres[c as usize];
            (q[0] - p[0]).powi(2) + (q[1] - p[1]).powi(2)
        };
        (0..self.centres.len() as u32)
            .min_by(|a, b| d(*a).total_cmp(&d(*b)))
            .unwrap_or(NONE)
    }
}

/// The body of a sheet of the scene, number `index` of the model: of its part between mirror planes, which has the points
/// `points` (m) and `cells` in their numbers, and of its images.
///
/// # Errors
/// When its fibres lie askew to the planes.
pub fn body(
    sheet: &StackSheet,
    index: usize,
    points: &[V],
    cells: &[[u32; 4]],
    planes: Planes,
) -> Result<Body, String> {
    let mut body = Body::new(sheet, index, cells.to_vec());
    if planes.any() {
        let whole = Whole::new(points, cells, planes);
        body.cells.clone_from(&whole.cells);
        body.mirrored = Some(MirroredBody {
            whole,
            families: Families::of(sheet, planes)?,
        });
    }
    Ok(body)
}
