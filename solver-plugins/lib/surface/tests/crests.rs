//! Crests of tools with few large facets, as files have them.

use plyflow_geometry::vec3::{Vec3, norm, sub};
use plyflow_surface::{Crests, Surface, tool_crests};

/// Radius of the fillets (m), facets of each, half the width of the top, half the length.
const R: f64 = 0.006;
const N: usize = 9;
const HALF: [f64; 2] = [0.100, 0.150];

/// A profile in y and z: up a wall, over a fillet, across the top, over a fillet, down a wall.
fn profile() -> Vec<[f64; 2]> {
    let fillet = |side: f64| {
        (0..=N).map(move |k| {
            let angle = 0.5 * std::f64::consts::PI * k as f64 / N as f64;
            let y = HALF[0] - R + R * angle.cos();
            [side * y, R * (angle.sin() - 1.0)]
        })
    };
    let mut all = vec![[HALF[0], -0.06]];
    all.extend(fillet(1.0));
    all.extend(fillet(-1.0).collect::<Vec<_>>().into_iter().rev());
    all.push([-HALF[0], -0.06]);
    all
}

/// The profile drawn along x: two facets from end to end for each of its sides, or in pieces of that length.
fn tool(piece: f64) -> Surface {
    let profile = profile();
    let n = (2.0 * HALF[1] / piece).round().max(1.0) as usize;
    let points: Vec<Vec3> = (0..=n)
        .flat_map(|i| {
            let x = HALF[1] * (2.0 * i as f64 / n as f64 - 1.0);
            profile.iter().map(move |[y, z]| [x, *y, *z])
        })
        .collect();
    let m = profile.len();
    let at = |i: usize, j: usize| (i * m + j) as u32;
    let facets: Vec<[u32; 3]> = (0..n)
        .flat_map(|i| (0..m - 1).map(move |j| (i, j)))
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[a, c, b], [a, d, c]]
        })
        .collect();
    Surface::new(&points, &facets).unwrap()
}

#[test]
fn a_large_flat_facet_is_crested_at_its_rim_alone() {
    for piece in [1.0, 0.02] {
        let tool = tool(piece);
        let (crests, by_triangle) = (Crests::new(&tool), tool_crests(&tool));
        let at = |p: Vec3| {
            let t = tool.closest(p).triangle;
            (crests.at(p, t), by_triangle[t])
        };
        // 1 mm above the top, the wall and the fillets, away from the ends.
        for i in 0..30 {
            let x = -0.1 + 0.2 * f64::from(i) / 29.0;
            for y in [-0.08, -0.05, 0.0, 0.03, 0.079] {
                let (found, before) = at([x, y, 0.001]);
                assert!(found.abs() < 1e-6, "{x} {y}: {found}");
                if piece < 0.1 {
                    assert!(before < -30.0, "{before}");
                }
            }
            let (found, _) = at([x, HALF[0] + 0.001, -0.035]);
            assert!(found.abs() < 1e-6, "{x}: {found}");
            for k in 0..20 {
                let angle: f64 = 0.1 + 1.37 * f64::from(k) / 19.0;
                let (y, z) = (
                    HALF[0] - R + (R + 0.001) * angle.cos(),
                    (R + 0.001) * angle.sin() - R,
                );
                let (found, _) = at([x, y, z]);
                assert!((-300.0..-130.0).contains(&found), "{x} {angle}: {found}");
            }
            // Where the fillet ends, what lies over it is still bent.
            let (found, _) = at([x, HALF[0] - R - 0.0005, 0.001]);
            assert!(found < -40.0, "{x}: {found}");
        }
    }
}

#[test]
fn facets_of_the_size_of_parametric_tools_are_left_as_they_are() {
    // Of the shipped workflows.
    let tools = serde_json::json!([
        {"flat": {"length": "620 mm", "width": "420 mm", "height": "20 mm", "fillet": "10 mm", "facet_size": "12 mm"}},
        {"joggle_spar": {
            "length": "620 mm", "top_width": "130 mm", "height": "110 mm", "draft": "8 deg", "fillet": "14 mm",
            "corner": "40 mm", "facet_size": "8 mm",
            "joggles": [{"start": "-115 mm", "length": "30 mm", "rise": "10 mm", "skew": "20 deg",
                         "side_step": ["6 mm", "0 mm"], "fillet": "14 mm"}]}},
        {"ramped_spar": {
            "length": "640 mm", "top_width": "110 mm", "height": "90 mm", "draft": "8 deg", "fillet": "14 mm",
            "recess": "60 mm", "ramp": "40 mm", "depth": "10 mm", "side_depth": "5 mm", "facet_size": "8 mm"}},
        {"hemisphere": {"radius": "50 mm", "facet_size": "4 mm"}},
    ]);
    for tool in tools.as_array().unwrap() {
        let tool: plyflow_model::scene::Tool = serde_json::from_value(tool.clone()).unwrap();
        let mesh = plyflow_tooling::build(&tool).unwrap();
        let tool = Surface::new(&mesh.points, &mesh.triangles).unwrap();
        let (crests, by_triangle) = (Crests::new(&tool), tool_crests(&tool));
        for (t, corners) in tool.triangles().iter().enumerate() {
            let p = tool.points()[corners[0] as usize];
            assert_eq!(crests.at(p, t).to_bits(), by_triangle[t].to_bits());
            let side = |i: usize| {
                let [p, q] = [corners[i], corners[(i + 1) % 3]].map(|k| tool.points()[k as usize]);
                norm(sub(p, q))
            };
            assert!((0..3).all(|i| side(i) < 0.010));
        }
    }
}
