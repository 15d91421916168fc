//! The judgement of compressed fibres behind the host.

use crate::compressed::{Carrying, Law, excess};
use crate::laws::PlyLaw;
use plyflow_geometry::vec3::Vec3;
use plyflow_model::artifact::{Forming, Sheet};
use plyflow_model::scene::{Scene, first_axis};
use plyflow_model::steering::Laid;
use plyflow_sdk::{Host, Input, StepError};
use plyflow_surface::Topology;

/// Fields of cells with what a ply carries.
const FORCES: [&str; 3] = ["membrane_force_1", "membrane_force_2", "membrane_force_12"];

/// Field of points with what presses a ply to the tool.
const PRESSURE: &str = "contact_pressure";

/// What is known of a ply.
struct Known {
    topology: Topology,
    flat: Vec<Vec3>,
    axis: f64,
    forces: [Vec<f64>; 3],
    pressure: Vec<f64>,
    law: PlyLaw,
}

impl Known {
    fn read(
        host: &Host,
        input: &Input,
        frame: usize,
        formed: &Forming,
        sheet: &Sheet,
        scene: &Scene,
    ) -> Result<Self, StepError> {
        let meshes = host.meshes(input)?;
        let body = meshes.body(&sheet.name)?;
        let has = |name: &str| body.fields.iter().any(|f| f.name == name);
        let all = FORCES.iter().chain([&PRESSURE]);
        let missing: Vec<&str> = all.copied().filter(|f| !has(f)).collect();
        let laid = sheet.laid();
        let askew = laid.as_ref().and_then(Laid::crossing);
        let straight = laid.filter(|_| askew.is_none()).and_then(|l| l.straight());
        let axis = straight.filter(|_| missing.is_empty());
        let axis = axis.map(|[first, second]| first_axis(first, second));
        let axis = axis.ok_or_else(|| {
            let what = match &missing[..] {
                [] if sheet.steering.is_some() => {
                    return format!(
                        "scene: given, so compressed fibres are to be judged, but the fibres of ply '{}' of '{}' are steered, and a ruck is looked for \
                         along straight fibres alone; leave out `scene`",
                        sheet.name, input.step
                    );
                }
                [] if askew.is_some() => {
                    return format!(
                        "scene: given, so compressed fibres are to be judged, but the fibre families of ply '{}' of '{}' do not cross at a right angle, and a \
                         ruck is looked for along families that do; leave out `scene`",
                        sheet.name, input.step
                    );
                }
                [] => "fibre directions".to_owned(),
                fields => fields.join(", "),
            };
            format!(
                "scene: given, so compressed fibres are to be judged, but '{}' does not tell {what} of ply '{}'; judge a run of forming-explicit, or leave \
                 out `scene`",
                input.step, sheet.name
            )
        })?;
        let field = |name: &str| host.frame_field(input, body, frame, name);
        let (flat, cells) = host.mesh(input, body)?;
        let [one, two, both] = FORCES;
        Ok(Self {
            topology: Topology::new(flat.len(), body.nodes_per_cell, &cells),
            flat,
            axis,
            forces: [field(one)?, field(two)?, field(both)?],
            pressure: field(PRESSURE)?,
            law: PlyLaw::new(host, scene, formed, sheet)?,
        })
    }

    fn carrying(&self) -> Carrying<'_> {
        Carrying {
            topology: &self.topology,
            flat: &self.flat,
            axis: self.axis,
            resultants: [0, 1, 2].map(|k| &self.forces[k][..]),
            contact_pressure: &self.pressure,
            law: &self.law as &dyn Law,
        }
    }
}

/// What is found of a ply.
pub(crate) struct Buckling {
    /// `[cells]` excess length of compressed fibres over that which a ruck needs.
    pub(crate) excess: Vec<f64>,
    /// `[cells]` whether that is enough.
    pub(crate) buckles: Vec<bool>,
    /// `[cells]` undeformed areas (m2).
    pub(crate) areas: Vec<f64>,
}

impl Buckling {
    /// Undeformed area of the chosen cells (m2).
    pub(crate) fn area(&self, chosen: &[bool]) -> f64 {
        let chosen = self.areas.iter().zip(chosen).filter(|(_, c)| **c);
        chosen.fold(0.0, |sum, (a, _)| sum + a)
    }

    /// The largest excess.
    pub(crate) fn largest(&self) -> f64 {
        self.excess.iter().copied().fold(0.0, f64::max)
    }
}

/// Where compressed fibres of the plies of a run have length enough for a ruck of the height `height` (m), by ply.
///
/// # Errors
/// When the run does not hold what is needed, or the scene is not the one that was formed.
pub(crate) fn judge(
    host: &Host,
    input: &Input,
    frame: usize,
    scene: &Scene,
    height: f64,
) -> Result<Vec<Buckling>, StepError> {
    let formed: Forming = host.attributes(input)?;
    let known = |s: &Sheet| Known::read(host, input, frame, &formed, s, scene);
    let plies: Vec<Known> = formed.plies().map(known).collect::<Result<_, _>>()?;
    let carrying: Vec<Carrying<'_>> = plies.iter().map(Known::carrying).collect();
    let found = |(excess, known): (Vec<f64>, &Known)| Buckling {
        buckles: excess.iter().map(|e| *e >= 1.0).collect(),
        areas: known.topology.cell_areas(&known.flat),
        excess,
    };
    Ok(excess(&carrying, height)
        .into_iter()
        .zip(&plies)
        .map(found)
        .collect())
}
