//! `report`, and the report and summary at the end of a run.

use super::args::{ReportArgs, Workflow};
use super::found::change::nothing_yet;
use super::found::damage::{concluded, recheck, tell_gone};
use super::found::row::{Row, Verdict};
use super::found::rows::Found;
use super::open::{Opened, open};
use super::typed::arguments;
use crate::engine::core::{Id, State};
use crate::engine::{Depth, Failure, Session};
use crate::exit;
use crate::said::{Done, Stop, print};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_model::job::Record;
use plyflow_report::{
    Expectation, Instance, Kept, ReportInput, is_current, judge, write_beside, write_report,
};

/// `plyflow report`.
///
/// # Errors
/// When there is nothing to report or the file cannot be written; [`exit::DAMAGED`] when something is damaged: a page with gaps would pass for
/// the whole.
pub fn report(args: &ReportArgs) -> Done {
    if let Some(other) = &args.beside {
        return two(args, other);
    }
    let opened = open(&args.workflow)?;
    let mut session = opened.look()?;
    let damages = recheck(&mut session, &|_| true, Depth::Artifacts);
    if !damages.is_empty() {
        return concluded(Ok(()), &damages, &args.workflow);
    }
    tell_gone(&session);
    let found = Found::read(&session);
    if found.records.is_empty() {
        let text = nothing_yet(&session, &[], &args.workflow);
        return Err(Stop::new(exit::USAGE, text));
    }
    let path = args
        .output
        .clone()
        .unwrap_or_else(|| beside(&opened.workflow.file, &[]));
    let failures: Vec<Failure> = (0..session.core.instances().len())
        .filter_map(|id| session.failed_before(id))
        .collect();
    let page = if args.point.is_empty() {
        path.clone()
    } else {
        beside(&opened.workflow.file, &[])
    };
    let asked = (&args.workflow, &[][..], page.as_path());
    let input = input(&opened, &session, &found, &failures, asked);
    if !args.point.is_empty() {
        return super::study_report::points(args, &session, &input, &page);
    }
    let bytes = write_report(&input, &path).map_err(|e| Stop::new(exit::INTERNAL, e))?;
    print(&format!("{path}: {}\n", super::table::bytes(bytes)))
}

/// `plyflow report A --beside B`: two runs on one page.
fn two(args: &ReportArgs, other: &Utf8Path) -> Done {
    let first = &args.workflow;
    let second = Workflow {
        workflow: other.to_owned(),
        places: first.places.clone(),
        set: args.beside_set.clone(),
        confirm: None,
    };
    let name = format!("beside-{}", other.file_stem().unwrap_or("workflow"));
    let path = args.output.clone().unwrap_or_else(|| {
        let alone = beside(&first.workflow, &[]);
        let stem = alone.file_stem().unwrap_or("report");
        alone.with_file_name(format!("{stem}-{name}.html"))
    });
    let mut inputs = Vec::new();
    for given in [first, &second] {
        let opened = open(given)?;
        if opened.workflow.study.is_some() {
            let text = format!(
                "{}: it is a study, which has a run for each of its points; expected a workflow without `study`: \
                 give the values of a point by `--set` and `--beside-set` to the workflow without it",
                given.workflow
            );
            return Err(Stop::new(exit::USAGE, text));
        }
        let mut session = opened.look()?;
        let damages = recheck(&mut session, &|_| true, Depth::Artifacts);
        if !damages.is_empty() {
            return concluded(Ok(()), &damages, given);
        }
        tell_gone(&session);
        let found = Found::read(&session);
        if found.records.is_empty() {
            return Err(Stop::new(exit::USAGE, nothing_yet(&session, &[], given)));
        }
        let failures: Vec<Failure> = (0..session.core.instances().len())
            .filter_map(|id| session.failed_before(id))
            .collect();
        let asked = (given, &[][..], path.as_path());
        inputs.push(input(&opened, &session, &found, &failures, asked));
    }
    let both = [&inputs[0], &inputs[1]];
    let bytes = write_beside(both, &path).map_err(|e| Stop::new(exit::INTERNAL, e))?;
    print(&format!("{path}: {}\n", super::table::bytes(bytes)))
}

/// The report of a workflow file: `report.html` for `workflow.yaml`, `report-coarse.html` for
/// `workflow-coarse.yaml`, `flat-report.html` for `flat.yaml`. A run of a part (`until`) has a page of its own,
/// `report-until-zones.html`: it must not take the place of the whole's.
pub fn beside(workflow: &Utf8Path, until: &[String]) -> Utf8PathBuf {
    let stem = workflow.file_stem().unwrap_or("workflow");
    let part = match until {
        [] => String::new(),
        [first] => format!("-until-{first}"),
        [first, further @ ..] => format!("-until-{first}-and-{}-more", further.len()),
    };
    let name = match stem.strip_prefix("workflow") {
        Some(rest) => format!("report{rest}{part}.html"),
        None => format!("{stem}-report{part}.html"),
    };
    workflow.with_file_name(name)
}

/// Changes with what a page shows of the same artifacts: an older page is then written again.
const LAYOUT: &[u8] = b"page 11";

/// Names all that a report depends on. `page`: where it lies.
pub fn fingerprint(
    opened: &Opened,
    session: &Session<'_>,
    failures: &[Failure],
    page: &Utf8Path,
) -> String {
    let mut hasher = blake3::Hasher::new();
    let mut add = |bytes: &[u8]| {
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update(bytes);
    };
    add(env!("CARGO_PKG_VERSION").as_bytes());
    add(LAYOUT);
    add(opened.workflow.name.as_bytes());
    add(opened
        .workflow
        .description
        .as_deref()
        .unwrap_or_default()
        .as_bytes());
    add(&serde_json::to_vec(&opened.workflow.expectations).unwrap_or_default());
    add(&serde_json::to_vec(&opened.workflow.limits).unwrap_or_default());
    for instance in session.core.instances() {
        add(&instance.key.map(|k| k.0).unwrap_or_default());
        add(&[u8::from(matches!(instance.state, State::Done { .. }))]);
    }
    for failure in failures {
        add(failure.label.as_bytes());
        add(failure.reason.as_bytes());
    }
    if let Some(study) = &opened.workflow.study {
        add(&serde_json::to_vec(study).unwrap_or_default());
        let pages = super::study_report::written(session, page);
        pages.iter().for_each(|p| add(p.as_bytes()));
    }
    hasher.finalize().to_hex().to_string()
}

/// Whether the report at `path` already tells this state.
pub fn is_written(path: &Utf8Path, fingerprint: &str) -> bool {
    is_current(path, fingerprint)
}

/// What a page tells of a row that something was expected of.
fn expectation(r: &Row) -> Option<Expectation> {
    let e = r.expected.as_ref()?;
    Some(Expectation {
        step: r.step.clone(),
        item: r.item.clone(),
        result: r.name.clone(),
        unit: r.unit.clone(),
        got: r.value,
        value: e.value,
        tolerance: e.tolerance,
        minimum: e.minimum,
        maximum: e.maximum,
        source: e.source.clone(),
        met: r.verdict() == Some(Verdict::Ok),
    })
}

/// All that a report or a summary is made of. `given`, `until`: the workflow as the user asked for it; `page`: where the report lies.
pub fn input(
    opened: &Opened,
    session: &Session<'_>,
    found: &Found,
    failures: &[Failure],
    (given, until, page): (&Workflow, &[String], &Utf8Path),
) -> ReportInput {
    let core = &session.core;
    let instance = |(id, record): &(Id, Record)| {
        let i = &core.instances()[*id];
        Instance {
            step: core.graph().steps[i.step].name.clone(),
            item: core.item_labels(*id),
            artifact: i
                .key
                .map(|k| session.store.artifact(&k))
                .unwrap_or_default(),
            record: record.clone(),
        }
    };
    let failed = |label: &str| failures.iter().any(|f| f.label == label);
    let did_not_run = |id: &Id| {
        let state = core.instances()[*id].state;
        !matches!(state, State::Done { .. } | State::Failed) && !failed(&core.label(*id))
    };
    let file = &opened.workflow.file;
    let family = super::study_report::family(session, &found.records, file, page);
    let mut input = ReportInput {
        workflow: opened.workflow.name.clone(),
        description: opened.workflow.description.clone(),
        file: given.workflow.clone(),
        given: arguments(given),
        until: until.to_vec(),
        program: format!("plyflow {}", env!("CARGO_PKG_VERSION")),
        fingerprint: fingerprint(opened, session, failures, page),
        instances: found.records.iter().map(instance).collect(),
        expectations: found.rows.iter().filter_map(expectation).collect(),
        failures: failures
            .iter()
            .map(|f| (f.label.clone(), f.reason.clone()))
            .collect(),
        not_run: (0..core.instances().len()).filter(did_not_run).count(),
        family: family.filter(|_| until.is_empty()),
        limits: opened.workflow.limits.clone(),
        judged: Vec::new(),
    };
    input.judged = judge(&input);
    // What `--until` leaves out is not judged either, as it is not expected.
    if !until.is_empty() {
        input.judged.retain(|j| j.verdict != Kept::NotJudged);
    }
    input
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn workflows_of_one_folder_have_reports_of_their_own() {
        let name = |w: &str| beside(Utf8Path::new(w), &[]).to_string();
        assert_eq!(name("a/workflow.yaml"), "a/report.html");
        assert_eq!(name("a/workflow-coarse.yaml"), "a/report-coarse.html");
        assert_eq!(name("a/flat.yaml"), "a/flat-report.html");
        let part = |w: &str, until: &[&str]| {
            let until: Vec<String> = until.iter().map(|s| (*s).to_owned()).collect();
            beside(Utf8Path::new(w), &until).to_string()
        };
        assert_eq!(part("workflow.yaml", &["zones"]), "report-until-zones.html");
        assert_eq!(
            part("flat.yaml", &["a", "b"]),
            "flat-report-until-a-and-1-more.html"
        );
    }
}
