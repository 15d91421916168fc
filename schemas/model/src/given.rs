//! What a scene takes from other steps: the words that ask for it, and putting what the steps give in their place.
//!
//! A tool `{input: {body: NAME}}` is a body of an artifact of the kind `geometry`, and a contour `{input: NAME}` is an outline of one. Once they
//! are filled in, everything that reads a scene sees triangles and corners, wherever they come from.

use crate::contour::Contour;
use crate::fault::Path;
use crate::outline::{Point, Region};
use crate::process::Process;
use crate::scene::{Scene, Sheet};
use crate::tool::{GivenSurface, Tool};
use std::fmt;
use std::sync::Arc;

/// An outline with its holes that a step has made.
#[derive(Debug, Clone, PartialEq)]
pub struct GivenOutline {
    /// Name of the step.
    pub step: String,
    /// Corners (m), either way round, the first not repeated at the end.
    pub outline: Vec<Point>,
    /// Corners of its holes (m), likewise.
    pub holes: Vec<Vec<Point>>,
}

/// What other steps give.
pub trait Geometry {
    /// A body.
    ///
    /// # Errors
    /// When there is none of that name, more than one, or one that is not of triangles; says what there is.
    fn body(&self, name: &str) -> Result<GivenSurface, String>;

    /// An outline.
    ///
    /// # Errors
    /// When there is none of that name, more than one, or one whose arrays are no corners; says what there is.
    fn outline(&self, name: &str) -> Result<GivenOutline, String>;
}

/// What a word of a scene asks for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum AskedFor {
    /// The body of that name.
    Body(String),
    /// The outline of that name.
    Outline(String),
}

impl fmt::Display for AskedFor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Body(name) => write!(f, "the body `{name}`"),
            Self::Outline(name) => write!(f, "the outline `{name}`"),
        }
    }
}

/// All that a scene asks other steps for, with the place of the name, in the order of the scene.
pub fn asks(scene: &Scene) -> Vec<(Path, AskedFor)> {
    let mut found = Vec::new();
    let mut body = |tool: &Tool, path: Path| {
        if let Tool::Input(input) = tool {
            let path = path.key("input").key("body");
            found.push((path, AskedFor::Body(input.body.clone())));
        }
    };
    body(&scene.tool, Path::to("tool"));
    if let Process::Stamping(stamping) = &scene.process {
        for (k, part) in stamping.parts.iter().enumerate() {
            if let Some(tool) = &part.tool {
                body(tool, part_at(k).key("tool"));
            }
        }
    }
    for (k, sheet) in scene.sheets.iter().enumerate() {
        let at = Path::to("sheets").item(k);
        let outline = sheet.outline.iter().map(|c| (at.key("outline"), c));
        let holes = sheet.holes.iter().enumerate();
        let holes = holes.map(|(i, c)| (at.key("holes").item(i), c));
        let regions = sheet.regions.iter().enumerate();
        let regions = regions.filter_map(|(i, region)| {
            let path = at.key("regions").item(i).key("polygon");
            Some((path, region.polygon.as_ref()?))
        });
        for (path, contour) in outline.chain(holes).chain(regions) {
            if let Some(name) = contour.input() {
                found.push((path.key("input"), AskedFor::Outline(name.to_owned())));
            }
        }
    }
    found
}

/// Place of a rigid part of a stamping.
fn part_at(k: usize) -> Path {
    Path::to("process").key("stamping").key("parts").item(k)
}

/// Puts what other steps give into a scene, in the place of every word that asks for it. The holes of a ply's outline follow those that the scene
/// lists.
///
/// # Errors
/// What is missing or bounds no region, with its place in the scene and the step that gave it.
pub fn fill(scene: &mut Scene, from: &dyn Geometry) -> Result<(), String> {
    fill_tool(&mut scene.tool, &Path::to("tool"), from)?;
    if let Process::Stamping(stamping) = &mut scene.process {
        for (k, part) in stamping.parts.iter_mut().enumerate() {
            if let Some(tool) = &mut part.tool {
                fill_tool(tool, &part_at(k).key("tool"), from)?;
            }
        }
    }
    for (k, sheet) in scene.sheets.iter_mut().enumerate() {
        fill_sheet(sheet, &Path::to("sheets").item(k), from)?;
    }
    Ok(())
}

fn fill_tool(tool: &mut Tool, at: &Path, from: &dyn Geometry) -> Result<(), String> {
    if let Tool::Input(input) = tool {
        let given = from.body(&input.body);
        let given = given.map_err(|why| format!("scene.{at}.input.body: {why}"))?;
        input.given = Some(Arc::new(given));
    }
    Ok(())
}

fn fill_sheet(sheet: &mut Sheet, at: &Path, from: &dyn Geometry) -> Result<(), String> {
    for (i, hole) in sheet.holes.iter_mut().enumerate() {
        fill_plain(hole, &at.key("holes").item(i), from)?;
    }
    for (i, region) in sheet.regions.iter_mut().enumerate() {
        if let Some(polygon) = &mut region.polygon {
            fill_plain(polygon, &at.key("regions").item(i).key("polygon"), from)?;
        }
    }
    if let Some(name) = sheet.outline.as_ref().and_then(Contour::input) {
        let given = checked(name, &at.key("outline"), from)?;
        sheet.outline = Some(Contour::of(&given.outline));
        sheet
            .holes
            .extend(given.holes.iter().map(|h| Contour::of(h)));
    }
    Ok(())
}

/// A contour that has no holes of its own.
fn fill_plain(contour: &mut Contour, at: &Path, from: &dyn Geometry) -> Result<(), String> {
    let Some(name) = contour.input() else {
        return Ok(());
    };
    let given = checked(name, at, from)?;
    if !given.holes.is_empty() {
        return Err(format!(
            "scene.{at}.input: outline `{name}` of step `{}` has {} of its own; expected one without holes, as only the outline of a ply has any",
            given.step,
            match given.holes.len() {
                1 => "a hole".to_owned(),
                n => format!("{n} holes"),
            }
        ));
    }
    *contour = Contour::of(&given.outline);
    Ok(())
}

/// An outline that bounds a region.
fn checked(name: &str, at: &Path, from: &dyn Geometry) -> Result<GivenOutline, String> {
    let given = from.outline(name);
    let given = given.map_err(|why| format!("scene.{at}.input: {why}"))?;
    // Before it is moved to its place, so that what is wrong is told where the step has it.
    match Region::new(given.outline.clone(), given.holes.clone()) {
        Ok(_) => Ok(given),
        Err(why) => Err(format!(
            "scene.{at}.input: outline `{name}` of step `{}` bounds no region: {why}",
            given.step
        )),
    }
}
