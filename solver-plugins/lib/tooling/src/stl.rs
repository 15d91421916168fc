//! Tools from STL files.

use crate::error::ToolError;
use crate::facets;
use crate::mesh::{Adjacency, ToolMesh};
use plyflow_files::open::{self, MOST_DATA};
use plyflow_files::stl::{self, Facets};
use plyflow_geometry::vec3::{Vec3, dot, sub};
use std::path::Path;

/// How far above its lowest point, over its height, a tool may be open.
const FOOT: f64 = 1e-3;

/// Reads a file ([`plyflow_files::stl`]), joins its facets ([`facets::join`]) and checks that they are a surface with a consistent
/// outside, open at its foot at most.
pub(crate) fn read(path: &Path, unit: f64, translate: Vec3) -> Result<ToolMesh, ToolError> {
    let surface_error = |problem: String, remedy: &str| ToolError::Surface {
        path: path.to_owned(),
        problem,
        remedy: remedy.to_owned(),
    };
    let bytes = open::read(path, MOST_DATA).map_err(|source| ToolError::Read {
        path: path.to_owned(),
        source,
    })?;
    let mut read = stl::parse(&bytes).map_err(|e| ToolError::Stl(e.of(path)))?;
    drop(bytes);
    for corners in &mut read.corners {
        for p in corners.iter_mut() {
            *p = std::array::from_fn(|k| p[k] * unit + translate[k]);
        }
        if corners.as_flattened().iter().any(|c| !c.is_finite()) {
            return Err(surface_error(
                "it has a coordinate that is too large".to_owned(),
                "export the file again",
            ));
        }
    }
    let surface = facets::join(&read.corners);
    let mesh = ToolMesh {
        points: surface.points,
        triangles: surface.triangles,
    };
    if mesh.triangles.is_empty() {
        return Err(surface_error(
            format!("none of its {} facets has an area", read.corners.len()),
            "export the tool's surface as facets",
        ));
    }
    let checked = Checked {
        mesh: &mesh,
        facet: &surface.facet,
        read: &read,
        unit,
        translate,
    };
    checked
        .check()
        .map_err(|(problem, remedy)| surface_error(problem, remedy))?;
    Ok(mesh)
}

/// A surface beside the file that it is of.
struct Checked<'a> {
    mesh: &'a ToolMesh,
    /// Facet of the file for each of the mesh.
    facet: &'a [u32],
    read: &'a Facets,
    unit: f64,
    translate: Vec3,
}

impl Checked<'_> {
    /// A point in the file's units.
    fn point(&self, p: Vec3) -> String {
        let q: Vec3 = std::array::from_fn(|k| (p[k] - self.translate[k]) / self.unit);
        format!("({:.4}, {:.4}, {:.4})", q[0], q[1], q[2])
    }

    /// An edge, and the first facet of the file that has it.
    fn edge(&self, [a, b]: [u32; 2]) -> String {
        let has = |t: &[u32; 3]| t.contains(&a) && t.contains(&b);
        let of = self.mesh.triangles.iter().position(has);
        let place = of.map_or(String::new(), |t| {
            format!(", {}", self.read.place(self.facet[t] as usize))
        });
        let [p, q] = [a, b].map(|p| self.point(self.mesh.points[p as usize]));
        format!("the edge from {p} to {q} (in the file's units{place})")
    }

    fn check(&self) -> Result<(), (String, &'static str)> {
        let (mesh, adjacency) = (self.mesh, self.mesh.adjacency());
        if let Some(edge) = adjacency.crowded {
            return Err((
                format!("{} has more than two facets", self.edge(edge)),
                "export one surface without double or inner walls",
            ));
        }
        if let Some(edge) = adjacency.flipped {
            return Err((
                format!(
                    "the two facets at {} are oriented against each other",
                    self.edge(edge)
                ),
                "make the normals consistent (in MeshLab: Re-Orient all faces coherently)",
            ));
        }
        self.outside(&adjacency)?;
        // A rim higher up has no outside beside it.
        let [low, high] = mesh.bounds();
        let near = low[2] + FOOT * (high[2] - low[2]);
        let is_high = |edge: &&[u32; 2]| edge.iter().any(|p| mesh.points[*p as usize][2] > near);
        if let Some(edge) = adjacency.open.iter().find(is_high) {
            return Err((
                format!(
                    "it has a hole or a free rim above its foot: {} has one facet only ({} such edges in all)",
                    self.edge(*edge),
                    adjacency.open.iter().filter(is_high).count()
                ),
                "close it (in MeshLab: Close Holes), or draw its walls down to its foot",
            ));
        }
        Ok(())
    }

    /// Whether each body has its outside outside.
    fn outside(&self, adjacency: &Adjacency) -> Result<(), (String, &'static str)> {
        let mesh = self.mesh;
        // About a point at the foot: where a tool is open there, what is missing has no part in it.
        let [low, high] = mesh.bounds();
        let foot = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2]];
        let bodies = bodies(adjacency);
        let count = bodies.iter().max().map_or(0, |b| b + 1);
        let (mut volumes, mut first) = (vec![0.0; count], vec![usize::MAX; count]);
        for (t, &body) in bodies.iter().enumerate() {
            volumes[body] += dot(sub(mesh.corners(t)[0], foot), mesh.area_normal(t)) / 6.0;
            first[body] = first[body].min(t);
        }
        let Some(body) = volumes.iter().position(|v| *v <= 0.0) else {
            return Ok(());
        };
        let which = match count {
            1 => "its facets point inwards".to_owned(),
            n => format!(
                "the facets of one of its {n} bodies, that at {} (in the file's units, {}), point inwards",
                self.point(mesh.corners(first[body])[0]),
                self.read.place(self.facet[first[body]] as usize)
            ),
        };
        Err((
            format!("{which} (volume {:.3e} m3)", volumes[body]),
            "flip the facets so that they point away from the tool; a cavity inside of a tool is to be left out",
        ))
    }
}

/// For each facet the body of which it is: facets that share edges. The order is that of their first facets.
fn bodies(adjacency: &Adjacency) -> Vec<usize> {
    let mut of = vec![usize::MAX; adjacency.neighbour.len()];
    let mut count = 0;
    for first in 0..of.len() {
        if of[first] != usize::MAX {
            continue;
        }
        let mut open = vec![first];
        of[first] = count;
        while let Some(t) = open.pop() {
            for next in adjacency.neighbour[t].into_iter().flatten() {
                if of[next as usize] == usize::MAX {
                    of[next as usize] = count;
                    open.push(next as usize);
                }
            }
        }
        count += 1;
    }
    of
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hemisphere::hemisphere;
    use std::io::Write;

    fn facets(mesh: &ToolMesh) -> Vec<[Vec3; 3]> {
        let all = 0..mesh.triangles.len();
        all.map(|t| mesh.corners(t).map(|p| p.map(|c| 1e3 * c)))
            .collect()
    }

    fn binary(mesh: &ToolMesh) -> tempfile::NamedTempFile {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(&stl::write(&facets(mesh))).unwrap();
        file
    }

    fn ascii(mesh: &ToolMesh) -> tempfile::NamedTempFile {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        writeln!(file, "solid tool").unwrap();
        for t in facets(mesh) {
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
