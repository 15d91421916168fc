//! Step plugin `confirm`: follows the defects of zones through runs in other ways, and says which stay and between which bounds their sizes lie.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod bounds;
mod follow;
mod judged;
mod runs;
mod told;

pub use bounds::{Bounds, Measured, bounds};

use plyflow_defects::Settings;
use plyflow_model::artifact::{Confirmation, ConfirmedDefect, Stands};
use plyflow_sdk::{Host, Log, Progress, Step, StepError, export_step};
use serde::Deserialize;
use told::{Size, sizes};

/// The step.
pub struct Confirm;

export_step!(Confirm);

/// Shares of a size.
#[derive(Clone, Copy, Deserialize)]
struct Shares {
    /// By which it may change in a variant.
    tolerance: f64,
    /// By which all runs may be wrong together.
    shared_error: f64,
}

/// Defects that do not stay and are named in the warning.
const NAMED: usize = 8;

impl Step for Confirm {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let settings: Settings = host.parameters()?;
        let shares: Shares = host.parameters()?;
        host.progress(&Progress {
            phase: "reading",
            ..Default::default()
        });
        let all = runs::read(host, &settings)?;
        host.progress(&Progress {
            fraction: 0.5,
            phase: "following",
            ..Default::default()
        });
        let tracks = follow::follow(host, &all, &settings)?;
        let told = told::told(&all, &tracks, shares);
        warn(host, &told);
        host.write_attributes(&told)?;
        write_results(host, &told)
    }
}

/// Tells what does not stay.
fn warn(host: &Host, told: &Confirmation) {
    let level = if told.verdict.stays {
        Log::Info
    } else {
        Log::Warn
    };
    host.log(level, &told.verdict.text);
    if let Some(judged) = &told.judged {
        let text = format!(
            "judged by '{}': {} of {} bounds hold, {} defects are gone there, and {} are new",
            judged.step, judged.held, judged.bounds, judged.gone, judged.missed
        );
        host.log(Log::Info, &text);
    }
    let moves = |d: &&ConfirmedDefect| d.stands != Stands::Stays;
    let moving: Vec<&ConfirmedDefect> = told.defects.iter().filter(moves).collect();
    if moving.is_empty() {
        return;
    }
    let mut named: Vec<String> = (moving.iter().take(NAMED))
        .map(|d| format!("{}: {}", d.id, d.text))
        .collect();
    if moving.len() > NAMED {
        named.push(format!("and {} more", moving.len() - NAMED));
    }
    let text = format!(
        "{} of {} defects do not stay: {}",
        moving.len(),
        told.defects.len(),
        named.join("; ")
    );
    host.log(Log::Warn, &text);
}

fn write_results(host: &Host, told: &Confirmation) -> Result<(), StepError> {
    let count = |stands| {
        let those = told.defects.iter().filter(|d| d.stands == stands);
        those.count() as f64
    };
    host.result(
        "verdict_stays",
        f64::from(u8::from(told.verdict.stays)),
        "1",
    )?;
    host.result("defect_count", told.defects.len() as f64, "1")?;
    host.result("stay_count", count(Stands::Stays), "1")?;
    host.result("hang_count", count(Stands::Hangs), "1")?;
    host.result("gone_count", count(Stands::Gone), "1")?;
    let inside = told.new.iter().filter(|n| n.zone.is_some()).count();
    host.result("new_count", inside as f64, "1")?;
    host.result("outside_count", (told.new.len() - inside) as f64, "1")?;
    if let Some(judged) = &told.judged {
        host.result("bounds_judged", judged.bounds as f64, "1")?;
        host.result("bounds_held", judged.held as f64, "1")?;
        host.result("reference_gone", judged.gone as f64, "1")?;
        host.result("reference_missed", judged.missed as f64, "1")?;
        if judged.bounds > 0 {
            let share = judged.held as f64 / judged.bounds as f64;
            host.result("bounds_held_ratio", share, "1")?;
        }
    }
    for d in &told.defects {
        let stays = u8::from(d.stands == Stands::Stays);
        host.result(&format!("stays.{}", d.id), f64::from(stays), "1")?;
        for size in sizes(d.kind).0 {
            write_size(host, d, *size)?;
        }
    }
    Ok(())
}

fn write_size(host: &Host, d: &ConfirmedDefect, size: Size) -> Result<(), StepError> {
    let (name, unit) = (size.name(), size.unit());
    let bounds = &d.sizes[name];
    host.result(&format!("{name}_low.{}", d.id), bounds.low, unit)?;
    host.result(&format!("{name}_high.{}", d.id), bounds.high, unit)
}
