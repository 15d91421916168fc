//! What runs in an allocation: takes orders of its shape, runs them as at home, and tells how they ended.

use super::folder::{Beat, Exchange, Order, Verdict, host, publish, read_sealed, to_sealed};
use super::intent::{Intent, pilot_name};
use crate::engine::{Executor, Local, Outcome, Report, Task};
use camino::Utf8PathBuf;
use plyflow_model::job::Message;
use plyflow_model::job::Progress;
use std::collections::{BTreeMap, VecDeque};
use std::io;
use std::os::fd::OwnedFd;
use std::time::{Duration, Instant};

/// Time between two signs of life.
const BEAT: Duration = Duration::from_secs(5);
/// Time between two looks into an empty queue: at first, and at most.
const LOOKS: [Duration; 2] = [Duration::from_millis(20), Duration::from_secs(2)];
/// Time between looks for what is to stop.
const HEED: Duration = Duration::from_secs(1);

/// Why an allocation cannot begin.
#[derive(Debug, thiserror::Error)]
pub enum PilotError {
    /// What it must know is not there.
    #[error(
        "there is no whole {0}: this allocation was not meant, or the file system of the store is not the one of the head"
    )]
    NoIntent(Utf8PathBuf),
    /// The disk or the system refuses.
    #[error("the allocation {0}: {1}")]
    Io(String, io::Error),
}

struct Running {
    order: Order,
    since: Instant,
    progress: Progress,
}

/// An allocation at work.
struct Pilot<'a> {
    exchange: &'a Exchange,
    intent: Intent,
    name: String,
    beat_file: Utf8PathBuf,
    folder: Utf8PathBuf,
    local: Local,
    running: BTreeMap<usize, Running>,
    serial: usize,
    /// Orders that were seen to wait.
    seen: VecDeque<String>,
    beat: Beat,
    began: Instant,
    /// Since when there has been nothing to run.
    idle: Instant,
    /// When it was told to end, and told its steps.
    told: Option<Instant>,
    taken: u32,
}

/// Runs orders until there are no more, the wall-clock time is nearly over, or it is told to end. `wishes` counts what it was told by
/// signals; `wake` becomes readable when there is one.
///
/// # Errors
/// When it cannot begin, or can tell nobody what it does.
pub fn run(
    exchange: &Exchange,
    submission: &str,
    index: u32,
    wake: OwnedFd,
    wishes: &dyn Fn() -> u32,
) -> Result<(), PilotError> {
    let folder = exchange.submission(submission);
    let path = folder.join("intent.json");
    let intent: Intent = read_sealed(&path).ok_or(PilotError::NoIntent(path))?;
    let name = pilot_name(submission, index);
    let grace = Duration::from_secs_f64((intent.grace * 0.8).max(1.0));
    let now = Instant::now();
    let mut pilot = Pilot {
        exchange,
        name: name.clone(),
        beat_file: folder.join(format!("beat-{index}.json")),
        folder,
        local: Local::new("/proc/self/exe".into(), Some(wake)).with_grace(grace),
        running: BTreeMap::new(),
        serial: 0,
        seen: VecDeque::new(),
        beat: Beat {
            // As Slurm calls it.
            host: std::env::var("SLURMD_NODENAME").unwrap_or_else(|_| host()),
            ..Beat::default()
        },
        intent,
        began: now,
        idle: now,
        told: None,
        taken: 0,
    };
    pilot.work(wishes).map_err(|e| PilotError::Io(name, e))
}

impl Pilot<'_> {
    fn work(&mut self, wishes: &dyn Fn() -> u32) -> io::Result<()> {
        self.publish_beat()?;
        let (mut beat, mut heed, mut look, mut pause) =
            (Instant::now(), Instant::now(), Instant::now(), LOOKS[0]);
        let mut over = None;
        let mut reports = Vec::new();
        loop {
            let now = Instant::now();
            if over.is_none() {
                over = self.over(wishes());
            } else if wishes() > 0 {
                self.tell_all();
            }
            if now >= heed {
                heed = now + HEED;
                self.heed();
            }
            if over.is_none() && now >= look && self.has_room() {
                pause = if self.take_orders() {
                    LOOKS[0]
                } else {
                    (pause * 2).min(LOOKS[1])
                };
                look = now + pause;
            }
            if self.running.is_empty() {
                if over.is_some() {
                    break;
                }
            } else {
                self.idle = now;
            }
            let room = self.has_room() && over.is_none();
            let until = if room { look.min(heed) } else { heed };
            self.local
                .wait(Some(until.saturating_duration_since(now)), &mut reports)?;
            for report in reports.drain(..) {
                if self.take_report(report)? {
                    look = Instant::now();
                }
            }
            if beat.elapsed() >= BEAT {
                beat = Instant::now();
                // A full disk, or a server that is away: it is tried again, and the steps go on.
                let _ = self.publish_beat();
            }
        }
        self.beat.over = over;
        self.publish_beat()
    }

    fn has_room(&self) -> bool {
        self.running.len() < self.intent.shape.at_once as usize
            && self.taken < self.intent.most_steps
    }

    /// Why it is to take no more, if so.
    fn over(&mut self, wishes: u32) -> Option<String> {
        let ran = self.began.elapsed().as_secs_f64();
        let left = self.intent.shape.walltime as f64 - ran;
        if wishes > 0 {
            self.tell_all();
            return Some("told by a signal".into());
        }
        if left <= self.intent.grace {
            self.tell_all();
            return Some("its wall-clock time ends".into());
        }
        if self.taken >= self.intent.most_steps {
            return Some("it has run as many steps as it may".into());
        }
        if self.folder.join("settled").exists() {
            return Some("nobody looks after it".into());
        }
        if self.running.is_empty() && self.idle.elapsed().as_secs_f64() > self.intent.idle {
            return Some("there was nothing to run".into());
        }
        // What was begun now would be told to stop in a moment.
        let room = left - self.intent.grace > 0.05 * self.intent.shape.walltime as f64;
        (!room && self.running.is_empty()).then(|| "its wall-clock time ends".into())
    }

    /// Tells all steps to write checkpoints and stop.
    fn tell_all(&mut self) {
        if self.told.is_some() {
            return;
        }
        self.told = Some(Instant::now());
        for id in self.running.keys() {
            self.local.cancel(*id, false);
        }
    }

    /// Looks for steps that are to stop, and whether it is to end.
    fn heed(&mut self) {
        let asked = self.exchange.to_stop();
        let mine = self
            .running
            .iter()
            .filter(|(_, r)| asked.contains(&r.order.attempt));
        for id in mine.map(|(id, _)| *id).collect::<Vec<_>>() {
            self.local.cancel(id, false);
        }
        if self.running.is_empty() && self.folder.join("end").exists() {
            self.taken = self.intent.most_steps;
        }
        let left = self.intent.shape.walltime as f64 - self.began.elapsed().as_secs_f64();
        if left <= self.intent.grace {
            self.tell_all();
        }
    }

    /// Takes as many orders as there is room for; true: at least one.
    fn take_orders(&mut self) -> bool {
        let shape = self.intent.shape.name();
        let mut any = false;
        let mut listed = false;
        while self.has_room() {
            let Some(attempt) = self.seen.pop_front() else {
                if listed {
                    break;
                }
                listed = true;
                self.seen = self.exchange.waiting(&shape).into();
                // So that allocations that look at the same time do not all want the same one.
                let n = self.seen.len();
                if n > 0 {
                    let hash = blake3::hash(self.name.as_bytes());
                    self.seen.rotate_left(usize::from(hash.as_bytes()[0]) % n);
                }
                continue;
            };
            if let Some(order) = self.exchange.take(&shape, &attempt, &self.name) {
                self.begin(order);
                any = true;
            }
        }
        any
    }

    fn begin(&mut self, order: Order) {
        self.serial += 1;
        self.taken += 1;
        let task = Task {
            id: self.serial,
            job: order.job.clone(),
            time_limit: order.time_limit,
            log: order.log.clone(),
        };
        let running = Running {
            order,
            since: Instant::now(),
            progress: Progress::default(),
        };
        self.running.insert(self.serial, running);
        self.local.submit(task);
    }

    /// Takes up what a step says; true: one has ended.
    fn take_report(&mut self, report: Report) -> io::Result<bool> {
        match report {
            Report::Message { id, message } => {
                if let (Some(running), Message::Progress(progress)) =
                    (self.running.get_mut(&id), message)
                {
                    running.progress = progress;
                }
                Ok(false)
            }
            Report::Ended { id, outcome } => {
                let Some(running) = self.running.remove(&id) else {
                    return Ok(false);
                };
                self.beat.ended += 1;
                let lasting = !matches!(&outcome, Outcome::Done(record) if !record.is_lasting());
                let verdict = Verdict {
                    attempt: running.order.attempt,
                    pilot: self.name.clone(),
                    host: self.beat.host.clone(),
                    seconds: running.since.elapsed().as_secs_f64(),
                    told: self.told.is_some(),
                    outcome,
                };
                self.insist(&verdict, lasting)?;
                Ok(true)
            }
        }
    }

    /// Writes a verdict, also where the disk is full for a while or its server is away.
    fn insist(&self, verdict: &Verdict, lasting: bool) -> io::Result<()> {
        let until = Instant::now() + Duration::from_secs_f64(self.intent.grace);
        loop {
            match self.exchange.tell(verdict, lasting) {
                Err(_) if Instant::now() < until => std::thread::sleep(HEED),
                other => return other,
            }
        }
    }

    fn publish_beat(&mut self) -> io::Result<()> {
        self.beat.count += 1;
        let one = |r: &Running| (r.order.attempt.clone(), r.progress.clone());
        self.beat.running = self.running.values().map(one).collect();
        publish(&self.beat_file, &to_sealed(&self.beat)?, false)
    }
}
