//! `new study`: a scene and a workflow for a part of one's own, from an answer to each of five questions.

mod ask;
mod part;
mod plies;
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
use plies::{Book, Named, Plies};
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
    /// Length and width of plies that are rectangles (m).
    ply: Option<[f64; 2]>,
    /// What `--material` says, where it is needed.
    material: Option<String>,
    process: StudyProcess,
}

/// A material of the plies: how the scene names it, and what is known of it.
type Material = (String, Sheet);

/// What is known of a material.
#[derive(Debug, Clone, Copy, Default)]
struct Sheet {
    /// Thickness (m).
    thickness: Option<f64>,
    /// Areal mass (kg/m2).
    areal_mass: Option<f64>,
    /// Angle from its first fibre family to its second one (rad), where it is not a right one.
    crossing: Option<f64>,
}

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
    let mut take = |name: &str| take_material(name, &materials, folder, &mut files);
    let given = of.material.as_deref().map(&mut take).transpose()?;
    let (plies, sheets) = plies(args, &of, (metres, &unit), folder, given.clone(), &mut take)?;
    if of.process.has_films() {
        let film = text_of(&materials.join("stretchlon-ht350.yaml"))?;
        files.push((Utf8PathBuf::from(FILM), film));
    }
    let thickest = sheets.iter().filter_map(|s| s.thickness);
    let lightest = sheets.iter().filter_map(|s| s.areal_mass);
    let crossing = given.as_ref().and_then(|g| g.1.crossing);
    let study = Study {
        name: args.name.clone(),
        tool: from_folder(folder, Utf8Path::new(&of.tool))?,
        unit,
        part,
        plies,
        material: given.map_or(String::new(), |g| g.0),
        // The thickest, so that it fits into the gaps, and the lightest, so that no mass is added to it.
        sheet: [thickest.reduce(f64::max), lightest.reduce(f64::min)],
        crossing: crossing.map_or(90.0, |angle| (1e6 * angle.to_degrees()).round() / 1e6),
        angles: angles(&args.study.angles)?,
        process: of.process,
    };
    files.push(("scene.yaml".into(), study.scene()));
    files.push(("workflow.yaml".into(), study.workflow()));
    files.sort();
    files.dedup();
    Ok((files, told(&study, folder)))
}

/// The plies, and thickness and areal mass of each of their materials. `unit`: of the tool (m), and as the scene writes it; `given`: the material of
/// `--material`; `take`: takes a material into the study.
fn plies(
    args: &NewArgs,
    of: &Answers,
    (metres, unit): (f64, &str),
    folder: &Utf8Path,
    given: Option<Material>,
    take: &mut impl FnMut(&str) -> Result<Material, Stop>,
) -> Result<(Plies, Vec<Sheet>), Stop> {
    let mut sheets: Vec<Sheet> = given.iter().map(|g| g.1).collect();
    let words = &args.study;
    if let Some(path) = &words.dxf {
        let layer = words.layer.clone();
        let (without_unit, size) = plies::drawing(path, layer.as_deref(), metres)?;
        let drawn = Plies::Drawn {
            file: from_folder(folder, path)?,
            layer,
            unit: without_unit.then(|| unit.to_owned()),
            size,
        };
        return Ok((drawn, sheets));
    }
    let Some(path) = &words.plies else {
        let size = of
            .ply
            .ok_or_else(|| Stop::new(exit::INTERNAL, "an answer is missing"))?;
        return Ok((Plies::Rectangles(size), sheets));
    };
    let read = plies::read(path, of.ply, metres)?;
    let mut materials = Vec::new();
    for named in plies::materials(path, &read.rows).0 {
        match named {
            Named::File(file) => sheets.push(sheet_of(&text_of(&file)?)),
            Named::Name(name) => {
                let taken = of_name(path, &name, given.as_ref(), take)?;
                sheets.push(taken.1);
                materials.push((name, taken.0));
            }
        }
    }
    let book = Book {
        file: from_folder(folder, path)?,
        unit: read.without_unit.then(|| unit.to_owned()),
        read,
        size: of.ply,
        material: given.map(|g| g.0),
        materials,
    };
    Ok((Plies::Book(book), sheets))
}

/// What a name of a book's material stands for: one that comes along, or the one of `--material`.
fn of_name(
    book: &Utf8Path,
    name: &str,
    given: Option<&Material>,
    take: &mut impl FnMut(&str) -> Result<Material, Stop>,
) -> Result<Material, Stop> {
    take(name).or_else(|stop| {
        given.cloned().ok_or_else(|| {
            let why = stop.text.trim_start_matches(&format!("--material {name}: "));
            let text = format!(
                "{book}: the material `{name}`: {why}. Or say with --material what names that are no file stand for"
            );
            Stop::new(stop.code, text)
        })
    })
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
    let (ply, needs_material) = ply(args, &mut asker)?;
    let names = shipped_names(materials).join(", ");
    let question = format!("Which material: a file, or one of {names}?");
    let material = given.material.as_deref();
    let material = match needs_material || material.is_some() {
        true => asker.value(material, "--material NAME|FILE", &question, None)?,
        false => None,
    };
    let process = asker.process(given)?;
    asker.complete().map_err(|stop| match (&unit, &tool) {
        (None, Some(_)) => {
            let text = format!("{}. The tool spans{}", stop.text, in_units(&facets));
            Stop::new(stop.code, text)
        }
        _ => stop,
    })?;
    match (tool, unit) {
        (Some(tool), Some(unit)) => Ok(Answers {
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

/// Length and width of plies that are rectangles (m), and whether `--material` is needed. `None` where there are no such plies, or where the answer is
/// missing and nobody gives it.
fn ply(args: &NewArgs, asker: &mut Asker<'_>) -> Result<(Option<[f64; 2]>, bool), Stop> {
    let wrong = |text: String| Stop::new(exit::USAGE, text);
    let words = &args.study;
    let read = |size: Option<String>| size.map(|s| words::ply(&s).map_err(wrong)).transpose();
    if words.dxf.is_some() {
        return Ok((None, true));
    }
    let question = "How large are the plies, such as '400 x 200 mm'?";
    if let Some(book) = &words.plies {
        let rows = plies::rows(book)?;
        let (_, without) = plies::materials(book, &rows);
        let size = match (&words.ply, rows.iter().any(|r| r.outline.is_none())) {
            (given, false) => given.clone(),
            (given, true) => {
                let option = "--ply SIZE (of the plies whose row has no outline)";
                let question =
                    "How large are the plies whose row has no outline, such as '400 x 200 mm'?";
                asker.value(given.as_deref(), option, question, None)?
            }
        };
        return Ok((read(size)?, without));
    }
    let option = "--ply SIZE, --dxf FILE or --plies BOOK";
    let size = asker.value(words.ply.as_deref(), option, question, None)?;
    Ok((read(size)?, true))
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
    let whole = match study.process.has_films() {
        true => "coarse",
        false => "formed",
    };
    let plies = match &study.plies {
        Plies::Book(book) => format!(
            " The book has {} plies: scene.yaml names it, so what you change in it counts.",
            book.read.rows.len()
        ),
        _ => String::new(),
    };
    format!(
        "The tool is {x} long, {y} wide and {z} high; {placed}.{plies} Go on with\n\n  cd {}\n  plyflow run workflow.yaml --until drape    # a second: does \
         it stand as it should?\n  plyflow run workflow.yaml --until {whole}   # the whole part\n  plyflow run workflow.yaml\n\nEach ends with the path of its report. \
         scene.yaml says what was guessed.\n",
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
) -> Result<Material, Stop> {
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
    let sheet = sheet_of(&text);
    let names_files = text.contains("./") || text.contains("file:");
    let name = path.file_name().unwrap_or("material.yaml");
    if names_files {
        return Ok((from_folder(folder, &path)?, sheet));
    }
    let place = format!("materials/{name}");
    files.push((Utf8PathBuf::from(&place), text.clone()));
    Ok((place, sheet))
}

/// What a material's text says of it, where thickness and areal mass stand in lines of their own, and the crossing in one, or between others.
fn sheet_of(text: &str) -> Sheet {
    let bare = || text.lines().filter_map(|l| l.split(" #").next());
    let value = |key: &str, dimension| {
        let line = bare().find_map(|l| l.strip_prefix(key)?.strip_prefix(':'))?;
        parse_quantity(line.trim(), dimension).ok()
    };
    let crossing = bare().find_map(|l| {
        let (before, after) = l.split_once("crossing:")?;
        let is_key = before.is_empty() || before.ends_with([' ', ',', '{']);
        let value = after.split([',', '}']).next()?.trim();
        let angle = parse_quantity(value, Dimension::Angle).ok();
        angle.filter(|_| is_key && !before.contains('#'))
    });
    Sheet {
        thickness: value("thickness", Dimension::Length),
        areal_mass: value("areal_mass", Dimension::ArealMass),
        crossing,
    }
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
