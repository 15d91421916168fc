//! `verify`: reads a whole store and says what is not as it was written; or makes a step again and compares its bytes.

use super::args::{TextOrJson, VerifyArgs, Workflow};
use super::machine::default_memory;
use super::open::{cores, locked, open, store_root};
use super::table::bytes;
use crate::advice;
use crate::engine::core::Limits;
use crate::engine::{Compared, Local, Options, Purpose, Session};
use crate::exit;
use crate::plan::Key;
use crate::progress::Lines;
use crate::said::{Done, Stop, print, warn};
use crate::store::{
    Flaw, Journal, Lock, LockError, Store, damage_of_plugins, read_unplaced, resolved,
};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_plugin_host::damaged_cost;
use plyflow_workflow::resolved::FailurePolicy;
use serde_json::json;
use std::collections::BTreeSet;

/// `plyflow verify`.
///
/// # Errors
/// [`exit::DAMAGED`] when something is not as it was written, or a step makes other bytes; [`exit::USAGE`] when there is no store.
pub fn verify(args: &VerifyArgs) -> Done {
    if !args.again.is_empty() {
        return again(args);
    }
    if let Some(file) = args.workflow.as_deref().filter(|f| !f.is_file()) {
        let text = format!(
            "there is no workflow file {file}; name the workflow beside which the store lies, or the store itself with --store"
        );
        return Err(Stop::new(exit::USAGE, text));
    }
    let store = Store::new(store_root(&args.places, args.workflow.as_deref()));
    if !store.root().is_dir() {
        let text = format!("there is no store {}", store.root());
        return Err(Stop::new(exit::USAGE, text));
    }
    let what = format!("the store {}", store.root());
    // A store on a disk that is not to be written to has no lock, and nobody who changes it.
    let _lock = match Lock::shared(&store.lock(), &what) {
        Err(LockError::Io { .. }) if args.dry_run => None,
        other => Some(other.map_err(locked)?),
    };
    let failed = || Stop::machine(format!("reading {what}"));
    let mut found = Findings {
        store: &store,
        dry_run: args.dry_run,
        whole: 0,
        size: 0,
        unsealed: 0,
        damaged: Vec::new(),
    };
    found.artifacts().map_err(failed())?;
    found.caches().map_err(failed())?;
    found.runs().map_err(failed())?;
    found.tell(args)
}

/// What was found in a store.
struct Findings<'a> {
    store: &'a Store,
    dry_run: bool,
    whole: u64,
    size: u64,
    unsealed: u64,
    damaged: Vec<String>,
}

impl Findings<'_> {
    fn artifacts(&mut self) -> std::io::Result<()> {
        self.unsealed = self.store.earlier_keys()?.len() as u64;
        let mut keys: BTreeSet<Key> = self.store.keys()?.into_iter().collect();
        let lone = self.store.recorded_keys()?;
        for key in &keys {
            match self.store.check(key, None) {
                Ok(record) => {
                    self.whole += 1;
                    self.size += record.bytes;
                }
                // A run with `--force`, or `clean`, was faster.
                Err(Flaw::Gone) => {}
                Err(Flaw::Unsealed) => self.unsealed += 1,
                Err(Flaw::Damaged(text)) => {
                    let place = match self.dry_run {
                        true => String::new(),
                        false => format!("; {}", self.store.set_key_aside(key)),
                    };
                    self.damaged.push(text + &place);
                }
            }
        }
        keys.extend(self.store.earlier_keys()?);
        let noted = self.noted()?;
        for key in lone.iter().filter(|k| !keys.contains(k)) {
            // One that a run places at this moment has its artifact right after it, and one of which no journal knows is all that a run
            // has left that was killed between the two: nothing has gone.
            if self.store.size(key).is_none() && noted.contains(key) {
                let path = self.store.record(key);
                self.note(&path, "the artifact of this record has gone");
            }
        }
        Ok(())
    }

    /// Keys of artifacts that journals know to have been in the store.
    fn noted(&self) -> std::io::Result<BTreeSet<Key>> {
        let mut noted = BTreeSet::new();
        for run in self.store.runs()? {
            // What is wrong with a journal is told when it is its turn.
            if let Ok(journal) = Journal::read(&run.journal()) {
                noted.extend(journal.known_keys());
            }
        }
        Ok(noted)
    }

    fn caches(&mut self) -> std::io::Result<()> {
        let plugins = self.store.plugins();
        if let Some(why) = damage_of_plugins(&plugins) {
            self.note(&plugins, &why);
        }
        for file in self.store.kept_resolutions()? {
            if let Some(why) = resolved::damage(&file) {
                self.note(&file, &why);
            }
        }
        Ok(())
    }

    fn runs(&mut self) -> std::io::Result<()> {
        for run in self.store.runs()? {
            let path = run.journal();
            let why = match Journal::read(&path) {
                Ok(journal) => journal.is_damaged().then(String::new),
                Err(e) => Some(format!(": {e}")),
            };
            if let Some(why) = why {
                // Only its own run may move it: it may be writing.
                self.damaged.push(format!(
                    "the journal {path} is damaged{why}; the next run of its workflow sets it aside and begins a new one"
                ));
            }
            for (artifact, flaw) in read_unplaced(&run) {
                self.damaged.push(flaw.text().to_owned());
                if !self.dry_run {
                    let _ = self.store.set_aside(&artifact);
                    let _ = self
                        .store
                        .set_aside(&artifact.with_extension("record.json"));
                }
            }
            for folder in run.all_checkpoints()? {
                if let Some(why) = damaged_cost(&folder) {
                    self.damaged
                        .push(format!("{why}; what the attempts before cost is not known"));
                }
            }
        }
        Ok(())
    }

    fn note(&mut self, path: &Utf8Path, why: &str) {
        let moved = match self.dry_run {
            true => Ok(None),
            false => self.store.set_aside(path),
        };
        let place = match moved {
            Ok(None) => String::new(),
            Ok(Some(place)) => format!("; it is kept as {place}"),
            Err(e) => format!("; it cannot be moved: {e}"),
        };
        self.damaged
            .push(format!("{path} is damaged: {why}{place}"));
    }

    fn tell(&self, args: &VerifyArgs) -> Done {
        let n = self.damaged.len();
        if args.format == TextOrJson::Json {
            let all = json!({
                "store": self.store.root(), "whole": self.whole, "bytes": self.size, "unsealed": self.unsealed,
                "damaged": self.damaged,
            });
            print(&format!("{all:#}\n"))?;
        } else {
            let mut out = String::new();
            for text in &self.damaged {
                out += &format!("{text}\n");
            }
            let s = if self.whole == 1 { "" } else { "s" };
            out += &format!(
                "{} artifact{s} ({}) as written, {n} damaged, in the store {}\n",
                self.whole,
                bytes(self.size),
                self.store.root()
            );
            if self.unsealed > 0 {
                out += &format!(
                    "{} of an earlier version, which kept no hash: they are not used any more, and `plyflow clean` removes them\n",
                    self.unsealed
                );
            }
            if n > 0 {
                out += "What was damaged is made again by the next run of its workflow.\n";
            }
            print(&out)?;
        }
        match n {
            0 => Ok(()),
            _ => Err(Stop::silent(exit::DAMAGED)),
        }
    }
}

/// `plyflow verify --again STEP`.
fn again(args: &VerifyArgs) -> Done {
    let file: Utf8PathBuf = args.workflow.clone().unwrap_or_default();
    let places = super::args::Places {
        store: args.places.store.clone(),
        plugins: args.places.plugins.clone(),
        trust: args.places.trust.clone(),
    };
    let mut opened = open(&Workflow {
        workflow: file,
        places,
        set: args.set.clone(),
        confirm: None,
    })?;
    opened.restrict(&args.again)?;
    let steps = opened.step_indices(&args.again)?;
    let _locks = opened.lock()?;
    let options = Options {
        limits: Limits {
            cores: args.jobs.unwrap_or_else(cores),
            memory: default_memory(),
            policy: FailurePolicy::KeepGoing,
        },
        search_path: opened.catalog.trusted_folders(),
        force: Vec::new(),
        compare: steps,
        checkpoint_interval: f64::INFINITY,
    };
    let failed = || Stop::machine(format!("running with the store {}", opened.store.root()));
    let mut session = opened.session(options, Purpose::Run(None))?;
    let mut observer = Lines::default();
    session.look(&mut observer);
    opened.admit(&session)?;
    let mut executor = Local::new("/proc/self/exe".into(), None);
    let (session, summary) = session
        .execute(&mut executor, &mut observer, &|| 0)
        .map_err(failed())?;
    for text in session.told() {
        warn(&format!("plyflow: {text}\n"));
    }
    let mut out = String::new();
    for (label, how) in session.compared() {
        out += &format!("{label}: {}\n", how.text());
    }
    for step in not_compared(&session, &args.again) {
        out += &format!("{step}: it has no items, so nothing was made again\n");
    }
    print(&out)?;
    if let Some(first) = summary.failures.first() {
        let reason = advice::with(&first.reason);
        warn(&format!("plyflow: {}: {reason}\n", first.label));
        return Err(Stop::silent(exit::STEP_FAILED));
    }
    let other = |(_, how): &(String, Compared)| matches!(how, Compared::Other { .. });
    match session.compared().iter().any(other) || summary.damaged > 0 {
        true => Err(Stop::silent(exit::DAMAGED)),
        false => Ok(()),
    }
}

/// Those of the steps of which there is no instance: their collections are empty, or could not be made.
fn not_compared<'a>(session: &Session<'_>, steps: &'a [String]) -> Vec<&'a String> {
    let core = &session.core;
    let is_of = |step: &String| {
        let mut all = core.instances().iter();
        all.any(|i| core.graph().steps[i.step].name == *step)
    };
    steps.iter().filter(|step| !is_of(step)).collect()
}
