//! Meshes of the shapes that plies are cut to, at several element sizes.

use plyflow_blank::quality::{self, most_cells_at_inner_node};
use plyflow_blank::{Blank, LEAST_FEATURE, mesh_region};
use plyflow_mechanics::mesh::{NONE, QuadMesh};
use plyflow_model::outline::{Point, Region, segment_distance, sides};
use plyflow_model::scene::Sheet;
use serde_json::json;
use std::f64::consts::TAU;

fn round(centre: Point, radius: f64, corners: usize) -> Vec<Point> {
    let at = |k: usize| (TAU * k as f64 / corners as f64).sin_cos();
    (0..corners)
        .map(|k| [centre[0] + radius * at(k).1, centre[1] + radius * at(k).0])
        .collect()
}

fn rectangle(length: f64, width: f64) -> Vec<Point> {
    let (x, y) = (0.5 * length, 0.5 * width);
    vec![[-x, -y], [x, -y], [x, y], [-x, y]]
}

fn turned(corners: &[Point], degrees: f64) -> Vec<Point> {
    let (s, c) = degrees.to_radians().sin_cos();
    corners
        .iter()
        .map(|p| [c * p[0] - s * p[1], s * p[0] + c * p[1]])
        .collect()
}

fn region(outline: Vec<Point>, holes: Vec<Vec<Point>>) -> Region {
    Region::new(outline, holes).expect("a region")
}

/// Names, regions and their sharpest corners (deg).
fn shapes() -> Vec<(&'static str, Region, f64)> {
    let ell = vec![
        [0.0, 0.0],
        [0.2, 0.0],
        [0.2, 0.08],
        [0.07, 0.08],
        [0.07, 0.15],
        [0.0, 0.15],
    ];
    let slender = vec![
        [0.0, 0.0],
        [0.25, 0.0],
        [0.25, 0.25 * 20f64.to_radians().tan()],
    ];
    let star: Vec<Point> = (0..10)
        .map(|k| {
            let (s, c) = (TAU * k as f64 / 10.0).sin_cos();
            let r = if k % 2 == 0 { 0.12 } else { 0.06 };
            [r * c, r * s]
        })
        .collect();
    let plate = || rectangle(0.2, 0.12);
    vec![
        ("rectangle", region(plate(), vec![]), 90.0),
        ("hexagon", region(round([0.0; 2], 0.1, 6), vec![]), 120.0),
        ("ell", region(ell.clone(), vec![]), 90.0),
        ("48-gon", region(round([0.0; 2], 0.1, 48), vec![]), 172.5),
        (
            "ring",
            region(
                round([0.0; 2], 0.1, 360),
                vec![round([0.01, 0.02], 0.03, 360)],
            ),
            179.0,
        ),
        (
            "round hole",
            region(plate(), vec![round([0.03, 0.01], 0.025, 48)]),
            90.0,
        ),
        (
            "square hole",
            region(plate(), vec![rectangle(0.04, 0.04)]),
            90.0,
        ),
        (
            "two holes",
            region(
                plate(),
                vec![round([-0.05, 0.0], 0.02, 90), round([0.05, 0.01], 0.03, 90)],
            ),
            90.0,
        ),
        ("slender", region(slender, vec![]), 20.0),
        (
            "turned rectangle",
            region(turned(&plate(), 30.0), vec![]),
            90.0,
        ),
        ("turned ell", region(turned(&ell, 30.0), vec![]), 90.0),
        (
            "turned, with a hole",
            region(turned(&plate(), 30.0), vec![rectangle(0.06, 0.04)]),
            90.0,
        ),
        ("star", region(star, vec![]), 45.0),
    ]
}

/// That the mesh's free edges are the contours: every node on them, every sharp corner a node, each edge once.
fn follows(mesh: &QuadMesh, region: &Region, what: &str) {
    let boundary = mesh.on_boundary();
    let at = |n: usize| [mesh.points[n][0], mesh.points[n][1]];
    for n in (0..mesh.points.len()).filter(|n| boundary[*n]) {
        assert!(
            region.distance_to_edge(at(n)) < 1e-12,
            "{what}: {:?}",
            at(n)
        );
    }
    for contour in region.contours() {
        let k = contour.len();
        for i in 0..k {
            let (a, b, c) = (contour[(i + k - 1) % k], contour[i], contour[(i + 1) % k]);
            let turn = ((c[1] - b[1]).atan2(c[0] - b[0]) - (b[1] - a[1]).atan2(b[0] - a[0])).sin();
            if turn.abs() > 0.5 {
                let near = |n: usize| (at(n)[0] - b[0]).hypot(at(n)[1] - b[1]);
                let least = (0..mesh.points.len()).map(near).fold(f64::MAX, f64::min);
                assert!(least < 1e-15, "{what}: no node on the corner {b:?}");
            }
        }
    }
    // Every boundary node has one free edge in and one out: the free edges are closed curves that do not touch.
    let mut out = vec![0; mesh.points.len()];
    let mut inwards = vec![0; mesh.points.len()];
    for (cell, near) in mesh.cells.iter().zip(mesh.neighbours()) {
        for e in (0..4).filter(|e| near[*e] == NONE) {
            out[cell[e] as usize] += 1;
            inwards[cell[(e + 1) % 4] as usize] += 1;
        }
    }
    for n in 0..mesh.points.len() {
        let wanted = usize::from(boundary[n]);
        assert_eq!([out[n], inwards[n]], [wanted; 2], "{what}: node {n}");
    }
    // One component with one hole for each of the region's: Euler's number.
    let edges = (4 * mesh.cells.len() + boundary.iter().filter(|b| **b).count()) / 2;
    let euler = mesh.points.len() as i64 - edges as i64 + mesh.cells.len() as i64;
    assert_eq!(euler, 1 - region.holes.len() as i64, "{what}");
}

#[test]
fn meshes_follow_their_outlines_with_sound_quads() {
    for (name, region, sharpest) in shapes() {
        for size in [0.004, 0.005, 0.0075, 0.01, 0.015] {
            let what = format!("{name} at {size} m");
            let mesh = mesh_region(&region, size).unwrap_or_else(|e| panic!("{what}: {e}"));
            let q = quality::of(&mesh, &region, size);
            // One cell at least has the angle of the sharpest corner, or a part of it.
            let corner = f64::to_radians(sharpest.min(90.0));
            assert!(
                q.least_scaled_jacobian >= 0.65f64.min(0.999 * corner.sin()),
                "{what}: {q:?}"
            );
            assert!(
                q.least_angle >= f64::to_radians(40.0).min(0.999 * corner),
                "{what}: {q:?}"
            );
            assert!(q.largest_angle < f64::to_radians(145.0), "{what}: {q:?}");
            assert!(q.least_edge >= 0.35, "{what}: {q:?}");
            assert!(q.edge_ratio < 4.0, "{what}: {q:?}");
            // In the star's arms no two triangles can join without a flat cell at the edge.
            let most = if name == "star" { 6 } else { 5 };
            assert!(most_cells_at_inner_node(&mesh) <= most, "{what}: {q:?}");
            // Straight sides are followed exactly; chords cut off a share of the square of their length over the radius.
            let curved = region.contours().any(|c| c.len() > 12);
            let bound = if curved {
                0.5 * (size / 0.025f64).powi(2) / 12.0
            } else {
                1e-12
            };
            assert!(q.area_error.abs() < bound, "{what}: {q:?}");
            let cells = region.area() / (size * size);
            assert!(
                (mesh.cells.len() as f64 / cells - 1.0).abs()
                    < if size < 0.012 { 0.2 } else { 0.35 },
                "{what}: {} of {cells}",
                mesh.cells.len()
            );
            follows(&mesh, &region, &what);
        }
    }
}

#[test]
fn a_rectangle_given_as_a_polygon_has_the_regular_grid() {
    let plain = Blank::Rectangle([-0.1, -0.06, 0.1, 0.06])
        .mesh(0.005)
        .unwrap()
        .0;
    let polygon = mesh_region(&region(rectangle(0.2, 0.12), vec![]), 0.005).unwrap();
    assert_eq!(plain.cells.len(), polygon.cells.len());
    for p in &plain.points {
        let near = polygon
            .points
            .iter()
            .map(|q| (p[0] - q[0]).hypot(p[1] - q[1]));
        assert!(near.fold(f64::MAX, f64::min) < 1e-9, "{p:?}");
    }
}

#[test]
fn inside_of_a_turned_outline_the_grid_keeps_its_axes() {
    let region = region(turned(&rectangle(0.3, 0.2), 30.0), vec![]);
    let mesh = mesh_region(&region, 0.005).unwrap();
    let inner = mesh.cells.iter().filter(|c| {
        let p = c.map(|n| mesh.points[n as usize]);
        let middle = [0, 1].map(|k| 0.25 * p.iter().map(|x| x[k]).sum::<f64>());
        region.distance_to_edge(middle) > 0.05
    });
    let mut count = 0;
    for c in inner {
        let [a, b, _, d] = c.map(|n| mesh.points[n as usize]);
        let slope = (b[0] - a[0]).abs().min((b[1] - a[1]).abs())
            + (d[0] - a[0]).abs().min((d[1] - a[1]).abs());
        assert!(slope < 1e-12, "{slope}");
        count += 1;
    }
    assert!(count > 500, "{count}");
}

#[test]
fn the_mesh_of_a_contour_does_not_depend_on_its_sense() {
    for (name, region, _) in shapes() {
        let reversed = |c: &Vec<Point>| c.iter().rev().copied().collect::<Vec<_>>();
        let other = Region::new(
            reversed(&region.outline),
            region.holes.iter().map(reversed).collect(),
        )
        .unwrap();
        let (a, b) = (
            mesh_region(&region, 0.01).unwrap(),
            mesh_region(&other, 0.01).unwrap(),
        );
        let (a, b) = (
            quality::of(&a, &region, 0.01),
            quality::of(&b, &other, 0.01),
        );
        // Only where a contour begins may differ, and with it where the nodes of a round one lie.
        assert!(
            (a.least_scaled_jacobian - b.least_scaled_jacobian).abs() < 0.1,
            "{name}: {a:?} {b:?}"
        );
        if name != "ring" {
            assert_eq!(
                mesh_region(&region, 0.01).unwrap(),
                mesh_region(&region, 0.01).unwrap()
            );
        }
    }
}

/// Random numbers in 0..1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}

#[test]
fn random_blanks_are_meshed_soundly_or_refused_with_a_size_that_works() {
    let (mut meshed, mut refused, mut random) = (0, 0, Random(7));
    for case in 0..120 {
        let corners = 3 + (random.next() * 9.0) as usize;
        let outline: Vec<Point> = (0..corners)
            .map(|k| {
                let (s, c) = (TAU * (k as f64 + 0.6 * random.next()) / corners as f64).sin_cos();
                let r = 0.06 + 0.08 * random.next();
                [r * c, r * s]
            })
            .collect();
        let place = [0.04 * (random.next() - 0.5), 0.04 * (random.next() - 0.5)];
        let hole = round(
            place,
            0.008 + 0.02 * random.next(),
            3 + (random.next() * 40.0) as usize,
        );
        let Ok(region) = Region::new(outline, vec![hole]) else {
            continue;
        };
        let size = 0.003 + 0.007 * random.next();
        match mesh_region(&region, size) {
            Ok(mesh) => {
                let q = quality::of(&mesh, &region, size);
                let what = format!("case {case}: {region:?} at {size}: {q:?}");
                let narrowest = region
                    .contours()
                    .flat_map(|c| angles(c))
                    .fold(90.0f64, f64::min);
                let bound = 0.3f64.min(0.95 * narrowest.to_radians().sin());
                assert!(q.least_scaled_jacobian > bound, "{what}");
                assert!(q.least_edge > 0.15, "{what}");
                assert!(most_cells_at_inner_node(&mesh) <= 5, "{what}");
                follows(&mesh, &region, &what);
                meshed += 1;
            }
            Err(e) => {
                assert!(
                    e.to_string().contains("too small for elements of"),
                    "case {case}: {e}"
                );
                refused += 1;
            }
        }
    }
    assert!(meshed > 60 && refused >= 3, "{meshed} {refused}");
}

/// Angles of the region at a contour's corners (deg).
fn angles(contour: &[Point]) -> impl Iterator<Item = f64> + '_ {
    let k = contour.len();
    (0..k).map(move |i| {
        let (a, b, c) = (contour[(i + k - 1) % k], contour[i], contour[(i + 1) % k]);
        let (u, v) = (
            (a[1] - b[1]).atan2(a[0] - b[0]),
            (c[1] - b[1]).atan2(c[0] - b[0]),
        );
        (u - v).rem_euclid(TAU).to_degrees()
    })
}

#[test]
fn what_is_too_small_for_the_elements_is_refused_with_place_and_size() {
    let refused = |region: &Region, size: f64| mesh_region(region, size).unwrap_err().to_string();
    let plate = rectangle(0.2, 0.12);
    let mut notched = plate.clone();
    notched.splice(
        1..1,
        [[0.0, -0.06], [0.0, -0.058], [0.02, -0.058], [0.02, -0.06]],
    );
    let side = refused(&region(notched, vec![]), 0.005);
    assert!(
        side.contains("a side at (0, -60) mm measures 2.000 mm"),
        "{side}"
    );
    assert!(side.contains("at most 2.857 mm"), "{side}");
    let hole = region(plate.clone(), vec![round([0.0; 2], 0.003, 60)]);
    let tiny = refused(&hole, 0.01);
    assert!(
        tiny.contains("contour") && tiny.contains("10.000 mm"),
        "{tiny}"
    );
    let near = region(plate, vec![round([0.0, 0.038], 0.02, 60)]);
    let neck = refused(&near, 0.005);
    assert!(
        neck.contains("material between two edges") && neck.contains("measures 2.0"),
        "{neck}"
    );
    // The size that each names does it.
    assert!(mesh_region(&near, 0.002 / LEAST_FEATURE).is_ok());
}

#[test]
fn a_sheet_of_the_scene_becomes_a_blank_where_it_stands() {
    let sheet = |with: serde_json::Value| -> Sheet {
        let mut value = json!({"name": "ply", "kind": "ply", "material": "m.yaml", "centre": ["10 mm", "0 mm"]});
        value
            .as_object_mut()
            .unwrap()
            .extend(with.as_object().unwrap().clone());
        serde_json::from_value(value).expect("a sheet")
    };
    let plain = Blank::new(&sheet(json!({"length": "200 mm", "width": "100 mm"}))).unwrap();
    let near = |b: [f64; 4], c: [f64; 4]| (0..4).all(|k| (b[k] - c[k]).abs() < 1e-12);
    assert!(matches!(plain, Blank::Rectangle(b) if near(b, [-0.09, -0.05, 0.11, 0.05])));
    let ring = Blank::new(&sheet(json!({
        "outline": {"circle": {"radius": "50 mm"}}, "holes": [{"circle": {"radius": "20 mm"}}]
    })))
    .unwrap();
    let b = ring.bounds();
    assert!(
        (b[0] + 0.04).abs() < 1e-12 && (b[2] - 0.06).abs() < 1e-12,
        "{b:?}"
    );
    assert_eq!(ring.distance([0.04, 0.0]), 0.0);
    assert!((ring.distance([0.01, 0.0]) - 0.02).abs() < 1e-5);
    assert!((ring.distance([0.08, 0.0]) - 0.02).abs() < 1e-5);
    let turned = [[0, 0], [50, 0], [0, 50]].map(|p| p.map(|x| format!("{x} mm")));
    let wrong = sheet(json!({"outline": turned, "length": "1 m"}));
    let text = Blank::new(&wrong).unwrap_err().to_string();
    assert!(text.contains("'ply'") && text.contains("beside"), "{text}");
    let none = Blank::new(&sheet(json!({}))).unwrap_err().to_string();
    assert!(none.contains("length and width, or an outline"), "{none}");
    let holes = sheet(json!({"holes": [turned], "length": "1 m", "width": "1 m"}));
    assert!(
        Blank::new(&holes)
            .unwrap_err()
            .to_string()
            .contains("without `outline`")
    );
}

#[test]
fn every_side_of_a_contour_is_covered_by_edges_of_the_mesh() {
    for (name, region, _) in shapes()
        .into_iter()
        .filter(|s| s.1.contours().all(|c| c.len() < 13))
    {
        let mesh = mesh_region(&region, 0.006).unwrap();
        let mut covered = 0.0;
        for (cell, near) in mesh.cells.iter().zip(mesh.neighbours()) {
            for e in (0..4).filter(|e| near[*e] == NONE) {
                let [a, b] = [cell[e], cell[(e + 1) % 4]].map(|n| mesh.points[n as usize]);
                let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
                let on = region
                    .contours()
                    .flat_map(|c| sides(c))
                    .any(|(p, q)| segment_distance(middle, p, q) < 1e-12);
                assert!(on, "{name}: {middle:?}");
                covered += (b[0] - a[0]).hypot(b[1] - a[1]);
            }
        }
        let around: f64 = region
            .contours()
            .flat_map(|c| sides(c))
            .map(|(a, b)| (b[0] - a[0]).hypot(b[1] - a[1]))
            .sum();
        assert!(
            (covered - around).abs() < 1e-10,
            "{name}: {covered} {around}"
        );
    }
}
