//! Reading scans and aligning them.

use nalgebra::{Isometry3, Point3, Vector3};
use plyflow_defects::align::{Settings, align};
use plyflow_defects::scan::read;
use plyflow_model::scene::Tool;
use plyflow_surface::Surface;
use plyflow_surface::vector::{Vec3, add, cross, distance, scale, sub, unit};
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
    let rows: String = (0..30).map(|i| format!("{i}, {},5;7\n", 2 * i)).collect();
    fs::write(&path, format!("x,y,z\n# a remark\n\n{rows}")).unwrap();
    let scan = read(&path, 0.001).unwrap();
    assert_eq!((scan.points.len(), scan.triangles.len()), (30, 0));
    assert_eq!(scan.points[3], [0.003, 0.006, 0.005]);
    fs::write(&path, "x,y,z\n1 2 3\nnext\n").unwrap();
    let error = read(&path, 0.001).unwrap_err().to_string();
    assert!(error.ends_with("scan.csv:3: `next` does not begin with three numbers x, y, z; correct or remove the line"), "{error}");
    fs::write(&path, "1 2 3\n1 2 nan\n").unwrap();
    assert!(
        read(&path, 0.001)
            .unwrap_err()
            .to_string()
            .contains(":2: `1 2 nan`")
    );
    fs::write(&path, "1 2 3\n").unwrap();
    assert!(
        read(&path, 0.001)
            .unwrap_err()
            .to_string()
            .contains("has 1 points")
    );
    let error = read(&folder.path().join("scan.ply"), 1.0).unwrap_err();
    assert!(error.to_string().contains("*.stl"), "{error}");
    let error = read(&folder.path().join("none.xyz"), 1.0).unwrap_err();
    assert!(error.to_string().contains("none.xyz"), "{error}");
}

#[test]
fn facets_of_an_stl_share_their_corners() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.STL");
    let mesh = spar();
    let facet = |t: &[u32; 3]| stl_io::Triangle {
        normal: stl_io::Normal::new([0.0; 3]),
        vertices: t.map(|i| stl_io::Vertex::new(mesh.points[i as usize].map(|v| 1e3 * v as f32))),
    };
    let facets: Vec<stl_io::Triangle> = mesh.triangles.iter().map(facet).collect();
    let mut file = fs::File::create(&path).unwrap();
    stl_io::write_stl(&mut file, facets.iter()).unwrap();
    let scan = read(&path, 0.001).unwrap();
    assert_eq!(scan.triangles.len(), mesh.triangles.len());
    assert!(scan.points.len() <= mesh.points.len());
    let far = scan.points.iter().map(|p| p[0]).fold(0.0, f64::max);
    assert!((far - 0.31).abs() < 1e-6, "{far}");
}
