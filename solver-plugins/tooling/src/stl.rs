//! Tools from STL files.

use crate::error::ToolError;
use crate::mesh::ToolMesh;
use crate::vector::{V3, cross, dot, norm, sub};
use std::borrow::Cow;
use std::fs::File;
use std::io::{Cursor, Read};
use std::path::Path;

/// How far above its lowest point, over its height, a tool may be open.
const FOOT: f64 = 1e-3;

/// Points closer than this part of the tool's diagonal are one.
const WELD: f64 = 1e-6;

/// Reads a binary or ASCII file, welds its points, drops facets without area and checks that the rest is a
/// surface with a consistent outside, open at its foot at most.
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
    let bytes = std::fs::read(path).map_err(read_error)?;
    let unreadable = |source| match no_stl(path) {
        Some((problem, remedy)) => surface_error(problem, remedy),
        None => read_error(source),
    };
    let mut soup: Vec<[V3; 3]> = Vec::new();
    for solid in solids(&bytes) {
        let mut input = Cursor::new(&solid[..]);
        for triangle in stl_io::create_stl_reader(&mut input).map_err(unreadable)? {
            let corners = triangle
                .map_err(unreadable)?
                .vertices
                .map(|v| std::array::from_fn(|k| f64::from(v.0[k]) * unit + translate[k]));
            if corners.iter().flatten().any(|c: &f64| !c.is_finite()) {
                return Err(surface_error(
                    format!(
                        "facet {} has a coordinate that is not a finite number",
                        soup.len() + 1
                    ),
                    "export the file again",
                ));
            }
            soup.push(corners);
        }
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

/// The solids of a text file, each as a file of its own (the reader takes the first alone, and asks for a name); anything else as it is.
pub fn solids(bytes: &[u8]) -> Vec<Cow<'_, [u8]>> {
    let whole = || vec![Cow::Borrowed(bytes)];
    let Ok(text) = std::str::from_utf8(bytes) else {
        return whole();
    };
    // A binary file may begin with the word too.
    if !text.trim_start().starts_with("solid") || !text.contains("facet") {
        return whole();
    }
    let mut solids: Vec<Cow<'_, [u8]>> = Vec::new();
    let mut lines: Vec<&str> = Vec::new();
    for line in text.lines().filter(|l| !l.trim().is_empty()) {
        let first = lines.is_empty();
        lines.push(if first { "solid of_a_tool" } else { line });
        if line.trim_start().starts_with("endsolid") {
            solids.push(Cow::Owned((lines.join("\n") + "\n").into_bytes()));
            lines.clear();
        }
    }
    if !lines.is_empty() {
        solids.push(Cow::Owned((lines.join("\n") + "\n").into_bytes()));
    }
    solids
}

/// What a file that cannot be read is instead, and what to do.
fn no_stl(path: &Path) -> Option<(String, &'static str)> {
    const HEAD: usize = 84;
    let length = std::fs::metadata(path).ok()?.len();
    let mut head = Vec::new();
    let file = File::open(path).ok()?;
    file.take(HEAD as u64).read_to_end(&mut head).ok()?;
    if head.is_empty() {
        return Some(("it is empty".into(), "export the tool's surface again"));
    }
    let text = String::from_utf8_lossy(&head);
    let text = text.trim_start();
    for (start, what) in [
        ("ISO-10303", "a STEP file"),
        ("<", "HTML or XML"),
        ("PK", "a zip archive"),
    ] {
        if text.starts_with(start) {
            let problem = format!("it is {what}, no STL file");
            return Some((problem, "export the tool's surface as STL"));
        }
    }
    if text.starts_with("solid") {
        return None;
    }
    // Binary: 80 bytes of text, the number of facets, 50 bytes for each.
    let count: [u8; 4] = head.get(80..HEAD)?.try_into().ok()?;
    let count = u64::from(u32::from_le_bytes(count));
    let there = (length - HEAD as u64) / 50;
    (there < count).then(|| {
        (
            format!("it ends after {there} of the {count} facets that it announces"),
            "it was cut off, or is no STL file: copy or export it again",
        )
    })
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
    // About a point at the foot: where a tool is open there, what is missing has no part in it.
    let [low, high] = mesh.bounds();
    let foot = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2]];
    let shells = mesh.shells();
    for shell in &shells {
        let volume: f64 = (0..shell.triangles.len())
            .map(|t| dot(sub(shell.corners(t)[0], foot), shell.area_normal(t)) / 6.0)
            .sum();
        if volume <= 0.0 {
            let which = match shells.len() {
                1 => "its facets point inwards".to_owned(),
                n => {
                    let at = shell.corners(0)[0];
                    let q: V3 = std::array::from_fn(|k| (at[k] - translate[k]) / unit);
                    format!(
                        "the facets of one of its {n} bodies, that at ({:.4}, {:.4}, {:.4}) (in the file's units), point inwards",
                        q[0], q[1], q[2]
                    )
                }
            };
            return Err((
                format!("{which} (volume {volume:.3e} m3)"),
                "flip the facets so that they point away from the tool; a cavity inside of a tool is to be left out",
            ));
        }
    }
    // A rim higher up has no outside beside it.
    let near = low[2] + FOOT * (high[2] - low[2]);
    let is_high = |edge: &&[u32; 2]| edge.iter().any(|p| mesh.points[*p as usize][2] > near);
    if let Some(edge) = adjacency.open.iter().find(is_high) {
        return Err((
            format!(
                "it has a hole or a free rim above its foot: {} has one facet only ({} such edges in all)",
                place(*edge),
                adjacency.open.iter().filter(is_high).count()
            ),
            "close it (in MeshLab: Close Holes), or draw its walls down to its foot",
        ));
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
    fn all_solids_of_a_text_file_are_read_and_each_must_have_its_outside() {
        let dome = hemisphere(0.05, 0.01).unwrap();
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
        let mesh = hemisphere(0.05, 0.01).unwrap();
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
        let whole = std::fs::read(binary(&hemisphere(0.05, 0.01).unwrap()).path()).unwrap();
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
