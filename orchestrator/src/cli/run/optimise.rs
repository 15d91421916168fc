//! `run` of a workflow with `optimise`: asks its method for points, runs them as those of a study, tells what became of them, and goes on.
//!
//! Every round is a run of the workflow at the points that are new. What a method asks for depends on what it was told alone, and what it is told
//! is in the store: so the same command goes on after a kill, and asks for the same points.

use super::conclude::conclude;
use super::interrupts::Interrupts;
use super::settings::{ROUNDS, observer, options};
use crate::cli::args::RunArgs;
use crate::cli::found::answer::{Line, is_answer, no_answer, outcome};
use crate::cli::found::asked::Kept;
use crate::cli::found::change::cost_of;
use crate::cli::found::points::Table;
use crate::cli::found::rows::records;
use crate::cli::on::{On, Place};
use crate::cli::open::{Opened, open_at};
use crate::engine::core::State;
use crate::engine::{Depth, Purpose, Session, Summary};
use crate::exit;
use crate::plan::Key;
use crate::said::{Done, Stop};
use plyflow_plugin_host::children_seconds;
use plyflow_study::Value;
use plyflow_study::optimise::{Asked, Search, Told};
use plyflow_workflow::resolved::{Budget, Optimisation, Study};
use std::collections::{BTreeMap, HashSet};
use std::time::Instant;

/// What an opened workflow optimises, if it does.
pub fn of(opened: &Opened) -> Option<Optimisation> {
    opened.workflow.study.as_ref()?.optimisation.clone()
}

/// Where the steps of all rounds run.
#[derive(Default)]
struct Places {
    /// What `--on` says, once a round has something to run.
    on: Option<Option<On>>,
    place: Option<Place>,
}

impl Places {
    /// What `--on` says.
    fn on(&mut self, args: &RunArgs) -> Result<Option<&On>, Stop> {
        if self.on.is_none() {
            self.on = Some(On::chosen(args.on.as_deref(), &args.workflow.workflow)?);
        }
        Ok(self.on.as_ref().and_then(Option::as_ref))
    }

    /// The place for a round.
    fn open(&mut self, opened: &Opened, interrupts: &Interrupts) -> Result<&mut Place, Stop> {
        if self.place.is_none() {
            let root = opened.store.root();
            let wake = interrupts
                .poll_end()
                .map_err(Stop::machine(format!("running with the store {root}")))?;
            let on = self.on.as_ref().and_then(Option::as_ref);
            self.place = Some(Place::open(on, opened, wake)?);
        }
        Ok(self.place.as_mut().expect("just opened"))
    }

    /// A round has ended. Allocations stay for the next one: each may have waited in a queue for hours. Workers of this machine end, as only
    /// then what they took is known.
    fn rest(&mut self) {
        if !matches!(self.on, Some(Some(_))) {
            self.close();
        }
    }

    fn close(&mut self) {
        if let Some(mut place) = self.place.take() {
            place.executor.close();
        }
    }
}

impl Drop for Places {
    fn drop(&mut self) {
        self.close();
    }
}

/// How far a run has come.
#[derive(Default)]
struct Way {
    told: Vec<Told>,
    summary: Summary,
    cpu_seconds: f64,
    /// As [`Kept::failed`]: of this run and of those before.
    failed: BTreeMap<String, f64>,
    /// Keys of artifacts and failures that have been counted.
    seen: HashSet<Key>,
    settled: bool,
    /// What the machine could not do.
    broken: Option<String>,
}

/// The points of the next round: what the search asks for, as far as the budget goes; none when it is over.
fn asked(search: &Search, o: &Optimisation, way: &mut Way) -> Result<Vec<Vec<Value>>, Stop> {
    let mut points = match search.ask(&way.told).map_err(wrong)? {
        Asked::Points(points) => points,
        Asked::Settled => Vec::new(),
    };
    way.settled = points.is_empty();
    points.truncate(match o.budget {
        Budget::Runs(most) => (most as usize).saturating_sub(way.told.len()),
        Budget::CpuSeconds(most) if way.cpu_seconds >= most => 0,
        Budget::CpuSeconds(_) => usize::MAX,
    });
    Ok(points)
}

/// Runs an optimisation to the end of its budget.
///
/// # Errors
/// As `run`.
pub fn run(args: &RunArgs, opened: &Opened, o: Optimisation, begun: Instant) -> Done {
    if !args.until.is_empty() {
        let text =
            "--until: an optimisation runs whole, as its method needs the response of every point";
        return Err(Stop::new(exit::USAGE, text));
    }
    let Some((search, _)) = &o.search else {
        return Err(Stop::new(
            exit::INTERNAL,
            "the search of this optimisation is missing",
        ));
    };
    let folder = opened.store.run(&opened.workflow.name);
    let root = format!("the store {}", opened.store.root());
    let _locks = opened.lock()?;
    let machine = || Stop::machine(format!("running with {root}"));
    let interrupts = Interrupts::listen().map_err(machine())?;
    let kept = Kept::read(&folder, &o.digest);
    let mut way = Way {
        failed: kept.map_or_else(BTreeMap::new, |k| k.failed),
        ..Way::default()
    };
    let mut places = Places::default();
    loop {
        let points = asked(search, &o, &mut way)?;
        keep(&o, &way, &points).write(&folder).map_err(machine())?;
        if points.is_empty() {
            break;
        }
        let before = way.told.len();
        round(args, points.clone(), &mut way, (&mut places, &interrupts))?;
        // What failed in a round that ends the run has taken its time as well.
        let rest = &points[way.told.len() - before..];
        keep(&o, &way, rest).write(&folder).map_err(machine())?;
        if way.told.len() == before {
            way.broken
                .get_or_insert("no point of this round has an answer".into());
        }
        if way.summary.interrupted || way.broken.is_some() {
            break;
        }
    }
    drop(places);
    let all: Vec<Vec<Value>> = way.told.iter().map(|t| t.point.clone()).collect();
    let opened = open_at(&args.workflow, &all)?;
    let session = opened.look()?;
    conclude(args, &opened, &session, &way.summary, begun)?;
    match way.broken {
        Some(reason) => {
            let text = format!("{reason}; the same command goes on");
            Err(Stop::new(exit::STEP_FAILED, text))
        }
        None => Ok(()),
    }
}

fn wrong(problem: plyflow_study::Problem) -> Stop {
    Stop::new(
        exit::INVALID,
        format!("the optimisation cannot go on: {problem}"),
    )
}

fn keep(o: &Optimisation, way: &Way, new: &[Vec<Value>]) -> Kept {
    let told = way.told.iter().map(|t| &t.point);
    let text = |p: &Vec<Value>| p.iter().map(Value::text).collect();
    Kept {
        digest: o.digest.clone(),
        settled: way.settled,
        cpu_seconds: way.cpu_seconds,
        failed: way.failed.clone(),
        points: told.chain(new).map(text).collect(),
    }
}

/// Runs the workflow at some points and takes up what became of them. A point that has failed before stays so: it is an answer, on which later
/// points rest. `--force` runs it again.
fn round(
    args: &RunArgs,
    points: Vec<Vec<Value>>,
    way: &mut Way,
    (places, interrupts): (&mut Places, &Interrupts),
) -> Result<(), Stop> {
    let mut opened = open_at(&args.workflow, &points)?;
    let mut lines = {
        let session = opened.look()?;
        let lines = read(&session);
        way.count(&session, !args.force.is_empty());
        lines
    };
    let open: Vec<usize> = (0..points.len())
        .filter(|i| !args.force.is_empty() || !is_answer(&lines[*i]))
        .collect();
    if !open.is_empty() {
        let study = study_of(&opened);
        let steps = open.iter().flat_map(|i| study.points[*i].steps.iter());
        let names: HashSet<&str> = steps
            .map(|s| opened.workflow.steps[*s].name.as_str())
            .collect();
        let mut names: Vec<String> = names.into_iter().map(str::to_owned).collect();
        names.sort_unstable();
        opened.restrict(&names)?;
        if let Some(on) = places.on(args)? {
            on.prepare(&mut opened)?;
        }
        let session = execute(args, &opened, way, (places, interrupts))?;
        let found = read(&session);
        for i in open {
            lines[i] = found[i].clone();
        }
    }
    let study = study_of(&opened);
    let o = study
        .optimisation
        .as_ref()
        .ok_or_else(|| Stop::new(exit::INTERNAL, "the search of this optimisation is missing"))?;
    for (point, line) in points.into_iter().zip(&lines) {
        if let Some(why) = no_answer(line) {
            way.broken.get_or_insert(why);
        }
        // Points are told in the order in which they were asked for: behind one without an answer there is none.
        if !is_answer(line) {
            break;
        }
        let outcome = outcome(o, study, &point, line).map_err(wrong)?;
        way.told.push(Told { point, outcome });
    }
    Ok(())
}

fn study_of(opened: &Opened) -> &Study {
    opened
        .workflow
        .study
        .as_ref()
        .expect("an optimisation is a study")
}

fn read(session: &Session<'_>) -> Vec<Line> {
    Table::read(session, &records(session)).lines
}

/// Runs the wanted steps of an opened workflow.
fn execute<'o>(
    args: &RunArgs,
    opened: &'o Opened,
    way: &mut Way,
    (places, interrupts): (&mut Places, &Interrupts),
) -> Result<Session<'o>, Stop> {
    let machine = || Stop::machine(format!("running with the store {}", opened.store.root()));
    let options = options(args, opened)?;
    let mut session = opened.session(options, Purpose::Run(None))?;
    let mut observer = observer(args);
    session.look(observer.as_mut());
    if let Err(stop) = opened.admit(&session) {
        observer.end();
        return Err(stop);
    }
    let before = children_seconds();
    let place = places.open(opened, interrupts)?;
    let mut failed = false;
    for round in 0.. {
        let (ended, summary) = session
            .execute(place.executor.as_mut(), observer.as_mut(), &|| {
                interrupts.count() + place.wishes.get()
            })
            .map_err(machine())?;
        session = ended;
        failed |= !summary.failures.is_empty();
        // What was there has been counted.
        way.summary.add(Summary {
            cached: 0,
            ..summary
        });
        // What the method is told is read first; what is not as it was written is made again, as long as that helps.
        let lost = match way.summary.interrupted {
            true => 0,
            false => session.recheck(&|_| true, Depth::Records, observer.as_mut()),
        };
        if lost == 0 {
            break;
        }
        if round == ROUNDS {
            let text =
                "damaged each time it was read: look after the disk and the memory of this machine";
            return Err(Stop::new(exit::DAMAGED, text));
        }
    }
    let elsewhere = place.executor.lost_seconds();
    places.rest();
    let counted = way.take(&session);
    // What was stopped took some of it, and runs again.
    let spent = elsewhere.unwrap_or_else(|| (children_seconds() - before - counted).max(0.0));
    way.take_failed(
        &session,
        (failed && !way.summary.interrupted).then_some(spent),
    );
    Ok(session)
}

impl Way {
    /// Counts what the store has already, and what failed unless that runs again.
    fn count(&mut self, session: &Session<'_>, again: bool) {
        let before = self.seen.len();
        self.take(session);
        self.summary.cached += self.seen.len() - before;
        if !again {
            self.take_failed(session, None);
        }
    }

    /// Takes up what steps took that failed, each once. Of those that have failed now `spent` (CPU, s) is what all of them took together; of others
    /// it is what was noted then. A step that is another one by now has another key, and nothing of it was noted.
    fn take_failed(&mut self, session: &Session<'_>, spent: Option<f64>) {
        let ids = 0..session.core.instances().len();
        let failed = ids.filter(|id| session.failed_before(*id).is_some());
        let keys = failed.filter_map(|id| session.core.instances()[id].key);
        let new: Vec<Key> = keys.filter(|key| self.seen.insert(*key)).collect();
        for key in &new {
            if let Some(spent) = spent {
                self.failed.insert(key.hex(), spent / new.len() as f64);
            }
            self.cpu_seconds += self.failed.get(&key.hex()).copied().unwrap_or(0.0);
        }
    }

    /// Takes up what artifacts took, each once; gives what was new (CPU, s).
    fn take(&mut self, session: &Session<'_>) -> f64 {
        let before = self.cpu_seconds;
        for instance in session.core.instances() {
            if let (State::Done { .. }, Some(key)) = (&instance.state, instance.key)
                && self.seen.insert(key)
            {
                let cost = cost_of(session, &key);
                self.cpu_seconds += cost.map_or(0.0, |c| c.cpu_seconds);
            }
        }
        self.cpu_seconds - before
    }
}
