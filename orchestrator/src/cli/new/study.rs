//! `new study`: a scene and a workflow for a part of one's own, from an answer to each of five questions.

mod ask;
mod drawing;
mod part;
mod sizes;
mod text;
mod words;

use crate::cli::args::{NewArgs, StudyProcess};
use crate::cli::shipped;
use crate::cli::typed::quoted;
use crate::exit;
use crate::said::Stop;
use ask::Asker;
use camino::{Utf8Path, Utf8PathBuf};
use part::Part;
use plyflow_files::open::{self, MOST_DATA, MOST_WRITTEN};
use plyflow_files::stl;
use plyflow_model::units::{Dimension, parse_quantity};
use std::io::BufRead;
use text::{FILM, Study};
use words::mm;

/// Units that a tool is shown in where it is not known in which it is drawn.
const UNITS: [&str; 5] = ["mm", "cm", "m", "in", "ft"];

/// Most plies of a study that is begun.
const MOST_PLIES: usize = 100;

/// What the five questions are answered with.
struct Answers {
    tool: String,
    facets: Vec<[[f64; 3]; 3]>,
    unit: String,
    ply: [f64; 2],
    material: String,
    process: StudyProcess,
}

/// The step that reads a drawing: its files, in the folder of the workflows that come along.
const DXF_STEP: [&str; 2] = ["dxf_outline.py", "dxf_reading.py"];

/// The files of a new study by their paths in its folder, and what to say of it.
///
/// # Errors
/// [`exit::USAGE`] when something is missing and nobody answers, or is none; with what to say instead.
pub fn files(
    args: &NewArgs,
    folder: &Utf8Path,
    answers: Option<&mut dyn BufRead>,
) -> Result<(Vec<(Utf8PathBuf, String)>, String), Stop> {
    let wrong = |text: String| Stop::new(exit::USAGE, text);
    let shipped = shipped::workflows()?;
    let materials = shipped.join("materials");
    let of = answered(args, &materials, answers)?;
    let (metres, unit) = words::unit(&of.unit).map_err(wrong)?;
    let part = Part::new(&of.facets, metres)
        .ok_or_else(|| wrong(format!("--tool {}: its facets have no extent", of.tool)))?;
    let mut files = Vec::new();
    let (material, sheet) = take_material(&of.material, &materials, folder, &mut files)?;
    if of.process == StudyProcess::DoubleDiaphragm {
        let film = text_of(&materials.join("stretchlon-ht350.yaml"))?;
        files.push((Utf8PathBuf::from(FILM), film));
    }
    let outline = args.study.dxf.as_deref();
    let outline = outline.map(|dxf| from_folder(folder, dxf)).transpose()?;
    if outline.is_some() {
        for name in DXF_STEP {
            let text = text_of(&shipped.join("files-of-others").join(name))?;
            files.push((Utf8PathBuf::from(name), text));
        }
    }
    let study = Study {
        name: args.name.clone(),
        tool: from_folder(folder, Utf8Path::new(&of.tool))?,
        unit,
        part,
        ply: of.ply,
        outline,
        layer: args.study.layer.clone(),
        material,
        sheet,
        angles: angles(&args.study.angles)?,
        process: of.process,
    };
    files.push(("scene.yaml".into(), study.scene()));
    files.push(("workflow.yaml".into(), study.workflow()));
    files.sort();
    files.dedup();
    Ok((files, told(&study, folder)))
}

/// The answers: those that are given, and for the others those of who is asked.
fn answered(
    args: &NewArgs,
    materials: &Utf8Path,
    answers: Option<&mut dyn BufRead>,
) -> Result<Answers, Stop> {
    let given = &args.study;
    let mut asker = Asker::new(answers);
    let tool = given.tool.as_ref().map(|t| t.as_str());
    let tool = asker.value(tool, "--tool FILE", "Which STL file is the tool?", None)?;
    let facets = tool.as_deref().map_or(Ok(Vec::new()), read)?;
    let question = format!("Which unit does it have?{}", in_units(&facets));
    let unit = given.unit.as_deref();
    let unit = asker.value(unit, "--unit UNIT", &question, Some("mm"))?;
    let ply = ply(args, &mut asker)?;
    let names = shipped_names(materials).join(", ");
    let question = format!("Which material: a file, or one of {names}?");
    let material = given.material.as_deref();
    let material = asker.value(material, "--material NAME|FILE", &question, None)?;
    let process = asker.process(given)?;
    asker.complete().map_err(|stop| match (&unit, &tool) {
        (None, Some(_)) => {
            let text = format!("{}. The tool spans{}", stop.text, in_units(&facets));
            Stop::new(stop.code, text)
        }
        _ => stop,
    })?;
    match (tool, unit, ply, material) {
        (Some(tool), Some(unit), Some(ply), Some(material)) => Ok(Answers {
            tool,
            facets,
            unit,
            ply,
            material,
            process,
        }),
        _ => Err(Stop::new(exit::INTERNAL, "an answer is missing")),
    }
}

/// Length and width of the plies, or of the box around their outline (m). `None` where they are missing and nobody answers.
fn ply(args: &NewArgs, asker: &mut Asker<'_>) -> Result<Option<[f64; 2]>, Stop> {
    let wrong = |text: String| Stop::new(exit::USAGE, text);
    let words = &args.study;
    if let (Some(dxf), None) = (&words.dxf, &words.ply) {
        let bytes = open::read(dxf.as_std_path(), MOST_DATA)
            .map_err(|e| wrong(format!("--dxf {dxf}: {e}; expected a DXF drawing")))?;
        let text = String::from_utf8_lossy(&bytes);
        let size = drawing::size(&text, words.layer.as_deref());
        return size.map(Some).ok_or_else(|| {
            let what = match &words.layer {
                Some(layer) => format!("its curves on the layer `{layer}`"),
                None => "its curves".to_owned(),
            };
            wrong(format!(
                "--dxf {dxf}: nothing tells how large {what} are, or in which unit ($INSUNITS); expected a text DXF with lines, arcs or polylines \
                 outside of blocks. Say how large the box around the outline is with --ply, such as --ply '400 x 200 mm'"
            ))
        });
    }
    if let Some(dxf) = words.dxf.as_ref().filter(|d| !d.is_file()) {
        return Err(wrong(format!("--dxf {dxf}: there is no such file")));
    }
    let question = "How large are the plies, such as '400 x 200 mm'?";
    let option = "--ply SIZE or --dxf FILE";
    let size = asker.value(words.ply.as_deref(), option, question, None)?;
    size.map(|size| words::ply(&size).map_err(wrong))
        .transpose()
}

/// What is said of a study that has been written.
fn told(study: &Study, folder: &Utf8Path) -> String {
    let [x, y, z] = study.part.size.map(|s| mm((1e5 * s).round() * 1e-5));
    let placed = match study.part.words.is_empty() {
        true => "it lies in its place".to_owned(),
        false => format!(
            "it is put in its place by `{}`",
            study.part.words.join(", ")
        ),
    };
    let (trust, needs) = match study.outline {
        Some(_) => (
            " --trust",
            " The drawing is read by dxf_outline.py, which lies in the folder now: `--trust` lets it run, and it needs a Python with `numpy`, `ezdxf` \
             and `shapely` (docs/guide/files-of-others.md).",
        ),
        None => ("", ""),
    };
    let whole = match study.process {
        StudyProcess::DoubleDiaphragm => "coarse",
        StudyProcess::Press => "formed",
    };
    format!(
        "The tool is {x} long, {y} wide and {z} high; {placed}. Go on with\n\n  cd {}\n  plyflow run{trust} workflow.yaml --until drape    # a second: does \
         it stand as it should?\n  plyflow run{trust} workflow.yaml --until {whole}   # the whole part\n  plyflow run{trust} workflow.yaml\n\nEach ends with the path of its report. \
         scene.yaml says what was guessed.{needs}\n",
        quoted(folder.as_str())
    )
}

/// The facets of a tool's file, in its units.
fn read(tool: &str) -> Result<Vec<[[f64; 3]; 3]>, Stop> {
    let path = Utf8Path::new(tool);
    let wrong = |text: String| Stop::new(exit::USAGE, text);
    let bytes = open::read(path.as_std_path(), MOST_DATA)
        .map_err(|e| wrong(format!("--tool {tool}: {e}; expected an STL file")))?;
    let facets = stl::parse(&bytes).map_err(|e| {
        let text = e.of(path.as_std_path());
        wrong(format!(
            "--tool {text}. A STEP file comes in through a step of the workflow: docs/guide/files-of-others.md"
        ))
    })?;
    match facets.corners.is_empty() {
        true => Err(wrong(format!("--tool {tool}: it has no facet"))),
        false => Ok(facets.corners),
    }
}

/// How large facets are in each unit, for a question.
fn in_units(facets: &[[[f64; 3]; 3]]) -> String {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in facets.as_flattened() {
        for k in 0..3 {
            (low[k], high[k]) = (low[k].min(p[k]), high[k].max(p[k]));
        }
    }
    if facets.is_empty() {
        return String::new();
    }
    let one = |unit: &&str| {
        let metres = words::unit(unit).map_or(1.0, |u| u.0);
        let [x, y, z] = [0, 1, 2].map(|k| {
            let size = 1e3 * metres * (high[k] - low[k]);
            format!("{}", (10.0 * size).round() / 10.0)
        });
        format!("{x} x {y} x {z} mm in {unit}")
    };
    let all: Vec<String> = UNITS.iter().map(one).collect();
    format!(" {}", all.join(", "))
}

/// Names of the materials that come along.
fn shipped_names(materials: &Utf8Path) -> Vec<String> {
    let entries = materials.read_dir_utf8().into_iter().flatten().flatten();
    let mut names: Vec<String> = entries
        .filter(|e| e.path().extension() == Some("yaml"))
        .filter_map(|e| e.path().file_stem().map(str::to_owned))
        .collect();
    names.sort();
    names
}

fn text_of(path: &Utf8Path) -> Result<String, Stop> {
    let bytes = open::read(path.as_std_path(), MOST_WRITTEN)
        .map_err(|e| Stop::new(exit::USAGE, format!("{path}: {e}")))?;
    String::from_utf8(bytes)
        .map_err(|_| Stop::new(exit::USAGE, format!("{path}: it is no text in UTF-8")))
}

/// A material as the scene is to name it, with its thickness (m) and areal mass (kg/m2): a file or one that comes along. It is copied unless
/// it names files beside it.
fn take_material(
    given: &str,
    materials: &Utf8Path,
    folder: &Utf8Path,
    files: &mut Vec<(Utf8PathBuf, String)>,
) -> Result<(String, [Option<f64>; 2]), Stop> {
    let path = Utf8PathBuf::from(given);
    let shipped = materials.join(format!("{given}.yaml"));
    let path = match path.is_file() {
        true => path,
        false if shipped.is_file() => shipped,
        false => {
            let text = format!(
                "--material {given}: there is no such file, and no material of that name comes along; expected a file or one of {}",
                shipped_names(materials).join(", ")
            );
            return Err(Stop::new(exit::USAGE, text));
        }
    };
    let text = text_of(&path)?;
    if !text.lines().any(|l| l.starts_with("plyflow_material:")) {
        let text = format!(
            "--material {path}: it is no material; expected a file with `plyflow_material: 1`"
        );
        return Err(Stop::new(exit::USAGE, text));
    }
    let value = |key: &str, dimension| {
        let line = text
            .lines()
            .find_map(|l| l.strip_prefix(key)?.strip_prefix(':'))?;
        let bare = line.split(" #").next()?.trim();
        parse_quantity(bare, dimension).ok()
    };
    let sheet = [
        value("thickness", Dimension::Length),
        value("areal_mass", Dimension::ArealMass),
    ];
    let names_files = text.contains("./") || text.contains("file:");
    let name = path.file_name().unwrap_or("material.yaml");
    if names_files {
        return Ok((from_folder(folder, &path)?, sheet));
    }
    let place = format!("materials/{name}");
    files.push((Utf8PathBuf::from(&place), text.clone()));
    Ok((place, sheet))
}

/// The path of a file as it is named from a folder that may not be there yet.
fn from_folder(folder: &Utf8Path, file: &Utf8Path) -> Result<String, Stop> {
    let failed = |what: &Utf8Path| Stop::machine(format!("finding {what}"));
    let file = file.canonicalize_utf8().map_err(failed(file))?;
    // What there is of the folder's path, and then the rest.
    let absolute = camino::absolute_utf8(folder).map_err(failed(folder))?;
    let there = absolute
        .ancestors()
        .find(|a| a.is_dir())
        .unwrap_or(Utf8Path::new("/"));
    let rest = absolute.strip_prefix(there).unwrap_or(Utf8Path::new(""));
    let folder = there.canonicalize_utf8().map_err(failed(there))?.join(rest);
    let common = folder
        .components()
        .zip(file.components())
        .take_while(|(a, b)| a == b)
        .count();
    let ups = folder.components().count() - common;
    let down: Utf8PathBuf = file.components().skip(common).collect();
    Ok(format!("{}{down}", "../".repeat(ups)))
}

/// Directions of the plies' first fibres (deg).
fn angles(given: &[f64]) -> Result<Vec<f64>, Stop> {
    if given.is_empty() {
        return Ok(vec![0.0]);
    }
    if given.len() > MOST_PLIES || given.iter().any(|a| !(0.0..=360.0).contains(&a.abs())) {
        let text = format!(
            "--angles: expected 1 to {MOST_PLIES} angles between -360 and 360 degrees, such as `--angles 45,-45`"
        );
        return Err(Stop::new(exit::USAGE, text));
    }
    Ok(given.to_vec())
}

#[cfg(test)]
mod tests;
