//! Whether a tool that is made from parameters has not too many facets to be made.

use crate::error::ToolError;
use plyflow_model::budget::{self, Wanted};
use plyflow_model::scene::Tool;

/// Estimates the facets from the tool's extent in plan, before any is made. Files have the facets that they have.
pub(crate) fn allow(tool: &Tool) -> Result<(), ToolError> {
    let Some((plan, facet)) = plan_and_facet(tool) else {
        return Ok(());
    };
    // Two facets for each square of that side, on top and below. The generators refuse lengths that are none.
    let count = 4.0 * plan / (facet * facet);
    if !(plan > 0.0 && facet > 0.0 && count.is_finite()) {
        return Ok(());
    }
    budget::allow(Wanted {
        what: "the tool's surface",
        of: "facets",
        count,
        most: budget::MOST_FACETS,
        bytes: budget::FACET_BYTES,
        parameter: "facet_size",
        size: facet,
    })
    .map_err(ToolError::TooMany)
}

/// Area in plan (m2) and largest edge of a facet (m).
fn plan_and_facet(tool: &Tool) -> Option<(f64, f64)> {
    let circle = |r: f64| std::f64::consts::PI * r * r;
    Some(match tool {
        Tool::JoggleSpar(s) => (s.length.si() * s.top_width.si(), s.facet_size.si()),
        Tool::RampedSpar(s) => (s.length.si() * s.top_width.si(), s.facet_size.si()),
        Tool::Flat(f) => (f.length.si() * f.width.si(), f.facet_size.si()),
        Tool::Tetrahedron(t) => (0.25 * 3f64.sqrt() * t.edge.si().powi(2), t.facet_size.si()),
        Tool::DoubleDome(d) => (circle(d.dome_radius.si()), d.facet_size.si()),
        Tool::Hemisphere(h) => (circle(h.radius.si()), h.facet_size.si()),
        Tool::Stl(_) => return None,
    })
}

#[cfg(test)]
mod tests {
    use crate::build;
    use plyflow_model::scene::Tool;
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
            let (plan, facet) = super::plan_and_facet(&tool).unwrap();
            let made = build(&tool).unwrap().triangles.len() as f64;
            assert!(
                4.0 * plan / (facet * facet) < 1.2 * made,
                "{tool:?}: {made}"
            );
        }
    }
}
