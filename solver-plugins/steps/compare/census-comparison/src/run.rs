//! The censuses that arrive.

use plyflow_geometry::vec3::Vec3;
use plyflow_model::artifact::{Census, CensusCurve, CrossSection, Wrinkle};
use plyflow_sdk::{Host, Input, On, StepError};
use plyflow_surface::Topology;
use serde::Deserialize;

/// A run as the workflow names it.
#[derive(Debug, Clone, Deserialize)]
pub struct Choice {
    /// Its census step.
    pub step: String,
    /// What it is called.
    pub label: Option<String>,
    /// Constant bending stiffness (N m).
    pub bending_stiffness: Option<f64>,
}

/// A field of a ply with the undeformed areas (m2) that its values stand for.
#[derive(Debug, Clone)]
pub struct Field {
    /// On points or cells.
    pub on: On,
    /// Values (SI).
    pub values: Vec<f64>,
    /// As many areas.
    pub weights: Vec<f64>,
}

/// A run with its census.
#[derive(Debug)]
pub struct Run {
    /// Its name in paths: the step's, with its place in a fan-out.
    pub name: String,
    /// For people.
    pub label: String,
    /// Constant bending stiffness (N m), if it has one.
    pub bending_stiffness: Option<f64>,
    /// Where its arrays are read.
    pub input: Input,
    /// Wrinkles on the first circle.
    pub wrinkles: Vec<Wrinkle>,
    /// Its curves.
    pub curves: Vec<CensusCurve>,
    /// Its cross sections.
    pub sections: Vec<CrossSection>,
    /// The ply: undeformed and formed points (m), quads.
    pub flat: Vec<Vec3>,
    /// Formed.
    pub points: Vec<Vec3>,
    /// Four nodes each.
    pub cells: Vec<u32>,
    /// Deviation (m); absent when the census had no surface to measure from.
    pub deviation: Option<Field>,
    /// Root mean square of the bending moments along both families (N); absent for membranes.
    pub bending_moment: Option<Field>,
}

/// Reads the censuses in the order of `choices`, or of the workflow when there are none.
///
/// # Errors
/// When a choice has no census, a census no choice or two, or one cannot be read.
pub fn read(host: &Host, choices: &[Choice]) -> Result<Vec<Run>, StepError> {
    let mut inputs = host.inputs_of("censuses")?;
    let names: Vec<String> = inputs.iter().map(name).collect();
    if choices.is_empty() {
        return (inputs.into_iter().zip(names))
            .map(|(input, name)| one(host, input, name, None))
            .collect();
    }
    let given = || choices.iter().map(|c| c.step.as_str());
    if let Some(left_out) = names.iter().find(|n| !given().any(|c| c == *n)) {
        return Err(format!(
            "runs: nothing for '{left_out}', which is wired to the step; give it an entry, or leave `runs` out"
        )
        .into());
    }
    let mut runs = Vec::new();
    for (k, choice) in choices.iter().enumerate() {
        if given().take(k).any(|c| c == choice.step) {
            return Err(format!("runs: '{}' is given twice", choice.step).into());
        }
        let at = inputs.iter().position(|i| name(i) == choice.step);
        let at = at.ok_or_else(|| {
            let there = names.join(", ");
            format!(
                "runs: given step '{}'; wired to the step are: {there}",
                choice.step
            )
        })?;
        let input = inputs.remove(at);
        runs.push(one(host, input, choice.step.clone(), Some(choice))?);
    }
    Ok(runs)
}

/// The step's name, with its place in a fan-out.
fn name(input: &Input) -> String {
    let item = input.item.iter().map(|i| format!("_{i}"));
    format!("{}{}", input.step, item.collect::<String>())
}

fn one(host: &Host, input: Input, name: String, choice: Option<&Choice>) -> Result<Run, StepError> {
    let census: Census = host.attributes(&input)?;
    let meshes = host.meshes(&input)?;
    let body = meshes.body(&census.ply)?;
    let last = meshes.times.len().checked_sub(1);
    let frame = last.ok_or_else(|| format!("'{}' has no frame", input.step))?;
    let (flat, cells) = host.mesh(&input, body)?;
    let topology = Topology::new(flat.len(), 4, &cells);
    let field = |what: &str, inner: bool| -> Result<Option<Field>, StepError> {
        let Some(info) = body.fields.iter().find(|f| f.name == what) else {
            return Ok(None);
        };
        let weights = match info.on {
            On::Cells => topology.cell_areas(&flat),
            On::Points if inner => topology.inner_node_areas(&flat),
            On::Points => topology.node_areas(&flat),
        };
        Ok(Some(Field {
            on: info.on,
            values: host.frame_field(&input, body, frame, what)?,
            weights,
        }))
    };
    let (deviation, bending_moment) = (field("deviation", false)?, field("bending_moment", true)?);
    let first = census.circles.into_iter().next();
    Ok(Run {
        label: choice
            .and_then(|c| c.label.clone())
            .unwrap_or_else(|| name.clone()),
        bending_stiffness: choice.and_then(|c| c.bending_stiffness),
        wrinkles: first.map(|c| c.wrinkles).unwrap_or_default(),
        curves: census.curves,
        sections: census.cross_sections,
        points: host.frame_points(&input, body, frame)?,
        name,
        input,
        flat,
        cells,
        deviation,
        bending_moment,
    })
}
