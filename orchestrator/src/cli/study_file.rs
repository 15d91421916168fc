//! The table of a study as files beside the workflow: an artifact (HDF5) and the same as CSV.
//!
//! What is in them depends on the workflow, on the plugins and on what came out, not on the order in which it did.

use super::study::{Line, Status, Table, as_csv};
use crate::engine::Session;
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_artifact::{ArtifactError, ArtifactWriter, DType};
use plyflow_workflow::resolved::{StudyPoint, StudyValue};
use serde_json::json;
use std::io;

/// Kind of the artifact.
pub const KIND: &str = "study-table";

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
        let name = path.file_name().unwrap_or("study");
        path.with_file_name(format!(".{name}.{}", std::process::id()))
    };
    let (text, file) = (temporary(csv), temporary(artifact));
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
    let mut writer = ArtifactWriter::create(path.as_std_path(), KIND)?;
    writer.attributes(&attributes(table, session).to_string())?;
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

fn attributes(table: &Table<'_>, session: &Session<'_>) -> serde_json::Value {
    let study = table.study;
    let column = |i: usize| -> Vec<serde_json::Value> {
        let text = |p: &StudyPoint| match &p.values[i] {
            StudyValue::Text(t) => json!(t),
            StudyValue::Bool(b) => json!(b),
            StudyValue::Number { shown, .. } => json!(shown),
        };
        study.points.iter().map(text).collect()
    };
    let variables = study.variables.iter().enumerate().map(
        |(i, v)| json!({"name": v.name, "unit": v.unit, "si_unit": v.si_unit, "values": column(i)}),
    );
    let responses = study.responses.iter().map(|r| r.origin(&study.steps));
    let failures = table
        .lines
        .iter()
        .enumerate()
        .filter_map(|(i, line)| match &line.status {
            Status::Failed { step, class, cause } => {
                Some(json!({"point": i, "step": step, "class": class, "cause": cause}))
            }
            _ => None,
        });
    let keys = table.steps.iter().enumerate().map(|(i, step)| {
        let keys: Vec<&str> = table.lines.iter().map(|l| l.keys[i].as_str()).collect();
        json!({"step": study.steps[*step], "keys": keys})
    });
    let samples = study
        .samples
        .iter()
        .map(|s| json!({"method": s.0, "count": s.1, "seed": s.2}));
    json!({
        "workflow": session.workflow.name,
        "points": study.points.iter().map(|p| p.name.as_str()).collect::<Vec<_>>(),
        "variables": variables.collect::<Vec<_>>(),
        "responses": responses.collect::<Vec<_>>(),
        "status": ["done", "failed", "not run"],
        "failures": failures.collect::<Vec<_>>(),
        "keys": keys.collect::<Vec<_>>(),
        "samples": samples.collect::<Vec<_>>(),
        "optimisation": table.trace.as_ref().map(|t| t.as_json(table)),
    })
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
