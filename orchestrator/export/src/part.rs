//! What of an artifact is exported: its bodies in one frame, with the fields that are stored and those that follow from the shape.

use crate::error::ExportError;
use crate::fibres::{Sheared, deviations, sheared};
use crate::request::{Format, LengthUnit, Request};
use crate::vec3::Vec3;
use plyflow_artifact::{Artifact, BodyInfo, On};
use plyflow_model::artifact::{Forming, Sheet};
use plyflow_model::steering::Laid;
use serde_json::Value;

/// Bodies in one frame.
#[derive(Debug)]
pub struct Part {
    /// The bodies, in the order of the artifact; of plies that is the order of the stack.
    pub bodies: Vec<Body>,
    /// Time of the frame (s).
    pub time: Option<f64>,
    /// What the files say of where they come from, one line each, without the name of a format.
    pub origin: Vec<String>,
    /// Symbol of the unit of lengths.
    pub unit: &'static str,
    /// How many of it are a metre.
    pub scale: f64,
}

/// A body. Lengths are in the unit of the part.
#[derive(Debug)]
pub struct Body {
    /// Its name.
    pub name: String,
    /// Corners of a cell, 3 or 4.
    pub k: usize,
    /// Undeformed points.
    pub flat: Vec<Vec3>,
    /// Points in the frame.
    pub points: Vec<Vec3>,
    /// Corners of the cells, `k` each.
    pub cells: Vec<u32>,
    /// Whether a cell has a shape: a drape need not reach all of a ply.
    pub shaped: Vec<bool>,
    /// All fields, the stored ones first.
    pub fields: Vec<Field>,
    /// Of a ply.
    pub ply: Option<Ply>,
}

/// A field of a body.
#[derive(Debug)]
pub struct Field {
    /// Its name.
    pub name: String,
    /// Where it sits.
    pub on: On,
    /// Values a row.
    pub components: usize,
    /// Its unit, as written.
    pub unit: String,
    /// Values `[rows * components]`; NaN where there is none.
    pub values: Vec<f64>,
    /// Whether they come from the artifact, in single precision.
    pub stored: bool,
}

/// What is known of a ply.
#[derive(Debug)]
pub struct Ply {
    /// Which it is, from 1 at the tool.
    pub number: usize,
    /// What the artifact tells of it.
    pub sheet: Sheet,
    /// Directions of its fibres in the flat ply (by place in metres), where they are told.
    pub laid: Option<Laid>,
    /// Of each cell its fibres; `None` where they are not known.
    pub sheared: Vec<Option<Sheared>>,
    /// Of each cell its thickness at constant volume (in the unit of lengths), where that of the flat ply is known.
    pub thickness: Option<Vec<f64>>,
}

impl Body {
    /// Corners of a cell.
    pub fn corners(&self, cell: usize) -> &[u32] {
        &self.cells[cell * self.k..(cell + 1) * self.k]
    }

    /// Number of cells.
    pub fn count(&self) -> usize {
        self.cells.len() / self.k
    }

    /// The cells that have a shape, and fibres where the ply has any.
    pub fn usable(&self) -> Vec<usize> {
        let known = |cell: &usize| match &self.ply {
            Some(ply) if ply.laid.is_some() => ply.sheared[*cell].is_some(),
            _ => true,
        };
        let shaped = (0..self.count()).filter(|c| self.shaped[*c]);
        shaped.filter(known).collect()
    }

    /// Says how many cells are not in a file that cannot hold cells without a shape.
    pub fn tell_missing(&self, told: &mut Vec<String>) {
        let missing = self.count() - self.usable().len();
        if missing > 0 {
            told.push(format!(
                "{}: {missing} of {} cells have no shape (a drape does not reach them), and are left out",
                self.name,
                self.count()
            ));
        }
    }
}

impl Part {
    /// Reads what is asked for.
    pub fn read(
        artifact: &Artifact,
        request: &Request,
        frame: Option<u64>,
        told: &mut Vec<String>,
    ) -> Result<Self, ExportError> {
        if artifact.contents().bodies.is_empty() {
            return Err(ExportError::NoBodies(artifact.kind().to_owned()));
        }
        let plies = plies(artifact)?;
        let names = chosen(artifact, request, &plies)?;
        let mut bodies = Vec::new();
        for name in names {
            let ply = plies.iter().position(|s| s.name == name);
            let ply = ply.map(|at| (at + 1, &plies[at]));
            let mut body = read_body(artifact, name, frame, ply, told)?;
            if request.unit != LengthUnit::Metre {
                rescale(&mut body, request.unit);
            }
            bodies.push(body);
        }
        let time = frame.and_then(|k| artifact.times().get(k as usize).copied());
        Ok(Self {
            origin: origin(artifact, frame, time, request),
            bodies,
            time,
            unit: request.unit.symbol(),
            scale: request.unit.per_metre(),
        })
    }
}

/// The plies that an artifact tells of; none of another kind than `forming`.
fn plies(artifact: &Artifact) -> Result<Vec<Sheet>, ExportError> {
    if artifact.kind() != "forming" {
        return Ok(Vec::new());
    }
    let forming: Forming = serde_json::from_str(artifact.attributes())?;
    let there = |s: &&Sheet| artifact.contents().body(&s.name).is_some();
    Ok(forming.plies().filter(there).cloned().collect())
}

fn chosen<'a>(
    artifact: &'a Artifact,
    request: &Request,
    plies: &[Sheet],
) -> Result<Vec<&'a str>, ExportError> {
    let all: Vec<&str> = artifact
        .contents()
        .bodies
        .iter()
        .map(|b| b.name.as_str())
        .collect();
    let is_ply = |name: &str| plies.iter().any(|s| s.name == name);
    let format = request.format.name();
    for name in &request.bodies {
        if !all.contains(&name.as_str()) {
            let there = all.iter().map(ToString::to_string).collect();
            return Err(ExportError::NoBody {
                name: name.clone(),
                there,
            });
        }
        if request.format == Format::Dxf && !is_ply(name) {
            let plies = plies.iter().map(|s| s.name.clone()).collect();
            return Err(ExportError::NotAPly {
                name: name.clone(),
                format,
                plies,
            });
        }
    }
    let wanted = |name: &str| match request.bodies.is_empty() {
        true => request.format == Format::Vtu || is_ply(name),
        false => request.bodies.iter().any(|b| b == name),
    };
    let found: Vec<&str> = all.iter().copied().filter(|name| wanted(name)).collect();
    if found.is_empty() {
        return Err(ExportError::NoPlies {
            kind: artifact.kind().to_owned(),
            format,
            bodies: match request.format {
                Format::Dxf => Vec::new(),
                _ => all.iter().map(ToString::to_string).collect(),
            },
        });
    }
    Ok(found)
}

/// Values that stand once in an artifact without frames, too: there are no fields then.
fn read_fields(
    artifact: &Artifact,
    info: &BodyInfo,
    frame: u64,
) -> Result<Vec<Field>, ExportError> {
    let mut fields = Vec::new();
    for f in &info.fields {
        fields.push(Field {
            name: f.name.clone(),
            on: f.on,
            components: f.components as usize,
            unit: f.unit.clone(),
            values: artifact.frame_field(&info.name, frame, f.on, &f.name)?,
            stored: true,
        });
    }
    Ok(fields)
}

fn read_body(
    artifact: &Artifact,
    name: &str,
    frame: Option<u64>,
    ply: Option<(usize, &Sheet)>,
    told: &mut Vec<String>,
) -> Result<Body, ExportError> {
    let info = artifact.body(name)?;
    let (flat, cells) = artifact.mesh(name)?;
    let points = match frame {
        Some(frame) => artifact.frame_points(name, frame)?,
        None => flat.clone(),
    };
    let k = info.nodes_per_cell as usize;
    let fields = match frame {
        Some(frame) => read_fields(artifact, info, frame)?,
        None => Vec::new(),
    };
    let draped = fields
        .iter()
        .find(|f| f.name == "draped" && f.on == On::Cells);
    let shaped = match draped {
        Some(field) => field.values.iter().map(|v| *v == 1.0).collect(),
        None => vec![true; cells.len() / k],
    };
    let mut body = Body {
        name: name.to_owned(),
        k,
        flat: Vec::new(),
        points: Vec::new(),
        cells,
        shaped,
        fields,
        ply: None,
    };
    (body.flat, body.points) = (flat, points);
    if info.moving {
        let values = body.flat.as_flattened().to_vec();
        add(&mut body, "undeformed", On::Points, 3, "m", values, told);
    }
    if let Some((number, sheet)) = ply {
        derive(&mut body, number, sheet, told);
    }
    Ok(body)
}

/// Gives lengths in another unit, after all has been computed: what is no length keeps its bits.
fn rescale(body: &mut Body, unit: LengthUnit) {
    let scale = unit.per_metre();
    for p in body.flat.iter_mut().chain(&mut body.points) {
        *p = p.map(|x| x * scale);
    }
    for field in body.fields.iter_mut().filter(|f| f.unit == "m") {
        unit.symbol().clone_into(&mut field.unit);
        field.values.iter_mut().for_each(|v| *v *= scale);
    }
    if let Some(thickness) = body.ply.as_mut().and_then(|p| p.thickness.as_mut()) {
        thickness.iter_mut().for_each(|v| *v *= scale);
    }
}

/// Adds a field that is computed here, unless the artifact has one of that name.
fn add(
    body: &mut Body,
    name: &str,
    on: On,
    components: usize,
    unit: &str,
    values: Vec<f64>,
    told: &mut Vec<String>,
) {
    if body.fields.iter().any(|f| f.name == name && f.on == on) {
        told.push(format!(
            "{}: the artifact has a field '{name}' of its own, which is written instead of the one that is computed here",
            body.name
        ));
        return;
    }
    body.fields.push(Field {
        name: name.to_owned(),
        on,
        components,
        unit: unit.to_owned(),
        values,
        stored: false,
    });
}

/// The shapes of the cells of a ply. `laid`: `None` of one whose fibres are not told, which has an area all the same.
fn shapes(body: &Body, laid: Option<&Laid>) -> Vec<Option<Sheared>> {
    let any = Laid::Straight([0.0, std::f64::consts::FRAC_PI_2]);
    let laid = laid.unwrap_or(&any);
    let of = |cell: usize| {
        let at = |points: &[Vec3]| -> Vec<Vec3> {
            let corners = body.corners(cell).iter();
            corners.map(|i| points[*i as usize]).collect()
        };
        let flat = at(&body.flat);
        let shaped = body.shaped[cell];
        shaped
            .then(|| sheared(&flat, &at(&body.points), laid.in_cell(&flat)))
            .flatten()
    };
    (0..body.count()).map(of).collect()
}

/// The fields that follow from the shape of a ply. What the artifact does not tell is said, and no field of it is made.
fn derive(body: &mut Body, number: usize, sheet: &Sheet, told: &mut Vec<String>) {
    // A ply without fibres has an area all the same.
    let laid = sheet.laid();
    let shapes = shapes(body, laid.as_ref());
    let over = |value: f64| -> Vec<f64> {
        let of = |s: &Option<Sheared>| s.map_or(f64::NAN, |s| value / s.area_ratio);
        shapes.iter().map(of).collect()
    };
    let thickness = (sheet.thickness > 0.0).then(|| over(sheet.thickness));
    let cells = On::Cells;
    add(
        body,
        "ply",
        cells,
        1,
        "1",
        vec![number as f64; shapes.len()],
        told,
    );
    let mut unknown = Vec::new();
    match &laid {
        Some(laid) => add_fibres(body, &shapes, laid, told),
        None => unknown.push("its fibre directions"),
    }
    match &thickness {
        Some(values) => add(body, "thickness", cells, 1, "m", values.clone(), told),
        None => unknown.push("its thickness"),
    }
    match sheet.areal_mass.map(over) {
        Some(values) => add(body, "areal_mass", cells, 1, "kg/m2", values, told),
        None => unknown.push("its areal mass"),
    }
    let name = &sheet.name;
    for what in unknown {
        told.push(format!(
            "{name}: the artifact does not tell {what}, so nothing is written of that"
        ));
    }
    body.ply = Some(Ply {
        number,
        sheet: sheet.clone(),
        laid,
        sheared: shapes,
        thickness,
    });
}

/// `laid`: directions of both families in the flat ply.
fn add_fibres(body: &mut Body, shapes: &[Option<Sheared>], laid: &Laid, told: &mut Vec<String>) {
    for family in 0..2 {
        let of = |s: &Option<Sheared>| s.map_or([f64::NAN; 3], |s| s.directions[family]);
        let values = shapes.iter().flat_map(of).collect();
        let field = format!("fibre_direction_{}", family + 1);
        add(body, &field, On::Cells, 3, "1", values, told);
    }
    let angle = |s: &Option<Sheared>| s.map_or(f64::NAN, |s| s.angle);
    add(
        body,
        "fibre_angle",
        On::Cells,
        1,
        "rad",
        shapes.iter().map(angle).collect(),
        told,
    );
    // As the limit `fibre_deviation` counts them: none where the ply stands across the axis from which they are told.
    let turned = |(cell, s): (usize, &Option<Sheared>)| {
        let corners = body.corners(cell).iter();
        let flat: Vec<Vec3> = corners.map(|i| body.flat[*i as usize]).collect();
        deviations(s.as_ref()?, laid.in_cell(&flat))
    };
    let turned: Vec<Option<[f64; 2]>> = shapes.iter().enumerate().map(turned).collect();
    for family in 0..2 {
        let of = |d: &Option<[f64; 2]>| d.map_or(f64::NAN, |d| d[family]);
        let field = format!("fibre_deviation_{}", family + 1);
        let values = turned.iter().map(of).collect();
        add(body, &field, On::Cells, 1, "rad", values, told);
    }
}

/// Where the numbers come from, in lines of plain text.
fn origin(
    artifact: &Artifact,
    frame: Option<u64>,
    time: Option<f64>,
    request: &Request,
) -> Vec<String> {
    let made: Value = serde_json::from_str(artifact.provenance()).unwrap_or_default();
    let word = |v: &Value| v.as_str().unwrap_or("?").to_owned();
    let plugin = &made["plugin"];
    let mut lines = vec![format!(
        "Plyflow, {} ({} {}), artifact {}",
        request.stem,
        word(&plugin["name"]),
        word(&plugin["version"]),
        word(&made["key"])
    )];
    let unit = request.unit.symbol();
    lines.push(match (frame, time) {
        (Some(frame), Some(time)) => {
            format!("frame {frame} (from 0), time {time} s; lengths in {unit}")
        }
        _ => format!("undeformed; lengths in {unit}"),
    });
    // Names of others: nothing that ends a line or a comment.
    let plain = |c: char| {
        if c.is_ascii_graphic() || c == ' ' {
            c
        } else {
            '?'
        }
    };
    lines
        .iter()
        .map(|l| l.chars().map(plain).collect())
        .collect()
}
