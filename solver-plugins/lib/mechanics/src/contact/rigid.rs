//! Sheet nodes on a rigid surface, at rest or moving without turning.

use super::friction::{Constant, Coulomb, Sliding};
use super::penalty::{
    ContactEnergy, ContactSettings, Follow, Pace, TOGETHER, content, normal_force, waking,
};
use super::regions::FrictionLaw;
use super::sheets::SheetContact;
use crate::archive::{Archive, ArchiveError};
use crate::vec3::{Vec3, add, dot, norm, scale, sub};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A rigid surface as a signed distance field.
pub trait RigidSurface: Send + Sync {
    /// Signed distance (m, positive outside) and its gradient at a point. Far from the surface the
    /// distance may be any positive lower bound of the true one.
    fn distance(&self, point: Vec3) -> (f64, Vec3);

    /// Whether to ask for a distance costs so much that nodes in touch, or nearly so, keep their tangent planes for some steps.
    fn is_costly(&self) -> bool {
        false
    }
}

/// The plane z = `height`, solid below.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Height (m).
    pub height: f64,
}

impl RigidSurface for Plane {
    fn distance(&self, point: Vec3) -> (f64, Vec3) {
        (point[2] - self.height, [0.0, 0.0, 1.0])
    }
}

/// A plate with a face at `height` and a round opening about the z axis, whose edge is rounded.
///
/// In a half plane through the axis, r outwards and y into the plate: the face y = 0 for r >= a, a quarter circle
/// about (a, edge) with radius `edge`, the wall r = `opening` beyond; a = opening + edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OpenPlate {
    /// Height of the face (m).
    pub height: f64,
    /// 1: solid above the face; -1: solid below.
    pub side: f64,
    /// Radius of the opening (m).
    pub opening: f64,
    /// Radius of the rounding (m).
    pub edge: f64,
}

impl RigidSurface for OpenPlate {
    fn distance(&self, p: Vec3) -> (f64, Vec3) {
        let y = self.side * (p[2] - self.height);
        let r = (p[0] * p[0] + p[1] * p[1]).sqrt();
        let a = self.opening + self.edge;
        let outwards = if r > 0.0 {
            [p[0] / r, p[1] / r]
        } else {
            [1.0, 0.0]
        };
        let (distance, along, into) = if r >= a {
            (-y, 0.0, -1.0)
        } else if y >= self.edge {
            (self.opening - r, -1.0, 0.0)
        } else {
            // Both parts are negative: the quarter that faces the opening and the sheets.
            let (dr, dy) = (r - a, y - self.edge);
            let size = (dr * dr + dy * dy).sqrt().max(1e-12);
            (size - self.edge, dr / size, dy / size)
        };
        let gradient = [along * outwards[0], along * outwards[1], self.side * into];
        (distance, gradient)
    }
}

/// Where a rigid surface is, and how fast it moves: set before each step.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct RigidMotion {
    /// Way from where the surface is described (m).
    pub shift: Vec3,
    /// Mean velocity over the last step (m/s), as that of the nodes.
    pub velocity: Vec3,
}

/// One node that may touch the surface.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RigidItem {
    /// Model node.
    pub node: u32,
    /// Penetration (m), 0 when apart; for reports.
    pub penetration: f32,
    /// Damping (N s/m). Like the normal force it is of single precision, where its last digits do not matter, to save memory:
    /// every node has an item for each rigid part.
    pub damping: f32,
    /// Normal stiffness (N/m).
    pub stiffness: f64,
    /// Multiplier: the steady part of the normal force (N).
    pub multiplier: f64,
    work: f64,
    /// Normal part of the force on the node in the last step (N); for reports.
    pub normal_force: f32,
    /// Friction force held by the slip spring (N).
    pub slip: Vec3,
    /// Force on the node in the last step (N).
    pub force: Vec3,
}

impl RigidItem {
    /// A node at rest; stiffness and damping are set by the model.
    pub fn new(node: u32) -> Self {
        Self {
            node,
            penetration: 0.0,
            stiffness: 0.0,
            damping: 0.0,
            multiplier: 0.0,
            work: 0.0,
            slip: [0.0; 3],
            force: [0.0; 3],
            normal_force: 0.0,
        }
    }

    /// Forgets the contact.
    fn part(&mut self) {
        *self = Self {
            stiffness: self.stiffness,
            damping: self.damping,
            ..Self::new(self.node)
        };
    }
}

/// Nodes on one rigid surface.
pub struct RigidContact {
    /// Name of the pair, for reports.
    pub name: String,
    /// The surface.
    pub surface: Arc<dyn RigidSurface>,
    /// Its motion.
    pub motion: RigidMotion,
    /// Whether it moves, or will: what accelerates the nodes then says nothing of when they meet it.
    pub moves: bool,
    /// Distance that the nodes keep from the surface (m).
    pub offset: f64,
    /// By how much that is less than what lies between them is thick (m): nodes that sink in further count so much deeper in reports.
    pub slack: f64,
    /// Coulomb coefficient.
    pub friction: FrictionLaw,
    /// Elastic-slip stiffness over normal stiffness.
    pub slip_factor: f64,
    /// Share of the penalty force that a step adds to the multiplier.
    pub augmentation: f64,
    /// As [`SheetContact::deep`].
    pub deep: f64,
    /// Its stiffness over what the masses would allow.
    pub share: f64,
    /// As [`SheetContact::counted`].
    pub counted: f64,
    /// Of nodes that are held through other sheets: numbers of the contacts in [`crate::model::Model::sheet_contacts`] of these nodes, in
    /// this order, with all sheets between. Where a node has slid past the edge of one, it is not held at this distance.
    pub through: Vec<usize>,
    /// The nodes.
    pub items: Vec<RigidItem>,
    /// By item.
    between: Vec<Between>,
    /// By item: call of [`RigidContact::compute`] before which the node cannot reach the surface. Apart from the items,
    /// so that to pass over one that sleeps touches four bytes and not a cache line or two.
    wakes: Vec<u32>,
    /// By item; empty unless the surface is costly.
    planes: Vec<TangentPlane>,
    spans: Vec<Span>,
    cycle: u64,
}

/// Whether the sheets between a node and a rigid surface lie there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum Between {
    /// All of them do.
    There,
    /// They do again, but the node is still nearer than they are thick: a push would come all at once.
    Coming,
    /// Not all.
    Gone,
}

/// The surface as a node saw it that touches or may at the next step: `gap = gradient . x - level`, x less the surface's
/// shift. The level is NaN of a node that sleeps.
///
/// Until it looks again ([`INTERVAL`]) it slides by some tens of micrometres at most. Over those a fillet of 10 mm departs
/// from its tangent plane by less than a tenth of a micrometre, the penetration with which a multiplier is content.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct TangentPlane {
    gradient: Vec3,
    level: f64,
}

impl TangentPlane {
    const NONE: Self = Self {
        gradient: [0.0; 3],
        level: f64::NAN,
    };
}

impl RigidContact {
    /// Nodes that keep the distance `offset` (m) from a surface at rest; the settings' `stiffness_factor` and `damping_ratio` are not used here.
    pub fn new(
        name: String,
        surface: Arc<dyn RigidSurface>,
        offset: f64,
        friction: impl Into<FrictionLaw>,
        settings: &ContactSettings,
        items: Vec<RigidItem>,
    ) -> Self {
        Self {
            name,
            surface,
            motion: RigidMotion::default(),
            moves: false,
            offset,
            slack: 0.0,
            friction: friction.into(),
            slip_factor: settings.slip_factor,
            augmentation: settings.augmentation,
            deep: f64::INFINITY,
            share: 1.0,
            counted: 1.0,
            through: Vec::new(),
            items,
            between: Vec::new(),
            wakes: Vec::new(),
            planes: Vec::new(),
            spans: Vec::new(),
            cycle: 0,
        }
    }

    /// Lets the nodes come nearer by `slack` (m) before the surface holds them: for a sheet that another one keeps away from it.
    pub fn with_slack(mut self, slack: f64) -> Self {
        self.offset -= slack;
        self.slack = slack;
        self
    }

    /// Takes note of which nodes lie on all sheets of [`RigidContact::through`].
    pub(crate) fn look_between(&mut self, sheets: &[SheetContact]) {
        if self.through.is_empty() {
            return;
        }
        self.between.resize(self.items.len(), Between::There);
        for (k, between) in self.between.iter_mut().enumerate() {
            let lies_on = |c: &usize| {
                let item = &sheets[*c].items[k];
                debug_assert_eq!(item.node, self.items[k].node, "of the same nodes");
                item.lies_on_its_cell()
            };
            *between = match (self.through.iter().all(lies_on), *between) {
                (false, _) => Between::Gone,
                (true, Between::Gone) => Between::Coming,
                (true, as_it_was) => as_it_was,
            };
        }
    }

    /// Computes the force of every item from positions (m) and velocities (m/s). `pace`: of the nodes; the surface's own
    /// speed comes on top.
    pub fn compute(&mut self, x: &[Vec3], v: &[Vec3], pace: Pace) -> ContactEnergy {
        match self.friction.clone() {
            FrictionLaw::Constant(mu) => self.compute_with(&Constant(mu), x, v, pace),
            FrictionLaw::Varying(law) => self.compute_with(&*law, x, v, pace),
            FrictionLaw::Regional(law) => self.compute_with(&*law, x, v, pace),
        }
    }

    /// The same by one thread, which then adds the forces to `f` (N).
    pub(crate) fn compute_onto(
        &mut self,
        x: &[Vec3],
        v: &[Vec3],
        pace: Pace,
        f: &mut [Vec3],
    ) -> ContactEnergy {
        let energy = self.compute(x, v, pace);
        self.scatter(f);
        energy
    }

    fn compute_with<F: Coulomb>(
        &mut self,
        friction: &F,
        x: &[Vec3],
        v: &[Vec3],
        pace: Pace,
    ) -> ContactEnergy {
        self.make_room();
        let motion = self.motion;
        let looking = Looking {
            surface: self.surface.as_ref(),
            motion,
            pace: self.pace(pace),
            cycle: self.cycle,
            v,
            law: Law {
                dt: pace.dt,
                friction,
                x,
                offset: self.offset,
                slip_factor: self.slip_factor,
                follow: Follow {
                    share: self.augmentation,
                    rest: content(self.offset),
                    deep: self.deep,
                    swift: f64::INFINITY,
                },
            },
        };
        self.cycle += 1;
        let items = self.items.par_chunks_mut(SPAN);
        let spans = items
            .zip_eq(self.wakes.par_chunks_mut(SPAN))
            .zip_eq(self.between.par_chunks_mut(SPAN))
            .zip_eq(self.spans.par_iter_mut())
            .with_max_len(TOGETHER)
            .with_min_len(crate::team::least());
        if self.surface.is_costly() {
            let spans = spans.zip_eq(self.planes.par_chunks_mut(SPAN));
            let look = |((((items, wakes), between), span), planes): (_, &mut [_])| {
                looking.span(items, (wakes, between), span, planes);
            };
            spans.for_each(look);
        } else {
            spans.for_each(|(((items, wakes), between), span)| {
                looking.span(items, (wakes, between), span, &mut []);
            });
        }
        let mut total = ContactEnergy::default();
        for span in self.spans.iter().filter(|s| s.touches) {
            total.add(&span.energy);
        }
        total
    }

    /// How fast nodes may come to the surface, which may move too.
    fn pace(&self, mut pace: Pace) -> Pace {
        pace.speed += 2.0 * norm(self.motion.velocity);
        if self.moves {
            pace.acceleration = f64::INFINITY;
        }
        pace
    }

    /// What is known of each item, and of each span of them.
    fn make_room(&mut self) {
        debug_assert!(
            [0, self.items.len()].contains(&self.wakes.len()),
            "'{}' has other items than when it looked last",
            self.name
        );
        self.wakes.resize(self.items.len(), 0);
        self.spans
            .resize_with(self.items.len().div_ceil(SPAN), Span::default);
        self.between.resize(self.items.len(), Between::There);
        if self.surface.is_costly() {
            self.planes.resize(self.items.len(), TangentPlane::NONE);
        }
    }

    /// Adds the forces on the nodes to `f` (N).
    pub fn scatter(&self, f: &mut [Vec3]) {
        for (items, span) in self.items.chunks(SPAN).zip(&self.spans) {
            if span.touches {
                for item in items.iter().filter(|i| i.normal_force > 0.0) {
                    let n = item.node as usize;
                    f[n] = add(f[n], item.force);
                }
            }
        }
    }

    /// What changes: motion, nodes, sleep.
    pub(crate) fn archive(&mut self, a: &mut Archive<'_>) -> Result<(), ArchiveError> {
        a.value(&mut self.motion)?;
        a.value(&mut self.cycle)?;
        a.value(&mut self.wakes)?;
        a.value(&mut self.between)?;
        a.value(&mut self.planes)?;
        a.value(&mut self.spans)?;
        a.values(&mut self.items)
    }

    /// Sum of the forces on the nodes (N) in the last step; on the surface acts the opposite.
    pub fn resultant(&self) -> Vec3 {
        let touching = self.spans.iter().filter(|s| s.touches);
        touching.fold([0.0; 3], |sum, s| add(sum, s.force))
    }
}

/// Nodes whose forces are summed, and that are passed over while all of them sleep.
const SPAN: usize = 64;

/// A run of [`SPAN`] nodes.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct Span {
    /// Call of [`RigidContact::compute`] in which the first of them wakes.
    wake: u32,
    /// Whether any touched in the last call.
    touches: bool,
    /// Sum of their forces (N).
    force: Vec3,
    energy: ContactEnergy,
}

/// What a look at the items of a surface needs.
struct Looking<'a, F> {
    surface: &'a dyn RigidSurface,
    motion: RigidMotion,
    pace: Pace,
    cycle: u64,
    v: &'a [Vec3],
    law: Law<'a, F>,
}

impl<F: Coulomb> Looking<'_, F> {
    /// Forces of those items of a span that are awake, with the machine's wider vectors; no fused operations, so the bits are
    /// the same on all. `planes`: by item, or none.
    fn span(
        &self,
        items: &mut [RigidItem],
        by_item: (&mut [u32], &mut [Between]),
        span: &mut Span,
        planes: &mut [TangentPlane],
    ) {
        if self.cycle < u64::from(span.wake) {
            return;
        }
        #[cfg(target_arch = "x86_64")]
        {
            #[target_feature(enable = "avx2")]
            fn wide<F: Coulomb>(
                looking: &Looking<'_, F>,
                items: &mut [RigidItem],
                by_item: (&mut [u32], &mut [Between]),
                span: &mut Span,
                planes: &mut [TangentPlane],
            ) {
                looking.each(items, by_item, span, planes);
            }
            if std::arch::is_x86_feature_detected!("avx2") {
                // SAFETY: AVX2, all that `wide` asks for, was found the line above.
                return unsafe { wide(self, items, by_item, span, planes) };
            }
        }
        self.each(items, by_item, span, planes);
    }

    #[inline(always)]
    fn each(
        &self,
        items: &mut [RigidItem],
        by_item: (&mut [u32], &mut [Between]),
        span: &mut Span,
        planes: &mut [TangentPlane],
    ) {
        *span = Span {
            wake: u32::MAX,
            ..Span::default()
        };
        let (wakes, between) = by_item;
        let by_item = wakes.iter_mut().zip(between);
        for (k, (item, (wake, between))) in items.iter_mut().zip(by_item).enumerate() {
            if self.cycle >= u64::from(*wake) {
                if *between == Between::Gone {
                    item.part();
                    // Until about when this is looked at again. It is not held then, either, before it has come clear.
                    *wake = waking(self.cycle, INTERVAL);
                    span.wake = span.wake.min(*wake);
                    continue;
                }
                let mut plane = planes.get_mut(k);
                let (gap, gradient) = self.gap(item, plane.as_deref_mut());
                let relative = sub(self.v[item.node as usize], self.motion.velocity);
                if *between == Between::Coming {
                    if gap <= 0.0 {
                        *wake = waking(self.cycle, 1);
                        span.wake = span.wake.min(*wake);
                        continue;
                    }
                    *between = Between::There;
                }
                if gap <= 0.0 || item.multiplier > 0.0 {
                    let energy = touch(item, gap, gradient, relative, &self.law);
                    span.energy.add(&energy);
                    span.force = add(span.force, item.force);
                    span.touches = true;
                } else {
                    item.part();
                    let steps = self.pace.steps(gap, norm(relative), 200.0);
                    *wake = waking(self.cycle, 1 + steps);
                    if steps > 0
                        && let Some(plane) = plane
                    {
                        plane.level = f64::NAN;
                    }
                }
            }
            span.wake = span.wake.min(*wake);
        }
    }

    /// Gap of an item (m) and its gradient; from the plane while the item keeps it.
    #[inline(always)]
    fn gap(&self, item: &RigidItem, plane: Option<&mut TangentPlane>) -> (f64, Vec3) {
        let n = item.node as usize;
        let x = sub(self.law.x[n], self.motion.shift);
        if let Some(plane) = &plane
            && !(self.cycle + n as u64).is_multiple_of(INTERVAL)
        {
            let gap = dot(plane.gradient, x) - plane.level;
            // No plane, or a node that has just come: look.
            if gap > 0.0 || item.normal_force > 0.0 {
                return (gap, plane.gradient);
            }
        }
        let (distance, gradient) = self.surface.distance(x);
        let gap = distance - self.law.offset;
        if let Some(plane) = plane {
            let level = dot(gradient, x) - gap;
            *plane = TangentPlane { gradient, level };
        }
        (gap, gradient)
    }
}

/// How often (steps) an item that is awake asks a costly surface for its distance.
const INTERVAL: u64 = 8;

struct Law<'a, F> {
    dt: f64,
    friction: &'a F,
    x: &'a [Vec3],
    offset: f64,
    slip_factor: f64,
    follow: Follow,
}

/// Force of an item in touch, or so lately that it still has a multiplier; its energy. `v`: relative to the surface.
#[inline(always)]
fn touch<F: Coulomb>(
    item: &mut RigidItem,
    gap: f64,
    g: Vec3,
    v: Vec3,
    law: &Law<'_, F>,
) -> ContactEnergy {
    let (k, c) = (item.stiffness, f64::from(item.damping));
    let vn = dot(v, g);
    let (held, work) = (item.multiplier, item.work);
    let normal = normal_force(gap, vn, law.dt, k, c, law.follow, held, work);
    // The gradient of a distance field is a unit vector up to the error of its interpolation.
    let n = scale(g, 1.0 / dot(g, g).max(1e-12).sqrt());
    let mut energy = ContactEnergy {
        stored: normal.stored,
        friction: 0.0,
        damping: normal.loss,
        work: 0.0,
    };
    let before = std::mem::replace(&mut item.force, scale(g, normal.force));
    if !law.friction.is_smooth() {
        let vt = sub(v, scale(n, dot(v, n)));
        let rest = sub(item.slip, scale(n, dot(item.slip, n)));
        let (spring, damper) = (law.slip_factor * k, law.slip_factor * c);
        let sliding = Sliding {
            node: item.node,
            cell: crate::mesh::NONE,
            x: law.x,
            normal: n,
            force: normal.force,
            held: rest,
            vt,
            spring: spring * law.dt,
        };
        let f = sliding.friction(law.friction, law.dt, spring, damper);
        item.slip = f.slip;
        item.force = add(item.force, f.force);
        energy.stored += f.stored;
        energy.friction = f.friction;
        energy.damping += f.damping;
    }
    energy.work = -0.5 * dot(add(before, item.force), v) * law.dt;
    item.normal_force = normal.force as f32;
    item.multiplier = normal.multiplier;
    item.work = normal.work;
    item.penetration = (-gap).max(0.0) as f32;
    energy
}
