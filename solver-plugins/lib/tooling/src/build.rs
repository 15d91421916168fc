//! The surface of a scene's tool.

use crate::chord::CHORD_TOLERANCE;
use crate::error::ToolError;
use crate::mesh::ToolMesh;
use crate::{double_dome, hemisphere, input, stl, sweep, tetrahedron};
use plyflow_model::artifact::ToolPlacement;
use plyflow_model::scene::Tool;
use plyflow_model::tool::rules;
use std::path::Path;

/// The surface of a scene's tool. STL paths are taken as they stand: absolute, or relative to the working
/// directory (see [`build_from`]).
///
/// # Errors
/// When the tool's words make no surface ([`rules::check`]), or its file, or what another step gave for it, is none.
pub fn build(tool: &Tool) -> Result<ToolMesh, ToolError> {
    build_from(tool, Path::new(""))
}

/// A tool's surface, and how it has been put in its place.
pub struct Built {
    /// The surface.
    pub mesh: ToolMesh,
    /// Of a tool that its words put in its place by more than `translate`.
    pub placement: Option<ToolPlacement>,
}

/// As [`build`], with how the tool has been put in its place.
///
/// # Errors
/// As [`build`].
pub fn built(tool: &Tool) -> Result<Built, ToolError> {
    built_from(tool, Path::new(""))
}

/// As [`build`], with STL paths relative to `folder`, the one that holds the scene file.
///
/// # Errors
/// As [`build`].
pub fn build_from(tool: &Tool, folder: &Path) -> Result<ToolMesh, ToolError> {
    built_from(tool, folder).map(|built| built.mesh)
}

fn built_from(tool: &Tool, folder: &Path) -> Result<Built, ToolError> {
    rules::check(tool)?;
    let mut placement = None;
    let mesh = match tool {
        Tool::JoggleSpar(t) => sweep::mesh(&t.shape()?, t.facet_size.si(), CHORD_TOLERANCE),
        Tool::Flat(t) => sweep::mesh(&t.shape()?, t.facet_size.si(), CHORD_TOLERANCE),
        Tool::RampedSpar(t) => sweep::mesh(&t.shape()?, t.facet_size.si(), CHORD_TOLERANCE),
        Tool::Tetrahedron(t) => tetrahedron::tetrahedron(t),
        Tool::DoubleDome(t) => double_dome::double_dome(t),
        Tool::Hemisphere(t) => hemisphere::hemisphere(t.radius.si(), t.facet_size.si()),
        Tool::Stl(s) => {
            let path = folder.join(&s.file);
            let (mesh, placed) = stl::read(&path, s.unit.si(), &s.place())?;
            placement = placed.told();
            mesh
        }
        Tool::Input(t) => {
            let (mesh, placed) = input::read(t)?;
            placement = placed.told();
            mesh
        }
    };
    Ok(Built { mesh, placement })
}

#[cfg(test)]
mod tests {
    use super::*;
    use plyflow_model::tool::rules::plan_and_facet;
    use std::time::Instant;

    fn tool(facet: &str) -> Vec<Tool> {
        [
            format!(r#"{{"hemisphere": {{"radius": "100 mm", "facet_size": "{facet}"}}}}"#),
            format!(
                r#"{{"flat": {{"length": "300 mm", "width": "200 mm", "height": "20 mm", "fillet": "5 mm", "facet_size": "{facet}"}}}}"#
            ),
            format!(
                r#"{{"tetrahedron": {{"edge": "200 mm", "height": "160 mm", "radius": "10 mm", "facet_size": "{facet}"}}}}"#
            ),
            format!(
                r#"{{"double_dome": {{"dome_radius": "60 mm", "dome_distance": "180 mm", "waist_radius": "150 mm", "facet_size": "{facet}"}}}}"#
            ),
            format!(
                r#"{{"joggle_spar": {{"length": "400 mm", "top_width": "100 mm", "height": "40 mm", "draft": "5 deg", "fillet": "8 mm", "joggles": [], "facet_size": "{facet}"}}}}"#
            ),
        ]
        .iter()
        .map(|text| serde_saphyr::from_str(text).unwrap_or_else(|e| panic!("{text}: {e}")))
        .collect()
    }

    #[test]
    fn facets_a_thousand_times_too_small_are_refused_at_once_for_every_generator() {
        for tool in tool("0.001 mm") {
            let begun = Instant::now();
            let text = build(&tool).unwrap_err().to_string();
            assert!(text.contains("facets at `facet_size`"), "{text}");
            assert!(begun.elapsed().as_secs_f64() < 1.0, "{tool:?}");
        }
    }

    #[test]
    fn the_estimate_is_no_more_than_what_is_made() {
        for tool in tool("5 mm") {
            let (plan, facet) = plan_and_facet(&tool).unwrap();
            let made = build(&tool).unwrap().triangles.len() as f64;
            assert!(
                4.0 * plan / (facet * facet) < 1.2 * made,
                "{tool:?}: {made}"
            );
        }
    }
}
