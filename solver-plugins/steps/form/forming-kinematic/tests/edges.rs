//! Tools that a net cannot lie on everywhere: sharp edges, corners, ends, bad facets.

use plyflow_forming_kinematic::drop_on;
use plyflow_forming_kinematic::net::{Fabric, Generators, Net, Node, Stop};
use plyflow_forming_kinematic::ply::{lay, stops};
use plyflow_forming_kinematic::surface::{DrapeSurface, SmoothSurface};
use plyflow_geometry::vec3::distance;
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_tooling::{SurfaceTree, ToolMesh};
use std::convert::Infallible;
use std::f64::consts::FRAC_PI_2;

/// A box on the bed, 80 x 60 x 40 mm, two facets a side.
fn block() -> ToolMesh {
    let mut mesh = ToolMesh::default();
    for k in 0..8u32 {
        let side = |bit: u32, half: f64| if k >> bit & 1 == 1 { half } else { -half };
        mesh.points
            .push([side(0, 0.04), side(1, 0.03), 0.02 + side(2, 0.02)]);
    }
    for [a, b, c, d] in [
        [4, 5, 7, 6],
        [0, 2, 3, 1],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [1, 3, 7, 5],
        [0, 4, 6, 2],
    ] {
        mesh.triangles.extend([[a, b, c], [a, c, d]]);
    }
    mesh
}

fn fabric(half: [f64; 2]) -> Fabric {
    Fabric {
        directions: [0.0, FRAC_PI_2],
        blank: [-half[0], -half[1], half[0], half[1]],
        start: [0.0; 2],
        spacing: 1.3e-3,
        locking: 70f64.to_radians(),
        bed: 0.0,
        generators: Generators::Geodesic,
        offset: 0.6e-3,
    }
}

fn drape(surface: &SmoothSurface, f: Fabric) -> Net {
    let (z, face) = surface.top(0.0, 0.0).expect("a top");
    let (place, normal) = drop_on(surface, [0.0, 0.0, z], face, f.offset, 0.05).expect("a start");
    let mut net = Net::new(f).expect("a small net");
    let Ok(()) = net.drape(surface, place, normal, |_| Ok::<(), Infallible>(()));
    net
}

#[test]
fn strip_over_a_sharp_edge_bends_round_it_at_its_offset_without_shear() {
    let mesh = block();
    assert!(mesh.is_watertight());
    let surface = SmoothSurface::new(&mesh, 0.5).expect("facets");
    let net = drape(&surface, fabric([0.06, 0.02]));
    let tree = SurfaceTree::new(&mesh);
    let mut below = 0;
    for (at, node) in net.nodes() {
        assert!(
            matches!(node, Node::Placed(..) | Node::Unused),
            "{at:?} {node:?}"
        );
        let Some(x) = net.position(at) else { continue };
        assert!(
            (tree.closest(x).signed_distance - 0.6e-3).abs() < 1e-10,
            "{at:?} {x:?}"
        );
        below += u32::from(x[2] < 0.03);
        if let Some(g) = net.shear(at) {
            assert!(g.abs() < 1e-9, "{at:?}: {g}");
        }
    }
    assert!(below > 100, "{below}");
}

#[test]
fn corners_of_a_box_stop_the_net_and_everything_stays_finite() {
    let surface = SmoothSurface::new(&block(), 0.5).expect("facets");
    let net = drape(&surface, fabric([0.065, 0.055]));
    let found = stops(&net);
    assert_eq!(found[0].0, Stop::Locked);
    // The first place that cannot be closed lies over a corner of the top, and is told in the flat ply.
    let [x, y] = found[0].2;
    assert!(x.abs() > 0.038 && y.abs() > 0.028, "{x} {y}");
    let mesh = QuadMesh::grid(
        &even_axis(-0.065, 0.065, 4e-3),
        &even_axis(-0.055, 0.055, 4e-3),
    );
    let draped = lay(&net, &mesh, &surface, 0.6e-3).expect("whole cells");
    let reached = draped.reached.iter().filter(|r| **r).count();
    let share = reached as f64 / mesh.cells.len() as f64;
    println!("reached {share}");
    assert!(share > 0.6 && share < 1.0, "{share}");
    assert!(draped.points.iter().flatten().all(|v| v.is_finite()));
    assert!(draped.shear.iter().all(|g| g.abs() <= 70f64.to_radians()));
}

#[test]
fn net_ends_where_an_open_tool_ends() {
    // One square of 100 mm, 50 mm over the bed.
    let mesh = ToolMesh {
        points: vec![
            [-0.05, -0.05, 0.05],
            [0.05, -0.05, 0.05],
            [0.05, 0.05, 0.05],
            [-0.05, 0.05, 0.05],
        ],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
    };
    let surface = SmoothSurface::new(&mesh, 0.5).expect("facets");
    let net = drape(&surface, fabric([0.06, 0.03]));
    for (at, node) in net.nodes() {
        let [x, _] = net.flat(at);
        match node {
            Node::Placed(p, _) => {
                assert!(x.abs() < 0.05 + 1e-9 && (p[2] - 0.0506).abs() < 1e-12);
            }
            Node::Stopped(why) => assert_eq!(why, Stop::Edge, "{at:?}"),
            Node::Behind(_) => assert!(x.abs() > 0.05, "{at:?}"),
            Node::Unused => {}
            Node::Waiting => panic!("{at:?} was forgotten"),
        }
    }
    assert!(stops(&net).iter().all(|s| s.0 == Stop::Edge && s.1 > 10));
}

#[test]
fn fibres_go_round_the_end_of_a_tool_that_is_longer_beside_it() {
    // An L of two flat strips: the first fibre along x ends at x = 20 mm, the tool beside it does not.
    let mut mesh = ToolMesh::default();
    for [x, y] in [
        [-0.05, -0.05],
        [0.02, -0.05],
        [0.02, 0.01],
        [0.05, 0.01],
        [0.05, 0.05],
        [-0.05, 0.05],
        [-0.05, 0.01],
        [0.02, 0.05],
    ] {
        mesh.points.push([x, y, 0.05]);
    }
    mesh.triangles = vec![
        [0, 1, 2],
        [0, 2, 6],
        [6, 2, 7],
        [6, 7, 5],
        [2, 3, 4],
        [2, 4, 7],
    ];
    let surface = SmoothSurface::new(&mesh, 0.5).expect("facets");
    let net = drape(&surface, fabric([0.045, 0.045]));
    for (at, node) in net.nodes() {
        let [x, y] = net.flat(at);
        let on_tool = x.abs() < 0.05 && y.abs() < 0.05 && (x < 0.02 || y > 0.01);
        if on_tool && node != Node::Unused {
            let p = net
                .position(at)
                .unwrap_or_else(|| panic!("{x} {y} is {node:?}"));
            assert!(distance(p, [x, y, 0.0506]) < 1e-12, "{p:?} {x} {y}");
        } else {
            assert_eq!(net.position(at), None);
        }
    }
}

#[test]
fn facets_without_area_and_facets_turned_over_do_no_harm() {
    let mut mesh = block();
    mesh.points.push([0.0, 0.03, 0.04]);
    mesh.triangles.push([6, 8, 7]);
    mesh.triangles.push([5, 5, 7]);
    let surface = SmoothSurface::new(&mesh, 0.5).expect("facets");
    let net = drape(&surface, fabric([0.035, 0.025]));
    for (at, node) in net.nodes() {
        if let Node::Placed(x, n) = node {
            assert!(x.iter().chain(&n).all(|v| v.is_finite()), "{at:?}");
        }
    }
    assert!(
        net.nodes()
            .all(|(_, n)| matches!(n, Node::Placed(..) | Node::Unused))
    );
    let nothing = ToolMesh {
        points: vec![[0.0; 3]; 3],
        triangles: vec![[0, 1, 2]],
    };
    assert!(SmoothSurface::new(&nothing, 0.5).is_none());
}

#[test]
fn level_of_smooth_facets_is_continuous_across_them() {
    // A coarse sphere: along a line over its facets the level changes no faster than the place.
    let tool = plyflow_model::scene::Tool::Hemisphere(plyflow_model::scene::HemisphereTool {
        radius: plyflow_model::units::Length(1e-3),
        facet_size: plyflow_model::units::Length(0.4e-3),
    });
    let surface = SmoothSurface::new(&plyflow_tooling::build(&tool).unwrap(), 0.6).unwrap();
    let at = |k: i32| {
        let angle = 1.2 * f64::from(k) / 20000.0;
        [
            1.01e-3 * angle.sin() * 0.8,
            1.01e-3 * angle.sin() * 0.6,
            1.01e-3 * angle.cos(),
        ]
    };
    let mut before = surface.level(at(0), 0.01e-3).unwrap().0;
    for k in 1..20000 {
        let here = surface.level(at(k), 0.01e-3).unwrap().0;
        let moved = distance(at(k), at(k - 1));
        assert!((here - before).abs() < 0.2 * moved, "{k}: {before} {here}");
        before = here;
    }
}

#[test]
fn drape_ends_when_it_is_told_to() {
    let surface = SmoothSurface::new(&block(), 0.5).expect("facets");
    let mut net = Net::new(fabric([0.03, 0.02])).expect("a small net");
    let mut heard = 0;
    let ended = net.drape(&surface, [0.0, 0.0, 0.0406], [0.0, 0.0, 1.0], |part| {
        assert!((0.0..=1.0).contains(&part));
        heard += 1;
        if heard == 2 { Err("cancelled") } else { Ok(()) }
    });
    assert_eq!(ended, Err("cancelled"));
    assert_eq!(heard, 2);
    assert!(net.nodes().any(|(_, n)| n == Node::Waiting));
}
