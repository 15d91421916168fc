//! What the step is given by others: an element size, zones, the boundary of a zone.

use crate::error::{FormingError, Result};
use crate::request::cut::{LocalInput, LocalSheet, RecordedWay, Start};
use crate::request::parameters::Parameters;
use plyflow_geometry::vec3::Vec3;
use plyflow_model::artifact::{self, Boundary, MeshStudy, Rectangle, Zones};
use plyflow_model::material::MaterialEntry;
use plyflow_model::scene::{Laid, PartMotion, Process, Scene, Sheet, SheetKind};
use plyflow_sdk::{Host, Input, Log};

/// The element size (m) that a mesh study advises, if there is one.
pub fn advised_size(host: &Host) -> Result<Option<f64>> {
    let studies = host.inputs_of("meshes")?;
    let Some(study) = studies.first() else {
        return Ok(None);
    };
    if !host.inputs_of("boundary")?.is_empty() {
        return Err(FormingError::Input(
            "`meshes` is for runs of a whole scene; the meshes of a zone come with its `boundary`"
                .into(),
        ));
    }
    let MeshStudy {
        advised_element_size,
        ..
    } = host.attributes(study)?;
    match advised_element_size {
        Some(size) if size > 0.0 => Ok(Some(size)),
        _ => Err(FormingError::Input(format!(
            "'{}' advises no element size",
            study.step
        ))),
    }
}

/// Boxes of the zones in which alone plies have `element`; none without the input `zones`.
pub fn bending_zones(host: &Host, p: &Parameters) -> Result<Vec<Rectangle>> {
    let inputs = host.inputs_of("zones")?;
    let steps: Vec<&str> = inputs.iter().map(|i| i.step.as_str()).collect();
    match (&p.element_elsewhere, inputs.is_empty()) {
        (None, true) => return Ok(Vec::new()),
        (Some(choice), true) => {
            return Err(FormingError::Input(format!(
                "element_elsewhere: given '{}', but no `zones`; expected the zones in which plies have `element` instead. Wire the \
                 input `zones`, or leave out `element_elsewhere`",
                choice.plugin
            )));
        }
        (None, false) => {
            return Err(FormingError::Input(format!(
                "zones: given '{}', but no `element_elsewhere`; expected the plies' element outside of the zones. Give \
                 `element_elsewhere: m4`, or do not wire `zones`",
                steps.join(", ")
            )));
        }
        (Some(_), false) => {}
    }
    if !host.inputs_of("boundary")?.is_empty() {
        return Err(FormingError::Input("zones: given beside `boundary`; expected one of them: `zones` are for the run of a whole scene in which plies bend in the \
             zones alone, `boundary` makes the run that of one zone".into()));
    }
    let mut all = Vec::new();
    for input in &inputs {
        let Zones { zones, .. } = host.attributes(input)?;
        all.extend(zones.iter().map(|z| z.bounds));
    }
    if all.is_empty() {
        let text = format!("'{}' holds no zone: no ply bends", steps.join(", "));
        host.log(Log::Info, &text);
    }
    Ok(all)
}

/// What drives a zone.
///
/// # Errors
/// When it is of another scene, or not as boundaries are.
pub fn read_boundary(host: &Host, input: &Input, scene: &Scene) -> Result<LocalInput> {
    let boundary: Boundary = host.attributes(input)?;
    fits(scene, &boundary, &input.step)?;
    let series = |name: &str| host.array_f64(input, name).map(|(v, _)| v);
    let (time, sheets) = read_motion(host, input)?;
    Ok(LocalInput {
        cavity: series("cavity_pressure")?,
        bag: series("bag_pressure")?,
        frame: series("frame_height")?,
        time,
        sheets,
        ways: read_ways(host, input, scene)?,
        zone: boundary.zone,
        element_size: boundary.element_size,
        slower: boundary.slower.unwrap_or(1.0),
    })
}

/// Ways of the parts of the scene that are pressed, as far as the boundary tells them.
fn read_ways(host: &Host, input: &Input, scene: &Scene) -> Result<Vec<RecordedWay>> {
    let names: Vec<&str> = match &scene.process {
        Process::DoubleDiaphragm(_) | Process::SingleDiaphragm(_) => Vec::new(),
        Process::Press(_) => vec!["holder"],
        Process::Stamping(stamping) => (stamping.parts.iter())
            .filter(|p| matches!(p.motion, Some(PartMotion::Pressed(_))))
            .map(|p| p.name.as_str())
            .collect(),
    };
    let path = |name: &str| format!("parts/{name}/way");
    let told = |name: &&str| host.array_info(input, &path(name)).is_some();
    let read = |name: &str| {
        Ok(RecordedWay {
            name: name.to_owned(),
            time: host.array_f64(input, "parts/time")?.0,
            way: host.array_f64(input, &path(name))?.0,
        })
    };
    names.into_iter().filter(told).map(read).collect()
}

/// Whether a boundary is of this scene: its name, and what the run that it was made of told of its sheets.
fn fits(scene: &Scene, boundary: &Boundary, step: &str) -> Result<()> {
    let differs = |what: &str, there: &str, here: &str| {
        Err(FormingError::Input(format!(
            "scene: {what} is {here}, and {there} in the run that '{step}' was made of; expected the same scene for a zone as for the whole"
        )))
    };
    if let Some(there) = boundary.scene.as_ref().filter(|n| **n != scene.name) {
        return differs(
            "its name",
            &format!("'{there}'"),
            &format!("'{}'", scene.name),
        );
    }
    for told in &boundary.sheets {
        let name = &told.name;
        let Some(sheet) = scene.sheets.iter().find(|s| s.name == *name) else {
            return differs(&format!("sheet '{name}'"), "there", "not there");
        };
        let thickness = match &sheet.material {
            MaterialEntry::Inline(material) => Some(material.thickness.si()),
            _ => None,
        };
        let laid = match sheet.kind {
            SheetKind::Ply => sheet.fibres(),
            SheetKind::Diaphragm => None,
        };
        let degree = 1f64.to_degrees();
        let [fibre_1, fibre_2] = [0, 1].map(|k| laid.map(|fibres| fibres[k]));
        steered_alike(sheet, told).or_else(|there_here| {
            let [there, here] = there_here;
            differs(
                &format!("the direction of the fibres of sheet '{name}'"),
                &there,
                &here,
            )
        })?;
        let held = [
            ("thickness", "mm", 1e3, Some(told.thickness), thickness),
            ("fibre_1", "deg", degree, told.fibre_1, fibre_1),
            ("fibre_2", "deg", degree, told.fibre_2, fibre_2),
        ];
        for (what, unit, factor, there, here) in held {
            if let (Some(there), Some(here)) = (there, here)
                && (there - here).abs() > 1e-6 * here.abs().max(1e-6)
            {
                let text = |v: f64| format!("{:.4} {unit}", factor * v);
                return differs(
                    &format!("{what} of sheet '{name}'"),
                    &text(there),
                    &text(here),
                );
            }
        }
    }
    Ok(())
}

/// Whether a ply is steered alike in the run of the whole and in the scene; else how it is there, and here.
fn steered_alike(sheet: &Sheet, told: &artifact::Sheet) -> std::result::Result<(), [String; 2]> {
    let own = match sheet.laid() {
        Ok(Laid::Steered(field)) => Some(field.points().to_vec()),
        _ => None,
    };
    // Older runs tell no directions at all.
    let straight = told.steering.is_none() && told.fibre_1.is_none();
    if straight && own.is_none() || told.steering == own {
        return Ok(());
    }
    let text = |points: &Option<Vec<[f64; 3]>>| match points {
        Some(points) => format!("steered by {} points", points.len()),
        None => "the same everywhere".to_owned(),
    };
    let (there, here) = (text(&told.steering), text(&own));
    match there == here {
        true => Err([format!("{there} of other places or directions"), here]),
        false => Err([there, here]),
    }
}

/// Times and driven sheets of a boundary artifact.
pub fn read_motion(host: &Host, input: &Input) -> Result<(Vec<f64>, Vec<LocalSheet>)> {
    let meshes = host.meshes(input)?;
    let (time, _) = host.array_f64(input, "time")?;
    let mut sheets = Vec::new();
    for body in &meshes.bodies {
        let (points, cells) = host.mesh(input, body)?;
        let name = &body.name;
        let (driven, _) = host.array_u32(input, &format!("{name}/driven_nodes"))?;
        let shape = [time.len(), driven.len(), 3];
        let vectors = |what: &str| read_vectors(host, input, &format!("{name}/{what}"), shape);
        // Written by older versions without normals.
        let known = |what: &str| {
            let there = host.array_info(input, &format!("{name}/{what}")).is_some();
            if there { vectors(what) } else { Ok(Vec::new()) }
        };
        let pull = known("pull")?;
        let stiffness = match pull.is_empty() {
            true => Vec::new(),
            false => host.array_f64(input, &format!("{name}/stiffness"))?.0,
        };
        if !pull.is_empty() && stiffness.len() != driven.len() {
            return Err(FormingError::Input(format!(
                "'{name}/stiffness' has {} values for {} driven nodes; run the boundary's step again",
                stiffness.len(),
                driven.len()
            )));
        }
        sheets.push(LocalSheet {
            name: name.clone(),
            points,
            cells: cells.as_chunks::<4>().0.to_vec(),
            position: vectors("position")?,
            velocity: vectors("velocity")?,
            normal: known("normal")?,
            normal_rate: known("normal_rate")?,
            pull,
            stiffness,
            start: read_start(host, input, name)?,
            driven,
        });
    }
    Ok((time, sheets))
}

/// `[frames][driven]` vectors of an array of this shape.
fn read_vectors(
    host: &Host,
    input: &Input,
    path: &str,
    expected: [usize; 3],
) -> Result<Vec<Vec<Vec3>>> {
    let (v, shape) = host.array_f64(input, path)?;
    if shape != expected {
        return Err(FormingError::Input(format!(
            "'{path}' has shape {shape:?}, expected {expected:?}"
        )));
    }
    let [frames, driven, _] = expected;
    let row = 3 * driven;
    let frame = |f: usize| v[f * row..(f + 1) * row].as_chunks::<3>().0.to_vec();
    Ok((0..frames).map(frame).collect())
}

/// Where a sheet of a boundary artifact begins, if not with the process.
fn read_start(host: &Host, input: &Input, name: &str) -> Result<Option<Start>> {
    let [path, velocity] = ["path", "start_velocity"].map(|what| format!("{name}/{what}"));
    if host.array_info(input, &path).is_none() {
        return Ok(None);
    }
    let (ways, shape) = host.array_f64(input, &path)?;
    let (velocity, _) = host.array_f64(input, &velocity)?;
    let vectors = |v: &[f64]| -> Vec<Vec3> { v.as_chunks::<3>().0.to_vec() };
    let row = shape[1..].iter().product::<usize>().max(1);
    Ok(Some(Start {
        path: ways.chunks_exact(row).map(vectors).collect(),
        velocity: vectors(&velocity),
    }))
}
