//! `inspect`: what an artifact holds.

use super::args::{InspectArgs, Places, TextOrJson, Workflow};
use super::explain::instances_named;
use super::found::damage::{damaged, recheck};
use super::open::{Opened, open};
use super::table::{bytes, number, table};
use crate::engine::Depth;
use crate::engine::core::State;
use crate::exit;
use crate::progress::duration_text;
use crate::said::{Done, Stop, print};
use crate::store::{check_artifact, record_beside};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_artifact::Artifact;
use plyflow_model::job::Record;
use serde_json::{Value, json};

/// `plyflow inspect`.
///
/// # Errors
/// [`exit::USAGE`] when there is no such artifact.
pub fn inspect(args: &InspectArgs) -> Done {
    let path = locate(args)?;
    let record = record_of(&path)?;
    let artifact = Artifact::open(path.as_std_path()).map_err(|e| Stop::new(exit::USAGE, e))?;
    let parsed = |text: &str| serde_json::from_str::<Value>(text).unwrap_or_default();
    if args.format == TextOrJson::Json {
        let all = json!({
            "path": path,
            "kind": artifact.kind(),
            "attributes": parsed(artifact.attributes()),
            "results": artifact.results(),
            "collection": artifact.collection(),
            "contents": artifact.contents(),
            "times": artifact.times(),
            "provenance": parsed(artifact.provenance()),
            "record": record,
            "verified": record.is_some(),
        });
        return print(&format!("{all:#}\n"));
    }
    print(&text(
        &path,
        &artifact,
        record.as_ref(),
        &parsed(artifact.provenance()),
    ))
}

/// The record beside an artifact, when there is one: then the artifact is what it tells of.
///
/// # Errors
/// [`exit::DAMAGED`] when the two are not what was written.
pub fn record_of(path: &Utf8Path) -> Result<Option<Record>, Stop> {
    let found = record_beside(path).and_then(|record| {
        if let Some(record) = &record {
            check_artifact(path, record)?;
        }
        Ok(record)
    });
    found.map_err(|flaw| {
        let text = format!(
            "{}; what is in it is not shown. A run of its workflow makes it again",
            flaw.text()
        );
        Stop::new(exit::DAMAGED, text)
    })
}

fn locate(args: &InspectArgs) -> Result<Utf8PathBuf, Stop> {
    let Some(file) = &args.workflow else {
        let path = Utf8Path::new(&args.artifact);
        if path.is_file() {
            return Ok(path.to_owned());
        }
        let text = format!(
            "there is no file {path}; for the artifact of a step: plyflow inspect STEP --workflow FILE"
        );
        return Err(Stop::new(exit::USAGE, text));
    };
    let places = Places {
        store: args.places.store.clone(),
        plugins: args.places.plugins.clone(),
        trust: args.places.trust.clone(),
    };
    let opened = open(&Workflow {
        workflow: file.clone(),
        places,
        set: Vec::new(),
        confirm: None,
    })?;
    artifact_of(&opened, &args.artifact, file)
}

/// The artifact of a step or of one of its items (`local[A]`) of the workflow in `file`.
///
/// # Errors
/// [`exit::USAGE`] when there is no such step or item, several items, or no artifact yet.
pub fn artifact_of(opened: &Opened, word: &str, file: &Utf8Path) -> Result<Utf8PathBuf, Stop> {
    let mut session = opened.look()?;
    let ids = instances_named(opened, &session, word)?;
    recheck(&mut session, &|id| ids.contains(&id), Depth::Artifacts);
    let damages: Vec<String> = ids.iter().filter_map(|id| session.damage(*id)).collect();
    if !damages.is_empty() {
        return Err(damaged(&damages, &format!("plyflow run {file}")));
    }
    let labels: Vec<String> = ids.iter().map(|id| session.core.label(*id)).collect();
    let [id] = ids[..] else {
        let text = if labels.is_empty() {
            format!("'{word}' has no items yet, or none at all; start with: plyflow run {file}")
        } else {
            format!("'{word}' has several items: {}", labels.join(", "))
        };
        return Err(Stop::new(exit::USAGE, text));
    };
    let instance = &session.core.instances()[id];
    match (instance.state, instance.key) {
        (State::Done { .. }, Some(key)) => Ok(opened.store.artifact(&key)),
        _ => Err(Stop::new(
            exit::USAGE,
            format!(
                "{} has no artifact yet; start with: plyflow run {file}",
                labels[0]
            ),
        )),
    }
}

fn text(path: &Utf8Path, artifact: &Artifact, record: Option<&Record>, made: &Value) -> String {
    let word = |v: &Value| v.as_str().unwrap_or_default().to_owned();
    let mut out = format!("{path}\nkind      {}\n", artifact.kind());
    out += &format!("step      {} {}\n", word(&made["step"]), made["item"]);
    let plugin = &made["plugin"];
    out += &format!(
        "plugin    {} {}\n",
        word(&plugin["name"]),
        word(&plugin["version"])
    );
    out += &verified(record);
    if let Some(labels) = artifact.collection() {
        out += &format!("items     {}: {}\n", labels.len(), labels.join(", "));
    }
    let contents = artifact.contents();
    if contents.frames > 0 {
        let (first, last) = (artifact.times().first(), artifact.times().last());
        let span = |t: Option<&f64>| t.map_or(String::new(), |t| number(*t));
        out += &format!(
            "frames    {} from {} s to {} s\n",
            contents.frames,
            span(first),
            span(last)
        );
    }
    out += &bodies(artifact);
    if !contents.arrays.is_empty() {
        let rows: Vec<Vec<String>> = contents
            .arrays
            .iter()
            .map(|a| {
                vec![
                    a.path.clone(),
                    format!("{:?}", a.dtype),
                    format!("{:?}", a.shape),
                    a.unit.clone(),
                ]
            })
            .collect();
        out += &format!(
            "\n{}",
            table(&["array", "type", "shape", "unit"], &rows, &[])
        );
    }
    if !artifact.results().is_empty() {
        let rows: Vec<Vec<String>> = artifact
            .results()
            .iter()
            .map(|r| vec![r.name.clone(), number(r.value), r.unit.clone()])
            .collect();
        out += &format!("\n{}", table(&["result", "value", "unit"], &rows, &[1]));
    }
    out
}

/// What the record beside an artifact tells: what it cost, and that it is whole.
fn verified(record: Option<&Record>) -> String {
    let Some(r) = record else {
        return "verified  no: no record lies beside it, so it cannot be told whether it is as it was written\n".into();
    };
    let c = &r.cost;
    let mut out = format!(
        "cost      {} wall, {} cpu, {} threads, {} memory on {}\n",
        duration_text(c.wall_seconds),
        duration_text(c.cpu_seconds),
        c.threads,
        bytes(c.peak_memory),
        r.host
    );
    out += &format!("size      {}\n", bytes(r.bytes));
    out += &format!(
        "verified  its bytes are those that were written (BLAKE3 {})\n",
        r.hash
    );
    for warning in &r.warnings {
        out += &format!("warning   {warning}\n");
    }
    out
}

fn bodies(artifact: &Artifact) -> String {
    let bodies = &artifact.contents().bodies;
    if bodies.is_empty() {
        return String::new();
    }
    let line = |b: &plyflow_artifact::BodyInfo| {
        let fields: Vec<String> = b
            .fields
            .iter()
            .map(|f| format!("{} [{}]", f.name, f.unit))
            .collect();
        vec![
            b.name.clone(),
            b.points.to_string(),
            b.cells.to_string(),
            fields.join(", "),
        ]
    };
    let rows: Vec<Vec<String>> = bodies.iter().map(line).collect();
    format!(
        "\n{}",
        table(&["body", "points", "cells", "fields"], &rows, &[1, 2])
    )
}
