//! The table of a study as files beside the workflow: an artifact (HDF5) and the same as CSV.
//!
//! What is in them depends on the workflow, on the plugins and on what came out, not on the order in which it did.

use super::found::answer::{Line, Status};
use super::found::points::Table;
use super::study::as_csv;
use crate::engine::Session;
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_artifact::whole;
use plyflow_artifact::{ArtifactError, ArtifactWriter, DType};
use plyflow_model::artifact::{
    self, Attributes, StudyFailure, StudyKeys, StudySamples, StudyTable, StudyVariable,
};
use plyflow_workflow::resolved::{StudyPoint, StudyValue};
use serde_json::json;
use std::io;

/// The files of a workflow's table: `study.csv` and `study.h5` for `workflow.yaml`, `study-coarse.csv` for `workflow-coarse.yaml`,
/// `flat-study.csv` for `flat.yaml`.
pub fn beside(workflow: &Utf8Path) -> (Utf8PathBuf, Utf8PathBuf) {
    let stem = workflow.file_stem().unwrap_or("workflow");
    let name = match stem.strip_prefix("workflow") {
        Some(rest) => format!("study{rest}"),
        None => format!("{stem}-study"),
    };
    let file = |end: &str| workflow.with_file_name(format!("{name}.{end}"));
    (file("csv"), file("h5"))
}

/// Writes both files where they are not so already, each whole or not at all.
///
/// # Errors
/// When one cannot be written.
pub fn write(
    table: &Table<'_>,
    session: &Session<'_>,
    csv: &Utf8Path,
    artifact: &Utf8Path,
) -> io::Result<()> {
    let temporary = |path: &Utf8Path| {
        Utf8PathBuf::try_from(whole::begun(path.as_std_path())).map_err(|e| e.into_io_error())
    };
    let (text, file) = (temporary(csv)?, temporary(artifact)?);
    let done = std::fs::write(&text, as_csv(table))
        .and_then(|()| make(table, session, &file).map_err(io::Error::other))
        .and_then(|()| replace(&text, csv))
        .and_then(|()| replace(&file, artifact));
    if done.is_err() {
        let _ = (std::fs::remove_file(&text), std::fs::remove_file(&file));
    }
    done
}

/// Puts a file in its place, unless what lies there has the same bytes: whoever watches it is not woken for nothing.
fn replace(new: &Utf8Path, place: &Utf8Path) -> io::Result<()> {
    match std::fs::read(place) {
        Ok(there) if there == std::fs::read(new)? => std::fs::remove_file(new),
        _ => std::fs::rename(new, place),
    }
}

fn doubles(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn wholes(values: &[u32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// The artifact. Numbers of variables and responses are arrays (SI), a response without holes: beside its values stand the rows that
/// have one. Everything that is text is in the attributes.
fn make(table: &Table<'_>, session: &Session<'_>, path: &Utf8Path) -> Result<(), ArtifactError> {
    let study = table.study;
    let mut writer = ArtifactWriter::create(path.as_std_path(), StudyTable::KIND)?;
    // By way of a value, whose keys are sorted: the text hangs on what is told, not on the order of a type's fields.
    writer.attributes(&json!(attributes(table, session)).to_string())?;
    let n = study.points.len() as u64;
    for (i, variable) in study.variables.iter().enumerate() {
        let number = |p: &StudyPoint| match &p.values[i] {
            StudyValue::Number { si, .. } => Some(*si),
            _ => None,
        };
        let values: Option<Vec<f64>> = study.points.iter().map(number).collect();
        // Texts are in the attributes.
        if let Some(values) = values {
            let (name, unit) = (
                format!("variables/{}", variable.name),
                si(&variable.si_unit),
            );
            writer.array(&name, DType::F64, &[n], unit, &doubles(&values))?;
        }
    }
    for (i, response) in study.responses.iter().enumerate() {
        let known = |(row, line): (usize, &Line)| Some((row as u32, line.responses[i]?));
        let known: Vec<(u32, f64)> = table.lines.iter().enumerate().filter_map(known).collect();
        let rows: Vec<u32> = known.iter().map(|k| k.0).collect();
        let values: Vec<f64> = known.iter().map(|k| k.1).collect();
        let n = known.len() as u64;
        let name = |part: &str| format!("responses/{}/{part}", response.name);
        writer.array(&name("point"), DType::U32, &[n], "1", &wholes(&rows))?;
        let unit = si(&response.unit);
        writer.array(&name("value"), DType::F64, &[n], unit, &doubles(&values))?;
    }
    if let Some(trace) = &table.trace {
        for (name, unit, known) in trace.columns(study) {
            let rows: Vec<u32> = known.iter().map(|k| k.0).collect();
            let values: Vec<f64> = known.iter().map(|k| k.1).collect();
            let n = known.len() as u64;
            let name = |part: &str| format!("optimisation/{name}/{part}");
            writer.array(&name("point"), DType::U32, &[n], "1", &wholes(&rows))?;
            writer.array(
                &name("value"),
                DType::F64,
                &[n],
                si(&unit),
                &doubles(&values),
            )?;
        }
    }
    let status = |line: &Line| match line.status {
        Status::Done => 0,
        Status::Failed { .. } => 1,
        Status::NotRun => 2,
    };
    let status: Vec<u32> = table.lines.iter().map(status).collect();
    writer.array("status", DType::U32, &[n], "1", &wholes(&status))?;
    writer.finish(&json!({"workflow": session.workflow.name}))?;
    Ok(())
}

fn si(unit: &str) -> &str {
    if unit.is_empty() { "1" } else { unit }
}

fn attributes(table: &Table<'_>, session: &Session<'_>) -> StudyTable {
    let study = table.study;
    let variables = study.variables.iter().enumerate();
    let variables = variables.map(|(i, v)| StudyVariable {
        name: v.name.clone(),
        unit: v.unit.clone(),
        si_unit: v.si_unit.clone(),
        values: study.points.iter().map(|p| told(&p.values[i])).collect(),
    });
    let failures = table.lines.iter().enumerate();
    let failures = failures.filter_map(|(point, line)| match &line.status {
        Status::Failed { step, class, cause } => Some(StudyFailure {
            point,
            step: step.clone(),
            class: class.to_string(),
            cause: cause.clone(),
        }),
        _ => None,
    });
    let keys = table.steps.iter().enumerate().map(|(i, step)| StudyKeys {
        step: study.steps[*step].clone(),
        keys: table.lines.iter().map(|l| l.keys[i].clone()).collect(),
    });
    let samples = study.samples.iter().map(|s| StudySamples {
        method: s.0.clone(),
        count: s.1,
        seed: s.2,
    });
    StudyTable {
        workflow: session.workflow.name.clone(),
        points: study.points.iter().map(|p| p.name.clone()).collect(),
        variables: variables.collect(),
        responses: study
            .responses
            .iter()
            .map(|r| r.told(&study.steps))
            .collect(),
        status: StudyTable::STATUS.map(str::to_owned).into(),
        failures: failures.collect(),
        keys: keys.collect(),
        samples: samples.collect(),
        optimisation: table.trace.as_ref().and_then(|t| t.told(table.study)),
    }
}

/// A value of a variable in the unit in which it is shown.
fn told(value: &StudyValue) -> artifact::StudyValue {
    match value {
        StudyValue::Text(t) => artifact::StudyValue::Text(t.clone()),
        StudyValue::Bool(b) => artifact::StudyValue::Bool(*b),
        StudyValue::Number { shown, .. } => artifact::StudyValue::Number(*shown),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn workflows_of_one_folder_have_tables_of_their_own() {
        let name = |w: &str| {
            let (csv, artifact) = beside(Utf8Path::new(w));
            (csv.into_string(), artifact.into_string())
        };
        assert_eq!(
            name("a/workflow.yaml"),
            ("a/study.csv".into(), "a/study.h5".into())
        );
        assert_eq!(name("a/workflow-coarse.yaml").0, "a/study-coarse.csv");
        assert_eq!(name("angles.yaml").0, "angles-study.csv");
    }
}
