//! Scanned preforms: facets from STL files, or clouds of points, which are joined to facets here.

use nalgebra::{Matrix3, Vector3};
use plyflow_surface::vector::{Vec3, add, cross, dot, norm, scale, sub};
use plyflow_tooling::stl::solids;
use rstar::RTree;
use rstar::primitives::GeomWithData;
use spade::{DelaunayTriangulation, Point2, Triangulation};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fs::File;
use std::io::{BufRead, BufReader, Cursor};
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
    /// A facet that lies nowhere.
    #[error(
        "the scan `{path}`: facet {facet} has a corner whose coordinates are not all finite numbers; export the scan again"
    )]
    Facet {
        /// As given.
        path: PathBuf,
        /// From 1.
        facet: usize,
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

/// Corners closer than this part of the diagonal of the box around a scan are one.
const WELD: f64 = 1e-6;

/// Reads a scan whose numbers are in `unit` (m). STL: the facets of all solids; corners nearer to each other than a millionth of the scan's diagonal are
/// one point, facets that lose a corner by that or repeat another one are left out; how they are wound is left to [`orient`]. `.xyz`, `.txt`, `.asc`, `.csv`: a point a line, its first three numbers, parted by blanks, commas or semicolons; empty lines, those that begin with
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
    let bytes = std::fs::read(path).map_err(failed)?;
    let mut corners: Vec<Vec3> = Vec::new();
    for solid in solids(&bytes) {
        let mut input = Cursor::new(&solid[..]);
        for facet in stl_io::create_stl_reader(&mut input).map_err(failed)? {
            let facet = facet.map_err(failed)?.vertices;
            if facet.iter().flat_map(|v| v.0).any(|c| !c.is_finite()) {
                return Err(ScanError::Facet {
                    path: path.to_owned(),
                    facet: corners.len() / 3 + 1,
                });
            }
            corners.extend(facet.map(|v| v.0.map(|c| f64::from(c) * unit)));
        }
    }
    let (points, stands_for) = weld(&corners);
    let mut seen = BTreeSet::new();
    let mut whole = |t: &[u32; 3]| {
        let mut sorted = *t;
        sorted.sort_unstable();
        let [a, b, c] = sorted;
        a != b && b != c && seen.insert(sorted)
    };
    let facets = stands_for.as_chunks::<3>().0;
    Ok(Scan {
        triangles: facets.iter().copied().filter(|t| whole(t)).collect(),
        points,
    })
}

/// The places of corners, those within reach of an earlier one left out, and the place that each corner takes: seams, where a file gives the same
/// place with other last digits, are closed.
fn weld(corners: &[Vec3]) -> (Vec<Vec3>, Vec<u32>) {
    // The equal ones first, which are most by far. Adding zero turns -0 into 0.
    let mut first: HashMap<[u64; 3], u32> = HashMap::new();
    let mut places: Vec<GeomWithData<Vec3, u32>> = Vec::new();
    let of_corner: Vec<u32> = (corners.iter())
        .map(|p| {
            let p = p.map(|c| c + 0.0);
            *first.entry(p.map(f64::to_bits)).or_insert_with(|| {
                places.push(GeomWithData::new(p, places.len() as u32));
                places.len() as u32 - 1
            })
        })
        .collect();
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for place in &places {
        for d in 0..3 {
            low[d] = low[d].min(place.geom()[d]);
            high[d] = high[d].max(place.geom()[d]);
        }
    }
    let near = WELD * norm(sub(high, low));
    let tree = RTree::bulk_load(places.clone());
    let mut points = Vec::new();
    let mut stands_for = vec![u32::MAX; places.len()];
    for place in &places {
        if stands_for[place.data as usize] != u32::MAX {
            continue;
        }
        for other in tree.locate_within_distance(*place.geom(), near * near) {
            let taken = &mut stands_for[other.data as usize];
            *taken = (*taken).min(points.len() as u32);
        }
        // Whatever the search's rounding makes of a distance of 0.
        stands_for[place.data as usize] = points.len() as u32;
        points.push(*place.geom());
    }
    let stands_for = of_corner.iter().map(|&i| stands_for[i as usize]);
    (points, stands_for.collect())
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
