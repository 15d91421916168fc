//! Plies formed over the tools that are no block and no hemisphere: double dome, tetrahedron, STL files.
//!
//! What the shear angles are judged by: fibres that do not stretch form a net of two families on the tool, and in a net the angles of a
//! patch between fibres tell its total curvature (Hazzidakis 1879): going around the patch, the angle between the families at the
//! corners, with alternating signs, sums to the integral of the Gaussian curvature over the patch. It follows from the tool's shape
//! alone.

use crate::common::scenes::{bag, gentle_press, ply};
use crate::common::{apart, form, woven};
use plyflow_forming_explicit::{Forming, Outcome, Parameters};
use plyflow_geometry::vec3::Vec3;
use plyflow_kernels::m4::M4;
use plyflow_mechanics::component::element_fields;
use plyflow_model::scene::Scene;
use plyflow_sdk::Element as _;
use plyflow_tooling::ToolMesh;
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;

/// A bag with one woven ply, its fibres along x and y, over this tool: elements of 4 mm. So slippery that the ply does not bridge what is
/// hollow.
fn bagged(tool: Value, size: [f64; 2], symmetry: &[&str]) -> Parameters {
    bag(1, |p| {
        let scene = &mut p["scene"];
        scene["tool"] = tool;
        scene["sheets"][1] = ply("ply_1", &woven(), size, 0.0);
        scene["friction"] =
            json!({"tool_diaphragm": 0.1, "fabric_diaphragm": 0.1, "diaphragm_diaphragm": 0.1});
        scene["symmetry"] = json!(symmetry);
        let process = &mut scene["process"]["double_diaphragm"];
        process["frame_length"] = json!("0.32 m");
        process["frame_width"] = json!("0.3 m");
        p["element_size"] = json!(0.004);
        p["diaphragm_element_size"] = json!(0.008);
        p["time_step"] = json!(7e-6);
        p["frames"] = json!(10);
        p["tool_grid"] = json!(0.002);
    })
}

/// The beginning of a press stroke on a woven ply over another tool, through a hole of this radius (m).
fn pressed(tool: &Value, size: f64, opening: f64, symmetry: &[&str]) -> Parameters {
    let mut p = gentle_press("m4", 0.0, symmetry);
    let mut scene = serde_json::to_value(&p.scene).unwrap();
    scene["tool"] = tool.clone();
    scene["sheets"][0]["length"] = json!(format!("{size} m"));
    scene["sheets"][0]["width"] = json!(format!("{size} m"));
    scene["process"]["press"]["die"]["opening_radius"] = json!(format!("{opening} m"));
    p.scene = Scene::from_json(scene).unwrap();
    (p.element_size, p.tool_grid) = (0.008, 0.001);
    p
}

/// The ledger closes, and at the 99.9 % quantile of every pair no body is in another by a tenth of its thickness.
fn assert_sound(what: &str, forming: &Forming, outcome: &Outcome) {
    assert!(
        outcome.health.peak_drift_ratio < 0.01,
        "{what}: {:?}",
        outcome.health
    );
    for p in forming.penetrations() {
        assert!(p.q999 < 0.1 * (p.thinner + p.spare), "{what}: {p:?}");
    }
}

/// An element of a ply: its corners at the start and now (m), and by how much (rad) its fibres have opened beyond a right angle.
struct Element {
    then: [Vec3; 4],
    now: [Vec3; 4],
    opened: f64,
}

fn elements(forming: &Forming, body: usize) -> Vec<Element> {
    let body = &forming.bodies[body];
    let (then, now) = (forming.reference_points(body), forming.points(body));
    let all = element_fields(M4::MANIFEST);
    let shear = all
        .iter()
        .find(|f| f.name == "shear_angle")
        .expect("a field");
    let shear = forming.field(body, shear, &all);
    let at = |points: &[Vec3], c: &[u32; 4]| c.map(|n| points[n as usize]);
    let cells = body.cells.iter().zip(shear);
    cells
        .map(|(c, s)| Element {
            then: at(&then, c),
            now: at(&now, c),
            opened: -s,
        })
        .collect()
}

fn middle(corners: &[Vec3; 4]) -> Vec3 {
    [0, 1, 2].map(|k| corners.iter().map(|c| c[k]).sum::<f64>() / 4.0)
}

/// Mean opening (rad) of the elements that began in a square around a place.
fn opened_around(all: &[Element], place: [f64; 2], reach: f64) -> f64 {
    let near = |e: &&Element| (0..2).all(|k| (middle(&e.then)[k] - place[k]).abs() < reach);
    let opened: Vec<f64> = all.iter().filter(near).map(|e| e.opened).collect();
    assert!(opened.len() >= 4, "{place:?}");
    opened.iter().sum::<f64>() / opened.len() as f64
}

/// A part of a symmetric scene gives the whole's places, energies and force.
fn part_is_whole(what: &str, planes: &[&str], scene: impl Fn(&[&str]) -> Parameters) {
    let ((whole, a), (part, b)) = (form(&scene(&[]), 1), form(&scene(planes), 1));
    assert_sound(what, &whole, &a);
    assert_sound(what, &part, &b);
    // The tool's facets are no mirror images of each other: they cut corners by up to 20 um, in other ways on either side.
    let far = apart(&whole, &part);
    assert!(far < 1e-5, "{what}: {far} m");
    let [a, b] = [&a, &b].map(|o| o.history.last().expect("rows"));
    let near = |x: f64, y: f64, to: f64| (x / y - 1.0).abs() < to;
    assert!(
        near(a.ledger.membrane, b.ledger.membrane, 1e-3),
        "{what}: {a:?} {b:?}"
    );
    assert!(
        near(a.punch_force, b.punch_force, 1e-2),
        "{what}: {a:?} {b:?}"
    );
    // There is something to compare.
    let most = elements(&whole, 0)
        .iter()
        .fold(0.0f64, |m, e| m.max(e.opened.abs()));
    assert!(most > 5f64.to_radians(), "{what}: {most}");
}

mod double_dome {
    use super::*;

    const RADIUS: f64 = 0.025;
    /// Of a dome's centre from the middle (m).
    const CENTRE: f64 = 0.0375;
    const WAIST: f64 = 0.15;

    /// 125 mm long, 50 mm wide and 42 mm at the waist.
    fn tool() -> Value {
        json!({"double_dome": {"dome_radius": format!("{RADIUS} m"), "dome_distance": format!("{} m", 2.0 * CENTRE),
                               "waist_radius": format!("{WAIST} m"), "facet_size": "0.002 m"}})
    }

    /// Distance (m) of a point from the tool, the angle of its normal about the x axis, and the normal's component along x: the
    /// tool is turned about that axis. Parallel surfaces have the same normals.
    fn normal_at(p: Vec3) -> (f64, [f64; 2]) {
        let r = p[1].hypot(p[2]);
        let turn = p[1].atan2(p[2]);
        let both = RADIUS + WAIST;
        let height = (both * both - CENTRE * CENTRE).sqrt();
        let x = p[0].abs();
        // Left of the line through both arcs' centres the nearest point is on the waist.
        let (distance, along) = if x * height + (r - height) * CENTRE < 0.0 {
            let far = x.hypot(r - height);
            (WAIST - far, -x / far)
        } else {
            let far = (x - CENTRE).hypot(r);
            (far - RADIUS, (x - CENTRE) / far)
        };
        (distance, [turn, along.copysign(along * p[0].signum())])
    }

    /// Total curvature of an element on the tool: the area of its normals on the sphere, which projects to the cylinder around
    /// its axis x without loss.
    fn curvature(now: &[Vec3; 4]) -> f64 {
        let q = now.map(|p| normal_at(p).1);
        0.5 * ((q[2][0] - q[0][0]) * (q[3][1] - q[1][1])
            - (q[2][1] - q[0][1]) * (q[3][0] - q[1][0]))
    }

    #[test]
    fn a_quarter_in_a_bag_lies_on_the_tool_and_its_fibres_turn_as_the_tools_curvature_has_it() {
        let p = bagged(tool(), [0.112, 0.064], &["x", "y"]);
        let (forming, outcome) = form(&p, 1);
        assert_sound("double dome, bagged", &forming, &outcome);
        let all = elements(&forming, 1);
        let in_quarter = |e: &&Element| middle(&e.then)[0] > 0.0 && middle(&e.then)[1] > 0.0;
        let quarter: Vec<&Element> = all.iter().filter(in_quarter).collect();
        // At nodes, as the mean of the four elements there: nodes of the film between those of the ply draw its rows of
        // elements to and fro.
        let (mut squares, mut count, mut largest) = (0.0, 0.0, 0.0f64);
        for i in 1..14 {
            for j in 1..=6 {
                let [x, y] = [i, j].map(|k| 0.004 * f64::from(k));
                let inside = quarter.iter().filter(|e| {
                    let c = middle(&e.then);
                    c[0] < x && c[1] < y
                });
                let off = inside.clone().map(|e| normal_at(middle(&e.now)).0);
                // Its middle lies on the film and half of itself, 0.23 mm; it bridges the waist by as much again.
                let off = off.fold(0.0, f64::max);
                assert!(off < 5e-4, "({x}, {y}): {off} m off the tool");
                // Along the planes of symmetry the angle is a right one.
                let expected: f64 = inside.map(|e| curvature(&e.now)).sum();
                let opened = opened_around(&all, [x, y], 0.003);
                let apart = (opened - expected).abs();
                squares += apart * apart;
                count += 1.0;
                largest = largest.max(expected.abs());
                // On the dome itself; in the hollow before it friction holds some of the shear back.
                let bound = 0.8f64.to_radians() + 0.05 * expected.abs();
                assert!(
                    x < 0.039 || apart < bound,
                    "({x}, {y}): {} deg, expected {} deg",
                    opened.to_degrees(),
                    expected.to_degrees()
                );
            }
        }
        // 13 degrees on the waist, 29 on the domes. The curvature jumps where they meet, within elements of 4 mm. Measured: 0.73 degrees.
        let apart = f64::sqrt(squares / count);
        assert!(
            largest > 25f64.to_radians() && apart < 1.0f64.to_radians(),
            "{apart} {largest}"
        );
    }

    #[test]
    fn a_pressed_quarter_is_that_of_the_whole() {
        part_is_whole("double dome", &["x", "y"], |planes| {
            pressed(&tool(), 0.16, 0.06, planes)
        });
    }
}

mod tetrahedron {
    use super::*;

    const EDGE: f64 = 0.1;
    const HEIGHT: f64 = 0.025;

    fn tool() -> Value {
        json!({"tetrahedron": {"edge": format!("{EDGE} m"), "height": format!("{HEIGHT} m"), "radius": "0.01 m",
                               "facet_size": "0.002 m"}})
    }

    #[test]
    fn a_half_in_a_bag_has_the_shear_that_the_angles_missing_at_the_top_give() {
        let p = bagged(tool(), [0.064, 0.064], &["x"]);
        let (forming, outcome) = form(&p, 1);
        assert_sound("tetrahedron, bagged", &forming, &outcome);
        // Between plane faces and rounded edges no angle changes: all curvature is in the rounded top, and is what the
        // angles of the three faces there lack of a full turn. Half of it lies beside the plane of symmetry, along which angles are
        // right ones: it is the difference of the angles across the top. Measured: 20.6 of 22.1 degrees; fabric that resists shear
        // strains a little.
        let all = elements(&forming, 1);
        let [low, high] = [-0.016, 0.016].map(|y| opened_around(&all, [0.016, y], 0.0081));
        let side = (EDGE * EDGE / 3.0 + HEIGHT * HEIGHT).sqrt();
        let face = 2.0 * (0.5 * EDGE / side).asin();
        let expected = 0.5 * (std::f64::consts::TAU - 3.0 * face);
        assert!(
            ((low - high) / expected - 1.0).abs() < 0.1,
            "{low} {high}: expected a difference of {expected}"
        );
        // Fibres along y come over an edge on one side and over a face on the other, which shares it about evenly.
        assert!((low + high).abs() < 0.2 * expected, "{low} {high}");
    }

    #[test]
    fn a_pressed_half_is_that_of_the_whole() {
        part_is_whole("tetrahedron", &["x"], |planes| {
            pressed(&tool(), 0.128, 0.045, planes)
        });
    }
}

mod stl {
    use super::*;

    /// Where the file's origin lies (mm).
    const ORIGIN: [f64; 3] = [120.0, -35.0, 12.5];

    /// Corners of the facets in a file's units.
    fn facets(mesh: &ToolMesh) -> Vec<[[f32; 3]; 3]> {
        let in_file = |p: Vec3| [0, 1, 2].map(|k| (1e3 * p[k] - ORIGIN[k]) as f32);
        (0..mesh.triangles.len())
            .map(|t| mesh.corners(t).map(in_file))
            .collect()
    }

    fn binary(facets: &[[[f32; 3]; 3]]) -> Vec<u8> {
        let mut bytes = vec![0; 80];
        bytes.extend((facets.len() as u32).to_le_bytes());
        for corners in facets {
            // Normals are not read.
            bytes.extend([0; 12]);
            bytes.extend(corners.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    fn ascii(facets: &[[[f32; 3]; 3]]) -> String {
        let mut text = String::from("solid dome\n");
        for corners in facets {
            text.push_str("facet normal 0 0 0\nouter loop\n");
            for corner in corners {
                // All digits: text is read in double precision.
                let [x, y, z] = corner.map(f64::from);
                writeln!(text, "vertex {x} {y} {z}").unwrap();
            }
            text.push_str("endloop\nendfacet\n");
        }
        text + "endsolid dome\n"
    }

    /// A ply pressed over a dome, or over what a file holds.
    fn over(file: Option<&Path>) -> (Forming, Outcome) {
        let of_file = |file: &Path| json!({"stl": {"file": file, "unit": "1 mm", "translate": ORIGIN.map(|x| format!("{x} mm"))}});
        over_tool(file.map(of_file))
    }

    /// A ply pressed over a dome, or over a tool of these words.
    fn over_tool(tool: Option<Value>) -> (Forming, Outcome) {
        let mut p = gentle_press("m4", -std::f64::consts::FRAC_PI_4, &[]);
        if let Some(tool) = tool {
            p.scene.tool = serde_json::from_value(tool).unwrap();
        }
        form(&p, 1)
    }

    #[test]
    fn a_dome_in_aircraft_coordinates_and_inches_forms_as_the_one_in_its_place_to_the_bit() {
        let p = gentle_press("m4", -std::f64::consts::FRAC_PI_4, &[]);
        let mut dome = plyflow_tooling::build(&p.scene.tool).unwrap();
        let points = dome.points.iter_mut();
        points.for_each(|q| *q = q.map(|c| (c * 1e9).round() / 1e9));
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, put: &dyn Fn([f64; 3]) -> [f64; 3]| {
            let mut text = String::from("solid dome\n");
            for t in 0..dome.triangles.len() {
                text.push_str("facet normal 0 0 0\nouter loop\n");
                for [x, y, z] in dome.corners(t).map(put) {
                    writeln!(text, "vertex {x} {y} {z}").unwrap();
                }
                text.push_str("endloop\nendfacet\n");
            }
            let file = folder.path().join(name);
            std::fs::write(&file, text + "endsolid dome\n").unwrap();
            file
        };
        let here = write("here.stl", &|q| q.map(|c| (c * 1e9).round() / 1e6));
        let there = write("there.stl", &|[x, y, z]| {
            [y + 4.123, z - 1.5, x + 20.456].map(|c| c / 0.0254)
        });
        let (own, a) = over_tool(Some(json!({"stl": {"file": here, "unit": "1 mm"}})));
        let (placed, b) = over_tool(Some(json!({"stl": {
            "file": there, "unit": "1 in", "up": "+y", "rotate": "90 deg", "centre": "auto", "foot": "auto"}})));
        assert!(a.cycles > 100 && a.cycles == b.cycles);
        assert!(own.model.x() == placed.model.x() && own.model.v() == placed.model.v());
        assert!(own.placement.is_none() && placed.placement.is_some());
    }

    #[test]
    fn a_dome_from_a_file_forms_as_the_parametric_one() {
        let (parametric, a) = over(None);
        assert_sound("dome", &parametric, &a);
        let all = facets(&parametric.tool);
        let folder = tempfile::tempdir().unwrap();
        let [one, other] = ["binary.stl", "ascii.stl"].map(|n| folder.path().join(n));
        std::fs::write(&one, binary(&all)).unwrap();
        std::fs::write(&other, ascii(&all)).unwrap();
        let (one, b) = over(Some(&one));
        let (other, _) = over(Some(&other));
        assert_sound("dome from a file", &one, &b);
        // Measured: 2e-8 m, by the file's single precision.
        let far = apart(&parametric, &one);
        assert!(far < 2e-7, "{far} m");
        assert!(
            one.model.x() == other.model.x() && one.model.v() == other.model.v(),
            "the two kinds of files differ"
        );
    }
}
