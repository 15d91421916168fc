//! Distances on the tool of the joggle spar: fillets, ramps, thin facets.

use plyflow_geometry::vec3::{add, cross, norm, scale, sub, unit};
use plyflow_model::scene::Tool;
use plyflow_surface::{Ground, Surface, Topology, nodal_distances, tool_crests};

fn spar() -> plyflow_tooling::ToolMesh {
    let tool: Tool = serde_json::from_value(serde_json::json!({"joggle_spar": {
        "length": "620 mm", "top_width": "130 mm", "height": "110 mm", "draft": "8 deg",
        "fillet": "14 mm", "corner": "40 mm", "facet_size": "8 mm",
        "joggles": [{"start": "-115 mm", "length": "30 mm", "rise": "10 mm", "skew": "20 deg",
                     "side_step": ["6 mm", "0 mm"], "fillet": "14 mm"}]}}))
    .unwrap();
    plyflow_tooling::build(&tool).unwrap()
}

#[test]
fn a_sheet_offset_from_the_spar_conforms_and_one_lifted_off_it_does_not() {
    let mesh = spar();
    let tool = Surface::new(&mesh.points, &mesh.triangles).unwrap();
    let offset = 0.00068;
    let lift = |height: f64| {
        let above = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| mesh.points[i as usize]);
            let normal = unit(cross(sub(b, a), sub(c, a)));
            add(scale(add(a, add(b, c)), 1.0 / 3.0), scale(normal, height))
        };
        mesh.triangles.iter().map(above).collect::<Vec<_>>()
    };
    for height in [offset, offset + 0.002, -0.003] {
        let nodes = lift(height);
        // On a bed no normals are asked for.
        let none = Topology::new(nodes.len(), 3, &[]);
        let found = nodal_distances(&tool, &none, &nodes, offset, Ground::bed(0.010));
        let judged = found.iter().filter(|d| d.judged).count();
        assert!(judged > found.len() / 2, "{judged} of {}", found.len());
        // Facets are chords of 0.02 mm: in a valley a neighbour is that much nearer.
        let miss = found
            .iter()
            .filter(|d| d.judged)
            .map(|d| (d.value + offset - height).abs());
        let worst = miss.fold(0.0, f64::max);
        assert!(worst < 5e-5, "height {height}: {worst}");
    }
}

#[test]
fn all_facets_of_the_spar_have_pseudo_normals_outward() {
    let mesh = spar();
    let tool = Surface::new(&mesh.points, &mesh.triangles).unwrap();
    for p in &mesh.points {
        let outside = scale(unit([p[0] * 0.1, p[1], p[2]]), 0.5);
        let found = tool.closest(outside);
        assert!(found.signed_distance > 0.0, "{p:?}");
        assert!((norm(found.normal) - 1.0).abs() < 1e-9);
    }
}

#[test]
fn crests_of_the_spar_are_its_fillets_and_its_flats_have_none() {
    let mesh = spar();
    let tool = Surface::new(&mesh.points, &mesh.triangles).unwrap();
    let crests = tool_crests(&tool);
    let (low, high) = tool.bounds();
    let (mut sharpest, mut flat) = (0.0f64, 0);
    for (t, &crest) in tool.triangles().iter().zip(&crests) {
        let z = t.map(|i| mesh.points[i as usize][2]);
        // The rim at the bed has no neighbours below it: the fit is one-sided there.
        if z.iter().all(|&z| z > low[2] + 0.02) {
            sharpest = sharpest.min(crest);
        }
        if z.iter().all(|&z| (z - high[2]).abs() < 1e-9) {
            flat += usize::from(crest.abs() < 1.0);
        }
    }
    // The tool says of itself: 14 mm fillets, nowhere sharper than 10 mm.
    assert!((-110.0..-65.0).contains(&sharpest), "{sharpest}");
    assert!(flat > 10, "{flat}");
}
