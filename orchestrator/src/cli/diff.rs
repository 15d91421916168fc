//! `diff`: in which numbers two runs, or two artifacts, differ.

use super::args::{DiffArgs, Places, TextOrJson, Workflow};
use super::open::open;
use super::table::number;
use crate::exit;
use crate::plan::Key;
use crate::said::{Done, Stop, print, warn};
use crate::store::{Flaw, Journal, Store, check_artifact, record_beside};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_artifact::{Artifact, Difference, How, differences};
use plyflow_model::text::one_line;
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// So many differences of a step are shown unless all are asked for: thousands of attributes tell no more than twenty.
const SHOWN: usize = 20;

/// `plyflow diff`.
///
/// # Errors
/// [`exit::DIFFERENT`] when the two are not the same; [`exit::USAGE`] when there is nothing to compare; [`exit::DAMAGED`] when one of them is not what was
/// written.
pub fn diff(args: &DiffArgs) -> Done {
    let pairs = match [&args.a, &args.b].map(|p| is_artifact(p)) {
        [true, true] => {
            if !args.steps.is_empty() || args.store_a.is_some() || args.store_b.is_some() {
                let text =
                    "--step, --store-a and --store-b are for workflows; these are two artifacts";
                return Err(Stop::new(exit::USAGE, text));
            }
            vec![Pair {
                label: None,
                paths: [&args.a, &args.b].map(|p| Some(p.clone())),
            }]
        }
        [false, false] => pairs(args)?,
        _ => {
            let text = format!(
                "{} and {}: one is an artifact and the other a workflow; give two of a kind",
                args.a, args.b
            );
            return Err(Stop::new(exit::USAGE, text));
        }
    };
    let compared: Vec<Compared> = pairs.iter().map(compare).collect::<Result<_, _>>()?;
    if args.format == TextOrJson::Json {
        let steps: Vec<Value> = compared.iter().map(Compared::json).collect();
        print(&format!("{:#}\n", json!({"compared": steps})))?;
    } else {
        print(&text(&compared, args.all))?;
    }
    let is_alike = |c: &Compared| c.outcome.is_same() || matches!(c.outcome, Outcome::Neither);
    match compared.iter().all(is_alike) {
        true => Ok(()),
        false => Err(Stop::silent(exit::DIFFERENT)),
    }
}

fn is_artifact(path: &Utf8Path) -> bool {
    path.extension() == Some("vtkhdf")
}

/// Two artifacts of a name, or one without its other.
struct Pair {
    /// `None`: two files that were named.
    label: Option<String>,
    paths: [Option<Utf8PathBuf>; 2],
}

/// The artifacts of the last runs of two workflows, in the order of the first, those that only the second has behind it.
fn pairs(args: &DiffArgs) -> Result<Vec<Pair>, Stop> {
    let places = |store: &Option<Utf8PathBuf>| Places {
        store: store.clone(),
        plugins: args.plugins.clone(),
        trust: args.trust.clone(),
    };
    let (first, of_first) = last_run(&args.a, places(&args.store_a), &args.steps)?;
    let (second, of_second) = last_run(&args.b, places(&args.store_b), &args.steps)?;
    let real = |path: &Utf8Path| path.canonicalize_utf8().unwrap_or_else(|_| path.to_owned());
    if real(&of_first) == real(&of_second) {
        let text = format!(
            "{} and {} have one name and one store, which knows the last run of a name alone ({of_first}): there are no two runs to compare. Run one of them into \
             another store and give that with --store-b, or give one another `name`",
            args.a, args.b
        );
        return Err(Stop::new(exit::USAGE, text));
    }
    let find = |all: &[Made], label: &str| {
        let found = all.iter().find(|(l, _)| l == label);
        found.map(|(_, path)| path.clone())
    };
    let mut pairs: Vec<Pair> = Vec::new();
    for (label, path) in &first {
        pairs.push(Pair {
            label: Some(label.clone()),
            paths: [path.clone(), find(&second, label).flatten()],
        });
    }
    for (label, path) in &second {
        if find(&first, label).is_none() {
            pairs.push(Pair {
                label: Some(label.clone()),
                paths: [None, path.clone()],
            });
        }
    }
    Ok(pairs)
}

/// Label of a step or item, and its artifact; `None`: it has not run to its end.
type Made = (String, Option<Utf8PathBuf>);

/// The items that there can be: the longest collection, and all items that were recorded. A journal knows names and items by their hashes
/// alone, so it is asked for all of these.
fn items_of(store: &Store, keys: &[Key]) -> (u64, BTreeSet<Vec<u64>>) {
    let records = keys.iter().filter_map(|key| store.read_record(key).ok());
    let (mut longest, mut recorded) = (0, BTreeSet::new());
    for record in records {
        longest = longest.max(record.collection.map_or(0, |labels| labels.len() as u64));
        recorded.insert(record.item);
    }
    (longest, recorded)
}

/// What a workflow ran last, whatever program and plugins it was, and the journal that says so.
fn last_run(
    file: &Utf8Path,
    places: Places,
    only: &[String],
) -> Result<(Vec<Made>, Utf8PathBuf), Stop> {
    let opened = open(&Workflow {
        workflow: file.to_owned(),
        places,
        set: Vec::new(),
        confirm: None,
    })?;
    let wanted = match only {
        [] => (0..opened.workflow.steps.len()).collect(),
        names => opened.step_indices(names)?,
    };
    let store = &opened.store;
    let nothing = || {
        let text = format!(
            "{file} has not run into the store {root}; start with: plyflow run {file} --store {root}",
            root = store.root()
        );
        Stop::new(exit::USAGE, text)
    };
    let path = store.run(&opened.workflow.name).journal();
    if !path.is_file() {
        return Err(nothing());
    }
    let journal = Journal::read(&path).map_err(Stop::machine(format!("reading {path}")))?;
    let keys = journal.last_keys();
    let (longest, recorded) = items_of(store, &keys);
    let (mut found, mut named) = (Vec::new(), BTreeSet::new());
    for at in wanted {
        let (step, collections) = (
            &opened.workflow.steps[at],
            opened.graph.steps[at].dimensions.len(),
        );
        for item in indices(collections, longest, &recorded) {
            let key = journal.last(&step.name, &item);
            // A step that failed last may have a key, and has no artifact.
            let key = key.filter(|key| store.artifact(key).is_file());
            // There need not be so many items.
            if key.is_some() || collections == 0 {
                let path = key.map(|key| store.artifact(&key));
                found.push((label(&step.name, &item), path));
            }
            named.extend(key);
        }
    }
    let is_left = |key: &&Key| !named.contains(*key) && store.artifact(key).is_file();
    let left = keys.iter().filter(is_left).count();
    if only.is_empty() && left > 0 {
        warn(&format!(
            "plyflow: {file}: {left} artifacts are of steps that this file no longer has; they are not compared\n"
        ));
    }
    match found.iter().all(|(_, path)| path.is_none()) {
        true if only.is_empty() => Err(nothing()),
        _ => Ok((found, path)),
    }
}

/// All indices of items in so many collections with at most so many items each, in order; where these are too many to ask for, those that records tell
/// of (two items that share an artifact share its record).
fn indices(collections: usize, length: u64, recorded: &BTreeSet<Vec<u64>>) -> Vec<Vec<u64>> {
    const MOST: u64 = 100_000;
    let depth = u32::try_from(collections).unwrap_or(u32::MAX);
    if length.checked_pow(depth).is_none_or(|n| n > MOST) {
        let of = recorded.iter().filter(|item| item.len() == collections);
        return of.cloned().collect();
    }
    let mut all = vec![Vec::new()];
    for _ in 0..collections {
        let longer = |item: &Vec<u64>| -> Vec<Vec<u64>> {
            let with = |k| [item.as_slice(), &[k]].concat();
            (0..length).map(with).collect()
        };
        all = all.iter().flat_map(longer).collect();
    }
    all
}

fn label(step: &str, item: &[u64]) -> String {
    if item.is_empty() {
        return step.to_owned();
    }
    let item: Vec<String> = item.iter().map(u64::to_string).collect();
    format!("{step}[{}]", item.join(","))
}

/// One of the two that are compared.
#[derive(Clone, Copy)]
enum Side {
    First,
    Second,
}

impl Side {
    fn text(self) -> &'static str {
        match self {
            Self::First => "only in the first",
            Self::Second => "only in the second",
        }
    }
}

/// What came of comparing two artifacts.
enum Outcome {
    /// The files are the same byte by byte.
    SameBytes,
    /// All numbers are; something else made them.
    Same,
    /// Not the same.
    Differs(Vec<Difference>),
    /// One alone is there.
    OnlyIn(Side),
    /// None is: the step failed, or has not run.
    Neither,
}

impl Outcome {
    fn is_same(&self) -> bool {
        matches!(self, Self::SameBytes | Self::Same)
    }
}

struct Compared {
    label: Option<String>,
    outcome: Outcome,
}

fn compare(pair: &Pair) -> Result<Compared, Stop> {
    let outcome = match &pair.paths {
        [Some(a), Some(b)] => outcome(a, b)?,
        [Some(_), None] => Outcome::OnlyIn(Side::First),
        [None, Some(_)] => Outcome::OnlyIn(Side::Second),
        [None, None] => Outcome::Neither,
    };
    let label = pair.label.clone();
    Ok(Compared { label, outcome })
}

fn outcome(a: &Utf8Path, b: &Utf8Path) -> Result<Outcome, Stop> {
    let hashes = [hash(a)?, hash(b)?];
    if let [Some(first), Some(second)] = &hashes
        && first == second
    {
        return Ok(Outcome::SameBytes);
    }
    let open =
        |path: &Utf8Path| Artifact::open(path.as_std_path()).map_err(|e| Stop::new(exit::USAGE, e));
    let found =
        differences(&open(a)?, &open(b)?).map_err(Stop::machine(format!("reading {a} and {b}")))?;
    Ok(match found.is_empty() {
        true => Outcome::Same,
        false => Outcome::Differs(found),
    })
}

/// BLAKE3 of an artifact, by the record beside it, which it is held against; `None` without a record.
fn hash(path: &Utf8Path) -> Result<Option<String>, Stop> {
    let record = record_beside(path).and_then(|record| {
        if let Some(record) = &record {
            check_artifact(path, record)?;
        }
        Ok(record)
    });
    match record {
        Ok(record) => Ok(record.map(|r| r.hash).filter(|h| !h.is_empty())),
        Err(Flaw::Unsealed) => Ok(None),
        Err(flaw) => {
            let text = format!("{}; nothing was compared with it", flaw.text());
            Err(Stop::new(exit::DAMAGED, text))
        }
    }
}

impl Compared {
    fn json(&self) -> Value {
        let (status, list) = match &self.outcome {
            Outcome::SameBytes => ("same-bytes", &[][..]),
            Outcome::Same => ("same", &[][..]),
            Outcome::Differs(list) => ("differs", &list[..]),
            Outcome::OnlyIn(Side::First) => ("only-in-first", &[][..]),
            Outcome::OnlyIn(Side::Second) => ("only-in-second", &[][..]),
            Outcome::Neither => ("in-neither", &[][..]),
        };
        json!({"step": self.label, "status": status, "differences": list})
    }
}

fn text(compared: &[Compared], all: bool) -> String {
    let mut out = String::new();
    for one in compared {
        let head = match &one.label {
            Some(label) => format!("{label}: "),
            None => String::new(),
        };
        out += &match &one.outcome {
            Outcome::SameBytes => format!("{head}the same bytes\n"),
            Outcome::Same => format!("{head}the same numbers, made by something else\n"),
            Outcome::OnlyIn(side) => format!("{head}{}\n", side.text()),
            Outcome::Neither => format!("{head}in neither: it failed there, or has not run\n"),
            Outcome::Differs(list) => {
                let shown = if all { list.len() } else { SHOWN };
                let mut text = format!("{head}differs in {}\n", list.len());
                for d in list.iter().take(shown) {
                    text += &format!("  {}: {}\n", one_line(&d.place), how(&d.how));
                }
                if list.len() > shown {
                    let more = list.len() - shown;
                    text += &format!("  and {more} more; all of them: --all\n");
                }
                text
            }
        };
    }
    if compared.len() > 1 {
        let same = compared.iter().filter(|c| c.outcome.is_same()).count();
        let neither = (compared.iter()).filter(|c| matches!(c.outcome, Outcome::Neither));
        let neither = neither.count();
        out += &format!("{same} of {} are the same", compared.len() - neither);
        if neither > 0 {
            out += &format!("; {neither} are in neither");
        }
        out.push('\n');
    }
    out
}

fn how(how: &How) -> String {
    match how {
        How::OnlyInFirst => Side::First.text().into(),
        How::OnlyInSecond => Side::Second.text().into(),
        How::Other { first, second } => format!("{} | {}", brief(first), brief(second)),
        How::Number {
            first,
            second,
            unit,
        } => format!(
            "{} | {}{}",
            exact(*first, *second, unit),
            exact(*second, *first, unit),
            share(*first, *second)
        ),
        How::Numbers {
            differ,
            of,
            largest,
            at,
            scale,
            unit,
        } => format!(
            "{differ} of {of} numbers, by at most {} at {at:?}; the largest is {}",
            with_unit(*largest, unit),
            with_unit(*scale, unit)
        ),
    }
}

fn with_unit(value: f64, unit: &str) -> String {
    match unit {
        "1" | "" => number(value),
        _ => format!("{} {unit}", number(value)),
    }
}

/// A number with as many digits as tell it from the other.
fn exact(value: f64, other: f64, unit: &str) -> String {
    match number(value) == number(other) && unit != "1" {
        true => format!("{value} {unit}"),
        false if number(value) == number(other) => value.to_string(),
        false => with_unit(value, unit),
    }
}

fn share(first: f64, second: f64) -> String {
    let share = (second - first) / first;
    match share.is_finite() {
        true if share.abs() < 1e-3 => format!(" ({share:+.1e} of the first)"),
        true => format!(" ({:+.1} %)", 100.0 * share),
        false => String::new(),
    }
}

/// A value on a line of its own.
fn brief(value: &Value) -> String {
    const LONGEST: usize = 60;
    let text = value.to_string();
    let text = one_line(&text);
    match text.chars().count() > LONGEST {
        true => text.chars().take(LONGEST).chain("..".chars()).collect(),
        false => text.into_owned(),
    }
}
