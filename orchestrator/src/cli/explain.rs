//! `explain`: why a step would run.

use super::args::{ExplainArgs, TextOrJson};
use super::found::change::{Difference, Fate, difference};
use super::open::{Opened, open};
use super::table::or_none;
use crate::engine::Session;
use crate::engine::core::{Id, State};
use crate::exit;
use crate::plan::KeyPart;
use crate::said::{Done, Stop, print};
use crate::store::Flaw;
use serde_json::json;

/// The instances that a word means: all of a step, or one by its label.
///
/// # Errors
/// When there is none; says what there is.
pub fn instances_named(
    opened: &Opened,
    session: &Session<'_>,
    word: &str,
) -> Result<Vec<Id>, Stop> {
    let core = &session.core;
    let step = word.split('[').next().unwrap_or(word);
    let of = opened.step_indices(&[step.to_owned()])?;
    let all: Vec<Id> = (0..core.instances().len())
        .filter(|id| of.contains(&core.instances()[*id].step))
        .collect();
    if step == word {
        return Ok(all);
    }
    let labels: Vec<String> = all.iter().map(|id| core.label(*id)).collect();
    let by_index = |id: &Id| {
        let path: Vec<String> = core.instances()[*id]
            .item
            .iter()
            .map(u64::to_string)
            .collect();
        word == format!("{step}[{}]", path.join(","))
    };
    let by_label = labels.iter().position(|l| l == word);
    match by_label.or_else(|| all.iter().position(by_index)) {
        Some(at) => Ok(vec![all[at]]),
        None if labels.is_empty() => Err(Stop::new(
            exit::USAGE,
            format!(
                "the items of '{step}' are not known before the collection it fans out over is made"
            ),
        )),
        None => {
            let text = format!("there is no '{word}'; there are: {}", labels.join(", "));
            Err(Stop::new(exit::USAGE, text))
        }
    }
}

/// `plyflow explain`.
///
/// # Errors
/// See [`Stop`].
pub fn explain(args: &ExplainArgs) -> Done {
    let opened = open(&args.workflow)?;
    let session = opened.look()?;
    let ids = instances_named(&opened, &session, &args.step)?;
    if args.format == TextOrJson::Json {
        let list: Vec<_> = ids.iter().map(|id| as_json(&session, *id)).collect();
        return print(&format!("{:#}\n", json!(list)));
    }
    let mut out = String::new();
    for id in &ids {
        out += &as_text(&session, *id);
    }
    if ids.is_empty() {
        let hidden = session
            .core
            .hidden_by(opened.step_indices(std::slice::from_ref(&args.step))?[0]);
        let from: Vec<String> = hidden.iter().map(|id| session.core.label(*id)).collect();
        out = match from.len() {
            0 => format!(
                "{}: no items; the collection it fans out over is empty\n",
                args.step
            ),
            _ => format!("{}: unknown until {} is done\n", args.step, from.join(", ")),
        };
    }
    print(&out)
}

fn as_json(session: &Session<'_>, id: Id) -> serde_json::Value {
    let instance = &session.core.instances()[id];
    let fate = Fate::of(instance.state);
    let flaw = session.flaw(id).filter(|_| fate == Fate::Run);
    let (last, changed) = match (instance.state, difference(session, id)) {
        (State::Done { .. } | State::Unkeyed, _) => ("", vec![]),
        _ if flaw.is_some() => ("damaged", vec![]),
        (_, Difference::Never) => ("never", vec![]),
        (_, Difference::Gone) => ("gone", vec![]),
        (_, Difference::Changed(list)) => ("changed", list),
    };
    json!({
        "step": session.core.label(id),
        "state": fate.word(),
        "key": instance.key.map(|k| k.hex()),
        "because": last,
        "changes": changed,
        "damage": flaw.map(Flaw::text),
        "failed": session.failed_before(id).map(|f| f.reason),
    })
}

fn as_text(session: &Session<'_>, id: Id) -> String {
    let instance = &session.core.instances()[id];
    let label = session.core.label(id);
    let key = instance.key.map(|k| k.short()).unwrap_or_default();
    match instance.state {
        State::Done { .. } => return format!("{label}: cached; key {key}\n"),
        State::Unkeyed => {
            return format!(
                "{label}: unknown; an input is not known before earlier steps have run\n"
            );
        }
        _ => {}
    }
    if let Some(failed) = session.failed_before(id) {
        let reason = failed.reason.replace('\n', "\n  ");
        return format!("{label}: will run; it failed last time (key {key}):\n  {reason}\n");
    }
    if let Some(flaw) = session.flaw(id) {
        let text = flaw.text();
        return format!("{label}: will run; nothing changed, but {text}\n");
    }
    match difference(session, id) {
        Difference::Never => format!("{label}: will run; it has not run before (key {key})\n"),
        Difference::Gone => {
            format!(
                "{label}: will run; nothing changed, but its artifact {key} is not in the store\n"
            )
        }
        Difference::Changed(list) => {
            let mut out = format!("{label}: will run; what changed since the last run:\n");
            for c in list {
                out += &format!(
                    "  {}\n    old: {}\n    new: {}\n",
                    c.part,
                    or_none(&c.old),
                    or_none(&c.new)
                );
                if let KeyPart::Input { from, .. } = &c.part {
                    out += &format!(
                        "    why: plyflow explain {} '{from}'\n",
                        session.workflow.file
                    );
                }
            }
            out
        }
    }
}
