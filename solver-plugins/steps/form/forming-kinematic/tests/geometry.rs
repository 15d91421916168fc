//! A tool and outlines that another step makes, behind a host in memory.

use plyflow_forming_kinematic::FormingKinematic;
use plyflow_testing::{MemoryArtifact, MemoryBody, MemoryInput, run};
use plyflow_tooling::ToolMesh;
use serde_json::{Value, json};

fn material(name: &str, thickness: f64) -> Value {
    json!({
        "plyflow_material": 1, "name": name, "plugin": "none", "thickness": format!("{thickness} m"),
        "areal_mass": "0.4 kg/m2", "with": {},
    })
}

/// A scene of one ply, as the host hands it over.
fn scene(tool: Value, outline: Value, holes: Value) -> Value {
    let film =
        |name: &str| json!({"name": name, "kind": "diaphragm", "material": material("film", 8e-5)});
    json!({
        "plyflow_scene": 1, "name": "test", "tool": tool,
        "sheets": [film("lower"), {
            "name": "ply", "kind": "ply", "material": material("woven", 3e-4), "outline": outline, "holes": holes,
            "centre": ["0.002 m", "0 m"], "fibre_1": "0 deg", "fibre_2": "90 deg",
        }, film("upper")],
        "friction": {"tool_diaphragm": 0.5, "fabric_diaphragm": 0.4, "fabric_fabric": 0.3, "diaphragm_diaphragm": 0.3},
        "process": {"double_diaphragm": {
            "frame_length": "1 m", "frame_width": "1 m", "clearance": "0.005 m", "bag_pressure": "1e5 Pa",
            "forming_pressure": "1e5 Pa", "bagging_time": "0.1 s", "lowering_time": "0.1 s",
            "drawing_time": "0.1 s", "settling_time": "0.1 s", "film_joint_margin": "0.03 m",
        }},
    })
}

fn asking() -> Value {
    let tool = json!({"input": {"body": "dome"}});
    scene(tool, json!({"input": "blank"}), json!([]))
}

fn dome() -> ToolMesh {
    let words = json!({"hemisphere": {"radius": "0.05 m", "facet_size": "0.006 m"}});
    plyflow_tooling::build(&serde_json::from_value(words).unwrap()).unwrap()
}

const OUTLINE: [f64; 8] = [-0.03, -0.025, 0.03, -0.025, 0.03, 0.025, -0.03, 0.025];
const HOLE: [f64; 8] = [-0.012, -0.01, -0.012, 0.01, 0.004, 0.01, 0.004, -0.01];

/// What a step gives: the dome whose corners have gone through single precision and mm, as those of an STL file have, and an outline.
fn made() -> MemoryArtifact {
    let mesh = dome();
    let rounded = mesh.points.iter();
    let rounded = rounded.map(|p| p.map(|c| f64::from((1e3 * c) as f32) * 1e-3));
    let body = MemoryBody {
        name: "dome".into(),
        points: rounded.collect(),
        nodes_per_cell: 3,
        cells: mesh.triangles.as_flattened().to_vec(),
        ..Default::default()
    };
    let corners = |v: [f64; 8]| (vec![4, 2], v.to_vec());
    MemoryArtifact {
        kind: "geometry".into(),
        attributes: json!({"outlines": ["blank"]}),
        arrays: [
            ("outlines/blank/outline".to_owned(), corners(OUTLINE)),
            ("outlines/blank/hole_0".to_owned(), corners(HOLE)),
        ]
        .into(),
        bodies: vec![body],
        ..Default::default()
    }
}

fn drape(scene: Value, given: &[MemoryInput<'_>]) -> Result<MemoryArtifact, String> {
    let with = json!({"scene": scene, "element_size": 0.005, "net_spacing": 0.002});
    run::<FormingKinematic>(with, given, &[])
}

fn refused(scene: Value, given: &[MemoryInput<'_>]) -> String {
    drape(scene, given).unwrap_err()
}

/// What a step called `cad` gives.
fn of_cad(artifact: &MemoryArtifact) -> MemoryInput<'_> {
    MemoryInput {
        step: "cad",
        ..MemoryInput::new("geometry", artifact)
    }
}

#[test]
fn what_a_step_makes_is_draped_as_the_file_and_the_points_with_the_same_numbers() {
    let mesh = dome();
    let facets: Vec<[[f64; 3]; 3]> = (0..mesh.triangles.len())
        .map(|t| mesh.corners(t).map(|p| p.map(|c| 1e3 * c)))
        .collect();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("dome.stl");
    std::fs::write(&file, plyflow_files::stl::write(&facets)).unwrap();
    let listed = |v: [f64; 8]| -> Value {
        let corners = v.as_chunks::<2>().0.iter();
        corners
            .map(|[x, y]| json!([format!("{x} m"), format!("{y} m")]))
            .collect()
    };
    let tool = json!({"stl": {"file": file.to_str().unwrap(), "unit": "1 mm"}});
    let by_file = drape(scene(tool, listed(OUTLINE), json!([listed(HOLE)])), &[]).unwrap();
    let made = made();
    let by_step = drape(asking(), &[of_cad(&made)]).unwrap();
    assert!(by_file.result("elements") > 50.0 && by_file.result("coverage") == 1.0);
    assert_eq!(by_step.bodies, by_file.bodies);
    assert_eq!(by_step.attributes, by_file.attributes);
    assert_eq!(by_step.results, by_file.results);
    assert_eq!(by_step.log, by_file.log);
}

/// A block of 160 x 120 x 20 mm with rounded edges, its corners rounded to 1 nm: what decimals of a file say.
fn rounded_block() -> ToolMesh {
    let words = json!({"flat": {"length": "0.16 m", "width": "0.12 m", "height": "0.02 m", "fillet": "0.005 m", "facet_size": "0.01 m"}});
    let mut mesh = plyflow_tooling::build(&serde_json::from_value(words).unwrap()).unwrap();
    let points = mesh.points.iter_mut();
    points.for_each(|p| *p = p.map(|c| (c * 1e9).round() / 1e9));
    mesh
}

/// Writes a tool as text with all digits; `put` takes m to the units of the file.
fn write_text(path: &std::path::Path, mesh: &ToolMesh, put: impl Fn([f64; 3]) -> [f64; 3]) {
    let mut text = String::from("solid tool\n");
    for t in 0..mesh.triangles.len() {
        text += "facet normal 0 0 0\nouter loop\n";
        for p in mesh.corners(t) {
            let [x, y, z] = put(p);
            text += &format!("vertex {x} {y} {z}\n");
        }
        text += "endloop\nendfacet\n";
    }
    std::fs::write(path, text + "endsolid tool\n").unwrap();
}

/// From m to inches of an aircraft: the tool's x is z there, its y is x, up is y, and the place is some 20 m off.
fn to_aircraft([x, y, z]: [f64; 3]) -> [f64; 3] {
    [y + 4.123, z - 1.5, x + 20.456].map(|c| c / 0.0254)
}

#[test]
fn a_tool_in_aircraft_coordinates_and_inches_is_draped_as_the_one_in_its_place_to_the_bit() {
    let block = rounded_block();
    let folder = tempfile::tempdir().unwrap();
    let [here, there] = ["here.stl", "there.stl"].map(|n| folder.path().join(n));
    write_text(&here, &block, |p| p.map(|c| (c * 1e9).round() / 1e6));
    write_text(&there, &block, to_aircraft);
    let listed = json!([
        ["-0.05 m", "-0.04 m"],
        ["0.06 m", "-0.04 m"],
        ["0.05 m", "0.04 m"],
        ["-0.05 m", "0.03 m"]
    ]);
    let formed = |tool: Value| drape(scene(tool, listed.clone(), json!([])), &[]);
    let stl = |file: &std::path::Path, words: Value| {
        let mut all = words;
        all["file"] = json!(file.to_str().unwrap());
        json!({ "stl": all })
    };
    let own = formed(stl(&here, json!({"unit": "1 mm"}))).unwrap();
    let words =
        json!({"unit": "1 in", "up": "+y", "rotate": "90 deg", "centre": "auto", "foot": "auto"});
    let placed = formed(stl(&there, words)).unwrap();
    assert!(own.result("elements") > 50.0 && own.result("coverage") == 1.0);
    assert_eq!(placed.bodies, own.bodies);
    assert_eq!(placed.results, own.results);
    assert!(own.attributes.get("tool_placement").is_none());

    // The matrix takes the file, in m, to the scene.
    let told = &placed.attributes["tool_placement"];
    assert_eq!(told["unit"], json!(0.0254));
    let matrix: [[f64; 4]; 4] = serde_json::from_value(told["matrix"].clone()).unwrap();
    for p in &block.points {
        let q = to_aircraft(*p).map(|c| c * 0.0254);
        for k in 0..3 {
            let [a, b, c, d] = matrix[k];
            let found = a * q[0] + b * q[1] + c * q[2] + d;
            assert!((found - p[k]).abs() < 2e-14, "{found} {}", p[k]);
        }
    }
    assert!(
        placed
            .log
            .iter()
            .any(|l| format!("{l:?}").contains("put in its place by the matrix")),
        "{:?}",
        placed.log
    );

    // Not by quarters: the same to 1e-9 m.
    let (sine, cosine) = 0.4_f64.sin_cos();
    let turned =
        |[x, y, z]: [f64; 3]| [cosine * x - sine * y + 7.0, sine * x + cosine * y, z - 2.0];
    write_text(&there, &block, turned);
    let words = json!({"unit": "1 m", "rotate": "-0.4 rad", "centre": "auto", "foot": "auto"});
    let askew = formed(stl(&there, words)).unwrap();
    for (one, other) in askew.bodies.iter().zip(&own.bodies) {
        assert_eq!(one.cells, other.cells);
        for (p, q) in one.points.iter().zip(&other.points) {
            assert!((0..3).all(|k| (p[k] - q[k]).abs() < 1e-9), "{p:?} {q:?}");
        }
    }

    // A body of a step takes the same words.
    let body = MemoryBody {
        name: "dome".into(),
        points: block
            .points
            .iter()
            .map(|p| to_aircraft(*p).map(|c| c * 0.0254))
            .collect(),
        nodes_per_cell: 3,
        cells: block.triangles.as_flattened().to_vec(),
        ..Default::default()
    };
    let given = MemoryArtifact {
        kind: "geometry".into(),
        attributes: json!({}),
        bodies: vec![body],
        ..Default::default()
    };
    let words = json!({"input": {"body": "dome", "up": "+y", "rotate": "90 deg", "centre": "auto", "foot": "auto"}});
    let by_step = drape(scene(words, listed.clone(), json!([])), &[of_cad(&given)]).unwrap();
    assert_eq!(by_step.bodies, own.bodies);
    let as_given = json!({"input": {"body": "dome"}});
    let told = refused(
        scene(as_given, listed.clone(), json!([])),
        &[of_cad(&given)],
    );
    assert!(
        told.contains("`tool: {input: {body: dome, up: +y, centre: auto, foot: auto}}`"),
        "{told}"
    );
}

#[test]
fn tool_and_outline_may_come_from_two_steps_and_a_name_from_one_alone() {
    let (mut tool, mut outline) = (made(), made());
    tool.arrays.clear();
    tool.attributes = json!({});
    outline.bodies.clear();
    let drawn = MemoryInput {
        step: "dxf",
        ..of_cad(&outline)
    };
    let both = drape(asking(), &[of_cad(&tool), drawn]).unwrap();
    let made = made();
    let one = drape(asking(), &[of_cad(&made)]).unwrap();
    assert_eq!(both.bodies, one.bodies);
    let other = MemoryInput {
        step: "old",
        item: &[2],
        ..of_cad(&tool)
    };
    let twice = refused(asking(), &[of_cad(&made), other]);
    assert!(
        twice.contains(
            "scene.tool.input.body: the steps `cad` and `old[2]`, both wired to `geometry`, have the body `dome`"
        ),
        "{twice}"
    );
}

#[test]
fn what_does_not_arrive_or_is_something_else_is_told_with_its_place_and_step() {
    let none = refused(asking(), &[]);
    assert!(none.contains("scene.tool.input.body: the body `dome` is to come from another step, and none is wired to `geometry`"), "{none}");
    let told = |change: &dyn Fn(&mut MemoryArtifact)| {
        let mut changed = made();
        change(&mut changed);
        refused(asking(), &[of_cad(&changed)])
    };
    let quads = told(&|a| {
        let body = &mut a.bodies[0];
        body.nodes_per_cell = 4;
        body.cells.truncate(body.cells.len() / 4 * 4);
    });
    assert!(
        quads.contains(
            "the cells of the body `dome` of step `cad` have 4 nodes; expected triangles"
        ),
        "{quads}"
    );
    let spatial = told(&|a| {
        let outline = a.arrays.get_mut("outlines/blank/outline").unwrap();
        *outline = (vec![4, 3], vec![0.0; 12]);
    });
    assert!(
        spatial.contains("scene.sheets[1].outline.input: the array `outlines/blank/outline` of step `cad` has the shape [4, 3]; expected [n, 2]"),
        "{spatial}"
    );
    let far = told(&|a| {
        a.arrays.get_mut("outlines/blank/hole_0").unwrap().1[3] = f64::INFINITY;
    });
    assert!(
        far.contains("corner 1, counted from 0, of the array `outlines/blank/hole_0` of step `cad` is (-0.012, inf)"),
        "{far}"
    );
    let hole = told(&|a| a.arrays.get_mut("outlines/blank/hole_0").unwrap().1[0] = -0.05);
    assert!(
        hole.contains("outline `blank` of step `cad` bounds no region: holes[0]"),
        "{hole}"
    );
    let turned = told(&|a| a.bodies[0].cells.as_chunks_mut::<3>().0[4].swap(0, 1));
    assert!(
        turned.contains("scene.tool.input: body `dome` of step `cad`: the two facets at the edge")
            && turned.contains("triangle "),
        "{turned}"
    );
    let floating = told(&|a| a.bodies[0].points.iter_mut().for_each(|p| p[2] += 0.003));
    assert!(
        floating.contains(
            "scene.tool.input: the lowest point of body `dome` of step `cad` lies at z = 3.000 mm"
        ) && floating.contains("`translate: [0 mm, 0 mm, -3 mm]`"),
        "{floating}"
    );
    let speck = told(&|a| {
        let points = a.bodies[0].points.iter_mut();
        points.for_each(|p| *p = p.map(|c| 1e-3 * c));
    });
    assert!(
        speck.contains("scene.tool.input: body `dome` of step `cad` spans 0.100 x")
            && speck.contains("are the points of the step's artifact in m?"),
        "{speck}"
    );
}

#[test]
fn geometry_without_a_use_is_told() {
    let tool = json!({"hemisphere": {"radius": "0.05 m", "facet_size": "0.006 m"}});
    let points = json!([
        ["-0.03 m", "-0.02 m"],
        ["0.03 m", "-0.02 m"],
        ["0 m", "0.03 m"]
    ]);
    let made = made();
    let draped = drape(scene(tool, points, json!([])), &[of_cad(&made)]).unwrap();
    let says = "geometry: step `cad` is wired to `geometry`, and no word of the scene asks for anything of it (`tool: {input: {body: dome}}`, \
                `outline: {input: blank}`)";
    assert!(
        draped.log.iter().any(|line| line.contains(says)),
        "{:?}",
        draped.log
    );
}
