//! What is measured: the plies of a run, and a scan.

use crate::measured::SCAN;
use crate::parameters::{Align, Parameters};
use crate::sections;
use plyflow_defects::align::{Alignment, MOST_PASSES, Settings, align_where};
use plyflow_defects::{Ply, Shape, Tool, of_run, scan};
use plyflow_geometry::vec3::Vec3;
use plyflow_model::artifact::{Forming, Sheet};
use plyflow_sdk::{Host, Input, Log, StepError};
use plyflow_surface::draped;
use plyflow_surface::of_run::Stack;
use plyflow_surface::{Closest, Ground, Surface, Topology, triangles};
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
    /// Whether there is no bed under its tool.
    without_bed: bool,
    /// Distance of the outer face of the uppermost sheet from the tool (m).
    outer: f64,
}

impl Run {
    /// Reads tool and list of plies of the input `formed`.
    pub fn read(host: &Host) -> Result<Self, StepError> {
        let input = host.input("formed")?;
        let formed: Forming = host.attributes(&input)?;
        let meshes = host.meshes(&input)?;
        let frame = of_run::last_frame(&input, &meshes)?;
        let faces = formed.sheets.iter().map(|s| s.offset + 0.5 * s.thickness);
        let outer = faces.fold(0.0, f64::max);
        let without_bed = formed.without_bed;
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
            without_bed,
            outer,
            input,
        })
    }

    /// The run itself.
    pub fn step(&self) -> &Input {
        &self.input
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
        let of = of_run::Frame {
            host,
            input: &self.input,
            frame: self.frame,
        };
        of_run::strained_ply(of, sheet, &self.tool, foot_margin)
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
            let formed: Forming = host.attributes(&input)?;
            let meshes = host.meshes(&input)?;
            let frame = of_run::last_frame(&input, &meshes)?;
            let items: String = input.item.iter().map(|i| format!("_{i}")).collect();
            let run = format!("{}{items}", input.step);
            for sheet in formed.plies() {
                let body = meshes.body(&sheet.name)?;
                let part = draped::Formed::read(host, &input, body, frame)?;
                let ply = &sheet.name;
                all.push(Self {
                    label: match &formed.zone {
                        Some(zone) => format!("{ply}, zone {}", zone.name),
                        None => format!("{ply} of {run}"),
                    },
                    name: format!("{run}/{ply}"),
                    topology: Topology::new(part.flat.len(), body.nodes_per_cell, &part.cells),
                    formed: part.points,
                    undeformed: part.flat,
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

/// The plies of a run, some of which end under a scan.
struct Beneath<'a> {
    stack: Stack,
    /// From the tool upwards: their formed faces.
    plies: Vec<(&'a Ply, Surface)>,
}

impl<'a> Beneath<'a> {
    /// `None` where all lie everywhere, as far as the run tells. `counted`: those whose thickness is in the scan's offset, from the tool upwards.
    fn read(host: &Host, run: &Run, counted: &[&'a Ply]) -> Result<Option<Self>, StepError> {
        let Some(mut stack) = Stack::read(host, &run.input)? else {
            return Ok(None);
        };
        if let Some(last) = counted.last() {
            stack.up_to(&last.name);
        }
        let face = |ply: &&'a Ply| {
            let (corners, cells) = ply.topology.connectivity();
            Some((*ply, Surface::new(&ply.formed, &triangles(corners, cells))?))
        };
        let plies: Vec<_> = counted.iter().filter_map(face).collect();
        Ok((!plies.is_empty()).then_some(Self { stack, plies }))
    }

    /// Thickness (m) of the plies that do not lie under a place of the scan: by the flat place of the nearest point of the uppermost ply that lies there. Where
    /// none does, past the edge of what was simulated, the nearest edge tells: the stack goes on as it ends.
    fn missing(&self, p: Vec3) -> f64 {
        let mut nearest: Option<(&Ply, &Surface, Closest)> = None;
        for (ply, face) in self.plies.iter().rev() {
            let closest = face.closest(p);
            if !closest.on_free_edge {
                nearest = Some((ply, face, closest));
                break;
            }
            let off = closest.signed_distance.abs();
            if nearest.is_none_or(|(.., c)| off < c.signed_distance.abs()) {
                nearest = Some((ply, face, closest));
            }
        }
        nearest.map_or(0.0, |(ply, face, closest)| {
            let corners = face.triangles()[closest.triangle];
            let weights = face.weights(closest.triangle, closest.point);
            let place = |d: usize| -> f64 {
                let each = corners.iter().zip(weights);
                each.map(|(&i, w)| w * ply.undeformed[i as usize][d]).sum()
            };
            self.stack.missing_beside(&ply.name, [place(0), place(1)])
        })
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
    /// Reads and aligns a scan. `plies`: all of the run, from the tool upwards; `shown`: which of them it shows.
    pub fn read(
        host: &Host,
        run: &Run,
        (plies, shown): (&[&Ply], usize),
        p: &Parameters,
        foot_margin: f64,
    ) -> Result<Self, StepError> {
        let path = p.scan.as_deref().unwrap_or_default();
        let read = scan::read(Path::new(path), p.scan_unit).map_err(|e| e.to_string())?;
        let (mut points, mut facets) = (read.points, read.triangles);
        let (tool, offset) = (&run.tool.surface, p.scan_offset.unwrap_or(run.outer));
        // An offset that is given is that of the face of the ply that is shown; the plies above that are not in it.
        let counted = match p.scan_offset {
            Some(_) => &plies[..=shown],
            None => plies,
        };
        let beneath = Beneath::read(host, run, counted)?;
        let missing = |p: Vec3| beneath.as_ref().map_or(0.0, |b| b.missing(p));
        let mut alignment = None;
        if p.scan_align == Align::ClosestPoints {
            let found = aligned(host, &points, tool, (offset, &missing), (p, read.unit))?;
            points.iter_mut().for_each(|p| *p = found.place(*p));
            alignment = Some(found);
        }
        if facets.is_empty() {
            facets = scan::join(&points, |p| tool.closest(p).normal);
        } else {
            scan::orient(&points, &mut facets, |p| {
                Some(tool.closest(p))
                    .filter(|c| !c.on_free_edge)
                    .map(|c| c.normal)
            });
        }
        let topology = Topology::new(points.len(), 3, facets.as_flattened());
        let missing: Vec<f64> = match &beneath {
            Some(beneath) => points.iter().map(|p| beneath.missing(*p)).collect(),
            None => Vec::new(),
        };
        let shape = Shape {
            topology,
            undeformed: points.clone(),
            formed: points,
        };
        let ground = Ground {
            foot_margin,
            bed: !run.without_bed,
        };
        let mut ply = Ply::new(SCAN.to_owned(), shape, &run.tool, offset, ground);
        ply.lower(&missing);
        Ok(Self {
            ply,
            alignment,
            offset,
        })
    }
}

/// Aligns the points of a scan, which lie at `offset` (m) from the tool less what is missing beneath them.
fn aligned(
    host: &Host,
    points: &[Vec3],
    tool: &Surface,
    (offset, missing): (f64, &dyn Fn(Vec3) -> f64),
    (p, unit): (&Parameters, f64),
) -> Result<Alignment, StepError> {
    let settings = Settings {
        offset,
        kept: p.scan_kept,
        most_points: 20000,
    };
    let found = align_where(points, tool, &settings, missing).ok_or_else(|| {
        format!(
            "scan: fewer than six of the {} points of `{}` lie over the tool, the others beyond its edge: it cannot be aligned. Correct `scan_unit` (one unit of \
             its numbers is taken for {} mm), or move the scan to within some centimetres and degrees of the tool",
            points.len(),
            p.scan.as_deref().unwrap_or_default(),
            1e3 * unit
        )
    })?;
    if !found.converged {
        let text = format!(
            "scan: it had not come to rest on the tool after {MOST_PASSES} passes, the last of which moved it by {:.4} mm ({:.4} mm root mean square off it, {} of six \
             freedoms decided): where it lies is not certain. Move the scan nearer to where it belongs, or change `scan_kept` ({})",
            1e3 * found.last_motion,
            1e3 * found.rms,
            found.decided,
            p.scan_kept
        );
        host.log(Log::Warn, &text);
    }
    Ok(found)
}
