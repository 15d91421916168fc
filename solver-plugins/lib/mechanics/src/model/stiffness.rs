//! How stiff contacts are, from the masses that they couple and the step.

use super::mirror::Mirroring;
use super::parts::Model;
use crate::contact::{
    ContactSettings, FoldSpec, SelfContact, SheetContact, Tie, WHOLE, ledge, rim_height, shape,
};
use crate::mesh::NONE;
use std::ops::Range;

/// Share of the thinner sheet from which on a contact is deep ([`SheetContact::deep`]).
const DEEP: f64 = 0.1;

/// Masses of nodes (kg): of the whole node where a mirror plane cuts it, so that contacts there are as stiff as in the whole model.
struct Masses<'a> {
    mass: &'a [f64],
    mirroring: &'a Mirroring,
}

impl Masses<'_> {
    fn whole(&self, n: u32) -> f64 {
        self.mass[n as usize] / self.mirroring.share(n)
    }

    /// Of a node against a cell, what counts of it in the model.
    fn reduced(&self, node: u32, cell: [u32; 4]) -> f64 {
        let whole = |n: u32| self.whole(n);
        let lightest = cell.map(whole).into_iter().fold(f64::INFINITY, f64::min);
        self.mirroring.share(node) / (1.0 / whole(node) + 1.0 / lightest)
    }

    /// Sets the stiffness of the items of a contact, and adds it to the `row` of each node that it acts on.
    fn stiffen(
        &self,
        contact: &mut SheetContact,
        cells: &[[u32; 4]],
        c: &ContactSettings,
        dt2: f64,
        row: &mut [f64],
    ) {
        let whole = |n: u32| self.whole(n);
        let augmentation = contact.augmentation;
        let (share, counted) = (contact.share, contact.counted);
        for item in contact.items.iter_mut().filter(|i| i.cell != NONE) {
            let nodes = cells[item.cell as usize];
            let (slave, master) = (whole(item.node), nodes.map(whole).iter().sum::<f64>() / 4.0);
            let most = c.largest_augmentation(slave.min(master) / slave.max(master));
            item.follows = (f64::from(WHOLE) * (most / augmentation).min(1.0)) as u8;
            // None at all would leave every load to the penalty.
            item.follows = item.follows.max(1);
            item.stiffness = share * c.stiffness_factor * self.reduced(item.node, nodes) / dt2;
            row[item.node as usize] += counted * item.stiffness;
            for (k, n) in nodes.iter().enumerate() {
                row[*n as usize] += counted * item.weights()[k] * item.stiffness;
            }
        }
        for tie in &mut contact.ties.items {
            let nodes = cells[tie.cell as usize];
            tie.stiffness = c.stiffness_factor * self.reduced(tie.node, nodes) / dt2;
            add_to_row(tie, nodes, tie.stiffness, row);
        }
    }

    /// Bounds the stiffness of a tie, and sets its damping.
    fn limit(&self, tie: &mut Tie, cells: &[[u32; 4]], c: &ContactSettings, limit: &[f64]) {
        let nodes = cells[tie.cell as usize];
        let stiffness = tie.stiffness * limit_of(tie, nodes, limit);
        let damping = 2.0 * c.damping_ratio * (stiffness * self.reduced(tie.node, nodes)).sqrt();
        // As weak as those of slip: along the fibres elements leave little of the bound.
        (tie.stiffness, tie.damping) = (c.slip_factor * stiffness, c.slip_factor * damping);
    }
}

/// Adds what a tie has of something to the `row` of each node that it acts on.
fn add_to_row(tie: &Tie, nodes: [u32; 4], of_it: f64, row: &mut [f64]) {
    row[tie.node as usize] += of_it;
    for (w, n) in shape(tie.xi).iter().zip(nodes) {
        row[n as usize] += w * of_it;
    }
}

/// The least limit of the nodes that a tie acts on.
fn limit_of(tie: &Tie, nodes: [u32; 4], limit: &[f64]) -> f64 {
    let least = nodes.iter().map(|n| limit[*n as usize]).fold(1.0, f64::min);
    least.min(limit[tie.node as usize])
}

/// From which depth on a contact is deep, and how high the ledge at the rim of its master is, from the sheets' `thickness` by node (m).
fn set_depths(
    contact: &mut SheetContact,
    cells: &[[u32; 4]],
    thickness: &[f64],
    heights: &[(Range<usize>, Option<f64>)],
) {
    let on = (contact.items.iter().map(|i| i.cell)).find(|c| *c != NONE);
    let master = on.and_then(|c| heights.iter().find(|h| h.0.contains(&(c as usize))));
    if let Some((_, Some(height))) = master {
        contact.ledge = ledge(contact.offset, *height);
    }
    let items = contact.items.iter().filter(|i| i.cell != NONE);
    // Where they are kept further apart than they are thick, what is between them is to spare.
    let both = items.map(|i| {
        let master = cells[i.cell as usize][0];
        let [a, b] = [i.node, master].map(|n| thickness[n as usize]);
        (contact.offset - 0.5 * (a + b)).max(0.0) + DEEP * a.min(b)
    });
    contact.deep = both.fold(f64::INFINITY, f64::min);
}

impl Model {
    /// Sets stiffness and damping of all contacts from the masses that they couple, and bounds the
    /// assembled stiffness of every node: 2 sum(k) dt^2 / m stays below `2 * 0.7`, which leaves the rest of
    /// the stability bound 4 to the elements. Contacts that touch where others do not count less ([`SheetContact::counted`]).
    pub fn set_contact_stiffness(&mut self, c: &ContactSettings) {
        let dt2 = self.topology.settings.target_step.powi(2);
        let masses = Masses {
            mass: &self.topology.mass,
            mirroring: &self.topology.mirroring,
        };
        let augmentation = c
            .augmentation
            .min(c.largest_augmentation(self.mass_ratio()));
        let thickness = self.thickness_by_node();
        let heights = self.rim_heights();
        let mut row = vec![0.0; masses.mass.len()];
        for contact in &mut self.contacts.rigid {
            contact.augmentation = augmentation;
            let nodes = contact.items.iter().map(|i| thickness[i.node as usize]);
            contact.deep = DEEP * nodes.fold(f64::INFINITY, f64::min);
            let (share, counted) = (contact.share, contact.counted);
            for item in &mut contact.items {
                let mass = masses.mass[item.node as usize];
                item.stiffness = share * c.stiffness_factor * mass / dt2;
                row[item.node as usize] += counted * item.stiffness;
            }
        }
        let cells = &self.topology.cells;
        for contact in &mut self.contacts.sheets {
            contact.augmentation = augmentation;
            set_depths(contact, cells, &thickness, &heights);
            masses.stiffen(contact, cells, c, dt2, &mut row);
        }
        let limit: Vec<f64> = row
            .iter()
            .zip(masses.mass)
            .map(|(r, m)| (0.7 * m / (dt2 * r.max(1e-300))).min(1.0))
            .collect();
        for item in self.contacts.rigid.iter_mut().flat_map(|c| &mut c.items) {
            let m = masses.mass[item.node as usize];
            item.stiffness *= limit[item.node as usize];
            item.damping = (2.0 * c.damping_ratio * (item.stiffness * m).sqrt()) as f32;
        }
        for item in self.contacts.sheets.iter_mut().flat_map(|c| &mut c.items) {
            if item.cell == NONE {
                continue;
            }
            let nodes = cells[item.cell as usize];
            let least = nodes.iter().map(|n| limit[*n as usize]).fold(1.0, f64::min);
            item.stiffness *= least.min(limit[item.node as usize]);
            let reduced = masses.reduced(item.node, nodes);
            item.damping = 2.0 * c.damping_ratio * (item.stiffness * reduced).sqrt();
        }
        let ties = self
            .contacts
            .sheets
            .iter_mut()
            .flat_map(|c| &mut c.ties.items);
        ties.for_each(|tie| masses.limit(tie, cells, c, &limit));
        self.bound_contact_damping();
        self.set_contact_room();
    }

    /// Thickness (m) of the sheet of each node.
    fn thickness_by_node(&self) -> Vec<f64> {
        let mut thickness = vec![f64::INFINITY; self.topology.mass.len()];
        for sheet in &self.topology.sheets {
            for node in &sheet.nodes {
                thickness[*node as usize] = sheet.thickness;
            }
        }
        thickness
    }

    /// By sheet, its cells and how long (m) those at its rim are across it ([`rim_height`]).
    fn rim_heights(&self) -> Vec<(Range<usize>, Option<f64>)> {
        let (cells, neighbours, x) = (
            &self.topology.cells,
            &self.topology.neighbours,
            &self.state.x,
        );
        let heights = self.topology.sheets.iter().map(|sheet| {
            let (from, to) = sheet.cell_range;
            let height = rim_height(&cells[from..to], &neighbours[from..to], x);
            (from..to, height)
        });
        heights.collect()
    }

    /// The least share that the heaviest node of the lighter one of two sheets in contact has of the other's.
    fn mass_ratio(&self) -> f64 {
        let heaviest = |nodes: &mut dyn Iterator<Item = u32>| {
            let masses = nodes.map(|n| self.topology.mass[n as usize]);
            masses.fold(0.0, f64::max)
        };
        let of_contact = |contact: &SheetContact| {
            let items = || contact.items.iter().filter(|i| i.cell != NONE);
            let slave = heaviest(&mut items().map(|i| i.node));
            let master = heaviest(&mut items().flat_map(|i| self.topology.cells[i.cell as usize]));
            (slave.min(master) > 0.0).then(|| slave.min(master) / slave.max(master))
        };
        let ratios = self.contacts.sheets.iter().filter_map(of_contact);
        ratios.fold(1.0, f64::min)
    }

    /// Bounds the assembled damping of every node. The damper's force is that of the velocity half a step ago,
    /// so that an oscillator is stable while `k dt^2 / m + 2 c dt / m < 4`. The contacts' stiffness takes
    /// up to 1.4 of that ([`Model::set_contact_stiffness`]), their damping gets the rest: by Gershgorin's
    /// theorem `2 sum(c) dt / m` stays below 2.6, where a damper between two sheets counts twice. (Elements take
    /// nearly all of it along the fibres, but next to nothing across a thin sheet; along it dampers are weaker
    /// by `slip_factor`.)
    fn bound_contact_damping(&mut self) {
        const BOUND: f64 = 0.5 * (4.0 - 1.4);
        let dt = self.topology.settings.target_step;
        let mut row = vec![0.0; self.topology.mass.len()];
        for contact in &self.contacts.rigid {
            for item in &contact.items {
                row[item.node as usize] += contact.counted * f64::from(item.damping);
            }
        }
        for contact in &self.contacts.sheets {
            let items = contact.items.iter();
            for item in items.filter(|i| i.cell != NONE) {
                let damping = 2.0 * contact.counted * item.damping;
                row[item.node as usize] += damping;
                for (k, n) in self.topology.cells[item.cell as usize].iter().enumerate() {
                    row[*n as usize] += item.weights()[k] * damping;
                }
            }
            for tie in &contact.ties.items {
                let nodes = self.topology.cells[tie.cell as usize];
                add_to_row(tie, nodes, 2.0 * tie.damping, &mut row);
            }
        }
        let of = row.iter().zip(&self.topology.mass);
        let limit: Vec<f64> = of
            .map(|(r, m)| (BOUND * m / (dt * r.max(1e-300))).min(1.0))
            .collect();
        for item in self.contacts.rigid.iter_mut().flat_map(|c| &mut c.items) {
            let limited = f64::from(item.damping) * limit[item.node as usize];
            item.damping = limited as f32;
        }
        let sheets = self.contacts.sheets.iter_mut().flat_map(|c| &mut c.items);
        for item in sheets.filter(|i| i.cell != NONE) {
            let nodes = self.topology.cells[item.cell as usize];
            let least = nodes.iter().map(|n| limit[*n as usize]).fold(1.0, f64::min);
            item.damping *= least.min(limit[item.node as usize]);
        }
        for tie in (self.contacts.sheets.iter_mut()).flat_map(|c| &mut c.ties.items) {
            let nodes = self.topology.cells[tie.cell as usize];
            tie.damping *= limit_of(tie, nodes, &limit);
        }
    }

    /// Adds the contact of a sheet with itself. `undeformed`: the model's points (m) with the sheet flat; what
    /// is near in it does not touch. The other contacts' stiffness is set, or comes to be set, by
    /// [`Model::set_contact_stiffness`].
    pub fn add_self_contact(&mut self, spec: FoldSpec, c: &ContactSettings) {
        let contact = SelfContact::new(spec, &self.topology.cells, *c);
        self.contacts.folds.push(contact);
        self.set_contact_room();
    }

    /// What the other contacts leave of `sum(rigid k) + 2 sum(sheet k) < 2 * 0.7 m / dt^2`: a rigid surface does not
    /// move, so its springs count once. Where they leave little, a node gets a small share all the same: it does
    /// not touch everything at once.
    fn set_contact_room(&mut self) {
        if self.contacts.folds.is_empty() {
            return;
        }
        let dt2 = self.topology.settings.target_step.powi(2);
        let mut used = vec![0.0; self.topology.mass.len()];
        for contact in &self.contacts.rigid {
            for item in &contact.items {
                used[item.node as usize] += 0.5 * contact.counted * item.stiffness;
            }
        }
        for contact in &self.contacts.sheets {
            let items = contact.items.iter();
            for item in items.filter(|i| i.cell != NONE) {
                let stiffness = contact.counted * item.stiffness;
                used[item.node as usize] += stiffness;
                for (w, n) in item
                    .weights()
                    .iter()
                    .zip(self.topology.cells[item.cell as usize])
                {
                    used[n as usize] += w.max(0.0) * stiffness;
                }
            }
            for tie in &contact.ties.items {
                let nodes = self.topology.cells[tie.cell as usize];
                add_to_row(tie, nodes, tie.stiffness, &mut used);
            }
        }
        let left = |(u, m): (&f64, &f64)| (0.7 * m / dt2 - u).max(0.1 * m / dt2);
        self.contacts.room = used.iter().zip(&self.topology.mass).map(left).collect();
    }
}
