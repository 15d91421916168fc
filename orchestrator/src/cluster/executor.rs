//! The executor of a cluster: writes orders, reads verdicts, and sees to it that there are allocations to take them.

use super::folder::{Exchange, Order, Past, Standing, Verdict, publish, to_sealed};
use super::judge::{self, Rule};
use super::needs::Shape;
use super::provide::{PACE, Pace, Provider};
use super::reach::{Reach, Taken};
use super::slurm::{Limits, Slurm};
use super::work::Work;
use crate::engine::{Executor, Outcome, Report, Task};
use crate::store::ENDING;
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_model::job::{LogLevel, Message, Record};
use plyflow_model::profile::Profile;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use std::cell::Cell;
use std::collections::{BTreeMap, HashMap};
use std::io;
use std::os::fd::OwnedFd;
use std::rc::Rc;
use std::time::{Duration, Instant};

/// Time between two looks for verdicts: at first, and when nothing comes.
const LOOKS: [Duration; 2] = [Duration::from_millis(50), Duration::from_secs(3)];
/// Digits of the key in the name of an attempt.
const DIGITS: usize = 16;

/// Why a run cannot be given to the cluster.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// Another head has it.
    #[error(transparent)]
    Taken(#[from] Taken),
    /// The store lies where no script can say it.
    #[error(
        "the path {0} has a line break, a quotation mark or a backslash in it, which `sbatch` cannot be given; put the store elsewhere with --store"
    )]
    Path(Utf8PathBuf),
    /// The disk refuses.
    #[error("the folder {0}: {1}")]
    Io(Utf8PathBuf, io::Error),
}

/// With what a run on a cluster works.
pub struct Means {
    /// How steps are given to it.
    pub profile: Profile,
    /// What its partition gives.
    pub limits: Limits,
    /// This program as the nodes find it.
    pub program: String,
    /// Slurm.
    pub slurm: Slurm,
}

/// Orders that an earlier head has left, by the first digits of their keys.
type Found = HashMap<String, Vec<(String, String, Standing)>>;

/// Steps in allocations of Slurm.
pub struct Cluster {
    exchange: Exchange,
    profile: Profile,
    limits: Limits,
    provider: Provider,
    reach: Reach,
    id: String,
    serial: u64,
    works: BTreeMap<usize, Work>,
    by_attempt: HashMap<String, usize>,
    found: Found,
    queued: Vec<Report>,
    /// Attempts that the engine has been told of: what is left of them goes when it asks again.
    told: Vec<(String, String)>,
    /// Attempts that were given up and had not come to an end when the engine was told of the work.
    left: Vec<(String, String)>,
    /// Which allocations had attempts on which there is a verdict.
    pilots: HashMap<String, String>,
    records: HashMap<usize, (String, Box<Record>)>,
    wake: Option<OwnedFd>,
    wishes: Rc<Cell<u32>>,
    /// What steps have taken that came to no artifact, since it was asked for (s).
    lost_seconds: f64,
    look: Instant,
    pause: Duration,
    hard: bool,
}

impl Cluster {
    /// Takes a run over, with what an earlier head has left of it. `run`: the folder of the run, of which the caller holds the lock.
    ///
    /// # Errors
    /// When another head is alive, or the folder cannot be written.
    pub fn open(run: &Utf8Path, means: Means, wake: Option<OwnedFd>) -> Result<Self, OpenError> {
        Self::open_at(run, means, wake, PACE)
    }

    fn open_at(
        run: &Utf8Path,
        means: Means,
        wake: Option<OwnedFd>,
        pace: Pace,
    ) -> Result<Self, OpenError> {
        let Means {
            profile,
            limits,
            program,
            slurm,
        } = means;
        let exchange = Exchange::new(run);
        let named = |e| OpenError::Io(exchange.root().to_owned(), e);
        if exchange.root().as_str().contains(['\n', '"', '\\']) {
            return Err(OpenError::Path(exchange.root().to_owned()));
        }
        exchange.prepare().map_err(named)?;
        let id = own_id();
        let reach = Reach::take(&exchange, &id)?;
        let _ = std::fs::remove_file(exchange.stop());
        let found = found(&exchange);
        let provider =
            Provider::new(&exchange, (&profile, &limits), &program, slurm, pace).map_err(named)?;
        Ok(Self {
            provider,
            reach,
            id,
            exchange,
            profile,
            limits,
            serial: 0,
            works: BTreeMap::new(),
            by_attempt: HashMap::new(),
            found,
            queued: Vec::new(),
            told: Vec::new(),
            left: Vec::new(),
            pilots: HashMap::new(),
            records: HashMap::new(),
            wake,
            wishes: Rc::default(),
            lost_seconds: 0.0,
            look: Instant::now(),
            pause: LOOKS[0],
            hard: false,
        })
    }

    /// How often the user has asked for the end of the run by `plyflow cancel`.
    pub fn wishes(&self) -> Rc<Cell<u32>> {
        self.wishes.clone()
    }

    fn next_attempt(&mut self, key: &str) -> String {
        self.serial += 1;
        format!(
            "{}-{}-{}",
            &key[..key.len().min(DIGITS)],
            self.id,
            self.serial
        )
    }

    /// An order for a task, not yet written.
    fn order(&mut self, task: &Task) -> Order {
        let job = &task.job;
        let granted = self
            .profile
            .granted(&job.plugin.name, job.threads, job.memory_limit);
        let mut order = Order {
            attempt: String::new(),
            shape: Shape::of(&granted),
            first: Shape::of(&granted),
            job: job.clone(),
            time_limit: task.time_limit,
            log: Utf8PathBuf::new(),
            past: Past::default(),
        };
        self.name(&mut order);
        order
    }

    /// Gives an order a name of its own, and its files.
    fn name(&mut self, order: &mut Order) {
        let attempt = self.next_attempt(&order.job.key);
        let made = |end: &str| self.exchange.made(&attempt, end);
        order.job.artifact = made(ENDING);
        order.job.record = made(".record.json");
        order.job.scratch = made(".scratch");
        order.log = made(".log");
        order.job.threads = order.shape.cores;
        order.job.memory_limit = order.shape.memory_bytes();
        order.attempt = attempt;
    }

    /// An order of an earlier head for the same work, if there is one that has not come to nothing.
    fn adopt(&mut self, fresh: &Order) -> Option<(Order, Option<Instant>)> {
        let digits = fresh.job.key.get(..DIGITS)?;
        let mut all = self.found.remove(digits)?;
        // What is taken may be done already.
        all.sort_by_key(|(_, _, standing)| *standing == Standing::Waits);
        let mut adopted = None;
        // Where the profile has changed, what has not begun is asked for anew.
        let is_as_asked = |o: &Option<Order>| o.as_ref().is_some_and(|o| o.first == fresh.shape);
        for (shape, attempt, standing) in all {
            let order = self.exchange.order(&shape, &attempt, &standing);
            let is_same = order.as_ref().is_some_and(|o| o.job.key == fresh.job.key);
            match standing {
                Standing::Taken(_) if is_same && adopted.is_none() => {
                    adopted = order.map(|o| (o, Some(Instant::now())))
                }
                Standing::Waits if is_same && adopted.is_none() && is_as_asked(&order) => {
                    adopted = order.map(|o| (o, None))
                }
                // Never begun: nothing is lost.
                Standing::Waits if self.exchange.withdraw(&shape, &attempt) => {
                    self.exchange.forget(&shape, &attempt)
                }
                _ => {}
            }
        }
        adopted
    }

    fn say(&mut self, id: usize, text: String) {
        let level = LogLevel::Warn;
        let message = Message::Log { level, text };
        self.queued.push(Report::Message { id, message });
    }

    /// Tells the engine how an instance ended.
    pub(super) fn end(&mut self, id: usize, outcome: Outcome) {
        let Some(work) = self.works.remove(&id) else {
            return;
        };
        let Order {
            attempt,
            shape,
            log,
            ..
        } = &work.order;
        self.by_attempt.remove(attempt);
        let _ = std::fs::create_dir_all(work.log.parent().unwrap_or(Utf8Path::new(".")));
        let _ = std::fs::rename(log, &work.log);
        match &outcome {
            Outcome::Done(record) => {
                self.records.insert(id, (attempt.clone(), record.clone()));
            }
            _ => self.lost_seconds += work.spent,
        }
        self.told.push((shape.name(), attempt.clone()));
        for (shape, attempt) in work.older {
            self.by_attempt.remove(&attempt);
            let _ = self.exchange.ask_to_stop(&attempt);
            self.left.push((shape, attempt));
        }
        self.queued.push(Report::Ended { id, outcome });
    }

    /// Follows a rule. `over`: the attempt is known to have come to its end.
    pub(super) fn follow(&mut self, id: usize, rule: Rule, over: bool) {
        let (past, shape, why) = match rule {
            Rule::Report(outcome) => return self.end(id, outcome),
            Rule::Again { past, shape, why } => (past, shape, why),
        };
        let Some(work) = self.works.get(&id) else {
            return;
        };
        if work.wished {
            return self.end(id, Outcome::Cancelled);
        }
        let mut order = work.order.clone();
        let before = (order.shape.name(), order.attempt.clone());
        (order.past, order.shape) = (past, shape);
        self.name(&mut order);
        if let Err(e) = self.exchange.put(&order) {
            return self.end(
                id,
                Outcome::NotStarted(format!("its order cannot be written: {e}")),
            );
        }
        self.by_attempt.insert(order.attempt.clone(), id);
        if over {
            self.by_attempt.remove(&before.1);
            self.told.push(before.clone());
        }
        if let Some(work) = self.works.get_mut(&id) {
            if let (false, Some(pilot)) = (over, work.pilot.take()) {
                self.pilots.insert(before.1.clone(), pilot);
            }
            (work.order, work.taken, work.pilot, work.late) = (order, None, None, None);
            if !over {
                work.older.push(before);
            }
        }
        self.provider.hurry();
        self.say(id, why);
    }

    /// Reads what verdicts there are; true: one was new.
    fn read_verdicts(&mut self) -> bool {
        let mut any = false;
        for attempt in self.exchange.told() {
            let Some(&id) = self.by_attempt.get(&attempt) else {
                continue;
            };
            if let Some(verdict) = self.exchange.verdict(&attempt) {
                any |= self.judge(id, &verdict);
            }
        }
        any
    }

    /// Acts on a verdict; false: it has to wait.
    fn judge(&mut self, id: usize, verdict: &Verdict) -> bool {
        self.pilots
            .insert(verdict.attempt.clone(), verdict.pilot.clone());
        let Some(work) = self.works.get_mut(&id) else {
            return false;
        };
        let is_late = work.order.attempt != verdict.attempt;
        if !matches!(verdict.outcome, Outcome::Done(_)) {
            work.spent += verdict.seconds * f64::from(work.order.shape.cores);
        }
        if let Outcome::Done(record) = &verdict.outcome {
            if !self.exchange.is_whole(&verdict.attempt, record, ENDING) {
                let since = *work.late.get_or_insert_with(Instant::now);
                if since.elapsed().as_secs_f64() < self.profile.settle.si().max(2.0) {
                    return false;
                }
                if !is_late {
                    let (past, shape) = (work.order.past.clone(), work.order.shape.clone());
                    let rule = judge::of_damage(&verdict.host, &past, &shape);
                    self.follow(id, rule, true);
                }
                return true;
            }
            if is_late {
                self.take_late(id, &verdict.attempt);
            }
            self.provider.measured(&verdict.pilot, verdict.seconds);
            self.end(id, verdict.outcome.clone());
            return true;
        }
        if is_late {
            // It was given up already: this is only the end that was expected of it.
            self.by_attempt.remove(&verdict.attempt);
            return false;
        }
        let (past, shape, wished) = (
            work.order.past.clone(),
            work.order.shape.clone(),
            work.wished,
        );
        let kept = work.is_kept();
        let rule = judge::of_verdict(verdict, &past, &shape, &self.limits, kept, wished);
        self.follow(id, rule, true);
        true
    }

    /// The attempt that was given up has come to its end even so: it is the one, and the newer is not needed.
    fn take_late(&mut self, id: usize, attempt: &str) {
        let Some(work) = self.works.get_mut(&id) else {
            return;
        };
        let newer = (work.order.shape.name(), work.order.attempt.clone());
        if let Some(at) = work.older.iter().position(|(_, a)| a == attempt) {
            let (_, attempt) = work.older.remove(at);
            work.order.log = self.exchange.made(&attempt, ".log");
            work.order.attempt = attempt;
        }
        if !self.exchange.withdraw(&newer.0, &newer.1) {
            let _ = self.exchange.ask_to_stop(&newer.1);
        }
        work.older.push(newer);
        self.say(
            id,
            "its first attempt has come to its end late; the other is stopped".into(),
        );
    }

    /// Removes what is left of attempts that the engine has dealt with.
    fn clear_told(&mut self) {
        for (shape, attempt) in std::mem::take(&mut self.told) {
            // The verdict last: an order without one would pass for a step that runs.
            if let Some(pilot) = self.pilots.remove(&attempt) {
                self.exchange.forget_taken(&shape, &attempt, &pilot);
            }
            self.exchange.forget(&shape, &attempt);
        }
    }

    /// What an earlier head has left and nobody wants now: what has not begun is taken back, what has failed is removed. What runs or has
    /// ended well waits for a run that wants it.
    fn clear_found(&self, shape: &str, attempt: &str, standing: &Standing) {
        match standing {
            Standing::Waits if self.exchange.withdraw(shape, attempt) => {
                self.exchange.forget(shape, attempt)
            }
            Standing::Taken(pilot) => {
                let verdict = self.exchange.verdict(attempt);
                if verdict.is_some_and(|v| !matches!(v.outcome, Outcome::Done(_))) {
                    self.exchange.forget_taken(shape, attempt, pilot);
                    self.exchange.forget(shape, attempt);
                }
            }
            Standing::Waits => {}
        }
    }

    /// Waits for a wish of the user, at most so long.
    fn sleep(&self, time: Duration) {
        let timeout = Timespec {
            tv_sec: time.as_secs() as i64,
            tv_nsec: i64::from(time.subsec_nanos()),
        };
        match &self.wake {
            Some(wake) => drop(poll(
                &mut [PollFd::new(wake, PollFlags::IN)],
                Some(&timeout),
            )),
            None => std::thread::sleep(time),
        }
    }
}

impl Executor for Cluster {
    fn submit(&mut self, task: Task) {
        let fresh = self.order(&task);
        let (order, taken) = match self.adopt(&fresh) {
            Some(adopted) => adopted,
            None => match self.exchange.put(&fresh) {
                Ok(()) => (fresh, None),
                Err(e) => {
                    let outcome = Outcome::NotStarted(format!("its order cannot be written: {e}"));
                    let id = task.id;
                    return self.queued.push(Report::Ended { id, outcome });
                }
            },
        };
        self.by_attempt.insert(order.attempt.clone(), task.id);
        let work = Work {
            order,
            taken,
            pilot: None,
            wished: false,
            late: None,
            older: Vec::new(),
            log: task.log,
            spent: 0.0,
        };
        self.works.insert(task.id, work);
        self.provider.hurry();
        self.pause = LOOKS[0];
    }

    fn wait(&mut self, timeout: Option<Duration>, out: &mut Vec<Report>) -> io::Result<()> {
        self.clear_told();
        let until = Instant::now() + timeout.unwrap_or(LOOKS[1]);
        loop {
            self.reach.keep().map_err(io::Error::other)?;
            if self.exchange.stop().exists() && self.wishes.get() == 0 {
                self.wishes.set(1);
            }
            if Instant::now() >= self.look {
                self.pause = if self.read_verdicts() {
                    LOOKS[0]
                } else {
                    (self.pause * 2).min(LOOKS[1])
                };
                self.look = Instant::now() + self.pause;
            }
            let (messages, rules) = self.provider.tend(&mut self.works, &self.by_attempt);
            self.queued.extend(messages);
            for (id, rule) in rules {
                self.follow(id, rule, false);
            }
            let now = Instant::now();
            if !self.queued.is_empty() || now >= until {
                out.append(&mut self.queued);
                return Ok(());
            }
            let next = self.look.min(until).saturating_duration_since(now);
            self.sleep(next.min(Duration::from_millis(200)));
            if self.wishes.get() == 0 && self.wake.as_ref().is_some_and(is_readable) {
                out.append(&mut self.queued);
                return Ok(());
            }
        }
    }

    fn cancel(&mut self, id: usize, now: bool) {
        self.hard |= now;
        let Some(work) = self.works.get_mut(&id) else {
            return;
        };
        work.wished = true;
        let (shape, attempt) = (work.order.shape.name(), work.order.attempt.clone());
        if self.exchange.withdraw(&shape, &attempt) {
            return self.end(id, Outcome::Cancelled);
        }
        let _ = self.exchange.ask_to_stop(&attempt);
        if now {
            self.end(id, Outcome::Cancelled);
        }
        self.pause = LOOKS[0];
    }

    fn files(&mut self, id: usize) -> Option<(Utf8PathBuf, Utf8PathBuf)> {
        let (attempt, record) = self.records.remove(&id)?;
        let file = self.exchange.made(&attempt, ".record.json");
        // An earlier head may have come as far as to put the record into the store.
        if !file.exists() {
            let _ =
                to_sealed(&record).and_then(|bytes| publish(&file, &bytes, record.is_lasting()));
        }
        Some((self.exchange.made(&attempt, ENDING), file))
    }

    fn lost_seconds(&mut self) -> Option<f64> {
        Some(std::mem::take(&mut self.lost_seconds))
    }

    fn close(&mut self) {
        let ended = self.exchange.told();
        for (shape, attempt) in std::mem::take(&mut self.left) {
            let pilot = self.pilots.get(&attempt);
            if ended.contains(&attempt) || pilot.is_some_and(|p| self.provider.is_gone(p)) {
                self.told.push((shape, attempt));
            }
        }
        self.clear_told();
        for (shape, attempt, standing) in std::mem::take(&mut self.found).into_values().flatten() {
            self.clear_found(&shape, &attempt, &standing);
        }
        self.provider.close(self.hard);
        self.reach.leave();
    }
}

fn is_readable(file: &OwnedFd) -> bool {
    let now = Timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    poll(&mut [PollFd::new(file, PollFlags::IN)], Some(&now)).is_ok_and(|n| n > 0)
}

/// What tells this head from all others.
fn own_id() -> String {
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    let text = format!("{} {} {now:?}", super::folder::host(), std::process::id());
    blake3::hash(text.as_bytes()).to_hex()[..6].to_owned()
}

/// Orders that are there, by the first digits of their keys.
fn found(exchange: &Exchange) -> Found {
    let mut found = Found::new();
    for shape in exchange.shapes() {
        for (attempt, standing) in exchange.standing(&shape) {
            if let Some(digits) = attempt.get(..DIGITS) {
                let of_key = found.entry(digits.to_owned()).or_default();
                of_key.push((shape.clone(), attempt, standing));
            }
        }
    }
    found
}

#[cfg(test)]
#[path = "executor_tests.rs"]
mod tests;
