//! `export`: formed plies as files of other programs.

use super::args::{ExportArgs, ExportFormat, ExportUnit, Places, Printed, Workflow};
use super::deliver::{self, Ready, write_all};
use super::inspect::{artifact_of, record_of};
use super::open::open;
use crate::exit;
use crate::said::{Done, Stop, print, warn};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_artifact::Artifact;
use plyflow_export::{ExportError, Format, Frames, LengthUnit, Request};
use plyflow_model::units::{Dimension, parse_quantity};
use serde_json::{Value, json};

/// `plyflow export`.
///
/// # Errors
/// [`exit::USAGE`] when the step has no artifact, when what is asked for is not in it, or when another file is in the way;
/// [`exit::DAMAGED`] when the artifact is not what was written; [`exit::INTERNAL`] when it cannot be read or a file cannot be written. Nothing
/// is written then, but what was before a disk failed.
pub fn export(args: &ExportArgs) -> Done {
    let frames = frames(args)?;
    let net = net(&args.net)?;
    let (path, stem) = located(args)?;
    let artifact = Artifact::open(path.as_std_path()).map_err(|e| Stop::new(exit::USAGE, e))?;
    let stem = stem.unwrap_or_else(|| made_by(&artifact));
    let (mut files, mut told) = (Vec::new(), Vec::new());
    let several = args.format.contains(&ExportFormat::Abaqus)
        && args.format.contains(&ExportFormat::Calculix);
    for format in &args.format {
        let stem = match format {
            // Both end in `.inp`.
            ExportFormat::Calculix if several => format!("{stem}-calculix"),
            _ => stem.clone(),
        };
        let request = Request {
            format: of(*format),
            frames,
            bodies: args.body.clone(),
            unit: match args.unit {
                ExportUnit::M => LengthUnit::Metre,
                ExportUnit::Mm => LengthUnit::Millimetre,
                ExportUnit::In => LengthUnit::Inch,
            },
            net,
            stem,
        };
        let made = plyflow_export::export(&artifact, &request).map_err(stop(&path))?;
        for file in made.files {
            // The same format given twice.
            if !files.iter().any(|f: &Ready| f.name == file.name) {
                let (name, content) = (file.name, file.content);
                files.push(Ready { name, content });
            }
        }
        let new = made
            .told
            .into_iter()
            .filter(|t| !told.contains(t))
            .collect::<Vec<_>>();
        told.extend(new);
    }
    let folder = args.to.as_deref().unwrap_or(Utf8Path::new("."));
    let written = write_all(&files, folder, args.force)?;
    match args.print {
        Printed::Text => {
            let notes: String = told.iter().map(|t| format!("note: {t}\n")).collect();
            print(&(deliver::told(&written) + &notes))
        }
        Printed::Json => {
            let files: Vec<Value> = written
                .iter()
                .map(|w| json!({"path": w.path, "bytes": w.bytes, "new": w.new}))
                .collect();
            print(&format!("{}\n", json!({"files": files, "notes": told})))
        }
    }
}

/// What a command line can mend is told as such.
fn stop(path: &Utf8Path) -> impl Fn(ExportError) -> Stop + '_ {
    move |e| {
        let code = match e {
            ExportError::Artifact(_) | ExportError::Attributes(_) => exit::INTERNAL,
            _ => exit::USAGE,
        };
        Stop::new(code, format!("{e}; {path}"))
    }
}

fn of(format: ExportFormat) -> Format {
    match format {
        ExportFormat::Vtu => Format::Vtu,
        ExportFormat::Csv => Format::Csv,
        ExportFormat::Abaqus => Format::Abaqus,
        ExportFormat::Calculix => Format::Calculix,
        ExportFormat::Nastran => Format::Nastran,
        ExportFormat::Dxf => Format::Dxf,
    }
}

fn frames(args: &ExportArgs) -> Result<Frames, Stop> {
    let other = args.format.iter().find(|f| **f != ExportFormat::Vtu);
    match (args.frame.as_deref(), other) {
        (None, _) => Ok(Frames::Last),
        (Some("all"), Some(other)) => {
            let name = of(*other).name();
            Err(Stop::new(exit::USAGE, ExportError::OneFrame(name)))
        }
        (Some("all"), None) => Ok(Frames::All),
        (Some(text), _) => text.parse().map(Frames::At).map_err(|_| {
            let text = format!("--frame {text}: expected a number from 0 on, or `all`");
            Stop::new(exit::USAGE, text)
        }),
    }
}

/// A distance (m).
fn net(text: &str) -> Result<f64, Stop> {
    let wrong = |why: String| Stop::new(exit::USAGE, format!("--net '{text}': {why}"));
    let found = parse_quantity(text, Dimension::Length);
    match found.map_err(|e| wrong(format!("{}; {}", e.reason(), e.help())))? {
        length if length > 0.0 && length.is_finite() => Ok(length),
        _ => Err(wrong("expected a length above 0, such as '20 mm'".into())),
    }
}

/// The artifact, and with what names of files begin where a step is named.
fn located(args: &ExportArgs) -> Result<(Utf8PathBuf, Option<String>), Stop> {
    let file = &args.file;
    let is_artifact = starts_as_hdf5(file);
    let Some(step) = &args.step else {
        if is_artifact {
            if record_of(file)?.is_none() {
                warn(&format!(
                    "plyflow: no record lies beside {file}, so it cannot be told whether it is as it was written\n"
                ));
            }
            return Ok((file.clone(), None));
        }
        let text = match file.is_file() {
            true => format!(
                "{file} is no artifact; of a workflow, name the step too: plyflow export {file} STEP"
            ),
            false => format!("there is no file {file}"),
        };
        return Err(Stop::new(exit::USAGE, text));
    };
    if is_artifact {
        let text = format!("{file} is an artifact, and no step of a workflow; leave '{step}' out");
        return Err(Stop::new(exit::USAGE, text));
    }
    let opened = open(&Workflow {
        workflow: file.clone(),
        places: Places {
            store: args.places.store.clone(),
            plugins: args.places.plugins.clone(),
            trust: args.places.trust.clone(),
        },
        set: args.set.clone(),
        confirm: None,
    })?;
    let path = artifact_of(&opened, step, file)?;
    Ok((path, Some(stem(step))))
}

fn starts_as_hdf5(file: &Utf8Path) -> bool {
    let mut first = [0; 8];
    let read =
        std::fs::File::open(file).and_then(|mut f| std::io::Read::read_exact(&mut f, &mut first));
    read.is_ok() && first == *b"\x89HDF\r\n\x1a\n"
}

/// The step, and the item's number, that an artifact says it was made by.
fn made_by(artifact: &Artifact) -> String {
    let made: Value = serde_json::from_str(artifact.provenance()).unwrap_or_default();
    let step = made["step"].as_str().unwrap_or("artifact");
    let items = made["item"].as_array().into_iter().flatten();
    let items: Vec<String> = items.map(|n| format!("[{n}]")).collect();
    stem(&format!("{step}{}", items.concat()))
}

/// `local[A]` as the beginning of a name that every system takes: `local-A`.
fn stem(word: &str) -> String {
    let word = word.replace("][", "-").replace('[', "-").replace(']', "");
    let fit = |c: char| {
        if c.is_alphanumeric() || "_-".contains(c) {
            c
        } else {
            '_'
        }
    };
    let word: String = word.chars().map(fit).take(100).collect();
    if word.is_empty() {
        "artifact".into()
    } else {
        word
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_items_become_beginnings_of_names() {
        for (word, expected) in [
            ("coarse", "coarse"),
            ("local[A]", "local-A"),
            ("points[2][B]", "points-2-B"),
            ("draped{size=80 mm}", "draped_size_80_mm_"),
            ("../a/b", "___a_b"),
            ("", "artifact"),
        ] {
            assert_eq!(stem(word), expected);
        }
    }

    #[test]
    fn distances_of_fibres_have_a_unit_and_are_above_zero() {
        assert_eq!(net("20 mm").unwrap(), 0.02);
        for text in ["20", "0 mm", "-1 mm", "1 kg", "x"] {
            let stop = net(text).unwrap_err();
            assert!(
                stop.text.contains(&format!("--net '{text}'")),
                "{}",
                stop.text
            );
        }
    }
}
