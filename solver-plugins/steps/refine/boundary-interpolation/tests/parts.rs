//! The splines and meshes that the step is made of.

use plyflow_blank::Blank;
use plyflow_boundary_interpolation::{Grid, Placed, film_grid, ply_grid, ply_part};
use plyflow_mechanics::history::{linear, spline_slopes};
use plyflow_mechanics::mesh::{QuadMesh, even_axis, graded_axis};
use plyflow_model::outline::Region;
use plyflow_surface::SmoothSheet;

#[test]
fn spline_gives_back_any_cubic_that_starts_at_rest() {
    let times = [0.0, 0.1, 0.35, 0.4, 1.0, 1.3];
    let f = |t: f64| [1.0 + 2.0 * t * t - 0.7 * t * t * t, -3.0 * t * t];
    let g = |t: f64| [4.0 * t - 2.1 * t * t, -6.0 * t];
    let values: Vec<f64> = times.iter().flat_map(|&t| f(t)).collect();
    for (s, e) in spline_slopes(&times, &values, 2)
        .iter()
        .zip(times.iter().flat_map(|&t| g(t)))
    {
        assert!((s - e).abs() < 1e-12, "{s} {e}");
    }
    for n in [2, 3] {
        let slopes = spline_slopes(&times[..n], &values[..2 * n], 2);
        assert!(
            (slopes[2 * n - 1] - g(times[n - 1])[1]).abs() < 1e-12,
            "{n} frames"
        );
    }
    assert_eq!(spline_slopes(&[0.5], &[3.0], 1), [0.0]);
}

#[test]
fn spline_of_a_motion_that_is_under_way_gives_back_any_cubic() {
    let times = [0.6, 0.63, 0.7, 0.71, 0.8, 1.0];
    let f = |t: f64| [2.0 - 3.0 * t + t * t - 0.7 * t * t * t, 1.0 - 2.0 * t];
    let g = |t: f64| [-3.0 + 2.0 * t - 2.1 * t * t, -2.0];
    let values: Vec<f64> = times.iter().flat_map(|&t| f(t)).collect();
    for n in 2..=times.len() {
        let slopes = spline_slopes(&times[..n], &values[..2 * n], 2);
        for (i, &t) in times[..n].iter().enumerate() {
            // Of fewer frames than a cubic has numbers: lines.
            let off = [0, 1].map(|c| (slopes[2 * i + c] - g(t)[c]).abs());
            assert!(off[1] < 1e-11 && (n < 4 || off[0] < 1e-11), "{n}: {off:?}");
        }
    }
    let parabola = |t: f64| 1.0 - t + 4.0 * t * t;
    let values = [0.6, 0.63, 0.7].map(parabola);
    let slopes = spline_slopes(&times[..3], &values, 1);
    for (s, t) in slopes.iter().zip(times) {
        assert!((s - (8.0 * t - 1.0)).abs() < 1e-11, "{s}");
    }
}

#[test]
fn hermite_pieces_join_without_a_jump_in_acceleration() {
    let times: Vec<f64> = (0..20)
        .map(|i| 0.05 * i as f64 + 0.01 * ((i * 7) % 5) as f64)
        .collect();
    let x: Vec<f64> = times.iter().map(|t| (9.0 * t).sin() + t * t).collect();
    let v = spline_slopes(&times, &x, 1);
    assert_eq!(v[0], 0.0);
    // Second derivative of the Hermite piece at its ends.
    let ends = |i: usize| {
        let h = times[i + 1] - times[i];
        let d = (x[i + 1] - x[i]) / h;
        (
            (6.0 * d - 4.0 * v[i] - 2.0 * v[i + 1]) / h,
            (-6.0 * d + 2.0 * v[i] + 4.0 * v[i + 1]) / h,
        )
    };
    for i in 0..18 {
        assert!(
            (ends(i).1 - ends(i + 1).0).abs() < 1e-8,
            "at {}",
            times[i + 1]
        );
    }
}

#[test]
fn error_of_the_spline_s_velocity_falls_with_the_third_power_of_the_frame_spacing() {
    let error = |n: usize| {
        let times: Vec<f64> = (0..=n).map(|i| i as f64 / n as f64).collect();
        let x: Vec<f64> = times.iter().map(|t| (4.0 * t).cos()).collect();
        let v = spline_slopes(&times, &x, 1);
        times
            .iter()
            .zip(v)
            .map(|(t, v)| (v + 4.0 * (4.0 * t).sin()).abs())
            .fold(0.0, f64::max)
    };
    let order = (error(25) / error(50)).log2();
    assert!(order > 2.7, "{order}");
    assert!(error(100) < 1e-4);
}

#[test]
fn histories_are_linear_between_and_constant_beyond_their_times() {
    let (t, v) = ([0.0, 1.0, 3.0], [5.0, 7.0, 3.0]);
    assert_eq!(
        [-1.0, 0.5, 2.0, 9.0].map(|at| linear(&t, &v, at)),
        [5.0, 6.0, 5.0, 3.0]
    );
}

fn rectangle(b: [f64; 4]) -> Vec<[f64; 2]> {
    vec![[b[0], b[1]], [b[2], b[1]], [b[2], b[3]], [b[0], b[3]]]
}

fn near(a: [f64; 4], b: [f64; 4]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12)
}

#[test]
fn a_zone_s_meshes_are_cut_out_of_those_of_the_whole() {
    // Plies of 480 x 300 mm in 4 mm have lines at -240 + 4 i and -150 + 4 j mm, films of 6 mm at 6 k mm.
    let (ply, film) = ([-0.24, -0.15, 0.24, 0.15], [-0.9, -0.75, 0.9, 0.75]);
    let whole = QuadMesh::grid(
        &even_axis(ply[0], ply[2], 0.004),
        &even_axis(ply[1], ply[3], 0.004),
    );
    let zone = [-0.0113, 0.0221, 0.0731, 0.1475];
    let part = ply_grid(zone, ply, 0.004).unwrap();
    assert!(
        near(part.bounds, [-0.012, 0.022, 0.076, 0.15]),
        "{:?}",
        part.bounds
    );
    // Of the whole's nodes, with the same bits. The zone's top is less than a cell from the edge: there it is free.
    let of_the_whole = |p: &[f64; 2]| whole.points.iter().any(|q| [q[0], q[1]] == *p);
    assert!(part.points.iter().all(of_the_whole));
    assert_eq!(
        part.cuts.each_ref().map(Option::is_some),
        [true, true, true, false]
    );
    let xs = graded_axis(film[0], film[2], -0.3, 0.3, 0.006, 1.25);
    let ys = graded_axis(film[1], film[3], -0.2, 0.2, 0.006, 1.25);
    let part = film_grid(zone, film, 0.02, 0.006).unwrap();
    assert!(near(part.bounds, [-0.036, 0.0, 0.096, 0.168]));
    assert!((part.points.iter()).all(|[x, y]| xs.contains(x) && ys.contains(y)));
}

#[test]
fn a_cut_that_lies_on_the_ply_s_edge_stays_free() {
    let ply = [-0.24, -0.15, 0.24, 0.15];
    let grid = ply_grid([-0.24, 0.05, -0.14, 0.15], ply, 0.003).unwrap();
    assert_eq!(
        grid.cuts.clone().map(|c| c.is_some()),
        [false, true, true, false]
    );
    // 100 / 3 mm needs 34 cells.
    assert_eq!(
        (grid.points.len(), grid.cells.len()),
        (35 * 35, 4 * 34 * 34)
    );
    assert_eq!(grid.driven_nodes().len(), 35 + 34);
    let whole = ply_grid([-0.3, -0.2, 0.3, 0.2], ply, 0.01).unwrap();
    assert!(whole.driven_nodes().is_empty());
    assert!(near(whole.bounds, ply));
    assert!(
        ply_grid([0.239, -0.1, 0.3, 0.1], ply, 0.003).is_none(),
        "less than a cell"
    );
}

#[test]
fn a_smaller_ply_has_its_own_edges() {
    let small = ply_grid([0.0, 0.0, 0.1, 0.1], [0.03, -0.1, 0.08, 0.05], 0.005).unwrap();
    assert!(near(small.bounds, [0.03, 0.0, 0.08, 0.05]));
    assert_eq!(
        small.cuts.clone().map(|c| c.is_some()),
        [false, false, true, false]
    );
}

#[test]
fn a_zone_wholly_inside_of_a_polygon_is_a_box_and_one_beside_it_is_nothing() {
    let part =
        |zone, outline: &[[f64; 2]], holes: &[Vec<[f64; 2]>]| ply_part(zone, outline, holes, 0.005);
    let ell = [
        [0.0, 0.0],
        [0.2, 0.0],
        [0.2, 0.08],
        [0.08, 0.08],
        [0.08, 0.2],
        [0.0, 0.2],
    ];
    let hole = vec![vec![[0.12, 0.02], [0.16, 0.02], [0.14, 0.06]]];
    let inside = part([0.01, 0.01, 0.05, 0.06], &ell, &hole)
        .unwrap()
        .unwrap();
    assert!(near(inside.bounds, [0.01, 0.01, 0.05, 0.06]));
    assert!(inside.cuts.iter().all(|c| c.is_some()));
    // Beside the L, in its notch and in the hole there is no ply.
    for zone in [
        [0.1, 0.1, 0.15, 0.15],
        [0.3, 0.0, 0.4, 0.1],
        [0.135, 0.025, 0.145, 0.035],
    ] {
        assert_eq!(part(zone, &ell, &hole), Ok(None), "{zone:?}");
    }
    // A rectangle has edges of its own.
    let plate = rectangle([0.0, 0.0, 0.2, 0.1]);
    let corner = part([-0.1, -0.1, 0.05, 0.05], &plate, &hole);
    assert!(!corner.unwrap().unwrap().outlined);
}

/// Area of a flat mesh (m2).
fn area(grid: &Grid) -> f64 {
    let of = |cell: &[u32; 4]| {
        let [a, b, c, d] = cell.map(|n| grid.points[n as usize]);
        0.5 * ((c[0] - a[0]) * (d[1] - b[1]) - (c[1] - a[1]) * (d[0] - b[0]))
    };
    grid.cells.as_chunks().0.iter().map(of).sum()
}

#[test]
fn a_zone_across_an_edge_a_notch_or_a_hole_has_cells_of_the_whole_ply_and_is_driven_at_its_cut_alone()
 {
    let ell = [
        [0.0, 0.0],
        [0.2, 0.0],
        [0.2, 0.08],
        [0.08, 0.08],
        [0.08, 0.2],
        [0.0, 0.2],
    ];
    let around = |k: usize| {
        let (s, c) = (k as f64 * 0.1 * std::f64::consts::PI).sin_cos();
        [0.14 + 0.02 * c, 0.04 + 0.02 * s]
    };
    let holes = vec![(0..20).map(around).collect::<Vec<_>>()];
    let size = 0.005;
    let region = Region::new(ell.to_vec(), holes.clone()).unwrap();
    let (whole, _) = Blank::Region(region.clone()).mesh(size).unwrap();
    // Over the inner corner; over the rim and the hole; the whole.
    for (zone, cut) in [
        ([0.06, 0.06, 0.1, 0.1], true),
        ([0.13, -0.01, 0.17, 0.05], true),
        ([-1.0, -1.0, 1.0, 1.0], false),
    ] {
        let grid = ply_part(zone, &ell, &holes, size).unwrap().unwrap();
        assert!(grid.outlined && grid.cuts.iter().all(Option::is_none));
        assert_eq!(!grid.pieces.is_empty(), cut);
        for p in &grid.points {
            assert!(
                whole.points.iter().any(|q| q[0] == p[0] && q[1] == p[1]),
                "{p:?}"
            );
        }
        // All of the ply in the zone, and less than an element more on every side.
        let inside =
            |p: &[f64; 2], by: f64| (0..2).all(|d| p[d] > zone[d] - by && p[d] < zone[d + 2] + by);
        let cells = whole.cells.iter();
        let all = cells.filter(|c| {
            c.iter().all(|n| {
                let [x, y, _] = whole.points[*n as usize];
                inside(&[x, y], 1e-9)
            })
        });
        assert!(grid.cells.len() / 4 >= all.count());
        assert!(grid.points.iter().all(|p| inside(p, 2.0 * size)));
        // What is driven lies beyond the zone's sides or on them, and not on the ply's own edge but where the cut ends there.
        let driven = grid.driven_nodes();
        for n in &driven {
            assert!(
                !inside(&grid.points[*n as usize], -1e-9),
                "{:?}",
                grid.points[*n as usize]
            );
        }
        let on_edge = |n: &&u32| region.distance_to_edge(grid.points[**n as usize]) < 1e-7;
        // The cut from edge to edge: two ends each, of one cut over the corner, and of three over rim and hole.
        let ends = driven.iter().filter(on_edge).count();
        let expected = match (cut, zone[1] > 0.0) {
            (false, _) => 0,
            (true, true) => 2,
            (true, false) => 4,
        };
        assert_eq!(ends, expected, "{zone:?}");
        if !cut {
            assert!((area(&grid) / region.area() - 1.0).abs() < 1e-2);
        }
    }
    let refused = ply_part([0.06, 0.06, 0.1, 0.1], &ell, &holes, 0.03).unwrap_err();
    assert!(refused.contains("element size of at most"), "{refused}");
}

#[test]
fn nodes_between_a_curved_edge_and_the_chords_of_the_coarse_mesh_go_on_with_its_motion() {
    let circle: Vec<[f64; 2]> = (0..360)
        .map(|k| {
            let (s, c) = f64::from(k).to_radians().sin_cos();
            [0.06 * c, 0.06 * s]
        })
        .collect();
    let region = Region::new(circle.clone(), Vec::new()).unwrap();
    let (coarse, _) = Blank::Region(region).mesh(0.012).unwrap();
    let grid = ply_part([0.0, 0.0, 0.1, 0.1], &circle, &[], 0.004)
        .unwrap()
        .unwrap();
    let cells = coarse.cells.as_flattened();
    let placed = Placed::new(grid, &coarse.points, cells).unwrap();
    // Stretched by 10 % along x, sheared and lifted: chords that are taken for the edge would hold nodes back by a tenth of what they cut off.
    let moved = |p: &[f64; 3]| [1.1 * p[0] + 0.05 * p[1], p[1], 0.2 * p[0]];
    let formed = coarse.points.iter().map(moved).collect();
    let surface = SmoothSheet::new(formed, cells);
    let everywhere = placed.everywhere(&surface);
    let mut outside = 0;
    for (now, then) in everywhere.iter().zip(&placed.points) {
        let expected = moved(then);
        let off = (0..3)
            .map(|d| (now[d] - expected[d]).abs())
            .fold(0.0, f64::max);
        assert!(off < 1e-9, "{then:?}: {off} m");
        let radius = then[0].hypot(then[1]);
        outside += usize::from(radius > 0.0599);
    }
    assert!(outside > 15 && placed.driven_nodes.len() > 20, "{outside}");
}

#[test]
fn films_reach_past_the_zone_but_not_past_themselves_and_are_cut_all_around() {
    let film = [-0.9, -0.75, 0.9, 0.75];
    let grid = film_grid([-0.24, 0.05, -0.14, 0.15], film, 0.02, 0.01).unwrap();
    assert!(near(grid.bounds, [-0.26, 0.03, -0.12, 0.17]));
    assert!(grid.cuts.iter().all(Option::is_some));
    assert_eq!(grid.driven_nodes().len(), 4 * 14);
    let at_the_end = film_grid([0.0, 0.0, 0.895, 0.1], film, 0.02, 0.01).unwrap();
    assert!(near(at_the_end.bounds, [-0.02, -0.02, 0.9, 0.12]));
    // A film that is no whole number of elements wide is cut at the last line that it reaches.
    let narrow = film_grid(
        [0.0, 0.0, 0.895, 0.1],
        [-0.9, -0.75, 0.897, 0.75],
        0.02,
        0.01,
    )
    .unwrap();
    assert!(near(narrow.bounds, [-0.02, -0.02, 0.89, 0.12]));
}
