//! Where there is tool to lie on: sheets that hang beside tools without a bed, and over holes in them.

mod common;

use plyflow_geometry::vec3::{Vec3, add, scale};
use plyflow_model::scene::Tool;
use plyflow_surface::{
    Ground, NodalDistance, Surface, Topology, judged_share, nodal_distances, triangles,
};
use serde_json::{Value, json};

const OFFSET: f64 = 0.0005;
/// A tool in the air, with the usual margin at its foot.
const AIR: Ground = Ground {
    foot_margin: 0.010,
    bed: false,
};

fn built(tool: Value) -> Surface {
    let tool: Tool = serde_json::from_value(tool).unwrap();
    let mesh = plyflow_tooling::build(&tool).unwrap();
    Surface::new(&mesh.points, &mesh.triangles).unwrap()
}

/// A sheet on a square grid over [-a, a]^2 in the plane z.
struct Flat {
    points: Vec<Vec3>,
    topology: Topology,
}

impl Flat {
    fn new(a: f64, cells: usize, z: f64) -> Self {
        let (flat, nodes) = common::grid(cells, a, 0.0);
        Self {
            points: common::lifted(&flat, |_, _| z),
            topology: Topology::new(flat.len(), 4, &nodes),
        }
    }

    fn on(&self, tool: &Surface, ground: Ground) -> Vec<NodalDistance> {
        nodal_distances(tool, &self.topology, &self.points, OFFSET, ground)
    }

    fn share(&self, found: &[NodalDistance]) -> f64 {
        judged_share(found, &self.topology.node_areas(&self.points))
    }

    /// Checks that exactly the nodes at these places are judged.
    fn only(&self, found: &[NodalDistance], at: impl Fn(f64, f64) -> bool) {
        for (p, d) in self.points.iter().zip(found) {
            assert_eq!(d.judged, at(p[0], p[1]), "{p:?} {d:?}");
        }
    }
}

#[test]
fn a_flat_tool_smaller_than_the_sheet_is_judged_where_it_is() {
    let tool = built(
        json!({"flat": {"length": "200 mm", "width": "104 mm", "height": "20 mm", "fillet": "4 mm", "facet_size": "8 mm"}}),
    );
    // The edges of the tool lie amid cells of 4 mm.
    let sheet = Flat::new(0.15, 75, 0.02 + OFFSET);
    let found = sheet.on(&tool, AIR);
    sheet.only(&found, |x, y| x.abs() <= 0.1 && y.abs() <= 0.052);
    let share = sheet.share(&found);
    assert!(
        (share - 0.2 * 0.104 / (0.3 * 0.3)).abs() < 0.01,
        "share {share}"
    );
    // It lies on the tool. Over the fillet of 4 mm, 2 mm off the middle of its arc, it stands off by the closed form; corners have two fillets.
    let straight = sheet.points.iter().zip(&found);
    let straight = straight.filter(|(p, d)| d.judged && (p[0].abs() < 0.08 || p[1].abs() < 0.03));
    let largest = straight.map(|(_, d)| d.value).fold(0.0, f64::max);
    let known = 0.002f64.hypot(0.004 + OFFSET) - 0.004 - OFFSET;
    assert!(
        (largest - known).abs() < 3e-5,
        "largest {largest}, not {known}"
    );
    // On a bed a sheet would be drawn down there: it bridges.
    let bridging = sheet.on(&tool, Ground::bed(0.010));
    assert!(bridging.iter().any(|d| d.judged && d.value > 0.04));
}

/// A square plate of 200 mm between z = -10 mm and 0 with a square hole of 60 mm through it, or down to a floor of 1 mm.
fn with_hole(floor: bool) -> Surface {
    let mut points: Vec<Vec3> = Vec::new();
    for half in [0.1, 0.03] {
        for z in [0.0, -0.01] {
            for [x, y] in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
                points.push([half * x, half * y, z]);
            }
        }
    }
    let at = |ring: u32, k: u32| 4 * ring + k % 4;
    let mut cells = Vec::new();
    for k in 0..4 {
        let (a, b) = (k, k + 1);
        // Top, outer side, bottom, side of the hole: from outside counter-clockwise.
        cells.extend([at(0, a), at(0, b), at(2, b), at(2, a)]);
        cells.extend([at(1, a), at(1, b), at(0, b), at(0, a)]);
        cells.extend([at(3, a), at(3, b), at(1, b), at(1, a)]);
        cells.extend([at(2, a), at(2, b), at(3, b), at(3, a)]);
    }
    if floor {
        cells.extend([at(3, 0), at(3, 1), at(3, 2), at(3, 3)]);
    }
    Surface::new(&points, &triangles(4, &cells)).unwrap()
}

#[test]
fn a_hole_through_the_tool_is_not_judged_and_a_pocket_in_it_is() {
    let sheet = Flat::new(0.12, 60, OFFSET);
    let on = |x: f64, y: f64| x.abs().max(y.abs()) <= 0.1;
    let hole = |x: f64, y: f64| x.abs().max(y.abs()) < 0.03;
    let found = sheet.on(&with_hole(false), AIR);
    sheet.only(&found, |x, y| on(x, y) && !hole(x, y));
    let found = sheet.on(&with_hole(true), AIR);
    sheet.only(&found, on);
    // Over the middle of the pocket its floor, 10 mm down, is the nearest.
    let middle = sheet.points.iter().position(|p| p[0].hypot(p[1]) < 1e-9);
    assert!((found[middle.unwrap()].value - 0.010).abs() < 1e-9);
}

#[test]
fn a_plane_over_a_hemisphere_is_judged_over_its_circle() {
    let radius = 0.05;
    let tool = built(json!({"hemisphere": {"radius": "50 mm", "facet_size": "4 mm"}}));
    let sheet = Flat::new(0.08, 128, radius + OFFSET);
    let found = sheet.on(&tool, AIR);
    for (p, d) in sheet.points.iter().zip(&found) {
        let r = p[0].hypot(p[1]);
        // Past the circle the plane runs along the sphere by 45 degrees until it is 51 mm off the axis, and facets of 4 mm are turned by some degrees.
        if r < radius - 2e-4 || r > 1.1 * radius {
            assert_eq!(d.judged, r < radius, "{p:?}");
        }
        if d.judged {
            let known = r.hypot(radius + OFFSET) - radius - OFFSET;
            assert!((d.value - known).abs() < 5e-5, "{p:?} {d:?}");
        }
    }
    let known = std::f64::consts::PI * radius * radius / (0.16 * 0.16);
    let share = sheet.share(&found);
    assert!(
        share > known - 0.005 && share < 1.21 * known,
        "{share} {known}"
    );
}

#[test]
fn a_sheet_on_a_wall_is_judged_and_its_flange_beside_the_tool_is_not() {
    // 60 mm high, with walls along z.
    let tool = built(
        json!({"flat": {"length": "200 mm", "width": "100 mm", "height": "60 mm", "fillet": "4 mm", "facet_size": "8 mm"}}),
    );
    // Down the wall at x = 100 mm, 2 mm off it, then a flange 20 mm over the foot.
    let mut line: Vec<[f64; 2]> = (0..8)
        .map(|k| [0.102, 0.054 - 0.004 * f64::from(k)])
        .collect();
    line.extend((1..10).map(|k| [0.102 + 0.004 * f64::from(k), 0.026]));
    let (along, rows) = (line.len(), 5);
    let points: Vec<Vec3> = (0..rows)
        .flat_map(|j| line.iter().map(move |[x, z]| [*x, 0.004 * j as f64, *z]))
        .collect();
    let at = |i: usize, j: usize| (j * along + i) as u32;
    let cells: Vec<u32> = (0..rows - 1)
        .flat_map(|j| (0..along - 1).map(move |i| (i, j)))
        .flat_map(|(i, j)| [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)])
        .collect();
    let topology = Topology::new(points.len(), 4, &cells);
    let found = nodal_distances(&tool, &topology, &points, OFFSET, AIR);
    for (i, d) in found.iter().enumerate() {
        let k = i % along;
        // At the bend the sheet is turned by 45 degrees: it may be either.
        if k != 7 {
            assert_eq!(d.judged, k < 7, "node {k} of the line");
        }
        if k < 7 {
            assert!((d.value - (0.002 - OFFSET)).abs() < 1e-9, "{d:?}");
        }
    }
}

#[test]
fn a_sheet_that_lies_on_a_spar_in_the_air_is_judged_above_its_foot() {
    let tool: Tool = serde_json::from_value(json!({"joggle_spar": {
        "length": "620 mm", "top_width": "130 mm", "height": "110 mm", "draft": "8 deg",
        "fillet": "14 mm", "corner": "40 mm", "facet_size": "8 mm",
        "joggles": [{"start": "-115 mm", "length": "30 mm", "rise": "10 mm", "skew": "20 deg",
                     "side_step": ["6 mm", "0 mm"], "fillet": "14 mm"}]}}))
    .unwrap();
    let mesh = plyflow_tooling::build(&tool).unwrap();
    let surface = Surface::new(&mesh.points, &mesh.triangles).unwrap();
    let topology = Topology::new(mesh.points.len(), 3, mesh.triangles.as_flattened());
    let normals = topology.normals(&mesh.points);
    let lifted: Vec<Vec3> = (mesh.points.iter().zip(&normals))
        .map(|(p, n)| add(*p, scale(*n, OFFSET)))
        .collect();
    let found = nodal_distances(&surface, &topology, &lifted, OFFSET, AIR);
    let mut seen = 0;
    for (p, d) in lifted.iter().zip(&found) {
        if p[2] > 0.0101 {
            assert!(d.judged, "{p:?}");
            seen += 1;
        }
    }
    assert!(seen > 500, "{seen}");
}
