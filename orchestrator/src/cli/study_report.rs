//! The page of a study, and those of its points.

use super::args::ReportArgs;
use super::found::answer::Status;
use super::found::points::Table;
use super::study_file;
use super::typed::quoted;
use crate::engine::Session;
use crate::engine::core::{Id, State};
use crate::exit;
use crate::said::{Done, Stop, print};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_model::job::Record;
use plyflow_report::{
    Family, Fate, Judged, Origin, Point, ReportInput, Response, Sampled, Value, Variable,
    write_report,
};
use plyflow_workflow::resolved::{ResponseFrom, Study, StudyResponse, StudyValue};

/// Names of files keep this many characters of a point's name.
const LONGEST: usize = 120;

/// Where the page of a point lies: `report-points/angle=45deg.html` beside `report.html`.
pub fn beside(page: &Utf8Path, point: &str) -> Utf8PathBuf {
    let stem = page.file_stem().unwrap_or("report");
    let plain = |c: char| c.is_ascii_alphanumeric() || "=,.+-_".contains(c);
    let kept: String = (point.chars().take(LONGEST))
        .map(|c| if plain(c) { c } else { '_' })
        .collect();
    let name = match kept == point {
        true => kept,
        // Two names may look the same now.
        false => format!("{kept}-{}", &blake3::hash(point.as_bytes()).to_hex()[..10]),
    };
    page.with_file_name(format!("{stem}-points"))
        .join(format!("{name}.html"))
}

/// The address of a point's page from the study's, if it has been written.
fn address(page: &Utf8Path, point: &str) -> Option<String> {
    let path = beside(page, point);
    let folder = path.parent()?.file_name()?.to_owned();
    let name = path.file_name()?;
    path.is_file().then(|| format!("{folder}/{name}"))
}

/// Points whose pages have been written, for the name of a page's content.
pub fn written(session: &Session<'_>, page: &Utf8Path) -> Vec<String> {
    let points = session.workflow.study.iter().flat_map(|s| &s.points);
    points.filter_map(|p| address(page, &p.name)).collect()
}

fn value(v: &StudyValue) -> Value {
    match v {
        StudyValue::Number { shown, .. } => Value::Number(*shown),
        StudyValue::Text(t) => Value::Text(t.clone()),
        StudyValue::Bool(b) => Value::Flag(*b),
    }
}

/// What the page at `page` shows of a study; `None`: the workflow is none, or not all of it was asked for. `records`: those of the page's
/// instances, in their order.
pub fn family(
    session: &Session<'_>,
    records: &[(Id, Record)],
    workflow: &Utf8Path,
    page: &Utf8Path,
) -> Option<Family> {
    let study = session.workflow.study.as_ref()?;
    let graph = session.core.graph();
    if graph.steps.iter().any(|s| !s.wanted) {
        return None;
    }
    let mut by_step: Vec<Vec<usize>> = vec![Vec::new(); graph.steps.len()];
    for (at, (id, _)) in records.iter().enumerate() {
        by_step[session.core.instances()[*id].step].push(at);
    }
    let table = Table::read(session, records);
    let points = study
        .points
        .iter()
        .zip(&table.lines)
        .map(|(p, line)| Point {
            name: p.name.clone(),
            word: quoted(&p.name),
            values: p.values.iter().map(value).collect(),
            responses: line.responses.clone(),
            fate: fate(&line.status),
            instances: p.steps.iter().flat_map(|s| by_step[*s].clone()).collect(),
            report: address(page, &p.name),
        });
    let is_shared = |at: &usize| {
        let step = session.core.instances()[records[*at].0].step;
        graph.steps[step].name == graph.steps[step].base
    };
    Some(Family {
        variables: (study.variables.iter())
            .map(|v| Variable {
                name: v.name.clone(),
                unit: v.unit.clone(),
            })
            .collect(),
        responses: study.responses.iter().map(|r| response(study, r)).collect(),
        points: points.collect(),
        samples: (study.samples.iter())
            .map(|(method, count, seed)| Sampled {
                method: method.clone(),
                count: *count,
                seed: *seed,
            })
            .collect(),
        table: study_file::beside(workflow)
            .0
            .file_name()
            .unwrap_or_default()
            .to_owned(),
        shared: (0..records.len()).filter(is_shared).collect(),
    })
}

fn response(study: &Study, r: &StudyResponse) -> Response {
    Response {
        name: r.name.clone(),
        unit: r.unit.clone(),
        from: match &r.from {
            ResponseFrom::Step { step, result, .. } => Origin::Step {
                step: study.steps[*step].clone(),
                result: result.clone(),
            },
            ResponseFrom::Variables { expression, .. } => Origin::Variables(expression.clone()),
        },
    }
}

fn fate(status: &Status) -> Fate {
    match status {
        Status::Done => Fate::Done,
        Status::NotRun => Fate::NotRun,
        Status::Failed { step, class, cause } => Fate::Failed {
            step: step.clone(),
            class: class.to_string(),
            cause: cause.clone(),
        },
    }
}

/// `plyflow report --point`: writes the pages of points. `whole`: the report of the study; `page`: where it lies.
///
/// # Errors
/// When the workflow is no study, a point is not there or has nothing to show, or a file cannot be written.
pub fn points(
    args: &ReportArgs,
    session: &Session<'_>,
    whole: &ReportInput,
    page: &Utf8Path,
) -> Done {
    let Some(study) = &session.workflow.study else {
        let text = "--point: this workflow is no study: it has no block `study`";
        return Err(Stop::new(exit::USAGE, text));
    };
    if args.output.is_some() && args.point.len() > 1 {
        let text = "--output names one file, and several points are asked for; without it each has a file of its own";
        return Err(Stop::new(exit::USAGE, text));
    }
    let mut told = String::new();
    for name in &args.point {
        let Some(at) = study.points.iter().position(|p| p.name == *name) else {
            return Err(Stop::new(exit::USAGE, unknown(name, study)));
        };
        let input = of_point(session, whole, at);
        if input.instances.is_empty() {
            let text = format!("nothing of the point {name} has been run; `plyflow run` does");
            return Err(Stop::new(exit::USAGE, text));
        }
        let path = args.output.clone().unwrap_or_else(|| beside(page, name));
        let bytes = write_report(&input, &path).map_err(|e| Stop::new(exit::INTERNAL, e))?;
        told += &format!("{path}: {}\n", super::table::bytes(bytes));
    }
    print(&told)
}

fn unknown(name: &str, study: &Study) -> String {
    let some: Vec<&str> = study
        .points
        .iter()
        .take(3)
        .map(|p| p.name.as_str())
        .collect();
    let more = if study.points.len() > some.len() {
        ", .."
    } else {
        ""
    };
    format!(
        "there is no point '{name}'; points are named by all of their values, in the order of the study: {}{more} (`plyflow results --study --format csv` lists them)",
        some.join(", ")
    )
}

/// How the limits fared at one point.
fn judged_at(whole: &ReportInput, title: &str) -> Vec<Judged> {
    let of_point = |j: &Judged| {
        let rest = j.of.strip_prefix(title)?;
        let of = match rest.strip_prefix(", ") {
            Some(of) => of,
            None if rest.is_empty() => "",
            None => return None,
        };
        let of = of.to_owned();
        Some(Judged { of, ..j.clone() })
    };
    whole.judged.iter().filter_map(of_point).collect()
}

/// The report of one point: as that of a workflow with its values.
fn of_point(session: &Session<'_>, whole: &ReportInput, at: usize) -> ReportInput {
    let core = &session.core;
    let steps: Vec<usize> = (session.workflow.study.iter())
        .flat_map(|s| s.points[at].steps.clone())
        .collect();
    let name = |s: &usize| core.graph().steps[*s].name.as_str();
    let names: Vec<&str> = steps.iter().map(name).collect();
    let is_of = |id: &Id| steps.contains(&core.instances()[*id].step);
    let own: Vec<Id> = (0..core.instances().len()).filter(is_of).collect();
    let labels: Vec<String> = own.iter().map(|id| core.label(*id)).collect();
    let failed = |label: &String| whole.failures.iter().any(|(l, _)| l == label);
    let open = own.iter().zip(&labels).filter(|(id, label)| {
        let state = core.instances()[**id].state;
        !matches!(state, State::Done { .. } | State::Failed) && !failed(label)
    });
    let point = whole.family.as_ref().map(|f| &f.points[at]);
    let instances = point.map_or(&[][..], |p| &p.instances);
    let title = point.map_or("", |p| p.name.as_str());
    let about = format!("The point {title} of the study {}.", whole.workflow);
    ReportInput {
        workflow: format!("{}: {title}", whole.workflow),
        description: Some(match &whole.description {
            Some(text) => format!("{about} {text}"),
            None => about,
        }),
        fingerprint: format!("{} {title}", whole.fingerprint),
        instances: instances
            .iter()
            .map(|i| whole.instances[*i].clone())
            .collect(),
        expectations: (whole.expectations.iter())
            .filter(|e| names.contains(&e.step.as_str()))
            .cloned()
            .collect(),
        failures: (whole.failures.iter())
            .filter(|(label, _)| labels.contains(label))
            .cloned()
            .collect(),
        not_run: open.count(),
        judged: judged_at(whole, title),
        family: None,
        ..whole.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_of_points_lie_in_a_folder_under_names_that_every_system_takes() {
        let at = |page: &str, point: &str| beside(Utf8Path::new(page), point).to_string();
        assert_eq!(
            at("a/report-coarse.html", "angle=45deg,mu=0.1"),
            "a/report-coarse-points/angle=45deg,mu=0.1.html"
        );
        // Signs that part folders, and names that differ in them alone.
        let (one, other) = (at("report.html", "f=a/b"), at("report.html", "f=a\\b"));
        assert!(
            one.starts_with("report-points/f=a_b-") && one != other,
            "{one} {other}"
        );
        assert!(at("report.html", &"x".repeat(5000)).len() < 200);
    }
}
