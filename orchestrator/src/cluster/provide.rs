//! Sees to it that there are allocations, and learns what has become of them: by their signs of life and by what Slurm says, never by one
//! of the two alone.

use super::folder::{Exchange, Standing};
use super::intent::Intent;
use super::judge::{self, Rule};
use super::needs::{GUESS, Shape, allocations};
use super::slurm::{Limits, Row, Slurm, Submitted};
use super::submission::{Pilot, Submission};
use super::work::Work;
use crate::engine::{Outcome, Report};
use camino::Utf8PathBuf;
use plyflow_model::job::{LogLevel, Message};
use plyflow_model::profile::Profile;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::io;
use std::time::{Duration, Instant};

/// Time between two questions to the controller: after something has changed, and at most.
const ASKS: [Duration; 2] = [Duration::from_secs(5), Duration::from_secs(60)];
/// Time between two looks into the queues of the folder, and for signs of life: when something was new, and at most.
const TENDS: [Duration; 2] = [Duration::from_millis(250), Duration::from_secs(5)];
/// For so long after `sbatch` an allocation that Slurm does not name may not be there yet.
const NOT_YET: Duration = Duration::from_secs(30);
/// After so long without a sign of life Slurm is asked again soon.
const SILENT: Duration = Duration::from_secs(15);
/// How long to wait after a limit on queued jobs was met, or the disk was full: at first, and at most.
const LATER: [Duration; 2] = [Duration::from_secs(10), Duration::from_secs(120)];
/// Allocations in a row that may end before they give a sign of life.
const STILLBORN: u32 = 3;
/// How often things are done.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pace {
    pub asks: [Duration; 2],
    pub tends: [Duration; 2],
    pub not_yet: Duration,
    pub later: [Duration; 2],
}

/// The pace of a real cluster.
pub(super) const PACE: Pace = Pace {
    asks: ASKS,
    tends: TENDS,
    not_yet: NOT_YET,
    later: LATER,
};

/// What allocations of a shape have to do.
#[derive(Default)]
struct Demand {
    plugin: String,
    waiting: Vec<usize>,
    running: usize,
    /// Longest time (s) that one has been running.
    oldest: f64,
}

/// The allocations of a run.
pub(super) struct Provider {
    exchange: Exchange,
    profile: Profile,
    limits: Limits,
    program: String,
    slurm: Slurm,
    pace: Pace,
    run: String,
    serial: u64,
    submissions: Vec<Submission>,
    /// Number and sum of times (s) of steps, by the shape of their allocation.
    times: HashMap<String, (u32, f64)>,
    tend: Instant,
    tend_pause: Duration,
    ask: Instant,
    ask_pause: Duration,
    submit_after: Instant,
    stillborn: u32,
    later: Duration,
    told_limit: bool,
    out: Vec<Report>,
    rules: Vec<(usize, Rule)>,
    /// Allocations that were given up though Slurm calls them running.
    hung: HashSet<String>,
}

impl Provider {
    /// With the allocations that an earlier head has left.
    pub fn new(
        exchange: &Exchange,
        (profile, limits): (&Profile, &Limits),
        program: &str,
        slurm: Slurm,
        pace: Pace,
    ) -> io::Result<Self> {
        let names = exchange.submissions();
        let mut submissions: Vec<Submission> = names
            .iter()
            .filter_map(|n| Submission::found(exchange, n))
            .collect();
        let now = Instant::now();
        for known in submissions.iter_mut().filter(|s| s.job.is_some()) {
            known.since = now.checked_sub(pace.not_yet).unwrap_or(now);
        }
        let number = |n: &String| n.rsplit('-').next().and_then(|t| t.parse::<u64>().ok());
        Ok(Self {
            run: run_id(exchange)?,
            serial: names.iter().filter_map(number).max().unwrap_or(0),
            exchange: exchange.clone(),
            profile: profile.clone(),
            limits: limits.clone(),
            program: program.to_owned(),
            slurm,
            pace,
            submissions,
            times: HashMap::new(),
            tend: now,
            tend_pause: pace.tends[0],
            ask: now,
            ask_pause: pace.asks[0],
            submit_after: now,
            stillborn: 0,
            later: pace.later[0],
            told_limit: false,
            out: Vec::new(),
            rules: Vec::new(),
            hung: HashSet::new(),
        })
    }

    /// Whether Slurm has an allocation no more, as far as this is known.
    pub fn is_gone(&self, pilot: &str) -> bool {
        let mut open = self.submissions.iter().flat_map(|s| &s.pilots);
        !self.hung.contains(pilot) && !open.any(|p| p.name == pilot && !p.closed)
    }

    /// There is something new to do.
    pub fn hurry(&mut self) {
        self.tend_pause = self.pace.tends[0];
        self.tend = self.tend.min(Instant::now() + self.pace.tends[0] / 4);
    }

    /// A step has ended in an allocation after so long (s).
    pub fn measured(&mut self, pilot: &str, seconds: f64) {
        let of = self
            .submissions
            .iter()
            .find(|s| s.pilots.iter().any(|p| p.name == pilot));
        if let Some(shape) = of.map(|s| s.intent.shape.name()) {
            let (n, sum) = self.times.entry(shape).or_default();
            (*n, *sum) = (*n + 1, *sum + seconds);
        }
    }

    /// Does what is due: listens, asks, judges and submits. Gives what to tell the engine, and what to do with attempts that ended silently.
    pub fn tend(
        &mut self,
        works: &mut BTreeMap<usize, Work>,
        by_attempt: &HashMap<String, usize>,
    ) -> (Vec<Report>, Vec<(usize, Rule)>) {
        let mut changed = self.take_answer();
        if Instant::now() >= self.tend {
            changed |= self.listen(by_attempt);
            let demands = self.look_into_queues(works);
            self.judge(works);
            self.provide(&demands);
            self.tend_pause = if changed {
                self.pace.tends[0]
            } else {
                (self.tend_pause * 3 / 2).min(self.pace.tends[1])
            };
            self.tend = Instant::now() + self.tend_pause;
        }
        self.ask();
        (
            std::mem::take(&mut self.out),
            std::mem::take(&mut self.rules),
        )
    }

    fn say(&mut self, id: usize, level: LogLevel, text: String) {
        let message = Message::Log { level, text };
        self.out.push(Report::Message { id, message });
    }

    /// Reads signs of life and passes on how far steps are.
    fn listen(&mut self, by_attempt: &HashMap<String, usize>) -> bool {
        let mut any = false;
        for submission in &mut self.submissions {
            any |= submission.listen();
            for beat in submission.pilots.iter().filter_map(|p| p.beat.as_ref()) {
                self.stillborn = 0;
                for (attempt, progress) in &beat.running {
                    if let Some(&id) = by_attempt.get(attempt).filter(|_| any) {
                        let message = Message::Progress(progress.clone());
                        self.out.push(Report::Message { id, message });
                    }
                }
            }
        }
        any
    }

    /// Whether an allocation that was heard before has been silent for some of its beats.
    fn one_is_silent(&self) -> bool {
        let pilots = self.submissions.iter().flat_map(|s| &s.pilots);
        let mut heard = pilots.filter(|p| !p.closed && p.gone.is_none() && p.beat.is_some());
        heard.any(|p| p.heard.elapsed() >= SILENT)
    }

    /// Asks the controller when it is time to, and there is something to ask for.
    fn ask(&mut self) {
        if self.one_is_silent() {
            self.ask_pause = self.pace.asks[0];
            self.ask = self.ask.min(Instant::now() + self.ask_pause);
        }
        let names: Vec<String> = self
            .submissions
            .iter()
            .map(|s| s.intent.name.clone())
            .collect();
        if !names.is_empty()
            && Instant::now() >= self.ask
            && self.slurm.may_look()
            && self.slurm.begin_look(&names)
        {
            self.ask = Instant::now() + self.ask_pause;
            self.ask_pause = (self.ask_pause * 3 / 2).min(self.pace.asks[1]);
        }
    }

    /// Takes up what the controller has answered. That it did not answer means nothing.
    fn take_answer(&mut self) -> bool {
        let Some(Ok(rows)) = self.slurm.looked() else {
            return false;
        };
        let mut changed = false;
        for submission in &mut self.submissions {
            changed |= submission.take_up(&rows, self.pace.not_yet);
        }
        if changed {
            self.ask_pause = self.pace.asks[0];
            self.ask = self.ask.min(Instant::now() + self.pace.asks[0]);
        }
        changed
    }

    /// What waits and what runs, by shape.
    fn look_into_queues(&self, works: &mut BTreeMap<usize, Work>) -> BTreeMap<Shape, Demand> {
        let mut standing: HashMap<String, HashMap<String, Standing>> = HashMap::new();
        let mut demands: BTreeMap<Shape, Demand> = BTreeMap::new();
        for (id, work) in works {
            let shape = &work.order.shape;
            let queue = standing
                .entry(shape.name())
                .or_insert_with_key(|name| self.exchange.standing(name).into_iter().collect());
            let demand = demands.entry(shape.clone()).or_default();
            match queue.get(&work.order.attempt) {
                Some(Standing::Waits) => {
                    demand.plugin.clone_from(&work.order.job.plugin.name);
                    demand.waiting.push(*id);
                }
                Some(Standing::Taken(pilot)) => {
                    let since = *work.taken.get_or_insert_with(Instant::now);
                    work.pilot = Some(pilot.clone());
                    demand.running += 1;
                    demand.oldest = demand.oldest.max(since.elapsed().as_secs_f64());
                }
                // Not seen here yet, or just ended.
                None => {}
            }
        }
        demands
    }

    /// Finds allocations that are gone or hang, and says what becomes of what they had.
    fn judge(&mut self, works: &BTreeMap<usize, Work>) {
        let settle = Duration::from_secs_f64(self.profile.settle.si());
        let silence = Duration::from_secs_f64(self.profile.silence.si());
        let told = self.exchange.told();
        let mut lost: Vec<(usize, usize, Vec<usize>, bool)> = Vec::new();
        for (at, submission) in self.submissions.iter().enumerate() {
            for (index, pilot) in submission
                .pilots
                .iter()
                .enumerate()
                .filter(|(_, p)| !p.closed)
            {
                let has: Vec<usize> = (works.iter())
                    .filter(|(_, w)| {
                        w.pilot.as_deref() == Some(&pilot.name) && !told.contains(&w.order.attempt)
                    })
                    .map(|(id, _)| *id)
                    .collect();
                if is_gone(pilot, settle, has.is_empty()) {
                    lost.push((at, index, has, false));
                } else if is_hanging(pilot, silence) && !has.is_empty() {
                    lost.push((at, index, has, true));
                }
            }
        }
        for (at, index, has, hangs) in lost {
            self.lose(works, at, index, &has, hangs);
        }
        self.judge_orphans(works, &told, settle);
        for submission in self.submissions.iter().filter(|s| s.is_settled()) {
            submission.settle();
        }
        self.submissions.retain(|s| !s.is_settled());
    }

    /// An earlier head has settled the allocation of a step and was killed before it queued the step again.
    fn judge_orphans(&mut self, works: &BTreeMap<usize, Work>, told: &[String], settle: Duration) {
        let pilots = self.submissions.iter().flat_map(|s| &s.pilots);
        let open: HashSet<&str> = pilots
            .filter(|p| !p.closed)
            .map(|p| p.name.as_str())
            .collect();
        for (id, work) in works {
            let is_orphan = work.pilot.as_deref().is_some_and(|p| !open.contains(p));
            let is_old = work.taken.is_some_and(|since| since.elapsed() >= settle);
            let is_known = told.contains(&work.order.attempt)
                || self.rules.iter().any(|(other, _)| other == id);
            if is_orphan && is_old && !is_known {
                let (past, shape) = (&work.order.past, &work.order.shape);
                let rule = judge::of_silence(None, past, shape, &self.limits, work.is_kept());
                self.rules.push((*id, rule));
            }
        }
    }

    fn lose(
        &mut self,
        works: &BTreeMap<usize, Work>,
        at: usize,
        index: usize,
        has: &[usize],
        hangs: bool,
    ) {
        let submission = &mut self.submissions[at];
        let job = submission.job.clone();
        let pilot = &mut submission.pilots[index];
        pilot.closed = true;
        let mut row = pilot.row.clone();
        let silent = pilot.beat.is_none();
        let node = pilot
            .beat
            .as_ref()
            .map(|b| b.host.clone())
            .unwrap_or_default();
        // The controller has forgotten it; what it was when it was seen last says nothing of its end.
        let forgotten = row.as_ref().is_none_or(|r| !r.has_ended());
        if forgotten && !hangs {
            let job = job.as_ref().filter(|_| !has.is_empty());
            row = job.and_then(|job| self.slurm.last_state(job, index as u32));
        }
        if hangs {
            self.hung.insert(pilot.name.clone());
        }
        if hangs && let Some(job) = &job {
            let _ = self.slurm.cancel(&[format!("{job}_{index}")], true);
        }
        if silent && job.is_some() && !hangs {
            self.stillborn += 1;
        }
        for id in has {
            let Some(work) = works.get(id) else { continue };
            let (past, shape) = (&work.order.past, &work.order.shape);
            let rule = match hangs {
                true => judge::of_hanging(&node, past, shape),
                false => judge::of_silence(row.as_ref(), past, shape, &self.limits, work.is_kept()),
            };
            self.rules.push((*id, rule));
        }
        if self.stillborn >= STILLBORN {
            let folder = self.exchange.submission(&self.submissions[at].intent.name);
            let state = row.map_or("gone".to_owned(), |r| format!("{} ({})", r.state, r.reason));
            self.give_up(works, &folder.join(format!("log-{index}")), &state);
        }
    }

    /// Allocations end before they begin to work: more of them would do the same.
    fn give_up(&mut self, works: &BTreeMap<usize, Work>, log: &Utf8PathBuf, state: &str) {
        self.stillborn = 0;
        let said = std::fs::read_to_string(log).unwrap_or_default();
        let last = said.lines().last().unwrap_or("nothing").to_owned();
        for id in works
            .iter()
            .filter(|(_, w)| w.pilot.is_none())
            .map(|(id, _)| *id)
        {
            let text = format!(
                "{STILLBORN} allocations ended before they began to work, the last as {state}; its log {log} ends with: {last}"
            );
            self.rules
                .push((id, Rule::Report(Outcome::NotStarted(text))));
        }
    }

    /// Submits allocations for what waits.
    fn provide(&mut self, demands: &BTreeMap<Shape, Demand>) {
        // What waits may be told to wait no more.
        if !self.rules.is_empty() {
            return;
        }
        for (shape, demand) in demands.iter().filter(|(_, d)| !d.waiting.is_empty()) {
            let serves = |s: &&Submission| s.intent.shape == *shape;
            let serving: usize = self.submissions.iter().filter(serves).map(live).sum();
            let all: usize = self.submissions.iter().map(live).sum();
            let room = (self.profile.most_queued as usize).saturating_sub(all);
            let array = self.limits.array.map_or(1, |n| n.max(1) as usize);
            let size = self
                .wanted(shape, demand)
                .saturating_sub(serving)
                .min(room)
                .min(array);
            if size > 0 && Instant::now() >= self.submit_after && self.slurm.may_ask() {
                self.submit(shape, size as u32, demand);
            }
        }
    }

    /// How many allocations of a shape there should be: each with work for some minutes, as far as that is known.
    fn wanted(&self, shape: &Shape, demand: &Demand) -> usize {
        let measured =
            (self.times.get(&shape.name())).map_or(GUESS, |(n, sum)| sum / f64::from(*n));
        let open = demand.waiting.len() + demand.running;
        allocations(
            shape,
            open,
            measured.max(demand.oldest),
            self.profile.most_steps,
        )
    }

    fn submit(&mut self, shape: &Shape, size: u32, demand: &Demand) {
        self.serial += 1;
        let intent = Intent {
            name: format!("plyflow-{}-{}", self.run, self.serial),
            shape: shape.clone(),
            size,
            most_steps: self.profile.most_steps,
            grace: self.profile.grace.si(),
            idle: self.profile.idle.si(),
        };
        let first = demand.waiting[0];
        let written = Submission::intend(&self.exchange, intent, &self.profile, &self.program);
        let mut submission = match written {
            Ok(submission) => submission,
            // A full disk passes, or the store fails of it elsewhere.
            Err(e) => {
                self.put_off();
                let text = format!("no allocation can be asked for: {e}");
                return self.say(first, LogLevel::Warn, text);
            }
        };
        let answer = self.slurm.submit(&submission.script());
        submission.since = Instant::now();
        match answer {
            Submitted::Job(job) => {
                submission.is_job(&job);
                (self.told_limit, self.later) = (false, self.pace.later[0]);
                let many = if size == 1 { "" } else { "s" };
                let text = format!("job {job}: {size} allocation{many} of {}", shape.text());
                self.say(first, LogLevel::Info, text);
            }
            // By its name it will be found, if it is there; until then no other is submitted in its place.
            Submitted::Unknown(why) => {
                let name = &submission.intent.name;
                let text =
                    format!("nobody knows whether {name} was submitted: {why}; it is looked for");
                self.say(first, LogLevel::Warn, text);
            }
            Submitted::Later(why) => return self.wait_for_limit(first, &submission, &why),
            Submitted::Refused(why) => return self.refuse(demand, &submission, &why),
        }
        self.ask_pause = self.pace.asks[0];
        self.ask = Instant::now() + self.pace.asks[0];
        self.submissions.push(submission);
    }

    /// A limit on what one may queue is reached.
    fn wait_for_limit(&mut self, first: usize, submission: &Submission, why: &str) {
        submission.settle();
        self.put_off();
        if !std::mem::replace(&mut self.told_limit, true) {
            let text = format!("Slurm takes no more allocations now ({why}); it is tried again");
            self.say(first, LogLevel::Warn, text);
        }
    }

    /// Slurm will never take it, nor another for the same steps.
    fn refuse(&mut self, demand: &Demand, submission: &Submission, why: &str) {
        submission.settle();
        let (script, shape) = (submission.script(), submission.intent.shape.text());
        let plugin = &demand.plugin;
        let text = format!(
            "Slurm refuses the allocation for '{plugin}' ({shape}): {why}; the script is {script}"
        );
        let rule = Rule::Report(Outcome::NotStarted(text));
        self.rules
            .extend(demand.waiting.iter().map(|id| (*id, rule.clone())));
    }

    /// Submits nothing for a while, and each time for longer.
    fn put_off(&mut self) {
        self.submit_after = Instant::now() + self.later;
        self.later = (self.later * 2).min(self.pace.later[1]);
    }

    /// Asks all allocations to end; what waits in the queue is taken out of it, and with `hard` what runs is ended.
    pub fn close(&mut self, hard: bool) {
        for submission in &self.submissions {
            submission.ask_to_end();
        }
        let is_wanted = |p: &Pilot| !p.closed && p.gone.is_none() && (hard || p.beat.is_none());
        let of = |s: &&Submission| s.pilots.iter().any(is_wanted);
        let jobs: Vec<String> = self
            .submissions
            .iter()
            .filter(of)
            .filter_map(|s| s.job.clone())
            .collect();
        let _ = self.slurm.cancel(&jobs, hard);
    }
}

/// Allocations of a submission that will take steps. One that ended before it gave a sign of life counts until it is judged: another would
/// do the same.
fn live(submission: &Submission) -> usize {
    let works = |p: &&Pilot| {
        !p.closed
            && p.beat
                .as_ref()
                .is_none_or(|b| b.over.is_none() && p.gone.is_none())
    };
    submission.pilots.iter().filter(works).count()
}

/// Whether an allocation is gone for good: Slurm does not have it, and the file system has had time to show what it left. One that said that it
/// ends and has nothing needs no waiting.
fn is_gone(pilot: &Pilot, settle: Duration, has_nothing: bool) -> bool {
    let Some(gone) = pilot.gone else { return false };
    let said = pilot.beat.as_ref().is_some_and(|b| b.over.is_some());
    (said && has_nothing) || (gone.elapsed() >= settle && pilot.heard.elapsed() >= settle)
}

/// Whether an allocation that Slurm calls running gives no sign of life.
fn is_hanging(pilot: &Pilot, silence: Duration) -> bool {
    let is_running = |r: &Row| r.state == "RUNNING";
    pilot.row.as_ref().is_some_and(is_running)
        && pilot.gone.is_none()
        && pilot.heard.elapsed() >= silence
}

/// Part of the names of all allocations of a run: made once.
fn run_id(exchange: &Exchange) -> io::Result<String> {
    let path = exchange.root().join("id");
    let is_one = |t: &String| t.len() == 10 && t.bytes().all(|b| b.is_ascii_hexdigit());
    if let Some(id) = std::fs::read_to_string(&path).ok().filter(is_one) {
        return Ok(id);
    }
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    let text = format!("{} {now:?} {}", exchange.root(), super::folder::host());
    let id = blake3::hash(text.as_bytes()).to_hex()[..10].to_owned();
    super::folder::publish(&path, id.as_bytes(), true)?;
    Ok(id)
}
