//! What `--confirm` costs: the steps of each variant beside those that they vary.

use super::found::change::{cost_of, cost_of_items};
use super::table::table;
use crate::engine::Session;
use crate::engine::core::{Id, State};
use crate::progress::duration_text;
use plyflow_model::artifact::Variation;
use plyflow_workflow::resolved::{Confirming, VariantStep};
use serde_json::{Value, json};

/// What a variant costs.
struct Cost {
    variant: Variation,
    /// Whether all of it is in the store.
    there: bool,
    /// How many times as much as what it varies (1), by CPU time where that is known.
    factor: f64,
    /// CPU time (s) of what is not in the store; `None`: what it varies has not run.
    cpu: Option<f64>,
}

/// What the variants of a workflow cost, as what they vary took.
pub struct Costs<'s> {
    confirming: &'s Confirming,
    variants: Vec<Cost>,
    /// CPU time (s) of all other steps, if all have run.
    workflow: Option<f64>,
}

impl<'s> Costs<'s> {
    /// Looks at a session; `None` without `--confirm`.
    pub fn of(session: &Session<'s>) -> Option<Self> {
        let confirming = session.workflow.confirming.as_ref()?;
        let of = |variant: Variation| {
            let steps: Vec<&VariantStep> = (confirming.steps.iter())
                .filter(|s| s.variant == variant)
                .collect();
            (!steps.is_empty()).then(|| Cost::of(session, variant, &steps))
        };
        let added =
            |name: &str| name == confirming.step || confirming.steps.iter().any(|s| s.name == name);
        let own = session.core.graph().steps.iter();
        let own = own.filter(|s| !added(&s.name));
        Some(Self {
            confirming,
            variants: Variation::ALL.into_iter().filter_map(of).collect(),
            workflow: own.map(|s| took(session, &s.name)).sum(),
        })
    }

    /// CPU time (s) of all that is not in the store.
    fn cpu(&self) -> Option<f64> {
        self.variants.iter().map(|c| c.cpu).sum()
    }

    /// In words.
    pub fn text(&self) -> String {
        let row = |c: &Cost| {
            let time = match (c.there, c.cpu) {
                (true, _) => "in the store".to_owned(),
                (false, Some(cpu)) => format!("about {}", duration_text(cpu)),
                (false, None) => "not known yet".to_owned(),
            };
            let factor = format!("{:.1}", c.factor);
            vec![
                c.variant.name().to_owned(),
                c.variant.how().to_owned(),
                factor,
                time,
            ]
        };
        let rows: Vec<Vec<String>> = self.variants.iter().map(row).collect();
        let head = ["variant", "the zones again", "times as much", "CPU time"];
        let mut text = String::from("confirm:\n") + &table(&head, &rows, &[2, 3]);
        for left_out in &self.confirming.left_out {
            let (variant, why) = (left_out.variant, &left_out.why);
            text += &format!("left out: {} ({}): {why}\n", variant.name(), variant.how());
        }
        let open = self.variants.iter().any(|c| !c.there);
        match (open, self.cpu(), self.workflow) {
            (false, ..) => {}
            (_, Some(cpu), Some(workflow)) if workflow > 0.0 => {
                text += &format!(
                    "together about {} of CPU time, {:.1} times what the workflow took\n",
                    duration_text(cpu),
                    cpu / workflow
                );
            }
            (_, Some(cpu), _) => {
                text += &format!("together about {} of CPU time\n", duration_text(cpu));
            }
            (_, None, _) => {
                text += "how long that takes is known when the steps that are varied have run\n"
            }
        }
        text
    }

    /// For programs.
    pub fn as_json(&self) -> Value {
        let variants = self.variants.iter().map(|c| {
            json!({"variant": c.variant.name(), "in_store": c.there, "times_as_much": c.factor, "estimated_cpu_seconds": c.cpu})
        });
        let left_out = self.confirming.left_out.iter();
        let left_out = left_out.map(|l| json!({"variant": l.variant.name(), "reason": l.why}));
        json!({
            "variants": variants.collect::<Vec<_>>(), "left_out": left_out.collect::<Vec<_>>(),
            "estimated_cpu_seconds": self.cpu(), "workflow_cpu_seconds": self.workflow,
        })
    }
}

impl Cost {
    fn of(session: &Session<'_>, variant: Variation, steps: &[&VariantStep]) -> Self {
        let is_there = |s: &&&VariantStep| is_there(session, &s.name);
        let there = steps.iter().all(|s| is_there(&s));
        let took_each: Vec<Option<f64>> = steps.iter().map(|s| took(session, &s.of)).collect();
        let sum = |with: &dyn Fn(usize) -> f64| -> Option<f64> {
            let each = took_each.iter().enumerate();
            each.map(|(k, t)| Some(with(k) * (*t)?)).sum()
        };
        let all = sum(&|k| steps[k].factor);
        let cpu = sum(&|k| {
            if is_there(&&steps[k]) {
                0.0
            } else {
                steps[k].factor
            }
        });
        // The fine runs, which come last, take nearly all of the time.
        let last = steps.last().map_or(1.0, |s| s.factor);
        let factor = match (all, sum(&|_| 1.0)) {
            (Some(all), Some(base)) if base > 0.0 => all / base,
            _ => last,
        };
        Self {
            variant,
            there,
            factor,
            cpu,
        }
    }
}

/// The instances of a step, and those that hide others.
fn of_step(session: &Session<'_>, name: &str) -> (Vec<Id>, Vec<Id>) {
    let core = &session.core;
    let Some(step) = core.graph().find(name) else {
        return Default::default();
    };
    let all = core.instances().iter().enumerate();
    let ids = all.filter(|(_, i)| i.step == step).map(|(id, _)| id);
    (ids.collect(), core.hidden_by(step))
}

/// Whether all of a step is in the store.
fn is_there(session: &Session<'_>, name: &str) -> bool {
    let (ids, hidden) = of_step(session, name);
    let done = |id: &Id| matches!(session.core.instances()[*id].state, State::Done { .. });
    hidden.is_empty() && ids.iter().all(done)
}

/// CPU time (s) that a step took, now or when it ran last; `None` when that is not known of all of it.
fn took(session: &Session<'_>, name: &str) -> Option<f64> {
    let (ids, hidden) = of_step(session, name);
    let one = |id: &Id| {
        let instance = &session.core.instances()[*id];
        let done = matches!(instance.state, State::Done { .. });
        let key = if done {
            instance.key
        } else {
            session.journal.last(name, &instance.item)
        };
        Some(cost_of(session, &key?)?.cpu_seconds)
    };
    let known: Option<f64> = ids.iter().map(one).sum();
    match hidden.is_empty() {
        true => known,
        false => Some(known? + cost_of_items(session, name, &hidden)?.cpu_seconds),
    }
}
