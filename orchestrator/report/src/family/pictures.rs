//! Small pictures of the formed ply, one for each point: the same step and ply, the same view, scale and colours.

use super::{Family, base};
use crate::colour::{Palette, Rgb, Scale, end_of_scale};
use crate::field::bar;
use crate::input::ReportInput;
use crate::others::at_points;
use crate::raster::{Camera, Canvas, Paint, Triangles, Vec3};
use crate::read::{last_frame, open, quads};
use crate::units::shown;
use camino::Utf8Path;
use maud::{Markup, html};
use plyflow_artifact::{Artifact, BodyInfo, On};
use plyflow_model::artifact::{CensusBody, Forming};
use rayon::prelude::*;
use serde::Deserialize;

/// Pictures on a page.
pub(crate) const MOST: usize = 240;
/// Together they are about this long at most (bytes).
const LENGTH: usize = 2_400_000;
/// Widths that are tried (px), the finest first.
const WIDTHS: [f64; 9] = [360.0, 300.0, 250.0, 205.0, 170.0, 140.0, 110.0, 85.0, 60.0];
/// Height over width.
const SHAPE: f64 = 0.72;
/// Values of a ply that are looked at for the scale of colours.
const LOOKED_AT: usize = 4000;
/// Colour of a ply of which nothing is known but its shape.
const PLAIN: Rgb = [150.0, 158.0, 168.0];
/// From where the plies are seen (deg about z from +x, and above the plane).
const VIEW: [f64; 2] = [-65.0, 38.0];

/// What colours the plies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Shade {
    Distance,
    Shear,
    Deflection,
    Nothing,
}

/// The pictures.
#[derive(Debug, Default)]
pub(crate) struct Pictures {
    /// What they show.
    pub(crate) title: String,
    /// The scale of colours, with its ends in words.
    pub(crate) bar: Markup,
    /// For each point its picture as an address, if it has one.
    pub(crate) of: Vec<Option<String>>,
    /// Pixels of each.
    pub(crate) size: [usize; 2],
}

impl Shade {
    /// Title and SI unit.
    fn said(self) -> (&'static str, &'static str) {
        match self {
            Self::Distance => ("distance from the tool", "m"),
            Self::Shear => ("shear angle", "rad"),
            Self::Deflection => ("deflection along z", "m"),
            Self::Nothing => ("shape", "1"),
        }
    }

    fn scale(self, values: &[f64]) -> Scale {
        let (factor, _) = shown(self.said().1);
        let least = if self == Self::Shear { 0.02 } else { 1e-5 };
        let high = end_of_scale(values.iter().copied(), 0.995, least, factor);
        let (palette, low) = match self {
            Self::Distance | Self::Nothing => (Palette::Viridis, 0.0),
            Self::Shear => (Palette::BlueRed, -high),
            Self::Deflection => (Palette::PurpleOrange, -high),
        };
        Scale { palette, low, high }
    }
}

/// The ply that is drawn: of a step of the file, and how it is coloured.
struct Source {
    step: String,
    kind: String,
}

struct Sheet {
    name: String,
    points: Vec<Vec3>,
    mesh: Triangles,
    /// Corners of all cells that are drawn.
    used: Vec<u32>,
    values: Vec<f64>,
    shade: Shade,
}

/// Draws the pictures; `None`: the points have no plies. What cannot be read is added to `problems`.
///
/// # Errors
/// When a picture cannot be encoded.
pub(crate) fn draw(
    input: &ReportInput,
    family: &Family,
    problems: &mut Vec<String>,
) -> Result<Option<Pictures>, String> {
    let Some(source) = source(input, family) else {
        return Ok(None);
    };
    let of = |p: usize| -> Option<&Utf8Path> {
        let own = family.points[p].instances.iter();
        let mut own = own.map(|i| &input.instances[*i]);
        let found = own.find(|i| base(i) == source.step && i.record.kind == source.kind)?;
        Some(&found.artifact)
    };
    let paths: Vec<Option<&Utf8Path>> = (0..family.points.len().min(MOST)).map(of).collect();
    let camera = Camera::oblique(VIEW[0].to_radians(), VIEW[1].to_radians());
    // Once for the view and the colours, and once to draw: so many meshes have no room together.
    let look = |path: &Option<&Utf8Path>| {
        let sheet = path.map(|p| read(p, &source.kind));
        sheet.map(|s| s.map(|s| Look::of(&s, &camera)))
    };
    let looks: Vec<Option<Result<Look, String>>> = paths.par_iter().map(look).collect();
    let mut seen = Vec::new();
    for (p, look) in looks.into_iter().enumerate() {
        match look {
            Some(Ok(look)) => seen.push(look),
            Some(Err(e)) => problems.push(format!("picture of {}: {e}", family.points[p].name)),
            None => {}
        }
    }
    let Some(first) = seen.first() else {
        return Ok(None);
    };
    let (shade, name) = (first.shade, first.name.clone());
    let values: Vec<f64> = seen.iter().flat_map(|l| l.values.iter().copied()).collect();
    let scale = shade.scale(&values);
    let corners: Vec<Vec3> = seen.iter().flat_map(|l| l.corners).collect();
    let one = |path: &Option<&Utf8Path>, width: f64| -> Result<Option<String>, String> {
        let Some(Ok(sheet)) = path.map(|p| read(p, &source.kind)) else {
            return Ok(None);
        };
        let (camera, size) = camera.fit(corners.iter(), [width, SHAPE * width], 3.0);
        let mut canvas = Canvas::new(size);
        let paint = match shade {
            Shade::Nothing => Paint::Plain(PLAIN),
            _ if sheet.shade == shade => Paint::Field(&sheet.values, scale),
            _ => Paint::Plain(PLAIN),
        };
        canvas.surface(&camera, &sheet.points, &sheet.mesh, paint, true, 0.0);
        canvas.data_url().map(Some).map_err(|e| e.to_string())
    };
    let mut drawn = Vec::new();
    let mut size = [0; 2];
    let mut probe = 0.0;
    for width in WIDTHS {
        size = camera.fit(corners.iter(), [width, SHAPE * width], 3.0).1;
        let last = width == WIDTHS[WIDTHS.len() - 1];
        // What the first one took tells which widths need not be tried.
        if !last && probe * width * width * seen.len() as f64 > 1.3 * LENGTH as f64 {
            continue;
        }
        if probe == 0.0 {
            let with = paths.iter().find(|p| p.is_some()).unwrap_or(&None);
            let length = one(with, width)?.map_or(0, |t| t.len());
            probe = length as f64 / (width * width);
            if !last && length * seen.len() > LENGTH * 13 / 10 {
                continue;
            }
        }
        drawn = paths
            .par_iter()
            .map(|p| one(p, width))
            .collect::<Result<Vec<_>, _>>()?;
        let length: usize = drawn.iter().flatten().map(String::len).sum();
        if length <= LENGTH {
            break;
        }
    }
    drawn.resize(family.points.len(), None);
    let (what, unit) = shade.said();
    let (factor, unit) = shown(unit);
    let said = if unit.is_empty() {
        what.to_owned()
    } else {
        format!("{what} ({unit})")
    };
    Ok(Some(Pictures {
        title: format!("ply {name} of the step {}, {said}", source.step),
        bar: if shade == Shade::Nothing {
            html! {}
        } else {
            bar(
                "study-pictures-scale",
                scale,
                factor,
                &[],
                &format!("Scale of the pictures: {said}"),
            )
        },
        of: drawn,
        size,
    }))
}

/// The step whose plies are drawn: the first that measured defects, else the first that looked for some, that formed, or that tested a
/// sheet.
fn source(input: &ReportInput, family: &Family) -> Option<Source> {
    for kind in ["measurement", "defects", "forming", "coupon"] {
        let mut tried: Vec<&str> = Vec::new();
        for point in &family.points {
            for i in &point.instances {
                let instance = &input.instances[*i];
                let step = base(instance);
                // Items of a step are of zones or of passes, not of the whole.
                if instance.record.kind != kind
                    || !instance.item.is_empty()
                    || tried.contains(&step)
                {
                    continue;
                }
                tried.push(step);
                if read(&instance.artifact, kind).is_ok() {
                    return Some(Source {
                        step: step.to_owned(),
                        kind: kind.to_owned(),
                    });
                }
            }
        }
    }
    None
}

/// What the first pass keeps of a ply.
struct Look {
    name: String,
    shade: Shade,
    /// The points that lie farthest to the left, right, bottom and top.
    corners: [Vec3; 4],
    values: Vec<f64>,
}

impl Look {
    fn of(sheet: &Sheet, camera: &Camera) -> Self {
        let used = || sheet.used.iter().map(|i| *i as usize);
        let first = used().next().unwrap_or(0);
        let mut corners = [sheet.points[first]; 4];
        let place = |p: Vec3| camera.project(p);
        for p in used().map(|i| &sheet.points[i]) {
            let at = place(*p);
            for (k, (d, sign)) in [(0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0)]
                .into_iter()
                .enumerate()
            {
                if sign * at[d] > sign * place(corners[k])[d] {
                    corners[k] = *p;
                }
            }
        }
        let apart = sheet.used.len().div_ceil(LOOKED_AT).max(1);
        Self {
            name: sheet.name.clone(),
            shade: sheet.shade,
            corners,
            values: used().step_by(apart).map(|i| sheet.values[i]).collect(),
        }
    }
}

/// The uppermost ply of an artifact, in its last frame.
fn read(path: &Utf8Path, kind: &str) -> Result<Sheet, String> {
    let artifact = open(path)?;
    let frame = last_frame(&artifact)?;
    let body = uppermost(&artifact, kind).ok_or("it has no ply")?;
    let name = &body.name;
    let (flat, cells) = artifact.mesh(name).map_err(|e| e.to_string())?;
    let cells = quads(name, &cells, body.nodes_per_cell)?;
    let points = artifact
        .frame_points(name, frame)
        .map_err(|e| e.to_string())?;
    if points.is_empty() || points.iter().flatten().any(|v| !v.is_finite()) {
        return Err(format!("body '{name}' has no place"));
    }
    let field = |on, what: &str| artifact.frame_field(name, frame, on, what).ok();
    // What is not draped has no shear and no distance, though zeros stand there.
    let draped = field(On::Cells, "draped").filter(|d| d.len() == cells.len());
    let is_draped = |i: usize| draped.as_ref().is_none_or(|d| d[i] > 0.5);
    let kept: Vec<usize> = (0..cells.len()).filter(|i| is_draped(*i)).collect();
    let shear = field(On::Cells, "shear_angle").filter(|s| s.len() == cells.len());
    let shear = shear.map(|s| kept.iter().map(|i| s[*i]).collect::<Vec<f64>>());
    let cells: Vec<[u32; 4]> = kept.iter().map(|i| cells[*i]).collect();
    let deflection = || flat.iter().zip(&points).map(|(a, b)| b[2] - a[2]).collect();
    let (shade, values) = match kind {
        "coupon" => (Shade::Deflection, deflection()),
        _ => match (field(On::Points, "nodal_distance"), shear) {
            (Some(d), _) if d.len() == points.len() => (Shade::Distance, d),
            (_, Some(s)) => (Shade::Shear, at_points(&s, &cells, points.len())),
            _ => (Shade::Nothing, vec![0.0; points.len()]),
        },
    };
    Ok(Sheet {
        name: CensusBody::deserialize(&body.attributes).map_or(name.to_owned(), |told| told.ply),
        mesh: Triangles::new(points.len(), cells.as_flattened(), 4),
        used: cells.as_flattened().to_vec(),
        points,
        values,
        shade,
    })
}

fn uppermost<'a>(artifact: &'a Artifact, kind: &str) -> Option<&'a BodyInfo> {
    let bodies = &artifact.contents().bodies;
    let is_sheet = |b: &&BodyInfo| b.nodes_per_cell == 4 && b.cells > 0 && b.points > 0;
    let sheets = || bodies.iter().filter(is_sheet);
    match kind {
        // Bodies stand in the order of the stack, from the tool.
        "measurement" | "defects" => sheets().next_back(),
        "forming" => {
            let told: Forming = serde_json::from_str(artifact.attributes()).ok()?;
            if told.zone.is_some() {
                return None;
            }
            let ply = told.plies().last()?;
            sheets().find(|b| b.name == ply.name)
        }
        _ => sheets().find(|b| b.moving && b.name != "tool"),
    }
}
