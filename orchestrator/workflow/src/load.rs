//! A workflow file -> [`ResolvedWorkflow`], or everything that is wrong with it.

use crate::catalog::{Catalog, Plugins};
use crate::check::Checker;
use crate::confirm;
use crate::diagnostics::{Diagnostics, Mention, Problems, Source};
use crate::draft::{Draft, WORKFLOW};
use crate::evidence::{Evidence, Resolution};
use crate::expect;
use crate::hints::other_format;
use crate::limits;
use crate::named::absolute;
use crate::overrides::{self, Lost, Override, without_variables};
use crate::parameters::{Place, Resolver, find};
use crate::resolved::{FailurePolicy, ResolvedInput, ResolvedStep, ResolvedWorkflow, Resources};
use crate::study::{Asked, Family, PointsOf};
use crate::wires::{self, Wiring};
use crate::yaml::{Kind, Node, Span};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_files::open::{self, MOST_WRITTEN};
use plyflow_model::artifact::{Attributes, Geometry, Variation};
use plyflow_model::canonical;
use plyflow_model::given::AskedFor;
use plyflow_model::manifest::PluginKind;
use plyflow_model::text::{WORD, is_word};
use plyflow_model::units::{Dimension, parse_quantity};
use std::collections::HashSet;

/// Reads a workflow file, looks every name up, checks every parameter, and hashes every file.
///
/// # Errors
/// All findings of one pass, each with its place.
pub fn load(path: &Utf8Path, catalog: &dyn Catalog) -> Result<ResolvedWorkflow, Diagnostics> {
    load_with(path, catalog, &[])
}

/// As [`load`], with parameters from the command line in place of the file's.
///
/// # Errors
/// As [`load`]; what is wrong with an overriding value is found in its own text, as in a file called `--set`.
pub fn load_with(
    path: &Utf8Path,
    catalog: &dyn Catalog,
    overrides: &[Override],
) -> Result<ResolvedWorkflow, Diagnostics> {
    resolve(path, catalog, overrides).map(|r| r.workflow)
}

/// A file that a workflow names, of a format of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// A scene.
    Scene,
    /// A material.
    Material,
}

/// Checks a scene or a material by itself, with all that it names. `None`: the file is neither, or cannot be read.
///
/// # Errors
/// All findings of one pass, each with its place.
pub fn check_part(path: &Utf8Path, catalog: &dyn Catalog) -> Option<Result<Part, Diagnostics>> {
    let mut problems = Problems::default();
    let (source, root) = open(path, &mut problems)?;
    let has = |key: &str| root.entry(key).is_some();
    let (part, what) = match (
        has("plyflow"),
        has("plyflow_scene"),
        has("plyflow_material"),
    ) {
        (false, true, _) => (Part::Scene, "scene"),
        (false, false, true) => (Part::Material, "material"),
        _ => return None,
    };
    let plugins = Plugins::new(catalog);
    let mut resolver = Resolver::new(&plugins, &mut problems);
    let place = Place {
        source: &source,
        pointer: format!("/{what}"),
        what: what.into(),
        key: root.span.clone(),
    };
    match part {
        Part::Scene => crate::scene::scene_value(&mut resolver, &root, &place, false),
        Part::Material => crate::scene::checked_material(&mut resolver, &root, &place),
    };
    Some(match problems.count() {
        0 => Ok(part),
        _ => Err(problems.finish()),
    })
}

/// As [`load_with`], with all that the result rests on, so that it can be kept and used again.
///
/// # Errors
/// As [`load_with`].
pub fn resolve(
    path: &Utf8Path,
    catalog: &dyn Catalog,
    overrides: &[Override],
) -> Result<Resolution, Diagnostics> {
    resolve_with_points(path, catalog, overrides, &|_, _, _| None)
}

/// As [`resolve`]; `points` gives those that an optimisation is looked at with: its first ones where it gives none.
///
/// # Errors
/// As [`resolve`].
pub fn resolve_with_points(
    path: &Utf8Path,
    catalog: &dyn Catalog,
    overrides: &[Override],
    points: &PointsOf<'_>,
) -> Result<Resolution, Diagnostics> {
    let wanted = Wanted {
        overrides,
        confirm: &[],
        points,
    };
    resolve_wanted(path, catalog, &wanted)
}

/// What is asked for besides what the file says.
#[derive(Clone, Copy)]
pub struct Wanted<'a> {
    /// Parameters from the command line in place of the file's.
    pub overrides: &'a [Override],
    /// Variants of the fine runs of zones that are run too; none: it is not asked to confirm anything.
    pub confirm: &'a [Variation],
    /// The points of an optimisation, as in [`resolve_with_points`].
    pub points: &'a PointsOf<'a>,
}

/// As [`resolve`], with all that may be asked for.
///
/// # Errors
/// As [`resolve`]; and when there is no chain of zones that could be confirmed.
pub fn resolve_wanted(
    path: &Utf8Path,
    catalog: &dyn Catalog,
    wanted: &Wanted<'_>,
) -> Result<Resolution, Diagnostics> {
    let mut problems = Problems::default();
    let plugins = Plugins::new(catalog);
    match load_into(path, &plugins, wanted, &mut problems) {
        Some((workflow, folders)) if problems.count() == 0 => Ok(Resolution {
            workflow,
            evidence: Evidence::new(&problems, folders, &plugins),
        }),
        _ => Err(problems.finish()),
    }
}

/// The workflow, and the folders that its `plugins:` names.
fn load_into(
    path: &Utf8Path,
    catalog: &Plugins<'_>,
    wanted: &Wanted<'_>,
    problems: &mut Problems,
) -> Option<(ResolvedWorkflow, Vec<Utf8PathBuf>)> {
    let (mut source, mut root) = open(path, problems)?;
    let form = "a workflow file, with `plyflow: 1`, `name` and `steps`";
    if other_format(&root, "plyflow", form, &source, problems) {
        return None;
    }
    let lost = overrides::apply(&mut root, wanted.overrides, &mut source, problems, catalog);
    let confirming = confirm::wanted(&mut root, wanted.confirm, &source, catalog, problems)?;
    let family = family(&root, wanted.points, &lost, &source, problems)?;
    let shown = family.as_ref().map(|f| f.first(&root));
    Checker::new(&WORKFLOW, &source, problems)
        .check(shown.as_ref().unwrap_or(&root), "the workflow");
    plugin_folders(&root, &source, problems);
    let drafts = drafts(&root, &source, catalog, problems);
    let wiring = wires::connect(&drafts, &source, problems);
    let asked = family
        .as_ref()
        .map(|f| Asked::read(f, &root, (&drafts, &wiring), &source, problems));
    if asked.is_none() {
        no_responses(&root, &source, problems);
    }
    let expectations = expect::expectations(&root, &drafts, asked.as_ref(), &source, problems);
    let mut resolve = |draft: &Draft<'_>, problems: &mut Problems| {
        step(draft, &wiring, &source, catalog, problems)
    };
    let (steps, mut study) = match &family {
        Some(family) => family.steps(&drafts, &wiring, &source, problems, &mut resolve)?,
        None => (one_each(&drafts, &wiring, problems, &mut resolve)?, None),
    };
    let expectations = match (&mut study, asked) {
        (Some(study), Some(asked)) => {
            study.optimisation = asked.optimisation(&root, &source, problems);
            study.responses = asked.responses;
            study.expectations = expectations.of_responses;
            crate::study::at_all_points(expectations.of_results, study, &steps)
        }
        _ => expectations.of_results,
    };
    let limits = limits::limits(&root, &steps, &source, problems);
    let workflow = ResolvedWorkflow {
        name: root.get("name")?.text()?.to_owned(),
        file: absolute(&source.folder, path.file_name()?),
        description: root
            .get("description")
            .and_then(Node::text)
            .map(str::to_owned),
        steps,
        expectations,
        limits,
        on_failure: on_failure(&root),
        study,
        confirming,
    };
    Some((workflow, named_folders(&root, &source)))
}

/// The study or the optimisation, where the workflow is one; the outer `None` when it is wrong (and reported).
fn family(
    root: &Node,
    points: &PointsOf<'_>,
    lost: &[Lost],
    source: &Source,
    problems: &mut Problems,
) -> Option<Option<Family>> {
    let family = match (root.get("study"), root.entry("optimise")) {
        (Some(_), Some(e)) if e.value.kind != Kind::Null => {
            let message = "`study` and `optimise` in one workflow";
            let d = problems.add(source, &e.key_span, message);
            d.expected("one of them");
            return None;
        }
        (Some(study), _) => Some(Family::read(study, root, source, problems)?),
        (None, Some(e)) => Some(Family::read_optimise(
            &e.value, root, points, source, problems,
        )?),
        (None, None) => None,
    };
    let names = family.as_ref().map_or(&[][..], |f| &f.names);
    without_variables(lost, names, source, problems);
    Some(family)
}

/// Reports responses of a workflow that has no points to take them from.
fn no_responses(root: &Node, source: &Source, problems: &mut Problems) {
    let entry = root.entry("responses");
    if let Some(e) = entry.filter(|e| e.value.kind != Kind::Null) {
        let message = "`responses` in a workflow without a study";
        let d = problems.add(source, &e.key_span, message);
        d.expected("a block `study` or `optimise`, or no `responses`");
    }
}

/// What happens to the other steps when one fails: as the study says, else as the workflow does.
fn on_failure(root: &Node) -> FailurePolicy {
    let of_study = root.get("study").and_then(|s| s.get("on_failure"));
    let written = of_study.or(root.get("on_failure")).and_then(Node::text);
    match written {
        Some("fail-fast") => FailurePolicy::FailFast,
        _ => FailurePolicy::KeepGoing,
    }
}

/// The steps of a workflow that is no study, in topological order.
fn one_each(
    drafts: &[Draft<'_>],
    wiring: &Wiring,
    problems: &mut Problems,
    resolve: &mut dyn FnMut(&Draft<'_>, &mut Problems) -> Option<ResolvedStep>,
) -> Option<Vec<ResolvedStep>> {
    let mut steps: Vec<Option<ResolvedStep>> = drafts
        .iter()
        .map(|draft| resolve(draft, problems))
        .collect();
    if problems.count() > 0 {
        return None;
    }
    (wiring.order.iter())
        .map(|&i| steps[i].take())
        .collect::<Option<Vec<_>>>()
}

/// Reads and parses the workflow file.
fn open(path: &Utf8Path, problems: &mut Problems) -> Option<(Source, Node)> {
    let full = match camino::absolute_utf8(path) {
        Ok(full) => absolute(&full, "."),
        Err(e) => {
            problems.add_unreadable(path, format!("cannot read the workflow: {e}"));
            return None;
        }
    };
    let full = open::in_other_form(full.as_std_path())
        .and_then(|found| Utf8PathBuf::from_path_buf(found).ok())
        .unwrap_or(full);
    match open::read(full.as_std_path(), MOST_WRITTEN) {
        Ok(bytes) => crate::scene::parse(problems, full, bytes),
        Err(why) => {
            let d = problems.add_unreadable(path, format!("cannot read the workflow: {why}"));
            d.help(
                "give the path of a workflow file, such as `workflows/joggle-spar/workflow.yaml`",
            );
            None
        }
    }
}

/// The folders that `plugins:` of a workflow file adds to the search path, absolute; none when the file
/// cannot be read (which [`load`] then reports).
pub fn plugin_search_folders(path: &Utf8Path) -> Vec<Utf8PathBuf> {
    let Some((source, root)) = open(path, &mut Problems::default()) else {
        return Vec::new();
    };
    named_folders(&root, &source)
}

/// The name of the workflow of a file; none when the file cannot be read (which [`load`] then reports).
pub fn name_of(path: &Utf8Path) -> Option<String> {
    let (_, root) = open(path, &mut Problems::default())?;
    root.get("name")?.text().map(str::to_owned)
}

fn named_folders(root: &Node, source: &Source) -> Vec<Utf8PathBuf> {
    let folders = root.get("plugins").map_or(&[][..], Node::items);
    folders
        .iter()
        .filter_map(Node::text)
        .map(|t| absolute(&source.folder, t))
        .collect()
}

fn plugin_folders(root: &Node, source: &Source, problems: &mut Problems) {
    for folder in root.get("plugins").map_or(&[][..], Node::items) {
        let Some(text) = folder.text() else { continue };
        let path = absolute(&source.folder, text);
        if !path.is_dir() {
            let d = problems.add(source, &folder.span, format!("there is no folder `{text}`"));
            d.given(text).expected(format!(
                "a folder; the path is relative to {}",
                source.folder
            ));
        }
    }
}

fn drafts<'n>(
    root: &'n Node,
    source: &Source,
    catalog: &Plugins<'_>,
    problems: &mut Problems,
) -> Vec<Draft<'n>> {
    let Some(steps) = root.entry("steps") else {
        return Vec::new();
    };
    if matches!(&steps.value.kind, crate::yaml::Kind::Map(e) if e.is_empty()) {
        let d = problems.add(source, &steps.key_span, "the workflow has no steps");
        d.expected("at least one step");
    }
    let mut drafts: Vec<Draft<'n>> = Vec::new();
    let mut seen = HashSet::new();
    for entry in steps.value.entries() {
        // A repeated step has been reported as a repeated key.
        if !seen.insert(entry.key.as_str()) {
            continue;
        }
        if !is_word(&entry.key) {
            let message = format!("`{}` cannot name a step", entry.key);
            let d = problems.add(source, &entry.key_span, message);
            d.given(entry.key.clone()).expected(WORD);
        }
        let plugin = entry.value.get("plugin").and_then(|node| {
            let name = Mention::new(source, &node.span, node.text()?);
            problems.of_step(Some(&entry.key));
            let found = find(catalog, problems, &name, PluginKind::Step);
            problems.of_step(None);
            found
        });
        drafts.push(Draft {
            entry,
            index: drafts.len(),
            plugin,
        });
    }
    drafts
}

fn step(
    draft: &Draft<'_>,
    wiring: &Wiring,
    source: &Source,
    catalog: &Plugins<'_>,
    problems: &mut Problems,
) -> Option<ResolvedStep> {
    let plugin = draft.plugin.as_ref()?;
    let manifest = &plugin.manifest;
    let node = &draft.entry.value;
    let with = node.entry("with");
    let place = Place {
        source,
        pointer: String::new(),
        what: "with".into(),
        key: with.map_or(&draft.entry.key_span, |e| &e.key_span).clone(),
    };
    problems.of_step(Some(draft.name()));
    let mut resolver = Resolver::new(catalog, problems);
    let owner = format!("`{}`", manifest.name);
    // The schema check has spoken about a `with` that is no mapping.
    let block = with
        .map(|e| &e.value)
        .filter(|n| matches!(n.kind, crate::yaml::Kind::Map(_)));
    let parameters = canonical(resolver.mapping(block, &manifest.parameters, &owner, &place));
    let components = resolver.components_in_order();
    let asked = std::mem::take(&mut resolver.asked);
    unwired(
        draft,
        &wiring.inputs[draft.index],
        &asked,
        resolver.problems,
    );
    resolver.problems.of_step(None);
    let output = manifest.output.as_ref()?;
    Some(ResolvedStep {
        name: draft.name().to_owned(),
        base: None,
        role: manifest.role.clone(),
        plugin: plugin.id.clone(),
        components,
        parameters: parameters.into(),
        files: resolver.files,
        inputs: wiring.inputs[draft.index].clone(),
        dimensions: wiring.dimensions[draft.index].clone(),
        output_kind: output.kind.clone(),
        collection: output.collection,
        resources: resources(node.get("resources")),
        retries: node.get("retries").and_then(whole).unwrap_or(0),
    })
}

/// Reports what a scene asks other steps for, where none is wired to the input at which it would arrive. A step without such an input has no use
/// for it, or tells so itself.
fn unwired(
    draft: &Draft<'_>,
    wired: &[ResolvedInput],
    asked: &[(Source, Span, AskedFor)],
    problems: &mut Problems,
) {
    let inputs = draft.plugin.iter().flat_map(|p| &p.manifest.inputs);
    let mut takers = inputs.filter(|(_, port)| port.kind == Geometry::KIND);
    let Some((name, port)) = takers.next() else {
        return;
    };
    if wired.iter().any(|w| w.port == *name) {
        return;
    }
    for (source, span, asked) in asked {
        let message = format!(
            "{asked} is to come from another step, and step `{}` does not wire its input `{name}`",
            draft.name()
        );
        let d = problems.add(source, span, message);
        d.expected(format!(
            "`from: {{{name}: <step that gives `{}`>}}` in step `{}`",
            port.kind,
            draft.name()
        ));
        d.help(format!("{name}: {}", port.doc));
    }
}

fn whole(node: &Node) -> Option<u32> {
    node.to_json().as_u64().and_then(|n| u32::try_from(n).ok())
}

/// The budget; wrong values have been reported by the schema check.
fn resources(node: Option<&Node>) -> Resources {
    let get = |name: &str| node.and_then(|n| n.get(name));
    let memory = get("memory")
        .and_then(Node::text)
        .and_then(|t| t.parse::<plyflow_model::workflow::Memory>().ok());
    let time_limit = get("time_limit")
        .and_then(Node::text)
        .and_then(|t| parse_quantity(t, Dimension::Time).ok());
    Resources {
        // 0: not stated, the engine deals out what is free.
        cores: get("cores").and_then(whole).unwrap_or(0),
        // 0: not stated.
        memory: memory.map_or(0, |m| m.0),
        time_limit: time_limit.unwrap_or(0.0),
    }
}
