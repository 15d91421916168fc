//! Tools that other steps make.

use crate::error::ToolError;
use crate::mesh::ToolMesh;
use crate::surface::{self, NoSurface, Origin};
use plyflow_geometry::vec3::Vec3;
use plyflow_model::tool::placed::Placed;
use plyflow_model::tool::{GivenSurface, InputTool};

/// Makes the triangles of a step a tool ([`surface::surface`]).
pub(crate) fn read(tool: &InputTool) -> Result<(ToolMesh, Placed), ToolError> {
    let Some(given) = &tool.given else {
        return Err(ToolError::NotRead(tool.body.clone()));
    };
    let error = |(problem, remedy): NoSurface| ToolError::Input {
        body: tool.body.clone(),
        step: given.step.clone(),
        problem,
        remedy: remedy.to_owned(),
    };
    let mut corners = corners(given).map_err(error)?;
    let placed = surface::put(&mut corners, 1.0, &tool.place()).map_err(error)?;
    let origin = Origin {
        placed,
        units: match tool.place().only_moves() {
            true => "in m, before `translate`",
            false => "in m, before it is placed",
        },
        place: &|triangle| format!("triangle {triangle}, counted from 0"),
    };
    let mesh = surface::surface(&corners, &origin).map_err(error)?;
    Ok((mesh, placed))
}

/// The corners of all triangles of a step (m), where it has been read and they are there.
pub(crate) fn facets(tool: &InputTool) -> Option<Vec<[Vec3; 3]>> {
    corners(tool.given.as_ref()?).ok()
}

/// The corners of all triangles (m).
fn corners(given: &GivenSurface) -> Result<Vec<[[f64; 3]; 3]>, NoSurface> {
    let corner = |k: usize, p: u32| {
        given.points.get(p as usize).copied().ok_or_else(|| {
            let count = given.points.len();
            (
                format!("triangle {k}, counted from 0, has the point {p}, and there are {count} points, counted from 0"),
                "correct the step's cells",
            )
        })
    };
    let all = given.triangles.iter().enumerate();
    all.map(|(k, [a, b, c])| Ok([corner(k, *a)?, corner(k, *b)?, corner(k, *c)?]))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hemisphere::hemisphere;
    use crate::stl;
    use plyflow_model::tool::place::Place;
    use plyflow_model::units::Length;
    use std::io::Write;
    use std::sync::Arc;

    /// A tool of these triangles, moved by (m).
    fn tool(points: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>, translate: [f64; 3]) -> InputTool {
        InputTool {
            body: "dome".into(),
            translate: translate.map(Length),
            up: None,
            rotate: None,
            centre: None,
            foot: None,
            given: Some(Arc::new(GivenSurface {
                step: "cad".into(),
                points,
                triangles,
            })),
        }
    }

    #[test]
    fn triangles_of_a_step_are_the_tool_of_an_stl_file_with_the_same_coordinates_bit_by_bit() {
        let mesh = hemisphere(0.05, 0.008);
        let facets: Vec<[[f64; 3]; 3]> = (0..mesh.triangles.len())
            .map(|t| mesh.corners(t).map(|p| p.map(|c| 1e3 * c)))
            .collect();
        let bytes = plyflow_files::stl::write(&facets);
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(&bytes).unwrap();
        let place = Place {
            translate: [0.0, 0.0, 0.01],
            ..Place::default()
        };
        let by_file = stl::read(file.path(), 1e-3, &place).unwrap().0;
        // As a step has them that read the same file: scaled, and each point once or once for each triangle.
        let read = plyflow_files::stl::parse(&bytes).unwrap().corners;
        let apart: Vec<[f64; 3]> = read
            .as_flattened()
            .iter()
            .map(|p| p.map(|c| c * 1e-3))
            .collect();
        let each: Vec<[u32; 3]> = (0..read.len() as u32)
            .map(|t| [3 * t, 3 * t + 1, 3 * t + 2])
            .collect();
        let shared = crate::facets::join(apart.as_chunks::<3>().0);
        for (points, triangles) in [(apart, each), (shared.points, shared.triangles)] {
            let by_step = super::read(&tool(points, triangles, [0.0, 0.0, 0.01]))
                .unwrap()
                .0;
            assert_eq!(by_step.triangles, by_file.triangles);
            let bits = |m: &ToolMesh| -> Vec<[u64; 3]> {
                m.points.iter().map(|p| p.map(f64::to_bits)).collect()
            };
            assert_eq!(bits(&by_step), bits(&by_file));
        }
    }

    #[test]
    fn what_is_no_surface_is_told_with_the_body_the_step_and_the_place() {
        let mesh = hemisphere(0.05, 0.01);
        let told = |points: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>| {
            super::read(&tool(points, triangles, [0.0; 3]))
                .unwrap_err()
                .to_string()
        };
        let mut turned = mesh.triangles.clone();
        turned.iter_mut().for_each(|t| t.swap(0, 1));
        let text = told(mesh.points.clone(), turned);
        assert!(
            text.starts_with(
                "scene.tool.input: body `dome` of step `cad`: its facets point inwards"
            ),
            "{text}"
        );
        let mut mixed = mesh.triangles.clone();
        mixed[7].swap(0, 1);
        let text = told(mesh.points.clone(), mixed);
        assert!(
            text.contains("oriented against each other")
                && text.contains("in m, before `translate`, triangle "),
            "{text}"
        );
        let mut off = mesh.triangles.clone();
        off[3][1] = 1_000_000;
        let text = told(mesh.points.clone(), off);
        assert!(
            text.contains("triangle 3, counted from 0, has the point 1000000"),
            "{text}"
        );
        let text = told(mesh.points.clone(), Vec::new());
        assert!(text.contains("none of its 0 facets has an area"), "{text}");
        let mut far = mesh.points.clone();
        far[0][0] = f64::INFINITY;
        assert!(told(far, mesh.triangles.clone()).contains("a coordinate that is too large"));
    }

    #[test]
    fn a_tool_that_nobody_has_read_says_what_to_wire() {
        let mut unread = tool(Vec::new(), Vec::new(), [0.0; 3]);
        unread.given = None;
        let text = super::read(&unread).unwrap_err().to_string();
        assert!(
            text.contains("scene.tool.input.body: `dome`")
                && text.contains("wired to the input `geometry`"),
            "{text}"
        );
    }
}
