//! Where a tool is sharper than the grid shows.

use super::{block, random, together};
use crate::mesh::ToolMesh;
use crate::sdf::SignedDistanceGrid;
use plyflow_geometry::vec3::{Vec3, norm, sub};

const OFFSET: f64 = 8e-4;

fn built(mesh: &ToolMesh, spacing: f64, tolerance: f64) -> (SignedDistanceGrid, f64) {
    let (grid, error) =
        SignedDistanceGrid::build_within(mesh, [spacing, 8e-3], [tolerance, OFFSET], &|_| true);
    (grid, error.largest)
}

const LOW: Vec3 = [-0.0113, -0.0087, 0.0];
const HIGH: Vec3 = [0.0097, 0.0091, 0.0103];

/// Distance outside of the block that goes on below the bed, in closed form.
fn outside(p: Vec3) -> f64 {
    let beyond = |k: usize| (LOW[k] - p[k]).max(p[k] - HIGH[k]);
    let d = [beyond(0), beyond(1), p[2] - HIGH[2]];
    let out = norm(d.map(|c| c.max(0.0)));
    if out > 0.0 {
        out
    } else {
        d[0].max(d[1]).max(d[2])
    }
}

/// Places from the surface to `OFFSET` out of it.
fn places(count: usize) -> Vec<Vec3> {
    let mut found = Vec::new();
    let mut n = 0;
    while found.len() < count {
        n += 1;
        let p: Vec3 = std::array::from_fn(|k| {
            LOW[k].min(HIGH[k]) - 1e-3 + random(3 * n + k as u64) * (HIGH[k] - LOW[k] + 2e-3)
        });
        // Half of them close to an edge.
        let p = if n.is_multiple_of(2) {
            [
                HIGH[0] + 2e-3 * (random(9 * n) - 0.5),
                p[1],
                HIGH[2] + 2e-3 * (random(7 * n) - 0.5),
            ]
        } else {
            p
        };
        if p[2] >= 0.0 && (0.0..=OFFSET).contains(&outside(p)) {
            found.push(p);
        }
    }
    found
}

#[test]
fn the_field_of_a_sharp_block_is_right_within_what_is_asked_for() {
    let mesh = block(LOW, HIGH);
    let most = |grid: &SignedDistanceGrid| {
        let error = |p: &Vec3| (grid.distance_and_gradient(*p).0 - outside(*p)).abs();
        places(40_000).iter().map(error).fold(0.0, f64::max)
    };
    let plain = most(&SignedDistanceGrid::build(&mesh, 3e-3, 8e-3));
    assert!(plain > 4e-4, "rounded without finer levels: {plain}");
    for (spacing, tolerance) in [(3e-3, 1e-4), (3e-3, 3e-5), (1e-2, 1e-4)] {
        let (grid, told) = built(&mesh, spacing, tolerance);
        let found = most(&grid);
        println!(
            "{spacing} {tolerance}: told {told}, found {found}, {} kB",
            grid.memory() / 1000
        );
        assert!(told <= tolerance, "{told} is more than {tolerance}");
        assert!(found <= 1.3 * tolerance, "{found} is more than {tolerance}");
    }
}

/// What no spacing would show: told, not passed over.
#[test]
fn an_error_that_is_left_is_told() {
    let mesh = block(LOW, HIGH);
    let (_, told) = built(&mesh, 1.0, 3e-5);
    assert!(told > 1e-3, "{told}");
}

#[test]
fn a_smooth_tool_is_left_as_it_is() {
    let mesh = crate::hemisphere::hemisphere(0.03, 0.002);
    let (grid, told) = built(&mesh, 3e-3, 4e-5);
    let plain = SignedDistanceGrid::build(&mesh, 3e-3, 8e-3);
    assert!(told > 0.0 && told < 4e-5, "{told}");
    assert!(grid.coefficients == plain.coefficients && grid.bounds == plain.bounds);
    assert_eq!(grid.memory(), plain.memory());
}

#[test]
fn gradient_is_the_derivative_of_the_distance_at_sharp_edges_too() {
    let (grid, _) = built(&block(LOW, HIGH), 3e-3, 1e-4);
    let step = 2e-5;
    for p in places(2000) {
        let (_, g) = grid.distance_and_gradient(p);
        for k in 0..3 {
            let at = |s: f64| {
                let mut q = p;
                q[k] += s * step;
                grid.distance_and_gradient(q).0
            };
            let slope = (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * step);
            assert!(
                (slope - g[k]).abs() < 3e-3,
                "at {p:?} axis {k}: {slope} against {}",
                g[k]
            );
        }
    }
}

/// From one cell of the finest level to the next, and from where there are finer levels to where there are none.
#[test]
fn value_and_gradient_are_continuous_between_levels() {
    let (grid, _) = built(&block(LOW, HIGH), 3e-3, 1e-4);
    for p in places(1000) {
        for level in 0..6 {
            let spacing = grid.spacing / f64::from(1 << level);
            for k in 0..3 {
                let mut q = p;
                q[k] = grid.origin[k] + ((p[k] - grid.origin[k]) / spacing).round() * spacing;
                let (mut a, mut b) = (q, q);
                (a[k], b[k]) = (q[k] - 1e-9, q[k] + 1e-9);
                let [(da, ga), (db, gb)] = [a, b].map(|p| grid.distance_and_gradient(p));
                assert!((da - db).abs() < 2e-8, "{da} {db}");
                assert!(norm(sub(ga, gb)) < 2e-4, "{ga:?} {gb:?}");
            }
        }
    }
}

#[test]
fn near_points_are_found_with_finer_levels() {
    let (grid, _) = built(&block(LOW, HIGH), 3e-3, 1e-4);
    let limit = 9e-4;
    for p in places(20_000) {
        let found = grid.within(p, limit).expect("closer than the limit");
        assert_eq!(found, grid.distance_and_gradient(p));
    }
    let shifted = grid.of_equal_length(4e-3);
    for p in places(20_000) {
        let all = shifted.distance_and_gradient(p);
        let near = shifted.within(p, limit);
        assert_eq!(near, (all.0 < limit).then_some(all));
    }
}

#[test]
fn finer_levels_are_the_same_bytes_for_any_number_of_threads() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.unwrap()
            .install(|| built(&block(LOW, HIGH), 3e-3, 1e-4).0)
    };
    let one = with(1);
    for other in [with(2), with(3)] {
        assert!(one.finer == other.finer && one.bounds == other.bounds);
    }
}

/// A rib 1 mm thick on a plate, and a sharp groove 3 mm wide between two blocks.
#[test]
fn thin_walls_and_sharp_grooves_are_in_the_field() {
    let plate = block([-0.02, -0.012, 0.0], [0.02, 0.012, 0.004]);
    let rib = block([-0.0005, -0.01, 0.004], [0.0005, 0.01, 0.012]);
    let blocks = [
        block([-0.012, -0.01, 0.004], [-0.008, 0.01, 0.01]),
        block([-0.005, -0.01, 0.004], [-0.0021, 0.01, 0.01]),
    ];
    let mesh = together(&[plate, rib, blocks[0].clone(), blocks[1].clone()]);
    let (grid, told) = built(&mesh, 3e-3, 4e-5);
    assert!(told <= 4e-5, "{told}");
    let at = |p: Vec3| grid.distance_and_gradient(p).0;
    // Beside the rib, at both of its faces, in its middle, over it.
    for (p, distance) in [
        ([0.0010, 0.003, 0.009], 5e-4),
        ([0.0005, 0.003, 0.009], 0.0),
        ([-0.0005, -0.003, 0.009], 0.0),
        ([0.0, 0.003, 0.0125], 5e-4),
        // On the groove's floor and its corner.
        ([-0.0065, 0.0, 0.0042], 2e-4),
        ([-0.0078, 0.0, 0.0042], 2e-4),
        ([-0.0052, 0.0, 0.0048], 2e-4),
    ] {
        assert!((at(p) - distance).abs() < 6e-5, "{p:?}: {}", at(p));
    }
    assert!(at([0.0, 0.0, 0.009]) < -3e-4);
}
