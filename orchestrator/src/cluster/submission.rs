//! A submission: an allocation, or an array of allocations of one shape, from the intent to the end.

use super::folder::{Beat, Exchange, publish, read_sealed, to_sealed};
use super::intent::{Intent, pilot_name};
use super::script;
use super::slurm::Row;
use camino::Utf8PathBuf;
use plyflow_model::profile::Profile;
use std::io;
use std::time::{Duration, Instant};

/// An allocation as the head sees it.
#[derive(Debug, Clone)]
pub struct Pilot {
    /// Its name: that of the submission and its index.
    pub name: String,
    /// Its last sign of life.
    pub beat: Option<Beat>,
    /// When the last sign of life was new.
    pub heard: Instant,
    /// What Slurm told of it last.
    pub row: Option<Row>,
    /// Since when Slurm is known not to have it any more.
    pub gone: Option<Instant>,
    /// All about it is settled.
    pub closed: bool,
}

/// A submission.
#[derive(Debug)]
pub struct Submission {
    /// What was meant.
    pub intent: Intent,
    /// Number of its job, once known.
    pub job: Option<String>,
    /// Its allocations.
    pub pilots: Vec<Pilot>,
    /// When `sbatch` was called, or it was found.
    pub since: Instant,
    folder: Utf8PathBuf,
}

impl Submission {
    /// Writes the intent, the script and the folder of a new one; all of it is on the disk before Slurm is asked.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn intend(
        exchange: &Exchange,
        intent: Intent,
        profile: &Profile,
        program: &str,
    ) -> io::Result<Self> {
        let folder = exchange.submission(&intent.name);
        std::fs::create_dir_all(&folder)?;
        let text = script::text(&intent, profile, program, exchange);
        publish(&folder.join("submit.sh"), text.as_bytes(), true)?;
        publish(&folder.join("intent.json"), &to_sealed(&intent)?, true)?;
        Ok(Self::of(folder, intent))
    }

    /// One that an earlier head has left, if it is not settled; `None` also where the intent was never finished.
    pub fn found(exchange: &Exchange, name: &str) -> Option<Self> {
        let folder = exchange.submission(name);
        if folder.join("settled").exists() {
            return None;
        }
        let intent: Intent = read_sealed(&folder.join("intent.json"))?;
        let mut found = Self::of(folder, intent);
        let job = std::fs::read_to_string(found.folder.join("job")).ok();
        found.job = job.map(|text| text.trim().to_owned());
        Some(found)
    }

    fn of(folder: Utf8PathBuf, intent: Intent) -> Self {
        let now = Instant::now();
        let pilot = |index| Pilot {
            name: pilot_name(&intent.name, index),
            beat: None,
            heard: now,
            row: None,
            gone: None,
            closed: false,
        };
        Self {
            pilots: (0..intent.size).map(pilot).collect(),
            intent,
            job: None,
            since: now,
            folder,
        }
    }

    /// The script.
    pub fn script(&self) -> Utf8PathBuf {
        self.folder.join("submit.sh")
    }

    /// Notes the number of its job.
    pub fn is_job(&mut self, job: &str) {
        if self.job.as_deref() != Some(job) {
            let _ = publish(
                &self.folder.join("job"),
                format!("{job}\n").as_bytes(),
                true,
            );
            self.job = Some(job.to_owned());
        }
    }

    /// Asks its allocations to take no more steps, and to end when they have none.
    pub fn ask_to_end(&self) {
        let _ = publish(&self.folder.join("end"), b"", false);
    }

    /// Notes that nothing of it is left to look after. An allocation that begins even so ends at once.
    pub fn settle(&self) {
        self.ask_to_end();
        let _ = publish(&self.folder.join("settled"), b"", false);
    }

    /// Whether nothing of it is left to look after.
    pub fn is_settled(&self) -> bool {
        self.pilots.iter().all(|p| p.closed)
    }

    /// Reads signs of life; true: one was new.
    pub fn listen(&mut self) -> bool {
        let mut any = false;
        for (index, pilot) in self
            .pilots
            .iter_mut()
            .enumerate()
            .filter(|(_, p)| !p.closed)
        {
            let Some(beat) = read_sealed::<Beat>(&self.folder.join(format!("beat-{index}.json")))
            else {
                continue;
            };
            if pilot.beat.as_ref().is_none_or(|b| b.count != beat.count) {
                (pilot.beat, pilot.heard) = (Some(beat), Instant::now());
                any = true;
            }
        }
        any
    }

    /// Takes up what Slurm answered; true: something is another than before. What is in no row is not in the queue any more, but for some
    /// time after `sbatch` that may also mean: not yet.
    pub fn take_up(&mut self, rows: &[Row], not_yet: Duration) -> bool {
        let own: Vec<&Row> = rows.iter().filter(|r| r.name == self.intent.name).collect();
        if let Some(row) = own.first() {
            self.is_job(&row.job.clone());
        }
        let is_new = own.is_empty() && self.since.elapsed() < not_yet;
        let mut any = false;
        for (index, pilot) in self.pilots.iter_mut().enumerate() {
            let row = own
                .iter()
                .find(|r| r.index as usize == index)
                .map(|r| (*r).clone());
            let has_ended = row.as_ref().map_or(!is_new, Row::has_ended);
            any |= row.as_ref().map(|r| &r.state) != pilot.row.as_ref().map(|r| &r.state);
            let runs = |r: &Option<Row>| r.as_ref().is_some_and(|r| r.state == "RUNNING");
            if runs(&row) && !runs(&pilot.row) {
                // Only now can it give a sign of life.
                pilot.heard = Instant::now();
            }
            // A state that was seen is not forgotten when the controller forgets the job.
            if row.is_some() {
                pilot.row = row;
            }
            pilot.gone = has_ended.then(|| pilot.gone.unwrap_or_else(Instant::now));
        }
        any
    }
}
