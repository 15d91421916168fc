use super::*;
use crate::cli::args::{NewKind, StudyWords};

/// A block with walls that lean, in mm, with its up along y and far away.
fn block() -> String {
    let corner = |k: usize, high: bool| {
        let (x, y) = ([-1.0, 1.0, 1.0, -1.0][k], [-1.0, -1.0, 1.0, 1.0][k]);
        let by = if high { 5.0 } else { 0.0 };
        let (along, across, up) = (
            x * (150.0 - by),
            y * (60.0 - by),
            if high { 40.0 } else { 0.0 },
        );
        // Turned: up is y, along is x, across is -z.
        format!(
            "vertex {} {} {}\n",
            12_000.0 + along,
            900.0 + up,
            4_000.0 - across
        )
    };
    let mut text = String::from("solid block\n");
    let mut facet = |corners: [(usize, bool); 3]| {
        text += "facet normal 0 0 0\nouter loop\n";
        for (k, high) in corners {
            text += &corner(k, high);
        }
        text += "endloop\nendfacet\n";
    };
    facet([(0, true), (1, true), (2, true)]);
    facet([(0, true), (2, true), (3, true)]);
    facet([(0, false), (2, false), (1, false)]);
    facet([(0, false), (3, false), (2, false)]);
    for k in 0..4 {
        let n = (k + 1) % 4;
        facet([(k, false), (n, false), (n, true)]);
        facet([(k, false), (n, true), (k, true)]);
    }
    text + "endsolid block\n"
}

fn args(root: &Utf8Path) -> NewArgs {
    NewArgs {
        kind: NewKind::Study,
        name: "my-part".into(),
        into: None,
        study: StudyWords {
            tool: Some(root.join("my block.stl")),
            unit: Some("mm".into()),
            ply: Some("400 x 200 mm".into()),
            dxf: None,
            layer: None,
            material: Some(root.join("cloth.yaml").into()),
            angles: vec![45.0, -45.0],
            process: None,
        },
        python: false,
        rust: false,
        c: false,
        source: None,
    }
}

fn with_files(run: impl FnOnce(&Utf8Path)) {
    let dir = tempfile::tempdir().unwrap();
    let root = Utf8Path::from_path(dir.path()).unwrap();
    std::fs::write(root.join("my block.stl"), block()).unwrap();
    let material =
        "plyflow_material: 1\nname: cloth\nthickness: 0.3 mm  # measured\nareal_mass: 210 g/m2\n";
    std::fs::write(root.join("cloth.yaml"), material).unwrap();
    run(root);
}

fn file<'f>(files: &'f [(Utf8PathBuf, String)], name: &str) -> &'f str {
    let found = files.iter().find(|(path, _)| path == name);
    &found.unwrap_or_else(|| panic!("{name}")).1
}

#[test]
fn a_tool_drawn_elsewhere_is_placed_and_what_a_study_names_is_copied_into_it() {
    with_files(|root| {
        let args = args(root);
        let folder = root.join("new/my-part");
        let (files, told) = files(&args, &folder, None).unwrap();
        let scene = file(&files, "scene.yaml");
        for says in [
            "stl: {file: \"../../my block.stl\", unit: 1 mm, up: +y, centre: auto, foot: auto}",
            "# In its place it is 300 mm long, 120 mm wide and 40 mm high.",
            "material: materials/cloth.yaml\n    length: 400 mm\n    width: 200 mm\n    fibre_1: 45 deg\n    fibre_2: 135 deg",
            "name: ply_2",
            "fibre_1: -45 deg\n    fibre_2: 45 deg",
            "double_diaphragm:",
        ] {
            assert!(scene.contains(says), "{says}\n{scene}");
        }
        assert!(file(&files, "workflow.yaml").contains("element_size: 10 mm"));
        assert!(file(&files, "materials/cloth.yaml").contains("# measured"));
        assert!(file(&files, "materials/stretchlon-ht350.yaml").contains("plyflow_material"));
        assert!(
            told.contains("`up: +y, centre: auto, foot: auto`"),
            "{told}"
        );
        assert!(!folder.exists(), "nothing is written before all is known");
    });
}

#[test]
fn a_press_has_a_die_that_its_punch_goes_through_and_no_films() {
    with_files(|root| {
        let mut args = args(root);
        args.study.process = Some(StudyProcess::Press);
        let (files, _) = files(&args, &root.join("press"), None).unwrap();
        let scene = file(&files, "scene.yaml");
        // From the axis to a corner 161.6 mm, and 0.9 mm for two plies.
        for says in [
            "stroke: 40 mm",
            "forming_time: 320 ms",
            "opening_radius: 162.5 mm",
            "tool_fabric",
        ] {
            assert!(scene.contains(says), "{says}\n{scene}");
        }
        assert!(!scene.contains("diaphragm"), "{scene}");
        let workflow = file(&files, "workflow.yaml");
        assert!(
            workflow.contains("least_areal_mass: 0.21 kg/m2"),
            "{workflow}"
        );
        assert!(!workflow.contains("zone-extraction"), "{workflow}");
    });
}

#[test]
fn what_is_missing_or_wrong_is_told_with_what_would_do() {
    with_files(|root| {
        let told = |change: &dyn Fn(&mut StudyWords)| {
            let mut args = args(root);
            change(&mut args.study);
            let stop = files(&args, &root.join("new"), None).unwrap_err();
            assert_eq!(stop.code, exit::USAGE, "{}", stop.text);
            stop.text
        };
        let no_unit = told(&|w| w.unit = None);
        assert!(
            no_unit.contains("needs --unit UNIT") && no_unit.contains("300 x 40 x 120 mm in mm"),
            "{no_unit}"
        );
        let nothing = told(&|w| *w = StudyWords::default());
        assert!(
            nothing.contains(
                "--tool FILE, --unit UNIT, --ply SIZE or --dxf FILE, --material NAME|FILE"
            ),
            "{nothing}"
        );
        let material = told(&|w| w.material = Some("wool".into()));
        assert!(
            material.contains("--material wool") && material.contains("woven-38616"),
            "{material}"
        );
        let none = told(&|w| w.material = Some(root.join("my block.stl").into()));
        assert!(none.contains("it is no material"), "{none}");
        let tool = told(&|w| w.tool = Some(root.join("cloth.yaml")));
        assert!(
            tool.contains("cloth.yaml") && tool.contains("STEP"),
            "{tool}"
        );
        let gone = told(&|w| w.tool = Some(root.join("gone.stl")));
        assert!(gone.contains("gone.stl"), "{gone}");
        let ply = told(&|w| w.ply = Some("400".into()));
        assert!(ply.contains("--ply 400"), "{ply}");
        let angles = told(&|w| w.angles = vec![f64::NAN]);
        assert!(angles.contains("--angles"), "{angles}");
    });
}

#[test]
fn on_a_terminal_it_asks_and_shows_how_large_the_tool_would_be() {
    with_files(|root| {
        let mut args = args(root);
        let tool = args.study.tool.take().unwrap();
        args.study = StudyWords::default();
        let text = format!("{tool}\nin\n400 x 200 mm\nwoven-38616\n\n");
        let mut answers = text.as_bytes();
        let (files, _) = files(&args, &root.join("new"), Some(&mut answers)).unwrap();
        let scene = file(&files, "scene.yaml");
        assert!(
            scene.contains("unit: 1 in") && scene.contains("materials/woven-38616.yaml"),
            "{scene}"
        );
        assert!(scene.contains("fibre_1: 0 deg"), "{scene}");
    });
}

#[test]
fn an_outline_of_a_drawing_is_read_by_a_step_that_comes_along() {
    with_files(|root| {
        let shipped = shipped::workflows().unwrap().join("files-of-others");
        let mut args = args(root);
        (args.study.ply, args.study.dxf) = (None, Some(shipped.join("blank.dxf")));
        args.study.layer = Some("PLY".into());
        let (files, told) = files(&args, &root.join("new"), None).unwrap();
        let scene = file(&files, "scene.yaml");
        assert!(
            scene.contains("outline: {input: outline}") && !scene.contains("width: 200"),
            "{scene}"
        );
        let workflow = file(&files, "workflow.yaml");
        assert!(workflow.contains("plugin: ./dxf_outline.py"), "{workflow}");
        assert!(
            workflow.contains("blank.dxf, layers: {outline: PLY}, centred: true}"),
            "{workflow}"
        );
        assert_eq!(workflow.matches("geometry: blank").count(), 3, "{workflow}");
        assert!(
            workflow.contains("from: {boundary: boundary, geometry: blank}"),
            "{workflow}"
        );
        assert!(file(&files, "dxf_outline.py").contains("dxf-outline"));
        assert!(file(&files, "dxf_reading.py").contains("ezdxf"));
        assert!(
            told.contains("run --trust workflow.yaml --until drape"),
            "{told}"
        );
        args.study.layer = Some("GONE".into());
        let stop = super::files(&args, &root.join("new"), None).unwrap_err();
        assert!(
            stop.text.contains("on the layer `GONE`") && stop.text.contains("--ply '400"),
            "{}",
            stop.text
        );
    });
}
