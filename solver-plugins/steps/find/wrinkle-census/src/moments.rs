//! Bending moments along the fibres.

use plyflow_geometry::vec3::Vec3;
use plyflow_sdk::{BodyInfo, Host, Input, On, StepError};
use plyflow_surface::Topology;

/// Fields of an element that bends.
const FIELDS: [&str; 2] = ["bending_moment_1", "bending_moment_2"];

/// Root mean square of the moments along the two fibre families, `sqrt((M1^2 + M2^2) / 2)` (N: N m per m of width; thesis figures
/// 4.7 and 4.11), where the element has them; `None` for membranes.
///
/// # Errors
/// When the artifact cannot be read.
pub fn read(
    host: &Host,
    input: &Input,
    body: &BodyInfo,
    frame: usize,
) -> Result<Option<(On, Vec<f64>)>, StepError> {
    let found = FIELDS.map(|name| body.fields.iter().find(|f| f.name == name));
    let [Some(first), Some(second)] = found else {
        return Ok(None);
    };
    if first.on != second.on {
        return Err(format!(
            "'{}' of body '{}' lies on {:?}, '{}' on {:?}; expected both on points or both on cells",
            FIELDS[0], body.name, first.on, FIELDS[1], second.on
        )
        .into());
    }
    let [m1, m2] = [
        host.frame_field(input, body, frame, FIELDS[0])?,
        host.frame_field(input, body, frame, FIELDS[1])?,
    ];
    let rms = m1
        .iter()
        .zip(&m2)
        .map(|(a, b)| (0.5 * (a * a + b * b)).sqrt());
    Ok(Some((first.on, rms.collect())))
}

/// The undeformed area (m2) that each value stands for. Nodes on the ply's edge have none: a fit over the
/// neighbours of a node exists only where it is surrounded.
pub fn weights(on: On, topology: &Topology, flat: &[Vec3]) -> Vec<f64> {
    match on {
        On::Cells => topology.cell_areas(flat),
        On::Points => topology.inner_node_areas(flat),
    }
}
