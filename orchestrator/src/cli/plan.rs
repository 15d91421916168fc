//! `plan`, `validate`, `graph`: what would be done.

use super::args::{GraphArgs, GraphFormat, PlanArgs, TextOrJson, ValidateArgs};
use super::confirm::Costs;
use super::found::change::{Difference, Fate, cost_of, cost_of_items, difference};
use super::on::On;
use super::open::{self, open};
use super::study_plan::Prospects;
use super::table::{first_line, or_none, table};
use crate::engine::Session;
use crate::engine::core::Id;
use crate::exit;
use crate::plan::{Change, KeyPart};
use crate::progress::duration_text;
use crate::said::{Done, Stop, print, show_findings, warn};
use plyflow_model::job::Cost;
use plyflow_plugin_host::cost_so_far;
use plyflow_workflow::Part;
use serde_json::json;

/// What a run would do with an instance, or with the hidden ones of a step.
pub struct Prospect {
    /// Name of the step, and the labels of its item; `None`: what is not known yet, or none at all.
    pub place: (String, Option<Vec<String>>),
    /// Whether it failed when it ran last.
    pub failed: bool,
    /// Label: `coarse`, `local[A]`, or `local x N (from zones)`.
    pub label: String,
    /// What a run does with it.
    pub fate: Fate,
    /// Why.
    pub reason: String,
    /// What it cost when it ran last, if that is known: of what is unknown, all items together.
    pub last: Option<Cost>,
}

/// `plyflow plan`.
///
/// # Errors
/// See [`Stop`].
pub fn plan(args: &PlanArgs) -> Done {
    let mut opened = open(&args.workflow)?;
    opened.restrict(&args.until)?;
    let on = On::chosen(args.on.as_deref(), &args.workflow.workflow)?;
    if let Some(on) = &on {
        on.prepare(&mut opened)?;
    }
    let session = opened.look()?;
    for text in session.told() {
        warn(&format!("plyflow: {text}\n"));
    }
    let allocations = on
        .as_ref()
        .map_or(String::new(), |on| on.text(&opened, &session));
    let study = Prospects::of(&session);
    if let (Some(study), TextOrJson::Text) = (&study, args.format) {
        return print(&(study.text() + &allocations));
    }
    let found = prospects(&session);
    if args.format == TextOrJson::Json {
        let list: Vec<_> = found
            .iter()
            .map(|p| {
                json!({"step": p.label, "name": p.place.0, "item": p.place.1,
                    "state": p.fate.word(), "failed": p.failed, "reason": p.reason,
                    "last_wall_seconds": p.last.map(|c| c.wall_seconds),
                    "last_cpu_seconds": p.last.map(|c| c.cpu_seconds)})
            })
            .collect();
        let mut all = match (study, Costs::of(&session)) {
            (Some(study), _) => json!({"study": study.as_json(), "steps": list}),
            (None, Some(costs)) => json!({"confirm": costs.as_json(), "steps": list}),
            (None, None) if on.is_some() => json!({"steps": list}),
            (None, None) => json!(list),
        };
        if let Some(on) = &on {
            all["allocations"] = on.as_json(&opened, &session);
        }
        return print(&format!("{all:#}\n"));
    }
    let rows: Vec<Vec<String>> = found
        .iter()
        .map(|p| {
            let wall = p.last.map(|c| duration_text(c.wall_seconds));
            let (label, fate) = (p.label.clone(), p.fate.word().to_owned());
            vec![label, fate, wall.unwrap_or_default(), p.reason.clone()]
        })
        .collect();
    let head = ["step", "state", "last time", "reason"];
    let costs = Costs::of(&session).map_or(String::new(), |c| format!("\n{}", c.text()));
    print(&(table(&head, &rows, &[2]) + &sum(&found) + &costs + &allocations))
}

/// How many of each fate, and what those that are not there took when they ran last.
fn sum(found: &[Prospect]) -> String {
    let count = |fate| found.iter().filter(|p| p.fate == fate).count();
    let mut text = format!(
        "{} to run, {} cached, {} unknown",
        count(Fate::Run),
        count(Fate::Cached),
        count(Fate::Unknown)
    );
    let open = || found.iter().filter(|p| p.fate != Fate::Cached);
    let cpu: f64 = open().filter_map(|p| p.last).map(|c| c.cpu_seconds).sum();
    let new = open().filter(|p| p.last.is_none()).count();
    if new < open().count() {
        text += &format!("; last time {} of CPU time", duration_text(cpu));
        match new {
            0 => {}
            1 => text += ", without one that did not run then",
            n => text += &format!(", without {n} that did not run then"),
        }
    }
    text + "\n"
}

/// What a run would do, step by step in the order of the workflow.
pub fn prospects(session: &Session<'_>) -> Vec<Prospect> {
    let core = &session.core;
    let mut by_step: Vec<Vec<Id>> = vec![Vec::new(); core.graph().steps.len()];
    for (id, instance) in core.instances().iter().enumerate() {
        by_step[instance.step].push(id);
    }
    let mut found = Vec::new();
    for (step, plan) in core.graph().steps.iter().enumerate() {
        if !plan.wanted {
            continue;
        }
        by_step[step].sort_by(|a, b| core.instances()[*a].item.cmp(&core.instances()[*b].item));
        found.extend(by_step[step].iter().map(|id| prospect(session, *id)));
        let hidden = core.hidden_by(step);
        if !hidden.is_empty() {
            let from: Vec<String> = hidden.iter().map(|id| core.label(*id)).collect();
            found.push(Prospect {
                place: (plan.name.clone(), None),
                failed: false,
                label: format!("{} x N (from {})", plan.name, from.join(", ")),
                fate: Fate::Unknown,
                reason: format!("how many is known when {} is done", from.join(", ")),
                last: cost_of_items(session, &plan.name, &hidden),
            });
        } else if by_step[step].is_empty() {
            found.push(Prospect {
                place: (plan.name.clone(), None),
                failed: false,
                label: format!("{} x 0", plan.name),
                fate: Fate::Cached,
                reason: "the collection it fans out over is empty".into(),
                last: None,
            });
        }
    }
    found
}

fn prospect(session: &Session<'_>, id: Id) -> Prospect {
    let core = &session.core;
    let instance = &core.instances()[id];
    let fate = Fate::of(instance.state);
    let reason = match (fate, session.failed_before(id)) {
        (Fate::Cached, _) => {
            let key = instance.key.map(|k| format!("key {}", k.short()));
            key.unwrap_or_default()
        }
        (Fate::Unknown, _) => waits_for(session, id),
        (Fate::Run, Some(f)) => {
            let first = first_line(&f.reason);
            format!("failed last time: {first}{}", goes_on(session, id))
        }
        (Fate::Run, None) => why(session, id) + &goes_on(session, id),
    };
    let name = &core.graph().steps[instance.step].name;
    let last = session.journal.last(name, &instance.item);
    Prospect {
        place: (name.clone(), Some(core.item_labels(id))),
        failed: fate == Fate::Run && session.failed_before(id).is_some(),
        label: core.label(id),
        fate,
        reason,
        last: last
            .filter(|_| fate != Fate::Cached)
            .and_then(|key| cost_of(session, &key)),
    }
}

/// Whether an instance goes on from a checkpoint, and what it has taken up to there.
fn goes_on(session: &Session<'_>, id: Id) -> String {
    let folder = session.core.instances()[id]
        .key
        .map(|key| session.folder().checkpoints(&session.core.label(id), &key));
    match folder.and_then(|f| cost_so_far(&f)) {
        Some(cost) => format!(
            "; goes on from a checkpoint, {} in",
            duration_text(cost.wall_seconds)
        ),
        None => String::new(),
    }
}

fn waits_for(session: &Session<'_>, id: Id) -> String {
    let core = &session.core;
    let step = &core.graph().steps[core.instances()[id].step];
    let mut names: Vec<&str> = step
        .wires
        .iter()
        .map(|w| core.graph().steps[w.from].name.as_str())
        .collect();
    names.retain(|n| {
        session
            .workflow
            .steps
            .iter()
            .zip(&core.graph().steps)
            .enumerate()
            .any(|(at, (w, _))| w.name == *n && !core.hidden_by(at).is_empty())
    });
    names.dedup();
    if names.is_empty() {
        return "an input is not known yet".into();
    }
    format!(
        "gathers {}, whose number is not known yet",
        names.join(", ")
    )
}

/// Why an instance must run, in one line.
fn why(session: &Session<'_>, id: Id) -> String {
    if let Some(flaw) = session.flaw(id) {
        return flaw.text().to_owned();
    }
    match difference(session, id) {
        Difference::Never => "has not run before".into(),
        Difference::Gone => "its artifact is not in the store any more".into(),
        Difference::Changed(list) => {
            let is_input = |c: &&Change| matches!(c.part, KeyPart::Input { .. });
            let (inputs, rest): (Vec<&Change>, Vec<&Change>) = list.iter().partition(is_input);
            let mut own: Vec<String> = (rest.iter())
                .map(|c| format!("{}: {} -> {}", c.part, or_none(&c.old), or_none(&c.new)))
                .collect();
            match inputs[..] {
                [] => {}
                [one] => own.push(format!("{} changed", one.part)),
                _ => own.push(format!("{} inputs changed", inputs.len())),
            }
            own.join("; ")
        }
    }
}

/// `plyflow validate`.
///
/// # Errors
/// [`exit::INVALID`] when there are findings.
pub fn validate(args: &ValidateArgs) -> Done {
    let outcome = match open::check_part(&args.workflow)? {
        Some(part) => part.map(|part| match part {
            Part::Scene => "a scene".to_owned(),
            Part::Material => "a material".to_owned(),
        }),
        None => open::load(&args.workflow)?.map(|o| {
            let n = o.workflow.steps.len();
            let steps = format!("{n} step{}", if n == 1 { "" } else { "s" });
            match &o.workflow.study {
                Some(study) => format!("{} points, {steps} in all", study.points.len()),
                None => steps,
            }
        }),
    };
    let json = args.format == TextOrJson::Json;
    match outcome {
        Ok(_) if json => print("[]\n"),
        Ok(what) => print(&format!("{}: {what}, no errors\n", args.workflow.workflow)),
        Err(findings) => {
            if json {
                // A reader that has gone away must not make findings a success.
                let _ = print(&format!("{:#}\n", findings.to_json()));
            } else {
                show_findings(&findings);
            }
            Err(Stop::silent(exit::INVALID))
        }
    }
}

/// `plyflow graph`.
///
/// # Errors
/// See [`Stop`].
pub fn graph(args: &GraphArgs) -> Done {
    let opened = open(&args.workflow)?;
    print(&match args.format {
        GraphFormat::Dot => plyflow_workflow::to_dot(&opened.workflow),
        GraphFormat::Mermaid => plyflow_workflow::to_mermaid(&opened.workflow),
    })
}
