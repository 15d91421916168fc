//! The formed plies, the finer plies of the zones and the tool of a study, as data for the rotatable view of the page.

mod body;
mod fibres;
mod pack;
mod thin;
mod way;

use crate::draw::error::DrawError;
use crate::draw::legend::{Legend, Others};
use crate::draw::sharpness::Sharpness;
use crate::draw::view::lift;
use crate::plain::{Frames, Locator, Place, Ply, Tool, Vec3, normal, outline};
use body::Body;
use fibres::ToldFibres;
use pack::{Extent, Stream, script_json};
use plyflow_model::artifact::Zone;
use serde::Serialize;
use thin::Thinned;
use way::{ToldWay, Way};

/// Points of all meshes of a page at full sharpness; about 10 bytes each on the page.
const POINTS: f64 = 120_000.0;
/// Fields besides those that are mapped take so many bytes on a page at full sharpness, at most. A value is one of 256 places on its scale,
/// which is what a screen shows.
const ROOM: f64 = 1_200_000.0;
/// Sharp edges of a tool; more are no edges but a rough surface.
const EDGES: usize = 6000;
/// Meshes of fewer points than this would be stamps: they are left out.
const LEAST: usize = 60;
/// Points along the outline of a zone are this far apart (m).
const OUTLINE_STEP: f64 = 4e-3;

/// What a view shows.
pub(crate) struct Shown<'a> {
    pub(crate) tool: Option<&'a Tool>,
    /// Of the global run.
    pub(crate) plies: &'a [Ply],
    /// The finer plies of the local runs, each with the name of its zone.
    pub(crate) finer: Vec<(&'a str, &'a Ply)>,
    pub(crate) zones: &'a [Zone],
    pub(crate) places: &'a [Place],
    /// The fields that are mapped.
    pub(crate) legends: Vec<Legend>,
    /// The plies of the global run on their way.
    pub(crate) frames: Option<&'a Frames>,
    /// Plies of other views that share the scales.
    pub(crate) beside: &'a [&'a Ply],
}

/// A scene, ready for the page.
#[derive(Debug)]
pub(crate) struct Scene {
    /// What the script reads.
    pub(crate) json: String,
    /// What can be shown and hidden.
    pub(crate) seen: Seen,
    /// What is shown coarser than it is, or not at all.
    pub(crate) notes: Vec<String>,
    /// The fields of the menu.
    pub(crate) legends: Vec<Legend>,
    /// Fields that are the same everywhere, and those for which the page has no room.
    pub(crate) even: Vec<String>,
    pub(crate) left_out: Vec<String>,
    /// Whether there are defects to choose from.
    pub(crate) defects: bool,
    /// How far apart lines of fibres are in the flat ply (m), where there are any.
    pub(crate) fibres: Option<f64>,
    /// The moments that can be shown, the last one included; empty without a way.
    pub(crate) times: Vec<f64>,
    /// How exact places on the way are (m).
    pub(crate) coarse: f64,
}

/// What of a scene can be shown and hidden.
#[derive(Debug)]
pub(crate) struct Seen {
    /// Names of plies and of zones.
    pub(crate) plies: Vec<String>,
    pub(crate) zones: Vec<String>,
    pub(crate) tool: bool,
    /// Whether the cells of all plies are those that were computed.
    pub(crate) elements: bool,
}

/// What the script is told. Places are in metres; arrays lie in `data`, in the order of what is listed here.
#[derive(Debug, Serialize)]
struct Told {
    extent: Extent,
    /// All is drawn this far (m) before the tool, which mid-planes touch and straight sides cut.
    lift: f64,
    fields: Vec<ToldField>,
    bodies: Vec<ToldBody>,
    outlines: Vec<ToldOutline>,
    defects: Vec<ToldDefect>,
    way: Option<ToldWay>,
    data: String,
}

#[derive(Debug, Serialize)]
struct ToldField {
    name: String,
    /// Colours of the scale, equally spaced.
    stops: Vec<String>,
}

/// A mesh: in `data` its points, its cells and its fields.
#[derive(Debug, Serialize)]
struct ToldBody {
    /// Absent: the tool.
    ply: Option<String>,
    /// Absent: the global run.
    zone: Option<String>,
    points: usize,
    /// Cells in parts: those wholly in a zone are hidden while its own, finer ply is shown.
    parts: Vec<Part>,
    /// Indices of the fields that it has.
    fields: Vec<usize>,
    /// Lines of its fibres, behind the fields.
    fibres: Vec<ToldFibres>,
    /// Sharp edges of the tool and its rim, of two points each, behind these.
    edges: usize,
}

#[derive(Debug, Serialize)]
struct Part {
    zone: Option<String>,
    cells: usize,
}

/// Lines on a ply: in `data` so many points a line.
#[derive(Debug, Serialize)]
struct ToldOutline {
    zone: String,
    ply: String,
    /// Mean normal of the ply in the zone.
    normal: Vec3,
    lines: Vec<usize>,
}

#[derive(Debug, Serialize)]
struct ToldDefect {
    id: String,
    label: String,
    ply: String,
    zone: Option<String>,
    at: Vec3,
    normal: Vec3,
    lines: Vec<usize>,
}

/// The scene of what is shown in one of `drawn` views on the page; `None` without formed plies. Long, as it writes all parts in the order in which
/// the script of the page reads them.
///
/// # Errors
/// When the data cannot be packed.
pub(crate) fn scene(
    shown: Shown<'_>,
    drawn: usize,
    sharp: Sharpness,
) -> Result<Option<Scene>, DrawError> {
    if shown.plies.is_empty() {
        return Ok(None);
    }
    let way = Way {
        frames: shown.frames,
        plies: shown.plies,
    };
    let of_page = |all: f64| (all * sharp.share()) as usize / drawn.max(1);
    let all = bodies(&shown);
    let own = all.iter().filter_map(|b| b.ply);
    let others = Others::of(&own.chain(shown.beside.iter().copied()).collect::<Vec<_>>());
    let (bodies, most, mut notes) = chosen(all, of_page(POINTS));
    let places = shown.places;
    let Some(extent) = extent(&bodies, places, way) else {
        return Ok(None);
    };
    let thinned: Vec<Thinned> = (bodies.iter())
        .map(|b| thin::thin(b.at, &b.cells, most, b.ply.is_none()))
        .collect();
    let mut legends = shown.legends;
    let left_out = choose(
        &mut legends,
        others.legends,
        &bodies,
        &thinned,
        of_page(ROOM),
    )?;
    let mut stream = Stream::default();
    let apart = fibres::apart(&bodies, of_page(fibres::POINTS));
    let pairs: Vec<_> = bodies.iter().zip(&thinned).collect();
    let lines = (shown.zones, apart);
    let told = meshes(&mut stream, &extent, &pairs, &legends, lines);
    notes.extend(bodies.iter().zip(&told).filter_map(coarser));
    let outlines = outlines(&mut stream, &extent, shown.plies, shown.zones);
    let defects = defects(&mut stream, &extent, places);
    let most = of_page(way::POINTS);
    let way = way.write(&mut stream, &extent, (&bodies, &thinned), &legends, most);
    let times = way.as_ref().map_or(Vec::new(), |w| w.times.clone());
    let coarse = way::exact(&extent);
    let seen = Seen::of(&told, &bodies);
    let told = Told {
        extent,
        lift: shown.plies.iter().map(lift).fold(0.0, f64::max),
        fields: legends.iter().map(field).collect(),
        bodies: told,
        outlines,
        defects,
        way,
        data: stream.text()?,
    };
    Ok(Some(Scene {
        json: script_json(&told)?,
        seen,
        notes,
        legends,
        even: others.even,
        left_out,
        defects: !places.is_empty(),
        fibres: apart,
        times,
        coarse,
    }))
}

/// Writes all meshes with their fields, lines of fibres and edges. `lines`: the zones, and how far apart lines of fibres are (m).
fn meshes(
    stream: &mut Stream,
    extent: &Extent,
    pairs: &[(&Body<'_>, &Thinned)],
    legends: &[Legend],
    (zones, apart): (&[Zone], Option<f64>),
) -> Vec<ToldBody> {
    let mut all = Vec::new();
    for (body, found) in pairs {
        let inside = refined(body, pairs, zones);
        let mut told = write(stream, extent, (body, found), &inside, legends);
        told.fibres = fibres::write(stream, extent, body, &inside, apart);
        told.edges = edges(stream, extent, body);
        all.push(told);
    }
    all
}

/// The box of all that is shown, wherever it is on its way; `None` without a point.
fn extent(bodies: &[Body<'_>], places: &[Place], way: Way<'_>) -> Option<Extent> {
    let ends = (places.iter()).flat_map(|p| p.lines.iter().flat_map(|l| &l.formed));
    let all = bodies.iter().flat_map(|b| b.formed).chain(ends);
    Extent::of(all.chain(way.points()))
}

impl Seen {
    fn of(told: &[ToldBody], bodies: &[Body<'_>]) -> Self {
        Self {
            plies: distinct(told.iter().filter_map(|b| b.ply.clone())),
            zones: distinct(told.iter().filter_map(|b| b.zone.clone())),
            tool: told.iter().any(|b| b.ply.is_none()),
            elements: are_elements(bodies, told),
        }
    }
}

/// Whether the cells of all plies are those that were computed.
fn are_elements(bodies: &[Body<'_>], told: &[ToldBody]) -> bool {
    let mut pairs = bodies.iter().zip(told);
    pairs.all(|(b, t)| b.ply.is_none() || t.points == b.formed.len())
}

/// Says how much of a mesh is shown, if that is not all of it.
fn coarser((body, told): (&Body<'_>, &ToldBody)) -> Option<String> {
    let (name, left, whole) = (body.name(), told.points, body.formed.len());
    (left < whole).then(|| format!("{name} with {left} of its {whole} points"))
}

/// The zones in which a ply of the global run is there as a finer one, too.
fn refined<'a>(
    body: &Body<'_>,
    pairs: &[(&Body<'_>, &Thinned)],
    zones: &'a [Zone],
) -> Vec<&'a Zone> {
    let (Some(ply), None) = (body.ply, body.zone) else {
        return Vec::new();
    };
    let is_finer = |b: &Body<'_>, zone: &Zone| {
        b.zone == Some(zone.name.as_str()) && b.ply.is_some_and(|p| p.name == ply.name)
    };
    let has = |zone: &&Zone| pairs.iter().any(|(b, _)| is_finer(b, zone));
    zones.iter().filter(has).collect()
}

/// Names in the order in which they first come.
fn distinct(all: impl Iterator<Item = String>) -> Vec<String> {
    let mut names = Vec::new();
    for name in all {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

fn bodies<'a>(shown: &Shown<'a>) -> Vec<Body<'a>> {
    let of_ply = |ply: &'a Ply, zone| Body {
        ply: Some(ply),
        zone,
        at: &ply.flat,
        formed: &ply.formed,
        cells: ply.cells.iter().map(|c| c.to_vec()).collect(),
    };
    let tool = shown.tool.iter().map(|t| Body {
        ply: None,
        zone: None,
        at: &t.points,
        formed: &t.points,
        cells: t.cells.surface(),
    });
    let global = shown.plies.iter().map(|p| of_ply(p, None));
    let local = shown.finer.iter().map(|(zone, p)| of_ply(p, Some(*zone)));
    tool.chain(global).chain(local).collect()
}

/// The bodies that are shown, the most points of each, and what is left out: finer plies, when a fair share of the budget
/// is too little for a shape.
fn chosen(mut bodies: Vec<Body<'_>>, budget: usize) -> (Vec<Body<'_>>, usize, Vec<String>) {
    let most = |bodies: &[Body]| {
        let sizes: Vec<usize> = bodies.iter().map(|b| b.formed.len()).collect();
        thin::share(&sizes, budget)
    };
    let mut notes = Vec::new();
    if most(&bodies) < LEAST {
        bodies.retain(|b| b.zone.is_none());
        notes.push("the finer plies of the zones not at all: there are too many".to_owned());
    }
    let most = most(&bodies).max(LEAST);
    (bodies, most, notes)
}

/// Adds `others` to the fields that are shown as long as they take no more than `room` bytes on the page together, and gives the titles of
/// those that are left out.
fn choose(
    legends: &mut Vec<Legend>,
    others: Vec<Legend>,
    bodies: &[Body<'_>],
    thinned: &[Thinned],
    mut room: usize,
) -> Result<Vec<String>, DrawError> {
    let mut left_out = Vec::new();
    for legend in others {
        let mut alone = Stream::default();
        for (body, found) in bodies.iter().zip(thinned) {
            shade(&mut alone, body, found, &legend);
        }
        let size = alone.text()?.len();
        if size <= room {
            room -= size;
            legends.push(legend);
        } else {
            left_out.push(legend.title().to_owned());
        }
    }
    Ok(left_out)
}

/// Writes a field of a mesh; `false` when the mesh does not have it.
fn shade(stream: &mut Stream, body: &Body<'_>, found: &Thinned, legend: &Legend) -> bool {
    let Some(values) = body.ply.and_then(|p| legend.at_points(p)) else {
        return false;
    };
    let place = |i: &u32| legend.scale.place(values[*i as usize]);
    stream.places(found.points.iter().map(place));
    true
}

/// Writes a mesh.
fn write(
    stream: &mut Stream,
    extent: &Extent,
    (body, found): (&Body<'_>, &Thinned),
    zones: &[&Zone],
    legends: &[Legend],
) -> ToldBody {
    let of = |values: &[Vec3], i: u32| values[found.points[i as usize] as usize];
    stream.points(
        extent,
        found.points.iter().map(|i| body.formed[*i as usize]),
    );
    // By part: those in no zone, then those of each zone.
    let within = |c: &Vec<u32>, z: &Zone| {
        c.iter().all(|i| {
            let p = of(body.at, *i);
            (0..2).all(|d| (z.bounds[d]..=z.bounds[d + 2]).contains(&p[d]))
        })
    };
    let zone_of = |c: &Vec<u32>| zones.iter().position(|z| within(c, z));
    let places: Vec<Option<usize>> = found.cells.iter().map(zone_of).collect();
    let mut parts = Vec::new();
    for part in std::iter::once(None).chain((0..zones.len()).map(Some)) {
        let cells = found.cells.iter().zip(&places).filter(|(_, p)| **p == part);
        let cells: Vec<&[u32]> = cells.map(|(c, _)| c.as_slice()).collect();
        stream.cells(cells.iter().copied());
        parts.push(Part {
            zone: part.map(|z| zones[z].name.clone()),
            cells: cells.len(),
        });
    }
    let mut fields = Vec::new();
    for (k, legend) in legends.iter().enumerate() {
        if shade(stream, body, found, legend) {
            fields.push(k);
        }
    }
    ToldBody {
        ply: body.ply.map(|p| p.name.clone()),
        zone: body.zone.map(str::to_owned),
        points: found.points.len(),
        parts,
        fields,
        fibres: Vec::new(),
        edges: 0,
    }
}

/// Writes the sharp edges of a tool, as it was before it was thinned; gives their number. Of a tool that is rough everywhere there are none.
fn edges(stream: &mut Stream, extent: &Extent, body: &Body<'_>) -> usize {
    let mut all = match body.ply {
        Some(_) => Vec::new(),
        None => thin::sharp_edges(body.at, &body.cells),
    };
    if all.len() > EDGES {
        all.clear();
    }
    for side in &all {
        stream.points(extent, side.iter().map(|i| body.formed[*i as usize]));
    }
    all.len()
}

fn field(legend: &Legend) -> ToldField {
    let stops = legend.scale.palette.css().into_iter();
    ToldField {
        name: legend.title().to_owned(),
        stops: stops.map(|s| s.1).collect(),
    }
}

/// The outlines of the zones on the plies of the global run.
fn outlines(
    stream: &mut Stream,
    extent: &Extent,
    plies: &[Ply],
    zones: &[Zone],
) -> Vec<ToldOutline> {
    let mut all = Vec::new();
    for ply in plies {
        let locator = Locator::new(&ply.flat, &ply.cells);
        for zone in zones {
            let lines = outline_on(&locator, ply, zone);
            if lines.is_empty() {
                continue;
            }
            for line in &lines {
                stream.points(extent, line.iter().copied());
            }
            all.push(ToldOutline {
                zone: zone.name.clone(),
                ply: ply.name.clone(),
                normal: normal(&ply.flat, &ply.formed, &inside(ply, zone)),
                lines: lines.iter().map(Vec::len).collect(),
            });
        }
    }
    all
}

/// Cells with a corner in a zone.
fn inside(ply: &Ply, zone: &Zone) -> Vec<[u32; 4]> {
    let within = |i: &u32| {
        let p = ply.flat[*i as usize];
        (0..2).all(|d| (zone.bounds[d]..=zone.bounds[d + 2]).contains(&p[d]))
    };
    let any = |c: &&[u32; 4]| c.iter().any(within);
    ply.cells.iter().filter(any).copied().collect()
}

/// The parts of a zone's outline that lie on a ply.
fn outline_on(locator: &Locator<'_>, ply: &Ply, zone: &Zone) -> Vec<Vec<Vec3>> {
    let mut lines = vec![Vec::new()];
    for at in outline(zone.bounds, OUTLINE_STEP) {
        match locator.carried(at, &ply.formed) {
            Some(p) => lines.last_mut().expect("never empty").push(p),
            None => lines.push(Vec::new()),
        }
    }
    lines.retain(|l| l.len() > 1);
    lines
}

fn defects(stream: &mut Stream, extent: &Extent, places: &[Place]) -> Vec<ToldDefect> {
    let one = |place: &Place| {
        for line in &place.lines {
            stream.points(extent, line.formed.iter().copied());
        }
        ToldDefect {
            id: place.id.clone(),
            label: place.label.clone(),
            ply: place.ply.clone(),
            zone: place.zone.clone(),
            at: place.at,
            normal: place.normal,
            lines: place.lines.iter().map(|l| l.formed.len()).collect(),
        }
    };
    places.iter().map(one).collect()
}
