//! `--on`: where the steps of a run are run.

use super::open::{Opened, program};
use super::table::table;
use crate::cluster::{
    Cluster, GUESS, Limits, Means, NoLimits, OpenError, Refusal, Shape, Slurm, allocations, refusal,
};
use crate::engine::Session;
use crate::engine::core::State;
use crate::engine::{Executor, Local};
use crate::exit;
use crate::said::{Stop, show_findings, warn};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_model::profile::{Granted, Profile};
use std::cell::Cell;
use std::collections::BTreeSet;
use std::os::fd::OwnedFd;
use std::rc::Rc;

/// A cluster as a run was told to use it.
pub struct On {
    /// How.
    pub profile: Profile,
    /// What its partition gives.
    pub limits: Limits,
    /// With the requests that it took to ask for them: they count.
    slurm: Cell<Slurm>,
}

/// Where `--on slurm` looks for a profile.
fn default_profile(workflow: &Utf8Path) -> Option<Utf8PathBuf> {
    let beside = workflow
        .parent()
        .unwrap_or(Utf8Path::new(""))
        .join("slurm.yaml");
    let home = |name: &str, below: &str| {
        std::env::var(name)
            .ok()
            .map(|d| Utf8PathBuf::from(d).join(below).join("plyflow/slurm.yaml"))
    };
    let own = home("XDG_CONFIG_HOME", "").or_else(|| home("HOME", ".config"));
    std::iter::once(beside).chain(own).find(|p| p.is_file())
}

impl On {
    /// What `--on` says; `None` where it is not given.
    ///
    /// # Errors
    /// [`exit::INVALID`] when the profile has errors or names a partition that is not there; [`exit::USAGE`] when there is no such file.
    pub fn chosen(on: Option<&Utf8Path>, workflow: &Utf8Path) -> Result<Option<Self>, Stop> {
        let file = match on {
            None => return Ok(None),
            Some(word) if word == "slurm" => default_profile(workflow),
            Some(file) if !file.is_file() => {
                let text = format!(
                    "--on {file}: there is no such profile; give `slurm` or the path of a profile (see `plyflow schema profile --format text`)"
                );
                return Err(Stop::new(exit::USAGE, text));
            }
            Some(file) => Some(file.to_owned()),
        };
        let profile = match &file {
            None => Profile::default(),
            Some(file) => plyflow_workflow::load_profile(file).map_err(|findings| {
                show_findings(&findings);
                Stop::silent(exit::INVALID)
            })?,
        };
        let mut slurm = Slurm::default();
        let limits = match slurm.limits(profile.partition.as_deref()) {
            Ok(limits) => limits,
            Err(e @ NoLimits::NoPartition(..)) => {
                return Err(Stop::new(exit::INVALID, format!("the profile: {e}")));
            }
            Err(NoLimits::Silent(why)) => {
                warn(&format!(
                    "plyflow: Slurm does not tell its limits ({why}); what does not fit them is found out later\n"
                ));
                Limits::default()
            }
        };
        let slurm = Cell::new(slurm);
        Ok(Some(Self {
            profile,
            limits,
            slurm,
        }))
    }

    /// What the steps of a workflow get, by their index; those only that are wanted.
    pub fn granted(&self, opened: &Opened) -> Vec<(usize, Granted)> {
        let one = |(at, step): (usize, &plyflow_workflow::resolved::ResolvedStep)| {
            let stated = opened.graph.steps[at].cores;
            let granted = self
                .profile
                .granted(&step.plugin.name, stated, step.resources.memory);
            opened.graph.steps[at].wanted.then_some((at, granted))
        };
        opened
            .workflow
            .steps
            .iter()
            .enumerate()
            .filter_map(one)
            .collect()
    }

    /// Why the cluster can never run some steps; each reason once.
    pub fn refusals(&self, opened: &Opened) -> Vec<Refusal> {
        let mut found = Vec::new();
        for (at, granted) in self.granted(opened) {
            let plugin = &opened.workflow.steps[at].plugin.name;
            let refused = refusal(&Shape::of(&granted), plugin, &self.profile, &self.limits);
            found.extend(refused.filter(|r| !found.contains(r)));
        }
        found
    }

    /// Gives steps that state no cores those of the profile.
    ///
    /// # Errors
    /// [`exit::INVALID`] when the cluster can never run a step.
    pub fn prepare(&self, opened: &mut Opened) -> Result<(), Stop> {
        let refusals: Vec<String> = self
            .refusals(opened)
            .iter()
            .map(ToString::to_string)
            .collect();
        if !refusals.is_empty() {
            return Err(Stop::new(exit::INVALID, refusals.join("\nplyflow: ")));
        }
        for (at, granted) in self.granted(opened) {
            opened.graph.steps[at].cores = granted.cores;
        }
        Ok(())
    }
}

/// Allocations of one shape that a run asks for.
struct Asked {
    shape: Shape,
    plugins: BTreeSet<String>,
    steps: usize,
    /// Whether there may be more steps than are known.
    open: bool,
}

impl On {
    fn asked(&self, opened: &Opened, session: &Session<'_>) -> Vec<Asked> {
        let core = &session.core;
        let mut missing = vec![0; opened.graph.steps.len()];
        for instance in core.instances() {
            missing[instance.step] += usize::from(!matches!(instance.state, State::Done { .. }));
        }
        let mut found: Vec<Asked> = Vec::new();
        for (at, granted) in self.granted(opened) {
            let (shape, open) = (Shape::of(&granted), !core.hidden_by(at).is_empty());
            if missing[at] == 0 && !open {
                continue;
            }
            let place = found
                .iter()
                .position(|a| a.shape == shape)
                .unwrap_or_else(|| {
                    found.push(Asked {
                        shape,
                        plugins: BTreeSet::new(),
                        steps: 0,
                        open: false,
                    });
                    found.len() - 1
                });
            let asked = &mut found[place];
            asked
                .plugins
                .insert(opened.workflow.steps[at].plugin.name.clone());
            asked.steps += missing[at];
            asked.open |= open;
        }
        found
    }

    /// How many allocations of a shape are asked for at first.
    fn at_first(&self, asked: &Asked) -> usize {
        allocations(&asked.shape, asked.steps, GUESS, self.profile.most_steps)
            .min(self.profile.most_queued as usize)
    }

    /// The allocations that a run asks for, for people.
    pub fn text(&self, opened: &Opened, session: &Session<'_>) -> String {
        let asked = self.asked(opened, session);
        if asked.is_empty() {
            return "\nno allocations: nothing is to run\n".into();
        }
        let row = |a: &Asked| {
            let more = if a.open { " or more" } else { "" };
            let plugins: Vec<&str> = a.plugins.iter().map(String::as_str).collect();
            vec![
                a.shape.text(),
                format!("{}{more}", a.steps),
                self.at_first(a).to_string(),
                plugins.join(", "),
            ]
        };
        let rows: Vec<_> = asked.iter().map(row).collect();
        let partition = match self.limits.partition.as_str() {
            "" => String::new(),
            name => format!(" of the partition '{name}'"),
        };
        let most = self.profile.most_queued;
        format!(
            "\n{}at most {most} allocations{partition} at a time; steps that are short share one\n",
            table(&["allocation", "steps", "at first", "of"], &rows, &[1, 2])
        )
    }

    /// The same for programs.
    pub fn as_json(&self, opened: &Opened, session: &Session<'_>) -> serde_json::Value {
        let one = |a: &Asked| {
            let s = &a.shape;
            serde_json::json!({
                "cores": s.all_cores(), "memory_mebibytes": s.all_memory(), "walltime_seconds": s.walltime, "gpus": s.gpus,
                "steps_at_once": s.at_once, "steps": a.steps, "more_steps": a.open, "allocations_at_first": self.at_first(a),
                "plugins": a.plugins,
            })
        };
        self.asked(opened, session).iter().map(one).collect()
    }
}

/// Where the steps of a run are run, and what the user wishes by other ways than signals.
pub struct Place {
    /// It runs them.
    pub executor: Box<dyn Executor>,
    /// How often `plyflow cancel` was called.
    pub wishes: Rc<Cell<u32>>,
}

impl Place {
    /// This machine, or a cluster. The caller holds the lock of the run.
    ///
    /// # Errors
    /// [`exit::LOCKED`] when another machine drives the run.
    pub fn open(on: Option<&On>, opened: &Opened, wake: OwnedFd) -> Result<Self, Stop> {
        let Some(on) = on else {
            // Not the path: a build that replaces the program in the middle of a run must not mix versions.
            let executor = Box::new(Local::new("/proc/self/exe".into(), Some(wake)));
            return Ok(Self {
                executor,
                wishes: Rc::default(),
            });
        };
        let run = opened.store.run(&opened.workflow.name);
        let means = Means {
            profile: on.profile.clone(),
            limits: on.limits.clone(),
            program: program()?.into_string(),
            slurm: on.slurm.take(),
        };
        let opened = Cluster::open(&run.root, means, Some(wake));
        let executor = opened.map_err(|e| match e {
            OpenError::Taken(crate::cluster::Taken::Elsewhere { .. }) => Stop::new(exit::LOCKED, e),
            OpenError::Path(_) => Stop::new(exit::USAGE, e),
            _ => Stop::new(exit::INTERNAL, e),
        })?;
        Ok(Self {
            wishes: executor.wishes(),
            executor: Box::new(executor),
        })
    }
}
