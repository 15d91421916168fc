//! The table of defects: numbering, and which defect of one model is which of another.

use crate::models::{Model, bounds_in_whole, bounds_of};
use plyflow_defects::of_run::neighbours;
use plyflow_defects::pairs::{apart, name_of, same_within, unlike};
use plyflow_defects::{Defect, Kind, Limits, Settings, find_causes, measure};
use plyflow_model::artifact::{ComparedDefect, Role, Zone};

/// A defect with its place in the table.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// "AW1": zone, W (wrinkle) or B (bridging), number.
    pub id: String,
    /// Index of the model.
    pub model: usize,
    /// Index of the zone.
    pub zone: usize,
    /// Name of the ply.
    pub ply: String,
    /// Local models: whether it reaches the left, right, bottom and top side of the zone's cut, so that its zone is too
    /// small. Never a free side, nor one at which the ply ends.
    pub cut_sides: [bool; 4],
    /// What was measured.
    pub defect: Defect,
}

impl Entry {
    /// Whether it reaches any side of the cut.
    pub fn touches_cut(&self) -> bool {
        self.cut_sides.contains(&true)
    }

    /// As the attributes have it.
    pub fn told(&self, models: &[Model], zones: &[Zone]) -> ComparedDefect {
        let d = &self.defect;
        ComparedDefect {
            id: self.id.clone(),
            model: models[self.model].name.clone(),
            zone: zones[self.zone].name.clone(),
            ply: self.ply.clone(),
            found: d.told(),
            length: d.length,
            curvature_max: d.curvature_max,
            shear_min: d.shear.map(|s| s[0]),
            shear_max: d.shear.map(|s| s[1]),
            touches_cut: self.touches_cut(),
            cut_sides: self.cut_sides,
        }
    }
}

/// All defects: first those of the local models, numbered in their zone from the uppermost ply down, wrinkles
/// by length and bridging by area; then those of the other models in the same boxes, which take the id
/// of the local defect that they are, or the next free number. Causes are those of [`find_causes`], by what each model shows in the box.
pub fn defect_table(
    models: &[Model],
    zones: &[Zone],
    settings: &Settings,
    limits: &Limits,
) -> Vec<Entry> {
    let mut entries: Vec<Entry> = Vec::new();
    let local = models
        .iter()
        .enumerate()
        .filter(|(_, m)| m.role == Role::Local);
    for (m, model) in local {
        let zone = model.zone.unwrap_or(0);
        let found = entries_of(models, m, zones, zone, (settings, limits));
        number(&mut entries, found, &[], zones);
    }
    let locals = entries.clone();
    for (m, _) in models
        .iter()
        .enumerate()
        .filter(|(_, m)| m.role != Role::Local)
    {
        for zone in 0..zones.len() {
            let found = entries_of(models, m, zones, zone, (settings, limits));
            number(&mut entries, found, &locals, zones);
        }
    }
    entries
}

fn entries_of(
    models: &[Model],
    m: usize,
    zones: &[Zone],
    zone: usize,
    (settings, limits): (&Settings, &Limits),
) -> Vec<Entry> {
    let model = &models[m];
    let z = &zones[zone];
    let mut found = Vec::new();
    // The stack is listed from the tool upwards.
    for (k, ply) in model.plies.iter().enumerate().rev() {
        let within = |p: &[f64; 3]| z.holds(p, 0.0);
        // The mesh of a zone reaches past it, to the nearest lines of the whole's.
        let inside: Vec<bool> = ply.undeformed.iter().map(within).collect();
        let mut measured = measure(ply, &inside, settings);
        let sheet = &model.sheets[k];
        let others = neighbours(&model.sheets, &model.plies, k);
        let limits = limits.of_ply(sheet.over_shear);
        find_causes(ply, &mut measured, sheet.laid().as_ref(), &others, &limits);
        let cuts = z.cuts(bounds_in_whole(models, &ply.name), bounds_of(ply));
        for defect in measured {
            let near = |side: usize| {
                let (d, level) = (side / 2, z.bounds[side / 2 + 2 * (side % 2)]);
                cuts[side]
                    && defect.nodes.iter().any(|&i| {
                        (ply.undeformed[i as usize][d] - level).abs() < 1.01 * model.element_size
                    })
            };
            let cut_sides = [0, 1, 2, 3].map(|side| model.role == Role::Local && near(side));
            let id = String::new();
            found.push(Entry {
                id,
                model: m,
                zone,
                ply: ply.name.clone(),
                cut_sides,
                defect,
            });
        }
    }
    found
}

/// Gives ids to the entries of one model and zone, and appends them.
fn number(entries: &mut Vec<Entry>, found: Vec<Entry>, locals: &[Entry], zones: &[Zone]) {
    let mut taken: Vec<String> = Vec::new();
    let count = |zone: usize, kind: Kind| {
        locals
            .iter()
            .filter(|l| l.zone == zone && l.defect.kind == kind)
            .count()
    };
    let mut next = [0, 0];
    for mut entry in found {
        let twin = twin(&entry, locals, &taken);
        entry.id = twin.unwrap_or_else(|| {
            let kind = entry.defect.kind;
            let next = &mut next[usize::from(kind == Kind::Bridging)];
            *next += 1;
            let number = count(entry.zone, kind) + *next;
            name_of(&zones[entry.zone].name, kind, number)
        });
        taken.push(entry.id.clone());
        entries.push(entry);
    }
}

/// The id of the most alike local defect of the same zone, ply and kind that is not taken yet.
fn twin(entry: &Entry, locals: &[Entry], taken: &[String]) -> Option<String> {
    locals
        .iter()
        .filter(|l| {
            l.zone == entry.zone
                && l.ply == entry.ply
                && l.defect.kind == entry.defect.kind
                && !taken.contains(&l.id)
                && apart(&l.defect, &entry.defect) <= same_within(&l.defect, &entry.defect)
        })
        .min_by(|a, b| {
            let [a, b] = [a, b].map(|l| {
                let d = apart(&l.defect, &entry.defect);
                unlike(&l.defect, &entry.defect, d)
            });
            a.total_cmp(&b)
        })
        .map(|l| l.id.clone())
}
