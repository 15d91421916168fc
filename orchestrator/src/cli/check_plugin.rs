//! `check-plugin`: judges a plugin against the contract, in a process that it may take down.
//!
//! The library is first described by a child. An element or a material is then judged by the step plugin
//! `plugin-conformance`, in a worker process as any step: a workflow of that one step is written into a temporary
//! folder, so that names, parameters and materials are looked up and checked as everywhere else. The step tells of
//! every check as it begins and ends, so that a worker that dies or hangs leaves behind which check it was.

use super::args::{CheckPluginArgs, Places, TextOrJson};
use super::open::{catalog, folders, program};
use crate::engine::{Executor, Local, Outcome, Report, Task, library};
use crate::exit;
use crate::said::{Done, Stop, print, show_findings};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_model::artifact::{
    CONFORMANCE_MARK, CheckOutcome, ConformanceCheck, ConformanceLine, ConformanceRule,
    ConformanceSubject,
};
use plyflow_model::job::{JOB_VERSION, Job, Message};
use plyflow_model::manifest::PluginKind;
use plyflow_plugin_host::PluginCatalog;
use plyflow_workflow::resolved::{PluginId, ResolvedStep};
use plyflow_workflow::{Catalog, CatalogEntry, CatalogError};
use serde_json::json;

/// The materials that an element is judged with when none is given: name and file.
const MATERIALS: [(&str, &str); 2] = [
    (
        "ncf-fcim359.yaml",
        include_str!("../../../workflows/materials/ncf-fcim359.yaml"),
    ),
    (
        "stretchlon-ht350.yaml",
        include_str!("../../../workflows/materials/stretchlon-ht350.yaml"),
    ),
];

/// A check of which no number is known.
fn check(rule: ConformanceRule, outcome: CheckOutcome, seen: String) -> ConformanceCheck {
    ConformanceCheck {
        rule,
        outcome,
        seen,
        measured: None,
        limit: None,
    }
}

fn rule(name: &str, expected: &str, remedy: &str) -> ConformanceRule {
    ConformanceRule {
        name: name.into(),
        expected: expected.into(),
        remedy: remedy.into(),
    }
}

/// `plyflow check-plugin`.
///
/// # Errors
/// [`exit::NOT_CONFORMING`] when a check failed, [`exit::USAGE`] when there is no such plugin, [`exit::INVALID`] when
/// its parameters or a material are wrong.
pub fn check_plugin(args: &CheckPluginArgs) -> Done {
    let places = Places {
        store: None,
        plugins: args.plugins.clone(),
        // To judge a library is to run it: whoever names its path consents.
        trust: match args.trust {
            true => vec![String::new()],
            false => Some(args.plugin.clone())
                .filter(|p| Utf8Path::new(p).is_file())
                .into_iter()
                .collect(),
        },
    };
    // No store: a look at a plugin leaves nothing behind.
    let catalog = catalog(folders(&places, None)?, &places, Utf8Path::new(""))?;
    let mut verdict = Verdict::new(&args.plugin);
    match catalog.find(&args.plugin, Utf8Path::new(".")) {
        Ok(entry) => {
            let entry = CatalogEntry {
                id: PluginId {
                    path: absolute(&entry.id.path),
                    ..entry.id
                },
                ..entry
            };
            verdict.name(&entry);
            verdict.loaded(&entry);
            if entry.manifest.kind == PluginKind::Step {
                verdict.notes.push(
                    "of a step only the descriptor and the manifest are checked; run it in a workflow to see \
                     what it does"
                        .into(),
                );
            } else {
                judge(args, &entry, &catalog, &mut verdict)?;
            }
        }
        Err(e @ CatalogError::Broken { .. }) => verdict.broken(&e.to_string()),
        Err(e) => return Err(Stop::new(exit::USAGE, e)),
    }
    verdict.show(args.format)
}

/// Judges an element or a material in a worker.
fn judge(
    args: &CheckPluginArgs,
    entry: &CatalogEntry,
    catalog: &PluginCatalog,
    verdict: &mut Verdict,
) -> Done {
    let folder = Folder::new()?;
    let file = folder.0.join("check-plugin.yaml");
    std::fs::write(&file, workflow(args, entry, &folder.0)?)
        .map_err(Stop::machine(format!("writing {file}")))?;
    let resolved = plyflow_workflow::resolve(&file, catalog, &[]).map_err(|findings| {
        show_findings(&findings);
        Stop::silent(exit::INVALID)
    })?;
    let step = resolved.workflow.steps.into_iter().next();
    let step = step.ok_or_else(|| Stop::new(exit::INTERNAL, "the workflow has no step"))?;
    named_by_material(entry, &step)?;
    for id in &step.components {
        catalog.admit(id).map_err(|e| Stop::new(exit::INVALID, e))?;
    }
    let task = Task {
        id: 0,
        job: job(&step, catalog.trusted_folders(), &folder.0),
        time_limit: args.time_limit,
        log: folder.0.join("log"),
    };
    let log = task.log.clone();
    let mut local = Local::new(program()?, None);
    local.submit(task);
    loop {
        let mut reports = Vec::new();
        local
            .wait(None, &mut reports)
            .map_err(Stop::machine("waiting for the checks"))?;
        for report in reports {
            match report {
                Report::Message {
                    message: Message::Log { text, .. },
                    ..
                } => verdict.hear(&text),
                Report::Message { .. } => {}
                Report::Ended { outcome, .. } => {
                    let said = std::fs::read_to_string(&log).unwrap_or_default();
                    return verdict.ended(outcome, &said);
                }
            }
        }
    }
}

/// A material file may name another plugin than the one that is to be judged.
fn named_by_material(entry: &CatalogEntry, step: &ResolvedStep) -> Done {
    let judged = |c: &&PluginId| c.hash == entry.id.hash;
    if step.components.iter().any(|c| judged(&c)) {
        return Ok(());
    }
    let names: Vec<&str> = step.components.iter().map(|c| c.path.as_str()).collect();
    let text = format!(
        "--material: the file names the plugin {}; expected {}. Write `plugin: {}` into the file",
        names.join(", "),
        entry.id.path,
        entry.id.path
    );
    Err(Stop::new(exit::INVALID, text))
}

/// The workflow of the one step, as YAML. Only what the user wrote under `--with` is not JSON.
fn workflow(
    args: &CheckPluginArgs,
    entry: &CatalogEntry,
    folder: &Utf8Path,
) -> Result<String, Stop> {
    let with = match &args.with {
        None => "{}".to_owned(),
        Some(text) if Utf8Path::new(text).is_file() => {
            std::fs::read_to_string(text).map_err(Stop::machine(format!("reading {text}")))?
        }
        Some(text) => text.clone(),
    };
    // Below a key, each line further in than that.
    let block = |depth: usize| -> String {
        with.lines()
            .map(|l| format!("\n{:depth$}{l}", ""))
            .collect()
    };
    let quoted = |text: &str| json!(text).to_string();
    let plugin = quoted(entry.id.path.as_str());
    let mut text = String::from(
        "plyflow: 1\nname: check-plugin\nsteps:\n  check:\n    plugin: plugin-conformance\n    with:\n",
    );
    if entry.manifest.kind == PluginKind::Element {
        let with = block(10);
        text += &format!("      element:\n        plugin: {plugin}\n        with:{with}\n");
    }
    text += "      materials:\n";
    if !args.material.is_empty() {
        if entry.manifest.kind == PluginKind::Material && args.with.is_some() {
            let text = "a material is judged with the parameters of `--material` or with those of `--with`: give one of them";
            return Err(Stop::new(exit::USAGE, text));
        }
        for file in &args.material {
            let file = absolute(file);
            if !file.is_file() {
                let text = format!("--material {file}: there is no such file");
                return Err(Stop::new(exit::USAGE, text));
            }
            text += &format!("        - {}\n", quoted(file.as_str()));
        }
    } else if entry.manifest.kind == PluginKind::Element {
        for (name, content) in MATERIALS {
            let file = folder.join(name);
            std::fs::write(&file, content).map_err(Stop::machine(format!("writing {file}")))?;
            text += &format!("        - {}\n", quoted(file.as_str()));
        }
    } else {
        let with = block(12);
        text += &format!(
            "        - plyflow_material: 1\n          name: parameters given\n          plugin: {plugin}\n          \
             thickness: 0.4 mm\n          areal_mass: 440 g/m2\n          with:{with}\n"
        );
    }
    Ok(text)
}

fn job(step: &ResolvedStep, search_path: Vec<Utf8PathBuf>, folder: &Utf8Path) -> Job {
    let library = |p: &PluginId| library(p, &search_path);
    Job {
        version: JOB_VERSION,
        step: step.name.clone(),
        item: Vec::new(),
        key: String::new(),
        plugin: library(&step.plugin),
        components: step.components.iter().map(library).collect(),
        search_path: search_path.clone(),
        parameters: step.parameters.clone_value(),
        inputs: Vec::new(),
        output_kind: step.output_kind.clone(),
        collection: step.collection,
        threads: 4,
        memory_limit: 0,
        artifact: folder.join("checks.vtkhdf"),
        record: folder.join("checks.json"),
        scratch: folder.join("scratch"),
        checkpoints: None,
        provenance: json!({}),
    }
}

fn absolute(path: &Utf8Path) -> Utf8PathBuf {
    path.canonicalize_utf8().unwrap_or_else(|_| path.to_owned())
}

/// A folder that goes when it is dropped.
struct Folder(Utf8PathBuf);

impl Folder {
    fn new() -> Result<Self, Stop> {
        let name = format!("plyflow-check-plugin-{}", std::process::id());
        let path = Utf8PathBuf::from_path_buf(std::env::temp_dir().join(name))
            .map_err(|p| Stop::new(exit::INTERNAL, format!("{} is not UTF-8", p.display())))?;
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir(&path).map_err(Stop::machine(format!("making {path}")))?;
        Ok(Self(path))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// What is found.
struct Verdict {
    plugin: String,
    about: String,
    subjects: Vec<ConformanceSubject>,
    under_way: Option<(String, ConformanceRule)>,
    notes: Vec<String>,
}

impl Verdict {
    fn new(plugin: &str) -> Self {
        Self {
            plugin: plugin.to_owned(),
            about: String::new(),
            subjects: Vec::new(),
            under_way: None,
            notes: Vec::new(),
        }
    }

    fn name(&mut self, e: &CatalogEntry) {
        let (m, kind) = (&e.manifest, e.manifest.kind);
        self.about = format!("{kind} '{}' {} by {}", e.id.name, e.id.version, m.vendor);
    }

    fn add(&mut self, subject: &str, check: ConformanceCheck) {
        match self.subjects.last_mut() {
            Some(last) if last.subject == subject => last.checks.push(check),
            _ => self.subjects.push(ConformanceSubject {
                subject: subject.to_owned(),
                checks: vec![check],
            }),
        }
    }

    /// The library could be described; its manifest is looked at.
    fn loaded(&mut self, e: &CatalogEntry) {
        let (expected, remedy) = (
            "the library loads and exports a descriptor of this ABI",
            "see the message of the loader",
        );
        let seen = format!("{} loads in a process of its own", e.id.path);
        self.add(
            "library",
            check(rule("load", expected, remedy), CheckOutcome::Passed, seen),
        );
        let m = &e.manifest;
        let mut bare: Vec<&str> = m
            .parameters
            .iter()
            .filter(|(_, d)| d.doc.is_empty())
            .map(|(name, _)| name.as_str())
            .collect();
        bare.extend(
            m.fields
                .iter()
                .filter(|f| f.doc.is_empty())
                .map(|f| f.name.as_str()),
        );
        bare.extend(
            m.results
                .iter()
                .filter(|(_, r)| r.doc.is_empty())
                .map(|(n, _)| n.as_str()),
        );
        if m.summary.is_empty() {
            bare.push("summary");
        }
        let (outcome, seen) = if bare.is_empty() {
            let n = m.parameters.len();
            (
                CheckOutcome::Passed,
                format!(
                    "{n} parameters, {} fields, {} results",
                    m.fields.len(),
                    m.results.len()
                ),
            )
        } else {
            (
                CheckOutcome::Failed,
                format!("no text for: {}", bare.join(", ")),
            )
        };
        let (expected, remedy) = (
            "the manifest has a summary, and a `doc` for every parameter, field and result",
            "write one sentence each: users see them in `plyflow plugins` and in their editors",
        );
        self.add(
            "library",
            check(rule("manifest", expected, remedy), outcome, seen),
        );
    }

    fn broken(&mut self, reason: &str) {
        let rule = rule(
            "load",
            "the library loads and exports a descriptor of this ABI with a manifest after schemas/manifest.md",
            "repair what the message says; `plyflow plugins PATH` shows the manifest as it is understood",
        );
        let check = check(rule, CheckOutcome::Failed, reason.to_owned());
        self.add("library", check);
    }

    /// A line of the step's log.
    fn hear(&mut self, text: &str) {
        let json = text.strip_prefix(CONFORMANCE_MARK);
        let Some(line) = json.and_then(|json| serde_json::from_str::<ConformanceLine>(json).ok())
        else {
            return;
        };
        if let Some(begun) = line.begins {
            self.under_way = Some((line.subject, begun));
        } else if let Some(check) = line.ends {
            self.under_way = None;
            self.add(&line.subject, check);
        }
    }

    /// The worker ended: well, or not, which is a finding about the check that was under way.
    fn ended(&mut self, outcome: Outcome, log: &str) -> Done {
        let died = match outcome {
            Outcome::Done(_) => return Ok(()),
            Outcome::Failed { message, .. } => return Err(Stop::new(exit::INVALID, message)),
            Outcome::NotStarted(text) => return Err(Stop::new(exit::INTERNAL, text)),
            Outcome::Cancelled => return Err(Stop::silent(exit::INTERRUPTED)),
            Outcome::Signal(name) => format!("the process was killed by {name}"),
            Outcome::Silent(code) => format!("the plugin ended the process with status {code}"),
            Outcome::TimedOut(limit) => {
                format!("still running when the time limit of {limit} s was reached (--time-limit)")
            }
        };
        let (subject, begun) = self.under_way.take().unwrap_or_else(|| {
            let begun = rule(
                "process",
                "the plugin leaves the process alone",
                "look for what runs when the library is loaded or unloaded",
            );
            ("library".into(), begun)
        });
        let own: Vec<&str> = log
            .lines()
            .filter(|l| !l.contains(CONFORMANCE_MARK) && !l.starts_with("the worker"))
            .collect();
        let last = own
            .last()
            .map_or(String::new(), |l| format!("; it said: {l}"));
        let remedy = format!(
            "a crash, an exit or a hang, not a wrong number: run the plugin under a debugger or with \
             -fsanitize=address. What this check looks for: {}",
            begun.remedy
        );
        let seen = format!("{died}{last}");
        let rule = rule(&begun.name, &begun.expected, &remedy);
        let check = check(rule, CheckOutcome::Failed, seen);
        self.add(&subject, check);
        self.notes
            .push("checks after this one were not made".into());
        Ok(())
    }

    fn show(&self, format: TextOrJson) -> Done {
        let count = |outcome: CheckOutcome| {
            let all = self.subjects.iter().flat_map(|s| &s.checks);
            all.filter(|c| c.outcome == outcome).count()
        };
        let (passed, failed, skipped) = (
            count(CheckOutcome::Passed),
            count(CheckOutcome::Failed),
            count(CheckOutcome::Skipped),
        );
        if format == TextOrJson::Json {
            let value = json!({
                "plugin": self.plugin, "about": self.about, "passed": passed, "failed": failed,
                "skipped": skipped, "subjects": self.subjects, "notes": self.notes,
            });
            print(&format!("{value:#}\n"))?;
        } else {
            print(&self.text(passed, failed, skipped))?;
        }
        if failed > 0 {
            return Err(Stop::silent(exit::NOT_CONFORMING));
        }
        Ok(())
    }

    fn text(&self, passed: usize, failed: usize, skipped: usize) -> String {
        let mut out = format!("{}\n", self.plugin);
        if !self.about.is_empty() {
            out += &format!("{}\n", self.about);
        }
        for subject in &self.subjects {
            out += &format!("\n{}\n", subject.subject);
            for c in &subject.checks {
                let word = match c.outcome {
                    CheckOutcome::Passed => "passed",
                    CheckOutcome::Failed => "FAILED",
                    CheckOutcome::Skipped => "skipped",
                };
                out += &format!("  {word:7} {:26} {}", c.rule.name, c.seen);
                if let (Some(measured), Some(limit)) = (c.measured, c.limit) {
                    out += &format!(" [{measured:.3e}, allowed {limit:.3e}]");
                }
                out += "\n";
                if c.outcome == CheckOutcome::Failed {
                    out += &format!(
                        "          expected: {}\n          to do: {}\n",
                        c.rule.expected, c.rule.remedy
                    );
                }
            }
        }
        for note in &self.notes {
            out += &format!("\nnote: {note}\n");
        }
        let verdict = if failed == 0 {
            "keeps the contract as far as it was checked"
        } else {
            "does not keep the contract"
        };
        out + &format!("\n{verdict}: {passed} passed, {failed} failed, {skipped} skipped\n")
    }
}
