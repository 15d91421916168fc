//! What is measured: the plies of a run, and a scan.

use crate::output::SCAN;
use crate::{Align, Parameters, sections};
use plyflow_defects::align::{Alignment, Settings, align};
use plyflow_defects::of_run::Sheet;
use plyflow_defects::{Ply, Tool, of_run, scan};
use plyflow_sdk::{Host, Input, StepError};
use plyflow_surface::Topology;
use plyflow_surface::vector::Vec3;
use serde::Deserialize;
use serde_json::Value;
use std::path::Path;

/// A formed run.
pub struct Run {
    input: Input,
    frame: usize,
    /// Time of the frame (s).
    pub time: f64,
    /// Its tool.
    pub tool: Tool,
    /// The plies, from the tool upwards.
    pub plies: Vec<Sheet>,
    /// Distance of the outer face of the uppermost sheet from the tool (m).
    outer: f64,
}

#[derive(Deserialize)]
struct Formed {
    sheets: Vec<Sheet>,
    /// Of a run of a zone.
    #[serde(default)]
    zone: Value,
}

impl Run {
    /// Reads tool and list of plies of the input `formed`.
    pub fn read(host: &Host) -> Result<Self, StepError> {
        let input = host.input("formed")?;
        let formed: Formed = host.attributes(&input)?;
        let meshes = host.meshes(&input)?;
        let frame = of_run::last_frame(&input, &meshes)?;
        let faces = formed.sheets.iter().map(|s| s.offset + 0.5 * s.thickness);
        let outer = faces.fold(0.0, f64::max);
        let plies: Vec<Sheet> = (formed.sheets.into_iter()).filter(Sheet::is_ply).collect();
        if plies.is_empty() {
            return Err(format!(
                "'{}' lists no sheet of kind 'ply' in its attributes",
                input.step
            )
            .into());
        }
        Ok(Self {
            frame,
            time: meshes.times[frame],
            tool: of_run::tool(host, &input)?,
            plies,
            outer,
            input,
        })
    }

    /// Index of the ply that a scan shows: the one of that name, or the uppermost.
    pub fn shown(&self, name: Option<&str>) -> Result<usize, StepError> {
        let Some(name) = name else {
            return Ok(self.plies.len() - 1);
        };
        let place = self.plies.iter().position(|s| s.name == name);
        place.ok_or_else(|| {
            let all: Vec<&str> = self.plies.iter().map(|s| s.name.as_str()).collect();
            let all = all.join(", ");
            format!("scan_ply: the run has no ply '{name}'; its plies are: {all}").into()
        })
    }

    /// Reads a ply and takes its distances and curvatures.
    pub fn ply(&self, host: &Host, sheet: &Sheet, foot_margin: f64) -> Result<Ply, StepError> {
        of_run::strained_ply(
            host,
            &self.input,
            self.frame,
            sheet,
            &self.tool,
            foot_margin,
        )
    }
}

/// A ply of a run beside the one that is measured, which its sections show too.
pub struct Beside {
    label: String,
    name: String,
    undeformed: Vec<Vec3>,
    formed: Vec<Vec3>,
    topology: Topology,
}

impl Beside {
    /// Reads the plies of all inputs `beside` in their last frames.
    pub fn read(host: &Host) -> Result<Vec<Self>, StepError> {
        let mut all = Vec::new();
        for input in host.inputs_of("beside")? {
            let formed: Formed = host.attributes(&input)?;
            let meshes = host.meshes(&input)?;
            let frame = of_run::last_frame(&input, &meshes)?;
            let items: String = input.item.iter().map(|i| format!("_{i}")).collect();
            let run = format!("{}{items}", input.step);
            for sheet in formed.sheets.iter().filter(|s| s.is_ply()) {
                let body = meshes.body(&sheet.name)?;
                let (undeformed, cells) = host.mesh(&input, body)?;
                let ply = &sheet.name;
                all.push(Self {
                    label: match formed.zone["name"].as_str() {
                        Some(zone) => format!("{ply}, zone {zone}"),
                        None => format!("{ply} of {run}"),
                    },
                    name: format!("{run}/{ply}"),
                    topology: Topology::new(undeformed.len(), body.nodes_per_cell, &cells),
                    formed: host.frame_points(&input, body, frame)?,
                    undeformed,
                });
            }
        }
        Ok(all)
    }

    /// As sections cut it.
    pub fn sheet(&self) -> sections::Sheet<'_> {
        sections::Sheet {
            label: self.label.clone(),
            name: self.name.clone(),
            flat: Some(&self.undeformed),
            formed: &self.formed,
            topology: &self.topology,
        }
    }
}

/// A scan on the tool of a run.
pub struct Scan {
    /// Measured as a ply.
    pub ply: Ply,
    /// How it was moved there.
    pub alignment: Option<Alignment>,
    /// Distance of the scanned surface from the tool where everything lies on it (m).
    pub offset: f64,
}

impl Scan {
    /// Reads and aligns a scan.
    pub fn read(
        run: &Run,
        path: &str,
        p: &Parameters,
        foot_margin: f64,
    ) -> Result<Self, StepError> {
        let read = scan::read(Path::new(path), p.scan_unit).map_err(|e| e.to_string())?;
        let (mut points, mut facets) = (read.points, read.triangles);
        let (tool, offset) = (&run.tool.surface, p.scan_offset.unwrap_or(run.outer));
        let mut alignment = None;
        if p.scan_align == Align::ClosestPoints {
            let settings = Settings {
                offset,
                kept: p.scan_kept,
                most_points: 20000,
            };
            let found = align(&points, tool, &settings).ok_or_else(|| {
                format!(
                    "scan: fewer than six of the {} points of `{path}` lie over the tool, the others beyond its edge: it cannot be aligned. Correct `scan_unit` (one unit of \
                     its numbers is taken for {} mm), or move the scan to within some centimetres and degrees of the tool",
                    points.len(),
                    1e3 * p.scan_unit
                )
            })?;
            points.iter_mut().for_each(|p| *p = found.place(*p));
            alignment = Some(found);
        }
        if facets.is_empty() {
            facets = scan::join(&points, |p| tool.closest(p).normal);
        }
        let topology = Topology::new(points.len(), 3, facets.as_flattened());
        let flat = points.clone();
        let name = SCAN.to_owned();
        let ply = Ply::new(name, topology, flat, points, &run.tool, offset, foot_margin);
        Ok(Self {
            ply,
            alignment,
            offset,
        })
    }
}
