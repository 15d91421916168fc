//! Everything that is read for a report: the runs of a workflow as studies, each of a global run with what it led to.

use crate::input::ReportInput;
use crate::plain::Ply;
use crate::read::comparison::Comparison;
use crate::read::error::{ReadError, form};
use crate::read::facts::Facts;
use crate::read::history::History;
use crate::read::links::Links;
use crate::read::study::{Local, Run, Study};
use crate::read::{frames, measured, others, plies};
use camino::Utf8Path;
use plyflow_model::artifact::{
    Attributes, ComparedBody, Defects, Forming, Measurement, Zones, current_zones,
};
use serde::de::DeserializeOwned;
use std::collections::BTreeSet;

/// Studies of which pictures are drawn; of more only tables are shown.
const DRAWN: usize = 6;

/// Everything that is read for a report.
#[derive(Debug, Default)]
pub(crate) struct Material {
    /// What each instance tells of itself; absent when its artifact cannot be read.
    pub(crate) facts: Vec<Option<Facts>>,
    /// The studies.
    pub(crate) studies: Vec<Study>,
    /// What could not be read, or is not shown.
    pub(crate) problems: Vec<String>,
}

impl Material {
    /// Reads the attributes of all artifacts; with `pictures` also meshes, fields and histories.
    pub(crate) fn read(input: &ReportInput, pictures: bool) -> Self {
        let mut problems = Vec::new();
        let mut facts = Vec::new();
        for instance in &input.instances {
            let read = Facts::read(&instance.artifact);
            let said = |e| problems.push(format!("{}: {e}", instance.label()));
            facts.push(read.map_err(said).ok());
        }
        let links = Links {
            input,
            facts: &facts,
        };
        let mut reader = Reader {
            links,
            problems,
            pictures,
        };
        let studies = reader.studies();
        Self {
            problems: reader.problems,
            studies,
            facts,
        }
    }
}

/// The instances of which a study is made.
#[derive(Default)]
struct Plan {
    global: usize,
    detection: Option<usize>,
    /// The last of its lists of zones, where there are others of the same detection.
    list: Option<usize>,
    /// Its lists of zones: the first, those drawn again after a first look, and so on.
    zones: Vec<usize>,
}

/// A study for each detection in a run and each list of zones that was drawn from it, and for each run that nothing looked at. What was looked
/// at comes before what was only run, as a drape.
fn plans(links: Links<'_>) -> Vec<Plan> {
    let references: BTreeSet<&str> = links.at_port(0..links.facts.len(), "reference").collect();
    let (mut looked_at, mut only_run) = (Vec::new(), Vec::new());
    for global in links
        .of_kind(Forming::KIND)
        .filter(|at| !links.is_local(*at))
    {
        let detections = links.takers(Defects::KIND, global);
        if detections.is_empty() && !references.contains(links.key(global)) {
            only_run.push(Plan {
                global,
                ..Plan::default()
            });
        }
        for detection in detections {
            let lists = links.zone_lists(detection);
            let many = lists.len() > 1;
            looked_at.extend(lists.into_iter().map(|zones| Plan {
                global,
                detection: Some(detection),
                list: zones.last().copied().filter(|_| many),
                zones,
            }));
        }
    }
    looked_at.append(&mut only_run);
    looked_at
}

struct Reader<'a> {
    links: Links<'a>,
    problems: Vec<String>,
    pictures: bool,
}

impl<'a> Reader<'a> {
    /// Keeps what went wrong with an instance for the list of problems.
    fn noted<T>(&mut self, at: usize, result: Result<T, ReadError>) -> Option<T> {
        let label = || self.links.instance(at).label();
        let said = |e| self.problems.push(format!("{}: {e}", label()));
        result.map_err(said).ok()
    }

    fn path(&self, at: usize) -> &'a Utf8Path {
        &self.links.instance(at).artifact
    }

    fn studies(&mut self) -> Vec<Study> {
        let plans = plans(self.links);
        let wide = self.pictures;
        let mut studies = Vec::new();
        for (n, plan) in plans.iter().enumerate() {
            self.pictures = wide && n < DRAWN;
            let mut study = self.study(plan);
            if plans.len() > 1 {
                let steps = [Some(plan.global), plan.detection, plan.list];
                let names = steps.iter().flatten();
                let names: Vec<String> = names.map(|at| self.links.instance(*at).label()).collect();
                study.title = names.join(", ");
            }
            studies.push(study);
        }
        if plans.len() > DRAWN && wide {
            let all = plans.len();
            self.problems.push(format!(
                "maps are drawn for the first {DRAWN} of {all} global runs"
            ));
        }
        studies
    }

    fn study(&mut self, plan: &Plan) -> Study {
        let links = self.links;
        let mut study = Study {
            global: self.run(plan.global),
            detection: plan.detection.and_then(|at| self.attributes(at)),
            detected_by: plan.detection,
            ..Study::default()
        };
        if !plan.zones.is_empty() {
            let lists = plan.zones.iter().filter_map(|at| self.attributes(*at));
            let all = lists.flat_map(|list: Zones| list.zones).collect();
            study.zones = Some(current_zones(all).0);
        }
        let compared = links.comparisons(&plan.zones, plan.global);
        let (comparison, others) = compared.map_or((None, Vec::new()), |(c, o)| (Some(c), o));
        study.comparison = comparison.and_then(|at| {
            Some(Comparison {
                told: self.attributes(at)?,
                label: links.instance(at).label(),
                missed: Comparison::missed_by(&links.instance(at).record.results),
                others: (others.iter().map(|o| links.instance(*o).label())).collect(),
            })
        });
        self.read_global(&mut study, plan);
        let lists = plan.zones.iter();
        let mut locals: Vec<usize> = lists.flat_map(|z| links.local_runs(*z)).collect();
        let zones = study.zones.as_deref().unwrap_or_default();
        locals.retain(|at| {
            let own = links.zone(*at).and_then(|own| self.noted(*at, own));
            own.is_some_and(|own| zones.iter().any(|z| z.is(&own)))
        });
        let locals = links.one_of_each_zone(locals, comparison);
        self.read_locals(&mut study, &locals, comparison);
        let confirmed = links.confirmation(&locals);
        study.confirmed = confirmed.and_then(|at| self.attributes(at));
        let reference = links.at_port(comparison, "reference").next();
        let reference =
            reference.and_then(|key| (0..links.facts.len()).find(|at| links.key(*at) == key));
        study.reference = reference.and_then(|at| self.run(at));
        self.read_further(&mut study, &others);
        self.read_measurements(&mut study, plan.global);
        study
    }

    /// Local runs of comparisons that are not drawn, each once.
    fn read_further(&mut self, study: &mut Study, others: &[usize]) {
        let links = self.links;
        let wanted: BTreeSet<&str> = links.at_port(others.iter().copied(), "local").collect();
        let mut seen: BTreeSet<&str> = study.runs().map(|r| links.key(r.instance)).collect();
        for at in 0..links.facts.len() {
            if wanted.contains(links.key(at)) && seen.insert(links.key(at)) {
                study.further.extend(self.run_without_history(at));
            }
        }
    }

    fn read_measurements(&mut self, study: &mut Study, global: usize) {
        if !self.pictures {
            return;
        }
        for at in self.links.takers(Measurement::KIND, global) {
            let Some(facts) = self.links.facts(at) else {
                continue;
            };
            let found = measured::read(self.path(at), facts, at);
            let found = self.noted(at, found).unwrap_or_default();
            study.measured.extend(found);
            self.noted(at, others::add_slip(self.path(at), &mut study.plies));
        }
    }

    fn attributes<T: DeserializeOwned>(&mut self, at: usize) -> Option<T> {
        let value = self.links.facts(at)?.attributes.clone();
        self.noted(
            at,
            serde_json::from_value(value).map_err(form("attributes")),
        )
    }

    fn run(&mut self, at: usize) -> Option<Run> {
        let mut run = self.run_without_history(at)?;
        if self.pictures {
            let read = History::read(self.path(at));
            run.history = self.noted(at, read).unwrap_or_default();
        }
        Some(run)
    }

    fn run_without_history(&mut self, at: usize) -> Option<Run> {
        Some(Run {
            label: self.links.instance(at).label(),
            instance: at,
            key: self.links.key(at).to_owned(),
            facts: self.attributes(at)?,
            kinetic_bound: self.links.facts(at)?.kinetic_bound(),
            history: History::default(),
        })
    }

    fn read_global(&mut self, study: &mut Study, plan: &Plan) {
        if !self.pictures {
            return;
        }
        let path = self.path(plan.global);
        study.tool = self.noted(plan.global, plies::tool(path)).flatten();
        let Some(at) = plan.detection else {
            let unread = Forming::default();
            let told = study.global.as_ref().map_or(&unread, |g| &g.facts);
            let plies = plies::formed_plies(path, told);
            study.plies = self.noted(plan.global, plies).unwrap_or_default();
            study.laid();
            study.frames = self
                .noted(plan.global, frames::read(path, &study.plies))
                .flatten();
            return;
        };
        let plies = self.noted(at, plies::judged_plies(self.path(at)));
        let plies = plies.into_iter().flatten();
        study.plies = plies.map(|(_, ply)| ply).collect();
        self.noted(plan.global, others::add(path, &mut study.plies));
        study.laid();
        study.frames = self
            .noted(plan.global, frames::read(path, &study.plies))
            .flatten();
    }

    fn read_locals(&mut self, study: &mut Study, runs: &[usize], comparison: Option<usize>) {
        let mut judged: Vec<(Option<ComparedBody>, Ply)> = Vec::new();
        if let Some(at) = comparison.filter(|_| self.pictures) {
            let read = plies::judged_plies(self.path(at));
            judged = self.noted(at, read).unwrap_or_default();
        }
        for &at in runs {
            let Some(run) = self.run(at) else { continue };
            let zone = run.facts.zone.as_ref().map_or("?", |z| &z.name).to_owned();
            let compared = study.comparison.as_ref();
            let model = compared.and_then(|c| c.told.local_of(&zone));
            let is_mine = |(about, _): &mut (Option<ComparedBody>, Ply)| {
                let about = about.as_ref().zip(model);
                about.is_some_and(|(about, model)| about.model == model.name)
            };
            let mine = judged.extract_if(.., is_mine);
            let mut plies: Vec<Ply> = mine.map(|(_, ply)| ply).collect();
            if plies.is_empty() && self.pictures {
                let read = plies::formed_plies(self.path(at), &run.facts);
                plies = self.noted(at, read).unwrap_or_default();
            } else if self.pictures {
                self.noted(at, others::add(self.path(at), &mut plies));
            }
            for ply in &mut plies {
                ply.laid_as(&run.facts.sheets);
            }
            study.locals.push(Local { zone, run, plies });
        }
    }
}
