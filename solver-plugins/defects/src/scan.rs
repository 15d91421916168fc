//! Scanned preforms: facets from STL files, or clouds of points, which are joined to facets here.

use nalgebra::{Matrix3, Vector3};
use plyflow_surface::vector::{Vec3, cross, dot, norm, sub};
use rstar::RTree;
use rstar::primitives::GeomWithData;
use spade::{DelaunayTriangulation, Point2, Triangulation};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

/// What a file holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Scan {
    /// (m)
    pub points: Vec<Vec3>,
    /// Empty for a cloud: see [`join`].
    pub triangles: Vec<[u32; 3]>,
}

/// Why a scan cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ScanError {
    /// The file cannot be opened or is no STL.
    #[error("cannot read the scan `{path}`: {source}")]
    Read {
        /// As given.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Neither facets nor points by its name.
    #[error(
        "`{path}` is called neither *.stl (facets) nor *.xyz, *.txt, *.asc or *.csv (x y z of a point on each line); give one of these"
    )]
    Kind {
        /// As given.
        path: PathBuf,
    },
    /// A line that holds no point.
    #[error(
        "{path}:{line}: `{text}` does not begin with three numbers x, y, z; correct or remove the line"
    )]
    Line {
        /// As given.
        path: PathBuf,
        /// From 1.
        line: usize,
        /// As given, at most 60 characters.
        text: String,
    },
    /// Too little to measure.
    #[error("the scan `{path}` has {found} points; at least {LEAST} are needed")]
    Few {
        /// As given.
        path: PathBuf,
        /// Number of points.
        found: usize,
    },
}

/// A surface has at least so many points.
const LEAST: usize = 20;

/// Reads a scan whose numbers are in `unit` (m). STL: facets, corners at bit-equal places are one point. `.xyz`, `.txt`, `.asc`,
/// `.csv`: a point a line, its first three numbers, parted by blanks, commas or semicolons; empty lines, those that begin with
/// `#` or `//`, and a first line of words are passed over.
///
/// # Errors
/// See [`ScanError`].
pub fn read(path: &Path, unit: f64) -> Result<Scan, ScanError> {
    let extension = path.extension().map(|e| e.to_ascii_lowercase());
    let scan = match extension.as_deref().and_then(|e| e.to_str()) {
        Some("stl") => read_stl(path, unit)?,
        Some("xyz" | "txt" | "asc" | "csv") => read_points(path, unit)?,
        _ => {
            return Err(ScanError::Kind {
                path: path.to_owned(),
            });
        }
    };
    if scan.points.len() < LEAST {
        return Err(ScanError::Few {
            path: path.to_owned(),
            found: scan.points.len(),
        });
    }
    Ok(scan)
}

fn read_stl(path: &Path, unit: f64) -> Result<Scan, ScanError> {
    let failed = |source| ScanError::Read {
        path: path.to_owned(),
        source,
    };
    let mut input = BufReader::new(File::open(path).map_err(failed)?);
    let mesh = stl_io::read_stl(&mut input).map_err(failed)?;
    let place = |v: &stl_io::Vertex| [0, 1, 2].map(|k| f64::from(v[k]) * unit);
    Ok(Scan {
        points: mesh.vertices.iter().map(place).collect(),
        triangles: (mesh.faces.iter())
            .map(|f| f.vertices.map(|i| i as u32))
            .filter(|t| t[0] != t[1] && t[1] != t[2] && t[2] != t[0])
            .collect(),
    })
}

fn read_points(path: &Path, unit: f64) -> Result<Scan, ScanError> {
    let failed = |source| ScanError::Read {
        path: path.to_owned(),
        source,
    };
    let input = BufReader::new(File::open(path).map_err(failed)?);
    let (mut points, mut first) = (Vec::new(), true);
    for (k, line) in input.lines().enumerate() {
        let line = line.map_err(failed)?;
        let text = line.trim();
        if text.is_empty() || text.starts_with('#') || text.starts_with("//") {
            continue;
        }
        let words = text.split(|c: char| c.is_whitespace() || c == ',' || c == ';');
        let numbers: Vec<f64> = (words.filter(|w| !w.is_empty()).take(3))
            .map_while(|w| w.parse().ok().filter(|v: &f64| v.is_finite()))
            .collect();
        if let [x, y, z] = numbers[..] {
            points.push([x, y, z].map(|v| v * unit));
        } else if !(first && text.starts_with(|c: char| c.is_alphabetic() || c == '"')) {
            return Err(ScanError::Line {
                path: path.to_owned(),
                line: k + 1,
                text: text.chars().take(60).collect(),
            });
        }
        first = false;
    }
    Ok(Scan {
        points,
        triangles: Vec::new(),
    })
}

/// Neighbours of a point that its triangles are looked for among.
const NEIGHBOURS: usize = 20;
/// Sides of triangles are at most so many times as long as the way to the sixth neighbour.
const LONGEST: f64 = 2.5;
/// Least height of a triangle over its longest side: three points in a row along the rim make none.
const FLATTEST: f64 = 0.02;

/// Joins a cloud of points on an open surface to triangles, by Delaunay triangulations in the tangent planes (M. Gopi, S. Krishnan, C. T. Silva,
/// Comput. Graph. Forum 19 (2000) 467): each point proposes those around it; what all three corners propose is taken first,
/// then what fits in between. `outward(p)` is a direction on the surface's outer side at `p`.
pub fn join(points: &[Vec3], outward: impl Fn(Vec3) -> Vec3) -> Vec<[u32; 3]> {
    let tree = RTree::bulk_load(
        (points.iter().enumerate())
            .map(|(i, p)| GeomWithData::new(*p, i as u32))
            .collect(),
    );
    let mut votes: BTreeMap<[u32; 3], u32> = BTreeMap::new();
    for i in 0..points.len() {
        for triangle in around(points, &tree, i) {
            *votes.entry(triangle).or_default() += 1;
        }
    }
    let mut proposed: Vec<([u32; 3], u32, f64)> = votes
        .into_iter()
        .map(|(t, n)| {
            let [a, b, c] = t.map(|i| points[i as usize]);
            let sides = norm(sub(b, a)) * norm(sub(c, b)) * norm(sub(a, c));
            let area = norm(cross(sub(b, a), sub(c, a)));
            (t, n, sides / (2.0 * area).max(f64::MIN_POSITIVE))
        })
        .collect();
    // Most votes first, then the smallest circle; the corners decide between equals.
    proposed.sort_by(|a, b| b.1.cmp(&a.1).then(a.2.total_cmp(&b.2)).then(a.0.cmp(&b.0)));
    let mut sides = BTreeSet::new();
    let mut taken = Vec::new();
    for (t, _, _) in proposed {
        let [a, b, c] = t.map(|i| points[i as usize]);
        let up = dot(cross(sub(b, a), sub(c, a)), outward(a)) > 0.0;
        let t = if up { t } else { [t[0], t[2], t[1]] };
        // Each side once in each direction: two triangles at a side lie on its two sides.
        let own = [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
        if own.iter().all(|s| !sides.contains(s)) {
            sides.extend(own);
            taken.push(t);
        }
    }
    taken.sort_unstable();
    taken
}

type Tree = RTree<GeomWithData<Vec3, u32>>;

/// Triangles around a point (corners ascending) in the Delaunay triangulation of its neighbours in their plane.
fn around(points: &[Vec3], tree: &Tree, i: usize) -> Vec<[u32; 3]> {
    let near: Vec<u32> = (tree.nearest_neighbor_iter(&points[i]))
        .map(|n| n.data)
        .filter(|&n| n as usize == i || points[n as usize] != points[i])
        .take(NEIGHBOURS + 1)
        .collect();
    let reach = LONGEST
        * near
            .get(6)
            .map_or(f64::INFINITY, |&n| norm(sub(points[n as usize], points[i])));
    let axes = plane(points, &near, points[i]);
    let mut flat = DelaunayTriangulation::<Point2<f64>>::new();
    let mut names = Vec::new();
    // The point itself first: handle 0.
    let others = near.iter().copied().filter(|&n| n as usize != i);
    for n in std::iter::once(i as u32).chain(others) {
        let d = Vector3::from(sub(points[n as usize], points[i])) / reach;
        let Ok(handle) = flat.insert(Point2::new(d.dot(&axes[0]), d.dot(&axes[1]))) else {
            return Vec::new();
        };
        if handle.index() == names.len() {
            names.push(n);
        }
    }
    let own = |f: &[usize; 3]| f.contains(&0);
    let faces = flat.inner_faces().map(|f| f.vertices().map(|v| v.index()));
    let shaped = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| points[i as usize]);
        let sides = [sub(b, a), sub(c, b), sub(a, c)];
        let longest = sides.into_iter().map(norm).fold(0.0, f64::max);
        longest <= reach && norm(cross(sides[0], sides[1])) >= FLATTEST * longest * longest
    };
    faces
        .filter(own)
        .map(|f| {
            let mut t = f.map(|k| names[k]);
            t.sort_unstable();
            t
        })
        .filter(shaped)
        .collect()
}

/// Two unit directions of the plane that lies nearest to the points.
fn plane(points: &[Vec3], near: &[u32], at: Vec3) -> [Vector3<f64>; 2] {
    let spread = near.iter().fold(Matrix3::zeros(), |m, &n| {
        // The nearest decide: on a crest the farther ones lie on both its sides.
        let d = Vector3::from(sub(points[n as usize], at));
        m + d * d.transpose() / d.norm_squared().powi(2).max(f64::MIN_POSITIVE)
    });
    let parts = spread.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| parts.eigenvalues[b].total_cmp(&parts.eigenvalues[a]));
    [0, 1].map(|k| parts.eigenvectors.column(order[k]).into_owned())
}
