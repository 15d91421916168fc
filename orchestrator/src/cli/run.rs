//! `run`.

mod conclude;
pub(super) mod interrupts;
mod optimise;
mod settings;

use super::args::{LogFormat, RunArgs};
use super::confirm::Costs;
use super::on::{On, Place};
use super::open::{Opened, load, store_root};
use crate::engine::{Observer, Purpose, Session, Summary};
use crate::exit;
use crate::said::{Done, Stop, show_findings, warn};
use crate::store::{Early, Store};
use conclude::{about_to_read, conclude};
use interrupts::Interrupts;
use serde_json::json;
use settings::{ROUNDS, observer, options};
use std::time::Instant;

fn damaged_again() -> Stop {
    let text = format!(
        "made again {ROUNDS} times in this run, and each time damaged when it was read: look after the disk and the memory of this machine"
    );
    Stop::new(exit::DAMAGED, text)
}

/// `plyflow run`.
///
/// # Errors
/// See [`exit`].
pub fn run(args: &RunArgs) -> Done {
    let begun = Instant::now();
    let file = &args.workflow.workflow;
    if file.is_file() {
        let root = store_root(&args.workflow.places, Some(file));
        std::fs::create_dir_all(&root)
            .map_err(Stop::machine(format!("making the store {root}")))?;
    }
    let early = Early::begin(&Store::new(store_root(&args.workflow.places, Some(file))));
    let mut opened = opened(args)?;
    if let Some(o) = optimise::of(&opened) {
        drop(early);
        return optimise::run(args, &opened, o, begun);
    }
    opened.restrict(&args.until)?;
    let on = On::chosen(args.on.as_deref(), file)?;
    if let Some(on) = &on {
        on.prepare(&mut opened)?;
    }
    let options = options(args, &opened)?;
    let _locks = opened.lock()?;
    let machine = || Stop::machine(format!("running with the store {}", opened.store.root()));
    let mut session = opened.session(options, Purpose::Run(early))?;
    let mut observer = observer(args);
    session.look(observer.as_mut());
    if let Err(stop) = opened.admit(&session) {
        observer.end();
        return Err(stop);
    }
    let interrupts = Interrupts::listen().map_err(machine())?;
    let wake = interrupts.poll_end().map_err(machine())?;
    let mut place = Place::open(on.as_ref(), &opened, wake)?;
    for text in session.told() {
        tell_damage(args, text);
    }
    tell_costs(args, &session);
    let observer = observer.as_mut();
    let (session, all) = rounds(args, &opened, session, &mut place, observer, &interrupts)?;
    let end = conclude(args, &opened, &session, &all, begun);
    // The process ends with this: to give ten thousand steps back to the allocator takes longer than to look at them.
    std::mem::forget(session);
    std::mem::forget(opened);
    end
}

/// The workflow, or what is wrong with it in the form that was asked for.
fn opened(args: &RunArgs) -> Result<Opened, Stop> {
    let findings = match load(&args.workflow)? {
        Ok(opened) => return Ok(opened),
        Err(findings) => findings,
    };
    match args.log_format {
        LogFormat::Json => {
            let line = json!({"event": "invalid", "findings": findings.to_json()});
            warn(&format!("{line}\n"));
        }
        LogFormat::Text => show_findings(&findings),
    }
    Err(Stop::silent(exit::INVALID))
}

/// Runs what is missing, and again what turns out to be damaged, as long as that helps.
fn rounds<'o>(
    args: &RunArgs,
    opened: &'o Opened,
    mut session: Session<'o>,
    place: &mut Place,
    observer: &mut dyn Observer,
    interrupts: &Interrupts,
) -> Result<(Session<'o>, Summary), Stop> {
    let machine = Stop::machine(format!("running with the store {}", opened.store.root()));
    let mut all = Summary::default();
    let mut round = 0;
    let lost = loop {
        let wishes = || interrupts.count() + place.wishes.get();
        let (ended, summary) = match session.execute(place.executor.as_mut(), observer, &wishes) {
            Ok(ended) => ended,
            Err(e) => return Err(machine(e)),
        };
        session = ended;
        all.add(summary);
        // What is about to be printed is read first.
        let lost = match about_to_read(args, opened, &session, &all) {
            Some(depth) if !all.interrupted => session.recheck(&|_| true, depth, observer),
            _ => 0,
        };
        if lost == 0 || round == ROUNDS {
            break lost;
        }
        round += 1;
    };
    place.executor.close();
    match lost {
        0 => Ok((session, all)),
        _ => Err(damaged_again()),
    }
}

/// Says beforehand what the variants of `--confirm` cost.
fn tell_costs(args: &RunArgs, session: &Session<'_>) {
    if args.quiet || args.log_format == LogFormat::Json {
        return;
    }
    if let Some(costs) = Costs::of(session) {
        warn(&costs.text());
    }
}

/// Says what was found damaged of the files of the run itself.
fn tell_damage(args: &RunArgs, text: &str) {
    match args.log_format {
        LogFormat::Json => {
            let line = json!({"event": "damaged", "what": text});
            warn(&format!("{line}\n"));
        }
        LogFormat::Text => warn(&format!("plyflow: {text}\n")),
    }
}
