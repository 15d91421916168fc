//! What has come of an optimisation.

use super::answer::{Line, is_answer, outcome};
use super::asked::Kept;
use crate::cli::table::{head, number};
use crate::engine::Session;
use plyflow_model::artifact::{StudyBest, StudyOptimisation};
use plyflow_study::Found;
use plyflow_study::optimise::{Entry, Outcome, Told, best, trace};
use plyflow_workflow::resolved::{Budget, FamilyExpectation, Study, StudyPoint, StudyValue};

/// A column of numbers: its name, its unit, and the positions of the points that have a value, with it.
pub type Column = (String, String, Vec<(u32, f64)>);

/// How far an optimisation has come with each of its points.
#[derive(Debug)]
pub struct Trace {
    /// Of the points that have been told, in their order.
    told: Vec<Told>,
    entries: Vec<Entry>,
    /// The SI units of the constraints.
    constraints: Vec<String>,
    /// Whether its budget is used up, or its method has nothing more to ask.
    pub ended: bool,
    settled: bool,
    maximise: bool,
    objective: usize,
}

impl Trace {
    /// Reads it off the table; `None` for a study.
    pub fn of(session: &Session<'_>, study: &Study, lines: &[Line]) -> Option<Self> {
        let o = study.optimisation.as_ref()?;
        let (search, points) = o.search.as_ref()?;
        let mut told = Vec::new();
        for (point, line) in points.iter().zip(lines) {
            if !is_answer(line) {
                break;
            }
            // A constraint that cannot be computed has stopped the run.
            let Ok(outcome) = outcome(o, study, point, line) else {
                break;
            };
            told.push(Told {
                point: point.clone(),
                outcome,
            });
        }
        let kept = Kept::read(&session.store.run(&session.workflow.name), &o.digest);
        let kept = kept.unwrap_or_default();
        let spent = match o.budget {
            Budget::Runs(most) => told.len() >= most as usize,
            Budget::CpuSeconds(most) => kept.cpu_seconds >= most,
        };
        Some(Self {
            entries: trace(search, &told).ok()?,
            constraints: o.constraints.clone(),
            ended: told.len() == points.len() && (spent || kept.settled),
            settled: kept.settled,
            maximise: o.maximise,
            objective: o.objective,
            told,
        })
    }

    /// The number of a response that the method sees as small.
    fn value(&self, at: usize) -> Option<f64> {
        match &self.told.get(at)?.outcome {
            Outcome::Done { objective, .. } if self.maximise => Some(-objective),
            Outcome::Done { objective, .. } => Some(*objective),
            Outcome::Failed => None,
        }
    }

    /// Heads of its columns.
    pub fn heads(&self, study: &Study) -> Vec<String> {
        let mut all = vec!["asked".to_owned()];
        all.extend((1..=self.constraints.len()).map(|k| format!("excess_{k}")));
        all.push("feasible".into());
        let unit = &study.responses[self.objective].unit;
        all.push(head("best_so_far", unit));
        all
    }

    /// Cells of a row.
    pub fn cells(&self, at: usize, number: impl Fn(f64) -> String) -> Vec<String> {
        let mut all = vec![(at + 1).to_string()];
        let excess = self.told.get(at).and_then(|t| match &t.outcome {
            Outcome::Done { excess, .. } => Some(excess),
            Outcome::Failed => None,
        });
        let one = |k: usize| excess.and_then(|e| e.get(k)).map(|e| number(*e));
        all.extend((0..self.constraints.len()).map(|k| one(k).unwrap_or_default()));
        let entry = self.entries.get(at);
        all.push(match entry.and_then(|e| e.feasible) {
            Some(true) => "yes".into(),
            Some(false) => "no".into(),
            None => String::new(),
        });
        let best = self.best_so_far(at);
        all.push(best.map(number).unwrap_or_default());
        all
    }

    /// The best value of a point that meets the constraints, so far.
    fn best_so_far(&self, at: usize) -> Option<f64> {
        let best = self.entries.get(at)?.best?;
        self.told[best]
            .outcome
            .is_feasible()
            .then(|| self.value(best))
            .flatten()
    }

    /// What of it are numbers, for the artifact.
    pub fn columns(&self, study: &Study) -> Vec<Column> {
        let mut all = Vec::new();
        let rows = || 0..self.told.len();
        for (k, unit) in self.constraints.iter().enumerate() {
            let value = |i: usize| match &self.told[i].outcome {
                Outcome::Done { excess, .. } => Some((i as u32, *excess.get(k)?)),
                Outcome::Failed => None,
            };
            let known = rows().filter_map(value).collect();
            all.push((format!("excess_{}", k + 1), unit.clone(), known));
        }
        let feasible = |i: usize| {
            let feasible = self.entries[i].feasible?;
            Some((i as u32, f64::from(u8::from(feasible))))
        };
        let known = rows().filter_map(feasible).collect();
        all.push(("feasible".into(), "1".into(), known));
        let best = |i: usize| Some((i as u32, self.best_so_far(i)?));
        let unit = study.responses[self.objective].unit.clone();
        all.push((
            "best_so_far".into(),
            unit,
            rows().filter_map(best).collect(),
        ));
        all
    }

    /// In one sentence.
    pub fn in_words(&self, study: &Study) -> String {
        let name = &study.responses[self.objective].name;
        let unit = &study.responses[self.objective].unit;
        let ended = match (self.ended, self.settled) {
            (true, true) => "its method has nothing more to ask",
            (true, false) => "its budget is used up",
            _ => "it is not at its end",
        };
        let failed = self
            .told
            .iter()
            .filter(|t| t.outcome == Outcome::Failed)
            .count();
        let told = self.told.len();
        match best(&self.told) {
            Some(at) => {
                let value = number(self.value(at).unwrap_or(f64::NAN));
                let unit = if unit == "1" { "" } else { unit };
                let value = format!("{value} {unit}");
                let value = value.trim_end();
                format!(
                    "best of {told} ({failed} failed): {name} = {value} at {}; {ended}\n",
                    study.points[at].name
                )
            }
            None => {
                format!("none of {told} points ({failed} failed) meets what must hold; {ended}\n")
            }
        }
    }

    /// For programs; `None` for a study.
    pub fn told(&self, study: &Study) -> Option<StudyOptimisation> {
        let o = study.optimisation.as_ref()?;
        let response = &study.responses[self.objective];
        let best = best(&self.told).map(|at| StudyBest {
            point: study.points[at].name.clone(),
            value: self.value(at),
        });
        Some(StudyOptimisation {
            objective: response.name.clone(),
            unit: response.unit.clone(),
            maximise: self.maximise,
            subject_to: o.subject_to.clone(),
            method: o.method.clone(),
            seed: o.seed,
            told: self.told.len(),
            ended: self.ended,
            settled: self.settled,
            feasible: self.entries.iter().map(|e| e.feasible).collect(),
            best_so_far: (0..self.told.len()).map(|i| self.best_so_far(i)).collect(),
            best,
        })
    }
}

/// Why there is no best point to be judged; empty where there is one.
pub fn why_not(trace: Option<&Trace>) -> &'static str {
    match trace {
        Some(t) if t.ended && best(&t.told).is_some() => "",
        Some(t) if t.ended => " (no point meets what must hold)",
        _ => " (the optimisation is not at its end)",
    }
}

/// The number of an expectation on the best point, once the optimisation is at its end.
pub fn found(trace: Option<&Trace>, study: &Study, lines: &[Line], e: &FamilyExpectation) -> Found {
    let Some(trace) = trace.filter(|t| t.ended) else {
        return Found::default();
    };
    let at = best(&trace.told);
    let place = at.and_then(|at| e.points.iter().position(|p| *p as usize == at));
    let Some((at, place)) = at.zip(place) else {
        return Found::default();
    };
    let point: &StudyPoint = &study.points[at];
    let value = match e.over.map(|v| &point.values[v]) {
        Some(StudyValue::Number { si, .. }) => Some(*si),
        // Only a number is looked at.
        Some(_) => None,
        None => lines[at].responses[e.response],
    };
    Found {
        value,
        at: vec![place],
        ..Found::default()
    }
}
