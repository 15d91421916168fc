//! Kills runs of one workflow at random moments, again and again, and counts what a kill must not cause.

use plyflow_e2e::random::Random;
use plyflow_e2e::watch::{Watch, leftovers, workers_under};
use plyflow_e2e::{artifacts, program, wait_for};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// What is killed, and how often.
pub struct Plan {
    /// Where all of it lies; what is there goes on.
    pub folder: PathBuf,
    /// The workflow.
    pub workflow: PathBuf,
    /// What is given to `plyflow run` besides.
    pub words: &'static [&'static str],
    /// Kills in all.
    pub kills: u64,
    /// Latest moment of a kill after the one before it, or after the start: a share of the time that the undisturbed run takes. Most are
    /// much earlier, by the cube of a random number, and some late enough for the workflow to get on.
    pub horizon: f64,
    /// Of which all moments and victims follow.
    pub seed: u64,
}

/// What has come of it so far.
#[derive(Debug, Default, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Count {
    /// Kills that met a process.
    pub kills: u64,
    /// Of these: the head alone, one worker, both in one moment.
    pub heads: u64,
    pub workers: u64,
    pub both: u64,
    /// Runs that were started.
    pub runs: u64,
    /// Times that the whole workflow was done in spite of it; each began with an empty store.
    pub done: u64,
    /// Finished steps that were started, or placed, again.
    pub reruns: u64,
    /// Artifacts that were visible before they were whole, at any moment.
    pub partials: u64,
    /// Files and processes that were left at the end of a whole run.
    pub leftovers: u64,
}

/// What a campaign that was stopped goes on with.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Kept {
    count: Count,
    /// What was found.
    said: Vec<String>,
    /// The artifacts of the undisturbed run.
    artifacts: Vec<String>,
    /// How long that run took (s).
    calm: f64,
}

/// A campaign of kills.
pub struct Campaign<'a> {
    plan: &'a Plan,
    expected: BTreeMap<String, Vec<u8>>,
    /// How long the undisturbed run takes (s).
    calm: f64,
    count: Count,
    watch: Watch,
    said: Vec<String>,
}

impl Plan {
    fn store(&self) -> PathBuf {
        self.folder.join("store")
    }

    fn command(&self, store: &Path, jobs: usize) -> Command {
        let mut command = Command::new(program());
        command.arg("run").arg(&self.workflow).arg("--store");
        command.arg(store).args(self.words);
        command.args(["--no-report", "--log-format", "json", "--jobs"]);
        command.arg(jobs.to_string()).stdin(Stdio::null());
        command.env("PLYFLOW_PLUGINS", plyflow_faults::folder());
        // By this word its workers are known, whoever their parent is by then.
        command.env("TMPDIR", self.folder.join("temporary"));
        command.stdout(Stdio::null());
        command
    }

    fn start(&self, jobs: usize) -> Child {
        let log = std::fs::File::create(self.folder.join("log")).expect("a log");
        let mut command = self.command(&self.store(), jobs);
        command.stderr(log).spawn().expect("plyflow starts")
    }

    /// Kills until the plan is fulfilled, then lets the last run end.
    pub fn carry_out(&self) -> (Count, Vec<String>) {
        std::fs::create_dir_all(self.folder.join("temporary")).expect("a folder");
        let calm = self.folder.join("calm");
        let begun = Instant::now();
        let status = self.command(&calm, 2).stderr(Stdio::null()).status();
        assert!(status.expect("plyflow starts").success());
        let took = begun.elapsed().as_secs_f64();
        let expected = artifacts(&calm);
        let kept = std::fs::read(self.folder.join("count.json")).unwrap_or_default();
        let kept: Kept = serde_json::from_slice(&kept).unwrap_or_default();
        // With other plugins every step has another key, and what they make would all count as partial.
        assert!(
            kept.count.runs == 0 || kept.artifacts.iter().eq(expected.keys()),
            "{} was begun with other plugins or another workflow: empty it, or take another folder",
            self.folder.display()
        );
        let mut campaign = Campaign {
            plan: self,
            expected,
            // What is gone on with is in the store already.
            calm: took.max(kept.calm),
            count: kept.count,
            watch: Watch::begin(&self.store()),
            said: kept.said,
        };
        while campaign.count.kills < self.kills {
            campaign.run();
            campaign.keep();
        }
        campaign.end();
        campaign.keep();
        (campaign.count, campaign.said)
    }
}

impl Campaign<'_> {
    fn keep(&self) {
        let kept = Kept {
            count: self.count.clone(),
            said: self.said.clone(),
            artifacts: self.expected.keys().cloned().collect(),
            calm: self.calm,
        };
        let text = serde_json::to_vec(&kept).expect("numbers");
        let new = self.plan.folder.join("count.new");
        std::fs::write(&new, text).expect("room for a count");
        std::fs::rename(new, self.plan.folder.join("count.json")).expect("a count");
    }

    /// One run, up to the kill that ends it, or to its end.
    fn run(&mut self) {
        let mut random = Random::new(self.plan.seed, self.count.runs);
        self.count.runs += 1;
        let finished = self.watch.visible.clone();
        let mut head = self.plan.start(*random.one_of(&[1, 2, 4]));
        let mut workers = 0;
        // A machine under load takes longer to read the workflow than it has until the first kill: most kills are to meet steps.
        if random.below(4) > 0 {
            wait_for("a step, or the end", || {
                self.log().contains("\"started\"") || head.try_wait().expect("a child").is_some()
            });
        }
        let ended = loop {
            let latest = self.plan.horizon * self.calm;
            std::thread::sleep(Duration::from_secs_f64(latest * random.unit().powi(3)));
            if let Some(status) = head.try_wait().expect("a child") {
                break status.code();
            }
            let victims = workers_of(head.id());
            let whom = random.below(3);
            self.count.kills += 1;
            match (whom, victims.is_empty()) {
                (0, false) => {
                    kill(*random.one_of(&victims));
                    self.count.workers += 1;
                    workers += 1;
                    continue;
                }
                (1, false) => {
                    // In either order: whoever is killed first cannot help the other.
                    let mut all = victims;
                    all.push(head.id());
                    random.shuffle(&mut all);
                    all.into_iter().for_each(kill);
                    self.count.both += 1;
                }
                _ => {
                    kill(head.id());
                    self.count.heads += 1;
                }
            }
            break None;
        };
        head.wait().expect("a child");
        wait_for("the workers' end", || {
            workers_under(&self.plan.folder.join("temporary")) == 0
        });
        self.look(&finished);
        match ended {
            Some(0) => self.end_of_all(),
            Some(4) if workers > 0 => {}
            Some(code) => self.said.push(format!(
                "a run of which {workers} workers were killed ended with code {code}: {}",
                self.log()
            )),
            None => {}
        }
    }

    fn log(&self) -> String {
        std::fs::read_to_string(self.plan.folder.join("log")).unwrap_or_default()
    }

    /// Looks at what a run did: what was finished before it must not have been begun.
    fn look(&mut self, finished: &BTreeSet<String>) {
        for line in self.log().lines() {
            let line: Value = serde_json::from_str(line).unwrap_or_default();
            let name = format!("{}.vtkhdf", line["key"].as_str().unwrap_or_default());
            if line["event"] == "started" && finished.contains(&name) {
                self.count.reruns += 1;
                self.said.push(format!("{} was run again", line["step"]));
            }
        }
        self.watch.take(&self.expected);
        self.watch.read_all(&self.expected);
        self.count.reruns += std::mem::take(&mut self.watch.again);
        self.count.partials += self.watch.partial.len() as u64;
        self.said.append(&mut self.watch.partial);
    }

    /// The whole workflow is done: the same bytes as undisturbed, and nothing else.
    fn end_of_all(&mut self) {
        self.count.done += 1;
        let store = self.plan.store();
        if artifacts(&store) != self.expected {
            self.said.push("other bytes at the end".into());
        }
        let mut left = leftovers(&self.plan.folder, &store);
        let temporary = std::fs::read_dir(self.plan.folder.join("temporary"));
        left.extend(
            temporary
                .expect("a folder")
                .flatten()
                .map(|e| format!("{e:?}")),
        );
        self.count.leftovers += left.len() as u64;
        self.said.extend(left);
        std::fs::remove_dir_all(&store).expect("a store");
        self.watch = Watch::begin(&store);
    }

    /// Lets the last run end; nothing is left to do then.
    fn end(&mut self) {
        for again in [false, true] {
            let finished = self.watch.visible.clone();
            let mut head = self.plan.start(2);
            let status = head.wait().expect("a child");
            self.look(&finished);
            let log = self.log();
            if !status.success() || (again && log.contains("\"started\"")) {
                self.said.push(format!("the last run: {log}"));
            }
        }
        let verify = Command::new(program())
            .args(["verify", "--store"])
            .arg(self.plan.store())
            .output()
            .expect("plyflow starts");
        if !verify.status.success() {
            let text = String::from_utf8_lossy(&verify.stdout);
            self.said.push(format!("verify: {text}"));
        }
        self.end_of_all();
    }
}

/// The processes of workers of a head.
fn workers_of(head: u32) -> Vec<u32> {
    let all = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    let marks = [format!("--parent\0{head}\0"), format!("--inside\0{head}\0")];
    let is_one = |pid: &u32| {
        let line = std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        let line = String::from_utf8_lossy(&line).into_owned();
        marks.iter().any(|m| line.contains(m))
    };
    all.filter_map(|e| e.file_name().to_str()?.parse().ok())
        .filter(is_one)
        .collect()
}

/// One that has ended in this moment is none any more; numbers of processes are not used again so soon.
fn kill(pid: u32) {
    if let Some(pid) = i32::try_from(pid)
        .ok()
        .and_then(rustix::process::Pid::from_raw)
    {
        let _ = rustix::process::kill_process(pid, rustix::process::Signal::KILL);
    }
}
