//! Opens what most commands need: the plugins, the workflow, the store.

use super::args::{Places, Workflow};
use super::found::asked::asked_before;
use super::trust;
use crate::engine::core::{Limits, State};
use crate::engine::{Of, Options, Purpose, Session};
use crate::exit;
use crate::plan::{Graph, recipes};
use crate::progress::Quiet;
use crate::said::{Stop, show_findings, warn};
use crate::store::{Lock, LockError, Store, resolved};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_model::artifact::Variation;
use plyflow_model::text::one_line;
use plyflow_plugin_host::{Describer, PluginCatalog};
use plyflow_workflow::resolved::ResolvedWorkflow;
use plyflow_workflow::{Part, Wanted};
use std::collections::HashSet;

/// A workflow that is ready to plan, and where its things are.
pub struct Opened {
    /// The workflow.
    pub workflow: ResolvedWorkflow,
    /// Its steps as a graph.
    pub graph: Graph,
    /// Its store.
    pub store: Store,
    /// Where plugins are looked for.
    pub catalog: PluginCatalog,
}

/// This program.
///
/// # Errors
/// When the system does not tell.
pub fn program() -> Result<Utf8PathBuf, Stop> {
    let path = std::env::current_exe().map_err(Stop::machine("finding this program"))?;
    Utf8PathBuf::from_path_buf(path).map_err(|p| {
        Stop::new(
            exit::INTERNAL,
            format!("the path {} is not UTF-8", p.display()),
        )
    })
}

fn absolute(path: &Utf8Path) -> Utf8PathBuf {
    camino::absolute_utf8(path).unwrap_or_else(|_| path.to_owned())
}

/// The folders where plugins are looked for, by whom they are trusted.
#[derive(Debug, Default)]
pub struct Folders {
    /// All, in the order of the search: the command line, the workflow, the environment, beside this program.
    pub search: Vec<Utf8PathBuf>,
    /// Beside this program.
    installation: Vec<Utf8PathBuf>,
    /// Of the command line and the environment: the user's own.
    own: Vec<Utf8PathBuf>,
}

/// The folders where plugins are looked for.
///
/// # Errors
/// When this program cannot be found.
pub fn folders(places: &Places, workflow: Option<&Utf8Path>) -> Result<Folders, Stop> {
    let mut found = Folders::default();
    for given in places.plugins.iter().map(|p| absolute(p)) {
        if !given.is_dir() {
            return Err(Stop::new(
                exit::USAGE,
                format!("--plugins {given}: there is no such folder"),
            ));
        }
        found.own.push(given);
    }
    let mut search = found.own.clone();
    // The file is parsed twice only when it may name folders: a study may have ten thousand steps.
    if let Some(file) = workflow.filter(|f| mentions_plugins(f)) {
        search.extend(plyflow_workflow::plugin_search_folders(file));
    }
    if let Some(list) = std::env::var_os("PLYFLOW_PLUGINS") {
        let given = std::env::split_paths(&list).filter(|p| !p.as_os_str().is_empty());
        for path in given.filter_map(|p| Utf8PathBuf::from_path_buf(p).ok()) {
            // A path from where one happens to stand may lead into a stranger's folder.
            if path.is_absolute() {
                found.own.push(path.clone());
            }
            search.push(absolute(&path));
        }
    }
    if let Some(beside) = program()?.parent() {
        found
            .installation
            .extend([beside.join("plugins"), beside.to_owned()]);
        if let Some(prefix) = beside.parent() {
            found.installation.push(prefix.join("lib/plyflow"));
        }
    }
    search.extend(found.installation.iter().cloned());
    let mut seen = Vec::new();
    search.retain(|f| {
        let new = f.is_dir() && !seen.contains(f);
        seen.push(f.clone());
        new
    });
    found.search = search;
    Ok(found)
}

fn mentions_plugins(file: &Utf8Path) -> bool {
    let read = plyflow_files::open::read(file.as_std_path(), plyflow_files::open::MOST_WRITTEN);
    // What cannot be read is told when it is loaded; in UTF-16 the word has zeros in it.
    read.is_ok_and(|bytes| {
        bytes.windows(7).any(|w| w == b"plugins")
            || bytes.starts_with(&[0xff, 0xfe])
            || bytes.starts_with(&[0xfe, 0xff])
    })
}

/// The store of a workflow file.
pub fn store_root(places: &Places, workflow: Option<&Utf8Path>) -> Utf8PathBuf {
    match (&places.store, workflow) {
        (Some(given), _) => absolute(given),
        (None, Some(file)) => absolute(file)
            .parent()
            .map_or_else(|| ".".into(), Utf8Path::to_owned)
            .join(".plyflow"),
        (None, None) => absolute(Utf8Path::new(".plyflow")),
    }
}

/// The plugins on a search path, behind the gate of what the user trusts. What is known of them is kept in the store, if
/// there is one.
///
/// # Errors
/// When this program cannot be found, or `--trust` names no library.
pub fn catalog(folders: Folders, places: &Places, store: &Utf8Path) -> Result<PluginCatalog, Stop> {
    let describer = Describer::Child {
        program: program()?,
        arguments: vec!["step-worker".into(), "--describe".into()],
    };
    // Only where there is a store: a look at the plugins leaves nothing in the folder where it was taken.
    let store = Store::new(store.to_owned());
    let cache = store.root().is_dir().then(|| store.plugins());
    if let Some(text) = cache
        .is_some()
        .then(|| store.set_damaged_plugins_aside())
        .flatten()
    {
        warn(&format!("plyflow: {text}\n"));
    }
    let python = super::python::python(&program()?, &folders.installation);
    let trust = trust::trust(places, &folders.installation, folders.own)?;
    let catalog = PluginCatalog::new(folders.search, cache, describer).gated(trust);
    Ok(catalog.with_python(python))
}

/// Reads and checks a workflow; says everything that is wrong with it.
///
/// # Errors
/// [`exit::INVALID`] with the findings shown, or [`exit::USAGE`] when there is no such file.
pub fn open(args: &Workflow) -> Result<Opened, Stop> {
    match load(args)? {
        Ok(opened) => Ok(opened),
        Err(findings) => {
            show_findings(&findings);
            Err(Stop::silent(exit::INVALID))
        }
    }
}

/// As [`open`], an optimisation with these points.
///
/// # Errors
/// As [`open`].
pub fn open_at(args: &Workflow, points: &[Vec<plyflow_study::Value>]) -> Result<Opened, Stop> {
    match load_at(args, Some(points))? {
        Ok(opened) => Ok(opened),
        Err(findings) => {
            show_findings(&findings);
            Err(Stop::silent(exit::INVALID))
        }
    }
}

/// As [`open`], with the findings given back.
///
/// # Errors
/// When the file does not exist or an override is not understood.
pub fn load(args: &Workflow) -> Result<Result<Opened, plyflow_workflow::Diagnostics>, Stop> {
    load_at(args, None)
}

/// `points`: those of an optimisation; where none are given, those that it has asked for when it ran last.
fn load_at(
    args: &Workflow,
    points: Option<&[Vec<plyflow_study::Value>]>,
) -> Result<Result<Opened, plyflow_workflow::Diagnostics>, Stop> {
    let file = &args.workflow;
    if !file.is_file() {
        let text = format!("there is no workflow file {file}");
        return Err(Stop::new(exit::USAGE, text));
    }
    let folders = folders(&args.places, Some(file))?;
    let root = store_root(&args.places, Some(file));
    let catalog = catalog(folders, &args.places, &root)?;
    let overrides = overrides(&args.set)?;
    let full = absolute(file);
    let circumstances = resolved::circumstances(&program()?, &full, &args.set, catalog.folders());
    let confirm = chosen(args.confirm.as_ref())?;
    let kept = circumstances
        .as_ref()
        .filter(|_| points.is_none() && confirm.is_empty())
        .and_then(|c| resolved::read(&root, &full, c, &catalog));
    let (workflow, recipes) = match kept {
        Some(kept) => kept,
        None => match plyflow_workflow::resolve_wanted(
            file,
            &catalog,
            &Wanted {
                overrides: &overrides,
                confirm: &confirm,
                points: &|name, digest, search| match points {
                    Some(points) => Some(points.to_vec()),
                    None => asked_before(&root, name, digest, search),
                },
            },
        ) {
            Ok(resolution) => {
                let recipes = recipes(&resolution.workflow);
                // What an optimisation has asked for changes from run to run; what is confirmed has more steps than the file.
                let study = resolution.workflow.study.as_ref();
                let moves = study.is_some_and(|s| s.optimisation.is_some()) || !confirm.is_empty();
                if let Some(c) = circumstances.as_ref().filter(|_| !moves) {
                    resolved::write(&root, &full, c, (&resolution, &recipes));
                }
                (resolution.workflow, recipes)
            }
            Err(findings) => return Ok(Err(findings)),
        },
    };
    let graph = Graph::of_recipes(&workflow, recipes).map_err(|e| Stop::new(exit::INVALID, e))?;
    Ok(Ok(Opened {
        workflow,
        graph,
        store: Store::new(root),
        catalog,
    }))
}

/// Checks a scene or a material by itself; `None`: the file is neither.
///
/// # Errors
/// When the plugins' folders cannot be searched.
pub fn check_part(
    args: &Workflow,
) -> Result<Option<Result<Part, plyflow_workflow::Diagnostics>>, Stop> {
    let file = &args.workflow;
    if !file.is_file() {
        return Ok(None);
    }
    let folders = folders(&args.places, Some(file))?;
    let root = store_root(&args.places, Some(file));
    let catalog = catalog(folders, &args.places, &root)?;
    Ok(plyflow_workflow::check_part(file, &catalog))
}

fn overrides(set: &[String]) -> Result<Vec<plyflow_workflow::Override>, Stop> {
    let one = |text: &String| {
        text.parse()
            .map_err(|e| Stop::new(exit::USAGE, format!("--set {text}: {e}")))
    };
    set.iter().map(one).collect()
}

/// The variants that `--confirm` asks for; none where it is not given.
///
/// # Errors
/// When a name is none of a variant.
fn chosen(given: Option<&String>) -> Result<Vec<Variation>, Stop> {
    let Some(text) = given else {
        return Ok(Vec::new());
    };
    plyflow_workflow::variants_of(text)
        .map_err(|e| Stop::new(exit::USAGE, format!("--confirm={text}: {e}")))
}

impl Opened {
    /// Locks of a run: of the store, which others may run in too, and of this workflow, which only one may run. Held until they are dropped.
    ///
    /// # Errors
    /// [`exit::LOCKED`] when the workflow runs already, or the store is being cleaned.
    pub fn lock(&self) -> Result<[Lock; 2], Stop> {
        let store = format!("the store {}", self.store.root());
        let workflow = format!("the workflow '{}'", one_line(&self.workflow.name));
        let folder = self.store.run(&self.workflow.name);
        Ok([
            Lock::shared(&self.store.lock(), &store).map_err(locked)?,
            Lock::exclusive(&folder.lock(), &workflow).map_err(locked)?,
        ])
    }

    /// A session that has not looked at anything yet.
    ///
    /// # Errors
    /// When the journal cannot be read or written.
    pub fn session(&self, options: Options, purpose: Purpose) -> Result<Session<'_>, Stop> {
        let root = self.store.root();
        let what = match purpose {
            Purpose::Look => format!("reading the store {root}"),
            Purpose::Run(_) => format!("running with the store {root}"),
        };
        let of = Of {
            workflow: &self.workflow,
            graph: &self.graph,
            store: &self.store,
        };
        Session::new(of, options, purpose).map_err(Stop::machine(what))
    }

    /// A session that has looked at the store and will not run anything.
    ///
    /// # Errors
    /// When the journal cannot be read.
    pub fn look(&self) -> Result<Session<'_>, Stop> {
        let limits = Limits {
            cores: cores(),
            memory: 0,
            policy: self.workflow.on_failure,
        };
        let options = Options {
            limits,
            search_path: self.catalog.trusted_folders(),
            force: Vec::new(),
            compare: Vec::new(),
            checkpoint_interval: f64::INFINITY,
        };
        let mut session = self.session(options, Purpose::Look)?;
        session.look(&mut Quiet);
        Ok(session)
    }

    /// Whether every library that a run would load may be loaded: those of steps that are not all in the store. Asked of the libraries
    /// as they are now, whatever the store has kept of them.
    ///
    /// # Errors
    /// [`exit::INVALID`] with the first library that may not.
    pub fn admit(&self, session: &Session<'_>) -> Result<(), Stop> {
        let core = &session.core;
        let open = core.instances().iter();
        let open: HashSet<usize> = open
            .filter(|i| !matches!(i.state, State::Done { .. }))
            .map(|i| i.step)
            .collect();
        let mut seen = HashSet::new();
        for (at, step) in self.workflow.steps.iter().enumerate() {
            let plan = &self.graph.steps[at];
            let hidden = || !plan.dimensions.is_empty() && !core.hidden_by(at).is_empty();
            if !plan.wanted || !(open.contains(&at) || hidden()) {
                continue;
            }
            for id in std::iter::once(&step.plugin).chain(&step.components) {
                if seen.insert(&id.path) {
                    self.catalog
                        .admit(id)
                        .map_err(|e| Stop::new(exit::INVALID, format!("{}: {e}", step.name)))?;
                }
            }
        }
        Ok(())
    }

    /// Wants only these steps and what they need.
    ///
    /// # Errors
    /// When a name is none of the steps; says which there are.
    pub fn restrict(&mut self, names: &[String]) -> Result<(), Stop> {
        self.step_indices(names)?;
        self.graph
            .restrict(names)
            .map_err(|e| Stop::new(exit::USAGE, e))
    }

    /// Indices of steps by name.
    ///
    /// # Errors
    /// When a name is none of the steps; says which there are.
    pub fn step_indices(&self, names: &[String]) -> Result<Vec<usize>, Stop> {
        let mut found = Vec::new();
        for name in names {
            let named = self.graph.named(name);
            if named.is_empty() {
                let mut all: Vec<&str> = self.graph.steps.iter().map(|s| s.base.as_str()).collect();
                all.dedup();
                let mut text = format!(
                    "there is no step '{name}'; the steps are: {}",
                    all.join(", ")
                );
                if let Some(first) = self.graph.steps.iter().find(|s| s.name != s.base) {
                    text += &format!("; at a point of the study such as '{}'", first.name);
                }
                return Err(Stop::new(exit::USAGE, text));
            }
            found.extend(named);
        }
        Ok(found)
    }
}

/// Turns a lock that is not to be had into an exit code.
pub fn locked(e: LockError) -> Stop {
    match e {
        LockError::Held { .. } => Stop::new(exit::LOCKED, e),
        LockError::Io { .. } => Stop::new(exit::INTERNAL, e),
    }
}

/// Cores of this machine that this process may use.
pub fn cores() -> u32 {
    std::thread::available_parallelism().map_or(1, |n| n.get() as u32)
}
