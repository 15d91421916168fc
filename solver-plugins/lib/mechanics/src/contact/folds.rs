//! A sheet on itself.
//!
//! Slaves are the sheet's nodes, masters its cells. For every node the cells whose corners lie further than a
//! few thicknesses from it in the undeformed sheet are a fixed set, its far cells; the gap is the distance to
//! the closest point of these, less the thickness, and the force is its exact gradient, as between two sheets
//! (`docs/decisions/0003`, `docs/decisions/0017`). A flat sheet has no far cell within reach.
//!
//! A search in space finds the pairs that may touch; it is done anew only when some node may have moved
//! further than the margin that the last one allowed for. In between each pair is followed by walking.

use super::blend::{Pull, pulled};
use super::closest::{Closest, Surface, cell_normal, combine, shape};
use super::friction::{Constant, Coulomb};
use super::penalty::{ContactEnergy, ContactSettings, Follow, Pace, content};
use super::proximity::{Blocks, Candidate, Reach, is_far};
use super::regions::FrictionLaw;
use super::search::track;
use super::slave::{Law, SEARCH_INTERVAL, SlaveItem, hold, relative_speed, scatter, touch};
use crate::archive::{Archive, ArchiveError};
use crate::vec3::{Vec3, dot, norm, scale, sub};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Distance in the undeformed sheet, over the thickness, up to which a node does not see a cell. Two legs that
/// touch around the tightest fold of a thick sheet begin at pi / 2; at 3, a flat sheet may be sheared by 70
/// degrees before a cell that counts is as near as a thickness.
const NEAR: f64 = 3.0;

/// What a search looks beyond the thickness, over the mean edge of a cell.
const MARGIN: f64 = 0.25;

/// Contacts that a node may have at a time: one on each face.
const MOST: usize = 2;

/// Least penalty of a pair over mass / step^2, where other contacts have used up what a node bears.
const LEAST_STIFFNESS: f64 = 0.02;

/// A node on another part of its sheet.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FoldItem {
    /// Slave, place and forces.
    pub slave: SlaveItem,
    /// +1: the slave lies on the side of the master cell's normal; -1: on the other. In touch it changes only around a crease.
    pub side: f64,
    /// Steps for which it is passed over.
    sleep: u32,
}

/// What a search starts from.
#[derive(Debug, Clone, Default, PartialEq)]
struct Search {
    /// `[slaves]` positions at the last search (m); empty before the first.
    x: Vec<Vec3>,
    /// How far a node may have moved since the displacements were looked at (m).
    travelled: f64,
    /// At how much of that they are looked at again (m).
    room: f64,
}

/// What a self-contact is made of.
pub struct FoldSpec {
    /// Name of the pair, for reports.
    pub name: String,
    /// Slaves: model nodes in increasing order.
    pub slaves: Vec<u32>,
    /// Its cells in the model's numbering: first and one past the last.
    pub cell_range: (usize, usize),
    /// Thickness (m): distance of the mid-surfaces in touch.
    pub thickness: f64,
    /// Coulomb coefficient.
    pub friction: FrictionLaw,
    /// `[nodes]` positions in the flat, undeformed sheet (m).
    pub undeformed: Arc<[Vec3]>,
}

/// A sheet on itself.
pub struct SelfContact {
    /// Name of the pair, for reports.
    pub name: String,
    /// Distance of the two mid-surfaces in touch (m).
    pub offset: f64,
    /// Coulomb coefficient.
    pub friction: FrictionLaw,
    /// Constants shared with the other contacts.
    pub settings: ContactSettings,
    /// The pairs within reach, by slave.
    pub items: Vec<FoldItem>,
    /// Whether the sheet has ever touched itself.
    pub touched: bool,
    /// How often pairs were searched.
    pub searches: u64,
    slaves: Vec<u32>,
    undeformed: Arc<[Vec3]>,
    blocks: Blocks,
    near: f64,
    margin: f64,
    /// Edge of a cell (m), mean.
    edge: f64,
    search: Search,
    /// By chunk of items, of one step: its energies, and whether any touches. Kept for its room.
    sums: Vec<(ContactEnergy, bool)>,
}

/// What bounds the penalty of new pairs.
#[derive(Clone, Copy)]
pub(crate) struct Bearing<'a> {
    /// `[nodes]` masses (kg).
    pub mass: &'a [f64],
    /// `[nodes]` stiffness that self-contacts may add to a node (N/m).
    pub room: &'a [f64],
    /// Step (s) that the stiffness must bear.
    pub step: f64,
}

impl SelfContact {
    /// A sheet on itself; `cells` are the model's.
    pub(crate) fn new(spec: FoldSpec, cells: &[[u32; 4]], settings: ContactSettings) -> Self {
        let (c0, c1) = spec.cell_range;
        let own = &cells[c0..c1];
        let at = |n: u32| spec.undeformed[n as usize];
        let sides = own
            .iter()
            .flat_map(|c| (0..4).map(move |k| (c[k], c[(k + 1) % 4])));
        let length: f64 = sides.map(|(a, b)| norm(sub(at(a), at(b)))).sum();
        let edge = length / (4 * own.len()).max(1) as f64;
        let margin = (MARGIN * edge).max(0.5 * spec.thickness);
        let reach = spec.thickness + margin;
        let blocks = Blocks::new(
            spec.cell_range,
            cells,
            &spec.slaves,
            &spec.undeformed,
            reach / edge,
        );
        Self {
            name: spec.name,
            offset: spec.thickness,
            friction: spec.friction,
            settings,
            items: Vec::new(),
            touched: false,
            searches: 0,
            slaves: spec.slaves,
            undeformed: spec.undeformed,
            blocks,
            near: NEAR * spec.thickness,
            margin,
            edge,
            search: Search::default(),
            sums: Vec::new(),
        }
    }

    /// Follows the pairs, after a search if one is due, and computes the force of every slave. `stride` (m): the
    /// furthest that any node has moved in the last step. `onto`: forces (N) to which one thread adds at once what [`SelfContact::scatter`]
    /// would.
    pub(crate) fn compute(
        &mut self,
        s: &Surface<'_>,
        v: &[Vec3],
        pace: Pace,
        stride: f64,
        bearing: Bearing<'_>,
        onto: Option<&mut [Vec3]>,
    ) -> ContactEnergy {
        if self.slaves.is_empty() {
            return ContactEnergy::default();
        }
        if self.is_search_due(s.x, stride) {
            self.search(s, bearing);
        }
        match self.friction.clone() {
            FrictionLaw::Constant(mu) => self.compute_with(&Constant(mu), s, v, pace, onto),
            FrictionLaw::Varying(law) => self.compute_with(&*law, s, v, pace, onto),
            FrictionLaw::Regional(law) => self.compute_with(&*law, s, v, pace, onto),
        }
    }

    fn compute_with<F: Coulomb>(
        &mut self,
        friction: &F,
        s: &Surface<'_>,
        v: &[Vec3],
        pace: Pace,
        onto: Option<&mut [Vec3]>,
    ) -> ContactEnergy {
        let law = Law {
            dt: pace.dt,
            offset: self.offset,
            friction,
            slip_factor: self.settings.slip_factor,
            follow: Follow {
                share: self.settings.augmentation,
                rest: content(self.offset),
                deep: f64::INFINITY,
                swift: f64::INFINITY,
            },
            growth: 1.0,
            clearing: false,
        };
        let (undeformed, near) = (&self.undeformed, self.near);
        let follow_all = |items: &mut [FoldItem]| {
            let (mut sum, mut touched) = (ContactEnergy::default(), false);
            for item in items {
                let own = undeformed[item.slave.node as usize];
                let open = |cell: u32| is_far(s.cells[cell as usize], undeformed, own, near);
                if let Some(energy) = follow(item, s, v, &pace, &law, open) {
                    sum.add(&energy);
                    touched = true;
                }
            }
            (sum, touched)
        };
        let chunks = self
            .items
            .par_chunks_mut(256)
            .map(follow_all)
            .with_min_len(crate::team::least());
        chunks.collect_into_vec(&mut self.sums);
        if let Some(f) = onto {
            self.scatter(s.cells, f);
        }
        let mut total = ContactEnergy::default();
        for (energy, touched) in &self.sums {
            total.add(energy);
            self.touched |= touched;
        }
        total
    }

    /// Keeps only those slaves for which `keep` says so; what touches is found again.
    pub fn retain(&mut self, keep: impl Fn(u32) -> bool) {
        self.slaves.retain(|n| keep(*n));
        self.blocks.retain(keep);
        self.items.clear();
        self.search = Search::default();
    }

    /// Adds the forces to `f` (N), slaves and masters, in the order of the items.
    pub fn scatter(&self, cells: &[[u32; 4]], f: &mut [Vec3]) {
        scatter(self.items.iter().map(|i| &i.slave), cells, f);
    }

    /// Whether two points that the last search found out of reach may have come within the thickness. What
    /// counts is how far nodes have moved against each other: the mean motion is taken off.
    fn is_search_due(&mut self, x: &[Vec3], stride: f64) -> bool {
        let search = &mut self.search;
        if search.x.is_empty() {
            return true;
        }
        search.travelled += stride;
        if search.travelled + stride < search.room {
            return false;
        }
        let moved = |(n, then): (&u32, &Vec3)| sub(x[*n as usize], *then);
        let pairs = || self.slaves.iter().zip(&search.x);
        let mut mean = [0.0; 3];
        for d in pairs().map(moved) {
            mean = crate::vec3::add(mean, d);
        }
        mean = scale(mean, 1.0 / self.slaves.len() as f64);
        let from_mean = |d: Vec3| sub(d, mean);
        let square = |d: Vec3| dot(d, d);
        let most = pairs()
            .map(moved)
            .map(from_mean)
            .map(square)
            .fold(0.0, f64::max)
            .sqrt();
        // Two nodes at this distance from the mean motion may have moved by twice of it, and each step moves a
        // node and the mean.
        let half = 0.5 * self.margin;
        search.travelled = 0.0;
        search.room = 0.5 * (half - most);
        most + 2.0 * stride > 0.7 * half
    }

    /// Finds all pairs within reach. Those in touch stay as they are; of the others a node keeps the nearest,
    /// and the nearest on its other side.
    fn search(&mut self, s: &Surface<'_>, bearing: Bearing<'_>) {
        let reach = Reach {
            distance: self.offset + self.margin,
            near: self.near,
            undeformed: &self.undeformed,
        };
        let candidates = self.blocks.candidates(s, &reach);
        let mut kept = std::mem::take(&mut self.items);
        kept.retain(|i| i.slave.active || i.slave.multiplier > 0.0);
        let carried = kept.len();
        let mut fresh: Vec<FoldItem> = Vec::new();
        for group in candidates.chunk_by(|a, b| a.node == b.node) {
            let node = group[0].node;
            let begin = kept[..carried].partition_point(|i| i.slave.node < node);
            let end = kept[..carried].partition_point(|i| i.slave.node <= node);
            let mut taken: Vec<(Vec3, Vec3)> = kept[begin..end]
                .iter()
                .map(|i| (i.slave.direction, self.foot(s, &i.slave)))
                .collect();
            for c in group {
                let direction = scale(c.arm, 1.0 / c.distance.max(1e-300));
                let foot = combine(shape(c.xi), &self.corners(s, c.cell));
                // The nearest of a direction hides what lies behind it; and a patch that the slave touches, or has
                // passed through by a little, is not met again from its other side.
                let is_known = |(d, f): &(Vec3, Vec3)| {
                    dot(*d, direction) > 0.0 || norm(sub(*f, foot)) < self.near + self.edge
                };
                if taken.len() < MOST && !taken.iter().any(is_known) {
                    taken.push((direction, foot));
                    fresh.push(self.pair(s, c, direction));
                }
            }
        }
        self.stiffen(s.cells, &kept, &mut fresh, bearing);
        kept.append(&mut fresh);
        kept.sort_by_key(|i| i.slave.node);
        self.items = kept;
        self.search.x.clear();
        let now = self.slaves.iter().map(|n| s.x[*n as usize]);
        self.search.x.extend(now);
        self.search.travelled = 0.0;
        self.search.room = 0.25 * self.margin;
        self.searches += 1;
    }

    fn corners(&self, s: &Surface<'_>, cell: u32) -> [Vec3; 4] {
        s.cells[cell as usize].map(|n| self.undeformed[n as usize])
    }

    /// Where the closest point lies in the undeformed sheet (m).
    fn foot(&self, s: &Surface<'_>, item: &SlaveItem) -> Vec3 {
        combine(shape(item.xi), &self.corners(s, item.cell))
    }

    fn pair(&self, s: &Surface<'_>, c: &Candidate, direction: Vec3) -> FoldItem {
        let mut slave = SlaveItem::new(c.node, c.cell, c.xi);
        slave.direction = direction;
        // It was out of reach before, so it cannot be deep inside.
        slave.guarded = true;
        let up = cell_normal(s, c.cell, c.xi);
        let side = if dot(direction, up) < 0.0 { -1.0 } else { 1.0 };
        FoldItem {
            slave,
            side,
            sleep: 0,
        }
    }

    /// Stiffness and damping of new pairs, so that all pairs of a node together stay within what it bears. Pairs
    /// in touch keep theirs: to change it would change what they store.
    fn stiffen(
        &self,
        cells: &[[u32; 4]],
        kept: &[FoldItem],
        fresh: &mut [FoldItem],
        bearing: Bearing<'_>,
    ) {
        let (c, mass) = (&self.settings, bearing.mass);
        let unit = 1.0 / bearing.step.powi(2);
        let reduced = |i: &SlaveItem| {
            let nodes = cells[i.cell as usize].iter();
            let lightest = nodes
                .map(|n| mass[*n as usize])
                .fold(f64::INFINITY, f64::min);
            1.0 / (1.0 / mass[i.node as usize] + 1.0 / lightest)
        };
        // By node: of the pairs in touch, of the new ones.
        let mut rows = std::collections::BTreeMap::<u32, [f64; 2]>::new();
        let mut add = |i: &SlaveItem, k: usize| {
            rows.entry(i.node).or_default()[k] += i.stiffness;
            for (w, n) in shape(i.xi).iter().zip(cells[i.cell as usize]) {
                rows.entry(n).or_default()[k] += w.max(0.0) * i.stiffness;
            }
        };
        kept.iter().for_each(|i| add(&i.slave, 0));
        for item in fresh.iter_mut() {
            item.slave.stiffness = c.stiffness_factor * reduced(&item.slave) * unit;
            add(&item.slave, 1);
        }
        let share = |n: u32| {
            let [old, new] = rows[&n];
            ((bearing.room[n as usize] - old) / new.max(1e-300)).clamp(0.0, 1.0)
        };
        for item in fresh {
            let m = reduced(&item.slave);
            let nodes = cells[item.slave.cell as usize].iter();
            let least = nodes
                .map(|n| share(*n))
                .fold(share(item.slave.node), f64::min);
            let k = (item.slave.stiffness * least).max(LEAST_STIFFNESS * m * unit);
            item.slave.stiffness = k;
            item.slave.damping = 2.0 * c.damping_ratio * (k * m).sqrt();
        }
    }

    /// What changes from step to step.
    pub(crate) fn archive(&mut self, a: &mut Archive<'_>) -> Result<(), ArchiveError> {
        a.value(&mut self.items)?;
        a.value(&mut self.touched)?;
        a.value(&mut self.searches)?;
        a.value(&mut self.search.x)?;
        a.value(&mut self.search.travelled)?;
        a.value(&mut self.search.room)
    }
}

/// On which side of the cell that is closest now (its normal: `up`) a slave lies that was on `side` of the last one.
#[inline]
fn side_of(side: f64, item: &SlaveItem, first: &Closest, up: Vec3, offset: f64) -> f64 {
    let (distance, along) = (first.distance2.sqrt(), dot(first.arm, up));
    if !item.active && distance > offset {
        // Apart, it lies where it is seen to lie.
        return if along < 0.0 { -1.0 } else { 1.0 };
    }
    // The cell is another one and faces the other way, but the slave lies where it lay: it has come around a crease.
    let stays = dot(first.arm, item.direction) > 0.5 * distance;
    if side * along < -0.5 * distance && stays {
        -side
    } else {
        side
    }
}

/// Follows a pair and computes its force; its energy in touch.
fn follow<F: Coulomb>(
    pair: &mut FoldItem,
    s: &Surface<'_>,
    v: &[Vec3],
    pace: &Pace,
    law: &Law<'_, F>,
    open: impl Fn(u32) -> bool,
) -> Option<ContactEnergy> {
    if pair.sleep > 0 {
        pair.sleep -= 1;
        return None;
    }
    let (item, offset) = (&mut pair.slave, law.offset);
    item.turn = item.turn.wrapping_add(1);
    if item.active && item.plain && !item.turn.is_multiple_of(SEARCH_INTERVAL) {
        return Some(hold(item, s, v, law));
    }
    let p = s.x[item.node as usize];
    let found = track(s, item, p, offset, if item.active { 1 } else { 3 }, open);
    let first = &found.first;
    (item.cell, item.xi) = (first.cell, first.xi);
    let up = cell_normal(s, first.cell, first.xi);
    let distance = first.distance2.sqrt();
    pair.side = side_of(pair.side, item, first, up, offset);
    let height = pair.side * dot(first.arm, up);
    let through = height < -0.5 * distance;
    if through && (!item.active || height < -offset) {
        item.part();
        return None;
    }
    let pull = if through || distance < 1e-3 * offset {
        Pull::plain(height - offset, scale(up, pair.side))
    } else {
        // Also on ridges and at the border of what the slave sees, where the foot is no perpendicular's.
        let (pull, alone) = pulled(&found, offset);
        item.plain = alone && height > 0.999 * distance;
        pull
    };
    let plain = item.plain && !through;
    if pull.gap > 0.0 && item.multiplier == 0.0 {
        item.part();
        item.direction = pull.first;
        pair.sleep = pace.steps(pull.gap, relative_speed(item, s, v), 50.0) as u32;
        None
    } else {
        item.plain = plain;
        item.direction = pull.first;
        Some(touch(item, s, v, &pull, &found, law))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::NONE;

    /// Two cells folded flat onto each other along y at x = 0: the upper one faces up, the lower one down.
    const X: [Vec3; 7] = [
        [-1e-2, 0.0, 0.0],
        [0.0, 0.0, 0.0],
        [0.0, 1e-2, 0.0],
        [-1e-2, 1e-2, 0.0],
        [-1e-2, 0.0, -1e-4],
        [-1e-2, 1e-2, -1e-4],
        // The slave, above the crease.
        [0.0, 5e-3, 0.9e-3],
    ];

    /// Follows a slave in touch (0.1 mm deep) that was last seen in `direction` of the upper cell and is now found on the
    /// lower one.
    fn found_below(direction: Vec3, slave: Vec3) -> FoldItem {
        let mut x = X;
        x[6] = slave;
        let surface = Surface {
            cells: &[[0, 1, 2, 3], [1, 4, 5, 2]],
            neighbours: &[[NONE, 1, NONE, NONE], [NONE, NONE, NONE, 0]],
            x: &x,
            normals: &x,
        };
        let mut item = SlaveItem::new(6, 1, [-1.0, 0.0]);
        (item.active, item.guarded, item.direction) = (true, true, direction);
        (item.penetration, item.stiffness) = (1e-4, 1e3);
        let mut pair = FoldItem {
            slave: item,
            side: 1.0,
            sleep: 0,
        };
        let pace = Pace {
            dt: 1e-6,
            speed: 10.0,
            acceleration: f64::INFINITY,
            growth: 1.0,
        };
        let law = Law {
            dt: 1e-6,
            offset: 1e-3,
            friction: &Constant(0.0),
            slip_factor: 0.5,
            follow: Follow {
                share: 0.0,
                rest: 0.0,
                deep: f64::INFINITY,
                swift: f64::INFINITY,
            },
            growth: 1.0,
            clearing: false,
        };
        follow(&mut pair, &surface, &[[0.0; 3]; 7], &pace, &law, |_| true);
        pair
    }

    #[test]
    fn a_slave_that_comes_around_a_crease_has_not_passed_through() {
        let pair = found_below([0.0, 0.0, 1.0], X[6]);
        assert_eq!((pair.slave.cell, pair.side), (1, -1.0));
        assert!((pair.slave.penetration - 1e-4).abs() < 1e-12);
        assert!((pair.slave.force[2] - 0.1).abs() < 1e-9, "{pair:?}");
    }

    #[test]
    fn a_slave_that_has_passed_through_is_pushed_back_the_way_it_came() {
        // It was below the lower cell and is now above it.
        let pair = found_below([0.0, 0.0, -1.0], [-5e-3, 5e-3, 0.2e-3]);
        assert_eq!(pair.side, 1.0);
        assert!(pair.slave.penetration > 1e-3, "{pair:?}");
    }
}
