//! The runs of a workflow as studies: a global run, its defects and zones, its local runs, their comparison.

pub(crate) use crate::comparison::Comparison;
use crate::input::{Instance, ReportInput};
use crate::measured::{self, Measured};
use crate::others;
use crate::read::{self, Facts, History, Ply, Tool};
use crate::steps::{self, Shown};
use plyflow_model::artifact::{
    self, Attributes, Boundary, ComparedBody, Defects, Forming, Measurement, Zone, Zones,
    current_zones,
};
use serde::Deserialize;
use serde_json::Value;
use std::collections::BTreeSet;

/// Studies of which pictures are drawn; of more only tables are shown.
const DRAWN: usize = 6;

/// What one global run led to.
#[derive(Debug, Default)]
pub(crate) struct Study {
    /// Items of the global run, when there are several.
    pub(crate) title: String,
    /// The global run.
    pub(crate) global: Option<Run>,
    /// Its tool.
    pub(crate) tool: Option<Tool>,
    /// Its plies, formed, with what the detection found.
    pub(crate) plies: Vec<Ply>,
    /// What the detection tells of itself; absent without one.
    pub(crate) detection: Option<Defects>,
    /// Zones; absent when no step looked for them.
    pub(crate) zones: Option<Vec<Zone>>,
    /// One entry per zone with something to show.
    pub(crate) locals: Vec<Local>,
    /// What the comparison found; of several of the same zones, the first.
    pub(crate) comparison: Option<Comparison>,
    /// Local runs that only the other comparisons of these zones have, without plies and histories.
    pub(crate) further: Vec<Run>,
    /// A fine run of the whole scene.
    pub(crate) reference: Option<Run>,
    /// Measurements of the plies of the global run.
    pub(crate) measured: Vec<Measured>,
}

/// A forming run without its meshes.
#[derive(Debug)]
pub(crate) struct Run {
    /// Name for people.
    pub(crate) label: String,
    /// Index of its instance.
    pub(crate) instance: usize,
    /// Its attributes.
    pub(crate) facts: Forming,
    /// Bound on kinetic over internal energy that it was given.
    pub(crate) kinetic_bound: Option<f64>,
    /// Its history.
    pub(crate) history: History,
}

/// A local run.
#[derive(Debug)]
pub(crate) struct Local {
    /// Name of its zone.
    pub(crate) zone: String,
    /// The run.
    pub(crate) run: Option<Run>,
    /// Its plies, formed.
    pub(crate) plies: Vec<Ply>,
}

/// Everything that is read for a report.
#[derive(Debug, Default)]
pub(crate) struct Material {
    /// What each instance tells of itself; absent when its artifact cannot be read.
    pub(crate) facts: Vec<Option<Facts>>,
    /// The studies.
    pub(crate) studies: Vec<Study>,
    /// Steps with plots, files or numbers of their own.
    pub(crate) shown: Vec<Shown>,
    /// What could not be read, or is not shown.
    pub(crate) problems: Vec<String>,
}

impl Material {
    /// Reads the attributes of all artifacts; with `pictures` also meshes, fields and histories.
    pub(crate) fn read(input: &ReportInput, pictures: bool) -> Self {
        let mut reader = Reader {
            input,
            all: Self::default(),
            pictures,
        };
        for instance in &input.instances {
            let facts = Facts::read(&instance.artifact);
            let facts = reader.noted(&instance.label(), facts);
            reader.all.facts.push(facts);
        }
        reader.studies();
        let mut all = reader.all;
        if pictures {
            all.shown = steps::read(input, &all.facts, &mut all.problems);
        }
        all
    }
}

/// The instances of which a study is made.
struct Plan {
    global: usize,
    detection: Option<usize>,
    /// The last of its lists of zones, where there are others of the same detection.
    list: Option<usize>,
    /// Its lists of zones: the first, those drawn again after a first look, and so on.
    zones: Vec<usize>,
}

impl Plan {
    /// Of a run that nothing looked at.
    fn of_run(global: usize) -> Self {
        Self {
            global,
            detection: None,
            list: None,
            zones: Vec::new(),
        }
    }
}

struct Reader<'a> {
    input: &'a ReportInput,
    all: Material,
    pictures: bool,
}

impl Reader<'_> {
    /// Keeps what went wrong for the list of problems.
    fn noted<T>(&mut self, label: &str, result: Result<T, String>) -> Option<T> {
        result
            .map_err(|e| self.all.problems.push(format!("{label}: {e}")))
            .ok()
    }

    fn kind(&self, at: usize) -> &str {
        self.all.facts[at].as_ref().map_or("", |f| f.kind.as_str())
    }

    fn key(&self, at: usize) -> &str {
        &self.input.instances[at].record.key
    }

    /// Instances of a kind that took the artifact of `giver`.
    fn takers(&self, kind: &str, giver: usize) -> Vec<usize> {
        let key = self.key(giver);
        (0..self.all.facts.len())
            .filter(|at| self.kind(*at) == kind)
            .filter(|at| self.all.facts[*at].as_ref().is_some_and(|f| f.took(key)))
            .collect()
    }

    fn is_local(&self, at: usize) -> bool {
        self.all.facts[at]
            .as_ref()
            .is_some_and(|f| f.attributes["zone"].is_object())
    }

    /// The zone of a local run.
    fn zone(&self, at: usize) -> Result<Zone, serde_json::Error> {
        let facts = self.all.facts[at].as_ref();
        Zone::deserialize(facts.map_or(&Value::Null, |f| &f.attributes["zone"]))
    }

    fn studies(&mut self) {
        let forming: Vec<usize> = (0..self.all.facts.len())
            .filter(|at| self.kind(*at) == Forming::KIND)
            .collect();
        let references: BTreeSet<&str> = self
            .all
            .facts
            .iter()
            .flatten()
            .flat_map(|f| f.at_port("reference"))
            .collect();
        let mut plans: Vec<Plan> = Vec::new();
        for at in forming.iter().copied().filter(|at| !self.is_local(*at)) {
            let detections = self.takers(Defects::KIND, at);
            if detections.is_empty() && !references.contains(self.key(at)) {
                plans.push(Plan::of_run(at));
            }
            for detection in detections {
                plans.extend(self.plans(at, detection));
            }
        }
        // What was looked at comes before what was only run, as a drape.
        plans.sort_by_key(|p| p.detection.is_none());
        let wide = self.pictures;
        let many = plans.len() > 1;
        for (n, plan) in plans.iter().enumerate() {
            self.pictures = wide && n < DRAWN;
            let mut study = self.study(plan);
            if many {
                let steps = std::iter::once(plan.global)
                    .chain(plan.detection)
                    .chain(plan.list);
                let names: Vec<String> = steps.map(|at| self.instance(at).label()).collect();
                study.title = names.join(", ");
            }
            self.all.studies.push(study);
        }
        if plans.len() > DRAWN && wide {
            let text = format!(
                "maps are drawn for the first {DRAWN} of {} global runs",
                plans.len()
            );
            self.all.problems.push(text);
        }
    }

    /// What a detection led to: a study for each list of zones that was drawn from it.
    fn plans(&self, global: usize, detection: usize) -> Vec<Plan> {
        let of_list = |zones: Vec<usize>| Plan {
            global,
            detection: Some(detection),
            list: None,
            zones,
        };
        let lists = self.zone_lists(detection);
        let many = lists.len() > 1;
        let mut plans: Vec<Plan> = lists.into_iter().map(of_list).collect();
        for plan in plans.iter_mut().filter(|_| many) {
            plan.list = plan.zones.last().copied();
        }
        plans
    }

    /// Lists of zones that were drawn from what `giver` gave, each with those drawn again after a first look, and so on; one that
    /// is empty where none was.
    fn zone_lists(&self, giver: usize) -> Vec<Vec<usize>> {
        let takers = self.takers(Zones::KIND, giver);
        let is_first = |at: &&usize| {
            let facts = self.all.facts[**at].as_ref();
            !takers
                .iter()
                .any(|t| facts.is_some_and(|f| f.took(self.key(*t))))
        };
        let lists = takers.iter().filter(is_first).flat_map(|&at| {
            let further = self.zone_lists(at).into_iter();
            further.map(move |rest| std::iter::once(at).chain(rest).collect())
        });
        let lists: Vec<Vec<usize>> = lists.collect();
        if lists.is_empty() {
            vec![Vec::new()]
        } else {
            lists
        }
    }

    fn study(&mut self, plan: &Plan) -> Study {
        let (global, detection) = (plan.global, plan.detection);
        let mut study = Study {
            global: self.run(global),
            ..Study::default()
        };
        let zones_at = &plan.zones;
        if let Some(at) = detection {
            study.detection = self.attributes(at);
        }
        if !zones_at.is_empty() {
            let lists: Vec<Zones> = (zones_at.iter())
                .filter_map(|at| self.attributes(*at))
                .collect();
            let all = lists.into_iter().flat_map(|list| list.zones).collect();
            study.zones = Some(current_zones(all).0);
        }
        let compared = self.comparisons(zones_at, global);
        let comparison = compared.as_ref().map(|(drawn, _)| *drawn);
        let others = compared.map(|(_, others)| others).unwrap_or_default();
        if let Some(at) = comparison {
            study.comparison = self.attributes(at).map(|told| Comparison {
                told,
                label: self.instance(at).label(),
                missed: Comparison::missed_by(&self.instance(at).record.results),
                others: (others.iter().map(|o| self.instance(*o).label())).collect(),
            });
        }
        self.read_global(&mut study, global, detection);
        let mut locals: Vec<usize> = zones_at.iter().flat_map(|z| self.local_runs(*z)).collect();
        let zones = study.zones.clone().unwrap_or_default();
        locals.retain(|at| {
            let label = self.instance(*at).label();
            let own = self
                .zone(*at)
                .map_err(|e| format!("its attribute 'zone': {e}"));
            let own = self.noted(&label, own);
            own.is_some_and(|own| zones.iter().any(|z| z.is(&own)))
        });
        let locals = self.one_of_each_zone(locals, comparison);
        self.read_locals(&mut study, &locals, comparison);
        let reference = comparison.and_then(|c| {
            let key = self.all.facts[c]
                .as_ref()?
                .at_port("reference")
                .next()?
                .to_owned();
            (0..self.all.facts.len()).find(|at| self.key(*at) == key)
        });
        study.reference = reference.and_then(|at| self.run(at));
        self.read_further(&mut study, &others);
        self.read_measurements(&mut study, global);
        study
    }

    /// What compares the last of the lists of zones with the global run, or, while that has not run, an earlier one; and what else
    /// compares the same list.
    fn comparisons(&self, zones: &[usize], global: usize) -> Option<(usize, Vec<usize>)> {
        zones.iter().rev().find_map(|z| {
            let mut all = self.takers(artifact::Comparison::KIND, *z);
            let of_run = |at: &usize| {
                let facts = self.all.facts[*at].as_ref();
                facts.is_some_and(|f| f.took(self.key(global)))
            };
            let drawn = all.remove(all.iter().position(of_run)?);
            Some((drawn, all))
        })
    }

    /// Local runs of comparisons that are not drawn, each once.
    fn read_further(&mut self, study: &mut Study, others: &[usize]) {
        let facts = others.iter().filter_map(|o| self.all.facts[*o].as_ref());
        let wanted: BTreeSet<String> = facts
            .flat_map(|f| f.at_port("local"))
            .map(str::to_owned)
            .collect();
        let shown = study.locals.iter().filter_map(|l| l.run.as_ref());
        let shown = shown.chain(&study.reference).chain(&study.global);
        let mut seen: BTreeSet<String> = shown.map(|r| self.key(r.instance).to_owned()).collect();
        for at in 0..self.all.facts.len() {
            let key = self.key(at).to_owned();
            if wanted.contains(&key) && seen.insert(key) {
                study.further.extend(self.run_without_history(at));
            }
        }
    }

    fn read_measurements(&mut self, study: &mut Study, global: usize) {
        if !self.pictures {
            return;
        }
        for at in self.takers(Measurement::KIND, global) {
            let Some(facts) = self.all.facts[at].as_ref() else {
                continue;
            };
            let found = measured::read(&self.instance(at).artifact, facts, at);
            let label = self.instance(at).label();
            study.measured.extend(self.noted(&label, found));
            let added = others::add_slip(&self.instance(at).artifact, &mut study.plies);
            self.noted(&label, added);
        }
    }

    /// Of several runs of one zone (other elements, other sizes, other passes) the one that was compared, of several of these the last, as
    /// `comparison` has it; or else the finest.
    fn one_of_each_zone(&self, runs: Vec<usize>, comparison: Option<usize>) -> Vec<usize> {
        let facts = |at: usize| self.all.facts[at].as_ref();
        let compared: Vec<&str> = (comparison.and_then(facts).into_iter())
            .flat_map(|f| f.at_port("local"))
            .collect();
        let rank = |at: usize| {
            let size = facts(at).and_then(|f| f.attributes["element_size"].as_f64());
            let place = compared.iter().rposition(|key| *key == self.key(at));
            // The last place first, and what has none behind all.
            let passed_over = place.map_or(usize::MAX, |k| compared.len() - k);
            (passed_over, size.unwrap_or(f64::INFINITY))
        };
        let zone = |at: usize| self.zone(at).ok();
        let mut kept: Vec<usize> = Vec::new();
        for at in runs {
            match kept.iter_mut().find(|k| zone(**k) == zone(at)) {
                None => kept.push(at),
                Some(k) if rank(at) < rank(*k) => *k = at,
                Some(_) => {}
            }
        }
        kept
    }

    /// Forming runs whose boundary was made for the zones of an instance.
    fn local_runs(&self, zones: usize) -> Vec<usize> {
        let boundaries = self.takers(Boundary::KIND, zones);
        boundaries
            .into_iter()
            .flat_map(|b| self.takers(Forming::KIND, b))
            .collect()
    }

    fn instance(&self, at: usize) -> &Instance {
        &self.input.instances[at]
    }

    fn attributes<T: for<'de> Deserialize<'de>>(&mut self, at: usize) -> Option<T> {
        let value = self.all.facts[at].as_ref()?.attributes.clone();
        let result = serde_json::from_value(value).map_err(|e| format!("its attributes: {e}"));
        let label = self.instance(at).label();
        self.noted(&label, result)
    }

    fn run(&mut self, at: usize) -> Option<Run> {
        let mut run = self.run_without_history(at)?;
        if self.pictures {
            let read = History::read(&self.instance(at).artifact);
            run.history = self.noted(&run.label, read).unwrap_or_default();
        }
        Some(run)
    }

    fn run_without_history(&mut self, at: usize) -> Option<Run> {
        let facts: Forming = self.attributes(at)?;
        let provenance = &self.all.facts[at].as_ref()?.provenance;
        let kinetic_bound = provenance["parameters"]["kinetic_bound"].as_f64();
        Some(Run {
            label: self.instance(at).label(),
            instance: at,
            facts,
            kinetic_bound,
            history: History::default(),
        })
    }

    fn read_global(&mut self, study: &mut Study, global: usize, detection: Option<usize>) {
        if !self.pictures {
            return;
        }
        let path = self.instance(global).artifact.clone();
        let label = self.instance(global).label();
        study.tool = self.noted(&label, read::tool(&path)).flatten();
        let plies = match detection {
            Some(at) => {
                let label = self.instance(at).label();
                let plies = read::judged_plies(&self.instance(at).artifact);
                self.noted(
                    &label,
                    plies.map(|all| all.into_iter().map(|(_, p)| p).collect()),
                )
            }
            None => {
                let names = study
                    .global
                    .as_ref()
                    .map(|g| names_of_plies(&g.facts))
                    .unwrap_or_default();
                self.noted(&label, read::formed_plies(&path, &names))
            }
        };
        study.plies = plies.unwrap_or_default();
        if detection.is_some() {
            let added = others::add(&path, &mut study.plies);
            self.noted(&label, added);
        }
    }

    fn read_locals(&mut self, study: &mut Study, runs: &[usize], comparison: Option<usize>) {
        let mut judged: Vec<(Option<ComparedBody>, Ply)> = Vec::new();
        if let (Some(at), true) = (comparison, self.pictures) {
            let label = self.instance(at).label();
            let read = read::judged_plies(&self.instance(at).artifact);
            judged = self.noted(&label, read).unwrap_or_default();
        }
        for at in runs {
            let Some(run) = self.run(*at) else { continue };
            let zone = run.facts.zone.as_ref().map_or("?", |z| &z.name).to_owned();
            let compared = study.comparison.as_ref();
            let model = compared.and_then(|c| c.told.local_of(&zone));
            let model = model.map(|m| m.name.clone());
            let mut plies: Vec<Ply> = Vec::new();
            judged.retain_mut(|(about, ply)| {
                let of = about.as_ref().map(|a| a.model.as_str());
                let mine = model.is_some() && of == model.as_deref();
                if mine {
                    plies.push(std::mem::take(ply));
                }
                !mine
            });
            if plies.is_empty() && self.pictures {
                let path = self.instance(*at).artifact.clone();
                let read = read::formed_plies(&path, &names_of_plies(&run.facts));
                plies = self.noted(&run.label.clone(), read).unwrap_or_default();
            } else if self.pictures {
                let added = others::add(&self.instance(*at).artifact, &mut plies);
                self.noted(&run.label.clone(), added);
            }
            study.locals.push(Local {
                zone,
                run: Some(run),
                plies,
            });
        }
    }
}

/// Names of the plies in the order of the stack.
fn names_of_plies(facts: &Forming) -> Vec<String> {
    facts.plies().map(|s| s.name.clone()).collect()
}
