//! Closest point and signed distance.

mod common;

use plyflow_geometry::vec3::{Vec3, distance, norm, scale};
use plyflow_geometry::{Feature, QuadLocator, TriangleTree};
use plyflow_surface::{Ground, Surface, Topology, nodal_distances, triangles};

fn brute_force(points: &[Vec3], tris: &[[u32; 3]], p: Vec3) -> f64 {
    // Projected gradient over barycentric coordinates is slow; sample the sides finely and the plane exactly.
    use plyflow_geometry::vec3::{add, cross, dot, sub, unit};
    tris.iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| points[i as usize]);
            let side = |a: Vec3, b: Vec3| {
                let u = sub(b, a);
                let s = (dot(sub(p, a), u) / dot(u, u)).clamp(0.0, 1.0);
                distance(p, add(a, scale(u, s)))
            };
            let n = unit(cross(sub(b, a), sub(c, a)));
            let q = sub(p, scale(n, dot(sub(p, a), n)));
            let inside = [(a, b), (b, c), (c, a)]
                .iter()
                .all(|&(a, b)| dot(cross(sub(b, a), sub(q, a)), n) >= 0.0);
            let plane = if inside {
                distance(p, q)
            } else {
                f64::INFINITY
            };
            plane.min(side(a, b)).min(side(b, c)).min(side(c, a))
        })
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn distance_equals_brute_force_on_a_wavy_jittered_surface() {
    let (flat, cells) = common::grid(12, 1.0, 0.3);
    let points = common::lifted(&flat, |x, y| 0.3 * (3.0 * x).sin() * (2.0 * y).cos());
    let tris = triangles(4, &cells);
    let surface = Surface::new(&points, &tris).unwrap();
    let (queries, _) = common::grid(9, 1.4, 0.4);
    for (i, &[x, y]) in queries.iter().enumerate() {
        let p = [x, y, ((i * 37) % 17) as f64 / 10.0 - 0.8];
        let found = surface.closest(p);
        let expected = brute_force(&points, &tris, p);
        assert!(
            (found.signed_distance.abs() - expected).abs() < 1e-12,
            "{p:?}"
        );
        assert!((distance(p, found.point) - expected).abs() < 1e-12);
    }
}

#[test]
fn a_search_finds_the_same_from_any_hint() {
    let (points, tris) = common::sphere(3, 1.0);
    let surface = Surface::new(&points, &tris).unwrap();
    let tree = TriangleTree::new(points, surface.triangles().to_vec());
    let (tree, count) = (tree.unwrap(), surface.triangles().len());
    for i in 0..400usize {
        let f = |k: f64| (i as f64 * k).fract() - 0.5;
        let p = [3.0 * f(0.618), 3.0 * f(0.414), 3.0 * f(0.732)];
        let found = surface.closest(p);
        let hint = i * 7919 % count;
        assert_eq!(surface.closest_from(p, hint), found);
        assert_eq!(tree.closest_from(p, hint), found.triangle);
        let reach = found.signed_distance.abs();
        for hint in [None, Some(hint)] {
            assert_eq!(surface.closest_within(p, 1.01 * reach, hint), Some(found));
            assert_eq!(surface.closest_within(p, 0.99 * reach, hint), None);
            assert_eq!(tree.closest_within(p, 0.99 * reach, hint), None);
        }
    }
}

#[test]
fn sign_is_right_everywhere_around_a_triangle_soup_sphere() {
    let (points, tris) = common::sphere(2, 0.05);
    let surface = Surface::new(&points, &tris).unwrap();
    let (directions, _) = common::sphere(3, 1.0);
    for d in directions {
        for r in [0.01, 0.04, 0.052, 0.08] {
            let found = surface.closest(scale(d, r));
            assert_eq!(found.signed_distance > 0.0, r > 0.05, "r = {r}");
            assert!((found.signed_distance - (r - 0.05)).abs() < 0.0015);
            assert!(!found.on_free_edge);
        }
    }
}

#[test]
fn sign_is_that_of_the_pseudo_normal_at_a_sharp_open_edge() {
    // A roof, open below; its ridge is sharper than a right angle, so that beside the ridge the plane of one
    // face alone gives the wrong side.
    let points = [
        [-0.1, -1.0, -1.0],
        [0.0, -1.0, 0.0],
        [0.0, 1.0, 0.0],
        [-0.1, 1.0, -1.0],
        [0.1, -1.0, -1.0],
        [0.1, 1.0, -1.0],
    ];
    let tris = [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]];
    let surface = Surface::new(&points, &tris).unwrap();
    for p in [
        [0.2, 0.1, 0.1],
        [-0.2, 0.1, 0.1],
        [0.0, 0.0, 0.3],
        [0.01, 0.0, 0.001],
    ] {
        let found = surface.closest(p);
        assert!(found.signed_distance > 0.0, "{p:?} {found:?}");
    }
    assert!(surface.closest([0.0, 0.1, -0.5]).signed_distance < 0.0);
    let below = surface.closest([0.3, 0.0, -2.0]);
    assert!(below.on_free_edge && matches!(below.feature, Feature::Edge(_)));
}

#[test]
fn degenerate_triangles_are_left_out_and_nothing_left_is_no_surface() {
    let points = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    assert!(Surface::new(&points, &[[0, 1, 2]]).is_none());
    let one = Surface::new(&points, &[[0, 1, 2], [0, 1, 3]]).unwrap();
    assert_eq!(one.triangles().len(), 1);
}

#[test]
fn nodes_past_the_rim_or_at_the_foot_are_not_judged() {
    let (flat, cells) = common::grid(10, 0.05, 0.0);
    // A dome 30 mm high, open at the bottom.
    let points = common::lifted(&flat, |x, y| {
        0.03 * (1.0 - (x / 0.05).powi(2)) * (1.0 - (y / 0.05).powi(2))
    });
    let tool = Surface::new(&points, &triangles(4, &cells)).unwrap();
    let nodes = [[0.0, 0.0, 0.0325], [0.2, 0.0, 0.0], [0.0, 0.0499, 0.002]];
    // On a bed no normals are asked for.
    let none = Topology::new(nodes.len(), 3, &[]);
    let found = nodal_distances(&tool, &none, &nodes, 0.0005, Ground::bed(0.010));
    assert!(
        found[0].judged && (found[0].value - 0.002).abs() < 1e-9,
        "{found:?}"
    );
    assert!(!found[1].judged && !found[2].judged, "{found:?}");
}

#[test]
fn location_in_skewed_cells_gives_back_the_point() {
    let (flat, cells) = common::grid(7, 1.0, 0.35);
    let points = common::lifted(&flat, |x, y| 1.0 + 2.0 * x - y);
    let locator = QuadLocator::new(&points, &cells).unwrap();
    let (queries, _) = common::grid(23, 0.999, 0.4);
    for [x, y] in queries {
        let location = locator.locate(x, y, 1e-9).unwrap();
        let back = location.interpolate(&points);
        assert!((back[0] - x).abs() < 1e-12 && (back[1] - y).abs() < 1e-12);
        // A plane is bilinear in any cell.
        assert!((back[2] - (1.0 + 2.0 * x - y)).abs() < 1e-12);
        assert!((location.weights.iter().sum::<f64>() - 1.0).abs() < 1e-14);
    }
    assert!(locator.locate(1.05, 0.0, 0.01).is_none());
    let clamped = locator
        .locate(1.005, 0.2, 0.01)
        .unwrap()
        .interpolate(&points);
    assert!((clamped[0] - 1.0).abs() < 1e-12);
}

#[test]
fn topology_of_a_grid_knows_rings_rims_components_and_areas() {
    let (flat, cells) = common::grid(4, 1.0, 0.0);
    let points = common::lifted(&flat, |_, _| 0.0);
    let t = Topology::new(25, 4, &cells);
    assert_eq!(t.ring(12), &[6, 7, 8, 11, 13, 16, 17, 18]);
    assert_eq!(t.edge_neighbours(12), &[7, 11, 13, 17]);
    assert_eq!(t.rings(0, 2).len(), 8);
    assert_eq!(t.free_edges().len(), 16);
    assert_eq!((0..25).filter(|&i| t.is_free(i)).count(), 16);
    assert!((t.cell_areas(&points).iter().sum::<f64>() - 4.0).abs() < 1e-14);
    assert!((t.node_areas(&points)[0] - 0.0625).abs() < 1e-15);
    let mut chosen = vec![false; 25];
    for i in [0, 6, 24, 14] {
        chosen[i] = true;
    }
    assert_eq!(t.node_components(&chosen), [vec![0, 6], vec![14], vec![24]]);
    let lengths = t.path_lengths(&points, &[0], &[true; 25], 1.2);
    assert!((lengths[12] - 2f64.sqrt()).abs() > 0.1, "beyond the reach");
    assert!((lengths[6] - 0.5f64.sqrt()).abs() < 1e-12 && (lengths[2] - 1.0).abs() < 1e-12);
    assert!(norm(t.normals(&points)[12]) > 0.999 && t.normals(&points)[0] == [0.0, 0.0, 1.0]);
}
