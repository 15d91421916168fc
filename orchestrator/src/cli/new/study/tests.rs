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
            plies: None,
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
fn the_second_fibres_lie_as_the_material_says() {
    with_files(|root| {
        let text = "plyflow_material: 1\nname: cloth\nthickness: 0.3 mm\nareal_mass: 210 g/m2\n";
        for (with, second) in [
            ("with: {fibre_modulus: 3 GPa, crossing: 60 deg}\n", "105"),
            ("with:\n  crossing: 1 rad  # measured\n", "102.29578"),
            ("# crossing: 60 deg\nwith: {}\n", "135"),
        ] {
            std::fs::write(root.join("cloth.yaml"), format!("{text}{with}")).unwrap();
            let (files, _) = files(&args(root), &root.join("new/part"), None).unwrap();
            let says = format!("fibre_1: 45 deg\n    fibre_2: {second} deg");
            let scene = file(&files, "scene.yaml");
            assert!(scene.contains(&says), "{says}\n{scene}");
        }
    });
}

#[test]
fn under_a_single_film_plies_lie_on_the_tool() {
    with_files(|root| {
        let mut args = args(root);
        args.study.process = Some(StudyProcess::SingleDiaphragm);
        let (files, told) = files(&args, &root.join("single"), None).unwrap();
        let scene = file(&files, "scene.yaml");
        for says in [
            "  single_diaphragm:\n",
            "{name: film, kind: diaphragm, material: materials/stretchlon-ht350.yaml}",
            "tool_fabric: 0.23",
            "stretching_time: 40 ms",
            "weight: tool",
        ] {
            assert!(scene.contains(says), "{says}\n{scene}");
        }
        assert_eq!(scene.matches("kind: diaphragm").count(), 1, "{scene}");
        let at = |what: &str| scene.find(what).unwrap();
        assert!(at("name: ply_2") < at("name: film"), "{scene}");
        for word in ["bag_pressure", "film_joint_margin", "diaphragm_diaphragm"] {
            assert!(!scene.contains(word), "{word}\n{scene}");
        }
        assert!(file(&files, "workflow.yaml").contains("zone-extraction"));
        assert!(file(&files, "materials/stretchlon-ht350.yaml").contains("plyflow_material"));
        assert!(told.contains("--until coarse"), "{told}");
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
                "--tool FILE, --unit UNIT, --ply SIZE, --dxf FILE or --plies BOOK, --material NAME|FILE"
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
fn an_outline_of_a_drawing_stands_in_the_scene_and_needs_no_step() {
    with_files(|root| {
        let shipped = shipped::workflows().unwrap().join("files-of-others");
        let mut args = args(root);
        (args.study.ply, args.study.dxf) = (None, Some(shipped.join("blank.dxf")));
        args.study.layer = Some("PLY".into());
        let (files, told) = files(&args, &root.join("new"), None).unwrap();
        let scene = file(&files, "scene.yaml");
        assert_eq!(
            scene
                .matches("files-of-others/blank.dxf, layer: PLY, centred: true}}")
                .count(),
            2,
            "{scene}"
        );
        assert!(!scene.contains("    length: "), "{scene}");
        let workflow = file(&files, "workflow.yaml");
        assert!(!workflow.contains("geometry:"), "{workflow}");
        assert!(!told.contains("trust"), "{told}");
        args.study.layer = Some("GONE".into());
        let stop = super::files(&args, &root.join("new"), None).unwrap_err();
        assert!(
            stop.text
                .contains("blank.dxf:1:1: there is no curve on the layer `GONE`"),
            "{}",
            stop.text
        );
        // Where the drawing does not say its unit, the tool's is a guess that the scene names.
        let drawing = std::fs::read_to_string(shipped.join("blank.dxf")).unwrap();
        let bare = drawing.replace("$INSUNITS", "$OTHER");
        assert_ne!(bare, drawing);
        let path = root.join("bare.dxf");
        std::fs::write(&path, bare).unwrap();
        (args.study.dxf, args.study.layer) = (Some(path), None);
        let (files, _) = super::files(&args, &root.join("new"), None).unwrap();
        let scene = file(&files, "scene.yaml");
        assert!(
            scene.contains("unit: 1 mm, centred") && scene.contains("A guess: `unit`"),
            "{scene}"
        );
    });
}

/// A book of three plies with two outlines beside it, one of them a table without units, far from the tool.
fn book(root: &Utf8Path) -> Utf8PathBuf {
    let drawing = "0\nSECTION\n2\nHEADER\n9\n$INSUNITS\n70\n4\n0\nENDSEC\n0\nSECTION\n2\nENTITIES\n0\nLWPOLYLINE\n8\nA\n70\n1\n10\n0\n20\n0\n10\n400\n20\n0\n10\n400\n20\n200\n10\n0\n20\n200\n0\nENDSEC\n";
    std::fs::create_dir_all(root.join("plies")).unwrap();
    std::fs::write(root.join("plies/skin.dxf"), drawing).unwrap();
    std::fs::write(
        root.join("plies/cap.csv"),
        "x,y\n0,0\n300,0\n300,60\n0,60\n",
    )
    .unwrap();
    let table = "name,material,angle,outline,x [mm],y [mm],rotation\n\
                 skin,AS4,45,skin.dxf,12000,4000,\n\
                 cap,woven-38616,-45 deg,cap.csv,12200,4050,90\n\
                 strip,,0,,12200,4100,\n";
    let path = root.join("plies/book.csv");
    std::fs::write(&path, table).unwrap();
    path
}

#[test]
fn a_ply_book_stands_in_the_scene_with_what_it_leaves_open() {
    with_files(|root| {
        let mut args = args(root);
        (args.study.plies, args.study.angles) = (Some(book(root)), Vec::new());
        args.study.ply = Some("350 x 80 mm".into());
        let (files, told) = files(&args, &root.join("new"), None).unwrap();
        let scene = file(&files, "scene.yaml");
        for says in [
            "  - plies:\n      book: ../plies/book.csv\n",
            "      material: materials/cloth.yaml\n",
            // One name comes along, and the other stands for what is given.
            "      materials: {AS4: materials/cloth.yaml, woven-38616: materials/woven-38616.yaml}\n",
            "      length: 350 mm\n      width: 80 mm\n",
            "      unit: 1 mm\n",
            // The box of all is from (12000, 4000) to (12400, 4350).
            "      centre: [-12200 mm, -4175 mm]\n",
            "name: lower_film",
            "name: upper_film",
        ] {
            assert!(scene.contains(says), "{says}\n{scene}");
        }
        assert!(!scene.contains("fibre_1"), "{scene}");
        assert!(file(&files, "materials/woven-38616.yaml").contains("plyflow_material"));
        // The narrowest ply is 60 mm wide.
        let workflow = file(&files, "workflow.yaml");
        assert!(workflow.contains("element_size: 5 mm"), "{workflow}");
        assert!(told.contains("The book has 3 plies"), "{told}");
        args.study.process = Some(StudyProcess::Press);
        let (files, _) = super::files(&args, &root.join("new"), None).unwrap();
        assert!(file(&files, "scene.yaml").contains("plies:\n      book:"));
    });
}

#[test]
fn what_is_wrong_with_a_book_or_left_open_is_told_with_its_place() {
    with_files(|root| {
        let mut args = args(root);
        let path = book(root);
        (args.study.plies, args.study.angles) = (Some(path.clone()), Vec::new());
        let told = |args: &NewArgs| {
            let stop = files(args, &root.join("new"), None).unwrap_err();
            assert_eq!(stop.code, exit::USAGE, "{}", stop.text);
            stop.text
        };
        (args.study.ply, args.study.material) = (None, None);
        let open = told(&args);
        assert!(
            open.contains(
                "needs --ply SIZE (of the plies whose row has no outline), --material NAME|FILE"
            ),
            "{open}"
        );
        args.study.ply = Some("350 x 80 mm".into());
        args.study.material = Some("woven-38616".into());
        let of = |table: &str| {
            std::fs::write(&path, table).unwrap();
            told(&args)
        };
        for (table, says) in [
            ("name,angle\na,steep\n", "book.csv:2:3: `angle` is `steep`"),
            (
                "name,angle,outline\na,0,gone.dxf\n",
                "book.csv:2:5: cannot read `gone.dxf`: there is no such file",
            ),
            (
                "name,angle,outline,layer\na,0,skin.dxf,B\n",
                "skin.dxf:1:1: there is no curve on the layer `B`",
            ),
        ] {
            let text = of(table);
            assert!(text.contains(says), "{text}");
        }
        std::fs::write(&path, "name,angle,material,outline\na,0,wool,skin.dxf\n").unwrap();
        args.study.material = None;
        let wool = told(&args);
        assert!(
            wool.contains("the material `wool`: there is no such file")
                && wool.contains("--material"),
            "{wool}"
        );
    });
}
