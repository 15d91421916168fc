//! One JSON object per event on standard error, for programs.

use crate::engine::core::{Core, Id};
use crate::engine::{Observer, Update};
use serde_json::{Value, json};

/// Writes `{"event", "step", "item", ..}` lines.
pub struct JsonLines;

impl Observer for JsonLines {
    fn update(&mut self, core: &Core<'_>, id: Id, update: &Update<'_>) {
        let (event, more) = match update {
            Update::Cached => ("cached", json!({})),
            Update::Damaged { what } => ("damaged", json!({"what": what})),
            Update::Started { threads, attempt } => {
                ("started", json!({"threads": threads, "attempt": attempt}))
            }
            Update::Progress(p) => ("progress", serde_json::to_value(p).unwrap_or_default()),
            Update::Log { level, text } => ("log", json!({"level": level, "text": text})),
            Update::Finished(r) => ("finished", json!({"cost": r.cost, "bytes": r.bytes})),
            Update::Failed { reason, again } => {
                ("failed", json!({"reason": reason, "again": again}))
            }
            Update::Stopped => ("stopped", json!({})),
            Update::Skipped { cause } => ("skipped", json!({"cause": core.label(*cause)})),
        };
        let instance = &core.instances()[id];
        let mut line = json!({
            "event": event,
            "step": core.graph().steps[instance.step].name,
            "item": core.item_labels(id),
            "key": instance.key.map(|k| k.hex()),
        });
        if let (Value::Object(line), Value::Object(more)) = (&mut line, more) {
            line.extend(more);
        }
        crate::said::warn(&format!("{line}\n"));
    }
}
