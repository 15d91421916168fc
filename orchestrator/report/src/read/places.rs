//! Where the defects of a study's tables lie on its plies.

use crate::plain::{Place, cells_of, id_of, of_cells, ring};
use crate::read::study::Study;
use plyflow_model::artifact::{ComparedDefect, Role};
use std::collections::BTreeMap;

/// Places of all defects of a study that lie on a ply which the page has: those of the comparison and of measurements.
pub(crate) fn places(study: &Study, n: usize) -> Vec<Place> {
    let mut all = Vec::new();
    let defects = study.comparison.iter().flat_map(|c| &c.told.defects);
    let mut named: BTreeMap<String, Vec<&ComparedDefect>> = BTreeMap::new();
    for d in defects {
        named.entry(d.id.clone()).or_default().push(d);
    }
    let is_local = |d: &ComparedDefect| {
        let c = study.comparison.as_ref();
        c.is_some_and(|c| c.told.role(&d.model) == Some(Role::Local))
    };
    for (id, models) in named {
        let d = models.iter().find(|d| is_local(d)).unwrap_or(&models[0]);
        let on_local = is_local(d).then(|| of_local(study, d)).flatten();
        let found = on_local.or_else(|| {
            let ply = study.plies.iter().find(|p| p.name == d.ply)?;
            ring(ply, d)
        });
        all.extend(found.map(|place| Place {
            id: id_of(n, &id),
            label: id.clone(),
            ply: d.ply.clone(),
            ..place
        }));
    }
    all.extend(study.measured.iter().cloned());
    all
}

/// A defect on the finer ply of its zone: the marked cells of its kind that hang together about its centre.
fn of_local(study: &Study, d: &ComparedDefect) -> Option<Place> {
    let local = study.locals.iter().find(|l| l.zone == d.zone)?;
    let ply = local.plies.iter().find(|p| p.name == d.ply)?;
    let others = study.comparison.iter().flat_map(|c| c.told.local_defects());
    let rivals: Vec<[f64; 2]> = others
        .filter(|o| o.id != d.id && o.zone == d.zone && o.ply == d.ply)
        .filter(|o| o.found.kind == d.found.kind)
        .map(|o| o.found.centre)
        .collect();
    let cells = cells_of(ply, &d.found, &rivals);
    let mut place = if cells.is_empty() {
        ring(ply, d)?
    } else {
        of_cells(&ply.flat, &ply.formed, &cells)
    };
    place.zone = Some(d.zone.clone());
    Some(place)
}
