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
