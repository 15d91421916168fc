//! Scanned preforms: facets from STL files, or clouds of points, which are joined to facets here.

use crate::points;
use nalgebra::{Matrix3, Vector3};
use plyflow_files::open::{FileError, MOST_DATA};
use plyflow_files::text::excerpt;
use plyflow_files::{open, stl};
use plyflow_geometry::vec3::{Vec3, add, cross, dot, norm, scale, sub};
use plyflow_tooling::facets;
use rstar::RTree;
use rstar::primitives::GeomWithData;
use spade::{DelaunayTriangulation, Point2, Triangulation};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// What a file holds.
#[derive(Debug, Clone, PartialEq)]
pub struct Scan {
    /// (m)
    pub points: Vec<Vec3>,
    /// Empty for a cloud: see [`join`].
    pub triangles: Vec<[u32; 3]>,
    /// What one unit of the file's numbers was taken for (m).
    pub unit: f64,
}

/// Why a scan cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ScanError {
    /// The file cannot be opened.
    #[error("cannot read the scan `{path}`: {source}")]
    Read {
        /// As given.
        path: PathBuf,
        /// Why.
        source: FileError,
    },
    /// Neither facets nor points by its name.
    #[error(
        "`{path}` is called neither *.stl (facets) nor *.xyz, *.txt, *.asc, *.csv, *.tsv or *.dat (x y z of a point on each line); give one of these"
    )]
    Kind {
        /// As given.
        path: PathBuf,
    },
    /// What is in it is no scan: `file:line: problem; remedy`.
    #[error("{0}")]
    Content(String),
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

/// Reads a scan whose numbers are in `unit` (m; `None`: as a table's header says, else millimetres). STL: the facets of all solids
/// ([`plyflow_files::stl`], joined by [`plyflow_tooling::facets::join`]); facets that repeat another one are left out; how they are wound is left to
/// [`orient`]. `.xyz`, `.txt`, `.asc`, `.csv`, `.tsv`, `.dat`: a point a line, in the columns that a header calls x, y and z, else in the first three.
///
/// # Errors
/// See [`ScanError`].
pub fn read(path: &Path, unit: Option<f64>) -> Result<Scan, ScanError> {
    let extension = path.extension().map(|e| e.to_ascii_lowercase());
    let extension = extension.as_deref().and_then(|e| e.to_str());
    let facets = extension == Some("stl");
    if !facets
        && !matches!(
            extension,
            Some("xyz" | "txt" | "asc" | "csv" | "tsv" | "dat")
        )
    {
        return Err(ScanError::Kind {
            path: path.to_owned(),
        });
    }
    let bytes = open::read(path, MOST_DATA).map_err(|source| ScanError::Read {
        path: path.to_owned(),
        source,
    })?;
    let scan = if facets {
        of_facets(&bytes, unit.unwrap_or(1e-3))
            .map_err(|e| ScanError::Content(format!("the scan {}", e.of(path))))?
    } else {
        let name = excerpt(&path.display().to_string(), 300);
        let read = points::read(&bytes, unit).map_err(|e| ScanError::Content(e.of(&name)))?;
        Scan {
            points: read.points,
            triangles: Vec::new(),
            unit: read.unit,
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

fn of_facets(bytes: &[u8], unit: f64) -> Result<Scan, stl::StlError> {
    let mut read = stl::parse(bytes)?;
    for p in read.corners.as_flattened_mut() {
        *p = p.map(|c| c * unit);
    }
    let surface = facets::join(&read.corners);
    let mut seen = BTreeSet::new();
    let mut first = |t: &[u32; 3]| {
        let mut sorted = *t;
        sorted.sort_unstable();
        seen.insert(sorted)
    };
    let mut triangles = surface.triangles;
    triangles.retain(|t| first(t));
    Ok(Scan {
        triangles,
        points: surface.points,
        unit,
    })
}

/// Winds all facets alike, where some are wound against others: as along every side that two of them share the one goes against the other, so on what
/// hangs together all of them; and what hangs together so that, on the whole and by area, it has its face where `outward` (a direction on the outer side at a
/// place; `None` where none can be told) has it. Facets that are wound alike already stay, whichever way that is.
pub fn orient(points: &[Vec3], triangles: &mut [[u32; 3]], outward: impl Fn(Vec3) -> Option<Vec3>) {
    let pieces = pieces(triangles);
    let alike = |p: &Piece| p.holds && p.facets.iter().all(|f| !f.1);
    if let [one] = &pieces[..]
        && alike(one)
    {
        return;
    }
    // Twice the area of a facet that has its face on the outer side, negative for one that has its back there.
    let faces = |t: usize| {
        let [a, b, c] = triangles[t].map(|i| points[i as usize]);
        let middle = scale(add(a, add(b, c)), 1.0 / 3.0);
        outward(middle).map_or(0.0, |n| dot(cross(sub(b, a), sub(c, a)), n))
    };
    let mut turned = vec![false; triangles.len()];
    for piece in &pieces {
        let signed = |&(t, other): &(usize, bool)| if other { -faces(t) } else { faces(t) };
        let back = piece.facets.iter().map(signed).sum::<f64>() < 0.0;
        for &(t, other) in &piece.facets {
            // A band with a half turn has no sides: there each facet is for itself.
            turned[t] = if piece.holds {
                other != back
            } else {
                faces(t) < 0.0
            };
        }
    }
    if turned.iter().all(|t| *t) {
        return;
    }
    for (t, turned) in triangles.iter_mut().zip(turned) {
        if turned {
            t.swap(1, 2);
        }
    }
}

/// Facets that hang together over sides that two of them share.
struct Piece {
    /// Index, and whether it is wound against the first one.
    facets: Vec<(usize, bool)>,
    /// Whether that is the same along whatever way one goes from one to the other.
    holds: bool,
}

fn pieces(triangles: &[[u32; 3]]) -> Vec<Piece> {
    let mut sides: Vec<(u32, u32, usize, bool)> = (triangles.iter().enumerate())
        .flat_map(|(t, c)| {
            [(c[0], c[1]), (c[1], c[2]), (c[2], c[0])].map(|(a, b)| (a.min(b), a.max(b), t, a < b))
        })
        .collect();
    sides.sort_unstable();
    // By facet: its neighbours, and whether they are wound against it. A side of three facets has no two sides to tell.
    let mut next: Vec<Vec<(usize, bool)>> = vec![Vec::new(); triangles.len()];
    for group in sides.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        if let [(.., t, forth), (.., u, back)] = *group {
            next[t].push((u, forth == back));
            next[u].push((t, forth == back));
        }
    }
    let mut winding: Vec<Option<bool>> = vec![None; triangles.len()];
    let mut found = Vec::new();
    for start in 0..triangles.len() {
        if winding[start].is_some() {
            continue;
        }
        winding[start] = Some(false);
        let mut piece = Piece {
            facets: vec![(start, false)],
            holds: true,
        };
        let mut at = 0;
        while let Some(&(t, own)) = piece.facets.get(at) {
            for &(u, against) in &next[t] {
                match winding[u] {
                    None => {
                        winding[u] = Some(own != against);
                        piece.facets.push((u, own != against));
                    }
                    Some(there) => piece.holds &= there == (own != against),
                }
            }
            at += 1;
        }
        found.push(piece);
    }
    found
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
