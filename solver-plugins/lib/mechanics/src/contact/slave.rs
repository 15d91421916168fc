//! One node of a sheet on another sheet: its state, its force in touch, and where that goes.

use super::blend::Pull;
use super::closest::{Closest, FACES, Found, RIM, Surface, combine, shape};
use super::friction::{Coulomb, Sliding};
use super::penalty::{ContactEnergy, Follow, grown, normal_force};
use crate::mesh::NONE;
use crate::mirror::{Image, reflect};
use crate::vec3::{Vec3, add, dot, norm, scale, sub, unit};
use serde::{Deserialize, Serialize};

/// A further cell of a concave fold or corner that a slave touches.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Face {
    /// Master cell (model numbering) or [`NONE`].
    pub(super) cell: u32,
    /// The mirror planes across which the slave touches it: its image.
    pub(super) image: Image,
    /// Place in the cell, -1..1.
    pub(super) xi: [f64; 2],
    /// Its share of the force (N).
    pub(super) force: Vec3,
}

impl Face {
    const NONE: Self = Self {
        cell: NONE,
        image: [false; 2],
        xi: [0.0; 2],
        force: [0.0; 3],
    };
}

/// One slave node. Kept small, since a step goes through those of all contacts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SlaveItem {
    /// Model node.
    pub node: u32,
    /// Master cell (model numbering) or [`NONE`].
    pub cell: u32,
    pub(super) turn: u8,
    /// The last search found one cell, on the slave's own side.
    pub(super) plain: bool,
    /// In touch in the last step.
    pub active: bool,
    /// Whether penetrations that no motion has brought about are ignored.
    pub(super) guarded: bool,
    /// Whether it touches several cells, of a concave fold or corner.
    between: bool,
    /// By how much nearer than the contact's distance it may come before it touches, in [`LET_IN`] of that
    /// ([`super::SheetContact::let_in`]).
    let_in: u16,
    /// Share of the contact's augmentation with which its multiplier follows penetrations, in [`WHOLE`]: less than all of a light node that a
    /// heavy sheet rides on ([`super::ContactSettings::largest_augmentation`]).
    pub(crate) follows: u8,
    /// Direction from master to slave at the last search.
    pub(super) direction: Vec3,
    /// Place in the cell, -1..1.
    pub xi: [f64; 2],
    /// Normal stiffness (N/m).
    pub stiffness: f64,
    /// Damping (N s/m).
    pub damping: f64,
    /// Multiplier: the steady part of the normal force (N).
    pub multiplier: f64,
    pub(super) work: f64,
    /// Friction force held by the slip spring (N).
    pub slip: Vec3,
    /// Force on the slave (N): minus this acts on the cells' nodes.
    pub force: Vec3,
    /// Of one that lies between several cells, those besides `cell`; the first without a cell ends them. Few ever do: the
    /// place for them is made when it is first needed, and kept.
    others: Option<Box<[Face; FACES]>>,
    /// Normal part of the force (N).
    pub normal_force: f64,
    /// Penetration (m), 0 when apart.
    pub penetration: f64,
    /// Part of it that no motion has brought about (m): it is left standing and pushes nothing ([`SlaveItem::admit`]).
    pub(super) ignored: f64,
}

impl SlaveItem {
    /// A node above (or below) a cell; stiffness and damping are set by the model.
    pub fn new(node: u32, cell: u32, xi: [f64; 2]) -> Self {
        Self {
            node,
            cell,
            // Spread over the nodes, so that every step searches for its share of them.
            turn: (node % u32::from(SEARCH_INTERVAL)) as u8,
            plain: false,
            active: false,
            guarded: false,
            between: false,
            let_in: 0,
            follows: WHOLE,
            direction: [0.0; 3],
            xi,
            stiffness: 0.0,
            damping: 0.0,
            multiplier: 0.0,
            work: 0.0,
            slip: [0.0; 3],
            force: [0.0; 3],
            others: None,
            normal_force: 0.0,
            penetration: 0.0,
            ignored: 0.0,
        }
    }

    /// Distance (m) at which it touches, where sheets touch at `offset`.
    #[inline(always)]
    pub(super) fn touching(&self, offset: f64) -> f64 {
        offset * (1.0 - LET_IN * f64::from(self.let_in))
    }

    /// Lets it come nearer by the share `base` of the distance `offset` (m) at which sheets touch, and by what the straight cells of both sheets
    /// cut off them where they are curved: by its own as much as by that which it is nearest to. At most by [`MOST_LET_IN`].
    #[inline(never)]
    pub(super) fn let_in(&mut self, s: &Surface<'_>, base: f64, offset: f64) {
        let share = base + 2.0 * bulge(s, self.cell, self.weights()) / offset;
        self.let_in = (share.min(MOST_LET_IN) / LET_IN) as u16;
    }

    /// Whether it lies in a concave fold or corner, between several cells.
    #[inline]
    pub(super) fn is_between(&self) -> bool {
        self.between
    }

    /// Whether the place of the master that it is nearest to is not past a rim, or by so little that the master is about as thick there as elsewhere
    /// ([`STILL_THICK`]).
    pub(super) fn lies_on_its_cell(&self) -> bool {
        self.cell != NONE && self.xi.iter().all(|x| x.abs() < 1.0 + STILL_THICK * RIM)
    }

    /// Share of the contact's augmentation with which its multiplier follows penetrations.
    #[inline(always)]
    pub fn follows(&self) -> f64 {
        f64::from(self.follows) / f64::from(WHOLE)
    }

    /// Weights of the cell's nodes.
    pub fn weights(&self) -> [f64; 4] {
        shape(self.xi)
    }

    /// The other cells that it touches.
    fn others(&self) -> impl Iterator<Item = &Face> {
        let others = self.others.iter().filter(|_| self.between);
        others.flat_map(|o| o.iter()).take_while(|o| o.cell != NONE)
    }

    pub(super) fn part(&mut self) {
        self.active = false;
        self.ignored = 0.0;
        self.plain = false;
        self.multiplier = 0.0;
        self.work = 0.0;
        self.between = false;
        self.slip = [0.0; 3];
        self.force = [0.0; 3];
        self.normal_force = 0.0;
        self.penetration = 0.0;
    }

    /// Lays the normal force (N) and the friction `along` (N) on the cells that pull.
    fn share_out(&mut self, pull: &Pull, found: &Found, normal: f64, along: Vec3) {
        let own = 1.0 - pull.shares.iter().sum::<f64>();
        self.force = add(scale(pull.first, normal), scale(along, own));
        let others = self
            .others
            .get_or_insert_with(|| Box::new([Face::NONE; FACES]));
        let mut count = 0;
        for (face, c) in found.others.iter().enumerate() {
            let share = pull.shares[face];
            let Some(c) = c.as_ref().filter(|_| share > 0.0) else {
                continue;
            };
            let force = add(scale(pull.others[face], normal), scale(along, share));
            self.force = add(self.force, force);
            others[count] = Face {
                cell: c.cell,
                image: c.image,
                xi: c.xi,
                force,
            };
            count += 1;
        }
        if count < FACES {
            others[count].cell = NONE;
        }
    }

    /// Takes note of a penetration `depth` (m, negative when apart) after a step `dt` (s) at the relative velocity
    /// `rel` (m/s), and gives the part of it that pushes.
    ///
    /// What motion cannot have brought about has come from the search: another face of a fold has become the
    /// closest one, or a slave has got behind a rim. To push it out would make energy from nothing. It is left
    /// standing; as the slave comes out it shrinks, and it never grows again.
    #[inline(always)]
    fn admit(&mut self, depth: f64, rel: Vec3, dt: f64, offset: f64) -> f64 {
        let jump = depth - self.penetration;
        if self.guarded && jump > SLACK * offset && jump > SLACK * offset + 2.0 * norm(rel) * dt {
            self.ignored += jump;
        }
        self.ignored = self.ignored.min(depth.max(0.0));
        depth - self.ignored
    }
}

/// All of a contact's augmentation ([`SlaveItem::follows`]).
pub(crate) const WHOLE: u8 = u8::MAX;

/// Share of a ledge past a rim over which the sheet grows thinner by less than a rigid part lets nodes sink into what is between (2.8 %, of 5). At the rim
/// itself, where nodes of plies of one outline lie, rounding would say which of them lie on the ply.
const STILL_THICK: f64 = 0.2;

/// Steps of [`SlaveItem::let_in`], over the distance at which sheets touch.
const LET_IN: f64 = 1e-4;

/// What a slave is let in by at most, over the distance at which sheets touch: as much as keeps the middles of two sheets from crossing.
const MOST_LET_IN: f64 = 0.5;

/// How far (m) the smooth sheet through the nodes lies off a cell, at a place in it given by the weights of its nodes: half of how far the tangent
/// planes at its corners lie off it there, which is exact for a parabola.
fn bulge(s: &Surface<'_>, cell: u32, weights: [f64; 4]) -> f64 {
    let nodes = s.cells[cell as usize];
    let x = nodes.map(|n| s.x[n as usize]);
    let normals = nodes.map(|n| s.normals[n as usize]);
    let place = combine(weights, &x);
    let normal = unit(combine(weights, &normals));
    let off: f64 = (0..4)
        .map(|k| {
            let n = normals[k];
            weights[k] * dot(n, sub(x[k], place)) / dot(n, normal).max(0.3)
        })
        .sum();
    0.5 * off.abs()
}

/// What a search may move the closest point by while nothing folds, over the offset.
const SLACK: f64 = 1e-2;

/// How often (steps) the closest point of a slave in touch is searched anew. In between it keeps its place in the
/// cell: it slides by some micrometres, which changes the distance by less than a nanometre.
pub(super) const SEARCH_INTERVAL: u8 = 4;

/// Adds the forces of the items in touch to `f` (N), slaves and masters, with the machine's wider vectors; no fused operations, so the
/// bits are the same on all.
pub(super) fn scatter<'a>(
    items: impl Iterator<Item = &'a SlaveItem>,
    cells: &[[u32; 4]],
    f: &mut [Vec3],
) {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn wide<'a>(
            items: impl Iterator<Item = &'a SlaveItem>,
            cells: &[[u32; 4]],
            f: &mut [Vec3],
        ) {
            scatter_each(items, cells, f);
        }
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: AVX2, all that `wide` asks for, was found the line above.
            return unsafe { wide(items, cells, f) };
        }
    }
    scatter_each(items, cells, f);
}

#[inline(always)]
fn scatter_each<'a>(
    items: impl Iterator<Item = &'a SlaveItem>,
    cells: &[[u32; 4]],
    f: &mut [Vec3],
) {
    for item in items.filter(|i| i.active) {
        let mut own = item.force;
        if item.between {
            own = scatter_others(item, cells, f);
        }
        push(cells[item.cell as usize], item.xi, own, f);
        let node = item.node as usize;
        f[node] = add(f[node], item.force);
    }
}

/// Adds what acts on the other cells of an item that lies between several to `f` (N), and gives what is left for its own.
#[inline(never)]
fn scatter_others(item: &SlaveItem, cells: &[[u32; 4]], f: &mut [Vec3]) -> Vec3 {
    let mut own = item.force;
    for other in item.others() {
        own = sub(own, other.force);
        // What acts on an image acts mirrored on the cell itself.
        let mirrored = reflect(other.force, other.image);
        push(cells[other.cell as usize], other.xi, mirrored, f);
    }
    own
}

/// Takes `force` (N) off the nodes of a cell, at a place in it.
#[inline(always)]
fn push(cell: [u32; 4], xi: [f64; 2], force: Vec3, f: &mut [Vec3]) {
    for (w, n) in shape(xi).iter().zip(cell) {
        let n = n as usize;
        f[n] = sub(f[n], scale(force, *w));
    }
}

/// Weights of the place that a slave keeps, and the way from there to the slave (m).
#[inline(always)]
fn held_arm(item: &SlaveItem, s: &Surface<'_>) -> ([f64; 4], Vec3) {
    let weights = item.weights();
    let x = s.cells[item.cell as usize].map(|n| s.x[n as usize]);
    (weights, sub(s.x[item.node as usize], combine(weights, &x)))
}

/// Gap (m) of a slave that keeps its place in its cell and its direction.
#[inline(always)]
pub(super) fn held_gap(item: &SlaveItem, s: &Surface<'_>, offset: f64) -> f64 {
    dot(held_arm(item, s).1, item.direction) - offset
}

/// How fast (m/s) a slave moves against the place of the master that it was seen to be nearest to.
#[inline(always)]
pub(super) fn relative_speed(item: &SlaveItem, s: &Surface<'_>, v: &[Vec3]) -> f64 {
    let master = s.cells[item.cell as usize].map(|n| v[n as usize]);
    norm(sub(v[item.node as usize], combine(item.weights(), &master)))
}

/// Force of a slave that keeps its place in its cell and its direction. (The distance to a point that stands
/// still would not do: pressed at a tenth of a millimetre from it, the slave is a pendulum on its head.)
#[inline(always)]
pub(super) fn hold<F: Coulomb>(
    item: &mut SlaveItem,
    s: &Surface<'_>,
    v: &[Vec3],
    law: &Law<'_, F>,
) -> ContactEnergy {
    let (weights, arm) = held_arm(item, s);
    let n = item.direction;
    touch_one(item, s, v, dot(arm, n) - law.offset, n, weights, law)
}

/// Constants of a contact in a step.
#[derive(Clone, Copy)]
pub(super) struct Law<'a, F> {
    pub(super) dt: f64,
    pub(super) offset: f64,
    pub(super) friction: &'a F,
    pub(super) slip_factor: f64,
    pub(super) follow: Follow,
    /// As [`super::Pace::growth`].
    pub(super) growth: f64,
    /// Slaves are pushed out from wherever they are.
    pub(super) clearing: bool,
}

/// Force of a slave in touch, or so lately that it still has a multiplier, at the place `found` that it has been given.
#[inline(always)]
pub(super) fn touch<F: Coulomb>(
    item: &mut SlaveItem,
    s: &Surface<'_>,
    v: &[Vec3],
    pull: &Pull,
    found: &Found,
    law: &Law<'_, F>,
) -> ContactEnergy {
    if pull.shares == [0.0; FACES] {
        let weights = found.first.weights;
        touch_one(item, s, v, pull.gap, pull.first, weights, law)
    } else {
        touch_several(item, s, v, pull, found, law)
    }
}

/// By its cell alone, along `direction`.
#[inline(always)]
fn touch_one<F: Coulomb>(
    item: &mut SlaveItem,
    s: &Surface<'_>,
    v: &[Vec3],
    gap: f64,
    direction: Vec3,
    weights: [f64; 4],
    law: &Law<'_, F>,
) -> ContactEnergy {
    let master = s.cells[item.cell as usize].map(|n| v[n as usize]);
    let rel = sub(v[item.node as usize], combine(weights, &master));
    let vn = dot(rel, direction);
    let reaction = react(item, s, gap, rel, vn, direction, law);
    item.between = false;
    item.force = add(scale(direction, reaction.normal), reaction.along);
    reaction.energy
}

/// By several cells.
#[inline(never)]
fn touch_several<F: Coulomb>(
    item: &mut SlaveItem,
    s: &Surface<'_>,
    v: &[Vec3],
    pull: &Pull,
    found: &Found,
    law: &Law<'_, F>,
) -> ContactEnergy {
    let speed = |c: &Closest| {
        let own = combine(c.weights, &s.cells[c.cell as usize].map(|n| v[n as usize]));
        reflect(own, c.image)
    };
    let own = v[item.node as usize];
    let rel1 = sub(own, speed(&found.first));
    let (mut vn, mut way) = (dot(rel1, pull.first), pull.first);
    let mut rel = scale(rel1, 1.0 - pull.shares.iter().sum::<f64>());
    for (face, c) in found.others.iter().enumerate() {
        let (Some(c), share) = (c, pull.shares[face]) else {
            continue;
        };
        let other = sub(own, speed(c));
        vn += dot(other, pull.others[face]);
        rel = add(rel, scale(other, share));
        way = add(way, pull.others[face]);
    }
    let reaction = react(item, s, pull.gap, rel, vn, way, law);
    item.between = true;
    item.share_out(pull, found, reaction.normal, reaction.along);
    reaction.energy
}

/// What a contact answers.
struct Reaction {
    /// Normal force (N).
    normal: f64,
    /// Friction (N).
    along: Vec3,
    energy: ContactEnergy,
}

/// Answer to a gap (m) at the relative velocity `rel` (m/s), which opens it at `vn` (m/s). `way`: normal, of any length.
#[inline(always)]
fn react<F: Coulomb>(
    item: &mut SlaveItem,
    s: &Surface<'_>,
    gap: f64,
    rel: Vec3,
    vn: f64,
    way: Vec3,
    law: &Law<'_, F>,
) -> Reaction {
    let (k, c) = (item.stiffness, item.damping);
    let depth = -gap;
    let gap = -item.admit(depth, rel, law.dt, law.offset);
    let (held, work) = grown(item.multiplier, item.work, law.growth, k, gap);
    let follow = Follow {
        share: law.follow.share * item.follows(),
        ..law.follow
    };
    let normal = normal_force(gap, vn, law.dt, k, c, follow, held, work);
    let n = unit(way);
    let vt = sub(rel, scale(n, dot(rel, n)));
    let rest = sub(item.slip, scale(n, dot(item.slip, n)));
    let (spring, damper) = (law.slip_factor * k, law.slip_factor * c);
    let sliding = Sliding {
        node: item.node,
        cell: item.cell,
        x: s.x,
        normal: n,
        force: normal.force,
        held: rest,
        vt,
        spring: spring * law.dt,
    };
    let f = sliding.friction(law.friction, law.dt, spring, damper);
    let before = if item.active {
        dot(item.force, rel)
    } else {
        0.0
    };
    let now = normal.force * vn + dot(f.force, rel);
    item.active = true;
    item.slip = f.slip;
    item.normal_force = normal.force;
    item.multiplier = normal.multiplier;
    item.work = normal.work;
    item.penetration = depth.max(0.0);
    Reaction {
        normal: normal.force,
        along: f.force,
        energy: ContactEnergy {
            stored: normal.stored + f.stored,
            friction: f.friction,
            damping: normal.loss + f.damping,
            work: -0.5 * (before + now) * law.dt,
        },
    }
}
