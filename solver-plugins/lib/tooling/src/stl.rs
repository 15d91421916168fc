//! Tools from STL files.

use crate::error::ToolError;
use crate::mesh::ToolMesh;
use crate::surface::{self, NoSurface, Origin};
use plyflow_files::open::{self, MOST_DATA};
use plyflow_files::stl;
use plyflow_geometry::vec3::Vec3;
use plyflow_model::tool::place::Place;
use plyflow_model::tool::placed::Placed;
use std::path::Path;

/// Reads a file ([`plyflow_files::stl`]) and makes its facets a tool ([`surface::surface`]), put where `place` says.
pub(crate) fn read(path: &Path, unit: f64, place: &Place) -> Result<(ToolMesh, Placed), ToolError> {
    let surface_error = |(problem, remedy): NoSurface| ToolError::Surface {
        path: path.to_owned(),
        problem,
        remedy: remedy.to_owned(),
    };
    let mut read = parsed(path)?;
    let mut corners = std::mem::take(&mut read.corners);
    let placed = surface::put(&mut corners, unit, place).map_err(surface_error)?;
    let origin = Origin {
        placed,
        units: "in the file's units",
        place: &|facet| read.place(facet),
    };
    let mesh = surface::surface(&corners, &origin).map_err(surface_error)?;
    Ok((mesh, placed))
}

/// The facets of a file, in its units.
pub(crate) fn facets(path: &str) -> Result<Vec<[Vec3; 3]>, ToolError> {
    parsed(Path::new(path)).map(|read| read.corners)
}

fn parsed(path: &Path) -> Result<stl::Facets, ToolError> {
    let bytes = open::read(path, MOST_DATA).map_err(|source| ToolError::Read {
        path: path.to_owned(),
        source,
    })?;
    stl::parse(&bytes).map_err(|e| ToolError::Stl(e.of(path)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hemisphere::hemisphere;
    use std::io::Write;

    fn read(path: &Path, unit: f64, translate: Vec3) -> Result<ToolMesh, ToolError> {
        let place = Place {
            translate,
            ..Place::default()
        };
        super::read(path, unit, &place).map(|(mesh, _)| mesh)
    }

    fn in_mm(mesh: &ToolMesh) -> Vec<[Vec3; 3]> {
        let all = 0..mesh.triangles.len();
        all.map(|t| mesh.corners(t).map(|p| p.map(|c| 1e3 * c)))
            .collect()
    }

    fn binary(mesh: &ToolMesh) -> tempfile::NamedTempFile {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(&stl::write(&in_mm(mesh))).unwrap();
        file
    }

    fn ascii(mesh: &ToolMesh) -> tempfile::NamedTempFile {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        writeln!(file, "solid tool").unwrap();
        for t in in_mm(mesh) {
            writeln!(file, "facet normal 0 0 0\nouter loop").unwrap();
            for v in t {
                writeln!(file, "vertex {} {} {}", v[0], v[1], v[2]).unwrap();
            }
            writeln!(file, "endloop\nendfacet").unwrap();
        }
        writeln!(file, "endsolid tool").unwrap();
        file
    }

    #[test]
    fn surface_survives_the_round_trip_in_both_formats() {
        let mesh = hemisphere(0.05, 0.008);
        for file in [binary(&mesh), ascii(&mesh)] {
            let back = read(file.path(), 1e-3, [0.0, 0.0, 0.01]).unwrap();
            assert_eq!(back.points.len(), mesh.points.len());
            assert_eq!(back.triangles.len(), mesh.triangles.len());
            assert!(back.is_watertight());
            assert!((back.volume() / mesh.volume() - 1.0).abs() < 1e-6);
            assert!((back.bounds()[0][2] - 0.01).abs() < 1e-9, "translation");
        }
    }

    #[test]
    fn all_solids_of_a_text_file_are_read_and_each_must_have_its_outside() {
        let dome = hemisphere(0.05, 0.01);
        let moved = |turned: bool| {
            let mut mesh = dome.clone();
            mesh.points.iter_mut().for_each(|p| p[0] += 0.2);
            if turned {
                mesh.triangles.iter_mut().for_each(|t| t.swap(0, 1));
            }
            mesh
        };
        let both = |second: &ToolMesh, name: &str| {
            let mut file = tempfile::NamedTempFile::new().unwrap();
            for mesh in [&dome, second] {
                let text = std::fs::read_to_string(ascii(mesh).path()).unwrap();
                write!(file, "{}\n\n", text.replace("solid tool", name)).unwrap();
            }
            read(file.path(), 1e-3, [0.0; 3])
        };
        for name in ["solid tool", "solid"] {
            let read = both(&moved(false), name).unwrap();
            assert_eq!(read.triangles.len(), 2 * dome.triangles.len(), "{name}");
            assert!((read.volume() / dome.volume() - 2.0).abs() < 1e-5);
            assert_eq!(read.shells().len(), 2);
        }
        // Smaller than the first, so that the volume of both is positive.
        let mut small = moved(true);
        small.points.iter_mut().for_each(|p| {
            *p = [0.2 + 0.5 * (p[0] - 0.2), 0.5 * p[1], 0.5 * p[2]];
        });
        let text = both(&small, "solid tool").unwrap_err().to_string();
        assert!(text.contains("of one of its 2 bodies, that at ("), "{text}");
    }

    #[test]
    fn facets_without_area_are_dropped() {
        let mut mesh = hemisphere(0.05, 0.01);
        let count = mesh.triangles.len();
        mesh.triangles.insert(3, [5, 5, 6]);
        assert_eq!(
            read(binary(&mesh).path(), 1e-3, [0.0; 3])
                .unwrap()
                .triangles
                .len(),
            count
        );
    }

    #[test]
    fn wrong_orientation_is_an_error_that_says_so() {
        let mesh = hemisphere(0.05, 0.01);
        let text = |mesh: &ToolMesh| {
            read(binary(mesh).path(), 1e-3, [0.0; 3])
                .unwrap_err()
                .to_string()
        };
        let mut inward = mesh.clone();
        inward.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        assert!(text(&inward).contains("point inwards"), "{}", text(&inward));
        let mut mixed = mesh.clone();
        mixed.triangles[7].swap(0, 1);
        assert!(
            text(&mixed).contains("oriented against each other"),
            "{}",
            text(&mixed)
        );
        let mut double = mesh.clone();
        // There twice, it is the same; as a wall it is one too many.
        double.triangles.push(mesh.triangles[2]);
        read(binary(&double).path(), 1e-3, [0.0; 3]).unwrap();
        let [a, b, c] = mesh.triangles[2];
        double.triangles.push([b, a, c]);
        assert!(
            text(&double).contains("more than two facets"),
            "{}",
            text(&double)
        );
        // Open at its foot either way round.
        let wall = |t: &[u32; 3]| t.iter().any(|&p| mesh.points[p as usize][2] > 1e-9);
        let mut open = mesh.clone();
        open.triangles.retain(wall);
        assert!(!open.is_watertight());
        read(binary(&open).path(), 1e-3, [0.0; 3]).unwrap();
        open.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        assert!(text(&open).contains("point inwards"), "{}", text(&open));
    }

    #[test]
    fn a_hole_is_named_with_its_place_and_not_taken_for_a_wrong_side() {
        let mesh = hemisphere(0.05, 0.01);
        let mut holed = mesh.clone();
        let top = |t: &[u32; 3]| t.iter().all(|&p| mesh.points[p as usize][2] > 0.04);
        let at = mesh.triangles.iter().position(top).unwrap();
        holed.triangles.remove(at);
        let error = read(binary(&holed).path(), 1e-3, [0.0; 3]).unwrap_err();
        let text = error.to_string();
        assert!(
            text.contains("a hole or a free rim above its foot: the edge from (")
                && text.contains("(3 such edges in all)")
                && text.contains("close it"),
            "{text}"
        );
    }

    #[test]
    fn a_file_that_is_cut_off_or_something_else_is_called_so() {
        let whole = std::fs::read(binary(&hemisphere(0.05, 0.01)).path()).unwrap();
        let told = |bytes: &[u8]| {
            let mut file = tempfile::NamedTempFile::new().unwrap();
            file.write_all(bytes).unwrap();
            read(file.path(), 1e-3, [0.0; 3]).unwrap_err().to_string()
        };
        let cut = told(&whole[..84 + 50 * 7 + 20]);
        assert!(cut.contains("it ends after 7 of the "), "{cut}");
        let step = told(b"ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('tool'),'2;1');\n");
        assert!(step.contains("it is a STEP file"), "{step}");
        let page = told(b"<!DOCTYPE html>\n<html><body>Log in</body></html>\n");
        assert!(page.contains("it is HTML or XML"), "{page}");
        assert!(told(b"").contains("it is empty"), "{}", told(b""));
    }

    #[test]
    fn missing_and_broken_files_are_errors_that_name_the_file() {
        let missing = read(Path::new("no-such-tool.stl"), 1e-3, [0.0; 3])
            .unwrap_err()
            .to_string();
        assert!(missing.contains("no-such-tool.stl"), "{missing}");
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(&[7; 90]).unwrap();
        let broken = read(file.path(), 1e-3, [0.0; 3]).unwrap_err().to_string();
        assert!(
            broken.contains(&file.path().display().to_string()),
            "{broken}"
        );
    }
}
