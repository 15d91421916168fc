//! The history of a run for the host.

use crate::course::{HistoryRow, Outcome};
use crate::error::Result;
use crate::forming::Forming;
use plyflow_mechanics::contact::ContactEnergy;
use plyflow_mechanics::energy::SheetEnergy;
use plyflow_sdk::Host;

/// The columns of the history.
pub fn write_history(host: &Host, forming: &Forming, outcome: &Outcome) -> Result<()> {
    let of_press = forming.load.press().map(|_| HistoryRow::OF_PRESS);
    let columns = HistoryRow::COLUMNS.into_iter();
    for (name, unit, value) in columns.chain(of_press.into_iter().flatten()) {
        let data: Vec<f64> = outcome.history.iter().map(value).collect();
        host.write_f64(&format!("history/{name}"), &[data.len()], unit, &data)?;
    }
    let Some(stamping) = forming.load.stamping() else {
        return Ok(());
    };
    for (k, name) in stamping.names().enumerate() {
        for (c, (what, unit)) in [("force", "N"), ("way", "m")].into_iter().enumerate() {
            let rows = outcome.history.iter();
            let data: Vec<f64> = rows.map(|r| r.parts.get(k).map_or(0.0, |p| p[c])).collect();
            host.write_f64(
                &format!("history/{name}/{what}"),
                &[data.len()],
                unit,
                &data,
            )?;
        }
    }
    Ok(())
}

/// Energies by sheet and by interface over the times of the history, and depths by pair.
pub fn write_energies(host: &Host, forming: &Forming, outcome: &Outcome) -> Result<()> {
    type Of<T> = (&'static str, fn(&T) -> f64);
    let sheet: [Of<SheetEnergy>; 4] = [
        ("kinetic", |e| e.kinetic),
        ("membrane", |e| e.membrane),
        ("bending", |e| e.bending),
        ("hourglass", |e| e.hourglass),
    ];
    let interface: [Of<ContactEnergy>; 4] = [
        ("stored", |e| e.stored),
        ("friction", |e| e.friction),
        ("damping", |e| e.damping),
        ("work", |e| e.work),
    ];
    let write = |path: String, data: Vec<f64>| host.write_f64(&path, &[data.len()], "J", &data);
    let rows = &outcome.history;
    for (k, s) in forming.model.sheets().iter().enumerate() {
        for (what, of) in sheet {
            let data = rows.iter().map(|r| r.sheets.get(k).map_or(0.0, of));
            write(format!("history/sheets/{}/{what}", s.name), data.collect())?;
        }
    }
    for (k, (name, _)) in forming.model.interface_energies().enumerate() {
        for (what, of) in interface {
            let data = rows.iter().map(|r| r.interfaces.get(k).map_or(0.0, of));
            write(format!("history/interfaces/{name}/{what}"), data.collect())?;
        }
    }
    for (k, d) in outcome.depths.iter().enumerate() {
        let data: Vec<f64> = (rows.iter())
            .map(|r| r.depths.get(k).copied().unwrap_or(0.0))
            .collect();
        if data.iter().all(|depth| *depth == 0.0) {
            continue;
        }
        let path = format!("history/depth/{}", d.pair.name);
        host.write_f64(&path, &[data.len()], "m", &data)?;
    }
    Ok(())
}
