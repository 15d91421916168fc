//! Reading scans and aligning them.

use nalgebra::{Isometry3, Point3, Vector3};
use plyflow_defects::align::{MOST_PASSES, Settings, align};
use plyflow_defects::scan::{orient, read};
use plyflow_files::stl::write;
use plyflow_geometry::vec3::{Vec3, add, cross, distance, scale, sub, unit};
use plyflow_model::scene::Tool;
use plyflow_surface::Surface;
use std::fs;

fn spar() -> plyflow_tooling::ToolMesh {
    let tool: Tool = serde_json::from_value(serde_json::json!({"joggle_spar": {
        "length": "620 mm", "top_width": "130 mm", "height": "110 mm", "draft": "8 deg",
        "fillet": "14 mm", "corner": "40 mm", "facet_size": "8 mm",
        "joggles": [{"start": "-115 mm", "length": "30 mm", "rise": "10 mm", "skew": "20 deg",
                     "side_step": ["6 mm", "0 mm"], "fillet": "14 mm"}]}}))
    .unwrap();
    plyflow_tooling::build(&tool).unwrap()
}

/// Points `height(k)` above the middles of facets.
fn above(points: &[Vec3], facets: &[[u32; 3]], height: impl Fn(usize) -> f64) -> Vec<Vec3> {
    let place = |(k, t): (usize, &[u32; 3])| {
        let [a, b, c] = t.map(|i| points[i as usize]);
        let middle = scale(add(a, add(b, c)), 1.0 / 3.0);
        add(middle, scale(unit(cross(sub(b, a), sub(c, a))), height(k)))
    };
    facets.iter().enumerate().map(place).collect()
}

#[test]
fn a_scan_finds_its_place_though_a_tenth_of_it_stands_off() {
    let mesh = spar();
    let tool = Surface::new(&mesh.points, &mesh.triangles).unwrap();
    let settings = Settings {
        offset: 0.0009,
        kept: 0.8,
        most_points: 20000,
    };
    // Every tenth point 4 mm too high.
    let height = |k: usize| if k % 10 == 3 { 0.0049 } else { 0.0009 };
    let right = above(&mesh.points, &mesh.triangles, height);
    let motion = Isometry3::new(
        Vector3::new(0.004, -0.006, 0.005),
        Vector3::new(0.02, -0.03, 0.04),
    );
    let moved: Vec<Vec3> = right
        .iter()
        .map(|&p| (motion * Point3::from(p)).coords.into())
        .collect();
    let found = align(&moved, &tool, &settings).unwrap();
    assert_eq!(found.decided, 6);
    let worst = moved
        .iter()
        .zip(&right)
        .map(|(m, r)| distance(found.place(*m), *r))
        .fold(0.0, f64::max);
    // Chords in a valley are 0.02 mm off.
    assert!(worst < 2e-5, "{worst} {found:?}");
    assert!(found.rms < 1e-5, "{found:?}");
}

#[test]
fn what_the_surface_does_not_decide_stays() {
    // A sheet on a plane may be shifted and turned in it.
    let points: Vec<Vec3> = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
        .map(|[x, y]| [x, y, 0.0])
        .into();
    let plane = Surface::new(&points, &[[0, 1, 2], [0, 2, 3]]).unwrap();
    let scan: Vec<Vec3> = (0..100)
        .map(|k| {
            let (x, y) = (0.01 * f64::from(k % 10), 0.01 * f64::from(k / 10));
            [x, y, 0.003 + 0.1 * x]
        })
        .collect();
    let settings = Settings {
        offset: 0.001,
        kept: 1.0,
        most_points: 1000,
    };
    let found = align(&scan, &plane, &settings).unwrap();
    assert_eq!(found.decided, 3);
    for p in &scan {
        let q = found.place(*p);
        assert!((q[2] - 0.001).abs() < 1e-9, "{p:?} {q:?}");
        // Turned down about the middle, it moves along the plane by a hair; nothing shifts or turns it there.
        assert!((q[0] - p[0]).hypot(q[1] - p[1]) < 1e-3, "{p:?} {q:?}");
    }
    assert_eq!(align(&scan[..5], &plane, &settings), None);
    // Beyond the plane's edge there is nothing to lie on.
    let beside: Vec<Vec3> = scan.iter().map(|p| [p[0] + 5.0, p[1], p[2]]).collect();
    assert_eq!(align(&beside, &plane, &settings), None);
}

#[test]
fn points_are_read_in_their_unit_and_what_is_no_point_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.csv");
    let rows: String = (0..30).map(|i| format!("{i}, {},5\n", 2 * i)).collect();
    fs::write(&path, format!("x,y,z\n# a remark\n\n{rows}")).unwrap();
    let scan = read(&path, Some(0.001)).unwrap();
    assert_eq!((scan.points.len(), scan.triangles.len()), (30, 0));
    assert_eq!(scan.points[3], [0.003, 0.006, 0.005]);
    fs::write(&path, "x,y,z\n1 2 3\nnext\n").unwrap();
    let error = read(&path, Some(0.001)).unwrap_err().to_string();
    assert!(
        error.contains("scan.csv:3: `next` has 1 values where line 2 has 3"),
        "{error}"
    );
    fs::write(&path, "1 2 3\n1 2 nan\n").unwrap();
    assert!(
        read(&path, Some(0.001))
            .unwrap_err()
            .to_string()
            .contains(":2: `1 2 nan`")
    );
    fs::write(&path, "1 2 3\n").unwrap();
    assert!(
        read(&path, Some(0.001))
            .unwrap_err()
            .to_string()
            .contains("has 1 points")
    );
    let error = read(&folder.path().join("scan.ply"), None).unwrap_err();
    assert!(error.to_string().contains("*.stl"), "{error}");
    let error = read(&folder.path().join("none.xyz"), None).unwrap_err();
    assert!(error.to_string().contains("none.xyz"), "{error}");
}

#[test]
fn facets_of_an_stl_share_their_corners() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.STL");
    let mesh = spar();
    let facet = |t: &[u32; 3]| t.map(|i| mesh.points[i as usize].map(|v| 1e3 * v));
    let facets: Vec<[Vec3; 3]> = mesh.triangles.iter().map(facet).collect();
    fs::write(&path, write(&facets)).unwrap();
    let scan = read(&path, Some(0.001)).unwrap();
    assert_eq!(scan.triangles.len(), mesh.triangles.len());
    assert!(scan.points.len() <= mesh.points.len());
    let far = scan.points.iter().map(|p| p[0]).fold(0.0, f64::max);
    assert!((far - 0.31).abs() < 1e-6, "{far}");
}

/// Facets as an ASCII STL has them, in mm.
fn solid(header: &str, points: &[Vec3], facets: &[[u32; 3]]) -> String {
    let mut text = format!("{header}\n");
    for t in facets {
        text += "facet normal 0 0 0\nouter loop\n";
        for [x, y, z] in t.map(|i| points[i as usize].map(|v| 1e3 * v)) {
            text += &format!("vertex {x:?} {y:?} {z:?}\n");
        }
        text += "endloop\nendfacet\n";
    }
    text + "endsolid\n"
}

#[test]
fn all_solids_of_a_text_file_are_read_and_none_needs_a_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.stl");
    let mesh = spar();
    let half = mesh.triangles.len() / 2;
    let (first, second) = mesh.triangles.split_at(half);
    for header in ["solid", "solid patch"] {
        let both = solid(header, &mesh.points, first) + "\n" + &solid(header, &mesh.points, second);
        fs::write(&path, both).unwrap();
        let scan = read(&path, Some(0.001)).unwrap();
        assert_eq!(scan.triangles.len(), mesh.triangles.len(), "{header}");
        // The patches hang together.
        assert!(scan.points.len() <= mesh.points.len());
    }
}

#[test]
fn a_facet_that_lies_nowhere_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.stl");
    let mesh = spar();
    for wrong in [f64::NAN, f64::INFINITY] {
        let facet = |t: &[u32; 3]| t.map(|i| mesh.points[i as usize].map(|v| 1e3 * v));
        let mut facets: Vec<[Vec3; 3]> = mesh.triangles.iter().map(facet).collect();
        facets[6][1][2] = wrong;
        fs::write(&path, write(&facets)).unwrap();
        let error = read(&path, Some(0.001)).unwrap_err().to_string();
        assert!(
            error.contains("scan.stl: facet 7 has") && error.contains("export the file again"),
            "{error}"
        );
    }
}

/// 20 x 10 squares of 5 mm about the origin, flat, each in two facets.
fn sheet() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let points = (0..11)
        .flat_map(|j| {
            (0..21).map(move |i| {
                [
                    0.005 * f64::from(i) - 0.05,
                    0.005 * f64::from(j) - 0.025,
                    0.0,
                ]
            })
        })
        .collect();
    let at = |i: u32, j: u32| 21 * j + i;
    let facets = (0..10)
        .flat_map(|j| (0..20).map(move |i| (i, j)))
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    (points, facets)
}

#[test]
fn seams_are_closed_and_facets_that_collapse_or_repeat_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.stl");
    let (points, facets) = sheet();
    let left = |t: &&[u32; 3]| t.iter().all(|&i| points[i as usize][0] < 1e-9);
    let (left, right): (Vec<[u32; 3]>, Vec<[u32; 3]>) = facets.iter().partition(left);
    // The right patch has its border at -0 and 0.00001 mm off in y; two facets more are there twice, and as thin as that.
    let off = |p: &Vec3| {
        if p[0].abs() < 1e-9 {
            [-0.0, p[1] + 1e-8, -0.0]
        } else {
            *p
        }
    };
    let mut moved: Vec<Vec3> = points.iter().map(off).collect();
    moved.push([0.01 + 1e-8, 0.01, 0.0]);
    moved.push([0.01, 0.01, 0.0]);
    let [thin, other] = [moved.len() as u32 - 2, moved.len() as u32 - 1];
    let mut with = right.clone();
    with.extend([
        right[3],
        [right[4][1], right[4][0], right[4][2]],
        [thin, other, right[0][0]],
    ]);
    fs::write(
        &path,
        solid("solid", &points, &left) + &solid("solid", &moved, &with),
    )
    .unwrap();
    let scan = read(&path, Some(0.001)).unwrap();
    assert_eq!(
        (scan.points.len(), scan.triangles.len()),
        (points.len(), facets.len())
    );
    assert!(
        scan.points
            .iter()
            .flatten()
            .all(|c| c.to_bits() != (-0.0f64).to_bits())
    );
}

#[test]
fn facets_wound_against_each_other_are_wound_as_the_outside_has_it() {
    let (points, facets) = sheet();
    let up = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| points[i as usize]);
        cross(sub(b, a), sub(c, a))[2] > 0.0
    };
    let turn = |which: &dyn Fn(usize) -> bool| -> Vec<[u32; 3]> {
        let each = facets.iter().enumerate();
        each.map(|(k, t)| if which(k) { [t[0], t[2], t[1]] } else { *t })
            .collect()
    };
    let above = |_: Vec3| Some([0.0, 0.0, 1.0]);
    // A patch, and single ones.
    for which in [
        &|k: usize| k < 150,
        &(|k: usize| k % 7 == 3 || k > 310) as &dyn Fn(usize) -> bool,
    ] {
        let mut mixed = turn(which);
        orient(&points, &mut mixed, above);
        assert!(mixed.iter().all(up));
        // Where only one corner knows the outside, the rest follows it.
        let mut mixed = turn(which);
        let corner = |p: Vec3| (p[0] < -0.04 && p[1] < -0.02).then_some([0.0, 0.0, 1.0]);
        orient(&points, &mut mixed, corner);
        assert!(mixed.iter().all(up));
    }
    // Two that do not touch, 100 mm apart.
    let mut apart = points.clone();
    apart.extend(points.iter().map(|p| [p[0] + 0.2, p[1], p[2]]));
    let mut both = facets.clone();
    both.extend(
        turn(&|_| true)
            .iter()
            .map(|t| t.map(|i| i + points.len() as u32)),
    );
    orient(&apart, &mut both, above);
    let right = both[facets.len()..]
        .iter()
        .map(|t| t.map(|i| i - points.len() as u32));
    assert!(
        right
            .chain(both[..facets.len()].iter().copied())
            .all(|t| up(&t))
    );
    // All alike, they stay.
    for which in [&|_| true, &(|_| false) as &dyn Fn(usize) -> bool] {
        let mut alike = turn(which);
        orient(&points, &mut alike, above);
        assert_eq!(alike, turn(which));
    }
}

#[test]
fn the_freedoms_are_those_of_the_surface_and_not_of_its_facets() {
    let tool = |of: serde_json::Value| {
        let tool: Tool = serde_json::from_value(of).unwrap();
        plyflow_tooling::build(&tool).unwrap()
    };
    let settings = Settings {
        offset: 0.0009,
        kept: 0.9,
        most_points: 20000,
    };
    let freedoms = |mesh: &plyflow_tooling::ToolMesh, seen: &dyn Fn(&Vec3) -> bool| {
        let surface = Surface::new(&mesh.points, &mesh.triangles).unwrap();
        let scan = above(&mesh.points, &mesh.triangles, |_| 0.0009);
        let motion = Isometry3::new(
            Vector3::new(0.001, -0.002, 0.001),
            Vector3::new(0.01, -0.02, 0.01),
        );
        let moved: Vec<Vec3> = (scan.iter().filter(|p| seen(p)))
            .map(|&p| (motion * Point3::from(p)).coords.into())
            .collect();
        let found = align(&moved, &surface, &settings).unwrap();
        assert!(found.converged, "{found:?}");
        assert!(found.rms < 3e-5, "{found:?}");
        found.decided
    };
    for size in ["2 mm", "4 mm"] {
        let dome = tool(serde_json::json!({"hemisphere": {"radius": "50 mm", "facet_size": size}}));
        assert_eq!(freedoms(&dome, &|p| p[2] > 0.010), 3, "{size}");
    }
    // Its ends do not count for what lies on its length alone.
    let prism = tool(serde_json::json!({"joggle_spar": {
        "length": "620 mm", "top_width": "130 mm", "height": "110 mm", "draft": "8 deg",
        "fillet": "14 mm", "corner": "40 mm", "facet_size": "8 mm", "joggles": []}}));
    assert_eq!(freedoms(&prism, &|p| p[0].abs() < 0.15), 5);
    assert_eq!(freedoms(&spar(), &|_| true), 6);
}

#[test]
fn a_scan_that_does_not_come_to_rest_says_so() {
    let mesh = spar();
    let tool = Surface::new(&mesh.points, &mesh.triangles).unwrap();
    let mut state = 7u64;
    let mut random = move || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let settings = Settings {
        offset: 0.001,
        kept: 1.0,
        most_points: 1000,
    };
    let mut restless = 0;
    for _ in 0..8 {
        // Dust all around the tool, of which every point counts.
        let dust: Vec<Vec3> = (0..100)
            .map(|_| [0.3, 0.1, 0.1].map(|s| s * random()))
            .collect();
        let found = align(&dust, &tool, &settings).unwrap();
        if found.converged {
            assert!(found.last_motion < 1e-9, "{found:?}");
        } else {
            assert!(found.last_motion > 1e-9, "{found:?}");
            assert_eq!(found.passes, MOST_PASSES);
            restless += 1;
        }
    }
    assert!(restless > 0);
}
