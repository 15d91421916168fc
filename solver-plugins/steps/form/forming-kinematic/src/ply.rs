//! A ply of the scene: its place in the stack, its fibres, its mesh, and that mesh laid on the net.

use crate::net::{Net, Node, Stop};
use crate::surface::DrapeSurface;
use plyflow_blank::Blank;
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{Vec3, add, scale, sub};
use plyflow_mechanics::mesh::QuadMesh;
use plyflow_model::artifact::MeshQuality;
use plyflow_model::material::{Material, MaterialEntry};
use plyflow_model::rules;
use plyflow_model::scene::{Scene, Sheet, SheetKind};

/// A ply with its place in the stack.
#[derive(Debug, Clone)]
pub struct Ply {
    /// The scene's words.
    pub scene: Sheet,
    /// Its material.
    pub material: Material,
    /// Distance of its mid-plane from the tool when all sheets lie on it (m).
    pub offset: f64,
    /// Its shape before forming.
    pub blank: Blank,
    /// Directions of its fibre families (rad, from x).
    pub fibres: [f64; 2],
}

/// The plies of a scene from the tool upwards; films count with their thickness.
///
/// # Errors
/// When the scene breaks a rule ([`rules::check`]).
pub fn plies(scene: &Scene) -> Result<Vec<Ply>, String> {
    rules::check(scene).map_err(|fault| format!("scene.{fault}"))?;
    let mut below = 0.0;
    let mut found = Vec::new();
    for (k, sheet) in scene.sheets.iter().enumerate() {
        let MaterialEntry::Inline(material) = &sheet.material else {
            return Err(format!(
                "the material of sheet '{}' was not read in",
                sheet.name
            ));
        };
        let thickness = material.thickness.si();
        let offset = below + 0.5 * thickness;
        below += thickness;
        if sheet.kind != SheetKind::Ply {
            continue;
        }
        // Threads at even distances, as a net has them, lie along curves nowhere but on a surface that curves as much.
        let fibres = sheet.fibres().ok_or_else(|| {
            format!(
                "scene.sheets[{k}].fibre_1: the fibres of ply '{}' are steered; expected one direction, as a pin-jointed net of threads at even distances \
                 cannot be laid along curves (forming-explicit forms steered plies)",
                sheet.name
            )
        })?;
        let ply = Ply {
            fibres,
            scene: sheet.clone(),
            material: (**material).clone(),
            offset,
            blank: Blank::new(sheet).map_err(|e| e.to_string())?,
        };
        found.push(ply);
    }
    Ok(found)
}

impl Ply {
    /// Directions of the net (rad), the second counter-clockwise of the first by less than half a turn: the
    /// families in the order of the scene, or the other way round, so that the stitch still lies between them.
    pub fn directions(&self) -> [f64; 2] {
        use std::f64::consts::TAU;
        let [first, second] = self.fibres;
        let (a, b) = if (second - first).fixed_sin() >= 0.0 {
            (first, second)
        } else {
            (second, first)
        };
        [a, a + (b - a).rem_euclid(TAU)]
    }

    /// The mesh of the flat ply, as `forming-explicit` makes it.
    ///
    /// # Errors
    /// When the elements cannot follow its outline.
    pub fn mesh(&self, element_size: f64) -> Result<(QuadMesh, Option<MeshQuality>), String> {
        let mesh = self.blank.mesh(element_size);
        mesh.map_err(|e| format!("ply '{}': {e}", self.scene.name))
    }
}

/// A ply's mesh laid on its net.
#[derive(Debug, Clone, Default)]
pub struct Draped {
    /// Positions (m).
    pub points: Vec<Vec3>,
    /// Per cell: shear angle (rad) of the net at its centre; 0 where the net does not reach all of it.
    pub shear: Vec<f64>,
    /// Per cell: whether the net reaches all of it.
    pub reached: Vec<bool>,
    /// Per cell that is not reached: why the net stopped there, or before; `None` also where no node of the net near by tells.
    pub stopped: Vec<Option<Stop>>,
}

/// What stopped a net, by reason: nodes and the first of them in the flat ply (m).
pub type Stops = Vec<(Stop, usize, [f64; 2])>;

/// Counts the nodes that could not be placed, by reason.
pub fn stops(net: &Net) -> Stops {
    let mut found: Stops = Vec::new();
    for (at, node) in net.nodes() {
        if let Node::Stopped(why) = node {
            match found.iter_mut().find(|f| f.0 == why) {
                Some(f) => f.1 += 1,
                None => found.push((why, 1, net.flat(at))),
            }
        }
    }
    found.sort_unstable_by_key(|f| f.0);
    found
}

/// Lays the mesh on the net: bilinear in the net's cells, then back onto the surface along its normal. What the net does
/// not reach hangs on in the plane of the nearest whole cell, not below `offset` over the `bed` (m). `None`
/// when no cell of the net is whole.
pub fn lay(net: &Net, mesh: &QuadMesh, surface: &dyn DrapeSurface, offset: f64) -> Option<Draped> {
    let bed = net.fabric.bed;
    let whole = rim(net);
    if whole.is_empty() {
        return None;
    }
    let mut draped = Draped::default();
    let mut on_net = Vec::with_capacity(mesh.points.len());
    for p in &mesh.points {
        let at = net.coordinates([p[0], p[1]]);
        let found = inside(net, at).map(|x| onto(surface, x, offset));
        on_net.push(found.is_some());
        draped.points.push(found.unwrap_or_else(|| {
            let mut x = beyond(net, nearest(&whole, at), at);
            x[2] = x[2].max(bed + offset);
            x
        }));
    }
    for cell in &mesh.cells {
        let centre = [0, 1].map(|d| {
            cell.iter()
                .map(|n| mesh.points[*n as usize][d])
                .sum::<f64>()
                / 4.0
        });
        let at = net.coordinates(centre);
        let shear = shear_at(net, at);
        let reached = shear.is_some() && cell.iter().all(|n| on_net[*n as usize]);
        draped.shear.push(shear.filter(|_| reached).unwrap_or(0.0));
        draped.reached.push(reached);
        let corners = cell.iter().map(|n| {
            let p = mesh.points[*n as usize];
            net.coordinates([p[0], p[1]])
        });
        let places = corners.chain([at]);
        let stop = places.filter_map(|at| stop_at(net, at)).min();
        draped.stopped.push(stop.filter(|_| !reached));
    }
    Some(draped)
}

/// The first reason (in the order of [`Stop`]) that the nodes around a place of the net have for not being placed.
fn stop_at(net: &Net, at: [f64; 2]) -> Option<Stop> {
    let [i, j] = at.map(|v| v.floor() as i32);
    let around = crate::net::corners([i, j]).into_iter();
    around.filter_map(|c| net.node(c).stop()).min()
}

/// Position at a place of the net (in steps of it), when it lies in a whole cell.
fn inside(net: &Net, at: [f64; 2]) -> Option<Vec3> {
    /// A place this near to a line of the net also lies in the cell beyond.
    const NEAR: f64 = 1e-5;
    let choices = at.map(|v| {
        let low = v.floor();
        let part = v - low;
        let other = if part < NEAR {
            low - 1.0
        } else if part > 1.0 - NEAR {
            low + 1.0
        } else {
            low
        };
        [low as i32, other as i32]
    });
    for j in choices[1] {
        for i in choices[0] {
            if net.shear([i, j]).is_some() {
                return Some(beyond(net, [i, j], at));
            }
        }
    }
    None
}

/// Bilinear continuation of a whole cell: inside it the surface patch between its nodes, outside its tangent plane at
/// the centre.
fn beyond(net: &Net, cell: [i32; 2], at: [f64; 2]) -> Vec3 {
    let x = crate::net::corners(cell).map(|c| net.position(c).expect("a whole cell"));
    let (s, t) = (at[0] - f64::from(cell[0]), at[1] - f64::from(cell[1]));
    let sum = |w: [f64; 4]| (0..4).fold([0.0; 3], |sum, k| add(sum, scale(x[k], w[k])));
    let held = |v: f64| (-0.01..=1.01).contains(&v);
    if held(s) && held(t) {
        return sum([(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t]);
    }
    let (p, q) = (0.5 * (s - 0.5), 0.5 * (t - 0.5));
    sum([0.25 - p - q, 0.25 + p - q, 0.25 + p + q, 0.25 - p + q])
}

/// Whole cells with a side where the net ends: the nearest cell to what is not reached is one of them.
fn rim(net: &Net) -> Vec<[i32; 2]> {
    let inner = |[i, j]: [i32; 2]| {
        let sides = [[i - 1, j], [i + 1, j], [i, j - 1], [i, j + 1]];
        sides.iter().all(|c| net.shear(*c).is_some())
    };
    net.nodes()
        .map(|(at, _)| at)
        .filter(|at| net.shear(*at).is_some() && !inner(*at))
        .collect()
}

fn onto(surface: &dyn DrapeSurface, mut x: Vec3, offset: f64) -> Vec3 {
    let first = x;
    for _ in 0..20 {
        let Some((level, normal)) = surface.level(x, offset) else {
            return first;
        };
        x = sub(x, scale(normal, level));
        if level.abs() < 1e-13 {
            break;
        }
    }
    x
}

/// Shear angle (rad) at a place of the net: bilinear between the centres of the whole cells around it.
fn shear_at(net: &Net, at: [f64; 2]) -> Option<f64> {
    let low = at.map(|v| (v - 0.5).floor());
    let (mut sum, mut weight) = (0.0, 0.0);
    for b in 0..2 {
        for a in 0..2 {
            let cell = [low[0] + f64::from(a), low[1] + f64::from(b)];
            let w = (0..2).fold(1.0, |w, d| {
                w * (1.0 - (at[d] - cell[d] - 0.5).abs()).max(0.0)
            });
            if let Some(shear) = net.shear(cell.map(|v| v as i32)).filter(|_| w > 0.0) {
                sum += w * shear;
                weight += w;
            }
        }
    }
    (weight > 0.0).then(|| sum / weight)
}

fn nearest(whole: &[[i32; 2]], at: [f64; 2]) -> [i32; 2] {
    let away = |cell: &[i32; 2]| {
        let d = [0, 1].map(|k| f64::from(cell[k]) + 0.5 - at[k]);
        d[0] * d[0] + d[1] * d[1]
    };
    // The first of equally near ones.
    let mut best = whole[0];
    for other in &whole[1..] {
        if away(other) < away(&best) {
            best = *other;
        }
    }
    best
}
