//! `plan` of a study: its points, what they share, and what is left to do costs.

use super::found::answer::is_answer_of;
use super::found::change::cost_of;
use super::table::{first_line, head, shortened, table};
use crate::engine::Session;
use crate::engine::core::{Id, State};
use crate::progress::duration_text;
use plyflow_workflow::resolved::{Budget, Study};
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// Points that are listed.
const SHOWN: usize = 20;

/// Steps of which the cost is looked up to estimate that of others like them.
const LOOKED_AT: usize = 50;

/// What of a study is there and what is not.
pub struct Prospects<'s> {
    study: &'s Study,
    /// By step of the file.
    steps: Vec<Step>,
    /// Positions of the points of which something is missing, and what of them failed last time.
    open: Vec<(usize, Option<String>)>,
    /// Points of an optimisation that failed: answers, which are not run again.
    failed: usize,
}

/// A step of the file, at all points.
struct Step {
    name: String,
    /// How many different ones there are.
    count: usize,
    cached: usize,
    run: usize,
    /// Those whose items are not known yet.
    unknown: usize,
    /// What one took (CPU, s), on average, if any is there.
    took: Option<f64>,
    /// What those that are missing take (CPU, s).
    estimate: f64,
    /// Missing ones of which nothing is known.
    without: usize,
}

impl<'s> Prospects<'s> {
    /// Looks at a session; `None` when the workflow is no study.
    pub fn of(session: &Session<'s>) -> Option<Self> {
        let study = session.workflow.study.as_ref()?;
        let core = &session.core;
        let mut by_step: Vec<Vec<Id>> = vec![Vec::new(); core.graph().steps.len()];
        for (id, instance) in core.instances().iter().enumerate() {
            by_step[instance.step].push(id);
        }
        let mut fates: Vec<Fate> = (0..by_step.len())
            .map(|step| Fate::of(session, step, &by_step[step]))
            .collect();
        let answered = answered(session, study, &by_step);
        leave_out_answered(study, &answered, &mut fates);
        let steps = (0..study.steps.len()).map(|at| {
            let mut all: Vec<usize> = study.points.iter().map(|p| p.steps[at]).collect();
            all.sort_unstable();
            all.dedup();
            Step::of(session, &study.steps[at], &all, &by_step, &fates)
        });
        let steps = steps.collect();
        // A step that a failed point shares with another one is run for that one.
        let is_open = |p: &usize| {
            let mut of = study.points[*p].steps.iter();
            !answered[*p] && of.any(|s| !matches!(fates[*s], Fate::Cached | Fate::LeftOut))
        };
        let failed: Vec<Option<String>> = (by_step.iter())
            .map(|ids| {
                let failure = ids.iter().find_map(|id| session.failed_before(*id))?;
                Some(format!(
                    "{}: {}",
                    failure.label,
                    first_line(&failure.reason)
                ))
            })
            .collect();
        let failure = |p: usize| {
            study.points[p]
                .steps
                .iter()
                .find_map(|s| failed[*s].clone())
        };
        let open = (0..study.points.len()).filter(is_open);
        let open = open.map(|p| (p, failure(p))).collect();
        let failed = answered.iter().filter(|failed| **failed).count();
        Some(Self {
            study,
            steps,
            open,
            failed,
        })
    }

    fn estimate(&self) -> f64 {
        self.steps.iter().map(|s| s.estimate).sum()
    }

    fn without(&self) -> usize {
        self.steps.iter().map(|s| s.without).sum()
    }

    /// The first points that are to run, one a line; empty when there are none.
    fn to_run(&self) -> String {
        let mut out = String::new();
        if !self.open.is_empty() {
            out += "\npoints to run:\n";
            for (p, failure) in self.open.iter().take(SHOWN) {
                out += &format!("  {}", self.study.points[*p].name);
                if let Some(text) = failure {
                    out += &format!("   failed last time: {}", shortened(text));
                }
                out.push('\n');
            }
            if self.open.len() > SHOWN {
                out += &format!("  and {} more\n", self.open.len() - SHOWN);
            }
        }
        out
    }

    /// In words.
    pub fn text(&self) -> String {
        let names: Vec<String> = self
            .study
            .variables
            .iter()
            .map(|v| head(&v.name, &v.unit))
            .collect();
        let (all, open) = (self.study.points.len(), self.open.len());
        let s = if all == 1 { "" } else { "s" };
        let mut out = format!(
            "study over {}: {all} point{s}, {} done, {}{open} to run\n",
            names.join(", "),
            all - open - self.failed,
            match self.failed {
                0 => String::new(),
                n => format!("{n} failed (not run again), "),
            }
        );
        out += "\n";
        let row = |s: &Step| {
            let seconds = |t: f64| duration_text(t);
            vec![
                s.name.clone(),
                match (s.count, all) {
                    (1, 2..) => "one for all points".into(),
                    (n, all) if n == all => "one for each point".into(),
                    (n, _) => format!("{n} for {all} points"),
                },
                s.cached.to_string(),
                s.run.to_string(),
                s.unknown.to_string(),
                s.took.map(seconds).unwrap_or_default(),
                if s.without > 0 {
                    "not known".into()
                } else {
                    seconds(s.estimate)
                },
            ]
        };
        let rows: Vec<Vec<String>> = self.steps.iter().map(row).collect();
        let heads = [
            "step",
            "shared",
            "cached",
            "to run",
            "items unknown",
            "one took (CPU)",
            "estimate (CPU)",
        ];
        out += &table(&heads, &rows, &[2, 3, 4, 5, 6]);
        out += &self.to_run();
        out + "\n" + &self.cost() + &ahead(self.study, self.of_a_point())
    }

    /// What a further point would take (CPU, s): the steps that are not the same for all. `None`: not known.
    fn of_a_point(&self) -> Option<f64> {
        let all = self.study.points.len();
        let own = self.steps.iter().filter(|s| s.count == all || all == 1);
        own.map(|s| s.took).sum()
    }

    fn cost(&self) -> String {
        let missing: usize = self.steps.iter().map(|s| s.run + s.unknown).sum();
        match (missing, self.without()) {
            (0, _) => "nothing to run\n".into(),
            (n, w) if n == w => format!(
                "{n} steps to run; none like them has run yet, so that their cost is not known\n"
            ),
            (n, w) => {
                let known = duration_text(self.estimate());
                let mut text =
                    format!("{n} steps to run; about {known} of CPU time, as such steps took");
                if w > 0 {
                    text += &format!(", without {w} of which none like them has run yet");
                }
                text + "\n"
            }
        }
    }

    /// For programs.
    pub fn as_json(&self) -> Value {
        let steps = self.steps.iter().map(|s| {
            json!({"step": s.name, "different": s.count, "cached": s.cached, "run": s.run, "unknown": s.unknown,
                "mean_cpu_seconds": s.took, "estimated_cpu_seconds": s.estimate, "without_estimate": s.without})
        });
        let name = |(p, _): &(usize, Option<String>)| self.study.points[*p].name.as_str();
        json!({
            "variables": self.study.variables.iter().map(|v| v.name.as_str()).collect::<Vec<_>>(),
            "points": self.study.points.len(),
            "points_failed": self.failed,
            "points_to_run": self.open.iter().map(name).collect::<Vec<_>>(),
            "steps": steps.collect::<Vec<_>>(),
            "estimated_cpu_seconds": self.estimate(),
            "steps_without_estimate": self.without(),
            "optimisation": ahead_json(self.study, self.of_a_point()),
        })
    }
}

/// For each point whether it is one of an optimisation that failed, which is an answer to its method.
fn answered(session: &Session<'_>, study: &Study, by_step: &[Vec<Id>]) -> Vec<bool> {
    let is_answer = |id: &Id| {
        let failure = session.failed_before(*id);
        failure.is_some_and(|f| is_answer_of(&f.label, &f.reason))
    };
    let point = |steps: &[usize]| {
        let mut all = steps.iter().flat_map(|s| &by_step[*s]);
        study.optimisation.is_some() && all.any(is_answer)
    };
    study.points.iter().map(|p| point(&p.steps)).collect()
}

/// Steps that only such points have are not run.
fn leave_out_answered(study: &Study, answered: &[bool], fates: &mut [Fate]) {
    let points = || study.points.iter().zip(answered);
    let of = |wanted: bool| {
        let those = points().filter(move |(_, failed)| **failed == wanted);
        those.flat_map(|(p, _)| p.steps.iter().copied())
    };
    let needed: BTreeSet<usize> = of(false).collect();
    for step in of(true).filter(|s| !needed.contains(s)) {
        if fates[step] != Fate::Cached {
            fates[step] = Fate::LeftOut;
        }
    }
}

/// Where a step of the graph stands.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fate {
    Cached,
    /// This part of it is missing.
    Run(f64),
    /// How many items it has is not known.
    Unknown,
    /// Not wanted (`--until`).
    LeftOut,
}

impl Fate {
    fn of(session: &Session<'_>, step: usize, ids: &[Id]) -> Self {
        let core = &session.core;
        if !core.graph().steps[step].wanted {
            return Self::LeftOut;
        }
        if !core.hidden_by(step).is_empty() {
            return Self::Unknown;
        }
        let done = |id: &&Id| matches!(core.instances()[**id].state, State::Done { .. });
        let missing = ids.len() - ids.iter().filter(done).count();
        match missing {
            0 => Self::Cached,
            n => Self::Run(n as f64 / ids.len() as f64),
        }
    }
}

impl Step {
    fn of(
        session: &Session<'_>,
        name: &str,
        all: &[usize],
        by_step: &[Vec<Id>],
        fates: &[Fate],
    ) -> Self {
        let cpu = |step: usize| -> Option<f64> {
            let ids = by_step[step].iter();
            let costs = ids.map(|id| cost_of(session, &session.core.instances()[*id].key?));
            costs.map(|c| Some(c?.cpu_seconds)).sum()
        };
        let cached: BTreeSet<usize> = (all.iter().copied())
            .filter(|s| fates[*s] == Fate::Cached)
            .collect();
        // Spread over all that are there, so that a dear corner of the study counts.
        let apart = cached.len().div_ceil(LOOKED_AT).max(1);
        let known: Vec<f64> = cached
            .iter()
            .step_by(apart)
            .filter_map(|s| cpu(*s))
            .collect();
        let took = (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64);
        let mut step = Self {
            name: name.to_owned(),
            count: all.len(),
            cached: cached.len(),
            run: 0,
            unknown: 0,
            took,
            estimate: 0.0,
            without: 0,
        };
        for at in all {
            let part = match fates[*at] {
                Fate::Cached | Fate::LeftOut => continue,
                Fate::Run(part) => {
                    step.run += 1;
                    part
                }
                Fate::Unknown => {
                    step.unknown += 1;
                    1.0
                }
            };
            match own(session, *at, &by_step[*at]).or(took) {
                Some(cpu) => step.estimate += part * cpu,
                None => step.without += 1,
            }
        }
        step
    }
}

/// How much of the budget is left, for `plan`; empty for a study.
fn ahead(study: &Study, of_a_point: Option<f64>) -> String {
    let Some(o) = &study.optimisation else {
        return String::new();
    };
    let (asked, word) = (
        study.points.len(),
        if o.maximise { "maximise" } else { "minimise" },
    );
    let name = &study.responses[o.objective].name;
    let mut out = format!("optimisation: {word} {name}, method {}, ", o.method);
    let took = of_a_point.map(duration_text);
    match o.budget {
        Budget::Runs(most) => {
            let left = (most as usize).saturating_sub(asked);
            out += &format!("budget {most} points: {asked} asked for, at most {left} more");
            if let (Some(one), true) = (of_a_point, left > 0) {
                out += &format!(", about {} of CPU time", duration_text(one * left as f64));
            }
        }
        Budget::CpuSeconds(most) => {
            out += &format!(
                "budget {} of CPU time: {asked} points asked for",
                duration_text(most)
            );
            if let Some(one) = took {
                out += &format!(", one takes about {one}");
            }
        }
    }
    out + "\n"
}

/// As [`ahead`], for programs.
fn ahead_json(study: &Study, of_a_point: Option<f64>) -> serde_json::Value {
    let Some(o) = &study.optimisation else {
        return serde_json::Value::Null;
    };
    let (runs, cpu) = match o.budget {
        Budget::Runs(most) => (Some(most), None),
        Budget::CpuSeconds(most) => (None, Some(most)),
    };
    let left = runs.map(|most| (most as usize).saturating_sub(study.points.len()));
    let more = left.zip(of_a_point).map(|(n, one)| n as f64 * one);
    json!({
        "objective": study.responses[o.objective].name, "maximise": o.maximise, "method": o.method,
        "budget_runs": runs, "budget_cpu_seconds": cpu, "asked": study.points.len(), "at_most_more": left,
        "estimated_cpu_seconds_more": more,
    })
}

/// CPU time (s) that a step took itself when it ran last, with other parameters perhaps: nearer than what others took. `ids`: its instances.
fn own(session: &Session<'_>, step: usize, ids: &[Id]) -> Option<f64> {
    let name = &session.core.graph().steps[step].name;
    let last = ids.iter().map(|id| {
        let item = &session.core.instances()[*id].item;
        let last = session.journal.last(name, item)?;
        Some(cost_of(session, &last)?.cpu_seconds)
    });
    last.sum::<Option<f64>>().filter(|_| !ids.is_empty())
}
