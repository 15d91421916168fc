//! Small pictures of the formed ply, one for each point: the same step and ply.

use crate::draw::{DrawError, Look, Series};
use crate::family::Family;
use crate::input::ReportInput;
use crate::read::{Source, sheet};
use camino::Utf8Path;
use maud::Markup;
use rayon::prelude::*;

/// Pictures on a page.
pub(super) const MOST: usize = 240;
/// Together they are about this long at most (bytes).
const LENGTH: usize = 2_400_000;
/// Widths that are tried (px), the finest first.
const WIDTHS: [f64; 9] = [360.0, 300.0, 250.0, 205.0, 170.0, 140.0, 110.0, 85.0, 60.0];

/// The pictures.
#[derive(Debug, Default)]
pub(crate) struct Pictures {
    /// What they show.
    pub(super) title: String,
    /// The scale of colours, with its ends in words.
    pub(super) bar: Markup,
    /// For each point its picture as an address, if it has one.
    pub(super) of: Vec<Option<String>>,
    /// Pixels of each.
    pub(super) size: [usize; 2],
}

/// Draws the pictures; `None`: the points have no plies. What cannot be read is added to `problems`.
///
/// # Errors
/// When a picture cannot be encoded.
pub(super) fn draw(
    input: &ReportInput,
    family: &Family,
    problems: &mut Vec<String>,
) -> Result<Option<Pictures>, DrawError> {
    let Some((step, source)) = source(input, family, problems) else {
        return Ok(None);
    };
    let of = |p: usize| -> Option<&Utf8Path> {
        let own = family.points[p].instances.iter();
        let mut own = own.map(|i| &input.instances[*i]);
        let found = own.find(|i| i.base() == step && i.record.kind == source.kind())?;
        Some(&found.artifact)
    };
    let paths: Vec<Option<&Utf8Path>> = (0..family.points.len().min(MOST)).map(of).collect();
    // Once for the view and the colours, and once to draw: so many meshes have no room together.
    let look = |path: &Option<&Utf8Path>| {
        let sheet = sheet::read((*path)?, source);
        Some(sheet.map(|s| s.map(|s| Look::of(&s))))
    };
    let looks: Vec<Option<_>> = paths.par_iter().map(look).collect();
    let mut seen = Vec::new();
    for (p, look) in looks.into_iter().enumerate() {
        let name = &family.points[p].name;
        match look {
            Some(Ok(Some(look))) => seen.push(look),
            Some(Ok(None)) => problems.push(format!("picture of {name}: it has no ply")),
            Some(Err(e)) => problems.push(format!("picture of {name}: {e}")),
            None => {}
        }
    }
    let Some(series) = Series::of(&seen) else {
        return Ok(None);
    };
    let (mut of, size) = fitting(&series, &paths, source, seen.len())?;
    of.resize(family.points.len(), None);
    Ok(Some(Pictures {
        title: series.title(step),
        bar: series.bar("study-pictures-scale"),
        of,
        size,
    }))
}

/// The pictures in the finest size for which there is room, with their pixels. `count`: how many plies there are.
fn fitting(
    series: &Series,
    paths: &[Option<&Utf8Path>],
    source: Source,
    count: usize,
) -> Result<(Vec<Option<String>>, [usize; 2]), DrawError> {
    let one = |path: &Option<&Utf8Path>, width: f64| -> Result<Option<String>, DrawError> {
        let Some(Ok(Some(sheet))) = path.map(|p| sheet::read(p, source)) else {
            return Ok(None);
        };
        series.picture(&sheet, width).map(Some)
    };
    let mut drawn = Vec::new();
    let mut size = [0; 2];
    let mut probe = 0.0;
    for width in WIDTHS {
        size = series.size(width);
        let last = width == WIDTHS[WIDTHS.len() - 1];
        // What the first one took tells which widths need not be tried.
        if !last && probe * width * width * count as f64 > 1.3 * LENGTH as f64 {
            continue;
        }
        if probe == 0.0 {
            let with = paths.iter().find(|p| p.is_some()).unwrap_or(&None);
            let length = one(with, width)?.map_or(0, |t| t.len());
            probe = length as f64 / (width * width);
            if !last && length * count > LENGTH * 13 / 10 {
                continue;
            }
        }
        drawn = (paths.par_iter())
            .map(|p| one(p, width))
            .collect::<Result<Vec<_>, _>>()?;
        let length: usize = drawn.iter().flatten().map(String::len).sum();
        if length <= LENGTH {
            break;
        }
    }
    Ok((drawn, size))
}

/// The step whose plies are drawn: the first that measured defects, else the first that looked for some, that formed, or that tested a
/// sheet. A step of which no ply can be read is told in `problems`.
fn source<'a>(
    input: &'a ReportInput,
    family: &Family,
    problems: &mut Vec<String>,
) -> Option<(&'a str, Source)> {
    for source in Source::ALL {
        // Steps without plies; and those of which a ply cannot be read at one point, and perhaps at another.
        let mut without: Vec<&str> = Vec::new();
        let mut unread: Vec<(&str, String)> = Vec::new();
        let mut found = None;
        let all = (family.points.iter()).flat_map(|p| p.instances.iter().map(move |i| (p, *i)));
        for (point, i) in all {
            let instance = &input.instances[i];
            let step = instance.base();
            // Items of a step are of zones or of passes, not of the whole.
            let is_whole = instance.record.kind == source.kind() && instance.item.is_empty();
            if !is_whole || without.contains(&step) {
                continue;
            }
            match sheet::read(&instance.artifact, source) {
                Ok(Some(_)) => {
                    found = Some((step, source));
                    break;
                }
                Ok(None) => without.push(step),
                Err(e) if unread.iter().all(|(known, _)| *known != step) => {
                    unread.push((step, format!("{}: {e}", point.name)));
                }
                Err(_) => {}
            }
        }
        // What cannot be read of the step that is drawn is told with its points.
        let lost = (unread.iter()).filter(|(step, _)| found.is_none_or(|f| f.0 != *step));
        problems.extend(
            lost.map(|(step, why)| format!("no picture of a ply of the step {step}: at {why}")),
        );
        if found.is_some() {
            return found;
        }
    }
    None
}
