use super::*;
use crate::hemisphere::hemisphere;
use plyflow_geometry::vec3::{add, scale, sub, unit};
use plyflow_model::scene::{FlatTool, Tool};
use plyflow_model::units::Length;

mod finer;

/// A number in 0..1 from a counter (SplitMix64).
fn random(n: u64) -> f64 {
    let mut z = n
        .wrapping_mul(0x9E37_79B9_7F4A_7C15)
        .wrapping_add(0x1234_5678_9ABC_DEF1);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

/// Points within `band` of the surface above the bed, with their exact distances.
fn points_near(mesh: &ToolMesh, band: f64, count: usize) -> Vec<(Vec3, f64)> {
    let tree = SurfaceTree::new(&mesh.without_bottom(0.1));
    let mut found = Vec::new();
    let mut n = 0;
    while found.len() < count {
        n += 1;
        let t = (random(4 * n) * mesh.triangles.len() as f64) as usize;
        let [a, b, c] = mesh.corners(t);
        let (mut u, mut v) = (random(4 * n + 1), random(4 * n + 2));
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        let on = add(a, add(scale(sub(b, a), u), scale(sub(c, a), v)));
        let out = (2.0 * random(4 * n + 3) - 1.0) * band;
        let p = add(on, scale(unit(mesh.area_normal(t)), out));
        let exact = tree.closest(p).signed_distance;
        if p[2] >= 0.0 && exact.abs() <= band {
            found.push((p, exact));
        }
    }
    found
}

fn spar() -> ToolMesh {
    crate::build(&plyflow_model::scene::Tool::JoggleSpar(
        crate::sweep::tests::demo(),
    ))
    .unwrap()
}

/// Largest error and its 99 % quantile.
fn errors(grid: &SignedDistanceGrid, points: &[(Vec3, f64)]) -> [f64; 2] {
    let mut e: Vec<f64> = points
        .iter()
        .map(|&(p, d)| (grid.distance_and_gradient(p).0 - d).abs())
        .collect();
    e.sort_by(f64::total_cmp);
    [e[e.len() - 1], e[e.len() * 99 / 100]]
}

#[test]
fn distance_error_stays_within_the_stated_bounds_in_a_2_mm_band_of_the_spar() {
    let mesh = spar();
    let points = points_near(&mesh, 2e-3, 20_000);
    for (h, largest, most) in [
        (2e-3, 0.04e-3, 0.02e-3),
        (3e-3, 0.06e-3, 0.03e-3),
        (4e-3, 0.1e-3, 0.05e-3),
    ] {
        let grid = SignedDistanceGrid::build(&mesh, h, 6e-3);
        let [max, p99] = errors(&grid, &points);
        println!(
            "h {} mm: max {:.4} mm, 99 % {:.4} mm",
            h * 1e3,
            max * 1e3,
            p99 * 1e3
        );
        assert!(max < largest && p99 < most, "h {h}: {max} {p99}");
    }
}

#[test]
fn gradient_points_from_the_surface_with_nearly_unit_length() {
    let mesh = spar();
    let tree = SurfaceTree::new(&mesh.without_bottom(0.1));
    let grid = SignedDistanceGrid::build(&mesh, 3e-3, 6e-3);
    let (mut length, mut angle): (f64, f64) = (0.0, 0.0);
    for (p, d) in points_near(&mesh, 2e-3, 20_000) {
        let (_, g) = grid.distance_and_gradient(p);
        length = length.max((plyflow_geometry::vec3::norm(g) - 1.0).abs());
        // Closer than this the direction to a facet says nothing of the surface between its edges.
        if d.abs() > 1e-3 {
            let away = scale(sub(p, tree.closest(p).point), 1.0 / d);
            angle = angle.max(plyflow_geometry::vec3::norm(sub(g, away)));
        }
    }
    println!("gradient: length within {length:.4} of 1, direction within {angle:.4} rad");
    assert!(length < 0.04 && angle < 0.12, "{length} {angle}");
}

#[test]
fn distance_to_a_hemisphere_approaches_the_closed_form() {
    // Fine facets: where the surface is smooth the spline adds less than they do.
    let mesh = hemisphere(0.03, 0.001);
    let error = |h: f64| {
        let grid = SignedDistanceGrid::build(&mesh, h, 4e-3);
        (0..4000)
            .map(|n| {
                let (u, turn) = (
                    0.2 + 0.8 * random(3 * n),
                    std::f64::consts::TAU * random(3 * n + 1),
                );
                let out = 4e-3 * (random(3 * n + 2) - 0.5);
                let (r, s) = (0.03 + out, (1.0 - u * u).sqrt());
                let p = [r * s * turn.cos(), r * s * turn.sin(), r * u];
                (grid.distance_and_gradient(p).0 - out).abs()
            })
            .fold(0.0, f64::max)
    };
    let (coarse, fine) = (error(4e-3), error(2e-3));
    println!(
        "sphere: {:.5} mm at 4 mm, {:.5} mm at 2 mm",
        coarse * 1e3,
        fine * 1e3
    );
    assert!(
        coarse < 8e-6 && fine < 5e-6 && fine < coarse,
        "{coarse} {fine}"
    );
}

#[test]
fn gradient_is_the_derivative_of_the_distance() {
    let mesh = spar();
    let grid = SignedDistanceGrid::build(&mesh, 4e-3, 6e-3);
    let d = 2e-4;
    for (p, _) in points_near(&mesh, 4e-3, 2000) {
        let (_, g) = grid.distance_and_gradient(p);
        for k in 0..3 {
            let at = |s: f64| {
                let mut q = p;
                q[k] += s * d;
                grid.distance_and_gradient(q).0
            };
            // Fourth order; single precision leaves about 1e-8 m in the distance.
            let slope = (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * d);
            assert!(
                (slope - g[k]).abs() < 3e-4,
                "at {p:?} axis {k}: {slope} against {}",
                g[k]
            );
        }
    }
}

#[test]
fn gradient_is_continuous_across_cell_faces() {
    let mesh = spar();
    let grid = SignedDistanceGrid::build(&mesh, 4e-3, 6e-3);
    for (p, _) in points_near(&mesh, 2e-3, 1000) {
        for k in 0..3 {
            let mut q = p;
            q[k] = grid.origin[k] + ((p[k] - grid.origin[k]) / grid.spacing).round() * grid.spacing;
            let (mut a, mut b) = (q, q);
            (a[k], b[k]) = (q[k] - 1e-9, q[k] + 1e-9);
            let (da, ga) = grid.distance_and_gradient(a);
            let (db, gb) = grid.distance_and_gradient(b);
            assert!((da - db).abs() < 2e-8, "{da} {db}");
            assert!(
                plyflow_geometry::vec3::norm(sub(ga, gb)) < 2e-5,
                "{ga:?} {gb:?}"
            );
        }
    }
}

#[test]
fn walls_are_right_on_both_sides_down_to_the_bed() {
    // A vertical wall at x = 60 mm: the bottom must not count.
    let tool = Tool::Flat(FlatTool {
        length: Length(0.12),
        width: Length(0.12),
        height: Length(0.04),
        fillet: Length(0.008),
        facet_size: Length(0.005),
    });
    let grid = SignedDistanceGrid::build(&crate::build(&tool).unwrap(), 2e-3, 6e-3);
    for z in [0.0, 1e-4, 1e-3, 5e-3] {
        for out in [-4e-3, -1e-3, 0.0, 1e-3, 4e-3] {
            let (d, g) = grid.distance_and_gradient([0.06 + out, 0.01, z]);
            assert!((d - out).abs() < 1e-6, "z {z}: {d} against {out}");
            assert!(
                (g[0] - 1.0).abs() < 1e-4 && g[2].abs() < 1e-4,
                "z {z}: {g:?}"
            );
        }
    }
}

#[test]
fn far_points_are_left_out_and_near_points_are_not() {
    let mesh = hemisphere(0.05, 0.004);
    let grid = SignedDistanceGrid::build(&mesh, 3e-3, 6e-3);
    let tree = SurfaceTree::new(&mesh.without_bottom(0.1));
    let limit = 4e-3;
    let (mut near, mut far) = (0, 0);
    for n in 0..20_000 {
        let p: Vec3 = std::array::from_fn(|k| {
            let r = random(3 * n + k as u64);
            if k == 2 { 0.08 * r } else { 0.16 * (r - 0.5) }
        });
        let exact = tree.closest(p).signed_distance;
        match grid.within(p, limit) {
            Some((d, _)) => {
                near += 1;
                assert!(exact < limit + 1e-4 && d < limit, "{p:?} {exact} {d}");
                assert!(
                    exact < -0.02 || (d - exact).abs() < 1e-4,
                    "{p:?} {exact} {d}"
                );
            }
            None => {
                far += 1;
                assert!(exact > limit - 1e-4, "{p:?} {exact}");
            }
        }
        let (d, _) = grid.distance_and_gradient(p);
        assert!(
            d <= exact.max(-0.02) + 1e-4,
            "not a lower bound at {p:?}: {d} for {exact}"
        );
    }
    assert!(near > 1000 && far > 1000, "{near} {far}");
    let (d, g) = grid.distance_and_gradient([0.0, 0.0, 1.05]);
    assert!((d - 1.0).abs() < 1e-12 && g == [0.0, 0.0, 1.0]);
    assert_eq!(grid.within([f64::NAN, 0.0, 0.0], limit), None);
}

#[test]
fn many_points_give_the_same_as_one_by_one() {
    let mesh = hemisphere(0.05, 0.006);
    let grid = SignedDistanceGrid::build(&mesh, 3e-3, 6e-3);
    let points: Vec<Vec3> = (0..500)
        .map(|n| {
            std::array::from_fn(|k| {
                0.06 * (random(3 * n + k as u64) - if k == 2 { 0.0 } else { 0.5 })
            })
        })
        .collect();
    let (mut d, mut g) = (vec![0.0; 500], vec![[0.0; 3]; 500]);
    grid.within_many(&points, 5e-3, &mut d, &mut g);
    for (i, p) in points.iter().enumerate() {
        assert_eq!(
            grid.within(*p, 5e-3).unwrap_or((f64::INFINITY, [0.0; 3])),
            (d[i], g[i])
        );
    }
}

#[test]
fn grid_is_the_same_bytes_for_any_number_of_threads() {
    let mesh = hemisphere(0.05, 0.006);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let grid = pool.install(|| SignedDistanceGrid::build(&mesh, 4e-3, 6e-3));
        (grid.coefficients, grid.bounds)
    };
    let one = with(1);
    assert!(one == with(2) && one == with(3));
}

/// Where the ray from `axis` outwards crosses the zero of a field (m from the axis).
fn zero(grid: &SignedDistanceGrid, axis: Vec3, out: Vec3, mut near: f64) -> f64 {
    for _ in 0..20 {
        near -= grid.distance_and_gradient(add(axis, scale(out, near))).0;
    }
    near
}

/// Sum of the chords of a polygon with its nodes every `size` of arc (m) around a circle of `radius`, at `at` the angles' radii.
fn perimeter(radius: f64, size: f64, at: impl Fn(f64) -> f64) -> f64 {
    let n = (std::f64::consts::TAU * radius / size).round() as usize;
    let node = |i: usize| {
        let angle = std::f64::consts::TAU * i as f64 / n as f64;
        [angle.cos(), angle.sin()].map(|c| at(angle) * c)
    };
    let chord = |i: usize| {
        let [[a, b], [c, d]] = [node(i), node(i + 1)];
        (a - c).hypot(b - d)
    };
    (0..n).map(chord).sum()
}

#[test]
fn elements_on_the_shifted_field_are_as_long_as_the_surface() {
    // Around a ball near its foot, where it curves both ways; elements of 5 and 8 mm are some 1 and 3 % of it short on the surface.
    let radius = 0.02;
    let mesh = hemisphere(radius, 0.0004);
    let grid = SignedDistanceGrid::build(&mesh, 1.5e-3, 9e-3);
    let around = std::f64::consts::TAU * radius;
    for size in [5e-3, 8e-3] {
        let field = grid.of_equal_length(size);
        let on = |angle: f64| zero(&field, [0.0; 3], [angle.cos(), angle.sin(), 0.0], radius);
        let short = around - perimeter(radius, size, |_| radius);
        let left = around - perimeter(radius, size, on);
        println!("{size}: {short} {left}");
        assert!(left.abs() < 0.12 * short, "{size}: {left} of {short}");
    }
}

/// A block, 120 mm long and 200 mm wide, with a half-round groove of `radius` (m) across its top at z = `top` (m).
fn grooved(radius: f64, top: f64) -> ToolMesh {
    let groove = (0..=120).map(|i| {
        let angle = std::f64::consts::PI * f64::from(i) / 120.0;
        [-radius * angle.cos(), top - radius * angle.sin()]
    });
    let edge = |x: f64| [x, top];
    let profile: Vec<[f64; 2]> = [edge(-0.06)]
        .into_iter()
        .chain(groove)
        .chain([edge(0.06)])
        .collect();
    let mut mesh = ToolMesh::default();
    for &[x, z] in &profile {
        for (y, z) in [(-0.1, 0.0), (0.1, 0.0), (0.1, z), (-0.1, z)] {
            mesh.points.push([x, y, z]);
        }
    }
    // Between two sections, and the two ends; seen from outside the corners go round against the clock.
    let mut quad = |[a, b, c, d]: [u32; 4]| mesh.triangles.extend([[a, b, c], [a, c, d]]);
    let last = profile.len() as u32 - 1;
    for i in 0..last {
        let (n, m) = (4 * i, 4 * i + 4);
        for k in 0..4 {
            let l = (k + 1) % 4;
            quad([n + k, n + l, m + l, m + k]);
        }
    }
    quad([3, 2, 1, 0]);
    quad([0, 1, 2, 3].map(|k| 4 * last + k));
    mesh
}

#[test]
fn elements_in_a_hollow_are_as_long_as_it_too() {
    let (radius, top) = (0.02, 0.05);
    let mesh = grooved(radius, top);
    assert!(mesh.is_watertight() && mesh.volume() > 0.0);
    let grid = SignedDistanceGrid::build(&mesh, 1.5e-3, 9e-3);
    // 100 degrees of the groove, of elements that fit in whole, along it.
    let arc = 100f64.to_radians();
    for elements in [4, 7] {
        let size = radius * arc / f64::from(elements);
        let field = grid.of_equal_length(size);
        let length = |on: &dyn Fn(Vec3) -> f64| {
            let node = |i: i32| {
                let angle = arc * (f64::from(i) / f64::from(elements) - 0.5);
                let down = [angle.sin(), 0.0, -angle.cos()];
                add([0.0, 0.0, top], scale(down, on(down)))
            };
            let chord = |i: i32| plyflow_geometry::vec3::norm(sub(node(i + 1), node(i)));
            (0..elements).map(chord).sum::<f64>()
        };
        // Outside is towards the axis.
        let on = |out: Vec3| {
            let at = |r: f64| add([0.0, 0.0, top], scale(out, r));
            (0..20).fold(radius, |r, _| r + field.distance_and_gradient(at(r)).0)
        };
        let short = radius * arc - length(&|_| radius);
        let left = radius * arc - length(&on);
        println!("{size}: {short} {left}");
        assert!(left.abs() < 0.12 * short, "{size}: {left} of {short}");
    }
}

#[test]
fn the_shifted_field_is_that_of_the_surface_where_it_is_flat() {
    let mesh = spar();
    let grid = SignedDistanceGrid::build(&mesh, 3e-3, 12e-3);
    let field = grid.of_equal_length(8e-3);
    // On the flat top, far from its edges.
    let top = mesh.bounds()[1];
    let p = [0.3 * top[0], 0.0, top[2] + 1e-3];
    let [a, b] = [&grid, &field].map(|g| g.distance_and_gradient(p));
    assert!((a.0 - b.0).abs() < 1e-6, "{} {}", a.0, b.0);
    assert!(
        plyflow_geometry::vec3::norm(sub(a.1, b.1)) < 1e-3,
        "{a:?} {b:?}"
    );
}

/// A box over `low` to `high` (m).
fn block(low: Vec3, high: Vec3) -> ToolMesh {
    let mut mesh = ToolMesh::default();
    for z in [low[2], high[2]] {
        for [x, y] in [
            [low[0], low[1]],
            [high[0], low[1]],
            [high[0], high[1]],
            [low[0], high[1]],
        ] {
            mesh.points.push([x, y, z]);
        }
    }
    for [a, b, c, d] in [
        [3, 2, 1, 0],
        [4, 5, 6, 7],
        [0, 1, 5, 4],
        [1, 2, 6, 5],
        [2, 3, 7, 6],
        [3, 0, 4, 7],
    ] {
        mesh.triangles.extend([[a, b, c], [a, c, d]]);
    }
    mesh
}

fn together(meshes: &[ToolMesh]) -> ToolMesh {
    let mut all = ToolMesh::default();
    for mesh in meshes {
        let first = all.points.len() as u32;
        all.points.extend(&mesh.points);
        all.triangles
            .extend(mesh.triangles.iter().map(|t| t.map(|p| first + p)));
    }
    all
}

/// A rib 5 mm thick and 60 mm high: differences over half an element reach through it. Its flat sides have no curvature.
#[test]
fn the_flat_sides_of_a_thin_wall_stay_where_they_are() {
    let wall = block([-0.0025, -0.05, 0.0], [0.0025, 0.05, 0.06]);
    let grid = SignedDistanceGrid::build(&wall, 3e-3, 12e-3);
    for size in [8e-3, 10e-3, 15e-3] {
        let field = grid.of_equal_length(size);
        for z in [0.02, 0.03, 0.04] {
            let p = [0.0035, 0.0, z];
            let shift = grid.distance_and_gradient(p).0 - field.distance_and_gradient(p).0;
            assert!(shift.abs() < 2e-5, "{size}, {z}: moved by {shift}");
        }
    }
}

#[test]
fn bodies_that_stand_on_or_in_each_other_are_one_tool() {
    let plate = block([-0.06, -0.06, 0.0], [0.06, 0.06, 0.02]);
    // Standing on the plate, and sunk 5 mm into it.
    for foot in [0.02, 0.015] {
        let block = block([-0.03, -0.03, foot], [0.03, 0.03, 0.06]);
        let grid = SignedDistanceGrid::build(&together(&[plate.clone(), block]), 2e-3, 8e-3);
        for (p, inside) in [
            ([0.0, 0.0, 0.021], true),
            ([0.025, 0.0, 0.022], true),
            ([0.0, 0.0, 0.012], true),
            ([0.04, 0.0, 0.018], true),
            ([0.034, 0.0, 0.024], false),
            ([0.0, 0.0, 0.064], false),
        ] {
            let d = grid.distance_and_gradient(p).0;
            assert!((d < -5e-4) == inside && d.abs() > 5e-4, "{foot}: {p:?} {d}");
        }
        // Square to the block's side, over the plate.
        let (d, n) = grid.distance_and_gradient([0.034, 0.0, 0.04]);
        assert!((d - 0.004).abs() < 1e-4 && n[0] > 0.99, "{d} {n:?}");
    }
}

/// A punch may be described from its crown: its top at z = 0 is no bottom, and its foot need not be at 0.
#[test]
fn the_bottom_of_a_tool_is_its_lowest_face_wherever_that_is() {
    let punch = block([-0.03, -0.03, -0.05], [0.03, 0.03, 0.0]);
    let open = punch.without_bottom(0.02);
    assert_eq!(open.bounds()[1][2], 0.0);
    assert!((open.bounds()[0][2] + 0.07).abs() < 1e-12);
    let grid = SignedDistanceGrid::build(&punch, 2e-3, 8e-3);
    assert!((grid.distance_and_gradient([0.0, 0.0, 2e-4]).0 - 2e-4).abs() < 1e-5);
    // Single precision of a file in inches: 5 um above the bed.
    let lifted = block([-0.03, -0.03, 5e-6], [0.03, 0.03, 0.05]);
    let grid = SignedDistanceGrid::build(&lifted, 2e-3, 8e-3);
    let (d, n) = grid.distance_and_gradient([0.029, 0.0, 5e-4]);
    assert!((d + 1e-3).abs() < 2e-5 && n[0] > 0.99, "{d} {n:?}");
}
