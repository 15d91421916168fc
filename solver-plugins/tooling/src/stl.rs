//! Tools from STL files.

use crate::error::ToolError;
use crate::mesh::ToolMesh;
use crate::vector::{V3, cross, norm, sub};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Points closer than this part of the tool's diagonal are one.
const WELD: f64 = 1e-6;

/// Reads a binary or ASCII file, welds its points, drops facets without area and checks that the rest is a
/// surface with a consistent outside. Closed surfaces must have positive volume; open ones must face up.
pub(crate) fn read(path: &Path, unit: f64, translate: V3) -> Result<ToolMesh, ToolError> {
    let read_error = |source| ToolError::Read {
        path: path.to_owned(),
        source,
    };
    let surface_error = |problem: String, remedy: &str| ToolError::Surface {
        path: path.to_owned(),
        problem,
        remedy: remedy.to_owned(),
    };
    if !(unit > 0.0 && unit.is_finite()) {
        return Err(ToolError::length(
            "stl",
            "unit",
            unit,
            "it must be greater than 0 mm".into(),
            "give the length of one unit of the file, such as `1 mm`",
        ));
    }
    let mut input = BufReader::new(File::open(path).map_err(read_error)?);
    let mut soup: Vec<[V3; 3]> = Vec::new();
    for (facet, triangle) in stl_io::create_stl_reader(&mut input)
        .map_err(read_error)?
        .enumerate()
    {
        let corners = triangle
            .map_err(read_error)?
            .vertices
            .map(|v| std::array::from_fn(|k| f64::from(v.0[k]) * unit + translate[k]));
        if corners.iter().flatten().any(|c: &f64| !c.is_finite()) {
            return Err(surface_error(
                format!(
                    "facet {} has a coordinate that is not a finite number",
                    facet + 1
                ),
                "export the file again",
            ));
        }
        soup.push(corners);
    }
    let mesh = weld(&soup);
    if mesh.triangles.is_empty() {
        return Err(surface_error(
            format!("none of its {} facets has an area", soup.len()),
            "export the tool's surface as facets",
        ));
    }
    check(&mesh, unit, translate).map_err(|(problem, remedy)| surface_error(problem, remedy))?;
    Ok(mesh)
}

/// Joins equal points; facets that lose a corner or have no area are dropped.
fn weld(soup: &[[V3; 3]]) -> ToolMesh {
    let corners = ToolMesh {
        points: soup.iter().flatten().copied().collect(),
        triangles: Vec::new(),
    };
    let [low, high] = corners.bounds();
    let near = WELD * norm(sub(high, low));
    let mut order: Vec<u32> = (0..corners.points.len() as u32).collect();
    order.sort_by(|&a, &b| {
        let (p, q) = (corners.points[a as usize], corners.points[b as usize]);
        p[0].total_cmp(&q[0]).then(a.cmp(&b))
    });
    // Each corner takes the first of the sorted corners within reach that stands for itself.
    let mut stands_for = vec![u32::MAX; order.len()];
    let mut mesh = ToolMesh::default();
    let mut kept: Vec<(f64, u32)> = Vec::new();
    let mut window = 0;
    for &c in &order {
        let p = corners.points[c as usize];
        while window < kept.len() && kept[window].0 < p[0] - near {
            window += 1;
        }
        let found = kept[window..]
            .iter()
            .map(|&(_, q)| q)
            .find(|&q| norm(sub(mesh.points[q as usize], p)) <= near);
        stands_for[c as usize] = found.unwrap_or_else(|| {
            let q = mesh.push(p);
            kept.push((p[0], q));
            q
        });
    }
    for t in 0..soup.len() {
        let [a, b, c] = [3 * t, 3 * t + 1, 3 * t + 2].map(|k| stands_for[k]);
        let [p, q, r] = [a, b, c].map(|k| mesh.points[k as usize]);
        let longest = norm(sub(q, p)).max(norm(sub(r, q))).max(norm(sub(p, r)));
        let height = norm(cross(sub(q, p), sub(r, p))) / longest;
        if a != b && b != c && c != a && height > 0.0 {
            mesh.triangles.push([a, b, c]);
        }
    }
    mesh
}

fn check(mesh: &ToolMesh, unit: f64, translate: V3) -> Result<(), (String, &'static str)> {
    let adjacency = mesh.adjacency();
    let place = |[a, b]: [u32; 2]| {
        let text = [a, b].map(|p| {
            let q: V3 = std::array::from_fn(|k| (mesh.points[p as usize][k] - translate[k]) / unit);
            format!("({:.4}, {:.4}, {:.4})", q[0], q[1], q[2])
        });
        format!(
            "the edge from {} to {} (in the file's units)",
            text[0], text[1]
        )
    };
    if let Some(edge) = adjacency.crowded {
        return Err((
            format!("{} has more than two facets", place(edge)),
            "export one surface without double or inner walls",
        ));
    }
    if let Some(edge) = adjacency.flipped {
        return Err((
            format!(
                "the two facets at {} are oriented against each other",
                place(edge)
            ),
            "make the normals consistent (in MeshLab: Re-Orient all faces coherently)",
        ));
    }
    let remedy = "flip the facets so that they point away from the tool";
    if adjacency.open_edges == 0 {
        let volume = mesh.volume();
        if volume <= 0.0 {
            return Err((
                format!("its facets point inwards (volume {volume:.3e} m3)"),
                remedy,
            ));
        }
    } else {
        let up: f64 = (0..mesh.triangles.len())
            .map(|t| mesh.area_normal(t)[2])
            .sum();
        if up <= 0.0 {
            return Err((
                format!(
                    "it is open ({} free edges) and faces down",
                    adjacency.open_edges
                ),
                remedy,
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hemisphere::hemisphere;
    use std::io::Write;

    fn facets(mesh: &ToolMesh) -> Vec<stl_io::Triangle> {
        (0..mesh.triangles.len())
            .map(|t| stl_io::Triangle {
                normal: stl_io::Normal::new([0.0; 3]),
                vertices: mesh
                    .corners(t)
                    .map(|p| stl_io::Vertex::new(p.map(|c| (c * 1e3) as f32))),
            })
            .collect()
    }

    fn binary(mesh: &ToolMesh) -> tempfile::NamedTempFile {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        stl_io::write_stl(&mut file, facets(mesh).iter()).unwrap();
        file
    }

    fn ascii(mesh: &ToolMesh) -> tempfile::NamedTempFile {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        writeln!(file, "solid tool").unwrap();
        for t in facets(mesh) {
            writeln!(file, "facet normal 0 0 0\nouter loop").unwrap();
            for v in t.vertices {
                writeln!(file, "vertex {} {} {}", v.0[0], v.0[1], v.0[2]).unwrap();
            }
            writeln!(file, "endloop\nendfacet").unwrap();
        }
        writeln!(file, "endsolid tool").unwrap();
        file
    }

    #[test]
    fn surface_survives_the_round_trip_in_both_formats() {
        let mesh = hemisphere(0.05, 0.008).unwrap();
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
    fn facets_without_area_are_dropped() {
        let mut mesh = hemisphere(0.05, 0.01).unwrap();
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
        let mesh = hemisphere(0.05, 0.01).unwrap();
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
        double.triangles.push(mesh.triangles[2]);
        assert!(
            text(&double).contains("more than two facets"),
            "{}",
            text(&double)
        );
        let mut open = inward.clone();
        let high = |t: &[u32; 3]| t.iter().any(|&p| mesh.points[p as usize][2] > 0.02);
        open.triangles.retain(high);
        assert!(text(&open).contains("faces down"), "{}", text(&open));
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
