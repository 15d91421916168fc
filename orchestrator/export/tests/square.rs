//! Files of a sheared square, whose fibres, thickness and areal mass are closed forms.

#[path = "../examples/sheared-square.rs"]
#[allow(dead_code)]
mod square;

use plyflow_artifact::Artifact;
use plyflow_export::{ExportError, Exported, Format, Frames, LengthUnit, Request, export};
use std::path::PathBuf;

const ALL: [Format; 6] = [
    Format::Vtu,
    Format::Csv,
    Format::Abaqus,
    Format::Calculix,
    Format::Nastran,
    Format::Dxf,
];

/// The artifact without what is named, in a folder that goes with the first value.
fn artifact(without: &[&str]) -> (tempfile::TempDir, Artifact) {
    let dir = tempfile::tempdir().unwrap();
    let path: PathBuf = dir.path().join("square.vtkhdf");
    let words: Vec<String> = without.iter().map(ToString::to_string).collect();
    square::write(path.to_str().unwrap(), &words).unwrap();
    let artifact = Artifact::open(&path).unwrap();
    (dir, artifact)
}

fn request(format: Format) -> Request {
    Request {
        format,
        frames: Frames::Last,
        bodies: Vec::new(),
        unit: LengthUnit::Metre,
        net: 0.02,
        stem: "square".into(),
    }
}

fn text<'a>(made: &'a Exported, name: &str) -> &'a str {
    let names: Vec<&str> = made.files.iter().map(|f| f.name.as_str()).collect();
    let file = made.files.iter().find(|f| f.name == name);
    std::str::from_utf8(&file.unwrap_or_else(|| panic!("{names:?}")).content).unwrap()
}

/// A column of a table, by its head.
fn column(table: &str, head: &str) -> Vec<f64> {
    let mut lines = table.lines();
    let heads = lines.next().unwrap();
    let at = heads.split(',').position(|h| h == head);
    let at = at.unwrap_or_else(|| panic!("{head}: {heads}"));
    let value = |line: &str| line.split(',').nth(at).unwrap().parse().unwrap_or(f64::NAN);
    lines.map(value).collect()
}

/// Direction of a fibre of the flat angle `angle` (degrees) in the formed square, and the area over the flat one.
fn closed_form(angle: f64) -> ([f64; 3], f64) {
    let (sin, cos) = angle.to_radians().sin_cos();
    let (tilt_sin, tilt_cos) = square::TURN.sin_cos();
    let along = square::STRETCH * (cos + square::SHEAR.tan() * sin);
    let length = along.hypot(sin);
    (
        [
            along / length,
            tilt_cos * sin / length,
            tilt_sin * sin / length,
        ],
        square::STRETCH,
    )
}

#[test]
fn tables_have_fibres_thickness_and_mass_of_the_closed_form() {
    let (_keep, artifact) = artifact(&[]);
    let made = export(&artifact, &request(Format::Csv)).unwrap();
    assert_eq!(made.told, Vec::<String>::new());
    for (ply, number, first) in [("lower", 1.0, 0.0), ("upper-2", 2.0, 45.0)] {
        let table = text(&made, &format!("square-{ply}-cells.csv"));
        let mut directions = Vec::new();
        for family in 0..2 {
            let (expected, ratio) = closed_form(first + 90.0 * f64::from(family));
            for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
                let head = format!("fibre_direction_{}_{axis}", family + 1);
                let found = column(table, &head);
                assert_eq!(found.len(), 16);
                assert!(
                    found.iter().all(|v| (v - expected[k]).abs() < 1e-14),
                    "{head}: {found:?}"
                );
            }
            let close = |head: &str, value: f64| {
                let found = column(table, head);
                assert!(
                    found.iter().all(|v| (v - value).abs() < 1e-14 * value),
                    "{head}: {found:?}"
                );
            };
            close("thickness (m)", 0.0005 / ratio);
            close("areal_mass (kg/m2)", 0.44 / ratio);
            close("ply", number);
            // The square is tilted about x, so that x still is the axis on it: from there the fibre has turned by the shear and the stretch.
            let laid = (first + 90.0 * f64::from(family)).to_radians();
            let (tilt_sin, tilt_cos) = square::TURN.sin_cos();
            let across = tilt_cos * expected[1] + tilt_sin * expected[2];
            let turned = across.atan2(expected[0]) - laid;
            assert!(
                turned.abs() > 0.01 || (first == 0.0 && family == 0),
                "{turned}"
            );
            let found = column(table, &format!("fibre_deviation_{} (rad)", family + 1));
            assert!(
                found.len() == 16 && found.iter().all(|v| (v - turned).abs() < 1e-14),
                "{ply}, family {family}: {found:?}, not {turned}"
            );
            directions.push(expected);
        }
        let cosine: f64 = (0..3).map(|k| directions[0][k] * directions[1][k]).sum();
        let angles = column(table, "fibre_angle (rad)");
        assert!(
            angles.iter().all(|a| (a - cosine.acos()).abs() < 1e-14),
            "{angles:?}"
        );
        assert!(
            column(table, "shear_angle (rad)")
                .iter()
                .all(|v| *v == f64::from(square::SHEAR as f32))
        );
    }
}

/// Angle (degrees) of the steered fibres of the square at x (m): between the two points of their table the vectors at twice the angle are mixed.
fn steered(first: f64, x: f64) -> f64 {
    let share = x / square::LENGTH + 0.5;
    let ends = [first.to_radians(), first.to_radians() + square::STEERED];
    let mixed = |of: fn(f64) -> f64| (1.0 - share) * of(2.0 * ends[0]) + share * of(2.0 * ends[1]);
    (0.5 * mixed(f64::sin).atan2(mixed(f64::cos))).to_degrees()
}

#[test]
fn steered_fibres_have_the_closed_form_of_each_place_in_tables_and_drawings() {
    let (_keep, artifact) = artifact(&["straight"]);
    let made = export(&artifact, &request(Format::Csv)).unwrap();
    assert_eq!(made.told, Vec::<String>::new());
    let step = square::LENGTH / 4.0;
    for (ply, first) in [("lower", 0.0), ("upper-2", 45.0)] {
        let table = text(&made, &format!("square-{ply}-cells.csv"));
        let along_x = column(table, "fibre_direction_1_x");
        let across_x = column(table, "fibre_direction_2_x");
        let turned = column(table, "fibre_deviation_1 (rad)");
        for cell in 0..16 {
            let x = (cell % 4) as f64 * step + 0.5 * step - 0.5 * square::LENGTH;
            let angle = steered(first, x);
            let expected = closed_form(angle).0;
            assert!((along_x[cell].abs() - expected[0].abs()).abs() < 1e-13);
            assert!((across_x[cell].abs() - closed_form(angle + 90.0).0[0].abs()).abs() < 1e-13);
            let (tilt_sin, tilt_cos) = square::TURN.sin_cos();
            let across = tilt_cos * expected[1] + tilt_sin * expected[2];
            let wanted = across.atan2(expected[0]) - angle.to_radians();
            assert!(
                (turned[cell] - wanted).abs() < 1e-13,
                "{}, {wanted}",
                turned[cell]
            );
        }
    }
    // Whatever the unit, lines follow the directions.
    for (unit, metres) in [(LengthUnit::Metre, 1.0), (LengthUnit::Millimetre, 1e-3)] {
        let drawing = export(
            &artifact,
            &Request {
                unit,
                ..request(Format::Dxf)
            },
        )
        .unwrap();
        let flat = text(&drawing, "square-flat.dxf");
        let words: Vec<&str> = flat.lines().map(str::trim).collect();
        let mut checked = 0;
        for (k, _) in words
            .iter()
            .enumerate()
            .filter(|(_, w)| **w == "LWPOLYLINE")
        {
            let end =
                (k + 1..words.len()).find(|i| words[*i] == "LWPOLYLINE" || words[*i] == "ENDSEC");
            let own = &words[k..end.unwrap_or(words.len())];
            let pairs: Vec<(&str, &str)> = own[1..].chunks_exact(2).map(|p| (p[0], p[1])).collect();
            let layer = pairs.iter().find(|p| p.0 == "8").unwrap().1;
            if layer != "lower-fibres_1" {
                continue;
            }
            let of = |code: &str| -> Vec<f64> {
                let all = pairs.iter().filter(|p| p.0 == code);
                all.map(|p| p.1.parse::<f64>().unwrap() * metres).collect()
            };
            let (x, y) = (of("10"), of("20"));
            assert!(x.len() > 2, "a curve has more than its ends");
            for i in 1..x.len() {
                let [a, b] = [x[i] - x[i - 1], y[i] - y[i - 1]];
                let angle = steered(0.0, 0.5 * (x[i] + x[i - 1])).to_radians();
                // Across the chord of a step, of which the curve bends by less than 0.1 rad.
                let off = (b * angle.cos() - a * angle.sin()).abs();
                assert!(
                    off < 1e-3 * a.hypot(b) + 1e-9,
                    "{off} of {} at {}, {}: point {i} of {}",
                    a.hypot(b),
                    x[i],
                    y[i],
                    x.len()
                );
                checked += 1;
            }
        }
        assert!(checked > 20, "{checked}");
    }
}

#[test]
fn lengths_are_in_the_unit_that_was_asked_for_and_nothing_else_is() {
    let (_keep, artifact) = artifact(&[]);
    let of = |unit: LengthUnit| {
        let made = export(
            &artifact,
            &Request {
                unit,
                ..request(Format::Csv)
            },
        )
        .unwrap();
        let points = text(&made, "square-lower-points.csv").to_owned();
        (points, text(&made, "square-lower-cells.csv").to_owned())
    };
    let (metres, mm, inches) = (
        of(LengthUnit::Metre),
        of(LengthUnit::Millimetre),
        of(LengthUnit::Inch),
    );
    for (head, [a, b, c], [m, n, i]) in [
        (
            "x",
            [&metres.0, &mm.0, &inches.0],
            ["x (m)", "x (mm)", "x (in)"],
        ),
        (
            "undeformed",
            [&metres.0, &mm.0, &inches.0],
            ["undeformed_y (m)", "undeformed_y (mm)", "undeformed_y (in)"],
        ),
        (
            "thickness",
            [&metres.1, &mm.1, &inches.1],
            ["thickness (m)", "thickness (mm)", "thickness (in)"],
        ),
    ] {
        let (a, b, c) = (column(a, m), column(b, n), column(c, i));
        for k in 0..a.len() {
            assert!((b[k] - 1000.0 * a[k]).abs() < 1e-12, "{head}");
            assert!((0.0254 * c[k] - a[k]).abs() < 1e-15, "{head}");
        }
    }
    for head in ["areal_mass (kg/m2)", "fibre_angle (rad)"] {
        assert_eq!(column(&metres.1, head), column(&mm.1, head));
    }
    assert_eq!(
        column(&metres.0, "contact_pressure (Pa)"),
        column(&mm.0, "contact_pressure (Pa)")
    );
}

#[test]
fn what_the_artifact_does_not_tell_is_said_and_not_written() {
    for (without, field, said) in [
        (
            "fibres",
            "fibre_direction_1_x",
            "does not tell its fibre directions",
        ),
        ("thickness", "thickness (m)", "does not tell its thickness"),
        ("mass", "areal_mass (kg/m2)", "does not tell its areal mass"),
    ] {
        let (_keep, artifact) = artifact(&[without]);
        let made = export(&artifact, &request(Format::Csv)).unwrap();
        for ply in ["lower", "upper-2"] {
            let table = text(&made, &format!("square-{ply}-cells.csv"));
            assert!(!table.lines().next().unwrap().contains(field), "{without}");
            assert!(
                made.told
                    .iter()
                    .any(|t| t.starts_with(ply) && t.contains(said)),
                "{:?}",
                made.told
            );
        }
    }
    // A deck without what its sections need has the meshes, and says so.
    let (_keep, artifact) = artifact(&["thickness"]);
    for (format, name, word) in [
        (Format::Abaqus, "square.inp", "*Shell Section"),
        (Format::Calculix, "square.inp", "*Shell Section"),
        (Format::Nastran, "square.bdf", "PSHELL"),
    ] {
        let made = export(&artifact, &request(format)).unwrap();
        assert!(!text(&made, name).contains(word));
        let said = made
            .told
            .iter()
            .filter(|t| t.contains("only its mesh is written"));
        assert_eq!(said.count(), 2, "{:?}", made.told);
    }
}

#[test]
fn a_cell_that_a_drape_does_not_reach_is_in_no_deck_and_empty_in_tables() {
    let (_keep, artifact) = artifact(&["drape"]);
    let made = export(&artifact, &request(Format::Csv)).unwrap();
    let thickness = column(text(&made, "square-lower-cells.csv"), "thickness (m)");
    assert!(thickness[0].is_nan() && thickness[1..].iter().all(|t| t.is_finite()));
    let made = export(&artifact, &request(Format::Abaqus)).unwrap();
    assert!(
        made.told
            .iter()
            .any(|t| t.contains("lower: 1 of 16 cells have no shape")),
        "{:?}",
        made.told
    );
    // 15 and 16 elements, each in two distributions of axes and one of the thickness; the corner node of the cell alone is gone.
    let deck = text(&made, "square.inp");
    let rows = |from: &str| {
        let after = deck.split(from).nth(1).unwrap();
        after
            .lines()
            .skip(1)
            .take_while(|l| !l.starts_with('*'))
            .count()
    };
    // Readers of meshes take one block of nodes, and forget all but the last of several.
    assert_eq!(deck.matches("*Node\n").count(), 1);
    assert_eq!(rows("*Node\n"), 24 + 25 - 1);
    assert!(deck.contains("*Nset, nset=LOWER, generate\n1, 24, 1\n"));
    assert!(deck.contains("*Nset, nset=UPPER_2, generate\n25, 49, 1\n"));
    assert_eq!(rows("*Element, type=S4, elset=LOWER"), 15);
    assert_eq!(rows("*Element, type=S4, elset=UPPER_2"), 16);
    assert_eq!(rows("*Distribution, name=LOWER_FIBRE_2_AXES"), 1 + 15);
    let drawing = export(&artifact, &request(Format::Dxf)).unwrap();
    // Without an outline in the attributes the pattern is that of the mesh: 16 nodes. The draped part has one corner less and three nodes more.
    let flat = text(&drawing, "square-flat.dxf");
    let vertices: Vec<&str> = flat
        .split("LWPOLYLINE\n")
        .skip(1)
        .map(|e| e.split("90\n").nth(1).unwrap().lines().next().unwrap())
        .collect();
    assert_eq!(vertices[..2], ["16", "16"]);
}

#[test]
fn all_formats_give_the_same_bytes_each_time_and_names_that_differ() {
    let (_keep, artifact) = artifact(&["drape"]);
    for format in ALL {
        let (one, two) = (
            export(&artifact, &request(format)).unwrap(),
            export(&artifact, &request(format)).unwrap(),
        );
        assert_eq!(one, two, "{}", format.name());
        let mut names: Vec<&str> = one.files.iter().map(|f| f.name.as_str()).collect();
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), count);
        assert!(one.files.iter().all(|f| !f.content.is_empty()));
    }
}

#[test]
fn series_name_all_frames_and_single_bodies_need_no_file_of_blocks() {
    let (_keep, artifact) = artifact(&[]);
    let made = export(
        &artifact,
        &Request {
            frames: Frames::All,
            ..request(Format::Vtu)
        },
    )
    .unwrap();
    let series = text(&made, "square.pvd");
    for (time, name) in [("0", "square-0000.vtm"), ("0.25", "square-0001.vtm")] {
        assert!(
            series.contains(&format!("timestep=\"{time}\" part=\"0\" file=\"{name}\"")),
            "{series}"
        );
        assert!(text(&made, name).contains("name=\"upper-2\""));
    }
    let bodies = vec!["film".to_owned()];
    let made = export(
        &artifact,
        &Request {
            bodies,
            ..request(Format::Vtu)
        },
    )
    .unwrap();
    let names: Vec<&str> = made.files.iter().map(|f| f.name.as_str()).collect();
    assert_eq!(names, ["square-film.vtu"]);
}

#[test]
fn what_is_not_there_is_refused_with_what_is() {
    let (_keep, artifact) = artifact(&[]);
    let of = |request: Request| export(&artifact, &request).unwrap_err().to_string();
    let named = |name: &str, format| Request {
        bodies: vec![name.into()],
        ..request(format)
    };
    let said = of(named("ply", Format::Csv));
    assert_eq!(
        said,
        "--body ply: the artifact has no such body; there are: lower, film, upper-2, tool"
    );
    let said = of(named("tool", Format::Dxf));
    assert_eq!(
        said,
        "--body tool: dxf is written of plies, and it is none; the plies are: lower, upper-2"
    );
    let said = of(Request {
        frames: Frames::At(2),
        ..request(Format::Vtu)
    });
    assert_eq!(said, "--frame 2: the artifact has 2 frames, from 0 to 1");
    let error = export(
        &artifact,
        &Request {
            net: 1e-6,
            ..request(Format::Dxf)
        },
    )
    .unwrap_err();
    assert!(matches!(error, ExportError::Net { .. }));
    assert!(
        error.to_string().contains(
            "fibre lines; expected at most 10000: give a larger distance, such as --net '"
        ),
        "{error}"
    );
}

#[test]
fn names_that_are_nearly_alike_stay_apart_in_every_format() {
    let (_keep, artifact) = artifact(&["names"]);
    let of = |format| export(&artifact, &request(format)).unwrap();
    for format in [Format::Abaqus, Format::Calculix] {
        let made = of(format);
        let deck = text(&made, "square.inp");
        for material in ["GEWEBE__", "GEWEBE___2"] {
            assert!(
                deck.contains(&format!(", 3, {material}, ")),
                "{material}: {deck:.2000}"
            );
        }
        let told =
            "materials GEWEBE__ (`Gewebe \u{e4}`), GEWEBE___2 (`Gewebe \u{f6}`) in your model";
        assert!(
            made.told.iter().any(|t| t.contains(told)),
            "{:?}",
            made.told
        );
    }
    let made = of(Format::Dxf);
    let drawing = text(&made, "square-flat.dxf");
    let layers: Vec<&str> = drawing.split("AcDbLayerTableRecord\n").skip(1).collect();
    let mut layers: Vec<String> = (layers.iter())
        .map(|l| l.lines().nth(1).unwrap().to_lowercase())
        .collect();
    assert_eq!(layers.len(), 1 + 2 * 4, "{layers:?}");
    layers.sort_unstable();
    layers.dedup();
    assert_eq!(layers.len(), 1 + 2 * 4, "{layers:?}");
    let told = "A-Draped: its layers are called `A-Draped_2`";
    assert!(
        made.told.iter().any(|t| t.contains(told)),
        "{:?}",
        made.told
    );
}
